//! A mesh in whatever format it is, as one [`Visual`].

use std::path::Path;
use std::sync::Arc;

use image::RgbImage;
use nalgebra::Vector3;

use super::mesh_io::{self, finish};
use super::{gltf, obj};
use crate::mesh::{Material, Mesh, Visual};
use crate::robot::mesh_files;
use crate::robot::mesh_part::Part;
use crate::{Error, Result};

/// The endings of files that are read.
pub const ENDINGS: [&str; 6] = ["obj", "ply", "stl", "glb", "gltf", "dae"];

/// Reads an OBJ, PLY, STL, glTF (`.glb`, `.gltf`) or COLLADA file and scales it by `scale`, such as 0.001 for millimetres. A COLLADA
/// file's own unit is applied before. glTF's y axis becomes z.
///
/// Several parts become one mesh: with colours and finishes of their own, or with the one texture that all of them have.
///
/// # Errors
/// If the format is another one, a file is missing, cut off or wrong, or the parts have several textures.
pub fn load(path: &Path, scale: f64) -> Result<Visual> {
    let invalid = |message: String| Error::invalid(path, message);
    match ending(path).as_str() {
        "obj" => Ok(scaled(mesh_io::load_obj(path)?, scale)),
        "ply" => mesh_io::load_ply(path, scale),
        "stl" | "dae" => {
            let parts = mesh_files::load(path, &Vector3::repeat(scale)).map_err(invalid)?;
            joined(path, parts)
        }
        "glb" | "gltf" => Ok(scaled(joined(path, gltf::load(path).map_err(invalid)?)?, scale)),
        other => {
            Err(invalid(format!("mesh format '{other}' is not read; convert it to .{}", ENDINGS.join(", ."))))
        }
    }
}

/// [`load`] with this texture in place of the file's.
///
/// # Errors
/// As [`load`], and when the mesh has no texture coordinates.
pub(super) fn load_textured(path: &Path, scale: f64, texture: Arc<RgbImage>) -> Result<Visual> {
    let invalid = |message: String| Error::invalid(path, message);
    let parts = match ending(path).as_str() {
        "obj" => obj_parts(path)?,
        "dae" => mesh_files::load(path, &Vector3::repeat(1.0)).map_err(invalid)?,
        "glb" | "gltf" => gltf::load(path).map_err(invalid)?,
        "ply" => vec![Part { mesh: mesh_io::load_ply_mesh(path)?, material: None }],
        _ => Vec::new(),
    };
    let coordinates = |part: &Part| part.mesh.uvs.len() == part.mesh.positions.len();
    if parts.is_empty() || !parts.iter().all(coordinates) {
        return Err(invalid(
            "has no texture coordinates for the texture of the table; leave `texture` out".into(),
        ));
    }
    let material = Material { texture: Some(texture), ..Material::default() };
    let parts = parts.into_iter().map(|part| Part { material: Some(material.clone()), ..part }).collect();
    Ok(scaled(joined(path, parts)?, scale))
}

/// The groups of an OBJ.
fn obj_parts(path: &Path) -> Result<Vec<Part>> {
    let models = obj::load(path)?.models;
    Ok(models.iter().map(|model| Part { mesh: obj::mesh(&model.mesh), material: None }).collect())
}

/// The parts of a file, such as the groups of an OBJ, as bare meshes; scaled as by [`load`].
///
/// # Errors
/// As [`load`].
pub(super) fn parts(path: &Path, scale: f64) -> Result<Vec<Mesh>> {
    let invalid = |message: String| Error::invalid(path, message);
    let parts = match ending(path).as_str() {
        "obj" => obj_parts(path)?,
        "stl" | "dae" => mesh_files::load(path, &Vector3::repeat(1.0)).map_err(invalid)?,
        "glb" | "gltf" => gltf::load(path).map_err(invalid)?,
        _ => return load(path, scale).map(|visual| vec![Arc::unwrap_or_clone(visual.mesh)]),
    };
    Ok(parts.into_iter().map(|part| enlarged(part.mesh, scale)).collect())
}

fn ending(path: &Path) -> String {
    path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase()
}

fn scaled(mut visual: Visual, scale: f64) -> Visual {
    if scale != 1.0 {
        visual.mesh = Arc::new(enlarged(Arc::unwrap_or_clone(visual.mesh), scale));
    }
    visual
}

fn enlarged(mut mesh: Mesh, scale: f64) -> Mesh {
    if scale != 1.0 {
        mesh.positions.iter_mut().for_each(|p| *p = (p.cast::<f64>() * scale).cast());
    }
    mesh
}

