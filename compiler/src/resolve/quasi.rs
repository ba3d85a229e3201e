//! Quasi-quote: templates of data with holes.

use grammar::{Form, FormKind, Prefix};
use vm::value::Value;

use super::Scope;
use crate::Compiler;
use crate::ast::{Expr, ExprKind};
use crate::error::CompileError;

impl Compiler<'_> {
    /// The expression that makes the data of a template. `level` counts quasi-quotes around it.
    pub(super) fn quasi(&mut self, scope: &mut Scope, form: &Form, level: u32) -> Expr {
        if !has_hole(form) {
            return self.constant(form);
        }
        let span = form.span;
        match &form.kind {
            FormKind::Prefixed(Prefix::Unquote, inner) if level == 1 => self.expr(scope, inner),
            FormKind::Prefixed(prefix @ Prefix::Splice, _) if level == 1 => {
                let (form, inside) = (prefix.sign().into(), "a list or vector of a quasi-quote".into());
                let help = Some("`,@` puts the elements of a list into the list around it".into());
                self.error(CompileError::Outside { form, inside, at: span, help });
                Expr::nil(span)
            }
            FormKind::Prefixed(prefix, inner) => {
                let level = match prefix {
                    Prefix::Quasi => level + 1,
                    Prefix::Unquote | Prefix::Splice => level.saturating_sub(1).max(1),
                    Prefix::Quote => level,
                };
                let head = Expr::new(ExprKind::Const(Value::symbol(prefix.name())), span);
                let inner = self.quasi(scope, inner, level);
                self.native_call("list", vec![Some(head), Some(inner)], span)
            }
            FormKind::List(items) => self.quasi_items(scope, form, items, level),
            FormKind::Vector(items) => {
                let list = self.quasi_items(scope, form, items, level);
                self.native_call("list->vec", vec![Some(list)], span)
            }
            FormKind::Map(pairs) => {
                let parts = pairs.iter().flat_map(|(key, value)| [key, value]);
                let parts = parts.map(|part| self.quasi(scope, part, level)).collect();
                Expr::new(ExprKind::Map(parts), span)
            }
            _ => self.constant(form),
        }
    }

    /// A list of templates: cells from the end, spliced lists appended.
    fn quasi_items(&mut self, scope: &mut Scope, form: &Form, items: &[Form], level: u32) -> Expr {
        // Parts are resolved in the order of the text, so that what they do happens in it.
        let mut parts: Vec<(bool, Expr)> = Vec::new();
        for item in items {
            match &item.kind {
                FormKind::Prefixed(Prefix::Splice, inner) if level == 1 => {
                    parts.push((true, self.expr(scope, inner)))
                }
                _ => parts.push((false, self.quasi(scope, item, level))),
            }
        }
        if parts.iter().all(|(spliced, _)| !spliced) {
            let parts = parts.into_iter().map(|(_, part)| Some(part)).collect();
            return self.list_of(parts, form.span);
        }
        let mut lists: Vec<Option<Expr>> = Vec::new();
        let mut run: Vec<Option<Expr>> = Vec::new();
        for (spliced, part) in parts {
            if spliced {
                if !run.is_empty() {
                    let list = self.list_of(std::mem::take(&mut run), form.span);
                    lists.push(Some(list));
                }
                lists.push(Some(part));
            } else {
                run.push(Some(part));
            }
        }
        if !run.is_empty() {
            let list = self.list_of(run, form.span);
            lists.push(Some(list));
        }
        self.native_call("append", lists, form.span)
    }
}

/// True if something in the template is evaluated.
fn has_hole(form: &Form) -> bool {
    match &form.kind {
        FormKind::Prefixed(Prefix::Unquote | Prefix::Splice, _) => true,
        FormKind::Prefixed(_, inner) => has_hole(inner),
        FormKind::List(items) | FormKind::Vector(items) => items.iter().any(has_hole),
        FormKind::Map(pairs) => pairs.iter().any(|(key, value)| has_hole(key) || has_hole(value)),
        _ => false,
    }
}
