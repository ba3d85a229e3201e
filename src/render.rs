//! Diagnostics and failures as text for people.

use std::fmt::Write as _;

use compiler::Report;
use miette::{Diagnostic, GraphicalReportHandler, GraphicalTheme, NamedSource};
use vm::failure::Failure;
use vm::value::{Symbol, Value};

use crate::files::{File, Files};

/// How text is drawn.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Style {
    /// With colours.
    pub colour: bool,
}

/// A diagnostic made safe to be shown, with the source that it points at.
#[derive(Debug)]
struct Safe<'a> {
    inner: &'a dyn Diagnostic,
    source: Option<NamedSource<String>>,
}

impl std::fmt::Display for Safe<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&printable(&self.inner.to_string()))
    }
}
impl std::error::Error for Safe<'_> {}
impl Diagnostic for Safe<'_> {
    fn code<'a>(&'a self) -> Option<Box<dyn std::fmt::Display + 'a>> {
        self.inner.code()
    }
    fn severity(&self) -> Option<miette::Severity> {
        self.inner.severity()
    }
    fn help<'a>(&'a self) -> Option<Box<dyn std::fmt::Display + 'a>> {
        self.inner.help().map(|help| Box::new(printable(&help.to_string())) as Box<dyn std::fmt::Display>)
    }
    fn labels(&self) -> Option<Box<dyn Iterator<Item = miette::LabeledSpan> + '_>> {
        let labels = self.inner.labels().filter(|_| self.source.is_some())?;
        Some(Box::new(labels.map(|mut label| {
            label.set_label(label.label().map(printable));
            label
        })))
    }
    fn source_code(&self) -> Option<&dyn miette::SourceCode> {
        self.source.as_ref().map(|source| source as &dyn miette::SourceCode)
    }
}

/// A mistake in a program, with the lines that it is in.
#[must_use]
pub fn report(files: &Files, report: &Report, style: Style) -> String {
    match files.get(report.span().file) {
        Some(file) => in_file(file, report.diagnostic(), style),
        None => draw(report.diagnostic(), None, style),
    }
}

/// Lines longer than this are not shown, in bytes.
const LONGEST_LINE: usize = 1000;

/// Draws a diagnostic with the lines of the file that it points at.
fn in_file(file: &File, diagnostic: &dyn Diagnostic, style: Style) -> String {
    let labels: Vec<miette::LabeledSpan> = diagnostic.labels().into_iter().flatten().collect();
    if labels.iter().all(|label| has_short_lines(&file.text, label.offset(), label.len())) {
        return draw(diagnostic, Some(file), style);
    }
    let mut text = draw(diagnostic, None, style);
    for label in &labels {
        let before = file.text.get(..label.offset()).unwrap_or_default();
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().map_or(0, |line| line.chars().count()) + 1;
        let _ =
            writeln!(text, "  {}:{line}:{column}: {}", file.name, printable(label.label().unwrap_or("here")));
    }
    text
}

/// True if the lines that a label touches, and those beside them, are not too long to be read.
fn has_short_lines(text: &str, start: usize, len: usize) -> bool {
    let (Some(before), Some(after)) = (text.get(..start), text.get(start + len..)) else { return true };
    let first = before.len()
        - before.rsplit('\n').take(2).map(|line| line.len() + 1).sum::<usize>().min(before.len());
    let last =
        start + len + after.split('\n').take(2).map(|line| line.len() + 1).sum::<usize>().min(after.len());
    text.get(first..last).is_none_or(|lines| lines.lines().all(|line| line.len() <= LONGEST_LINE))
}

/// A text of the same length without characters that a terminal would obey.
fn printable(text: &str) -> String {
    let harmless = |c: char| match c {
        '\n' | '\t' | '\r' => c,
        // Direction marks make text look like another text.
        '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' => '\u{fffd}',
        c if c.is_control() && c.len_utf8() == 1 => '?',
        c if c.is_control() => '\u{bf}',
        c => c,
    };
    text.chars().map(harmless).collect()
}

/// Draws a diagnostic, with lines of a file or without.
fn draw(diagnostic: &dyn Diagnostic, file: Option<&File>, style: Style) -> String {
    let source = file.map(|file| NamedSource::new(printable(&file.name), printable(&file.text)));
    let safe = Safe { inner: diagnostic, source };
    let theme = if style.colour { GraphicalTheme::unicode() } else { GraphicalTheme::unicode_nocolor() };
    let handler = GraphicalReportHandler::new_themed(theme).with_width(100).with_links(false);
    let mut out = String::new();
    match handler.render_report(&mut out, &safe) {
        Ok(()) => out,
        Err(_) => format!("{safe}\n"),
    }
}

