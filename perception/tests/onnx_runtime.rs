//! The same heat maps from the runtime that is built in and from a native ONNX Runtime.
//!
//! A process has one runtime, so the native one runs in a process of its own. Its library is that of the Python package
//! `onnxruntime`, or what `GRIP_TEST_ONNXRUNTIME` names; without one the test says so, and fails where
//! `GRIP_REQUIRE_ONNXRUNTIME` is set.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stderr, reason = "tests")]

use std::path::PathBuf;
use std::process::Command;

use grip_perception::{BuiltInNetwork, Providers, PyramidCnn};
use grip_sim::images::RgbImage;

/// What the two may differ by.
const TOLERANCE: f32 = 1e-4;
/// Where the process of the native runtime leaves its heat maps.
const OUT: &str = "GRIP_TEST_HEATMAPS";

fn heatmaps() -> (String, Vec<f32>) {
    let network = PyramidCnn::built_in(BuiltInNetwork::default(), &Providers::default()).unwrap();
    let picture = RgbImage::from_fn(320, 240, |u, v| {
        let inside = (f64::from(u) - 130.0).hypot(f64::from(v) - 120.0) < 40.0;
        image::Rgb(if inside { [200, 40, 30] } else { [(u / 3) as u8, 120, (v / 2) as u8] })
    });
    let maps = network.look(&picture).unwrap();
    let classes = 0..=maps.description().objects.len();
    let heat =
        maps.levels().iter().flat_map(|map| classes.clone().flat_map(|class| map.class(class).to_vec()));
    let mut values: Vec<f32> = heat.collect();
    // Aspect ratios are seen in boxes; the best one of each object, in tenths of the picture's width.
    values.extend(classes.skip(1).flat_map(|class| maps.boxes(class)[0].bbox.map(|x| x as f32 / 32.0)));
    (network.runtime().to_owned(), values)
}

fn library() -> Option<PathBuf> {
    if let Some(path) = std::env::var_os("GRIP_TEST_ONNXRUNTIME") {
        return Some(path.into());
    }
    let script = "import importlib.util, pathlib; \
        folder = pathlib.Path(importlib.util.find_spec('onnxruntime').origin).parent / 'capi'; \
        print(next(iter(sorted(folder.glob('libonnxruntime.so*')) + sorted(folder.glob('libonnxruntime*.dylib')))))";
    let said = Command::new("python3").args(["-c", script]).output().ok()?;
    let path = String::from_utf8(said.stdout).ok()?;
    (said.status.success() && !path.trim().is_empty()).then(|| path.trim().into())
}

#[test]
fn a_native_runtime_says_the_same() {
    let Some(library) = library() else {
        assert!(
            std::env::var_os("GRIP_REQUIRE_ONNXRUNTIME").is_none(),
            "no ONNX Runtime; pip install onnxruntime, or set GRIP_TEST_ONNXRUNTIME to its library"
        );
        eprintln!("skipped: no ONNX Runtime");
        return;
    };
    let out = std::env::temp_dir().join(format!("grip-heatmaps-{}", std::process::id()));
    let said = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "natively", "--ignored"])
        .env("ORT_DYLIB_PATH", &library)
        .env(OUT, &out)
        .output()
        .unwrap();
    assert!(said.status.success(), "{}", String::from_utf8_lossy(&said.stdout));
    let bytes = std::fs::read(&out).unwrap();
    std::fs::remove_file(&out).unwrap();
    let native: Vec<f32> =
        bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    let (runtime, embedded) = heatmaps();
    assert_eq!(runtime, "tract", "unset ORT_DYLIB_PATH");
    assert_eq!(native.len(), embedded.len());
    let most = native.iter().zip(&embedded).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(most < TOLERANCE, "differ by up to {most}");
    // The picture is not so dull that any two networks would agree.
    let spread = embedded.iter().fold([1.0_f32, 0.0], |[low, high], p| [low.min(*p), high.max(*p)]);
    assert!(spread[0] < 1e-3 && spread[1] > 0.9, "{spread:?}");
}

#[test]
#[ignore = "runs in a process of its own, begun by the other test"]
fn natively() {
    let (runtime, values) = heatmaps();
    assert!(runtime.starts_with("ONNX Runtime"), "{runtime}");
    let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
    std::fs::write(std::env::var_os(OUT).expect("set by the other test"), bytes).unwrap();
}
