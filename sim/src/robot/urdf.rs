//! The text of a URDF, checked element by element before `urdf-rs` reads it.
//!
//! `urdf-rs` tells neither which joint or link an error is of nor its line, passes over numbers that are none, and takes an effort
//! that is not there for 0. What is wrong is told here, and a velocity or effort limit that is not there becomes an infinite one.

use std::borrow::Cow;

use roxmltree::{Document, Node};

type Result<T> = std::result::Result<T, String>;

/// The description in a URDF.
///
/// # Errors
/// Joint or link, element, attribute, value and line.
pub(super) fn parse(text: &str) -> Result<urdf_rs::Robot> {
    let text = &with_prefixes(text);
    let document = Document::parse(text).map_err(|error| {
        let cut = if text.contains("<robot") && !text.contains("</robot>") {
            "; it was cut off: it has no </robot>"
        } else {
            ""
        };
        format!("is no whole XML: {error}{cut}")
    })?;
    let robot = document.root_element();
    let root = robot.tag_name().name();
    if root != "robot" {
        return Err(format!(
            "is no URDF: its root element is <{root}>, not <robot>{}",
            match root {
                "sdf" | "mujoco" | "COLLADA" => "; convert it to URDF first",
                "html" => "; download the raw file",
                _ => "",
            }
        ));
    }
    require(robot, &["name"])?;
    let mut mended = text.to_string();
    // From the end, so that places before stay what they are.
    let elements: Vec<Node<'_, '_>> = robot.descendants().filter(Node::is_element).collect();
    for node in elements.into_iter().rev() {
        let Some(parent) = node.parent_element() else { continue };
        if !known(node) {
            continue;
        }
        check(node, parent)?;
        if let Some((place, addition)) = limit_of(node) {
            mended.insert_str(place, &addition);
        }
    }
    urdf_rs::read_from_string(&mended).map_err(|error| format!("is not read as a URDF: {error}"))
}

/// The text with all prefixes of names declared: files for other programs, such as Drake, use them without that.
fn with_prefixes(text: &str) -> Cow<'_, str> {
    let mut text = Cow::Borrowed(text);
    // Each round declares another prefix; nobody uses so many.
    for _ in 0..8 {
        let Err(roxmltree::Error::UnknownNamespace(prefix, _)) = Document::parse(&text) else { break };
        let Some(at) = text.find("<robot").map(|at| at + "<robot".len()) else { break };
        text.to_mut().insert_str(at, &format!(" xmlns:{prefix}=\"urn:{prefix}\""));
    }
    text
}

/// Whether an element is one of a link, a joint or a material, and not in what other programs put into a URDF.
fn known(node: Node<'_, '_>) -> bool {
    // The document itself is the last ancestor, the robot the one before; what is directly in it says what it is.
    let path: Vec<&str> = node.ancestors().map(|node| node.tag_name().name()).collect();
    let [.., top, _, _] = path[..] else { return false };
    matches!(top, "link" | "joint" | "material")
}

/// Checks the attributes and children of an element that is known.
fn check(node: Node<'_, '_>, parent: Node<'_, '_>) -> Result<()> {
    let (tag, within) = (node.tag_name().name(), parent.tag_name().name());
    match (within, tag) {
        ("robot", "link") => {
            require(node, &["name"])?;
            once(node, &["inertial"])
        }
        ("robot", "joint") => {
            require(node, &["name", "type"])?;
            once(node, &["origin", "parent", "child", "axis", "limit", "mimic"])?;
            child(node, "parent")?;
            child(node, "child")?;
            kind(node)
        }
        ("joint", "parent" | "child") => require(node, &["link"]),
        ("joint", "mimic") => {
            require(node, &["joint"])?;
            numbers(node, &[("multiplier", 1), ("offset", 1)])
        }
        ("joint", "dynamics") => numbers(node, &[("damping", 1), ("friction", 1)]),
        ("joint", "calibration") => numbers(node, &[("rising", 1), ("falling", 1)]),
        ("joint", "safety_controller") => {
            require(node, &["k_velocity"])?;
            let all = ["soft_lower_limit", "soft_upper_limit", "k_position", "k_velocity"];
            numbers(node, &all.map(|name| (name, 1)))
        }
        ("joint", "limit") => numbers(node, &[("lower", 1), ("upper", 1), ("velocity", 1), ("effort", 1)]),
        ("joint", "axis") => {
            require(node, &["xyz"])?;
            numbers(node, &[("xyz", 3)])
        }
        (_, "origin") => {
            // Before, its readers pass over it, and the element is not turned.
            if node.attribute("quat_xyzw").is_some() && version(node) < (1, 1) {
                return Err(format!(
                    "{}: quat_xyzw is of URDF 1.1: say <robot version=\"1.1\">, or give rpy",
                    about(node)
                ));
            }
            numbers(node, &[("xyz", 3), ("rpy", 3), ("quat_xyzw", 4)])
        }
        ("link", "inertial") => {
            once(node, &["origin", "mass", "inertia"])?;
            child(node, "mass")?;
            child(node, "inertia")
        }
        ("inertial", "mass") => {
            require(node, &["value"])?;
            numbers(node, &[("value", 1)])
        }
        ("inertial", "inertia") => {
            let all = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"];
            require(node, &all)?;
            numbers(node, &all.map(|name| (name, 1)))
        }
        ("link", "visual" | "collision") => {
            once(node, &["origin", "geometry", "material"])?;
            child(node, "geometry")
        }
        (_, "geometry") => geometry(node),
        ("robot" | "visual", "material") => {
            require(node, &["name"])?;
            once(node, &["color", "texture"])
        }
        ("material", "color") => {
            require(node, &["rgba"])?;
            numbers(node, &[("rgba", 4)])?;
            color(node)
        }
        ("material", "texture") => {
            log::warn!("{}: textures of URDF materials are not read; its colour counts", about(node));
            Ok(())
        }
        _ => Ok(()),
    }
}

