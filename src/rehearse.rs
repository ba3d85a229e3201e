//! Rehearsals: a plan is run in projection, transformed, and rehearsed again, until no transformation applies.
//!
//! All of that is said in the language (`stdlib/plans/transformation.plan`). Here it is called for a plan of a session, and
//! what it gives becomes rows of a tree, with which another run goes on, and a report.

use std::path::{Path, PathBuf};
use std::rc::Rc;

use compiler::Report;
use serde_json::{Map as JsonMap, Value as Json, json};
use vm::code::{FnId, SiteId};
use vm::graft::Graft;
use vm::machine::Progress;
use vm::persist::SavedTree;
use vm::tree::Tree;
use vm::value::{Imm, Obj, Symbol, Value};

use crate::inline::Inlined;
use crate::session::{Ended, Output, Session};

/// What rehearses a plan of another module.
const STAGE: &str = "\
(module rehearsal)
(use transformation)
(def-fun %rehearse (plan args accept seeds seed only tree)
  (if plan
      (rehearse plan :args args :accept accept :seeds seeds :seed seed :only only :tree tree)
      (transform-tree tree :only only)))
(def-fun %transformations () (transformations))";

/// How a plan is to be rehearsed.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Wishes {
    /// `static`, `projected` or `paired`.
    pub accept: String,
    /// How many seeds.
    pub seeds: u32,
    /// The first of them.
    pub seed: u64,
    /// The transformations that take part; all if there is none.
    pub only: Vec<String>,
    /// Files with more transformations.
    pub rules: Vec<PathBuf>,
}

/// What came of a rehearsal.
#[derive(Debug)]
pub struct Rehearsal {
    /// The tree with the edits that were kept, as rows.
    pub tree: SavedTree,
    /// The same as a list of nodes.
    pub nodes: Json,
    /// What was proposed, and what became of it: `steps`, `before`, `after`, `seeds`, `why`.
    pub report: Json,
    /// The edits as the text of a variant of the plan, or why they cannot be written down.
    pub variant: Result<String, String>,
    /// The plan written out with the edits worked in, or why that cannot be done.
    pub inlined: Result<Inlined, String>,
}

/// Why there is no rehearsal.
#[derive(Debug)]
pub enum NoRehearsal {
    /// The program, or a file of rules, has errors or could not be loaded.
    NotLoaded(Ended),
    /// A failure left the rehearsal.
    Failed(Value),
    /// It was stopped from outside.
    Stopped,
    /// A sentence.
    Because(String),
}

impl From<String> for NoRehearsal {
    fn from(why: String) -> NoRehearsal {
        NoRehearsal::Because(why)
    }
}

impl Session {
    /// Rehearses a plan of the user's module, with arguments that are forms. What the file prints when it is loaded, and
    /// what the rehearsals would print, is left out.
    ///
    /// # Errors
    /// Why there is nothing to go on with.
    pub fn rehearse(
        &mut self,
        loaded: compiler::Loaded,
        plan: &str,
        args: &[String],
        wishes: &Wishes,
        base: Option<&SavedTree>,
        output: &mut dyn Output,
    ) -> Result<Rehearsal, NoRehearsal> {
        let rehearse = self.on_stage(loaded, wishes, "%rehearse", output)?;
        let function = self.plan(plan).ok_or_else(|| format!("the program has no plan called `{plan}`"))?;
        let args = self.arguments(args, output)?;
        let number = |n: u64| Value::int(i64::try_from(n % (1 << 53)).unwrap_or(0));
        let only = wishes.only.iter().map(|name| Value::symbol(name));
        let given = vec![
            Value::Imm(Imm::Function(function)),
            args,
            Value::symbol(&wishes.accept),
            number(wishes.seeds.into()),
            number(wishes.seed),
            Value::list(only.collect::<Vec<_>>()),
            base.map_or(Ok(Value::NIL), |base| self.restored(base))?,
        ];
        let value = self.called(rehearse, given, output)?;
        let tree = value.as_map().and_then(|map| map.get(&Value::keyword("tree"))).and_then(Value::as_tree);
        let tree = tree.ok_or_else(|| String::from("the rehearsal gave no tree"))?;
        let program = &self.machine.program;
        let better = format!("{plan}/better");
        Ok(Rehearsal {
            variant: self.variant(tree, &better),
            inlined: self.inline(tree, &better),
            tree: vm::persist::tree(program, tree),
            nodes: vm::show::json(program, tree),
            report: self.as_json(&value),
        })
    }

    /// The edits of a tree as the text of a variant of its plan.
    fn variant(&self, tree: &Tree, name: &str) -> Result<String, String> {
        let graft = Graft::of_tree(&self.machine.program, tree)?;
        let reader = crate::read::Reader::default();
        let text =
            graft.text(&self.machine.program, Symbol::from(name), &graft.doc(), &|text| reader.value(text));
        Ok(grammar::format(&text).unwrap_or(text))
    }

    /// The transformations in the order in which they are tried: what the function `transformations` gives.
    ///
    /// # Errors
    /// Why they cannot be listed.
    pub fn transformations(
        &mut self,
        loaded: compiler::Loaded,
        wishes: &Wishes,
        output: &mut dyn Output,
    ) -> Result<Json, NoRehearsal> {
        let list = self.on_stage(loaded, wishes, "%transformations", output)?;
        let value = self.called(list, Vec::new(), output)?;
        Ok(if value.is_nil() { json!([]) } else { self.as_json(&value) })
    }

