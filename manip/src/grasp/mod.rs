//! Grasps of an object, and their ranking in a scene.

mod antipodal;
mod contact;
mod given;
mod grasp_set;
mod grip_force;
mod object_grasps;
mod oriented;
mod rank;
mod settings;

pub use antipodal::{GraspCandidate, antipodal_grasps, friction_cone, grasp_at, narrow_opening};
pub use contact::{PadContact, RayGrid, pad_contact};
pub use given::GivenGrasp;
pub(crate) use given::{BelievedSurface, free_given, gripped};
pub use grasp_set::{GraspFile, GraspPose, GraspSet, GraspSetError, read_poses};
pub use grip_force::{GripForceSettings, grip_force};
pub use object_grasps::{GraspCache, ObjectGrasps};
pub use oriented::HandFrom;
pub use rank::{Grasp, GraspCounters, hand_may_touch, rank_grasps};
pub use settings::{AntipodalSettings, GraspSettings, GraspWeights};
