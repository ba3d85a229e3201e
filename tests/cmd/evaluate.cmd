# Experiments from the command line: tables, folders, parts, and what is said about mistakes.
=== day.plan
(use experiment)
(use transformation)
(def-failure slept)
(def-plan yawn () (sleep 2))
(def-plan work (k)
  (sleep (+ k (random 3)))
  (when (= 0 (random 12)) (fail slept :message "it fell asleep")))
(def-plan day (tasks) (dolist (k (iota tasks)) (yawn) (work k)))
(def-transformation lively
  "No yawns."
  :applicable (task-name ?yawn yawn)
  :rewrite (list (skip ?yawn)))
(def-transformation diligent
  "Everything twice, which does not pay."
  :applicable (task-name ?work work)
  :rewrite (list (before ?work '(sleep 3))))
(def-experiment yawning
  "What yawning costs."
  :plan (day tasks)
  :factors ((tasks 2 4))
  :variants (none lively diligent)
  :runs 10
  :measures ((per-task (/ (tree-end tree) tasks))))
(def-experiment short
  "A plan by hand."
  :plan (day 3)
  :variants (none (half :plan (day 1)))
  :runs 5
  :goal (< (tree-end tree) 11))
=== plain.plan
(use transformation)
(def-plan main () (sleep (random 5)))
=== text.plan
(use experiment)
(def-plan main () 1)
(def-experiment text "A measure that is none." :plan (main) :measures ((mood "good")))
=== twice.plan
(use experiment)
(def-plan main () 1)
(def-experiment one "One." :plan (main))
(def-experiment one "Two." :plan (main))
=== wrong.plan
(use experiment)
(def-plan main () 1)
(def-experiment one "One." :plan main)
(def-experiment two "Two." :plan (main) :run 5)
(def-experiment three "Three." :plan (main) :factors ((seed 1 2)))
(def-experiment four "Four." :plan (main) :variants (none (both tray)))
(def-experiment five :plan (main))
=== commands
$ pleach evaluate day.plan --list
yawning  What yawning costs.
    day · 2 cases · 10 runs of none, lively, diligent
short  A plan by hand.
    day · 1 case · 5 runs of none, half
--- exit 0
$ pleach evaluate day.plan
yawning: What yawning costs.
plan day · 10 runs of each variant, seeds 1 to 10

tasks 2
            mean          95 %   median  against none           95 %       p  where both succeed
success
  none    90.0 %   59.6 – 98.2  9 of 10
  lively  90.0 %   59.6 – 98.2  9 of 10    0.0 points  −27.8 – +27.8   1.000
seconds
  none      6.80   5.34 – 8.26     7.50
  lively    3.00   1.88 – 4.12     3.50       −55.9 %  −62.5 – −49.2  <0.001  −54.5 % of 9 pairs
failures
  none      0.10  −0.13 – 0.33     0.00
  lively    0.10  −0.13 – 0.33     0.00         0.0 %      0.0 – 0.0   1.000     0.00 of 9 pairs
per-task
  none      3.40   2.67 – 4.13     3.75
  lively    1.50   0.94 – 2.06     1.75       −55.9 %  −62.5 – −49.2  <0.001  −54.5 % of 9 pairs
  none failed once: it fell asleep
  lively failed once: it fell asleep
  diligent runs as none: diligent was refused (projected): it does not pay under these seeds

tasks 4
            mean           95 %   median  against none           95 %       p  where both succeed
success
  none    70.0 %    39.7 – 89.2  7 of 10
  lively  70.0 %    39.7 – 89.2  7 of 10    0.0 points  −20.0 – +20.0   1.000
seconds
  none     17.30  13.35 – 21.25    19.00
  lively    9.90   7.26 – 12.54    11.00       −42.8 %  −50.6 – −34.9  <0.001  −40.9 % of 7 pairs
failures
  none      0.30   −0.05 – 0.65     0.00
  lively    0.30   −0.05 – 0.65     0.00         0.0 %      0.0 – 0.0   1.000     0.00 of 7 pairs
per-task
  none      4.33    3.34 – 5.31     4.75
  lively    2.48    1.81 – 3.14     2.75       −42.8 %  −50.6 – −34.9  <0.001  −40.9 % of 7 pairs
  none failed 3 times: it fell asleep
  lively failed 3 times: it fell asleep
  diligent runs as none: diligent was refused (projected): it does not pay under these seeds

p: Student's paired test; of success McNemar's exact one. --json and the report have Welch's, Wilcoxon's and Fisher's tests,
corrections for many tests, and effect sizes.

short: A plan by hand.
plan day · 5 runs of each variant, seeds 1 to 5
            mean          95 %  median  against none            95 %      p  where both succeed
success
  none     0.0 %    0.0 – 43.4  0 of 5
  half    80.0 %   37.6 – 96.4  4 of 5  +80.0 points   +19.3 – +96.4  0.125
seconds
  none     11.00  4.67 – 17.33   13.00
  half      2.60   1.49 – 3.71    2.00       −76.4 %  −129.7 – −23.1  0.016
failures
  none      0.20  −0.36 – 0.76    0.00
  half      0.20  −0.36 – 0.76    0.00         0.0 %       0.0 – 0.0  1.000
  none failed 4 times: it has ended, and the goal does not hold
  none failed once: it fell asleep
  half failed once: it fell asleep

p: Student's paired test; of success McNemar's exact one. --json and the report have Welch's, Wilcoxon's and Fisher's tests,
corrections for many tests, and effect sizes.

--- exit 0
$ pleach evaluate day.plan short --json | tr ',' '\n' | grep -c '"median"'
24
--- exit 0
$ pleach evaluate day.plan --plan day --arg 3 --variants none,lively+diligent --accept static --runs 4 --jobs 2
day
plan day · 4 runs of each variant, seeds 1 to 4
                     mean          95 %  median  against none           95 %      p  where both succeed
success
  none             75.0 %   30.1 – 95.4  3 of 4
  lively+diligent  75.0 %   30.1 – 95.4  3 of 4    0.0 points  −42.7 – +42.7  1.000
seconds
  none              10.25  1.40 – 19.10   12.50
  lively+diligent   12.75  2.33 – 23.17   15.50       +24.4 %   +8.9 – +39.9  0.015  +23.1 % of 3 pairs
failures
  none               0.25  −0.55 – 1.05    0.00
  lively+diligent    0.25  −0.55 – 1.05    0.00         0.0 %      0.0 – 0.0  1.000     0.00 of 3 pairs
  none failed once: it fell asleep
  lively+diligent failed once: it fell asleep

p: Student's paired test; of success McNemar's exact one. --json and the report have Welch's, Wilcoxon's and Fisher's tests,
corrections for many tests, and effect sizes.

--- exit 0
$ pleach evaluate plain.plan --runs 2
main
plan main · 2 runs of each variant, seeds 1 to 2
            mean            95 %  median
success
  none   100.0 %    34.2 – 100.0  2 of 2
seconds
  none      2.00  −23.41 – 27.41    2.00

p: Student's paired test; of success McNemar's exact one. --json and the report have Welch's, Wilcoxon's and Fisher's tests,
corrections for many tests, and effect sizes.

--- exit 0
$ pleach evaluate plain.plan --plan main --runs 1
main
plan main · one run, seed 1
            mean          95 %  median
success
  none   100.0 %  20.7 – 100.0  1 of 1

p: Student's paired test; of success McNemar's exact one. --json and the report have Welch's, Wilcoxon's and Fisher's tests,
corrections for many tests, and effect sizes.

--- exit 0
$ pleach evaluate plain.plan --plan main --rules household --variants none,both-hands --runs 2
main
plan main · 2 runs of each variant, seeds 1 to 2
            mean            95 %  median  against none  95 %  p  where both succeed
success
  none   100.0 %    34.2 – 100.0  2 of 2
seconds
  none      2.00  −23.41 – 27.41    2.00
  both-hands runs as none: no transformation applies

p: Student's paired test; of success McNemar's exact one. --json and the report have Welch's, Wilcoxon's and Fisher's tests,
corrections for many tests, and effect sizes.

--- exit 0
$ pleach evaluate plain.plan --plan main --variants none,tray --runs 2
--- stderr
error: there is no transformation tray, for none is loaded; those of the library are by (use household)
--- exit 2
$ pleach evaluate day.plan shot
--- stderr
error: the file has no experiment called `shot`
  help: did you mean `short`?
--- exit 2
$ pleach evaluate day.plan --plan dya
--- stderr
error: the program has no plan called `dya`
  help: did you mean `day`?
--- exit 2
$ pleach evaluate nowhere.plan
--- stderr
error: cannot read nowhere.plan: there is no such file
--- exit 2
$ pleach evaluate text.plan
--- stderr
error: the run of none under seed 1 could not be measured: the measure mood of text gave "good"; it should be a number, or nil if there is none
--- exit 2
$ pleach evaluate twice.plan
--- stderr
error: there are two experiments one; give one of them another name
--- exit 2
$ pleach check wrong.plan
--- stderr
expand::failed

  × the macro `experiment` failed: the experiment one has the plan main; it should be a call, as
  │ in `:plan (set-table 3)` (program-error)
   ╭─[wrong.plan:3:1]
 2 │ (def-plan main () 1)
 3 │ (def-experiment one "One." :plan main)
   · ───────────────────┬──────────────────
   ·                    ╰── expanded here
 4 │ (def-experiment two "Two." :plan (main) :run 5)
   ╰────
expand::failed

  × the macro `experiment` failed: the experiment two says :run; it may
  │ say :plan :factors :variants :runs :seed :accept :seeds :goal :measures (program-error)
   ╭─[wrong.plan:4:1]
 3 │ (def-experiment one "One." :plan main)
 4 │ (def-experiment two "Two." :plan (main) :run 5)
   · ───────────────────────┬───────────────────────
   ·                        ╰── expanded here
 5 │ (def-experiment three "Three." :plan (main) :factors ((seed 1 2)))
   ╰────
expand::failed

  × the macro `experiment` failed: the experiment three calls something seed, which is a column
  │ already (program-error)
   ╭─[wrong.plan:5:1]
 4 │ (def-experiment two "Two." :plan (main) :run 5)
 5 │ (def-experiment three "Three." :plan (main) :factors ((seed 1 2)))
   · ─────────────────────────────────┬────────────────────────────────
   ·                                  ╰── expanded here
 6 │ (def-experiment four "Four." :plan (main) :variants (none (both tray)))
   ╰────
expand::failed

  × the macro `experiment` failed: the experiment four says (both tray) in :variants; it should be
  │ `none`, `all`, the name of a transformation, or (name :only (…) :plan (…) :accept …) (program-
  │ error)
   ╭─[wrong.plan:6:1]
 5 │ (def-experiment three "Three." :plan (main) :factors ((seed 1 2)))
 6 │ (def-experiment four "Four." :plan (main) :variants (none (both tray)))
   · ───────────────────────────────────┬───────────────────────────────────
   ·                                    ╰── expanded here
 7 │ (def-experiment five :plan (main))
   ╰────
expand::failed

  × the macro `experiment` failed: the experiment five says nothing about itself: a text stands
  │ behind its name (program-error)
   ╭─[wrong.plan:7:1]
 6 │ (def-experiment four "Four." :plan (main) :variants (none (both tray)))
 7 │ (def-experiment five :plan (main))
   · ─────────────────┬────────────────
   ·                  ╰── expanded here
   ╰────
5 errors, 0 warnings
--- exit 2
$ pleach evaluate wrong.plan 2>&1 | head -3
error: expand::failed

  × the macro `experiment` failed: the experiment one has the plan main; it should be a call, as
--- exit 0
$ pleach evaluate day.plan yawning --out r --quiet --runs 6 && ls r/yawning
evaluation.json
evaluation.lock
failures-by-tasks.svg
failures.svg
per-task-by-tasks.svg
per-task.svg
report.html
runs.csv
seconds-by-tasks.svg
seconds.svg
summary.json
variants.store
variants.store-writer
--- exit 0
$ pleach evaluate day.plan yawning --out r --runs 6 2>&1 | head -3
yawning: What yawning costs.
plan day · 6 runs of each variant, seeds 1 to 6

--- exit 0
$ pleach evaluate day.plan yawning --out r --quiet --runs 6 --accept static
--- stderr
error: r/yawning holds runs of something else, which differs in its accept; name another folder, or remove this one
--- exit 2
$ pleach evaluate day.plan --shard 1/2
--- stderr
error: the following required arguments were not provided:
  --out <DIR>

Usage: pleach evaluate --out <DIR> --shard <i/n> <FILE> [EXPERIMENT]...

For more information, try '--help'.
--- exit 2
$ pleach evaluate day.plan --shard 3/2 --out p
--- stderr
error: invalid value '3/2' for '--shard <i/n>': `3/2` is no shard: i/n, the i-th of n, as in 2/4

For more information, try '--help'.
--- exit 2
$ for i in 1 2; do pleach evaluate day.plan yawning --out p --quiet --runs 6 --shard $i/2; done; pleach evaluate merge p --out m --quiet && cmp m/yawning/runs.csv r/yawning/runs.csv && cmp m/yawning/evaluation.json r/yawning/evaluation.json
--- exit 0
$ pleach evaluate merge p m p --out m | head -4
yawning: What yawning costs.
plan day · 6 runs of each variant, seeds 1 to 6

tasks 2
--- stderr
written: m/yawning/report.html
--- exit 0
$ pleach evaluate merge . --out m2 --quiet; pleach evaluate merge nowhere --out m2; pleach evaluate merge p
--- stderr
error: there is no evaluation in nowhere
  help: evaluations are made by pleach evaluate FILE --out DIR
error: it is not said where to
  help: name a folder: pleach evaluate merge DIR … --out DIR
--- exit 2
$ cat r/yawning/runs.csv | head -4
experiment,tasks,variant,seed,status,success,why,seconds,driven,straight,hands,motions,actions,failures,recovered,per-task
yawning,2,none,1,succeeded,true,,6.0,0.0,0.0,0.0,0.0,0.0,0.0,0.0,3.0
yawning,2,lively,1,succeeded,true,,2.0,0.0,0.0,0.0,0.0,0.0,0.0,0.0,1.0
yawning,2,none,2,succeeded,true,,8.0,0.0,0.0,0.0,0.0,0.0,0.0,0.0,4.0
--- exit 0
$ pleach evaluate day.plan --out day.plan
--- stderr
error: cannot write day.plan/yawning: a part of its path is no folder
--- exit 2
$ pleach evaluate day.plan --plan day --arg 2 --runs 2 --out a --quiet; pleach evaluate day.plan --plan day --arg 4 --runs 2 --out a --quiet
--- stderr
error: a/day holds runs of something else, which differs in its arguments; name another folder, or remove this one
--- exit 2
$ pleach evaluate day.plan short --variants none,half,none --runs 2
--- stderr
error: the experiment short cannot be evaluated: it has the variant none twice
--- exit 2
$ pleach evaluate day.plan short --runs 0
--- stderr
error: the experiment short cannot be evaluated: its runs are a number from 1 to 1000000, not 0
--- exit 2
$ pleach evaluate day.plan short --seed 9223372036854775807
--- stderr
error: the experiment short cannot be evaluated: its seeds go up to 9223372036854775807
--- exit 2
$ pleach evaluate day.plan yawning --out r --runs 2 2>&1 >/dev/null
note: the folder has been asked for 6 runs of each variant, and all of them count
written: r/yawning/report.html
--- exit 0
$ ls -a r
.
..
yawning
--- exit 0
$ pleach evaluate plain.plan --variants none --runs 3
main
plan main · 3 runs of each variant, seeds 1 to 3
            mean          95 %  median
success
  none   100.0 %  43.9 – 100.0  3 of 3
seconds
  none      1.33  −4.40 – 7.07    0.00

p: Student's paired test; of success McNemar's exact one. --json and the report have Welch's, Wilcoxon's and Fisher's tests,
corrections for many tests, and effect sizes.

--- exit 0
