//! Bad input gets a clear message that names file, field and value, exit code 2, and leaves nothing behind.

use std::fs;
use std::path::Path;

use crate::common::{code, edited_scene, grip, root, stderr, stdout};

/// Runs `grip render` on an edited copy of the default scene and returns what it says on failure.
fn complaint(edit: impl Fn(String) -> String) -> String {
    let folder = tempfile::tempdir().unwrap();
    let scene = edited_scene(folder.path(), edit);
    let out = folder.path().join("out");
    let output =
        grip(&["render", scene.to_str().unwrap(), "--renderer", "cpu", "--out", out.to_str().unwrap()]);
    assert_eq!(code(&output), 2, "{}", stderr(&output));
    assert_eq!(stdout(&output), "");
    let left: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left, ["scene.toml"], "nothing half-written is left behind");
    stderr(&output)
}

fn assert_all(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "no '{part}' in: {message}");
    }
}

#[test]
fn an_unknown_object_is_named_with_the_known_ones() {
    let message = complaint(|t| t.replace("005_tomato_soup_can", "005_tomato_soup_cam"));
    assert_all(&message, &["scene.toml", "005_tomato_soup_cam", "005_tomato_soup_can"]);
}

#[test]
fn an_object_off_the_table_is_refused() {
    let message = complaint(|t| {
        t + "\n[[objects.placed]]\nname = \"005_tomato_soup_can\"\n\
             pose = { translation = [3.0, 0.0, 0.9], quaternion = [1.0, 0.0, 0.0, 0.0] }\n"
    });
    assert_all(&message, &["scene.toml", "005_tomato_soup_can", "off the table", "move it"]);
}

#[test]
fn nan_and_huge_numbers_are_refused_by_field() {
    let nan = complaint(|t| replace_value(&t, "gap", "nan"));
    assert_all(&nan, &["scene.toml", "objects.gap = NaN", "finite"]);
    let huge = complaint(|t| replace_value(&t, "wall_height", "1e300"));
    assert_all(&huge, &["bin.wall_height", "from"]);
}

/// Replaces the value of the first line `key = ...`.
fn replace_value(text: &str, key: &str, value: &str) -> String {
    let mut done = false;
    text.lines()
        .map(|line| {
            if !done && line.split('=').next().is_some_and(|k| k.trim() == key) {
                done = true;
                format!("{key} = {value}")
            } else {
                line.to_string()
            }
        })
        .collect::<Vec<_>>()
        .join("\n")
}

#[test]
fn a_broken_scene_file_names_the_line() {
    let message = complaint(|t| t.replacen("[table]", "[table", 1));
    assert_all(&message, &["scene.toml", "line"]);
}

#[test]
fn a_missing_scene_is_named() {
    let output = grip(&["pack", "no/such/scene.toml"]);
    assert_eq!(code(&output), 2);
    assert_all(&stderr(&output), &["no/such/scene.toml", "check that the path exists"]);
}

#[test]
fn an_unknown_condition_lists_those_there_are() {
    let output = grip(&["render", "--condition", "foggy", "--renderer", "cpu"]);
    assert_eq!(code(&output), 2);
    assert_all(&stderr(&output), &["foggy", "base", "dark", "light-left", "light-right", "clutter-1"]);
}

#[test]
fn a_truncated_urdf_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let urdf = fs::read_to_string(root().join("robots/fetch/fetch.urdf")).unwrap();
    let path = folder.path().join("cut.urdf");
    fs::write(&path, &urdf[..urdf.len() / 2]).unwrap();
    let output = grip(&["robot", "--robot", path.to_str().unwrap()]);
    assert_eq!(code(&output), 2);
    assert_all(&stderr(&output), &["cut.urdf"]);
}

#[test]
fn a_missing_mesh_is_named_with_its_link_and_urdf() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("robot.urdf");
    let urdf = r#"<robot name="r"><link name="base_link"><visual><geometry>
        <mesh filename="package://some_description/meshes/gone.dae"/></geometry></visual></link></robot>"#;
    fs::write(&path, urdf).unwrap();
    let packages = folder.path().join("packages");
    fs::create_dir(&packages).unwrap();
    let output =
        grip(&["robot", "--robot", path.to_str().unwrap(), "--package-path", packages.to_str().unwrap()]);
    assert_eq!(code(&output), 2);
    assert_all(&stderr(&output), &["gone.dae", "base_link", "robot.urdf"]);
}

