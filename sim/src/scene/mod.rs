//! Scene files: a table, a bin, a robot and what lies on the table, in TOML that a person can read and edit.
//!
//! All positions are in the world frame: z up, origin on the floor, the robot's base usually at the origin looking
//! along +x. Reading validates every number, so that a [`Scene`] which exists can be built.

use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use rand::seq::index;
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

use crate::camera::Intrinsics;
use crate::error::{Error, Result};
use crate::pose::{Base, Camera, Object, Pose, World};
use crate::range::Range;
use crate::render::Surroundings;
use crate::rng;

mod bin;
mod fixture;

pub use bin::{Bin, BinKind};
use fixture::block;
pub use fixture::{Fixture, FixtureKind};

/// The version this program reads and writes.
pub const SCHEMA: &str = "grip.scene/1";

/// A scene as written in its file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Always [`SCHEMA`].
    pub schema: String,
    /// Short name, used in outputs.
    pub name: String,
    /// How table, bin and room look: `laboratory`, the default, or `varied`, which differs with every seed. Looks only:
    /// all solids stay.
    #[serde(default)]
    pub surroundings: Surroundings,
    /// Where the robot stands and how it starts.
    pub robot: RobotPlacement,
    /// The head camera.
    pub camera: CameraSetup,
    /// The table.
    pub table: Table,
    /// The bin that is packed.
    pub bin: Bin,
    /// What lies on the table.
    pub objects: ObjectPlacement,
}

/// Where the robot stands and how it starts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotPlacement {
    /// URDF file, relative to the scene file.
    pub urdf: PathBuf,
    /// Robot settings (groups, poses, limits), relative to the scene file.
    pub config: PathBuf,
    /// Base position on the floor, metres.
    pub base: [f64; 2],
    /// Base heading, radians.
    #[serde(default)]
    pub yaw: f64,
    /// Named pose of the arm at the start and while looking.
    pub start_pose: String,
    /// Torso height above its lower stop at the start and while looking, metres.
    pub torso: f64,
    /// The point that the head camera looks at, metres.
    pub look_at: [f64; 3],
}

/// The head camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraSetup {
    /// A preset: `fetch` or `grip-paper`.
    pub intrinsics: IntrinsicsPreset,
    /// Depth noise preset, such as `carmine-109` or `none`.
    pub depth_noise: String,
    /// Where a camera on a sphere stands, for training data.
    #[serde(default)]
    pub sphere: Sphere,
}

/// A camera that looks from anywhere around at the middle of the objects' region.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Sphere {
    /// From that point, metres.
    pub distance: Range,
    /// Above the horizon, radians.
    pub elevation: Range,
    /// About the vertical from the world's -x axis, radians: 0 stands where the robot stands.
    pub azimuth: Range,
    /// How far off that point it looks, along each axis, metres.
    pub aim: Range,
}

impl Default for Sphere {
    fn default() -> Self {
        use std::f64::consts::PI;
        Self {
            distance: Range { min: 0.5, max: 1.1 },
            elevation: Range { min: 0.45, max: 1.35 },
            azimuth: Range { min: -PI, max: PI },
            aim: Range { min: -0.06, max: 0.06 },
        }
    }
}

impl Sphere {
    fn problem(&self) -> Option<String> {
        let limits = [
            ("distance", self.distance, 0.1, 10.0),
            // From straight above the picture's up is not defined.
            ("elevation", self.elevation, -1.5, 1.5),
            ("azimuth", self.azimuth, -7.0, 7.0),
            ("aim", self.aim, -5.0, 5.0),
        ];
        limits.into_iter().find_map(|(field, range, low, high)| {
            let problem = range.problem().or_else(|| {
                (range.min < low || range.max > high).then(|| {
                    format!("{{ min = {}, max = {} }}: must be from {low} to {high}", range.min, range.max)
                })
            })?;
            Some(format!("camera.sphere.{field} = {problem}"))
        })
    }

