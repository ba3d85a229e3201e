//! Colours for a line of forms.
//!
//! This is not the lexer of the language, which wants whole texts: it colours what is being typed,
//! right or wrong, and changes no character.

/// ANSI colours.
const COMMENT: u8 = 90;
const STRING: u8 = 32;
const KEYWORD: u8 = 36;
const SPECIAL: u8 = 35;
const NUMBER: u8 = 33;
/// The bracket that belongs to the one at the cursor.
const PARTNER: &str = "1;4";

/// The line in colours; `pos` is the cursor.
pub fn paint(line: &str, pos: usize) -> String {
    let partner = partner(line, pos);
    let mut out = String::new();
    for (start, piece) in pieces(line) {
        match colour(piece) {
            Some(colour) => out += &format!("\x1b[{colour}m{piece}\x1b[0m"),
            None if partner == Some(start) => out += &format!("\x1b[{PARTNER}m{piece}\x1b[0m"),
            None => out += piece,
        }
    }
    out
}

fn colour(piece: &str) -> Option<u8> {
    match piece.chars().next()? {
        ';' => Some(COMMENT),
        '#' if piece.starts_with("#|") => Some(COMMENT),
        '"' => Some(STRING),
        ':' => Some(KEYWORD),
        c if c.is_ascii_digit() => Some(NUMBER),
        _ => compiler::special_forms().iter().any(|(name, _)| *name == piece).then_some(SPECIAL),
    }
}

/// Cuts a line into words, strings, comments, and single other characters; with their positions.
fn pieces(line: &str) -> Vec<(usize, &str)> {
    let mut pieces = Vec::new();
    let mut start = 0;
    while start < line.len() {
        let rest = &line[start..];
        let len = length(rest).max(1);
        pieces.push((start, &rest[..len]));
        start += len;
    }
    pieces
}

/// How long the piece at the start of a text is, in bytes.
fn length(text: &str) -> usize {
    let first = text.chars().next().unwrap_or(' ');
    let to = |end: Option<usize>| end.unwrap_or(text.len());
    match first {
        '"' => {
            let mut escaped = false;
            let end = text.char_indices().skip(1).find(|(_, c)| {
                let ends = *c == '"' && !escaped;
                escaped = *c == '\\' && !escaped;
                ends
            });
            to(end.map(|(at, _)| at + 1))
        }
        ';' => to(text.find('\n')),
        '#' if text.starts_with("#|") => to(text.find("|#").map(|at| at + 2)),
        c if is_word(c) => to(text.find(|c| !is_word(c))),
        c => c.len_utf8(),
    }
}

fn is_word(c: char) -> bool {
    !c.is_whitespace() && !"()[]{}\"'`,;".contains(c)
}

/// The bracket that belongs to the one at, or else just before, the cursor.
fn partner(line: &str, pos: usize) -> Option<usize> {
    let brackets: Vec<(usize, &str)> =
        pieces(line).into_iter().filter(|(_, piece)| "()[]{}".contains(*piece)).collect();
    let mut open = Vec::new();
    for (at, piece) in brackets {
        if "([{".contains(piece) {
            open.push(at);
            continue;
        }
        let opened = open.pop()?;
        for (one, other) in [(opened, at), (at, opened)] {
            if one == pos || one + 1 == pos {
                return Some(other);
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_character_is_lost() {
        for line in ["(if \"a\\\"b\" :k ; c", "#| x |# (1 2)", "\"open", "größe 'ö", "#|", ""] {
            let text: String = pieces(line).into_iter().map(|(_, piece)| piece).collect();
            assert_eq!(text, line);
        }
    }

    #[test]
    fn partners_are_found() {
        assert_eq!(partner("(a [b] \")\" c)", 0), Some(12));
        assert_eq!(partner("(a [b])", 6), Some(3));
        assert_eq!(partner("(a", 0), None);
    }
}
