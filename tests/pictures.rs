//! Pictures in documents are what the programs beside them give.

use std::path::Path;

use pleach::{Options, Session};
use world::world::{Mode, World};

use crate::expected::{check_file, report};

#[test]
fn the_picture_of_the_kitchen_is_what_the_example_gives() {
    let program = Path::new("examples/12-world/main.plan");
    let mut session = Session::new(Options::default());
    *session.machine.world() = Some(Box::new(World::empty(Mode::Projected, true)));
    let loaded = session.load_file(program).expect("the example is read");
    session.run(loaded, None, &mut String::new());
    let end_ns = session.machine.now();
    let world = session.machine.world().as_mut().and_then(|it| it.as_any().downcast_mut::<World>());
    let recording = world.and_then(|it| it.recording.clone()).expect("it was recorded");
    let picture = recording.picture("main.plan, main", end_ns);
    report(
        &check_file(Path::new("examples/12-world/picture.svg"), &picture)
            .err()
            .into_iter()
            .collect::<Vec<_>>(),
    );
}