    /// World from camera, looking at `center`, upright.
    pub fn draw(&self, center: &Point3<f64>, random: &mut impl Rng) -> Pose<World, Camera> {
        let [distance, elevation, azimuth] =
            [self.distance, self.elevation, self.azimuth].map(|range| range.draw(random));
        let target = center + Vector3::from([0, 1, 2].map(|_: usize| self.aim.draw(random)));
        let away =
            Vector3::new(-elevation.cos() * azimuth.cos(), -elevation.cos() * azimuth.sin(), elevation.sin());
        // The optical frame: z towards the target, y down.
        let rotation = UnitQuaternion::face_towards(&-away, &-Vector3::z());
        Pose::new(Isometry3::from_parts((target + away * distance).coords.into(), rotation))
    }
}

/// Named intrinsics.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum IntrinsicsPreset {
    /// [`Intrinsics::FETCH`].
    Fetch,
    /// [`Intrinsics::GRIP_PAPER`].
    GripPaper,
}

impl IntrinsicsPreset {
    /// The numbers.
    pub fn intrinsics(self) -> Intrinsics {
        match self {
            Self::Fetch => Intrinsics::FETCH,
            Self::GripPaper => Intrinsics::GRIP_PAPER,
        }
    }
}

/// A rectangular table, sides along the world axes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Table {
    /// Centre of the top, metres.
    pub center: [f64; 2],
    /// Extents along x and y, metres.
    pub size: [f64; 2],
    /// Height of the top above the floor, metres.
    pub height: f64,
    /// Thickness of the top, metres.
    #[serde(default = "default_thickness")]
    pub thickness: f64,
    /// Coulomb friction.
    #[serde(default = "default_friction")]
    pub friction: f64,
}

fn default_thickness() -> f64 {
    0.04
}

fn default_friction() -> f64 {
    0.6
}

/// What lies on the table and how it got there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObjectPlacement {
    /// Objects by YCB name; each at most once.
    pub names: Vec<String>,
    /// How many of them a run draws from its seed; all of them, in this order, unless given.
    #[serde(default)]
    pub count: Option<Count>,
    /// Centre of the region on the table where objects are dropped, metres.
    pub center: [f64; 2],
    /// Extents of that region along x and y, metres.
    pub size: [f64; 2],
    /// Free space between the outlines of objects that are spread out, metres.
    pub gap: f64,
    /// Share of the objects that may lie that are dropped lying on a side, 0 to 1.
    #[serde(default)]
    pub lying_fraction: f64,
    /// Objects at fixed places, by name; they are not dropped at random. They settle as well.
    #[serde(default)]
    pub placed: Vec<PlacedObject>,
}

/// A number of objects, drawn evenly from `min` to `max`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Count {
    /// At least so many.
    pub min: usize,
    /// At most so many.
    pub max: usize,
}

impl ObjectPlacement {
    /// The positions in `names` of the objects of a run with `seed`, in the order in which they are put down.
    pub fn draw(&self, seed: u64) -> Vec<usize> {
        let all = self.names.len();
        let Some(Count { min, max }) = self.count else { return (0..all).collect() };
        let mut random = rng::stream(seed, "objects");
        let count = random.random_range(min..=max);
        index::sample(&mut random, all, count).into_vec()
    }
}

/// An object at a place of its own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlacedObject {
    /// YCB name; must be among the scene's names.
    pub name: String,
    /// World from object.
    pub pose: Pose<World, Object>,
}

impl Scene {
    /// Reads and validates a scene file.
    ///
    /// # Errors
    /// [`Error::Io`] when it cannot be read; [`Error::Invalid`] naming field, value and what to try.
    pub fn load(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(|e| Error::io(path, e))?;
        let scene: Self =
            toml::from_str(&text).map_err(|e| Error::invalid(path, e.to_string().trim_end()))?;
        scene.validate().map_err(|message| Error::invalid(path, message))?;
        Ok(scene)
    }

