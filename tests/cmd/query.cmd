# What `pleach query` says of answers, of their absence, of mistakes; the exit codes.
=== kitchen.plan
(def-facts kitchen
  (on milk table)
  (on cup shelf)
  (on pot table))

(def-rules near
  (<- (near ?x ?y) (on ?x ?place) (on ?y ?place) (not (== ?x ?y)))
  (<- (endless ?x) (endless ?x)))

(def-fun weigh (x)
  (if (equal? x 'pot)
      (fail plan-failure :message "too heavy")
      2))

(def-plan wash (what)
  (print "washing the" what)
  (sleep 2)
  (when (equal? what 'pot)
    (fail plan-failure :message "broken"))
  (an object (type ,what) (color white)))

(def-plan main ()
  (wash 'cup)
  (wash 'pot))

(def-plan wash-all (things)
  (dolist (thing things)
    (wash thing)))

(print "loaded")
=== once.plan
(def-plan wash (what) (sleep 1) what)
(def-plan main () (wash 'cup) (wash 'plate))
=== bad.plan
(def-facts kitchen (on ?x table))
=== failing.plan
(def-facts kitchen (on milk table))
(fail plan-failure :message "not today")
=== family.pl
parent(adam, abel).
parent(eve, abel).
parent(eve, seth).
parent(seth, enosh).
ancestor(X, Y) :- parent(X, Y).
ancestor(X, Z) :- parent(X, Y), ancestor(Y, Z).
=== wrong.pl
parent(adam, abel).
lonely(X) :- parent(X, Child), \+ married(X).
parent(eve abel).
=== commands
$ pleach query kitchen.plan '(on ?x table)'
?x = milk
--- stderr
loaded
there may be more answers: --all shows them
--- exit 0
$ pleach query kitchen.plan '(on ?x table)' --all
?x = milk
?x = pot
--- stderr
loaded
--- exit 0
$ pleach query kitchen.plan '(on ?x ?y) (not (== ?y shelf))' --all
?x = milk
?y = table

?x = pot
?y = table
--- stderr
loaded
--- exit 0
$ pleach query kitchen.plan '(near ?x ?y)' --most 1
?x = milk
?y = pot
--- stderr
loaded
there may be more answers
--- exit 0
$ pleach query kitchen.plan '(near ?x ?y)' --most 5
?x = milk
?y = pot

?x = pot
?y = milk
--- stderr
loaded
--- exit 0
$ pleach query kitchen.plan '(on milk table)'
true.
--- stderr
loaded
--- exit 0
$ pleach query kitchen.plan '(on milk shelf)'
false.
--- stderr
loaded
--- exit 1
$ pleach query kitchen.plan '(on ?x ?y) (fun weigh ?x ?w)' --all
?x = milk
?y = table
?w = 2

?x = cup
?y = shelf
?w = 2
--- stderr
loaded
  × plan-failure: too heavy
    ╭─[kitchen.plan:12:7]
 11 │   (if (equal? x 'pot)
 12 │       (fail plan-failure :message "too heavy")
    ·       ────────────────────┬───────────────────
    ·                           ╰── failed here
 13 │       2))
    ╰────
--- exit 1
$ pleach query kitchen.plan '(endless 1)' --fuel 10_000
--- stderr
loaded
  × fuel-exhausted: the query used up its fuel of 10000 inferences
  │ limit: 10000
  │ goals: (endless)
--- exit 1
$ pleach query kitchen.plan '(onn ?x table)'
--- stderr
loaded
rule::unknown_predicate

  × no predicate is called `onn`
   ╭─[goal:1:2]
 1 │ (onn ?x table)
   ·  ─┬─
   ·   ╰── not a goal
   ╰────
  help: did you mean `on`?
--- exit 2
$ pleach query kitchen.plan '(on ?x table'
--- stderr
loaded
parse::unclosed

  × `(` is never closed
   ╭─[goal:1:1]
 1 │ (on ?x table
   · ┬
   · ╰── opened here
   ╰────
  help: the missing end is `)`
--- exit 2
$ pleach query kitchen.plan ''
--- stderr
loaded
form::shape

  × `?-` has no goal
   ╭─[goal:1:1]
   ╰────
  help: it is written ?- (predicate ?x …)
--- exit 2
$ pleach query kitchen.plan '(on ?x ?y)' --json
{"answers":[{"?x":"milk","?y":"table"}],"more":true}
--- stderr
loaded
--- exit 0
$ pleach query kitchen.plan '(on ?x shelf)' --json --all
{"answers":[{"?x":"cup"}],"more":false}
--- stderr
loaded
--- exit 0
$ pleach query kitchen.plan '(on ?x floor)' --json
{"answers":[],"more":false}
--- stderr
loaded
--- exit 1
$ pleach query kitchen.plan '(on milk table)' --json
{"answers":[{}],"more":false}
--- stderr
loaded
--- exit 0
$ pleach query kitchen.plan '(on ?x ?y) (fun weigh ?x ?w)' --all --json
{"answers":[{"?x":"milk","?y":"table","?w":"2"},{"?x":"cup","?y":"shelf","?w":"2"}],"more":false,"failure":{"type":"plan-failure","fields":{"message":"\"too heavy\""},"place":{"file":"kitchen.plan","line":12,"column":7,"end-line":12,"end-column":47}}}
--- stderr
loaded
  × plan-failure: too heavy
    ╭─[kitchen.plan:12:7]
 11 │   (if (equal? x 'pot)
 12 │       (fail plan-failure :message "too heavy")
    ·       ────────────────────┬───────────────────
    ·                           ╰── failed here
 13 │       2))
    ╰────
--- exit 1
$ pleach query kitchen.plan '(on ?x' --json 2>/dev/null
{"errors":[{"severity":"error","code":"parse::unclosed","message":"`(` is never closed","help":"the missing end is `)`","file":"goal","line":1,"column":1,"end-line":1,"end-column":2,"labels":[{"file":"goal","line":1,"column":1,"end-line":1,"end-column":2,"text":"opened here"}]}]}
--- exit 2
$ pleach query bad.plan '(on ?x table)'
--- stderr
rule::term

  × a fact has a variable in it
   ╭─[bad.plan:1:24]
 1 │ (def-facts kitchen (on ?x table))
   ·                        ─┬
   ·                         ╰── here
   ╰────
  help: what holds for all values is a clause: (def-rules … (<- (p ?x)))
--- exit 2
$ pleach query failing.plan '(on ?x table)'
--- stderr
error: the file could not be loaded: one of its top-level forms failed
  × plan-failure: not today
  │ in top-level
   ╭─[failing.plan:2:1]
 1 │ (def-facts kitchen (on milk table))
 2 │ (fail plan-failure :message "not today")
   · ────────────────────┬───────────────────
   ·                     ╰── failed here
   ╰────
--- exit 2
$ pleach query missing.plan '(on ?x table)'
--- stderr
error: cannot read missing.plan: there is no such file
  help: check the name, and the folder that you are in
--- exit 2
$ pleach query kitchen.plan '(task-name ?task wash) (task-status ?task ?status)' --run --all
?task = (path main wash)
?status = succeeded

?task = (path main (wash :call 2))
?status = failed
--- stderr
loaded
washing the cup
washing the pot
note: the plan failed: plan-failure
--- exit 0
$ pleach query kitchen.plan '(task-param ?task what ?what) (task-value ?task ?value)' --run=wash-all --arg "'(cup plate)" --all
?task = (path wash-all wash)
?what = cup
?value = (an object (color white) (type cup))

?task = (path wash-all (wash :call 2))
?what = plate
?value = (an object (color white) (type plate))
--- stderr
loaded
washing the cup
washing the plate
--- exit 0
$ pleach query kitchen.plan '(task ?task)' --run=wash-al
--- stderr
error: the program has no plan called `wash-al`
  help: did you mean `wash-all`?
--- exit 2
$ pleach run once.plan --json > tree.json
--- exit 0
$ pleach query kitchen.plan '(task-param ?task what ?what) (task-end ?task ?end)' --tree tree.json --all
?task = (path main wash)
?what = cup
?end = 1.0

?task = (path main (wash :call 2))
?what = plate
?end = 2.0
--- stderr
loaded
--- exit 0
$ pleach query kitchen.plan '(task ?task)' --tree missing.json
--- stderr
error: cannot read missing.json: there is no such file
  help: check the name, and the folder that you are in
--- exit 2
$ echo '{"tree": [{"name": "top-level", "kind": "top-level", "status": "don"}]}' > bad.json; pleach query kitchen.plan '(task ?task)' --tree bad.json
--- stderr
error: bad.json holds no tree of `pleach run --json`: tree[0].status is none of planned, created, running, suspended, deferred, succeeded, failed, evaporated, skipped
  help: write one with: pleach run FILE.plan --json > tree.json
--- exit 2
$ echo '{"tree": [' > bad.json; pleach query kitchen.plan '(task ?task)' --tree bad.json
--- stderr
error: bad.json holds no tree of `pleach run --json`: it is no JSON: EOF while parsing a list at line 2 column 0
  help: write one with: pleach run FILE.plan --json > tree.json
--- exit 2
$ pleach run once.plan --json --quiet > bad.json; pleach query kitchen.plan '(task ?task)' --tree bad.json
--- stderr
error: bad.json holds no tree of `pleach run --json`: there is no `tree` in it: was it written with --quiet, or by a run that had errors?
  help: write one with: pleach run FILE.plan --json > tree.json
--- exit 2
$ pleach query family.pl '(ancestor ?x enosh)' --all
?x = seth
?x = eve
--- exit 0
$ pleach query wrong.pl '(parent ?x ?y)'
--- stderr
rule::unknown_predicate

  × no predicate is called `married`
   ╭─[wrong.pl:2:35]
 1 │ parent(adam, abel).
 2 │ lonely(X) :- parent(X, Child), \+ married(X).
   ·                                   ───┬───
   ·                                      ╰── not a goal
 3 │ parent(eve abel).
   ╰────
  help: define it with `def-rules` or `def-facts`, or declare that it may have no clauses: (def-
        open married 1)
prolog::unexpected

  × `abel` cannot stand here
   ╭─[wrong.pl:3:12]
 2 │ lonely(X) :- parent(X, Child), \+ married(X).
 3 │ parent(eve abel).
   ·            ──┬─
   ·              ╰── here
   ╰────
  help: an operator, a comma or the end of the clause `.` is missing before it
--- exit 2
$ pleach check family.pl
--- exit 0
$ pleach check wrong.pl
--- stderr
rule::unknown_predicate

  × no predicate is called `married`
   ╭─[wrong.pl:2:35]
 1 │ parent(adam, abel).
 2 │ lonely(X) :- parent(X, Child), \+ married(X).
   ·                                   ───┬───
   ·                                      ╰── not a goal
 3 │ parent(eve abel).
   ╰────
  help: define it with `def-rules` or `def-facts`, or declare that it may have no clauses: (def-
        open married 1)
prolog::unexpected

  × `abel` cannot stand here
   ╭─[wrong.pl:3:12]
 2 │ lonely(X) :- parent(X, Child), \+ married(X).
 3 │ parent(eve abel).
   ·            ──┬─
   ·              ╰── here
   ╰────
  help: an operator, a comma or the end of the clause `.` is missing before it
2 errors, 0 warnings
--- exit 2
$ pleach query missing.pl '(parent ?x ?y)'
--- stderr
error: cannot read missing.pl: there is no such file
  help: check the name, and the folder that you are in
--- exit 2
