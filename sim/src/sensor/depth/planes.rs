//! Each preset on real tilted planes, against its closed form.
//!
//! A plane through (0, 0, z0), turned by t about the image's vertical, is z = z0 / (1 - x tan t) on the ray (x, y, 1): its
//! slope is dz/du = z^2 tan t / (f z0) metres a pixel, and the cosine of incidence (1 - x tan t) cos t / |(x, y, 1)|. A
//! sensor that reads one pixel o away with variance V in o adds slope^2 V to its axial variance and slope E[o] to its
//! bias. One that rounds to steps of s adds s^2 / 12 where depths are spread over many steps, as they are on a plane that
//! is tilted, and as they are made to be here on one that is not.

use nalgebra::Vector3;

use super::tests::CAMERA;
use super::*;
use crate::rng;

/// Depths and tilts (degrees) that all presets are tested at.
const DEPTHS: [f64; 3] = [0.6, 1.0, 1.5];
const TILTS: [f64; 3] = [0.0, 30.0, 60.0];

/// Variances of round(N(0, sigma)), pixels squared: the sum over k of (2 k - 1) P(|N| > (k - 1/2) / sigma). Sheppard's
/// sigma^2 + 1/12 holds from about sigma 0.6 on.
const ROUNDED_HALF_PIXEL: f64 = 0.3173 + 3.0 * 0.0027;
/// P(N > 2): how often a shift of N(0, 1/4) pixel rounds to one pixel to a given side.
const QUARTER_PIXEL_TAIL: f64 = 0.022_75;

/// A plane; `tilt` in radians turns it about the image's vertical, or about its horizontal where `down`.
#[derive(Clone, Copy)]
struct Plane {
    z: f64,
    tilt: f64,
    down: bool,
}

/// What a pixel should show.
#[derive(Clone, Copy)]
struct Truth {
    z: f64,
    /// Metres a pixel.
    slope: f64,
    cos: f64,
}

impl Plane {
    fn at(&self, u: usize, v: usize) -> Truth {
        let ray = CAMERA.back_project(u as f64, v as f64, 1.0).coords;
        let normal = if self.down {
            Vector3::new(0.0, -self.tilt.sin(), self.tilt.cos())
        } else {
            Vector3::new(-self.tilt.sin(), 0.0, self.tilt.cos())
        };
        let facing = normal.dot(&ray);
        // Beyond the plane's horizon there is nothing.
        let z = if facing > 1e-3 { self.z * self.tilt.cos() / facing } else { 0.0 };
        let slope = z * z * self.tilt.tan() / (CAMERA.fx * self.z);
        Truth { z, slope, cos: facing / ray.norm() }
    }

    fn rendering(&self) -> Rendering {
        let (w, h) = (CAMERA.width, CAMERA.height);
        let truth = |i: usize| self.at(i % w, i / w);
        let image = |f: &dyn Fn(Truth) -> f64| {
            Image::from_vec(w, h, (0..w * h).map(|i| f(truth(i)) as f32).collect()).unwrap()
        };
        Rendering {
            radiance: Image::filled(w, h, [0.0; 3]),
            labels: Image::filled(w, h, 0),
            depth: image(&|t| t.z),
            cos_incidence: image(&|t| t.cos.max(0.0)),
        }
    }

    /// Whether a pixel is used: not so near the border that shifts end there, and where the plane is within 30 % of the
    /// nominal depth.
    fn uses(&self, u: usize, v: usize) -> bool {
        let inside = |at: usize, size: usize| at >= 8 && at + 8 < size;
        inside(u, CAMERA.width) && inside(v, CAMERA.height) && (self.at(u, v).z / self.z - 1.0).abs() < 0.3
    }
}

/// Planes about a nominal one whose depths differ by `spread` metres in all.
fn planes(z: f64, degrees: f64, spread: f64) -> impl Iterator<Item = Plane> {
    const COUNT: u32 = 12;
    let tilt = degrees.to_radians();
    (0..COUNT).map(move |i| Plane {
        z: z + spread * ((f64::from(i) + 0.5) / f64::from(COUNT) - 0.5),
        // Both ways, and both signs: the projector stands on one side.
        tilt: if i % 2 == 0 { tilt } else { -tilt },
        down: i % 4 >= 2,
    })
}

