//! Hand tools: a cordless drill, scissors and a marker pen, each a union of closed parts that run into each other.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use super::BuiltIn;
use super::canvas::{BLACK, Canvas, Color, METAL, Turn, WHITE, Weight};
use super::lofts::{
    self, Look, MARGIN, MM, Part, Ring, Spot, hull, hulls, plain, ribbon, spline, superellipse,
};

const ORANGE: Color = [226, 92, 22];
const DARK: Color = [38, 38, 40];

pub(super) fn build(name: &str) -> Option<BuiltIn> {
    match name {
        "035_power_drill" => Some(drill()),
        "037_scissors" => Some(scissors()),
        "040_large_marker" => Some(marker()),
        _ => None,
    }
}

/// Circles about an axis along +x through `(y, z)`; profile of `(x, radius)`, millimetres.
fn along_x(profile: &[[f64; 2]], y: f64, z: f64, n: usize) -> Vec<Ring> {
    profile
        .iter()
        .map(|&[x, radius]| {
            superellipse(radius, radius, 2.0, n)
                .iter()
                .map(|&[u, v]| Point3::new(x, y + u, z + v) * MM)
                .collect()
        })
        .collect()
}

fn drill() -> BuiltIn {
    // The drill lies on its side: the bit points to -x, the battery is at -y.
    let chuck = [
        [-92.1, 7.0],
        [-91.4, 9.0],
        [-87.6, 11.6],
        [-86.4, 14.0],
        [-77.0, 19.2],
        [-58.6, 20.0],
        [-57.4, 21.4],
        [-40.0, 21.0],
        [-38.0, 20.2],
        [-34.0, 20.2],
    ];
    let chuck = along_x(&chuck, 67.2, -0.5, 36);
    let nose = [
        [-37.4, 19.0],
        [-36.8, 22.2],
        [-35.0, 23.4],
        [-20.0, 24.4],
        [-18.0, 25.0],
        [-5.0, 26.0],
        [-3.0, 24.0],
    ];
    let nose = along_x(&nose, 67.8, -0.5, 36);
    // Columns of `ribbon`; travelling along +x, the upper edge is on the left.
    let housing = [
        [-6.0, 89.0, -6.0, 44.5, 22.0, -0.5],
        [-5.0, 90.0, -5.0, 43.5, 23.0, -0.5],
        [16.0, 90.4, 16.0, 43.0, 23.4, -0.5],
        [40.0, 89.4, 40.0, 42.5, 23.4, -0.5],
        [68.0, 89.0, 68.0, 43.0, 23.0, -0.5],
        [80.0, 88.2, 80.0, 44.0, 22.0, -0.5],
        [87.0, 84.0, 87.0, 48.0, 18.5, -0.5],
        [90.8, 78.0, 90.8, 54.0, 13.0, -0.5],
        [92.1, 71.0, 92.1, 61.0, 6.0, -0.5],
    ];
    let housing = ribbon(&spline(&housing, 2), 3.2, 36);
    // Downwards, the rear edge is on the left.
    let grip = [
        [72.0, 50.0, -14.0, 50.0, 14.0, -1.0],
        [78.0, 42.0, -20.0, 42.0, 15.0, -1.0],
        [77.5, 35.0, -20.4, 34.0, 14.6, -1.0],
        [70.0, 31.5, -15.0, 30.0, 14.4, -1.0],
        [58.0, 28.0, 2.0, 24.0, 15.0, -1.2],
        [53.6, 20.0, 6.4, 14.0, 15.6, -1.4],
        [55.4, 8.0, 12.4, 4.0, 16.4, -1.6],
        [59.4, -8.0, 15.2, -8.0, 17.0, -1.8],
        [61.8, -24.0, 17.4, -24.0, 17.0, -1.8],
        [62.4, -40.0, 21.0, -40.0, 16.6, -1.6],
        [62.0, -52.0, 23.2, -52.0, 16.4, -1.0],
        [62.0, -62.0, 23.0, -62.0, 16.4, 0.0],
    ];
    let grip = ribbon(&spline(&grip, 2), 3.0, 32);
    let trigger = [
        [9.0, 31.0, -16.0, 31.0, 5.6, -1.0],
        [9.0, 28.0, -13.0, 28.4, 6.6, -1.0],
        [9.0, 22.0, -6.2, 22.0, 6.8, -1.0],
        [9.0, 14.0, -4.8, 14.0, 6.8, -1.0],
        [9.0, 8.0, -7.0, 8.0, 6.4, -1.0],
        [9.0, 5.4, -5.0, 6.2, 4.6, -1.0],
    ];
    let trigger = ribbon(&spline(&trigger, 2), 3.0, 20);
    let battery = [
        [58.0, -56.6, -6.0, -57.6, 16.0, 0.0],
        [62.0, -58.6, -24.0, -60.4, 19.5, 0.0],
        [64.0, -62.0, -27.6, -63.0, 22.0, 0.0],
        [67.0, -70.0, -30.6, -70.0, 25.6, 0.0],
        [68.6, -80.0, -34.0, -80.0, 28.2, 0.0],
        [66.4, -87.6, -37.0, -88.0, 28.6, 0.0],
        [61.0, -91.6, -36.4, -92.4, 27.4, 0.0],
        [56.0, -92.8, -33.0, -93.8, 25.0, 0.0],
    ];
    let battery = ribbon(&spline(&battery, 2), 4.5, 36);

    let parts = [
        Part::loft(&chuck, |spot| {
            plain(if spot.band.is_some_and(|band| band >= 6) { [58, 58, 62] } else { DARK })
        }),
        Part::loft(&nose, |_| plain([50, 50, 54])),
        Part::loft(&housing, |spot| match spot.band {
            None => plain(ORANGE),
            Some(_) => drill_print(spot),
        }),
        Part::loft(&grip, |spot| match spot.band {
            // Rubber where the palm is.
            Some(band) if band >= 9 && (0.12..0.88).contains(&spot.facet) => plain(ORANGE),
            Some(band) if band < 7 => plain(ORANGE),
            _ => plain(DARK),
        }),
        Part::loft(&trigger, |_| plain(DARK)),
        Part::loft(&battery, |spot| match spot.band {
            Some(0..=3) => plain(ORANGE),
            Some(_) => drill_print(spot),
            None => plain(DARK),
        }),
    ];
    let mut collision = hulls(&chuck, &[0, 5, 9], 12);
    collision.extend(hulls(&nose, &[1, 5], 14));
    collision.extend(hulls(&housing, &[0, 10, 16], 14));
    collision.extend(hulls(&grip, &[0, 3, 6, 9, 13, 18, 22], 14));
    collision.extend(hulls(&trigger, &[2, 8], 8));
    collision.extend(hulls(&battery, &[0, 4, 8, 11, 14], 14));
    BuiltIn { visual: lofts::visual(&parts, 0.5, drill_label()), collision }
}

