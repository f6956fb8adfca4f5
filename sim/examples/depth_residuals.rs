//! What the depth pictures of a BOP data set are worth: how they differ from the models at their true poses.
//!
//! ```sh
//! cargo run --release -p grip-sim --example depth_residuals -- SET [SPLIT]
//! ```
//!
//! The depth presets `xtion` and `fetch-head` are made from what it prints of real frames; of a set of `grip scenes
//! --depth-noise xtion` it prints about the same.

use std::error::Error;
use std::path::PathBuf;

use grip_sim::bop::Dataset;
use grip_sim::images::{DepthImage, Image};
use grip_sim::render::object_depth;
use nalgebra::{Matrix6, Vector3, Vector6};

/// Readings farther from the model than this are of something else, metres.
const SAME_M: f32 = 0.025;
/// The rim of an object, pixels: edges are looked at apart.
const RIM_PX: usize = 6;
/// Objects with fewer pixels are left out; and surfaces more tilted than this (cosine) when noise is measured.
const LEAST_PX: usize = 400;
const LEAST_COS: f64 = 0.35;
/// Distances of pixels at which noise is correlated, and limits of cosines between which lost readings are counted.
const LAGS: [usize; 5] = [1, 2, 4, 8, 16];
const COSINES: [f64; 8] = [0.0, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.01];

/// One object in one picture.
struct Measured {
    /// Mean distance and offset, metres.
    z: f64,
    offset: f64,
    /// Standard deviation after the best rigid motion, metres over z^2; products of such errors at each lag over z^4.
    sigma: f64,
    products: [f64; LAGS.len()],
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let usage = "usage: depth_residuals SET [SPLIT], a data set in BOP's format";
    let folder = PathBuf::from(arguments.next().ok_or(usage)?);
    let set = Dataset::open(&folder, arguments.next().as_deref())?;
    let mut measured = Vec::new();
    // Pixels, and those of them without reading.
    let mut by_cosine = [[0_u64; 2]; COSINES.len() - 1];
    let mut by_rim = [[0_u64; 2]; 2 * RIM_PX];
    for scene in set.scenes()? {
        for image in set.images(scene)? {
            let frame = set.frame(scene, image)?;
            for truth in frame.truth()? {
                let mesh = set.load_model(truth.obj_id)?.mesh;
                let object = object_depth(&mesh, &truth.camera_from_object, &frame.intrinsics);
                let [columns, rows] = object.size();
                let points = Image::from_vec(
                    columns,
                    rows,
                    (0..columns * rows)
                        .map(|i| {
                            let z = object.depth.data()[i];
                            let [u, v] = [i % columns + object.offset[0], i / columns + object.offset[1]];
                            (z > 0.0)
                                .then(|| frame.intrinsics.back_project(u as f64, v as f64, z.into()).coords)
                        })
                        .collect(),
                );
                let Some(points) = points else { continue };
                let hidden = hidden(&object.depth, &frame.depth, object.offset);
                let distance = to_rim(&points);
                let mut pixels: Vec<(usize, f64, Vector6<f64>)> = Vec::new();
                for v in 1..rows.saturating_sub(1) {
                    for u in 1..columns.saturating_sub(1) {
                        let at = v * columns + u;
                        let reading = *frame.depth.at(u + object.offset[0], v + object.offset[1]);
                        if points.data()[at].is_none() || *hidden.at(u, v) {
                            continue;
                        }
                        let rim = distance[at];
                        if rim < 2 * RIM_PX {
                            by_rim[rim][0] += 1;
                            by_rim[rim][1] += u64::from(reading == 0.0);
                        }
                        let Some((point, normal)) = normal(&points, u, v) else { continue };
                        if rim < RIM_PX {
                            continue;
                        }
                        let cos = -normal.dot(&point.normalize());
                        let bin = COSINES.windows(2).position(|bin| (bin[0]..bin[1]).contains(&cos));
                        if let Some(bin) = bin {
                            by_cosine[bin][0] += 1;
                            by_cosine[bin][1] += u64::from(reading == 0.0);
                        }
                        let error = reading - object.depth.data()[at];
                        if reading > 0.0 && error.abs() < SAME_M && cos > LEAST_COS {
                            // How depth along the pixel's ray changes with a small motion of the object.
                            let along = normal.dot(&(point / point.z));
                            let turn = point.cross(&normal) / along;
                            let shift = normal / along;
                            let jacobian = Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z);
                            pixels.push((at, error.into(), jacobian));
                        }
                    }
                }
                measured.extend(measure(&pixels, &points));
            }
        }
    }
    print(&mut measured, &by_cosine, &by_rim)
}

/// Where something stands before the object, and about it.
fn hidden(object: &DepthImage, depth: &DepthImage, offset: [usize; 2]) -> Image<bool> {
    let (columns, rows) = (object.width(), object.height());
    let before = |u: usize, v: usize| {
        let (reading, z) = (*depth.at(u + offset[0], v + offset[1]), *object.at(u, v));
        reading > 0.0 && z > 0.0 && reading < z - SAME_M
    };
    let mut hidden = Image::filled(columns, rows, false);
    for v in 0..rows {
        for u in 0..columns {
            if before(u, v) {
                for y in v.saturating_sub(RIM_PX)..(v + RIM_PX + 1).min(rows) {
                    for x in u.saturating_sub(RIM_PX)..(u + RIM_PX + 1).min(columns) {
                        *hidden.at_mut(x, y) = true;
                    }
                }
            }
        }
    }
    hidden
}

