//! Terms that nothing needs any more are taken away.
//!
//! A deterministic loop makes terms and forgets them; nothing goes back there that would free them. So
//! when the heap has doubled, all cells that something can still reach are marked, then moved together, in
//! their order. The order is what makes this fit an engine that goes back: what a choice protects is still what lies
//! below its mark, and the younger of two variables still refers to the older.
//!
//! Something can be reached from registers that clauses need where they go on ([`super::live`]), from
//! arguments that choices keep, and from the answer. Other registers may hold what they like: nobody
//! looks at them before they get a new value. Values from outside that no cell holds go as well.

use super::Rules;
use super::choice::Alternative;
use super::engine::Engine;
use super::store::{CONSTANT, Cell, Mark, Store};

/// A set of numbers that knows how many are below each.
struct Bits {
    words: Vec<u64>,
    below: Vec<u32>,
}

impl Bits {
    fn new(n: usize) -> Bits {
        Bits { words: vec![0; n / 64 + 1], below: Vec::new() }
    }

    /// Adds a number: true if it was not there.
    fn add(&mut self, at: u32) -> bool {
        let (word, bit) = (&mut self.words[at as usize / 64], 1 << (at % 64));
        let new = *word & bit == 0;
        *word |= bit;
        new
    }

    fn has(&self, at: u32) -> bool {
        self.words[at as usize / 64] & (1 << (at % 64)) != 0
    }

    /// Nothing is added any more.
    fn count(&mut self) {
        let mut sum = 0;
        self.below = Vec::with_capacity(self.words.len());
        for word in &self.words {
            self.below.push(sum);
            sum += word.count_ones();
        }
    }

    /// How many are below.
    fn below(&self, at: u32) -> u32 {
        let word = at as usize / 64;
        self.below[word] + (self.words[word] & ((1 << (at % 64)) - 1)).count_ones()
    }
}

/// What can be reached.
struct Marks {
    cells: Bits,
    objects: Bits,
    /// Cells that are marked, but not what they refer to.
    todo: Vec<u32>,
}

impl Marks {
    fn new(store: &Store) -> Marks {
        let (cells, objects) = (Bits::new(store.heap.len()), Bits::new(store.objects.len()));
        Marks { cells, objects, todo: Vec::new() }
    }

    /// A cell can be reached, and all that it is made of. It is made as short as can be.
    fn reach(&mut self, store: &mut Store, cell: &mut Cell) {
        self.refers(store, cell);
        while let Some(at) = self.todo.pop() {
            let mut cell = store.heap[at as usize];
            self.refers(store, &mut cell);
            store.heap[at as usize] = cell;
        }
    }

    fn refers(&mut self, store: &Store, cell: &mut Cell) {
        // A variable that is younger than all choices keeps its value as long as it is there.
        while let Cell::Ref(at) = *cell
            && at >= store.old
        {
            match store.heap[at as usize] {
                Cell::Ref(next) if next == at => break,
                next => *cell = next,
            }
        }
        match *cell {
            Cell::Ref(at) => self.add(at),
            Cell::Pair(at) => {
                self.add(at);
                self.add(at + 1);
            }
            Cell::Struct(at) => {
                let parts = store.parts(at).1.len() as u32;
                (at..=at + parts).for_each(|part| self.add(part));
            }
            Cell::Obj(at) if at < CONSTANT => {
                self.objects.add(at);
            }
            Cell::Imm(_) | Cell::Obj(_) | Cell::Head(..) | Cell::Task(_) => {}
        }
    }

    fn add(&mut self, at: u32) {
        if self.cells.add(at) {
            self.todo.push(at);
        }
    }

    /// Where a cell refers to when all have moved.
    fn moved(&self, cell: &mut Cell) {
        match cell {
            Cell::Ref(at) | Cell::Pair(at) | Cell::Struct(at) => *at = self.cells.below(*at),
            Cell::Obj(at) if *at < CONSTANT => *at = self.objects.below(*at),
            Cell::Imm(_) | Cell::Obj(_) | Cell::Head(..) | Cell::Task(_) => {}
        }
    }

