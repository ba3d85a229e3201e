//! Candidates keep what they promise, and are functions of what is asked.

use nalgebra::{Isometry3, Vector2, Vector3};
use vm::world::World as _;

use super::Dice;
use super::kitchen::Errand;
use crate::belief::Sight;
use crate::motions::base::Maps;
use crate::motions::hand::Target;
use crate::motions::tool::ToolWay;
use crate::nav::convex::Polygon;
use crate::nav::{Flood, Place, turn_between};
use crate::parry::Solid;
use crate::places::{Distance, to_put, to_stand};
use crate::rehearse::{moved, rehearse, seen};
use crate::scene::grasp::{PRE_GRASP_M, back, lifted};
use crate::scene::{ContainerId, Hands, ObjectId, Scene, SurfaceId};
use crate::shape::PosedShape;
use crate::stands::{Item, plane, stands};
use crate::state::{Around, State, Support};
use crate::world::{Motion, World};

const NEAR: Distance = Distance { least_m: 0.35, best_m: 0.65, most_m: 0.95 };

fn stand(state: &State, maps: &Maps, goal: Vector2<f64>, seed: u64, count: usize) -> Vec<Place> {
    to_stand(state, maps, goal, NEAR, seed, count).unwrap_or_else(|why| panic!("{}", why.message))
}

fn put(state: &State, maps: &Maps, object: ObjectId, on: Support, seed: u64) -> Vec<Isometry3<f64>> {
    to_put((state, state), maps, object, on, None, seed, 6).unwrap_or_else(|why| panic!("{}", why.message))
}

fn surfaces(scene: &Scene) -> impl Iterator<Item = Support> {
    (0..scene.surfaces.len()).map(|number| Support::Surface(SurfaceId(number)))
}

#[test]
fn where_the_base_may_stand_it_gets_to() {
    let errand = Errand::kitchen("pr2");
    let (state, maps, mut dice) = (&errand.world.state, Maps::default(), Dice::new(1));
    let parked = state.parked();
    let map = maps.of(&parked);
    let drive = state.machine().expect("there is a robot").limbs.drive;
    let flood = Flood::new(&map, Place::of_pose(&state.base), drive).expect("it stands where it can");
    let mut found = 0;
    for seed in 0..50 {
        let goal = Vector2::new(5.0 * dice.unit(), 5.0 * dice.unit());
        for place in stand(state, &maps, goal, seed, 20) {
            assert!(map.blocker(&place).is_none(), "{goal} {place:?} is not free");
            assert!(flood.cost_m(&map, place).is_some(), "{goal} {place:?} is not reached");
            let towards = goal - place.point();
            assert!((NEAR.least_m..=NEAR.most_m).contains(&towards.norm()), "{goal} {place:?}");
            assert!(
                turn_between(libm::atan2(towards.y, towards.x), place.yaw).abs() < 0.8,
                "{goal} {place:?}"
            );
            found += 1;
        }
    }
    assert!(found > 500, "{found}");
}

/// The bodies of an object at a pose.
fn bodies(shapes: &[PosedShape], pose: &Isometry3<f64>) -> Vec<PosedShape> {
    shapes.iter().map(|it| PosedShape { pose: pose * it.pose, shape: it.shape }).collect()
}

/// All bodies of the world but an object's own.
fn all_but(state: &State, own: ObjectId) -> Vec<PosedShape> {
    let scene = &state.setting.scene;
    let fixtures = scene.fixtures.iter().flat_map(|it| bodies(&it.shapes, &it.pose));
    let containers = scene.containers.iter().enumerate().flat_map(|(number, it)| {
        let id = ContainerId(number);
        bodies(&it.shapes, &state.setting.container_pose(id, state.opening(id)))
    });
    let others = state.objects.keys().filter(|it| **it != own);
    let others = others.flat_map(|it| bodies(&scene.kind_of(*it).shapes, &state.object_pose(*it)));
    fixtures.chain(containers).chain(others).collect()
}

