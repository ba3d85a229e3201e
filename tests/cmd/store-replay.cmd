# Past moments of a run of a store: at a step, a time, the begin of a task.
=== cook.plan
(def-const door (fluent 'shut))
(def-plan boil (what s) (sleep s) what)
(def-plan open-door () (sleep 1.5) (set-value door 'open))
(def-plan cook (what) (par (boil what 2) (seq (wait-for (fl (equal? door 'open))) (boil 'water 1))))
(def-plan main ()
  (print "begin")
  (par (open-door) (cook 'rice))
  (cook 'tea)
  (print "end"))
=== go.plan
(use world)
(use robots)
(use scenes/tableware)
(def-scene room
  "A desk with a cup."
  ,@tableware
  (a room (name walls) (from 0 0) (to 4 3))
  (a furniture (name desk) (at 3 1.5 3.14159) (box (size 0.8 1.6 0.04) (at 0 0 0.72))
    (surface (name desk_area) (at 0 0 0.74) (size 0.8 1.6)))
  (an object (name my-cup) (type cup) (on desk_area) (at 0.2 0)))
(def-plan main ()
  (use-scene room)
  (use-robot one-arm :at (pose 1 1.5 0))
  (looking (vec3 3 1.5 0.8))
  (detecting)
  (going (pose 1.3 0.8 0)))
=== commands
$ pleach run cook.plan --store a.store -q
begin
end
--- exit 0
$ pleach replay a.store 1 --to 1s
begin
--- stderr
top-level  running
└─ main  running
   ├─ par  running
   │  └─ open-door  running
   └─ par  running
      └─ cook rice  running
         ├─ par  running
         │  └─ boil rice 2  running
         └─ par  running
stopped at step 7, 1 s of the task clock
  in function wait-for at library/task.plan:57:3
  in branch par at cook.plan:4:47
tasks
  top-level / main waits for its branches
  top-level / main / par / open-door waits for a time
  top-level / main / par :call 2 / cook waits for its branches
  top-level / main / par :call 2 / cook / par / boil waits for a time
  top-level / main / par :call 2 / cook / par :call 2 waits for an expression over door, which holds shut
fluents
  door #<fluent 1> holds shut
  #<fluent 2> holds false
--- exit 0
$ pleach replay a.store 1 --to 1.5s --json
{"outcome":"stopped","file":"cook.plan","plan":"main","seed":0,"steps":8,"clock":1.5,"tree":[{"name":"top-level","path":"top-level","parent":null,"kind":"top-level","status":"running","attempt":1,"params":{},"value":"nil","start":0.0,"end":null},{"name":"main","path":"top-level / main","parent":0,"kind":"plan","status":"running","attempt":1,"params":{},"value":"nil","start":0.0,"end":null},{"name":"par","path":"top-level / main / par","parent":1,"kind":"branch","status":"succeeded","attempt":1,"params":{},"value":"open","start":0.0,"end":1.5},{"name":"open-door","path":"top-level / main / par / open-door","parent":2,"kind":"plan","status":"succeeded","attempt":1,"params":{},"value":"open","start":0.0,"end":1.5},{"name":"par","path":"top-level / main / par :call 2","parent":1,"kind":"branch","status":"running","attempt":1,"params":{},"value":"nil","start":0.0,"end":null},{"name":"cook","path":"top-level / main / par :call 2 / cook","parent":4,"kind":"plan","status":"running","attempt":1,"params":{"what":"rice"},"value":"nil","start":0.0,"end":null},{"name":"par","path":"top-level / main / par :call 2 / cook / par","parent":5,"kind":"branch","status":"running","attempt":1,"params":{},"value":"nil","start":0.0,"end":null},{"name":"boil","path":"top-level / main / par :call 2 / cook / par / boil","parent":6,"kind":"plan","status":"running","attempt":1,"params":{"what":"rice","s":"2"},"value":"nil","start":0.0,"end":null},{"name":"par","path":"top-level / main / par :call 2 / cook / par :call 2","parent":5,"kind":"branch","status":"running","attempt":1,"params":{},"value":"nil","start":0.0,"end":null},{"name":"boil","path":"top-level / main / par :call 2 / cook / par :call 2 / boil","parent":8,"kind":"plan","status":"running","attempt":1,"params":{"what":"water","s":"1"},"value":"nil","start":1.5,"end":null}],"tasks":[{"path":"top-level / main","what":"waits for its branches"},{"path":"top-level / main / par :call 2 / cook","what":"waits for its branches"},{"path":"top-level / main / par :call 2 / cook / par / boil","what":"waits for a time"},{"path":"top-level / main / par :call 2 / cook / par :call 2 / boil","what":"waits for a time"}],"fluents":[{"name":"door","fluent":"#<fluent 1>","value":"open"}],"world":null,"beliefs":null}
--- stderr
begin
--- exit 0
$ pleach replay a.store run-1 --to 'par :call 2 / boil' -q
begin
--- stderr
stopped at step 8, 1.5 s of the task clock where top-level / main / par :call 2 / cook / par :call 2 / boil begins
  in plan boil at cook.plan:2:32
  in branch par at cook.plan:4:83
--- exit 0
$ pleach replay a.store 1 --to 'cook :call 2'
begin
end
--- stderr
error: no task with a path that ends with `cook :call 2` began; it ended at 4.5 s
  help: tasks called `cook` are: top-level / main / par :call 2 / cook, top-level / main / cook
--- exit 2
$ pleach replay a.store 1 --to 'opne-door'
begin
end
--- stderr
error: no task with a path that ends with `opne-door` began; it ended at 4.5 s
  help: did you mean top-level / main / par / open-door?
--- exit 2
$ pleach replay a.store 1 --to nobody
begin
end
--- stderr
error: no task with a path that ends with `nobody` began; it ended at 4.5 s
  help: `pleach tree STORE RUN` shows which tasks there are
--- exit 2
$ pleach replay a.store 1 --to 4s -q
begin
--- stderr
stopped at step 13, 4 s of the task clock
  in plan cook at cook.plan:4:23
--- exit 0
$ pleach replay a.store 1 --to 99s
begin
end
--- stderr
error: the run did not last until 99 s: it ended at 4.5 s
  help: name an earlier time, as in --to 4.5s
--- exit 2
$ pleach replay a.store 1 --to 1.5
--- stderr
error: invalid value '1.5' for '--to <STEP|TIME|PATH>': `1.5` is no moment: a step is 3000, a time 12.5s, a task `transporting :call 2 / fetching`

For more information, try '--help'.
--- exit 2
$ pleach replay a.store 1 --to 12 2>&1 | tail -4
  top-level / main / cook / par :call 2 runs
fluents
  door #<fluent 1> holds open
  #<fluent 3> holds true
--- exit 0
$ pleach run go.plan --store a.store -q
--- exit 0
$ pleach replay a.store run-2 --to detecting 2>&1 | tail -9 | sed 's/world.plan:.*/world.plan/'
stopped at step 6, 0.268313608 s of the task clock where top-level / main / detecting begins
  in plan detecting at library/world.plan
  in plan main at go.plan:15:3
  in file top-level at the call of the plan:1:1
tasks
  top-level / main / detecting runs
world
  one-arm at (1.000 1.500 0.000), turned by 0°
  my-cup on desk_area at (2.800 1.500 0.785)
--- exit 0
$ pleach replay a.store run-2 --to 3s --json -q | grep -o '"objects".*'
"objects":[{"name":"my-cup","type":"cup","on":"desk_area","pose":[2.8,1.500001,0.785,0.0,0.0,1.0,1e-6]}],"containers":{},"motions":[{"motion":"going","begin":1.268314,"lasts":4.437916}]},"beliefs":{"seen":[{"name":"my-cup","at":1.268314,"pose":[2.795277,1.502247,0.785928,0.0,0.0,0.999991,-0.004163]}],"open":{}}}
--- exit 0
