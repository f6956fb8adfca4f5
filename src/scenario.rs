//! Everything that a trial depends on, as resolved: the content of scenario.json, and its hash.

use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result};
use grip_manip::grasp::GraspSet;
use grip_sim::camera::Intrinsics;
use grip_sim::condition::Condition;
use grip_sim::mesh::Visual;
use grip_sim::objects::{MeshSource, ObjectInfo, ObjectModel};
use grip_sim::robot::RobotModel;
use grip_sim::scene::Scene;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;
use sha2::{Digest, Sha256};

use crate::estimators::Estimator;
use crate::graspers::Grasper;
use crate::settings::Settings;
use crate::setup::Setup;

/// Version of scenario.json.
pub const SCHEMA: &str = "grip.scenario/3";

/// scenario.json.
#[derive(Serialize, JsonSchema)]
pub struct ScenarioFile<'a> {
    schema: &'static str,
    program: Program,
    seed: u64,
    /// Its name, and what its estimates depend on.
    estimator: Value,
    /// Who plans grasps: its name, and what they depend on.
    grasper: Value,
    grasps: Option<Digested<'a>>,
    /// How many objects are to be packed: the first of `objects`.
    items: usize,
    object_set: String,
    renderer: &'a str,
    /// Who renders hypotheses.
    hypotheses: String,
    robot: RobotEntry<'a>,
    objects: Vec<ObjectEntry<'a>>,
    intrinsics: Intrinsics,
    condition: &'a Condition,
    scene: &'a Scene,
    settings: &'a Settings,
}

/// The program that made a file.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Program {
    /// Of the package.
    pub version: &'static str,
    /// The commit it was built from, with `-dirty` where files differ from it.
    pub commit: &'static str,
    /// The platform it was built for.
    pub target: &'static str,
    /// The processor's features that it was built for.
    pub target_features: &'static str,
}

/// A file or folder, and SHA-256 of its content.
#[derive(Serialize, JsonSchema)]
struct Digested<'a> {
    #[serde(serialize_with = "grip_sim::files::shown")]
    path: &'a Path,
    sha256: String,
}

/// An object, and SHA-256 of its shape and looks.
#[derive(Debug, Serialize, JsonSchema)]
pub struct ObjectEntry<'a> {
    info: &'a ObjectInfo,
    sha256: String,
    /// The files of an object of one's own.
    #[serde(skip_serializing_if = "Option::is_none")]
    source: Option<&'a MeshSource>,
}

/// A robot: where it was read, and SHA-256 of what is in it.
#[derive(Debug, Serialize, JsonSchema)]
pub struct RobotEntry<'a> {
    name: &'a str,
    #[serde(serialize_with = "grip_sim::files::shown")]
    path: &'a Path,
    sha256: String,
    /// The file of what the URDF does not say, and SHA-256 of what it says.
    #[serde(serialize_with = "grip_sim::files::shown")]
    config: &'a Path,
    config_sha256: String,
}

/// The inputs of a trial.
#[derive(Debug, Clone, PartialEq)]
pub struct Scenario(Value);

impl Scenario {
    /// Of a trial with `items` of the setup's objects to be packed, by grasps of `grasper`; those of our own planner are from the folder
    /// `grasps` if there is one. `renderer` draws: `wgpu` or `cpu`.
    ///
    /// # Errors
    /// When a file of grasps cannot be read.
    pub fn new(
        setup: &Setup,
        estimator: &Estimator,
        (grasper, grasps): (&Grasper, Option<&Path>),
        items: usize,
        renderer: &str,
    ) -> Result<Self> {
        let digested =
            |path| Ok::<_, anyhow::Error>(Digested { path, sha256: grasps_digest(path, &setup.models)? });
        Ok(Self(serde_json::to_value(ScenarioFile {
            schema: SCHEMA,
            program: program(),
            seed: setup.seed,
            estimator: estimator.description(),
            grasper: grasper.description(),
            grasps: grasps.map(digested).transpose()?,
            items,
            object_set: setup.object_set(),
            renderer,
            hypotheses: setup.hypotheses.to_string(),
            robot: robot(setup),
            objects: setup.models.iter().map(|model| object(model)).collect(),
            intrinsics: setup.camera.intrinsics,
            condition: &setup.condition,
            scene: &setup.cell.scene,
            settings: &setup.settings,
        })?))
    }

    /// scenario.json.
    pub fn json(&self) -> &Value {
        &self.0
    }

    /// SHA-256 over everything but the paths of files, whose content counts instead: scene, condition, objects, robot,
    /// estimator, grasp planner, settings, seed and the program (version, commit, target). Trials with the same hash have the same result on
    /// the same kind of machine.
    pub fn hash(&self) -> String {
        let mut value = self.0.clone();
        for file in ["robot", "grasps", "estimator"] {
            if let Some(entry) = value.get_mut(file).and_then(Value::as_object_mut) {
                entry.remove("path");
                entry.remove("config");
            }
        }
        if let Some(robot) = value.pointer_mut("/scene/robot").and_then(Value::as_object_mut) {
            robot.remove("urdf");
            robot.remove("config");
        }
        if let Some(objects) = value.pointer_mut("/scene/objects").and_then(Value::as_object_mut) {
            objects.remove("tables");
        }
        for object in value.get_mut("objects").and_then(Value::as_array_mut).into_iter().flatten() {
            object.as_object_mut().map(|entry| entry.remove("source"));
        }
        // The maps of serde_json are sorted by their keys.
        format!("{:x}", Sha256::digest(value.to_string()))
    }
}

