//! Making obligations: `defer` and `owe` at the call of their slot.

use std::cell::Cell;

use crate::code::{FormKind, FormRange, Pc, Program, RoundKey, SiteId};
use crate::edit::What;
use crate::host::Host;
use crate::key::{Element, Step};
use crate::tree::{DRIVEN, MOVED, NodeKind, RecId, SlotId, Status, Why};
use crate::value::{Obj, Symbol, Value};

use super::super::drive::{Call, Driver};
use super::super::fork::Fork;
use super::super::task::TaskId;
use super::super::{Machine, RESUME, Run};
use super::place::{Activation, Common, Stands, common_form, levels, own_side, side_within};
use super::{Context, Obligation, Owed, Side};

/// Where an obligation goes: after which place, and in which form.
struct Plan {
    after: SlotId,
    side: Side,
    form: u32,
    /// The frame of the common form, and which level on the way to the call it is.
    holder: (TaskId, usize),
    level: usize,
    /// Handlers below it.
    contexts: Vec<Context>,
}

impl Machine {
    /// Applies `owe` to a call whose record has been made.
    pub(in crate::machine) fn owe_all(&mut self, call: &Call) {
        for id in &call.edits {
            if let What::Owe { name, .. } = &self.accepted(*id).edit.what {
                let name = *name;
                self.owe(call, *id, name);
            }
        }
    }

    /// Applies `defer` to a call whose record has been made. Gives it back if it is not deferred.
    pub(in crate::machine) fn put_off(&mut self, host: &mut dyn Host, call: Call) -> Result<(), Box<Call>> {
        let mut call = Box::new(call);
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
        let goals = self.move_goals(plan.holder);
        self.performed_by(rec, plan.holder);
        let Plan { after, side, form, holder, level, contexts } = plan;
        let passed = Cell::new(false);
        let owed = Obligation { slot, rec, what, after, side, passed, holder, level, form, contexts, goals };
        self.top().obligations.push(owed);
    }

