//! Prolog text to rules, and what is said about mistakes and about what is not taken.

use expect_test::{Expect, expect};
use grammar::{FileId, Form, parse, prolog};
use proptest::prelude::*;

use crate::reading::{lines, render};

/// The rules that `source` is read as, laid out.
#[track_caller]
fn check(source: &str, expected: Expect) {
    let parsed = prolog::parse(FileId(0), "it", source);
    assert_eq!(parsed.errors, [], "in\n{source}");
    check_read_back(&parsed.forms);
    expected.assert_eq(&grammar::format(&lines(&parsed.forms)).expect("it reads back"));
}

/// The clauses of `source` that have one goal, or are facts, a line each: `head` or the goal.
#[track_caller]
fn check_goals(source: &str, expected: Expect) {
    let parsed = prolog::parse(FileId(0), "it", source);
    assert_eq!(parsed.errors, [], "in\n{source}");
    check_read_back(&parsed.forms);
    let clauses = parsed.forms.iter().flat_map(|form| form.list().unwrap_or_default().iter().skip(2));
    let goals: Vec<String> = clauses.filter_map(|clause| Some(clause.list()?.last()?.to_string())).collect();
    expected.assert_eq(&lines(&goals));
}

/// What is said about `source`.
#[track_caller]
fn check_errors(source: &str, expected: Expect) {
    let parsed = prolog::parse(FileId(0), "it", source);
    let errors: String = parsed.errors.iter().map(|error| render(source, error)).collect();
    expected.assert_eq(&errors);
}

/// The heads of the clauses that were read, and how many errors there were.
fn heads(source: &str) -> (Vec<String>, usize) {
    let parsed = prolog::parse(FileId(0), "it", source);
    let clauses = parsed.forms.iter().flat_map(|form| form.list().unwrap_or_default().iter().skip(2));
    (clauses.filter_map(|clause| Some(clause.list()?.get(1)?.to_string())).collect(), parsed.errors.len())
}

/// What is made of Prolog text could have been read from our own.
fn check_read_back(forms: &[Form]) {
    let printed = lines(forms);
    let again = parse(FileId(0), &printed);
    assert_eq!((lines(&again.forms), again.errors), (printed, Vec::new()));
}