/// Distance of each pixel to the object's rim along columns or rows, pixels.
fn to_rim(points: &Image<Option<Vector3<f64>>>) -> Vec<usize> {
    let (columns, rows) = (points.width(), points.height());
    let mut distance = vec![0; columns * rows];
    let inside = |u: usize, v: usize| u < columns && v < rows && points.at(u, v).is_some();
    for v in 0..rows {
        for u in 0..columns {
            let free = |k: usize| {
                u >= k
                    && v >= k
                    && inside(u - k, v)
                    && inside(u + k, v)
                    && inside(u, v - k)
                    && inside(u, v + k)
            };
            distance[v * columns + u] = (1..=2 * RIM_PX).take_while(|k| free(*k)).count();
        }
    }
    distance
}

/// Point and outward normal of a pixel, from its neighbours; none across a fold.
fn normal(points: &Image<Option<Vector3<f64>>>, u: usize, v: usize) -> Option<(Vector3<f64>, Vector3<f64>)> {
    let at = |u: usize, v: usize| *points.at(u, v);
    let (here, right, left) = (at(u, v)?, at(u + 1, v)?, at(u - 1, v)?);
    let (below, above) = (at(u, v + 1)?, at(u, v - 1)?);
    let smooth = |a: Vector3<f64>, b: Vector3<f64>| ((a + b) / 2.0 - here).norm() < 0.002;
    let normal = (below - above).cross(&(right - left)).try_normalize(1e-12)?;
    (smooth(left, right) && smooth(above, below))
        .then(|| (here, if normal.dot(&here) > 0.0 { -normal } else { normal }))
}

/// What is left of the errors of one object when it is moved to where it fits best.
fn measure(pixels: &[(usize, f64, Vector6<f64>)], points: &Image<Option<Vector3<f64>>>) -> Option<Measured> {
    if pixels.len() < LEAST_PX {
        return None;
    }
    let mut weights = vec![1.0; pixels.len()];
    let mut motion = Vector6::zeros();
    let mut sigma = 0.0;
    for _ in 0..6 {
        let (mut left, mut right) = (Matrix6::from_diagonal_element(1e-9), Vector6::zeros());
        for ((_, error, jacobian), weight) in pixels.iter().zip(&weights) {
            left += jacobian * jacobian.transpose() * *weight;
            right += jacobian * (error * weight);
        }
        motion = left.cholesky()?.solve(&right);
        let mut sizes: Vec<f64> = pixels.iter().map(|(_, e, j)| (e - j.dot(&motion)).abs()).collect();
        sizes.sort_by(f64::total_cmp);
        sigma = 1.4826 * sizes[sizes.len() / 2];
        for ((_, error, jacobian), weight) in pixels.iter().zip(&mut weights) {
            let size = (error - jacobian.dot(&motion)).abs();
            *weight = (2.0 * sigma / size.max(1e-9)).min(1.0);
        }
    }
    let mut field = vec![f64::NAN; points.data().len()];
    let mut z = 0.0;
    let mut offsets: Vec<f64> = Vec::new();
    for (at, error, jacobian) in pixels {
        z += points.data()[*at].map_or(0.0, |p| p.z) / pixels.len() as f64;
        offsets.push(*error);
        // Tails are other things than noise.
        field[*at] = (error - jacobian.dot(&motion)).clamp(-4.0 * sigma, 4.0 * sigma);
    }
    offsets.sort_by(f64::total_cmp);
    let products = LAGS.map(|lag| {
        let (mut sum, mut count) = (0.0, 0.0_f64);
        for (i, here) in field.iter().enumerate() {
            let same_row = i % points.width() + lag < points.width();
            let others =
                [same_row.then(|| field.get(i + lag)).flatten(), field.get(i + lag * points.width())];
            for other in others.into_iter().flatten().filter(|other| !(here * **other).is_nan()) {
                sum += here * other;
                count += 1.0;
            }
        }
        if count > 50.0 { sum / count / z.powi(4) } else { f64::NAN }
    });
    Some(Measured { z, offset: offsets[offsets.len() / 2], sigma: sigma / (z * z), products })
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.filter(|v| !v.is_nan()).collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

#[expect(clippy::print_stdout, reason = "what it measures is what one runs this for")]
fn print(
    measured: &mut [Measured],
    by_cosine: &[[u64; 2]],
    by_rim: &[[u64; 2]],
) -> Result<(), Box<dyn Error>> {
    if measured.is_empty() {
        return Err("no object is seen on enough pixels".into());
    }
    let count = measured.len() as f64;
    let offset = (measured.iter().map(|m| m.offset * m.offset).sum::<f64>() / count).sqrt();
    println!("{} objects, at {:.2} m (median)", measured.len(), median(measured.iter().map(|m| m.z)));
    println!("offset of an object: {:.1} mm (root mean square)", 1e3 * offset);
    println!(
        "noise after the best rigid motion, at 1 m: {:.2} mm (median)",
        1e3 * median(measured.iter().map(|m| m.sigma))
    );
    let first = median(measured.iter().map(|m| m.products[0]));
    println!("of it common to neighbours: {:.2} mm", 1e3 * first.max(0.0).sqrt());
    for (i, lag) in LAGS.iter().enumerate() {
        let share = median(measured.iter().map(|m| m.products[i])) / first;
        println!("  {lag:2} pixels apart: {share:5.2} of the product at one");
    }
    println!("readings lost, more than {RIM_PX} pixels from the rim:");
    for (bin, [all, lost]) in COSINES.windows(2).zip(by_cosine) {
        println!("  cos {:.1} to {:.1}: {:4.1} % of {all}", bin[0], bin[1].min(1.0), percent(*lost, *all));
    }
    println!("readings lost by distance from the rim:");
    for (distance, [all, lost]) in by_rim.iter().enumerate() {
        println!("  {distance:2} pixels: {:4.1} % of {all}", percent(*lost, *all));
    }
    Ok(())
}

fn percent(part: u64, all: u64) -> f64 {
    100.0 * part as f64 / all.max(1) as f64
}
