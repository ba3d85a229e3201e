//! Turns `src/grammar.lalrpop` into the tables of the parser.

fn main() {
    lalrpop::Configuration::new()
        .use_cargo_dir_conventions()
        .emit_rerun_directives(true)
        .process_dir("src")
        .expect("src/grammar.lalrpop is a grammar");
}
