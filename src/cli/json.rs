//! What `--json` prints: the parts that several commands share.
//!
//! Values are the text that `write` prints. Lines and columns count from 1.

use compiler::Report;
use pleach::files::Files;
use serde_json::{Map, Value as Json, json};
use vm::code::{Place, Program};
use vm::value::Value;

/// `{file, line, column, end-line, end-column}`
pub fn place(files: &Files, place: Place) -> Json {
    let file = grammar::FileId(place.file);
    let name = files.get(file).map(|it| it.name.as_str());
    let (line, column) = files.line_column(file, place.start).unwrap_or((0, 0));
    let (end_line, end_column) = files.line_column(file, place.end).unwrap_or((0, 0));
    json!({"file": name, "line": line, "column": column, "end-line": end_line, "end-column": end_column})
}

/// A failure with the places where it and its causes were raised.
pub fn failure(files: &Files, program: &Program, value: &Value) -> Json {
    let mut json = vm::show::failure_json(program, value, 0);
    add_places(files, value, &mut json);
    json
}

fn add_places(files: &Files, value: &Value, json: &mut Json) {
    let (Some(it), Json::Object(_)) = (value.as_failure(), &json) else { return };
    if let Some(at) = it.place.filter(|at| *at != Place::default()) {
        json["place"] = place(files, at);
    }
    if let (Some(cause), Some(json)) = (&it.cause, json.get_mut("cause")) {
        add_places(files, cause, json);
    }
    if let Some(Json::Array(also)) = json.get_mut("also") {
        it.also.iter().zip(also).for_each(|(value, json)| add_places(files, value, json));
    }
}

/// `{severity, code, message, help, file, line, …, labels}` of an error or a warning.
pub fn report(files: &Files, report: &Report) -> Json {
    let it = report.diagnostic();
    let mut json = Map::new();
    let severity = if report.is_warning() { "warning" } else { "error" };
    json.insert("severity".into(), json!(severity));
    json.insert("code".into(), json!(it.code().map(|code| code.to_string())));
    json.insert("message".into(), json!(it.to_string()));
    json.insert("help".into(), json!(it.help().map(|help| help.to_string())));
    let span = report.span();
    if let Json::Object(at) = place(files, Place { file: span.file.0, start: span.start, end: span.end }) {
        json.extend(at);
    }
    let labels = it.labels().into_iter().flatten().map(|label| {
        let (start, end) = (label.offset() as u32, (label.offset() + label.len()) as u32);
        let mut json = place(files, Place { file: span.file.0, start, end });
        json["text"] = json!(label.label());
        json
    });
    json.insert("labels".into(), labels.collect());
    Json::Object(json)
}
