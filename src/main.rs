//! The `pleach` command: see [`cli`].

mod cli;
mod repl;

use std::process::ExitCode;

/// Forms may nest 1,000 deep, and the compiler walks them by recursion.
const STACK_BYTES: usize = 256 << 20;

fn main() -> ExitCode {
    let work = std::thread::Builder::new().stack_size(STACK_BYTES).spawn(cli::main);
    match work.map(std::thread::JoinHandle::join) {
        Ok(Ok(code)) => ExitCode::from(code),
        Ok(Err(_)) => {
            cli::term::complain("this is a bug of pleach, not of your program: please report it\n");
            ExitCode::from(101)
        }
        Err(error) => {
            cli::term::complain(&format!(
                "error: there is no memory for a stack of {STACK_BYTES} bytes: {error}\n"
            ));
            ExitCode::from(2)
        }
    }
}
