//! Diagnostics and failures as text for people.

use std::fmt::Write as _;

use compiler::Report;
use miette::{Diagnostic, GraphicalReportHandler, GraphicalTheme, NamedSource};
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
    inner: &'a (dyn Diagnostic + 'static),
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

/// A failure that nothing handled: what, where in the tree, where in the source, why.
#[must_use]
pub fn failure(files: &Files, failure: &Value) -> String {
    let mut out = String::new();
    one_failure(files, failure, "", 0, &mut out);
    out
}

fn one_failure(files: &Files, failure: &Value, lead: &str, depth: usize, out: &mut String) {
    const DEPTH: usize = 10;
    let Some(it) = failure.as_failure() else { return };
    let indent = "  ".repeat(depth);
    let message = it.get(Symbol::from("message")).map(vm::print::display);
    let _ = writeln!(out, "{indent}{lead}{}{}", it.name, message.map_or(String::new(), |text| format!(": {}", vm::show::safe(&text))));
    for (key, value) in it.fields.iter().filter(|(key, _)| *key != "message") {
        let _ = writeln!(out, "{indent}  {key}: {}", vm::print::brief(value));
    }
    if let Some(task) = &it.task {
        let _ = writeln!(out, "{indent}  in {}", vm::show::safe(task));
    }
    if let Some(place) = it.place {
        let _ = writeln!(out, "{indent}  at {}", files.show(place));
    }
    if depth == DEPTH {
        return;
    }
    if let Some(cause) = &it.cause {
        one_failure(files, cause, "caused by ", depth + 1, out);
    }
    for also in &it.also {
        one_failure(files, also, "and also ", depth + 1, out);
    }
}
