//! Rules as the machine gets them: the clauses of a text, printed back with all names resolved.

use expect_test::{Expect, expect};
use pleach::{Options, Session};
use vm::rules::clause::{Clause, Goal, GoalKind, PredId};
use vm::rules::show;

/// Compiles a text and prints its predicates, hidden ones included, with their clauses and facts.
#[track_caller]
fn check(text: &str, expected: Expect) {
    let mut session = Session::new(Options::default());
    let first = session.machine.program.rules.predicates.len();
    let loaded = session.load_text("rules.plan", text);
    let reports: String = loaded.reports.iter().map(|report| session.report(report)).collect();
    expected.assert_eq(&(reports + &predicates(&session, first)));
}

fn predicates(session: &Session, first: usize) -> String {
    let program = &session.machine.program;
    let mut out = String::new();
    for (at, predicate) in program.rules.predicates.iter().enumerate().skip(first) {
        let declared = &predicate.declared;
        let tabled = if declared.tabled { " tabled" } else { "" };
        out += &format!("{}/{} {:?}{tabled}\n", declared.name, declared.arity, declared.kind);
        for clause in &predicate.clauses {
            out += &format!("  {}{}\n", show::clause(program, clause), notes(clause));
        }
        for fact in &predicate.facts {
            out += &format!("  {}\n", show::fact(program, PredId(at as u32), fact));
        }
    }
    out
}

/// What does not stand in the text of a clause: which variables `not` looks at.
fn notes(clause: &Clause) -> String {
    let mut notes = String::new();
    let mut todo: Vec<&Goal> = vec![&clause.body];
    while let Some(goal) = todo.pop() {
        match &goal.kind {
            GoalKind::And(goals) | GoalKind::Or(goals) => todo.extend(goals),
            GoalKind::Not(_, vars) if !vars.is_empty() => {
                let names: Vec<&str> = vars.iter().map(|var| clause.vars[*var as usize].as_str()).collect();
                notes += &format!("  ; not: {}", names.join(" "));
            }
            GoalKind::Bag { by, .. } => {
                let names: Vec<&str> = by.iter().map(|var| clause.vars[*var as usize].as_str()).collect();
                notes += &format!("  ; by: {}", names.join(" "));
            }
            _ => {}
        }
    }
    notes
}

