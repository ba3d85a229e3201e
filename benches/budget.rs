//! The budgets of the language core, measured: `cargo bench --bench budget [PATTERN]`.
//!
//! Each workload is a program of the language, run several times; the figure is the median of
//! the CPU time per operation. Where `lua5.4` is installed, the same workload runs there in
//! between, and the ratio of the two medians is printed: on a shared machine only ratios of one
//! run can be trusted. Tasks are compared with those of the other engines that are found. Figures and how they are judged: `vm/benches/README.md`.

mod measure;

use std::process::Command;

use measure::{median, timed};
use pleach::{Options, Session};
use vm::machine::Progress;
use vm::value::Value;

/// How often each workload runs.
const RUNS: usize = 9;

fn main() {
    if let Some(n) = std::env::var(MEASURE_BYTES).ok().and_then(|n| n.parse().ok()) {
        return println!("{}", parked_bytes(n));
    }
    measure::begin(all);
}

fn all(wanted: &dyn Fn(&str) -> bool) {
    functions(wanted);
    plans(wanted);
    loops(wanted);
    depth(wanted);
    failures(wanted);
    tasks(wanted);
    fluents(wanted);
    text(wanted);
}

// ---------------------------------------------------------------------------------------------
// Measuring

fn line(name: &str, ns: f64, per: &str, note: &str) {
    println!("{name:<34} {ns:>10.1} ns per {per:<8} {note}");
}

/// A session with a program loaded, and what it calls.
struct Program {
    session: Session,
    function: vm::FnId,
}

impl Program {
    fn new(text: &str, function: &str) -> Program {
        let mut session = Session::new(Options::default());
        let loaded = session.load_text("bench.plan", text);
        let errors: Vec<String> = loaded.reports.iter().map(|report| session.report(report)).collect();
        assert!(errors.is_empty(), "{}", errors.join("\n"));
        for init in loaded.init {
            session.call(init, Vec::new(), &mut String::new()).expect("the file loads");
        }
        let function = session.plan(function).expect("the function is defined");
        Program { session, function }
    }

    fn run(&mut self, args: &[i64]) -> (Value, f64) {
        let args = args.iter().map(|arg| Value::int(*arg)).collect();
        let (outcome, ns) = timed(|| self.session.call(self.function, args, &mut String::new()));
        (outcome.expect("it succeeds"), ns)
    }
}

/// An engine that does some of the workloads as well, where it is installed.
struct Peer {
    name: &'static str,
    command: &'static str,
    script: &'static str,
}

/// The one that functions are judged by, then others that have tasks.
const PEERS: [Peer; 3] = [
    Peer { name: "Lua 5.4", command: "lua5.4", script: "peer.lua" },
    Peer { name: "LuaJIT", command: "luajit", script: "peer.lua" },
    Peer { name: "Python's generators", command: "python3", script: "peer.py" },
];

impl Peer {
    /// Milliseconds of a workload, or what else it is asked for.
    fn run(&self, workload: &str) -> Option<f64> {
        let script = format!("{}/benches/{}", env!("CARGO_MANIFEST_DIR"), self.script);
        let output = Command::new(self.command).args([&script, workload]).output().ok()?;
        String::from_utf8(output.stdout).ok()?.trim().parse().ok()
    }
}

/// Milliseconds of a workload in Lua 5.4, if it is installed.
fn lua(workload: &str) -> Option<f64> {
    PEERS[0].run(workload)
}

/// A workload of ours that runs in turns with those of the peers that are found, if they have it: nanoseconds of
/// ours, and ratios to theirs. Each does so many operations.
fn beside_peers(workload: Option<&str>, operations: f64, mut ours: impl FnMut() -> f64) -> (f64, String) {
    let mut times = Vec::new();
    let mut theirs = PEERS.map(|_| Vec::new());
    for _ in 0..RUNS {
        times.push(ours());
        for (peer, times) in PEERS.iter().zip(&mut theirs) {
            times.extend(workload.and_then(|workload| peer.run(workload)));
        }
    }
    let ours = median(times);
    let found = PEERS.iter().zip(theirs).filter(|(_, times)| !times.is_empty());
    let ratios = found.map(|(peer, times)| format!("{:.2} x {}", ours / (median(times) * 1e6), peer.name));
    (ours / operations, ratios.collect::<Vec<_>>().join(", "))
}

// ---------------------------------------------------------------------------------------------
// Workloads

