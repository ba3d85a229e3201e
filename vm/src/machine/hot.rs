//! The loop.
//!
//! Each turn reads an instruction and does it. What cannot be done with the registers of one
//! frame (natives, drivers, failures, calls that need arranging) leaves the loop as
//! [`Out::Slow`] and comes back; everything else stays.
//!
//! A window of 256 registers is taken once per call or return, so that a register named by a
//! `u8` needs no bounds check.

use std::rc::Rc;

use crate::arith;
use crate::code::{FnId, FnKind, Program, RoundKey};
use crate::key::{Chain, Key};
use crate::native::Raise;
use crate::op::Op;
use crate::tree::{COUNTED, DRIVEN, NodeKind, RecId, SlotId, Status, Tree};
use crate::value::{Imm, Obj, Value};

use super::cleanup::CleanUp;
use super::drive::Body;
use super::edited::Edited;
use super::obligation::{self, RunView};
use super::{Frame, Here, MEMO, Run};

/// Why the loop was left.
pub(super) enum Out {
    /// An instruction that the loop does not do itself.
    Slow(Op),
    /// A call of a plan at a slot with edits that need a driver.
    Edited(Op, SlotId),
    /// An instruction that failed.
    Raise(Raise),
    /// The outermost function returned.
    Done(Value),
    /// The stack is at its end.
    Grow,
    /// Calls are nested deeper than the limit.
    TooDeep,
    /// Something that this frame owes is due before the next instruction.
    Due,
    /// The fuel is used up; the instruction has not been done.
    Fuel,
}

