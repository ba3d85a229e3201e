//! The `pleach` command.
fn main() {
    let path = std::env::args().nth(1).unwrap_or_default();
    let mut session = pleach::Session::new(pleach::Options::default());
    let loaded = session.load_file(std::path::Path::new(&path)).unwrap();
    let mut out = String::new();
    for r in &loaded.reports { println!("{}", session.report(r)); }
    let ended = session.run(loaded, None, &mut out);
    print!("{out}");
    match ended {
        pleach::Ended::Ran(Err(f)) | pleach::Ended::NotLoaded(f) => println!("{}", pleach::render::failure(&session.files, &f)),
        e => println!("{e:?}"),
    }
    println!("{}", vm::show::text(&session.machine.program, session.machine.tree(), 100));
}
