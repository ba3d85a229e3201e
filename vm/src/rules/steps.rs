//! The loop: one instruction of a clause after another.

use crate::arith;
use crate::code::{FnId, Program};
use crate::failure::{Builtin, Failure};
use crate::native::Raise;
use crate::value::{Imm, Value};

use super::Rules;
use super::call::Frame;
use super::choice::Alternative;
use super::collect::{Collecting, Groups};
use super::engine::{Engine, Step, WINDOW, too_large};
use super::native::{Call, Found};
use super::op::{Part, RuleOp};
use super::store::Cell;

/// Why the loop was left.
pub(super) enum Out {
    Step(Step),
    /// The registers are at their end.
    Grow,
    /// There may be garbage.
    Collect,
}

impl Engine {
    /// Does instructions until something has to be done outside of them.
    pub(super) fn steps(&mut self, program: &Program, fuel: &mut u64) -> Result<Out, Raise> {
        let rules: &Rules = &program.rules;
        let code: &[RuleOp] = &rules.code;
        // Calls of plain predicates need no look at anything but their clauses.
        let direct = self.view.scoped.is_empty() && self.trace.is_none();
        'window: loop {
            let (mut pc, base) = (self.pc as usize, self.base as usize);
            let Some(w) = self.stack.get_mut(base..).and_then(|above| above.first_chunk_mut::<WINDOW>())
            else {
                return Ok(Out::Grow);
            };
            let store = &mut self.store;
            macro_rules! at {
                ($r:expr) => {
                    w[$r as usize]
                };
            }
            macro_rules! fail {
                () => {{
                    self.pc = pc as u32;
                    break;
                }};
            }
            macro_rules! holds {
                ($it:expr) => {
                    if !$it.map_err(too_large)? {
                        fail!()
                    }
                };
            }
            // A part of a cell of a list that is at `at`.
            macro_rules! look {
                ($part:expr, $at:expr) => {
                    match $part {
                        Part::First(r) => at!(r) = store.heap[$at as usize],
                        Part::Same(r) => holds!(store.unify(at!(r), store.heap[$at as usize])),
                        Part::Nil => holds!(store.unify(Cell::NIL, store.heap[$at as usize])),
                        Part::Any => {}
                    }
                };
            }
            // What register r holds; a list or structure from outside comes on the heap.
            macro_rules! opened {
                ($r:expr) => {{
                    let cell = store.deref(at!($r));
                    if let Cell::Obj(_) = cell { store.open(cell) } else { cell }
                }};
            }
            // A part of a cell of a list that is made at `at`.
            macro_rules! make {
                ($part:expr, $at:expr) => {
                    match $part {
                        Part::Any => Cell::Ref($at),
                        Part::First(r) => {
                            at!(r) = Cell::Ref($at);
                            at!(r)
                        }
                        Part::Same(r) => at!(r),
                        Part::Nil => Cell::NIL,
                    }
                };
            }
            macro_rules! make_pair {
                ($first:expr, $rest:expr) => {{
                    let at = store.heap.len() as u32;
                    let first = make!($first, at);
                    let rest = make!($rest, at + 1);
                    store.pair(first, rest)
                }};
            }
            // Fails if the variable at `var` is part of what register r holds.
            macro_rules! without {
                ($var:expr, $r:expr) => {{
                    let inside = store.deref(at!($r));
                    match inside {
                        Cell::Ref(it) if it == $var => fail!(),
                        Cell::Pair(_) | Cell::Struct(_)
                            if store.occurs($var, inside).map_err(too_large)? =>
                        {
                            fail!()
                        }
                        _ => {}
                    }
                }};
            }
            macro_rules! number {
                ($r:expr) => {{
                    match store.deref(at!($r)) {
                        Cell::Imm(imm) => imm,
                        other => {
                            self.pc = pc as u32;
                            return Err(self.no_number(other));
                        }
                    }
                }};
            }
            macro_rules! arith {
                ($d:expr, $a:expr, $b:expr, $checked:ident, $slow:path) => {{
                    let (a, b) = (number!($a), number!($b));
                    let fast = match (a, b) {
                        (Imm::Int(a), Imm::Int(b)) => a.$checked(b),
                        _ => None,
                    };
                    at!($d) = match fast {
                        Some(it) => Cell::int(it),
                        None => {
                            self.pc = pc as u32;
                            cell_of($slow(&Value::Imm(a), &Value::Imm(b))?)
                        }
                    };
                }};
            }
            macro_rules! compare {
                ($a:expr, $b:expr, $op:tt, $slow:path) => {{
                    let holds = match (number!($a), number!($b)) {
                        (Imm::Int(a), Imm::Int(b)) => a $op b,
                        (a, b) => {
                            self.pc = pc as u32;
                            $slow(&Value::Imm(a), &Value::Imm(b))?
                        }
                    };
                    if !holds {
                        fail!()
                    }
                }};
            }
            macro_rules! before_call {
                () => {{
                    if *fuel == 0 || store.heap.len() >= self.collect_at {
                        self.pc = pc as u32 - 1;
                        return Ok(if *fuel == 0 { Out::Step(Step::Fuel) } else { Out::Collect });
                    }
                    *fuel -= 1;
                }};
            }
            loop {
                let op = code[pc];
                pc += 1;
                match op {
                    RuleOp::GetNil(a) => match store.deref(at!(a)) {
                        Cell::Imm(Imm::Nil) => {}
                        Cell::Ref(at) => store.bind(at, Cell::NIL),
                        _ => fail!(),
                    },
                    RuleOp::GetConst(a, k) => match (store.deref(at!(a)), rules.cells[k.0 as usize]) {
                        (Cell::Imm(a), Cell::Imm(b)) => {
                            if !super::store::same_imm(&a, &b) {
                                fail!()
                            }
                        }
                        (Cell::Ref(at), constant) => store.bind(at, constant),
                        (a, constant) => holds!(store.unify(a, constant)),
                    },
                    RuleOp::GetPair(a, first, rest) => {
                        match opened!(a) {
                            Cell::Pair(pair) => {
                                look!(first, pair);
                                look!(rest, pair + 1);
                            }
                            Cell::Ref(var) => {
                                // What goes into the cell must not have the variable in it.
                                if let Part::Same(r) = first {
                                    without!(var, r);
                                }
                                // In `(?x . ?x)` the second one is what the first will be.
                                if let Part::Same(r) = rest
                                    && first != Part::First(r)
                                {
                                    without!(var, r);
                                }
                                let pair = make_pair!(first, rest);
                                store.bind(var, pair);
                            }
                            _ => fail!(),
                        }
                    }
                    RuleOp::GetParts(a, first, rest) => match opened!(a) {
                        Cell::Pair(pair) => {
                            [at!(first), at!(rest)] = store.pair_at(pair);
                        }
                        Cell::Ref(var) => {
                            let at = store.heap.len() as u32;
                            (at!(first), at!(rest)) = (Cell::Ref(at), Cell::Ref(at + 1));
                            let pair = store.pair(at!(first), at!(rest));
                            store.bind(var, pair);
                        }
                        _ => fail!(),
                    },
                    RuleOp::GetRest(a, first, rest) => match opened!(a) {
                        Cell::Ref(var) => {
                            without!(var, first);
                            let at = store.heap.len() as u32;
                            let pair = store.pair(at!(first), Cell::Ref(at + 1));
                            at!(rest) = Cell::Ref(at + 1);
                            store.bind(var, pair);
                        }
                        Cell::Pair(pair) => {
                            let [head, tail] = store.pair_at(pair);
                            holds!(store.unify(at!(first), head));
                            at!(rest) = tail;
                        }
                        _ => fail!(),
                    },
                    RuleOp::GetStruct(a, s, t) => {
                        let template = &rules.templates[t.0 as usize];
                        let cell = store.open(at!(a));
                        let holds = match cell {
                            Cell::Struct(at) => {
                                super::structure::take_apart(store, at, template, &mut w[s as usize..])
                            }
                            Cell::Ref(var) => {
                                let values = &mut w[s as usize..][..template.values as usize];
                                values.iter_mut().for_each(|value| *value = store.fresh());
                                let made = super::structure::make(store, template, &w[s as usize..]);
                                store.bind(var, made);
                                true
                            }
                            _ => false,
                        };
                        if !holds {
                            fail!()
                        }
                    }
                    RuleOp::Unify(a, b) => holds!(store.unify(at!(a), at!(b))),
                    RuleOp::Identical(a, b) => holds!(store.identical(at!(a), at!(b))),
                    RuleOp::Matches(a, b) => holds!(store.matches(at!(a), at!(b))),
                    RuleOp::Less(a, b) => compare!(a, b, <, arith::less),
                    RuleOp::LessEq(a, b) => compare!(a, b, <=, arith::less_eq),
                    RuleOp::NumEq(a, b) => compare!(a, b, ==, arith::num_eq),
                    RuleOp::NumNe(a, b) => compare!(a, b, !=, num_ne),
                    RuleOp::NeedsBound(a, k) => {
                        if let Cell::Ref(_) = store.deref(at!(a)) {
                            self.pc = pc as u32;
                            return Err(floundering(&rules.constants[k.0 as usize]));
                        }
                    }

                    RuleOp::Fresh(d) => at!(d) = store.fresh(),
                    RuleOp::Move(d, s) => at!(d) = at!(s),
                    RuleOp::PutConst(d, k) => at!(d) = rules.cells[k.0 as usize],
                    RuleOp::PutPair(d, first, rest) => at!(d) = make_pair!(first, rest),
                    RuleOp::PutStruct(d, s, t) => {
                        let template = &rules.templates[t.0 as usize];
                        at!(d) = super::structure::make(store, template, &w[s as usize..]);
                    }
                    RuleOp::Add(d, a, b) => arith!(d, a, b, checked_add, arith::add),
                    RuleOp::Sub(d, a, b) => arith!(d, a, b, checked_sub, arith::sub),
                    RuleOp::Mul(d, a, b) => arith!(d, a, b, checked_mul, arith::mul),
                    RuleOp::Div(d, a, b) => arith!(d, a, b, checked_exact_div, arith::div),
                    RuleOp::AddInt(d, a, i) => {
                        let a = number!(a);
                        let fast = if let Imm::Int(a) = a { a.checked_add(i.into()) } else { None };
                        at!(d) = match fast {
                            Some(it) => Cell::int(it),
                            None => {
                                self.pc = pc as u32;
                                cell_of(arith::add(&Value::Imm(a), &Value::int(i.into()))?)
                            }
                        };
                    }

                    RuleOp::Call(window, n, predicate) => {
                        before_call!();
                        // The frame goes above all that a choice needs.
                        let at = (self.frame + 1).max(self.frames_top);
                        self.frames.truncate(at as usize);
                        self.frames.push(Frame { parent: self.frame, pc: pc as u32, base: base as u32 });
                        self.frame = at;
                        let above = (base as u32 + u32::from(n)).max(self.top);
                        let callee = &rules.predicates[predicate.at()];
                        self.move_args(base + window as usize, above as usize, callee.declared.arity.into());
                        self.base = above;
                        self.pc = pc as u32;
                        if !(direct && callee.is_plain) {
                            if let Some(trace) = &mut self.trace {
                                trace.begin(self.frame);
                            }
                            if !self.call_predicate(program, predicate, above)? {
                                break;
                            }
                        } else if !self.enter_clauses(rules, predicate) {
                            break;
                        }
                        continue 'window;
                    }
                    RuleOp::CallNative(window, predicate) => {
                        before_call!();
                        let it = &rules.predicates[predicate.at()];
                        let arity = it.declared.arity;
                        let args = &w[window as usize..][..usize::from(arity)];
                        self.pc = pc as u32;
                        if let (Some(native), None) = (it.native, &self.trace) {
                            let mut call = Call::new(program, store, args, &self.view);
                            match native(&mut call)? {
                                Found::Yes => continue,
                                Found::No => break,
                                Found::Many(alternatives) => {
                                    self.frame_for_goal(base as u32, window, arity.into());
                                    let more = Alternative::Native(alternatives);
                                    self.push_choice(self.base.max(self.top), arity, more);
                                }
                            }
                            break;
                        }
                        self.frame_for_goal(base as u32, window, arity.into());
                        if let Some(trace) = &mut self.trace {
                            trace.begin(self.frame);
                        }
                        if !self.call_predicate(program, predicate, self.base)? {
                            break;
                        }
                        continue 'window;
                    }
                    RuleOp::Execute(window, predicate) => {
                        before_call!();
                        let n = usize::from(rules.predicates[predicate.at()].declared.arity);
                        if self.top <= base as u32 {
                            for i in 0..n {
                                w[i] = w[(window as usize + i) & 255];
                            }
                        } else {
                            let above = (base as u32 + u32::from(window)).max(self.top);
                            self.move_args(base + window as usize, above as usize, n);
                            self.base = above;
                        }
                        self.pc = pc as u32;
                        if !self.enter(program, predicate)? {
                            break;
                        }
                        continue 'window;
                    }
                    RuleOp::ExecuteHere(predicate) => {
                        before_call!();
                        let callee = &rules.predicates[predicate.at()];
                        if direct && callee.is_plain {
                            // The arguments stand in this window already.
                            let found = callee.index.select(store, w);
                            self.entry = self.choices.len() as u32;
                            if found.count() == 1 {
                                // Where the engine is, should the clause meet a limit.
                                self.pc = found.first.0;
                                pc = found.first.at();
                                continue;
                            }
                            self.pc = pc as u32;
                            if !self.take_clauses(found, callee.declared.arity) {
                                break;
                            }
                            continue 'window;
                        }
                        self.pc = pc as u32;
                        if !self.enter(program, predicate)? {
                            break;
                        }
                        continue 'window;
                    }
                    RuleOp::CallValue(window, n, most, scope) => {
                        before_call!();
                        self.pc = pc as u32;
                        if !self.call_value(program, (window, n), most, scope)? {
                            break;
                        }
                        continue 'window;
                    }
                    RuleOp::CallFun(d, window, n, function) => {
                        let (mut args, mut vars) = (Vec::with_capacity(n.into()), Vec::new());
                        for i in 0..usize::from(n) {
                            let cell = w[(window as usize + i) & 255];
                            args.push(store.export_with(cell, &self.view, &mut vars).map_err(too_large)?);
                        }
                        self.pc = pc as u32;
                        if !vars.is_empty() {
                            return Err(no_value(program, function));
                        }
                        self.result = base as u32 + u32::from(d);
                        return Ok(Out::Step(Step::Call(function, args)));
                    }
                    RuleOp::Proceed => {
                        let frame = self.frames[self.frame as usize];
                        if let Some(trace) = &mut self.trace {
                            trace.leave(self.frame);
                        }
                        (self.pc, self.base, self.frame) = (frame.pc, frame.base, frame.parent);
                        continue 'window;
                    }
                    RuleOp::Answer => {
                        self.pc = pc as u32;
                        return Ok(Out::Step(Step::Answer));
                    }
                    RuleOp::TableAnswer => {
                        let (table, args) = (at!(0), store.deref(at!(1)));
                        self.pc = pc as u32;
                        self.table_answer(table, args)?;
                        break;
                    }
                    RuleOp::Fail => fail!(),
                    RuleOp::Tick(n) => {
                        let n = n as usize;
                        if self.ticks.len() <= n {
                            self.ticks.resize(n + 1, 0);
                        }
                        self.ticks[n] += 1;
                    }

                    RuleOp::Jump(t) => pc = t.0 as usize,
                    RuleOp::Try(n, t) => {
                        let top = (base as u32 + u32::from(n)).max(self.top);
                        self.pc = pc as u32;
                        self.push_choice(top, 0, Alternative::Code(t));
                        continue 'window;
                    }
                    RuleOp::Entry(d) => at!(d) = Cell::int(self.entry.into()),
                    RuleOp::Choices(d) => at!(d) = Cell::int(self.choices.len() as i64),
                    RuleOp::Cut(a) => {
                        if let Cell::Imm(Imm::Int(n)) = at!(a)
                            && (n as usize) < self.choices.len()
                        {
                            self.pc = pc as u32;
                            self.cut_to(n as usize);
                            continue 'window;
                        }
                    }
                    RuleOp::Close(a) => {
                        if let Cell::Imm(Imm::Int(n)) = at!(a)
                            && let Some(choice) = self.choices.get_mut(n as usize)
                        {
                            choice.alternative = Alternative::None;
                        }
                    }

                    RuleOp::Collect(d, kind) => {
                        at!(d) = Cell::int(self.collecting.len() as i64);
                        self.collecting.push(Collecting::new(kind));
                    }
                    RuleOp::Add1(d, s) => {
                        let (d, s) = (at!(d), at!(s));
                        if let Cell::Imm(Imm::Int(n)) = d
                            && let Some(collecting) = self.collecting.get_mut(n as usize)
                        {
                            collecting.add(store, s, &self.view).map_err(too_large)?;
                        }
                    }
                    RuleOp::Collected(d) => {
                        let Cell::Imm(Imm::Int(n)) = at!(d) else { fail!() };
                        let Some(collecting) = self.collecting.get_mut(n as usize) else { fail!() };
                        let result = collecting.finish(store).map_err(too_large)?;
                        self.collecting.truncate(n as usize);
                        match result {
                            Some(cell) => at!(d) = cell,
                            None => fail!(),
                        }
                    }
                    RuleOp::Groups(window, set) => {
                        self.pc = pc as u32;
                        let groups =
                            Groups::new(store, at!(window), at!(window + 1), set, pc as u32, &self.view)
                                .map_err(too_large)?;
                        self.push_choice(
                            (base as u32 + WINDOW as u32).max(self.top),
                            0,
                            Alternative::Groups(window, Box::new(groups)),
                        );
                        break;
                    }
                }
            }
            // The goal does not hold.
            if let Some(end) = self.back_or_stop(program, fuel)? {
                return Ok(Out::Step(end));
            }
        }
    }

    fn no_number(&self, cell: Cell) -> Raise {
        match cell {
            Cell::Ref(_) => Box::new(Failure::new(
                Builtin::UnboundVariable,
                "a variable in arithmetic has no value yet: put the goal that gives it one before",
            )),
            other => match self.store.export(other, &self.view) {
                Ok(value) => crate::native::type_error("a number", &value),
                Err(it) => too_large(it),
            },
        }
    }
}

