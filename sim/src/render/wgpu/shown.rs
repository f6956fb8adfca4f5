//! What the geometry images show, so that the same view in another light is only lit anew; and what need not be drawn.

use nalgebra::{Isometry3, Point3};

use super::cache;
use crate::camera::Intrinsics;
use crate::pose::{Camera, Pose, World};
use crate::render::Instance;

/// All that geometry depends on. The cache holds what the addresses belong to until the next frame.
#[derive(PartialEq)]
pub(super) struct Shown {
    instances: Vec<ShownInstance>,
    intrinsics: Intrinsics,
    world_from_camera: Isometry3<f64>,
}

#[derive(PartialEq)]
struct ShownInstance {
    mesh: usize,
    texture: Option<usize>,
    /// Base colour, roughness, metallic.
    looks: ([f32; 3], f32, f32),
    pose: Isometry3<f64>,
    label: u16,
}

impl Shown {
    pub fn new(
        drawn: &[&Instance],
        intrinsics: &Intrinsics,
        world_from_camera: &Pose<World, Camera>,
    ) -> Self {
        let instances = drawn.iter().map(|instance| {
            let material = &instance.visual.material;
            ShownInstance {
                mesh: cache::key(&instance.visual.mesh),
                texture: material.texture.as_ref().map(cache::key),
                looks: (material.base_color, material.roughness, material.metallic),
                pose: instance.pose,
                label: instance.label,
            }
        });
        Self {
            instances: instances.collect(),
            intrinsics: *intrinsics,
            world_from_camera: *world_from_camera.iso(),
        }
    }
}

/// Whether a sphere in the camera's frame may reach into the picture: whether it is on the inner side of the planes through
/// the picture's borders (half a pixel outside the outermost centres, and a pixel more for the further samples).
pub(super) fn may_be_seen(k: &Intrinsics, center: &Point3<f64>, radius: f64) -> bool {
    const MARGIN_PX: f64 = 1.5;
    let (w, h) = (k.width as f64 - 1.0 + MARGIN_PX, k.height as f64 - 1.0 + MARGIN_PX);
    // Along an image axis: slopes of the two borders.
    let between = |at: f64, low: f64, high: f64| {
        let beyond = |slope: f64, side: f64| side * (at - slope * center.z) / slope.hypot(1.0) > radius;
        !beyond(low, -1.0) && !beyond(high, 1.0)
    };
    center.z > -radius
        && between(center.x, (-MARGIN_PX - k.cx) / k.fx, (w - k.cx) / k.fx)
        && between(center.y, (-MARGIN_PX - k.cy) / k.fy, (h - k.cy) / k.fy)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_surely_outside_is_left_out() {
        let k = Intrinsics::FETCH;
        let mut random = crate::rng::stream(1, "frustum");
        let mut draw = |low: f64, high: f64| crate::range::Range { min: low, max: high }.draw(&mut random);
        for _ in 0..2000 {
            let center = Point3::new(draw(-2.0, 2.0), draw(-2.0, 2.0), draw(-1.0, 2.0));
            let radius = draw(0.01, 0.5);
            // A point of the sphere that is seen.
            let offset = nalgebra::Vector3::new(draw(-1.0, 1.0), draw(-1.0, 1.0), draw(-1.0, 1.0));
            let point = center + offset.normalize() * radius;
            let seen = k
                .project(&point)
                .is_some_and(|p| (-0.5..=639.5).contains(&p.x) && (-0.5..=479.5).contains(&p.y));
            assert!(!seen || may_be_seen(&k, &center, radius), "{center} {radius}");
        }
        assert!(!may_be_seen(&k, &Point3::new(0.0, 0.0, -1.0), 0.5));
        assert!(!may_be_seen(&k, &Point3::new(2.0, 0.0, 1.0), 0.5));
    }
}
