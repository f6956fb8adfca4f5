//! What is printed on an object: its surface as points with a look each.

use grip_sim::mesh::{Mesh, Visual};
use grip_sim::render::srgb::{from_linear, to_linear};
use grip_sim::rng;
use nalgebra::{Point3, Vector3};

/// Points an object has, about. Half of them face the camera; compared is at the resolution at which these cover the pixels.
const POINTS: usize = 24_000;
/// Places where the print is read for each point: what the camera sees at this distance is their mean.
const READINGS: usize = 6;
/// Print that varies by less is none: root mean square of the look, by channel.
const PLAIN: f32 = 0.02;

/// A small piece of the surface.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PrintedPoint {
    /// Object frame, metres.
    pub position: Vector3<f32>,
    /// Outward, unit length.
    pub normal: Vector3<f32>,
    /// See [`look`].
    pub look: [f32; 3],
}

/// The printed surface of an object.
#[derive(Debug)]
pub(crate) struct Print {
    /// Spread evenly.
    pub points: Vec<PrintedPoint>,
    /// Distance between neighbours, metres.
    pub spacing: f32,
}

/// What is compared of a colour, sRGB code values from 0 to 1: half the logarithm of its brightness, in which light and shading
/// are sums, and two differences of channels over their sum, which light and shading hardly change. The offsets bound what
/// near-black can say.
#[inline]
pub(crate) fn look([r, g, b]: [f32; 3]) -> [f32; 3] {
    let over = 1.5 / (r + g + b + 0.3);
    [0.5 * (0.3 * r + 0.5 * g + 0.2 * b + 0.1).ln(), (r - g) * over, (b - 0.5 * (r + g)) * over]
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
        let mut readings: Vec<([i32; 4], PrintedPoint)> = Vec::with_capacity(POINTS * READINGS);
        for (at, t) in mesh.sample_surface_indexed(POINTS * READINGS, &mut rng::stream(0, "looks")) {
            let Some(normal) = (facet(mesh, t) * outward).try_normalize(0.0) else { continue };
            let side = normal.iamax();
            let [x, y, z] = [at.x, at.y, at.z].map(|c| (c / spacing).floor() as i32);
            let facing = 2 * side as i32 + i32::from(normal[side] > 0.0);
            let (position, normal) = (at.coords.cast(), normal.cast());
            readings
                .push(([x, y, z, facing], PrintedPoint { position, normal, look: colour(visual, t, &at) }));
        }
        readings.sort_unstable_by_key(|(cube, _)| *cube);
        // A cube that the surface only grazes would stand for a corner of itself.
        let cubes = readings.chunk_by(|a, b| a.0 == b.0).filter(|cube| cube.len() >= READINGS / 3);
        let points: Vec<PrintedPoint> = cubes
            .filter_map(|cube| {
                let n = cube.len() as f32;
                let points = || cube.iter().map(|(_, point)| point);
                let normal = points().map(|p| p.normal).sum::<Vector3<f32>>().try_normalize(0.0)?;
                let position = points().map(|p| p.position).sum::<Vector3<f32>>() / n;
                let mean = [0, 1, 2].map(|c| from_linear(points().map(|p| p.look[c]).sum::<f32>() / n));
                Some(PrintedPoint { position, normal, look: look(mean) })
            })
            .collect();
        (variation(&points) >= PLAIN).then_some(Self { points, spacing: spacing as f32 })
    }
}

/// Root mean square deviation of a look's channels from their means, the largest.
fn variation(points: &[PrintedPoint]) -> f32 {
    let n = points.len().max(1) as f32;
    let variance = |channel: usize| {
        let looks = || points.iter().map(|p| p.look[channel]);
        let mean = looks().sum::<f32>() / n;
        looks().map(|l| (l - mean).powi(2)).sum::<f32>() / n
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
    let mut out = material.base_color.map(to_linear);
    if !mesh.colors.is_empty() {
        for (channel, o) in out.iter_mut().enumerate() {
            let of = |i: usize| to_linear(f32::from(mesh.colors[corners[i]][channel]) / 255.0);
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
            *o *= to_linear(f32::from(p) / 255.0);
        }
    }
    out
}
