//! REPL
use clap::Args;
use crate::cli::Answer;
pub const HELP: &str = "";
#[derive(Args)]
pub struct Repl { file: Option<std::path::PathBuf> }
pub fn run(_it: &Repl) -> Answer { Ok(0) }
