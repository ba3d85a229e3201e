//! A tree as it was at an earlier moment.

use super::{SavedRecord, SavedTree};
use crate::tree::{Status, Why};

impl SavedTree {
    /// The tree as it was when all that happened until this time, in nanoseconds of the task clock, had happened.
    ///
    /// Tasks that had not begun are not there. Those that had not ended are `running`, whatever they waited for: a
    /// row knows when its task began and ended, not what was between. What is only known from the end is left out:
    /// values, failures, notes. Edits hold from the beginning. Siblings stand in the order of their last runs until then.
    #[must_use]
    pub fn at(&self, time_ns: u64) -> SavedTree {
        let mut now = vec![0; self.records.len() + 1];
        let mut last = vec![0; self.slots.len() + 1];
        let mut records = Vec::new();
        for it in &self.records {
            let parent = now.get(it.parent as usize).copied().unwrap_or(0);
            // What an unfinished run has not begun is there as a plan only.
            if it.start_ns > time_ns || (it.parent != 0 && parent == 0) {
                continue;
            }
            let number = records.len() as u32 + 1;
            now[it.record as usize] = number;
            if let Some(last) = last.get_mut(it.slot as usize) {
                *last = number;
            }
            let it = SavedRecord { record: number, parent, ..it.clone() };
            records.push(match it.end_ns.is_some_and(|end| end <= time_ns) {
                true => it,
                false => running(it),
            });
        }
        let mut slots = self.slots.clone();
        for (slot, last) in slots.iter_mut().zip(last.into_iter().skip(1)) {
            // A later run may have put it elsewhere.
            let place = now.get(slot.place as usize).copied().unwrap_or(0);
            slot.place = if place == 0 { last } else { place };
        }
        SavedTree { slots, records, edits: self.edits.clone() }
    }

    /// When the last task began or ended, in nanoseconds of the task clock.
    #[must_use]
    pub fn last_ns(&self) -> u64 {
        self.records.iter().map(|it| it.end_ns.unwrap_or(it.start_ns)).max().unwrap_or(0)
    }
}

fn running(mut it: SavedRecord) -> SavedRecord {
    it.status = Status::Running.word().into();
    it.why = Why::Nothing.word().into();
    (it.end_ns, it.value, it.failure, it.more) = (None, None, None, None);
    it
}
