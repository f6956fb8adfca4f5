//! A first configuration file of a robot, guessed from its URDF: for a person to check.

use std::fmt::Write as _;

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};
use rand::RngExt;

use super::kinematics::Motion;
use super::{IkRequest, JointKind, RobotModel, pairs};
use crate::rng;
use crate::shape::CollisionShape;

/// Attempts to find a pose with the hand pointing down.
const ATTEMPTS: usize = 400;
/// Highest force of a finger that is guessed, newtons.
const MOST_FORCE: f64 = 100.0;

/// Two fingers that slide apart on one link.
struct Hand {
    /// The link that they slide on.
    link: usize,
    /// The links that they move, right and left: the one on the negative side of the closing axis is right.
    fingers: [usize; 2],
    /// The gripper's frame in the link.
    frame: Isometry3<f64>,
    pad_half_extents: Vector3<f64>,
    pad_centers: [Vector3<f64>; 2],
    opening: f64,
    depth: f64,
}

impl RobotModel {
    /// A first configuration file for this robot, TOML. Guessed are the two fingers (prismatic joints that slide apart on one link), the
    /// arm (all that turns on the way to them) and torso (what lifts), the pads (the solid that reaches farthest out), a pose with the hand
    /// pointing down, and the pairs of links that may touch. What is to be checked stands beside it.
    ///
    /// # Errors
    /// When there are no two such fingers; says what to do.
    pub fn guessed_config(&self) -> Result<String, String> {
        let hand = self.guessed_hand()?;
        let chain = self.chain(hand.link);
        let moving: Vec<usize> =
            chain.iter().filter_map(|&link| self.links[link].parent_joint.as_ref()?.moved_by).collect();
        let turns = |joint: &&usize| self.joints[**joint].kind != JointKind::Prismatic;
        let arm: Vec<usize> = moving.iter().filter(turns).copied().collect();
        if arm.is_empty() {
            return Err("no joint that turns leads to the gripper: is this the URDF of the gripper alone? Attach it to an arm's \
                        ([[attach]], robots/README.md)"
                .into());
        }
        let name = |joint: usize| format!("{:?}", self.joints[joint].name);
        let names = |joints: &[usize]| joints.iter().map(|&joint| name(joint)).collect::<Vec<_>>().join(", ");
        let mut text = format!(
            "# {}: guessed from its URDF. Check all of it against the maker's data, then by `grip robot --check`.\n# Metres, radians, \
             seconds, newtons.\n\n[groups]\narm = [{}]\n",
            self.name,
            names(&arm)
        );
        let mut line = |text_line: String| {
            text.push_str(&text_line);
            text.push('\n');
        };
        if moving.len() > arm.len() {
            line(format!("arm_with_torso = [{}]", names(&moving)));
        }
        let finger_name = |side: usize| {
            let parent = self.links[hand.fingers[side]].parent_joint.as_ref();
            format!("{:?}", parent.map_or("", |joint| joint.name.as_str()))
        };
        line(format!("gripper = [{}, {}] # right, left", finger_name(0), finger_name(1)));
        let (ready, down) = self.guessed_pose(&hand, &moving);
        line(String::new());
        line(
            if down {
                "# The hand points down in front."
            } else {
                "# CHECK: no pose with the hand pointing down was found; the middle of the ranges."
            }
            .to_owned(),
        );
        line("[poses.ready]".into());
        for &joint in &moving {
            line(format!("{} = {:.4}", name(joint), ready[joint]));
        }
        line(
            "\n# CHECK: the URDF's speeds, and accelerations that reach them in half a second.\n[limits]"
                .into(),
        );
        let speed = |limit: f64| if limit.is_finite() && limit > 0.0 { limit } else { 1.0 };
        for &joint in &moving {
            let velocity = speed(self.joints[joint].limits.velocity);
            line(format!("{} = {{ velocity = {velocity}, acceleration = {} }}", name(joint), 2.0 * velocity));
        }
        let limits = hand.fingers.map(|link| self.limits_of(link));
        for (side, limits) in limits.iter().enumerate() {
            let velocity = speed(limits.velocity);
            line(format!("{} = {{ velocity = {velocity}, acceleration = 0.5 }}", finger_name(side)));
        }
        let force = limits.iter().map(|limits| limits.effort).fold(MOST_FORCE, f64::min);
        let [roll, pitch, yaw]: [f64; 3] = hand.frame.rotation.euler_angles().into();
        let at = hand.frame.translation.vector;
        let vector = |v: &Vector3<f64>| format!("[{:.5}, {:.5}, {:.5}]", v.x, v.y, v.z);
        line(format!(
            "\n[gripper]\nlink = {:?}\n# The gripper's frame in it: origin between the pads, x out along the fingers, y along the closing \
             direction.\nframe = {{ xyz = {}, rpy = [{roll:.7}, {pitch:.7}, {yaw:.7}] }}\n# CHECK: the solid of a finger that reaches \
             farthest out.\npad_half_extents = {}\npad_centers = [{}, {}]\nopening = {:.4}\n# CHECK: from the palm's front to the tips.\n\
             finger_depth = {:.4}\n# CHECK: the maker's closing force.\nmax_force = {force}",
            self.links[hand.link].name,
            vector(&at),
            vector(&hand.pad_half_extents),
            vector(&hand.pad_centers[0]),
            vector(&hand.pad_centers[1]),
            hand.opening,
            hand.depth,
        ));
        line(String::new());
        line(self.sampled_pairs_toml());
        Ok(text)
    }

