//! Files of others, as they were met: right, or an error that names the file, the place in it and what to do, and exit code 2.

use std::ffi::OsString;
use std::fs;
use std::os::unix::ffi::OsStringExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use image::metadata::Orientation;
use image::{DynamicImage, ImageFormat, RgbImage};

use crate::common::{code, edited_scene, grip, root, stderr, stdout};
use crate::plan::{REQUEST, problem};

/// Exit code 2, no panic, and each of `parts` in the error.
fn refused(output: &Output, parts: &[&str]) {
    assert_eq!(code(output), 2, "{}{}", stdout(output), stderr(output));
    for part in parts {
        assert!(stderr(output).contains(part), "{part}: {}", stderr(output));
    }
}

fn done(output: &Output) -> String {
    assert_eq!(code(output), 0, "{}", stderr(output));
    stdout(output)
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// `grip robot` on a robot of one link with the mesh `name`.
fn robot_with_mesh(folder: &Path, name: &str) -> Output {
    let urdf = folder.join("robot.urdf");
    let geometry = format!("<geometry><mesh filename=\"{name}\"/></geometry>");
    let links =
        format!("<link name=\"body\"><visual>{geometry}</visual><collision>{geometry}</collision></link>");
    fs::write(&urdf, format!("<robot name=\"one\">{links}</robot>")).unwrap();
    grip(&["robot", "--robot", text(&urdf)])
}

/// A picture with something in it.
fn photo() -> DynamicImage {
    RgbImage::from_fn(160, 120, |x, y| {
        let red = (x as f64 - 50.0).hypot(y as f64 - 70.0) < 25.0;
        image::Rgb(if red { [200, 30, 20] } else { [(x / 2) as u8 + 60, 120, (y / 2) as u8 + 90] })
    })
    .into()
}

fn jpeg(picture: &DynamicImage) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut bytes, ImageFormat::Jpeg).unwrap();
    bytes.into_inner()
}

fn data_set(folder: &Path) -> PathBuf {
    let set = folder.join("set");
    let scenes = ["scenes", "--scenes", "1", "--views", "B", "--seed", "3", "--objects"];
    done(&grip(&[&scenes[..], &["003_cracker_box,005_tomato_soup_can", "--out", text(&set)]].concat()));
    set
}

#[test]
fn a_jpeg_that_was_cut_off_is_not_searched() {
    let folder = tempfile::tempdir().unwrap();
    let whole = jpeg(&photo());
    let half = folder.path().join("half.jpg");
    for (bytes, wanted) in [
        (whole[..whole.len() / 2].to_vec(), "ends before its end marker"),
        ([&whole[..whole.len() / 2], &whole[whole.len() - 2..]].concat(), "before its last pixels"),
        (vec![0; 100], "is no picture"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n".to_vec(), "git lfs pull"),
    ] {
        fs::write(&half, bytes).unwrap();
        let output = grip(&["detect", text(&half), "--top", "3"]);
        refused(&output, &["half.jpg", wanted]);
        assert_eq!(stdout(&output), "");
    }
}

#[test]
fn a_photo_that_its_exif_tag_turns_gives_the_boxes_of_the_upright_one() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = jpeg(&photo());
    let exif = b"Exif\0\0II\x2a\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0";
    let length = (exif.len() as u16 + 2).to_be_bytes();
    let tagged = [&bytes[..2], &[0xff, 0xe1], &length, exif.as_slice(), &bytes[2..]].concat();
    let (turned, upright) = (folder.path().join("tagged.jpg"), folder.path().join("upright.png"));
    fs::write(&turned, tagged).unwrap();
    let mut picture = image::load_from_memory(&bytes).unwrap();
    picture.apply_orientation(Orientation::Rotate90);
    picture.save(&upright).unwrap();
    let boxes = |path: &Path| {
        let json: serde_json::Value =
            serde_json::from_str(&done(&grip(&["detect", text(path), "--top", "5", "--json"]))).unwrap();
        json["boxes"].clone()
    };
    assert_eq!(boxes(&turned), boxes(&upright));
    assert!(!boxes(&turned).as_array().unwrap().is_empty());
}

