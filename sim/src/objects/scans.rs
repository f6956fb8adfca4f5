//! Scanned models of the YCB objects: the official scans, and the copies of BOP.

use std::path::Path;
use std::sync::Arc;

use super::{ObjectInfo, ObjectModel, decompose, mesh_io};
use crate::mesh::{Mesh, Visual};
use crate::{Error, Result};

/// BOP writes millimetres.
const MILLIMETRE: f64 = 1e-3;

/// Reads `folder/NNN_name/google_16k/textured.obj` and moves it to the BOP frame.
///
/// BOP made its frames by moving the centre of the scan's bounding box to the origin, without a turn.
///
/// # Errors
/// If the object's folder or mesh is missing, or a file is wrong.
pub fn load_ycb(folder: &Path, info: ObjectInfo) -> Result<ObjectModel> {
    let path = folder.join(&info.name).join("google_16k").join("textured.obj");
    if !path.is_file() {
        return Err(missing(&path, &info, "the official YCB set has NNN_name/google_16k/textured.obj"));
    }
    let mut visual = mesh_io::load_obj(&path)?;
    visual.mesh = Arc::new(Arc::unwrap_or_clone(visual.mesh).centered());
    model(&path, info, visual)
}

/// Reads `folder/obj_NNNNNN.ply`, in millimetres and in the BOP frame already; it is not moved, so that poses from BOP
/// data hold to the last digit.
///
/// # Errors
/// If the file is missing or wrong.
pub fn load_bop(folder: &Path, info: ObjectInfo) -> Result<ObjectModel> {
    let path = folder.join(format!("obj_{:06}.ply", info.bop_id));
    if !path.is_file() {
        return Err(missing(&path, &info, "a BOP models folder has one obj_NNNNNN.ply for each object"));
    }
    let visual = mesh_io::load_ply(&path, MILLIMETRE)?;
    model(&path, info, visual)
}

fn missing(path: &Path, info: &ObjectInfo, layout: &str) -> Error {
    Error::invalid(
        path,
        format!(
            "no such file, so the set lacks {}; {layout}; leave out --ycb to use the built-in models",
            info.name
        ),
    )
}

fn model(path: &Path, info: ObjectInfo, visual: Visual) -> Result<ObjectModel> {
    check_size(&visual.mesh).map_err(|message| Error::invalid(path, message))?;
    let collision = decompose::decompose(&visual.mesh).map_err(|message| Error::invalid(path, message))?;
    Ok(ObjectModel::new(info, visual, collision))
}

