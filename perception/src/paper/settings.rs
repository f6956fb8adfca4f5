//! Settings of the method as published, with where each is published.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::checks::{Checked, part, within};
use crate::observation::Stride;
use crate::support::SupportSettings;

/// Largest side of a window, pixels.
pub(super) const MAX_WINDOW: usize = 5;

/// What a neighbour without a point adds to the smoothness of a surface; the paper does not say.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Holes {
    /// Nothing: it is no neighbour. The literal reading: the sum is over points.
    Skip,
    /// A point at the camera, as an empty pixel of a point cloud image often is: outlines become edges.
    Origin,
}

/// Which points of a window are its features when there are more than may be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Ranking {
    /// Edges with the largest and planar points with the smallest c. The literal reading ("largest and smallest c values").
    Smoothness,
    /// The first ones, row by row ("if the number of selected points has not exceeded the limit").
    Scan,
}

/// Where the centre of a hypothesis must project to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Centre {
    /// Anywhere. The literal reading.
    Anywhere,
    /// Into the image.
    Image,
    /// Into its box.
    Box,
}

/// Where samples begin in the space that a box indicates ("uniformly within the 3D workspaces indicated by sampled bounding
/// boxes").
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Start {
    /// Anywhere that projects into the box, between its nearest and its farthest reading. The literal reading.
    Frustum,
    /// At readings in the box, with a support plane those above it.
    Readings,
}

/// Which features of the observation a hypothesis's feature may match.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum FeatureMatch {
    /// That of the same pixel. The literal reading ("the same inlier calculation").
    Pixel,
    /// Any within epsilon of the point that is seen in its pixel.
    Near,
}

/// Whose weight the diffusion shrinks by ("the weight of best pose estimation at that iteration").
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Decay {
    /// The best sample's of the iteration. The literal reading.
    Current,
    /// The best one's so far.
    Running,
}

/// What has the diffusion's standard deviations ("zero-mean Gaussian noises N(0, sigma^2)" of a pose, with one number each for
/// translation and rotation).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Diffusion {
    /// Each of three axes: a step is hardly ever small (one of 0.07 m a axis is below 1 cm once in 1,300). The literal reading.
    Axes,
    /// The length of the step and the angle of the turn, in a direction and about an axis that are drawn evenly: many steps are
    /// small (below 1 cm one in nine).
    Length,
}

/// Settings of [`PaperEstimator`](crate::PaperEstimator). The default is the published method, read literally; section and equation
/// numbers are those of Chen et al. 2019.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PaperSettings {
    /// Samples an object (Implementation: 625).
    pub samples: usize,
    /// Most iterations (Implementation: 400).
    pub iterations: usize,
    /// Weight of the best sample at which iterations end (w-bar: 0.9).
    pub converged: f32,
    /// Inlier distance, metres (epsilon: 0.005).
    pub epsilon_m: f64,
    /// Weights of the terms of W (alpha: 0.1, 0.1, 0.3, 0.25, 0.25): confidence of the box,
    pub alpha_box: f32,
    /// inliers in the box,
    pub alpha_b: f32,
    /// all inliers,
    pub alpha_r: f32,
    /// edge inliers,
    pub alpha_e: f32,
    /// planar inliers.
    pub alpha_p: f32,
    /// Standard deviations of the diffusion at the start, metres (sigma_T: 0.07)
    pub sigma_m: f32,
    /// and radians (sigma_R: 0.3).
    pub sigma_rad: f32,
    /// Weight of the best sample at which the diffusion begins to shrink (0.6),
    pub decay_from: f32,
    /// and the exponent of its decay (5).
    pub decay_exponent: i32,
    /// Logarithm of the smoothness from which a point is an edge (-5.5).
    pub edge_ln_c: f32,
    /// Side of the windows in which features are limited, pixels (5).
    pub window: usize,
    /// Most edge points a window (5).
    pub window_edges: usize,
    /// Most planar points a window (2).
    pub window_planes: usize,
    /// OPEN in the paper: which points of a window come first.
    pub ranking: Ranking,
    /// OPEN in the paper: whether the limits hold for the observation's features too, or only for a hypothesis's.
    pub limit_observed: bool,
    /// OPEN in the paper: which of them a hypothesis's feature may match.
    pub feature_match: FeatureMatch,
    /// OPEN in the paper: half the side of the neighbourhood N of a point, pixels.
    pub neighbours: usize,
    /// OPEN in the paper: neighbours without a point.
    pub holes: Holes,
    /// OPEN in the paper: the chance, each iteration, that a sample's box is drawn anew among all boxes ("diffused
    /// uniformly within the image").
    pub box_jump: f64,
    /// OPEN in the paper: at what part of the image's resolution hypotheses are rendered and compared. ("The sample size is
    /// limited by the buffer size"; epsilon is "approximated distance between adjacent points", which at 0.8 m is 6 mm at a
    /// quarter of 640 x 480.)
    pub stride: Stride,
    /// OPEN in the paper: where samples begin.
    pub start: Start,
    /// OPEN in the paper: whose weight the diffusion shrinks by.
    pub decay_by: Decay,
    /// OPEN in the paper: what has the diffusion's standard deviations.
    pub diffusion: Diffusion,
    /// Triangles of the model that is rendered; their depth is off by 0.1 to 0.6 mm on average, a tenth of epsilon.
    pub triangles: usize,

    // What the paper does not have, or does not tell; the defaults leave it out.
    /// Samples are drawn in proportion to W to this power (1).
    pub resampling_exponent: f32,
    /// Whether the best sample survives as it is (false).
    pub keep_best: bool,
    /// Samples that cover fewer pixels of the image weigh nothing (0).
    pub min_pixels: usize,
    /// Where a sample's centre must be, or it weighs nothing (anywhere).
    pub centre: Centre,
    /// With a support plane, points on it are nobody's inliers (switched off).
    pub support: SupportSettings,
}

