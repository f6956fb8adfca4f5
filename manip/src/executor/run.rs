//! The state machine: one step of a plan after the other, and what to do when one fails.

use nalgebra::Vector3;

use super::port::{ControlTarget, RobotPort};
use super::report::{ExecCause, ExecOutcome, ExecutionReport, Observer, StepReport};
use super::settings::ExecutorSettings;
use crate::motion::Trajectory;
use crate::plan::{Action, GripperCommand, Guard, PlanStep, StepName};

/// Carries out `steps`, one after the other.
pub(super) fn run(
    port: &mut impl RobotPort,
    steps: &[PlanStep],
    settings: &ExecutorSettings,
    observer: &mut impl Observer,
) -> ExecutionReport {
    let mut run = Run::new(port, settings, observer);
    let mut approach: Option<Followed<'_>> = None;
    // Where a lowering motion stopped high above its goal: the way back begins there and not at the goal.
    let mut stopped_high: Option<(Followed<'_>, f64)> = None;
    for step in steps {
        let begin_s = run.begin(step.name);
        let result = match stopped_high.take_if(|_| step.name == StepName::Retreat) {
            Some((lower, gone)) => run.back(&lower, gone, 0.0).map(|()| End::Complete),
            None => run.perform(step),
        };
        if let Action::Move { trajectory, .. } = &step.action {
            let followed = || Followed { trajectory, offset: run.offset.clone() };
            if step.name == StepName::Approach {
                approach = Some(followed());
            }
            if let Ok(End::Stopped { gone, high: true }) = &result {
                stopped_high = Some((followed(), *gone));
            }
        }
        run.end(begin_s, matches!(result, Ok(End::Stopped { .. })));
        if let Err(stop) = result {
            let Stop { cause, reason, gone } = stop;
            run.report.outcome = ExecOutcome::Failed { stage: step.name.into(), cause, reason };
            run.recover(step, approach, gone);
            break;
        }
    }
    run.report
}

/// Opens the gripper a little where it stands.
pub(super) fn release_in_place(
    port: &mut impl RobotPort,
    settings: &ExecutorSettings,
    observer: &mut impl Observer,
) -> ExecutionReport {
    let mut run = Run::new(port, settings, observer);
    let begin_s = run.begin(StepName::Release);
    run.gripper = GripperCommand::Open { width: run.width() + settings.release_opening };
    for _ in 0..(settings.release_time / run.port.period()).round() as usize {
        if let Err(Stop { cause, reason, .. }) = run.tick()
            && run.report.outcome == ExecOutcome::Done
        {
            run.report.outcome = ExecOutcome::Failed { stage: StepName::Release.into(), cause, reason };
        }
    }
    run.end(begin_s, false);
    run.report
}

/// A motion that was followed, and how far from where it begins each of its joints was at its beginning.
struct Followed<'a> {
    trajectory: &'a Trajectory,
    offset: Vec<f64>,
}

/// How a step ended well.
enum End {
    Complete,
    /// On contact, near enough to the goal, after so many seconds of the trajectory.
    Stopped {
        gone: f64,
        /// Farther from the goal than what a guard calls near.
        high: bool,
    },
}

/// Why a step ended badly, and how many seconds of its trajectory were done.
struct Stop {
    cause: ExecCause,
    reason: String,
    gone: f64,
}

impl Stop {
    fn new(cause: ExecCause, reason: String) -> Self {
        Self { cause, reason, gone: 0.0 }
    }

    fn after(self, gone: f64) -> Self {
        Self { gone, ..self }
    }
}

/// The forces on the robot at a moment.
#[derive(Clone, Copy, Default)]
struct Felt {
    hand: Vector3<f64>,
    link: f64,
}

impl Felt {
    /// How much more, or in another direction, than at another moment, newtons: a held object's weight is no contact.
    fn beside(&self, before: &Self) -> f64 {
        (self.hand - before.hand).norm().max(self.link - before.link)
    }
}

struct Run<'a, P, O> {
    port: &'a mut P,
    settings: &'a ExecutorSettings,
    observer: &'a mut O,
    target: Vec<f64>,
    /// How far from where the last motion begins each of its joints was at its beginning: it fades out on the way.
    offset: Vec<f64>,
    gripper: GripperCommand,
    /// The last command that opened the gripper.
    opened: GripperCommand,
    step: StepName,
    /// What was felt when the step began.
    before: Felt,
    peak_contact: f64,
    report: ExecutionReport,
}

impl<'a, P: RobotPort, O: Observer> Run<'a, P, O> {
    fn new(port: &'a mut P, settings: &'a ExecutorSettings, observer: &'a mut O) -> Self {
        Self {
            target: port.joints(),
            offset: Vec::new(),
            port,
            settings,
            observer,
            gripper: GripperCommand::Hold,
            opened: GripperCommand::Hold,
            step: StepName::Open,
            before: Felt::default(),
            peak_contact: 0.0,
            report: ExecutionReport {
                steps: Vec::new(),
                outcome: ExecOutcome::Done,
                grasp_width_m: None,
                slip_m: 0.0,
                peak_contact_n: 0.0,
                peak_grip_n: 0.0,
            },
        }
    }

