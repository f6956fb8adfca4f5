//! Where shadow maps look: the views from each light that hold everything that casts a shadow.

use nalgebra::{Matrix4, Point3, Unit, Vector3};

use crate::render::shading::ViewLight;

/// A cone wider than this is drawn as the six faces of a cube instead: a flat picture would be coarse.
const WIDEST_HALF_ANGLE: f64 = 1.1;
/// Larger things are walls and floors: they take shadows but their own fall outside the room.
const LARGEST_CASTER_RADIUS: f64 = 1.6;
/// Nothing closer to a light than this casts a shadow, metres.
const NEAREST: f64 = 0.02;

/// A bounding sphere in the camera's frame.
pub(super) struct Caster {
    pub center: Point3<f64>,
    pub radius: f64,
}

/// The shadow maps of one light.
pub(super) struct ShadowViews {
    /// Rigid transform to the frame of each view, z along it: one view, or six for a cube in the order +x -x +y -y +z -z.
    pub light_from_camera: Vec<Matrix4<f32>>,
    /// Half of a view's width at a distance of 1 m, metres.
    pub tangent: f64,
    /// Distance along the view of depth 0, metres.
    pub near: f64,
    /// Distance along the view of depth 1, metres.
    pub far: f64,
}

impl ShadowViews {
    /// Clip coordinates from a view's frame: depth 0 at `near` and 1 at `far`.
    pub fn projection(&self) -> Matrix4<f32> {
        let stretch = (self.far / (self.far - self.near)) as f32;
        let scale = (1.0 / self.tangent) as f32;
        Matrix4::from_row_slice(&[
            scale,
            0.0,
            0.0,
            0.0, //
            0.0,
            scale,
            0.0,
            0.0, //
            0.0,
            0.0,
            stretch,
            -(self.near as f32) * stretch, //
            0.0,
            0.0,
            1.0,
            0.0,
        ])
    }
}

/// Views from `light` that see all `casters` in its cone; `None` where it casts no shadow.
pub(super) fn shadow_views(light: &ViewLight, casters: &[Caster]) -> Option<ShadowViews> {
    if !light.shadows {
        return None;
    }
    let eye = light.position.cast::<f64>();
    let around: Vec<(Vector3<f64>, f64, f64)> = casters
        .iter()
        .filter(|c| c.radius < LARGEST_CASTER_RADIUS)
        .map(|c| {
            let offset = c.center - eye;
            (offset, offset.norm(), c.radius)
        })
        .collect();
    if around.is_empty() {
        return None;
    }
    let near = around.iter().map(|(_, d, r)| d - r).fold(f64::INFINITY, f64::min).max(NEAREST);
    let far = around.iter().map(|(_, d, r)| d + r).fold(0.0, f64::max).max(near * 1.01);

    // Towards the middle of the casters, wide enough for all of them; or the light's own cone where that is narrower.
    let middle: Vector3<f64> = around.iter().map(|(o, d, _)| o / d.max(1e-6)).sum();
    let mut axis = Unit::try_new(middle, 1e-6);
    let mut half = axis.map_or(f64::INFINITY, |axis| {
        around
            .iter()
            .map(|(o, d, r)| if d <= r { f64::INFINITY } else { o.angle(&axis) + (r / d).asin() })
            .fold(0.0, f64::max)
    });
    let cone = if light.cos_outer < -1.0 {
        f64::INFINITY
    } else {
        f64::from(light.cos_outer).clamp(-1.0, 1.0).acos()
    };
    if cone < half {
        half = cone;
        axis = Unit::try_new(light.axis.cast(), 1e-6);
    }
    match axis {
        Some(axis) if half <= WIDEST_HALF_ANGLE => {
            // Room for the kernel at the rim.
            let tangent = (half + 0.01).tan();
            // The nearest depth along the axis is less than the nearest distance.
            let near = (near * half.cos()).max(NEAREST);
            Some(ShadowViews { light_from_camera: vec![look(eye, axis.into_inner())], tangent, near, far })
        }
        _ => {
            let near = (near / 3.0_f64.sqrt()).max(NEAREST);
            let light_from_camera =
                [Vector3::x(), -Vector3::x(), Vector3::y(), -Vector3::y(), Vector3::z(), -Vector3::z()]
                    .into_iter()
                    .map(|forward| look(eye, forward))
                    .collect();
            Some(ShadowViews { light_from_camera, tangent: 1.0, near, far })
        }
    }
}

/// To the frame of a view from `eye` along unit vector `forward`.
fn look(eye: Point3<f64>, forward: Vector3<f64>) -> Matrix4<f32> {
    let side = if forward.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    let right = forward.cross(&side).normalize();
    let up = right.cross(&forward);
    let rows = [right, up, forward].map(|axis| [axis.x, axis.y, axis.z, -axis.dot(&eye.coords)]);
    let last = [0.0, 0.0, 0.0, 1.0];
    Matrix4::from_fn(|r, c| rows.get(r).unwrap_or(&last)[c] as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector4;

    fn light(cos_outer: f32) -> ViewLight {
        ViewLight {
            position: Point3::new(0.1, -2.0, 1.0),
            axis: Vector3::new(0.0, 1.0, 0.0),
            intensity: Vector3::repeat(1.0),
            cos_outer,
            cos_inner: 1.0,
            radius: 0.0,
            shadows: true,
        }
    }

    #[test]
    fn one_view_holds_every_caster() {
        let casters: Vec<Caster> = (0..5)
            .map(|i| Caster {
                center: Point3::new(0.2 * f64::from(i) - 0.4, 0.3, 1.0 + 0.1 * f64::from(i)),
                radius: 0.1,
            })
            .collect();
        let views = shadow_views(&light(-2.0), &casters).unwrap();
        assert_eq!(views.light_from_camera.len(), 1);
        for caster in &casters {
            for direction in [Vector3::x(), Vector3::y(), Vector3::z()] {
                for sign in [-1.0, 1.0] {
                    let p = (caster.center + direction * (sign * caster.radius)).cast::<f32>();
                    let clip =
                        views.projection() * views.light_from_camera[0] * Vector4::new(p.x, p.y, p.z, 1.0);
                    let ndc = clip.xyz() / clip.w;
                    assert!(ndc.x.abs() <= 1.0 && ndc.y.abs() <= 1.0, "{ndc}");
                    assert!((0.0..=1.0).contains(&ndc.z), "{ndc}");
                }
            }
        }
    }

    #[test]
    fn a_light_among_the_casters_looks_all_around_and_a_narrow_cone_limits_the_view() {
        let around = [Caster { center: Point3::new(0.1, -2.0, 1.1), radius: 0.5 }];
        let views = shadow_views(&light(-2.0), &around).unwrap();
        assert_eq!(views.light_from_camera.len(), 6);
        let cone = 0.3_f32;
        let views = shadow_views(&light(cone.cos()), &around).unwrap();
        assert_eq!(views.light_from_camera.len(), 1);
        assert!((views.tangent - f64::from(cone + 0.01).tan()).abs() < 1e-3);
        assert!(shadow_views(&light(-2.0), &[]).is_none());
    }
}
