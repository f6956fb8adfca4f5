//! What the shaders read, laid out as WGSL lays it out.

use bytemuck::{Pod, Zeroable};

use crate::render::shading::MAX_LIGHTS;

/// Four lights with six views each.
pub(super) const MAX_SHADOW_VIEWS: usize = 6 * MAX_LIGHTS;

/// Counterpart of `Light` in `frame.wgsl`.
#[derive(Clone, Copy, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Light {
    pub position: [f32; 3],
    pub cos_outer: f32,
    pub axis: [f32; 3],
    pub cos_inner: f32,
    pub intensity: [f32; 3],
    pub first_layer: u32,
    pub faces: u32,
    pub radius: f32,
    pub tangent: f32,
    pub inverse_near: f32,
    pub inverse_far: f32,
    pub padding: [u32; 3],
    pub view_from_camera: [[f32; 4]; 4],
}

/// Counterpart of `Frame` in `frame.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Frame {
    pub intrinsics: [f32; 4],
    pub up: [f32; 3],
    pub padding: f32,
    pub sky: [f32; 3],
    pub padding_2: f32,
    pub ground: [f32; 3],
    pub bounce_radius: f32,
    pub bounce_center: [f32; 3],
    pub bounce_lowest: f32,
    pub bounce_lux: [f32; 3],
    pub padding_3: f32,
    pub background: [f32; 3],
    pub padding_4: f32,
    pub lights: [Light; MAX_LIGHTS],
    pub layer_from_camera: [[[f32; 4]; 4]; MAX_SHADOW_VIEWS],
}

/// Counterpart of `View` in `geometry.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct View {
    pub projection: [f32; 4],
    pub near: f32,
    pub padding: [u32; 3],
}

/// Counterpart of `Instance` in `instances.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Instance {
    pub camera_from_mesh: [[f32; 4]; 4],
    pub base_color: [f32; 3],
    pub roughness: f32,
    pub metallic: f32,
    pub padding: [u32; 3],
}
