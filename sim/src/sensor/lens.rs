//! The lens: a picture with distortion, made from a pinhole picture that is somewhat larger.
//!
//! Renderers draw pinhole pictures. A pixel of the distorted picture shows what lies on one ray; that ray also hits a
//! pinhole picture drawn from the same place, at a place between pixels that [`Lens`] knows for each pixel. Colour is
//! taken bilinearly. Depth along the axis does not depend on the lens, as the ray is the same; depth, labels and angles are
//! the nearest pixel's, since a value between a can's depth and the wall's would be neither.

use nalgebra::Point2;
use rayon::prelude::*;

use crate::camera::{Distortion, Intrinsics};
use crate::error::{Error, Result};
use crate::images::{Image, RadianceImage};
use crate::render::Rendering;

/// Turns pinhole pictures into pictures of one camera with one lens. Build it once, use it for every frame.
#[derive(Debug, Clone)]
pub struct Lens {
    padded: Intrinsics,
    /// For each pixel of the distorted picture, the place in the pinhole picture.
    places: Image<Point2<f64>>,
}

/// The pinhole camera to render with: the same focal lengths, a shifted principal point, and so many pixels that it sees
/// every ray of the distorted picture, with a pixel to spare on each side.
///
/// # Errors
/// When camera or distortion has a [problem](Distortion::problem), or the picture would be too large to draw.
pub fn padded(intrinsics: &Intrinsics, distortion: &Distortion) -> Result<Intrinsics> {
    let invalid = |message: String| Error::invalid("camera lens", message);
    if let Some(message) = intrinsics.problem().or_else(|| distortion.problem(intrinsics)) {
        return Err(invalid(message));
    }
    let (width, height) = (intrinsics.width, intrinsics.height);
    // The map is one to one, so that the border of one picture is the border of the other.
    let border = (0..width)
        .flat_map(|u| [(u, 0), (u, height - 1)])
        .chain((0..height).flat_map(|v| [(0, v), (width - 1, v)]));
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for (u, v) in border {
        let place = undistorted(intrinsics, distortion, u, v)
            .ok_or_else(|| invalid(format!("no ray for pixel ({u}, {v}); use smaller coefficients")))?;
        for axis in 0..2 {
            low[axis] = low[axis].min(place[axis]);
            high[axis] = high[axis].max(place[axis]);
        }
    }
    let first = low.map(|v| v.floor() - 1.0);
    let size = [0, 1].map(|axis| (high[axis].ceil() + 1.0 - first[axis]) as usize + 1);
    let padded = Intrinsics {
        width: size[0],
        height: size[1],
        cx: intrinsics.cx - first[0],
        cy: intrinsics.cy - first[1],
        ..*intrinsics
    };
    match padded.problem() {
        Some(message) => Err(invalid(format!("the pinhole picture under the lens: {message}"))),
        None => Ok(padded),
    }
}

/// Where a pinhole camera with the same numbers sees what the lens puts on pixel (u, v).
fn undistorted(k: &Intrinsics, distortion: &Distortion, u: usize, v: usize) -> Option<Point2<f64>> {
    let (x, y) = distortion.undistort((u as f64 - k.cx) / k.fx, (v as f64 - k.cy) / k.fy)?;
    Some(Point2::new(snap(k.fx * x + k.cx), snap(k.fy * y + k.cy)))
}

/// The nearest whole number where that is within rounding: else a lens without distortion would blend each pixel with a
/// billionth of its neighbour.
fn snap(t: f64) -> f64 {
    if (t - t.round()).abs() < 1e-9 { t.round() } else { t }
}

impl Lens {
    /// For pictures of `intrinsics` (which project the distorted rays).
    ///
    /// # Errors
    /// As [`padded`].
    pub fn new(intrinsics: &Intrinsics, distortion: &Distortion) -> Result<Self> {
        let padded = padded(intrinsics, distortion)?;
        let shift = [padded.cx - intrinsics.cx, padded.cy - intrinsics.cy];
        let width = intrinsics.width;
        let mut places = Image::filled(width, intrinsics.height, Point2::origin());
        places.data_mut().par_chunks_mut(width).enumerate().try_for_each(|(v, row)| {
            for (u, place) in row.iter_mut().enumerate() {
                let at = undistorted(intrinsics, distortion, u, v).ok_or_else(|| {
                    Error::invalid(
                        "camera lens",
                        format!("no ray for pixel ({u}, {v}); use smaller coefficients"),
                    )
                })?;
                *place = Point2::new(snap(at.x + shift[0]), snap(at.y + shift[1]));
            }
            Ok(())
        })?;
        Ok(Self { padded, places })
    }

