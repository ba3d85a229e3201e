//! Where: the common form of two places, found by comparing the ways to them.
//!
//! The way to a slot is a list of levels, one for each function between the root and the call:
//! its call site and the rounds of loops around that. Two ways are the same up to the level at
//! which the places part; the forms of that level's function say the rest.

use crate::code::{FnKind, FormKind, FormRange, Pc, Program, SiteId};
use crate::key::Step;
use crate::op::Op;
use crate::tree::{ROOT, RecId, SlotId, Tree};
use crate::value::Symbol;

use super::super::drive::Driver;
use super::super::task::TaskId;
use super::super::{Frame, Here, RESUME, Run};
use super::Side;

/// One function between the root and a call: the call that it makes, and the rounds it is in.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Level {
    pub(super) site: SiteId,
    pub(super) rounds: Vec<Step>,
    pub(super) again: u32,
    pub(super) name: Option<Symbol>,
}

/// The frame of a level.
pub(super) struct Activation {
    pub(super) pc: u32,
    pub(super) base: u32,
    pub(super) here: Here,
    pub(super) task: TaskId,
    depth: usize,
    pub(super) stands: Stands,
}

/// Where a frame stands in its function.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Stands {
    /// At a call.
    At(SiteId),
    /// At the end of a part of this form, which performs what it owes. What is inside of it is over.
    EndOf(u32),
}

impl Activation {
    /// The frame, for obligations.
    pub(super) fn holder(&self) -> (TaskId, usize) {
        (self.task, self.depth)
    }

    /// The forms that the frame is in, innermost first.
    pub(super) fn forms<'p>(
        &self,
        program: &'p Program,
    ) -> impl Iterator<Item = (u32, &'p FormRange)> + use<'p> {
        program.forms_outward(match self.stands {
            Stands::At(site) => program.sites[site.at()].form,
            Stands::EndOf(form) => form,
        })
    }
}

