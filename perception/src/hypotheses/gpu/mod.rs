//! Hypotheses on a graphics adapter: one dispatch moves, renders and compares a whole batch, a workgroup each pose.

mod kept;
#[cfg(test)]
mod tests;

use std::num::NonZeroU64;
use std::sync::{Arc, Mutex, PoisonError, mpsc};

use bytemuck::{Pod, Zeroable};
use grip_sim::gpu::{Gpu as Device, GpuError};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use wgpu::{
    BindGroup, BindGroupDescriptor, BindGroupEntry, BindGroupLayout, BindGroupLayoutDescriptor,
    BindGroupLayoutEntry, BindingResource, BindingType, Buffer, BufferBinding, BufferBindingType,
    BufferDescriptor, BufferUsages, CommandEncoderDescriptor, ComputePassDescriptor, ComputePipeline,
    ComputePipelineDescriptor, MapMode, PipelineCompilationOptions, PipelineLayoutDescriptor, PollType,
    ShaderModuleDescriptor, ShaderSource, ShaderStages,
};

use self::kept::Kept;
use super::batch::{Batch, Hypotheses, Rendered};
use super::compare::Terms;
use super::lod::Lod;
use super::raster::Extent;
use crate::error::{Error, Result};
use crate::observation::Level;

const SHADER: &str = concat!(include_str!("hypotheses.wgsl"), include_str!("step.wgsl"));

/// Poses in one dispatch: drivers end a program that keeps the device for seconds.
const MOST_POSES: usize = 4096;
/// Levels kept on the device, 5 MB for the largest of a 640x480 frame: those of a few frames at a time.
const MOST_LEVELS: usize = 64;
/// Meshes kept on the device, about 30 kB each.
const MOST_MESHES: usize = 256;
/// Threads of a workgroup. Each thread must wait for the others a dozen times; on a software adapter, where they take
/// turns, that costs more than it brings.
const THREADS: usize = 256;
const SOFTWARE_THREADS: usize = 64;
/// Steps in one dispatch, for the same reason as [`MOST_POSES`];
const MOST_STEPS: usize = 16;
/// on a software adapter a step each: there a program that goes through its loops 65535 times is cut short.
const SOFTWARE_STEPS: usize = 1;
/// Few triangles are shared by several threads each, row by row, until there is work for this many times the threads:
/// half of the triangles face away, and the others differ in size. But no more than so many share one: each sets it up
/// anew.
const WORK: usize = 2;
const MOST_STRIPS: usize = 32;
/// Offsets into a uniform buffer must be multiples of this (the default limit of every adapter).
const UNIFORM_ALIGNMENT: usize = 256;

/// States of a hypothesis in the shader.
const UNSEEN: u32 = 0;
const COMPARED: u32 = 1;
const MOVING: u32 = 2;

/// `Batch` in the shader.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Uniforms {
    focal: [f32; 2],
    principal: [f32; 2],
    size: [i32; 2],
    pitch: i32,
    vertices: u32,
    triangles: u32,
    strips: u32,
    steps: u32,
    last: u32,
    kernel: f32,
    radius: f32,
    damping: f32,
    converged: f32,
    plane: [f32; 4],
}

/// `Hypothesis` in the shader.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Hypothesis {
    rotation: [f32; 4],
    translation: [f32; 3],
    state: u32,
    /// In the order of [`Terms`].
    terms: [f32; 7],
    lowest: f32,
    bounds: [f32; 4],
}

impl Hypothesis {
    fn new(pose: &Isometry3<f32>) -> Self {
        Self {
            rotation: pose.rotation.coords.into(),
            translation: pose.translation.vector.into(),
            state: MOVING,
            ..Self::zeroed()
        }
    }

    /// `None` when the pose that came in was no pose: it is not to be changed then.
    fn pose(&self) -> Option<Isometry3<f32>> {
        let finite = self.rotation.iter().chain(&self.translation).all(|x| x.is_finite());
        finite.then(|| {
            Isometry3::from_parts(
                Translation3::from(Vector3::from(self.translation)),
                UnitQuaternion::new_unchecked(Quaternion::from(self.rotation)),
            )
        })
    }

    fn rendered(&self) -> Result<Option<Rendered>> {
        let [rendered, hole, occluded, violated, fit, rim, edge] = self.terms;
        match self.state {
            UNSEEN => Ok(None),
            COMPARED => Ok(Some(Rendered {
                terms: Terms { rendered, hole, occluded, violated, fit, rim, edge },
                extent: Extent { bounds: self.bounds, lowest: self.lowest },
            })),
            _ => Err(Error::Gpu(
                "the driver gave up amid the work, as software ones do on large images; use --hypotheses cpu"
                    .to_owned(),
            )),
        }
    }
}

