//! A join that is being answered.
//!
//! The answers come as if the goals had been asked one after another as they are written. Each goal gives
//! tasks in the order of the tree, and each once, so that is the order of the tuples of those tasks that are
//! looked for, in the order in which the goals look for them. So a run may look for them in another order if it
//! sorts. It keeps the first, and sorts what it finds for each of its tasks: the first answer comes at once.
//!
//! Invariant: a run does a bounded number of steps before it lets the engine look at its fuel.

use std::cell::Cell as Counter;
use std::rc::Rc;

use crate::native::Raise;
use crate::value::{Imm, Value};

use super::super::native::{Alternatives, Call, Found};
use super::super::store::Cell;
use super::super::tree::{TaskArg, task_arg};
use super::super::view::{NONE, TreeView};
use super::order::{Order, UNKNOWN, WIDTH, known};
use super::steps::{Cursor, Op, Source, Step, Work};
use super::{Sort, Var, bit};

/// Steps between two looks at the fuel.
const STRETCH: u32 = 256;
/// Rows that are sorted at most; where there are more, tasks are looked for in the order that is written.
const MOST_ROWS: usize = 1 << 18;

/// A join that is being answered.
struct Run {
    order: Rc<Order>,
    given: u64,
    regs: Vec<u32>,
    cursors: Vec<Cursor>,
    at: usize,
    forward: bool,
    rows: Vec<[u32; WIDTH]>,
    next_row: usize,
    collecting: bool,
    /// Answers that have been given, and those that are to be left out.
    given_out: u64,
    left_out: u64,
    /// The registers are an answer that nobody has taken.
    is_ready: bool,
    is_busy: bool,
}

/// What a stretch of steps has come to.
#[derive(PartialEq)]
enum Came {
    Answer,
    End,
    Later,
}

impl Run {
    /// Goes on for a stretch.
    fn go(&mut self, view: &TreeView) -> Came {
        let order = self.order.clone();
        let work = Work { view, join: &order.join, columns: &order.columns, spent: Counter::new(0) };
        let mut left = STRETCH;
        loop {
            if let Some(row) = self.rows.get(self.next_row).filter(|_| !self.collecting) {
                for (var, number) in order.row.iter().zip(row) {
                    self.regs[*var as usize] = *number;
                }
                self.next_row += 1;
                return Came::Answer;
            }
            if left == 0 {
                return Came::Later;
            }
            left = (left - 1).saturating_sub(work.spent.take());
            if !self.forward {
                // The last step before this one that looks for tasks has more, or the one before that.
                let back = order.steps.get(self.at).map_or_else(|| last_find(&order.steps), |step| step.back);
                if self.collecting && back <= order.sorted_from {
                    self.collecting = false;
                    self.rows.sort_unstable();
                    self.next_row = 0;
                    self.at = order.sorted_from;
                    continue;
                }
                let Some(at) = back.checked_sub(1) else { return Came::End };
                let step = &order.steps[at];
                self.at = at;
                if let Op::Find(var, source) = &step.op
                    && let Some(task) = work.next(source, &mut self.cursors[at])
                {
                    self.regs[*var as usize] = task;
                    step.held.set(step.held.get() + 1);
                    (self.at, self.forward) = (at + 1, true);
                }
                continue;
            }
            if self.at == order.sorted_from && !self.collecting && self.at < order.steps.len() {
                self.collecting = true;
                self.rows.clear();
                self.next_row = 0;
            }
            let Some(step) = order.steps.get(self.at) else {
                self.forward = false;
                if !self.collecting {
                    return Came::Answer;
                }
                if self.rows.len() == MOST_ROWS {
                    self.begin_as_written(view);
                    return Came::Later;
                }
                let mut row = [0; WIDTH];
                for (cell, var) in row.iter_mut().zip(&order.row) {
                    *cell = self.regs[*var as usize];
                }
                self.rows.push(row);
                continue;
            };
            match &step.op {
                Op::Find(_, source) => {
                    work.open(source, &self.regs, &mut self.cursors[self.at]);
                    // It is the last one before the step after it.
                    self.at += 1;
                    self.forward = false;
                    if let Some(task) = work.next(source, &mut self.cursors[self.at - 1])
                        && let Op::Find(var, _) = &step.op
                    {
                        self.regs[*var as usize] = task;
                        step.held.set(step.held.get() + 1);
                        self.forward = true;
                    } else {
                        self.at -= 1;
                    }
                }
                op => match work.holds(op, &mut self.regs) {
                    true => {
                        step.held.set(step.held.get() + 1);
                        self.at += 1;
                    }
                    false => self.forward = false,
                },
            }
        }
    }

    /// Begins once more, in the order that is written: nothing has to be kept for that.
    fn begin_as_written(&mut self, view: &TreeView) {
        self.order = Rc::new(Order::as_written(&self.order.join, view, self.given));
        self.cursors = self.order.steps.iter().map(|_| Cursor::default()).collect();
        (self.rows, self.next_row, self.collecting) = (Vec::new(), 0, false);
        (self.at, self.forward) = (0, true);
        (self.left_out, self.given_out) = (self.given_out, 0);
    }

