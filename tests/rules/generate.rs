//! Random programs as Prolog text: small domains, all of Prolog's control, and they end.
//!
//! A predicate calls such as were made before it, or itself with a shorter list or a smaller number;
//! tabled ones call each other as they like over a finite graph. In a compound term Prolog and we differ: `f(X)`
//! is a list here. So a program has either compound terms or lists in its data, never both.

use crate::dice::Dice;

/// Some programs in one text. Program `n` is asked by the goal `t<n>w(Answer)`.
pub struct Batch {
    pub text: String,
    pub programs: usize,
    /// Answers have no order.
    pub tabled: bool,
}

/// What the programs of a batch are about.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Theme {
    Control,
    Tabling,
    Joins,
}

pub fn batch(seed: u64, programs: usize, theme: Theme) -> Batch {
    let mut text = String::new();
    for number in 0..programs {
        text += &program(seed, number, theme);
    }
    Batch { text, programs, tabled: theme == Theme::Tabling }
}

/// The text of one program of a batch.
pub fn program(seed: u64, number: usize, theme: Theme) -> String {
    let mut it = Program {
        dice: Dice::new(seed.wrapping_mul(1009).wrapping_add(number as u64)),
        name: format!("t{number}"),
        lists: false,
        text: String::new(),
        facts: Vec::new(),
        rules: Vec::new(),
        counters: Vec::new(),
        walkers: Vec::new(),
        seen: Vec::new(),
        vars: 0,
    };
    it.lists = it.dice.chance(50);
    match theme {
        Theme::Control => it.control(),
        Theme::Tabling => it.tabling(),
        Theme::Joins => it.joins(),
    }
    it.text
}

struct Program {
    dice: Dice,
    name: String,
    /// Data is made of lists, or else of compound terms.
    lists: bool,
    text: String,
    /// Predicates whose arguments are constants: name and number of arguments.
    facts: Vec<(String, usize)>,
    rules: Vec<(String, usize)>,
    /// Those that count down in their first argument, which is followed by another one.
    counters: Vec<String>,
    /// Those that go through a list, or a chain of compound terms.
    walkers: Vec<String>,
    /// Variables of the clause that a goal before may have given a value.
    seen: Vec<String>,
    vars: usize,
}

const CONSTANTS: [&str; 6] = ["a", "b", "c", "1", "2", "3"];

impl Program {
    fn percent(&mut self, percent: usize) -> bool {
        self.dice.chance(percent)
    }

    fn clause(&mut self, head: &str, goals: &[String]) {
        let body = if goals.is_empty() { String::new() } else { format!(" :-\n  {}", goals.join(",\n  ")) };
        self.text += &name_singletons(&format!("{head}{body}.\n"));
    }

    fn facts(&mut self, n: usize, most_rows: usize, constants: &[&str]) {
        for number in 0..n {
            let (name, arity) = (format!("{}f{number}", self.name), 1 + self.dice.below(3));
            let rows = 1 + self.dice.below(most_rows);
            for _ in 0..rows {
                let args: Vec<&str> = (0..arity).map(|_| self.dice.pick(constants)).collect();
                self.text += &format!("{name}({}).\n", args.join(","));
            }
            self.facts.push((name, arity));
        }
    }

    /// `w(Answer)` asks for three variables.
    fn question(&mut self, goals: usize, tabled: bool) {
        (self.seen, self.vars) = (Vec::new(), 0);
        let mut body = Vec::new();
        for _ in 0..goals {
            let goal = if tabled { self.call() } else { self.goal(2, true) };
            body.push(goal);
        }
        let answer: Vec<String> = (0..3).map(|_| self.seen_or_constant()).collect();
        // What the answer says of variables without a value has to be a variable there, too.
        let end = if self.lists { "[]" } else { "end" };
        body.push(format!("Answer = [{},{end}]", answer.join(",")));
        let head = format!("{}w(Answer)", self.name);
        self.clause(&head, &body);
    }

    // -------------------------------------------------------------------------------- control

    fn control(&mut self) {
        let n = 1 + self.dice.below(3);
        self.facts(n, 5, &CONSTANTS);
        self.open_facts();
        for number in 0..1 + self.dice.below(4) {
            self.rule(number);
            if self.percent(40) {
                self.counter(number);
            }
            if self.percent(40) {
                self.walker(number);
            }
        }
        let goals = 1 + self.dice.below(3);
        self.question(goals, false);
    }

