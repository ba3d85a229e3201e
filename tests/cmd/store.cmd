# Stores: kept runs, trees with versions, what is said of wrong files.
=== wash.plan
(def-plan wash (x) (if (eq x 'knife) (fail plan-failure :message "sharp") x))
(def-plan main ()
  (dolist (x '(cup plate knife))
    (with-failure-handling ((plan-failure (e) (return nil))) (wash x))))
=== commands
$ pleach run wash.plan --store a.store -q
$ pleach run wash.plan --store a.store --tree kitchen -q
$ sed -i 's/cup plate/cup/' wash.plan
$ pleach run wash.plan --store a.store --tree kitchen -q
$ pleach tree a.store
$ pleach tree a.store kitchen
$ pleach tree a.store kitchen --path wash[*]
$ pleach tree a.store kitchen --path nothing
$ pleach tree a.store --diff kitchen@1 kitchen@2
$ pleach tree a.store kitchen --dot
$ pleach tree a.store kitchn
$ pleach query a.store '(task-status ?task failed)' --each --all
$ pleach query a.store '(task-status ?task failed)' --stored kitchen@1
$ pleach query wash.plan '(task-status ?task failed)' --stored kitchen@1
$ pleach store check a.store
$ pleach store export a.store trees.json
$ pleach store export a.store trees.json
$ pleach store import b.store trees.json
$ pleach tree b.store
$ pleach store gc a.store --keep 1
$ pleach tree a.store
$ pleach run wash.plan --store c.store --stop-at 3 -q
$ pleach resume c.store
$ pleach resume c.store
$ pleach replay c.store 1 -q
$ pleach run wash.plan --tree kitchen
$ pleach run wash.plan --store c.store --tree 7
$ pleach run wash.plan --store wash.plan
$ pleach run wash.plan --store no/folder.store
$ pleach tree none.store
