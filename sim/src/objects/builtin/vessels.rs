//! Open vessels: a wall turned about the vertical, a cavity, and a handle that runs into the wall.
//!
//! A vessel with a handle is a union of two closed parts. Collision keeps the cavity: the wall is a ring of wedges.
//! The pitcher has no lid; its rim ends where the scan's lid does, so that it is as high.

use std::f64::consts::PI;

use nalgebra::{Point3, Translation3, Vector3};

use super::BuiltIn;
use super::canvas::{Canvas, Color};
use super::lofts::{
    self, Look, MARGIN, MM, Part, Ring, Spot, hull, hulls, plain, spline, superellipse, swept, wall,
};
use crate::shape::CollisionShape;

const AROUND: usize = 64;

pub(super) fn build(name: &str) -> Option<BuiltIn> {
    match name {
        "019_pitcher_base" => Some(pitcher()),
        "024_bowl" => Some(bowl()),
        "025_mug" => Some(mug()),
        _ => None,
    }
}

/// A coloured surface that takes the texture's shades once round, over `height` metres about the origin.
fn glazed(spot: Spot, color: Color, height: f64) -> Look {
    let down = (0.5 - spot.point.z / height).clamp(0.0, 1.0);
    let v = f64::from(MARGIN) + 0.02 + (0.96 - f64::from(MARGIN)) * down;
    Look { color, uv: [spot.around as f32, v as f32] }
}

/// White with faint clouds and specks: the unevenness of enamel and of moulded plastic.
fn glaze(amount: f32, seed: u32) -> Canvas {
    let mut canvas = Canvas::new(512, 512, [255; 3]);
    canvas.grain([40.0, 40.0], [214, 208, 206], amount, seed);
    canvas.noise(3.0, seed);
    canvas.rect(0.0, 0.0, 512.0, 512.0 * MARGIN, [255; 3]);
    canvas
}

/// A solid of revolution's bottom as one hull: a disc from `low` to `high`, radii at both, millimetres.
fn floor(low: [f64; 2], high: [f64; 2]) -> CollisionShape {
    hull(lofts::revolved(&[low, high], 16).concat())
}

/// Moves shapes that were made about the z axis.
fn displaced(mut shapes: Vec<CollisionShape>, by: Vector3<f64>) -> Vec<CollisionShape> {
    for shape in &mut shapes {
        shape.pose = Translation3::from(by) * shape.pose;
    }
    shapes
}

fn bowl() -> BuiltIn {
    const RED: Color = [186, 30, 34];
    let profile = [
        [3.0, -26.4],
        [38.0, -26.4],
        [40.5, -27.5],
        [44.6, -27.5],
        [46.8, -25.4],
        [52.2, -20.0],
        [57.0, -15.0],
        [60.8, -10.0],
        [64.0, -5.0],
        [66.6, 0.0],
        [68.9, 5.0],
        [70.8, 10.0],
        [72.2, 15.0],
        [73.2, 20.0],
        [73.6, 22.2],
        [76.0, 23.2],
        [79.4, 23.4],
        [80.7, 25.0],
        [79.8, 26.8],
        [77.0, 27.45],
        [73.5, 26.6],
        [71.4, 23.8],
        [70.4, 19.0],
        [68.2, 10.0],
        [64.0, 0.0],
        [58.2, -10.0],
        [53.6, -15.6],
        [48.0, -20.2],
        [41.0, -23.2],
        [30.0, -24.0],
        [3.0, -24.0],
    ];
    let rings = lofts::revolved(&profile, AROUND);
    let body = Part::loft(&rings, |spot| match spot.band {
        Some(3) => plain([150, 70, 60]),
        Some(_) => glazed(spot, RED, 0.056),
        None => plain(RED),
    });
    let mut collision = vec![floor([44.6, -27.5], [49.0, -23.0])];
    collision.extend(wall(&[[47.0, -25.4], [66.6, 0.0]], &[[47.0, -21.0], [63.6, 0.0]], 14));
    collision.extend(wall(
        &[[66.6, 0.0], [73.6, 22.2], [80.0, 24.0], [79.0, 27.2]],
        &[[63.6, 0.0], [71.0, 26.0]],
        14,
    ));
    BuiltIn { visual: lofts::visual(&[body], 0.3, glaze(0.25, 24)), collision }
}

