//! The module `grip._grip`: what of GRIP Python sees. The package around it, `python/grip`, is what people use.

mod arrays;
mod caller;
mod episode;
mod error;
mod estimators;
mod frame;
mod graspers;
mod process;
mod world;

use pyo3::prelude::*;

/// Worlds, frames, estimators and the verbs of the command, without their Python side.
#[pymodule]
mod _grip {
    use super::*;

    #[pymodule_export]
    use super::caller::{call, main};
    #[pymodule_export]
    use super::episode::Episode;
    #[pymodule_export]
    use super::error::Error;
    #[pymodule_export]
    use super::estimators::{Asked, Estimator, Model, Posterior};
    #[pymodule_export]
    use super::frame::Frame;
    #[pymodule_export]
    use super::graspers::Target;
    #[pymodule_export]
    use super::world::{Scene, World};

    /// The text of a file of the project, on disk or built in (`builtin:scenes/grocery.toml`).
    #[pyfunction]
    fn read_text(path: std::path::PathBuf) -> PyResult<String> {
        error::raised(|| Ok(grip_sim::files::read_to_string(&path)?.into_owned()))
    }

    /// The path of a file that ships with the program: under the current folder, or `builtin:`; as it is where there is no such file.
    #[pyfunction]
    fn find(relative: &str) -> String {
        let found = grip::assets::find(relative);
        let there = grip_sim::files::exists(&found);
        if there { found.to_string_lossy().into_owned() } else { relative.to_owned() }
    }

    /// JSON as TOML.
    #[pyfunction]
    fn toml(json: &str) -> PyResult<String> {
        error::raised(|| {
            let value: serde_json::Value = serde_json::from_str(json)?;
            Ok(::toml::to_string(&value)?)
        })
    }
}
