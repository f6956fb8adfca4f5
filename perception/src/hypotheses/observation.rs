//! What the camera saw, prepared once a frame for all hypotheses of all objects: inverse depth, tolerance, plane weight
//! and silhouette evidence at strides 1, 2, 4 and 8.

use std::sync::Arc;

use grip_sim::camera::Intrinsics;
use grip_sim::frame::CameraFrame;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use super::raster::FlatPlane;
use crate::detector::is_reading;
use crate::grip::GripSettings;
use crate::plane::{OVERHANG, Plane, Support, fit_support_plane};
use grip_sim::lanes::{F8, Isa, LANES, blocks, blocks_mut, per_machine};

/// The strides that are prepared.
pub const STRIDES: [usize; 4] = [1, 2, 4, 8];
/// Readings in a block that are farther than this from each other belong to two surfaces, metres.
const BLOCK_SPREAD: f32 = 0.015;
/// Depth edges are looked for across holes of up to this many pixels: the projector's shadow of a near object.
const EDGE_REACH: usize = 12;
/// A wide hole may hide a slope; each pixel of it adds this to the jump that makes an edge, metres.
const EDGE_SLOPE: f32 = 0.002;
/// Inverse depth of pixels that another object explains: an occluder right before the lens.
const EXPLAINED: f32 = 20.0;

/// The frame at one resolution. Arrays are padded: row and column -1 exist, and at least eight columns on the right,
/// since rows are read in blocks.
#[derive(Debug, Clone)]
pub struct Level {
    /// Blocks of this side make a pixel.
    pub stride: usize,
    /// Pixels a row,
    pub width: usize,
    /// rows,
    pub height: usize,
    /// and values a row of the arrays, padding included.
    pub pitch: usize,
    /// Intrinsics of this resolution: focal lengths
    pub fx: f32,
    #[expect(missing_docs, reason = "with fx")]
    pub fy: f32,
    /// and principal point, pixels.
    pub cx: f32,
    #[expect(missing_docs, reason = "with cx")]
    pub cy: f32,
    /// Observed inverse depth, 1/m; 0 for no reading.
    pub w: Vec<f32>,
    /// Tolerance of inverse depth for the distance epsilon: `|w' - w| < tol w`; 1 where there is no reading.
    pub tol: Vec<f32>,
    /// 0 for points on the support plane, beside it or outside the workspace, 1 for points well above it.
    pub weight: Vec<f32>,
    /// `exp(-d^2 / 2 sigma^2)`, d the distance to the nearest near-side depth edge.
    pub edge: Vec<f32>,
}

impl Level {
    /// Index of pixel (u, v); -1 is allowed.
    #[inline]
    pub fn index(&self, u: i32, v: i32) -> usize {
        ((v + 1) as usize) * self.pitch + (u + 1) as usize
    }
}

/// The frame at all resolutions, and the plane in it.
#[derive(Debug, Clone)]
pub struct Observation {
    /// Shared, so that what does not change is known by its address.
    levels: Vec<Arc<Level>>,
    /// The support plane, if one was found.
    pub plane: Option<Plane>,
    /// The camera at full resolution.
    pub intrinsics: Intrinsics,
}

impl Observation {
    /// Prepares a frame.
    pub fn new(frame: &CameraFrame, settings: &GripSettings) -> Self {
        let support =
            settings.plane.as_ref().and_then(|p| fit_support_plane(frame, p, settings.workspace.as_ref()));
        let edges = near_edges(frame, settings.edge_jump_m as f32);
        let inverse = |z: &f32| if is_reading(*z) { 1.0 / z } else { 0.0 };
        let inverse: Vec<f32> = frame.depth.data().iter().map(inverse).collect();
        // Blocks with an edge, each level from the one before.
        let size = [frame.intrinsics.width, frame.intrinsics.height];
        let mut near = vec![edges];
        for stride in &STRIDES[..STRIDES.len() - 1] {
            near.push(halved(&near[near.len() - 1], size.map(|side| side / stride)));
        }
        let levels = STRIDES
            .par_iter()
            .zip(&near)
            .map(|(&stride, near)| Arc::new(level(frame, &inverse, stride, support.as_ref(), near, settings)))
            .collect();
        Self { levels, plane: support.map(|s| s.plane), intrinsics: frame.intrinsics }
    }

    /// The support plane for the kernels.
    pub fn flat_plane(&self) -> Option<FlatPlane> {
        self.plane.map(|p| (p.normal.into_inner().cast(), p.offset as f32))
    }

    /// The level of a stride that is one of [`STRIDES`].
    pub fn level(&self, stride: usize) -> &Level {
        self.shared_level(stride)
    }