/// Runs until something has to be done that the loop does not do. `OWES`: obligations are open,
/// so each instruction is looked at before it is done.
pub(super) fn run<const OWES: bool>(
    program: &Program,
    globals: &mut [Value],
    run: &mut Run,
    depth: usize,
    left: &mut u64,
) -> Out {
    let mut fuel = *left;
    let (mut pc, mut base, mut here) = (run.pc as usize, run.base as usize, run.here);
    let Run { stack, frames, tree, occurrences, obligations, handling, cleanups, tasks, .. } = run;
    let task = tasks.loaded;
    let code: &[Op] = &program.code;
    let out = 'window: loop {
        let Some(w) = stack.get_mut(base..).and_then(|above| above.first_chunk_mut::<256>()) else {
            break 'window Out::Grow;
        };
        macro_rules! at {
            ($r:expr) => {
                w[$r as usize]
            };
        }
        macro_rules! set {
            ($d:expr, $v:expr) => {
                w[$d as usize] = $v
            };
        }
        macro_rules! try_op {
            ($result:expr) => {
                match $result {
                    Ok(it) => it,
                    Err(raise) => break 'window Out::Raise(raise),
                }
            };
        }
        macro_rules! burn {
            () => {
                if fuel == 0 {
                    pc -= 1;
                    break 'window Out::Fuel;
                }
                fuel -= 1;
            };
        }
        macro_rules! push {
            ($d:expr) => {
                if frames.len() >= depth {
                    break 'window Out::TooDeep;
                }
                frames.push(Frame { pc: pc as u32, base: base as u32, here, dst: $d });
            };
        }
        macro_rules! arith {
            ($d:expr, $a:expr, $b:expr, $checked:ident, $slow:path) => {{
                let fast = match (&at!($a), $b) {
                    (Value::Imm(Imm::Int(x)), Value::Imm(Imm::Int(y))) => x.$checked(*y),
                    _ => None,
                };
                let value = match fast {
                    Some(it) => Value::int(it),
                    None => try_op!($slow(&at!($a), $b)),
                };
                set!($d, value);
            }};
        }
        macro_rules! compare {
            ($a:expr, $b:expr, $op:tt, $slow:path) => {
                match (&at!($a), $b) {
                    (Value::Imm(Imm::Int(x)), Value::Imm(Imm::Int(y))) => x $op y,
                    _ => try_op!($slow(&at!($a), $b)),
                }
            };
        }
        macro_rules! compare_int {
            ($a:expr, $i:expr, $op:tt) => {
                match &at!($a) {
                    Value::Imm(Imm::Int(x)) => *x $op i64::from($i),
                    other => try_op!(arith::order(other, &Value::int($i.into()))).is_some_and(|it| it $op std::cmp::Ordering::Equal),
                }
            };
        }
        macro_rules! jump {
            ($t:expr) => {
                pc = $t.0 as usize
            };
        }
        loop {
            let op = code[pc];
            if OWES {
                let view = RunView { task, obligations, handling, tree, stack: &w[..], base: 0 };
                if obligation::due(program, &view, frames.len(), pc as u32, op) {
                    break 'window Out::Due;
                }
            }
            pc += 1;
            match op {
                Op::Const(d, k) => set!(d, program.constants[k.at()].clone()),
                Op::Int(d, i) => set!(d, Value::int(i.into())),
                Op::Nil(d) => set!(d, Value::NIL),
                Op::True(d) => set!(d, Value::TRUE),
                Op::False(d) => set!(d, Value::FALSE),
                Op::Move(d, s) => set!(d, at!(s).clone()),
                Op::Move2(d, s, t) => {
                    set!(d, at!(s).clone());
                    set!(d.wrapping_add(1), at!(t).clone());
                }
                Op::Global(d, g) => match &globals[g.at()] {
                    value if value.is_unset() => break 'window Out::Slow(op),
                    value => set!(d, value.clone()),
                },
                Op::SetGlobal(s, g) => globals[g.at()] = at!(s).clone(),

                Op::Add(d, a, b) => arith!(d, a, &at!(b), checked_add, arith::add),
                Op::Sub(d, a, b) => arith!(d, a, &at!(b), checked_sub, arith::sub),
                Op::Mul(d, a, b) => arith!(d, a, &at!(b), checked_mul, arith::mul),
                Op::Div(d, a, b) => set!(d, try_op!(arith::div(&at!(a), &at!(b)))),
                Op::AddInt(d, a, i) => arith!(d, a, &Value::int(i.into()), checked_add, arith::add),
                Op::Less(d, a, b) => set!(d, Value::bool(compare!(a, &at!(b), <, arith::less))),
                Op::LessEq(d, a, b) => set!(d, Value::bool(compare!(a, &at!(b), <=, arith::less_eq))),
                Op::NumEq(d, a, b) => set!(d, Value::bool(compare!(a, &at!(b), ==, arith::num_eq))),
                Op::Not(d, a) => set!(d, Value::bool(!at!(a).is_true())),
                Op::IsNil(d, a) => set!(d, Value::bool(at!(a).is_nil())),
                Op::Identical(d, a, b) => set!(d, Value::bool(at!(a).identical(&at!(b)))),
                Op::Cons(d, a, b) => set!(d, Value::cons(at!(a).clone(), at!(b).clone())),
                Op::First(d, a) => match at!(a).as_pair() {
                    Some((first, _)) => set!(d, first.clone()),
                    None if at!(a).is_stream() => break 'window Out::Slow(op),
                    None => set!(d, try_op!(end_of_list(&at!(a)))),
                },
                Op::Rest(d, a) => match at!(a).as_pair() {
                    Some((_, rest)) => set!(d, rest.clone()),
                    None if at!(a).is_stream() => break 'window Out::Slow(op),
                    None => set!(d, try_op!(end_of_list(&at!(a)))),
                },
                Op::Closure(d, s, f) => {
                    let captures = program.functions[f.at()].captures as usize;
                    let captured = w[s as usize..].iter().take(captures).cloned().collect();
                    set!(d, Value::new(Obj::Closure(f, captured)));
                }

                Op::BeginCleanUp => cleanups.push(CleanUp::begin(
                    frames.len(),
                    run.now,
                    cleanups.last(),
                    tasks.get(task).limit(),
                )),
                Op::Jump(t) => jump!(t),
                Op::Loop(t) => {
                    burn!();
                    jump!(t);
                }
                Op::JumpIfFalse(a, t) => {
                    if !at!(a).is_true() {
                        jump!(t)
                    }
                }
                Op::JumpIfTrue(a, t) => {
                    if at!(a).is_true() {
                        jump!(t)
                    }
                }
                Op::JumpIfNil(a, t) => {
                    if at!(a).is_nil() {
                        jump!(t)
                    }
                }
                Op::JumpUnlessNil(a, t) => {
                    if !at!(a).is_nil() {
                        jump!(t)
                    }
                }
                Op::JumpUnlessLess(a, b, t) => {
                    if !compare!(a, &at!(b), <, arith::less) {
                        jump!(t)
                    }
                }
                Op::JumpUnlessLessEq(a, b, t) => {
                    if !compare!(a, &at!(b), <=, arith::less_eq) {
                        jump!(t)
                    }
                }
                Op::JumpUnlessNumEq(a, b, t) => {
                    if !compare!(a, &at!(b), ==, arith::num_eq) {
                        jump!(t)
                    }
                }
                Op::JumpIfNumEq(a, b, t) => {
                    if compare!(a, &at!(b), ==, arith::num_eq) {
                        jump!(t)
                    }
                }
                Op::JumpUnlessLessInt(a, i, t) => {
                    if !compare_int!(a, i, <) {
                        jump!(t)
                    }
                }
                Op::JumpUnlessLessEqInt(a, i, t) => {
                    if !compare_int!(a, i, <=) {
                        jump!(t)
                    }
                }
                Op::JumpUnlessMoreInt(a, i, t) => {
                    if !compare_int!(a, i, >) {
                        jump!(t)
                    }
                }
                Op::JumpUnlessMoreEqInt(a, i, t) => {
                    if !compare_int!(a, i, >=) {
                        jump!(t)
                    }
                }
                Op::JumpUnlessEqInt(a, i, t) => {
                    if !compare_int!(a, i, ==) {
                        jump!(t)
                    }
                }
                Op::JumpIfSet(a, t) => {
                    if !at!(a).is_unset() {
                        jump!(t)
                    }
                }
                Op::JumpUnlessConst(a, k, t) => {
                    let constant = &program.constants[k.0 as usize];
                    let same = at!(a).identical(constant)
                        || crate::value::equal(&at!(a), constant, crate::value::COMPARE_LIMIT) == Some(true);
                    if !same {
                        jump!(t)
                    }
                }

                Op::IterNext(d, t) => match at!(d.wrapping_add(1)).as_pair() {
                    Some((first, rest)) => {
                        let (first, rest) = (first.clone(), rest.clone());
                        set!(d, first);
                        set!(d.wrapping_add(1), rest);
                    }
                    // The answers of a query are walked over one by one, too.
                    None if at!(d.wrapping_add(1)).is_stream() => break 'window Out::Slow(op),
                    None => {
                        try_op!(end_of_list(&at!(d.wrapping_add(1))));
                        jump!(t);
                    }
                },

                Op::Call(d, window, f) => {
                    burn!();
                    push!(d);
                    base += window as usize;
                    pc = program.functions[f.at()].entry.at();
                    continue 'window;
                }
                Op::CallPlan(d, window, s) => {
                    let site = &program.sites[s.at()];
                    let Some(chain) = chain_of(site.counted, &site.rounds, w) else {
                        break 'window Out::Slow(op);
                    };
                    if here.0 & MEMO != 0 || run.traced || tree.record(RecId(here.0)).flags & COUNTED != 0 {
                        break 'window Out::Slow(op);
                    }
                    // Before the slot is looked up: the cursor must not move twice for one call.
                    if fuel == 0 {
                        pc -= 1;
                        break 'window Out::Fuel;
                    }
                    let Some(callee) = site.callee else { break 'window Out::Slow(op) };
                    let slot = tree.child(RecId(here.0), Key { site: s, chain }, site.name, site.hash);
                    let args = w[window as usize..].split_at_mut(site.args as usize).0;
                    let is_edited = !tree.edits_of(slot).is_empty();
                    if is_edited && !only_changes_params(program, tree, slot, callee, args) {
                        fuel -= 1;
                        break 'window Out::Edited(op, slot);
                    }
                    fuel -= 1;
                    push!(d);
                    let rec = tree.enter(RecId(here.0), slot, NodeKind::Plan, args, run.now);
                    if is_edited {
                        change_params(program, tree, (rec, slot), callee, args);
                    }
                    here = Here(rec.0);
                    base += window as usize;
                    pc = program.functions[callee.at()].entry.at();
                    continue 'window;
                }
                Op::CallValue(d, window, n, _) => {
                    let Some((entry, closure)) = plain_callee(program, &at!(window), n.0) else {
                        break 'window Out::Slow(op);
                    };
                    burn!();
                    push!(d);
                    capture(&mut w[window as usize + 1 + n.0 as usize..], closure);
                    base += window as usize + 1;
                    pc = entry;
                    continue 'window;
                }
                Op::TailCall(window, n, f) => {
                    if OWES && obligations.iter().any(|it| it.holder == (task, frames.len())) {
                        // The frame must stay until what it owes is done.
                        break 'window Out::Slow(op);
                    }
                    burn!();
                    for i in 0..n.0 {
                        w.swap(i as usize, window.wrapping_add(i) as usize);
                    }
                    pc = program.functions[f.at()].entry.at();
                }
                Op::TailCallValue(window, n, _) => {
                    if OWES && obligations.iter().any(|it| it.holder == (task, frames.len())) {
                        break 'window Out::Slow(op);
                    }
                    let Some((entry, closure)) = plain_callee(program, &at!(window), n.0) else {
                        break 'window Out::Slow(op);
                    };
                    burn!();
                    for i in 0..n.0 {
                        w.swap(i as usize, window.wrapping_add(1 + i) as usize);
                    }
                    capture(&mut w[n.0 as usize..], closure);
                    pc = entry;
                }
                Op::Return(a) => match frames.pop() {
                    Some(frame) => {
                        let to = frame.base as usize + frame.dst as usize;
                        stack.swap(base + a as usize, to);
                        (pc, base, here) = (frame.pc as usize, frame.base as usize, frame.here);
                        continue 'window;
                    }
                    None => break 'window Out::Done(std::mem::take(&mut at!(a))),
                },
                Op::ReturnPlan(a) => {
                    if here.0 & MEMO != 0 || run.traced || !occurrences.is_empty() {
                        break 'window Out::Slow(op);
                    }
                    let value = std::mem::take(&mut at!(a));
                    let rec = RecId(here.0);
                    if tree.record(rec).flags & DRIVEN == 0 {
                        tree.end(rec, Status::Succeeded, value.clone(), run.now);
                    }
                    match frames.pop() {
                        Some(frame) => {
                            (pc, base, here) = (frame.pc as usize, frame.base as usize, frame.here);
                            stack[base + frame.dst as usize] = value;
                            continue 'window;
                        }
                        None => break 'window Out::Done(value),
                    }
                }

                Op::List(..)
                | Op::Vector(..)
                | Op::Map(..)
                | Op::Desc(..)
                | Op::Counter(..)
                | Op::CountDown(..)
                | Op::IterStart(..)
                | Op::CountStart(..)
                | Op::CallNative(..)
                | Op::Perform(..)
                | Op::Original(..)
                | Op::Fail(..)
                | Op::Raise(..)
                | Op::MakeFailure(..)
                | Op::JumpUnlessKind(..)
                | Op::Mark(..)
                | Op::Retry(..)
                | Op::Fork(..)
                | Op::EndCleanUp(..)
                | Op::Resume => break 'window Out::Slow(op),
            }
        }
    };
    (run.pc, run.base, run.here) = (pc as u32, base as u32, here);
    *left = fuel;
    out
}

