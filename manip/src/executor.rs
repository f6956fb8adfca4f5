//! Carries a plan out through a robot port, with what a real Fetch can sense: joints, fingers, forces.
//!
//! A small state machine, one step of the plan after the other. Guarded motions stop on contact; a grasp has missed
//! when the fingers close completely; an object is lost when they close further while it is carried.

use serde::{Deserialize, Serialize};

use crate::plan::{Action, Guard, PickPlacePlan, PlanStep, StepName};
use crate::timing::Trajectory;

pub use crate::plan::GripperCommand;

/// What the robot is told for one control period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControlTarget<'a> {
    /// Positions of all movable joints in the model's order, radians or metres. Those of the fingers are to be ignored:
    /// the gripper's command rules them.
    pub joints: &'a [f64],
    /// What the gripper does.
    pub gripper: GripperCommand,
}

/// The robot refuses to move on: too much force, or too far behind its target.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("protective stop: {reason}")]
pub struct ProtectiveStop {
    /// Why.
    pub reason: String,
}

/// A robot, simulated or real, that follows joint targets.
pub trait RobotPort {
    /// Time, seconds.
    fn time(&self) -> f64;
    /// Length of a control period, seconds.
    fn period(&self) -> f64 {
        1.0 / 240.0
    }
    /// Measured positions of all movable joints, in the model's order.
    fn joints(&self) -> Vec<f64>;
    /// Measured positions of the fingers (right, left), metres; 0 is closed, the pads' distance is their sum.
    fn fingers(&self) -> [f64; 2];
    /// Force with which the finger drives press, newtons a finger.
    fn grip_force(&self) -> f64;
    /// Largest external force that arm or fingers feel, newtons, as joint torque sensing gives; what the fingers press
    /// against each other or an object between them does not count.
    fn contact_force(&self) -> f64;
    /// Goes on for one control period.
    ///
    /// # Errors
    /// When the robot has stopped itself.
    fn step(&mut self, target: &ControlTarget<'_>) -> Result<(), ProtectiveStop>;
}

/// Settings of [`execute`].
#[derive(Debug, Clone, PartialEq)]
pub struct ExecutorSettings {
    /// Contact force that stops a free motion, newtons above what was felt at its start. Default 60.
    pub free_force: f64,
    /// Control periods in a row for which a force must last to stop a motion. Default 2.
    pub force_periods: u32,
    /// Longest wait for the joints to arrive after a motion, seconds. Default 0.6.
    pub settle: f64,
    /// Joints this near to their target have arrived, radians or metres. Default 0.005.
    pub arrived: f64,
    /// Joints farther than this from their target after the wait have failed, radians or metres. Default 0.05.
    pub lost: f64,
    /// Longest wait for the fingers, seconds. Default 3.0.
    pub grip_timeout: f64,
    /// The fingers stand still when they move less than this in 0.1 s, metres. Default 0.0002.
    pub still: f64,
    /// Fingers closer together than this share of the expected width have missed. Default 0.3.
    pub miss_share: f64,
    /// ... or than this, metres. Default 0.001.
    pub miss_width: f64,
    /// Change of the width while carrying that counts as lost, metres. Default 0.010.
    pub slip_limit: f64,
    /// A lowering motion that meets something with less than this left lets go there, metres. Default 0.1: on what
    /// stands in its way in the bin, rather than to carry it about.
    pub early_release: f64,
    /// Share of the planned speed when backing off. Default 0.5.
    pub back_off: f64,
    /// Most of a guarded motion that is taken back to relieve a contact, seconds of the plan. Default 0.3.
    pub relief: f64,
}

impl Default for ExecutorSettings {
    fn default() -> Self {
        Self {
            free_force: 60.0,
            force_periods: 2,
            settle: 0.6,
            arrived: 0.005,
            lost: 0.05,
            grip_timeout: 3.0,
            still: 0.0002,
            miss_share: 0.3,
            miss_width: 0.001,
            slip_limit: 0.010,
            early_release: 0.1,
            back_off: 0.5,
            relief: 0.3,
        }
    }
}

/// Where an execution failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ExecStage {
    /// On the way to the object.
    Approach,
    /// Closing on it.
    Grasp,
    /// Lifting it.
    Lift,
    /// Carrying it to the bin.
    Carry,
    /// Lowering it, letting go, or drawing back.
    Place,
}

