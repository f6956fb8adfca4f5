//! The renderer for graphics adapters (Vulkan, Metal, DX12), without a window.
//!
//! Three passes a frame: shadow maps of all lights; depth, labels and angle of incidence with exactly one sample at each
//! pixel's centre; colour with four samples a pixel, or one on software adapters, where four take three times as long. Everything is computed in the camera's frame, so that depth stays
//! precise wherever in the world the robot stands.

mod cache;
mod device;
mod pipelines;
mod shadow;
mod targets;

use std::num::NonZeroU64;

use bytemuck::{Pod, Zeroable};
use nalgebra::Isometry3;
use wgpu::{
    BindGroup, BindGroupDescriptor, BindGroupEntry, BindingResource, Buffer, BufferBinding, BufferDescriptor,
    BufferUsages, Color, CommandEncoder, CompareFunction, FilterMode, IndexFormat, LoadOp, Operations,
    RenderPass, RenderPassColorAttachment, RenderPassDepthStencilAttachment, RenderPassDescriptor, Sampler,
    SamplerDescriptor, StoreOp, TextureView,
};

use self::cache::Cache;
use self::device::Gpu;
use self::pipelines::Pipelines;
use self::shadow::{Caster, ShadowViews, shadow_views};
use self::targets::{ShadowMaps, Targets};
use super::check::check_view;
use super::shading::{AMBIENT_FROM_BELOW, MAX_LIGHTS, MIN_ROUGHNESS, ViewLighting};
use super::srgb::color_to_linear;
use super::{Instance, Lighting, NEAR, RenderScene, Renderer, Rendering};
use crate::camera::Intrinsics;
use crate::error::{Error, Result};
use crate::images::Image;
use crate::pose::{Camera, Pose, World};

/// Side of a shadow map in texels: 1 to 2 mm a texel for a table seen from the ceiling.
const SHADOW_MAP_SIZE: u32 = 2048;
/// The same on software adapters, which feel each texel.
const SMALL_SHADOW_MAP_SIZE: u32 = 1024;
/// Four lights with six views each.
const MAX_SHADOW_VIEWS: usize = 6 * MAX_LIGHTS;
/// Offsets into a uniform buffer must be multiples of this (the default limit of every adapter).
const UNIFORM_ALIGNMENT: usize = 256;

/// An [`Error::Renderer`] of this renderer.
fn failed(message: impl Into<String>) -> Error {
    Error::Renderer { renderer: "wgpu", message: message.into() }
}

/// Draws on a graphics adapter; keeps meshes and textures there between frames.
pub struct WgpuRenderer {
    gpu: Gpu,
    pipelines: Pipelines,
    cache: Cache,
    samples: u32,
    shadow_sampler: Sampler,
    shadow_maps: ShadowMaps,
    shadow_map_size: u32,
    /// [`Frame`].
    frame: Buffer,
    /// One matrix a shadow view, each at a multiple of [`UNIFORM_ALIGNMENT`].
    views: Buffer,
    instances: Buffer,
    targets: Option<Targets>,
}

/// Counterpart of `Light` in `scene.wgsl`.
#[derive(Clone, Copy, Default, Pod, Zeroable)]
#[repr(C)]
struct LightUniform {
    position: [f32; 3],
    cos_outer: f32,
    axis: [f32; 3],
    cos_inner: f32,
    intensity: [f32; 3],
    first_layer: i32,
    faces: u32,
    texel: f32,
    padding: [u32; 2],
}

/// Counterpart of `Frame` in `scene.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Frame {
    projection: [f32; 4],
    up: [f32; 3],
    ambient: f32,
    near: f32,
    light_count: u32,
    ambient_from_below: f32,
    padding: u32,
    lights: [LightUniform; MAX_LIGHTS],
    shadow_from_camera: [[[f32; 4]; 4]; MAX_SHADOW_VIEWS],
}

/// Counterpart of `Instance` in both shaders.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct InstanceUniform {
    camera_from_mesh: [[f32; 4]; 4],
    base_color: [f32; 3],
    roughness: f32,
    metallic: f32,
    label: u32,
    padding: [u32; 2],
}

