//! Edge and planar points of a point cloud image (the paper's equation "c", after Zhang and Singh 2014).

use super::settings::{Holes, PaperSettings};
use crate::hypotheses::{Isa, Level, per_machine};

/// A part of an image of inverse depth: what [`Smoothness`] is computed of.
#[derive(Clone, Copy)]
pub(super) struct Patch<'a> {
    /// Image pixel of column 0, row 0.
    pub origin: [i32; 2],
    pub width: usize,
    pub height: usize,
    /// Inverse depth, 1/m, 0 for no point; row `y` begins at `start + y * pitch`.
    pub values: &'a [f32],
    pub start: usize,
    pub pitch: usize,
}

impl<'a> Patch<'a> {
    /// All of a level.
    pub fn whole(level: &'a Level) -> Self {
        Self {
            origin: [0, 0],
            width: level.width,
            height: level.height,
            values: &level.w,
            start: level.index(0, 0),
            pitch: level.pitch,
        }
    }

    pub fn row(&self, y: usize) -> &'a [f32] {
        &self.values[self.start + y * self.pitch..][..self.width]
    }
}

/// Kinds of a pixel of the observation.
pub(super) const NONE: u8 = 0;
pub(super) const EDGE: u8 = 1;
pub(super) const PLANE: u8 = 2;

/// Squares of c, and the buffers that it takes.
#[derive(Debug, Clone, Default)]
pub(super) struct Smoothness {
    /// c^2 of each pixel of the patch, row by row; negative where there is no point or no neighbour.
    pub squared: Vec<f32>,
    /// Coordinates and presence of the points, with a margin as wide as the neighbourhood reaches.
    points: [Vec<f32>; 4],
    /// Sums along the rows, then over whole neighbourhoods.
    rows: [Vec<f32>; 4],
}

