//! What is written reads back: random values with odd names, texts and numbers in them. Data read back
//! in a quoted form, all else as an expression (see the reference, "Printing").

use std::collections::BTreeMap;

use grammar::{FileId, FormKind};
use pleach::read::Reader;
use pleach::{Options, Session};
use proptest::prelude::*;
use vm::desc::{Desc, KINDS};
use vm::edit::{Edit, What};
use vm::path::{Path, PathStep};
use vm::print::write;
use vm::value::{Obj, Symbol, Value};

fn run(text: &str) -> Result<Value, String> {
    Session::new(Options::default()).run_text("written.plan", text).outcome
}

/// The values of some texts, each quoted if the value is data.
#[track_caller]
fn check_reads_back(values: &[Value]) {
    let expression = |value: &Value| format!("{}{}", if is_data(value) { "'" } else { "" }, write(value));
    let text = values.iter().map(|value| expression(value) + "\n").collect::<String>();
    let read = run(&format!("(list\n{text})")).unwrap_or_else(|why| panic!("{why}\n{text}"));
    let reader = Reader::default();
    for (value, read) in values.iter().zip(read.to_vec().expect("it is a list")) {
        assert_eq!(write(value), write(&read));
        assert!(*value == read, "{}", write(value));
        assert!(*value == reader.value(&write(value)), "{}", write(value));
    }
}

/// True for what can stand in a quoted form.
fn is_data(value: &Value) -> bool {
    match value.obj() {
        None | Some(Obj::Str(_)) => true,
        Some(Obj::Pair(first, rest)) => is_data(first) && rest.is_list() && is_data(rest),
        Some(Obj::Vector(items)) => items.iter().all(is_data),
        Some(Obj::Map(map)) => map.iter().all(|(key, value)| is_data(key) && is_data(value)),
        Some(_) => false,
    }
}

// ---------------------------------------------------------------------------------------------
// Random values

/// Texts with what is special to the reader and what nobody can see.
fn odd_text() -> impl Strategy<Value = String> {
    let special = "()[]{}'`,@|;:#\"\\.?&%/+-e019ax \n\t\r\0\u{7}\u{1b}\u{7f}\u{85}ö→λ“\u{a0}\u{ad}\u{200b}\u{202e}\u{2066}\u{feff}\u{e000}\u{1f600}";
    let special: Vec<char> = special.chars().collect();
    let odd = prop_oneof![3 => prop::sample::select(special), 1 => any::<char>()];
    prop::collection::vec(odd, 0..6).prop_map(String::from_iter)
}

/// Names of programs, names that look like something else, and any text.
fn name() -> impl Strategy<Value = String> {
    const NAMES: &[&str] = &[
        "milk", "a", "an", "quote", "unquote", "list", "?x", "?_", ".", "..", "1+", "12", "-1", "+inf", "+x",
        ".5", "&rest", "guard", "call", "2d", "@", "a:b", "nill", "#", "...", "-",
    ];
    prop_oneof![prop::sample::select(NAMES).prop_map(String::from), odd_text()]
}

fn symbol() -> impl Strategy<Value = String> {
    name().prop_filter("nil, true and false are no symbols", |name| {
        !["nil", "true", "false"].contains(&name.as_str())
    })
}

fn path() -> impl Strategy<Value = Path> {
    let step = (name(), prop_oneof![Just(1), 1..=u32::MAX]);
    let step = step.prop_map(|(name, call)| PathStep { name: Symbol::from(&name), call });
    prop::collection::vec(step, 0..4).prop_map(|steps| Path { steps })
}

