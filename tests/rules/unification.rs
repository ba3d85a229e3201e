//! Unification of random terms: what holds of it whatever the terms are.
//!
//! A term is thrown as a recipe and built twice, once from cells and once with its parts without variables
//! as values from outside, which are opened only when somebody looks inside.

use vm::desc::Desc;
use vm::rules::store::{Cell, Outside, Shape, Store};
use vm::value::{Map, Symbol, Value};

use crate::dice::Dice;

/// How often terms are thrown.
const THROWS: u64 = 20_000;

#[derive(Clone, Debug)]
enum Recipe {
    Var(usize),
    Leaf(Value),
    Pair(Box<Recipe>, Box<Recipe>),
    Vector(Vec<Recipe>),
    /// `{:a … :b …}`
    Map(Vec<Recipe>),
    /// `(an object (a …) (b …))`
    Desc(Vec<Recipe>),
}

const KEYS: [&str; 3] = ["a", "b", "c"];
const VARS: usize = 4;

struct Nobody;
impl Outside for Nobody {
    fn task(&self, _: u32) -> Value {
        Value::NIL
    }
}

fn throw(dice: &mut Dice, depth: usize) -> Recipe {
    let some = |dice: &mut Dice, most: usize| {
        (0..dice.below(most + 1)).map(|_| throw(dice, depth - 1)).collect::<Vec<_>>()
    };
    match dice.below(if depth == 0 { 5 } else { 11 }) {
        0 | 1 => Recipe::Var(dice.below(VARS)),
        2 => Recipe::Leaf(Value::int(dice.below(2) as i64)),
        3 => Recipe::Leaf(Value::symbol(dice.pick(&["x", "y"]))),
        4 => Recipe::Leaf(if dice.chance(50) { Value::NIL } else { Value::str("text") }),
        5..8 => Recipe::Pair(Box::new(throw(dice, depth - 1)), Box::new(throw(dice, depth - 1))),
        8 => Recipe::Vector(some(dice, 3)),
        9 => Recipe::Map(some(dice, 2)),
        _ => Recipe::Desc(some(dice, 2)),
    }
}

/// The same with some parts changed: two terms by chance have seldom anything in common.
fn vary(dice: &mut Dice, it: &Recipe) -> Recipe {
    if dice.chance(15) {
        return throw(dice, 1);
    }
    let all = |dice: &mut Dice, parts: &[Recipe]| parts.iter().map(|part| vary(dice, part)).collect();
    match it {
        Recipe::Pair(a, b) => Recipe::Pair(Box::new(vary(dice, a)), Box::new(vary(dice, b))),
        Recipe::Vector(parts) => Recipe::Vector(all(dice, parts)),
        Recipe::Map(parts) => Recipe::Map(all(dice, parts)),
        Recipe::Desc(parts) => Recipe::Desc(all(dice, parts)),
        other => other.clone(),
    }
}

/// The value of a recipe without variables.
fn value(it: &Recipe) -> Option<Value> {
    let all = |parts: &[Recipe]| parts.iter().map(value).collect::<Option<Vec<_>>>();
    Some(match it {
        Recipe::Var(_) => return None,
        Recipe::Leaf(value) => value.clone(),
        Recipe::Pair(a, b) => Value::cons(value(a)?, value(b)?),
        Recipe::Vector(parts) => Value::vector(all(parts)?),
        Recipe::Map(parts) => {
            let entries = KEYS.iter().map(|key| Value::keyword(key)).zip(all(parts)?);
            Value::map(entries.collect::<Map>())
        }
        Recipe::Desc(parts) => {
            let properties = KEYS.iter().map(|key| Symbol::from(key)).zip(all(parts)?);
            Value::desc(Desc::new(Symbol::from("object"), properties.collect::<Vec<_>>()))
        }
    })
}

fn build(store: &mut Store, it: &Recipe, vars: &[Cell], opaque: bool) -> Cell {
    if let (true, Some(value)) = (opaque, value(it)) {
        return store.import(&value);
    }
    let parts_of = |store: &mut Store, parts: &[Recipe]| -> Vec<Cell> {
        parts.iter().map(|part| build(store, part, vars, opaque)).collect()
    };
    match it {
        Recipe::Var(n) => vars[*n],
        Recipe::Leaf(value) => store.import(value),
        Recipe::Pair(a, b) => {
            let (a, b) = (build(store, a, vars, opaque), build(store, b, vars, opaque));
            store.pair(a, b)
        }
        Recipe::Vector(parts) => {
            let parts = parts_of(store, parts);
            store.structure(Shape::Vector, parts)
        }
        Recipe::Map(parts) => {
            let parts = parts_of(store, parts);
            let keyed = KEYS.iter().zip(parts).flat_map(|(key, part)| [keyword(key), part]);
            let keyed: Vec<Cell> = keyed.collect();
            store.structure(Shape::Map, keyed)
        }
        Recipe::Desc(parts) => {
            let parts = parts_of(store, parts);
            let keyed = KEYS.iter().zip(parts).flat_map(|(key, part)| [symbol(key), part]);
            let all: Vec<Cell> = std::iter::once(symbol("object")).chain(keyed).collect();
            store.structure(Shape::Desc, all)
        }
    }
}