/// ITODD's pictures are grey and TIFF.
#[test]
fn a_set_of_grey_tiff_pictures_is_estimated_and_scored_in_full() {
    let folder = tempfile::tempdir().unwrap();
    let set = data_set(folder.path());
    let scene = set.join("test/000001");
    let (a, b) = (folder.path().join("a.csv"), folder.path().join("b.csv"));
    let estimate = |out: &Path| done(&grip(&["estimate", text(&set), "--boxes", "gt", "--out", text(out)]));
    estimate(&a);
    fs::create_dir(scene.join("gray")).unwrap();
    for (from, to) in [("rgb/000000.png", "gray/000000.tif"), ("depth/000000.png", "depth/000000.tif")] {
        let picture = image::open(scene.join(from)).unwrap();
        let picture = if to.starts_with("gray") { picture.grayscale() } else { picture };
        picture.save(scene.join(to)).unwrap();
        fs::remove_file(scene.join(from)).unwrap();
    }
    estimate(&b);
    // Poses are found by their depth.
    let lines = |path: &Path| fs::read_to_string(path).unwrap().lines().count();
    assert_eq!(lines(&a), lines(&b));
    let output = grip(&["eval", text(&set), text(&b)]);
    assert!(!done(&output).contains("no AR") && !stderr(&output).contains("no depth"), "{}", stderr(&output));
    // What is there and is not read is said, and not taken for absent.
    for (from, to) in [("gray/000000.tif", "gray/000000.webp"), ("depth/000000.tif", "depth/000000.exr")] {
        fs::rename(scene.join(from), scene.join(to)).unwrap();
        let wanted = [to, "format that is not read", ".tif"];
        refused(&grip(&["estimate", text(&set), "--boxes", "gt", "--out", text(&b)]), &wanted);
        refused(&grip(&["eval", text(&set), text(&b)]), &wanted);
        fs::rename(scene.join(to), scene.join(from)).unwrap();
    }
}

#[test]
fn folders_whose_names_are_not_utf_8_are_worked_on_by_every_command() {
    let folder = tempfile::tempdir().unwrap();
    let odd = folder.path().join(OsString::from_vec(b"caf\xe9".to_vec()));
    fs::create_dir(&odd).unwrap();
    fs::rename(data_set(folder.path()), odd.join("set")).unwrap();
    photo().save(odd.join("p.png")).unwrap();
    fs::create_dir(odd.join("problems")).unwrap();
    problem(&odd.join("problems"), "0001", [0.75, 0.0], REQUEST);
    let urdf = odd.join("r.urdf");
    fs::write(&urdf, "<robot name='r'><link name='a'/></robot>").unwrap();
    // Of the words those with a slash are in that folder.
    let run = |arguments: &str| {
        let word = |word: &str| match word.strip_prefix('/') {
            Some(inside) => odd.join(inside).into_os_string(),
            None => OsString::from(word),
        };
        let mut command = Command::new(env!("CARGO_BIN_EXE_grip"));
        command.args(arguments.split(' ').map(word)).current_dir(root()).env_remove("GRIP_YCB_DIR");
        let output = command.output().unwrap();
        assert_eq!(code(&output), 0, "{arguments}: {}", stderr(&output));
        stdout(&output)
    };
    let shown = run("estimate /set --boxes gt --out /r.csv --json");
    assert!(shown.contains("caf\u{fffd}/set"), "{shown}");
    for arguments in [
        "estimate /set --boxes gt --out /r.csv --resume",
        "eval /set /r.csv --json",
        "explain /set /r.csv --scene 1 --image 0 --out /e.png --json",
        "detect /p.png --top 1 --json",
        "detect /set --out /b.json --json",
        "plan /problems --json",
        "robot --robot /r.urdf --json",
        "render --renderer cpu --out /render",
        "grasps 003_cracker_box --out /grasps",
        "scenes --scenes 1 --views B --renderer cpu --out /more --json",
    ] {
        run(arguments);
    }
    assert!(odd.join("e.png").is_file() && odd.join("render/rgb.png").is_file());
}

