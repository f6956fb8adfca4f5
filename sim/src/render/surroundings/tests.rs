//! The laboratory stays what it was; varied surroundings repeat by seed and keep the solids.

use std::collections::HashSet;

use image::RgbImage;
use nalgebra::{Isometry3, Vector3};

use super::look::Look;
use super::*;
use crate::render::textures;
use crate::scene::{BinKind, FixtureKind};
use crate::shape::{CollisionShape, Convex};

fn fixtures() -> Vec<Fixture> {
    let block = |kind, center: [f64; 3], half: [f64; 3]| Fixture {
        kind,
        shape: CollisionShape {
            pose: Isometry3::translation(center[0], center[1], center[2]),
            geometry: Convex::Cuboid { half: Vector3::from(half) },
        },
        friction: 0.5,
    };
    vec![
        block(FixtureKind::TableTop, [0.64, -0.05, 0.63], [0.3, 0.6, 0.02]),
        block(FixtureKind::TableLeg, [0.4, -0.5, 0.3], [0.03, 0.03, 0.3]),
        block(FixtureKind::Bin(BinKind::Carton), [0.52, -0.42, 0.66], [0.15, 0.2, 0.01]),
    ]
}

fn same(a: &Furniture, b: &Furniture) -> bool {
    a.table_albedo == b.table_albedo
        && a.drawn.len() == b.drawn.len()
        && a.drawn.iter().zip(&b.drawn).all(|((pose_a, a), (pose_b, b))| {
            pose_a == pose_b
                && a.mesh.positions == b.mesh.positions
                && a.mesh.uvs == b.mesh.uvs
                && a.material.roughness == b.material.roughness
                && a.material.texture == b.material.texture
        })
}

#[test]
fn the_laboratory_is_what_it_always_was() {
    let room = furniture(&fixtures(), Surroundings::default(), 3);
    let looks: Vec<_> =
        room.drawn.iter().map(|(_, v)| (v.material.roughness, v.material.texture.is_some())).collect();
    assert_eq!(looks, [(0.55, true), (0.5, false), (0.9, true), (0.6, true), (0.95, true)]);
    assert_eq!(room.drawn[0].1.material.texture.as_deref(), Some(&textures::wood(3)));
    assert_eq!(room.drawn[3].1.material.texture.as_deref(), Some(&textures::floor(3)));
    assert_eq!(room.drawn[1].1.material.base_color, [0.32, 0.33, 0.35]);
    assert_eq!(room.drawn[4].0.translation.vector, Vector3::new(4.5, 0.0, 1.5));
    // The table's long side, 1.2 m, shows one and a half repeats of wood.
    let widest = room.drawn[0].1.mesh.uvs.iter().map(|uv| uv[0]).fold(0.0, f32::max);
    assert!((widest - 1.5).abs() < 1e-6);
}

#[test]
fn varied_surroundings_are_the_seeds_on_any_number_of_threads() {
    let draw = |threads, seed| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| furniture(&fixtures(), Surroundings::Varied, seed))
    };
    let (one, three, other) = (draw(1, 7), draw(3, 7), draw(1, 8));
    assert!(same(&one, &three));
    assert!(!same(&one, &other));
    // The solids are where the physics has them, in both.
    for (drawn, fixture) in one.drawn.iter().zip(fixtures()) {
        assert_eq!(drawn.0, fixture.shape.pose);
    }
}

#[test]
fn tables_differ_in_colour_gloss_and_scale() {
    let mut roughness = HashSet::new();
    let (mut darkest, mut brightest) = (1.0_f32, 0.0_f32);
    for seed in 0..12 {
        let room = furniture(&fixtures(), Surroundings::Varied, seed);
        let table = &room.drawn[0].1.material;
        roughness.insert((table.roughness * 20.0) as i32);
        darkest = darkest.min(room.table_albedo[1]);
        brightest = brightest.max(room.table_albedo[1]);
        assert!(room.table_albedo.iter().all(|a| (0.0..1.0).contains(a)), "{:?}", room.table_albedo);
        assert!((0.15..=0.95).contains(&table.roughness));
    }
    assert!(roughness.len() >= 4, "{roughness:?}");
    assert!(brightest > 2.0 * darkest, "{darkest} {brightest}");
}

#[test]
fn albedo_is_the_mean_in_linear_light() {
    let checker = RgbImage::from_fn(8, 8, |x, y| image::Rgb([255 * ((x + y) % 2) as u8, 0, 255]));
    let albedo = Look::textured(checker, 1.0, 0.5).albedo();
    for (a, expected) in albedo.into_iter().zip([0.5, 0.0, 1.0]) {
        assert!((a - expected).abs() < 1e-6, "{albedo:?}");
    }
    assert_eq!(furniture(&[], Surroundings::Laboratory, 1).table_albedo, [0.0; 3]);
}
