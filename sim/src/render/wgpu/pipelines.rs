//! The pipelines (shadow maps, geometry, shade, light, smooth edges) and the layouts of what they read; made once.

use std::cell::OnceCell;

use wgpu::{
    BindGroup, BindGroupDescriptor, BindGroupEntry, BindGroupLayout, BindGroupLayoutDescriptor,
    BindGroupLayoutEntry, BindingResource, BindingType, BufferBindingType, ColorTargetState, CompareFunction,
    DepthStencilState, Device, FragmentState, MultisampleState, PipelineCompilationOptions,
    PipelineLayoutDescriptor, PrimitiveState, RenderPipeline, RenderPipelineDescriptor, SamplerBindingType,
    ShaderModule, ShaderModuleDescriptor, ShaderSource, ShaderStages, TextureFormat, TextureSampleType,
    TextureViewDimension, VertexBufferLayout, VertexState, VertexStepMode, vertex_attr_array,
};

use super::cache::{FlatVertex, Vertex};
use super::shaders;
use crate::render::shading::MAX_LIGHTS;

/// Metres along the optical axis.
pub(super) const DEPTH: TextureFormat = TextureFormat::R32Float;
/// Instance and normal: what tells surfaces apart.
pub(super) const SURFACE: TextureFormat = TextureFormat::R32Uint;
/// Cosine of the angle of incidence.
pub(super) const COS: TextureFormat = TextureFormat::R32Float;
/// Luminance: half floats keep 11 bits, the finest that every adapter can blend.
pub(super) const COLOR: TextureFormat = TextureFormat::Rgba16Float;
/// Depth buffers.
pub(super) const DEPTH_BUFFER: TextureFormat = TextureFormat::Depth32Float;
/// Depth buffers of lights, in steps of a few hundredths of a millimetre between its nearest and its farthest object.
pub(super) const SHADOW_DEPTH: TextureFormat = TextureFormat::Depth16Unorm;

/// Square root of linear colour, and roughness.
pub(super) const ALBEDO: TextureFormat = TextureFormat::Rgba8Unorm;
/// Normal, each component from 0 to 1, and metallic: 0, 1/3, 2/3 or 1.
pub(super) const NORMAL: TextureFormat = TextureFormat::Rgb10a2Unorm;

/// Open share of the ambient light, and whether the pixel is an edge.
pub(super) const PREPARED: TextureFormat = TextureFormat::Rg8Unorm;

/// Share of each of four lights that arrives.
pub(super) const SHARES: TextureFormat = TextureFormat::Rgba8Unorm;

pub(super) struct Pipelines {
    pub shadow: RenderPipeline,
    pub geometry: RenderPipeline,
    /// Draws one more sample of each pixel.
    pub sample: RenderPipeline,
    /// What does not depend on the light: ambient occlusion and edges.
    pub prepare: RenderPipeline,
    /// One for each number of lights, without and with cubes, made when first needed. Told by a uniform instead, Mesa's
    /// software driver would translate the shader anew for each frame.
    shades: [[OnceCell<RenderPipeline>; 2]; MAX_LIGHTS + 1],
    shade: ShaderModule,
    /// Along rows and along columns.
    pub soften: [RenderPipeline; 2],
    /// One for each number of lights.
    lights: [OnceCell<RenderPipeline>; MAX_LIGHTS + 1],
    light: ShaderModule,
    pub smooth: RenderPipeline,
    /// View and instances.
    pub view_group: BindGroupLayout,
    /// A texture and its sampler.
    pub texture_group: BindGroupLayout,
    /// Frame and shadow maps.
    pub frame_group: BindGroupLayout,
    /// Depth, surface, normal.
    pub prepare_group: BindGroupLayout,
    /// Depth, normal.
    pub shade_group: BindGroupLayout,
    /// Surface, shares.
    pub soften_group: BindGroupLayout,
    /// Depth, albedo, normal, prepared, shares.
    pub surface_group: BindGroupLayout,
    /// Depth, surface, colour, samples and their depth buffers, prepared.
    pub smooth_group: BindGroupLayout,
}

