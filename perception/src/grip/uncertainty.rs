//! How far off a pose may be: its covariance, from the depth image's own errors at that pose.
//!
//! At its best pose the object's pixels differ from the depth image by what the sensor gets wrong, and the model. Those errors are no
//! white noise: a depth camera matches windows, and has slow errors beside. So nothing is assumed of how they correlate: they
//! are summed by cells, whose sums are taken as they come (White 1980, Liang and Zeger 1986: with H the normal equations of
//! the pose and g the gradient of each cell, the covariance is H^-1 (sum of g g^T) H^-1). What slides along the surface
//! without a change of depth is held by the silhouette, where it is seen.

use nalgebra::{Isometry3, Matrix3, Matrix6, Vector3, Vector6};

use super::settings::UncertaintySettings;
use crate::hypotheses::{Raster, Tile, render};
use crate::model::Model;
use crate::observation::{Level, Observation, Stride};

/// Side of a cell, pixels of the picture: errors farther apart have little in common (on real frames a tenth at 16).
const CELL_PX: usize = 16;
/// Readings farther from the surface than this many epsilons are of something else.
const SAME: f32 = 2.0;
/// Surfaces more slanted than this (cosine) are not counted: their readings are wild.
const SLANTED: f32 = 0.25;
/// Evidence of a depth edge from which a silhouette counts as seen.
const EDGE_SEEN: f32 = 0.6;
/// An object has at most so many pixels across at the resolution at which it is looked at.
const MOST_ACROSS: f32 = 96.0;
/// Cells with readings that an estimate of noise takes at least.
const LEAST_CELLS: usize = 6;

/// How well the depth image fits an object's pose, and how far off that may be.
#[derive(Debug, Clone)]
pub(super) struct Fit {
    /// Root mean square of the cells' mean errors, metres along the surface's normal: what does not average out within a
    /// window.
    pub noise_m: f64,
    /// Of position (metres, optical axes) and of the rotation vector about the object's origin (radians, optical axes); of a t
    /// distribution.
    pub covariance: Matrix6<f64>,
}

/// Sums over the pixels of a cell.
#[derive(Debug, Clone, Copy)]
struct Cell {
    gradient: Vector6<f64>,
    error: f64,
    pixels: f64,
}

impl Fit {
    /// At a pose; `None` where too little of the object is seen.
    pub fn new(
        model: &Model,
        pose: &Isometry3<f32>,
        observation: &Observation,
        triangles: usize,
        settings: &UncertaintySettings,
    ) -> Option<Self> {
        let distance = pose.translation.vector.z;
        let across = 2.0 * model.radius * observation.intrinsics.fx as f32 / distance;
        let fits = |stride: &Stride| across / stride.pixels() as f32 <= MOST_ACROSS;
        let stride = Stride::ALL.into_iter().find(fits).unwrap_or(Stride::Eight);
        let level = observation.level(stride);
        let mut raster = Raster::default();
        render(&mut raster, model.lod(triangles), pose, level, None)?;
        let surface = Surface { tile: &raster.tile, level, centre: pose.translation.vector.cast() };
        let mut fit = surface.fit(stride, settings, model.radius.into())?;
        if let Some(axis) = &model.symmetry().revolution {
            // What the facets of its mesh say about turns about its axis is no measurement.
            let axis: Vector3<f64> = (pose.rotation * axis.into_inner()).cast();
            let free = axis * axis.transpose() * settings.prior_rad.powi(2);
            let turns = fit.covariance.fixed_view::<3, 3>(3, 3) + free;
            fit.covariance.fixed_view_mut::<3, 3>(3, 3).copy_from(&turns);
        }
        Some(fit)
    }
}

/// A rendered object before the depth image.
struct Surface<'a> {
    tile: &'a Tile,
    level: &'a Level,
    centre: Vector3<f64>,
}

