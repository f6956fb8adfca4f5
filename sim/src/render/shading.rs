//! How surfaces take light: Lambert plus GGX, in photometric units. `light.wgsl` holds the same formulas line by line;
//! the agreement test compares the two.
//!
//! A light of `I` candela gives `E = I cos / d^2` lux at distance `d`; a surface with reflectance `f` sends back a
//! luminance `f E` cd/m^2 (`f = albedo / pi` for a matt one). All vectors are in the camera's optical frame.

use std::f32::consts::PI;

use nalgebra::{Point3, Vector3};

use super::{Bounce, Lighting};
use crate::pose::{Camera, Pose, World};

/// The most lights a scene may have.
pub const MAX_LIGHTS: usize = 4;

/// Ambient light from below as a share of that from above: the floor reflects less than ceiling and walls.
pub(super) const AMBIENT_FROM_BELOW: f32 = 0.4;

/// The inner part of a light's cone that has full intensity, as a share of its half angle; it falls smoothly to zero at
/// the edge, as the beam of a torch does.
const HOT_SPOT: f32 = 0.4;

/// Linear reflectance of what lies behind the scene, lit by the ambient light.
const BACKGROUND_ALBEDO: [f32; 3] = [0.42, 0.40, 0.37];

/// What lies lower than this against the table's top gets no light from it, metres.
pub(super) const BOUNCE_LOWEST: f32 = -0.002;

/// Smoother surfaces have highlights smaller than a pixel.
pub(super) const MIN_ROUGHNESS: f32 = 0.08;

/// A light in the camera's frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct ViewLight {
    pub position: Point3<f32>,
    /// Unit vector along which it shines.
    pub axis: Vector3<f32>,
    /// Candela a channel.
    pub intensity: Vector3<f32>,
    /// Cosine of the cone's edge; -2 shines everywhere.
    pub cos_outer: f32,
    /// Cosine of the hot spot's edge.
    pub cos_inner: f32,
    /// Radius of the luminous disk, metres.
    pub radius: f32,
    pub shadows: bool,
}

/// The room's light as one camera sees it.
#[derive(Debug, Clone)]
pub(super) struct ViewLighting {
    pub lights: Vec<ViewLight>,
    /// Lux a channel on a surface that faces up, from sky or ceiling and walls.
    pub sky: Vector3<f32>,
    /// Lux a channel on a surface that faces down, from the floor.
    pub ground: Vector3<f32>,
    pub bounce: Option<ViewBounce>,
    /// World up.
    pub up: Vector3<f32>,
    /// Luminance where nothing is hit.
    pub background: [f32; 3],
}

/// A lit disk that colours what is above it: the table's top. Its light arrives with the form factor of a disk that
/// faces the receiver, r^2 / (r^2 + d^2).
#[derive(Debug, Clone, Copy)]
pub(super) struct ViewBounce {
    pub center: Point3<f32>,
    pub radius: f32,
    /// Lux a channel that it sends up, right above it.
    pub lux: Vector3<f32>,
}

impl ViewLighting {
    pub fn new(
        lighting: &Lighting,
        bounce: Option<&Bounce>,
        world_from_camera: &Pose<World, Camera>,
    ) -> Self {
        let camera_from_world = world_from_camera.inverse();
        let lights: Vec<ViewLight> = lighting
            .lights
            .iter()
            .map(|light| {
                let axis = (light.target - light.position).try_normalize(1e-9).unwrap_or(-Vector3::z());
                let everywhere = light.half_angle >= std::f64::consts::PI;
                ViewLight {
                    position: camera_from_world.transform_point(&light.position.into()).cast(),
                    axis: camera_from_world.transform_vector(&axis).cast(),
                    intensity: Vector3::from(light.color).cast() * light.intensity_cd as f32,
                    cos_outer: if everywhere { -2.0 } else { light.half_angle.cos() as f32 },
                    cos_inner: if everywhere {
                        -1.5
                    } else {
                        (light.half_angle * f64::from(HOT_SPOT)).cos() as f32
                    },
                    radius: light.radius as f32,
                    shadows: light.shadows,
                }
            })
            .collect();
        let up: Vector3<f32> = camera_from_world.transform_vector(&Vector3::z()).cast();
        let sky = Vector3::from(lighting.ambient_color).cast() * lighting.ambient_lux as f32;
        let bounce = bounce.map(|bounce| {
            let center: Point3<f32> = camera_from_world.transform_point(&bounce.center).cast();
            let direct = lights.iter().filter_map(|light| {
                let (to_light, lux) = light.reach(&center)?;
                Some(lux * to_light.dot(&up).max(0.0))
            });
            let arriving = direct.fold(sky, |sum, lux| sum + lux);
            let lux = arriving.component_mul(&Vector3::from(bounce.albedo));
            ViewBounce { center, radius: bounce.radius as f32, lux }
        });
        Self {
            lights,
            ground: sky * AMBIENT_FROM_BELOW,
            bounce,
            up,
            background: (sky.component_mul(&Vector3::from(BACKGROUND_ALBEDO)) / PI).into(),
            sky,
        }
    }

