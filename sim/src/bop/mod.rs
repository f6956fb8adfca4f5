//! Data sets in the format of BOP, the benchmark for 6D object pose estimation (<https://bop.felk.cvut.cz>): real ones are
//! read, and our own are written so that its tools and everyone's training code read them.
//!
//! ```text
//! SET/camera.json                    the sensor, for simulation; images have their own intrinsics
//! SET/test_targets_bop19.json        what an evaluation asks for: scene, image, object, number of instances
//! SET/models/obj_NNNNNN.ply          models, with obj_NNNNNN.png where they are textured
//! SET/models/models_info.json        diameter, bounding box and symmetries of each
//! SET/models_eval/                   the same surfaces without looks, for measuring errors
//! SET/coco.json                      all scenes as one COCO set (ours; BOP has one a scene)
//! SET/SPLIT/SSSSSS/scene_camera.json intrinsics, unit of depth and pose of the camera, for each image
//! SET/SPLIT/SSSSSS/scene_gt.json     object and pose of each instance, for each image
//! SET/SPLIT/SSSSSS/scene_gt_info.json  bounding boxes, pixel counts and visibility of the same instances
//! SET/SPLIT/SSSSSS/scene_gt_coco.json  the same as instance masks in COCO's format
//! SET/SPLIT/SSSSSS/rgb/IIIIII.png    colour (.jpg in rendered training sets; gray/ in others)
//! SET/SPLIT/SSSSSS/depth/IIIIII.png  16-bit grey; times depth_scale gives millimetres, 0 is no reading
//! SET/SPLIT/SSSSSS/mask/IIIIII_GGGGGG.png        silhouette of instance G of image I as if it were alone
//! SET/SPLIT/SSSSSS/mask_visib/IIIIII_GGGGGG.png  the part of it that is seen
//! ```
//!
//! Files have millimetres, everything that leaves this module has metres; the conversion happens here and nowhere else.
//! Frames are those of [`pose`](crate::pose): BOP's `R_m2c, t_m2c` is `camera_from_object`, its `R_w2c, t_w2c` the inverse
//! of `world_from_camera`. Image points have pixel centres at integers, as in [`camera`](crate::camera). (The toolkit's
//! own OpenGL renderers place them at a half, so its masks lie half a pixel off what its distance images assume.)
//!
//! | module | what it does |
//! |---|---|
//! | [`format`](mod@format) | the JSON files as they are |
//! | [`read`] | a data set on disk, read as it is asked for |
//! | [`gt_info`](mod@gt_info) | counts and boxes of an instance from its masks |
//! | [`write`](mod@write) | scenes |
//! | [`models`] | object models and `models_info.json` |
//! | [`coco`] | instance masks in COCO's format |
//! | [`results`] | pose estimates as the challenge's CSV files |

pub mod coco;
pub mod format;
pub mod gt_info;
pub mod models;
mod pictures;
pub mod read;
#[cfg(test)]
mod rendered_tests;
pub mod results;
mod staging;
#[cfg(test)]
mod tests;
mod texture;
pub mod write;

pub use coco::write_set as write_coco_set;
pub use format::{
    CameraFile, GtInfo, ModelInfo, ModelsFile, SceneCamera, SceneGt, SceneGtInfo, Symmetries, SymmetryAxis,
    Target, TargetImage, rigid, write_camera, write_targets,
};
pub use gt_info::{VISIBLE_M, estimated_gt_info, gt_info};
pub use models::{export_evaluation_models, export_models};
pub use read::{BopFrame, BopView, Dataset, GroundTruth};
pub use staging::write_atomic;
pub use write::{EncodedFrame, FrameFiles, ObjectInFrame, SceneWriter, encode_frame};
