# Each limit ends in a failure of its own.

=== loop.plan
(def-plan main () (loop nil))

=== deep.plan
(def-fun down (n) (+ 1 (down n)))
(def-plan main () (down 1))

=== wide.plan
(def-plan leaf (i) i)
(def-plan main () (dotimes (i 2000) (leaf i)))

=== loud.plan
(def-plan main () (loop (write-string "0123456789")))

=== commands
$ pleach run loop.plan --fuel 10_000
--- stderr
top-level  failed: fuel-exhausted  [0 – 0.009 s]
└─ main  failed: fuel-exhausted  [0 – 0.009 s]
  × fuel-exhausted: the run used up its fuel of 10000 calls and backward jumps
  │ in top-level / main
  │ limit: 10000
   ╭─[loop.plan:1:19]
 1 │ (def-plan main () (loop nil))
   ·                   ─────┬────
   ·                        ╰── failed here
   ╰────
--- exit 1
$ pleach run deep.plan --depth 1000 --quiet
--- stderr
  × too-deep: calls are nested deeper than 1000 calls
  │ in top-level / main
  │ limit: 1000
   ╭─[deep.plan:1:24]
 1 │ (def-fun down (n) (+ 1 (down n)))
   ·                        ────┬───
   ·                            ╰── failed here
 2 │ (def-plan main () (down 1))
   ╰────
--- exit 1
$ pleach run wide.plan --nodes 1000 --quiet
--- stderr
  × tree-too-large: the tree has more than 1000 nodes
  │ in top-level / main
  │ limit: 1000
   ╭─[wide.plan:2:19]
 1 │ (def-plan leaf (i) i)
 2 │ (def-plan main () (dotimes (i 2000) (leaf i)))
   ·                   ─────────────┬─────────────
   ·                                ╰── failed here
   ╰────
--- exit 1
$ pleach run loud.plan --output-limit 1K --quiet | wc -c
1020
--- stderr
  × output-too-large: the program printed more than 1024 bytes
  │ in top-level / main
  │ limit: 1024
   ╭─[loud.plan:1:25]
 1 │ (def-plan main () (loop (write-string "0123456789")))
   ·                         ─────────────┬─────────────
   ·                                      ╰── failed here
 2 │ 
   ╰────
--- exit 0
$ pleach run wide.plan 2>&1 | tail -2
   ├─ leaf 497  succeeded → 497
… and more: 2002 nodes in all; --all shows them
--- exit 0
$ pleach run wide.plan --all 2>&1 | wc -l
2002
--- exit 0
$ pleach run loud.plan --quiet | head -c 25
0123456789012345678901234⏎
--- exit 0