    /// The pinhole camera to render with, see [`padded`].
    pub fn padded(&self) -> &Intrinsics {
        &self.padded
    }

    /// What the camera sees through the lens, given what the [padded](Self::padded) pinhole camera sees.
    ///
    /// # Errors
    /// When `pinhole` has another size.
    pub fn rendering(&self, pinhole: &Rendering) -> Result<Rendering> {
        Ok(Rendering {
            radiance: self.bilinear(&pinhole.radiance)?,
            depth: self.nearest(&pinhole.depth)?,
            labels: self.nearest(&pinhole.labels)?,
            cos_incidence: self.nearest(&pinhole.cos_incidence)?,
        })
    }

    /// An image whose values must not be blended: masks, labels, depth.
    ///
    /// # Errors
    /// When `pinhole` has another size than the padded camera's.
    pub fn nearest<T: Copy + Send + Sync>(&self, pinhole: &Image<T>) -> Result<Image<T>> {
        self.map(pinhole, |place| *pinhole.at(place.x.round() as usize, place.y.round() as usize))
    }

    /// A picture of light.
    ///
    /// # Errors
    /// When `pinhole` has another size than the padded camera's.
    pub fn bilinear(&self, pinhole: &RadianceImage) -> Result<RadianceImage> {
        self.map(pinhole, |place| {
            let (u, v) = (place.x as usize, place.y as usize);
            let (fu, fv) = (place.x.fract() as f32, place.y.fract() as f32);
            let [a, b] = [0, 1].map(|du| pinhole.at(u + du, v));
            let [c, d] = [0, 1].map(|du| pinhole.at(u + du, v + 1));
            std::array::from_fn(|i| {
                (a[i] * (1.0 - fu) + b[i] * fu) * (1.0 - fv) + (c[i] * (1.0 - fu) + d[i] * fu) * fv
            })
        })
    }

    /// One value for each pixel, from its place in `pinhole`; a pixel is to spare on each side of all places.
    fn map<T: Copy + Send + Sync>(
        &self,
        pinhole: &Image<T>,
        value: impl Fn(&Point2<f64>) -> T + Sync + Send,
    ) -> Result<Image<T>> {
        let Intrinsics { width, height, .. } = self.padded;
        let wrong_size = || {
            let size = format!("{}x{}", pinhole.width(), pinhole.height());
            Error::invalid("camera lens", format!("the pinhole picture is {size}; draw it {width}x{height}"))
        };
        if (pinhole.width(), pinhole.height()) != (width, height) {
            return Err(wrong_size());
        }
        let data = self.places.data().par_iter().map(value).collect();
        Image::from_vec(self.places.width(), self.places.height(), data).ok_or_else(wrong_size)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BARREL: Distortion = Distortion { k1: -0.28, k2: 0.07, p1: 0.001, p2: -0.002, k3: 0.0 };
    const CAMERA: Intrinsics = Intrinsics::FETCH;

    /// A pinhole rendering from functions of the ray (x, y, 1).
    fn drawn(k: &Intrinsics, light: impl Fn(f64, f64) -> f32, depth: impl Fn(f64, f64) -> f32) -> Rendering {
        let ray = |i: usize| {
            let p = k.back_project((i % k.width) as f64, (i / k.width) as f64, 1.0);
            (p.x, p.y)
        };
        let count = k.width * k.height;
        let rays: Vec<_> = (0..count).map(ray).collect();
        let depths: Vec<f32> = rays.iter().map(|&(x, y)| depth(x, y)).collect();
        let image = |f: &dyn Fn(f64, f64) -> f32| rays.iter().map(|&(x, y)| f(x, y)).collect::<Vec<_>>();
        Rendering {
            radiance: Image::from_vec(k.width, k.height, image(&light).iter().map(|&l| [l; 3]).collect())
                .unwrap(),
            labels: Image::from_vec(k.width, k.height, depths.iter().map(|d| (d * 100.0) as u16).collect())
                .unwrap(),
            depth: Image::from_vec(k.width, k.height, depths).unwrap(),
            cos_incidence: Image::filled(k.width, k.height, 1.0),
        }
    }

    #[test]
    fn a_lens_without_distortion_changes_nothing() {
        let lens = Lens::new(&CAMERA, &Distortion::default()).unwrap();
        assert_eq!((lens.padded().width, lens.padded().height), (642, 482));
        let light = |x: f64, y: f64| (10.0 + 3.0 * (40.0 * x).sin() + y) as f32;
        let depth = |x: f64, y: f64| (1.0 + x * y) as f32;
        let seen = lens.rendering(&drawn(lens.padded(), light, depth)).unwrap();
        let direct = drawn(&CAMERA, light, depth);
        // The same rays; only their numbers are rounded differently.
        let close = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5);
        assert!(close(seen.depth.data(), direct.depth.data()));
        assert!(close(seen.radiance.data().as_flattened(), direct.radiance.data().as_flattened()));
    }

