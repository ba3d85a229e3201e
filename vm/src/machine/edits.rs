//! Adding edits to a tree: paths become slots, code is compiled, what cannot hold is refused.

use std::rc::Rc;

use crate::code::{FnId, SiteId};
use crate::edit::{Accepted, Edit, What};
use crate::failure::{Builtin, Failure};
use crate::host::{CodeRequest, Host};
use crate::native::{Raise, type_error};
use crate::path::{Path, Places};
use crate::persist::{Restored, SavedEdit, SavedTree};
use crate::tree::{NodeKind, ROOT, SlotId, Tree};
use crate::value::{Obj, Symbol, Value};

use super::Machine;
use super::obligation::Guard;

impl Machine {
    /// `(edit-tree tree edits :origin origin)`: all edits or none.
    pub(super) fn edit_tree(
        &mut self,
        host: &mut dyn Host,
        tree: &Value,
        edits: &Value,
        origin: &str,
    ) -> Result<Value, Raise> {
        let mut tree = Tree::clone(tree.as_tree().ok_or_else(|| type_error("a tree", tree))?);
        let mut refused = Vec::new();
        let mut places = Places::default();
        for value in crate::native::list(edits)? {
            let Some(Obj::Edit(edit)) = value.obj() else { return Err(type_error("an edit", &value)) };
            match self.accept(host, &tree, &mut places, edit) {
                Ok((slot, accepted)) if waits_for_itself(&tree, slot, &accepted) => {
                    let why = format!("{} would wait for itself", Path::of(&tree, slot).show());
                    refused.push((value, why));
                }
                Ok((slot, accepted)) => {
                    let origin = match (origin, edit.by) {
                        ("", Some(by)) => format!("transformation {by}").into(),
                        (origin, _) => origin.into(),
                    };
                    tree.add_edit(slot, Accepted { origin, ..accepted });
                }
                Err(why) => refused.push((value, why)),
            }
        }
        if refused.is_empty() {
            return Ok(Value::new(Obj::Tree(Rc::new(tree))));
        }
        let lines: Vec<String> =
            refused.iter().map(|(edit, why)| format!("{}: {why}", crate::print::brief(edit))).collect();
        let edits = Value::list(refused.into_iter().map(|(edit, _)| edit).collect::<Vec<_>>());
        let fields = vec![("message", Value::str(lines.join("\n"))), ("edit", edits)];
        Err(Box::new(Failure::with(Builtin::EditRefused, fields)))
    }

    /// The slot of an edit and what holds there, or why it is refused.
    fn accept(
        &mut self,
        host: &mut dyn Host,
        tree: &Tree,
        places: &mut Places,
        edit: &Edit,
    ) -> Result<(SlotId, Accepted), String> {
        let slot = edit.at.find_with(tree, places)?;
        self.accept_at(host, tree, slot, edit)
    }

    /// Goes on with a saved tree: its places and edits are those of the run that begins. Answers the edits that hold no
    /// more, each with the reason. `top` is the site that calls the plan.
    ///
    /// # Errors
    /// A sentence that says which row of the tree does not fit to the others.
    pub fn take_up(
        &mut self,
        host: &mut dyn Host,
        saved: &SavedTree,
        top: Option<SiteId>,
        read: &dyn Fn(&str) -> Value,
    ) -> Result<Vec<(SavedEdit, String)>, String> {
        let (tree, orphans) = self.restore(host, saved, top, read)?;
        let run = self.bottom();
        let world = run.world.take();
        let traced = run.traced;
        *run = super::Run::new(tree, traced, run.seed);
        run.world = world;
        Ok(orphans)
    }

