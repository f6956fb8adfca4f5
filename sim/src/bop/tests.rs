//! Data sets written and read back, broken in many ways, and a real one.

use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Translation3, UnitQuaternion};

use super::*;
use crate::camera::Intrinsics;
use crate::images::{DepthImage, Image, RgbImage};
use crate::pose::{Camera, Object, Pose, World};

const K: Intrinsics = Intrinsics { width: 24, height: 20, fx: 30.5, fy: 31.25, cx: 11.7, cy: 9.3 };
const UNIT_MM: f64 = 0.5;

/// Everything of one image, made from its number.
struct Sample {
    rgb: RgbImage,
    depth: DepthImage,
    camera: Pose<World, Camera>,
    poses: Vec<Pose<Camera, Object>>,
    masks: Vec<[Image<bool>; 2]>,
    infos: Vec<GtInfo>,
}

fn pose<A, B>(k: f64) -> Pose<A, B> {
    let turn = UnitQuaternion::from_euler_angles(0.3 + k, -0.7 * k, 2.0 - 0.9 * k);
    Pose::new(Isometry3::from_parts(Translation3::new(0.1 * k - 0.2, 0.05, 0.7 + 0.123_456_7 * k), turn))
}

fn rectangle([left, top, right, bottom]: [usize; 4]) -> Image<bool> {
    let mut mask = Image::filled(K.width, K.height, false);
    for v in top..bottom {
        (left..right).for_each(|u| *mask.at_mut(u, v) = true);
    }
    mask
}

fn sample(im_id: u32) -> Sample {
    let k = f64::from(im_id);
    let byte = |x: u32, y: u32, c: u32| ((x * 7 + y * 13 + c * 50 + im_id) % 256) as u8;
    let rgb = RgbImage::from_fn(24, 20, |x, y| image::Rgb([byte(x, y, 0), byte(x, y, 1), byte(x, y, 2)]));
    let metres = |i: usize| if i % 11 == 3 { 0.0 } else { 0.6 + 0.000_371 * i as f32 };
    let depth = DepthImage::from_vec(24, 20, (0..24 * 20).map(metres).collect()).unwrap();
    let front = rectangle([2, 3, 10, 12]);
    let back = rectangle([6, 5, 18, 16]);
    let seen_back = Image::from_vec(
        24,
        20,
        back.data().iter().zip(front.data()).map(|(back, front)| *back && !front).collect(),
    )
    .unwrap();
    let hidden = rectangle([3, 4, 5, 6]);
    let masks = vec![[front.clone(), front], [back, seen_back], [hidden, Image::filled(24, 20, false)]];
    let infos = masks.iter().map(|[mask, seen]| gt_info(mask, [0, 0], seen, &depth).unwrap()).collect();
    let poses = (0..3).map(|i| pose(k + f64::from(i))).collect();
    Sample { rgb, depth, camera: pose(-k), poses, masks, infos }
}

const OBJECTS: [(u32, &str); 3] = [(1, "master chef can"), (4, "005_tomato_soup_can"), (9, "potted meat")];

/// Writes a data set of one scene, number 7, with the images 12, 3 and 100.
fn write(root: &Path) -> PathBuf {
    let writer = SceneWriter::begin(&root.join("test"), 7).unwrap().with_coco("tiny", OBJECTS);
    for im_id in [12, 3, 100] {
        let sample = sample(im_id);
        let objects: Vec<ObjectInFrame> = (0..3)
            .map(|i| ObjectInFrame {
                obj_id: [4, 9, 4][i],
                camera_from_object: sample.poses[i],
                mask: &sample.masks[i][0],
                mask_visib: &sample.masks[i][1],
                info: sample.infos[i],
            })
            .collect();
        let frame = FrameFiles {
            im_id,
            rgb: &sample.rgb,
            depth: &sample.depth,
            depth_scale_mm: UNIT_MM,
            intrinsics: K,
            world_from_camera: Some(sample.camera),
            objects: &objects,
        };
        assert_eq!(encode_frame(&frame).unwrap(), encode_frame(&frame).unwrap());
        writer.add_frame(&frame).unwrap();
    }
    assert!(!root.join("test/000007").exists(), "a scene appears when it is finished");
    writer.finish().unwrap()
}

