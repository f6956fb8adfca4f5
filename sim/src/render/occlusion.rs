//! Ambient light that near surfaces keep away, estimated from the depth image (after Alchemy AO, McGuire 2011). This is
//! what makes things stand on the table and not float. `prepare.wgsl` holds the same formulas line by line.

use std::f32::consts::TAU;

use nalgebra::{Point3, Vector3};

use crate::camera::Intrinsics;

/// Surfaces farther than this do not count, metres: a contact shadow is a few centimetres wide.
pub(super) const RADIUS: f32 = 0.09;
/// Depths looked at around each pixel.
const TAPS: u32 = 8;
/// The taps stay within this distance, pixels.
const LARGEST_RADIUS_PX: f32 = 72.0;
/// What rises less than this above a surface, as a share of its distance from the camera, is the surface itself.
const RISE: f32 = 0.0015;
/// Scale of the estimate: makes the foot of a wall half dark, as it is.
const STRENGTH: f32 = 2.0;
/// The golden angle: a spiral of steps by it covers a disk evenly (Vogel 1979).
const GOLDEN_ANGLE: f32 = 2.399_963_2;

/// The angle by which pixel (u, v) turns its pattern, so that too few taps show as fine grain and not as bands
/// (interleaved gradient noise, Jimenez 2014).
pub(super) fn rotation(u: usize, v: usize) -> f32 {
    TAU * (52.982_918 * (0.067_110_56 * u as f32 + 0.005_837_15 * v as f32).fract()).fract()
}

/// Point `index` of `count` on a unit disk, turned by `angle`.
pub(super) fn on_disk(index: u32, count: u32, angle: f32) -> [f32; 2] {
    let radius = ((index as f32 + 0.5) / count as f32).sqrt();
    let (sin, cos) = (angle + index as f32 * GOLDEN_ANGLE).sin_cos();
    [radius * cos, radius * sin]
}

/// The share, 0 to 1, of ambient light that reaches `point`, seen in pixel `at`, on a surface with `normal`; camera frame.
/// `depth(u, v)` is the depth image, 0 where nothing is hit.
pub(super) fn open_share(
    depth: impl Fn(usize, usize) -> f32,
    intrinsics: &Intrinsics,
    at: [usize; 2],
    point: &Point3<f32>,
    normal: &Vector3<f32>,
) -> f32 {
    let reach = (intrinsics.fx as f32 * RADIUS / point.z).min(LARGEST_RADIUS_PX);
    let angle = rotation(at[0], at[1]);
    let mut kept = 0.0;
    for i in 0..TAPS {
        let [x, y] = on_disk(i, TAPS, angle);
        let u = (at[0] as f32 + reach * x + 0.5).floor().clamp(0.0, (intrinsics.width - 1) as f32);
        let v = (at[1] as f32 + reach * y + 0.5).floor().clamp(0.0, (intrinsics.height - 1) as f32);
        let z = depth(u as usize, v as usize);
        let other = Vector3::new(
            (u - intrinsics.cx as f32) / intrinsics.fx as f32 * z,
            (v - intrinsics.cy as f32) / intrinsics.fy as f32 * z,
            z,
        );
        let offset = other - point.coords;
        let squared = offset.norm_squared();
        let rise = (offset.dot(normal) - RISE * point.z).max(0.0);
        kept += rise / squared.sqrt().max(1e-6) * (1.0 - squared / (RADIUS * RADIUS)).max(0.0);
    }
    (1.0 - STRENGTH * kept / TAPS as f32).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Intrinsics =
        Intrinsics { width: 640, height: 480, fx: 550.0, fy: 550.0, cx: 319.5, cy: 239.5 };

    /// Mean over a block of pixels of a floor, seen straight on at 1 m, whose depth is `depth`.
    fn mean(depth: impl Fn(usize, usize) -> f32 + Copy, columns: std::ops::Range<usize>) -> f32 {
        let count = (columns.len() * 40) as f32;
        let mut sum = 0.0;
        for u in columns {
            for v in 200..240 {
                let point = CAMERA.back_project(u as f64, v as f64, f64::from(depth(u, v))).cast();
                sum += open_share(depth, &CAMERA, [u, v], &point, &-Vector3::z());
            }
        }
        sum / count
    }

    #[test]
    fn a_plane_is_open_and_the_foot_of_a_block_is_not() {
        assert_eq!(mean(|_, _| 1.0, 100..140), 1.0);
        // A block 3 cm high to the right of column 320.
        let block = |u: usize, _: usize| if u >= 320 { 0.97 } else { 1.0 };
        let (foot, away) = (mean(block, 312..320), mean(block, 240..260));
        assert!((0.35..0.85).contains(&foot), "{foot}");
        assert!(away > 0.99, "{away}");
        assert!(mean(block, 340..342) > 0.99, "the block's top looks over the floor");
    }
}
