//! A layout of one object, and grasps tried on it.

use std::sync::Arc;

use anyhow::Result;
use grip_manip::executor::{ExecStage, Observer, StepReport, execute_steps};
use grip_manip::{BeliefScene, BelievedObject, Grasp, GraspTest, StepName};
use grip_perception::metrics;
use grip_sim::objects::ObjectModel;
use grip_sim::pose::{Object, Pose, World as WorldFrame};
use nalgebra::{Isometry3, Point3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::motion::GraspMotion;
use super::{GraspLine, Sweep};
use crate::score::{GraspMonitor, model_points};
use crate::settings::SweepSettings;
use crate::setup::Setup;
use crate::trial::{SharedWorld, WorldPort};

/// What became of a grasp.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum GraspOutcome {
    /// Lifted, shaken and still in place in the hand.
    Held,
    /// The arm does not reach the displaced grasp: this says nothing about the grasp.
    Unreachable,
    /// The hand ran into the object or the table before it was there.
    CollisionOnApproach,
    /// The fingers closed on nothing, or not on opposite sides.
    Missed,
    /// Lost while lifting, or never clear of the table.
    SlippedOnLift,
    /// Lost in the shake.
    LostInShake,
    /// Held, but it slipped or turned in the hand beyond the bounds.
    SlippedInHand,
}

/// An object on the table, and the grasp that is tried on it.
pub struct Layout {
    object: String,
    seed: u64,
    setup: Setup,
    model: Arc<ObjectModel>,
    points: Vec<Point3<f64>>,
    world_from_object: Pose<WorldFrame, Object>,
    /// The belief, which is right.
    belief: BeliefScene,
    /// The grasp.
    pub grasp: Grasp,
    /// Where the joints are at it.
    q: Vec<f64>,
}

impl Layout {
    /// The first layout of `object` and `seed` with a grasp within reach: with `only`, that grasp. If there is none, why not.
    ///
    /// # Errors
    /// When the object cannot be loaded or laid out.
    pub fn find(
        sweep: &Sweep,
        object: &str,
        seed: u64,
        only: Option<&Grasp>,
    ) -> Result<std::result::Result<Self, String>> {
        let mut model = sweep.setup.library.load(object)?;
        if let Some(friction) = sweep.friction {
            let mut other = (*model).clone();
            other.info.friction = friction;
            model = Arc::new(other);
        }
        let mut reason = String::new();
        let layouts = sweep.setup.settings.sweep.layouts;
        for number in 0..layouts {
            let mut setup = sweep.setup.clone();
            setup.cell.scene.objects.names = vec![object.to_owned()];
            setup.cell.scene.objects.placed.clear();
            setup.models = vec![model.clone()];
            setup.seed = seed;
            setup.seed = setup.stream(&format!("layout/{object}/{number}"));
            let (world, _) = setup.drop_objects()?;
            let world_from_object = world.truth(0);
            let believed = BelievedObject::new(model.clone(), world_from_object);
            let belief = BeliefScene { objects: vec![believed], ..setup.cell.empty_belief() };
            match sweep.planner.choose_grasp(&belief, 0, &setup.cell.start, only) {
                Ok((grasp, q)) => {
                    let points = model_points(&model);
                    let (object, model) = (object.to_owned(), model.clone());
                    let layout =
                        Self { object, seed, setup, model, points, world_from_object, belief, grasp, q };
                    // A layout at whose edge the arm cannot lift and shake says nothing about grasps.
                    if layout.plan(sweep, layout.grasp.world_from_gripper.iso()).is_some() {
                        return Ok(Ok(layout));
                    }
                    reason = "the arm does not reach the lift and the shake".into();
                }
                Err(failure) => {
                    log::debug!("{failure} at {world_from_object:?}: {:?}", failure.counters);
                    reason = failure.to_string();
                }
            }
        }
        Ok(Err(format!("{object}: none of {layouts} layouts has a grasp to try; {reason}")))
    }

