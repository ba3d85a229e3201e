//! Instructions: one table for the enum, the disassembler, the verifier and BYTECODE.md.
//!
//! The machine has registers: `r`, `s`, … are `u8` and name one of the 256 registers above the
//! base of the frame. An instruction takes 8 bytes. Targets of jumps are absolute.

use crate::code::{ConstId, FnId, GlobalId, NativeId, Pc, SiteId};
use crate::failure::TypeId;

/// What an operand is, for those who look at instructions from outside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Operand {
    /// A register.
    Reg(u8),
    /// A number: how many registers, or an integer.
    Num(i64),
    /// An instruction to go to.
    Target(Pc),
    /// A constant.
    Const(ConstId),
    /// A top-level constant.
    Global(GlobalId),
    /// A function.
    Function(FnId),
    /// A native.
    Native(NativeId),
    /// A call site.
    Site(SiteId),
    /// A failure type.
    Failure(TypeId),
}

impl From<u8> for Operand {
    fn from(it: u8) -> Self {
        Operand::Reg(it)
    }
}
impl From<i16> for Operand {
    fn from(it: i16) -> Self {
        Operand::Num(it.into())
    }
}
impl From<i32> for Operand {
    fn from(it: i32) -> Self {
        Operand::Num(it.into())
    }
}
impl From<Count> for Operand {
    fn from(it: Count) -> Self {
        Operand::Num(it.0.into())
    }
}
impl From<Pc> for Operand {
    fn from(it: Pc) -> Self {
        Operand::Target(it)
    }
}
impl From<ConstId> for Operand {
    fn from(it: ConstId) -> Self {
        Operand::Const(it)
    }
}
impl From<GlobalId> for Operand {
    fn from(it: GlobalId) -> Self {
        Operand::Global(it)
    }
}
impl From<FnId> for Operand {
    fn from(it: FnId) -> Self {
        Operand::Function(it)
    }
}
impl From<NativeId> for Operand {
    fn from(it: NativeId) -> Self {
        Operand::Native(it)
    }
}
impl From<SiteId> for Operand {
    fn from(it: SiteId) -> Self {
        Operand::Site(it)
    }
}
impl From<Kind> for Operand {
    fn from(it: Kind) -> Self {
        Operand::Failure(TypeId(it.0.into()))
    }
}

/// A number of registers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Count(pub u8);

/// A failure type in an instruction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Kind(pub u16);

