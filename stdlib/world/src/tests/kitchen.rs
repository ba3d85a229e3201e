//! Whole errands in the shipped kitchen.

use std::sync::Arc;

use expect_test::{Expect, expect};
use nalgebra::{Isometry3, Translation3, Vector3};

use super::text;
use crate::belief::Sight;
use crate::motions::Surroundings;
use crate::motions::hand::Target;
use crate::motions::tool::ToolWay;
use crate::nav::Place;
use crate::read_robot;
use crate::scene::grasp::{back, lifted};
use crate::scene::{Hands, ObjectId, Scene, Side};
use crate::setting::Setting;
use crate::state::{Around, Grip, State, Support};
use crate::world::{Ended, Mode, Motion, World};

/// A world with a clock.
pub(super) struct Errand {
    pub world: World,
    pub now_ns: u64,
    pub seed: u64,
}

impl Errand {
    pub fn new(robot: &str, scene: &vm::value::Value) -> Errand {
        let scene = Scene::read(scene).unwrap_or_else(|mistakes| {
            panic!("{}", mistakes.iter().map(|it| it.text()).collect::<Vec<_>>().join("\n"))
        });
        let machine = read_robot::machine(&text::robot(robot)).unwrap_or_else(|why| panic!("{}", why.text()));
        let setting = Setting::new(scene, Some(Arc::new(machine)));
        let state = State::new(Arc::new(setting), Place::new(1.6, 2.0, 0.0).pose());
        Errand { world: World::new(state), now_ns: 0, seed: 1 }
    }

    pub fn kitchen(robot: &str) -> Errand {
        Errand::new(robot, &text::kitchen())
    }

    /// At the sink of the kitchen, with the torso up.
    pub fn at_the_sink(mode: Mode) -> Errand {
        let mut errand = Errand::kitchen("pr2");
        errand.world.mode = mode;
        errand.go_to_the_sink();
        errand
    }

    #[track_caller]
    fn go_to_the_sink(&mut self) {
        self.go(&Motion::MovingTorso(0.2));
        self.drive(1.1, 3.35, WEST).expect("it gets to the sink");
    }

    /// The same scene, but for what is changed in it; everything stays where it is.
    pub fn change_scene(&mut self, change: impl FnOnce(&mut Scene)) {
        let setting = &self.world.state.setting;
        let mut scene = setting.scene.clone();
        change(&mut scene);
        self.world.state.setting = Arc::new(Setting::new(scene, setting.machine.clone()));
        self.world.changed();
    }

    pub fn object(&self, name: &str) -> ObjectId {
        self.world.state.setting.scene.object(name).expect("the object exists")
    }

    /// Does a motion: nothing if it went well, else the kind of the failure with its message.
    pub fn try_motion(&mut self, motion: &Motion) -> Result<(), String> {
        self.seed += 1;
        let (number, duration_s) = self.world.begin(motion, self.now_ns, self.seed);
        self.now_ns += (duration_s * 1e9) as u64 + 1;
        self.world.end(number, self.now_ns);
        match self.world.take_end(number).expect("it has ended") {
            Ended::Done(_) => {
                self.assert_apart(motion);
                Ok(())
            }
            Ended::Failed(trouble) => Err(format!("{}: {}", trouble.kind, trouble.message)),
            Ended::Stopped => Err("stopped".into()),
        }
    }

    #[track_caller]
    pub fn go(&mut self, motion: &Motion) {
        if let Err(why) = self.try_motion(motion) {
            panic!("{motion:?}\n{why}");
        }
    }

    /// Nothing penetrates anything, but for fingers around what they are about to hold.
    #[track_caller]
    fn assert_apart(&self, motion: &Motion) {
        let state = &self.world.state;
        let all = Around {
            touchable: state.objects.keys().copied().collect(),
            handles: (0..state.setting.scene.containers.len()).map(crate::scene::ContainerId).collect(),
            ..Around::default()
        };
        let machine = state.machine().expect("there is a robot");
        let mut around = Surroundings::new(machine, state.obstacles(&all), state.carried());
        if let Some(touch) = around.touch(&state.base, &state.joints) {
            panic!("after {motion:?} {:?} touch", around.names(&touch));
        }
    }

