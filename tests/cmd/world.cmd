# What `run` keeps of a world: a record and a picture.

=== room.plan
(use world)
(use robots)
(use scenes/tableware)

(def-scene room
  "A desk, with names that a file must not take as its own."
  ,@tableware
  (a room (name <b>&room) (from 0 0) (to 4 3))
  (a furniture
    (name <script>desk&co)
    (at 3 1.5 3.14159)
    (box (size 0.8 1.6 0.04) (at 0 0 0.72))
    (surface (name desk_area) (at 0 0 0.74) (size 0.8 1.6)))
  (an object (name my-cup) (type cup) (on desk_area) (at 0.2 0)))

(def-plan main ()
  (use-scene room)
  (use-robot one-arm :at (pose 1 1.5 0))
  (put-object 'my-cup 'desk_area 0.1 0.5)
  (with-hypothetical-world (going (pose 2 1 0)))
  (with-failure-handling ((world-failure (e) (return 'tried)))
    (par (going (pose 1.3 0.8 0)) (looking (vec3 2 1.5 0.7)))
    (going (pose 3 1.5 0)))
  (put-object 'my-cup 'desk_area 0.1 -0.5))

=== nothing.plan
(def-plan main () (print "no world"))

=== drop.plan
(use world)
(use robots)
(use scenes/kitchen)

(def-plan main ()
  (use-scene kitchen)
  (use-robot pr2 :at (pose 1.1 3.35 0 :yaw 3.14159))
  (moving-torso 0.2)
  (looking (surface-pose 'sink_area))
  (detecting)
  (releasing 'left)
  (let ((ways (grasp 'cup-1 'front)))
    (moving-tcp 'left (list (first ways) (second ways)) :touching 'cup-1)
    (gripping 'left 'cup-1)
    (moving-tcp 'left (transform (pose 0 0 0.2) (second ways)) :touching 'cup-1))
  (with-failure-handling
      ((placing-failure (e)
         (print (failure-type e) (get e :object))
         (return nil)))
    (releasing 'left))
  (print (where-is 'cup-1)))

=== commands
$ pleach run room.plan --quiet --record room.json --picture room.svg
--- exit 0
$ grep -A5 '"motions"' room.json | cut -c1-230
      "motions": [
        {"motion":"looking","begin":3.395187,"end":3.979243,"outcome":"succeeded","wanted":{"at":[2.0,1.5,0.7]},"costs":{"path-m":0.0,"hand-m":0.0,"leaps":0},"keys":[{"at":3.395187,"joints":{"camera_pan_joint":0.0,"camera_tilt_joi
        {"motion":"going","begin":3.395187,"end":7.833103,"outcome":"succeeded","wanted":{"poses":[[1.3,0.8,0.0,0.0,0.0,0.0,1.0]]},"costs":{"path-m":0.761577,"hand-m":0.0,"leaps":0},"keys":[{"at":3.395187,"base":[1.0,1.5,0.0,0.0,0
        {"motion":"going","begin":7.833103,"end":8.333103,"outcome":"failed","failure":{"type":"base-goal-in-collision","message":"the base would touch something at its goal: `<script>desk&co`"},"wanted":{"poses":[[3.0,1.5,0.0,0.0
      ],
      "objects": [
--- exit 0
$ grep -A9 '"objects"' room.json
      "objects": [
        {"name":"my-cup","type":"cup","poses":[{"at":0.0,"on":"desk_area","pose":[2.899999,1.0,0.785,0.0,0.0,1.0,1e-6]},{"at":8.333103,"on":"desk_area","pose":[2.900001,2.0,0.785,0.0,0.0,1.0,1e-6]}]}
      ],
      "hands": [],
      "put": [
        0.0,
        8.333103
      ]
    }
  ]
--- exit 0
$ grep -c . room.svg; grep -n '<b>\|<script>\|my-cup\|driven\|motions' room.svg | head -12
121
15:<polygon points="415.48,177.55 417.87,175.81 418.78,173 417.87,170.19 415.48,168.45 412.52,168.45 410.13,170.19 409.22,173 410.13,175.81 412.52,177.55" fill="#c9a3d4" stroke="#6a1b7a"><title>my-cup</title></polygon>
61:<text x="421" y="297" class="m" opacity="0.6">my-cup</text>
62:<text x="423" y="166" class="m">my-cup</text>
70:<text x="594" y="72" >0.8 m driven, 8.3 s</text>
71:<text x="594" y="90" >3 motions, 1 failed</text>
117:<text x="594" y="166" fill="#6a1b7a">my-cup: desk_area → desk_area</text>
--- exit 0
$ pleach run room.plan --quiet --record again.json --picture again.svg; cmp room.json again.json; cmp room.svg again.svg
--- exit 0
$ pleach run nothing.plan --quiet --record nothing.json --picture nothing.svg
no world
--- stderr
note: this run has no world, so there is nothing in nothing.json and nothing.svg
--- exit 0
$ cat nothing.json
{
  "pleach-record": 1,
  "file": "nothing.plan",
  "plan": "main",
  "seed": 0,
  "end": 0.0,
  "episodes": []
}
--- exit 0
$ pleach run nothing.plan --record there/is/none.json
--- stderr
error: cannot write there/is/none.json: there is no such file
  help: name a file in a folder that is there: --record FILE
--- exit 2
$ pleach run nothing.plan --picture .
--- stderr
error: cannot write .: it is a folder
  help: name a file in a folder that is there: --picture FILE
--- exit 2
$ pleach run nothing.plan --picture room.plan
--- stderr
error: room.plan is no file of --picture, and is not overwritten
  help: choose another name after --picture
--- exit 2
$ pleach run nothing.plan --picture x --record x
--- stderr
error: --record and --picture name the same file
  help: name two files
--- exit 2
$ pleach run nothing.plan --picture x.svg --schedules 0..2
--- stderr
error: the argument '--picture <FILE.svg>' cannot be used with '--schedules <A..B>'

Usage: pleach run --picture <FILE.svg> <FILE>

For more information, try '--help'.
--- exit 2
$ pleach run drop.plan --quiet
object-fell cup-1
sink_area
--- exit 0
$ pleach run drop.plan --quiet --robot simulated
object-fell cup-1
sink_area
--- exit 0
$ pleach run drop.plan --quiet --robot simulated --log drop.log && pleach replay drop.log --quiet
object-fell cup-1
sink_area
object-fell cup-1
sink_area
--- exit 0
$ pleach run drop.plan --robot imagined
--- stderr
error: invalid value 'imagined' for '--robot <KIND>'
  [possible values: projected, simulated]

  tip: a similar value exists: 'simulated'

For more information, try '--help'.
--- exit 2
