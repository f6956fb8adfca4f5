//! How far the picture and the print at a pose agree in structure.
//!
//! Exposure, the light's colour, blur, sharpening and compression change what values a print has in a picture, not where it is
//! dark and where it is red. So looks are correlated (Pearson): in cells of two sizes, each about its own mean, and over the
//! whole object, after what is linear in the surface's normal, which is shading by lights far away, is taken out of both. Each for
//! brightness and for colour: six correlations, from -1 to 1; the agreement is their mean. Colour and depth image of real
//! cameras, and the print of a scan and its shape, are some pixels apart: the shift that agrees best counts.

use grip_sim::lanes::{F8, Isa, LANES, blocks, per_machine};
use nalgebra::{Matrix4, SMatrix, Vector4};

use super::picture::PictureLevel;
use super::sheet::{CELL, Sheet};

/// What correlates must be larger than this, standard deviation of a look: noise and compression of a picture.
const FLOOR: f32 = 0.02;
/// Channels of a look that are correlated together: brightness, and colour.
const GROUPS: [&[usize]; 2] = [&[0], &[1, 2]];
/// What the largest shift along one side costs; less ones in proportion to their square. Without it a can could turn as well as
/// shift.
const SHIFT_COST: f32 = 0.1;
/// Correlations of which the mean is taken.
const CORRELATIONS: f32 = 6.0;

/// Sums over the drawn pixels of a cell, by channel.
#[derive(Debug, Clone, Copy, Default)]
struct PrintSums {
    pixels: f32,
    print: [f32; 3],
    squares: [f32; 3],
}

/// The same of what is observed there.
#[derive(Debug, Clone, Copy, Default)]
struct SeenSums {
    seen: [f32; 3],
    squares: [f32; 3],
    /// Times the print,
    products: [f32; 3],
    /// and times the print without shading.
    unshaded: [f32; 3],
}

/// Of what is observed times each component of the normal, over all pixels, by channel.
type NormalSums = [[f32; 3]; 3];

/// A print at a pose, ready to be compared with a picture.
#[derive(Debug)]
pub(super) struct Prepared {
    sheet: Sheet,
    /// The print less its mean and what is linear in the normal, by channel, and the sum of its squares.
    unshaded: [Vec<f32>; 3],
    squares: [f32; 3],
    /// Inverse of the sums of products of `(normal, 1)`.
    shading: Matrix4<f32>,
    cells: Vec<PrintSums>,
}

/// How a print at a pose agrees with the picture.
#[derive(Debug, Clone, Copy)]
pub(super) struct Agreement {
    /// -1 to 1.
    pub total: f32,
    /// Pixels compared.
    pub pixels: usize,
    /// Of the picture against the depth image, pixels of the level.
    pub shift: [i32; 2],
}

/// `(normal, 1)` of a pixel.
fn basis(sheet: &Sheet, i: usize) -> Vector4<f64> {
    let [x, y, z] = [0, 1, 2].map(|k| f64::from(sheet.normals[k][i]));
    Vector4::new(x, y, z, 1.0)
}

impl Prepared {
    /// `None` where nothing of the print is seen.
    pub fn new(sheet: Sheet) -> Option<Self> {
        let drawn: Vec<usize> = (0..sheet.mask.len()).filter(|i| sheet.mask[*i] > 0.0).collect();
        let mut products = Matrix4::<f64>::zeros();
        let mut with_print = SMatrix::<f64, 4, 3>::zeros();
        for &i in &drawn {
            let normal = basis(&sheet, i);
            products += normal * normal.transpose();
            for c in 0..3 {
                with_print.column_mut(c).axpy(f64::from(sheet.looks[c][i]), &normal, 1.0);
            }
        }
        // A flat face has one normal: a little damping decides between that and the constant.
        let damping = Matrix4::from_diagonal_element(1e-4 * products[(3, 3)]);
        let shading = (products + damping).try_inverse()?;
        let slopes = shading * with_print;
        let columns = sheet.width / CELL;
        let mut cells = vec![PrintSums::default(); columns * (sheet.height / CELL)];
        let mut unshaded = [0; 3].map(|_| vec![0.0; sheet.mask.len()]);
        let mut squares = [0.0; 3];
        for i in drawn {
            let normal = basis(&sheet, i);
            let cell = &mut cells[i / sheet.width / CELL * columns + i % sheet.width / CELL];
            cell.pixels += 1.0;
            for c in 0..3 {
                let look = sheet.looks[c][i];
                let left = look - slopes.column(c).dot(&normal) as f32;
                unshaded[c][i] = left;
                squares[c] += left * left;
                cell.print[c] += look;
                cell.squares[c] += look * look;
            }
        }
        Some(Self { sheet, unshaded, squares, shading: shading.cast(), cells })
    }

    /// At the shift that agrees best of those up to `reach` pixels along each side from `about`. One of `most` pixels along one
    /// side costs [`SHIFT_COST`].
    pub fn agreement(&self, picture: &PictureLevel, about: [i32; 2], reach: i32, most: f32) -> Agreement {
        let mut seen = vec![SeenSums::default(); self.cells.len()];
        let cost = |d: i32| SHIFT_COST * (d as f32 / most.max(1.0)).powi(2);
        let mut best = Agreement { total: f32::MIN, pixels: self.sheet.pixels, shift: about };
        for v in -reach..=reach {
            for u in -reach..=reach {
                let shift = [about[0] + u, about[1] + v];
                let normals = sums(Isa::best(), self, picture, shift, &mut seen);
                let total = self.total(&seen, &normals) - cost(shift[0]) - cost(shift[1]);
                if total > best.total {
                    best = Agreement { total, shift, ..best };
                }
            }
        }
        best
    }