    /// Tools before the object, at it, and lifted: for a grasp from `side`.
    pub fn grasp(&self, object: ObjectId, side: Side, arms: &[usize]) -> Vec<[ToolWay; 2]> {
        let state = &self.world.state;
        let pose = state.object_pose(object);
        let kind = state.setting.scene.kind_of(object);
        let ways = |tools: &[Isometry3<f64>], pre_m: f64, lift_m: f64| {
            let reach = arms.iter().zip(tools).map(|(arm, tool)| ToolWay {
                arm: *arm,
                vias: vec![back(&(pose * tool), pre_m), pose * tool],
            });
            let lift = arms
                .iter()
                .zip(tools)
                .map(|(arm, tool)| ToolWay { arm: *arm, vias: vec![lifted(&(pose * tool), lift_m)] });
            reach.zip(lift).map(|(reach, lift)| [reach, lift]).collect::<Vec<_>>()
        };
        let grasp = kind.grasps.iter().find(|grasp| {
            grasp.side == side
                && matches!((grasp.hands, arms.len()), (Hands::One(_), 1) | (Hands::Two(..), 2))
        });
        let grasp = grasp.expect("it has such a grasp");
        match grasp.hands {
            Hands::One(tool) => ways(&[tool], grasp.pre_m, grasp.lift_m),
            Hands::Two(left, right) => ways(&[left, right], grasp.pre_m, grasp.lift_m),
        }
    }

    pub fn pick(&mut self, name: &str, side: Side, arms: &[usize]) -> Result<(), String> {
        let object = self.object(name);
        let ways = self.grasp(object, side, arms);
        let near = Around { touchable: vec![object], ..Around::default() };
        self.try_motion(&Motion::Releasing(arms.to_vec()))?;
        self.try_motion(&Motion::MovingTcp(ways.iter().map(|it| it[0].clone()).collect(), near.clone()))?;
        self.try_motion(&Motion::Gripping(arms.to_vec(), Target::Object(object)))?;
        self.try_motion(&Motion::MovingTcp(ways.iter().map(|it| it[1].clone()).take(1).collect(), near))
    }

    /// Puts what the arm holds at a pose in the world, from above.
    pub fn place(&mut self, arm: usize, pose: Isometry3<f64>) -> Result<(), String> {
        let state = &self.world.state;
        let Some(Grip::Object(object, in_tool)) = state.hands.get(&arm).copied() else {
            panic!("the hand is empty")
        };
        let tool = lifted(&pose, 0.004) * in_tool.inverse();
        let arms = state.holders(object);
        self.try_motion(&Motion::MovingTcp(
            vec![ToolWay { arm, vias: vec![lifted(&tool, 0.08), tool] }],
            Around::default(),
        ))?;
        self.try_motion(&Motion::Releasing(arms.clone()))?;
        let near = Around { touchable: vec![object], ..Around::default() };
        let state = &self.world.state;
        let away = arms.iter().map(|arm| ToolWay { arm: *arm, vias: vec![back(&state.tool(*arm), 0.1)] });
        let away = away.collect();
        self.try_motion(&Motion::MovingTcp(away, near))
    }

    pub fn park(&mut self) -> Result<(), String> {
        let arms = self.world.state.machine().expect("there is a robot").limbs.arms.iter().enumerate();
        let parked = arms.map(|(number, arm)| (number, arm.park.clone())).collect();
        self.try_motion(&Motion::MovingArmJoints(parked))
    }

    pub fn drive(&mut self, x: f64, y: f64, yaw: f64) -> Result<(), String> {
        self.try_motion(&Motion::Going(vec![Place::new(x, y, yaw)]))
    }

