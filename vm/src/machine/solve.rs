//! Queries of plans: the engine of rules as a driver of a frame.
//!
//! Inferences are counted like calls against the fuel of the run, but a query that is not long takes nothing of
//! its task's turn: how many there are depends on how goals are planned, and a better plan must not change the clock
//! of a tree. Only after [`TURN`] inferences the turn is over, so that who asks without end stops nobody else. In
//! between it is solved in slices, after which the run may be stopped. When a rule calls a function, the function
//! has a frame above the driver's.

use std::rc::Rc;

use crate::code::{Pc, SiteId};
use crate::failure::Failure;
use crate::host::Host;
use crate::native::{Raise, type_error};
use crate::rules::clause::PredId;
use crate::rules::engine::{Engine, Step};
use crate::rules::index::Facts;
use crate::rules::store::Cell;
use crate::rules::stream::{State, Stream};
use crate::rules::view::TreeView;
use crate::rules::{Ask, View};
use crate::value::{Imm, Obj, Value};

use super::call::Slow;
use super::drive::Driver;
use super::{Exit, Machine, QUANTUM, RESUME};

/// A query that is being solved.
pub(super) struct Solve {
    pub(super) engine: Box<Engine>,
    want: Want,
    /// A function is running whose value the engine waits for.
    called: bool,
    /// Inferences since the query began, or since it last ended a turn.
    in_turn: u64,
}

/// A query from outside of a run.
pub struct Query {
    pub(super) engine: Engine,
}

impl Query {
    /// What it sees.
    #[must_use]
    pub fn view(&self) -> &View {
        &self.engine.view
    }
    /// True if there is nothing more to try after the answer.
    #[must_use]
    pub fn is_last(&self) -> bool {
        self.engine.is_last()
    }
}

/// Inferences between two looks at the limits.
const SLICE: u64 = 20_000;

/// Inferences of a query that use up a turn of its task. Part of the language.
const TURN: u64 = 100_000;

/// How many open goals a failure names.
const MOST_GOALS: usize = 8;

/// What becomes of answers.
enum Want {
    /// Whether there is one.
    Whether,
    /// All of them.
    All(Vec<Value>),
    /// The first is that of a stream, then this part of it is the value.
    Stream(Value, Part),
    /// The first is what a description is grounded to; nil if there is none.
    First,
}

/// What a native wants to know of a stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// Its first answer; nil at the end.
    First,
    /// The stream of the answers after that; at the end the stream itself.
    Rest,
    /// Whether there is an answer.
    More,
    /// Whether there is none.
    Empty,
}

/// What is in force for a while in a task and its branches, the newest first.
pub(super) type Scoped = Option<Rc<Scope>>;

/// Facts or a tree, and what was in force before.
pub(super) struct Scope {
    facts: Vec<(PredId, Vec<Value>)>,
    tree: Option<Rc<TreeView>>,
    before: Scoped,
}

impl Machine {
    /// Asks a predicate whose last argument is what an answer is.
    pub(super) fn ask(&mut self, d: u8, predicate: PredId, inputs: &[Value], ask: Ask) -> Slow {
        let engine = self.engine(predicate, inputs)?;
        let want = match ask {
            Ask::Whether => Want::Whether,
            Ask::All => Want::All(Vec::new()),
            Ask::Stream => {
                let id = (self.number(), 0);
                return self.put(d, Stream::open(id, engine));
            }
        };
        self.solve(d, engine, want)
    }

    /// What a description is grounded to, by rules; to register `d`.
    pub(super) fn ask_first(&mut self, d: u8, predicate: PredId, inputs: &[Value]) -> Slow {
        let engine = self.engine(predicate, inputs)?;
        self.solve(d, engine, Want::First)
    }

    fn solve(&mut self, d: u8, engine: Box<Engine>, want: Want) -> Slow {
        self.push_driver(Driver::Solve(Box::new(Solve { engine, want, called: false, in_turn: 0 })), d);
        Ok(None)
    }

    /// The next answer for a loop over a stream: to register `d`, the rest to that after it.
    pub(super) fn next_answer(&mut self, d: u8, end: Pc) -> Slow {
        let stream = self.reg(d.wrapping_add(1)).clone();
        if let Some((first, rest)) = stream.cell() {
            *self.top().register(d.wrapping_add(1)) = rest;
            return self.put(d, first);
        }
        if let Some(Obj::Stream(it)) = stream.obj()
            && it.look(|state| matches!(state, State::End))
        {
            self.top().pc = end.0;
            return Ok(None);
        }
        // When somebody has looked, the instruction is done again.
        self.top().pc -= 1;
        self.stream_part(d, &stream, Part::More)
    }

