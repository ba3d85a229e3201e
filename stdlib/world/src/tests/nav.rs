//! Driving against brute force: distances cell by cell, ways step by step.

use nalgebra::{Isometry3, Vector2, Vector3};

use super::{Dice, one_arm, pr2};
use crate::nav::convex::Polygon;
use crate::nav::{
    Barrier, Blocker, Costmap, Drive, Flood, Footprint, Grid, Map, NoWay, Place, Room, Settings, Speeds,
    normal_angle,
};
use crate::robot::chain::DriveKind;
use crate::shape::{PosedShape, Shape};

use DriveKind::{Differential, Omnidirectional};

fn block(size: (f64, f64, f64)) -> PosedShape {
    PosedShape {
        pose: Isometry3::identity(),
        shape: Shape::Box { size: Vector3::new(size.0, size.1, size.2) },
    }
}

fn at(x: f64, y: f64, z: f64) -> Isometry3<f64> {
    Isometry3::translation(x, y, z)
}

/// Barriers that own their shapes.
#[derive(Default)]
struct Things(Vec<(Isometry3<f64>, Vec<PosedShape>, bool)>);

impl Things {
    fn add(&mut self, pose: Isometry3<f64>, size: (f64, f64, f64), fixed: bool) {
        self.0.push((pose, vec![block(size)], fixed));
    }

    fn map(&self, footprint: Footprint) -> Map {
        let barriers: Vec<Barrier> = self
            .0
            .iter()
            .map(|(pose, shapes, fixed)| Barrier { pose: *pose, shapes, fixed: *fixed })
            .collect();
        Map::new(room(), &barriers, footprint, Settings::default())
    }

    /// Walls and some boxes, none at the middle.
    fn random(dice: &mut Dice) -> Things {
        let mut things = Things::default();
        for _ in 0..8 {
            let size = (0.1 + dice.unit(), 0.1 + 1.5 * dice.unit(), 0.1 + dice.unit());
            let (x, y) = (4.0 * dice.unit() - 2.0, 4.0 * dice.unit() - 2.0);
            if x.hypot(y) > 0.8 {
                let pose =
                    Isometry3::new(Vector3::new(x, y, size.2 * 0.5), Vector3::z() * (6.0 * dice.unit()));
                things.add(pose, size, dice.unit() < 0.5);
            }
        }
        things
    }
}

fn room() -> Room {
    Room { low: Vector2::new(-3.0, -3.0), high: Vector2::new(3.0, 3.0) }
}

fn footprint() -> Footprint {
    let (robot, limbs) = pr2();
    let mut configuration = robot.zero();
    for arm in &limbs.arms {
        arm.chain.place(&arm.park, &mut configuration);
    }
    Footprint::of_robot(&robot, &configuration, &[])
}

/// A base like a plank: 0.9 m long, 0.4 m wide.
fn plank() -> Footprint {
    let shape = PosedShape { pose: at(0.1, 0.0, 0.2), ..block((0.9, 0.4, 0.3)) };
    Footprint::new(&[shape], &[])
}

/// All places of a drive in small steps.
fn steps(drive: &Drive) -> Vec<Place> {
    let mut places = Vec::new();
    for pair in drive.places.windows(2) {
        let (from, to) = (pair[0], pair[1]);
        let size = (to.point() - from.point()).norm().max((to.yaw - from.yaw).abs());
        let count = (size / 0.01).ceil().max(1.0);
        for step in 0..=count as usize {
            let share = step as f64 / count;
            let point = from.point().lerp(&to.point(), share);
            places.push(Place::new(point.x, point.y, from.yaw + (to.yaw - from.yaw) * share));
        }
    }
    places
}

