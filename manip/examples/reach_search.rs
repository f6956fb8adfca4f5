//! Searches the geometry of table, bin and torso that lets the robot reach most grasps and places.
#![allow(clippy::print_stdout, clippy::unwrap_used, missing_docs)]

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use grip_manip::belief::{BeliefScene, BinGeometry, bin_fixtures};
use grip_manip::collision::RobotSolids;
use grip_manip::ik::IkSolver;
use grip_manip::reach::{ReachParams, reach_score};
use grip_sim::pose::Pose;
use grip_sim::robot::{RobotConfig, RobotModel};
use grip_sim::shape::{CollisionShape, Convex};
use nalgebra::{Isometry3, Vector3};

struct Geometry {
    table: f64,
    near: f64,
    depth: f64,
    half_width: f64,
    region: [[f64; 2]; 2],
    bin: [f64; 3],
    bin_yaw: f64,
    wall: f64,
    torso: f64,
}

fn belief(g: &Geometry) -> BeliefScene {
    let cuboid = |center: Vector3<f64>, half: Vector3<f64>| CollisionShape {
        pose: Isometry3::translation(center.x, center.y, center.z),
        geometry: Convex::Cuboid { half },
    };
    let bin = BinGeometry {
        world_from_bin: Pose::from_xyz_rpy(g.bin, [0.0, 0.0, g.bin_yaw]),
        inner: [0.40, 0.30],
        wall_height: g.wall,
    };
    let mut fixtures = vec![cuboid(
        Vector3::new(g.near + 0.5 * g.depth, 0.0, g.table - 0.02),
        Vector3::new(0.5 * g.depth, g.half_width, 0.02),
    )];
    fixtures.extend(bin_fixtures(&bin, 0.008));
    BeliefScene {
        fixtures,
        table_height: g.table,
        bin,
        objects: Vec::new(),
        world_from_base: Pose::identity(),
    }
}

type Case = (f64, f64, [[f64; 2]; 2], [f64; 4], f64);

fn cases(bins: bool) -> Vec<Case> {
    let mut cases = Vec::new();
    let half_pi = std::f64::consts::FRAC_PI_2;
    if std::env::args().any(|a| a == "final") {
        for table in [0.60, 0.65, 0.70, 0.75] {
            for (x, y) in [(0.50, -0.40), (0.50, -0.45), (0.52, -0.42), (0.55, -0.42)] {
                for near in [0.30, 0.34] {
                    cases.push((
                        table,
                        near,
                        [[0.45, -0.13], [0.75, 0.29]],
                        [x, y, table + 0.008, half_pi],
                        0.36,
                    ));
                }
            }
        }
        return cases;
    }
    if bins {
        for x in [0.45, 0.50, 0.55, 0.60, 0.65] {
            for y in [-0.35, -0.42, -0.50] {
                for yaw in [0.0, half_pi] {
                    cases.push((0.70, 0.40, [[0.6, 0.1], [0.6, 0.1]], [x, y, 0.708, yaw], 0.36));
                }
            }
        }
        return cases;
    }
    for table in [0.60, 0.65, 0.70, 0.75] {
        for torso in [0.1, 0.25, 0.36] {
            cases.push((table, 0.40, [[0.5, -0.15], [0.8, 0.35]], [0.6, -0.45, table + 0.008, 0.0], torso));
        }
    }
    for x in [0.45, 0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9] {
        cases.push((0.70, 0.40, [[x, -0.2], [x, 0.4]], [0.6, -0.45, 0.708, 0.0], 0.36));
    }
    for y in [-0.3, -0.2, -0.1, 0.0, 0.1, 0.2, 0.3, 0.4, 0.5] {
        cases.push((0.70, 0.40, [[0.5, y], [0.8, y]], [0.6, -0.6, 0.3, 0.0], 0.36));
    }
    cases
}

fn main() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../robots/fetch");
    let model = Arc::new(RobotModel::load(&root.join("fetch.urdf"), &[]).unwrap());
    let config = RobotConfig::load(&root.join("fetch.toml"), &model).unwrap();
    let clock = Instant::now();
    let solids = Arc::new(RobotSolids::new(model.clone(), &config));
    let solver = IkSolver::new(solids, &config);
    println!("seed table in {:.3} s", clock.elapsed().as_secs_f64());
    let mut start = config.configuration(&model, "ready").unwrap();
    let fine = std::env::args().any(|a| a == "fine");

    for name in ["ready", "stow"] {
        let q = config.configuration(&model, name).unwrap();
        for (link, pose) in model.links().iter().zip(model.fk(&q)) {
            let t = pose.translation.vector;
            println!("{name} {} {:.2} {:.2} {:.2}", link.name, t.x, t.y, t.z);
        }
    }
    println!("table near torso | region x y | bin x y z yaw | top any dead | place_top place_any | s");
    for (table, near, region, bin, torso) in cases(std::env::args().any(|a| a == "bins")) {
        let (yaw, half_width) = (bin[3], 0.62);
        let bin = [bin[0], bin[1], bin[2]];
        start[config.arm_with_torso[0]] = torso;
        let g =
            Geometry { table, near, depth: 0.6, half_width, region, bin, bin_yaw: yaw, wall: 0.12, torso };
        let checker = grip_manip::collision::CollisionChecker::new(solver.robot().clone(), &belief(&g));
        let query = grip_manip::collision::Query {
            held: None,
            allowed: &[],
            margins: grip_manip::collision::Margins { world: 0.01, own: 0.005, spread: 0.0 },
        };
        for name in config.poses.keys() {
            let mut q = config.configuration(&model, name).unwrap();
            q[config.arm_with_torso[0]] = q[config.arm_with_torso[0]].max(torso);
            for pair in checker.collisions(&q, &query) {
                println!("  pose {name}: {}", checker.describe(pair));
            }
        }
        let params = ReachParams {
            region: g.region,
            spacing: if fine { 0.05 } else { 0.10 },
            grasp_heights: vec![0.035, 0.10],
            place_heights: vec![0.05, 0.12],
            tilts: [0.0_f64, 20.0, 40.0].map(f64::to_radians).to_vec(),
            headings: 6,
            lift: 0.2,
            start: start.clone(),
        };
        let clock = Instant::now();
        let s = reach_score(&solver, &belief(&g), &params);
        println!(
            "{table:.2} {near:.2} {:.2} | {:?} | {bin:?} | {:.3} {:.3} {:.3} | {:.3} {:.3} | {:.1}",
            g.torso,
            g.region,
            s.top,
            s.any_tilt,
            s.dead_cells,
            s.place_top,
            s.place_any,
            clock.elapsed().as_secs_f64()
        );
    }
}
