//! Programs as the machine runs them: functions, their instructions, and the maps that say
//! which form of the source an instruction belongs to.
//!
//! Code is not a file format. Programs are kept as source; compiling is fast.
//!
//! The **form map** is what makes handlers, clean-ups, keys and obligations free for code that
//! does not meet them: each function lists its forms as ranges of instructions, outer before
//! inner, and whoever has to know where a frame stands looks its program counter up.

use std::cell::Cell;

use crate::failure::FailureTypes;
use crate::native::Native;
use crate::op::Op;
use crate::value::{Imm, Symbol, Value};

/// What the function of the top-level forms of a file is called, and the root of a tree.
pub const TOP_LEVEL: &str = "top-level";

macro_rules! index_types {
    ($($(#[$doc:meta])+ $name:ident;)+) => {
        $($(#[$doc])+ #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)] pub struct $name(pub u32);
        impl $name {
            /// As a position in the table that it is an index of.
            #[inline(always)] #[must_use] pub fn at(self) -> usize { self.0 as usize }
        })+
    };
}

index_types! {
    /// A function of the program.
    FnId;
    /// A function written in Rust.
    NativeId;
    /// A call in the source.
    SiteId;
    /// A constant of the code.
    ConstId;
    /// A top-level constant of the program (`def-const`).
    GlobalId;
    /// An instruction.
    Pc;
}

/// Where something stands in a source file, in bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Place {
    /// Number of the file.
    pub file: u32,
    /// First byte.
    pub start: u32,
    /// One past the last byte.
    pub end: u32,
}

/// All code of a program. It only grows: functions may be added while it runs.
#[derive(Default)]
pub struct Program {
    /// Instructions of all functions, one after another.
    pub code: Vec<Op>,
    /// Where each instruction comes from.
    pub places: Vec<Place>,
    /// The functions.
    pub functions: Vec<Function>,
    /// Which function the instructions from here on belong to, in the order of instructions.
    pub extents: Vec<(Pc, FnId)>,
    /// All calls, grouped by function, in the order of their instructions.
    pub sites: Vec<Site>,
    /// All forms, grouped by function, outer before inner, earlier before later.
    pub forms: Vec<FormRange>,
    /// Values that instructions name by index.
    pub constants: Vec<Value>,
    /// Names of top-level constants; their values belong to the run.
    pub globals: Vec<Symbol>,
    /// The functions written in Rust.
    pub natives: Vec<Native>,
    /// The types of failures.
    pub failures: FailureTypes,
    /// The rules.
    pub rules: crate::rules::Rules,
    /// The files of the library, by their numbers.
    pub library: rustc_hash::FxHashSet<u32>,
    /// The function that says which plan performs a description, if a module provides one.
    pub ground: Option<FnId>,
    /// The function that was looked for last: most often it is the next one, too.
    found: Cell<FnId>,
}

/// What a function is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FnKind {
    /// `def-fun`: calls of it make no node.
    Function,
    /// `def-plan`: each call makes a node.
    Plan,
    /// `lambda`
    Lambda,
    /// A branch of a parallel form: each run of it makes a node.
    Branch,
    /// The top-level forms of a file.
    TopLevel,
    /// Code that an edit brings in, with the parameters of the plan that it edits.
    Inserted,
}

impl FnKind {
    /// The word for it.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            FnKind::Function | FnKind::Lambda => "function",
            FnKind::Branch => "branch",
            FnKind::Plan => "plan",
            FnKind::TopLevel => "file",
            FnKind::Inserted => "code",
        }
    }
}

/// A function or plan.
#[derive(Debug, Clone)]
pub struct Function {
    /// Its name; `lambda` for one without.
    pub name: Symbol,
    /// What it is.
    pub kind: FnKind,
    /// Its first instruction.
    pub entry: Pc,
    /// One past its last instruction.
    pub end: Pc,
    /// How many registers its frame uses.
    pub registers: u8,
    /// Its parameters, in the first registers.
    pub params: Params,
    /// How many captured values follow the parameters.
    pub captures: u8,
    /// True if a handler or clean-up stands in it.
    pub guards: bool,
    /// Its part of [`Program::forms`].
    pub forms: std::ops::Range<u32>,
    /// Its part of [`Program::sites`].
    pub sites: std::ops::Range<u32>,
    /// Its definition.
    pub place: Place,
}

