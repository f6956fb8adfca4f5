//! From what a search found to what is believed: weights, modes, spread, confidence.

use grip_sim::pose::Pose;
use nalgebra::{Isometry3, Matrix4, Quaternion, Translation3, UnitQuaternion, Vector3, Vector4};

use super::colour::Turns;
use super::model::{Model, directions};
use super::search::{Found, Hypothesis, reach};
use super::settings::GripSettings;
use crate::posterior::{Mode, PosePosterior};

/// Directions in which hulls are compared.
const DIRECTIONS: usize = 64;
/// Two particles are in one mode when their convex hulls are this near (Hausdorff distance), metres, as the restarts of a
/// search are one that end so near.
const MODE_M: f32 = 0.015;
/// Confidence from which an object is said to be there.
const THERE: f64 = 0.5;

/// Weights and confidence of what a search found.
pub(super) fn posterior(
    model: &Model,
    found: Option<Found>,
    seconds: f64,
    settings: &GripSettings,
) -> PosePosterior {
    let presence = |found: &Found| {
        1.0 / (1.0 + (-(found.evidence(settings) - settings.presence_score) / settings.presence_scale).exp())
    };
    let Some(mut found) = found else { return nothing(model, seconds) };
    // One restart that nobody confirms is worth half, unless it is sure.
    let confirmed =
        found.agreeing >= 2 || settings.max_restarts == 1 || found.best.score >= settings.sure_score;
    let first = presence(&found);
    let confidence = if confirmed { first } else { 0.5 * first };
    let mut weights = weights(&found.population, settings.posterior_temperature);
    // Further instances have their share by how sure it is that they are there.
    let others = std::mem::take(&mut found.others);
    let shares: Vec<f64> = others.iter().map(presence).collect();
    let sum = first + shares.iter().sum::<f64>();
    if sum > 0.0 && !others.is_empty() {
        weights.iter_mut().for_each(|w| *w *= first / sum);
        for (other, share) in others.into_iter().zip(shares) {
            let of_other = self::weights(&other.population, settings.posterior_temperature);
            weights.extend(of_other.into_iter().map(|w| w * share / sum));
            found.hypotheses += other.hypotheses;
            found.population.extend(other.population);
        }
    }
    belief(model, Some(found), weights, confidence, seconds)
}

/// No hypothesis could be drawn, so nothing is known: a point at the camera with no confidence.
fn nothing(model: &Model, seconds: f64) -> PosePosterior {
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
        seconds,
        colour: None,
        trace: Vec::new(),
    }
}

/// What is believed after a search; `weights` are those of the population.
pub(super) fn belief(
    model: &Model,
    found: Option<Found>,
    weights: Vec<f64>,
    confidence: f64,
    seconds: f64,
) -> PosePosterior {
    let Some(found) = found else { return nothing(model, seconds) };
    let population: Vec<(Hypothesis, f64)> = found.population.iter().copied().zip(weights).collect();
    let (position_std_m, rotation_std_rad) = spread(model, &population, &found.best.pose);
    let modes = modes(model, &found.best, &population);
    let entropy = modes.iter().map(|m| if m.mass > 0.0 { -m.mass * m.mass.ln() } else { 0.0 }).sum();
    PosePosterior {
        object: model.name.clone(),
        best: typed(&found.best.pose),
        particles: population.iter().map(|(h, w)| (typed(&h.pose), *w)).collect(),
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
        seconds,
        colour: None,
        trace: found.trace,
    }
}

/// Particles whose hulls are near that of the first.
struct Place {
    first: Hypothesis,
    /// How far its hull reaches.
    outline: Vec<f32>,
    members: Vec<(Hypothesis, f64)>,
}

/// The places of the population, that of the best pose first, then by falling mass.
fn modes(model: &Model, best: &Hypothesis, population: &[(Hypothesis, f64)]) -> Vec<Mode> {
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
        let (position_std_m, rotation_std_rad) = spread(model, &members, &first.pose);
        Mode {
            pose: typed(&first.pose),
            mean: typed(&mean(model.turns(), &first.pose, &members)),
            mass: members.iter().map(|(_, w)| w).sum(),
            score: f64::from(first.score),
            position_std_m,
            rotation_std_rad,
        }
    };
    let mut modes: Vec<Mode> = places.into_iter().map(mode).collect();
    if let Some((_, rest)) = modes.split_first_mut() {
        rest.sort_by(|a, b| b.mass.total_cmp(&a.mass));
    }
    modes
}

/// Mean of poses of an object that looks the same after some turns: each is taken in that of its equal orientations which is
/// nearest to `first`. Rotations are averaged as Markley (2007) does.
fn mean(turns: &Turns, first: &Isometry3<f32>, members: &[(Hypothesis, f64)]) -> Isometry3<f32> {
    let mass: f64 = members.iter().map(|(_, w)| w).sum();
    if mass.is_nan() || mass <= 0.0 {
        return *first;
    }
    let mut position = Vector3::zeros();
    let mut products = Matrix4::<f64>::zeros();
    for (h, w) in members {
        let pose = turns.nearest(&h.pose, first);
        position += pose.translation.vector.cast::<f64>() * (w / mass);
        let q: Vector4<f64> = pose.rotation.coords.cast();
        products += q * q.transpose() * *w;
    }
    let eigen = products.symmetric_eigen();
    let q = Quaternion::from_vector(eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned());
    let rotation = UnitQuaternion::from_quaternion(q.cast());
    Isometry3::from_parts(Translation3::from(position.cast::<f32>()), rotation)
}