#[test]
fn results_in_metres_or_of_unknown_objects_are_not_accepted_without_a_word() {
    let folder = tempfile::tempdir().unwrap();
    let set = data_set(folder.path());
    let results = folder.path().join("r.csv");
    let write =
        |lines: &str| fs::write(&results, format!("scene_id,im_id,obj_id,score,R,t,time\n{lines}")).unwrap();
    let line = |object: u32, t: &str| format!("1,0,{object},0.9,1 0 0 0 1 0 0 0 1,{t},-1\n");
    write(&line(2, "0.01 -0.02 0.93"));
    refused(&grip(&["eval", text(&set), text(&results)]), &["r.csv", "0.930 mm", "millimetres", "metres"]);
    write(&(line(2, "10 -20 930") + &line(99, "0 0 900")));
    let output = grip(&["eval", text(&set), text(&results), "--json"]);
    let json: serde_json::Value = serde_json::from_str(&done(&output)).unwrap();
    assert!(stderr(&output).contains("no model of: 99"), "{}", stderr(&output));
    assert_eq!(
        (&json["unknown"]["99"], &json["ignored"], &json["presence"]["absent"]),
        (&1.into(), &1.into(), &0.into())
    );
    write(&line(99, "0 0 900"));
    refused(&grip(&["eval", text(&set), text(&results)]), &["none of the 1 estimates"]);
}

#[test]
fn a_limit_without_velocity_is_none_and_other_urdf_errors_name_their_element() {
    let folder = tempfile::tempdir().unwrap();
    let urdf = folder.path().join("r.urdf");
    let run = |joint: &str| {
        let ends = "<parent link='base'/><child link='drawer'/><axis xyz='1 0 0'/>";
        let joint = format!("<joint name='slide' type='prismatic'>{ends}\n{joint}</joint>");
        fs::write(
            &urdf,
            format!("<robot name='two'><link name='base'/><link name='drawer'/>{joint}</robot>"),
        )
        .unwrap();
        grip(&["robot", "--robot", text(&urdf)])
    };
    let table = done(&run("<limit lower='0' upper='0.4'/>"));
    let row: Vec<&str> =
        table.lines().find(|line| line.contains("slide")).unwrap().split_whitespace().collect();
    assert_eq!(row, ["slide", "prismatic", "0.0000", "0.4000", "-", "-"]);
    let output = run("<limit lower='0' upper='far' velocity='1'/>");
    refused(&output, &["r.urdf", "joint 'slide', <limit>, line 2", "upper=\"far\"", "no number"]);
    refused(&run("<origin xyz='${x} 0 0'/><limit lower='0' upper='1'/>"), &["<origin>", "xacro"]);
    refused(&run("<limit lower='0' upper='0.4' velocity='-1'/>"), &["joint 'slide'", "velocity -1"]);
    fs::write(&urdf, "<sdf version='1.6'><model name='m'/></sdf>").unwrap();
    refused(&grip(&["robot", "--robot", text(&urdf)]), &["r.urdf", "<sdf>", "convert it to URDF"]);
}

