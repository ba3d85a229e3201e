//! Where something stands: the forms around it, from the root of the tree inwards.
//!
//! Two places can be compared from the outside in; what they have in common is the form that
//! contains both. The place of a slot does not go through the code that edits put around it.

use std::rc::Rc;

use vm::key::Step;

/// A part of a form that is done in one go.
#[derive(Debug, Clone, PartialEq)]
pub enum Part {
    /// An expression in the form, known by its address.
    Expr(usize),
    /// A round of a loop over elements or numbers.
    Round(Step),
    /// A round of another loop: its rounds are one place.
    Turn,
    /// The body of a function that is called, known by its address.
    Body(usize),
    /// The body of `with-failure-handling`.
    Guarded,
    /// One of its clauses.
    Clause(usize),
    /// The clean-up of `unwind-protect`.
    CleanUp,
    /// What runs in the node of a slot.
    Node(usize),
    /// A branch of a parallel form, or its round of one that goes over a list.
    Branch(usize, Option<Step>),
    /// The code of an edit.
    Code(usize),
}

/// The parts around a place, innermost first.
#[derive(Clone, Default)]
pub struct Place(Option<Rc<(Part, Place)>>);

/// Tail calls may make it long.
impl Drop for Place {
    fn drop(&mut self) {
        let mut next = self.0.take();
        while let Some(it) = next {
            next = Rc::try_unwrap(it).ok().and_then(|mut it| it.1.0.take());
        }
    }
}

impl Place {
    /// A part of this.
    #[must_use]
    pub fn inside(&self, part: Part) -> Place {
        Place(Some(Rc::new((part, self.clone()))))
    }
    /// What this is a part of.
    pub fn around(&self) -> Place {
        self.0.as_ref().map(|it| it.1.clone()).unwrap_or_default()
    }
    /// All parts, from the root.
    pub fn parts(&self) -> Vec<Part> {
        let inwards = std::iter::successors(self.0.as_ref(), |it| it.1.0.as_ref());
        let mut parts: Vec<Part> = inwards.map(|it| it.0.clone()).collect();
        parts.reverse();
        parts
    }
    /// The part of this place that `inner` lies in, if it lies in this place.
    pub fn part_with(&self, inner: &Place) -> Option<Part> {
        let (outer, inner) = (self.parts(), inner.parts());
        (inner.starts_with(&outer) && inner.len() > outer.len()).then(|| inner[outer.len()].clone())
    }
}
