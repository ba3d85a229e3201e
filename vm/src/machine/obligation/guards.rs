//! What stands around a call and not around the form in which it is performed later.
//!
//! Clean-ups, time-outs and policies hold for what is done inside of them. What is deferred or owed is performed outside
//! of those between its call and the common form, and who moves work out of one has to say so: see `edit-tree`.

use crate::code::{FnId, FnKind, FormKind, Program, SiteId};
use crate::edit::What;
use crate::op::Op;
use crate::path::Path;
use crate::tree::{SlotId, Tree};
use crate::value::{Imm, Symbol, Value};

use super::place::{Level, common_form, levels};

/// Branches that are a guard of what is done in them, by their names.
const BRANCHES: [&str; 2] = ["with-timeout", "with-policy"];

/// Something around a call that is not around what is performed later.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::machine) struct Guard {
    /// `with-timeout`, `with-policy`, `clean-up`, or the form that has the clean-up.
    pub(in crate::machine) name: Symbol,
    /// Where it stands, for people.
    pub(in crate::machine) place: String,
}

impl Guard {
    /// What it is, for people.
    pub(in crate::machine) fn shown(&self) -> String {
        match self.name.as_str() {
            "clean-up" => "clean-up of `unwind-protect`".into(),
            name => format!("`{name}`"),
        }
    }
}

/// The guards around the call of `p` inside of the common form of `p` and `q`, innermost first.
pub(in crate::machine) fn guards(program: &Program, tree: &Tree, p: SlotId, q: SlotId) -> Vec<Guard> {
    let (mine, theirs) = (levels(tree, p), levels(tree, q));
    let Some(common) = common_form(program, &mine, &theirs) else { return Vec::new() };
    let mut found = Vec::new();
    let mut inner = p;
    for (at, (level, slot)) in mine.iter().enumerate().skip(common.level).rev() {
        if *slot != inner {
            inner = *slot;
            let place = format!("what an edit puts around {}", Path::of(tree, inner).show());
            let names = around_original(program, tree, inner).into_iter();
            found.extend(names.map(|name| Guard { name, place: place.clone() }));
        }
        let outermost = (at == common.level).then_some(common.form);
        let place = || place(program, tree, level, *slot);
        found.extend(around(program, level.site, outermost).map(|name| Guard { name, place: place() }));
    }
    // A policy is a branch and a clean-up, which is one guard.
    found.dedup();
    found
}

/// The names of the guards around a site in its function, up to a form of it.
fn around(program: &Program, site: SiteId, form: Option<u32>) -> impl Iterator<Item = Symbol> {
    let it = &program.sites[site.at()];
    let is_guard = matches!(program.code[it.pc.at()], Op::Fork(..)) && BRANCHES.contains(&it.name.as_str());
    let forms = program.forms_outward(it.form).take_while(move |(id, _)| Some(*id) != form);
    let names = forms.filter_map(|(_, form)| match form.kind {
        FormKind::Protected { name, .. } | FormKind::CleanUp { name, .. } => Some(name),
        _ => None,
    });
    is_guard.then_some(it.name).into_iter().chain(names)
}

/// The guards in code that edits run in the place of a call, around the call in it.
fn around_original(program: &Program, tree: &Tree, slot: SlotId) -> Vec<Symbol> {
    let edits = tree.edits_of(slot).iter().map(|id| &tree.edits[*id as usize - 1]);
    let codes = edits.filter(|it| matches!(it.edit.what, What::Wrap(_) | What::Replace(_)));
    let names = codes.filter_map(|it| it.code).filter_map(|code| originals(program, code));
    names.flatten().collect()
}

/// The guards around any `(original)` in a function and its branches; none if there is no such call.
fn originals(program: &Program, function: FnId) -> Option<Vec<Symbol>> {
    let it = &program.functions[function.at()];
    let mut names: Option<Vec<Symbol>> = None;
    let mut branches: Vec<(u8, FnId)> = Vec::new();
    for op in &program.code[it.entry.at()..it.end.at()] {
        match *op {
            Op::Closure(register, _, branch) => branches.push((register, branch)),
            Op::Const(register, value) => {
                if let Value::Imm(Imm::Function(branch)) = program.constants[value.at()] {
                    branches.push((register, branch));
                }
            }
            Op::Original(_, site) => {
                names.get_or_insert_default().extend(around(program, site, None));
            }
            Op::Fork(_, window, n, first) => {
                for at in 0..n.0 {
                    let register = window.wrapping_add(2 + at);
                    let branch = branches.iter().rev().find(|(written, _)| *written == register);
                    let Some(inner) = branch.and_then(|(_, branch)| originals(program, *branch)) else {
                        continue;
                    };
                    let all = names.get_or_insert_default();
                    all.extend(inner);
                    all.extend(around(program, SiteId(first.0 + u32::from(at)), None));
                }
            }
            _ => {}
        }
    }
    names
}

/// The code that a level's call stands in, for people.
fn place(program: &Program, tree: &Tree, level: &Level, slot: SlotId) -> String {
    let task = Path::of(tree, tree.slot(slot).parent).show();
    let owner = &program.functions[program.sites[level.site.at()].owner.at()];
    match owner.kind {
        FnKind::Function => format!("`{}` in {task}", owner.name),
        FnKind::Inserted => format!("the code of an edit in {task}"),
        _ => task,
    }
}
