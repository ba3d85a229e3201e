//! Expectations in files beside the input.

use std::path::Path;

/// Compares a text with the content of a file, or writes it there with `UPDATE_EXPECT=1`.
///
/// # Errors
/// Both texts, from the first line on in which they differ.
pub fn check_file(path: &Path, actual: &str) -> Result<(), String> {
    let known = std::fs::read_to_string(path).unwrap_or_default();
    // A checkout may have changed the ends of the lines.
    if known.replace('\r', "") == actual.replace('\r', "") {
        return Ok(());
    }
    if std::env::var_os("UPDATE_EXPECT").is_some() {
        std::fs::write(path, actual).unwrap_or_else(|why| panic!("{}: {why}", path.display()));
        return Ok(());
    }
    Err(format!(
        "{}:\n{}\nUPDATE_EXPECT=1 takes what came out as expected.",
        path.display(),
        difference(&known, actual)
    ))
}

/// Two texts, from the first line on in which they differ.
pub fn difference(expected: &str, actual: &str) -> String {
    const LINES: usize = 30;
    let same = expected.lines().zip(actual.lines()).take_while(|(a, b)| a == b).count();
    let tail = |text: &str| {
        text.lines().skip(same).take(LINES).map(|line| format!("    {line}\n")).collect::<String>()
    };
    format!("  from line {}\n  expected:\n{}  actual:\n{}", same + 1, tail(expected), tail(actual))
}

/// Fails with all problems at once.
#[track_caller]
pub fn report(problems: &[String]) {
    assert!(problems.is_empty(), "{} problems\n\n{}", problems.len(), problems.join("\n\n"));
}
