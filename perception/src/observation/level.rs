//! The frame at one resolution.

use grip_sim::frame::CameraFrame;
use grip_sim::lanes::{F8, Isa, LANES, blocks, blocks_mut, per_machine};
use nalgebra::{Point3, Vector3};

use super::edges::soft_distance;
use super::settings::ObservationSettings;
use super::stride::Stride;
use crate::support::{Support, Supports};
use crate::workspace::Workspace;

/// The frame at one resolution. Arrays are padded: row and column -1 exist, and at least eight columns on the right,
/// since rows are read in blocks.
#[derive(Debug, Clone)]
pub struct Level {
    /// Blocks of this side make a pixel.
    pub stride: Stride,
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
    /// 0 for points on a support plane, beside all of them or outside the workspace, 1 for points well above.
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

/// What all levels of a frame are made of.
pub(super) struct Sources<'a> {
    pub frame: &'a CameraFrame,
    /// Inverse depth at full resolution, 1/m; 0 for no reading.
    pub inverse: &'a [f32],
    pub supports: Option<&'a Supports>,
    pub workspace: Option<&'a Workspace>,
    pub settings: &'a ObservationSettings,
}

/// The level of a stride; `edges` are its pixels with a depth edge.
pub(super) fn level(sources: &Sources<'_>, stride: Stride, edges: &[bool]) -> Level {
    let Sources { frame, inverse, supports, workspace, settings } = *sources;
    let (k, of) = (&frame.intrinsics, stride);
    let stride = of.pixels();
    let (width, height) = (k.width / stride, k.height / stride);
    let pitch = (width + 2 + LANES).next_multiple_of(LANES) + LANES;
    let centre = (stride - 1) as f64 / 2.0;
    let s = stride as f64;
    let size = pitch * (height + 2);
    let mut level = Level {
        stride: of,
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
                    *w = block_mean(
                        inverse,
                        k.width,
                        [u * stride, v * stride],
                        stride,
                        settings.block_spread_m,
                    );
                }
            }
        }
    }
    let bounds = Bounds::new(frame, supports, workspace, settings);
    judge(Isa::best(), &mut level, &bounds, settings.epsilon_m as f32);
    level.edge = soft_distance(&near, pitch, settings.edge_sigma_px as f32);
    level
}

/// A half-space of the optical frame: `n . p + d` is how far inside a point is, metres.
type HalfSpace = [f32; 4];

/// Where an object's points may be.
struct Bounds {
    /// Over the lowest support plane: heights up to `band[0]` weigh nothing, from `band[1]` on fully.
    plane: Option<HalfSpace>,
    band: [f32; 2],
    /// In the workspace.
    inside: Vec<HalfSpace>,
    /// Over one of the surfaces, or little beside it: of each its sides.
    surfaces: Vec<Vec<HalfSpace>>,
    /// The planes above the lowest, each with the sides of its surface: what is on that weighs nothing, either.
    steps: Vec<(HalfSpace, Vec<HalfSpace>)>,
}

impl Bounds {
    fn new(
        frame: &CameraFrame,
        supports: Option<&Supports>,
        workspace: Option<&Workspace>,
        settings: &ObservationSettings,
    ) -> Self {
        let flat = |n: &Vector3<f64>, d: f64| [n.x, n.y, n.z, d].map(|x| x as f32);
        let plane = |support: &Support| flat(&support.plane.normal, support.plane.offset);
        let sides = |support: &Support, margin: f64| -> Vec<HalfSpace> {
            support.footprint.sides().iter().map(|(inward, offset)| flat(inward, margin - offset)).collect()
        };
        let all = supports.map_or(&[][..], Supports::all);
        let higher = supports.map_or(&[][..], Supports::higher);
        let mut inside = Vec::new();
        if let Some(workspace) = workspace {
            let camera_from_world = frame.world_from_camera.inverse();
            let camera = frame.world_from_camera.transform_point(&Point3::origin());
            for axis in 0..3 {
                let normal = camera_from_world.transform_vector(&Vector3::ith(axis, 1.0));
                inside.push(flat(&normal, camera[axis] - workspace.min[axis]));
                inside.push(flat(&-normal, workspace.max[axis] - camera[axis]));
            }
        }
        Self {
            plane: supports.map(|supports| plane(supports.base())),
            band: [0.4, 1.4].map(|x| x * settings.plane_band_m as f32),
            inside,
            surfaces: all.iter().map(|support| sides(support, support.overhang_m)).collect(),
            steps: higher.iter().map(|support| (plane(support), sides(support, 0.0))).collect(),
        }
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
            // How far a height, times w, is through the band.
            let through = |height: F8| {
                let [low, high] = bounds.band.map(F8::all);
                ((height - low * w) / (w.positive(w, one) * (high - low))).max(zero).min(one)
            };
            if let Some(plane) = &bounds.plane {
                out = out.min(through(scaled(plane)));
            }
            if out == zero {
                weight[b] = zero.0;
                continue;
            }
            // Without a support everything is over one.
            let over =
                |sides: &Vec<HalfSpace>| sides.iter().fold(zero, |least, side| least.min(scaled(side)));
            let mut least = bounds.surfaces.iter().map(over).reduce(F8::max).unwrap_or(zero);
            for side in &bounds.inside {
                least = least.min(scaled(side));
            }
            for (plane, sides) in &bounds.steps {
                let height = scaled(plane);
                let on = out.min(through(height.max(zero - height)));
                out = zero.above(over(sides), out, on);
            }
            weight[b] = zero.above(least, zero, out).0;
        }
    }
}

/// Mean of a block of inverse depths; where it holds two surfaces, of the one with more readings. 0 when less than a quarter
/// of the block has readings.
fn block_mean(inverse: &[f32], pitch: usize, [u0, v0]: [usize; 2], stride: usize, spread_m: f32) -> f32 {
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
    if farthest - nearest < spread_m {
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
pub(super) fn halved(marked: &[bool], [width, height]: [usize; 2]) -> Vec<bool> {
    let any = |u: usize, v: usize| {
        let at = 2 * v * width + 2 * u;
        marked[at] | marked[at + 1] | marked[at + width] | marked[at + width + 1]
    };
    (0..height / 2).flat_map(|v| (0..width / 2).map(move |u| any(u, v))).collect()
}
