//! Everything that a trial depends on, as resolved: the content of scenario.json, and its hash.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use grip_sim::mesh::Visual;
use grip_sim::objects::ObjectModel;
use grip_sim::robot::RobotModel;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use crate::cli;
use crate::perceive::Perception;
use crate::setup::Setup;

/// Version of scenario.json.
const SCHEMA: &str = "grip.scenario/2";

/// What a run of trials has in common beside scene, condition and seed.
#[derive(Debug, Clone)]
pub struct Options {
    /// Whether grasps are scored at the best pose or over the posterior.
    pub grasp_at: cli::GraspAt,
    /// The folder of grasp files.
    pub grasps: Option<PathBuf>,
    /// Who draws: `wgpu` or `cpu`.
    pub renderer: &'static str,
}

/// The inputs of a trial.
#[derive(Debug, Clone, PartialEq)]
pub struct Scenario(Value);

impl Scenario {
    /// Of a trial with `items` of the setup's objects to be packed.
    ///
    /// # Errors
    /// When a file of grasps cannot be read.
    pub fn new(setup: &Setup, perception: &Perception, items: usize, options: &Options) -> Result<Self> {
        let objects: Vec<Value> = setup.models.iter().map(|model| object(model)).collect();
        let grasps = match &options.grasps {
            Some(folder) => json!({ "path": folder, "sha256": grasps_digest(folder, &setup.models)? }),
            None => Value::Null,
        };
        Ok(Self(json!({
            "schema": SCHEMA,
            "program": env!("CARGO_PKG_VERSION"),
            "seed": setup.seed,
            "estimator": perception.description(),
            "grasps": grasps,
            "grasp_at": format!("{:?}", options.grasp_at).to_lowercase(),
            "items": items,
            "object_set": setup.library.set().label(),
            "renderer": options.renderer,
            "hypotheses": setup.hypotheses.to_string(),
            "robot": robot(setup),
            "objects": objects,
            "intrinsics": setup.intrinsics,
            "condition": setup.condition,
            "scene": setup.scene,
        })))
    }

    /// scenario.json.
    pub fn json(&self) -> &Value {
        &self.0
    }

    /// SHA-256 over everything but the paths of files, whose content counts instead. Trials of one program with the same hash
    /// have the same result on the same kind of machine.
    pub fn hash(&self) -> String {
        let mut value = self.0.clone();
        for file in ["robot", "grasps", "estimator"] {
            if let Some(entry) = value.get_mut(file).and_then(Value::as_object_mut) {
                entry.remove("path");
            }
        }
        if let Some(robot) = value.pointer_mut("/scene/robot").and_then(Value::as_object_mut) {
            robot.remove("urdf");
            robot.remove("config");
        }
        // The maps of serde_json are sorted by their keys.
        hex(&Sha256::digest(value.to_string()))
    }
}

/// What is known of an object, and the digest of its shape and looks.
pub fn object(model: &ObjectModel) -> Value {
    json!({ "info": model.info, "sha256": mesh_digest(model) })
}

/// The robot: its name, where it was read, and digests of what is in it.
pub fn robot(setup: &Setup) -> Value {
    json!({
        "name": setup.robot.name(),
        "path": setup.robot.source(),
        "sha256": robot_digest(&setup.robot),
        "settings": format!("{:?}", setup.config),
    })
}

/// Bytes as text.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

/// Of an object's shape and looks; its other properties are written out.
fn mesh_digest(model: &ObjectModel) -> String {
    let mut hasher = Sha256::new();
    add_visual(&mut hasher, &model.visual);
    hasher.update(format!("{:?}", model.collision));
    hex(&hasher.finalize())
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
    hex(&hasher.finalize())
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

fn grasps_digest(folder: &Path, models: &[std::sync::Arc<ObjectModel>]) -> Result<String> {
    let mut hasher = Sha256::new();
    for model in models {
        let path = folder.join(grip_manip::grasp_set::file_name(&model.info.name));
        let bytes = std::fs::read(&path).with_context(|| format!("{}: cannot be read", path.display()))?;
        hasher.update(&model.info.name);
        hasher.update(bytes);
    }
    Ok(hex(&hasher.finalize()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::{Cli, Command};
    use clap::Parser;

    fn hash(args: &[&str], change: impl Fn(&mut Setup)) -> String {
        let Command::Pack(args) = Cli::parse_from([&["grip", "pack"], args].concat()).command else {
            unreachable!()
        };
        let mut setup = Setup::load(&args.scene, &args.condition).unwrap();
        change(&mut setup);
        let options = Options { grasp_at: args.grasp_at, grasps: None, renderer: "cpu" };
        let perception =
            Perception::open(&setup, &args.estimator, cli::Detector::None, &args.network).unwrap();
        Scenario::new(&setup, &perception, 5, &options).unwrap().hash()
    }

    #[test]
    fn the_hash_tells_inputs_apart_and_not_where_they_lie() {
        let plain = hash(&[], |_| ());
        assert_eq!(plain, hash(&["--seed", "1"], |_| ()));
        let elsewhere = |setup: &mut Setup| setup.scene.robot.urdf = "/elsewhere/fetch.urdf".into();
        assert_eq!(plain, hash(&[], elsewhere));
        let others = [
            hash(&["--seed", "2"], |_| ()),
            hash(&["--condition", "dark"], |_| ()),
            hash(&["--estimator", "truth"], |_| ()),
            hash(&["--grasp-at", "best"], |_| ()),
            hash(&[], |setup| setup.scene.table.friction += 0.01),
            hash(&[], |setup| {
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
    }
}