    /// Facts with structure and variables in them.
    fn open_facts(&mut self) {
        let (name, arity) = (format!("{}o", self.name), 1 + self.dice.below(3));
        for _ in 0..1 + self.dice.below(5) {
            (self.seen, self.vars) = (Vec::new(), 0);
            let head = self.head(&name, arity);
            self.clause(&head, &[]);
        }
        self.rules.push((name, arity));
    }

    fn head(&mut self, name: &str, arity: usize) -> String {
        let args: Vec<String> = (0..arity)
            .map(|_| match self.dice.below(10) {
                0..6 => self.new_var(),
                6 => self.seen_or_constant(),
                _ => self.term(2),
            })
            .collect();
        format!("{name}({})", args.join(","))
    }

    fn rule(&mut self, number: usize) {
        let (name, arity) = (format!("{}p{number}", self.name), 1 + self.dice.below(3));
        for _ in 0..1 + self.dice.below(3) {
            (self.seen, self.vars) = (Vec::new(), 0);
            let head = self.head(&name, arity);
            let goals = self.dice.below(4);
            let body: Vec<String> = (0..goals).map(|_| self.goal(3, true)).collect();
            self.clause(&head, &body);
        }
        self.rules.push((name, arity));
    }

    fn counter(&mut self, number: usize) {
        let name = format!("{}n{number}", self.name);
        let cut = if self.percent(30) { vec!["!".to_string()] } else { Vec::new() };
        (self.seen, self.vars) = (Vec::new(), 0);
        let base = self.term(1);
        self.clause(&format!("{name}(0,{base})"), &cut);
        for _ in 0..1 + self.dice.below(2) {
            (self.seen, self.vars) = (vec!["N".into(), "X".into()], 0);
            let mut body = vec!["N > 0".to_string()];
            body.extend((0..self.dice.below(2)).map(|_| self.goal(2, true)));
            body.push("M is N - 1".into());
            self.seen.push("M".into());
            let result = if self.percent(50) { self.new_var() } else { self.term(2) };
            body.push(format!("{name}(M,{result})"));
            body.extend((0..self.dice.below(3)).map(|_| self.goal(2, true)));
            self.clause(&format!("{name}(N,X)"), &body);
        }
        self.counters.push(name);
    }

    fn walker(&mut self, number: usize) {
        let name = format!("{}l{number}", self.name);
        let (end, step) = if self.lists { ("[]", "[H|T]") } else { ("z", "s(H,T)") };
        (self.seen, self.vars) = (Vec::new(), 0);
        let base = self.term(1);
        self.clause(&format!("{name}({end},{base})"), &[]);
        for _ in 0..1 + self.dice.below(2) {
            (self.seen, self.vars) = (vec!["H".into()], 0);
            let given = if self.percent(50) { self.new_var() } else { self.term(2) };
            let mut body: Vec<String> = (0..self.dice.below(2)).map(|_| self.goal(2, true)).collect();
            let result = if self.percent(50) { self.new_var() } else { self.term(2) };
            body.push(format!("{name}(T,{result})"));
            body.extend((0..self.dice.below(2)).map(|_| self.goal(2, true)));
            self.clause(&format!("{name}({step},{given})"), &body);
        }
        self.walkers.push(name);
    }

    // -------------------------------------------------------------------------------- terms

    fn new_var(&mut self) -> String {
        self.vars += 1;
        let var = format!("V{}", self.vars);
        self.seen.push(var.clone());
        var
    }

    fn seen_var(&mut self) -> Option<String> {
        match self.seen.len() {
            0 => None,
            n => Some(self.seen[self.dice.below(n)].clone()),
        }
    }

    fn constant(&mut self) -> String {
        self.dice.pick(&CONSTANTS).to_string()
    }

    fn seen_or_constant(&mut self) -> String {
        match self.percent(75) {
            true => self.seen_var().unwrap_or_else(|| "a".into()),
            false => self.constant(),
        }
    }

    fn term(&mut self, depth: usize) -> String {
        match self.dice.below(if depth == 0 { 6 } else { 10 }) {
            0 | 1 => self.constant(),
            2 | 3 => self.seen_or_constant(),
            4 => self.new_var(),
            5 => "_".into(),
            _ if self.lists => {
                let items: Vec<String> = (0..self.dice.below(4)).map(|_| self.term(depth - 1)).collect();
                match !items.is_empty() && self.percent(25) {
                    true => format!("[{}|{}]", items.join(","), self.seen_or_constant()),
                    false => format!("[{}]", items.join(",")),
                }
            }
            _ => {
                let arity = 1 + self.dice.below(3);
                let args: Vec<String> = (0..arity).map(|_| self.term(depth - 1)).collect();
                format!("{}({})", self.dice.pick(&["f", "g"]), args.join(","))
            }
        }
    }

