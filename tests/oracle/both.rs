//! A program on the machine and on the oracle, and what tells the two runs apart.

use std::collections::BTreeMap;
use std::rc::Rc;

use compiler::Report;
use compiler::ast::{ExprKind, Function};
use pleach::{Options, Session};
use vm::code::{FnId, FnKind, Program};
use vm::host::CodeRequest;
use vm::limits::Limits;
use vm::value::Value;

use super::{MOST_FUEL, World, run, text};

/// What one of the two made of a program.
#[derive(Debug, Clone, PartialEq)]
pub struct Seen {
    pub outcome: String,
    pub output: String,
    pub tree: String,
}

/// What became of a comparison.
#[derive(Debug, Clone, PartialEq)]
pub enum Verdict {
    /// Both made this of the program.
    Same(Seen),
    /// The machine, and the oracle, made this of it.
    Different(Seen, Seen),
    /// The program has errors.
    Errors(String),
    /// The oracle cannot run the program.
    NotCompared(String),
}

/// The session as the world of the oracle.
struct Door<'a>(&'a mut Session);

impl World for Door<'_> {
    fn program(&self) -> &Program {
        &self.0.machine.program
    }
    fn compile(&mut self, code: &CodeRequest<'_>) -> Result<(FnId, Rc<Function>), String> {
        let Session { front, machine, .. } = &mut *self.0;
        match front.compile_edit(&mut machine.program, code) {
            Ok(id) => Ok((id, front.functions[&id].clone())),
            Err(reports) => Err(reports.iter().map(|report| self.0.report(report)).collect()),
        }
    }
}

/// Runs a program on both and compares. To be called on a large stack.
#[must_use]
pub fn compare(program: &str, seed: u64) -> Verdict {
    let limits = Limits { fuel: MOST_FUEL, depth: 10_000, memory: 256 << 20, ..Limits::default() };
    let mut session = Session::new(Options { seed, keep_ast: true, limits, ..Options::default() });
    let library = library_constants(&session.front.functions);
    let loaded = session.load_text("random.plan", program);
    if !loaded.reports.iter().all(Report::is_warning) {
        return Verdict::Errors(loaded.reports.iter().map(|report| session.report(report)).collect());
    }
    let mut todo = loaded.init;
    if session.plan("main").is_some() {
        todo.extend(session.extend("the call of the plan", "(main)").init);
    }
    let Some(machine) = on_machine(&mut session, &todo) else {
        return Verdict::NotCompared("the program runs too long".into());
    };
    let functions = session.front.functions.clone();
    match run(&mut Door(&mut session), &functions, &library, &todo, seed) {
        Err(why) => Verdict::NotCompared(why),
        Ok(ran) => {
            let tree = text::of_oracle(&ran.tree, &ran.trees);
            let oracle = Seen { outcome: text::of_outcome(&ran.outcome), output: ran.output, tree };
            if machine == oracle { Verdict::Same(machine) } else { Verdict::Different(machine, oracle) }
        }
    }
}

/// The session has computed the constants of the library before.
fn library_constants(functions: &BTreeMap<FnId, Rc<Function>>) -> Vec<FnId> {
    let is_constant = |function: &Function| {
        function.kind == FnKind::TopLevel
            && matches!(function.body.first().map(|it| &it.kind), Some(ExprKind::Define(..)))
    };
    functions.iter().filter(|(_, function)| is_constant(function)).map(|(id, _)| *id).collect()
}

fn on_machine(session: &mut Session, todo: &[FnId]) -> Option<Seen> {
    let mut output = String::new();
    let mut outcome = Ok(Value::NIL);
    for id in todo {
        outcome = session.call(*id, Vec::new(), &mut output);
        if outcome.is_err() {
            break;
        }
    }
    if session.machine.steps() >= MOST_FUEL {
        return None;
    }
    session.machine.finish(&outcome);
    let (Ok(value) | Err(value)) = &outcome;
    text::name_all(session.machine.tree(), value);
    let tree = text::of_machine(session.machine.tree());
    Some(Seen { outcome: text::of_outcome(&outcome), output, tree })
}