    /// What is owed with this record will be performed in the task of a frame. (5)
    pub(super) fn performed_by(&mut self, rec: RecId, holder: (TaskId, usize)) {
        let holder = self.holder_record(holder);
        let run = self.top();
        run.tree.extra_mut(rec).performed_in = Some(run.tree.record(holder).slot);
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
    fn move_goals(&mut self, holder: (TaskId, usize)) -> Vec<(RecId, Value)> {
        let run = self.top();
        let mut tasks = vec![run.tasks.loaded];
        while let Some(task) = tasks.last().copied().filter(|task| *task != holder.0) {
            tasks.push(run.tasks.get(task).parent);
        }
        let mut goals = Vec::new();
        let mut goal = None;
        for task in tasks.into_iter().rev() {
            let (frames, drivers) = run.frames_of(task);
            let depth = if task == holder.0 { holder.1 } else { 0 };
            // The frame on top of those that wait for a branch is the driver of its form.
            let on_top = usize::from(task != run.tasks.loaded);
            let above = on_top + frames[depth..].iter().filter(|frame| frame.pc == RESUME).count();
            for driver in &drivers[drivers.len().saturating_sub(above)..] {
                match driver {
                    Driver::Call(call) => goal = call.goal.clone(),
                    Driver::Body(layer) if layer.outermost => {
                        goals.extend(goal.take().map(|goal| (layer.rec, goal)));
                    }
                    _ => {}
                }
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
        let activations = run.activations(program, mine.len());
        let mut places: Vec<(SlotId, Common)> = Vec::new();
        for slot in &accepted.after {
            let theirs = levels(&run.tree, *slot);
            places.extend(common_form(program, &mine, &theirs).map(|common| (*slot, common)));
        }
        // Forms around a call are nested: an outer one begins earlier, if not in an outer frame.
        let nesting =
            |common: &Common| (common.level, program.forms[common.form as usize].start, common.form);
        let outermost = places.iter().map(|(_, common)| (nesting(common), common.level, common.form)).min();
        let Some((_, level, form)) = outermost else {
            return match owes {
                true => own_place(program, run, &activations, call.slot)
                    .ok_or_else(|| format!("{word} not applied: there is no form around the call")),
                false => Err(format!("{word} not applied: the places have no form in common")),
            };
        };
        if owes {
            // What is owed is one thing for all places: it goes into the form that contains them all.
            for (_, common) in &mut places {
                if (common.level, common.form) != (level, form) {
                    let side = side_within(program, form, common, &mine, level);
                    *common = Common { level, form, side };
                }
            }
        }
        let frame = |common: &Common| {
            let act = activations.get(common.level)?.as_ref()?;
            let stands_there = match act.stands {
                Stands::At(site) => site == mine[common.level].0.site,
                Stands::EndOf(_) => true,
            };
            act.forms(program).any(|(form, _)| form == common.form).then_some(act).filter(|_| stands_there)
        };
        if !places.iter().any(|(_, common)| frame(common).is_some()) {
            return Err(format!("{word} not applied: the form that contains both places is over"));
        }
        let mut ahead = Vec::new();
        for (slot, common) in places {
            let Some(act) = frame(&common) else { continue };
            let strangers = accepted.between.get(&slot);
            if let Some(order) = run.is_ahead(program, act, &common.side, strangers) {
                // What is awaited further out comes later.
                ahead.push((std::cmp::Reverse(nesting(&common)), order, slot, common));
            }
        }
        let last = ahead.into_iter().max_by_key(|(nesting, order, ..)| (*nesting, *order));
        let chosen = last.map(|(.., slot, common)| (slot, common)).or_else(|| {
            // It is owed after its own call as well.
            let side = own_side(program, form, &mine[level].0);
            owes.then_some((call.slot, Common { level, form, side }))
        });
        let (after, common) = chosen.ok_or_else(|| {
            format!("{word} not applied: what it waits for is over, or does not come as expected")
        })?;
        let gone = || format!("{word} not applied: the form that contains both places is over");
        let holder = frame(&common).ok_or_else(gone)?.holder();
        let Common { level, form, side } = common;
        let contexts = run.contexts(program, &activations, level, form);
        Ok(Plan { after, side: with_record(side, call.rec), form, holder, level, contexts })
    }

    /// `(owe p code :after q :as name)`: one obligation per name and common form. (10)
    fn owe(&mut self, call: &Call, id: u32, name: Symbol) {
        let plan = match self.place_for(call, id, true) {
            Ok(plan) => plan,
            Err(note) => return self.top().tree.extra_mut(call.rec).notes.push(note),
        };
        let goals = self.move_goals(plan.holder);
        let holder = self.holder_record(plan.holder);
        let code = self.accepted(id).code;
        let run = self.top();
        let open = run.obligations.iter_mut().find(|it| {
            it.holder == plan.holder
                && it.form == plan.form
                && matches!(&it.what, Owed::Code(..))
                && run.tree.slot(it.slot).name == name
        });
        if let Some(open) = open {
            (open.after, open.side) = (plan.after, plan.side);
            open.passed.set(false);
            open.goals.extend(goals);
            return;
        }
        let Some(code) = code else { return };
        let chain = run.tree.keys.then(crate::key::Chain::EMPTY, Step::Name(name), |_| 0);
        let key = crate::key::Key { site: SiteId(0), chain };
        let slot = run.tree.child(holder, key, name, 0);
        let rec = run.tree.enter(holder, slot, NodeKind::Plan, &[], run.now);
        run.tree.record_mut(rec).status = Status::Deferred;
        run.tree.record_mut(rec).flags |= DRIVEN;
        let Plan { after, side, form, holder, level, contexts } = plan;
        let what = Owed::Code(code, call.args.clone());
        let passed = Cell::new(false);
        let owed = Obligation { slot, rec, what, after, side, passed, holder, level, form, contexts, goals };
        run.obligations.push(owed);
    }

    /// The record whose code holds the common form.
    fn holder_record(&self, (task, depth): (TaskId, usize)) -> RecId {
        let run = &self.runs[self.runs.len() - 1];
        run.record(run.frames_of(task).0.get(depth).map_or(run.here, |frame| frame.here))
    }
}

/// A later run is over when its record is newer than the call's.
fn with_record(side: Side, rec: RecId) -> Side {
    if let Side::Later(_) = side { Side::Later(rec) } else { side }
}

/// An `owe` after its own call alone: in the innermost form around it.
fn own_place(program: &Program, run: &Run, activations: &[Option<Activation>], slot: SlotId) -> Option<Plan> {
    let level = activations.len().checked_sub(1)?;
    let act = activations[level].as_ref()?;
    let (form, _) = act.forms(program).next()?;
    let contexts = run.contexts(program, activations, level, form);
    Some(Plan { after: slot, side: Side::Until(Pc(act.pc)), form, holder: act.holder(), level, contexts })
}

impl Run {
    /// When a side comes that is still to come: a number to compare it with others of the form. (3)
    fn is_ahead(
        &self,
        program: &Program,
        act: &Activation,
        side: &Side,
        between: Option<&Vec<Step>>,
    ) -> Option<usize> {
        match side {
            Side::Until(end) => (act.pc < end.0).then_some(end.0 as usize),
            Side::Later(_) => Some(act.pc as usize),
            Side::Branch(slot) => {
                let begun = self.branch_beside(act.task, *slot);
                let ended = begun.is_some_and(|rec| self.tree.record(rec).status.is_final());
                (!ended).then_some(act.pc as usize)
            }
            Side::Round(round, key) => {
                let registers = program.forms[*round as usize].key()?;
                let coming = rounds_to_come(registers, self.registers_of(act.task, act.base as usize));
                let at = coming.iter().position(|step| step == key)?;
                let strangers =
                    between.is_some_and(|known| coming[..at].iter().any(|step| !known.contains(step)));
                (!strangers).then_some(at)
            }
        }
    }

    /// The record of the branch at a slot, in the form of the task `above` that the call stands in: a run of
    /// the branch before that form began is none of its own. A call that is performed when the form has ended
    /// stands in none of its branches.
    fn branch_beside(&self, above: TaskId, slot: SlotId) -> Option<RecId> {
        let up = |task: &TaskId| (*task != TaskId::ROOT).then(|| self.tasks.get(*task).parent);
        let mut around = std::iter::successors(Some(self.tasks.loaded), up);
        let own = around.find(|task| up(task) == Some(above));
        let mut branches = own.and_then(|own| self.fork_of(own)).into_iter().flat_map(Fork::tasks);
        match branches.find_map(|task| Some(self.tasks.get(task)).filter(|branch| branch.slot == slot)) {
            Some(branch) => Some(branch.rec).filter(|rec| rec.0 != 0),
            None => self.tree.shown(slot),
        }
    }

    /// The handlers between a call and the common form, innermost first. (4)
    fn contexts(
        &self,
        program: &Program,
        activations: &[Option<Activation>],
        level: usize,
        common: u32,
    ) -> Vec<Context> {
        let mut contexts = Vec::new();
        for (at, act) in activations.iter().enumerate().skip(level).rev() {
            let Some(act) = act else { continue };
            let forms: Vec<_> =
                act.forms(program).take_while(|(form, _)| at != level || *form != common).collect();
            // Variables that the call's part of the common form only uses stay those of the frame. A round of a
            // loop has its element and its key for itself.
            let shared = match forms.last() {
                _ if at != level => 0,
                Some((_, part)) => part.key().map_or(part.registers, RoundKey::register),
                None => u8::MAX,
            };
            let registers = self.registers_of(act.task, act.base as usize);
            if let Stands::EndOf(_) = act.stands {
                contexts.extend(
                    self.contexts_at(act.holder(), registers)
                        .map(|context| Context { shared: context.shared.min(shared), ..context }),
                );
            }
            for &(form, it) in &forms {
                let FormKind::Guarded { handler, failure } = it.kind else { continue };
                let Some(owner) = program.function_at(it.start) else { continue };
                let mut registers = registers[..program.functions[owner.at()].registers as usize].to_vec();
                leave_loops(&forms, &mut registers);
                // The clauses are the form that begins at the handler.
                let mut around = program.forms_outward(program.form_at(owner, handler));
                let clauses = around.find(|(_, form)| matches!(form.kind, FormKind::Clauses { .. }));
                let clauses = clauses.map_or(form, |(id, _)| id);
                contexts.push(Context { registers, shared, here: act.here, handler, failure, clauses });
            }
        }
        contexts
    }

    /// The handlers that are still around what a frame performs late.
    fn contexts_at(&self, holder: (TaskId, usize), live: &[Value]) -> impl Iterator<Item = Context> {
        let performed = self.frames_of(holder.0).1.iter().rev().find_map(|driver| match driver {
            Driver::Discharge(it) if it.obligation.holder == holder => Some(it),
            _ => None,
        });
        let contexts = performed.map_or(&[][..], |it| it.contexts_left()).iter();
        contexts.map(|context| {
            let mut context = context.clone();
            let shared = context.shared as usize;
            context.registers[..shared].clone_from_slice(&live[..shared]);
            context
        })
    }
}

/// Loops go on while a handler is kept for later: in its own registers they stand in the round of the call.
fn leave_loops(forms: &[(u32, &FormRange)], registers: &mut [Value]) {
    for (_, form) in forms {
        let Some(RoundKey::Element(register)) = form.key() else { continue };
        let [_, rest, ranks] = &mut registers[register as usize..][..3] else { continue };
        if let Some(Obj::Ranks(it)) = ranks.obj() {
            *ranks = Value::new(Obj::Ranks(Box::new(it.left_after(rest))));
            *rest = Value::NIL;
        }
    }
}

/// The keys of the rounds that a loop has not begun.
fn rounds_to_come(key: RoundKey, registers: &[Value]) -> Vec<Step> {
    match key {
        RoundKey::Count(register) => {
            let number = |at: usize| registers[at].as_int().unwrap_or(0);
            let (now, limit) = (number(register as usize), number(register as usize + 1));
            (now + 1..limit).map(|i| Step::Round(Element::Int(i), 0)).collect()
        }
        RoundKey::Element(register) => {
            let at = register as usize;
            match registers[at + 2].obj() {
                Some(Obj::Ranks(ranks)) => ranks.to_come(&registers[at + 1]),
                _ => Vec::new(),
            }
        }
    }
}
