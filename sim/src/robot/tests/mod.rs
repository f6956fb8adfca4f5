//! Tests of the robot model: the Fetch's figures, kinematics against `k`, loading, geometry.

mod collision;
mod fetch;
mod ik;
mod k_chain;
mod lanes;
mod loading;
mod others;

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use rand::{Rng, RngExt};

use super::{RobotConfig, RobotModel};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../robots/fetch")
}

static FETCH: LazyLock<(RobotModel, RobotConfig)> = LazyLock::new(|| {
    let robot = RobotModel::load(&folder().join("fetch.urdf"), &[]).unwrap_or_else(|e| panic!("{e}"));
    RobotConfig::load(&folder().join("fetch.toml"), robot).unwrap_or_else(|e| panic!("{e}"))
});

/// Every joint anywhere within its limits, continuous ones within a turn.
fn random_configuration(robot: &RobotModel, rng: &mut impl Rng) -> Vec<f64> {
    robot
        .joints()
        .iter()
        .map(|joint| {
            let lower = joint.limits.lower.max(-std::f64::consts::PI);
            let upper = joint.limits.upper.min(std::f64::consts::PI);
            rng.random_range(lower..upper)
        })
        .collect()
}
