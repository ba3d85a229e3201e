//! Smaller programs that still show what a larger one shows.

/// A form of a program: enough of its structure to leave parts out.
#[derive(Clone, PartialEq)]
enum Part {
    Atom(String),
    /// Opening and closing sign, with a prefix such as `'` in the former.
    Group(String, Vec<Part>, char),
}

/// Leaves out parts of a program as long as `shows` stays true of it.
#[must_use]
pub fn shrink(program: &str, mut shows: impl FnMut(&str) -> bool) -> String {
    let mut parts = read(program);
    let mut tries = 0;
    loop {
        let before = parts.clone();
        let mut at = 0;
        while let Some(smaller) = smaller_at(&parts, at) {
            let next = smaller.into_iter().find(|candidate| {
                tries += 1;
                tries < 1500 && shows(&write(candidate))
            });
            match next {
                Some(next) => parts = next,
                None => at += 1,
            }
        }
        if parts == before {
            return write(&parts);
        }
    }
}

/// The program with its `at`-th part left out, made nil, or replaced by one of its own parts.
fn smaller_at(parts: &[Part], at: usize) -> Option<Vec<Vec<Part>>> {
    let mut number = at;
    let found = find(parts, &mut number)?;
    let mut ways = vec![Vec::new()];
    if let Part::Group(_, inner, _) = found {
        ways.push(vec![Part::Atom("nil".into())]);
        ways.extend(inner.iter().skip(1).map(|part| vec![part.clone()]));
    }
    Some(ways.into_iter().map(|way| replaced(parts, &mut at.clone(), &way)).collect())
}

/// The `number`-th part in the order of the text.
fn find<'a>(parts: &'a [Part], number: &mut usize) -> Option<&'a Part> {
    for part in parts {
        if *number == 0 {
            return Some(part);
        }
        *number -= 1;
        if let Part::Group(_, inner, _) = part
            && let Some(found) = find(inner, number)
        {
            return Some(found);
        }
    }
    None
}

fn replaced(parts: &[Part], number: &mut usize, by: &[Part]) -> Vec<Part> {
    let mut out = Vec::new();
    for part in parts {
        if *number == 0 {
            out.extend(by.iter().cloned());
            *number = usize::MAX;
            continue;
        }
        *number -= 1;
        out.push(match part {
            Part::Group(open, inner, close) => Part::Group(open.clone(), replaced(inner, number, by), *close),
            Part::Atom(_) => part.clone(),
        });
    }
    out
}

fn read(text: &str) -> Vec<Part> {
    let mut chars = text.chars().peekable();
    let mut stack: Vec<(String, Vec<Part>)> = vec![(String::new(), Vec::new())];
    let mut prefix = String::new();
    while let Some(c) = chars.next() {
        match c {
            '(' | '[' | '{' => {
                prefix.push(c);
                stack.push((std::mem::take(&mut prefix), Vec::new()));
            }
            ')' | ']' | '}' => {
                let (open, inner) = stack.pop().expect("brackets balance");
                let around = &mut stack.last_mut().expect("brackets balance").1;
                let group = Part::Group(open, inner, c);
                // What an edit says about guards stays as it is: only the machine asks for that.
                around.push(match around.last() {
                    Some(Part::Atom(word)) if word == ":out-of" => Part::Atom(write(&[group])),
                    _ => group,
                });
            }
            '\'' | '`' | ',' => prefix.push(c),
            c if c.is_whitespace() => {}
            c => {
                let mut atom = std::mem::take(&mut prefix);
                atom.push(c);
                let is_string = c == '"';
                while let Some(next) = chars.peek() {
                    let ends = if is_string {
                        atom.len() > 1 && atom.ends_with('"')
                    } else {
                        next.is_whitespace() || "()[]{}".contains(*next)
                    };
                    if ends {
                        break;
                    }
                    atom.extend(chars.next());
                }
                stack.last_mut().expect("brackets balance").1.push(Part::Atom(atom));
            }
        }
    }
    stack.pop().map(|(_, parts)| parts).unwrap_or_default()
}

fn write(parts: &[Part]) -> String {
    let text = |part: &Part| match part {
        Part::Atom(text) => text.clone(),
        Part::Group(open, inner, close) => format!("{open}{}{close}", write(inner)),
    };
    parts.iter().map(text).collect::<Vec<_>>().join(" ")
}
