//! Searches the geometry of table, bin and object region that lets the Fetch reach most grasps and places.
//!
//! Prints one line a geometry: the share of gripper poses with collision-free inverse kinematics and a straight lift.
//! The default scene stands where this search said. Run with `cargo run --release -p grip-manip --example reach_search`.
#![allow(clippy::print_stdout)]

use std::error::Error;
use std::path::Path;
use std::sync::Arc;

use grip_manip::belief::{BeliefScene, BinGeometry, bin_fixtures};
use grip_manip::collision::RobotSolids;
use grip_manip::motion::{IkSolver, ReachParams, reach_score};
use grip_sim::pose::Pose;
use grip_sim::robot::{RobotConfig, RobotModel};
use grip_sim::shape::{CollisionShape, Convex};
use nalgebra::{Isometry3, Vector3};

/// Thickness of the bin's walls and floor, metres.
const WALL: f64 = 0.008;

/// A table of 0.6 x 1.2 m whose near edge is at x = 0.34, and a bin on it.
fn scene(table_height: f64, bin_xy: [f64; 2], bin_yaw: f64) -> BeliefScene {
    let bin = BinGeometry {
        world_from_bin: Pose::from_xyz_rpy([bin_xy[0], bin_xy[1], table_height + WALL], [0.0, 0.0, bin_yaw]),
        inner: [0.40, 0.30],
        wall_height: 0.12,
    };
    let mut fixtures = vec![CollisionShape {
        pose: Isometry3::translation(0.64, -0.05, table_height - 0.02),
        geometry: Convex::Cuboid { half: Vector3::new(0.30, 0.60, 0.02) },
    }];
    fixtures.extend(bin_fixtures(&bin, WALL));
    BeliefScene::new(fixtures, table_height, bin, Pose::identity())
}

fn main() -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../robots/fetch");
    let model = RobotModel::load(&root.join("fetch.urdf"), &[])?;
    let (model, config) = RobotConfig::load(&root.join("fetch.toml"), model)?;
    let model = Arc::new(model);
    let solver = IkSolver::new(Arc::new(RobotSolids::new(model.clone(), &config)), &config);
    let params = ReachParams {
        region: [[0.45, -0.13], [0.75, 0.29]],
        spacing: 0.05,
        grasp_heights: vec![0.035, 0.10],
        place_heights: vec![0.05, 0.12],
        tilts: [0.0_f64, 20.0, 40.0].map(f64::to_radians).to_vec(),
        headings: 6,
        lift: 0.2,
        opening: config.gripper.opening,
        start: config.configuration(&model, "ready")?,
    };

    println!("where objects may lie: one column of the region at a time, table 0.65 m");
    println!("{:>6} {:>6} {:>6}", "x", "top", "tilted");
    for x in [0.40, 0.45, 0.50, 0.55, 0.60, 0.65, 0.70, 0.75, 0.80, 0.85, 0.90] {
        let column = ReachParams { region: [[x, -0.13], [x, 0.29]], ..params.clone() };
        let s = reach_score(&solver, &scene(0.65, [0.52, -0.42], std::f64::consts::FRAC_PI_2), &column);
        println!("{x:6.2} {:6.3} {:6.3}", s.top, s.any_tilt);
    }

    println!("\ntable and bin");
    println!(
        "{:>6} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6}",
        "table", "bin x", "bin y", "yaw", "top", "tilted", "place", "tilted"
    );
    for table in [0.60, 0.65, 0.70, 0.75] {
        for bin in [[0.52, -0.42], [0.50, -0.45], [0.55, -0.42], [0.60, -0.45]] {
            for yaw in [0.0, std::f64::consts::FRAC_PI_2] {
                let s = reach_score(&solver, &scene(table, bin, yaw), &params);
                println!(
                    "{table:6.2} {:6.2} {:6.2} {yaw:6.2} {:6.3} {:6.3} {:6.3} {:6.3}",
                    bin[0], bin[1], s.top, s.any_tilt, s.place_top, s.place_any
                );
            }
        }
    }
    Ok(())
}
