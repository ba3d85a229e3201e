//! Random programs: small, ending, and full of what the two implementations could disagree on.
//!
//! Each definition calls only later ones, so nothing recurses without end; loops count; a `retry`
//! stands under a counter. All randomness comes from the seed, so a failing seed is a program.

use crate::dice::Dice;

/// Calls are put off out of whatever stands around them.
const ANYWHERE: &str = " :out-of '(clean-up with-facts with-tree)";

/// What a random program is made for.
#[derive(Clone, Copy, PartialEq)]
pub enum Focus {
    /// A plan that runs once.
    Plain,
    /// A plan that runs, then runs again after random places of its tree have been edited.
    Edits,
    /// The same, with many edits that put calls off.
    Obligations,
}

/// A program of definitions and a plan `main`.
#[must_use]
pub fn random_program(seed: u64) -> String {
    let focus = [Focus::Plain, Focus::Edits, Focus::Obligations][(seed % 3) as usize];
    Generator { dice: Dice::new(seed), focus, names: 0, size: 0, callables: Vec::new() }.program()
}

/// What a variable may be used for.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Number,
    List,
    Function,
    Failure,
}

#[derive(Clone)]
struct Var {
    name: String,
    kind: Kind,
    /// `set!` may change it; then no function captures it.
    changes: bool,
}

/// What may be said at a place.
#[derive(Clone, Default)]
struct Scope {
    vars: Vec<Var>,
    /// Retry counters in sight.
    counters: Vec<String>,
    /// In a loop or clause: `return`.
    can_return: bool,
    /// In a clause: `propagate`.
    in_clause: bool,
    /// What has been defined from this number on may be called.
    from: usize,
    /// How many loops are around: inner ones are short.
    loops: usize,
}

/// A plan or function that can be called.
#[derive(Clone)]
struct Callable {
    name: String,
    is_plan: bool,
    /// How many arguments must be given.
    required: usize,
    optional: usize,
    keys: Vec<&'static str>,
    rest: bool,
}

struct Generator {
    dice: Dice,
    focus: Focus,
    names: usize,
    /// What is left of the size of the function that is being made.
    size: usize,
    callables: Vec<Callable>,
}

