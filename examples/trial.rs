//! A whole trial: look, estimate, plan, act, score.

#![allow(clippy::print_stdout, reason = "an example")]

use grip::estimators::{DetectorKind, DetectorOptions, Estimator, EstimatorKind};
use grip::progress::Quiet;
use grip::setup::{Setup, SetupOptions};
use grip::trial::{self, TrialOptions};
use grip_sim::render::{self, RendererChoice};

pub(crate) fn main() -> anyhow::Result<()> {
    let setup = Setup::load(&SetupOptions { seed: 7, ..SetupOptions::default() })?;
    let network = DetectorOptions::default();
    let estimator = Estimator::open(&setup, &EstimatorKind::Grip, DetectorKind::Pyramid, &network)?;
    let (planner, mut renderer) = (setup.planner(), render::open(RendererChoice::Auto)?);
    let options = TrialOptions { items: Some(2), ..TrialOptions::default() };
    let trial = trial::run(&setup, &estimator, &planner, renderer.as_mut(), options, &Quiet)?;
    for item in &trial.result.items {
        println!("{}: {}", item.object, item.outcome.words());
    }
    Ok(())
}
