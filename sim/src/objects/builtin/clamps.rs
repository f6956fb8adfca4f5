//! Spring clamps: two arms, each a ribbon from the jaw's tip past the pivot to the handle, and the pivot's bolt.
//!
//! Each arm is drawn by its two edges in the plane of the clamp. The three closed parts run into each other at the
//! pivot. The hollow backs of the real handles are filled.

use nalgebra::{Isometry3, Vector3};

use super::BuiltIn;
use super::canvas::{Canvas, Color};
use super::lofts::{self, Look, MARGIN, MM, Part, Ring, hull, hulls, plain, ribbon, spline};

const BLACK: Color = [34, 34, 36];
const ORANGE: Color = [232, 104, 24];
const STEEL: Color = [120, 122, 126];

pub(super) fn build(name: &str) -> Option<BuiltIn> {
    match name {
        "051_large_clamp" => Some(clamp([&LARGE_LEFT, &LARGE_RIGHT], [10.0, -5.0], [-19.5, 17.2])),
        "052_extra_large_clamp" => Some(clamp([&EXTRA_UPPER, &EXTRA_LOWER], [-4.0, -8.6], [-18.1, 18.1])),
        _ => None,
    }
}

/// From the tip to the end of the handle; the outer edge is on the left. See [`ribbon`] for the columns.
const LARGE_LEFT: [[f64; 6]; 17] = [
    [12.0, -81.5, 21.0, -85.2, 11.0, -6.0],
    [8.0, -78.0, 20.8, -76.0, 12.6, -6.0],
    [2.0, -72.5, 18.4, -67.0, 12.6, -6.0],
    [-6.0, -65.0, 13.0, -59.0, 12.0, -6.0],
    [-15.0, -55.0, 6.0, -49.0, 12.0, -5.5],
    [-22.0, -42.0, 1.5, -38.0, 12.0, -4.5],
    [-25.5, -28.0, 0.8, -28.0, 12.0, -3.2],
    [-25.0, -16.0, 4.0, -20.0, 12.0, -2.0],
    [-22.5, -6.0, 14.0, -14.0, 12.0, -1.0],
    [-21.5, 1.0, 17.0, 0.0, 12.0, 0.0],
    [-24.0, 9.0, 0.0, 5.0, 12.0, 1.0],
    [-31.0, 19.0, -9.0, 15.0, 12.0, 2.4],
    [-43.0, 34.0, -24.0, 32.0, 12.0, 5.0],
    [-56.0, 47.5, -40.0, 51.0, 12.0, 7.0],
    [-59.8, 56.0, -47.5, 60.0, 11.8, 7.6],
    [-59.0, 63.0, -51.5, 66.5, 9.5, 7.6],
    [-56.0, 67.5, -53.0, 69.3, 6.0, 7.6],
];

/// From the tip to the end of the handle; the outer edge is on the right.
const LARGE_RIGHT: [[f64; 6]; 17] = [
    [21.0, -85.6, 29.0, -84.0, 11.0, -6.0],
    [21.4, -77.0, 31.0, -80.0, 12.6, -6.0],
    [22.5, -66.0, 36.0, -70.0, 12.6, -6.0],
    [24.0, -58.0, 41.0, -59.0, 12.0, -6.0],
    [27.0, -48.0, 47.0, -47.0, 12.0, -5.0],
    [29.0, -38.0, 52.0, -35.0, 12.0, -4.5],
    [28.5, -27.0, 53.5, -24.0, 12.0, -3.5],
    [24.0, -19.0, 51.0, -13.0, 12.0, -2.5],
    [14.0, -15.0, 46.0, -3.0, 12.0, -2.0],
    [4.0, -4.0, 41.0, 6.0, 12.0, -1.5],
    [14.0, 5.0, 40.0, 13.0, 12.0, -1.3],
    [20.0, 15.0, 42.0, 21.0, 12.0, -1.2],
    [29.0, 37.0, 50.0, 43.0, 12.0, -1.2],
    [39.0, 62.0, 58.0, 63.0, 12.0, -1.2],
    [43.5, 73.0, 60.0, 71.0, 11.8, -1.2],
    [47.0, 81.0, 57.5, 79.0, 9.5, -1.2],
    [49.5, 85.3, 52.5, 84.0, 6.0, -1.2],
];

/// From the tip to the end of the handle; the outer edge is on the left.
const EXTRA_UPPER: [[f64; 6]; 18] = [
    [-104.8, -18.0, -103.5, -20.4, 12.5, -0.5],
    [-100.0, -12.0, -96.0, -20.2, 13.8, -0.5],
    [-92.0, -5.0, -86.0, -19.0, 13.8, -0.5],
    [-84.0, 2.0, -79.0, -15.0, 13.0, -0.3],
    [-70.0, 13.5, -64.0, -8.0, 12.6, 0.0],
    [-55.0, 25.0, -52.0, 2.0, 12.6, 0.0],
    [-45.0, 31.0, -42.0, 5.5, 12.6, 0.0],
    [-34.0, 34.0, -30.0, 5.0, 12.6, 0.0],
    [-22.0, 33.0, -22.0, 0.0, 12.6, 0.0],
    [-12.0, 29.5, -14.0, -10.0, 12.6, 0.0],
    [-3.0, 27.0, -4.0, -18.0, 12.6, 0.0],
    [4.0, 28.5, 6.0, -3.0, 12.6, 0.0],
    [10.0, 32.0, 15.0, 6.0, 12.6, 0.0],
    [30.0, 48.0, 40.0, 27.0, 12.4, 0.0],
    [55.0, 69.0, 65.0, 50.0, 12.2, 0.0],
    [67.0, 79.5, 76.0, 62.0, 11.8, 0.0],
    [75.0, 82.1, 82.5, 71.0, 9.5, 0.0],
    [83.0, 80.5, 86.5, 77.0, 6.0, 0.0],
];

