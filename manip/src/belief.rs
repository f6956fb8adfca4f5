//! What the planner believes about the world. Nothing here is true; it is what perception said and what was measured
//! once (table, bin, base).

use std::sync::Arc;

use grip_sim::objects::ObjectModel;
use grip_sim::pose::{Base, Object, Pose, World};
use grip_sim::shape::{CollisionShape, Convex};
use nalgebra::{Point3, Vector3};

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

impl BinGeometry {
    /// A bin whose inner floor has its centre at `world_from_bin` (z up), `inner` metres along its x and y, with walls
    /// `wall_height` metres above that floor.
    pub fn new(world_from_bin: Pose<World, World>, inner: [f64; 2], wall_height: f64) -> Self {
        Self { world_from_bin, inner, wall_height }
    }

    /// Whether a point of the world, seen from above, is over the bin's inside or nearer than this to it, metres.
    pub fn is_near(&self, point: &Point3<f64>, metres: f64) -> bool {
        let inside = self.world_from_bin.iso().inverse_transform_point(point);
        (0..2).all(|axis| inside[axis].abs() < 0.5 * self.inner[axis] + metres)
    }
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
    /// Spread of the position, metres (one standard deviation).
    pub position_std_m: f64,
    /// Confidence of the estimate, 0 to 1.
    pub confidence: f64,
    /// It is in the bin already.
    pub packed: bool,
}

impl BelievedObject {
    /// An object of which one pose is known, exactly and for sure; it waits to be packed, and is named after its model.
    pub fn new(model: Arc<ObjectModel>, world_from_object: Pose<World, Object>) -> Self {
        Self {
            name: model.info.name.clone(),
            model,
            world_from_object,
            position_std_m: 0.0,
            confidence: 1.0,
            packed: false,
        }
    }

    /// What makes it unusable, if anything.
    fn problem(&self) -> Option<String> {
        let name = &self.name;
        if !self.world_from_object.is_finite() {
            return Some(format!("{name}: world_from_object is not finite"));
        }
        if !(self.position_std_m >= 0.0 && self.position_std_m.is_finite()) {
            return Some(format!(
                "{name}: position_std_m is {}, which is no spread in metres; leave out what was not located",
                self.position_std_m
            ));
        }
        // A sum of weights may miss 1 by a rounding.
        if !(-1e-9..=1.0 + 1e-9).contains(&self.confidence) {
            return Some(format!("{name}: confidence is {}, not within 0 to 1", self.confidence));
        }
        None
    }
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
    /// Obstacles that are none of the above: points of the world on a grid of a centimetre, metres
    /// ([`crate::collision::unmodelled_obstacles`]).
    pub unmodelled: Vec<Point3<f64>>,
    /// Where the robot stands.
    pub world_from_base: Pose<World, Base>,
}

impl BeliefScene {
    /// A scene without objects: the robot at `world_from_base`, a table whose surface is `table_height` metres high, `bin`, and
    /// what does not move. `fixtures` are to hold the solids of table and bin ([`bin_fixtures`]) too: they are what the robot
    /// keeps clear of.
    pub fn new(
        fixtures: Vec<CollisionShape>,
        table_height: f64,
        bin: BinGeometry,
        world_from_base: Pose<World, Base>,
    ) -> Self {
        Self { fixtures, table_height, bin, objects: Vec::new(), unmodelled: Vec::new(), world_from_base }
    }

    /// Solids alone, in the robot's base frame, for motions that place nothing: the bin is of no account.
    pub fn without_bin(fixtures: Vec<CollisionShape>) -> Self {
        let bin = BinGeometry { world_from_bin: Pose::identity(), inner: [1.0, 1.0], wall_height: 0.0 };
        Self::new(fixtures, 0.0, bin, Pose::identity())
    }

    /// Height of what something with its centre at `center` may stand on: of the highest level box below it, else the table.
    pub fn ground(&self, center: &Point3<f64>) -> f64 {
        /// The table's own top is one of the fixtures, too.
        const HIGHER: f64 = 1e-3;
        let tops = self.fixtures.iter().filter_map(|fixture| level_top(fixture, center));
        tops.filter(|top| *top > self.table_height + HIGHER && *top < center.z)
            .fold(self.table_height, f64::max)
    }

    /// Whether something with its centre at `center` would come down on the table or on another level box.
    pub fn is_over_table(&self, center: &Point3<f64>) -> bool {
        self.fixtures.iter().any(|fixture| level_top(fixture, center).is_some())
    }