/// Errors of the readings on `planes` less their expected bias, in expected standard deviations: mean, standard deviation,
/// and the share of pixels with a reading. `expected` tells bias and standard deviation, metres.
fn normalised(
    noise: &DepthNoise,
    planes: impl Iterator<Item = Plane>,
    expected: impl Fn(&Truth) -> (f64, f64),
) -> (f64, f64, f64) {
    let (mut sum, mut squares, mut read, mut used) = (0.0, 0.0, 0.0, 0.0_f64);
    for (seed, plane) in planes.enumerate() {
        let image = noise.apply(&plane.rendering(), &CAMERA, &mut rng::stream(seed as u64, "planes"));
        for v in 0..CAMERA.height {
            for u in (0..CAMERA.width).filter(|&u| plane.uses(u, v)) {
                used += 1.0;
                let z = f64::from(*image.at(u, v));
                if z > 0.0 {
                    let truth = plane.at(u, v);
                    let (bias, sigma) = expected(&truth);
                    let error = (z - truth.z - bias) / sigma;
                    sum += error;
                    squares += error * error;
                    read += 1.0;
                }
            }
        }
    }
    let mean = sum / read;
    (mean, (squares / read - mean * mean).sqrt(), read / used)
}

/// Asserts that readings have the expected bias and standard deviation at all depths and `tilts`. `spread` tells over which
/// range of depths, metres, rounding is even; tolerances are in standard deviations.
fn assert_closed_form(
    noise: &DepthNoise,
    tilts: &[f64],
    spread: impl Fn(f64) -> f64,
    tolerance: f64,
    expected: impl Fn(&Truth) -> (f64, f64),
) {
    for z in DEPTHS {
        for &degrees in tilts {
            let (bias, sigma, valid) = normalised(noise, planes(z, degrees, spread(z)), &expected);
            let case = format!("{noise:?} at {z} m, {degrees} degrees: {bias} {sigma} {valid}");
            assert!(bias.abs() < tolerance, "{case}");
            assert!((sigma - 1.0).abs() < tolerance, "{case}");
            assert!(valid > 0.9, "{case}");
        }
    }
}

#[test]
fn none_reads_the_plane() {
    for plane in planes(1.0, 60.0, 0.0) {
        let rendering = plane.rendering();
        assert_eq!(DepthNoise::None.apply(&rendering, &CAMERA, &mut rng::stream(1, "t")), rendering.depth);
    }
}

#[test]
fn nguyen_is_axial_noise_and_lateral_noise_times_slope() {
    assert_closed_form(
        &DepthNoise::Nguyen,
        &[0.0, 30.0, 60.0, 75.0],
        |_| 0.0,
        0.03,
        |truth| {
            let theta = truth.cos.acos();
            let steep = theta / (std::f64::consts::FRAC_PI_2 - theta);
            let axial = 0.0012 + 0.0019 * (truth.z - 0.4).powi(2) + 0.0001 / truth.z.sqrt() * steep * steep;
            let lateral = 0.8 + 0.035 * steep;
            // The nearest pixel is read: a twelfth (Sheppard; the shift is wide enough).
            let variance = axial * axial + truth.slope * truth.slope * (lateral * lateral + 1.0 / 12.0);
            (0.0, variance.sqrt())
        },
    );
}

#[test]
fn redwood_is_disparity_noise_its_step_and_the_coarse_pixel_times_slope() {
    // The pixel that is read has even column and row: from an even one the offset is 0, or -2 with probability p; from an
    // odd one -1, or +1 with probability p. So E[o] = -1/2 and E[o^2] = (4 p + 1) / 2.
    let offset_variance = (4.0 * QUARTER_PIXEL_TAIL + 1.0) / 2.0 - 0.25;
    let disparity = (0.027_778_f64.powi(2) + (1.0 / 8.0_f64).powi(2) / 12.0).sqrt();
    assert_closed_form(
        &DepthNoise::Redwood,
        &TILTS,
        |z| z * z / (35.130 * 8.0),
        0.03,
        |truth| {
            let axial = truth.z * truth.z / 35.130 * disparity;
            let variance = axial * axial + truth.slope * truth.slope * offset_variance;
            (-0.5 * truth.slope, variance.sqrt())
        },
    );
}

