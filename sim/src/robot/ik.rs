//! Inverse kinematics: Levenberg-Marquardt within joint limits.
//!
//! Damping after Sugihara, "Solvability-Unconcerned Inverse Kinematics by the Levenberg-Marquardt Method", IEEE T-RO
//! 27(5), 2011: the damping is the squared error itself plus a small constant, so that the step is careful far away and
//! at unreachable targets, and nearly Gauss-Newton close to a solution. Two departures: a joint that stands at its limit
//! and would be pushed through is taken out of the step (active set) instead of being clamped afterwards, and a
//! redundant arm is pulled towards the middle of its ranges in the null space, the less the closer it is to the target.

use nalgebra::{Cholesky, Isometry3, Matrix6, Vector3, Vector6};

use super::{JointKind, RobotModel};

/// Constant part of the damping: large enough for a straight arm (singular), small enough to keep convergence fast.
const DAMPING: f64 = 1e-5;
/// Longest step of a joint in one iteration, radians or metres: beyond it the linear model means nothing.
const MAX_STEP: f64 = 0.6;
/// Share of the way to mid-range that the null-space pull takes in an iteration, at an error of 1 m or 1 rad.
const CENTERING: f64 = 0.05;

/// What to solve.
#[derive(Debug, Clone, Copy)]
pub struct IkRequest<'a> {
    /// The link to be placed.
    pub link: usize,
    /// Where its frame shall be, in the root link's frame.
    pub target: Isometry3<f64>,
    /// The joints that may move, indices into `q`. Those that do not move the link are left alone.
    pub joints: &'a [usize],
    /// A whole configuration to start from; joints not in `joints` keep its values, the others are first brought
    /// within their limits.
    pub seed: &'a [f64],
    /// Largest distance from the target that counts as reached, metres.
    pub position_tol: f64,
    /// Largest angle from the target that counts as reached, radians.
    pub rotation_tol: f64,
    /// Most iterations; 50 are plenty from a near seed.
    pub max_iterations: usize,
}

/// What came out, solved or not.
#[derive(Debug, Clone)]
pub struct IkOutcome {
    /// The configuration reached, whole, within limits; continuous joints are within half a turn of the seed.
    pub q: Vec<f64>,
    /// Whether both tolerances are met.
    pub converged: bool,
    /// Iterations made.
    pub iterations: usize,
    /// Distance from the target, metres.
    pub position_error: f64,
    /// Angle from the target, radians.
    pub rotation_error: f64,
}

/// A joint of the group that moves the link.
struct Column {
    joint: usize,
    lower: f64,
    upper: f64,
    /// Middle of the range, where the null-space pull leads; 0 for continuous joints, which are not pulled.
    middle: f64,
    centering: f64,
    /// Velocity of the link per unit of this joint: linear, angular.
    velocity: Vector6<f64>,
    pull: f64,
    step: f64,
    frozen: bool,
}

impl RobotModel {
    /// [`RobotModel::ik`], but only a solution: the whole configuration, or `None`.
    ///
    /// # Panics
    /// When the seed does not have one value a movable joint, or `link` or `joints` are no indices of this robot.
    pub fn solve_ik(&self, request: IkRequest<'_>) -> Option<Vec<f64>> {
        let outcome = self.ik(request);
        outcome.converged.then_some(outcome.q)
    }

