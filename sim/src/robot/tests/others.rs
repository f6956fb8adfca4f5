//! Robots that are no Fetch: without head and torso, with a hand that is drawn along z, fingers that mimic each other, an arm and a
//! gripper in files of their own.

use std::path::Path;

use nalgebra::{Isometry3, Vector3};

use super::super::{RobotConfig, RobotModel, pairs};

const ARM: &str = r#"<robot name="arm">
<link name="base"><collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>
<link name="upper"><collision><origin xyz="0 0 0.2"/><geometry><box size="0.06 0.06 0.34"/></geometry></collision></link>
<link name="lower"><collision><origin xyz="0 0 0.2"/><geometry><box size="0.06 0.06 0.34"/></geometry></collision></link>
<link name="wrist"/><link name="roll"/><link name="flange"/>
<joint name="pan" type="revolute"><parent link="base"/><child link="turn"/><origin xyz="0 0 0.15"/><axis xyz="0 0 1"/>
  <limit lower="-2" upper="2" velocity="2" effort="50"/></joint>
<link name="turn"/>
<joint name="shoulder" type="revolute"><parent link="turn"/><child link="upper"/><axis xyz="0 1 0"/>
  <limit lower="-2" upper="2" velocity="2" effort="50"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0 0 0.4"/><axis xyz="0 1 0"/>
  <limit lower="-2.8" upper="2.8" velocity="2" effort="50"/></joint>
<joint name="wrist_flex" type="revolute"><parent link="lower"/><child link="wrist"/><origin xyz="0 0 0.4"/><axis xyz="0 1 0"/>
  <limit lower="-2.8" upper="2.8" velocity="2" effort="20"/></joint>
<joint name="wrist_yaw" type="revolute"><parent link="wrist"/><child link="roll"/><origin xyz="0 0 0.08"/><axis xyz="1 0 0"/>
  <limit lower="-2.8" upper="2.8" velocity="2" effort="20"/></joint>
<joint name="wrist_roll" type="continuous"><parent link="roll"/><child link="flange"/><origin xyz="0 0 0.08"/><axis xyz="0 0 1"/>
  <limit velocity="2" effort="20"/></joint>
</robot>"#;

/// z points out, x is the closing direction, and the tips are links of their own.
const HAND: &str = r#"<robot name="hand">
<link name="palm"><collision><origin xyz="0 0 0.03"/><geometry><box size="0.16 0.05 0.06"/></geometry></collision></link>
<link name="right"/><link name="left"/>
<link name="right_tip"><collision><origin xyz="-0.005 0 0.02"/><geometry><box size="0.01 0.02 0.04"/></geometry></collision></link>
<link name="left_tip"><collision><origin xyz="0.005 0 0.02"/><geometry><box size="0.01 0.02 0.04"/></geometry></collision></link>
<joint name="right_slide" type="prismatic"><parent link="palm"/><child link="right"/><origin xyz="0 0 0.06"/><axis xyz="-1 0 0"/>
  <limit lower="0" upper="0.04" velocity="0.1" effort="40"/></joint>
<joint name="left_slide" type="prismatic"><parent link="palm"/><child link="left"/><origin xyz="0 0 0.06"/><axis xyz="1 0 0"/>
  <limit lower="0" upper="0.04" velocity="0.1" effort="40"/><mimic joint="right_slide"/></joint>
<joint name="right_fix" type="fixed"><parent link="right"/><child link="right_tip"/><origin xyz="0 0 0.01"/></joint>
<joint name="left_fix" type="fixed"><parent link="left"/><child link="left_tip"/><origin xyz="0 0 0.01"/></joint>
</robot>"#;

const CONFIG: &str = r#"
[groups]
arm = ["pan", "shoulder", "elbow", "wrist_flex", "wrist_yaw", "wrist_roll"]
gripper = ["right_slide", "left_slide"]
[[attach]]
urdf = "hand.urdf"
link = "flange"
xyz = [0.0, 0.0, 0.01]
[poses.ready]
shoulder = -0.3
elbow = 1.5
[limits]
pan = { velocity = 1.0, acceleration = 1.0, lower = -1.0, upper = 1.5 }
shoulder = { velocity = 1.0, acceleration = 1.0 }
elbow = { velocity = 1.0, acceleration = 1.0 }
wrist_flex = { velocity = 1.0, acceleration = 1.0 }
wrist_yaw = { velocity = 1.0, acceleration = 1.0 }
wrist_roll = { velocity = 1.0, acceleration = 1.0 }
right_slide = { velocity = 0.1, acceleration = 1.0 }
left_slide = { velocity = 0.1, acceleration = 1.0 }
[gripper]
link = "palm"
frame = { xyz = [0.0, 0.0, 0.09], rpy = [1.5707963267948966, 0.0, 1.5707963267948966] }
pad_half_extents = [0.005, 0.01, 0.02]
pad_centers = [[-0.005, 0.0, 0.03], [0.005, 0.0, 0.03]]
opening = 0.08
finger_depth = 0.05
max_force = 40.0
"#;

