//! What one errand costs: `cargo bench -p pleach-world --bench errand`.
//!
//! The shipped kitchen and PR2: to the sink, take the cup, to the island, put it down. No language. Each
//! figure is the median of nine runs, CPU time of the process; budgets and what was seen: `README.md`.

mod measure;
#[path = "../src/tests/text.rs"]
#[allow(dead_code)]
mod text;

use std::sync::Arc;

use cpu_time::ProcessTime;
use nalgebra::{Isometry3, Vector3};
use vm::world::World as _;
use world::motions::base::Maps;
use world::motions::hand::{Target, releasing};
use world::motions::tool::ToolWay;
use world::nav::Place;
use world::places::{Distance, to_put, to_stand};
use world::rehearse::{moved, rehearse, seen};
use world::scene::grasp::{back, lifted};
use world::scene::{Hands, Scene, Side, upright};
use world::setting::Setting;
use world::state::{Around, Grip, State, Support};
use world::world::{Ended, Mode, Motion, World};

use measure::{RUNS, measure, median};

const WEST: f64 = std::f64::consts::PI;

fn main() {
    let scene = Scene::read(&text::kitchen()).expect("the shipped scene is read");
    line("reading the scene", measure(1, || drop(Scene::read(&text::kitchen()))), "scene");
    let machine = world::read_robot::machine(&text::robot("pr2")).expect("the shipped robot is read");
    let setting = Arc::new(Setting::new(scene, Some(Arc::new(machine))));
    let start = State::new(setting, Place::new(1.6, 2.0, 0.0).pose());
    errand(&mut Stage::new(&start));
    line("an errand: take a cup, put it down", measure(1, || errand(&mut Stage::new(&start))), "errand");
    parts(&start, Mode::Projected);
    let simulated = || errand(&mut Stage { world: in_mode(&start, Mode::Simulated), ..Stage::new(&start) });
    line("the same, simulated", measure(1, simulated), "errand");
    parts(&start, Mode::Simulated);
    questions(&start);
}

fn in_mode(start: &State, mode: Mode) -> World {
    let mut world = World::new(start.clone());
    world.mode = mode;
    world
}

fn line(name: &str, ns: f64, per: &str) {
    println!("{name:<44} {:>10.1} µs per {per}", ns / 1000.0);
}

struct Stage {
    world: World,
    now_ns: u64,
    /// CPU time of each motion.
    times: Vec<(&'static str, f64)>,
}

impl Stage {
    fn new(start: &State) -> Stage {
        Stage { world: World::new(start.clone()), now_ns: 0, times: Vec::new() }
    }

