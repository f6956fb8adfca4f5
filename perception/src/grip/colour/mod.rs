//! Colour where depth cannot decide: of poses that explain the depth image equally well, the one whose printed surface
//! explains the colours. The last step, after the search; it never overrules geometry.
//!
//! Read in this order: [`ColourSettings`], [`crate::symmetry`] (which poses depth confuses), `crate::model` (an object's print),
//! `picture` (the colour image, prepared), `evidence` (one pose against the picture), and the decision, here.
//!
//! DIFFERENCE to the paper: its filter looks at depth alone. Set [`ColourSettings::enabled`] to false for that.

mod evidence;
mod picture;
#[cfg(test)]
mod tests;

use std::f32::consts::TAU;

use nalgebra::{Isometry3, UnitQuaternion};

pub(crate) use self::picture::Picture;

use self::evidence::{Against, View};
use super::search::Search;
use super::settings::ColourSettings;
use crate::error::Result;
use crate::model::Model;
use crate::observation::Observation;
use crate::particles::SearchResult;
use crate::posterior::ColourVerdict;
use crate::symmetry::{SymmetryGroup, turned_about};

/// Turns of a body of revolution are looked for with one point in so many,
const COARSE: usize = 3;
/// and so many of the best coarse ones are refined.
const REFINED: usize = 3;
/// Halvings of the step of these: from 15 degrees to one.
const HALVINGS: usize = 4;

/// A pose, and how much better than the present one it explains the picture.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    pose: Isometry3<f32>,
    against: Against,
}

/// Replaces the best pose of `found` by a geometrically equal one that explains the picture significantly better, if there
/// is one. `None` when there is nothing to go by: no print on the object, nothing to confuse the pose with, too little seen.
pub(crate) fn decide(
    model: &Model,
    found: &mut SearchResult,
    observation: &Observation,
    picture: &Picture,
    search: &mut Search<'_>,
    settings: &ColourSettings,
) -> Option<Result<ColourVerdict>> {
    let print = model.print()?;
    let best = found.best.pose;
    let view = View::new(print, &best, observation, picture)?;
    let seen = |pose: &Isometry3<f32>| view.evidence(print, pose, 1);
    let present = seen(&best).filter(|e| e.points >= settings.min_points)?;
    let judged = |pose: Isometry3<f32>| -> Option<Candidate> {
        Some(Candidate { pose, against: seen(&pose)?.against(&present) })
    };
    let (symmetry, middle) = (model.symmetry(), model.oriented_box.translation.vector);
    let (mut candidates, mut near) = (Vec::new(), None);
    // Of a body of revolution the population's modes are all turns, too.
    if let Some(axis) = &symmetry.revolution {
        let step = TAU / settings.revolution_steps as f32;
        let turned = |angle: f32, end: &UnitQuaternion<f32>| {
            turned_about(&best, &middle, &(UnitQuaternion::from_axis_angle(axis, angle) * end))
        };
        let sketch = view.evidence(print, &best, COARSE)?;
        let height = |angle: f32, end: &UnitQuaternion<f32>| {
            view.evidence(print, &turned(angle, end), COARSE).map_or(f32::MIN, |e| e.against(&sketch).total)
        };
        let peak = |angle: f32, end: &UnitQuaternion<f32>| {
            judged(turned(refined(angle, step, |angle| height(angle, end)), end))
        };
        let peaks = peaks(symmetry, settings.revolution_steps, height);
        candidates.extend(peaks.into_iter().filter_map(|(angle, end)| peak(angle, end)));
        near = peak(0.0, &UnitQuaternion::identity());
        candidates.extend(near);
    } else {
        candidates.extend(modes(model, found, settings).into_iter().filter_map(judged));
    }
    candidates.sort_by(|a, b| b.against.total.total_cmp(&a.against.total));
    let first = candidates.first()?.against;
    let mut verdict = ColourVerdict {
        candidates: candidates.len(),
        gain: f64::from(first.gain),
        consistency: f64::from(first.consistency),
        abstained: true,
    };
    // Print often repeats around a can: one that is nearly right is put right, not turned to the next copy.
    let rival = near.and_then(|n| Some((n.pose, seen(&n.pose)?)));
    let beats_rival = |pose: &Isometry3<f32>| {
        rival.as_ref().is_none_or(|(near, evidence)| {
            near == pose || seen(pose).is_some_and(|e| e.against(evidence).decides(settings))
        })
    };
    let standing = candidates.iter().filter(|c| c.against.decides(settings) && beats_rival(&c.pose));
    // In noise the pose with the least contrast is the likeliest: what decides must be there, not just be missing. A trace
    // of the print is better than none when the two correlate, whatever the contrast in dim light.
    let printed = |pose: &Isometry3<f32>| {
        let trace = view.faded(print, pose, settings.faded_contrast).zip(view.faded(print, pose, 0.0));
        trace.is_some_and(|(trace, none)| trace.against(&none).consistency >= settings.min_consistency)
    };
    let mut least = None;
    for candidate in standing.take(settings.finalists) {
        let mut polished = |pose| search.polished(vec![pose]).map(|polished| polished[0]);
        // Both polished in the same frame, so that their scores are comparable.
        let least = match least {
            Some(least) => least,
            None => match polished(best) {
                Ok(best) => *least.insert(best.score - settings.depth_margin),
                Err(error) => return Some(Err(error)),
            },
        };
        let polished = match polished(candidate.pose) {
            Ok(polished) => polished,
            Err(error) => return Some(Err(error)),
        };
        // The polish may have moved it.
        let against = seen(&polished.pose).map(|e| e.against(&present)).unwrap_or_default();
        if polished.score >= least && against.decides(settings) && printed(&polished.pose) {
            verdict.gain = f64::from(against.gain);
            verdict.consistency = f64::from(against.consistency);
            verdict.abstained = false;
            found.best = polished;
            found.population.insert(0, polished);
            break;
        }
    }
    Some(Ok(verdict))
}

