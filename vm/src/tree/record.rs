//! Records: what is kept of one run of a slot, in the words of those who look at trees.

use super::{RecId, SlotId};
use crate::value::Value;

/// What became of a task.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub enum Status {
    /// A planner made it; it has not run.
    Planned,
    /// Called, but nothing of it has run.
    #[default]
    Created,
    /// Being run.
    Running,
    /// Stopped until it is woken up.
    Suspended,
    /// Its call has been recorded; it will be performed later.
    Deferred,
    /// It returned.
    Succeeded,
    /// A failure left it.
    Failed,
    /// It was stopped from outside.
    Evaporated,
    /// It did not have to run.
    Skipped,
}

impl Status {
    /// All of them.
    pub const ALL: &[Status] = &[
        Status::Planned,
        Status::Created,
        Status::Running,
        Status::Suspended,
        Status::Deferred,
        Status::Succeeded,
        Status::Failed,
        Status::Evaporated,
        Status::Skipped,
    ];
    /// True for a status that is never left.
    #[must_use]
    pub fn is_final(self) -> bool {
        self >= Status::Succeeded
    }
    /// The word for it.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Status::Planned => "planned",
            Status::Created => "created",
            Status::Running => "running",
            Status::Suspended => "suspended",
            Status::Deferred => "deferred",
            Status::Succeeded => "succeeded",
            Status::Failed => "failed",
            Status::Evaporated => "evaporated",
            Status::Skipped => "skipped",
        }
    }
}

/// Why a record was skipped or evaporated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Why {
    /// Nothing to say.
    #[default]
    Nothing,
    /// Its goal was true already.
    Goal,
    /// An edit says so.
    Edit,
    /// A new call took its place.
    Superseded,
    /// The code before it failed.
    Before,
    /// Another branch of its form failed.
    Failed,
    /// Another branch of its form decided it.
    Won,
    /// Its time was over.
    Timeout,
    /// What it is part of ended.
    Parent,
    /// A task asked for it.
    Asked,
    /// A task asked for it, and for dropping what was owed.
    Emergency,
}

impl Why {
    /// All of them.
    pub const ALL: &[Why] = &[
        Why::Nothing,
        Why::Goal,
        Why::Edit,
        Why::Superseded,
        Why::Before,
        Why::Failed,
        Why::Won,
        Why::Timeout,
        Why::Parent,
        Why::Asked,
        Why::Emergency,
    ];
    /// The word for it; empty where there is nothing to say.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Why::Nothing => "",
            Why::Goal => "goal",
            Why::Edit => "edit",
            Why::Superseded => "superseded",
            Why::Before => "before",
            Why::Failed => "failed",
            Why::Won => "won",
            Why::Timeout => "timeout",
            Why::Parent => "parent",
            Why::Asked => "asked",
            Why::Emergency => "emergency",
        }
    }
}

/// What kind of node a record makes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum NodeKind {
    /// The root.
    #[default]
    TopLevel,
    /// A call of a plan.
    Plan,
    /// A performed description.
    Action,
    /// A branch of a parallel form.
    Branch,
}

impl NodeKind {
    /// All of them.
    pub const ALL: &[NodeKind] = &[NodeKind::TopLevel, NodeKind::Plan, NodeKind::Action, NodeKind::Branch];
    /// The word for it.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            NodeKind::TopLevel => "top-level",
            NodeKind::Plan => "plan",
            NodeKind::Action => "action",
            NodeKind::Branch => "branch",
        }
    }
}

/// One run of a slot; 64 bytes.
#[derive(Clone, Default)]
pub struct Record {
    /// The place.
    pub slot: SlotId,
    /// The record that it ran in.
    pub parent: RecId,
    /// The child slot that was called last.
    pub(super) cursor: SlotId,
    /// Where its parameters are in [`Tree::params`].
    pub(super) params: u32,
    /// 1 for the first run of the slot in this run of the tree.
    pub attempt: u32,
    /// How many parameters it has.
    pub(super) args: u8,
    /// What became of it.
    pub status: Status,
    /// [`RETRIED`], [`DRIVEN`], [`MOVED`], [`COUNTED`], [`ATTEMPTED`], [`CHANGED`].
    pub flags: u8,
    /// What kind of node it makes.
    pub kind: NodeKind,
    /// Why it was skipped or evaporated.
    pub why: Why,
    /// How many records there were when it became final: a version shows it final from then on.
    pub stamp: u32,
    /// When it was called, in nanoseconds of the task clock.
    pub start: u64,
    /// When it became final.
    pub end: u64,
    /// What it returned, or the failure that left it.
    pub value: Value,
}

impl Record {
    /// How many parameters it has.
    #[must_use]
    pub fn args(&self) -> u8 {
        self.args
    }
}

/// Children may exist that the cursor has not seen: look before a slot is added.
pub const RETRIED: u8 = 1;
/// A driver ends the record, not the frame of the plan.
pub const DRIVEN: u8 = 2;
/// The check of its goal has moved to an obligation.
pub const MOVED: u8 = 4;

/// Its calls are counted, whatever the site says: code may run its body more than once.
pub const COUNTED: u8 = 8;

/// Its body has been begun: what runs it again is another attempt.
pub const ATTEMPTED: u8 = 16;

/// Edits have changed its parameters; before these stand the ones that the plan gives.
pub const CHANGED: u8 = 32;

/// What few records have.
#[derive(Debug, Clone, Default)]
pub struct Extra {
    /// The call that a description was grounded to.
    pub grounded: Option<Value>,
    /// The slot of the form that it was performed in, where that is not its parent.
    pub performed_in: Option<SlotId>,
    /// What the tree has to say about edits here: guards that did not hold, places not ahead.
    pub notes: Vec<String>,
}