impl Surface<'_> {
    fn fit(&self, stride: Stride, settings: &UncertaintySettings, radius: f64) -> Option<Fit> {
        let tile = self.tile;
        let side = (CELL_PX / stride.pixels()).max(1);
        let (columns, rows) = (tile.width.div_ceil(side), tile.height.div_ceil(side));
        let empty = Cell { gradient: Vector6::zeros(), error: 0.0, pixels: 0.0 };
        let mut cells = vec![empty; columns * rows];
        let mut normal_equations = Matrix6::zeros();
        let mut rim = Matrix6::zeros();
        let (mut squares, mut pixels) = (0.0, 0.0);
        for y in 0..tile.height {
            for x in 0..tile.width {
                let Some((error, jacobian)) = self.reading(x, y) else { continue };
                normal_equations += jacobian * jacobian.transpose();
                squares += error * error;
                pixels += 1.0;
                let cell = &mut cells[y / side * columns + x / side];
                cell.gradient += jacobian * error;
                cell.error += error;
                cell.pixels += 1.0;
            }
        }
        // A silhouette is known to `edge_px`, and its neighbouring pixels have that error in common.
        let edge_px = settings.edge_px / stride.pixels() as f64;
        let each = (1.0 / edge_px.max(1.0)) / (edge_px * edge_px);
        for y in 0..tile.height {
            for x in 0..tile.width {
                if let Some(jacobian) = self.outline(x, y) {
                    rim += jacobian * jacobian.transpose() * each;
                }
            }
        }
        let used = cells.iter().filter(|cell| cell.pixels > 0.0);
        if pixels == 0.0 || used.clone().count() < LEAST_CELLS {
            return None;
        }
        // Cells with few pixels have means of few: weighed by their pixels.
        let noise = used.clone().map(|c| c.error * c.error / c.pixels).sum::<f64>() / pixels;
        let variance = (squares / pixels).max(noise).max(settings.least_noise_m.powi(2));
        let mut spread = Matrix6::zeros();
        for cell in used {
            spread += cell.gradient * cell.gradient.transpose();
        }
        // However well the cells agree by chance, each has the least noise of its own.
        let own = settings.least_noise_m.powi(2) * (side * side) as f64 / 2.0;
        spread += normal_equations * own;
        let prior = settings.prior().try_inverse()?;
        let information = normal_equations / variance + rim + prior;
        let inverse = information.try_inverse()?;
        let within = inverse * (spread / (variance * variance) + rim + prior) * inverse;
        let mut covariance = within * settings.inflation.powi(2);
        // The camera's slow errors are in the pose already: nothing is left of them to be seen.
        let distance = self.centre.z;
        let [along, across, turn] = settings.slow_m;
        let along = (along * distance * distance).powi(2);
        let (across, turn) = ((across * distance).powi(2), (turn * distance).powi(2));
        let ray = self.centre.normalize();
        let outer = ray * ray.transpose();
        let position =
            covariance.fixed_view::<3, 3>(0, 0) + outer * along + (Matrix3::identity() - outer) * across;
        covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(&position);
        for i in 3..6 {
            covariance[(i, i)] += turn / (radius * radius);
        }
        covariance *= settings.degrees_of_freedom / (settings.degrees_of_freedom - 2.0);
        covariance.iter().all(|x| x.is_finite()).then_some(Fit { noise_m: noise.sqrt(), covariance })
    }

    /// Of a pixel that shows the object: distance of the observed point from its surface, metres, and how a motion of the object
    /// changes it, by position and rotation vector.
    fn reading(&self, x: usize, y: usize) -> Option<(f64, Vector6<f64>)> {
        let Self { tile, level, .. } = *self;
        let here = tile.index(x, y);
        let values = tile.values();
        let w: f64 = values[here].into();
        let [left, right, above, below] =
            [here - 1, here + 1, here - tile.pitch(), here + tile.pitch()].map(|i| f64::from(values[i]));
        if [w, left, right, above, below].iter().any(|w| *w <= 0.0) {
            return None;
        }
        let (u, v) = (tile.u0 + x as i32, tile.v0 + y as i32);
        let at = level.index(u, v);
        let seen = f64::from(level.w[at]);
        if seen <= 0.0 || (seen - w).abs() > f64::from(SAME * level.tol[at]) * w {
            return None;
        }
        let (wu, wv) = ((right - left) / 2.0, (below - above) / 2.0);
        let (fx, fy) = (f64::from(level.fx), f64::from(level.fy));
        let (du, dv) = (f64::from(u) - f64::from(level.cx), f64::from(v) - f64::from(level.cy));
        // The plane n . p = 1 through the rendered surface.
        let n = Vector3::new(fx * wu, fy * wv, w - wu * du - wv * dv);
        let length = n.norm();
        let ray = Vector3::new(du / fx, dv / fy, 1.0);
        // n . ray is w: the cosine of incidence follows.
        if w / (length * ray.norm()) < f64::from(SLANTED) {
            return None;
        }
        let normal = n / length;
        let point = ray / w;
        let error = (w / seen - 1.0) / length;
        let turn = (point - self.centre).cross(&normal);
        Some((error, Vector6::new(normal.x, normal.y, normal.z, turn.x, turn.y, turn.z)))
    }

    /// Of a pixel of the silhouette that is seen in the depth image: how a motion of the object moves it outwards, pixels of the
    /// level.
    fn outline(&self, x: usize, y: usize) -> Option<Vector6<f64>> {
        let Self { tile, level, .. } = *self;
        let here = tile.index(x, y);
        let values = tile.values();
        let w = f64::from(values[here]);
        if w <= 0.0 {
            return None;
        }
        let free = |i: usize| f64::from(u8::from(values[i] <= 0.0));
        let outwards = nalgebra::Vector2::new(
            free(here + 1) - free(here - 1),
            free(here + tile.pitch()) - free(here - tile.pitch()),
        );
        let outwards = outwards.try_normalize(0.5)?;
        let (u, v) = (tile.u0 + x as i32, tile.v0 + y as i32);
        let inside = |at: i32, end: usize| at >= 0 && at < end as i32;
        if !inside(u, level.width) || !inside(v, level.height) {
            return None;
        }
        let at = level.index(u, v);
        let seen = f64::from(level.w[at]);
        let hidden = seen > 0.0 && seen - w > f64::from(SAME * level.tol[at]) * w;
        if hidden || level.edge[at] < EDGE_SEEN {
            return None;
        }
        let (fx, fy) = (f64::from(level.fx), f64::from(level.fy));
        let ray = Vector3::new(
            (f64::from(u) - f64::from(level.cx)) / fx,
            (f64::from(v) - f64::from(level.cy)) / fy,
            1.0,
        );
        // A point of the surface that moves by d moves by f (d - ray d_z) w on the screen.
        let across = Vector3::new(outwards.x * fx, outwards.y * fy, 0.0);
        let moved = (across - Vector3::z() * across.dot(&ray)) * w;
        let turn = (ray / w - self.centre).cross(&moved);
        Some(Vector6::new(moved.x, moved.y, moved.z, turn.x, turn.y, turn.z))
    }
}

