//! Robots from URDF files.
//!
//! `urdf-rs` turns XML into data; what is done here is to look whether that data is a robot: one
//! tree, finite numbers, limits, shapes with a volume, plausible units. Format:
//! <http://wiki.ros.org/urdf/XML>; angles roll, pitch, yaw turn about the fixed axes X, Y, Z.
//!
//! A planar or floating joint may stand above everything else: it is the way the whole robot moves,
//! and its child becomes the root. Meshes are left out with a warning; a link needs primitive
//! shapes to collide. Elements that are not about links and joints (transmissions, simulators) are
//! passed over.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};

use crate::shape::{PosedShape, Shape};

use super::error::{Mistake, RobotError, Warning, nearest, not_readable};
use super::model::{BaseJoint, Drive, Joint, JointId, JointKind, Link, LinkId, Robot, Variable, VariableId};

/// The file of the PR2-like robot.
pub const PR2: &str = include_str!("../../robots/pr2.urdf");
/// The file of the robot with one arm.
pub const ONE_ARM: &str = include_str!("../../robots/one-arm.urdf");

/// Bytes of a file; the PR2's own has 200,000.
const MAX_BYTES: usize = 16 << 20;
/// Elements in one another; URDF needs six. The reader recurses, so this protects its stack.
const MAX_DEPTH: usize = 64;
/// Links of a file; the PR2's own has 90.
const MAX_LINKS: usize = 4096;
/// Mimics of mimics of mimics.
const MAX_MIMICS: usize = 16;
/// No part of a robot is so long.
const MAX_LENGTH_M: f64 = 100.0;
/// Four turns: more is a winch, or degrees.
const MAX_ANGLE_RAD: f64 = 8.0 * std::f64::consts::PI;

impl Robot {
    /// Reads a robot from a file.
    ///
    /// # Errors
    /// What the file lacks, see [`Mistake`].
    pub fn from_file(path: &Path) -> Result<Robot, RobotError> {
        let bytes = std::fs::metadata(path).map_err(|why| not_readable(path, &why))?.len();
        let bytes = usize::try_from(bytes).unwrap_or(usize::MAX);
        let name = path.display().to_string();
        if bytes > MAX_BYTES {
            return Err(Mistake::TooLarge { bytes, limit: MAX_BYTES }.of(&name));
        }
        let text = std::fs::read_to_string(path).map_err(|why| not_readable(path, &why))?;
        Robot::from_urdf(&name, &text)
    }

    /// Reads a robot from a text; `file` is what messages call it.
    ///
    /// # Errors
    /// What the text lacks, see [`Mistake`].
    pub fn from_urdf(file: &str, text: &str) -> Result<Robot, RobotError> {
        read(file, text).map_err(|mistake| mistake.of(file))
    }
}

fn read(file: &str, text: &str) -> Result<Robot, Mistake> {
    if text.len() > MAX_BYTES {
        return Err(Mistake::TooLarge { bytes: text.len(), limit: MAX_BYTES });
    }
    if depth(text) > MAX_DEPTH {
        return Err(Mistake::TooDeep { limit: MAX_DEPTH });
    }
    let file_data = urdf_rs::read_from_string(text).map_err(|why| not_urdf(text, &why))?;
    let tree = Tree::of(&file_data)?;
    Builder::new(file, &file_data, tree).build()
}

/// An upper bound of how deeply elements are nested. It need not understand comments: a file that
/// has dozens of unclosed elements in them is refused as well.
fn depth(text: &str) -> usize {
    let (mut open, mut deepest) = (0_usize, 0_usize);
    for element in text.split('<').skip(1) {
        match element.as_bytes().first() {
            Some(b'/') => open = open.saturating_sub(1),
            Some(b'!' | b'?') => {}
            _ => {
                deepest = deepest.max(open + 1);
                let closes_itself = element.find('>').is_some_and(|end| element[..end].ends_with('/'));
                open += usize::from(!closes_itself);
            }
        }
    }
    deepest
}

