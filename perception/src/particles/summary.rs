//! From weighted particles to a posterior: modes, entropy and spread.

use grip_sim::objects::ObjectModel;
use grip_sim::pose::{Camera, Object, Pose};
use nalgebra::{Isometry3, Matrix6, Vector3};

use super::result::{ScoredPose, SearchResult, typed};
use crate::error::{Error, Result};
use crate::hull::{directions, reach};
use crate::model::Model;
use crate::posterior::{Mode, PosePosterior};
use crate::symmetry::SymmetryGroup;

/// Directions in which hulls are compared.
const DIRECTIONS: usize = 64;
/// Two particles are in one mode when their convex hulls are this near (Hausdorff distance), metres, as the restarts of a
/// search are one that end so near.
const MODE_M: f32 = 0.015;
/// Confidence from which an object is said to be there.
const THERE: f64 = 0.5;

/// No hypothesis could be drawn, so nothing is known: a point at the camera with no confidence.
pub(crate) fn nothing(model: &Model, seconds: f64) -> PosePosterior {
    PosePosterior {
        object: model.name.clone(),
        best: Pose::identity(),
        particles: vec![(Pose::identity(), 1.0)],
        modes: Vec::new(),
        entropy: 0.0,
        score: 0.0,
        confidence: 0.0,
        there: false,
        terms: Default::default(),
        position_std_m: f64::INFINITY,
        rotation_std_rad: f64::INFINITY,
        restarts: 0,
        hypotheses: 0,
        followed: 0,
        seconds,
        colour: None,
        trace: Vec::new(),
    }
}

/// What is believed after a search; `weights` are those of the population.
pub(crate) fn summarized(
    model: &Model,
    found: SearchResult,
    weights: Vec<f64>,
    confidence: f64,
    seconds: f64,
) -> PosePosterior {
    let population: Vec<(ScoredPose, f64)> = found.population.iter().copied().zip(weights).collect();
    let modes = modes(model, &found.best, &population);
    let particles = population.iter().map(|(h, w)| (h.pose, *w)).collect();
    believed(model, found, modes, particles, confidence, seconds)
}

/// What is believed after a search: modes, and weighted poses that stand for them.
pub(crate) fn believed(
    model: &Model,
    found: SearchResult,
    modes: Vec<Mode>,
    particles: Vec<(Isometry3<f32>, f64)>,
    confidence: f64,
    seconds: f64,
) -> PosePosterior {
    let (position_std_m, rotation_std_rad) = spread(&modes);
    let entropy = entropy(&modes);
    PosePosterior {
        object: model.name.clone(),
        best: typed(&found.best.pose),
        particles: particles.iter().map(|(pose, w)| (typed(pose), *w)).collect(),
        modes,
        entropy,
        score: f64::from(found.best.score),
        confidence,
        there: confidence >= THERE,
        terms: Default::default(),
        position_std_m,
        rotation_std_rad,
        restarts: found.restarts,
        hypotheses: found.hypotheses,
        followed: 0,
        seconds,
        colour: None,
        trace: found.trace,
    }
}

/// The symmetries of an object do not depend on how finely it is drawn.
const TRIANGLES: usize = 100;