#[test]
fn distances_are_those_of_brute_force() {
    let mut dice = Dice::new(1);
    for round in 0..30 {
        let size = Vector2::new(1.0 + 4.0 * dice.unit(), 1.0 + 4.0 * dice.unit());
        let grid = Grid::over(Vector2::zeros(), size, 0.1);
        let mut bits = vec![0_u64; grid.width.div_ceil(64) * grid.height];
        let cells: Vec<usize> = (0..1 + round).map(|_| dice.below(grid.len())).collect();
        for cell in &cells {
            let (row, column) = (cell / grid.width, cell % grid.width);
            bits[row * grid.width.div_ceil(64) + column / 64] |= 1 << (column % 64);
        }
        let got = grid.distances(&bits);
        for (cell, got) in got.iter().enumerate() {
            let squared = |other: &usize| {
                let rows = (cell / grid.width).abs_diff(other / grid.width);
                let columns = (cell % grid.width).abs_diff(other % grid.width);
                (rows * rows + columns * columns) as u32
            };
            assert_eq!(Some(*got), cells.iter().map(squared).min());
        }
    }
}

#[test]
fn polygons_are_filled_cell_by_cell() {
    let mut dice = Dice::new(2);
    let grid = Grid::over(Vector2::zeros(), Vector2::new(7.0, 5.0), 0.05);
    for _ in 0..50 {
        let mut point = || Vector2::new(9.0 * dice.unit() - 1.0, 7.0 * dice.unit() - 1.0);
        let points: Vec<Vector2<f64>> = (0..6).map(|_| point()).collect();
        let polygon = Polygon::around(&points).expect("it has an area");
        let mut bits = vec![0_u64; grid.width.div_ceil(64) * grid.height];
        grid.fill(&polygon, &mut bits);
        for cell in 0..grid.len() {
            let depth = polygon.depth(&grid.centre(cell));
            // Not on an edge, where rounding decides.
            if depth.abs() > 1e-9 {
                let (row, column) = (cell / grid.width, cell % grid.width);
                let bit = bits[row * grid.width.div_ceil(64) + column / 64] >> (column % 64) & 1;
                assert_eq!(bit == 1, depth > 0.0, "{polygon:?} {cell}");
            }
        }
    }
}

#[test]
fn sums_of_polygons_decide_like_the_test_for_touch() {
    let mut dice = Dice::new(3);
    for _ in 0..500 {
        let mut polygon = |size: f64| {
            let mut point = || Vector2::new(size * dice.unit(), size * dice.unit());
            Polygon::around(&(0..5).map(|_| point()).collect::<Vec<_>>()).expect("it has an area")
        };
        let (robot, obstacle) = (polygon(1.0), polygon(2.0));
        let sum = obstacle.plus(&robot.mirrored());
        let place = Vector2::new(4.0 * dice.unit() - 1.5, 4.0 * dice.unit() - 1.5);
        if sum.depth(&place).abs() > 1e-9 {
            assert_eq!(robot.moved((0.0, 1.0), place).touches(&obstacle), sum.contains(&place));
        }
    }
}

#[test]
fn sweeps_and_simpler_polygons_hold_what_they_should() {
    let mut dice = Dice::new(11);
    for round in 0..500 {
        let mut point = || Vector2::new(4.0 * dice.unit() - 2.0, 4.0 * dice.unit() - 2.0);
        let points: Vec<Vector2<f64>> = (0..9).map(|_| point()).collect();
        let polygon = Polygon::around(&points).expect("it has an area");
        // A sum with an own edge has several edges in one line.
        let again = Polygon::around(&[points[0], points[1], point()]).expect("it has an area");
        let polygon = if round % 2 == 0 { polygon.plus(&again).plus(&again) } else { polygon };
        let way = point();
        let edge = polygon.corners()[1] - polygon.corners()[0];
        let way = [way, Vector2::new(way.x, 0.0), Vector2::new(0.0, way.y), edge * 0.3, -edge][round % 5];
        let swept = polygon.along(way);
        let ends: Vec<Vector2<f64>> =
            polygon.corners().iter().flat_map(|corner| [*corner, corner + way]).collect();
        let hull = Polygon::around(&ends).expect("it has an area");
        for _ in 0..20 {
            let at = 5.0 * point();
            if hull.depth(&at).abs() > 1e-9 {
                assert_eq!(swept.contains(&at), hull.contains(&at), "{polygon:?} {way:?}");
            }
        }
        let simpler = polygon.simpler(0.1);
        assert!(simpler.corners().len() <= polygon.corners().len());
        assert!(polygon.corners().iter().all(|corner| simpler.depth(corner) > -1e-9));
        assert!(simpler.corners().iter().all(|corner| polygon.depth(corner) > -0.1 - 1e-9));
    }
}

