# Layout: in place, checked, from stdin; files with mistakes are left alone.

=== a.plan
(def-plan   main()
(print   1))

=== sub/b.plan
(def-plan main () 1)

=== broken.plan
(def-plan   main (

=== commands
$ chmod 640 a.plan; pleach fmt --check a.plan sub
a.plan
sub/b.plan
--- exit 1
$ pleach fmt a.plan sub broken.plan
--- stderr
parse::unclosed

  × `(` is never closed
   ╭─[broken.plan:1:18]
 1 │ (def-plan   main (
   ·                  ┬
   ·                  ╰── opened here
 2 │ 
   ╰────
  help: the missing end is `))`
--- exit 2
$ cat a.plan; stat -c %a a.plan; cat broken.plan
(def-plan main ()
  (print 1))
640
(def-plan   main (

--- exit 0
$ pleach fmt --check a.plan sub
--- exit 0
$ echo '(a    b)' | pleach fmt -
(a b)
--- exit 0
$ echo '(a    b)' | pleach fmt --stdin --check
--- exit 1
$ ln -s a.plan link.plan; echo '(x   y)' > a.plan; pleach fmt link.plan; cat a.plan; test -L link.plan
(x y)
--- exit 0
$ ls -A | wc -l
4
--- exit 0