impl WgpuRenderer {
    /// Opens the best adapter there is, software ones included. Edges in colour are smoothed on real devices only.
    ///
    /// # Errors
    /// When there is no adapter, or none that will do.
    pub fn new() -> Result<Self> {
        let gpu = Gpu::open()?;
        let samples = if gpu.software { 1 } else { 4 };
        Self::on(gpu, samples)
    }

    /// As [`WgpuRenderer::new`], with four samples a pixel in the colour image or one, whatever the adapter. Depth and
    /// labels always have one.
    ///
    /// # Errors
    /// When there is no adapter, or none that will do.
    pub fn with_smooth_edges(smooth_edges: bool) -> Result<Self> {
        Self::on(Gpu::open()?, if smooth_edges { 4 } else { 1 })
    }

    fn on(gpu: Gpu, samples: u32) -> Result<Self> {
        let shadow_map_size = if gpu.software { SMALL_SHADOW_MAP_SIZE } else { SHADOW_MAP_SIZE };
        let pipelines = Pipelines::new(&gpu.device, samples);
        let cache = Cache::new(&gpu, &pipelines.texture_group);
        let buffer = |label, size, usage| {
            gpu.device.create_buffer(&BufferDescriptor {
                label: Some(label),
                size: size as u64,
                usage: usage | BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        let renderer = Self {
            frame: buffer("frame", size_of::<Frame>(), BufferUsages::UNIFORM),
            views: buffer("shadow views", MAX_SHADOW_VIEWS * UNIFORM_ALIGNMENT, BufferUsages::UNIFORM),
            instances: buffer("instances", 64 * size_of::<InstanceUniform>(), BufferUsages::STORAGE),
            shadow_sampler: gpu.device.create_sampler(&SamplerDescriptor {
                label: Some("shadow"),
                mag_filter: FilterMode::Linear,
                min_filter: FilterMode::Linear,
                compare: Some(CompareFunction::LessEqual),
                ..Default::default()
            }),
            shadow_maps: ShadowMaps::new(&gpu, shadow_map_size, 1),
            shadow_map_size,
            targets: None,
            samples,
            cache,
            pipelines,
            gpu,
        };
        renderer.gpu.check()?;
        log::info!("renderer wgpu on {}", renderer.adapter_info());
        Ok(renderer)
    }

    /// Name, kind, interface and driver of the adapter, for people.
    pub fn adapter_info(&self) -> &str {
        &self.gpu.info
    }

    /// Uploads what is new in `scene` and returns the instances that have something to draw.
    fn upload<'a>(
        &mut self,
        scene: &'a RenderScene,
        camera_from_world: &Isometry3<f64>,
    ) -> Result<Vec<&'a Instance>> {
        self.cache.forget_unused();
        let drawn: Vec<&Instance> =
            scene.instances.iter().filter(|instance| !instance.visual.mesh.triangles.is_empty()).collect();
        let mut uniforms = Vec::with_capacity(drawn.len());
        for instance in &drawn {
            let material = &instance.visual.material;
            self.cache.add_mesh(&self.gpu, &instance.visual.mesh)?;
            if let Some(texture) = &material.texture {
                self.cache.add_texture(&self.gpu, &self.pipelines.texture_group, texture);
            }
            let camera_from_mesh = camera_from_world * instance.pose;
            uniforms.push(InstanceUniform {
                camera_from_mesh: camera_from_mesh.to_homogeneous().cast().into(),
                base_color: color_to_linear(material.base_color),
                roughness: material.roughness.clamp(MIN_ROUGHNESS, 1.0),
                metallic: material.metallic.clamp(0.0, 1.0),
                label: u32::from(instance.label),
                padding: [0; 2],
            });
        }
        let bytes: &[u8] = bytemuck::cast_slice(&uniforms);
        if bytes.len() as u64 > self.instances.size() {
            self.instances = self.gpu.device.create_buffer(&BufferDescriptor {
                label: Some("instances"),
                size: bytes.len().next_power_of_two() as u64,
                usage: BufferUsages::STORAGE | BufferUsages::COPY_DST,
                mapped_at_creation: false,
            });
        }
        self.gpu.queue.write_buffer(&self.instances, 0, bytes);
        Ok(drawn)
    }

    /// Where each light's shadow maps look.
    fn shadow_views(
        &self,
        drawn: &[&Instance],
        lighting: &ViewLighting,
        camera_from_world: &Isometry3<f64>,
    ) -> Vec<Option<ShadowViews>> {
        let casters: Vec<Caster> = drawn
            .iter()
            .map(|instance| {
                let mesh = self.cache.mesh(&instance.visual.mesh);
                Caster { center: camera_from_world * (instance.pose * mesh.center), radius: mesh.radius }
            })
            .collect();
        lighting.lights.iter().map(|light| shadow_views(light, &casters)).collect()
    }

    /// Writes [`Frame`] and the shadow views; returns how many views there are.
    fn write_frame(
        &self,
        lighting: &ViewLighting,
        shadows: &[Option<ShadowViews>],
        intrinsics: &Intrinsics,
    ) -> usize {
        let (w, h) = (intrinsics.width as f64, intrinsics.height as f64);
        let mut frame = Frame {
            // Image point (u, v) is the centre of pixel (u, v), half a pixel inside its corner.
            projection: [
                2.0 * intrinsics.fx / w,
                2.0 * intrinsics.fy / h,
                2.0 * (intrinsics.cx + 0.5) / w - 1.0,
                2.0 * (intrinsics.cy + 0.5) / h - 1.0,
            ]
            .map(|v| v as f32),
            up: lighting.up.into(),
            ambient: lighting.ambient,
            near: NEAR as f32,
            light_count: lighting.lights.len() as u32,
            ambient_from_below: AMBIENT_FROM_BELOW,
            padding: 0,
            lights: Default::default(),
            shadow_from_camera: [[[0.0; 4]; 4]; MAX_SHADOW_VIEWS],
        };
        let mut layer = 0;
        for (i, (light, shadow)) in lighting.lights.iter().zip(shadows).enumerate() {
            frame.lights[i] = LightUniform {
                position: light.position.coords.into(),
                cos_outer: light.cos_outer,
                axis: light.axis.into(),
                cos_inner: light.cos_inner,
                intensity: light.intensity.into(),
                first_layer: -1,
                ..Default::default()
            };
            if let Some(views) = shadow {
                let uniform = &mut frame.lights[i];
                uniform.first_layer = layer as i32;
                uniform.faces = views.shadow_from_camera.len() as u32;
                uniform.texel = (views.width_at_1m / f64::from(self.shadow_map_size)) as f32;
                for matrix in &views.shadow_from_camera {
                    frame.shadow_from_camera[layer] = (*matrix).into();
                    self.gpu.queue.write_buffer(
                        &self.views,
                        (layer * UNIFORM_ALIGNMENT) as u64,
                        bytemuck::bytes_of(&frame.shadow_from_camera[layer]),
                    );
                    layer += 1;
                }
            }
        }
        self.gpu.queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&frame));
        layer
    }

    fn draw_shadows(&self, encoder: &mut CommandEncoder, drawn: &[&Instance], views: usize) {
        let group = self.group(
            &self.pipelines.shadow_group,
            &[
                BindingResource::Buffer(BufferBinding {
                    buffer: &self.views,
                    offset: 0,
                    size: NonZeroU64::new(size_of::<[[f32; 4]; 4]>() as u64),
                }),
                self.instances.as_entire_binding(),
            ],
        );
        for layer in 0..views {
            let mut pass = encoder.begin_render_pass(&RenderPassDescriptor {
                label: Some("shadow"),
                depth_stencil_attachment: Some(depth_buffer(
                    &self.shadow_maps.layers[layer],
                    LoadOp::Clear(1.0),
                    StoreOp::Store,
                )),
                ..Default::default()
            });
            pass.set_pipeline(&self.pipelines.shadow);
            pass.set_bind_group(0, &group, &[(layer * UNIFORM_ALIGNMENT) as u32]);
            for (i, instance) in drawn.iter().enumerate() {
                self.draw_mesh(&mut pass, i, instance);
            }
        }
    }

    fn draw_camera(
        &self,
        encoder: &mut CommandEncoder,
        drawn: &[&Instance],
        background: [f32; 3],
        targets: &Targets,
    ) {
        let group = self.group(
            &self.pipelines.frame_group,
            &[
                self.frame.as_entire_binding(),
                self.instances.as_entire_binding(),
                BindingResource::TextureView(&self.shadow_maps.all),
                BindingResource::Sampler(&self.shadow_sampler),
            ],
        );
        let mut pass = encoder.begin_render_pass(&RenderPassDescriptor {
            label: Some("geometry"),
            color_attachments: &[&targets.depth, &targets.labels, &targets.cos]
                .map(|view| Some(target(view, None, Color::TRANSPARENT))),
            depth_stencil_attachment: Some(depth_buffer(
                &targets.geometry_depth,
                LoadOp::Clear(0.0),
                StoreOp::Store,
            )),
            ..Default::default()
        });
        pass.set_pipeline(&self.pipelines.geometry);
        pass.set_bind_group(0, &group, &[]);
        pass.set_bind_group(1, self.cache.texture(None), &[]);
        for (i, instance) in drawn.iter().enumerate() {
            self.draw_mesh(&mut pass, i, instance);
        }
        drop(pass);

        let [r, g, b] = background.map(f64::from);
        let clear = Color { r, g, b, a: 1.0 };
        let (color, depth, load) = match &targets.multisampled {
            Some([view, depth]) => (target(view, Some(&targets.color), clear), depth, LoadOp::Clear(0.0)),
            None => (target(&targets.color, None, clear), &targets.geometry_depth, LoadOp::Load),
        };
        let mut pass = encoder.begin_render_pass(&RenderPassDescriptor {
            label: Some("color"),
            color_attachments: &[Some(color)],
            depth_stencil_attachment: Some(depth_buffer(depth, load, StoreOp::Discard)),
            ..Default::default()
        });
        pass.set_pipeline(&self.pipelines.color);
        pass.set_bind_group(0, &group, &[]);
        for (i, instance) in drawn.iter().enumerate() {
            let texture = (!instance.visual.mesh.uvs.is_empty())
                .then_some(instance.visual.material.texture.as_ref())
                .flatten();
            pass.set_bind_group(1, self.cache.texture(texture), &[]);
            self.draw_mesh(&mut pass, i, instance);
        }
    }

    fn draw_mesh(&self, pass: &mut RenderPass<'_>, index: usize, instance: &Instance) {
        let mesh = self.cache.mesh(&instance.visual.mesh);
        pass.set_vertex_buffer(0, mesh.vertices.slice(..));
        pass.set_index_buffer(mesh.indices.slice(..), IndexFormat::Uint32);
        let index = index as u32;
        pass.draw_indexed(0..mesh.index_count, 0, index..index + 1);
    }

    fn group(&self, layout: &wgpu::BindGroupLayout, resources: &[BindingResource<'_>]) -> BindGroup {
        let entries: Vec<BindGroupEntry<'_>> = resources
            .iter()
            .enumerate()
            .map(|(i, resource)| BindGroupEntry { binding: i as u32, resource: resource.clone() })
            .collect();
        self.gpu.device.create_bind_group(&BindGroupDescriptor { label: None, layout, entries: &entries })
    }
}

