//! A mesh of a file, and the texture beside it: what all formats give.

use std::borrow::Cow;
use std::path::Path;
use std::sync::Arc;

use image::RgbImage;

use crate::error::Error;
use crate::files;
use crate::mesh::{Material, Mesh};

/// One mesh of a file, with the material that the file gives it.
#[derive(Debug)]
pub(super) struct Part {
    pub mesh: Mesh,
    /// `None` when the file has none: the URDF's material applies.
    pub material: Option<Material>,
}

/// The bytes of a file; the caller names it in the error.
pub(super) fn read(path: &Path) -> Result<Cow<'static, [u8]>, String> {
    files::read(path).map_err(|error| match error {
        Error::Io { source, .. } => source.to_string(),
        other => other.to_string(),
    })
}

/// A texture beside the mesh file.
pub(super) fn texture(name: &str, folder: Option<&Path>) -> Result<Arc<RgbImage>, String> {
    let name = name.strip_prefix("file://").unwrap_or(name).replace('\\', "/");
    let path = folder.unwrap_or(Path::new(".")).join(&name);
    let about = |error: String| format!("texture {}: {error}; PNG and JPEG are supported", path.display());
    let bytes = read(&path).map_err(about)?;
    let image = image::load_from_memory(&bytes).map_err(|error| about(error.to_string()))?;
    Ok(Arc::new(image.to_rgb8()))
}