    /// What is wrong with the numbers, if anything: field, value and what to try.
    fn validate(&self) -> std::result::Result<(), String> {
        if self.schema != SCHEMA {
            return Err(format!("schema = \"{}\": this program reads \"{SCHEMA}\"", self.schema));
        }
        let Self { robot, table, bin, objects, .. } = self;
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        if self.name.is_empty() || !self.name.chars().all(plain) {
            return Err(format!(
                "name = \"{}\": must be of letters, digits, '-' and '_' (it names folders)",
                self.name
            ));
        }
        each("robot.base", &robot.base, -10.0, 10.0)?;
        each("robot.yaw", &[robot.yaw], -7.0, 7.0)?;
        each("robot.torso", &[robot.torso], 0.0, 1.0)?;
        each("robot.look_at", &robot.look_at, -10.0, 10.0)?;
        if let Some(problem) = self.camera.sphere.problem() {
            return Err(problem);
        }
        each("table.center", &table.center, -10.0, 10.0)?;
        each("table.size", &table.size, 0.1, 5.0)?;
        each("table.height", &[table.height], 0.05, 2.0)?;
        each("table.thickness", &[table.thickness], 0.005, table.height)?;
        each("table.friction", &[table.friction], 0.0, 2.0)?;
        each("bin.center", &bin.center, -10.0, 10.0)?;
        each("bin.base_height", &[bin.base_height], 0.0, 2.0)?;
        each("bin.yaw", &[bin.yaw], -7.0, 7.0)?;
        each("bin.inner", &bin.inner, 0.05, 2.0)?;
        each("bin.wall_height", &[bin.wall_height], 0.01, 1.0)?;
        each("bin.wall_thickness", &[bin.wall_thickness], 0.002, 0.1)?;
        each("bin.friction", &[bin.friction], 0.0, 2.0)?;
        each("objects.center", &objects.center, -10.0, 10.0)?;
        each("objects.size", &objects.size, 0.02, 5.0)?;
        each("objects.gap", &[objects.gap], 0.0, 0.5)?;
        each("objects.lying_fraction", &[objects.lying_fraction], 0.0, 1.0)?;
        if objects.names.is_empty() {
            return Err("objects.names = []: name at least one object (see `grip objects`)".into());
        }
        if let Some(Count { min, max }) = objects.count
            && !(1 <= min && min <= max && max <= objects.names.len())
        {
            return Err(format!(
                "objects.count = {{ min = {min}, max = {max} }}: must be 1 <= min <= max <= {}, the number of names",
                objects.names.len()
            ));
        }
        for (i, name) in objects.names.iter().enumerate() {
            if objects.names[..i].contains(name) {
                return Err(format!("objects.names: '{name}' stands twice; each object may stand once"));
            }
        }
        for axis in 0..2 {
            let (low, high) = (
                objects.center[axis] - objects.size[axis] / 2.0,
                objects.center[axis] + objects.size[axis] / 2.0,
            );
            if low < table.low()[axis] || high > table.high()[axis] {
                return Err(format!(
                    "objects.center {:?} with objects.size {:?} reaches over the table's edge ({:?} to {:?}); move or shrink it",
                    objects.center,
                    objects.size,
                    table.low(),
                    table.high()
                ));
            }
        }
        for (i, placed) in objects.placed.iter().enumerate() {
            if objects.placed[..i].iter().any(|earlier| earlier.name == placed.name) {
                return Err(format!(
                    "objects.placed: '{}' stands twice; place each object once",
                    placed.name
                ));
            }
            let field = format!("objects.placed '{}'", placed.name);
            if !objects.names.contains(&placed.name) {
                return Err(format!("{field}: not in objects.names; add it there"));
            }
            let p = placed.pose.translation();
            if !table.holds(p.x, p.y) {
                return Err(format!(
                    "{field}: position [{}, {}, {}] is off the table (x {} to {}, y {} to {}); move it over the table",
                    p.x,
                    p.y,
                    p.z,
                    table.low()[0],
                    table.high()[0],
                    table.low()[1],
                    table.high()[1]
                ));
            }
            if !(p.z > table.height && p.z < table.height + 1.0) {
                return Err(format!(
                    "{field}: z = {} must be above the table's top ({}) and at most 1 m over it",
                    p.z, table.height
                ));
            }
        }
        Ok(())
    }

