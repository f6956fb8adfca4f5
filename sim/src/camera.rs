//! The pinhole camera, and the distortion of a lens before it.

mod distortion;
mod load;
mod ros;

use nalgebra::{Point2, Point3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use self::distortion::Distortion;

/// Pinhole intrinsics, pixels. Image point `(fx x/z + cx, fy y/z + cy)`, pixel centres at integers (OpenCV, BOP).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Intrinsics {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Focal length along u, pixels.
    pub fx: f64,
    /// Focal length along v, pixels.
    pub fy: f64,
    /// Principal point, column.
    pub cx: f64,
    /// Principal point, row.
    pub cy: f64,
}

impl Intrinsics {
    /// The Fetch head camera as in its public description: 640x480, horizontal field of view 1.0472 rad.
    pub const FETCH: Self = Self { width: 640, height: 480, fx: 554.26, fy: 554.26, cx: 319.5, cy: 239.5 };
    /// The Fetch head camera as calibrated by the GRIP paper's authors for their data set.
    pub const GRIP_PAPER: Self =
        Self { width: 640, height: 480, fx: 542.556, fy: 542.556, cx: 322.065, cy: 222.214 };

    /// The image point of a point in the optical frame; `None` when it is not in front of the camera.
    pub fn project(&self, p: &Point3<f64>) -> Option<Point2<f64>> {
        (p.z > 1e-9).then(|| Point2::new(self.fx * p.x / p.z + self.cx, self.fy * p.y / p.z + self.cy))
    }

    /// The point in the optical frame that image point (u, v) shows at `depth` metres along the axis.
    pub fn back_project(&self, u: f64, v: f64, depth: f64) -> Point3<f64> {
        Point3::new((u - self.cx) / self.fx * depth, (v - self.cy) / self.fy * depth, depth)
    }

    /// The same view in a picture that is `times` smaller in width and height.
    #[must_use]
    pub fn shrunk(&self, times: usize) -> Self {
        let by = times as f64;
        let middle = |c: f64| (c + 0.5) / by - 0.5;
        Self {
            width: self.width / times,
            height: self.height / times,
            fx: self.fx / by,
            fy: self.fy / by,
            cx: middle(self.cx),
            cy: middle(self.cy),
        }
    }

    /// What is wrong with these numbers, if anything.
    pub fn problem(&self) -> Option<String> {
        let Self { width, height, fx, fy, cx, cy } = *self;
        if !(16..=8192).contains(&width) || !(16..=8192).contains(&height) {
            return Some(format!("image size {width}x{height}: each side must be 16 to 8192 pixels"));
        }
        let focal = |f: f64| f.is_finite() && f > 1.0 && f < 1e6;
        if !focal(fx) || !focal(fy) || !cx.is_finite() || !cy.is_finite() {
            return Some(format!(
                "fx {fx}, fy {fy}, cx {cx}, cy {cy}: must be finite, focal lengths 1 to 1e6 pixels"
            ));
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_corners_of_a_shrunk_picture_see_the_same() {
        let (k, small) = (Intrinsics::FETCH, Intrinsics::FETCH.shrunk(4));
        assert_eq!((small.width, small.height), (160, 120));
        for [u, v] in [[-0.5, -0.5], [639.5, 479.5]] {
            let shrunk = small.project(&k.back_project(u, v, 0.7)).unwrap();
            assert!((shrunk.x - ((u + 0.5) / 4.0 - 0.5)).abs() < 1e-9, "{shrunk}");
            assert!((shrunk.y - ((v + 0.5) / 4.0 - 0.5)).abs() < 1e-9, "{shrunk}");
        }
    }

    #[test]
    fn back_projection_inverts_projection() {
        let k = Intrinsics::FETCH;
        let p = Point3::new(0.21, -0.13, 0.97);
        let uv = k.project(&p).unwrap();
        assert!((k.back_project(uv.x, uv.y, p.z) - p).norm() < 1e-12);
        assert!(k.project(&Point3::new(0.0, 0.0, -1.0)).is_none());
    }

    #[test]
    fn fetch_field_of_view_is_sixty_degrees() {
        let k = Intrinsics::FETCH;
        assert!((2.0 * (k.width as f64 / 2.0 / k.fx).atan() - 60_f64.to_radians()).abs() < 1e-3);
    }
}
