# Goals about stored trees: of several runs, with rules of other files.
=== things.plan
(def-facts things (sharp knife))
=== wash.plan
(use "things")
(def-plan wash (x) (sleep 1) (if (eq x 'knife) (fail plan-failure :message "sharp") x))
(def-plan main ()
  (dolist (x '(cup knife plate))
    (with-failure-handling ((plan-failure (e) (return nil))) (wash x))))
=== late.plan
(def-rules lateness
  (<- (late ?task ?s) (task-end ?task ?s) (< 1.5 ?s) (task-name ?task wash))
  (<- (hurt ?what) (task-status ?task failed) (task-param ?task x ?what) (sharp ?what)))
=== late.pl
clean(X) :- 'task-status'(T, succeeded), 'task-param'(T, x, X).
=== wrong.plan
(def-rules late (<- (late ?task) (nothing ?task)))
=== commands
$ pleach run wash.plan --store a.store -q
--- exit 0
$ sed -i "s/(cup knife plate)/(cup spoon)/" wash.plan; pleach run wash.plan --store a.store --tree kitchen -q
--- exit 0
$ sed -i "s/(cup spoon)/(knife)/" wash.plan; pleach run wash.plan --store a.store --tree kitchen -q; rm wash.plan things.plan
--- exit 0
$ pleach query a.store '(hurt ?what)' --each --all --rules late.plan
% run-1@1
?what = knife
% kitchen@1
false.
% kitchen@2
?what = knife
--- exit 0
$ pleach query a.store '(late ?task ?s)' --each --all --rules late.plan --json
{"tree":"run-1@1","answers":[{"?task":"(path main (wash :call 2))","?s":"2.0"},{"?task":"(path main (wash :call 3))","?s":"3.0"}],"more":false}
{"tree":"kitchen@1","answers":[{"?task":"(path main (wash :call 2))","?s":"2.0"}],"more":false}
{"tree":"kitchen@2","answers":[],"more":false}
--- exit 0
$ pleach query a.store '(clean ?what)' --all --rules late.pl --stored kitchen@1
?what = cup
?what = spoon
--- exit 0
$ pleach query a.store '(late ?task ?s) (clean ?what)' --rules late.plan --rules late.pl --stored kitchen@1
?task = (path main (wash :call 2))
?s = 2.0
?what = cup
--- stderr
there may be more answers: --all shows them
--- exit 0
$ pleach query a.store '(late ?task ?s)' --each
% run-1@1
--- stderr
rule::unknown_predicate

  × no predicate is called `late`
   ╭─[goal:1:2]
 1 │ (late ?task ?s)
   ·  ──┬─
   ·    ╰── not a goal
   ╰────
  help: define it with `def-rules` or `def-facts`, or declare that it may have no clauses: (def-
        open late 2)
--- exit 2
$ pleach query a.store '(late ?task)' --rules wrong.plan
--- stderr
rule::unknown_predicate

  × no predicate is called `nothing`
   ╭─[wrong.plan:1:35]
 1 │ (def-rules late (<- (late ?task) (nothing ?task)))
   ·                                   ───┬───
   ·                                      ╰── not a goal
   ╰────
  help: define it with `def-rules` or `def-facts`, or declare that it may have no clauses: (def-
        open nothing 1)
--- exit 2
$ pleach query a.store '(late ?task)' --rules none.plan
--- stderr
error: cannot read none.plan: there is no such file
  help: did you mean ./late.plan?
--- exit 2
$ pleach replay a.store 1 --to 2.5s
--- stderr
top-level  running
└─ main  running
   ├─ wash cup  succeeded → cup  [0 – 1 s]
   ├─ wash knife  failed: plan-failure  [1 – 2 s]
   └─ wash plate  running  [since 2 s]
stopped at step 6, 2.5 s of the task clock
  in plan wash at wash.plan:2:38
  in plan main at wash.plan:5:62
  in file top-level at the call of the plan:1:1
tasks
  top-level / main / wash :call 3 waits for a time
--- exit 0