    /// World from the robot's base.
    pub fn world_from_base(&self) -> Pose<World, Base> {
        let [x, y] = self.robot.base;
        Pose::from_xyz_rpy([x, y, 0.0], [0.0, 0.0, self.robot.yaw])
    }

    /// The fixed solids of the scene: table top and legs as one block each, bin floor and walls. World frame.
    ///
    /// This is the map that the robot is given of its cell; it holds no object.
    pub fn fixtures(&self) -> Vec<Fixture> {
        let mut fixtures = self.table.solids();
        fixtures.extend(self.bin.solids(self.table.height));
        fixtures
    }
}

/// Every one of `values` must be finite and within `low..=high`.
fn each(field: &str, values: &[f64], low: f64, high: f64) -> std::result::Result<(), String> {
    match values.iter().find(|v| !(v.is_finite() && (low..=high).contains(*v))) {
        Some(value) => Err(format!("{field} = {value}: must be a finite number from {low} to {high}")),
        None => Ok(()),
    }
}

impl Table {
    /// Lower corner of the top, metres.
    pub fn low(&self) -> [f64; 2] {
        [self.center[0] - self.size[0] / 2.0, self.center[1] - self.size[1] / 2.0]
    }

    /// Upper corner of the top, metres.
    pub fn high(&self) -> [f64; 2] {
        [self.center[0] + self.size[0] / 2.0, self.center[1] + self.size[1] / 2.0]
    }

    /// Whether (x, y) is over the table's top.
    pub fn holds(&self, x: f64, y: f64) -> bool {
        let ([x0, y0], [x1, y1]) = (self.low(), self.high());
        (x0..=x1).contains(&x) && (y0..=y1).contains(&y)
    }

    fn solids(&self) -> Vec<Fixture> {
        const LEG: f64 = 0.03;
        let [x, y] = self.center;
        let top = block(
            FixtureKind::TableTop,
            Isometry3::translation(x, y, self.height - self.thickness / 2.0),
            [self.size[0] / 2.0, self.size[1] / 2.0, self.thickness / 2.0],
            self.friction,
        );
        let leg_half = (self.height - self.thickness) / 2.0;
        let mut solids = vec![top];
        for (sx, sy) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
            let at = Isometry3::translation(
                x + sx * (self.size[0] / 2.0 - 2.0 * LEG),
                y + sy * (self.size[1] / 2.0 - 2.0 * LEG),
                leg_half,
            );
            solids.push(block(FixtureKind::TableLeg, at, [LEG, LEG, leg_half], self.friction));
        }
        solids
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(edit: impl Fn(String) -> String) -> String {
        edit(
            r#"
schema = "grip.scene/1"
name = "test"
[robot]
urdf = "r.urdf"
config = "r.toml"
base = [0.0, 0.0]
start_pose = "ready"
torso = 0.3
look_at = [0.8, 0.0, 0.6]
[camera]
intrinsics = "fetch"
depth_noise = "none"
[table]
center = [0.8, 0.0]
size = [0.8, 1.2]
height = 0.6
[bin]
center = [0.7, 0.45]
base_height = 0.6
inner = [0.3, 0.4]
wall_height = 0.12
wall_thickness = 0.01
[objects]
names = ["005_tomato_soup_can"]
center = [0.7, 0.0]
size = [0.3, 0.4]
gap = 0.03
"#
            .to_string(),
        )
    }

    fn message(edit: impl Fn(String) -> String) -> String {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.toml");
        std::fs::write(&path, text(edit)).unwrap();
        Scene::load(&path).map(|_| String::from("accepted")).unwrap_or_else(|e| e.to_string())
    }