#[test]
fn clearance_is_never_too_high_and_hardly_too_low() {
    let mut dice = Dice::new(4);
    for _ in 0..5 {
        let things = Things::random(&mut dice);
        let map = things.map(plank());
        let outlines: Vec<Polygon> = things
            .0
            .iter()
            .filter_map(|(pose, shapes, _)| Polygon::shadow(&PosedShape { pose: *pose, ..shapes[0] }))
            .collect();
        for cell in 0..map.grid().len() {
            let at = map.grid().centre(cell);
            let edge = (3.0 - at.x.abs()).min(3.0 - at.y.abs());
            let truth = outlines.iter().map(|outline| -outline.depth(&at)).fold(edge, f64::min);
            if truth > 0.0 {
                let said = map.clearance_m(cell);
                assert!(said <= truth + 1e-6, "{said} > {truth}");
                assert!(said >= truth - 2.0 * map.grid().half_diagonal() - 1e-6, "{said} < {truth}");
            }
        }
    }
}

#[test]
fn free_headings_are_free_and_few_others_are() {
    let mut dice = Dice::new(5);
    let (mut said, mut truth) = (0, 0);
    for _ in 0..3 {
        let map = Things::random(&mut dice).map(footprint());
        for cell in (0..map.grid().len()).step_by(7) {
            let centre = map.grid().centre(cell);
            for heading in 0..16_u32 {
                let yaw = f64::from(heading) * std::f64::consts::TAU / 16.0;
                let free = map.blocker(&Place::new(centre.x, centre.y, yaw)).is_none();
                let claimed = map.free_headings(cell) >> heading & 1 == 1;
                assert!(free || !claimed, "cell {cell} heading {heading}");
                said += i32::from(claimed);
                truth += i32::from(free);
            }
        }
    }
    // The margin, and nothing else.
    assert!(f64::from(said) > 0.9 * f64::from(truth), "{said} of {truth}");
}

#[test]
fn ways_touch_nothing_and_end_where_they_should() {
    let mut dice = Dice::new(6);
    let speeds = Speeds::default();
    let round = {
        let (robot, _) = one_arm();
        Footprint::of_robot(&robot, &robot.zero(), &[])
    };
    let (mut driven, mut refused) = (0, 0);
    for (footprint, drive) in [
        (footprint(), Omnidirectional),
        (plank(), Omnidirectional),
        (round, Differential),
        (plank(), Differential),
    ] {
        for _ in 0..12 {
            let map = Things::random(&mut dice).map(footprint.clone());
            let start = Place::new(0.0, 0.0, 6.0 * dice.unit());
            let Ok(flood) = Flood::new(&map, start, drive) else { continue };
            for _ in 0..30 {
                let goal =
                    Place::new(6.0 * dice.unit() - 3.0, 6.0 * dice.unit() - 3.0, 6.0 * dice.unit() - 3.0);
                let Ok(reach) = flood.reach(&map, goal) else { continue };
                let straight = (goal.point() - start.point()).norm();
                assert!(reach.length_m >= straight - 1e-9 && reach.cost_m.is_finite());
                let way = match flood.drive(&map, goal, &speeds) {
                    Ok(way) => way,
                    Err(error) => {
                        eprintln!("{drive:?} {start:?} {goal:?}: {error:?}");
                        refused += 1;
                        continue;
                    }
                };
                driven += 1;
                assert!(way.length_m >= straight - 1e-9);
                assert!(way.length_m <= reach.length_m * 1.02 + 1e-6, "{} {}", way.length_m, reach.length_m);
                for place in steps(&way) {
                    assert_eq!(map.blocker(&place), None, "{place:?} on {way:?}");
                }
                let last = way.places[way.places.len() - 1];
                assert!((last.point() - goal.point()).norm() < 1e-9);
                assert!(normal_angle(last.yaw - goal.yaw).abs() < 1e-9);
                if drive == Differential {
                    assert_drives_along_its_heading(&way);
                }
                assert_ends_in_time(&way, &speeds);
            }
        }
    }
    assert!(driven > 300, "{driven}");
    assert_eq!(refused, 0);
}

