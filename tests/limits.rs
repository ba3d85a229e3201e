//! Limits at the limit, and how deep and wide programs may go with the limits that all have.

use pleach::{Options, Session};

/// The value of a program, or the rendered failure.
#[track_caller]
fn check(text: &str, expected: &str) {
    check_with(Options::default(), text, expected);
}

#[track_caller]
fn check_with(options: Options, text: &str, expected: &str) {
    let mut session = Session::new(options);
    let run = session.run_text("limit.plan", text);
    let outcome = match run.outcome {
        Ok(value) => crate::program::text_of(&session, &value),
        Err(failure) => failure.lines().next().unwrap_or_default().to_string(),
    };
    assert_eq!(outcome, expected, "{text}");
}

#[test]
fn functions_recur_a_million_deep() {
    check("(def-fun down (n) (if (= n 0) 0 (+ 1 (down (- n 1))))) (down 1000000)", "1000000");
}

#[test]
fn functions_recur_a_million_deep_through_values() {
    check("(def-fun down (f n) (if (= n 0) 0 (+ 1 (f f (- n 1))))) (down down 1000000)", "1000000");
}

#[test]
fn plans_recur_a_million_deep() {
    check(
        "(def-plan down (n) (if (= n 0) 0 (+ 1 (down (- n 1))))) (def-plan main () (down 1000000))",
        "1000000",
    );
}

#[test]
fn actions_recur_a_hundred_thousand_deep() {
    let text = "
        (def-plan down (n) (if (= n 0) 0 (+ 1 (perform (an action (type going) (n ,(- n 1)))))))
        (extend ground (d) (when (matches (an action (type going)) d) (list down (get d :n))))
        (def-plan main () (down 100000))";
    check(text, "100000");
}

#[test]
fn handlers_and_clean_ups_nest_a_hundred_thousand_deep() {
    let text = "
        (def-failure stop () (n))
        (def-fun down (n)
          (if (= n 0)
              (fail stop :n 0)
              (with-failure-handling ((stop (e) (fail stop :n (+ 1 (get e :n)))))
                (unwind-protect (down (- n 1)) (identity n)))))
        (with-failure-handling ((stop (e) (return (get e :n)))) (down 100000))";
    check(text, "100000");
}