    /// A saved tree as one of this program, and the edits that hold no more, each with the reason.
    ///
    /// # Errors
    /// A sentence that says which row of the tree does not fit to the others.
    pub fn restore(
        &mut self,
        host: &mut dyn Host,
        saved: &SavedTree,
        top: Option<SiteId>,
        read: &dyn Fn(&str) -> Value,
    ) -> Result<(Tree, Vec<(SavedEdit, String)>), String> {
        let mut restored = Restored::new(saved)?;
        let mut orphans = Vec::new();
        let mut open: Vec<&SavedEdit> = saved.edits.iter().collect();
        // Code of edits has places, too, and these may have edits.
        while restored.add_slots(&self.program, saved, top) {
            // Edits look at what was called where.
            let mut ran = Restored { tree: restored.tree.clone(), ..Restored::new(saved)? };
            ran.slots.clone_from(&restored.slots);
            ran.add_records(&self.program, saved, read);
            let mut waiting = Vec::new();
            for it in open {
                let known = restored.slots.get(it.slot as usize).copied().filter(|slot| slot.0 != 0);
                let Some(slot) = known else {
                    waiting.push(it);
                    continue;
                };
                match self.accept_saved(host, &ran, slot, it, read) {
                    Ok(accepted) => restored.add_edit(it.number, slot, accepted),
                    Err(why) => orphans.push((it.clone(), why)),
                }
            }
            open = waiting;
            if open.is_empty() && restored.edits.len() == 1 {
                break;
            }
        }
        let gone = "the program does not have this place any more";
        orphans.extend(open.into_iter().map(|it| (it.clone(), gone.to_string())));
        restored.add_records(&self.program, saved, read);
        Ok((restored.tree, orphans))
    }

    fn accept_saved(
        &mut self,
        host: &mut dyn Host,
        ran: &Restored,
        slot: SlotId,
        it: &SavedEdit,
        read: &dyn Fn(&str) -> Value,
    ) -> Result<Accepted, String> {
        let value = read(&it.edit);
        let Some(Obj::Edit(edit)) = value.obj() else { return Err("it is no edit".into()) };
        let (after, between) =
            ran.after(&self.program, &it.after).ok_or("a task that it waits for is not there any more")?;
        let site = &self.program.sites[ran.tree.slot(slot).key.site.at()];
        if site.callee.is_some() && site.name != it.callee.as_str() {
            return Err(format!("`{}` is called there now, not `{}`", site.name, it.callee));
        }
        // The places are known; what is left to see is whether it can hold there.
        let alone = Edit {
            what: match &edit.what {
                What::Defer(_) => What::Defer(after.iter().map(|slot| Path::of(&ran.tree, *slot)).collect()),
                What::Owe { code, name, .. } => What::Owe {
                    code: code.clone(),
                    name: *name,
                    after: after.iter().map(|slot| Path::of(&ran.tree, *slot)).collect(),
                },
                other => other.clone(),
            },
            ..(**edit).clone()
        };
        let (_, accepted) = self.accept_at(host, &ran.tree, slot, &alone)?;
        Ok(Accepted {
            edit: Rc::new((**edit).clone()),
            after,
            between,
            origin: it.origin.as_str().into(),
            ..accepted
        })
    }

    /// The same where the place is known.
    fn accept_at(
        &mut self,
        host: &mut dyn Host,
        tree: &Tree,
        slot: SlotId,
        edit: &Edit,
    ) -> Result<(SlotId, Accepted), String> {
        if slot == ROOT {
            return Err("the root is not called, so nothing can be changed there".into());
        }
        let after = match &edit.what {
            What::Defer(after) => find_all(tree, slot, after, false)?,
            What::Owe { .. } if tree.slot(slot).parent == ROOT && tree.slot(slot).key.site == SiteId(0) => {
                return Err(
                    "nothing is around the plan that is run; say `after` for what comes at its end".into()
                );
            }
            What::Owe { after, .. } => find_all(tree, slot, after, true)?,
            _ => Vec::new(),
        };
        self.check_value(tree, slot, edit)?;
        let plan = self.plan_at(tree, slot)?;
        let home = self.home_of(edit).unwrap_or(plan);
        let code = self.compile_code(host, edit, plan, home)?;
        let is_action = self.program.ground == Some(plan);
        let (callee, plan) = (tree.slot(slot).name, (!is_action).then_some(plan));
        let between = after
            .iter()
            .filter_map(|q| Some((*q, super::obligation::between(&self.program, tree, slot, *q)?)));
        let between = between.collect();
        self.check_guards(tree, slot, edit, &after)?;
        Ok((
            slot,
            Accepted { edit: Rc::new(edit.clone()), callee, plan, code, after, between, origin: "".into() },
        ))
    }

