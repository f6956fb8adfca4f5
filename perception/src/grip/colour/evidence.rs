//! One pose against the picture: how likely are the colours that are seen where its points are?
//!
//! The picture of a point is modelled as `gain * light * colour + veil`: gain is exposure times brightness of the light, light
//! its colour, veil what a glossy surface mirrors of the room. What is compared is the logarithm, in which gain, light and
//! shading are sums: gain and light are fitted to each pose, light within bounds, and shading is taken out as the median over
//! a patch of the image. Residuals, in units of model error and noise of the image together, go through Geman and McClure's
//! function, which bounds what a point can say: highlights, edges of shadows and what hides the object are outliers.

use nalgebra::Isometry3;

use super::picture::{Picture, PictureLevel};
use crate::grip::settings::ColourSettings;
use crate::model::{Print, PrintedPoint};
use crate::observation::{Level, Observation};

/// Points that face away more than this (cosine) are too slanted to be read.
const SLANTED: f32 = 0.3;
/// A point is seen where the reading is this many epsilons off at most.
const SEEN: f32 = 1.5;
/// Veil, as a share of a white surface's light.
const VEIL: f32 = 0.1;
/// The light's colour departs from white by this factor at most, as a logarithm: cameras balance white.
const TINT: f32 = 0.5;
/// Model error of log brightness after shading is taken out, and of the log ratios of channels.
const BRIGHTNESS_ERROR: f32 = 0.2;
const COLOUR_ERROR: f32 = 0.25;
/// The most that one residual can cost, nats: a normal law's for 2.4 standard deviations.
const MOST: f32 = 3.0;
/// Noise is taken for this many times of what is measured: what the median misses of its tails.
const NOISE: f32 = 1.5;
/// A patch of the image is this many points wide.
const PATCH: f32 = 6.0;
/// Patches with fewer points say nothing.
const FEWEST: u32 = 4;
/// Of each so many points one serves to fit gain and light.
const FITTED: usize = 4;
/// Least points to fit them.
const LEAST: usize = 30;
/// Less gain is no light: a white surface would be darker than a tenth of the first 8-bit code.
const DIMMEST: f32 = 3e-5;
/// Brightness of RGB.
const BRIGHTNESS: [f32; 3] = [0.3, 0.4, 0.3];

/// The picture and depth image at the resolution at which an object is compared.
#[derive(Debug)]
pub(super) struct View<'a> {
    picture: &'a PictureLevel,
    depth: &'a Level,
    /// Side of a patch, pixels of the level.
    patch: f32,
    /// Patches a row.
    columns: usize,
    rows: usize,
}

/// What a pose says of each patch.
#[derive(Debug)]
pub(super) struct Evidence {
    /// Points seen.
    pub points: usize,
    /// Points and the sum of their log-likelihoods, by patch.
    patches: Vec<(u32, f32)>,
}

/// Evidence for one pose against another.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Against {
    /// Log-likelihood ratio, nats.
    pub total: f32,
    /// The same a point.
    pub gain: f32,
    /// See [`crate::ColourVerdict::consistency`].
    pub consistency: f32,
}

impl Against {
    /// Whether it is enough to decide.
    pub fn decides(&self, settings: &ColourSettings) -> bool {
        self.gain >= settings.min_gain && self.consistency >= settings.min_consistency
    }
}

/// A point where it is seen.
struct Seen {
    patch: u32,
    colour: [f32; 3],
    observed: [f32; 3],
}

impl<'a> View<'a> {
    /// For an object about at `pose`; `None` where that is behind the camera.
    pub fn new(
        print: &Print,
        pose: &Isometry3<f32>,
        observation: &'a Observation,
        picture: &'a Picture,
    ) -> Option<Self> {
        let distance = pose.translation.vector.z;
        if distance.is_nan() || distance <= 0.0 {
            return None;
        }
        let pixels = print.spacing * observation.intrinsics.fx as f32 / distance;
        let picture = picture.level(pixels);
        let depth = observation.level(picture.stride);
        let patch = PATCH * (pixels / picture.stride.pixels() as f32).max(1.0);
        let count = |size: usize| (size as f32 / patch) as usize + 1;
        Some(Self { picture, depth, patch, columns: count(depth.width), rows: count(depth.height) })
    }

    /// Which of one point in `every` are seen at a pose: that face the camera, and are where the reading is.
    fn seen(&self, print: &Print, pose: &Isometry3<f32>, every: usize) -> Vec<Seen> {
        let r = pose.rotation.to_rotation_matrix();
        let level = self.depth;
        let visible = |point: &PrintedPoint| {
            let p = r * point.position + pose.translation.vector;
            let facing = -(r * point.normal).dot(&p);
            if p.z <= 0.0 || facing < SLANTED * p.norm() {
                return None;
            }
            let w = 1.0 / p.z;
            let (u, v) = (level.fx * p.x * w + level.cx, level.fy * p.y * w + level.cy);
            let observed = self.picture.at(u, v)?;
            let i = level.index((u + 0.5) as i32, (v + 0.5) as i32);
            let read = level.w[i] > 0.0 && (level.w[i] - w).abs() < SEEN * level.tol[i] * w;
            let patch = (v / self.patch) as usize * self.columns + (u / self.patch) as usize;
            read.then_some(Seen { patch: patch as u32, colour: point.colour, observed })
        };
        print.points.iter().step_by(every).filter_map(visible).collect()
    }