    /// Whether a level box, such as the board of a shelf, is above something with its centre at `center`, however high.
    pub fn is_under_board(&self, center: &Point3<f64>) -> bool {
        self.fixtures.iter().any(|fixture| level_top(fixture, center).is_some_and(|top| top > center.z))
    }

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
        if self.unmodelled.iter().any(|p| !p.coords.iter().all(|v| v.is_finite())) {
            return Some("a point of the unmodelled obstacles is not finite".into());
        }
        self.objects.iter().find_map(BelievedObject::problem)
    }
}

/// Height of a box's upper face when that is level and `point` over it or under it.
fn level_top(fixture: &CollisionShape, point: &Point3<f64>) -> Option<f64> {
    let Convex::Cuboid { half } = &fixture.geometry else { return None };
    let up = fixture.pose.inverse_transform_vector(&Vector3::z());
    let axis = up.iamax();
    let local = fixture.pose.inverse_transform_point(point);
    let over = (0..3).all(|other| other == axis || local[other].abs() <= half[other]);
    (up[axis].abs() > 1.0 - 1e-6 && over).then(|| fixture.pose.translation.z + half[axis])
}

/// Fixtures of a bin: floor and four walls of `thickness` metres, outside the inner space.
pub fn bin_fixtures(bin: &BinGeometry, thickness: f64) -> Vec<CollisionShape> {
    use nalgebra::Translation3;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{box_model, empty_scene};

    #[test]
    fn the_ground_is_the_table_or_the_highest_level_box_below() {
        let mut scene = empty_scene();
        let step = |z: f64, roll: f64| CollisionShape {
            pose: nalgebra::Isometry3::new(Vector3::new(0.6, 0.2, z), Vector3::x() * roll),
            geometry: Convex::Cuboid { half: Vector3::new(0.1, 0.1, 0.04) },
        };
        scene.fixtures.push(step(scene.table_height + 0.04, std::f64::consts::PI));
        let ground = |scene: &BeliefScene, y: f64, z: f64| {
            scene.ground(&Point3::new(0.6, y, scene.table_height + z)) - scene.table_height
        };
        assert!((ground(&scene, 0.25, 0.1) - 0.08).abs() < 1e-9);
        assert_eq!(ground(&scene, 0.35, 0.1), 0.0, "beside it");
        assert_eq!(ground(&scene, 0.25, 0.07), 0.0, "below its top");
        // A shelf above the step; a slope is no ground.
        let at = Point3::new(0.6, 0.25, scene.table_height + 0.15);
        assert!(!scene.is_under_board(&at));
        scene.fixtures.push(step(scene.table_height + 0.3, 0.0));
        assert!(scene.is_under_board(&at) && !scene.is_under_board(&Point3::new(0.6, 0.35, at.z)));
        scene.fixtures.push(step(scene.table_height + 0.5, 0.3));
        assert!(
            (ground(&scene, 0.25, 0.4) - 0.34).abs() < 1e-9
                && (ground(&scene, 0.25, 0.2) - 0.08).abs() < 1e-9
        );
        assert!((ground(&scene, 0.25, 0.7) - 0.34).abs() < 1e-9);
    }

    #[test]
    fn what_is_not_a_belief_is_refused_by_name_and_value() {
        let mut scene = empty_scene();
        let at = Pose::from_xyz_rpy([0.6, 0.0, 0.7], [0.0; 3]);
        scene.objects = vec![BelievedObject::new(box_model("brick", [0.05; 3]), at)];
        assert_eq!(scene.problem(), None);
        let problem = |change: &dyn Fn(&mut BelievedObject)| {
            let mut scene = scene.clone();
            change(&mut scene.objects[0]);
            scene.problem().unwrap()
        };
        // An estimate without a spread is no belief: nobody knows where the object is.
        let said = problem(&|o| o.position_std_m = f64::INFINITY);
        assert!(said.contains("brick") && said.contains("position_std_m is inf"), "{said}");
        let said = problem(&|o| o.position_std_m = -0.1);
        assert!(said.contains("position_std_m is -0.1"), "{said}");
        let said = problem(&|o| o.confidence = f64::NAN);
        assert!(said.contains("confidence is NaN"), "{said}");
        let said = problem(&|o| o.world_from_object = Pose::from_xyz_rpy([f64::NAN, 0.0, 0.7], [0.0; 3]));
        assert!(said.contains("world_from_object"), "{said}");
    }
}
