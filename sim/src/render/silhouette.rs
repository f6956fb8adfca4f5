//! The whole outline of an object in the picture, whatever stands before it and however far it reaches out of the image.

use nalgebra::Point3;

use super::NEAR;
use crate::camera::Intrinsics;
use crate::images::Image;
use crate::mesh::Mesh;
use crate::pose::{Camera, Object, Pose};

/// The pixels that an object covers.
#[derive(Debug, Clone, PartialEq)]
pub struct Silhouette {
    /// The smallest rectangle of pixels that holds the object.
    pub mask: Image<bool>,
    /// One over the depth of its nearest surface, 1/m; 0 where it covers nothing. Same size as the mask.
    pub inverse_depth: Image<f32>,
    /// Image pixel of the mask's (0, 0); negative where the object reaches out of the image on the left or above.
    pub offset: [i32; 2],
}

/// Draws the outline of a mesh; `None` where it covers no pixel centre, or reaches behind the camera, or out of a canvas
/// three times as wide and high as the image.
///
/// A pixel is covered when the ray through its centre meets a triangle; edges belong to both of their triangles.
pub fn silhouette(
    mesh: &Mesh,
    camera_from_object: &Pose<Camera, Object>,
    intrinsics: &Intrinsics,
) -> Option<Silhouette> {
    let points: Vec<[f64; 3]> = mesh
        .positions
        .iter()
        .map(|p| {
            let seen: Point3<f64> = camera_from_object.transform_point(&p.cast());
            let at = (seen.z > NEAR).then(|| intrinsics.project(&seen)).flatten()?;
            Some([at.x, at.y, 1.0 / seen.z])
        })
        .collect::<Option<_>>()?;
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for p in &points {
        for axis in 0..2 {
            low[axis] = low[axis].min(p[axis]);
            high[axis] = high[axis].max(p[axis]);
        }
    }
    let (low, high) = (low.map(f64::ceil), high.map(f64::floor));
    let size = [intrinsics.width as f64, intrinsics.height as f64];
    let fits =
        |axis: usize| low[axis] >= -size[axis] && high[axis] < 2.0 * size[axis] && low[axis] <= high[axis];
    if !(fits(0) && fits(1)) {
        return None;
    }
    let [width, height] = [0, 1].map(|axis| (high[axis] - low[axis]) as usize + 1);
    let mut inverse_depth = Image::filled(width, height, 0.0);
    for triangle in &mesh.triangles {
        cover(
            &mut inverse_depth,
            triangle.map(|i| {
                let [x, y, inverse] = points[i as usize];
                [x - low[0], y - low[1], inverse]
            }),
        );
    }
    let mask = Image::from_vec(width, height, inverse_depth.data().iter().map(|&d| d > 0.0).collect())?;
    Some(Silhouette { mask, inverse_depth, offset: low.map(|v| v as i32) })
}

