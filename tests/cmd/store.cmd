# Stores: kept runs, trees with versions, what is said of wrong files.
=== wash.plan
(def-plan wash (x) (if (eq x 'knife) (fail plan-failure :message "sharp") x))
(def-plan main ()
  (dolist (x '(cup plate knife))
    (with-failure-handling ((plan-failure (e) (return nil))) (wash x))))
=== commands
$ pleach run wash.plan --store a.store -q
--- exit 0
$ pleach run wash.plan --store a.store --tree kitchen -q
--- exit 0
$ sed -i 's/cup plate/cup/' wash.plan
--- exit 0
$ pleach run wash.plan --store a.store --tree kitchen -q
--- exit 0
$ pleach tree a.store
  run  tree                     outcome          nodes  edits  file
    1  run-1@1                  succeeded            5      0  wash.plan main
    2  kitchen@1                succeeded            5      0  wash.plan main
    3  kitchen@2                succeeded            4      0  wash.plan main
--- exit 0
$ pleach tree a.store kitchen
top-level  succeeded
└─ main  succeeded
   ├─ wash cup  succeeded → cup
   └─ wash knife  failed: plan-failure
--- exit 0
$ pleach tree a.store kitchen --path wash[*]
wash cup  succeeded → cup
wash knife  failed: plan-failure
--- exit 0
$ pleach tree a.store kitchen --path nothing
--- stderr
error: no task of the tree has a path that ends with `nothing`
--- exit 2
$ pleach tree a.store --diff kitchen@1 kitchen@2
~ top-level / main / wash :call 2  status succeeded → failed, params {"x":"plate"} → {"x":"knife"}, value plate, failure {"type":"plan-failure","fields":{"message":"\"sharp\""},"tas …
- top-level / main / wash :call 3  status failed
--- exit 1
$ pleach tree a.store kitchen --dot
digraph tree {
  node [shape=box, style=filled, fontname="sans-serif"];
  n0 [label="top-level\nsucceeded", fillcolor="#d5f0d5"];
  n1 [label="main\nsucceeded", fillcolor="#d5f0d5"];
  n0 -> n1;
  n2 [label="wash\nsucceeded → cup", fillcolor="#d5f0d5"];
  n1 -> n2;
  n3 [label="wash\nfailed: plan-failure", fillcolor="#f5c8c8"];
  n1 -> n3;
}
--- exit 0
$ pleach tree a.store kitchn
--- stderr
error: there is no tree `kitchn` in the store a.store
  help: its trees are: run-1 kitchen
--- exit 2
$ pleach query a.store '(task-status ?task failed)' --each --all
% run-1@1
?task = (path main (wash :call 3))
% kitchen@1
?task = (path main (wash :call 3))
% kitchen@2
?task = (path main (wash :call 2))
--- exit 0
$ pleach query a.store '(task-status ?task failed)' --stored kitchen@1
?task = (path main (wash :call 3))
--- exit 0
$ pleach query wash.plan '(task-status ?task failed)' --stored kitchen@1
--- stderr
error: --stored is about a store, and there is none
  help: name a store in the place of the file, or after --tree
--- exit 2
$ pleach store check a.store
run-1@1: whole, 5 nodes, 0 entries in its log
kitchen@1: whole, 5 nodes, 0 entries in its log
kitchen@2: whole, 4 nodes, 0 entries in its log
--- exit 0
$ pleach store export a.store trees.json
--- stderr
3 versions in trees.json
--- exit 0
$ pleach store export a.store trees.json
--- stderr
error: trees.json is there already, and is not overwritten
  help: choose another name
--- exit 2
$ pleach store import b.store trees.json
run-1@1
kitchen@1
kitchen@2
--- exit 0
$ pleach tree b.store
  run  tree                     outcome          nodes  edits  file
    1  run-1@1                  succeeded            5      0  wash.plan main
    2  kitchen@1                succeeded            5      0  wash.plan main
    3  kitchen@2                succeeded            4      0  wash.plan main
--- exit 0
$ pleach store gc a.store --keep 1
0 versions forgotten, 3 left
--- exit 0
$ pleach tree a.store
  run  tree                     outcome          nodes  edits  file
    1  run-1@1                  succeeded            5      0  wash.plan main
    2  kitchen@1                succeeded            5      0  wash.plan main
    3  kitchen@2                succeeded            4      0  wash.plan main
--- exit 0
$ pleach run wash.plan --store c.store --stop-at 3 -q
--- stderr
stopped at step 3, 0 s of the task clock
  in plan main at wash.plan:4:62
  in file top-level at the call of the plan:1:1
go on with: pleach resume c.store 1
--- exit 0
$ pleach resume c.store
--- stderr
top-level  succeeded
└─ main  succeeded
   ├─ wash cup  succeeded → cup
   └─ wash knife  failed: plan-failure
--- exit 0
$ pleach resume c.store
--- stderr
error: all runs in the store [FOLDER]/c.store have ended
  help: `pleach replay STORE RUN` runs one again; `pleach tree STORE` lists them
--- exit 2
$ pleach replay c.store 1 -q
--- exit 0
$ pleach run wash.plan --tree kitchen
--- stderr
error: the following required arguments were not provided:
  --store <FILE>

Usage: pleach run --store <FILE> --tree <NAME> <FILE>

For more information, try '--help'.
--- exit 2
$ pleach run wash.plan --store c.store --tree 7
--- stderr
error: invalid value '7' for '--tree <NAME>': a tree has a name that is no number and has no `@` in it

For more information, try '--help'.
--- exit 2
$ pleach run wash.plan --store wash.plan
--- stderr
error: wash.plan is no store: it is another kind of file
  help: name a store, or a file that is not there yet: `pleach run FILE --store STORE` makes it
--- exit 2
$ pleach run wash.plan --store no/folder.store
--- stderr
error: cannot write the store no/folder.store: its folder is not there
--- exit 2
$ pleach tree none.store
--- stderr
error: cannot read the store none.store: there is no such file
--- exit 2
