//! Settings of the planner.

use crate::collision::Margins;
use crate::grasp::GraspSettings;
use crate::place::PlaceSettings;
use crate::rrt::RrtSettings;

/// Settings of [`crate::Planner`].
#[derive(Debug, Clone, PartialEq)]
pub struct PlannerSettings {
    /// Choice of grasps.
    pub grasp: GraspSettings,
    /// Choice of places.
    pub place: PlaceSettings,
    /// Search in joint space.
    pub rrt: RrtSettings,
    /// Margins of free motion. Default 10 mm to the world, so that checks 20 mm apart leave no gap; 5 mm between links.
    pub free: Margins,
    /// Margins of straight motion at objects. Default 2 mm.
    pub near: Margins,
    /// Straight lifts tried, metres, best first. Default 0.20, 0.15, 0.25, 0.10.
    pub lifts: Vec<f64>,
    /// How far a lift leans to one side where none straight up is free, radians. Default 0.5.
    pub lift_lean: f64,
    /// Room between the object and the top of the bin's walls when it is carried in, metres. Default 0.03.
    pub over_walls: f64,
    /// Straight way back from a placed object, metres. Default 0.10.
    pub retreat: f64,
    /// How much wider than the object the gripper opens to let go, metres, both sides together. Default 0.030.
    pub release: f64,
    /// Speed of the gripper when it may touch something, m/s. Default 0.08.
    pub guarded_speed: f64,
    /// Speed of the gripper in other straight motions, m/s. Default 0.25.
    pub straight_speed: f64,
    /// Shares of the joints' velocity and acceleration limits that are used. Default 0.9 and 0.8.
    pub effort: [f64; 2],
    /// Share of those while an object is held. Default 0.8.
    pub holding: f64,
    /// Contact force that stops a guarded motion, newtons. Default 20.
    pub guard_force: f64,
    /// Largest distance of a rounded corner from the path, norm of joint values. Default 0.15.
    pub corner: f64,
    /// Seconds between trajectory points. Default 1/240, the control period.
    pub dt: f64,
    /// Seeds from the table for each inverse kinematics problem. Default 8.
    pub ik_seeds: usize,
    /// Grasps that are tried, and places for each of them that the hand fits in. Default 24 and 16.
    pub tries: [usize; 2],
    /// Objects whose lower side is within this of the table's height are believed to stand on it, metres. Default 0.015.
    pub snap: f64,
}

impl Default for PlannerSettings {
    fn default() -> Self {
        Self {
            grasp: GraspSettings::default(),
            place: PlaceSettings::default(),
            rrt: RrtSettings { max_iterations: 1500, ..RrtSettings::default() },
            free: Margins { world: 0.010, own: 0.005, spread: 0.5 },
            near: Margins { world: 0.002, own: 0.003, spread: 0.0 },
            lifts: vec![0.20, 0.15, 0.25, 0.10],
            lift_lean: 0.5,
            over_walls: 0.03,
            retreat: 0.10,
            release: 0.030,
            guarded_speed: 0.08,
            straight_speed: 0.25,
            effort: [0.9, 0.8],
            holding: 0.8,
            guard_force: 20.0,
            corner: 0.15,
            dt: 1.0 / 240.0,
            ik_seeds: 8,
            tries: [24, 16],
            snap: 0.015,
        }
    }
}
