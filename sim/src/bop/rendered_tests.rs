//! A small rendered data set, looked through by `tests/check_bop.py`, which shares no code with us: it draws the exported
//! models at the written poses and compares them with masks and depth.

use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use nalgebra::{Isometry3, Translation3, UnitQuaternion};

use super::*;
use crate::camera::Intrinsics;
use crate::images::{Image, RgbImage};
use crate::objects::{ObjectLibrary, ObjectModel, ObjectSet};
use crate::pose::{Camera, Object, Pose, World};
use crate::render::cpu::CpuRenderer;
use crate::render::{Instance, Lighting, RenderScene, Renderer, Rendering};

const K: Intrinsics = Intrinsics { width: 160, height: 120, fx: 139.0, fy: 137.5, cx: 80.3, cy: 58.6 };

/// Names, and places in the camera's frame, metres. The mug stands behind the box, the soup can is cut by the left edge,
/// the bowl lies outside of the image.
const OBJECTS: [(&str, [f64; 3]); 5] = [
    ("003_cracker_box", [-0.02, 0.02, 0.75]),
    ("025_mug", [0.07, 0.01, 0.95]),
    ("005_tomato_soup_can", [-0.38, 0.1, 0.7]),
    ("011_banana", [0.22, 0.16, 0.8]),
    ("024_bowl", [-2.0, 0.0, 1.0]),
];

fn render(
    models: &[(&ObjectModel, Pose<Camera, Object>, u16)],
    k: &Intrinsics,
    eye: &Pose<World, Camera>,
) -> Rendering {
    let instances = models
        .iter()
        .map(|(model, pose, label)| Instance {
            visual: Arc::clone(&model.visual),
            pose: *(*eye * *pose).iso(),
            label: *label,
        })
        .collect();
    let lighting = Lighting { ambient_lux: 500.0, ..Lighting::default() };
    CpuRenderer::new().render(&RenderScene { instances, bounce: None }, &lighting, k, eye).unwrap()
}

fn mask(rendering: &Rendering, label: u16) -> Image<bool> {
    let labels = &rendering.labels;
    let data = labels.data().iter().map(|&found| found == label).collect();
    Image::from_vec(labels.width(), labels.height(), data).unwrap()
}

/// The part of the canvas that is the image.
fn cut(canvas: &Image<bool>) -> Image<bool> {
    let at = |i: usize| *canvas.at(K.width + i % K.width, K.height + i / K.width);
    Image::from_vec(K.width, K.height, (0..K.width * K.height).map(at).collect()).unwrap()
}

fn write_frame(writer: &SceneWriter, models: &[Arc<ObjectModel>], im_id: u32) {
    let turn = 0.7 * f64::from(im_id);
    let eye = Pose::from_xyz_rpy([0.4, 0.1 * turn, 1.2], [-2.2, 0.0, turn]);
    let posed: Vec<(&ObjectModel, Pose<Camera, Object>, u16)> = models
        .iter()
        .zip(OBJECTS)
        .zip(1..)
        .map(|((model, (_, [x, y, z])), label)| {
            let rotation = UnitQuaternion::from_euler_angles(1.9 + turn, 0.3, 0.4 - 2.0 * turn);
            (&**model, Pose::new(Isometry3::from_parts(Translation3::new(x, y, z), rotation)), label)
        })
        .collect();
    let rendering = render(&posed, &K, &eye);
    let large = Intrinsics {
        width: 3 * K.width,
        height: 3 * K.height,
        cx: K.cx + K.width as f64,
        cy: K.cy + K.height as f64,
        ..K
    };
    let masks: Vec<[Image<bool>; 3]> = posed
        .iter()
        .map(|object| {
            let seen = mask(&rendering, object.2);
            let mut canvas = mask(&render(&[*object], &large, &eye), object.2);
            // Rays through the larger canvas round differently, so a pixel of the outline may be lost there.
            for i in (0..K.width * K.height).filter(|&i| seen.data()[i]) {
                *canvas.at_mut(K.width + i % K.width, K.height + i / K.width) = true;
            }
            [cut(&canvas), seen, canvas]
        })
        .collect();
    let objects: Vec<ObjectInFrame> = posed
        .iter()
        .zip(&masks)
        .map(|((model, pose, _), [mask, seen, canvas])| {
            let offset = [-(K.width as i32), -(K.height as i32)];
            let info = gt_info(canvas, offset, seen, &rendering.depth).unwrap();
            ObjectInFrame {
                obj_id: model.info.bop_id,
                camera_from_object: *pose,
                mask,
                mask_visib: seen,
                info,
            }
        })
        .collect();
    if im_id == 0 {
        let fractions = objects.iter().map(|object| object.info.visib_fract).collect::<Vec<_>>();
        assert!(fractions[1] < 0.9 && fractions[2] < 0.9 && fractions[4] == 0.0, "{fractions:?}");
    }
    let pixels = rendering.radiance.data().iter().flat_map(|light| light.map(|l| (l * 2.0) as u8)).collect();
    let frame = FrameFiles {
        im_id,
        rgb: &RgbImage::from_vec(K.width as u32, K.height as u32, pixels).unwrap(),
        depth: &rendering.depth,
        depth_scale_mm: 0.1,
        intrinsics: K,
        world_from_camera: Some(eye),
        objects: &objects,
    };
    writer.add_frame(&frame).unwrap();
}

