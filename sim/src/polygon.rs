//! Faces of more than three corners, cut into triangles.

use earcut::{Earcut, utils3d::project3d_to_2d};
use nalgebra::Vector3;

/// Triangles of a face as places in its list of corners, wound as it is: a fan where it is convex, else by ears.
pub(crate) fn triangles(corners: &[Vector3<f64>]) -> Vec<[usize; 3]> {
    let count = corners.len();
    let fan = || (1..count.saturating_sub(1)).map(|i| [0, i, i + 1]).collect();
    let next = |i: usize| (i + 1) % count;
    // Newell's normal: whole where some corners are in line.
    let normal: Vector3<f64> = (0..count).map(|i| corners[i].cross(&corners[next(i)])).sum();
    let turn = |i: usize| {
        let (a, b, c) = (corners[i], corners[next(i)], corners[next(next(i))]);
        (b - a).cross(&(c - b)).dot(&normal)
    };
    let least = -1e-9 * normal.norm_squared();
    if count < 4 || (0..count).all(|i| turn(i) >= least) {
        return fan();
    }
    let points: Vec<[f64; 3]> = corners.iter().map(|corner| (corner - corners[0]).into()).collect();
    let (mut flat, mut cut) = (Vec::new(), Vec::<usize>::new());
    if !project3d_to_2d(&points, count, &mut flat) {
        return fan();
    }
    Earcut::new().earcut(flat, &[], &mut cut);
    let mut triangles = cut.as_chunks::<3>().0.to_vec();
    for triangle in &mut triangles {
        let [a, b, c] = triangle.map(|i| corners[i]);
        if (b - a).cross(&(c - a)).dot(&normal) < 0.0 {
            triangle.swap(1, 2);
        }
    }
    if triangles.is_empty() { fan() } else { triangles }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(corners: &[Vector3<f64>], triangles: &[[usize; 3]]) -> Vector3<f64> {
        triangles.iter().map(|t| t.map(|i| corners[i])).map(|[a, b, c]| 0.5 * (b - a).cross(&(c - a))).sum()
    }

    #[test]
    fn a_concave_face_has_its_own_area_from_whichever_corner_and_side() {
        let outline = [[0.0, 0.0], [0.12, 0.0], [0.12, 0.04], [0.05, 0.04], [0.05, 0.1], [0.0, 0.1]];
        let turn = nalgebra::Rotation3::from_euler_angles(0.3, -1.1, 2.0);
        for first in 0..6 {
            for back in [false, true] {
                let mut corners: Vec<Vector3<f64>> = (0..6)
                    .map(|i| outline[(i + first) % 6])
                    .map(|[x, y]| turn * Vector3::new(x, y, 0.7) + Vector3::new(1.0, 2.0, 3.0))
                    .collect();
                if back {
                    corners.reverse();
                }
                let cut = triangles(&corners);
                assert_eq!(cut.len(), 4);
                let normal = turn * Vector3::z() * if back { -1.0 } else { 1.0 };
                let of_triangle = |t: &[usize; 3]| area(&corners, &[*t]).dot(&normal);
                assert!(cut.iter().all(|t| of_triangle(t) > 0.0), "{first}: {cut:?}");
                let whole: f64 = cut.iter().map(of_triangle).sum();
                assert!((whole - (0.12 * 0.04 + 0.05 * 0.06)).abs() < 1e-12, "{first}: {whole}");
            }
        }
    }

    #[test]
    fn a_convex_face_is_a_fan_and_one_without_area_no_harm() {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.5, 1.0], [0.0, 1.0]]
            .map(|[x, y]| Vector3::new(x, y, 2.0));
        assert_eq!(triangles(&square), [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
        assert_eq!(triangles(&[Vector3::zeros(); 5]).len(), 3);
        assert!(triangles(&square[..2]).is_empty() && triangles(&[]).is_empty());
        let wrong = [Vector3::repeat(f64::NAN), square[0], square[1], square[2]];
        assert!(triangles(&wrong).len() <= 2);
    }
}