#[test]
fn clauses_in_the_order_of_the_text() {
    check(
        "% facts\non(milk, table).\nraining.\n\n/* and a rule */\nbring(Thing, Place) :-\n    on(Thing, From),\n    From \\= Place, \\+ raining.\n",
        expect![[r#"
            (def-rules it
              (<- (on milk table))
              (<- (raining))
              (<- (bring ?thing ?place) (on ?thing ?from) (not (== ?from ?place)) (not (raining))))
        "#]],
    );
    check("", expect![[r#""#]]);
    check("#!/usr/bin/env swipl\n% nothing\n", expect![[r#""#]]);
}

#[test]
fn names() {
    check_goals(
        "p(transport_task, milk, 'CounterTop', 'sink_area', 'two words', größe, a1_B, [], '', 'don''t', '\\x41\\\\n').",
        expect![[r#"
            (p transport-task milk CounterTop sink_area |two words| größe a1-B () || |don't| |A\n|)
        "#]],
    );
    check_goals(
        "p(First_task, X, FirstTask, _, _Any_thing, __, _1, Größe, X_1).\nq(A_B, A_b, A_b, A_B_2, _a, _A).",
        expect![[r#"
            (p ?first-task ?x ?firsttask ?_ ?_any-thing ?_- ?_1 ?größe ?x-1)
            (q ?a-b ?a-b-2 ?a-b-2 ?a-b-2-2 ?_a ?_a-2)
        "#]],
    );
    check_goals(
        "p(+, -, =, (:-), [-], - , f(;), !, (a), is, mod, table, dynamic).",
        expect![[r#"
        (p + - = |:-| (-) - (f |;|) ! a is mod table dynamic)
    "#]],
    );
    check_goals(
        "p(table-1, dynamic+x) :- q(table).",
        expect![[r#"
        (q table)
    "#]],
    );
}

#[test]
fn numbers_and_strings() {
    check_goals(
        "p(42, 1_000, 0xff, 0o17, 0b101, 0'a, 0''', 0'\\n, 0' , 1.5, 1.0e-5, 2e3, -1, -1.5, - 1, -0'a, -9223372036854775808).",
        expect![[r#"
            (p 42 1000 255 15 5 97 39 10 32 1.5 1e-5 2000.0 -1 -1.5 (- 1) -97 -9223372036854775808)
        "#]],
    );
    check_goals(
        r#"p("text", "say ""hi""", "it's", "a\tb\n", "\x1F600\ \u00e9 \351\ \e", "two \
lines", "größe")."#,
        expect![[r#"
            (p "text" "say \"hi\"" "it's" "a\tb\n" "😀 é é \u{1b}" "two lines" "größe")
        "#]],
    );
    check_goals(
        "p :- X is 1 - 1.\np :- X is 1 -1.\np :- X is -1 - -1.\np :- X is - (1).",
        expect![[r#"
        (is ?x (- 1 1))
        (is ?x (- 1 1))
        (is ?x (- -1 -1))
        (is ?x (- 1))
    "#]],
    );
    check_goals(
        "p(X) :- X = 1.\n",
        expect![[r#"
        (== ?x 1)
    "#]],
    );
}

#[test]
fn terms() {
    check_goals(
        "p(f(a, B), g(h(x)), f((a))).",
        expect![[r#"
        (p (f a ?b) (g (h x)) (f a))
    "#]],
    );
    check_goals(
        "p([], [a], [a, B], [H|T], [a, b|T], [a|[b|[c]]], [[]|[]], [a|b]).",
        expect![[r#"
        (p () (a) (a ?b) (?h . ?t) (a b . ?t) (a b c) (()) (a . b))
    "#]],
    );
    check_goals(
        "p(K-V, a/b, 2*x+1, -x, - - x, m:x, a:b:c, x^2, 2 ** 3, a-b-c, a- -1, 7//2).",
        expect![[r#"
        (p (- ?k ?v) (/ a b) (+ (* 2 x) 1) (- x) (- (- x)) (|:| m x) (|:| a (|:| b c)) (^ x 2) (** 2 3) (- (- a b) c) (- a -1) (// 7 2))
    "#]],
    );
    check_goals(
        "p((a, b, C), (a ; b), (a -> b ; c), (a :- b), \\+ a, X = Y, a == b, c =< d).",
        expect![[r#"
        (p (and a (and b ?c)) (or a b) (-> a b c) (|:-| a b) (not a) (== ?x ?y) (identical? a b) (<= c d))
    "#]],
    );
    check_goals(
        "p(a ; b, c -> d ; e, [k -> v, f ; g | h -> i]).",
        expect![[r#"
        (p (or a b) (-> c d e) ((-> k v) (or f g) . (-> h i)))
    "#]],
    );
    check_goals(
        "p(an(object, type(milk), name('sink_area'))).",
        expect![[r#"
        (p (an object (type milk) (name sink_area)))
    "#]],
    );
}

#[test]
fn operators_bind_as_in_prolog() {
    check_goals(
        "p :- X is 1 + 2 * 3 - 4 - 5.\np :- X is (1 + 2) * 3.\np :- X is - a ** 2.",
        expect![[r#"
        (is ?x (- (- (+ 1 (* 2 3)) 4) 5))
        (is ?x (* (+ 1 2) 3))
        (is ?x (- (expt a 2)))
    "#]],
    );
    check_goals(
        "p :- X is 2 ^ 3 ^ 4.\np :- X is a mod b * c.\np :- \\+ X = Y.\np :- \\+ \\+ x.",
        expect![[r#"
            (is ?x (expt 2 (expt 3 4)))
            (is ?x (* (mod a b) c))
            (not (== ?x ?y))
            (not (not (x)))
        "#]],
    );
    check_goals(
        "p :- X is -(1).\np :- X is -(1, 2).\np(- = x, -(-)).\np(\\+ (a, b)).",
        expect![[r#"
        (is ?x (- 1))
        (is ?x (- 1 2))
        (p (== - x) (- -))
        (p (not (and a b)))
    "#]],
    );
}

#[test]
fn control() {
    check(
        "p :- a, (b, c), d, (e, f ; g).\np :- (a ; b ; c).\np :- (a -> b ; c).\np :- (a -> b).\np :- (a *-> b ; c).\n\
         p :- ( a -> b ; c -> d ; e ).\np :- ( a ; b -> c ; d ).\np :- ((a -> b ; c) ; d).\np :- ((a -> b) ; c).",
        expect![[r#"
            (def-rules it
              (<- (p) (a) (b) (c) (d) (or (and (e) (f)) (g)))
              (<- (p) (or (a) (b) (c)))
              (<- (p) (-> (a) (b) (c)))
              (<- (p) (-> (a) (b)))
              (<- (p) (*-> (a) (b) (c)))
              (<- (p) (-> (a) (b) (-> (c) (d) (e))))
              (<- (p) (or (a) (-> (b) (c) (d))))
              (<- (p) (or (-> (a) (b) (c)) (d)))
              (<- (p) (-> (a) (b) (c))))
        "#]],
    );
    check_goals(
        "p :- !.\np :- true.\np :- fail.\np :- false.\np :- \\+ a.\np :- not(a(X)).\np :- not((a, b)).\np :- once(a).\n\
         p :- ignore(a).\np :- G.\np :- call(G).\np :- call(a).\np :- call(G, X, y).\np :- call(a(b), X).",
        expect![[r#"
            (cut)
            (true)
            (false)
            (false)
            (not (a))
            (not (a ?x))
            (not (and (a) (b)))
            (once (a))
            (-> (a) (true) (true))
            (call ?g)
            (call ?g)
            (call (a))
            (call ?g ?x y)
            (call (a b) ?x)
        "#]],
    );
    check_goals(
        "p :- forall(a(X), b(X)).\np :- findall(X-Y, (a(X), b(Y)), L).\np :- bagof(X, Y^a(X, Y), L).\n\
         p :- setof(X-Z, Y^Z^f(Y)^a(X, Y), L).\np :- bagof(X, a(X), L).",
        expect![[r#"
            (forall (a ?x) (b ?x))
            (findall (- ?x ?y) (and (a ?x) (b ?y)) ?l)
            (bagof ?x (exists (?y) (a ?x ?y)) ?l)
            (setof (- ?x ?z) (exists (?y ?z) (a ?x ?y)) ?l)
            (bagof ?x (a ?x) ?l)
        "#]],
    );
}

#[test]
fn comparisons() {
    check_goals(
        "p :- A = f(B).\np :- A \\= B.\np :- A == B.\np :- A \\== B.\np :- A @< B.\np :- A @> B.\np :- A @=< B.\np :- A @>= B.",
        expect![[r#"
            (== ?a (f ?b))
            (not (== ?a ?b))
            (identical? ?a ?b)
            (not (identical? ?a ?b))
            (comes-before? ?a ?b)
            (comes-before? ?b ?a)
            (not (comes-before? ?b ?a))
            (not (comes-before? ?a ?b))
        "#]],
    );
    check_goals(
        "p :- A =:= B.\np :- A =\\= B.\np :- A < B + 1.\np :- A > B.\np :- A =< B.\np :- A >= B.\np :- X - 1 = Y - 1.",
        expect![[r#"
            (= ?a ?b)
            (/= ?a ?b)
            (< ?a (+ ?b 1))
            (> ?a ?b)
            (<= ?a ?b)
            (>= ?a ?b)
            (== (- ?x 1) (- ?y 1))
        "#]],
    );
    check_goals(
        "p :- var(X).\np :- nonvar(X).\np :- atom(X).\np :- number(X).\np :- integer(X).\np :- is_list(X).\np :- memberchk(X, L).",
        expect![[r#"
            (var? ?x)
            (not (var? ?x))
            (symbol? ?x)
            (number? ?x)
            (integer? ?x)
            (list? ?x)
            (once (member ?x ?l))
        "#]],
    );
}

#[test]
fn arithmetic() {
    check_goals(
        "p :- X is A // B.\np :- X is A div B.\np :- X is A mod B.\np :- X is A rem B.\np :- X is A ** B.\np :- X is A ^ B.\n\
         p :- X is A / B.\np :- X is A << B.\np :- X is A >> B.\np :- X is A /\\ B \\/ \\ C.\np :- X is A xor B.\n\
         p :- X is abs(min(A, max(B, 1))).\np :- X is truncate(A) + floor(B) + sqrt(2) + atan2(1, 2).\n\
         p :- X is log(2, A) + log(A) + log2(A).\np :- X is pi + e + inf + max_integer.\np :- X is - A.\np :- X is A.",
        expect![[r#"
            (is ?x (truncate ?a ?b))
            (is ?x (div ?a ?b))
            (is ?x (mod ?a ?b))
            (is ?x (rem ?a ?b))
            (is ?x (expt ?a ?b))
            (is ?x (expt ?a ?b))
            (is ?x (/ ?a ?b))
            (is ?x (shift ?a ?b))
            (is ?x (shift ?a (- ?b)))
            (is ?x (bit-or (bit-and ?a ?b) (bit-not ?c)))
            (is ?x (bit-xor ?a ?b))
            (is ?x (abs (min ?a (max ?b 1))))
            (is ?x (+ (+ (+ (truncate ?a) (floor ?b)) (sqrt 2)) (atan2 1 2)))
            (is ?x (+ (+ (log ?a 2) (log ?a)) (log ?a 2)))
            (is ?x (+ (+ (+ pi 2.718281828459045) +inf) 9223372036854775807))
            (is ?x (- ?a))
            (is ?x ?a)
        "#]],
    );
}

#[test]
fn what_a_text_defines_itself_is_no_built_in() {
    check_goals(
        "memberchk(X, [X|_]).\np :- memberchk(X, L).\nwrite(a, b, c).\np :- write(a, b, c).",
        expect![[r#"
            (memberchk ?x (?x . ?_))
            (memberchk ?x ?l)
            (write a b c)
            (write a b c)
        "#]],
    );
}

#[test]
fn declarations() {
    check(
        ":- use_module(library(lists)).\n:- dynamic on/2, in_hand/1.\n:- dynamic([on/2]).\n:- multifile likes/2.\n\
         :- discontiguous(seen/1).\n:- table path/2.\npath(X, Y) :- edge(X, Y).\nedge(a, b).\n\
         path(X, Y) :- path(X, Z), edge(Z, Y).\npath(x).\n",
        expect![[r#"
            (def-open on 2)
            (def-open in-hand 1)
            (def-open likes 2)
            (def-open seen 1)

            (def-rules it
              (<- (edge a b))
              (<- (path x)))

            (def-rules it-tabled :tabled
              (<- (path ?x ?y) (edge ?x ?y))
              (<- (path ?x ?y) (path ?x ?z) (edge ?z ?y)))
        "#]],
    );
    check(
        ":- table p/1.\np(X) :- p(X).\n",
        expect![[r#"
        (def-rules it :tabled
          (<- (p ?x) (p ?x)))
    "#]],
    );
}

/// The first listing of the paper, with the predicates that it names.
#[test]
fn both_hands() {
    check(
        include_str!("both_hands.pl"),
        expect![[r#"
        (def-rules it
          (<- (both-hands ?first-deliver-path ?second-deliver-path)
              (transport-task top-level ?first-transport ?first-path)
              (transport-task top-level ?second-transport ?second-path)
              (not (identical? ?first-transport ?second-transport))
              (not-transformed ?first-path)
              (not-transformed ?second-path)
              (one-arm-action ?first-transport)
              (one-arm-action ?second-transport)
              (fetch-task ?first-transport ?first-fetch ?_)
              (fetch-task ?second-transport ?second-fetch ?_)
              (fetch-from-same-loc ?first-fetch ?second-fetch)
              (deliver-task ?first-transport ?first-deliver ?first-deliver-path)
              (deliver-task ?second-transport ?second-deliver ?second-deliver-path)
              (deliver-to-same-loc ?first-deliver ?second-deliver))
          (<- (one-arm-action ?task) (task-action-param ?task object ?object) (not (heavy ?object)))
          (<- (fetch-from-same-loc ?first ?second)
              (task-action-param ?first location ?location)
              (task-action-param ?second location ?location))
          (<- (heavy (an object (type Pot)))))
    "#]],
    );
}

/// The second one, with the goals that it leaves out.
#[test]
fn container() {
    check(
        include_str!("container.pl"),
        expect![[r#"
        (def-rules it
          (<- (container ?container ?closes)
              (setof ?close (exists (?open) (in-container ?container ?open ?close)) ?closes)
              (length ?closes ?n)
              (> ?n 1)
              (forall (and (member ?a ?closes) (member ?b ?closes) (not (identical? ?a ?b)))
                      (fetch-from-same-container ?a ?b)))
          (<- (in-container ?container ?open-path ?close-path)
              (transport-task top-level ?transport ?_)
              (open-task ?transport ?open ?open-path)
              (close-task ?transport ?_close ?close-path)
              (not-transformed ?close-path)
              (-> (task-action-param ?open object ?container)
                  (true)
                  (task-action-param ?open location (in ?container . ?_)))))
    "#]],
    );
}

#[test]
fn the_reference_shows_what_is_read() {
    let (_, section) = include_str!("../../REFERENCE.md").split_once("## Prolog text").expect("it is there");
    let block = |mark: &str| {
        let (_, rest) = section.split_once(&format!("```{mark}\n")).expect("an example");
        rest.split_once("```").expect("a block ends").0
    };
    let parsed = prolog::parse(FileId(0), "file", block("prolog"));
    assert_eq!((parsed.errors, parsed.forms), (Vec::new(), parse(FileId(0), block("text")).forms));
}

#[test]
fn forms_have_their_places() {
    let source = "on(milk, X) :- \\+ gone(X), Y is X + [a|B].";
    let parsed = prolog::parse(FileId(7), "it", source);
    let mut places = Vec::new();
    let mut waiting: Vec<&Form> = parsed.forms.iter().collect();
    while let Some(form) = waiting.pop() {
        assert_eq!(form.span.file, FileId(7));
        places.push(format!("{form} at {}", &source[form.span.start as usize..form.span.end as usize]));
        waiting.extend(form.list().unwrap_or_default().iter().rev());
    }
    expect![[r#"
        (def-rules it (<- (on milk ?x) (not (gone ?x)) (is ?y (+ ?x (a . ?b))))) at on(milk, X) :- \+ gone(X), Y is X + [a|B]
        def-rules at 
        it at 
        (<- (on milk ?x) (not (gone ?x)) (is ?y (+ ?x (a . ?b)))) at on(milk, X) :- \+ gone(X), Y is X + [a|B]
        <- at :-
        (on milk ?x) at on(milk, X)
        on at on
        milk at milk
        ?x at X
        (not (gone ?x)) at \+ gone(X)
        not at \+
        (gone ?x) at gone(X)
        gone at gone
        ?x at X
        (is ?y (+ ?x (a . ?b))) at Y is X + [a|B]
        is at is
        ?y at Y
        (+ ?x (a . ?b)) at X + [a|B]
        + at +
        ?x at X
        (a . ?b) at [a|B]
        a at a
        . at B
        ?b at B
    "#]].assert_eq(&lines(&places));
    let source = "% one\na. /* two */ b.";
    let comments = prolog::parse(FileId(0), "it", source).comments;
    let text: Vec<_> =
        comments.iter().map(|c| (&source[c.span.start as usize..c.span.end as usize], c.block)).collect();
    assert_eq!(text, [("% one", false), ("/* two */", true)]);
}

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

/// Runs `work` with no more stack than the forms themselves are allowed to need.
fn with_little_stack(work: fn()) {
    let thread = std::thread::Builder::new().stack_size(1 << 20).spawn(work).expect("a thread starts");
    thread.join().expect("1 MiB of stack is enough");
}

#[test]
fn a_million_of_anything_is_one_error() {
    with_little_stack(|| {
        for (before, part) in [
            ("p :- ", "("),
            ("p([", "["),
            ("p(", "f("),
            ("p(", "- "),
            ("p :- ", "\\+ "),
            ("p :- X is ", "1+"),
            ("p(", "a:"),
            ("p :- ", "a->"),
            ("p :- ", "(a,b;c->"),
            ("p(", "[a|"),
            ("p(", "X^"),
            ("p(", "a->"),
            ("p(", "a,b->[c,d->"),
        ] {
            let source = format!("{before}{} .\nz.\n", part.repeat(1_000_000));
            assert_eq!(heads(&source), (vec!["(z)".into()], 1), "{part}");
        }
    });
}

#[test]
fn what_is_long_is_not_deep() {
    with_little_stack(|| {
        for (before, part, after) in [
            ("p :- ", "b, ", "b"),
            ("p :- ", "b; ", "b"),
            ("p([", "b, ", "b])"),
            ("p(", "b, ", "b)"),
            ("p([", "a->b, ", "b])"),
        ] {
            let parsed = prolog::parse(FileId(0), "it", &format!("{before}{}{after}.", part.repeat(100_000)));
            assert_eq!(parsed.errors, []);
            check_read_back(&parsed.forms);
        }
    });
}

#[test]
fn the_deepest_terms_give_forms_that_are_not_too_deep() {
    with_little_stack(|| {
        let nested = |open: &str, inner: &str, close: &str, times: usize| {
            let source = format!("p :- {}{inner}{}.", open.repeat(times), close.repeat(times));
            prolog::parse(FileId(0), "it", &source)
        };
        for (open, inner, close) in [
            ("f(", "a", ")"),
            ("(", "1", "=\\= 1)"),
            ("(", "1", "\\= 1)"),
            ("(", "1", "@=< 1)"),
            ("\\+ (", "a", ")"),
            ("\\+ ", "a", ""),
            ("a ; b -> c ; d, e, (", "f", ")"),
            ("(a ; b, c -> d ; ", "e", ")"),
            ("a -> b ; ", "c", ""),
            ("q([a,", "b", "])"),
            ("X is (1 >> ", "2", ")"),
            ("bagof(X, Y^", "a", ", L)"),
            ("ignore((a, ", "b", "))"),
            ("memberchk(a, ", "b", ")"),
            ("f((a, ", "b", "))"),
            ("f(a -> b ; ", "b", ", c)"),
            ("f(a, b -> c -> ", "b", ")"),
        ] {
            let fits = (1..=400).rev().map(|times| nested(open, inner, close, times));
            let deepest = fits.into_iter().find(|parsed| parsed.errors.is_empty());
            check_read_back(&deepest.unwrap_or_else(|| panic!("{open} is never taken")).forms);
        }
        // A pair for each comma comes on top of that.
        let pairs = format!("f(({}", "a, ".repeat(70));
        let parsed = nested(&pairs, "b", "))", 2);
        assert_eq!(parsed.errors, []);
        check_read_back(&parsed.forms);
        assert_eq!(nested(&pairs, "b", "))", 3).errors.len(), 1);
    });
}

const SOUP: &[&str] = &[
    "p",
    "q(",
    "(",
    ")",
    "[",
    "]",
    "|",
    "{",
    "}",
    ",",
    ".",
    ".\n",
    ".\n",
    " ",
    ":-",
    " :- ",
    "-->",
    "?-",
    ";",
    "->",
    "\\+",
    "-",
    "- ",
    "+",
    "=",
    " is ",
    "==",
    "@<",
    "*",
    "**",
    "^",
    ":",
    "X",
    "_",
    "Y_z",
    "a_b",
    "'a_b'",
    "1",
    "1.5",
    "0'a",
    "0x",
    "\"s\"",
    "'",
    "\"",
    "`",
    "%",
    "/*",
    "*/",
    "\\",
    "not(",
    "findall(",
    "bagof(X,",
    "table ",
    ":- table p/1.\n",
    ":- dynamic ",
    "p/2",
    "!",
    "...",
    "ö",
    "“",
    "\u{0}",
    "\u{202e}",
    "nil",
    "[]",
    "call(",
    "log(2,",
    "round(",
];

/// Errors are within the text and in order, and what was read are forms.
fn check_wild(text: &str) -> Result<(), TestCaseError> {
    let parsed = prolog::parse(FileId(0), "it", text);
    let mut last = 0;
    for error in &parsed.errors {
        let span = error.span();
        prop_assert!(
            last <= span.start && span.start <= span.end && span.end as usize <= text.len(),
            "{error:?}"
        );
        prop_assert!(text.is_char_boundary(span.start as usize) && text.is_char_boundary(span.end as usize));
        last = span.start;
    }
    check_read_back(&parsed.forms);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(if cfg!(debug_assertions) { 400 } else { 20_000 }))]

    #[test]
    fn any_text_never_panics(text in any::<String>()) {
        check_wild(&text)?;
    }

    #[test]
    fn bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let _ = prolog::parse_bytes(FileId(0), "it", &bytes);
        check_wild(&String::from_utf8_lossy(&bytes))?;
    }

    #[test]
    fn tokens_in_any_order_never_panic(tokens in prop::collection::vec(prop::sample::select(SOUP), 0..60)) {
        check_wild(&tokens.concat())?;
    }
}
