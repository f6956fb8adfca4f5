//! Wavefront OBJ files and their material libraries, as people's programs write them.
//!
//! `tobj` reads them, after what it does not bear is put right: text in an 8-bit encoding, colours of fewer than three numbers (on
//! which it panics), options before a texture's name (which it takes for a part of it).

use std::cell::RefCell;
use std::path::Path;

use nalgebra::{Point3, Vector3};

use crate::files::{self, text::lenient};
use crate::mesh::Mesh;
use crate::polygon;
use crate::{Error, Result};

/// Models and materials of an OBJ file, its faces cut into triangles. Of a material library that is not there the materials are
/// missing, and `absent` holds its name.
///
/// # Errors
/// What is wrong with the file, or with a material library: its name, line and keyword.
pub(crate) fn load(path: &Path) -> Result<Obj> {
    let folder = path.parent().unwrap_or(Path::new("."));
    let (wrong, absent) = (RefCell::new(None), RefCell::new(None));
    let library = |name: &Path| {
        let path = folder.join(name);
        let shown = path.display().to_string();
        if !files::exists(&path) {
            absent.replace(Some(shown));
            return Ok(Default::default());
        }
        let bytes = files::read(&path).map_err(Error::without_file);
        let mended = bytes.and_then(|bytes| mended_library(&lenient(bytes)));
        mended
            .and_then(|text| tobj::load_mtl_buf(&mut text.as_bytes()).map_err(|error| error.to_string()))
            .map_err(|reason| {
                wrong.replace(Some(format!("its material library {shown}: {reason}")));
                tobj::LoadError::MaterialParseError
            })
    };
    let object = lenient(files::read(path)?);
    let object = mended_object(&object, folder)
        .map_err(|reason| Error::invalid(path, format!("not a readable OBJ file: {reason}")))?;
    let unreadable = |reason: String| Error::invalid(path, format!("not a readable OBJ file: {reason}"));
    let (mut models, materials) = tobj::load_obj_buf(&mut object.as_bytes(), &OPTIONS, library)
        .map_err(|error| unreadable(error.to_string()))?;
    models.iter_mut().for_each(|model| cut(&mut model.mesh));
    let materials =
        materials.map_err(|error| unreadable(wrong.take().unwrap_or_else(|| error.to_string())))?;
    let absent = absent.take();
    if absent.is_none() {
        let mut unknown: Vec<&str> = object
            .split(['\n', '\r'])
            .filter_map(|line| line.trim_start().strip_prefix("usemtl "))
            .map(str::trim)
            .filter(|name| materials.iter().all(|material| material.name.trim() != *name))
            .collect();
        unknown.sort_unstable();
        unknown.dedup();
        if !unknown.is_empty() {
            log::warn!(
                "{}: uses materials that no library of it has, which are grey: {}",
                path.display(),
                unknown.join(", ")
            );
        }
    }
    Ok(Obj { models, materials, absent })
}

/// The mesh of a model. Texture coordinates and colours are none where not every vertex has them, as where faces with and without
/// them are in one group.
pub(crate) fn mesh(model: &tobj::Mesh) -> Mesh {
    let triples = |values: &[f32]| -> Vec<[f32; 3]> { values.as_chunks::<3>().0.to_vec() };
    let count = model.positions.len() / 3;
    let whole = |values: &'_ [f32], each: usize| values.len() == each * count;
    let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
    let mut mesh = Mesh {
        positions: triples(&model.positions).into_iter().map(Point3::from).collect(),
        normals: triples(&model.normals).into_iter().map(Vector3::from).collect(),
        triangles: model.indices.as_chunks::<3>().0.to_vec(),
        ..Mesh::default()
    };
    if whole(&model.texcoords, 2) {
        // OBJ's v points up, ours down.
        mesh.uvs = model.texcoords.as_chunks::<2>().0.iter().map(|&[u, v]| [u, 1.0 - v]).collect();
    }
    if whole(&model.vertex_color, 3) {
        mesh.colors = triples(&model.vertex_color).into_iter().map(|rgb| rgb.map(byte)).collect();
    }
    mesh
}