    fn list(&mut self) -> String {
        let items: Vec<String> = (0..self.dice.below(4)).map(|_| self.term(1)).collect();
        format!("[{}]", items.join(","))
    }

    // -------------------------------------------------------------------------------- goals

    /// Goals within a goal whose new variables are not seen after it.
    fn inside(&mut self, depth: usize) -> String {
        let seen = self.seen.clone();
        let goal = self.goals(depth, false);
        self.seen = seen;
        goal
    }

    /// A goal or several.
    fn goals(&mut self, depth: usize, cut: bool) -> String {
        let goals: Vec<String> = (0..1 + self.dice.below(2)).map(|_| self.goal(depth, cut)).collect();
        format!("({})", goals.join(", "))
    }

    fn call(&mut self) -> String {
        let all = self.facts.len() + self.rules.len();
        let at = self.dice.below(all);
        let (name, arity) = self.facts.get(at).unwrap_or_else(|| &self.rules[at - self.facts.len()]).clone();
        let args: Vec<String> = (0..arity).map(|_| self.arg()).collect();
        format!("{name}({})", args.join(","))
    }

    fn arg(&mut self) -> String {
        match self.dice.below(10) {
            0..4 => self.new_var(),
            4..8 => self.seen_or_constant(),
            _ => self.term(2),
        }
    }

    fn call_of_fact(&mut self) -> (String, Vec<String>) {
        let at = self.dice.below(self.facts.len());
        let (name, arity) = self.facts[at].clone();
        (name, (0..arity).map(|_| format!("V{}", self.new_number())).collect())
    }

    fn new_number(&mut self) -> usize {
        self.vars += 1;
        self.vars
    }

    /// Some variables that have values then, and goals inside of which only these are seen.
    fn with_values(&mut self, goals: impl FnOnce(&mut Program) -> String) -> String {
        let all = self.seen.clone();
        self.seen = (0..self.dice.below(3)).filter_map(|_| self.seen_var()).collect();
        let tests: Vec<String> = self.seen.iter().map(|var| format!("ground({var}), ")).collect();
        let goal = goals(self);
        self.seen = all;
        format!("{}{goal}", tests.concat())
    }

    fn goal(&mut self, depth: usize, cut: bool) -> String {
        if depth == 0 {
            return self.call();
        }
        match self.dice.below(40) {
            0..10 => self.call(),
            10..13 => {
                let (a, b) = (self.arg(), self.term(3));
                format!("{a} = {b}")
            }
            13 => {
                let (a, b) = (self.seen_or_constant(), self.seen_or_constant());
                let op = self.dice.pick(&["==", "\\=="]);
                format!("{a} {op} {b}")
            }
            14 => self.with_values(|it| {
                let (a, b) = (it.seen_or_constant(), it.seen_or_constant());
                format!("{a} \\= {b}")
            }),
            15 | 16 => self.arithmetic(),
            17 | 18 if cut => "!".into(),
            17 | 18 => self.test(),
            19..22 => {
                let before = self.seen.clone();
                let test = self.goals(depth - 1, false);
                let then = self.goals(depth - 1, cut);
                let after = std::mem::replace(&mut self.seen, before);
                let arrow = self.dice.pick(&["->", "->", "*->"]);
                let otherwise = if self.percent(20) { None } else { Some(self.goals(depth - 1, cut)) };
                self.seen.extend(after);
                match otherwise {
                    Some(otherwise) => format!("({test} {arrow} {then} ; {otherwise})"),
                    None => format!("({test} {arrow} {then})"),
                }
            }
            22..25 => {
                let before = self.seen.clone();
                let mut seen = before.clone();
                let mut parts = Vec::new();
                for _ in 0..2 + self.dice.below(2) {
                    self.seen.clone_from(&before);
                    parts.push(self.goals(depth - 1, cut));
                    seen.append(&mut self.seen);
                }
                seen.sort();
                seen.dedup();
                self.seen = seen;
                format!("({})", parts.join(" ; "))
            }
            25 | 26 => self.with_values(|it| format!("\\+ {}", it.goals(depth - 1, false))),
            27 => self.with_values(|it| {
                let test = it.goals(depth - 1, false);
                format!("forall({test}, {})", it.inside(depth - 1))
            }),
            28 => format!("once({})", self.goals(depth - 1, false)),
            29 | 30 => self.findall(depth),
            31 => self.bag(),
            32 => {
                let x = self.arg();
                format!("member({x}, {})", self.list())
            }
            33 if self.lists => self.of_lists(),
            33 | 34 if !self.counters.is_empty() => {
                let at = self.dice.below(self.counters.len());
                let (name, n, x) = (self.counters[at].clone(), self.dice.below(5), self.arg());
                format!("{name}({n},{x})")
            }
            35 | 36 if !self.walkers.is_empty() => {
                let at = self.dice.below(self.walkers.len());
                let (name, x) = (self.walkers[at].clone(), self.arg());
                let items: Vec<String> = (0..self.dice.below(4)).map(|_| self.term(1)).collect();
                let walked = match self.lists {
                    true => format!("[{}]", items.join(",")),
                    false => items.iter().fold("z".to_string(), |rest, item| format!("s({item},{rest})")),
                };
                format!("{name}({walked},{x})")
            }
            37 => self.called(),
            38 => self.test(),
            _ => {
                let (low, high) = (self.dice.below(3), self.dice.below(5));
                format!("between({low},{high},{})", self.new_var())
            }
        }
    }

