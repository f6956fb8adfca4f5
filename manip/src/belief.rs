//! What the planner believes about the world. Nothing here is true; it is what perception said and what was measured
//! once (table, bin, base).

use std::sync::Arc;

use grip_sim::objects::ObjectModel;
use grip_sim::pose::{Base, Object, Pose, World};
use grip_sim::shape::CollisionShape;
use nalgebra::Point3;

/// A box without a lid.
#[derive(Debug, Clone, PartialEq)]
pub struct BinGeometry {
    /// World from the bin's frame: the centre of its inner floor, z up.
    pub world_from_bin: Pose<World, World>,
    /// Inner extents along the bin's x and y, metres.
    pub inner: [f64; 2],
    /// Height of the walls above the inner floor, metres.
    pub wall_height: f64,
}

/// An object as estimated.
#[derive(Debug, Clone)]
pub struct BelievedObject {
    /// Name of the instance.
    pub name: String,
    /// Its model.
    pub model: Arc<ObjectModel>,
    /// Best pose.
    pub world_from_object: Pose<World, Object>,
    /// Poses that it may have, with weights; none where the best one is all that is known.
    pub poses: Vec<(Pose<World, Object>, f64)>,
    /// Spread of the position, metres (one standard deviation).
    pub position_std_m: f64,
    /// Confidence of the estimate, 0 to 1.
    pub confidence: f64,
    /// It is in the bin already.
    pub packed: bool,
}

/// Everything that a plan depends on besides the robot.
#[derive(Debug, Clone)]
pub struct BeliefScene {
    /// Convex solids that do not move, in the world: table, stand, bin walls and floor.
    pub fixtures: Vec<CollisionShape>,
    /// Height of the table's surface in the world, metres.
    pub table_height: f64,
    /// The bin to pack into.
    pub bin: BinGeometry,
    /// The objects, packed or not.
    pub objects: Vec<BelievedObject>,
    /// What was seen and is nothing of the above: points of the world on a grid of a centimetre, metres ([`crate::seen`]).
    pub seen: Vec<Point3<f64>>,
    /// Where the robot stands.
    pub world_from_base: Pose<World, Base>,
}

impl BeliefScene {
    /// What makes this belief unusable, if anything: a number that is not finite or an extent that is not positive.
    pub fn problem(&self) -> Option<String> {
        let bin = &self.bin;
        if !self.world_from_base.is_finite() {
            return Some("world_from_base is not finite".into());
        }
        if !(bin.world_from_bin.is_finite() && bin.inner.iter().all(|v| *v > 0.0 && v.is_finite())) {
            return Some(format!("the bin's pose or inner size {:?} is not usable", bin.inner));
        }
        if !(self.table_height.is_finite() && bin.wall_height.is_finite()) {
            return Some("table_height or wall_height is not finite".into());
        }
        if self.fixtures.iter().any(|f| {
            !f.pose.translation.vector.iter().all(|v| v.is_finite())
                || !f.pose.rotation.coords.iter().all(|v| v.is_finite())
        }) {
            return Some("a fixture's pose is not finite".into());
        }
        if self.seen.iter().any(|p| !p.coords.iter().all(|v| v.is_finite())) {
            return Some("a point of what was seen is not finite".into());
        }
        self.objects
            .iter()
            .find(|o| {
                let poses = o.poses.iter().all(|(pose, weight)| pose.is_finite() && weight.is_finite());
                !o.world_from_object.is_finite() || !o.position_std_m.is_finite() || !poses
            })
            .map(|o| format!("{}: its pose or spread is not finite", o.name))
    }
}

/// Fixtures of a bin: floor and four walls of `thickness` metres, outside the inner space.
pub fn bin_fixtures(bin: &BinGeometry, thickness: f64) -> Vec<CollisionShape> {
    use grip_sim::shape::Convex;
    use nalgebra::{Translation3, Vector3};
    let [x, y] = bin.inner.map(|v| 0.5 * v);
    let (h, t) = (0.5 * bin.wall_height, 0.5 * thickness);
    let part = |center: [f64; 3], half: [f64; 3]| CollisionShape {
        pose: bin.world_from_bin.iso() * Translation3::new(center[0], center[1], center[2]),
        geometry: Convex::Cuboid { half: Vector3::from(half) },
    };
    vec![
        part([0.0, 0.0, -t], [x + thickness, y + thickness, t]),
        part([x + t, 0.0, h], [t, y + thickness, h]),
        part([-x - t, 0.0, h], [t, y + thickness, h]),
        part([0.0, y + t, h], [x, t, h]),
        part([0.0, -y - t, h], [x, t, h]),
    ]
}
