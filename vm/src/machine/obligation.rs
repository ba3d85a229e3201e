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
//! Source of the rules: SEMANTICS, section 4, numbers in the comments.

use crate::code::{FormKind, FormRange, Pc, Program, RoundKey, SiteId};
use crate::edit::What;
use crate::failure::{Builtin, Failure};
use crate::host::Host;
use crate::key::{Element, Step};
use crate::op::Op;
use crate::path::Path;
use crate::tree::{DRIVEN, MOVED, NodeKind, ROOT, RecId, SlotId, Status, Tree, Why};
use crate::value::{Obj, Symbol, Value};

use super::call::Slow;
use super::drive::{Call, Driver};
use super::{FnId, Frame, Here, Machine, RESUME, Run};

/// Something that the run owes.
pub(super) struct Obligation {
    /// The slot that will be performed.
    slot: SlotId,
    /// Its record, status `deferred`.
    rec: RecId,
    what: Owed,
    /// The place that it waits for.
    after: SlotId,
    side: Side,
    /// The frame that holds the common form, as a number of frames.
    pub(super) depth: usize,
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
}

/// A handler with the registers that its frame had when p was called. (4)
struct Context {
    registers: Vec<Value>,
    here: Here,
    handler: Pc,
    failure: u8,
    clauses: u32,
}

/// A handler of an obligation that is running.
pub(super) struct Handling {
    /// Its frame, as a number of frames.
    depth: usize,
    /// Its clauses: leaving them by a jump ends the obligation.
    clauses: (Pc, Pc),
    form: u32,
}

/// What an obligation being performed waits for.
pub(super) struct Discharge {
    obligation: Obligation,
    stage: Stage,
    /// The failure that goes on outwards from the common form afterwards.
    then: Option<Value>,
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
pub(super) fn due(program: &Program, run: &RunView<'_>, depth: usize, pc: u32, op: Op) -> bool {
    if run.handling.last().is_some_and(|it| it.depth == depth && it.left_by(pc, op)) {
        return true;
    }
    let mut held = run.obligations.iter().filter(|it| it.depth == depth);
    held.any(|it| {
        let form = &program.forms[it.form as usize];
        !form.contains(pc) || matches!(op, Op::Return(_) | Op::ReturnPlan(_)) || it.is_over(program, run, pc)
    })
}

/// What is looked at to see whether an obligation is due.
pub(super) struct RunView<'r> {
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
        !(self.clauses.0.0..self.clauses.1.0).contains(&pc) || matches!(op, Op::Retry(..))
    }
}

