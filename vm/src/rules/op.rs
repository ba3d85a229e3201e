//! Instructions of rules.
//!
//! A clause has registers of its own, as a function has: the arguments of its head, then its
//! variables, then room for the arguments of goals. The instructions of its head come first and say
//! what each argument must look like; those of a goal build its arguments above all that is in use.
//! An instruction that does not hold makes the newest choice go on.

use crate::code::{FnId, Pc};

use super::clause::PredId;

/// A part of a list cell in an instruction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// A variable that nothing else looks at.
    Any,
    /// Register r gets it: the variable is met here first.
    First(u8),
    /// It is what register r holds.
    Same(u8),
    /// The end of a list.
    Nil,
}

/// A constant, as a position in [`super::Rules::constants`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Const(pub u32);

/// A structure's shape and keys, as a position in [`super::Rules::templates`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Template(pub u32);

/// An instruction; 8 bytes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RuleOp {
    // What must hold of a register.
    /// a is nil.
    GetNil(u8),
    /// a is constant k.
    GetConst(u8, Const),
    /// a is a cell of a list with these parts.
    GetPair(u8, Part, Part),
    /// a is a cell of a list, whose parts go to h and t.
    GetParts(u8, u8, u8),
    /// a is a cell of a list that begins with what h holds; the rest goes to t.
    GetRest(u8, u8, u8),
    /// a is a structure with the keys of t; its values go to the registers from s.
    GetStruct(u8, u8, Template),
    /// a and b are the same.
    Unify(u8, u8),
    /// a and b are the same already.
    Identical(u8, u8),
    /// Pattern a matches b, whose descriptions may say more.
    Matches(u8, u8),
    /// a < b
    Less(u8, u8),
    /// a <= b
    LessEq(u8, u8),
    /// a = b, as numbers
    NumEq(u8, u8),
    /// not a = b, as numbers
    NumNe(u8, u8),
    /// Variable a, of the name in constant k, is bound; if not, the run fails with `floundering`.
    NeedsBound(u8, Const),

    // Making terms.
    /// d = a new variable
    Fresh(u8),
    /// d = s
    Move(u8, u8),
    /// d = constant k
    PutConst(u8, Const),
    /// d = a cell of a list
    PutPair(u8, Part, Part),
    /// d = a structure with the keys of t and the values of the registers from s
    PutStruct(u8, u8, Template),
    /// d = a + b
    Add(u8, u8, u8),
    /// d = a - b
    Sub(u8, u8, u8),
    /// d = a * b
    Mul(u8, u8, u8),
    /// d = a / b
    Div(u8, u8, u8),
    /// d = a + i
    AddInt(u8, u8, i32),

    // Goals.
    /// Solve predicate p, its arguments in the registers from w. The clause uses n registers, and the
    /// predicate begins above them: if it leaves a choice, its registers must stay.
    Call(u8, u8, PredId),
    /// Solve a predicate that is written in Rust, its arguments in the registers from w.
    CallNative(u8, PredId),
    /// Solve it as the last goal of the clause: its arguments are in the registers from w.
    Execute(u8, PredId),
    /// The same where the arguments are in the first registers already.
    ExecuteHere(PredId),
    /// Solve the goal in w, with n more arguments after it, in scope s. The clause uses m registers.
    CallValue(u8, u8, u8, u32),
    /// d = the result of function f for the n arguments from w; leaves the loop.
    CallFun(u8, u8, u8, FnId),
    /// The clause holds.
    Proceed,
    /// The query holds.
    Answer,
    /// A clause of the table in register 0 holds for the arguments in register 1.
    TableAnswer,
    /// Counts in counter n.
    Tick(u32),
    /// Nothing more here: go back to the newest choice.
    Fail,

    // Control.
    /// Go to t.
    Jump(Pc),
    /// A choice: go on here, later at t. The clause uses n registers.
    Try(u8, Pc),
    /// d = the number of choices when the predicate was called.
    Entry(u8),
    /// d = the number of choices now.
    Choices(u8),
    /// Forget the choices beyond the number in a.
    Cut(u8),
    /// The first choice beyond the number in a is no longer one.
    Close(u8),

    // Collecting.
    /// Begin to collect; its number goes to d.
    Collect(u8, super::clause::Collect),
    /// Collect the term in s for collection d.
    Add1(u8, u8),
    /// d = what has been collected in d; fails for the least or greatest of nothing.
    Collected(u8),
    /// The groups of the list in w+1 by the parts of its elements, one after another: variables to w,
    /// instances to w+2. A set has each instance once.
    Groups(u8, bool),
}

const _: () = assert!(size_of::<RuleOp>() <= 8);

