//! A plan written out with the edits of a tree worked in, where that says the same.
//!
//! An edit is known by its slot, a text by its calls. Where a slot stands for all runs of one call in the plan's own
//! body, the text of the call can be changed: left out, put between others, moved. What holds for one round of a loop,
//! below another plan or beside some calls only is left to a variant, and the reason is said.

use std::collections::BTreeMap;
use std::rc::Rc;

use grammar::{FileId, Form, FormKind, Prefix};
use vm::code::{FnId, Program};
use vm::edit::{Edit, What};
use vm::graft::{AROUND, CALL, Change, Graft, Link};
use vm::key::Step;
use vm::print::{LIMIT, Printer, write};
use vm::tree::Tree;
use vm::value::{Obj, Symbol, Value};

use crate::Session;

/// A plan with edits worked in.
#[derive(Debug, Clone, Default)]
pub struct Inlined {
    /// Its definition, and those of plans that it needs.
    pub text: String,
    /// The edits that are not in it, each with the reason.
    pub left: Vec<(String, String)>,
    /// What is otherwise than with the edits.
    pub remarks: Vec<String>,
}

impl Session {
    /// The plan of a tree with its edits worked in, under another name.
    ///
    /// # Errors
    /// A sentence that says why the plan cannot be written out at all.
    pub fn inline(&self, tree: &Tree, name: &str) -> Result<Inlined, String> {
        let program = &self.machine.program;
        let graft = Graft::of_tree(program, tree)?;
        let of = graft.places[CALL].step.name;
        let root = tree.slot(tree.root_plan()).key.site;
        let known =
            program.sites.get(root.at()).and_then(|site| site.callee).or(tree.called(tree.root_plan()));
        let plan = known.ok_or_else(|| format!("it is not known which plan `{of}` is"))?;
        let source = Rc::new(Source::of(self, plan)?);
        let mut writer = Writer {
            program,
            graft: &graft,
            source,
            name,
            changes: BTreeMap::new(),
            moved: BTreeMap::new(),
            plans: Vec::new(),
            it: Inlined::default(),
        };
        writer.it.left =
            graft.lost.iter().map(|lost| (lost.clone(), "it stands outside of the plan".into())).collect();
        writer.work(self);
        Ok(writer.done())
    }
}

/// The text of a definition.
struct Source {
    plan: FnId,
    text: String,
    form: Form,
    /// Names that mean something else somewhere in the plan.
    locals: Vec<Symbol>,
}

impl Source {
    fn of(session: &Session, plan: FnId) -> Result<Source, String> {
        let function = &session.machine.program.functions[plan.at()];
        let missing = || format!("the text of `{}` is not there", function.name);
        let text = session.text(FileId(function.place.file)).ok_or_else(missing)?.to_string();
        let forms = grammar::parse(FileId(function.place.file), &text).forms;
        let is_it =
            |form: &Form| (form.span.start, form.span.end) == (function.place.start, function.place.end);
        let form =
            forms.into_iter().find(is_it).filter(|form| form.list().is_some_and(|items| items.len() > 2));
        let form = form.filter(|form| form.head().is_some_and(|head| head == "def-plan"));
        let form = form.ok_or_else(|| format!("`{}` is made by a macro", function.name))?;
        let mut locals: Vec<Symbol> = function.params.names.clone();
        binders(&form, &mut locals);
        Ok(Source { plan, text, form, locals })
    }

    fn text(&self, form: &Form) -> &str {
        self.text.get(form.span.start as usize..form.span.end as usize).unwrap_or_default()
    }

    /// The forms around a place, outermost first, the one at the place last.
    fn way_to(&self, start: u32, end: u32) -> Vec<&Form> {
        let mut way = vec![&self.form];
        while let Some(last) = way.last() {
            if (last.span.start, last.span.end) == (start, end) {
                break;
            }
            let inside = |form: &&Form| form.span.start <= start && end <= form.span.end;
            match parts(last).into_iter().find(inside) {
                Some(next) => way.push(next),
                None => return Vec::new(),
            }
        }
        way
    }
}

fn parts(form: &Form) -> Vec<&Form> {
    match &form.kind {
        FormKind::List(items) | FormKind::Vector(items) => items.iter().collect(),
        FormKind::Map(pairs) => pairs.iter().flat_map(|(key, value)| [key, value]).collect(),
        FormKind::Prefixed(_, inner) => vec![inner],
        _ => Vec::new(),
    }
}