fn is_near<A, B>(a: &Pose<A, B>, b: &Pose<A, B>) -> bool {
    (a.translation() - b.translation()).norm() < 1e-9 && a.angle_to(b) < 1e-6
}

#[test]
fn a_scene_reads_back_as_it_was_written() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path());
    let targets = r#"[{"scene_id": 7, "im_id": 3, "obj_id": 4, "inst_count": 2}]"#;
    write_atomic(&folder.path().join("test_targets_bop19.json"), targets.as_bytes()).unwrap();
    let set = Dataset::open(folder.path(), None).unwrap();
    assert_eq!((set.split(), set.scenes().unwrap()), ("test", vec![7]));
    assert_eq!(set.images(7).unwrap(), [3, 12, 100]);
    assert_eq!(set.targets().unwrap().unwrap(), [Target { scene_id: 7, im_id: 3, obj_id: 4, inst_count: 2 }]);
    for im_id in [3, 12, 100] {
        let (frame, sample) = (set.frame(7, im_id).unwrap(), sample(im_id));
        assert_eq!(frame.rgb, sample.rgb);
        assert_eq!(frame.intrinsics, K, "numbers keep all their bits");
        assert!(is_near(&frame.world_from_camera.unwrap(), &sample.camera));
        for (a, b) in frame.depth.data().iter().zip(sample.depth.data()) {
            assert!((a - b).abs() <= 0.5e-3 * UNIT_MM as f32 + 1e-6 && (*a == 0.0) == (*b == 0.0));
        }
        assert_eq!(frame.truth().unwrap().len(), 3);
        for (index, truth) in frame.truth().unwrap().iter().enumerate() {
            assert_eq!((truth.obj_id, truth.info), ([4, 9, 4][index], Some(sample.infos[index])));
            assert!(is_near(&truth.camera_from_object, &sample.poses[index]));
            assert_eq!(set.mask(7, im_id, index).unwrap().unwrap(), sample.masks[index][0]);
            assert_eq!(set.mask_visib(7, im_id, index).unwrap().unwrap(), sample.masks[index][1]);
        }
    }
    // Images stand in the order of their numbers, not of their names or of writing.
    let text = std::fs::read_to_string(folder.path().join("test/000007/scene_gt.json")).unwrap();
    let places = ["  \"3\": ", "  \"12\": ", "  \"100\": "].map(|key| text.find(key).unwrap());
    assert!(places.is_sorted());
    // The same again makes the same bytes.
    let other = tempfile::tempdir().unwrap();
    write(other.path());
    for file in ["scene_gt.json", "scene_gt_coco.json", "rgb/000012.png", "depth/000003.png"] {
        let [a, b] =
            [&folder, &other].map(|f| std::fs::read(f.path().join("test/000007").join(file)).unwrap());
        assert_eq!(a, b, "{file}");
    }
}

#[test]
fn coco_files_hold_the_visible_masks() {
    let folder = tempfile::tempdir().unwrap();
    let scene = write(folder.path());
    let path = write_coco_set(folder.path(), "test").unwrap();
    for (path, from) in [(path, folder.path()), (scene.join("scene_gt_coco.json"), &scene)] {
        let set: coco::Coco = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
        let categories: Vec<_> = set.categories.iter().map(|c| (c.id, c.name.as_str())).collect();
        assert_eq!(categories, OBJECTS);
        // The third instance is hidden in each image.
        assert_eq!((set.images.len(), set.annotations.len()), (3, 6));
        let sample = sample(3);
        for (index, annotation) in set.annotations[..2].iter().enumerate() {
            assert_eq!(annotation.segmentation.decode().unwrap(), sample.masks[index][1]);
            assert_eq!(annotation.area, sample.infos[index].px_count_visib);
            let [x, y, width, height] = sample.infos[index].bbox_obj;
            assert_eq!(annotation.bbox, [x, y, width + 1, height + 1]);
        }
        assert!(set.images.iter().all(|image| from.join(&image.file_name).is_file()));
    }
}

