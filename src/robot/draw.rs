//! The robot in its named poses, from the front and from the side.

use anyhow::Result;
use grip_sim::camera::Intrinsics;
use grip_sim::images::RgbImage;
use grip_sim::render::Renderer;
use grip_sim::scene::CameraPlace;
use grip_sim::sensor::color::{develop, metered};
use nalgebra::{Point3, Vector3};

use crate::pictures;
use crate::setup::Setup;

/// Size of a picture.
const SIZE: [usize; 2] = [400, 400];
/// Focal length as a share of the width: 53 degrees wide.
const FOCAL: f64 = 1.0;
/// What is around the frames of links, metres.
const AROUND_M: f64 = 0.15;
/// Where the camera is, from the robot: x ahead, y to the left.
const VIEWS: [(&str, [f64; 3]); 2] = [("front", [1.0, 0.35, 0.45]), ("side", [0.15, -1.0, 0.3])];

/// One row a named pose: from the front and from the side, at the robot's place in its scene.
///
/// # Errors
/// When the renderer fails, or a pose cannot be simulated.
pub fn portrait(setup: &Setup, renderer: &mut dyn Renderer) -> Result<RgbImage> {
    let cell = &setup.cell;
    let world_from_base = *cell.scene.world_from_base().iso();
    let mut views = Vec::new();
    let mut points: Vec<Point3<f64>> = Vec::new();
    for (name, pose) in &cell.config.poses {
        let mut q = cell.start.clone();
        pose.apply(&mut q);
        let links = cell.robot.fk(&q);
        points.extend(links.iter().map(|link| world_from_base * Point3::from(link.translation.vector)));
        views.push((name, setup.camera.view(&setup.empty_world(q)?)));
    }
    let middle = points.iter().fold(Vector3::zeros(), |sum, p| sum + p.coords) / points.len().max(1) as f64;
    let radius = points.iter().map(|p| (p.coords - middle).norm()).fold(0.0, f64::max) + AROUND_M;
    let [width, height] = SIZE;
    let focal = FOCAL * width as f64;
    let (cx, cy) = (0.5 * (width as f64 - 1.0), 0.5 * (height as f64 - 1.0));
    let intrinsics = Intrinsics { width, height, fx: focal, fy: focal, cx, cy };
    let distance = radius * (1.0 + 4.0 * FOCAL * FOCAL).sqrt();
    let lighting = &setup.condition.lighting;
    let mut cells = Vec::new();
    for (name, view) in &views {
        for (from, direction) in VIEWS {
            let away = world_from_base * Vector3::from(direction).normalize();
            let eye = middle + away * distance;
            let place =
                CameraPlace { eye: Some(eye.into()), target: Some(middle.into()), ..CameraPlace::default() };
            let Some(camera) = place.in_room() else { continue };
            let rendering = renderer.render(view, lighting, &intrinsics, &camera)?;
            let mut picture = develop(&rendering.radiance, metered(&rendering.radiance));
            pictures::write_text(&mut picture, &format!("{name}, {from}"));
            cells.push(picture);
        }
    }
    Ok(pictures::sheet(&cells, VIEWS.len() as u32))
}
