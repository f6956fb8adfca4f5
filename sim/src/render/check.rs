//! What both renderers refuse to draw, and how they say so.

use super::shading::MAX_LIGHTS;
use super::{Lighting, RenderScene};
use crate::camera::Intrinsics;
use crate::error::{Error, Result};
use crate::mesh::Mesh;
use crate::pose::{Camera, Pose, World};

/// Refuses sizes, poses and lights that no renderer can draw.
pub(super) fn check_view(
    renderer: &'static str,
    scene: &RenderScene,
    lighting: &Lighting,
    intrinsics: &Intrinsics,
    world_from_camera: &Pose<World, Camera>,
) -> Result<()> {
    let fail = |message: String| Err(Error::Renderer { renderer, message });
    if let Some(problem) = intrinsics.problem() {
        return fail(problem);
    }
    if !world_from_camera.is_finite() {
        return fail(format!(
            "the camera's pose is not finite: {world_from_camera:?}; check the joint positions it comes from"
        ));
    }
    if let Some(problem) = lighting.problem() {
        return fail(problem);
    }
    for (i, instance) in scene.instances.iter().enumerate() {
        let iso = &instance.pose;
        let finite = iso.translation.vector.iter().all(|v| v.is_finite())
            && iso.rotation.coords.iter().all(|v| v.is_finite());
        if !finite {
            return fail(format!(
                "instance {i} (label {}) has a pose that is not finite; did the simulation blow up?",
                instance.label
            ));
        }
    }
    Ok(())
}

/// Refuses meshes whose parts do not fit together.
pub(super) fn check_mesh(renderer: &'static str, mesh: &Mesh) -> Result<()> {
    let vertices = mesh.positions.len();
    let fits = |len: usize| len == 0 || len == vertices;
    let message = if mesh.normals.len() != vertices {
        format!("{} normals for {vertices} vertices", mesh.normals.len())
    } else if !fits(mesh.uvs.len()) {
        format!("{} texture coordinates for {vertices} vertices", mesh.uvs.len())
    } else if !fits(mesh.colors.len()) {
        format!("{} colours for {vertices} vertices", mesh.colors.len())
    } else if !fits(mesh.finish.len()) {
        format!("{} finishes for {vertices} vertices", mesh.finish.len())
    } else if let Some(i) =
        mesh.positions.iter().position(|p| !p.coords.iter().all(|c| c.is_finite() && c.abs() < 1e6))
    {
        format!("vertex {i} is {}, which is no place", mesh.positions[i])
    } else if let Some(triangle) = mesh.triangles.iter().find(|t| t.iter().any(|&i| i as usize >= vertices)) {
        format!("triangle {triangle:?} names a vertex beyond the {vertices} there are")
    } else {
        return Ok(());
    };
    Err(Error::Renderer { renderer, message: format!("a mesh cannot be drawn: {message}; export it again") })
}

impl Lighting {
    /// What is wrong with these numbers, if anything: field, value and range.
    pub fn problem(&self) -> Option<String> {
        let bad = |v: f64| !(v.is_finite() && v >= 0.0);
        if bad(self.ambient_lux) {
            return Some(format!("ambient_lux = {}: must be finite and not negative", self.ambient_lux));
        }
        if self.ambient_color.iter().any(|&c| bad(c) || c > 1.0) {
            return Some(format!("ambient_color = {:?}: each channel must be 0 to 1", self.ambient_color));
        }
        if self.lights.len() > MAX_LIGHTS {
            return Some(format!("{} lights: at most {MAX_LIGHTS} can be drawn", self.lights.len()));
        }
        for (i, light) in self.lights.iter().enumerate() {
            let place = |v: &nalgebra::Vector3<f64>| v.iter().all(|c| c.is_finite() && c.abs() < 1e4);
            if !place(&light.position) || !place(&light.target) {
                return Some(format!(
                    "lights[{i}]: position {:?} and target {:?} must be finite and within 10 km",
                    light.position.as_slice(),
                    light.target.as_slice()
                ));
            }
            if (light.position - light.target).norm() < 1e-6 {
                return Some(format!(
                    "lights[{i}]: target {:?} is where the light stands; aim it somewhere else",
                    light.target.as_slice()
                ));
            }
            if bad(light.intensity_cd) || light.intensity_cd > 1e7 {
                return Some(format!("lights[{i}].intensity_cd = {}: must be 0 to 1e7", light.intensity_cd));
            }
            if light.color.iter().any(|&c| bad(c) || c > 1.0) {
                return Some(format!("lights[{i}].color = {:?}: each channel must be 0 to 1", light.color));
            }
            if bad(light.radius) || light.radius > 5.0 {
                return Some(format!("lights[{i}].radius = {}: must be 0 to 5 m", light.radius));
            }
            let pi = std::f64::consts::PI;
            if !(light.half_angle > 0.0 && light.half_angle <= pi + 1e-9) {
                return Some(format!(
                    "lights[{i}].half_angle = {}: must be above 0 and at most pi radians",
                    light.half_angle
                ));
            }
        }
        None
    }
}
