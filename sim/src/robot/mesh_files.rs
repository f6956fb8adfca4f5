//! Meshes that a URDF names: STL, COLLADA and OBJ, by file ending.
//!
//! Texts of errors here say what is wrong with the file; the caller adds file, link and URDF.

use std::path::Path;

use nalgebra::Vector3;

use super::mesh_part::{Part, read, texture};
use super::{collada, stl};
use crate::error::Error;
use crate::mesh::{Material, Mesh};
use crate::objects::obj::{self, Obj};

/// Reads all parts of a mesh file, scaled along the axes.
pub(crate) fn load(path: &Path, scale: &Vector3<f64>) -> Result<Vec<Part>, String> {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or("").to_ascii_lowercase();
    let mut parts = match ending.as_str() {
        "stl" => vec![Part { mesh: stl::load(&read(path)?)?, material: None }],
        "dae" => collada::load(&read(path)?, path.parent())?,
        "obj" => wavefront(path)?,
        _ => {
            return Err(format!("mesh format '{ending}' is not supported; convert it to .stl, .dae or .obj"));
        }
    };
    parts.retain(|part| !part.mesh.triangles.is_empty());
    if parts.is_empty() {
        return Err("holds no triangles".into());
    }
    for part in &mut parts {
        finish(&mut part.mesh, scale)?;
    }
    Ok(parts)
}

/// Checks indices and numbers, applies the scale, and sees to it that every vertex has a unit normal.
fn finish(mesh: &mut Mesh, scale: &Vector3<f64>) -> Result<(), String> {
    let count = mesh.positions.len();
    if mesh.triangles.iter().flatten().any(|&i| i as usize >= count) {
        return Err(format!("a triangle names a vertex beyond the {count} there are"));
    }
    let scale32 = scale.cast::<f32>();
    for p in &mut mesh.positions {
        p.coords.component_mul_assign(&scale32);
        // A part of a robot a kilometre away is a slip of units, and overflows what comes after.
        if !p.coords.iter().all(|v| v.is_finite() && v.abs() < 1e3) {
            return Err(format!(
                "vertex ({}, {}, {}) is not finite or farther than 1 km; check the file and the scale",
                p.x, p.y, p.z
            ));
        }
    }
    if scale.product() < 0.0 {
        // A mirror turns the surface inside out: wind it back.
        for triangle in &mut mesh.triangles {
            triangle.swap(1, 2);
        }
    }
    if mesh.normals.len() == count {
        for normal in &mut mesh.normals {
            normal.component_div_assign(&scale32);
        }
    } else {
        mesh.normals = vec![Vector3::zeros(); count];
        facet_normals(mesh);
    }
    // A normal of length zero or NaN gives way to that of its facet.
    if mesh.normals.iter().any(is_missing) {
        facet_normals(mesh);
    }
    for normal in &mut mesh.normals {
        *normal = normal.try_normalize(1e-12).unwrap_or_else(Vector3::z);
    }
    Ok(())
}

/// Whether a normal has no direction, or is not a number.
fn is_missing(normal: &Vector3<f32>) -> bool {
    !normal.norm().is_normal() || normal.norm() < 1e-6
}

/// Fills in missing normals with the area-weighted mean of the facets around.
fn facet_normals(mesh: &mut Mesh) {
    let missing: Vec<bool> = mesh.normals.iter().map(is_missing).collect();
    for (normal, &missing) in mesh.normals.iter_mut().zip(&missing) {
        if missing {
            *normal = Vector3::zeros();
        }
    }
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
        let facet = (b - a).cross(&(c - a));
        for &i in t {
            if missing[i as usize] {
                mesh.normals[i as usize] += facet;
            }
        }
    }
}

fn wavefront(path: &Path) -> Result<Vec<Part>, String> {
    let Obj { models, materials, absent } = obj::load(path).map_err(Error::without_file)?;
    if let Some(library) = absent {
        log::warn!(
            "{}: its material library {library} is not there; its materials are left out",
            path.display()
        );
    }
    let folder = path.parent();
    models
        .into_iter()
        .map(|model| {
            let mesh = obj::mesh(&model.mesh);
            let material = model
                .mesh
                .material_id
                .and_then(|id| materials.get(id))
                .map(|material| {
                    Ok::<_, String>(Material {
                        base_color: material.diffuse.unwrap_or([1.0; 3]),
                        texture: match &material.diffuse_texture {
                            Some(name) => Some(texture(name, folder)?),
                            None => None,
                        },
                        ..Material::default()
                    })
                })
                .transpose()?;
            let textured = material.as_ref().is_some_and(|material| material.texture.is_some());
            if textured && mesh.uvs.is_empty() {
                return Err(format!(
                    "group '{}' has a texture, but not texture coordinates (vt) at all corners",
                    model.name
                ));
            }
            // Colours of vertices are colours, not shades of the URDF's.
            let material = material.or_else(|| (!mesh.colors.is_empty()).then(Material::default));
            Ok(Part { mesh, material })
        })
        .collect()
}