    pub fn on(&self, surface: &str, x: f64, y: f64, yaw: f64, object: &str) -> Isometry3<f64> {
        let state = &self.world.state;
        let surface = state.setting.scene.surface(surface).expect("the surface exists");
        let kind = state.setting.scene.kind_of(self.object(object));
        state.surface_pose(surface)
            * crate::scene::upright(Vector3::new(x, y, kind.height_above_ground_m()), yaw)
    }
}

#[test]
fn the_kitchen_is_a_scene() {
    let errand = Errand::kitchen("pr2");
    assert_eq!(errand.world.state.objects.len(), 11);
}

#[test]
fn the_shipped_robots_are_those_of_the_names() {
    for (name, chains) in [("pr2", crate::robot::Chains::pr2()), ("one-arm", crate::robot::Chains::one_arm())]
    {
        let list = vm::value::Value::cons(vm::value::Value::symbol("robot"), text::robot(name));
        let entry = crate::read::Entry::of(&list, "the test", 1).expect("it is an entry");
        let read = read_robot::chains(&entry).expect("it is a robot");
        assert_eq!(read, chains);
    }
}

#[test]
fn a_cup_is_carried_to_the_island() {
    let mut errand = Errand::kitchen("pr2");
    errand.go(&Motion::MovingTorso(0.2));
    errand.drive(1.1, 3.35, std::f64::consts::PI).expect("it gets to the sink");
    let _ = errand.pick("cup-1", Side::Front, &[0]).map_err(|why| panic!("{why}"));
    assert_eq!(errand.world.state.ground_of(errand.object("cup-1")), Support::Hand(0));
    errand.park().expect("the arms park");
    errand.drive(2.1, 3.0, 0.0).expect("it gets to the island");
    let goal = errand.on("island_area", 0.2, 0.0, 0.0, "cup-1");
    errand.place(0, goal).expect("it is put down");
    let there = errand.world.state.object_pose(errand.object("cup-1"));
    assert!((there.translation.vector - goal.translation.vector).norm() < 0.01, "{there} {goal}");
    let island = errand.world.state.setting.scene.surface("island_area").expect("there is one");
    assert_eq!(errand.world.state.ground_of(errand.object("cup-1")), Support::Surface(island));
    println!("{:?} {} s", errand.world.costs, errand.now_ns as f64 / 1e9);
}

const WEST: f64 = std::f64::consts::PI;

/// The hand of an arm at a handle, closed around it.
fn hold_handle(errand: &mut Errand, arm: usize, container: &str) -> Result<(), String> {
    let state = &errand.world.state;
    let id = state.setting.scene.container(container).expect("the container exists");
    let tool = state.setting.container_pose(id, state.opening(id)) * state.setting.container(id).handle.tool;
    let near = Around { handles: vec![id], ..Around::default() };
    errand.try_motion(&Motion::Releasing(vec![arm]))?;
    errand.try_motion(&Motion::MovingTcp(vec![ToolWay { arm, vias: vec![back(&tool, 0.1), tool] }], near))?;
    errand.try_motion(&Motion::Gripping(vec![arm], Target::Handle(id)))
}

/// Lets go of a handle and takes the hand away.
fn leave_handle(errand: &mut Errand, arm: usize, container: &str) -> Result<(), String> {
    let id = errand.world.state.setting.scene.container(container).expect("the container exists");
    errand.try_motion(&Motion::Releasing(vec![arm]))?;
    let tool = errand.world.state.tool(arm);
    let near = Around { handles: vec![id], ..Around::default() };
    errand.try_motion(&Motion::MovingTcp(vec![ToolWay { arm, vias: vec![back(&tool, 0.1)] }], near))
}