/// Marks the pixels whose centres (at whole numbers) lie in or on a triangle, row by row. Corners are column, row and inverse
/// depth, which is linear in the image.
pub(super) fn cover(nearest: &mut Image<f32>, corners: [[f64; 3]; 3]) {
    let rows = |pick: fn(f64, f64) -> f64| corners[1..].iter().fold(corners[0][1], |y, c| pick(y, c[1]));
    let first = rows(f64::min).ceil().max(0.0) as usize;
    let last = rows(f64::max).floor().min(nearest.height() as f64 - 1.0);
    if last < first as f64 {
        return;
    }
    for v in first..=last as usize {
        let y = v as f64;
        // Column and inverse depth where the row enters and leaves.
        let (mut left, mut right) = ([f64::INFINITY, 0.0], [f64::NEG_INFINITY, 0.0]);
        let mut meet = |x: f64, inverse: f64| {
            if x < left[0] {
                left = [x, inverse];
            }
            if x > right[0] {
                right = [x, inverse];
            }
        };
        for (a, b) in [(0, 1), (1, 2), (2, 0)] {
            let ([ax, ay, ai], [bx, by, bi]) = (corners[a], corners[b]);
            if (ay - y) * (by - y) > 0.0 {
                continue;
            }
            if ay == by {
                meet(ax, ai);
                meet(bx, bi);
            } else {
                let share = (y - ay) / (by - ay);
                meet(ax + (bx - ax) * share, ai + (bi - ai) * share);
            }
        }
        let (from, to) = (left[0].ceil().max(0.0), right[0].floor().min(nearest.width() as f64 - 1.0));
        if from > to {
            continue;
        }
        let slope = (right[1] - left[1]) / (right[0] - left[0]).max(1e-9);
        for u in from as usize..=to as usize {
            let inverse = (left[1] + slope * (u as f64 - left[0])) as f32;
            let pixel = nearest.at_mut(u, v);
            *pixel = pixel.max(inverse);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Isometry3, Vector3};

    const CAMERA: Intrinsics = Intrinsics { width: 64, height: 48, fx: 60.0, fy: 60.0, cx: 31.5, cy: 23.5 };

    fn square(half: f32) -> Mesh {
        let corner = |x: f32, y: f32| Point3::new(x * half, y * half, 0.0);
        Mesh {
            positions: vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
            normals: vec![-Vector3::z(); 4],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Mesh::default()
        }
    }

    fn at(x: f64, y: f64, z: f64) -> Pose<Camera, Object> {
        Pose::new(Isometry3::translation(x, y, z))
    }

    #[test]
    fn a_square_covers_the_pixels_of_its_projection() {
        // 60 * 0.1 / 1 = 6 pixels to each side of 31.5, 23.5.
        let seen = silhouette(&square(0.1), &at(0.0, 0.0, 1.0), &CAMERA).unwrap();
        assert_eq!(seen.offset, [26, 18]);
        assert_eq!((seen.mask.width(), seen.mask.height()), (12, 12));
        assert!(seen.mask.data().iter().all(|&covered| covered));
        assert!(seen.inverse_depth.data().iter().all(|&d| (d - 1.0).abs() < 1e-6));
    }

    #[test]
    fn depth_is_that_of_the_plane() {
        let tilted = Isometry3::rotation(Vector3::new(0.6, 0.3, 0.0));
        let pose = Pose::new(Isometry3::translation(0.0, 0.0, 1.0) * tilted);
        let seen = silhouette(&square(0.2), &pose, &CAMERA).unwrap();
        let normal = tilted * Vector3::z();
        for v in 0..seen.mask.height() {
            for u in 0..seen.mask.width() {
                let inverse = f64::from(*seen.inverse_depth.at(u, v));
                if inverse > 0.0 {
                    let [u, v] = [u as f64 + f64::from(seen.offset[0]), v as f64 + f64::from(seen.offset[1])];
                    let ray = CAMERA.back_project(u, v, 1.0).coords;
                    let depth = normal.z / normal.dot(&ray);
                    assert!((1.0 / inverse - depth).abs() < 1e-5, "{inverse} {depth}");
                }
            }
        }
    }

    #[test]
    fn what_reaches_out_of_the_image_is_whole() {
        let seen = silhouette(&square(0.1), &at(-0.55, 0.0, 1.0), &CAMERA).unwrap();
        assert_eq!(seen.offset, [-7, 18]);
        assert_eq!(seen.mask.data().len(), 144);
    }

    #[test]
    fn behind_the_camera_and_far_outside_there_is_nothing() {
        assert!(silhouette(&square(0.1), &at(0.0, 0.0, 0.01), &CAMERA).is_none());
        assert!(silhouette(&square(0.1), &at(0.0, 0.0, -1.0), &CAMERA).is_none());
        assert!(silhouette(&square(0.1), &at(9.0, 0.0, 1.0), &CAMERA).is_none());
        // Between pixel centres.
        assert!(silhouette(&square(0.001), &at(0.0, 0.0, 1.0), &CAMERA).is_none());
    }
}