#[test]
fn a_rendered_set_passes_the_independent_checker() {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let python = Command::new("python3").args(["-c", "import numpy, PIL"]).output();
    if !python.is_ok_and(|output| output.status.success()) {
        assert!(
            std::env::var_os("GRIP_REQUIRE_PYTHON").is_none(),
            "GRIP_REQUIRE_PYTHON is set but there is no python3 with numpy and Pillow"
        );
        println!("SKIPPED: no python3 with numpy and Pillow for tests/check_bop.py");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    let library = ObjectLibrary::open(&workspace.join("scenes/objects.toml"), ObjectSet::BuiltIn).unwrap();
    let models: Vec<Arc<ObjectModel>> = OBJECTS.iter().map(|(name, _)| library.load(name).unwrap()).collect();
    let ids: Vec<u32> = models.iter().map(|model| model.info.bop_id).collect();
    export_models(&root.join("models"), models.iter().map(Arc::as_ref)).unwrap();
    export_evaluation_models(&root.join("models_eval"), models.iter().map(Arc::as_ref)).unwrap();
    for scene_id in [2, 5] {
        let writer = SceneWriter::begin(&root.join("test"), scene_id)
            .unwrap()
            .with_coco("rendered", models.iter().map(|model| (model.info.bop_id, model.info.name.as_str())));
        (0..2).for_each(|im_id| write_frame(&writer, &models, im_id + scene_id - 2));
        writer.finish().unwrap();
    }
    let Intrinsics { width, height, fx, fy, cx, cy } = K;
    let camera = format::CameraFile { width, height, fx, fy, cx, cy, depth_scale: Some(0.1) };
    format::write_camera(root, &camera).unwrap();
    let targets = [Target { scene_id: 2, im_id: 0, obj_id: ids[0], inst_count: 1 }];
    format::write_targets(root, &targets).unwrap();
    write_coco_set(root, "test").unwrap();
    assert_eq!(Dataset::open(root, None).unwrap().targets().unwrap().unwrap(), targets);

    let check = || {
        let mut command = Command::new("python3");
        command.arg(workspace.join("tests/check_bop.py")).arg(root).arg("--models-depth");
        let output = command.output().unwrap();
        (
            output.status.code(),
            String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr),
        )
    };
    let (code, text) = check();
    println!("{text}");
    assert_eq!(code, Some(0), "{text}");
    // It would have found out a pose that is off by 5 mm.
    let path = root.join("test/000002/scene_gt.json");
    let gt = std::fs::read_to_string(&path).unwrap();
    assert!(gt.contains("750.0]"), "{gt}");
    std::fs::write(&path, gt.replacen("750.0]", "755.0]", 1).replacen("-20.0,", "-40.0,", 1)).unwrap();
    let (code, text) = check();
    assert!(code == Some(1) && text.contains("mask and drawn model differ"), "{text}");
}