pub(super) fn open(errand: &mut Errand, arm: usize, container: &str) -> Result<(), String> {
    let id = errand.world.state.setting.scene.container(container).expect("the container exists");
    hold_handle(errand, arm, container)?;
    errand.try_motion(&Motion::MovingContainer(arm, id, None))?;
    leave_handle(errand, arm, container)
}

/// The first place from which something succeeds, out of a grid before a point: for tests that are not about
/// where to stand.
pub(super) fn from_somewhere(
    errand: &Errand,
    near: (f64, f64),
    yaw: f64,
    work: impl Fn(&mut Errand) -> Result<(), String>,
) -> Result<Errand, String> {
    use vm::world::World as _;
    let mut whys = std::collections::BTreeMap::<String, usize>::new();
    for step in 0..49 {
        let (i, j) = (f64::from(step % 7) - 3.0, f64::from(step / 7) - 3.0);
        let mut fork = errand.world.fork();
        let world = std::mem::take(fork.as_any().downcast_mut::<World>().expect("it is one"));
        let mut tried = Errand { world, now_ns: errand.now_ns, seed: errand.seed };
        let done = tried.drive(near.0 + 0.1 * i, near.1 + 0.1 * j, yaw).and_then(|()| work(&mut tried));
        match done {
            Ok(()) => return Ok(tried),
            Err(why) => *whys.entry(why).or_default() += 1,
        }
    }
    Err(format!("{whys:#?}"))
}

#[test]
fn the_fridge_is_opened_and_the_milk_taken_out() {
    let mut errand = Errand::kitchen("pr2");
    errand.go(&Motion::MovingTorso(0.25));
    let errand = from_somewhere(&errand, (1.7, 0.9), WEST, |errand| open(errand, 1, "fridge"));
    let mut errand = errand.unwrap_or_else(|why| panic!("the fridge: {why}"));
    let fridge = errand.world.state.setting.scene.container("fridge").expect("there is one");
    assert!(errand.world.state.opening(fridge) > 1.5);
    assert!(errand.world.belief.open.contains_key(&fridge));
    errand.park().expect("the arms park");
    let taken = from_somewhere(&errand, (1.3, 1.05), WEST, |errand| errand.pick("milk-1", Side::Front, &[1]));
    let taken = taken.unwrap_or_else(|why| panic!("the milk: {why}"));
    assert_eq!(taken.world.state.ground_of(taken.object("milk-1")), Support::Hand(1));
}

#[test]
fn what_is_in_a_drawer_moves_with_it() {
    let mut errand = Errand::kitchen("pr2");
    let spoon = errand.object("spoon-1");
    let before = errand.world.state.object_pose(spoon);
    // It has been seen, some millimetres beside where it is.
    let seen = Translation3::new(0.004, -0.003, 0.005) * before;
    errand.world.belief.seen.insert(spoon, Sight { pose: seen, at_s: 0.0 });
    errand = from_somewhere(&errand, (1.3, 2.5), WEST, |errand| open(errand, 0, "sink_drawer_top"))
        .unwrap_or_else(|why| panic!("{why}"));
    let moved = errand.world.state.object_pose(spoon).translation.vector - before.translation.vector;
    assert!((moved - Vector3::new(0.4, 0.0, 0.0)).norm() < 1e-9, "{moved}");
    let believed = errand.world.belief.seen[&spoon].pose.translation.vector - seen.translation.vector;
    assert!((believed - moved).norm() < 1e-9, "{believed}");
    errand.park().expect("the arms park");
    let taken = from_somewhere(&errand, (1.4, 2.5), WEST, |errand| {
        errand.try_motion(&Motion::MovingTorso(0.3))?;
        errand.pick("spoon-1", Side::Top, &[0])
    });
    taken.unwrap_or_else(|why| panic!("the spoon: {why}"));
}