    /// How one point in `every` at `pose` agrees with the picture; `None` where too few are seen, or no light.
    pub fn evidence(&self, print: &Print, pose: &Isometry3<f32>, every: usize) -> Option<Evidence> {
        self.weighed(self.seen(print, pose, every))
    }

    /// The same of all points with their print faded to a share of its contrast: each colour that much of itself, and the
    /// rest of the mean.
    pub fn faded(&self, print: &Print, pose: &Isometry3<f32>, contrast: f32) -> Option<Evidence> {
        let mut seen = self.seen(print, pose, 1);
        let count = seen.len() as f32;
        let mean = [0, 1, 2].map(|c| seen.iter().map(|s| s.colour[c]).sum::<f32>() / count);
        for s in &mut seen {
            s.colour = [0, 1, 2].map(|c| mean[c] + contrast * (s.colour[c] - mean[c]));
        }
        self.weighed(seen)
    }

    fn weighed(&self, mut seen: Vec<Seen>) -> Option<Evidence> {
        let (gain, light) = fitted(&seen)?;
        seen.sort_by_key(|s| s.patch);
        let mut patches = vec![(0, 0.0); self.columns * self.rows];
        let mut brightness: Vec<f32> = Vec::new();
        let mut sorted: Vec<f32> = Vec::new();
        for patch in seen.chunk_by(|a, b| a.patch == b.patch) {
            let off: Vec<[f32; 3]> = patch.iter().map(|s| residual(s, gain, &light)).collect();
            brightness.clear();
            brightness.extend(off.iter().map(|r| (0..3).map(|c| BRIGHTNESS[c] * r[c]).sum::<f32>()));
            sorted.clone_from(&brightness);
            let shading = median(&mut sorted);
            let sum = patch.iter().zip(&off).zip(&brightness).map(|((s, off), b)| {
                // Noise of the logarithms.
                let n = s.observed.map(|o| (NOISE * self.picture.noise(o) / (o + VEIL * gain)).powi(2));
                let noise = (0..3).map(|c| BRIGHTNESS[c].powi(2) * n[c]).sum::<f32>();
                let bright = (b - shading).powi(2) / (BRIGHTNESS_ERROR.powi(2) + noise);
                let noise = 0.5 * (n[0] + n[2]) + n[1];
                let colour =
                    ((off[0] - off[1]).powi(2) + (off[2] - off[1]).powi(2)) / (COLOUR_ERROR.powi(2) + noise);
                likelihood(bright) + likelihood(colour)
            });
            patches[patch[0].patch as usize] = (patch.len() as u32, sum.sum());
        }
        Some(Evidence { points: seen.len(), patches })
    }
}

impl Evidence {
    /// What speaks for this pose and against `other`, in the patches that both see.
    pub fn against(&self, other: &Self) -> Against {
        let (mut total, mut squares, mut points) = (0.0, 0.0, 0.0);
        for (a, b) in self.patches.iter().zip(&other.patches) {
            if a.0 >= FEWEST && b.0 >= FEWEST {
                let shared = a.0.min(b.0) as f32;
                let gain = (a.1 / a.0 as f32 - b.1 / b.0 as f32) * shared;
                total += gain;
                squares += gain * gain;
                points += shared;
            }
        }
        if squares <= 0.0 {
            return Against::default();
        }
        Against { total, gain: total / points, consistency: total / squares.sqrt() }
    }
}

/// Log-likelihood of a squared, normalised residual: `-x / 2` near 0, [`MOST`] far off.
#[inline]
fn likelihood(squared: f32) -> f32 {
    -MOST * squared / (squared + 2.0 * MOST)
}

/// Log of what is seen over what is expected, by channel.
#[inline]
fn residual(seen: &Seen, gain: f32, light: &[f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|c| ((seen.observed[c] / gain + VEIL) / (light[c] * seen.colour[c] + VEIL)).ln())
}

/// Gain, and the light's colour as factors of red and blue against green; `None` for too few points or no light.
fn fitted(seen: &[Seen]) -> Option<(f32, [f32; 3])> {
    if seen.len() < LEAST {
        return None;
    }
    let some = || seen.iter().step_by(FITTED.min(seen.len() / LEAST));
    let sum = |c: &[f32; 3]| c.iter().sum::<f32>();
    let mut ratios: Vec<f32> = some().map(|s| sum(&s.observed) / (sum(&s.colour) + VEIL)).collect();
    let mut gain = median(&mut ratios);
    let mut light = [1.0f32; 3];
    for _ in 0..2 {
        if gain.is_nan() || gain < DIMMEST {
            return None;
        }
        let off: Vec<[f32; 3]> = some().map(|s| residual(s, gain, &light)).collect();
        for c in [0, 2] {
            let mut tint: Vec<f32> = off.iter().map(|r| r[c] - r[1]).collect();
            light[c] = (light[c].ln() + median(&mut tint)).clamp(-TINT, TINT).exp();
        }
        let mut brightness: Vec<f32> = off.iter().map(|r| sum(r) / 3.0).collect();
        gain *= median(&mut brightness).exp();
    }
    (gain >= DIMMEST).then_some((gain, light))
}

/// The middle value (the upper one of two).
fn median(values: &mut [f32]) -> f32 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}
