//! What the robot believes after a look.

use grip_manip::{BeliefScene, BelievedObject};
use grip_sim::frame::CameraFrame;
use grip_sim::pose::{Camera, Object, Pose, World};
use grip_sim::rng;
use nalgebra::{Isometry3, Point3, Vector3};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

use crate::estimators::Estimates;
use crate::score::record::ItemRecord;
use crate::setup::Setup;

/// A believed scene, and which of the setup's objects each believed one is.
pub struct Belief {
    /// What the planner gets.
    pub scene: BeliefScene,
    /// For each object of the scene its position in the setup's list.
    pub index: Vec<usize>,
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
        let mut belief = Self { scene: setup.cell.empty_belief(), index: Vec::new() };
        for (i, posterior) in estimates {
            if posterior.confidence < settings.least_confidence {
                continue;
            }
            let pose = frame.world_from_camera * posterior.best;
            let calibration =
                Calibration { metres: settings.calibration_m, radians: settings.calibration_rad };
            let mut random = rng::stream(setup.seed, &format!("calibration/{i}"));
            let mut camera = || frame.world_from_camera * calibration.drawn(&mut random);
            let poses = calibration.spread(posterior.thinned(settings.poses), settings.poses);
            belief.push(
                *i,
                BelievedObject {
                    poses: poses.into_iter().map(|(pose, weight)| (camera() * pose, weight)).collect(),
                    position_std_m: calibration.with(posterior.position_std_m, &posterior.best),
                    confidence: posterior.confidence,
                    // What fell into the bin on the way is not fetched out of it again.
                    packed: setup
                        .cell
                        .scene
                        .bin
                        .contains(&Point3::from(pose.translation()), settings.over_bin_m),
                    ..BelievedObject::new(setup.models[*i].clone(), pose)
                },
            );
        }
        for (i, record) in records.iter().enumerate() {
            if let Some(pose) = record.believed_packed {
                let model = setup.models[i].clone();
                belief.push(i, BelievedObject { packed: true, ..BelievedObject::new(model, pose) });
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
                }
            }
        }
        self
    }
}

/// How far off the camera may be, one standard deviation in each direction.
struct Calibration {
    metres: f64,
    radians: f64,
}

impl Calibration {
    fn is_none(&self) -> bool {
        self.metres == 0.0 && self.radians == 0.0
    }

    /// The poses as often as it takes to make `count` of them, so that each may be displaced in another way.
    fn spread<P: Clone>(&self, poses: Vec<(P, f64)>, count: usize) -> Vec<(P, f64)> {
        let times = if self.is_none() { 1 } else { (count / poses.len().max(1)).max(1) };
        let repeated = |(pose, weight)| std::iter::repeat_n((pose, weight / times as f64), times);
        poses.into_iter().flat_map(repeated).collect()
    }

    /// A displacement of the camera by chance.
    fn drawn(&self, random: &mut impl Rng) -> Pose<Camera, Camera> {
        if self.is_none() {
            return Pose::identity();
        }
        let mut normal = |std: f64| Vector3::from_fn(|_, _| std * random.sample::<f64, _>(StandardNormal));
        let (shift, turn) = (normal(self.metres), normal(self.radians));
        Pose::new(Isometry3::new(shift, turn))
    }

    /// The spread of an object's position with it; across the ray a turn of the camera moves what is far by more.
    fn with(&self, position_std_m: f64, pose: &Pose<Camera, Object>) -> f64 {
        if self.is_none() {
            return position_std_m;
        }
        let across = self.radians * pose.translation().norm();
        (position_std_m.powi(2) + 3.0 * self.metres.powi(2) + 2.0 * across.powi(2)).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_that_may_be_off_spreads_what_it_sees() {
        let calibration = Calibration { metres: 0.002, radians: 0.01 };
        let seen = Pose::<Camera, Object>::from_xyz_rpy([0.0, 0.0, 1.0], [0.0; 3]);
        let poses = calibration.spread(vec![(seen, 1.0)], 4000);
        assert_eq!(poses.len(), 4000);
        assert!((poses.iter().map(|(_, weight)| weight).sum::<f64>() - 1.0).abs() < 1e-9);
        let mut random = rng::stream(1, "test");
        let square = |(pose, weight): &(Pose<Camera, Object>, f64)| {
            weight
                * ((calibration.drawn(&mut random) * *pose).translation() - seen.translation()).norm_squared()
        };
        let spread = poses.iter().map(square).sum::<f64>().sqrt();
        let said = calibration.with(0.0, &seen);
        assert!((spread / said - 1.0).abs() < 0.05, "{spread} {said}");

        let none = Calibration { metres: 0.0, radians: 0.0 };
        assert_eq!(none.spread(vec![(seen, 1.0)], 32), vec![(seen, 1.0)]);
        assert_eq!(none.with(0.003, &seen), 0.003);
    }
}
