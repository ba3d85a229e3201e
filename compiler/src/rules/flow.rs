//! How values flow through a clause: which variables may have none where one is needed.
//!
//! A goal is looked at with what is known before it: a variable that nothing before it mentions has
//! no value for *sure*; one that a fact, a number or a function has given a value has one for sure; of
//! all others it is known when the clause runs. So `not` gets the list of the variables to look at,
//! and a `not` over a variable that surely has no value is a mistake. Cuts behind tabled calls and
//! goals behind `(false)` are found on the way.

use grammar::{FileId, Span};
use vm::code::{Place, Program};
use vm::rules::clause::{Goal, GoalKind, Kind, Number, PredId, Term, VarNo};
use vm::value::Symbol;

use super::goal::whole;
use crate::error::CompileError;

/// Looks at the body of a clause and fills the lists of its `not`s.
pub(super) struct Flow<'a> {
    pub(super) program: &'a Program,
    pub(super) vars: &'a [Symbol],
    /// How many goals beside those that are being looked at have each variable.
    around: Vec<usize>,
    pub(super) errors: Vec<CompileError>,
}

/// What is known before a goal.
#[derive(Clone)]
struct State {
    /// The variable may have a value.
    maybe: Vec<bool>,
    /// The variable has a value, with no variable in it.
    sure: Vec<bool>,
    /// A tabled call.
    tabled: Option<(PredId, Place)>,
}

impl<'a> Flow<'a> {
    pub(super) fn new(program: &'a Program, vars: &'a [Symbol]) -> Flow<'a> {
        Flow { program, vars, around: vec![0; vars.len()], errors: Vec::new() }
    }

    /// A clause with this head. That of a query has values for its first `given` arguments, and the last
    /// one is what it gives.
    pub(super) fn clause(&mut self, head: &[Term], given: Option<usize>, body: &mut Goal) {
        let none = vec![false; self.vars.len()];
        let mut state = State { maybe: none.clone(), sure: none, tabled: None };
        for (at, term) in head.iter().enumerate() {
            for var in in_terms([term]) {
                self.around[var as usize] += 1;
                state.maybe[var as usize] |= given.is_none_or(|given| at < given);
                state.sure[var as usize] |= given.is_some_and(|given| at < given);
            }
        }
        self.goal(body, &mut state);
    }

    fn beside(&mut self, vars: &[VarNo], work: impl FnOnce(&mut Self)) {
        vars.iter().for_each(|var| self.around[*var as usize] += 1);
        work(self);
        vars.iter().for_each(|var| self.around[*var as usize] -= 1);
    }

    fn goal(&mut self, goal: &mut Goal, state: &mut State) {
        let at = goal.place;
        match &mut goal.kind {
            GoalKind::True | GoalKind::Tick(_) | GoalKind::False | GoalKind::Identical(..) => {}
            GoalKind::Cut => self.cut(at, state),
            GoalKind::And(goals) => self.row(goals, state),
            GoalKind::Or(goals) => self.alternatives(goals, state),
            GoalKind::Once(goal) => self.goal(goal, state),
            GoalKind::Not(goal, open) => self.negation(goal, open, at, state),
            GoalKind::If { test, then, otherwise, .. } => {
                let mut other = state.clone();
                self.two(test, then, state);
                if let Some(otherwise) = otherwise {
                    self.goal(otherwise, &mut other);
                    state.or(&other);
                }
            }
            GoalKind::ForAll(test, goal) => self.two(test, goal, &mut state.clone()),
            GoalKind::Call(predicate, args) => self.call(*predicate, args, at, state),
            GoalKind::CallValue(goal, args, _) => {
                if let Term::Var(var) = goal {
                    self.needs("call", &[*var], at, state);
                }
                state.may_bind(in_terms(args.iter().chain([&*goal])));
            }
            GoalKind::Unify(a, b) => {
                let (a, b) = (in_terms([&*a]), in_terms([&*b]));
                let (left, right) = (state.has_all(&a), state.has_all(&b));
                state.may_bind(a.iter().chain(&b).copied());
                state.bind(if left { b } else { Vec::new() });
                state.bind(if right { a } else { Vec::new() });
            }
            GoalKind::Matches(pattern, value) => {
                let value = in_terms([&*value]);
                self.needs("matches", &value, at, state);
                let pattern = in_terms([&*pattern]);
                state.may_bind(pattern.iter().copied());
                state.bind(if state.has_all(&value) { pattern } else { Vec::new() });
            }
            GoalKind::Compare(how, a, b) => {
                let vars = in_numbers([&*a, &*b]);
                self.needs(how.sign(), &vars, at, state);
                state.bind(vars);
            }
            GoalKind::Is(result, number) => {
                let vars = in_numbers([&*number]);
                self.needs("is", &vars, at, state);
                state.bind(vars);
                state.bind(in_terms([&*result]));
            }
            GoalKind::Fun(f, args, result) => {
                let vars = in_terms(args.iter());
                let name = self.program.functions.get(f.at()).map_or(Symbol::from("fun"), |it| it.name);
                self.needs(&name, &vars, at, state);
                state.bind(vars);
                state.bind(in_terms([&*result]));
            }
            GoalKind::Collect(_, template, goal, result) => {
                let result = in_terms([&*result]);
                let beside: Vec<VarNo> = in_terms([&*template]).into_iter().chain(result.clone()).collect();
                self.beside(&beside, |it| it.goal(goal, &mut state.clone()));
                state.may_bind(result);
            }
            GoalKind::Bag { template, by, goal, list, .. } => {
                let list = in_terms([&*list]);
                let beside: Vec<VarNo> = in_terms([&*template]).into_iter().chain(list.clone()).collect();
                self.beside(&beside, |it| it.goal(goal, &mut state.clone()));
                state.may_bind(list.into_iter().chain(by.iter().copied()));
            }
        }
    }

    fn row(&mut self, goals: &mut [Goal], state: &mut State) {
        let vars: Vec<Vec<VarNo>> = goals.iter().map(in_goal).collect();
        vars.iter().flatten().for_each(|var| self.around[*var as usize] += 1);
        for (at, goal) in goals.iter_mut().enumerate() {
            vars[at].iter().for_each(|var| self.around[*var as usize] -= 1);
            self.goal(goal, state);
            vars[at].iter().for_each(|var| self.around[*var as usize] += 1);
        }
        vars.iter().flatten().for_each(|var| self.around[*var as usize] -= 1);
        let end = goals.iter().position(|goal| matches!(goal.kind, GoalKind::False));
        if let Some(end) = end.filter(|end| end + 1 < goals.len()) {
            let what = if end + 2 < goals.len() { "the rest of these goals" } else { "this goal" };
            self.errors.push(CompileError::Unreachable {
                what: what.into(),
                at: whole(&goals[end + 1..]),
                because: "nothing holds after this".into(),
                of: span(goals[end].place),
                help: Some("leave out the goals after `(false)`".into()),
            });
        }
    }

    fn two(&mut self, first: &mut Goal, second: &mut Goal, state: &mut State) {
        let (vars, after) = (in_goal(first), in_goal(second));
        self.beside(&after, |it| it.goal(first, state));
        self.beside(&vars, |it| it.goal(second, state));
    }

    fn alternatives(&mut self, goals: &mut [Goal], state: &mut State) {
        let before = state.clone();
        for (at, goal) in goals.iter_mut().enumerate() {
            let mut branch = before.clone();
            self.goal(goal, &mut branch);
            match at {
                0 => *state = branch,
                _ => state.or(&branch),
            }
        }
    }

    fn negation(&mut self, goal: &mut Goal, open: &mut Vec<VarNo>, at: Place, state: &State) {
        // To look at variables themselves needs no values.
        let mut vars = if self.only_looks(goal) { Vec::new() } else { in_goal(goal) };
        vars.retain(|var| self.around[*var as usize] > 0 && !state.sure[*var as usize]);
        self.needs("not", &vars, at, state);
        *open = vars;
        self.goal(goal, &mut state.clone());
    }

    /// True for a goal that looks at variables and gives none a value.
    fn only_looks(&self, goal: &Goal) -> bool {
        match &goal.kind {
            GoalKind::Identical(..) => true,
            GoalKind::Call(predicate, _) => {
                let it = &self.program.rules.predicates[predicate.at()].declared;
                it.kind == Kind::Native && vm::rules::control::binds_nothing(&it.name)
            }
            _ => false,
        }
    }

    fn call(&mut self, predicate: PredId, args: &[Term], at: Place, state: &mut State) {
        let Some(known) = self.program.rules.predicates.get(predicate.at()) else { return };
        let vars = in_terms(args);
        match known.declared.kind {
            Kind::Facts => state.bind(vars),
            _ => state.may_bind(vars),
        }
        if known.declared.tabled {
            state.tabled = Some((predicate, at));
        }
    }

    fn cut(&mut self, at: Place, state: &State) {
        let Some((predicate, call)) = state.tabled else { return };
        let name = self.program.rules.predicates[predicate.at()].declared.name.to_string();
        self.errors.push(CompileError::TableCut { name, at: span(at), call: span(call) });
    }

    /// A goal needs values of these variables.
    fn needs(&mut self, form: &str, vars: &[VarNo], at: Place, state: &State) {
        for var in vars.iter().filter(|var| !state.maybe[**var as usize]) {
            let (form, name) = (form.to_string(), self.vars[*var as usize].to_string());
            self.errors.push(CompileError::Floundering { form, name, at: span(at) });
        }
    }
}