fn assert_drives_along_its_heading(way: &Drive) {
    for pair in way.places.windows(2) {
        let along = pair[1].point() - pair[0].point();
        if along.norm() > 1e-6 {
            let off = normal_angle(libm::atan2(along.y, along.x) - pair[0].yaw).abs();
            assert!(off.min(std::f64::consts::PI - off) < 1e-6, "{pair:?}");
        }
    }
}

fn assert_ends_in_time(way: &Drive, speeds: &Speeds) {
    let takes = way.duration_s(speeds);
    assert!(takes >= way.length_m / speeds.linear - 1e-9);
    let (first, last) = (way.place_at(-1.0, speeds), way.place_at(takes + 1.0, speeds));
    assert!((first.point() - way.places[0].point()).norm() < 1e-9);
    assert!((last.point() - way.places[way.places.len() - 1].point()).norm() < 1e-9);
    // No faster than it can.
    let mut before = first;
    for step in 0..=50 {
        let now = way.place_at(takes * f64::from(step) / 50.0, speeds);
        assert!((now.point() - before.point()).norm() <= speeds.linear * takes / 50.0 + 1e-9);
        before = now;
    }
}

#[test]
fn distance_is_the_same_both_ways() {
    let mut dice = Dice::new(7);
    let mut compared = 0;
    for _ in 0..14 {
        let map = Things::random(&mut dice).map(footprint());
        let mut place = || Place::new(5.0 * dice.unit() - 2.5, 5.0 * dice.unit() - 2.5, 6.0 * dice.unit());
        let places: Vec<Place> =
            (0..8).map(|_| place()).filter(|place| map.blocker(place).is_none()).collect();
        for a in &places {
            for b in &places {
                let there = Flood::new(&map, *a, Omnidirectional).and_then(|flood| flood.reach(&map, *b));
                let back = Flood::new(&map, *b, Omnidirectional).and_then(|flood| flood.reach(&map, *a));
                assert_eq!(there.is_ok(), back.is_ok());
                if let (Ok(there), Ok(back)) = (there, back) {
                    assert!((there.cost_m - back.cost_m).abs() < 0.01, "{} {}", there.cost_m, back.cost_m);
                    compared += 1;
                }
            }
        }
    }
    assert!(compared > 100, "{compared}");
}

#[test]
fn same_answers_each_time() {
    let make = || {
        let map = Things::random(&mut Dice::new(10)).map(plank());
        let flood = Flood::new(&map, Place::default(), Omnidirectional).expect("the middle is free");
        let way = flood.drive(&map, Place::new(-1.9, 2.2, 1.0), &Speeds::default());
        let samples: Vec<Vector2<f64>> = costmap(&map).samples(7).take(50).collect();
        (format!("{way:?}"), samples)
    };
    assert_eq!(make(), make());
}

