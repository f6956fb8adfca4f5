//! The two renderers agree on the default scene, robot, objects and all; and what `grip render` writes is what it says.

use std::path::Path;

use crate::common::{self, code, grip, stderr};

struct Shot {
    depth_mm: Vec<u16>,
    labels: Vec<u8>,
}

/// Renders the default scene without depth noise and reads the files back as a tool would.
fn shot(renderer: &str, condition: &str, folder: &Path) -> Option<Shot> {
    let scene = common::edited_scene(folder, |t| t.replace("\"carmine-109\"", "\"none\""));
    let out = folder.join(format!("{renderer}-{condition}"));
    let output = grip(&[
        "render",
        scene.to_str().unwrap(),
        "--seed",
        "3",
        "--renderer",
        renderer,
        "--condition",
        common::root().join(format!("scenes/conditions/{condition}.toml")).to_str().unwrap(),
        "--out",
        out.to_str().unwrap(),
    ]);
    if renderer == "wgpu" && code(&output) == 2 && stderr(&output).contains("adapter") {
        assert!(
            std::env::var_os("GRIP_REQUIRE_ADAPTER").is_none(),
            "GRIP_REQUIRE_ADAPTER is set but there is no adapter: {}",
            stderr(&output)
        );
        println!("SKIPPED: no graphics adapter: {}", stderr(&output));
        return None;
    }
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let depth_mm = image::open(out.join("depth.png")).unwrap().into_luma16().into_raw();
    let file = std::io::BufReader::new(std::fs::File::open(out.join("labels.png")).unwrap());
    let mut decoder = png::Decoder::new(file);
    decoder.set_transformations(png::Transformations::IDENTITY);
    let mut reader = decoder.read_info().unwrap();
    let mut labels = vec![0; 640 * 480];
    reader.next_frame(&mut labels).unwrap();
    Some(Shot { depth_mm, labels })
}

#[test]
fn wgpu_and_cpu_agree_on_depth_and_labels() {
    let folder = tempfile::tempdir().unwrap();
    let Some(wgpu) = shot("wgpu", "base", folder.path()) else { return };
    let cpu = shot("cpu", "base", folder.path()).unwrap();
    let pixels = cpu.labels.len();
    let same: Vec<usize> = (0..pixels).filter(|&i| cpu.labels[i] == wgpu.labels[i]).collect();
    let label_share = same.len() as f64 / pixels as f64;
    let close = same.iter().filter(|&&i| cpu.depth_mm[i].abs_diff(wgpu.depth_mm[i]) <= 1).count();
    let depth_share = close as f64 / same.len() as f64;
    println!(
        "labels equal on {:.3} %, depth within 1 mm on {:.3} %",
        label_share * 100.0,
        depth_share * 100.0
    );
    assert!(label_share >= 0.995, "{label_share}");
    assert!(depth_share >= 0.995, "{depth_share}");
    // The pictures show something: all five objects, the robot or not.
    for label in 1..=5u8 {
        let seen = cpu.labels.iter().filter(|&&l| l == label).count();
        assert!(seen > 150, "object {label} covers {seen} pixels");
    }
}

#[test]
fn darkness_changes_the_picture_and_not_the_depth() {
    let folder = tempfile::tempdir().unwrap();
    let base = shot("cpu", "base", folder.path()).unwrap();
    let dark = shot("cpu", "dark", folder.path()).unwrap();
    assert_eq!(base.depth_mm, dark.depth_mm, "perfect depth does not depend on the light");
    let brightness = |condition: &str| {
        let rgb = image::open(folder.path().join(format!("cpu-{condition}/rgb.png"))).unwrap().into_luma8();
        rgb.as_raw().iter().map(|&v| f64::from(v)).sum::<f64>() / rgb.as_raw().len() as f64
    };
    let (base, dark) = (brightness("base"), brightness("dark"));
    println!("mean brightness: base {base:.1}, dark {dark:.1}");
    assert!(base > 80.0 && dark < 0.5 * base && dark > 2.0, "base {base}, dark {dark}");
}
