//! Rows as one JSON object, and back: a tree is taken to another place without a store.

use serde_json::{Value as Json, json};

use super::{SavedEdit, SavedRecord, SavedSlot, SavedTree, Word, chunk};

impl SavedTree {
    /// All rows as one JSON object, to be taken elsewhere.
    #[must_use]
    pub fn rows(&self) -> Json {
        let slots = self.slots.iter().map(|it| {
            json!([it.slot, it.parent, it.name.as_str(), format!("{:016x}", it.site), it.steps, it.place])
        });
        let records = self.records.iter().map(|it| {
            json!([
                it.record,
                it.slot,
                it.parent,
                it.attempt,
                it.kind.as_str(),
                it.status.as_str(),
                it.why.as_str(),
                it.start_ns,
                it.end_ns,
                it.params,
                it.value,
                it.failure,
                it.more
            ])
        });
        let edits = self.edits.iter().map(SavedEdit::row);
        json!({
            "slots": slots.collect::<Json>(),
            "records": records.collect::<Json>(),
            "edits": edits.collect::<Json>(),
        })
    }

    /// The way back of [`SavedTree::rows`].
    ///
    /// # Errors
    /// A sentence that says which row is none.
    pub fn from_rows(json: &Json) -> Result<SavedTree, String> {
        fn rows<T>(json: &Json, key: &str, row: impl Fn(&Json) -> Option<T>) -> Result<Vec<T>, String> {
            let rows = json[key].as_array().ok_or_else(|| format!("there is no list of {key}"))?;
            let row = |(at, json)| row(json).ok_or_else(|| format!("{key}[{at}] is no row of them"));
            rows.iter().enumerate().map(row).collect()
        }
        let word = |json: &Json, at: usize| Some(Word::from(json.get(at)?.as_str()?));
        // JSON in a text; there may be none.
        let part =
            |json: &Json, at: usize| text(json, at).filter(|text| text.is_empty() || chunk::is_part(text));
        // Nothing for what is no text, and nothing inside for what is not there.
        let maybe = |json: &Json, at: usize| match json.get(at)? {
            Json::Null => Some(None),
            Json::String(text) => Some(Some(text.clone())),
            _ => None,
        };
        let maybe_part =
            |json: &Json, at: usize| maybe(json, at).filter(|it| it.as_deref().is_none_or(chunk::is_part));
        let slot = |it: &Json| {
            Some(SavedSlot {
                slot: number(it, 0)?,
                parent: number(it, 1)?,
                name: word(it, 2)?,
                site: u64::from_str_radix(&text(it, 3)?, 16).ok()?,
                steps: part(it, 4)?,
                place: number(it, 5)?,
            })
        };
        let record = |it: &Json| {
            Some(SavedRecord {
                record: number(it, 0)?,
                slot: number(it, 1)?,
                parent: number(it, 2)?,
                attempt: number(it, 3)?,
                kind: word(it, 4)?,
                status: word(it, 5)?,
                why: word(it, 6)?,
                start_ns: it.get(7)?.as_u64()?,
                end_ns: it.get(8)?.as_u64(),
                params: part(it, 9)?,
                value: maybe(it, 10)?,
                failure: maybe_part(it, 11)?,
                more: maybe_part(it, 12)?,
            })
        };
        let tree = SavedTree {
            slots: rows(json, "slots", slot)?,
            records: rows(json, "records", record)?,
            edits: rows(json, "edits", SavedEdit::from_row)?,
        };
        tree.places()?;
        let known = 1..=tree.slots.len();
        match tree.edits.iter().position(|it| !known.contains(&(it.slot as usize))) {
            Some(at) => Err(format!("edits[{at}] is about a slot that is not there")),
            None => Ok(tree),
        }
    }
}

impl SavedEdit {
    /// The edit as a JSON list.
    #[must_use]
    pub fn row(&self) -> Json {
        json!([self.number, self.slot, self.edit, self.callee, self.after, self.origin])
    }

    /// The way back of [`SavedEdit::row`].
    #[must_use]
    pub fn from_row(it: &Json) -> Option<SavedEdit> {
        Some(SavedEdit {
            number: number(it, 0)?,
            slot: number(it, 1)?,
            edit: text(it, 2)?,
            callee: text(it, 3)?,
            after: text(it, 4)?,
            // In logs of older versions edits do not say who made them.
            origin: text(it, 5).unwrap_or_default(),
        })
    }
}

fn number(json: &Json, at: usize) -> Option<u32> {
    u32::try_from(json.get(at)?.as_u64()?).ok()
}

fn text(json: &Json, at: usize) -> Option<String> {
    json.get(at)?.as_str().map(str::to_string)
}