/// A wall across the room with a doorway, and a door that may stand in it.
fn two_rooms(door_yaw: Option<f64>) -> Things {
    let mut things = Things::default();
    things.add(at(0.0, -1.75, 1.0), (0.1, 2.5, 2.0), true);
    things.add(at(0.0, 1.75, 1.0), (0.1, 2.5, 2.0), true);
    if let Some(yaw) = door_yaw {
        let hinge = Isometry3::new(Vector3::new(0.0, -0.5, 0.0), Vector3::z() * yaw);
        things.add(hinge * at(0.0, 0.45, 1.0), (0.04, 0.9, 1.9), false);
    }
    things
}

#[test]
fn doors_block_when_they_are_in_the_way() {
    let (start, goal) = (Place::new(-1.5, 1.0, 0.0), Place::new(1.5, 1.0, 0.0));
    for (door, blocked) in [(None, false), (Some(0.0), true), (Some(-1.57), false), (Some(-0.8), true)] {
        let map = two_rooms(door).map(footprint());
        let flood = Flood::new(&map, start, Omnidirectional).expect("it stands free");
        match flood.drive(&map, goal, &Speeds::default()) {
            Ok(way) => {
                assert!(!blocked, "{door:?}");
                assert!(way.length_m > 3.5 && way.length_m < 4.2, "{}", way.length_m);
            }
            Err(NoWay::Blocked { by, at }) => {
                assert!(blocked, "{door:?} {by:?} {at:?}");
                assert_eq!(by, Blocker::Barrier(2));
                assert!(at.x.abs() < 1.0 && at.y.abs() < 1.0, "{at:?}");
                let near = flood.nearest(&map, goal.point()).expect("something is reached");
                assert!(near.x < 0.0);
            }
            Err(other) => panic!("{other}"),
        }
    }
}

#[test]
fn walls_are_blamed_where_nothing_else_is() {
    let mut things = two_rooms(None);
    things.add(at(0.0, 0.0, 1.0), (0.1, 1.0, 2.0), true);
    let map = things.map(footprint());
    let flood = Flood::new(&map, Place::new(-1.5, 1.0, 0.0), Omnidirectional).expect("it stands free");
    let answer = flood.reach(&map, Place::new(1.5, 1.0, 0.0));
    assert!(matches!(answer, Err(NoWay::Blocked { by: Blocker::Barrier(_), .. })), "{answer:?}");
}

#[test]
fn a_map_made_on_the_ground_of_another_is_the_same() {
    let mut dice = Dice::new(12);
    let things = Things::random(&mut dice);
    let barriers: Vec<Barrier> =
        things.0.iter().map(|(pose, shapes, fixed)| Barrier { pose: *pose, shapes, fixed: *fixed }).collect();
    let all = Map::new(room(), &barriers, footprint(), Settings::default());
    let fixed: Vec<Barrier> = barriers.iter().copied().filter(|barrier| barrier.fixed).collect();
    for (old, footprint_then) in [(&barriers[..], plank()), (&fixed, footprint()), (&[], footprint())] {
        let before = Map::new(room(), old, footprint_then, Settings::default());
        let again = before.again(room(), &barriers, footprint());
        for cell in 0..all.grid().len() {
            assert_eq!(again.free_headings(cell), all.free_headings(cell));
            assert_eq!(again.clearance_m(cell), all.clearance_m(cell));
        }
    }
}

#[test]
fn what_is_carried_counts() {
    let (robot, limbs) = pr2();
    let hand = limbs.arms[0].chain.tip();
    let mut configuration = robot.zero();
    for arm in &limbs.arms {
        arm.chain.place(&arm.park, &mut configuration);
    }
    let mut things = two_rooms(None);
    // The doorway is 1 m wide.
    let board = PosedShape { ..block((0.05, 1.4, 1.4)) };
    let goal = Place::new(1.5, 0.0, 0.0);
    for (carried, passes) in [(vec![], true), (vec![(hand, board)], false)] {
        let map = things.map(Footprint::of_robot(&robot, &configuration, &carried));
        let flood = Flood::new(&map, Place::new(-1.5, 0.0, 0.0), Omnidirectional).expect("it stands free");
        assert_eq!(flood.reach(&map, goal).is_ok(), passes);
    }
    // A tall board on wheels sideways: the plank passes only lengthwise.
    things.add(at(0.0, 0.35, 0.2), (0.3, 0.25, 0.4), true);
    let map = things.map(plank());
    let flood = Flood::new(&map, Place::new(-1.5, 0.0, 1.57), Omnidirectional).expect("it stands free");
    let way = flood.drive(&map, Place::new(1.5, 0.0, 1.57), &Speeds::default()).expect("lengthwise");
    assert!(way.turns >= 2, "{way:?}");
}