/// Prints the left half of the canvas on +z and the right half on -z, 190 mm square about the origin.
fn drill_print(spot: Spot) -> Look {
    let across = (spot.point.x / (2.0 * 0.19)) as f32;
    let u = if spot.facet < 0.5 { 0.25 + across } else { 0.75 - across };
    let down = (0.5 - spot.point.y / 0.19) as f32;
    Look { color: [255; 3], uv: [u, MARGIN + 0.005 + (0.99 - MARGIN) * down] }
}

fn drill_label() -> Canvas {
    // 5.39 pixels a millimetre across, 5.04 down.
    let mut canvas = Canvas::new(2048, 1024, ORANGE);
    canvas.rect(0.0, 600.0, 2048.0, 1024.0, DARK);
    for (middle, sign) in [(512.0, 1.0), (1536.0, -1.0)] {
        let at = |x: f32, y: f32| [middle + sign * 5.39 * x, 67.0 + 957.0 * (0.5 - y / 190.0)];
        let [cx, cy] = at(32.0, 69.0);
        canvas.rounded_rect(cx - 146.0, cy - 50.0, cx + 146.0, cy + 50.0, 18.0, DARK);
        canvas.text_fitted([cx, cy], [270.0, 84.0], "DRILL", WHITE);
        let [vx, vy] = at(72.0, 68.0);
        for slot in 0..4 {
            let y = vy - 42.0 + 24.0 * slot as f32;
            canvas.rounded_rect(vx - 40.0, y, vx + 40.0, y + 12.0, 5.0, BLACK);
        }
        let [bx, by] = at(14.0, -78.0);
        canvas.rounded_rect(bx - 200.0, by - 48.0, bx + 200.0, by + 48.0, 12.0, [232, 120, 36]);
        canvas.text_fitted([bx - 60.0, by], [250.0, 84.0], "18 V", BLACK);
        canvas.text_fitted([bx + 126.0, by], [120.0, 50.0], "Li-Ion", BLACK);
    }
    canvas.rect(0.0, 0.0, 2048.0, 1024.0 * MARGIN, [255; 3]);
    canvas
}

