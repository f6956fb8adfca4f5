//! Colour where depth cannot decide: of poses that explain the depth image equally well, the one whose printed surface
//! explains the colours. The last step, after the search; it never overrules geometry.
//!
//! Read in this order: [`ColourSettings`], [`crate::symmetry`] (which poses depth confuses), `crate::model` (an object's print),
//! `picture` (the colour image, prepared), `sheet` (the print as seen at a pose), `agreement` (one against the other), `view` (at what
//! resolution), and the decision, here.
//!
//! DIFFERENCE to the paper: its filter looks at depth alone. Set [`ColourSettings::enabled`] to false for that.

mod agreement;
mod picture;
mod sheet;
#[cfg(test)]
mod tests;
mod view;

use std::f32::consts::TAU;

use grip_sim::frame::CameraFrame;
use grip_sim::mesh::Visual;
use grip_sim::pose::{Camera, Object, Pose};
use nalgebra::{Isometry3, UnitQuaternion};

pub(crate) use self::picture::Picture;

use self::agreement::Agreement;
use self::view::View;
use super::search::Search;
use super::settings::{ColourSettings, GripSettings};
use super::uncertainty::Fit;
use crate::error::Result;
use crate::model::{Model, Print};
use crate::observation::{Observation, ObservationSettings};
use crate::particles::{ScoredPose, SearchResult};
use crate::posterior::ColourVerdict;
use crate::support::SupportSettings;
use crate::symmetry::{SymmetryGroup, turned_about};

/// Of the other bodies' rivals so many are looked at closely, those whose sketches agree best.
const LOOKED_AT: usize = 8;
/// So many of the best coarse turns of a body of revolution are refined.
const REFINED: usize = 3;
/// Halvings of the step of these: from 15 degrees to one.
const HALVINGS: usize = 4;

/// How the prints of objects agree with a picture, for who wants to see why a pose is believed.
#[derive(Debug)]
pub struct ColourEvidence {
    picture: Picture,
    observation: Observation,
    settings: ColourSettings,
}

impl ColourEvidence {
    /// Of a frame; `None` where its colour and depth image differ in size.
    pub fn new(frame: &CameraFrame) -> Option<Self> {
        let settings = ObservationSettings { support: SupportSettings::off(), ..Default::default() };
        let observation = Observation::new(frame, &settings, None);
        Some(Self { picture: Picture::new(frame)?, observation, settings: ColourSettings::default() })
    }

    /// See [`ColourVerdict::agreement`]; `None` of an object of one colour, and where nothing of it is seen.
    pub fn agreement(&self, visual: &Visual, pose: &Pose<Camera, Object>) -> Option<f64> {
        let (print, pose) = (Print::new(visual)?, pose.iso().cast());
        let view = View::new(&print, &pose, &self.observation, &self.picture, &self.settings)?;
        view.agreement(&pose).map(|agreement| f64::from(agreement.total))
    }
}

/// Of the best pose of `found` and those that depth confuses with it, takes the one that depth and colour together like best:
/// whose score and weighted agreement with the picture sum to most. `None` when there is nothing to go by: no print on the
/// object, nothing to confuse the pose with, too little seen.
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
    let view = View::new(print, &best, observation, picture, settings)?;
    let present = view.agreement(&best).filter(|a| a.pixels >= settings.min_pixels)?;
    let mut rivals: Vec<(Isometry3<f32>, Agreement)> = rivals(model, found, &view, settings)
        .into_iter()
        .filter_map(|pose| Some((pose, view.agreement(&pose)?)))
        // What shows little of itself where the present pose shows much is not to be compared.
        .filter(|(_, a)| 2 * a.pixels >= present.pixels)
        .collect();
    rivals.sort_by(|a, b| b.1.total.total_cmp(&a.1.total));
    let first = &rivals.first()?.1;
    let verdict = |agreement: &Agreement, abstained: bool| ColourVerdict {
        candidates: rivals.len(),
        agreement: f64::from(agreement.total),
        gain: f64::from(agreement.total - present.total),
        abstained,
    };
    // Where depth itself is off by much, a lower depth score says little.
    let GripSettings { polish, uncertainty, .. } = search.settings();
    let noise =
        Fit::new(model, &best, observation, polish.triangles, uncertainty).map_or(0.0, |fit| fit.noise_m);
    let trust = settings.trust(noise);
    // Where print and picture are opposites they agree no less than where they have nothing in common.
    let gain = |a: &Agreement| settings.weight * (a.total.max(0.0) - present.total.max(0.0));
    // Before it is polished a pose need not be better by the margin yet.
    let mut standing: Vec<Isometry3<f32>> = Vec::new();
    for (pose, a) in &rivals {
        let apart = |other: &Isometry3<f32>| other.rotation.angle_to(&pose.rotation) > settings.same_mode_rad;
        if standing.len() < settings.finalists && gain(a) > 0.0 && standing.iter().all(apart) {
            standing.push(*pose);
        }
    }
    if standing.is_empty() {
        return Some(Ok(verdict(first, true)));
    }
    // All polished in one frame, so that their scores are comparable.
    let mut polished = |pose| search.polished(vec![pose]).map(|polished| polished[0]);
    let depth = match polished(best) {
        Ok(polished) => polished.score,
        Err(error) => return Some(Err(error)),
    };
    let mut chosen: Option<(f32, ScoredPose, Agreement)> = None;
    for pose in standing {
        let polished = match polished(pose) {
            Ok(polished) => polished,
            Err(error) => return Some(Err(error)),
        };
        // The polish may have moved it.
        let Some(agreement) = view.agreement(&polished.pose) else { continue };
        let lost = trust * (depth - polished.score);
        let merit = gain(&agreement) - lost;
        let better = chosen.as_ref().is_none_or(|(most, ..)| merit > *most);
        let there = agreement.total >= settings.min_agreement && lost <= settings.depth_margin;
        if better && there && merit >= settings.margin {
            chosen = Some((merit, polished, agreement));
        }
    }
    let Some((_, pose, agreement)) = chosen else { return Some(Ok(verdict(first, true))) };
    found.best = pose;
    found.population.insert(0, pose);
    Some(Ok(verdict(&agreement, false)))
}