/// The names that forms like `let` bind, as far as their shape tells.
fn binders(form: &Form, names: &mut Vec<Symbol>) {
    let mut todo = vec![form];
    while let Some(form) = todo.pop() {
        let head = form.head().unwrap_or_default();
        let binds = [
            "let",
            "let*",
            "dolist",
            "dotimes",
            "lambda",
            "par-loop",
            "try-each",
            "for-each-answer",
            "if-let",
            "when-let",
        ];
        if binds.contains(&head.as_str())
            && let Some(list) = form.list().and_then(|items| items.get(1))
        {
            let mut inner = vec![list];
            while let Some(form) = inner.pop() {
                names.extend(form.symbol());
                inner.extend(parts(form));
            }
        }
        if head == "with-failure-handling" || head == "with-retry-counters" {
            let inner = form.list().and_then(|items| items.get(1)).map(parts).unwrap_or_default();
            for part in inner {
                parts(part).into_iter().take(2).for_each(|it| {
                    names.extend(it.symbol());
                    names.extend(parts(it).into_iter().filter_map(Form::symbol));
                });
            }
        }
        todo.extend(parts(form));
    }
}

/// True for what may be computed again, later or not at all.
fn is_plain(form: &Form) -> bool {
    match &form.kind {
        FormKind::Prefixed(Prefix::Quote, _) => true,
        FormKind::Prefixed(..) => false,
        FormKind::List(items) => {
            form.is("nil")
                || form.head().is_some_and(|head| head == "a" || head == "an")
                    && items.iter().skip(1).all(is_property)
        }
        FormKind::Vector(items) => items.iter().all(is_plain),
        FormKind::Map(pairs) => pairs.iter().all(|(key, value)| is_plain(key) && is_plain(value)),
        _ => true,
    }
}

fn is_property(form: &Form) -> bool {
    !matches!(form.kind, FormKind::Prefixed(..)) && parts(form).into_iter().all(is_property)
}

/// How often a name stands in a form that is no quoted data.
fn mentions(value: &Value, name: &str) -> usize {
    let mut found = 0;
    let mut todo = vec![value.clone()];
    while let Some(value) = todo.pop() {
        match value.obj() {
            None => found += usize::from(value.as_symbol().is_some_and(|it| it == name)),
            Some(Obj::Pair(head, _)) if head.as_symbol().is_some_and(|head| head == "quote") => {}
            Some(Obj::Pair(head, rest)) => todo.extend([head.clone(), rest.clone()]),
            Some(Obj::Vector(items)) => todo.extend(items.iter().cloned()),
            _ => {}
        }
    }
    found
}

struct Writer<'s> {
    program: &'s Program,
    graft: &'s Graft,
    source: Rc<Source>,
    name: &'s str,
    /// What stands in the place of a range of bytes.
    changes: BTreeMap<(u32, u32), String>,
    /// Calls that have been moved, by the range that they stand behind, and whether that has the value of its body.
    moved: BTreeMap<(u32, u32), (bool, Vec<String>)>,
    /// Definitions of other plans.
    plans: Vec<String>,
    it: Inlined,
}

/// A call in the text, with what stands there now.
struct Call<'f> {
    /// The forms around it, and itself.
    way: Vec<&'f Form>,
    head: String,
    args: Vec<String>,
    /// Variables around the call for its arguments.
    bound: Option<Vec<(Symbol, String)>>,
    text: Option<String>,
    befores: Vec<String>,
    afters: Vec<String>,
}