/// Shares of 0 to 1; what is less or more counts as these, as in RViz.
fn color(node: Node<'_, '_>) -> Result<()> {
    let text = node.attribute("rgba").unwrap_or_default();
    let shares = || text.split_whitespace().filter_map(|word| word.parse::<f64>().ok());
    if shares().any(f64::is_nan) {
        return Err(format!("{}: rgba=\"{text}\": must be four numbers of 0 to 1", about(node)));
    }
    if shares().any(|share| !(0.0..=1.0).contains(&share)) {
        log::warn!(
            "{}: rgba=\"{text}\": shares are 0 to 1, and what is more counts as 1; divide by 255",
            about(node)
        );
    }
    Ok(())
}

/// What the robot says, 1.0 where it says nothing or no version.
fn version(node: Node<'_, '_>) -> (u32, u32) {
    let said =
        node.document().root_element().attribute("version").and_then(|text| text.trim().split_once('.'));
    said.and_then(|(major, minor)| Some((major.parse().ok()?, minor.parse().ok()?))).unwrap_or((1, 0))
}

fn kind(joint: Node<'_, '_>) -> Result<()> {
    const KINDS: [&str; 7] =
        ["revolute", "continuous", "prismatic", "fixed", "floating", "planar", "spherical"];
    let kind = joint.attribute("type").unwrap_or_default();
    if !KINDS.contains(&kind) {
        return Err(format!("{}: type '{kind}' is none of {}", about(joint), KINDS.join(", ")));
    }
    let limit = children(joint, "limit").next();
    let needs = matches!(kind, "revolute" | "prismatic") && children(joint, "mimic").next().is_none();
    if limit.is_none() && needs {
        return Err(format!("{}: has no <limit>, which a revolute or prismatic joint needs", about(joint)));
    }
    Ok(())
}

fn geometry(node: Node<'_, '_>) -> Result<()> {
    let shapes: Vec<Node<'_, '_>> = node.children().filter(Node::is_element).collect();
    let [shape] = shapes[..] else {
        return Err(format!("{}: has {} shapes, not one", about(node), shapes.len()));
    };
    match shape.tag_name().name() {
        "box" => {
            require(shape, &["size"])?;
            numbers(shape, &[("size", 3)])
        }
        "cylinder" | "capsule" => {
            require(shape, &["radius", "length"])?;
            numbers(shape, &[("radius", 1), ("length", 1)])
        }
        "sphere" => {
            require(shape, &["radius"])?;
            numbers(shape, &[("radius", 1)])
        }
        "mesh" => {
            require(shape, &["filename"])?;
            numbers(shape, &[("scale", 3)])
        }
        other => Err(format!(
            "{}: <{other}> is not supported; box, cylinder, capsule, sphere and mesh are",
            about(node)
        )),
    }
}

/// What to add where, so that limits of a joint that are not there are none.
fn limit_of(node: Node<'_, '_>) -> Option<(usize, String)> {
    const NONE: &str = "inf";
    match node.tag_name().name() {
        "limit" => {
            let absent = ["velocity", "effort"].into_iter().filter(|name| node.attribute(*name).is_none());
            let addition: String = absent.map(|name| format!(" {name}=\"{NONE}\"")).collect();
            (!addition.is_empty()).then(|| (node.range().start + "<limit".len(), addition))
        }
        "joint" if children(node, "limit").next().is_none() => {
            // Before the first child: a joint has some.
            let place = node.first_element_child()?.range().start;
            Some((place, format!("<limit velocity=\"{NONE}\" effort=\"{NONE}\"/>")))
        }
        _ => None,
    }
}