    /// Looks for a configuration near the seed that puts a link at a pose. One descent, no restarts: it may end in a
    /// local minimum, and the outcome then says how far it is. Deterministic.
    ///
    /// # Panics
    /// When the seed does not have one value a movable joint, or `link` or `joints` are no indices of this robot.
    pub fn ik(&self, request: IkRequest<'_>) -> IkOutcome {
        self.check_length(request.seed);
        let mut q = request.seed.to_vec();
        for &joint in request.joints {
            q[joint] = self.joints[joint].limits.clamp(q[joint]);
        }
        let chain = self.chain(request.link);
        let mut columns = self.columns(&chain, request.joints);
        // Nothing above the first moving joint changes: fold it into one pose.
        let first = chain
            .iter()
            .position(|&link| self.driving_column(link, &columns).is_some())
            .unwrap_or(chain.len());
        let fixed = chain[..first]
            .iter()
            .fold(Isometry3::identity(), |pose, &link| self.steps[link].follow(&pose, &q));
        let moving: Vec<(usize, Option<usize>)> =
            chain[first..].iter().map(|&link| (link, self.driving_column(link, &columns))).collect();
        let mut poses = vec![Isometry3::identity(); moving.len()];

        let mut outcome = IkOutcome {
            q: q.clone(),
            converged: false,
            iterations: 0,
            position_error: f64::INFINITY,
            rotation_error: f64::INFINITY,
        };
        let mut caution = 1.0;
        let mut last_energy = f64::INFINITY;
        loop {
            let mut pose = fixed;
            for (&(link, _), slot) in moving.iter().zip(&mut poses) {
                pose = self.steps[link].follow(&pose, &q);
                *slot = pose;
            }
            let error = pose_error(&request.target, &pose);
            let (position_error, rotation_error) =
                (error.fixed_rows::<3>(0).norm(), error.fixed_rows::<3>(3).norm());
            let energy = 0.5 * error.norm_squared();
            // Keep the best; the last iterate is the best unless the descent ran past a minimum.
            if energy < best_energy(&outcome) {
                outcome.q.copy_from_slice(&q);
                outcome.position_error = position_error;
                outcome.rotation_error = rotation_error;
            }
            if position_error <= request.position_tol && rotation_error <= request.rotation_tol {
                outcome.converged = true;
                break;
            }
            // A NaN in the target or seed ends here too: nothing compares less than infinity.
            if outcome.iterations >= request.max_iterations || columns.is_empty() || !energy.is_finite() {
                break;
            }
            outcome.iterations += 1;
            caution = if energy < last_energy {
                f64::max(caution * 0.5, 1.0)
            } else {
                f64::min(caution * 4.0, 256.0)
            };
            last_energy = energy;

            for column in &mut columns {
                column.velocity = Vector6::zeros();
                column.frozen = false;
            }
            for (&(link, column), link_pose) in moving.iter().zip(&poses) {
                if let Some(column) = column {
                    let (linear, angular) = self.steps[link].velocity(link_pose, &pose.translation.vector);
                    columns[column].velocity += stack(&linear, &angular);
                }
            }
            let redundant = columns.len() > 6;
            for column in &mut columns {
                let pull = CENTERING * column.centering * energy.min(1.0);
                column.pull = if redundant { pull * (column.middle - q[column.joint]) } else { 0.0 };
            }
            if !step(&mut columns, &error, &q, caution * energy + DAMPING) {
                break;
            }
            let longest = columns.iter().fold(0.0, |max: f64, column| max.max(column.step.abs()));
            let scale = if longest > MAX_STEP { MAX_STEP / longest } else { 1.0 };
            for column in &columns {
                let moved = q[column.joint] + scale * column.step;
                q[column.joint] = moved.max(column.lower).min(column.upper);
            }
        }
        for &joint in request.joints {
            if self.joints[joint].kind == JointKind::Continuous {
                let turns = ((outcome.q[joint] - request.seed[joint]) / std::f64::consts::TAU).round();
                outcome.q[joint] -= turns * std::f64::consts::TAU;
            }
        }
        outcome
    }

    fn columns(&self, chain: &[usize], joints: &[usize]) -> Vec<Column> {
        joints
            .iter()
            .filter(|&&joint| {
                chain
                    .iter()
                    .any(|&link| self.steps[link].motion.drive().is_some_and(|drive| drive.joint == joint))
            })
            .map(|&joint| {
                let limits = self.joints[joint].limits;
                let range = limits.upper - limits.lower;
                let bounded = range.is_finite();
                Column {
                    joint,
                    lower: limits.lower,
                    upper: limits.upper,
                    middle: if bounded { 0.5 * (limits.lower + limits.upper) } else { 0.0 },
                    centering: if bounded { 1.0 } else { 0.0 },
                    velocity: Vector6::zeros(),
                    pull: 0.0,
                    step: 0.0,
                    frozen: false,
                }
            })
            .collect()
    }

    fn driving_column(&self, link: usize, columns: &[Column]) -> Option<usize> {
        let drive = self.steps[link].motion.drive()?;
        columns.iter().position(|column| column.joint == drive.joint)
    }
}

fn best_energy(outcome: &IkOutcome) -> f64 {
    0.5 * (outcome.position_error.powi(2) + outcome.rotation_error.powi(2))
}

/// Fills in `step` of every column: `J^T (J J^T + damping)^-1 (error - J pull) + pull`, joints at a limit that would be
/// pushed through it held still. False when the system cannot be solved.
fn step(columns: &mut [Column], error: &Vector6<f64>, q: &[f64], damping: f64) -> bool {
    loop {
        let mut system = Matrix6::from_diagonal_element(damping);
        let mut rest = *error;
        for column in columns.iter().filter(|column| !column.frozen) {
            system.ger(1.0, &column.velocity, &column.velocity, 1.0);
            rest -= column.velocity * column.pull;
        }
        let Some(system) = Cholesky::new(system) else {
            return false;
        };
        let multipliers = system.solve(&rest);
        let mut newly_frozen = false;
        for column in columns.iter_mut() {
            if column.frozen {
                column.step = 0.0;
                continue;
            }
            column.step = column.velocity.dot(&multipliers) + column.pull;
            let at = q[column.joint];
            if (at <= column.lower && column.step < 0.0) || (at >= column.upper && column.step > 0.0) {
                column.frozen = true;
                column.step = 0.0;
                newly_frozen = true;
            }
        }
        if !newly_frozen {
            return true;
        }
    }
}

/// Twist that carries `pose` to `target`: difference of origins and rotation vector, base frame.
fn pose_error(target: &Isometry3<f64>, pose: &Isometry3<f64>) -> Vector6<f64> {
    stack(
        &(target.translation.vector - pose.translation.vector),
        &(target.rotation * pose.rotation.inverse()).scaled_axis(),
    )
}

fn stack(linear: &Vector3<f64>, angular: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z)
}
