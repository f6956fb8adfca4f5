//! Pictures of a trial from outside: a strip of each attempt and, if asked for, an animated replay.
//!
//! While the trial runs only poses are kept; everything is drawn afterwards, without sensor noise, by a camera that stands
//! on the other side of the table. Nothing of this is seen by perception or planning.

use std::borrow::Cow;

use anyhow::{Context, Result};
use color_quant::NeuQuant;
use grip_manip::StepName;
use grip_physics::World;
use grip_sim::camera::Intrinsics;
use grip_sim::images::RgbImage;
use grip_sim::pose::{Camera, Pose, World as WorldFrame};
use grip_sim::render::{RenderScene, Renderer};
use grip_sim::scene::Scene;
use grip_sim::sensor::color::{develop, metered};
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};

use crate::pictures;
use crate::progress::Progress;
use crate::setup::Setup;

/// Simulated seconds between pictures of the replay, and how long each is shown, hundredths of a second: four times as fast.
const EVERY_S: f64 = 0.4;
const SHOWN: u16 = 10;
/// Size of a picture.
const STRIP_SIZE: [usize; 2] = [400, 300];
const REPLAY_SIZE: [usize; 2] = [320, 240];
/// Pictures of an attempt: at its beginning, and after these steps.
const MOMENTS: [(StepName, &str); 4] = [
    (StepName::Close, "grasp"),
    (StepName::Lift, "lift"),
    (StepName::Push, "push"),
    (StepName::Retreat, "place"),
];

/// What an attempt looked like.
#[derive(Debug)]
pub struct Strip {
    /// Whom it was for.
    pub object: String,
    /// What they show, and the pictures.
    pub pictures: Vec<(&'static str, RgbImage)>,
}

/// The film in the camera.
pub struct Film<'a> {
    setup: &'a Setup,
    /// Attempts: the object, and the scenes of its moments.
    attempts: Vec<(String, Vec<(&'static str, RenderScene)>)>,
    /// Scenes of the replay; none unless it is recorded.
    replay: Option<Vec<RenderScene>>,
    next_s: f64,
}

impl<'a> Film<'a> {
    /// An empty film; `record` takes the replay too.
    pub fn new(setup: &'a Setup, record: bool) -> Self {
        Self { setup, attempts: Vec::new(), replay: record.then(Vec::new), next_s: 0.0 }
    }

    /// An attempt at `object` begins.
    pub fn begin(&mut self, world: &World, object: &str) {
        self.attempts.push((object.to_string(), vec![("before", self.setup.camera.view(world))]));
    }

    /// A control period is over.
    pub fn tick(&mut self, world: &World) {
        if let Some(replay) = self.replay.as_mut().filter(|_| world.time() >= self.next_s) {
            replay.push(self.setup.camera.view(world));
            self.next_s = world.time() + EVERY_S;
        }
    }

    /// A step of the attempt is over.
    pub fn step_done(&mut self, world: &World, step: StepName) {
        let moment = MOMENTS.iter().find(|(name, _)| *name == step);
        if let (Some((_, name)), Some((_, moments))) = (moment, self.attempts.last_mut()) {
            moments.push((name, self.setup.camera.view(world)));
        }
    }

    /// Draws the strips.
    ///
    /// # Errors
    /// When the renderer fails.
    pub fn strips(&self, renderer: &mut dyn Renderer, progress: &dyn Progress) -> Result<Vec<Strip>> {
        progress.message("drawing the film strips");
        let mut draw = Drawing::new(self.setup, renderer, STRIP_SIZE);
        self.attempts
            .iter()
            .map(|(object, moments)| {
                let pictures = moments
                    .iter()
                    .map(|(name, scene)| Ok((*name, draw.picture(scene)?)))
                    .collect::<Result<_>>()?;
                Ok(Strip { object: object.clone(), pictures })
            })
            .collect()
    }

    /// Draws the replay as an animated GIF; none if it was not recorded.
    ///
    /// # Errors
    /// When the renderer or the encoder fails.
    pub fn replay(&self, renderer: &mut dyn Renderer, progress: &dyn Progress) -> Result<Option<Vec<u8>>> {
        let Some(scenes) = self.replay.as_ref().filter(|scenes| !scenes.is_empty()) else {
            return Ok(None);
        };
        let mut draw = Drawing::new(self.setup, renderer, REPLAY_SIZE);
        let mut pictures = Vec::with_capacity(scenes.len());
        for (i, scene) in scenes.iter().enumerate() {
            progress.message(&format!("drawing the replay: {} of {}", i + 1, scenes.len()));
            pictures.push(draw.picture(scene)?);
        }
        Ok(Some(animation(&pictures)?))
    }
}

/// Draws scenes as the outside camera sees them, all at the exposure of the first.
struct Drawing<'a> {
    setup: &'a Setup,
    renderer: &'a mut dyn Renderer,
    intrinsics: Intrinsics,
    world_from_camera: Pose<WorldFrame, Camera>,
    exposure: Option<f32>,
}

impl<'a> Drawing<'a> {
    fn new(setup: &'a Setup, renderer: &'a mut dyn Renderer, [width, height]: [usize; 2]) -> Self {
        // 55 degrees wide.
        let f = 0.96 * width as f64;
        let (cx, cy) = (0.5 * (width as f64 - 1.0), 0.5 * (height as f64 - 1.0));
        Self {
            setup,
            renderer,
            intrinsics: Intrinsics { width, height, fx: f, fy: f, cx, cy },
            world_from_camera: outside(&setup.cell.scene),
            exposure: None,
        }
    }

