//! Edge and planar points of a point cloud image (the paper's equation "c", after Zhang and Singh 2014).

use std::ops::Range;

use nalgebra::Vector3;

use super::settings::{FeatureMatch, Holes, MAX_WINDOW, PaperSettings, Ranking};
use crate::hypotheses::Isa;
use crate::observation::Level;
use grip_sim::lanes::{F8, LANES, blocks, blocks_mut, per_machine};

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

    /// A row in blocks, with what follows it in the buffer.
    #[inline(always)]
    fn blocks(&self, y: usize, count: usize) -> &'a [[f32; LANES]] {
        blocks(self.values, self.start + y * self.pitch, count)
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
    /// One row of the patch: z, x and presence of its points, with margins of zeros.
    row: [Vec<f32>; 3],
    /// Sums of z, x, presence and y over the neighbours within a row, of the last rows: as many as a neighbourhood has.
    sums: [Vec<f32>; 4],
}

per_machine! {
    /// Computes [`Smoothness::squared`] of a patch of `level`.
    pub(super) fn compute(smoothness: &mut Smoothness, patch: Patch<'_>, level: &Level, settings: &PaperSettings) -> () => compute_body
}

#[inline(always)]
fn compute_body(smoothness: &mut Smoothness, patch: Patch<'_>, level: &Level, settings: &PaperSettings) {
    // The usual neighbourhood gets loops of its own, unrolled.
    match settings.neighbours {
        2 => compute_within(2, smoothness, patch, level, settings),
        reach => compute_within(reach, smoothness, patch, level, settings),
    }
}

#[inline(always)]
fn compute_within(
    reach: usize,
    smoothness: &mut Smoothness,
    patch: Patch<'_>,
    level: &Level,
    settings: &PaperSettings,
) {
    let (width, height) = (patch.width, patch.height);
    let rows = 2 * reach + 1;
    // Whole blocks: what lies beyond the width is computed and never read.
    let count = width.div_ceil(LANES);
    let pitch = count * LANES;
    let Smoothness { squared, row, sums } = smoothness;
    for line in row.iter_mut() {
        line.clear();
        line.resize(pitch + 2 * reach, 0.0);
    }
    for planes in sums.iter_mut() {
        planes.clear();
        planes.resize(pitch * rows, 0.0);
    }
    squared.clear();
    squared.resize(width * height + LANES, -1.0);

    let all = F8::all((rows * rows) as f32);
    let holes_count = settings.holes == Holes::Origin;
    let (one, zero) = (F8::all(1.0), F8::ZERO);
    let (cx, inverse_fx) = (F8::all(level.cx - patch.origin[0] as f32), F8::all(1.0 / level.fx));
    let ray_y = |y: usize| F8::all((patch.origin[1] as f32 + y as f32 - level.cy) / level.fy);
    let ray_x = |b: usize| (F8::INDEX + F8::all((b * LANES) as f32) - cx) * inverse_fx;
    // Beyond the patch's width there is no point, whatever the buffer holds.
    let inside = |b: usize| {
        let left = F8::all((width - b * LANES) as f32);
        left.above(F8::INDEX, one, zero)
    };
    let [rz, rx, rn] = row;
    for entering in 0..height + reach {
        let slot = (entering % rows) * pitch;
        let [sz, sx, sn, sy] = sums.each_mut().map(|planes| blocks_mut(planes, slot, count));
        if entering < height {
            let values = patch.blocks(entering, count);
            let ray_y = ray_y(entering);
            {
                let [rz, rx, rn] = [&mut *rz, rx, rn].map(|line| blocks_mut(line, reach, count));
                for b in 0..count {
                    let w = F8(values[b]);
                    let there = w.positive(inside(b), zero);
                    let z = there / w.positive(w, one);
                    rz[b] = z.0;
                    rx[b] = (ray_x(b) * z).0;
                    rn[b] = there.0;
                }
            }
            sum_along(rz, reach, sz);
            sum_along(rx, reach, sx);
            sum_along(rn, reach, sn);
            for b in 0..count {
                sy[b] = (ray_y * F8(sz[b])).0;
            }
        } else {
            for planes in [sz, sx, sn, sy] {
                planes.fill(F8::ZERO.0);
            }
        }
        let Some(y) = entering.checked_sub(reach) else { continue };
        let values = patch.blocks(y, count);
        let ray_y = ray_y(y);
        let planes = sums.each_ref().map(|planes| blocks(planes, 0, rows * count));
        let out = &mut squared[y * width..y * width + count * LANES];
        let out = &mut out.as_chunks_mut::<LANES>().0[..count];
        for b in 0..count {
            let w = F8(values[b]);
            if w == zero {
                continue;
            }
            let [mut sz, mut sx, mut sn, mut sy] = [zero; 4];
            for row in 0..rows {
                let at = row * count + b;
                sz += F8(planes[0][at]);
                sx += F8(planes[1][at]);
                sn += F8(planes[2][at]);
                sy += F8(planes[3][at]);
            }
            let there = w.positive(inside(b), zero);
            let z = there / w.positive(w, one);
            let (px, py) = (ray_x(b) * z, ray_y * z);
            // The point itself adds nothing to the sum of displacements, but is counted.
            let points = if holes_count { all } else { sn };
            let (dx, dy, dz) = (sx - points * px, sy - points * py, sz - points * z);
            let length = px * px + py * py + z * z;
            let others = points - one;
            let c2 = (dx * dx + dy * dy + dz * dz) / (others * others * length);
            let known = others.above(F8::all(0.5), there, zero);
            // What goes beyond the row is overwritten by the next one, and there is room after the last.
            out[b] = known.positive(c2, zero - one).0;
        }
    }
    squared.truncate(width * height);
}

/// Sums over the neighbours along a row, a neighbourhood `reach` to each side; the line has a margin as wide.
#[inline(always)]
fn sum_along(line: &[f32], reach: usize, out: &mut [[f32; LANES]]) {
    for (b, out) in out.iter_mut().enumerate() {
        let near = &line[b * LANES..b * LANES + LANES + 2 * reach];
        let mut sum = F8::ZERO;
        for eight in near.array_windows::<LANES>() {
            sum += F8(*eight);
        }
        *out = sum.0;
    }
}

/// c^2 from which a point is an edge.
pub(super) fn edge_threshold(settings: &PaperSettings) -> f32 {
    (2.0 * settings.edge_ln_c).exp()
}

/// Bits of a key under its rank: the place in the window, in scan order, and whether the point matches.
const PLACE_BITS: u32 = 5;
const LOW_BITS: u32 = (1 << (PLACE_BITS + 1)) - 1;
// The places of the largest window fit in a key.
const _: () = assert!(MAX_WINDOW * MAX_WINDOW <= 1 << PLACE_BITS);
/// The key of what is no feature: it sorts last.
const NO_FEATURE: u32 = u32::MAX;

/// The key of a point: those with the least keys are picked. Floats that are not negative sort as their bits do.
#[inline(always)]
fn key(rank: u32, ranking: Ranking, place: u32, matches: bool) -> u32 {
    let mask = if ranking == Ranking::Smoothness { !LOW_BITS } else { 0 };
    // The last value is taken.
    (rank & mask & !(1 << 31)) | place << 1 | u32::from(matches)
}

/// Features of hypotheses: how many, and how many match the observation's. The buffers hold what each column of a row of
/// windows has.
#[derive(Debug, Clone, Default)]
pub(super) struct Features {
    /// Points, and edges among them.
    points: Vec<u32>,
    edges: Vec<u32>,
    /// Edges and planar points that match.
    matched: [Vec<u32>; 2],
    /// The least key of a planar point, and the next.
    least: [Vec<u32>; 2],
    /// Columns' places in their windows.
    places: Vec<u32>,
    /// Keys of one window.
    keys: Vec<u32>,
}

/// Pixels whose features are wanted.
#[derive(Clone, Copy)]
pub(super) struct Ranked<'a> {
    /// c^2, row by row.
    pub squared: &'a [f32],
    /// The kind of which a pixel is a match.
    pub matches: &'a [u8],
    /// Pixels a row, and the pixel of the image where they begin.
    pub width: usize,
    pub height: usize,
    pub origin: [i32; 2],
}

