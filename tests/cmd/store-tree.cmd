# Trees of a store: as they were at a time, how long tasks took, as a page.
=== cook.plan
(def-plan boil (what s) (sleep s) what)
(def-plan wash (what) (sleep 0.25) (fail plan-failure :message "no water"))
(def-plan cook (what)
  (par (boil what 2) (boil 'water 3.5))
  (with-failure-handling ((plan-failure (e) (return nil))) (wash what)))
(def-plan main () (cook 'rice) (cook "</script><img src=x onerror=alert(1)>"))
=== commands
$ pleach run cook.plan --store a.store -q
--- exit 0
$ pleach tree a.store run-1
top-level  succeeded  [0 – 7.5 s, 7.5 s]
└─ main  succeeded  [0 – 7.5 s, 7.5 s]
   ├─ cook rice  succeeded  [0 – 3.75 s, 3.75 s]
   │  ├─ par  succeeded → rice  [0 – 2 s, 2 s]
   │  │  └─ boil rice 2  succeeded → rice  [0 – 2 s, 2 s]
   │  ├─ par  succeeded → water  [0 – 3.5 s, 3.5 s]
   │  │  └─ boil water 3.5  succeeded → water  [0 – 3.5 s, 3.5 s]
   │  └─ wash rice  failed: plan-failure  [3.5 – 3.75 s, 0.25 s]
   └─ cook "</script><img src=x onerror=alert(1)>"  succeeded  [3.75 – 7.5 s, 3.75 s]
      ├─ par  succeeded → "</script><img src=x onerror=alert(1)>"  [3.75 – 5.75 s, 2 s]
      │  └─ boil "</script><img src=x onerror=alert(1)>" 2  succeeded → "</script><img src=x onerror=alert(1)>"  [3.75 – 5.75 s, 2 s]
      ├─ par  succeeded → water  [3.75 – 7.25 s, 3.5 s]
      │  └─ boil water 3.5  succeeded → water  [3.75 – 7.25 s, 3.5 s]
      └─ wash "</script><img src=x onerror=alert(1)>"  failed: plan-failure  [7.25 – 7.5 s, 0.25 s]
--- exit 0
$ pleach tree a.store run-1 --at 0
top-level  running  [since 0 s]
└─ main  running  [since 0 s]
   └─ cook rice  running  [since 0 s]
      ├─ par  running  [since 0 s]
      │  └─ boil rice 2  running  [since 0 s]
      └─ par  running  [since 0 s]
         └─ boil water 3.5  running  [since 0 s]
--- exit 0
$ pleach tree a.store run-1 --at 2.5s
top-level  running  [since 0 s]
└─ main  running  [since 0 s]
   └─ cook rice  running  [since 0 s]
      ├─ par  succeeded → rice  [0 – 2 s, 2 s]
      │  └─ boil rice 2  succeeded → rice  [0 – 2 s, 2 s]
      └─ par  running  [since 0 s]
         └─ boil water 3.5  running  [since 0 s]
--- exit 0
$ pleach tree a.store run-1 --at 3.75
top-level  running  [since 0 s]
└─ main  running  [since 0 s]
   ├─ cook rice  succeeded  [0 – 3.75 s, 3.75 s]
   │  ├─ par  succeeded → rice  [0 – 2 s, 2 s]
   │  │  └─ boil rice 2  succeeded → rice  [0 – 2 s, 2 s]
   │  ├─ par  succeeded → water  [0 – 3.5 s, 3.5 s]
   │  │  └─ boil water 3.5  succeeded → water  [0 – 3.5 s, 3.5 s]
   │  └─ wash rice  failed: plan-failure  [3.5 – 3.75 s, 0.25 s]
   └─ cook "</script><img src=x onerror=alert(1)>"  running  [since 3.75 s]
      ├─ par  running  [since 3.75 s]
      │  └─ boil "</script><img src=x onerror=alert(1)>" 2  running  [since 3.75 s]
      └─ par  running  [since 3.75 s]
         └─ boil water 3.5  running  [since 3.75 s]
--- exit 0
$ pleach tree a.store run-1 --at 3.74 --path wash
wash rice  running  [since 3.5 s]
--- exit 0
$ pleach tree a.store run-1 --at 3 --path 'par :call 2' --json
{"tree":[{"name":"par","path":"top-level / main / cook / par :call 2","parent":null,"kind":"branch","status":"running","attempt":1,"params":{},"value":"nil","start":0.0,"end":null},{"name":"boil","path":"top-level / main / cook / par :call 2 / boil","parent":0,"kind":"plan","status":"running","attempt":1,"params":{"what":"water","s":"3.5"},"value":"nil","start":0.0,"end":null}]}
--- exit 0
$ pleach tree a.store run-1 --at 3.6 --path cook --dot
digraph tree {
  node [shape=box, style=filled, fontname="sans-serif"];
  n0 [label="cook\nrunning", fillcolor="#d0e4f5"];
  n1 [label="par\nsucceeded → rice", fillcolor="#d5f0d5"];
  n0 -> n1;
  n2 [label="boil\nsucceeded → rice", fillcolor="#d5f0d5"];
  n1 -> n2;
  n3 [label="par\nsucceeded → water", fillcolor="#d5f0d5"];
  n0 -> n3;
  n4 [label="boil\nsucceeded → water", fillcolor="#d5f0d5"];
  n3 -> n4;
  n5 [label="wash\nrunning", fillcolor="#d0e4f5"];
  n0 -> n5;
}
--- exit 0
$ pleach tree a.store run-1 --at 99 --path main | head -1
main  succeeded  [0 – 7.5 s, 7.5 s]
--- stderr
note: the last task began or ended at 7.5 s
--- exit 0
$ pleach tree a.store run-1 --at -1
--- stderr
error: unexpected argument '-1' found

  tip: to pass '-1' as a value, use '-- -1'

Usage: pleach tree [OPTIONS] <STORE> [NAME]

For more information, try '--help'.
--- exit 2
$ pleach tree a.store run-1 --at soon
--- stderr
error: invalid value 'soon' for '--at <TIME>': `soon` is no time: seconds of the task clock, as in 12.5 or 12.5s

For more information, try '--help'.
--- exit 2
$ pleach tree a.store --at 3
--- stderr
error: the following required arguments were not provided:
  <NAME>

Usage: pleach tree --at <TIME> <STORE> <NAME>

For more information, try '--help'.
--- exit 2
$ pleach tree a.store run-1 --html > a.html; grep -c '<script' a.html; grep -c '<img' a.html; grep -o '"name":"main"[^}]*}' a.html; grep -o 'u003c/script.u003e' a.html | sort | uniq -c | sed 's/^ *//'
2
0
"name":"main","path":"top-level / main","parent":0,"kind":"plan","status":"succeeded","attempt":1,"params":{}
5 u003c/script\u003e
--- exit 0
$ pleach tree a.store run-1 --html --at 2.5 | grep '<title>'
<title>run-1@1 at 2.5 s</title>
--- exit 0
$ pleach tree a.store run-1 --html --json
--- stderr
error: the argument '--html' cannot be used with '--json'

Usage: pleach tree --html <STORE> <NAME>

For more information, try '--help'.
--- exit 2
