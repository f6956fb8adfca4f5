//! Squeezed bottles: oval sections lofted along a profile, and a cap of its own.
//!
//! Profiles are in millimetres, read off a scan's bounding sections; labels carry generic words.

use std::f64::consts::PI;

use nalgebra::{Isometry3, Vector3};

use super::BuiltIn;
use super::canvas::{Canvas, Color, WHITE, Weight};
use super::lofts::{self, Look, MARGIN, MM, Part, Ring, Spot, hulls, level, plain, spline, superellipse};

const AROUND: usize = 48;

pub(super) fn build(name: &str) -> Option<BuiltIn> {
    match name {
        "006_mustard_bottle" => Some(mustard()),
        "021_bleach_cleanser" => Some(bleach()),
        _ => None,
    }
}

/// Prints a canvas on a bottle from both broad sides: its left half on the side of +y, its right half on that of -y,
/// `width` metres to a half and from `top` down over `height` metres. The spot is in the bottle's own axes.
fn printed(spot: Spot, center: f64, width: f64, top: f64, height: f64) -> Look {
    let across = (spot.point.x - center) / (2.0 * width);
    let u = if spot.facet < 0.5 { 0.25 - across } else { 0.75 + across };
    let v = f64::from(MARGIN) + (1.0 - f64::from(MARGIN)) * ((top - spot.point.z) / height).clamp(0.0, 1.0);
    Look { color: [255; 3], uv: [u as f32, v as f32] }
}

/// The plane of the broad sides is turned about z by this, as the scan lies, radians.
const MUSTARD_YAW: f64 = -24.0 / 180.0 * PI;

fn mustard() -> BuiltIn {
    const YELLOW: Color = [238, 190, 22];
    const CAP: Color = [240, 196, 36];
    // Height, half width, half depth in the middle, half depth at the sides, power of the outline.
    let rows = [
        [-95.6, 38.0, 22.0, 12.0, 4.0],
        [-93.5, 43.5, 26.5, 15.0, 5.0],
        [-90.0, 47.6, 28.4, 14.4, 6.0],
        [-84.0, 48.9, 29.0, 14.9, 6.0],
        [-70.0, 48.5, 28.8, 15.0, 6.0],
        [-50.0, 44.8, 27.6, 16.4, 6.0],
        [-30.0, 40.4, 26.8, 17.0, 6.0],
        [-10.0, 42.2, 26.8, 16.8, 6.0],
        [10.0, 47.9, 26.8, 15.0, 6.0],
        [20.0, 47.8, 26.8, 14.6, 5.5],
        [30.0, 45.5, 26.8, 14.8, 5.0],
        [40.0, 40.5, 26.8, 16.0, 4.0],
        [46.0, 35.6, 28.0, 17.5, 3.4],
        [51.0, 30.4, 27.4, 20.0, 2.8],
        [56.0, 25.4, 24.8, 20.0, 2.3],
        [61.0, 20.6, 20.6, 20.6, 2.0],
        [63.5, 19.2, 19.2, 19.2, 2.0],
    ];
    let oval = |&[z, a, middle, side, power]: &[f64; 5]| -> Ring {
        // A barrel-sided rectangle: the depth falls off with the square of the distance from the middle.
        let unit = superellipse(1.0, 0.6, power, 16 * AROUND);
        let outline: Vec<[f64; 2]> = unit
            .iter()
            .map(|&[u, v]| [a * MM * u, v / 0.6 * MM * (middle - (middle - side) * u * u)])
            .collect();
        level(&lofts::resampled(&outline, AROUND), 0.0, 0.0, z * MM)
    };
    let rings: Vec<Ring> = spline(&rows, 2).iter().map(oval).collect();
    let body = Part::loft(&rings, |spot| match spot.band {
        None => plain(YELLOW),
        Some(_) => printed(spot, 0.0, 0.104, 0.064, 0.160),
    });
    let cap = [
        [18.2, 63.0],
        [19.6, 63.4],
        [20.4, 65.0],
        [20.4, 74.0],
        [19.4, 75.6],
        [13.2, 76.4],
        [12.4, 77.2],
        [9.9, 91.5],
        [9.6, 94.4],
        [8.2, 95.7],
    ];
    let cap: Vec<Ring> = lofts::revolved(&cap, 40);
    let center = Vector3::new(0.0006, 0.0009, 0.0);
    let shifted: Vec<Ring> =
        cap.iter().map(|ring| ring.iter().map(|point| point + center).collect()).collect();
    let top = Part::loft(&shifted, |_| plain(CAP));

    let turn = Isometry3::rotation(Vector3::z() * MUSTARD_YAW);
    let mut collision = hulls(&rings, &[0, 4, 8, 12, 16, 20, 26, 32], 16);
    collision.extend(hulls(&shifted, &[1, 4, 5, 9], 12));
    for piece in &mut collision {
        piece.pose = turn;
    }
    BuiltIn {
        visual: lofts::visual(&[body.moved(&turn), top.moved(&turn)], 0.35, mustard_label(YELLOW)),
        collision,
    }
}

