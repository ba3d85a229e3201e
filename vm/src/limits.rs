//! What a run may use and do.

use crate::native::Effect;

/// Limits of a run. Each ends in a typed `resource-failure`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Limits {
    /// Calls and backward jumps.
    pub fuel: u64,
    /// Nested calls.
    pub depth: usize,
    /// Bytes of values, frames and tree.
    pub memory: usize,
    /// Nodes of the tree.
    pub nodes: usize,
    /// Bytes that the program prints.
    pub output: usize,
}

impl Default for Limits {
    /// Lets recursion 10^6 deep through, and ends an endless one within seconds and a few GiB.
    fn default() -> Limits {
        Limits {
            fuel: 2_000_000_000,
            depth: 20_000_000,
            memory: 4 << 30,
            nodes: 20_000_000,
            output: 256 << 20,
        }
    }
}

impl Limits {
    /// For macros: an expansion is short.
    #[must_use]
    pub fn for_expansion() -> Limits {
        Limits { fuel: 20_000_000, depth: 200_000, memory: 512 << 20, nodes: 1, output: 0 }
    }
}

/// What a run may do besides computing.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Grants {
    /// Effects that are allowed everywhere.
    effects: Vec<Effect>,
    /// Folders, or files, below which files may be read.
    pub read: Vec<String>,
    /// Folders, or files, below which files may be written.
    pub write: Vec<String>,
}

impl Grants {
    /// Adds a grant as written after `--allow`: `clock`, `read=DIR`, `write=DIR`.
    ///
    /// # Errors
    /// A sentence that lists what can be granted.
    pub fn allow(&mut self, text: &str) -> Result<(), String> {
        match text.split_once('=') {
            Some(("read", path)) => self.read.push(path.into()),
            Some(("write", path)) => self.write.push(path.into()),
            None if text == "clock" => self.effects.push(Effect::Clock),
            None if text == "read" || text == "write" => {
                return Err(format!("`{text}` needs a folder: --allow {text}=DIR"));
            }
            _ => return Err(format!("`{text}` is no grant; there are: read=DIR, write=DIR, clock")),
        }
        Ok(())
    }

    /// True if natives with this effect may be called at all; which files is asked for each.
    #[must_use]
    pub fn allows(&self, effect: Effect) -> bool {
        match effect {
            // The only world and the only motions so far are those of the projection.
            Effect::Pure | Effect::Look | Effect::World | Effect::Motion => true,
            Effect::Read => !self.read.is_empty(),
            Effect::Write => !self.write.is_empty(),
            other => self.effects.contains(&other),
        }
    }
}
