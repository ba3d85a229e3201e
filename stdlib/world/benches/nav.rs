//! What driving and looking cost: `cargo bench -p pleach-world [--bench nav] [PATTERN]`.
//!
//! A room of 10 × 10 m with walls, counters, a table, chairs and forty small things, a PR2 with
//! parked arms. Each figure is the median of nine runs, CPU time of the process. What was seen:
//! `benches/README.md` beside this file.

mod measure;

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Vector2, Vector3};
use world::nav::{Barrier, Costmap, Flood, Footprint, Ground, Map, Place, Room, Settings, Speeds};
use world::robot::chain::DriveKind;
use world::robot::urdf::{ONE_ARM, PR2};
use world::robot::{Chains, Robot};
use world::shape::{PosedShape, Shape};
use world::sight::{Camera, Things};

use measure::Dice;

fn main() {
    let pattern = std::env::args().skip(1).find(|arg| !arg.starts_with("--")).unwrap_or_default();
    // The name of this file asks for all that is in it.
    let wanted = |name: &str| name.contains(&pattern) || pattern == "nav";
    let things = kitchen();
    driving(&wanted, &things);
    looking(&wanted, &things);
}

// ---------------------------------------------------------------------------------------------
// Measuring

/// Median of the CPU time of `work`, in µs, divided by the number of operations it does.
fn measure(operations: usize, work: impl FnMut()) -> f64 {
    measure::measure(operations, work) / 1000.0
}

fn line(name: &str, us: f64, per: &str, note: &str) {
    println!("{name:<40} {us:>10.2} µs per {per:<8} {note}");
}

// ---------------------------------------------------------------------------------------------
// The room

struct Thing {
    pose: Isometry3<f64>,
    shapes: Vec<PosedShape>,
    fixed: bool,
}

fn kitchen() -> Vec<Thing> {
    let mut things = Vec::new();
    let mut add = |size: (f64, f64, f64), at: (f64, f64, f64), yaw: f64| {
        let shape = Shape::Box { size: Vector3::new(size.0, size.1, size.2) };
        let pose = Isometry3::new(Vector3::new(at.0, at.1, at.2), Vector3::z() * yaw);
        // Walls, counters and the table stay; what is smaller can be put elsewhere, or closed.
        let fixed = size.0 * size.1 > 0.3 && size.2 > 0.5 && size.0 != 0.04;
        things.push(Thing { pose, shapes: vec![PosedShape { pose: Isometry3::identity(), shape }], fixed });
    };
    for side in [-1.0, 1.0] {
        add((0.1, 10.0, 2.5), (5.0 * side, 0.0, 1.25), 0.0);
        add((10.0, 0.1, 2.5), (0.0, 5.0 * side, 1.25), 0.0);
        // A wall through the room, with a doorway and an open door.
        add((0.1, 3.4, 2.5), (-1.0, 2.8 * side, 1.25), 0.0);
    }
    add((0.04, 0.9, 2.0), (-1.6, 0.8, 1.0), 1.2);
    add((0.6, 4.0, 0.9), (4.6, 0.0, 0.45), 0.0);
    add((1.0, 2.0, 0.9), (2.0, 0.0, 0.45), 0.0);
    add((0.7, 0.7, 1.9), (4.5, 3.5, 0.95), 0.0);
    add((0.35, 4.0, 0.6), (4.7, 0.0, 1.8), 0.0);
    // A table with legs, and chairs.
    add((1.6, 0.9, 0.04), (-3.0, -2.0, 0.72), 0.3);
    for (x, y) in [(-3.7, -2.3), (-2.3, -2.3), (-3.7, -1.7), (-2.3, -1.7)] {
        add((0.06, 0.06, 0.7), (x, y, 0.35), 0.3);
        add((0.45, 0.45, 0.45), (x + 0.2, y * 1.2, 0.22), 0.7);
    }
    let mut dice = Dice(3);
    for _ in 0..40 {
        let (x, y) = if dice.unit() < 0.5 {
            (4.45, 3.8 * dice.unit() - 1.9)
        } else {
            (1.6 + 0.8 * dice.unit(), 1.8 * dice.unit() - 0.9)
        };
        add((0.08, 0.08, 0.05 + 0.2 * dice.unit()), (x, y, 1.0), 3.0 * dice.unit());
    }
    things
}

fn barriers(things: &[Thing]) -> Vec<Barrier<'_>> {
    things
        .iter()
        .map(|thing| Barrier { pose: thing.pose, shapes: &thing.shapes, fixed: thing.fixed })
        .collect()
}

