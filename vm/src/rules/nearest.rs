//! What is nearest to something that no rule answers.

use crate::code::Program;
use crate::desc::Desc;
use crate::value::{Imm, Symbol, Value};

use super::clause::{Clause, GoalKind, Term};
use super::show;
use super::why::conjuncts;

/// How many rules are named.
const MOST: usize = 3;
/// Words that are less alike than this were not meant for one another.
const ALIKE: f64 = 0.85;

/// For an action that nothing grounds: what the rules for its type miss, or the type that was meant.
#[must_use]
pub fn to_action(program: &Program, action: &Value) -> Vec<String> {
    let Some(desc) = action.as_desc() else { return Vec::new() };
    let Some(grounding) = program.rules.grounding else { return Vec::new() };
    let clauses = &program.rules.predicates[grounding.at()].clauses;
    let kind = Symbol::from("type");
    let mut near: Vec<(usize, String)> = Vec::new();
    let mut types: Vec<Symbol> = Vec::new();
    for clause in clauses {
        let Some(wanted) = wanted(clause).filter(|wanted| wanted.0 == desc.kind) else { continue };
        let of_type = wanted.1.iter().find(|(key, _)| *key == kind).map(|(_, term)| term);
        if let Some(Term::Const(value)) = of_type
            && desc.get(kind) != Some(value)
        {
            types.extend(value.as_symbol());
            continue;
        }
        let plan = clause.head.get(1).map_or_else(String::new, |call| plan_of(program, clause, call));
        let misses: Vec<String> =
            wanted.1.iter().filter_map(|(key, term)| miss(program, clause, desc, *key, term)).collect();
        let line = match misses.is_empty() {
            true => format!("the rule for {plan} fits, but its conditions do not hold"),
            false => format!("the rule for {plan} {}", misses.join(" and ")),
        };
        near.push((misses.len(), line));
    }
    near.sort_by_key(|it| it.0);
    if near.is_empty() {
        let given = desc.get(kind).and_then(Value::as_symbol);
        return given.and_then(|given| meant(given, &types)).into_iter().collect();
    }
    near.into_iter().take(MOST).map(|it| it.1).collect()
}

/// Which type was meant by one that no rule is for.
fn meant(given: Symbol, types: &[Symbol]) -> Option<String> {
    let alike = |name: &Symbol| strsim::jaro_winkler(given.as_str(), name.as_str());
    let near = types.iter().map(|name| (alike(name), name)).filter(|it| it.0 >= ALIKE);
    let (_, name) = near.max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.as_str().cmp(a.1.as_str())))?;
    Some(format!("no rule is for the type {given}; did you mean {name}?"))
}

/// The kind and the properties that a rule wants: in its head, or where its body begins to look at the action.
fn wanted(clause: &Clause) -> Option<(Symbol, Vec<(Symbol, Term)>)> {
    let head = clause.head.first()?;
    properties(head).or_else(|| {
        conjuncts(&clause.body).into_iter().find_map(|goal| match &goal.kind {
            GoalKind::Matches(pattern, action) if action == head => properties(pattern),
            _ => None,
        })
    })
}

fn properties(pattern: &Term) -> Option<(Symbol, Vec<(Symbol, Term)>)> {
    match pattern {
        Term::Desc(kind, properties) => Some((*kind, properties.clone())),
        Term::Const(value) => {
            let desc = value.as_desc()?;
            let constant = |(key, value): (Symbol, &Value)| (key, Term::Const(value.clone()));
            Some((desc.kind, desc.properties().map(constant).collect()))
        }
        _ => None,
    }
}

/// Why a property does not fit, if one can say.
fn miss(program: &Program, clause: &Clause, desc: &Desc, key: Symbol, wanted: &Term) -> Option<String> {
    let wanted_text = || show::term(program, wanted, &clause.vars);
    match (desc.get(key), wanted) {
        (None, Term::Var(_) | Term::Any) => Some(format!("needs a property {key}")),
        (None, _) => Some(format!("needs ({key} {})", wanted_text())),
        (Some(value), Term::Const(constant)) if value != constant => {
            Some(format!("is for ({key} {})", wanted_text()))
        }
        _ => None,
    }
}

/// The name of the plan that a rule gives.
fn plan_of(program: &Program, clause: &Clause, call: &Term) -> String {
    let first = match call {
        Term::Pair(first, _) => match &**first {
            Term::Const(value) => Some(value.clone()),
            _ => None,
        },
        Term::Const(value) => value.as_pair().map(|pair| pair.0.clone()),
        _ => None,
    };
    match first {
        Some(Value::Imm(Imm::Function(id))) => format!("`{}`", program.functions[id.at()].name),
        Some(Value::Imm(Imm::Symbol(name))) => format!("`{name}`"),
        _ => show::term(program, call, &clause.vars),
    }
}
