//! What the benches time: the filters' inner parts on frames made for them. Only with the feature `bench`.

use std::sync::Arc;

use grip_sim::camera::Intrinsics;
use grip_sim::frame::CameraFrame;
use grip_sim::images::{Image, RgbImage};
use grip_sim::objects::ObjectModel;
use grip_sim::pose::Pose;
use grip_sim::rng;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::detector::{Detection, Detections};
use crate::error::Result;
use crate::hypotheses::{Batch, Hypotheses, Isa, Raster, render_on};
use crate::model::Model;
use crate::observation::{Observation, ObservationSettings, Stride};
use crate::paper::{PaperSettings, Prepared};
use crate::sampling::small_rotation;
use crate::support::SupportSettings;

/// Standard deviation of the depth noise, metres.
const NOISE_M: f32 = 0.001;
/// Triangles of the mesh that the frame shows.
const SHOWN: usize = 5000;

/// An object on a table before the camera, and hypotheses about its pose.
#[derive(Debug)]
pub struct Workbench {
    /// What the camera sees.
    pub frame: CameraFrame,
    /// The object's box and four false ones.
    pub detections: Detections,
    model: Arc<Model>,
    observation: Observation,
    poses: Vec<Isometry3<f32>>,
}

impl Workbench {
    /// `object`, turned by a little, so far from a camera that looks 40 degrees down on the table under it, and `hypotheses`
    /// scattered by 1 cm and 0.2 rad about its pose.
    ///
    /// # Errors
    /// For an object without a surface.
    pub fn new(object: &Arc<ObjectModel>, distance_m: f32, hypotheses: usize) -> Result<Self> {
        let model = Arc::new(Model::new(object, &[60, 200, 500, 1000, SHOWN])?);
        let Stage { frame, truths, detections, mut random } =
            Stage::new(std::slice::from_ref(&model), &[[0.0; 2]], distance_m)?;
        let truth = truths[0];
        let poses = (0..hypotheses)
            .map(|_| {
                let shift = Vector3::from_fn(|_, _| 0.01 * normal(&mut random));
                let rotation = small_rotation(0.2, &mut random) * truth.rotation;
                Isometry3::from_parts(Translation3::from(truth.translation.vector + shift), rotation)
            })
            .collect();
        let observation = Observation::new(&frame, &settings(), None);
        Ok(Self { frame, detections, model, observation, poses })
    }

    /// A frame of several objects on one table, 0.2 m apart, and their boxes among false ones, as for one.
    ///
    /// # Errors
    /// For an object without a surface.
    pub fn together(objects: &[Arc<ObjectModel>], distance_m: f32) -> Result<(CameraFrame, Detections)> {
        let model = |object: &Arc<ObjectModel>| Ok(Arc::new(Model::new(object, &[60, SHOWN])?));
        let models: Vec<Arc<Model>> = objects.iter().map(model).collect::<Result<_>>()?;
        let place = |i: usize| [0.2 * (i % 3) as f32 - 0.2, 0.2 * (i / 3) as f32];
        let places: Vec<[f32; 2]> = (0..models.len()).map(place).collect();
        let stage = Stage::new(&models, &places, distance_m)?;
        Ok((stage.frame, stage.detections))
    }

    /// Instruction sets that this machine has, the plainest first.
    pub fn isas() -> Vec<Isa> {
        Isa::available()
    }

    /// Draws all hypotheses; the number of those that can be drawn.
    pub fn render(&self, isa: Isa, stride: Stride, triangles: usize) -> usize {
        let mut raster = Raster::default();
        let (lod, level) = (self.model.lod(triangles), self.observation.level(stride));
        let drawn = |pose| render_on(isa, &mut raster, lod, pose, level, None).is_some();
        self.poses.iter().map(drawn).filter(|drawn| *drawn).count()
    }

    /// Moves all hypotheses by `steps`, draws and compares them; the sum of the inliers' kernels.
    ///
    /// # Errors
    /// None on the CPU.
    pub fn advance(
        &self,
        renderer: &mut dyn Hypotheses,
        stride: Stride,
        triangles: usize,
        steps: usize,
    ) -> Result<f32> {
        let batch = Batch {
            lod: self.model.lod(triangles),
            radius: self.model.radius,
            observation: &self.observation,
            stride,
            kernel: 2.0,
            steps,
            damping: 0.01,
            converged_m: 0.0,
        };
        let mut poses = self.poses.clone();
        Ok(renderer.advance(&batch, &mut poses)?.iter().flatten().map(|r| r.terms.fit).sum())
    }

