//! A small depth renderer: one model at one pose into a tile of inverse depth.
//!
//! Inverse depth is linear on the screen, and larger is nearer, so an empty pixel is 0 and the depth test is a maximum.
//! Two phases: triangles that face away are dropped, eight at a time, by their planes in the object frame; then each that is
//! left is drawn in blocks of eight pixels, down its rows, by the signs of three linear functions: most triangles are so
//! small that finding the ends of each row costs more (measured). Blocks are aligned, or reading back what was just written
//! in another alignment would stall.

use nalgebra::{Isometry3, Vector3};

use super::lod::Lod;
use crate::observation::{FlatPlane, Level};
use grip_sim::lanes::{F8, Isa, LANES, per_machine};

/// Points nearer than this are not rendered, metres.
const NEAREST: f32 = 0.05;

/// Inverse depth of a rendered model, with an empty margin.
#[derive(Debug, Clone, Default)]
pub(crate) struct Tile {
    /// Pixel of the level at the tile's first column and row; may be -1.
    pub u0: i32,
    pub v0: i32,
    pub width: usize,
    pub height: usize,
    /// Blocks a row, an empty one in front included.
    blocks: usize,
    w: Vec<[f32; LANES]>,
}

impl Tile {
    /// Values a row of [`Self::values`].
    #[inline]
    pub fn pitch(&self) -> usize {
        self.blocks * LANES
    }

    /// Index of the pixel in column `x`, row `y` of the tile.
    #[inline]
    pub fn index(&self, x: usize, y: usize) -> usize {
        (y + 1) * self.pitch() + LANES + x
    }

    /// All values, margins included: an empty row above and below, empty columns on both sides.
    #[inline]
    pub fn values(&self) -> &[f32] {
        self.w.as_flattened()
    }

    /// Drawn pixels `(u, v, 1/z)` of the level, those of the margins too.
    pub fn pixels(&self) -> impl Iterator<Item = (i32, i32, f32)> {
        (0..self.height)
            .flat_map(move |y| (0..self.width).map(move |x| (x, y)))
            .map(|(x, y)| (self.u0 + x as i32, self.v0 + y as i32, self.values()[self.index(x, y)]))
            .filter(|(_, _, w)| *w > 0.0)
    }

    /// Empties what was drawn to the right of the last column.
    fn clear_right_margin(&mut self) {
        for y in 0..self.height {
            let (from, to) = (self.index(self.width, y), self.index(0, y + 1) - LANES);
            self.w.as_flattened_mut()[from..to].fill(0.0);
        }
    }

    /// An empty tile of this size.
    fn clear(&mut self, u0: i32, v0: i32, width: usize, height: usize) {
        self.blocks = width.div_ceil(LANES) + 1;
        (self.u0, self.v0, self.width, self.height) = (u0, v0, width, height);
        self.w.clear();
        // One block more: the last row's right margin.
        self.w.resize(self.blocks * (height + 2) + 1, F8::ZERO.0);
    }
}

/// What the projection says before any pixel is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extent {
    /// Bounds of the projected vertices `[u0, v0, u1, v1]`, pixels of the level.
    pub bounds: [f32; 4],
    /// Height of the lowest vertex over the plane, metres.
    pub lowest: f32,
}

/// The renderer and its buffers.
#[derive(Debug, Default)]
pub(crate) struct Raster {
    /// Projected vertices `[u, v, 1/z, 0]`.
    projected: Vec<[f32; 4]>,
    /// Triangles that face the camera.
    facing: Vec<u32>,
    pub tile: Tile,
}

per_machine! {
    /// Draws `lod` at camera-from-object `pose` into [`Raster::tile`]. `None`, and the tile is not to be used, when a part
    /// of it is too near or it is wholly outside the image.
    pub(crate) fn render_on(
        raster: &mut Raster,
        lod: &Lod,
        pose: &Isometry3<f32>,
        level: &Level,
        plane: Option<&FlatPlane>,
    ) -> Option<Extent> => render_body
}

