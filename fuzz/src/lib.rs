//! Programs out of programs: most bytes that come out of chance are no forms, and most forms that do
//! mean nothing. This mutator works on forms, so that what it makes is read and often runs.

use grammar::form::{Form, FormKind, Prefix, Symbol};
use grammar::{FileId, Span};

/// Numbers from a seed: SplitMix64.
pub struct Chance(pub u64);

impl Chance {
    fn draw(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    fn below(&mut self, end: usize) -> usize {
        (self.draw() % end.max(1) as u64) as usize
    }
    fn one_of<'a, T>(&mut self, items: &'a [T]) -> &'a T {
        &items[self.below(items.len())]
    }
}

/// Words that a program may be made of besides its own.
const WORDS: &[&str] = &[
    "nil",
    "true",
    "'()",
    "0",
    "1",
    "-1",
    "2.5",
    "9223372036854775807",
    "+nan",
    "\"text\"",
    ":key",
    "'milk",
    "[1 2]",
    "{:a 1}",
    "(an object (type milk))",
    "(list 1 2 3)",
    "(lambda (x) x)",
    "(fail plan-failure)",
    "(retry)",
    "(return 1)",
    "(propagate)",
    "(loop)",
    "(first 5)",
    "(run-plan main)",
    "(path main)",
    "(skip (path main))",
    "(original)",
    "(dotimes (i 3) i)",
    "(par 1 2)",
    "(par (:tag t (sleep 1)) (evaporate t))",
    "(pursue (sleep 1) (loop))",
    "(try-all (fail plan-failure) 2)",
    "(try-in-order (fail plan-failure) 2)",
    "(par-loop (x '(1 2 1)) x)",
    "(try-each (x '(1 2)) x)",
    "(partial-order ((:tag p 1) (:tag q 2)) (:order p q))",
    "(with-timeout 1 (sleep 2))",
    "(sleep 1)",
    "(fluent 1)",
    "(set-value f 2)",
    "(wait-for (fluent) :timeout 1)",
    "(wait-for (fluent))",
    "(whenever (fluent 1) (sleep 1))",
    "(fl (+ f 1))",
    "(suspend t)",
    "(wake-up t)",
    "(join t)",
    "(value (status t))",
    "(edit-tree (run-plan main) (list (defer (path main par) :after (path main (par :call 2)))))",
    "(dolist (x '(a b a)) x)",
    "(unwind-protect 1 2)",
    "(with-failure-handling ((failure (e) (return e))) (first 5))",
    "(set! x 1)",
    "(incf x)",
    "(apply list '(1 2))",
    "(perform (an action (type going)))",
    "(random 5)",
    "(now)",
    "main",
    "x",
    "e",
    "(tree-text (run-plan main))",
    "(edit-tree (run-plan main) (list (wrap (path main) '(original))))",
    "(defer (path main) :after (path main))",
    "(owe (path main) '(print 1) :after (path main) :as 'owed)",
    "(before (path main) '(print 1))",
    "(with-retry-counters ((n 2)) (do-retry n 1))",
    "(def-failure slipped ())",
    "(matches (an object (type ?t)) x)",
];

fn word(chance: &mut Chance) -> Form {
    let text = chance.one_of(WORDS);
    grammar::parse(FileId(0), text).forms.remove(0)
}

/// A program made from another one by a few changes, at most `most` bytes.
pub fn mutate(text: &str, most: usize, seed: u64) -> Option<String> {
    let mut chance = Chance(seed);
    let mut forms = grammar::parse(FileId(0), text).forms;
    for _ in 0..=chance.below(3) {
        change(&mut forms, &mut chance);
    }
    let text: String = forms.iter().map(|form| format!("{form}\n")).collect();
    (text.len() <= most).then_some(text)
}

