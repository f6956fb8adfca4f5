//! Who renders hypotheses: the choice, and what came of it.

use std::fmt;
use std::sync::Arc;

use super::batch::Hypotheses;
use super::cpu::Cpu;
use super::gpu::{Gpu, GpuRenderer};
use crate::error::Result;

/// Which renderer of hypotheses to use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum HypothesisRendererChoice {
    /// The CPU: the same results on every x86-64 machine.
    #[default]
    Cpu,
    /// The best graphics adapter, a software driver included, or an error.
    Gpu,
    /// The best graphics adapter that is a device, else the CPU: software drivers are slower than it.
    Auto,
}

/// Who renders hypotheses, opened once and shared by all searches.
#[derive(Debug, Clone, Default)]
pub enum HypothesisRenderer {
    /// Each search on its own thread.
    #[default]
    Cpu,
    /// All searches on one graphics adapter.
    Gpu(Arc<GpuRenderer>),
}

impl HypothesisRenderer {
    /// Opens what was chosen, and logs what it is. With [`HypothesisRendererChoice::Auto`] and no adapter that is a
    /// device, the CPU does it.
    ///
    /// # Errors
    /// With [`HypothesisRendererChoice::Gpu`], when there is no graphics adapter that will do.
    pub fn open(choice: HypothesisRendererChoice) -> Result<Self> {
        let opened = match choice {
            HypothesisRendererChoice::Cpu => Self::Cpu,
            HypothesisRendererChoice::Gpu => Self::Gpu(Arc::new(GpuRenderer::open()?)),
            HypothesisRendererChoice::Auto => GpuRenderer::open_hardware().map_or_else(
                |error| {
                    log::warn!("{error}; rendering them on the CPU instead");
                    Self::Cpu
                },
                |renderer| Self::Gpu(Arc::new(renderer)),
            ),
        };
        log::info!("hypotheses are rendered by {opened}");
        Ok(opened)
    }

    /// `cpu` or `gpu`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            Self::Gpu(_) => "gpu",
        }
    }

    /// One for a search.
    pub fn session(&self) -> Box<dyn Hypotheses> {
        match self {
            Self::Cpu => Box::new(Cpu::default()),
            Self::Gpu(renderer) => Box::new(Gpu::new(renderer.clone())),
        }
    }
}

/// The name, and the adapter if there is one.
impl fmt::Display for HypothesisRenderer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Cpu => write!(f, "cpu"),
            Self::Gpu(renderer) => write!(f, "gpu: {}", renderer.info()),
        }
    }
}
