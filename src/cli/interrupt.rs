//! Ctrl-C: the first one asks the run to stop between two instructions, a second one ends the
//! command at once.

use std::sync::atomic::{AtomicBool, Ordering};

static ASKED: AtomicBool = AtomicBool::new(false);

/// From now on Ctrl-C is a question.
pub fn listen() {
    // It fails where there is a handler already, and then there is nothing to do.
    let _ = ctrlc::set_handler(|| {
        if ASKED.swap(true, Ordering::SeqCst) {
            std::process::exit(super::INTERRUPTED.into());
        }
    });
}

/// True if the user wants the run to stop.
pub fn asked() -> bool {
    ASKED.load(Ordering::Relaxed)
}

/// The question has been answered.
pub fn answered() {
    ASKED.store(false, Ordering::SeqCst);
}