    fn go(&mut self, name: &'static str, motion: &Motion) {
        let begin = ProcessTime::now();
        let (number, duration_s) = self.world.begin(motion, self.now_ns, 1);
        self.now_ns += (duration_s * 1e9) as u64 + 1;
        self.world.end(number, self.now_ns);
        self.times.push((name, begin.elapsed().as_nanos() as f64));
        if let Some(Ended::Failed(trouble)) = self.world.take_end(number) {
            panic!("{name}: {}", trouble.message);
        }
    }
}

fn errand(stage: &mut Stage) {
    stage.go("torso", &Motion::MovingTorso(0.2));
    stage.go("drive to the sink", &Motion::Going(vec![Place::new(1.1, 3.35, WEST)]));
    let state = &stage.world.state;
    let cup = state.setting.scene.object("cup-1").expect("there is a cup");
    let grasp = state.setting.scene.kind_of(cup).grasps.iter().find(|it| it.side == Side::Front).copied();
    let Some(Hands::One(in_object)) = grasp.map(|it| it.hands) else { panic!("it has a grasp") };
    let tool = state.object_pose(cup) * in_object;
    let near = Around { touchable: vec![cup], ..Around::default() };
    stage.go("open the hand", &Motion::Releasing(vec![0]));
    let reach = ToolWay { arm: 0, vias: vec![back(&tool, 0.1), tool] };
    stage.go("reach", &Motion::MovingTcp(vec![reach], near.clone()));
    stage.go("grip", &Motion::Gripping(vec![0], Target::Object(cup)));
    let lift = ToolWay { arm: 0, vias: vec![lifted(&tool, 0.06)] };
    stage.go("lift", &Motion::MovingTcp(vec![lift], near));
    let park =
        stage.world.state.machine().expect("there is a robot").limbs.arms.iter().map(|arm| arm.park.clone());
    let park = park.enumerate().collect();
    stage.go("park", &Motion::MovingArmJoints(park));
    stage.go("drive to the island", &Motion::Going(vec![Place::new(2.1, 3.0, 0.0)]));
    let tool = place_tool(&stage.world.state);
    let down = ToolWay { arm: 0, vias: vec![lifted(&tool, 0.08), tool] };
    stage.go("reach down", &Motion::MovingTcp(vec![down], Around::default()));
    stage.go("release, settle", &Motion::Releasing(vec![0]));
}

/// Where the tool is when the cup is just above the island.
fn place_tool(state: &State) -> Isometry3<f64> {
    let island = state.setting.scene.surface("island_area").expect("there is an island");
    let Some(Grip::Object(_, in_tool)) = state.hands.get(&0) else { panic!("the cup is in the hand") };
    state.surface_pose(island) * upright(Vector3::new(0.2, 0.0, 0.049), 0.0) * in_tool.inverse()
}

fn parts(start: &State, mode: Mode) {
    let mut all: Vec<Vec<(&str, f64)>> = Vec::new();
    for _ in 0..RUNS {
        let mut stage = Stage { world: in_mode(start, mode), ..Stage::new(start) };
        errand(&mut stage);
        all.push(stage.times);
    }
    for (number, (name, _)) in all[0].iter().enumerate() {
        let times = all.iter().map(|run| run[number].1).collect();
        line(&format!("  {name}"), median(times), "motion");
    }
}

fn questions(start: &State) {
    let stage = World::new(start.clone());
    const MANY: usize = 1000;
    line("fork", measure(MANY, || (0..MANY).for_each(|_| drop(std::hint::black_box(stage.fork())))), "fork");
    let around = Around::default();
    line(
        "obstacles of a version",
        measure(MANY, || (0..MANY).for_each(|_| drop(std::hint::black_box(start.obstacles(&around))))),
        "version",
    );
    let cup = start.setting.scene.object("cup-1").expect("there is a cup");
    candidates(start);
    let mut held = start.clone();
    held.take(cup, &[0]);
    line(
        "release in the air, fall, roll",
        measure(1, || drop(std::hint::black_box(releasing(&held, &[0])))),
        "fall",
    );
}

/// What a plan may ask before anything moves.
fn candidates(start: &State) {
    let maps = Maps::default();
    let scene = &start.setting.scene;
    let cup = scene.object("cup-1").expect("there is a cup");
    let front = scene.kind_of(cup).grasps.iter().find(|it| it.side == Side::Front).map(|it| it.hands);
    let Some(Hands::One(in_object)) = front else { panic!("it has a grasp") };
    let tool = start.object_pose(cup) * in_object;
    let near = Around { touchable: vec![cup], ..Around::default() };
    let motions = [
        Motion::Releasing(vec![0]),
        Motion::MovingTcp(vec![ToolWay { arm: 0, vias: vec![back(&tool, 0.1), tool] }], near.clone()),
        Motion::Gripping(vec![0], Target::Object(cup)),
        Motion::MovingTcp(vec![ToolWay { arm: 0, vias: vec![lifted(&tool, 0.06)] }], near),
    ];
    let distance = Distance { least_m: 0.35, best_m: 0.65, most_m: 0.95 };
    let stand = || to_stand(start, &maps, tool.translation.vector.xy(), distance, 1, 40).unwrap_or_default();
    let bases = stand();
    line("places to stand at for a cup", measure(1, || drop(stand())), "list");
    let mind = start.parked();
    let works = |place: &Place| rehearse(&moved(&mind, &place.pose()), start, &motions, 0).is_ok();
    let one = bases.iter().copied().find(works).expect("the cup can be taken");
    line("take the cup, in the mind", measure(1, || _ = std::hint::black_box(works(&one))), "place");
    let all = || bases.iter().filter(|place| works(place)).count();
    let name = format!("the same from {} places, {} work", bases.len(), all());
    line(&name, measure(1, || _ = std::hint::black_box(all())), "list");
    let island = Support::Surface(scene.surface("island_area").expect("there is one"));
    let put = || drop(to_put((start, start), &maps, cup, island, None, 1, 40));
    line("places to put a cup on the island", measure(1, put), "list");
    let there = moved(&mind, &one.pose());
    let points = [tool.translation.vector; 5];
    line("points that a camera sees", measure(1, || drop(seen(&there, &points))), "five");
}
