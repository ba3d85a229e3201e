//! Robots from the language: a URDF text, and which of its names are which part.
//!
//! ```text
//! ((urdf "…") (drive omnidirectional) (torso torso_lift_joint)
//!  (head (pan head_pan_joint) (tilt head_tilt_joint) (camera camera_frame))
//!  (arm (name left) (base torso_link) (tool l_tool_frame) (park 1.7 -0.3 …)
//!       (gripper (joint l_finger_joint) (closed 0) (open 0.5) (width 0.09) (fingers l_palm l_finger …))))
//! ```
//! `(urdf pr2)` and `(urdf one-arm)` are the shipped files. Names that stand for text may be symbols or strings.

use vm::value::Value;

use crate::read::{Entry, Mistake};
use crate::robot::chain::{ArmNames, DriveKind, GripperNames, HeadNames};
use crate::robot::urdf::{ONE_ARM, PR2};
use crate::robot::{Chains, Robot};
use crate::setting::Machine;

/// The robot that a list describes.
///
/// # Errors
/// A mistake in the list, in the URDF text, or in the names of the parts.
pub fn machine(description: &Value) -> Result<Machine, Mistake> {
    let list = Value::cons(Value::symbol("robot"), description.clone());
    let entry = Entry::of(&list, "the description", 1)?;
    let path = "the robot";
    let (file, text) = match entry.get("urdf")? {
        Some([value]) => match (value.as_str(), value.as_symbol().as_ref().map(|it| it.as_str())) {
            (Some(text), _) => ("the URDF text".to_string(), text.to_string()),
            (_, Some("pr2")) => ("pr2.urdf".into(), PR2.into()),
            (_, Some("one-arm")) => ("one-arm.urdf".into(), ONE_ARM.into()),
            _ => {
                return Err(entry.wrong(
                    "`urdf` is neither a text nor a shipped robot",
                    "write (urdf pr2), (urdf one-arm) or (urdf ,(read-file \"robot.urdf\"))",
                ));
            }
        },
        _ => {
            return Err(entry.missing("urdf", "write (urdf pr2) or (urdf ,(read-file \"robot.urdf\"))"));
        }
    };
    let chains = chains(&entry)?;
    entry.done()?;
    let wrong = |why: crate::robot::RobotError| Mistake {
        entry: path.into(),
        problem: why.to_string(),
        help: Some(why.help()),
    };
    let robot = Robot::from_urdf(&file, &text).map_err(wrong)?;
    Machine::new(robot, &chains).map_err(wrong)
}

/// The parts that an entry names.
///
/// # Errors
/// A mistake in it.
pub fn chains(entry: &Entry) -> Result<Chains, Mistake> {
    let drive = match word(entry, "drive")?.as_deref() {
        None | Some("fixed") => DriveKind::Fixed,
        Some("differential") => DriveKind::Differential,
        Some("omnidirectional") => DriveKind::Omnidirectional,
        Some(other) => {
            let help = "there are: fixed, differential, omnidirectional";
            return Err(entry.wrong(format!("`{other}` is no way to drive"), help));
        }
    };
    let head = match entry.entries("head")?.as_slice() {
        [] => None,
        [head] => {
            let names = HeadNames {
                pan: needed(head, "pan")?,
                tilt: needed(head, "tilt")?,
                camera: needed(head, "camera")?,
            };
            head.done()?;
            Some(names)
        }
        _ => return Err(entry.wrong("has two heads", "leave one of them out")),
    };
    let arms = entry.entries("arm")?.iter().map(arm).collect::<Result<_, _>>()?;
    Ok(Chains { drive, torso: word(entry, "torso")?, head, arms })
}

fn arm(entry: &Entry) -> Result<ArmNames, Mistake> {
    let gripper = match entry.entries("gripper")?.as_slice() {
        [] => None,
        [it] => {
            let names = GripperNames {
                joint: needed(it, "joint")?,
                closed: it.number("closed", 0.0)?,
                open: it.positive("open", None)?,
                width_m: it.positive("width", None)?,
                fingers: it.names("fingers")?,
            };
            it.done()?;
            Some(names)
        }
        _ => return Err(entry.wrong("has two grippers", "leave one of them out")),
    };
    let names = ArmNames {
        name: needed(entry, "name")?,
        base: needed(entry, "base")?,
        tool: needed(entry, "tool")?,
        gripper,
        park: entry.numbers("park", 1, crate::robot::chain::MAX_JOINTS)?.unwrap_or_default(),
    };
    entry.done()?;
    Ok(names)
}

/// A symbol or a string.
fn word(entry: &Entry, key: &str) -> Result<Option<String>, Mistake> {
    match entry.get(key)? {
        Some([value]) if value.as_str().is_some() => Ok(value.as_str().map(String::from)),
        _ => entry.name(key),
    }
}

fn needed(entry: &Entry, key: &str) -> Result<String, Mistake> {
    word(entry, key)?.ok_or_else(|| entry.missing(key, format!("write ({key} a_name_of_the_file)")))
}