impl PosePosterior {
    /// What another estimator believes of an object: its best pose with a score of its own scale, and other poses with their weights,
    /// which need not sum to 1. Without any it is sure. Nothing is said of its confidence, which is 1.
    ///
    /// # Errors
    /// When the object's mesh is none, or all weights are zero.
    pub fn of_samples(
        object: &ObjectModel,
        best: Pose<Camera, Object>,
        score: f64,
        samples: &[(Pose<Camera, Object>, f64)],
    ) -> Result<Self> {
        let name = &object.info.name;
        if samples.is_empty() {
            let mut sure = Self::certain(name, best);
            (sure.score, sure.modes[0].score) = (score, score);
            return Ok(sure);
        }
        let sum: f64 = samples.iter().map(|(_, weight)| weight).sum();
        if sum.is_nan() || sum <= 0.0 {
            return Err(Error::Object {
                object: name.clone(),
                message: format!("the samples' weights sum to {sum}"),
            });
        }
        let model = Model::new(object, &[TRIANGLES])?;
        let scored =
            |pose: &Pose<Camera, Object>| ScoredPose { pose: pose.iso().cast(), score: score as f32 };
        let population: Vec<(ScoredPose, f64)> =
            samples.iter().map(|(pose, weight)| (scored(pose), weight / sum)).collect();
        let modes = modes(&model, &scored(&best), &population);
        let (position_std_m, rotation_std_rad) = spread(&modes);
        let particles = samples.iter().map(|(pose, weight)| (*pose, weight / sum)).collect();
        let entropy = entropy(&modes);
        Ok(Self {
            particles,
            modes,
            entropy,
            score,
            position_std_m,
            rotation_std_rad,
            ..Self::certain(name, best)
        })
    }
}

/// Of the modes' masses, nats.
fn entropy(modes: &[Mode]) -> f64 {
    modes.iter().map(|m| if m.mass > 0.0 { -m.mass * m.mass.ln() } else { 0.0 }).sum()
}

/// Root mean square of how far an object is from where and how it lies in the mean (position) and in the first mode
/// (orientation), metres and radians.
fn spread(modes: &[Mode]) -> (f64, f64) {
    let mass: f64 = modes.iter().map(|mode| mode.mass).sum();
    let Some(first) = modes.first().filter(|_| mass > 0.0) else { return (f64::INFINITY, f64::INFINITY) };
    let weighted = || modes.iter().map(|mode| (mode, mode.mass / mass));
    let mean = weighted().fold(Vector3::zeros(), |sum, (mode, w)| sum + mode.pose.translation() * w);
    let position: f64 = weighted()
        .map(|(mode, w)| w * (mode.position_std_m.powi(2) + (mode.pose.translation() - mean).norm_squared()))
        .sum();
    (position.sqrt(), first.rotation_std_rad)
}

/// Particles whose hulls are near that of the first.
struct Place {
    first: ScoredPose,
    /// How far its hull reaches.
    outline: Vec<f32>,
    members: Vec<(ScoredPose, f64)>,
}

/// The places of the population, that of the best pose first, then by falling mass.
fn modes(model: &Model, best: &ScoredPose, population: &[(ScoredPose, f64)]) -> Vec<Mode> {
    let outline = |pose: &Isometry3<f32>| -> Vec<f32> {
        directions(DIRECTIONS).map(|d| reach(&model.hull, pose, &d)).collect()
    };
    let near = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < MODE_M);
    let mut places = vec![Place { first: *best, outline: outline(&best.pose), members: Vec::new() }];
    // The population is sorted by score within each instance, so that places are opened by their best particles.
    for &(h, w) in population {
        let outline = outline(&h.pose);
        match places.iter_mut().find(|place| near(&place.outline, &outline)) {
            Some(place) => place.members.push((h, w)),
            None => places.push(Place { first: h, outline, members: vec![(h, w)] }),
        }
    }
    let mode = |Place { first, members, .. }: Place| {
        let mass = members.iter().map(|(_, w)| w).sum();
        let covariance = covariance(model.symmetry(), &first.pose, &members);
        Mode::new(typed(&first.pose), mass, first.score.into(), &covariance)
    };
    let mut modes: Vec<Mode> = places.into_iter().map(mode).collect();
    if let Some((_, rest)) = modes.split_first_mut() {
        rest.sort_by(|a, b| b.mass.total_cmp(&a.mass));
    }
    modes
}

