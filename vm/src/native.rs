//! Natives: functions of the language that are written in Rust.
//!
//! A native never blocks and never calls back: it returns what should happen [`Next`]. So the
//! machine can stop between any two instructions, and no Rust stack has to be saved.
//!
//! Each native declares its [`Effect`] when it is written. A run without a grant for an effect
//! refuses the call, so a stranger's plan can only compute.

use crate::failure::{Builtin, Failure};
use crate::machine::Ctx;
use crate::value::{Imm, Obj, Value};

/// A native's failure, on its way to the handlers.
pub type Raise = Box<Failure>;

/// What a native computes with its context and arguments.
pub type NativeFn = fn(&mut Ctx<'_>, &[Value]) -> Result<Next, Raise>;

/// What a native does to the world outside of its arguments.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Effect {
    /// Nothing: the result depends on the arguments alone. Printing to the run's own output and
    /// keyed random draws count as pure: they need no grant and repeat exactly.
    Pure,
    /// Looks at the projected world. Rules may do that: a query sees it as it was when it was opened.
    Look,
    /// Changes the projected world, or begins one.
    World,
    /// Asks a robot to move.
    Motion,
    /// Reads a file.
    Read,
    /// Writes a file.
    Write,
    /// Speaks over a network.
    Network,
    /// Starts a process.
    Process,
    /// Reads the clock on the wall.
    Clock,
}

impl Effect {
    /// The word for it in `--allow` and in messages.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Effect::Pure => "pure",
            Effect::Look => "look",
            Effect::World => "world",
            Effect::Motion => "motion",
            Effect::Read => "read",
            Effect::Write => "write",
            Effect::Network => "network",
            Effect::Process => "process",
            Effect::Clock => "clock",
        }
    }
}

/// What should happen after a native.
pub enum Next {
    /// The call has this value.
    Return(Value),
    /// The call has the value that this call will have.
    Call {
        /// A function.
        callee: Value,
        /// Its arguments.
        args: Vec<Value>,
    },
    /// Wait so many nanoseconds of the task clock; the value is nil.
    Sleep(u64),
    /// Something with fluents and tasks.
    Task(crate::machine::TaskOp),
    /// Ask the outside, between two rounds; the call has the answer as its value.
    Ask(crate::host::Request),
    /// Ask rules; the call has what is asked for as its value.
    Query {
        /// A predicate whose last argument is what an answer is.
        predicate: crate::rules::clause::PredId,
        /// Its other arguments.
        inputs: Vec<Value>,
        /// What is asked for.
        ask: crate::rules::Ask,
    },
    /// Why the query of a stream has an answer, or why it has none, as text; nil if that is not so.
    Explain(Value, bool),
    /// A part of a stream of answers.
    Part(Value, crate::machine::Part),
    /// Facts come into force in the task: a list of predicates with their arguments; nil.
    PushFacts(Value),
    /// Queries of the task see this tree; nil.
    PushTree(Value),
    /// The newest of such facts or trees are no longer in force; nil.
    PopScope,
    /// Run a plan as a root of its own; the call has the tree as its value.
    RunPlan {
        /// The plan.
        plan: Value,
        /// Its arguments.
        args: Vec<Value>,
        /// The tree whose slots and edits it starts from.
        tree: Option<Value>,
        /// The key of its random draws, if it is not that of the run that asks.
        seed: Option<u64>,
        /// It is a rehearsal: it prints nothing, changes nothing outside, and motions are projected.
        projected: bool,
    },
    /// Call a plan, in this run, with the edits of a graft below the call.
    WithEdits {
        /// The plan.
        plan: Value,
        /// Its arguments; without any, those of the plan that calls.
        args: Option<Vec<Value>>,
        /// The edits.
        graft: std::rc::Rc<crate::graft::Graft>,
    },
    /// Compile the code of edits, then add them to a tree; the call has the new tree as its value.
    EditTree {
        /// A tree.
        tree: Value,
        /// A list of edits.
        edits: Value,
        /// Who made them, in words for people.
        origin: String,
    },
}

/// A function of the language that is written in Rust.
pub struct Native {
    /// Its name in the language.
    pub name: &'static str,
    /// Fewest and most arguments; no most for any number.
    pub arity: (u8, Option<u8>),
    /// What it does besides computing.
    pub effect: Effect,
    /// The function.
    pub run: NativeFn,
}

