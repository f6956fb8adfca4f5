//! Errors of estimates against the truth of a data set.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::Path;

use anyhow::{Context, Result};
use grip_perception::metrics::{ErrorKind, Hits, PairErrors, auc};
use grip_sim::bop::results::Estimate;
use grip_sim::bop::{Dataset, GroundTruth, Target};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::case::{Case, InImage, bootstrap};
use super::challenge::{Asked, Lacking, Model, Recall};
use super::estimates::targets;
use super::objects::names as object_names;
use super::presence::{Presence, THERE, of_absent_objects, presence};

/// Thresholds of the accuracy curves, metres: the paper's, and PoseCNN's.
pub const THRESHOLDS: [f64; 2] = [0.04, 0.1];
/// An object is found when its error is less than this share of its diameter (Hinterstoisser 2012).
const FOUND_SHARE: f64 = 0.1;

/// Figures of some instances.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Figures {
    /// How many instances.
    pub instances: usize,
    /// How many of them have an estimate.
    pub estimated: usize,
    /// Area under the accuracy-threshold curve of ADD-S up to 0.04 m and 0.1 m, 0 to 1.
    pub auc_adds: [f64; 2],
    /// Bootstrap interval of the first, 95 %, scenes drawn (images, of fewer than five); null of a single image.
    pub auc_adds_interval: Option<[f64; 2]>,
    /// The same area for ADD.
    pub auc_add: [f64; 2],
    /// The same for ADD(-S): ADD-S for objects with symmetries, ADD for others.
    pub auc_add_or_adds: [f64; 2],
    /// The same of the first of these.
    pub auc_add_or_adds_interval: Option<[f64; 2]>,
    /// Share of instances with ADD(-S) under a tenth of the diameter.
    pub found: f64,
    /// Median ADD-S of those with an estimate, metres; null without any.
    pub median_adds_m: Option<f64>,
    /// Those of the BOP challenge.
    pub bop: Recall,
    /// How instances are found, and how they are missed; kinds that do not occur are left out.
    pub kinds: BTreeMap<ErrorKind, Kind>,
}

/// Estimates that are right, or wrong in one way.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Kind {
    /// How many instances.
    pub instances: usize,
    /// Mean confidence of their estimates; null without any.
    pub confidence: Option<f64>,
    /// Those with a confidence of 0.5 or more.
    pub sure: usize,
}

/// The errors of a results file.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Evaluation {
    /// All instances.
    pub all: Figures,
    /// By object number.
    pub objects: BTreeMap<u32, Figures>,
    /// Names of the objects, by their numbers; left out of a set that has none.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub names: BTreeMap<u32, String>,
    /// By view, where the scenes tell the views' names (`scene_info.json`).
    pub conditions: BTreeMap<String, Figures>,
    /// Estimates of images or objects that are not asked for.
    pub ignored: usize,
    /// Of these, how many are of objects that the data set has no model of, by the object's number.
    pub unknown: BTreeMap<u32, usize>,
    /// What the confidences are worth.
    pub presence: Presence,
    /// What errors could not be measured with.
    pub lacking: Lacking,
    /// Every instance.
    #[serde(skip)]
    pub cases: Vec<Case>,
    /// Names of the views, by scene and image, as far as they have any.
    #[serde(skip)]
    pub views: HashMap<(u32, u32), String>,
}

/// Estimates by scene, image and object.
type ByTarget<'a> = HashMap<(u32, u32, u32), Vec<&'a Estimate>>;

