//! Procedural pictures for table, floor, walls and bin: made in code, the same on every machine, tiling in both directions.
//!
//! All are sRGB and square. Those of the `laboratory` are [`SIZE`] pixels wide, each with the metres that one repeat
//! is meant to cover. A [`Family`] draws any number of different ones from a seed.

mod canvas;
mod cardboard;
mod checker;
mod cloth;
mod clutter;
mod colors;
mod laboratory;
mod metal;
mod noise;
mod plain;
mod plaster;
mod print;
mod stone;
mod tiles;
mod wood;

use image::RgbImage;
use rand::RngExt;

pub use self::laboratory::{cardboard, cloth, floor, wall, wood};
use crate::rng;

/// Width and height of the laboratory's pictures, pixels.
pub const SIZE: u32 = 1024;

/// A kind of surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Family {
    /// Planks of nine woods, oiled or painted.
    Wood,
    /// Laminate or paint in any colour, even or with faint speckles.
    Plain,
    /// Woven: one colour, striped, gingham, tartan or dotted.
    Cloth,
    /// Squares of two colours, upright or on their corners.
    Checker,
    /// Glazed tiles with grout, in rows or running bond.
    Tiles,
    /// Marble, granite or terrazzo.
    Stone,
    /// Plaster, concrete or wall paint.
    Plaster,
    /// Bricks in running bond.
    Brick,
    /// Carpet of loops.
    Carpet,
    /// Corrugated cardboard, brown to white.
    Cardboard,
    /// Smooth coloured plastic.
    Plastic,
    /// Brushed, rolled or galvanised sheet.
    Metal,
    /// Posters and newspaper pages, overlapping.
    Print,
    /// Shapes, gradients, strokes and letters, overlapping: looks like nothing, to distract.
    Clutter,
}

/// A surface drawn from a [`Family`].
#[derive(Debug, Clone)]
pub struct Swatch {
    /// One repeat, sRGB.
    pub image: RgbImage,
    /// What one repeat covers in the world, metres.
    pub metres: f64,
    /// GGX roughness, 0.15 to 0.95.
    pub roughness: f32,
    /// 0 for dielectrics, 1 for metal.
    pub metallic: f32,
}

impl Family {
    /// All of them.
    pub const ALL: [Self; 14] = [
        Self::Wood,
        Self::Plain,
        Self::Cloth,
        Self::Checker,
        Self::Tiles,
        Self::Stone,
        Self::Plaster,
        Self::Brick,
        Self::Carpet,
        Self::Cardboard,
        Self::Plastic,
        Self::Metal,
        Self::Print,
        Self::Clutter,
    ];

    /// Lower-case name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Wood => "wood",
            Self::Plain => "plain",
            Self::Cloth => "cloth",
            Self::Checker => "checker",
            Self::Tiles => "tiles",
            Self::Stone => "stone",
            Self::Plaster => "plaster",
            Self::Brick => "brick",
            Self::Carpet => "carpet",
            Self::Cardboard => "cardboard",
            Self::Plastic => "plastic",
            Self::Metal => "metal",
            Self::Print => "print",
            Self::Clutter => "clutter",
        }
    }

    /// One repeat of `size` pixels square, 16 to 4096 (others are clipped to that); the pattern does not depend on the
    /// size, but what is finer than a pixel is lost. Same seed and size, same picture, on any number of threads.
    pub fn draw(self, seed: u64, size: u32) -> Swatch {
        let size = size.clamp(16, 4096);
        let rng = &mut rng::stream(seed, &format!("texture/{}", self.name()));
        let (image, metres, roughness, metallic) = match self {
            Self::Wood => (wood::draw(size, rng), 0.8, 0.3..0.75, 0.0),
            Self::Plain => (plain::laminate(size, rng), 0.6, 0.2..0.8, 0.0),
            Self::Cloth => (cloth::cloth(size, rng), 0.4, 0.8..0.95, 0.0),
            Self::Checker => (checker::draw(size, rng), 0.5, 0.2..0.8, 0.0),
            Self::Tiles => (tiles::tiles(size, rng), 0.9, 0.15..0.5, 0.0),
            Self::Stone => (stone::draw(size, rng), 0.5, 0.15..0.6, 0.0),
            Self::Plaster => (plaster::draw(size, rng), 1.5, 0.7..0.95, 0.0),
            Self::Brick => (tiles::brick(size, rng), 0.9, 0.75..0.95, 0.0),
            Self::Carpet => (cloth::carpet(size, rng), 0.6, 0.85..0.95, 0.0),
            Self::Cardboard => (cardboard::draw(size, rng), 0.4, 0.75..0.95, 0.0),
            Self::Plastic => (plain::plastic(size, rng), 0.5, 0.15..0.5, 0.0),
            Self::Metal => (metal::draw(size, rng), 0.6, 0.25..0.6, 1.0),
            Self::Print => (print::draw(size, rng), 1.0, 0.3..0.9, 0.0),
            Self::Clutter => (clutter::draw(size, rng), 0.8, 0.2..0.9, 0.0),
        };
        Swatch { image, metres, roughness: rng.random_range(roughness), metallic }
    }
}

#[cfg(test)]
mod tests;
