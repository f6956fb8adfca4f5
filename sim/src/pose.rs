//! Rigid transforms whose type says between which frames they go.
//!
//! `Pose<A, B>` maps coordinates in frame `B` to coordinates in frame `A`; a variable of that type
//! is called `a_from_b`, so that a chain reads by eye and by compiler:
//!
//! ```
//! use grip_sim::pose::{Camera, Object, Pose, World};
//! let world_from_camera: Pose<World, Camera> = Pose::identity();
//! let camera_from_object: Pose<Camera, Object> = Pose::identity();
//! let world_from_object: Pose<World, Object> = world_from_camera * camera_from_object;
//! # let _ = world_from_object;
//! ```
//!
//! Mismatched frames do not compile:
//!
//! ```compile_fail
//! use grip_sim::pose::{Camera, Object, Pose, World};
//! let world_from_camera: Pose<World, Camera> = Pose::identity();
//! let world_from_object: Pose<World, Object> = Pose::identity();
//! let nonsense = world_from_camera * world_from_object;
//! ```
//!
//! Typed poses stand at crate boundaries; inside a module plain [`Isometry3`] is fine.

use std::borrow::Cow;
use std::marker::PhantomData;
use std::ops::Mul;

use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error as _};

/// The world: z up, origin on the floor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct World;
/// The robot's root link (`base_link`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Base;
/// The camera's optical frame: x right, y down, z forward.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Camera;
/// An object's frame as in BOP: the centre of the model's bounding box, axes as in the YCB scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Object;
/// The robot's `gripper_link`: x along the fingers, outwards; y the closing direction; origin between the pads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Gripper;

/// A rigid transform that maps coordinates in frame `B` to frame `A` (metres).
pub struct Pose<A, B> {
    iso: Isometry3<f64>,
    frames: PhantomData<fn() -> (A, B)>,
}

impl<A, B> Clone for Pose<A, B> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<A, B> Copy for Pose<A, B> {}
impl<A, B> PartialEq for Pose<A, B> {
    fn eq(&self, other: &Self) -> bool {
        self.iso == other.iso
    }
}
impl<A, B> std::fmt::Debug for Pose<A, B> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (t, q) = (self.iso.translation.vector, self.iso.rotation);
        write!(
            f,
            "Pose(t [{:.4}, {:.4}, {:.4}] q wxyz [{:.4}, {:.4}, {:.4}, {:.4}])",
            t.x, t.y, t.z, q.w, q.i, q.j, q.k
        )
    }
}

impl<A, B> Pose<A, B> {
    /// Declares that `iso` maps frame `B` to frame `A`.
    pub fn new(iso: Isometry3<f64>) -> Self {
        Self { iso, frames: PhantomData }
    }

    /// The frames coincide.
    pub fn identity() -> Self {
        Self::new(Isometry3::identity())
    }

    /// From a translation in metres and roll, pitch, yaw in radians (fixed axes x, y, z as in URDF).
    pub fn from_xyz_rpy(xyz: [f64; 3], rpy: [f64; 3]) -> Self {
        Self::new(Isometry3::from_parts(
            Translation3::new(xyz[0], xyz[1], xyz[2]),
            UnitQuaternion::from_euler_angles(rpy[0], rpy[1], rpy[2]),
        ))
    }

    /// The untyped transform.
    pub fn iso(&self) -> &Isometry3<f64> {
        &self.iso
    }

    /// `B` from `A`.
    pub fn inverse(&self) -> Pose<B, A> {
        Pose::new(self.iso.inverse())
    }

    /// A point given in `B`, expressed in `A`.
    pub fn transform_point(&self, point_b: &Point3<f64>) -> Point3<f64> {
        self.iso * point_b
    }

    /// A direction given in `B`, expressed in `A`.
    pub fn transform_vector(&self, vector_b: &Vector3<f64>) -> Vector3<f64> {
        self.iso * vector_b
    }

