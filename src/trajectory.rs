//! Trajectories as files: JSON of our own, and ROS 2's `trajectory_msgs/msg/JointTrajectory` as YAML.

use std::fmt::Write as _;

use grip_manip::Trajectory;
use grip_sim::robot::RobotModel;
use schemars::JsonSchema;
use serde::Serialize;

/// Version of the JSON file.
pub const SCHEMA: &str = "grip.trajectory/1";

/// A timed motion from rest to rest.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct TrajectoryFile {
    schema: &'static str,
    /// What it solves.
    pub name: String,
    /// The robot's name in its URDF.
    pub robot: String,
    /// The robot's first link, which stands still.
    pub base: String,
    /// The joints that move, by their names in the URDF.
    pub joints: Vec<String>,
    /// Seconds.
    pub duration_s: f64,
    /// In the order of time: the start at 0 seconds, the goal at the end. There is at least one.
    pub points: Vec<Point>,
}

/// The joints at a time, in their order; radians and metres.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Point {
    /// Seconds from the start.
    pub time_s: f64,
    /// Radians or metres.
    pub positions: Vec<f64>,
    /// Per second.
    pub velocities: Vec<f64>,
    /// Per second squared: differences of the velocities before and after.
    pub accelerations: Vec<f64>,
}

impl TrajectoryFile {
    /// `trajectory` of `robot`, which solves what is called `name`.
    pub fn new(name: &str, robot: &RobotModel, trajectory: &Trajectory) -> Self {
        let last = trajectory.points.len() - 1;
        let time = |i: usize| if i == last { trajectory.duration } else { trajectory.dt * i as f64 };
        let points = trajectory.points.iter().enumerate().map(|(i, point)| {
            let [before, after] = [i.saturating_sub(1), (i + 1).min(last)];
            let seconds = time(after) - time(before);
            let [from, to] = [before, after].map(|k| &trajectory.points[k].qd);
            let change = |(from, to): (&f64, &f64)| if seconds > 0.0 { (to - from) / seconds } else { 0.0 };
            Point {
                time_s: time(i),
                positions: point.q.clone(),
                velocities: point.qd.clone(),
                accelerations: from.iter().zip(to).map(change).collect(),
            }
        });
        Self {
            schema: SCHEMA,
            name: name.to_owned(),
            robot: robot.name().to_owned(),
            base: robot.links()[0].name.clone(),
            joints: trajectory.joints.iter().map(|&joint| robot.joints()[joint].name.clone()).collect(),
            duration_s: trajectory.duration,
            points: points.collect(),
        }
    }

    /// The message as `ros2 topic echo` prints it, to be sent by `ros2 topic pub`.
    pub fn to_ros_yaml(&self) -> String {
        let mut text = String::from("header:\n  stamp:\n    sec: 0\n    nanosec: 0\n");
        // Writing to a String cannot fail. JSON's strings are YAML's as well.
        let quoted = |name: &str| serde_json::Value::from(name).to_string();
        let _ = writeln!(text, "  frame_id: {}\njoint_names:", quoted(&self.base));
        for joint in &self.joints {
            let _ = writeln!(text, "- {}", quoted(joint));
        }
        text.push_str("points:\n");
        for point in &self.points {
            let rows = [
                ("positions", &point.positions),
                ("velocities", &point.velocities),
                ("accelerations", &point.accelerations),
            ];
            for (i, (field, values)) in rows.into_iter().enumerate() {
                let _ = writeln!(text, "{} {field}:", if i == 0 { "-" } else { " " });
                for value in values {
                    // Digits and no exponent, which YAML's readers do not agree about; adding zero takes the sign from a minus zero.
                    let rounded = (value * 1e9).round() / 1e9 + 0.0;
                    let _ = writeln!(text, "  - {rounded:.9}");
                }
            }
            let nanoseconds = (point.time_s * 1e9).round() as u64;
            let (sec, nanosec) = (nanoseconds / 1_000_000_000, nanoseconds % 1_000_000_000);
            let _ =
                writeln!(text, "  effort: []\n  time_from_start:\n    sec: {sec}\n    nanosec: {nanosec}");
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use grip_manip::motion::TrajectoryPoint;

    #[test]
    fn accelerations_are_those_of_a_parabola() {
        let robot = RobotModel::load(std::path::Path::new("robots/fetch/fetch.urdf"), &[]).unwrap();
        // q = t^2 every 0.1 s, the last interval shorter.
        let times = [0.0, 0.1, 0.2, 0.25];
        let points = times.map(|t| TrajectoryPoint { q: vec![t * t, -1.0], qd: vec![2.0 * t, 0.0] });
        let trajectory = Trajectory { joints: vec![0, 1], dt: 0.1, duration: 0.25, points: points.to_vec() };
        let file = TrajectoryFile::new("a", &robot, &trajectory);
        assert_eq!(file.points.iter().map(|p| p.time_s).collect::<Vec<_>>(), times);
        assert!(
            file.points.iter().all(|p| (p.accelerations[0] - 2.0).abs() < 1e-9 && p.accelerations[1] == 0.0)
        );
        assert_eq!(file.joints, [robot.joints()[0].name.clone(), robot.joints()[1].name.clone()]);
        let text = file.to_ros_yaml();
        assert!(text.contains("  time_from_start:\n    sec: 0\n    nanosec: 250000000\n"), "{text}");
        assert!(text.contains("- positions:\n  - 0.062500000\n  - -1.000000000\n  velocities:"), "{text}");
        let still = Trajectory::hold(vec![0], vec![0.2], 0.1);
        assert_eq!(TrajectoryFile::new("b", &robot, &still).points[0].accelerations, [0.0]);
    }
}