#[test]
fn what_is_put_down_overlaps_nothing_and_stays_inside() {
    let errand = Errand::kitchen("pr2");
    let (state, maps) = (&errand.world.state, Maps::default());
    let scene = &state.setting.scene;
    let tray = Support::Object(errand.object("tray-1"));
    let mut found = 0;
    for (number, object) in state.objects.keys().enumerate() {
        let others = all_but(state, *object);
        for on in surfaces(scene).chain([tray]).filter(|on| *on != Support::Object(*object)) {
            let shapes = &scene.kind_of(*object).shapes;
            let (middle, size) = match on {
                Support::Surface(id) => (state.surface_pose(id), scene.surfaces[id.0].size),
                _ => {
                    let size =
                        scene.kind_of(errand.object("tray-1")).carries.expect("it carries things").size;
                    (plane(state, on).expect("it carries things"), size)
                }
            };
            for pose in put(state, &maps, *object, on, number as u64) {
                for posed in bodies(shapes, &(middle.inverse() * pose)) {
                    let (low, high) = Polygon::shadow(&posed).expect("it has an outline").bounds();
                    let inside = |at: usize| low[at] >= -size[at] * 0.5 && high[at] <= size[at] * 0.5;
                    assert!(inside(0) && inside(1), "{} {pose}", state.support_name(on));
                }
                // It touches what it stands on.
                for posed in bodies(shapes, &lifted(&pose, 0.003)) {
                    let near = |it: &&PosedShape| {
                        let (a, b) = (posed.bounds(), it.bounds());
                        (0..3).all(|at| a.0[at] <= b.1[at] && b.0[at] <= a.1[at])
                    };
                    let here = Isometry3::identity();
                    let hit = others
                        .iter()
                        .filter(near)
                        .find(|it| Solid::new(&posed).touches(&here, &Solid::new(it), &here));
                    assert!(
                        hit.is_none(),
                        "{} on {} {pose} {hit:?}",
                        scene.objects[object.0].name,
                        state.support_name(on)
                    );
                }
                found += 1;
            }
        }
    }
    assert!(found > 300, "{found}");
}

#[test]
fn what_was_put_down_stands() {
    let errand = Errand::kitchen("pr2");
    let maps = Maps::default();
    let scene = &errand.world.state.setting.scene;
    let (mut good, mut all) = (0, 0);
    for on in surfaces(scene) {
        let mut packed = errand.world.state.clone();
        // One after another, each object of the kitchen finds a place beside those that came before.
        for object in packed.objects.keys().copied().collect::<Vec<_>>() {
            let item = Item { kind: scene.kind_of(object), object: Some(object) };
            let found = put(&packed, &maps, object, on, 7);
            all += found.len();
            let stand: Vec<_> = found.iter().filter(|pose| stands(&packed, &item, pose)).collect();
            good += stand.len();
            if let Some(pose) = stand.first() {
                packed.put(object, on, pose);
            }
        }
        assert!(
            packed.count_on(on) <= packed.capacity(on).unwrap_or(usize::MAX),
            "{}",
            packed.support_name(on)
        );
    }
    // Not those on what is full: poses to put something at are not counted.
    println!("{good} of {all}");
    assert!(good * 10 >= all * 7, "{good} of {all}");
}

#[test]
fn what_is_asked_again_is_answered_alike() {
    let errand = Errand::kitchen("pr2");
    let state = &errand.world.state;
    let (cup, island) = (errand.object("cup-1"), state.setting.scene.surface("island_area"));
    let on = Support::Surface(island.expect("there is one"));
    let (known, fresh) = (Maps::default(), Maps::default());
    let goal = Vector2::new(0.3, 3.5);
    let first = (stand(state, &known, goal, 5, 20), put(state, &known, cup, on, 5));
    // What was asked before does not matter, nor does what else is known.
    let _ = (stand(state, &known, Vector2::new(2.7, 3.4), 5, 20), put(state, &known, cup, on, 6));
    assert_eq!(first, (stand(state, &known, goal, 5, 20), put(state, &known, cup, on, 5)));
    assert_eq!(first, (stand(state, &fresh, goal, 5, 20), put(state, &fresh, cup, on, 5)));
    // Who asks for fewer gets the first of them.
    assert_eq!(first.0[..7], stand(state, &fresh, goal, 5, 7));
    assert_ne!(first.0, stand(state, &fresh, goal, 6, 20));
    assert_ne!(first.1, put(state, &fresh, cup, on, 6));
}