#[test]
fn a_scene_exists_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let split = folder.path().join("test");
    let writer = SceneWriter::begin(&split, 1).unwrap();
    assert_eq!(std::fs::read_dir(&split).unwrap().count(), 1);
    drop(writer);
    assert_eq!(std::fs::read_dir(&split).unwrap().count(), 0, "nothing is left of a dropped scene");
    write(folder.path());
    let message = SceneWriter::begin(&split, 7).unwrap_err().to_string();
    assert!(message.contains("000007") && message.contains("exists already"), "{message}");
    assert!(SceneWriter::begin(&split, 1_000_000).is_err());
    let file = folder.path().join("file.json");
    write_atomic(&file, b"1").unwrap();
    write_atomic(&file, b"2").unwrap();
    assert_eq!(std::fs::read(&file).unwrap(), b"2");
    assert!(write_atomic(&folder.path().join("gone/file.json"), b"").is_err());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2, "no temporary file stays");
}

type Change<'a> = &'a dyn Fn(&mut ObjectInFrame<'a>, &mut FrameFiles<'a>);

#[test]
fn contradictions_are_not_written() {
    let sample = sample(3);
    let (wide, small) = (RgbImage::new(25, 20), Image::filled(8, 8, false));
    let other = &sample.masks[1][1];
    let nowhere = Pose::from_xyz_rpy([f64::NAN, 0.0, 0.0], [0.0; 3]);
    let cases: [(Change, Option<&str>); 9] = [
        (&|_, _| {}, None),
        (&|_, frame| frame.rgb = &wide, Some("rgb/000003.png: is 25x20")),
        (&|object, _| object.mask = &small, Some("mask/000003_000000.png: is 8x8")),
        (&|object, _| object.mask_visib = other, Some("outside of the silhouette")),
        (&|object, _| object.info.px_count_visib += 1, Some("ground truth 0, px_count_visib = 73")),
        (&|object, _| object.info.px_count_all = 5, Some("px_count_all = 5")),
        (&|object, _| object.info.visib_fract = f64::NAN, Some("visib_fract = NaN")),
        (&|_, frame| frame.depth_scale_mm = 0.0, Some("depth_scale = 0")),
        (&|object, _| object.camera_from_object = nowhere, Some("pose is not finite")),
    ];
    for (change, wanted) in cases {
        let mut object = ObjectInFrame {
            obj_id: 4,
            camera_from_object: sample.poses[0],
            mask: &sample.masks[0][0],
            mask_visib: &sample.masks[0][1],
            info: sample.infos[0],
        };
        let mut frame = FrameFiles {
            im_id: 3,
            rgb: &sample.rgb,
            depth: &sample.depth,
            depth_scale_mm: UNIT_MM,
            intrinsics: K,
            world_from_camera: None,
            objects: &[],
        };
        change(&mut object, &mut frame);
        let encoded = encode_frame(&FrameFiles { objects: &[object], ..frame });
        match (encoded.map_err(|error| error.to_string()), wanted) {
            (Ok(_), None) => {}
            (Err(message), Some(wanted)) => assert!(message.contains(wanted), "{wanted}: {message}"),
            (result, wanted) => panic!("{wanted:?}: {:?}", result.map(|_| ())),
        }
    }
}

/// What reading everything of the set says after `file` has been changed from one text to another.
fn error_after(file: &str, from: &str, to: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path());
    std::fs::create_dir(folder.path().join("models")).unwrap();
    std::fs::write(
        folder.path().join("models/models_info.json"),
        r#"{"1": {"diameter": 10, "min_x": -1, "min_y": -1, "min_z": -1, "size_x": 2, "size_y": 2, "size_z": 2,
            "symmetries_discrete": [[-1,0,0,0, 0,-1,0,0, 0,0,1,0, 0,0,0,1]],
            "symmetries_continuous": [{"axis": [0, 0, 1], "offset": [0, 0, 0]}]}}"#,
    )
    .unwrap();
    std::fs::write(
        folder.path().join("test_targets_bop19.json"),
        r#"[{"scene_id": 7, "im_id": 3, "obj_id": 4, "inst_count": 2}]"#,
    )
    .unwrap();
    let path = folder.path().join(file);
    let text = std::fs::read_to_string(&path).unwrap();
    let changed = text.replacen(from, to, 1);
    assert!(from.is_empty() || text != changed, "{file} lacks {from}: {text}");
    std::fs::write(&path, if from.is_empty() { to.to_owned() } else { changed }).unwrap();
    everything(folder.path()).unwrap_err().to_string()
}

