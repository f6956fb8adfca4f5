//! Time-optimal timing of a [`SmoothPath`] under velocity and acceleration limits of every joint.
//!
//! Reachability analysis as in TOPP-RA (Pham and Pham 2018): with `x` the square of the path rate and `u` the path
//! acceleration, joint `k` moves with `q'_k sqrt(x)` and accelerates with `q'_k u + q''_k x`. A backward pass finds
//! at each grid point the largest `x` from which one can still stop in time, a forward pass takes the fastest choice.
//! On a piecewise quadratic path `q''` is constant and `q'`, `x` are linear in a cell, so the acceleration is linear as
//! well: a limit that holds at both ends of a cell (each end with the cell's own `q''`) holds everywhere in it. The
//! velocity limit is put on the larger `q'` of the cells that meet. The limits therefore hold at every instant.

use serde::{Deserialize, Serialize};

use super::smooth::SmoothPath;

/// Limits of each joint of a trajectory, in its order.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionLimits {
    /// rad/s or m/s, positive.
    pub velocity: Vec<f64>,
    /// rad/s^2 or m/s^2, positive.
    pub acceleration: Vec<f64>,
}

impl MotionLimits {
    /// The limits times a share of velocity and of acceleration.
    pub fn scaled(&self, velocity: f64, acceleration: f64) -> Self {
        let scale = |v: &[f64], f: f64| v.iter().map(|x| x * f).collect();
        Self {
            velocity: scale(&self.velocity, velocity),
            acceleration: scale(&self.acceleration, acceleration),
        }
    }
}

/// Position and velocity of the joints at one time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrajectoryPoint {
    /// Radians or metres.
    pub q: Vec<f64>,
    /// Per second.
    pub qd: Vec<f64>,
}

/// A timed motion of some joints: points every `dt` from rest to rest, the last one at `duration`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Trajectory {
    /// Indices into the robot's movable joints.
    pub joints: Vec<usize>,
    /// Seconds between points; the last interval may be shorter.
    pub dt: f64,
    /// Seconds.
    pub duration: f64,
    /// At least one point.
    pub points: Vec<TrajectoryPoint>,
}

impl Trajectory {
    /// Stands still at `q`.
    pub fn hold(joints: Vec<usize>, q: Vec<f64>, dt: f64) -> Self {
        let qd = vec![0.0; q.len()];
        Self { joints, dt, duration: 0.0, points: vec![TrajectoryPoint { q, qd }] }
    }

    /// Position and velocity at `t` seconds, held at the ends outside `[0, duration]`. Linear between points.
    pub fn sample(&self, t: f64) -> (Vec<f64>, Vec<f64>) {
        let last = self.points.len() - 1;
        let t = t.clamp(0.0, self.duration);
        let i = ((t / self.dt + 1e-9).floor() as usize).min(last);
        let (a, b) = (&self.points[i], &self.points[(i + 1).min(last)]);
        let begin = self.dt * i as f64;
        let end = (begin + self.dt).min(self.duration);
        let f = if end > begin { ((t - begin) / (end - begin)).clamp(0.0, 1.0) } else { 0.0 };
        let mix = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a + (b - a) * f).collect();
        (mix(&a.q, &b.q), mix(&a.qd, &b.qd))
    }

    /// The same motion with accelerations that build up over `seconds` rather than at once, and as much longer: each point is the mean of
    /// the ones up to it, in which limits of velocity and acceleration hold, as they do in each of them. Jerk is then at most twice the
    /// acceleration by `seconds`. Joints leave the path by at most acceleration x `seconds`^2 / 24: 0.2 mrad for 1.5 rad/s^2 and 50 ms.
    #[must_use]
    pub fn ramped(self, seconds: f64) -> Self {
        let window = (seconds / self.dt).round() as usize;
        if window < 2 || self.points.len() < 2 {
            return self;
        }
        let last = self.points.len() - 1;
        let mean = |end: usize, of: fn(&TrajectoryPoint) -> &[f64]| -> Vec<f64> {
            let from = (end + 1).saturating_sub(window);
            // Before it begins it stands at its first point, after its end at the last one.
            let before = (window - 1).saturating_sub(end) as f64;
            let mut sum: Vec<f64> = of(&self.points[0]).iter().map(|x| before * x).collect();
            for k in from..=end {
                sum.iter_mut().zip(of(&self.points[k.min(last)])).for_each(|(sum, x)| *sum += x);
            }
            sum.iter_mut().for_each(|x| *x /= window as f64);
            sum
        };
        let mut points: Vec<TrajectoryPoint> = (0..last + window - 1)
            .map(|end| TrajectoryPoint { q: mean(end, |p| &p.q), qd: mean(end, |p| &p.qd) })
            .collect();
        points.push(self.points[last].clone());
        let duration = self.dt * (points.len() - 1) as f64;
        Self { points, duration, ..self }
    }

    /// Where it begins.
    pub fn first(&self) -> &[f64] {
        &self.points[0].q
    }

    /// Where it ends.
    pub fn last(&self) -> &[f64] {
        &self.points[self.points.len() - 1].q
    }
}