fn load(folder: &Path, config: &str) -> crate::Result<(RobotModel, RobotConfig)> {
    std::fs::write(folder.join("arm.urdf"), ARM).unwrap();
    std::fs::write(folder.join("hand.urdf"), HAND).unwrap();
    std::fs::write(folder.join("robot.toml"), config).unwrap();
    RobotConfig::load(&folder.join("robot.toml"), RobotModel::load(&folder.join("arm.urdf"), &[])?)
}

/// A frame whose x is along z of the palm and whose y along its x.
fn frame() -> String {
    // z out, x closing: columns z, x, y.
    let axes: nalgebra::Matrix3<f64> =
        nalgebra::Matrix3::from_columns(&[Vector3::z(), Vector3::x(), Vector3::y()]);
    let (roll, pitch, yaw) = nalgebra::Rotation3::from_matrix_unchecked(axes).euler_angles();
    CONFIG.replace(
        "rpy = [1.5707963267948966, 0.0, 1.5707963267948966]",
        &format!("rpy = [{roll:.12}, {pitch:.12}, {yaw:.12}]"),
    )
}

#[test]
fn an_arm_and_a_hand_of_two_files_are_one_robot() {
    let folder = tempfile::tempdir().unwrap();
    let (robot, config) = load(folder.path(), &frame()).unwrap();
    assert!(config.head.is_none() && config.camera.is_none() && config.torso().is_none());
    assert_eq!(config.arm, config.arm_with_torso);
    let pan = &robot.joints()[robot.joint_index("pan").unwrap()];
    assert_eq!((pan.limits.lower, pan.limits.upper), (-1.0, 1.5));
    // The finger that mimics the other has a drive of its own.
    let names: Vec<&str> = config.gripper.fingers.iter().map(|&j| robot.joints()[j].name.as_str()).collect();
    assert_eq!(names, ["right_slide", "left_slide"]);
    let mut q = config.configuration(&robot, "ready").unwrap();
    let [right, left] = config.gripper.fingers;
    (q[right], q[left]) = (0.01, 0.03);
    let poses = robot.fk(&q);
    // x of the gripper's frame leads out of the palm, y from the right finger to the left.
    let palm = poses[robot.link_index("palm").unwrap()];
    let gripper = poses[config.gripper.link];
    assert!((gripper * Vector3::x() - palm * Vector3::z()).norm() < 1e-9);
    let seen = |name: &str| -> Isometry3<f64> { gripper.inverse() * poses[robot.link_index(name).unwrap()] };
    assert!((seen("right").translation.vector - Vector3::new(-0.03, -0.01, 0.0)).norm() < 1e-9);
    assert!((seen("left").translation.vector - Vector3::new(-0.03, 0.03, 0.0)).norm() < 1e-9);
    assert!((config.gripper.gap(&robot, [0.01, 0.03]) - 0.04).abs() < 1e-9);
    assert!((config.gripper.pad_half_extents - Vector3::new(0.02, 0.005, 0.01)).norm() < 1e-9);
    // What is fixed to a finger is a part of it.
    let finger = &robot.links()[config.gripper.finger_links[1]];
    assert_eq!(finger.collisions.len(), 1);
    assert!((finger.collisions[0].pose.translation.vector - Vector3::new(0.005, 0.0, 0.03)).norm() < 1e-9);
    assert!(robot.links()[robot.link_index("left_tip").unwrap()].collisions.is_empty());
}

#[test]
fn what_does_not_fit_is_told_with_its_field() {
    let folder = tempfile::tempdir().unwrap();
    for (from, to, wanted) in [
        ("link = \"flange\"", "link = \"flanch\"", "attach[0]: link: robot arm: no link 'flanch'"),
        ("hand.urdf", "arm.urdf", "attach[0]: two links are called 'base'"),
        ("lower = -1.0", "lower = -3.0", "limits.pan: lower -3 and upper 1.5"),
        (
            "xyz = [0.0, 0.0, 0.09]",
            "xyz = [0.0, 0.0, 0.12]",
            "gripper.frame: its origin must lie between the pads",
        ),
        ("[[-0.005, 0.0, 0.03], [0.005", "[[-0.008, 0.0, 0.03], [0.008", "the pads are 0.0860 m apart"),
        ("link = \"palm\"", "link = \"flange\"", "must be a prismatic joint on gripper.link 'flange'"),
        ("[gripper]", "[head]\npan = \"pan\"\ntilt = \"elbow\"\n[gripper]", "there is no [camera]"),
        ("[gripper]", "[self_collision]\nsrdf = \"none.srdf\"\n[gripper]", "self_collision.srdf"),
    ] {
        let text = frame();
        assert!(text.contains(from), "{from}");
        let error = load(folder.path(), &text.replacen(from, to, 1)).unwrap_err().to_string();
        assert!(error.contains(wanted) && error.contains("robot.toml"), "{error}");
    }
}

