//! A small depth renderer: one model at one pose into a tile of inverse depth.
//!
//! Inverse depth is linear on the screen, and larger is nearer, so an empty pixel is 0 and the depth test is a maximum.
//! Triangles are filled row by row between their edges; an edge is computed from its upper to its lower vertex whatever
//! the triangle, so that neighbours share it to the bit and leave no gap.

use nalgebra::{Isometry3, Vector3};

use super::lod::Lod;
use super::observation::{LANES, Level};

/// Points nearer than this are not rendered, metres.
const NEAREST: f32 = 0.05;

/// Inverse depth of a rendered model, with an empty margin of one pixel.
#[derive(Debug, Clone, Default)]
pub(crate) struct Tile {
    /// Pixel of the level at the tile's first column and row; may be -1.
    pub u0: i32,
    pub v0: i32,
    pub width: usize,
    pub height: usize,
    pub pitch: usize,
    pub w: Vec<f32>,
}

impl Tile {
    /// Index of the pixel in column `x`, row `y` of the tile.
    #[inline]
    pub fn index(&self, x: usize, y: usize) -> usize {
        (y + 1) * self.pitch + x + 1
    }

    /// An empty tile of this size.
    fn clear(&mut self, u0: i32, v0: i32, width: usize, height: usize) {
        self.pitch = width.next_multiple_of(LANES) + LANES;
        (self.u0, self.v0, self.width, self.height) = (u0, v0, width, height);
        self.w.clear();
        self.w.resize(self.pitch * (height + 2), 0.0);
    }
}

/// `LANES` values from `at` on.
#[inline(always)]
pub(crate) fn lanes(values: &[f32], at: usize) -> &[f32; LANES] {
    const EMPTY: &[f32; LANES] = &[0.0; LANES];
    values
        .get(at..)
        .and_then(|v| v.first_chunk())
        .unwrap_or(EMPTY)
}

/// What the projection says before any pixel is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Extent {
    /// Bounds of the projected vertices `[u0, v0, u1, v1]`, pixels of the level.
    pub bounds: [f32; 4],
    /// Height of the lowest vertex over the plane, metres.
    pub lowest: f32,
}

/// The renderer and its buffers.
#[derive(Debug, Default)]
pub(crate) struct Raster {
    u: Vec<f32>,
    v: Vec<f32>,
    w: Vec<f32>,
    pub tile: Tile,
}

/// A plane for the kernels: normal and offset.
pub(crate) type FlatPlane = (Vector3<f32>, f32);

impl Raster {
    /// Draws `lod` at camera-from-object `pose` into [`Self::tile`]. `None`, and the tile is not to be used, when a part
    /// of it is too near or it is wholly outside the image.
    pub fn render(
        &mut self,
        lod: &Lod,
        pose: &Isometry3<f32>,
        level: &Level,
        plane: Option<&FlatPlane>,
    ) -> Option<Extent> {
        let extent = self.project(lod, pose, level, plane)?;
        let [u0, v0, u1, v1] = extent.bounds;
        // One pixel beyond the image is drawn too, over padding without readings: the image's border is no silhouette.
        let (u0, v0) = (u0.floor().max(-1.0), v0.floor().max(-1.0));
        let (u1, v1) = (u1.ceil().min(level.width as f32), v1.ceil().min(level.height as f32));
        if !(u1 >= u0 && v1 >= v0) {
            return None;
        }
        let size = |a: f32, b: f32| (b - a) as usize + 1;
        self.tile.clear(u0 as i32, v0 as i32, size(u0, u1), size(v0, v1));
        for triangle in &lod.triangles {
            let [a, b, c] = triangle.map(|i| {
                let i = i as usize;
                [self.u[i] - u0, self.v[i] - v0, self.w[i]]
            });
            fill(&mut self.tile, a, b, c);
        }
        Some(extent)
    }

