//! ADD and ADD-S: mean distances of model points (Hinterstoisser 2012, PoseCNN).

use grip_sim::pose::{Camera, Object, Pose};
use nalgebra::Point3;
use rstar::RTree;

/// The points of a model, ready for many comparisons of poses: ADD and ADD-S as [`add`] and [`adds`] have them, the nearest
/// point found by a tree.
#[derive(Debug)]
pub struct Surface {
    points: Vec<Point3<f64>>,
    tree: RTree<[f64; 3]>,
}

impl Surface {
    /// Of these points, metres, object frame.
    pub fn new(points: Vec<Point3<f64>>) -> Self {
        let tree = RTree::bulk_load(points.iter().map(|p| [p.x, p.y, p.z]).collect());
        Self { points, tree }
    }

    /// ADD, metres.
    pub fn add(&self, truth: &Pose<Camera, Object>, estimate: &Pose<Camera, Object>) -> f64 {
        add(&self.points, truth, estimate)
    }

    /// ADD-S, metres.
    pub fn adds(&self, truth: &Pose<Camera, Object>, estimate: &Pose<Camera, Object>) -> f64 {
        // In the frame of the estimate, where the tree is.
        let estimate_from_truth = estimate.inverse() * *truth;
        let sum: f64 = self
            .points
            .iter()
            .map(|p| {
                let p = estimate_from_truth.transform_point(p);
                let nearest = self.tree.nearest_neighbor([p.x, p.y, p.z]);
                nearest.map_or(0.0, |q| nalgebra::distance(&p, &Point3::from(*q)))
            })
            .sum();
        sum / self.points.len().max(1) as f64
    }
}

/// ADD, metres: mean distance between corresponding model points under the two poses. 0 for no points.
pub fn add(points: &[Point3<f64>], truth: &Pose<Camera, Object>, estimate: &Pose<Camera, Object>) -> f64 {
    let sum: f64 =
        points.iter().map(|p| (truth.transform_point(p) - estimate.transform_point(p)).norm()).sum();
    sum / points.len().max(1) as f64
}

/// ADD-S, metres: for each model point under the true pose the distance to the nearest one under the estimate, mean.
/// Brute force: quadratic in the number of points, so sample them down to 1000 with
/// [`sample_points`](super::sample_points). 0 for no points.
pub fn adds(points: &[Point3<f64>], truth: &Pose<Camera, Object>, estimate: &Pose<Camera, Object>) -> f64 {
    let moved: Vec<Point3<f64>> = points.iter().map(|p| estimate.transform_point(p)).collect();
    let sum: f64 = points
        .iter()
        .map(|p| {
            let p = truth.transform_point(p);
            moved.iter().map(|q| (p - q).norm_squared()).fold(f64::INFINITY, f64::min).sqrt()
        })
        .sum();
    sum / points.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Isometry3, Vector3};

    fn cube() -> Vec<Point3<f64>> {
        (0..8)
            .map(|i| Point3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64) - Vector3::repeat(0.5))
            .collect()
    }

    #[test]
    fn translation_is_its_own_add() {
        let a = Pose::from_xyz_rpy([0.1, 0.2, 1.0], [0.3, 0.2, 0.1]);
        let b = Pose::new(Isometry3::translation(0.03, -0.04, 0.0) * a.iso());
        assert!((add(&cube(), &a, &b) - 0.05).abs() < 1e-12);
        assert!((adds(&cube(), &a, &b) - 0.05).abs() < 1e-12);
    }

    #[test]
    fn a_quarter_turn_of_a_cube_is_nothing_to_adds() {
        let a = Pose::identity();
        let b = Pose::from_xyz_rpy([0.0; 3], [0.0, 0.0, std::f64::consts::FRAC_PI_2]);
        // Each corner moves along the side of a unit square.
        assert!((add(&cube(), &a, &b) - 1.0).abs() < 1e-12);
        assert!(adds(&cube(), &a, &b) < 1e-12);
    }

    #[test]
    fn the_tree_finds_what_brute_force_finds() {
        let points: Vec<Point3<f64>> = (0..500)
            .map(|i| {
                let x = f64::from(i);
                Point3::new((1.3 * x).sin(), (2.1 * x).cos(), (0.7 * x).sin() * (0.2 * x).cos()) * 0.1
            })
            .collect();
        let surface = Surface::new(points.clone());
        for i in 0..50 {
            let x = f64::from(i) * 0.37;
            let a = Pose::from_xyz_rpy([0.1, 0.2, 0.9], [0.3 * x, 0.1, x]);
            let b = Pose::from_xyz_rpy([0.1 + 0.02 * x.sin(), 0.2, 0.9], [0.1 * x, x, 0.2]);
            assert!((surface.adds(&a, &b) - adds(&points, &a, &b)).abs() < 1e-12);
            assert_eq!(surface.add(&a, &b), add(&points, &a, &b));
        }
        assert_eq!(Surface::new(vec![]).adds(&Pose::identity(), &Pose::identity()), 0.0);
    }

    #[test]
    fn nearest_never_exceeds_corresponding() {
        for i in 0..50 {
            let x = f64::from(i) * 0.37;
            let b = Pose::from_xyz_rpy([x.sin(), 0.1 * x, 0.0], [x, 2.0 * x, 0.3]);
            assert!(adds(&cube(), &Pose::identity(), &b) <= add(&cube(), &Pose::identity(), &b) + 1e-12);
        }
    }
}
