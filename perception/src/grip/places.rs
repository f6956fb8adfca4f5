//! Where an object may be: the best pose, and those of other modes that explain the frame nearly as well.
//!
//! A search ends in one mode; what it may be confused with is known: turns that nearly keep the object's shape, and where its
//! restarts ended. Each is moved to where it fits best, then depth and colour together say what it is worth.

use nalgebra::Isometry3;

use super::colour::{self, Picture};
use super::search::Search;
use super::settings::GripSettings;
use super::uncertainty::Fit;
use crate::error::Result;
use crate::hypotheses::Batch;
use crate::model::Model;
use crate::observation::Observation;
use crate::particles::{ScoredPose, SearchResult};

/// A mode.
#[derive(Debug, Clone)]
pub(super) struct Place {
    pub best: ScoredPose,
    /// Of the print there with the picture, not below 0; 0 where there is no telling.
    pub agreement: f32,
    /// `None` where too little is seen.
    pub fit: Option<Fit>,
    /// Its share of the masses of an instance's places.
    pub mass: f64,
}

impl Place {
    fn new(
        model: &Model,
        best: ScoredPose,
        observation: &Observation,
        picture: Option<&Picture>,
        settings: &GripSettings,
    ) -> Self {
        let agreement =
            picture.and_then(|p| colour::agreement(model, &best.pose, observation, p, &settings.colour));
        let fit = Fit::new(model, &best.pose, observation, settings.polish.triangles, &settings.uncertainty);
        Self { best, agreement: agreement.unwrap_or(0.0).max(0.0), fit, mass: 0.0 }
    }
}

/// A pose is as good as lost when its mass would be exp(-this) of the best one's.
const LOST: f64 = 7.0;

/// The places where an object may be, that of the best pose first.
pub(super) fn places(
    model: &Model,
    found: &SearchResult,
    observation: &Observation,
    picture: Option<&Picture>,
    search: &mut Search<'_>,
) -> Result<Vec<Place>> {
    let settings = search.settings();
    let place = |best: ScoredPose| Place::new(model, best, observation, picture, settings);
    let first = place(found.best);
    let mut places = vec![first.clone()];
    let mut poses = candidates(model, found, settings);
    if poses.is_empty() {
        return Ok(weighed(places, settings));
    }
    // A rough look first: most turns explain the image far worse.
    let near = &settings.near_symmetry;
    let batch = Batch {
        lod: model.lod(near.triangles),
        stride: near.stride,
        kernel: near.kernel,
        steps: near.steps,
        ..search.full_batch()
    };
    poses.insert(0, found.best.pose);
    let roughly = search.weigh(&batch, &mut poses)?;
    let trust = trust(&first, settings);
    let most_gain = settings.colour.weight * (1.0 - first.agreement);
    let lost = |worse: f32| f64::from(trust * worse - most_gain) > LOST * settings.belief.temperature;
    let mut left: Vec<usize> = (1..poses.len()).filter(|&i| !lost(roughly[0] - roughly[i])).collect();
    left.sort_by(|&a, &b| roughly[b].total_cmp(&roughly[a]));
    left.truncate(settings.uncertainty.most_places);
    let polished = search.polished(left.into_iter().map(|i| poses[i]).collect())?;
    for other in polished {
        let known = places.iter().any(|p| same(model, &p.best.pose, &other.pose));
        if !known && !lost(found.best.score - other.score) {
            places.push(place(other));
        }
    }
    Ok(weighed(places, settings))
}

/// The places at these poses, and no others.
pub(super) fn places_at(
    model: &Model,
    poses: impl Iterator<Item = ScoredPose>,
    observation: &Observation,
    picture: Option<&Picture>,
    settings: &GripSettings,
) -> Vec<Place> {
    weighed(poses.map(|pose| Place::new(model, pose, observation, picture, settings)).collect(), settings)
}

/// With masses that sum to 1: depth and colour, each weighed by what it is worth.
fn weighed(mut places: Vec<Place>, settings: &GripSettings) -> Vec<Place> {
    let Some(first) = places.first() else { return places };
    let trust = trust(first, settings);
    let merit = |p: &Place| f64::from(trust * p.best.score + settings.colour.weight * p.agreement);
    let best = places.iter().map(merit).fold(f64::MIN, f64::max);
    let raw: Vec<f64> =
        places.iter().map(|p| ((merit(p) - best) / settings.belief.temperature).exp()).collect();
    let sum: f64 = raw.iter().sum();
    places.iter_mut().zip(raw).for_each(|(place, raw)| place.mass = raw / sum);
    places
}

/// How far differences of the depth score are to be believed at a place.
fn trust(place: &Place, settings: &GripSettings) -> f32 {
    settings.colour.trust(place.fit.as_ref().map_or(0.0, |fit| fit.noise_m))
}

/// What the best pose may be confused with, and where else the search ended.
fn candidates(model: &Model, found: &SearchResult, settings: &GripSettings) -> Vec<Isometry3<f32>> {
    let best = &found.best.pose;
    let mut poses = colour::turned(model, best);
    let most = poses.len() + settings.uncertainty.most_places;
    for h in &found.population {
        if poses.len() < most && !poses.iter().chain([best]).any(|p| same(model, p, &h.pose)) {
            poses.push(h.pose);
        }
    }
    poses
}

/// Whether two poses are of one mode: near each other, and not turned but about the axis of a body of revolution.
pub(super) fn same(model: &Model, a: &Isometry3<f32>, b: &Isometry3<f32>) -> bool {
    /// Radians, and share of the object's radius.
    const TURN: f32 = 0.3;
    const SHIFT: f32 = 0.25;
    let angle = match &model.symmetry().revolution {
        Some(axis) => (a.rotation * axis).angle(&(b.rotation * axis)),
        None => a.rotation.angle_to(&b.rotation),
    };
    angle < TURN && (a.translation.vector - b.translation.vector).norm() < SHIFT * model.radius
}
