//! What speaks for the pose estimates of an image, and what against them: all of them are rendered together and compared
//! with the observed depth, pixel by pixel, and their prints with the colours. The truth is not asked.

mod picture;

use std::collections::BTreeMap;
use std::sync::Arc;

use anyhow::{Context, Result};
use grip_perception::ColourEvidence;
use grip_sim::bop::results::Estimate;
use grip_sim::bop::{BopFrame, Dataset};
use grip_sim::images::{Image, LabelImage, RgbImage};
use grip_sim::mesh::Visual;
use grip_sim::pose::Pose;
use grip_sim::render::cpu::CpuRenderer;
use grip_sim::render::{Instance, Lighting, RenderScene, Renderer};
use grip_sim::sensor::color::develop;
use schemars::JsonSchema;
use serde::Serialize;

use crate::benchmark::{camera_frame, object_names};

/// Readings nearer than this to the rendered surface, along the ray, support it, metres.
pub const INLIER_M: f64 = 0.007;
/// Estimates below this confidence are listed and not drawn.
pub const LEAST_SCORE: f64 = 0.05;

/// What is white in pictures of the models, cd/m^2: two thirds of what paper has that faces up in their light, since sides get
/// less of it.
const WHITE_NITS: f32 = 0.65 * 100.0 / std::f32::consts::PI;

/// What the observed depth says of a pixel of a rendered estimate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// The observed surface is where the rendered one is.
    Inlier,
    /// Something was observed nearer, which may hide the object.
    Occluded,
    /// The camera saw through the rendered surface: at this pose something is wrong.
    Violated,
    /// No reading.
    Hole,
}

impl Verdict {
    /// In the order of legends and tables.
    pub const ALL: [Self; 4] = [Self::Inlier, Self::Occluded, Self::Violated, Self::Hole];
}

/// Shares of the verdicts among the pixels that something covers; their sum is 1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Shares {
    /// [`Verdict::Inlier`].
    pub inlier: f64,
    /// [`Verdict::Occluded`].
    pub occluded: f64,
    /// [`Verdict::Violated`].
    pub violated: f64,
    /// [`Verdict::Hole`].
    pub hole: f64,
}

impl Shares {
    /// `None` where nothing is covered.
    fn of(verdicts: impl Iterator<Item = Verdict>) -> Option<Self> {
        let mut counts = [0_usize; 4];
        verdicts.for_each(|verdict| counts[verdict as usize] += 1);
        let all: usize = counts.iter().sum();
        let [inlier, occluded, violated, hole] = counts.map(|count| count as f64 / all as f64);
        (all > 0).then_some(Self { inlier, occluded, violated, hole })
    }

    /// In the order of [`Verdict::ALL`].
    pub fn values(&self) -> [f64; 4] {
        [self.inlier, self.occluded, self.violated, self.hole]
    }
}

/// One estimate, as found.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Explained {
    /// Object.
    pub obj_id: u32,
    /// Its name, where the data set has one.
    pub name: Option<String>,
    /// Confidence, as in the results file.
    pub score: f64,
    /// Whether it is rendered; figures of others are empty.
    pub drawn: bool,
    /// Pixels where it is the nearest of the rendered estimates.
    pub covered_px: usize,
    /// Of these pixels.
    pub shares: Option<Shares>,
    /// Median of observed minus rendered depth over those with a reading, millimetres.
    pub median_residual_mm: Option<f64>,
    /// How what is printed on it agrees with the picture, -1 to 1 (see `agreement` of a posterior's colour); null of an object of
    /// one colour, and where nothing of it is seen.
    pub agreement: Option<f64>,
}

impl Explained {
    /// For people: the name, else the number.
    pub fn title(&self) -> String {
        self.name.clone().unwrap_or_else(|| format!("object {}", self.obj_id))
    }
}

/// An image and its estimates. Images have the size of the frame's.
#[derive(Debug)]
pub struct Explanation {
    /// What was observed.
    frame: BopFrame,
    /// As in the results file, in its order.
    estimates: Vec<Estimate>,
    /// Surfaces, by object.
    models: BTreeMap<u32, Visual>,
    /// Index of the nearest estimate plus one; 0 where none is.
    owner: LabelImage,
    /// Observed minus rendered depth, metres; only where [`verdicts`](Self::verdicts) has one that is no hole.
    residual_m: Image<f32>,
    /// The models at the estimated poses, in even light.
    models_seen: RgbImage,
    /// Where an estimate is.
    verdicts: Image<Option<Verdict>>,
    /// In the order of the estimates.
    pub explained: Vec<Explained>,
    /// Of all pixels that estimates cover.
    pub shares: Option<Shares>,
}