const FAILURES: &[&str] = &["f1", "f2", "f3", "plan-failure", "failure", "program-error"];
const ELEMENTS: &[&str] = &["a", "b", "a", "1", "2", "1", "\"s\"", "(x y)", "nil", "1.5", ":k", "[1 a]"];
const HEAD: &str = "\
(def-failure f1 () (what))
(def-failure f2 (f1))
(def-failure f3 (program-error))
(def-plan leaf (a) (when (= (random 4) 0) (fail f2 :what a)) (list 'leaf a))
(def-fun down (n x) (if (< n 1) (leaf x) (seq (leaf n) (down (- n 1) x))))
(def-fun up (n x) (when (> n 0) (let ((y (up (- n 1) x))) (leaf n) y)))
";
const EDITING: &str = "\
(def-fun pick (tree k) (let ((paths (tree-paths tree))) (nth (mod k (length paths)) paths)))
(def-fun pick-below (tree k)
  (let ((paths (rest (tree-paths tree)))) (if paths (nth (mod k (length paths)) paths) (path none))))
(def-fun try-edit (tree edit)
  (with-failure-handling ((edit-refused (e) (return tree))) (edit-tree tree (list (edit)))))
";
const ACTIONS: &[&str] = &["act0", "act1", "act2"];

impl Generator {
    fn fresh(&mut self, stem: &str) -> String {
        self.names += 1;
        format!("{stem}{}", self.names)
    }

    // ------------------------------------------------------------------ programs

    fn program(&mut self) -> String {
        for number in 0..3 + self.dice.below(4) {
            let callable = self.callable(number);
            self.callables.push(callable);
        }
        let mut out =
            HEAD.replace("(down (- n 1) x))))", &format!("(down (- n 1) x){})))", self.no_tail(" x")));
        for number in 0..self.callables.len() {
            out += &self.definition(number);
        }
        let last = self.callables.iter().rfind(|it| it.is_plan).cloned().expect("the first one is a plan");
        out += &format!(
            "(extend ground (d) (case (get d :type) (act0 (list leaf (get d :x))) (act1 (list {}{})) (otherwise nil)))\n",
            last.name,
            " (get d :x)".repeat(last.required)
        );
        self.size = 25;
        out + &match self.focus {
            Focus::Plain => format!("(def-plan main () {})\n", self.body(&mut Scope::default(), 4)),
            Focus::Edits | Focus::Obligations => self.edited_main(),
        }
    }

    fn callable(&mut self, number: usize) -> Callable {
        let is_plan = number == 0 || self.dice.chance(60);
        let name = format!("{}{number}", if is_plan { "p" } else { "g" });
        let optional = usize::from(self.dice.chance(25));
        let keys = if self.dice.chance(25) { vec!["k1", "k2"] } else { Vec::new() };
        let rest = keys.is_empty() && self.dice.chance(15);
        Callable { name, is_plan, required: 1 + self.dice.below(2), optional, keys, rest }
    }

    /// A tail call ends the forms that it stands in, which the oracle does not know: programs about
    /// obligations have none.
    fn no_tail<'a>(&self, value: &'a str) -> &'a str {
        if self.focus == Focus::Obligations { value } else { "" }
    }

    fn definition(&mut self, number: usize) -> String {
        self.size = 20;
        let made = self.callables[number].clone();
        let mut params = vec!["a", "b"][..made.required].to_vec();
        let mut vars: Vec<(&str, Kind)> = params.iter().map(|name| (*name, Kind::Number)).collect();
        if made.optional > 0 {
            params.push("&optional (o 4)");
            vars.push(("o", Kind::Number));
        }
        if !made.keys.is_empty() {
            params.push("&key k1 (k2 (list a 1))");
            vars.extend([("k1", Kind::Number), ("k2", Kind::Number)]);
        }
        if made.rest {
            params.push("&rest more");
            vars.push(("more", Kind::List));
        }
        let vars =
            vars.into_iter().map(|(name, kind)| Var { name: name.into(), kind, changes: false }).collect();
        let mut scope = Scope { vars, from: number + 1, ..Scope::default() };
        let form = if made.is_plan { "def-plan" } else { "def-fun" };
        let body = self.body(&mut scope, 3);
        format!("({form} {} ({}) {body}{})\n", made.name, params.join(" "), self.no_tail(" a"))
    }

    // ------------------------------------------------------------------ edits

    fn edited_main(&mut self) -> String {
        let (name, required) = (self.callables[0].name.clone(), self.callables[0].required);
        let (args, other) =
            (&["(list 1)", "(list 1 2)"][required - 1], &["(list 2)", "(list 3 1)"][required - 1]);
        let mut bindings = String::new();
        let mut tree = String::from("t");
        for number in 0..1 + self.dice.below(5) {
            bindings += &format!(" (t{number} (try-edit {tree} (lambda () {})))", self.edit());
            tree = format!("t{number}");
        }
        format!(
            "{EDITING}(def-plan main () (let* ((t (run-plan {name} :args {args})){bindings} \
             (again (run-plan {name} :args {args} :tree {tree})) (other (run-plan {name} :args {other} :tree {tree}))) \
             (list t again other (length (tree-edits {tree})) (tree-paths again))))\n"
        )
    }

    fn edit(&mut self) -> String {
        let at = format!("(pick t {})", self.dice.below(60));
        let guard = if self.dice.chance(20) {
            format!(" :guard {{:a {}}}", self.dice.below(4))
        } else {
            String::new()
        };
        if self.focus == Focus::Obligations && self.dice.chance(65) {
            return self.put_off(&at, &guard);
        }
        // Nor from below a call that is wrapped.
        match self.dice.below(if self.focus == Focus::Obligations { 9 } else { 12 }) {
            0 => format!("(skip {at}{guard})"),
            1 => format!("(skip {at} :value {}{guard})", self.dice.below(9)),
            2..=4 => format!("(replace {at} '{}{guard})", self.edit_code(true)),
            5 => format!("(before {at} '{}{guard})", self.edit_code(false)),
            6 => format!("(after {at} '{}{guard})", self.edit_code(false)),
            7 | 8 => {
                let key = self.dice.pick(&["a", "b", "x", "o"]);
                format!("(with-param {at} :{key} {}{guard})", self.dice.below(9))
            }
            _ => format!("(wrap {at} '{}{guard})", self.edit_code(true)),
        }
    }

    fn put_off(&mut self, at: &str, guard: &str) -> String {
        let one = |it: &mut Self| format!("(pick-below t {})", it.dice.below(60));
        let at = at.replace("(pick ", "(pick-below ");
        if self.dice.chance(20) {
            let (code, name) = (self.edit_code(false), self.dice.pick(&["due", "debt"]));
            let after = format!("(list {} {} {})", one(self), one(self), one(self));
            return format!("(owe {at} '{code} :after {after} :as '{name}{guard}{ANYWHERE})");
        }
        let after = match self.dice.below(4) {
            0 => format!("(list {} {})", one(self), one(self)),
            _ => one(self),
        };
        format!("(defer {at} :after {after}{guard}{ANYWHERE})")
    }

    fn edit_code(&mut self, original: bool) -> String {
        let call = match self.dice.below(5) {
            0 => "(leaf 8)".to_string(),
            1 => "(leaf a)".into(),
            2 => "(fail f1 :what 9)".into(),
            3 => format!("(dolist (x '(1 2 1)) (when (< x {}) (leaf x)))", self.dice.below(4)),
            _ => "(print 'edit)".into(),
        };
        if !original {
            return call;
        }
        match self.dice.below(10) {
            0 => "(original)".into(),
            1 => format!("(seq {call} (original))"),
            2 => "(seq (original) (original))".into(),
            3 => call,
            4 => "(dotimes (i 2 'twice) (original))".into(),
            5 => format!("(unwind-protect (original) {call})"),
            6 => "(with-failure-handling ((f1 (e) (return 'handled))) (original))".into(),
            7 => "(with-retry-counters ((n 2)) (with-failure-handling ((failure (e) (do-retry n (retry)))) (original)))".into(),
            8 => format!("(let ((v (original))) {call} v)"),
            _ => "(with-retry-counters ((n 1)) (with-failure-handling ((f1 (e) (do-retry n (retry)) (return 5))) (seq (original) (original))))".into(),
        }
    }

    // ------------------------------------------------------------------ statements

    fn body(&mut self, scope: &mut Scope, depth: usize) -> String {
        let count = 1 + self.dice.below(3);
        let parts: Vec<String> = (0..count).map(|_| self.statement(scope, depth)).collect();
        parts.join(" ")
    }

    /// A body whose scope is its own.
    fn inner(&mut self, scope: &Scope, depth: usize) -> String {
        self.body(&mut scope.clone(), depth)
    }

    fn statement(&mut self, scope: &mut Scope, depth: usize) -> String {
        if self.size == 0 || depth == 0 {
            return self.leaf(scope);
        }
        self.size -= 1;
        match self.dice.below(24) {
            0..=3 => self.call(scope),
            4 => self.if_(scope, depth),
            5 => self.let_(scope, depth),
            6 | 7 => self.dolist(scope, depth),
            8 => self.counted_loop(scope, depth),
            9..=12 => self.handler(scope, depth),
            13 | 14 => {
                let (body, cleanup) = (self.inner(scope, depth - 1), self.inner(scope, depth - 1));
                format!("(unwind-protect (seq {body}) {cleanup})")
            }
            15 => self.higher_order(scope, depth),
            16 => self.perform(scope),
            17 => self.case(scope, depth),
            18 => {
                let (a, b) = (self.inner(scope, depth - 1), self.inner(scope, depth - 1));
                let word = self.dice.pick(&["and", "or"]);
                format!("({word} (seq {a}) (seq {b}))")
            }
            19 => self.set(scope),
            20 => format!("(list {} {})", self.call(scope), self.statement(scope, depth - 1)),
            21 => format!(
                "({} {} {})",
                self.dice.pick(&["down", "up"]),
                self.dice.below(3),
                self.number(scope, 1)
            ),
            _ => self.leaf(scope),
        }
    }

    fn leaf(&mut self, scope: &mut Scope) -> String {
        match self.dice.below(12) {
            0 | 1 => format!("(print '{} {})", self.dice.pick(&["a", "b", "c"]), self.number(scope, 1)),
            2 | 3 => self.fail(scope),
            4 => self.call(scope),
            5 if scope.can_return => {
                format!("(when {} (return {}))", self.test(scope), self.number(scope, 1))
            }
            6 if scope.in_clause => "(propagate)".into(),
            7 if !scope.counters.is_empty() && scope.in_clause => {
                let counter = scope.counters[self.dice.below(scope.counters.len())].clone();
                format!("(do-retry {counter} (retry))")
            }
            8 => self.set(scope),
            _ => self.number(scope, 2),
        }
    }

    fn fail(&mut self, scope: &mut Scope) -> String {
        let failures: Vec<String> =
            scope.vars.iter().filter(|var| var.kind == Kind::Failure).map(|var| var.name.clone()).collect();
        let what = self.number(scope, 1);
        let form = match self.dice.below(8) {
            0 if !failures.is_empty() => format!("(fail {})", failures[self.dice.below(failures.len())]),
            1 => format!("(fail (make-failure f1 :what {what}))"),
            2 => "(first 5)".into(),
            _ => format!("(fail {} :what {what})", self.dice.pick(&["f1", "f2", "f3", "plan-failure"])),
        };
        if self.dice.chance(25) { form } else { format!("(when {} {form})", self.test(scope)) }
    }

    fn set(&mut self, scope: &mut Scope) -> String {
        let names: Vec<String> =
            scope.vars.iter().filter(|var| var.changes).map(|var| var.name.clone()).collect();
        if names.is_empty() {
            return self.number(scope, 1);
        }
        let name = names[self.dice.below(names.len())].clone();
        format!("(set! {name} {})", self.number(scope, 2))
    }

    fn if_(&mut self, scope: &mut Scope, depth: usize) -> String {
        let test = self.test(scope);
        let (a, b) = (self.inner(scope, depth - 1), self.inner(scope, depth - 1));
        match self.dice.below(4) {
            0 => format!("(when {test} {a})"),
            1 => format!("(unless {test} {a})"),
            2 => format!("(cond ({test} {a}) ({} {b}) (true nil))", self.test(scope)),
            _ => format!("(if {test} (seq {a}) (seq {b}))"),
        }
    }

    fn case(&mut self, scope: &mut Scope, depth: usize) -> String {
        let subject = self.number(scope, 2);
        let (a, b) = (self.inner(scope, depth - 1), self.inner(scope, depth - 1));
        let c = self.inner(scope, depth - 1);
        format!("(case {subject} (1 {a}) ((2 3 a) {b}) (otherwise {c}))")
    }

    fn let_(&mut self, scope: &mut Scope, depth: usize) -> String {
        let changes = self.dice.chance(50);
        let name = self.fresh(if changes { "m" } else { "v" });
        let value = if self.dice.chance(40) { self.call(scope) } else { self.number(scope, 2) };
        let mut inner = scope.clone();
        // What a call returns may be anything.
        inner.vars.push(Var { name: name.clone(), kind: Kind::Number, changes });
        format!("(let (({name} {value})) {})", self.body(&mut inner, depth - 1))
    }

    fn dolist(&mut self, scope: &mut Scope, depth: usize) -> String {
        let name = self.fresh("x");
        let list = self.list(scope);
        let mut inner = scope.clone();
        inner.vars.push(Var { name: name.clone(), kind: Kind::Number, changes: false });
        (inner.can_return, inner.loops) = (true, scope.loops + 1);
        format!("(dolist ({name} {list}) {})", self.body(&mut inner, depth - 1))
    }

    fn counted_loop(&mut self, scope: &mut Scope, depth: usize) -> String {
        let name = self.fresh("i");
        let rounds = if scope.loops > 0 { 1 + self.dice.below(2) } else { 1 + self.dice.below(3) };
        let mut inner = scope.clone();
        inner.vars.push(Var { name: name.clone(), kind: Kind::Number, changes: false });
        (inner.can_return, inner.loops) = (true, scope.loops + 1);
        if self.dice.chance(50) {
            let result = self.number(scope, 1);
            return format!("(dotimes ({name} {rounds} {result}) {})", self.body(&mut inner, depth - 1));
        }
        // Functions must not capture a variable that changes.
        inner.vars.pop();
        let body = self.body(&mut inner, depth - 1);
        if self.dice.chance(50) {
            format!("(let (({name} 0)) (while (< {name} {rounds}) (set! {name} (+ {name} 1)) {body}))")
        } else {
            format!(
                "(let (({name} 0)) (loop (when (= {name} {rounds}) (return {name})) (set! {name} (+ {name} 1)) {body}))"
            )
        }
    }

    fn handler(&mut self, scope: &mut Scope, depth: usize) -> String {
        let counter = self.fresh("n");
        let mut inner = scope.clone();
        inner.counters.push(counter.clone());
        // What `(propagate)` means in a body that stands in a clause is an open question.
        let body = self.body(&mut Scope { in_clause: false, ..scope.clone() }, depth - 1);
        let mut clauses = String::new();
        for _ in 0..1 + self.dice.below(2) {
            let name = self.fresh("e");
            let kind = match self.dice.below(8) {
                0 => "(or f2 program-error)",
                _ => self.dice.pick(FAILURES),
            };
            let mut clause = inner.clone();
            clause.vars.push(Var { name: name.clone(), kind: Kind::Failure, changes: false });
            (clause.can_return, clause.in_clause) = (true, true);
            let first = if self.dice.chance(30) {
                self.body(&mut clause, depth.saturating_sub(2))
            } else {
                String::new()
            };
            let second = match self.dice.below(6) {
                0 | 1 => format!("(do-retry {counter} (retry))"),
                2 => format!("(do-retry {counter} (print 'again) (retry))"),
                3 => "(propagate)".into(),
                _ => String::new(),
            };
            let third = match self.dice.below(6) {
                0 | 1 => format!("(return {})", self.number(&clause, 1)),
                2 => format!("(fail f2 :what {})", self.number(&clause, 1)),
                3 => format!("(fail {name})"),
                _ => String::new(),
            };
            clauses += &format!("({kind} ({name}) {first} {second} {third})");
        }
        let count = self.dice.below(3);
        format!("(with-retry-counters (({counter} {count})) (with-failure-handling ({clauses}) {body}))")
    }

    fn higher_order(&mut self, scope: &mut Scope, depth: usize) -> String {
        let name = self.fresh("y");
        let mut inner = scope.clone();
        inner.vars.retain(|var| !var.changes);
        inner.counters.clear();
        (inner.can_return, inner.in_clause, inner.loops) = (false, false, scope.loops + 1);
        inner.vars.push(Var { name: name.clone(), kind: Kind::Number, changes: false });
        let body = self.body(&mut inner, depth - 1);
        let list = self.list(scope);
        let lambda = format!("(lambda ({name}) {body}{})", self.no_tail(&format!(" {name}")));
        match self.dice.below(6) {
            0 | 1 => format!("(map {lambda} {list})"),
            2 => format!("(funcall {lambda} {})", self.number(scope, 1)),
            3 => {
                let f = self.fresh("h");
                let mut inner = scope.clone();
                inner.vars.push(Var { name: f.clone(), kind: Kind::Function, changes: false });
                format!("(let (({f} {lambda})) {})", self.body(&mut inner, depth - 1))
            }
            4 => format!("(map leaf {list})"),
            _ => format!("(find-if {lambda} {list})"),
        }
    }

    fn perform(&mut self, scope: &mut Scope) -> String {
        let action = self.dice.pick(ACTIONS);
        // What `act1` grounds to may be called by earlier definitions only.
        let last = self.callables.iter().rposition(|it| it.is_plan).unwrap_or(0);
        let action = if action == "act1" && scope.from > last { "act0" } else { action };
        let goal = match self.dice.below(5) {
            0 => " :goal (= (random 2) 0)",
            1 => " :goal false",
            2 => " :goal (= (random 3) 0)",
            3 => " :goal true",
            _ => "",
        };
        format!("(perform (an action (type {action}) (x ,{})){goal})", self.number(scope, 1))
    }

    /// A call of a plan or function.
    fn call(&mut self, scope: &Scope) -> String {
        let functions: Vec<String> =
            scope.vars.iter().filter(|var| var.kind == Kind::Function).map(|var| var.name.clone()).collect();
        if !functions.is_empty() && self.dice.chance(40) {
            let f = functions[self.dice.below(functions.len())].clone();
            return format!("({f} {})", self.number(scope, 1));
        }
        let later = self.callables.len() - scope.from;
        if later == 0 || self.dice.chance(20) {
            return format!("(leaf {})", self.number(scope, 1));
        }
        let at = scope.from + self.dice.below(later);
        let Callable { name, required, optional, keys, rest, .. } = self.callables[at].clone();
        let mut args: Vec<String> = (0..required).map(|_| self.number(scope, 1)).collect();
        let all_optional = optional == 0 || self.dice.chance(50);
        if optional > 0 && all_optional {
            args.push(self.number(scope, 1));
        }
        if all_optional && !keys.is_empty() {
            for key in ["k1", "k2"] {
                if self.dice.chance(40) {
                    args.push(format!(":{key} {}", self.number(scope, 1)));
                }
            }
        }
        if all_optional && rest {
            for _ in 0..self.dice.below(3) {
                args.push(self.number(scope, 1));
            }
        }
        format!("({name} {})", args.join(" "))
    }

    // ------------------------------------------------------------------ expressions

    fn test(&mut self, scope: &Scope) -> String {
        match self.dice.below(8) {
            0..=2 => format!("(= (random {}) 0)", 2 + self.dice.below(3)),
            3 => format!("(equal? {} {})", self.number(scope, 1), self.number(scope, 1)),
            4 => format!("(not (equal? {} {}))", self.number(scope, 1), self.dice.below(3)),
            5 => format!("(or (= (random 3) 0) (equal? {} 1))", self.number(scope, 1)),
            6 => format!("(and (< (random 3) 2) (equal? {} 1))", self.number(scope, 1)),
            _ => self.dice.pick(&["true", "nil", "(< (random-float) 0.5)"]).into(),
        }
    }

    /// Most often a number: variables may hold what calls returned.
    fn number(&mut self, scope: &Scope, depth: usize) -> String {
        let vars: Vec<String> =
            scope.vars.iter().filter(|var| var.kind == Kind::Number).map(|var| var.name.clone()).collect();
        match self.dice.below(10) {
            0..=4 if !vars.is_empty() => vars[self.dice.below(vars.len())].clone(),
            5 => format!("(random {})", 1 + self.dice.below(5)),
            6 if depth > 1 => {
                format!("(list {} {})", self.number(scope, depth - 1), self.number(scope, depth - 1))
            }
            7 if depth > 1 && self.dice.chance(20) => format!("(+ {} 1)", self.number(scope, depth - 1)),
            8 if depth > 1 => {
                format!("(equal? {} {})", self.number(scope, depth - 1), self.number(scope, depth - 1))
            }
            _ => self.dice.below(5).to_string(),
        }
    }

    fn list(&mut self, scope: &Scope) -> String {
        let lists: Vec<String> =
            scope.vars.iter().filter(|var| var.kind == Kind::List).map(|var| var.name.clone()).collect();
        if !lists.is_empty() && self.dice.chance(40) {
            return lists[self.dice.below(lists.len())].clone();
        }
        let most = if scope.loops > 0 { 2 } else { 4 };
        let items: Vec<&str> = (0..self.dice.below(most + 1)).map(|_| self.dice.pick(ELEMENTS)).collect();
        match self.dice.below(5) {
            0 => format!("[{}]", items.iter().map(|item| format!("'{item}")).collect::<Vec<_>>().join(" ")),
            1 => format!("(list leaf {} leaf)", self.number(scope, 1)),
            _ => format!("'({})", items.join(" ")),
        }
    }
}