    /// The function in whose module the code of an edit means what its words mean: that which defines the transformation
    /// that made it, else the one that is running, for there it was written, mostly.
    pub(super) fn home_of(&mut self, edit: &Edit) -> Option<FnId> {
        let maker = edit.by.and_then(|by| {
            let name = format!("%{by}-transformation");
            self.program.functions.iter().rposition(|it| it.name == name.as_str())
        });
        if let Some(maker) = maker {
            return Some(FnId(maker as u32));
        }
        let at = self.top().pc.checked_sub(1).map(crate::code::Pc)?;
        self.program.function_at(at)
    }

    /// The code of an edit of a call of `plan`, if it has some.
    pub(super) fn compile_code(
        &mut self,
        host: &mut dyn Host,
        edit: &Edit,
        plan: FnId,
        home: FnId,
    ) -> Result<Option<FnId>, String> {
        let (form, original) = match &edit.what {
            What::Replace(code) | What::Wrap(code) => (code, true),
            What::Before(code) | What::After(code) | What::Owe { code, .. } => (code, false),
            What::Skip(_) | What::WithParam(..) | What::Defer(_) => return Ok(None),
        };
        host.compile(&mut self.program, CodeRequest { form, plan, home, original }).map(Some)
    }

    /// What is performed later is performed outside of clean-ups, time-outs and policies around its call. The edit must say
    /// that it means that, for its own call and for those that wait for it.
    fn check_guards(&self, tree: &Tree, slot: SlotId, edit: &Edit, after: &[SlotId]) -> Result<(), String> {
        if after.is_empty() {
            return Ok(());
        }
        let after = what_those_wait_for(tree, after);
        let mut moved = vec![(slot, edit.out_of.clone())];
        if let What::Defer(_) = edit.what {
            moved.extend(those_that_wait_for(tree, slot));
        }
        for (p, said) in moved {
            let mut guards: Vec<Guard> = Vec::new();
            for q in after.iter().filter(|q| **q != p) {
                guards.extend(super::obligation::guards(&self.program, tree, p, *q));
            }
            let is_said = |it: &&Guard| said.contains(&it.name) || edit.out_of.contains(&it.name);
            let Some(guard) = guards.iter().find(|it| !is_said(it)) else { continue };
            let mut names: Vec<&str> = Vec::new();
            for guard in &guards {
                if !names.contains(&guard.name.as_str()) {
                    names.push(guard.name.as_str());
                }
            }
            return Err(format!(
                "{} would be performed outside of the {} around it in {}; if that may be, say {}",
                Path::of(tree, p).show(),
                guard.shown(),
                guard.place,
                match edit.by {
                    Some(by) => format!("`:out-of ({})` in the transformation {by}", names.join(" ")),
                    None => format!("`:out-of '({})`", names.join(" ")),
                },
            ));
        }
        Ok(())
    }

    /// A call whose value is used can be left out only with another value in its place.
    pub(super) fn check_value(&self, tree: &Tree, slot: SlotId, edit: &Edit) -> Result<(), String> {
        let used = self.program.sites[tree.slot(slot).key.site.at()].value_used;
        let path = || Path::of(tree, slot).show();
        match &edit.what {
            What::Skip(None) if used => {
                Err(format!("the value of {} is used; say `:value v` for what it should be", path()))
            }
            What::Defer(_) if used => {
                Err(format!("the value of {} is used, so it cannot be performed later", path()))
            }
            What::WithParam(key, _) => {
                let Some(rec) = tree.shown(slot) else { return Ok(()) };
                match tree.record(rec).kind {
                    NodeKind::Action => Ok(()),
                    _ => self.check_param(tree, slot, self.plan_at(tree, slot)?, *key),
                }
            }
            _ => Ok(()),
        }
    }

    /// Edits change parameters that the plan has.
    pub(super) fn check_param(
        &self,
        tree: &Tree,
        slot: SlotId,
        plan: FnId,
        key: Symbol,
    ) -> Result<(), String> {
        let known: Vec<Symbol> = self.program.functions[plan.at()].params.given_names().collect();
        if known.contains(&key) {
            return Ok(());
        }
        let path = Path::of(tree, slot).show();
        let known: Vec<&str> = known.iter().map(|name| name.as_str()).collect();
        Err(match known.is_empty() {
            true => format!("{path} has no parameter `{key}`, and no other that has a name"),
            false => format!("{path} has no parameter `{key}`, only {}", known.join(", ")),
        })
    }

