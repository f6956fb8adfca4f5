//! The renderer for graphics adapters (Vulkan, Metal, DX12), without a window.
//!
//! The passes of a frame: shadow maps of all lights; geometry (depth, labels, angle of incidence, colour, normal) with
//! exactly one sample at each pixel's centre; how much of each light arrives at every pixel; light on every pixel; three
//! more samples of the geometry, from which edges are smoothed. Light comes after geometry because a software adapter
//! shades small triangles by blocks of sixteen pixels: this way each pixel is lit once. Everything is computed in the
//! camera's frame, so that depth stays precise wherever in the world the robot stands.

mod cache;
mod pipelines;
mod shaders;
mod shadow;
mod shown;
mod targets;
mod uniforms;

use std::num::NonZeroU64;

use nalgebra::Isometry3;
use wgpu::{
    BindGroup, BindingResource, Buffer, BufferBinding, BufferDescriptor, BufferUsages, Color, CommandEncoder,
    IndexFormat, LoadOp, Operations, RenderPass, RenderPassColorAttachment, RenderPassDepthStencilAttachment,
    RenderPassDescriptor, RenderPipeline, StoreOp, TextureView,
};

use self::cache::Cache;
use self::pipelines::{Lights, Pipelines, bind};
use self::shadow::{Caster, ShadowViews, shadow_views};
use self::shown::{Shown, may_be_seen};
use self::targets::{ShadowMaps, Targets};
use self::uniforms::{Frame, MAX_SHADOW_VIEWS};
use super::SUBPIXELS;
use super::check::check_view;
use super::shading::{BOUNCE_LOWEST, MIN_ROUGHNESS, ViewLighting};
use super::srgb::color_to_linear;
use super::{Instance, Lighting, NEAR, RenderScene, Renderer, Rendering};
use crate::camera::Intrinsics;
use crate::error::{Error, Result};
use crate::gpu::{Gpu, GpuError};
use crate::images::Image;
use crate::pose::{Camera, Pose, World};

/// Side of a shadow map in texels: 1 to 2 mm a texel for a table seen from the ceiling.
const SHADOW_MAP_SIZE: u32 = 2048;
/// The same on software adapters, which feel each texel.
const SMALL_SHADOW_MAP_SIZE: u32 = 1024;
/// Offsets into a uniform buffer must be multiples of this (the default limit of every adapter).
const UNIFORM_ALIGNMENT: usize = 256;

/// An [`Error::Renderer`] of this renderer.
fn failed(message: impl Into<String>) -> Error {
    Error::Renderer { renderer: "wgpu", message: message.into() }
}

/// An [`Error::Renderer`] for what the device says.
fn device_failed(error: GpuError) -> Error {
    failed(format!("{error}, or use --renderer cpu"))
}

/// Draws on a graphics adapter; keeps meshes and textures there between frames.
pub struct WgpuRenderer {
    gpu: Gpu,
    pipelines: Pipelines,
    cache: Cache,
    smooth_edges: bool,
    shadow_maps: ShadowMaps,
    shadow_map_size: u32,
    /// [`Frame`].
    frame: Buffer,
    /// A projection for each sample of a pixel, each at a multiple of [`UNIFORM_ALIGNMENT`].
    projections: Buffer,
    /// One matrix a shadow view, each at a multiple of [`UNIFORM_ALIGNMENT`].
    views: Buffer,
    instances: Buffer,
    targets: Option<Targets>,
    /// What the geometry images in `targets` show, so that the same view in another light is only lit anew.
    shown: Option<Shown>,
}

