//! How files are laid out.

use expect_test::{Expect, expect};
use grammar::{FileId, format, parse};

/// Formats `source`; whatever comes out must be stable and mean the same.
#[track_caller]
pub fn check_format(source: &str, expected: Expect) {
    let once = formatted(source);
    expected.assert_eq(&once);
}

/// The text laid out, after a look at all that must hold for it.
#[track_caller]
pub fn formatted(source: &str) -> String {
    let once = format(source).unwrap_or_else(|errors| panic!("{errors:?} in\n{source}"));
    let twice = format(&once).unwrap_or_else(|errors| panic!("{errors:?} in formatted\n{once}"));
    assert_eq!(once, twice, "formatting is not stable for\n{source}");
    let (before, after) = (parse(FileId(0), source), parse(FileId(0), &once));
    assert_eq!(before.forms, after.forms, "the meaning changed:\n{source}\n--\n{once}");
    assert_eq!(comments(source), comments(&once), "the comments changed:\n{source}\n--\n{once}");
    once
}

fn comments(text: &str) -> Vec<&str> {
    let parsed = parse(FileId(0), text);
    parsed.comments.iter().map(|c| text[c.span.start as usize..c.span.end as usize].trim_end()).collect()
}

#[test]
fn listing_1_of_the_paper_is_as_we_print_it() {
    let listing = "\
(def-plan transport-objects ()
  (dolist (?type '(milk cup))
    (perform
      (an action
        (type transporting)
        (object (an object (type ?type)))
        (location (a location (on (an object (type CounterTop) (name sink_area)))))
        (target (a location (on (an object (type CounterTop) (name island_area)))))))))
";
    assert_eq!(formatted(listing), listing);
    let one_line = listing.split_whitespace().collect::<Vec<_>>().join(" ");
    assert_eq!(formatted(&one_line), listing);
}

