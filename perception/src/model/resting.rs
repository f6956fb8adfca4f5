//! The orientations in which an object can rest on a plane: local minima of the height of its centre of mass, each with the
//! share of all orientations that roll into it.
//!
//! A filter draws from these, so the shares matter and a degree does not. (`grip_manip::stable` asks another question: on
//! which facets of the exact hull an object stands, without shares, to put it down flat.)

use grip_sim::mesh::Mesh;
use nalgebra::{Point3, Unit, Vector3};

use crate::hull::{directions, extreme_points};

/// A resting orientation, up to a turn about the vertical.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Resting {
    /// The direction in the object frame that points down.
    pub down: Vector3<f32>,
    /// Height of the object's origin over the plane, metres.
    pub height: f32,
    /// Share of all orientations that roll into this one.
    pub weight: f32,
}

/// Start directions; their shares are the weights.
const STARTS: usize = 400;
/// Resting orientations closer than this are one, radians.
const SAME: f32 = 0.05;
/// Steps of the descent, radians, coarse to fine.
const STEPS: [f32; 7] = [0.2, 0.1, 0.05, 0.02, 0.01, 0.004, 0.0015];

/// Directions in which the hull's points are taken.
const HULL_DIRECTIONS: usize = 400;

/// An orientation in which an object rests on a plane, up to a turn about the vertical.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RestingPose {
    /// The direction in the mesh's frame that points down.
    pub down: Unit<Vector3<f64>>,
    /// Height of the mesh's origin over the plane, metres.
    pub height_m: f64,
    /// Share of all orientations that roll into this one, 0 to 1.
    pub share: f64,
}

/// The orientations in which a mesh with this centre of mass rests on a plane, the commonest first.
pub fn resting_poses(mesh: &Mesh, center_of_mass: &Point3<f64>) -> Vec<RestingPose> {
    let points: Vec<Vector3<f32>> = mesh.positions.iter().map(|p| p.coords).collect();
    if points.is_empty() {
        return Vec::new();
    }
    let hull = extreme_points(&points, HULL_DIRECTIONS);
    let mut poses: Vec<RestingPose> = resting_orientations(&hull, center_of_mass.coords.cast())
        .into_iter()
        .map(|resting| RestingPose {
            down: Unit::new_normalize(resting.down.cast()),
            height_m: f64::from(resting.height),
            share: f64::from(resting.weight),
        })
        .collect();
    poses.sort_by(|a, b| b.share.total_cmp(&a.share));
    poses
}

/// Rolls the hull downhill from evenly spread orientations. `centroid` is the centre of mass in the object frame.
pub(crate) fn resting_orientations(hull: &[Vector3<f32>], centroid: Vector3<f32>) -> Vec<Resting> {
    let reach = |d: &Vector3<f32>, from: &Vector3<f32>| {
        hull.iter().map(|p| (p - from).dot(d)).fold(f32::MIN, f32::max)
    };
    let mut found: Vec<Resting> = Vec::new();
    for start in directions(STARTS) {
        let down = descend(start, |d| reach(d, &centroid));
        match found.iter_mut().find(|r| r.down.dot(&down) > SAME.cos()) {
            Some(same) => same.weight += 1.0 / STARTS as f32,
            None => found.push(Resting {
                down,
                height: reach(&down, &Vector3::zeros()),
                weight: 1.0 / STARTS as f32,
            }),
        }
    }
    found
}

/// Pattern search on the sphere with ever smaller steps.
fn descend(start: Vector3<f32>, height: impl Fn(&Vector3<f32>) -> f32) -> Vector3<f32> {
    let mut at = start;
    let mut best = height(&at);
    for step in STEPS {
        // The number of moves is bounded: half a turn at each step width is more than any descent needs.
        for _ in 0..(3.2 / step) as usize {
            let side = at.cross(&if at.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() }).normalize();
            let other = at.cross(&side);
            let next = (0..8)
                .map(|i| {
                    let (sin, cos) = (i as f32 * std::f32::consts::FRAC_PI_4).sin_cos();
                    (at + (side * cos + other * sin) * step).normalize()
                })
                .map(|d| (height(&d), d))
                .min_by(|a, b| a.0.total_cmp(&b.0));
            match next {
                Some((h, d)) if h < best => (best, at) = (h, d),
                _ => break,
            }
        }
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_rests_on_its_six_faces_mostly_the_large_ones() {
        let half = Vector3::new(0.03f32, 0.08, 0.1);
        let hull: Vec<_> = (0..8)
            .map(|i| {
                let sign = |b: i32| if i >> b & 1 == 1 { 1.0 } else { -1.0 };
                half.component_mul(&Vector3::new(sign(0), sign(1), sign(2)))
            })
            .collect();
        let found = resting_orientations(&hull, Vector3::zeros());
        assert_eq!(found.len(), 6, "{found:?}");
        for r in &found {
            let axis = r.down.iamax();
            assert!(r.down[axis].abs() > 0.05f32.cos(), "{r:?}");
            assert!((r.height - half[axis]).abs() < 0.002, "{r:?}");
            if axis == 0 {
                assert!(r.weight > 0.25, "{r:?}");
            }
        }
    }
}
