//! Scene files: a table, a bin, a robot and what lies on the table, in TOML that a person can read and edit.
//!
//! All positions are in the world frame: z up, origin on the floor, the robot's base usually at the origin looking
//! along +x. Reading validates every number, so that a [`Scene`] which exists can be built.
//!
//! | file | what it holds |
//! |---|---|
//! | `mod` | the scene file and its checks; where the robot stands |
//! | `camera` | the head camera, and the sphere on which other cameras stand |
//! | `table`, `bin` | what the scene is built of |
//! | `block` | further solids: shelves, steps |
//! | `fixture` | the solids of all these |
//! | `objects` | what lies on the table |
//! | `surroundings` | how it all looks |

use std::path::{Path, PathBuf};

use rand::RngExt;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::files;
use crate::pose::{Base, Pose, World};
use crate::range::within;

mod bin;
mod block;
mod camera;
mod fixture;
mod objects;
mod surroundings;
mod table;

pub use bin::Bin;
pub use block::Block;
pub use camera::{CameraPlace, CameraSetup, FurtherCamera, IntrinsicsChoice, Sphere};
pub use fixture::{BinKind, Fixture, FixtureKind};
pub use objects::{Count, ObjectPlacement, PlacedObject};
pub use surroundings::Surroundings;
pub use table::Table;

/// The version this program reads and writes.
pub const SCHEMA: &str = "grip.scene/1";

/// A scene as written in its file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
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
    /// The camera: the robot's, or one of the scene's own.
    pub camera: CameraSetup,
    /// Further cameras, which take pictures for data sets beside it (`grip scenes --camera all`).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cameras: Vec<FurtherCamera>,
    /// The table.
    pub table: Table,
    /// The bin that is packed.
    pub bin: Bin,
    /// Further solids: shelves, steps, walls. What stands over one when it is laid out is put on top.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub blocks: Vec<Block>,
    /// What lies on the table.
    pub objects: ObjectPlacement,
}

/// Where the robot stands and how it starts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RobotPlacement {
    /// URDF file, relative to the scene file, or `package://`, which is looked up in `--package-path`.
    #[serde(serialize_with = "files::shown")]
    pub urdf: PathBuf,
    /// Robot settings (groups, poses, limits), relative to the scene file.
    #[serde(serialize_with = "files::shown")]
    pub config: PathBuf,
    /// Base position on the floor, metres.
    pub base: [f64; 2],
    /// Height of the base over the floor, metres: of a robot on a table or a stand. What it stands on is a table or one of `blocks`.
    #[serde(default, skip_serializing_if = "is_on_floor")]
    pub base_height: f64,
    /// Base heading, radians.
    #[serde(default)]
    pub yaw: f64,
    /// The base stands up to so far beside that along x and y, metres, and is turned by up to so much, radians: each run draws its own
    /// from its seed. The robot knows where it stands.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub spread: [f64; 3],
    /// Named pose of the arm at the start and while looking.
    pub start_pose: String,
    /// Torso height above its lower stop at the start and while looking, metres; left out for a robot without a torso.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub torso: Option<f64>,
    /// The point that the head camera looks at, metres; left out for a robot without a head.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub look_at: Option<[f64; 3]>,
}

impl RobotPlacement {
    /// Moves the base to where it stands in a run with `seed`.
    pub fn draw(&mut self, seed: u64) {
        let mut random = crate::rng::stream(seed, "base");
        let [x, y, turn] =
            std::mem::take(&mut self.spread).map(|most| most * (2.0 * random.random::<f64>() - 1.0));
        self.base[0] += x;
        self.base[1] += y;
        self.yaw += turn;
    }
}