/// Compares `estimates` with the truth of all that is asked for. Of more estimates of an object in an image than there are
/// instances the best scored count; each takes the nearest instance (by ADD-S) that is left. The challenge's recalls are of
/// matches of their own.
///
/// # Errors
/// When the truth, a model or a depth picture cannot be read, or none of the estimates is of what is asked for.
pub fn evaluate(dataset: &Dataset, estimates: &[Estimate]) -> Result<Evaluation> {
    let mut targets = targets(dataset)?;
    let mut by_target = ByTarget::new();
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
    let ids: BTreeSet<u32> = targets.iter().map(|target| target.obj_id).collect();
    let models = Model::load_all(dataset, ids.into_iter().collect())?;
    // By image, so that its depth picture is read once.
    targets.sort_by_key(|target| (target.scene_id, target.im_id));
    let images: Vec<&[Target]> =
        targets.chunk_by(|a, b| (a.scene_id, a.im_id) == (b.scene_id, b.im_id)).collect();
    let images: Vec<Image> = images
        .into_par_iter()
        .map(|targets| image(dataset, &models, &by_target, targets))
        .collect::<Result<_>>()?;
    let short: usize = images.iter().map(|image| image.short).sum();
    if short > 0 {
        log::warn!(
            "{}: {short} targets ask for more instances (inst_count) than the truth has; those that are there count",
            dataset.root().display()
        );
    }
    let cases: Vec<Case> = images.iter().flat_map(|image| &image.cases).copied().collect();
    let absent = of_absent_objects(dataset, estimates)?;
    // Targets may name what the truth has not.
    let asked_and_absent = |e: &&&Estimate| {
        targets.iter().any(|t| (t.scene_id, t.im_id, t.obj_id) == (e.scene_id, e.im_id, e.obj_id))
    };
    let both = absent.iter().filter(asked_and_absent).count();
    let presence = presence(&absent, &cases);
    let names = views(dataset)?;
    let all: Vec<&Image> = images.iter().collect();
    let of_object = |id: &u32| {
        figures(
            cases.iter().filter(|case| case.obj_id == *id),
            images.iter().flat_map(|image| &image.asked).filter(|asked| asked.obj_id == *id),
        )
    };
    let of_images = |images: &[&Image]| {
        figures(images.iter().flat_map(|image| &image.cases), images.iter().flat_map(|image| &image.asked))
    };
    let mut by_condition: BTreeMap<String, Vec<&Image>> = BTreeMap::new();
    for image in &images {
        if let Some(name) = image.cases.first().and_then(|case| names.get(&case.image())) {
            by_condition.entry(name.clone()).or_default().push(image);
        }
    }
    let objects: BTreeSet<u32> = cases.iter().map(|case| case.obj_id).collect();
    let known: BTreeSet<u32> = dataset.model_ids()?.into_iter().collect();
    let mut unknown: BTreeMap<u32, usize> = BTreeMap::new();
    for estimate in estimates.iter().filter(|estimate| !known.contains(&estimate.obj_id)) {
        *unknown.entry(estimate.obj_id).or_default() += 1;
    }
    Ok(Evaluation {
        unknown,
        all: of_images(&all),
        names: object_names(dataset).into_iter().filter(|(id, _)| objects.contains(id)).collect(),
        objects: objects.iter().map(|id| (*id, of_object(id))).collect(),
        conditions: by_condition.into_iter().map(|(name, images)| (name, of_images(&images))).collect(),
        ignored: estimates.len() + both - asked - presence.absent,
        presence,
        lacking: images.iter().map(|image| image.lacking).fold(Lacking::default(), Lacking::and),
        cases,
        views: names,
    })
}

/// What was found in an image.
#[derive(Default)]
struct Image {
    cases: Vec<Case>,
    asked: Vec<Asked>,
    lacking: Lacking,
    /// Targets of more instances than there are.
    short: usize,
}

/// Compares what is asked for in one image.
fn image(
    dataset: &Dataset,
    models: &BTreeMap<u32, Model>,
    by_target: &ByTarget,
    targets: &[Target],
) -> Result<Image> {
    let Some(&Target { scene_id, im_id, .. }) = targets.first() else { return Ok(Image::default()) };
    let truths = dataset.ground_truths(scene_id, im_id)?;
    if !targets.iter().any(|target| truths.iter().any(|truth| truth.obj_id == target.obj_id)) {
        return Ok(Image::default());
    }
    let view = dataset.view(scene_id, im_id)?;
    let mut image = Image { lacking: Lacking::of(&view), ..Image::default() };
    for Target { obj_id, inst_count, .. } in targets {
        let model = &models[obj_id];
        let mut truths: Vec<GroundTruth> = truths.iter().filter(|t| t.obj_id == *obj_id).cloned().collect();
        // Those are asked for of which most is seen.
        let seen = |truth: &GroundTruth| truth.info.map_or(1.0, |info| info.visib_fract);
        truths.sort_by(|a, b| seen(b).total_cmp(&seen(a)));
        truths.truncate(*inst_count as usize);
        // None is an object that is asked for where it is not.
        image.short += usize::from(!truths.is_empty() && truths.len() < *inst_count as usize);
        if truths.is_empty() {
            continue;
        }
        let mut given = by_target.get(&(scene_id, im_id, *obj_id)).cloned().unwrap_or_default();
        given.sort_by(|a, b| b.score.total_cmp(&a.score));
        given.truncate(*inst_count as usize);
        let errors = model.errors(&view, &truths, &given);
        let hits = Hits::new(&errors, truths.len(), &model.measured(&view));
        image.asked.push(Asked { image: (scene_id, im_id), obj_id: *obj_id, hits });

        let case = Case {
            scene_id,
            im_id,
            obj_id: *obj_id,
            score: None,
            add: f64::INFINITY,
            adds: f64::INFINITY,
            challenge: PairErrors::MISSED,
            kind: ErrorKind::Missing,
            symmetric: model.symmetric,
            diameter: model.diameter,
        };
        let mut open: Vec<usize> = (0..truths.len()).collect();
        for (estimate, errors) in given.iter().zip(&errors) {
            let pose = &estimate.camera_from_object;
            let distances = open
                .iter()
                .enumerate()
                .map(|(place, truth)| (model.surface.adds(&truths[*truth].camera_from_object, pose), place));
            let Some((adds, place)) = distances.min_by(|a, b| a.0.total_cmp(&b.0)) else { break };
            let truth = open.remove(place);
            let add = model.surface.add(&truths[truth].camera_from_object, pose);
            let challenge = errors[truth];
            let kind = model.kinds.kind(&truths[truth].camera_from_object, pose, challenge.mssd_m);
            image.cases.push(Case { score: Some(estimate.score), add, adds, challenge, kind, ..case });
        }
        image.cases.extend(open.iter().map(|_| case));
    }
    Ok(image)
}

