//! Numbered jobs over threads. Each thread has a worker of its own, for sessions do not leave their thread.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;

use super::Stop;
use super::worker::{Program, Worker};

/// A worker does so many jobs; then it makes way for a new one, so that nothing piles up in its session.
const JOBS_OF_A_WORKER: usize = 500;

/// Compilers and drawing recur over nested forms.
const STACK_BYTES: usize = 256 << 20;

/// Results that may wait to be taken, for each thread.
const WAITING: usize = 16;

/// Does the jobs with numbers below `count` on so many threads. Results come to `take` as they are done, in any order.
///
/// # Errors
/// The first error of a job, of `take`, or of making a worker; or that `goes_on` has said no. Jobs that have been begun are
/// done and taken before.
pub fn spread<T: Send>(
    program: &Program,
    threads: usize,
    count: usize,
    goes_on: &(dyn Fn() -> bool + Sync),
    work: impl Fn(&mut Worker<'_>, usize) -> Result<T, Stop> + Sync,
    mut take: impl FnMut(usize, T) -> Result<(), Stop>,
) -> Result<(), Stop> {
    let (next, failed) = (AtomicUsize::new(0), AtomicBool::new(false));
    // Jobs that have been begun before an error come to their end: the first error is then the same however they run.
    let begins = || !failed.load(Ordering::Relaxed) && goes_on();
    let (sender, results) = mpsc::sync_channel(WAITING * threads.max(1));
    let on_a_thread = |sender: mpsc::SyncSender<(usize, Result<T, Stop>)>| {
        let mut worker: Option<(Worker<'_>, usize)> = None;
        while begins() {
            let job = next.fetch_add(1, Ordering::Relaxed);
            if job >= count {
                break;
            }
            if worker.as_ref().is_none_or(|(_, done)| *done >= JOBS_OF_A_WORKER) {
                match Worker::new(program, &goes_on) {
                    Ok(new) => worker = Some((new, 0)),
                    Err(stop) => {
                        let _ = sender.send((job, Err(stop)));
                        return;
                    }
                }
            }
            let Some((worker, done)) = &mut worker else { return };
            *done += 1;
            if sender.send((job, work(worker, job))).is_err() {
                return;
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..threads.clamp(1, count.max(1)) {
            let (sender, on_a_thread) = (sender.clone(), &on_a_thread);
            let thread = std::thread::Builder::new().stack_size(STACK_BYTES);
            if let Err(error) = thread.spawn_scoped(scope, move || on_a_thread(sender)) {
                return Err(Stop::Because(format!("there is no thread to work on: {error}")));
            }
        }
        drop(sender);
        let mut first: Option<(usize, Stop)> = None;
        let mut done = 0;
        for (job, result) in results {
            match result.and_then(|it| take(job, it)) {
                Ok(()) => done += 1,
                Err(stop) => {
                    failed.store(true, Ordering::Relaxed);
                    let stays =
                        |(at, it): &(usize, Stop)| *it != Stop::Asked && (*at < job || stop == Stop::Asked);
                    first = first.take().filter(stays).or(Some((job, stop)));
                }
            }
        }
        match first {
            Some((_, stop)) => Err(stop),
            None if done < count => Err(Stop::Asked),
            None => Ok(()),
        }
    })
}
