# Tests in the language.

=== t.plan
(def-const base 1)
(def-fun add (a b) (+ a b))
(def-test adds "Sums." (expect (= (add base 2) 3)))
(def-test wrong (print "before") (expect (= (add 1 2) 4)))
(def-test refuses (expect-failure type-error (add 1 'a)))
(def-test raises (add 1 'x))

=== bad.plan
(def-test x (nothing))

=== commands
$ pleach test t.plan
t.plan: 4 tests
test adds ... ok
test wrong ... FAILED
  it printed:
    before
      × expectation-failed
      │ in top-level
      │ form: (= (add 1 2) 4)
      │ expected: 4
      │ actual: 3
       ╭─[t.plan:4:34]
     3 │ (def-test adds "Sums." (expect (= (add base 2) 3)))
     4 │ (def-test wrong (print "before") (expect (= (add 1 2) 4)))
       ·                                  ────────────┬───────────
       ·                                              ╰── failed here
     5 │ (def-test refuses (expect-failure type-error (add 1 'a)))
       ╰────
test refuses ... ok
test raises ... FAILED
      × type-error: expected a number, got the symbol x
      │ in top-level
      │ expected: "a number"
      │ value: x
       ╭─[t.plan:2:20]
     1 │ (def-const base 1)
     2 │ (def-fun add (a b) (+ a b))
       ·                    ───┬───
       ·                       ╰── failed here
     3 │ (def-test adds "Sums." (expect (= (add base 2) 3)))
       ╰────

2 passed, 2 failed
--- exit 1
$ pleach test t.plan --filter s
t.plan: 3 tests
test adds ... ok
test refuses ... ok
test raises ... FAILED
      × type-error: expected a number, got the symbol x
      │ in top-level
      │ expected: "a number"
      │ value: x
       ╭─[t.plan:2:20]
     1 │ (def-const base 1)
     2 │ (def-fun add (a b) (+ a b))
       ·                    ───┬───
       ·                       ╰── failed here
     3 │ (def-test adds "Sums." (expect (= (add base 2) 3)))
       ╰────

2 passed, 1 failed
--- exit 1
$ pleach test t.plan --filter adds --json
{"passed":1,"failed":0,"tests":[{"name":"adds","file":"t.plan","line":3,"outcome":"passed","printed":""}],"errors":[]}
--- exit 0
$ pleach test . --filter adds
resolve::unknown_name

  × nothing is called `nothing`
   ╭─[./bad.plan:1:14]
 1 │ (def-test x (nothing))
   ·              ───┬───
   ·                 ╰── not defined here
 2 │ 
   ╰────
./t.plan: 1 test
test adds ... ok

1 file could not be tested
1 passed, 0 failed
--- exit 2
$ pleach test t.plan --filter nothing-of-this-name
t.plan: 0 tests

0 passed, 0 failed
--- exit 0