    /// Begins a step; the port's time.
    fn begin(&mut self, step: StepName) -> f64 {
        self.step = step;
        self.before = self.felt();
        self.peak_contact = 0.0;
        self.port.time()
    }

    /// Reports the step that began at `begin_s`.
    fn end(&mut self, begin_s: f64, stopped_early: bool) {
        let report = StepReport {
            name: self.step,
            begin_s,
            end_s: self.port.time(),
            peak_contact_n: self.peak_contact,
            stopped_early,
        };
        self.observer.step_done(&report);
        self.report.steps.push(report);
    }

    fn perform(&mut self, step: &PlanStep) -> Result<End, Stop> {
        match &step.action {
            Action::Gripper { command, width } => {
                self.gripper = *command;
                if let GripperCommand::Open { .. } = command {
                    self.opened = *command;
                }
                self.grip(*command, *width).map(|()| End::Complete)
            }
            Action::Move { trajectory, guard, holding } => self.follow(trajectory, guard.as_ref(), *holding),
        }
    }

    fn width(&self) -> f64 {
        self.port.fingers().iter().sum()
    }

    fn felt(&self) -> Felt {
        Felt { hand: self.port.hand_force(), link: self.port.link_force() }
    }

    /// The force of contacts, newtons: what is felt beside what was felt when the step began.
    fn contact_force(&self) -> f64 {
        self.felt().beside(&self.before)
    }

    /// One control period.
    fn tick(&mut self) -> Result<(), Stop> {
        let target = ControlTarget { joints: &self.target, gripper: self.gripper };
        self.port.step(&target).map_err(|stop| Stop::new(ExecCause::Contact, stop.to_string()))?;
        let force = self.contact_force();
        self.peak_contact = self.peak_contact.max(force);
        self.report.peak_contact_n = self.report.peak_contact_n.max(force);
        self.report.peak_grip_n = self.report.peak_grip_n.max(self.port.grip_force());
        self.observer.tick(self.step, self.port.time());
        Ok(())
    }

