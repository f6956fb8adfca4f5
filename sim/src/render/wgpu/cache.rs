//! Meshes and textures on the device, uploaded once and found again by the identity of their `Arc`.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use image::RgbImage;
use nalgebra::{Point3, Vector3};
use wgpu::util::{BufferInitDescriptor, DeviceExt};
use wgpu::{
    AddressMode, BindGroup, BindGroupDescriptor, BindGroupEntry, BindGroupLayout, BindingResource, Buffer,
    BufferUsages, Extent3d, FilterMode, MipmapFilterMode, Origin3d, Sampler, SamplerDescriptor,
    TexelCopyBufferLayout, TexelCopyTextureInfo, TextureAspect, TextureDescriptor, TextureDimension,
    TextureFormat, TextureUsages, TextureViewDescriptor,
};

use crate::error::Result;
use crate::gpu::Gpu;
use crate::mesh::Mesh;
use crate::render::check::check_mesh;
use crate::render::pyramid::{MAX_ANISOTROPY, Pyramid};
use crate::render::srgb::LINEAR_OF_8BIT;

/// A vertex as `geometry.wgsl` reads it.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Vertex {
    position: [f32; 3],
    normal: [f32; 3],
    uv: [f32; 2],
    /// Linear light in 65535 steps, so that it is interpolated in linear light. The fourth is 0, or the largest where
    /// the vertex has a finish of its own.
    color: [u16; 4],
    /// Roughness and metallic in 255 steps.
    finish: [u8; 4],
}

/// A vertex of triangles that have one normal each, that of their first vertex.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct FlatVertex {
    position: [f32; 3],
    normal: [f32; 3],
}

/// Triangles on the device.
pub(super) struct Triangles {
    pub vertices: Buffer,
    pub indices: Buffer,
    pub index_count: u32,
}

/// A mesh on the device.
pub(super) struct GpuMesh {
    pub fine: Triangles,
    /// Of [`FlatVertex`], within [`COARSE_ERROR`]: for shadows and further samples, whose price on software adapters is that
    /// of their triangles.
    pub coarse: Triangles,
    /// Bounding sphere in the mesh's frame.
    pub center: Point3<f64>,
    pub radius: f64,
}

/// How far the coarse surface may be from the fine one, metres: a third of a pixel at 0.6 m.
const COARSE_ERROR: f64 = 0.0004;

/// Everything uploaded so far. It holds the `Arc`s, so that an address is never used twice.
pub(super) struct Cache {
    meshes: HashMap<usize, (Arc<Mesh>, GpuMesh)>,
    textures: HashMap<usize, (Arc<RgbImage>, BindGroup)>,
    white: BindGroup,
    sampler: Sampler,
}

/// Names a mesh or texture in the cache.
pub(super) fn key<T>(item: &Arc<T>) -> usize {
    Arc::as_ptr(item) as usize
}

impl Cache {
    pub fn new(gpu: &Gpu, layout: &BindGroupLayout) -> Self {
        let sampler = gpu.device.create_sampler(&SamplerDescriptor {
            label: Some("texture"),
            address_mode_u: AddressMode::Repeat,
            address_mode_v: AddressMode::Repeat,
            mag_filter: FilterMode::Linear,
            min_filter: FilterMode::Linear,
            mipmap_filter: MipmapFilterMode::Linear,
            anisotropy_clamp: MAX_ANISOTROPY,
            ..Default::default()
        });
        let white = RgbImage::from_pixel(1, 1, image::Rgb([255; 3]));
        let white = upload_texture(gpu, layout, &sampler, Pyramid::new(&white));
        Self { meshes: HashMap::new(), textures: HashMap::new(), white, sampler }
    }

    /// Drops what nobody else holds any more and so cannot come back.
    pub fn forget_unused(&mut self) {
        self.meshes.retain(|_, (arc, _)| Arc::strong_count(arc) > 1);
        self.textures.retain(|_, (arc, _)| Arc::strong_count(arc) > 1);
    }

    pub fn add_mesh(&mut self, gpu: &Gpu, mesh: &Arc<Mesh>) -> Result<()> {
        if let Entry::Vacant(entry) = self.meshes.entry(key(mesh)) {
            check_mesh("wgpu", mesh)?;
            entry.insert((mesh.clone(), upload_mesh(gpu, mesh)));
        }
        Ok(())
    }

    pub fn add_texture(&mut self, gpu: &Gpu, layout: &BindGroupLayout, image: &Arc<RgbImage>) {
        self.textures.entry(key(image)).or_insert_with(|| {
            let group = upload_texture(gpu, layout, &self.sampler, Pyramid::new(image));
            (image.clone(), group)
        });
    }

    /// The mesh; it must have been added.
    pub fn mesh(&self, mesh: &Arc<Mesh>) -> &GpuMesh {
        &self.meshes[&key(mesh)].1
    }

    /// The texture, or white where there is none.
    pub fn texture(&self, image: Option<&Arc<RgbImage>>) -> &BindGroup {
        image.and_then(|image| self.textures.get(&key(image))).map_or(&self.white, |(_, group)| group)
    }
}

