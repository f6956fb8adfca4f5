//! The state machine on a robot with one joint.

use super::run::run;
use super::*;
use crate::motion::TrajectoryPoint;
use crate::plan::{GripperCommand, Guard};
use nalgebra::Vector3;

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
    /// The hand feels 30 N beyond this position, and below that one.
    wall: f64,
    floor: f64,
    /// Time of a protective stop, which passes.
    stop_at: f64,
    /// Highest speed commanded while the gripper is closed, and ever.
    fastest: f64,
    fastest_ever: f64,
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
            floor: f64::NEG_INFINITY,
            stop_at: f64::INFINITY,
            fastest: 0.0,
            fastest_ever: 0.0,
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
    fn hand_force(&self) -> Vector3<f64> {
        let weight = if self.fingers <= 0.5 * self.object { 15.0 } else { 0.0 };
        let wall = if self.q > self.wall || self.q < self.floor { 30.0 } else { 0.0 };
        // What carries a load pushes against its weight.
        Vector3::z() * (wall - weight)
    }
    fn link_force(&self) -> f64 {
        0.5
    }
    fn step(&mut self, target: &ControlTarget<'_>) -> Result<(), ProtectiveStop> {
        self.time += self.period();
        if self.time > self.stop_at && self.time < self.stop_at + 0.02 {
            return Err(ProtectiveStop { reason: "too much torque".into() });
        }
        let speed = (target.joints[0] - self.q).abs() / self.period();
        self.fastest_ever = self.fastest_ever.max(speed);
        if let GripperCommand::Close { .. } = self.command {
            self.fastest = self.fastest.max(speed);
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
    let go = |name, from, to, guarded: bool, holding| {
        let trajectory = line(from, to, 1.0);
        let left = trajectory.points.iter().map(|point| (to - point.q[0]).abs()).collect();
        let guard = guarded.then_some(Guard { force_n: 20.0, near: 0.02, left });
        PlanStep { name, action: Action::Move { trajectory, guard, holding } }
    };
    let grip = |name, command, width| PlanStep { name, action: Action::Gripper { command, width } };
    vec![
        grip(StepName::Open, GripperCommand::Open { width: 0.10 }, 0.10),
        go(StepName::ToPregrasp, 0.0, 0.5, false, false),
        go(StepName::Approach, 0.5, 0.6, true, false),
        grip(StepName::Close, GripperCommand::Close { force_n: 30.0 }, 0.06),
        go(StepName::Lift, 0.6, 0.4, false, true),
        go(StepName::Carry, 0.4, -0.4, false, true),
        go(StepName::Lower, -0.4, -0.5, true, true),
        grip(StepName::Release, GripperCommand::Open { width: 0.09 }, 0.09),
        go(StepName::Retreat, -0.5, -0.4, false, false),
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
    let report = go(&mut port);
    let (stage, cause, reason) = report.failure().unwrap();
    assert_eq!((stage, cause), (ExecStage::Grasp, ExecCause::Missed));
    assert!(reason.contains("missed"), "{reason}");
    assert!((port.q - 0.5).abs() < 1e-6 && port.fingers > 0.049);
}

#[test]
fn an_early_contact_fails_the_approach_and_a_late_one_grasps_there() {
    let mut port = Fake::new(0.06);
    port.wall = 0.53;
    let report = go(&mut port);
    let (stage, cause, reason) = report.failure().unwrap();
    assert_eq!((stage, cause), (ExecStage::Approach, ExecCause::Contact));
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
    let report = go(&mut port);
    let (_, cause, reason) = report.failure().unwrap();
    assert!(cause == ExecCause::Astray && reason.contains("not where"), "{reason}");
    assert!((port.q - 1.0).abs() < 1e-12);
}

#[test]
fn an_object_lost_on_the_way_is_noticed_by_the_fingers() {
    let mut port = Fake::new(0.06);
    port.lost_at = 3.0;
    let report = go(&mut port);
    let (stage, cause, reason) = report.failure().unwrap();
    assert!(matches!(stage, ExecStage::Lift | ExecStage::Carry), "{stage:?}");
    assert!(cause == ExecCause::Lost && reason.contains("lost"), "{reason}");
}

#[test]
fn a_protective_stop_ends_the_execution_with_its_reason() {
    let mut port = Fake::new(0.06);
    port.stop_at = 1.4;
    let report = go(&mut port);
    let (stage, cause, reason) = report.failure().unwrap();
    assert_eq!((stage, cause), (ExecStage::Approach, ExecCause::Contact));
    assert!(reason.contains("too much torque"), "{reason}");
}

#[test]
fn what_meets_something_on_the_way_down_is_let_go_there_and_the_hand_goes_back_up() {
    let mut port = Fake::new(0.06);
    port.floor = -0.46;
    let report = go(&mut port);
    assert_eq!(report.failure(), None);
    let lower = &report.steps[6];
    assert!(lower.name == StepName::Lower && lower.stopped_early);
    // Where the lowering began, and not a retreat from where it would have ended.
    assert!((port.q + 0.4).abs() < 1e-6, "{}", port.q);
    // Close to the goal it is the goal.
    let mut port = Fake::new(0.06);
    port.floor = -0.49;
    let report = go(&mut port);
    assert!(report.steps[6].stopped_early && report.failure().is_none());
    assert!((port.q + 0.4).abs() < 1e-6);
}

/// The way back once began on the planned path, although the motion had begun beside it: the arm jumped there.
#[test]
fn a_motion_that_began_beside_its_path_goes_back_to_where_it_began() {
    let mut port = Fake::new(0.06);
    (port.q, port.wall) = (0.2, 0.35);
    let settings = ExecutorSettings { free_force: 20.0, ..ExecutorSettings::default() };
    let report = execute_motion(&mut port, &line(0.0, 0.5, 1.0), &settings, &mut ());
    assert_eq!(report.failure().map(|f| f.1), Some(ExecCause::Contact));
    assert!((port.q - 0.2).abs() < 1e-9, "{}", port.q);
    assert!(port.fastest_ever < 1.0, "{}: no jump", port.fastest_ever);
}

#[test]
fn what_is_let_go_high_is_left_the_way_it_came_even_from_beside_the_path() {
    let mut port = Fake::new(0.06);
    (port.q, port.floor) = (-0.35, -0.46);
    let report = execute_steps(&mut port, &steps()[6..], &ExecutorSettings::default(), &mut ());
    assert_eq!(report.failure(), None);
    assert!(report.steps[0].stopped_early);
    assert!((port.q + 0.35).abs() < 1e-9, "{}", port.q);
    assert!(port.fastest_ever < 0.5, "{}: no jump", port.fastest_ever);
}

/// Counts the control periods of each step.
#[derive(Default)]
struct Periods(Vec<StepName>);

impl Observer for Periods {
    fn tick(&mut self, step: StepName, _time: f64) {
        self.0.push(step);
    }
}

#[test]
fn a_release_in_place_opens_a_little_and_leaves_the_arm_where_it_is() {
    let mut port = Fake::new(0.06);
    (port.q, port.fingers) = (0.3, 0.03);
    port.command = GripperCommand::Close { force_n: 30.0 };
    let mut seen = Periods::default();
    let report = release_in_place(&mut port, &ExecutorSettings::default(), &mut seen);
    assert_eq!(report.failure(), None);
    assert_eq!(seen.0, [StepName::Release; 192], "0.8 s of 240 Hz");
    assert!((port.time - 0.8).abs() < 1e-9 && (report.seconds() - 0.8).abs() < 1e-9);
    assert_eq!(port.q, 0.3);
    assert!((2.0 * port.fingers - 0.09).abs() < 1e-6, "{}", port.fingers);
}

#[test]
fn a_release_in_place_goes_on_after_a_protective_stop_and_tells_of_it() {
    let mut port = Fake::new(0.06);
    port.fingers = 0.03;
    port.stop_at = 0.1;
    let report = release_in_place(&mut port, &ExecutorSettings::default(), &mut ());
    let (stage, cause, reason) = report.failure().unwrap();
    assert_eq!((stage, cause), (ExecStage::Place, ExecCause::Contact));
    assert!(reason.contains("too much torque"), "{reason}");
    assert!((port.time - 0.8).abs() < 1e-9 && 2.0 * port.fingers > 0.089);
}
