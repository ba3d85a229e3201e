//! Whole errands in the shipped kitchen.

use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};

use super::text;
use crate::motions::Surroundings;
use crate::motions::hand::Target;
use crate::motions::tool::ToolWay;
use crate::nav::Place;
use crate::read_robot;
use crate::scene::grasp::{back, lifted};
use crate::scene::{Hands, ObjectId, Scene, Side};
use crate::setting::Setting;
use crate::state::{Around, Grip, State, Support};
use crate::world::{Ended, Motion, World};

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
