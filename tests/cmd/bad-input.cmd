# Files and options that cannot be: what, where, why, what next; exit code 2.

=== good.plan
(def-plan main () 1)

=== folder/nothing.txt
no plan

=== commands
$ pleach run godo.plan
--- stderr
error: cannot read godo.plan: there is no such file
  help: did you mean ./good.plan?
--- exit 2
$ pleach run folder
--- stderr
error: cannot read folder: it is a folder
  help: name a file in it
--- exit 2
$ pleach check folder
--- stderr
error: there is no plan file in the folder folder
  help: plan files end in .plan
--- exit 2
$ pleach run good.plan/x
--- stderr
error: cannot read good.plan/x: a part of its path is no folder
  help: check the name, and the folder that you are in
--- exit 2
$ printf 'ab\nc\377d' > latin.plan; pleach run latin.plan
--- stderr
error: cannot read latin.plan: it is no UTF-8 text; the first wrong byte is number 4, in line 2
  help: plan files are UTF-8 text: is it another kind of file, or saved with another encoding?
--- exit 2
$ head -c 100000000 /dev/zero > large.plan; pleach check large.plan
--- stderr
error: cannot read large.plan: it has 100000000 bytes, more than 67108864
  help: split it into modules, and put data into files of their own
1 error, 0 warnings
--- exit 2
$ pleach run /dev/zero
--- stderr
error: cannot read /dev/zero: it has more than 67108864 bytes
  help: split it into modules, and put data into files of their own
--- exit 2
$ pleach run good.plan --nothing
--- stderr
error: unexpected argument '--nothing' found

  tip: to pass '--nothing' as a value, use '-- --nothing'

Usage: pleach run <FILE>

For more information, try '--help'.
--- exit 2
$ pleach run good.plan --memory 12X
--- stderr
error: invalid value '12X' for '--memory <BYTES>': `12X` is no number of bytes, as in 1000, 64K, 512M, 2G

For more information, try '--help'.
--- exit 2
$ pleach run good.plan --allow everything
--- stderr
error: --allow everything: `everything` is no grant; there are: read=DIR, write=DIR, clock
  help: for example: --allow read=data
--- exit 2
$ pleach run good.plan --allow read=nowhere
--- stderr
error: --allow read=nowhere: there is no nowhere
  help: create the folder first, or name one that is there
--- exit 2
$ pleach run good.plan --seed x
--- stderr
error: invalid value 'x' for '--seed <N>': `x` is no number from 0 to 18446744073709551615

For more information, try '--help'.
--- exit 2
$ pleach nothing 2>&1 | head -2
error: unrecognized subcommand 'nothing'

--- exit 0
$ pleach explain typ-error
--- stderr
error: there is no error code `typ-error`
  help: did you mean `type-error`? `pleach explain` lists all codes
--- exit 2
$ pleach doc dolits
--- stderr
error: nothing is called `dolits`
  help: did you mean `dolist`?
--- exit 2
$ pleach fmt - < latin.plan
--- stderr
error: cannot read stdin: stream did not contain valid UTF-8
  help: what is to be formatted must be UTF-8 text
--- exit 2
$ pleach run good.plan > /dev/full
--- stderr
top-level  succeeded → 1
└─ main  succeeded → 1
--- exit 0
$ pleach replay good.plan
--- stderr
error: [FOLDER]/good.plan is not the log of a run
  help: logs are written by `pleach run FILE --log LOG`
--- exit 2
$ pleach resume nothing.log
--- stderr
error: cannot read the log nothing.log: there is no such file
--- exit 2
$ printf '(first 5' | pleach repl
> (first 5
parse::unclosed

  × `(` is never closed
   ╭─[input 1:1:1]
 1 │ (first 5
   · ┬
   · ╰── opened here
   ╰────
  help: the missing end is `)`
--- exit 0
$ printf '\377\n:type\n' | pleach repl
> �
parse::character

  × `\u{fffd}` cannot stand here
   ╭─[input 1:1:1]
 1 │ �
   · ┬
   · ╰── here
   ╰────
  help: delete it; in a string it is written by its number, such as `\u{1b}`
> :type
error: :type needs something: :type FORM
--- exit 0
$ pleach repl nothing.plan < /dev/null
--- stderr
error: cannot read nothing.plan: there is no such file
  help: check the name, and the folder that you are in
--- exit 2
$ pleach fmt
--- stderr
error: the following required arguments were not provided:
  <FILE|FOLDER|->...

Usage: pleach fmt <FILE|FOLDER|->...

For more information, try '--help'.
--- exit 2
$ pleach
--- stderr
A language for robot plans that can rewrite themselves

Usage: pleach <COMMAND>

Commands:
  run        Run a plan file, then show the tree of its tasks
  resume     Go on with a run that was stopped or killed, from its log or a store
  replay     Run again from a log or a store, as far as a moment, and show that moment
  query      Ask the rules of a file, over its facts and over task trees
  tree       Look at the trees of a store: list, show, compare
  transform  Rehearse a plan, and rewrite it where that pays
  evaluate   Run experiments: variants of a plan under many seeds, compared
  store      Check, export, import and empty stores
  repl       Try forms by hand
  check      Say all that is wrong with files, without running them
  fmt        Lay files out
  test       Run the tests in files: their `(def-test name …)`
  explain    Explain an error code or a type of failures
  doc        What a name means: special forms, functions, plans, modules, failures
  help       Print this message or the help of the given subcommand(s)

Options:
  -h, --help     Print help
  -V, --version  Print version

First steps:
  Write a file hello.plan:
      (def-plan greet (name) (print "hello," name))
      (def-plan main () (greet 'Ada) (greet 'Grace))

  pleach run hello.plan         what it prints, then the tree of its tasks
  pleach check hello.plan       all that is wrong with it, without running it
  pleach repl hello.plan        try its plans by hand
  pleach query hello.plan --run '(task-name ?task greet)' --all
                                what its rules find, here in the tree of a run
  pleach doc with-failure-handling
                                what a word of the language or of the library means

Exit codes: 0 all is well · 1 the plan, a test or a check failed · 2 errors in the program or in
the call · 130 stopped by Ctrl-C. NO_COLOR switches colours off.
--- exit 2