    /// The frame as the paper's filter wants it.
    pub fn paper<'a>(&'a self, settings: &'a PaperSettings) -> Paper<'a> {
        Paper { bench: self, prepared: Prepared::new(settings, &self.frame) }
    }
}

/// Objects on a table before the camera.
struct Stage {
    frame: CameraFrame,
    truths: Vec<Isometry3<f32>>,
    detections: Detections,
    random: ChaCha8Rng,
}

impl Stage {
    /// The first is so far from the camera; places are to the right and away from it, metres.
    fn new(models: &[Arc<Model>], places: &[[f32; 2]], distance_m: f32) -> Result<Self> {
        let k = Intrinsics::FETCH;
        let down = 40.0f32.to_radians();
        let tilt = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f32::consts::FRAC_PI_2 + down);
        let rotation = tilt * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.4);
        let up = tilt * Vector3::z();
        let away = Vector3::x().cross(&up);
        let low = |model: &Model| model.hull.iter().map(|p| (rotation * p).dot(&up)).fold(f32::MAX, f32::min);
        // The table is under the lowest point of the first, and of all others.
        let table = Vector3::z() * distance_m + up * low(&models[0]);
        let height = table.dot(&up);
        let truth = |(model, [right, far]): (&Arc<Model>, &[f32; 2])| {
            let position = table + Vector3::x() * *right + away * *far - up * low(model);
            Isometry3::from_parts(Translation3::from(position), rotation)
        };
        let truths: Vec<Isometry3<f32>> = models.iter().zip(places).map(truth).collect();
        let mut frame = CameraFrame {
            rgb: RgbImage::new(k.width as u32, k.height as u32),
            depth: Image::filled(k.width, k.height, 0.0f32),
            intrinsics: k,
            world_from_camera: Pose::identity(),
        };
        for v in 0..k.height {
            for u in 0..k.width {
                let ray = k.back_project(u as f64, v as f64, 1.0).coords.cast::<f32>();
                let z = height / ray.dot(&up);
                *frame.depth.at_mut(u, v) = if (0.2..4.0).contains(&z) { z } else { 0.0 };
            }
        }
        let mut raster = Raster::default();
        let empty = Observation::new(&frame, &settings(), None);
        let mut detections = Detections::new();
        for (model, truth) in models.iter().zip(&truths) {
            let mut bounds = [0.0; 4];
            if let Some(extent) =
                render_on(Isa::BASE, &mut raster, model.lod(SHOWN), truth, empty.level(Stride::One), None)
            {
                bounds = extent.bounds.map(f64::from);
                for (u, v, w) in raster.tile.pixels() {
                    if u >= 0 && v >= 0 && (u as usize) < k.width && (v as usize) < k.height {
                        let z = frame.depth.at_mut(u as usize, v as usize);
                        *z = z.min(1.0 / w);
                    }
                }
            }
            let moved = |by: f64| [bounds[0] + by, bounds[1], bounds[2] + by, bounds[3]];
            for (by, confidence) in [(0.0, 0.6), (-160.0, 0.1), (-80.0, 0.1), (80.0, 0.1), (160.0, 0.1)] {
                detections.push(&model.name, Detection { bbox: moved(by), confidence })?;
            }
        }
        let mut random = rng::stream(1, "workbench");
        for z in frame.depth.data_mut() {
            if *z > 0.0 {
                *z += NOISE_M * normal(&mut random);
            }
        }
        Ok(Self { frame, truths, detections, random })
    }
}

/// The camera's tilt is not told.
fn settings() -> ObservationSettings {
    let support = SupportSettings { max_tilt_rad: SupportSettings::ANY_TILT, ..SupportSettings::default() };
    ObservationSettings { support, ..ObservationSettings::default() }
}

/// The paper's filter before its next iteration.
#[derive(Debug)]
pub struct Paper<'a> {
    bench: &'a Workbench,
    prepared: Prepared<'a>,
}

impl Paper<'_> {
    /// W of all hypotheses at full resolution, in parallel; the largest.
    pub fn iteration(&self) -> f32 {
        let Workbench { model, detections, poses, .. } = self.bench;
        self.prepared.iteration(model, detections.of(&model.name), poses)
    }
}

fn normal(random: &mut impl Rng) -> f32 {
    StandardNormal.sample(random)
}