/// An OBJ file.
pub(crate) struct Obj {
    pub models: Vec<tobj::Model>,
    pub materials: Vec<tobj::Material>,
    /// A material library that it names and that is not there.
    pub absent: Option<String>,
}

/// One index a vertex. `tobj` cuts faces as if all were convex: that is left to us.
const OPTIONS: tobj::LoadOptions = tobj::LoadOptions { triangulate: false, ..tobj::GPU_LOAD_OPTIONS };

/// Cuts faces into triangles.
fn cut(mesh: &mut tobj::Mesh) {
    if mesh.face_arities.is_empty() {
        return;
    }
    let corner = |&index: &u32| {
        let at = 3 * index as usize;
        mesh.positions
            .get(at..at + 3)
            .map_or(Vector3::repeat(f64::NAN), |p| Vector3::from_fn(|i, _| p[i].into()))
    };
    let (mut rest, mut indices) = (mesh.indices.as_slice(), Vec::new());
    for arity in &mesh.face_arities {
        let (face, after) = rest.split_at((*arity as usize).min(rest.len()));
        let corners: Vec<Vector3<f64>> = face.iter().map(corner).collect();
        indices.extend(polygon::triangles(&corners).iter().flatten().map(|&i| face[i]));
        rest = after;
    }
    mesh.indices = indices;
    mesh.face_arities.clear();
}

/// An OBJ with what `tobj` does not bear put right: lines that go on, comments behind them, polylines (which it takes for faces),
/// several libraries in one line.
fn mended_object(text: &str, folder: &Path) -> std::result::Result<String, String> {
    let text = text.replace("\\\r\n", " ").replace("\\\n", " ");
    let ends: &[char] = if text.contains('\n') { &['\n'] } else { &['\r'] };
    // Faces may come before what they are made of.
    let count =
        |keyword| text.split(ends).filter(|line| line.split_whitespace().next() == Some(keyword)).count();
    let all = ["v", "vt", "vn"].map(count);
    let mut so_far = [0; 3];
    let mut mended = String::with_capacity(text.len());
    for (i, line) in text.split(ends).enumerate() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("l" | "p") => {}
            Some("mtllib") => {
                for name in libraries(line.trim_start()["mtllib".len()..].trim(), folder) {
                    mended += &format!("mtllib {name}\n");
                }
            }
            Some(keyword @ ("v" | "vn" | "vt" | "f")) => {
                let line = line.split('#').next().unwrap_or_default();
                if keyword != "f"
                    && let Some(word) =
                        line.split_whitespace().skip(1).find(|word| word.parse::<f32>().is_err())
                {
                    return Err(format!("line {}, '{}': '{word}' is no number", i + 1, line.trim()));
                }
                match keyword {
                    "f" => face(line, all, so_far)
                        .map_err(|reason| format!("line {}, '{}': {reason}", i + 1, line.trim()))?,
                    "v" => so_far[0] += 1,
                    "vt" => so_far[1] += 1,
                    _ => so_far[2] += 1,
                }
                mended += line;
            }
            _ => mended += line,
        }
        mended.push('\n');
    }
    Ok(mended)
}

/// Checks a face's numbers of vertices, texture coordinates and normals: `all` there are, `so_far` before it.
fn face(line: &str, all: [usize; 3], so_far: [usize; 3]) -> std::result::Result<(), String> {
    const WHAT: [&str; 3] = ["vertices", "texture coordinates (vt)", "normals (vn)"];
    for corner in line.split_whitespace().skip(1) {
        for (i, word) in corner.split('/').enumerate() {
            let index = match word.parse::<i64>() {
                Err(_) if word.is_empty() && i > 0 => continue,
                Ok(index) if i < 3 => index,
                _ => return Err(format!("'{corner}' is no corner; write v, v/vt, v//vn or v/vt/vn")),
            };
            // Numbers begin at 1; those below 0 count back from the last one before.
            let there = if index > 0 { all[i] } else { so_far[i] };
            if index == 0 || index.unsigned_abs() > there as u64 {
                return Err(format!("names {index} of {there} {}", WHAT[i]));
            }
        }
    }
    Ok(())
}

