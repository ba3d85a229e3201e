//! Scenes from the language: a list of entries, each `(a kind (property value…) …)`.
//!
//! | entry | properties |
//! |---|---|
//! | `room` | `from x y`, `to x y`, `height`, `thickness` of its four walls |
//! | `wall` | `from x y`, `to x y`, `height`, `thickness` |
//! | `furniture` | `name`, `at x y yaw`; `box`, `cylinder`, `surface`, `door`, `drawer` |
//! | `object-type` | `name`, `box` or `cylinder` …, `mass`, `friction`, `grasps side…`, `grasp`, `two-hands`, `carries` |
//! | `object` | `name`, `type`, `on surface`, `at x y yaw` there or `at x y z yaw` in the world |
//!
//! Lengths in metres, angles in radians, masses in kilograms. All mistakes are reported, not only the first.

use nalgebra::{Isometry3, Unit, Vector3};
use vm::value::Value;

use crate::read::{Entry, Mistake};
use crate::robot::error::nearest;
use crate::shape::{PosedShape, Shape};

use super::grasp::{Grasp, Hands, LIFT_M, PRE_GRASP_M, Side, tool};
use super::{
    Container, ContainerId, Fixture, FixtureId, Handle, Hinge, Kind, Object, Scene, Surface, Tray, boxed,
    upright,
};

const KINDS: [&str; 5] = ["room", "wall", "furniture", "object-type", "object"];
/// Entries of a scene; rooms have hundreds.
const MOST_ENTRIES: usize = 10_000;
/// Friction where nothing is said: wood, plastic and glass on each other.
const FRICTION: f64 = 0.6;

impl Scene {
    /// Reads a list of entries.
    ///
    /// # Errors
    /// All mistakes in it, in the order of the text.
    pub fn read(entries: &Value) -> Result<Scene, Vec<Mistake>> {
        let Some(list) = entries.to_vec() else {
            let help = "write (def-scene kitchen \"what it is\" (a room …) (a furniture …) …)";
            return Err(vec![Mistake::new("the scene", "is no list of entries", help)]);
        };
        if list.len() > MOST_ENTRIES {
            let problem = format!("has {} entries, more than {MOST_ENTRIES}", list.len());
            return Err(vec![Mistake::new("the scene", problem, "leave some out")]);
        }
        let (mut scene, mut mistakes) = (Scene::default(), Vec::new());
        for (number, value) in list.iter().enumerate() {
            let read = Entry::of(value, "the scene", number + 1).and_then(|entry| scene.add(&entry));
            mistakes.extend(read.err());
        }
        if mistakes.is_empty() {
            mistakes = super::check::mistakes(&scene);
        }
        if mistakes.is_empty() { Ok(scene) } else { Err(mistakes) }
    }

    fn add(&mut self, entry: &Entry) -> Result<(), Mistake> {
        match entry.kind.as_str() {
            "room" => self.add_room(entry)?,
            "wall" => self.add_wall(entry)?,
            "furniture" => self.add_furniture(entry)?,
            "object-type" => {
                let kind = kind(entry)?;
                self.is_new(entry, "object-type", &kind.name, |scene| scene.kind(&kind.name).is_some())?;
                self.kinds.push(kind);
            }
            "object" => self.add_object(entry)?,
            other => {
                let help = match nearest(other, KINDS.into_iter()) {
                    Some(meant) => format!("probably `{meant}` is meant"),
                    None => format!("there are: {}", KINDS.join(", ")),
                };
                return Err(entry.wrong(format!("`{other}` is no kind of entry"), help));
            }
        }
        entry.done()
    }

    fn is_new(
        &self,
        entry: &Entry,
        what: &str,
        name: &str,
        known: impl Fn(&Scene) -> bool,
    ) -> Result<(), Mistake> {
        match known(self) {
            true => Err(entry.wrong(format!("a second {what} is called `{name}`"), "give it another name")),
            false => Ok(()),
        }
    }

    // ------------------------------------------------------------------ rooms and furniture

