//! Checks of a robot in a cell, before the first trial.

use anyhow::Result;
use grip_manip::collision::{CollisionBody, CollisionChecker, CollisionQuery, Margins};
use grip_manip::motion::{ReachParams, ReachScore, reach_score};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use crate::setup::Setup;

/// Least share of sampled grasps and places within reach of a robot that fits its cell. The Panda of `scenes/panda.toml`, which packs 92 of
/// 100, reaches 83 % of the places.
const LEAST_REACH: f64 = 0.7;
/// Most of the points that may be out of reach.
const MOST_DEAD: f64 = 0.02;
/// Distance of the points that are tried, metres.
const SPACING_M: f64 = 0.06;
/// Heights of the pads' middle over the table and over the bin's floor, metres.
const GRASP_HEIGHTS_M: [f64; 2] = [0.035, 0.10];
const PLACE_HEIGHTS_M: [f64; 2] = [0.05, 0.12];
/// How far the hand leans from straight down, degrees.
const TILTS_DEG: [f64; 3] = [0.0, 20.0, 40.0];
/// Turns of the closing axis that are tried within half a turn, and the straight lift, metres.
const HEADINGS: usize = 6;
const LIFT_M: f64 = 0.2;

/// What was checked, and what does not fit.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct RobotCheck {
    /// Each named pose.
    pub poses: Vec<PoseCheck>,
    /// Share of grasps over the objects' region that are within reach with a straight lift: straight down, and leaning by up to 40 degrees.
    pub grasps_straight_down: f64,
    /// See there.
    pub grasps: f64,
    /// Share of places over the bin, the same.
    pub places_straight_down: f64,
    /// See there.
    pub places: f64,
    /// Share of the region's points where no grasp is, and of the bin's where no place is.
    pub out_of_reach: [f64; 2],
    /// The scene's objects, and how many grasps the gripper has of each.
    pub objects: Vec<ObjectCheck>,
    /// What does not fit, each with what to try; empty where all does.
    pub problems: Vec<String>,
}

/// A named pose.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct PoseCheck {
    /// Its name.
    pub name: String,
    /// Links that touch each other in it, and links that touch table, bin or blocks of the scene.
    pub touching: Vec<String>,
}

/// An object of the scene.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct ObjectCheck {
    /// Its name.
    pub name: String,
    /// Grasps in free space.
    pub grasps: usize,
}

/// Checks the robot of `setup` in its cell. Joints that a pose does not name are as at the start.
///
/// # Errors
/// When the scene has no pose of its start's name, which loading it has checked.
pub fn check(setup: &Setup) -> Result<RobotCheck> {
    let cell = &setup.cell;
    let planner = setup.planner();
    let belief = cell.empty_belief();
    let checker = CollisionChecker::new(planner.robot().clone(), &belief);
    let query = CollisionQuery { held: None, allowed: &[], margins: Margins::TOUCHING };
    let mut problems = Vec::new();
    let mut poses = Vec::new();
    let start = &cell.scene.robot.start_pose;
    for (name, pose) in &cell.config.poses {
        let mut q = cell.start.clone();
        pose.apply(&mut q);
        let pairs = checker.collisions(&q, &query);
        // Only where it starts must it be clear of the scene; other poses may be for other scenes.
        let own = |body| matches!(body, CollisionBody::Link(_));
        let wrong: Vec<String> = pairs
            .iter()
            .filter(|pair| own(pair.b) || name == start)
            .map(|pair| checker.describe(*pair))
            .collect();
        if !wrong.is_empty() {
            problems.push(format!(
                "poses.{name}: {} touch; change the pose, or, if they may, name them in self_collision.allowed",
                wrong.join(", ")
            ));
        }
        let touching = pairs.iter().map(|pair| checker.describe(*pair)).collect();
        poses.push(PoseCheck { name: name.clone(), touching });
    }
    let region = &cell.scene.objects;
    let corner = |sign: f64| [0, 1].map(|axis| region.center[axis] + sign * 0.5 * region.size[axis]);
    let reach = reach_score(
        planner.solver(),
        &belief,
        &ReachParams {
            region: [corner(-1.0), corner(1.0)],
            spacing: SPACING_M,
            grasp_heights: GRASP_HEIGHTS_M.to_vec(),
            place_heights: PLACE_HEIGHTS_M.to_vec(),
            tilts: TILTS_DEG.map(f64::to_radians).to_vec(),
            headings: HEADINGS,
            lift: LIFT_M,
            opening: cell.config.gripper.opening,
            start: cell.start.clone(),
        },
    );
    let ReachScore { top, any_tilt, place_top, place_any, dead_cells, dead_place_cells } = reach;
    for (what, share, dead, field) in [
        ("grasps over the objects' region", any_tilt, dead_cells, "objects"),
        ("places over the bin", place_any, dead_place_cells, "bin"),
    ] {
        if share < LEAST_REACH || dead > MOST_DEAD {
            problems.push(format!(
                "reach: {:.0} % of {what} are within reach, of at least {:.0} %, and at {:.0} % of the points there is none, of at most \
                 {:.0} %; move robot.base, robot.base_height or {field}.center of the scene, or choose another start_pose",
                100.0 * share,
                100.0 * LEAST_REACH,
                100.0 * dead,
                100.0 * MOST_DEAD
            ));
        }
    }
    let objects: Vec<ObjectCheck> = setup
        .models
        .par_iter()
        .map(|model| ObjectCheck {
            name: model.info.name.clone(),
            grasps: planner.grasps(model).candidates.len(),
        })
        .collect();
    for object in objects.iter().filter(|object| object.grasps == 0) {
        problems.push(format!(
            "objects: the gripper has no grasp of {}; leave it out, or check gripper.opening and the pads",
            object.name
        ));
    }
    Ok(RobotCheck {
        poses,
        grasps_straight_down: top,
        grasps: any_tilt,
        places_straight_down: place_top,
        places: place_any,
        out_of_reach: [dead_cells, dead_place_cells],
        objects,
        problems,
    })
}