#[test]
fn a_base_goes_under_a_table_and_a_torso_does_not() {
    let mut things = Things::default();
    things.add(at(1.5, 0.0, 0.7), (1.0, 2.0, 0.04), true);
    let map = things.map(footprint());
    let low = Footprint::new(&[PosedShape { pose: at(0.0, 0.0, 0.17), ..block((0.66, 0.66, 0.29)) }], &[]);
    let low = things.map(low);
    let touching = (0..60).map(|step| Place::new(f64::from(step) * 0.02, 0.0, 0.0));
    let first = |map: &Map| touching.clone().find(|place| map.blocker(place).is_some());
    assert_eq!(first(&low), None);
    let stops = first(&map).expect("arms and torso do not go under it");
    // Farther than the base alone could come if the table reached to the floor.
    assert!(stops.x > 0.3 && stops.x < 1.2, "{stops:?}");
}

#[test]
fn errors_say_which() {
    let mut things = Things::default();
    things.add(at(1.5, 0.0, 0.5), (0.5, 0.5, 1.0), true);
    things.add(at(-1.5, 0.0, 0.5), (0.5, 0.5, 1.0), true);
    let map = things.map(footprint());
    let new = |x: f64, y: f64| Flood::new(&map, Place::new(x, y, 0.3), Omnidirectional);
    assert_eq!(new(1.4, 0.2).err(), Some(NoWay::StartBlocked { by: Blocker::Barrier(0) }));
    assert_eq!(new(2.9, 2.9).err(), Some(NoWay::StartBlocked { by: Blocker::Bounds }));
    assert!(matches!(new(4.0, 0.0), Err(NoWay::OutsideRoom { .. })));
    assert!(matches!(new(f64::NAN, 0.0), Err(NoWay::OutsideRoom { .. })));
    let flood = new(0.0, 0.0).expect("the middle is free");
    let reach = |x: f64, y: f64| flood.reach(&map, Place::new(x, y, 0.0)).err();
    assert_eq!(reach(-1.2, 0.1), Some(NoWay::GoalBlocked { by: Blocker::Barrier(1) }));
    assert!(matches!(reach(0.0, f64::INFINITY), Some(NoWay::OutsideRoom { .. })));
    let standing = Flood::new(&map, Place::default(), DriveKind::Fixed).expect("the middle is free");
    assert!(standing.reach(&map, Place::new(0.0, 1.5, 0.0)).is_err());
}

#[test]
fn a_base_stands_close_to_a_counter() {
    let mut things = Things::default();
    things.add(at(2.0, 0.0, 0.45), (0.6, 3.0, 0.9), true);
    let map = things
        .map(Footprint::new(&[PosedShape { pose: at(0.0, 0.0, 0.2), ..block((0.66, 0.66, 0.3)) }], &[]));
    let flood = Flood::new(&map, Place::new(-1.0, 0.3, 0.4), Omnidirectional).expect("it stands free");
    // A millimetre of air in front.
    let close = Place::new(1.7 - 0.331, 0.123, 0.0);
    let way = flood.drive(&map, close, &Speeds::default()).expect("it gets there");
    for place in steps(&way) {
        assert_eq!(map.blocker(&place), None);
    }
    let back = Flood::new(&map, close, Omnidirectional).expect("it stands free");
    assert!(back.drive(&map, Place::new(-1.0, 0.3, 0.4), &Speeds::default()).is_ok());
}

