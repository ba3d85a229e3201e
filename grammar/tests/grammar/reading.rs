//! Text to forms, and what is said about mistakes.

use std::fmt::Write;

use expect_test::{Expect, expect};
use grammar::{Completeness, FileId, ParseError, completeness, parse, parse_bytes};
use miette::Diagnostic;

/// The forms of `source` as they are printed, one a line.
#[track_caller]
fn check_parse(source: &str, expected: Expect) {
    let parsed = parse(FileId(0), source);
    assert_eq!(parsed.errors, [], "in\n{source}");
    expected.assert_eq(&lines(&parsed.forms));
}

/// The forms that were saved, then each error with its labels and help.
#[track_caller]
fn check_errors(source: &str, expected: Expect) {
    let parsed = parse(FileId(0), source);
    let errors: String = parsed.errors.iter().map(|error| render(source, error)).collect();
    expected.assert_eq(&(lines(&parsed.forms) + &errors));
}

pub fn lines<T: ToString>(items: &[T]) -> String {
    items.iter().map(|item| item.to_string() + "\n").collect()
}

pub fn render(source: &str, error: &ParseError) -> String {
    let mut out = format!("{}: {error}\n", error.code().expect("each error has a code"));
    for label in error.labels().into_iter().flatten() {
        let (start, end) = (label.offset(), label.offset() + label.len());
        let line = source[..start].matches('\n').count() + 1;
        let column = start - source[..start].rfind('\n').map_or(0, |at| at + 1) + 1;
        let text = source[start..end].escape_debug();
        writeln!(out, "  {line}:{column} `{text}` {}", label.label().unwrap_or_default())
            .expect("a string takes all");
    }
    if let Some(help) = error.help() {
        writeln!(out, "  help: {help}").expect("a string takes all");
    }
    out
}

