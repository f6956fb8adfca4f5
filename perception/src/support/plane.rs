//! Support planes (table top, shelf, step) in a depth image: seeded RANSAC, then least squares on the inliers.

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

/// The level surfaces of a frame, one above the other: a table, and what steps and shelves there are.
#[derive(Debug, Clone, PartialEq)]
pub struct Supports {
    /// The lowest first.
    levels: Vec<Support>,
}

impl Supports {
    /// One plane without an end.
    #[cfg(test)]
    pub(crate) fn endless(plane: Plane) -> Self {
        Self { levels: vec![Support { plane, footprint: Footprint::endless(), overhang_m: 0.0 }] }
    }

    /// The lowest surface that objects are looked for on.
    pub fn base(&self) -> &Support {
        &self.levels[0]
    }

    /// The surfaces above it, the lowest first.
    pub fn higher(&self) -> &[Support] {
        &self.levels[1..]
    }

    /// All of them, the lowest first.
    pub fn all(&self) -> &[Support] {
        &self.levels
    }

    /// Height of a point over the highest surface below it, metres; `None` for a point that is beside all of them. A surface
    /// counts from `tolerance` metres below it on.
    pub fn height(&self, point: &Point3<f64>, tolerance: f64) -> Option<f64> {
        if !self.levels.iter().any(|support| support.holds(point)) {
            return None;
        }
        let over = |support: &Support| {
            let height = support.plane.height(point);
            (height > -tolerance && support.footprint.covers(point, 0.0)).then_some(height)
        };
        let higher = self.higher().iter().rev().find_map(over);
        Some(higher.unwrap_or_else(|| self.base().plane.height(point)))
    }
}

/// Points are taken from every sixth pixel: about 8500 of a 640x480 image, plenty for a plane.
const STRIDE: usize = 6;
/// Draws are counted on every eighth of those.
const COUNT_STEP: usize = 8;
/// The largest plane, then up to two more: the floor may be larger than the table.
const MAIN_PLANES: usize = 3;
/// With further steps and shelves.
const MOST_PLANES: usize = 5;
/// Rounds of the least-squares refinement.
const REFINEMENTS: usize = 4;

impl Supports {
    /// Finds the surfaces that objects stand on; `None` when no plane has enough points, or the settings switch it off. The
    /// main one is the largest, or one above it that is nearly as large. With it go those parallel to it that are large
    /// enough, and not too far above or below. With a workspace only points within its x and y range count. The draws come
    /// from a fixed stream: the same frame gives the same planes.
    pub fn fit(
        frame: &CameraFrame,
        settings: &SupportSettings,
        workspace: Option<&Workspace>,
    ) -> Option<Self> {
        if !settings.enabled {
            return None;
        }
        let points = sample_points(frame, workspace);
        let (main, others) = main_and_others(frame, points.clone(), settings)?;
        let support = |plane: Plane| {
            let close = points.iter().copied().filter(|p| plane.height(p).abs() < settings.inlier_m);
            let footprint = Footprint::new(&plane.normal, close)?;
            Some(Support { plane, footprint, overhang_m: settings.overhang_m })
        };
        let further = |plane: &Plane| {
            let rise = (main.offset - plane.offset).abs();
            plane.normal.dot(&main.normal) > PARALLEL && (LEAST_STEP..=settings.levels_m).contains(&rise)
        };
        let mut levels = vec![support(main)?];
        let others = others.into_iter().filter(further).filter_map(support);
        levels.extend(others.filter(|other| other.footprint.area() >= settings.higher_area_m2));
        // The camera is above all of them: the higher a plane, the nearer.
        levels.sort_by(|a, b| b.plane.offset.total_cmp(&a.plane.offset));
        Some(Self { levels })
    }
}

/// Cosine of the largest angle between planes of one support.
const PARALLEL: f64 = 0.98;
/// Planes nearer to each other are one, metres.
const LEAST_STEP: f64 = 0.02;