    #[test]
    fn a_good_scene_is_read() {
        assert_eq!(message(|t| t), "accepted");
        let scene: Scene = toml::from_str(&text(|t| t)).unwrap();
        assert_eq!(scene.surroundings, Surroundings::Laboratory);
        let varied = text(|t| t.replace("name = \"test\"", "name = \"test\"\nsurroundings = \"varied\""));
        assert_eq!(toml::from_str::<Scene>(&varied).unwrap().surroundings, Surroundings::Varied);
        let odd = message(|t| t.replace("name = \"test\"", "name = \"test\"\nsurroundings = \"kitchen\""));
        assert!(odd.contains("kitchen") && odd.contains("varied"), "{odd}");
    }

    #[test]
    fn bad_numbers_are_named_with_field_and_value() {
        let nan = message(|t| t.replace("height = 0.6\n", "height = nan\n"));
        assert!(nan.contains("scene.toml") && nan.contains("table.height = NaN"), "{nan}");
        let huge = message(|t| t.replace("torso = 0.3", "torso = 1e300"));
        assert!(huge.contains("robot.torso") && huge.contains("from 0 to 1"), "{huge}");
        let unknown = message(|t| t.replace("gap = 0.03", "gap = 0.03\nfriktion = 1"));
        assert!(unknown.contains("friktion"), "{unknown}");
        let over = message(|t| t.replace("center = [0.7, 0.0]", "center = [1.1, 0.0]"));
        assert!(over.contains("over the table's edge"), "{over}");
    }

    #[test]
    fn a_camera_on_the_sphere_looks_at_the_objects() {
        let center = Point3::new(0.6, 0.1, 0.7);
        let sphere = Sphere { aim: Range::exactly(0.0), ..Sphere::default() };
        for seed in 0..50 {
            let camera = sphere.draw(&center, &mut rng::stream(seed, "camera"));
            let seen = camera.inverse().transform_point(&center);
            assert!(seen.x.abs() < 1e-9 && seen.y.abs() < 1e-9 && (0.5..=1.1).contains(&seen.z), "{seen}");
            // Upright: what is higher in the world is higher in the picture, and the x axis is level.
            assert!(camera.inverse().transform_vector(&Vector3::z()).y < 0.0);
            assert!(camera.transform_vector(&Vector3::x()).z.abs() < 1e-9);
            assert!(camera.translation().z > 0.7);
        }
        let at_robot = Sphere { azimuth: Range::exactly(0.0), ..sphere };
        assert!(at_robot.draw(&center, &mut rng::stream(1, "camera")).translation().x < 0.6);
    }

    #[test]
    fn a_count_draws_that_many_different_objects() {
        let ten = (0..10).map(|i| format!("\"{i}\"")).collect::<Vec<_>>().join(", ");
        let with = |count: &str| {
            let scene = text(|t| {
                t.replace("names = [\"005_tomato_soup_can\"]", &format!("names = [{ten}]\n{count}"))
            });
            toml::from_str::<Scene>(&scene).unwrap()
        };
        assert_eq!(with("").objects.draw(3), (0..10).collect::<Vec<_>>());
        let scene = with("count = { min = 5, max = 7 }");
        let mut sizes = std::collections::BTreeSet::new();
        for seed in 0..60 {
            let mut drawn = scene.objects.draw(seed);
            assert_eq!(drawn, scene.objects.draw(seed));
            sizes.insert(drawn.len());
            drawn.sort_unstable();
            drawn.dedup();
            assert!(sizes.contains(&drawn.len()) && drawn.iter().all(|&i| i < 10));
        }
        assert_eq!(sizes.into_iter().collect::<Vec<_>>(), [5, 6, 7]);
        let error = message(|t| t.replace("gap = 0.03", "gap = 0.03\ncount = { min = 2, max = 3 }"));
        assert!(error.contains("objects.count = { min = 2, max = 3 }"), "{error}");
    }

    #[test]
    fn an_object_off_the_table_is_refused() {
        let off = message(|t| {
            t + "[[objects.placed]]\nname = \"005_tomato_soup_can\"\npose = { translation = [2.0, 0.0, 0.7], quaternion = [1.0, 0.0, 0.0, 0.0] }\n"
        });
        assert!(off.contains("005_tomato_soup_can") && off.contains("off the table"), "{off}");
    }
}
