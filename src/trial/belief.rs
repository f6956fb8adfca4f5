//! What the robot believes after a look.

use grip_manip::{BeliefScene, BelievedObject};
use grip_sim::frame::CameraFrame;
use grip_sim::pose::{Object, Pose, World};
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
            let poses = posterior.thinned(settings.poses).into_iter();
            belief.push(
                *i,
                BelievedObject {
                    poses: poses.map(|(pose, weight)| (frame.world_from_camera * pose, weight)).collect(),
                    position_std_m: posterior.position_std_m,
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
