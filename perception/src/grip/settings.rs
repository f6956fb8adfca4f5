//! Settings of the filter, with the reason for each default.
//!
//! What each departure from the paper is worth, by leaving it out: area under the accuracy-threshold curve up to 4 cm, per
//! cent, of ADD-S (all views, and those with clutter) and of ADD(-S), on 406 instances of `grip scenes --seed 510 --scenes 10`,
//! boxes jittered by 10 % among four false ones, one seed of the estimator. Differences under a point are within the noise.
//!
//! | left out | setting | ADD-S | clutter | ADD(-S) |
//! |---|---|---|---|---|
//! | nothing | | 97.6 | 96.3 | 93.4 |
//! | Gauss-Newton steps, four times the samples instead | `levels[].steps`, `final_steps` = 0 | 87.5 | 83.4 | 68.9 |
//! | support plane | `plane` = null | 91.6 | 88.8 | 86.4 |
//! | looking at objects together | `joint` = null | 94.6 | 90.8 | 90.9 |
//! | silhouettes | `edge_weight` = 0 | 95.9 | 93.8 | 90.4 |
//! | restarts | `max_restarts` = 1 | 96.6 | 95.2 | 90.9 |
//! | turns in which it nearly lies on itself | `twins` = false | 97.2 | 95.8 | 82.9 |
//! | how much of the image these explain | `explained_weight` = 0 | 97.3 | 95.7 | 92.9 |
//! | colour | `colour` = null | 97.6 | 96.2 | 93.5 |
//! | free space that is violated | `violation` = 0 | 97.7 | 96.6 | 93.0 |
//! | hidden pixels are not held against a pose | `occlusion_discount` = 0 | 97.0 | 95.7 | 92.1 |
//! | boxes in the score | `box_weight` = 0 | 97.2 | 95.4 | 92.8 |
//! | resting poses | `resting_share` = 0 | 97.7 | 96.8 | 91.8 |
//! | choosing proposals by their boxes | `oversampling` = 1 | 97.3 | 95.6 | 92.3 |
//! | a tenth of the proposals from anywhere | `anywhere` = 0 | 97.7 | 97.1 | 93.5 |
//! | a kernel for real depth | `epsilon_m` = 0.005 | 97.0 | 95.3 | 92.3 |

use serde::{Deserialize, Serialize};

use super::colour::ColourSettings;
use super::joint::JointSettings;
use crate::detector::Workspace;
use crate::error::{Error, Result};
use crate::hypotheses::STRIDES;
use crate::plane::PlaneSettings;

/// One level of the search, coarse to fine: `samples` hypotheses, each moved by Gauss-Newton steps and weighed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SearchLevel {
    /// Hypotheses that live in this level.
    pub samples: usize,
    /// Pixel blocks of this side make one pixel: 1, 2, 4 or 8; less for an object that would be fewer than
    /// [`GripSettings::least_side_px`] of these across.
    pub stride: usize,
    /// Triangles of the simplified model that is rendered.
    pub triangles: usize,
    /// Half-width of the soft inlier kernel, in units of [`GripSettings::epsilon_m`].
    pub kernel: f32,
    /// Gauss-Newton steps of each hypothesis in each iteration.
    pub steps: usize,
    /// Rounds of move, weigh, resample and diffuse.
    pub iterations: usize,
    /// Standard deviation of the diffusion after the first and the last round, metres, interpolated geometrically.
    /// No diffusion follows the last round of a level.
    pub diffusion_m: [f32; 2],
    /// The same for rotation, radians.
    pub diffusion_rad: [f32; 2],
}

