//! What is nearest to something that no rule answers.

use crate::code::Program;
use crate::desc::Desc;
use crate::value::{Imm, Symbol, Value};

use super::clause::{Clause, Term};
use super::show;

/// How many rules are named.
const MOST: usize = 3;

/// For an action that nothing grounds: the rules whose heads are most like it, and what each misses.
#[must_use]
pub fn to_action(program: &Program, action: &Value) -> Vec<String> {
    let Some(desc) = action.as_desc() else { return Vec::new() };
    let Some(grounding) = program.rules.grounding else { return Vec::new() };
    let clauses = &program.rules.predicates[grounding.at()].clauses;
    let mut near: Vec<(usize, usize, String)> = Vec::new();
    for clause in clauses {
        let Some(wanted) = clause.head.first().and_then(properties) else { continue };
        let plan = clause.head.get(1).map_or_else(String::new, |call| plan_of(program, clause, call));
        let misses: Vec<String> =
            wanted.iter().filter_map(|(key, term)| miss(program, clause, desc, *key, term)).collect();
        let is_of_type =
            wanted.iter().any(|(key, _)| *key == "type") && misses.iter().all(|it| !it.contains("(type"));
        let line = match misses.is_empty() {
            true => format!("the rule for {plan} fits, but its conditions do not hold"),
            false => format!("the rule for {plan} {}", misses.join(" and ")),
        };
        near.push((usize::from(!is_of_type), misses.len(), line));
    }
    near.sort_by_key(|it| (it.0, it.1));
    // Rules for other types say nothing where there is one for this type.
    let best = near.first().map(|it| it.0);
    near.into_iter().filter(|it| Some(it.0) == best).take(MOST).map(|it| it.2).collect()
}

/// The properties that a head wants.
fn properties(head: &Term) -> Option<Vec<(Symbol, Term)>> {
    match head {
        Term::Desc(_, properties) => Some(properties.clone()),
        Term::Const(value) => {
            let desc = value.as_desc()?;
            Some(desc.properties().map(|(key, value)| (key, Term::Const(value.clone()))).collect())
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
