//! A call of a slot with edits: which of them hold, and what they make of its parameters.

use crate::code::Program;
use crate::edit::{Accepted, Edit, What};
use crate::tree::{SlotId, Tree};
use crate::value::{Symbol, Value};

use super::drive::Body;

/// A call of a slot with edits.
pub(super) struct Edited<'m> {
    pub program: &'m Program,
    pub tree: &'m Tree,
    pub slot: SlotId,
    pub body: Body,
}

impl<'m> Edited<'m> {
    /// The edits of the slot, with their numbers, in the order in which they were accepted.
    pub(super) fn edits(&self) -> impl Iterator<Item = (u32, &'m Accepted)> + use<'m> {
        let all = &self.tree.edits;
        self.tree.edits_of(self.slot).iter().map(|id| (*id, &all[*id as usize - 1]))
    }

    /// True if all edits hold for a call with these arguments and do no more than change parameters. Such a
    /// call is made like any other.
    #[inline]
    pub(super) fn only_changes_params(&self, args: &[Value]) -> bool {
        self.edits().all(|(_, accepted)| {
            matches!(accepted.edit.what, What::WithParam(..)) && self.problem(accepted, args).is_none()
        })
    }

    /// Why an edit does not hold for a call as made, if it does not.
    #[inline]
    pub(super) fn problem(&self, accepted: &Accepted, args: &[Value]) -> Option<String> {
        let callee = match self.body {
            Body::Plan(function) => self.program.functions[function.at()].name,
            Body::Action | Body::Branch(_) => self.tree.slot(self.slot).name,
        };
        let is_other_plan =
            matches!((self.body, accepted.plan), (Body::Plan(now), Some(then)) if now != then);
        if callee != accepted.callee || is_other_plan {
            return Some(format!(
                "{} not applied: it was made for `{}`, the call is of `{callee}`",
                accepted.edit.word(),
                accepted.callee
            ));
        }
        let refusing = accepted.edit.guard.iter().find(|(key, wanted)| {
            let actual = self.param(args, *key);
            actual.is_none_or(|actual| crate::value::equal(&actual, wanted, 100_000) != Some(true))
        });
        let (key, wanted) = refusing?;
        let given = self.param(args, *key).filter(|value| !value.is_unset());
        let has = given.map(|value| format!("has {}", crate::print::brief(&value)));
        Some(format!(
            "{} not applied: its guard wants :{key} {}, the call {}",
            accepted.edit.word(),
            crate::print::brief(wanted),
            has.as_deref().unwrap_or("does not give it")
        ))
    }

    /// A parameter of a plan by name, or a property of a performed description.
    fn param(&self, args: &[Value], key: Symbol) -> Option<Value> {
        match self.body {
            Body::Plan(_) => args.get(self.place_of(key)?).cloned(),
            Body::Action => args.first()?.as_desc()?.get(key).cloned(),
            Body::Branch(_) => None,
        }
    }

    /// The number of a parameter of a plan.
    fn place_of(&self, key: Symbol) -> Option<usize> {
        let Body::Plan(function) = self.body else { return None };
        self.program.functions[function.at()].params.names.iter().position(|name| *name == key)
    }

    /// Gives a parameter the value that an edit says, if it says one.
    #[inline]
    pub(super) fn change_param(&self, edit: &Edit, args: &mut [Value]) {
        let What::WithParam(key, value) = &edit.what else { return };
        match self.body {
            Body::Plan(_) => {
                if let Some(arg) = self.place_of(*key).and_then(|at| args.get_mut(at)) {
                    arg.clone_from(value);
                }
            }
            Body::Action => {
                if let Some(arg) = args.first_mut()
                    && let Some(desc) = arg.as_desc()
                {
                    *arg = Value::desc(desc.with(*key, value.clone()));
                }
            }
            Body::Branch(_) => {}
        }
    }

    /// Gives parameters the values that all edits say.
    #[inline]
    pub(super) fn change_params(&self, args: &mut [Value]) {
        self.edits().for_each(|(_, accepted)| self.change_param(&accepted.edit, args));
    }
}