#[test]
fn terms_are_data_with_variables() {
    check(
        r#"(def-rules data
             (<- (p milk :on 1 -2.5 "text" nil () true))
             (<- (p (a b (c)) (?x . ?xs) (?x ?x . ?xs) (a 'b '?x) ?_ ?_ ?_rest (1 . 2)))
             (<- (p [1 ?x] [1 2] {:b 2 :a ?x} {:b 2 :a 1} (an object (type ?x) (name a)) (a location (on (a b c))) ?x ?x))
             (<- (p |left hand| (a ?x) (an x y) 1 2 3 4 ?x)))"#,
        expect![[r#"
            p/8 Rules
              (<- (p milk :on 1 -2.5 "text" () () true))
              (<- (p (a b (c)) (?x . ?xs) (?x ?x . ?xs) (a b ?x) ?_ ?_ ?_rest (1 . 2)))
              (<- (p [1 ?x] [1 2] {:a ?x :b 2} {:a 1 :b 2} (an object (name a) (type ?x)) (a location (on (a b c))) ?x ?x))
              (<- (p |left hand| (a ?x) (an x y) 1 2 3 4 ?x))
        "#]],
    );
}

#[test]
fn goals_of_the_language() {
    check(
        "(def-facts f (on milk table) (thing milk))
         (def-rules goals :tabled \"All of them.\"
           (<- (a 1) (true))
           (<- (a ?x) (and (thing ?x) (and) (and (thing ?x) (cut))) (or (thing ?x) (false)))
           (<- (a ?x) (-> (thing ?x) (true) (false)) (*-> (thing ?x) (thing ?x)))
           (<- (a ?x) (once (thing ?x)) (== ?x (b ?y)) (matches (an object (type ?y)) ?x) (identical? ?x ?y))
           (<- (a ?x) :priority 5 (forall (thing ?y) (on ?y ?x)) (call ?x 1 ?_) (call (on ?x) table))
           (<- (a ?x) (findall (?y . ?z) (on ?y ?z) ?x) (count (on ?_ table) ?n) (> ?n 1))
           (<- (a ?x) (min ?y (thing ?y) ?x) (max ?y (thing ?y) ?x)))",
        expect![[r#"
            on/2 Facts
              (on milk table)
            thing/1 Facts
              (thing milk)
            a/1 Rules tabled
              (<- (a ?x) :priority 5 (forall (thing ?y) (on ?y ?x)) (call ?x 1 ?_) (on ?x table))
              (<- (a 1))
              (<- (a ?x) (thing ?x) (true) (thing ?x) (cut) (or (thing ?x) (false)))
              (<- (a ?x) (-> (thing ?x) (true) (false)) (*-> (thing ?x) (thing ?x)))
              (<- (a ?x) (once (thing ?x)) (== ?x (b ?y)) (matches (an object (type ?y)) ?x) (identical? ?x ?y))
              (<- (a ?x) (findall (?y . ?z) (on ?y ?z) ?x) (count (on ?_ table) ?n) (> ?n 1))
              (<- (a ?x) (min ?y (thing ?y) ?x) (max ?y (thing ?y) ?x))
        "#]],
    );
}

#[test]
fn numbers_and_functions() {
    check(
        "(def-fun twice (x) (* 2 x))
         (def-fun with-key (x &key (by 1)) (* by x))
         (def-facts f (n 1))
         (def-rules numbers
           (<- (a ?x) (n ?y) (is ?x (+ ?y (* 2 ?y) 1)) (< (- ?y) (+ (/ ?y) 3.5)))
           (<- (b ?x) (n ?y) (is ?x (twice ?y)) (<= (+ 1 (twice ?x)) (floor (/ ?y 2))))
           (<- (c ?x) (n ?y) (fun twice ?y ?z) (fun max ?y ?z ?x) (fun with-key ?y ?_))
           (<- (d ?x) (is ?x \"text\") (is ?x 'milk) (is ?x nil))
           (<- (e ?x) (n ?y) (is ?x (let ((?y 2) (f (lambda (?z) (+ ?z ?y)))) (f ?y)))))",
        expect![[r#"
            n/1 Facts
              (n 1)
            a/1 Rules
              (<- (a ?x) (n ?y) (is ?x (+ (+ ?y (* 2 ?y)) 1)) (< (* -1 ?y) (+ (/ 1 ?y) 3.5)))
            b/1 Rules
              (<- (b ?x) (n ?y) (is ?x (twice ?y)) (is ?%2 (twice ?x)) (is ?%3 (floor (/ ?y 2))) (<= (+ 1 ?%2) ?%3))
            c/1 Rules
              (<- (c ?x) (n ?y) (fun twice ?y ?z) (fun max ?y ?z ?x) (fun with-key ?y ?_))
            d/1 Rules
              (<- (d ?x) (== ?x "text") (== ?x milk) (== ?x ()))
            e/1 Rules
              (<- (e ?x) (n ?y) (is ?x (let ((?y 2) (f (lambda (?z) (+ ?z ?y)))) (f ?y))))
        "#]],
    );
}

#[test]
fn negation_looks_at_variables_that_may_have_no_value() {
    check(
        "(def-facts f (on milk table) (thing milk))
         (def-rules r (<- (rule ?x) (thing ?x)))
         (def-rules negation
           (<- (a ?x) (not (on ?x ?_y)))
           (<- (b ?x) (thing ?x) (not (on ?x ?_)))
           (<- (c ?x) (rule ?x) (not (on ?x table)))
           (<- (d ?x) (rule ?y) (is ?z (+ ?y 1)) (not (on ?x ?z)))
           (<- (e ?x) (or (thing ?x) (rule ?x)) (not (not (on ?x table)))))",
        expect![[r#"
            on/2 Facts
              (on milk table)
            thing/1 Facts
              (thing milk)
            rule/1 Rules
              (<- (rule ?x) (thing ?x))
            a/1 Rules
              (<- (a ?x) (not (on ?x ?_y)))  ; not: ?x
            b/1 Rules
              (<- (b ?x) (thing ?x) (not (on ?x ?_)))
            c/1 Rules
              (<- (c ?x) (rule ?x) (not (on ?x table)))  ; not: ?x
            d/1 Rules
              (<- (d ?x) (rule ?y) (is ?z (+ ?y 1)) (not (on ?x ?z)))  ; not: ?x
            e/1 Rules
              (<- (e ?x) (or (thing ?x) (rule ?x)) (not (not (on ?x table))))  ; not: ?x
        "#]],
    );
}

#[test]
fn groups_of_answers() {
    check(
        "(def-facts f (age peter 7) (age ann 11))
         (def-rules bags
           (<- (a ?l) (bagof ?c (age ?c ?a) ?l))
           (<- (b ?l) (setof (?a ?c) (age ?c ?a) ?l))
           (<- (c ?l) (setof ?c (exists (?a) (age ?c ?a)) ?l))
           (<- (d ?x) (exists (?x ?y) (age ?x ?y)) (age ?x ?_)))",
        expect![[r#"
            rule::singleton

              ⚠ the variable `?a` occurs only once in its clause
               ╭─[rules.plan:3:41]
             2 │          (def-rules bags
             3 │            (<- (a ?l) (bagof ?c (age ?c ?a) ?l))
               ·                                         ─┬
               ·                                          ╰── nothing else in the clause has this name
             4 │            (<- (b ?l) (setof (?a ?c) (age ?c ?a) ?l))
               ╰────
              help: write `?_` if its value does not matter, or a name that begins with `?_`
            age/2 Facts
              (age peter 7)
              (age ann 11)
            a/1 Rules
              (<- (a ?l) (bagof ?c (age ?c ?a) ?l))  ; by: ?a
            b/1 Rules
              (<- (b ?l) (setof (?a ?c) (age ?c ?a) ?l))  ; by: 
            c/1 Rules
              (<- (c ?l) (setof ?c (exists (?a) (age ?c ?a)) ?l))  ; by: 
            d/1 Rules
              (<- (d ?x) (age ?x%1 ?y) (age ?x ?_))
        "#]],
    );
}

#[test]
fn open_predicates_and_facts() {
    check(
        "(def-rules first (<- (p 1)) (<- (p 2) :priority -1))
         (def-open p 1 \"Clauses from many places.\")
         (def-facts second (p 3) (q (an object (type milk)) [1 2]))",
        expect![[r#"
            p/1 Rules
              (<- (p 1))
              (<- (p 3))
              (<- (p 2) :priority -1)
            q/2 Facts
              (q (an object (type milk)) [1 2])
        "#]],
    );
}

#[test]
fn macros_make_rules_and_goals() {
    check(
        "(def-macro def-kind (name &rest things)
           `(def-facts ,name ,@(map (lambda (thing) (list name thing)) things)))
         (def-macro both (a b) `(and ,a ,b))
         (def-kind cup red blue)
         (def-rules pair (<- (pair ?a ?b) (both (cup ?a) (cup ?b))))",
        expect![[r#"
            pair/2 Rules
              (<- (pair ?a ?b) (cup ?a) (cup ?b))
            cup/1 Facts
              (cup red)
              (cup blue)
        "#]],
    );
}

#[test]
fn queries_of_plans() {
    check(
        "(def-facts f (on milk table))
         (def-plan main (?known thing)
           (ask (on ?known ?_))
           (answers ?x (on ?x ?known))
           (answers (?x ?known) (and (on ?x ?known) (not (on ?x ?local))))
           (query (on ?x ?y))
           (query (on ?known ,thing))
           (let ((?y 1)) (for-each-answer (?x ?y) (on ?x ?y) (print ?x ?y)))
           (with-facts ((on ?known (?known . ,thing)) (on cup table)) 1))",
        expect![[r#"
            on/2 Facts
              (on milk table)
            ask/2 Rules
              (<- (ask ?known true) (on ?known ?_))
            answers/2 Rules
              (<- (answers ?known ?x) (on ?x ?known))
            answers/1 Rules
              (<- (answers (?x ?known)) (on ?x ?known) (not (on ?x ?local)))
            query/1 Rules
              (<- (query {?x ?x ?y ?y}) (on ?x ?y))
            query/3 Rules
              (<- (query ?known ?,0 {}) (on ?known ?,0))
            for-each-answer/1 Rules
              (<- (for-each-answer (?x ?y)) (on ?x ?y))
        "#]],
    );
}

#[test]
fn goals_that_are_typed() {
    let mut session = Session::new(Options::default());
    session.extend("input", "(def-facts f (on milk table))");
    let first = session.machine.program.rules.predicates.len();
    let text = "(on ?x ?y) (not (on ?y ?local)) (findall ?z (on ?z ?_) ?all)";
    let file = session.files.add("goal", text);
    let Session { front, machine, module, .. } = &mut session;
    let goal = front.compile_goal(&mut machine.program, *module, file, text).expect("it has no mistakes");
    let names: Vec<&str> = goal.variables.iter().map(|name| name.as_str()).collect();
    expect![[r#"
        ?x ?y ?all
        query/1 Rules
          (<- (query (?x ?y ?all)) (on ?x ?y) (not (on ?y ?local)) (findall ?z (on ?z ?_) ?all))
    "#]]
    .assert_eq(&format!("{}\n{}", names.join(" "), predicates(&session, first)));
}

#[test]
fn a_repl_defines_again() {
    let mut session = Session::new(Options::default());
    let first = session.machine.program.rules.predicates.len();
    let mut input = |text: &str| {
        let loaded = session.extend("input", text);
        loaded.reports.iter().map(|report| session.report(report)).collect::<String>()
            + &predicates(&session, first)
    };
    input("(def-open open 1) (def-rules g (<- (p 1)) (<- (q 1)) (<- (open 1)))");
    input("(def-rules h (<- (open 2)) (<- (r ?x) (p ?x)))");
    let defined = input("(def-rules g :tabled (<- (p 2)) (<- (open 3)))");
    expect![[r#"
        open/1 Rules
          (<- (open 3))
          (<- (open 2))
        p/1 Rules tabled
          (<- (p 2))
        q/1 Rules
        r/1 Rules
          (<- (r ?x) (p ?x))
    "#]]
    .assert_eq(&defined);
    // With a mistake nothing changes.
    let with_mistake = input("(def-facts g (p 3)) (def-rules h (<- (r ?x) (unknown ?x)))");
    let (mistake, after) = with_mistake.split_at(with_mistake.len() - defined.len());
    assert_eq!(after, defined);
    expect![[r#"
        rule::unknown_predicate

          × no predicate is called `unknown`
           ╭─[input:1:46]
         1 │ (def-facts g (p 3)) (def-rules h (<- (r ?x) (unknown ?x)))
           ·                                              ───┬───
           ·                                                 ╰── not a goal
           ╰────
          help: define it with `def-rules` or `def-facts`, or declare that it may have no clauses: (def-
                open unknown 1)
    "#]]
    .assert_eq(mistake);
}