#[test]
fn handa_is_four_roundings_and_a_shift_times_slope() {
    // In turn: a shift of N(0, 1/2) pixel, read between pixels; disparity 36 / z in eighths; whole centimetres; and a step of
    // z^2 / 351.3 with noise of a sixth of it, whose 0.5 before rounding brings depth down by half a step. Twelve planes over
    // 13 cm lie at twelve even places between whole centimetres.
    let expected = |truth: &Truth| {
        let squared = truth.z * truth.z;
        let matcher = squared / (36.0 * 8.0);
        let step = squared / 351.3;
        let variance = truth.slope * truth.slope * 0.25
            + (matcher * matcher + 0.01 * 0.01 + step * step) / 12.0
            + (step / 6.0).powi(2);
        (-0.5 * step, variance.sqrt())
    };
    assert_closed_form(&DepthNoise::Handa, &[5.0, 30.0, 60.0], |_| 0.13, 0.1, expected);
    // Facing the camera, a plane has one depth: it takes many of them, in small pictures, until the nested roundings are even.
    for z in DEPTHS {
        let (mut sum, mut squares, mut count) = (0.0, 0.0, 0.0_f64);
        for i in 0..1000 {
            let z = z + 0.2 * (f64::from(i) / 1000.0 - 0.5);
            let (bias, sigma) = expected(&Truth { z, slope: 0.0, cos: 1.0 });
            let flat = Image::filled(16, 16, z as f32);
            for read in handa::handa(&flat, &mut rng::stream(i as u64, "t")).data() {
                let error = (f64::from(*read) - z - bias) / sigma;
                sum += error;
                squares += error * error;
                count += 1.0;
            }
        }
        let mean = sum / count;
        let sigma = (squares / count - mean * mean).sqrt();
        // Twenty whole centimetres are few to even out the rounding that follows: 0.1 is what that leaves in the mean.
        assert!(mean.abs() < 0.1 && (sigma - 1.0).abs() < 0.06, "{z}: {mean} {sigma}");
    }
}

#[test]
fn carmine_is_the_data_sheets_noise_and_a_shift_times_slope() {
    let noise = DepthNoise::Carmine109(Carmine109 { bias_px: 0.0, ..Carmine109::default() });
    assert_closed_form(
        &noise,
        &TILTS,
        |z| z * z / (575.8 * 0.075 * 8.0),
        0.03,
        |truth| {
            let axial = 0.000_181 + 0.001_66 * (truth.z - 0.1).powi(2);
            (0.0, (axial * axial + truth.slope * truth.slope * ROUNDED_HALF_PIXEL).sqrt())
        },
    );
}

#[test]
fn published_anchors_at_one_metre() {
    // Nguyen 1.88 mm; Carmine's data sheet 1.53 mm; Handa's noise 0.47 mm in steps of 2.85 mm; Redwood's 0.79 mm in 3.56 mm.
    let at = |noise: &DepthNoise, sigma: f64| {
        let upright = planes(1.0, 0.0, 0.05);
        let about_one_metre = move |truth: &Truth| (0.0, sigma * truth.z * truth.z);
        normalised(noise, upright, about_one_metre).1
    };
    let with_step = |sigma: f64, step: f64| (sigma * sigma + step * step / 12.0).sqrt();
    let carmine = DepthNoise::Carmine109(Carmine109 { bias_px: 0.0, ..Carmine109::default() });
    for (noise, sigma) in [
        (DepthNoise::Nguyen, 0.001_88),
        (carmine, 0.001_53),
        (DepthNoise::Redwood, with_step(0.000_79, 0.003_56)),
    ] {
        let ratio = at(&noise, sigma);
        assert!((ratio - 1.0).abs() < 0.02, "{noise:?}: {ratio}");
    }
    let grid = |noise: &DepthNoise, step_mm: f64| {
        let plane = Plane { z: 1.0, tilt: 0.5, down: false };
        let image = noise.apply(&plane.rendering(), &CAMERA, &mut rng::stream(1, "t"));
        let mut read: Vec<f32> = image.data().iter().copied().filter(|z| (0.98..1.02).contains(z)).collect();
        read.sort_by(f32::total_cmp);
        read.dedup();
        // Handa's whole centimetres leave some steps out: the smallest distance is one.
        let gap =
            read.windows(2).map(|w| f64::from(w[1] - w[0]) / f64::from(w[0] * w[1])).fold(1.0, f64::min);
        assert!((1000.0 * gap / step_mm - 1.0).abs() < 0.005, "{noise:?}: {gap}");
    };
    grid(&DepthNoise::Handa, 2.85);
    grid(&DepthNoise::Redwood, 3.56);
    grid(&carmine, 2.89);
    let any_value = Plane { z: 1.0, tilt: 0.0, down: false }.rendering();
    let mut read = DepthNoise::Nguyen.apply(&any_value, &CAMERA, &mut rng::stream(1, "t")).data().to_vec();
    read.sort_by(f32::total_cmp);
    read.dedup();
    assert!(read.len() > 10_000, "nguyen has no steps: {}", read.len());
}