impl From<StepName> for ExecStage {
    fn from(name: StepName) -> Self {
        match name {
            StepName::Open | StepName::ToPregrasp | StepName::Approach => Self::Approach,
            StepName::Close => Self::Grasp,
            StepName::Lift => Self::Lift,
            StepName::Carry | StepName::Home => Self::Carry,
            StepName::Lower | StepName::Release | StepName::Retreat => Self::Place,
        }
    }
}

/// How an execution ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ExecOutcome {
    /// All steps are done, as far as the robot can tell.
    Done,
    /// A step failed.
    Failed {
        /// Where.
        stage: ExecStage,
        /// In words.
        reason: String,
    },
}

/// One step as it went.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StepReport {
    /// Which one.
    pub name: StepName,
    /// Beginning, seconds of the port's time.
    pub begin_s: f64,
    /// End, seconds of the port's time.
    pub end_s: f64,
    /// Largest contact force felt, newtons.
    pub peak_contact_n: f64,
    /// The motion stopped on contact before its end.
    pub stopped_early: bool,
}

/// What happened, as the robot itself could tell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ExecutionReport {
    /// The steps begun, in order.
    pub steps: Vec<StepReport>,
    /// How it ended.
    pub outcome: ExecOutcome,
    /// Distance of the pads after closing, metres.
    pub grasp_width_m: Option<f64>,
    /// Largest change of that distance while the object was held, metres.
    pub slip_m: f64,
    /// Largest contact force of all steps, newtons.
    pub peak_contact_n: f64,
    /// Largest force of the finger drives, newtons.
    pub peak_grip_n: f64,
}

impl ExecutionReport {
    /// Stage and reason when it failed.
    pub fn failure(&self) -> Option<(ExecStage, String)> {
        match &self.outcome {
            ExecOutcome::Done => None,
            ExecOutcome::Failed { stage, reason } => Some((*stage, reason.clone())),
        }
    }

    /// From the first step's beginning to the last one's end, seconds.
    pub fn seconds(&self) -> f64 {
        match (self.steps.first(), self.steps.last()) {
            (Some(first), Some(last)) => last.end_s - first.begin_s,
            _ => 0.0,
        }
    }
}

/// Sees every control period of an execution.
pub trait Observer {
    /// Called after each period with the step and the port's time.
    fn tick(&mut self, _step: StepName, _time: f64) {}
    /// Called after each step.
    fn step_done(&mut self, _report: &StepReport) {}
}

impl Observer for () {}

/// Carries out a pick and place.
///
/// When it fails on the way to the object or at the grasp the gripper opens and draws back the way it came; when an
/// object is lost the robot stands where it is. Either way the report tells, and the caller plans the way home.
pub fn execute(
    port: &mut impl RobotPort,
    plan: &PickPlacePlan,
    settings: &ExecutorSettings,
    observer: &mut impl Observer,
) -> ExecutionReport {
    run(port, &plan.steps, settings, observer)
}

/// Carries out a single free motion, such as the one home, with the gripper as it is.
pub fn execute_motion(
    port: &mut impl RobotPort,
    trajectory: &Trajectory,
    settings: &ExecutorSettings,
    observer: &mut impl Observer,
) -> ExecutionReport {
    let step = PlanStep {
        name: StepName::Home,
        action: Action::Move { trajectory: trajectory.clone(), guard: None, holding: false },
    };
    run(port, &[step], settings, observer)
}

fn run(
    port: &mut impl RobotPort,
    steps: &[PlanStep],
    settings: &ExecutorSettings,
    observer: &mut impl Observer,
) -> ExecutionReport {
    let mut run = Run {
        target: port.joints(),
        port,
        settings,
        observer,
        gripper: GripperCommand::Hold,
        opened: GripperCommand::Hold,
        step: StepName::Open,
        peak_contact: 0.0,
        report: ExecutionReport {
            steps: Vec::new(),
            outcome: ExecOutcome::Done,
            grasp_width_m: None,
            slip_m: 0.0,
            peak_contact_n: 0.0,
            peak_grip_n: 0.0,
        },
    };
    let mut approach: Option<&Trajectory> = None;
    for step in steps {
        if let (StepName::Approach, Action::Move { trajectory, .. }) = (step.name, &step.action) {
            approach = Some(trajectory);
        }
        let begin_s = run.port.time();
        run.step = step.name;
        run.peak_contact = 0.0;
        let result = run.perform(step);
        let report = StepReport {
            name: step.name,
            begin_s,
            end_s: run.port.time(),
            peak_contact_n: run.peak_contact,
            stopped_early: matches!(result, Ok(End::Stopped)),
        };
        run.observer.step_done(&report);
        run.report.steps.push(report);
        if let Err(stop) = result {
            run.report.outcome = ExecOutcome::Failed { stage: step.name.into(), reason: stop.reason };
            run.recover(step, approach, stop.gone);
            break;
        }
    }
    run.report
}

