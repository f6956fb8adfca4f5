//! How well a table, a bin and a robot's place suit each other: the share of grasp and place poses within reach.
//!
//! A fixed grid of top and tilted gripper poses over the object region and over the bin's floor is solved with the
//! table, the bin and the robot as obstacles; a pose counts when it can be approached and lifted straight as well.

use nalgebra::{Isometry3, Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::cartesian::translate;
use super::ik::IkSolver;
use crate::belief::BeliefScene;
use crate::collision::{CollisionChecker, CollisionQuery, Margins};

/// What to try.
#[derive(Debug, Clone)]
pub struct ReachParams {
    /// Corners of the object region on the table, world x and y, metres.
    pub region: [[f64; 2]; 2],
    /// Distance between grid points, metres.
    pub spacing: f64,
    /// Heights of the grasp above the table, metres (the pads reach 0.03 below the gripper's origin).
    pub grasp_heights: Vec<f64>,
    /// Heights of the gripper above the bin's floor at release, metres.
    pub place_heights: Vec<f64>,
    /// Angles of the approach from straight down, radians, leaning so that the wrist is nearer to the robot.
    pub tilts: Vec<f64>,
    /// Headings of the closing axis, so many within half a turn.
    pub headings: usize,
    /// Straight lift after a grasp and before a place, metres.
    pub lift: f64,
    /// Distance of the open pads, metres.
    pub opening: f64,
    /// Whole configuration to start from.
    pub start: Vec<f64>,
}

/// Shares of the poses tried that are within reach, 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct ReachScore {
    /// Straight-down grasps over the region.
    pub top: f64,
    /// Grasps over the region, any of the tilts.
    pub any_tilt: f64,
    /// Places over the bin, straight down.
    pub place_top: f64,
    /// Places over the bin, any of the tilts.
    pub place_any: f64,
    /// Grid cells of the region without any grasp.
    pub dead_cells: f64,
    /// Grid cells of the bin without any place.
    pub dead_place_cells: f64,
}

/// The gripper pointing down, leaning by `tilt` towards the robot (which looks along `forward`), its closing axis
/// turned by `heading` about the approach.
pub fn grasp_orientation(forward: f64, tilt: f64, heading: f64) -> UnitQuaternion<f64> {
    // x down, y along world y, z along world x.
    let down = Matrix3::from_columns(&[-Vector3::z(), Vector3::y(), Vector3::x()]);
    let down = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(down));
    let yaw = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), forward);
    let lean = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -tilt);
    let roll = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), heading);
    yaw * lean * down * roll
}

/// Counts what is within reach in `template` (its objects are ignored).
pub fn reach_score(solver: &IkSolver, template: &BeliefScene, params: &ReachParams) -> ReachScore {
    let mut empty = template.clone();
    empty.objects.clear();
    let checker = CollisionChecker::new(solver.robot().clone(), &empty);
    let base_from_world = empty.world_from_base.iso().inverse();
    let base = empty.world_from_base.translation();

    // (straight, any, cells without any) over a list of points in the world.
    let survey = |points: &[Vector3<f64>], heights: &[f64]| {
        let (mut straight, mut any, mut total, mut dead) = (0usize, 0usize, 0usize, 0usize);
        for point in points {
            let forward = (point.y - base.y).atan2(point.x - base.x);
            let mut reached = false;
            for height in heights {
                for h in 0..params.headings {
                    let heading = std::f64::consts::PI * h as f64 / params.headings as f64;
                    total += 1;
                    for (i, &tilt) in params.tilts.iter().enumerate() {
                        let world_from_gripper = Isometry3::from_parts(
                            (point + Vector3::z() * *height).into(),
                            grasp_orientation(forward, tilt, heading),
                        );
                        if reachable(solver, &checker, params, &(base_from_world * world_from_gripper)) {
                            straight += usize::from(i == 0);
                            any += 1;
                            reached = true;
                            break;
                        }
                    }
                }
            }
            dead += usize::from(!reached);
        }
        let share = |n: usize, of: usize| n as f64 / of.max(1) as f64;
        (share(straight, total), share(any, total), share(dead, points.len()))
    };

    let [low, high] = params.region;
    let on_table: Vec<Vector3<f64>> =
        grid(low, high, params.spacing).map(|[x, y]| Vector3::new(x, y, empty.table_height)).collect();
    let half = empty.bin.inner.map(|v| 0.5 * v - 0.08);
    let in_bin: Vec<Vector3<f64>> = grid(half.map(|v| -v), half, params.spacing)
        .map(|[x, y]| (empty.bin.world_from_bin.iso() * nalgebra::Point3::new(x, y, 0.0)).coords)
        .collect();
    let (top, any_tilt, dead_cells) = survey(&on_table, &params.grasp_heights);
    let (place_top, place_any, dead_place_cells) = survey(&in_bin, &params.place_heights);
    ReachScore { top, any_tilt, place_top, place_any, dead_cells, dead_place_cells }
}

fn grid(low: [f64; 2], high: [f64; 2], spacing: f64) -> impl Iterator<Item = [f64; 2]> {
    let count = |i: usize| ((high[i] - low[i]) / spacing).round().max(0.0) as usize;
    let (nx, ny) = (count(0), count(1));
    let at = move |i: usize, k: usize, n: usize| {
        if n == 0 { 0.5 * (low[i] + high[i]) } else { low[i] + (high[i] - low[i]) * k as f64 / n as f64 }
    };
    (0..=nx).flat_map(move |a| (0..=ny).map(move |b| [at(0, a, nx), at(1, b, ny)]))
}

fn reachable(
    solver: &IkSolver,
    checker: &CollisionChecker,
    params: &ReachParams,
    base_from_gripper: &Isometry3<f64>,
) -> bool {
    let query = CollisionQuery {
        held: None,
        allowed: &[],
        margins: Margins { world: 0.003, own: 0.003, spread: 0.0 },
    };
    if checker.hand_collision(base_from_gripper, params.opening, &query).is_some() {
        return false;
    }
    let mut found = false;
    solver.solutions(base_from_gripper, &params.start, 10, 1, |q| {
        found = checker.in_collision(q, &query).is_none()
            && translate(solver, q, Vector3::z() * params.lift, |_, q| checker.in_collision(q, &query))
                .is_ok();
        found
    });
    found
}
