//! Errors of estimates against the truth of a data set.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::Path;

use anyhow::{Context, Result};
use grip_perception::metrics::{Surface, auc};
use grip_sim::bop::Dataset;
use grip_sim::bop::results::Estimate;
use grip_sim::rng;
use rand::RngExt;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::estimates::targets;
use super::presence::{Presence, presence};

/// Thresholds of the accuracy curves, metres: the paper's, and PoseCNN's.
pub const THRESHOLDS: [f64; 2] = [0.04, 0.1];
/// An object is found when its error is less than this share of its diameter (Hinterstoisser 2012).
const FOUND_SHARE: f64 = 0.1;
/// The bootstrap draws whole scenes where there are at least as many.
const FEWEST_SCENES: usize = 5;
/// Draws of the bootstrap.
const RESAMPLES: usize = 1000;

/// One instance that was asked for.
#[derive(Debug, Clone, Copy)]
pub struct Case {
    pub(super) scene_id: u32,
    pub(super) im_id: u32,
    pub(super) obj_id: u32,
    /// Confidence of its estimate.
    pub(super) score: Option<f64>,
    /// Metres; infinite where there is no estimate.
    pub(super) add: f64,
    pub(super) adds: f64,
    /// Whether the object has symmetries, so that ADD(-S) is ADD-S.
    symmetric: bool,
    diameter: f64,
}

impl Case {
    /// The columns of [`Case::line`].
    pub const HEADER: &'static str = "scene_id,im_id,obj_id,score,add_mm,adds_mm";

    /// A line of a CSV file, with its end; score and errors are empty where there is no estimate.
    pub fn line(&self) -> String {
        let Self { scene_id, im_id, obj_id, .. } = self;
        let mm = |error: f64| if error.is_finite() { (1e3 * error).to_string() } else { String::new() };
        let score = self.score.map_or_else(String::new, |score| score.to_string());
        format!("{scene_id},{im_id},{obj_id},{score},{},{}\n", mm(self.add), mm(self.adds))
    }

    /// ADD-S for objects with symmetries, ADD for others.
    pub(super) fn add_or_adds(&self) -> f64 {
        if self.symmetric { self.adds } else { self.add }
    }
}

/// Figures of some instances.
#[derive(Debug, Clone, Serialize)]
pub struct Figures {
    /// How many instances.
    pub instances: usize,
    /// How many of them have an estimate.
    pub estimated: usize,
    /// Area under the accuracy-threshold curve of ADD-S up to 0.04 m and 0.1 m, 0 to 1.
    pub auc_adds: [f64; 2],
    /// Bootstrap interval of the first, 95 %, scenes drawn (images, of fewer than five).
    pub auc_adds_interval: [f64; 2],
    /// The same area for ADD.
    pub auc_add: [f64; 2],
    /// The same for ADD(-S): ADD-S for objects with symmetries, ADD for others.
    pub auc_add_or_adds: [f64; 2],
    /// Bootstrap interval of the first, 95 %, scenes drawn (images, of fewer than five).
    pub auc_add_or_adds_interval: [f64; 2],
    /// Share of instances with ADD(-S) under a tenth of the diameter.
    pub found: f64,
    /// Median ADD-S of those with an estimate, metres; null without any.
    pub median_adds_m: Option<f64>,
}

/// The errors of a results file.
#[derive(Debug, Clone, Serialize)]
pub struct Evaluation {
    /// All instances.
    pub all: Figures,
    /// By object number.
    pub objects: BTreeMap<u32, Figures>,
    /// By view, where the scenes tell the views' names (`scene_info.json`).
    pub conditions: BTreeMap<String, Figures>,
    /// Estimates of images or objects that are not asked for.
    pub ignored: usize,
    /// What the confidences are worth.
    pub presence: Presence,
    /// Every instance.
    #[serde(skip)]
    pub cases: Vec<Case>,
    /// Names of the views, by scene and image, as far as they have any.
    #[serde(skip)]
    pub views: HashMap<(u32, u32), String>,
}

