//! What is asked of who renders hypotheses, and what comes back.

use std::sync::Arc;

use nalgebra::Isometry3;

use super::compare::Terms;
use super::lod::Lod;
use super::raster::Extent;
use crate::error::Result;
use crate::observation::{Observation, Stride};

/// What the hypotheses of one batch share.
#[derive(Debug, Clone, Copy)]
pub struct Batch<'a> {
    /// The mesh that is rendered.
    pub lod: &'a Arc<Lod>,
    /// Half of the object's diameter, metres: the unit of its turns.
    pub radius: f32,
    /// The frame.
    pub observation: &'a Observation,
    /// Its resolution that is compared with.
    pub stride: Stride,
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
