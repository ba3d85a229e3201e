//! Edits: which hold for a call, what they change in it, and adding them to a tree.

use std::rc::Rc;

use compiler::ast::Function;
use vm::code::{FnId, SiteId};
use vm::edit::{Edit, What};
use vm::failure::{Builtin, Failure};
use vm::host::CodeRequest;
use vm::native::type_error;
use vm::path::Path;
use vm::value::{Obj, Symbol, Value};

use super::Tree;
use super::call::{Body, Call};
use super::eval::{Eval, Here};
use super::obligations;
use super::tasks::Oracle;

/// An edit that holds in a tree.
pub struct Accepted {
    pub edit: Edit,
    /// What was called at the slot.
    pub callee: Symbol,
    /// Its code. It lives until the process ends: tests are short.
    pub code: Option<(FnId, &'static Function)>,
    /// The slots that a `defer` or `owe` waits for.
    pub after: Vec<obligations::Awaited>,
}

impl<'p> Oracle<'_, 'p> {
    /// True if the tree has edits.
    pub fn is_edited(&self) -> bool {
        !self.run.tree.edits.is_empty()
    }

    /// Keeps the edits whose guards hold for a call as made, and changes its parameters.
    pub fn apply_edits(&mut self, call: &mut Call) {
        let written = call.args.clone();
        for id in self.run.tree.slots[call.slot].edits.clone() {
            let accepted = self.run.tree.edits[id].clone();
            if let Some(problem) = self.guard_problem(call, &written, &accepted) {
                self.run.tree.records[call.rec].notes.push(problem);
                continue;
            }
            call.edits.push(id);
            let What::WithParam(key, value) = &accepted.edit.what else { continue };
            match call.body {
                Body::Plan(plan) => {
                    let at = self.function(plan).params.names.iter().position(|name| name == key);
                    if let Some(at) = at {
                        call.args[at] = value.clone();
                    }
                }
                Body::Action => {
                    let desc = call.args[0].as_desc().expect("descriptions are performed");
                    call.args[0] = Value::desc(desc.with(*key, value.clone()));
                }
                Body::Branch => {}
            }
        }
        if call.args.iter().zip(&written).any(|(new, old)| !new.identical(old)) {
            let record = &mut self.run.tree.records[call.rec];
            record.args.clone_from(&call.args);
            record.written = Some(written);
        }
    }

    /// Why an edit does not hold for a call as made, if it does not.
    fn guard_problem(&self, call: &Call, args: &[Value], accepted: &Accepted) -> Option<String> {
        let word = accepted.edit.word();
        let (callee, made_for) = (self.run.tree.slots[call.slot].name, accepted.callee);
        if callee != made_for {
            return Some(format!(
                "{word} not applied: it was made for `{made_for}`, the call is of `{callee}`"
            ));
        }
        accepted.edit.guard.iter().find_map(|(key, wanted)| {
            let actual = match call.body {
                Body::Plan(plan) => {
                    let at = self.function(plan).params.names.iter().position(|name| name == key);
                    at.map(|at| args[at].clone())
                }
                Body::Action => args[0].as_desc().and_then(|desc| desc.get(*key).cloned()),
                Body::Branch => None,
            };
            if actual.as_ref() == Some(wanted) {
                return None;
            }
            let has = match actual.filter(|value| !value.is_unset()) {
                Some(value) => format!("has {}", vm::print::brief(&value)),
                None => "does not give it".into(),
            };
            let wanted = vm::print::brief(wanted);
            Some(format!("{word} not applied: its guard wants :{key} {wanted}, the call {has}"))
        })
    }

    // ------------------------------------------------------------------ adding