/// Names of material libraries: one with spaces in it, or several.
fn libraries(text: &str, folder: &Path) -> Vec<String> {
    let plain = text.trim_matches('"').replace('\\', "/");
    let there = |name: &str| files::exists(&folder.join(name));
    let several: Vec<&str> = plain.split_whitespace().collect();
    if plain.is_empty() {
        Vec::new()
    } else if !there(&plain) && several.len() > 1 && several.iter().any(|name| there(name)) {
        several.into_iter().map(str::to_owned).collect()
    } else {
        vec![plain]
    }
}

/// The material library's lines that are used, with what `tobj` does not bear put right.
fn mended_library(text: &str) -> std::result::Result<String, String> {
    let mut mended = String::with_capacity(text.len());
    for (i, line) in text.split(['\n', '\r']).enumerate() {
        let words: Vec<&str> = line.split_whitespace().take_while(|word| !word.starts_with('#')).collect();
        let of_line = |reason: String| format!("line {}, '{}': {reason}", i + 1, line.trim());
        // What else a material has is not used, however it is written.
        let Some(keyword) = words.first() else { continue };
        match keyword.to_ascii_lowercase().as_str() {
            "newmtl" => mended += &format!("newmtl {}\n", words[1..].join(" ")),
            "kd" => mended += &format!("Kd {}\n", color(&words[1..]).map_err(of_line)?),
            "map_kd" => {
                let name = map_name(line.trim_start()[keyword.len()..].trim()).trim_matches('"');
                if name.is_empty() {
                    log::warn!("a material's {} names no texture", line.trim());
                } else {
                    mended += &format!("map_Kd {name}\n");
                }
            }
            _ => {}
        }
    }
    Ok(mended)
}

/// Three numbers; green and blue may be left out, and are then as red.
fn color(words: &[&str]) -> std::result::Result<String, String> {
    let number = |word: &&str| word.parse::<f32>().is_ok_and(f32::is_finite);
    match words {
        [r] if number(r) => Ok(format!("{r} {r} {r}")),
        [r, g] if number(r) && number(g) => Ok(format!("{r} {g} {r}")),
        [r, g, b, ..] if [r, g, b].into_iter().all(number) => Ok(format!("{r} {g} {b}")),
        [] => Err("needs a colour, three numbers".into()),
        _ => Err("is not a colour of three numbers; spectra and CIE XYZ are not read".into()),
    }
}