fn figures<'a>(cases: impl Iterator<Item = &'a Case>, asked: impl Iterator<Item = &'a Asked>) -> Figures {
    let cases: Vec<Case> = cases.copied().collect();
    let asked: Vec<Asked> = asked.copied().collect();
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
        auc_adds_interval: interval(&cases, |c| c.adds),
        auc_add: areas(&add),
        auc_add_or_adds: areas(&either),
        auc_add_or_adds_interval: interval(&cases, Case::add_or_adds),
        found: found as f64 / cases.len().max(1) as f64,
        median_adds_m: known.get(known.len() / 2).copied(),
        bop: Recall::new(&asked),
        kinds: kinds(&cases),
    }
}

fn kinds(cases: &[Case]) -> BTreeMap<ErrorKind, Kind> {
    let mut scores: BTreeMap<ErrorKind, Vec<Option<f64>>> = BTreeMap::new();
    for case in cases {
        scores.entry(case.kind).or_default().push(case.score);
    }
    let kind = |scores: Vec<Option<f64>>| {
        let known: Vec<f64> = scores.iter().flatten().copied().collect();
        Kind {
            instances: scores.len(),
            confidence: (!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64),
            sure: known.iter().filter(|score| **score >= THERE).count(),
        }
    };
    scores.into_iter().map(|(name, scores)| (name, kind(scores))).collect()
}

/// Interval of the area up to the first threshold.
fn interval(cases: &[Case], error: impl Fn(&Case) -> f64) -> Option<[f64; 2]> {
    bootstrap(cases, error, |drawn| auc(drawn, THRESHOLDS[0]))
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
        let (challenge, kind) = (PairErrors::MISSED, ErrorKind::Missing);
        Case {
            scene_id: 1,
            im_id,
            obj_id: 1,
            score: None,
            add,
            adds,
            challenge,
            kind,
            symmetric,
            diameter: 0.1,
        }
    }

    #[test]
    fn figures_of_a_few_cases_in_closed_form() {
        let cases = [
            case(0, 0.02, 0.0, true),
            case(1, 0.02, 0.0, false),
            case(2, f64::INFINITY, f64::INFINITY, false),
            case(3, 0.0, 0.0, false),
        ];
        let f = figures(cases.iter(), [].iter());
        assert_eq!((f.instances, f.estimated, f.median_adds_m), (4, 3, Some(0.0)));
        assert_eq!(f.auc_adds, [0.75, 0.75]);
        // Found: the symmetric one by ADD-S, and the exact one.
        assert_eq!(f.found, 0.5);
        // ADD(-S) 0, 0.02, none, 0: a half up to 2 cm, three quarters from there.
        assert!((f.auc_add_or_adds[0] - 0.625).abs() < 1e-12);
        assert!((f.auc_add_or_adds[1] - (0.2 * 0.5 + 0.8 * 0.75)).abs() < 1e-12);
        let [low, high] = f.auc_adds_interval.unwrap();
        assert!(low < 0.75 && high > 0.75 && low >= 0.0 && high <= 1.0, "{low} {high}");
    }

    #[test]
    fn kinds_are_counted_with_their_confidences() {
        let of = |kind: ErrorKind, score: Option<f64>| Case { kind, score, ..case(0, 0.0, 0.0, false) };
        let cases = [
            of(ErrorKind::Right, Some(0.9)),
            of(ErrorKind::Missing, None),
            of(ErrorKind::HalfTurnLong, Some(0.75)),
            of(ErrorKind::HalfTurnLong, Some(0.25)),
        ];
        let f = figures(cases.iter(), [].iter());
        let kinds: Vec<(ErrorKind, Kind)> = f.kinds.into_iter().collect();
        let kind = |instances, confidence, sure| Kind { instances, confidence, sure };
        assert_eq!(
            kinds,
            [
                (ErrorKind::Right, kind(1, Some(0.9), 1)),
                (ErrorKind::HalfTurnLong, kind(2, Some(0.5), 1)),
                (ErrorKind::Missing, kind(1, None, 0)),
            ]
        );
    }

    #[test]
    fn the_interval_has_the_width_of_a_binomial() {
        // 400 images, a quarter of them missed: the standard error of the share is sqrt(3/16/400).
        let cases: Vec<Case> =
            (0..400).map(|i| case(i, 0.0, if i % 4 == 0 { f64::INFINITY } else { 0.0 }, true)).collect();
        let of_one_image = interval(&cases[..1], |c| c.adds);
        assert_eq!(of_one_image, None);
        let [low, high] = interval(&cases, |c| c.adds).unwrap();
        let expected = 1.96 * (0.75_f64 * 0.25 / 400.0).sqrt();
        assert!(
            (0.75 - low - expected).abs() < 0.008 && (high - 0.75 - expected).abs() < 0.008,
            "{low} {high}"
        );
    }
}
