//! Objects of one's own: a row of a table, and the files that it names, as a model.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Vector3};
use parry3d::math::Vector;
use parry3d::transformation::try_convex_hull;
use schemars::JsonSchema;
use serde::Serialize;
use sha2::{Digest, Sha256};

use super::mass::{hull, solid_mass};
use super::table::{ObjectRow, Unit};
use super::{ObjectInfo, ObjectModel, any_mesh, decompose};
use crate::mesh::{Mesh, Visual};
use crate::shape::{CollisionShape, Convex};
use crate::{Error, Result, files, pictures};

/// Objects fit a gripper or a hand, metres along their longest side, and are no foil, metres along their shortest.
const LONGEST: [f64; 2] = [5e-3, 1.0];
const SHORTEST: f64 = 5e-4;
/// Corners of a collision piece: beyond it contacts get slow.
const MOST_CORNERS: usize = 128;

/// Where an object's model is from, if it is not one of a set.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct MeshSource {
    /// The table.
    #[serde(serialize_with = "files::shown")]
    pub table: PathBuf,
    /// The mesh.
    #[serde(serialize_with = "files::shown")]
    pub mesh: PathBuf,
    /// SHA-256 of the mesh's file.
    pub sha256: String,
}

/// The files that a row names.
#[derive(Debug, Clone)]
pub struct OwnMesh {
    table: PathBuf,
    mesh: PathBuf,
    unit: Unit,
    texture: Option<PathBuf>,
    collision: Option<PathBuf>,
}

impl OwnMesh {
    /// Of a row of the table at `table`; `None` if the row names no mesh.
    pub fn of(table: &Path, row: &ObjectRow) -> Option<Self> {
        let folder = table.parent().unwrap_or(Path::new("."));
        let beside = |file: &PathBuf| folder.join(file);
        Some(Self {
            table: table.to_path_buf(),
            mesh: beside(row.mesh.as_ref()?),
            unit: row.unit.unwrap_or_default(),
            texture: row.texture.as_ref().map(beside),
            collision: row.collision.as_ref().map(beside),
        })
    }

    /// The mesh's file.
    pub fn path(&self) -> &Path {
        &self.mesh
    }

    /// The object's looks in its frame, and where that frame's origin is in the file's, metres.
    ///
    /// # Errors
    /// When a file is missing or wrong, or the size is none of an object.
    pub fn visual(&self) -> Result<(Visual, Vector3<f64>)> {
        let mut visual = match &self.texture {
            None => any_mesh::load(&self.mesh, self.unit.metres())?,
            Some(texture) => {
                let picture = pictures::stored(texture)?;
                any_mesh::load_textured(&self.mesh, self.unit.metres(), Arc::new(picture))?
            }
        };
        check_size(&visual.mesh, self.unit).map_err(|message| Error::invalid(&self.mesh, message))?;
        let (low, high) = visual.mesh.bounds().unwrap_or_default();
        visual.mesh = Arc::new(Arc::unwrap_or_clone(visual.mesh).centered());
        Ok((visual, nalgebra::center(&low, &high).coords))
    }

    /// Cubic metres of what the mesh bounds, or of its convex hull where it is not closed.
    ///
    /// # Errors
    /// As [`OwnMesh::visual`], and when it has none.
    pub fn volume(&self) -> Result<f64> {
        volume(&self.visual()?.0.mesh)
            .ok_or_else(|| Error::invalid(&self.mesh, "is flat: an object has a volume"))
    }

    /// The object: looks, and convex pieces of the solid.
    ///
    /// # Errors
    /// When a file is missing or wrong, or the mesh has no volume.
    pub fn model(&self, info: ObjectInfo) -> Result<ObjectModel> {
        let (visual, origin) = self.visual()?;
        let collision = match &self.collision {
            Some(path) => pieces(path, self.unit, &origin)?,
            None => {
                decompose::decompose(&visual.mesh).map_err(|message| Error::invalid(&self.mesh, message))?
            }
        };
        let mut model = ObjectModel::new(info, visual, collision);
        model.source = Some(Arc::new(MeshSource {
            table: self.table.clone(),
            mesh: self.mesh.clone(),
            sha256: format!("{:x}", Sha256::digest(files::read(&self.mesh)?)),
        }));
        Ok(model)
    }
}

/// Cubic metres of what a mesh bounds, or of its convex hull where it is not closed; `None` for a flat one.
pub fn volume(mesh: &Mesh) -> Option<f64> {
    if mesh.is_closed()
        && let Some(mass) = solid_mass(mesh)
    {
        return Some(mass.volume_m3);
    }
    solid_mass(&hull(mesh)?).map(|mass| mass.volume_m3)
}

/// The hulls of a file's parts, moved with the mesh by `origin`.
fn pieces(path: &Path, unit: Unit, origin: &Vector3<f64>) -> Result<Vec<CollisionShape>> {
    let parts = any_mesh::parts(path, unit.metres())?;
    let shapes = parts.iter().enumerate().map(|(i, part)| {
        let wrong = |reason: &str| Error::invalid(path, format!("part {} of the solid {reason}", i + 1));
        let points: Vec<Vector> = part.positions.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
        let (points, _) = try_convex_hull(&points).map_err(|_| wrong("is flat"))?;
        if points.len() > MOST_CORNERS {
            return Err(wrong(&format!("has {} corners; {MOST_CORNERS} are the most", points.len())));
        }
        let points = points.iter().map(|p| Point3::new(p.x, p.y, p.z).cast::<f64>() - origin).collect();
        Ok(CollisionShape { pose: Isometry3::identity(), geometry: Convex::Hull { points } })
    });
    shapes.collect()
}

/// What is wrong with an object's size, and which unit would make it right.
fn check_size(mesh: &Mesh, unit: Unit) -> std::result::Result<(), String> {
    let Some((low, high)) = mesh.bounds() else {
        return Err("has no vertices".into());
    };
    let size = high - low;
    let plausible = |scale: f64| {
        (LONGEST[0]..=LONGEST[1]).contains(&(scale * size.max())) && scale * size.min() >= SHORTEST
    };
    if plausible(1.0) {
        return Ok(());
    }
    let others: Vec<String> = Unit::ALL
        .into_iter()
        .filter(|other| *other != unit && plausible(other.metres() / unit.metres()))
        .map(|other| {
            let mm = 1e3 * size * (other.metres() / unit.metres());
            format!("unit = \"{other}\" makes it {:.1} x {:.1} x {:.1} mm", mm.x, mm.y, mm.z)
        })
        .collect();
    let advice = if others.is_empty() { "scale the mesh".to_owned() } else { others.join(", ") };
    Err(format!(
        "measures {:.4} x {:.4} x {:.4} m with unit = \"{unit}\"; objects are 5 mm to 1 m long and no flatter than 0.5 mm: {advice}",
        size.x, size.y, size.z
    ))
}
