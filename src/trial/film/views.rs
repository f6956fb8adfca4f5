//! Where the camera outside stands, by which people see a trial.

use grip_sim::camera::Intrinsics;
use grip_sim::pose::{Camera, Pose, World};
use grip_sim::scene::{Fixture, Scene, Surroundings};
use nalgebra::{Point3, Rotation3, Vector3};

use crate::pictures::camera::fitted;

/// Directions that are tried, degrees: from across the table, about the vertical, and above the horizon.
const AROUND_DEG: [f64; 13] =
    [0.0, 15.0, -15.0, 30.0, -30.0, 45.0, -45.0, 60.0, -60.0, 75.0, -75.0, 90.0, -90.0];
const ABOVE_DEG: [f64; 4] = [30.0, 38.0, 46.0, 54.0];
/// Of two directions that show as much, the one nearer to this is taken: neither flat nor from above, and no arm in front of the table.
const LIKED_DEG: [f64; 2] = [20.0, 36.0];
/// What a degree off the liked direction costs, as a share of the points of the bin's floor, or of the table, that are seen.
const PER_DEGREE: f64 = 0.002;
/// Points of the bin's floor and of the table along each side, and how far above them they are: what lies there is as high.
const POINTS: usize = 9;
const OVER_M: f64 = 0.02;
/// A varied room's wall stands at least this far behind the table, metres.
const NEAREST_WALL_M: f64 = 0.85;

/// A camera outside that has the whole bin and the table's top in its picture, `headroom` metres above both too, and sees as much of the
/// bin's floor and of the table as it can from where nobody stands. It depends on the scene alone.
pub fn overview(scene: &Scene, lens: &Intrinsics, headroom: f64) -> Pose<World, Camera> {
    let shown = outline(scene, headroom);
    let (floor, top) = (floor_points(scene), table_points(scene));
    let fixtures = scene.fixtures();
    let mut best: Option<(f64, Pose<World, Camera>)> = None;
    for above in ABOVE_DEG {
        for around in AROUND_DEG {
            let camera = fitted(&shown, direction(scene, around, above), lens);
            let eye = Point3::from(camera.translation());
            if scene.surroundings == Surroundings::Varied && eye.x > scene.table.high()[0] + NEAREST_WALL_M {
                continue;
            }
            let off = (around - LIKED_DEG[0]).abs() + (above - LIKED_DEG[1]).abs();
            let score = seen(&floor, &eye, &fixtures) + seen(&top, &eye, &fixtures) - PER_DEGREE * off;
            if best.as_ref().is_none_or(|(most, _)| score > *most) {
                best = Some((score, camera));
            }
        }
    }
    // A room that leaves no place across the table or beside it.
    best.map_or_else(|| fitted(&shown, direction(scene, 90.0, 54.0), lens), |(_, camera)| camera)
}

/// Towards the camera: `around` degrees from straight across the table, seen from the robot, to the robot's left, `above` the horizon.
fn direction(scene: &Scene, around: f64, above: f64) -> Vector3<f64> {
    let base = scene.world_from_base().translation();
    let mut away = Vector3::new(scene.table.center[0], scene.table.center[1], 0.0) - base;
    away.z = 0.0;
    let away = away.try_normalize(1e-9).unwrap_or_else(Vector3::x);
    let turned = Rotation3::from_axis_angle(&Vector3::z_axis(), around.to_radians()) * away;
    let above = above.to_radians();
    turned * above.cos() + Vector3::z() * above.sin()
}

/// Corners of what is to be in the picture: the table's top, the bin from the ground to its edge, and both so much higher.
fn outline(scene: &Scene, headroom: f64) -> Vec<Point3<f64>> {
    let (table, bin) = (&scene.table, &scene.bin);
    let edge = bin.base_height + bin.wall_thickness + bin.wall_height;
    let mut corners = Vec::new();
    let mut add = |[low, high]: [[f64; 2]; 2], heights: [f64; 2]| {
        for x in [low[0], high[0]] {
            for y in [low[1], high[1]] {
                corners.extend(heights.map(|z| Point3::new(x, y, z)));
            }
        }
    };
    add([table.low(), table.high()], [table.height, table.height]);
    let (low, high) = bin.outline();
    add([low, high], [bin.base_height, edge]);
    // The air above: over their middles, since what is high stands and is carried there.
    for (center, from) in [(table.center, table.height), (bin.center, edge)] {
        corners.push(Point3::new(center[0], center[1], from + headroom));
    }
    corners
}