/// Compares `estimates` with the truth of all that is asked for. Of more estimates of an object in an image than there are
/// instances the best scored count; each takes the nearest instance (by ADD-S) that is left.
///
/// # Errors
/// When the truth or a model cannot be read, or none of the estimates is of what is asked for.
pub fn evaluate(dataset: &Dataset, estimates: &[Estimate]) -> Result<Evaluation> {
    let targets = targets(dataset)?;
    let mut by_target: HashMap<(u32, u32, u32), Vec<&Estimate>> = HashMap::new();
    for estimate in estimates {
        by_target.entry((estimate.scene_id, estimate.im_id, estimate.obj_id)).or_default().push(estimate);
    }
    let asked: usize =
        targets.iter().filter_map(|t| by_target.get(&(t.scene_id, t.im_id, t.obj_id))).map(Vec::len).sum();
    anyhow::ensure!(
        estimates.is_empty() || asked > 0,
        "none of the {} estimates is of an image and object that {} asks for; are they of another data set?",
        estimates.len(),
        dataset.root().display()
    );
    let infos = dataset.models_info()?;
    let mut surfaces = BTreeMap::new();
    for target in &targets {
        if let Entry::Vacant(entry) = surfaces.entry(target.obj_id) {
            let points: Vec<_> = dataset
                .load_evaluation_model(target.obj_id)?
                .mesh
                .positions
                .iter()
                .map(|p| p.cast())
                .collect();
            entry.insert(Surface::new(points));
        }
    }
    let cases: Vec<Case> = targets
        .par_iter()
        .map(|target| {
            let info = infos.get(&target.obj_id).with_context(|| {
                format!("{}: models_info.json has no object {}", dataset.root().display(), target.obj_id)
            })?;
            let case = Case {
                scene_id: target.scene_id,
                im_id: target.im_id,
                obj_id: target.obj_id,
                score: None,
                add: f64::INFINITY,
                adds: f64::INFINITY,
                symmetric: !(info.symmetries.discrete.is_empty() && info.symmetries.continuous.is_empty()),
                diameter: info.diameter,
            };
            let mut open: Vec<_> = dataset
                .ground_truths(target.scene_id, target.im_id)?
                .into_iter()
                .filter(|t| t.obj_id == target.obj_id)
                .collect();
            // What is hidden is not asked for while enough is seen.
            open.sort_by_key(|truth| !truth.is_target());
            open.truncate(target.inst_count as usize);
            let mut given =
                by_target.get(&(target.scene_id, target.im_id, target.obj_id)).cloned().unwrap_or_default();
            given.sort_by(|a, b| b.score.total_cmp(&a.score));
            given.truncate(target.inst_count as usize);
            let surface = &surfaces[&target.obj_id];
            let mut cases = Vec::new();
            for estimate in given {
                let errors = open.iter().enumerate().map(|(i, truth)| {
                    (surface.adds(&truth.camera_from_object, &estimate.camera_from_object), i)
                });
                let Some((adds, nearest)) = errors.min_by(|a, b| a.0.total_cmp(&b.0)) else { break };
                let truth = open.remove(nearest);
                let add = surface.add(&truth.camera_from_object, &estimate.camera_from_object);
                cases.push(Case { score: Some(estimate.score), add, adds, ..case });
            }
            cases.extend(open.iter().map(|_| case));
            Ok(cases)
        })
        .collect::<Result<Vec<Vec<Case>>>>()?
        .into_iter()
        .flatten()
        .collect();
    let presence = presence(dataset, estimates, &cases)?;
    let names = views(dataset)?;
    let mut objects: BTreeMap<u32, Vec<Case>> = BTreeMap::new();
    let mut by_condition: BTreeMap<String, Vec<Case>> = BTreeMap::new();
    for case in &cases {
        objects.entry(case.obj_id).or_default().push(*case);
        if let Some(name) = names.get(&(case.scene_id, case.im_id)) {
            by_condition.entry(name.clone()).or_default().push(*case);
        }
    }
    Ok(Evaluation {
        all: figures(&cases),
        objects: objects.into_iter().map(|(id, cases)| (id, figures(&cases))).collect(),
        conditions: by_condition.into_iter().map(|(name, cases)| (name, figures(&cases))).collect(),
        ignored: estimates.len() - asked - presence.absent,
        presence,
        cases,
        views: names,
    })
}

fn figures(cases: &[Case]) -> Figures {
    let add: Vec<f64> = cases.iter().map(|c| c.add).collect();
    let adds: Vec<f64> = cases.iter().map(|c| c.adds).collect();
    let either: Vec<f64> = cases.iter().map(Case::add_or_adds).collect();
    let mut known: Vec<f64> = adds.iter().copied().filter(|e| e.is_finite()).collect();
    known.sort_by(f64::total_cmp);
    let found = cases.iter().filter(|c| c.add_or_adds() < FOUND_SHARE * c.diameter).count();
    let areas = |errors: &[f64]| THRESHOLDS.map(|threshold| auc(errors, threshold));
    Figures {
        instances: cases.len(),
        estimated: known.len(),
        auc_adds: areas(&adds),
        auc_adds_interval: interval(cases, |c| c.adds),
        auc_add: areas(&add),
        auc_add_or_adds: areas(&either),
        auc_add_or_adds_interval: interval(cases, Case::add_or_adds),
        found: found as f64 / cases.len().max(1) as f64,
        median_adds_m: known.get(known.len() / 2).copied(),
    }
}

/// Interval of the area up to the first threshold.
fn interval(cases: &[Case], error: impl Fn(&Case) -> f64) -> [f64; 2] {
    bootstrap(cases, error, |drawn| auc(drawn, THRESHOLDS[0]))
}

