//! Random concurrent programs: tasks that wait for, stop and suspend one another, and end all the same.
//!
//! Plans call only later ones, loops count, a `retry` stands under a counter, and who waits does so for a
//! limited time, mostly. Each `unwind-protect` has a number: its body prints `enter N`, its clean-up
//! `clean N`; one that cannot fail then prints `begin N`, sleeps, and prints `done N`.

use crate::dice::Dice;

/// Calls are put off out of whatever stands around them.
const GUARDS: &str = ":out-of '(clean-up with-timeout with-policy with-task-suspended)";

/// What comes after [`HEAD`]: plans, and `main`. It may read the file `path`.
#[must_use]
pub fn random_program(seed: u64, path: &str) -> String {
    let busy = seed.is_multiple_of(3);
    let mut it =
        Generator { dice: Dice::new(seed ^ 0xC0), names: 0, size: 0, plans: 0, busy, path: path.into() };
    it.program(seed % 4 == 1)
}

/// What may be said at a place.
#[derive(Clone, Default)]
struct Scope {
    /// Variables that hold numbers.
    numbers: Vec<String>,
    /// Fluents that can be set, and all fluents.
    cells: Vec<String>,
    fluents: Vec<String>,
    /// Handles of tasks.
    tasks: Vec<String>,
    counters: Vec<String>,
    can_return: bool,
    in_clause: bool,
    in_clean_up: bool,
    /// Plans from this number on may be called.
    from: usize,
    loops: usize,
}

struct Generator {
    dice: Dice,
    names: usize,
    /// What is left of the size of the plan that is being made.
    size: usize,
    plans: usize,
    /// Endless loops are stopped from outside; then all times are short.
    busy: bool,
    path: String,
}

const FAILURES: &[&str] = &["f1", "f2", "plan-failure", "failure", "timeout", "composite-failure"];
const LISTS: &[&str] = &["'(1 2)", "'(a 1 a)", "'(3)", "'()", "'(1 2 3)"];

