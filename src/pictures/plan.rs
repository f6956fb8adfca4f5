//! A planned motion: the robot at its start and at its goal among what is in its way, and the path of its hand.

use std::sync::Arc;

use anyhow::{Context, Result};
use grip_manip::Trajectory;
use grip_manip::benchmark::MotionProblem;
use grip_sim::images::RgbImage;
use grip_sim::mesh::{Material, Mesh, Visual};
use grip_sim::objects::mass::hull;
use grip_sim::render::{Instance, RenderScene, Renderer};
use grip_sim::robot::RobotModel;
use grip_sim::shape::{CollisionShape, Convex};
use nalgebra::{Isometry3, Point3, Vector3};

use super::camera::{fitted, lens};
use super::sheet;
use super::solid::Drawing;
use super::text::{Tone, caption, captioned};

const SIZE: [usize; 2] = [560, 420];
/// How wide the lens is, degrees.
const WIDE_DEG: f64 = 40.0;
/// From where it is seen: x ahead of the robot, y to its left.
const VIEWS: [(&str, [f64; 3]); 2] = [("from the front", [1.0, 0.55, 0.5]), ("from above", [0.25, 0.0, 1.0])];
/// The hand's path from start to goal.
const START: [u8; 3] = [20, 150, 60];
const GOAL: [u8; 3] = [215, 40, 130];
/// Obstacles, sRGB.
const OBSTACLE: [f32; 3] = [0.72, 0.66, 0.55];
/// Pieces that a round obstacle is drawn of.
const ROUND: usize = 32;
/// Pieces of the path.
const PIECES: usize = 120;

/// Two rows: from the front and from above; in each the robot at the start and at the goal. World is the robot's base frame, in which the
/// problem is. `link` is the hand's.
///
/// # Errors
/// When the renderer fails.
pub fn plan(
    robot: &RobotModel,
    link: usize,
    problem: &MotionProblem,
    trajectory: &Trajectory,
    renderer: &mut dyn Renderer,
) -> Result<RgbImage> {
    let at = |seconds: f64| {
        let mut q = problem.start.clone();
        for (&joint, value) in trajectory.joints.iter().zip(trajectory.sample(seconds).0) {
            q[joint] = value;
        }
        q
    };
    let path: Vec<Point3<f64>> = (0..=PIECES)
        .map(|k| at(trajectory.duration * k as f64 / PIECES as f64))
        .map(|q| robot.fk_link(&q, link).translation.vector.into())
        .collect();
    let ends = [("start", at(0.0)), ("goal", at(trajectory.duration))];
    let obstacles = problem.obstacles.iter().map(solid).collect::<Result<Vec<_>>>()?;
    let lens = lens(SIZE, WIDE_DEG);
    let shown = outline(robot, &ends.each_ref().map(|(_, q)| q.as_slice()), &path);
    let mut cells = Vec::new();
    for (from, direction) in VIEWS {
        let camera = fitted(&shown, Vector3::from(direction).normalize(), &lens);
        for (end, q) in &ends {
            let mut instances = obstacles.clone();
            for (link, pose) in robot.links().iter().zip(robot.fk(q)) {
                instances.extend(link.visuals.iter().map(|drawn| Instance {
                    visual: drawn.visual.clone(),
                    pose: pose * drawn.pose,
                    label: 1,
                }));
            }
            let scene = RenderScene { instances, bounce: None };
            let mut drawing = Drawing::of(&scene, renderer, &lens, &camera)?;
            for (k, piece) in path.windows(2).enumerate() {
                drawing.line(piece[0], piece[1], 5.0, mix(k as f64 / (path.len() - 2) as f64));
            }
            for (at, color) in path.first().zip(Some(START)).into_iter().chain(path.last().zip(Some(GOAL))) {
                drawing.dot(*at, 5.0, color);
            }
            cells.push(captioned(&drawing.picture, &format!("{end}, {from}"), Tone::Plain));
        }
    }
    let sheet_of_views = sheet(&cells, ends.len() as u32);
    let title = format!("{}: the hand's path, {:.2} s, green to magenta", problem.name, trajectory.duration);
    Ok(sheet(&[caption(sheet_of_views.width(), &title, Tone::Title), sheet_of_views], 1))
}

fn mix(share: f64) -> [u8; 3] {
    [0, 1, 2].map(|i| (f64::from(START[i]) * (1.0 - share) + f64::from(GOAL[i]) * share).round() as u8)
}

/// Frames of all links with some room about them, and the path.
fn outline(robot: &RobotModel, ends: &[&[f64]], path: &[Point3<f64>]) -> Vec<Point3<f64>> {
    const AROUND_M: f64 = 0.1;
    let frames = ends.iter().flat_map(|q| robot.fk(q)).map(|pose| Point3::from(pose.translation.vector));
    let around = |p: Point3<f64>| {
        [1.0, -1.0]
            .into_iter()
            .flat_map(move |sign| (0..3).map(move |a| p + Vector3::ith(a, sign * AROUND_M)))
    };
    frames.chain(path.iter().copied()).flat_map(around).collect()
}

/// A convex solid, to be drawn.
fn solid(shape: &CollisionShape) -> Result<Instance> {
    let turn = |k: usize| std::f64::consts::TAU * k as f64 / ROUND as f64;
    let points: Vec<Point3<f64>> = match &shape.geometry {
        Convex::Cuboid { half } => (0..8)
            .map(|k| Point3::from([0, 1, 2].map(|a| if k >> a & 1 == 1 { half[a] } else { -half[a] })))
            .collect(),
        Convex::Cylinder { half_height, radius } => (0..2 * ROUND)
            .map(|k| {
                let (sin, cos) = turn(k / 2).sin_cos();
                Point3::new(radius * cos, radius * sin, if k % 2 == 0 { *half_height } else { -half_height })
            })
            .collect(),
        Convex::Sphere { radius } => (0..=ROUND / 2)
            .flat_map(|row| (0..ROUND).map(move |k| (turn(row).cos(), turn(row).sin(), turn(k))))
            .map(|(z, r, turn)| Point3::new(r * turn.cos(), r * turn.sin(), z) * *radius)
            .collect(),
        Convex::Hull { points } => points.clone(),
    };
    let positions = points.iter().map(|p| p.cast::<f32>()).collect();
    let mesh = hull(&Mesh { positions, ..Mesh::default() }).context("an obstacle without volume")?;
    let material = Material { base_color: OBSTACLE, ..Material::default() };
    let visual = Arc::new(Visual { mesh: Arc::new(mesh.compute_normals(0.5)), material });
    Ok(Instance { visual, pose: Isometry3::clone(&shape.pose), label: 0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solids_are_drawn_as_large_as_they_are() {
        let volume = |geometry: Convex| {
            let drawn = solid(&CollisionShape { pose: Isometry3::identity(), geometry }).unwrap();
            drawn.visual.mesh.volume()
        };
        let near = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 0.02, "{a} {b}");
        near(volume(Convex::Cuboid { half: Vector3::new(0.1, 0.2, 0.3) }), 0.048);
        near(
            volume(Convex::Cylinder { half_height: 0.8, radius: 0.05 }),
            std::f64::consts::PI * 0.0025 * 1.6,
        );
        near(volume(Convex::Sphere { radius: 0.2 }), 4.0 / 3.0 * std::f64::consts::PI * 0.008);
        let flat = Convex::Hull { points: vec![Point3::origin(); 4] };
        assert!(solid(&CollisionShape { pose: Isometry3::identity(), geometry: flat }).is_err());
    }
}
