//! Turns `src/grammar.lalrpop` and `src/prolog.lalrpop` into the tables of the parsers.

fn main() {
    lalrpop::Configuration::new()
        .use_cargo_dir_conventions()
        .emit_rerun_directives(true)
        .process_dir("src")
        .expect("the files in src are grammars");
}
