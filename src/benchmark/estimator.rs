//! Which estimator a data set is given to.

use std::path::Path;

use anyhow::Result;
use grip_perception::{GripEstimator, HypothesisRenderer, PaperEstimator, PoseEstimator, SupportSettings};
use serde_json::{Value, json};

use crate::settings::Settings;

/// The second stages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameEstimatorKind {
    /// Ours.
    Grip,
    /// The filter of the GRIP paper to the letter.
    Paper,
    /// The same with guards that the paper leaves out.
    PaperGuarded,
}

impl FrameEstimatorKind {
    /// As on the command line and in outputs.
    pub fn name(self) -> &'static str {
        match self {
            Self::Grip => "grip",
            Self::Paper => "paper",
            Self::PaperGuarded => "paper-guarded",
        }
    }
}

/// Settings for the images of a data set: where up is in the world is known of our own sets alone, others leave the world's
/// axes open.
pub fn for_dataset(mut settings: Settings, dataset: &Path) -> Settings {
    if !dataset.join("dataset.json").is_file() {
        let perception = &mut settings.perception;
        let supports = [
            &mut perception.detector.clusters.support,
            &mut perception.grip.observation.support,
            &mut perception.paper.support,
            &mut perception.paper_guarded.support,
        ];
        supports.into_iter().for_each(|support| support.max_tilt_rad = SupportSettings::ANY_TILT);
    }
    settings
}

/// An estimator, and its part of the settings. With `trace` it keeps the error of its best pose after each iteration.
///
/// # Errors
/// When a setting is out of range.
pub fn frame_estimator(
    kind: FrameEstimatorKind,
    settings: &Settings,
    renderer: HypothesisRenderer,
    trace: bool,
) -> Result<(Box<dyn PoseEstimator>, Value)> {
    let paper = match kind {
        FrameEstimatorKind::Grip => {
            let settings = &settings.perception.grip;
            let estimator = GripEstimator::new(settings.clone())?.with_renderer(renderer);
            return Ok((Box::new(if trace { estimator.traced() } else { estimator }), json!(settings)));
        }
        FrameEstimatorKind::Paper => &settings.perception.paper,
        FrameEstimatorKind::PaperGuarded => &settings.perception.paper_guarded,
    };
    let estimator = PaperEstimator::new(paper.clone())?;
    Ok((Box::new(if trace { estimator.traced() } else { estimator }), json!(paper)))
}
