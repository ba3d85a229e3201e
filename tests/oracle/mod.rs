//! The oracle: a second implementation of the language, slow and meant to be obviously right.
//!
//! It walks the AST by recursion and says the same as SEMANTICS in other words than the machine:
//! no instructions, no registers, no map of forms, no interned keys. It shares with the machine
//! what is not semantics: values, natives, types of failures, the text of values. A program must
//! give the same tree and print the same on both.
//!
//! Read [`eval`] first, then [`call`] (calls and their edits), [`tasks`] (turns, rounds, the clock),
//! [`branches`] (parallel forms), [`fluents`], [`forms`] (where something stands), [`tree`], [`edits`],
//! [`obligations`] (`defer` and `owe`); [`calls`] gives calls the numbers that draws are keyed by.
//! [`text`] writes both trees in one way; [`random`] makes programs, `concurrency` concurrent ones;
//! [`shrink`] makes a program smaller that tells the two apart.

pub mod both;
mod branches;
mod call;
mod calls;
mod edits;
mod eval;
mod fluents;
mod forms;
mod obligations;
pub mod random;
pub mod seeds;
pub mod shrink;
mod tasks;
pub mod text;
mod tree;

use std::collections::BTreeMap;
use std::rc::Rc;

use compiler::ast::Function;
use vm::code::{FnId, Program};
use vm::host::CodeRequest;
use vm::value::Value;

use eval::Walker;
pub use tree::Tree;

/// The program that an oracle runs.
pub trait World {
    /// Its natives, its types of failures, the names of its functions.
    fn program(&self) -> &Program;
    /// The code of an edit.
    ///
    /// # Errors
    /// What is wrong with it, as text.
    fn compile(&mut self, code: &CodeRequest<'_>) -> Result<(FnId, Rc<Function>), String>;
}

/// What a run came to.
pub struct Ran {
    /// The value of the last function, or the failure that ended the run.
    pub outcome: Result<Value, Value>,
    pub tree: Tree,
    /// What it printed.
    pub output: String,
    /// Trees that the run made as values.
    pub trees: Trees,
}

/// The oracle's tree for each tree that is a value.
pub type Trees = Vec<(Rc<vm::tree::Tree>, Rc<Tree>)>;

/// How much fuel a program may use, and how many steps a key may have, before the oracle gives up.
const MOST_FUEL: u64 = 50_000;
const MOST_STEPS: usize = 1000;
/// Enough for that.
const STACK_BYTES: usize = 1 << 30;

/// Runs functions without arguments one after another in one tree, until one fails: those that
/// compute the constants of the library, then those of the program.
///
/// # Errors
/// What the oracle does not do: answers from outside, runs that meet a limit, forms with very many branches.
pub fn run(
    world: &mut dyn World,
    functions: &BTreeMap<FnId, Rc<Function>>,
    library: &[FnId],
    start: &[FnId],
    seed: u64,
) -> Result<Ran, String> {
    Walker::new(world, functions, seed).run(library, start)
}

/// Does `work` in a thread whose stack is large enough for [`run`].
pub fn with_large_stack<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    std::thread::scope(|scope| {
        let thread = std::thread::Builder::new().stack_size(STACK_BYTES).spawn_scoped(scope, work);
        thread.expect("a thread can be started").join().expect("the work does not panic")
    })
}