impl Writer<'_> {
    fn work(&mut self, session: &Session) {
        let mut at: BTreeMap<usize, Vec<&Change>> = BTreeMap::new();
        for change in &self.graft.edits {
            match self.place_of(change.place) {
                Ok(_) => at.entry(change.place).or_default().push(change),
                Err(why) => self.leave(change, why),
            }
        }
        for (place, changes) in at {
            // All of a call or nothing: they have an order among each other.
            if let Err(why) = self.call(session, place, &changes) {
                changes.iter().for_each(|change| self.leave(change, why.clone()));
            }
        }
    }

    fn leave(&mut self, change: &Change, why: String) {
        let edit = Value::new(Obj::Edit(Box::new((*change.edit).clone())));
        self.it.left.push((write(&edit), why));
    }

    /// The range of the call that a place stands for in all its runs.
    fn place_of(&self, at: usize) -> Result<(u32, u32), String> {
        let place = &self.graft.places[at];
        if at == AROUND || at == CALL {
            return Err("it stands at the call of the plan itself".into());
        }
        let no = |why: &str| Err(why.to_string());
        for link in &place.way {
            match link {
                Link::Same(Step::Round(..) | Step::Number(_)) => {
                    return no("it holds for one round of a loop");
                }
                Link::Same(Step::Again(_)) => return no("it holds for one of several calls of one site"),
                Link::Edit(_) => return no("it stands in the code of another edit"),
                Link::Through(words, _) => {
                    return Err(format!("the call stands in the function `{}`", words.name));
                }
                Link::Same(_) => {}
            }
        }
        if place.above != CALL {
            let above = self.graft.places[place.above].step.name;
            return Err(format!("it stands below `{above}`, of which it would need a copy"));
        }
        let site = place.known.map(|site| &self.program.sites[site.at()]);
        let site = site
            .filter(|site| site.owner == self.source.plan)
            .ok_or("the call is not in the plan's own body")?;
        if site.counted {
            return no("the call may be reached several times");
        }
        let place = self.program.places[site.pc.at()];
        if place.file != self.source.form.span.file.0 {
            return no("the call is made by a macro");
        }
        Ok((place.start, place.end))
    }

    fn call(&mut self, session: &Session, at: usize, changes: &[&Change]) -> Result<(), String> {
        let (start, end) = self.place_of(at)?;
        let place = &self.graft.places[at];
        let site = place.known.map(|site| &self.program.sites[site.at()]).ok_or("the call is not known")?;
        let source = self.source.clone();
        let way = source.way_to(start, end);
        let form = *way.last().ok_or("the call is made by a macro")?;
        let items = form.list().ok_or("the call is made by a macro")?;
        let head = form.head().unwrap_or_default();
        let performs = head == "perform";
        if !performs && (head != site.name || site.callee.is_none()) {
            return Err("the call is made by a macro, or of what is computed".into());
        }
        if self.changes.keys().any(|(from, to)| *from < end && start < *to) {
            return Err("it stands within another call with edits".into());
        }
        let mut call = Call {
            head: head.to_string(),
            args: items[1..].iter().map(|it| source.text(it).to_string()).collect(),
            way: way.clone(),
            bound: None,
            text: None,
            befores: Vec::new(),
            afters: Vec::new(),
        };
        let (mut skipped, mut deferred) = (None, None);
        for change in changes {
            let edit = &change.edit;
            if !edit.guard.is_empty() {
                return Err("it holds for some calls only: it has a guard".into());
            }
            if refers(edit) {
                return Err("it refers to a task of a tree".into());
            }
            match &edit.what {
                What::WithParam(key, value) => self.with_param(&mut call, items, site.callee, *key, value)?,
                What::Skip(value) => skipped = Some(self.value(value.as_ref().unwrap_or(&Value::NIL))?),
                What::Before(_) | What::After(_) | What::Wrap(_) | What::Replace(_) => {}
                What::Defer(_) => deferred = Some(*change),
                What::Owe { .. } => return Err("what is owed is owed once, however many owe it".into()),
            }
        }
        let computed: Vec<&Form> = items[1..].iter().filter(|it| !is_plain(it)).collect();
        if let Some(value) = skipped {
            let mut parts: Vec<String> = computed.iter().map(|it| source.text(it).to_string()).collect();
            parts.push(value);
            let text = match parts.len() {
                1 if call.stands(is_statement) => String::new(),
                1 => parts.remove(0),
                _ => format!("(seq {})", parts.join(" ")),
            };
            self.changes.insert((start, end), text);
            return Ok(());
        }
        self.codes(session, &mut call, items, site.callee, changes, !computed.is_empty())?;
        let text = call.written();
        match deferred {
            None => drop(self.changes.insert((start, end), text)),
            Some(change) => {
                if !computed.is_empty() {
                    return Err("what the call is given is computed, and would be computed later".into());
                }
                let to = self.later(&call.way, change)?;
                self.changes.insert((start, end), String::new());
                let (last, is_value) = to;
                self.moved.entry(last).or_insert((is_value, Vec::new())).1.push(text);
                self.it.remarks.push(format!(
                    "{} is called later: not any more if what it is put after fails",
                    self.graft.path(at).show()
                ));
            }
        }
        Ok(())
    }

    /// Another argument, or another property of the description.
    fn with_param(
        &self,
        call: &mut Call<'_>,
        items: &[Form],
        callee: Option<FnId>,
        key: Symbol,
        value: &Value,
    ) -> Result<(), String> {
        let Some(callee) = callee else {
            let desc = items.get(1).filter(|it| it.head().is_some_and(|head| head == "a" || head == "an"));
            let desc = desc.ok_or("the description is computed")?;
            let text = Value::desc(vm::desc::Desc::new(Symbol::from("x"), vec![(key, value.clone())]));
            let text = write(&text);
            let property = text.strip_prefix("(a x ").and_then(|it| it.strip_suffix(')')).unwrap_or_default();
            if text.contains("#<") {
                return Err("its value has no text".into());
            }
            let start = desc.span.start as usize;
            let written = &mut call.args[0];
            if written != self.source.text(desc) {
                return Err("several properties change".into());
            }
            let known = parts(desc).into_iter().find(|it| it.head().is_some_and(|head| head == key));
            match known {
                Some(known) if !is_property(known) => {
                    return Err("the property that it changes is computed, perhaps with an effect".into());
                }
                Some(known) => {
                    let range = known.span.start as usize - start..known.span.end as usize - start;
                    written.replace_range(range, property);
                }
                None => written.insert_str(written.len() - 1, &format!(" {property}")),
            }
            return Ok(());
        };
        let params = &self.program.functions[callee.at()].params;
        let value = self.value(value)?;
        let at = params.names.iter().position(|name| *name == key).ok_or("the plan has no such parameter")?;
        let by_place = params.required as usize + params.optional as usize;
        let at = match at {
            at if at < by_place => at,
            at if at < by_place + params.keys as usize => {
                let is_key = |it: &Form| matches!(&it.kind, FormKind::Keyword(name) if *name == key);
                match items[1..].iter().position(is_key) {
                    Some(at) => at + 1,
                    None => {
                        call.args.push(format!(":{key} {value}"));
                        return Ok(());
                    }
                }
            }
            _ => return Err("it changes the rest of the arguments".into()),
        };
        let by_key = |it: &Form| matches!(it.kind, FormKind::Keyword(_));
        if at < by_place && items.iter().take(at + 2).any(by_key) {
            return Err("the argument that it changes is not given".into());
        }
        match items.get(at + 1) {
            Some(arg) if !is_plain(arg) => {
                Err("the argument that it changes is computed, perhaps with an effect".into())
            }
            Some(_) => {
                call.args[at] = value;
                Ok(())
            }
            None if at == call.args.len() && !params.rest && params.keys == 0 => {
                call.args.push(value);
                Ok(())
            }
            None => Err("the argument that it changes is not given".into()),
        }
    }

    /// The code of edits around and beside the call.
    fn codes(
        &mut self,
        session: &Session,
        call: &mut Call<'_>,
        items: &[Form],
        callee: Option<FnId>,
        changes: &[&Change],
        computed: bool,
    ) -> Result<(), String> {
        let wanted = |it: &&&Change| {
            matches!(it.edit.what, What::Before(_) | What::After(_) | What::Wrap(_) | What::Replace(_))
        };
        let codes: Vec<&Edit> = changes.iter().filter(wanted).map(|it| &*it.edit).collect();
        if codes.is_empty() {
            return Ok(());
        }
        let names: Vec<Symbol> = match callee {
            Some(callee) => self.program.functions[callee.at()].params.names.clone(),
            None => vec![Symbol::from("description")],
        };
        let inside = |edit: &&&Edit| !matches!(edit.what, What::Replace(_));
        let uses = codes
            .iter()
            .filter(inside)
            .any(|edit| code(edit).is_some_and(|code| names.iter().any(|name| mentions(code, name) > 0)));
        for edit in codes.iter().filter(inside) {
            let hidden = self.source.locals.iter().find(|name| {
                !names.contains(name) && code(edit).is_some_and(|code| mentions(code, name) > 0)
            });
            if let Some(name) = hidden {
                return Err(format!("its code says `{name}`, which means something else in the plan"));
            }
        }
        if uses || (computed && codes.iter().any(|edit| matches!(edit.what, What::Before(_) | What::Wrap(_))))
        {
            let params = callee.map(|callee| &self.program.functions[callee.at()].params);
            let simple = params.is_none_or(|it| it.required as usize == it.names.len())
                && !names.iter().any(|name| vm::code::is_pattern(name))
                && items.len() == names.len() + 1;
            if !simple {
                return Err("its code uses parameters that are not given one by one".into());
            }
            call.bound = Some(names.iter().copied().zip(std::mem::take(&mut call.args)).collect());
            call.args = names.iter().map(ToString::to_string).collect();
        }
        for edit in &codes {
            if let What::Replace(code) = &edit.what {
                let callee = callee.ok_or("it stands instead of what an action is grounded to")?;
                call.head = self.replaced(session, callee, &call.head, code)?;
            }
        }
        for edit in &codes {
            if let What::Wrap(code) = &edit.what {
                let text = write(code);
                let inner = call.text.clone().unwrap_or_else(|| call.plain());
                match text.matches("(original)").count() {
                    0 | 1 => call.text = Some(text.replace("(original)", &inner)),
                    _ => return Err("it calls the original several times".into()),
                }
            }
        }
        for edit in codes {
            match &edit.what {
                What::Before(code) => call.befores.push(write(code)),
                What::After(code) => call.afters.push(write(code)),
                _ => {}
            }
        }
        Ok(())
    }

    /// The name of a copy of a plan with another body.
    fn replaced(
        &mut self,
        session: &Session,
        callee: FnId,
        head: &str,
        code: &Value,
    ) -> Result<String, String> {
        let name = format!("{}/{head}", self.name);
        let text = write(code);
        if self.plans.iter().any(|plan| plan.starts_with(&format!("(def-plan {name} "))) {
            return Err("another call of the plan has another body already".into());
        }
        let source = Source::of(session, callee)?;
        let params = &self.program.functions[callee.at()].params.names;
        let free = source.locals.iter().filter(|name| !params.contains(name));
        if text.contains("(original)") && free.into_iter().any(|name| mentions(code, name) > 0) {
            return Err("its code and the body that it replaces use the same names".into());
        }
        let items = source.form.list().unwrap_or_default();
        let body = items.get(3..).unwrap_or_default();
        let is_doc = |it: &Form| matches!(it.kind, FormKind::Str(_));
        let body = if body.len() > 1 && body.first().is_some_and(is_doc) { &body[1..] } else { body };
        let body: Vec<&str> = body.iter().map(|it| source.text(it)).collect();
        let original = format!("(seq {})", body.join(" "));
        let params = items.get(2).map_or("()", |it| source.text(it));
        let text = text.replace("(original)", &original);
        self.plans.push(format!("(def-plan {name} {params}\n{text})"));
        self.it.remarks.push(format!("`{head}` is called `{name}` there, with another body"));
        Ok(name)
    }

    /// Where a call stands that is put off: behind the form in which the last of the others stands. True if that form
    /// has the value of the body.
    fn later(&self, way: &[&Form], change: &Change) -> Result<((u32, u32), bool), String> {
        let [.., body, call] = way else { return Err("the call is made by a macro".into()) };
        let straight = "the calls do not stand one after the other in one body";
        let element =
            |at: u32| parts(body).into_iter().position(|it| it.span.start <= at && at < it.span.end);
        let mine = element(call.span.start).ok_or(straight)?;
        if !is_statement(body, mine) {
            return Err(straight.into());
        }
        if self.source.text(&self.source.form).contains("(set! ") {
            return Err("a variable of the plan changes".into());
        }
        let mut last = None;
        for place in &change.after {
            let up = std::iter::successors(Some(*place), |at| Some(self.graft.places[*at].above));
            let top = up.take_while(|at| *at > CALL).last().ok_or(straight)?;
            let place = &self.graft.places[top];
            if place.way.iter().any(|link| matches!(link, Link::Edit(_))) {
                return Err("it waits for the code of an edit".into());
            }
            let site = place.known.map(|site| &self.program.sites[site.at()]);
            let site = site.filter(|site| site.owner == self.source.plan).ok_or(straight)?;
            let theirs = element(self.program.places[site.pc.at()].start).ok_or(straight)?;
            if theirs <= mine {
                return Err("what it waits for stands before it".into());
            }
            last = last.max(Some(theirs));
        }
        let last = last.and_then(|at| parts(body).get(at).copied()).ok_or(straight)?;
        let is_value = parts(body).last().is_some_and(|it| it.span == last.span);
        Ok(((last.span.start, last.span.end), is_value))
    }

    /// The text of an expression for a value.
    fn value(&self, value: &Value) -> Result<String, String> {
        let text = Printer::new(Some(self.program), true, LIMIT).expression(value);
        if text.contains("#<") { Err("its value has no text".into()) } else { Ok(text) }
    }

    fn done(mut self) -> Inlined {
        let source = self.source.clone();
        let items = source.form.list().unwrap_or_default();
        if let Some(name) = items.get(1) {
            self.changes.insert((name.span.start, name.span.end), self.name.into());
        }
        for ((start, end), (is_value, calls)) in std::mem::take(&mut self.moved) {
            let calls = calls.join("\n");
            if is_value {
                self.changes.insert((start, start), "(let ((value-of-all ".into());
                self.changes.insert((end, end), format!("))\n{calls}\nvalue-of-all)"));
            } else {
                self.changes.insert((end, end), format!("\n{calls}"));
            }
        }
        let mut text = String::new();
        let mut at = source.form.span.start;
        for ((start, end), new) in &self.changes {
            text += source.text.get(at as usize..*start as usize).unwrap_or_default();
            text += new;
            at = *end;
        }
        text += source.text.get(at as usize..source.form.span.end as usize).unwrap_or_default();
        self.plans.push(text);
        let text = self.plans.join("\n\n");
        self.it.text = grammar::format(&text).unwrap_or(text);
        self.it
    }
}