/// Cells a radian (or metre) of path, and at least so many a piece: the rate changes linearly (in its square) within one.
const CELLS_PER_UNIT: f64 = 100.0;
const MIN_CELLS: usize = 4;
/// How often the cell next to a point of rest is halved.
const REST_HALVINGS: i32 = 7;

/// A grid point's cell: where in which piece it begins, and its length.
struct Cell {
    piece: usize,
    offset: f64,
    length: f64,
}

/// Times `path` from rest to rest as fast as `limits` allow, with points every `dt` seconds.
///
/// `start` is the configuration to hold when the path does not move. `limits` must be positive and as many as joints.
pub fn time_path(
    joints: &[usize],
    start: &[f64],
    path: &SmoothPath,
    limits: &MotionLimits,
    dt: f64,
) -> Trajectory {
    let cells = grid(path);
    if cells.is_empty() {
        return Trajectory::hold(joints.to_vec(), start.to_vec(), dt);
    }
    let rates = path_rates(path, &cells, limits);
    sample_cells(joints, path, &cells, &rates, dt)
}

/// Cuts the pieces into cells, finer and finer towards points of rest, where the rate changes fastest.
fn grid(path: &SmoothPath) -> Vec<Cell> {
    let mut cells = Vec::new();
    let mut from_rest = true;
    for (i, piece) in path.pieces.iter().enumerate() {
        let n = ((piece.length * CELLS_PER_UNIT).ceil() as usize).max(MIN_CELLS);
        let h = piece.length / n as f64;
        let mut ends: Vec<f64> = (0..=n).map(|k| h * k as f64).collect();
        let halvings = (1..=REST_HALVINGS).map(|k| h * 0.5_f64.powi(k));
        if from_rest {
            ends.extend(halvings.clone());
        }
        if piece.stop {
            ends.extend(halvings.map(|x| piece.length - x));
        }
        ends.sort_by(f64::total_cmp);
        cells.extend(ends.windows(2).map(|w| Cell { piece: i, offset: w[0], length: w[1] - w[0] }));
        from_rest = piece.stop;
    }
    cells
}

