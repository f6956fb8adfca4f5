//! The paper's likelihood W(q) (its equation "weight") of one hypothesis.

use nalgebra::Isometry3;

use super::features::{Features, Patch, Ranked, Smoothness, compute};
use super::settings::{Centre, PaperSettings};
use crate::detector::Detection;
use crate::hypotheses::{Isa, Lod, Raster, Tile, render};
use crate::observation::{Level, Observation};
use grip_sim::lanes::per_machine;

/// The terms of W of one hypothesis, each 0 to 1.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Weight {
    /// w_box: confidence of its box.
    pub confidence: f32,
    /// I_b: inliers among the rendered points in the box.
    pub in_box: f32,
    /// I_r: inliers among all rendered points.
    pub all: f32,
    /// I_e: inliers among the rendered edge points.
    pub edges: f32,
    /// I_p: inliers among the rendered planar points.
    pub planes: f32,
}

impl Weight {
    /// W(q).
    pub fn total(&self, settings: &PaperSettings) -> f32 {
        settings.alpha_box * self.confidence
            + settings.alpha_b * self.in_box
            + settings.alpha_r * self.all
            + settings.alpha_e * self.edges
            + settings.alpha_p * self.planes
    }
}

/// Buffers for one thread.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    raster: Raster,
    smoothness: Smoothness,
    features: Features,
    /// 1 for inliers, by pixel of the patch.
    inlier: Vec<u8>,
}

/// The frame, and what is looked for in it.
pub(super) struct Likelihood<'a> {
    pub settings: &'a PaperSettings,
    pub observation: &'a Observation,
    /// Kinds of the observation's pixels.
    pub features: &'a [u8],
    pub lod: &'a Lod,
    /// Confidences between 0 and 1.
    pub boxes: &'a [Detection],
}

impl Likelihood<'_> {
    /// The weight of a pose with a box. A hypothesis that cannot be rendered (behind the camera, out of the image) has no
    /// points, so no inliers.
    pub fn weigh(&self, scratch: &mut Scratch, pose: &Isometry3<f32>, index: usize) -> Weight {
        let bounding = &self.boxes[index];
        let nothing = Weight { confidence: bounding.confidence as f32, ..Weight::default() };
        let level = self.observation.level(self.settings.stride);
        if !self.centred(pose, &bounding.bbox) {
            return Weight::default();
        }
        if render(&mut scratch.raster, self.lod, pose, level, None).is_none() {
            return nothing;
        }
        let Scratch { raster, smoothness, features, inlier } = scratch;
        let tile = &raster.tile;
        let patch = patch(tile, [level.width, level.height]);
        let Counts { rendered, inliers, in_box, inliers_in_box } =
            count(Isa::best(), self, patch, &on_level(&bounding.bbox, level), inlier);
        if rendered == 0 {
            return nothing;
        }
        if rendered * self.settings.stride.pixels().pow(2) < self.settings.min_pixels {
            return Weight::default();
        }
        let share = |part: usize, whole: usize| if whole == 0 { 0.0 } else { part as f32 / whole as f32 };
        let counted =
            Weight { in_box: share(inliers_in_box, in_box), all: share(inliers, rendered), ..nothing };
        if inliers == 0 {
            // Features are points: without inliers there are none among them.
            return counted;
        }
        compute(Isa::best(), smoothness, patch, level, self.settings);
        let [edges, planes] = count_features(Isa::best(), features, patch, &smoothness.squared, inlier, self)
            .map(|[found, matched]| share(matched, found));
        Weight { edges, planes, ..counted }
    }

    fn centred(&self, pose: &Isometry3<f32>, [u0, v0, u1, v1]: &[f64; 4]) -> bool {
        let k = &self.observation.intrinsics;
        let centre = nalgebra::Point3::from(pose.translation.vector.cast::<f64>());
        let seen = || k.project(&centre);
        match self.settings.centre {
            Centre::Anywhere => true,
            Centre::Image => seen().is_some_and(|p| {
                (0.0..k.width as f64).contains(&p.x) && (0.0..k.height as f64).contains(&p.y)
            }),
            Centre::Box => seen().is_some_and(|p| (u0..=u1).contains(&&p.x) && (v0..=v1).contains(&&p.y)),
        }
    }
}

per_machine! {
    /// How many edge and planar points a hypothesis has, and how many of these are inliers of the observation's.
    fn count_features(
        features: &mut Features,
        patch: Patch<'_>,
        squared: &[f32],
        inlier: &mut [u8],
        likelihood: &Likelihood<'_>,
    ) -> [[usize; 2]; 2] => count_features_body
}