impl Pipelines {
    pub fn new(device: &Device) -> Self {
        let shadow = shader(device, "shadow", shaders::SHADOW);
        let geometry = shader(device, "geometry", shaders::GEOMETRY);
        let prepare = shader(device, "prepare", shaders::PREPARE);
        let shade = shader(device, "shade", shaders::SHADE);
        let soften = shader(device, "soften", shaders::SOFTEN);
        let light = shader(device, "light", shaders::LIGHT);
        let smooth = shader(device, "smooth", shaders::SMOOTH);

        let uniform = |has_dynamic_offset| BindingType::Buffer {
            ty: BufferBindingType::Uniform,
            has_dynamic_offset,
            min_binding_size: None,
        };
        let instances = BindingType::Buffer {
            ty: BufferBindingType::Storage { read_only: true },
            has_dynamic_offset: false,
            min_binding_size: None,
        };
        let image = |sample_type| texture(sample_type, TextureViewDimension::D2);
        let floats = image(TextureSampleType::Float { filterable: false });
        let array = |sample_type| texture(sample_type, TextureViewDimension::D2Array);
        let (vertex, fragment) = (ShaderStages::VERTEX, ShaderStages::FRAGMENT);
        let view_group = layout(device, &[(vertex, uniform(true)), (vertex, instances)]);
        let texture_group = layout(
            device,
            &[
                (fragment, image(TextureSampleType::Float { filterable: true })),
                (fragment, BindingType::Sampler(SamplerBindingType::Filtering)),
            ],
        );
        let frame_group =
            layout(device, &[(fragment, uniform(false)), (fragment, array(TextureSampleType::Depth))]);
        let shade_group = layout(device, &[(fragment, floats); 2]);
        let soften_group = layout(device, &[(fragment, image(TextureSampleType::Uint)), (fragment, floats)]);
        let surface_group = layout(device, &[(fragment, floats); 5]);
        let prepare_group = layout(
            device,
            &[(fragment, floats), (fragment, image(TextureSampleType::Uint)), (fragment, floats)],
        );
        let smooth_group = layout(
            device,
            &[
                (fragment, floats),
                (fragment, image(TextureSampleType::Uint)),
                (fragment, floats),
                (fragment, array(TextureSampleType::Uint)),
                (fragment, array(TextureSampleType::Depth)),
                (fragment, floats),
            ],
        );

        let writes = |format: TextureFormat| Some(ColorTargetState::from(format));
        // The camera's depth buffer is reversed (1 near, 0 at infinity): even precision at all distances.
        let nearer = Some((DEPTH_BUFFER, CompareFunction::Greater));
        let drawn = Stage {
            label: "geometry",
            module: &geometry,
            vertex: "vs_main",
            vertices: Vertices::Full,
            fragment: Some("fs_geometry"),
            groups: &[Some(&view_group), Some(&texture_group)],
            targets: &[DEPTH, SURFACE, COS, ALBEDO, NORMAL].map(writes),
            depth: nearer,
            constants: &[],
        };
        Self {
            shadow: pipeline(
                device,
                &Stage {
                    label: "shadow",
                    module: &shadow,
                    vertex: "vs_shadow",
                    vertices: Vertices::Flat,
                    fragment: None,
                    groups: &[Some(&view_group)],
                    targets: &[],
                    depth: Some((SHADOW_DEPTH, CompareFunction::Less)),
                    constants: &[],
                },
            ),
            geometry: pipeline(device, &drawn),
            sample: pipeline(
                device,
                &Stage {
                    label: "sample",
                    vertex: "vs_sample",
                    vertices: Vertices::Flat,
                    fragment: Some("fs_sample"),
                    groups: &[Some(&view_group)],
                    targets: &[writes(SURFACE)],
                    ..drawn
                },
            ),
            prepare: pipeline(
                device,
                &Stage {
                    label: "prepare",
                    fragment: Some("fs_prepare"),
                    groups: &[Some(&frame_group), Some(&prepare_group)],
                    targets: &[writes(PREPARED)],
                    ..Stage::whole(&prepare)
                },
            ),
            shades: Default::default(),
            shade,
            soften: [1.0, 0.0].map(|along_rows| {
                pipeline(
                    device,
                    &Stage {
                        label: "soften",
                        fragment: Some("fs_soften"),
                        groups: &[Some(&soften_group)],
                        targets: &[writes(SHARES)],
                        constants: &[("ALONG_ROWS", along_rows)],
                        ..Stage::whole(&soften)
                    },
                )
            }),
            lights: Default::default(),
            light,
            smooth: pipeline(
                device,
                &Stage {
                    label: "smooth",
                    fragment: Some("fs_smooth"),
                    groups: &[Some(&smooth_group)],
                    targets: &[writes(COLOR)],
                    ..Stage::whole(&smooth)
                },
            ),
            view_group,
            texture_group,
            frame_group,
            prepare_group,
            shade_group,
            soften_group,
            surface_group,
            smooth_group,
        }
    }

    pub fn shade(&self, device: &Device, lights: Lights) -> &RenderPipeline {
        self.shades[lights.count][usize::from(lights.cubes)].get_or_init(|| {
            pipeline(
                device,
                &Stage {
                    label: "shade",
                    fragment: Some("fs_shade"),
                    groups: &[Some(&self.frame_group), Some(&self.shade_group)],
                    targets: &[Some(ColorTargetState::from(SHARES))],
                    constants: &[
                        ("LIGHT_COUNT", lights.count as f64),
                        ("CUBES", f64::from(u8::from(lights.cubes))),
                    ],
                    ..Stage::whole(&self.shade)
                },
            )
        })
    }

    pub fn light(&self, device: &Device, lights: Lights) -> &RenderPipeline {
        self.lights[lights.count].get_or_init(|| {
            pipeline(
                device,
                &Stage {
                    label: "light",
                    fragment: Some("fs_light"),
                    groups: &[Some(&self.frame_group), Some(&self.surface_group)],
                    targets: &[Some(ColorTargetState::from(COLOR))],
                    constants: &[("LIGHT_COUNT", lights.count as f64)],
                    ..Stage::whole(&self.light)
                },
            )
        })
    }
}