/// Draws `lod` at camera-from-object `pose`, as [`render_on`] does, with the best instructions.
pub(crate) fn render(
    raster: &mut Raster,
    lod: &Lod,
    pose: &Isometry3<f32>,
    level: &Level,
    plane: Option<&FlatPlane>,
) -> Option<Extent> {
    render_on(Isa::best(), raster, lod, pose, level, plane)
}

#[inline(always)]
pub(crate) fn render_body(
    raster: &mut Raster,
    lod: &Lod,
    pose: &Isometry3<f32>,
    level: &Level,
    plane: Option<&FlatPlane>,
) -> Option<Extent> {
    let extent = project(&mut raster.projected, lod, pose, level, plane)?;
    let [u0, v0, u1, v1] = extent.bounds;
    // One pixel beyond the image is drawn too, over padding without readings: the image's border is no silhouette.
    let (u0, v0) = (u0.floor().max(-1.0), v0.floor().max(-1.0));
    let (u1, v1) = (u1.ceil().min(level.width as f32), v1.ceil().min(level.height as f32));
    if !(u1 >= u0 && v1 >= v0) {
        return None;
    }
    let size = |a: f32, b: f32| (b - a) as usize + 1;
    let tile = &mut raster.tile;
    tile.clear(u0 as i32, v0 as i32, size(u0, u1), size(v0, v1));
    face(&mut raster.facing, lod, pose);
    for &triangle in &raster.facing {
        let corner = |i: u32| {
            let [u, v, w, _] = raster.projected[i as usize];
            [u - u0, v - v0, w]
        };
        let [a, b, c] = lod.triangles[triangle as usize].map(corner);
        fill(tile, a, b, c);
    }
    if extent.bounds[2] > u1 {
        tile.clear_right_margin();
    }
    Some(extent)
}

/// Lists the triangles whose front is towards the camera.
#[inline(always)]
fn face(facing: &mut Vec<u32>, lod: &Lod, pose: &Isometry3<f32>) {
    let camera = pose.rotation.inverse() * -pose.translation.vector;
    let c = camera.map(F8::all);
    facing.clear();
    facing.resize(lod.planes.len() * LANES, 0);
    let mut count = 0;
    for (block, [x, y, z, offset]) in lod.planes.iter().enumerate() {
        let before = c.x * *x + c.y * *y + c.z * *z - *offset;
        for lane in 0..LANES {
            // Always written, counted when it stays: no branch to be guessed wrongly. There is one slot for each triangle.
            if let Some(slot) = facing.get_mut(count) {
                *slot = (block * LANES + lane) as u32;
            }
            count += usize::from(before.0[lane] > 0.0);
        }
    }
    facing.truncate(count);
}

#[inline(always)]
fn project(
    out: &mut Vec<[f32; 4]>,
    lod: &Lod,
    pose: &Isometry3<f32>,
    level: &Level,
    plane: Option<&FlatPlane>,
) -> Option<Extent> {
    let r = pose.rotation.to_rotation_matrix();
    let r = |i: usize, j: usize| F8::all(r.matrix()[(i, j)]);
    let t = pose.translation.vector.map(F8::all);
    let (n, offset) = plane.copied().unwrap_or((Vector3::zeros(), 0.0));
    let (n, offset) = (n.map(F8::all), F8::all(offset));
    let (fx, fy) = (F8::all(level.fx), F8::all(level.fy));
    let (cx, cy) = (F8::all(level.cx), F8::all(level.cy));
    let mut low = [F8::all(f32::MAX); 4];
    let mut high = [F8::all(f32::MIN); 2];
    out.resize(lod.blocks.len() * LANES, [0.0; 4]);
    for ([x, y, z], out) in lod.blocks.iter().zip(out.as_chunks_mut::<LANES>().0) {
        let px = r(0, 0) * *x + r(0, 1) * *y + r(0, 2) * *z + t.x;
        let py = r(1, 0) * *x + r(1, 1) * *y + r(1, 2) * *z + t.y;
        let pz = r(2, 0) * *x + r(2, 1) * *y + r(2, 2) * *z + t.z;
        let w = F8::all(1.0) / pz;
        let u = fx * px * w + cx;
        let v = fy * py * w + cy;
        let height = n.x * px + n.y * py + n.z * pz + offset;
        low = [u.min(low[0]), v.min(low[1]), pz.min(low[2]), height.min(low[3])];
        high = [u.max(high[0]), v.max(high[1])];
        for (i, out) in out.iter_mut().enumerate() {
            *out = [u.0[i], v.0[i], w.0[i], 0.0];
        }
    }
    let bounds = [low[0].least(), low[1].least(), high[0].most(), high[1].most()];
    let usable = low[2].least() > NEAREST && bounds.iter().all(|b| b.abs() < 1e5);
    usable.then_some(Extent { bounds, lowest: low[3].least() })
}

