//! Lists that grow without copying.

/// Items in leaves that never move, so that growing copies nothing.
#[derive(Debug, Clone)]
pub(super) struct Chunks<T> {
    leaves: Vec<Vec<T>>,
    pub(super) len: usize,
}

const LEAF_BITS: usize = 12;

impl<T> Default for Chunks<T> {
    fn default() -> Self {
        Chunks { leaves: Vec::new(), len: 0 }
    }
}

impl<T> Chunks<T> {
    #[inline(always)]
    pub(super) fn push(&mut self, item: T) -> u32 {
        let at = self.len;
        if at >> LEAF_BITS == self.leaves.len() {
            self.grow();
        }
        self.leaves[at >> LEAF_BITS].push(item);
        self.len += 1;
        at as u32
    }
    #[cold]
    #[inline(never)]
    fn grow(&mut self) {
        self.leaves.push(Vec::with_capacity(1 << LEAF_BITS));
    }
    #[inline(always)]
    pub(super) fn get(&self, at: u32) -> &T {
        &self.leaves[at as usize >> LEAF_BITS][at as usize & ((1 << LEAF_BITS) - 1)]
    }
    #[inline(always)]
    pub(super) fn get_mut(&mut self, at: u32) -> &mut T {
        &mut self.leaves[at as usize >> LEAF_BITS][at as usize & ((1 << LEAF_BITS) - 1)]
    }
    pub(super) fn iter_mut(&mut self) -> impl Iterator<Item = &mut T> {
        self.leaves.iter_mut().flatten()
    }
    /// Forgets all items but keeps the memory: fresh pages are most of the cost of a fresh call.
    pub(super) fn clear(&mut self) {
        self.leaves.iter_mut().for_each(Vec::clear);
        self.len = 0;
    }
}
