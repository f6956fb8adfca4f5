//! From scores to weights and confidence.

use super::settings::{GripSettings, ScoreSettings};
use crate::model::Model;
use crate::particles::{ScoredPose, SearchResult, nothing, summarized};
use crate::posterior::PosePosterior;

/// What is believed after a search.
pub(super) fn posterior(
    model: &Model,
    found: Option<SearchResult>,
    seconds: f64,
    settings: &GripSettings,
) -> PosePosterior {
    let presence = |found: &SearchResult| {
        1.0 / (1.0
            + (-(evidence(found, &settings.score) - settings.belief.presence_score)
                / settings.belief.presence_scale)
                .exp())
    };
    let Some(mut found) = found else { return nothing(model, seconds) };
    // One restart that nobody confirms is worth half, unless it is sure.
    let confirmed = found.agreeing >= 2
        || settings.restarts.most == 1
        || found.best.score >= settings.restarts.sure_score;
    let first = presence(&found);
    let confidence = if confirmed { first } else { 0.5 * first };
    let mut weights = weights(&found.population, settings.belief.temperature);
    // Further instances have their share by how sure it is that they are there.
    let others = std::mem::take(&mut found.others);
    let shares: Vec<f64> = others.iter().map(presence).collect();
    let sum = first + shares.iter().sum::<f64>();
    if sum > 0.0 && !others.is_empty() {
        weights.iter_mut().for_each(|w| *w *= first / sum);
        for (other, share) in others.into_iter().zip(shares) {
            let of_other = self::weights(&other.population, settings.belief.temperature);
            weights.extend(of_other.into_iter().map(|w| w * share / sum));
            found.hypotheses += other.hypotheses;
            found.population.extend(other.population);
        }
    }
    summarized(model, found, weights, confidence, seconds)
}

/// The score as a sign that the object is there: the box term counts for as much as the best box is believed, since a detector
/// that darkness fools says nothing against an object. (The search itself compares plain scores.)
pub(super) fn evidence(found: &SearchResult, settings: &ScoreSettings) -> f64 {
    let others = settings.fit_weight + settings.edge_weight;
    let whole = f64::from(others + settings.box_weight);
    let reachable = f64::from(others) + f64::from(settings.box_weight) * found.box_confidence;
    f64::from(found.best.score) * whole / reachable
}

/// Weights of tempered scores; they sum to 1.
fn weights(population: &[ScoredPose], temperature: f64) -> Vec<f64> {
    let best = population.iter().map(|h| h.score).fold(f32::MIN, f32::max);
    let raw: Vec<f64> = population.iter().map(|h| (f64::from(h.score - best) / temperature).exp()).collect();
    let sum: f64 = raw.iter().sum();
    raw.iter().map(|w| w / sum).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;

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
}