/// Smallest integer not below `x`, for `|x| < 2^21`; other values give some integer. Adding 1.5 * 2^23 rounds to the
/// nearest; unlike `ceil` this needs no library call on plain x86-64.
#[inline(always)]
fn ceil(x: f32) -> i32 {
    const MAGIC: f32 = 12_582_912.0;
    (((x + 0.5) + MAGIC).to_bits() as i32).wrapping_sub(MAGIC.to_bits() as i32)
}

/// Half-plane tests count a pixel as inside up to this much outside, pixels squared: neighbours may both draw a pixel (the
/// nearer wins), but none is left out between them.
const SLACK: f32 = 1e-3;

/// Fills one triangle, vertices `[x, y, 1/z]` in tile pixels. Back faces (clockwise in a picture with y up) are skipped.
#[inline(always)]
fn fill(tile: &mut Tile, a: [f32; 3], b: [f32; 3], c: [f32; 3]) {
    let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    // In the image y points down, so the front side has negative area.
    if area > -1e-6 || area.is_nan() {
        return;
    }
    // The pixels from ceil(low) to floor(high).
    let range = |axis: usize, size: usize| {
        let low = a[axis].min(b[axis]).min(c[axis]);
        let high = a[axis].max(b[axis]).max(c[axis]);
        let clamped = |x: f32| ceil(x).clamp(0, size as i32) as usize;
        (clamped(low - SLACK), clamped(high + SLACK))
    };
    let (top, bottom) = range(1, tile.height);
    let (left, right) = range(0, tile.width);
    if top >= bottom || left >= right {
        return;
    }
    let inverse = 1.0 / area;
    let slope_x = ((b[2] - a[2]) * (c[1] - a[1]) - (c[2] - a[2]) * (b[1] - a[1])) * inverse;
    let slope_y = ((c[2] - a[2]) * (b[0] - a[0]) - (b[2] - a[2]) * (c[0] - a[0])) * inverse;
    // A sliver's slope is ill-conditioned: no pixel is nearer than the nearest vertex.
    let nearest = F8::all(a[2].max(b[2]).max(c[2]));
    let slack = F8::all(SLACK);
    let y = top as f32;
    for block in left / LANES..=(right - 1) / LANES {
        let x = F8::INDEX + F8::all((block * LANES) as f32);
        // Twice the area that an edge spans with the pixel: negative inside. Zero for a shared edge seen from either side.
        let edge = |p: [f32; 3], q: [f32; 3]| {
            let (dx, dy) = (q[0] - p[0], q[1] - p[1]);
            let start = F8::all(dx * (y - p[1])) - F8::all(dy) * (x - F8::all(p[0]));
            (start, F8::all(dx))
        };
        let ((mut e0, d0), (mut e1, d1), (mut e2, d2)) = (edge(a, b), edge(b, c), edge(c, a));
        let mut value = F8::all(a[2] + slope_y * (y - a[1])) + F8::all(slope_x) * (x - F8::all(a[0]));
        let down = F8::all(slope_y);
        let mut at = (top + 1) * tile.blocks + 1 + block;
        for _ in top..bottom {
            let outside = e0.max(e1).max(e2);
            let drawn = slack.above(outside, value.min(nearest), F8::ZERO);
            if let Some(pixels) = tile.w.get_mut(at) {
                *pixels = drawn.max_of_positive(F8(*pixels)).0;
            }
            e0 += d0;
            e1 += d1;
            e2 += d2;
            value += down;
            at += tile.blocks;
        }
    }
}