fn cell_of(value: Value) -> Cell {
    match value {
        Value::Imm(imm) => Cell::Imm(imm),
        Value::Obj(_) => Cell::NIL,
    }
}

fn num_ne(a: &Value, b: &Value) -> Result<bool, Raise> {
    arith::num_eq(a, b).map(|equal| !equal)
}

/// Integers that divide exactly.
trait ExactDiv: Sized {
    fn checked_exact_div(self, other: Self) -> Option<Self>;
}
impl ExactDiv for i64 {
    fn checked_exact_div(self, other: i64) -> Option<i64> {
        if self.checked_rem(other)? == 0 { Some(self / other) } else { None }
    }
}

fn no_value(program: &Program, function: FnId) -> Raise {
    let name = program.functions.get(function.at()).map_or("a function", |it| it.name.as_str());
    let name = if name.starts_with('%') { "an expression" } else { name };
    let message = format!(
        "a variable that `{name}` is computed from has no value yet: put the goal that gives it one before"
    );
    Box::new(Failure::new(Builtin::UnboundVariable, message))
}

fn floundering(var: &Value) -> Raise {
    let name = crate::print::brief(var);
    let message =
        format!("`{name}` has no value where its negation is asked: a goal before must give it one");
    Box::new(Failure::with(
        Builtin::Floundering,
        vec![("message", Value::str(message)), ("variable", var.clone())],
    ))
}