#[test]
fn odd_inputs_do_no_harm() {
    let nan = PosedShape { pose: at(f64::NAN, 0.0, 0.0), ..block((1.0, 1.0, 1.0)) };
    let huge = PosedShape { ..block((1e300, 1.0, 1.0)) };
    for shapes in [vec![], vec![nan], vec![huge]] {
        for size in [0.0, -1.0, 1e-9, 6.0, 1e9, f64::NAN, f64::INFINITY] {
            for cell_m in [0.5, -1.0, f64::NAN] {
                let barrier = Barrier { pose: Isometry3::identity(), shapes: &shapes, fixed: cell_m == 0.5 };
                let room = Room { low: Vector2::zeros(), high: Vector2::repeat(size) };
                let settings = Settings { cell_m, ..Settings::default() };
                for footprint in [plank(), Footprint::new(&shapes, &[0.3])] {
                    let map = Map::new(room, &[barrier], footprint, settings);
                    let place = Place::new(size * 0.5, size * 0.5, 0.0);
                    if let Ok(flood) = Flood::new(&map, place, Omnidirectional) {
                        let _ =
                            flood.drive(&map, Place::new(size * 0.7, size * 0.4, 9.0), &Speeds::default());
                    }
                }
            }
        }
    }
}

// ---------------------------------------------------------------------------------------------
// Costmaps

fn costmap(map: &Map) -> Costmap {
    Costmap::new(*map.grid())
        .range(Vector2::new(0.5, 0.5), 0.4, 1.0)
        .gaussian(Vector2::new(0.5, 0.5), 0.7, 0.1)
        .free(map)
}

#[test]
fn samples_are_stable_without_repetition_and_likely_ones_come_first() {
    let map = Things::random(&mut Dice::new(9)).map(footprint());
    let all: Vec<Vector2<f64>> = costmap(&map).samples(1).collect();
    assert!(all.len() > 100);
    for k in [0, 1, 17, 99] {
        assert_eq!(costmap(&map).sample(1, k), Some(all[k]));
    }
    assert_eq!(costmap(&map).sample(1, all.len()), None);
    let mut cells: Vec<Option<usize>> = all.iter().map(|at| map.grid().cell(at)).collect();
    cells.sort_unstable();
    cells.dedup();
    assert_eq!(cells.len(), all.len());
    assert_ne!(costmap(&map).sample(2, 0), costmap(&map).sample(1, 0));
    let off = |at: &Vector2<f64>| ((at - Vector2::new(0.5, 0.5)).norm() - 0.7).abs();
    let mean = |part: &[Vector2<f64>]| part.iter().map(off).sum::<f64>() / part.len() as f64;
    assert!(mean(&all[..50]) < mean(&all[all.len() - 50..]));
    let (k, found) = costmap(&map).find(1, 50, |at| (at.x > 0.6).then_some(at)).expect("there is one");
    assert_eq!(all[k], found);
}

#[test]
fn generators_keep_what_they_say() {
    let grid = Grid::over(Vector2::zeros(), Vector2::new(4.0, 4.0), 0.05);
    let table = Polygon::rectangle(Vector2::new(1.0, 1.0), Vector2::new(2.0, 3.0)).expect("it has an area");
    let rim =
        Costmap::new(grid).region(&table).boundary(&table, 0.2).side(Vector2::new(1.5, 1.5), Vector2::x());
    let mut kept = 0;
    for cell in 0..grid.len() {
        let at = grid.centre(cell);
        let (inside, right) = (table.contains(&at), at.x >= 1.5);
        let expected = inside && right && table.depth(&at) <= 0.2;
        assert_eq!(rim.weight(cell) > 0.0, expected);
        kept += i32::from(expected);
    }
    assert!(kept > 100);
}
