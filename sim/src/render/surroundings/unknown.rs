//! Things among the objects that nobody has a model of: boxes, books, tins and bottles in looks of their own.

use nalgebra::{Isometry3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::look::{Look, Odds};
use super::solids::{cuboid, cylinder};
use crate::mesh::{Mesh, Visual};
use crate::objects::{Fragility, ObjectInfo, ObjectModel};
use crate::render::textures::Family::*;
use crate::shape::{CollisionShape, Convex};

/// What they are made of.
const ODDS: &Odds = &[
    (Print, 24),
    (Clutter, 22),
    (Plastic, 16),
    (Cardboard, 12),
    (Plain, 10),
    (Metal, 8),
    (Cloth, 4),
    (Wood, 4),
];
/// Width of their pictures, pixels.
const SIDE_PX: u32 = 256;
/// Kilograms a cubic metre, of half-filled packages; and the least mass, kilograms.
const DENSITY: f64 = 350.0;
const LIGHTEST_KG: f64 = 0.02;

/// One of them. Its `bop_id` is 0: it is in no table and in no file.
pub fn unknown_object(number: usize, rng: &mut ChaCha8Rng) -> ObjectModel {
    let solids = draw(rng);
    // A print is about as large as what it is on.
    let look = Look::drawn(ODDS, 0.15..0.6, SIDE_PX, rng);
    let mut mesh = Mesh::default();
    let mut volume = 0.0;
    for shape in &solids {
        let (part, filled) = match shape.geometry {
            Convex::Cylinder { half_height, radius } => (
                cylinder(radius, half_height, look.metres()),
                2.0 * half_height * std::f64::consts::PI * radius * radius,
            ),
            Convex::Cuboid { half } => (cuboid(half, look.metres()), 8.0 * half.product()),
            _ => continue,
        };
        volume += filled;
        let first = mesh.positions.len() as u32;
        let moved = shape.pose.translation.vector.cast::<f32>();
        mesh.positions.extend(part.positions.iter().map(|p| p + moved));
        mesh.normals.extend(part.normals);
        mesh.uvs.extend(part.uvs);
        mesh.triangles.extend(part.triangles.iter().map(|t| t.map(|i| first + i)));
    }
    let info = ObjectInfo {
        name: format!("unknown_{number}"),
        bop_id: 0,
        mass_kg: (DENSITY * volume).max(LIGHTEST_KG),
        friction: 0.6,
        symmetric: false,
        fragility: Fragility::Sturdy,
        upright: false,
        revolution: None,
        half_turns: Vec::new(),
    };
    ObjectModel::new(info, Visual { mesh: mesh.into(), material: look.material().clone() }, solids)
}

/// One or two solids about the origin, of the size of groceries.
fn draw(rng: &mut ChaCha8Rng) -> Vec<CollisionShape> {
    let kind: f64 = rng.random();
    let mut between = |low: f64, high: f64| rng.random_range(low..high);
    let along_z = |z: f64, geometry| CollisionShape { pose: Isometry3::translation(0.0, 0.0, z), geometry };
    if kind < 0.4 {
        let half = Vector3::new(between(0.015, 0.05), between(0.03, 0.09), between(0.03, 0.11));
        return vec![along_z(0.0, Convex::Cuboid { half })];
    }
    if kind < 0.5 {
        // A book, lying.
        let half = Vector3::new(between(0.06, 0.12), between(0.05, 0.09), between(0.006, 0.02));
        return vec![along_z(0.0, Convex::Cuboid { half })];
    }
    let (radius, half_height) = (between(0.02, 0.05), between(0.02, 0.08));
    let body = Convex::Cylinder { half_height, radius };
    if kind < 0.75 {
        return vec![along_z(0.0, body)];
    }
    // A bottle: the neck stands on the body.
    let top = between(0.01, 0.035);
    let neck = Convex::Cylinder { half_height: top, radius: radius * between(0.3, 0.6) };
    vec![along_z(-top, body), along_z(half_height, neck)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng;

    #[test]
    fn they_are_sound_small_and_all_different() {
        let mut sizes = Vec::new();
        for seed in 0..100 {
            let thing = unknown_object(seed, &mut rng::stream(seed as u64, "unknown"));
            let mesh = &thing.visual.mesh;
            mesh.validate().unwrap();
            assert!(thing.size().max() < 0.3 && thing.size().min() > 0.01, "{:?}", thing.size());
            assert!((0.02..2.0).contains(&thing.info.mass_kg), "{}", thing.info.mass_kg);
            // The mesh is what physics has.
            let solid: f64 = thing
                .collision
                .iter()
                .map(|shape| match shape.geometry {
                    Convex::Cuboid { half } => 8.0 * half.product(),
                    // 32 sides.
                    Convex::Cylinder { half_height, radius } => {
                        32.0 * half_height * radius * radius * (std::f64::consts::TAU / 32.0).sin()
                    }
                    _ => panic!("{shape:?}"),
                })
                .sum();
            assert!((mesh.volume() / solid - 1.0).abs() < 1e-3, "{} {solid}", mesh.volume());
            sizes.push((thing.size().norm() * 1e9) as u64);
        }
        sizes.sort_unstable();
        sizes.dedup();
        assert_eq!(sizes.len(), 100);
    }
}
