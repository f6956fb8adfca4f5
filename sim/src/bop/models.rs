//! The models folder of a data set: PLY files in millimetres, their textures, and `models_info.json`.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::path::Path;

use nalgebra::{Isometry3, Point3, Translation3};

use super::format::{self, MILLIMETRE, ModelFile, ModelInfo, Symmetries, SymmetryAxis};
use super::pictures;
use super::staging::Staging;
use super::texture;
use crate::mesh::Mesh;
use crate::objects::{ObjectInfo, ObjectModel};
use crate::{Error, Result};

/// Writes `obj_NNNNNN.ply` (and `.png` where textured) of each model and `models_info.json` to `folder`, which appears
/// whole. Numbers are the objects' BOP ids, coordinates those of the object frame in millimetres.
///
/// A PLY file has a texture or vertex colours: where a model has both, and a base colour, they are multiplied into one
/// texture. Roughness and metal are lost.
///
/// # Errors
/// If `folder` exists, two models have one id, or a file cannot be written.
pub fn export_models<'a>(folder: &Path, models: impl IntoIterator<Item = &'a ObjectModel>) -> Result<()> {
    export(folder, models, |staging, model| {
        let id = model.info.bop_id;
        let (mesh, texture) = texture::plain(&model.visual);
        let picture = format!("obj_{id:06}.png");
        if let Some(texture) = &texture {
            staging.write(&picture, &pictures::encode_rgb(Path::new(&picture), texture)?)?;
        }
        let ply = encode_ply(&mesh, texture.as_ref().map(|_| picture.as_str()));
        staging.write(&format!("obj_{id:06}.ply"), &ply)
    })
}

/// Longest edge of a model for evaluation, metres.
const EVALUATION_EDGE: f64 = 0.009;

/// Writes the models as the benchmark's tools measure with them: the same surfaces and numbers without looks, their vertices
/// spread about evenly, so that the mean over vertices in ADD and ADD-S is one over the surface.
///
/// # Errors
/// As [`export_models`].
pub fn export_evaluation_models<'a>(
    folder: &Path,
    models: impl IntoIterator<Item = &'a ObjectModel>,
) -> Result<()> {
    export(folder, models, |staging, model| {
        let mesh = model.visual.mesh.refined(EVALUATION_EDGE);
        staging.write(&format!("obj_{:06}.ply", model.info.bop_id), &encode_ply(&mesh, None))
    })
}

/// A folder with `models_info.json` and what `write` makes of each model.
fn export<'a>(
    folder: &Path,
    models: impl IntoIterator<Item = &'a ObjectModel>,
    write: impl Fn(&Staging, &ObjectModel) -> Result<()>,
) -> Result<()> {
    let staging = Staging::begin(folder)?;
    let mut infos: BTreeMap<u32, ModelFile> = BTreeMap::new();
    let mut written: Vec<&ObjectModel> = Vec::new();
    for model in models {
        // Of several instances of an object there is one model.
        if written.iter().any(|earlier| std::ptr::eq(*earlier, model)) {
            continue;
        }
        written.push(model);
        write(&staging, model)?;
        if infos.insert(model.info.bop_id, ModelFile::from(&model_info(model))).is_some() {
            let message = format!(
                "bop_id = {} of {}: is used by another model too",
                model.info.bop_id, model.info.name
            );
            return Err(Error::invalid(folder, message));
        }
    }
    staging.write("models_info.json", format::lines(Path::new("models_info.json"), &infos)?.as_bytes())?;
    staging.finish().map(|_| ())
}

/// Size and symmetries of a model as they go to `models_info.json`.
pub fn model_info(model: &ObjectModel) -> ModelInfo {
    ModelInfo {
        diameter: model.diameter,
        min: model.min,
        size: model.size(),
        symmetries: symmetries(&model.info),
    }
}

/// The declared symmetries of an object. They turn about the origin, as the object's frame is centred.
pub fn symmetries(info: &ObjectInfo) -> Symmetries {
    let half_turn = |axis: &crate::objects::Axis| {
        // By the matrix and not by sine and cosine, so that files have ones and zeros.
        let rotation = nalgebra::Rotation3::from_matrix_unchecked(
            axis.turn(PI).to_rotation_matrix().matrix().map(f64::round),
        );
        Isometry3::from_parts(Translation3::identity(), rotation.into())
    };
    Symmetries {
        discrete: info.half_turns.iter().map(half_turn).collect(),
        continuous: info
            .revolution
            .iter()
            .map(|axis| SymmetryAxis { axis: axis.unit(), through: Point3::origin() })
            .collect(),
    }
}

