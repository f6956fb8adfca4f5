//! A banana: a rounded pentagon swept along a bent centreline that lies in the x-y plane, tapering to brown ends.

use std::f64::consts::TAU;

use nalgebra::{Point3, Vector3};

use super::BuiltIn;
use super::canvas::{Canvas, Color, mix};
use super::lofts::{self, Look, MARGIN, MM, Part, hulls, spline, swept};

const AROUND: usize = 40;

pub(super) fn build(name: &str) -> Option<BuiltIn> {
    (name == "011_banana").then(banana)
}

/// The centreline in millimetres from the blossom end to the stalk: x, y, z, half width in the plane, half thickness.
const STATIONS: [[f64; 5]; 17] = [
    [-31.0, -89.2, -5.6, 3.6, 3.8],
    [-31.1, -87.6, -5.3, 6.2, 6.2],
    [-31.6, -82.0, -4.4, 9.6, 9.4],
    [-32.6, -72.0, -3.5, 13.2, 12.4],
    [-33.8, -60.0, -2.6, 16.0, 14.8],
    [-35.2, -44.0, -1.8, 17.6, 16.4],
    [-35.6, -28.0, -0.9, 18.4, 17.3],
    [-35.0, -10.0, -0.2, 19.2, 17.8],
    [-32.2, 8.0, 0.1, 19.2, 18.0],
    [-27.0, 26.0, 0.2, 18.6, 18.2],
    [-18.6, 44.0, 0.2, 17.6, 18.2],
    [-8.0, 60.0, -0.4, 16.2, 17.6],
    [5.0, 73.0, -2.2, 12.9, 15.6],
    [19.0, 80.6, -5.6, 9.0, 12.0],
    [31.0, 83.4, -9.4, 6.2, 7.6],
    [43.0, 84.0, -12.0, 4.8, 5.3],
    [54.4, 84.4, -12.6, 5.1, 5.6],
];

/// A pentagon with round corners and round sides of unit size, one ridge outwards and up.
fn pentagon() -> Vec<[f64; 2]> {
    (0..AROUND)
        .map(|j| {
            let angle = TAU * j as f64 / AROUND as f64;
            let radius = 0.97 + 0.035 * (5.0 * (angle - 0.35)).cos();
            [radius * angle.cos(), radius * angle.sin()]
        })
        .collect()
}

fn banana() -> BuiltIn {
    const YELLOW: Color = [232, 194, 44];
    const GREEN: Color = [188, 180, 60];
    const BROWN: Color = [74, 52, 32];
    let stations = spline(&STATIONS, 4);
    let path: Vec<Point3<f64>> = stations.iter().map(|&[x, y, z, ..]| Point3::new(x, y, z) * MM).collect();
    let outline = pentagon();
    let rings = swept(&path, Vector3::z(), false, |i| {
        let [.., width, thickness] = stations[i];
        outline.iter().map(|&[u, v]| [u * width * MM, v * thickness * MM]).collect()
    });
    let last = rings.len() - 2;
    let peel = Part::loft(&rings, |spot| {
        let Some(band) = spot.band else {
            return lofts::plain(BROWN);
        };
        // Brown within the first centimetre and at the cut of the stalk, greenish towards the stalk.
        let color = if band < 4 {
            mix(BROWN, YELLOW, band as f32 / 6.0)
        } else if band + 2 > last {
            BROWN
        } else {
            mix(YELLOW, GREEN, (band as f32 - 44.0) / 16.0)
        };
        let along = (spot.point.y / (180.0 * MM) + 0.5).clamp(0.0, 1.0) as f32;
        Look { color, uv: [spot.around as f32, MARGIN + 0.02 + (0.96 - MARGIN) * along] }
    });
    let collision = hulls(&rings, &[0, 6, 14, 22, 30, 38, 46, 54, 60, 64], 14);
    BuiltIn { visual: lofts::visual(&[peel], 0.55, freckles()), collision }
}

/// White with small brown freckles and darker lines along the five ridges.
fn freckles() -> Canvas {
    let mut canvas = Canvas::new(512, 1024, [255; 3]);
    for ridge in 0..5 {
        let x = 512.0 * (0.35 / TAU as f32 + ridge as f32 / 5.0);
        canvas.rect(x - 3.0, 0.0, x + 3.0, 1024.0, [226, 206, 170]);
    }
    canvas.grain([9.0, 26.0], [168, 130, 80], 0.28, 11);
    for spot in 0..70 {
        let at = |k: u32| super::canvas::hash(spot, 0, k);
        let size = 1.5 + 4.0 * at(3) * at(3);
        canvas.ellipse(512.0 * at(1), 90.0 + 900.0 * at(2), size, 1.8 * size, [150, 108, 66]);
    }
    canvas.rect(0.0, 0.0, 512.0, 1024.0 * MARGIN, [255; 3]);
    canvas
}