fn edit(value: BoxedStrategy<Value>) -> impl Strategy<Value = Value> {
    let key = name().prop_filter("a guard is no parameter", |name| name != "guard");
    let after = || prop::collection::vec(path(), 0..3);
    let what = prop_oneof![
        prop::option::of(value.clone()).prop_map(What::Skip),
        value.clone().prop_map(What::Replace),
        value.clone().prop_map(What::Wrap),
        (key, value.clone()).prop_map(|(key, value)| What::WithParam(Symbol::from(&key), value)),
        after().prop_map(What::Defer),
        (value.clone(), after(), symbol()).prop_map(|(code, after, name)| {
            let name = Symbol::from(&name);
            What::Owe { code, after, name }
        }),
    ];
    let guard = prop::collection::btree_map(name(), value, 0..3);
    let out_of = prop::collection::vec(symbol(), 0..3);
    let parts = (path(), what, guard, out_of);
    parts.prop_map(|(at, what, guard, names): (Path, What, BTreeMap<String, Value>, Vec<String>)| {
        let moves = matches!(what, What::Defer(_) | What::Owe { .. });
        let out_of = names.iter().filter(|_| moves).map(|name| Symbol::from(name)).collect();
        let guard = guard.into_iter().map(|(key, value)| (Symbol::from(&key), value)).collect();
        Value::new(Obj::Edit(Box::new(Edit { at, what, guard, by: None, out_of })))
    })
}

/// Values without parts that are values.
fn atom() -> BoxedStrategy<Value> {
    let geometry = run(
        "(list (vec3 1 -0.0 1e-7) (vec3 0 1e300 3) (pose 1 2 3) (pose '|odd frame| 1 2 3 :yaw 0.3 :roll 2))",
    );
    let geometry = geometry.expect("this computes").to_vec().expect("it is a list");
    prop_oneof![
        Just(Value::NIL),
        any::<bool>().prop_map(Value::bool),
        any::<i64>().prop_map(Value::int),
        any::<f64>().prop_map(Value::float),
        symbol().prop_map(|name| Value::symbol(&name)),
        name().prop_map(|name| Value::keyword(&name)),
        odd_text().prop_map(Value::str),
        prop::sample::select(geometry),
        path().prop_map(|path| Value::new(Obj::Path(Box::new(path)))),
    ]
    .boxed()
}

fn value() -> impl Strategy<Value = Value> {
    atom().prop_recursive(5, 40, 4, |inner| {
        let items = prop::collection::vec(inner.clone(), 0..4);
        // A key that is no number is not refused anywhere.
        let keys =
            prop_oneof![symbol().prop_map(|name| Value::symbol(&name)), odd_text().prop_map(Value::str)];
        let entries = prop::collection::vec((keys, inner.clone()), 0..4);
        let properties = prop::collection::vec((name(), inner.clone()), 0..4);
        prop_oneof![
            3 => items.clone().prop_map(Value::list),
            1 => (items.clone(), inner.clone()).prop_map(|(items, end)| Value::list_onto(items, end)),
            1 => inner.clone().prop_map(|form| Value::list([Value::symbol("quote"), form])),
            2 => items.prop_map(Value::vector),
            2 => entries.prop_map(|entries| Value::map(entries.into_iter().collect())),
            3 => (prop::sample::select(&KINDS[..]), properties).prop_map(|(kind, properties)| {
                let properties = properties.into_iter().map(|(key, value)| (Symbol::from(&key), value));
                Value::desc(Desc::new(Symbol::from(kind), properties.collect()))
            }),
            2 => edit(inner),
        ]
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn random_values_read_back(values in prop::collection::vec(value(), 20)) {
        check_reads_back(&values);
    }
}

// ---------------------------------------------------------------------------------------------
// Names

/// The one symbol that a text is.
fn read_symbol(text: &str) -> Option<Symbol> {
    let parsed = grammar::parse(FileId(0), text);
    match parsed.forms.as_slice() {
        [form] if parsed.errors.is_empty() => match &form.kind {
            FormKind::Symbol(name) => Some(*name),
            _ => None,
        },
        _ => None,
    }
}

#[test]
fn names_with_any_character_read_back_and_have_bars_only_where_they_must() {
    for c in (0..=0x3_0000).chain([0xe_0001, 0xf_0000, 0x10_ffff]).filter_map(char::from_u32) {
        for name in [format!("x{c}y"), format!("{c}y")] {
            let written = write(&Value::symbol(&name));
            let symbol = Some(Symbol::from(&name));
            assert_eq!(read_symbol(&written), symbol, "{written}");
            let is_plain = c != '|' && read_symbol(&name) == symbol;
            assert_eq!(written == name, is_plain, "{}", name.escape_unicode());
        }
    }
}
