//! Lens distortion after Brown (1966), in OpenCV's order and formulas.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Intrinsics;

/// Distortion of a lens: radial k1, k2, k3 and tangential p1, p2, all without unit. In OpenCV's order, `(k1, k2, p1, p2,
/// k3)` (calib3d, "Camera Calibration and 3D Reconstruction"). The default is a lens that distorts nothing.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Distortion {
    /// Share of r^2: negative for barrels, positive for pincushions.
    pub k1: f64,
    /// Share of r^4.
    pub k2: f64,
    /// Decentring along y.
    pub p1: f64,
    /// Decentring along x.
    pub p2: f64,
    /// Share of r^6.
    pub k3: f64,
}

/// Names, and the largest value that a lens within this model has: beyond it the numbers are a slip.
const LIMITS: [(&str, f64); 5] = [("k1", 2.0), ("k2", 10.0), ("p1", 0.2), ("p2", 0.2), ("k3", 50.0)];
/// Newton's iteration ends when it reproduces its target this well: a millionth of a millionth of the focal length.
const CONVERGED: f64 = 1e-12;
/// Newton needs 4 to 6 steps for usual lenses.
const MOST_STEPS: usize = 50;
/// Where the derivative's determinant is below this, the picture is about to fold.
const LEAST_DETERMINANT: f64 = 1e-3;