/// A motion may begin this far from where the arm is, radians or metres: what a guarded motion leaves when it stops early.
const FARTHEST_START: f64 = 0.25;

/// How a step ended well.
enum End {
    Complete,
    /// On contact, near enough to the goal.
    Stopped,
}

/// Why a step ended badly, and how many seconds of its trajectory were done.
struct Stop {
    reason: String,
    gone: f64,
}

struct Run<'a, P, O> {
    port: &'a mut P,
    settings: &'a ExecutorSettings,
    observer: &'a mut O,
    target: Vec<f64>,
    gripper: GripperCommand,
    /// The last command that opened the gripper.
    opened: GripperCommand,
    step: StepName,
    peak_contact: f64,
    report: ExecutionReport,
}

impl<P: RobotPort, O: Observer> Run<'_, P, O> {
    fn perform(&mut self, step: &PlanStep) -> Result<End, Stop> {
        match &step.action {
            Action::Gripper { command, width } => {
                self.gripper = *command;
                if let GripperCommand::Open { .. } = command {
                    self.opened = *command;
                }
                self.grip(*command, *width)
                    .map(|()| End::Complete)
                    .map_err(|reason| Stop { reason, gone: 0.0 })
            }
            Action::Move { trajectory, guard, holding } => self.follow(trajectory, guard.as_ref(), *holding),
        }
    }

    fn width(&self) -> f64 {
        self.port.fingers().iter().sum()
    }

    /// One control period.
    fn tick(&mut self) -> Result<(), String> {
        let target = ControlTarget { joints: &self.target, gripper: self.gripper };
        self.port.step(&target).map_err(|stop| stop.to_string())?;
        let force = self.port.contact_force();
        self.peak_contact = self.peak_contact.max(force);
        self.report.peak_contact_n = self.report.peak_contact_n.max(force);
        self.report.peak_grip_n = self.report.peak_grip_n.max(self.port.grip_force());
        self.observer.tick(self.step, self.port.time());
        Ok(())
    }

    fn follow(&mut self, trajectory: &Trajectory, guard: Option<&Guard>, holding: bool) -> Result<End, Stop> {
        let begin = self.port.time();
        let baseline = self.port.contact_force();
        let limit = guard.map_or(self.settings.free_force, |g| g.force_n);
        // After a motion that stopped early the arm is not where this one begins: the difference fades out on the way.
        let offset: Vec<f64> = trajectory
            .joints
            .iter()
            .zip(trajectory.first())
            .map(|(&j, first)| self.target[j] - first)
            .collect();
        if let Some(far) = offset.iter().find(|o| o.is_nan() || o.abs() > FARTHEST_START) {
            let reason = format!("the robot is not where the motion begins: a joint is {far:.3} off");
            return Err(Stop { reason, gone: 0.0 });
        }
        let mut pressed = 0;
        loop {
            let gone = self.port.time() - begin;
            let fail = |reason: String| Stop { reason, gone };
            self.aim(trajectory, gone + self.port.period(), &offset);
            self.tick().map_err(fail)?;
            if holding {
                self.watch_object().map_err(fail)?;
            }
            pressed = if self.port.contact_force() - baseline > limit { pressed + 1 } else { 0 };
            if pressed >= self.settings.force_periods {
                return self.touched(trajectory, guard, gone, limit, &offset, baseline);
            }
            if gone >= trajectory.duration {
                break;
            }
        }
        self.settle(trajectory, holding)
    }

    /// Decides what a contact means.
    fn touched(
        &mut self,
        trajectory: &Trajectory,
        guard: Option<&Guard>,
        gone: f64,
        limit: f64,
        offset: &[f64],
        baseline: f64,
    ) -> Result<End, Stop> {
        // Stay where the contact was felt instead of pressing on.
        let measured = self.port.joints();
        for &j in &trajectory.joints {
            self.target[j] = measured[j];
        }
        if let Some(guard) = guard {
            let left = guard.length * (1.0 - done_share(trajectory, gone));
            let enough = if self.step == StepName::Lower {
                self.settings.early_release.max(guard.near)
            } else {
                guard.near
            };
            if left <= enough {
                self.relieve(trajectory, gone, limit, offset, baseline)?;
                return Ok(End::Stopped);
            }
            return Err(Stop { reason: format!("contact above {limit:.0} N with {left:.3} m to go"), gone });
        }
        Err(Stop { reason: format!("unexpected contact above {limit:.0} N"), gone })
    }

    /// Draws back the way it came until the contact hardly presses, so that nothing is squeezed while the fingers move.
    fn relieve(
        &mut self,
        trajectory: &Trajectory,
        gone: f64,
        limit: f64,
        offset: &[f64],
        baseline: f64,
    ) -> Result<(), Stop> {
        let last = (gone - self.settings.relief).max(0.0);
        let mut t = gone;
        while t > last && self.port.contact_force() - baseline > 0.25 * limit {
            t = (t - self.port.period() * self.settings.back_off).max(last);
            self.aim(trajectory, t, offset);
            self.tick().map_err(|reason| Stop { reason, gone: t })?;
        }
        Ok(())
    }

    /// Targets the trajectory at `t`, plus what is left of `offset` (none when empty).
    fn aim(&mut self, trajectory: &Trajectory, t: f64, offset: &[f64]) {
        let (q, _) = trajectory.sample(t);
        let x = if trajectory.duration > 0.0 { (t / trajectory.duration).clamp(0.0, 1.0) } else { 1.0 };
        let left = 1.0 - x * x * (3.0 - 2.0 * x);
        for (k, (&j, v)) in trajectory.joints.iter().zip(q).enumerate() {
            self.target[j] = v + left * offset.get(k).copied().unwrap_or(0.0);
        }
    }

    /// Waits for the joints to arrive.
    fn settle(&mut self, trajectory: &Trajectory, holding: bool) -> Result<End, Stop> {
        let fail = |reason: String| Stop { reason, gone: trajectory.duration };
        let end = self.port.time() + self.settings.settle;
        loop {
            let measured = self.port.joints();
            let off =
                trajectory.joints.iter().map(|&j| (measured[j] - self.target[j]).abs()).fold(0.0, f64::max);
            if off <= self.settings.arrived {
                return Ok(End::Complete);
            }
            if self.port.time() >= end {
                if off > self.settings.lost {
                    return Err(fail(format!("a joint is {off:.3} short of its goal")));
                }
                return Ok(End::Complete);
            }
            self.tick().map_err(fail)?;
            if holding {
                self.watch_object().map_err(fail)?;
            }
        }
    }

    /// Moves the fingers and judges a grasp.
    fn grip(&mut self, command: GripperCommand, expected: f64) -> Result<(), String> {
        let begin = self.port.time();
        let window = (0.1 / self.port.period()).ceil() as usize;
        let mut widths = vec![self.width()];
        while self.port.time() - begin < self.settings.grip_timeout {
            self.tick()?;
            widths.push(self.width());
            let n = widths.len();
            let still =
                n > window + 1 && (widths[n - 1] - widths[n - 1 - window]).abs() < self.settings.still;
            let done = match command {
                GripperCommand::Open { width } => {
                    (widths[n - 1] - width).abs() < 0.001 || (still && n > 3 * window)
                }
                // The drives build their force up after the fingers stand still.
                GripperCommand::Close { force_n } => {
                    still && (self.port.grip_force() > 0.8 * force_n || n > 10 * window)
                }
                GripperCommand::Hold => true,
            };
            if done {
                break;
            }
        }
        if let GripperCommand::Close { .. } = command {
            let width = self.width();
            self.report.grasp_width_m = Some(width);
            let missed = (self.settings.miss_share * expected).max(self.settings.miss_width);
            if width < missed {
                return Err(format!(
                    "missed: the fingers closed to {:.1} mm, the object is {:.1} mm wide",
                    1e3 * width,
                    1e3 * expected
                ));
            }
        }
        Ok(())
    }

    /// The fingers of a hand that holds something do not move.
    fn watch_object(&mut self) -> Result<(), String> {
        let Some(grasped) = self.report.grasp_width_m else {
            return Ok(());
        };
        let width = self.width();
        let slip = (width - grasped).abs();
        self.report.slip_m = self.report.slip_m.max(slip);
        let closed = width < (self.settings.miss_share * grasped).max(self.settings.miss_width);
        if closed || slip > self.settings.slip_limit {
            return Err(format!(
                "lost the object: the fingers went from {:.1} to {:.1} mm",
                1e3 * grasped,
                1e3 * width
            ));
        }
        Ok(())
    }

    /// After a failure: opens and draws back the way it came, as far as the robot lets it. Errors here change nothing.
    fn recover(&mut self, step: &PlanStep, approach: Option<&Trajectory>, gone: f64) {
        let back = match (&step.action, step.name) {
            (Action::Move { trajectory, .. }, StepName::ToPregrasp | StepName::Approach | StepName::Home) => {
                // A free motion backs off for half a second, a straight one to its beginning.
                let to = if step.name == StepName::Approach { 0.0 } else { (gone - 0.5).max(0.0) };
                Some((trajectory, gone, to))
            }
            (_, StepName::Close) => {
                self.gripper = self.opened;
                if self.grip(self.opened, 0.0).is_err() {
                    return;
                }
                approach.map(|t| (t, t.duration, 0.0))
            }
            (Action::Move { trajectory, .. }, StepName::Lower) => Some((trajectory, gone, 0.0)),
            _ => None,
        };
        if let Some((trajectory, from, to)) = back {
            let mut t = from;
            while t > to {
                t = (t - self.port.period() * self.settings.back_off).max(to);
                self.aim(trajectory, t, &[]);
                if self.tick().is_err() {
                    return;
                }
            }
        }
    }
}

