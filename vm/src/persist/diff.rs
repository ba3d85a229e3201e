//! What differs between two trees.

use std::collections::BTreeMap;

use serde_json::Value as Json;

/// A difference between two trees.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Difference {
    /// The path of the task.
    pub path: String,
    /// Only in the first, only in the second, or in both but not the same.
    pub kind: DifferenceKind,
    /// What is said of it in the first tree and in the second: fields that differ, with their texts.
    pub fields: Vec<(String, String, String)>,
}

/// Where a task is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DifferenceKind {
    /// Only in the first tree.
    Gone,
    /// Only in the second.
    New,
    /// In both.
    Changed,
}

impl DifferenceKind {
    /// The word for it.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            DifferenceKind::Gone => "gone",
            DifferenceKind::New => "new",
            DifferenceKind::Changed => "changed",
        }
    }
}

/// What differs between two trees, given as the nodes of [`crate::show::json`]: tasks are the same if their paths are.
/// When they ran is no difference.
#[must_use]
pub fn diff(one: &Json, other: &Json) -> Vec<Difference> {
    const FIELDS: &[&str] =
        &["status", "why", "attempt", "params", "value", "failure", "grounded", "edits", "notes"];
    fn nodes(json: &Json) -> impl Iterator<Item = (&str, &Json)> {
        json.as_array().into_iter().flatten().filter_map(|node| Some((node["path"].as_str()?, node)))
    }
    fn text(json: &Json) -> String {
        match json {
            Json::Null => String::new(),
            Json::String(text) => text.clone(),
            other => other.to_string(),
        }
    }
    let before: BTreeMap<&str, &Json> = nodes(one).collect();
    let after: BTreeMap<&str, &Json> = nodes(other).collect();
    let status = |node: &Json| text(&node["status"]);
    let mut found = Vec::new();
    for (path, node) in nodes(one) {
        let difference = |kind, fields| Difference { path: path.into(), kind, fields };
        match after.get(path) {
            None => {
                let fields = vec![("status".to_string(), status(node), String::new())];
                found.push(difference(DifferenceKind::Gone, fields));
            }
            Some(other) => {
                let differing = FIELDS.iter().filter(|field| node[**field] != other[**field]);
                let fields: Vec<_> = differing
                    .map(|field| ((*field).to_string(), text(&node[*field]), text(&other[*field])))
                    .collect();
                if !fields.is_empty() {
                    found.push(difference(DifferenceKind::Changed, fields));
                }
            }
        }
    }
    for (path, node) in nodes(other).filter(|(path, _)| !before.contains_key(path)) {
        let fields = vec![("status".to_string(), String::new(), status(node))];
        found.push(Difference { path: path.into(), kind: DifferenceKind::New, fields });
    }
    found
}
