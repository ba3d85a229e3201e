//! Robots from files: the shipped ones, mistakes and what is said about them, damaged files.

use expect_test::{Expect, expect};

use super::{Dice, assert_same_pose, bare_arm, one_arm, pr2};
use crate::robot::Robot;
use crate::robot::chain::{Chains, HeadNames};
use crate::robot::collision::{CollisionModel, Scratch};
use crate::robot::model::BaseJoint;
use crate::robot::urdf::{ONE_ARM, PR2};

use nalgebra::Isometry3;

/// A robot around some elements.
fn robot(elements: &str) -> String {
    format!("<robot name=\"test\">{elements}</robot>")
}

#[track_caller]
fn check_error(text: &str, expected: Expect) {
    let error = Robot::from_urdf("test.urdf", text).expect_err("the file has a mistake");
    expected.assert_eq(&format!("{error}\nhelp: {}", error.help()));
}

#[track_caller]
fn check_warnings(text: &str, expected: Expect) {
    let robot = Robot::from_urdf("test.urdf", text).expect("the file is read");
    let lines: Vec<String> =
        robot.warnings.iter().map(|warning| format!("{warning}\nhelp: {}", warning.help())).collect();
    expected.assert_eq(&lines.join("\n"));
}

#[track_caller]
fn check_chains(change: impl FnOnce(&mut Chains), expected: Expect) {
    let mut chains = Chains::pr2();
    change(&mut chains);
    let error = pr2().0.limbs(&chains).expect_err("the names have a mistake");
    expected.assert_eq(&format!("{error}\nhelp: {}", error.help()));
}

#[test]
fn the_pr2_stands_as_published() {
    let (robot, limbs) = pr2();
    assert_eq!(robot.warnings, []);
    assert_eq!(robot.variables().len(), 19);
    // Torso (-0.05, 0, 0.790675), shoulder 0.188 to the side, 0.1 + 0.4 + 0.321 + 0.18 to the tool.
    let tool = robot.link_in_root(limbs.arms[0].chain.tip(), &robot.zero());
    assert_same_pose(&tool, &Isometry3::translation(0.951, 0.188, 0.790675), 1e-12);
    let limits: Vec<_> = limbs.arms[1].chain.limits().to_vec();
    let pan = std::f64::consts::FRAC_PI_4;
    assert!((limits[0].expect("the pan joint has limits").0 + pan + 1.5).abs() < 1e-8);
    assert_eq!(limits[3], Some((-2.3213, 0.0)));
    assert_eq!(limits[4], None);
}

#[test]
fn the_camera_of_the_pr2_looks_forward() {
    let (robot, limbs) = pr2();
    let camera = robot.link_in_root(limbs.head.expect("it has a head").camera, &robot.zero());
    let forward = camera.rotation * nalgebra::Vector3::z();
    assert!((forward - nalgebra::Vector3::x()).norm() < 1e-9);
    assert!((camera.translation.z - (0.790675 + 0.38145 + 0.1146)).abs() < 1e-9);
}

#[test]
fn the_robot_with_one_arm_is_read() {
    let (robot, limbs) = one_arm();
    assert_eq!(robot.warnings, []);
    assert_eq!(limbs.arms.len(), 1);
    assert_eq!(limbs.arms[0].chain.variables().len(), 6);
}

#[test]
fn fingers_that_mimic_move_alike() {
    let (robot, limbs) = pr2();
    let gripper = limbs.arms[0].gripper.as_ref().expect("it has a gripper");
    let mut open = robot.zero();
    open[gripper.variable.index()] = gripper.open;
    let gap = |configuration: &[f64]| {
        let at = |name| {
            robot.link_in_root(robot.link(name).expect("it is there"), configuration).translation.vector
        };
        (at("l_gripper_l_finger_tip_link") - at("l_gripper_r_finger_tip_link")).norm()
    };
    // Pads meet at 0 and are about 0.09 m apart when open, as published.
    assert!((gap(&open) - gap(&robot.zero()) - gripper.width_m).abs() < 0.005);
    assert_eq!(gripper.value_for_width(0.0), gripper.closed);
    assert_eq!(gripper.value_for_width(1.0), gripper.open);
    assert_eq!(gripper.value_for_width(f64::INFINITY), gripper.open);
}

