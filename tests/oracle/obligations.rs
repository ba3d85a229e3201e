//! Obligations: `defer` and `owe`. Numbers in brackets are those of SEMANTICS, section 4.
//!
//! Each form that is being done stands on a stack, with the parts of it that are over and with what
//! it owes. A part that ends may make something due; a form that ends performs all that it owes.

use std::rc::Rc;

use compiler::ast::{Expr, ExprKind, Function};
use vm::code::{FnId, SiteId};
use vm::edit::What;
use vm::key::Step;
use vm::tree::{NodeKind, Status, Why};
use vm::value::{Symbol, Value};

use super::Tree;
use super::call::{Body, Call};
use super::eval::{Eval, Exit, Handler, Here, Run, Way, beside, gave_up};
use super::forms::{Part, Place};
use super::tasks::Oracle;

/// A form that is being done.
#[derive(Default)]
pub struct Form {
    place: Place,
    /// The record whose code it is.
    rec: usize,
    /// Only the parts in one of these lists are done, as with the branches of `if`.
    branches: Vec<Vec<Part>>,
    /// The parts that are over.
    ended: Vec<Part>,
    /// The keys of a loop's rounds, and how many have begun.
    rounds: Option<(Rc<Vec<Step>>, usize)>,
    /// How many handlers are around it.
    handlers: usize,
    /// It stands for the form below it while that performs what it owes.
    is_shadow: bool,
}

/// What a form owes.
#[derive(Clone)]
pub struct Obligation<'p> {
    /// What is performed, with its record.
    slot: usize,
    rec: usize,
    what: Owed,
    /// The common form, as a position on the stack.
    form: usize,
    /// The slot that it waits for, and the part of the form that this is in.
    after: usize,
    side: Side,
    /// Handlers that stood around the call below the form, outermost first. (4)
    handlers: Vec<Handler<'p>>,
    /// Calls whose goals are checked after it, innermost first. (6)
    goals: Vec<(usize, Rc<Call>)>,
}

#[derive(Clone)]
enum Owed {
    /// A deferred call.
    Call(Rc<Call>),
    /// The code of an `owe`, with the number of its edit and the parameters of the plan that owes.
    Code(FnId, &'static Function, usize, Vec<Value>),
}

#[derive(Clone, PartialEq)]
enum Side {
    /// A part of the common form.
    Part(Part),
    /// A later call at the same place: over when it has more records than these and the last is final.
    Later(usize),
    /// It is performed when the form ends.
    Never,
}

/// A slot that a call waits for, as it was when the edit was made.
#[derive(Clone)]
pub struct Awaited {
    pub slot: usize,
    /// Where it was called.
    place: Place,
    /// When it was called first.
    order: usize,
    /// The rounds between the two, if a loop tells them apart.
    between: Option<Vec<Step>>,
}

impl Awaited {
    pub fn of(tree: &Tree, from: usize, slot: usize) -> Awaited {
        let (mine, theirs) = (&tree.slots[from].place, &tree.slots[slot].place);
        let order = tree.slots[slot].records.first().copied().unwrap_or(0);
        Awaited { slot, place: theirs.clone(), order, between: between(tree, mine, theirs) }
    }
}

/// The keys of the rounds between those of two places, in the loop that tells them apart. (3)
fn between(tree: &Tree, mine: &Place, theirs: &Place) -> Option<Vec<Step>> {
    let (mine, theirs) = (mine.parts(), theirs.parts());
    let at = mine.iter().zip(&theirs).position(|(a, b)| a != b)?;
    let (Part::Round(first), Part::Round(last)) = (&mine[at], &theirs[at]) else { return None };
    let keys = tree.loops.iter().rev().find(|(place, _)| place.parts() == mine[..at])?.1.clone();
    // A round without calls leaves no trace in the tree.
    let in_tree = |key: &&Step| {
        let round: Vec<Part> = mine[..at].iter().cloned().chain([Part::Round((*key).clone())]).collect();
        tree.slots.iter().any(|slot| slot.place.parts().starts_with(&round))
    };
    let keys: Vec<Step> = keys.iter().filter(in_tree).cloned().collect();
    let position = |key: &Step| keys.iter().position(|it| it == key);
    Some(keys.get(position(first)? + 1..position(last)?).unwrap_or_default().to_vec())
}

/// Refuses a `defer` by which calls would wait for each other. Of several that it waits for a call
/// takes one that is still to come, so only what waits for one place can be part of a circle. (2, 7)
pub fn check_cycle(tree: &Tree, slot: usize, after: &[Awaited]) -> Result<(), String> {
    let single = |after: &[Awaited]| if let [awaited] = after { Some(awaited.slot) } else { None };
    let mut next = single(after);
    for _ in 0..=tree.edits.len() {
        let Some(at) = next else { return Ok(()) };
        if at == slot {
            return Err("calls would wait for each other".into());
        }
        let edits = tree.slots[at].edits.iter().rev().map(|id| &tree.edits[*id]);
        let mut defers = edits.filter(|accepted| matches!(accepted.edit.what, What::Defer(_)));
        next = defers.find_map(|accepted| single(&accepted.after));
    }
    Ok(())
}

impl<'p> Oracle<'_, 'p> {
    // ------------------------------------------------------------------ forms