    /// Ambient illuminance, lux a channel, at `point` on a surface whose normal is `normal`.
    fn ambient_on(&self, point: &Point3<f32>, normal: &Vector3<f32>) -> Vector3<f32> {
        let above = 0.5 + 0.5 * normal.dot(&self.up);
        let mut below = self.ground;
        if let Some(bounce) = &self.bounce {
            let offset = point - bounce.center;
            if offset.dot(&self.up) > BOUNCE_LOWEST {
                let squared = bounce.radius * bounce.radius;
                below += bounce.lux * (squared / (squared + offset.norm_squared()));
            }
        }
        self.sky * above + below * (1.0 - above)
    }
}

impl ViewLight {
    /// Unit vector from `point` to the light, and illuminance there on a surface that faces it (lux a channel);
    /// `None` outside the cone.
    pub fn reach(&self, point: &Point3<f32>) -> Option<(Vector3<f32>, Vector3<f32>)> {
        let to_light = self.position - point;
        // A source is never closer than 1 cm, so that nothing is infinitely bright.
        let squared = to_light.norm_squared().max(1e-4);
        let direction = to_light / squared.sqrt();
        let s = ((-direction.dot(&self.axis) - self.cos_outer) / (self.cos_inner - self.cos_outer).max(1e-4))
            .clamp(0.0, 1.0);
        let beam = s * s * (3.0 - 2.0 * s);
        (beam > 0.0).then(|| (direction, self.intensity * (beam / squared)))
    }
}

/// A point of a surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Surface {
    pub point: Point3<f32>,
    /// Unit normal on the camera's side.
    pub normal: Vector3<f32>,
    /// Linear reflectance.
    pub albedo: Vector3<f32>,
    pub roughness: f32,
    pub metallic: f32,
}

impl Surface {
    /// Luminance towards the camera, cd/m^2 a channel. `open` is the share of the ambient light that arrives,
    /// `lit(i, to_light)` that of light `i`.
    pub fn radiance(
        &self,
        lighting: &ViewLighting,
        open: f32,
        lit: impl Fn(usize, &Vector3<f32>) -> f32,
    ) -> [f32; 3] {
        let view = -self.point.coords.normalize();
        let n_v = self.normal.dot(&view).max(1e-3);
        let specular = Vector3::repeat(0.04).lerp(&self.albedo, self.metallic);
        let diffuse = self.albedo * ((1.0 - self.metallic) / PI);

        // Ambient: matt part by the hemisphere about the normal, glossy part by the one about the mirror direction.
        let mirror = self.normal * (2.0 * self.normal.dot(&view)) - view;
        let gloss = ambient_gloss(specular, self.roughness, n_v) / PI;
        let mut radiance = (diffuse.component_mul(&lighting.ambient_on(&self.point, &self.normal))
            + gloss.component_mul(&lighting.ambient_on(&self.point, &mirror)))
            * open;

        for (i, light) in lighting.lights.iter().enumerate() {
            let Some((to_light, illuminance)) = light.reach(&self.point) else {
                continue;
            };
            let n_l = self.normal.dot(&to_light);
            if n_l <= 0.0 {
                continue;
            }
            let share = if light.shadows { lit(i, &to_light) } else { 1.0 };
            if share <= 0.0 {
                continue;
            }
            let half = (to_light + view).normalize();
            let fresnel = schlick(specular, view.dot(&half).max(0.0));
            let distance = (light.position - self.point).norm();
            let roughness = widened(self.roughness, light.radius, distance);
            let gloss = fresnel * ggx(roughness, self.normal.dot(&half), n_l, n_v);
            let matt = diffuse.component_mul(&(Vector3::repeat(1.0) - fresnel));
            radiance += (matt + gloss).component_mul(&illuminance) * (n_l * share);
        }
        radiance.into()
    }
}

/// Fresnel reflectance (Schlick 1994).
fn schlick(at_normal: Vector3<f32>, cos: f32) -> Vector3<f32> {
    let m = 1.0 - cos;
    let m5 = m * m * m * m * m;
    at_normal + (Vector3::repeat(1.0) - at_normal) * m5
}