/// How the print of an object at a pose agrees with the picture; `None` where there is no telling.
pub(super) fn agreement(
    model: &Model,
    pose: &Isometry3<f32>,
    observation: &Observation,
    picture: &Picture,
    settings: &ColourSettings,
) -> Option<f32> {
    let view = View::new(model.print()?, pose, observation, picture, settings)?;
    view.agreement(pose).filter(|a| a.pixels >= settings.min_pixels).map(|a| a.total)
}

/// A pose turned in all ways that depth may not notice, but about the axis of a body of revolution.
pub(super) fn turned(model: &Model, pose: &Isometry3<f32>) -> Vec<Isometry3<f32>> {
    let middle = model.oriented_box.translation.vector;
    let turned = |q: &UnitQuaternion<f32>| turned_about(pose, &middle, q);
    let discrete = model.symmetry().discrete.iter().filter(|q| q.angle() > 0.1).map(turned);
    discrete.chain(model.near_symmetries().iter().map(|turn| pose * turn)).collect()
}

/// The poses that depth confuses with the best one.
fn rivals(
    model: &Model,
    found: &SearchResult,
    view: &View<'_>,
    settings: &ColourSettings,
) -> Vec<Isometry3<f32>> {
    let (best, symmetry) = (&found.best.pose, model.symmetry());
    let middle = model.oriented_box.translation.vector;
    // Of a body of revolution the population's modes are all turns, too.
    let Some(axis) = &symmetry.revolution else {
        let mut sketched: Vec<(f32, Isometry3<f32>)> = modes(model, found, settings)
            .into_iter()
            .filter_map(|pose| Some((view.sketched(&pose)?.total, pose)))
            .collect();
        sketched.sort_by(|a, b| b.0.total_cmp(&a.0));
        return sketched.into_iter().take(LOOKED_AT).map(|(_, pose)| pose).collect();
    };
    let step = TAU / settings.revolution_steps as f32;
    let turned = |angle: f32, end: &UnitQuaternion<f32>| {
        turned_about(best, &middle, &(UnitQuaternion::from_axis_angle(axis, angle) * end))
    };
    let total = |agreement: Option<Agreement>| agreement.map_or(f32::MIN, |a| a.total);
    let sketched = |angle: f32, end: &UnitQuaternion<f32>| total(view.sketched(&turned(angle, end)));
    let peak = |angle: f32, end: &UnitQuaternion<f32>| {
        turned(refined(angle, step, |angle| total(view.agreement(&turned(angle, end)))), end)
    };
    let peaks = peaks(symmetry, settings.revolution_steps, sketched);
    let mut poses: Vec<Isometry3<f32>> = peaks.into_iter().map(|(angle, end)| peak(angle, end)).collect();
    // Print often repeats around a can: one that is nearly right is put right there.
    poses.push(peak(0.0, &UnitQuaternion::identity()));
    poses
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
    let mut poses = turned(model, &best.pose);
    let most = poses.len() + settings.most_modes;
    for h in found.population.iter().filter(|h| h.score > best.score - settings.depth_margin) {
        let same = |p: &Isometry3<f32>| p.rotation.angle_to(&h.pose.rotation) < settings.same_mode_rad;
        if poses.len() < most && !same(&best.pose) && !poses.iter().any(same) {
            poses.push(h.pose);
        }
    }
    poses
}