    /// Tries the grasp with the sweep's error number `case`.
    ///
    /// # Errors
    /// When the world cannot be built.
    pub fn try_grasp(&self, sweep: &Sweep, case: usize) -> Result<GraspLine> {
        let error = sweep.cases[case].at(self.seed);
        let world_from_gripper = *self.grasp.world_from_gripper.iso();
        let displaced = world_from_gripper * error.iso();
        // The pose of the object that the displaced grasp would be right for.
        let believed: Pose<WorldFrame, Object> =
            Pose::new(displaced * world_from_gripper.inverse() * self.world_from_object.iso());
        let (truth, believed) = (self.in_camera(&self.world_from_object), self.in_camera(&believed));
        let mut line = GraspLine {
            object: self.object.clone(),
            seed: self.seed,
            case,
            error,
            add_m: metrics::add(&self.points, &truth, &believed),
            adds_m: metrics::adds(&self.points, &truth, &believed),
            outcome: GraspOutcome::Unreachable,
            opposing_contacts: false,
            lifted_clear: false,
            held_after_shake: false,
            slip_within: false,
            slip_m: None,
            slip_deg: None,
            motion: None,
        };
        let Some(test) = self.plan(sweep, &displaced) else { return Ok(line) };
        if sweep.motions {
            line.motion = Some(Box::new(GraspMotion::of(&test, &self.world_from_object, &self.setup)));
        }

        let setup = &self.setup;
        let mut world = setup.empty_world(test.start.clone())?;
        world.add_object(self.model.clone(), &self.world_from_object)?;
        let SweepSettings { wait_s, thrown_m, .. } = setup.settings.sweep;
        if world.drift(wait_s) > thrown_m {
            line.outcome = GraspOutcome::CollisionOnApproach;
            return Ok(line);
        }
        let hand = setup.cell.config.gripper.link;
        let monitor = GraspMonitor::begin(&world, 0, hand, &setup.settings.success);
        let shared = SharedWorld::new(&mut world);
        let mut observer = GraspObserver { world: &shared, monitor };
        let report = execute_steps(
            &mut WorldPort::new(&shared, &setup.miscalibration),
            &test.steps,
            &setup.settings.executor,
            &mut observer,
        );
        let clauses = observer.monitor.clauses;
        let measures = observer.monitor.measures;
        line.opposing_contacts = clauses.opposing_contacts;
        line.lifted_clear = clauses.lifted_clear;
        line.held_after_shake = clauses.held_after_carry;
        line.slip_within = clauses.slip_within;
        if clauses.held_after_carry {
            (line.slip_m, line.slip_deg) = (Some(measures.slip_m), Some(measures.slip_deg));
        }
        for step in &report.steps {
            log::debug!(
                "{} seed {} case {case}: {:?}: {:.2} s to {:.2} s, {:.0} N{}",
                self.object,
                self.seed,
                step.name,
                step.begin_s,
                step.end_s,
                step.peak_contact_n,
                if step.stopped_early { ", stopped early" } else { "" }
            );
        }
        log::debug!(
            "{} seed {} case {case}: {measures:?}, width {:?}",
            self.object,
            self.seed,
            report.grasp_width_m
        );
        if let Some((stage, _, reason)) = report.failure() {
            log::debug!("{} seed {} case {case}: {stage:?}: {reason}", self.object, self.seed);
        }
        line.outcome = match report.failure() {
            Some((ExecStage::Approach, ..)) => GraspOutcome::CollisionOnApproach,
            Some((ExecStage::Grasp, ..)) => GraspOutcome::Missed,
            Some((ExecStage::Lift, ..)) => GraspOutcome::SlippedOnLift,
            Some((ExecStage::Carry | ExecStage::Place, ..)) => GraspOutcome::LostInShake,
            None if !clauses.opposing_contacts => GraspOutcome::Missed,
            None if !clauses.lifted_clear => GraspOutcome::SlippedOnLift,
            None if !clauses.held_after_carry => GraspOutcome::LostInShake,
            None if !clauses.slip_within => GraspOutcome::SlippedInHand,
            None => GraspOutcome::Held,
        };
        Ok(line)
    }

    /// What to do to try the grasp with the hand at `world_from_gripper`; none where the arm does not reach.
    fn plan(&self, sweep: &Sweep, world_from_gripper: &Isometry3<f64>) -> Option<GraspTest> {
        let base_from_gripper = self.belief.world_from_base.iso().inverse() * world_from_gripper;
        let force_n = sweep.force_n;
        sweep.planner.plan_grasp_test(&self.belief, 0, &self.grasp, &base_from_gripper, &self.q, force_n)
    }

    /// Errors of poses do not depend on where the camera is.
    fn in_camera(&self, pose: &Pose<WorldFrame, Object>) -> Pose<grip_sim::pose::Camera, Object> {
        self.setup.cell.world_from_camera(&self.setup.cell.start).inverse() * *pose
    }
}

/// The score, watching a grasp on its own.
struct GraspObserver<'a, 'w> {
    world: &'a SharedWorld<'w>,
    monitor: GraspMonitor,
}

impl Observer for GraspObserver<'_, '_> {
    fn tick(&mut self, step: StepName, _: f64) {
        if matches!(step, StepName::Close | StepName::Lift | StepName::Shake) {
            self.monitor.step(&self.world.borrow());
        }
    }

    fn step_done(&mut self, report: &StepReport) {
        match report.name {
            StepName::Close => self.monitor.closed(&self.world.borrow()),
            // The shake is several motions; the last one counts.
            StepName::Shake => self.monitor.carried(),
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::setup::SetupOptions;
    use nalgebra::UnitQuaternion;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn a_marker_that_lies_flat_is_grasped_by_the_fingertips_whichever_side_is_up() {
        let setup = Setup::load(&SetupOptions::default()).unwrap();
        let planner = setup.planner();
        let model = setup.library.load("040_large_marker").unwrap();
        let (table, pad) = (setup.cell.scene.table.height, setup.cell.config.gripper.pad_half_extents);
        let long = (0..3).max_by(|&a, &b| model.size()[a].total_cmp(&model.size()[b])).unwrap();
        for k in 0..8 {
            // Its length along the world's x, turned about it.
            let along = match long {
                0 => UnitQuaternion::identity(),
                1 => UnitQuaternion::from_euler_angles(0.0, 0.0, -FRAC_PI_2),
                _ => UnitQuaternion::from_euler_angles(0.0, FRAC_PI_2, 0.0),
            };
            let rotation = UnitQuaternion::from_euler_angles(0.8 * f64::from(k), 0.0, 0.0) * along;
            let lowest = model.visual.mesh.positions.iter().map(|p| (rotation * p.cast::<f64>()).z);
            let height = table - lowest.fold(f64::INFINITY, f64::min);
            let pose = Isometry3::from_parts([0.6, 0.05, height].into(), rotation);
            let marker = BelievedObject::new(model.clone(), Pose::new(pose));
            let belief = BeliefScene { objects: vec![marker], ..setup.cell.empty_belief() };
            let grasp = planner.choose_grasp(&belief, 0, &setup.cell.start, None);
            let (grasp, _) = grasp.unwrap_or_else(|e| panic!("{k}: {e} {:?}", e.counters.grasps));
            let tip = grasp.world_from_gripper.transform_point(&Point3::new(pad.x, 0.0, 0.0)).z - table;
            let margin = planner.settings().grasp.margin;
            assert!(tip >= margin - 1e-6 && tip < 0.015, "{k}: {tip}");
        }
    }
}
