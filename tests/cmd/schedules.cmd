# Which task ran when, and in which orders tasks may run: `--timeline`, `--schedule`, `--schedules`.

=== plan.plan
(def-plan drive (place seconds) (sleep seconds) place)
(def-plan main ()
  (par (drive 'table 2)
       (:tag sink (drive 'sink 4)))
  (pursue (drive 'shelf 4) (sleep 3)))

=== race.plan
(def-plan main ()
  (let ((log (fluent nil)))
    (par (set-value log (append (value log) '(left)))
         (set-value log (append (value log) '(right))))
    (value log)))

=== printed.plan
(def-plan main () (par (print "left") (print "right")))

=== clean-up.plan
(def-plan work () (unwind-protect (sleep 9) (+ 1 'one)))
(def-plan main () (pursue (work) (sleep 1)))

=== commands
$ pleach run plan.plan --timeline
--- stderr
        0         7  ━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━   top-level  succeeded
        0         7  ━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━     main  succeeded
        0         2  ━━━━━━━━━━━                                    par  succeeded → table
        0         2  ━━━━━━━━━━━                                      drive  succeeded → table
        0         4  ━━━━━━━━━━━━━━━━━━━━━━                         sink  succeeded → sink
        0         4  ━━━━━━━━━━━━━━━━━━━━━━                           drive  succeeded → sink
        4         7                        ━━━━━━━━━━━━━━━━━━       pursue  evaporated (won)
        4         7                        ━━━━━━━━━━━━━━━━━━         drive  evaporated (won)
        4         7                        ━━━━━━━━━━━━━━━━━━       pursue  succeeded
--- exit 0
$ pleach run plan.plan --schedules 0..20
20 schedules, one outcome

20 times, for example with --schedule 0:
succeeded → nil
--- exit 0
$ pleach run race.plan --schedules 0..20
20 schedules, 2 outcomes: the program depends on the order of its tasks

11 times, for example with --schedule 2:
succeeded → (right left)

9 times, for example with --schedule 0:
succeeded → (left right)
--- exit 1
$ pleach run race.plan --schedules 20 --json
{"schedules":20,"outcomes":[{"outcome":"succeeded → (left right)","schedules":[0,1,3,8,9,11,15,16,19]},{"outcome":"succeeded → (right left)","schedules":[2,4,5,6,7,10,12,13,14,17,18]}]}
--- exit 1
$ pleach run race.plan --schedule 0
--- stderr
top-level  succeeded → (left right)
└─ main  succeeded → (left right)
   ├─ par  succeeded → (left)
   └─ par  succeeded → (left right)
--- exit 0
$ pleach run race.plan --schedule 2
--- stderr
top-level  succeeded → (right left)
└─ main  succeeded → (right left)
   ├─ par  succeeded → (right left)
   └─ par  succeeded → (right)
--- exit 0
$ pleach run printed.plan --schedules 0..20
20 schedules, one outcome

20 times, for example with --schedule 0:
succeeded → (nil nil)

what is printed differs, for example with --schedule 2
--- exit 0
$ pleach run race.plan --schedules 5..5
--- stderr
error: invalid value '5..5' for '--schedules <A..B>': there is no schedule in it; write 0..200

For more information, try '--help'.
--- exit 2
$ pleach run race.plan --schedules left
--- stderr
error: invalid value 'left' for '--schedules <A..B>': `left` is no number from 0 to 18446744073709551615

For more information, try '--help'.
--- exit 2
$ pleach run race.plan --schedules 0..5 --schedule 1
--- stderr
error: the argument '--schedules <A..B>' cannot be used with '--schedule <N>'

Usage: pleach run --schedules <A..B> <FILE>

For more information, try '--help'.
--- exit 2
$ pleach run clean-up.plan --quiet
--- stderr
warning: a clean-up failed while its task was stopped: type-error in top-level / main / pursue / work: "expected a number, got the symbol one"
--- exit 0
