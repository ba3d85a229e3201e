//! Calls of a plan with edits that come from elsewhere: see [`crate::graft`].
//!
//! Places and edits are added below the slot of the call before the call is made. What stands there already, because
//! the tree has been run before or the call is made again, is not added twice. The edits get numbers after those that
//! the tree has; keys that name an edit name the new number.

use std::rc::Rc;

use crate::code::{FnId, FnKind, Pc, SiteId};
use crate::edit::{Accepted, Edit, What};
use crate::graft::{AROUND, CALL, Change, Graft, Link, Words, move_paths, not_applied};
use crate::host::Host;
use crate::key::{Chain, Key, Step};
use crate::native::type_error;
use crate::op::Op;
use crate::path::{Path, PathStep};
use crate::tree::SlotId;
use crate::value::{Imm, Obj, Symbol, Value};

use super::Machine;
use super::call::Slow;
use super::drive::Call;
use super::edits::{is_within, waits_for_itself};

/// A graft on its way into the running tree.
struct Growing<'g> {
    graft: &'g Graft,
    /// The path of the call.
    below: Vec<PathStep>,
    /// The slot of each place; none for those that the program does not have.
    slots: Vec<Option<Option<SlotId>>>,
    /// The number of each edit, from 1; zero for those that are not there.
    numbers: Vec<u32>,
    /// Edits that were there before and stand for one of the graft.
    found: Vec<u32>,
}

impl Machine {
    /// `(with-edits tree (plan args…))`, and the call in the body of a variant.
    pub(super) fn call_with_edits(
        &mut self,
        host: &mut dyn Host,
        d: u8,
        site: SiteId,
        plan: &Value,
        args: Option<Vec<Value>>,
        graft: &Graft,
    ) -> Slow {
        let is_plan = |it: &FnId| self.program.functions[it.at()].kind == FnKind::Plan;
        let function = match plan {
            Value::Imm(Imm::Function(function)) if is_plan(function) => *function,
            _ => return Err(type_error("a plan", plan)),
        };
        let args = match args {
            Some(args) => self.arrange(function, args)?,
            None => {
                let run = self.top();
                let args = run.tree.args(run.record(run.here));
                // The parameters of a variant are those of its plan, what was not given included.
                if args.len() == self.program.functions[function.at()].params.names.len() {
                    args
                } else {
                    self.arrange(function, args)?
                }
            }
        };
        let site = self.site_of_native().unwrap_or(site);
        let name = self.program.functions[function.at()].name;
        let slot = self.slot_of_call(site, name);
        let run = self.top();
        run.tree.calls(slot, function);
        let parent = run.record(run.here);
        let mut call = Call::of_plan(slot, parent, function, args);
        call.rec = self.record_of_call(host, &call);
        let notes = self.graft(host, slot, graft);
        if !notes.is_empty() {
            self.top().tree.extra_mut(call.rec).notes = notes;
        }
        self.drive(host, d, call)
    }

    /// The site of the native that runs: mostly natives call nothing, so their instructions do not say it.
    fn site_of_native(&mut self) -> Option<SiteId> {
        let at = Pc(self.top().pc.checked_sub(1)?);
        let is_native = matches!(self.program.code.get(at.0 as usize)?, Op::CallNative(..));
        self.program.site_at(self.program.function_at(at)?, at).filter(|_| is_native)
    }

    /// Adds the places and edits of a graft below a call. Answers what does not hold here, in sentences.
    fn graft(&mut self, host: &mut dyn Host, call: SlotId, graft: &Graft) -> Vec<String> {
        let mut notes = graft.lost.clone();
        if graft.edits.is_empty() {
            return notes;
        }
        let tree = &self.top().tree;
        let mut growing = Growing {
            graft,
            below: Path::of(tree, call).steps,
            slots: vec![None; graft.places.len()],
            numbers: vec![0; graft.edits.len() + 1],
            found: Vec::new(),
        };
        growing.slots[AROUND] = Some(Some(tree.slot(call).parent));
        growing.slots[CALL] = Some(Some(call));
        // In the order of the places, as far as they do not come from the code of an edit.
        for at in 0..graft.places.len() {
            if growing.is_ready(at) {
                self.place_of(&mut growing, at);
            }
        }
        for (number, change) in (1..).zip(&graft.edits) {
            if change.place == AROUND {
                continue;
            }
            match self.grow(host, &mut growing, change) {
                Ok(now) => {
                    growing.numbers[number] = now;
                    for at in 0..graft.places.len() {
                        if graft.places[at].comes_from(number) && growing.is_ready(at) {
                            self.place_of(&mut growing, at);
                        }
                    }
                }
                Err(why) => notes.push(not_applied(change.edit.word(), &change.edit.at, &why)),
            }
        }
        self.top().tree.grafted();
        notes
    }

