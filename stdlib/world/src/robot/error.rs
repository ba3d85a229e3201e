//! What can be wrong with the file of a robot, or with the names of its parts.
//!
//! An error says where, what, and, in [`RobotError::help`], what to do next.

use std::path::PathBuf;

use thiserror::Error;

/// A robot that cannot be used, and why.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("{file}: {mistake}")]
pub struct RobotError {
    /// The file, or whatever the caller called the text.
    pub file: String,
    /// What is wrong.
    pub mistake: Mistake,
}

/// One mistake in a robot's file, or in the [`Chains`](super::Chains) that name its parts.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Mistake {
    /// The file cannot be read from the disk.
    #[error("cannot be read: {why}")]
    NotReadable {
        /// What the system says.
        why: String,
    },
    /// Larger than any robot.
    #[error("{bytes} bytes are more than the {limit} that a robot's file may have")]
    TooLarge {
        /// Length of the text.
        bytes: usize,
        /// What is allowed.
        limit: usize,
    },
    /// Elements nested too deeply, or never closed.
    #[error("elements are nested more than {limit} deep")]
    TooDeep {
        /// What is allowed.
        limit: usize,
    },
    /// Not XML, or not URDF.
    #[error("{}{why}", place(.line))]
    NotUrdf {
        /// The line of the link or joint in which the mistake is, if that is known.
        line: Option<usize>,
        /// What the reader says.
        why: String,
    },
    /// More links than any robot has.
    #[error("has {links} links, more than {limit}")]
    TooManyLinks {
        /// How many there are.
        links: usize,
        /// How many there may be.
        limit: usize,
    },
    /// No link at all.
    #[error("has no link")]
    NoLinks,
    /// A name that stands for two things.
    #[error("two {kind}s are called `{name}`")]
    Duplicate {
        /// "link" or "joint".
        kind: &'static str,
        /// The name.
        name: String,
    },
    /// A joint connects something that is not there.
    #[error("joint `{joint}` names the link `{link}`, which is not defined")]
    JointWithoutLink {
        /// The joint.
        joint: String,
        /// What it names.
        link: String,
        /// A link with nearly this name.
        did_you_mean: Option<String>,
    },
    /// A link moved by two joints.
    #[error("link `{link}` is the child of two joints, `{first}` and `{second}`")]
    TwoParents {
        /// The link.
        link: String,
        /// A joint.
        first: String,
        /// Another.
        second: String,
    },
    /// Links that hang on one another in a ring.
    #[error("the links {} hang on one another in a ring", list(.links))]
    Cycle {
        /// Links of the ring, in the order of the file.
        links: Vec<String>,
    },
    /// Links that hang on nothing, more than one.
    #[error("the links {} all hang on nothing, but a robot has one root", list(.links))]
    SeveralRoots {
        /// The roots.
        links: Vec<String>,
    },
    /// NaN or infinity.
    #[error("{place}: {what} is not a finite number")]
    NotFinite {
        /// "joint `x`" or "link `x`".
        place: String,
        /// Which number.
        what: &'static str,
    },
    /// Numbers that only make sense in another unit.
    #[error("{place}: {what} of {value} {unit}")]
    WrongUnit {
        /// "joint `x`" or "link `x`".
        place: String,
        /// Which number.
        what: &'static str,
        /// Its value.
        value: f64,
        /// "m" or "rad".
        unit: &'static str,
    },
    /// A joint that must have limits.
    #[error("joint `{joint}` has no limits")]
    LimitsMissing {
        /// The joint.
        joint: String,
    },
    /// Lower is above upper.
    #[error("joint `{joint}` has the lower limit {lower} above the upper limit {upper}")]
    LimitsReversed {
        /// The joint.
        joint: String,
        /// As written.
        lower: f64,
        /// As written.
        upper: f64,
    },
    /// An axis of length 0.
    #[error("joint `{joint}` moves along an axis of length 0")]
    NoAxis {
        /// The joint.
        joint: String,
    },
    /// A kind of joint that is not supported where it stands.
    #[error("joint `{joint}` is {kind}, which {why}")]
    Unsupported {
        /// The joint.
        joint: String,
        /// Its kind.
        kind: &'static str,
        /// Why not.
        why: &'static str,
    },
    /// A shape with a length below 0, or one that is no number.
    #[error("link `{link}` has a {shape} of negative or endless size")]
    BadShape {
        /// The link.
        link: String,
        /// "box", "cylinder" …
        shape: &'static str,
    },
    /// A speed below 0.
    #[error("joint `{joint}` has the greatest velocity {velocity}")]
    NegativeVelocity {
        /// The joint.
        joint: String,
        /// As written.
        velocity: f64,
    },
    /// A mass below 0.
    #[error("link `{link}` has the mass {mass} kg")]
    NegativeMass {
        /// The link.
        link: String,
        /// As written.
        mass: f64,
    },
    /// A mimic joint that follows nothing that moves.
    #[error("joint `{joint}` mimics `{source_joint}`, {why}")]
    BadMimic {
        /// The joint.
        joint: String,
        /// What it names.
        source_joint: String,
        /// Why that does not work.
        why: &'static str,
    },
    /// A name of a part that the robot does not have.
    #[error("{part} names the {kind} `{name}`, which the robot does not have")]
    UnknownName {
        /// Which part: "the arm `left`".
        part: String,
        /// "link" or "joint".
        kind: &'static str,
        /// The name.
        name: String,
        /// One that the robot has.
        did_you_mean: Option<String>,
    },
    /// Two ends of a chain with no way from one to the other.
    #[error("{part}: the link `{tip}` does not hang on the link `{base}`")]
    NotConnected {
        /// Which part.
        part: String,
        /// First link.
        base: String,
        /// Last link.
        tip: String,
    },
    /// A chain in which nothing moves.
    #[error("{part}: nothing moves between the links `{base}` and `{tip}`")]
    NothingMoves {
        /// Which part.
        part: String,
        /// First link.
        base: String,
        /// Last link.
        tip: String,
    },
    /// More joints than the solvers take.
    #[error("{part} has {joints} moving joints, more than {limit}")]
    ChainTooLong {
        /// Which part.
        part: String,
        /// How many there are.
        joints: usize,
        /// How many there may be.
        limit: usize,
    },
    /// A joint of the wrong kind for its part.
    #[error("{part}: joint `{joint}` {why}")]
    WrongJoint {
        /// Which part.
        part: String,
        /// The joint.
        joint: String,
        /// What is expected of it.
        why: &'static str,
    },
    /// A value that its joint cannot take.
    #[error("{part}: {what} of joint `{joint}` {why}")]
    BadValue {
        /// Which part.
        part: String,
        /// The joint.
        joint: String,
        /// Which value.
        what: &'static str,
        /// What is wrong with it.
        why: &'static str,
    },
    /// A number of values that does not fit.
    #[error("{part}: {given} values are given for {needed} moving joints")]
    WrongCount {
        /// Which part.
        part: String,
        /// How many are given.
        given: usize,
        /// How many are needed.
        needed: usize,
    },
}