    /// The same, for who keeps what was made of it.
    pub(super) fn shared_level(&self, stride: usize) -> &Arc<Level> {
        let i = STRIDES.iter().position(|&s| s == stride).unwrap_or(0);
        &self.levels[i]
    }

    /// A copy in which the marked pixels of the level with stride 2 are taken: they count as occluders from now on.
    pub fn without(&self, explained: &[bool]) -> Self {
        let mut copy = self.clone();
        let marks = &self.levels[1];
        for level in &mut copy.levels {
            let level = Arc::make_mut(level);
            for v in 0..level.height {
                for u in 0..level.width {
                    let at = |u: usize, v: usize| {
                        u < marks.width && v < marks.height && explained[marks.index(u as i32, v as i32)]
                    };
                    let taken = match level.stride {
                        1 => at(u / 2, v / 2),
                        stride => {
                            let side = stride / 2;
                            let marked = |i: &usize| at(side * u + i % side, side * v + i / side);
                            2 * (0..side * side).filter(marked).count() >= side * side
                        }
                    };
                    if taken {
                        let i = level.index(u as i32, v as i32);
                        level.w[i] = EXPLAINED;
                        level.tol[i] = 1e-3;
                        level.weight[i] = 0.0;
                        level.edge[i] = 0.0;
                    }
                }
            }
        }
        copy
    }
}

fn level(
    frame: &CameraFrame,
    inverse: &[f32],
    stride: usize,
    support: Option<&Support>,
    edges: &[bool],
    settings: &GripSettings,
) -> Level {
    let k = &frame.intrinsics;
    let (width, height) = (k.width / stride, k.height / stride);
    let pitch = (width + 2 + LANES).next_multiple_of(LANES) + LANES;
    let centre = (stride - 1) as f64 / 2.0;
    let s = stride as f64;
    let size = pitch * (height + 2);
    let mut level = Level {
        stride,
        width,
        height,
        pitch,
        fx: (k.fx / s) as f32,
        fy: (k.fy / s) as f32,
        cx: ((k.cx - centre) / s) as f32,
        cy: ((k.cy - centre) / s) as f32,
        w: vec![0.0; size],
        tol: vec![1.0; size],
        weight: vec![0.0; size],
        edge: Vec::new(),
    };
    let mut near = vec![false; size];
    for v in 0..height {
        let row = level.index(0, v as i32);
        near[row..row + width].copy_from_slice(&edges[v * width..(v + 1) * width]);
        let out = &mut level.w[row..row + width];
        match stride {
            1 => out.copy_from_slice(&inverse[v * width..(v + 1) * width]),
            _ => {
                for (u, w) in out.iter_mut().enumerate() {
                    *w = block_mean(inverse, k.width, [u * stride, v * stride], stride);
                }
            }
        }
    }
    let bounds = Bounds::new(frame, support, settings);
    judge(Isa::best(), &mut level, &bounds, settings.epsilon_m as f32);
    level.edge = soft_distance(&near, pitch, settings.edge_sigma_px as f32);
    level
}

/// A half-space of the optical frame: `n . p + d` is how far inside a point is, metres.
type HalfSpace = [f32; 4];

/// Where an object's points may be.
struct Bounds {
    /// Over the support plane: heights up to `band[0]` weigh nothing, from `band[1]` on fully.
    plane: Option<HalfSpace>,
    band: [f32; 2],
    /// Over the support's surface and in the workspace.
    inside: Vec<HalfSpace>,
}

impl Bounds {
    fn new(frame: &CameraFrame, support: Option<&Support>, settings: &GripSettings) -> Self {
        let flat = |n: &Vector3<f64>, d: f64| [n.x, n.y, n.z, d].map(|x| x as f32);
        let mut inside = Vec::new();
        if let Some(support) = support {
            let sides = support.footprint.sides().iter();
            inside.extend(sides.map(|(inward, offset)| flat(inward, OVERHANG - offset)));
        }
        if let Some(workspace) = &settings.workspace {
            let camera_from_world = frame.world_from_camera.inverse();
            let camera = frame.world_from_camera.transform_point(&Point3::origin());
            for axis in 0..3 {
                let normal = camera_from_world.transform_vector(&Vector3::ith(axis, 1.0));
                inside.push(flat(&normal, camera[axis] - workspace.min[axis]));
                inside.push(flat(&-normal, workspace.max[axis] - camera[axis]));
            }
        }
        let plane = support.map(|s| flat(&s.plane.normal, s.plane.offset));
        Self { plane, band: [0.4, 1.4].map(|x| x * settings.plane_band_m as f32), inside }
    }
}

per_machine! {
    /// Fills the tolerances and weights of a level that has its readings.
    fn judge(level: &mut Level, bounds: &Bounds, epsilon: f32) -> () => judge_body
}