// ---------------------------------------------------------------------------------------------
// Workloads

fn driving(wanted: &dyn Fn(&str) -> bool, things: &[Thing]) {
    let robot = Robot::from_urdf("pr2.urdf", PR2).expect("the shipped robot is read");
    let limbs = robot.limbs(&Chains::pr2()).expect("the parts are there");
    let mut configuration = robot.zero();
    for arm in &limbs.arms {
        arm.chain.place(&arm.park, &mut configuration);
    }
    let footprint = Footprint::of_robot(&robot, &configuration, &[]);
    let room = Room { low: Vector2::repeat(-5.0), high: Vector2::repeat(5.0) };
    let barriers = barriers(things);
    let make_ground =
        |footprint: &Footprint| Ground::new(room, &barriers, footprint.clone(), Settings::default());
    let ground = Arc::new(make_ground(&footprint));
    let make = || Map::on(ground.clone(), &barriers);
    let fixed = barriers.iter().filter(|barrier| barrier.fixed).count();
    let start = Place::new(-3.5, 3.0, 0.4);
    let map = make();
    let flood = Flood::new(&map, start, DriveKind::Omnidirectional).expect("it stands free");
    let radii = (footprint.inscribed_m(), footprint.circumscribed_m());
    if wanted("footprint of the robot") {
        let us = measure(100, || {
            for _ in 0..100 {
                std::hint::black_box(Footprint::of_robot(&robot, &configuration, &[]));
            }
        });
        line(
            "footprint of the robot",
            us,
            "footprint",
            &format!("radii {:.2} and {:.2} m", radii.0, radii.1),
        );
    }
    if wanted("ground: fixed things") {
        let us = measure(10, || {
            for _ in 0..10 {
                std::hint::black_box(make_ground(&footprint));
            }
        });
        line("ground: fixed things", us, "ground", &format!("{fixed} fixed things"));
    }
    if wanted("map: clearance and headings") {
        let us = measure(10, || {
            for _ in 0..10 {
                std::hint::black_box(make());
            }
        });
        let cells = map.grid().len();
        let open = (0..cells).filter(|cell| map.free_headings(*cell) == u16::MAX).count();
        let tight = (0..cells).filter(|cell| !matches!(map.free_headings(*cell), 0 | u16::MAX)).count();
        let note = format!("{} movable, {cells} cells, {open} open, {tight} tight", barriers.len() - fixed);
        line("map: clearance and headings", us, "map", &note);
    }
    if wanted("flood") {
        let us = measure(10, || {
            for _ in 0..10 {
                let flood = Flood::new(&map, start, DriveKind::Omnidirectional);
                std::hint::black_box(flood.is_ok());
            }
        });
        let reached = (0..map.grid().len()).filter(|cell| flood.reaches_cell(&map, *cell)).count();
        line("flood", us, "flood", &format!("{reached} cells reached"));
    }
    if wanted("flood, one arm on two wheels") {
        let robot = Robot::from_urdf("one-arm.urdf", ONE_ARM).expect("the shipped robot is read");
        let footprint = Footprint::of_robot(&robot, &robot.zero(), &[]);
        let map = Map::new(room, &barriers, footprint, Settings::default());
        let us = measure(10, || {
            for _ in 0..10 {
                let flood = Flood::new(&map, start, DriveKind::Differential);
                std::hint::black_box(flood.is_ok());
            }
        });
        line("flood, one arm on two wheels", us, "flood", "");
    }
    let mut dice = Dice(5);
    let candidates: Vec<Place> = (0..1000)
        .map(|_| Place::new(10.0 * dice.unit() - 5.0, 10.0 * dice.unit() - 5.0, 6.0 * dice.unit()))
        .collect();
    if wanted("candidate: free or not") {
        let mut free = 0;
        let us = measure(1000, || {
            free = candidates.iter().filter(|place| map.blocker(place).is_none()).count();
        });
        line("candidate: free or not", us, "query", &format!("{free} of 1000 free"));
    }
    if wanted("candidate: distance from the robot") {
        let free: Vec<Place> =
            candidates.iter().copied().filter(|place| flood.reach(&map, *place).is_ok()).collect();
        let us = measure(free.len(), || {
            for place in &free {
                std::hint::black_box(flood.reach(&map, *place).is_ok());
            }
        });
        line("candidate: distance from the robot", us, "query", &format!("{} reached", free.len()));
    }
    // Beside the counter, with the island and the wall between.
    let goal = Place::new(3.4, -2.9, 0.0);
    let other = Robot::from_urdf("one-arm.urdf", ONE_ARM).expect("the shipped robot is read");
    let other = Footprint::of_robot(&other, &other.zero(), &[]);
    let other = Map::new(room, &barriers, other, Settings::default());
    for (name, map, kind) in [
        ("way to the counter", &map, DriveKind::Omnidirectional),
        ("the same, one arm on two wheels", &other, DriveKind::Differential),
    ] {
        if wanted(name) {
            let flood = Flood::new(map, start, kind).expect("it stands free");
            let way = flood.drive(map, goal, &Speeds::default());
            let us = measure(20, || {
                for _ in 0..20 {
                    std::hint::black_box(flood.drive(map, goal, &Speeds::default()).is_ok());
                }
            });
            let note = way.map_or_else(
                |why| format!("{why:?}"),
                |way| format!("{:.2} m, straight {:.2} m, {} turns", way.length_m, way.straight_m, way.turns),
            );
            line(name, us, "way", &note);
        }
    }
    if wanted("no way: who is to blame") {
        let mut closed: Vec<Barrier> = barriers.clone();
        let door = [PosedShape {
            pose: Isometry3::identity(),
            shape: Shape::Box { size: Vector3::new(0.05, 2.2, 2.0) },
        }];
        closed.push(Barrier { pose: Isometry3::translation(-1.0, 0.0, 1.0), shapes: &door, fixed: false });
        let map = Map::on(ground.clone(), &closed);
        let flood = Flood::new(&map, start, DriveKind::Omnidirectional).expect("it stands free");
        let answer = flood.reach(&map, goal);
        let us = measure(5, || {
            for _ in 0..5 {
                std::hint::black_box(flood.reach(&map, goal).is_ok());
            }
        });
        line("no way: who is to blame", us, "query", &format!("{answer:?}"));
    }
    if wanted("costmap of a ring, 20 samples") {
        let centre = Vector2::new(4.4, 0.5);
        let sample = || {
            let costs =
                Costmap::new(*map.grid()).range(centre, 0.4, 1.0).gaussian(centre, 0.7, 0.15).free(&map);
            costs
                .samples(1)
                .take(20)
                .filter(|at| flood.reach(&map, Place::new(at.x, at.y, 0.0)).is_ok())
                .count()
        };
        let us = measure(20, || {
            for _ in 0..20 {
                std::hint::black_box(sample());
            }
        });
        line("costmap of a ring, 20 samples", us, "search", &format!("{} reached", sample()));
    }
}