impl Explanation {
    /// Renders the `estimates` of `frame`, those below [`LEAST_SCORE`] only with `all`.
    ///
    /// # Errors
    /// When a model cannot be read or drawn.
    pub fn new(dataset: &Dataset, frame: BopFrame, estimates: Vec<Estimate>, all: bool) -> Result<Self> {
        let mut models = BTreeMap::new();
        let drawn: Vec<bool> =
            estimates.iter().map(|estimate| all || estimate.score >= LEAST_SCORE).collect();
        let mut instances = Vec::new();
        for (i, estimate) in estimates.iter().enumerate().filter(|(i, _)| drawn[*i]) {
            let label =
                u16::try_from(i + 1).context("an image of more than 65535 estimates cannot be drawn")?;
            let visual = load(&mut models, dataset, estimate.obj_id)?.clone();
            instances.push(Instance {
                visual: Arc::new(visual),
                pose: *estimate.camera_from_object.iso(),
                label,
            });
        }
        let scene = RenderScene { instances, bounce: None };
        let mut renderer = CpuRenderer::new().with_smooth_edges(false);
        // The camera is the world.
        let even = Lighting { ambient_lux: 100.0, ..Lighting::default() };
        let rendering = renderer.render(&scene, &even, &frame.intrinsics, &Pose::identity())?;
        let models_seen = develop(&rendering.radiance, WHITE_NITS.recip());

        let (width, height) = (frame.depth.width(), frame.depth.height());
        let mut residual_m = Image::filled(width, height, 0.0);
        let mut verdicts = Image::filled(width, height, None);
        for v in 0..height {
            for u in 0..width {
                if *rendering.labels.at(u, v) == 0 {
                    continue;
                }
                let (observed, rendered) = (*frame.depth.at(u, v), *rendering.depth.at(u, v));
                let residual = observed - rendered;
                let ray = frame.intrinsics.back_project(u as f64, v as f64, 1.0).coords.norm();
                *verdicts.at_mut(u, v) =
                    Some(if observed == 0.0 { Verdict::Hole } else { verdict(f64::from(residual) * ray) });
                *residual_m.at_mut(u, v) = residual;
            }
        }
        let names = object_names(dataset);
        let evidence = ColourEvidence::new(&camera_frame(&frame));
        let agreement = |estimate: &Estimate| {
            let visual = models.get(&estimate.obj_id)?;
            evidence.as_ref()?.agreement(visual, &estimate.camera_from_object)
        };
        let explained = estimates
            .iter()
            .enumerate()
            .map(|(i, estimate)| {
                let pixels = || {
                    let owned = rendering.labels.data().iter().map(move |&label| usize::from(label) == i + 1);
                    let found = verdicts.data().iter().zip(residual_m.data());
                    owned.zip(found).filter_map(|(own, (verdict, residual))| {
                        Some(((*verdict)?, *residual)).filter(|_| own)
                    })
                };
                let read =
                    pixels().filter(|(verdict, _)| *verdict != Verdict::Hole).map(|(_, residual)| residual);
                Explained {
                    obj_id: estimate.obj_id,
                    name: names.get(&estimate.obj_id).cloned(),
                    score: estimate.score,
                    drawn: drawn[i],
                    covered_px: pixels().count(),
                    shares: Shares::of(pixels().map(|(verdict, _)| verdict)),
                    median_residual_mm: median(read.collect()).map(|m| 1e3 * f64::from(m)),
                    agreement: agreement(estimate).filter(|_| drawn[i]),
                }
            })
            .collect();
        let shares = Shares::of(verdicts.data().iter().flatten().copied());
        Ok(Self {
            frame,
            estimates,
            models,
            owner: rendering.labels,
            residual_m,
            models_seen,
            verdicts,
            explained,
            shares,
        })
    }

    /// Reads the models of the truth, for [`picture`](Self::picture) to draw it.
    ///
    /// # Errors
    /// When there is no truth, or a model cannot be read.
    pub fn load_truth(&mut self, dataset: &Dataset) -> Result<()> {
        let BopFrame { scene_id, im_id, ground_truths, .. } = &self.frame;
        let Some(truths) = ground_truths.as_ref().filter(|truths| !truths.is_empty()) else {
            anyhow::bail!(
                "--truth: the data set has no truth of scene {scene_id}, image {im_id}; leave it out"
            );
        };
        truths.iter().try_for_each(|truth| load(&mut self.models, dataset, truth.obj_id).map(drop))
    }
}

/// Of a pixel with a reading, from observed minus rendered distance along its ray, metres.
fn verdict(residual_m: f64) -> Verdict {
    match residual_m {
        r if r.abs() < INLIER_M => Verdict::Inlier,
        r if r < 0.0 => Verdict::Occluded,
        _ => Verdict::Violated,
    }
}

fn median(mut values: Vec<f32>) -> Option<f32> {
    values.sort_by(f32::total_cmp);
    let middle = values.len() / 2;
    let high = *values.get(middle)?;
    Some(if values.len() % 2 == 1 { high } else { 0.5 * (values[middle - 1] + high) })
}

fn load<'a>(models: &'a mut BTreeMap<u32, Visual>, dataset: &Dataset, id: u32) -> Result<&'a Visual> {
    use std::collections::btree_map::Entry;
    Ok(match models.entry(id) {
        Entry::Occupied(entry) => entry.into_mut(),
        Entry::Vacant(entry) => entry.insert(dataset.load_model(id)?),
    })
}