/// Something odd in a robot's file that it can be used in spite of.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Warning {
    /// A mesh is no shape here.
    #[error("link `{link}`: the mesh `{mesh}` is left out, so collisions with this part are not seen")]
    MeshLeftOut {
        /// The link.
        link: String,
        /// As written in the file.
        mesh: String,
    },
    /// A shape that nothing can touch.
    #[error("link `{link}`: a {shape} without volume is left out")]
    FlatShape {
        /// The link.
        link: String,
        /// "box", "cylinder" …
        shape: &'static str,
    },
    /// Nothing to collide with, so what is seen is taken.
    #[error("no link has a collision shape; the visual shapes are taken instead")]
    VisualShapesTaken,
    /// Shapes, but no mass.
    #[error("link `{link}` has shapes, but no mass; a body of it will be as heavy as water")]
    NoMass {
        /// The link.
        link: String,
    },
    /// Links above the joint that moves the whole robot.
    #[error("joint `{joint}` moves the whole robot; the links above it are left out")]
    LinksAboveBase {
        /// The planar or floating joint.
        joint: String,
    },
}

impl RobotError {
    /// What to do next.
    #[must_use]
    pub fn help(&self) -> String {
        self.mistake.help()
    }
}

impl Warning {
    /// What to do next.
    #[must_use]
    pub fn help(&self) -> &'static str {
        match self {
            Warning::MeshLeftOut { .. } => {
                "add a `<collision>` of boxes, cylinders, spheres or capsules around it to the link"
            }
            Warning::FlatShape { .. } => "delete it, or give it lengths above 0",
            Warning::VisualShapesTaken => "copy shapes that matter into `<collision>` elements",
            Warning::NoMass { .. } => "add `<inertial>` with a mass above 0 to the link",
            Warning::LinksAboveBase { .. } => "put what does not move with the robot into the scene",
        }
    }
}