/// The turns of a body of revolution, as angle and end, that are the highest maxima of `height` among coarse steps.
fn peaks(
    symmetry: &SymmetryGroup,
    steps: usize,
    height: impl Fn(f32, &UnitQuaternion<f32>) -> f32,
) -> Vec<(f32, &UnitQuaternion<f32>)> {
    let angle = |k: usize| TAU * k as f32 / steps as f32;
    let mut peaks: Vec<(f32, f32, &UnitQuaternion<f32>)> = Vec::new();
    for end in &symmetry.discrete {
        let heights: Vec<f32> = (0..steps).map(|k| height(angle(k), end)).collect();
        let at = |k: usize| heights[k % steps];
        let maxima = (0..steps).filter(|&k| at(k) >= at(k + 1) && at(k) > at(k + steps - 1));
        peaks.extend(maxima.map(|k| (at(k), angle(k), end)));
    }
    peaks.sort_by(|a, b| b.0.total_cmp(&a.0));
    peaks.into_iter().take(REFINED).map(|(_, angle, end)| (angle, end)).collect()
}

/// The angle moved to where it is higher by steps that are halved.
fn refined(mut angle: f32, mut step: f32, height: impl Fn(f32) -> f32) -> f32 {
    let mut best = height(angle);
    for _ in 0..HALVINGS {
        step /= 2.0;
        for side in [angle - step, angle + step] {
            let there = height(side);
            if there > best {
                (angle, best) = (side, there);
            }
        }
    }
    angle
}

/// The best pose turned in all ways that depth may not notice, and those of the population within the margin of it that are
/// none of these.
fn modes(model: &Model, found: &SearchResult, settings: &ColourSettings) -> Vec<Isometry3<f32>> {
    let best = &found.best;
    let middle = model.oriented_box.translation.vector;
    let turned = |q: &UnitQuaternion<f32>| turned_about(&best.pose, &middle, q);
    let mut poses: Vec<Isometry3<f32>> = model.symmetry().discrete.iter().map(turned).collect();
    let most = poses.len() + settings.most_modes;
    for h in found.population.iter().filter(|h| h.score > best.score - settings.depth_margin) {
        let same = |p: &Isometry3<f32>| p.rotation.angle_to(&h.pose.rotation) < settings.same_mode_rad;
        if poses.len() < most && !same(&best.pose) && !poses.iter().any(same) {
            poses.push(h.pose);
        }
    }
    poses
}