    /// Adds an edit and the places that it needs. Answers its number.
    fn grow(
        &mut self,
        host: &mut dyn Host,
        growing: &mut Growing<'_>,
        change: &Change,
    ) -> Result<u32, String> {
        let gone = |place: usize| {
            let path = growing.graft.path(place);
            format!("the program does not have the place {} any more", path.show())
        };
        let (mine, theirs) =
            (gone(change.place), change.after.iter().map(|it| gone(*it)).collect::<Vec<_>>());
        let slot = self.place_of(growing, change.place).ok_or(mine)?;
        let mut after = Vec::new();
        let mut between = std::collections::BTreeMap::new();
        for (place, gone) in change.after.iter().zip(theirs) {
            let other = self.place_of(growing, *place).ok_or(gone)?;
            let tree = &self.top().tree;
            if other == slot {
                // What is owed after all calls of a group is owed after each of them as well.
                continue;
            }
            if is_within(tree, other, slot) || is_within(tree, slot, other) {
                return Err("one of the two is part of the other".into());
            }
            after.push(other);
            if let Some(steps) = change.between.get(place) {
                between.insert(other, steps.clone());
            }
        }
        if change.after.is_empty() && matches!(change.edit.what, What::Defer(_)) {
            return Err("`:after` names no task".into());
        }
        let edit = growing.moved(change);
        if let Some(number) = self.is_there(growing, slot, &edit, &after) {
            growing.found.push(number);
            return Ok(number);
        }
        let run = &self.runs[self.runs.len() - 1];
        self.check_value(&run.tree, slot, &edit)?;
        let plan = self.plan_called(slot)?;
        if let What::WithParam(key, _) = &edit.what
            && self.program.ground != Some(plan)
        {
            let run = &self.runs[self.runs.len() - 1];
            self.check_param(&run.tree, slot, plan, *key)?;
        }
        let home = change.code.or_else(|| self.home_of(&edit)).unwrap_or(plan);
        let code = self.compile_code(host, &edit, plan, home)?;
        let is_action = self.program.ground == Some(plan);
        let run = self.runs.last_mut().expect("a machine has a run");
        let callee = run.tree.slot(slot).name;
        let plan = (!is_action).then_some(plan);
        let accepted = Accepted {
            edit: Rc::new(edit),
            callee,
            plan,
            code,
            after,
            between,
            origin: change.origin.clone(),
        };
        if waits_for_itself(&run.tree, slot, &accepted) {
            return Err("it would wait for itself".into());
        }
        let number = run.tree.add_edit(slot, accepted);
        let chain = run.tree.keys.then(Chain::EMPTY, Step::Edit(number), |_| 0);
        run.inserted.extend(code.map(|code| (code, chain)));
        Ok(number)
    }

    /// An edit that is there already: the tree has been run with the graft, or the call is made again.
    fn is_there(&self, growing: &Growing<'_>, slot: SlotId, edit: &Edit, after: &[SlotId]) -> Option<u32> {
        let tree = &self.runs[self.runs.len() - 1].tree;
        let words = in_words(edit);
        let same = |number: &u32| {
            let known = &tree.edits[*number as usize - 1];
            known.after == after && !growing.found.contains(number) && in_words(&known.edit) == words
        };
        let added = |number: &u32| growing.numbers.contains(number);
        tree.edits_of(slot).iter().copied().find(|number| !added(number) && same(number))
    }

    /// The slot of a place, made if it is missing; none if the program does not have it.
    fn place_of(&mut self, growing: &mut Growing<'_>, place: usize) -> Option<SlotId> {
        let missing: Vec<usize> =
            std::iter::successors(Some(place), |at| Some(growing.graft.places[*at].above))
                .take_while(|at| growing.slots[*at].is_none())
                .collect();
        for at in missing.into_iter().rev() {
            let slot = self.slot_below(growing, at);
            growing.slots[at] = Some(slot);
        }
        growing.slots[place].flatten()
    }