/// A mesh on the device.
#[derive(Debug, Clone)]
struct Mesh {
    vertices: Buffer,
    triangles: Buffer,
}

/// A graphics adapter that renders hypotheses, and what was uploaded to it. Searches in parallel share it, each with a
/// [`Gpu`] of its own.
#[derive(Debug)]
pub struct GpuRenderer {
    device: Device,
    layout: BindGroupLayout,
    pipeline: ComputePipeline,
    threads: usize,
    steps: usize,
    levels: Mutex<Kept<Level, Buffer>>,
    meshes: Mutex<Kept<Lod, Mesh>>,
}

impl GpuRenderer {
    /// Opens the best adapter there is, software ones included.
    ///
    /// # Errors
    /// When there is no adapter, or none that will do.
    pub fn open() -> Result<Self> {
        Self::on(Device::open().map_err(failed)?)
    }

    /// Opens the best adapter that is no software.
    ///
    /// # Errors
    /// When there is no such adapter, or none that will do.
    pub fn open_hardware() -> Result<Self> {
        Self::on(Device::open_hardware().map_err(|error| Error::Gpu(error.to_string()))?)
    }

    fn on(device: Device) -> Result<Self> {
        let (threads, steps) =
            if device.software { (SOFTWARE_THREADS, SOFTWARE_STEPS) } else { (THREADS, MOST_STEPS) };
        Self::new(device, threads, steps)
    }

    /// Name, kind, interface and driver of the adapter, for people.
    pub fn info(&self) -> &str {
        &self.device.info
    }

    /// Workgroups of `threads`, up to `steps` Gauss-Newton steps a dispatch.
    fn new(device: Device, threads: usize, steps: usize) -> Result<Self> {
        let storage = |read_only| BufferBindingType::Storage { read_only };
        let kinds = [BufferBindingType::Uniform, storage(true), storage(true), storage(true), storage(false)];
        let entries: Vec<BindGroupLayoutEntry> = kinds
            .into_iter()
            .zip(0..)
            .map(|(ty, binding)| BindGroupLayoutEntry {
                binding,
                visibility: ShaderStages::COMPUTE,
                ty: BindingType::Buffer { ty, has_dynamic_offset: binding == 0, min_binding_size: None },
                count: None,
            })
            .collect();
        let layout = device.device.create_bind_group_layout(&BindGroupLayoutDescriptor {
            label: Some("hypotheses"),
            entries: &entries,
        });
        let module = device.device.create_shader_module(ShaderModuleDescriptor {
            label: Some("hypotheses"),
            source: ShaderSource::Wgsl(SHADER.into()),
        });
        let pipeline = device.device.create_compute_pipeline(&ComputePipelineDescriptor {
            label: Some("hypotheses"),
            layout: Some(&device.device.create_pipeline_layout(&PipelineLayoutDescriptor {
                label: Some("hypotheses"),
                bind_group_layouts: &[Some(&layout)],
                immediate_size: 0,
            })),
            module: &module,
            entry_point: None,
            compilation_options: PipelineCompilationOptions {
                constants: &[("THREADS", threads as f64)],
                // The shader writes all of it before it reads.
                zero_initialize_workgroup_memory: false,
            },
            cache: None,
        });
        device.check().map_err(failed)?;
        Ok(Self {
            device,
            layout,
            pipeline,
            threads,
            steps,
            levels: Mutex::new(Kept::new(MOST_LEVELS)),
            meshes: Mutex::new(Kept::new(MOST_MESHES)),
        })
    }

    /// The buffer with the pixels of a level, as the shader reads them.
    fn level(&self, level: &Arc<Level>) -> Result<Buffer> {
        self.levels.lock().unwrap_or_else(PoisonError::into_inner).get(level, |level| {
            let sides = level.weight.iter().zip(&level.edge);
            let pixels = level.w.iter().zip(&level.tol).zip(sides);
            let pixels: Vec<[f32; 4]> =
                pixels.map(|((w, tol), (weight, edge))| [*w, *tol, *weight, *edge]).collect();
            self.upload("level", &pixels)
        })
    }