impl State {
    fn has_all(&self, vars: &[VarNo]) -> bool {
        vars.iter().all(|var| self.sure[*var as usize])
    }
    fn may_bind(&mut self, vars: impl IntoIterator<Item = VarNo>) {
        vars.into_iter().for_each(|var| self.maybe[var as usize] = true);
    }
    fn bind(&mut self, vars: Vec<VarNo>) {
        vars.iter().for_each(|var| self.sure[*var as usize] = true);
        self.may_bind(vars);
    }
    /// After one of two branches.
    fn or(&mut self, other: &State) {
        self.maybe.iter_mut().zip(&other.maybe).for_each(|(a, b)| *a |= b);
        self.sure.iter_mut().zip(&other.sure).for_each(|(a, b)| *a &= b);
        self.tabled = self.tabled.or(other.tabled);
    }
}

fn span(place: Place) -> Span {
    Span { file: FileId(place.file), start: place.start, end: place.end }
}

fn sorted(mut vars: Vec<VarNo>) -> Vec<VarNo> {
    vars.sort_unstable();
    vars.dedup();
    vars
}

fn in_goal(goal: &Goal) -> Vec<VarNo> {
    let mut vars = Vec::new();
    goal.each_var(&mut |var| vars.push(var));
    sorted(vars)
}

fn in_terms<'t>(terms: impl IntoIterator<Item = &'t Term>) -> Vec<VarNo> {
    let mut vars = Vec::new();
    terms.into_iter().for_each(|term| term.each_var(&mut |var| vars.push(var)));
    sorted(vars)
}

fn in_numbers<'n>(numbers: impl IntoIterator<Item = &'n Number>) -> Vec<VarNo> {
    let mut vars = Vec::new();
    numbers.into_iter().for_each(|number| number.each_var(&mut |var| vars.push(var)));
    sorted(vars)
}