    fn add_room(&mut self, entry: &Entry) -> Result<(), Mistake> {
        let corner = |key: &str| {
            let given = entry.numbers(key, 2, 2)?;
            given.ok_or_else(|| entry.missing(key, format!("write ({key} 0 0)")))
        };
        let (from, to) = (corner("from")?, corner("to")?);
        let (height, thickness) =
            (entry.positive("height", Some(2.5))?, entry.positive("thickness", Some(0.1))?);
        let name = entry.name("name")?.unwrap_or_else(|| "room".into());
        let (x0, x1) = (from[0].min(to[0]), from[0].max(to[0]));
        let (y0, y1) = (from[1].min(to[1]), from[1].max(to[1]));
        if x1 - x0 < thickness || y1 - y0 < thickness {
            return Err(entry.wrong("is smaller than its walls are thick", "write (from 0 0) (to 6 5)"));
        }
        // The inner faces of the walls go through the corners.
        let out = thickness * 0.5;
        let sides = [
            ("west", [x0 - out, y0 - thickness], [x0 - out, y1 + thickness]),
            ("east", [x1 + out, y0 - thickness], [x1 + out, y1 + thickness]),
            ("south", [x0, y0 - out], [x1, y0 - out]),
            ("north", [x0, y1 + out], [x1, y1 + out]),
        ];
        for (side, from, to) in sides {
            self.fixtures.push(wall(format!("{name}-{side}-wall"), from, to, height, thickness));
        }
        Ok(())
    }

    fn add_wall(&mut self, entry: &Entry) -> Result<(), Mistake> {
        let end = |key: &str| {
            let given = entry.numbers(key, 2, 2)?;
            let given = given.ok_or_else(|| entry.missing(key, format!("write ({key} 0 0)")))?;
            Ok([given[0], given[1]])
        };
        let (from, to) = (end("from")?, end("to")?);
        let (height, thickness) =
            (entry.positive("height", Some(2.5))?, entry.positive("thickness", Some(0.1))?);
        let name = entry.name("name")?.unwrap_or_else(|| format!("wall-{}", self.fixtures.len() + 1));
        if libm::hypot(to[0] - from[0], to[1] - from[1]) < 1e-3 {
            return Err(entry.wrong("begins where it ends", "write (from 0 0) (to 2 0)"));
        }
        self.fixtures.push(wall(name, from, to, height, thickness));
        Ok(())
    }

    fn add_furniture(&mut self, entry: &Entry) -> Result<(), Mistake> {
        let name = entry.needed_name("name")?;
        self.is_new(entry, "fixture", &name, |scene| scene.fixtures.iter().any(|it| it.name == name))?;
        let at = entry.numbers("at", 2, 3)?;
        let at = at.ok_or_else(|| entry.missing("at", "write (at 1.5 2 0): x, y and the turn about Z"))?;
        let pose = upright(Vector3::new(at[0], at[1], 0.0), at.get(2).copied().unwrap_or(0.0));
        let owner = FixtureId(self.fixtures.len());
        self.fixtures.push(Fixture { name, pose, shapes: shapes(entry)? });
        for part in entry.entries("door")? {
            self.add_container(&part, owner, true)?;
        }
        for part in entry.entries("drawer")? {
            self.add_container(&part, owner, false)?;
        }
        for part in entry.entries("surface")? {
            let inside = match part.name("in")? {
                None => None,
                Some(name) => Some(self.container(&name).ok_or_else(|| {
                    let names = self.containers.iter().map(|it| it.name.as_str());
                    let help = nearest(&name, names).map_or("name a door of this furniture".into(), |it| {
                        format!("probably `{it}` is meant")
                    });
                    part.wrong(format!("is in `{name}`, and there is no such container"), help)
                })?),
            };
            self.add_surface(&part, owner, None, inside)?;
        }
        let (first, fixture) = (&self.fixtures[owner.0], owner);
        if first.shapes.is_empty() && !self.containers.iter().any(|it| it.owner == fixture) {
            return Err(entry.wrong("has no shape", "write (box (size 0.6 1.2 0.86) (at 0 0 0.43))"));
        }
        Ok(())
    }

