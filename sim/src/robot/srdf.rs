//! Pairs of links that an SRDF takes out of collision checks: MoveIt's semantic description of a robot.

use std::path::Path;

use roxmltree::Document;

use super::RobotModel;
use crate::files;

/// The pairs of `disable_collisions`, as indices of links, lower first. `name` is relative to `folder`, or `package://`.
///
/// # Errors
/// When the file cannot be read or is no SRDF of this robot: file, element and link.
pub(super) fn disabled_pairs(
    name: &str,
    robot: &RobotModel,
    folder: &Path,
) -> Result<Vec<(usize, usize)>, String> {
    let path = robot.locate(name, folder)?;
    let text = files::read_to_string(&path).map_err(|error| error.to_string())?;
    parse(&text, robot).map_err(|message| format!("{}: {message}", path.display()))
}

fn parse(text: &str, robot: &RobotModel) -> Result<Vec<(usize, usize)>, String> {
    let document = Document::parse(text).map_err(|error| format!("is no whole XML: {error}"))?;
    let root = document.root_element();
    if root.tag_name().name() != "robot" {
        return Err(format!("is no SRDF: its root element is <{}>, not <robot>", root.tag_name().name()));
    }
    let elements = root.children().filter(|node| node.has_tag_name("disable_collisions"));
    elements
        .map(|node| {
            let line = document.text_pos_at(node.range().start).row;
            let link = |attribute: &str| {
                let name = node
                    .attribute(attribute)
                    .ok_or_else(|| format!("line {line}: disable_collisions has no {attribute}"))?;
                robot.link_index(name).map_err(|error| format!("line {line}: {error}"))
            };
            let (a, b) = (link("link1")?, link("link2")?);
            Ok((a.min(b), a.max(b)))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const URDF: &str = "<robot name=\"r\"><link name=\"a\"/><link name=\"b\"/><link name=\"c\"/>\
        <joint name=\"x\" type=\"fixed\"><parent link=\"a\"/><child link=\"b\"/></joint>\
        <joint name=\"y\" type=\"fixed\"><parent link=\"b\"/><child link=\"c\"/></joint></robot>";

    #[test]
    fn pairs_are_read_and_what_is_no_pair_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let urdf = folder.path().join("r.urdf");
        std::fs::write(&urdf, URDF).unwrap();
        let robot = RobotModel::load(&urdf, &[]).unwrap();
        let srdf = "<robot name=\"r\">\n<group name=\"arm\"><chain base_link=\"a\" tip_link=\"c\"/></group>\n\
                    <disable_collisions link1=\"c\" link2=\"a\" reason=\"Never\"/>\n</robot>";
        let path = folder.path().join("r.srdf");
        std::fs::write(&path, srdf).unwrap();
        assert_eq!(disabled_pairs("r.srdf", &robot, folder.path()), Ok(vec![(0, 2)]));
        let error = parse(&srdf.replace("link2=\"a\"", "link2=\"d\""), &robot).unwrap_err();
        assert!(error.contains("line 3") && error.contains("no link 'd'; links: a, b, c"), "{error}");
        let error = parse(&srdf.replace(" link2=\"a\"", ""), &robot).unwrap_err();
        assert!(error.contains("line 3: disable_collisions has no link2"), "{error}");
        assert!(parse("<sdf/>", &robot).unwrap_err().contains("<sdf>"));
        assert!(disabled_pairs("none.srdf", &robot, folder.path()).unwrap_err().contains("none.srdf"));
    }
}