fn upload_mesh(gpu: &Gpu, mesh: &Mesh) -> GpuMesh {
    let vertices: Vec<Vertex> = (0..mesh.positions.len())
        .map(|i| {
            let color = mesh.colors.get(i).map_or([u16::MAX; 3], |srgb| {
                srgb.map(|c| (LINEAR_OF_8BIT[c as usize] * 65535.0 + 0.5) as u16)
            });
            Vertex {
                position: mesh.positions[i].coords.into(),
                normal: mesh.normals[i].into(),
                uv: mesh.uvs.get(i).copied().unwrap_or_default(),
                color: [color[0], color[1], color[2], if mesh.finish.is_empty() { 0 } else { u16::MAX }],
                finish: mesh
                    .finish
                    .get(i)
                    .map_or([0; 4], |&[roughness, metallic]| [roughness, metallic, 0, 0]),
            }
        })
        .collect();
    let positions = || mesh.positions.iter().map(|p| p.cast::<f64>());
    let (low, high) = positions()
        .fold((Point3::from([f64::INFINITY; 3]), Point3::from([f64::NEG_INFINITY; 3])), |(low, high), p| {
            (low.inf(&p), high.sup(&p))
        });
    let center = nalgebra::center(&low, &high);
    let (flat, flat_indices) = coarse(mesh);
    GpuMesh {
        fine: upload(gpu, &vertices, mesh.triangles.as_flattened()),
        coarse: upload(gpu, &flat, &flat_indices),
        center,
        radius: positions().map(|p| nalgebra::distance(&p, &center)).fold(0.0, f64::max),
    }
}

fn upload<V: Pod>(gpu: &Gpu, vertices: &[V], indices: &[u32]) -> Triangles {
    let buffer = |label, contents: &[u8], usage| {
        gpu.device.create_buffer_init(&BufferInitDescriptor { label: Some(label), contents, usage })
    };
    Triangles {
        vertices: buffer("vertices", bytemuck::cast_slice(vertices), BufferUsages::VERTEX),
        indices: buffer("indices", bytemuck::cast_slice(indices), BufferUsages::INDEX),
        index_count: indices.len() as u32,
    }
}

/// The surface with as few triangles as [`COARSE_ERROR`] allows. The first vertex of each triangle belongs to it alone and
/// has its normal.
fn coarse(mesh: &Mesh) -> (Vec<FlatVertex>, Vec<u32>) {
    let Mesh { positions, mut triangles, .. } = mesh.simplified(COARSE_ERROR);
    let mut vertices: Vec<FlatVertex> =
        positions.iter().map(|p| FlatVertex { position: p.coords.into(), normal: [0.0; 3] }).collect();
    let mut taken = vec![false; vertices.len()];
    for corners in &mut triangles {
        let [a, b, c] = corners.map(|i| Vector3::from(vertices[i as usize].position));
        let normal = (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_default();
        if let Some(free) = corners.iter().position(|&i| !taken[i as usize]) {
            corners.rotate_left(free);
            taken[corners[0] as usize] = true;
        } else {
            vertices.push(vertices[corners[0] as usize]);
            taken.push(true);
            corners[0] = vertices.len() as u32 - 1;
        }
        vertices[corners[0] as usize].normal = normal.into();
    }
    (vertices, triangles.into_flattened())
}

/// Uploads all levels; white where there is no picture.
fn upload_texture(
    gpu: &Gpu,
    layout: &BindGroupLayout,
    sampler: &Sampler,
    pyramid: Option<Pyramid>,
) -> BindGroup {
    let levels = pyramid.map(|p| p.levels).unwrap_or_default();
    let (width, height) = levels.first().map_or((1, 1), |l| (l.width, l.height));
    let texture = gpu.device.create_texture(&TextureDescriptor {
        label: Some("texture"),
        size: Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: levels.len().max(1) as u32,
        sample_count: 1,
        dimension: TextureDimension::D2,
        // sRGB, decoded by the shader after filtering: a software adapter would decode eight texels a pixel.
        format: TextureFormat::Rgba8Unorm,
        usage: TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST,
        view_formats: &[],
    });
    let write = |mip_level, width, height, rgba: &[u8]| {
        gpu.queue.write_texture(
            TexelCopyTextureInfo {
                texture: &texture,
                mip_level,
                origin: Origin3d::ZERO,
                aspect: TextureAspect::All,
            },
            rgba,
            TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * width), rows_per_image: None },
            Extent3d { width, height, depth_or_array_layers: 1 },
        );
    };
    if levels.is_empty() {
        write(0, 1, 1, &[255; 4]);
    }
    for (i, level) in levels.iter().enumerate() {
        let rgba: Vec<u8> = level.texels.iter().flat_map(|&[r, g, b]| [r, g, b, 255]).collect();
        write(i as u32, level.width, level.height, &rgba);
    }
    gpu.device.create_bind_group(&BindGroupDescriptor {
        label: Some("texture"),
        layout,
        entries: &[
            BindGroupEntry {
                binding: 0,
                resource: BindingResource::TextureView(
                    &texture.create_view(&TextureViewDescriptor::default()),
                ),
            },
            BindGroupEntry { binding: 1, resource: BindingResource::Sampler(sampler) },
        ],
    })
}