fn symbol(name: &str) -> Cell {
    Store::default().import(&Value::symbol(name))
}

fn keyword(name: &str) -> Cell {
    Store::default().import(&Value::keyword(name))
}

/// Two terms that share variables, in a store of their own.
fn both(a: &Recipe, b: &Recipe, opaque: bool) -> (Store, [Cell; 2]) {
    let mut store = Store::default();
    let vars: Vec<Cell> = (0..VARS).map(|_| store.fresh()).collect();
    let a = build(&mut store, a, &vars, opaque);
    let b = build(&mut store, b, &vars, opaque);
    (store, [a, b])
}

/// The texts of terms that share variables.
fn texts(store: &Store, terms: [Cell; 2]) -> String {
    let mut vars = Vec::new();
    let export = |term, vars: &mut Vec<u32>| store.export_with(term, &Nobody, vars).expect("terms are small");
    let [a, b] = terms;
    let (a, b) = (export(a, &mut vars), export(b, &mut vars));
    format!("{} {}", vm::print::write(&a), vm::print::write(&b))
}

/// What the naive oracle says of pairs.
fn can_be_same(a: &Recipe, b: &Recipe) -> Option<bool> {
    let (a, b) = (super::naive::Tree::of(a)?, super::naive::Tree::of(b)?);
    Some(super::naive::can_be_same(&a, &b))
}

impl super::naive::Tree {
    /// Of terms without structures.
    fn of(it: &Recipe) -> Option<super::naive::Tree> {
        use super::naive::Tree;
        Some(match it {
            Recipe::Var(n) => Tree::Var(*n),
            Recipe::Leaf(value) => Tree::Leaf(value.clone()),
            Recipe::Pair(a, b) => Tree::Pair((Tree::of(a)?, Tree::of(b)?).into()),
            _ => return None,
        })
    }
}

#[test]
fn unification_is_what_it_should_be() {
    let (mut same, mut judged) = (0, 0);
    for seed in 0..THROWS {
        let mut dice = Dice::new(seed);
        let a = throw(&mut dice, 4);
        let b = if dice.chance(70) { vary(&mut dice, &a) } else { throw(&mut dice, 4) };
        let (mut store, [x, y]) = both(&a, &b, false);
        let before = texts(&store, [x, y]);
        let mark = store.mark();
        store.old = mark.heap;
        let holds = store.unify(x, y).expect("terms are small");
        same += u64::from(holds);
        if let Some(wanted) = can_be_same(&a, &b) {
            assert_eq!(holds, wanted, "the oracle: {a:?} {b:?}");
            judged += 1;
        }
        if holds {
            let after = texts(&store, [x, y]);
            let (one, other) = (store.export(x, &Nobody), store.export(y, &Nobody));
            assert_eq!(
                one.expect("no term contains itself"),
                other.expect("no term contains itself"),
                "sound"
            );
            let bindings = store.trail.len();
            assert!(
                store.unify(x, y).expect("terms are small") && store.trail.len() == bindings,
                "idempotent"
            );
            assert!(store.identical(x, y).expect("terms are small"), "identical then");
            assert_eq!(texts(&store, [x, y]), after);
            // From outside it is the same term with variables of its own.
            let value = store.export(x, &Nobody).expect("terms are small");
            let copy = store.import_open(&value, &mut Vec::new()).expect("terms are small");
            assert_eq!(store.export(copy, &Nobody).expect("terms are small"), value, "there and back");
        }
        store.back_to(mark);
        assert_eq!(texts(&store, [x, y]), before, "undone");

        let (mut store, [x, y]) = both(&a, &b, false);
        assert_eq!(store.unify(y, x).expect("terms are small"), holds, "symmetric: {a:?} {b:?}");
        let whole = texts(&store, [x, x]);
        let (mut store, [x, y]) = both(&a, &b, true);
        assert_eq!(store.unify(x, y).expect("terms are small"), holds, "values from outside: {a:?} {b:?}");
        if holds {
            assert_eq!(texts(&store, [x, x]), whole, "values from outside");
        }
    }
    println!("{same} of {THROWS} pairs unify, the oracle judged {judged}");
    assert!(same * 10 > THROWS && judged * 10 > THROWS);
}
