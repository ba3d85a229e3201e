//! A moment of a run that stands: what its tasks wait for, what fluents hold, the world, what the robot believes.
//!
//! The REPL shows the first two of a run that is stopped there, `pleach replay --to` all of it.

use pleach::Session;
use serde_json::{Value as Json, json};
use vm::path::PathEnd;
use vm::show::safe;
use vm::value::{Obj, Value};

use super::{Trouble, settings};

/// The moment that a replay goes to.
#[derive(Debug, Clone)]
pub enum Target {
    /// So many calls and backward jumps.
    Step(u64),
    /// All has happened that happens until then, in nanoseconds of the task clock.
    Time(u64),
    /// A task whose path ends so begins.
    Path(String),
}

impl Target {
    /// `3000`, `12.5s`, `transporting :call 2 / fetching`
    pub fn read(text: &str) -> Result<Target, String> {
        let wrong = || {
            format!(
                "`{text}` is no moment: a step is 3000, a time 12.5s, a task `transporting :call 2 / fetching`"
            )
        };
        let is_number = |text: &str| {
            text.starts_with(|c: char| c.is_ascii_digit() || c == '.')
                && text.bytes().all(|byte| byte.is_ascii_digit() || matches!(byte, b'_' | b'.'))
        };
        match text.strip_suffix('s') {
            _ if is_number(text) => settings::count(text).map(Target::Step).map_err(|_| wrong()),
            Some(number) if is_number(number) => settings::time(text).map(Target::Time).map_err(|_| wrong()),
            _ => PathEnd::parse(text).map(|_| Target::Path(text.into())).ok_or_else(wrong),
        }
    }

    /// Makes the run of a session stop there.
    pub fn set(&self, session: &mut Session) {
        match self {
            Target::Step(step) => session.stop_at = Some(*step),
            Target::Time(ns) => session.machine.stop_clock_at(*ns),
            Target::Path(text) => session.machine.break_at(PathEnd::parse(text).into_iter().collect()),
        }
    }

    /// Why a run that does not stand there has not come there; nothing for a step, which shows what there is.
    pub fn missed(&self, session: &Session) -> Option<Trouble> {
        let machine = &session.machine;
        let end = vm::show::seconds(machine.now());
        let ended = if session.log_ended { "the log ends at" } else { "it ended at" };
        match self {
            Target::Time(ns) if !machine.is_at_end_of_clock() && *ns > machine.now() => {
                let what =
                    format!("the run did not last until {} s: {ended} {end} s", vm::show::seconds(*ns));
                Some(Trouble::new(what, format!("name an earlier time, as in --to {end}s")))
            }
            Target::Path(text) if machine.stopped_at().is_none() => {
                let what =
                    format!("no task with a path that ends with `{}` began; {ended} {end} s", safe(text));
                Some(Trouble::new(what, near(session, text)))
            }
            _ => None,
        }
    }
}

/// The paths that were probably meant.
fn near(session: &Session, text: &str) -> String {
    const MOST: usize = 5;
    let tree = session.machine.tree();
    let last = text.rsplit('/').next().unwrap_or_default();
    let last = last.split_whitespace().next().unwrap_or_default().trim_end_matches("[*]");
    let slots = || tree.slots().filter(|slot| tree.shown(*slot).is_some());
    let names = || slots().map(|slot| tree.slot(slot).name.as_str());
    let shown = |name: &str| -> Vec<String> {
        let same = slots().filter(|slot| tree.slot(*slot).name == name).take(MOST);
        same.map(|slot| vm::path::Path::of(tree, slot).show()).collect()
    };
    let paths = shown(last);
    if !paths.is_empty() {
        return format!("tasks called `{}` are: {}", safe(last), safe(&paths.join(", ")));
    }
    let longer = || names().find(|name| !last.is_empty() && name.contains(last));
    match compiler::module::nearest(last, names()).or_else(longer) {
        Some(name) => format!("did you mean {}?", safe(&shown(name).join(", or "))),
        None => "`pleach tree STORE RUN` shows which tasks there are".into(),
    }
}

/// What is shown of a moment besides the tree.
pub struct Moment {
    tasks: Vec<(String, String)>,
    fluents: Vec<(Option<String>, String, String)>,
    beliefs: Option<Json>,
    world: Option<Json>,
}

impl Moment {
    /// The moment at which a run stands.
    pub fn of(session: &mut Session) -> Moment {
        let now_ns = session.machine.now();
        let slot = session.machine.world();
        let world = slot.as_mut().and_then(|it| it.as_any().downcast_mut::<world::world::World>());
        let (world, beliefs) = match world.and_then(|it| Some((it.moment(now_ns)?, it.beliefs()))) {
            Some((world, beliefs)) => (Some(world), Some(beliefs)),
            None => (None, None),
        };
        Moment { tasks: tasks(session), fluents: fluents(session), beliefs, world }
    }

    /// For people.
    pub fn text(&self) -> String {
        let mut text = part("tasks", task_lines(&self.tasks));
        text += &part("fluents", fluent_lines(&self.fluents));
        if let Some(world) = &self.world {
            text += &part("world", world_lines(world));
        }
        if let Some(beliefs) = &self.beliefs {
            text += &part("what the robot believes", belief_lines(beliefs));
        }
        text
    }