/// The name of a texture behind its options, which are not followed.
fn map_name(text: &str) -> &str {
    let mut rest = text;
    while let Some(option) = rest.split_whitespace().next().filter(|word| word.starts_with('-')) {
        let values = match option {
            "-o" | "-s" | "-t" => 3,
            "-mm" => 2,
            "-blendu" | "-blendv" | "-boost" | "-bm" | "-cc" | "-clamp" | "-imfchan" | "-texres"
            | "-type" => 1,
            // A file's name may begin with a hyphen.
            _ => break,
        };
        log::warn!("texture option {option} is not followed: {text}");
        rest = rest[option.len()..].trim_start();
        for i in 0..values {
            let Some(word) = rest.split_whitespace().next() else { break };
            // Of three numbers one may stand alone.
            if values == 3 && i > 0 && word.parse::<f32>().is_err() {
                break;
            }
            rest = rest[word.len()..].trim_start();
        }
    }
    rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_colour_of_fewer_numbers_is_grey_and_one_of_none_is_an_error_with_its_line() {
        let mended = |text: &str| mended_library(text).unwrap();
        assert_eq!(mended("newmtl a # red\n\tKd 0.6\r\nKs .1 .2 # of print\n"), "newmtl a\nKd 0.6 0.6 0.6\n");
        assert_eq!(mended("kd 0.1 0.2 0.3 0.4\nNs ten\nillum 2.0\nd -halo\n"), "Kd 0.1 0.2 0.3\n");
        assert_eq!(mended("map_Kd \"a b.png\"\nmap_Kd\n"), "map_Kd a b.png\n");
        let error = mended_library("newmtl a\nKd\n").unwrap_err();
        assert_eq!(error, "line 2, 'Kd': needs a colour, three numbers");
        let error = mended_library("Kd spectral film.rfl 1").unwrap_err();
        assert!(error.contains("line 1") && error.contains("spectra"), "{error}");
        assert!(mended_library("Kd red green blue").is_err());
    }

    #[test]
    fn options_are_no_part_of_a_textures_name() {
        let cases = [
            ("label.png", "label.png"),
            ("-s 2 2 1 label.png", "label.png"),
            ("-s 2 -o 0.5 0.5 -clamp on my label.png", "my label.png"),
            ("-mm 0 1 -bm 0.5 -texres 512 a.png", "a.png"),
            ("-strange.png", "-strange.png"),
            ("-s 1 1", ""),
            ("", ""),
        ];
        for (text, wanted) in cases {
            assert_eq!(map_name(text), wanted, "{text}");
        }
    }

    #[test]
    fn objects_are_read_as_people_write_them() {
        let folder = tempfile::tempdir().unwrap();
        let mended = |text: &str| mended_object(text, folder.path());
        assert_eq!(
            mended("f 1 \\\n1 1 # c\nl 1 2 3\nv 0 0 1 1 0 0\n"),
            Ok("f 1  1 1 \n\nv 0 0 1 1 0 0\n\n".into())
        );
        assert_eq!(mended("v 0 0 0\rv 1 0 0"), Ok("v 0 0 0\nv 1 0 0\n".into()));
        assert_eq!(mended("v 0,5 1 2"), Err("line 1, 'v 0,5 1 2': '0,5' is no number".into()));
        let corners = "v 0 0 0\nv 1 0 0\nf 1 2 3\nv 0 1 0\nf 1 2 -3\nvn 0 0 1\nf 1//1 2//1 3//-1\n";
        assert!(mended(corners).is_ok());
        for (from, to, wanted) in [
            ("f 1 2 3", "f 1 2 4", "line 3, 'f 1 2 4': names 4 of 3 vertices"),
            ("f 1 2 3", "f 1 2 -3", "line 3, 'f 1 2 -3': names -3 of 2 vertices"),
            ("f 1 2 3", "f 0 1 2", "line 3, 'f 0 1 2': names 0 of 2 vertices"),
            ("1//1", "1/1", "names 1 of 0 texture coordinates"),
            ("1//1", "x", "'x' is no corner"),
            ("//-1", "//-2", "line 7, 'f 1//1 2//1 3//-2': names -2 of 1 normals"),
        ] {
            let text = corners.replacen(from, to, 1);
            let error = mended(&text).unwrap_err();
            assert!(error.contains(wanted), "{wanted}\n{error}");
        }
        std::fs::write(folder.path().join("b.mtl"), "newmtl b").unwrap();
        assert_eq!(libraries("a.mtl b.mtl", folder.path()), ["a.mtl", "b.mtl"]);
        assert_eq!(libraries("my file.mtl", folder.path()), ["my file.mtl"]);
        assert_eq!(libraries("\".\\b.mtl\"", folder.path()), ["./b.mtl"]);

        // A concave face, and a polyline, which is none.
        let path = folder.path().join("l.obj");
        let outline = "v 0 0 0\nv 3 0 0\nv 3 1 0\nv 1 1 0\nv 1 3 0\nv 0 3 0\n";
        std::fs::write(&path, format!("{outline}l 1 2 3 4\nf 4 5 6 1 2 3\nf 1 2 3\n")).unwrap();
        let mesh = &load(&path).unwrap().models[0].mesh;
        assert_eq!(mesh.indices.len(), 3 * 5);
    }
}