impl Renderer for WgpuRenderer {
    fn name(&self) -> &'static str {
        "wgpu"
    }

    fn device(&self) -> String {
        self.adapter_info().to_owned()
    }

    fn render(
        &mut self,
        scene: &RenderScene,
        lighting: &Lighting,
        intrinsics: &Intrinsics,
        world_from_camera: &Pose<World, Camera>,
    ) -> Result<Rendering> {
        check_view("wgpu", scene, lighting, intrinsics, world_from_camera)?;
        let (width, height) = (intrinsics.width, intrinsics.height);
        let largest = self.gpu.limits.max_texture_dimension_2d as usize;
        if width.max(height) > largest {
            return Err(failed(format!(
                "an image of {width}x{height} is larger than this adapter can draw ({largest}); use --renderer cpu"
            )));
        }
        self.gpu.check()?;
        let camera_from_world = *world_from_camera.inverse().iso();
        let lighting = ViewLighting::new(lighting, world_from_camera);
        let drawn = self.upload(scene, &camera_from_world)?;
        let shadows = self.shadow_views(&drawn, &lighting, &camera_from_world);
        let views = self.write_frame(&lighting, &shadows, intrinsics);
        if views > self.shadow_maps.layers.len() {
            self.shadow_maps = ShadowMaps::new(&self.gpu, self.shadow_map_size, views as u32);
        }
        let targets = match self.targets.take() {
            Some(targets) if (targets.width, targets.height) == (width, height) => targets,
            _ => Targets::new(&self.gpu, width, height, self.samples),
        };

        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        self.draw_shadows(&mut encoder, &drawn, views);
        self.draw_camera(&mut encoder, &drawn, lighting.background, &targets);
        targets.copy_back(&mut encoder);
        self.gpu.queue.submit([encoder.finish()]);

        let pixels = width * height;
        let mut depths = Vec::with_capacity(pixels);
        let mut label_data = Vec::with_capacity(pixels);
        let mut cosines = Vec::with_capacity(pixels);
        let mut luminances = Vec::with_capacity(pixels);
        targets.read_rows(&self.gpu, |[depth, labels, cos, color]| {
            depths.extend(depth.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)));
            label_data.extend(labels.as_chunks().0.iter().map(|b| u32::from_le_bytes(*b) as u16));
            cosines.extend(cos.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)));
            luminances.extend(
                color
                    .as_chunks::<8>()
                    .0
                    .iter()
                    .map(|b| [0, 2, 4].map(|i| float_of_half(u16::from_le_bytes([b[i], b[i + 1]])))),
            );
        })?;
        self.targets = Some(targets);
        let whole = || failed("the picture came back incomplete");
        Ok(Rendering {
            radiance: Image::from_vec(width, height, luminances).ok_or_else(whole)?,
            depth: Image::from_vec(width, height, depths).ok_or_else(whole)?,
            labels: Image::from_vec(width, height, label_data).ok_or_else(whole)?,
            cos_incidence: Image::from_vec(width, height, cosines).ok_or_else(whole)?,
        })
    }
}

