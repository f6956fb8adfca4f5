//! Orientations in which an object can stand: quasi-static, from its convex hull.
//!
//! An object at rest on a plane lies on a facet of its convex hull above which its centre of mass is; on all others it tips
//! over (Goldberg et al. 1999).

use grip_sim::mesh::Mesh;
use nalgebra::{Point3, Unit, UnitQuaternion, Vector3};
use parry3d::math::Vector;
use parry3d::transformation::try_convex_hull;

use crate::surface::Surface;

/// Facets smaller than this are edges and corners that the tessellation cut, square metres.
const LEAST_AREA: f64 = 2e-6;

/// The outward normals, in the mesh's frame, of the facets on which it can stand: down, when it does.
pub fn stable_facets(mesh: &Mesh) -> Vec<Unit<Vector3<f64>>> {
    let Some(surface) = Surface::new(mesh) else {
        return Vec::new();
    };
    let points: Vec<Vector> = mesh.positions.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
    let Ok((points, facets)) = try_convex_hull(&points) else {
        return Vec::new();
    };
    let at = |i: u32| {
        let p = points[i as usize];
        Point3::new(f64::from(p.x), f64::from(p.y), f64::from(p.z))
    };
    facets
        .iter()
        .filter_map(|facet| {
            let [a, b, c] = facet.map(at);
            let cross = (b - a).cross(&(c - a));
            let normal = Unit::try_new(cross, 2.0 * LEAST_AREA)?;
            // The centre of mass, moved along the normal, falls inside the triangle.
            let foot = surface.center_of_mass;
            let inside =
                [(a, b), (b, c), (c, a)].iter().all(|(p, q)| (q - p).cross(&(foot - p)).dot(&cross) >= 0.0);
            inside.then_some(normal)
        })
        .collect()
}

/// The orientation nearest to `now` in which an object with these facets stands, heading kept; `now` itself without facets.
pub fn nearest_standing(facets: &[Unit<Vector3<f64>>], now: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    let down = -Vector3::z();
    let lowest = facets
        .iter()
        .map(|normal| now * normal.into_inner())
        .min_by(|a, b| a.angle(&down).total_cmp(&b.angle(&down)));
    match lowest {
        Some(normal) => {
            let upright = UnitQuaternion::rotation_between(&normal, &down)
                .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
            upright * now
        }
        None => *now,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{box_model, cylinder_model};

    #[test]
    fn a_box_stands_on_its_six_sides_and_a_can_on_both_ends_and_all_round() {
        let facets = stable_facets(&box_model("box", [0.1, 0.06, 0.2]).visual.mesh);
        let along = |axis: Vector3<f64>| facets.iter().filter(|n| n.dot(&axis).abs() > 0.999).count();
        // A centre above the diagonal falls into one of the two triangles of a side, or on the edge of both.
        assert!((6..=12).contains(&facets.len()));
        assert!([Vector3::x(), Vector3::y(), Vector3::z()].iter().all(|axis| along(*axis) >= 2));
        let facets = stable_facets(&cylinder_model("can", 0.03, 0.1).visual.mesh);
        let side = facets.iter().filter(|n| n.z.abs() < 1e-3).count();
        assert!(side >= 40, "{side}");
        assert!(facets.iter().all(|n| n.z.abs() < 1e-3 || n.z.abs() > 0.999));
    }

    #[test]
    fn a_leaning_object_is_put_down_on_the_side_it_nearly_lies_on() {
        let facets = stable_facets(&box_model("box", [0.1, 0.06, 0.2]).visual.mesh);
        let leaning = UnitQuaternion::from_euler_angles(0.3, -0.2, 0.7);
        let standing = nearest_standing(&facets, &leaning);
        assert!(((standing * Vector3::z()).z - 1.0).abs() < 1e-6);
        assert!(leaning.angle_to(&standing) < 0.4);
        let level = UnitQuaternion::from_euler_angles(0.0, 0.0, 1.1);
        assert!(nearest_standing(&facets, &level).angle_to(&level) < 1e-6);
    }
}
