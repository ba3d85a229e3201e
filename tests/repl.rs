//! REPL transcripts: `repl/NAME.transcript`, as people see them; see `src/repl/mod.rs` for the form.
//!
//! The inputs are read out of the transcript, and the REPL must give the whole transcript again.

use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

use grammar::Completeness;

use crate::expected::{check_file, report};
use crate::program::files_below;

/// The inputs of a transcript: lines behind `> `, and behind two spaces while brackets are open.
fn inputs(transcript: &str) -> String {
    let mut all = String::new();
    let mut open = String::new();
    for line in transcript.lines() {
        let typed = match open.is_empty() {
            true if line == ">" => "",
            true => match line.strip_prefix("> ") {
                Some(typed) => typed,
                None => continue,
            },
            false => line.strip_prefix("  ").unwrap_or(line),
        };
        open += typed;
        open.push('\n');
        let forms =
            if open.starts_with(':') { open.split_once(' ').map_or("", |(_, rest)| rest) } else { &open };
        if !matches!(grammar::completeness(forms), Completeness::Incomplete { .. }) {
            all += &std::mem::take(&mut open);
        }
    }
    all + &open
}

/// What the REPL makes of some inputs.
fn transcript(inputs: &str) -> String {
    let mut repl = Command::new(env!("CARGO_BIN_EXE_pleach"))
        .arg("repl")
        .current_dir("tests/repl")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the binary is there");
    let mut stdin = repl.stdin.take().expect("it is piped");
    let inputs = inputs.to_string();
    let writer = std::thread::spawn(move || stdin.write_all(inputs.as_bytes()));
    let output = repl.wait_with_output().expect("it can be waited for");
    // It may have left before it had read all.
    let _ = writer.join().expect("writing does not panic");
    assert_eq!(String::from_utf8_lossy(&output.stderr), "", "a transcript is all on stdout");
    String::from_utf8(output.stdout).expect("the REPL says text")
}

#[test]
fn transcripts_are_what_the_repl_says() {
    let paths = files_below(Path::new("tests/repl"), ".transcript");
    assert!(!paths.is_empty());
    let problems = paths.iter().filter_map(|path| {
        let text = std::fs::read_to_string(path).expect("it was listed");
        check_file(path, &transcript(&inputs(&text))).err()
    });
    report(&problems.collect::<Vec<_>>());
}