impl Distortion {
    /// Whether it changes nothing.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// Where the lens puts the ray `(x, y, 1)`, in normalised coordinates: `x = (u - cx) / fx`, `y = (v - cy) / fy`.
    pub fn distort(&self, x: f64, y: f64) -> (f64, f64) {
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3));
        (
            x * radial + 2.0 * self.p1 * x * y + self.p2 * (r2 + 2.0 * x * x),
            y * radial + self.p1 * (r2 + 2.0 * y * y) + 2.0 * self.p2 * x * y,
        )
    }

    /// The ray `(x, y, 1)` that the lens puts at the given normalised coordinates: [`distort`](Self::distort) undone, to
    /// 1e-12, by Newton's method with steps halved while they do not help. `None` where no such ray is found, or only
    /// one beyond the place where the picture folds.
    pub fn undistort(&self, x: f64, y: f64) -> Option<(f64, f64)> {
        let error = |at: (f64, f64)| {
            let (dx, dy) = self.distort(at.0, at.1);
            (dx - x, dy - y)
        };
        let size = |e: (f64, f64)| e.0.abs().max(e.1.abs());
        let mut at = (x, y);
        let mut off = error(at);
        for _ in 0..MOST_STEPS {
            if size(off) < CONVERGED {
                return self.unfolded_to(at.0, at.1).then_some(at);
            }
            let [xx, xy, yy] = self.derivative(at.0, at.1);
            let determinant = xx * yy - xy * xy;
            if determinant.abs() < 1e-12 {
                return None;
            }
            let step = ((yy * off.0 - xy * off.1) / determinant, (xx * off.1 - xy * off.0) / determinant);
            let mut share = 1.0;
            let next = loop {
                let next = (at.0 - share * step.0, at.1 - share * step.1);
                if size(error(next)) < size(off) {
                    break next;
                }
                share *= 0.5;
                // No step helps: rounding's limit, which is good enough only if it meets the bound above.
                if share < 1e-4 {
                    return None;
                }
            };
            at = next;
            off = error(at);
        }
        None
    }

    /// d x'/d x, d x'/d y (which equals d y'/d x), d y'/d y.
    fn derivative(&self, x: f64, y: f64) -> [f64; 3] {
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3));
        let slope = 2.0 * (self.k1 + r2 * (2.0 * self.k2 + r2 * 3.0 * self.k3));
        [
            radial + slope * x * x + 2.0 * self.p1 * y + 6.0 * self.p2 * x,
            slope * x * y + 2.0 * self.p1 * x + 2.0 * self.p2 * y,
            radial + slope * y * y + 6.0 * self.p1 * y + 2.0 * self.p2 * x,
        ]
    }

    /// Whether the picture nowhere turns back between the axis and the ray (x, y).
    fn unfolded_to(&self, x: f64, y: f64) -> bool {
        (0..=16).all(|i| {
            let t = f64::from(i) / 16.0;
            let [xx, xy, yy] = self.derivative(t * x, t * y);
            xx * yy - xy * xy > LEAST_DETERMINANT
        })
    }

    /// What is wrong with these numbers for a picture of `intrinsics`, if anything: not finite, beyond what lenses have, or
    /// the picture folds over itself.
    pub fn problem(&self, intrinsics: &Intrinsics) -> Option<String> {
        let values = [self.k1, self.k2, self.p1, self.p2, self.k3];
        for ((name, limit), value) in LIMITS.into_iter().zip(values) {
            if !value.is_finite() || value.abs() > limit {
                return Some(format!("{name} = {value}: must be a number from -{limit} to {limit}"));
            }
        }
        let folds = |u: f64, v: f64| {
            let (x, y) = ((u - intrinsics.cx) / intrinsics.fx, (v - intrinsics.cy) / intrinsics.fy);
            self.undistort(x, y).is_none()
        };
        let (last_u, last_v) = (intrinsics.width as f64 - 1.0, intrinsics.height as f64 - 1.0);
        const STEPS: u32 = 32;
        let at = |i: u32, last: f64| last * f64::from(i) / f64::from(STEPS);
        for i in 0..=STEPS {
            for j in 0..=STEPS {
                let (u, v) = (at(i, last_u), at(j, last_v));
                if folds(u, v) {
                    return Some(format!(
                        "k1 {}, k2 {}, p1 {}, p2 {}, k3 {}: the picture folds about pixel ({u:.0}, {v:.0}); use \
                         smaller coefficients or a longer focal length",
                        self.k1, self.k2, self.p1, self.p2, self.k3
                    ));
                }
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ZERO: Distortion = Distortion { k1: 0.0, k2: 0.0, p1: 0.0, p2: 0.0, k3: 0.0 };
    const STRONG: Distortion = Distortion { k1: 0.1, k2: -0.2, p1: 0.001, p2: -0.002, k3: 0.05 };
    const USUAL: Distortion = Distortion { k1: 0.0416, k2: -0.0927, p1: -0.0011, p2: 0.0043, k3: 0.0 };
    const BARREL: Distortion = Distortion { k1: -0.28, k2: 0.07, ..ZERO };

    #[test]
    fn zero_is_the_identity() {
        assert!(Distortion::default().is_none() && !USUAL.is_none());
        assert_eq!(ZERO.distort(0.3, -0.7), (0.3, -0.7));
        assert_eq!(ZERO.undistort(0.3, -0.7), Some((0.3, -0.7)));
    }

    #[test]
    fn radial_distortion_scales_the_radius() {
        let lens = Distortion { k1: -0.2, ..ZERO };
        for r in [0.1_f64, 0.3, 0.6] {
            for angle in [0.0_f64, 1.0, 2.5, 4.0] {
                let (x, y) = lens.distort(r * angle.cos(), r * angle.sin());
                assert!((x.hypot(y) - r * (1.0 - 0.2 * r * r)).abs() < 1e-15);
                assert!((y.atan2(x) - angle).sin().abs() < 1e-12);
            }
        }
    }

    #[test]
    fn values_are_opencvs() {
        // Computed apart from this program (Python, double precision) from the formula in OpenCV's documentation of
        // calib3d: x'' = x' (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x' y' + p2 (r^2 + 2 x'^2), y'' likewise.
        let cases = [
            (STRONG, 0.3, -0.2, 0.302_178_955_000_000, -0.201_495_970_000_000),
            (STRONG, -0.55, 0.4, -0.557_203_432_617_188, 0.405_028_632_812_500),
            (STRONG, 0.0, 0.43, -0.000_369_800_000_000, 0.435_701_140_445_553),
            (USUAL, 0.3, -0.2, 0.302_617_411_000_000, -0.201_515_274_000_000),
            (USUAL, -0.55, 0.4, -0.544_601_739_843_750, 0.397_011_606_250_000),
            (USUAL, 0.0, 0.43, 0.000_795_070_000_000, 0.431_334_552_933_390),
            (BARREL, 0.3, -0.2, 0.289_434_900_000_000, -0.192_956_600_000_000),
            (BARREL, -0.55, 0.4, -0.487_010_390_625_000, 0.354_189_375_000_000),
            (BARREL, 0.0, 0.43, 0.0, 0.408_767_099_101_000),
        ];
        for (lens, x, y, expected_x, expected_y) in cases {
            let (dx, dy) = lens.distort(x, y);
            assert!((dx - expected_x).abs() < 1e-14 && (dy - expected_y).abs() < 1e-14, "{lens:?} {dx} {dy}");
        }
    }

    #[test]
    fn undistortion_inverts_over_the_image() {
        let k = Intrinsics::FETCH;
        for lens in [ZERO, STRONG, USUAL, BARREL] {
            assert_eq!(lens.problem(&k), None);
            for v in (0..480).step_by(13) {
                for u in (0..640).step_by(13) {
                    let (x, y) = ((u as f64 - k.cx) / k.fx, (v as f64 - k.cy) / k.fy);
                    let (dx, dy) = lens.distort(x, y);
                    let (bx, by) = lens.undistort(dx, dy).unwrap();
                    assert!((bx - x).abs() < 1e-9 && (by - y).abs() < 1e-9, "{lens:?} {u} {v}");
                    let (ux, uy) = lens.undistort(x, y).unwrap();
                    let (fx, fy) = lens.distort(ux, uy);
                    assert!((fx - x).abs() < 1e-9 && (fy - y).abs() < 1e-9, "{lens:?} {u} {v}");
                }
            }
        }
    }

    #[test]
    fn derivative_is_the_difference_quotient() {
        let (x, y, h) = (0.31, -0.22, 1e-6);
        let [xx, xy, yy] = STRONG.derivative(x, y);
        let along_x = (STRONG.distort(x + h, y), STRONG.distort(x - h, y));
        let along_y = (STRONG.distort(x, y + h), STRONG.distort(x, y - h));
        let slope = |a: f64, b: f64| (a - b) / (2.0 * h);
        assert!((slope(along_x.0.0, along_x.1.0) - xx).abs() < 1e-8);
        assert!((slope(along_x.0.1, along_x.1.1) - xy).abs() < 1e-8);
        assert!((slope(along_y.0.0, along_y.1.0) - xy).abs() < 1e-8);
        assert!((slope(along_y.0.1, along_y.1.1) - yy).abs() < 1e-8);
    }

    #[test]
    fn bad_numbers_and_folding_pictures_are_named() {
        let k = Intrinsics::FETCH;
        let nan = Distortion { k2: f64::NAN, ..ZERO }.problem(&k).unwrap();
        assert!(nan.contains("k2 = NaN"), "{nan}");
        let huge = Distortion { p1: 3.0, ..ZERO }.problem(&k).unwrap();
        assert!(huge.contains("p1 = 3"), "{huge}");
        // r (1 - 0.9 r^2) is largest at r = 0.61, where it is 0.41; the image's corner is at 0.72.
        let fold = Distortion { k1: -0.9, ..ZERO };
        assert!(fold.problem(&k).unwrap().contains("folds"));
        assert_eq!(fold.undistort(0.6, 0.4), None);
        // The same lens on a longer focal length stays on the near side of the fold.
        let long = Intrinsics { fx: 1200.0, fy: 1200.0, ..k };
        assert_eq!(fold.problem(&long), None);
    }
}