impl Default for PaperSettings {
    fn default() -> Self {
        Self {
            samples: 625,
            iterations: 400,
            converged: 0.9,
            epsilon_m: 0.005,
            alpha_box: 0.1,
            alpha_b: 0.1,
            alpha_r: 0.3,
            alpha_e: 0.25,
            alpha_p: 0.25,
            sigma_m: 0.07,
            sigma_rad: 0.3,
            decay_from: 0.6,
            decay_exponent: 5,
            edge_ln_c: -5.5,
            window: 5,
            window_edges: 5,
            window_planes: 2,
            ranking: Ranking::Smoothness,
            limit_observed: true,
            feature_match: FeatureMatch::Pixel,
            neighbours: 2,
            holes: Holes::Skip,
            box_jump: 1.0,
            stride: Stride::One,
            start: Start::Frustum,
            decay_by: Decay::Current,
            diffusion: Diffusion::Axes,
            triangles: 500,
            resampling_exponent: 1.0,
            keep_best: false,
            min_pixels: 0,
            centre: Centre::Anywhere,
            support: SupportSettings::off(),
        }
    }
}

impl PaperSettings {
    /// The published method with the guards without which it does not converge on cluttered tables: see the fields' docs.
    #[must_use]
    pub fn guarded() -> Self {
        Self {
            resampling_exponent: 4.0,
            keep_best: true,
            min_pixels: 40,
            centre: Centre::Box,
            box_jump: 0.0,
            support: SupportSettings::default(),
            ..Self::default()
        }
    }

    /// What is wrong with a value, if anything: its field, the value and the range.
    ///
    /// # Errors
    /// That, for the first such field.
    pub fn validate(&self) -> Checked {
        within("samples", self.samples, 1..=100_000, "")?;
        within("iterations", self.iterations, 1..=100_000, "")?;
        within("converged", self.converged, 0.0..=10.0, "")?;
        within("epsilon_m", self.epsilon_m, 1e-4..=0.1, "metres")?;
        let alphas = [self.alpha_box, self.alpha_b, self.alpha_r, self.alpha_e, self.alpha_p];
        let sum: f32 = alphas.iter().sum();
        if alphas.iter().any(|a| !(0.0..=1.0).contains(a)) || (sum - 1.0).abs() > 1e-3 {
            return Err(format!("alpha_* = {alphas:?}: each 0 to 1, with a sum of 1"));
        }
        within("sigma_m", self.sigma_m, 0.0..=10.0, "metres")?;
        within("sigma_rad", self.sigma_rad, 0.0..=10.0, "radians")?;
        within("decay_from", self.decay_from, 0.0..=0.999, "")?;
        within("decay_exponent", self.decay_exponent, 0..=100, "")?;
        within("edge_ln_c", self.edge_ln_c, -50.0..=10.0, "")?;
        within("window", self.window, 1..=MAX_WINDOW, "pixels")?;
        within("window_edges", self.window_edges, 0..=4096, "")?;
        within("window_planes", self.window_planes, 0..=4096, "")?;
        within("neighbours", self.neighbours, 1..=16, "pixels")?;
        within("box_jump", self.box_jump, 0.0..=1.0, "")?;
        within("triangles", self.triangles, 4..=100_000, "")?;
        within("resampling_exponent", self.resampling_exponent, 0.0..=100.0, "")?;
        part("support", self.support.validate())
    }
}