    #[test]
    fn every_pixel_shows_its_ray() {
        let lens = Lens::new(&CAMERA, &BARREL).unwrap();
        assert!(lens.padded().width > 700 && lens.padded().height > 500, "{:?}", lens.padded());
        assert_eq!((lens.padded().fx, lens.padded().fy), (CAMERA.fx, CAMERA.fy));
        // Light and depth that grow evenly with the ray's slope tell which ray a pixel shows.
        let pinhole = drawn(lens.padded(), |x, _| (2.0 + x) as f32, |_, y| (2.0 + y) as f32);
        let seen = lens.rendering(&pinhole).unwrap();
        assert_eq!((seen.depth.width(), seen.depth.height()), (640, 480));
        for v in (0..480).step_by(7) {
            for u in (0..640).step_by(7) {
                let at = ((u as f64 - CAMERA.cx) / CAMERA.fx, (v as f64 - CAMERA.cy) / CAMERA.fy);
                let (x, y) = BARREL.undistort(at.0, at.1).unwrap();
                assert!((f64::from(seen.radiance.at(u, v)[1]) - 2.0 - x).abs() < 1e-5);
                // Nearest: within half a pixel.
                assert!((f64::from(*seen.depth.at(u, v)) - 2.0 - y).abs() < 0.5 / CAMERA.fy + 1e-6);
                assert!((i32::from(*seen.labels.at(u, v)) - ((2.0 + y) * 100.0) as i32).abs() <= 1);
            }
        }
    }

    #[test]
    fn a_straight_line_bends_by_its_sagitta() {
        // Radial only: a point (x, y) of the line x = 0.4 is drawn at x (1 + k1 (x^2 + y^2)), so between y = 0 and y the
        // line bends by k1 x y^2, towards the middle for a barrel.
        let lens_of = |k1| Distortion { k1, ..Distortion::default() };
        for k1 in [-0.2, 0.1] {
            let lens = Lens::new(&CAMERA, &lens_of(k1)).unwrap();
            let (x, y) = (0.4, 0.35);
            let width = 2.0 / CAMERA.fx;
            let line = |at: f64, _| (1.0 - ((at - x) / width).abs()).max(0.0) as f32;
            let seen = lens.rendering(&drawn(lens.padded(), line, |_, _| 1.0)).unwrap();
            let column = |slope: f64| {
                let row = (lens_of(k1).distort(x, slope).1 * CAMERA.fy + CAMERA.cy).round() as usize;
                let light = |u: usize| f64::from(seen.radiance.at(u, row)[0]);
                let sum: f64 = (0..640).map(light).sum();
                (0..640).map(|u| u as f64 * light(u)).sum::<f64>() / sum
            };
            let sagitta = column(y) - column(0.0);
            let expected = k1 * x * y * y * CAMERA.fx;
            // The rows are whole pixels, which moves the points where it is read by up to half a row.
            assert!((sagitta - expected).abs() < 0.1, "{k1}: {sagitta} {expected}");
        }
    }

    #[test]
    fn masks_pass_and_wrong_sizes_and_folding_lenses_do_not() {
        let lens = Lens::new(&CAMERA, &BARREL).unwrap();
        let k = *lens.padded();
        let mut mask = Image::filled(k.width, k.height, false);
        *mask.at_mut(k.cx.round() as usize, k.cy.round() as usize) = true;
        let seen = lens.nearest(&mask).unwrap();
        let found: Vec<_> = (0..640 * 480).filter(|&i| seen.data()[i]).collect();
        assert!(
            !found.is_empty()
                && found.iter().all(|i| (i % 640).abs_diff(320) <= 1 && (i / 640).abs_diff(240) <= 1)
        );
        let error = lens.nearest(&Image::filled(640, 480, 1_u16)).unwrap_err().to_string();
        assert!(error.contains("640x480") && error.contains("draw it"), "{error}");
        let fold = Distortion { k1: -0.9, ..Distortion::default() };
        assert!(padded(&CAMERA, &fold).unwrap_err().to_string().contains("folds"));
    }
}