per_machine! {
    /// Computes [`Smoothness::squared`] of a patch of `level`.
    pub(super) fn compute(smoothness: &mut Smoothness, patch: Patch<'_>, level: &Level, settings: &PaperSettings) -> () => compute_body
}

#[inline(always)]
fn compute_body(smoothness: &mut Smoothness, patch: Patch<'_>, level: &Level, settings: &PaperSettings) {
    let reach = settings.neighbours;
    let (width, height) = (patch.width, patch.height);
    let pitch = width + 2 * reach;
    let Smoothness { squared, points, rows } = smoothness;
    for plane in points.iter_mut().chain(rows.iter_mut()) {
        plane.clear();
        plane.resize(pitch * (height + 2 * reach), 0.0);
    }
    squared.clear();
    squared.resize(width * height, -1.0);

    let [xs, ys, zs, ns] = points;
    for y in 0..height {
        let at = (y + reach) * pitch + reach;
        let row = patch.row(y);
        let ray_y = ((patch.origin[1] + y as i32) as f32 - level.cy) / level.fy;
        let (xs, ys) = (&mut xs[at..at + width], &mut ys[at..at + width]);
        let (zs, ns) = (&mut zs[at..at + width], &mut ns[at..at + width]);
        for x in 0..width {
            let there = row[x] > 0.0;
            let z = if there { 1.0 / row[x] } else { 0.0 };
            xs[x] = ((patch.origin[0] + x as i32) as f32 - level.cx) / level.fx * z;
            ys[x] = ray_y * z;
            zs[x] = z;
            ns[x] = if there { 1.0 } else { 0.0 };
        }
    }
    for (sums, plane) in rows.iter_mut().zip([&*xs, &*ys, &*zs, &*ns]) {
        for y in reach..height + reach {
            let sums = &mut sums[y * pitch + reach..][..width];
            for d in 0..=2 * reach {
                for (sum, value) in sums.iter_mut().zip(&plane[y * pitch + d..][..width]) {
                    *sum += value;
                }
            }
        }
    }
    let all = ((2 * reach + 1) * (2 * reach + 1)) as f32;
    let mut sums = [vec![0.0_f32; width], vec![0.0; width], vec![0.0; width], vec![0.0; width]];
    for y in 0..height {
        for (sum, plane) in sums.iter_mut().zip(rows.iter()) {
            sum.fill(0.0);
            for d in 0..=2 * reach {
                for (sum, value) in sum.iter_mut().zip(&plane[(y + d) * pitch + reach..][..width]) {
                    *sum += value;
                }
            }
        }
        let at = (y + reach) * pitch + reach;
        let [px, py, pz, pn] =
            [&xs[at..at + width], &ys[at..at + width], &zs[at..at + width], &ns[at..at + width]];
        let [sx, sy, sz, sn] = &sums;
        let out = &mut squared[y * width..][..width];
        for x in 0..width {
            // The point itself adds nothing to the sum of displacements, but is counted.
            let count = if settings.holes == Holes::Skip { sn[x] } else { all };
            let [dx, dy, dz] = [sx[x] - count * px[x], sy[x] - count * py[x], sz[x] - count * pz[x]];
            let length = px[x] * px[x] + py[x] * py[x] + pz[x] * pz[x];
            let others = count - 1.0;
            let c2 = (dx * dx + dy * dy + dz * dz) / (others * others * length);
            out[x] = if pn[x] > 0.0 && others > 0.5 { c2 } else { -1.0 };
        }
    }
}

/// c^2 from which a point is an edge.
pub(super) fn edge_threshold(settings: &PaperSettings) -> f32 {
    (2.0 * settings.edge_ln_c).exp()
}

/// The points of one window that are features.
#[derive(Debug, Clone, Default)]
pub(super) struct Window {
    /// c^2 and index in the patch: edges by falling, planar points by rising smoothness.
    pub edges: Vec<(f32, usize)>,
    pub planes: Vec<(f32, usize)>,
}

impl Window {
    /// Picks the features among `pixels`, indices into `squared`.
    pub fn pick(&mut self, squared: &[f32], pixels: impl Iterator<Item = usize>, settings: &PaperSettings) {
        let threshold = edge_threshold(settings);
        self.edges.clear();
        self.planes.clear();
        for i in pixels {
            let c2 = squared[i];
            if c2 >= threshold {
                self.edges.push((c2, i));
            } else if c2 >= 0.0 {
                self.planes.push((c2, i));
            }
        }
        if self.edges.len() > settings.window_edges {
            self.edges.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
            self.edges.truncate(settings.window_edges);
        }
        if self.planes.len() > settings.window_planes {
            self.planes.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            self.planes.truncate(settings.window_planes);
        }
    }
}

/// Column or row ranges, in a patch that begins at image pixel `origin`, of the image's windows.
pub(super) fn windows(
    origin: i32,
    size: usize,
    window: usize,
) -> impl Iterator<Item = std::ops::Range<usize>> {
    let side = window as i32;
    let end = origin + size as i32;
    (origin.div_euclid(side)..=(end - 1).div_euclid(side)).map(move |i| {
        let (from, to) = ((i * side).max(origin), ((i + 1) * side).min(end));
        (from - origin) as usize..(to - origin) as usize
    })
}

/// The kind of each pixel of a whole level, at [`Level::index`].
pub(super) fn observed(level: &Level, settings: &PaperSettings) -> Vec<u8> {
    let mut smoothness = Smoothness::default();
    compute(Isa::best(), &mut smoothness, Patch::whole(level), level, settings);
    let mut kinds = vec![NONE; level.w.len()];
    let mut window = Window::default();
    for rows in windows(0, level.height, settings.window) {
        for columns in windows(0, level.width, settings.window) {
            let pixels = rows.clone().flat_map(|y| columns.clone().map(move |x| y * level.width + x));
            window.pick(&smoothness.squared, pixels, settings);
            for (kind, picked) in [(EDGE, &window.edges), (PLANE, &window.planes)] {
                for &(_, i) in picked {
                    kinds[level.index((i % level.width) as i32, (i / level.width) as i32)] = kind;
                }
            }
        }
    }
    kinds
}
