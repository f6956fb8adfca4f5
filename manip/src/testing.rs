//! Objects, a scene and the robot for this crate's tests.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::sync::Arc;

use grip_sim::objects::ObjectModel;
use grip_sim::pose::Pose;
use grip_sim::robot::{RobotConfig, RobotModel};
use grip_sim::shape::{CollisionShape, Convex};
use grip_testkit::objects;
use nalgebra::{Isometry3, Vector3};

use crate::belief::{BeliefScene, BelievedObject, BinGeometry, bin_fixtures};

/// A box of full extents `size`, metres.
pub(crate) fn box_model(name: &str, size: [f64; 3]) -> Arc<ObjectModel> {
    grocery(objects::box_object(name, size.map(|v| v as f32)))
}

/// A can along z.
pub(crate) fn cylinder_model(name: &str, radius: f64, height: f64) -> Arc<ObjectModel> {
    grocery(objects::can_object(name, radius as f32, height as f32))
}

/// Of the mass and friction of a full can.
fn grocery(model: Arc<ObjectModel>) -> Arc<ObjectModel> {
    let mut model = Arc::unwrap_or_clone(model);
    (model.info.mass_kg, model.info.friction) = (0.35, 0.6);
    Arc::new(model)
}

/// The Fetch of this repository.
pub(crate) fn fetch() -> (Arc<RobotModel>, Arc<RobotConfig>) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../robots/fetch");
    let model = RobotModel::load(&root.join("fetch.urdf"), &[]).unwrap();
    let (model, config) = RobotConfig::load(&root.join("fetch.toml"), model).unwrap();
    let (model, config) = (Arc::new(model), Arc::new(config));
    (model, config)
}

/// A table with a bin on it at the robot's right, and nothing else.
pub(crate) fn empty_scene() -> BeliefScene {
    let table_height = 0.65;
    let bin = BinGeometry {
        world_from_bin: Pose::from_xyz_rpy(
            [0.52, -0.42, table_height + 0.008],
            [0.0, 0.0, std::f64::consts::FRAC_PI_2],
        ),
        inner: [0.40, 0.30],
        wall_height: 0.12,
    };
    let mut fixtures = vec![CollisionShape {
        pose: Isometry3::translation(0.64, -0.05, table_height - 0.02),
        geometry: Convex::Cuboid { half: Vector3::new(0.30, 0.60, 0.02) },
    }];
    fixtures.extend(bin_fixtures(&bin, 0.008));
    BeliefScene {
        fixtures,
        table_height,
        bin,
        objects: Vec::new(),
        unmodelled: Vec::new(),
        world_from_base: Pose::identity(),
    }
}

/// `model` standing on the table at (x, y), turned by `yaw`.
pub(crate) fn standing(model: &Arc<ObjectModel>, x: f64, y: f64, yaw: f64) -> BelievedObject {
    BelievedObject {
        name: model.info.name.clone(),
        model: model.clone(),
        world_from_object: Pose::from_xyz_rpy([x, y, 0.65 - model.min.z], [0.0, 0.0, yaw]),
        position_std_m: 0.002,
        confidence: 0.9,
        packed: false,
    }
}

/// A few groceries on the table.
pub(crate) fn groceries() -> BeliefScene {
    let mut scene = empty_scene();
    let mut soup = (*cylinder_model("soup", 0.034, 0.102)).clone();
    soup.info.upright = true;
    scene.objects = vec![
        standing(&Arc::new(soup), 0.55, 0.00, 0.0),
        standing(&box_model("sugar", [0.045, 0.09, 0.175]), 0.62, 0.16, 0.5),
        standing(&box_model("meat", [0.10, 0.058, 0.083]), 0.70, -0.02, -0.3),
        standing(&box_model("pudding", [0.11, 0.089, 0.035]), 0.48, 0.22, 0.2),
    ];
    scene
}