    fn test(&mut self) -> String {
        let name = self.dice.pick(&["var", "nonvar", "integer", "number", "ground", "true", "fail"]);
        match (name, self.seen_var()) {
            ("true" | "fail", _) | (_, None) => if name == "fail" { "fail" } else { "true" }.into(),
            (_, Some(var)) => format!("{name}({var})"),
        }
    }

    fn arithmetic(&mut self) -> String {
        let (Some(x), Some(y)) = (self.seen_var(), self.seen_var()) else { return "true".into() };
        // Without the tests it is an error in both languages.
        let tests = match self.percent(90) || self.lists {
            true => format!("integer({x}), integer({y}), "),
            false => String::new(),
        };
        let op = self.dice.pick(&["<", ">", "=<", ">=", "=:=", "=\\="]);
        let n = self.dice.below(4);
        match self.percent(50) {
            true => format!("{tests}{x} {op} {y} + {n}"),
            false => {
                let by = self.dice.pick(&["+", "-", "*"]);
                format!("{tests}{} is {x} {by} ({y} - {n})", self.new_var())
            }
        }
    }

    fn findall(&mut self, depth: usize) -> String {
        let seen = self.seen.clone();
        let goal = self.goals(depth - 1, false);
        let template = self.term(1);
        self.seen = seen;
        match self.lists {
            true => format!("findall({template}, {goal}, {})", self.arg()),
            false => {
                let list = format!("V{}", self.new_number());
                format!("findall({template}, {goal}, {list}), length({list}, {})", self.new_var())
            }
        }
    }

    fn bag(&mut self) -> String {
        let (name, vars) = self.call_of_fact();
        let args: Vec<String> = vars
            .iter()
            .map(|var| match self.dice.below(10) {
                // The template must be part of the goal, or all instances are alike.
                _ if *var == vars[0] => var.clone(),
                0 => self.constant(),
                1 => self.seen_or_constant(),
                _ => var.clone(),
            })
            .collect();
        let which = self.dice.pick(&["bagof", "setof"]);
        let hidden: String =
            vars[1..].iter().filter(|_| self.dice.chance(40)).map(|var| format!("{var}^")).collect();
        let list = format!("V{}", self.new_number());
        let grouping =
            vars[1..].iter().filter(|var| args.contains(var) && !hidden.contains(&format!("{var}^")));
        self.seen.extend(grouping.cloned());
        let goal = format!("{which}({}, {hidden}{name}({}), {list})", vars[0], args.join(","));
        match self.lists {
            true => {
                self.seen.push(list);
                goal
            }
            false => format!("{goal}, member({}, {list})", self.arg()),
        }
    }

    fn of_lists(&mut self) -> String {
        let (x, y, list) = (self.arg(), self.new_var(), self.list());
        match self.dice.below(6) {
            0 => format!("append({y}, {}, {list})", self.new_var()),
            1 => format!("append({list}, {x}, {y})"),
            2 => format!("select({x}, {list}, {y})"),
            3 => format!("reverse({list}, {y})"),
            4 => format!("last({list}, {x})"),
            _ => format!("length({list}, {y})"),
        }
    }