#[cfg(test)]
mod tests {
    use grip_sim::frame::CameraFrame;
    use grip_sim::rng;
    use nalgebra::UnitQuaternion;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::hypotheses::tests::{placed, settings as observation_settings, shown};
    use crate::model::fixtures::{can, skew_box};

    /// Nothing but what the depth image says.
    fn plain() -> UncertaintySettings {
        UncertaintySettings { inflation: 1.0, slow_m: [0.0; 3], least_noise_m: 1e-6, ..Default::default() }
    }

    /// The same error of depth in each square of `side` pixels, normal with this standard deviation.
    fn noisy(mut frame: CameraFrame, sigma_m: f32, side: usize, seed: u64) -> CameraFrame {
        let mut rng = rng::stream(seed, "noise");
        let columns = frame.depth.width() / side + 1;
        let errors: Vec<f32> = (0..columns * (frame.depth.height() / side + 1))
            .map(|_| {
                sigma_m * {
                    let x: f32 = StandardNormal.sample(&mut rng);
                    x
                }
            })
            .collect();
        let width = frame.depth.width();
        for (i, z) in frame.depth.data_mut().iter_mut().enumerate() {
            *z += errors[i / width / side * columns + i % width / side];
        }
        frame
    }

    fn fit(model: &Model, pose: &Isometry3<f32>, frame: &CameraFrame, settings: &UncertaintySettings) -> Fit {
        let observation = Observation::new(frame, &observation_settings(), None);
        Fit::new(model, pose, &observation, 1000, settings).unwrap()
    }

    fn std(fit: &Fit, along: Vector3<f64>) -> f64 {
        along.dot(&(fit.covariance.fixed_view::<3, 3>(0, 0) * along)).sqrt()
    }

    #[test]
    fn noise_within_windows_counts_and_white_noise_averages_out() {
        let model = skew_box([0.12, 0.16, 0.09]);
        let pose = placed(0.02, -0.01, 0.7, Vector3::new(0.5, 0.4, 0.2));
        let frame = shown(&model, &pose, 2.0);
        let mean = |sigma: f32, side: usize| {
            let fits = (0..8)
                .map(|seed| fit(&model, &pose, &noisy(frame.clone(), sigma, side, seed), &plain()).noise_m);
            fits.sum::<f64>() / 8.0
        };
        // Along the normals of faces that stand obliquely it is less than along the ray.
        let windows = mean(0.002, 16);
        assert!((0.0009..0.002).contains(&windows), "{windows}");
        let white = mean(0.002, 1);
        assert!(white < 0.2 * windows, "{white} {windows}");
        let doubled = mean(0.004, 16);
        assert!((doubled / windows - 2.0).abs() < 0.3, "{doubled} {windows}");
    }