impl WgpuRenderer {
    /// Opens the best adapter there is, software ones included.
    ///
    /// # Errors
    /// When there is no adapter, or none that will do.
    pub fn new() -> Result<Self> {
        let gpu = Gpu::open().map_err(device_failed)?;
        let shadow_map_size = if gpu.software { SMALL_SHADOW_MAP_SIZE } else { SHADOW_MAP_SIZE };
        let pipelines = Pipelines::new(&gpu.device);
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
            instances: buffer("instances", 64 * size_of::<uniforms::Instance>(), BufferUsages::STORAGE),
            projections: buffer("projections", 4 * UNIFORM_ALIGNMENT, BufferUsages::UNIFORM),
            smooth_edges: true,
            shadow_maps: ShadowMaps::new(&gpu, shadow_map_size, 1),
            shadow_map_size,
            targets: None,
            shown: None,
            cache,
            pipelines,
            gpu,
        };
        renderer.gpu.check().map_err(device_failed)?;
        log::info!("renderer wgpu on {}", renderer.adapter_info());
        Ok(renderer)
    }

    /// Whether edges in the colour image are smoothed by three more samples a pixel (on by default). Depth and labels
    /// always have one.
    #[must_use]
    pub fn with_smooth_edges(mut self, smooth_edges: bool) -> Self {
        self.smooth_edges = smooth_edges;
        self
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
            uniforms.push(uniforms::Instance {
                camera_from_mesh: camera_from_mesh.to_homogeneous().cast().into(),
                base_color: color_to_linear(material.base_color),
                roughness: material.roughness.clamp(MIN_ROUGHNESS, 1.0),
                metallic: material.metallic.clamp(0.0, 1.0),
                padding: [0; 3],
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
        let Intrinsics { fx, fy, cx, cy, .. } = *intrinsics;
        let (w, h) = (intrinsics.width as f64, intrinsics.height as f64);
        for (i, [du, dv]) in SUBPIXELS.into_iter().enumerate() {
            // Image point (u, v) is the centre of pixel (u, v), half a pixel inside its corner.
            let projection = [
                2.0 * fx / w,
                2.0 * fy / h,
                2.0 * (cx - du + 0.5) / w - 1.0,
                2.0 * (cy - dv + 0.5) / h - 1.0,
            ];
            let at = (i * UNIFORM_ALIGNMENT) as u64;
            let view = uniforms::View {
                projection: projection.map(|v| v as f32),
                near: NEAR as f32,
                padding: [0; 3],
            };
            self.gpu.queue.write_buffer(&self.projections, at, bytemuck::bytes_of(&view));
        }
        let bounce = lighting.bounce;
        let mut frame = Frame {
            intrinsics: [fx, fy, cx, cy].map(|v| v as f32),
            up: lighting.up.into(),
            padding: 0.0,
            sky: lighting.sky.into(),
            padding_2: 0.0,
            ground: lighting.ground.into(),
            bounce_radius: bounce.map_or(0.0, |b| b.radius),
            bounce_center: bounce.map_or([0.0; 3], |b| b.center.coords.into()),
            bounce_lowest: BOUNCE_LOWEST,
            bounce_lux: bounce.map_or([0.0; 3], |b| b.lux.into()),
            padding_3: 0.0,
            background: lighting.background,
            padding_4: 0.0,
            lights: Default::default(),
            layer_from_camera: [[[0.0; 4]; 4]; MAX_SHADOW_VIEWS],
        };
        let mut layer = 0;
        for (i, (light, shadow)) in lighting.lights.iter().zip(shadows).enumerate() {
            frame.lights[i] = uniforms::Light {
                position: light.position.coords.into(),
                cos_outer: light.cos_outer,
                axis: light.axis.into(),
                cos_inner: light.cos_inner,
                intensity: light.intensity.into(),
                radius: light.radius,
                tangent: 1.0,
                ..Default::default()
            };
            if let Some(views) = shadow {
                let uniform = &mut frame.lights[i];
                uniform.first_layer = layer as u32;
                uniform.faces = views.light_from_camera.len() as u32;
                uniform.tangent = views.tangent as f32;
                uniform.inverse_near = (1.0 / views.near) as f32;
                uniform.inverse_far = (1.0 / views.far) as f32;
                // One of a cube's: what a light without cubes goes by.
                uniform.view_from_camera = views.light_from_camera[0].into();
                let projection = views.projection();
                for rigid in &views.light_from_camera {
                    frame.layer_from_camera[layer] = (*rigid).into();
                    let matrix: [[f32; 4]; 4] = (projection * rigid).into();
                    self.gpu.queue.write_buffer(
                        &self.views,
                        (layer * UNIFORM_ALIGNMENT) as u64,
                        bytemuck::bytes_of(&matrix),
                    );
                    layer += 1;
                }
            }
        }
        self.gpu.queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&frame));
        layer
    }

    fn draw_shadows(&self, encoder: &mut CommandEncoder, drawn: &[&Instance], views: usize) {
        let group = bind(
            &self.gpu.device,
            &self.pipelines.view_group,
            &[slot::<[[f32; 4]; 4]>(&self.views), self.instances.as_entire_binding()],
        );
        for layer in 0..views {
            let mut pass = encoder.begin_render_pass(&RenderPassDescriptor {
                label: Some("shadow"),
                depth_stencil_attachment: Some(depth_buffer(
                    &self.shadow_maps.layers[layer],
                    1.0,
                    StoreOp::Store,
                )),
                ..Default::default()
            });
            pass.set_pipeline(&self.pipelines.shadow);
            pass.set_bind_group(0, &group, &[(layer * UNIFORM_ALIGNMENT) as u32]);
            for (i, instance) in drawn.iter().enumerate() {
                self.draw_mesh(&mut pass, i, instance, true);
            }
        }
    }

    fn draw_geometry(&self, encoder: &mut CommandEncoder, in_view: &[(usize, &Instance)], targets: &Targets) {
        let view = bind(
            &self.gpu.device,
            &self.pipelines.view_group,
            &[slot::<uniforms::View>(&self.projections), self.instances.as_entire_binding()],
        );
        let images = [&targets.depth, &targets.surface, &targets.cos, &targets.albedo, &targets.normal];
        let mut pass = encoder.begin_render_pass(&RenderPassDescriptor {
            label: Some("geometry"),
            color_attachments: &images.map(|view| Some(target(view))),
            depth_stencil_attachment: Some(depth_buffer(&targets.geometry_depth, 0.0, StoreOp::Discard)),
            ..Default::default()
        });
        pass.set_pipeline(&self.pipelines.geometry);
        pass.set_bind_group(0, &view, &[0]);
        for &(i, instance) in in_view {
            let texture = (!instance.visual.mesh.uvs.is_empty())
                .then_some(instance.visual.material.texture.as_ref())
                .flatten();
            pass.set_bind_group(1, self.cache.texture(texture), &[]);
            self.draw_mesh(&mut pass, i, instance, false);
        }
        drop(pass);

        if !self.smooth_edges {
            return;
        }
        for (sample, (surface, depth)) in (1..).zip(&targets.samples) {
            let mut pass = encoder.begin_render_pass(&RenderPassDescriptor {
                label: Some("sample"),
                color_attachments: &[Some(target(surface))],
                depth_stencil_attachment: Some(depth_buffer(depth, 0.0, StoreOp::Store)),
                ..Default::default()
            });
            pass.set_pipeline(&self.pipelines.sample);
            pass.set_bind_group(0, &view, &[sample * UNIFORM_ALIGNMENT as u32]);
            for &(i, instance) in in_view {
                self.draw_mesh(&mut pass, i, instance, true);
            }
        }
    }

    /// `lights` are what the light shader is made for.
    fn light_up(&self, encoder: &mut CommandEncoder, targets: &Targets, lights: Lights, new_geometry: bool) {
        let frame = bind(
            &self.gpu.device,
            &self.pipelines.frame_group,
            &[self.frame.as_entire_binding(), BindingResource::TextureView(&self.shadow_maps.all)],
        );
        if new_geometry {
            let groups = [&frame, &targets.prepare_group];
            whole_picture(encoder, &self.pipelines.prepare, &targets.prepared, &groups);
        }
        if lights.count > 0 {
            let shade = self.pipelines.shade(&self.gpu.device, lights);
            whole_picture(encoder, shade, &targets.shares[0], &[&frame, &targets.shade_group]);
            for (i, soften) in self.pipelines.soften.iter().enumerate() {
                whole_picture(encoder, soften, &targets.shares[1 - i], &[&targets.soften_groups[i]]);
            }
        }
        let lit = if self.smooth_edges { &targets.color } else { &targets.smooth };
        whole_picture(
            encoder,
            self.pipelines.light(&self.gpu.device, lights),
            lit,
            &[&frame, &targets.surface_group],
        );
        if self.smooth_edges {
            whole_picture(encoder, &self.pipelines.smooth, &targets.smooth, &[&targets.smooth_group]);
        }
    }

    fn draw_mesh(&self, pass: &mut RenderPass<'_>, index: usize, instance: &Instance, coarse: bool) {
        let mesh = self.cache.mesh(&instance.visual.mesh);
        let mesh = if coarse { &mesh.coarse } else { &mesh.fine };
        pass.set_vertex_buffer(0, mesh.vertices.slice(..));
        pass.set_index_buffer(mesh.indices.slice(..), IndexFormat::Uint32);
        let index = index as u32;
        pass.draw_indexed(0..mesh.index_count, 0, index..index + 1);
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
        self.gpu.check().map_err(device_failed)?;
        // Gone if anything fails: then nobody knows what the images show.
        let last = self.shown.take();
        let camera_from_world = *world_from_camera.inverse().iso();
        let lighting = ViewLighting::new(lighting, scene.bounce.as_ref(), world_from_camera);
        let drawn = self.upload(scene, &camera_from_world)?;
        let shadows = self.shadow_views(&drawn, &lighting, &camera_from_world);
        let views = self.write_frame(&lighting, &shadows, intrinsics);
        let lights = Lights {
            count: shadows.len(),
            cubes: shadows.iter().flatten().any(|views| views.light_from_camera.len() > 1),
        };
        if views > self.shadow_maps.layers.len() {
            self.shadow_maps = ShadowMaps::new(&self.gpu, self.shadow_map_size, views as u32);
        }
        let targets = match self.targets.take() {
            Some(targets) if (targets.width, targets.height) == (width, height) => targets,
            _ => Targets::new(&self.gpu, &self.pipelines, width, height),
        };

        // What stands behind the camera casts shadows into the picture, but need not be drawn.
        let mut in_view: Vec<(usize, &Instance)> = (0..)
            .zip(drawn.iter().copied())
            .filter(|(_, instance)| {
                let mesh = self.cache.mesh(&instance.visual.mesh);
                let center = camera_from_world * (instance.pose * mesh.center);
                may_be_seen(intrinsics, &center, mesh.radius)
            })
            .collect();
        // Small things mostly stand before large ones (objects, table, walls): drawn first, they spare what they hide.
        in_view.sort_by(|(_, a), (_, b)| {
            let radius = |instance: &Instance| self.cache.mesh(&instance.visual.mesh).radius;
            radius(a).total_cmp(&radius(b))
        });
        let shown = Shown::new(&drawn, intrinsics, world_from_camera);
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        self.draw_shadows(&mut encoder, &drawn, views);
        let new_geometry = last.as_ref() != Some(&shown);
        if new_geometry {
            self.draw_geometry(&mut encoder, &in_view, &targets);
        }
        self.light_up(&mut encoder, &targets, lights, new_geometry);
        targets.copy_back(&mut encoder);
        self.gpu.queue.submit([encoder.finish()]);

        let pixels = width * height;
        let mut depths = Vec::with_capacity(pixels);
        let mut label_data = Vec::with_capacity(pixels);
        let mut cosines = Vec::with_capacity(pixels);
        let mut luminances = Vec::with_capacity(pixels);
        // Instances count from 1; 0 is where nothing is hit.
        let labels: Vec<u16> = std::iter::once(0).chain(drawn.iter().map(|i| i.label)).collect();
        targets.read_rows(&self.gpu, |[depth, surface, cos, color]| {
            depths.extend(depth.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)));
            label_data.extend(
                surface.as_chunks().0.iter().map(|b| labels[(u32::from_le_bytes(*b) >> 16) as usize]),
            );
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
        self.shown = Some(shown);
        let whole = || failed("the picture came back incomplete");
        Ok(Rendering {
            radiance: Image::from_vec(width, height, luminances).ok_or_else(whole)?,
            depth: Image::from_vec(width, height, depths).ok_or_else(whole)?,
            labels: Image::from_vec(width, height, label_data).ok_or_else(whole)?,
            cos_incidence: Image::from_vec(width, height, cosines).ok_or_else(whole)?,
        })
    }
}

