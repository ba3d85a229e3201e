//! The budgets of rules, measured: `cargo bench --bench rules [PATTERN]`.
//!
//! Programs without trees are Prolog text that we and SWI-Prolog both read (`rules/programs.pl`); the
//! both-hands rule runs here over a real tree, with slots, records and edits, whose actions have nested
//! descriptions as their locations, and there over facts. The figure is the median of the CPU time of some runs; where
//! `swipl` is installed, the same runs there in between, and the ratio of the two medians is printed: on a
//! shared machine only ratios of one run can be trusted. Figures and how they are judged: `vm/benches/README.md`.

mod measure;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::rc::Rc;

use measure::median;
use pleach::{Options, Session};
use vm::code::SiteId;
use vm::edit::{Accepted, Edit, What};
use vm::key::Key;
use vm::rules::View;
use vm::rules::engine::{Engine, Step};
use vm::rules::view::TreeView;
use vm::tree::{NodeKind, RecId, SlotId, Status, Tree};
use vm::value::{Symbol, Value};

/// How often each workload runs.
const RUNS: usize = 5;

fn main() {
    measure::begin(all);
}

fn all(wanted: &dyn Fn(&str) -> bool) {
    programs(wanted);
    for transports in [1000, 10_000] {
        both_hands(wanted, transports);
    }
}

// ---------------------------------------------------------------------------------------------
// Measuring

/// Milliseconds of CPU time.
fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let (result, ns) = measure::timed(work);
    (result, ns / 1e6)
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/rules")
}