    fn add_surface(
        &mut self,
        entry: &Entry,
        owner: FixtureId,
        moves_with: Option<ContainerId>,
        inside: Option<ContainerId>,
    ) -> Result<(), Mistake> {
        let name = entry.needed_name("name")?;
        self.is_new(entry, "surface", &name, |scene| scene.surface(&name).is_some())?;
        let size = entry.size("size", 2)?;
        let (pose, capacity) = (placed(entry)?, capacity(entry)?);
        self.surfaces.push(Surface {
            name,
            owner,
            moves_with,
            inside,
            pose,
            size: [size[0], size[1]],
            capacity,
        });
        entry.done()
    }

    fn add_container(&mut self, entry: &Entry, owner: FixtureId, turns: bool) -> Result<(), Mistake> {
        let name = entry.needed_name("name")?;
        self.is_new(entry, "container", &name, |scene| scene.container(&name).is_some())?;
        let direction = |key: &str, otherwise: Vector3<f64>| {
            let given = entry.vector(key)?.unwrap_or(otherwise);
            Unit::try_new(given, 1e-9).ok_or_else(|| {
                entry.wrong(format!("`{key}` has no direction"), format!("write ({key} 1 0 0)"))
            })
        };
        let joint = if turns {
            let at = entry.vector("hinge")?;
            let at = at.ok_or_else(|| entry.missing("hinge", "write (hinge x y z), a point of its axis"))?;
            Hinge::Turn { at, axis: direction("axis", Vector3::z())? }
        } else {
            Hinge::Slide { along: direction("slide", Vector3::x())? }
        };
        let open = entry.positive("open", Some(if turns { std::f64::consts::FRAC_PI_2 } else { 0.35 }))?;
        if turns && open > std::f64::consts::PI {
            return Err(
                entry.wrong("opens by more than half a turn", "angles are radians: write (open 1.57)")
            );
        }
        let mut shapes = shapes(entry)?;
        let handles = entry.entries("handle")?;
        let [bar] = handles.as_slice() else {
            let help = "write (handle (at 0.35 0 0.7) (size 0.02 0.02 0.2))";
            return Err(entry.wrong(format!("has {} handles and needs one", handles.len()), help));
        };
        let handle = handle(bar)?;
        shapes.push(handle.1);
        let id = ContainerId(self.containers.len());
        self.containers.push(Container { name, owner, joint, open, shapes, handle: handle.0 });
        for part in entry.entries("surface")? {
            // What stands on a drawer's floor moves with it, and is hidden while it is shut.
            self.add_surface(&part, owner, Some(id), Some(id))?;
        }
        entry.done()
    }

    // ------------------------------------------------------------------ objects

    fn add_object(&mut self, entry: &Entry) -> Result<(), Mistake> {
        let name = entry.needed_name("name")?;
        self.is_new(entry, "object", &name, |scene| scene.object(&name).is_some())?;
        let type_name = entry.needed_name("type")?;
        let kind = self.kind(&type_name).ok_or_else(|| {
            let help = match nearest(&type_name, self.kinds.iter().map(|it| it.name.as_str())) {
                Some(meant) => format!("probably `{meant}` is meant"),
                None => "an object-type comes before its objects".into(),
            };
            entry.wrong(format!("there is no object-type `{type_name}`"), help)
        })?;
        let on = match entry.name("on")? {
            None => None,
            Some(name) => Some(self.surface(&name).ok_or_else(|| {
                let help = match nearest(&name, self.surfaces.iter().map(|it| it.name.as_str())) {
                    Some(meant) => format!("probably `{meant}` is meant"),
                    None => "a surface comes before the objects on it".into(),
                };
                entry.wrong(format!("there is no surface `{name}`"), help)
            })?),
        };
        let height = self.kinds[kind.0].height_above_ground_m();
        let pose = match on {
            Some(_) => {
                let at = entry.numbers("at", 2, 3)?.unwrap_or_else(|| vec![0.0, 0.0]);
                upright(Vector3::new(at[0], at[1], height), at.get(2).copied().unwrap_or(0.0))
            }
            None => {
                let help = "write (on surface), or (at x y z)";
                let at = entry.numbers("at", 3, 4)?.ok_or_else(|| entry.wrong("is nowhere", help))?;
                upright(Vector3::new(at[0], at[1], at[2]), at.get(3).copied().unwrap_or(0.0))
            }
        };
        self.objects.push(Object { name, kind, on, pose });
        Ok(())
    }
}