/// A depth buffer that begins at `clear`.
fn depth_buffer(view: &TextureView, clear: f32, store: StoreOp) -> RenderPassDepthStencilAttachment<'_> {
    let depth_ops = Some(Operations { load: LoadOp::Clear(clear), store });
    RenderPassDepthStencilAttachment { view, depth_ops, stencil_ops: None }
}

/// A target that begins at 0.
fn target(view: &TextureView) -> RenderPassColorAttachment<'_> {
    RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target: None,
        ops: Operations { load: LoadOp::Clear(Color::TRANSPARENT), store: StoreOp::Store },
    }
}

/// Runs a fragment shader on every pixel of `view`.
fn whole_picture(
    encoder: &mut CommandEncoder,
    pipeline: &RenderPipeline,
    view: &TextureView,
    groups: &[&BindGroup],
) {
    let mut pass = encoder.begin_render_pass(&RenderPassDescriptor {
        label: Some("whole picture"),
        color_attachments: &[Some(target(view))],
        ..Default::default()
    });
    pass.set_pipeline(pipeline);
    for (i, group) in (0..).zip(groups) {
        pass.set_bind_group(i, *group, &[]);
    }
    pass.draw(0..3, 0..1);
}

/// One `T` of a uniform buffer, at a dynamic offset.
fn slot<T>(buffer: &Buffer) -> BindingResource<'_> {
    BindingResource::Buffer(BufferBinding { buffer, offset: 0, size: NonZeroU64::new(size_of::<T>() as u64) })
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
