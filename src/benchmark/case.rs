//! One instance that was asked for and its errors, and how sure figures of many of them are.

use std::collections::{BTreeMap, BTreeSet};

use grip_perception::metrics::{ErrorKind, PairErrors};
use grip_sim::rng;
use rand::RngExt;

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
    /// Those of the BOP challenge, of the same estimate.
    pub(super) challenge: PairErrors,
    /// How it is wrong.
    pub(super) kind: ErrorKind,
    /// Whether the object has symmetries, so that ADD(-S) is ADD-S.
    pub(super) symmetric: bool,
    /// Metres.
    pub(super) diameter: f64,
}

impl Case {
    /// The columns of [`Case::line`].
    pub const HEADER: &'static str = "scene_id,im_id,obj_id,score,add_mm,adds_mm,mssd_mm,mspd_px,vsd,kind";

    /// A line of a CSV file, with its end; score and errors are empty where there is no estimate or nothing to measure them
    /// with. VSD is the mean over its tolerances; kind the name of an [`ErrorKind`].
    pub fn line(&self) -> String {
        let Self { scene_id, im_id, obj_id, .. } = self;
        let number = |x: f64| if x.is_finite() { x.to_string() } else { String::new() };
        let score = self.score.map_or_else(String::new, |score| score.to_string());
        let PairErrors { mssd_m, mspd_px, .. } = self.challenge;
        let errors =
            [1e3 * self.add, 1e3 * self.adds, 1e3 * mssd_m, mspd_px, self.challenge.mean_vsd()].map(number);
        let kind = self.kind.name();
        format!("{scene_id},{im_id},{obj_id},{score},{},{kind}\n", errors.join(","))
    }

    /// ADD-S for objects with symmetries, ADD for others.
    pub(super) fn add_or_adds(&self) -> f64 {
        if self.symmetric { self.adds } else { self.add }
    }
}

impl InImage for Case {
    fn image(&self) -> (u32, u32) {
        (self.scene_id, self.im_id)
    }
}

/// What belongs to an image.
pub(super) trait InImage {
    /// Scene, and image of the scene.
    fn image(&self) -> (u32, u32);
}

/// 95 % percentile bootstrap of a statistic of what `value` takes from the cases. Scenes are drawn, not instances, because
/// the errors in one scene depend on each other (four frames of ours show one layout). Images are drawn where scenes are
/// too few. `None` of a single one, which says nothing of others.
pub(super) fn bootstrap<C: InImage, T: Clone>(
    cases: &[C],
    value: impl Fn(&C) -> T,
    statistic: impl Fn(&[T]) -> f64,
) -> Option<[f64; 2]> {
    let scenes: BTreeSet<u32> = cases.iter().map(|case| case.image().0).collect();
    let mut groups: BTreeMap<(u32, u32), Vec<T>> = BTreeMap::new();
    for case in cases {
        let (scene_id, im_id) = case.image();
        let image = if scenes.len() < FEWEST_SCENES { im_id } else { 0 };
        groups.entry((scene_id, image)).or_default().push(value(case));
    }
    let groups: Vec<Vec<T>> = groups.into_values().collect();
    if groups.len() < 2 {
        return None;
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
    Some([0.025, 0.975].map(|q| areas[(q * (RESAMPLES - 1) as f64).round() as usize]))
}