/// What the shaders of light and shade are made for.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lights {
    /// At most [`MAX_LIGHTS`].
    pub count: usize,
    /// Whether any shadow map is a cube.
    pub cubes: bool,
}

fn pipeline(device: &Device, stage: &Stage<'_>) -> RenderPipeline {
    let layout = device.create_pipeline_layout(&PipelineLayoutDescriptor {
        label: Some(stage.label),
        bind_group_layouts: stage.groups,
        immediate_size: 0,
    });
    let flat = [Some(VertexBufferLayout {
        array_stride: size_of::<FlatVertex>() as u64,
        step_mode: VertexStepMode::Vertex,
        attributes: &vertex_attr_array![0 => Float32x3, 1 => Float32x3],
    })];
    let full = [Some(VertexBufferLayout {
        array_stride: size_of::<Vertex>() as u64,
        step_mode: VertexStepMode::Vertex,
        attributes: &vertex_attr_array![
            0 => Float32x3, 1 => Float32x3, 2 => Float32x2, 3 => Unorm16x4, 4 => Unorm8x4
        ],
    })];
    device.create_render_pipeline(&RenderPipelineDescriptor {
        label: Some(stage.label),
        layout: Some(&layout),
        vertex: VertexState {
            module: stage.module,
            entry_point: Some(stage.vertex),
            compilation_options: Default::default(),
            buffers: match stage.vertices {
                Vertices::None => &[],
                Vertices::Flat => &flat,
                Vertices::Full => &full,
            },
        },
        // Both sides are drawn, so that open meshes (a sheet, a bin) have an inside.
        primitive: PrimitiveState::default(),
        depth_stencil: stage.depth.map(|(format, compare)| DepthStencilState {
            format,
            depth_write_enabled: Some(true),
            depth_compare: Some(compare),
            stencil: Default::default(),
            bias: Default::default(),
        }),
        multisample: MultisampleState::default(),
        fragment: stage.fragment.map(|entry_point| FragmentState {
            module: stage.module,
            entry_point: Some(entry_point),
            compilation_options: PipelineCompilationOptions {
                constants: stage.constants,
                ..Default::default()
            },
            targets: stage.targets,
        }),
        multiview_mask: None,
        cache: None,
    })
}

/// What a vertex stage reads.
#[derive(Clone, Copy)]
enum Vertices {
    None,
    /// [`FlatVertex`].
    Flat,
    /// [`Vertex`].
    Full,
}

/// What differs between the pipelines.
#[derive(Clone, Copy)]
struct Stage<'a> {
    label: &'a str,
    module: &'a ShaderModule,
    vertex: &'a str,
    vertices: Vertices,
    fragment: Option<&'a str>,
    groups: &'a [Option<&'a BindGroupLayout>],
    targets: &'a [Option<ColorTargetState>],
    /// The depth buffer, and what passes it.
    depth: Option<(TextureFormat, CompareFunction)>,
    /// Values of the fragment shader's `override` declarations.
    constants: &'a [(&'a str, f64)],
}

impl<'a> Stage<'a> {
    /// Covers the picture and reads no mesh.
    fn whole(module: &'a ShaderModule) -> Self {
        Self {
            label: "whole picture",
            module,
            vertex: "vs_whole",
            vertices: Vertices::None,
            fragment: None,
            groups: &[],
            targets: &[],
            depth: None,
            constants: &[],
        }
    }
}

fn shader(device: &Device, label: &str, source: &'static str) -> ShaderModule {
    device.create_shader_module(ShaderModuleDescriptor {
        label: Some(label),
        source: ShaderSource::Wgsl(source.into()),
    })
}

fn layout(device: &Device, bindings: &[(ShaderStages, BindingType)]) -> BindGroupLayout {
    let entries: Vec<BindGroupLayoutEntry> = bindings
        .iter()
        .enumerate()
        .map(|(i, &(visibility, ty))| BindGroupLayoutEntry { binding: i as u32, visibility, ty, count: None })
        .collect();
    device.create_bind_group_layout(&BindGroupLayoutDescriptor { label: None, entries: &entries })
}

fn texture(sample_type: TextureSampleType, view_dimension: TextureViewDimension) -> BindingType {
    BindingType::Texture { sample_type, view_dimension, multisampled: false }
}

/// A bind group of `resources` in the order of `layout`.
pub(super) fn bind(
    device: &Device,
    layout: &BindGroupLayout,
    resources: &[BindingResource<'_>],
) -> BindGroup {
    let entries: Vec<BindGroupEntry<'_>> = resources
        .iter()
        .enumerate()
        .map(|(i, resource)| BindGroupEntry { binding: i as u32, resource: resource.clone() })
        .collect();
    device.create_bind_group(&BindGroupDescriptor { label: None, layout, entries: &entries })
}
