//! The second stages of our own: from boxes to poses.

use anyhow::Result;
use grip_perception::{GripEstimator, HypothesisRenderer, PaperEstimator, PoseEstimator, Workspace};
use serde_json::{Value, json};

use crate::settings::Settings;

/// A second stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SecondStage {
    /// Ours.
    Grip,
    /// The filter of the GRIP paper to the letter.
    Paper,
    /// The same with guards that the paper leaves out.
    PaperGuarded,
}

impl SecondStage {
    /// As on the command line and in outputs.
    pub fn name(self) -> &'static str {
        match self {
            Self::Grip => "grip",
            Self::Paper => "paper",
            Self::PaperGuarded => "paper-guarded",
        }
    }

    /// Who estimates, and its part of the settings. GRIP looks for objects in `workspace` alone, where there is one, and has
    /// its hypotheses drawn by `renderer`; the paper's filter knows neither. With `trace` it keeps the error of its best
    /// pose after each iteration.
    ///
    /// # Errors
    /// When a setting is out of range.
    pub fn open(
        self,
        settings: &Settings,
        renderer: HypothesisRenderer,
        workspace: Option<Workspace>,
        trace: bool,
    ) -> Result<(Box<dyn PoseEstimator>, Value)> {
        let paper = match self {
            Self::Grip => {
                let settings = &settings.perception.grip;
                let mut estimator = GripEstimator::new(settings.clone())?.with_renderer(renderer);
                if let Some(workspace) = workspace {
                    estimator = estimator.within(workspace);
                }
                return Ok((Box::new(if trace { estimator.traced() } else { estimator }), json!(settings)));
            }
            Self::Paper => &settings.perception.paper,
            Self::PaperGuarded => &settings.perception.paper_guarded,
        };
        let estimator = PaperEstimator::new(paper.clone())?;
        Ok((Box::new(if trace { estimator.traced() } else { estimator }), json!(paper)))
    }
}
