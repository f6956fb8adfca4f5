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

/// The mesh of a file alone, whatever its texture.
///
/// # Errors
/// As [`load_ply`].
pub(super) fn load_ply_mesh(path: &Path) -> Result<Mesh> {
    parse(&files::read(path)?, 1.0).map(|(mesh, _)| mesh).map_err(|m| Error::invalid(path, m))
}

/// The mesh in the bytes of a file, and the name of its texture.
///
/// # Errors
/// What is wrong; the caller names the file.
pub(crate) fn parse(bytes: &[u8], unit_scale: f64) -> std::result::Result<(Mesh, Option<String>), String> {
    let bytes = plain(bytes);
    let ply = Parser::<DefaultElement>::new().read_ply(&mut &*bytes).map_err(|error| {
        let at = error.line().map(|line| format!(" near line {line}")).unwrap_or_default();
        // The parser cites the line, which may be all of the file.
        let reason: String = error.to_string().chars().take(200).collect();
        format!("not a readable PLY file, or cut off{at}: {reason}")
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

/// A file with what the parser does not bear put right: comments in an 8-bit encoding, and in text line ends of an old Mac and
/// numbers such as `nan` and `.5`.
fn plain(bytes: &[u8]) -> Cow<'_, [u8]> {
    const END: &[u8] = b"end_header";
    let end = bytes.windows(END.len()).position(|window| window == END).unwrap_or(0);
    let (header, rest) = bytes.split_at(end);
    let is_text = header.windows(12).any(|window| window == b"format ascii");
    let old = is_text && !header.contains(&b'\n');
    let odd = is_text
        && rest[END.len().min(rest.len())..].split(u8::is_ascii_whitespace).any(|word| !is_plain(word));
    if header.is_ascii() && !old && !odd {
        return Cow::Borrowed(bytes);
    }
    let mut plain: Vec<u8> = header.iter().map(|byte| if byte.is_ascii() { *byte } else { b'?' }).collect();
    if odd {
        for word in rest.split_inclusive(u8::is_ascii_whitespace) {
            let (number, space) = word.split_at(word.trim_ascii_end().len());
            plain.extend(
                numeral(number).map_or(Cow::Borrowed(number), |text| Cow::Owned(text.into_bytes())).iter(),
            );
            plain.extend(space);
        }
    } else {
        plain.extend(rest);
    }
    if old {
        plain.iter_mut().filter(|byte| **byte == b'\r').for_each(|byte| *byte = b'\n');
    }
    Cow::Owned(plain)
}

/// Whether the parser takes a word for a number, if it is one.
fn is_plain(word: &[u8]) -> bool {
    let digits = word.strip_prefix(b"-").or(word.strip_prefix(b"+")).unwrap_or(word);
    let digit = |byte: Option<&u8>| byte.is_none_or(u8::is_ascii_digit);
    // `1.` and `1.e3` lack a digit behind the point.
    let point = digits.iter().position(|byte| *byte == b'.');
    digit(digits.first()) && point.is_none_or(|at| digits.get(at + 1).is_some_and(u8::is_ascii_digit))
}

/// A number in digits. What is none or endless becomes more than the largest float, which is endless again when it is read.
fn numeral(word: &[u8]) -> Option<String> {
    let number: f64 = std::str::from_utf8(word).ok().filter(|_| !is_plain(word))?.parse().ok()?;
    Some(if number.is_finite() { format!("{number:e}") } else { "1e39".to_owned() })
}
