//! Wavefront OBJ and PLY files as a [`Visual`].
//!
//! Whatever the files hold, the result passes [`Mesh::validate`], or there is an error that names the file.

use std::io::BufReader;
use std::path::Path;
use std::sync::Arc;

use image::RgbImage;
use nalgebra::{Point3, Vector3};
use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{DefaultElement, Property};

use super::obj::{self, Obj};
use crate::files;
use crate::mesh::{Material, Mesh, Visual};
use crate::pictures;
use crate::{Error, Result};

/// Facets of a file without normals are shaded smoothly up to this angle, radians.
const CREASE: f64 = 0.7;

/// Reads a Wavefront OBJ file in metres, with the diffuse texture of its material library.
///
/// Polygons are cut into triangles and all groups become one mesh. With several materials, the textured one counts.
///
/// # Errors
/// If the file, its material library or its texture is missing, cut off or wrong.
pub fn load_obj(path: &Path) -> Result<Visual> {
    let invalid = |message: String| Error::invalid(path, message);
    let Obj { models, materials, absent } =
        obj::load(path)?;
    // What an object looks like matters, unlike a robot's link.
    if let Some(library) = absent {
        return Err(invalid(format!("its material library {library} is missing; it belongs beside the OBJ")));
    }

    let mut mesh = Mesh::default();
    let textured =
        models.iter().all(|model| model.mesh.texcoords.len() / 2 == model.mesh.positions.len() / 3);
    let colored = models.iter().all(|model| model.mesh.vertex_color.len() == model.mesh.positions.len());
    for model in &models {
        let part = &model.mesh;
        let base = mesh.positions.len() as u32;
        let triple = |values: &[f32]| -> Vec<[f32; 3]> { values.as_chunks::<3>().0.to_vec() };
        mesh.positions.extend(triple(&part.positions).into_iter().map(Point3::from));
        mesh.normals.extend(triple(&part.normals).into_iter().map(Vector3::from));
        if textured {
            // OBJ's v points up, ours down.
            mesh.uvs.extend(part.texcoords.as_chunks::<2>().0.iter().map(|&[u, v]| [u, 1.0 - v]));
        }
        if colored {
            let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
            mesh.colors.extend(triple(&part.vertex_color).into_iter().map(|rgb| rgb.map(byte)));
        }
        mesh.triangles.extend(part.indices.as_chunks::<3>().0.iter().map(|t| t.map(|i| i + base)));
    }

    let used: Vec<&tobj::Material> =
        models.iter().filter_map(|model| materials.get(model.mesh.material_id?)).collect();
    let mut material = Material::default();
    if let Some(name) = used.iter().find_map(|material| material.diffuse_texture.as_ref()) {
        if !textured {
            return Err(invalid(format!(
                "names the texture '{name}' but has vertices without texture coordinates (vt)"
            )));
        }
        material.texture = Some(load_texture(path, name)?);
    } else if let Some(diffuse) = used.iter().find_map(|material| material.diffuse) {
        material.base_color = diffuse.map(|v| if v.is_finite() { v.clamp(0.0, 1.0) } else { 0.8 });
    }
    finish(path, mesh, material)
}