/// Something that hands may do in the kitchen: motions, and the point that they are about.
struct Job {
    name: String,
    at: Vector2<f64>,
    motions: Vec<Motion>,
}

/// Taking an object with one hand, in each way that there is.
fn picking(state: &State, object: ObjectId, arm: usize) -> Vec<Job> {
    let pose = state.object_pose(object);
    let near = || Around { touchable: vec![object], ..Around::default() };
    let grasps = state.setting.scene.kind_of(object).grasps.iter();
    let job = |grasp: &crate::scene::Grasp| {
        let Hands::One(in_object) = grasp.hands else { return None };
        let tool = pose * in_object;
        let reach = ToolWay { arm, vias: vec![back(&tool, grasp.pre_m), tool] };
        let lift = ToolWay { arm, vias: vec![lifted(&tool, grasp.lift_m)] };
        Some(Job {
            name: format!("{} from {:?}", state.setting.scene.objects[object.0].name, grasp.side),
            at: pose.translation.vector.xy(),
            motions: vec![
                Motion::Releasing(vec![arm]),
                Motion::MovingTcp(vec![reach], near()),
                Motion::Gripping(vec![arm], Target::Object(object)),
                Motion::MovingTcp(vec![lift], near()),
            ],
        })
    };
    grasps.filter_map(job).collect()
}

/// Opening a container a little.
fn opening(state: &State, id: ContainerId, arm: usize) -> Job {
    let container = state.setting.container(id);
    let tool = state.setting.container_pose(id, 0.0) * container.handle.tool;
    let near = Around { handles: vec![id], ..Around::default() };
    Job {
        name: container.name.clone(),
        at: tool.translation.vector.xy(),
        motions: vec![
            Motion::Releasing(vec![arm]),
            Motion::MovingTcp(vec![ToolWay { arm, vias: vec![back(&tool, PRE_GRASP_M), tool] }], near),
            Motion::Gripping(vec![arm], Target::Handle(id)),
            Motion::MovingContainer(arm, id, Some(container.open * 0.5)),
        ],
    }
}

/// What could be done with an arm in a kitchen where all doors and drawers are shut.
fn jobs(state: &State, arm: usize) -> Vec<Job> {
    let scene = &state.setting.scene;
    let outside = state.objects.keys().filter(|it| state.container_of(**it).is_none());
    let mut all: Vec<Job> = outside.flat_map(|it| picking(state, *it, arm)).collect();
    all.extend((0..scene.containers.len()).map(|number| opening(state, ContainerId(number), arm)));
    all
}

#[test]
fn what_works_in_the_mind_works_when_it_is_done() {
    let mut errand = Errand::kitchen("pr2");
    errand.go(&Motion::MovingTorso(0.25));
    let mut dice = Dice::new(11);
    let maps = Maps::default();
    let (mut good, mut whys) = (0, Vec::new());
    for seed in 0..50 {
        let state = &errand.world.state;
        let mut jobs = jobs(state, dice.below(2));
        let first = dice.below(jobs.len());
        jobs.rotate_left(first);
        let mind = state.parked();
        // A plan takes what works, too: not every handle is within reach of every arm.
        let chance = jobs.into_iter().find_map(|job| {
            let works = |place: &Place| {
                let there = moved(&mind, &place.pose());
                rehearse(&there, state, &job.motions, errand.now_ns).is_ok()
            };
            stand(state, &maps, job.at, seed, 40).into_iter().find(works).map(|place| (job, place))
        });
        let Some((job, place)) = chance else { panic!("nothing works: {seed}") };
        let mut fork = errand.world.fork();
        let world = std::mem::take(fork.as_any().downcast_mut::<World>().expect("it is one"));
        let mut real = Errand { world, now_ns: errand.now_ns, seed: 1000 * seed };
        let done = real.park().and_then(|()| real.try_motion(&Motion::Going(vec![place])));
        match done.and_then(|()| job.motions.iter().try_for_each(|motion| real.try_motion(motion))) {
            Ok(()) => good += 1,
            Err(why) => whys.push(format!("{seed} {}: {why}", job.name)),
        }
    }
    println!("{good} of 50\n{}", whys.join("\n"));
    // Errors of where the base and the tools come to are not rehearsed.
    assert!(good >= 45, "{good} of 50\n{}", whys.join("\n"));
}

