//! Drawings of solids with lines in space: what is behind a surface shows through faintly.

use anyhow::Result;
use grip_sim::camera::Intrinsics;
use grip_sim::images::{DepthImage, RgbImage};
use grip_sim::pose::{Camera, Pose, World};
use grip_sim::render::{Light, Lighting, RenderScene, Renderer};
use grip_sim::sensor::color::develop;
use nalgebra::{Point3, Vector3};

use super::draw::line;

/// Behind what is solid by no more than this, a line is seen, metres: so it may lie on a surface.
const ON_SURFACE_M: f64 = 0.003;
/// Of a hidden line: its width and the share of its colour.
const HIDDEN: (f64, f64) = (0.5, 0.45);
/// Behind everything.
const PAPER: [u8; 3] = [244, 245, 247];
/// Pixels of a line that are seen or hidden as one.
const PIECE: f64 = 3.0;
/// White paper in the light has this share of full scale.
const EXPOSED: f32 = 0.0045;

/// A picture of solids in even light.
pub struct Drawing {
    /// So far.
    pub picture: RgbImage,
    depth: DepthImage,
    lens: Intrinsics,
    camera_from_world: Pose<Camera, World>,
}

impl Drawing {
    /// Draws the solids, on paper.
    ///
    /// # Errors
    /// When the renderer fails.
    pub fn of(
        scene: &RenderScene,
        renderer: &mut dyn Renderer,
        lens: &Intrinsics,
        camera: &Pose<World, Camera>,
    ) -> Result<Self> {
        let rendering = renderer.render(scene, &studio(camera), lens, camera)?;
        let mut picture = develop(&rendering.radiance, EXPOSED);
        for (pixel, metres) in picture.pixels_mut().zip(rendering.depth.data()) {
            if *metres <= 0.0 {
                pixel.0 = PAPER;
            }
        }
        Ok(Self { picture, depth: rendering.depth, lens: *lens, camera_from_world: camera.inverse() })
    }

    /// A line with dark edges where it is seen.
    pub fn edged_line(&mut self, from: Point3<f64>, to: Point3<f64>, width: f64, color: [u8; 3]) {
        self.stroke(from, to, width + 2.0, [30; 3], false);
        self.line(from, to, width, color);
    }

    /// A line in space; where a solid hides it, it is thin and faint.
    pub fn line(&mut self, from: Point3<f64>, to: Point3<f64>, width: f64, color: [u8; 3]) {
        self.stroke(from, to, width, color, true);
    }

    fn stroke(&mut self, from: Point3<f64>, to: Point3<f64>, width: f64, color: [u8; 3], through: bool) {
        let [a, b] = [from, to].map(|p| self.camera_from_world.transform_point(&p));
        let (Some(start), Some(end)) = (self.lens.project(&a), self.lens.project(&b)) else { return };
        let pieces = ((end - start).norm() / PIECE).ceil().clamp(1.0, 2000.0) as usize;
        let at = |k: usize| a + (b - a) * (k as f64 / pieces as f64);
        for k in 0..pieces {
            let (p, q) = (at(k), at(k + 1));
            let (Some(u), Some(v)) = (self.lens.project(&p), self.lens.project(&q)) else { continue };
            let hidden = self.hides(&nalgebra::center(&p, &q));
            if hidden && !through {
                continue;
            }
            let (width, color) = if hidden {
                let faint =
                    |c: u8, under: u8| (HIDDEN.1 * f64::from(c) + (1.0 - HIDDEN.1) * f64::from(under)) as u8;
                (HIDDEN.0 * width, [0, 1, 2].map(|i| faint(color[i], PAPER[i])))
            } else {
                (width, color)
            };
            line(&mut self.picture, [u.x, u.y], [v.x, v.y], width, color);
        }
    }

    /// A disc about a point in space, over everything.
    pub fn dot(&mut self, at: Point3<f64>, radius: f64, color: [u8; 3]) {
        if let Some(pixel) = self.lens.project(&self.camera_from_world.transform_point(&at)) {
            super::disc(&mut self.picture, [pixel.x, pixel.y], radius + 1.5, [0; 3]);
            super::disc(&mut self.picture, [pixel.x, pixel.y], radius, color);
        }
    }

    /// Distance from the camera along its axis, metres: what is farther is drawn first.
    pub fn distance(&self, at: &Point3<f64>) -> f64 {
        self.camera_from_world.transform_point(at).z
    }

    /// Whether a solid is before a point of the camera's frame.
    fn hides(&self, p: &Point3<f64>) -> bool {
        let Some(pixel) = self.lens.project(p) else { return false };
        let (u, v) = (pixel.x.round(), pixel.y.round());
        if u < 0.0 || v < 0.0 || u >= self.lens.width as f64 || v >= self.lens.height as f64 {
            return false;
        }
        let metres = f64::from(*self.depth.at(u as usize, v as usize));
        metres > 0.0 && metres < p.z - ON_SURFACE_M
    }
}

/// Light from all sides, and more from over the camera's left shoulder.
fn studio(camera: &Pose<World, Camera>) -> Lighting {
    let away = 4.0;
    let eye = camera.translation();
    let target = eye + camera.transform_vector(&Vector3::z());
    let light = Light {
        position: eye + camera.transform_vector(&Vector3::new(-0.6, -1.0, -0.4)) * away,
        target,
        intensity_cd: 340.0 * away * away,
        color: [1.0; 3],
        radius: 0.5,
        half_angle: 1.2,
        shadows: false,
    };
    Lighting { ambient_lux: 380.0, ambient_color: [1.0; 3], lights: vec![light] }
}