/// Of weighted poses about `first`, each taken in that of its equal orientations which is nearest to it.
fn covariance(
    symmetry: &SymmetryGroup,
    first: &Isometry3<f32>,
    members: &[(ScoredPose, f64)],
) -> Matrix6<f64> {
    let mass: f64 = members.iter().map(|(_, w)| w).sum();
    if mass.is_nan() || mass <= 0.0 {
        return Matrix6::zeros();
    }
    let about = Mode::new(typed(first), 1.0, 1.0, &Matrix6::zeros());
    let mut sum = Matrix6::zeros();
    for (h, w) in members {
        let off = about.displacement(&typed(&symmetry.nearest(&h.pose, first)));
        sum += off * off.transpose() * (w / mass);
    }
    sum
}

#[cfg(test)]
mod tests {
    use nalgebra::{Translation3, UnitQuaternion};

    use super::*;
    use crate::model::fixtures::{can, skew_box};

    fn at(x: f32, turn: Vector3<f32>, score: f32) -> ScoredPose {
        let rotation = UnitQuaternion::from_scaled_axis(turn);
        ScoredPose { pose: Isometry3::from_parts(Translation3::new(x, 0.0, 0.8), rotation), score }
    }

    fn found(population: Vec<ScoredPose>) -> SearchResult {
        let best = population[0];
        SearchResult {
            best,
            population,
            others: Vec::new(),
            restarts: 1,
            agreeing: 1,
            hypotheses: 10,
            box_confidence: 1.0,
            trace: Vec::new(),
        }
    }

    #[test]
    fn two_places_of_equal_weight_are_two_modes_and_one_bit_of_entropy() {
        let still = Vector3::zeros();
        let population =
            vec![at(0.0, still, 0.8), at(0.1, still, 0.8), at(0.001, still, 0.8), at(0.101, still, 0.8)];
        let p = summarized(&skew_box([0.05, 0.08, 0.1]), found(population), vec![0.25; 4], 0.9, 0.0);
        let masses: Vec<f64> = p.modes.iter().map(|m| m.mass).collect();
        assert_eq!(masses, [0.5, 0.5]);
        assert!((p.entropy - 2f64.ln()).abs() < 1e-12);
        // About the first of two that are a millimetre apart.
        assert!((p.modes[1].position_std_m - 0.001 / 2f64.sqrt()).abs() < 1e-6);
        assert!(p.there && p.modes[0].pose == p.best);
    }

    #[test]
    fn a_turned_can_is_one_mode_without_spread() {
        let can = can(0.03, 0.1);
        let turned = |angle: f32| Vector3::new(0.0, 0.0, angle);
        let population: Vec<ScoredPose> = (0..12).map(|i| at(0.0, turned(0.5 * i as f32), 0.8)).collect();
        let p = summarized(&can, found(population), vec![1.0 / 12.0; 12], 0.9, 0.0);
        assert_eq!(p.modes.len(), 1);
        assert!(p.entropy.abs() < 1e-9 && p.modes[0].rotation_std_rad < 0.02, "{:?}", p.modes[0]);
    }

    #[test]
    fn the_covariance_is_that_of_the_poses_about_the_best() {
        let model = skew_box([0.05, 0.08, 0.1]);
        let population =
            vec![at(0.0, Vector3::new(0.0, 0.1, 0.0), 0.8), at(0.003, Vector3::new(0.0, -0.06, 0.0), 0.8)];
        let p = summarized(&model, found(population), vec![0.5, 0.5], 0.9, 0.0);
        let covariance = p.modes[0].covariance();
        assert!((covariance[(0, 0)] - 0.5 * 0.003_f64.powi(2)).abs() < 1e-9);
        assert!((covariance[(4, 4)] - 0.5 * 0.16_f64.powi(2)).abs() < 1e-5);
        assert!((covariance[(0, 4)] + 0.5 * 0.003 * 0.16).abs() < 1e-6);
        // And what is off by it is found again.
        let off = p.modes[0].displacement(&p.particles[1].0);
        assert!(
            (p.modes[0].displaced(&off).iso().inverse() * p.particles[1].0.iso()).rotation.angle() < 1e-6
        );
    }
}