    /// A goal that is only known when it is called.
    fn called(&mut self) -> String {
        let at = self.dice.below(self.facts.len());
        let (name, arity) = self.facts[at].clone();
        let args: Vec<String> = (0..arity).map(|_| self.arg()).collect();
        match arity {
            1 => format!("call({name}, {})", args[0]),
            _ if self.lists => format!("call({name}, {})", args.join(", ")),
            _ => format!("call({name}({}), {})", args[..arity - 1].join(","), args[arity - 1]),
        }
    }

    // -------------------------------------------------------------------------------- tabling

    fn tabling(&mut self) {
        let nodes = 2 + self.dice.below(6);
        let edge = format!("{}e", self.name);
        for _ in 0..1 + self.dice.below(12) {
            let (a, b) = (self.dice.below(nodes), self.dice.below(nodes));
            self.text += &format!("{edge}({a},{b}).\n");
        }
        let n = 1 + self.dice.below(3);
        let names: Vec<String> = (0..n).map(|at| format!("{}p{at}", self.name)).collect();
        let tables: Vec<String> = names.iter().map(|name| format!("{name}/2")).collect();
        self.text += &format!(":- table {}.\n", tables.join(", "));
        for name in &names {
            self.clause(&format!("{name}(X,Y)"), &[format!("{edge}(X,Y)")]);
            for _ in 0..1 + self.dice.below(2) {
                let goals = self.steps(&edge, &names);
                self.clause(&format!("{name}(X,Y)"), &goals);
            }
        }
        self.rules = names.iter().map(|name| (name.clone(), 2)).collect();
        self.facts.push((edge, 2));
        self.lists = true;
        let goals = 1 + self.dice.below(2);
        self.question(goals, true);
    }

    /// A way from X to Y by edges and tabled steps, in any order.
    fn steps(&mut self, edge: &str, names: &[String]) -> Vec<String> {
        let n = 1 + self.dice.below(3);
        let mut goals = Vec::new();
        for at in 0..n {
            let step = match self.dice.chance(35) {
                true => edge,
                false => &names[self.dice.below(names.len())],
            };
            let from = if at == 0 { "X".to_string() } else { format!("M{at}") };
            let to = if at + 1 == n { "Y".to_string() } else { format!("M{}", at + 1) };
            let (from, to) = if self.dice.chance(15) { (to, from) } else { (from, to) };
            goals.push(format!("{step}({from},{to})"));
        }
        if n > 1 && self.dice.chance(20) {
            goals.swap(0, 1);
        }
        if self.dice.chance(15) {
            goals.push("X < Y".into());
        }
        goals
    }

    // -------------------------------------------------------------------------------- joins

    fn joins(&mut self) {
        let constants = ["a", "b", "c", "d", "1", "2", "3", "4"];
        let n = 2 + self.dice.below(3);
        self.facts(n, 25, &constants);
        (self.seen, self.vars) = (Vec::new(), 0);
        let mut goals = Vec::new();
        for _ in 0..2 + self.dice.below(3) {
            let call = self.call();
            goals.push(call);
            if self.percent(30) {
                let goal = match self.dice.below(3) {
                    0 => self.arithmetic(),
                    1 => self.with_values(|it| format!("\\+ {}", it.call())),
                    _ => self.bag(),
                };
                goals.push(goal);
            }
        }
        let answer: Vec<String> = (0..3).map(|_| self.seen_or_constant()).collect();
        goals.push(format!("Answer = [{}]", answer.join(",")));
        let head = format!("{}w(Answer)", self.name);
        self.clause(&head, &goals);
    }
}

/// Variables that occur once get names that say so: nobody wants thousands of warnings.
fn name_singletons(clause: &str) -> String {
    let is_part = |it: char| it.is_ascii_alphanumeric() || it == '_';
    let words: Vec<&str> = clause.split(|it| !is_part(it)).filter(|word| !word.is_empty()).collect();
    let mut out = String::new();
    let mut rest = clause;
    while let Some(start) = rest.find(is_part) {
        let end = rest[start..].find(|it| !is_part(it)).map_or(rest.len(), |end| start + end);
        let word = &rest[start..end];
        let once = word.starts_with(|it: char| it.is_ascii_uppercase())
            && words.iter().filter(|it| **it == word).count() == 1;
        out += &rest[..start];
        out += if once { "_" } else { "" };
        out += word;
        rest = &rest[end..];
    }
    out + rest
}
