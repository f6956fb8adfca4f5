//! The images that are drawn into, and their way back to main memory.

use wgpu::{
    BindGroup, BindingResource, Buffer, BufferDescriptor, BufferUsages, CommandEncoder, Extent3d, MapMode,
    PollType, TexelCopyBufferInfo, TexelCopyBufferLayout, Texture, TextureDescriptor, TextureDimension,
    TextureFormat, TextureUsages, TextureView, TextureViewDescriptor, TextureViewDimension,
};

use super::pipelines::{
    ALBEDO, COLOR, COS, DEPTH, DEPTH_BUFFER, NORMAL, PREPARED, Pipelines, SHADOW_DEPTH, SHARES, SURFACE, bind,
};
use super::{device_failed, failed};
use crate::error::Result;
use crate::gpu::Gpu;

/// Rows in a copy start at multiples of this many bytes (`COPY_BYTES_PER_ROW_ALIGNMENT`).
const ROW_ALIGNMENT: usize = 256;

/// Targets for one image size.
pub(super) struct Targets {
    pub width: usize,
    pub height: usize,
    pub geometry_depth: TextureView,
    pub depth: TextureView,
    pub surface: TextureView,
    pub cos: TextureView,
    pub albedo: TextureView,
    pub normal: TextureView,
    pub prepared: TextureView,
    /// Shares of each light that arrive: by single rays and in the end, and on the way from one to the other.
    pub shares: [TextureView; 2],
    /// Luminance before edges are smoothed, and after.
    pub color: TextureView,
    pub smooth: TextureView,
    /// Three more samples of each pixel and their depth buffers.
    pub samples: [(TextureView, TextureView); 3],
    pub prepare_group: BindGroup,
    pub shade_group: BindGroup,
    /// With each of `shares`.
    pub soften_groups: [BindGroup; 2],
    pub surface_group: BindGroup,
    pub smooth_group: BindGroup,
    readback: Buffer,
    /// In the buffer's order.
    copies: [Copy; 4],
}

/// A texture that is read back, and where in the buffer it goes.
struct Copy {
    texture: Texture,
    offset: usize,
    pixel: usize,
    row: usize,
}

impl Targets {
    pub fn new(gpu: &Gpu, pipelines: &Pipelines, width: usize, height: usize) -> Self {
        let texture = |format, layers, usage| {
            gpu.device.create_texture(&TextureDescriptor {
                label: Some("target"),
                size: Extent3d { width: width as u32, height: height as u32, depth_or_array_layers: layers },
                mip_level_count: 1,
                sample_count: 1,
                dimension: TextureDimension::D2,
                format,
                usage: TextureUsages::RENDER_ATTACHMENT | usage,
                view_formats: &[],
            })
        };
        let bound = TextureUsages::TEXTURE_BINDING;
        let view = |texture: &Texture| texture.create_view(&TextureViewDescriptor::default());
        let mut end = 0;
        let mut copy = |format: TextureFormat| {
            let pixel = format.block_copy_size(None).unwrap_or(16) as usize;
            let row = (width * pixel).next_multiple_of(ROW_ALIGNMENT);
            let offset = end;
            end += row * height;
            Copy { texture: texture(format, 1, TextureUsages::COPY_SRC | bound), offset, pixel, row }
        };
        let copies = [copy(DEPTH), copy(SURFACE), copy(COS), copy(COLOR)];
        let [depth, surface, cos, smooth] = [0, 1, 2, 3].map(|i: usize| view(&copies[i].texture));
        let [albedo, normal, color, prepared] =
            [ALBEDO, NORMAL, COLOR, PREPARED].map(|format| view(&texture(format, 1, bound)));
        let shares = [SHARES, SHARES].map(|format| view(&texture(format, 1, bound)));
        let [sample, sample_depth] = [SURFACE, DEPTH_BUFFER].map(|format| texture(format, 3, bound));
        let layer = |texture: &Texture, base_array_layer| {
            texture.create_view(&TextureViewDescriptor {
                dimension: Some(TextureViewDimension::D2),
                base_array_layer,
                array_layer_count: Some(1),
                ..Default::default()
            })
        };
        let group = |layout, views: &[&TextureView]| {
            let resources: Vec<_> = views.iter().map(|view| BindingResource::TextureView(view)).collect();
            bind(&gpu.device, layout, &resources)
        };
        Self {
            width,
            height,
            geometry_depth: view(&texture(DEPTH_BUFFER, 1, TextureUsages::empty())),
            surface_group: group(
                &pipelines.surface_group,
                &[&depth, &albedo, &normal, &prepared, &shares[0]],
            ),
            shade_group: group(&pipelines.shade_group, &[&depth, &normal]),
            soften_groups: [0, 1].map(|i| group(&pipelines.soften_group, &[&surface, &shares[i]])),
            prepare_group: group(&pipelines.prepare_group, &[&depth, &surface, &normal]),
            smooth_group: group(
                &pipelines.smooth_group,
                &[&depth, &surface, &color, &view(&sample), &view(&sample_depth), &prepared],
            ),
            samples: [0, 1, 2].map(|i| (layer(&sample, i), layer(&sample_depth, i))),
            depth,
            surface,
            cos,
            albedo,
            normal,
            prepared,
            shares,
            color,
            smooth,
            readback: gpu.device.create_buffer(&BufferDescriptor {
                label: Some("readback"),
                size: end as u64,
                usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
                mapped_at_creation: false,
            }),
            copies,
        }
    }

