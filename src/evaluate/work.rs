//! What is missing of an experiment is done: variants are rehearsed, plans run, runs kept.

use std::path::Path;

use vm::persist::SavedTree;

use super::folder::{Folder, Head, Runs};
use super::spread::spread;
use super::worker::{Program, Worker};
use super::{Run, Stop};

/// Who watches an evaluation, and may stop it.
pub trait Watch: Sync {
    /// So many rehearsals or runs begin; some of them have been done before.
    fn begins(&self, what: &str, done: usize, of: usize);
    /// One of them has been done.
    fn did(&self);
    /// False stops the evaluation.
    fn goes_on(&self) -> bool;
}

/// What there is of an experiment.
pub struct Evaluated {
    /// What was evaluated.
    pub head: Head,
    /// Its runs.
    pub runs: Runs,
    /// It was stopped before all of them were done.
    pub stopped: bool,
}

/// Does what is missing of an experiment, the one with number `at` of the program. With a folder its runs are kept there, and
/// those that are there already are not done again.
///
/// # Errors
/// The folder cannot be used, or something has failed that is not the plan. What was done until then is kept.
pub fn evaluate(
    program: &Program,
    (at, head): (usize, Head),
    threads: usize,
    folder: Option<&Path>,
    watch: &dyn Watch,
) -> Result<Evaluated, Stop> {
    let (mut folder, mut runs, mut head, mut trees) = match folder {
        None => (None, Runs::new(), head, Vec::new()),
        Some(path) => {
            let (mut folder, runs) = Folder::open(path, head)?;
            let trees = folder.trees();
            let head = folder.head().clone();
            (Some(folder), runs, head, trees)
        }
    };
    trees.resize(head.experiment.cells(), None);
    match rehearse(program, (at, &mut head), threads, folder.as_mut(), &mut trees, watch) {
        Err(Stop::Asked) => return Ok(Evaluated { head, runs, stopped: true }),
        rehearsed => rehearsed?,
    }
    let it = &head.experiment;
    let wanted = head.wanted();
    let missing: Vec<_> = wanted
        .iter()
        .copied()
        .filter(|(case, variant, seed)| !runs.contains_key(&(*case, *seed, *variant)))
        .collect();
    watch.begins("runs", wanted.len() - missing.len(), wanted.len());
    let run = |worker: &mut Worker<'_>, job: usize| {
        let (case, variant, _) = missing[job];
        worker.run((at, it), missing[job], trees[it.cell(case, variant)].as_ref())
    };
    let keep = |_: usize, run: Run| {
        watch.did();
        if let Some(folder) = &mut folder {
            folder.add(&run)?;
        }
        runs.insert((run.case, run.seed, run.variant), run);
        Ok(())
    };
    let ended = spread(program, threads, missing.len(), &|| watch.goes_on(), run, keep);
    match ended {
        Ok(()) => {}
        Err(Stop::Asked) => return Ok(Evaluated { head, runs, stopped: true }),
        Err(stop) => return Err(stop),
    }
    if let Some(folder) = &mut folder {
        folder.finish(&runs)?;
    }
    Ok(Evaluated { head, runs, stopped: false })
}

/// Rehearses the variants in all cases in which that has not been done.
fn rehearse(
    program: &Program,
    (at, head): (usize, &mut Head),
    threads: usize,
    mut folder: Option<&mut Folder>,
    trees: &mut [Option<SavedTree>],
    watch: &dyn Watch,
) -> Result<(), Stop> {
    let unknown = head.unknown();
    let (cells, variants) = (head.experiment.cells(), head.experiment.variants.len());
    watch.begins("rehearsals", cells - unknown.len(), cells);
    spread(
        program,
        threads,
        unknown.len(),
        &|| watch.goes_on(),
        |worker, job| worker.rehearse(at, unknown[job] / variants, unknown[job] % variants),
        |job, (edits, tree)| {
            watch.did();
            let cell = unknown[job];
            if let Some(folder) = &mut folder {
                folder.set_edits(cell, edits.clone(), tree.as_ref())?;
            }
            head.edits[cell] = Some(edits);
            trees[cell] = tree;
            Ok(())
        },
    )
}
