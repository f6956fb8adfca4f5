//! Hashes, noise that repeats, and the loop that fills a picture: what all textures are made from.

use image::RgbImage;
use rayon::prelude::*;

/// Fills a square picture of `size` pixels from a function of position, 0 to 1 along each side, to sRGB, 0 to 1.
pub(super) fn paint(size: u32, color: impl Fn(f32, f32) -> [f32; 3] + Sync) -> RgbImage {
    let at = |i: usize| (i as f32 + 0.5) / size as f32;
    let mut pixels = vec![0_u8; 3 * (size * size) as usize];
    pixels.par_chunks_mut(3 * size as usize).enumerate().for_each(|(y, row)| {
        for (x, pixel) in row.as_chunks_mut::<3>().0.iter_mut().enumerate() {
            *pixel = color(at(x), at(y)).map(encode);
        }
    });
    RgbImage::from_raw(size, size, pixels).unwrap_or_default()
}

/// The 8-bit code of a channel, 0 to 1.
pub(super) fn encode(channel: f32) -> u8 {
    (channel.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

/// A fixed random number, 0 to 1, for each cell (a 32-bit integer hash, after Wellons' lowbias32).
pub(super) fn random(seed: u32, x: u32, y: u32) -> f32 {
    let mut h = seed.wrapping_mul(0x9e37_79b9).wrapping_add(x).wrapping_mul(0x85eb_ca6b).wrapping_add(y);
    for multiplier in [0x7feb_352d_u32, 0x846c_a68b] {
        h = (h ^ (h >> 16)).wrapping_mul(multiplier);
    }
    ((h ^ (h >> 16)) >> 8) as f32 / (1 << 24) as f32
}

/// Value noise, 0 to 1, that repeats after `period` cells; for positions that are not negative.
pub(super) fn noise(x: f32, y: f32, period: [u32; 2], seed: u32) -> f32 {
    let (x0, y0) = (x as u32, y as u32);
    let (fx, fy) = (smooth(x - x0 as f32), smooth(y - y0 as f32));
    let (x0, y0) = (x0 % period[0], y0 % period[1]);
    let next = |i: u32, period: u32| if i + 1 < period { i + 1 } else { 0 };
    let (x1, y1) = (next(x0, period[0]), next(y0, period[1]));
    let top = random(seed, x0, y0) * (1.0 - fx) + random(seed, x1, y0) * fx;
    let bottom = random(seed, x0, y1) * (1.0 - fx) + random(seed, x1, y1) * fx;
    top * (1.0 - fy) + bottom * fy
}

/// Octaves of [`noise`], 0 to 1.
pub(super) fn fractal(x: f32, y: f32, period: [u32; 2], seed: u32, octaves: u32) -> f32 {
    let (mut sum, mut weight) = (0.0, 0.0);
    for octave in 0..octaves {
        let scale = (1 << octave) as f32;
        let period = period.map(|p| p << octave);
        sum += noise(x * scale, y * scale, period, seed.wrapping_add(octave * 101)) / scale;
        weight += 1.0 / scale;
    }
    sum / weight
}

/// Octaves of value noise, 0 to 1, over a picture, from tables: several times faster than [`fractal`].
pub(super) struct Cloud {
    /// Columns, rows, random numbers of the nodes and weight, one for each octave.
    octaves: Vec<(i32, i32, Vec<f32>, f32)>,
}

impl Cloud {
    /// With `cells` along each side of the picture in the first octave.
    pub(super) fn new(cells: [u32; 2], seed: u32, octaves: u32) -> Self {
        let total: f32 = (0..octaves).map(|octave| 0.5_f32.powi(octave as i32)).sum();
        let octave = |octave: u32| {
            let [columns, rows] = cells.map(|c| c << octave);
            let seed = seed.wrapping_add(octave * 101);
            let nodes = (0..columns * rows).map(|i| random(seed, i % columns, i / columns)).collect();
            (columns as i32, rows as i32, nodes, 0.5_f32.powi(octave as i32) / total)
        };
        Self { octaves: (0..octaves).map(octave).collect() }
    }

    /// At a position, 0 to 1 along each side; it repeats outside.
    #[inline]
    pub(super) fn at(&self, x: f32, y: f32) -> f32 {
        let (x, y) = (fraction(x), fraction(y));
        let mut sum = 0.0;
        for (columns, rows, nodes, weight) in &self.octaves {
            let (x0, x1, fx) = between(x, *columns);
            let (y0, y1, fy) = between(y, *rows);
            let (above, below) = (y0 * columns, y1 * columns);
            let node = |i: i32| nodes[i as u32 as usize];
            let (a, b) = (node(above + x0), node(below + x0));
            let top = a + (node(above + x1) - a) * fx;
            let bottom = b + (node(below + x1) - b) * fx;
            sum += weight * (top + (bottom - top) * fy);
        }
        sum
    }
}

/// The two nodes beside a position, 0 to 1, on a circle of `count`, and how far it is towards the second. (32-bit signed
/// numbers: the conversion from floating point is several times faster than to `usize`.)
#[inline]
fn between(t: f32, count: i32) -> (i32, i32, f32) {
    let t = t * count as f32;
    let lower = (t as i32).min(count - 1);
    (lower, if lower + 1 < count { lower + 1 } else { 0 }, smooth(t - lower as f32))
}

/// A point of a pattern of irregular cells.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cell {
    /// A random number, 0 to 1, of this cell.
    pub id: f32,
    /// Distance to its seed point, squares of the grid.
    pub distance: f32,
    /// How much farther the next seed point is: about twice the distance to the cell's edge.
    pub gap: f32,
}

/// Irregular cells over a picture, about one seed point in each square of a grid (Worley 1996).
pub(super) struct Cells {
    count: usize,
    /// Where in its square each seed point is, and its random number.
    points: Vec<[f32; 3]>,
}

impl Cells {
    /// With `count` squares along each side.
    pub(super) fn new(count: u32, seed: u32) -> Self {
        let of = |salt: u32, i: u32| random(seed ^ salt, i % count, i / count);
        // Not the whole square: so no two points meet, and the next one is nearly always in the nine squares looked at.
        let place = |t: f32| 0.1 + 0.8 * t;
        let point = |i| [place(of(0, i)), place(of(0x5bd1_e995, i)), of(0x27d4_eb2f, i)];
        Self { count: count as usize, points: (0..count * count).map(point).collect() }
    }

    /// The cell at a position, 0 to 1 along each side; it repeats outside.
    pub(super) fn at(&self, x: f32, y: f32) -> Cell {
        let (x, y) = (fraction(x) * self.count as f32, fraction(y) * self.count as f32);
        let last = self.count - 1;
        let (i, j) = ((x as i32 as usize).min(last), (y as i32 as usize).min(last));
        let (x, y) = (x - i as f32, y - j as f32);
        let around = |i: usize| [if i > 0 { i - 1 } else { last }, i, if i < last { i + 1 } else { 0 }];
        let (mut first, mut second, mut id) = (f32::INFINITY, f32::INFINITY, 0.0);
        for (row, dy) in around(j).into_iter().zip([-1.0, 0.0, 1.0]) {
            for (column, dx) in around(i).into_iter().zip([-1.0, 0.0, 1.0]) {
                let [px, py, own] = self.points[row * self.count + column];
                let (px, py) = (px + dx - x, py + dy - y);
                let squared = px * px + py * py;
                if squared < first {
                    (second, first, id) = (first, squared, own);
                } else if squared < second {
                    second = squared;
                }
            }
        }
        let distance = first.sqrt();
        Cell { id, distance, gap: second.sqrt() - distance }
    }
}

/// What is left of `t` above the next lower whole number. (The library's `fract` and `floor` are calls, and this is the
/// innermost loop.)
pub(super) fn fraction(t: f32) -> f32 {
    let rest = t - (t as i32) as f32;
    if rest < 0.0 { rest + 1.0 } else { rest }
}

/// Distance from the origin (`hypot` without its care for very large numbers).
pub(super) fn length(x: f32, y: f32) -> f32 {
    (x * x + y * y).sqrt()
}

/// 0 to 1 with a level start and end; `t` 0 to 1.
pub(super) fn smooth(t: f32) -> f32 {
    t * t * (3.0 - 2.0 * t)
}

/// 0 below `low`, 1 above `high`, smooth between.
pub(super) fn ramp(low: f32, high: f32, t: f32) -> f32 {
    smooth(((t - low) / (high - low)).clamp(0.0, 1.0))
}

/// Distance on a circle of length 1.
pub(super) fn wrap_distance(a: f32, b: f32) -> f32 {
    let d = (a - b).abs();
    d.min(1.0 - d)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_repeats_after_its_period() {
        for i in 0..50 {
            let t = i as f32 * 0.137;
            let a = noise(t, 2.3, [7, 5], 1);
            assert!((a - noise(t + 7.0, 2.3 + 5.0, [7, 5], 1)).abs() < 1e-4);
        }
    }

    #[test]
    fn clouds_and_cells_repeat_over_the_picture_and_have_no_steps() {
        let (cloud, cells) = (Cloud::new([3, 7], 5, 3), Cells::new(9, 4));
        for i in 0..500 {
            let (x, y) = (i as f32 * 0.0197, i as f32 * 0.0113);
            assert!((cloud.at(x, y) - cloud.at(x + 1.0, y + 1.0)).abs() < 1e-3);
            assert!((cloud.at(x, y) - cloud.at(x + 1e-4, y)).abs() < 0.01);
            assert!((cells.at(x, y).distance - cells.at(x + 1.0, y + 1.0).distance).abs() < 1e-3);
            assert!((cells.at(x, y).gap - cells.at(x + 1e-4, y).gap).abs() < 0.01);
        }
    }

    #[test]
    fn clouds_are_fractal_noise() {
        let cloud = Cloud::new([3, 7], 5, 3);
        for i in 0..50 {
            let (x, y) = (i as f32 * 0.0137, i as f32 * 0.0171);
            assert!((cloud.at(x, y) - fractal(x * 3.0, y * 7.0, [3, 7], 5, 3)).abs() < 1e-4);
        }
    }
}
