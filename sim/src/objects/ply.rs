//! PLY files as a [`Visual`].

use std::borrow::Cow;
use std::path::Path;

use nalgebra::{Point3, Vector3};
use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{DefaultElement, Property};

use super::mesh_io::{finish, load_texture};
use crate::files;
use crate::mesh::{Material, Mesh, Visual};
use crate::polygon;
use crate::{Error, Result};

/// Reads a PLY file, ASCII or binary, and scales it by `unit_scale` (0.001 for millimetres).
///
/// Vertices: `x y z`, and if there are any `nx ny nz`, `red green blue`, and `texture_u texture_v`, `s t` or `u v`.
/// Faces: lists of at least three indices, cut into triangles, and if there are any `red green blue`, or a list
/// `texcoord` of two numbers a corner. A header line `comment TextureFile NAME` names the texture.
///
/// # Errors
/// If the file or its texture is missing, cut off or wrong.
pub fn load_ply(path: &Path, unit_scale: f64) -> Result<Visual> {
    let (mesh, texture) = parse(&files::read(path)?, unit_scale).map_err(|m| Error::invalid(path, m))?;
    let mut material = Material::default();
    if let Some(name) = texture {
        material.texture = Some(load_texture(path, &name)?);
    }
    finish(path, mesh, material)
}

/// The mesh in the bytes of a file, and the name of its texture.
///
/// # Errors
/// What is wrong; the caller names the file.
pub(crate) fn parse(bytes: &[u8], unit_scale: f64) -> std::result::Result<(Mesh, Option<String>), String> {
    let bytes = plain_header(bytes);
    let ply = Parser::<DefaultElement>::new().read_ply(&mut &*bytes).map_err(|error| {
        let at = error.line().map(|line| format!(" near line {line}")).unwrap_or_default();
        format!("not a readable PLY file, or cut off{at}: {error}")
    })?;
    let vertices = ply.payload.get("vertex").ok_or("has no element 'vertex'")?;
    let faces = ply.payload.get("face").ok_or("has no element 'face': holds no triangles")?;
    let first = vertices.first().ok_or("has no vertices")?;
    let has = |element: &DefaultElement, names: &[&str]| names.iter().all(|name| element.contains_key(*name));
    if !has(first, &["x", "y", "z"]) {
        return Err("its vertices lack x, y or z".into());
    }
    let number = |element: &DefaultElement, name: &str| {
        element.get(name).and_then(Property::to_f32_lossy).unwrap_or(f32::NAN)
    };
    let color = |element: &DefaultElement| {
        let byte = |name| element.get(name).and_then(Property::to_u8_color_lossy).unwrap_or(0);
        ["red", "green", "blue"].map(byte)
    };
    let mut whole = Mesh::default();
    let uv_names =
        [["texture_u", "texture_v"], ["s", "t"], ["u", "v"]].into_iter().find(|names| has(first, names));
    let normals = has(first, &["nx", "ny", "nz"]);
    let colors = has(first, &["red", "green", "blue"]);
    for vertex in vertices {
        let position = ["x", "y", "z"].map(|name| (f64::from(number(vertex, name)) * unit_scale) as f32);
        whole.positions.push(Point3::from(position));
        if normals {
            whole.normals.push(Vector3::from(["nx", "ny", "nz"].map(|name| number(vertex, name))));
        }
        if colors {
            whole.colors.push(color(vertex));
        }
        if let Some([u, v]) = uv_names {
            // As in OBJ, v points up.
            whole.uvs.push([number(vertex, u), 1.0 - number(vertex, v)]);
        }
    }

    let textures: Vec<&str> = ply
        .header
        .comments
        .iter()
        .filter_map(|comment| comment.trim().strip_prefix("TextureFile").map(str::trim))
        .collect();
    let texture = match textures[..] {
        [] => None,
        [name] => Some(name.to_owned()),
        _ => return Err(format!("names {} textures; one is supported: bake them into one", textures.len())),
    };
    // What a face says of itself and no vertex does, its corners get, each one of its own.
    let of_faces = faces.first().map_or([false; 2], |face| {
        [
            !colors && has(face, &["red", "green", "blue"]),
            texture.is_some() && whole.uvs.is_empty() && has(face, &["texcoord"]),
        ]
    });
    let mut apart = Mesh::default();
    for (index, face) in faces.iter().enumerate() {
        let corners = ["vertex_indices", "vertex_index"]
            .iter()
            .find_map(|name| face.get(*name))
            .and_then(Property::to_u32_list)
            .ok_or_else(|| format!("face {index} has no list 'vertex_indices' of vertex numbers"))?;
        if corners.len() < 3 {
            return Err(format!("face {index} has {} vertices; three or more make a face", corners.len()));
        }
        // What names a vertex that is not there is told below.
        let place = |&corner: &u32| {
            let at = whole.positions.get(corner as usize);
            at.map_or(Vector3::repeat(f64::NAN), |p| p.coords.cast::<f64>())
        };
        let cut = polygon::triangles(&corners.iter().map(place).collect::<Vec<_>>());
        if of_faces == [false; 2] {
            whole.triangles.extend(cut.iter().map(|triangle| triangle.map(|i| corners[i])));
            continue;
        }
        let base = apart.positions.len() as u32;
        for &corner in &corners {
            let at = corner as usize;
            let beyond =
                || format!("face {index} names vertex {corner} beyond the {} there are", vertices.len());
            apart.positions.push(*whole.positions.get(at).ok_or_else(beyond)?);
            apart.normals.extend(whole.normals.get(at));
            apart.colors.extend(whole.colors.get(at));
            apart.uvs.extend(whole.uvs.get(at));
        }
        if of_faces[0] {
            apart.colors.extend(corners.iter().map(|_| color(face)));
        }
        if of_faces[1] {
            let uvs = match face.get("texcoord") {
                Some(Property::ListFloat(list)) => list.clone(),
                Some(Property::ListDouble(list)) => list.iter().map(|&value| value as f32).collect(),
                _ => Vec::new(),
            };
            if uvs.len() != 2 * corners.len() {
                return Err(format!(
                    "face {index} has {} vertices, but {} texture coordinates (texcoord)",
                    corners.len(),
                    uvs.len()
                ));
            }
            apart.uvs.extend(uvs.as_chunks::<2>().0.iter().map(|&[u, v]| [u, 1.0 - v]));
        }
        apart.triangles.extend(cut.iter().map(|triangle| triangle.map(|i| base + i as u32)));
    }
    let mesh = if of_faces == [false; 2] { whole } else { apart };
    if let (Some(name), true) = (&texture, mesh.uvs.is_empty()) {
        return Err(format!(
            "names the texture '{name}' but has no texture coordinates: texture_u and texture_v of vertices, or texcoord of faces"
        ));
    }
    Ok((mesh, texture))
}

/// Comments in an 8-bit encoding do no harm: what is not ASCII in the header is left out.
fn plain_header(bytes: &[u8]) -> Cow<'_, [u8]> {
    const END: &[u8] = b"end_header";
    let end = bytes.windows(END.len()).position(|window| window == END).unwrap_or(0);
    if std::str::from_utf8(&bytes[..end]).is_ok() {
        return Cow::Borrowed(bytes);
    }
    let mut plain = bytes.to_vec();
    plain[..end].iter_mut().filter(|byte| !byte.is_ascii()).for_each(|byte| *byte = b'?');
    Cow::Owned(plain)
}
