//! Grasps of an object as a file, `grip.grasps/1`: what `grip grasps` writes and `grip pack --grasps` reads.
//!
//! ```json
//! { "schema": "grip.grasps/1",
//!   "object": "005_tomato_soup_can",
//!   "grasps": [ { "object_from_gripper": { "translation": [0.0, 0.0, 0.06], "quaternion": [1.0, 0.0, 0.0, 0.0] } } ] }
//! ```
//!
//! Metres; quaternions are w, x, y, z. The gripper's frame: origin midway between the pads' centres, x out along the
//! fingers, y along the closing direction. Ours have more fields: what the pads measured ([`GraspCandidate`]). They are for
//! information: a file's grasps are measured again on the object's mesh, and those that do not hold are left out, so files
//! made by other planners need the poses alone.

use std::path::{Path, PathBuf};

use grip_sim::objects::ObjectModel;
use grip_sim::pose::{Gripper, Object, Pose};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::antipodal::GraspCandidate;

/// Version of the format.
const SCHEMA: &str = "grip.grasps/1";

/// A file of grasps.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GraspSet {
    schema: &'static str,
    /// YCB name.
    pub object: String,
    /// Built in, or which scans.
    pub object_set: String,
    /// The robot whose gripper it is.
    pub robot: String,
    /// The grasps.
    pub grasps: Vec<GraspCandidate>,
}

/// A file of grasps that cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{}: {reason}", path.display())]
pub struct GraspSetError {
    /// The file.
    pub path: PathBuf,
    /// Field and value, in words.
    pub reason: String,
}

/// What is read of a file of grasps; other fields are let pass.
#[derive(Deserialize, JsonSchema)]
pub struct GraspFile {
    /// `grip.grasps/1`.
    schema: String,
    /// YCB name.
    object: String,
    /// At least one.
    grasps: Vec<GraspPose>,
}

/// A grasp.
#[derive(Deserialize, JsonSchema)]
pub struct GraspPose {
    /// The gripper's frame: origin between the pads, x out along the fingers, y along the closing direction.
    object_from_gripper: Pose<Object, Gripper>,
}

impl GraspFile {
    /// The `schema` that this program reads.
    pub const SCHEMA: &'static str = SCHEMA;
}

impl GraspSet {
    /// The grasps of `model`.
    pub fn new(model: &ObjectModel, object_set: &str, robot: &str, grasps: &[GraspCandidate]) -> Self {
        Self {
            schema: SCHEMA,
            object: model.info.name.clone(),
            object_set: object_set.into(),
            robot: robot.into(),
            grasps: grasps.to_vec(),
        }
    }

    /// The name of the file of `object` in a folder of sets.
    pub fn file_name(object: &str) -> String {
        format!("{object}.json")
    }
}

