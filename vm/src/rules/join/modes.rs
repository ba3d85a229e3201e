//! What is known of the variables of a join while its goals are read as they are written.
//!
//! A test, like a negation, may become part of a join only if it holds once at the most and looks for few tasks
//! itself: it is asked for each tuple that the join finds.

use super::{Cond, Rel};

/// What is known of variables while goals are read as they are written.
#[derive(Debug, Clone, Copy, Default)]
pub struct Modes {
    /// Those that have values.
    pub known: u64,
    /// Those that stand for something inside of a test only: nobody else may look at them.
    pub hidden: u64,
}

impl Modes {
    /// True if a goal holds once at the most, and never looks for something without end. Then its variables are
    /// known after it.
    pub fn is_single(&mut self, cond: &Cond) -> bool {
        let mut finds = 0;
        self.walk(cond, true, &mut finds) && finds == 0
    }

    /// `single`: it must hold once at the most; else it is only asked whether it holds, and may look for the
    /// tasks of one list.
    fn walk(&mut self, cond: &Cond, single: bool, finds: &mut u32) -> bool {
        if cond.vars() & self.hidden != 0 {
            return false;
        }
        match cond {
            Cond::Rel(rel) => {
                let is_known = rel.vars() & !self.known == 0;
                let looks = rel.looks_for(self.known).count() as u32;
                let is_test = matches!(rel, Rel::Same(..)) && rel.vars() & self.known != 0;
                *finds += looks;
                self.known |= rel.vars();
                let fits = match rel {
                    Rel::Same(..) => is_test || is_known,
                    Rel::Form(..) => is_known,
                    _ => true,
                };
                fits && (looks == 0 || !single && *finds <= 1)
            }
            Cond::All(all) => all.iter().all(|it| self.walk(it, single, finds)),
            Cond::Any(all) => {
                let mut after = u64::MAX;
                let mut inside = 0;
                for it in all {
                    let mut modes = *self;
                    if !modes.walk(it, single, finds) {
                        return false;
                    }
                    after &= modes.known;
                    inside |= it.vars();
                }
                if !all.is_empty() {
                    self.known |= after & inside;
                    self.hidden |= inside & !self.known;
                }
                !single || all.len() < 2
            }
            Cond::Not(it) => {
                let mut modes = *self;
                let mut inner = 0;
                let fits = modes.walk(it, false, &mut inner);
                *finds += if single { 0 } else { inner };
                self.hidden |= it.vars() & !self.known;
                fits
            }
            Cond::If(test, then, otherwise) => {
                let (mut yes, mut no) = (*self, *self);
                let mut inner = 0;
                let fits = yes.walk(test, false, &mut inner) && yes.walk(then, true, &mut 0);
                *finds += if single { 0 } else { inner };
                self.hidden |= cond.vars() & !self.known;
                fits && no.walk(otherwise, true, &mut 0)
            }
        }
    }
}

/// The variables that have values when a test holds.
pub(super) fn binds(cond: &Cond) -> u64 {
    match cond {
        Cond::Rel(rel) => rel.vars(),
        Cond::All(all) => all.iter().fold(0, |vars, it| vars | binds(it)),
        Cond::Any(all) => all.iter().map(binds).reduce(|a, b| a & b).unwrap_or(0),
        Cond::Not(_) => 0,
        // Nobody looks at what it finds.
        Cond::If(..) => 0,
    }
}