    /// Does a part of the form that `here` stands in, as a form of its own.
    pub fn form(
        &mut self,
        here: &Here,
        part: Part,
        work: impl FnOnce(&mut Self, &Here) -> Eval<'p>,
    ) -> Eval<'p> {
        let place = here.place.inside(part.clone());
        let inner = Here { place: place.clone(), ..here.clone() };
        let mut result = self.whole_form(place, here.rec, |it| work(it, &inner));
        let around = self.running_form();
        self.form_mut(around).ended.push(part);
        while let (Ok(_), Some(next)) = (&result, self.next_due(around)) {
            result = and_then(result, self.discharge(next));
        }
        result
    }

    /// Does a branch of a parallel form, as a form of its own. What the parallel form owes is not its
    /// business.
    pub fn branch_form(
        &mut self,
        here: &Here,
        place: Place,
        work: impl FnOnce(&mut Self, Place) -> Eval<'p>,
    ) -> Eval<'p> {
        let part = here.place.part_with(&place).expect("a branch stands in its form");
        let result = self.whole_form(place.clone(), here.rec, |it| work(it, place));
        let around = self.running_form();
        self.form_mut(around).ended.push(part);
        result
    }

    /// A form, and what it owes at its end.
    fn whole_form(&mut self, place: Place, rec: usize, work: impl FnOnce(&mut Self) -> Eval<'p>) -> Eval<'p> {
        let handlers = self.stacks.handlers.len();
        let form = self.push_form(Form { place, rec, handlers, ..Form::default() });
        let mut result = work(self);
        if matches!(result, Err(Exit::Evaporate(_))) && self.run.tasks.is_emergency(self.me) {
            self.drop_owed(form);
        }
        // What it owes is performed before it ends, whatever ends it. (1)
        while let (false, Some(next)) = (gave_up(&result), self.next_at_end(form)) {
            // Because it fails, or is stopped: then that is clean-up. (9)
            let cleans_up = matches!(&result, Err(Exit::Fail(_) | Exit::Propagate(_) | Exit::Evaporate(_)));
            if cleans_up {
                self.begin_clean_up();
            }
            let owed = self.discharge(next);
            if cleans_up {
                self.end_clean_up();
            }
            result = and_then(result, owed);
        }
        self.pop_form();
        result
    }

    /// In an emergency what a form owes is not performed. (9)
    fn drop_owed(&mut self, form: usize) {
        let owed = std::mem::take(&mut self.run.obligations);
        let (dropped, kept): (Vec<_>, Vec<_>) = owed.into_iter().partition(|it| it.form == form);
        self.run.obligations = kept;
        for it in dropped {
            self.run.tree.records[it.rec].why = Why::Emergency;
            self.end_record(it.rec, Status::Evaporated, Value::NIL);
        }
    }

    fn push_form(&mut self, form: Form) -> usize {
        let number = self.run.forms_made;
        self.run.forms_made += 1;
        self.run.forms.insert(number, form);
        self.stacks.forms.push(number);
        number
    }

    fn pop_form(&mut self) {
        let form = self.running_form();
        self.stacks.forms.pop();
        self.run.forms.remove(&form);
    }

    fn running_form(&self) -> usize {
        *self.stacks.forms.last().expect("the root is a form")
    }

    fn form_mut(&mut self, form: usize) -> &mut Form {
        self.run.forms.get_mut(&form).expect("it is being done")
    }

    /// The innermost form that is as wanted.
    fn find_form(&self, wanted: impl Fn(&Form) -> bool) -> Option<usize> {
        let forms = &self.run.forms;
        self.stacks.forms.iter().rev().copied().find(|form| wanted(&forms[form]))
    }

    /// The running form has branches: of these only one is done.
    pub fn branches(&mut self, branches: &[&[Expr]]) {
        let parts = |body: &&[Expr]| body.iter().map(|expr| Part::Expr(super::eval::address(expr))).collect();
        let form = self.running_form();
        self.form_mut(form).branches = branches.iter().map(parts).collect();
    }

    /// A round of the running form begins.
    pub fn round_begins(&mut self, keys: &Rc<Vec<Step>>, at: usize) {
        let form = self.running_form();
        let form = self.form_mut(form);
        form.rounds = Some((keys.clone(), at + 1));
        if at == 0 {
            let place = form.place.clone();
            self.run.tree.loops.push((place, keys.clone()));
        }
    }

    /// A retry: the parts of the running form are still to come.
    pub fn form_restarts(&mut self) {
        let form = self.running_form();
        self.form_mut(form).ended.clear();
    }

    /// Where a function is called, by the form of its body.
    pub fn place_of_call(&self, body: usize) -> Place {
        self.run.forms[&body].place.around()
    }

    /// True if one of its forms from number `first` on owes something.
    pub fn owes(&self, first: usize) -> bool {
        self.run.obligations.iter().any(|it| it.form >= first && self.stacks.forms.contains(&it.form))
    }

    // ------------------------------------------------------------------ when

    /// What a form owes that is due while it goes on. (1, 7)
    fn next_due(&self, form: usize) -> Option<usize> {
        let obligations = &self.run.obligations;
        let is_due = |it: &&Obligation<'p>| {
            let over = match &it.side {
                Side::Never => false,
                Side::Part(part) => self.run.forms[&form].ended.contains(part),
                Side::Later(before) => {
                    let records = &self.run.tree.slots[it.after].records;
                    let last = records.last().map(|rec| self.run.tree.records[*rec].status);
                    records.len() > *before && last.is_some_and(Status::is_final)
                }
            };
            it.form == form && over && !obligations.iter().any(|other| other.slot == it.after)
        };
        let due = obligations.iter().find(is_due)?;
        obligations.iter().position(|it| it.rec == due.rec)
    }

    /// What a form owes next when it ends: in order of making, but what waits for something that is
    /// owed as well after that; if that is owed further out, it is owed there. (7)
    fn next_at_end(&mut self, form: usize) -> Option<usize> {
        loop {
            let held: Vec<usize> =
                (0..self.run.obligations.len()).filter(|at| self.run.obligations[*at].form == form).collect();
            let first = *held.first()?;
            let waits_for = |at: &usize| {
                let after = self.run.obligations[*at].after;
                self.run.obligations.iter().position(|it| it.slot == after)
            };
            if let Some(free) = held.iter().find(|at| waits_for(at).is_none()) {
                return Some(*free);
            }
            let further = held.iter().find_map(|at| {
                let is_outer = |owed: &usize| {
                    let other = self.run.obligations[*owed].form;
                    other < form && self.stacks.forms.contains(&other)
                };
                let outer = waits_for(at).filter(is_outer)?;
                Some((*at, outer))
            });
            let Some((at, outer)) = further else { return Some(first) };
            let Obligation { form, side, .. } = self.run.obligations[outer].clone();
            let it = &mut self.run.obligations[at];
            (it.form, it.side) = (form, side);
            // That is where it is performed, too. (5)
            let (rec, holder) = (it.rec, self.run.forms[&form].rec);
            self.run.tree.records[rec].performed_in = Some(self.run.tree.records[holder].slot);
        }
    }

    // ------------------------------------------------------------------ making

    /// A new call takes the place of one that is still owed. (8)
    fn supersede(&mut self, slot: usize) {
        if let Some(at) = self.run.obligations.iter().position(|it| it.slot == slot) {
            let old = self.run.obligations.remove(at);
            self.run.tree.records[old.rec].why = Why::Superseded;
            self.end_record(old.rec, Status::Evaporated, Value::NIL);
        }
    }

    /// True if a call is put off by an edit.
    pub fn defer(&mut self, call: &Rc<Call>) -> bool {
        self.supersede(call.slot);
        let defers = self.edits_of(call, |what| matches!(what, What::Defer(_)));
        let Some(id) = defers.last() else { return false };
        let accepted = self.run.tree.edits[*id].clone();
        let found = self.last_to_come(call, &accepted.after);
        let Some((form, after, side)) = found else {
            let note = "defer not applied: what it waits for is over, or does not come as expected";
            self.run.tree.records[call.rec].notes.push(note.into());
            return false;
        };
        let goals = self.move_goals(form);
        let edits = call.edits.iter().copied().filter(|id| !defers.contains(id)).collect();
        let what = Owed::Call(Rc::new(Call { edits, ..Call::clone(call) }));
        let handlers = self.stacks.handlers[self.run.forms[&form].handlers..].to_vec();
        let holder = self.run.tree.records[self.run.forms[&form].rec].slot;
        let record = &mut self.run.tree.records[call.rec];
        record.status = Status::Deferred;
        record.performed_in = Some(holder);
        let (slot, rec) = (call.slot, call.rec);
        self.run.obligations.push(Obligation { slot, rec, what, form, after, side, handlers, goals });
        true
    }

    /// The last of some slots that is still to come, with the form that contains the call and it,
    /// and its side of the form. (2, 3)
    fn last_to_come(&self, call: &Call, after: &[Awaited]) -> Option<(usize, usize, Side)> {
        let ahead = after.iter().filter_map(|awaited| {
            let (form, side, order) = self.ahead(call, awaited)?;
            // Forms further out end later.
            Some(((std::cmp::Reverse(form), order), (form, awaited.slot, side)))
        });
        ahead.max_by_key(|(order, _)| *order).map(|(_, found)| found)
    }

    /// The common form of a call and a slot that is still to come, its side, and its order there.
    fn ahead(&self, call: &Call, awaited: &Awaited) -> Option<(usize, Side, usize)> {
        let form = self.common_form(call, awaited)?;
        let it = &self.run.forms[&form];
        if let Some((mine, theirs)) = self.same_call(call, awaited) {
            // The same call again: it comes if it is a later one.
            let [mine, theirs] = [mine, theirs].map(|slot| &self.run.tree.slots[slot]);
            let before = self.run.tree.slots[awaited.slot].records.len();
            let later = theirs.occurrence() > mine.occurrence();
            return later.then_some((form, Side::Later(before), awaited.order));
        }
        let part = it.place.part_with(&awaited.place)?;
        let mine = it.place.part_with(&call.here.place);
        let branch_of = |part: &Part| it.branches.iter().position(|branch| branch.contains(part));
        let branches = (branch_of(&part), mine.as_ref().and_then(branch_of));
        let excluded = matches!(branches, (Some(theirs), Some(mine)) if theirs != mine);
        // A branch that is put off is not over. (7)
        let there = it.place.inside(part.clone()).parts();
        let is_owed = |owed: &Obligation<'p>| self.run.tree.slots[owed.slot].place.parts() == there;
        let is_branch = matches!(part, Part::Branch(..));
        let over = it.ended.contains(&part) && !(is_branch && self.run.obligations.iter().any(is_owed));
        if over || excluded {
            return None;
        }
        let order = match (&part, &it.rounds) {
            (Part::Round(key), Some((keys, begun))) => {
                let coming = &keys[*begun..];
                let at = coming.iter().position(|other| other == key)?;
                let known =
                    |step: &Step| awaited.between.as_ref().is_none_or(|between| between.contains(step));
                if !coming[..at].iter().all(known) {
                    return None;
                }
                at
            }
            // Branches are done at once: the last one is the one that was named last.
            _ if is_branch => 0,
            _ => awaited.order,
        };
        Some((form, Side::Part(part), order))
    }

    /// The tasks around the two, or the two themselves, that are called at one place.
    fn same_call(&self, call: &Call, awaited: &Awaited) -> Option<(usize, usize)> {
        let slots = &self.run.tree.slots;
        let tasks = |slot| std::iter::successors(Some(slot), |at: &usize| slots[*at].parent);
        let siblings = |theirs: &usize| {
            let mine = tasks(call.slot).find(|mine| slots[*mine].parent == slots[*theirs].parent)?;
            (mine != *theirs).then_some((mine, *theirs))
        };
        let (mine, theirs) = tasks(awaited.slot).find_map(|theirs| siblings(&theirs))?;
        let mine_at = if mine == call.slot { &call.here.place } else { &slots[mine].place };
        let theirs_at = if theirs == awaited.slot { &awaited.place } else { &slots[theirs].place };
        (mine_at.parts() == theirs_at.parts()).then_some((mine, theirs))
    }

    /// The innermost form that is being done and contains a call and another place. A place that is
    /// the call's own is another run of the loop or function around it.
    fn common_form(&self, call: &Call, awaited: &Awaited) -> Option<usize> {
        let (mine, theirs) = (call.here.place.parts(), awaited.place.parts());
        if let Some((same, _)) = self.same_call(call, awaited) {
            let place = if same == call.slot { &call.here.place } else { &self.run.tree.slots[same].place };
            let theirs = place.parts();
            // The innermost loop without keys in its task, or the whole body of that.
            let body = theirs.iter().rposition(|part| matches!(part, Part::Node(_))).map_or(0, |at| at + 1);
            let turn = theirs[body..].iter().rposition(|part| *part == Part::Turn);
            let outer = &theirs[..turn.map_or(body, |at| body + at)];
            return self.find_form(|form| !form.is_shadow && form.place.parts() == outer);
        }
        let contains =
            |form: &Form, parts: &[Part]| !form.is_shadow && parts.starts_with(&form.place.parts());
        let common = self.find_form(|form| {
            contains(form, &mine) && contains(form, &theirs) && form.place.parts().len() < theirs.len()
        })?;
        // Where one function goes on as the other, a tail call ends the forms that would contain both.
        let next = self.run.forms[&common].place.parts().len();
        let is_tail =
            matches!((mine.get(next), theirs.get(next)), (Some(Part::Body(_)), Some(Part::Body(_))));
        (!is_tail).then_some(common)
    }

    /// Goals of tasks between the running call and a form are checked later. (6)
    fn move_goals(&mut self, form: usize) -> Vec<(usize, Rc<Call>)> {
        let holder = self.run.forms[&form].rec;
        let between = self.stacks.bodies.iter().rev().take_while(|(rec, _)| *rec != holder);
        let goals: Vec<(usize, Rc<Call>)> =
            between.filter(|(_, call)| call.goal.is_some()).cloned().collect();
        for (rec, _) in &goals {
            self.run.tree.records[*rec].moved = true;
        }
        goals
    }

    /// Puts the code of `owe` edits into the forms of what they wait for. (10)
    pub fn owe(&mut self, call: &Rc<Call>) {
        for id in self.edits_of(call, |what| matches!(what, What::Owe { .. })) {
            let accepted = self.run.tree.edits[id].clone();
            let What::Owe { name, .. } = &accepted.edit.what else { continue };
            let (owner, function) = accepted.code.expect("what is owed is code");
            let Some((form, after, side)) = self.owing_form(call, &accepted.after) else { continue };
            let goals = self.move_goals(form);
            let Run { obligations, tree, .. } = &mut self.run;
            let open = obligations.iter_mut().find(|it| {
                it.form == form && matches!(it.what, Owed::Code(..)) && tree.slots[it.slot].name == *name
            });
            if let Some(open) = open {
                (open.after, open.side) = (after, side);
                open.goals.extend(goals);
                continue;
            }
            let holder = self.run.forms[&form].rec;
            let (slot, rec) = self.owed_record(holder, *name);
            let what = Owed::Code(owner, function, id, call.args.clone());
            let handlers = self.stacks.handlers[self.run.forms[&form].handlers..].to_vec();
            self.run.obligations.push(Obligation { slot, rec, what, form, after, side, handlers, goals });
        }
    }

    /// The form that contains a call and all that it waits for, which of these is the last, and its
    /// side. With nothing to come, what is owed comes after the call itself. (2, 10)
    fn owing_form(&self, call: &Call, after: &[Awaited]) -> Option<(usize, usize, Side)> {
        let Some(form) = after.iter().filter_map(|it| self.common_form(call, it)).min() else {
            // The call alone: its own form owes it.
            let is_branch = matches!(call.body, Body::Branch);
            let around = |form: &Form| !is_branch || form.place.part_with(&call.here.place).is_some();
            let form = self.find_form(|form| !form.is_shadow && form.rec == call.here.rec && around(form))?;
            return Some((form, call.slot, Side::Never));
        };
        let own = Side::Part(self.run.forms[&form].place.part_with(&call.here.place)?);
        let ahead = after.iter().filter_map(|awaited| match self.ahead(call, awaited)? {
            (common, side, order) if common == form => Some((order + 1, awaited.slot, side)),
            // It comes in the part of the form that the call itself is in.
            _ => Some((0, awaited.slot, own.clone())),
        });
        let last = ahead.max_by_key(|(order, ..)| *order).map(|(_, slot, side)| (form, slot, side));
        Some(last.unwrap_or((form, call.slot, own)))
    }

    fn owed_record(&mut self, holder: usize, name: Symbol) -> (usize, usize) {
        let slot = self.run.tree.slot(holder, (SiteId(0), vec![Step::Name(name)]), name, |_| 0);
        let now = self.run.now;
        let rec = self.run.tree.enter(holder, slot, NodeKind::Plan, Vec::new(), now);
        self.run.tree.records[rec].status = Status::Deferred;
        (slot, rec)
    }

    // ------------------------------------------------------------------ performing

    /// Performs what is owed, in the form that is on top of the stack.
    fn discharge(&mut self, at: usize) -> Result<(), Exit<'p>> {
        let mut owed = self.run.obligations.remove(at);
        let counts = self.counts_around(&owed);
        let form = &self.run.forms[&owed.form];
        let shadow = Form { place: form.place.clone(), rec: form.rec, is_shadow: true, ..Form::default() };
        let handlers = self.stacks.handlers.split_off(form.handlers);
        // What is put off meanwhile is performed inside of its handlers as well.
        self.stacks.handlers.extend(owed.handlers.iter().cloned());
        self.push_form(shadow);
        let holder = self.run.tree.records[owed.rec].performed_in;
        self.stacks.late.push(holder);
        let mut result = self.attempt_of(&owed).map(drop);
        let mut around = owed.handlers.clone();
        while let Err(Exit::Fail(failure)) = &result {
            let Some(Handler { clauses, here, counts: before }) = around.pop() else { break };
            self.stacks.handlers.pop();
            // Calls in a handler are attempts, one for each run of it.
            let now = std::mem::replace(&mut self.run.tree.records[here.rec].counts, before);
            let taken = self.take(&here, clauses, failure.clone());
            self.run.tree.records[here.rec].counts = now;
            match taken {
                Ok(Some(_)) => result = Ok(()),
                Ok(None) => {
                    self.burn(&here)?;
                    for (rec, counts) in &counts {
                        self.run.tree.records[*rec].counts.clone_from(counts);
                    }
                    owed.rec = self.again(&owed);
                    self.stacks.handlers.extend(owed.handlers[around.len()..].iter().cloned());
                    around.clone_from(&owed.handlers);
                    result = self.attempt_of(&owed).map(drop);
                }
                Err(exit) => result = Err(exit),
            }
        }
        self.stacks.late.pop();
        self.pop_form();
        self.stacks.handlers.truncate(self.run.forms[&owed.form].handlers);
        self.stacks.handlers.extend(handlers);
        result
    }

    /// How often calls were counted in the records that performing it may count in: a retry takes back
    /// what is counted there.
    fn counts_around(&self, owed: &Obligation<'p>) -> Vec<(usize, super::tree::Counts)> {
        let own = if let Owed::Call(call) = &owed.what { Some(call.here.rec) } else { None };
        let records = own.into_iter().chain(owed.handlers.iter().map(|handler| handler.here.rec));
        records.map(|rec| (rec, self.run.tree.records[rec].counts.clone())).collect()
    }

    /// The record of the next attempt of what is owed.
    fn again(&mut self, owed: &Obligation<'p>) -> usize {
        let old = self.run.tree.records[owed.rec].clone();
        let parent = old.parent.expect("only the root has no parent");
        let entered = old.written.as_ref().unwrap_or(&old.args).clone();
        let now = self.run.now;
        let rec = self.run.tree.enter(parent, owed.slot, old.kind, entered, now);
        let it = &mut self.run.tree.records[rec];
        (it.args, it.written, it.performed_in) = (old.args, old.written, old.performed_in);
        rec
    }

    fn attempt_of(&mut self, owed: &Obligation<'p>) -> Eval<'p> {
        let now = self.run.now;
        let record = &mut self.run.tree.records[owed.rec];
        (record.status, record.start) = (Status::Running, now);
        let holder = Here { rec: self.run.forms[&owed.form].rec, ..Here::root(None) };
        let value = match &owed.what {
            Owed::Call(call) => self.perform(&Rc::new(Call { rec: owed.rec, ..Call::clone(call) }))?,
            Owed::Code(owner, function, id, args) => {
                self.owed_code(&holder, owed, (*owner, function, *id), args.clone())?
            }
        };
        for (rec, call) in &owed.goals {
            let (Some(goal), Status::Succeeded) = (&call.goal, self.run.tree.records[*rec].status) else {
                continue;
            };
            let here = Here { rec: *rec, ..holder.clone() };
            if !self.ask_goal(&here, goal)? {
                return self.goal_not_reached(&holder, call.slot);
            }
        }
        Ok(value)
    }

    fn owed_code(
        &mut self,
        holder: &Here,
        owed: &Obligation<'p>,
        (owner, function, id): (FnId, &'p Function, usize),
        args: Vec<Value>,
    ) -> Eval<'p> {
        let place = self.run.forms[&owed.form].place.clone();
        let way = Way::default().then(Step::Edit(id as u32 + 1));
        let here = Here { rec: owed.rec, way, place, owner: Some(owner), ..holder.clone() };
        let result = self.deeper(|it| {
            it.form(&here, Part::Code(id), |it, here| it.body_of(here, function, Vec::new(), args))
        });
        match &result {
            Ok(value) => self.end_record(owed.rec, Status::Succeeded, value.clone()),
            Err(exit) => self.left_by(owed.rec, exit),
        }
        result
    }
}

/// How a form ends in which something owed ended so: a failure beside another is kept there. (9)
fn and_then<'p>(result: Eval<'p>, owed: Result<(), Exit<'p>>) -> Eval<'p> {
    match (result, owed) {
        (result, Ok(())) => result,
        (Err(exit), Err(Exit::Fail(other))) => Err(beside(exit, other)),
        (_, Err(exit)) => Err(exit),
    }
}

/// The branches of which an expression does one.
pub fn branches(expr: &Expr) -> Vec<&[Expr]> {
    match &expr.kind {
        ExprKind::If(_, then, other) => vec![std::slice::from_ref(&**then), std::slice::from_ref(&**other)],
        ExprKind::Case(_, arms, otherwise) => {
            arms.iter().map(|(_, body)| body).chain([otherwise]).map(Vec::as_slice).collect()
        }
        _ => Vec::new(),
    }
}