/// The plane that most objects stand on, and others.
fn main_and_others(
    frame: &CameraFrame,
    mut points: Vec<Point3<f64>>,
    settings: &SupportSettings,
) -> Option<(Plane, Vec<Plane>)> {
    let enough = ((points.len() as f64 * settings.min_share) as usize).max(30);
    let up = (settings.max_tilt_rad < SupportSettings::ANY_TILT).then(|| {
        let up = frame.world_from_camera.inverse().transform_vector(&Vector3::z());
        (up, settings.max_tilt_rad.cos())
    });
    let mut rng = rng::stream(0, "support-plane");
    let mut best: Option<(usize, usize)> = None;
    let mut planes: Vec<Plane> = Vec::new();
    for round in 0..MOST_PLANES {
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
        let better = round < MAIN_PLANES
            && best.is_none_or(|(old, most)| {
                let old: &Plane = &planes[old];
                count as f64 > settings.higher_share * most as f64
                    && plane.normal.dot(&old.normal) > PARALLEL
                    && plane.offset < old.offset - LEAST_STEP
                    && large()
            });
        if better {
            best = Some((planes.len(), best.map_or(count, |(_, most)| most)));
        }
        planes.push(plane);
        // Everything near it goes, or its noisy rim would be found again.
        points.retain(|p| plane.height(p).abs() > 3.0 * settings.inlier_m);
    }
    let main = planes.remove(best?.0);
    Some((main, planes))
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
pub(crate) mod tests {
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

    fn main_plane(frame: &CameraFrame, settings: &SupportSettings) -> Plane {
        main_and_others(frame, sample_points(frame, None), settings).unwrap().0
    }

    #[test]
    fn finds_a_noisy_table_to_the_millimetre() {
        for (down, max_tilt_rad) in [(0.8, 0.1), (0.95, SupportSettings::ANY_TILT)] {
            let frame = frame(down, 3.0, 0.008);
            let settings = SupportSettings { max_tilt_rad, ..Default::default() };
            let plane = main_plane(&frame, &settings);
            assert!((plane.offset - 0.5).abs() < 0.001, "{plane:?}");
            let up = frame.world_from_camera.transform_vector(&plane.normal);
            assert!(up.z > 0.5f64.to_radians().cos(), "{up:?}");
        }
    }

    #[test]
    fn prefers_the_table_to_a_larger_floor() {
        let frame = frame(0.75, 0.5, 0.004);
        let plane = main_plane(&frame, &SupportSettings::default());
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
        let plane = main_plane(&frame, &SupportSettings::default());
        assert!((plane.offset - 0.5).abs() < 0.003, "{plane:?}");
    }

    /// The frame of a camera 1.2 m up over a table at 0.7 m that ends at x = 1.1, its floor, and a step of this height on the
    /// table for y > 0; a block of 5 x 6 cm, 4 cm high, stands on the step and one on the table.
    pub(crate) fn stepped(step: f64) -> CameraFrame {
        let mut frame = frame(0.8, 1.1, 0.0);
        let k = frame.intrinsics;
        for v in 0..k.height {
            for u in 0..k.width {
                let ray =
                    frame.world_from_camera.transform_vector(&k.back_project(u as f64, v as f64, 1.0).coords);
                let top = |height: f64, inside: &dyn Fn(f64, f64) -> bool| {
                    let z = (height - 1.2) / ray.z;
                    (z > 0.0 && inside(z * ray.x, z * ray.y)).then_some(z as f32)
                };
                let block = |x: f64, y: f64| (0.50..0.55).contains(&x) && (0.12..0.18).contains(&y.abs());
                let hits = [
                    top(0.7 + step + 0.04, &|x, y| y > 0.0 && block(x, y)),
                    top(0.7 + step, &|x, y| y > 0.0 && (0.3..0.9).contains(&x)),
                    top(0.74, &|x, y| y < 0.0 && block(x, y)),
                ];
                if let Some(z) = hits.into_iter().flatten().reduce(f32::min) {
                    *frame.depth.at_mut(u, v) = z;
                }
            }
        }
        frame
    }

    #[test]
    fn a_step_is_a_second_support_and_the_floor_is_none() {
        for step in [0.08, 0.2] {
            let frame = stepped(step);
            let supports = Supports::fit(&frame, &SupportSettings::default(), None).unwrap();
            let heights: Vec<f64> = supports.all().iter().map(|support| 1.2 - support.plane.offset).collect();
            assert_eq!(heights.len(), 2, "{heights:?}");
            assert!((heights[0] - 0.7).abs() < 1e-3 && (heights[1] - 0.7 - step).abs() < 1e-3, "{heights:?}");
            let camera_from_world = frame.world_from_camera.inverse();
            let height = |x: f64, y: f64, z: f64| {
                supports.height(&camera_from_world.transform_point(&Point3::new(x, y, z)), 0.005)
            };
            // Over the step, over the table beside it, below the step, beside both.
            assert!((height(0.5, 0.15, 0.75 + step).unwrap() - 0.05).abs() < 1e-3);
            assert!((height(0.5, -0.15, 0.75 + step).unwrap() - 0.05 - step).abs() < 1e-3);
            assert!((height(0.5, 0.15, 0.7 + 0.5 * step).unwrap() - 0.5 * step).abs() < 1e-3);
            assert_eq!(height(1.6, 0.0, 0.1), None);
        }
        let alone = SupportSettings { levels_m: 0.0, ..SupportSettings::default() };
        assert_eq!(Supports::fit(&stepped(0.08), &alone, None).unwrap().all().len(), 1);
    }

    #[test]
    fn a_wall_is_no_support() {
        let mut frame = frame(0.8, 3.0, 0.0);
        let (w, h) = (640, 480);
        frame.depth = Image::filled(w, h, 1.0);
        assert!(Supports::fit(&frame, &SupportSettings::default(), None).is_none());
    }
}
