//! Diagnostics and failures as text for people.

use std::fmt::Write as _;

use compiler::Report;
use miette::{Diagnostic, GraphicalReportHandler, GraphicalTheme, NamedSource};
use vm::failure::Failure;
use vm::value::{Symbol, Value};

use crate::files::Files;

/// How text is drawn.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Style {
    /// With colours.
    pub colour: bool,
}

/// A diagnostic with the source that it points at.
#[derive(Debug)]
struct WithSource<'a> {
    inner: &'a dyn Diagnostic,
    source: NamedSource<String>,
}

impl std::fmt::Display for WithSource<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        std::fmt::Display::fmt(self.inner, f)
    }
}
impl std::error::Error for WithSource<'_> {}
impl Diagnostic for WithSource<'_> {
    fn code<'a>(&'a self) -> Option<Box<dyn std::fmt::Display + 'a>> {
        self.inner.code()
    }
    fn severity(&self) -> Option<miette::Severity> {
        self.inner.severity()
    }
    fn help<'a>(&'a self) -> Option<Box<dyn std::fmt::Display + 'a>> {
        self.inner.help()
    }
    fn labels(&self) -> Option<Box<dyn Iterator<Item = miette::LabeledSpan> + '_>> {
        self.inner.labels()
    }
    fn source_code(&self) -> Option<&dyn miette::SourceCode> {
        Some(&self.source)
    }
}

/// A mistake in a program, with the lines that it is in.
#[must_use]
pub fn report(files: &Files, report: &Report, style: Style) -> String {
    let file = files.get(report.span().file);
    let (name, text) = file.map_or(("unknown", ""), |file| (&file.name, &file.text));
    let inner = report.diagnostic();
    let source = NamedSource::new(name, text.to_string());
    draw(&WithSource { inner, source }, style)
}

/// Draws any diagnostic.
fn draw(diagnostic: &dyn Diagnostic, style: Style) -> String {
    let theme = if style.colour { GraphicalTheme::unicode() } else { GraphicalTheme::unicode_nocolor() };
    let handler = GraphicalReportHandler::new_themed(theme).with_width(100).with_links(false);
    let mut out = String::new();
    match handler.render_report(&mut out, diagnostic) {
        Ok(()) => out,
        Err(_) => format!("{diagnostic}\n"),
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
    }
    out
}

/// A failure that nothing handled, with the lines of the source that it comes from.
#[must_use]
pub fn failure_in_source(files: &Files, failure: &Value, style: Style) -> String {
    let mut out = String::new();
    for (lead, _, it) in with_reasons(failure) {
        let source = it.place.and_then(|place| files.get(grammar::FileId(place.file)));
        let shown = ShownFailure { lead, failure: it, in_source: source.is_some() };
        out += &match source {
            Some(file) => draw(&WithSource { inner: &shown, source: NamedSource::new(&file.name, file.text.clone()) }, style),
            None => draw(&shown, style),
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
