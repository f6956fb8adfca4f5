//! Pointing the head camera.

use nalgebra::{Point3, Vector2};

use super::{RobotConfig, RobotModel};

impl RobotConfig {
    /// The configuration `q` with the head turned so that the point (root link's frame, metres) lies on the camera's
    /// optical axis, or as near to it as the head's limits allow.
    ///
    /// # Panics
    /// When `q` does not have one value a movable joint.
    pub fn look_at(&self, robot: &RobotModel, q: &[f64], point: &Point3<f64>) -> Vec<f64> {
        let mut q = q.to_vec();
        let joints = [self.head.pan, self.head.tilt];
        // First by the geometry of a head at the pan axis, which is good to some degrees; then Newton on the two angles
        // at which the camera sees the point.
        let neck =
            robot.fk_link(&q, robot.joints()[self.head.pan].parent) * robot.joints()[self.head.pan].origin;
        let seen = neck.inverse_transform_point(point);
        q[self.head.pan] = seen.y.atan2(seen.x);
        q[self.head.tilt] = (-seen.z).atan2(seen.x.hypot(seen.y));
        for _ in 0..20 {
            for joint in joints {
                q[joint] = robot.joints()[joint].limits.clamp(q[joint]);
            }
            let camera = robot.fk_link(&q, self.camera.optical_link);
            let p = camera.inverse_transform_point(point);
            let off = Vector2::new(p.x.atan2(p.z), p.y.atan2(p.z));
            if off.norm() < 1e-9 || p.z <= 0.0 {
                break;
            }
            // Pan turns the view about the vertical, tilt about the lateral axis: the derivatives are near -1 and known
            // well enough for Newton to converge linearly within a few steps.
            let tilt_cos = q[self.head.tilt].cos().max(0.2);
            q[self.head.pan] -= off.x / tilt_cos;
            q[self.head.tilt] += off.y;
        }
        for joint in joints {
            q[joint] = robot.joints()[joint].limits.clamp(q[joint]);
        }
        q
    }
}