    /// The plan that was called at a slot.
    pub(super) fn plan_at(&self, tree: &Tree, slot: SlotId) -> Result<FnId, String> {
        if let Some(plan) = self.program.sites[tree.slot(slot).key.site.at()].callee {
            return Ok(plan);
        }
        let is_action = tree.shown(slot).is_some_and(|rec| tree.record(rec).kind == NodeKind::Action);
        let called = tree.called(slot).filter(|_| !is_action).or(self.program.ground);
        called.ok_or_else(|| format!("`{}` is no plan of the program", tree.slot(slot).name))
    }
}

/// The slots of some paths; they must lie outside of the place that waits for them.
fn find_all(tree: &Tree, slot: SlotId, paths: &[Path], own: bool) -> Result<Vec<SlotId>, String> {
    if paths.is_empty() {
        return Err("`:after` names no task".into());
    }
    let mut slots = Vec::new();
    for path in paths {
        let other = path.find(tree)?;
        if own && other == slot {
            // What is owed after all calls of a group is owed after each of them as well.
            continue;
        }
        if is_within(tree, other, slot) || is_within(tree, slot, other) {
            return Err(format!(
                "{} cannot wait for {}: one is part of the other",
                Path::of(tree, slot).show(),
                path.show()
            ));
        }
        if !slots.contains(&other) {
            slots.push(other);
        }
    }
    Ok(slots)
}

/// These slots, and those that they are themselves deferred after: a call may move on to where they are performed.
fn what_those_wait_for(tree: &Tree, slots: &[SlotId]) -> Vec<SlotId> {
    let mut all = slots.to_vec();
    let mut at = 0;
    while let Some(slot) = all.get(at).copied() {
        let edits = tree.edits_of(slot).iter().map(|id| &tree.edits[*id as usize - 1]);
        for later in edits.filter(|it| matches!(it.edit.what, What::Defer(_))).flat_map(|it| &it.after) {
            if !all.contains(later) {
                all.push(*later);
            }
        }
        at += 1;
    }
    all
}

/// The slots whose calls wait for that of a slot, or for one of those, and what their edits may move them out of.
fn those_that_wait_for(tree: &Tree, slot: SlotId) -> Vec<(SlotId, Vec<Symbol>)> {
    let mut all = vec![(slot, Vec::new())];
    let mut at = 0;
    while let Some((awaited, _)) = all.get(at) {
        let awaited = *awaited;
        at += 1;
        if !tree.edits.iter().any(|it| it.after.contains(&awaited)) {
            continue;
        }
        for other in tree.slots().filter(|it| !tree.edits_of(*it).is_empty()) {
            let edits = tree.edits_of(other).iter().map(|id| &tree.edits[*id as usize - 1]);
            let waiting: Vec<_> = edits.filter(|it| it.after.contains(&awaited)).collect();
            if !waiting.is_empty() && all.iter().all(|(known, _)| *known != other) {
                all.push((other, waiting.iter().flat_map(|it| it.edit.out_of.iter().copied()).collect()));
            }
        }
    }
    all.split_off(1)
}

/// True if an edit closes a circle of calls each of which is deferred after one other. (A call that
/// waits for the last of several is deferred only while one of them is still to come.)
pub(super) fn waits_for_itself(tree: &Tree, slot: SlotId, edit: &Accepted) -> bool {
    let deferred_after = |edit: &Accepted| match (&edit.edit.what, edit.after.as_slice()) {
        (What::Defer(_), [after]) => Some(*after),
        _ => None,
    };
    let next = |at: &SlotId| {
        tree.edits_of(*at).iter().rev().find_map(|id| deferred_after(&tree.edits[*id as usize - 1]))
    };
    let mut chain = std::iter::successors(deferred_after(edit), next).take(tree.edits.len() + 1);
    chain.any(|at| at == slot)
}

/// True if `slot` is `of` or below it.
pub(super) fn is_within(tree: &Tree, slot: SlotId, of: SlotId) -> bool {
    std::iter::successors(Some(slot), |at| Some(tree.slot(*at).parent).filter(|up| up.0 != 0))
        .any(|at| at == of)
}