/// True if the edits at the slot of a call only change its parameters.
#[inline(never)]
fn only_changes_params(program: &Program, tree: &Tree, slot: SlotId, callee: FnId, args: &[Value]) -> bool {
    Edited { program, tree, slot, body: Body::Plan(callee) }.only_changes_params(args)
}

/// Changes the parameters of a call that has a record as the edits at its slot say.
#[inline(never)]
pub(super) fn change_params(
    program: &Program,
    tree: &mut Tree,
    (rec, slot): (RecId, SlotId),
    callee: FnId,
    args: &mut [Value],
) {
    Edited { program, tree, slot, body: Body::Plan(callee) }.change_params(args);
    let is_as_written = |(at, arg): (u8, &Value)| tree.arg(rec, at).is_some_and(|it| it.identical(arg));
    if !(0..).zip(args.iter()).all(is_as_written) {
        tree.change_args(rec, args);
    }
}

/// The chain of a call directly in a plan, where it is plain to see.
#[inline(always)]
fn chain_of(counted: bool, rounds: &[RoundKey], w: &[Value; 256]) -> Option<Chain> {
    match rounds {
        _ if counted => None,
        [] => Some(Chain::EMPTY),
        [RoundKey::Count(register)] => Chain::round(w[*register as usize].as_int()?),
        _ => None,
    }
}