#[test]
fn an_open_door_is_in_the_way() {
    let mut errand = Errand::kitchen("pr2");
    // Between the sink and the island, where the dishwasher opens.
    let dishwasher = errand.world.state.setting.scene.container("dishwasher").expect("there is one");
    errand.world.state.openings.insert(dishwasher, 1.4);
    errand.world.changed();
    let why = errand.drive(2.2, 2.25, 0.0).expect_err("the door is there");
    assert!(why.contains("base-goal-in-collision") && why.contains("dishwasher"), "{why}");
    errand.world.state.openings.remove(&dishwasher);
    errand.world.changed();
    errand.drive(2.2, 2.25, 0.0).expect("the door is shut");
}

#[test]
fn a_pot_needs_two_hands() {
    let mut errand = Errand::kitchen("pr2");
    errand.go(&Motion::MovingTorso(0.3));
    let pot = errand.object("pot-1");
    // Its left handle shall be at the left hand of a robot that looks west.
    let stove = errand.world.state.setting.scene.surface("stove_area").expect("there is one");
    let turned = errand.on("stove_area", 0.12, 0.0, WEST, "pot-1");
    errand.world.state.put(pot, Support::Surface(stove), &turned);
    errand.world.changed();
    let mut held =
        from_somewhere(&errand, (1.3, 4.3), WEST, |errand| errand.pick("pot-1", Side::Top, &[0, 1]))
            .unwrap_or_else(|why| panic!("{why}"));
    let state = &held.world.state;
    assert_eq!(state.holders(pot), [0, 1]);
    // The chain is closed: whatever the hands do, the pot is in both at the same place.
    let in_hands = |state: &State| [0, 1].map(|arm| state.tool(arm).inverse() * state.object_pose(pot));
    let before = in_hands(state);
    let up = vec![ToolWay { arm: 0, vias: vec![lifted(&state.tool(0), 0.05)] }];
    held.go(&Motion::MovingTcp(up, Around::default()));
    for (before, after) in before.iter().zip(in_hands(&held.world.state)) {
        super::assert_same_pose(before, &after, 1e-6);
    }
    let alone =
        held.try_motion(&Motion::MovingArmJoints(vec![(0, vec![0.0; 7])])).expect_err("two hands hold it");
    assert!(alone.starts_with("hands-bound"), "{alone}");
    held.drive(1.5, 4.3, WEST).expect("it drives with the pot");
    let one = errand.grasp(pot, Side::Top, &[0, 1])[0][0].vias[1];
    errand.drive(1.25, 4.2, WEST).expect("it gets to the stove");
    let missed =
        errand.try_motion(&Motion::Gripping(vec![0], Target::Object(pot))).expect_err("one hand is too few");
    assert!(missed.starts_with("grasp-missed"), "{missed} {one}");
}

#[test]
fn what_stands_on_a_tray_moves_with_it() {
    let mut errand = Errand::kitchen("pr2");
    errand.go(&Motion::MovingTorso(0.3));
    let (tray, cup) = (errand.object("tray-1"), errand.object("cup-1"));
    let island = errand.world.state.setting.scene.surface("island_area").expect("there is one");
    let at = errand.on("island_area", 0.18, 0.0, WEST, "tray-1");
    errand.world.state.put(tray, Support::Surface(island), &at);
    let on_tray = at * crate::scene::upright(Vector3::new(0.05, 0.0, 0.01 + 0.045), 0.0);
    errand.world.state.put(cup, Support::Object(tray), &on_tray);
    errand.world.changed();
    let mut held =
        from_somewhere(&errand, (2.0, 3.1), 0.0, |errand| errand.pick("tray-1", Side::Top, &[0, 1]))
            .unwrap_or_else(|why| panic!("{why}"));
    let relative = |errand: &Errand| {
        errand.world.state.object_pose(tray).inverse() * errand.world.state.object_pose(cup)
    };
    let before = relative(&held);
    assert_eq!(held.world.state.ground_of(cup), Support::Hand(0));
    let base = held.world.state.base;
    held.drive(base.translation.x - 0.2, base.translation.y, 0.0).expect("it drives with the tray");
    super::assert_same_pose(&before, &relative(&held), 1e-9);
    held.drive(base.translation.x, base.translation.y, 0.0).expect("it drives back");
    held.place(0, at).unwrap_or_else(|why| panic!("{why}"));
    assert_eq!(held.world.state.ground_of(cup), Support::Surface(island));
    assert_eq!(held.world.state.root_of(cup), tray);
}