    fn compact(&self, store: &mut Store) {
        let mut to = 0;
        for at in 0..store.heap.len() {
            if self.cells.has(at as u32) {
                let mut cell = store.heap[at];
                self.moved(&mut cell);
                store.heap[to] = cell;
                to += 1;
            }
        }
        store.heap.truncate(to);
        let mut at = 0;
        store.objects.retain(|_| {
            at += 1;
            self.objects.has(at - 1)
        });
    }
}

impl Engine {
    /// Takes away what cannot be reached. The next instruction is a call.
    pub(super) fn collect(&mut self, rules: &Rules) {
        let registers = self.registers(rules);
        let mut marks = Marks::new(&self.store);
        self.each_root(&registers, |store, cell| marks.reach(store, cell));
        marks.cells.count();
        marks.objects.count();
        self.each_root(&registers, |_, cell| marks.moved(cell));
        marks.compact(&mut self.store);
        self.move_trail(&marks);
        self.look_at_newest();
    }

    /// The registers that are needed: positions on the stack, each once.
    fn registers(&mut self, rules: &Rules) -> Vec<u32> {
        let mut found = Vec::new();
        let mut seen = Bits::new(self.frames.len());
        let mut needed = vec![(self.pc, self.base, None)];
        let mut frames = vec![self.frame];
        for choice in &self.choices {
            frames.push(choice.frame);
            match &choice.alternative {
                Alternative::Code(pc) => needed.push((pc.0, choice.base, None)),
                // The register that takes the instances has none yet.
                Alternative::Groups(window, groups) => {
                    needed.push((groups.pc, choice.base, Some(window + 2)));
                }
                _ => {}
            }
        }
        for mut at in frames {
            while seen.add(at) {
                let frame = self.frames[at as usize];
                needed.push((frame.pc, frame.base, None));
                at = frame.parent;
            }
        }
        needed.sort_unstable();
        needed.dedup();
        for (pc, base, but) in needed {
            let live = self.live(rules, pc);
            let registers = live.registers.iter().filter(|register| but != Some(**register));
            found.extend(registers.map(|register| base + u32::from(*register)));
        }
        found.sort_unstable();
        found.dedup();
        found
    }

    /// Visits all that must not go, each place once.
    fn each_root(&mut self, registers: &[u32], mut visit: impl FnMut(&mut Store, &mut Cell)) {
        let store = &mut self.store;
        visit(store, &mut self.template);
        for register in registers {
            visit(store, &mut self.stack[*register as usize]);
        }
        for cell in &mut self.saved {
            visit(store, cell);
        }
        for choice in &mut self.choices {
            match &mut choice.alternative {
                Alternative::Native(alternatives) => {
                    alternatives.terms().iter_mut().for_each(|cell| visit(store, cell));
                }
                Alternative::Groups(_, groups) => visit(store, &mut groups.key),
                _ => {}
            }
        }
        if let Some(trace) = &mut self.trace {
            trace.terms().for_each(|cell| visit(store, cell));
        }
    }

    /// The marks of choices are where their cells are now. A binding is forgotten on the way back only if the
    /// variable is there and older than the choice.
    fn move_trail(&mut self, marks: &Marks) {
        let trail = std::mem::take(&mut self.store.trail);
        let mut from = 0;
        let ends = self.choices.iter().skip(1).map(|choice| choice.mark.trail).chain([trail.len() as u32]);
        let ends: Vec<u32> = ends.collect();
        for (choice, end) in self.choices.iter_mut().zip(ends) {
            let old = choice.mark;
            // What lies below the first choice's part was noted for choices that have been cut away.
            from = from.max(old.trail);
            choice.mark = Mark {
                heap: marks.cells.below(old.heap),
                trail: self.store.trail.len() as u32,
                objects: marks.objects.below(old.objects),
            };
            let part = &trail[from as usize..end.max(from) as usize];
            let kept = part.iter().filter(|at| **at < old.heap && marks.cells.has(**at));
            self.store.trail.extend(kept.map(|at| marks.cells.below(*at)));
            from = end;
        }
    }
}