/// Files for this run.
fn temporary() -> PathBuf {
    let folder = std::env::temp_dir().join(format!("pleach-bench-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder can be made");
    folder
}

/// The result of a workload in SWI-Prolog and its milliseconds, if that is installed.
fn swipl(workload: &str, files: &[PathBuf]) -> Option<(String, f64)> {
    let peer = folder().join("peer.pl");
    let output =
        Command::new("swipl").arg("-O").arg(peer).arg("--").arg(workload).args(files).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    let (result, time) = text.trim().rsplit_once(' ')?;
    Some((result.into(), time.parse().ok()?))
}

/// A line of the table; `per` operations were done in the time of a run.
fn line(name: &str, ms: f64, per: f64, theirs: &[f64], note: &str) {
    let ratio = match theirs.is_empty() {
        // It is not installed, or has no such workload.
        true => "no peer".to_string(),
        false => format!("{:.2} x SWI-Prolog", ms / median(theirs.to_vec())),
    };
    match per {
        1.0 => println!("{name:<34} {ms:>10.3} ms            {ratio:<24} {note}"),
        _ => println!("{name:<34} {:>10.1} ns each       {ratio:<24} {note}", ms * 1e6 / per),
    }
}

/// A session with the rules of these files.
fn session(files: &[PathBuf]) -> Session {
    let mut session = Session::new(Options::default());
    let mut text = String::new();
    for file in files {
        writeln!(text, "(use-rules {:?})", file.display().to_string()).expect("texts grow");
    }
    load(&mut session, &text);
    session
}

fn load(session: &mut Session, text: &str) {
    let loaded = session.load_text("bench.plan", text);
    let errors: Vec<String> =
        loaded.reports.iter().filter(|it| !it.is_warning()).map(|it| session.report(it)).collect();
    assert!(errors.is_empty(), "{}", errors.join("\n"));
    for init in loaded.init {
        session.call(init, Vec::new(), &mut String::new()).expect("the file loads");
    }
}

/// The answers of a predicate, as many as wanted; and the most memory that it had.
fn ask(session: &Session, name: &str, arity: usize, view: &View, most: usize) -> (usize, Value, usize) {
    let program = &session.machine.program;
    let predicate = program.rules.find(Symbol::from(name), arity).expect("the predicate is there");
    let mut engine = Engine::new(predicate, &[], view.clone(), arity > 1);
    let (mut answers, mut last, mut bytes) = (0, Value::NIL, 0);
    loop {
        let mut fuel = 1_000_000;
        match engine.run(program, &mut fuel) {
            Ok(Step::Answer) => {
                answers += 1;
                bytes = bytes.max(engine.bytes());
                last = engine.answer().unwrap_or_default();
                if answers == most {
                    return (answers, last, bytes);
                }
            }
            Ok(Step::Fuel) => bytes = bytes.max(engine.bytes()),
            Ok(Step::No) => return (answers, last, bytes),
            Ok(Step::Call(..)) => panic!("{name} calls a function"),
            Err(failure) => panic!("{name} fails: {:?}", Value::new(vm::value::Obj::Failure(failure))),
        }
    }
}

// ---------------------------------------------------------------------------------------------
// Programs without trees

fn facts() -> String {
    let mut text = String::new();
    for at in 0..100_000 {
        writeln!(text, "f({at},{}).", at % 1000 * 7).expect("texts grow");
    }
    // Twenty graphs of a hundred nodes, two edges from each.
    for at in 0..2000 {
        let block = at - at % 100;
        writeln!(text, "edge({at},{}).", block + (at * 17 + 3) % 100).expect("texts grow");
    }
    for at in 0..2000 {
        let block = at - at % 100;
        writeln!(text, "edge({at},{}).", block + (at + 1) % 100).expect("texts grow");
    }
    text
}

fn programs(wanted: &dyn Fn(&str) -> bool) {
    // Name, operations in a run, what is promised.
    let workloads = [
        ("nrev", 20_000.0 * 496.0, "must 1.43 x"),
        ("zebra", 101.0, "must 1.43 x"),
        ("none", 100_000.0, "the loop of the next three"),
        ("first", 100_000.0, "must 250 ns without the loop"),
        ("second", 100_000.0, "must 250 ns without the loop"),
        ("both", 100_000.0, "must 250 ns without the loop"),
        ("findall", 100_000.0, ""),
        ("tc", 1.0, ""),
        ("deep", 1_000_000.0, ""),
        ("churn", 20_000.0 * 496.0, ""),
    ];
    if !workloads.iter().any(|it| wanted(it.0)) {
        return;
    }
    let facts_file = temporary().join("facts.pl");
    std::fs::write(&facts_file, facts()).expect("a file can be written");
    let files = [facts_file, folder().join("programs.pl")];
    let (session, load_ms) = timed(|| session(&files));
    println!("{:<34} {load_ms:>10.1} ms", "loading 104,000 facts");
    for (name, per, note) in workloads {
        if !wanted(name) {
            continue;
        }
        let (mut ours, mut theirs, mut bytes, mut result) = (Vec::new(), Vec::new(), 0, String::new());
        for _ in 0..RUNS {
            let ((answers, value, most), ms) =
                timed(|| ask(&session, &format!("{name}-work"), 1, &View::default(), 1));
            assert_eq!(answers, 1, "{name} has an answer");
            (result, bytes) = (vm::print::write(&value), bytes.max(most));
            ours.push(ms);
            if let Some((value, ms)) = swipl(name, &files) {
                assert_eq!(value, result, "{name} has the answer of SWI-Prolog");
                theirs.push(ms);
            }
        }
        let note = format!("{result}, {:.1} MB, {note}", bytes as f64 / 1e6);
        line(name, median(ours), per, &theirs, &note);
    }
}

// ---------------------------------------------------------------------------------------------
// The both-hands rule

const BOTH_HANDS: &str = "
(def-rules both-hands
  (<- (one-arm ?task) (task-param ?task arms ?arms) (not (== ?arms both)))
  (<- (deliver-path ?task ?path) (subtask ?task ?deliver) (task-type ?deliver delivering) (task-path ?deliver ?path))
  ; The order of goals as the paper has them: two transports first, then the tests.
  (<- (paper ?p1 ?p2)
      (transport-task top-level ?a) (transport-task top-level ?b) (not (== ?a ?b))
      (not-transformed ?a) (not-transformed ?b) (one-arm ?a) (one-arm ?b)
      (task-param ?a location ?from) (task-param ?b location ?from)
      (task-param ?a target ?to) (task-param ?b target ?to)
      (deliver-path ?a ?p1) (deliver-path ?b ?p2))
  (<- (best ?p1 ?p2)
      (transport-task top-level ?a) (not-transformed ?a) (one-arm ?a)
      (task-param ?a location ?from) (task-param ?a target ?to)
      (task-param ?b location ?from) (not (== ?a ?b)) (transport-task top-level ?b)
      (not-transformed ?b) (one-arm ?b) (task-param ?b target ?to)
      (deliver-path ?a ?p1) (deliver-path ?b ?p2))
  (<- (candidate ?from ?to ?task)
      (transport-task top-level ?task) (not-transformed ?task) (one-arm ?task)
      (task-param ?task location ?from) (task-param ?task target ?to))
  (<- (group ?tasks)
      (bagof ?task (candidate ?_from ?_to ?task) ?tasks)
      (== ?tasks (?_ ?_ . ?_)))
  (<- (paper-query ?answer) (paper ?p1 ?p2) (== ?answer (?p1 ?p2)))
  (<- (best-query ?answer) (best ?p1 ?p2) (== ?answer (?p1 ?p2)))
  (<- (listing-query ?answer) (both-hands ?p1 ?p2) (== ?answer (?p1 ?p2))))
";

fn both_hands(wanted: &dyn Fn(&str) -> bool, transports: usize) {
    let name = |what: &str| format!("both-hands/{transports}/{what}");
    let kinds = ["cold", "all", "paper", "listing", "first", "paper-first", "group"];
    if !kinds.iter().any(|kind| wanted(&name(kind))) {
        return;
    }
    let mut session = Session::new(Options::default());
    let listing = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/11-rules/both_hands.pl");
    load(&mut session, &format!("(use-rules {:?}) {BOTH_HANDS}", listing.display().to_string()));
    let (tree, facts) = synthetic(transports);
    let facts_file = temporary().join(format!("tree-{transports}.pl"));
    std::fs::write(&facts_file, facts).expect("a file can be written");
    let files = [facts_file, folder().join("both_hands.pl")];
    let program = &session.machine.program;
    let view = |tree: &Tree| View { scoped: Vec::new(), tree: Rc::new(TreeView::of(program, tree)) };
    let warm = view(&tree);
    let peer = |workload: &str, runs: usize| -> (Option<String>, Vec<f64>) {
        let found: Vec<(String, f64)> = (0..runs).filter_map(|_| swipl(workload, &files)).collect();
        (found.first().map(|it| it.0.clone()), found.into_iter().map(|it| it.1).collect())
    };
    let run = |what: &str,
               query: &str,
               most: usize,
               repeat: usize,
               peer: (Option<String>, Vec<f64>),
               note: &str| {
        let mut times = Vec::new();
        let mut count = 0;
        for _ in 0..RUNS {
            let (found, ms) = timed(|| (0..repeat).map(|_| ask(&session, query, 1, &warm, most).0).last());
            count = found.unwrap_or_default();
            times.push(ms / repeat as f64);
        }
        if let Some(theirs) = peer.0.filter(|_| most == usize::MAX) {
            assert_eq!(theirs, count.to_string(), "{what}: as many answers as SWI-Prolog has");
        }
        line(&name(what), median(times), 1.0, &peer.1, &format!("{count} answers, {note}"));
    };
    let (all, paper_runs) = (usize::MAX, usize::from(transports <= 1000));
    let (must, must_cold) = if transports == 1000 { ("must 2 ms", "must 15 ms") } else { ("must 40 ms", "") };
    if wanted(&name("all")) {
        run("all", "best-query", all, 1, peer("all", RUNS), must);
    }
    if wanted(&name("paper")) {
        run("paper", "paper-query", all, 1, peer("paper", paper_runs), "must 1.5 x the best order");
    }
    if wanted(&name("listing")) {
        run(
            "listing",
            "listing-query",
            all,
            1,
            (None, Vec::new()),
            "the rule of the paper, with its subtasks",
        );
    }
    let per_answer = |(result, times): (Option<String>, Vec<f64>)| {
        (result, times.into_iter().map(|it| it / 1000.0).collect())
    };
    if wanted(&name("first")) {
        run("first", "best-query", 1, 1000, per_answer(peer("first_answer", RUNS)), "must 0.020 ms");
        run("paper-first", "paper-query", 1, 1000, (None, Vec::new()), "must 0.020 ms");
    }
    if wanted(&name("group")) {
        run("group", "group", all, 1, peer("group", RUNS), "");
    }
    if wanted(&name("cold")) {
        let mut times = Vec::new();
        let mut views = Vec::new();
        for _ in 0..RUNS {
            let (view, first) = timed(|| view(&tree));
            let (count, ms) = timed(|| ask(&session, "best-query", 1, &view, all).0);
            assert!(count > 0);
            views.push(first);
            times.push(first + ms);
        }
        let note = format!("{:.3} ms of it the table of the tree, {must_cold}", median(views));
        line(&name("cold"), median(times), 1.0, &[], &note);
    }
}

/// A tree of this many transports, each with 30 tasks below it, and the same as facts for SWI-Prolog. It is the
/// tree for which other engines were measured: the draws are those of Python's `random.Random(42)`.
fn synthetic(transports: usize) -> (Tree, String) {
    let mut it = Synthetic {
        tree: Tree::default(),
        draws: MersenneTwister::new(42),
        facts: ":- dynamic(replaced/1).\n".into(),
        nodes: Vec::new(),
        props: String::new(),
        replaced: String::new(),
    };
    let root_rec = it.tree.begin();
    let root = it.node(None, "top_level", root_rec, &[]);
    let places = (transports / 8).max(2);
    let mut plan = root;
    for number in 0..transports {
        if number % 10 == 0 {
            plan = it.below(root, "set_table", &[]);
        }
        it.transport(plan, number, places);
    }
    let facts = it.facts + &it.props + &it.replaced;
    (it.tree, facts)
}

/// A number of a node in the facts; from 1, as they have it.
type Node = usize;

struct Synthetic {
    tree: Tree,
    draws: MersenneTwister,
    facts: String,
    /// Record, children, and path of each node.
    nodes: Vec<(RecId, Vec<String>, String)>,
    props: String,
    replaced: String,
}

type Props<'a> = [(&'a str, String)];
/// The properties of a step, by its type.
type PropsOf<'a> = &'a dyn Fn(&str, &Props) -> Vec<(&'static str, String)>;

impl Synthetic {
    fn node(&mut self, parent: Option<Node>, name: &str, rec: RecId, props: &Props) -> Node {
        let node = self.nodes.len() + 1;
        let path = match parent {
            None => format!("/{name}"),
            Some(parent) => {
                let (_, children, above) = &mut self.nodes[parent - 1];
                children.push(name.into());
                let call = children.iter().filter(|it| *it == name).count();
                if call > 1 { format!("{above}/{name}:{call}") } else { format!("{above}/{name}") }
            }
        };
        let failed = self.draws.below(10) == 9;
        let status = if failed { "failed" } else { "succeeded" };
        let above = parent.unwrap_or(0);
        writeln!(self.facts, "task({node},{above},{name},'{path}',{status}).").expect("texts grow");
        for (key, value) in props {
            writeln!(self.props, "prop({node},{key},{value}).").expect("texts grow");
        }
        if parent.is_some() {
            let status = if failed { Status::Failed } else { Status::Succeeded };
            self.tree.end(rec, status, Value::NIL, node as u64);
        }
        self.nodes.push((rec, Vec::new(), path));
        node
    }

    /// A task below another one: an action if it has properties, else a plan.
    fn below(&mut self, parent: Node, name: &str, props: &Props) -> Node {
        let (rec, children, _) = &self.nodes[parent - 1];
        let key = Key { site: SiteId(children.len() as u32), ..Key::default() };
        let ours = Symbol::from(&name.replace('_', "-"));
        let slot = self.tree.child(*rec, key, ours, 0);
        let now = self.nodes.len() as u64;
        let new = match props.is_empty() {
            true => self.tree.enter(*rec, slot, NodeKind::Plan, &[], now),
            false => self.tree.enter(*rec, slot, NodeKind::Action, &[description(props)], now),
        };
        self.node(Some(parent), name, new, props)
    }

    fn transport(&mut self, plan: Node, number: usize, places: usize) {
        let from = format!("from{}", self.draws.below(places));
        let to = format!("to{}", self.draws.below(2));
        let arms = match self.draws.real() < 0.1 {
            true => "both",
            false => ["left", "right"][self.draws.below(2)],
        };
        let object = format!("object{number}");
        let props = |name: &str, more: &Props| -> Vec<(&'static str, String)> {
            let mut props = vec![("type", name.to_string()), ("object", object.clone())];
            for key in ["location", "target", "arms"] {
                props.extend(more.iter().filter(|it| it.0 == key).map(|it| (key, it.1.clone())));
            }
            props
        };
        let (from, to, arms) = (("location", from), ("target", to), ("arms", arms.to_string()));
        let all = [from.clone(), to.clone(), arms.clone()];
        let transporting = self.below(plan, "transporting", &props("transporting", &all));
        if self.draws.real() < 0.1 {
            writeln!(self.replaced, "replaced({transporting}).").expect("texts grow");
            self.skip(transporting);
        }
        let fetching = self.below(transporting, "fetching", &props("fetching", &[from, arms.clone()]));
        for name in ["opening", "navigating", "searching", "picking_up", "closing"] {
            let steps = if name == "searching" { ["looking", "turning"] } else { ["reaching", "grasping"] };
            self.steps(fetching, name, steps, &props);
        }
        let delivering = self.below(transporting, "delivering", &props("delivering", &[to, arms.clone()]));
        for name in ["navigating", "opening", "placing", "closing"] {
            self.steps(delivering, name, ["reaching", "releasing"], &props);
        }
        self.below(transporting, "parking_arms", &[("type", "parking_arms".into()), arms]);
    }

    fn steps(&mut self, above: Node, name: &str, steps: [&str; 2], props: PropsOf) {
        let node = self.below(above, name, &props(name, &[]));
        for step in steps {
            self.below(node, step, &props(step, &[]));
        }
    }

    /// An edit stands on the task.
    fn skip(&mut self, node: Node) {
        let slot: SlotId = self.tree.record(self.nodes[node - 1].0).slot;
        let edit = Edit {
            at: vm::path::Path { steps: Vec::new() },
            what: What::Skip(None),
            guard: Vec::new(),
            by: None,
            out_of: Vec::new(),
        };
        let accepted = Accepted {
            origin: "".into(),
            edit: Rc::new(edit),
            callee: Symbol::from("transporting"),
            plan: None,
            code: None,
            after: Vec::new(),
            between: Default::default(),
        };
        self.tree.add_edit(slot, accepted);
    }
}

/// `(an action (type t) (location (a location (on (an object (name n))))) …)`
fn description(props: &Props) -> Value {
    let properties = props.iter().map(|(key, value)| {
        let value = match *key {
            "location" | "target" => {
                let object = vm::desc::Desc::new(
                    Symbol::from("object"),
                    vec![(Symbol::from("name"), Value::symbol(value))],
                );
                let on = vec![(Symbol::from("on"), Value::desc(object))];
                Value::desc(vm::desc::Desc::new(Symbol::from("location"), on))
            }
            _ => Value::symbol(&value.replace('_', "-")),
        };
        (Symbol::from(key), value)
    });
    Value::desc(vm::desc::Desc::new(Symbol::from("action"), properties.collect::<Vec<_>>()))
}

/// Random numbers as Python's `random.Random(seed)` draws them.
struct MersenneTwister {
    state: [u32; 624],
    at: usize,
}

impl MersenneTwister {
    fn new(seed: u32) -> MersenneTwister {
        let mut state = [19_650_218_u32; 624];
        for i in 1..624 {
            state[i] =
                1_812_433_253_u32.wrapping_mul(state[i - 1] ^ (state[i - 1] >> 30)).wrapping_add(i as u32);
        }
        let mut i = 1;
        let mut mixed = |state: &mut [u32; 624], by: u32, add: u32, less: bool| {
            let before = state[i - 1];
            let mix = state[i] ^ (before ^ (before >> 30)).wrapping_mul(by);
            state[i] = if less { mix.wrapping_sub(i as u32) } else { mix.wrapping_add(add) };
            i += 1;
            if i == 624 {
                state[0] = state[623];
                i = 1;
            }
        };
        (0..624).for_each(|_| mixed(&mut state, 1_664_525, seed, false));
        (0..623).for_each(|_| mixed(&mut state, 1_566_083_941, 0, true));
        state[0] = 0x8000_0000;
        MersenneTwister { state, at: 624 }
    }

    fn next(&mut self) -> u32 {
        if self.at == 624 {
            for i in 0..624 {
                let y = (self.state[i] & 0x8000_0000) | (self.state[(i + 1) % 624] & 0x7fff_ffff);
                let odd = if y & 1 == 1 { 0x9908_b0df } else { 0 };
                self.state[i] = self.state[(i + 397) % 624] ^ (y >> 1) ^ odd;
            }
            self.at = 0;
        }
        let mut y = self.state[self.at];
        self.at += 1;
        y ^= y >> 11;
        y ^= (y << 7) & 0x9d2c_5680;
        y ^= (y << 15) & 0xefc6_0000;
        y ^ (y >> 18)
    }

    /// `randrange(n)`, `choice` among n
    fn below(&mut self, n: usize) -> usize {
        let bits = usize::BITS - n.leading_zeros();
        loop {
            let drawn = (self.next() >> (32 - bits)) as usize;
            if drawn < n {
                return drawn;
            }
        }
    }

    /// `random()`
    fn real(&mut self) -> f64 {
        let (high, low) = (self.next() >> 5, self.next() >> 6);
        (f64::from(high) * 67_108_864.0 + f64::from(low)) / 9_007_199_254_740_992.0
    }
}
