//! The three pipelines (shadow, geometry, colour) and the layouts of what they read; made once.

use wgpu::{
    BindGroupLayout, BindGroupLayoutDescriptor, BindGroupLayoutEntry, BindingType, BufferBindingType,
    ColorTargetState, CompareFunction, DepthStencilState, Device, FragmentState, MultisampleState,
    PipelineLayoutDescriptor, PrimitiveState, RenderPipeline, RenderPipelineDescriptor, SamplerBindingType,
    ShaderModule, ShaderModuleDescriptor, ShaderSource, ShaderStages, TextureFormat, TextureSampleType,
    TextureViewDimension, VertexBufferLayout, VertexState, VertexStepMode, vertex_attr_array,
};

use super::cache::Vertex;

/// Metres along the optical axis.
pub(super) const DEPTH: TextureFormat = TextureFormat::R32Float;
/// Instance labels.
pub(super) const LABELS: TextureFormat = TextureFormat::R32Uint;
/// Cosine of the angle of incidence.
pub(super) const COS: TextureFormat = TextureFormat::R32Float;
/// Luminance: half floats keep 11 bits, the finest that every adapter can multisample.
pub(super) const COLOR: TextureFormat = TextureFormat::Rgba16Float;
/// Depth buffers.
pub(super) const DEPTH_BUFFER: TextureFormat = TextureFormat::Depth32Float;

pub(super) struct Pipelines {
    pub shadow: RenderPipeline,
    pub geometry: RenderPipeline,
    pub color: RenderPipeline,
    /// The light's view and the instances.
    pub shadow_group: BindGroupLayout,
    /// Frame, instances, shadow maps.
    pub frame_group: BindGroupLayout,
    /// A texture and its sampler.
    pub texture_group: BindGroupLayout,
}

impl Pipelines {
    /// For a colour target of `samples` samples a pixel (1 or 4).
    pub fn new(device: &Device, samples: u32) -> Self {
        let scene = shader(device, "scene", include_str!("scene.wgsl"));
        let shadow = shader(device, "shadow", include_str!("shadow.wgsl"));

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
        let both = ShaderStages::VERTEX_FRAGMENT;
        let shadow_group =
            layout(device, &[(ShaderStages::VERTEX, uniform(true)), (ShaderStages::VERTEX, instances)]);
        let frame_group = layout(
            device,
            &[
                (both, uniform(false)),
                (both, instances),
                (ShaderStages::FRAGMENT, texture(TextureSampleType::Depth, TextureViewDimension::D2Array)),
                (ShaderStages::FRAGMENT, BindingType::Sampler(SamplerBindingType::Comparison)),
            ],
        );
        let texture_group = layout(
            device,
            &[
                (
                    ShaderStages::FRAGMENT,
                    texture(TextureSampleType::Float { filterable: true }, TextureViewDimension::D2),
                ),
                (ShaderStages::FRAGMENT, BindingType::Sampler(SamplerBindingType::Filtering)),
            ],
        );

        let pipeline = |stage: &Stage<'_>| {
            let layout = device.create_pipeline_layout(&PipelineLayoutDescriptor {
                label: Some(stage.label),
                bind_group_layouts: stage.groups,
                immediate_size: 0,
            });
            let targets: Vec<Option<ColorTargetState>> =
                stage.targets.iter().map(|&format| Some(format.into())).collect();
            device.create_render_pipeline(&RenderPipelineDescriptor {
                label: Some(stage.label),
                layout: Some(&layout),
                vertex: VertexState {
                    module: stage.module,
                    entry_point: Some(stage.vertex),
                    compilation_options: Default::default(),
                    buffers: &[Some(VertexBufferLayout {
                        array_stride: size_of::<Vertex>() as u64,
                        step_mode: VertexStepMode::Vertex,
                        attributes: &vertex_attr_array![
                            0 => Float32x3, 1 => Float32x3, 2 => Float32x2, 3 => Unorm16x4
                        ],
                    })],
                },
                // Both sides are drawn, so that open meshes (a sheet, a bin) have an inside.
                primitive: PrimitiveState::default(),
                depth_stencil: Some(DepthStencilState {
                    format: DEPTH_BUFFER,
                    depth_write_enabled: Some(stage.writes_depth),
                    depth_compare: Some(stage.nearer),
                    stencil: Default::default(),
                    bias: Default::default(),
                }),
                multisample: MultisampleState { count: stage.samples, ..Default::default() },
                fragment: stage.fragment.map(|entry_point| FragmentState {
                    module: stage.module,
                    entry_point: Some(entry_point),
                    compilation_options: Default::default(),
                    targets: &targets,
                }),
                multiview_mask: None,
                cache: None,
            })
        };
        let scene_groups = [Some(&frame_group), Some(&texture_group)];
        Self {
            shadow: pipeline(&Stage {
                label: "shadow",
                module: &shadow,
                vertex: "vs_shadow",
                fragment: None,
                groups: &[Some(&shadow_group)],
                targets: &[],
                nearer: CompareFunction::Less,
                writes_depth: true,
                samples: 1,
            }),
            geometry: pipeline(&Stage {
                label: "geometry",
                module: &scene,
                vertex: "vs_main",
                fragment: Some("fs_geometry"),
                groups: &scene_groups,
                targets: &[DEPTH, LABELS, COS],
                // The camera's depth buffer is reversed (1 near, 0 at infinity): even precision at all distances.
                nearer: CompareFunction::Greater,
                writes_depth: true,
                samples: 1,
            }),
            color: pipeline(&Stage {
                label: "color",
                module: &scene,
                vertex: "vs_main",
                fragment: Some("fs_color"),
                groups: &scene_groups,
                targets: &[COLOR],
                // With one sample it starts from the depths of the geometry pass and shades each pixel once.
                nearer: if samples == 1 { CompareFunction::Equal } else { CompareFunction::Greater },
                writes_depth: samples > 1,
                samples,
            }),
            shadow_group,
            frame_group,
            texture_group,
        }
    }
}

/// What differs between the pipelines.
struct Stage<'a> {
    label: &'a str,
    module: &'a ShaderModule,
    vertex: &'a str,
    fragment: Option<&'a str>,
    groups: &'a [Option<&'a BindGroupLayout>],
    targets: &'a [TextureFormat],
    nearer: CompareFunction,
    writes_depth: bool,
    samples: u32,
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