impl Ranked<'_> {
    /// The window's pixels `(index, place)`, in scan order.
    fn window(
        &self,
        rows: &Range<usize>,
        columns: &Range<usize>,
        side: usize,
    ) -> impl Iterator<Item = (usize, u32)> {
        let place = move |x: usize, y: usize| {
            let [u, v] =
                [(x, 0), (y, 1)].map(|(at, axis)| (self.origin[axis] + at as i32).rem_euclid(side as i32));
            (v * side as i32 + u) as u32
        };
        let columns = columns.clone();
        rows.clone().flat_map(move |y| columns.clone().map(move |x| (y * self.width + x, place(x, y))))
    }
}

impl Features {
    /// How many edges (0) and planar points (1) there are within the limits, and how many of them match: `[found, matched]`.
    #[inline(always)]
    pub fn count(&mut self, ranked: Ranked<'_>, settings: &PaperSettings) -> [[usize; 2]; 2] {
        let (width, side) = (ranked.width, settings.window);
        let limits = [settings.window_edges, settings.window_planes];
        let mut counts = [[0; 2]; 2];
        for rows in windows(ranked.origin[1], ranked.height, side) {
            self.columns(ranked, &rows, settings);
            for columns in windows(ranked.origin[0], width, side) {
                let sum = |values: &[u32]| values[columns.clone()].iter().sum::<u32>() as usize;
                let (points, edges) = (sum(&self.points), sum(&self.edges));
                if points == 0 {
                    continue;
                }
                for (kind, there) in [edges, points - edges].into_iter().enumerate() {
                    let most = limits[kind];
                    let [found, matched] = &mut counts[kind];
                    *found += there.min(most);
                    *matched += if there == 0 {
                        0
                    } else if there <= most {
                        sum(&self.matched[kind])
                    } else if kind == 1 && most == 2 {
                        let (mut least, mut next) = (NO_FEATURE, NO_FEATURE);
                        for key in self.least.iter().flat_map(|keys| &keys[columns.clone()]) {
                            next = next.min(least.max(*key));
                            least = least.min(*key);
                        }
                        ((least & 1) + (next & 1)) as usize
                    } else {
                        let picked = pick(&mut self.keys, ranked, [&rows, &columns], kind, most, settings);
                        picked.iter().filter(|key| *key & 1 == 1).count()
                    };
                }
            }
        }
        counts
    }

