//! What robots cost: `cargo bench -p pleach-world [--bench robot] [PATTERN]`.
//!
//! Targets of inverse kinematics are the poses of random configurations within the limits, so each
//! is reachable; seeds are other random configurations, or, for `near`, the configuration a moment
//! ago. Each figure is the median of nine runs, CPU time of the process. Budgets and what was seen:
//! `benches/README.md` beside this file.

mod measure;

use nalgebra::{Isometry3, Vector3, Vector6};
use world::robot::collision::{Body, Carried, CollisionModel, Obstacles, Scratch};
use world::robot::ik::{Effort, Solver};
use world::robot::path::{Resolution, joint_path, tool_path};
use world::robot::urdf::{ONE_ARM, PR2};
use world::robot::{Chain, Chains, Limbs, Robot};
use world::shape::{PosedShape, Shape};

use measure::{Dice, measure};

fn main() {
    let pattern = std::env::args().skip(1).find(|arg| !arg.starts_with("--")).unwrap_or_default();
    let wanted = |name: &str| name.contains(&pattern);
    let pr2 = Robot::from_urdf("pr2.urdf", PR2).expect("the shipped robot is read");
    let one_arm = Robot::from_urdf("one-arm.urdf", ONE_ARM).expect("the shipped robot is read");
    let limbs = pr2.limbs(&Chains::pr2()).expect("the parts are there");
    inverse(&wanted, &pr2, &one_arm);
    forward(&wanted, &pr2, &limbs);
    collision(&wanted, &pr2, &limbs);
    ways(&wanted, &pr2, &limbs);
    reading(&wanted);
}

// ---------------------------------------------------------------------------------------------
// Measuring

fn line(name: &str, ns: f64, per: &str, note: &str) {
    println!("{name:<34} {ns:>10.1} ns per {per:<8} {note}");
}

/// A configuration by chance.
fn by_chance(dice: &mut Dice, chain: &Chain) -> Vec<f64> {
    let pi = std::f64::consts::PI;
    chain
        .limits()
        .iter()
        .map(|limits| limits.unwrap_or((-pi, pi)))
        .map(|(low, high)| low + (high - low) * dice.unit())
        .collect()
}

// ---------------------------------------------------------------------------------------------
// Workloads

fn inverse(wanted: &dyn Fn(&str) -> bool, pr2: &Robot, one_arm: &Robot) {
    let pr2_arm = pr2.limbs(&Chains::pr2()).expect("the parts are there").arms.remove(0).chain;
    let other_arm = one_arm.limbs(&Chains::one_arm()).expect("the parts are there").arms.remove(0).chain;
    let with_torso = pr2.chain("base_link", "r_gripper_tool_frame").expect("it is connected");
    for (name, solver, queries) in [
        ("ik pr2 arm, closed form", Solver::new(&pr2_arm), 20_000),
        ("ik pr2 arm, damped", Solver::numeric(&pr2_arm, Effort::default()), 2_000),
        ("ik pr2 torso and arm, damped", Solver::new(&with_torso), 2_000),
        ("ik one arm of six joints, damped", Solver::new(&other_arm), 2_000),
    ] {
        if wanted(name) {
            solve_random(name, &solver, queries);
        }
        let near = format!("{name}, near");
        if wanted(&near) {
            solve_near(&near, &solver, queries);
        }
    }
}

fn solve_random(name: &str, solver: &Solver, queries: usize) {
    let mut dice = Dice(1);
    let targets: Vec<(Isometry3<f64>, Vec<f64>)> = (0..queries)
        .map(|_| {
            (
                solver.chain().forward(&by_chance(&mut dice, solver.chain())),
                by_chance(&mut dice, solver.chain()),
            )
        })
        .collect();
    solve_all(name, solver, &targets);
}

