# What comes from outside between two rounds is one entry of the log, whole or not there.

=== data/cup.txt
in the cupboard

=== data/milk.txt
in the fridge

=== main.plan
(def-plan look (thing) (read-file (format "data/~a.txt" thing)))
(def-plan main ()
  (par (look 'cup)
       (look 'milk)
       (seq (sleep 100) (look 'cup) (look 'tea)))
  'done)

=== two.plan
(def-plan main () (par (read-file "data/milk.txt") (read-file "data/cup.txt")))

=== commands
$ pleach run main.plan --allow read=data --log run.log --quiet 2>&1 | head -1
  × file-failure: cannot read data/tea.txt: there is no such file
--- exit 0
$ tail -n +2 run.log
{"round":2,"step":4,"clock":0,"events":[{"slot":6,"attempt":1,"number":1,"request":"read data/cup.txt","answer":"in the cupboard\n"},{"slot":7,"attempt":1,"number":1,"request":"read data/milk.txt","answer":"in the fridge\n"}]}
{"round":4,"step":5,"clock":100000000000,"events":[{"slot":8,"attempt":1,"number":1,"request":"read data/cup.txt","answer":"in the cupboard\n"}]}
{"round":5,"step":6,"clock":100000000000,"events":[{"slot":9,"attempt":1,"number":1,"request":"read data/tea.txt","refused":"cannot read data/tea.txt: there is no such file"}]}
--- exit 0
$ head -n 2 run.log | head -c -40 > cut.log; pleach resume cut.log --quiet 2>/dev/null; cmp cut.log run.log
--- exit 0
$ head -n 3 run.log > cut.log; pleach replay cut.log 2>&1 | tail -5
   └─ par  running
      └─ look cup  running  [since 100 s]
the log ends here: stopped at step 5, 100 s of the task clock
  in plan look at main.plan:1:1
  in branch par at main.plan:5:25
--- exit 0
$ sed 's/cup.txt/tee.txt/' run.log > other.log; pleach resume other.log --quiet
--- stderr
allowed, as the log says: read=data
  × program-error: the run differs from its log: in round 2 it asks for read data/cup.txt (slot 6,
  │ attempt 1, number 1), the log has read data/tee.txt (slot 6, attempt 1, number 1) in round 2
  │ in top-level / main / par :call 3
   ╭─[main.plan:5:13]
 4 │        (look 'milk)
 5 │        (seq (sleep 100) (look 'cup) (look 'tea)))
   ·             ─────┬─────
   ·                  ╰── failed here
 6 │   'done)
   ╰────
--- exit 1
$ sed '2s/,{.*}/]}/' run.log > fewer.log; pleach resume fewer.log --quiet 2>&1 | head -2
allowed, as the log says: read=data
  × program-error: the run differs from its log: in round 2 it asks for read data/milk.txt (slot
--- exit 0
$ sed 's/"clock":"virtual"/"clock":"real"/' run.log > real.log; timeout 50 pleach resume real.log --quiet 2>&1 | head -2
allowed, as the log says: read=data
  × file-failure: cannot read data/tea.txt: there is no such file
--- exit 0
$ sed 's/"pleach-log":2/"pleach-log":1/' run.log > old.log; pleach resume old.log
--- stderr
error: [FOLDER]/old.log is a log of version 1; this pleach reads version 2
  help: use the pleach that wrote it
--- exit 2
$ pleach run two.plan --allow read=data --log old.log --quiet; head -c 16 old.log
{"pleach-log":2,⏎
--- exit 0
$ printf '(read-file "data/cup.txt")\n(read-file "data/milk.txt")\n:back 1\n:continue\n:back 9\n(read-file "data/milk.txt")\n' | pleach repl --allow read=data
> (read-file "data/cup.txt")
"in the cupboard\n"
> (read-file "data/milk.txt")
"in the fridge\n"
> :back 1
back at step 0, before an input
> :continue
error: nothing is stopped
  help: :break NAME stops a run where a task of that name begins
> :back 9
back at step 0, before an input
> (read-file "data/milk.txt")
"in the fridge\n"
--- exit 0
