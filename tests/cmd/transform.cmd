# Plans that are rehearsed and rewritten: what is kept, what is refused, and why.
=== day.plan
(use transformation)
(def-plan nap () (sleep 5))
(def-plan work (what) (sleep 1) what)
(def-plan main () (nap) (work 'a) (nap) (print "done"))
(def-transformation lazy
  "Skips naps."
  :applicable (task-name ?nap nap)
  :rewrite (list (skip ?nap)))
(def-transformation lazier
  "Naps after work."
  :applicable (task-name ?work work)
  :rewrite (list (after ?work '(nap)))
  :before (lazy))
=== more/twice.plan
(use transformation)
(def-transformation at-once
  "Work is the same once."
  :applicable (and (task-name ?a work) (task-name ?b work) (before ?a ?b))
  :rewrite (list (skip ?b)))
=== more/none.plan
(use transformation)
(def-transformation hopeless
  "Needs a hand more than there are."
  :applicable (task-name ?work work)
  :rewrite (list (skip ?work))
  :capacity ((< 2 (- (hands) (hands-used)))))
=== own/tea.plan
(use transformation)
(def-plan brew () (sleep 2) (print "tea"))
(def-rules tea (<- (action-grounding (an action (type brewing)) (brew))))
(def-transformation tea-time
  "Tea is quicker than a nap."
  :applicable (task-name ?nap nap)
  :rewrite (list (replace ?nap '(perform (an action (type brewing))))))
=== circle.plan
(use transformation)
(def-transformation a "A." :applicable (task ?t) :rewrite nil :before (b))
(def-transformation b "B." :applicable (task ?t) :rewrite nil :before (a))
(def-plan main () (print 1))
=== fails.plan
(use transformation)
(def-plan work () (fail plan-failure :message "no tools"))
(def-plan main () (work))
(def-transformation lazy "Skips work." :applicable (task-name ?work work) :rewrite (list (skip ?work)))
=== wrong.plan
(use transformation)
(def-transformation lazy "Says too little." :applicable (task ?t))
(def-transformation odd "Says too much." :applicable (task ?t) :rewrite nil :keep ((task ?t)))
(def-transformation bare :applicable (task ?t) :rewrite nil)
(def-transformation lost "Groups by what is not there." :applicable (task ?t) :rewrite nil :answers (all :group-by (?x)))
(def-transformation slip "A slip of the pen." :applicable (task ?t) :rewrite nil :answers (all :gruop-by (?t)))
(def-transformation twice "Says it twice." :applicable (task ?t) :rewrite nil :rewrite nil)
(def-plan main () (print 1))
=== commands
$ pleach transform day.plan
rehearsed under 5 seeds: 11.0 s → 1.0 s, 91 % less
  lazy             accepted (projected), 11.0 s → 6.0 s
      (skip (path main nap) :by 'lazy)
  lazy             accepted (projected), 6.0 s → 1.0 s
      (skip (path main (nap :call 2)) :by 'lazy)
1 refused, --why says why
top-level  succeeded  [0 – 1 s, 1 s]
└─ main  succeeded  [0 – 1 s, 1 s]
   ├─ nap  skipped (edit)
   ├─ work a  succeeded → a  [0 – 1 s, 1 s]
   └─ nap  skipped (edit)
--- exit 0
$ pleach transform day.plan --why --quiet --rules more
rehearsed under 5 seeds: 11.0 s → 1.0 s, 91 % less
  lazier           refused (projected), 11.0 s → 16.0 s: it does not pay under these seeds
      (after (path main work) '(nap) :by 'lazier)
  lazy             accepted (projected), 11.0 s → 6.0 s
      (skip (path main nap) :by 'lazy)
  lazy             accepted (projected), 6.0 s → 1.0 s
      (skip (path main (nap :call 2)) :by 'lazy)
  hopeless         refused (static): the capacity (< 2 (- (hands) (hands-used))) of hopeless does not hold even with empty hands
      (skip (path main work) :by 'hopeless)
--- exit 0
$ pleach transform day.plan --only lazy --accept paired -q
rehearsed under 5 seeds: 11.0 s → 1.0 s, 91 % less
  lazy             accepted (paired), saves 5.0 s (5.0 to 5.0, 20 pairs)
      (skip (path main nap) :by 'lazy)
  lazy             accepted (paired), saves 5.0 s (5.0 to 5.0, 20 pairs)
      (skip (path main (nap :call 2)) :by 'lazy)
--- exit 0
$ pleach transform day.plan --only lazier -q
rehearsed under 5 seeds: 11.0 s → 11.0 s, 0 % less
nothing was kept; 1 refused, --why says why
--- exit 1
$ pleach transform day.plan --only nobody -q
--- stderr
error: the rehearsal failed
  × transformation-failure: there is no transformation nobody; there are: lazy lazier
  │ in top-level
  │ name: nobody
     ╭─[library/transformation.plan:145:7]
 144 │         (unless (member name names)
 145 │ ╭─▶       (fail
 146 │ │          transformation-failure
 147 │ │          :name name
 148 │ │          :message
 149 │ │            (if
 150 │ │             names
 151 │ │             (format "there is no transformation ~a; there are: ~a"
 152 │ │                     name
 153 │ │                     (string-join (map symbol->string names) " "))
 154 │ │             (format
 155 │ │              "there is no transformation ~a, for none is loaded; those of the library are by (use household)"
 156 │ ├─▶            name))))
     · ╰──── failed here
 157 │         name))
     ╰────
--- exit 2
$ pleach transform day.plan --list
1  lazier                   enabled   Naps after work.
2  lazy                     enabled   Skips naps.
--- exit 0
$ pleach transform day.plan --list --json
{"transformations":[{"before":["lazy"],"doc":"Naps after work.","name":"lazier","priority":1,"state":"enabled"},{"before":null,"doc":"Skips naps.","name":"lazy","priority":2,"state":"enabled"}]}
--- exit 0
$ pleach transform day.plan --only lazy --json -q
{"after":1.0,"before":11.0,"seeds":[1000003,1000004,1000005,1000006,1000007],"steps":[{"check":"projected","edits":["(skip (path main nap) :by 'lazy)"],"input":{"?nap":"top-level / main / nap"},"numbers":{"after":6.0,"before":11.0,"seeds":[1000003,1000004,1000005,1000006,1000007],"succeeded":5},"transformation":"lazy","verdict":"accepted","why":null},{"check":"projected","edits":["(skip (path main (nap :call 2)) :by 'lazy)"],"input":{"?nap":"top-level / main / nap :call 2"},"numbers":{"after":1.0,"before":6.0,"seeds":[1000003,1000004,1000005,1000006,1000007],"succeeded":5},"transformation":"lazy","verdict":"accepted","why":null}],"saved":null,"tree":[{"name":"top-level","path":"top-level","parent":null,"kind":"top-level","status":"succeeded","attempt":1,"params":{},"value":"nil","start":0.0,"end":1.0},{"name":"main","path":"top-level / main","parent":0,"kind":"plan","status":"succeeded","attempt":1,"params":{},"value":"nil","start":0.0,"end":1.0},{"name":"nap","path":"top-level / main / nap","parent":1,"kind":"plan","status":"skipped","attempt":1,"params":{},"value":"nil","why":"edit","start":0.0,"end":0.0,"edits":["(skip (path main nap) :by 'lazy)"]},{"name":"work","path":"top-level / main / work","parent":1,"kind":"plan","status":"succeeded","attempt":1,"params":{"what":"a"},"value":"a","start":0.0,"end":1.0},{"name":"nap","path":"top-level / main / nap :call 2","parent":1,"kind":"plan","status":"skipped","attempt":1,"params":{},"value":"nil","why":"edit","start":1.0,"end":1.0,"edits":["(skip (path main (nap :call 2)) :by 'lazy)"]}]}
--- exit 0
$ pleach run day.plan --rehearse
done
--- stderr
rehearsed under 5 seeds: 11.0 s → 1.0 s, 91 % less
  lazy             accepted (projected), 11.0 s → 6.0 s
      (skip (path main nap) :by 'lazy)
  lazy             accepted (projected), 6.0 s → 1.0 s
      (skip (path main (nap :call 2)) :by 'lazy)
1 refused, --why says why
top-level  succeeded  [0 – 1 s]
└─ main  succeeded  [0 – 1 s]
   ├─ nap  skipped (edit)
   ├─ work a  succeeded → a  [0 – 1 s]
   └─ nap  skipped (edit)
--- exit 0
$ pleach run day.plan --rehearse --store s.store --tree day -q; pleach tree s.store day; pleach run day.plan --store s.store --tree day -q; pleach tree s.store
done
top-level  succeeded  [0 – 1 s, 1 s]
└─ main  succeeded  [0 – 1 s, 1 s]
   ├─ nap  skipped (edit)
   ├─ work a  succeeded → a  [0 – 1 s, 1 s]
   └─ nap  skipped (edit)
edit (skip (path main nap) :by 'lazy) by transformation lazy
edit (skip (path main (nap :call 2)) :by 'lazy) by transformation lazy
refused (projected): it does not pay under these seeds; lazier: (after (path main work) '(nap) :by 'lazier)
done
  run  tree                     outcome          nodes  edits  file
    1  day@1                    succeeded            5      2  day.plan main
    2  day@2                    succeeded            5      2  day.plan main
--- exit 0
$ pleach run day.plan --rehearse --log day.log -q; pleach replay day.log -q
done
done
--- exit 0
$ pleach transform day.plan --emit better.plan -q; tail -6 better.plan; pleach run better.plan --plan main/better
rehearsed under 5 seeds: 11.0 s → 1.0 s, 91 % less
  lazy             accepted (projected), 11.0 s → 6.0 s
      (skip (path main nap) :by 'lazy)
  lazy             accepted (projected), 6.0 s → 1.0 s
      (skip (path main (nap :call 2)) :by 'lazy)
1 refused, --why says why

(def-variant main/better (:of main)
  "`main` with the edits of lazy."
  (places (main (nap) (nap :call 2 :nth 2)))
  (skip (path main nap) :by 'lazy)
  (skip (path main (nap :call 2)) :by 'lazy))
done
--- stderr
written: pleach run better.plan --plan main/better
top-level  succeeded  [0 – 1 s]
└─ main/better  succeeded  [0 – 1 s]
   └─ main  succeeded  [0 – 1 s]
      ├─ nap  skipped (edit)
      ├─ work a  succeeded → a  [0 – 1 s]
      └─ nap  skipped (edit)
--- exit 0
$ pleach transform day.plan --emit written.plan --inline -q; tail -4 written.plan; pleach run written.plan --plan main/better
rehearsed under 5 seeds: 11.0 s → 1.0 s, 91 % less
  lazy             accepted (projected), 11.0 s → 6.0 s
      (skip (path main nap) :by 'lazy)
  lazy             accepted (projected), 6.0 s → 1.0 s
      (skip (path main (nap :call 2)) :by 'lazy)
1 refused, --why says why

(def-plan main/better ()
  (work 'a)
  (print "done"))
done
--- stderr
written: pleach run written.plan --plan main/better
top-level  succeeded  [0 – 1 s]
└─ main/better  succeeded  [0 – 1 s]
   └─ work a  succeeded → a  [0 – 1 s]
--- exit 0
$ pleach transform day.plan --emit day.plan -q
--- stderr
error: day.plan is the plan file itself, and is not overwritten
  help: choose another name after --emit
--- exit 2
$ pleach run day.plan --store t.store --tree day -q; pleach transform t.store day --save -q; pleach run day.plan --store t.store --tree day -q; mv day.plan gone; pleach transform t.store -q; mv gone day.plan; pleach tree t.store
done
rehearsed under 5 seeds: 11.0 s → 1.0 s, 91 % less
  lazy             accepted (projected), 11.0 s → 6.0 s
      (skip (path main nap) :by 'lazy)
  lazy             accepted (projected), 6.0 s → 1.0 s
      (skip (path main (nap :call 2)) :by 'lazy)
1 refused, --why says why
saved as day@2; `pleach run … --tree` goes on with it
done
rehearsed under 5 seeds: 1.0 s → 1.0 s, 0 % less
nothing was kept; 1 refused, --why says why
  run  tree                     outcome          nodes  edits  file
    1  day@1                    succeeded            5      0  day.plan main
    2  day@2                    saved                5      2
    3  day@3                    succeeded            5      2  day.plan main
--- exit 0
$ pleach transform t.store nothing
--- stderr
error: there is no tree `nothing` in the store t.store
  help: its trees are: day
--- exit 2
$ pleach run day.plan --rehearse --only tea-time --rules own --store o.store --log o.log -q; rm -r own; pleach replay o.store -q
tea
tea
done
tea
tea
done
--- exit 0
$ pleach transform circle.plan --save
--- stderr
error: --save puts the better plan into a store, and this is a plan file
  help: pleach run FILE --rehearse --store STORE --tree NAME keeps it with the run
--- exit 2
$ pleach transform circle.plan --list
--- stderr
  × transformation-failure: the priorities go in a circle: a before b before a
  │ in top-level
  │ name: a
     ╭─[library/transformation.plan:219:10]
 218 │            (let ((name (get (first left) :name)))
 219 │ ╭─▶          (fail transformation-failure
 220 │ │                  :name name
 221 │ │                  :message (format "the priorities go in a circle: ~a"
 222 │ │                                   (string-join (map symbol->string (%circle name before nil))
 223 │ ├─▶                                              " before "))))))))
     · ╰──── failed here
 224 │     
     ╰────
--- exit 2
$ pleach transform fails.plan
the plan fails in projection: no tools
top-level  failed: plan-failure
└─ main  failed: plan-failure
   └─ work  failed: plan-failure
--- exit 1
$ pleach transform wrong.plan
--- stderr
expand::failed

  × the macro `transformation` failed: the transformation lazy does not say :rewrite (program-
  │ error)
   ╭─[wrong.plan:2:1]
 1 │ (use transformation)
 2 │ (def-transformation lazy "Says too little." :applicable (task ?t))
   · ─────────────────────────────────┬────────────────────────────────
   ·                                  ╰── expanded here
 3 │ (def-transformation odd "Says too much." :applicable (task ?t) :rewrite nil :keep ((task ?t)))
   ╰────
expand::failed

  × the macro `transformation` failed: the transformation odd says :keep; it may
  │ say :applicable :answers :rewrite :keeps :capacity :before :out-of (program-error)
   ╭─[wrong.plan:3:1]
 2 │ (def-transformation lazy "Says too little." :applicable (task ?t))
 3 │ (def-transformation odd "Says too much." :applicable (task ?t) :rewrite nil :keep ((task ?t)))
   · ───────────────────────────────────────────────┬──────────────────────────────────────────────
   ·                                                ╰── expanded here
 4 │ (def-transformation bare :applicable (task ?t) :rewrite nil)
   ╰────
expand::failed

  × the macro `transformation` failed: the transformation bare says nothing about itself: a text
  │ stands behind its name (program-error)
   ╭─[wrong.plan:4:1]
 3 │ (def-transformation odd "Says too much." :applicable (task ?t) :rewrite nil :keep ((task ?t)))
 4 │ (def-transformation bare :applicable (task ?t) :rewrite nil)
   · ──────────────────────────────┬─────────────────────────────
   ·                               ╰── expanded here
 5 │ (def-transformation lost "Groups by what is not there." :applicable (task ?t) :rewrite nil :answers (all :group-by (?x)))
   ╰────
expand::failed

  × the macro `transformation` failed: the transformation lost groups by (?x); the variables of
  │ its `:applicable` are (?t) (program-error)
   ╭─[wrong.plan:5:1]
 4 │ (def-transformation bare :applicable (task ?t) :rewrite nil)
 5 │ (def-transformation lost "Groups by what is not there." :applicable (task ?t) :rewrite nil :answers (all :group-by (?x)))
   · ────────────────────────────────────────────────────────────┬────────────────────────────────────────────────────────────
   ·                                                             ╰── expanded here
 6 │ (def-transformation slip "A slip of the pen." :applicable (task ?t) :rewrite nil :answers (all :gruop-by (?t)))
   ╰────
expand::failed

  × the macro `transformation` failed: the transformation slip says `:answers (all :gruop-by (?
  │ t))`; there are `(first)` and `(all :group-by (?x) :min n :order predicate)` (program-error)
   ╭─[wrong.plan:6:1]
 5 │ (def-transformation lost "Groups by what is not there." :applicable (task ?t) :rewrite nil :answers (all :group-by (?x)))
 6 │ (def-transformation slip "A slip of the pen." :applicable (task ?t) :rewrite nil :answers (all :gruop-by (?t)))
   · ───────────────────────────────────────────────────────┬───────────────────────────────────────────────────────
   ·                                                        ╰── expanded here
 7 │ (def-transformation twice "Says it twice." :applicable (task ?t) :rewrite nil :rewrite nil)
   ╰────
expand::failed

  × the macro `transformation` failed: the transformation twice does not say :rewrite once, with
  │ what it is (program-error)
   ╭─[wrong.plan:7:1]
 6 │ (def-transformation slip "A slip of the pen." :applicable (task ?t) :rewrite nil :answers (all :gruop-by (?t)))
 7 │ (def-transformation twice "Says it twice." :applicable (task ?t) :rewrite nil :rewrite nil)
   · ─────────────────────────────────────────────┬─────────────────────────────────────────────
   ·                                              ╰── expanded here
 8 │ (def-plan main () (print 1))
   ╰────
--- exit 2
$ pleach transform missing.plan
--- stderr
error: cannot read missing.plan: there is no such file
  help: check the name, and the folder that you are in
--- exit 2
$ pleach transform day.plan --rules nowhere.plan
--- stderr
error: cannot read nowhere.plan: there is no such file
--- exit 2
$ pleach transform day.plan --plan nap --arg 1
--- stderr
error: the rehearsal failed
  × arity-error: `nap` takes 0 arguments, got 1
  │ in top-level
     ╭─[library/transformation.plan:461:3]
 460 │ (def-fun %run (state tree seed)
 461 │   (project (get state :plan) :args (get state :args) :tree tree :seed seed))
     ·   ────────────────────────────────────┬────────────────────────────────────
     ·                                       ╰── failed here
 462 │ 
     ╰────
--- exit 2