/// A binary little-endian PLY in millimetres. With `texture`, the name of a picture beside it, vertices have
/// `texture_u texture_v`, else `red green blue` if the mesh has colours.
///
/// The picture's bottom has v = 0, as in the toolkit, whose renderer turns the picture over for OpenGL.
fn encode_ply(mesh: &Mesh, texture: Option<&str>) -> Vec<u8> {
    let mut header = String::from("ply\nformat binary_little_endian 1.0\ncomment millimetres\n");
    if let Some(name) = texture {
        header.push_str(&format!("comment TextureFile {name}\n"));
    }
    header.push_str(&format!("element vertex {}\n", mesh.positions.len()));
    let floats: &[&str] = match texture {
        Some(_) => &["x", "y", "z", "nx", "ny", "nz", "texture_u", "texture_v"],
        None => &["x", "y", "z", "nx", "ny", "nz"],
    };
    floats.iter().for_each(|name| header.push_str(&format!("property float {name}\n")));
    let colored = texture.is_none() && !mesh.colors.is_empty();
    if colored {
        ["red", "green", "blue"].iter().for_each(|name| header.push_str(&format!("property uchar {name}\n")));
    }
    // `int` and not `uint`: the toolkit's reader knows no other whole numbers than `int` and `uchar`.
    header.push_str(&format!(
        "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        mesh.triangles.len()
    ));
    let mut file = header.into_bytes();
    for (index, (p, n)) in mesh.positions.iter().zip(&mesh.normals).enumerate() {
        let mm = p.coords.map(|metres| (f64::from(metres) / MILLIMETRE) as f32);
        mm.iter().chain(n.iter()).for_each(|value| file.extend(value.to_le_bytes()));
        if texture.is_some() {
            let [u, v] = mesh.uvs[index];
            [u, 1.0 - v].iter().for_each(|value| file.extend(value.to_le_bytes()));
        }
        if colored {
            file.extend(mesh.colors[index]);
        }
    }
    for triangle in &mesh.triangles {
        file.push(3);
        triangle.iter().for_each(|vertex| file.extend(vertex.to_le_bytes()));
    }
    file
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;
    use std::sync::Arc;

    use super::*;
    use crate::bop::Dataset;
    use crate::mesh::{Material, Visual};
    use crate::objects::{ObjectLibrary, ObjectSet};
    use crate::render::srgb::{LINEAR_OF_8BIT, color_to_linear};

    fn table() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/objects.toml")
    }

    /// The colour in the middle of a triangle as a renderer would have it, linear, nearest texel.
    fn color(visual: &Visual, triangle: [u32; 3]) -> [f32; 3] {
        let mesh = &visual.mesh;
        let mean =
            |value: &dyn Fn(usize) -> f32| triangle.iter().map(|&i| value(i as usize)).sum::<f32>() / 3.0;
        let base = color_to_linear(visual.material.base_color);
        std::array::from_fn(|channel| {
            let mut light = base[channel];
            if !mesh.colors.is_empty() {
                light *= mean(&|i| LINEAR_OF_8BIT[usize::from(mesh.colors[i][channel])]);
            }
            if let Some(texture) = &visual.material.texture {
                let (width, height) = texture.dimensions();
                let at = |axis: usize, size: u32| {
                    let texel = (mean(&|i| mesh.uvs[i][axis]) * size as f32).floor() as i64;
                    texel.rem_euclid(i64::from(size)) as u32
                };
                let texel = texture.get_pixel(at(0, width), at(1, height));
                light *= LINEAR_OF_8BIT[usize::from(texel.0[channel])];
            }
            light
        })
    }

    #[test]
    fn exported_models_read_back_in_shape_and_colour() {
        let folder = tempfile::tempdir().unwrap();
        let library = ObjectLibrary::open(&table(), ObjectSet::BuiltIn).unwrap();
        let mut models: Vec<Arc<ObjectModel>> =
            library.names().map(|name| library.load(name).unwrap()).collect();
        // One without any texture and one of a single colour.
        for (id, colors) in [(30, true), (31, false)] {
            let mut model = ObjectModel::clone(&models[9]);
            let mut mesh = Mesh::clone(&model.visual.mesh);
            mesh.uvs.clear();
            if !colors {
                mesh.colors.clear();
            }
            let material = Material { base_color: [0.8, 0.5, 1.0], ..Material::default() };
            model.visual = Arc::new(Visual { mesh: Arc::new(mesh), material });
            model.info.bop_id = id;
            models.push(Arc::new(model));
        }
        // A split, so that the reader takes it for a data set.
        std::fs::create_dir_all(folder.path().join("test/000000")).unwrap();
        export_models(&folder.path().join("models"), models.iter().map(Arc::as_ref)).unwrap();
        let set = Dataset::open(folder.path(), None).unwrap();
        let infos = set.models_info().unwrap();
        assert_eq!(set.model_ids().unwrap(), infos.keys().copied().collect::<Vec<_>>());
        for model in &models {
            let (name, id) = (&model.info.name, model.info.bop_id);
            let back = set.load_model(id).unwrap();
            let info = &infos[&id];
            assert!(
                (info.diameter - model.diameter).abs() < 1e-12 && (info.size - model.size()).norm() < 1e-12
            );
            assert_eq!(back.mesh.triangles.len(), model.visual.mesh.triangles.len(), "{name}");
            let mut off = 0.0_f64;
            let mut shades = 0.0_f32;
            for (index, triangle) in model.visual.mesh.triangles.iter().enumerate() {
                let (a, b) = (model.visual.mesh.corners(index), back.mesh.corners(index));
                off = (0..3).map(|i| (a[i] - b[i]).norm()).fold(off, f64::max);
                let other = back.mesh.triangles[index];
                for i in 0..3 {
                    let [m, n] = [(&model.visual, triangle[i]), (&Arc::new(back.clone()), other[i])]
                        .map(|(visual, vertex)| visual.mesh.normals[vertex as usize]);
                    assert!((m - n).norm() < 1e-5, "{name}");
                }
                let [a, b] = [color(&model.visual, *triangle), color(&back, other)];
                shades += (0..3).map(|i| (a[i] - b[i]).abs()).fold(0.0, f32::max);
            }
            shades /= back.mesh.triangles.len() as f32;
            let texture = back.material.texture.as_ref().map(|texture| texture.dimensions());
            println!("{name}: off {:.1e} mm, mean colour off {shades:.4}, texture {texture:?}", off * 1e3);
            assert!(off < 1e-6, "{name}: {off} m");
            // A texel of a noisy label may round the other way.
            assert!(shades < 4e-3, "{name}: {shades}");
        }
        assert!(export_models(&folder.path().join("models"), []).unwrap_err().to_string().contains("exists"));
    }

    #[test]
    fn symmetries_go_through_the_file() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(folder.path().join("test/000000")).unwrap();
        let library = ObjectLibrary::open(&table(), ObjectSet::BuiltIn).unwrap();
        let models = ["002_master_chef_can", "003_cracker_box"].map(|name| library.load(name).unwrap());
        export_models(&folder.path().join("models"), models.iter().map(Arc::as_ref)).unwrap();
        let text = std::fs::read_to_string(folder.path().join("models/models_info.json")).unwrap();
        assert!(
            text.contains("[-1.0,0.0,0.0,0.0,0.0,-1.0,0.0,0.0,0.0,0.0,1.0,0.0,0.0,0.0,0.0,1.0]"),
            "{text}"
        );
        let infos = Dataset::open(folder.path(), None).unwrap().models_info().unwrap();
        let can = &infos[&1].symmetries;
        assert_eq!((can.discrete.len(), can.continuous.len()), (1, 1));
        // Steps of a hundredth of the diameter: 315 round, upright and upside down.
        let all = can.transforms(0.01);
        assert_eq!(all.len(), 630);
        let rim = Point3::new(0.05, 0.0, 0.07);
        assert!(all.iter().all(|turn| {
            let p = turn * rim;
            (p.xy().coords.norm() - 0.05).abs() < 1e-9 && (p.z.abs() - 0.07).abs() < 1e-9
        }));
        assert_eq!(infos[&2].symmetries.transforms(0.01).len(), 4);
    }
}
