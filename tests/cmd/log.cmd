# A run is its log: stopped, resumed, replayed, and what a log does not fit to.

=== data/list.txt
milk, tea

=== main.plan
(def-plan fetch (i) (when (= i 3) (print (read-file "data/list.txt"))) i)
(def-plan main ()
  (dotimes (i 2000) (fetch i))
  (write-string (read-file "data/list.txt"))
  'done)

=== commands
$ pleach run main.plan --allow read=data --log run.log --stop-at 3000 2>&1 | tail -3
  in plan main at main.plan:3:3
  in file top-level at the call of the plan:1:1
go on with: pleach resume run.log
--- exit 0
$ sed 's/"folder":"[^"]*"/"folder":"…"/; s/"hash":"[^"]*"/"hash":"…"/g; s/"program":"[^"]*"/"program":"…"/' run.log
{"pleach-log":2,"pleach":"0.1.0","program":"…","file":"main.plan","plan":null,"args":[],"quantum":1000,"folder":"…","files":[{"name":"library/","hash":"…"},{"name":"main.plan","hash":"…"}],"seed":0,"schedule":0,"clock":"virtual","robot":"projected","limits":{"fuel":2000000000,"depth":20000000,"memory":4294967296,"nodes":20000000,"output":268435456},"allow":["read=data"]}
{"round":1,"step":8,"clock":0,"events":[{"slot":6,"attempt":1,"number":1,"request":"read data/list.txt","answer":"milk, tea\n"}]}
--- exit 0
$ cp run.log stopped.log
--- exit 0
$ pleach replay stopped.log --to 12
milk, tea

--- stderr
top-level  running
└─ main  running
   ├─ fetch 0  succeeded → 0
   ├─ fetch 1  succeeded → 1
   ├─ fetch 2  succeeded → 2
   ├─ fetch 3  succeeded → 3
   ├─ fetch 4  succeeded → 4
   └─ fetch 5  succeeded → 5
stopped at step 12, 0 s of the task clock
  in plan main at main.plan:3:3
  in file top-level at the call of the plan:1:1
tasks
  top-level / main runs
--- exit 0
$ pleach resume run.log --quiet
milk, tea

milk, tea
--- stderr
allowed, as the log says: read=data
--- exit 0
$ tail -n +2 run.log
{"round":1,"step":8,"clock":0,"events":[{"slot":6,"attempt":1,"number":1,"request":"read data/list.txt","answer":"milk, tea\n"}]}
{"round":5,"step":4001,"clock":3000000,"events":[{"slot":2,"attempt":1,"number":1,"request":"read data/list.txt","answer":"milk, tea\n"}]}
--- exit 0
$ rm data/list.txt
--- exit 0
$ pleach replay run.log --quiet
milk, tea

milk, tea
--- exit 0
$ pleach replay stopped.log 2>&1 | tail -3
the log ends here: stopped at step 4000, 0.003 s of the task clock
  in plan main at main.plan:3:3
  in file top-level at the call of the plan:1:1
--- exit 0
$ pleach resume run.log --quiet --json 2>/dev/null
{"outcome":"succeeded","value":"done","file":"main.plan","plan":"main","seed":0,"steps":4001,"clock":0.003}
--- exit 0
$ printf '{"round":1,"st' >> run.log; pleach replay run.log --quiet
milk, tea

milk, tea
--- exit 0
$ printf 'ep":x}\n' >> run.log; pleach replay run.log --quiet
--- stderr
error: the log run.log is damaged: line 4 is no entry of a log
  help: delete this line and all below it to go on from there
--- exit 2
$ pleach run main.plan --log main.plan
--- stderr
error: main.plan is not the log of a run, and is not overwritten
  help: choose another name after --log
--- exit 2
$ cd data && pleach replay ../stopped.log --to 8 --quiet
--- stderr
stopped at step 8, 0 s of the task clock
  in plan fetch at main.plan:1:35
  in plan main at main.plan:3:21
  in file top-level at the call of the plan:1:1
--- exit 0
$ echo '; changed' >> main.plan; pleach resume stopped.log
--- stderr
allowed, as the log says: read=data
error: the program is not the one that wrote the log [FOLDER]/stopped.log: main.plan has changed
  help: put the old text back, or start again with `pleach run`
--- exit 2