    fn slot_below(&mut self, growing: &Growing<'_>, at: usize) -> Option<SlotId> {
        let place = &growing.graft.places[at];
        let above = growing.slots[place.above].flatten()?;
        let plan = self.plan_called(above).ok();
        let run = self.runs.last_mut().expect("a machine has a run");
        let code = match place.way.first() {
            Some(Link::Edit(number)) => {
                let now = growing.numbers.get(*number as usize).copied().filter(|now| *now > 0)?;
                run.tree.edits[now as usize - 1].code
            }
            _ => None,
        };
        let program = &self.program;
        let find = |words: &Words, known: Option<SiteId>| {
            // The code of an edit is compiled anew.
            let known = known.filter(|_| code.is_none());
            known.or_else(|| words.find(program, code, plan))
        };
        let site = find(place.site.as_ref()?, place.known)?;
        let it = &program.sites[site.at()];
        let mut steps = Vec::new();
        for link in &place.way {
            steps.push(match link {
                Link::Same(step) => step.clone(),
                Link::Through(words, known) => Step::Call(find(words, *known)?),
                Link::Edit(number) => Step::Edit(growing.numbers[*number as usize]),
            });
        }
        let named = steps.iter().any(|step| matches!(step, Step::Name(_)));
        if it.callee.is_none() && !named {
            let again = matches!(steps.last(), Some(Step::Again(_)));
            steps.insert(steps.len() - usize::from(again), Step::Name(place.step.name));
        }
        let hash = |site: SiteId| program.sites[site.at()].hash;
        let chain = steps.into_iter().fold(Chain::EMPTY, |chain, step| run.tree.keys.then(chain, step, hash));
        let slot = run.tree.restore_slot(above, Key { site, chain }, place.step.name, it.hash);
        if it.callee.is_none() && run.tree.called(slot).is_none() {
            let is_plan =
                matches!(program.code.get(it.pc.0 as usize), Some(Op::CallValue(..) | Op::CallNative(..)));
            let called = place.called.or_else(|| is_plan.then(|| plan_named(program, place.step.name))?);
            called.into_iter().for_each(|plan| run.tree.calls(slot, plan));
        }
        Some(slot)
    }

    /// The plan that is called at a slot; what grounds descriptions where one is performed.
    fn plan_called(&self, slot: SlotId) -> Result<FnId, String> {
        let run = &self.runs[self.runs.len() - 1];
        let it = run.tree.slot(slot);
        let site = &self.program.sites[it.key.site.at()];
        if let Some(plan) = site.callee.or(run.tree.called(slot)) {
            return Ok(plan);
        }
        self.program.ground.ok_or_else(|| format!("`{}` is no plan of the program", it.name))
    }
}

fn plan_named(program: &crate::code::Program, name: Symbol) -> Option<FnId> {
    let is_it = |it: &crate::code::Function| it.kind == FnKind::Plan && it.name == name;
    program.functions.iter().position(is_it).map(|at| FnId(at as u32))
}

impl Growing<'_> {
    /// True if what the place needs is there: the one above, and the edit whose code it stands in.
    fn is_ready(&self, at: usize) -> bool {
        let place = &self.graft.places[at];
        let from = place.way.first();
        let edit = matches!(from, Some(Link::Edit(number)) if self.numbers.get(*number as usize).is_none_or(|it| *it == 0));
        self.slots[at].is_none() && self.slots[place.above].is_some() && !edit
    }

    /// An edit with its paths as they are below the call.
    fn moved(&self, change: &Change) -> Edit {
        let root = self.graft.places[CALL].step;
        let above = &self.below[..self.below.len().saturating_sub(1)];
        let path = |place: usize| {
            let steps = self.graft.path(place).steps;
            let inside = steps.first() == Some(&root) && is_below(self.graft, place);
            let steps = if inside {
                self.below.iter().chain(&steps[1..]).copied().collect()
            } else {
                above.iter().chain(&steps).copied().collect()
            };
            Path { steps }
        };
        let value = |it: &Value| move_paths(it, root, &self.below, 0).unwrap_or_else(|| it.clone());
        let paths = || change.after.iter().map(|place| path(*place)).collect::<Vec<Path>>();
        let edit = &change.edit;
        let what = match &edit.what {
            What::Skip(given) => What::Skip(given.as_ref().map(value)),
            What::Replace(code) => What::Replace(value(code)),
            What::Before(code) => What::Before(value(code)),
            What::After(code) => What::After(value(code)),
            What::Wrap(code) => What::Wrap(value(code)),
            What::WithParam(key, given) => What::WithParam(*key, value(given)),
            What::Defer(_) => What::Defer(paths()),
            What::Owe { code, name, .. } => What::Owe { code: value(code), after: paths(), name: *name },
        };
        Edit { at: path(change.place), what, ..(**edit).clone() }
    }
}

fn is_below(graft: &Graft, place: usize) -> bool {
    std::iter::successors(Some(place), |at| Some(graft.places[*at].above).filter(|_| *at != AROUND))
        .any(|at| at == CALL)
}

/// What an edit says, apart from where.
fn in_words(edit: &Edit) -> String {
    let nowhere = Path { steps: Vec::new() };
    let what = match &edit.what {
        What::Defer(_) => What::Defer(Vec::new()),
        What::Owe { code, name, .. } => What::Owe { code: code.clone(), after: Vec::new(), name: *name },
        other => other.clone(),
    };
    let edit = Edit { at: nowhere, what, ..edit.clone() };
    crate::print::write(&Value::new(Obj::Edit(Box::new(edit))))
}