/// The parameters of a function, in the order of their registers.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Params {
    /// All names: required, optional, keys, rest. Of a pattern its text, see [`is_pattern`].
    pub names: Vec<Symbol>,
    /// How many are required.
    pub required: u8,
    /// How many are optional.
    pub optional: u8,
    /// How many are given by keyword.
    pub keys: u8,
    /// True if the last one takes all that is left as a list.
    pub rest: bool,
}

impl Params {
    /// True if a call with `n` arguments needs no rearrangement.
    #[inline(always)]
    #[must_use]
    pub fn is_plain(&self, n: usize) -> bool {
        self.required as usize == n && self.names.len() == n
    }
    /// The names that the program gives them: a pattern has none.
    pub fn given_names(&self) -> impl Iterator<Item = Symbol> {
        self.names.iter().copied().filter(|name| !is_pattern(name))
    }
    /// Arguments in the order of the parameters as a call gives them: without those that were not given,
    /// keywords by their names.
    #[must_use]
    pub fn written(&self, args: Vec<Value>) -> Vec<Value> {
        let mut args = args.into_iter();
        let by_place = args.by_ref().take(self.required as usize + self.optional as usize);
        let mut written: Vec<Value> = by_place.filter(|arg| !arg.is_unset()).collect();
        let keys: Vec<Value> = args.by_ref().take(self.keys as usize).collect();
        match args.next().filter(|_| self.rest) {
            // The list of the rest holds the keywords as well.
            Some(rest) => written.extend(rest.iter().cloned()),
            None => {
                let given = self.key_names().iter().zip(keys).filter(|(_, value)| !value.is_unset());
                written.extend(given.flat_map(|(name, value)| [Value::Imm(Imm::Keyword(*name)), value]));
            }
        }
        written
    }
    /// The names of the keyword parameters.
    #[must_use]
    pub fn key_names(&self) -> &[Symbol] {
        let first = self.required as usize + self.optional as usize;
        &self.names[first..first + self.keys as usize]
    }
}

/// True for what stands in the place of a name where a parameter is a pattern: its text.
#[must_use]
pub fn is_pattern(name: &str) -> bool {
    name.starts_with(['(', '['])
}

/// A call in the source. The key of a slot starts with it.
#[derive(Debug, Clone)]
pub struct Site {
    /// The function that the call stands in.
    pub owner: FnId,
    /// The calling instruction.
    pub pc: Pc,
    /// The callee, where it is known when compiling.
    pub callee: Option<FnId>,
    /// The name of the callee where it is known, else of what is called.
    pub name: Symbol,
    /// How many arguments are in the window.
    pub args: u8,
    /// Stands for owner, place among the owner's calls and callee, in words.
    pub hash: u64,
    /// The innermost form around it, as an index into [`Program::forms`].
    pub form: u32,
    /// The rounds of loops around it within its function, outer before inner.
    pub rounds: Box<[RoundKey]>,
    /// True if it may be reached more than once with the same key, so that calls must be counted.
    pub counted: bool,
    /// True if the value of the call is used.
    pub value_used: bool,
}

/// Where a round of a loop has its key.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RoundKey {
    /// `dotimes`: the register holds the number of the round.
    Count(u8),
    /// `dolist`: three registers from here hold element, rest of the list, ranks.
    Element(u8),
}

impl RoundKey {
    /// The first register of the loop.
    #[must_use]
    pub fn register(self) -> u8 {
        let (RoundKey::Count(register) | RoundKey::Element(register)) = self;
        register
    }
}

/// A form of the source as a range of instructions.
#[derive(Debug, Clone, Copy)]
pub struct FormRange {
    /// What it is.
    pub kind: FormKind,
    /// First instruction.
    pub start: Pc,
    /// One past the last instruction.
    pub end: Pc,
    /// The form around it, as an index into [`Program::forms`]; its own index for the outermost.
    pub parent: u32,
    /// So many registers belong to what is around it.
    pub registers: u8,
}

