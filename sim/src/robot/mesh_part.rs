//! A mesh of a file, and the texture beside it: what all formats give.

use std::borrow::Cow;
use std::path::Path;
use std::sync::Arc;

use image::RgbImage;

use crate::error::Error;
use crate::files;
use crate::mesh::{Material, Mesh};
use crate::pictures;

/// One mesh of a file, with the material that the file gives it.
#[derive(Debug)]
pub(crate) struct Part {
    pub mesh: Mesh,
    /// `None` when the file has none: the URDF's material applies.
    pub material: Option<Material>,
}

/// The bytes of a file; the caller names it in the error.
pub(super) fn read(path: &Path) -> Result<Cow<'static, [u8]>, String> {
    files::read(path).map_err(Error::without_file)
}

/// A texture beside the mesh file; `name` is a path or a URI.
pub(super) fn texture(name: &str, folder: Option<&Path>) -> Result<Arc<RgbImage>, String> {
    let path = files::named(folder.unwrap_or(Path::new(".")), name);
    pictures::stored(&path).map(Arc::new).map_err(|error| format!("texture {error}"))
}