fn mustard_label(yellow: Color) -> Canvas {
    const RED: Color = [196, 30, 36];
    const BLUE: Color = [22, 40, 110];
    let mut canvas = Canvas::new(1024, 1024, yellow);
    canvas.rect(0.0, 0.0, 1024.0, 1024.0 * MARGIN, [255; 3]);
    for (middle, front) in [(256.0, false), (768.0, true)] {
        canvas.ellipse(middle, 420.0, 196.0, 250.0, WHITE);
        canvas.ellipse(middle, 420.0, 182.0, 236.0, [250, 214, 60]);
        canvas.polygon(
            &[
                [middle - 180.0, 330.0],
                [middle + 150.0, 300.0],
                [middle + 200.0, 372.0],
                [middle + 150.0, 440.0],
                [middle - 180.0, 458.0],
            ],
            RED,
        );
        canvas.text_fitted([middle - 6.0, 382.0], [306.0, 104.0], "MUSTARD", WHITE);
        canvas.text_fitted([middle, 250.0], [190.0, 50.0], "CLASSIC", BLUE);
        canvas.text_fitted([middle, 510.0], [240.0, 56.0], "100% NATURAL", BLUE);
        if front {
            canvas.text_fitted([middle, 590.0], [200.0, 60.0], "YELLOW", RED);
            canvas.circle(middle, 760.0, 62.0, BLUE);
            canvas.text_fitted([middle, 760.0], [96.0, 50.0], "NEW", WHITE);
            canvas.text_centered(middle, 880.0, 34.0, "NET WT 14 OZ (396 g)", BLUE, Weight::Bold);
        } else {
            canvas.rect(middle - 130.0, 690.0, middle + 130.0, 900.0, WHITE);
            canvas.small_print([middle - 120.0, 700.0, middle + 120.0, 800.0], 10.0, BLUE, 6);
            canvas.barcode(middle - 80.0, 810.0, 160.0, 80.0, 6);
        }
    }
    canvas
}

