//! The whole outline of an object in the picture, whatever stands before it and however far it reaches out of the image.

use nalgebra::{Point2, Point3};

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
    let points: Vec<Point2<f64>> = mesh
        .positions
        .iter()
        .map(|p| {
            let seen: Point3<f64> = camera_from_object.transform_point(&p.cast());
            (seen.z > NEAR).then(|| intrinsics.project(&seen)).flatten()
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
    let fits = |axis: usize| low[axis] >= -size[axis] && high[axis] < 2.0 * size[axis] && low[axis] <= high[axis];
    if !(fits(0) && fits(1)) {
        return None;
    }
    let [width, height] = [0, 1].map(|axis| (high[axis] - low[axis]) as usize + 1);
    let mut mask = Image::filled(width, height, false);
    for triangle in &mesh.triangles {
        let corners = triangle.map(|i| points[i as usize] - nalgebra::Vector2::from(low));
        cover(&mut mask, corners);
    }
    Some(Silhouette { mask, offset: low.map(|v| v as i32) })
}

/// Marks the pixels whose centres (at whole numbers) lie in or on a triangle, row by row.
fn cover(mask: &mut Image<bool>, corners: [Point2<f64>; 3]) {
    let rows = |pick: fn(f64, f64) -> f64| corners[1..].iter().fold(corners[0].y, |y, c| pick(y, c.y));
    let first = rows(f64::min).ceil().max(0.0) as usize;
    let last = rows(f64::max).floor().min(mask.height() as f64 - 1.0);
    if last < first as f64 {
        return;
    }
    for v in first..=last as usize {
        let y = v as f64;
        let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
        for (a, b) in [(0, 1), (1, 2), (2, 0)] {
            let (a, b) = (corners[a], corners[b]);
            if (a.y - y) * (b.y - y) > 0.0 {
                continue;
            }
            let at = if a.y == b.y { [a.x, b.x] } else { [a.x + (b.x - a.x) * (y - a.y) / (b.y - a.y); 2] };
            left = left.min(at[0]).min(at[1]);
            right = right.max(at[0]).max(at[1]);
        }
        let (left, right) = (left.ceil().max(0.0), right.floor().min(mask.width() as f64 - 1.0));
        if left <= right {
            for u in left as usize..=right as usize {
                *mask.at_mut(u, v) = true;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Isometry3, Vector3};

    const CAMERA: Intrinsics =
        Intrinsics { width: 64, height: 48, fx: 60.0, fy: 60.0, cx: 31.5, cy: 23.5 };

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