/// The reader does not say where it met a mistake, so links and joints are read one by one until it
/// meets one again.
fn not_urdf(text: &str, why: &urdf_rs::UrdfError) -> Mistake {
    let mut at = 0;
    while let Some(start) = text[at..].find('<').map(|offset| at + offset) {
        let rest = &text[start..];
        let name: String = rest[1..].chars().take_while(|letter| letter.is_ascii_alphanumeric()).collect();
        let end = match name.as_str() {
            _ if rest.starts_with("<!--") => rest.find("-->"),
            // Simulators and motors have elements that are called joints, too.
            "link" | "joint" | "transmission" | "gazebo" => element_end(rest, &name),
            _ => Some(1),
        };
        let line = || Some(text[..start].matches('\n').count() + 1);
        let Some(end) = end else {
            return Mistake::NotUrdf { line: line(), why: format!("`<{name}>` is not closed") };
        };
        if matches!(name.as_str(), "link" | "joint") {
            let alone = format!("<robot name=\"\">{}</robot>", &rest[..end]);
            if let Err(why) = urdf_rs::read_from_string(&alone) {
                return Mistake::NotUrdf { line: line(), why: one_line(&why) };
            }
        }
        at = start + end;
    }
    Mistake::NotUrdf { line: None, why: one_line(why) }
}

/// Length of the element that the text begins with.
fn element_end(text: &str, name: &str) -> Option<usize> {
    let opened = text.find('>')? + 1;
    if text[..opened].ends_with("/>") {
        return Some(opened);
    }
    let close = format!("</{name}>");
    text.find(&close).map(|at| at + close.len())
}

/// What the reader says, on one line and not longer than a screen's.
fn one_line(why: &urdf_rs::UrdfError) -> String {
    let text = why.to_string();
    let words: Vec<&str> = text.trim_start_matches("custom: ").split_whitespace().collect();
    words.join(" ").chars().take(200).collect()
}

// ---------------------------------------------------------------------------------------------
// The tree

/// Which joint moves which link, in an order in which parents come first.
struct Tree {
    /// Numbers of links in the file, the root first.
    order: Vec<usize>,
    /// For each of `order` but the first: its joint in the file.
    joints: Vec<usize>,
    base_joint: BaseJoint,
    warnings: Vec<Warning>,
}

impl Tree {
    fn of(data: &urdf_rs::Robot) -> Result<Tree, Mistake> {
        if data.links.is_empty() {
            return Err(Mistake::NoLinks);
        }
        if data.links.len() > MAX_LINKS {
            return Err(Mistake::TooManyLinks { links: data.links.len(), limit: MAX_LINKS });
        }
        let links = unique("link", data.links.iter().map(|link| link.name.as_str()))?;
        unique("joint", data.joints.iter().map(|joint| joint.name.as_str()))?;
        let find = |joint: &urdf_rs::Joint, link: &str| {
            links.get(link).copied().ok_or_else(|| Mistake::JointWithoutLink {
                joint: joint.name.clone(),
                link: link.into(),
                did_you_mean: nearest(link, links.keys().copied()),
            })
        };
        let mut above: Vec<Option<usize>> = vec![None; data.links.len()];
        let mut below: Vec<Vec<usize>> = vec![Vec::new(); data.links.len()];
        for (number, joint) in data.joints.iter().enumerate() {
            let (parent, child) = (find(joint, &joint.parent.link)?, find(joint, &joint.child.link)?);
            if let Some(first) = above[child].replace(number) {
                return Err(Mistake::TwoParents {
                    link: data.links[child].name.clone(),
                    first: data.joints[first].name.clone(),
                    second: joint.name.clone(),
                });
            }
            below[parent].push(number);
        }
        let names = |chosen: &mut dyn Iterator<Item = usize>| {
            chosen.map(|link| data.links[link].name.clone()).collect()
        };
        let roots: Vec<usize> = (0..data.links.len()).filter(|link| above[*link].is_none()).collect();
        let [mut root] = roots[..] else {
            return Err(match roots.is_empty() {
                true => Mistake::Cycle { links: names(&mut (0..data.links.len())) },
                false => Mistake::SeveralRoots { links: names(&mut roots.into_iter()) },
            });
        };
        let child = |joint: usize| links.get(data.joints[joint].child.link.as_str()).copied().unwrap_or(0);
        let (mut order, mut joints) = walk(root, &below, child);
        if order.len() < data.links.len() {
            // All links have a parent, but some are not below the root.
            let mut lost = (0..data.links.len()).filter(|link| !order.contains(link));
            return Err(Mistake::Cycle { links: names(&mut lost) });
        }
        let mut tree =
            Tree { order: Vec::new(), joints: Vec::new(), base_joint: BaseJoint::None, warnings: Vec::new() };
        while let [joint] = below[root][..] {
            tree.base_joint = match data.joints[joint].joint_type {
                urdf_rs::JointType::Planar => BaseJoint::Planar,
                urdf_rs::JointType::Floating => BaseJoint::Floating,
                _ => break,
            };
            tree.warnings.push(Warning::LinksAboveBase { joint: data.joints[joint].name.clone() });
            root = child(joint);
            (order, joints) = walk(root, &below, child);
        }
        Ok(Tree { order, joints, ..tree })
    }
}

