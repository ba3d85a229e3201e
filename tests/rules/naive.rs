//! The oracle of rules: what a goal means, said as plainly as can be.
//!
//! A goal takes a substitution to the list of its answers, in their order, and says whether a cut was
//! met. An answer is a substitution; what goes wrong is the last answer. There is no trail, no choice,
//! no index and no laziness. A tabled predicate is the least set of answers: it is computed from below, by
//! asking its clauses until nothing new comes.

use std::collections::BTreeSet;
use std::rc::Rc;

use vm::code::Program;
use vm::rules::clause::{Arith, Clause, Collect, Compare, Goal, GoalKind, Number, PredId, Term};
use vm::value::{Imm, Value};

/// A term: a variable, something without parts, or a list cell.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Tree {
    Var(usize),
    Leaf(Value),
    Pair(Rc<(Tree, Tree)>),
}

/// What variables stand for.
type Known = im::HashMap<usize, Tree>;

#[derive(Clone, Debug, PartialEq)]
pub enum Fault {
    /// A goal did something wrong.
    Error,
    /// It takes too long.
    Limit,
}

type Answer = Result<Known, Fault>;
/// Answers in their order, and whether a cut was met.
type Answers = (Vec<Answer>, bool);

pub struct Naive<'p> {
    program: &'p Program,
    /// Variables so far.
    vars: usize,
    fuel: usize,
    /// The answers of tabled predicates.
    tables: BTreeSet<(PredId, Tree)>,
}

fn pair(first: Tree, rest: Tree) -> Tree {
    Tree::Pair(Rc::new((first, rest)))
}

fn list(items: impl DoubleEndedIterator<Item = Tree>) -> Tree {
    items.rev().fold(Tree::Leaf(Value::NIL), |rest, first| pair(first, rest))
}

fn of_value(value: &Value) -> Tree {
    match value.as_pair() {
        Some((first, rest)) => pair(of_value(first), of_value(rest)),
        None => Tree::Leaf(value.clone()),
    }
}

/// What a term stands for, all through.
fn full(tree: &Tree, known: &Known) -> Tree {
    match tree {
        Tree::Var(var) => known.get(var).map_or_else(|| tree.clone(), |tree| full(tree, known)),
        Tree::Leaf(_) => tree.clone(),
        Tree::Pair(both) => pair(full(&both.0, known), full(&both.1, known)),
    }
}

fn variables(tree: &Tree, found: &mut Vec<usize>) {
    match tree {
        Tree::Var(var) if !found.contains(var) => found.push(*var),
        Tree::Pair(both) => {
            variables(&both.0, found);
            variables(&both.1, found);
        }
        _ => {}
    }
}

fn unify(a: &Tree, b: &Tree, known: &Known) -> Option<Known> {
    match (full(a, known), full(b, known)) {
        (a, b) if a == b => Some(known.clone()),
        (Tree::Var(var), other) | (other, Tree::Var(var)) => {
            let mut inside = Vec::new();
            variables(&other, &mut inside);
            (!inside.contains(&var)).then(|| known.update(var, other))
        }
        (Tree::Pair(a), Tree::Pair(b)) => unify(&a.1, &b.1, &unify(&a.0, &b.0, known)?),
        _ => None,
    }
}

/// Whether two terms can be the same.
pub fn can_be_same(a: &Tree, b: &Tree) -> bool {
    unify(a, b, &Known::new()).is_some()
}

