//! Text to the terminal: nothing here panics when nobody reads any more.

use std::io::{IsTerminal as _, Write as _};

use pleach::render::Style;

use super::Trouble;

/// The exit code of a program whose reader has gone, as shells count it.
const NO_READER: i32 = 141;

/// Writes to the output of the command. Ends the command if nobody reads it.
pub fn say(text: &str) {
    let mut out = std::io::stdout().lock();
    if let Err(error) = out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        if error.kind() == std::io::ErrorKind::BrokenPipe {
            std::process::exit(NO_READER);
        }
        complain(&format!("error: cannot write to the output: {}\n", pleach::files::why(&error)));
        std::process::exit(super::ERRORS.into());
    }
}

/// Writes to where errors go, if anybody reads that.
pub fn complain(text: &str) {
    let _ = std::io::stderr().lock().write_all(text.as_bytes());
}

/// Colours for the output, if it is a terminal and wants them.
pub fn out_style() -> Style {
    Style { colour: std::io::stdout().is_terminal() && wants_colour() }
}

/// Colours for errors, if they go to a terminal that wants them.
pub fn error_style() -> Style {
    Style { colour: std::io::stderr().is_terminal() && wants_colour() }
}

/// See <https://no-color.org>.
fn wants_colour() -> bool {
    let set = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    !set("NO_COLOR") && std::env::var_os("TERM").is_none_or(|term| term != "dumb")
}

/// What went wrong and what to do, as text.
pub fn trouble(trouble: &Trouble) -> String {
    let help = trouble
        .help
        .as_ref()
        .map_or(String::new(), |help| format!("  help: {}\n", help.replace('\n', "\n        ")));
    format!("error: {}\n{help}", trouble.what)
}

/// Text in a colour, by its number among the ANSI colours.
pub fn paint(text: &str, colour: u8, style: Style) -> String {
    if style.colour { format!("\x1b[{colour}m{text}\x1b[0m") } else { text.to_string() }
}

/// A tree in colours: its words for outcomes.
pub fn paint_tree(tree: &str, style: Style) -> String {
    const WORDS: &[(&str, u8)] = &[
        ("failed", 31),
        ("succeeded", 32),
        ("skipped", 33),
        ("evaporated", 33),
        ("deferred", 33),
        ("running", 36),
        ("suspended", 36),
    ];
    if !style.colour {
        return tree.to_string();
    }
    let line = |line: &str| {
        let found =
            WORDS.iter().filter_map(|(word, colour)| Some((line.find(&format!("  {word}"))?, word, colour)));
        let Some((at, word, colour)) = found.min() else { return format!("{line}\n") };
        format!("{}  {}{}\n", &line[..at], paint(word, *colour, style), &line[at + 2 + word.len()..])
    };
    tree.lines().map(line).collect()
}
