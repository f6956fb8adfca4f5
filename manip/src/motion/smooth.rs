//! A piecewise linear joint path with its corners rounded by parabolas.
//!
//! At a waypoint with the directions `u` before and `w` after, the path leaves the straight line `l` before the
//! corner and is back on it `l` behind: a quadratic Bezier curve whose derivative goes linearly from `u` to `w`. The
//! whole path is then C1 and piecewise quadratic, `q(s) = q0 + d (s - s0) + c (s - s0)^2 / 2`, which makes the limits
//! of [`super::time_path`] exact rather than sampled. It strays `|w - u| l / 4` from the corner at most. Where a corner
//! cannot be rounded (`l = 0`) the motion stops on it.

/// One quadratic stretch of a [`SmoothPath`].
#[derive(Debug, Clone)]
pub struct PathPiece {
    /// Path parameter at its beginning.
    pub start: f64,
    /// Length in the path parameter.
    pub length: f64,
    /// Position at its beginning.
    pub q: Vec<f64>,
    /// First derivative by the path parameter at its beginning.
    pub d: Vec<f64>,
    /// Second derivative, constant.
    pub c: Vec<f64>,
    /// Upper bound of the rate of the path parameter, 1/s (infinite when there is none).
    pub max_rate: f64,
    /// The motion must stand still at the end of this piece: a corner that is not rounded, or the goal.
    pub stop: bool,
}

impl PathPiece {
    /// Position at `x` past the beginning.
    pub fn position(&self, x: f64) -> Vec<f64> {
        (0..self.q.len()).map(|j| self.q[j] + self.d[j] * x + 0.5 * self.c[j] * x * x).collect()
    }

    /// First derivative at `x` past the beginning.
    pub fn derivative(&self, x: f64) -> Vec<f64> {
        (0..self.q.len()).map(|j| self.d[j] + self.c[j] * x).collect()
    }
}

/// The rounded path; the parameter is the joint-space arc length of the straight stretches.
#[derive(Debug, Clone, Default)]
pub struct SmoothPath {
    /// The stretches in order; empty when the path does not move.
    pub pieces: Vec<PathPiece>,
}

/// Corners sharper than this (cosine between the directions) are not rounded.
const SHARPEST: f64 = -0.5;

impl SmoothPath {
    /// Rounds the corners of `waypoints` (unwrapped), straying at most `deviation` (norm of joint values) from each.
    ///
    /// `free` is asked of the waypoint with this number whether the straight motion between two configurations beside it is
    /// free; a corner is rounded less, in the end not at all, until the points of its curve pass. `rates` bounds the rate of the path parameter on each
    /// segment, or is empty.
    pub fn round(
        waypoints: &[Vec<f64>],
        deviation: f64,
        rates: &[f64],
        free: impl Fn(usize, &[f64], &[f64]) -> bool,
    ) -> Self {
        // Segments that do not move have no direction: leave them out, rates with them.
        let mut points: Vec<&Vec<f64>> = Vec::new();
        let mut numbers: Vec<usize> = Vec::new();
        let mut limits: Vec<f64> = Vec::new();
        for (i, q) in waypoints.iter().enumerate() {
            match points.last() {
                Some(last) if norm(&sub(q, last)) < 1e-9 => continue,
                Some(_) => limits.push(rates.get(i - 1).copied().unwrap_or(f64::INFINITY)),
                None => {}
            }
            points.push(q);
            numbers.push(i);
        }
        if points.len() < 2 {
            return Self::default();
        }
        let lengths: Vec<f64> = points.windows(2).map(|w| norm(&sub(w[1], w[0]))).collect();
        let dirs: Vec<Vec<f64>> = points
            .windows(2)
            .zip(&lengths)
            .map(|(w, l)| sub(w[1], w[0]).iter().map(|v| v / l).collect())
            .collect();

        // Half length of the blend at each waypoint; none at the two ends.
        let mut blends = vec![0.0; points.len()];
        for i in 1..points.len() - 1 {
            let (u, w) = (&dirs[i - 1], &dirs[i]);
            let cosine: f64 = u.iter().zip(w).map(|(a, b)| a * b).sum();
            if cosine < SHARPEST {
                continue;
            }
            let turn = norm(&sub(w, u));
            let half = 0.5 * lengths[i - 1].min(lengths[i]);
            let mut l = if turn < 1e-12 { half } else { half.min(4.0 * deviation / turn) };
            for _ in 0..5 {
                let curve = blend(points[i], u, w, l);
                let mut last = curve.position(0.0);
                let clear = (1..=6).all(|k| {
                    let next = curve.position(curve.length * f64::from(k) / 6.0);
                    let ok = free(numbers[i], &last, &next);
                    last = next;
                    ok
                });
                if clear {
                    blends[i] = l;
                    break;
                }
                l *= 0.5;
            }
        }

        let mut path = Self::default();
        for i in 0..dirs.len() {
            // The straight stretch between the two blends of segment i, then the blend at its far end.
            let straight = lengths[i] - blends[i] - blends[i + 1];
            if straight > 1e-9 {
                let q = points[i].iter().zip(&dirs[i]).map(|(p, d)| p + d * blends[i]).collect();
                path.push(PathPiece {
                    start: 0.0,
                    length: straight,
                    q,
                    d: dirs[i].clone(),
                    c: vec![0.0; dirs[i].len()],
                    max_rate: limits[i],
                    stop: blends[i + 1] == 0.0,
                });
            }
            if blends[i + 1] > 0.0 {
                let mut piece = blend(points[i + 1], &dirs[i], &dirs[i + 1], blends[i + 1]);
                piece.max_rate = limits[i].min(limits[i + 1]);
                path.push(piece);
            }
        }
        if let Some(last) = path.pieces.last_mut() {
            last.stop = true;
        }
        path
    }

