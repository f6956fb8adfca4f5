//! Pointing the head camera.

use nalgebra::{Point3, Vector2};

use super::{RobotConfig, RobotModel};

impl RobotConfig {
    /// The configuration `q` with the head turned so that the point (root link's frame, metres) lies on the camera's
    /// optical axis, or as near to it as the head's limits allow. Without a head it is `q`.
    ///
    /// # Panics
    /// When `q` does not have one value a movable joint.
    pub fn look_at(&self, robot: &RobotModel, q: &[f64], point: &Point3<f64>) -> Vec<f64> {
        let mut q = q.to_vec();
        let (Some(head), Some(camera)) = (self.head, self.camera.as_ref()) else { return q };
        let joints = [head.pan, head.tilt];
        // First by the geometry of a head at the pan axis, which is good to some degrees; then Newton on the two angles
        // at which the camera sees the point.
        let neck = robot.fk_link(&q, robot.joints()[head.pan].parent) * robot.joints()[head.pan].origin;
        let seen = neck.inverse_transform_point(point);
        q[head.pan] = seen.y.atan2(seen.x);
        q[head.tilt] = (-seen.z).atan2(seen.x.hypot(seen.y));
        for _ in 0..20 {
            for joint in joints {
                q[joint] = robot.joints()[joint].limits.clamp(q[joint]);
            }
            let base_from_camera = robot.fk_link(&q, camera.optical_link);
            let p = base_from_camera.inverse_transform_point(point);
            let off = Vector2::new(p.x.atan2(p.z), p.y.atan2(p.z));
            if off.norm() < 1e-9 || p.z <= 0.0 {
                break;
            }
            // Pan turns the view about the vertical, tilt about the lateral axis: the derivatives are near -1 and known
            // well enough for Newton to converge linearly within a few steps.
            let tilt_cos = q[head.tilt].cos().max(0.2);
            q[head.pan] -= off.x / tilt_cos;
            q[head.tilt] += off.y;
        }
        for joint in joints {
            q[joint] = robot.joints()[joint].limits.clamp(q[joint]);
        }
        q
    }
}