/// GGX normal distribution times Smith's height-correlated visibility (Walter 2007; Heitz 2014), alpha = roughness^2.
fn ggx(roughness: f32, n_h: f32, n_l: f32, n_v: f32) -> f32 {
    let alpha = roughness * roughness;
    let a2 = alpha * alpha;
    let n_h = n_h.clamp(0.0, 1.0);
    let d = n_h * n_h * (a2 - 1.0) + 1.0;
    let distribution = a2 / (PI * d * d);
    let shadow_v = n_l * (n_v * n_v * (1.0 - a2) + a2).sqrt();
    let shadow_l = n_v * (n_l * n_l * (1.0 - a2) + a2).sqrt();
    distribution * 0.5 / (shadow_v + shadow_l).max(1e-6)
}

/// Roughness that makes the highlight of a point as wide as that of a disk of `radius` at `distance` (Karis 2013).
fn widened(roughness: f32, radius: f32, distance: f32) -> f32 {
    (roughness * roughness + 0.5 * radius / distance.max(0.01)).min(1.0).sqrt()
}

/// Reflectance of a glossy surface under even light (Karis 2014, the analytic fit).
fn ambient_gloss(specular: Vector3<f32>, roughness: f32, n_v: f32) -> Vector3<f32> {
    let r =
        [1.0 - roughness, 0.0425 - 0.0275 * roughness, 1.04 - 0.572 * roughness, 0.022 * roughness - 0.04];
    let a = (r[0] * r[0]).min((-9.28 * n_v).exp2()) * r[0] + r[1];
    specular * (r[2] - 1.04 * a) + Vector3::repeat(r[3] + 1.04 * a)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::Light;

    fn lighting(half_angle: f64) -> ViewLighting {
        let light = Light {
            position: Vector3::new(0.0, 0.0, 0.0),
            target: Vector3::new(0.0, 0.0, 1.0),
            intensity_cd: 200.0,
            color: [1.0, 0.5, 0.25],
            half_angle,
            radius: 0.0,
            shadows: false,
        };
        ViewLighting::new(&Lighting { lights: vec![light], ..Lighting::default() }, None, &Pose::identity())
    }

    #[test]
    fn matt_luminance_is_albedo_times_lux_over_pi() {
        // 200 cd at 2 m are 50 lux; the surface faces light and camera, so that gloss adds at most a few per cent.
        let surface = Surface {
            point: Point3::new(0.0, 0.0, 2.0),
            normal: -Vector3::z(),
            albedo: Vector3::repeat(0.5),
            roughness: 1.0,
            metallic: 0.0,
        };
        let radiance = surface.radiance(&lighting(std::f64::consts::PI), 1.0, |_, _| 1.0);
        let matt = 0.5 * 50.0 / PI;
        assert!((radiance[0] / matt - 1.0).abs() < 0.05, "{radiance:?}");
        assert!((radiance[1] / radiance[0] - 0.5).abs() < 1e-5);
    }

    #[test]
    fn gloss_never_returns_more_light_than_it_gets() {
        // White furnace by the midpoint rule over the hemisphere of light directions, for a perfect mirror material.
        for roughness in [0.2_f32, 0.5, 1.0] {
            for n_v in [0.3_f32, 0.7, 1.0] {
                let view = Vector3::new((1.0 - n_v * n_v).sqrt(), 0.0, n_v);
                let (mut sum, steps) = (0.0_f64, 400);
                for i in 0..steps {
                    let n_l = (i as f32 + 0.5) / steps as f32;
                    for j in 0..steps {
                        let phi = (j as f32 + 0.5) / steps as f32 * 2.0 * PI;
                        let s = (1.0 - n_l * n_l).sqrt();
                        let l = Vector3::new(s * phi.cos(), s * phi.sin(), n_l);
                        let h = (l + view).normalize();
                        sum += f64::from(ggx(roughness, h.z, n_l, n_v) * n_l);
                    }
                }
                let reflectance = sum * 2.0 * std::f64::consts::PI / f64::from(steps * steps);
                // Light that bounces twice between facets is not modelled, so rough surfaces lose some; smooth ones little.
                let least = if roughness < 0.3 { 0.95 } else { 0.2 };
                assert!(
                    reflectance < 1.02 && reflectance > least,
                    "roughness {roughness}, n_v {n_v}: {reflectance}"
                );
            }
        }
    }

    #[test]
    fn a_cone_is_bright_inside_and_dark_outside() {
        let light = lighting(0.5).lights[0];
        let at = |angle: f32| {
            light.reach(&Point3::new(angle.sin(), 0.0, angle.cos())).map_or(0.0, |(_, lux)| lux.x)
        };
        assert!((at(0.1) - 200.0).abs() < 1e-2);
        assert!(at(0.35) > at(0.45) && at(0.45) > 0.0);
        assert_eq!(at(0.51), 0.0);
    }
}