/// Points just above the bin's floor.
pub(super) fn floor_points(scene: &Scene) -> Vec<Point3<f64>> {
    let bin = &scene.bin;
    let from = bin.world_from_bin();
    grid(bin.inner.map(|length| 0.46 * length)).map(|[x, y]| from * Point3::new(x, y, OVER_M)).collect()
}

/// Points just above the table's top, where no bin stands.
fn table_points(scene: &Scene) -> Vec<Point3<f64>> {
    let table = &scene.table;
    grid(table.size.map(|length| 0.46 * length))
        .map(|[x, y]| Point3::new(table.center[0] + x, table.center[1] + y, table.height + OVER_M))
        .filter(|p| scene.bin.distance(p.x, p.y) > 0.02)
        .collect()
}

fn grid(half: [f64; 2]) -> impl Iterator<Item = [f64; 2]> {
    let place = |i: usize, half: f64| half * (2.0 * i as f64 / (POINTS - 1) as f64 - 1.0);
    (0..POINTS * POINTS).map(move |k| [place(k / POINTS, half[0]), place(k % POINTS, half[1])])
}

/// The share of `points` that nothing fixed hides from `eye`.
pub(super) fn seen(points: &[Point3<f64>], eye: &Point3<f64>, fixtures: &[Fixture]) -> f64 {
    let free = |p: &&Point3<f64>| !fixtures.iter().any(|fixture| crosses(fixture, eye, p));
    points.iter().filter(free).count() as f64 / points.len().max(1) as f64
}

/// Whether the straight line from `a` to `b` meets a fixture, by its box.
fn crosses(fixture: &Fixture, a: &Point3<f64>, b: &Point3<f64>) -> bool {
    let [low, high] = fixture.shape.geometry.bounds();
    let [a, b] = [a, b].map(|p| fixture.shape.pose.inverse_transform_point(p));
    let (mut from, mut to) = (0.0_f64, 1.0_f64);
    for axis in 0..3 {
        let step = b[axis] - a[axis];
        if step.abs() < 1e-12 {
            if !(low[axis]..=high[axis]).contains(&a[axis]) {
                return false;
            }
            continue;
        }
        let ends = [(low[axis] - a[axis]) / step, (high[axis] - a[axis]) / step];
        from = from.max(ends[0].min(ends[1]));
        to = to.min(ends[0].max(ends[1]));
    }
    from <= to
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pictures::camera::{bounds, lens};
    use std::path::Path;

    #[test]
    fn in_every_scene_the_whole_bin_is_in_the_picture_and_its_floor_is_seen() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
        let mut scenes = 0;
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let text = std::fs::read_to_string(&path).unwrap_or_default();
            if !text.contains("schema = \"grip.scene/1\"") {
                continue;
            }
            let (scene, lens) = (Scene::load(&path).unwrap(), lens([640, 480], 55.0));
            let camera = overview(&scene, &lens, 0.2);
            let eye = Point3::from(camera.translation());
            let name = path.file_name().unwrap().display().to_string();
            let [low, high] = bounds(&outline(&scene, 0.2), &camera, &lens).unwrap();
            assert!(
                low[0] > 5.0 && low[1] > 5.0 && high[0] < 634.0 && high[1] < 474.0,
                "{name}: {low:?} {high:?}"
            );
            let share = ((high[0] - low[0]) / 640.0).max((high[1] - low[1]) / 480.0);
            assert!(share > 0.85, "{name}: only {share:.2} of the picture are used");
            let fixtures = scene.fixtures();
            let [floor, top] =
                [floor_points(&scene), table_points(&scene)].map(|points| seen(&points, &eye, &fixtures));
            // A wall hides as much of the floor as it is high, by the steepest slope; more only for the sake of the table.
            let length = scene.bin.inner[0].max(scene.bin.inner[1]);
            let possible = 1.0 - scene.bin.wall_height / (ABOVE_DEG[3].to_radians().tan() * length);
            let least = (possible - 0.1).min(0.65);
            assert!(floor > least, "{name}: {floor:.2} of the bin's floor, at least {least:.2} can be seen");
            assert!(top > 0.65, "{name}: {top:.2} of the table");
            scenes += 1;
        }
        assert!(scenes >= 14, "{scenes}");
    }

    #[test]
    fn a_wall_before_a_point_hides_it() {
        let scene = Scene::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/grocery.toml")).unwrap();
        let (points, fixtures) = (floor_points(&scene), scene.fixtures());
        let centre = scene.bin.world_from_bin() * Point3::origin();
        let above = centre + Vector3::new(0.0, 0.0, 1.0);
        assert!(seen(&points, &above, &fixtures) > 0.99);
        let level = centre + Vector3::new(2.0, 0.0, 0.05);
        assert!(seen(&points, &level, &fixtures) < 0.01);
    }
}
