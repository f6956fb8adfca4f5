use std::sync::Arc;

use grip_sim::images::RgbImage;

use super::*;
use crate::detector::detections::iou;

static MODEL: &[u8] = include_bytes!("../../../models/pyramid-varied.onnx");
static DESCRIPTION: &str = include_str!("../../../models/pyramid-varied.json");

fn description() -> DetectorDescription {
    DetectorDescription::parse(DESCRIPTION, "test").unwrap()
}

fn network() -> PyramidCnn {
    PyramidCnn::built_in(BuiltInNetwork::default(), &Providers::default()).unwrap()
}

/// An image with something in it.
fn picture(width: u32, height: u32) -> RgbImage {
    RgbImage::from_fn(width, height, |u, v| {
        let inside = (u as f64 - 0.4 * f64::from(width)).hypot(v as f64 - 0.5 * f64::from(height)) < 40.0;
        image::Rgb(if inside { [200, 40, 30] } else { [(u / 3 % 256) as u8, 120, (v / 2 % 256) as u8] })
    })
}

/// Heat maps of a 640 x 480 image that are nearly zero everywhere.
fn silent() -> HeatMaps {
    let description = description();
    let (classes, ratios) = (1 + description.objects.len(), description.aspect_ratios.len());
    let maps = (0..6)
        .map(|level| {
            let scale = description.side_px / PyramidSettings::default().side_px(level);
            let (w, h) = ((640.0 * scale).round() as usize, (480.0 * scale).round() as usize);
            let (rows, columns) = (h / description.stride_px, w / description.stride_px);
            let cells = rows * columns;
            HeatMap {
                scale: [w as f64 / 640.0, h as f64 / 480.0],
                rows,
                columns,
                classes: vec![1e-6; classes * cells],
                shapes: vec![1.0 / ratios as f32; ratios * cells],
            }
        })
        .collect();
    HeatMaps {
        size: [640.0, 480.0],
        maps,
        description: Arc::new(description),
        settings: PyramidSettings::default(),
    }
}

fn set(maps: &mut HeatMaps, level: usize, class: usize, [column, row]: [usize; 2], value: f32) {
    let map = &mut maps.maps[level];
    let cell = row * map.columns + column;
    map.classes[class * map.rows * map.columns + cell] = value;
}

#[test]
fn levels_are_half_an_octave_apart_and_hold_what_a_table_shows() {
    let levels = network().levels(640, 480);
    assert_eq!(levels[0], (452, 339));
    assert_eq!(levels.len(), 7);
    for (finer, coarser) in levels.iter().zip(&levels[1..]) {
        let ratio = finer.0 as f64 / coarser.0 as f64;
        assert!((ratio - std::f64::consts::SQRT_2).abs() < 0.02, "{levels:?}");
    }
}

#[test]
fn a_hot_cell_is_a_box_of_its_place_and_level() {
    let mut maps = silent();
    set(&mut maps, 2, 5, [10, 6], 0.8);
    let best = maps.boxes(5)[0];
    assert!((best.confidence - 0.8).abs() < 1e-6);
    let stride = maps.description.stride_px as f64;
    let [sx, sy] = maps.maps[2].scale;
    let centre = [(best.bbox[0] + best.bbox[2] + 1.0) / 2.0, (best.bbox[1] + best.bbox[3] + 1.0) / 2.0];
    assert!(
        (centre[0] - 10.5 * stride / sx).abs() < 0.1 && (centre[1] - 6.5 * stride / sy).abs() < 0.1,
        "{best:?}"
    );
    // A flat distribution of ratios reads as its first three here; the longer side is the level's all the same.
    let longer = (best.bbox[2] - best.bbox[0]).max(best.bbox[3] - best.bbox[1]) + 1.0;
    assert!((longer - PyramidSettings::default().side_px(2)).abs() < 0.1, "{best:?}");
}