fn mug() -> BuiltIn {
    const RED: Color = [178, 26, 30];
    const RIM: Color = [120, 22, 26];
    let axis = Vector3::new(-12.3 * MM, -0.1 * MM, 0.0);
    let profile = [
        [3.0, -39.6],
        [32.0, -39.6],
        [33.5, -40.6],
        [35.5, -40.6],
        [38.4, -39.4],
        [40.2, -36.8],
        [40.7, -33.0],
        [40.8, -10.0],
        [40.9, 15.0],
        [41.0, 36.6],
        [42.0, 37.6],
        [45.6, 37.8],
        [46.5, 39.1],
        [45.4, 40.4],
        [41.6, 40.5],
        [39.4, 39.4],
        [38.6, 36.0],
        [38.5, 0.0],
        [38.3, -33.0],
        [37.0, -36.2],
        [34.0, -37.2],
        [3.0, -37.2],
    ];
    let rings: Vec<Ring> = lofts::revolved(&profile, AROUND)
        .iter()
        .map(|ring| ring.iter().map(|point| point + axis).collect())
        .collect();
    let body = Part::loft(&rings, |spot| match spot.band {
        Some(9..=14) => plain(RIM),
        Some(_) => glazed(spot, RED, 0.082),
        None => plain(RED),
    });
    let path = [
        [27.0, 26.0],
        [38.0, 26.4],
        [46.5, 24.6],
        [52.6, 18.4],
        [55.2, 8.0],
        [55.6, -2.0],
        [53.4, -12.0],
        [47.0, -20.4],
        [38.0, -24.6],
        [27.0, -26.4],
    ];
    let path: Vec<Point3<f64>> =
        spline(&path, 3).iter().map(|&[x, z]| Point3::new(x * MM, -2.6 * MM, z * MM)).collect();
    let strap = superellipse(2.6 * MM, 6.8 * MM, 3.0, 20);
    let loops = swept(&path, Vector3::y(), false, |_| strap.clone());
    let handle = Part::loft(&loops, |_| plain(RED));

    let mut collision = vec![floor([37.0, -40.6], [40.4, -37.2])];
    collision.extend(wall(&[[40.6, -37.2], [41.0, 37.6]], &[[38.4, -37.2], [38.6, 37.6]], 10));
    collision.extend(wall(&[[42.0, 37.4], [46.2, 38.4], [45.4, 40.4]], &[[38.8, 37.4], [40.4, 40.4]], 10));
    let mut collision = displaced(collision, axis);
    collision.extend(hulls(&loops, &[0, 7, 13, 20, 27], 10));
    BuiltIn { visual: lofts::visual(&[body, handle], 0.3, glaze(0.25, 25)), collision }
}

/// How far the spout bulges at `angle` from its middle and height `z` (millimetres), millimetres.
fn spout(angle: f64, z: f64) -> f64 {
    let rise = ((z - 74.0) / 40.0).clamp(0.0, 1.0);
    let rise = rise * rise * (3.0 - 2.0 * rise);
    12.5 * rise * (-(angle / 0.2).powi(2)).exp()
}