#[test]
fn meshes_as_exporters_write_them_are_loaded() {
    let folder = tempfile::tempdir().unwrap();
    let here = |name: &str| folder.path().join(name);
    let facet = |v: [&str; 3]| {
        format!(
            "FACET NORMAL 0 0 0\nOUTER LOOP\nVERTEX {}\nVERTEX {}\nVERTEX {}\nENDLOOP\nENDFACET\n",
            v[0], v[1], v[2]
        )
    };
    let [o, x, y, z] = ["0 0 0", "1 0 0", "0 1 0", "0 0 1"];
    let facets = [[o, y, x], [o, x, z], [o, z, y], [x, y, z]].map(facet).concat();
    fs::write(here("part.stl"), format!("\u{feff}SOLID PART\n{facets}ENDSOLID PART\n")).unwrap();
    assert!(
        done(&robot_with_mesh(folder.path(), "part.stl"))
            .contains("1 visuals, 1 collision shapes, 1 mesh files")
    );

    // A material library in which a colour is one number, and whose texture has options and a space in its name.
    photo().save(here("my label.png")).unwrap();
    let mtl = b"newmtl a\nKd 0.6\nmap_Kd -s 2 2 1 -clamp on my label.png\n# gr\xfcn\n";
    fs::write(here("part.mtl"), mtl).unwrap();
    let mut obj = b"# f\xfcr\nmtllib part.mtl\nusemtl a\nvt 0 0\n".to_vec();
    obj.extend(
        b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1/1 3/1 2/1\nf 1/1 2/1 4/1\nf 1/1 4/1 3/1\nf 2/1 3/1 4/1\n",
    );
    fs::write(here("part.obj"), &obj).unwrap();
    let output = robot_with_mesh(folder.path(), "part.obj");
    assert!(
        done(&output).contains("1 visuals") && stderr(&output).contains("-s is not followed"),
        "{}",
        stderr(&output)
    );
    fs::write(here("part.mtl"), "newmtl a\nKd\n").unwrap();
    refused(&robot_with_mesh(folder.path(), "part.obj"), &["part.mtl", "line 2", "'Kd'"]);
    fs::remove_file(here("part.mtl")).unwrap();
    let output = robot_with_mesh(folder.path(), "part.obj");
    assert!(
        done(&output).contains("1 visuals") && stderr(&output).contains("part.mtl"),
        "{}",
        stderr(&output)
    );

    // A COLLADA texture is named by a URI, and so are meshes.
    let source = |id: &str, numbers: &str, count: usize| {
        format!(
            "<source id='{id}'><float_array id='{id}a' count='{count}'>{numbers}</float_array><technique_common>\
             <accessor source='#{id}a' stride='{}'/></technique_common></source>",
            if id == "t" { 2 } else { 3 }
        )
    };
    let dae = format!(
        "<?xml version='1.0' encoding='ISO-8859-1'?><COLLADA><library_images><image id='i'><init_from>my%20label.png</init_from>\
         </image></library_images><library_effects><effect id='e'><diffuse><texture texture='i'/></diffuse></effect></library_effects>\
         <library_materials><material id='m'><instance_effect url='#e'/></material></library_materials><library_geometries>\
         <geometry id='g'><mesh>{}{}<vertices id='vs'><input semantic='POSITION' source='#v'/></vertices><triangles material='x' count='4'>\
         <input semantic='VERTEX' source='#vs' offset='0'/><input semantic='TEXCOORD' source='#t' offset='1'/>\
         <p>0 0 2 0 1 0 0 0 1 0 3 0 0 0 3 0 2 0 1 0 2 0 3 0</p></triangles></mesh></geometry></library_geometries><library_visual_scenes>\
         <visual_scene id='w'><node name='gr\u{fc}n'><instance_geometry url='#g'><bind_material><technique_common>\
         <instance_material symbol='x' target='#m'/></technique_common></bind_material></instance_geometry></node></visual_scene>\
         </library_visual_scenes><scene><instance_visual_scene url='#w'/></scene></COLLADA>",
        source("v", "0 0 0 1 0 0 0 1 0 0 0 1", 12),
        source("t", "0.5 0.5", 2)
    );
    let latin: Vec<u8> = dae.chars().map(|letter| letter as u8).collect();
    fs::write(here("my part.dae"), latin).unwrap();
    assert!(done(&robot_with_mesh(folder.path(), "my%20part.dae")).contains("1 visuals"));
    fs::remove_file(here("my label.png")).unwrap();
    refused(
        &robot_with_mesh(folder.path(), "my%20part.dae"),
        &["link 'body'", "my part.dae", "my label.png"],
    );
}

#[test]
fn what_stands_in_place_of_a_file_is_recognised_wherever_one_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let set = data_set(folder.path());
    let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a2146\nsize 12345\n";
    let here = |name: &str| {
        let path = folder.path().join(name);
        fs::write(&path, pointer).unwrap();
        path
    };
    let wanted = ["Git LFS pointer", "git lfs pull"];
    let settings = here("s.toml");
    for name in ["a.stl", "a.dae", "a.obj"] {
        here(name);
        refused(&robot_with_mesh(folder.path(), name), &[&[name], &wanted[..]].concat());
    }
    refused(&grip(&["robot", "--robot", text(&here("l.urdf"))]), &wanted);
    refused(&grip(&["settings", "--settings", text(&settings)]), &wanted);
    refused(&grip(&["pack", text(&here("scene.toml"))]), &wanted);
    refused(&grip(&["eval", text(&set), text(&here("r.csv"))]), &wanted);
    refused(&grip(&["detect", text(&set), "--detector-model", text(&here("n.onnx"))]), &wanted);
    let boxes = here("b.json");
    refused(
        &grip(&["estimate", text(&set), "--boxes", text(&boxes), "--out", text(&here("o.csv"))]),
        &wanted,
    );
    let model = set.join("models/obj_000002.ply");
    fs::write(&model, pointer).unwrap();
    let out = folder.path().join("o.csv");
    refused(
        &grip(&["estimate", text(&set), "--boxes", "gt", "--out", text(&out)]),
        &["obj_000002.ply", wanted[1]],
    );
    for (content, wanted) in
        [("", "is empty"), ("<!DOCTYPE html>", "HTML page"), ("PK\u{3}\u{4}", "zip archive")]
    {
        fs::write(&settings, content).unwrap();
        refused(&grip(&["settings", "--settings", text(&settings)]), &["s.toml", wanted]);
    }
}

