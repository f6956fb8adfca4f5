//! The search for one object: its levels, the polish after them, and its restarts.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::checks::{Checked, part, positive, within};
use crate::observation::Stride;

/// One level of the search, coarse to fine: `samples` hypotheses, each moved by Gauss-Newton steps and weighed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SearchLevel {
    /// Hypotheses that live in this level, 1 to 100000.
    pub samples: usize,
    /// Pixel blocks of this side make one pixel: 1, 2, 4 or 8; less for an object that would be fewer than
    /// [`SearchSettings::least_side_px`] of these across.
    pub stride: Stride,
    /// Triangles of the simplified model that is rendered, 4 to 100000.
    pub triangles: usize,
    /// Half-width of the soft inlier kernel, in units of [`ObservationSettings::epsilon_m`](crate::ObservationSettings),
    /// 0.1 to 100.
    pub kernel: f32,
    /// Gauss-Newton steps of each hypothesis in each iteration, 0 to 1000.
    pub steps: usize,
    /// Rounds of move, weigh, resample and diffuse, 1 to 1000.
    pub iterations: usize,
    /// Standard deviation of the diffusion after the first and the last round, metres, 0 to 10, interpolated geometrically.
    /// No diffusion follows the last round of a level.
    pub diffusion_m: [f32; 2],
    /// The same for rotation, radians, 0 to 10.
    pub diffusion_rad: [f32; 2],
}

impl SearchLevel {
    /// What is wrong with a value, if anything: its field, the value and the range.
    ///
    /// # Errors
    /// That, for the first such field.
    pub fn validate(&self) -> Checked {
        within("samples", self.samples, 1..=100_000, "")?;
        within("triangles", self.triangles, 4..=100_000, "")?;
        within("kernel", self.kernel, 0.1..=100.0, "epsilons")?;
        within("steps", self.steps, 0..=1000, "")?;
        within("iterations", self.iterations, 1..=1000, "")?;
        self.diffusion_m.iter().try_for_each(|d| within("diffusion_m", *d, 0.0..=10.0, "metres"))?;
        self.diffusion_rad.iter().try_for_each(|d| within("diffusion_rad", *d, 0.0..=10.0, "radians"))
    }
}

/// One pass of the search, from the first hypotheses to the last level. Figures in brackets are the defaults.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SearchSettings {
    /// Coarse to fine (400 samples at stride 8, 150 at 8, 50 at 4, 20 at 2; the paper: 625 samples, 400 iterations at one
    /// resolution).
    pub levels: Vec<SearchLevel>,
    /// How many pixels of a level an object must be across, 0 to 1000 (20); see [`SearchLevel::stride`].
    pub least_side_px: f32,
    /// Effective sample size after tempering, as a share of the samples, over 0, to 1 (0.3).
    pub ess: f64,
    /// The same in the last level (0.5).
    pub last_ess: f64,
    /// Damping of Gauss-Newton, relative to the diagonal of the normal equations, over 0 (0.01).
    pub damping: f32,
}

impl Default for SearchSettings {
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
            levels: vec![
                level(400, Stride::Eight, 60, 5.0, 2, 1, [[0.0; 2]; 2]),
                level(150, Stride::Eight, 60, 5.0, 3, 1, [[0.0; 2]; 2]),
                level(50, Stride::Four, 200, 3.0, 2, 2, [[0.010, 0.005], [0.2, 0.1]]),
                level(20, Stride::Two, 200, 2.0, 1, 2, [[0.004, 0.002], [0.1, 0.05]]),
            ],
            least_side_px: 20.0,
            ess: 0.3,
            last_ess: 0.5,
            damping: 0.01,
        }
    }
}

