//! Wavefront OBJ files as a [`Visual`], and what all formats have in common.
//!
//! Whatever the files hold, the result passes [`Mesh::validate`], or there is an error that names the file.

use std::path::Path;
use std::sync::Arc;

use super::obj::{self, Obj};
pub use super::ply::load_ply;
pub(super) use super::ply::load_ply_mesh;
use crate::files;
use crate::mesh::{Material, Mesh, Visual};
use crate::pictures;
use crate::{Error, Result};
use image::RgbImage;
use nalgebra::Vector3;

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
    let Obj { models, materials, absent } = obj::load(path)?;
    // What an object looks like matters, unlike a robot's link.
    if let Some(library) = absent {
        return Err(invalid(format!("its material library {library} is missing; it belongs beside the OBJ")));
    }

    let parts: Vec<Mesh> = models.iter().map(|model| obj::mesh(&model.mesh)).collect();
    let textured = parts.iter().all(|part| part.uvs.len() == part.positions.len());
    let colored = parts.iter().all(|part| part.colors.len() == part.positions.len());
    let mut mesh = Mesh::default();
    for part in parts {
        let base = mesh.positions.len() as u32;
        mesh.positions.extend(part.positions);
        mesh.normals.extend(part.normals);
        if textured {
            mesh.uvs.extend(part.uvs);
        }
        if colored {
            mesh.colors.extend(part.colors);
        }
        mesh.triangles.extend(part.triangles.iter().map(|t| t.map(|i| i + base)));
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

/// Checks the mesh, and sees to normals and to which colours count.
pub(super) fn finish(path: &Path, mut mesh: Mesh, mut material: Material) -> Result<Visual> {
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
    if mesh.volume() < 0.0 && mesh.is_closed() {
        log::warn!("{}: its faces are wound inwards; they are turned", path.display());
        mesh.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        mesh.normals.iter_mut().for_each(|normal| *normal = -*normal);
    }
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
pub(super) fn load_texture(mesh: &Path, name: &str) -> Result<Arc<RgbImage>> {
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

    const CUBE: &str = "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n\
        element face 6\nproperty list uchar int vertex_indices\nproperty uchar red\nproperty uchar green\n\
        property uchar blue\nend_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 1\n1 0 1\n1 1 1\n0 1 1\n\
        4 3 2 1 0 9 0 0\n4 4 5 6 7 9 9 0\n4 0 1 5 4 9 0 9\n4 1 2 6 5 0 9 0\n4 2 3 7 6 0 0 9\n4 3 0 4 7 9 9 9\n";

    #[test]
    fn colours_of_faces_are_those_of_their_corners() {
        let (_keep, path) = folder("c.ply", CUBE.as_bytes());
        let mesh = load_ply(&path, 1.0).unwrap().mesh;
        assert!(mesh.triangles.len() == 12 && mesh.colors.len() == mesh.positions.len());
        for triangle in &mesh.triangles {
            let corners = triangle.map(|i| mesh.colors[i as usize]);
            assert!(corners[0] == corners[1] && corners[0] == corners[2]);
            // The floor's colour is on the floor.
            let floor = triangle.iter().all(|&i| mesh.positions[i as usize].z == 0.0);
            assert_eq!(floor, corners[0] == [9, 0, 0]);
        }
    }

    #[test]
    fn texture_coordinates_of_corners_are_read() {
        let head = PLY_HEAD
            .replace("property float texture_u\nproperty float texture_v\n", "")
            .replace("int vertex_indices\n", "int vertex_indices\nproperty list uchar float texcoord\n");
        let body = "0 0 0\n1000 0 0\n1000 1000 0\n0 1000 0\n4 0 1 2 3 8 0 0 1 0 1 1 0 1\n";
        let (_keep, path) = folder("w.ply", format!("{head}{body}").as_bytes());
        check_square(&load_ply(&path, 1e-3).unwrap());
        let (_keep, path) =
            folder("w.ply", format!("{head}{}", body.replace("8 0 0 1 0", "6 1 0")).as_bytes());
        assert!(load_ply(&path, 1e-3).unwrap_err().to_string().contains("4 vertices, but 6 texture"));
    }

    #[test]
    fn a_closed_mesh_that_is_wound_inwards_is_turned() {
        let turned =
            CUBE.replace("3 2 1 0", "0 1 2 3").replace("4 5 6 7", "7 6 5 4").replace("0 1 5 4", "4 5 1 0");
        let turned =
            turned.replace("1 2 6 5", "5 6 2 1").replace("2 3 7 6", "6 7 3 2").replace("3 0 4 7", "7 4 0 3");
        for text in [CUBE.to_owned(), turned] {
            let (_keep, path) = folder("c.ply", text.as_bytes());
            let mesh = load_ply(&path, 1.0).unwrap().mesh;
            assert!((mesh.volume() - 1.0).abs() < 1e-6, "{}", mesh.volume());
            let center = Vector3::repeat(0.5);
            assert!(mesh.positions.iter().zip(&mesh.normals).all(|(p, n)| (p.coords - center).dot(n) > 0.1));
        }
    }

    #[test]
    fn a_comment_in_another_encoding_does_no_harm() {
        let text = format!("{PLY_HEAD}{PLY_BODY}");
        let text = text.replacen("comment", "comment made by M@ller\ncomment", 1);
        let bytes: Vec<u8> = text.bytes().map(|byte| if byte == b'@' { 0xfc } else { byte }).collect();
        let (_keep, path) = folder("l.ply", &bytes);
        check_square(&load_ply(&path, 1e-3).unwrap());
    }

    #[test]
    fn a_pointer_an_archive_and_a_page_are_no_meshes() {
        let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 1\n";
        for (bytes, wanted) in
            [(pointer, "git lfs pull"), ("PK\u{3}\u{4}", "zip archive"), ("<html>", "HTML"), ("", "is empty")]
        {
            let (_keep, path) = folder("a.ply", bytes.as_bytes());
            assert!(load_ply(&path, 1.0).unwrap_err().to_string().contains(wanted));
            let (_keep, path) = folder("a.obj", bytes.as_bytes());
            assert!(load_obj(&path).unwrap_err().to_string().contains(wanted));
        }
    }

    #[test]
    fn ply_text_is_read_as_programs_write_numbers_and_lines() {
        let plain = format!("{PLY_HEAD}{PLY_BODY}");
        let normals = plain
            .replace(
                "property float texture_u",
                "property float nx\nproperty float ny\nproperty float nz\nproperty float texture_u",
            )
            .replace("1000 0 0 1 0", "1.e3 0 0 nan -nan inf 1. .0")
            .replace("0 0 0 0 0\n", "0 0 0 0 0 1 0 0\n")
            .replace("1000 1000 0 1 1", "1000 1000 0 0 0 1 1 1")
            .replace("0 1000 0 0 1", "0 1000 0 0 0 1 0 1");
        for text in [plain.replace('\n', "\r"), plain.replace('\n', "\r\n"), normals] {
            let (_keep, path) = folder("a.ply", text.as_bytes());
            check_square(&load_ply(&path, 1e-3).unwrap_or_else(|error| panic!("{text}: {error}")));
        }
        // All of a file that has no lines is not cited.
        let (_keep, path) = folder("a.ply", plain.replace('\n', "  ").repeat(9).as_bytes());
        assert!(load_ply(&path, 1e-3).unwrap_err().to_string().len() < 600);
    }

    #[test]
    fn ply_errors_name_the_file_and_the_reason() {
        let text = format!("{PLY_HEAD}{PLY_BODY}");
        for (from, to, wanted) in [
            ("1000 1000 0 1 1", "nan 1000 0 1 1", "vertex 2"),
            ("1000 1000 0 1 1", "1000 1,5 0 1 1", "near line 15"),
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