fn wall(name: String, from: [f64; 2], to: [f64; 2], height: f64, thickness: f64) -> Fixture {
    let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
    let size = Vector3::new(libm::hypot(dx, dy), thickness, height);
    let at = Vector3::new((from[0] + to[0]) * 0.5, (from[1] + to[1]) * 0.5, 0.0);
    let pose = upright(at, libm::atan2(dy, dx));
    Fixture { name, pose, shapes: vec![boxed(size, Vector3::new(0.0, 0.0, height * 0.5), 0.0)] }
}

/// `at x y z [yaw]`.
fn placed(entry: &Entry) -> Result<Isometry3<f64>, Mistake> {
    let at = entry.numbers("at", 3, 4)?;
    let at = at.ok_or_else(|| entry.missing("at", "write (at 0 0 0.86): x, y, z of its middle"))?;
    Ok(upright(Vector3::new(at[0], at[1], at[2]), at.get(3).copied().unwrap_or(0.0)))
}

fn capacity(entry: &Entry) -> Result<Option<usize>, Mistake> {
    let Some(number) = entry.numbers("capacity", 1, 1)?.map(|it| it[0]) else { return Ok(None) };
    match number >= 1.0 && number.fract() == 0.0 {
        true => Ok(Some(number as usize)),
        false => Err(entry.wrong("`capacity` is no whole number from 1", "write (capacity 4)")),
    }
}

/// The boxes and cylinders of an entry.
fn shapes(entry: &Entry) -> Result<Vec<PosedShape>, Mistake> {
    let mut shapes = Vec::new();
    for part in entry.entries("box")? {
        let size = part.size("size", 3)?;
        let shape = Shape::Box { size: Vector3::new(size[0], size[1], size[2]) };
        shapes.push(PosedShape { pose: middle(&part)?, shape });
        part.done()?;
    }
    for part in entry.entries("cylinder")? {
        let shape = Shape::Cylinder {
            radius: part.positive("radius", None)?,
            length: part.positive("height", None)?,
        };
        shapes.push(PosedShape { pose: middle(&part)?, shape });
        part.done()?;
    }
    Ok(shapes)
}

fn middle(entry: &Entry) -> Result<Isometry3<f64>, Mistake> {
    let at = entry.numbers("at", 3, 4)?.unwrap_or_else(|| vec![0.0; 3]);
    Ok(upright(Vector3::new(at[0], at[1], at[2]), at.get(3).copied().unwrap_or(0.0)))
}

/// A bar, held from the front, the fingers across it.
fn handle(entry: &Entry) -> Result<(Handle, PosedShape), Mistake> {
    let pose = placed(entry)?;
    let edges = entry.size("size", 3)?;
    let size = Vector3::new(edges[0], edges[1], edges[2]);
    let approach = entry.vector("approach")?.unwrap_or(-Vector3::x());
    let bar = match size.imax() {
        0 => Vector3::x_axis(),
        1 => Vector3::y_axis(),
        _ => Vector3::z_axis(),
    };
    let fingers = bar.cross(&approach);
    let at = pose.translation.vector;
    let tool = tool(at, approach, fingers).ok_or_else(|| {
        entry.wrong("is held along its own bar", "write (approach -1 0 0): where the hand goes")
    })?;
    entry.done()?;
    let width_m = fingers.normalize().abs().dot(&size);
    Ok((Handle { tool, bar, width_m }, PosedShape { pose, shape: Shape::Box { size } }))
}

