//! Fluents against a naive model: random cells, derived fluents, pulses, waiters and watchers.
//!
//! After each change the values are those that the model computes anew from the cells; each derived fluent
//! has been computed once if something that it reads has changed, else not at all, and has seen no old value
//! beside a new one; and those are woken whom the model wakes, in the next round.

use pleach::{Options, Session};

use crate::dice::Dice;

/// Programs of so many changes each.
const PROGRAMS: u64 = 250;
const CHANGES: usize = 400;

/// What a fluent holds.
#[derive(Debug, Clone, PartialEq)]
enum Held {
    Bool(bool),
    Int(i64),
    List(Vec<Held>),
}

impl Held {
    fn is_true(&self) -> bool {
        *self != Held::Bool(false)
    }
    /// What the function `num` of the program makes of it.
    fn number(&self) -> i64 {
        if let Held::Int(n) = self { *n } else { 0 }
    }
    fn text(&self) -> String {
        match self {
            Held::Bool(b) => b.to_string(),
            Held::Int(n) => n.to_string(),
            Held::List(items) => {
                format!("({})", items.iter().map(Held::text).collect::<Vec<_>>().join(" "))
            }
        }
    }
}

/// An expression over two fluents, by their numbers.
#[derive(Clone, Copy)]
enum Expression {
    Sum,
    And,
    Or,
    Not,
    Equal,
    If,
    Pair,
}

const EXPRESSIONS: &[Expression] = &[
    Expression::Sum,
    Expression::And,
    Expression::Or,
    Expression::Not,
    Expression::Equal,
    Expression::If,
    Expression::Pair,
];

impl Expression {
    fn text(self, a: &str, b: &str) -> String {
        match self {
            Expression::Sum => format!("(mod (+ (num {a}) (num {b})) 4)"),
            Expression::And => format!("(and {a} {b})"),
            Expression::Or => format!("(or {a} {b})"),
            Expression::Not => format!("(if {b} (not {a}) (not {a}))"),
            Expression::Equal => format!("(equal? {a} {b})"),
            Expression::If => format!("(if {a} {b} false)"),
            Expression::Pair => format!("(list (num {a}) (num {b}))"),
        }
    }
    fn of(self, a: &Held, b: &Held) -> Held {
        match self {
            Expression::Sum => Held::Int((a.number() + b.number()).rem_euclid(4)),
            Expression::And => if a.is_true() { b } else { a }.clone(),
            Expression::Or => if a.is_true() { a } else { b }.clone(),
            Expression::Not => Held::Bool(!a.is_true()),
            Expression::Equal => Held::Bool(a == b),
            Expression::If => {
                if a.is_true() {
                    b.clone()
                } else {
                    Held::Bool(false)
                }
            }
            Expression::Pair => Held::List(vec![Held::Int(a.number()), Held::Int(b.number())]),
        }
    }
}

/// What `whenever` makes of rises while its body waits for its turn.
#[derive(Clone, Copy, PartialEq)]
enum Missed {
    Never,
    Once,
    Always,
}

/// `(whenever fluent (print "rise" n))` in a task of its own.
struct Watcher {
    of: usize,
    missed: Missed,
    /// Its body is to run: how often.
    due: usize,
}

/// `(loop (wait-for fluent) (wait-for (fl (not fluent))))` in a task of its own.
struct Waiter {
    of: usize,
    /// It waits for a true value, or for none.
    for_true: bool,
    /// What has woken it.
    woken: Option<Held>,
}

/// Fluents in the order of their making: cells first.
struct Model {
    dice: Dice,
    cells: usize,
    derived: Vec<(Expression, usize, usize)>,
    values: Vec<Held>,
    watchers: Vec<Watcher>,
    waiters: Vec<Waiter>,
    /// The lines of the program.
    expected: Vec<String>,
}

fn name(fluent: usize) -> String {
    format!("f{fluent}")
}