    /// The same, until there is an answer that has not been given.
    fn go_on(&mut self, view: &TreeView) -> Came {
        loop {
            let came = self.go(view);
            if came != Came::Answer {
                return came;
            }
            self.given_out += 1;
            if self.left_out == 0 {
                return came;
            }
            self.left_out -= 1;
        }
    }

    /// True if there may be more answers.
    fn has_more(&self) -> bool {
        let steps = self.order.steps.iter().zip(&self.cursors).take(self.order.sorted_from);
        let may_go_on = |(step, cursor): (&Step, &Cursor)| match &step.op {
            Op::Find(_, Source::Having(..) | Source::Below(_, Some(_))) => !cursor.list.is_empty(),
            Op::Find(_, Source::Above(_)) => !cursor.above.is_empty(),
            Op::Find(..) => cursor.next < cursor.end,
            _ => false,
        };
        self.next_row < self.rows.len() || steps.into_iter().any(may_go_on)
    }

    /// The answer goes to the arguments of the call.
    fn bind(&self, call: &mut Call<'_>) -> Result<bool, Raise> {
        let join = &self.order.join;
        for var in 0..join.args {
            let number = self.regs[var];
            let holds = match join.vars[var] {
                _ if self.given & bit(var as Var) != 0 => true,
                Sort::Task => call.unify(var + 1, Cell::Task(number))?,
                _ => call.unify_value(var + 1, &call.view.tree.value_of(number))?,
            };
            if !holds {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

fn last_find(steps: &[Step]) -> usize {
    match steps.last() {
        Some(Step { op: Op::Find(..), .. }) => steps.len(),
        Some(step) => step.back,
        None => 0,
    }
}

impl Alternatives for Run {
    fn next(&mut self, call: &mut Call<'_>) -> Result<Option<bool>, Raise> {
        loop {
            if !std::mem::take(&mut self.is_ready) {
                let came = self.go_on(&call.view.tree);
                self.is_busy = came == Came::Later;
                if came != Came::Answer {
                    return Ok(None);
                }
            }
            let mark = call.store.mark();
            if self.bind(call)? {
                return Ok(Some(self.has_more()));
            }
            call.store.back_to(mark);
        }
    }

    fn is_busy(&self) -> bool {
        self.is_busy
    }
}

/// `(%join number variable …)`
pub fn call(call: &mut Call<'_>) -> Result<Found, Raise> {
    let Cell::Imm(Imm::Int(number)) = call.arg(0) else { return Ok(Found::No) };
    let Some(join) = call.program.rules.joins.get(number as usize) else { return Ok(Found::No) };
    let view = call.view.tree.clone();
    if view.is_empty() {
        return Ok(Found::No);
    }
    let mut given = 0;
    let mut regs = vec![NONE; join.vars.len()];
    for (var, sort) in join.vars[..join.args].iter().enumerate() {
        let is_given = match sort {
            Sort::Task => match task_arg(call, var + 1) {
                TaskArg::Free => false,
                TaskArg::Task(task) => {
                    regs[var] = task;
                    true
                }
                TaskArg::None => return Ok(Found::No),
            },
            // A term that may have variables is compared with what is found.
            _ => matches!(call.arg(var + 1), Cell::Imm(_) | Cell::Obj(_)),
        };
        given |= u64::from(is_given) << var;
    }
    let key = (number as u32, given);
    let cached = view.orders.borrow().get(&key).cloned();
    // The number may be another join's where two programs look at one tree.
    let cached = cached.filter(|order| Rc::ptr_eq(&order.join, join));
    let order = cached.unwrap_or_else(|| {
        let order = Rc::new(Order::of(join, &view, given));
        view.orders.borrow_mut().insert(key, order.clone());
        order
    });
    if order.is_empty {
        return Ok(Found::No);
    }
    // Now the columns are there, in which values have numbers.
    for var in (0..join.args).filter(|var| given >> var & 1 != 0) {
        regs[var] = match call.arg(var + 1) {
            _ if join.vars[var] == Sort::Task => regs[var],
            Cell::Imm(imm) => known(&view, &Value::Imm(imm)),
            Cell::Obj(at) => known(&view, call.store.object(at)),
            _ => UNKNOWN,
        };
    }
    order.fixed.iter().for_each(|(var, number)| regs[*var as usize] = *number);
    let cursors = order.steps.iter().map(|_| Cursor::default()).collect();
    let mut run = Run {
        order,
        given,
        regs,
        cursors,
        at: 0,
        forward: true,
        rows: Vec::new(),
        next_row: 0,
        collecting: false,
        given_out: 0,
        left_out: 0,
        is_ready: false,
        is_busy: false,
    };
    Ok(match run.go_on(&view) {
        Came::End => Found::No,
        Came::Answer if !run.has_more() => match run.bind(call)? {
            true => Found::Yes,
            false => Found::No,
        },
        came => {
            run.is_ready = came == Came::Answer;
            Found::Many(Box::new(run))
        }
    })
}
