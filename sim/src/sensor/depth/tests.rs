//! The presets on pictures of constant depth and angle, which tell axial noise from lateral.

use super::*;
use crate::rng;

/// A picture of constant depth and angle (not of a plane: that isolates axial noise from lateral).
pub(super) fn flat(z: f32, theta: f32) -> Rendering {
    let (w, h) = (320, 240);
    Rendering {
        radiance: Image::filled(w, h, [0.0; 3]),
        depth: Image::filled(w, h, z),
        labels: Image::filled(w, h, 0),
        cos_incidence: Image::filled(w, h, theta.cos()),
    }
}

pub(super) const CAMERA: Intrinsics =
    Intrinsics { width: 320, height: 240, fx: 554.26, fy: 554.26, cx: 159.5, cy: 119.5 };

/// Mean, standard deviation and share of valid readings, relative to `z`.
pub(super) fn statistics(image: &DepthImage, z: f32) -> (f64, f64, f64) {
    let valid: Vec<f64> =
        image.data().iter().filter(|&&d| d > 0.0).map(|&d| f64::from(d) - f64::from(z)).collect();
    let count = valid.len().max(1) as f64;
    let mean = valid.iter().sum::<f64>() / count;
    let variance = valid.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / count;
    (mean, variance.sqrt(), count / image.data().len() as f64)
}

#[test]
fn names_lead_to_presets_and_an_unknown_one_lists_them() {
    for name in DepthNoise::NAMES {
        assert!(DepthNoise::from_name(name, &Carmine109::default()).is_ok());
    }
    assert_eq!(DepthNoise::from_name("carmine-109", &Carmine109::default()).unwrap(), DepthNoise::default());
    let error = DepthNoise::from_name("kinect", &Carmine109::default()).unwrap_err().to_string();
    assert!(error.contains("kinect") && error.contains("redwood"), "{error}");
}

#[test]
fn none_changes_nothing() {
    let rendering = flat(1.0, 0.3);
    let read = DepthNoise::None.apply(&rendering, &CAMERA, &mut rng::stream(1, "t"));
    assert_eq!(read, rendering.depth);
}

#[test]
fn nguyen_has_its_published_sigma() {
    // The figure that is quoted for one metre, straight on.
    assert!((nguyen_axial(1.0, 0.0) - 0.00188).abs() < 1e-5);
    for (z, theta) in [(0.6, 0.0), (1.0, 0.0), (1.5, 0.0), (1.0, 1.1)] {
        let read = DepthNoise::Nguyen.apply(&flat(z, theta), &CAMERA, &mut rng::stream(1, "t"));
        let (bias, sigma, valid) = statistics(&read, z);
        let t = f64::from(theta);
        let steep = (t / (std::f64::consts::FRAC_PI_2 - t)).powi(2);
        let depth = f64::from(z);
        let expected = 0.0012 + 0.0019 * (depth - 0.4).powi(2) + 0.0001 / depth.sqrt() * steep;
        assert_eq!(valid, 1.0);
        assert!(bias.abs() < 0.03 * expected, "{z} {theta}: bias {bias}");
        assert!((sigma / expected - 1.0).abs() < 0.02, "{z} {theta}: {sigma} {expected}");
    }
}

#[test]
fn nguyen_moves_edges_sideways_by_its_lateral_sigma() {
    // Depth that grows along u turns a shift of pixels into a change of depth (rounding to pixels adds 1/12); axial noise
    // comes on top.
    let mut rendering = flat(1.0, 0.0);
    let slope = 0.05;
    for v in 0..240 {
        for u in 0..320 {
            *rendering.depth.at_mut(u, v) = 1.0 + slope * u as f32;
        }
    }
    let read = DepthNoise::Nguyen.apply(&rendering, &CAMERA, &mut rng::stream(2, "t"));
    let (mut sum, mut expected) = (0.0, 0.0);
    for v in 0..240 {
        for u in 8..60 {
            let z = *rendering.depth.at(u, v);
            sum += f64::from((read.at(u, v) - z) / slope).powi(2);
            expected += 0.64_f64 + 1.0 / 12.0 + f64::from(nguyen_axial(z, 0.0) / slope).powi(2);
        }
    }
    let ratio = (sum / expected).sqrt();
    assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
}

#[test]
fn redwood_has_its_published_step_and_sigma() {
    for (z, step, sigma) in [(0.6, 0.001_28, 0.000_285), (1.0, 0.003_56, 0.000_79), (1.5, 0.008_0, 0.001_78)]
    {
        let read = DepthNoise::Redwood.apply(&flat(z, 0.0), &CAMERA, &mut rng::stream(3, "t"));
        let mut levels: Vec<f32> = read.data().to_vec();
        levels.sort_by(f32::total_cmp);
        levels.dedup();
        let steps: Vec<f32> = levels.windows(2).map(|w| w[1] - w[0]).collect();
        for s in &steps {
            assert!((s / step - 1.0).abs() < 0.03, "{z}: {s}");
        }
        // Rounding adds a twelfth of the squared step to the noise on average over depths: average over a step.
        let mut squares = 0.0;
        for i in 0..16 {
            let z = z + step * (i as f32 + 0.5) / 16.0;
            let read = DepthNoise::Redwood.apply(&flat(z, 0.0), &CAMERA, &mut rng::stream(i, "t"));
            let (bias, sigma, _) = statistics(&read, z);
            squares += bias * bias + sigma * sigma;
        }
        let total = (squares / 16.0).sqrt();
        let expected = (f64::from(step * step) / 12.0 + sigma * sigma).sqrt();
        assert!((total / expected - 1.0).abs() < 0.03, "{z}: {total} {expected}");
    }
    let far = DepthNoise::Redwood.apply(&flat(10.5, 0.0), &CAMERA, &mut rng::stream(3, "t"));
    assert!(far.data().iter().all(|&z| z == 0.0));
}

#[test]
fn readings_do_not_depend_on_the_number_of_threads() {
    let rendering = flat(0.9, 0.7);
    for name in DepthNoise::NAMES {
        let noise = DepthNoise::from_name(name, &Carmine109::default()).unwrap();
        let take = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| noise.apply(&rendering, &CAMERA, &mut rng::stream(5, "t")))
        };
        assert_eq!(take(1), take(3), "{name}");
    }
}