    fn picture(&mut self, scene: &RenderScene) -> Result<RgbImage> {
        let lighting = &self.setup.condition.lighting;
        let rendering = self.renderer.render(scene, lighting, &self.intrinsics, &self.world_from_camera)?;
        let exposure = *self.exposure.get_or_insert_with(|| metered(&rendering.radiance));
        Ok(develop(&rendering.radiance, exposure))
    }
}

/// Across the table from the robot and to its left, where hand, objects and bin are seen at once.
fn outside(scene: &Scene) -> Pose<WorldFrame, Camera> {
    let base = scene.world_from_base().translation();
    let table = Vector3::new(scene.table.center[0], scene.table.center[1], scene.table.height);
    let mut away = table - base;
    away.z = 0.0;
    let away = away.try_normalize(1e-9).unwrap_or_else(Vector3::x);
    let left = Vector3::z().cross(&away);
    let eye = table + away * 1.2 + left * 0.6 + Vector3::z() * 0.85;
    let target = table - away * 0.15 - left * 0.08 + Vector3::z() * 0.17;
    looking(eye, target)
}

/// A camera at `eye` that looks at `target`, upright.
fn looking(eye: Vector3<f64>, target: Vector3<f64>) -> Pose<WorldFrame, Camera> {
    let forward = (target - eye).normalize();
    let right = forward.cross(&Vector3::z()).normalize();
    let axes = Matrix3::from_columns(&[right, forward.cross(&right), forward]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    Pose::new(Isometry3::from_parts(Point3::from(eye).into(), rotation))
}

/// An animated GIF that repeats. One palette for all pictures, and only what changed from picture to picture: small.
fn animation(pictures: &[RgbImage]) -> Result<Vec<u8>> {
    /// The palette's last entry means "as before".
    const SAME: u8 = 255;
    /// Pixels that the palette is learnt from.
    const SAMPLES: usize = 200_000;
    let first = pictures.first().context("no pictures")?;
    let (width, height) = (u16::try_from(first.width())?, u16::try_from(first.height())?);
    let all = pictures.len() * first.pixels().len();
    let sample: Vec<u8> = pictures
        .iter()
        .flat_map(RgbImage::pixels)
        .step_by(all.div_ceil(SAMPLES).max(1))
        .flat_map(|p| [p[0], p[1], p[2], 255])
        .collect();
    let colors = NeuQuant::new(1, usize::from(SAME), &sample);
    let mut palette = colors.color_map_rgb();
    palette.resize(3 * 256, 0);

    let mut bytes = Vec::new();
    let mut encoder = gif::Encoder::new(&mut bytes, width, height, &palette)?;
    encoder.set_repeat(gif::Repeat::Infinite)?;
    let mut shown: Vec<u8> = Vec::new();
    for (i, picture) in pictures.iter().enumerate() {
        let indices: Vec<u8> =
            picture.pixels().map(|p| colors.index_of(&[p[0], p[1], p[2], 255]) as u8).collect();
        let last = i + 1 == pictures.len();
        let changed = indices
            .iter()
            .enumerate()
            .map(|(k, &c)| if shown.get(k) == Some(&c) { SAME } else { c })
            .collect::<Vec<u8>>();
        encoder.write_frame(&gif::Frame {
            width,
            height,
            // The end stays for two seconds.
            delay: if last { 200 } else { SHOWN },
            transparent: Some(SAME),
            dispose: gif::DisposalMethod::Keep,
            buffer: Cow::Owned(changed),
            ..gif::Frame::default()
        })?;
        shown = indices;
    }
    drop(encoder);
    Ok(bytes)
}

/// All strips below each other, each with the object's name.
pub fn sheet(strips: &[Strip]) -> RgbImage {
    let columns = strips.iter().map(|strip| strip.pictures.len()).max().unwrap_or(0).max(1);
    let [width, height] = STRIP_SIZE.map(|n| n as u32);
    let mut cells = Vec::new();
    for strip in strips {
        for k in 0..columns {
            let mut cell = match strip.pictures.get(k) {
                Some((_, picture)) => picture.clone(),
                None => RgbImage::from_pixel(width, height, image::Rgb([235; 3])),
            };
            match strip.pictures.get(k) {
                Some(("before", _)) => pictures::write_text(&mut cell, &strip.object),
                Some((name, _)) => pictures::write_text(&mut cell, name),
                None => {}
            }
            cells.push(cell);
        }
    }
    pictures::sheet(&cells, columns as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_camera_sees_what_it_looks_at_in_the_middle_and_the_world_upright() {
        let camera = looking(Vector3::new(2.0, 0.5, 1.5), Vector3::new(0.5, 0.0, 0.7));
        let seen = |x: f64, y: f64, z: f64| camera.inverse().transform_point(&Point3::new(x, y, z));
        let target = seen(0.5, 0.0, 0.7);
        assert!(target.x.abs() < 1e-9 && target.y.abs() < 1e-9 && target.z > 1.0);
        assert!(seen(0.5, 0.0, 0.9).y < 0.0, "what is higher is higher in the picture");
        assert!(seen(0.5, 0.3, 0.7).x > 0.0, "seen from beyond, the robot's left is on the right");
    }

    #[test]
    fn an_animation_is_read_back_with_what_did_not_change_left_out() {
        // A grey gradient, and a red square that moves on it.
        let frame = |at: u32| {
            RgbImage::from_fn(64, 48, |x, y| {
                let inside = x >= at && x < at + 8 && (10..18).contains(&y);
                image::Rgb(if inside { [220, 20, 20] } else { [(x * 3) as u8; 3] })
            })
        };
        let pictures: Vec<RgbImage> = (0..20).map(|i| frame(2 * i)).collect();
        let bytes = animation(&pictures).unwrap();
        assert!(bytes.len() < 20 * 64 * 48 / 4, "{}", bytes.len());
        let mut options = gif::DecodeOptions::new();
        options.set_color_output(gif::ColorOutput::RGBA);
        let mut decoder = options.read_info(bytes.as_slice()).unwrap();
        let mut shown = vec![0; 64 * 48 * 4];
        let mut count = 0;
        while let Some(next) = decoder.read_next_frame().unwrap() {
            for (k, pixel) in next.buffer.chunks(4).enumerate().filter(|(_, p)| p[3] > 0) {
                shown[4 * k..4 * k + 4].copy_from_slice(pixel);
            }
            for (k, pixel) in pictures[count].pixels().enumerate() {
                let off = (0..3).map(|c| shown[4 * k + c].abs_diff(pixel[c])).max().unwrap();
                assert!(off <= 12, "frame {count}, pixel {k}: off by {off}");
            }
            count += 1;
        }
        assert_eq!(count, 20);
    }
}