#[test]
fn a_truncated_scan_is_named() {
    // The official layout, with a mesh that was cut off in the middle of a line.
    let folder = tempfile::tempdir().unwrap();
    let object = folder.path().join("005_tomato_soup_can/google_16k");
    fs::create_dir_all(&object).unwrap();
    fs::write(object.join("textured.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\nv 0 1").unwrap();
    let message = with_scans(folder.path());
    assert_all(&message, &["textured.obj"]);

    // A BOP models folder, cut off in the header's promise of vertices.
    let folder = tempfile::tempdir().unwrap();
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
               element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n";
    for id in 1..=21 {
        fs::write(folder.path().join(format!("obj_{id:06}.ply")), ply).unwrap();
    }
    let message = with_scans(folder.path());
    assert_all(&message, &[".ply"]);
}

#[test]
fn a_truncated_texture_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let object = folder.path().join("005_tomato_soup_can/google_16k");
    fs::create_dir_all(&object).unwrap();
    fs::write(
        object.join("textured.obj"),
        "mtllib textured.mtl\nv 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\n\
         f 1/1 3/3 2/2\nf 1/1 2/2 4/3\nf 1/1 4/3 3/2\nf 2/1 3/2 4/3\n",
    )
    .unwrap();
    fs::write(object.join("textured.mtl"), "newmtl m\nmap_Kd texture_map.png\n").unwrap();
    fs::write(object.join("texture_map.png"), b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR").unwrap();
    let message = with_scans(folder.path());
    assert_all(&message, &["texture_map.png"]);
}

/// Renders a scene of one can from the scanned set in `folder` and returns the complaint.
fn with_scans(folder: &Path) -> String {
    let place = tempfile::tempdir().unwrap();
    let scene = edited_scene(place.path(), |t| {
        let mut skip = false;
        // Only the can is asked for, so that its file is the one that is read.
        t.lines()
            .filter_map(|line| {
                if line.trim_start().starts_with("names = [") {
                    skip = !line.contains(']');
                    return Some("names = [\"005_tomato_soup_can\"]".to_string());
                }
                if skip {
                    skip = !line.contains(']');
                    return None;
                }
                Some(line.to_string())
            })
            .collect::<Vec<_>>()
            .join("\n")
    });
    let out = place.path().join("out");
    let output = grip(&[
        "render",
        scene.to_str().unwrap(),
        "--ycb",
        folder.to_str().unwrap(),
        "--renderer",
        "cpu",
        "--out",
        out.to_str().unwrap(),
    ]);
    assert_eq!(code(&output), 2, "{}", stderr(&output));
    assert!(!out.exists());
    stderr(&output)
}

#[test]
fn a_folder_that_cannot_be_written_is_named() {
    // A file where a folder is needed fails for root as well, which permissions would not.
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("file"), "").unwrap();
    let out = folder.path().join("file/run");
    for verb in ["render", "pack"] {
        let output = grip(&[verb, "--renderer", "cpu", "--out", out.to_str().unwrap()]);
        assert_eq!(code(&output), 2);
        assert_all(&stderr(&output), &["file", "cannot write", "--out"]);
    }
}

#[test]
fn another_folder_is_never_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("thesis.tex"), "precious").unwrap();
    let output = grip(&["pack", "--out", folder.path().to_str().unwrap()]);
    assert_eq!(code(&output), 2);
    assert_all(&stderr(&output), &["not the folder of an earlier run"]);
    assert_eq!(fs::read_to_string(folder.path().join("thesis.tex")).unwrap(), "precious");
}

#[test]
fn a_wrong_command_line_exits_with_two_and_help_with_zero() {
    assert_eq!(code(&grip(&["pack", "--estimator", "psychic"])), 2);
    let help = grip(&["--help"]);
    assert_eq!(code(&help), 0);
    assert_all(&stdout(&help), &["pack", "render", "objects", "robot"]);
}

/// The loader of Vulkan drivers is told that there is none.
#[cfg(target_os = "linux")]
#[test]
fn without_an_adapter_hypotheses_on_the_gpu_are_an_error_that_says_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_grip"))
        .args(["pack", "--renderer", "cpu", "--hypotheses", "gpu", "--out"])
        .arg(folder.path().join("run"))
        .current_dir(root())
        .env("VK_ICD_FILENAMES", "/nonexistent")
        .env("VK_DRIVER_FILES", "/nonexistent")
        .output()
        .unwrap();
    assert_eq!(code(&output), 2);
    assert_all(&stderr(&output), &["no graphics adapter", "mesa-vulkan-drivers", "--hypotheses cpu"]);
}

#[test]
fn objects_and_robot_print_tables_and_json() {
    let table = grip(&["objects"]);
    assert_eq!(code(&table), 0);
    assert_all(&stdout(&table), &["002_master_chef_can", "061_foam_brick", "object set in use: built-in"]);
    let json: serde_json::Value = serde_json::from_slice(&grip(&["objects", "--json"]).stdout).unwrap();
    assert_eq!(json["objects"].as_array().unwrap().len(), 21);

    let robot: serde_json::Value = serde_json::from_slice(&grip(&["robot", "--json"]).stdout).unwrap();
    let joints = robot["joints"].as_array().unwrap();
    let named = |name: &str| joints.iter().find(|j| j["name"] == name).unwrap();
    assert_eq!(named("torso_lift_joint")["upper"], 0.38615);
    assert_eq!(named("elbow_flex_joint")["upper"], 2.251);
}