/// Share of a trajectory's way, by joint-space length, that is done after `gone` seconds.
fn done_share(trajectory: &Trajectory, gone: f64) -> f64 {
    let p = &trajectory.points;
    let step = |w: &[crate::timing::TrajectoryPoint]| -> f64 {
        w[0].q.iter().zip(&w[1].q).map(|(a, b)| (b - a).powi(2)).sum::<f64>().sqrt()
    };
    let total: f64 = p.windows(2).map(step).sum();
    let done_points = ((gone / trajectory.dt).floor() as usize + 1).min(p.len());
    let done: f64 = p[..done_points].windows(2).map(step).sum();
    if total > 0.0 { done / total } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::timing::TrajectoryPoint;

    /// A robot with one arm joint that follows perfectly and two fingers; an obstacle and an object at will.
    struct Fake {
        time: f64,
        q: f64,
        fingers: f64,
        command: GripperCommand,
        /// Width of what stands between the fingers when they close.
        object: f64,
        /// Time at which the object is lost.
        lost_at: f64,
        /// The arm feels 50 N beyond this position.
        wall: f64,
        /// Time of a protective stop, which passes.
        stop_at: f64,
        /// Highest speed commanded while the gripper is closed.
        fastest: f64,
    }

    impl Fake {
        fn new(object: f64) -> Self {
            Self {
                time: 0.0,
                q: 0.0,
                fingers: 0.05,
                command: GripperCommand::Hold,
                object,
                lost_at: f64::INFINITY,
                wall: f64::INFINITY,
                stop_at: f64::INFINITY,
                fastest: 0.0,
            }
        }
    }

    impl RobotPort for Fake {
        fn time(&self) -> f64 {
            self.time
        }
        fn joints(&self) -> Vec<f64> {
            vec![self.q, self.fingers, self.fingers]
        }
        fn fingers(&self) -> [f64; 2] {
            [self.fingers; 2]
        }
        fn grip_force(&self) -> f64 {
            match self.command {
                GripperCommand::Close { force_n } if self.fingers <= 0.5 * self.object => force_n,
                _ => 0.0,
            }
        }
        fn contact_force(&self) -> f64 {
            if self.q > self.wall { 50.0 } else { 0.5 }
        }
        fn step(&mut self, target: &ControlTarget<'_>) -> Result<(), ProtectiveStop> {
            self.time += self.period();
            if self.time > self.stop_at && self.time < self.stop_at + 0.02 {
                return Err(ProtectiveStop { reason: "too much torque".into() });
            }
            if let GripperCommand::Close { .. } = self.command {
                self.fastest = self.fastest.max((target.joints[0] - self.q).abs() / self.period());
            }
            self.q = target.joints[0];
            self.command = match target.gripper {
                GripperCommand::Hold => self.command,
                other => other,
            };
            let object = if self.time > self.lost_at { 0.0 } else { self.object };
            let goal = match self.command {
                GripperCommand::Open { width } => 0.5 * width,
                GripperCommand::Close { .. } => 0.5 * object,
                GripperCommand::Hold => self.fingers,
            };
            let most = 0.05 * self.period();
            self.fingers += (goal - self.fingers).clamp(-most, most);
            Ok(())
        }
    }

    fn line(from: f64, to: f64, seconds: f64) -> Trajectory {
        let dt = 1.0 / 240.0;
        let n = (seconds / dt).round() as usize;
        let points = (0..=n)
            .map(|i| TrajectoryPoint {
                q: vec![from + (to - from) * i as f64 / n as f64],
                qd: vec![(to - from) / seconds],
            })
            .collect();
        Trajectory { joints: vec![0], dt, duration: seconds, points }
    }

    fn steps() -> Vec<PlanStep> {
        let guard = Some(Guard { force_n: 20.0, near: 0.02, length: 0.1 });
        let go = |name, from, to, guard, holding| PlanStep {
            name,
            action: Action::Move { trajectory: line(from, to, 1.0), guard, holding },
        };
        let grip = |name, command, width| PlanStep { name, action: Action::Gripper { command, width } };
        vec![
            grip(StepName::Open, GripperCommand::Open { width: 0.10 }, 0.10),
            go(StepName::ToPregrasp, 0.0, 0.5, None, false),
            go(StepName::Approach, 0.5, 0.6, guard, false),
            grip(StepName::Close, GripperCommand::Close { force_n: 30.0 }, 0.06),
            go(StepName::Lift, 0.6, 0.4, None, true),
            go(StepName::Carry, 0.4, -0.4, None, true),
            go(StepName::Lower, -0.4, -0.5, guard, true),
            grip(StepName::Release, GripperCommand::Open { width: 0.09 }, 0.09),
            go(StepName::Retreat, -0.5, -0.4, None, false),
        ]
    }

    fn go(port: &mut Fake) -> ExecutionReport {
        run(port, &steps(), &ExecutorSettings::default(), &mut ())
    }

    #[test]
    fn a_good_grasp_is_carried_to_the_end() {
        let mut port = Fake::new(0.06);
        let report = go(&mut port);
        assert_eq!(report.failure(), None);
        assert_eq!(report.steps.len(), 9);
        assert!((report.grasp_width_m.unwrap() - 0.06).abs() < 1e-3 && report.slip_m < 1e-3);
        assert!((port.q + 0.4).abs() < 1e-9 && (2.0 * port.fingers - 0.09).abs() < 2e-3);
        assert!(report.peak_grip_n == 30.0 && report.seconds() > 6.0);
    }

    #[test]
    fn fingers_that_close_completely_have_missed_and_the_hand_draws_back_open() {
        let mut port = Fake::new(0.0);
        let (stage, reason) = go(&mut port).failure().unwrap();
        assert_eq!(stage, ExecStage::Grasp);
        assert!(reason.contains("missed"), "{reason}");
        assert!((port.q - 0.5).abs() < 1e-6 && port.fingers > 0.049);
    }

    #[test]
    fn an_early_contact_fails_the_approach_and_a_late_one_grasps_there() {
        let mut port = Fake::new(0.06);
        port.wall = 0.53;
        let report = go(&mut port);
        let (stage, reason) = report.failure().unwrap();
        assert_eq!(stage, ExecStage::Approach);
        assert!(reason.contains("contact"), "{reason}");
        assert!((port.q - 0.5).abs() < 1e-6, "backed off");
        let mut port = Fake::new(0.06);
        port.wall = 0.59;
        let report = go(&mut port);
        assert!(report.steps[2].stopped_early && port.fastest < 1.0, "no jump to where the lift begins");
        assert_eq!(report.failure(), None);
    }

    #[test]
    fn a_plan_for_another_configuration_is_refused_without_a_motion() {
        let mut port = Fake::new(0.06);
        port.q = 1.0;
        let (_, reason) = go(&mut port).failure().unwrap();
        assert!(reason.contains("not where"), "{reason}");
        assert!((port.q - 1.0).abs() < 1e-12);
    }

    #[test]
    fn an_object_lost_on_the_way_is_noticed_by_the_fingers() {
        let mut port = Fake::new(0.06);
        port.lost_at = 3.0;
        let (stage, reason) = go(&mut port).failure().unwrap();
        assert!(matches!(stage, ExecStage::Lift | ExecStage::Carry), "{stage:?}");
        assert!(reason.contains("lost"), "{reason}");
    }

    #[test]
    fn a_protective_stop_ends_the_execution_with_its_reason() {
        let mut port = Fake::new(0.06);
        port.stop_at = 1.4;
        let (stage, reason) = go(&mut port).failure().unwrap();
        assert_eq!(stage, ExecStage::Approach);
        assert!(reason.contains("too much torque"), "{reason}");
    }
}
