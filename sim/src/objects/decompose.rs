//! Convex collision pieces of a scanned mesh.
//!
//! A box or a cylinder where one fits the surface, else a V-HACD decomposition (Mamou, 2016; parry's), each hull by few
//! points. Decompositions are kept on disk, since one takes up to some seconds.

mod hulls;
mod primitive;

use sha2::{Digest, Sha256};

use crate::mesh::Mesh;
use crate::shape::{CollisionShape, Convex};
use crate::{cache, convert};

/// Changes whenever the pieces of a mesh would come out differently: old cache files are then left alone.
const VERSION: &str = "grip-decompose/1";

/// The folder of the disk cache.
const CACHE: &str = "collision";

/// Convex pieces that together stand for the solid inside `mesh`, in its frame.
///
/// The result is the same with and without the cache, which lies in `$GRIP_CACHE_DIR`, else `$XDG_CACHE_HOME/grip`, else
/// `~/.cache/grip`.
///
/// # Errors
/// If the mesh has no volume; in words, the caller adds the file.
pub fn decompose(mesh: &Mesh) -> Result<Vec<CollisionShape>, String> {
    decompose_with(mesh, cache::folder().as_deref())
}

fn decompose_with(mesh: &Mesh, folder: Option<&std::path::Path>) -> Result<Vec<CollisionShape>, String> {
    mesh.validate()?;
    let Some(folder) = folder else {
        return compute(mesh);
    };
    let key = key(mesh);
    let whole = |shapes: &Vec<CollisionShape>| !shapes.is_empty() && shapes.iter().all(is_sound);
    if let Some(shapes) = cache::read(folder, CACHE, &key, whole) {
        return Ok(shapes);
    }
    let shapes = compute(mesh)?;
    cache::write(folder, CACHE, &key, &shapes);
    Ok(shapes)
}

/// Whether a piece from a file is one that could have been computed.
fn is_sound(shape: &CollisionShape) -> bool {
    let positive = |values: &[f64]| values.iter().all(|v| *v > 0.0 && *v < 10.0);
    let dimensions = match &shape.geometry {
        Convex::Cuboid { half } => positive(half.as_slice()),
        Convex::Cylinder { half_height, radius } => positive(&[*half_height, *radius]),
        Convex::Sphere { radius } => positive(&[*radius]),
        Convex::Hull { points } => {
            points.len() >= 4 && points.iter().flat_map(|p| p.iter()).all(|v| v.abs() < 10.0)
        }
    };
    let unit = (shape.pose.rotation.norm() - 1.0).abs() < 1e-6;
    let near = shape.pose.translation.vector.iter().all(|v| v.abs() < 10.0);
    dimensions && unit && near && convert::solid(shape).is_some()
}

fn compute(mesh: &Mesh) -> Result<Vec<CollisionShape>, String> {
    if let Some(shape) = primitive::fit(mesh) {
        return Ok(vec![shape]);
    }
    hulls::decompose(mesh)
}

/// SHA-256 of geometry and parameters, in hexadecimal.
fn key(mesh: &Mesh) -> String {
    let mut hasher = Sha256::new();
    hasher.update(VERSION);
    hasher.update(hulls::PARAMETERS);
    hasher.update((mesh.positions.len() as u64).to_le_bytes());
    for p in &mesh.positions {
        p.iter().for_each(|v| hasher.update(v.to_le_bytes()));
    }
    for t in &mesh.triangles {
        t.iter().for_each(|i| hasher.update(i.to_le_bytes()));
    }
    format!("{:x}", hasher.finalize())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::objects::collision_error;
    use nalgebra::{Point3, Vector3};

    /// The prism over a polygon that is a star as seen from `hub`, from `-half` to `half` along z.
    fn prism(outline: &[[f32; 2]], hub: [f32; 2], half: f32) -> Mesh {
        let n = outline.len() as u32;
        let ring = |z: f32| outline.iter().map(move |&[x, y]| Point3::new(x, y, z));
        let mut positions: Vec<Point3<f32>> = ring(-half).chain(ring(half)).collect();
        positions.extend([Point3::new(hub[0], hub[1], -half), Point3::new(hub[0], hub[1], half)]);
        let triangles = (0..n)
            .flat_map(|i| {
                let j = (i + 1) % n;
                [[i, j, n + j], [i, n + j, n + i], [2 * n, j, i], [2 * n + 1, n + i, n + j]]
            })
            .collect();
        Mesh { normals: vec![Vector3::z(); positions.len()], positions, triangles, ..Mesh::default() }
    }

    fn can() -> Mesh {
        let outline: Vec<[f32; 2]> = (0..96)
            .map(|i| (i as f32 / 96.0 * std::f32::consts::TAU).sin_cos())
            .map(|(sin, cos)| [0.034 * cos + 0.002, 0.034 * sin])
            .collect();
        prism(&outline, [0.002, 0.0], 0.051)
    }

    /// An L of two arms, 0.1 m long and 0.03 m thick.
    fn angle_iron() -> Mesh {
        let outline = [[0.0, 0.0], [0.1, 0.0], [0.1, 0.03], [0.03, 0.03], [0.03, 0.1], [0.0, 0.1]];
        prism(&outline, [0.02, 0.02], 0.02)
    }

    #[test]
    fn a_can_becomes_a_cylinder_of_its_size() {
        let mesh = can();
        assert!(mesh.is_closed());
        let shapes = decompose_with(&mesh, None).unwrap();
        let [CollisionShape { pose, geometry: Convex::Cylinder { half_height, radius } }] = shapes.as_slice()
        else {
            panic!("{shapes:?}");
        };
        assert!(
            (radius - 0.034).abs() < 2e-4 && (half_height - 0.051).abs() < 1e-5,
            "{radius} {half_height}"
        );
        assert!((pose.translation.vector - Vector3::new(0.002, 0.0, 0.0)).norm() < 2e-4);
    }

    #[test]
    fn an_angle_iron_is_cut_in_its_arms() {
        let mesh = angle_iron();
        assert!(mesh.is_closed());
        let shapes = decompose_with(&mesh, None).unwrap();
        assert!(shapes.len() >= 2);
        for shape in &shapes {
            assert!(matches!(&shape.geometry, Convex::Hull { points } if points.len() <= 32), "{shape:?}");
        }
        let error = collision_error::between(&mesh, &shapes);
        assert!(error.mean_m < 5e-4 && error.max_m < 3e-3, "{error:?}");
        assert_eq!(shapes, decompose_with(&mesh, None).unwrap(), "same bits every time");
    }

    #[test]
    fn the_cache_gives_the_same_pieces_and_heals() {
        let folder = tempfile::tempdir().unwrap();
        let mesh = angle_iron();
        let computed = decompose_with(&mesh, Some(folder.path())).unwrap();
        assert_eq!(computed, decompose_with(&mesh, Some(folder.path())).unwrap());
        let file = folder.path().join(format!("collision/{}.json", key(&mesh)));
        std::fs::write(&file, "{").unwrap();
        assert_eq!(computed, decompose_with(&mesh, Some(folder.path())).unwrap());
        assert!(std::fs::metadata(&file).unwrap().len() > 100, "the damaged file was replaced");
        assert_ne!(key(&mesh), key(&can()));
    }

    #[test]
    fn meshes_without_volume_are_refused() {
        let flat = prism(&[[0.0, 0.0], [0.1, 0.0], [0.0, 0.1]], [0.03, 0.03], 0.0);
        assert!(decompose_with(&flat, None).unwrap_err().contains("flat"));
        assert!(decompose_with(&Mesh::default(), None).unwrap_err().contains("no triangles"));
    }
}
