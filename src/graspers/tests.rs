//! What grasp planners of others say, and what becomes of it.

use std::time::Duration;

use grip_perception::Workspace;
use grip_sim::camera::Intrinsics;
use grip_sim::images::{DepthImage, RgbImage};
use nalgebra::Vector3;

use super::external::Grasping;
use super::protocol::Gripper;
use super::*;
use crate::external::Programs;

/// A grasp planner that is a shell script.
struct Script {
    folder: tempfile::TempDir,
    external: External,
}

impl Script {
    /// It wants what `wants` says, and answers every question with `grasps`, as far as what the shell makes of them.
    fn saying(wants: &str, grasps: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("grasper.sh");
        let told = folder.path().join("told");
        let hello = format!(r#"{{"type":"hello","protocol":1,"name":"test","wants":[{wants}]}}"#);
        let answer = format!(r#"{{\"type\":\"grasps\",\"id\":$id,\"grasps\":[{grasps}]}}"#);
        let text = format!(
            "read hello\necho \"$hello\" >> '{told}'\necho '{hello}'\nwhile read look; do\necho \"$look\" >> '{told}'\n\
             id=${{look#*:}}; id=${{id#*:}}; id=${{id%%,*}}\necho \"{answer}\"\ndone\n",
            told = told.display()
        );
        std::fs::write(&path, text).unwrap();
        let gripper = Gripper {
            approach: [1.0, 0.0, 0.0],
            closing: [0.0, 1.0, 0.0],
            opening: 0.1,
            finger_depth: 0.06,
            pad_length: 0.06,
            pad_width: 0.02,
            finger_thickness: 0.01,
        };
        let command = format!("sh '{}'", path.display()).parse().unwrap();
        let programs = Programs::new(Grasping { gripper }, &command, Duration::from_secs(60), Vec::new());
        let space = Workspace { min: [0.0; 3], max: [1.0; 3] };
        Self { folder, external: External::of(programs, space, 0.65).unwrap() }
    }

    fn asked(&self) -> Result<Vec<ForeignGrasp>> {
        let frame = CameraFrame {
            rgb: RgbImage::new(16, 16),
            depth: DepthImage::filled(16, 16, 1.0),
            intrinsics: Intrinsics { width: 16, height: 16, ..Intrinsics::FETCH },
            world_from_camera: Pose::identity(),
        };
        let pose = Some(Pose::from_xyz_rpy([0.0, 0.0, 0.8], [0.0; 3]));
        let targets = [4, 7].map(|index| Target { index, obj_id: 5, wanted: true, pose });
        let labels = LabelImage::filled(16, 16, 5);
        let wants = self.external.wants().contains(&Want::Segmentation);
        self.external.grasps(&GraspQuestion {
            frame: &frame,
            look: 0,
            targets: &targets,
            segmentation: wants.then_some(&labels),
            seed: 7,
        })
    }

    fn failure(&self) -> String {
        self.asked().unwrap_err().downcast::<GrasperFailed>().unwrap().0
    }

    /// What it was told, line by line.
    fn told(&self) -> Vec<Value> {
        let text = std::fs::read_to_string(self.folder.path().join("told")).unwrap();
        text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    }
}

/// Down along the camera's axis.
const DOWN: &str = r#"\"R\":[0,0,-1,0,1,0,1,0,0],\"t\":[0,0,0.7]"#;

#[test]
fn what_it_says_is_a_grasp_and_it_is_told_what_it_wants_alone() {
    let free = Script::saying("", &format!(r#"{{{DOWN},\"width\":0.05,\"score\":0.4}}"#));
    let [grasp] = &free.asked().unwrap()[..] else { panic!() };
    assert_eq!((grasp.width, grasp.score, grasp.index), (Some(0.05), 0.4, None));
    let approach = grasp.camera_from_gripper.transform_vector(&Vector3::x());
    assert!((approach - Vector3::z()).norm() < 1e-12, "{approach}");
    let [hello, look] = &free.told()[..] else { panic!() };
    assert_eq!((&hello["gripper"]["opening"], &hello["protocol"]), (&json!(0.1), &json!(1)));
    assert_eq!(look["objects"][1], json!({ "index": 7, "obj_id": 5, "wanted": true }));
    assert!(look.get("segmentation").is_none() && look["table"] == 0.65, "{look}");

    let both = Script::saying(r#""poses","segmentation""#, &format!(r#"{{{DOWN},\"index\":7}}"#));
    assert_eq!(both.asked().unwrap()[0].index, Some(7));
    let look = &both.told()[1];
    assert_eq!(look["objects"][0]["pose"]["t"], json!([0.0, 0.0, 0.8]));
    let labels = std::fs::read(look["segmentation"].as_str().unwrap()).unwrap();
    assert_eq!((&labels[labels.len() - 4..], labels.len() % 64), (&[5, 0, 5, 0][..], 2 * 16 * 16 % 64));
}

#[test]
fn grasps_that_mean_nothing_are_refused_by_field_and_value() {
    let said = |grasp: &str| Script::saying("", &format!("{{{DOWN}}},{{{grasp}}}")).failure();
    assert!(said(&format!(r#"{DOWN},\"index\":5"#)).contains("grasps[1]: index 5: give that of one"));
    assert!(said(&format!(r#"{DOWN},\"width\":0"#)).contains("width 0: must be more than 0"));
    assert!(said(r#"\"R\":[1,0,0,0,1,0,0,0,-1],\"t\":[0,0,1]"#).contains("is not a rotation"));
    assert!(said(&format!(r#"{DOWN},\"angle\":5"#)).contains("unknown field `angle`"));
}

#[test]
fn graspers_are_named_like_estimators() {
    let kind = |text: &str| text.parse::<GrasperKind>();
    assert_eq!(kind("grip"), Ok(GrasperKind::Grip));
    assert_eq!(kind("cmd:python3 x/gpd.py").unwrap().name(), "gpd");
    assert_eq!(kind("mine=cmd:python3 gpd.py").unwrap().name(), "mine");
    assert!(kind("truth").is_err() && kind("grip=cmd:x").is_err());
}
