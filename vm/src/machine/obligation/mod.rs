//! Obligations: calls that are performed later, at the end of a part of the plan.
//!
//! `defer` and `owe` put an obligation into the **common form** of two places p and q: the
//! innermost form instance that contains the call of p and the place of q. It is due when **q's
//! side** of that form has ended, or before the form itself ends, whatever ends it. Then p is
//! performed there, inside the handlers that stood around its call below the common form.
//!
//! Nobody pays for this who owes nothing: while obligations are open, the loop asks before each
//! instruction of a frame that holds one whether it has become due (see [`due`]).
//!
//! [`place`] says where, [`guards`] what that is outside of, [`make`] puts obligations there, [`perform`] performs them. The rules are in
//! `vm/OBLIGATIONS.md`; numbers in comments are theirs.

mod guards;
mod make;
mod perform;
mod place;

use std::cell::Cell;

use crate::code::{FormKind, FormRange, Pc, Program, RoundKey};
use crate::key::{Element, Key, Step};
use crate::op::Op;
use crate::tree::{RecId, SlotId, Tree};
use crate::value::{Obj, Value};

use super::drive::{Call, Driver};
use super::task::TaskId;
use super::{FnId, Here, Run};

pub(super) use guards::{Guard, guards};
pub(super) use place::between;

/// Something that the run owes.
pub(in crate::machine) struct Obligation {
    /// The slot that will be performed.
    slot: SlotId,
    /// Its record, status `deferred`.
    rec: RecId,
    what: Owed,
    /// The place that it waits for.
    after: SlotId,
    side: Side,
    /// The round that is q's side has been seen to end: afterwards the loop tells of later rounds only.
    passed: Cell<bool>,
    /// The frame that holds the common form: a task, and a number of frames below it.
    pub(in crate::machine) holder: (TaskId, usize),
    /// Which level that frame is on the way to the call.
    level: usize,
    /// The common form.
    form: u32,
    /// Handlers that stood around the call below the common form, innermost first.
    contexts: Vec<Context>,
    /// Goals of tasks below the common form, to be checked after it. (6)
    goals: Vec<(RecId, Value)>,
}

/// What is performed.
enum Owed {
    /// The call as it was made.
    Call(Box<Call>),
    /// Code of an `owe`, with the parameters of the plan that owes it.
    Code(FnId, Vec<Value>),
}

/// The part of the common form that contains q and not p.
#[derive(Clone)]
enum Side {
    /// Everything before this instruction.
    Until(Pc),
    /// The round of a loop with this key.
    Round(u32, Step),
    /// A later run of the same code: over when q has a newer record that is final.
    Later(RecId),
    /// Another branch of the same parallel form, by its slot.
    Branch(SlotId),
}

/// A handler with the registers that its frame had when p was called. (4)
#[derive(Clone)]
struct Context {
    registers: Vec<Value>,
    /// So many of them belong to what is around the common form: they are those of its frame.
    shared: u8,
    here: Here,
    handler: Pc,
    failure: u8,
    clauses: u32,
}

/// A handler of an obligation that is running.
pub(in crate::machine) struct Handling {
    /// Its frame, as a number of frames.
    depth: usize,
    /// Its clauses: leaving them by a jump ends the obligation.
    clauses: (Pc, Pc),
    form: u32,
    /// How often its calls had been reached before: they are further attempts. (4)
    counted: Vec<(Key, u32)>,
    /// How many calls had been counted in its record.
    mark: usize,
}

/// What an obligation being performed waits for.
pub(in crate::machine) struct Discharge {
    obligation: Obligation,
    stage: Stage,
    /// The failure that goes on outwards from the common form afterwards.
    then: Option<Value>,
    /// How many calls had been counted before it in the records that it may count in: a retry takes
    /// back what came since.
    marks: Vec<(RecId, usize)>,
}

impl Discharge {
    /// The level of the frame that performs it, unless that is called by the frame's record: the
    /// code of an `owe` is.
    fn level(&self) -> Option<usize> {
        let is_code = matches!((&self.obligation.what, self.stage), (Owed::Code(..), Stage::Performing));
        (!is_code).then_some(self.obligation.level)
    }

    fn form(&self) -> u32 {
        self.obligation.form
    }

