//! What robots cost: `cargo bench -p pleach-world [--bench robot] [PATTERN]`.
//!
//! Targets of inverse kinematics are the poses of random configurations within the limits, so each
//! is reachable; seeds are other random configurations, or, for `near`, the configuration a moment
//! ago. Each figure is the median of nine runs, CPU time of the process. Budgets and what was seen:
//! `benches/README.md` beside this file.

use cpu_time::ProcessTime;
use nalgebra::Isometry3;
use world::robot::ik::{Effort, Solver};
use world::robot::urdf::{ONE_ARM, PR2};
use world::robot::{Chain, Chains, Robot};

/// How often each workload runs.
const RUNS: usize = 9;

fn main() {
    let pattern = std::env::args().skip(1).find(|arg| !arg.starts_with("--")).unwrap_or_default();
    let wanted = |name: &str| name.contains(&pattern);
    let pr2 = Robot::from_urdf("pr2.urdf", PR2).expect("the shipped robot is read");
    let one_arm = Robot::from_urdf("one-arm.urdf", ONE_ARM).expect("the shipped robot is read");
    inverse(&wanted, &pr2, &one_arm);
    forward(&wanted, &pr2);
}

// ---------------------------------------------------------------------------------------------
// Measuring

/// Median of the CPU time of `work`, in ns, divided by the number of operations it does.
fn measure(operations: usize, mut work: impl FnMut()) -> f64 {
    let mut times: Vec<f64> = (0..RUNS)
        .map(|_| {
            let start = ProcessTime::now();
            work();
            start.elapsed().as_nanos() as f64
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[RUNS / 2] / operations as f64
}

fn line(name: &str, ns: f64, per: &str, note: &str) {
    println!("{name:<34} {ns:>10.1} ns per {per:<8} {note}");
}

/// Numbers from 0 to 1 (SplitMix64).
struct Dice(u64);

impl Dice {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn configuration(&mut self, chain: &Chain) -> Vec<f64> {
        let pi = std::f64::consts::PI;
        chain
            .limits()
            .iter()
            .map(|limits| limits.unwrap_or((-pi, pi)))
            .map(|(low, high)| low + (high - low) * self.unit())
            .collect()
    }
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
            (solver.chain().forward(&dice.configuration(solver.chain())), dice.configuration(solver.chain()))
        })
        .collect();
    solve_all(name, solver, &targets);
}

/// Seeds are at most 0.05 from the configuration that the target was made of.
fn solve_near(name: &str, solver: &Solver, queries: usize) {
    let mut dice = Dice(2);
    let mut near = || {
        let there = dice.configuration(solver.chain());
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

fn forward(wanted: &dyn Fn(&str) -> bool, pr2: &Robot) {
    let configuration = pr2.zero();
    let mut poses = Vec::new();
    if wanted("forward, all links of the pr2") {
        let ns = measure(10_000, || {
            for _ in 0..10_000 {
                pr2.forward(&Isometry3::identity(), std::hint::black_box(&configuration), &mut poses);
            }
        });
        line("forward, all links of the pr2", ns, "pose set", &format!("{} links", poses.len()));
    }
}