/// Reads a PLY file, ASCII or binary, and scales it by `unit_scale` (0.001 for millimetres).
///
/// Vertices: `x y z`, and if there are any `nx ny nz`, `red green blue`, and `texture_u texture_v`, `s t` or `u v`.
/// Faces: lists of at least three indices, cut into fans of triangles. A header line `comment TextureFile NAME` names
/// the texture.
///
/// # Errors
/// If the file or its texture is missing, cut off or wrong.
pub fn load_ply(path: &Path, unit_scale: f64) -> Result<Visual> {
    let invalid = |message: String| Error::invalid(path, message);
    let file = std::fs::File::open(path).map_err(|source| Error::io(path, source))?;
    let ply = Parser::<DefaultElement>::new().read_ply(&mut BufReader::new(file)).map_err(|error| {
        let at = error.line().map(|line| format!(" near line {line}")).unwrap_or_default();
        invalid(format!("not a readable PLY file, or cut off{at}: {error}"))
    })?;
    let vertices = ply.payload.get("vertex").ok_or_else(|| invalid("has no element 'vertex'".into()))?;
    let faces =
        ply.payload.get("face").ok_or_else(|| invalid("has no element 'face': holds no triangles".into()))?;

    let mut mesh = Mesh::default();
    let first = vertices.first().ok_or_else(|| invalid("has no vertices".into()))?;
    let has = |names: &[&str]| names.iter().all(|name| first.contains_key(*name));
    if !has(&["x", "y", "z"]) {
        return Err(invalid("its vertices lack x, y or z".into()));
    }
    let number = |vertex: &DefaultElement, name: &str| {
        vertex.get(name).and_then(Property::to_f32_lossy).unwrap_or(f32::NAN)
    };
    let uv_names = [["texture_u", "texture_v"], ["s", "t"], ["u", "v"]].into_iter().find(|names| has(names));
    let normals = has(&["nx", "ny", "nz"]);
    let colors = has(&["red", "green", "blue"]);
    for vertex in vertices {
        let position = ["x", "y", "z"].map(|name| (f64::from(number(vertex, name)) * unit_scale) as f32);
        mesh.positions.push(Point3::from(position));
        if normals {
            mesh.normals.push(Vector3::from(["nx", "ny", "nz"].map(|name| number(vertex, name))));
        }
        if colors {
            let byte = |name| vertex.get(name).and_then(Property::to_u8_color_lossy).unwrap_or(0);
            mesh.colors.push(["red", "green", "blue"].map(byte));
        }
        if let Some([u, v]) = uv_names {
            // As in OBJ, v points up.
            mesh.uvs.push([number(vertex, u), 1.0 - number(vertex, v)]);
        }
    }
    for (index, face) in faces.iter().enumerate() {
        let corners = ["vertex_indices", "vertex_index"]
            .iter()
            .find_map(|name| face.get(*name))
            .and_then(Property::to_u32_list)
            .ok_or_else(|| invalid(format!("face {index} has no list 'vertex_indices' of vertex numbers")))?;
        let [first, rest @ ..] = corners.as_slice() else {
            return Err(invalid(format!("face {index} is empty")));
        };
        if rest.len() < 2 {
            return Err(invalid(format!(
                "face {index} has {} vertices; three or more make a face",
                corners.len()
            )));
        }
        mesh.triangles.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]]));
    }

    let mut material = Material::default();
    let texture = ply.header.comments.iter().find_map(|comment| comment.trim().strip_prefix("TextureFile"));
    if let Some(name) = texture {
        let name = name.trim();
        if mesh.uvs.is_empty() {
            return Err(invalid(format!(
                "names the texture '{name}' but its vertices have no texture_u and texture_v; \
                 export texture coordinates per vertex"
            )));
        }
        material.texture = Some(load_texture(path, name)?);
    }
    finish(path, mesh, material)
}

/// Checks the mesh, and sees to normals and to which colours count.
fn finish(path: &Path, mut mesh: Mesh, mut material: Material) -> Result<Visual> {
    let count = mesh.positions.len();
    let usable =
        mesh.normals.len() == count && mesh.normals.iter().all(|n| n.norm() > 1e-6 && n.norm() < 1e6);
    if usable {
        for normal in &mut mesh.normals {
            normal.normalize_mut();
        }
    } else {
        mesh.normals = vec![Vector3::z(); count];
    }
    mesh.validate().map_err(|message| Error::invalid(path, message))?;
    if !usable {
        mesh = mesh.compute_normals(CREASE);
    }
    if material.texture.is_some() {
        // Scans carry the texture's colours a second time, per vertex or as the material's: the texture alone counts.
        mesh.colors.clear();
        material.base_color = [1.0; 3];
    } else {
        mesh.uvs.clear();
        if !mesh.colors.is_empty() {
            material.base_color = [1.0; 3];
        }
    }
    Ok(Visual { mesh: Arc::new(mesh), material })
}