    /// The handlers that have not been asked yet.
    fn contexts_left(&self) -> &[Context] {
        let asked = if let Stage::Handling(n) = self.stage { n + 1 } else { 0 };
        &self.obligation.contexts[asked..]
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Stage {
    Performing,
    /// The handler of this context runs.
    Handling(usize),
    /// The goal with this number is being checked.
    Goal(usize),
}

// ---------------------------------------------------------------------------------------------
// When

/// True if the loop must stop before `op` at `pc`: an obligation of this frame is due, or a
/// handler of an obligation has been left.
pub(in crate::machine) fn due(program: &Program, run: &RunView<'_>, depth: usize, pc: u32, op: Op) -> bool {
    if run.handling.last().is_some_and(|it| it.depth == depth && it.left_by(pc, op)) {
        return true;
    }
    let mut held = run.obligations.iter().filter(|it| it.holder == (run.task, depth));
    held.any(|it| {
        let form = &program.forms[it.form as usize];
        !form.contains(pc) || matches!(op, Op::Return(_) | Op::ReturnPlan(_)) || it.is_over(program, run, pc)
    })
}

/// What is looked at to see whether an obligation is due.
pub(in crate::machine) struct RunView<'r> {
    pub task: TaskId,
    pub obligations: &'r [Obligation],
    pub handling: &'r [Handling],
    pub tree: &'r Tree,
    pub stack: &'r [Value],
    pub base: usize,
}

impl FormRange {
    fn contains(&self, pc: u32) -> bool {
        (self.start.0..self.end.0).contains(&pc)
    }
}

impl Handling {
    fn left_by(&self, pc: u32, op: Op) -> bool {
        !self.contains(pc) || self.is_retry(pc, op)
    }

    /// True for the `(retry)` of the handler itself: a handler inside of its clauses goes back to a place there.
    fn is_retry(&self, pc: u32, op: Op) -> bool {
        matches!(op, Op::Retry(_, to) if self.contains(pc) && !self.contains(to.0))
    }

    fn contains(&self, pc: u32) -> bool {
        (self.clauses.0.0..self.clauses.1.0).contains(&pc)
    }
}

impl Obligation {
    /// True if q's side has ended and q is not itself deferred. (1, 7)
    fn is_over(&self, program: &Program, run: &RunView<'_>, pc: u32) -> bool {
        let passed = self.passed.get()
            || match &self.side {
                Side::Until(end) => pc >= end.0,
                Side::Round(round, key) => {
                    let round = &program.forms[*round as usize];
                    let passed = round.is_behind(pc)
                        && round
                            .key()
                            .is_some_and(|it| current_round(it, run.stack, run.base) == Some(key.clone()));
                    self.passed.set(passed);
                    passed
                }
                Side::Later(before) => {
                    let last = run.tree.shown(self.after).filter(|rec| rec > before);
                    last.is_some_and(|rec| run.tree.record(rec).status.is_final())
                        && program.is_between_parts(self.form, Pc(pc))
                }
                // The frame goes on when the form has ended.
                Side::Branch(_) => true,
            };
        passed && !run.obligations.iter().any(|it| it.slot == self.after)
    }
}

impl FormRange {
    /// True between the end of a round and the next one, while its key is still in its register.
    fn is_behind(&self, pc: u32) -> bool {
        match self.key() {
            // The number of the round is counted up by the instruction behind it.
            Some(RoundKey::Count(_)) => pc == self.end.0,
            _ => !self.contains(pc),
        }
    }

    fn key(&self) -> Option<RoundKey> {
        if let FormKind::Round(key) = self.kind { key } else { None }
    }
}

/// The key of the round that a loop is in or has just done.
fn current_round(key: RoundKey, stack: &[Value], base: usize) -> Option<Step> {
    match key {
        RoundKey::Count(register) => {
            Some(Step::Round(Element::Int(stack.get(base + register as usize)?.as_int()?), 0))
        }
        RoundKey::Element(register) => {
            let at = base + register as usize;
            match stack.get(at + 2)?.obj() {
                Some(Obj::Ranks(ranks)) => Some(ranks.step(stack.get(at + 1)?)),
                _ => None,
            }
        }
    }
}

impl Handling {
    /// The clauses that a failure leaves, if this is the handler of the running frame.
    pub(in crate::machine) fn of_frame(&self, depth: usize) -> Option<u32> {
        (self.depth == depth).then_some(self.form)
    }
}

impl Run {
    /// What is called by a task that has ended is performed where that is performed which calls it. (5)
    pub(in crate::machine) fn note_late(&mut self, rec: RecId) {
        let parent = self.tree.record(rec).parent;
        if !self.tree.record(parent).status.is_final() {
            return;
        }
        let performed = self.drivers.iter().rev().find_map(|driver| match driver {
            Driver::Discharge(it) => Some(it.obligation.rec),
            _ => None,
        });
        let holder = performed.and_then(|owed| self.tree.extra(owed)?.performed_in);
        if holder.is_some() {
            self.tree.extra_mut(rec).performed_in = holder;
        }
    }

    pub(in crate::machine) fn view(&self) -> RunView<'_> {
        RunView {
            task: self.tasks.loaded,
            obligations: &self.obligations,
            handling: &self.handling,
            tree: &self.tree,
            stack: &self.stack,
            base: self.base as usize,
        }
    }
}