    /// Adds it to what is said of the run.
    pub fn add_to(self, json: &mut Json) {
        let task = |(path, what): &(String, String)| json!({"path": path, "what": what});
        json["tasks"] = self.tasks.iter().map(task).collect();
        let fluent = |(name, fluent, value): &(Option<String>, String, String)| json!({"name": name, "fluent": fluent, "value": value});
        json["fluents"] = self.fluents.iter().map(fluent).collect();
        json["world"] = self.world.unwrap_or_default();
        json["beliefs"] = self.beliefs.unwrap_or_default();
    }
}

/// Lines below a heading; nothing for none.
fn part(heading: &str, lines: Vec<String>) -> String {
    if lines.is_empty() {
        return String::new();
    }
    let lines: String = lines.iter().map(|line| format!("  {}\n", safe(line))).collect();
    format!("{heading}\n{lines}")
}

/// Paths of the tasks of the innermost run that have not ended, and what each does.
pub fn tasks(session: &Session) -> Vec<(String, String)> {
    session.machine.tasks().into_iter().map(|(path, what)| (path.show(), what)).collect()
}

/// A line for each.
pub fn task_lines(tasks: &[(String, String)]) -> Vec<String> {
    tasks.iter().map(|(path, what)| format!("{path} {what}")).collect()
}

/// The fluents that are in use: the name of the constant that holds it, itself, its value.
pub fn fluents(session: &Session) -> Vec<(Option<String>, String, String)> {
    let found = session.machine.fluents().into_iter();
    found
        .map(|(name, fluent)| {
            let value = match fluent.obj() {
                Some(Obj::Fluent(it)) => it.value(),
                _ => Value::NIL,
            };
            (name.map(|name| name.to_string()), session.write(&fluent), session.write(&value))
        })
        .collect()
}

/// A line for each.
pub fn fluent_lines(fluents: &[(Option<String>, String, String)]) -> Vec<String> {
    let line = |(name, fluent, value): &(Option<String>, String, String)| {
        let name = name.as_ref().map_or_else(String::new, |name| format!("{name} "));
        format!("{name}{fluent} holds {value}")
    };
    fluents.iter().map(line).collect()
}

/// Where a pose is: its place in metres.
fn place(pose: &Json) -> String {
    let part = |at: usize| format!("{:.3}", pose[at].as_f64().unwrap_or_default());
    format!("({} {} {})", part(0), part(1), part(2))
}

/// Which way a pose looks from above, in degrees.
fn turn(pose: &Json) -> String {
    let part = |at: usize| pose[at].as_f64().unwrap_or_default();
    let (x, y, z, w) = (part(3), part(4), part(5), part(6));
    let yaw = (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z));
    format!("{:.0}", yaw.to_degrees() + 0.0)
}

fn entries(json: &Json) -> impl Iterator<Item = (&String, &Json)> {
    json.as_object().into_iter().flatten()
}

fn items(json: &Json) -> impl Iterator<Item = &Json> {
    json.as_array().into_iter().flatten()
}

fn word(json: &Json) -> &str {
    json.as_str().unwrap_or_default()
}

fn world_lines(world: &Json) -> Vec<String> {
    let mut lines = Vec::new();
    let robot = &world["robot"];
    if robot.is_object() {
        let base = &robot["base"];
        lines.push(format!("{} at {}, turned by {}°", word(&robot["name"]), place(base), turn(base)));
    }
    for motion in items(&world["motions"]) {
        let (begin, lasts) = (&motion["begin"], &motion["lasts"]);
        lines.push(format!("it is {} since {begin} s, for {lasts} s", word(&motion["motion"])));
    }
    lines.extend(entries(&world["hands"]).map(|(arm, what)| format!("{arm} hand holds {}", word(what))));
    let object =
        |it: &Json| format!("{} on {} at {}", word(&it["name"]), word(&it["on"]), place(&it["pose"]));
    lines.extend(items(&world["objects"]).map(object));
    let open = entries(&world["containers"]).filter(|(_, by)| by.as_f64().is_some_and(|by| by != 0.0));
    lines.extend(open.map(|(name, by)| format!("{name} is open by {by}")));
    lines
}

fn belief_lines(beliefs: &Json) -> Vec<String> {
    let seen = items(&beliefs["seen"]);
    let seen =
        seen.map(|it| format!("{} at {}, known at {} s", word(&it["name"]), place(&it["pose"]), it["at"]));
    let open = entries(&beliefs["open"]).map(|(name, by)| format!("{name} was left open by {by}"));
    seen.chain(open).collect()
}

#[cfg(test)]
mod tests {
    use super::Target;

    #[test]
    fn moments_are_steps_times_and_paths() {
        assert!(matches!(Target::read("3_000"), Ok(Target::Step(3000))));
        assert!(matches!(Target::read("12.5s"), Ok(Target::Time(12_500_000_000))));
        assert!(matches!(Target::read("fetch :call 2 / drives"), Ok(Target::Path(_))));
        assert!(matches!(Target::read("s"), Ok(Target::Path(_))));
        for wrong in ["", "12.5", "1.s", "a / ", "(a)", "fetch :call 0"] {
            assert!(Target::read(wrong).is_err(), "{wrong}");
        }
    }
}
