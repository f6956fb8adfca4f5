//! Many hypotheses of one object, rendered as depth images, compared with the frame and pulled towards it.
//!
//! Read in this order: `observation` (the frame, prepared), `lod` (a mesh, prepared), `raster` (draws one hypothesis),
//! `compare` (weighs it), `refine` (moves it), `lanes` (how all three become vector instructions).
//! [`Hypotheses`] is what a search asks for; [`Cpu`] does it on one thread, since searches run in parallel, [`Gpu`] on
//! a graphics adapter. `renderer` chooses between them.

mod compare;
mod gpu;
mod lod;
mod observation;
mod raster;
mod refine;
mod renderer;
#[cfg(test)]
mod scalar;
#[cfg(test)]
pub(crate) mod tests;

use std::sync::Arc;

use nalgebra::Isometry3;

pub use self::compare::Terms;
pub use self::gpu::{Gpu, GpuRenderer};
pub use self::lod::Lod;
pub use self::observation::{Level, Observation, STRIDES};
pub use self::raster::{Extent, FlatPlane};
pub use self::renderer::{HypothesisRenderer, HypothesisRendererChoice};

pub(crate) use self::lod::{simplify, weld};
pub(crate) use self::raster::{Raster, Tile, render_on};
pub use grip_sim::lanes::Isa;

use self::compare::compare;
use self::refine::{accumulate, step};
use crate::error::Result;

/// What the hypotheses of one batch share.
#[derive(Debug, Clone, Copy)]
pub struct Batch<'a> {
    /// The mesh that is rendered.
    pub lod: &'a Arc<Lod>,
    /// Half of the object's diameter, metres: the unit of its turns.
    pub radius: f32,
    /// The frame.
    pub observation: &'a Observation,
    /// Its resolution that is compared with, one of [`STRIDES`].
    pub stride: usize,
    /// Half-width of the kernel, in epsilons of the observation.
    pub kernel: f32,
    /// Gauss-Newton steps of each hypothesis before it is compared.
    pub steps: usize,
    /// Damping of these, relative to the diagonal of the normal equations.
    pub damping: f32,
    /// A step that moves no point of the object farther is a hypothesis's last, metres.
    pub converged_m: f32,
}

/// A hypothesis compared with the frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rendered {
    /// The sums over its pixels.
    pub terms: Terms,
    /// Where it is in the image, and its lowest point.
    pub extent: Extent,
}

/// Who renders hypotheses.
pub trait Hypotheses {
    /// Moves each pose (camera from object) by the batch's steps, then renders and compares it; the results are in the order
    /// of the poses. `None` for a pose that cannot be rendered: too near, behind the camera, out of the image.
    ///
    /// # Errors
    /// When a graphics device fails.
    fn advance(&mut self, batch: &Batch<'_>, poses: &mut [Isometry3<f32>]) -> Result<&[Option<Rendered>]>;
}

/// Renders on the CPU, in one thread.
#[derive(Debug, Default)]
pub struct Cpu {
    isa: Isa,
    raster: Raster,
    rendered: Vec<Option<Rendered>>,
}

impl Cpu {
    /// With these instructions.
    pub fn on(isa: Isa) -> Self {
        Self { isa, ..Self::default() }
    }
}

impl Hypotheses for Cpu {
    fn advance(&mut self, batch: &Batch<'_>, poses: &mut [Isometry3<f32>]) -> Result<&[Option<Rendered>]> {
        let Batch { lod, radius, observation, stride, kernel, .. } = *batch;
        let isa = self.isa;
        let (level, plane) = (observation.level(stride), observation.flat_plane());
        self.rendered.clear();
        for pose in poses {
            for _ in 0..batch.steps {
                // Where nothing can be rendered, nothing pulls.
                if render_on(isa, &mut self.raster, lod, pose, level, None).is_none() {
                    break;
                }
                let sums =
                    accumulate(isa, &self.raster.tile, level, kernel, &pose.translation.vector, radius);
                let last = *pose;
                *pose = step(pose, &sums, radius, batch.damping);
                let shift = (pose.translation.vector - last.translation.vector).norm();
                let turn = pose.rotation.angle_to(&last.rotation) * radius;
                if shift.max(turn) < batch.converged_m {
                    break;
                }
            }
            let extent = render_on(isa, &mut self.raster, lod, pose, level, plane.as_ref());
            self.rendered.push(
                extent
                    .map(|extent| Rendered { terms: compare(isa, &self.raster.tile, level, kernel), extent }),
            );
        }
        Ok(&self.rendered)
    }
}

/// Draws `lod` at camera-from-object `pose`, as [`render_on`] does, with the best instructions.
pub(crate) fn render(
    raster: &mut Raster,
    lod: &Lod,
    pose: &Isometry3<f32>,
    level: &Level,
    plane: Option<&FlatPlane>,
) -> Option<Extent> {
    render_on(Isa::best(), raster, lod, pose, level, plane)
}