/// Makes `natives()` of a topic from its table.
///
/// A row is `"name" [arity] => function;`. The arity is `[2]`, `[1 3]` for one to three, or `[0 ..]`.
/// Most natives need only their arguments and are `fn(&[Value]) -> Result<Value, Raise>`. Those that
/// need more say `in ctx` and are [`NativeFn`]; an effect other than `Pure` follows it.
#[macro_export]
macro_rules! natives {
    ($($name:literal [$($arity:tt)+] $(in $ctx:ident $($effect:ident)?)? => $run:expr;)+) => {
        /// The natives of this topic.
        pub(crate) fn natives() -> Vec<$crate::native::Native> {
            vec![$($crate::native::Native {
                name: $name,
                arity: $crate::natives!(@arity $($arity)+),
                effect: $crate::natives!(@effect $($($effect)?)?),
                run: $crate::natives!(@run $run $(, $ctx)?),
            }),+]
        }
    };
    (@arity $n:literal) => { ($n, Some($n)) };
    (@arity $least:literal ..) => { ($least, None) };
    (@arity $least:literal $most:literal) => { ($least, Some($most)) };
    (@effect) => { $crate::native::Effect::Pure };
    (@effect $effect:ident) => { $crate::native::Effect::$effect };
    (@run $run:expr) => { |_ctx, args| ($run)(args).map($crate::native::Next::Return) };
    (@run $run:expr, $ctx:ident) => { $run };
}

// ---------------------------------------------------------------------------------------------
// For those who write natives

impl From<Value> for Next {
    fn from(value: Value) -> Next {
        Next::Return(value)
    }
}

/// The failure of a value of the wrong kind. `expected` names the right one: "a list".
#[must_use]
pub fn type_error(expected: &str, value: &Value) -> Raise {
    let shown = match value.is_nil() {
        true => "nil".to_string(),
        false => format!("the {} {}", value.type_name(), crate::print::brief(value)),
    };
    Box::new(Failure::with(
        Builtin::TypeError,
        vec![
            ("message", Value::str(format!("expected {expected}, got {shown}"))),
            ("expected", Value::str(expected)),
            ("value", value.clone()),
        ],
    ))
}

/// The failure of a position, key or number that is out of its range.
#[must_use]
pub fn range_error(message: impl Into<String>, value: &Value) -> Raise {
    let message = Value::str(message.into());
    Box::new(Failure::with(Builtin::RangeError, vec![("message", message), ("value", value.clone())]))
}

/// The failure of arithmetic that has no result.
#[must_use]
pub fn arithmetic_error(message: impl Into<String>) -> Raise {
    Box::new(Failure::new(Builtin::ArithmeticError, message))
}

/// The failure of a result that would be larger than any limit.
#[must_use]
pub fn too_large(message: impl Into<String>) -> Raise {
    Box::new(Failure::new(Builtin::MemoryExhausted, message))
}

/// An integer argument.
pub fn int(value: &Value) -> Result<i64, Raise> {
    value.as_int().ok_or_else(|| type_error("an integer", value))
}

/// An integer argument that counts or numbers something.
pub fn index(value: &Value) -> Result<usize, Raise> {
    let number = int(value)?;
    usize::try_from(number).map_err(|_| range_error(format!("expected a number from 0, got {number}"), value))
}

/// A number argument, integers converted.
pub fn number(value: &Value) -> Result<f64, Raise> {
    value.as_number().ok_or_else(|| type_error("a number", value))
}

/// A string argument.
pub fn str(value: &Value) -> Result<&str, Raise> {
    value.as_str().ok_or_else(|| type_error("a string", value))
}

/// The elements of a list argument.
pub fn list(value: &Value) -> Result<Vec<Value>, Raise> {
    value.to_vec().ok_or_else(|| type_error("a list", value))
}

/// How many parts a key of a map may have: keys are compared at each look-up.
const KEY_LIMIT: usize = 10_000;

/// A value as key of a map: refused if it is huge, or has no content to compare by.
pub fn map_key(value: &Value) -> Result<Value, Raise> {
    let mut todo = vec![value.clone()];
    for _ in 0..KEY_LIMIT {
        let Some(part) = todo.pop() else { return Ok(value.clone()) };
        match part.obj() {
            None if matches!(part, Value::Imm(Imm::Float(f)) if f.is_nan()) => {
                return Err(range_error("nan cannot be the key of a map", value));
            }
            Some(Obj::Pair(first, rest)) => todo.extend([first.clone(), rest.clone()]),
            Some(Obj::Vector(items)) => todo.extend(items.iter().take(KEY_LIMIT).cloned()),
            Some(Obj::Map(map)) => {
                todo.extend(map.iter().take(KEY_LIMIT).flat_map(|(k, v)| [k.clone(), v.clone()]))
            }
            Some(Obj::Desc(desc)) => todo.extend(desc.values().cloned()),
            Some(Obj::Counter(_) | Obj::Ranks(_) | Obj::Tree(_)) => {
                return Err(type_error("a value that can be a key", value));
            }
            _ => {}
        }
    }
    Err(too_large(format!("the key of a map has more than {KEY_LIMIT} parts")))
}