    /// Has the images copied when the work before it is done.
    pub fn copy_back(&self, encoder: &mut CommandEncoder) {
        for copy in &self.copies {
            encoder.copy_texture_to_buffer(
                copy.texture.as_image_copy(),
                TexelCopyBufferInfo {
                    buffer: &self.readback,
                    layout: TexelCopyBufferLayout {
                        offset: copy.offset as u64,
                        bytes_per_row: Some(copy.row as u32),
                        rows_per_image: None,
                    },
                },
                copy.texture.size(),
            );
        }
    }

    /// Waits for the device, then calls `read(depth, surface, cos, color)` for each row in turn.
    pub fn read_rows(&self, gpu: &Gpu, mut read: impl FnMut([&[u8]; 4])) -> Result<()> {
        let slice = self.readback.slice(..);
        slice.map_async(MapMode::Read, |_| {});
        let unreadable = |what: String| failed(format!("the picture cannot be read back: {what}"));
        gpu.device.poll(PollType::wait_indefinitely()).map_err(|error| unreadable(error.to_string()))?;
        gpu.check().map_err(device_failed)?;
        let view = slice.get_mapped_range().map_err(|error| unreadable(error.to_string()))?;
        for v in 0..self.height {
            read(std::array::from_fn(|i| {
                let copy = &self.copies[i];
                let start = copy.offset + v * copy.row;
                &view[start..start + self.width * copy.pixel]
            }));
        }
        drop(view);
        self.readback.unmap();
        Ok(())
    }
}

/// The shadow maps of all lights, one layer a view.
pub(super) struct ShadowMaps {
    pub layers: Vec<TextureView>,
    pub all: TextureView,
}

impl ShadowMaps {
    pub fn new(gpu: &Gpu, size: u32, layers: u32) -> Self {
        let texture = gpu.device.create_texture(&TextureDescriptor {
            label: Some("shadow maps"),
            size: Extent3d { width: size, height: size, depth_or_array_layers: layers },
            mip_level_count: 1,
            sample_count: 1,
            dimension: TextureDimension::D2,
            format: SHADOW_DEPTH,
            usage: TextureUsages::RENDER_ATTACHMENT | TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        let view = |dimension, base_array_layer, count| {
            texture.create_view(&TextureViewDescriptor {
                dimension: Some(dimension),
                base_array_layer,
                array_layer_count: Some(count),
                ..Default::default()
            })
        };
        Self {
            layers: (0..layers).map(|layer| view(TextureViewDimension::D2, layer, 1)).collect(),
            all: view(TextureViewDimension::D2Array, 0, layers),
        }
    }
}
