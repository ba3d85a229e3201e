//! Programs: compiled, run with little fuel, their trees shown. Nothing panics, and no task is left
//! running.

#![no_main]

use std::cell::RefCell;

use libfuzzer_sys::{fuzz_mutator, fuzz_target};
use pleach::{Options, Session};

fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
    let text = String::from_utf8_lossy(&data[..size]).into_owned();
    match pleach_fuzz::mutate(&text, max_size.min(4096), seed.into()) {
        Some(text) if !seed.is_multiple_of(8) => {
            data[..text.len()].copy_from_slice(text.as_bytes());
            text.len()
        }
        _ => libfuzzer_sys::fuzzer_mutate(data, size, max_size),
    }
});

const FUEL: u64 = 5_000;
/// Loading the library takes longer than most programs: a session serves so many of them.
const PROGRAMS: usize = 300;

fn session() -> Session {
    let mut options = Options::default();
    options.limits.depth = 2_000;
    options.limits.memory = 256 << 20;
    Session::new(options)
}

thread_local! {
    static SESSION: RefCell<(Session, usize)> = RefCell::new((session(), 0));
}

fuzz_target!(|bytes: &[u8]| {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    SESSION.with_borrow_mut(|(session, served)| {
        *served += 1;
        if served.is_multiple_of(PROGRAMS) {
            *session = self::session();
        }
        session.machine.restart(false);
        session.machine.limits.fuel = session.machine.steps() + FUEL;
        let _ = session.run_text("fuzz.plan", text);
        let (program, tree) = (&session.machine.program, session.machine.tree());
        for rec in tree.records() {
            assert!(
                tree.record(rec).status.is_final() || rec == vm::tree::RecId(1),
                "a run ends what it began"
            );
        }
        let _ = vm::show::json(program, tree).to_string();
        let _ = vm::show::text(program, tree, 1_000);
    });
});
