//! Many hypotheses of one object, rendered as depth images, compared with the frame and pulled towards it.
//!
//! Read in this order: `lod` (a mesh, prepared), `raster` (draws one hypothesis), `compare` (weighs it), `refine` (moves it),
//! `grip_sim::lanes` (how all three become vector instructions). [`Hypotheses`] is what a search asks for; [`Cpu`] does it on
//! one thread, since searches run in parallel, [`Gpu`] on a graphics adapter. `renderer` chooses between them.

mod batch;
mod compare;
mod cpu;
mod gpu;
mod lod;
mod raster;
mod refine;
mod renderer;
#[cfg(test)]
mod scalar;
#[cfg(test)]
pub(crate) mod tests;

pub use self::batch::{Batch, Hypotheses, Rendered};
pub use self::compare::Terms;
pub use self::cpu::Cpu;
pub use self::gpu::{Gpu, GpuRenderer};
pub use self::lod::Lod;
pub use self::raster::Extent;
pub use self::renderer::{HypothesisRenderer, HypothesisRendererChoice};
pub use grip_sim::lanes::Isa;

pub(crate) use self::lod::{simplify, weld};
#[cfg(feature = "bench")]
pub(crate) use self::raster::render_on;
pub(crate) use self::raster::{Raster, Tile, render};
