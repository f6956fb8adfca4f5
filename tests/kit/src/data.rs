//! Data that lies outside of the repository.
#![allow(clippy::print_stdout, reason = "a skip must be seen")]

use std::path::{Path, PathBuf};
use std::sync::Arc;

use grip_sim::objects::ObjectModel;
use nalgebra::Point3;

use crate::meshes::mesh;
use crate::objects::object;

/// The folder `sub` of real data: in the folder that the environment variable `GRIP_TEST_DATA` names, or, without it, in
/// `shared/data` beside or in this checkout. `None`, said on standard output, where it is not there.
pub fn data(sub: &str) -> Option<PathBuf> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folders = match std::env::var_os("GRIP_TEST_DATA") {
        Some(folder) => vec![PathBuf::from(folder)],
        None => ["../../shared/data", "../../../shared/data"].map(|folder| here.join(folder)).to_vec(),
    };
    let found = folders.iter().map(|folder| folder.join(sub)).find(|path| path.exists());
    if found.is_none() {
        println!("SKIPPED what needs {sub}: set GRIP_TEST_DATA to the folder that holds it");
    }
    found
}

/// YCB-Video's names in the order of its BOP numbers, 1 to 21.
pub const NAMES: [&str; 21] = [
    "002_master_chef_can",
    "003_cracker_box",
    "004_sugar_box",
    "005_tomato_soup_can",
    "006_mustard_bottle",
    "007_tuna_fish_can",
    "008_pudding_box",
    "009_gelatin_box",
    "010_potted_meat_can",
    "011_banana",
    "019_pitcher_base",
    "021_bleach_cleanser",
    "024_bowl",
    "025_mug",
    "035_power_drill",
    "036_wood_block",
    "037_scissors",
    "040_large_marker",
    "051_large_clamp",
    "052_extra_large_clamp",
    "061_foam_brick",
];

/// Model `id` of a BOP folder, from 1: binary PLY with float x, y, z and triangles only, millimetres. Another reader than the
/// product's, on purpose.
pub fn bop_object(models: &Path, id: usize) -> Arc<ObjectModel> {
    let bytes = std::fs::read(models.join(format!("obj_{id:06}.ply"))).unwrap();
    let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let header = String::from_utf8_lossy(&bytes[..end]).into_owned();
    let count = |what: &str| -> usize {
        let line = header.lines().find(|l| l.starts_with(what)).unwrap();
        line.split(' ').next_back().unwrap().parse().unwrap()
    };
    let (vertices, faces) = (count("element vertex"), count("element face"));
    let body = &bytes[end..];
    let float = |i: usize| f32::from_le_bytes(body[i..i + 4].try_into().unwrap()) * 1e-3;
    let positions =
        (0..vertices).map(|i| Point3::new(float(12 * i), float(12 * i + 4), float(12 * i + 8))).collect();
    let index = |i: usize| u32::from_le_bytes(body[i..i + 4].try_into().unwrap());
    let start = 12 * vertices;
    let triangles = (0..faces)
        .map(|i| {
            let at = start + 13 * i;
            assert_eq!(body[at], 3);
            [index(at + 1), index(at + 5), index(at + 9)]
        })
        .collect();
    object(NAMES[id - 1], mesh(positions, triangles))
}