/// One mesh of all parts.
fn joined(path: &Path, parts: Vec<Part>) -> Result<Visual> {
    let invalid = |message: String| Error::invalid(path, message);
    if parts.iter().all(|part| part.mesh.triangles.is_empty()) {
        return Err(invalid("holds no triangles".into()));
    }
    let materials: Vec<Material> =
        parts.iter().map(|part| part.material.clone().unwrap_or_default()).collect();
    let mut textures: Vec<Arc<RgbImage>> = Vec::new();
    for texture in materials.iter().filter_map(|material| material.texture.as_ref()) {
        if !textures.iter().any(|known| Arc::ptr_eq(known, texture) || known == texture) {
            textures.push(Arc::clone(texture));
        }
    }
    if textures.len() > 1 {
        return Err(invalid(format!(
            "has {} textures; one is supported: bake them into one",
            textures.len()
        )));
    }
    let texture = textures.pop();
    if texture.is_some() && materials.iter().any(|material| material.texture.is_none()) {
        return Err(invalid(
            "has parts with a texture and parts without: bake colours and texture into one texture".into(),
        ));
    }
    let first = materials.first().cloned().unwrap_or_default();
    let alike = materials.iter().all(|m| {
        (m.base_color, m.roughness, m.metallic) == (first.base_color, first.roughness, first.metallic)
    });
    let colored = texture.is_none()
        && (parts.iter().any(|part| !part.mesh.colors.is_empty())
            || materials.iter().any(|material| material.base_color != first.base_color));
    let mut mesh = Mesh::default();
    for (part, material) in parts.into_iter().zip(&materials) {
        let (base, count) = (mesh.positions.len() as u32, part.mesh.positions.len());
        let own = material.base_color;
        let byte = |v: f32| (255.0 * v.clamp(0.0, 1.0)).round() as u8;
        if colored && part.mesh.colors.len() == count {
            // A vertex's colour is multiplied by the material's.
            let mixed =
                part.mesh.colors.iter().map(|c| [0, 1, 2].map(|i| byte(own[i] * f32::from(c[i]) / 255.0)));
            mesh.colors.extend(mixed);
        } else if colored {
            mesh.colors.extend(std::iter::repeat_n(own.map(byte), count));
        }
        if !alike {
            mesh.finish.extend(std::iter::repeat_n([material.roughness, material.metallic].map(byte), count));
        }
        if texture.is_some() {
            mesh.uvs.extend(part.mesh.uvs);
        }
        mesh.normals.extend(part.mesh.normals);
        mesh.positions.extend(part.mesh.positions);
        mesh.triangles.extend(part.mesh.triangles.iter().map(|t| t.map(|i| i + base)));
    }
    if texture.is_some() && mesh.uvs.len() != mesh.positions.len() {
        return Err(invalid("has a texture, but not texture coordinates at all corners".into()));
    }
    finish(path, mesh, Material { texture, ..first })
}

#[cfg(test)]
mod tests {
    use super::*;
    use base64::Engine;