/// The square of the path rate at the grid points (one more than cells).
fn path_rates(path: &SmoothPath, cells: &[Cell], limits: &MotionLimits) -> Vec<f64> {
    let n = cells.len();
    // Bound of x at every grid point from velocities, rate bounds and stops.
    let mut bound = vec![f64::INFINITY; n + 1];
    bound[0] = 0.0;
    for (i, cell) in cells.iter().enumerate() {
        let piece = &path.pieces[cell.piece];
        let (d0, d1) = (piece.derivative(cell.offset), piece.derivative(cell.offset + cell.length));
        let mut rate = piece.max_rate;
        for (k, v) in limits.velocity.iter().enumerate() {
            let steepest = d0[k].abs().max(d1[k].abs());
            if steepest > 0.0 {
                rate = rate.min(v / steepest);
            }
        }
        let x = rate * rate;
        bound[i] = bound[i].min(x);
        bound[i + 1] = bound[i + 1].min(x);
        let ends_piece = cells.get(i + 1).is_none_or(|next| next.piece != cell.piece);
        if ends_piece && piece.stop {
            bound[i + 1] = 0.0;
        }
    }
    // Backward: the largest x from which the rest can be driven. The feasible pairs (x, next x) are a convex set that
    // holds (0, 0), so the feasible x are an interval from 0 and bisection finds its end.
    let mut top = bound;
    for i in (0..n).rev() {
        let feasible = |x: f64| next_rate(path, &cells[i], limits, x, top[i + 1]).is_some();
        let mut high = top[i];
        if !high.is_finite() {
            // No joint moves here to speak of; any finite bound serves.
            high = 1e6;
        }
        if !feasible(high) {
            let mut low = 0.0;
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if feasible(middle) {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            high = low;
        }
        top[i] = high;
    }
    // Forward: as fast as can be.
    let mut x = vec![0.0; n + 1];
    for i in 0..n {
        x[i + 1] = next_rate(path, &cells[i], limits, x[i], top[i + 1]).unwrap_or(0.0);
    }
    x
}

/// The largest square rate at the end of a cell that begins with `x`, at most `bound`; none if the limits forbid it.
fn next_rate(path: &SmoothPath, cell: &Cell, limits: &MotionLimits, x: f64, bound: f64) -> Option<f64> {
    let piece = &path.pieces[cell.piece];
    let h = 2.0 * cell.length;
    let (mut low, mut high) = (0.0_f64, bound);
    for (k, &a) in limits.acceleration.iter().enumerate() {
        let c = piece.c[k];
        // Begin: |d (y - x) / h + c x| <= a. End: |d' (y - x) / h + c y| <= a. Both are |p y + r| <= a.
        let d0 = piece.d[k] + c * cell.offset;
        let d1 = d0 + c * cell.length;
        for (p, r) in [(d0 / h, c * x - d0 * x / h), (d1 / h + c, -d1 * x / h)] {
            if p.abs() < 1e-12 {
                if r.abs() > a * (1.0 + 1e-9) {
                    return None;
                }
                continue;
            }
            let (e, f) = ((-a - r) / p, (a - r) / p);
            low = low.max(e.min(f));
            high = high.min(e.max(f));
        }
    }
    // The grid's exact ends may miss each other by a rounding.
    (low <= high + 1e-12 * (1.0 + high.abs())).then_some(high.max(0.0))
}

/// Evaluates position and velocity every `dt`.
fn sample_cells(joints: &[usize], path: &SmoothPath, cells: &[Cell], x: &[f64], dt: f64) -> Trajectory {
    let mut points = Vec::new();
    let mut begin = 0.0; // time at the beginning of the cell
    let mut k = 0; // next point to make
    for (i, cell) in cells.iter().enumerate() {
        let piece = &path.pieces[cell.piece];
        let (v0, v1) = (x[i].sqrt(), x[i + 1].sqrt());
        // A cell that cannot be driven would last forever; the passes above exclude it (x > 0 inside a piece).
        let duration = 2.0 * cell.length / (v0 + v1).max(1e-9);
        let u = (x[i + 1] - x[i]) / (2.0 * cell.length);
        while dt * f64::from(k) < begin + duration {
            let t = dt * f64::from(k) - begin;
            let s = (v0 * t + 0.5 * u * t * t).clamp(0.0, cell.length) + cell.offset;
            let rate = (v0 + u * t).max(0.0);
            points.push(TrajectoryPoint {
                q: piece.position(s),
                qd: piece.derivative(s).iter().map(|d| d * rate).collect(),
            });
            k += 1;
        }
        begin += duration;
    }
    let piece = &path.pieces[path.pieces.len() - 1];
    let q = piece.position(piece.length);
    let qd = vec![0.0; q.len()];
    points.push(TrajectoryPoint { q, qd });
    Trajectory { joints: joints.to_vec(), dt, duration: begin, points }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const DT: f64 = 1.0 / 240.0;

    fn limits(v: &[f64], a: &[f64]) -> MotionLimits {
        MotionLimits { velocity: v.to_vec(), acceleration: a.to_vec() }
    }

    fn timed(waypoints: &[Vec<f64>], limits: &MotionLimits) -> Trajectory {
        let path = SmoothPath::round(waypoints, 0.1, &[], |_, _, _| true);
        let joints: Vec<usize> = (0..waypoints[0].len()).collect();
        time_path(&joints, &waypoints[0], &path, limits, DT)
    }

    /// Checks both limits by the points and by finite differences of the positions; returns the tightest ratio.
    fn check(trajectory: &Trajectory, limits: &MotionLimits) -> f64 {
        let mut tightest: f64 = 0.0;
        let p = &trajectory.points;
        let n = p.len();
        for k in 0..limits.velocity.len() {
            let (v, a) = (limits.velocity[k], limits.acceleration[k]);
            for w in p.windows(2) {
                assert!(w[0].qd[k].abs() <= v * (1.0 + 1e-9));
                // The last interval is shorter than dt, hence the regular ones only.
                assert!((w[1].q[k] - w[0].q[k]).abs() <= v * DT * (1.0 + 1e-6) + 1e-12);
                tightest = tightest.max(w[0].qd[k].abs() / v);
            }
            for w in p[..n - 1].windows(3) {
                let second = (w[2].q[k] - 2.0 * w[1].q[k] + w[0].q[k]) / (DT * DT);
                assert!(second.abs() <= a * (1.0 + 1e-6) + 1e-6, "joint {k} {second} > {a}");
                let change = (w[1].qd[k] - w[0].qd[k]) / DT;
                assert!(change.abs() <= a * (1.0 + 1e-6) + 1e-6);
                tightest = tightest.max(second.abs() / a);
            }
        }
        tightest
    }

    #[test]
    fn a_straight_motion_is_the_closed_form_trapezoid_or_triangle() {
        for (distance, v, a) in [(2.0, 1.0, 1.5), (0.1, 1.0, 1.5), (0.4, 0.1, 0.5)] {
            let l = limits(&[v, 10.0], &[a, 10.0]);
            let t = timed(&[vec![0.0, 0.0], vec![distance, 0.0]], &l);
            let exact =
                if distance > v * v / a { distance / v + v / a } else { 2.0 * f64::sqrt(distance / a) };
            // The grid costs one cell's rounding of the ramp.
            assert!((t.duration - exact).abs() < 0.01 * exact, "{} {exact}", t.duration);
            assert!(t.duration >= exact - 1e-9);
            check(&t, &l);
            // A quarter of the way up the ramp the position is a t^2 / 2.
            let quarter = 0.1 * exact.min(v / a);
            let (q, qd) = t.sample(quarter);
            assert!((q[0] - 0.5 * a * quarter * quarter).abs() < 2e-5);
            assert!((qd[0] - a * quarter).abs() < 1e-3);
        }
    }

    #[test]
    fn ends_exactly_at_rest_on_the_goal() {
        let l = limits(&[1.0, 1.0], &[1.0, 2.0]);
        let t = timed(&[vec![0.0, 0.3], vec![0.5, 0.1], vec![0.4, 0.9]], &l);
        let (q, qd) = t.sample(t.duration + 1.0);
        assert!((q[0] - 0.4).abs() < 1e-12 && (q[1] - 0.9).abs() < 1e-12);
        assert_eq!(qd, [0.0, 0.0]);
        assert_eq!(t.sample(0.0).0, [0.0, 0.3]);
    }

    #[test]
    fn a_rate_bound_slows_a_segment_down() {
        let l = limits(&[1.0], &[2.0]);
        let path = SmoothPath::round(&[vec![0.0], vec![0.2]], 0.1, &[0.05], |_, _, _| true);
        let t = time_path(&[0], &[0.0], &path, &l, DT);
        assert!(t.points.iter().all(|p| p.qd[0] <= 0.05 + 1e-12));
        assert!((t.duration - (0.2 / 0.05 + 0.05 / 2.0)).abs() < 0.05);
    }

    #[test]
    fn a_ramp_bounds_the_jerk_and_hardly_leaves_the_path() {
        let l = limits(&[1.0, 0.8], &[1.5, 2.0]);
        let sharp = timed(&[vec![0.0, 0.3], vec![0.5, 0.1], vec![0.4, 0.9]], &l);
        let ramp = 0.05;
        let t = sharp.clone().ramped(ramp);
        check(&t, &l);
        assert_eq!((t.first(), t.last()), (sharp.first(), sharp.last()));
        assert!((t.duration - sharp.duration - ramp).abs() < 2.0 * DT, "{} {}", t.duration, sharp.duration);
        for k in 0..2 {
            let away = (0..=(t.duration / 1e-3) as usize).map(|ms| t.sample(1e-3 * ms as f64).0[k]);
            let near = |q: f64| {
                let there =
                    (0..=(sharp.duration / 1e-3) as usize).map(|ms| sharp.sample(1e-3 * ms as f64).0[k]);
                there.map(|other| (other - q).abs()).fold(f64::INFINITY, f64::min)
            };
            assert!(
                away.step_by(20).map(near).fold(0.0, f64::max)
                    < l.acceleration[k] * ramp * ramp / 24.0 + 5e-4
            );
            for w in t.points.windows(4) {
                let jerk = (w[3].q[k] - 3.0 * w[2].q[k] + 3.0 * w[1].q[k] - w[0].q[k]) / DT.powi(3);
                assert!(jerk.abs() <= 2.0 * l.acceleration[k] / ramp * 1.01, "{jerk}");
            }
        }
        assert_eq!(sharp.clone().ramped(0.0), sharp);
    }

    #[test]
    fn a_path_without_motion_holds() {
        let q = vec![0.1, 0.2];
        let t = timed(&[q.clone(), q.clone()], &limits(&[1.0, 1.0], &[1.0, 1.0]));
        assert_eq!(t.duration, 0.0);
        assert_eq!(t.sample(3.0).0, q);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn limits_hold_at_every_instant(
            waypoints in prop::collection::vec(prop::collection::vec(-1.5..1.5f64, 4), 2..7),
            v in prop::collection::vec(0.1..2.0f64, 4),
            a in prop::collection::vec(0.3..3.0f64, 4),
        ) {
            let l = limits(&v, &a);
            let t = timed(&waypoints, &l);
            let tightest = check(&t, &l);
            // Time-optimal: some limit is reached somewhere.
            prop_assert!(tightest > 0.98, "{tightest}");
            for (a, b) in t.last().iter().zip(&waypoints[waypoints.len() - 1]) {
                prop_assert!((a - b).abs() < 1e-9);
            }
        }
    }
}