fn everything(root: &Path) -> crate::Result<()> {
    let set = Dataset::open(root, None)?;
    set.targets()?;
    set.models_info()?;
    for scene in set.scenes()? {
        for image in set.images(scene)? {
            let frame = set.frame(scene, image)?;
            for index in 0..frame.truth().unwrap().len() {
                set.mask(scene, image, index)?;
                set.mask_visib(scene, image, index)?;
            }
        }
    }
    Ok(())
}

#[test]
fn broken_json_is_told_by_file_image_instance_field_and_value() {
    let (camera, gt, info) =
        ("test/000007/scene_camera.json", "test/000007/scene_gt.json", "test/000007/scene_gt_info.json");
    let (models, targets) = ("models/models_info.json", "test_targets_bop19.json");
    for (file, from, to, wanted) in [
        (
            camera,
            "\"cam_K\":[30.5,",
            "\"cam_K\":[",
            "image 3, cam_K: [0.0, 11.7, 0.0, 31.25, 9.3, 0.0, 0.0, 1.0] has 8 numbers",
        ),
        (
            camera,
            "\"cam_K\":[30.5,",
            "\"cam_K\":[1, 30.5,",
            "has 10 numbers, must have 9 (a 3x3 matrix row by row)",
        ),
        (camera, "\"cam_K\":[30.5,", "\"cam_K\":[-30.5,", "image 3, cam_K: fx -30.5"),
        (camera, "\"cam_K\":[30.5,0.0", "\"cam_K\":[30.5,0.1", "skewed"),
        (camera, "\"cam_K\":[30.5,", "\"cam_K\":[NaN,", "image 3, cam_K[0]: expected value at line 2 column"),
        (camera, "\"cam_K\":[30.5,", "\"cam_K\":[NaN,", "NaN and Infinity are no numbers"),
        (camera, "\"cam_K\":[30.5,", "\"cam_K\":[null,", "cam_K[0]: invalid type: null, expected f64"),
        (camera, "\"cam_K\":[30.5,", "\"cam_K\":[1e999,", "image 3, cam_K[0]: number out of range"),
        (camera, "\"cam_K\"", "\"cam_k\"", "image 3: missing field `cam_K`"),
        (camera, "\"depth_scale\":0.5", "\"depth_scale\":-0.5", "image 3, depth_scale = -0.5"),
        (
            camera,
            "\"depth_scale\":0.5",
            "\"depth_scale\":\"0.5\"",
            "image 3, depth_scale: invalid type: string \"0.5\"",
        ),
        (camera, "\"cam_t_w2c\"", "\"cam_t\"", "image 3, cam_t_w2c is missing beside cam_R_w2c"),
        (camera, "\"3\"", "\"three\"", "three"),
        (camera, "", "", "is empty"),
        (camera, "", "[]", "invalid type: sequence, expected a map"),
        (gt, "\"cam_R_m2c\":[", "\"cam_R_m2c\":[2,", "image 3, ground truth 0, cam_R_m2c: [2.0, "),
        (
            gt,
            "\"cam_t_m2c\":[",
            "\"cam_t_m2c\":[NaN,",
            "image 3, ground truth 0, cam_t_m2c[0]: expected value",
        ),
        (gt, "\"cam_t_m2c\":[", "\"cam_t_m2c\":[Infinity,", "are no numbers in JSON"),
        (gt, "\"obj_id\":9", "\"obj_id\":-9", "image 3, ground truth 1, obj_id: invalid value: integer `-9`"),
        (gt, "\"obj_id\":4", "\"obj\":4", "image 3, ground truth 0: missing field `obj_id`"),
        (gt, "  \"3\": [{", "  \"3\": [{}, {", "image 3, ground truth 0: missing field"),
        (info, "{\"bbox_obj\"", "{\"bbox\"", "image 3, ground truth 0: missing field `bbox_obj`"),
        (info, "\"bbox_obj\":[", "\"bbox_obj\":[0,", "image 3, ground truth 0, bbox_obj"),
        (info, "\"visib_fract\":1.0", "\"visib_fract\":NaN", "ground truth 0, visib_fract: expected value"),
        (info, "  \"3\": ", "  \"3\": [], \"4\": ", "image 3 has 0 entries, but 3 in scene_gt.json"),
        (
            models,
            "-1,0,0,0, 0,-1",
            "-1,0,0, 0,-1",
            "object 1, symmetries_discrete: [-1.0, 0.0, 0.0, 0.0, -1.0",
        ),
        (
            models,
            "-1,0,0,0, 0,-1",
            "-1,0,0,0, 0,1",
            "object 1, symmetries_discrete[0]: [-1.0, 0.0, 0.0, 0.0, 1.0",
        ),
        (models, "0,0,0,1]", "0,0,5,1]", "the last row must be 0, 0, 0, 1"),
        (models, "[0, 0, 1]", "[0, 0, 0]", "object 1, symmetries_continuous[0].axis = [0.0, 0.0, 0.0]"),
        (models, "\"diameter\": 10", "\"diameter\": -10", "object 1, diameter = -10"),
        (
            models,
            "\"diameter\": 10",
            "\"diameter\": 0.010",
            "diameter = 0.01: is less than 2 mm; sizes are in millimetres",
        ),
        (camera, "\"3\"", "\"000003\"", "keys are numbers without zeros before them"),
        (models, "\"min_x\"", "\"min\"", "object 1: missing field `min_x`"),
        (
            targets,
            "\"inst_count\": 2",
            "\"inst_count\": 2.5",
            "target 0, inst_count: invalid type: floating point `2.5`",
        ),
        (targets, "]", "", "EOF"),
        (targets, "]", "] x", "trailing characters"),
    ] {
        let message = error_after(file, from, to);
        let name = file.rsplit('/').next().unwrap();
        assert!(
            message.contains(name) && message.contains(wanted),
            "{from} -> {to}\nwanted {wanted}\ngot    {message}"
        );
    }
    // A mirror image is no rotation.
    let folder = tempfile::tempdir().unwrap();
    write(folder.path());
    let path = folder.path().join(gt);
    let mirrored = r#"{"3": [{"cam_R_m2c": [1,0,0,0,1,0,0,0,-1], "cam_t_m2c": [0,0,900], "obj_id": 1}]}"#;
    std::fs::write(&path, mirrored).unwrap();
    std::fs::remove_file(folder.path().join(info)).unwrap();
    let message = Dataset::open(folder.path(), None).unwrap().frame(7, 3).unwrap_err().to_string();
    assert!(
        message.contains("image 3, ground truth 0, cam_R_m2c = [1.0") && message.contains("determinant -1"),
        "{message}"
    );
    // Fields of others are let pass.
    let more = mirrored.replace("-1]", "1]").replace("\"obj_id\"", "\"visib\": {\"a\": []}, \"obj_id\"");
    std::fs::write(&path, more).unwrap();
    Dataset::open(folder.path(), None).unwrap().frame(7, 3).unwrap();
}