/// The poses in the file at `path`, which must be of `object`.
///
/// # Errors
/// When it cannot be read, is of another schema or object, or holds no grasp or one that is no pose.
pub fn read_poses(path: &Path, object: &str) -> Result<Vec<Pose<Object, Gripper>>, GraspSetError> {
    let fail = |reason: String| GraspSetError { path: path.to_path_buf(), reason };
    let text = grip_sim::files::read_to_string(path)
        .map_err(|e| fail(format!("{}; `grip grasps {object} --out DIR` makes one", e.without_file())))?;
    let file: GraspFile = serde_json::from_str(&text).map_err(|e| fail(e.to_string()))?;
    if file.schema != SCHEMA {
        return Err(fail(format!("schema \"{}\": this program reads \"{SCHEMA}\"", file.schema)));
    }
    if file.object != object {
        return Err(fail(format!("object \"{}\": the grasps of \"{object}\" are wanted", file.object)));
    }
    if file.grasps.is_empty() {
        return Err(fail("grasps: there is none".into()));
    }
    let far = |pose: &Pose<Object, Gripper>| pose.translation().norm() > 10.0;
    if let Some(k) = file.grasps.iter().position(|g| far(&g.object_from_gripper)) {
        let norm = file.grasps[k].object_from_gripper.translation().norm();
        return Err(fail(format!(
            "grasps[{k}].object_from_gripper.translation is {norm} m from the object; is it in millimetres?"
        )));
    }
    Ok(file.grasps.into_iter().map(|g| g.object_from_gripper).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{box_model, fetch};
    use crate::{Planner, PlannerSettings};

    fn planner() -> Planner {
        let (model, config) = fetch();
        Planner::new(model, config, PlannerSettings::default())
    }

    #[test]
    fn a_file_gives_back_its_grasps_and_poses_alone_are_enough() {
        let folder = tempfile::tempdir().unwrap();
        let brick = box_model("brick", [0.2, 0.06, 0.06]);
        let made = planner().grasps(&brick);
        assert!(made.candidates.len() > 50);
        let file = folder.path().join(GraspSet::file_name("brick"));
        let set = GraspSet::new(&brick, "built-in", "fetch", &made.candidates);
        std::fs::write(&file, serde_json::to_string(&set).unwrap()).unwrap();
        let again = planner();
        assert_eq!(again.use_grasps(&brick, &file).unwrap(), [made.candidates.len(); 2]);
        for (a, b) in made.candidates.iter().zip(&again.grasps(&brick).candidates) {
            let apart = (a.object_from_gripper.translation() - b.object_from_gripper.translation()).norm();
            assert!(apart < 1e-5 && (a.width - b.width).abs() < 1e-5, "rays are in single precision");
        }

        // By hand: one that holds, off centre by 5 mm, and one beside the object.
        let text = r#"{ "schema": "grip.grasps/1", "object": "brick", "grasps": [
            { "object_from_gripper": { "translation": [0.0, 0.005, 0.02], "quaternion": [0.7071067811865476, 0.0, 0.7071067811865476, 0.0] } },
            { "object_from_gripper": { "translation": [0.3, 0.0, 0.02], "quaternion": [0.7071067811865476, 0.0, 0.7071067811865476, 0.0] } } ] }"#;
        std::fs::write(&file, text).unwrap();
        let by_hand = planner();
        assert_eq!(by_hand.use_grasps(&brick, &file).unwrap(), [1, 2]);
        let grasp = by_hand.grasps(&brick).candidates[0].clone();
        assert!((grasp.width - 0.06).abs() < 1e-6);
        assert!(grasp.object_from_gripper.translation().y.abs() < 1e-6, "centred on the object");
    }

    #[test]
    fn errors_name_file_field_and_value() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("brick.json");
        let grasp = r#"{ "object_from_gripper": { "translation": [0, 0, 0], "quaternion": [1, 0, 0, 0] } }"#;
        let text = |schema: &str, object: &str, grasps: &str| {
            format!(r#"{{ "schema": "{schema}", "object": "{object}", "grasps": [{grasps}] }}"#)
        };
        for (content, words) in [
            (text("grip.grasps/9", "brick", grasp), "schema \"grip.grasps/9\""),
            (text(SCHEMA, "can", grasp), "object \"can\""),
            (text(SCHEMA, "brick", ""), "there is none"),
            (text(SCHEMA, "brick", &grasp.replace("[0, 0, 0]", "[0, 60, 0]")), "millimetres"),
            (text(SCHEMA, "brick", &grasp.replace("[1, 0, 0, 0]", "[2, 0, 0, 0]")), "quaternion"),
            ("{".into(), "line 1"),
        ] {
            std::fs::write(&file, &content).unwrap();
            let error = read_poses(&file, "brick").unwrap_err().to_string();
            assert!(error.contains(words) && error.contains("brick.json"), "{error}");
        }
        let missing = read_poses(&folder.path().join("none.json"), "brick").unwrap_err().to_string();
        assert!(missing.contains("grip grasps brick"), "{missing}");
        // A whole file none of whose grasps holds the object is of no use.
        std::fs::write(&file, text(SCHEMA, "brick", &grasp.replace("[0, 0, 0]", "[1, 0, 0]"))).unwrap();
        let brick = box_model("brick", [0.2, 0.06, 0.06]);
        let error = planner().use_grasps(&brick, &file).unwrap_err().to_string();
        assert!(error.contains("none of 1"), "{error}");
    }
}