#[test]
fn a_guessed_file_fits_its_robot() {
    let folder = tempfile::tempdir().unwrap();
    let (robot, by_hand) = load(folder.path(), &frame()).unwrap();
    // Of the whole robot, as a URDF of it would have it: what was added by the file goes.
    let whole = ARM.replace("</robot>", "")
        + &HAND.replace("<robot name=\"hand\">", "")
            .replace("</robot>", "<joint name=\"mount\" type=\"fixed\"><parent link=\"flange\"/><child link=\"palm\"/></joint></robot>");
    std::fs::write(folder.path().join("whole.urdf"), whole).unwrap();
    let whole = RobotModel::load(&folder.path().join("whole.urdf"), &[]).unwrap();
    let text = whole.guessed_config().unwrap();
    let path = folder.path().join("guessed.toml");
    std::fs::write(&path, &text).unwrap();
    let (whole, guessed) = RobotConfig::load(&path, whole).unwrap_or_else(|error| panic!("{error}\n{text}"));
    assert_eq!(guessed.arm.len(), 6);
    let names = |robot: &RobotModel, config: &RobotConfig| {
        config.gripper.fingers.map(|joint| robot.joints()[joint].name.clone())
    };
    assert_eq!(names(&whole, &guessed), names(&robot, &by_hand));
    assert!((guessed.gripper.opening - 0.08).abs() < 1e-6, "{text}");
    assert!((guessed.gripper.finger_depth - 0.05).abs() < 1e-6, "{text}");
    assert!((guessed.gripper.pad_half_extents - by_hand.gripper.pad_half_extents).norm() < 1e-6, "{text}");
    // The hand points down.
    let q = guessed.configuration(&whole, "ready").unwrap();
    let out = whole.fk_link(&q, guessed.gripper.link) * Vector3::x();
    assert!((out + Vector3::z()).norm() < 0.02, "{out}\n{text}");
    // An arm alone is told what it lacks.
    let arm = RobotModel::load(&folder.path().join("arm.urdf"), &[]).unwrap();
    assert!(arm.guessed_config().unwrap_err().contains("no two prismatic joints"));
}

#[test]
fn sampling_finds_what_touches_always_and_never() {
    let folder = tempfile::tempdir().unwrap();
    // A cover about the elbow reaches into the base's own shell: "lower" is always in "shell", "far" is never near.
    let urdf = r#"<robot name="r"><link name="base"/>
<link name="a"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
<link name="b"/>
<link name="c"><collision><origin xyz="0 0 0.05"/><geometry><sphere radius="0.1"/></geometry></collision></link>
<link name="d"><collision><origin xyz="0 0 1"/><geometry><sphere radius="0.1"/></geometry></collision></link>
<joint name="i" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
<joint name="k" type="revolute"><parent link="b"/><child link="c"/><axis xyz="1 0 0"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
<joint name="l" type="revolute"><parent link="b"/><child link="d"/><axis xyz="1 0 0"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
</robot>"#;
    let path = folder.path().join("r.urdf");
    std::fs::write(&path, urdf).unwrap();
    let robot = RobotModel::load(&path, &[]).unwrap();
    let found = pairs::sampled(&robot);
    let reason = |a: &str, b: &str| {
        let links = (robot.link_index(a).unwrap(), robot.link_index(b).unwrap());
        found.iter().find(|pair| pair.links == links).map(|pair| pair.reason)
    };
    assert_eq!(reason("a", "c"), Some(pairs::Reason::Always));
    assert_eq!(reason("a", "d"), Some(pairs::Reason::Never));
    assert_eq!(found, pairs::sampled(&robot));
}

#[test]
fn a_follower_keeps_its_leader_within_its_own_limits() {
    let folder = tempfile::tempdir().unwrap();
    let urdf = |multiplier: f64| {
        format!(
            r#"<robot name="r" drake:kind="x"><link name="a"/><link name="b"/><link name="c"/>
<joint name="leader" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
<joint name="follower" type="revolute"><parent link="b"/><child link="c"/><axis xyz="0 0 1"/><limit lower="0" upper="0.4" velocity="1" effort="1"/>
<mimic joint="leader" multiplier="{multiplier}" offset="0.1"/></joint></robot>"#
        )
    };
    let path = folder.path().join("r.urdf");
    let limits = |multiplier: f64| {
        std::fs::write(&path, urdf(multiplier)).unwrap();
        let robot = RobotModel::load(&path, &[]).unwrap();
        let limits = robot.joints()[0].limits;
        [limits.lower, limits.upper]
    };
    let near = |a: [f64; 2], b: [f64; 2]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
    assert!(near(limits(2.0), [-0.05, 0.15]));
    assert!(near(limits(-2.0), [-0.15, 0.05]));
    // Nothing would be left of it: limits of a joint that turns the other way, as linkages have them.
    let other = urdf(-1.0).replace("lower=\"0\" upper=\"0.4\"", "lower=\"1.2\" upper=\"2\"");
    std::fs::write(&path, other).unwrap();
    assert_eq!(RobotModel::load(&path, &[]).unwrap().joints()[0].limits.upper, 1.0);
}