/// Settings of [`super::GripEstimator`].
///
/// Figures in brackets are the paper's where it has the quantity.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GripSettings {
    /// A rendered point this far from the observed one is no inlier, metres (paper: 0.005). On synthetic depth 0.005 is
    /// best by a little; real depth is off by up to 8 mm at the true pose, and 0.008 is best there.
    pub epsilon_m: f64,
    /// Coarse to fine (paper: 625 samples, 400 iterations at one resolution).
    pub levels: Vec<SearchLevel>,
    /// How many pixels of a level an object must be across; see [`SearchLevel::stride`].
    pub least_side_px: f32,
    /// Least share of proposals that are drawn from the whole image and not from boxes (paper: 0). Where the best box is doubtful,
    /// it is what that box lacks to certainty: a detector that darkness fools is no hindrance then. The least share is for detectors
    /// that are sure and wrong; it gains nothing with ours.
    pub anywhere: f64,
    /// Proposals drawn for each that is kept by the overlap of its projection with its box.
    pub oversampling: usize,
    /// Share of proposals in resting orientations on the support plane; the others are uniform over all rotations, so
    /// that leaning and stacked objects are found too. No plane, no resting proposals.
    pub resting_share: f64,
    /// Hypotheses of the last level that are polished at full resolution.
    pub finalists: usize,
    /// Gauss-Newton steps of that polish.
    pub final_steps: usize,
    /// Kernel of the final score, in epsilons: final scores are compared between restarts and with other objects'.
    pub final_kernel: f32,
    /// Restarts end when the best score was reached twice at the same place, or after this many.
    pub max_restarts: usize,
    /// A restart that scores this much needs no other one to agree. (Of 120 first restarts in a data set of our own that scored
    /// 0.7 or more, 119 were within 1 cm.)
    pub sure_score: f32,
    /// Whether the result is compared with itself turned so that it nearly lies on itself: boxes, clamps, mugs, whose scores
    /// differ little then.
    pub twins: bool,
    /// A turned one that scores less than the result by more is not looked at further.
    pub twin_margin: f32,
    /// What explaining twice as many pixels of the image is worth among these, in units of the score.
    pub explained_weight: f32,
    /// When the best of three restarts scores less, the object is not there: no more restarts, and no second search (a
    /// true pose scores over 0.5 nearly always).
    pub hopeless_score: f32,
    /// Weight of the depth fit in the score (paper: alpha_r).
    pub fit_weight: f32,
    /// Weight of the silhouette term (paper: alpha_e, in another form).
    pub edge_weight: f32,
    /// Weight of a box's confidence times overlap (paper: alpha_box + alpha_b = 0.2). Exact boxes deserve 0.6, sloppy
    /// ones 0.1. The score is divided by the sum of this and the two weights above.
    pub box_weight: f32,
    /// Weight of the penetration of the support plane.
    pub plane_weight: f32,
    /// What a pixel costs where the camera looks through the hypothesis, as a share of what an inlier gains.
    pub violation: f32,
    /// Share of occluded pixels that is taken out of the denominator: below 1, since what hides behind others explains
    /// nothing.
    pub occlusion_discount: f32,
    /// The denominator is at least this share of the rendered pixels.
    pub min_visible: f32,
    /// A hypothesis that covers fewer full-resolution pixels is rejected: slivers fit anything.
    pub min_pixels: f32,
    /// Penetration of the plane up to this is free, metres: real models sink by up to 12 mm under the fitted plane.
    pub penetration_free_m: f64,
    /// Penetration beyond that which costs the full weight, metres.
    pub penetration_full_m: f64,
    /// Points lower than 0.4 times this over the plane explain nothing, those higher than 1.4 times fully, metres.
    pub plane_band_m: f64,
    /// Depth jumps larger than this between neighbouring readings are edges, metres.
    pub edge_jump_m: f64,
    /// Standard deviation of the distance from a silhouette to a depth edge, pixels of the level's resolution.
    pub edge_sigma_px: f64,
    /// Effective sample size after tempering, as a share of the samples.
    pub ess: f64,
    /// The same in the last level.
    pub last_ess: f64,
    /// Damping of Gauss-Newton, relative to the diagonal.
    pub damping: f32,
    /// Two restarts agree when their scores differ by less,
    pub same_score: f32,
    /// their origins by less, metres,
    pub same_position_m: f32,
    /// and their convex hulls by less (Hausdorff distance), metres.
    pub same_hull_m: f32,
    /// Temperature of the particle weights that are handed out: two runs' scores at one place differ by about this.
    pub posterior_temperature: f64,
    /// Score at which an object is as likely present as absent.
    pub presence_score: f64,
    /// Scale of the logistic function about it.
    pub presence_scale: f64,
    /// How objects are looked at together after each was searched on its own; `None` for not at all (the paper: not).
    pub joint: Option<JointSettings>,
    /// When colour decides between poses that depth cannot tell apart; `None` leaves them as depth has them (the paper: none).
    pub colour: Option<ColourSettings>,
    /// How the support plane is found; `None` searches without one.
    pub plane: Option<PlaneSettings>,
    /// Only points in here can be an object's, in the world frame; `None` for everywhere.
    pub workspace: Option<Workspace>,
    /// Whether [`PosePosterior::trace`](crate::PosePosterior::trace) is kept.
    pub trace: bool,
}