impl SearchSettings {
    /// What is wrong with a value, if anything: its field, the value and the range.
    ///
    /// # Errors
    /// That, for the first such field.
    pub fn validate(&self) -> Checked {
        if self.levels.is_empty() {
            return Err("levels = []: at least one level is needed; see the default".to_owned());
        }
        for (i, level) in self.levels.iter().enumerate() {
            part(&format!("levels[{i}]"), level.validate())?;
        }
        within("least_side_px", self.least_side_px, 0.0..=1000.0, "pixels")?;
        within("ess", self.ess, 1e-6..=1.0, "")?;
        within("last_ess", self.last_ess, 1e-6..=1.0, "")?;
        positive("damping", self.damping)
    }
}

/// The polish of the best hypotheses at full resolution, whose scores are final. Figures in brackets are the defaults.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PolishSettings {
    /// Hypotheses of the last level that are polished, 1 to 1000 (2).
    pub finalists: usize,
    /// Gauss-Newton steps, 0 to 1000 (8).
    pub steps: usize,
    /// Kernel of the final score, in epsilons, over 0 (1): final scores are compared between restarts and with other
    /// objects'.
    pub kernel: f32,
    /// Triangles of the mesh that final scores are made with, 4 to 100000 (1000).
    pub triangles: usize,
    /// A step that moves no point of the object farther is the last, metres, 0 to 0.1 (0.0001): a tenth of what the noise
    /// leaves.
    pub converged_m: f32,
}

impl Default for PolishSettings {
    fn default() -> Self {
        Self { finalists: 2, steps: 8, kernel: 1.0, triangles: 1000, converged_m: 1e-4 }
    }
}

impl PolishSettings {
    /// What is wrong with a value, if anything: its field, the value and the range.
    ///
    /// # Errors
    /// That, for the first such field.
    pub fn validate(&self) -> Checked {
        within("finalists", self.finalists, 1..=1000, "")?;
        within("steps", self.steps, 0..=1000, "")?;
        positive("kernel", self.kernel)?;
        within("triangles", self.triangles, 4..=100_000, "")?;
        within("converged_m", self.converged_m, 0.0..=0.1, "metres")
    }
}

/// When a search is made anew, and when it ends. Figures in brackets are the defaults.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RestartSettings {
    /// Restarts end when the best score was reached twice at the same place, or after this many, 1 to 1000 (8).
    pub most: usize,
    /// A restart that scores this much needs no other one to agree (0.75). Of 120 first restarts in a data set of our own that
    /// scored 0.7 or more, 119 were within 1 cm.
    pub sure_score: f32,
    /// When the best of [`RestartSettings::hopeless_after`] restarts scores less, the object is not there: no more restarts,
    /// and no second search (0.3: a true pose scores over 0.5 nearly always).
    pub hopeless_score: f32,
    /// Restarts after which a search may be given up, 1 to 1000 (3).
    pub hopeless_after: usize,
    /// Two restarts agree when their scores differ by less (0.03),
    pub same_score: f32,
    /// their origins by less, metres (0.006),
    pub same_position_m: f32,
    /// and their convex hulls by less (Hausdorff distance), metres (0.015).
    pub same_hull_m: f32,
}

impl Default for RestartSettings {
    fn default() -> Self {
        Self {
            most: 8,
            sure_score: 0.75,
            hopeless_score: 0.3,
            hopeless_after: 3,
            same_score: 0.03,
            same_position_m: 0.006,
            same_hull_m: 0.015,
        }
    }
}

impl RestartSettings {
    /// What is wrong with a value, if anything: its field, the value and the range.
    ///
    /// # Errors
    /// That, for the first such field.
    pub fn validate(&self) -> Checked {
        within("most", self.most, 1..=1000, "")?;
        within("sure_score", self.sure_score, -10.0..=10.0, "")?;
        within("hopeless_score", self.hopeless_score, -10.0..=10.0, "")?;
        within("hopeless_after", self.hopeless_after, 1..=1000, "")?;
        within("same_score", self.same_score, 0.0..=10.0, "")?;
        within("same_position_m", self.same_position_m, 0.0..=10.0, "metres")?;
        within("same_hull_m", self.same_hull_m, 0.0..=10.0, "metres")
    }
}