    /// A part of a stream.
    pub(super) fn stream_part(&mut self, d: u8, value: &Value, part: Part) -> Slow {
        let Some(Obj::Stream(stream)) = value.obj() else {
            return Err(type_error("a stream of answers", value));
        };
        if let Some(engine) = stream.take() {
            return self.solve(d, engine, Want::Stream(value.clone(), part));
        }
        let known = stream.look(|state: &State| match state {
            State::Failed(failure) => Err(failure.clone()),
            state => Ok(part_of(state, value, part)),
        });
        match known {
            Ok(Some(it)) => self.put(d, it),
            Ok(None) => {
                let message = "two branches look at the same answer of a stream at the same time: \
                    give each a query of its own";
                Err(Box::new(Failure::new(crate::failure::Builtin::ProgramError, message)))
            }
            Err(failure) => match failure.as_failure() {
                Some(failure) => Err(Box::new(failure.clone())),
                None => self.put(d, Value::NIL),
            },
        }
    }

    /// A query from outside of the run, over its tree or another one.
    ///
    /// The last argument of the predicate is what an answer is; `inputs` are the others.
    pub fn open_query(&mut self, predicate: PredId, inputs: &[Value], tree: Option<Rc<TreeView>>) -> Query {
        let mut view = self.view(predicate);
        if let Some(tree) = tree {
            view.tree = tree;
        }
        Query { engine: Engine::new(predicate, inputs, view, false) }
    }

    /// The next answer of a query, or nothing after the last. Functions that rules call are computed at
    /// once. The fuel is that of the run.
    ///
    /// # Errors
    /// A failure: what a rule did wrong, or a limit of the run.
    pub fn next_answer_of(&mut self, host: &mut dyn Host, query: &mut Query) -> Result<Option<Value>, Value> {
        let engine = &mut query.engine;
        loop {
            let mut left = SLICE.min(self.limits.fuel.saturating_sub(self.steps));
            let given = left;
            let step = engine.run(&self.program, &mut left).map_err(|mut raise| {
                engine.say_where(&self.program, &mut raise);
                Value::new(Obj::Failure(raise))
            });
            self.steps += given - left;
            let raised = |raise: Raise| Value::new(Obj::Failure(raise));
            match step? {
                Step::Answer => return engine.answer().map(Some).map_err(raised),
                Step::No => return Ok(None),
                Step::Fuel if self.steps >= self.limits.fuel => {
                    let mut failure = self.over(
                        crate::failure::Builtin::FuelExhausted,
                        "the query used up its fuel of",
                        self.limits.fuel as usize,
                        "inferences",
                    );
                    failure.fields.extend(self.goals_of(engine).map(|(name, goals)| (name.into(), goals)));
                    return Err(raised(failure));
                }
                Step::Fuel if self.bytes() + engine.bytes() > self.limits.memory => {
                    return Err(raised(self.rules_take_too_much(engine)));
                }
                Step::Fuel => {}
                Step::Call(function, args) => {
                    let function = Value::Imm(Imm::Function(function));
                    let value = self.compute_at_once(host, &function, args, "a function that a rule calls");
                    engine.give(&value.map_err(raised)?);
                }
            }
        }
    }

    /// An engine about to solve a predicate, with all that the query can see.
    fn engine(&mut self, predicate: PredId, inputs: &[Value]) -> Result<Box<Engine>, Raise> {
        let view = self.view(predicate);
        let mut engine = Box::new(Engine::new(predicate, inputs, view, false));
        if self.program.rules.sees_world(predicate) {
            engine.world = self.top().world.as_ref().map(|world| world.fork());
        }
        Ok(engine)
    }