impl Obligation {
    /// True if q's side has ended and q is not itself deferred. (1, 7)
    fn is_over(&self, program: &Program, run: &RunView<'_>, pc: u32) -> bool {
        let passed = match &self.side {
            Side::Until(end) => pc >= end.0,
            Side::Round(round, key) => {
                let round = &program.forms[*round as usize];
                round.is_behind(pc)
                    && round
                        .key()
                        .is_some_and(|it| current_round(it, run.stack, run.base) == Some(key.clone()))
            }
            Side::Later(before) => run
                .tree
                .shown(self.after)
                .is_some_and(|rec| rec > *before && run.tree.record(rec).status.is_final()),
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

// ---------------------------------------------------------------------------------------------
// Where

/// One function between the root and a call: the call that it makes, and the rounds it is in.
#[derive(Debug, Clone, PartialEq)]
struct Level {
    site: SiteId,
    rounds: Vec<Step>,
    again: u32,
    name: Option<Symbol>,
}

/// The same for a frame that is there.
struct Activation {
    site: Option<SiteId>,
    pc: u32,
    base: u32,
    here: Here,
    depth: usize,
}

/// The levels between the root and a slot, and for each the slot that they lead to.
fn levels(tree: &Tree, slot: SlotId) -> Vec<(Level, SlotId)> {
    let mut slots: Vec<SlotId> = std::iter::successors(Some(slot), |at| {
        Some(tree.slot(*at).parent).filter(|up| *up != ROOT && up.0 != 0)
    })
    .collect();
    slots.reverse();
    let mut levels = Vec::new();
    for slot in slots {
        let key = tree.slot(slot).key;
        let mut level = Level { site: key.site, rounds: Vec::new(), again: 0, name: None };
        for step in tree.keys.steps(key.chain) {
            match step {
                Step::Call(site) => {
                    let next = Level { site: key.site, rounds: Vec::new(), again: 0, name: None };
                    let done = std::mem::replace(&mut level, next);
                    levels.push((Level { site, ..done }, slot));
                }
                Step::Again(n) => level.again = n,
                Step::Name(name) => level.name = Some(name),
                round => level.rounds.push(round),
            }
        }
        levels.push((level, slot));
    }
    levels
}

/// Where the common form of two places is.
struct Common {
    /// The level at which they part.
    level: usize,
    form: u32,
    side: Side,
}

/// The common form of the call that `mine` leads to and the place that `theirs` leads to.
fn common_form(program: &Program, mine: &[(Level, SlotId)], theirs: &[(Level, SlotId)]) -> Option<Common> {
    let level = mine.iter().zip(theirs).position(|((a, _), (b, _))| a != b)?;
    let (ours, other) = (&mine[level].0, &theirs[level].0);
    let path = |site: SiteId| {
        let forms = program.forms_outward(program.sites[site.at()].form).map(|(id, _)| id);
        let mut forms: Vec<u32> = forms.collect();
        forms.reverse();
        forms
    };
    let (a, b) = (path(ours.site), path(other.site));
    let mut rounds = 0;
    let mut common = None;
    for (form, same) in a.iter().zip(&b) {
        if form != same {
            break;
        }
        if program.forms[*form as usize].key().is_some() {
            let (p, q) = (ours.rounds.get(rounds), other.rounds.get(rounds));
            if p != q {
                return Some(Common { level, form: common?, side: Side::Round(*form, q?.clone()) });
            }
            rounds += 1;
        }
        common = Some(*form);
    }
    let form = common?;
    if ours.site == other.site {
        return Some(repeated(program, level, &a));
    }
    let depth = a.iter().position(|it| *it == form)? + 1;
    let end = match b.get(depth) {
        Some(side) => program.forms[*side as usize].end,
        None => Pc(program.sites[other.site.at()].pc.0 + 1),
    };
    Some(Common { level, form, side: Side::Until(end) })
}

/// The same call again: the loop without keys around it, or the whole body.
fn repeated(program: &Program, level: usize, path: &[u32]) -> Common {
    let unkeyed =
        path.iter().rposition(|form| matches!(program.forms[*form as usize].kind, FormKind::Round(None)));
    let form = unkeyed.and_then(|at| at.checked_sub(1)).map_or(path[0], |at| path[at]);
    Common { level, form, side: Side::Later(RecId(0)) }
}

impl Run {
    /// The frames between the root and the running one that a key is made of, outermost first.
    fn activations(&self, program: &Program) -> Vec<Activation> {
        use crate::code::FnKind;
        let mut all = Vec::new();
        let (mut pc, mut base, mut here) = (self.pc, self.base, self.here);
        let mut depth = self.frames.len();
        loop {
            let rec = self.record(here);
            loop {
                let at = Pc(pc.saturating_sub(1));
                let function = if pc == RESUME { None } else { program.function_at(at) };
                if let Some(function) = function {
                    let site = program.site_at(function, at);
                    all.push(Activation { site, pc, base, here, depth });
                    if !matches!(program.functions[function.at()].kind, FnKind::Function | FnKind::Lambda) {
                        break;
                    }
                }
                match depth.checked_sub(1).map(|at| self.frames[at]) {
                    Some(frame) if self.record(frame.here) == rec => {
                        (pc, base, here) = (frame.pc, frame.base, frame.here);
                        depth -= 1;
                    }
                    _ => break,
                }
            }
            while depth > 0 && self.record(self.frames[depth - 1].here) == rec {
                depth -= 1;
            }
            let Some(at) = depth.checked_sub(1) else { break };
            let frame = self.frames[at];
            (pc, base, here, depth) = (frame.pc, frame.base, frame.here, at);
        }
        all.retain(|it| it.site.is_some());
        all.reverse();
        all
    }
}

// ---------------------------------------------------------------------------------------------
// Making obligations

/// Where an obligation goes: after which place, and in which form.
struct Plan {
    after: SlotId,
    side: Side,
    form: u32,
    /// The frame of the common form.
    depth: usize,
    /// Handlers below it.
    contexts: Vec<Context>,
}

impl Machine {
    /// Applies `owe` and `defer` to a call whose record has been made. True if it is deferred.
    pub(super) fn put_off(&mut self, host: &mut dyn Host, call: Call) -> Result<(), Box<Call>> {
        let mut call = Box::new(call);
        for id in call.edits.clone() {
            if let What::Owe { name, .. } = &self.accepted(id).edit.what {
                let name = *name;
                self.owe(&call, id, name);
            }
        }
        let defers: Vec<u32> = call
            .edits
            .iter()
            .copied()
            .filter(|id| matches!(self.accepted(*id).edit.what, What::Defer(_)))
            .collect();
        let Some(id) = defers.last() else { return Err(call) };
        let plan = match self.place_for(&call, *id, false) {
            Ok(plan) => plan,
            Err(note) => {
                self.top().tree.extra_mut(call.rec).notes.push(note);
                return Err(call);
            }
        };
        self.supersede(host, call.slot);
        call.edits.retain(|id| !defers.contains(id));
        let (slot, rec) = (call.slot, call.rec);
        self.top().tree.record_mut(rec).status = Status::Deferred;
        self.add(slot, rec, Owed::Call(call), plan);
        Ok(())
    }

    fn accepted(&self, id: u32) -> &crate::edit::Accepted {
        &self.runs[self.runs.len() - 1].tree.edits[id as usize - 1]
    }

    fn add(&mut self, slot: SlotId, rec: RecId, what: Owed, plan: Plan) {
        let holder = self.holder_slot(plan.depth);
        let goals = self.move_goals(plan.depth);
        let run = self.top();
        run.tree.extra_mut(rec).performed_in = Some(holder);
        let Plan { after, side, form, depth, contexts } = plan;
        run.obligations.push(Obligation { slot, rec, what, after, side, depth, form, contexts, goals });
    }

    /// The slot whose code holds the common form.
    fn holder_slot(&self, depth: usize) -> SlotId {
        let run = &self.runs[self.runs.len() - 1];
        let here = run.frames.get(depth).map_or(run.here, |frame| frame.here);
        run.tree.record(run.record(here)).slot
    }

    /// A new call of p takes the place of the one that is still owed. (8)
    fn supersede(&mut self, host: &mut dyn Host, slot: SlotId) {
        let run = self.top();
        let Some(at) = run.obligations.iter().position(|it| it.slot == slot) else { return };
        let old = run.obligations.remove(at);
        run.tree.record_mut(old.rec).why = Why::Superseded;
        self.end_record(host, old.rec, Status::Evaporated, Value::NIL);
    }

    /// The goals of tasks between the call and the common form are checked later. (6)
    fn move_goals(&mut self, depth: usize) -> Vec<(RecId, Value)> {
        let run = self.top();
        // The running frame is a driver's: that of the call itself.
        let above = run.frames[depth..].iter().filter(|frame| frame.pc == RESUME).count();
        let first = run.drivers.len().saturating_sub(above);
        let mut goals = Vec::new();
        let mut goal = None;
        for driver in &run.drivers[first..] {
            match driver {
                Driver::Call(call) => goal = call.goal.clone(),
                Driver::Body(layer) if layer.outermost => {
                    goals.extend(goal.take().map(|goal| (layer.rec, goal)));
                }
                _ => {}
            }
        }
        for (rec, _) in &goals {
            run.tree.record_mut(*rec).flags |= MOVED;
        }
        goals.reverse();
        goals
    }

    /// Where the obligation of an edit goes, or why there is none. (1, 2, 3)
    fn place_for(&mut self, call: &Call, id: u32, owes: bool) -> Result<Plan, String> {
        let accepted = self.accepted(id).clone();
        let word = accepted.edit.word();
        let (program, runs) = (&self.program, &mut self.runs);
        let Some(run) = runs.last_mut() else { return Err("there is no run".into()) };
        let mine = levels(&run.tree, call.slot);
        // The call's own driver frame is on top; its caller is the innermost activation.
        let activations = run.activations(program);
        let mut found: Vec<(SlotId, Common)> = Vec::new();
        for slot in &accepted.after {
            let theirs = levels(&run.tree, *slot);
            found.extend(common_form(program, &mine, &theirs).map(|common| (*slot, common)));
        }
        let own = owes.then_some(call.slot);
        // Several places: the form that contains them all.
        let outer =
            found.iter().map(|(_, it)| (it.level, program.forms[it.form as usize].start, it.form)).min();
        let Some((level, _, form)) = outer else {
            return match own {
                Some(slot) => Ok(own_place(program, run, &activations, slot)),
                None => Err(format!("{word} not applied: the places have no form in common")),
            };
        };
        // Frames that perform something owed stand for the frames that are gone: count from the call.
        let index = (level + activations.len()).checked_sub(mine.len());
        let act = index.and_then(|at| activations.get(at)).filter(|act| act.site == Some(mine[level].0.site));
        let (Some(act), Some(index)) = (act, index) else {
            return Err(format!("{word} not applied: the form that contains both places is over"));
        };
        let mut ahead: Vec<(usize, SlotId, Side)> = Vec::new();
        for (slot, common) in &found {
            let side = match common.level == level && common.form == form {
                true => common.side.clone(),
                false => side_within(program, form, common, &mine, level),
            };
            if let Some(order) = run.is_ahead(program, act, &side, call.rec, accepted.between.get(slot)) {
                ahead.push((order, *slot, with_record(side, call.rec)));
            }
        }
        let chosen = ahead.into_iter().max_by_key(|(order, ..)| *order).map(|(_, slot, side)| (slot, side));
        let chosen = chosen.or_else(|| own.map(|slot| (slot, own_side(program, form, &mine[level].0))));
        let (after, side) = chosen.ok_or_else(|| {
            format!("{word} not applied: what it waits for is over, or does not come as expected")
        })?;
        let contexts = run.contexts(program, &activations[index..], form);
        Ok(Plan { after, side, form, depth: act.depth, contexts })
    }

    /// `(owe p code :after q :as name)`: one obligation per name and common form. (10)
    fn owe(&mut self, call: &Call, id: u32, name: Symbol) {
        let plan = match self.place_for(call, id, true) {
            Ok(plan) => plan,
            Err(note) => return self.top().tree.extra_mut(call.rec).notes.push(note),
        };
        let goals = self.move_goals(plan.depth);
        let holder = self.holder_record(plan.depth);
        let code = self.accepted(id).code;
        let run = self.top();
        let open = run.obligations.iter_mut().find(|it| {
            it.depth == plan.depth
                && it.form == plan.form
                && matches!(&it.what, Owed::Code(..))
                && run.tree.slot(it.slot).name == name
        });
        if let Some(open) = open {
            (open.after, open.side) = (plan.after, plan.side);
            open.goals.extend(goals);
            return;
        }
        let Some(code) = code else { return };
        let chain = run.tree.keys.then(crate::key::Chain::EMPTY, Step::Edit(id), |_| 0);
        let chain = run.tree.keys.then(chain, Step::Name(name), |_| 0);
        let key = crate::key::Key { site: SiteId(0), chain };
        let slot = run.tree.child(holder, key, name, 0);
        let rec = run.tree.enter(holder, slot, NodeKind::Plan, &[], run.now);
        run.tree.record_mut(rec).status = Status::Deferred;
        run.tree.record_mut(rec).flags |= DRIVEN;
        let Plan { after, side, form, depth, contexts } = plan;
        let what = Owed::Code(code, call.args.clone());
        run.obligations.push(Obligation { slot, rec, what, after, side, depth, form, contexts, goals });
    }

    fn holder_record(&self, depth: usize) -> RecId {
        let run = &self.runs[self.runs.len() - 1];
        run.record(run.frames.get(depth).map_or(run.here, |frame| frame.here))
    }
}

/// A later run is over when its record is newer than the call's.
fn with_record(side: Side, rec: RecId) -> Side {
    if let Side::Later(_) = side { Side::Later(rec) } else { side }
}

/// The side of a place whose own common form is inside of `form`.
fn side_within(program: &Program, form: u32, inner: &Common, mine: &[(Level, SlotId)], level: usize) -> Side {
    let from = if inner.level == level { inner.form } else { program.sites[mine[level].0.site.at()].form };
    let child = program.forms_outward(from).map(|(id, _)| id).take_while(|id| *id != form).last();
    match child {
        Some(child) => match program.forms[child as usize].key() {
            Some(_) => own_side(program, form, &mine[level].0),
            None => Side::Until(program.forms[child as usize].end),
        },
        None => Side::Until(Pc(program.sites[mine[level].0.site.at()].pc.0 + 1)),
    }
}

/// The part of `form` that the call itself stands in.
fn own_side(program: &Program, form: u32, level: &Level) -> Side {
    let site = &program.sites[level.site.at()];
    let outward: Vec<u32> = program.forms_outward(site.form).map(|(id, _)| id).collect();
    let Some(child) = outward.iter().take_while(|id| **id != form).last() else {
        return Side::Until(Pc(site.pc.0 + 1));
    };
    if program.forms[*child as usize].key().is_none() {
        return Side::Until(program.forms[*child as usize].end);
    }
    // How many keyed rounds stand around the common form: the next key is that of the child.
    let around = program.forms_outward(form).filter(|(_, it)| it.key().is_some()).count();
    match level.rounds.get(around) {
        Some(step) => Side::Round(*child, step.clone()),
        None => Side::Until(program.forms[*child as usize].end),
    }
}

/// An `owe` after its own call alone: in the innermost form around it.
fn own_place(program: &Program, run: &mut Run, activations: &[Activation], slot: SlotId) -> Plan {
    let Some(act) = activations.last() else {
        return Plan { after: slot, side: Side::Until(Pc(0)), form: 0, depth: 0, contexts: Vec::new() };
    };
    let form = act.site.map_or(0, |site| program.sites[site.at()].form);
    Plan {
        after: slot,
        side: Side::Until(Pc(act.pc)),
        form,
        depth: act.depth,
        contexts: run.contexts(program, &[], form),
    }
}

impl Run {
    /// True order of a side that is still to come, or nothing. (3)
    fn is_ahead(
        &mut self,
        program: &Program,
        act: &Activation,
        side: &Side,
        rec: RecId,
        between: Option<&Vec<Step>>,
    ) -> Option<usize> {
        match side {
            Side::Until(end) => (act.pc <= end.0).then_some(end.0 as usize),
            Side::Later(_) => Some(rec.0 as usize),
            Side::Round(round, key) => {
                let registers = program.forms[*round as usize].key()?;
                let coming = self.rounds_to_come(registers, act.base as usize);
                let at = coming.iter().position(|step| step == key)?;
                let strangers =
                    between.is_some_and(|known| coming[..at].iter().any(|step| !known.contains(step)));
                (!strangers).then_some(at)
            }
        }
    }

    /// The keys of the rounds that a loop has not begun.
    fn rounds_to_come(&self, key: RoundKey, base: usize) -> Vec<Step> {
        match key {
            RoundKey::Count(register) => {
                let number = |at: usize| self.stack[base + at].as_int().unwrap_or(0);
                let (now, limit) = (number(register as usize), number(register as usize + 1));
                (now + 1..limit).map(|i| Step::Round(Element::Int(i), 0)).collect()
            }
            RoundKey::Element(register) => {
                let at = base + register as usize;
                match self.stack[at + 2].obj() {
                    Some(Obj::Ranks(ranks)) => ranks.to_come(&self.stack[at + 1]),
                    _ => Vec::new(),
                }
            }
        }
    }

    /// The handlers between a call and the common form, innermost first. (4)
    fn contexts(&self, program: &Program, below: &[Activation], form: u32) -> Vec<Context> {
        let mut contexts = Vec::new();
        for act in below.iter().rev() {
            let Some(site) = act.site else { continue };
            let site = &program.sites[site.at()];
            let function = &program.functions[site.owner.at()];
            let base = act.base as usize;
            for (id, it) in program.forms_outward(site.form) {
                if id == form {
                    break;
                }
                let FormKind::Guarded { handler, failure } = it.kind else { continue };
                let registers = self.stack[base..base + function.registers as usize].to_vec();
                // The clauses are the form that begins at the handler.
                let clauses = program.form_at(site.owner, handler);
                let clauses = program
                    .forms_outward(clauses)
                    .find(|(_, form)| matches!(form.kind, FormKind::Clauses { .. }))
                    .map_or(clauses, |(id, _)| id);
                contexts.push(Context { registers, here: act.here, handler, failure, clauses });
            }
        }
        contexts
    }
}

// ---------------------------------------------------------------------------------------------
// Performing

impl Machine {
    /// The loop has stopped before an instruction because something of this frame is due.
    pub(super) fn perform_due(&mut self, host: &mut dyn Host) -> Slow {
        let run = self.top();
        let (depth, pc) = (run.frames.len(), run.pc);
        if run.handling.last().is_some_and(|it| it.depth == depth) {
            return self.leave_handling(host);
        }
        match self.next_due(depth, pc) {
            Some(at) => self.discharge(host, at, None),
            None => Ok(None),
        }
    }

    /// The obligation of this frame that is to be performed next, if one is. (1, 7)
    fn next_due(&mut self, depth: usize, pc: u32) -> Option<usize> {
        let (program, runs) = (&self.program, &self.runs);
        let run = &runs[runs.len() - 1];
        let view = run.view();
        let held: Vec<usize> =
            (0..run.obligations.len()).filter(|at| run.obligations[*at].depth == depth).collect();
        let op = program.code[pc as usize];
        let ended = |it: &Obligation| {
            !program.forms[it.form as usize].contains(pc) || matches!(op, Op::Return(_) | Op::ReturnPlan(_))
        };
        if let Some(at) = held
            .iter()
            .find(|at| !ended(&run.obligations[**at]) && run.obligations[**at].is_over(program, &view, pc))
        {
            return Some(*at);
        }
        let ended: Vec<usize> = held.into_iter().filter(|at| ended(&run.obligations[*at])).collect();
        self.first_at_end(&ended)
    }

    /// Of the obligations of a form that ends: one whose q is done, else one whose q is not owed
    /// here as well, else the first. One whose q is owed further out moves there. (7)
    fn first_at_end(&mut self, ended: &[usize]) -> Option<usize> {
        let run = self.top();
        for at in ended {
            let (after, depth, form) =
                (run.obligations[*at].after, run.obligations[*at].depth, run.obligations[*at].form);
            let further =
                run.obligations.iter().find(|it| it.slot == after && (it.depth, it.form) != (depth, form));
            if let Some(outer) = further.map(|it| (it.depth, it.form, it.side.clone())) {
                let it = &mut run.obligations[*at];
                (it.depth, it.form, it.side) = outer;
                return self
                    .first_at_end(&ended.iter().copied().filter(|other| other != at).collect::<Vec<_>>());
            }
        }
        let done = |at: &&usize| {
            let rec = run.tree.shown(run.obligations[**at].after);
            rec.is_some_and(|rec| matches!(run.tree.record(rec).status, Status::Succeeded | Status::Skipped))
        };
        let owed: Vec<SlotId> = ended.iter().map(|at| run.obligations[*at].slot).collect();
        let free = |at: &&usize| !owed.contains(&run.obligations[**at].after);
        ended.iter().find(done).or_else(|| ended.iter().find(free)).or(ended.first()).copied()
    }

    /// A failure leaves a form: what the form holds is performed before. The index of it.
    pub(super) fn due_before_failure(&mut self, form: u32) -> Option<usize> {
        let run = self.top();
        let depth = run.frames.len();
        let held: Vec<usize> = (0..run.obligations.len())
            .filter(|at| run.obligations[*at].depth == depth && run.obligations[*at].form == form)
            .collect();
        if held.is_empty() { None } else { self.first_at_end(&held) }
    }

    /// Performs an obligation on top of the running frame, which goes on afterwards.
    pub(super) fn discharge(&mut self, host: &mut dyn Host, at: usize, then: Option<Value>) -> Slow {
        let obligation = self.top().obligations.remove(at);
        let scratch = self.scratch_register();
        let above = self.driver_base();
        let run = self.top();
        run.frames.push(Frame { pc: run.pc, base: run.base, here: run.here, dst: scratch });
        (run.pc, run.base) = (RESUME, above);
        let discharge = Discharge { obligation, stage: Stage::Performing, then };
        run.drivers.push(Driver::Discharge(Box::new(discharge)));
        self.perform_owed(host)
    }

    /// The first register that the running function does not use.
    fn scratch_register(&self) -> u8 {
        let run = &self.runs[self.runs.len() - 1];
        let function = self
            .program
            .function_at(Pc(run.pc))
            .or_else(|| self.program.function_at(Pc(run.pc.saturating_sub(1))));
        function.map_or(0, |it| self.program.functions[it.at()].registers)
    }

    /// Starts the call of the discharge on top.
    fn perform_owed(&mut self, host: &mut dyn Host) -> Slow {
        let run = self.top();
        let now = run.now;
        let Some(Driver::Discharge(discharge)) = run.drivers.last_mut() else { return Ok(None) };
        let rec = discharge.obligation.rec;
        match &discharge.obligation.what {
            Owed::Call(call) => {
                let again = call.again(rec);
                let record = run.tree.record_mut(rec);
                (record.status, record.start) = (Status::Running, now);
                self.trace_start(host, rec);
                self.perform_again(host, again)
            }
            Owed::Code(code, args) => {
                let (code, args) = (*code, args.clone());
                let record = run.tree.record_mut(rec);
                (record.status, record.start) = (Status::Running, now);
                self.trace_start(host, rec);
                self.enter(0, code, args, &[]);
                self.top().here = Here(rec.0);
                Ok(None)
            }
        }
    }

    /// What the discharge called has returned.
    pub(super) fn discharge_resumed(
        &mut self,
        host: &mut dyn Host,
        mut discharge: Box<Discharge>,
        value: Value,
    ) -> Slow {
        let next = match discharge.stage {
            Stage::Performing => {
                let rec = discharge.obligation.rec;
                if !self.top().tree.record(rec).status.is_final() {
                    self.end_record(host, rec, Status::Succeeded, value);
                }
                0
            }
            // A handler that returns a value ends the obligation.
            Stage::Handling(_) => discharge.obligation.goals.len(),
            Stage::Goal(n) if value.is_true() => n + 1,
            Stage::Goal(n) => {
                let slot = self.top().tree.record(discharge.obligation.goals[n].0).slot;
                self.top().drivers.push(Driver::Discharge(discharge));
                return Err(self.goal_missed(slot));
            }
        };
        let goals = &discharge.obligation.goals;
        let reached =
            |at: &usize| self.runs[self.runs.len() - 1].tree.record(goals[*at].0).status == Status::Succeeded;
        match (next..goals.len()).find(reached) {
            Some(n) => {
                let goal = goals[n].1.clone();
                discharge.stage = Stage::Goal(n);
                self.top().drivers.push(Driver::Discharge(discharge));
                self.call_value(host, 0, SiteId(0), &goal, Vec::new())
            }
            None => self.end_discharge(host, *discharge),
        }
    }

    fn goal_missed(&self, slot: SlotId) -> crate::native::Raise {
        let path = Path::of(&self.runs[self.runs.len() - 1].tree, slot);
        let message = format!("the goal of {} is not true after what was deferred", path.show());
        let fields = vec![("message", Value::str(message)), ("of", Value::new(Obj::Path(Box::new(path))))];
        Box::new(Failure::with(Builtin::GoalNotReached, fields))
    }

    /// Goes back to the frame that held the obligation, or on with the failure that left it.
    fn end_discharge(&mut self, host: &mut dyn Host, discharge: Discharge) -> Slow {
        let form = discharge.obligation.form;
        self.return_value(Value::NIL)?;
        match discharge.then {
            Some(failure) => {
                self.top().leaving = Some(form);
                Ok(self.throw(host, failure))
            }
            None => Ok(None),
        }
    }

    /// A failure has come back to the discharge: the next handler takes it, or it goes on
    /// outwards from the common form. (4)
    pub(super) fn discharge_failed(
        &mut self,
        host: &mut dyn Host,
        mut discharge: Box<Discharge>,
        failure: Value,
    ) -> Result<(), Value> {
        let rec = discharge.obligation.rec;
        if !self.top().tree.record(rec).status.is_final() {
            self.end_record(host, rec, Status::Failed, failure.clone());
        }
        let next = match discharge.stage {
            Stage::Performing => 0,
            Stage::Handling(n) => n + 1,
            Stage::Goal(_) => discharge.obligation.contexts.len(),
        };
        if let Some(context) = discharge.obligation.contexts.get(next) {
            discharge.stage = Stage::Handling(next);
            let (registers, here, handler) = (context.registers.clone(), context.here, context.handler);
            let (register, clauses) = (context.failure, context.clauses);
            self.top().drivers.push(Driver::Discharge(discharge));
            self.enter_handler(registers, here, handler, clauses);
            *self.top().register(register) = failure;
            return Ok(());
        }
        let form = discharge.obligation.form;
        let Some(waiting) = discharge.then else { return Err(failure) };
        // The failure that was on its way goes on, with this one beside it.
        self.top().leaving = Some(form);
        Err(super::unwind::with_also(&waiting, failure))
    }

    /// A frame with the registers that the handler's frame had.
    fn enter_handler(&mut self, registers: Vec<Value>, here: Here, handler: Pc, form: u32) {
        let above = self.driver_base();
        let range = &self.program.forms[form as usize];
        let clauses = (range.start, range.end);
        let run = self.top();
        run.frames.push(Frame { pc: RESUME, base: run.base, here: run.here, dst: 0 });
        (run.pc, run.base, run.here) = (handler.0, above, here);
        for (register, value) in run.stack[above as usize..].iter_mut().zip(registers) {
            *register = value;
        }
        run.handling.push(Handling { depth: run.frames.len(), clauses, form });
    }

    /// A handler of an obligation has done `(retry)`, or was left with a value.
    fn leave_handling(&mut self, host: &mut dyn Host) -> Slow {
        let pc = self.top().pc as usize;
        let op = self.program.code[pc];
        self.keep_registers();
        self.top().handling.pop();
        if !matches!(op, Op::Retry(..)) {
            return self.return_value(Value::NIL);
        }
        // Perform it again: the next attempt of the same slot, the same obligation.
        self.return_value(Value::NIL)?;
        let run = self.top();
        let Some(Driver::Discharge(discharge)) = run.drivers.last_mut() else { return Ok(None) };
        discharge.stage = Stage::Performing;
        let old = discharge.obligation.rec;
        let (slot, parent, kind) =
            (discharge.obligation.slot, run.tree.record(old).parent, run.tree.record(old).kind);
        let args = run.tree.args(old);
        let performed_in = run.tree.extra(old).and_then(|extra| extra.performed_in);
        let rec = run.tree.enter(parent, slot, kind, &args, run.now);
        run.tree.record_mut(rec).flags |= DRIVEN;
        run.tree.extra_mut(rec).performed_in = performed_in;
        if let Some(Driver::Discharge(discharge)) = run.drivers.last_mut() {
            discharge.obligation.rec = rec;
        }
        self.perform_owed(host)
    }

    /// What a handler changed stays changed for its next run.
    fn keep_registers(&mut self) {
        let run = self.top();
        let base = run.base as usize;
        let Some(Driver::Discharge(discharge)) = run.drivers.last_mut() else { return };
        if let Stage::Handling(n) = discharge.stage
            && let Some(context) = discharge.obligation.contexts.get_mut(n)
        {
            let len = context.registers.len();
            context.registers.clone_from_slice(&run.stack[base..base + len]);
        }
    }
}

impl Handling {
    /// The clauses that a failure leaves, if this is the handler of the running frame.
    pub(super) fn of_frame(&self, depth: usize) -> Option<u32> {
        (self.depth == depth).then_some(self.form)
    }
}

impl Run {
    pub(super) fn view(&self) -> RunView<'_> {
        RunView {
            obligations: &self.obligations,
            handling: &self.handling,
            tree: &self.tree,
            stack: &self.stack,
            base: self.base as usize,
        }
    }
}

/// The keys of rounds between two places in the tree that an edit was made for. (3)
pub(super) fn between(program: &Program, tree: &Tree, p: SlotId, q: SlotId) -> Option<Vec<Step>> {
    let (mine, theirs) = (levels(tree, p), levels(tree, q));
    let common = common_form(program, &mine, &theirs)?;
    let Side::Round(_, last) = &common.side else { return None };
    let number = program.forms_outward(common.form).filter(|(_, form)| form.key().is_some()).count();
    let (at, slot) = (&mine[common.level].0, mine[common.level].1);
    let first = at.rounds.get(number)?;
    let mut steps: Vec<Step> = Vec::new();
    let before: Vec<Level> = mine[..common.level].iter().map(|(level, _)| level.clone()).collect();
    for child in tree.children(tree.slot(slot).parent) {
        let theirs = levels(tree, child);
        let same =
            theirs.len() > common.level && theirs.iter().zip(&before).all(|((level, _), mine)| level == mine);
        let round = theirs
            .get(common.level)
            .filter(|_| same)
            .and_then(|(level, _)| level.rounds.get(number).cloned());
        if let Some(round) = round.filter(|round| !steps.contains(round)) {
            steps.push(round);
        }
    }
    let place = |step: &Step| steps.iter().position(|it| it == step);
    let (from, to) = (place(first)?, place(last)?);
    Some(steps.get(from + 1..to).unwrap_or_default().to_vec())
}