#[test]
fn poses_and_models_in_metres_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let scene = write(folder.path());
    let path = scene.join("scene_gt.json");
    let metres = r#"{"3": [{"cam_R_m2c": [1,0,0,0,1,0,0,0,1], "cam_t_m2c": [0.1,0,0.9], "obj_id": 1}]}"#;
    std::fs::write(&path, metres).unwrap();
    std::fs::remove_file(scene.join("scene_gt_info.json")).unwrap();
    let message = Dataset::open(folder.path(), None).unwrap().images(7).unwrap_err().to_string();
    assert!(
        message.contains("scene_gt.json") && message.contains("(cam_t_m2c) are in millimetres"),
        "{message}"
    );

    let models = folder.path().join("models");
    std::fs::create_dir(&models).unwrap();
    let cube = |edge: f64| {
        let corners = (0..8).map(|i| {
            format!(
                "{} {} {}\n",
                edge * f64::from(i & 1),
                edge * f64::from(i >> 1 & 1),
                edge * f64::from(i >> 2)
            )
        });
        let faces = "4 0 1 3 2\n4 4 6 7 5\n4 0 4 5 1\n4 2 3 7 6\n4 0 2 6 4\n4 1 5 7 3\n";
        format!(
            "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\nelement face 6\n\
             property list uchar int vertex_indices\nend_header\n{}{faces}",
            corners.collect::<String>()
        )
    };
    let info = r#"{"1": {"diameter": 104, "min_x": 0, "min_y": 0, "min_z": 0, "size_x": 60, "size_y": 60, "size_z": 60}}"#;
    std::fs::write(models.join("models_info.json"), info).unwrap();
    let load = |edge: f64| {
        std::fs::write(models.join("obj_000001.ply"), cube(edge)).unwrap();
        Dataset::open(folder.path(), None).unwrap().load_evaluation_model(1)
    };
    assert!(load(60.0).is_ok() && load(50.0).is_ok());
    for edge in [0.06, 6.0, 60e3] {
        let message = load(edge).unwrap_err().to_string();
        assert!(
            message.contains("obj_000001.ply") && message.contains("gives it the diameter 104"),
            "{message}"
        );
    }
}