/// Problems that say more than is understood are no easier ones.
#[test]
fn a_sensed_scene_is_not_planned_in_as_if_it_were_empty() {
    let folder = tempfile::tempdir().unwrap();
    problem(folder.path(), "0001", [0.75, 0.0], REQUEST);
    let scene = folder.path().join("scene0001.yaml");
    let whole = fs::read_to_string(&scene).unwrap();
    let plan = || grip(&["plan", text(folder.path())]);
    for (content, wanted) in [
        (
            "world: {octomap: {octomap: {id: OcTree, data: [0, 0, 5, 85]}}}\n".to_owned(),
            "world.octomap: not supported",
        ),
        (String::new(), "is empty"),
        (format!("{whole}link_padding: [{{link_name: gripper_link, padding: 0.05}}]\n"), "link_padding"),
        (whole.replace("id: column", "id: column, operation: 1"), "operation: 1"),
    ] {
        fs::write(&scene, content).unwrap();
        refused(&plan(), &["scene0001.yaml", wanted]);
    }
    // An object's own pose: the column stands where its pose and its shape's pose together say.
    let solved = |content: &str| {
        fs::write(&scene, content).unwrap();
        let output = grip(&["plan", text(folder.path()), "--json"]);
        let json: serde_json::Value = serde_json::from_str(&done(&output)).unwrap();
        let problem = &json["problems"][0];
        (problem["path_length"].clone(), problem["iterations"].clone(), problem["clearance_m"].clone())
    };
    let apart = whole
        .replace(
            "primitives:",
            "pose: {position: {x: 0.75, y: 0.0, z: 0.3}, orientation: {x: 0, y: 0, z: 0, w: 1}}, primitives:",
        )
        .replace("[0.75, 0, 0.8]", "[0, 0, 0.5]");
    assert_ne!(apart, whole);
    let (a, b) = (solved(&whole), solved(&apart));
    assert_eq!(a, b);
}

#[test]
fn places_of_objects_that_cannot_be_are_said_at_once() {
    let folder = tempfile::tempdir().unwrap();
    // A can on a box may be; one over the table's edge falls.
    let place = |(name, x, z): (&str, f64, f64)| {
        format!(
            "[[objects.placed]]\nname = \"{name}\"\n\
             pose = {{ translation = [{x}, 0.2, {z}], quaternion = [1.0, 0.0, 0.0, 0.0] }}\n"
        )
    };
    let scene = edited_scene(folder.path(), |text| {
        let (head, _) = text.split_once("names = [").unwrap();
        let (_, tail) = text.split_once("names = [").unwrap().1.split_once(']').unwrap();
        let names = ["003_cracker_box", "005_tomato_soup_can"];
        let placed = [(names[0], 0.62, 0.765), (names[1], 0.935, 0.705)].map(place).concat();
        format!("{head}names = {names:?}{tail}\n{placed}")
    });
    let output =
        grip(&["render", text(&scene), "--renderer", "cpu", "--out", text(&folder.path().join("out"))]);
    refused(&output, &["objects.placed", "give other poses"]);
    assert!(!folder.path().join("out").exists());
}