#[test]
fn definitions() {
    check_format(
        r#"(module kitchen (:use world) (:export set-table))
(use "lib/list") (def-const x 3)
(def-const y 4)
(def-fun square (x) "The square of X." (* x x))
(def-failure spilled (plan-failure) (amount))
(def-open likes 2)
(def-rules both-hands :tabled "doc" (<- (p ?x) (q ?x)) (<- (q 1)))
(def-facts kitchen (on milk table) (on cup table))
(def-task (deliver ?package ?place) :post ((at ?package ?place)))
(def-method deliver-by-truck (deliver ?package ?place) :when ((at ?package ?from) (truck ?t))
 :steps (seq (get-to ?t ?from) (load ?t ?package)))


(def-transformation both-hands "Carry two." :applicable (both-hands ?a ?b) :answers (first)
  :rewrite (list (defer ?a :after ?b)))
(def-native reachable? (robot pose) "True if reachable.
   ex: (reachable? a b) => true")
(def-thing t (a b) c d)
"#,
        expect![[r#"
            (module kitchen (:use world) (:export set-table))
            (use "lib/list")
            (def-const x 3)
            (def-const y 4)

            (def-fun square (x)
              "The square of X."
              (* x x))

            (def-failure spilled (plan-failure) (amount))
            (def-open likes 2)

            (def-rules both-hands :tabled
              "doc"
              (<- (p ?x) (q ?x))
              (<- (q 1)))

            (def-facts kitchen
              (on milk table)
              (on cup table))

            (def-task (deliver ?package ?place) :post ((at ?package ?place)))

            (def-method deliver-by-truck (deliver ?package ?place)
              :when ((at ?package ?from) (truck ?t))
              :steps (seq
                       (get-to ?t ?from)
                       (load ?t ?package)))

            (def-transformation both-hands
              "Carry two."
              :applicable (both-hands ?a ?b)
              :answers (first)
              :rewrite (list (defer ?a :after ?b)))

            (def-native reachable? (robot pose)
              "True if reachable.
               ex: (reachable? a b) => true")

            (def-thing t (a b)
              c
              d)
        "#]],
    );
}

#[test]
fn bodies() {
    check_format(
        r#"(def-plan p (a &optional (b 2)) (let ((x 1)) x) (let ((x 1) (y 2)) (f x) (g y)) (when a (b))
(if a b c)
(if a
  b
  c)
(when a
(b))
(cond ((> a b) (c)) ((< a b) (d) (e)) (else (f)))
(cond ((= a b) (c)))
(case x (milk (a)) ((cup bowl) (b) (c)) (otherwise nil))
(par (:tag left (f)) (g))
(with-failure-handling ((manipulation-failure (e) (do-retry n (retry)) (propagate)) (plan-failure (e) nil)) (perform d) (perform e))
(with-failure-handling ((failure (e) nil)) (f))
(with-retry-counters ((n 3)) (f) (g))
(lambda (x) (* x x))

(unwind-protect (f) (g))
(partial-order ((:tag a (f)) (:tag b (g))) (:order a b)))"#,
        expect![[r#"
            (def-plan p (a &optional (b 2))
              (let ((x 1)) x)
              (let ((x 1) (y 2))
                (f x)
                (g y))
              (when a (b))
              (if a b c)
              (if a
                  b
                  c)
              (when a
                (b))
              (cond
                ((> a b) (c))
                ((< a b)
                 (d)
                 (e))
                (else (f)))
              (cond ((= a b) (c)))
              (case x
                (milk (a))
                ((cup bowl)
                 (b)
                 (c))
                (otherwise nil))
              (par
                (:tag left (f))
                (g))
              (with-failure-handling
                  ((manipulation-failure (e)
                     (do-retry n (retry))
                     (propagate))
                   (plan-failure (e) nil))
                (perform d)
                (perform e))
              (with-failure-handling ((failure (e) nil)) (f))
              (with-retry-counters ((n 3))
                (f)
                (g))
              (lambda (x) (* x x))

              (unwind-protect
                (f)
                (g))
              (partial-order
                ((:tag a (f)) (:tag b (g)))
                (:order a b)))
        "#]],
    );
}

#[test]
fn long_forms() {
    check_format(
        r#"(some-function-name (another-function argument-number-one argument-number-two) (a-third-function argument-number-three))
(a-function-with-an-extremely-long-name-that-leaves-no-room-for-anything-at-all-right-of-it-or-so argument-one "argument two")
(print 1111111111 2222222222 3333333333 4444444444 5555555555 6666666666 7777777777 8888888888 9999999999 1010101010)
(wait-for (fl (and (> (value position) 12) (< (value position) 23))) :timeout 12 :otherwise (fail too-slow :where here))
(let ((first-value (compute-something-long with-an-argument and-another-one)) (second-value (compute more of-the same))) x)
{:a 1 :b 2}
{:first-key (compute-something-long with-an-argument and-another-one) :second-key (compute-something-else x)}
{:a 1
 :b 2}
'(milk cup bowl spoon fork knife plate saucer glass bottle carton box bag can jar tin tube packet crate basket bin)
'((a 1) (b 2)
  (c 3))
[1 2
3]
(an action (type transporting)
   (object o))
"#,
        expect![[r#"
            (some-function-name (another-function argument-number-one argument-number-two)
                                (a-third-function argument-number-three))
            (a-function-with-an-extremely-long-name-that-leaves-no-room-for-anything-at-all-right-of-it-or-so
             argument-one "argument two")
            (print 1111111111 2222222222 3333333333 4444444444 5555555555 6666666666 7777777777 8888888888
                   9999999999 1010101010)
            (wait-for (fl (and (> (value position) 12) (< (value position) 23)))
                      :timeout 12
                      :otherwise (fail too-slow :where here))
            (let ((first-value (compute-something-long with-an-argument and-another-one))
                  (second-value (compute more of-the same)))
              x)
            {:a 1 :b 2}
            {:first-key (compute-something-long with-an-argument and-another-one)
             :second-key (compute-something-else x)}
            {:a 1
             :b 2}
            '(milk cup bowl spoon fork knife plate saucer glass bottle carton box bag can jar tin tube packet
              crate basket bin)
            '((a 1) (b 2)
              (c 3))
            [1 2
             3]
            (an action
              (type transporting)
              (object o))
        "#]],
    );
}

#[test]
fn rules() {
    check_format(
        r#"(def-rules both-hands
  "doc"
  (<- (both-hands ?first-deliver ?second-deliver) (transport-task top-level ?first) (transport-task top-level ?second) (before ?first ?second))
  (<- (p ?x)
   (q ?x)))"#,
        expect![[r#"
            (def-rules both-hands
              "doc"
              (<- (both-hands ?first-deliver ?second-deliver)
                  (transport-task top-level ?first)
                  (transport-task top-level ?second)
                  (before ?first ?second))
              (<- (p ?x)
                  (q ?x)))
        "#]],
    );
}

#[test]
fn comments_stay() {
    check_format(
        r#"; at the top
;; two


; before a definition
(def-plan a () ; signature
  ; before the body
  (foo) ; after foo

  ; before bar
  (bar ; inside bar
    1 #| glued |# 2 #| trailing |#
    3)
  #| block |#
  (baz) ; last
  ; very last
)
; between
(x) ; behind
(f ; c
)
( ; head
 a)
' ; within
b
(when ; odd
  a #| two
lines |# b)
#| end |# #| end |#
"#,
        expect![[r#"
            ; at the top
            ;; two

            ; before a definition
            (def-plan a () ; signature
              ; before the body
              (foo) ; after foo

              ; before bar
              (bar ; inside bar
                   1 #| glued |# 2 #| trailing |#
                   3)
              #| block |#
              (baz) ; last
              ; very last
              )

            ; between
            (x) ; behind
            (f ; c
               )
            ( ; head
             a)
            ; within
            'b
            (when ; odd
                a #| two
            lines |#
              b)
            #| end |#
            #| end |#
        "#]],
    );
}

#[test]
fn nothing_and_blanks() {
    check_format("", expect![[""]]);
    check_format("\n\n  \n", expect![[""]]);
    check_format(
        "  ; only\n",
        expect![[r#"
        ; only
    "#]],
    );
    check_format(
        "\u{feff}a\r\nb\r\n",
        expect![[r#"
        a
        b
    "#]],
    );
    check_format(
        "#!/usr/bin/env pleach run\n(main)",
        expect![[r#"
        #!/usr/bin/env pleach run
        (main)
    "#]],
    );
    check_format(
        "()\n(  )\n[ ]{ }\n\n\n\n' x",
        expect![[r#"
        ()
        ()
        []
        {}

        'x
    "#]],
    );
}

#[test]
fn a_text_with_errors_is_refused() {
    assert_eq!(format("(a").map_err(|errors| errors.len()), Err(1));
}

#[test]
fn the_deepest_nesting_needs_little_stack() {
    let small = std::thread::Builder::new().stack_size(1 << 20);
    let thread = small.spawn(format_the_deepest).expect("a thread starts");
    thread.join().expect("1 MiB of stack is enough");
}

fn format_the_deepest() {
    for (open, close) in [("(a ", ")"), ("(when a b ", ")"), ("[", "]"), ("{a ", "}"), ("'", "")] {
        formatted(&format!("{}x{}", open.repeat(999), close.repeat(999)));
    }
}

#[test]
fn a_long_file() {
    formatted(&"(def-plan a (b) (foo (bar 1 2) ; c\n (when x y z)))\n".repeat(2_000));
}

#[test]
fn rules_and_queries() {
    check_format(
        r#"(def-native-rule symbol? (?x) "True of symbols.")
(def-facts map (road a b))
(def-facts map "Roads." (road a b) (road b . ?x))
(def-plan main ()
 (for-each-answer (?x ?y) (road ?x ?y) (print ?x) (print ?y))
 (with-facts ((road ?x ?y) (road a b)) (print 1) (print 2))
 (with-facts ((road ?x ?y) (road a b) (road from-here-to-the-next-town a-town-with-a-long-name-on-the-way)) (print 1))
 (query (and (road ?x . ?y) (exists (?z ?y) (road ?z)) (bagof ?x (exists (?y) (road ?x ?y)) ?list-that-is-rather-long))))
"#,
        expect![[r#"
            (def-native-rule symbol? (?x)
              "True of symbols.")

            (def-facts map (road a b))

            (def-facts map
              "Roads."
              (road a b)
              (road b . ?x))

            (def-plan main ()
              (for-each-answer (?x ?y) (road ?x ?y)
                (print ?x)
                (print ?y))
              (with-facts ((road ?x ?y) (road a b))
                (print 1)
                (print 2))
              (with-facts ((road ?x ?y)
                           (road a b)
                           (road from-here-to-the-next-town a-town-with-a-long-name-on-the-way))
                (print 1))
              (query (and (road ?x . ?y)
                          (exists (?z ?y) (road ?z))
                          (bagof ?x (exists (?y) (road ?x ?y)) ?list-that-is-rather-long))))
        "#]],
    );
}
