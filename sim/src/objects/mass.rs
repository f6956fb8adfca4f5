//! Volume, centre of mass and moments of inertia of the solid that a closed mesh bounds.

use nalgebra::{Matrix3, Point3, Vector3};
use parry3d::math::Vector;
use parry3d::transformation::try_convex_hull;

use crate::mesh::Mesh;

/// What has less is flat, cubic metres: a cubic tenth of a millimetre.
const LEAST_VOLUME: f64 = 1e-12;

/// Of a solid of uniform density.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SolidMass {
    /// Cubic metres.
    pub volume_m3: f64,
    /// Centre of mass in the mesh's frame, metres.
    pub center: Point3<f64>,
    /// Moments of inertia about the centre of mass along the mesh's axes, of a kilogram of it, square metres: times the mass it is the
    /// tensor in kg m2.
    pub inertia_per_kg: Matrix3<f64>,
}

/// What a closed mesh bounds: the sum over its triangles of the tetrahedra that they make with the origin, signed, each in closed
/// form. `None` where that has no volume.
pub fn solid_mass(mesh: &Mesh) -> Option<SolidMass> {
    let (mut volume, mut first, mut second) = (0.0, Vector3::zeros(), Matrix3::zeros());
    // About a point near the solid, so that a mesh far from its origin loses no digits.
    let (low, high) = mesh.bounds()?;
    let near = nalgebra::center(&low, &high);
    for triangle in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(triangle).map(|p| p - near);
        let sixth = a.dot(&b.cross(&c)) / 6.0;
        volume += sixth;
        first += sixth / 4.0 * (a + b + c);
        // The integral of x x^T over a tetrahedron with one corner at the origin (Tonon 2004).
        let sum = a + b + c;
        let squares = a * a.transpose() + b * b.transpose() + c * c.transpose();
        second += sixth / 20.0 * (squares + sum * sum.transpose());
    }
    if volume <= LEAST_VOLUME || !volume.is_finite() {
        return None;
    }
    let center = first / volume;
    let spread = second / volume - center * center.transpose();
    let inertia_per_kg = Matrix3::identity() * spread.trace() - spread;
    Some(SolidMass { volume_m3: volume, center: near + center, inertia_per_kg })
}

/// The convex hull of a mesh; `None` for a flat one.
pub fn hull(mesh: &Mesh) -> Option<Mesh> {
    let points: Vec<Vector> = mesh.positions.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
    let (points, triangles) = try_convex_hull(&points).ok()?;
    let positions = points.iter().map(|p| Point3::new(p.x, p.y, p.z)).collect();
    let hull = Mesh { positions, triangles, ..Mesh::default() };
    (hull.volume() > LEAST_VOLUME).then_some(hull)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn near(value: f64, wanted: f64, share: f64) {
        assert!((value - wanted).abs() <= share * wanted.abs().max(1e-9), "{value} is not {wanted}");
    }

    /// A closed surface over a grid that wraps around in both directions.
    fn wrapped(rows: u32, columns: u32, at: impl Fn(f64, f64) -> [f64; 3]) -> Mesh {
        let positions = (0..rows * columns).map(|i| {
            let [x, y, z] = at(
                TAU * f64::from(i / columns) / f64::from(rows),
                TAU * f64::from(i % columns) / f64::from(columns),
            );
            Point3::new(x as f32, y as f32, z as f32)
        });
        let corner = |r: u32, c: u32| r % rows * columns + c % columns;
        let triangles = (0..rows).flat_map(|r| (0..columns).map(move |c| (r, c))).flat_map(|(r, c)| {
            let [a, b, d, e] = [corner(r, c), corner(r + 1, c), corner(r, c + 1), corner(r + 1, c + 1)];
            [[a, b, e], [a, e, d]]
        });
        Mesh { positions: positions.collect(), triangles: triangles.collect(), ..Mesh::default() }
    }

    #[test]
    fn a_torus_has_its_closed_forms_wherever_it_lies() {
        let (big, small) = (0.05, 0.02);
        let mesh = wrapped(400, 200, |u, v| {
            let r = big + small * v.cos();
            [0.7 + r * u.cos(), -0.4 + r * u.sin(), 0.9 + small * v.sin()]
        });
        let found = solid_mass(&mesh).unwrap();
        // Pappus: 2 pi R times pi r^2.
        near(found.volume_m3, TAU * big * std::f64::consts::PI * small * small, 5e-4);
        assert!((found.center - Point3::new(0.7, -0.4, 0.9)).norm() < 1e-6);
        let (axial, other) = (big * big + 0.75 * small * small, 0.5 * big * big + 0.625 * small * small);
        for (i, wanted) in [other, other, axial].into_iter().enumerate() {
            near(found.inertia_per_kg[(i, i)], wanted, 1e-3);
        }
        assert!(found.inertia_per_kg[(0, 2)].abs() < 1e-7);
        assert!(hull(&mesh).is_some_and(|hull| hull.volume() > 1.2 * found.volume_m3));
    }

    #[test]
    fn what_is_flat_or_open_all_over_has_none() {
        assert_eq!(solid_mass(&Mesh::default()), None);
        let flat = Mesh {
            positions: vec![[0.0; 3].into(), [1.0, 0.0, 0.0].into(), [0.0, 1.0, 0.0].into()],
            triangles: vec![[0, 1, 2]],
            ..Mesh::default()
        };
        assert_eq!(solid_mass(&flat), None);
        assert!(hull(&flat).is_none());
    }
}