/// 95 % percentile bootstrap of a statistic of what `value` takes from the cases. Scenes are drawn, not instances, because
/// the errors in one scene depend on each other (four frames of ours show one layout). Images are drawn where scenes are
/// too few.
pub(super) fn bootstrap<T: Clone>(
    cases: &[Case],
    value: impl Fn(&Case) -> T,
    statistic: impl Fn(&[T]) -> f64,
) -> [f64; 2] {
    let scenes: BTreeSet<u32> = cases.iter().map(|case| case.scene_id).collect();
    let mut groups: BTreeMap<(u32, u32), Vec<T>> = BTreeMap::new();
    for case in cases {
        let image = if scenes.len() < FEWEST_SCENES { case.im_id } else { 0 };
        groups.entry((case.scene_id, image)).or_default().push(value(case));
    }
    let groups: Vec<Vec<T>> = groups.into_values().collect();
    if groups.is_empty() {
        return [0.0; 2];
    }
    let mut random = rng::stream(0, "bootstrap");
    let mut areas: Vec<f64> = (0..RESAMPLES)
        .map(|_| {
            let drawn: Vec<T> = (0..groups.len())
                .flat_map(|_| groups[random.random_range(0..groups.len())].clone())
                .collect();
            statistic(&drawn)
        })
        .collect();
    areas.sort_by(f64::total_cmp);
    [0.025, 0.975].map(|q| areas[(q * (RESAMPLES - 1) as f64).round() as usize])
}

/// Names of the views, by scene and image, where the scenes have our `scene_info.json`.
pub fn views(dataset: &Dataset) -> Result<HashMap<(u32, u32), String>> {
    #[derive(Deserialize)]
    struct SceneInfo {
        frames: Vec<FrameInfo>,
    }
    #[derive(Deserialize)]
    struct FrameInfo {
        im_id: u32,
        name: String,
    }
    let mut names = HashMap::new();
    for scene_id in dataset.scenes()? {
        let path = dataset.root().join(dataset.split()).join(format!("{scene_id:06}/scene_info.json"));
        let Some(info) = read_optional::<SceneInfo>(&path)? else { continue };
        for frame in info.frames {
            let view = frame.name.rsplit('_').next().unwrap_or(&frame.name).to_owned();
            names.insert((scene_id, frame.im_id), view);
        }
    }
    Ok(names)
}

fn read_optional<T: for<'a> Deserialize<'a>>(path: &Path) -> Result<Option<T>> {
    match std::fs::read_to_string(path) {
        Ok(text) => serde_json::from_str(&text).map(Some).with_context(|| {
            format!("{}: is not the description of a scene; remove it or make the set anew", path.display())
        }),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error).with_context(|| format!("{}: cannot be read", path.display())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn case(im_id: u32, add: f64, adds: f64, symmetric: bool) -> Case {
        Case { scene_id: 1, im_id, obj_id: 1, score: None, add, adds, symmetric, diameter: 0.1 }
    }

    #[test]
    fn figures_of_a_few_cases_in_closed_form() {
        let cases = [
            case(0, 0.02, 0.0, true),
            case(1, 0.02, 0.0, false),
            case(2, f64::INFINITY, f64::INFINITY, false),
            case(3, 0.0, 0.0, false),
        ];
        let f = figures(&cases);
        assert_eq!((f.instances, f.estimated, f.median_adds_m), (4, 3, Some(0.0)));
        assert_eq!(f.auc_adds, [0.75, 0.75]);
        // Found: the symmetric one by ADD-S, and the exact one.
        assert_eq!(f.found, 0.5);
        // ADD(-S) 0, 0.02, none, 0: a half up to 2 cm, three quarters from there.
        assert!((f.auc_add_or_adds[0] - 0.625).abs() < 1e-12);
        assert!((f.auc_add_or_adds[1] - (0.2 * 0.5 + 0.8 * 0.75)).abs() < 1e-12);
        let [low, high] = f.auc_adds_interval;
        assert!(low < 0.75 && high > 0.75 && low >= 0.0 && high <= 1.0, "{low} {high}");
    }

    #[test]
    fn the_interval_has_the_width_of_a_binomial() {
        // 400 images, a quarter of them missed: the standard error of the share is sqrt(3/16/400).
        let cases: Vec<Case> =
            (0..400).map(|i| case(i, 0.0, if i % 4 == 0 { f64::INFINITY } else { 0.0 }, true)).collect();
        let [low, high] = interval(&cases, |c| c.adds);
        let expected = 1.96 * (0.75_f64 * 0.25 / 400.0).sqrt();
        assert!(
            (0.75 - low - expected).abs() < 0.008 && (high - 0.75 - expected).abs() < 0.008,
            "{low} {high}"
        );
    }
}