    /// A box of 0.02 x 0.04 x 0.06 in a glTF's own axes, y up, red and rough, moved by its node; its parts are its sides.
    fn gltf_box() -> (Vec<u8>, String) {
        let mut bytes: Vec<u8> = Vec::new();
        for i in 0..8 {
            for (axis, size) in [0.02f32, 0.04, 0.06].into_iter().enumerate() {
                bytes.extend((if i >> axis & 1 == 1 { size } else { 0.0 }).to_le_bytes());
            }
        }
        let quads = [[0u16, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        for [a, b, c, d] in quads {
            [a, b, c, a, c, d].iter().for_each(|i| bytes.extend(i.to_le_bytes()));
        }
        let json = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
            "nodes":[{"translation":[1,2,3],"children":[1]},{"mesh":0}],
            "meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1,"material":0}]}],
            "materials":[{"pbrMetallicRoughness":{"baseColorFactor":[1,0,0,1],"metallicFactor":0,"roughnessFactor":0.5}}],
            "accessors":[{"bufferView":0,"componentType":5126,"count":8,"type":"VEC3"},
                {"bufferView":1,"componentType":5123,"count":36,"type":"SCALAR"}],
            "bufferViews":[{"buffer":0,"byteLength":96},{"buffer":0,"byteOffset":96,"byteLength":72}],
            "buffers":[{BUFFER"byteLength":168}]}"#;
        (bytes, json.to_owned())
    }

    fn glb(json: &str, blob: &[u8]) -> Vec<u8> {
        let mut json = json.as_bytes().to_vec();
        json.resize(json.len().next_multiple_of(4), b' ');
        let mut bytes = b"glTF".to_vec();
        bytes.extend(2u32.to_le_bytes());
        bytes.extend((28 + json.len() as u32 + blob.len() as u32).to_le_bytes());
        bytes.extend((json.len() as u32).to_le_bytes());
        bytes.extend(b"JSON");
        bytes.extend(json);
        bytes.extend((blob.len() as u32).to_le_bytes());
        bytes.extend(b"BIN\0");
        bytes.extend(blob);
        bytes
    }

    fn read(name: &str, content: &[u8]) -> Result<Visual> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, content).unwrap();
        load(&path, 1.0)
    }

    #[test]
    fn a_box_of_a_gltf_stands_z_up_where_its_nodes_put_it() {
        let (bytes, json) = gltf_box();
        let uri = base64::engine::general_purpose::STANDARD.encode(&bytes);
        let text =
            json.replace("BUFFER", &format!("\"uri\":\"data:application/octet-stream;base64,{uri}\","));
        let binary = glb(&json.replace("BUFFER", ""), &bytes);
        for visual in [read("a.gltf", text.as_bytes()).unwrap(), read("a.glb", &binary).unwrap()] {
            let (low, high) = visual.mesh.bounds().unwrap();
            // (x, y, z) of the file is (x, -z, y) here.
            assert!((low - nalgebra::Point3::new(1.0, -3.06, 2.0)).norm() < 1e-6, "{low}");
            assert!((high - nalgebra::Point3::new(1.02, -3.0, 2.04)).norm() < 1e-6, "{high}");
            assert!(visual.mesh.is_closed());
            assert!((visual.mesh.volume() - 4.8e-5).abs() < 1e-9, "{}", visual.mesh.volume());
            let [r, g, b] = visual.material.base_color;
            assert!((r - 1.0).abs() < 1e-6 && (g, b) == (0.0, 0.0));
            assert_eq!((visual.material.roughness, visual.material.metallic), (0.5, 0.0));
        }
    }

    #[test]
    fn whatever_is_cut_off_or_wrong_in_a_gltf_is_an_error_that_names_it() {
        let (bytes, json) = gltf_box();
        let json = json.replace("BUFFER", "");
        let whole = glb(&json, &bytes);
        for length in 0..whole.len() {
            assert!(read("a.glb", &whole[..length]).unwrap_err().to_string().contains("a.glb"), "{length}");
        }
        for (from, to, wanted) in [
            ("\"count\":8", "\"count\":9", "reaches beyond the 96 bytes"),
            ("\"count\":8", "\"count\":7", "names vertex 7 of 7"),
            ("\"count\":8", "\"count\":18446744073709551615", "reaches beyond"),
            ("\"byteLength\":96", "\"byteLength\":960", "reaches beyond the 168 bytes"),
            ("\"children\":[1]", "\"children\":[0]", "circle"),
            ("\"children\":[1]", "\"children\":[7]", "names nodes[7], but there are 2"),
            ("\"material\":0", "\"material\":4", "names materials[4]"),
            ("\"type\":\"VEC3\"", "\"type\":\"MAT4\"", "MAT4"),
            ("5123", "5124", "componentType 5124"),
            ("\"version\":\"2.0\"", "\"version\":\"1.0\"", "version 2 is read"),
            ("\"scene\":0", "\"extensionsRequired\":[\"KHR_draco_mesh_compression\"]", "KHR_draco"),
            ("\"mesh\":0", "\"mesh\":0,\"skin\":0", "skinned"),
        ] {
            let broken = json.replacen(from, to, 1);
            assert_ne!(broken, json, "{from}");
            let message = read("a.glb", &glb(&broken, &bytes)).unwrap_err().to_string();
            assert!(message.contains(wanted) && message.contains("a.glb"), "{to}: {message}");
        }
        let message = read("a.fbx", b"Kaydara").unwrap_err().to_string();
        assert!(message.contains("fbx") && message.contains(".glb"), "{message}");
    }

    #[test]
    fn parts_keep_their_colours_in_one_mesh() {
        let part = |color: [f32; 3], roughness: f32| {
            let mesh = Mesh {
                positions: vec![[0.0; 3].into(), [1.0, 0.0, 0.0].into(), [0.0, 1.0, 0.0].into()],
                triangles: vec![[0, 1, 2]],
                ..Mesh::default()
            };
            let material = Material { base_color: color, roughness, ..Material::default() };
            Part { mesh, material: Some(material) }
        };
        let both = joined(Path::new("a.dae"), vec![part([1.0, 0.0, 0.0], 0.7), part([0.0, 0.0, 1.0], 0.7)]);
        let both = both.unwrap();
        assert_eq!(
            both.mesh.colors,
            [[255, 0, 0], [255, 0, 0], [255, 0, 0], [0, 0, 255], [0, 0, 255], [0, 0, 255]]
        );
        assert!(both.mesh.triangles == [[0, 1, 2], [3, 4, 5]] && both.material.base_color == [1.0; 3]);
        let rough = joined(Path::new("a.dae"), vec![part([1.0; 3], 0.0), part([1.0; 3], 1.0)]).unwrap();
        assert_eq!((rough.mesh.finish[0], rough.mesh.finish[5]), ([0, 0], [255, 0]));
    }
}