/// A finger loop about `center`, as rays: degrees, radius of the hole, radius outside, millimetres.
fn finger_loop(center: [f64; 2], rays: &[[f64; 3]], half: f64, z: f64) -> Vec<Ring> {
    let mut rays = spline(rays, 3);
    // The last ray is the first again.
    rays.pop();
    let rows: Vec<[f64; 6]> = rays
        .iter()
        .map(|&[degrees, inner, outer]| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let [x, y] = center;
            [x + inner * cos, y + inner * sin, x + outer * cos, y + outer * sin, half, z]
        })
        .collect();
    ribbon(&rows, 2.6, 16)
}

fn scissors() -> BuiltIn {
    const LEFT: [[f64; 3]; 9] = [
        [0.0, 13.5, 22.6],
        [45.0, 16.6, 26.0],
        [90.0, 16.6, 28.0],
        [135.0, 14.0, 23.6],
        [180.0, 13.6, 21.5],
        [225.0, 16.2, 25.0],
        [270.0, 15.6, 27.0],
        [315.0, 14.4, 25.0],
        [360.0, 13.5, 22.6],
    ];
    const RIGHT: [[f64; 3]; 14] = [
        [0.0, 13.4, 18.5],
        [45.0, 19.0, 25.6],
        [72.0, 28.0, 35.0],
        [90.0, 31.0, 40.0],
        [100.0, 25.0, 38.0],
        [114.0, 16.5, 34.0],
        [135.0, 10.0, 30.0],
        [165.0, 8.6, 24.6],
        [200.0, 11.5, 25.0],
        [235.0, 24.0, 31.0],
        [262.0, 26.6, 34.0],
        [290.0, 20.0, 27.0],
        [318.0, 15.2, 21.0],
        [360.0, 13.4, 18.5],
    ];
    // Travelling upwards, the edge at smaller x is on the left.
    let left_web = [
        [-34.0, -30.0, -10.0, -46.0, 5.6, -0.8],
        [-22.0, -22.5, -3.4, -37.0, 5.6, -0.8],
        [-8.0, -14.0, 2.0, -31.0, 5.4, -0.8],
        [2.0, -6.0, 10.0, -21.0, 5.0, -1.0],
        [8.0, 2.0, 19.0, -9.0, 4.6, -1.2],
        [11.0, 10.0, 27.0, 1.0, 4.2, -1.6],
        [14.0, 15.0, 28.0, 11.0, 4.0, -1.8],
        [18.0, 17.4, 24.0, 16.4, 3.4, -1.8],
    ];
    let right_web = [
        [-2.0, -46.0, 32.0, -37.0, 5.6, 1.0],
        [0.6, -36.0, 29.0, -32.0, 5.6, 1.0],
        [4.0, -24.0, 25.6, -20.0, 5.4, 1.0],
        [7.0, -10.0, 25.4, -8.0, 5.0, 1.0],
        [9.6, 2.0, 27.2, 3.0, 4.8, 1.2],
        [12.4, 11.0, 28.8, 9.0, 4.6, 1.6],
        [15.4, 16.0, 27.0, 14.6, 4.4, 1.8],
        [18.6, 17.8, 24.0, 17.2, 3.6, 1.8],
    ];
    let upper_blade = [
        [15.4, 12.0, 25.0, 10.0, 1.25, 1.6],
        [22.0, 40.0, 31.5, 38.0, 1.25, 1.5],
        [30.0, 68.0, 37.6, 66.0, 1.25, 1.4],
        [36.4, 89.0, 42.6, 88.0, 1.2, 1.3],
        [39.4, 96.0, 44.8, 96.0, 1.1, 1.3],
        [43.4, 100.6, 46.0, 100.9, 0.9, 1.3],
    ];
    let lower_blade = [
        [18.4, 12.0, 29.0, 12.0, 1.2, -0.9],
        [25.0, 40.0, 34.6, 38.0, 1.2, -0.8],
        [32.4, 68.0, 40.8, 66.0, 1.2, -0.7],
        [39.0, 89.0, 46.0, 87.0, 1.15, -0.7],
        [42.6, 96.5, 48.0, 96.5, 1.05, -0.7],
        [44.4, 99.8, 47.0, 100.2, 0.85, -0.7],
    ];
    let loops = [finger_loop([-26.5, -54.0], &LEFT, 6.9, -0.8), finger_loop([20.0, -67.0], &RIGHT, 7.1, 0.9)];
    let webs = [ribbon(&spline(&left_web, 2), 3.0, 24), ribbon(&spline(&right_web, 2), 3.0, 24)];
    let blades = [ribbon(&spline(&upper_blade, 3), 3.0, 16), ribbon(&spline(&lower_blade, 3), 3.0, 16)];
    let screw: Vec<Ring> =
        lofts::revolved(&[[4.6, -6.4], [5.4, -6.0], [5.4, 6.6], [4.6, 7.0], [3.0, 7.0], [2.6, 6.4]], 24);
    let pivot = Isometry3::translation(20.0 * MM, 7.6 * MM, 0.0);

    let mut parts: Vec<Part> = loops.iter().map(|rings| Part::closed_loop(rings, handle)).collect();
    parts.extend(webs.iter().map(|rings| Part::loft(rings, handle)));
    parts.extend(blades.iter().map(|rings| Part::loft(rings, brushed)));
    parts.push(Part::loft(&screw, |_| plain(METAL)).moved(&pivot));

    let mut collision = Vec::new();
    for rings in &loops {
        // Arcs of four rings or so keep the hole open.
        let count = rings.len();
        let breaks: Vec<usize> = (0..=7).map(|k| k * count / 7).collect();
        for pair in breaks.windows(2) {
            let ends = [pair[0], (pair[0] + pair[1]) / 2, pair[1] % count];
            collision.push(hull(ends.iter().flat_map(|&row| lofts::thinned(&rings[row], 8)).collect()));
        }
    }
    for rings in &webs {
        collision.extend(hulls(rings, &[0, 5, 10, 14], 10));
    }
    for rings in &blades {
        collision.extend(hulls(rings, &[0, 9, 15], 10));
    }
    BuiltIn { visual: lofts::visual(&parts, 0.45, brushed_steel()), collision }
}