/// Objects of the table fit a gripper or a hand; anything else was read in the wrong unit.
fn check_size(mesh: &Mesh) -> std::result::Result<(), String> {
    let Some((low, high)) = mesh.bounds() else {
        return Err("has no vertices".into());
    };
    let size = high - low;
    if size.max() > 1.0 || size.max() < 5e-3 || size.min() < 5e-4 {
        return Err(format!(
            "measures {:.4} x {:.4} x {:.4} m; objects are 5 mm to 1 m long and no flatter than 0.5 mm: check the unit",
            size.x, size.y, size.z
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::objects::{Fragility, ObjectLibrary, ObjectSet, collision_error};
    use std::path::PathBuf;

    fn root() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
    }

    /// BOP's models beside the repository, or beside the folder of a second work tree.
    fn bop_models() -> Option<PathBuf> {
        let found = ["..", "../.."]
            .map(|up| root().join(up).join("shared/data/ycbv-real-frame/models"))
            .into_iter()
            .find(|folder| folder.is_dir());
        if found.is_none() {
            println!("skipped: no BOP models in ../shared/data/ycbv-real-frame/models");
        }
        found
    }

    fn info() -> ObjectInfo {
        ObjectInfo {
            name: "036_wood_block".into(),
            bop_id: 16,
            mass_kg: 0.7,
            friction: 0.6,
            symmetric: true,
            fragility: Fragility::Sturdy,
            upright: false,
            revolution: None,
            half_turns: vec![],
        }
    }

    /// An OBJ of the box from `low` to `high`.
    fn box_obj(low: [f64; 3], high: [f64; 3]) -> String {
        let mut text = String::new();
        for i in 0..8 {
            let p: Vec<String> =
                (0..3).map(|bit| (if i >> bit & 1 == 1 { high } else { low })[bit].to_string()).collect();
            text.push_str(&format!("v {}\n", p.join(" ")));
        }
        for f in ["1 5 7 3", "2 4 8 6", "1 2 6 5", "3 7 8 4", "1 3 4 2", "5 6 8 7"] {
            text.push_str(&format!("f {f}\n"));
        }
        text
    }

    fn official(text: &str) -> (tempfile::TempDir, Result<ObjectModel>) {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("036_wood_block/google_16k");
        std::fs::create_dir_all(&place).unwrap();
        std::fs::write(place.join("textured.obj"), text).unwrap();
        let model = load_ycb(folder.path(), info());
        (folder, model)
    }

    #[test]
    fn official_scans_are_centred_and_a_box_becomes_a_box() {
        let (_keep, model) = official(&box_obj([0.1, 0.2, 0.0], [0.2, 0.3, 0.2]));
        let model = model.unwrap();
        assert!((model.min.coords + model.max.coords).norm() < 1e-6);
        assert!((model.size() - nalgebra::Vector3::new(0.1, 0.1, 0.2)).norm() < 1e-6);
        assert_eq!(model.collision.len(), 1);
        let crate::shape::Convex::Cuboid { half } = &model.collision[0].geometry else {
            panic!("{:?}", model.collision);
        };
        assert!((half - nalgebra::Vector3::new(0.05, 0.05, 0.1)).norm() < 1e-3, "{half}");
    }

    #[test]
    fn wrong_units_and_missing_files_are_named() {
        let message = official(&box_obj([0.0; 3], [100.0, 90.0, 200.0])).1.unwrap_err().to_string();
        assert!(message.contains("textured.obj") && message.contains("check the unit"), "{message}");
        let message = official(&box_obj([0.0; 3], [0.1, 0.1, 0.0])).1.unwrap_err().to_string();
        assert!(message.contains("textured.obj"), "{message}");
        let folder = tempfile::tempdir().unwrap();
        let message = load_ycb(folder.path(), info()).unwrap_err().to_string();
        assert!(message.contains("036_wood_block/google_16k/textured.obj"), "{message}");
        let message = load_bop(folder.path(), info()).unwrap_err().to_string();
        assert!(message.contains("obj_000016.ply"), "{message}");
    }

    #[test]
    fn bop_models_measure_what_their_table_says() {
        let Some(folder) = bop_models() else { return };
        let text = std::fs::read_to_string(folder.join("models_info.json")).unwrap();
        let facts: serde_json::Value = serde_json::from_str(&text).unwrap();
        let library =
            ObjectLibrary::open(&root().join("scenes/objects.toml"), ObjectSet::Bop(folder.clone())).unwrap();
        for name in library.names() {
            let info = library.info(name).unwrap();
            let fact = &facts[info.bop_id.to_string()];
            let visual =
                mesh_io::load_ply(&folder.join(format!("obj_{:06}.ply", info.bop_id)), MILLIMETRE).unwrap();
            let (low, high) = visual.mesh.bounds().unwrap();
            for (axis, letter) in ["x", "y", "z"].iter().enumerate() {
                let size = fact[format!("size_{letter}")].as_f64().unwrap() * MILLIMETRE;
                // The stored models have fewer triangles than those of the table.
                assert!((high[axis] - low[axis] - size).abs() < 1.5e-3, "{name} {letter}");
            }
            let diameter = fact["diameter"].as_f64().unwrap() * MILLIMETRE;
            assert!((visual.mesh.diameter() - diameter).abs() < 1.5e-3, "{name}");
        }
        // One that is a cylinder, one that is a turned box, and one that must be cut in pieces.
        for (name, most_pieces, mean) in
            [("005_tomato_soup_can", 1, 1.5e-3), ("008_pudding_box", 1, 1.5e-3), ("025_mug", 80, 1.5e-3)]
        {
            let model = library.load(name).unwrap();
            let error = collision_error(&model);
            println!("{name}: {} pieces, {error:?}", model.collision.len());
            assert!(model.collision.len() <= most_pieces && error.mean_m < mean, "{name}: {error:?}");
        }
    }

    /// The table of all scans: `cargo test --release -p grip-sim scans -- --ignored --nocapture`.
    #[test]
    #[ignore = "decomposes all scans, which takes a minute"]
    fn collision_pieces_of_all_bop_models() {
        let Some(folder) = bop_models() else { return };
        let library =
            ObjectLibrary::open(&root().join("scenes/objects.toml"), ObjectSet::Bop(folder)).unwrap();
        for name in library.names() {
            let start = std::time::Instant::now();
            let model = library.load(name).unwrap();
            let seconds = start.elapsed().as_secs_f64();
            let error = collision_error(&model);
            println!(
                "{name:24} {:3} pieces  mean {:5.2} mm  max {:5.2} mm  {seconds:.2} s",
                model.collision.len(),
                error.mean_m * 1e3,
                error.max_m * 1e3
            );
            assert!(error.mean_m < 2e-3, "{name}: {error:?}");
        }
    }
}
