//! Making obligations: `defer` and `owe` at the call of their slot.

use crate::code::{FormKind, Pc, Program, RoundKey, SiteId};
use crate::edit::What;
use crate::host::Host;
use crate::key::{Element, Step};
use crate::tree::{DRIVEN, MOVED, NodeKind, RecId, SlotId, Status, Why};
use crate::value::{Obj, Symbol, Value};

use super::super::drive::{Call, Driver};
use super::super::{Machine, RESUME, Run};
use super::place::{Activation, Common, common_form, levels, own_side, side_within};
use super::{Context, Obligation, Owed, Side};

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
        let chain = run.tree.keys.then(crate::key::Chain::EMPTY, Step::Name(name), |_| 0);
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