    fn project(
        &mut self,
        lod: &Lod,
        pose: &Isometry3<f32>,
        level: &Level,
        plane: Option<&FlatPlane>,
    ) -> Option<Extent> {
        let count = lod.x.len();
        for out in [&mut self.u, &mut self.v, &mut self.w] {
            out.resize(count, 0.0);
        }
        let r = pose.rotation.to_rotation_matrix();
        let (r, t) = (r.matrix(), pose.translation.vector);
        let (n, offset) = plane.copied().unwrap_or((Vector3::zeros(), 0.0));
        let mut low = [[f32::MAX; LANES]; 4];
        let mut high = [[f32::MIN; LANES]; 2];
        let blocks = lod.x.as_chunks::<LANES>().0.iter()
            .zip(lod.y.as_chunks::<LANES>().0)
            .zip(lod.z.as_chunks::<LANES>().0);
        let out = self.u.as_chunks_mut::<LANES>().0.iter_mut()
            .zip(self.v.as_chunks_mut::<LANES>().0)
            .zip(self.w.as_chunks_mut::<LANES>().0);
        for (((x, y), z), ((u, v), w)) in blocks.zip(out) {
            for i in 0..LANES {
                let px = r[(0, 0)] * x[i] + r[(0, 1)] * y[i] + r[(0, 2)] * z[i] + t.x;
                let py = r[(1, 0)] * x[i] + r[(1, 1)] * y[i] + r[(1, 2)] * z[i] + t.y;
                let pz = r[(2, 0)] * x[i] + r[(2, 1)] * y[i] + r[(2, 2)] * z[i] + t.z;
                let height = n.x * px + n.y * py + n.z * pz + offset;
                w[i] = 1.0 / pz;
                u[i] = level.fx * px * w[i] + level.cx;
                v[i] = level.fy * py * w[i] + level.cy;
                low[0][i] = if u[i] < low[0][i] { u[i] } else { low[0][i] };
                low[1][i] = if v[i] < low[1][i] { v[i] } else { low[1][i] };
                low[2][i] = if pz < low[2][i] { pz } else { low[2][i] };
                low[3][i] = if height < low[3][i] { height } else { low[3][i] };
                high[0][i] = if u[i] > high[0][i] { u[i] } else { high[0][i] };
                high[1][i] = if v[i] > high[1][i] { v[i] } else { high[1][i] };
            }
        }
        let least = |a: &[f32; LANES]| a.iter().fold(f32::MAX, |m, x| m.min(*x));
        let most = |a: &[f32; LANES]| a.iter().fold(f32::MIN, |m, x| m.max(*x));
        let bounds = [least(&low[0]), least(&low[1]), most(&high[0]), most(&high[1])];
        let usable = least(&low[2]) > NEAREST && bounds.iter().all(|b| b.abs() < 1e5);
        usable.then_some(Extent {
            bounds,
            lowest: least(&low[3]),
        })
    }
}

/// Smallest integer not below `x`, for `|x| < 2^21`; other values give some integer. Adding 1.5 * 2^23 rounds to the
/// nearest; unlike `ceil` this needs no library call on plain x86-64.
#[inline(always)]
fn ceil(x: f32) -> i32 {
    const MAGIC: f32 = 12_582_912.0;
    (((x + 0.5) + MAGIC).to_bits() as i32).wrapping_sub(MAGIC.to_bits() as i32)
}

/// Fills one triangle, vertices `[x, y, 1/z]` in tile pixels. Back faces (clockwise in a picture with y up) are skipped.
#[inline(always)]
fn fill(tile: &mut Tile, a: [f32; 3], b: [f32; 3], c: [f32; 3]) {
    let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    // In the image y points down, so the front side has negative area. NaN fails the test, too.
    if !(area < -1e-6) {
        return;
    }
    let inverse = 1.0 / area;
    let slope_x = ((b[2] - a[2]) * (c[1] - a[1]) - (c[2] - a[2]) * (b[1] - a[1])) * inverse;
    let slope_y = ((c[2] - a[2]) * (b[0] - a[0]) - (b[2] - a[2]) * (c[0] - a[0])) * inverse;
    let at_origin = a[2] - slope_x * a[0] - slope_y * a[1];
    // A sliver's slope is ill-conditioned: no pixel is nearer than the nearest vertex.
    let nearest = a[2].max(b[2]).max(c[2]);

    let (mut top, mut middle, mut bottom) = (a, b, c);
    if middle[1] < top[1] {
        std::mem::swap(&mut top, &mut middle);
    }
    if bottom[1] < top[1] {
        std::mem::swap(&mut top, &mut bottom);
    }
    if bottom[1] < middle[1] {
        std::mem::swap(&mut middle, &mut bottom);
    }
    let last_row = tile.height as i32;
    let first = ceil(top[1]).clamp(0, last_row);
    let split = ceil(middle[1]).clamp(0, last_row);
    let end = ceil(bottom[1]).clamp(0, last_row);
    if first >= end {
        return;
    }
    let edge = |p: [f32; 3], q: [f32; 3]| (q[0] - p[0]) / (q[1] - p[1]);
    let long = edge(top, bottom);
    let halves = [
        (first, split, top, edge(top, middle)),
        (split, end, middle, edge(middle, bottom)),
    ];
    for (from, to, corner, slope) in halves {
        for row in from..to {
            let y = row as f32;
            let x0 = top[0] + (y - top[1]) * long;
            let x1 = corner[0] + (y - corner[1]) * slope;
            let (left, right) = if x0 < x1 { (x0, x1) } else { (x1, x0) };
            let left = ceil(left).clamp(0, tile.width as i32) as usize;
            let right = ceil(right).clamp(0, tile.width as i32) as usize;
            if left >= right {
                continue;
            }
            let start = tile.index(left, row as usize);
            let mut w = at_origin + slope_y * y + slope_x * left as f32;
            if let Some(pixels) = tile.w.get_mut(start..start + right - left) {
                for pixel in pixels {
                    let value = if w < nearest { w } else { nearest };
                    *pixel = if value > *pixel { value } else { *pixel };
                    w += slope_x;
                }
            }
        }
    }
}
