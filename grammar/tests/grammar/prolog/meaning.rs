//! What Prolog text is read as.

use super::*;

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
            (bound? ?x)
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
    let (_, section) =
        include_str!("../../../REFERENCE.md").split_once("## Prolog text").expect("it is there");
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
fn variables_without_names_group_where_prolog_groups_by_them() {
    check(
        r"p(L) :- bagof(X, q(X, _, _), L).
r(L) :- setof(X-_, Y^(q(X, Y, _), \+ s(_), findall(_, t(_), [])), L).",
        expect![[r#"
            (def-rules it
              (<- (p ?l) (bagof ?x (q ?x ?_1 ?_2) ?l))
              (<- (r ?l)
                  (setof (- ?x ?_) (exists (?y) (and (q ?x ?y ?_1) (not (s ?_)) (findall ?_ (t ?_) ()))) ?l)))
        "#]],
    );
}