#[test]
fn to_rehearse_changes_nothing() {
    let mut errand = Errand::kitchen("pr2");
    errand.go(&Motion::MovingTorso(0.25));
    let state = &errand.world.state;
    let before = format!("{:?}", (&state.base, &state.joints, &state.objects, &state.hands, &state.openings));
    let (version, costs) = (state.version, errand.world.costs);
    let place = Place::new(1.1, 3.35, std::f64::consts::PI);
    for job in jobs(state, 0) {
        let there = moved(state, &place.pose());
        let first = rehearse(&there, state, &job.motions, 0).map_err(|why| why.message);
        let again = rehearse(&there, state, &job.motions, 0).map_err(|why| why.message);
        assert_eq!(first, again, "{}", job.name);
    }
    let after = format!("{:?}", (&state.base, &state.joints, &state.objects, &state.hands, &state.openings));
    assert_eq!(before, after);
    assert_eq!((version, costs), (state.version, errand.world.costs));
}

#[test]
fn cameras_see_points_that_nothing_hides() {
    let errand = Errand::kitchen("pr2");
    let state = &errand.world.state;
    let scene = &state.setting.scene;
    let there = moved(state, &Place::new(1.1, 3.35, std::f64::consts::PI).pose());
    let sink = state.surface_pose(scene.surface("sink_area").expect("there is one")).translation.vector;
    let milk = state.object_pose(errand.object("milk-1")).translation.vector;
    // In the open, behind the door of the fridge, and behind one's back.
    let count =
        |points: &[Vector3<f64>]| seen(&there, points).unwrap_or_else(|why| panic!("{}", why.message));
    let free = sink + Vector3::new(0.15, -0.3, 0.0);
    assert_eq!((count(&[free]), count(&[milk]), count(&[])), (1, 0, 0));
    // Nor what is below the sink.
    assert_eq!(count(&[free, free - Vector3::new(0.0, 0.0, 0.4)]), 1);
}

#[test]
fn what_is_believed_stands_on_what_is_believed() {
    let mut errand = Errand::kitchen("pr2");
    let (tray, cup) = (errand.object("tray-1"), errand.object("cup-1"));
    let at = |x: f64| Sight { pose: Isometry3::translation(x, 2.0, 0.9), at_s: 0.0 };
    errand.world.state.put(cup, Support::Object(tray), &Isometry3::translation(2.7, 3.4, 0.95));
    // The tray was seen elsewhere: someone has moved it since, and the cup on it.
    errand.world.belief.seen.insert(tray, at(1.0));
    errand.world.belief.seen.insert(cup, at(1.1));
    let pose_of = |world: &World, object| world.believed().object_pose(object).translation.vector;
    assert!((pose_of(&errand.world, tray) - at(1.0).pose.translation.vector).norm() < 1e-9);
    assert!((pose_of(&errand.world, cup) - at(1.1).pose.translation.vector).norm() < 1e-9);
    errand.world.belief.seen.remove(&tray);
    assert!((pose_of(&errand.world, cup) - at(1.1).pose.translation.vector).norm() < 1e-9);
    assert_eq!(errand.world.believed().objects.len(), 1);
}

#[test]
fn odd_questions_are_answered() {
    let errand = Errand::kitchen("pr2");
    let (state, maps) = (&errand.world.state, Maps::default());
    for number in [f64::NAN, f64::INFINITY, -1e300, 1e9] {
        let odd = Distance { least_m: number, best_m: number, most_m: number };
        let _ = to_stand(state, &maps, Vector2::new(number, number), NEAR, 1, 5);
        let _ = to_stand(state, &maps, Vector2::new(1.0, 1.0), odd, 1, 5);
        let far = Isometry3::translation(number, number, number);
        let item = Item { kind: state.setting.scene.kind_of(errand.object("cup-1")), object: None };
        assert!(!stands(state, &item, &far));
        let _ = seen(&moved(state, &far), &[Vector3::repeat(number)]);
    }
}