fn looking(wanted: &dyn Fn(&str) -> bool, kitchen: &[Thing]) {
    let robot = Robot::from_urdf("pr2.urdf", PR2).expect("the shipped robot is read");
    let limbs = robot.limbs(&Chains::pr2()).expect("the parts are there");
    let head = limbs.head.as_ref().expect("it has a head");
    let mut things = Things::default();
    for thing in kitchen {
        things.push(&thing.pose, &thing.shapes);
    }
    let root = Place::new(3.4, 0.3, 0.1).pose();
    let mut configuration = robot.zero();
    let point = Point3::new(4.45, 0.2, 0.95);
    if wanted("head towards a point") {
        let us = measure(100, || {
            for _ in 0..100 {
                std::hint::black_box(robot.look_at(head, &root, &configuration, &point).is_ok());
            }
        });
        line("head towards a point", us, "look", "");
    }
    let look = robot.look_at(head, &root, &configuration, &point).expect("it turns there");
    configuration[head.pan.index()] = look.pan;
    configuration[head.tilt.index()] = look.tilt;
    let mut poses = Vec::new();
    robot.forward(&root, &configuration, &mut poses);
    let eye = poses[head.camera.index()];
    if wanted("sight of a thing") {
        let small: Vec<usize> = (kitchen.len() - 40..kitchen.len()).collect();
        let see = |number: usize| {
            let thing = &kitchen[number];
            things.sight(&Camera::default(), &eye, (&thing.pose, &thing.shapes), &[number])
        };
        let mut seen = 0;
        let us = measure(100, || {
            seen = small.iter().cycle().take(100).filter(|number| see(**number).visible > 0.3).count();
        });
        line("sight of a thing", us, "query", &format!("{} things, {seen} of 100 seen", things.len()));
    }
}