impl Scene {
    /// Reads and validates a scene file.
    ///
    /// # Errors
    /// [`Error::Io`] when it cannot be read; [`Error::Invalid`] naming field, value and what to try.
    pub fn load(path: &Path) -> Result<Self> {
        let text = files::read_to_string(path)?;
        let scene: Self = files::from_toml(&text).map_err(|message| Error::invalid(path, message))?;
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
        each("robot.spread", &robot.spread, 0.0, 1.0)?;
        each("robot.base_height", &[robot.base_height], 0.0, 3.0)?;
        each("robot.torso", robot.torso.as_slice(), 0.0, 1.0)?;
        each("robot.look_at", robot.look_at.as_ref().map_or(&[], |at| at.as_slice()), -10.0, 10.0)?;
        if let Some(problem) = self.camera.problem() {
            return Err(problem);
        }
        for (i, further) in self.cameras.iter().enumerate() {
            if let Some(problem) = further.problem(&self.cameras[..i]) {
                return Err(problem);
            }
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
        for (i, block) in self.blocks.iter().enumerate() {
            each(&format!("blocks[{i}].center"), &block.center, -10.0, 10.0)?;
            each(&format!("blocks[{i}].size"), &block.size, 0.002, 5.0)?;
            each(&format!("blocks[{i}].rpy"), &block.rpy, -7.0, 7.0)?;
            each(&format!("blocks[{i}].friction"), &[block.friction], 0.0, 2.0)?;
        }
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
            let field = format!("objects.placed '{}'", placed.name);
            let places = objects.placed[..=i].iter().filter(|other| other.name == placed.name).count();
            let named = objects.names.iter().filter(|name| **name == placed.name).count();
            if places > named {
                return Err(format!(
                    "{field}: place number {places}, but objects.names has {named} of it; add it there"
                ));
            }
            if placed.frozen {
                // Trials pack the first objects.
                let all = objects.names.iter().filter(|name| **name == placed.name).count();
                let last = objects.names.len() - objects.placed.iter().filter(|other| other.frozen).count();
                if objects.count.is_some() || all > 1 || objects.names[..last].contains(&placed.name) {
                    return Err(format!(
                        "{field}: frozen objects are the last of objects.names, once each, and objects.count draws none; move it there"
                    ));
                }
                continue;
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
        Pose::from_xyz_rpy([x, y, self.robot.base_height], [0.0, 0.0, self.robot.yaw])
    }

    /// The fixed solids of the scene: table top and legs as one block each, bin floor and walls, further blocks. World frame.
    ///
    /// This is the map that the robot is given of its cell; it holds no object.
    pub fn fixtures(&self) -> Vec<Fixture> {
        let mut fixtures = self.table.solids();
        fixtures.extend(self.bin.solids(self.table.height));
        fixtures.extend(self.blocks.iter().map(Block::solid));
        fixtures
    }

    /// Height above which there is nothing but objects and what hangs over them, metres: the table's or the highest block's.
    pub fn highest_ground(&self) -> f64 {
        self.blocks
            .iter()
            .filter(|block| !block.overhead)
            .map(Block::highest)
            .fold(self.table.height, f64::max)
    }

    /// Height of the level ground, the table or the highest block, on which something with an outline of `radius` metres about
    /// (x, y) can stand, metres; `None` where it would stand on an edge or a slope.
    pub fn ground(&self, x: f64, y: f64, radius: f64) -> Option<f64> {
        block::ground(&self.blocks, self.table.height, x, y, radius)
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes references")]
fn is_on_floor(height: &f64) -> bool {
    *height == 0.0
}

fn is_zero(values: &[f64; 3]) -> bool {
    *values == [0.0; 3]
}

/// Every one of `values` must be finite and within `low..=high`.
fn each(field: &str, values: &[f64], low: f64, high: f64) -> std::result::Result<(), String> {
    values.iter().try_for_each(|&value| within(field, value, low, high))
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
    fn the_built_in_scenes_are_those_on_disk() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
        let mut scenes = 0;
        for path in files::list(&files::builtin_path("scenes")).unwrap() {
            let name = path.file_name().unwrap();
            if name != "objects.toml" {
                assert_eq!(Scene::load(&path).unwrap(), Scene::load(&folder.join(name)).unwrap());
                scenes += 1;
            }
        }
        assert!(scenes >= 5);
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
    fn a_name_may_stand_several_times_and_each_has_a_place_of_its_own() {
        let two = |t: String| t.replace("names = [", "names = [\"005_tomato_soup_can\", ");
        let at = |x: f64| {
            format!(
                "[[objects.placed]]\nname = \"005_tomato_soup_can\"\n\
                 pose = {{ translation = [{x}, 0.0, 0.7], quaternion = [1.0, 0.0, 0.0, 0.0] }}\n"
            )
        };
        assert_eq!(message(|t| two(t) + &at(0.6) + &at(0.7)), "accepted");
        let error = message(|t| two(t) + &at(0.6) + &at(0.7) + &at(0.8));
        assert!(error.contains("place number 3") && error.contains("objects.names has 2"), "{error}");
        let scene: Scene = toml::from_str(&text(|t| two(t) + &at(0.6) + &at(0.7))).unwrap();
        let places =
            scene.objects.places(["005_tomato_soup_can", "011_banana", "005_tomato_soup_can"].into_iter());
        let x: Vec<_> =
            places.iter().map(|place| place.as_ref().map(|placed| placed.pose.translation().x)).collect();
        assert_eq!(x, [Some(0.6), None, Some(0.7)]);
    }

    #[test]
    fn an_object_off_the_table_is_refused() {
        let off = message(|t| {
            t + "[[objects.placed]]\nname = \"005_tomato_soup_can\"\npose = { translation = [2.0, 0.0, 0.7], quaternion = [1.0, 0.0, 0.0, 0.0] }\n"
        });
        assert!(off.contains("005_tomato_soup_can") && off.contains("off the table"), "{off}");
    }
}
