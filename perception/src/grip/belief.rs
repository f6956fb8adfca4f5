//! From places to a posterior: masses, confidence, and poses that stand for it.

use grip_sim::pose::{Camera, Object, Pose};
use nalgebra::Vector6;
use rand::Rng;

use super::places::Place;
use super::settings::{GripSettings, ScoreSettings};
use crate::model::Model;
use crate::particles::{SearchResult, believed, typed};
use crate::posterior::{Mode, PosePosterior};

/// What is believed after a search: of each instance that was found the places where it may be.
pub(super) fn posterior(
    model: &Model,
    mut found: SearchResult,
    places: &[Vec<Place>],
    seconds: f64,
    settings: &GripSettings,
    rng: &mut impl Rng,
) -> PosePosterior {
    let presence = |found: &SearchResult| {
        1.0 / (1.0
            + (-(evidence(found, &settings.score) - settings.belief.presence_score)
                / settings.belief.presence_scale)
                .exp())
    };
    // One restart that nobody confirms is worth half, unless it is sure.
    let confirmed = found.agreeing >= 2
        || settings.restarts.most == 1
        || found.best.score >= settings.restarts.sure_score;
    let first = presence(&found);
    let confidence = if confirmed { first } else { 0.5 * first };
    // Further instances have their share by how sure it is that they are there.
    let others = std::mem::take(&mut found.others);
    let mut shares: Vec<f64> = std::iter::once(first).chain(others.iter().map(presence)).collect();
    let sum: f64 = shares.iter().sum();
    // Where nothing is believed there is still a best pose.
    let one = shares.len() as f64;
    shares.iter_mut().for_each(|share| *share = if sum > 0.0 { *share / sum } else { 1.0 / one });
    found.hypotheses += others.iter().map(|other| other.hypotheses).sum::<usize>();
    let mut modes: Vec<Mode> = Vec::new();
    for (places, share) in places.iter().zip(shares) {
        modes.extend(places.iter().map(|place| {
            // Where too little is seen, all that is known before.
            let prior = || settings.uncertainty.prior();
            let covariance = place.fit.as_ref().map_or_else(prior, |fit| fit.covariance);
            let pose = typed(&place.best.pose);
            let noise_m = place.fit.as_ref().map(|fit| fit.noise_m);
            let degrees_of_freedom = Some(settings.uncertainty.degrees_of_freedom);
            Mode {
                noise_m,
                degrees_of_freedom,
                ..Mode::new(pose, share * place.mass, place.best.score.into(), &covariance)
            }
        }));
    }
    // As far as the best pose is not believed the object is somewhere about, anyhow turned: no place, and no part of the spread.
    modes.iter_mut().for_each(|mode| mode.mass *= confidence);
    let covariance = settings.uncertainty.lost(model.radius.into());
    let lost = Mode {
        degrees_of_freedom: Some(settings.uncertainty.degrees_of_freedom),
        ..Mode::new(typed(&found.best.pose), 1.0 - confidence, found.best.score.into(), &covariance)
    };
    let mut belief = believed(model, found, modes, Vec::new(), confidence, seconds);
    belief.modes.push(lost);
    if let Some((_, rest)) = belief.modes.split_first_mut() {
        rest.sort_by(|a, b| b.mass.total_cmp(&a.mass));
    }
    belief.particles = drawn(&belief.modes, settings.uncertainty.particles, rng);
    belief
}

/// `count` poses of equal weight, drawn from the modes by their masses; the first is the best pose itself.
fn drawn(modes: &[Mode], count: usize, rng: &mut impl Rng) -> Vec<(Pose<Camera, Object>, f64)> {
    let mut particles = Vec::with_capacity(count);
    let (mut sum, mut step) = (0.0, 0);
    for (i, mode) in modes.iter().enumerate() {
        sum += mode.mass;
        let root = mode.root();
        // At even steps of the summed masses; the last mode takes what rounding leaves.
        let last = i + 1 == modes.len();
        while step < count && (last || (step as f64 + 0.5) / (count as f64) < sum) {
            let still = step == 0 && i == 0;
            let by = if still { Vector6::zeros() } else { mode.drawn(&root, rng) };
            particles.push((mode.displaced(&by), 1.0 / count as f64));
            step += 1;
        }
    }
    particles
}

/// The score as a sign that the object is there: the box term counts for as much as the best box is believed, since a detector
/// that darkness fools says nothing against an object. (The search itself compares plain scores.)
pub(super) fn evidence(found: &SearchResult, settings: &ScoreSettings) -> f64 {
    let others = settings.fit_weight + settings.edge_weight;
    let whole = f64::from(others + settings.box_weight);
    let reachable = f64::from(others) + f64::from(settings.box_weight) * found.box_confidence;
    f64::from(found.best.score) * whole / reachable
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use nalgebra::Matrix6;

    use super::*;
    use crate::particles::ScoredPose;
    use grip_sim::rng;

    #[test]
    fn a_detector_that_says_nothing_says_nothing_against_an_object() {
        let settings = ScoreSettings::default();
        let pose = Isometry3::translation(0.0, 0.0, 1.0);
        let best = ScoredPose { pose, score: 0.5 };
        let mut found = SearchResult {
            best,
            population: vec![best],
            others: Vec::new(),
            restarts: 1,
            agreeing: 1,
            hypotheses: 10,
            box_confidence: 1.0,
            trace: Vec::new(),
        };
        assert!((evidence(&found, &settings) - 0.5).abs() < 1e-6);
        // Without boxes only fit and silhouette, 1.0 of 1.3, can be reached.
        found.box_confidence = 0.0;
        assert!((evidence(&found, &settings) - 0.65).abs() < 1e-6);
        found.box_confidence = 0.5;
        assert!((evidence(&found, &settings) - 0.5 * 1.3 / 1.15).abs() < 1e-6);
    }

    #[test]
    fn particles_have_the_masses_and_spreads_of_their_modes() {
        let covariance = Matrix6::from_diagonal(&Vector6::new(1e-6, 4e-6, 9e-6, 1e-4, 4e-4, 9e-4));
        let at = |x: f64| Pose::from_xyz_rpy([x, 0.0, 1.0], [0.1, 0.2, 0.3]);
        let modes = [Mode::new(at(0.0), 0.7, 0.8, &covariance), Mode::new(at(1.0), 0.3, 0.7, &covariance)];
        let particles = drawn(&modes, 4000, &mut rng::stream(1, "t"));
        assert_eq!(particles.len(), 4000);
        assert!((particles[0].0.iso().inverse() * modes[0].pose.iso()).translation.vector.norm() < 1e-6);
        let of = |mode: usize| {
            particles.iter().map(|(p, _)| *p).filter(move |p| (p.translation().x > 0.5) == (mode == 1))
        };
        assert_eq!((of(0).count(), of(1).count()), (2800, 1200));
        for (i, mode) in modes.iter().enumerate() {
            let mut sum = Vector6::zeros();
            for pose in of(i) {
                sum += mode.displacement(&pose).map(|x| x * x);
            }
            let ratio = (sum / of(i).count() as f64).component_div(&covariance.diagonal());
            assert!(ratio.iter().all(|r| (r - 1.0).abs() < 0.15), "{ratio}");
        }
    }
}