    fn mesh(&self, lod: &Arc<Lod>) -> Result<Mesh> {
        self.meshes.lock().unwrap_or_else(PoisonError::into_inner).get(lod, |lod| {
            let lanes = |[x, y, z]: &[grip_sim::lanes::F8; 3]| {
                let (x, y, z) = (x.0, y.0, z.0);
                (0..x.len()).map(move |i| [x[i], y[i], z[i], 0.0])
            };
            let vertices: Vec<[f32; 4]> = lod.blocks.iter().flat_map(lanes).collect();
            let triangles: Vec<[u32; 4]> = lod.triangles.iter().map(|&[a, b, c]| [a, b, c, 0]).collect();
            Ok(Mesh {
                vertices: self.upload("vertices", &vertices)?,
                triangles: self.upload("triangles", &triangles)?,
            })
        })
    }

    fn upload<T: Pod>(&self, label: &'static str, values: &[T]) -> Result<Buffer> {
        let bytes: &[u8] = bytemuck::cast_slice(values);
        let most = self.device.limits.max_storage_buffer_binding_size;
        if bytes.len() as u64 > most {
            return Err(Error::Gpu(format!(
                "{label} of {} MiB: {} MiB fit; use smaller images or models, or --hypotheses cpu",
                bytes.len() >> 20,
                most >> 20
            )));
        }
        let buffer = self.buffer(label, bytes.len(), BufferUsages::STORAGE | BufferUsages::COPY_DST);
        self.device.queue.write_buffer(&buffer, 0, bytes);
        Ok(buffer)
    }

    fn buffer(&self, label: &'static str, size: usize, usage: BufferUsages) -> Buffer {
        self.device.device.create_buffer(&BufferDescriptor {
            label: Some(label),
            size: size as u64,
            usage,
            mapped_at_creation: false,
        })
    }
}

/// What the device says, and how to do without it.
fn failed(error: GpuError) -> Error {
    Error::Gpu(format!("{error}, or use --hypotheses cpu"))
}

/// Where batches of up to `capacity` poses go and come from.
#[derive(Debug)]
struct Buffers {
    capacity: usize,
    /// Those of all dispatches but the last, and of the last, each at a multiple of [`UNIFORM_ALIGNMENT`].
    uniforms: Buffer,
    hypotheses: Buffer,
    readback: Buffer,
}

impl Buffers {
    fn new(renderer: &GpuRenderer, capacity: usize) -> Self {
        let size = capacity * size_of::<Hypothesis>();
        let (to, from) = (BufferUsages::COPY_DST, BufferUsages::COPY_SRC);
        Self {
            capacity,
            uniforms: renderer.buffer("batch", 2 * UNIFORM_ALIGNMENT, BufferUsages::UNIFORM | to),
            hypotheses: renderer.buffer("hypotheses", size, BufferUsages::STORAGE | to | from),
            readback: renderer.buffer("readback", size, BufferUsages::MAP_READ | to),
        }
    }
}

/// Renders on a graphics adapter. Equal batches give equal bits on one adapter and driver; other adapters, and the CPU,
/// round differently.
#[derive(Debug)]
pub struct Gpu {
    renderer: Arc<GpuRenderer>,
    buffers: Option<Buffers>,
    rendered: Vec<Option<Rendered>>,
}

impl Gpu {
    /// For one search.
    pub fn new(renderer: Arc<GpuRenderer>) -> Self {
        Self { renderer, buffers: None, rendered: Vec::new() }
    }