/// What every random program begins with.
pub const HEAD: &str = "\
(def-failure f1 () (what))
(def-failure f2 (f1))
(def-plan leaf (a) (when (= (random 4) 0) (fail f2 :what a)) (print 'leaf a) a)
(def-plan nap (a) (sleep a) a)
(def-fun through (a c) (if (= (random 3) 0) (leaf a) (par (leaf a) (seq (set-value c a) (nap 0.001)))))
(extend ground (d) (case (get d :type) (act0 (list leaf (get d :x))) (act1 (list nap 0.002)) (otherwise nil)))
(def-fun pick (tree k) (let ((paths (tree-paths tree))) (nth (mod k (length paths)) paths)))
(def-fun try-edit (tree edit)
  (with-failure-handling ((edit-refused (e) (return tree))) (edit-tree tree (list (edit)))))
(def-policy guard (f)
  (:init (print \"enter\" 0)) (:check f) (:recover (print 'recover)) (:clean-up (print \"clean\" 0)))
(def-macro protect (n body &rest clean-up)
  `(unwind-protect (seq (print \"enter\" ,n) ,body) (print \"clean\" ,n) ,@clean-up))
(def-macro protect-well (n body seconds)
  `(protect ,n ,body (print \"begin\" ,n) (sleep ,seconds) (print \"done\" ,n)))
";

impl Generator {
    fn one_of(&mut self, items: &[String]) -> String {
        items[self.dice.below(items.len())].clone()
    }
    fn fresh(&mut self, stem: &str) -> String {
        self.names += 1;
        format!("{stem}{}", self.names)
    }

    // ------------------------------------------------------------------ programs

    fn program(&mut self, edited: bool) -> String {
        self.plans = 1 + self.dice.below(3);
        let mut out = String::new();
        for number in 0..self.plans {
            self.size = 20;
            let scope = Scope {
                numbers: vec!["a".into()],
                cells: vec!["c".into()],
                fluents: vec!["c".into()],
                from: number + 1,
                ..Scope::default()
            };
            out += &format!("(def-plan p{number} (a c) {} a)\n", self.body(&scope, 5));
        }
        out +=
            &if edited { self.edited_main() } else { "(def-plan main () (p0 1 (fluent nil)))\n".to_string() };
        out
    }

    fn edited_main(&mut self) -> String {
        let (mut bindings, mut tree) = (String::new(), String::from("t"));
        for number in 0..1 + self.dice.below(4) {
            bindings += &format!(" (t{number} (try-edit {tree} (lambda () {})))", self.edit());
            tree = format!("t{number}");
        }
        format!(
            "(def-plan main () (let* ((t (run-plan p0 :args (list 1 (fluent nil)))){bindings}) \
             (list t (run-plan p0 :args (list 1 (fluent nil)) :tree {tree}))))\n"
        )
    }

    fn edit(&mut self) -> String {
        let place = |it: &mut Self| format!("(pick t {})", it.dice.below(40));
        let at = place(self);
        let code = self.dice.pick(&[
            "(leaf 8)",
            "(nap 0.002)",
            "(print 'edit)",
            "(fail f1 :what 9)",
            "(par (leaf 6) (nap 0.001))",
        ]);
        let around = match self.dice.below(4) {
            0 => "(original)".to_string(),
            1 => format!("(par (original) {code})"),
            2 => format!("(pursue (original) (seq (sleep 0.004) {code}))"),
            _ => format!("(seq {code} (original))"),
        };
        match self.dice.below(11) {
            0 => format!("(skip {at})"),
            1 => format!("(before {at} '{code})"),
            2 => format!("(after {at} '{code})"),
            3 => format!("(wrap {at} '{around})"),
            4 => format!("(replace {at} '{around})"),
            5 => format!("(replace {at} '{code})"),
            6 | 7 => {
                format!("(owe {at} '{code} :after (list {} {}) :as 'debt {GUARDS})", place(self), place(self))
            }
            _ => format!("(defer {at} :after {} {GUARDS})", place(self)),
        }
    }

    // ------------------------------------------------------------------ statements

    fn body(&mut self, scope: &Scope, depth: usize) -> String {
        let count = 1 + self.dice.below(3);
        (0..count).map(|_| self.statement(scope, depth)).collect::<Vec<_>>().join(" ")
    }

    /// One form.
    fn seq(&mut self, scope: &Scope, depth: usize) -> String {
        format!("(seq {})", self.body(scope, depth))
    }

    fn statement(&mut self, scope: &Scope, depth: usize) -> String {
        if self.size == 0 || depth == 0 {
            return self.leaf(scope);
        }
        self.size -= 1;
        let inner = depth - 1;
        match self.dice.below(28) {
            0..=5 => self.parallel(scope, inner),
            6 => self.partial_order(scope, inner),
            7 => self.parallel_loop(scope, inner),
            8 => format!("(with-timeout {} {})", self.seconds(), self.body(&closed(scope), inner)),
            9..=11 => self.protect(scope, inner),
            12..=14 => self.handler(scope, inner),
            15 | 16 => self.let_fluent(scope, inner),
            17 | 18 => self.whenever(scope, inner),
            19 => self.loops(scope, inner),
            20 => {
                let (test, a, b) = (self.test(scope), self.seq(scope, inner), self.seq(scope, inner));
                format!("(if {test} {a} {b})")
            }
            21 if !scope.tasks.is_empty() => {
                format!("(with-task-suspended ({}) {})", self.one_of(&scope.tasks), self.body(scope, inner))
            }
            22 => {
                let fluent = self.one_of(&scope.fluents);
                format!("(with-policy (guard {fluent}) {})", self.body(&closed(scope), inner))
            }
            23 if self.busy && !scope.in_clean_up => format!("(with-timeout {} (loop nil))", self.seconds()),
            24 if self.busy && !scope.in_clean_up => {
                format!("(pursue (dotimes (i 2500) i) (nap {}))", self.seconds())
            }
            25 => {
                let name = self.fresh("y");
                let mut inside = Scope { loops: scope.loops + 1, ..closed(scope) };
                inside.numbers.push(name.clone());
                format!("(map (lambda ({name}) {}) {})", self.body(&inside, inner), self.dice.pick(LISTS))
            }
            _ => self.leaf(scope),
        }
    }

    fn leaf(&mut self, scope: &Scope) -> String {
        match self.dice.below(26) {
            0 | 1 => format!("(print '{} {})", self.dice.pick(&["x", "y", "z"]), self.number(scope)),
            2 | 3 => format!("(sleep {})", self.seconds()),
            4 => format!("(nap {})", self.seconds()),
            5 => format!(
                "(when {} (fail {} :what {}))",
                self.test(scope),
                self.dice.pick(&["f1", "f2"]),
                self.number(scope)
            ),
            6 => format!("(when {} (first 5))", self.test(scope)),
            7 | 8 => format!("(set-value {} {})", self.one_of(&scope.cells), self.setting(scope)),
            9 => format!("(pulse {})", self.one_of(&scope.fluents)),
            10 | 11 => {
                let fluent = self.one_of(&scope.fluents);
                format!("(print 'waited (wait-for {fluent} :timeout {}))", self.seconds())
            }
            12 if self.dice.chance(30) => format!("(wait-for {})", self.one_of(&scope.fluents)),
            13..=16 if !scope.tasks.is_empty() => self.act_on(scope),
            17 if scope.from < self.plans => {
                let plan = scope.from + self.dice.below(self.plans - scope.from);
                format!("(p{plan} {} {})", self.number(scope), self.one_of(&scope.cells))
            }
            18 if scope.can_return => format!("(when {} (return {}))", self.test(scope), self.number(scope)),
            19 if scope.in_clause => "(propagate)".into(),
            20 if self.dice.chance(30) => format!("(print (length (read-file \"{}\")))", self.path),
            21 => format!("(print (value {}))", self.one_of(&scope.fluents)),
            22 => format!("(through {} {})", self.number(scope), self.one_of(&scope.cells)),
            23 => {
                let (action, fluent) = (self.dice.pick(&["act0", "act1"]), self.one_of(&scope.fluents));
                let goal = self.dice.pick(&[
                    "",
                    " :goal (= (random 3) 0)",
                    " :goal (value FLUENT)",
                    " :goal FLUENT",
                ]);
                let goal = goal.replace("FLUENT", &fluent);
                format!("(perform (an action (type {action}) (x ,{})){goal})", self.number(scope))
            }
            24 if scope.from < self.plans && scope.loops == 0 => {
                // A run of its own, while the other tasks of this one stand still.
                let plan = scope.from + self.dice.below(self.plans - scope.from);
                format!("(print (tree-status (run-plan p{plan} :args (list 2 (fluent nil)))))")
            }
            _ => format!("(leaf {})", self.number(scope)),
        }
    }

    fn act_on(&mut self, scope: &Scope) -> String {
        let task = self.one_of(&scope.tasks);
        match self.dice.below(8) {
            0 | 1 => format!("(evaporate {task})"),
            2 => format!("(suspend {task})"),
            3 => format!("(seq (suspend {task}) (sleep {}) (wake-up {task}))", self.seconds()),
            4 => format!("(wake-up {task})"),
            5 => format!("(print 'joined (join {task}))"),
            6 => format!("(wait-for (fl (equal? (status {task}) 'running)) :timeout {})", self.seconds()),
            _ => format!("(print (value (status {task})))"),
        }
    }

    fn parallel(&mut self, scope: &Scope, depth: usize) -> String {
        let form = self.dice.pick(&["par", "par", "pursue", "try-all", "try-in-order"]);
        let (branches, _) = self.branches(scope, depth, 40);
        format!("({form} {})", branches.join(" "))
    }

    fn partial_order(&mut self, scope: &Scope, depth: usize) -> String {
        let (branches, tags) = self.branches(scope, depth, 100);
        let mut orders = String::new();
        for later in 1..tags.len() {
            if self.dice.chance(60) {
                orders += &format!(" (:order {} {})", tags[self.dice.below(later)], tags[later]);
            }
        }
        format!("(partial-order ({}){orders})", branches.join(" "))
    }

    /// Branches of a parallel form, so many of a hundred with tags, and the tags.
    fn branches(&mut self, scope: &Scope, depth: usize, tagged: usize) -> (Vec<String>, Vec<String>) {
        let tags: Vec<Option<String>> =
            (0..2 + self.dice.below(2)).map(|_| self.dice.chance(tagged).then(|| self.fresh("t"))).collect();
        let mut inner = closed(scope);
        inner.tasks.extend(tags.iter().flatten().cloned());
        let branches = tags.iter().map(|tag| {
            let body = self.seq(&inner, depth);
            tag.as_ref().map_or(body.clone(), |tag| format!("(:tag {tag} {body})"))
        });
        (branches.collect(), tags.iter().flatten().cloned().collect())
    }

    fn parallel_loop(&mut self, scope: &Scope, depth: usize) -> String {
        let (form, list, name) =
            (self.dice.pick(&["par-loop", "try-each"]), self.dice.pick(LISTS), self.fresh("v"));
        let inner = Scope { loops: scope.loops + 1, ..closed(scope) };
        format!("({form} ({name} {list}) (print 'round {name}) {})", self.body(&inner, depth))
    }

    fn protect(&mut self, scope: &Scope, depth: usize) -> String {
        let body = self.seq(scope, depth);
        self.names += 1;
        let number = self.names;
        // Nor in a plan that it calls.
        let inner = Scope { in_clean_up: true, can_return: false, from: self.plans, ..scope.clone() };
        match self.dice.below(3) {
            // No clean-up inside of another one: that has only what is left of the other's time.
            0 if !scope.in_clean_up => format!("(protect-well {number} {body} {})", self.seconds()),
            1 => format!("(protect {number} {body} (nap {}))", self.seconds()),
            _ => format!("(protect {number} {body} {})", self.body(&inner, depth)),
        }
    }

    fn handler(&mut self, scope: &Scope, depth: usize) -> String {
        let counter = self.fresh("n");
        let body = self.body(&Scope { in_clause: false, ..scope.clone() }, depth);
        let mut clause = Scope { can_return: true, in_clause: true, ..scope.clone() };
        clause.counters.push(counter.clone());
        let first = if self.dice.chance(40) { self.statement(&clause, depth.min(2)) } else { String::new() };
        let last = match self.dice.below(5) {
            0 | 1 => format!("(do-retry {counter} (retry))"),
            2 => format!("(return {})", self.number(scope)),
            3 => "(fail f1 :what 7)".into(),
            _ => String::new(),
        };
        let (kind, count) = (self.dice.pick(FAILURES), self.dice.below(3));
        format!(
            "(with-retry-counters (({counter} {count})) (with-failure-handling (({kind} (e) {first} {last})) {body}))"
        )
    }

    fn let_fluent(&mut self, scope: &Scope, depth: usize) -> String {
        let name = self.fresh("f");
        let (a, b) = (self.one_of(&scope.fluents), self.one_of(&scope.fluents));
        let mut inner = scope.clone();
        inner.fluents.push(name.clone());
        let value = match self.dice.below(6) {
            0 => format!("(fl (not {a}))"),
            1 => format!("(fl (and {a} {b}))"),
            2 => format!("(fl (or {a} (equal? {b} 2)))"),
            3 => format!(
                "(fl-pulsed {a} :handle-missed-pulses {})",
                self.dice.pick(&[":never", ":once", ":always"])
            ),
            _ => {
                inner.cells.push(name.clone());
                format!("(fluent {})", self.setting(scope))
            }
        };
        format!("(let (({name} {value})) {})", self.body(&inner, depth))
    }

    fn whenever(&mut self, scope: &Scope, depth: usize) -> String {
        // Nothing here may raise its own fluent without end: the other branch ends in short time.
        let fluent = self.one_of(&scope.fluents);
        let body = self.body(&closed(scope), depth.min(1));
        let beside = self.body(&closed(scope), depth);
        format!("(pursue (whenever {fluent} (nap 0.001) {body}) (with-timeout 0.02 {beside}))")
    }

    fn loops(&mut self, scope: &Scope, depth: usize) -> String {
        let name = self.fresh("i");
        let mut inner = Scope { can_return: true, loops: scope.loops + 1, ..scope.clone() };
        inner.numbers.push(name.clone());
        if self.dice.chance(50) {
            let list = self.dice.pick(LISTS);
            return format!("(dolist ({name} {list}) {})", self.body(&inner, depth));
        }
        let rounds = if scope.loops > 0 { 2 } else { 1 + self.dice.below(3) };
        format!("(dotimes ({name} {rounds}) {})", self.body(&inner, depth))
    }

    // ------------------------------------------------------------------ expressions

    fn seconds(&mut self) -> &'static str {
        match self.busy {
            true => self.dice.pick(&["0", "0.001", "0.002", "0.003", "0.005"]),
            false => self.dice.pick(&["0", "0.001", "0.001", "0.002", "0.003", "0.5", "1", "1", "2"]),
        }
    }

    /// What a fluent is given.
    fn setting(&mut self, scope: &Scope) -> String {
        match self.dice.below(4) {
            0 | 1 => self.dice.pick(&["nil", "true", "false"]).into(),
            _ => self.number(scope),
        }
    }

    fn test(&mut self, scope: &Scope) -> String {
        match self.dice.below(4) {
            0 => format!("(value {})", self.one_of(&scope.fluents)),
            1 => format!("(equal? {} {})", self.number(scope), self.number(scope)),
            _ => format!("(= (random {}) 0)", 2 + self.dice.below(3)),
        }
    }

    fn number(&mut self, scope: &Scope) -> String {
        match self.dice.below(4) {
            0 => format!("(random {})", 1 + self.dice.below(5)),
            1 => self.dice.below(4).to_string(),
            _ => self.one_of(&scope.numbers),
        }
    }
}

/// The scope of a branch: no jump leads out of it.
fn closed(scope: &Scope) -> Scope {
    Scope { can_return: false, in_clause: false, counters: Vec::new(), ..scope.clone() }
}