#[test]
fn a_scene_takes_the_intrinsics_that_it_names() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(
        folder.path().join("mine.yaml"),
        "image_width: 320\nimage_height: 240\ncamera_matrix: {rows: 3, cols: 3, data: [280.5, 0, 160, 0, 281, 119.5, 0, 0, 1]}\n",
    )
    .unwrap();
    let out = folder.path().join("out");
    let render = |name: &str| {
        let named = format!("intrinsics = {name:?}");
        let scene = edited_scene(folder.path(), |text| text.replace("intrinsics = \"fetch\"", &named));
        grip(&["render", text(&scene), "--renderer", "cpu", "--out", text(&out)])
    };
    let camera = |name: &str| {
        done(&render(name));
        let file: serde_json::Value =
            serde_json::from_str(&fs::read_to_string(out.join("camera.json")).unwrap()).unwrap();
        let size = image::image_dimensions(out.join("rgb.png")).unwrap();
        let k = &file["intrinsics"];
        (size, ["fx", "fy", "cx", "cy"].map(|name| k[name].as_f64().unwrap()))
    };
    assert_eq!(camera("mine.yaml"), ((320, 240), [280.5, 281.0, 160.0, 119.5]));
    assert_eq!(camera("grip-paper"), ((640, 480), [542.556, 542.556, 322.065, 222.214]));
    refused(&render("zed"), &["camera.intrinsics", "[camera.intrinsics.zed]", "fetch, grip-paper"]);
    refused(&render("none.yaml"), &["camera.intrinsics", "none.yaml"]);
}

#[test]
fn the_friction_of_a_sweep_is_that_of_the_contact() {
    let folder = tempfile::tempdir().unwrap();
    let held = |friction: &str| {
        let out = folder.path().join(friction);
        let args = [
            "sweep",
            "004_sugar_box",
            "--mode",
            "isotropic",
            "--samples",
            "2",
            "--range",
            "0.1,0.1",
            "--seeds",
            "2",
        ];
        let rest = ["--friction", friction, "--force", "15", "--out", text(&out), "--json"];
        let json: serde_json::Value =
            serde_json::from_str(&done(&grip(&[&args[..], &rest].concat()))).unwrap();
        json["objects"][0]["outcomes"]["held"].as_u64().unwrap_or(0)
    };
    // Two fingers of 15 N hold a weight of 5 N by 0.6 (18 N) and not by 0.15 (4.5 N), of which pads of 0.9 made 0.525 (16 N).
    assert_eq!((held("0.15"), held("0.6")), (0, 4));
}

/// Interrupted at any moment: no half-written folder, the exit code of Ctrl-C, and what to do next.
#[test]
fn an_interruption_leaves_nothing_half_written_and_says_how_to_go_on() {
    let folder = tempfile::tempdir().unwrap();
    for (signal, arguments, next) in [
        (
            "INT",
            &["pack", "--seed", "7", "--renderer", "cpu", "--out", "out"][..],
            "nothing half-written is left behind",
        ),
        ("TERM", &["trials", "--trials", "50", "--renderer", "cpu", "--out", "out"], "--resume goes on: out"),
        ("INT", &["scenes", "--scenes", "50", "--renderer", "cpu", "--out", "out"], "--resume goes on: out"),
    ] {
        let place = folder.path().join(arguments[0]);
        fs::create_dir(&place).unwrap();
        let child = Command::new(env!("CARGO_BIN_EXE_grip"))
            .args(arguments)
            .current_dir(&place)
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        // Until it has begun to write.
        while fs::read_dir(&place).unwrap().next().is_none() {
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        std::thread::sleep(std::time::Duration::from_millis(300));
        let kill =
            Command::new("kill").args([format!("-{signal}"), child.id().to_string()]).status().unwrap();
        assert!(kill.success());
        let output = child.wait_with_output().unwrap();
        assert_eq!(code(&output), 130, "{arguments:?}: {}", stderr(&output));
        assert!(
            stderr(&output).contains("interrupted: ") && stderr(&output).contains(next),
            "{}",
            stderr(&output)
        );
        let mut folders = vec![place.clone()];
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap()) {
                assert!(!entry.file_name().to_string_lossy().ends_with(".tmp"), "{:?}", entry.path());
                folders.extend(entry.path().is_dir().then(|| entry.path()));
            }
        }
        assert_eq!(place.join("out").exists(), arguments[0] != "pack");
    }
    // And it goes on.
    let set = folder.path().join("scenes/out");
    assert!(set.join("dataset.json").is_file());
}