#[inline(always)]
fn judge_body(level: &mut Level, bounds: &Bounds, epsilon: f32) {
    let (zero, one, epsilon) = (F8::ZERO, F8::all(1.0), F8::all(epsilon));
    let (cx, inverse_fx) = (F8::all(level.cx), F8::all(1.0 / level.fx));
    // What lies beyond the width has no reading.
    let count = level.width.div_ceil(LANES);
    for v in 0..level.height {
        let row = level.index(0, v as i32);
        let y = F8::all((v as f32 - level.cy) / level.fy);
        let w = blocks(&level.w, row, count);
        let [tol, weight] = [&mut level.tol, &mut level.weight].map(|out| blocks_mut(out, row, count));
        for b in 0..count {
            let w = F8(w[b]);
            let x = (F8::INDEX + F8::all((b * LANES) as f32) - cx) * inverse_fx;
            tol[b] = w.positive(epsilon * w / (x * x + y * y + one).sqrt(), one).0;
            // How far inside the point with inverse depth w is, times w: n . (x, y, 1) + d w.
            let scaled =
                |[a, b, c, d]: &HalfSpace| F8::all(*a) * x + F8::all(*b) * y + F8::all(*c) + F8::all(*d) * w;
            let mut out = w.positive(one, zero);
            if let Some(plane) = &bounds.plane {
                let [low, high] = bounds.band.map(F8::all);
                let over = (scaled(plane) - low * w) / (w.positive(w, one) * (high - low));
                out = out.min(over.max(zero).min(one));
            }
            if out == zero {
                weight[b] = zero.0;
                continue;
            }
            let mut least = zero;
            for side in &bounds.inside {
                least = least.min(scaled(side));
            }
            weight[b] = zero.above(least, zero, out).0;
        }
    }
}

/// Mean of a block of inverse depths; where it holds two surfaces, of the one with more readings. 0 when less than a quarter
/// of the block has readings.
fn block_mean(inverse: &[f32], pitch: usize, [u0, v0]: [usize; 2], stride: usize) -> f32 {
    let rows = || (v0..v0 + stride).map(|v| &inverse[v * pitch + u0..][..stride]);
    let (mut far, mut near, mut count, mut sum) = (f32::MAX, 0.0f32, 0usize, 0.0f32);
    for row in rows() {
        for &w in row {
            far = if w > 0.0 && w < far { w } else { far };
            near = if w > near { w } else { near };
            count += usize::from(w > 0.0);
            sum += w;
        }
    }
    if count == 0 || 4 * count < stride * stride {
        return 0.0;
    }
    let (nearest, farthest) = (1.0 / near, 1.0 / far);
    if farthest - nearest < BLOCK_SPREAD {
        return sum / count as f32;
    }
    let split = 2.0 / (nearest + farthest);
    let (mut sums, mut counts) = ([0.0f32; 2], [0u32; 2]);
    for &w in rows().flatten().filter(|w| **w > 0.0) {
        let side = usize::from(w < split);
        sums[side] += w;
        counts[side] += 1;
    }
    let side = usize::from(counts[1] > counts[0]);
    sums[side] / counts[side] as f32
}

/// Blocks of two by two in which any is marked, of an image of this size.
fn halved(marked: &[bool], [width, height]: [usize; 2]) -> Vec<bool> {
    let any = |u: usize, v: usize| {
        let at = 2 * v * width + 2 * u;
        marked[at] | marked[at + 1] | marked[at + width] | marked[at + width + 1]
    };
    (0..height / 2).flat_map(|v| (0..width / 2).map(move |u| any(u, v))).collect()
}

/// Pixels at full resolution with a reading whose next reading to some side is farther by the jump.
fn near_edges(frame: &CameraFrame, jump: f32) -> Vec<bool> {
    let (depth, width, height) = (frame.depth.data(), frame.intrinsics.width, frame.intrinsics.height);
    let mut edges = vec![false; depth.len()];
    // The last reading in the row, and those in the columns: indices.
    const NONE: usize = usize::MAX;
    let mut above = vec![NONE; width];
    for v in 0..height {
        let mut left = NONE;
        for (u, above) in above.iter_mut().enumerate() {
            let i = v * width + u;
            if !is_reading(depth[i]) {
                continue;
            }
            for (before, step) in [(left, 1), (*above, width)] {
                if before == NONE {
                    continue;
                }
                let gap = (i - before) / step;
                let difference = depth[i] - depth[before];
                if gap <= EDGE_REACH && difference.abs() > jump + EDGE_SLOPE * (gap - 1) as f32 {
                    edges[if difference > 0.0 { before } else { i }] = true;
                }
            }
            left = i;
            *above = i;
        }
    }
    edges
}

