# Pages about codes and names.

=== my.plan
(module mine "My plans.")
(def-failure spilled () (what) "Something is on the floor.")
(def-plan pour (what &optional (where 'cup))
  "Pours WHAT into WHERE."
  (list what where))

=== commands
$ pleach explain parse::unclosed | head -3
# parse::unclosed: a bracket is never closed

The text ends, or a new definition starts at the left margin, while a bracket is still open.
--- exit 0
$ pleach explain type-error | head -1
# failure::type-error: a value of the wrong kind
--- exit 0
$ pleach explain | head -3
parse::unclosed               a bracket is never closed
parse::unclosed_string        a string is never closed
parse::unclosed_symbol        a name in bars is never closed
--- exit 0
$ pleach doc dolist
(dolist (name list) body…)
  a special form
  The body for each element of a list, vector, map or string.
--- exit 0
$ pleach doc pursue
(pursue form …)
  a special form
  All forms at once, as tasks. Ends as the first one does, and stops the others. `(:tag name form)` names a task.
--- exit 0
$ pleach doc with-task-suspended | head -1
(with-task-suspended (task) &rest body)
--- exit 0
$ pleach doc first
(first items)
  a function of the module list
  The first element of a list or stream; nil of an empty one.
  ex: (first '(1 2 3)) => 1
  ex: (first (query (member ?x (a b)))) => {?x a}
  ex: (first nil) => nil
  ex! (first 5) => type-error
--- exit 0
$ pleach doc type-error
type-error
  a type of failures, below program-error, failure
  A value of the wrong kind.
  fields: message expected value
--- exit 0
$ pleach doc pour my.plan
(pour what &optional where)
  a plan, defined at my.plan:3:11
  Pours WHAT into WHERE.
--- exit 0
$ pleach doc spilled my.plan
spilled
  a type of failures, below plan-failure, failure
  Something is on the floor.
  fields: message what
--- exit 0
$ pleach doc mine my.plan
module mine
  My plans.
  (pour what &optional where)        Pours WHAT into WHERE
  spilled                            Something is on the floor
--- exit 0
$ pleach doc nothing-like-this
--- stderr
error: nothing is called `nothing-like-this`
  help: `pleach doc` lists modules and special forms; `pleach doc MODULE` lists the names of a module
--- exit 2
