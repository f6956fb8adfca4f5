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

use self::evidence::{Evidence, View};
use super::model::Model;
use super::search::{Found, Hypothesis, Search};
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
    /// Whether the pose was left as depth has it.
    pub abstained: bool,
}

/// Modes of the population that are looked at besides the turns: more would be noise of the search.
const MOST_MODES: usize = 6;
/// Two poses are one mode when they are turned against each other by less, radians.
const SAME_MODE_RAD: f32 = 0.35;
/// Winners that geometry may refuse before colour gives up: each costs a polish.
const MOST_POLISHED: usize = 4;
/// Coarse turns of a body of revolution are compared by one point in so many,
const COARSE: usize = 3;
/// and the best are refined.
const REFINED: usize = 3;
/// Halvings of the step of these: from 15 degrees to half a degree.
const HALVINGS: usize = 5;

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
) -> Option<ColourVerdict> {
    let looks = model.looks()?;
    let turns = model.turns();
    let best = found.best.pose;
    let view = View::new(looks, &best, observation, picture)?;
    let seen = |pose: &Isometry3<f32>| view.evidence(looks, pose, 1);
    let present = seen(&best).filter(|e| e.points >= settings.min_points)?;
    let judged = |pose: Isometry3<f32>| -> Option<Candidate> {
        Some(Candidate { pose, against: seen(&pose)?.against(&present) })
    };
    let turned = |q: &UnitQuaternion<f32>| turns::about(&best, &model.middle, q);
    let mut candidates: Vec<Candidate> = Vec::new();
    if let Some(axis) = &turns.revolution {
        let step = TAU / settings.revolution_steps as f32;
        let at = |angle: f32, end| turned(&(UnitQuaternion::from_axis_angle(axis, angle) * end));
        let sketch = view.evidence(looks, &best, COARSE)?;
        let height = |pose: &Isometry3<f32>| {
            view.evidence(looks, pose, COARSE).map_or(f32::MIN, |e| e.against(&sketch).total)
        };
        let mut peaks: Vec<(f32, f32, usize)> = Vec::new();
        for (i, end) in turns.ends.iter().enumerate() {
            let heights: Vec<f32> =
                (0..settings.revolution_steps).map(|k| height(&at(k as f32 * step, end))).collect();
            peaks.extend(maxima(&heights).map(|k| (heights[k], k as f32 * step, i)));
        }
        peaks.sort_by(|a, b| b.0.total_cmp(&a.0));
        peaks.truncate(REFINED);
        // The present pose's own peak last, see below.
        peaks.push((0.0, 0.0, 0));
        candidates.extend(
            peaks
                .into_iter()
                .filter_map(|(_, angle, i)| refined(angle, step, |angle| judged(at(angle, &turns.ends[i])))),
        );
    } else {
        let modes = modes(found, settings.depth_margin, turns.ends.iter().map(turned).collect());
        candidates.extend(modes.into_iter().filter_map(judged));
    }
    // Print often repeats around a can: one that is nearly right is put right, not turned to the next copy.
    let nearby = candidates.last().filter(|_| turns.revolution.is_some()).copied();
    let nearby_evidence = nearby.and_then(|c| seen(&c.pose));
    let settled = |pose: &Isometry3<f32>, evidence: &Evidence| {
        let rival = nearby_evidence.as_ref().filter(|_| nearby.is_some_and(|c| c.pose != *pose));
        let against = evidence.against(&present);
        let wins = rival.is_none_or(|rival| evidence.against(rival).decides(settings));
        (wins && against.decides(settings)).then_some(against)
    };
    candidates.sort_by(|a, b| b.against.total.total_cmp(&a.against.total));
    let first = candidates.first()?.against;
    let mut verdict = ColourVerdict {
        candidates: candidates.len(),
        gain: f64::from(first.gain),
        consistency: f64::from(first.consistency),
        abstained: true,
    };
    let mut least = None;
    let standing = candidates.iter().filter(|c| seen(&c.pose).and_then(|e| settled(&c.pose, &e)).is_some());
    for candidate in standing.take(MOST_POLISHED) {
        // Both polished in the same frame, so that their scores are comparable.
        let least =
            *least.get_or_insert_with(|| search.polished(vec![best])[0].score - settings.depth_margin);
        let polished = search.polished(vec![candidate.pose])[0];
        if polished.score < least {
            continue;
        }
        // The polish may have moved it.
        let Some(against) = seen(&polished.pose).map(|e| e.against(&present)).filter(|a| a.decides(settings))
        else {
            continue;
        };
        verdict.gain = f64::from(against.gain);
        verdict.consistency = f64::from(against.consistency);
        verdict.abstained = false;
        found.best = polished;
        found.population.insert(0, polished);
        break;
    }
    Some(verdict)
}

/// Where a closed curve has its maxima.
fn maxima(heights: &[f32]) -> impl Iterator<Item = usize> {
    let count = heights.len();
    let at = move |i: usize| heights[i % count];
    (0..count).filter(move |&i| at(i) >= at(i + 1) && at(i) > at(i + count - 1))
}

/// The turn by `angle` moved to the better side by steps that are halved.
fn refined(mut angle: f32, mut step: f32, at: impl Fn(f32) -> Option<Candidate>) -> Option<Candidate> {
    let mut best = at(angle)?;
    for _ in 0..HALVINGS {
        step /= 2.0;
        for side in [angle - step, angle + step] {
            if let Some(c) = at(side)
                && c.against.total > best.against.total
            {
                (angle, best) = (side, c);
            }
        }
    }
    Some(best)
}

/// The turned poses, and those of the population within the margin of the best that are none of them.
fn modes(found: &Found, margin: f32, mut poses: Vec<Isometry3<f32>>) -> Vec<Isometry3<f32>> {
    let turned = poses.len();
    let near = |h: &&Hypothesis| h.score > found.best.score - margin;
    for h in found.population.iter().filter(near) {
        if poses.len() == turned + MOST_MODES {
            break;
        }
        let known = |p: &Isometry3<f32>| p.rotation.angle_to(&h.pose.rotation) < SAME_MODE_RAD;
        if !known(&found.best.pose) && !poses.iter().any(known) {
            poses.push(h.pose);
        }
    }
    poses
}