#[test]
fn tail_calls_take_no_room() {
    let text = "
        (def-fun count (n) (if (= n 0) 'done (count (- n 1))))
        (def-fun even (n) (cond ((= n 0) true) (true (odd (- n 1)))))
        (def-fun odd (n) (and (not (= n 0)) (even (- n 1))))
        (def-fun by-value (f n) (if (= n 0) 'done (f f (- n 1))))
        (def-fun through-case (n) (case n (0 'done) (otherwise (let ((m (- n 1))) (seq (through-case m))))))
        (def-const closed (let ((step 1)) (lambda (self n) (when (> n 0) (self self (- n step))))))
        (def-plan main ()
          (list (count 3000000) (even 3000000) (by-value by-value 3000000) (through-case 3000000) (closed closed 3000000)))";
    let mut options = Options::default();
    options.limits.depth = 100;
    check_with(options, text, "(done true done done nil)");
}

#[test]
fn lists_a_million_long_and_deep_are_made_compared_printed_and_dropped() {
    let text = "
        (def-fun nest (n) (let ((x nil)) (dotimes (i n) (set! x (list x))) x))
        (def-plan main ()
          (let ((long (range 1000000))
                (deep (nest 1000000)))
            (list (length long) (length (map 1+ long)) (fold + 0 long) (last (sort (reverse (take 100000 long))))
                  (< (length (write-to-string deep)) 2000) (length (flatten deep)))))";
    check(text, "(1000000 1000000 499999500000 (99999) true 0)");
}

#[test]
fn an_endless_recursion_of_functions_ends_in_a_failure() {
    check(
        "(def-fun deeper (n) (+ 1 (deeper n))) (deeper 1)",
        "too-deep: calls are nested deeper than 20000000 calls",
    );
}

#[test]
fn an_endless_recursion_of_plans_ends_in_a_failure() {
    let mut session = Session::new(Options::default());
    let run =
        session.run_text("limit.plan", "(def-plan deeper () (+ 1 (deeper))) (def-plan main () (deeper))");
    let failure = run.outcome.expect_err("it has no end");
    let kinds = ["too-deep", "memory-exhausted", "tree-too-large"];
    assert!(kinds.iter().any(|kind| failure.starts_with(kind)), "{failure}");
}

#[test]
fn an_endless_list_ends_in_a_failure() {
    let mut options = Options::default();
    options.limits.memory = 64 << 20;
    let text = "(def-plan main () (let ((all nil)) (loop (set! all (cons all all)))))";
    check_with(options, text, "memory-exhausted: the run takes more than 67108864 bytes");
}

#[test]
fn a_text_that_doubles_ends_in_a_failure() {
    let mut options = Options::default();
    options.limits.memory = 64 << 20;
    let text = "(def-plan main () (let ((all \"ab\")) (loop (set! all (concat all all)))))";
    let mut session = Session::new(options);
    let run = session.run_text("limit.plan", text);
    let failure = run.outcome.expect_err("it has no end");
    assert!(failure.starts_with("memory-exhausted"), "{failure}");
}

#[test]
fn a_loop_at_the_top_level_ends_by_fuel() {
    let mut options = Options::default();
    options.limits.fuel = 10_000;
    check_with(
        options,
        "(loop)",
        "fuel-exhausted: the run used up its fuel of 10000 calls and backward jumps",
    );
}

#[test]
fn literals_may_be_long() {
    let numbers = |n: usize| (0..n).map(|i| format!("{i} ")).collect::<String>();
    let computed = |n: usize| (0..n).map(|i| format!("(+ x {i}) ")).collect::<String>();
    let text = format!(
        "(def-fun count (&rest xs) (length xs))
         (def-fun seen (x) (print x) x)
         (def-plan main ()
           (let ((x 1))
             (list (length [{0}]) (length {{{0}}}) (length (list {0})) (elt [{1}] 2999) (get {{{1}}} 2999)
                   (last (list {1})) (length `({2})) (count {0}) (get {{1 'a {0} 1 'b}} 1))))",
        numbers(3000),
        computed(3000),
        ",x ".repeat(3000)
    );
    check(&text, "(3000 1500 3000 3000 3000 (3000) 3000 3000 b)");
}

#[test]
fn long_literals_are_computed_in_order() {
    let items: String = (0..300).map(|i| format!("(next {i}) ")).collect();
    let text = format!(
        "(def-fun next (i) (write i) i) (def-plan main () (list (length [{items}]) (length {{{items}}})))"
    );
    let mut session = Session::new(Options::default());
    let run = session.run_text("limit.plan", &text);
    let once: String = (0..300).map(|i| i.to_string()).collect();
    assert_eq!(run.printed, format!("{once}{once}"));
}

#[test]
fn flat_forms_may_be_long() {
    let clauses: String = (0..900).map(|i| format!("((= x {i}) {i})")).collect();
    let keys: String = (0..20_000).map(|i| format!("({i} {i})")).collect();
    let tests: String = (0..20_000).map(|i| format!("(= x {i})")).collect();
    check(&format!("(def-fun f (x) (cond {clauses})) (f 899)"), "899");
    check(&format!("(def-fun f (x) (case x {keys})) (f 19999)"), "19999");
    check(&format!("(def-fun f (x) (or {tests})) (f 19999)"), "true");
}

#[test]
fn what_would_overflow_the_stack_of_the_compiler_is_an_error() {
    let clauses: String = (0..20_000).map(|i| format!("((= x {i}) {i})")).collect();
    let pairs = |n: usize| {
        let pairs =
            (0..n).map(|i| format!("(def-macro m{i} (x) (f{i} x)) (def-fun f{i} (x) (m{} x))", i + 1));
        format!("{} (def-macro m{n} (x) x) (def-plan main () (m0 5))", pairs.collect::<String>())
    };
    for text in [format!("(def-fun f (x) (cond {clauses}))"), pairs(5000)] {
        let mut session = Session::new(Options::default());
        let loaded = session.load_text("limit.plan", &text);
        let first = loaded.reports.first().and_then(|report| report.diagnostic().code());
        assert_eq!(first.map(|code| code.to_string()), Some("limit::nesting".into()));
    }
    check(&pairs(100), "5");
}