    /// `[self_collision]` with the pairs that sampling finds, TOML.
    pub fn sampled_pairs_toml(&self) -> String {
        let mut text = format!(
            "# By {} samples; links next to each other in the tree need not be named.\n[self_collision]\nallowed = [\n",
            pairs::SAMPLES
        );
        for pair in pairs::sampled(self) {
            let (a, b) = pair.links;
            let _ =
                writeln!(text, "    [{:?}, {:?}], # {}", self.links[a].name, self.links[b].name, pair.reason);
        }
        text + "]"
    }

    /// Of the joint, a follower too, that moves a link.
    fn limits_of(&self, link: usize) -> super::JointLimits {
        let follower = self.followers.iter().find(|follower| follower.link == link).map(|own| own.limits);
        let own = self.joints.iter().find(|joint| joint.child == link).map(|joint| joint.limits);
        let none = super::JointLimits { lower: 0.0, upper: 0.0, velocity: 0.0, effort: 0.0 };
        follower.or(own).unwrap_or(none)
    }

    fn guessed_hand(&self) -> Result<Hand, String> {
        let sliding: Vec<usize> = (0..self.links.len())
            .filter(|&link| matches!(self.steps[link].motion, Motion::Slide(_)))
            .filter(|&link| !self.solids_below(link).is_empty())
            .collect();
        let axis = |link: usize| self.steps[link].origin.rotation * self.steps[link].axis;
        let pair = sliding.iter().enumerate().find_map(|(i, &a)| {
            let apart = |b: &&usize| {
                self.steps[**b].parent == self.steps[a].parent && axis(a).dot(&axis(**b)) < -0.99
            };
            Some([a, *sliding[i + 1..].iter().find(apart)?])
        });
        let [a, b] = pair.ok_or_else(|| {
            format!(
                "no two prismatic joints slide apart on one link, as the fingers of a parallel gripper do; {} does. Fingers on a linkage \
                 are not driven by this program: attach a URDF in which they slide ([[attach]], robots/README.md)",
                match sliding.len() {
                    0 => "no joint slides that moves a solid, or none".to_owned(),
                    n => format!("{n} joints slide, but no pair"),
                }
            )
        })?;
        let link = self.steps[a].parent;
        // From right to left is +y: the left finger opens along it.
        let closing = axis(b).normalize();
        let [right, left] = [a, b];
        let inside = |finger: usize| -> Vec<Point3<f64>> {
            let at = self.steps[finger].origin;
            self.solids_below(finger).iter().flat_map(CollisionShape::corners).map(|p| at * p).collect()
        };
        let all: Vec<Point3<f64>> = [right, left].into_iter().flat_map(inside).collect();
        let middle = all.iter().fold(Vector3::zeros(), |sum, p| sum + p.coords) / all.len().max(1) as f64;
        let out = middle - closing * middle.dot(&closing);
        // Along the axis of the link that it is nearest to: hands are drawn along one.
        let out = [Vector3::x(), Vector3::y(), Vector3::z()]
            .into_iter()
            .flat_map(|axis| [axis, -axis])
            .filter(|axis| axis.dot(&closing).abs() < 0.1)
            .max_by(|a, b| a.dot(&out).total_cmp(&b.dot(&out)))
            .unwrap_or_else(Vector3::x);
        let side = out.cross(&closing);
        let axes = Matrix3::from_columns(&[out, closing, side]);
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
        // The pad is the solid that reaches farthest out, as a box along its finger's axes.
        let pad = |finger: usize| {
            let at = self.steps[finger].origin;
            let reach = |shape: &CollisionShape| {
                shape.corners().iter().map(|p| (at * p).coords.dot(&out)).fold(f64::NEG_INFINITY, f64::max)
            };
            let solids = self.solids_below(finger);
            let tip = solids.iter().max_by(|a, b| reach(a).total_cmp(&reach(b)));
            let points = tip.map(CollisionShape::corners).unwrap_or_default();
            let low = points.iter().fold(Vector3::repeat(f64::INFINITY), |low, p| low.inf(&p.coords));
            let high = points.iter().fold(Vector3::repeat(f64::NEG_INFINITY), |high, p| high.sup(&p.coords));
            (0.5 * (low + high), 0.5 * (high - low))
        };
        let [(right_center, half), (left_center, _)] = [pad(right), pad(left)];
        let place = |finger: usize, center: &Vector3<f64>| self.steps[finger].origin * Point3::from(*center);
        let (p, q) = (place(right, &right_center), place(left, &left_center));
        let origin = nalgebra::center(&p, &q).coords;
        let frame = Isometry3::from_parts(origin.into(), rotation);
        let upper = [right, left].map(|finger| self.limits_of(finger).upper);
        let thick = (self.steps[left].origin.rotation.inverse() * closing).abs().dot(&half);
        let opening = (q - p).dot(&closing) - 2.0 * thick + upper[0] + upper[1];
        let tip = all.iter().map(|p| p.coords.dot(&out)).fold(f64::NEG_INFINITY, f64::max);
        let palm = self.links[link]
            .collisions
            .iter()
            .flat_map(CollisionShape::corners)
            .map(|p| p.coords.dot(&out))
            .fold(f64::NEG_INFINITY, f64::max);
        let base = all.iter().map(|p| p.coords.dot(&out)).fold(f64::INFINITY, f64::min);
        let depth = tip - if palm.is_finite() && palm < tip { palm } else { base };
        Ok(Hand {
            link,
            fingers: [right, left],
            frame,
            pad_half_extents: half,
            pad_centers: [right_center, left_center],
            opening,
            depth,
        })
    }