impl<'p> Naive<'p> {
    /// Answers of tabled predicates among `tabled` are computed first.
    pub fn new(program: &'p Program, tabled: &[PredId], fuel: usize) -> Naive<'p> {
        let mut it = Naive { program, vars: 0, fuel, tables: BTreeSet::new() };
        loop {
            let before = it.tables.len();
            for predicate in tabled {
                let declared = &program.rules.predicates[predicate.at()];
                let args: Vec<Tree> = (0..declared.declared.arity).map(|_| it.fresh()).collect();
                for clause in &declared.clauses {
                    for answer in it.clause(clause, &args, &Known::new()).0.into_iter().flatten() {
                        it.tables.insert((*predicate, full(&list(args.iter().cloned()), &answer)));
                    }
                }
            }
            if it.tables.len() == before {
                return it;
            }
        }
    }

    /// The answers of a predicate of one argument, as texts, and how they end.
    pub fn ask(&mut self, predicate: PredId) -> (Vec<String>, Option<Fault>) {
        let arg = self.fresh();
        let mut texts = Vec::new();
        for answer in self.call(predicate, std::slice::from_ref(&arg), &Known::new()) {
            match answer {
                Ok(known) => texts.push(text(&full(&arg, &known))),
                Err(fault) => return (texts, Some(fault)),
            }
        }
        (texts, None)
    }

    fn fresh(&mut self) -> Tree {
        self.vars += 1;
        Tree::Var(self.vars)
    }

    fn call(&mut self, predicate: PredId, args: &[Tree], known: &Known) -> Vec<Answer> {
        if self.fuel == 0 {
            return vec![Err(Fault::Limit)];
        }
        self.fuel -= 1;
        let it = &self.program.rules.predicates[predicate.at()];
        let all = list(args.iter().cloned());
        if it.declared.tabled {
            let rows = self.tables.iter().filter(|row| row.0 == predicate);
            return rows.filter_map(|row| unify(&all, &row.1, known)).map(Ok).collect();
        }
        if let vm::rules::clause::Kind::Native = it.declared.kind {
            return native(&it.declared.name, args, known).into_iter().collect();
        }
        let mut answers = Vec::new();
        for fact in &it.facts {
            answers.extend(unify(&all, &list(fact.iter().map(of_value)), known).map(Ok));
        }
        for clause in &it.clauses {
            let (more, cut) = self.clause(clause, args, known);
            let failed = more.last().is_some_and(Result::is_err);
            answers.extend(more);
            if cut || failed {
                break;
            }
        }
        answers
    }

    fn clause(&mut self, clause: &Clause, args: &[Tree], known: &Known) -> Answers {
        let first = self.vars + 1;
        self.vars += clause.vars.len();
        let head: Vec<Tree> = clause.head.iter().map(|term| self.term(term, first)).collect();
        match unify(&list(head.into_iter()), &list(args.iter().cloned()), known) {
            Some(known) => self.goal(&clause.body, first, &known),
            None => (Vec::new(), false),
        }
    }

    fn term(&mut self, term: &Term, first: usize) -> Tree {
        match term {
            Term::Var(var) => Tree::Var(first + *var as usize),
            Term::Any => self.fresh(),
            Term::Const(value) => of_value(value),
            Term::Pair(a, b) => pair(self.term(a, first), self.term(b, first)),
            _ => panic!("the oracle knows no structures"),
        }
    }

    fn terms(&mut self, terms: &[Term], first: usize) -> Vec<Tree> {
        terms.iter().map(|term| self.term(term, first)).collect()
    }

    fn row(&mut self, goals: &[&Goal], first: usize, known: &Known) -> Answers {
        let Some((goal, rest)) = goals.split_first() else { return (vec![Ok(known.clone())], false) };
        let (found, mut cut) = self.goal(goal, first, known);
        let mut answers = Vec::new();
        for answer in found {
            let known = match answer {
                Ok(known) => known,
                Err(fault) => {
                    answers.push(Err(fault));
                    break;
                }
            };
            let (more, cuts) = self.row(rest, first, &known);
            let failed = more.last().is_some_and(Result::is_err);
            answers.extend(more);
            cut |= cuts;
            if cuts || failed {
                break;
            }
        }
        (answers, cut)
    }

    /// Whether a goal has an answer, and the first.
    fn first(&mut self, goal: &Goal, first: usize, known: &Known) -> Result<Option<Known>, Fault> {
        self.goal(goal, first, known).0.into_iter().next().transpose()
    }

    fn goal(&mut self, goal: &Goal, first: usize, known: &Known) -> Answers {
        match &goal.kind {
            GoalKind::Cut => return (vec![Ok(known.clone())], true),
            GoalKind::And(goals) => return self.row(&goals.iter().collect::<Vec<_>>(), first, known),
            GoalKind::Or(goals) => {
                let mut answers = Vec::new();
                for goal in goals {
                    let (more, cut) = self.goal(goal, first, known);
                    let ends = cut || more.last().is_some_and(Result::is_err);
                    answers.extend(more);
                    if ends {
                        return (answers, cut);
                    }
                }
                return (answers, false);
            }
            GoalKind::If { test, then, otherwise, soft } => {
                let (mut tests, _) = self.goal(test, first, known);
                if let (Some(goal), true) = (otherwise, tests.is_empty()) {
                    return self.goal(goal, first, known);
                }
                tests.truncate(if *soft { usize::MAX } else { 1 });
                let (mut answers, mut cut) = (Vec::new(), false);
                for test in tests {
                    match test {
                        Ok(known) => {
                            let (more, cuts) = self.goal(then, first, &known);
                            let ends = cuts || more.last().is_some_and(Result::is_err);
                            answers.extend(more);
                            cut |= cuts;
                            if ends {
                                break;
                            }
                        }
                        Err(fault) => answers.push(Err(fault)),
                    }
                }
                return (answers, cut);
            }
            _ => {}
        }
        match self.simple(goal, first, known) {
            Ok(answers) => (answers, false),
            Err(fault) => (vec![Err(fault)], false),
        }
    }

    /// Goals that a cut does not leave.
    fn simple(&mut self, goal: &Goal, first: usize, known: &Known) -> Result<Vec<Answer>, Fault> {
        let test = |holds: bool| Ok(if holds { vec![Ok(known.clone())] } else { Vec::new() });
        let same = |a: &Tree, b: &Tree| Ok(unify(a, b, known).map(Ok).into_iter().collect());
        match &goal.kind {
            GoalKind::True => test(true),
            GoalKind::False => test(false),
            GoalKind::Not(goal, needed) => {
                let unbound =
                    |var: &u16| matches!(full(&Tree::Var(first + *var as usize), known), Tree::Var(_));
                if needed.iter().any(unbound) {
                    return Err(Fault::Error);
                }
                test(self.first(goal, first, known)?.is_none())
            }
            GoalKind::Once(goal) => Ok(self.first(goal, first, known)?.map(Ok).into_iter().collect()),
            GoalKind::Call(predicate, args) => {
                let args = self.terms(args, first);
                Ok(self.call(*predicate, &args, known))
            }
            GoalKind::CallValue(goal, more, _) => {
                let goal = full(&self.term(goal, first), known);
                let mut parts = Vec::new();
                let mut rest = if let Tree::Pair(_) = goal { goal } else { list([goal].into_iter()) };
                while let Tree::Pair(both) = rest {
                    parts.push(both.0.clone());
                    rest = both.1.clone();
                }
                parts.extend(self.terms(more, first));
                let Tree::Leaf(Value::Imm(Imm::Symbol(name))) = parts.remove(0) else {
                    return Err(Fault::Error);
                };
                let predicate = self.program.rules.find(name, parts.len()).ok_or(Fault::Error)?;
                Ok(self.call(predicate, &parts, known))
            }
            GoalKind::Unify(a, b) => {
                let (a, b) = (self.term(a, first), self.term(b, first));
                same(&a, &b)
            }
            GoalKind::Identical(a, b) => {
                let (a, b) = (self.term(a, first), self.term(b, first));
                test(full(&a, known) == full(&b, known))
            }
            GoalKind::Compare(how, a, b) => {
                let (a, b) = (self.number(a, first, known)?, self.number(b, first, known)?);
                test(match how {
                    Compare::Less => a < b,
                    Compare::LessEq => a <= b,
                    Compare::More => a > b,
                    Compare::MoreEq => a >= b,
                    Compare::Equal => a == b,
                    Compare::Unequal => a != b,
                })
            }
            GoalKind::Is(result, number) => {
                let number = self.number(number, first, known)?;
                let result = self.term(result, first);
                same(&result, &Tree::Leaf(Value::int(number)))
            }
            GoalKind::Collect(how, template, goal, result) => {
                let template = self.term(template, first);
                let found: Result<Vec<Known>, Fault> = self.goal(goal, first, known).0.into_iter().collect();
                let mut items = Vec::new();
                for known in found? {
                    items.push(self.copy(&full(&template, &known)));
                }
                let result = self.term(result, first);
                match how {
                    Collect::List => same(&result, &list(items.into_iter())),
                    Collect::Count => same(&result, &Tree::Leaf(Value::int(items.len() as i64))),
                    Collect::Min => items.iter().min().map_or(Ok(Vec::new()), |item| same(&result, item)),
                    Collect::Max => items.iter().max().map_or(Ok(Vec::new()), |item| same(&result, item)),
                }
            }
            GoalKind::Bag { template, by, goal, list: result, set } => {
                let (template, result) = (self.term(template, first), self.term(result, first));
                let by = list(by.iter().map(|var| Tree::Var(first + *var as usize)));
                let found: Result<Vec<Known>, Fault> = self.goal(goal, first, known).0.into_iter().collect();
                let pairs = found?.into_iter().map(|known| (full(&by, &known), full(&template, &known)));
                let pairs: Vec<(Tree, Tree)> = pairs.collect();
                let mut keys: Vec<&Tree> = pairs.iter().map(|pair| &pair.0).collect();
                keys.sort();
                keys.dedup();
                let mut answers = Vec::new();
                for key in keys {
                    let mut items: Vec<Tree> =
                        pairs.iter().filter(|pair| pair.0 == *key).map(|pair| pair.1.clone()).collect();
                    if *set {
                        items.sort();
                        items.dedup();
                    }
                    let known =
                        unify(&by, key, known).and_then(|it| unify(&result, &list(items.into_iter()), &it));
                    answers.extend(known.map(Ok));
                }
                Ok(answers)
            }
            GoalKind::ForAll(test_goal, goal) => {
                for known in self.goal(test_goal, first, known).0 {
                    if self.first(goal, first, &known?)?.is_none() {
                        return test(false);
                    }
                }
                test(true)
            }
            _ => panic!("the oracle does not know this goal"),
        }
    }

    fn number(&mut self, number: &Number, first: usize, known: &Known) -> Result<i64, Fault> {
        match number {
            Number::Term(term) => match full(&self.term(term, first), known) {
                Tree::Leaf(Value::Imm(Imm::Int(number))) => Ok(number),
                _ => Err(Fault::Error),
            },
            Number::Op(op, a, b) => {
                let (a, b) = (self.number(a, first, known)?, self.number(b, first, known)?);
                let number = match op {
                    Arith::Add => a.checked_add(b),
                    Arith::Sub => a.checked_sub(b),
                    Arith::Mul => a.checked_mul(b),
                    Arith::Div => None,
                };
                number.ok_or(Fault::Error)
            }
        }
    }

    /// The same with new variables.
    fn copy(&mut self, tree: &Tree) -> Tree {
        let mut vars = Vec::new();
        variables(tree, &mut vars);
        let renamed: Known = vars.into_iter().map(|var| (var, self.fresh())).collect();
        full(tree, &renamed)
    }
}

fn native(name: &str, args: &[Tree], known: &Known) -> Option<Answer> {
    let it = full(&args[0], known);
    let holds = match (name, &it) {
        ("bound?", it) => !matches!(it, Tree::Var(_)),
        ("unbound?" | "var?", it) => matches!(it, Tree::Var(_)),
        ("ground?", it) => {
            let mut vars = Vec::new();
            variables(it, &mut vars);
            vars.is_empty()
        }
        ("number?" | "integer?", it) => matches!(it, Tree::Leaf(Value::Imm(Imm::Int(_)))),
        ("symbol?", it) => matches!(it, Tree::Leaf(Value::Imm(Imm::Symbol(_)))),
        _ => panic!("the oracle does not know {name}"),
    };
    holds.then(|| Ok(known.clone()))
}

/// A term with its variables numbered as they stand.
pub fn text(tree: &Tree) -> String {
    let mut vars = Vec::new();
    variables(tree, &mut vars);
    let mut out = String::new();
    write(tree, &vars, &mut out);
    out
}

fn write(tree: &Tree, vars: &[usize], out: &mut String) {
    match tree {
        Tree::Var(var) => *out += &format!("?_{}", vars.iter().position(|it| it == var).unwrap_or(0)),
        Tree::Leaf(value) => *out += &vm::print::write(value),
        Tree::Pair(_) => {
            *out += "(";
            let mut at = tree;
            while let Tree::Pair(both) = at {
                if out.as_bytes().last() != Some(&b'(') {
                    *out += " ";
                }
                write(&both.0, vars, out);
                at = &both.1;
            }
            if *at != Tree::Leaf(Value::NIL) {
                *out += " . ";
                write(at, vars, out);
            }
            *out += ")";
        }
    }
}

/// The text of an answer of the machine.
pub fn value_text(value: &Value) -> String {
    text(&of_answer(value))
}

fn of_answer(value: &Value) -> Tree {
    match value {
        Value::Imm(Imm::Var(name)) => {
            Tree::Var(name.strip_prefix("?_").and_then(|it| it.parse().ok()).unwrap_or(usize::MAX))
        }
        value => match value.as_pair() {
            Some((first, rest)) => pair(of_answer(first), of_answer(rest)),
            None => Tree::Leaf(value.clone()),
        },
    }
}