impl Mistake {
    fn help(&self) -> String {
        let fixed = match self {
            Mistake::NotReadable { .. } => "check the path and the rights of the file",
            Mistake::TooManyLinks { .. } | Mistake::TooLarge { .. } => {
                "leave out what is no link or joint; meshes belong into files of their own"
            }
            Mistake::TooDeep { .. } => "look for an element that is not closed",
            Mistake::NotUrdf { line: Some(_), .. } => {
                "what each element must have is listed at http://wiki.ros.org/urdf/XML"
            }
            Mistake::NotUrdf { .. } => {
                "a file that `check_urdf` accepts is read; xacro files are expanded first: `xacro robot.xacro > robot.urdf`"
            }
            Mistake::NoLinks => "the file of a robot has `<link name=\"…\">` elements inside of `<robot>`",
            Mistake::Duplicate { .. } => "rename one of the two",
            Mistake::JointWithoutLink { did_you_mean, .. } | Mistake::UnknownName { did_you_mean, .. } => {
                return match did_you_mean {
                    Some(name) => format!("did you mean `{name}`?"),
                    None => "check the name against those in the file; capital letters matter".into(),
                };
            }
            Mistake::TwoParents { .. } => {
                "a robot is a tree: remove one joint, or model the closed chain by a mimic joint"
            }
            Mistake::Cycle { .. } => "a robot is a tree: remove one joint of the ring",
            Mistake::SeveralRoots { .. } => {
                "connect them by joints, if need be fixed ones, or delete what is left over"
            }
            Mistake::NotFinite { .. } => "write a number such as `0.1` or `-2e-3`",
            Mistake::WrongUnit { unit: "m", .. } => "lengths are in metres; is this in millimetres?",
            Mistake::WrongUnit { .. } => {
                "angles are in radians; is this in degrees? A joint without end is `continuous`"
            }
            Mistake::LimitsMissing { .. } => {
                "add `<limit lower=\"…\" upper=\"…\" velocity=\"…\" effort=\"…\"/>`, or make a joint that turns without end `continuous`"
            }
            Mistake::LimitsReversed { .. } => "swap the two",
            Mistake::NoAxis { .. } => "write the direction, for example `<axis xyz=\"0 0 1\"/>`",
            Mistake::Unsupported { .. } => {
                "use revolute, continuous, prismatic and fixed joints; several at one place make a joint of more directions"
            }
            Mistake::BadShape { .. } => "all lengths must be above 0",
            Mistake::NegativeVelocity { .. } => "write a speed above 0, in rad/s or m/s",
            Mistake::NegativeMass { .. } => "a mass is above 0, or left out for a link that is only a frame",
            Mistake::BadMimic { .. } => "let it mimic a revolute, continuous or prismatic joint",
            Mistake::NotConnected { .. } => {
                "the first link of a chain is above the last one; are the two exchanged?"
            }
            Mistake::NothingMoves { .. } => "choose a first link further up, or a last link further down",
            Mistake::ChainTooLong { .. } => "choose a first link further down",
            Mistake::WrongJoint { .. } => "name another joint, or change its type in the file",
            Mistake::BadValue { .. } => "limits are those of the robot's file; radians and metres",
            Mistake::WrongCount { .. } => {
                "give one value for each moving joint between base and tip, in this order"
            }
        };
        fixed.into()
    }

    pub(crate) fn of(self, file: &str) -> RobotError {
        RobotError { file: file.into(), mistake: self }
    }
}

pub(crate) fn not_readable(path: &std::path::Path, why: &std::io::Error) -> RobotError {
    let file: PathBuf = path.into();
    Mistake::NotReadable { why: why.to_string() }.of(&file.display().to_string())
}

fn place(line: &Option<usize>) -> String {
    line.map_or_else(|| "is no URDF: ".into(), |line| format!("line {line}: "))
}

fn list(names: &[String]) -> String {
    const SHOWN: usize = 5;
    let mut shown: Vec<String> = names.iter().take(SHOWN).map(|name| format!("`{name}`")).collect();
    if names.len() > SHOWN {
        shown.push(format!("{} more", names.len() - SHOWN));
    }
    shown.join(", ")
}

/// The name that was probably meant: one that is alike, or that contains what was written.
pub(crate) fn nearest<'a>(wanted: &str, names: impl Iterator<Item = &'a str> + Clone) -> Option<String> {
    const ALIKE: f64 = 0.8;
    let mut best = (ALIKE, None);
    for name in names.clone() {
        let alike = strsim::jaro_winkler(wanted, name);
        if alike > best.0 {
            best = (alike, Some(name));
        }
    }
    let containing = || names.filter(|_| wanted.len() > 2).find(|name| name.contains(wanted));
    best.1.or_else(containing).map(String::from)
}