    /// Loads the program, more rules, and what rehearses; a function of the latter.
    fn on_stage(
        &mut self,
        loaded: compiler::Loaded,
        wishes: &Wishes,
        name: &str,
        output: &mut dyn Output,
    ) -> Result<FnId, NoRehearsal> {
        self.load_quietly(loaded, output)?;
        for file in &wishes.rules {
            self.load_rules(file, output)?;
        }
        let module = self.module;
        let stage = self.load_text("library/rehearsal.plan", STAGE);
        self.load_quietly(stage, output)?;
        let function = self.plan(name).ok_or_else(|| String::from("the library cannot be loaded"))?;
        self.module = module;
        Ok(function)
    }

    fn called(
        &mut self,
        function: FnId,
        args: Vec<Value>,
        output: &mut dyn Output,
    ) -> Result<Value, NoRehearsal> {
        match self.call_until(function, args, output) {
            Progress::Ended(Ok(value)) => Ok(value),
            Progress::Ended(Err(failure)) => Err(NoRehearsal::Failed(failure)),
            Progress::Stopped => Err(NoRehearsal::Stopped),
        }
    }

    /// A saved tree as one of this program.
    pub(crate) fn restored(&mut self, saved: &SavedTree) -> Result<Value, NoRehearsal> {
        let reader = crate::read::Reader::default();
        let (tree, _) = self.with_door(&mut String::new(), |machine, host| {
            machine.restore(host, saved, Some(SiteId(0)), &|text| reader.value(text))
        })?;
        Ok(Value::new(Obj::Tree(Rc::new(tree))))
    }

    pub(crate) fn load_quietly(
        &mut self,
        loaded: compiler::Loaded,
        output: &mut dyn Output,
    ) -> Result<(), NoRehearsal> {
        if !loaded.reports.iter().all(Report::is_warning) {
            return Err(NoRehearsal::NotLoaded(Ended::Errors(loaded.reports)));
        }
        match self.load_forms(loaded, &mut Quiet(output)) {
            Ended::Ran(Ok(_)) => Ok(()),
            Ended::Stopped => Err(NoRehearsal::Stopped),
            ended => Err(NoRehearsal::NotLoaded(ended)),
        }
    }

    /// Loads a file, or a module of the library, whose definitions take part, and which nobody has to name.
    ///
    /// # Errors
    /// It cannot be read, has errors, or one of its forms failed.
    pub fn load_rules(&mut self, path: &Path, output: &mut dyn Output) -> Result<(), NoRehearsal> {
        let module = self.module;
        let loaded = match path.to_str().filter(|name| is_library(name) && !path.exists()) {
            Some(name) => self.load_text("library/rules.plan", &format!("(use {name})")),
            None => self.load_file(path)?,
        };
        self.module = module;
        self.load_quietly(loaded, output)
    }

    /// The values of forms, as a list.
    pub(crate) fn arguments(
        &mut self,
        args: &[String],
        output: &mut dyn Output,
    ) -> Result<Value, NoRehearsal> {
        if args.is_empty() {
            return Ok(Value::NIL);
        }
        let loaded = self.extend(crate::session::CALL, &format!("(list {}\n)", args.join("\n")));
        if !loaded.reports.iter().all(Report::is_warning) {
            return Err(NoRehearsal::NotLoaded(Ended::Errors(loaded.reports)));
        }
        match self.load_forms(loaded, &mut Quiet(output)) {
            Ended::Ran(Ok(value)) => Ok(value),
            ended => Err(NoRehearsal::NotLoaded(ended)),
        }
    }

    /// Lists, maps and numbers as such, trees left out, all else as text.
    pub(crate) fn as_json(&self, value: &Value) -> Json {
        let text = |value: &Value| {
            Json::String(
                vm::print::Printer::new(Some(&self.machine.program), true, vm::print::LIMIT).text(value),
            )
        };
        if let Some(map) = value.as_map() {
            let entry = |(key, value): (&Value, &Value)| {
                let name = match key {
                    Value::Imm(Imm::Keyword(name) | Imm::Symbol(name)) => name.to_string(),
                    other => vm::print::write(other),
                };
                (name, self.as_json(value))
            };
            let is_tree = |value: &Value| matches!(value.obj(), Some(Obj::Tree(_)));
            let entries: JsonMap<String, Json> =
                map.iter().filter(|(_, value)| !is_tree(value)).map(entry).collect();
            return Json::Object(entries);
        }
        match value {
            Value::Imm(Imm::Nil) => Json::Null,
            Value::Imm(Imm::Symbol(name)) => json!(name.as_str()),
            Value::Imm(Imm::Int(n)) => json!(n),
            Value::Imm(Imm::Float(x)) => json!(x),
            Value::Imm(Imm::Bool(it)) => json!(it),
            other => match (other.as_str(), other.to_vec(), other.as_path()) {
                (Some(text), _, _) => json!(text),
                (_, Some(items), _) => items.iter().map(|item| self.as_json(item)).collect(),
                (_, _, Some(path)) => json!(path.show()),
                _ => text(other),
            },
        }
    }

    /// True if some transformation is loaded.
    #[must_use]
    pub fn has_transformations(&self) -> bool {
        let ending = "-transformation";
        let named = |name: Symbol| name.starts_with('%') && name.ends_with(ending);
        self.machine.program.functions.iter().any(|it| named(it.name))
    }
}

/// Output whose text nobody wants.
struct Quiet<'a>(&'a mut dyn Output);

impl Output for Quiet<'_> {
    fn print(&mut self, _text: &str) {}
    fn complain(&mut self, line: &str) {
        self.0.complain(line);
    }
    fn goes_on(&mut self) -> bool {
        self.0.goes_on()
    }
}

/// True of the name of a module of the library that has to be used to be there.
#[must_use]
pub fn is_library(name: &str) -> bool {
    stdlib::PLANS.iter().any(|(module, _)| *module == name)
}