fn kind(entry: &Entry) -> Result<Kind, Mistake> {
    let name = entry.needed_name("name")?;
    let shapes = shapes(entry)?;
    let Some(first) = shapes.first() else {
        return Err(entry.wrong(
            "has no shape",
            "write (box (size 0.07 0.07 0.2)) or (cylinder (radius 0.04) (height 0.1))",
        ));
    };
    let (mut low, mut high) = first.bounds();
    for shape in &shapes[1..] {
        let bounds = shape.bounds();
        (low, high) = (low.inf(&bounds.0), high.sup(&bounds.1));
    }
    let mass_kg = entry.positive("mass", None)?;
    let friction = entry.positive("friction", Some(FRICTION))?;
    let carries = match entry.entries("carries")?.as_slice() {
        [] => None,
        [part] => {
            let size = part.size("size", 2)?;
            let at = part.vector("at")?.unwrap_or(Vector3::new(0.0, 0.0, high.z));
            let capacity = capacity(part)?.unwrap_or(usize::MAX);
            part.done()?;
            Some(Tray { at, size: [size[0], size[1]], capacity })
        }
        _ => return Err(entry.wrong("has `carries` twice", "leave one of them out")),
    };
    let mut grasps = Vec::new();
    for name in entry.names("grasps")? {
        let side = side(entry, &name)?;
        let (at, fingers) = (side.place(&low, &high), side.fingers(&(high - low)));
        let tool = tool(at, side.approach(), fingers)
            .ok_or_else(|| entry.wrong("has a grasp without direction", ""))?;
        let width_m = fingers.abs().dot(&(high - low));
        grasps.push(Grasp { side, hands: Hands::One(tool), width_m, pre_m: PRE_GRASP_M, lift_m: LIFT_M });
    }
    for part in entry.entries("grasp")? {
        let side = side(&part, &part.needed_name("side")?)?;
        let (tool, width_m) = hand(&part, side, &low, &high)?;
        grasps.push(with_offsets(&part, side, Hands::One(tool), width_m)?);
    }
    for part in entry.entries("two-hands")? {
        let side = side(&part, &part.needed_name("side")?)?;
        let (left, right) = (part.entries("left")?, part.entries("right")?);
        let ([left], [right]) = (left.as_slice(), right.as_slice()) else {
            return Err(part.wrong(
                "needs one `left` and one `right`",
                "write (left (at 0 0.15 0)) (right (at 0 -0.15 0))",
            ));
        };
        let (first, second) = (hand(left, side, &low, &high)?, hand(right, side, &low, &high)?);
        left.done()?;
        right.done()?;
        grasps.push(with_offsets(&part, side, Hands::Two(first.0, second.0), first.1.max(second.1))?);
    }
    Ok(Kind { name, shapes, low, high, mass_kg, friction, grasps, carries })
}

fn side(entry: &Entry, name: &str) -> Result<Side, Mistake> {
    Side::of(name).ok_or_else(|| {
        let names = Side::ALL.map(Side::name);
        entry.wrong(format!("`{name}` is no side"), format!("there are: {}", names.join(", ")))
    })
}

/// A tool's pose and the width between its fingers.
fn hand(
    entry: &Entry,
    side: Side,
    low: &Vector3<f64>,
    high: &Vector3<f64>,
) -> Result<(Isometry3<f64>, f64), Mistake> {
    let at = entry.vector("at")?.unwrap_or_else(|| side.place(low, high));
    let approach = entry.vector("approach")?.unwrap_or_else(|| side.approach());
    let fingers = entry.vector("fingers")?.unwrap_or_else(|| side.fingers(&(high - low)));
    let width_m = entry.positive("width", Some(fingers.normalize().abs().dot(&(high - low))))?;
    let tool = tool(at, approach, fingers).ok_or_else(|| {
        let help = "write (approach 0 0 -1) (fingers 1 0 0), two directions across each other";
        entry.wrong("`approach` and `fingers` are one direction", help)
    })?;
    Ok((tool, width_m))
}

fn with_offsets(entry: &Entry, side: Side, hands: Hands, width_m: f64) -> Result<Grasp, Mistake> {
    let pre_m = entry.positive("pre", Some(PRE_GRASP_M))?;
    let lift_m = entry.positive("lift", Some(LIFT_M))?;
    entry.done()?;
    Ok(Grasp { side, hands, width_m, pre_m, lift_m })
}