impl Model {
    fn new(seed: u64) -> Model {
        let mut it = Model {
            dice: Dice::new(seed ^ 0xF1),
            cells: 0,
            derived: Vec::new(),
            values: Vec::new(),
            watchers: Vec::new(),
            waiters: Vec::new(),
            expected: Vec::new(),
        };
        it.cells = 1 + it.dice.below(4);
        for _ in 0..it.cells {
            let value = it.value();
            it.values.push(value);
        }
        for _ in 0..1 + it.dice.below(10) {
            let known = it.values.len();
            let (a, b) = (it.dice.below(known), it.dice.below(known));
            let expression = EXPRESSIONS[it.dice.below(EXPRESSIONS.len())];
            it.derived.push((expression, a, b));
            it.values.push(expression.of(&it.values[a], &it.values[b]));
        }
        let known = it.values.len();
        for _ in 0..it.dice.below(4) {
            let missed = [Missed::Never, Missed::Once, Missed::Always][it.dice.below(3)];
            let of = it.dice.below(known);
            let due = usize::from(it.values[of].is_true());
            it.watchers.push(Watcher { of, missed, due });
        }
        for _ in 0..it.dice.below(4) {
            let of = it.dice.below(known);
            let woken = Some(it.values[of].clone()).filter(Held::is_true);
            it.waiters.push(Waiter { of, for_true: true, woken });
        }
        it
    }

    fn value(&mut self) -> Held {
        match self.dice.below(3) {
            0 => Held::Bool(self.dice.below(2) == 0),
            _ => Held::Int(self.dice.below(4) as i64),
        }
    }

    // ------------------------------------------------------------------ the program