    /// Origin of `B` in `A`, metres.
    pub fn translation(&self) -> Vector3<f64> {
        self.iso.translation.vector
    }

    /// Rotation part.
    pub fn rotation(&self) -> UnitQuaternion<f64> {
        self.iso.rotation
    }

    /// Angle of the rotation between two poses, radians in `[0, pi]`.
    pub fn angle_to(&self, other: &Self) -> f64 {
        self.iso.rotation.angle_to(&other.iso.rotation)
    }

    /// True when no component is NaN or infinite.
    pub fn is_finite(&self) -> bool {
        self.iso.translation.vector.iter().all(|v| v.is_finite())
            && self.iso.rotation.coords.iter().all(|v| v.is_finite())
    }
}

impl<A, B, C> Mul<Pose<B, C>> for Pose<A, B> {
    type Output = Pose<A, C>;
    fn mul(self, rhs: Pose<B, C>) -> Pose<A, C> {
        Pose::new(self.iso * rhs.iso)
    }
}

/// A pose: `from_a` in the name of a field that holds one says whose coordinates go in, and what stands before it whose
/// come out.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct PoseFile {
    /// x, y, z, metres.
    translation: [f64; 3],
    /// w, x, y, z, of unit length.
    quaternion: [f64; 4],
}

impl<A, B> Serialize for Pose<A, B> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let (t, q) = (self.iso.translation.vector, self.iso.rotation);
        PoseFile { translation: [t.x, t.y, t.z], quaternion: [q.w, q.i, q.j, q.k] }.serialize(serializer)
    }
}

impl<A, B> JsonSchema for Pose<A, B> {
    fn schema_name() -> Cow<'static, str> {
        "Pose".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        PoseFile::json_schema(generator)
    }
}

impl<'de, A, B> Deserialize<'de> for Pose<A, B> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let PoseFile { translation: [x, y, z], quaternion: [w, i, j, k] } =
            PoseFile::deserialize(deserializer)?;
        let q = Quaternion::new(w, i, j, k);
        if ![x, y, z].iter().all(|v| v.is_finite()) || (q.norm() - 1.0).abs() > 1e-3 || q.norm().is_nan() {
            return Err(D::Error::custom(format!(
                "not a pose: translation [{x}, {y}, {z}] must be finite and quaternion [{w}, {i}, {j}, {k}] (w, x, y, z) of unit length"
            )));
        }
        Ok(Self::new(Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::from_quaternion(q))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn composes_and_inverts() {
        let a: Pose<World, Base> = Pose::from_xyz_rpy([1.0, 2.0, 3.0], [0.1, 0.2, 0.3]);
        let b: Pose<Base, Camera> = Pose::from_xyz_rpy([-0.3, 0.0, 0.5], [0.0, -0.4, 1.0]);
        let p = Point3::new(0.3, -0.2, 0.9);
        let through = a.transform_point(&b.transform_point(&p));
        let direct = (a * b).transform_point(&p);
        assert!((through - direct).norm() < 1e-12);
        assert!(((a * b).inverse().transform_point(&direct) - p).norm() < 1e-12);
    }

    #[test]
    fn reads_back_what_it_writes_and_refuses_a_long_quaternion() {
        let a: Pose<World, Object> = Pose::from_xyz_rpy([1.0, 2.0, 3.0], [0.1, 0.2, 0.3]);
        let text = serde_json::to_string(&a).unwrap();
        let b: Pose<World, Object> = serde_json::from_str(&text).unwrap();
        assert!((a.translation() - b.translation()).norm() < 1e-12 && a.angle_to(&b) < 1e-7);
        let bad = r#"{"translation":[0,0,0],"quaternion":[2,0,0,0]}"#;
        let error = serde_json::from_str::<Pose<World, Object>>(bad).unwrap_err().to_string();
        assert!(error.contains("unit length"), "{error}");
    }
}
