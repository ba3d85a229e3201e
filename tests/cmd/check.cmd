# All that is wrong with all files at once; code; grants.

=== one.plan
(def-plan main () (foo 1))
(def-fun f (x) (set! pi 3) (f))

=== two.plan
(def-plan main ( 1)

=== paper.plan
(def-plan main ()
  (perform (an action (type going) (location (a location (on table) (target (a location (on sink))))))))

=== files.plan
(def-fun load (name) (read-file name))
(def-plan main () (map read-file '("a" "b")) (load "c") (current-time))
(def-plan pure (x) x)

=== commands
$ pleach check one.plan two.plan
--- stderr
resolve::unknown_name

  × nothing is called `foo`
   ╭─[one.plan:1:20]
 1 │ (def-plan main () (foo 1))
   ·                    ─┬─
   ·                     ╰── not defined here
 2 │ (def-fun f (x) (set! pi 3) (f))
   ╰────
resolve::set_constant

  × `pi` cannot be changed: it is a constant
   ╭─[one.plan:2:16]
 1 │ (def-plan main () (foo 1))
 2 │ (def-fun f (x) (set! pi 3) (f))
   ·                ─────┬─────
   ·                     ╰── changed here
   ╰────
  help: bind a local variable with `let` and change that
form::arity

  × `f` takes 1 argument, got 0
   ╭─[one.plan:2:28]
 1 │ (def-plan main () (foo 1))
 2 │ (def-fun f (x) (set! pi 3) (f))
   ·                            ─┬─
   ·                             ╰── called here
   ╰────
  help: its parameters are (x)
parse::unclosed

  × `(` is never closed
   ╭─[two.plan:1:1]
 1 │ (def-plan main ( 1)
   · ┬
   · ╰── opened here
   ╰────
  help: the missing end is `)`
form::parameters

  × a parameter is a name
   ╭─[two.plan:1:18]
 1 │ (def-plan main ( 1)
   ·                  ┬
   ·                  ╰── here
   ╰────
  help: parameters are written (a b &optional (c 1) &key (d 2) &rest more)
5 errors, 0 warnings
--- exit 2
$ pleach check one.plan two.plan nothing.plan --json
{"errors":6,"warnings":0,"reports":[{"severity":"error","code":"resolve::unknown_name","message":"nothing is called `foo`","help":null,"file":"one.plan","line":1,"column":20,"end-line":1,"end-column":23,"labels":[{"file":"one.plan","line":1,"column":20,"end-line":1,"end-column":23,"text":"not defined here"}]},{"severity":"error","code":"resolve::set_constant","message":"`pi` cannot be changed: it is a constant","help":"bind a local variable with `let` and change that","file":"one.plan","line":2,"column":16,"end-line":2,"end-column":27,"labels":[{"file":"one.plan","line":2,"column":16,"end-line":2,"end-column":27,"text":"changed here"}]},{"severity":"error","code":"form::arity","message":"`f` takes 1 argument, got 0","help":"its parameters are (x)","file":"one.plan","line":2,"column":28,"end-line":2,"end-column":31,"labels":[{"file":"one.plan","line":2,"column":28,"end-line":2,"end-column":31,"text":"called here"}]},{"severity":"error","code":"parse::unclosed","message":"`(` is never closed","help":"the missing end is `)`","file":"two.plan","line":1,"column":1,"end-line":1,"end-column":2,"labels":[{"file":"two.plan","line":1,"column":1,"end-line":1,"end-column":2,"text":"opened here"}]},{"severity":"error","code":"form::parameters","message":"a parameter is a name","help":"parameters are written (a b &optional (c 1) &key (d 2) &rest more)","file":"two.plan","line":1,"column":18,"end-line":1,"end-column":19,"labels":[{"file":"two.plan","line":1,"column":18,"end-line":1,"end-column":19,"text":"here"}]},{"severity":"error","code":null,"message":"cannot read nothing.plan: there is no such file","help":"check the name, and the folder that you are in","file":"nothing.plan"}]}
--- exit 2
$ pleach check paper.plan
--- stderr
desc::misplaced

  ⚠ `target` stands inside the location, though it says something about the action around it
   ╭─[paper.plan:2:69]
 1 │ (def-plan main ()
 2 │   (perform (an action (type going) (location (a location (on table) (target (a location (on sink))))))))
   ·            ─────────────────────────────────────────────┬─────────────────────────────────────────────┬
   ·                                                         │                                             ╰── part of the location by its brackets
   ·                                                         ╰── the action that probably wants it
   ╰────
  help: close the location before it: (location (a location …)) (target …)
0 errors, 1 warning
--- exit 0
$ pleach check files.plan --code
function load (name) registers=3
     0  Move                 r2 r0
     1  CallNative           r1 r2 1 read-file
     2  Return               r1

plan main () registers=5
     0  Const                r2 #<function read-file>
     1  Const                r3 ("a" "b")
     2  Nil                  r4
     3  Call                 r1 r2 map
     4  Const                r2 "c"
     5  Call                 r1 r2 load
     6  CallNative           r0 r1 0 current-time
     7  ReturnPlan           r0

plan pure (x) registers=2
     0  Move                 r1 r0
     1  ReturnPlan           r1

--- exit 0
$ pleach check files.plan --grants
read: read-file at files.plan:1:22
read: read-file at files.plan:2:24
clock: current-time at files.plan:2:57
--- exit 0
$ pleach check files.plan --grants --json
{"errors":0,"warnings":0,"reports":[],"grants":[{"effect":"read","native":"read-file","file":"files.plan","line":1,"column":22,"end-line":1,"end-column":38},{"effect":"read","native":"read-file","file":"files.plan","line":2,"column":24,"end-line":2,"end-column":33},{"effect":"clock","native":"current-time","file":"files.plan","line":2,"column":57,"end-line":2,"end-column":71}]}
--- exit 0