macro_rules! ops {
    ($($(#[doc = $doc:literal])+ $name:ident $(($($field:ident: $type:ty),+))? ;)+) => {
        /// An instruction.
        #[derive(Debug, Clone, Copy, PartialEq)]
        #[rustfmt::skip]
        pub enum Op { $($(#[doc = $doc])+ $name $(($($type),+))?),+ }

        impl Op {
            /// Name, names of operands, and what it does, of every instruction.
            pub const TABLE: &'static [(&'static str, &'static [&'static str], &'static str)] =
                &[$((stringify!($name), &[$($(stringify!($field)),+)?], concat!($($doc),+))),+];
            /// Its name.
            #[must_use]
            pub fn name(&self) -> &'static str {
                match self { $(ops!(@pattern $name $(($($field),+))?) => stringify!($name)),+ }
            }
            /// Its operands, in order.
            #[must_use]
            pub fn operands(&self) -> Vec<Operand> {
                match *self { $(Op::$name $(($($field),+))? => vec![$($($field.into()),+)?]),+ }
            }
        }
    };
    (@pattern $name:ident ($($field:ident),+)) => { Op::$name(..) };
    (@pattern $name:ident) => { Op::$name };
}

ops! {
    /// Register `d` gets constant `k`.
    Const(d: u8, k: ConstId);
    /// Register `d` gets the integer `i`.
    Int(d: u8, i: i32);
    /// Register `d` gets nil.
    Nil(d: u8);
    /// Register `d` gets true.
    True(d: u8);
    /// Register `d` gets false.
    False(d: u8);
    /// Register `d` gets the value of register `s`.
    Move(d: u8, s: u8);
    /// Registers `d` and `d`+1 get the values of registers `s` and `t`.
    Move2(d: u8, s: u8, t: u8);
    /// Register `d` gets top-level constant `g`.
    Global(d: u8, g: GlobalId);
    /// Top-level constant `g` gets the value of register `s`.
    SetGlobal(s: u8, g: GlobalId);

    /// d = a + b.
    Add(d: u8, a: u8, b: u8);
    /// d = a - b.
    Sub(d: u8, a: u8, b: u8);
    /// d = a * b.
    Mul(d: u8, a: u8, b: u8);
    /// d = a / b: an integer where it is exact, else a float.
    Div(d: u8, a: u8, b: u8);
    /// d = a + i.
    AddInt(d: u8, a: u8, i: i32);
    /// d = a < b.
    Less(d: u8, a: u8, b: u8);
    /// d = a <= b.
    LessEq(d: u8, a: u8, b: u8);
    /// d = a = b, as numbers.
    NumEq(d: u8, a: u8, b: u8);
    /// d = true if a is nil or false.
    Not(d: u8, a: u8);
    /// d = true if a is nil.
    IsNil(d: u8, a: u8);
    /// d = true if a and b are one object.
    Identical(d: u8, a: u8, b: u8);
    /// d = the cell of a and b.
    Cons(d: u8, a: u8, b: u8);
    /// d = first element of the list or stream a; nil of nil.
    First(d: u8, a: u8);
    /// d = the list or stream a without its first element; nil of nil.
    Rest(d: u8, a: u8);
    /// d = the list of n registers from s.
    List(d: u8, s: u8, n: Count);
    /// d = the vector of n registers from s.
    Vector(d: u8, s: u8, n: Count);
    /// d = the map of n keys and values from register s.
    Map(d: u8, s: u8, n: Count);
    /// d = a description: kind and keys are constant k (a list), values the registers from s.
    Desc(d: u8, s: u8, k: ConstId);
    /// d = function f with the values that it captures, in the registers from s.
    Closure(d: u8, s: u8, f: FnId);
    /// d = a counter of the integer in s, for `with-retry-counters`.
    Counter(d: u8, s: u8);
    /// d = true and one less in the counter s, or false if it is zero.
    CountDown(d: u8, s: u8);

    /// Go to t.
    Jump(t: Pc);
    /// Go back to t; costs a unit of fuel.
    Loop(t: Pc);
    /// Go to t if a is nil or false.
    JumpIfFalse(a: u8, t: Pc);
    /// Go to t if a is neither nil nor false.
    JumpIfTrue(a: u8, t: Pc);
    /// Go to t if a is nil.
    JumpIfNil(a: u8, t: Pc);
    /// Go to t if a is not nil.
    JumpUnlessNil(a: u8, t: Pc);
    /// Go to t unless a < b.
    JumpUnlessLess(a: u8, b: u8, t: Pc);
    /// Go to t unless a <= b.
    JumpUnlessLessEq(a: u8, b: u8, t: Pc);
    /// Go to t unless a = b, as numbers.
    JumpUnlessNumEq(a: u8, b: u8, t: Pc);
    /// Go to t if a = b, as numbers.
    JumpIfNumEq(a: u8, b: u8, t: Pc);
    /// Go to t unless a < i.
    JumpUnlessLessInt(a: u8, i: i16, t: Pc);
    /// Go to t unless a <= i.
    JumpUnlessLessEqInt(a: u8, i: i16, t: Pc);
    /// Go to t unless a > i.
    JumpUnlessMoreInt(a: u8, i: i16, t: Pc);
    /// Go to t unless a >= i.
    JumpUnlessMoreEqInt(a: u8, i: i16, t: Pc);
    /// Go to t unless a = i.
    JumpUnlessEqInt(a: u8, i: i16, t: Pc);
    /// Go to t if parameter a was given.
    JumpIfSet(a: u8, t: Pc);
    /// Go to t unless a is constant k: `case` on constants that compare by content.
    JumpUnlessConst(a: u8, k: ShortConst, t: Pc);

    /// The list that `dolist` walks over the value of s goes to d+1 and d+2.
    IterStart(d: u8, s: u8);
    /// Take the next element of the list in d+1 to d, or go to t at its end.
    IterNext(d: u8, t: Pc);
    /// d = the value of s if it can be a count for `dotimes`.
    CountStart(d: u8, s: u8);

    /// Call function f; its registers begin at w of ours, its value goes to d.
    Call(d: u8, w: u8, f: FnId);
    /// Call the plan of site s as a new node; its registers begin at w, its value goes to d.
    CallPlan(d: u8, w: u8, s: SiteId);
    /// Call the value in w with the n registers after it, at site s; the value goes to d.
    CallValue(d: u8, w: u8, n: Count, s: SiteId);
    /// Call native f with the n registers from w; the value goes to d.
    CallNative(d: u8, w: u8, n: Count, f: NativeId);
    /// Perform the description in w, with the goal in w+1 (nil, or a function), at site s; the value goes to d.
    Perform(d: u8, w: u8, s: SiteId);
    /// Go on as function f with the n registers from w: the frame is its now.
    TailCall(w: u8, n: Count, f: FnId);
    /// Go on as the value in w with the n registers after it, at site s.
    TailCallValue(w: u8, n: Count, s: SiteId);
    /// The call has the value of a.
    Return(a: u8);
    /// The plan has the value of a; its node succeeds.
    ReturnPlan(a: u8);
    /// The body before the edit that this code belongs to: run it, its value goes to d; site s.
    Original(d: u8, s: SiteId);

    /// Begin a parallel form: its kind is in w, what else it needs in w+1, its n branches are the
    /// functions after that, with sites from s; the value goes to d.
    Fork(d: u8, w: u8, n: Count, s: SiteId);

    /// Raise a failure: type k, n fields as keyword and value from register a.
    Fail(a: u8, n: Count, k: Kind);
    /// Raise the failure in register a, which a handler lets pass.
    Raise(a: u8);
    /// d = a new failure of type k, n fields as keyword and value from register a.
    MakeFailure(d: u8, a: u8, n: Count, k: Kind);
    /// Go to t unless the failure in a is of type k or below.
    JumpUnlessKind(a: u8, k: Kind, t: Pc);
    /// Note in d how often the calls of this node have been counted, for `retry`.
    Mark(d: u8);
    /// Do the guarded body at t again; its calls are counted from the mark in a.
    Retry(a: u8, t: Pc);
    /// Clean-up forms begin: from now on they have their time.
    BeginCleanUp;
    /// The clean-up forms are over: raise the failure that waits in a, if one does.
    EndCleanUp(a: u8);
    /// The driver of the frame goes on with the value in register 0.
    Resume;
}

impl Op {
    /// True for calls of functions and plans and for backward jumps: what the source counts, so
    /// that a change of the code generator changes no tree.
    #[must_use]
    pub fn costs_fuel(&self) -> bool {
        matches!(
            self,
            Op::Loop(..)
                | Op::Call(..)
                | Op::CallPlan(..)
                | Op::CallValue(..)
                | Op::TailCall(..)
                | Op::TailCallValue(..)
                | Op::Perform(..)
                | Op::Retry(..)
                | Op::Fork(..)
        )
    }
}

/// A constant among the first 65,536, for instructions that have more to say.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ShortConst(pub u16);
impl From<ShortConst> for Operand {
    fn from(it: ShortConst) -> Self {
        Operand::Const(ConstId(it.0.into()))
    }
}

const _: () = assert!(size_of::<Op>() <= 8);
