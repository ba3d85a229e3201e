//! Call sites in words.

use super::Words;

use crate::code::{FnId, FnKind, Program, SiteId};

/// Functions in the order of their code: those inside of another one stand right before it.
fn with_inner(program: &Program, function: FnId) -> Option<(usize, usize)> {
    let entry = program.functions.get(function.at())?.entry;
    let first = program.extents.partition_point(|(at, _)| *at < entry);
    let same = program.extents[first..].iter().take_while(|(at, _)| *at == entry);
    let at = first + same.map(|(_, id)| *id).position(|id| id == function)?;
    let before = program.extents[..at].iter().rev();
    Some((at, before.take_while(|(_, id)| is_inner(program, *id)).count()))
}

fn is_inner(program: &Program, function: FnId) -> bool {
    matches!(program.functions[function.at()].kind, FnKind::Lambda | FnKind::Branch)
}

impl Words {
    /// The words for a site.
    #[must_use]
    pub fn of(program: &Program, site: SiteId) -> Option<Words> {
        let it = program.sites.get(site.at())?;
        let range = program.functions[it.owner.at()].sites.clone();
        let same = (range.start..=site.0).filter(|at| program.sites[*at as usize].name == it.name);
        let nth = same.count() as u32;
        let (mut owner, mut inner) = (it.owner, 0);
        if is_inner(program, owner) {
            let (at, before) = with_inner(program, owner)?;
            inner = before as u32 + 1;
            let outer = program.extents[at..].iter().map(|(_, id)| *id);
            owner = outer.into_iter().find(|id| !is_inner(program, *id))?;
        }
        let function = &program.functions[owner.at()];
        let owner = Some(function.name).filter(|_| function.kind != FnKind::Inserted);
        Some(Words { owner, inner, name: it.name, nth })
    }

    /// The site that they mean in the function `owner`, or in one inside of that.
    #[must_use]
    pub fn find_in(&self, program: &Program, owner: FnId) -> Option<SiteId> {
        let mut owner = owner;
        if let Some(inner) = self.inner.checked_sub(1) {
            let (at, before) = with_inner(program, owner)?;
            let inner = (inner as usize) < before;
            let first = at.checked_sub(before)?;
            owner = inner.then(|| program.extents[first + self.inner as usize - 1].1)?;
        }
        let range = program.functions[owner.at()].sites.clone();
        let mut same = range.filter(|at| program.sites[*at as usize].name == self.name);
        same.nth(self.nth.checked_sub(1)? as usize).map(SiteId)
    }

    /// The site that they mean: in the code of an edit, in the plan that is called above it, else in the first function
    /// of that name that has it.
    #[must_use]
    pub fn find(&self, program: &Program, code: Option<FnId>, above: Option<FnId>) -> Option<SiteId> {
        let Some(owner) = self.owner else { return self.find_in(program, code?) };
        let named = |id: &FnId| {
            let it = &program.functions[id.at()];
            it.name == owner && !matches!(it.kind, FnKind::Inserted | FnKind::Lambda | FnKind::Branch)
        };
        let all = (0..program.functions.len() as u32).map(FnId);
        let mut candidates = above.into_iter().chain(all).filter(named);
        candidates.find_map(|function| self.find_in(program, function))
    }
}