#[test]
fn two_equal_cells_mean_the_middle_and_two_equal_levels_the_size_between() {
    let mut maps = silent();
    set(&mut maps, 1, 3, [10, 10], 0.5);
    set(&mut maps, 1, 3, [11, 10], 0.5);
    let best = maps.boxes(3)[0];
    let centre = (best.bbox[0] + best.bbox[2] + 1.0) / 2.0;
    assert!((centre - 11.0 * 8.0 / maps.maps[1].scale[0]).abs() < 0.1, "{best:?}");

    let mut maps = silent();
    let place = |maps: &HeatMaps, level: usize| {
        [0, 1].map(|axis| (250.0 * maps.maps[level].scale[axis] / 8.0) as usize)
    };
    for level in [1, 2] {
        let at = place(&maps, level);
        set(&mut maps, level, 3, at, 0.5);
    }
    let best = maps.boxes(3)[0];
    let longer = (best.bbox[2] - best.bbox[0]).max(best.bbox[3] - best.bbox[1]) + 1.0;
    let between = (PyramidSettings::default().side_px(1) * PyramidSettings::default().side_px(2)).sqrt();
    assert!((longer - between).abs() < 0.5, "{longer} {between}");
}

#[test]
fn nothing_is_thresholded_and_no_two_boxes_are_one() {
    let mut maps = silent();
    set(&mut maps, 0, 7, [20, 20], 1e-5);
    let boxes = maps.boxes(7);
    assert!((boxes[0].confidence - 1e-5).abs() < 1e-9, "{:?}", boxes[0]);
    // Even an image without anything has boxes.
    assert!(!maps.boxes(8).is_empty());
    for (i, a) in boxes.iter().enumerate() {
        assert!(boxes[..i].iter().all(|b| iou(&a.bbox, &b.bbox) < 0.5));
    }
}

#[test]
fn probabilities_sum_to_one_and_do_not_depend_on_threads() {
    let (network, picture) = (network(), picture(320, 240));
    let maps = network.look(&picture).unwrap();
    for map in maps.levels() {
        for cell in 0..map.rows * map.columns {
            let sum: f32 = (0..=maps.description().objects.len()).map(|class| map.class(class)[cell]).sum();
            assert!((sum - 1.0).abs() < 1e-4, "{sum}");
        }
    }
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let again = alone.install(|| network.look(&picture).unwrap());
    for (a, b) in maps.levels().iter().zip(again.levels()) {
        assert_eq!((&a.classes, &a.shapes), (&b.classes, &b.shapes));
    }
}

#[test]
fn small_images_are_refused_and_odd_ones_are_not() {
    let network = network();
    for (width, height) in [(1, 1), (15, 400), (3, 2)] {
        let error = network.look(&picture(width, height)).unwrap_err().to_string();
        assert!(error.contains(&format!("{width}x{height}")), "{error}");
    }
    for (width, height) in [(101, 67), (640, 31)] {
        assert!(!network.look(&picture(width, height)).unwrap().levels().is_empty());
    }
}

#[test]
fn resizing_keeps_what_is_flat_and_averages_what_is_not() {
    let flat = RgbImage::from_pixel(64, 48, image::Rgb([10, 128, 250]));
    let planes = planes(&flat, 20, 15).unwrap();
    for (plane, value) in planes.chunks(300).zip([10.0, 128.0, 250.0]) {
        assert!(plane.iter().all(|x| (x * 255.0 - value).abs() < 0.01), "{value}");
    }
    let stripes = RgbImage::from_fn(64, 48, |u, _| image::Rgb([if u % 2 == 0 { 0 } else { 255 }; 3]));
    let small = super::planes(&stripes, 8, 6).unwrap();
    assert!(small.iter().all(|x| (x - 0.5).abs() < 0.05), "{small:?}");
}

