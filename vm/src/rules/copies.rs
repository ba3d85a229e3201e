//! Terms that stay while the engine goes back: copied out of the heap as cells, later back onto it at once.
//!
//! A copy has variables of its own. Its cells refer to each other by their positions among the copies; putting
//! them back adds to these where the heap ends. Constants of the program stay what they are.

use super::store::{CONSTANT, Cell, Outside, Store, TooLarge};
use crate::value::Value;

/// Copies of terms.
#[derive(Default)]
pub(super) struct Copies {
    cells: Vec<Cell>,
    objects: Vec<Value>,
    /// The variables of the term that is being copied, and where their copies are.
    vars: Vec<(u32, u32)>,
}

/// How many cells one term may have.
const MOST_CELLS: usize = 20_000_000;

impl Copies {
    pub fn bytes(&self) -> usize {
        (self.cells.len() + self.objects.len()) * size_of::<Cell>()
    }

    /// Copies a term: its position, for [`Copies::put_back`].
    pub fn add(&mut self, store: &Store, term: Cell, outside: &dyn Outside) -> Result<u32, TooLarge> {
        let start = self.cells.len();
        self.vars.clear();
        self.cells.push(term);
        let mut at = start;
        // What has been copied but not looked at refers to the store; what has been, to other copies.
        while let Some(cell) = self.cells.get(at) {
            self.cells[at] = self.copy(store, *cell, at as u32, outside);
            if self.cells.len() - start > MOST_CELLS {
                return Err(TooLarge);
            }
            at += 1;
        }
        Ok(start as u32)
    }

    /// What a cell of the store is among the copies, at `place`. Its parts go to the end.
    fn copy(&mut self, store: &Store, cell: Cell, place: u32, outside: &dyn Outside) -> Cell {
        let end = self.cells.len() as u32;
        match store.deref(cell) {
            Cell::Ref(var) => match self.vars.iter().find(|known| known.0 == var) {
                Some(known) => Cell::Ref(known.1),
                None => {
                    self.vars.push((var, place));
                    Cell::Ref(place)
                }
            },
            Cell::Pair(pair) => {
                self.cells.extend_from_slice(&store.pair_at(pair));
                Cell::Pair(end)
            }
            Cell::Struct(at) => {
                let (shape, parts) = store.parts(at);
                self.cells.push(Cell::Head(shape, parts.len() as u32));
                self.cells.extend_from_slice(parts);
                Cell::Struct(end)
            }
            Cell::Obj(at) if at < CONSTANT => self.object(store.object(at).clone()),
            Cell::Task(task) => self.object(outside.task(task)),
            other => other,
        }
    }

    fn object(&mut self, value: Value) -> Cell {
        self.objects.push(value);
        Cell::Obj(self.objects.len() as u32 - 1)
    }

    /// Puts all copies onto the heap. Returns what is to be added to their positions.
    pub fn put_back(&mut self, store: &mut Store) -> u32 {
        let (heap, objects) = (store.heap.len() as u32, store.objects.len() as u32);
        store.objects.append(&mut self.objects);
        store.heap.extend(self.cells.drain(..).map(|cell| match cell {
            Cell::Ref(at) => Cell::Ref(at + heap),
            Cell::Pair(at) => Cell::Pair(at + heap),
            Cell::Struct(at) => Cell::Struct(at + heap),
            Cell::Obj(at) if at < CONSTANT => Cell::Obj(at + objects),
            other => other,
        }));
        heap
    }
}
