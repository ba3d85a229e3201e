//! Scene files as data, without the language: this crate stands below its reader.
//!
//! Reads what scene files need: lists, symbols, numbers, strings, comments, and `,@name` for the entries of
//! another scene.

use vm::value::Value;

const TABLEWARE: &str = include_str!("../../scenes/tableware.plan");
const KITCHEN: &str = include_str!("../../scenes/kitchen.plan");
const ROBOTS: &str = include_str!("../../plans/robots.plan");

/// The entries of the shipped kitchen.
pub fn kitchen() -> Value {
    let mut entries = definition(TABLEWARE, "tableware");
    entries.extend(definition(KITCHEN, "kitchen"));
    Value::list(entries)
}

/// The types of objects that are shipped, then some entries.
pub fn with_tableware(entries: &str) -> Value {
    let mut all = definition(TABLEWARE, "tableware");
    all.extend(read(entries));
    Value::list(all)
}

/// The description of a shipped robot.
pub fn robot(name: &str) -> Value {
    Value::list(definition(ROBOTS, name))
}

/// What follows name and docstring in a definition.
fn definition(text: &str, name: &str) -> Vec<Value> {
    let forms = read(text);
    let found = forms
        .iter()
        .filter_map(Value::to_vec)
        .find(|form| form.get(1).and_then(Value::as_symbol).is_some_and(|it| it == name) && form.len() > 3);
    let found = found.unwrap_or_else(|| panic!("{name} is defined"));
    found[3..].iter().filter(|it| it.is_list()).cloned().collect()
}

/// All forms of a text.
pub fn read(text: &str) -> Vec<Value> {
    let mut stack: Vec<Vec<Value>> = vec![Vec::new()];
    let mut rest = text;
    loop {
        rest = rest.trim_start();
        let Some(first) = rest.chars().next() else { break };
        match first {
            ';' => rest = rest.split_once('\n').map_or("", |(_, rest)| rest),
            '(' => {
                stack.push(Vec::new());
                rest = &rest[1..];
            }
            ')' => {
                let list = Value::list(stack.pop().expect("a list is open"));
                stack.last_mut().expect("brackets match").push(list);
                rest = &rest[1..];
            }
            '"' => {
                let (text, after) = rest[1..].split_once('"').expect("a string ends");
                stack.last_mut().expect("brackets match").push(Value::str(text));
                rest = after;
            }
            _ => {
                let end = rest.find(|c: char| c.is_whitespace() || "();\"".contains(c)).unwrap_or(rest.len());
                let word = &rest[..end];
                let value = match (word.parse::<i64>(), word.parse::<f64>()) {
                    (Ok(number), _) => Value::int(number),
                    (_, Ok(number)) => Value::float(number),
                    _ => Value::symbol(word),
                };
                stack.last_mut().expect("brackets match").push(value);
                rest = &rest[end..];
            }
        }
    }
    stack.pop().expect("brackets match")
}