fn bleach() -> BuiltIn {
    const BODY: Color = [238, 238, 234];
    const CAP: Color = [24, 74, 160];
    // Height, smallest and largest x, half depth, power of the outline. The waist from 45 to 85 is the grip.
    let rows = [
        [-125.4, -46.5, 42.5, 28.8, 3.4],
        [-122.5, -50.4, 46.0, 32.4, 4.0],
        [-115.0, -51.3, 47.2, 33.8, 4.0],
        [-108.5, -48.6, 47.6, 33.5, 4.0],
        [-104.0, -46.6, 47.9, 32.8, 4.0],
        [-90.0, -46.2, 48.8, 32.2, 4.0],
        [-60.0, -44.9, 50.1, 30.4, 4.0],
        [-30.0, -42.6, 50.8, 28.7, 4.0],
        [0.0, -38.9, 51.1, 26.9, 4.0],
        [20.0, -35.5, 50.6, 25.7, 4.0],
        [36.0, -31.6, 49.7, 24.8, 4.0],
        [46.0, -27.0, 48.8, 24.9, 4.0],
        [54.0, -23.6, 47.8, 27.0, 3.6],
        [60.0, -21.8, 48.6, 27.2, 3.4],
        [66.0, -20.9, 49.9, 26.8, 3.4],
        [75.0, -21.8, 47.7, 26.0, 3.4],
        [85.0, -26.3, 44.1, 25.2, 3.2],
        [90.0, -24.0, 42.1, 24.7, 3.0],
        [95.0, -17.0, 39.4, 23.2, 2.8],
        [100.0, -10.6, 30.0, 18.2, 2.4],
        [104.0, -6.2, 24.0, 15.0, 2.0],
        [106.5, -4.8, 22.8, 13.8, 2.0],
    ];
    let rings: Vec<Ring> = spline(&rows, 2)
        .iter()
        .map(|&[z, low, high, depth, power]| {
            let section = superellipse(0.5 * (high - low) * MM, depth * MM, power, AROUND);
            level(&section, 0.5 * (low + high) * MM, 0.0, z * MM)
        })
        .collect();
    let body = Part::loft(&rings, |spot| match spot.band {
        None => plain(BODY),
        Some(_) => printed(spot, 0.004, 0.104, 0.096, 0.222),
    });
    let cap = [
        [14.2, 105.8],
        [15.2, 106.6],
        [15.4, 116.4],
        [14.6, 117.6],
        [12.2, 118.2],
        [11.4, 121.0],
        [13.6, 122.4],
        [14.0, 124.4],
        [13.2, 125.1],
    ];
    let shift = Vector3::new(8.9 * MM, -0.3 * MM, 0.0);
    let cap: Vec<Ring> = lofts::revolved(&cap, 40)
        .iter()
        .map(|ring| ring.iter().map(|point| point + shift).collect())
        .collect();
    let top = Part::loft(&cap, |_| plain(CAP));
    let mut collision = hulls(&rings, &[0, 4, 8, 14, 18, 22, 28, 32, 36, 42], 16);
    collision.extend(hulls(&cap, &[1, 3, 8], 12));
    BuiltIn { visual: lofts::visual(&[body, top], 0.35, bleach_label(BODY)), collision }
}

fn bleach_label(body: Color) -> Canvas {
    const BLUE: Color = [26, 70, 158];
    const DEEP: Color = [16, 38, 104];
    const RED: Color = [204, 32, 42];
    let mut canvas = Canvas::new(1024, 1100, body);
    canvas.rect(0.0, 0.0, 1024.0, 1100.0 * MARGIN, [255; 3]);
    for (middle, front) in [(256.0_f32, false), (768.0, true)] {
        let (left, right) = (middle - 172.0, middle + 196.0);
        canvas.rounded_rect(left, 420.0, right, 1000.0, 36.0, BLUE);
        canvas.gradient(left + 8.0, 640.0, right - 8.0, 940.0, BLUE, DEEP);
        canvas.polygon(&[[left, 480.0], [right, 440.0], [right, 600.0], [left, 640.0]], RED);
        canvas.text_fitted([middle + 12.0, 540.0], [330.0, 120.0], "BLEACH", WHITE);
        canvas.text_fitted([middle + 12.0, 700.0], [320.0, 92.0], "CLEANSER", WHITE);
        if front {
            canvas.circle(middle + 12.0, 836.0, 74.0, [240, 200, 40]);
            canvas.text_fitted([middle + 12.0, 820.0], [110.0, 50.0], "LEMON", DEEP);
            canvas.text_fitted([middle + 12.0, 858.0], [110.0, 40.0], "SCENT", DEEP);
            canvas.text_centered(middle + 12.0, 960.0, 34.0, "36 OZ (1.02 kg)", WHITE, Weight::Bold);
        } else {
            canvas.rect(middle - 150.0, 780.0, middle + 174.0, 980.0, WHITE);
            canvas.small_print([middle - 138.0, 790.0, middle + 40.0, 970.0], 10.0, DEEP, 21);
            canvas.barcode(middle + 54.0, 800.0, 110.0, 150.0, 21);
        }
    }
    canvas
}