    /// What a query sees besides rules, as it is now.
    pub(super) fn view(&mut self, predicate: PredId) -> View {
        let mut scoped: Vec<(PredId, Vec<Cell>)> = Vec::new();
        let run = &self.runs[self.runs.len() - 1];
        let mut level = run.tasks.get(run.tasks.loaded).scope();
        let mut tree = None;
        while let Some(it) = level {
            tree = tree.or_else(|| it.tree.clone());
            for (predicate, args) in &it.facts {
                let cells: Vec<Cell> = args.iter().map(|arg| self.program.rules.cell(arg)).collect();
                match scoped.iter_mut().find(|known| known.0 == *predicate) {
                    Some((_, known)) => known.extend(cells),
                    None => scoped.push((*predicate, cells)),
                }
            }
            level = it.before.clone();
        }
        let table = |(predicate, cells): (PredId, Vec<Cell>)| {
            let arity = self.program.rules.predicates[predicate.at()].declared.arity;
            (predicate, Rc::new(Facts::new(arity.into(), cells)))
        };
        let scoped = scoped.into_iter().map(table).collect();
        let tree = match tree {
            Some(tree) => tree,
            None if self.program.rules.sees_tree(predicate) => self.tree_view(),
            None => Rc::default(),
        };
        View { scoped, tree }
    }

    /// The tree of the run as rules see it. It is made again when the tree has changed.
    fn tree_view(&mut self) -> Rc<TreeView> {
        let program = &self.program;
        let Some(run) = self.runs.last_mut() else { return Rc::default() };
        let changes = run.tree.changes;
        match &run.view {
            Some((known, view)) if *known == changes => view.clone(),
            _ => {
                let view = Rc::new(TreeView::of(program, &run.tree));
                run.view = Some((changes, view.clone()));
                view
            }
        }
    }

    /// The next stretch of a query: its driver has the frame.
    pub(super) fn go_on_solving(&mut self, host: &mut dyn Host, value: Value) -> Slow {
        let Some(Driver::Solve(mut solve)) = self.top().drivers.pop() else { return Ok(None) };
        if std::mem::take(&mut solve.called) {
            solve.engine.give(&value);
        }
        self.top().pc = RESUME;
        loop {
            let given = SLICE.min(self.limits.fuel.saturating_sub(self.steps)).min(TURN - solve.in_turn);
            let mut slice = given;
            let step = solve.engine.run(&self.program, &mut slice);
            self.steps += given - slice;
            solve.in_turn += given - slice;
            let step = match step {
                Ok(step) => step,
                Err(mut raise) => {
                    solve.engine.say_where(&self.program, &mut raise);
                    self.top().drivers.push(Driver::Solve(solve));
                    return Err(raise);
                }
            };
            match step {
                Step::Fuel => {
                    if self.bytes() + solve.engine.bytes() > self.limits.memory {
                        let raise = self.rules_take_too_much(&solve.engine);
                        self.top().drivers.push(Driver::Solve(solve));
                        return Err(raise);
                    }
                    if solve.in_turn >= TURN {
                        solve.in_turn = 0;
                        self.top().tasks.in_turn = QUANTUM;
                    }
                    self.top().drivers.push(Driver::Solve(solve));
                    return Ok(Some(Exit::Fuel));
                }
                Step::Call(function, args) => {
                    solve.called = true;
                    self.top().drivers.push(Driver::Solve(solve));
                    return self.call_value(host, 0, SiteId(0), &Value::Imm(Imm::Function(function)), args);
                }
                Step::Answer => {
                    let answer = match solve.engine.answer() {
                        Ok(answer) => answer,
                        Err(raise) => {
                            self.top().drivers.push(Driver::Solve(solve));
                            return Err(raise);
                        }
                    };
                    match &mut solve.want {
                        Want::Whether => return self.return_value(Value::TRUE),
                        Want::First => return self.return_value(answer),
                        Want::All(answers) => answers.push(answer),
                        Want::Stream(stream, part) => {
                            let (stream, part) = (stream.clone(), *part);
                            let id = match stream.obj() {
                                Some(Obj::Stream(it)) => (it.id.0, it.id.1 + 1),
                                _ => (0, 0),
                            };
                            let rest = Stream::open(id, solve.engine);
                            return self.stream_becomes(&stream, State::Answer(answer, rest), part);
                        }
                    }
                }
                Step::No => match solve.want {
                    Want::Whether => return self.return_value(Value::FALSE),
                    Want::First => return self.return_value(Value::NIL),
                    Want::All(answers) => return self.return_value(Value::list(answers)),
                    Want::Stream(stream, part) => return self.stream_becomes(&stream, State::End, part),
                },
            }
        }
    }