    /// The program, which does the changes; what it must print is known then.
    fn program(&mut self) -> String {
        let mut bindings = String::new();
        for (at, value) in self.values[..self.cells].iter().enumerate() {
            bindings += &format!("({} (fluent {}))", name(at), value.text());
        }
        for (at, (expression, a, b)) in self.derived.iter().enumerate() {
            let at = at + self.cells;
            let text = expression.text(&name(*a), &name(*b));
            bindings += &format!("({} (fl (computed {at} {text})))", name(at));
        }
        let mut tasks = String::new();
        for (at, watcher) in self.watchers.iter().enumerate() {
            let missed = match watcher.missed {
                Missed::Never => ":never",
                Missed::Once => ":once",
                Missed::Always => ":always",
            };
            bindings += &format!("(w{at} (fl-pulsed {} :handle-missed-pulses {missed}))", name(watcher.of));
            tasks += &format!("(whenever w{at} (print \"rise\" {at}))");
        }
        for (at, waiter) in self.waiters.iter().enumerate() {
            let of = name(waiter.of);
            bindings += &format!("(n{at} (fl (not {of})))");
            tasks += &format!(
                "(loop (print \"true\" {at} (wait-for {of})) (wait-for n{at}) (print \"false\" {at}))"
            );
        }
        let all: String = (0..self.values.len()).map(|at| format!(" (value {})", name(at))).collect();
        let cells: String = (0..self.cells).map(|at| format!(" {}", name(at))).collect();
        let changes = self.changes();
        format!(
            "(def-fun computed (n x) (print \"computed\" n x) x)
             (def-fun num (x) (if (number? x) x 0))
             (def-plan main ()
               (let* ({bindings})
                 (print \"begin\")
                 (pursue {tasks}
                   (let ((cells (list {cells})))
                     (dolist (change '({changes}))
                       (case (first change)
                         (set (set-value (nth (second change) cells) (third change)) (print \"all\"{all}))
                         (pulse (pulse (nth (second change) cells)) (print \"pulsed\"))
                         (otherwise (print \"sleeps\") (sleep 0) (sleep 0))))))))"
        )
    }

    fn changes(&mut self) -> String {
        let mut out = String::new();
        // The other tasks stand before this one.
        self.tasks_run();
        // Few changes in one turn: it must not use up its quantum.
        let mut in_turn = 0;
        for _ in 0..CHANGES {
            let cell = self.dice.below(self.cells);
            if self.dice.below(5) == 0 {
                out += &format!("(pulse {cell})");
                self.pulse(cell);
            } else {
                let value = self.value();
                out += &format!("(set {cell} {})", value.text());
                self.set(cell, value);
            }
            in_turn += 1;
            if in_turn == 4 || self.dice.below(2) == 0 {
                in_turn = 0;
                out += "(sleep)";
                self.sleeps();
            }
        }
        out
    }

    // ------------------------------------------------------------------ what it means

    fn set(&mut self, cell: usize, value: Held) {
        let old = self.values.clone();
        self.values[cell] = value;
        let mut lines = Vec::new();
        for (at, (expression, a, b)) in self.derived.iter().enumerate() {
            let at = at + self.cells;
            let now = expression.of(&self.values[*a], &self.values[*b]);
            if self.values[*a] != old[*a] || self.values[*b] != old[*b] {
                lines.push(format!("computed {at} {}", now.text()));
            }
            assert!(now == old[at] || !lines.is_empty());
            self.values[at] = now;
        }
        self.expected.extend(lines);
        let all: String = self.values.iter().map(|value| format!(" {}", value.text())).collect();
        self.expected.push(format!("all{all}"));
        for at in 0..self.watchers.len() {
            let of = self.watchers[at].of;
            if self.values[of].is_true() && !old[of].is_true() {
                self.rise(at);
            }
        }
        for waiter in &mut self.waiters {
            let value = &self.values[waiter.of];
            if waiter.woken.is_none() && value.is_true() == waiter.for_true {
                waiter.woken = Some(value.clone());
            }
        }
    }

    fn pulse(&mut self, cell: usize) {
        self.expected.push("pulsed".into());
        for at in 0..self.watchers.len() {
            if self.watchers[at].of == cell {
                self.rise(at);
            }
        }
    }

    fn rise(&mut self, watcher: usize) {
        let it = &mut self.watchers[watcher];
        let most = match it.missed {
            Missed::Never => 1,
            Missed::Once => 2,
            Missed::Always => usize::MAX,
        };
        it.due = (it.due + 1).min(most);
    }

    /// All who were woken have their turns.
    fn sleeps(&mut self) {
        self.expected.push("sleeps".into());
        self.tasks_run();
    }

    fn tasks_run(&mut self) {
        let mut lines = Vec::new();
        for (at, watcher) in self.watchers.iter_mut().enumerate() {
            lines.extend((0..std::mem::take(&mut watcher.due)).map(|_| format!("rise {at}")));
        }
        for (at, waiter) in self.waiters.iter_mut().enumerate() {
            let mut woken = waiter.woken.take();
            while let Some(value) = woken {
                match waiter.for_true {
                    true => lines.push(format!("true {at} {}", value.text())),
                    false => lines.push(format!("false {at}")),
                }
                waiter.for_true = !waiter.for_true;
                let now = &self.values[waiter.of];
                woken = (now.is_true() == waiter.for_true).then(|| now.clone());
            }
        }
        self.expected.extend(lines);
    }
}

/// The lines of a program, those sorted that have no order.
fn sorted<'t>(lines: impl Iterator<Item = &'t str>) -> Vec<String> {
    let (mut out, mut free): (Vec<String>, Vec<String>) = (Vec::new(), Vec::new());
    for line in lines {
        let is_free = ["computed", "rise", "true", "false"].iter().any(|word| line.starts_with(word));
        if is_free {
            free.push(line.into());
            continue;
        }
        free.sort();
        out.append(&mut free);
        out.push(line.into());
    }
    free.sort();
    out.append(&mut free);
    out
}

#[test]
fn fluents_are_as_the_model_says() {
    let mut woken = 0;
    for seed in 0..PROGRAMS {
        let mut model = Model::new(seed);
        let program = model.program();
        let run = Session::new(Options { seed, ..Options::default() }).run_text("fluents.plan", &program);
        let shown = || grammar::format(&program).unwrap_or_else(|_| program.clone());
        assert!(run.outcome.is_ok(), "seed {seed}: {:?} {}\n{}", run.outcome, run.diagnostics, shown());
        let printed = sorted(run.printed.lines().skip_while(|line| *line != "begin").skip(1));
        let expected = sorted(model.expected.iter().map(String::as_str));
        woken += printed.iter().filter(|line| line.starts_with("true")).count();
        if let Some(at) =
            (0..printed.len().max(expected.len())).find(|at| printed.get(*at) != expected.get(*at))
        {
            let (from, to) = (at.saturating_sub(12), at + 4);
            let part = |lines: &[String]| lines[from.min(lines.len())..to.min(lines.len())].join("\n");
            panic!(
                "seed {seed}, line {at}\n{}\nbut should be\n{}\n{}",
                part(&printed),
                part(&expected),
                shown()
            );
        }
    }
    assert!(woken > 1000, "waiters were woken {woken} times");
}