    /// Sums and least keys down each column of some rows.
    #[inline(always)]
    fn columns(&mut self, ranked: Ranked<'_>, rows: &Range<usize>, settings: &PaperSettings) {
        let Self {
            points,
            edges,
            matched: [matched_edges, matched_planes],
            least: [least, next],
            places,
            ..
        } = self;
        let width = ranked.width;
        for sums in [&mut *points, edges, matched_edges, matched_planes] {
            sums.clear();
            sums.resize(width, 0);
        }
        for keys in [&mut *least, next] {
            keys.clear();
            keys.resize(width, NO_FEATURE);
        }
        let (points, edges) = (&mut points[..width], &mut edges[..width]);
        let (matched_edges, matched_planes) = (&mut matched_edges[..width], &mut matched_planes[..width]);
        let (least, next) = (&mut least[..width], &mut next[..width]);
        let (threshold, side) = (edge_threshold(settings), settings.window as u32);
        let first = ranked.origin[0].rem_euclid(side as i32) as u32;
        // A division for each pixel of each row would cost more than all the rest.
        if places.len() != width || places.first() != Some(&first) {
            places.clear();
            places.extend((0..width as u32).map(|x| (first + x) % side));
        }
        let places = &places[..width];
        for y in rows.clone() {
            let squared = &ranked.squared[y * width..][..width];
            let matches = &ranked.matches[y * width..][..width];
            let row = (ranked.origin[1] + y as i32).rem_euclid(side as i32) as u32 * side;
            for x in 0..width {
                let (c2, kind) = (squared[x], u32::from(matches[x]));
                let is_point = c2 >= 0.0;
                let is_edge = c2 >= threshold;
                let is_plane = is_point & !is_edge;
                points[x] += u32::from(is_point);
                edges[x] += u32::from(is_edge);
                let matched = [EDGE, PLANE].map(|of| u32::from(kind & u32::from(of) != 0));
                matched_edges[x] += matched[0] & u32::from(is_edge);
                matched_planes[x] += matched[1] & u32::from(is_plane);
                let place = row + places[x];
                let key = key(c2.to_bits(), settings.ranking, place, matched[1] == 1);
                let key = if is_plane { key } else { NO_FEATURE };
                next[x] = next[x].min(least[x].max(key));
                least[x] = least[x].min(key);
            }
        }
    }
}