/// `joint 'slide', <limit>, line 7`.
fn about(node: Node<'_, '_>) -> String {
    let tag = node.tag_name().name();
    let line = node.document().text_pos_at(node.range().start).row;
    let named = |node: &Node<'_, '_>| matches!(node.tag_name().name(), "link" | "joint" | "material");
    let whole = |node: &Node<'_, '_>| node.parent_element().is_some_and(|up| up.tag_name().name() == "robot");
    match node.ancestors().find(|up| named(up) && whole(up)) {
        None => format!("<{tag}>, line {line}"),
        Some(owner) => {
            let what = owner.tag_name().name();
            let name = owner.attribute("name").unwrap_or("without a name");
            let inner = if owner == node { String::new() } else { format!(", <{tag}>") };
            format!("{what} '{name}'{inner}, line {line}")
        }
    }
}

fn children<'a, 'input>(node: Node<'a, 'input>, tag: &'static str) -> impl Iterator<Item = Node<'a, 'input>> {
    node.children().filter(move |child| child.is_element() && child.tag_name().name() == tag)
}

fn child(node: Node<'_, '_>, tag: &'static str) -> Result<()> {
    children(node, tag).next().map(drop).ok_or_else(|| format!("{}: has no <{tag}>", about(node)))
}

fn once(node: Node<'_, '_>, tags: &[&'static str]) -> Result<()> {
    match tags.iter().find(|tag| children(node, tag).nth(1).is_some()) {
        Some(tag) => Err(format!("{}: has more than one <{tag}>", about(node))),
        None => Ok(()),
    }
}

fn require(node: Node<'_, '_>, attributes: &[&str]) -> Result<()> {
    match attributes.iter().find(|name| node.attribute(**name).is_none()) {
        Some(name) => Err(format!("{}: has no {name}=\"...\"", about(node))),
        None => Ok(()),
    }
}

/// Attributes that may be absent, and hold so many numbers where they are not.
fn numbers(node: Node<'_, '_>, attributes: &[(&str, usize)]) -> Result<()> {
    for &(name, count) in attributes {
        let Some(text) = node.attribute(name) else { continue };
        let wrong = |what: String| format!("{}: {name}=\"{text}\": {what}", about(node));
        if text.contains("${") || text.contains("$(") {
            return Err(wrong(
                "a xacro expression; expand it first: xacro FILE.urdf.xacro > FILE.urdf".into(),
            ));
        }
        let words: Vec<&str> = text.split_whitespace().collect();
        if let Some(word) = words.iter().find(|word| word.parse::<f64>().is_err()) {
            return Err(wrong(format!("'{word}' is no number")));
        }
        if words.len() != count {
            return Err(wrong(match words.len() {
                1 => format!("is one number, not {count}"),
                n => format!("are {n} numbers, not {count}"),
            }));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROBOT: &str = r#"<robot name="two">
  <material name="red"><color rgba="1 0 0 1"/></material>
  <link name="base"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <visual><origin xyz="0 0 1" rpy="0 0 0"/><geometry><mesh filename="a.stl" scale="1 1 1"/></geometry></visual></link>
  <link name="drawer"><collision><geometry><box size="1 1 1"/></geometry></collision></link>
  <joint name="slide" type="prismatic">
    <parent link="base"/><child link="drawer"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="0.4" velocity="1" effort="5"/>
  </joint>
  <gazebo reference="base"><limit velocity="fast"/><visual/></gazebo>
  <transmission name="t"><joint name="slide"/></transmission>
</robot>"#;

    #[test]
    fn limits_that_are_not_there_are_none() {
        let limit = |from: &str, to: &str| {
            let robot = parse(&ROBOT.replacen(from, to, 1)).unwrap();
            let limit = &robot.joints[0].limit;
            [limit.lower, limit.upper, limit.velocity, limit.effort]
        };
        let none = f64::INFINITY;
        assert_eq!(limit("", ""), [0.0, 0.4, 1.0, 5.0]);
        assert_eq!(limit(" velocity=\"1\" effort=\"5\"", ""), [0.0, 0.4, none, none]);
        assert_eq!(limit(" velocity=\"1\"", ""), [0.0, 0.4, none, 5.0]);
        assert_eq!(limit(" effort=\"5\"", ""), [0.0, 0.4, 1.0, none]);
        let turning = ROBOT.replace("prismatic", "continuous");
        let line = "    <limit lower=\"0\" upper=\"0.4\" velocity=\"1\" effort=\"5\"/>\n";
        let limit = &parse(&turning.replace(line, "")).unwrap().joints[0].limit;
        assert_eq!([limit.velocity, limit.effort], [none; 2]);
    }

    #[test]
    fn quaternions_of_urdf_1_1_turn_what_has_them() {
        let turned = ROBOT
            .replace("<robot name=\"two\">", "<robot name=\"two\" version=\"1.1\">")
            .replace("rpy=\"0 0 0\"", "quat_xyzw=\"0 0 0.7071067811865476 0.7071067811865476\"");
        let [roll, pitch, yaw] = *parse(&turned).unwrap().links[0].visual[0].origin.rpy;
        assert!(roll.abs() < 1e-9 && pitch.abs() < 1e-9 && (yaw - std::f64::consts::FRAC_PI_2).abs() < 1e-9);
    }

    #[test]
    fn what_is_wrong_is_named_with_its_element_value_and_line() {
        let limit = "<limit lower=\"0\" upper=\"0.4\" velocity=\"1\" effort=\"5\"/>";
        for (from, to, wanted) in [
            (
                "velocity=\"1\"",
                "velocity=\"fast\"",
                "joint 'slide', <limit>, line 8: velocity=\"fast\": 'fast' is no number",
            ),
            (
                "axis xyz=\"1 0 0\"",
                "axis xyz=\"1 a 0 0\"",
                "joint 'slide', <axis>, line 7: xyz=\"1 a 0 0\": 'a' is no number",
            ),
            (
                "scale=\"1 1 1\"",
                "scale=\"0.001\"",
                "link 'base', <mesh>, line 4: scale=\"0.001\": is one number, not 3",
            ),
            (
                "rgba=\"1 0 0 1\"",
                "rgba=\"1 0 0\"",
                "material 'red', <color>, line 2: rgba=\"1 0 0\": are 3 numbers, not 4",
            ),
            (
                "rgba=\"1 0 0 1\"",
                "rgba=\"1 nan 0 1\"",
                "material 'red', <color>, line 2: rgba=\"1 nan 0 1\": must be four numbers of 0 to 1",
            ),
            ("<material name=\"red\">", "<material>", "material 'without a name', line 2: has no name"),
            (
                limit,
                &format!("{limit}<dynamics damping=\"abc\"/>"),
                "joint 'slide', <dynamics>, line 8: damping=\"abc\": 'abc' is no number",
            ),
            (
                limit,
                &format!("{limit}<safety_controller/>"),
                "joint 'slide', <safety_controller>, line 8: has no k_velocity",
            ),
            (
                "xyz=\"0 0 1\"",
                "xyz=\"${x} 0 0\"",
                "link 'base', <origin>, line 4: xyz=\"${x} 0 0\": a xacro expression",
            ),
            (
                "<inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/>",
                "",
                "link 'base', <inertial>, line 3: has no <inertia>",
            ),
            ("<mass value=\"1\"/>", "<mass/>", "link 'base', <mass>, line 3: has no value"),
            (
                "type=\"prismatic\"",
                "type=\"sliding\"",
                "joint 'slide', line 6: type 'sliding' is none of revolute",
            ),
            ("<parent link=\"base\"/>", "", "joint 'slide', line 6: has no <parent>"),
            (limit, "", "joint 'slide', line 6: has no <limit>"),
            (limit, &format!("{limit}{limit}"), "joint 'slide', line 6: has more than one <limit>"),
            (
                "<box size=\"1 1 1\"/>",
                "<cone/>",
                "link 'drawer', <geometry>, line 5: <cone> is not supported",
            ),
            ("<box size=\"1 1 1\"/>", "", "link 'drawer', <geometry>, line 5: has 0 shapes"),
            ("<link name=\"drawer\">", "<link>", "link 'without a name', line 5: has no name"),
            (
                "rpy=\"0 0 0\"",
                "quat_xyzw=\"0 0 0 1\"",
                "link 'base', <origin>, line 4: quat_xyzw is of URDF 1.1",
            ),
            ("</robot>", "", "is no whole XML"),
            ("<robot name=\"two\">", "<sdf><robot name=\"two\">", ""),
        ] {
            let text = ROBOT.replacen(from, to, 1);
            assert_ne!(text, ROBOT, "{from}");
            let error = parse(&text).unwrap_err();
            assert!(error.contains(wanted), "{wanted}\n{error}");
        }
        assert!(parse("<sdf version='1.6'/>").unwrap_err().contains("<sdf>"));
    }
}