impl RuleOp {
    /// Visits the registers that it reads.
    pub(super) fn reads(
        &self,
        arity: &dyn Fn(PredId) -> u8,
        values: &dyn Fn(Template) -> u8,
        visit: &mut dyn FnMut(u8),
    ) {
        let mut range = |first: u8, n: u8| (0..n).for_each(|i| visit(first.wrapping_add(i)));
        match *self {
            RuleOp::GetNil(a)
            | RuleOp::GetParts(a, ..)
            | RuleOp::GetConst(a, _)
            | RuleOp::GetStruct(a, ..)
            | RuleOp::NeedsBound(a, _)
            | RuleOp::Move(_, a)
            | RuleOp::AddInt(_, a, _)
            | RuleOp::Cut(a)
            | RuleOp::Close(a)
            | RuleOp::Collected(a) => visit(a),
            RuleOp::GetPair(a, first, rest) => {
                visit(a);
                [first, rest].into_iter().filter_map(Part::read).for_each(visit);
            }
            RuleOp::PutPair(_, first, rest) => {
                [first, rest].into_iter().filter_map(Part::read).for_each(visit);
            }
            RuleOp::Unify(a, b)
            | RuleOp::Identical(a, b)
            | RuleOp::Matches(a, b)
            | RuleOp::Less(a, b)
            | RuleOp::LessEq(a, b)
            | RuleOp::NumEq(a, b)
            | RuleOp::NumNe(a, b)
            | RuleOp::Add(_, a, b)
            | RuleOp::Sub(_, a, b)
            | RuleOp::Mul(_, a, b)
            | RuleOp::Div(_, a, b)
            | RuleOp::GetRest(a, b, _)
            | RuleOp::Add1(a, b) => range_of(&[a, b], visit),
            RuleOp::PutStruct(_, s, t) => range(s, values(t)),
            RuleOp::Call(w, _, predicate)
            | RuleOp::CallNative(w, predicate)
            | RuleOp::Execute(w, predicate) => {
                range(w, arity(predicate));
            }
            RuleOp::ExecuteHere(predicate) => range(0, arity(predicate)),
            RuleOp::CallValue(w, n, ..) => range(w, n + 1),
            RuleOp::CallFun(_, w, n, _) => range(w, n),
            RuleOp::Groups(w, _) => range(w, 2),
            RuleOp::TableAnswer => range(0, 2),
            RuleOp::Fresh(_)
            | RuleOp::PutConst(..)
            | RuleOp::Proceed
            | RuleOp::Answer
            | RuleOp::Fail
            | RuleOp::Tick(_)
            | RuleOp::Jump(_)
            | RuleOp::Try(..)
            | RuleOp::Entry(_)
            | RuleOp::Choices(_)
            | RuleOp::Collect(..) => {}
        }
    }

    /// Visits the registers that it writes.
    pub(super) fn writes(&self, values: &dyn Fn(Template) -> u8, visit: &mut dyn FnMut(u8)) {
        match *self {
            RuleOp::GetPair(_, first, rest) => {
                [first, rest].into_iter().filter_map(Part::written).for_each(visit);
            }
            RuleOp::PutPair(d, first, rest) => {
                visit(d);
                [first, rest].into_iter().filter_map(Part::written).for_each(visit);
            }
            RuleOp::GetParts(_, first, rest) => range_of(&[first, rest], visit),
            RuleOp::GetRest(_, _, rest) => visit(rest),
            RuleOp::GetStruct(_, s, t) => (0..values(t)).for_each(|i| visit(s.wrapping_add(i))),
            RuleOp::Fresh(d)
            | RuleOp::Move(d, _)
            | RuleOp::PutConst(d, _)
            | RuleOp::PutStruct(d, ..)
            | RuleOp::Add(d, ..)
            | RuleOp::Sub(d, ..)
            | RuleOp::Mul(d, ..)
            | RuleOp::Div(d, ..)
            | RuleOp::AddInt(d, ..)
            | RuleOp::CallFun(d, ..)
            | RuleOp::Entry(d)
            | RuleOp::Choices(d)
            | RuleOp::Collect(d, _)
            | RuleOp::Collected(d) => visit(d),
            RuleOp::Groups(w, _) => visit(w + 2),
            _ => {}
        }
    }
}

fn range_of(registers: &[u8], visit: &mut dyn FnMut(u8)) {
    registers.iter().for_each(|it| visit(*it));
}

impl Part {
    fn read(self) -> Option<u8> {
        if let Part::Same(r) = self { Some(r) } else { None }
    }
    fn written(self) -> Option<u8> {
        if let Part::First(r) = self { Some(r) } else { None }
    }
}