/// The texture that the mesh file at `mesh` names.
fn load_texture(mesh: &Path, name: &str) -> Result<Arc<RgbImage>> {
    let path = files::named(mesh.parent().unwrap_or(Path::new(".")), name);
    pictures::stored(&path).map(Arc::new).map_err(|error| match error {
        Error::Invalid { path, message } => {
            Error::invalid(path, format!("the texture of {} {message}", mesh.display()))
        }
        other => other,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    use std::path::PathBuf;

    const PLY_HEAD: &str = "ply\nformat ascii 1.0\ncomment TextureFile t.png\nelement vertex 4\nproperty float x\n\
        property float y\nproperty float z\nproperty float texture_u\nproperty float texture_v\nelement face 1\n\
        property list uchar int vertex_indices\nend_header\n";
    const PLY_BODY: &str = "0 0 0 0 0\n1000 0 0 1 0\n1000 1000 0 1 1\n0 1000 0 0 1\n4 0 1 2 3\n";
    const OBJ: &str = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl m\n\
        f 1/1 2/2 3/3 4/4\n";

    /// A folder with a red-over-blue texture `t.png`, a material library `m.mtl`, and the file `name`.
    fn folder(name: &str, content: &[u8]) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let mut image = RgbImage::new(4, 4);
        for (_, y, pixel) in image.enumerate_pixels_mut() {
            *pixel = image::Rgb(if y < 2 { [255, 0, 0] } else { [0, 0, 255] });
        }
        image.save(folder.path().join("t.png")).unwrap();
        std::fs::write(folder.path().join("m.mtl"), "newmtl m\nKd 0 0 0\nmap_Kd t.png\n").unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, content).unwrap();
        (folder, path)
    }

    /// The textured unit square: the vertex at y = 1 carries the texture's top.
    fn check_square(visual: &Visual) {
        let mesh = &visual.mesh;
        assert_eq!((mesh.positions.len(), mesh.triangles.len()), (4, 2));
        assert!(mesh.normals.iter().all(|n| (n - Vector3::z()).norm() < 1e-6));
        for (p, uv) in mesh.positions.iter().zip(&mesh.uvs) {
            assert_eq!(*uv, [p.x, 1.0 - p.y]);
        }
        assert_eq!(visual.material.base_color, [1.0; 3]);
        assert_eq!(visual.material.texture.as_ref().unwrap().get_pixel(0, 0).0, [255, 0, 0]);
    }

    #[test]
    fn a_textured_square_reads_the_same_from_obj_and_ply() {
        let (_keep, path) = folder("a.obj", OBJ.as_bytes());
        check_square(&load_obj(&path).unwrap());
        let (_keep, path) = folder("a.ply", format!("{PLY_HEAD}{PLY_BODY}").as_bytes());
        check_square(&load_ply(&path, 1e-3).unwrap());
    }

    #[test]
    fn binary_ply_with_colours_and_normals() {
        for big in [false, true] {
            let mut bytes = format!(
                "ply\nformat binary_{}_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
                 property float z\nproperty float nx\nproperty float ny\nproperty float nz\nproperty uchar red\n\
                 property uchar green\nproperty uchar blue\nelement face 1\n\
                 property list uchar uint vertex_index\nend_header\n",
                if big { "big" } else { "little" }
            )
            .into_bytes();
            let float = |v: f32| if big { v.to_be_bytes() } else { v.to_le_bytes() };
            for (x, y) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)] {
                for v in [x, y, 0.0, 0.0, 0.0, 2.0] {
                    bytes.extend(float(v));
                }
                bytes.extend([10, 20, 30]);
            }
            bytes.push(3);
            for i in [0u32, 1, 2] {
                bytes.extend(if big { i.to_be_bytes() } else { i.to_le_bytes() });
            }
            let (_keep, path) = folder("b.ply", &bytes);
            let visual = load_ply(&path, 1.0).unwrap();
            assert_eq!(visual.mesh.triangles, [[0, 1, 2]]);
            assert_eq!(visual.mesh.colors, [[10, 20, 30]; 3]);
            assert_eq!(visual.mesh.normals, [Vector3::z(); 3]);
            // A NaN in place of the first vertex's z.
            let start = bytes.len() - 13 - 3 * 27;
            let mut broken = bytes.clone();
            broken[start + 8..start + 12].copy_from_slice(&float(f32::NAN));
            std::fs::write(&path, broken).unwrap();
            assert!(load_ply(&path, 1.0).unwrap_err().to_string().contains("vertex 0 is (0, 0, NaN)"));
            // However much is cut off, that is an error and no panic.
            for length in 0..bytes.len() {
                std::fs::write(&path, &bytes[..length]).unwrap();
                let message = load_ply(&path, 1.0).unwrap_err().to_string();
                assert!(message.contains("b.ply"), "{length}: {message}");
            }
        }
    }

    #[test]
    fn ply_errors_name_the_file_and_the_reason() {
        let text = format!("{PLY_HEAD}{PLY_BODY}");
        for (from, to, wanted) in [
            ("1000 1000 0 1 1", "nan 1000 0 1 1", "near line 15"),
            ("1000 1000 0 1 1", "1e30 1000 0 1 1", "vertex 2"),
            ("4 0 1 2 3", "4 0 1 2 9", "vertex 9"),
            ("4 0 1 2 3", "3 0 1 -2", "face 0"),
            ("4 0 1 2 3", "2 0 1", "face 0 has 2 vertices"),
            ("element face 1", "element face 0", "no triangles"),
            ("4 0 1 2 3\n", "", "cut off"),
            ("property float z", "property float w", "lack x, y or z"),
            ("texture_u", "other", "texture_u"),
            ("t.png", "gone.png", "gone.png"),
            ("element vertex 4", "element vertex 4000000000", "cut off"),
        ] {
            let (_keep, path) = folder("a.ply", text.replacen(from, to, 1).as_bytes());
            let message = load_ply(&path, 1e-3).unwrap_err().to_string();
            assert!(message.contains(wanted), "{to}: {message}");
            assert!(wanted == "gone.png" || message.contains("a.ply"), "{to}: {message}");
        }
        assert!(
            load_ply(Path::new("/nowhere/x.ply"), 1.0).unwrap_err().to_string().contains("/nowhere/x.ply")
        );
    }

    #[test]
    fn obj_errors_name_the_file_and_the_reason() {
        for (from, to, wanted) in [
            ("v 1 1 0", "v nan 1 0", "vertex 2"),
            ("v 1 1 0", "v 1 x 0", "not a readable OBJ"),
            ("4/4\n", "9/4\n", "not a readable OBJ"),
            ("f 1/1 2/2 3/3 4/4\n", "", "no triangles"),
            ("f 1/1 2/2 3/3 4/4\n", "f 1 2 3 4\n", "texture coordinates"),
            ("m.mtl", "gone.mtl", "material library"),
        ] {
            let (_keep, path) = folder("a.obj", OBJ.replacen(from, to, 1).as_bytes());
            let message = load_obj(&path).unwrap_err().to_string();
            assert!(message.contains("a.obj") && message.contains(wanted), "{to}: {message}");
        }
        for damage in [&b""[..], b"\x89PNG\r\n\x1a\n"] {
            let (keep, path) = folder("a.obj", OBJ.as_bytes());
            std::fs::write(keep.path().join("t.png"), damage).unwrap();
            let message = load_obj(&path).unwrap_err().to_string();
            assert!(message.contains("t.png") && message.contains("a.obj"), "{message}");
            std::fs::remove_file(keep.path().join("t.png")).unwrap();
            assert!(load_obj(&path).unwrap_err().to_string().contains("t.png"));
        }
        assert!(load_obj(Path::new("/nowhere/x.obj")).unwrap_err().to_string().contains("/nowhere/x.obj"));
    }
}