/// What a form is to the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FormKind {
    /// The body of a function.
    Body,
    /// A part of the form around it that is done in one go: an element of a sequence.
    Step,
    /// One of the branches of `if` or `case`: of those with the same number in a function one is done.
    Branch(u32),
    /// The body of a loop: each run of it is another instance of the form.
    Round(Option<RoundKey>),
    /// The body of `with-failure-handling`: a failure goes to `failure` and control to `handler`.
    Guarded {
        /// Where the clauses begin.
        handler: Pc,
        /// Register that takes the failure.
        failure: u8,
    },
    /// The clauses of `with-failure-handling`.
    Clauses {
        /// Register of the failure that is being handled.
        failure: u8,
    },
    /// The body of `unwind-protect`: a failure goes to `pending` and control to `cleanup`.
    Protected {
        /// Where the clean-up forms begin.
        cleanup: Pc,
        /// Register that takes the failure.
        pending: u8,
        /// The form that it is a part of, such as `with-robot`; `clean-up` if it is none's.
        name: Symbol,
    },
    /// The clean-up forms of `unwind-protect`.
    CleanUp {
        /// Register of the failure that waits until they have run, or nil.
        pending: u8,
        /// As that of the body.
        name: Symbol,
    },
}

impl Program {
    /// The function that an instruction belongs to.
    #[inline]
    #[must_use]
    pub fn function_at(&self, pc: Pc) -> Option<FnId> {
        let last = self.found.get();
        if self.has(last, pc) { Some(last) } else { self.find_function(pc) }
    }

    fn has(&self, function: FnId, pc: Pc) -> bool {
        self.functions.get(function.at()).is_some_and(|it| it.entry <= pc && pc < it.end)
    }

    #[inline(never)]
    fn find_function(&self, pc: Pc) -> Option<FnId> {
        let after = self.extents.partition_point(|(entry, _)| *entry <= pc);
        let (_, id) = self.extents[after.checked_sub(1)?];
        self.found.set(id);
        self.has(id, pc).then_some(id)
    }

    /// The innermost form around an instruction, as an index into [`Program::forms`].
    #[must_use]
    pub fn form_at(&self, function: FnId, pc: Pc) -> u32 {
        let range = &self.functions[function.at()].forms;
        let forms = &self.forms[range.start as usize..range.end as usize];
        let mut form =
            (forms.partition_point(|form| form.start <= pc) as u32 + range.start).saturating_sub(1);
        while self.forms[form as usize].end <= pc && self.forms[form as usize].parent != form {
            form = self.forms[form as usize].parent;
        }
        form
    }

    /// The forms from `form` outwards, within its function.
    pub fn forms_outward(&self, form: u32) -> impl Iterator<Item = (u32, &FormRange)> {
        let mut next = Some(form);
        std::iter::from_fn(move || {
            let at = next?;
            let form = self.forms.get(at as usize)?;
            next = (form.parent != at).then_some(form.parent);
            Some((at, form))
        })
    }

    /// True if no part of a form has begun at an instruction of it, or the one before has ended.
    #[must_use]
    pub fn is_between_parts(&self, form: u32, pc: Pc) -> bool {
        let Some(function) = self.function_at(pc) else { return true };
        let inside = self.forms_outward(self.form_at(function, pc)).take_while(|(id, _)| *id != form);
        inside.last().is_none_or(|(_, part)| part.start == pc)
    }

    /// The form around a form, within its function.
    #[must_use]
    pub fn around(&self, form: u32) -> Option<u32> {
        self.forms.get(form as usize).map(|it| it.parent).filter(|parent| *parent != form)
    }

    /// The site of the call at `pc`.
    #[must_use]
    pub fn site_at(&self, function: FnId, pc: Pc) -> Option<SiteId> {
        let range = &self.functions[function.at()].sites;
        let sites = &self.sites[range.start as usize..range.end as usize];
        let at = sites.binary_search_by_key(&pc, |site| site.pc).ok()?;
        Some(SiteId(range.start + at as u32))
    }

    /// The native of this name.
    #[must_use]
    pub fn native(&self, name: &str) -> Option<NativeId> {
        self.natives.iter().position(|native| native.name == name).map(|at| NativeId(at as u32))
    }
}