/// The levels between the root and a slot, and for each the slot that they lead to.
pub(super) fn levels(tree: &Tree, slot: SlotId) -> Vec<(Level, SlotId)> {
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
pub(super) struct Common {
    /// The level at which they part.
    pub(super) level: usize,
    pub(super) form: u32,
    pub(super) side: Side,
}

/// The common form of the call that `mine` leads to and the place that `theirs` leads to.
pub(super) fn common_form(
    program: &Program,
    mine: &[(Level, SlotId)],
    theirs: &[(Level, SlotId)],
) -> Option<Common> {
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
    let is_branch = |it: &Level| {
        let pc = program.sites[it.site.at()].pc;
        matches!(program.code[pc.at()], Op::Fork(..)).then_some((pc, it.again))
    };
    if is_branch(ours).is_some() && is_branch(ours) == is_branch(other) {
        return Some(Common { level, form, side: Side::Branch(theirs[level].1) });
    }
    if ours.site == other.site {
        return Some(repeated(program, mine, level, other.again > ours.again));
    }
    let depth = a.iter().position(|it| *it == form)? + 1;
    let branch = |path: &[u32]| match program.forms[*path.get(depth)? as usize].kind {
        FormKind::Branch(of) => Some(of),
        _ => None,
    };
    if let (Some(of), Some(other)) = (branch(&a), branch(&b))
        && of == other
    {
        // The other branch of an `if`: it does not come while this one is done. (3)
        return Some(Common { level, form, side: Side::Until(program.forms[form as usize].start) });
    }
    let end = match b.get(depth) {
        Some(side) => program.forms[*side as usize].end,
        None => Pc(program.sites[other.site.at()].pc.0 + 1),
    };
    Some(Common { level, form, side: Side::Until(end) })
}

/// The same call again: the innermost loop without keys around it in its task, or the whole body of that.
fn repeated(program: &Program, mine: &[(Level, SlotId)], level: usize, comes: bool) -> Common {
    let outward = |level: usize| program.forms_outward(program.sites[mine[level].0.site.at()].form);
    let looped = |level: usize| {
        let unkeyed = |form: &FormRange| matches!(form.kind, FormKind::Round(None));
        let around = outward(level).skip_while(|(_, form)| !unkeyed(form)).nth(1);
        around.map(|(form, _)| (level, form))
    };
    // Functions between are levels that lead to the same slot.
    let first = mine[..level].iter().rposition(|(_, slot)| *slot != mine[level].1).map_or(0, |at| at + 1);
    let body = || (first, outward(first).last().map_or(0, |(form, _)| form));
    let (level, form) = (first..=level).rev().find_map(looped).unwrap_or_else(body);
    // What was called before is over when the form has begun.
    let side = if comes { Side::Later(RecId(0)) } else { Side::Until(program.forms[form as usize].start) };
    Common { level, form, side }
}

impl Run {
    /// The frames of the levels that lead to the call whose driver is on top, outermost first. A frame
    /// is gone where the call, or a task around it, is itself performed later than it was made.
    pub(super) fn activations(&self, program: &Program, levels: usize) -> Vec<Option<Activation>> {
        let mut found: Vec<Option<Activation>> = Vec::new();
        let mut task = self.tasks.loaded;
        // The code of `wrap` and `replace` is no part of the way to what `(original)` in it calls.
        let mut skips = false;
        self.activations_in(program, levels, task, None, &mut skips, &mut found);
        while task != TaskId::ROOT {
            // The frame that began the branch stands at it.
            let branch = self.tree.slot(self.tasks.get(task).slot).key.site;
            task = self.tasks.get(task).parent;
            self.activations_in(program, levels, task, Some(branch), &mut skips, &mut found);
        }
        // The plan of a run is called by nobody.
        found.resize_with(levels, || None);
        found.reverse();
        found
    }

    /// Those of one task, innermost first. `branch` is what the innermost one waits for.
    fn activations_in(
        &self,
        program: &Program,
        levels: usize,
        task: TaskId,
        mut branch: Option<SiteId>,
        skips: &mut bool,
        found: &mut Vec<Option<Activation>>,
    ) {
        let (frames, drivers) = self.frames_of(task);
        // The frame on top of those that wait for a branch is the driver of its form.
        let (mut depth, mut driver) = (frames.len(), drivers.len() - usize::from(branch.is_some()));
        // Other inserted code is called by its record, not by the code of its plan.
        let mut inserted_in = None;
        while let Some(at) = depth.checked_sub(1) {
            depth = at;
            let (mut frame, mut stands) = (frames[at], None);
            if frame.pc == RESUME {
                // The outermost frame of a task has no driver.
                let Some(at_driver) = driver.checked_sub(1) else { break };
                driver = at_driver;
                let discharge = match &drivers[driver] {
                    Driver::Discharge(discharge) => discharge,
                    Driver::Body(_) | Driver::Wrap(_) => {
                        *skips = true;
                        continue;
                    }
                    // The call itself is made by a task above.
                    Driver::Origin(_) => continue,
                    Driver::Call(_) | Driver::Fork(_) | Driver::Solve(_) => {
                        *skips = false;
                        continue;
                    }
                };
                let holder = frames[at - 1];
                let Some(level) = discharge.level() else {
                    // The code of an `owe` is called by the record that owes it.
                    found.push(None);
                    inserted_in = Some(self.record(holder.here));
                    continue;
                };
                // The frame that owes it stands for its level; those between are gone.
                found.resize_with(levels.saturating_sub(level + 1), || None);
                (*skips, inserted_in, depth) = (false, None, at - 1);
                (frame, stands) = (holder, Some(Stands::EndOf(discharge.form())));
                if discharge.then.is_some() {
                    // A failure leaves the form: nothing in it is to come.
                    frame.pc = program.forms[discharge.form() as usize].end.0;
                }
            }
            if *skips || inserted_in == Some(self.record(frame.here)) {
                continue;
            }
            inserted_in = None;
            let Frame { pc, base, here, .. } = frame;
            let call = Pc(pc.saturating_sub(1));
            let Some(function) = program.function_at(call) else { continue };
            if program.functions[function.at()].kind == FnKind::Inserted {
                inserted_in = Some(self.record(here));
            }
            let site = branch.take().or_else(|| program.site_at(function, call));
            let stands = stands.or(site.map(Stands::At));
            found.extend(stands.map(|stands| Some(Activation { pc, base, here, task, depth, stands })));
        }
    }
}

/// The side of a place whose own common form is inside of `form`.
pub(super) fn side_within(
    program: &Program,
    form: u32,
    inner: &Common,
    mine: &[(Level, SlotId)],
    level: usize,
) -> Side {
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
pub(super) fn own_side(program: &Program, form: u32, level: &Level) -> Side {
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

/// The keys of rounds between two places in the tree that an edit was made for. (3)
pub(in crate::machine) fn between(program: &Program, tree: &Tree, p: SlotId, q: SlotId) -> Option<Vec<Step>> {
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