/// Links below `root`, depth first in the order of the file, and the joints that lead to them.
fn walk(root: usize, below: &[Vec<usize>], child: impl Fn(usize) -> usize) -> (Vec<usize>, Vec<usize>) {
    let (mut order, mut joints) = (vec![root], Vec::new());
    let mut pending: Vec<usize> = below[root].iter().rev().copied().collect();
    while let Some(joint) = pending.pop() {
        let link = child(joint);
        order.push(link);
        joints.push(joint);
        pending.extend(below[link].iter().rev());
    }
    (order, joints)
}

/// The numbers of things with names, each once.
fn unique<'a>(
    kind: &'static str,
    names: impl Iterator<Item = &'a str>,
) -> Result<BTreeMap<&'a str, usize>, Mistake> {
    let mut numbers = BTreeMap::new();
    for (number, name) in names.enumerate() {
        if numbers.insert(name, number).is_some() {
            return Err(Mistake::Duplicate { kind, name: name.into() });
        }
    }
    Ok(numbers)
}

// ---------------------------------------------------------------------------------------------
// Links and joints

struct Builder<'a> {
    data: &'a urdf_rs::Robot,
    tree: Tree,
    robot: Robot,
}

impl<'a> Builder<'a> {
    fn new(file: &str, data: &'a urdf_rs::Robot, mut tree: Tree) -> Builder<'a> {
        let robot = Robot {
            name: data.name.clone(),
            file: file.into(),
            base_joint: tree.base_joint,
            warnings: std::mem::take(&mut tree.warnings),
            links: Vec::new(),
            joints: Vec::new(),
            variables: Vec::new(),
        };
        Builder { data, tree, robot }
    }

    fn build(mut self) -> Result<Robot, Mistake> {
        self.links()?;
        self.joints()?;
        Ok(self.robot)
    }

    fn links(&mut self) -> Result<(), Mistake> {
        let data = self.data;
        let place_of: BTreeMap<&str, usize> = self
            .tree
            .order
            .iter()
            .enumerate()
            .map(|(place, link)| (data.links[*link].name.as_str(), place))
            .collect();
        let collides = data.links.iter().any(|link| !link.collision.is_empty());
        let seen = data.links.iter().any(|link| !link.visual.is_empty());
        if !collides && seen {
            self.robot.warnings.push(Warning::VisualShapesTaken);
        }
        for (place, number) in self.tree.order.iter().enumerate() {
            let link = &data.links[*number];
            let parent = place.checked_sub(1).map(|joint| &data.joints[self.tree.joints[joint]].parent.link);
            let parent = parent.and_then(|name| place_of.get(name.as_str()).copied()).map(LinkId);
            let shapes = match collides {
                true => shapes(
                    link,
                    link.collision.iter().map(|part| (&part.origin, &part.geometry)),
                    &mut self.robot.warnings,
                )?,
                false => shapes(
                    link,
                    link.visual.iter().map(|part| (&part.origin, &part.geometry)),
                    &mut self.robot.warnings,
                )?,
            };
            let built = body(link, parent, shapes)?;
            if built.mass == 0.0 && !built.shapes.is_empty() {
                self.robot.warnings.push(Warning::NoMass { link: link.name.clone() });
            }
            self.robot.links.push(built);
        }
        Ok(())
    }

    fn joints(&mut self) -> Result<(), Mistake> {
        let data = self.data;
        for number in &self.tree.joints {
            let joint = &data.joints[*number];
            let kind = kind(joint)?;
            let origin = pose(&joint.origin, || format!("joint `{}`", joint.name))?;
            let axis = match kind {
                JointKind::Fixed => Vector3::z_axis(),
                _ => axis(joint)?,
            };
            let mut drive = None;
            if kind != JointKind::Fixed && joint.mimic.is_none() {
                let variable = variable(joint, kind, JointId(self.robot.joints.len()))?;
                drive = Some(Drive {
                    variable: VariableId(self.robot.variables.len()),
                    multiplier: 1.0,
                    offset: 0.0,
                });
                self.robot.variables.push(variable);
            }
            self.robot.joints.push(Joint { name: joint.name.clone(), kind, origin, axis, drive });
        }
        for place in 0..self.robot.joints.len() {
            self.robot.joints[place].drive = self.drive(place)?;
        }
        Ok(())
    }

    /// What moves the joint at this place: follows mimics until a joint that moves by itself.
    fn drive(&self, place: usize) -> Result<Option<Drive>, Mistake> {
        let joint = &self.robot.joints[place];
        let written = |place: usize| {
            self.tree.joints.get(place).and_then(|joint| self.data.joints[*joint].mimic.as_ref())
        };
        if joint.kind == JointKind::Fixed || joint.drive.is_some() {
            return Ok(joint.drive);
        }
        let (mut multiplier, mut offset, mut at) = (1.0, 0.0, place);
        for _ in 0..MAX_MIMICS {
            let Some(mimic) = written(at) else { break };
            let bad =
                |why| Mistake::BadMimic { joint: joint.name.clone(), source_joint: mimic.joint.clone(), why };
            offset += multiplier * mimic.offset.unwrap_or(0.0);
            multiplier *= mimic.multiplier.unwrap_or(1.0);
            if !(f64::is_finite(offset) && f64::is_finite(multiplier)) {
                return Err(Mistake::NotFinite {
                    place: format!("joint `{}`", joint.name),
                    what: "its mimic",
                });
            }
            let JointId(source) =
                self.robot.joint(&mimic.joint).ok_or_else(|| bad("which is not defined"))?;
            match (&self.robot.joints[source], written(source)) {
                (Joint { kind: JointKind::Fixed, .. }, _) => return Err(bad("which is fixed")),
                (_, Some(_)) => at = source,
                (Joint { drive, .. }, None) => {
                    return Ok(drive.map(|drive| Drive { variable: drive.variable, multiplier, offset }));
                }
            }
        }
        let source_joint = written(place).map_or_else(String::new, |mimic| mimic.joint.clone());
        Err(Mistake::BadMimic {
            joint: joint.name.clone(),
            source_joint,
            why: "and at last itself, or a long way round",
        })
    }
}

fn kind(joint: &urdf_rs::Joint) -> Result<JointKind, Mistake> {
    use urdf_rs::JointType;
    let unsupported = |kind, why| Err(Mistake::Unsupported { joint: joint.name.clone(), kind, why });
    const ONLY_ABOVE: &str = "is understood only above all other joints";
    match joint.joint_type {
        JointType::Fixed => Ok(JointKind::Fixed),
        JointType::Revolute => Ok(JointKind::Revolute),
        JointType::Continuous => Ok(JointKind::Continuous),
        JointType::Prismatic => Ok(JointKind::Prismatic),
        JointType::Planar => unsupported("planar", ONLY_ABOVE),
        JointType::Floating => unsupported("floating", ONLY_ABOVE),
        JointType::Spherical => unsupported("spherical", "is not understood"),
    }
}

fn axis(joint: &urdf_rs::Joint) -> Result<Unit<Vector3<f64>>, Mistake> {
    let place = || format!("joint `{}`", joint.name);
    let axis = vector(&joint.axis.xyz, "the axis", place)?;
    Unit::try_new(axis, 1e-9).ok_or_else(|| Mistake::NoAxis { joint: joint.name.clone() })
}

fn variable(joint: &urdf_rs::Joint, kind: JointKind, id: JointId) -> Result<Variable, Mistake> {
    let place = || format!("joint `{}`", joint.name);
    let limit = &joint.limit;
    if limit.velocity.is_nan() {
        return Err(Mistake::NotFinite { place: place(), what: "the greatest velocity" });
    }
    if limit.velocity < 0.0 {
        return Err(Mistake::NegativeVelocity { joint: joint.name.clone(), velocity: limit.velocity });
    }
    // The reader gives 0 for what is not written.
    let velocity = if limit.velocity == 0.0 { f64::INFINITY } else { limit.velocity };
    if kind == JointKind::Continuous {
        return Ok(Variable { joint: id, limits: None, velocity });
    }
    let (lower, upper) = (limit.lower, limit.upper);
    if lower.is_nan() || upper.is_nan() {
        return Err(Mistake::NotFinite { place: place(), what: "a limit" });
    }
    if (lower == 0.0 && upper == 0.0) || lower.is_infinite() || upper.is_infinite() {
        return Err(Mistake::LimitsMissing { joint: joint.name.clone() });
    }
    if lower > upper {
        return Err(Mistake::LimitsReversed { joint: joint.name.clone(), lower, upper });
    }
    let (most, unit) = if kind.turns() { (MAX_ANGLE_RAD, "rad") } else { (MAX_LENGTH_M, "m") };
    for value in [lower, upper] {
        if value.abs() > most {
            return Err(Mistake::WrongUnit { place: place(), what: "a limit", value, unit });
        }
    }
    Ok(Variable { joint: id, limits: Some((lower, upper)), velocity })
}

fn body(link: &urdf_rs::Link, parent: Option<LinkId>, shapes: Vec<PosedShape>) -> Result<Link, Mistake> {
    let place = || format!("link `{}`", link.name);
    let inertial = &link.inertial;
    let mass = inertial.mass.value;
    if !mass.is_finite() {
        return Err(Mistake::NotFinite { place: place(), what: "the mass" });
    }
    if mass < 0.0 {
        return Err(Mistake::NegativeMass { link: link.name.clone(), mass });
    }
    let i = &inertial.inertia;
    let inertia = [i.ixx, i.ixy, i.ixz, i.iyy, i.iyz, i.izz];
    if !inertia.iter().all(|moment| moment.is_finite()) {
        return Err(Mistake::NotFinite { place: place(), what: "a moment of inertia" });
    }
    let centre_of_mass = pose(&inertial.origin, place)?;
    Ok(Link { name: link.name.clone(), parent, shapes, mass, centre_of_mass, inertia })
}

fn shapes<'a>(
    link: &urdf_rs::Link,
    parts: impl Iterator<Item = (&'a urdf_rs::Pose, &'a urdf_rs::Geometry)>,
    warnings: &mut Vec<Warning>,
) -> Result<Vec<PosedShape>, Mistake> {
    use urdf_rs::Geometry;
    let place = || format!("link `{}`", link.name);
    let mut built = Vec::new();
    for (origin, geometry) in parts {
        let (name, shape) = match geometry {
            Geometry::Box { size } => ("box", Shape::Box { size: vector(size, "the size of a box", place)? }),
            Geometry::Cylinder { radius, length } => {
                ("cylinder", Shape::Cylinder { radius: *radius, length: *length })
            }
            Geometry::Capsule { radius, length } => {
                ("capsule", Shape::Capsule { radius: *radius, length: *length })
            }
            Geometry::Sphere { radius } => ("sphere", Shape::Sphere { radius: *radius }),
            Geometry::Mesh { filename, .. } => {
                warnings.push(Warning::MeshLeftOut { link: link.name.clone(), mesh: filename.clone() });
                continue;
            }
        };
        if !shape.is_solid() {
            let lengths = shape.half_extents();
            if lengths.iter().all(|length| length.is_finite() && *length >= 0.0) {
                warnings.push(Warning::FlatShape { link: link.name.clone(), shape: name });
                continue;
            }
            return Err(Mistake::BadShape { link: link.name.clone(), shape: name });
        }
        let value = shape.half_extents().max() * 2.0;
        if value > MAX_LENGTH_M {
            return Err(Mistake::WrongUnit { place: place(), what: "a shape", value, unit: "m" });
        }
        built.push(PosedShape { pose: pose(origin, place)?, shape });
    }
    Ok(built)
}

fn vector(
    numbers: &[f64; 3],
    what: &'static str,
    place: impl Fn() -> String,
) -> Result<Vector3<f64>, Mistake> {
    let vector = Vector3::from(*numbers);
    match vector.iter().all(|number| number.is_finite()) {
        true => Ok(vector),
        false => Err(Mistake::NotFinite { place: place(), what }),
    }
}

fn pose(origin: &urdf_rs::Pose, place: impl Fn() -> String) -> Result<Isometry3<f64>, Mistake> {
    let translation = vector(&origin.xyz, "the position of an origin", &place)?;
    let angles = vector(&origin.rpy, "the rotation of an origin", &place)?;
    let value = translation.amax();
    if value > MAX_LENGTH_M {
        return Err(Mistake::WrongUnit { place: place(), what: "an offset", value, unit: "m" });
    }
    let value = angles.amax();
    if value > MAX_ANGLE_RAD {
        return Err(Mistake::WrongUnit { place: place(), what: "a rotation", value, unit: "rad" });
    }
    let rotation = UnitQuaternion::from_euler_angles(angles.x, angles.y, angles.z);
    Ok(Isometry3::from_parts(Translation3::from(translation), rotation))
}