fn depth_buffer(
    view: &TextureView,
    load: LoadOp<f32>,
    store: StoreOp,
) -> RenderPassDepthStencilAttachment<'_> {
    RenderPassDepthStencilAttachment { view, depth_ops: Some(Operations { load, store }), stencil_ops: None }
}

fn target<'a>(
    view: &'a TextureView,
    resolve_target: Option<&'a TextureView>,
    clear: Color,
) -> RenderPassColorAttachment<'a> {
    RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target,
        ops: Operations {
            load: LoadOp::Clear(clear),
            store: if resolve_target.is_some() { StoreOp::Discard } else { StoreOp::Store },
        },
    }
}

/// The value of a finite IEEE 754 half float (the shader writes no others).
fn float_of_half(half: u16) -> f32 {
    let magnitude = f32::from_bits(u32::from(half & 0x7fff) << 13) * 2.0_f32.powi(112);
    if half & 0x8000 == 0 { magnitude } else { -magnitude }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_floats_have_their_ieee_values() {
        for (half, value) in [
            (0x0000, 0.0),
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x7bff, 65504.0),
            (0x0400, 6.103_515_6e-5),
            (0x0001, 5.960_464_5e-8),
            (0x3555, 0.333_251_95),
        ] {
            assert_eq!(float_of_half(half), value);
        }
    }
}