/// A failure that nothing handled, in plain lines: what, where in the tree, where in the source, why.
#[must_use]
pub fn failure(files: &Files, failure: &Value) -> String {
    let mut out = String::new();
    for (lead, depth, it) in with_reasons(failure) {
        let indent = "  ".repeat(depth);
        let _ = writeln!(out, "{indent}{lead}{}", headline(it).replace('\n', "\\n"));
        for (key, value) in other_fields(it) {
            let _ = writeln!(out, "{indent}  {key}: {}", vm::print::brief(value));
        }
        if let Some(task) = it.path() {
            let _ = writeln!(out, "{indent}  in {}", vm::show::safe(task));
        }
        if let Some(place) = it.place {
            let _ = writeln!(out, "{indent}  at {}", files.show(place));
        }
        if let Some(place) = it.within {
            let _ = writeln!(out, "{indent}  from {}", files.show(place));
        }
    }
    out
}

/// A failure that nothing handled, with the lines of the source that it comes from.
#[must_use]
pub fn failure_in_source(files: &Files, failure: &Value, style: Style) -> String {
    let mut out = String::new();
    for (lead, _, it) in with_reasons(failure) {
        // What stops a run between two instructions may have no place.
        let place = it.place.filter(|place| *place != vm::Place::default());
        let source = place.and_then(|place| files.get(grammar::FileId(place.file)));
        let within = it.within.map(|place| files.show(place));
        let shown = ShownFailure { lead, failure: it, in_source: source.is_some(), within };
        out += &match source {
            Some(file) => in_file(file, &shown, style),
            None => draw(&shown, None, style),
        };
    }
    out
}

/// A failure, then its causes and what failed beside them, each with how it belongs to the first.
fn with_reasons(failure: &Value) -> Vec<(&'static str, usize, &Failure)> {
    const DEPTH: usize = 10;
    const MOST: usize = 50;
    let mut all = Vec::new();
    let mut todo = vec![("", 0, failure)];
    while let Some((lead, depth, value)) = todo.pop() {
        let Some(it) = value.as_failure().filter(|_| all.len() < MOST) else { continue };
        all.push((lead, depth, it));
        if depth < DEPTH {
            todo.extend(it.also.iter().rev().map(|also| ("and also ", depth + 1, also)));
            todo.extend(it.cause.iter().map(|cause| ("caused by ", depth + 1, cause)));
        }
    }
    all
}

/// Type and message.
fn headline(failure: &Failure) -> String {
    let message = failure.get(Symbol::from("message")).map(vm::print::display);
    let message: Option<Vec<String>> = message.map(|text| text.lines().map(vm::show::safe).collect());
    format!("{}{}", failure.name, message.map_or(String::new(), |lines| format!(": {}", lines.join("\n"))))
}

fn other_fields(failure: &Failure) -> impl Iterator<Item = &(Symbol, Value)> {
    failure.fields.iter().filter(|(key, _)| *key != "message")
}

/// A failure as a diagnostic: its path and fields stand under the headline.
struct ShownFailure<'a> {
    lead: &'static str,
    failure: &'a Failure,
    in_source: bool,
    /// Where in the library it comes from.
    within: Option<String>,
}

impl std::fmt::Debug for ShownFailure<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{self}")
    }
}
impl std::fmt::Display for ShownFailure<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}{}", self.lead, headline(self.failure))?;
        if let Some(task) = self.failure.path() {
            write!(f, "\nin {}", vm::show::safe(task))?;
        }
        for (key, value) in other_fields(self.failure) {
            write!(f, "\n{key}: {}", vm::print::brief(value))?;
        }
        if let Some(within) = &self.within {
            write!(f, "\nfrom {within}")?;
        }
        Ok(())
    }
}
impl std::error::Error for ShownFailure<'_> {}
impl Diagnostic for ShownFailure<'_> {
    fn labels(&self) -> Option<Box<dyn Iterator<Item = miette::LabeledSpan> + '_>> {
        let place = self.failure.place.filter(|_| self.in_source)?;
        let span = grammar::Span { file: grammar::FileId(place.file), start: place.start, end: place.end };
        Some(Box::new(std::iter::once(miette::LabeledSpan::new_with_span(Some("failed here".into()), span))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn printable_text_keeps_its_length() {
        let text = "a\u{1b}[31m\u{85}\u{202e}ö\n";
        assert_eq!(printable(text).len(), text.len());
        assert!(!printable(text).contains(['\u{1b}', '\u{202e}', '\u{85}']));
    }

    #[test]
    fn long_lines_are_not_shown() {
        let long = format!("short\n{}\nshort\nshort", "x".repeat(LONGEST_LINE + 1));
        assert!(!has_short_lines(&long, 8, 1));
        assert!(!has_short_lines(&long, 0, 2));
        assert!(has_short_lines(&long, long.len() - 2, 2));
        assert!(has_short_lines("", 0, 0));
    }
}