#[test]
fn carmines_slow_bias_adds_its_disparity() {
    // The field is constant over few pixels, so that frames count and pixels do not.
    let plane = Plane { z: 1.0, tilt: 0.0, down: false };
    let rendering = plane.rendering();
    let (mut squares, frames) = (0.0, 300);
    for seed in 0..frames {
        let image = DepthNoise::default().apply(&rendering, &CAMERA, &mut rng::stream(seed, "t"));
        let about = |u: usize| (u..u + 16).flat_map(move |u| (100..116).map(move |v| (u, v)));
        let mean = |u| about(u).map(|(u, v)| f64::from(*image.at(u, v)) - 1.0).sum::<f64>() / 256.0;
        squares += [20, 150, 280].map(|u| mean(u).powi(2)).iter().sum::<f64>() / 3.0;
    }
    let size = (squares / frames as f64).sqrt();
    let expected = 0.06 / (575.8 * 0.075);
    assert!((size / expected - 1.0).abs() < 0.1, "{size} {expected}");
}

/// A wall at `far` with a box before it at `near` over columns 120 to 199.
fn step_edges(near: f32, far: f32) -> Rendering {
    let mut rendering = Plane { z: far.into(), tilt: 0.0, down: false }.rendering();
    for v in 0..CAMERA.height {
        for u in 120..200 {
            *rendering.depth.at_mut(u, v) = near;
        }
    }
    rendering
}

#[test]
fn projector_shadows_are_as_wide_as_the_disparities_differ() {
    for (near, far) in [(0.5_f32, 0.7_f32), (0.6, 1.0), (0.8, 1.2), (1.0, 1.5), (0.9, 3.0)] {
        let rendering = step_edges(near, far);
        for side in [1.0_f32, -1.0] {
            let settings = Carmine109 {
                lateral_px: 0.0,
                bias_px: 0.0,
                projector_x: 0.075 * side,
                ..Carmine109::default()
            };
            let read = DepthNoise::Carmine109(settings).apply(&rendering, &CAMERA, &mut rng::stream(3, "t"));
            let dark: Vec<usize> = (0..320).filter(|&u| *read.at(u, 100) == 0.0).collect();
            let width = CAMERA.fx as f32 * 0.075 * (1.0 / near - 1.0 / far);
            assert!((dark.len() as f32 - width).abs() <= 1.0, "{near} {far} {side}: {dark:?} {width}");
            // Beside the box, on the side away from the projector, and without gaps.
            let edge = if side > 0.0 { dark[dark.len() - 1] == 119 } else { dark[0] == 200 };
            assert!(
                edge && dark[dark.len() - 1] - dark[0] + 1 == dark.len(),
                "{near} {far} {side}: {dark:?}"
            );
        }
        for noise in [DepthNoise::None, DepthNoise::Nguyen, DepthNoise::Redwood] {
            let read = noise.apply(&rendering, &CAMERA, &mut rng::stream(3, "t"));
            assert!(read.data().iter().all(|&z| z > 0.0), "{noise:?}");
        }
    }
}

#[test]
fn grazing_planes_lose_the_share_of_readings_that_the_formula_says() {
    let noise = DepthNoise::default();
    for degrees in [0.0, 45.0, 60.0, 70.0, 75.0, 80.0] {
        let (mut used, mut lost, mut expected) = (0.0_f64, 0.0, 0.0);
        for (seed, plane) in planes(1.0, degrees, 0.05).enumerate() {
            let read = noise.apply(&plane.rendering(), &CAMERA, &mut rng::stream(seed as u64, "t"));
            for v in 0..CAMERA.height {
                for u in (0..CAMERA.width).filter(|&u| plane.uses(u, v)) {
                    used += 1.0;
                    expected += (1.0 - plane.at(u, v).cos).powi(8);
                    lost += f64::from(u8::from(*read.at(u, v) == 0.0));
                }
            }
        }
        let (lost, expected) = (lost / used, expected / used);
        assert!((lost - expected).abs() < 0.02 * expected + 0.001, "{degrees}: {lost} {expected}");
    }
}