    /// Runs the shader on `poses`, of which there are some but not too many.
    fn dispatch(&mut self, batch: &Batch<'_>, poses: &mut [Isometry3<f32>]) -> Result<()> {
        let renderer = &*self.renderer;
        let Device { device, queue, .. } = &renderer.device;
        // After an error they stay away: a buffer may be left mapped.
        let buffers = match self.buffers.take() {
            Some(buffers) if buffers.capacity >= poses.len() => buffers,
            _ => Buffers::new(renderer, poses.len().next_power_of_two()),
        };
        let (uniforms, group) = bind(renderer, batch, &buffers)?;
        let hypotheses: Vec<Hypothesis> = poses.iter().map(Hypothesis::new).collect();
        let bytes: &[u8] = bytemuck::cast_slice(&hypotheses);
        let before = batch.steps.div_ceil(renderer.steps).saturating_sub(1);
        let rest = (batch.steps - before * renderer.steps) as u32;
        let rounds = [
            Uniforms { steps: renderer.steps as u32, last: 0, ..uniforms },
            Uniforms { steps: rest, last: 1, ..uniforms },
        ];
        for (round, at) in rounds.iter().zip([0, UNIFORM_ALIGNMENT as u64]) {
            queue.write_buffer(&buffers.uniforms, at, bytemuck::bytes_of(round));
        }
        queue.write_buffer(&buffers.hypotheses, 0, bytes);
        let mut encoder =
            device.create_command_encoder(&CommandEncoderDescriptor { label: Some("hypotheses") });
        {
            let mut pass = encoder.begin_compute_pass(&ComputePassDescriptor::default());
            pass.set_pipeline(&renderer.pipeline);
            for round in 0..=before {
                let last = usize::from(round == before);
                pass.set_bind_group(0, &group, &[(last * UNIFORM_ALIGNMENT) as u32]);
                pass.dispatch_workgroups(poses.len() as u32, 1, 1);
            }
        }
        let size = bytes.len() as u64;
        encoder.copy_buffer_to_buffer(&buffers.hypotheses, 0, &buffers.readback, 0, size);
        let submission = queue.submit([encoder.finish()]);

        // Another thread's wait may be what ends this one's, so the answer comes through a channel.
        let (sender, answer) = mpsc::channel();
        let slice = buffers.readback.slice(..size);
        slice.map_async(MapMode::Read, move |result| {
            let _ = sender.send(result.is_ok());
        });
        let unreadable =
            |what: String| Error::Gpu(format!("results cannot be read back: {what}; try --hypotheses cpu"));
        device
            .poll(PollType::Wait { submission_index: Some(submission), timeout: None })
            .map_err(|error| renderer.device.check().err().map_or(unreadable(error.to_string()), failed))?;
        renderer.device.check().map_err(failed)?;
        if !answer.recv().unwrap_or(false) {
            return Err(unreadable("the device refused".to_owned()));
        }
        let view = slice.get_mapped_range().map_err(|error| unreadable(error.to_string()))?;
        for (pose, bytes) in poses.iter_mut().zip(view.chunks_exact(size_of::<Hypothesis>())) {
            let result: Hypothesis = bytemuck::pod_read_unaligned(bytes);
            *pose = result.pose().unwrap_or(*pose);
            self.rendered.push(result.rendered()?);
        }
        drop(view);
        buffers.readback.unmap();
        self.buffers = Some(buffers);
        Ok(())
    }
}

/// What the shader reads beside the poses; the uniforms without what differs between dispatches.
fn bind(renderer: &GpuRenderer, batch: &Batch<'_>, buffers: &Buffers) -> Result<(Uniforms, BindGroup)> {
    let level = batch.observation.shared_level(batch.stride);
    let pixels = renderer.level(level)?;
    let mesh = renderer.mesh(batch.lod)?;
    let (normal, offset) = batch.observation.flat_plane().unwrap_or_default();
    let triangles = batch.lod.triangles.len();
    let uniforms = Uniforms {
        focal: [level.fx, level.fy],
        principal: [level.cx, level.cy],
        size: [level.width as i32, level.height as i32],
        pitch: level.pitch as i32,
        vertices: (mesh.vertices.size() / 16) as u32,
        triangles: triangles as u32,
        strips: (WORK * renderer.threads / triangles.max(1)).clamp(1, MOST_STRIPS) as u32,
        steps: 0,
        last: 0,
        kernel: batch.kernel,
        radius: batch.radius,
        damping: batch.damping,
        converged: batch.converged_m,
        plane: [normal.x, normal.y, normal.z, offset],
    };
    let round = BindingResource::Buffer(BufferBinding {
        buffer: &buffers.uniforms,
        offset: 0,
        size: NonZeroU64::new(size_of::<Uniforms>() as u64),
    });
    let whole = [&pixels, &mesh.vertices, &mesh.triangles, &buffers.hypotheses];
    let entries: Vec<BindGroupEntry<'_>> = std::iter::once(round)
        .chain(whole.map(Buffer::as_entire_binding))
        .zip(0..)
        .map(|(resource, binding)| BindGroupEntry { binding, resource })
        .collect();
    let descriptor = BindGroupDescriptor { label: None, layout: &renderer.layout, entries: &entries };
    Ok((uniforms, renderer.device.device.create_bind_group(&descriptor)))
}

impl Hypotheses for Gpu {
    fn advance(&mut self, batch: &Batch<'_>, poses: &mut [Isometry3<f32>]) -> Result<&[Option<Rendered>]> {
        self.rendered.clear();
        for some in poses.chunks_mut(MOST_POSES) {
            self.dispatch(batch, some)?;
        }
        Ok(&self.rendered)
    }
}