    /// `(edit-tree tree edits)`: all edits or none.
    pub fn edit_tree(&mut self, here: &Here, tree: &Value, edits: &Value) -> Eval<'p> {
        if tree.as_tree().is_none() {
            return self.raise(here, type_error("a tree", tree));
        }
        let old = self.tree_of(tree)?;
        let edits = match vm::native::list(edits) {
            Ok(edits) => edits,
            Err(raise) => return self.raise(here, raise),
        };
        let mut new = Tree::clone(&old);
        let mut refused: Vec<(Value, String)> = Vec::new();
        for value in edits {
            let Some(Obj::Edit(edit)) = value.obj() else {
                return self.raise(here, type_error("an edit", &value));
            };
            let slot = old.find(&edit.at).filter(|slot| *slot != 0);
            let Some(slot) = slot else {
                refused.push((value.clone(), "there is no such call".into()));
                continue;
            };
            match self.accept(here, &new, slot, edit) {
                Ok(accepted) => new.add_edit(slot, accepted),
                Err(why) => refused.push((value.clone(), why)),
            }
        }
        if refused.is_empty() {
            return Ok(self.tree_value(new));
        }
        let lines: Vec<String> =
            refused.iter().map(|(edit, why)| format!("{}: {why}", vm::print::brief(edit))).collect();
        let edits = Value::list(refused.into_iter().map(|(edit, _)| edit).collect::<Vec<_>>());
        let fields = vec![("message", Value::str(lines.join("\n"))), ("edit", edits)];
        self.raise(here, Box::new(Failure::with(Builtin::EditRefused, fields)))
    }

    /// What holds at a slot, or why the edit is refused.
    fn accept(&mut self, here: &Here, tree: &Tree, slot: usize, edit: &Edit) -> Result<Accepted, String> {
        let it = &tree.slots[slot];
        let plan = it.plan.or(self.world.program().ground).ok_or("it is no plan of the program")?;
        let (code, original) = match &edit.what {
            What::Skip(None) | What::Defer(_) if it.value_used => {
                return Err("the value of the call is used".into());
            }
            What::WithParam(key, _) if it.plan.is_some() => {
                if !self.world.program().functions[plan.at()].params.names.contains(key) {
                    return Err(format!("there is no parameter `{key}`"));
                }
                (None, false)
            }
            What::Replace(code) | What::Wrap(code) => (Some(code), true),
            What::Before(code) | What::After(code) | What::Owe { code, .. } => (Some(code), false),
            What::Skip(_) | What::Defer(_) | What::WithParam(..) => (None, false),
        };
        let after = match &edit.what {
            What::Defer(after) => awaited(tree, slot, after, false)?,
            What::Owe { .. } if it.parent == Some(0) && it.key.0 == SiteId(0) => {
                return Err("nothing is around the plan of a run".into());
            }
            What::Owe { after, .. } => awaited(tree, slot, after, true)?,
            _ => Vec::new(),
        };
        if let What::Defer(_) = edit.what {
            obligations::check_cycle(tree, slot, &after)?;
        }
        let code = match code {
            None => None,
            Some(form) => {
                // Its words mean what they mean where the edit is made.
                let home = here.owner.unwrap_or(plan);
                let (id, function) = self.world.compile(&CodeRequest { form, plan, home, original })?;
                let kept: &'static Rc<Function> = Box::leak(Box::new(function));
                Some((id, &**kept))
            }
        };
        Ok(Accepted { edit: edit.clone(), callee: it.name, code, after })
    }
}

/// The slots that a call shall wait for: outside of it, and it outside of them. What is owed after
/// all calls of a group may name its own call among them.
fn awaited(tree: &Tree, slot: usize, paths: &[Path], own: bool) -> Result<Vec<obligations::Awaited>, String> {
    if paths.is_empty() {
        return Err("`:after` names no task".into());
    }
    let mut after = Vec::new();
    for path in paths {
        let other = tree.find(path).ok_or_else(|| format!("there is no {}", path.show()))?;
        if own && other == slot {
            continue;
        }
        if tree.is_within(other, slot) || tree.is_within(slot, other) {
            return Err(format!("{} and the call are part of each other", path.show()));
        }
        if !after.iter().any(|known: &obligations::Awaited| known.slot == other) {
            after.push(obligations::Awaited::of(tree, slot, other));
        }
    }
    Ok(after)
}
