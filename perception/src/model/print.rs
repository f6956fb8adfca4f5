//! What is printed on an object: its surface as points with a colour each.

use std::collections::BTreeMap;

use grip_sim::mesh::{Mesh, Visual};
use grip_sim::rng;
use nalgebra::{Point3, Vector3};

/// Points an object has, about. Half of them face the camera; an object is some 100 pixels across, so that each stands for
/// a few pixels.
const POINTS: usize = 4000;
/// Places where the print is read for each point: what the camera sees at this distance is their mean.
const READINGS: usize = 16;
/// Print that varies by less is none: root mean square of the log of colour, by channel.
const PLAIN: f32 = 0.08;
/// Added to colours before the logarithm, so that near-black is not infinitely different from black.
const DARK: f32 = 0.05;

/// A small piece of the surface.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PrintedPoint {
    /// Object frame, metres.
    pub position: Vector3<f32>,
    /// Outward, unit length.
    pub normal: Vector3<f32>,
    /// Linear RGB, 0 to 1.
    pub colour: [f32; 3],
}

/// The printed surface of an object.
#[derive(Debug)]
pub(crate) struct Print {
    /// Spread evenly.
    pub points: Vec<PrintedPoint>,
    /// Distance between neighbours, metres.
    pub spacing: f32,
}

impl Print {
    /// Of this model; `None` where it is of one colour, or has no surface.
    pub fn new(visual: &Visual) -> Option<Self> {
        let mesh = &visual.mesh;
        let area: f64 = (0..mesh.triangles.len()).map(|t| facet(mesh, t).norm() / 2.0).sum();
        let spacing = (area / POINTS as f64).sqrt();
        if !(spacing > 0.0 && spacing.is_finite()) {
            return None;
        }
        let outward = if mesh.volume() < 0.0 { -1.0 } else { 1.0 };
        // Readings fall into cubes, and by the side of the cube that they face: two walls of a thin body are two points.
        let mut cubes: BTreeMap<[i32; 4], (usize, PrintedPoint)> = BTreeMap::new();
        for (at, t) in mesh.sample_surface_indexed(POINTS * READINGS, &mut rng::stream(0, "looks")) {
            let Some(normal) = (facet(mesh, t) * outward).try_normalize(0.0) else { continue };
            let side = normal.iamax();
            let [x, y, z] = [at.x, at.y, at.z].map(|c| (c / spacing).floor() as i32);
            let facing = 2 * side as i32 + i32::from(normal[side] > 0.0);
            let colour = colour(visual, t, &at);
            let zero =
                PrintedPoint { position: Vector3::zeros(), normal: Vector3::zeros(), colour: [0.0; 3] };
            let (count, sum) = cubes.entry([x, y, z, facing]).or_insert((0, zero));
            *count += 1;
            sum.position += at.coords.cast::<f32>();
            sum.normal += normal.cast::<f32>();
            for (s, c) in sum.colour.iter_mut().zip(colour) {
                *s += c;
            }
        }
        // A cube that the surface only grazes would stand for a corner of itself.
        let full = cubes.into_values().filter(|(count, _)| *count >= READINGS / 4);
        let points: Vec<PrintedPoint> = full
            .filter_map(|(count, sum)| {
                let n = count as f32;
                let normal = sum.normal.try_normalize(0.0)?;
                Some(PrintedPoint { position: sum.position / n, normal, colour: sum.colour.map(|c| c / n) })
            })
            .collect();
        (variation(&points) >= PLAIN).then_some(Self { points, spacing: spacing as f32 })
    }
}

/// Root mean square deviation of the log of the channels from their means.
fn variation(points: &[PrintedPoint]) -> f32 {
    let n = points.len().max(1) as f32;
    let variance = |channel: usize| {
        let logs = || points.iter().map(|p| (p.colour[channel] + DARK).ln());
        let mean = logs().sum::<f32>() / n;
        logs().map(|l| (l - mean).powi(2)).sum::<f32>() / n
    };
    [0, 1, 2].map(variance).into_iter().fold(0.0, f32::max).sqrt()
}

/// Normal of a triangle, twice its area long.
fn facet(mesh: &Mesh, triangle: usize) -> Vector3<f64> {
    let [a, b, c] = mesh.corners(triangle);
    (b - a).cross(&(c - a))
}

/// Linear RGB of the surface at a point of a triangle.
fn colour(visual: &Visual, triangle: usize, at: &Point3<f64>) -> [f32; 3] {
    let Visual { mesh, material } = visual;
    let corners = mesh.triangles[triangle].map(|i| i as usize);
    let [a, b, c] = mesh.corners(triangle);
    let whole = facet(mesh, triangle);
    let share = |p: &Point3<f64>, q: &Point3<f64>| {
        ((p - at).cross(&(q - at)).dot(&whole) / whole.norm_squared()) as f32
    };
    let weights = [share(&b, &c), share(&c, &a), share(&a, &b)];
    let mut out = material.base_color.map(linear);
    if !mesh.colors.is_empty() {
        for (channel, o) in out.iter_mut().enumerate() {
            let of = |i: usize| linear(f32::from(mesh.colors[corners[i]][channel]) / 255.0);
            *o *= weights[0] * of(0) + weights[1] * of(1) + weights[2] * of(2);
        }
    }
    if let Some(texture) = material.texture.as_ref().filter(|t| !mesh.uvs.is_empty() && !t.is_empty()) {
        let texel = |axis: usize, size: u32| {
            let of = |i: usize| weights[i] * mesh.uvs[corners[i]][axis];
            // Textures repeat.
            let x = (of(0) + of(1) + of(2)).rem_euclid(1.0);
            ((x * size as f32) as u32).min(size - 1)
        };
        let pixel = texture.get_pixel(texel(0, texture.width()), texel(1, texture.height()));
        for (o, p) in out.iter_mut().zip(pixel.0) {
            *o *= linear(f32::from(p) / 255.0);
        }
    }
    out
}

/// Linear light of an sRGB value, both 0 to 1.
pub(crate) fn linear(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}