#[test]
fn broken_pictures_and_missing_files_are_told_by_file() {
    let folder = tempfile::tempdir().unwrap();
    let scene = write(folder.path());
    let set = Dataset::open(folder.path(), Some("test")).unwrap();
    let small = pictures::encode_mask(Path::new(""), &Image::filled(8, 8, true)).unwrap();
    for file in
        ["rgb/000003.png", "depth/000003.png", "mask/000003_000001.png", "mask_visib/000003_000002.png"]
    {
        let path = scene.join(file);
        let whole = std::fs::read(&path).unwrap();
        let read = || {
            set.frame(7, 3).map(|_| ())?;
            (0..3).try_for_each(|i| set.mask(7, 3, i).and(set.mask_visib(7, 3, i)).map(|_| ()))
        };
        read().unwrap();
        for length in (0..whole.len() - 12).step_by(7) {
            std::fs::write(&path, &whole[..length]).unwrap();
            let message = read().unwrap_err().to_string();
            assert!(message.contains(file), "{length}: {message}");
        }
        std::fs::write(&path, &small).unwrap();
        let message = read().unwrap_err().to_string();
        // A small colour picture is found out by the depth picture that does not fit it.
        assert!(message.contains(file) || file.starts_with("rgb") && message.contains("8x8"), "{message}");
        std::fs::remove_file(&path).unwrap();
        if file.starts_with("mask") {
            read().unwrap();
        } else {
            assert!(read().unwrap_err().to_string().contains(file));
        }
        std::fs::write(&path, &whole).unwrap();
    }
    for (message, wanted) in [
        (set.frame(7, 4).unwrap_err(), "has no image 4; it has 3 images from 3 to 100"),
        (set.frame(8, 3).unwrap_err(), "000008"),
        (set.mask(7, 3, 3).unwrap_err(), "image 3 has 3 ground truths, so there is none of index 3"),
        (set.model_ids().unwrap_err(), "has no folder models"),
        (
            Dataset::open(folder.path(), Some("train_pbr")).unwrap_err(),
            "no split 'train_pbr' with scenes; splits found: test",
        ),
        (Dataset::open(&folder.path().join("gone"), None).unwrap_err(), "gone"),
        (Dataset::open(&scene, None).unwrap_err(), "splits found: none"),
    ] {
        assert!(message.to_string().contains(wanted), "{message}");
    }
    assert!(set.targets().unwrap().is_none());
    // Of several splits the test images come first.
    for split in ["train_pbr", "aaa"] {
        std::fs::create_dir_all(folder.path().join(split).join("000000")).unwrap();
    }
    assert_eq!(Dataset::open(folder.path(), None).unwrap().split(), "test");
    std::fs::remove_dir_all(folder.path().join("test")).unwrap();
    assert_eq!(Dataset::open(folder.path(), None).unwrap().split(), "train_pbr");
}