/// Seeds are at most 0.05 from the configuration that the target was made of.
fn solve_near(name: &str, solver: &Solver, queries: usize) {
    let mut dice = Dice(2);
    let mut near = || {
        let there = by_chance(&mut dice, solver.chain());
        let here = there.iter().map(|value| value + 0.1 * (dice.unit() - 0.5)).collect();
        (solver.chain().forward(&there), here)
    };
    let targets: Vec<(Isometry3<f64>, Vec<f64>)> = (0..queries).map(|_| near()).collect();
    solve_all(name, solver, &targets);
}

fn solve_all(name: &str, solver: &Solver, targets: &[(Isometry3<f64>, Vec<f64>)]) {
    let mut out = vec![0.0; solver.chain().variables().len()];
    let mut solved = 0;
    let mut worst = 0.0_f64;
    for (number, (target, seed)) in targets.iter().enumerate() {
        if solver.solve(target, seed, number as u64, &mut out).is_ok() {
            solved += 1;
            let reached = solver.chain().forward(&out);
            let distance = (reached.translation.vector - target.translation.vector).norm();
            worst = worst.max(distance).max(reached.rotation.angle_to(&target.rotation));
        }
    }
    let ns = measure(targets.len(), || {
        for (number, (target, seed)) in targets.iter().enumerate() {
            let _ = std::hint::black_box(solver.solve(target, seed, number as u64, &mut out));
        }
    });
    let share = 100.0 * f64::from(solved) / targets.len() as f64;
    line(name, ns, "query", &format!("{share:.2} % solved, worst error {worst:.1e}"));
}

fn forward(wanted: &dyn Fn(&str) -> bool, pr2: &Robot, limbs: &Limbs) {
    let configuration = pr2.zero();
    let mut poses = Vec::new();
    if wanted("forward, all links of the pr2") {
        let ns = measure(10_000, || {
            for _ in 0..10_000 {
                pr2.forward(&Isometry3::identity(), std::hint::black_box(&configuration), &mut poses);
            }
        });
        line("forward, all links of the pr2", ns, "call", &format!("{} links", poses.len()));
    }
    if wanted("jacobian of the pr2 arm") {
        let arm = &limbs.arms[0];
        let mut columns = [Vector6::zeros(); 7];
        let ns = measure(10_000, || {
            for _ in 0..10_000 {
                std::hint::black_box(arm.chain.jacobian(std::hint::black_box(&arm.park), &mut columns));
            }
        });
        line("jacobian of the pr2 arm", ns, "call", "");
    }
}

/// Boxes as a kitchen has them: walls, counters, shelves, and small things on them.
fn kitchen() -> Obstacles {
    let mut dice = Dice(3);
    let mut things = Obstacles::default();
    let mut add = |size: Vector3<f64>, at: Vector3<f64>| {
        let shape = PosedShape { pose: Isometry3::identity(), shape: Shape::Box { size } };
        things.push("thing", &Body::new(&[shape]), &Isometry3::new(at, Vector3::zeros()), &[]);
    };
    for side in [-1.0, 1.0] {
        add(Vector3::new(0.1, 6.0, 2.5), Vector3::new(3.0 * side, 0.0, 1.25));
        add(Vector3::new(6.0, 0.1, 2.5), Vector3::new(0.0, 3.0 * side, 1.25));
        for shelf in 0..10 {
            let z = 0.1 * f64::from(shelf);
            add(Vector3::new(0.6, 3.0, 0.03), Vector3::new(2.0 * side, 0.0, z));
        }
    }
    for _ in 0..76 {
        let at = Vector3::new(1.2 + dice.unit(), 4.0 * dice.unit() - 2.0, 0.9 + 0.4 * dice.unit());
        add(Vector3::new(0.08, 0.08, 0.15), at);
    }
    things
}

