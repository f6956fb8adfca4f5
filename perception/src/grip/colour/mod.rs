//! Colour where depth cannot decide: of poses that explain the depth image equally well, the one whose printed surface
//! explains the colours. The last step, after the search; it never overrules geometry.
//!
//! Read in this order: [`ColourSettings`], `turns` (which poses depth confuses), `looks` (an object's printed surface),
//! `picture` (the colour image, prepared), `evidence` (one pose against the picture), and the decision, here.
//!
//! DIFFERENCE to the paper: its filter looks at depth alone. Set [`super::GripSettings::colour`] to `None` for that.

mod evidence;
mod looks;
mod picture;
mod settings;
#[cfg(test)]
mod tests;
mod turns;

use std::f32::consts::TAU;

use nalgebra::{Isometry3, UnitQuaternion};
use serde::{Deserialize, Serialize};

pub use self::settings::ColourSettings;

pub(crate) use self::looks::Looks;
pub(crate) use self::picture::Picture;
pub(crate) use self::turns::Turns;

use self::evidence::View;
use super::model::Model;
use super::search::{Found, Search};
use crate::error::Result;
use crate::hypotheses::Observation;

/// What colour had to say about a pose.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ColourVerdict {
    /// Poses compared with the one that depth prefers.
    pub candidates: usize,
    /// Log-likelihood that the best of them gains over that one, nats a point of the surface; below
    /// [`ColourSettings::min_gain`] nothing is decided.
    pub gain: f64,
    /// Sum of the gains of the patches of the image over the root of the sum of their squares, which is a z-score where no
    /// patch says anything; below [`ColourSettings::min_consistency`] nothing is decided.
    pub consistency: f64,
    /// Whether the pose was left as depth has it: also where geometry refused the winner, where the print itself is lost in
    /// noise, and where a small turn explains the picture as well.
    pub abstained: bool,
}

/// Modes of the population that are looked at besides the turns: more would be noise of the search.
const MOST_MODES: usize = 6;
/// Two poses are one mode when they are turned against each other by less, radians.
const SAME_MODE_RAD: f32 = 0.35;
/// Winners that geometry may refuse before colour gives up: each costs a polish.
const MOST_POLISHED: usize = 4;
/// Share of the contrast of a winner's print that must be better than none of it.
const TRACE: f32 = 0.3;
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

/// Evidence for one pose against another.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Against {
    /// Log-likelihood ratio, nats.
    total: f32,
    /// The same a point.
    gain: f32,
    /// See [`ColourVerdict::consistency`].
    consistency: f32,
}

impl Against {
    fn decides(&self, settings: &ColourSettings) -> bool {
        self.gain >= settings.min_gain && self.consistency >= settings.min_consistency
    }
}

/// Replaces the best pose of `found` by a geometrically equal one that explains the picture significantly better, if there
/// is one. `None` when there is nothing to go by: no print on the object, nothing to confuse the pose with, too little seen.
pub(crate) fn decide(
    model: &Model,
    found: &mut Found,
    observation: &Observation,
    picture: &Picture,
    search: &mut Search<'_>,
    settings: &ColourSettings,
) -> Option<Result<ColourVerdict>> {
    let looks = model.looks()?;
    let best = found.best.pose;
    let view = View::new(looks, &best, observation, picture)?;
    let seen = |pose: &Isometry3<f32>| view.evidence(looks, pose, 1);
    let present = seen(&best).filter(|e| e.points >= settings.min_points)?;
    let judged = |pose: Isometry3<f32>| -> Option<Candidate> {
        Some(Candidate { pose, against: seen(&pose)?.against(&present) })
    };
    let (turns, middle) = (model.turns(), model.tight_box.translation.vector);
    let (mut candidates, mut near) = (Vec::new(), None);
    // Of a body of revolution the population's modes are all turns, too.
    if let Some(axis) = &turns.revolution {
        let step = TAU / settings.revolution_steps as f32;
        let turned = |angle: f32, end: &UnitQuaternion<f32>| {
            turns::about(&best, &middle, &(UnitQuaternion::from_axis_angle(axis, angle) * end))
        };
        let sketch = view.evidence(looks, &best, COARSE)?;
        let height = |angle: f32, end: &UnitQuaternion<f32>| {
            view.evidence(looks, &turned(angle, end), COARSE).map_or(f32::MIN, |e| e.against(&sketch).total)
        };
        let peak = |angle: f32, end: &UnitQuaternion<f32>| {
            judged(turned(refined(angle, step, |angle| height(angle, end)), end))
        };
        let peaks = peaks(turns, settings.revolution_steps, height);
        candidates.extend(peaks.into_iter().filter_map(|(angle, end)| peak(angle, end)));
        near = peak(0.0, &UnitQuaternion::identity());
        candidates.extend(near);
    } else {
        candidates.extend(modes(model, found, settings.depth_margin).into_iter().filter_map(judged));
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
        let trace = view.faded(looks, pose, TRACE).zip(view.faded(looks, pose, 0.0));
        trace.is_some_and(|(trace, none)| trace.against(&none).consistency >= settings.min_consistency)
    };
    let mut least = None;
    for candidate in standing.take(MOST_POLISHED) {
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
    turns: &Turns,
    steps: usize,
    height: impl Fn(f32, &UnitQuaternion<f32>) -> f32,
) -> Vec<(f32, &UnitQuaternion<f32>)> {
    let angle = |k: usize| TAU * k as f32 / steps as f32;
    let mut peaks: Vec<(f32, f32, &UnitQuaternion<f32>)> = Vec::new();
    for end in &turns.ends {
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
fn modes(model: &Model, found: &Found, margin: f32) -> Vec<Isometry3<f32>> {
    let best = &found.best;
    let middle = model.tight_box.translation.vector;
    let turned = |q: &UnitQuaternion<f32>| turns::about(&best.pose, &middle, q);
    let mut poses: Vec<Isometry3<f32>> = model.turns().ends.iter().map(turned).collect();
    let most = poses.len() + MOST_MODES;
    for h in found.population.iter().filter(|h| h.score > best.score - margin) {
        let same = |p: &Isometry3<f32>| p.rotation.angle_to(&h.pose.rotation) < SAME_MODE_RAD;
        if poses.len() < most && !same(&best.pose) && !poses.iter().any(same) {
            poses.push(h.pose);
        }
    }
    poses
}