#[test]
fn grey_and_jpeg_pictures_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let scene = write(folder.path());
    let set = Dataset::open(folder.path(), None).unwrap();
    let picture = sample(3).rgb;
    std::fs::remove_file(scene.join("rgb/000003.png")).unwrap();
    picture.save(scene.join("rgb/000003.jpg")).unwrap();
    assert_eq!(set.frame(7, 3).unwrap().rgb.dimensions(), (24, 20));
    std::fs::remove_file(scene.join("rgb/000003.jpg")).unwrap();
    std::fs::create_dir(scene.join("gray")).unwrap();
    image::DynamicImage::from(picture).into_luma8().save(scene.join("gray/000003.png")).unwrap();
    let grey = set.frame(7, 3).unwrap().rgb;
    assert!(grey.pixels().all(|pixel| pixel.0[0] == pixel.0[1] && pixel.0[1] == pixel.0[2]));
}

#[test]
fn a_real_frame_of_ycb_video_opens() {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let root = workspace.join("../shared/data/ycbv-real-frame");
    if !root.is_dir() {
        println!("SKIPPED: no real frame in ../shared/data/ycbv-real-frame");
        return;
    }
    let set = Dataset::open(&root, None).unwrap();
    assert_eq!((set.split(), set.scenes().unwrap(), set.images(50).unwrap()), ("test", vec![50], vec![1]));
    let frame = set.frame(50, 1).unwrap();
    let ids: Vec<u32> = frame.truth().unwrap().iter().map(|truth| truth.obj_id).collect();
    assert_eq!(ids, [2, 4, 5, 10, 15], "cracker box, soup can, mustard, banana, drill");
    let asked: Vec<u32> = set.targets().unwrap().unwrap().iter().map(|target| target.obj_id).collect();
    assert_eq!(asked, ids);
    assert!(frame.world_from_camera.is_none() && set.mask(50, 1, 0).unwrap().is_none());
    assert_eq!(set.model_ids().unwrap(), (1..=21).collect::<Vec<_>>());
    let infos = set.models_info().unwrap();
    assert_eq!(infos[&1].symmetries.continuous.len(), 1);
    assert_eq!(infos[&16].symmetries.discrete.len(), 2);
    for truth in frame.truth().unwrap() {
        assert!(truth.info.is_none());
        let model = set.load_model(truth.obj_id).unwrap();
        model.mesh.validate().unwrap();
        assert!((model.mesh.diameter() - infos[&truth.obj_id].diameter).abs() < 1.5e-3);
        // The surface that faces the camera is where the depth picture has it: units, axes and scale are right.
        let mut off: Vec<f64> = Vec::new();
        for (p, n) in model.mesh.positions.iter().zip(&model.mesh.normals) {
            let at = truth.camera_from_object.transform_point(&p.cast());
            let facing = truth.camera_from_object.transform_vector(&n.cast()).dot(&at.coords.normalize());
            let Some(uv) = frame.intrinsics.project(&at) else { continue };
            let (u, v) = (uv.x.round() as usize, uv.y.round() as usize);
            if facing < -0.5 && u < 640 && v < 480 && *frame.depth.at(u, v) > 0.0 {
                off.push((f64::from(*frame.depth.at(u, v)) - at.z).abs());
            }
        }
        off.sort_by(f64::total_cmp);
        let median = off[off.len() / 2];
        println!("object {}: median {:.1} mm of {} points", truth.obj_id, median * 1e3, off.len());
        // Its author's notes tell of up to 8 mm between depth and truth.
        assert!(median < 0.012, "object {}: {median}", truth.obj_id);
    }
}
