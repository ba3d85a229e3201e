//! Queries from outside of a program: a goal, and its answers one after another.

use std::path::Path;
use std::rc::Rc;

use compiler::{CompiledGoal, Report};
use vm::machine::{PlanStep, Query};
use vm::persist::{Outlined, SavedTree};
use vm::print::{LIMIT, Printer};
use vm::rules::view::TreeView;
use vm::rules::why::Explanation;
use vm::value::{Symbol, Value};

use crate::session::Session;

/// A goal that is being solved.
pub struct Question {
    goal: CompiledGoal,
    query: Query,
}

/// An answer of a query.
#[derive(Debug, Clone)]
pub struct Answer {
    /// The variables of the goal with their values, in the order of its text.
    pub values: Vec<(Symbol, Value)>,
    /// There is nothing more to try. Without this there may be another answer.
    pub is_last: bool,
}

/// Why a goal holds, or why it does not.
#[derive(Debug, Clone)]
pub struct Explained {
    /// It has an answer.
    pub holds: bool,
    /// The proof of the first answer; or what fails, of each clause, the nearest first.
    pub parts: Vec<Explanation>,
}

/// The answers of a query.
pub struct Answers<'s> {
    session: &'s mut Session,
    question: Option<Question>,
}

impl Session {
    /// The answers of a goal, found one after the other as they are asked for.
    ///
    /// The goal is one form or several, which all must hold. It sees the rules and facts of the user's
    /// module and the tree of the last run. A failure is what a rule did wrong, or a limit: the fuel is
    /// that of the runs of the session.
    ///
    /// ```
    /// let mut session = pleach::Session::new(pleach::Options::default());
    /// session.load_text("kitchen.plan", "(def-facts kitchen (on milk table) (on cup shelf) (on pot table))");
    /// let mut found = Vec::new();
    /// for answer in session.query("(on ?what table)").map_err(|_| "the goal has errors")? {
    ///     let answer = answer.map_err(|failure| vm::print::write(&failure))?;
    ///     found.push(answer.values[0].1.clone());
    /// }
    /// assert_eq!(found, [vm::Value::symbol("milk"), vm::Value::symbol("pot")]);
    /// # Ok::<(), String>(())
    /// ```
    ///
    /// # Errors
    /// What is wrong with the goal; its text is called `goal` in reports.
    pub fn query(&mut self, goal: &str) -> Result<Answers<'_>, Vec<Report>> {
        let question = self.ask("goal", goal, None)?;
        Ok(Answers { session: self, question: Some(question) })
    }

    /// The same over a tree that [`Session::read_tree`] has read.
    ///
    /// # Errors
    /// What is wrong with the goal.
    pub fn query_tree(&mut self, goal: &str, tree: Rc<TreeView>) -> Result<Answers<'_>, Vec<Report>> {
        let question = self.ask("goal", goal, Some(tree))?;
        Ok(Answers { session: self, question: Some(question) })
    }

    /// Opens a query whose answers [`Session::next_answer`] finds. `name` is what the text of the goal is
    /// called; without a tree it sees that of the last run.
    ///
    /// # Errors
    /// What is wrong with the goal.
    pub fn ask(
        &mut self,
        name: &str,
        goal: &str,
        tree: Option<Rc<TreeView>>,
    ) -> Result<Question, Vec<Report>> {
        let file = self.files.add(name, goal);
        let goal = self.front.compile_goal(&mut self.machine.program, self.module, file, goal)?;
        let query = self.machine.open_query(goal.predicate, &[], tree);
        Ok(Question { goal, query })
    }

    /// Why a question that has just been asked has an answer, or why it has none.
    ///
    /// # Errors
    /// A failure, as of the question itself.
    pub fn explain(&mut self, question: &mut Question) -> Result<Explained, Value> {
        let Question { goal, query } = question;
        let predicate = goal.predicate;
        self.with_door(&mut String::new(), |machine, door| match machine.why_of(door, query)? {
            Some(parts) => Ok(Explained { holds: true, parts }),
            None => {
                let view = query.view().clone();
                let parts = machine.why_not_in(door, predicate, &[], &view)?;
                Ok(Explained { holds: false, parts })
            }
        })
    }

    /// An explanation as text, with the places of clauses.
    #[must_use]
    pub fn explanation(&self, parts: &[Explanation]) -> String {
        vm::rules::why::text(parts, &|place| Some(self.files.show(place)).filter(|at| !at.is_empty()))
    }

    /// The order in which the goals of a question that has just been asked are solved, with how often each was
    /// expected to hold and how often it did.
    ///
    /// # Errors
    /// A failure, as of the question itself.
    pub fn plan_of(&mut self, question: &mut Question) -> Result<Vec<PlanStep>, Value> {
        let Question { goal, query } = question;
        let (predicate, view) = (goal.predicate, query.view().clone());
        self.with_door(&mut String::new(), |machine, door| machine.plan_of(door, predicate, &[], &view))
    }

    /// The next answer; nothing after the last.
    ///
    /// # Errors
    /// A failure, after which there is no answer.
    pub fn next_answer(&mut self, question: &mut Question) -> Result<Option<Answer>, Value> {
        let Question { goal, query } = question;
        // What rules call only computes: it prints nothing.
        let found =
            self.with_door(&mut String::new(), |machine, door| machine.next_answer_of(door, query))?;
        Ok(found.map(|values| {
            let values = goal.variables.iter().copied().zip(values.iter().cloned()).collect();
            Answer { values, is_last: query.is_last() }
        }))
    }

    /// Reads a file that `pleach run --json` wrote: the tree in it, for [`Session::query_tree`].
    ///
    /// # Errors
    /// A sentence that says why it is no such file, and where.
    pub fn read_tree(&self, path: &Path) -> Result<Rc<TreeView>, String> {
        let tree = self.tree_of_json(&crate::files::read_large_text(path)?);
        tree.map_err(|why| format!("{} holds no tree of `pleach run --json`: {why}", path.display()))
    }

    /// The same for the text of such a file.
    ///
    /// # Errors
    /// A sentence that says what is wrong with it, and where.
    pub fn tree_of_json(&self, text: &str) -> Result<Rc<TreeView>, String> {
        crate::import::tree(text, &self.machine.program.failures).map(Rc::new)
    }

    /// The same for a tree that a store has kept.
    ///
    /// # Errors
    /// A sentence that says which of its rows does not fit to the others.
    pub fn tree_of_saved(&self, saved: &SavedTree) -> Result<Rc<TreeView>, String> {
        let reader = crate::read::Reader::default();
        TreeView::of_saved(&self.machine.program.failures, saved, &|text| reader.value(text)).map(Rc::new)
    }

    /// The same for a tree of which the outline is known. The rest is loaded when a goal asks for it; whether that went
    /// well, [`TreeView::trouble`] says.
    #[must_use]
    pub fn tree_of_outline(
        &self,
        tasks: Vec<Outlined>,
        load: impl Fn() -> Result<SavedTree, String> + 'static,
    ) -> Rc<TreeView> {
        let failures = self.machine.program.failures.clone();
        Rc::new(TreeView::of_outline(tasks, move || {
            let reader = crate::read::Reader::default();
            TreeView::of_saved(&failures, &load()?, &|text| reader.value(text))
        }))
    }

    /// The text of a value that reads back, with the names of functions.
    #[must_use]
    pub fn write(&self, value: &Value) -> String {
        Printer::new(Some(&self.machine.program), true, LIMIT).text(value)
    }
}

impl Iterator for Answers<'_> {
    type Item = Result<Answer, Value>;

    fn next(&mut self) -> Option<Result<Answer, Value>> {
        let answer = self.session.next_answer(self.question.as_mut()?);
        if !matches!(&answer, Ok(Some(answer)) if !answer.is_last) {
            self.question = None;
        }
        answer.transpose()
    }
}
