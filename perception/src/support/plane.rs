//! The support plane (table top) in a depth image: seeded RANSAC, then least squares on the inliers.

use grip_sim::frame::CameraFrame;
use grip_sim::rng;
use nalgebra::{Matrix3, Point3, Unit, Vector3};
use rand::RngExt;

use super::footprint::Footprint;
use super::settings::SupportSettings;
use crate::frame::is_reading;
use crate::workspace::Workspace;

/// A plane in the camera's optical frame, its normal pointing up: the side on which objects stand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// Unit normal.
    pub normal: Unit<Vector3<f64>>,
    /// `normal . p + offset` is the height of point `p`, metres.
    pub offset: f64,
}

impl Plane {
    /// Height of a point over the plane, metres; negative below.
    pub fn height(&self, point: &Point3<f64>) -> f64 {
        self.normal.dot(&point.coords) + self.offset
    }
}

/// A support: a plane and how far it was seen to reach.
#[derive(Debug, Clone, PartialEq)]
pub struct Support {
    /// The plane, in the optical frame.
    pub plane: Plane,
    /// The outline of its visible surface.
    pub footprint: Footprint,
    /// How far beyond that outline objects may reach, metres.
    pub overhang_m: f64,
}

impl Support {
    /// Whether a point is over the support or little beside it, at any height.
    pub fn holds(&self, point: &Point3<f64>) -> bool {
        self.footprint.covers(point, self.overhang_m)
    }
}

/// Points are taken from every sixth pixel: about 8500 of a 640x480 image, plenty for a plane.
const STRIDE: usize = 6;
/// Draws are counted on every eighth of those.
const COUNT_STEP: usize = 8;
/// Rounds of the least-squares refinement.
const REFINEMENTS: usize = 4;

/// Finds the surface that objects stand on; `None` when no plane has enough points, or the settings switch it off. With a workspace only points within its
/// x and y range count. The draws come from a fixed stream: the same frame gives the same plane.
pub fn fit_support_plane(
    frame: &CameraFrame,
    settings: &SupportSettings,
    workspace: Option<&Workspace>,
) -> Option<Support> {
    if !settings.enabled {
        return None;
    }
    let mut points = sample_points(frame, workspace);
    let all = points.clone();
    let enough = ((points.len() as f64 * settings.min_share) as usize).max(30);
    let up = (settings.max_tilt_rad < SupportSettings::ANY_TILT).then(|| {
        let up = frame.world_from_camera.inverse().transform_vector(&Vector3::z());
        (up, settings.max_tilt_rad.cos())
    });
    let mut rng = rng::stream(0, "support-plane");
    let mut best: Option<(Plane, usize)> = None;
    // The largest plane, then up to two more: the floor may be larger than the table.
    for _ in 0..3 {
        let Some(plane) = ransac(&points, settings, up, &mut rng) else {
            break;
        };
        let plane = refine(plane, &points, settings.inlier_m);
        let close = |p: &Point3<f64>| plane.height(p).abs() < settings.inlier_m;
        let inliers: Vec<Point3<f64>> = points.iter().copied().filter(close).collect();
        let count = inliers.len();
        if count < enough {
            break;
        }
        let large = || {
            Footprint::new(&plane.normal, inliers.into_iter())
                .is_some_and(|f| f.area() >= settings.higher_area_m2)
        };
        let better = best.is_none_or(|(old, most)| {
            count as f64 > settings.higher_share * most as f64
                && plane.normal.dot(&old.normal) > 0.98
                && plane.offset < old.offset - 0.02
                && large()
        });
        if better {
            best = Some((plane, best.map_or(count, |(_, most)| most)));
        }
        // Everything near it goes, or its noisy rim would be found again.
        points.retain(|p| plane.height(p).abs() > 3.0 * settings.inlier_m);
    }
    let (plane, _) = best?;
    let close = all.into_iter().filter(|p| plane.height(p).abs() < settings.inlier_m);
    let footprint = Footprint::new(&plane.normal, close)?;
    Some(Support { plane, footprint, overhang_m: settings.overhang_m })
}