    fn stream_becomes(&mut self, stream: &Value, state: State, part: Part) -> Slow {
        let value = part_of(&state, stream, part).unwrap_or_default();
        if let Some(Obj::Stream(it)) = stream.obj() {
            it.becomes(state);
        }
        self.return_value(value)
    }

    fn rules_take_too_much(&self, engine: &Engine) -> Raise {
        let message = format!("a query takes more than {} bytes", self.limits.memory);
        let mut fields =
            vec![("message", Value::str(message)), ("limit", Value::int(self.limits.memory as i64))];
        fields.extend(self.goals_of(engine));
        Box::new(Failure::with(crate::failure::Builtin::MemoryExhausted, fields))
    }

    /// The field of a failure that says which goals a query was at.
    pub(super) fn goals_of(&self, engine: &Engine) -> Option<(&'static str, Value)> {
        let goals = engine.open_goals(&self.program, MOST_GOALS);
        let names = goals.into_iter().map(|name| Value::Imm(Imm::Symbol(name)));
        (names.len() > 0).then(|| ("goals", Value::list(names.collect::<Vec<_>>())))
    }

    /// A failure has come to a query: it is what its stream has, too.
    pub(super) fn solve_failed(&mut self, solve: Solve, failure: &Value) {
        if let Want::Stream(stream, _) = &solve.want
            && let Some(Obj::Stream(it)) = stream.obj()
        {
            it.becomes(State::Failed(failure.clone()));
        }
    }

    /// Facts come into force in the running task: a list of predicates, each with its arguments.
    pub(super) fn push_facts(&mut self, facts: &Value) -> Result<(), Raise> {
        let mut all = Vec::new();
        for fact in facts.iter() {
            let (predicate, args) = fact.as_pair().ok_or_else(|| type_error("a fact", fact))?;
            let predicate = PredId(crate::native::index(predicate)? as u32);
            all.push((predicate, crate::native::list(args)?));
        }
        let tasks = &mut self.top().tasks;
        let task = tasks.get_mut(tasks.loaded);
        let before = task.scope();
        task.set_scope(Some(Rc::new(Scope { facts: all, tree: None, before })));
        Ok(())
    }

    /// Queries of the running task see another tree.
    pub(super) fn push_tree(&mut self, tree: &Value) -> Result<(), Raise> {
        let tree = tree.as_tree().ok_or_else(|| type_error("a tree", tree))?;
        let tree = Some(Rc::new(TreeView::of(&self.program, tree)));
        let tasks = &mut self.top().tasks;
        let task = tasks.get_mut(tasks.loaded);
        let before = task.scope();
        task.set_scope(Some(Rc::new(Scope { facts: Vec::new(), tree, before })));
        Ok(())
    }

    /// The newest facts, or the newest tree, are no longer in force.
    pub(super) fn pop_scope(&mut self) {
        let tasks = &mut self.top().tasks;
        let task = tasks.get_mut(tasks.loaded);
        let before = task.scope().and_then(|it| it.before.clone());
        task.set_scope(before);
    }
}

impl Engine {
    /// Notes where in the source it stands, and where a rule outside of the library does.
    fn say_where(&self, program: &crate::code::Program, raise: &mut Raise) {
        if raise.place.is_some() {
            return;
        }
        let mut places = self.goes_on_at().filter_map(|pc| {
            program.rules.places.get(Pc(pc.checked_sub(1)?).at()).copied().filter(|place| place.end > 0)
        });
        raise.place = places.next();
        if raise.place.is_some_and(|place| program.library.contains(&place.file))
            && let Some(place) = places.find(|place| !program.library.contains(&place.file))
        {
            (raise.place, raise.within) = (Some(place), raise.place);
        }
    }
}

fn part_of(state: &State, stream: &Value, part: Part) -> Option<Value> {
    Some(match (state, part) {
        (State::Answer(first, _), Part::First) => first.clone(),
        (State::Answer(_, rest), Part::Rest) => rest.clone(),
        (State::Answer(..), Part::More) | (State::End, Part::Empty) => Value::TRUE,
        (State::End, Part::First) => Value::NIL,
        (State::End, Part::Rest) => stream.clone(),
        (State::End, Part::More) | (State::Answer(..), Part::Empty) => Value::FALSE,
        _ => return None,
    })
}