    /// The mean of the correlations.
    fn total(&self, seen: &[SeenSums], normals: &NormalSums) -> f32 {
        let (columns, rows) = (self.sheet.width / CELL, self.sheet.height / CELL);
        let wide = columns / 2;
        let quarters = |i: usize| {
            let first = 2 * (i / wide) * columns + 2 * (i % wide);
            [first, first + 1, first + columns, first + columns + 1]
        };
        let mut total = 0.0;
        for channels in GROUPS {
            // Covariance and variances: in cells, in wide cells and, without shading, over all.
            let mut pooled = [[0.0f32; 3]; 3];
            for &c in channels {
                let (mut a, mut aa, mut unshaded) = (0.0, 0.0, 0.0);
                for i in 0..wide * (rows / 2) {
                    let mut sum = Moments::default();
                    for (print, seen) in quarters(i).map(|q| (&self.cells[q], &seen[q])) {
                        let cell = Moments {
                            n: print.pixels,
                            a: seen.seen[c],
                            aa: seen.squares[c],
                            b: print.print[c],
                            bb: print.squares[c],
                            ab: seen.products[c],
                        };
                        add(&mut pooled[0], cell.central());
                        sum.add(&cell);
                        unshaded += seen.unshaded[c];
                    }
                    add(&mut pooled[1], sum.central());
                    a += sum.a;
                    aa += sum.aa;
                }
                let [x, y, z] = normals[c];
                let with = Vector4::new(x, y, z, a);
                // The print without shading has no part in the shading of what is observed.
                let shading = with.dot(&(self.shading * with));
                add(&mut pooled[2], [unshaded, aa - shading, self.squares[c]]);
            }
            let floor = FLOOR * FLOOR * self.sheet.pixels as f32 * channels.len() as f32;
            for [ab, aa, bb] in pooled {
                total += ab / ((aa.max(0.0) + floor) * (bb.max(0.0) + floor)).sqrt();
            }
        }
        total / CORRELATIONS
    }
}

fn add(sums: &mut [f32; 3], more: [f32; 3]) {
    for (sum, more) in sums.iter_mut().zip(more) {
        *sum += more;
    }
}

/// Number of pixels, and sums of what is observed (a), of the print (b), and of their products.
#[derive(Debug, Clone, Copy, Default)]
struct Moments {
    n: f32,
    a: f32,
    aa: f32,
    b: f32,
    bb: f32,
    ab: f32,
}

impl Moments {
    fn add(&mut self, other: &Self) {
        self.n += other.n;
        self.a += other.a;
        self.aa += other.aa;
        self.b += other.b;
        self.bb += other.bb;
        self.ab += other.ab;
    }

    /// The sums of products ab, aa and bb about the means.
    fn central(&self) -> [f32; 3] {
        let Self { n, a, aa, b, bb, ab } = *self;
        if n > 0.0 { [ab - a * b / n, aa - a * a / n, bb - b * b / n] } else { [0.0; 3] }
    }
}

per_machine! {
    /// Sums of the picture, shifted, over the drawn pixels of each cell.
    fn sums(
        prepared: &Prepared,
        picture: &PictureLevel,
        shift: [i32; 2],
        cells: &mut [SeenSums],
    ) -> NormalSums => sums_body
}

#[inline(always)]
fn sums_body(
    prepared: &Prepared,
    picture: &PictureLevel,
    [du, dv]: [i32; 2],
    cells: &mut [SeenSums],
) -> NormalSums {
    let Prepared { sheet, unshaded, .. } = prepared;
    let columns = sheet.width / LANES;
    let mut normals = [[F8::ZERO; 3]; 3];
    for (i, cell) in cells.iter_mut().enumerate() {
        *cell = SeenSums::default();
        if prepared.cells[i].pixels == 0.0 {
            continue;
        }
        let (x, y) = (i % columns * LANES, i / columns * CELL);
        let mut sums = [[F8::ZERO; 4]; 3];
        for row in 0..CELL {
            let here = (y + row) * sheet.width + x;
            let there = picture.index(sheet.u0 + x as i32 + du, sheet.v0 + (y + row) as i32 + dv);
            let block = |values: &[f32], at: usize| F8(blocks(values, at, 1)[0]);
            let mask = block(&sheet.mask, here);
            let normal = [0, 1, 2].map(|k| block(&sheet.normals[k], here));
            for c in 0..3 {
                let a = block(&picture.looks[c], there) * mask;
                sums[c][0] += a;
                sums[c][1] += a * a;
                sums[c][2] += a * block(&sheet.looks[c], here);
                sums[c][3] += a * block(&unshaded[c], here);
                for k in 0..3 {
                    normals[c][k] += a * normal[k];
                }
            }
        }
        for (c, sums) in sums.iter().enumerate() {
            let [a, aa, ab, left] = sums.map(F8::sum);
            (cell.seen[c], cell.squares[c], cell.products[c], cell.unshaded[c]) = (a, aa, ab, left);
        }
    }
    normals.map(|channel| channel.map(F8::sum))
}