const FUNCTIONS: &str = "
(def-fun fib (n) (if (< n 2) n (+ (fib (- n 1)) (fib (- n 2)))))
(def-fun tak (x y z) (if (>= y x) z (tak (tak (- x 1) y z) (tak (- y 1) z x) (tak (- z 1) x y))))
(def-fun join2 (a b) (if (null? a) b (cons (first a) (join2 (rest a) b))))
(def-fun ok (row dist placed)
  (or (null? placed)
      (let ((p (first placed)))
        (and (not (= p (+ row dist))) (not (= p (- row dist))) (ok row (+ dist 1) (rest placed))))))
(def-fun try (x y z)
  (if (null? x)
      (if (null? y) 1 0)
      (+ (if (ok (first x) 1 z) (try (join2 (rest x) y) nil (cons (first x) z)) 0)
         (try (rest x) (cons (first x) y) z))))
(def-fun queens (n) (let ((l nil) (i n)) (while (> i 0) (set! l (cons i l)) (set! i (- i 1))) (try l nil nil)))
(def-fun closures (n) (let ((acc 0)) (dotimes (i n) (set! acc ((lambda (x) (mod (+ x i) 1000003)) acc))) acc))
";

fn functions(wanted: &dyn Fn(&str) -> bool) {
    // Name, arguments, calls in one run as the budget experiment counts them, result.
    let workloads: [(&str, &str, &[i64], f64, i64); 4] = [
        ("fib30", "fib", &[30], 2_692_537.0, 832_040),
        ("tak", "tak", &[24, 16, 8], 2_493_349.0, 9),
        ("queens10", "queens", &[10], 695_127.0, 724),
        ("closure", "closures", &[1_000_000], 1_000_000.0, -1),
    ];
    let mut product = 1.0;
    let mut compared = 0;
    for (name, function, args, calls, expected) in workloads {
        if !wanted(name) {
            continue;
        }
        let (mut ours, mut theirs) = (Vec::new(), Vec::new());
        let mut program = Program::new(FUNCTIONS, function);
        for _ in 0..RUNS {
            let (value, time) = program.run(args);
            assert!(expected < 0 || value == Value::int(expected), "{name} gives {value:?}");
            ours.push(time);
            theirs.extend(lua(name));
        }
        let ours = median(ours);
        let note = match theirs.is_empty() {
            true => "lua5.4 is not installed".to_string(),
            false => {
                let ratio = ours / (median(theirs) * 1e6);
                if name != "closure" {
                    product *= ratio;
                    compared += 1;
                }
                format!("{ratio:.2} x Lua 5.4")
            }
        };
        line(name, ours / calls, "call", &note);
    }
    if compared == 3 {
        println!("{:<34} {:>10.2} x Lua 5.4 (must 1.0)", "geometric mean", f64::powf(product, 1.0 / 3.0));
    }
}

const PLANS: &str = "
(def-plan fib (n) (if (< n 2) n (+ (fib (- n 1)) (fib (- n 2)))))
(def-plan leaf (i) i)
(def-plan rounds (n) (dotimes (i n) (leaf i)))
(def-plan elements (xs) (dolist (x xs) (leaf x)))
(def-plan down (n) (let ((i n)) (while (> i 0) (set! i (- i 1)) (leaf i))))
(def-fun through (i) (leaf i))
(def-plan functions (n) (dotimes (i n) (through i)))
";
const NODES: f64 = 242_785.0;

fn plans(wanted: &dyn Fn(&str) -> bool) {
    if wanted("plan/fresh") {
        let mut times = Vec::new();
        let mut bytes = 0.0;
        for _ in 0..RUNS {
            let mut program = Program::new(PLANS, "fib");
            times.push(program.run(&[25]).1);
            bytes = program.session.machine.tree().bytes() as f64 / NODES;
        }
        line(
            "plan/fresh",
            median(times) / NODES,
            "call",
            &format!("{bytes:.0} bytes per node (must 120 ns, 160 B)"),
        );
    }
    for (name, keep, must) in [("plan/reused", false, 55), ("plan/again", true, 55)] {
        if !wanted(name) {
            continue;
        }
        let mut program = Program::new(PLANS, "fib");
        program.run(&[25]);
        let mut times = Vec::new();
        for _ in 0..RUNS {
            program.session.machine.restart(keep);
            times.push(program.run(&[25]).1);
        }
        line(name, median(times) / NODES, "call", &format!("(must {must} ns)"));
    }
    edited(wanted);
}