/// The code of an edit.
fn code(edit: &Edit) -> Option<&Value> {
    match &edit.what {
        What::Before(code) | What::After(code) | What::Wrap(code) | What::Replace(code) => Some(code),
        _ => None,
    }
}

/// True if a path stands in what an edit says.
fn refers(edit: &Edit) -> bool {
    let value = match &edit.what {
        What::WithParam(_, value) | What::Skip(Some(value)) => Some(value),
        _ => code(edit),
    };
    value.is_some_and(|value| write(value).contains("(path "))
}

/// True for an element of a body whose value nobody uses.
fn is_statement(body: &Form, at: usize) -> bool {
    is_element(body, at) && at + 1 < parts(body).len()
}

/// True for an element of a body.
fn is_element(body: &Form, at: usize) -> bool {
    let head = body.head().unwrap_or_default();
    let first = match head.as_str() {
        "seq" | "progn" | "loop" => 1,
        "let" | "let*" | "when" | "unless" | "while" | "with-failure-handling" | "with-retry-counters" => 2,
        "def-plan" => 3,
        _ => return false,
    };
    at >= first
}

impl Call<'_> {
    fn plain(&self) -> String {
        let parts: Vec<&str> = std::iter::once(&self.head).chain(&self.args).map(String::as_str).collect();
        format!("({})", parts.join(" "))
    }

    /// True if the call is such an element of the body around it.
    fn stands(&self, how: fn(&Form, usize) -> bool) -> bool {
        let [.., body, call] = self.way.as_slice() else { return false };
        let at = parts(body).into_iter().position(|it| it.span == call.span);
        at.is_some_and(|at| how(body, at))
    }

    /// The call with what is put beside it.
    fn written(&self) -> String {
        let mut forms = self.befores.clone();
        let text = self.text.clone().unwrap_or_else(|| self.plain());
        let afters = self.afters.join("\n");
        if self.afters.is_empty() || self.stands(is_statement) {
            forms.push(text);
            forms.extend(self.afters.iter().cloned());
        } else {
            forms.push(format!("(let ((value-of-call {text}))\n{afters}\nvalue-of-call)"));
        }
        let several = forms.len() > 1;
        let text = forms.join("\n");
        match &self.bound {
            Some(bound) => {
                let bound: Vec<String> =
                    bound.iter().map(|(name, text)| format!("({name} {text})")).collect();
                format!("(let ({})\n{text})", bound.join(" "))
            }
            None if several && !self.stands(is_element) => format!("(seq {text})"),
            None => text,
        }
    }
}