fn collision(wanted: &dyn Fn(&str) -> bool, robot: &Robot, limbs: &Limbs) {
    let model = CollisionModel::new(robot, limbs);
    let mut scratch = Scratch::default();
    let mut dice = Dice(4);
    let carried = limbs.arms.iter().map(|arm| Carried {
        name: "cup".into(),
        link: arm.chain.tip(),
        pose_in_link: Isometry3::identity(),
        body: Body::moving(&[PosedShape {
            pose: Isometry3::identity(),
            shape: Shape::Cylinder { radius: 0.04, length: 0.1 },
        }]),
        may_touch: arm.gripper.as_ref().map_or_else(Vec::new, |gripper| gripper.fingers.clone()),
    });
    let carried: Vec<Carried> = carried.collect();
    let mut samples: Vec<Vec<Isometry3<f64>>> = Vec::new();
    while samples.len() < 500 {
        let mut configuration = robot.zero();
        for arm in &limbs.arms {
            arm.chain.place(&by_chance(&mut dice, &arm.chain), &mut configuration);
        }
        let mut poses = Vec::new();
        robot.forward(&Isometry3::identity(), &configuration, &mut poses);
        // Only free ones: what touches is answered sooner.
        if model.self_touch(&poses, &carried, &mut scratch).is_none() {
            samples.push(poses);
        }
    }
    let all = kitchen();
    for (name, obstacles) in
        [("touch, robot and two cups alone", &Obstacles::default()), ("touch, in a room of 100 things", &all)]
    {
        if wanted(name) {
            let mut touching = 0;
            let ns = measure(samples.len(), || {
                touching = 0;
                for poses in &samples {
                    touching += i32::from(model.touch(poses, &carried, obstacles, &mut scratch).is_some());
                }
            });
            let share = 100.0 * f64::from(touching) / samples.len() as f64;
            line(name, ns, "check", &format!("{} pairs, {share:.0} % touch", model.pairs().count()));
        }
    }
}

fn ways(wanted: &dyn Fn(&str) -> bool, robot: &Robot, limbs: &Limbs) {
    let model = CollisionModel::new(robot, limbs);
    let (mut scratch, mut poses, all) = (Scratch::default(), Vec::new(), kitchen());
    let arm = &limbs.arms[0];
    let solver = Solver::new(&arm.chain);
    let start = [0.3, 0.4, 0.5, -1.5, 0.5, -0.9, 0.2];
    let from = arm.chain.forward(&start);
    if wanted("way of a tool, 0.3 m") {
        let via = Isometry3::translation(0.1, 0.1, 0.1) * from;
        let vias = [Isometry3::translation(0.0, 0.0, 0.13) * from, via];
        let mut steps = 0;
        let ns = measure(200, || {
            for _ in 0..200 {
                let path = tool_path(&solver, &start, &vias, Resolution::default(), 0);
                steps = path.map_or(0, |path| path.configurations.len());
            }
        });
        line("way of a tool, 0.3 m", ns, "way", &format!("{steps} steps"));
    }
    if wanted("way of joints, checked") {
        let mut configuration = robot.zero();
        for arm in &limbs.arms {
            arm.chain.place(&arm.park, &mut configuration);
        }
        let mut free = true;
        let ns = measure(20, || {
            for _ in 0..20 {
                free = joint_path(&arm.park, &start, 0.05, |at| {
                    arm.chain.place(at, &mut configuration);
                    robot.forward(&Isometry3::identity(), &configuration, &mut poses);
                    model.touch(&poses, &[], &all, &mut scratch)
                })
                .is_ok();
            }
        });
        line("way of joints, checked", ns, "way", &format!("39 steps of 0.05 rad, free: {free}"));
    }
}

fn reading(wanted: &dyn Fn(&str) -> bool) {
    if wanted("reading the pr2") {
        let ns = measure(20, || {
            for _ in 0..20 {
                std::hint::black_box(Robot::from_urdf("pr2.urdf", PR2)).expect("it is read");
            }
        });
        line("reading the pr2", ns, "file", "");
    }
    let robot = Robot::from_urdf("pr2.urdf", PR2).expect("it is read");
    let limbs = robot.limbs(&Chains::pr2()).expect("the parts are there");
    if wanted("making its collision model") {
        let ns = measure(20, || {
            for _ in 0..20 {
                std::hint::black_box(CollisionModel::new(&robot, &limbs));
            }
        });
        line("making its collision model", ns, "model", "");
    }
}
