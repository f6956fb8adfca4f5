//! A result against itself, turned so that it nearly lies on itself: a box the wrong way round, a clamp on its other side, a mug
//! with its handle elsewhere fit nearly as well, and a search that ended at one of these does not leave it.
//!
//! DIFFERENCE to the paper: its filter, and the score of ours, ask how well the pixels of a hypothesis are explained. A mug whose
//! handle hides behind it explains all of its pixels, too, though the handle in the image is left over. So poses of one object
//! at one place are also compared by how much of the image they explain.

use nalgebra::Isometry3;

use super::score::Parts;
use super::search::Search;
use crate::error::Result;
use crate::hypotheses::Batch;
use crate::particles::ScoredPose;

impl Search<'_> {
    /// The best of `found` and of what it is easily taken for. Those that were polished go to the population.
    pub(super) fn best_of_near_symmetric(
        &mut self,
        found: ScoredPose,
        population: &mut Vec<ScoredPose>,
    ) -> Result<ScoredPose> {
        let (model, settings) = (self.model(), &self.settings().near_symmetry);
        if !settings.enabled || model.near_symmetries().is_empty() {
            return Ok(found);
        }
        let batch = Batch {
            lod: model.lod(settings.triangles),
            stride: settings.stride,
            kernel: settings.kernel,
            steps: settings.steps,
            ..self.full_batch()
        };
        let turned = model.near_symmetries().iter().map(|turn| found.pose * turn);
        let mut poses: Vec<Isometry3<f32>> = std::iter::once(found.pose).chain(turned).collect();
        let merits = self.merits(&batch, &mut poses)?;
        let least = merits[0] - settings.margin;
        let mut order: Vec<usize> = (1..poses.len()).filter(|&i| merits[i] >= least).collect();
        order.sort_by(|&a, &b| merits[b].total_cmp(&merits[a]));
        let mut apart: Vec<Isometry3<f32>> = Vec::new();
        for pose in order.into_iter().map(|i| poses[i]) {
            let far = |other: &Isometry3<f32>| other.rotation.angle_to(&pose.rotation) > settings.apart_rad;
            if apart.len() < settings.finalists && apart.iter().all(far) {
                apart.push(pose);
            }
        }
        let polished = self.polished(apart)?;
        let rivals: Vec<ScoredPose> = std::iter::once(found).chain(polished.iter().copied()).collect();
        let mut poses: Vec<Isometry3<f32>> = rivals.iter().map(|h| h.pose).collect();
        let merits = self.merits(&self.full_batch(), &mut poses)?;
        population.extend(polished);
        // The first of equals: a turn must be better.
        let best = rivals.into_iter().zip(merits).reduce(|a, b| if b.1 > a.1 { b } else { a });
        Ok(best.map_or(found, |(h, _)| h))
    }

    /// Moves poses as the batch says; their scores, and beside them what they explain more than the first.
    fn merits(&mut self, batch: &Batch<'_>, poses: &mut [Isometry3<f32>]) -> Result<Vec<f32>> {
        let weight = self.settings().near_symmetry.explained_weight;
        let judged = self.judged(batch, poses)?;
        let first = judged.first().map_or(0.0, |p| p.explained).max(1.0);
        Ok(judged.iter().map(|p: &Parts| p.score() + weight * (p.explained / first - 1.0)).collect())
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Translation3, UnitQuaternion, Vector3};

    use super::*;
    use crate::grip::settings::GripSettings;
    use crate::hypotheses::Cpu;
    use crate::hypotheses::tests::observe;
    use crate::model::fixtures::mug;

    /// Upright, seen from a little above, the handle to the right; and with the handle behind it.
    fn seen_and_hidden() -> [Isometry3<f32>; 2] {
        let upright = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 1.8);
        let seen = Isometry3::from_parts(Translation3::new(0.0, 0.0, 0.8), upright);
        [seen, seen * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f32::consts::FRAC_PI_2)]
    }

    #[test]
    fn what_is_left_over_tells_where_shares_do_not() {
        let model = mug(0.04, 0.1);
        let [seen, hidden] = seen_and_hidden();
        let observation = observe(&model, &seen);
        let gain = |explained_weight: f32| {
            // Depth alone: how well the pixels of a pose are explained.
            let mut settings = GripSettings::default();
            settings.score.edge_weight = 0.0;
            settings.near_symmetry.explained_weight = explained_weight;
            let mut cpu = Cpu::default();
            let mut search = Search::new(&model, &observation, &[], &settings, &mut cpu);
            let batch = search.full_batch();
            let merits = search.merits(&batch, &mut [hidden, seen]).unwrap();
            merits[1] - merits[0]
        };
        let (without, with) = (gain(0.0), gain(GripSettings::default().near_symmetry.explained_weight));
        assert!(without.abs() < 0.02, "{without}");
        assert!(with > without + 0.03, "{with} {without}");
    }

    #[test]
    fn a_search_leaves_a_mug_with_its_handle_behind() {
        let model = mug(0.04, 0.1);
        let [truth, behind] = seen_and_hidden();
        let observation = observe(&model, &truth);
        let settings = GripSettings::default();
        let mut cpu = Cpu::default();
        let mut search = Search::new(&model, &observation, &[], &settings, &mut cpu);
        let found = search.polished(vec![behind]).unwrap()[0];
        let mut population = Vec::new();
        let best = search.best_of_near_symmetric(found, &mut population).unwrap();
        let off = best.pose.rotation.angle_to(&truth.rotation);
        assert!(off < 0.05, "{off} rad from the truth; {population:?}");
        // What is right already stays.
        let same = search.best_of_near_symmetric(best, &mut population).unwrap();
        assert!(same.pose.rotation.angle_to(&truth.rotation) < 0.05);
    }
}