fn pitcher() -> BuiltIn {
    const BLUE: Color = [30, 78, 152];
    const HANDLE: Color = [26, 68, 138];
    const TOP: f64 = 120.6;
    // The spout points away from the handle, which lies nearly along x = y.
    const HANDLE_YAW: f64 = 43.2 / 180.0 * PI;
    const SPOUT: f64 = HANDLE_YAW + PI;
    let axis = Vector3::new(-8.0 * MM, -6.8 * MM, 0.0);
    let cone = |z: f64| 53.5 + (z + 110.0) / 222.0 * 12.6;
    let mut profile =
        vec![[3.0, -119.6], [41.0, -119.6], [42.5, -121.2], [45.5, -121.2], [50.0, -117.6], [52.6, -114.0]];
    let heights = [-110.0, -70.0, -20.0, 30.0, 74.0, 84.0, 94.0, 104.0, 110.0];
    profile.extend(heights.iter().map(|&z| [cone(z), z]));
    profile.extend([
        [cone(111.0), 111.4],
        [66.6, 112.4],
        [66.6, TOP - 1.0],
        [65.8, TOP],
        [64.8, TOP],
        [64.0, TOP - 1.0],
    ]);
    profile.extend(heights.iter().rev().map(|&z| [cone(z) - 2.8, z]));
    profile.extend([[48.5, -114.8], [44.0, -117.0], [3.0, -117.0]]);
    let rings: Vec<Ring> = profile
        .iter()
        .map(|&[radius, z]| {
            superellipse(1.0, 1.0, 2.0, AROUND)
                .iter()
                .map(|&[x, y]| {
                    let angle = (y.atan2(x) - SPOUT + 3.0 * PI).rem_euclid(2.0 * PI) - PI;
                    let bulged = (radius + spout(angle, z)) * MM;
                    Point3::new(bulged * x, bulged * y, z * MM) + axis
                })
                .collect()
        })
        .collect();
    let body = Part::loft(&rings, |spot| match spot.band {
        Some(_) => glazed(spot, BLUE, 0.243),
        None => plain(BLUE),
    });
    let path = [
        [64.4, 101.0],
        [78.0, 100.0],
        [92.0, 93.0],
        [99.6, 78.0],
        [100.8, 50.0],
        [99.6, 20.0],
        [94.0, -6.0],
        [83.0, -25.0],
        [68.0, -38.0],
        [55.6, -41.0],
    ];
    let (sin, cos) = HANDLE_YAW.sin_cos();
    let stations = spline(&path, 3);
    let path: Vec<Point3<f64>> =
        stations.iter().map(|&[r, z]| Point3::new(r * cos * MM, r * sin * MM, z * MM) + axis).collect();
    let grip = superellipse(4.6 * MM, 9.6 * MM, 3.5, 20);
    let loops = swept(&path, Vector3::new(-sin, cos, 0.0), false, |_| grip.clone());
    let handle = Part::loft(&loops, |_| plain(HANDLE));

    let mut collision = vec![floor([45.5, -121.2], [53.0, -116.0])];
    collision.extend(wall(&[[53.2, -116.0], [66.4, TOP]], &[[50.4, -116.0], [63.6, TOP]], 14));
    let tip = |angle: f64, radius: f64, z: f64| {
        let (sin, cos) = (SPOUT + angle).sin_cos();
        Point3::new(radius * cos * MM, radius * sin * MM, z * MM)
    };
    // The two sides of the spout, with the channel between them open.
    collision.extend([-0.3, 0.3].map(|edge| {
        let rim = [(edge, 66.5), (edge, 63.6), (0.0, 78.8), (0.0, 75.6)].map(|(angle, r)| tip(angle, r, TOP));
        let foot = [tip(0.0, 64.8, 84.0), tip(0.0, 62.0, 84.0), tip(0.6 * edge, 63.6, 84.0)];
        hull(rim.into_iter().chain(foot).collect())
    }));
    let mut collision = displaced(collision, axis);
    collision.extend(hulls(&loops, &[0, 5, 9, 15, 19, 23, 27], 10));
    BuiltIn { visual: lofts::visual(&[body, handle], 0.4, glaze(0.3, 19)), collision }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;

    #[test]
    fn the_cavity_of_a_vessel_stays_open() {
        // A point in the middle of each cavity lies in none of the convex pieces.
        for (vessel, point) in [
            (bowl(), Point3::new(0.0, 0.0, 0.005)),
            (mug(), Point3::new(-0.012, 0.0, 0.0)),
            (pitcher(), Point3::new(-0.008, -0.007, 0.0)),
        ] {
            for piece in &vessel.collision {
                assert_eq!(piece.pose.rotation, UnitQuaternion::identity());
                let crate::shape::Convex::Hull { points } = &piece.geometry else { panic!("a hull") };
                // Each piece lies on one side of a plane through the point: that of the point and the piece's centre.
                let center =
                    Point3::from(points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / points.len() as f64);
                let away = piece.pose * center - point;
                assert!(points.iter().all(|p| (piece.pose * p - point).dot(&away) > 0.0));
            }
        }
    }
}
