//! Renderers: what a pinhole camera sees of a list of posed meshes.
//!
//! Two implementations of [`Renderer`] draw the same thing: `wgpu` on any Vulkan, Metal or DX12 adapter, and `cpu`, a
//! ray caster that needs none and is the oracle for the first. Use [`open`] to choose one.

use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use serde::{Deserialize, Serialize};

use crate::camera::Intrinsics;
use crate::error::Result;
use crate::images::{DepthImage, LabelImage, RadianceImage};
use crate::mesh::Visual;
use crate::pose::{Camera, Pose, World};

/// A mesh at a place in the world.
#[derive(Debug, Clone)]
pub struct Instance {
    /// What to draw.
    pub visual: Arc<Visual>,
    /// World from mesh.
    pub pose: Isometry3<f64>,
    /// What the label image shows where this instance is in front. 0 means background and furniture.
    pub label: u16,
}

/// All that is drawn.
#[derive(Debug, Clone, Default)]
pub struct RenderScene {
    /// Instances in any order.
    pub instances: Vec<Instance>,
}

/// One light source, in the world frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Light {
    /// Position, metres.
    pub position: Vector3<f64>,
    /// The point it aims at, metres.
    pub target: Vector3<f64>,
    /// Luminous intensity on the axis, candela.
    pub intensity_cd: f64,
    /// Linear RGB, brightest channel 1.
    pub color: [f64; 3],
    /// Half angle of the cone in radians; a value of pi shines everywhere.
    pub half_angle: f64,
    /// Whether it casts shadows.
    pub shadows: bool,
}

/// The light in the room.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lighting {
    /// Illuminance of the uniform ambient light on a surface, lux.
    pub ambient_lux: f64,
    /// Up to four sources.
    pub lights: Vec<Light>,
}

/// What a renderer returns. All images have the size of the intrinsics.
#[derive(Debug, Clone)]
pub struct Rendering {
    /// Luminance, linear RGB, cd/m^2, before exposure and noise.
    pub radiance: RadianceImage,
    /// Perfect depth along the axis, metres; 0.0 where nothing is hit.
    pub depth: DepthImage,
    /// [`Instance::label`] of the nearest surface.
    pub labels: LabelImage,
    /// Cosine of the angle between surface normal and viewing ray, 0 where nothing is hit; depth noise needs it.
    pub cos_incidence: crate::images::Image<f32>,
}

/// Draws scenes. Same input, same output, to the bit, on the same renderer and machine.
pub trait Renderer {
    /// `wgpu` or `cpu`.
    fn name(&self) -> &'static str;

    /// Draws `scene` from `world_from_camera`.
    ///
    /// # Errors
    /// When the graphics device fails or the image is larger than it can draw.
    fn render(
        &mut self,
        scene: &RenderScene,
        lighting: &Lighting,
        intrinsics: &Intrinsics,
        world_from_camera: &Pose<World, Camera>,
    ) -> Result<Rendering>;
}

/// Which renderer to use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RendererChoice {
    /// wgpu where an adapter exists, else cpu, saying so once.
    #[default]
    Auto,
    /// wgpu or an error.
    Wgpu,
    /// The CPU ray caster.
    Cpu,
}