fn change(forms: &mut Vec<Form>, chance: &mut Chance) {
    let count: usize = forms.iter().map(size).sum();
    if count == 0 {
        forms.push(word(chance));
        return;
    }
    let (at, from) = (chance.below(count), chance.below(count));
    let donor = match chance.below(4) {
        0 => word(chance),
        _ => part(forms, &mut { from }).cloned().unwrap_or_else(|| word(chance)),
    };
    let how = chance.below(7);
    let Some(target) = part_mut(forms, &mut { at }) else { return };
    match how {
        0..3 => *target = donor,
        3 => wrap(target, chance),
        4 => {
            if let FormKind::List(items) = &mut target.kind
                && !items.is_empty()
            {
                let at = chance.below(items.len());
                items.remove(at);
            }
        }
        5 => {
            if let FormKind::List(items) = &mut target.kind {
                let at = chance.below(items.len() + 1);
                items.insert(at, donor);
            }
        }
        _ => {
            if let FormKind::List(items) = &mut target.kind
                && !items.is_empty()
            {
                let (one, other) = (chance.below(items.len()), chance.below(items.len()));
                items.swap(one, other);
            }
        }
    }
}

fn wrap(target: &mut Form, chance: &mut Chance) {
    let inner = std::mem::replace(target, Form::new(FormKind::Int(0), Span::default()));
    let heads: &[&str] = &[
        "seq",
        "list",
        "loop",
        "unwind-protect",
        "lambda",
        "when",
        "let",
        "dolist",
        "def-plan",
        "quote",
        "run-plan",
        "edit-tree",
    ];
    let symbol = |name: &str| Form::new(FormKind::Symbol(Symbol::from(name)), Span::default());
    let head: &&str = chance.one_of(heads);
    target.kind = match chance.below(4) {
        0 => FormKind::Prefixed(
            *chance.one_of(&[Prefix::Quote, Prefix::Quasi, Prefix::Unquote, Prefix::Splice]),
            Box::new(inner),
        ),
        1 => FormKind::Vector(vec![inner]),
        _ => FormKind::List(vec![symbol(head), inner]),
    };
}

fn size(form: &Form) -> usize {
    1 + match &form.kind {
        FormKind::List(items) | FormKind::Vector(items) => items.iter().map(size).sum(),
        FormKind::Map(pairs) => pairs.iter().map(|(key, value)| size(key) + size(value)).sum(),
        FormKind::Prefixed(_, inner) => size(inner),
        _ => 0,
    }
}

/// The part with this number, counted from outside in.
fn part<'f>(forms: &'f [Form], number: &mut usize) -> Option<&'f Form> {
    for form in forms {
        if *number == 0 {
            return Some(form);
        }
        *number -= 1;
        let found = match &form.kind {
            FormKind::List(items) | FormKind::Vector(items) => part(items, number),
            FormKind::Prefixed(_, inner) => part(std::slice::from_ref(inner), number),
            FormKind::Map(pairs) => pairs.iter().find_map(|(key, value)| {
                part(std::slice::from_ref(key), number).or_else(|| part(std::slice::from_ref(value), number))
            }),
            _ => None,
        };
        if found.is_some() {
            return found;
        }
    }
    None
}

fn part_mut<'f>(forms: &'f mut [Form], number: &mut usize) -> Option<&'f mut Form> {
    for form in forms {
        if *number == 0 {
            return Some(form);
        }
        *number -= 1;
        let found = match &mut form.kind {
            FormKind::List(items) | FormKind::Vector(items) => part_mut(items, number),
            FormKind::Prefixed(_, inner) => part_mut(std::slice::from_mut(inner), number),
            FormKind::Map(pairs) => {
                pairs.iter_mut().find_map(|(key, value)| match part_mut(std::slice::from_mut(key), number) {
                    Some(found) => Some(found),
                    None => part_mut(std::slice::from_mut(value), number),
                })
            }
            _ => None,
        };
        if found.is_some() {
            return found;
        }
    }
    None
}
