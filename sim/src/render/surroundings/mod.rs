//! What stands about the objects: table, bin, floor, wall, and things in the distance, as things to draw.

mod distractors;
mod solids;
mod varied;

use std::sync::Arc;

use image::RgbImage;
use nalgebra::{Isometry3, Translation3, Vector3};
use serde::{Deserialize, Serialize};

use self::solids::cuboid;
use super::srgb::{LINEAR_OF_8BIT, color_to_linear};
use super::textures;
use crate::mesh::{Material, Visual};
use crate::scene::{Fixture, FixtureKind};
use crate::shape::Convex;

/// How the surroundings look. What is solid, and where, is the same in both.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Surroundings {
    /// A beech table, a cardboard bin, grey linoleum, white plaster. The seed varies the wood's grain only.
    #[default]
    Laboratory,
    /// Every part of any material, colour, scale and gloss, and other things behind and beside the table, all drawn from
    /// the seed: so that what is learnt from pictures is not the background.
    Varied,
}

/// Surroundings, ready to draw.
#[derive(Debug, Clone, Default)]
pub struct Furniture {
    /// Meshes and the world pose of each.
    pub drawn: Vec<(Isometry3<f64>, Arc<Visual>)>,
    /// Mean linear RGB reflectance of the table's top, 0 to 1: the colour of the light that it casts on what stands on
    /// it. Zero when there is no table.
    pub table_albedo: [f32; 3],
}

/// Metres that one repeat of a laboratory texture covers.
const WOOD_M: f64 = 0.8;
const CARDBOARD_M: f64 = 0.4;
const WALL_M: f64 = 2.0;
const FLOOR_M: f64 = 1.0;
/// The floor is drawn this far in each direction, and the laboratory's wall stands this far ahead, metres.
const ROOM_M: f64 = 4.0;
/// The room's middle is this far ahead of the origin, metres.
const ROOM_X: f64 = 0.5;

/// The scene's fixtures, a floor, a wall behind the table and, when varied, distractors. The same for the same seed.
pub fn furniture(fixtures: &[Fixture], surroundings: Surroundings, seed: u64) -> Furniture {
    match surroundings {
        Surroundings::Laboratory => laboratory(fixtures, seed),
        Surroundings::Varied => varied::furniture(fixtures, seed),
    }
}

/// What a part is made of.
#[derive(Debug, Clone)]
struct Look {
    material: Material,
    /// Metres that one repeat of the texture covers.
    metres: f64,
}

impl Look {
    fn textured(texture: RgbImage, metres: f64, roughness: f32) -> Self {
        let texture = Some(Arc::new(texture));
        Self { material: Material { base_color: [1.0; 3], roughness, metallic: 0.0, texture }, metres }
    }

    fn plain(base_color: [f32; 3], roughness: f32) -> Self {
        Self { material: Material { base_color, roughness, metallic: 0.0, texture: None }, metres: 1.0 }
    }

    /// A box of this look.
    fn cuboid(&self, half: Vector3<f64>) -> Arc<Visual> {
        Arc::new(Visual { mesh: Arc::new(cuboid(half, self.metres)), material: self.material.clone() })
    }

    /// A cylinder of this look, its axis along z.
    fn cylinder(&self, radius: f64, half_height: f64) -> Arc<Visual> {
        let mesh = solids::cylinder(radius, half_height, self.metres);
        Arc::new(Visual { mesh: Arc::new(mesh), material: self.material.clone() })
    }

    /// Mean linear reflectance.
    fn albedo(&self) -> [f32; 3] {
        let base = color_to_linear(self.material.base_color);
        let Some(texture) = &self.material.texture else { return base };
        let mut sum = [0.0_f64; 3];
        for pixel in texture.pixels() {
            for (sum, code) in sum.iter_mut().zip(pixel.0) {
                *sum += f64::from(LINEAR_OF_8BIT[code as usize]);
            }
        }
        let count = f64::from((texture.width() * texture.height()).max(1));
        std::array::from_fn(|c| base[c] * (sum[c] / count) as f32)
    }
}

/// The looks of all parts.
struct Parts {
    table: Look,
    legs: Look,
    stand: Look,
    /// Carton, crate, tote and bag, in the order of [`BinKind`].
    bins: [Look; 4],
    floor: Look,
    wall: Look,
    /// Where the wall's face stands, metres along x.
    wall_x: f64,
}

/// Each fixture in its look; floor and wall.
fn assemble(fixtures: &[Fixture], parts: &Parts) -> Furniture {
    let mut furniture = Furniture::default();
    for fixture in fixtures {
        let Convex::Cuboid { half } = &fixture.shape.geometry else { continue };
        let look = match fixture.kind {
            FixtureKind::TableTop => &parts.table,
            FixtureKind::Bin(kind) => &parts.bins[kind as usize],
            FixtureKind::TableLeg => &parts.legs,
            FixtureKind::Stand => &parts.stand,
        };
        if fixture.kind == FixtureKind::TableTop {
            furniture.table_albedo = parts.table.albedo();
        }
        furniture.drawn.push((fixture.shape.pose, look.cuboid(*half)));
    }
    let floor = parts.floor.cuboid(Vector3::new(ROOM_M, ROOM_M, 0.01));
    furniture.drawn.push((Isometry3::from(Translation3::new(ROOM_X, 0.0, -0.01)), floor));
    let wall = parts.wall.cuboid(Vector3::new(0.01, ROOM_M, 1.5));
    furniture.drawn.push((Isometry3::from(Translation3::new(parts.wall_x, 0.0, 1.5)), wall));
    furniture
}

fn laboratory(fixtures: &[Fixture], seed: u64) -> Furniture {
    let steel = Look::plain([0.32, 0.33, 0.35], 0.5);
    let parts = Parts {
        table: Look::textured(textures::wood(seed as u32), WOOD_M, 0.55),
        legs: steel.clone(),
        stand: steel,
        bins: [
            Look::textured(textures::cardboard(), CARDBOARD_M, 0.9),
            Look::textured(textures::wood(seed as u32 ^ 1), WOOD_M, 0.8),
            Look::plain([0.06, 0.14, 0.34], 0.35),
            Look::plain([0.46, 0.32, 0.19], 0.95),
        ],
        floor: Look::textured(textures::floor(seed as u32), FLOOR_M, 0.6),
        wall: Look::textured(textures::wall(), WALL_M, 0.95),
        wall_x: ROOM_X + ROOM_M,
    };
    assemble(fixtures, &parts)
}

#[cfg(test)]
mod tests;