#[test]
fn a_planar_joint_above_all_is_the_base() {
    let text = robot(
        r#"<link name="odom"/><link name="base"/><joint name="slide" type="planar">
        <parent link="odom"/><child link="base"/><axis xyz="0 0 1"/></joint>"#,
    );
    let read = Robot::from_urdf("test.urdf", &text).expect("the file is read");
    assert_eq!((read.base_joint, read.links().len()), (BaseJoint::Planar, 1));
    check_warnings(
        &text,
        expect![[r#"
        joint `slide` moves the whole robot; the links above it are left out
        help: put what does not move with the robot into the scene"#]],
    );
}

#[test]
fn odd_files_are_read_with_warnings() {
    check_warnings(
        &robot(
            r#"<link name="a"><collision><geometry><mesh filename="package://a/b.stl"/></geometry></collision></link>
            <link name="b"><collision><geometry><sphere radius="1"/></geometry></collision></link>
            <joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint>"#,
        ),
        expect![[r#"
            link `a`: the mesh `package://a/b.stl` is left out, so collisions with this part are not seen
            help: add a `<collision>` of boxes, cylinders, spheres or capsules around it to the link
            link `b` has shapes, but no mass; a body of it will be as heavy as water
            help: add `<inertial>` with a mass above 0 to the link"#]],
    );
    check_warnings(
        &robot(
            r#"<link name="a"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
            <visual><geometry><box size="1 1 1"/></geometry></visual></link>"#,
        ),
        expect![[r#"
            no link has a collision shape; the visual shapes are taken instead
            help: copy shapes that matter into `<collision>` elements"#]],
    );
}

#[test]
fn files_that_are_no_robot() {
    for text in ["", "<robot", "(a robot)"] {
        check_error(
            text,
            expect![[r#"
                test.urdf: is no URDF: No elements found
                help: a file that `check_urdf` accepts is read; xacro files are expanded first: `xacro robot.xacro > robot.urdf`"#]],
        );
    }
    check_error(
        "<robot name=\"a\"><link/></robot>",
        expect![[r#"
            test.urdf: line 1: missing field `name`
            help: what each element must have is listed at http://wiki.ros.org/urdf/XML"#]],
    );
    check_error(
        "<robot>\n<!-- <link> -->\n<link name=\"a\"/><joint name=\"j\" type=\"fixed\">",
        expect![[r#"
            test.urdf: line 3: `<joint>` is not closed
            help: what each element must have is listed at http://wiki.ros.org/urdf/XML"#]],
    );
    check_error(
        "<robot>\n<transmission><joint/></transmission>\n<link name=\"a\"/>\n\n<joint name=\"j\"/></robot>",
        expect![[r#"
            test.urdf: line 5: missing field `type`
            help: what each element must have is listed at http://wiki.ros.org/urdf/XML"#]],
    );
    check_error(
        "<robot name=\"a\"/>",
        expect![[r#"
        test.urdf: has no link
        help: the file of a robot has `<link name="…">` elements inside of `<robot>`"#]],
    );
    check_error(
        &"<a>".repeat(100_000),
        expect![[r#"
        test.urdf: elements are nested more than 64 deep
        help: look for an element that is not closed"#]],
    );
    let missing =
        Robot::from_file(std::path::Path::new("no-such-file.urdf")).expect_err("there is no such file");
    assert_eq!(missing.help(), "check the path and the rights of the file");
}

#[test]
fn robots_that_are_no_tree() {
    let link = |name: &str| format!("<link name=\"{name}\"/>");
    let joint = |name: &str, parent: &str, child: &str| {
        format!(
            r#"<joint name="{name}" type="fixed"><parent link="{parent}"/><child link="{child}"/></joint>"#
        )
    };
    let (base, arm, hand) = (link("base"), link("arm"), link("hand"));
    check_error(
        &robot(&format!("{base}{base}")),
        expect![[r#"
        test.urdf: two links are called `base`
        help: rename one of the two"#]],
    );
    check_error(
        &robot(&format!("{base}{arm}")),
        expect![[r#"
        test.urdf: the links `base`, `arm` all hang on nothing, but a robot has one root
        help: connect them by joints, if need be fixed ones, or delete what is left over"#]],
    );
    check_error(
        &robot(&format!("{base}{arm}{}", joint("j", "base", "arn"))),
        expect![[r#"
            test.urdf: joint `j` names the link `arn`, which is not defined
            help: did you mean `arm`?"#]],
    );
    check_error(
        &robot(&format!("{base}{arm}{}{}", joint("j", "base", "arm"), joint("k", "base", "arm"))),
        expect![[r#"
        test.urdf: link `arm` is the child of two joints, `j` and `k`
        help: a robot is a tree: remove one joint, or model the closed chain by a mimic joint"#]],
    );
    check_error(
        &robot(&format!("{base}{arm}{}{}", joint("j", "base", "arm"), joint("k", "arm", "base"))),
        expect![[r#"
        test.urdf: the links `base`, `arm` hang on one another in a ring
        help: a robot is a tree: remove one joint of the ring"#]],
    );
    check_error(
        &robot(&format!("{base}{arm}{hand}{}{}", joint("j", "hand", "arm"), joint("k", "arm", "hand"))),
        expect![[r#"
            test.urdf: the links `arm`, `hand` hang on one another in a ring
            help: a robot is a tree: remove one joint of the ring"#]],
    );
}

#[test]
fn joints_with_mistakes() {
    let with = |joint: &str| robot(&format!(r#"<link name="a"/><link name="b"/>{joint}"#));
    let joint = |kind: &str, rest: &str| {
        with(&format!(r#"<joint name="j" type="{kind}"><parent link="a"/><child link="b"/>{rest}</joint>"#))
    };
    check_error(
        &joint("revolute", ""),
        expect![[r#"
        test.urdf: joint `j` has no limits
        help: add `<limit lower="…" upper="…" velocity="…" effort="…"/>`, or make a joint that turns without end `continuous`"#]],
    );
    check_error(
        &joint("prismatic", r#"<limit velocity="1" effort="1"/>"#),
        expect![[r#"
        test.urdf: joint `j` has no limits
        help: add `<limit lower="…" upper="…" velocity="…" effort="…"/>`, or make a joint that turns without end `continuous`"#]],
    );
    check_error(
        &joint("revolute", r#"<limit lower="1" upper="-1" velocity="1"/>"#),
        expect![[r#"
        test.urdf: joint `j` has the lower limit 1 above the upper limit -1
        help: swap the two"#]],
    );
    check_error(
        &joint("revolute", r#"<limit lower="-90" upper="90" velocity="1"/>"#),
        expect![[r#"
        test.urdf: joint `j`: a limit of -90 rad
        help: angles are in radians; is this in degrees? A joint without end is `continuous`"#]],
    );
    check_error(
        &joint("continuous", r#"<limit velocity="-1"/>"#),
        expect![[r#"
            test.urdf: joint `j` has the greatest velocity -1
            help: write a speed above 0, in rad/s or m/s"#]],
    );
    check_error(
        &joint("continuous", r#"<axis xyz="0 0 0"/>"#),
        expect![[r#"
        test.urdf: joint `j` moves along an axis of length 0
        help: write the direction, for example `<axis xyz="0 0 1"/>`"#]],
    );
    check_error(
        &joint("fixed", r#"<origin xyz="0 nan 0"/>"#),
        expect![[r#"
        test.urdf: joint `j`: the position of an origin is not a finite number
        help: write a number such as `0.1` or `-2e-3`"#]],
    );
    check_error(
        &joint("fixed", r#"<origin xyz="350 0 0"/>"#),
        expect![[r#"
        test.urdf: joint `j`: an offset of 350 m
        help: lengths are in metres; is this in millimetres?"#]],
    );
    check_error(
        &joint("continuous", r#"<mimic joint="j"/>"#),
        expect![[r#"
        test.urdf: joint `j` mimics `j`, and at last itself, or a long way round
        help: let it mimic a revolute, continuous or prismatic joint"#]],
    );
    check_error(
        &joint("continuous", r#"<mimic joint="k"/>"#),
        expect![[r#"
        test.urdf: joint `j` mimics `k`, which is not defined
        help: let it mimic a revolute, continuous or prismatic joint"#]],
    );
    check_error(
        &joint("spherical", ""),
        expect![[r#"
        test.urdf: joint `j` is spherical, which is not understood
        help: use revolute, continuous, prismatic and fixed joints; several at one place make a joint of more directions"#]],
    );
    check_error(
        &joint("screw", ""),
        expect![[r#"
            test.urdf: line 1: unknown variant `screw`, expected one of `revolute`, `continuous`, `prismatic`, `fixed`, `floating`, `planar`, `spherical`
            help: what each element must have is listed at http://wiki.ros.org/urdf/XML"#]],
    );
    check_error(
        &robot(
            r#"<link name="a"/><link name="b"/><link name="c"/>
            <joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint>
            <joint name="k" type="floating"><parent link="b"/><child link="c"/></joint>"#,
        ),
        expect![[r#"
            test.urdf: joint `k` is floating, which is understood only above all other joints
            help: use revolute, continuous, prismatic and fixed joints; several at one place make a joint of more directions"#]],
    );
}

#[test]
fn links_with_mistakes() {
    let shape = |shape: &str| {
        robot(&format!(r#"<link name="a"><collision><geometry>{shape}</geometry></collision></link>"#))
    };
    check_warnings(
        &shape(r#"<box size="1 0 1"/>"#),
        expect![[r#"
        link `a`: a box without volume is left out
        help: delete it, or give it lengths above 0"#]],
    );
    check_error(
        &shape(r#"<box size="1 -1 1"/>"#),
        expect![[r#"
        test.urdf: link `a` has a box of negative or endless size
        help: all lengths must be above 0"#]],
    );
    check_error(
        &shape(r#"<cylinder radius="inf" length="1"/>"#),
        expect![[r#"
        test.urdf: link `a` has a cylinder of negative or endless size
        help: all lengths must be above 0"#]],
    );
    check_error(
        &shape(r#"<sphere radius="-1"/>"#),
        expect![[r#"
            test.urdf: link `a` has a sphere of negative or endless size
            help: all lengths must be above 0"#]],
    );
    check_error(
        &shape(r#"<cylinder radius="0.1" length="450"/>"#),
        expect![[r#"
        test.urdf: link `a`: a shape of 450 m
        help: lengths are in metres; is this in millimetres?"#]],
    );
    check_error(
        &shape(r#"<cone radius="1"/>"#),
        expect![[r#"
            test.urdf: line 1: unknown variant `cone`, expected one of `box`, `cylinder`, `capsule`, `sphere`, `mesh`
            help: what each element must have is listed at http://wiki.ros.org/urdf/XML"#]],
    );
    let mass = |mass: &str| {
        robot(&format!(
            r#"<link name="a"><inertial><mass value="{mass}"/>
            <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>"#
        ))
    };
    check_error(
        &mass("-2"),
        expect![[r#"
        test.urdf: link `a` has the mass -2 kg
        help: a mass is above 0, or left out for a link that is only a frame"#]],
    );
    check_error(
        &mass("inf"),
        expect![[r#"
        test.urdf: link `a`: the mass is not a finite number
        help: write a number such as `0.1` or `-2e-3`"#]],
    );
    check_error(
        &mass("heavy"),
        expect![[r#"
            test.urdf: line 1: invalid float literal
            help: what each element must have is listed at http://wiki.ros.org/urdf/XML"#]],
    );
}

#[test]
fn chains_with_mistakes() {
    check_chains(
        |chains| chains.torso = Some("torso_joint".into()),
        expect![[r#"
            pr2.urdf: the torso names the joint `torso_joint`, which the robot does not have
            help: did you mean `torso_lift_joint`?"#]],
    );
    check_chains(
        |chains| chains.torso = Some("head_plate".into()),
        expect![[r#"
            pr2.urdf: the torso names the joint `head_plate`, which the robot does not have
            help: did you mean `head_pan_joint`?"#]],
    );
    check_chains(
        |chains| chains.arms[0].base = "l_gripper_tool_frame".into(),
        expect![[r#"
        pr2.urdf: the arm `left`: nothing moves between the links `l_gripper_tool_frame` and `l_gripper_tool_frame`
        help: choose a first link further up, or a last link further down"#]],
    );
    check_chains(
        |chains| chains.arms[0].base = "head_pan_link".into(),
        expect![[r#"
        pr2.urdf: the arm `left`: the link `l_gripper_tool_frame` does not hang on the link `head_pan_link`
        help: the first link of a chain is above the last one; are the two exchanged?"#]],
    );
    check_chains(
        |chains| chains.arms[0].base = "l_gripper_palm_link".into(),
        expect![[r#"
        pr2.urdf: the arm `left`: nothing moves between the links `l_gripper_palm_link` and `l_gripper_tool_frame`
        help: choose a first link further up, or a last link further down"#]],
    );
    check_chains(
        |chains| chains.arms[1].name = "left".into(),
        expect![[r#"
        pr2.urdf: two arms are called `left`
        help: rename one of the two"#]],
    );
    check_chains(
        |chains| chains.arms[0].park = vec![0.0],
        expect![[r#"
        pr2.urdf: the arm `left`: 1 values are given for 7 moving joints
        help: give one value for each moving joint between base and tip, in this order"#]],
    );
    check_chains(
        |chains| chains.arms[0].park[3] = 1.0,
        expect![[r#"
            pr2.urdf: the arm `left`: the parked position of joint `l_elbow_flex_joint` is outside of its limits
            help: limits are those of the robot's file; radians and metres"#]],
    );
    let gripper = |chains: &mut Chains, joint: &str| {
        chains.arms[0].gripper.as_mut().expect("it has one").joint = joint.into();
    };
    check_chains(
        |chains| gripper(chains, "l_gripper_r_finger_joint"),
        expect![[r#"
        pr2.urdf: the gripper of the arm `left`: joint `l_gripper_r_finger_joint` only mimics another one; name that one
        help: name another joint, or change its type in the file"#]],
    );
    check_chains(
        |chains| gripper(chains, "l_gripper_tool_joint"),
        expect![[r#"
        pr2.urdf: the gripper of the arm `left`: joint `l_gripper_tool_joint` is fixed
        help: name another joint, or change its type in the file"#]],
    );
    check_chains(
        |chains| chains.arms[0].gripper.as_mut().expect("it has one").open = 2.0,
        expect![[r#"
            pr2.urdf: the gripper of the arm `left`: the open position of joint `l_gripper_l_finger_joint` is outside of its limits
            help: limits are those of the robot's file; radians and metres"#]],
    );
    check_chains(
        |chains| chains.arms[0].gripper.as_mut().expect("it has one").width_m = f64::NAN,
        expect![[r#"
            pr2.urdf: the gripper of the arm `left`: the width of joint `l_gripper_l_finger_joint` is not above 0
            help: limits are those of the robot's file; radians and metres"#]],
    );
    let head = |camera: &str| HeadNames {
        pan: "head_pan_joint".into(),
        tilt: "head_tilt_joint".into(),
        camera: camera.into(),
    };
    check_chains(
        |chains| chains.head = Some(head("stereo")),
        expect![[r#"
            pr2.urdf: the head names the link `stereo`, which the robot does not have
            help: did you mean `wide_stereo_optical_frame`?"#]],
    );
}

#[test]
fn a_chain_of_too_many_joints_is_refused() {
    let mut elements = String::from("<link name=\"l0\"/>");
    for number in 1..=17 {
        let above = number - 1;
        elements += &format!(
            r#"<link name="l{number}"/><joint name="j{number}" type="continuous"><parent link="l{above}"/><child link="l{number}"/></joint>"#
        );
    }
    let long = Robot::from_urdf("test.urdf", &robot(&elements)).expect("the file is read");
    let chains = Chains { arms: vec![bare_arm("l0", "l17", 17)], ..Chains::default() };
    let error = long.limbs(&chains).expect_err("it is too long");
    expect!["test.urdf: the arm `arm` has 17 moving joints, more than 16"].assert_eq(&error.to_string());
}

/// Damages a text in one of several ways.
fn mutate(text: &str, dice: &mut Dice) -> String {
    let mut bytes = text.as_bytes().to_vec();
    for _ in 0..=dice.below(3) {
        let at = dice.below(bytes.len());
        let end = (at + dice.below(40)).min(bytes.len());
        match dice.below(9) {
            0 => drop(bytes.drain(at..end)),
            1 => {
                let copy = bytes[at..end].to_vec();
                let to = dice.below(bytes.len());
                bytes.splice(to..to, copy);
            }
            2 => bytes[at] = b"<>/\"'=& \n\0x0-"[dice.below(13)],
            3 => bytes.truncate(at),
            // What a file contains most is numbers and names: exchange one for an odd one.
            _ => {
                let quoted: Vec<usize> = (0..bytes.len()).filter(|at| bytes[*at] == b'"').collect();
                let Some(pair) = quoted
                    .get(dice.below(quoted.len().max(2)) & !1..)
                    .and_then(|rest| rest.first_chunk::<2>())
                else {
                    continue;
                };
                let odd = [
                    "nan",
                    "inf",
                    "-1e308",
                    "0 0 0",
                    "1 1",
                    "",
                    "base_link",
                    "floating",
                    "planar",
                    "l_wrist_roll_link",
                    "99999",
                    "-0.0",
                    "1e-320 0 0",
                    "&amp;",
                    "0.3",
                    "-0.1 0.2 0.3",
                    "1 0 0",
                    "0.02 0.2 0.1",
                ];
                bytes.splice(pair[0] + 1..pair[1], odd[dice.below(odd.len())].bytes());
            }
        }
        if bytes.is_empty() {
            break;
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

#[test]
fn no_damaged_file_panics() {
    let mut dice = Dice::new(5);
    let (mut read, mut refused) = (0, 0);
    let (mut poses, mut scratch) = (Vec::new(), Scratch::default());
    for round in 0..1500 {
        let (text, chains) = match round % 2 {
            0 => (PR2, Chains::pr2()),
            _ => (ONE_ARM, Chains::one_arm()),
        };
        let text = mutate(text, &mut dice);
        match Robot::from_urdf("damaged.urdf", &text) {
            Ok(robot) => {
                read += 1;
                robot.forward(&Isometry3::identity(), &dice.configuration(&robot), &mut poses);
                assert!(
                    poses.iter().all(|pose| pose.translation.vector.iter().all(|number| number.is_finite()))
                );
                match robot.limbs(&chains) {
                    Ok(limbs) if round % 16 < 2 => {
                        CollisionModel::new(&robot, &limbs).self_touch(&poses, &[], &mut scratch);
                    }
                    Ok(_) => {}
                    Err(error) => assert!(!error.to_string().is_empty() && !error.help().is_empty()),
                }
            }
            Err(error) => {
                refused += 1;
                assert!(!error.to_string().is_empty() && !error.help().is_empty());
            }
        }
    }
    assert!(read > 100 && refused > 100, "{read} read, {refused} refused");
}
