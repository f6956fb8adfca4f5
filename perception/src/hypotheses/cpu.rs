//! Hypotheses on the CPU.

use grip_sim::lanes::Isa;
use nalgebra::Isometry3;

use super::batch::{Batch, Hypotheses, Rendered};
use super::compare::compare;
use super::raster::{Raster, render_on};
use super::refine::{accumulate, step};
use crate::error::Result;

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
