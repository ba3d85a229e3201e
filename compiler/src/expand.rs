//! Macros: functions from forms to forms, run while compiling.
//!
//! An expansion has fuel and no world. What the macro calls is compiled before it runs, and
//! constants that stand above it are computed.

use std::collections::BTreeSet;

use grammar::Form;
use vm::code::{FnId, FnKind, Params};
use vm::host::NoHost;
use vm::machine::Progress;
use vm::value::{Symbol, Value};

use crate::data::{NoForm, Places, to_form, to_value};
use crate::error::CompileError;
use crate::{Compiler, Expander};

/// How deep expansions may nest.
const MOST_LEVELS: usize = 200;
/// Fuel of one expansion.
const FUEL: u64 = 10_000_000;
/// Fuel of all expansions of a text.
const ALL_FUEL: u64 = 200_000_000;
/// How many expansions a text may have: two macros that call each other twice double it each time.
const MOST_EXPANSIONS: usize = 1_000_000;

/// What the expansions of a text have taken.
#[derive(Default)]
pub(crate) struct Taken {
    expansions: usize,
    fuel: u64,
}

impl Compiler<'_> {
    /// The expansion of a call of a macro, or nothing if there was an error.
    pub(crate) fn expand(
        &mut self,
        name: Symbol,
        function: FnId,
        params: &Params,
        form: &Form,
    ) -> Option<Form> {
        let at = form.span;
        if self.within.len() >= MOST_LEVELS {
            self.error(CompileError::ExpandedTooDeep { limit: MOST_LEVELS, at });
            return None;
        }
        self.taken.expansions += 1;
        if self.taken.expansions > MOST_EXPANSIONS {
            // Said once: what is left of the text is not expanded.
            if self.taken.expansions == MOST_EXPANSIONS + 1 {
                self.error(CompileError::ExpandedTooOften { limit: MOST_EXPANSIONS, at });
            }
            return None;
        }
        let mut places = Places::default();
        let args: Vec<Value> = form.list()?.iter().skip(1).map(|arg| to_value(arg, &mut places)).collect();
        let constants = match self.prepare(function) {
            Ok(constants) => constants,
            Err(needs) => {
                let (name, needs) = (name.to_string(), needs.to_string());
                self.error(CompileError::NotYet { name, needs, at });
                return None;
            }
        };
        let given = args.len();
        let result = self.run_macro(function, args, constants);
        let value = match result {
            Ok(value) => value,
            Err(failure) => {
                match failure.as_failure() {
                    Some(it) if it.name == "arity-error" && it.place.is_none() => {
                        self.arity(name, params, given, at)
                    }
                    _ => {
                        let why = explain(&failure);
                        self.error(CompileError::MacroFailed { name: name.to_string(), why, at });
                    }
                }
                return None;
            }
        };
        match to_form(&value, at, &places) {
            Ok(form) => Some(form),
            Err(NoForm::Value(what)) => {
                self.error(CompileError::NotAForm { name: name.to_string(), what, at });
                None
            }
            Err(NoForm::TooLarge) => {
                self.error(CompileError::ExpandedTooDeep { limit: crate::data::MOST_NESTED, at });
                None
            }
        }
    }

    /// Compiles a function and all that it mentions. Answers the functions of the constants among
    /// these, in the order of their definitions.
    ///
    /// # Errors
    /// The name of something that cannot be compiled yet.
    fn prepare(&mut self, function: FnId) -> Result<Vec<FnId>, Symbol> {
        let mut seen = BTreeSet::new();
        let mut todo = vec![function];
        while let Some(id) = todo.pop() {
            if !seen.insert(id) {
                continue;
            }
            self.compile(id);
            if let Some(references) = self.references.get(&id) {
                todo.extend(references);
            }
            // Being compiled just now: the macro is used inside of what it needs.
            let proto = &self.program.functions[id.at()];
            if proto.end == proto.entry {
                return Err(proto.name);
            }
        }
        Ok(seen.into_iter().filter(|id| self.program.functions[id.at()].kind == FnKind::TopLevel).collect())
    }

    fn run_macro(&mut self, function: FnId, args: Vec<Value>, constants: Vec<FnId>) -> Result<Value, Value> {
        let Compiler { front, program, taken, .. } = self;
        let Expander { machine, computed } = &mut front.expander;
        std::mem::swap(&mut machine.program, program);
        for constant in constants.into_iter().filter(|constant| computed.insert(*constant)) {
            // One that fails will fail again, with its place, when the program is loaded.
            let _ = call(machine, constant, Vec::new(), taken);
        }
        let result = match machine.arrange(function, args) {
            Ok(args) => call(machine, function, args, taken),
            Err(raise) => Err(Value::failure(*raise)),
        };
        std::mem::swap(&mut machine.program, program);
        result
    }
}

fn call(
    machine: &mut vm::Machine,
    function: FnId,
    args: Vec<Value>,
    taken: &mut Taken,
) -> Result<Value, Value> {
    let before = machine.steps();
    machine.limits.fuel = before + FUEL.min(ALL_FUEL.saturating_sub(taken.fuel));
    machine.start(function, args);
    let outcome = match machine.go(&mut NoHost, None) {
        Progress::Ended(outcome) => outcome,
        Progress::Stopped => Ok(Value::NIL),
    };
    taken.fuel += machine.steps() - before;
    outcome
}

/// A failure in one line.
fn explain(failure: &Value) -> String {
    let Some(it) = failure.as_failure() else { return vm::print::brief(failure) };
    match it.get(Symbol::from("message")).and_then(Value::as_str) {
        Some(message) => format!("{} ({})", message, it.name),
        None => vm::print::brief(failure),
    }
}