#[inline(always)]
fn count_features_body(
    features: &mut Features,
    patch: Patch<'_>,
    squared: &[f32],
    inlier: &mut [u8],
    likelihood: &Likelihood<'_>,
) -> [[usize; 2]; 2] {
    let level = likelihood.observation.level(likelihood.settings.stride);
    let Patch { origin, width, height, .. } = patch;
    for (y, line) in inlier.chunks_exact_mut(width.max(1)).enumerate() {
        let kinds = &likelihood.features[level.index(origin[0], origin[1] + y as i32)..][..width];
        for (inlier, kind) in line.iter_mut().zip(kinds) {
            // Outliers match nothing.
            *inlier *= kind;
        }
    }
    features.count(Ranked { squared, matches: inlier, width, height, origin }, likelihood.settings)
}

per_machine! {
    /// Counts inliers (equations "inlier" and "inlier_n"), and marks them.
    fn count(likelihood: &Likelihood<'_>, patch: Patch<'_>, bbox: &[f64; 4], inlier: &mut Vec<u8>) -> Counts => count_body
}

#[inline(always)]
fn count_body(
    likelihood: &Likelihood<'_>,
    patch: Patch<'_>,
    [u0, v0, u1, v1]: &[f64; 4],
    inlier: &mut Vec<u8>,
) -> Counts {
    let level = likelihood.observation.level(likelihood.settings.stride);
    // With a plane, what lies on it is nobody's.
    let least = if likelihood.observation.plane().is_some() { 0.5 } else { -1.0 };
    inlier.clear();
    inlier.resize(patch.width * patch.height, 0);
    // The columns whose pixels lie in the box.
    let column = |u: f64| ((u - f64::from(patch.origin[0])).max(0.0) as usize).min(patch.width);
    let boxed = column(u0.ceil())..column(u1.floor() + 1.0);
    let mut counts = Counts::default();
    for (y, inlier) in inlier.chunks_exact_mut(patch.width.max(1)).enumerate() {
        let v = patch.origin[1] + y as i32;
        let at = level.index(patch.origin[0], v);
        let [seen, tol, weight] = [&level.w, &level.tol, &level.weight].map(|row| &row[at..at + patch.width]);
        let row = patch.row(y);
        let (mut rendered, mut inliers) = (0_u32, 0_u32);
        for x in 0..patch.width {
            let (w, seen) = (row[x], seen[x]);
            // The tolerance is of the distance along the ray: two points of one pixel lie on one ray.
            let is = (w > 0.0) & (seen > 0.0) & ((seen - w).abs() < tol[x] * w) & (weight[x] > least);
            inlier[x] = u8::from(is);
            rendered += u32::from(w > 0.0);
            inliers += u32::from(is);
        }
        counts.rendered += rendered as usize;
        counts.inliers += inliers as usize;
        if (*v0..=*v1).contains(&f64::from(v)) && boxed.start < boxed.end {
            counts.in_box += row[boxed.clone()].iter().filter(|&&w| w > 0.0).count();
            counts.inliers_in_box += inlier[boxed.clone()].iter().map(|&is| usize::from(is)).sum::<usize>();
        }
    }
    counts
}

/// A box of the image in pixels of a level.
fn on_level(bbox: &[f64; 4], level: &Level) -> [f64; 4] {
    let stride = level.stride.pixels() as f64;
    // The middle of a block of pixels is the middle of the level's pixel.
    bbox.map(|edge| (edge - (stride - 1.0) / 2.0) / stride)
}

#[derive(Debug, Clone, Copy, Default)]
struct Counts {
    rendered: usize,
    inliers: usize,
    in_box: usize,
    inliers_in_box: usize,
}

/// The part of a tile that lies in the image: it has a pixel more on each side.
fn patch(tile: &Tile, [width, height]: [usize; 2]) -> Patch<'_> {
    let skip = [tile.u0, tile.v0].map(|at| (-at).max(0) as usize);
    let origin = [tile.u0.max(0), tile.v0.max(0)];
    let left = |size: usize, skip: usize, origin: i32, most: usize| {
        size.saturating_sub(skip).min(most.saturating_sub(origin as usize))
    };
    Patch {
        origin,
        width: left(tile.width, skip[0], origin[0], width),
        height: left(tile.height, skip[1], origin[1], height),
        values: tile.values(),
        start: tile.index(skip[0], skip[1]),
        pitch: tile.pitch(),
    }
}
