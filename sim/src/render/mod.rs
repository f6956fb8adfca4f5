//! Renderers: what a pinhole camera sees of a list of posed meshes.
//!
//! Two implementations of [`Renderer`] draw the same thing: `wgpu` on any Vulkan, Metal or DX12 adapter, and `cpu`, a
//! ray caster that needs none and is the oracle for the first. Use [`open`] to choose one.

mod bvh;
mod check;
pub mod cpu;
mod object_depth;
mod occlusion;
mod pyramid;
mod shading;
mod silhouette;
pub mod srgb;
mod surroundings;
pub mod textures;
pub mod wgpu;

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::camera::Intrinsics;
use crate::error::Result;
use crate::images::{DepthImage, Image, LabelImage, RadianceImage};
use crate::mesh::Visual;
use crate::pose::{Camera, Pose, World};
use crate::scene::Table;

pub use self::object_depth::{ObjectDepth, object_depth};
pub use self::shading::MAX_LIGHTS;
pub use self::silhouette::{Silhouette, silhouette};
pub use self::surroundings::{Furniture, furniture, unknown_object};

/// Nothing nearer to the camera than this along its axis is drawn, metres: the camera looks out through its own housing.
pub const NEAR: f64 = 0.02;

/// Where in an edge pixel the samples of its colour are taken, pixels off the centre: there, and on a triangle about it.
pub(crate) const SUBPIXELS: [[f64; 2]; 4] = [[0.0, 0.0], [0.36, 0.09], [-0.26, 0.27], [-0.10, -0.36]];

/// Opens a renderer. [`RendererChoice::Auto`] falls back to the CPU, saying so in one log line.
///
/// # Errors
/// With [`RendererChoice::Wgpu`], when there is no graphics adapter that will do.
pub fn open(choice: RendererChoice) -> Result<Box<dyn Renderer>> {
    match choice {
        RendererChoice::Cpu => Ok(Box::new(cpu::CpuRenderer::new())),
        RendererChoice::Wgpu => Ok(Box::new(wgpu::WgpuRenderer::new()?)),
        RendererChoice::Auto => match wgpu::WgpuRenderer::new() {
            Ok(renderer) => Ok(Box::new(renderer)),
            Err(error) => {
                log::warn!("{error}; drawing on the CPU instead");
                Ok(Box::new(cpu::CpuRenderer::new()))
            }
        },
    }
}

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
    /// The table's top, by whose light its colour bleeds into what stands on it.
    pub bounce: Option<Bounce>,
}

/// A matt horizontal disk that reflects the light that falls on it upwards.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounce {
    /// World frame, metres.
    pub center: Point3<f64>,
    /// Metres.
    pub radius: f64,
    /// Linear reflectance, 0 to 1.
    pub albedo: [f32; 3],
}

impl Bounce {
    /// A table's top, as a disk as wide as its shorter side; `albedo` as in [`Furniture::table_albedo`].
    pub fn of(table: &Table, albedo: [f32; 3]) -> Self {
        Self {
            center: Point3::new(table.center[0], table.center[1], table.height),
            radius: 0.5 * table.size[0].min(table.size[1]),
            albedo,
        }
    }
}

/// One light source, in the world frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Light {
    /// Position, metres.
    #[schemars(with = "[f64; 3]")]
    pub position: Vector3<f64>,
    /// The point it aims at, metres.
    #[schemars(with = "[f64; 3]")]
    pub target: Vector3<f64>,
    /// Luminous intensity on the axis, candela.
    pub intensity_cd: f64,
    /// Linear RGB, brightest channel 1. White unless given.
    #[serde(default = "white")]
    pub color: [f64; 3],
    /// Radius of the luminous disk, metres: the larger, the softer its shadows. 0, a point, unless given.
    #[serde(default)]
    pub radius: f64,
    /// Half angle of the cone in radians; a value of pi, the default, shines everywhere.
    #[serde(default = "everywhere")]
    pub half_angle: f64,
    /// Whether it casts shadows. True unless given.
    #[serde(default = "casts_shadows")]
    pub shadows: bool,
}

fn white() -> [f64; 3] {
    [1.0; 3]
}

fn everywhere() -> f64 {
    std::f64::consts::PI
}

fn casts_shadows() -> bool {
    true
}

/// The light in the room.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Lighting {
    /// Illuminance of the ambient light on a surface that faces up, lux; surfaces that face down get 40 % of it.
    pub ambient_lux: f64,
    /// Linear RGB of the ambient light, brightest channel 1. White unless given.
    #[serde(default = "white")]
    pub ambient_color: [f64; 3],
    /// Up to four sources. None unless given.
    #[serde(default)]
    pub lights: Vec<Light>,
}

impl Default for Lighting {
    /// Darkness.
    fn default() -> Self {
        Self { ambient_lux: 0.0, ambient_color: white(), lights: Vec::new() }
    }
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
    pub cos_incidence: Image<f32>,
}

/// Draws scenes. Same input, same output, to the bit, on the same renderer and machine.
pub trait Renderer: Send {
    /// `wgpu` or `cpu`.
    fn name(&self) -> &'static str;

    /// What it runs on, for people: the adapter and its driver, or the CPU.
    fn device(&self) -> String;

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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
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