impl Default for GripSettings {
    fn default() -> Self {
        let level =
            |samples, stride, triangles, kernel, steps, iterations, diffusion: [[f32; 2]; 2]| SearchLevel {
                samples,
                stride,
                triangles,
                kernel,
                steps,
                iterations,
                diffusion_m: diffusion[0],
                diffusion_rad: diffusion[1],
            };
        Self {
            epsilon_m: 0.007,
            levels: vec![
                level(400, 8, 60, 5.0, 2, 1, [[0.0; 2]; 2]),
                level(150, 8, 60, 5.0, 3, 1, [[0.0; 2]; 2]),
                level(50, 4, 200, 3.0, 2, 2, [[0.010, 0.005], [0.2, 0.1]]),
                level(20, 2, 200, 2.0, 1, 2, [[0.004, 0.002], [0.1, 0.05]]),
            ],
            least_side_px: 20.0,
            anywhere: 0.1,
            oversampling: 8,
            resting_share: 0.5,
            finalists: 2,
            final_steps: 8,
            final_kernel: 1.0,
            max_restarts: 8,
            sure_score: 0.75,
            twins: true,
            twin_margin: 0.1,
            explained_weight: 0.3,
            hopeless_score: 0.3,
            fit_weight: 0.6,
            edge_weight: 0.4,
            box_weight: 0.3,
            plane_weight: 0.3,
            violation: 0.5,
            occlusion_discount: 0.7,
            min_visible: 0.15,
            min_pixels: 60.0,
            penetration_free_m: 0.012,
            penetration_full_m: 0.02,
            plane_band_m: 0.003,
            edge_jump_m: 0.010,
            edge_sigma_px: 1.5,
            ess: 0.3,
            last_ess: 0.5,
            damping: 0.01,
            same_score: 0.03,
            same_position_m: 0.006,
            same_hull_m: 0.015,
            posterior_temperature: 0.03,
            presence_score: 0.5,
            presence_scale: 0.04,
            joint: Some(JointSettings::default()),
            colour: Some(ColourSettings::default()),
            plane: Some(PlaneSettings::default()),
            workspace: None,
            trace: false,
        }
    }
}

impl GripSettings {
    /// Refuses values that the filter cannot work with.
    pub(crate) fn check(&self) -> Result<()> {
        let bad = |name, value: String, message: &str| {
            Err(Error::Setting { name, value, message: message.to_owned() })
        };
        if !(1e-4..0.1).contains(&self.epsilon_m) {
            return bad("epsilon_m", self.epsilon_m.to_string(), "metres, 0.0001 to 0.1; try 0.005");
        }
        if self.levels.is_empty() {
            return bad("levels", "[]".into(), "at least one level is needed; see the default");
        }
        for level in &self.levels {
            let sane = (1..=100_000).contains(&level.samples)
                && STRIDES.contains(&level.stride)
                && (4..=100_000).contains(&level.triangles)
                && (0.1..100.0).contains(&level.kernel)
                && (1..=1000).contains(&level.iterations)
                && level.steps <= 1000
                && level.diffusion_m.iter().chain(&level.diffusion_rad).all(|d| (0.0..10.0).contains(d));
            if !sane {
                return bad(
                    "levels",
                    format!("{level:?}"),
                    "samples 1 to 100000, stride 1, 2, 4 or 8, triangles 4 to 100000, kernel 0.1 to 100, iterations 1 to 1000, diffusions 0 to 10",
                );
            }
        }
        let counts = [
            ("oversampling", self.oversampling),
            ("finalists", self.finalists),
            ("max_restarts", self.max_restarts),
        ];
        for (name, count) in counts {
            if !(1..=1000).contains(&count) {
                return bad(name, count.to_string(), "1 to 1000");
            }
        }
        let positive = [
            ("penetration_full_m", self.penetration_full_m),
            ("plane_band_m", self.plane_band_m),
            ("edge_jump_m", self.edge_jump_m),
            ("edge_sigma_px", self.edge_sigma_px),
            ("ess", self.ess),
            ("last_ess", self.last_ess),
            ("posterior_temperature", self.posterior_temperature),
            ("presence_scale", self.presence_scale),
            ("final_kernel", f64::from(self.final_kernel)),
            ("damping", f64::from(self.damping)),
            ("min_visible", f64::from(self.min_visible)),
            ("fit_weight", f64::from(self.fit_weight)),
        ];
        for (name, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return bad(name, value.to_string(), "must be positive and finite");
            }
        }
        let not_negative = [
            ("edge_weight", self.edge_weight),
            ("box_weight", self.box_weight),
            ("plane_weight", self.plane_weight),
            ("violation", self.violation),
            ("occlusion_discount", self.occlusion_discount),
            ("twin_margin", self.twin_margin),
            ("explained_weight", self.explained_weight),
        ];
        for (name, value) in not_negative {
            if !(value >= 0.0 && value.is_finite()) {
                return bad(name, value.to_string(), "must not be negative");
            }
        }
        if !(0.0..=1.0).contains(&self.anywhere) {
            return bad("anywhere", self.anywhere.to_string(), "0 to 1; try 0.1");
        }
        if !(0.0..=1.0).contains(&self.resting_share) {
            return bad("resting_share", self.resting_share.to_string(), "0 to 1; try 0.5");
        }
        self.joint.as_ref().map_or(Ok(()), JointSettings::check)?;
        self.colour.as_ref().map_or(Ok(()), ColourSettings::check)
    }
}
