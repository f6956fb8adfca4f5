//! How far off poses may be.

use nalgebra::{Matrix6, Vector6};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::checks::{Checked, positive, within};

/// What the covariance of a pose is made of, beside what the depth image itself says. Figures in brackets are the defaults.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct UncertaintySettings {
    /// To what the silhouette is known, pixels of the picture, 0.1 to 100 (2).
    pub edge_px: f64,
    /// Errors of depth that are no smaller, metres, over 0 (0.0001).
    pub least_noise_m: f64,
    /// How far off a pose can be at all: its position, metres, over 0 (0.02),
    pub prior_m: f64,
    /// and its orientation, radians, over 0 (1).
    pub prior_rad: f64,
    /// Standard deviations are larger than errors of depth explain by this factor, over 0 (1.3).
    pub inflation: f64,
    /// The camera's slow errors, which an object as a whole shares and does not show, metres at 1 m, 0 to 1 each: along the ray,
    /// growing with the square of the distance; across it, growing with the distance; and of turns, by which the object's
    /// rim is moved (0.00082, 0.00015, 0.00037: the `carmine-109`; for another camera in proportion).
    pub slow_m: [f64; 3],
    /// Degrees of freedom of the t distribution, over 2 (4.5): how large errors are is known from few cells alone.
    pub degrees_of_freedom: f64,
    /// Modes besides the best one that are looked at, 0 to 100 (6).
    pub most_places: usize,
    /// Poses that are drawn of all modes together, 1 to 10000 (64).
    pub particles: usize,
}

impl Default for UncertaintySettings {
    fn default() -> Self {
        Self {
            edge_px: 2.0,
            least_noise_m: 0.0001,
            prior_m: 0.02,
            prior_rad: 1.0,
            inflation: 1.3,
            slow_m: [0.00082, 0.00015, 0.00037],
            degrees_of_freedom: 4.5,
            most_places: 6,
            particles: 64,
        }
    }
}

impl UncertaintySettings {
    /// What is known of a pose before anything is measured.
    pub(crate) fn prior(&self) -> Matrix6<f64> {
        self.about(self.prior_m)
    }

    /// Where an object of this radius is that is not where it was found: within half of it about there.
    pub(crate) fn lost(&self, radius: f64) -> Matrix6<f64> {
        self.about(0.5 * radius)
    }

    /// Off by so much in each direction, metres, and turned as it may be.
    fn about(&self, metres: f64) -> Matrix6<f64> {
        let (position, turn) = (metres.powi(2), self.prior_rad.powi(2));
        Matrix6::from_diagonal(&Vector6::new(position, position, position, turn, turn, turn))
    }

    /// What is wrong with a value, if anything: its field, the value and the range.
    ///
    /// # Errors
    /// That, for the first such field.
    pub fn validate(&self) -> Checked {
        within("edge_px", self.edge_px, 0.1..=100.0, "pixels")?;
        positive("least_noise_m", self.least_noise_m)?;
        positive("prior_m", self.prior_m)?;
        positive("prior_rad", self.prior_rad)?;
        positive("inflation", self.inflation)?;
        for slow in self.slow_m {
            within("slow_m", slow, 0.0..=1.0, "m")?;
        }
        within("degrees_of_freedom", self.degrees_of_freedom, 2.01..=1e6, "")?;
        within("most_places", self.most_places, 0..=100, "")?;
        within("particles", self.particles, 1..=10_000, "")
    }
}