fn handle(_: Spot) -> Look {
    plain([230, 98, 28])
}

/// Steel, brushed across the blade; laid on from above.
fn brushed(spot: Spot) -> Look {
    let along = (spot.point.y / 0.2) as f32;
    let across = (spot.point.x / 0.1) as f32;
    Look { color: METAL, uv: [0.5 + across, MARGIN + 0.02 + (0.96 - MARGIN) * (0.5 - along)] }
}

fn brushed_steel() -> Canvas {
    let mut canvas = Canvas::new(256, 1024, [255; 3]);
    canvas.grain([90.0, 1.5], [190, 192, 196], 0.5, 37);
    canvas.rect(0.0, 0.0, 256.0, 1024.0 * MARGIN, [255; 3]);
    canvas
}

fn marker() -> BuiltIn {
    // Along the pen from its foot at -y to the plug at +y: place, radius.
    let profile = [
        [8.6, -60.4],
        [9.2, -59.8],
        [9.3, -52.0],
        [9.15, -50.0],
        [8.9, 0.0],
        [8.4, 24.0],
        [7.9, 30.0],
        [7.8, 32.0],
        [8.4, 40.0],
        [9.2, 53.2],
        [8.4, 54.2],
        [5.0, 54.6],
        [4.7, 56.0],
        [4.7, 60.0],
        [4.2, 60.6],
    ];
    let rings = lofts::revolved(&profile, 40);
    let pen = Part::loft(&rings, |spot| match spot.band {
        None => plain(DARK),
        Some(0..=2) => plain(DARK),
        Some(band) if band >= 5 => plain(DARK),
        Some(_) => {
            let along = (spot.point.z / MM + 52.0) / 80.0;
            Look {
                color: [255; 3],
                uv: [spot.around as f32, MARGIN + 0.005 + (0.99 - MARGIN) * (1.0 - along as f32)],
            }
        }
    });
    // The scan lies along y and is turned by one degree.
    let lie = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.018)
        * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -FRAC_PI_2);
    let lie = Isometry3::from_parts(Translation3::identity(), lie);
    let mut collision = hulls(&rings, &[0, 4, 7, 9, 13], 14);
    for piece in &mut collision {
        piece.pose = lie;
    }
    BuiltIn { visual: lofts::visual(&[pen.moved(&lie)], 0.35, marker_label()), collision }
}

fn marker_label() -> Canvas {
    const BLUE: Color = [24, 60, 140];
    let mut canvas = Canvas::new(512, 768, WHITE);
    canvas.rect(0.0, 700.0, 512.0, 768.0, BLUE);
    for x in [128.0, 384.0] {
        canvas.text_turned(x, 390.0, 96.0, "MARKER", BLACK, Weight::Bold, Turn::Clockwise);
        canvas.text_turned(x - 76.0, 390.0, 48.0, "DRY ERASE", BLUE, Weight::Bold, Turn::Clockwise);
        canvas.text_turned(
            x + 70.0,
            390.0,
            34.0,
            "low odor - black",
            BLACK,
            Weight::Regular,
            Turn::Clockwise,
        );
    }
    canvas.rect(0.0, 0.0, 512.0, 768.0 * MARGIN, [255; 3]);
    canvas
}