/// Keys of the features of a kind in a window, at most `most`; in any order.
fn pick<'a>(
    keys: &'a mut Vec<u32>,
    ranked: Ranked<'_>,
    [rows, columns]: [&Range<usize>; 2],
    kind: usize,
    most: usize,
    settings: &PaperSettings,
) -> &'a [u32] {
    let threshold = edge_threshold(settings);
    keys.clear();
    keys.extend(ranked.window(rows, columns, settings.window).filter_map(|(i, place)| {
        let c2 = ranked.squared[i];
        let is = c2 >= 0.0 && (c2 >= threshold) == (kind == 0);
        let rank = if kind == 0 { !c2.to_bits() } else { c2.to_bits() };
        is.then(|| key(rank, settings.ranking, place, ranked.matches[i] & [EDGE, PLANE][kind] != 0))
    }));
    if keys.len() > most {
        keys.select_nth_unstable(most);
        keys.truncate(most);
    }
    keys
}

/// Column or row ranges, in a patch that begins at image pixel `origin`, of the image's windows.
pub(super) fn windows(origin: i32, size: usize, window: usize) -> impl Iterator<Item = Range<usize>> {
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
    let (width, height, side) = (level.width, level.height, settings.window);
    let unmatched = vec![NONE; width * height];
    let squared = &smoothness.squared;
    let ranked = Ranked { squared, matches: &unmatched, width, height, origin: [0, 0] };
    let limits = [settings.window_edges, settings.window_planes]
        .map(|most| if settings.limit_observed { most } else { usize::MAX });
    let mut keys = Vec::new();
    for rows in windows(0, height, side) {
        for columns in windows(0, width, side) {
            for (kind, most) in limits.into_iter().enumerate() {
                for key in pick(&mut keys, ranked, [&rows, &columns], kind, most, settings) {
                    let place = (key & LOW_BITS) as usize >> 1;
                    let (u, v) = (columns.start + place % side, rows.start + place / side);
                    kinds[level.index(u as i32, v as i32)] = [EDGE, PLANE][kind];
                }
            }
        }
    }
    match settings.feature_match {
        FeatureMatch::Pixel => kinds,
        FeatureMatch::Near => nearby(&kinds, level, settings.epsilon_m as f32),
    }
}

/// The kinds of features within `epsilon` of each point of a level.
fn nearby(kinds: &[u8], level: &Level, epsilon: f32) -> Vec<u8> {
    let mut near = vec![NONE; kinds.len()];
    let point = |u: i32, v: i32| {
        let w = level.w[level.index(u, v)];
        let ray = Vector3::new((u as f32 - level.cx) / level.fx, (v as f32 - level.cy) / level.fy, 1.0);
        (w > 0.0).then(|| ray / w)
    };
    let (width, height) = (level.width as i32, level.height as i32);
    for v in 0..height {
        for u in 0..width {
            let Some(from) = point(u, v).filter(|_| kinds[level.index(u, v)] != NONE) else { continue };
            let reach = |focal: f32| (epsilon * focal / from.z) as i32;
            let (across, down) = (reach(level.fx), reach(level.fy));
            for y in (v - down).max(0)..=(v + down).min(height - 1) {
                for x in (u - across).max(0)..=(u + across).min(width - 1) {
                    if point(x, y).is_some_and(|to| (to - from).norm() < epsilon) {
                        near[level.index(x, y)] |= kinds[level.index(u, v)];
                    }
                }
            }
        }
    }
    near
}