/// Root mean square distance of the origins from their mean, and of orientation: change of the hull's support function from
/// that at `reference`, relative to the object's radius.
fn spread(model: &Model, population: &[(Hypothesis, f64)], reference: &Isometry3<f32>) -> (f64, f64) {
    let mass: f64 = population.iter().map(|(_, w)| w).sum();
    if mass.is_nan() || mass <= 0.0 {
        return (0.0, 0.0);
    }
    let positions = || population.iter().map(|(h, w)| (h.pose.translation.vector.cast::<f64>(), w / mass));
    let mean = positions().fold(Vector3::zeros(), |m, (p, w)| m + p * w);
    let variance: f64 = positions().map(|(p, w)| w * (p - mean).norm_squared()).sum();
    let only_turned = |pose: &Isometry3<f32>| Isometry3::from_parts(Translation3::identity(), pose.rotation);
    let reference = only_turned(reference);
    let base: Vec<f32> = directions(DIRECTIONS).map(|d| reach(&model.hull, &reference, &d)).collect();
    let mut change = 0.0;
    for (h, w) in population {
        let turned = only_turned(&h.pose);
        let sum: f32 = directions(DIRECTIONS)
            .zip(&base)
            .map(|(d, b)| (reach(&model.hull, &turned, &d) - b).powi(2))
            .sum();
        change += w / mass * f64::from(sum) / DIRECTIONS as f64;
    }
    (variance.sqrt(), change.sqrt() / f64::from(model.radius))
}

fn weights(population: &[Hypothesis], temperature: f64) -> Vec<f64> {
    let best = population.iter().map(|h| h.score).fold(f32::MIN, f32::max);
    let raw: Vec<f64> = population.iter().map(|h| (f64::from(h.score - best) / temperature).exp()).collect();
    let sum: f64 = raw.iter().sum();
    raw.iter().map(|w| w / sum).collect()
}

/// In f64, between typed frames.
pub(super) fn typed<From, To>(pose: &Isometry3<f32>) -> Pose<From, To> {
    let q = UnitQuaternion::from_quaternion(pose.rotation.into_inner().cast());
    Pose::new(Isometry3::from_parts(pose.translation.vector.cast::<f64>().into(), q))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hypotheses::tests::{can, skew_box};

    fn at(x: f32, turn: Vector3<f32>, score: f32) -> Hypothesis {
        let rotation = UnitQuaternion::from_scaled_axis(turn);
        Hypothesis { pose: Isometry3::from_parts(Translation3::new(x, 0.0, 0.8), rotation), score }
    }

    fn found(population: Vec<Hypothesis>) -> Found {
        let best = population[0];
        Found {
            best,
            population,
            others: Vec::new(),
            restarts: 1,
            agreeing: 1,
            hypotheses: 10,
            believed: 1.0,
            trace: Vec::new(),
        }
    }

    #[test]
    fn a_detector_that_says_nothing_says_nothing_against_an_object() {
        let settings = GripSettings::default();
        let pose = Isometry3::translation(0.0, 0.0, 1.0);
        let mut found = found(vec![Hypothesis { pose, score: 0.5 }]);
        assert!((found.evidence(&settings) - 0.5).abs() < 1e-6);
        // Without boxes only fit and silhouette, 1.0 of 1.3, can be reached.
        found.believed = 0.0;
        assert!((found.evidence(&settings) - 0.65).abs() < 1e-6);
        found.believed = 0.5;
        assert!((found.evidence(&settings) - 0.5 * 1.3 / 1.15).abs() < 1e-6);
    }

    #[test]
    fn two_places_of_equal_weight_are_two_modes_and_one_bit_of_entropy() {
        let still = Vector3::zeros();
        let population =
            vec![at(0.0, still, 0.8), at(0.1, still, 0.8), at(0.001, still, 0.8), at(0.101, still, 0.8)];
        let p = belief(&skew_box([0.05, 0.08, 0.1]), Some(found(population)), vec![0.25; 4], 0.9, 0.0);
        let masses: Vec<f64> = p.modes.iter().map(|m| m.mass).collect();
        assert_eq!(masses, [0.5, 0.5]);
        assert!((p.entropy - 2f64.ln()).abs() < 1e-12);
        assert!((p.modes[1].mean.translation().x - 0.1005).abs() < 1e-6);
        assert!((p.modes[1].position_std_m - 0.0005).abs() < 1e-6);
        assert!(p.there && p.modes[0].pose == p.best);
    }

    #[test]
    fn a_turned_can_is_one_mode_with_a_mean_and_no_spread() {
        let can = can(0.03, 0.1);
        let turned = |angle: f32| Vector3::new(0.0, 0.0, angle);
        let population: Vec<Hypothesis> = (0..12).map(|i| at(0.0, turned(0.5 * i as f32), 0.8)).collect();
        let p = belief(&can, Some(found(population)), vec![1.0 / 12.0; 12], 0.9, 0.0);
        assert_eq!(p.modes.len(), 1);
        assert!(p.entropy.abs() < 1e-9 && p.modes[0].rotation_std_rad < 0.02, "{:?}", p.modes[0]);
        // Equal orientations are taken nearest to the best: the mean is the best.
        let off = p.modes[0].mean.iso().rotation.angle_to(&p.best.iso().rotation);
        assert!(off < 1e-3, "{off}");
    }

    #[test]
    fn the_mean_of_rotations_is_halfway() {
        let model = skew_box([0.05, 0.08, 0.1]);
        let population =
            vec![at(0.0, Vector3::new(0.0, 0.1, 0.0), 0.8), at(0.0, Vector3::new(0.0, -0.06, 0.0), 0.8)];
        let p = belief(&model, Some(found(population)), vec![0.5, 0.5], 0.9, 0.0);
        let mean = p.modes[0].mean.iso().rotation.scaled_axis();
        assert!((mean - Vector3::new(0.0, 0.02, 0.0)).norm() < 1e-4, "{mean}");
    }
}