#[test]
fn broken_models_are_refused_by_name() {
    let folder = std::env::temp_dir().join(format!("grip-pyramid-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let open = |name: &str, model: Option<&[u8]>, text: Option<&str>| {
        let path = folder.join(format!("{name}.onnx"));
        if let Some(model) = model {
            std::fs::write(&path, model).unwrap();
        }
        if let Some(text) = text {
            std::fs::write(path.with_extension("json"), text).unwrap();
        }
        let error = PyramidCnn::open(&path, &Providers::default()).unwrap_err().to_string();
        assert!(error.contains(&format!("{name}.")), "{error}");
        error
    };
    open("missing", None, Some(DESCRIPTION));
    let error = open("alone", Some(MODEL), None);
    assert!(error.contains("alone.json"), "{error}");
    open("garbage", Some(b"no network"), Some(DESCRIPTION));
    open("empty", Some(b""), Some(DESCRIPTION));
    open("cut", Some(&MODEL[..MODEL.len() / 2]), Some(DESCRIPTION));
    // Another number of outputs than the description has.
    let fewer = DESCRIPTION.replace("0.25,", "");
    let error = open("fewer", Some(MODEL), Some(&fewer));
    assert!(error.contains("'shapes'") && error.contains("[1, 7,") && error.contains("[1, 6,"), "{error}");
    // An input of another name.
    let position =
        |needle: &[u8]| (0..MODEL.len()).filter(|i| MODEL[*i..].starts_with(needle)).collect::<Vec<_>>();
    let mut renamed = MODEL.to_vec();
    for at in position(b"image") {
        renamed[at..at + 5].copy_from_slice(b"photo");
    }
    let error = open("renamed", Some(&renamed), Some(DESCRIPTION));
    assert!(error.contains("photo") && error.contains("'image'"), "{error}");
    for (field, broken) in [
        ("schema", DESCRIPTION.replace("grip.detector/1", "grip.detector/9")),
        ("side_px", DESCRIPTION.replace("\"side_px\": 40.0", "\"side_px\": -1")),
        ("stride_px", DESCRIPTION.replace("\"stride_px\": 8", "\"stride_px\": 0")),
        ("aspect_ratios", DESCRIPTION.replace("0.25,", "9.0,")),
        ("diameter_m", DESCRIPTION.replacen("0.1725", "1e9", 1)),
        ("EOF", "{".to_owned()),
        ("twice", DESCRIPTION.replace("003_cracker_box", "002_master_chef_can")),
    ] {
        assert_ne!(broken, DESCRIPTION, "{field}");
        let error = open("described", Some(MODEL), Some(&broken));
        assert!(error.contains(field), "{field}: {error}");
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn providers_need_a_native_runtime() {
    if std::env::var_os("ORT_DYLIB_PATH").is_some() {
        return;
    }
    let asked = Providers(vec!["cuda".into()]);
    let error = PyramidCnn::built_in(BuiltInNetwork::default(), &asked).unwrap_err().to_string();
    assert!(error.contains("cuda") && error.contains("ORT_DYLIB_PATH"), "{error}");
}

/// PyTorch's exporter keeps weights in `NAME.onnx.data` beside the model.
#[test]
fn a_network_with_its_weights_in_a_file_beside_it_is_the_same_network() {
    use prost::Message;
    use tract_onnx::pb::tensor_proto::DataLocation;
    use tract_onnx::pb::{ModelProto, StringStringEntryProto};

    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let mut proto = ModelProto::decode(MODEL).unwrap();
    let mut weights: Vec<u8> = Vec::new();
    for tensor in &mut proto.graph.as_mut().unwrap().initializer {
        let raw = std::mem::take(&mut tensor.raw_data);
        if raw.is_empty() {
            continue;
        }
        let entry = |key: &str, value: String| StringStringEntryProto { key: key.into(), value };
        tensor.data_location = Some(DataLocation::External as i32);
        tensor.external_data = vec![
            entry("location", "split.onnx.data".into()),
            entry("offset", weights.len().to_string()),
            entry("length", raw.len().to_string()),
        ];
        weights.extend(raw);
    }
    assert!(weights.len() > 100_000);
    for (name, bytes) in [("whole", MODEL), ("split", &proto.encode_to_vec())] {
        std::fs::write(path(&format!("{name}.onnx")), bytes).unwrap();
        std::fs::write(path(&format!("{name}.json")), DESCRIPTION).unwrap();
    }
    std::fs::write(path("split.onnx.data"), &weights).unwrap();
    let open = |name: &str| PyramidCnn::open(&path(name), &Providers::default());
    let image = picture(160, 120);
    let [whole, split] = ["whole.onnx", "split.onnx"].map(|name| open(name).unwrap().look(&image).unwrap());
    assert!(whole.maps.iter().zip(&split.maps).all(|(a, b)| a.classes == b.classes && a.shapes == b.shapes));

    let refused = |wanted: &[&str]| {
        let error = open("split.onnx").unwrap_err().to_string();
        assert!(wanted.iter().all(|part| error.contains(part)), "{wanted:?}: {error}");
    };
    std::fs::write(path("split.onnx.data"), &weights[..weights.len() / 2]).unwrap();
    refused(&["split.onnx", "'split.onnx.data'", "bytes; copy it again"]);
    std::fs::remove_file(path("split.onnx.data")).unwrap();
    refused(&["split.onnx.data: No such file", "one file"]);
    // A model must not read what is elsewhere.
    for tensor in &mut proto.graph.as_mut().unwrap().initializer {
        tensor
            .external_data
            .iter_mut()
            .filter(|e| e.key == "location")
            .for_each(|e| e.value = "../secret".into());
    }
    std::fs::write(path("split.onnx"), proto.encode_to_vec()).unwrap();
    refused(&["'../secret'", "not beside the model"]);
}

/// Exporters of ONNX's first versions list weights as inputs, too, which counts them twice in tract.
#[test]
fn weights_that_are_listed_as_inputs_are_no_inputs() {
    use prost::Message;
    use tract_onnx::pb::{ModelProto, ValueInfoProto};

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("old.onnx");
    let mut proto = ModelProto::decode(MODEL).unwrap();
    let graph = proto.graph.as_mut().unwrap();
    let listed = graph
        .initializer
        .iter()
        .map(|tensor| ValueInfoProto { name: tensor.name.clone(), ..Default::default() });
    let listed: Vec<ValueInfoProto> = listed.collect();
    graph.input.extend(listed);
    std::fs::write(&path, proto.encode_to_vec()).unwrap();
    std::fs::write(path.with_extension("json"), DESCRIPTION).unwrap();
    let image = picture(160, 120);
    let old = PyramidCnn::open(&path, &Providers::default()).unwrap().look(&image).unwrap();
    let ours = network().look(&image).unwrap();
    assert!(old.maps.iter().zip(&ours.maps).all(|(a, b)| a.classes == b.classes));
}

#[test]
fn a_network_of_other_inputs_or_outputs_is_refused_by_what_it_has() {
    use prost::Message;
    use tract_onnx::pb::tensor_shape_proto::dimension::Value::DimValue;
    use tract_onnx::pb::{GraphProto, ModelProto, ValueInfoProto, type_proto};

    fn tensor(value: &mut ValueInfoProto) -> &mut type_proto::Tensor {
        let type_proto::Value::TensorType(tensor) = value.r#type.as_mut().unwrap().value.as_mut().unwrap();
        tensor
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("theirs.onnx");
    std::fs::write(path.with_extension("json"), DESCRIPTION).unwrap();
    type Change = fn(&mut GraphProto);
    let cases: [(Change, &str); 6] = [
        (|graph| tensor(&mut graph.input[0]).elem_type = 10, "the inputs image float16 (1, 3, ?, ?);"),
        (|graph| tensor(&mut graph.input[0]).elem_type = 2, "the inputs image uint8 (1, 3, ?, ?);"),
        (
            |graph| {
                let shape = tensor(&mut graph.input[0]).shape.as_mut().unwrap();
                shape.dim[1].value = Some(DimValue(1));
            },
            "the inputs image float (1, 1, ?, ?); a detector has one, 'image', float of (1, 3, height, width)",
        ),
        (|graph| graph.input[0].name = "images".into(), "the inputs images float"),
        (|graph| graph.input.clear(), "the inputs none;"),
        (|graph| graph.output[0].name = "boxes".into(), "the outputs boxes float"),
    ];
    for (change, wanted) in cases {
        let mut proto = ModelProto::decode(MODEL).unwrap();
        change(proto.graph.as_mut().unwrap());
        std::fs::write(&path, proto.encode_to_vec()).unwrap();
        let error = PyramidCnn::open(&path, &Providers::default()).unwrap_err().to_string();
        assert!(error.contains("theirs.onnx") && error.contains(wanted), "{wanted}\n{error}");
    }
}