#[test]
fn a_full_drawer_takes_no_more() {
    let mut errand = Errand::at_the_sink(Mode::Projected);
    errand.pick("cup-1", Side::Front, &[0]).expect("the cup is taken");
    // The sink now takes no more than what stands there.
    let sink = errand.world.state.setting.scene.surface("sink_area").expect("there is one");
    let there = errand.world.state.count_on(Support::Surface(sink));
    errand.change_scene(|scene| scene.surfaces[sink.0].capacity = Some(there));
    let goal = errand.on("sink_area", 0.1, -0.15, 0.0, "cup-1");
    let why = errand.place(0, goal).expect_err("it is full");
    assert!(why.starts_with("no-room: `sink_area` is full: 2 objects"), "{why}");
    let cup = errand.object("cup-1");
    assert_eq!(errand.world.state.ground_of(cup), Support::Hand(0), "it is still in the hand");
}

#[test]
fn heavy_and_smooth_things_slip() {
    let mut errand = Errand::at_the_sink(Mode::Projected);
    errand.change_scene(|scene| {
        let cup = scene.kind("cup").expect("there is one");
        (scene.kinds[cup.0].mass_kg, scene.kinds[cup.0].friction) = (3.0, 0.2);
    });
    let why = errand.pick("cup-1", Side::Front, &[0]).expect_err("it is too heavy");
    assert!(why.starts_with("object-slipped"), "{why}");
    let sink = errand.world.state.setting.scene.surface("sink_area").expect("there is one");
    assert_eq!(errand.world.state.ground_of(errand.object("cup-1")), Support::Surface(sink));
}

#[test]
fn what_is_let_go_in_the_air_falls() {
    let mut errand = Errand::at_the_sink(Mode::Projected);
    errand.pick("cup-1", Side::Front, &[0]).expect("the cup is taken");
    errand.drive(1.6, 3.35, WEST).expect("it backs off");
    let why = errand.try_motion(&Motion::Releasing(vec![0])).expect_err("it falls");
    assert!(why.starts_with("object-fell"), "{why}");
    let cup = errand.world.state.object_pose(errand.object("cup-1"));
    assert!(cup.translation.z < 0.1 && cup.translation.z > 0.0, "{cup}");
}

#[test]
fn forks_do_not_influence_one_another() {
    use vm::world::World as _;
    let mut errand = Errand::kitchen("pr2");
    let cup = errand.object("cup-1");
    let before = errand.world.state.clone();
    let mut fork = errand.world.fork();
    let fork = fork.as_any().downcast_mut::<World>().expect("it is one");
    let mut other = Errand { world: std::mem::take(fork), now_ns: 0, seed: 5 };
    other.go_to_the_sink();
    other.pick("cup-1", Side::Front, &[0]).expect("the cup is taken");
    assert_eq!(errand.world.state.objects, before.objects);
    assert_eq!(errand.world.state.joints, before.joints);
    assert_eq!(errand.world.state.base, before.base);
    assert!(errand.world.state.hands.is_empty() && errand.world.belief.seen.is_empty());
    errand.world.state.put(cup, Support::Floor, &Isometry3::translation(1.5, 1.5, 0.045));
    assert_eq!(other.world.state.ground_of(cup), Support::Hand(0));
}

