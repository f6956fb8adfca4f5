//! What a part of the surroundings is made of.

use std::sync::Arc;

use image::RgbImage;
use nalgebra::{Point3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::solids::{cuboid, cylinder, hull};
use crate::mesh::{Material, Visual};
use crate::render::srgb::{LINEAR_OF_8BIT, color_to_linear};
use crate::render::textures::Family;

/// Families and their shares, per cent.
pub(super) type Odds = [(Family, u32)];

/// What a part is made of.
#[derive(Debug, Clone)]
pub(super) struct Look {
    material: Material,
    /// Metres that one repeat of the texture covers.
    metres: f64,
}

impl Look {
    pub fn textured(texture: RgbImage, metres: f64, roughness: f32) -> Self {
        let texture = Some(Arc::new(texture));
        Self { material: Material { base_color: [1.0; 3], roughness, metallic: 0.0, texture }, metres }
    }

    pub fn plain(base_color: [f32; 3], roughness: f32) -> Self {
        Self { material: Material { base_color, roughness, metallic: 0.0, texture: None }, metres: 1.0 }
    }

    /// Metres that one repeat of the texture covers.
    pub fn metres(&self) -> f64 {
        self.metres
    }

    pub fn material(&self) -> &Material {
        &self.material
    }

    /// A box of this look.
    pub fn cuboid(&self, half: Vector3<f64>) -> Arc<Visual> {
        Arc::new(Visual { mesh: Arc::new(cuboid(half, self.metres)), material: self.material.clone() })
    }

    /// The convex hull of `points` in this look.
    pub fn hull(&self, points: &[Point3<f64>]) -> Arc<Visual> {
        Arc::new(Visual { mesh: Arc::new(hull(points, self.metres)), material: self.material.clone() })
    }

    /// A cylinder of this look, its axis along z.
    pub fn cylinder(&self, radius: f64, half_height: f64) -> Arc<Visual> {
        let mesh = cylinder(radius, half_height, self.metres);
        Arc::new(Visual { mesh: Arc::new(mesh), material: self.material.clone() })
    }

    /// Mean linear reflectance.
    pub fn albedo(&self) -> [f32; 3] {
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

    /// A look by `odds`, its repeat `scale` times as large as is natural, its picture `size` pixels wide.
    pub fn drawn(odds: &Odds, scale: std::ops::Range<f64>, size: u32, rng: &mut ChaCha8Rng) -> Self {
        let mut left = rng.random_range(0..odds.iter().map(|(_, share)| share).sum());
        let family = odds.iter().find(|(_, share)| {
            let found = left < *share;
            left = left.saturating_sub(*share);
            found
        });
        let swatch = family.map_or(Family::Plain, |(family, _)| *family).draw(rng.random(), size);
        // Even in the logarithm: half as large is as likely as twice as large.
        let metres = swatch.metres * rng.random_range(scale.start.ln()..scale.end.ln()).exp();
        let material = Material {
            base_color: [1.0; 3],
            roughness: swatch.roughness,
            metallic: swatch.metallic,
            texture: Some(swatch.image.into()),
        };
        Self { material, metres }
    }
}