#[test]
fn forms() {
    check_parse(
        "milk + ?type 1+ ... a.b/c",
        expect![[r#"
        milk
        +
        ?type
        1+
        ...
        a.b/c
    "#]],
    );
    check_parse(
        ":on :a-b :|odd one| ::x :2",
        expect![[r#"
        :on
        :a-b
        :|odd one|
        ::x
        :2
    "#]],
    );
    check_parse(
        "42 -7 +5 0xff 0b101 1_000 -0x8000000000000000",
        expect![[r#"
        42
        -7
        5
        255
        5
        1000
        -9223372036854775808
    "#]],
    );
    check_parse(
        "1.5 2e3 1e100 +inf -inf +nan -0.0 1_0.5",
        expect![[r#"
        1.5
        2000.0
        1e100
        +inf
        -inf
        +nan
        -0.0
        10.5
    "#]],
    );
    check_parse(
        r#""a\n\t\"\\\u{1F600}" "" "two
lines""#,
        expect![[r#"
    "a\n\t\"\\😀"
    ""
    "two\nlines"
"#]],
    );
    check_parse(
        "(a (b) ()) [1 [2]] {:a 1 :b {}} (?x . ?xs)",
        expect![[r#"
        (a (b) ())
        [1 [2]]
        {:a 1 :b {}}
        (?x . ?xs)
    "#]],
    );
    check_parse(
        "'a `(b ,c ,@d) ''e '()",
        expect![[r#"
        'a
        `(b ,c ,@d)
        ''e
        '()
    "#]],
    );
    check_parse(
        "|odd one| |a\\|b| || größe a|b |12|",
        expect![[r#"
        |odd one|
        a|b
        ||
        größe
        a|b
        |12|
    "#]],
    );
    check_parse(
        "a ; c\n#| b #| c |# |# d\"e\"f(g)h'i",
        expect![[r#"
        a
        d
        "e"
        f
        (g)
        h
        'i
    "#]],
    );
    check_parse(
        "\u{feff}a\u{a0}b\r\n",
        expect![[r#"
        a
        b
    "#]],
    );
    check_parse(
        "#!/bin/pleach\na",
        expect![[r#"
        a
    "#]],
    );
    check_parse("", expect![[r#""#]]);
}

#[test]
fn the_paper_as_printed_parses() {
    // The brackets of Listing 1 put `target` inside `location`.
    let source = "(perform (an action (location (a location (on sink_area) (target (a location))))))";
    check_parse(
        source,
        expect![[r#"
        (perform (an action (location (a location (on sink_area) (target (a location))))))
    "#]],
    );
}

#[test]
fn comments_keep_their_places() {
    let source = "; one\na #| two\n #| three |# |# b ; four\r\n";
    let parsed = parse(FileId(3), source);
    let text: Vec<_> = parsed
        .comments
        .iter()
        .map(|c| (&source[c.span.start as usize..c.span.end as usize], c.block, c.span.file.0))
        .collect();
    assert_eq!(text, [("; one", false, 3), ("#| two\n #| three |# |#", true, 3), ("; four\r", false, 3)]);
}

#[test]
fn one_missing_bracket_is_one_error_and_the_rest_is_read() {
    check_errors(
        "(def-plan a ()\n  (foo)\n  (bar 1\n\n(def-plan b ()\n  (baz))\n(def-fun c (x) x)\n",
        expect![[r#"
            (def-plan a () (foo) (bar 1))
            (def-plan b () (baz))
            (def-fun c (x) x)
            parse::unclosed: `(` is never closed
              3:3 `(` opened here
              5:1 `(` this starts a new definition
              help: the missing end is `))`
        "#]],
    );
}

#[test]
fn indentation_tells_which_bracket_was_forgotten() {
    check_errors(
        "(def-plan a ()\n  (foo (bar 1)\n  (baz))\n\n(def-plan b ())\n",
        expect![[r#"
        (def-plan a () (foo (bar 1) (baz)))
        (def-plan b ())
        parse::unclosed: `(` is never closed
          2:3 `(` opened here
          5:1 `(` this starts a new definition
          help: the missing end is `)`
    "#]],
    );
    check_errors(
        "(def-plan a ()\n  (when x\n    (foo)\n  (bar))\n",
        expect![[r#"
        (def-plan a () (when x (foo) (bar)))
        parse::unclosed: `(` is never closed
          2:3 `(` opened here
          help: the missing end is `)`
    "#]],
    );
}

#[test]
fn brackets() {
    check_errors(
        "(a (b [c",
        expect![[r#"
        (a (b [c]))
        parse::unclosed: `[` is never closed
          1:7 `[` opened here
          help: the missing end is `]))`
    "#]],
    );
    check_errors(
        "(a [b c) d",
        expect![[r#"
        (a [b c])
        d
        parse::mismatched: `[` is closed by `)`
          1:8 `)` closed here
          1:4 `[` opened here
          help: close each bracket with its own kind, the last opened first
    "#]],
    );
    check_errors(
        "(a b] c",
        expect![[r#"
        (a b)
        c
        parse::mismatched: `(` is closed by `]`
          1:5 `]` closed here
          1:1 `(` opened here
          help: close each bracket with its own kind, the last opened first
    "#]],
    );
    check_errors(
        "(a))) b ]",
        expect![[r#"
        (a)
        b
        parse::stray_close: `)` closes nothing
          1:4 `))` nothing is open here
          help: delete it, or look whether the form before it ends too early
        parse::stray_close: `]` closes nothing
          1:9 `]` nothing is open here
          help: delete it, or look whether the form before it ends too early
    "#]],
    );
    check_errors(
        "{:a (b} c)",
        expect![[r#"
        {:a (b)}
        c
        parse::mismatched: `(` is closed by `}`
          1:7 `}` closed here
          1:5 `(` opened here
          help: close each bracket with its own kind, the last opened first
        parse::stray_close: `)` closes nothing
          1:10 `)` nothing is open here
          help: delete it, or look whether the form before it ends too early
    "#]],
    );
    check_errors(
        "(a (\n(defer b)))",
        expect![[r#"
        (a ((defer b)))
    "#]],
    );
}

#[test]
fn strings_and_comments() {
    check_errors(
        "(print \"hello)\n(foo)",
        expect![[r#"
        (print "")
        parse::unclosed_string: a string is never closed
          1:8 `\"` this string runs to the end of the text
          help: end the string with `"`, or write `\"` for a quote inside it
    "#]],
    );
    check_errors(
        "(def-fun a () \"one)\n(def-fun b () \"two\")\n(def-fun c () \"three\")",
        expect![[r#"
            (def-fun a () "one)\n(def-fun b () " two ")\n(def-fun c () " three "")
            parse::unclosed_string: a string is never closed
              3:21 `\"` this string runs to the end of the text
              1:15 `\"` this string contains the start of a definition: is its end missing?
              help: end the string with `"`, or write `\"` for a quote inside it
        "#]],
    );
    check_errors(
        "(a #| b #| c |# d",
        expect![[r#"
        (a)
        parse::unclosed_comment: a comment is never closed
          1:4 `#|` opened here
          help: end it with `|#`; each `#|` inside it needs a `|#` of its own
    "#]],
    );
    check_errors(
        "(a |b c)\n(d)",
        expect![[r#"
        (a b c)
        (d)
        parse::unclosed_symbol: a name in bars is never closed
          1:4 `|b` no second `|` on this line
          help: end the name with `|` on the same line; a bar inside it is written `\|`
    "#]],
    );
    check_errors(
        r#""a\qb\u{110000}\u41" |x\"|"#,
        expect![[r#"
        "ab41"
        x
        parse::escape: `\q` is no escape
          1:3 `\\q` here
          help: the escapes are `\n`, `\t`, `\r`, `\0`, `\\`, `\u{1F600}` and, before the quote or bar that would end the text, `\`
        parse::escape: `\u{110000}` is no escape
          1:6 `\\u{110000}` here
          help: write the number of a Unicode character in hexadecimal: `\u{1F600}`
        parse::escape: `\u` is no escape
          1:16 `\\u` here
          help: write the number of a Unicode character in hexadecimal: `\u{1F600}`
        parse::escape: `\"` is no escape
          1:24 `\\\"` here
          help: the escapes are `\n`, `\t`, `\r`, `\0`, `\\`, `\u{1F600}` and, before the quote or bar that would end the text, `\`
    "#]],
    );
    check_errors(
        "\"a\u{1b}b\u{202e}\"",
        expect![[r#"
        "ab"
        parse::character: `\u{1b}` cannot stand here
          1:3 `\u{1b}` here
          help: an invisible character is written by its number: `\u{1b}`
        parse::character: `\u{202e}` cannot stand here
          1:5 `\u{202e}` here
          help: an invisible character is written by its number: `\u{1b}`
    "#]],
    );
}

#[test]
fn numbers() {
    check_errors(
        "12abc 1.2.3 .5 1. 99999999999999999999 1e999 0xg",
        expect![[r#"
        0
        0
        0
        0
        0
        0
        0
        parse::number: `12abc` is not a number
          1:1 `12abc` here
          help: a name that starts like a number stands in bars, `|2d|`; numbers are `42`, `1_000`, `0xff`, `0b101`, `1.5`, `2e3`
        parse::number: `1.2.3` is not a number
          1:7 `1.2.3` here
          help: a name that starts like a number stands in bars, `|2d|`; numbers are `42`, `1_000`, `0xff`, `0b101`, `1.5`, `2e3`
        parse::number: `.5` is not a number
          1:13 `.5` here
          help: write a digit on each side of the point: `0.5`, `1.0`
        parse::number: `1.` is not a number
          1:16 `1.` here
          help: write a digit on each side of the point: `0.5`, `1.0`
        parse::number: `99999999999999999999` does not fit into 64 bits
          1:19 `99999999999999999999` here
          help: integers go from -9223372036854775808 to 9223372036854775807; write a float, such as `1e30`, for more
        parse::number: `1e999` is too large for a float
          1:40 `1e999` here
          help: the greatest float is about `1.8e308`; infinity is written `+inf`
        parse::number: `0xg` is not a number
          1:46 `0xg` here
          help: a name that starts like a number stands in bars, `|2d|`; numbers are `42`, `1_000`, `0xff`, `0b101`, `1.5`, `2e3`
    "#]],
    );
}

#[test]
fn characters() {
    check_errors(
        "(a \0\0\u{1}\u{7f} b) #'f ##t @x \\ “a” :",
        expect![[r#"
        (a b)
        'f
        t
        a
        parse::character: `\u{0}` cannot stand here
          1:4 `\0\0\u{1}\u{7f}` here
          help: delete it; in a string it is written by its number, such as `\u{1b}`
        parse::character: `#` cannot stand here
          1:12 `#` here
          help: functions and values share their names: write `f` for `#'f`
        parse::character: `#` cannot stand here
          1:16 `##` here
          help: a comment starts with `;` or `#|`; truth is `true` and `false`; a name with `#` stands in bars, `|a#b|`
        parse::character: `@x` cannot stand here
          1:20 `@x` here
          help: only `,@` splices; a name that starts with `@` stands in bars, `|@a|`
        parse::character: `\` cannot stand here
          1:23 `\\` here
          help: a backslash stands in strings and between bars only
        parse::character: `“` cannot stand here
          1:25 `“` here
          help: use the plain quote `"`
        parse::character: `”` cannot stand here
          1:29 `”` here
          help: use the plain quote `"`
        parse::character: `:` cannot stand here
          1:33 `:` here
          help: a keyword is a colon and a name, `:name`
    "#]],
    );
}

#[test]
fn prefixes_and_maps() {
    check_errors(
        "(a ') (b ,@ ) '",
        expect![[r#"
        (a)
        (b)
        parse::prefix: `'` stands before nothing
          1:4 `\'` no form follows
          help: write the form that `'` belongs to after it, or delete it
        parse::prefix: `,@` stands before nothing
          1:10 `,@` no form follows
          help: write the form that `,@` belongs to after it, or delete it
        parse::prefix: `'` stands before nothing
          1:15 `\'` no form follows
          help: write the form that `'` belongs to after it, or delete it
    "#]],
    );
    check_errors(
        "{:a 1 :b} {a} {:a #}",
        expect![[r#"
        {:a 1 :b nil}
        {a nil}
        {:a nil}
        parse::odd_map: a map has a key without a value
          1:7 `:b` no value follows
          1:1 `{` in this map
          help: a map is written `{key value key value}`
        parse::odd_map: a map has a key without a value
          1:12 `a` no value follows
          1:11 `{` in this map
          help: a map is written `{key value key value}`
        parse::character: `#` cannot stand here
          1:19 `#` here
          help: a comment starts with `;` or `#|`; truth is `true` and `false`; a name with `#` stands in bars, `|a#b|`
    "#]],
    );
}

#[test]
fn nesting_is_limited_at_1000() {
    let nested = |depth: usize| format!("{}{} after", "(".repeat(depth), ")".repeat(depth));
    assert_eq!(parse(FileId(0), &nested(1_000)).errors, []);
    let parsed = parse(FileId(0), &nested(1_001));
    let [ParseError::TooDeep { at, .. }] = parsed.errors[..] else { panic!("{:?}", parsed.errors) };
    assert_eq!((at.start, parsed.forms.len()), (1_000, 2));

    assert_eq!(parse(FileId(0), &("'".repeat(1_000) + "a")).errors, []);
    assert_eq!(parse(FileId(0), &("'".repeat(1_001) + "a b")).errors.len(), 1);
    assert_eq!(parse(FileId(0), &("'(".repeat(501) + &")".repeat(501))).errors.len(), 1);
}

#[test]
fn a_million_brackets_are_one_error() {
    for text in ["(".repeat(1_000_000), "'".repeat(1_000_000), ")".repeat(1_000_000), "[(".repeat(500_000)] {
        assert_eq!(parse(FileId(0), &text).errors.len(), 1);
    }
    let text = "(".repeat(1_000_000) + &")".repeat(1_000_000) + "(ok";
    assert_eq!(parse(FileId(0), &text).errors.len(), 2);
    assert_eq!(parse(FileId(0), &("(".repeat(900) + &"](".repeat(500_000))).errors.len(), 101);
}

#[test]
fn a_hundred_errors_are_told_apart() {
    let parsed = parse(FileId(0), &"1x ".repeat(250));
    assert_eq!(parsed.errors.len(), 101);
    assert!(matches!(parsed.errors.last(), Some(ParseError::TooMany { more: 150, .. })));
    assert_eq!(parse(FileId(0), &"1x ".repeat(100)).errors.len(), 100);
}

#[test]
fn errors_come_in_the_order_of_the_text() {
    let parsed = parse(FileId(0), "(a 1x\n(b ]\n2y } \"z");
    let starts: Vec<_> = parsed.errors.iter().map(|error| error.span().start).collect();
    assert!(starts.is_sorted() && starts.len() > 3, "{:?}", parsed.errors);
}

#[test]
fn bytes() {
    assert_eq!(parse_bytes(FileId(0), "(größe)".as_bytes()).errors, []);
    let parsed = parse_bytes(FileId(0), b"(a)\n \xc3\xb6 \xff b");
    assert_eq!(lines(&parsed.errors), "byte 8 is no UTF-8 (line 2, column 4)\n");
    let large = vec![b' '; (64 << 20) + 1];
    assert_eq!(parse_bytes(FileId(0), &large[1..]).errors, []);
    assert_eq!(
        lines(&parse_bytes(FileId(0), &large).errors),
        "the file has 67108865 bytes, 67108864 are allowed\n"
    );
}

#[test]
fn a_prompt_knows_what_is_open() {
    let open = |text: &str| match completeness(text) {
        Completeness::Complete => "complete".to_owned(),
        Completeness::Incomplete { open } => {
            open.into_iter().map(|(sign, at)| format!("{sign}{}", at.start)).collect()
        }
        Completeness::Invalid => "invalid".to_owned(),
    };
    for complete in ["", "(a)", "a ; b", "'a #| |#"] {
        assert_eq!(open(complete), "complete", "{complete}");
    }
    for (text, expected) in [
        ("(a [b {c", "(0[3{6"),
        ("(a \"b", "(0\"3"),
        ("(a #| b", "(0#3"),
        ("(a '", "(0'3"),
        (",@", ",0"),
        ("(a ; )", "(0"),
    ] {
        assert_eq!(open(text), expected, "{text}");
    }
    for invalid in [")", "(a ]", "(1x", "{a}", "(a\n(def-fun b ()", "|a", &"(".repeat(1_001)] {
        assert_eq!(open(invalid), "invalid", "{invalid}");
    }
}
