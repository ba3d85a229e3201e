# What `run` prints where, and its exit codes.

=== good.plan
(def-plan greet (name) (print "hello," name) name)
(def-plan main () (greet 'Ada) (greet 'Grace))
(def-plan both (a b) (list a b))

=== bad.plan
(def-failure spilled () (what))
(def-plan pour (what) (fail spilled :what what))
(def-plan retrying (what)
  (with-failure-handling ((spilled (e) (fail type-error :message "cannot go on")))
    (pour what)))
(def-plan main () (print "before") (retrying 'milk))

=== wrong.plan
(def-plan main () (foo 1))

=== load.plan
(print "loading")
(first 5)
(def-plan main () (print "never"))

=== commands
$ pleach run good.plan
hello, Ada
hello, Grace
--- stderr
top-level  succeeded → Grace
└─ main  succeeded → Grace
   ├─ greet Ada  succeeded → Ada
   └─ greet Grace  succeeded → Grace
--- exit 0
$ pleach run good.plan --quiet
hello, Ada
hello, Grace
--- exit 0
$ pleach run good.plan --quiet --trace
hello, Ada
hello, Grace
--- stderr
        0 start top-level / main
        0 start top-level / main / greet Ada
        0 end   top-level / main / greet succeeded → Ada
        0 start top-level / main / greet :call 2 Grace
        0 end   top-level / main / greet :call 2 succeeded → Grace
        0 end   top-level / main succeeded → Grace
--- exit 0
$ pleach run good.plan --json
{"outcome":"succeeded","value":"Grace","file":"good.plan","plan":"main","seed":0,"steps":3,"clock":0.0,"tree":[{"name":"top-level","path":"top-level","parent":null,"kind":"top-level","status":"succeeded","attempt":1,"params":{},"value":"Grace","start":0.0,"end":0.0},{"name":"main","path":"top-level / main","parent":0,"kind":"plan","status":"succeeded","attempt":1,"params":{},"value":"Grace","start":0.0,"end":0.0},{"name":"greet","path":"top-level / main / greet","parent":1,"kind":"plan","status":"succeeded","attempt":1,"params":{"name":"Ada"},"value":"Ada","start":0.0,"end":0.0},{"name":"greet","path":"top-level / main / greet :call 2","parent":1,"kind":"plan","status":"succeeded","attempt":1,"params":{"name":"Grace"},"value":"Grace","start":0.0,"end":0.0}]}
--- stderr
hello, Ada
hello, Grace
--- exit 0
$ pleach run good.plan --plan both --arg "'x" --arg '"y z" ; comment'
--- stderr
top-level  succeeded → (x "y z")
└─ both x "y z"  succeeded → (x "y z")
--- exit 0
$ pleach run good.plan --plan both --arg 1
--- stderr
form::arity

  × `both` takes 2 arguments, got 1
   ╭─[the call of the plan:1:1]
 1 │ (both 1)
   · ────┬───
   ·     ╰── called here
   ╰────
  help: its parameters are (a b)
--- exit 2
$ pleach run good.plan --plan both --arg '1 2'
--- stderr
error: --arg 1 2 is no form: it has 2 forms, not one
  help: each --arg is one form, as it stands in a program: --arg "'milk" --arg 3 --arg '"text"'
--- exit 2
$ pleach run good.plan --plan bothh
--- stderr
error: the program has no plan called `bothh`
  help: did you mean `both`?
--- exit 2
$ pleach run bad.plan
before
--- stderr
top-level  failed: type-error
└─ main  failed: type-error
   └─ retrying milk  failed: type-error
      └─ pour milk  failed: spilled
  × type-error: cannot go on
  │ in top-level / main / retrying
   ╭─[bad.plan:4:40]
 3 │ (def-plan retrying (what)
 4 │   (with-failure-handling ((spilled (e) (fail type-error :message "cannot go on")))
   ·                                        ────────────────────┬────────────────────
   ·                                                            ╰── failed here
 5 │     (pour what)))
   ╰────
  × caused by spilled
  │ in top-level / main / retrying / pour
  │ what: milk
   ╭─[bad.plan:2:23]
 1 │ (def-failure spilled () (what))
 2 │ (def-plan pour (what) (fail spilled :what what))
   ·                       ────────────┬────────────
   ·                                   ╰── failed here
 3 │ (def-plan retrying (what)
   ╰────
--- exit 1
$ pleach run bad.plan --quiet
before
--- stderr
  × type-error: cannot go on
  │ in top-level / main / retrying
   ╭─[bad.plan:4:40]
 3 │ (def-plan retrying (what)
 4 │   (with-failure-handling ((spilled (e) (fail type-error :message "cannot go on")))
   ·                                        ────────────────────┬────────────────────
   ·                                                            ╰── failed here
 5 │     (pour what)))
   ╰────
  × caused by spilled
  │ in top-level / main / retrying / pour
  │ what: milk
   ╭─[bad.plan:2:23]
 1 │ (def-failure spilled () (what))
 2 │ (def-plan pour (what) (fail spilled :what what))
   ·                       ────────────┬────────────
   ·                                   ╰── failed here
 3 │ (def-plan retrying (what)
   ╰────
--- exit 1
$ pleach run bad.plan --json --quiet
{"outcome":"failed","failure":{"type":"type-error","fields":{"message":"\"cannot go on\""},"task":"top-level / main / retrying","cause":{"type":"spilled","fields":{"what":"milk"},"task":"top-level / main / retrying / pour","place":{"file":"bad.plan","line":2,"column":23,"end-line":2,"end-column":48}},"place":{"file":"bad.plan","line":4,"column":40,"end-line":4,"end-column":81}},"file":"bad.plan","plan":"main","seed":0,"steps":3,"clock":0.0}
--- stderr
before
--- exit 1
$ pleach run wrong.plan
--- stderr
resolve::unknown_name

  × nothing is called `foo`
   ╭─[wrong.plan:1:20]
 1 │ (def-plan main () (foo 1))
   ·                    ─┬─
   ·                     ╰── not defined here
   ╰────
--- exit 2
$ pleach run wrong.plan --json
{"outcome":"errors","errors":[{"severity":"error","code":"resolve::unknown_name","message":"nothing is called `foo`","help":null,"file":"wrong.plan","line":1,"column":20,"end-line":1,"end-column":23,"labels":[{"file":"wrong.plan","line":1,"column":20,"end-line":1,"end-column":23,"text":"not defined here"}]}]}
--- stderr
resolve::unknown_name

  × nothing is called `foo`
   ╭─[wrong.plan:1:20]
 1 │ (def-plan main () (foo 1))
   ·                    ─┬─
   ·                     ╰── not defined here
   ╰────
--- exit 2
$ pleach run load.plan
loading
--- stderr
top-level  failed: type-error
error: the file could not be loaded: one of its top-level forms failed
  × type-error: expected a list, got the integer 5
  │ in top-level
  │ expected: "a list"
  │ value: 5
   ╭─[load.plan:2:1]
 1 │ (print "loading")
 2 │ (first 5)
   · ────┬────
   ·     ╰── failed here
 3 │ (def-plan main () (print "never"))
   ╰────
--- exit 2
