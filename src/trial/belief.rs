//! What the robot believes after a look.

use grip_manip::{BeliefScene, BelievedObject, GivenGrasp};
use grip_sim::frame::CameraFrame;
use grip_sim::pose::{Camera, Object, Pose, World};
use nalgebra::Point3;

use crate::estimators::Estimates;
use crate::score::record::ItemRecord;
use crate::setup::Setup;

/// A believed scene, and which of the setup's objects each believed one is.
pub struct Belief {
    /// What the planner gets.
    pub scene: BeliefScene,
    /// For each object of the scene its position in the setup's list.
    pub index: Vec<usize>,
    /// Grasps by others of each object of the scene; none where the planner's own are used.
    pub grasps: Option<Vec<Vec<GivenGrasp>>>,
}

impl Belief {
    /// What was estimated with some confidence, and what was put into the bin where it was put.
    pub(super) fn new(
        setup: &Setup,
        frame: &CameraFrame,
        estimates: &Estimates,
        records: &[ItemRecord],
    ) -> Self {
        let settings = &setup.settings.belief;
        let mut belief = Self { scene: setup.cell.empty_belief(), index: Vec::new(), grasps: None };
        for (i, posterior) in estimates {
            if posterior.confidence < settings.least_confidence {
                continue;
            }
            let pose = frame.world_from_camera * posterior.best;
            belief.push(
                *i,
                BelievedObject {
                    position_std_m: spread_with_calibration(
                        posterior.position_std_m,
                        &posterior.best,
                        [settings.calibration_m, settings.calibration_rad],
                    ),
                    confidence: posterior.confidence,
                    // What fell into the bin on the way is not fetched out of it again.
                    packed: setup
                        .cell
                        .scene
                        .bin
                        .contains(&Point3::from(pose.translation()), settings.over_bin_m),
                    name: setup.name(*i),
                    ..BelievedObject::new(setup.models[*i].clone(), pose)
                },
            );
        }
        for (i, record) in records.iter().enumerate() {
            if let Some(pose) = record.believed_packed {
                let model = setup.models[i].clone();
                let name = setup.name(i);
                belief.push(i, BelievedObject { name, packed: true, ..BelievedObject::new(model, pose) });
            }
        }
        belief
    }

    fn push(&mut self, i: usize, object: BelievedObject) {
        self.scene.objects.push(object);
        self.index.push(i);
    }

    /// The belief when object `i` was handled: it is where it was released, or nobody knows where.
    pub(super) fn after_handling(mut self, i: usize, released: Option<Pose<World, Object>>) -> Self {
        if let Some(at) = self.index.iter().position(|&other| other == i) {
            match released {
                Some(pose) => {
                    self.scene.objects[at].world_from_object = pose;
                    self.scene.objects[at].packed = true;
                }
                None => {
                    self.scene.objects.remove(at);
                    self.index.remove(at);
                    self.grasps = None;
                }
            }
        }
        self
    }
}

/// The spread of an object's position, metres, when the camera may be `metres` and `radians` off, one standard deviation in
/// each direction. Across the ray a turn of the camera moves what is far by more.
fn spread_with_calibration(spread: f64, pose: &Pose<Camera, Object>, [metres, radians]: [f64; 2]) -> f64 {
    let across = radians * pose.translation().norm();
    (spread.powi(2) + 3.0 * metres.powi(2) + 2.0 * across.powi(2)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use grip_sim::rng;
    use nalgebra::{Isometry3, Vector3};
    use rand::RngExt;
    use rand_distr::StandardNormal;

    #[test]
    fn a_camera_that_may_be_off_spreads_what_it_sees() {
        let (metres, radians) = (0.002, 0.01);
        let seen = Pose::<Camera, Object>::from_xyz_rpy([0.0, 0.0, 1.0], [0.0; 3]);
        let mut random = rng::stream(1, "test");
        let mut normal = |std: f64| Vector3::from_fn(|_, _| std * random.sample::<f64, _>(StandardNormal));
        let count = 4000;
        let squares = (0..count).map(|_| {
            let camera = Pose::<Camera, Camera>::new(Isometry3::new(normal(metres), normal(radians)));
            ((camera * seen).translation() - seen.translation()).norm_squared()
        });
        let spread = (squares.sum::<f64>() / f64::from(count)).sqrt();
        let said = spread_with_calibration(0.0, &seen, [metres, radians]);
        assert!((spread / said - 1.0).abs() < 0.05, "{spread} {said}");
        assert!((spread_with_calibration(0.003, &seen, [0.0, 0.0]) - 0.003).abs() < 1e-12);
    }
}
