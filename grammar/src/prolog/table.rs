//! What the rules have for Prolog's built-in goals and functions, and what they have not.

/// Goals that are called otherwise here: Prolog's name, number of arguments, our name.
///
/// Their arguments are terms, and stay in their places.
const GOALS: &[(&str, usize, &str)] = &[
    ("!", 0, "cut"),
    ("true", 0, "true"),
    ("fail", 0, "false"),
    ("false", 0, "false"),
    ("=", 2, "=="),
    ("==", 2, "identical?"),
    ("@<", 2, "comes-before?"),
    ("var", 1, "var?"),
    ("ground", 1, "ground?"),
    ("atom", 1, "symbol?"),
    ("number", 1, "number?"),
    ("integer", 1, "integer?"),
    ("float", 1, "float?"),
    ("string", 1, "string?"),
    ("is_list", 1, "list?"),
];

/// Comparisons of numbers: both sides are computed.
const COMPARISONS: &[(&str, &str)] =
    &[("=:=", "="), ("=\\=", "/="), ("<", "<"), (">", ">"), ("=<", "<="), (">=", ">=")];

/// Functions that are called otherwise here.
///
/// `//` cuts towards zero, as `truncate` of two numbers does; `div` rounds down in both languages.
const FUNCTIONS: &[(&str, usize, &str)] = &[
    ("//", 2, "truncate"),
    ("**", 2, "expt"),
    ("^", 2, "expt"),
    ("/\\", 2, "bit-and"),
    ("\\/", 2, "bit-or"),
    ("xor", 2, "bit-xor"),
    ("\\", 1, "bit-not"),
    ("<<", 2, "shift"),
    ("succ", 1, "1+"),
    ("plus", 2, "+"),
];

/// Goals and terms with a meaning that the rules have not, and what to do instead.
const NOT_TAKEN: &[(&[&str], &str)] = &[
    (
        &["assert", "asserta", "assertz", "retract", "retractall", "abolish", "nb_setval", "b_setval"],
        "rules change nothing: a plan gives facts with `with-facts`, or collects answers with `findall`",
    ),
    (
        &["=..", "functor", "arg", "copy_term"],
        "a compound term is a list here: take `f(X)` apart as `[F|Arguments]`",
    ),
    (
        &[
            "write",
            "writeln",
            "print",
            "writeq",
            "write_canonical",
            "nl",
            "tab",
            "format",
            "put_char",
            "read",
        ],
        "rules only answer: print in the plan that asks",
    ),
    (&["catch", "throw"], "what goes wrong is a failure of the plan that asks, which handles it"),
    (&["halt", "consult", "include"], "it belongs into a plan; files are loaded with `use` and `use-rules`"),
    (&["aggregate_all"], "use `findall` and then `length` or a fold over the list"),
    (&["phrase"], "grammar rules are not taken: write the lists as arguments"),
];

fn find(table: &[(&str, usize, &'static str)], name: &str, count: usize) -> Option<&'static str> {
    table.iter().find(|row| (row.0, row.1) == (name, count)).map(|row| row.2)
}

pub(super) fn goal(name: &str, count: usize) -> Option<&'static str> {
    find(GOALS, name, count)
}

pub(super) fn comparison(name: &str, count: usize) -> Option<&'static str> {
    COMPARISONS.iter().find(|row| row.0 == name && count == 2).map(|row| row.1)
}

pub(super) fn function(name: &str, count: usize) -> Option<&'static str> {
    find(FUNCTIONS, name, count)
}

/// What to do instead of a goal that is not taken.
pub(super) fn not_taken(name: &str) -> Option<&'static str> {
    NOT_TAKEN.iter().find(|row| row.0.contains(&name)).map(|row| row.1)
}

/// Goals with a shape of their own, see `translate`.
const SHAPED: &[(&str, usize)] = &[
    (",", 2),
    (";", 2),
    ("->", 2),
    ("*->", 2),
    ("\\+", 1),
    ("not", 1),
    ("\\=", 2),
    ("\\==", 2),
    ("@>", 2),
    ("@=<", 2),
    ("@>=", 2),
    ("is", 2),
    ("nonvar", 1),
    ("once", 1),
    ("forall", 2),
    ("findall", 3),
    ("bagof", 3),
    ("setof", 3),
];

/// True if Prolog text cannot give clauses to this predicate.
pub(super) fn is_built_in(name: &str, count: usize) -> bool {
    goal(name, count).is_some()
        || comparison(name, count).is_some()
        || SHAPED.contains(&(name, count))
        || (name == "call" && count > 0)
}

/// A constant of arithmetic that is a number here.
pub(super) fn constant(name: &str) -> Option<f64> {
    Some(match name {
        "e" => std::f64::consts::E,
        "inf" | "infinite" => f64::INFINITY,
        "nan" => f64::NAN,
        "epsilon" => f64::EPSILON,
        _ => return None,
    })
}