/// Entry of a function that can be entered with `n` arguments as they are, and its closure.
#[inline(always)]
fn plain_callee(program: &Program, callee: &Value, n: u8) -> Option<(usize, Option<Rc<Obj>>)> {
    let (id, closure) = match callee {
        Value::Imm(Imm::Function(id)) => (*id, None),
        Value::Obj(obj) => match &**obj {
            Obj::Closure(id, _) => (*id, Some(obj.clone())),
            _ => return None,
        },
        Value::Imm(_) => return None,
    };
    let function = &program.functions[id.at()];
    let plain =
        matches!(function.kind, FnKind::Function | FnKind::Lambda) && function.params.is_plain(n as usize);
    plain.then_some((function.entry.at(), closure))
}

/// Puts the captured values of a closure into the registers from the first of `registers`.
#[inline(always)]
fn capture(registers: &mut [Value], closure: Option<Rc<Obj>>) {
    if let Some(closure) = closure
        && let Obj::Closure(_, captured) = &*closure
    {
        for (register, value) in registers.iter_mut().zip(captured) {
            *register = value.clone();
        }
    }
}

/// nil has no elements; anything else that is not a cell is no list.
#[cold]
fn end_of_list(value: &Value) -> Result<Value, Raise> {
    if value.is_nil() { Ok(Value::NIL) } else { Err(crate::native::type_error("a list", value)) }
}