/// All bits of a state, in one number.
fn bits(errand: &Errand) -> u64 {
    let state = &errand.world.state;
    let mut hash = 0u64;
    let mut add = |number: f64| hash = vm::random::mix(hash ^ number.to_bits());
    let mut pose = |pose: &Isometry3<f64>| {
        pose.translation.vector.iter().chain(pose.rotation.coords.iter()).for_each(|number| add(*number));
    };
    pose(&state.base);
    state.objects.keys().for_each(|object| pose(&state.object_pose(*object)));
    state.joints.iter().for_each(|joint| add(*joint));
    add(errand.now_ns as f64);
    hash
}

/// The bits at the end of an errand: `golden` for seed 1, in all processes and on all machines, others for another seed.
#[track_caller]
pub(super) fn check_bits(golden: Expect, errand: impl Fn(u64) -> Errand) {
    let end = |seed| bits(&errand(seed));
    assert_eq!(end(1), end(1));
    assert_ne!(end(1), end(2));
    golden.assert_eq(&format!("{:x}", end(1)));
}

#[test]
fn the_same_seed_gives_the_same_bits() {
    check_bits(expect!["f3a69611c6635ab2"], |seed| {
        let mut errand = Errand::kitchen("pr2");
        errand.seed = seed;
        errand.go_to_the_sink();
        errand.pick("cup-1", Side::Front, &[0]).expect("the cup is taken");
        errand.park().expect("the arms park");
        let goal = errand.on("sink_area", 0.12, -0.3, 0.0, "cup-1");
        errand.place(0, goal).unwrap_or_else(|why| panic!("{why}"));
        errand
    });
}

#[test]
fn belief_is_apart_from_the_truth() {
    use crate::world::Wanted;
    let mut errand = Errand::kitchen("pr2");
    let cup = errand.object("cup-1");
    errand.drive(1.2, 3.35, WEST).expect("it gets to the sink");
    errand.go(&Motion::Looking(errand.world.state.object_pose(cup).translation.vector));
    assert!(errand.world.belief.seen.is_empty());
    errand.go(&Motion::Detecting(Wanted::Kind("cup".into())));
    let (seen, truth) = (errand.world.belief.seen[&cup], errand.world.state.object_pose(cup));
    let off = (seen.pose.translation.vector - truth.translation.vector).norm();
    assert!(off > 1e-6 && off < 0.02, "{off}");
    assert!((seen.at_s - errand.now_ns as f64 / 1e9).abs() < 1e-6);
    // Somebody takes it away; the robot does not know.
    errand.world.state.put(cup, Support::Floor, &Isometry3::translation(4.0, 1.0, 0.045));
    errand.world.changed();
    assert_eq!(errand.world.belief.seen[&cup], seen);
    let why = errand.try_motion(&Motion::Detecting(Wanted::Object(cup))).expect_err("it is not there");
    assert!(why.starts_with("object-not-found"), "{why}");
}

#[test]
fn two_motions_at_once_have_parts_of_their_own() {
    let mut errand = Errand::kitchen("pr2");
    let world = &mut errand.world;
    let (torso, torso_s) = world.begin(&Motion::MovingTorso(0.2), 0, 1);
    let (drive, drive_s) = world.begin(&Motion::Going(vec![Place::new(1.6, 3.0, 0.0)]), 0, 2);
    let (second, _) = world.begin(&Motion::MovingTorso(0.1), 0, 3);
    world.end(second, 500_000_000);
    assert!(matches!(world.take_end(second), Some(Ended::Failed(trouble)) if trouble.kind == "robot-busy"));
    world.end(drive, (drive_s * 1e9) as u64 + 1);
    world.end(torso, (torso_s * 1e9) as u64 + 1);
    assert!(matches!(world.take_end(drive), Some(Ended::Done(_))));
    assert!(matches!(world.take_end(torso), Some(Ended::Done(_))));
    let state = &errand.world.state;
    assert!((state.base.translation.y - 3.0).abs() < 0.02);
    let lift = state.machine().and_then(|it| it.limbs.torso).expect("it has a torso");
    assert!((state.joints[lift.index()] - 0.2).abs() < 1e-9);
}
