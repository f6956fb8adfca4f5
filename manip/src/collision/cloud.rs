//! A point cloud as an obstacle: the unmodelled ones.
//!
//! The balls that cover the robot are looked up in a collision-affording point tree (Ramsey et al. 2024, crate `capt`); where
//! one touches a point, the convex solid behind it is held against the points exactly.

use capt::Capt;
use nalgebra::{Isometry3, Point3};
use parry3d::math::{Pose, Vector};

use super::piece::Piece;
use super::robot::LinkSolids;
use super::solid::distance_from_point;

/// Each point stands for a ball of this radius, metres: together they close the gaps of a grid of a centimetre.
const POINT_RADIUS: f64 = 0.006;
/// Largest ball that the tree is made for, metres; larger ones are left to the exact check.
const WIDEST: f32 = 0.15;

/// Points in the base frame.
#[derive(Debug)]
pub(crate) struct Cloud {
    points: Vec<Vector>,
    /// None where there are more points than it can hold: then all is left to the exact check.
    tree: Option<Capt<3, f32, u32>>,
    /// Box about the points.
    center: Vector,
    half: Vector,
}

impl Cloud {
    /// The cloud of `points` of the world; none of no points.
    pub fn new(points: &[Point3<f64>], base_from_world: &Isometry3<f64>) -> Option<Self> {
        let in_base = points.iter().map(|p| {
            let p = base_from_world * p;
            Vector::new(p.x as f32, p.y as f32, p.z as f32)
        });
        let points: Vec<Vector> = in_base.filter(|p| p.is_finite()).collect();
        let arrays: Vec<[f32; 3]> = points.iter().map(|p| p.to_array()).collect();
        let (mut low, mut high) = (*points.first()?, *points.first()?);
        for p in &points {
            low = low.min(*p);
            high = high.max(*p);
        }
        let tree = Capt::try_with_point_radius(&arrays, (0.0, WIDEST), POINT_RADIUS as f32, 1).ok();
        Some(Self { points, tree, center: (low + high) * 0.5, half: (high - low) * 0.5 })
    }

    /// Whether a ball may meet a point's; false only when it certainly does not.
    #[inline]
    pub fn may_meet_ball(&self, center: Vector, radius: f32) -> bool {
        let apart = ((center - self.center).abs() - self.half).max(Vector::ZERO).length();
        apart <= radius + POINT_RADIUS as f32
            && (radius > WIDEST
                || self.tree.as_ref().is_none_or(|tree| tree.collides(&center.to_array(), radius)))
    }

    /// Whether solids at `pose` are closer than `margin` to a point.
    pub fn meets(&self, solids: &LinkSolids, pose: &Pose, margin: f32) -> bool {
        let bound = &solids.bound;
        self.may_meet_ball(*pose * bound.center, bound.radius + margin)
            && solids.pieces.iter().any(|piece| {
                piece.balls.iter().any(|b| self.may_meet_ball(*pose * b.center, b.radius + margin))
                    && self.meets_piece(piece, pose, margin)
            })
    }

    /// Whether a piece at `pose` is closer than `margin` to a point's ball (0: whether they overlap).
    pub fn meets_piece(&self, piece: &Piece, pose: &Pose, margin: f32) -> bool {
        let margin = margin.max(f32::MIN_POSITIVE);
        self.piece_distance(piece, pose, margin) < margin
    }

    /// Distance of a piece at `pose` from the nearest point's ball, metres: at most `max`, 0 in contact.
    pub fn piece_distance(&self, piece: &Piece, pose: &Pose, max: f32) -> f32 {
        let at = *pose * piece.pose;
        let radius = POINT_RADIUS as f32;
        self.points.iter().fold(max, |best, point| {
            let local = at.inverse_transform_point(*point);
            let out = ((local - piece.center).abs() - piece.half).max(Vector::ZERO);
            if out.length() >= best + radius {
                return best;
            }
            best.min((distance_from_point(&piece.solid, local) - radius).max(0.0))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use grip_sim::shape::{CollisionShape, Convex};
    use nalgebra::Vector3;

    #[test]
    fn a_cylinder_meets_a_wall_of_points_at_its_radius() {
        let wall: Vec<Point3<f64>> =
            (0..400).map(|k| Point3::new(0.5, 0.01 * f64::from(k % 20), 0.01 * f64::from(k / 20))).collect();
        let cloud = Cloud::new(&wall, &Isometry3::identity()).unwrap();
        let shape = CollisionShape {
            pose: Isometry3::identity(),
            geometry: Convex::Cylinder { half_height: 0.1, radius: 0.04 },
        };
        let piece = Piece::new(&shape, &Isometry3::identity()).with_balls(0.01, 8);
        let link = LinkSolids::new(vec![piece], true);
        let at = |x: f64| super::super::solid::pose32(&Isometry3::from(Vector3::new(x, 0.1, 0.1)));
        let touching = 0.5 - 0.04 - POINT_RADIUS;
        for (gap, margin, expected) in [
            (0.001, 0.0, false),
            (-0.001, 0.0, true),
            (0.011, 0.01, false),
            (0.009, 0.01, true),
            (-0.04, 0.0, true),
        ] {
            assert_eq!(cloud.meets(&link, &at(touching - gap), margin), expected, "{gap} {margin}");
        }
        let far = cloud.piece_distance(&link.pieces[0], &at(touching - 0.03), 0.1);
        assert!((far - 0.03).abs() < 1e-5, "{far}");
        assert!(Cloud::new(&[], &Isometry3::identity()).is_none());
    }
}
