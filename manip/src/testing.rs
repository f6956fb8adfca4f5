//! Objects, a scene and the robot for this crate's tests.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::sync::Arc;

use grip_sim::mesh::{Material, Mesh, Visual};
use grip_sim::objects::{Fragility, ObjectInfo, ObjectModel};
use grip_sim::pose::Pose;
use grip_sim::robot::{RobotConfig, RobotModel};
use grip_sim::shape::{CollisionShape, Convex};
use nalgebra::{Isometry3, Point3, Vector3};

use crate::belief::{BeliefScene, BelievedObject, BinGeometry, bin_fixtures};

fn info(name: &str) -> ObjectInfo {
    ObjectInfo {
        name: name.into(),
        bop_id: 1,
        mass_kg: 0.35,
        friction: 0.6,
        symmetric: false,
        fragility: Fragility::Sturdy,
        upright: false,
        revolution: None,
        half_turns: vec![],
    }
}

fn model(
    name: &str,
    positions: Vec<Point3<f32>>,
    triangles: Vec<[u32; 3]>,
    geometry: Convex,
) -> Arc<ObjectModel> {
    let normals = positions.iter().map(|p| p.coords.normalize()).collect();
    let visual = Visual {
        mesh: Arc::new(Mesh { positions, normals, triangles, ..Mesh::default() }),
        material: Material::default(),
    };
    let collision = vec![CollisionShape { pose: Isometry3::identity(), geometry }];
    Arc::new(ObjectModel::new(info(name), visual, collision))
}

/// A box of full extents `size`, metres.
pub(crate) fn box_model(name: &str, size: [f64; 3]) -> Arc<ObjectModel> {
    let h = size.map(|v| (0.5 * v) as f32);
    let positions = (0..8)
        .map(|i| {
            let s = |bit: usize| if i >> bit & 1 == 0 { -h[bit] } else { h[bit] };
            Point3::new(s(0), s(1), s(2))
        })
        .collect();
    let triangles = vec![
        [0, 2, 1],
        [1, 2, 3], // z low
        [4, 5, 6],
        [5, 7, 6], // z high
        [0, 1, 4],
        [1, 5, 4], // y low
        [2, 6, 3],
        [3, 6, 7], // y high
        [0, 4, 2],
        [2, 4, 6], // x low
        [1, 3, 5],
        [3, 7, 5], // x high
    ];
    let half = Vector3::from(size) * 0.5;
    model(name, positions, triangles, Convex::Cuboid { half })
}

/// A can along z.
pub(crate) fn cylinder_model(name: &str, radius: f64, height: f64) -> Arc<ObjectModel> {
    let n = 48u32;
    let mut positions =
        vec![Point3::new(0.0, 0.0, (-0.5 * height) as f32), Point3::new(0.0, 0.0, (0.5 * height) as f32)];
    let mut triangles = Vec::new();
    for i in 0..n {
        let a = std::f64::consts::TAU * f64::from(i) / f64::from(n);
        for z in [-0.5, 0.5] {
            let p = Point3::new(radius * a.cos(), radius * a.sin(), z * height);
            positions.push(p.cast::<f32>());
        }
        let (p, q) = (2 + 2 * i, 2 + 2 * ((i + 1) % n));
        triangles.push([0, q, p]);
        triangles.push([1, p + 1, q + 1]);
        triangles.push([p, q, q + 1]);
        triangles.push([p, q + 1, p + 1]);
    }
    let geometry = Convex::Cylinder { half_height: 0.5 * height, radius };
    model(name, positions, triangles, geometry)
}

/// The Fetch of this repository.
pub(crate) fn fetch() -> (Arc<RobotModel>, Arc<RobotConfig>) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../robots/fetch");
    let model = Arc::new(RobotModel::load(&root.join("fetch.urdf"), &[]).unwrap());
    let config = Arc::new(RobotConfig::load(&root.join("fetch.toml"), &model).unwrap());
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
        poses: Vec::new(),
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