/// Plan calls in a copy of a tree, with edits of a parameter at some of the slots.
fn edited(wanted: &dyn Fn(&str) -> bool) {
    let workloads = [
        ("plan/edits-nowhere", None, "i", "copying the tree included, as in those that follow"),
        ("plan/edits-at-1-percent", Some(100), "i", "same value"),
        ("plan/edits-everywhere", Some(1), "i", "same value, must + 20 ns"),
        ("plan/edits-other-value", Some(1), "(+ i 1)", "another value, must + 20 ns"),
    ];
    for (name, every, value, note) in workloads {
        if !wanted(name) {
            continue;
        }
        let text = format!(
            "{PLANS}
             (def-plan main ()
               (let* ((tree (run-plan rounds :args '(10000)))
                      (edits (map (lambda (i) (with-param (make-path (list 'rounds (list 'leaf (+ 1 (* {} i))))) :i {value}))
                                  (range 0 {}))))
                 (edit-tree tree edits)))
             (def-plan again (tree) (run-plan rounds :args '(10000) :tree tree))",
            every.unwrap_or(0),
            every.map_or(0, |every| 10_000 / every)
        );
        let mut program = Program::new(&text, "main");
        let tree = program.run(&[]).0;
        let again = program.session.plan("again").expect("it is defined");
        let mut times = Vec::new();
        for _ in 0..RUNS {
            let call = || program.session.call(again, vec![tree.clone()], &mut String::new());
            let (outcome, ns) = timed(call);
            outcome.expect("it succeeds");
            times.push(ns);
        }
        line(name, median(times) / 10_000.0, "call", &format!("({note})"));
    }
}

fn loops(wanted: &dyn Fn(&str) -> bool) {
    for (plan, what) in [("rounds", "dotimes"), ("down", "while"), ("functions", "through a function")] {
        for n in [100, 1_000, 10_000, 100_000] {
            let name = format!("loop/{plan}/{n}");
            if !wanted(&name) {
                continue;
            }
            let mut program = Program::new(PLANS, plan);
            program.run(&[n]);
            let repeat = 100_000 / n;
            let mut times = Vec::new();
            for _ in 0..RUNS {
                let mut time = 0.0;
                for _ in 0..repeat {
                    program.session.machine.restart(false);
                    time += program.run(&[n]).1;
                }
                times.push(time / repeat as f64);
            }
            line(&name, median(times) / n as f64, "call", what);
        }
    }
}

const DEEP: &str = "
(def-fun deep (n) (if (= n 0) 0 (+ 1 (deep (- n 1)))))
(def-plan plan-deep (n) (if (= n 0) 0 (+ 1 (plan-deep (- n 1)))))
";

fn depth(wanted: &dyn Fn(&str) -> bool) {
    for (name, function, must) in [("depth/functions", "deep", 64), ("depth/plans", "plan-deep", 250)] {
        if !wanted(name) {
            continue;
        }
        const DEPTH: i64 = 1_000_000;
        let mut times = Vec::new();
        for _ in 0..3 {
            times.push(Program::new(DEEP, function).run(&[DEPTH]).1);
        }
        // Half-way down, what the frames and their nodes take.
        let mut program = Program::new(DEEP, function);
        let machine = &mut program.session.machine;
        let nodes = machine.tree().bytes();
        machine.start(program.function, vec![Value::int(DEPTH)]);
        let stop = machine.steps() + DEPTH as u64 / 2;
        let progress = program.session.go(&mut String::new(), Some(stop));
        assert!(matches!(progress, Progress::Stopped));
        let machine = &program.session.machine;
        let bytes = (machine.frame_bytes() + machine.tree().bytes() - nodes) as f64 / (DEPTH as f64 / 2.0);
        line(
            name,
            median(times) / DEPTH as f64,
            "call",
            &format!("{bytes:.0} bytes per level (must {must} B)"),
        );
    }
}

const FAIL: &str = "
(def-failure oops)
(def-fun fdown (n) (if (= n 0) (fail oops :n n) (+ 1 (fdown (- n 1)))))
(def-plan pdown (n) (if (= n 0) (fail oops :n n) (+ 1 (pdown (- n 1)))))
(def-fun cdown (n) (if (= n 0) (fail oops :n n) (+ 1 (unwind-protect (cdown (- n 1)) nil))))
(def-fun functions (n) (dotimes (i n) (with-failure-handling ((oops (e) (return 0))) (fdown 9))))
(def-fun plans (n) (dotimes (i n) (with-failure-handling ((oops (e) (return 0))) (pdown 9))))
(def-fun cleanups (n) (dotimes (i n) (with-failure-handling ((oops (e) (return 0))) (cdown 9))))
";

fn failures(wanted: &dyn Fn(&str) -> bool) {
    for (name, function, must) in [
        ("fail/functions", "functions", 250),
        ("fail/plans", "plans", 600),
        ("fail/clean-ups", "cleanups", 650),
    ] {
        if !wanted(name) {
            continue;
        }
        const FAILURES: i64 = 20_000;
        let mut program = Program::new(FAIL, function);
        program.run(&[FAILURES]);
        let mut times = Vec::new();
        for _ in 0..RUNS {
            program.session.machine.restart(false);
            times.push(program.run(&[FAILURES]).1);
        }
        line(
            name,
            median(times) / FAILURES as f64,
            "failure",
            &format!("through 10 frames (must {must} ns)"),
        );
    }
}

const TASKS: &str = "
(def-plan ends (xs rounds) (dotimes (i rounds) (par-loop (x xs) x)))
(def-plan parks (xs rounds)
  (dotimes (i rounds) (let ((go (fluent))) (par (par-loop (x xs) (wait-for go)) (seq (sleep 1) (set-value go true))))))
(def-plan sleeps (xs rounds) (dotimes (i rounds) (par-loop (x xs) (sleep x))))
(def-plan evaporates (xs rounds) (dotimes (i rounds) (pursue (par-loop (x xs) (sleep 1000000)) (sleep 1))))
(def-plan parked (xs forms)
  (let ((go (fluent)))
    (par
      (par-loop (form forms) (par-loop (x xs) (wait-for go)))
      (seq (sleep 1) (dotimes (i 10000000)) (set-value go true)))))
(def-plan hands-over (n)
  (let ((ping (fluent)) (pong (fluent)))
    (par
      (dotimes (i n) (set-value ping true) (wait-for pong) (set-value pong false))
      (dotimes (i n) (wait-for ping) (set-value ping false) (set-value pong true)))))
";
/// Branches in one run, however many are in one form.
const BRANCHES: i64 = 100_000;

fn tasks(wanted: &dyn Fn(&str) -> bool) {
    let workloads = [
        ("task/ends/10", "ends", 10, "must 300 ns"),
        ("task/ends/1000", "ends", 1_000, "must 300 ns"),
        ("task/ends/100000", "ends", BRANCHES, "must 500 ns"),
        ("task/waits/10", "parks", 10, "parked, woken by one fluent"),
        ("task/waits/1000", "parks", 1_000, "parked, woken by one fluent"),
        ("task/waits/100000", "parks", BRANCHES, "parked, woken by one fluent"),
        ("task/timers/100000", "sleeps", BRANCHES, "each with a time of its own, must 700 ns"),
        ("task/evaporated/100000", "evaporates", BRANCHES, "sleepers, started and stopped"),
    ];
    for (name, plan, n, note) in workloads {
        if !wanted(name) {
            continue;
        }
        let mut program = Program::new(TASKS, plan);
        let args = vec![Value::list((0..n).map(Value::int).collect::<Vec<_>>()), Value::int(BRANCHES / n)];
        let ours = || {
            program.session.machine.restart(false);
            let (outcome, time) =
                timed(|| program.session.call(program.function, args.clone(), &mut String::new()));
            outcome.expect("it succeeds");
            time
        };
        let peers = (plan == "parks").then(|| format!("park{n}"));
        let (time, ratios) = beside_peers(peers.as_deref(), BRANCHES as f64, ours);
        line(name, time, "branch", &format!("({note}) {ratios}"));
    }
    for n in [10, 1_000, BRANCHES] {
        let name = format!("task/bytes/{n}");
        if wanted(&name) {
            let this = std::env::current_exe().expect("it runs");
            let output = Command::new(this).env(MEASURE_BYTES, n.to_string()).output();
            let bytes = output.ok().and_then(|it| String::from_utf8(it.stdout).ok()).unwrap_or_default();
            let theirs = PEERS.iter().filter_map(|peer| Some((peer.name, peer.run("bytes")?)));
            let theirs: Vec<String> = theirs.map(|(name, bytes)| format!("{name} {bytes:.0}")).collect();
            let (bytes, theirs) = (bytes.trim(), theirs.join(", "));
            println!("{name:<34} {bytes:>10} bytes per branch that waits (must 600) {theirs}");
        }
    }
    if wanted("task/hand-off") {
        const ROUNDS: i64 = 50_000;
        let mut program = Program::new(TASKS, "hands-over");
        let (time, ratios) = beside_peers(Some("hand-off"), (2 * ROUNDS) as f64, || {
            program.session.machine.restart(false);
            program.run(&[ROUNDS]).1
        });
        line("task/hand-off", time, "hand-off", &format!("{ratios} (resume and yield)"));
    }
}

/// Set in a process of its own that measures memory: pages that have been used before tell nothing.
const MEASURE_BYTES: &str = "PLEACH_MEASURE_BYTES";

/// What a branch that waits takes, with its node, in forms of so many: resident memory, as it is measured of
/// the peers.
fn parked_bytes(n: i64) -> i64 {
    let resident = || -> i64 {
        let pages = std::fs::read_to_string("/proc/self/statm").unwrap_or_default();
        pages.split(' ').nth(1).and_then(|it| it.parse().ok()).unwrap_or(0) * 4096
    };
    let mut program = Program::new(TASKS, "parked");
    let list = |n: i64| Value::list((0..n).map(Value::int).collect::<Vec<_>>());
    let args = vec![list(n), list(BRANCHES / n)];
    let before = resident();
    let machine = &mut program.session.machine;
    machine.start(program.function, args);
    // In the long loop, while all others wait.
    let stop = machine.steps() + 5_000_000;
    let progress = program.session.go(&mut String::new(), Some(stop));
    assert!(matches!(progress, Progress::Stopped));
    (resident() - before) / BRANCHES
}

fn fluents(wanted: &dyn Fn(&str) -> bool) {
    for dependents in [0, 1, 10] {
        let name = format!("task/set-value/{dependents}");
        if !wanted(&name) {
            continue;
        }
        const CHANGES: i64 = 100_000;
        let names: String = (0..dependents).map(|i| format!("(d{i} (fl (+ cell {i})))")).collect();
        let last: String = (0..dependents).map(|i| format!(" (value d{i})")).collect();
        let text = format!(
            "(def-plan sets (n) (let* ((cell (fluent 0)) {names}) (dotimes (i n) (set-value cell i)) (list{last})))"
        );
        let mut program = Program::new(&text, "sets");
        let mut times = Vec::new();
        for _ in 0..RUNS {
            program.session.machine.restart(false);
            times.push(program.run(&[CHANGES]).1 / CHANGES as f64);
        }
        line(&name, median(times), "change", &format!("{dependents} fluents derived from it"));
    }
}

fn text(wanted: &dyn Fn(&str) -> bool) {
    let library: String = stdlib::MODULES.iter().map(|(_, text)| *text).collect();
    if wanted("parse") {
        let text = library.repeat(4_000_000 / library.len() + 1);
        let mut times = Vec::new();
        for _ in 0..RUNS {
            let (parsed, ns) = timed(|| grammar::parse(grammar::FileId(0), &text));
            times.push(ns);
            assert!(parsed.errors.is_empty());
        }
        println!("{:<34} {:>10.1} MB/s (must 10)", "parse", text.len() as f64 * 1e3 / median(times));
    }
    if wanted("compile") {
        let one = "(def-fun f0 (a b)
                     \"A function of the benchmark.\"
                     (let ((x (+ a b)) (items (list a b)))
                       (dolist (item items) (when (> item x) (print \"large\" item)))
                       (if (< x 10) (* x 2) (f0 (- a 1) (length items)))))\n";
        let functions: String = (0..4_000).map(|i| one.replace("f0", &format!("f{i}"))).collect();
        let mut times = Vec::new();
        for _ in 0..3 {
            let mut session = Session::new(Options::default());
            times.push(timed(|| session.load_text("bench.plan", &functions)).1);
        }
        println!("{:<34} {:>10.1} MB/s (must 2)", "compile", functions.len() as f64 * 1e3 / median(times));
    }
    if wanted("start") {
        let mut times = Vec::new();
        for _ in 0..RUNS {
            let start = || {
                let mut session = Session::new(Options::default());
                let loaded = session.load_text("empty.plan", "");
                session.run(loaded, None, &mut String::new());
            };
            times.push(timed(start).1);
        }
        println!("{:<34} {:>10.1} ms (must 20)", "start", median(times) / 1e6);
    }
}