/// `exp(-d^2 / 2 sigma^2)` with d the Euclidean distance to the nearest marked pixel, exact up to three sigma.
fn soft_distance(marked: &[bool], pitch: usize, sigma: f32) -> Vec<f32> {
    let reach = (3.0 * sigma).ceil() as usize;
    let far = (reach + 1) as f32;
    let rows = marked.len() / pitch;
    // Squared distance along the row, by a sweep each way.
    let mut along = vec![far * far; marked.len()];
    for (row, out) in marked.chunks_exact(pitch).zip(along.chunks_exact_mut(pitch)) {
        let mut d = far;
        for (m, o) in row.iter().zip(out.iter_mut()) {
            d = if *m { 0.0 } else { (d + 1.0).min(far) };
            *o = d * d;
        }
        d = far;
        for (m, o) in row.iter().zip(out.iter_mut()).rev() {
            d = if *m { 0.0 } else { (d + 1.0).min(far) };
            *o = o.min(d * d);
        }
    }
    // Then the least over the rows near by.
    let mut best = vec![far * far; marked.len()];
    for v in 0..rows {
        for other in v.saturating_sub(reach)..(v + reach + 1).min(rows) {
            let dv = (other as f32 - v as f32).powi(2);
            let source = &along[other * pitch..(other + 1) * pitch];
            for (o, a) in best[v * pitch..(v + 1) * pitch].iter_mut().zip(source) {
                *o = o.min(a + dv);
            }
        }
    }
    // Most pixels are far from any edge: spare them the exponential.
    let scale = -0.5 / (sigma * sigma);
    for b in &mut best {
        *b = if *b >= far * far { 0.0 } else { (*b * scale).exp() };
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use grip_sim::images::{Image, RgbImage};
    use grip_sim::pose::Pose;

    fn frame(paint: impl Fn(usize, usize) -> f32) -> CameraFrame {
        let k = Intrinsics::FETCH;
        let mut depth = Image::filled(k.width, k.height, 0.0f32);
        for v in 0..k.height {
            for u in 0..k.width {
                *depth.at_mut(u, v) = paint(u, v);
            }
        }
        CameraFrame {
            rgb: RgbImage::new(640, 480),
            depth,
            intrinsics: k,
            world_from_camera: Pose::identity(),
        }
    }

    #[test]
    fn blocks_take_the_surface_with_more_readings_and_skip_holes() {
        let frame = frame(|u, v| match (u, v) {
            (0..4, 0..4) if u < 3 => 1.0,
            (0..4, 0..4) => 2.0,
            (4..8, 0..4) if u == 4 && v < 3 => 1.0,
            (8..12, 0..4) if v == 0 => f32::NAN,
            (8..12, 0..4) => 0.5,
            _ => 0.0,
        });
        let observation = Observation::new(&frame, &GripSettings { plane: None, ..Default::default() });
        let level = observation.level(4);
        let at = |u| level.w[level.index(u, 0)];
        assert_eq!([at(0), at(1), at(2)], [1.0, 0.0, 2.0]);
        let two = observation.level(2);
        assert_eq!(two.w[two.index(0, 0)], 1.0);
        // The tolerance is epsilon along the ray.
        let x = (0.0 - level.cx) / level.fx;
        let y = (0.0 - level.cy) / level.fy;
        let tol = GripSettings::default().epsilon_m as f32 / (x * x + y * y + 1.0).sqrt();
        assert!((level.tol[level.index(0, 0)] - tol).abs() < 1e-8);
    }

    #[test]
    fn edges_are_on_the_near_side_also_across_a_shadow() {
        let frame = frame(|u, _| match u {
            0..100 => 1.0,
            100..108 => 0.0,
            _ => 1.1,
        });
        let edges = near_edges(&frame, 0.01);
        let row = &edges[640 * 7..640 * 8];
        let marked: Vec<usize> = (0..640).filter(|&u| row[u]).collect();
        assert_eq!(marked, [99]);
        let observation = Observation::new(&frame, &GripSettings { plane: None, ..Default::default() });
        let one = observation.level(1);
        assert_eq!(one.edge[one.index(99, 9)], 1.0);
        let expected = (-0.5f32 * (2.0f32 / 1.5).powi(2)).exp();
        assert!((one.edge[one.index(101, 9)] - expected).abs() < 1e-6);
        assert_eq!(one.edge[one.index(200, 9)], 0.0);
    }

    #[test]
    fn soft_distance_is_euclidean() {
        let pitch = 32;
        let mut marked = vec![false; pitch * 32];
        marked[10 * pitch + 10] = true;
        let soft = soft_distance(&marked, pitch, 2.0);
        let expected = (-(9.0f32 + 4.0) / 8.0).exp();
        assert!((soft[12 * pitch + 13] - expected).abs() < 1e-6);
    }
}