/// From the tip to the end of the handle; the outer edge is on the right.
const EXTRA_LOWER: [[f64; 6]; 18] = [
    [-103.5, -20.6, -104.0, -23.5, 12.5, -0.5],
    [-96.0, -20.9, -99.0, -29.5, 13.8, -0.5],
    [-86.0, -22.0, -90.0, -34.5, 13.8, -0.5],
    [-79.0, -23.0, -80.0, -40.0, 13.0, -0.3],
    [-62.0, -28.5, -62.0, -50.0, 12.6, 0.0],
    [-50.0, -32.5, -48.0, -57.0, 12.6, 0.0],
    [-40.0, -34.5, -35.0, -61.3, 12.6, 0.0],
    [-30.0, -33.0, -25.0, -60.5, 12.6, 0.0],
    [-22.0, -29.0, -14.0, -56.0, 12.6, 0.0],
    [-16.0, -18.0, -4.0, -50.0, 12.6, 0.0],
    [-6.0, -1.0, 4.0, -46.5, 12.6, 0.0],
    [5.0, -14.0, 12.0, -46.0, 12.6, 0.0],
    [18.0, -21.5, 19.0, -48.5, 12.6, 0.0],
    [44.0, -36.0, 34.0, -57.0, 12.4, 0.0],
    [73.0, -53.5, 62.0, -71.0, 12.2, 0.0],
    [88.0, -63.0, 77.5, -78.8, 11.8, 0.0],
    [97.5, -69.0, 89.0, -82.1, 9.5, 0.0],
    [104.9, -74.0, 100.0, -78.5, 6.0, 0.0],
];

/// A clamp of two arms and a bolt about `pivot` from and to the heights `reach`, millimetres.
fn clamp(arms: [&[[f64; 6]]; 2], pivot: [f64; 2], reach: [f64; 2]) -> BuiltIn {
    const STEPS: usize = 3;
    let mut parts = Vec::new();
    let mut collision = Vec::new();
    for rows in arms {
        let rings = ribbon(&spline(rows, STEPS), 5.0, 28);
        let tip = lofts::centroid(&rings[0]);
        parts.push(Part::loft(&rings, |spot| match spot.band {
            // The first two rows carry the pad; of the two ends, the one there is the pad's.
            Some(band) if band >= 2 * STEPS => ribbed(spot),
            None if (spot.point - tip).norm() > 20.0 * MM => plain(BLACK),
            _ => plain(ORANGE),
        }));
        let last = rows.len() - 1;
        // Two rows to a piece round the bend of the jaw, more along the straight handle.
        let breaks = [0, 2, 4, 6, 7, 9, 11, 14, last - 1, last].map(|row| row * STEPS);
        collision.extend(hulls(&rings, &breaks, 12));
    }
    let [low, high] = reach;
    let bolt = [
        [8.4, low],
        [9.4, low + 0.8],
        [10.8, low + 5.0],
        [10.8, high - 5.0],
        [9.4, high - 0.8],
        [8.4, high],
        [5.6, high],
        [5.2, high - 1.2],
    ];
    let bolt: Vec<Ring> = lofts::revolved(&bolt, 28);
    let place = Isometry3::translation(pivot[0] * MM, pivot[1] * MM, 0.0);
    let head = Part::loft(&bolt, |spot| match spot.band {
        Some(0..=4) => plain(BLACK),
        _ => plain(STEEL),
    });
    parts.push(head.moved(&place));
    let mut disc = hull(lofts::revolved(&[[9.4, low], [9.4, high]], 14).concat());
    disc.pose = place;
    collision.push(disc);
    BuiltIn { visual: lofts::visual(&parts, 0.6, plastic()), collision }
}

/// Black plastic, laid on from above over 0.22 m.
fn ribbed(spot: lofts::Spot) -> Look {
    let at = spot.point.coords.component_div(&Vector3::new(0.22, 0.22, 1.0)).map(|value| value as f32);
    Look { color: BLACK, uv: [0.5 + at.x, MARGIN + 0.02 + (0.96 - MARGIN) * (0.5 - at.y)] }
}

/// White with the faint grain of moulded plastic.
fn plastic() -> Canvas {
    let mut canvas = Canvas::new(512, 512, [255; 3]);
    canvas.grain([14.0, 14.0], [150, 150, 156], 0.5, 51);
    canvas.noise(6.0, 52);
    canvas.rect(0.0, 0.0, 512.0, 512.0 * MARGIN, [255; 3]);
    canvas
}