    #[test]
    fn the_covariance_grows_with_the_noise_and_shrinks_with_what_is_seen() {
        let model = skew_box([0.12, 0.16, 0.09]);
        let pose = placed(0.02, -0.01, 0.7, Vector3::new(0.5, 0.4, 0.2));
        let frame = shown(&model, &pose, 2.0);
        let of = |frame: &CameraFrame, sigma: f32| {
            let spreads = (0..8).map(|seed| {
                std(&fit(&model, &pose, &noisy(frame.clone(), sigma, 16, seed), &plain()), Vector3::z())
            });
            spreads.sum::<f64>() / 8.0
        };
        let (small, large) = (of(&frame, 0.001), of(&frame, 0.002));
        assert!((large / small - 2.0).abs() < 0.4, "{small} {large}");
        // A dozen cells of three faces: less than the noise of one, more than of all of them together.
        assert!((0.0001..0.001).contains(&small), "{small}");
        let mut half = frame.clone();
        for v in 0..half.depth.height() {
            for u in 0..330 {
                *half.depth.at_mut(u, v) = 0.4;
            }
        }
        let hidden = of(&half, 0.001);
        assert!(hidden > 1.2 * small, "{small} {hidden}");
    }

    #[test]
    fn what_slides_along_a_face_is_held_by_the_silhouette_alone() {
        // One face alone, seen from straight before it.
        let model = skew_box([0.12, 0.16, 0.09]);
        let pose = placed(0.0, 0.0, 0.7, Vector3::zeros());
        let frame = noisy(shown(&model, &pose, 2.0), 0.001, 16, 1);
        let vague = fit(&model, &pose, &frame, &UncertaintySettings { edge_px: 50.0, ..plain() });
        let sure = fit(&model, &pose, &frame, &plain());
        let [wide, narrow] = [&vague, &sure].map(|fit| std(fit, Vector3::x()));
        assert!(wide > 4.0 * narrow && narrow < 0.003, "{wide} {narrow}");
        // Its distance does not depend on the silhouette.
        let [wide, narrow] = [&vague, &sure].map(|fit| std(fit, Vector3::z()));
        assert!(wide < 1.5 * narrow, "{wide} {narrow}");
        // Without a silhouette there is what is known before.
        let mut flush = frame.clone();
        for z in flush.depth.data_mut() {
            *z = z.min(0.655);
        }
        let lost = fit(&model, &pose, &flush, &plain());
        let tails = (4.5_f64 / 2.5).sqrt();
        assert!(std(&lost, Vector3::x()) > 0.8 * tails * plain().prior_m, "{}", std(&lost, Vector3::x()));
    }

    #[test]
    fn slow_errors_are_the_cameras_and_turns_about_an_axis_are_free() {
        let model = can(0.04, 0.12);
        let upright = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 1.9);
        let pose = Isometry3::from_parts(nalgebra::Translation3::new(0.0, 0.0, 0.8), upright);
        let frame = noisy(shown(&model, &pose, 2.0), 0.0005, 16, 2);
        let without = fit(&model, &pose, &frame, &plain());
        let slow = UncertaintySettings { slow_m: [0.005, 0.0, 0.0], ..plain() };
        let with = fit(&model, &pose, &frame, &slow);
        let tails = 4.5 / 2.5;
        let added = std(&with, Vector3::z()).powi(2) - std(&without, Vector3::z()).powi(2);
        assert!((added / (tails * (0.005 * 0.64_f64).powi(2)) - 1.0).abs() < 1e-6, "{added}");
        assert!((std(&with, Vector3::x()) / std(&without, Vector3::x()) - 1.0).abs() < 1e-6);
        let axis = (upright * Vector3::z()).cast::<f64>();
        let turn =
            |along: &Vector3<f64>| along.dot(&(without.covariance.fixed_view::<3, 3>(3, 3) * along)).sqrt();
        // Across the axis.
        assert!(turn(&axis) > 0.9 && turn(&Vector3::x()) < 0.1, "{} {}", turn(&axis), turn(&Vector3::x()));
    }
}