    /// The solids of a link and of all that is fixed to it, in its frame.
    fn solids_below(&self, link: usize) -> Vec<CollisionShape> {
        let mut place = vec![None; self.links.len()];
        place[link] = Some(Isometry3::identity());
        let mut solids = Vec::new();
        for index in link..self.links.len() {
            if index > link {
                let step = &self.steps[index];
                if let (Some(parent), Motion::Fixed) = (place[step.parent], step.motion) {
                    place[index] = Some(parent * step.origin);
                }
            }
            if let Some(at) = place[index] {
                solids.extend(self.links[index].collisions.iter().cloned().map(|mut shape| {
                    shape.pose = at * shape.pose;
                    shape
                }));
            }
        }
        solids
    }

    /// A configuration with the hand pointing down, as high over its base and as near to the middle of its range as may be; else the
    /// middle. And whether it was found.
    fn guessed_pose(&self, hand: &Hand, moving: &[usize]) -> (Vec<f64>, bool) {
        let middle: Vec<f64> = self
            .joints
            .iter()
            .map(|joint| {
                let middle = 0.5 * (joint.limits.lower + joint.limits.upper);
                if middle.is_finite() { middle } else { 0.0 }
            })
            .collect();
        let reach: f64 =
            self.chain(hand.link).iter().map(|&link| self.steps[link].origin.translation.vector.norm()).sum();
        let mut random = rng::stream(0, "a pose with the hand pointing down");
        let down = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(
            Matrix3::from_columns(&[-Vector3::z(), Vector3::y(), Vector3::x()]),
        ));
        let mut best: Option<(f64, Vec<f64>)> = None;
        for _ in 0..ATTEMPTS {
            let mut draw = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
            let at = Vector3::new(draw(0.25, 0.5) * reach, 0.0, draw(0.15, 0.5) * reach);
            let seed: Vec<f64> = self
                .joints
                .iter()
                .map(|joint| draw(joint.limits.lower.max(-3.1), joint.limits.upper.min(3.1)))
                .collect();
            let gripper = Isometry3::from_parts(at.into(), down);
            let found = self.solve_ik(IkRequest {
                link: hand.link,
                target: gripper * hand.frame.inverse(),
                joints: moving,
                seed: &seed,
                position_tol: 1e-3,
                rotation_tol: 1e-2,
                max_iterations: 60,
            });
            let Some(q) = found else { continue };
            // The nearer to the middle of every range, the better.
            let off = |joint: &usize| {
                let limits = self.joints[*joint].limits;
                let range = limits.upper - limits.lower;
                if range.is_finite() {
                    ((q[*joint] - middle[*joint]) / range).powi(2)
                } else {
                    (q[*joint] / 7.0).powi(2)
                }
            };
            let cost: f64 = moving.iter().map(off).sum();
            if best.as_ref().is_none_or(|(least, _)| cost < *least) && !self.touches_itself(&q) {
                best = Some((cost, q));
            }
        }
        match best {
            Some((_, q)) => (q, true),
            None => (middle, false),
        }
    }

    /// Whether links touch that are not next to each other in the tree.
    fn touches_itself(&self, q: &[f64]) -> bool {
        let poses = self.fk(q);
        pairs::touching(self, &poses).is_some()
    }
}