/// This program.
pub fn program() -> Program {
    Program {
        version: env!("CARGO_PKG_VERSION"),
        commit: env!("GRIP_COMMIT"),
        target: env!("GRIP_TARGET"),
        target_features: env!("GRIP_TARGET_FEATURES"),
    }
}

/// What is known of an object, and the digest of its shape and looks.
pub fn object(model: &ObjectModel) -> ObjectEntry<'_> {
    ObjectEntry { info: &model.info, sha256: mesh_digest(model), source: model.source.as_deref() }
}

/// The robot: its name, where it was read, and digests of what is in it.
pub fn robot(setup: &Setup) -> RobotEntry<'_> {
    RobotEntry {
        name: setup.cell.robot.name(),
        path: setup.cell.robot.source(),
        sha256: robot_digest(&setup.cell.robot),
        config: &setup.cell.settings,
        config_sha256: format!("{:x}", Sha256::digest(format!("{:?}", setup.cell.config))),
    }
}

/// Of an object's shape and looks; its other properties are written out.
fn mesh_digest(model: &ObjectModel) -> String {
    let mut hasher = Sha256::new();
    add_visual(&mut hasher, &model.visual);
    hasher.update(format!("{:?}", model.collision));
    format!("{:x}", hasher.finalize())
}

/// Of the robot's kinematics, solids and looks.
fn robot_digest(robot: &RobotModel) -> String {
    let mut hasher = Sha256::new();
    hasher.update(format!("{:?}", robot.joints()));
    for link in robot.links() {
        hasher.update(format!("{} {:?}", link.name, link.collisions));
        for part in &link.visuals {
            hasher.update(format!("{:?}", part.pose));
            add_visual(&mut hasher, &part.visual);
        }
    }
    format!("{:x}", hasher.finalize())
}

fn add_visual(hasher: &mut Sha256, visual: &Visual) {
    let Visual { mesh, material } = visual;
    let mut numbers = |values: &mut dyn Iterator<Item = f32>| {
        values.for_each(|v| hasher.update(v.to_le_bytes()));
    };
    numbers(&mut mesh.positions.iter().flat_map(|p| [p.x, p.y, p.z]));
    numbers(&mut mesh.normals.iter().flat_map(|n| [n.x, n.y, n.z]));
    numbers(&mut mesh.uvs.iter().flatten().copied());
    numbers(&mut material.base_color.into_iter().chain([material.roughness, material.metallic]));
    mesh.colors.iter().for_each(|c| hasher.update(c));
    mesh.finish.iter().for_each(|f| hasher.update(f));
    mesh.triangles.iter().flatten().for_each(|i| hasher.update(i.to_le_bytes()));
    if let Some(texture) = &material.texture {
        hasher.update(texture.as_raw());
    }
}

fn grasps_digest(folder: &Path, models: &[Arc<ObjectModel>]) -> Result<String> {
    let mut hasher = Sha256::new();
    for model in models {
        let path = folder.join(GraspSet::file_name(&model.info.name));
        let bytes = std::fs::read(&path).with_context(|| format!("{}: cannot be read", path.display()))?;
        hasher.update(&model.info.name);
        hasher.update(bytes);
    }
    Ok(format!("{:x}", hasher.finalize()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Settings;
    use crate::setup::SetupOptions;

    fn hash_of(options: SetupOptions, estimator: &Estimator, change: impl Fn(&mut Setup)) -> String {
        let mut setup = Setup::load(&options).unwrap();
        change(&mut setup);
        Scenario::new(&setup, estimator, (&Grasper::Grip, None), 5, "cpu").unwrap().hash()
    }

    fn changed(change: impl Fn(&mut Setup)) -> String {
        hash_of(SetupOptions::default(), &Estimator::Truth, change)
    }

    #[test]
    fn the_hash_tells_inputs_apart_and_not_where_they_lie() {
        let plain = changed(|_| ());
        assert_eq!(plain, changed(|_| ()));
        assert_eq!(plain, changed(|setup| setup.cell.scene.robot.urdf = "/elsewhere/fetch.urdf".into()));
        let with = |options| hash_of(options, &Estimator::Truth, |_| ());
        let slip = Settings::parse("[success]\nslip_m = 0.01").unwrap();
        let others = [
            with(SetupOptions { seed: 2, ..SetupOptions::default() }),
            with(SetupOptions { condition: "dark".into(), ..SetupOptions::default() }),
            with(SetupOptions { settings: Arc::new(slip), ..SetupOptions::default() }),
            changed(|setup| setup.cell.scene.table.friction += 0.01),
            changed(|setup| {
                let mut model = (*setup.models[0]).clone();
                let mut visual = (*model.visual).clone();
                let mut mesh = (*visual.mesh).clone();
                mesh.positions[0].x += 1e-6;
                visual.mesh = mesh.into();
                model.visual = visual.into();
                setup.models[0] = model.into();
            }),
        ];
        for (i, other) in others.iter().enumerate() {
            assert_ne!(&plain, other, "{i}");
        }
        let mut setup = Setup::load(&SetupOptions::default()).unwrap();
        let scenario = Scenario::new(&setup, &Estimator::Truth, (&Grasper::Grip, None), 5, "cpu").unwrap();
        assert_eq!(scenario.json()["program"]["version"], env!("CARGO_PKG_VERSION"));
        assert_eq!(scenario.json()["settings"]["success"]["slip_m"], 0.02);
        setup.seed = 3;
        assert_ne!(
            scenario,
            Scenario::new(&setup, &Estimator::Truth, (&Grasper::Grip, None), 5, "cpu").unwrap()
        );
    }
}