fn sample_points(frame: &CameraFrame, workspace: Option<&Workspace>) -> Vec<Point3<f64>> {
    let (k, depth) = (&frame.intrinsics, &frame.depth);
    let inside = |p: &Point3<f64>| {
        workspace.is_none_or(|w| {
            let world = frame.world_from_camera.transform_point(p);
            (0..2).all(|i| world[i] >= w.min[i] && world[i] <= w.max[i])
        })
    };
    let mut points = Vec::new();
    for v in (0..k.height).step_by(STRIDE) {
        for u in (0..k.width).step_by(STRIDE) {
            let z = *depth.at(u, v);
            if is_reading(z) {
                let p = k.back_project(u as f64, v as f64, f64::from(z));
                if inside(&p) {
                    points.push(p);
                }
            }
        }
    }
    points
}

/// A plane through three points, its normal towards the camera: a plane that is seen is seen from above.
fn through(a: &Point3<f64>, b: &Point3<f64>, c: &Point3<f64>) -> Option<Plane> {
    let normal = Unit::try_new((b - a).cross(&(c - a)), 1e-8)?;
    Some(facing_camera(normal, a))
}

fn facing_camera(normal: Unit<Vector3<f64>>, through: &Point3<f64>) -> Plane {
    let offset = -normal.dot(&through.coords);
    if offset < 0.0 { Plane { normal: -normal, offset: -offset } } else { Plane { normal, offset } }
}

fn ransac(
    points: &[Point3<f64>],
    settings: &SupportSettings,
    up: Option<(Vector3<f64>, f64)>,
    rng: &mut impl rand::Rng,
) -> Option<Plane> {
    if points.len() < 30 {
        return None;
    }
    let mut best: Option<(Plane, usize)> = None;
    for _ in 0..settings.draws {
        let mut draw = || &points[rng.random_range(0..points.len())];
        let Some(plane) = through(draw(), draw(), draw()) else {
            continue;
        };
        if up.is_some_and(|(up, cos)| plane.normal.dot(&up) < cos) {
            continue;
        }
        let count =
            points.iter().step_by(COUNT_STEP).filter(|p| plane.height(p).abs() < settings.inlier_m).count();
        if best.is_none_or(|(_, most)| count > most) {
            best = Some((plane, count));
        }
    }
    best.map(|(plane, _)| plane)
}

/// Least squares on the inliers, a few times: the normal is the direction of least variance.
fn refine(mut plane: Plane, points: &[Point3<f64>], inlier_m: f64) -> Plane {
    for _ in 0..REFINEMENTS {
        let inliers = || points.iter().filter(|p| plane.height(p).abs() < inlier_m);
        let count = inliers().count();
        if count < 10 {
            break;
        }
        let mean = inliers().fold(Vector3::zeros(), |sum, p| sum + p.coords) / count as f64;
        let covariance = inliers().fold(Matrix3::zeros(), |sum: Matrix3<f64>, p| {
            let d = p.coords - mean;
            sum + d * d.transpose()
        });
        let eigen = covariance.symmetric_eigen();
        let Some(normal) =
            Unit::try_new(eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned(), 1e-9)
        else {
            break;
        };
        plane = facing_camera(normal, &Point3::from(mean));
    }
    plane
}

#[cfg(test)]
mod tests {
    use super::*;
    use grip_sim::camera::Intrinsics;
    use grip_sim::images::{Image, RgbImage};
    use grip_sim::pose::Pose;
    use nalgebra::{Isometry3, UnitQuaternion};

