//! What is said about mistakes, and about what is not taken.

use super::*;

#[test]
fn one_mistake_is_one_error_and_costs_one_clause() {
    let clauses = [
        "b(X :- c.",
        "b(]).",
        "b).",
        "b([a|).",
        "b :- c d.",
        "b :- , c.",
        "b :- c, .",
        "b(X, ).",
        "b().",
        "b = c = d.",
        "b('x).",
        "b(\"x).",
        "b(0x).",
        "b(12abc).",
        "b(\"\\q\").",
        "b({}).",
        "b --> c.",
        "?- b.",
        ":- op(700, xfx, ===).",
        "b :- 3.",
        "3 :- b.",
        "X :- b.",
        "b(`x`).",
        "b(0'').",
        "b('\\xFFFFFFF\\').",
        "b(€).",
        "b :- assertz(x).",
        ".",
        "b :- .",
        "b c d e f.",
        "b :- x = \\+ y.",
    ];
    for clause in clauses {
        let (heads, errors) = heads(&format!("a.\n{clause}\nz(z).\n"));
        assert_eq!(errors, 1, "{clause}");
        assert!(heads.contains(&"(a)".into()) && heads.contains(&"(z z)".into()), "{clause}: {heads:?}");
    }
}

#[test]
fn brackets_and_quotes() {
    check_errors(
        "p(a, [b.\nq.",
        expect![[r#"
        prolog::unclosed: `[` is never closed
          1:6 `[` opened here
          help: the missing end is `]`
    "#]],
    );
    check_errors(
        "p(a :- b.\nq.",
        expect![[r#"
        prolog::unclosed: `(` is never closed
          1:2 `(` opened here
          help: the missing end is `)`
    "#]],
    );
    check_errors(
        "p(a].\nq).",
        expect![[r#"
        parse::mismatched: `(` is closed by `]`
          1:4 `]` closed here
          1:2 `(` opened here
          help: close each bracket with its own kind, the last opened first
        parse::stray_close: `)` closes nothing
          2:2 `)` nothing is open here
          help: delete it, or look whether the form before it ends too early
    "#]],
    );
    check_errors(
        "p('milk).\nq(\"milk).\nr(`milk).",
        expect![[r#"
            prolog::unclosed: a quoted name is never closed
              1:3 `\'` opened here
              help: end it with `'` on the same line; a line end in it is written `\n`
            prolog::unclosed: a string is never closed
              2:3 `\"` opened here
              help: end it with `"` on the same line; a line end in it is written `\n`
            prolog::unclosed: a text in back quotes is never closed
              3:3 ``` opened here
              help: end it with ``` on the same line; a line end in it is written `\n`
        "#]],
    );
    check_errors(
        "p. /* never\nq.",
        expect![[r#"
        prolog::unclosed: a comment is never closed
          1:4 `/*` opened here
          help: end it with `*/`; such comments do not nest in Prolog
    "#]],
    );
    check_errors(
        "p(a)",
        expect![[r#"
        prolog::no_end: the last clause has no end
          1:4 `)` the text ends here
          help: write `.` after it
    "#]],
    );
    check_errors(
        "p(a,",
        expect![[r#"
        prolog::unclosed: `(` is never closed
          1:2 `(` opened here
          help: the missing end is `)`
    "#]],
    );
}

#[test]
fn what_is_no_term() {
    check_errors(
        "p(a)\nq(b).",
        expect![[r#"
        prolog::unexpected: `q` cannot stand here
          2:1 `q` here
          help: does the clause before it end with `.`?
    "#]],
    );
    check_errors(
        "p :- a b.",
        expect![[r#"
        prolog::unexpected: `b` cannot stand here
          1:8 `b` here
          help: an operator, a comma or the end of the clause `.` is missing before it
    "#]],
    );
    check_errors(
        "p :- a, .",
        expect![[r#"
        prolog::unexpected: `.` cannot stand here
          1:9 `.` here
          help: something is missing before it
    "#]],
    );
    check_errors(
        "p :- a, = b.",
        expect![[r#"
            prolog::unexpected: `=` cannot stand here
              1:9 `=` here
              help: something is missing before it
        "#]],
    );
    check_errors(
        "p :- a = b = c.",
        expect![[r#"
            prolog::unexpected: `=` cannot stand here
              1:12 `=` here
              help: it does not go with what is around it: brackets help, as in `(a = b) = c`
        "#]],
    );
    check_errors(
        "p :- a = \\+ b.",
        expect![[r#"
        prolog::unexpected: `\+` cannot stand here
          1:10 `\\+` here
          help: put it in brackets: it does not go with the operator before it
    "#]],
    );
    check_errors(
        "p([a | b, c]).",
        expect![[r#"
            prolog::unexpected: `,` cannot stand here
              1:9 `,` here
              help: behind the `|` of a list stands one term, the rest of the list
        "#]],
    );
    check_errors(
        "p().",
        expect![[r#"
        prolog::unexpected: `)` cannot stand here
          1:3 `)` here
          help: something is missing before it
    "#]],
    );
    check_errors(
        "a :- b :- c.",
        expect![[r#"
            prolog::unexpected: `:-` cannot stand here
              1:8 `:-` here
              help: it does not go with what is around it: brackets help, as in `(a = b) = c`
        "#]],
    );
}

#[test]
fn words_that_are_wrong() {
    check_errors(
        "p(12abc, 1_, 9223372036854775808, 0'', 1.0Inf).",
        expect![[r#"
            parse::number: `12abc` is not a number
              1:3 `12abc` here
              help: numbers are `42`, `1_000`, `0xff`, `0o17`, `0b101`, `0'a`, `1.5`, `2.0e3`; a name does not begin with a digit
            parse::number: `1_` is not a number
              1:10 `1_` here
              help: numbers are `42`, `1_000`, `0xff`, `0o17`, `0b101`, `0'a`, `1.5`, `2.0e3`; a name does not begin with a digit
            parse::number: `9223372036854775808` does not fit into 64 bits
              1:14 `9223372036854775808` here
              help: integers go from -9223372036854775808 to 9223372036854775807; write a float, such as `1e30`, for more
            parse::number: `0''` is not a number
              1:35 `0\'\'` here
              help: a character's number is written `0'a`, `0'''` for the quote, `0'\n` for a line end
        "#]],
    );
    check_errors(
        "p(\"C:\\plans\", '\\xFFFFFF\\').",
        expect![[r#"
            parse::escape: `\p` is no escape
              1:6 `\\p` here
              help: the escapes are `\n`, `\t`, `\r`, `\a`, `\b`, `\f`, `\v`, `\e`, `\s`, `\\`, `\'`, `\"`, and `\x1F600\`, `\u00e9`, `\351\` for a character's number
            parse::escape: `\xFFFFFF\` is no escape
              1:16 `\\xFFFFFF\\` here
              help: no character has this number; it is written `\x1F600\`, `\u00e9` or `\351\`
        "#]],
    );
    check_errors(
        "p(“a”).",
        expect![[r#"
        parse::character: `“` cannot stand here
          1:3 `“` here
          help: use the plain quotes `'` and `"`
        parse::character: `”` cannot stand here
          1:7 `”` here
          help: use the plain quotes `'` and `"`
    "#]],
    );
    check_errors(
        "p(\"a\u{1b}b\").",
        expect![[r#"
        parse::character: `\u{1b}` cannot stand here
          1:5 `\u{1b}` here
          help: an invisible character is written by its number: `\x1b\`
    "#]],
    );
}

#[test]
fn what_is_not_taken() {
    check_errors(
        "p :- assertz(q), X =.. [a], write(X), catch(a, _, b), aggregate_all(count, q, N).",
        expect![[r#"
            prolog::not_taken: `assertz` is not taken from Prolog text
              1:6 `assertz(q)` here
              help: rules change nothing: a plan gives facts with `with-facts`, or collects answers with `findall`
            prolog::not_taken: `=..` is not taken from Prolog text
              1:18 `X =.. [a]` here
              help: a compound term is a list here: take `f(X)` apart as `[F|Arguments]`
            prolog::not_taken: `write` is not taken from Prolog text
              1:29 `write(X)` here
              help: rules only answer: print in the plan that asks
            prolog::not_taken: `catch` is not taken from Prolog text
              1:39 `catch(a, _, b)` here
              help: what goes wrong is a failure of the plan that asks, which handles it
            prolog::not_taken: `aggregate_all` is not taken from Prolog text
              1:55 `aggregate_all(count, q, N)` here
              help: use `findall` and then `length` or a fold over the list
        "#]],
    );
    check_errors(
        "p --> [a], q.\n?- p.\np({a}).\np(`a`).",
        expect![[r#"
        prolog::not_taken: a grammar rule `-->` is not taken from Prolog text
          1:1 `p --> [a], q` here
          help: write a rule with the lists as two more arguments
        prolog::not_taken: a query is not taken from Prolog text
          2:1 `?- p` here
          help: delete it; ask with `(ask goal)` in a plan, or on the command line
        prolog::not_taken: a term in curly brackets is not taken from Prolog text
          3:3 `{a}` here
          help: write a compound term or a list
        prolog::not_taken: a list of codes in back quotes is not taken from Prolog text
          4:3 ``a`` here
          help: write a string, `"text"`
    "#]],
    );
    check_errors(
        ":- op(700, xfx, likes).\n:- initialization(main).\n:- initialization main.\n:- module(a, [p/1]).\n:- use_module(library(clpfd)).\n:- set_prolog_flag(a, b).\n:- table p(_, min).\n:- X.",
        expect![[r#"
            prolog::not_taken: the directive `op` is not taken from Prolog text
              1:4 `op(700, xfx, likes)` here
              help: operators cannot be added: write such terms as `name(a, b)`
            prolog::not_taken: the directive `initialization` is not taken from Prolog text
              2:4 `initialization(main)` here
              help: delete it and ask from a plan
            prolog::not_taken: the directive `initialization` is not taken from Prolog text
              3:4 `initialization main` here
              help: delete it and ask from a plan
            prolog::not_taken: the directive `module` is not taken from Prolog text
              4:4 `module(a, [p/1])` here
              help: delete it: all predicates of a file are seen by who uses it
            prolog::not_taken: the directive `use_module` is not taken from Prolog text
              5:4 `use_module(library(clpfd))` here
              help: the predicates for lists are always there, other libraries are not; load your own files with `use-rules`
            prolog::not_taken: the directive `set_prolog_flag` is not taken from Prolog text
              6:4 `set_prolog_flag(a, b)` here
              help: delete it, or say in a plan what it does
            prolog::not_taken: this form of a declaration is not taken from Prolog text
              7:10 `p(_, min)` here
              help: write names with their numbers of arguments: `p/2, q/1`
            prolog::not_callable: a variable is no directive
              8:4 `X` here
              help: a directive is a name with its arguments
        "#]],
    );
    check_errors(
        "p :- lists:append(X, Y, Z).\nm:p.\np :- \\+(a, b).\np :- a, ... .",
        expect![[r#"
        prolog::not_taken: the module of a goal is not taken from Prolog text
          1:6 `lists:append(X, Y, Z)` here
          help: write the goal alone
        prolog::not_taken: the module of a predicate is not taken from Prolog text
          2:2 `:` here
          help: write the name alone
        prolog::not_taken: `\+` of 2 arguments is not taken from Prolog text
          3:6 `\\+(a, b)` here
          help: write `\+ (a, b)` with a blank, or `not((a, b))`, for more than one goal
        prolog::not_taken: `...` is not taken from Prolog text
          4:9 `...` here
          help: write the goals that it stands for, or delete it
    "#]],
    );
    check_errors(
        "p :- X is round(Y).\np('?x', '.').\nX = Y :- a.\n(a, b) :- c.\nnot(X) :- a.",
        expect![[r#"
        prolog::not_taken: the function `round` is not taken from Prolog text
          1:11 `round(Y)` here
          help: halves go to the even number in our `round`: write `floor(X + 0.5)`
        prolog::not_taken: the name `?x` is not taken from Prolog text
          2:3 `\'?x\'` here
          help: it would be a variable here; give it another name
        prolog::not_taken: the name `.` is not taken from Prolog text
          2:9 `\'.\'` here
          help: a list of one is written `[X]`, a pair `[X|Y]`
        prolog::not_taken: a clause of the built-in `=` is not taken from Prolog text
          3:1 `X = Y` here
          help: give your predicate another name
        prolog::not_taken: a clause of the built-in `,` is not taken from Prolog text
          4:1 `(a, b)` here
          help: give your predicate another name
        prolog::not_taken: a clause of the built-in `not` is not taken from Prolog text
          5:1 `not(X)` here
          help: give your predicate another name
    "#]],
    );
}

#[test]
fn what_cannot_be_called() {
    check_errors(
        "p :- 3, \"a\", [b].\n3.\nX :- a.\n\"a\" :- b.\n:- 3.",
        expect![[r#"
        prolog::not_callable: a number is no goal
          1:6 `3` here
          help: a goal is a name with its arguments, such as `p(X)`
        prolog::not_callable: a string is no goal
          1:9 `\"a\"` here
          help: a goal is a name with its arguments, such as `p(X)`
        prolog::not_callable: this term is no goal
          1:14 `[b]` here
          help: a goal is a name with its arguments, such as `p(X)`
        prolog::not_callable: a number is no head of a clause
          2:1 `3` here
          help: a head is a name with its arguments, such as `p(X)`
        prolog::not_callable: a variable is no head of a clause
          3:1 `X` here
          help: a head is a name with its arguments, such as `p(X)`
        prolog::not_callable: a string is no head of a clause
          4:1 `\"a\"` here
          help: a head is a name with its arguments, such as `p(X)`
        prolog::not_callable: a number is no directive
          5:4 `3` here
          help: a directive is a name with its arguments
    "#]],
    );
}

#[test]
fn names_that_fall_together_or_apart() {
    check_errors(
        "p(sink_area).\nq('sink_area').\nr('sink_area').",
        expect![[r#"
        prolog::two_names: `sink_area` and `'sink_area'` are one name in Prolog and two here
          2:3 `\'sink_area\'` here it is written so
          1:3 `sink_area` and here so
          help: write both with quotes to keep the `_`, or both without to get `-` for it
    "#]],
    );
    check_errors(
        "p(sink_area).\nq('sink-area').",
        expect![[r#"
        prolog::two_names: `sink_area` and `sink-area` are two names in Prolog and both `sink-area` here
          2:3 `\'sink-area\'` here it is written so
          1:3 `sink_area` and here so
          help: give one of the two another name
    "#]],
    );
    check_errors(
        "p(nil).\nq([]).",
        expect![[r#"
        prolog::two_names: `nil` and `[]` are two names in Prolog and both `nil` here
          2:3 `[]` here it is written so
          1:3 `nil` and here so
          help: give one of the two another name
    "#]],
    );
    let (_, errors) = heads("p(sink_area, a, 'a', nil).\nq(sink_area, 'CounterTop').");
    assert_eq!(errors, 0);
}

#[test]
fn a_file_that_is_no_text() {
    let parsed = prolog::parse_bytes(FileId(0), "it", b"p(gr\xf6).");
    assert_eq!(lines(&parsed.errors), "byte 4 is no UTF-8 (line 1, column 5)\n");
    let parsed = prolog::parse(FileId(0), "it", &"p(1x).\n".repeat(250));
    assert_eq!(
        (parsed.errors.len(), parsed.errors.last().map(ToString::to_string)),
        (101, Some("150 more errors are not shown".into()))
    );
}