    fn push(&mut self, mut piece: PathPiece) {
        piece.start = self.length();
        self.pieces.push(piece);
    }

    /// Total length of the path parameter.
    pub fn length(&self) -> f64 {
        self.pieces.last().map_or(0.0, |p| p.start + p.length)
    }
}

fn blend(corner: &[f64], u: &[f64], w: &[f64], l: f64) -> PathPiece {
    PathPiece {
        start: 0.0,
        length: 2.0 * l,
        q: corner.iter().zip(u).map(|(p, u)| p - u * l).collect(),
        d: u.to_vec(),
        c: u.iter().zip(w).map(|(u, w)| (w - u) / (2.0 * l)).collect(),
        max_rate: f64::INFINITY,
        stop: false,
    }
}

fn sub(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

fn norm(v: &[f64]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_continuous_with_its_derivative_and_ends_where_it_should() {
        let waypoints = [vec![0.0, 0.0], vec![1.0, 0.0], vec![1.0, 1.0], vec![2.0, 1.5]];
        let path = SmoothPath::round(&waypoints, 0.1, &[], |_, _, _| true);
        for w in path.pieces.windows(2) {
            let gap = norm(&sub(&w[0].position(w[0].length), &w[1].q));
            let kink = norm(&sub(&w[0].derivative(w[0].length), &w[1].d));
            assert!(gap < 1e-12 && kink < 1e-12 && !w[0].stop, "{gap} {kink}");
        }
        let last = &path.pieces[path.pieces.len() - 1];
        assert!(last.stop && norm(&sub(&last.position(last.length), &waypoints[3])) < 1e-12);
        // The first corner turns by a right angle: |w - u| l / 4 = 0.1 at the middle of the blend.
        let b = &path.pieces[1];
        let stray = norm(&sub(&b.position(b.length / 2.0), &waypoints[1]));
        assert!((stray - 0.1).abs() < 1e-12, "{stray}");
    }

    #[test]
    fn stops_on_corners_that_may_not_be_rounded() {
        let waypoints = [vec![0.0, 0.0], vec![1.0, 0.0], vec![1.0, 1.0]];
        let path = SmoothPath::round(&waypoints, 0.1, &[], |_, _, _| false);
        assert_eq!(path.pieces.len(), 2);
        assert!(path.pieces[0].stop);
        let back = [vec![0.0], vec![1.0], vec![0.0]];
        assert!(SmoothPath::round(&back, 0.1, &[], |_, _, _| true).pieces[0].stop);
    }

    #[test]
    fn a_path_that_does_not_move_has_no_pieces() {
        let q = vec![0.3, 0.4];
        assert!(SmoothPath::round(&[q.clone(), q], 0.1, &[], |_, _, _| true).pieces.is_empty());
    }
}