    fn follow(&mut self, trajectory: &Trajectory, guard: Option<&Guard>, holding: bool) -> Result<End, Stop> {
        let begin = self.port.time();
        let limit = guard.map_or(self.settings.free_force, |g| g.force_n);
        // After a motion that stopped early the arm is not where this one begins: the difference fades out on the way.
        let offset: Vec<f64> = trajectory
            .joints
            .iter()
            .zip(trajectory.first())
            .map(|(&j, first)| self.target[j] - first)
            .collect();
        if let Some(far) = offset.iter().find(|o| o.is_nan() || o.abs() > self.settings.farthest_start) {
            let reason = format!("the robot is not where the motion begins: a joint is {far:.3} off");
            return Err(Stop::new(ExecCause::Astray, reason));
        }
        self.offset.clone_from(&offset);
        let mut pressed = 0;
        loop {
            let gone = self.port.time() - begin;
            self.aim(trajectory, gone + self.port.period(), &offset);
            self.tick().map_err(|stop| stop.after(gone))?;
            if holding {
                self.watch_object().map_err(|stop| stop.after(gone))?;
            }
            pressed = if self.contact_force() > limit { pressed + 1 } else { 0 };
            if pressed >= self.settings.force_periods {
                return self.touched(trajectory, guard, gone, limit, &offset);
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
    ) -> Result<End, Stop> {
        // Stay where the contact was felt instead of pressing on.
        let measured = self.port.joints();
        for &j in &trajectory.joints {
            self.target[j] = measured[j];
        }
        if let Some(guard) = guard {
            let left = left(guard, trajectory, gone);
            let enough = if self.step == StepName::Lower {
                self.settings.early_release.max(guard.near)
            } else {
                guard.near
            };
            if left <= enough {
                let gone = self.relieve(trajectory, gone, limit, offset)?;
                return Ok(End::Stopped { gone, high: left > guard.near });
            }
            let reason = format!("contact above {limit:.0} N with {left:.3} m to go");
            return Err(Stop::new(ExecCause::Contact, reason).after(gone));
        }
        Err(Stop::new(ExecCause::Contact, format!("unexpected contact above {limit:.0} N")).after(gone))
    }

    /// Draws back the way it came until the contact hardly presses, so that nothing is squeezed while the fingers move.
    /// Returns where on the trajectory it is then.
    fn relieve(
        &mut self,
        trajectory: &Trajectory,
        gone: f64,
        limit: f64,
        offset: &[f64],
    ) -> Result<f64, Stop> {
        let last = (gone - self.settings.relief_time).max(0.0);
        let mut t = gone;
        while t > last && self.contact_force() > self.settings.relief_share * limit {
            t = (t - self.port.period() * self.settings.back_off_speed).max(last);
            self.aim(trajectory, t, offset);
            self.tick().map_err(|stop| stop.after(t))?;
        }
        Ok(t)
    }

    /// Goes back the way it came along a motion, slower, from one time of it to an earlier one.
    fn back(&mut self, motion: &Followed<'_>, from: f64, to: f64) -> Result<(), Stop> {
        let mut t = from;
        while t > to {
            t = (t - self.port.period() * self.settings.back_off_speed).max(to);
            self.aim(motion.trajectory, t, &motion.offset);
            self.tick().map_err(|stop| stop.after(t))?;
        }
        Ok(())
    }

    /// Targets the trajectory at `t`, plus what is left of `offset` there.
    fn aim(&mut self, trajectory: &Trajectory, t: f64, offset: &[f64]) {
        let (q, _) = trajectory.sample(t);
        let x = if trajectory.duration > 0.0 { (t / trajectory.duration).clamp(0.0, 1.0) } else { 1.0 };
        let left = 1.0 - x * x * (3.0 - 2.0 * x);
        for (k, (&j, v)) in trajectory.joints.iter().zip(q).enumerate() {
            self.target[j] = v + left * offset[k];
        }
    }

    /// Waits for the joints to arrive.
    fn settle(&mut self, trajectory: &Trajectory, holding: bool) -> Result<End, Stop> {
        let gone = trajectory.duration;
        let end = self.port.time() + self.settings.settle_time;
        loop {
            let measured = self.port.joints();
            let off =
                trajectory.joints.iter().map(|&j| (measured[j] - self.target[j]).abs()).fold(0.0, f64::max);
            if off <= self.settings.arrival_tolerance {
                return Ok(End::Complete);
            }
            if self.port.time() >= end {
                if off > self.settings.tracking_tolerance {
                    let reason = format!("a joint is {off:.3} short of its goal");
                    return Err(Stop::new(ExecCause::Astray, reason).after(gone));
                }
                return Ok(End::Complete);
            }
            self.tick().map_err(|stop| stop.after(gone))?;
            if holding {
                self.watch_object().map_err(|stop| stop.after(gone))?;
            }
        }
    }

    /// Moves the fingers and judges a grasp.
    fn grip(&mut self, command: GripperCommand, expected: f64) -> Result<(), Stop> {
        let begin = self.port.time();
        let window = (0.1 / self.port.period()).ceil() as usize;
        let mut widths = vec![self.width()];
        while self.port.time() - begin < self.settings.grip_timeout {
            self.tick()?;
            widths.push(self.width());
            let n = widths.len();
            let still =
                n > window + 1 && (widths[n - 1] - widths[n - 1 - window]).abs() < self.settings.still_motion;
            let done = match command {
                GripperCommand::Open { width } => {
                    (widths[n - 1] - width).abs() < self.settings.opening_tolerance
                        || (still && n > 3 * window)
                }
                // The drives build their force up after the fingers stand still.
                GripperCommand::Close { force_n } => {
                    still
                        && (self.port.grip_force() > self.settings.pressed_share * force_n || n > 10 * window)
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
                let reason = format!(
                    "missed: the fingers closed to {:.1} mm, the object is {:.1} mm wide",
                    1e3 * width,
                    1e3 * expected
                );
                return Err(Stop::new(ExecCause::Missed, reason));
            }
        }
        Ok(())
    }

    /// The fingers of a hand that holds something do not move.
    fn watch_object(&mut self) -> Result<(), Stop> {
        let Some(grasped) = self.report.grasp_width_m else {
            return Ok(());
        };
        let width = self.width();
        let slip = (width - grasped).abs();
        self.report.slip_m = self.report.slip_m.max(slip);
        let closed = width < (self.settings.miss_share * grasped).max(self.settings.miss_width);
        if closed || slip > self.settings.slip_limit {
            let reason = format!(
                "lost the object: the fingers went from {:.1} to {:.1} mm",
                1e3 * grasped,
                1e3 * width
            );
            return Err(Stop::new(ExecCause::Lost, reason));
        }
        Ok(())
    }

    /// After a failure: opens and draws back the way it came, as far as the robot lets it. Errors here change nothing.
    fn recover(&mut self, step: &PlanStep, approach: Option<Followed<'_>>, gone: f64) {
        let followed = |trajectory| Followed { trajectory, offset: self.offset.clone() };
        let back = match (&step.action, step.name) {
            (Action::Move { trajectory, .. }, StepName::ToPregrasp | StepName::Approach | StepName::Home) => {
                // A free motion backs off for a while, a straight one to its beginning.
                let free = (gone - self.settings.back_off_time).max(0.0);
                Some((followed(trajectory), gone, if step.name == StepName::Approach { 0.0 } else { free }))
            }
            (_, StepName::Close) => {
                self.gripper = self.opened;
                if self.grip(self.opened, 0.0).is_err() {
                    return;
                }
                approach.map(|motion| {
                    let end = motion.trajectory.duration;
                    (motion, end, 0.0)
                })
            }
            (Action::Move { trajectory, .. }, StepName::Lower) => Some((followed(trajectory), gone, 0.0)),
            _ => None,
        };
        if let Some((motion, from, to)) = back {
            let _ = self.back(&motion, from, to);
        }
    }
}

/// What the gripper has left to go after `gone` seconds, metres.
fn left(guard: &Guard, trajectory: &Trajectory, gone: f64) -> f64 {
    guard.left.get((gone / trajectory.dt).floor() as usize).copied().unwrap_or(0.0)
}
