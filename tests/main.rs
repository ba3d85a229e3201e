//! The tests of the language as a whole: programs in, what they print and the trees they grow out.
//!
//! [`run`] runs the programs under `run/`, each also under the [`treatments`]; [`diagnostics`]
//! the mistakes under `diagnostics/`; [`docs`] all programs in documents and docstrings;
//! [`clauses`] prints rules as the machine gets them; [`written`] reads back random values, [`saved`] trees of runs; [`limits`] what needs a program too large to be written; [`arrows`] reads the manifests.
//! [`store`] kills and resumes runs; [`evaluate`] makes tables of many; [`transport`] runs robots over many seeds.
//! Only [`program`] knows how a program is loaded and run, only [`folder`] how the command is called.
//!
//! `UPDATE_EXPECT=1` writes what came out over what was expected: read the difference.

mod agreement;
mod arrows;
mod clauses;
mod cmd;
mod concurrency;
mod diagnostics;
mod dice;
mod docs;
mod evaluate;
mod expected;
mod fluents;
mod folder;
mod fuzz_regressions;
mod inlined;
mod limits;
mod oracle;
mod pictures;
mod program;
mod repl;
mod rules;
mod run;
mod saved;
mod store;
mod transport;
mod treatments;
mod variants;
mod written;