    /// A camera 1.2 m up, `down` radians below the horizon, over a floor and a table top at 0.7 m for world x < 1.1.
    fn frame(down: f64, table_end: f64, noise: f64) -> CameraFrame {
        let k = Intrinsics::FETCH;
        // Optical frame: z forward and down, x right (world -y), y down.
        let forward = Vector3::new(down.cos(), 0.0, -down.sin());
        let right = Vector3::new(0.0, -1.0, 0.0);
        let rotation = nalgebra::Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[
            right,
            forward.cross(&right),
            forward,
        ]));
        let iso = Isometry3::from_parts(
            nalgebra::Translation3::new(0.0, 0.0, 1.2),
            UnitQuaternion::from_rotation_matrix(&rotation),
        );
        let mut rng = rng::stream(3, "noise");
        let mut depth = Image::filled(k.width, k.height, 0.0f32);
        for v in 0..k.height {
            for u in 0..k.width {
                let ray = iso * k.back_project(u as f64, v as f64, 1.0).coords;
                let hit = |height: f64| (height - 1.2) / ray.z;
                let table = hit(0.7);
                let z = if table > 0.0 && table * ray.x < table_end { table } else { hit(0.0) };
                if z > 0.0 && z < 4.0 && rng.random::<f64>() > 0.1 {
                    *depth.at_mut(u, v) = (z + noise * (rng.random::<f64>() - 0.5)) as f32;
                }
            }
        }
        CameraFrame { rgb: RgbImage::new(640, 480), depth, intrinsics: k, world_from_camera: Pose::new(iso) }
    }

    #[test]
    fn finds_a_noisy_table_to_the_millimetre() {
        for (down, max_tilt_rad) in [(0.8, 0.1), (0.95, SupportSettings::ANY_TILT)] {
            let frame = frame(down, 3.0, 0.008);
            let settings = SupportSettings { max_tilt_rad, ..Default::default() };
            let plane = fit_support_plane(&frame, &settings, None).unwrap().plane;
            assert!((plane.offset - 0.5).abs() < 0.001, "{plane:?}");
            let up = frame.world_from_camera.transform_vector(&plane.normal);
            assert!(up.z > 0.5f64.to_radians().cos(), "{up:?}");
        }
    }

    #[test]
    fn prefers_the_table_to_a_larger_floor() {
        let frame = frame(0.75, 0.5, 0.004);
        let plane = fit_support_plane(&frame, &SupportSettings::default(), None).unwrap().plane;
        assert!((plane.offset - 0.5).abs() < 0.002, "{plane:?}");
    }

    #[test]
    fn the_top_of_a_box_is_no_table() {
        // A box of 0.22 x 0.18 m and 0.06 m height fills much of the image of a camera that looks down on it, and what is seen
        // of the table around it is mostly without readings.
        let mut frame = frame(1.2, 3.0, 0.002);
        let k = frame.intrinsics;
        let (mut top, mut table) = (0, 0);
        for v in 0..k.height {
            for u in 0..k.width {
                let ray =
                    frame.world_from_camera.transform_vector(&k.back_project(u as f64, v as f64, 1.0).coords);
                let z = (0.76 - 1.2) / ray.z;
                let (x, y) = (z * ray.x, z * ray.y);
                let depth = frame.depth.at_mut(u, v);
                if (0.06..0.24).contains(&x) && y.abs() < 0.11 {
                    *depth = z as f32;
                    top += 1;
                } else if !(u / STRIDE + v / STRIDE).is_multiple_of(3) {
                    *depth = 0.0;
                } else {
                    table += usize::from(*depth > 0.0);
                }
            }
        }
        assert!(
            top as f64 > SupportSettings::default().higher_share * table as f64,
            "{top} {table}: too small a box to be taken for one"
        );
        let plane = fit_support_plane(&frame, &SupportSettings::default(), None).unwrap().plane;
        assert!((plane.offset - 0.5).abs() < 0.003, "{plane:?}");
    }

    #[test]
    fn a_wall_is_no_support() {
        let mut frame = frame(0.8, 3.0, 0.0);
        let (w, h) = (640, 480);
        frame.depth = Image::filled(w, h, 1.0);
        assert!(fit_support_plane(&frame, &SupportSettings::default(), None).is_none());
    }
}
