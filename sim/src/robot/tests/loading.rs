//! Loading URDFs and meshes: what is there is loaded as it stands, and what is wrong is told.

use std::path::{Path, PathBuf};

use nalgebra::{Point3, Vector3};

use super::super::{JointKind, RobotConfig, RobotModel};
use super::FETCH;
use crate::error::Result;
use crate::files::builtin_path;
use crate::shape::Convex;

/// A unit tetrahedron with a right angle at the origin: its four facets, counter-clockwise from outside.
const TETRAHEDRON: [[[f32; 3]; 3]; 4] = [
    [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]],
    [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
    [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]],
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
];

#[test]
fn the_built_in_fetch_is_the_one_on_disk() {
    let (robot, config) = &*FETCH;
    let built_in = RobotModel::load(&builtin_path("robots/fetch/fetch.urdf"), &[]).unwrap();
    assert_eq!(built_in.loaded(), robot.loaded());
    assert_eq!(format!("{:?}", built_in.joints()), format!("{:?}", robot.joints()));
    assert!(format!("{:?}", built_in.links()) == format!("{:?}", robot.links()));
    let (_, its_config) = RobotConfig::load(&builtin_path("robots/fetch/fetch.toml"), built_in).unwrap();
    assert_eq!(format!("{its_config:?}"), format!("{config:?}"));
}

fn ascii_stl() -> String {
    let mut text = "solid tetrahedron\n".to_string();
    for facet in TETRAHEDRON {
        text += "facet normal 0 0 0\n outer loop\n";
        for [x, y, z] in facet {
            text += &format!("  vertex {x} {y} {z}\n");
        }
        text += " endloop\nendfacet\n";
    }
    text + "endsolid tetrahedron\n"
}

fn binary_stl() -> Vec<u8> {
    let mut bytes = vec![0u8; 80];
    bytes.extend(4u32.to_le_bytes());
    for facet in TETRAHEDRON {
        bytes.extend([0u8; 12]);
        for value in facet.iter().flatten() {
            bytes.extend(value.to_le_bytes());
        }
        bytes.extend([0u8; 2]);
    }
    bytes
}

/// Two triangles' worth of COLLADA in centimetres: one mesh, drawn twice, the second time inside a turned and shifted
/// parent node, with two materials.
const DAE: &str = r##"<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset><unit name="centimeter" meter="0.01"/><up_axis>Y_UP</up_axis></asset>
  <library_effects>
    <effect id="red-fx"><profile_COMMON><technique sid="common"><phong>
      <diffuse><color>1 0.25 0 1</color></diffuse></phong></technique></profile_COMMON></effect>
  </library_effects>
  <library_materials>
    <material id="red"><instance_effect url="#red-fx"/></material>
  </library_materials>
  <library_geometries><geometry id="g"><mesh>
    <source id="p"><float_array id="pa" count="12">0 0 0 100 0 0 100 100 0 0 100 0</float_array>
      <technique_common><accessor source="#pa" count="4" stride="3"/></technique_common></source>
    <source id="n"><float_array id="na" count="3">0 0 1</float_array>
      <technique_common><accessor source="#na" count="1" stride="3"/></technique_common></source>
    <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
    <polylist material="m" count="1">
      <input semantic="VERTEX" source="#v" offset="0"/><input semantic="NORMAL" source="#n" offset="1"/>
      <vcount>4</vcount><p>0 0 1 0 2 0 3 0</p></polylist>
  </mesh></geometry></library_geometries>
  <library_visual_scenes><visual_scene id="s">
    <node><lookat>0 0 9 0 0 0 0 1 0</lookat><instance_camera url="#c"/></node>
    <node><instance_geometry url="#g"><bind_material><technique_common>
      <instance_material symbol="m" target="#red"/></technique_common></bind_material></instance_geometry></node>
    <node><translate>0 0 50</translate><rotate>1 0 0 90</rotate>
      <node><translate>0 0 10</translate><instance_geometry url="#g"/></node></node>
  </visual_scene></library_visual_scenes>
  <scene><instance_visual_scene url="#s"/></scene>
</COLLADA>"##;

const OBJ: &str =
    "mtllib cube.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl blue\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

/// A package with a URDF and its meshes.
struct Package {
    _keep: tempfile::TempDir,
    root: PathBuf,
}

impl Package {
    fn new() -> Self {
        let keep = tempfile::tempdir().unwrap();
        let root = keep.path().join("tiny_description");
        std::fs::create_dir_all(root.join("meshes")).unwrap();
        std::fs::write(root.join("meshes/ascii.stl"), ascii_stl()).unwrap();
        std::fs::write(root.join("meshes/binary.STL"), binary_stl()).unwrap();
        std::fs::write(root.join("meshes/plates.dae"), DAE).unwrap();
        std::fs::write(root.join("meshes/cube.obj"), OBJ).unwrap();
        std::fs::write(root.join("meshes/cube.mtl"), "newmtl blue\nKd 0 0 1\n").unwrap();
        std::fs::write(root.join("meshes/shape.fbx"), "x").unwrap();
        Self { _keep: keep, root }
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        std::fs::write(self.root.join("meshes").join(name), bytes).unwrap();
    }

    /// Loads a URDF with this body, from outside the package.
    fn load_with(&self, body: &str, package_paths: &[PathBuf]) -> Result<RobotModel> {
        let folder = tempfile::tempdir().unwrap();
        let urdf = folder.path().join("tiny.urdf");
        std::fs::write(&urdf, format!("<robot name=\"tiny\">{body}</robot>")).unwrap();
        RobotModel::load(&urdf, package_paths)
    }

    fn load(&self, body: &str) -> Result<RobotModel> {
        self.load_with(body, std::slice::from_ref(&self.root))
    }

    fn error(&self, body: &str) -> String {
        match self.load(body) {
            Ok(_) => panic!("loaded: {body}"),
            Err(error) => error.to_string(),
        }
    }
}

fn mesh(name: &str) -> String {
    format!("<geometry><mesh filename=\"package://tiny_description/meshes/{name}\"/></geometry>")
}

fn visual(name: &str) -> String {
    format!("<link name=\"a\"><visual>{}</visual></link>", mesh(name))
}

const TWO_LINKS: &str = r#"<link name="a"/><link name="b"/>"#;

fn joint(inner: &str) -> String {
    format!(
        r#"{TWO_LINKS}<joint name="j" type="revolute"><parent link="a"/><child link="b"/>{inner}</joint>"#
    )
}

const LIMIT: &str = r#"<limit lower="-1" upper="1" velocity="1" effort="1"/>"#;

#[test]
fn package_paths_may_be_the_package_or_the_folder_around_it() {
    let package = Package::new();
    let body = visual("binary.STL");
    let around = package.root.parent().unwrap().to_path_buf();
    for paths in [vec![package.root.clone()], vec![around]] {
        assert_eq!(package.load_with(&body, &paths).unwrap().loaded().meshes, 1);
    }
    // Renamed on disk: its package.xml still says what it is.
    let renamed = package.root.parent().unwrap().join("checkout");
    std::fs::rename(&package.root, &renamed).unwrap();
    assert!(package.load_with(&body, std::slice::from_ref(&renamed)).is_err());
    let manifest = "<package>\n <name>tiny_description</name></package>";
    std::fs::write(renamed.join("package.xml"), manifest).unwrap();
    assert!(package.load_with(&body, &[renamed]).is_ok());
}

#[test]
fn a_urdf_inside_its_own_package_needs_no_paths() {
    let package = Package::new();
    let folder = package.root.join("robots");
    std::fs::create_dir(&folder).unwrap();
    let urdf = folder.join("tiny.urdf");
    std::fs::write(&urdf, format!("<robot name=\"tiny\">{}</robot>", visual("ascii.stl"))).unwrap();
    assert_eq!(RobotModel::load(&urdf, &[]).unwrap().loaded().meshes, 1);
}

#[test]
fn relative_and_file_paths_resolve() {
    let package = Package::new();
    let absolute = format!("file://{}", package.root.join("meshes/ascii.stl").display());
    let body = format!(
        r#"<link name="a"><visual><geometry><mesh filename="{absolute}"/></geometry></visual></link>"#
    );
    assert!(package.load(&body).is_ok());
    let urdf = package.root.join("here.urdf");
    let body = r#"<robot name="t"><link name="a"><visual><geometry><mesh filename="meshes/ascii.stl"/></geometry></visual></link></robot>"#;
    std::fs::write(&urdf, body).unwrap();
    assert!(RobotModel::load(&urdf, &[]).is_ok());
}

#[test]
fn stl_in_both_kinds_gives_the_same_solid_scaled_and_coloured() {
    let package = Package::new();
    for name in ["ascii.stl", "binary.STL"] {
        let body = format!(
            r#"<material name="teal"><color rgba="0 0.5 0.5 1"/></material>
            <link name="a"><visual><origin xyz="1 0 0"/>
            <geometry><mesh filename="package://tiny_description/meshes/{name}" scale="0.1 0.2 -0.3"/></geometry>
            <material name="teal"/></visual>
            <collision>{}</collision></link>"#,
            mesh(name)
        );
        let robot = package.load(&body).unwrap();
        let link = &robot.links()[0];
        let visual = &link.visuals[0];
        assert_eq!(visual.pose.translation.vector, Vector3::x());
        assert_eq!(visual.visual.material.base_color, [0.0, 0.5, 0.5]);
        let mesh = &visual.visual.mesh;
        assert_eq!((mesh.triangles.len(), mesh.normals.len()), (4, 12));
        // Mirrored by the negative scale, yet wound outwards: the volume is positive.
        let volume: f32 = mesh
            .triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|i| mesh.positions[i as usize].coords);
                a.dot(&b.cross(&c)) / 6.0
            })
            .sum();
        assert!((volume - 0.001).abs() < 1e-6, "{volume}");
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
            let facet = (b - a).cross(&(c - a)).normalize();
            assert!((facet - mesh.normals[t[0] as usize]).norm() < 1e-5);
        }
        let Convex::Hull { points } = &link.collisions[0].geometry else { panic!("a hull") };
        assert_eq!(points.len(), 4);
        // The same file at two scales is one mesh file.
        let loaded = robot.loaded();
        assert_eq!((loaded.meshes, loaded.visuals, loaded.collisions), (1, 1, 1));
    }
}

#[test]
fn collada_nodes_units_materials_and_repeated_meshes_are_kept() {
    let package = Package::new();
    let robot = package.load(&visual("plates.dae")).unwrap();
    let visuals = &robot.links()[0].visuals;
    assert_eq!(visuals.len(), 2);
    assert_eq!(robot.loaded().visuals, 1);
    assert_eq!(visuals[0].visual.material.base_color, [1.0, 0.25, 0.0]);
    let bounds = |index: usize| {
        let positions = &visuals[index].visual.mesh.positions;
        positions.iter().fold((Point3::from([9.0f32; 3]), Point3::from([-9.0f32; 3])), |(low, high), p| {
            (low.inf(p), high.sup(p))
        })
    };
    let near = |a: Point3<f32>, b: [f32; 3]| (a - Point3::from(b)).norm() < 1e-6;
    // A square metre in the x-y plane, as its coordinates stand: up_axis turns nothing.
    let (low, high) = bounds(0);
    assert!(near(low, [0.0; 3]) && near(high, [1.0, 1.0, 0.0]), "{low} {high}");
    // Turned by 90 degrees about x (y becomes z, z becomes -y), then up 0.5 m; the inner shift along z is turned too.
    let (low, high) = bounds(1);
    assert!(near(low, [0.0, -0.1, 0.5]) && near(high, [1.0, -0.1, 1.5]), "{low} {high}");
    let normal = visuals[1].visual.mesh.normals[0];
    assert!((normal + Vector3::y()).norm() < 1e-6, "{normal}");
}

#[test]
fn obj_with_its_material_library_is_read() {
    let package = Package::new();
    let robot = package.load(&visual("cube.obj")).unwrap();
    let visual = &robot.links()[0].visuals[0].visual;
    assert_eq!(visual.material.base_color, [0.0, 0.0, 1.0]);
    assert_eq!(visual.mesh.triangles.len(), 4);
    std::fs::remove_file(package.root.join("meshes/cube.mtl")).unwrap();
    // Many published descriptions lack it: the shape is there all the same.
    let plain = package.load(&self::visual("cube.obj")).unwrap();
    let visual = &plain.links()[0].visuals[0].visual;
    assert_eq!(visual.mesh.triangles.len(), 4);
    assert_ne!(visual.material.base_color, [0.0, 0.0, 1.0]);
    // A colour of one number is grey; one of none is an error that names the library and its line.
    let library = package.root.join("meshes/cube.mtl");
    std::fs::write(&library, "newmtl blue\nKd 0.25\n").unwrap();
    let grey = package.load(&self::visual("cube.obj")).unwrap();
    assert_eq!(grey.links()[0].visuals[0].visual.material.base_color, [0.25; 3]);
    std::fs::write(&library, "newmtl blue\nKd\n").unwrap();
    let error = package.error(&self::visual("cube.obj"));
    assert!(error.contains("cube.mtl: line 2, 'Kd'"), "{error}");
}

#[test]
fn a_mesh_that_cannot_be_read_is_an_error_with_mesh_link_and_urdf() {
    let package = Package::new();
    package.write("cut.stl", &binary_stl()[..200]);
    package.write("cut_ascii.stl", &ascii_stl()[..150]);
    package.write("empty.stl", "");
    package.write("nan.stl", ascii_stl().replace("vertex 1 0 0", "vertex NaN 0 0"));
    package.write("cut.dae", &DAE[..DAE.len() / 2]);
    package.write("index.dae", DAE.replace("<p>0 0 1 0 2 0 3 0</p>", "<p>0 0 1 0 9 0 3 0</p>"));
    package.write("count.dae", DAE.replace("<vcount>4", "<vcount>5"));
    package.write("link.dae", DAE.replace("url=\"#g\"", "url=\"#h\""));
    package.write("number.dae", DAE.replace("0 0 0 100", "0 nan 0 100"));
    package.write(
        "circle.dae",
        DAE.replace("<node><instance_geometry", "<node id=\"self\"><instance_node url=\"#self\"/><instance_node url=\"#self\"/><instance_geometry"),
    );
    package.write("texture.dae", DAE.replace("<color>1 0.25 0 1</color>", "<texture texture=\"t\"/>"));
    let cases = [
        ("none.stl", "No such file"),
        ("cut.stl", "cut off: 2 of 4 triangles"),
        ("cut_ascii.stl", ""),
        ("empty.stl", ""),
        ("nan.stl", "not finite"),
        ("cut.dae", "not XML"),
        ("index.dae", "index 9 is beyond source 'p'"),
        ("count.dae", "shorter than <vcount>"),
        ("link.dae", "names nothing"),
        ("number.dae", "'nan' is not a finite number"),
        ("circle.dae", "circle"),
        ("texture.dae", "texture 't' leads to no image"),
        ("shape.fbx", "format 'fbx' is not supported; convert it to .stl, .dae or .obj"),
    ];
    for (name, expected) in cases {
        let error = package.error(&visual(name));
        let names_all = error.contains(name) && error.contains("link 'a'") && error.contains("tiny.urdf");
        assert!(names_all && error.contains(expected), "{error}");
    }
    let error = package.error(&visual("none.stl").replace("tiny_description", "other"));
    assert!(error.contains("package 'other' not found; searched"), "{error}");
    let error = package.error(&visual("none.stl").replace("package:", "http:"));
    assert!(error.contains("scheme 'http' is not supported"), "{error}");
    // A flat mesh is no collision body.
    let flat = visual("plates.dae").replace("visual>", "collision>");
    package.write(
        "plates.dae",
        DAE.replace("<translate>0 0 50</translate><rotate>1 0 0 90</rotate>", "").replace("0 0 10", "0 0 0"),
    );
    assert!(package.error(&flat).contains("flat"));
}

#[test]
fn a_urdf_that_is_no_tree_or_has_bad_numbers_is_refused() {
    let package = Package::new();
    let cycle = r#"<link name="r"/><link name="a"/><link name="b"/>
        <joint name="x" type="fixed"><parent link="a"/><child link="b"/></joint>
        <joint name="y" type="fixed"><parent link="b"/><child link="a"/></joint>"#;
    let loop_of_all = cycle.replace(r#"<link name="r"/>"#, "");
    let two_parents = r#"<link name="a"/><link name="b"/><link name="c"/>
        <joint name="x" type="fixed"><parent link="a"/><child link="c"/></joint>
        <joint name="y" type="fixed"><parent link="b"/><child link="c"/></joint>"#;
    let mimic = joint(&format!(r#"{LIMIT}<mimic joint="k"/>"#));
    let cases: Vec<(String, &str)> = vec![
        (joint(&format!(r#"<origin xyz="0 nan 0"/>{LIMIT}"#)), "joint 'j': origin xyz [0, NaN, 0]"),
        (joint(&format!(r#"<origin rpy="0 inf 0"/>{LIMIT}"#)), "joint 'j': origin"),
        (joint(&format!(r#"<origin xyz="1e9 0 0"/>{LIMIT}"#)), "farther than 1000 m"),
        (joint(&LIMIT.replace("-1", "2")), "joint 'j': limit lower 2 is above upper 1"),
        (joint(&LIMIT.replace("\"-1\"", "\"nan\"")), "joint 'j': limit lower NaN"),
        (joint(""), "joint 'j', line 1: has no <limit>"),
        (joint(&format!(r#"{LIMIT}<axis xyz="0 0 0"/>"#)), "joint 'j': axis [0.0, 0.0, 0.0] has no direction"),
        (joint(LIMIT).replace("revolute", "floating"), "joint 'j': type Floating is not supported"),
        (joint(LIMIT).replace(r#"parent link="a""#, r#"parent link="z""#), "joint 'j': parent link 'z' does not exist; links: a, b"),
        (joint(LIMIT).replace(r#"child link="b""#, r#"child link="z""#), "child link 'z' does not exist"),
        (TWO_LINKS.to_string(), "2 links have no parent joint: a, b"),
        (TWO_LINKS.replace("\"b\"", "\"a\""), "two links are called 'a'"),
        (format!("{}{}", joint(LIMIT), joint(LIMIT).replace(TWO_LINKS, "")), "two joints are called 'j'"),
        (cycle.to_string(), "circle: a, b"),
        (loop_of_all, "circle"),
        (two_parents.to_string(), "link 'c' has two parents, by joints 'x' and 'y'"),
        (mimic, "joint 'j' mimics 'k'"),
        (String::new(), "has no links"),
        (r#"<link name="a"><inertial><mass value="-1"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link>"#.into(), "mass -1 is negative"),
        (r#"<link name="a"><collision><geometry><sphere radius="0"/></geometry></collision></link>"#.into(), "link 'a': collision: geometry sizes [0.0] must be positive"),
        (r#"<link name="a"><visual><geometry><box size="1 nan 1"/></geometry></visual></link>"#.into(), "link 'a': visual: geometry sizes"),
    ];
    for (body, expected) in cases {
        let error = package.error(&body);
        assert!(error.contains(expected) && error.contains("tiny.urdf"), "{error}\nexpected {expected}");
    }
}

#[test]
fn cut_off_missing_and_xacro_files_are_told_apart() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    let fetch = std::fs::read_to_string(super::folder().join("fetch.urdf")).unwrap();
    for share in [0, 1, 5, 20, 50, 80, 99] {
        let cut = write("cut.urdf", &fetch[..fetch.len() * share / 100]);
        let error = RobotModel::load(&cut, &[]).unwrap_err().to_string();
        let wanted = ["is empty", "no whole XML", "it was cut off"][if share < 2 { share } else { 2 }];
        assert!(error.contains("cut.urdf") && error.contains(wanted), "{error}");
    }
    let error = |path: &Path| RobotModel::load(path, &[]).unwrap_err().to_string();
    assert!(error(&folder.path().join("none.urdf")).contains("none.urdf"));
    assert!(error(folder.path()).contains("give a file"));
    assert!(error(&write("a.urdf.xacro", "<robot/>")).contains("expand it first"));
    assert!(error(&write("a.urdf", "<robot><xacro:include/></robot>")).contains("expand it first"));
    assert!(error(&write("b.urdf", "not xml")).contains("no whole XML"));
    let binary = folder.path().join("c.urdf");
    std::fs::write(&binary, [0xffu8, 0xfe, 0x00, 0x80]).unwrap();
    assert!(error(&binary).contains("c.urdf"));
}

#[test]
fn mimic_joints_follow_and_capsules_are_three_pieces() {
    let package = Package::new();
    let body = r#"<link name="a"><collision><geometry><capsule radius="0.1" length="0.4"/></geometry></collision>
          <visual><geometry><capsule radius="0.1" length="0.4"/></geometry></visual></link>
        <link name="b"/><link name="c"/>
        <joint name="second" type="prismatic"><parent link="a"/><child link="c"/><axis xyz="0 0 1"/>
          <limit lower="0" upper="1" velocity="1" effort="1"/><mimic joint="first" multiplier="-2" offset="0.5"/></joint>
        <joint name="first" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
          <limit lower="0" upper="1" velocity="1" effort="1"/></joint>"#;
    let robot = package.load(body).unwrap();
    assert_eq!(robot.joints().len(), 1);
    assert_eq!(robot.joints()[0].kind, JointKind::Prismatic);
    assert_eq!(robot.links()[0].collisions.len(), 3);
    let c = robot.link_index("c").unwrap();
    assert!((robot.fk_link(&[0.2], c).translation.z - 0.1).abs() < 1e-12);
    assert!((robot.jacobian(&[0.2], c, &[0])[(2, 0)] + 2.0).abs() < 1e-12);
    let error = robot.link_index("d").unwrap_err().to_string();
    assert!(error.contains("no link 'd'; links: a, c, b"), "{error}");
}

#[test]
fn adjacent_pairs_see_through_fixed_joints() {
    let package = Package::new();
    let fixed = |name: &str, parent: &str, child: &str| {
        format!(
            r#"<joint name="{name}" type="fixed"><parent link="{parent}"/><child link="{child}"/></joint>"#
        )
    };
    let turning = |name: &str, parent: &str, child: &str| {
        fixed(name, parent, child)
            .replace("fixed", "revolute")
            .replace("</joint>", &format!("{LIMIT}</joint>"))
    };
    // a ~ b -turn- c ~ d -turn- e
    let body: String = ["a", "b", "c", "d", "e"].map(|name| format!(r#"<link name="{name}"/>"#)).concat()
        + &fixed("ab", "a", "b")
        + &turning("bc", "b", "c")
        + &fixed("cd", "c", "d")
        + &turning("de", "d", "e");
    let robot = package.load(&body).unwrap();
    let expected = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3), (2, 4), (3, 4)];
    assert_eq!(robot.adjacent_pairs(), expected);
}

#[test]
fn habits_of_the_makers_urdf_are_understood() {
    // A dummy root with an <origin>, nameless materials, an axis on a fixed joint, no bounds on continuous joints.
    let body = r#"
      <joint name="dummy_joint" type="fixed"><origin rpy="0 0 0" xyz="0 0 0"/>
        <parent link="dummy_link"/><child link="base_link"/><axis xyz="0 1 0"/></joint>
      <link name="dummy_link"><origin rpy="0 0 0" xyz="0 0 0"/></link>
      <link name="base_link"><visual><origin rpy="0 0 0" xyz="0 0 0"/>
        <geometry><mesh filename="package://tiny_description/meshes/binary.STL"/></geometry>
        <material name=""><color rgba="0.356 0.361 0.376 1"/></material></visual></link>
      <link name="wheel"><visual><geometry><sphere radius="0.1"/></geometry>
        <material name=""><color rgba="0.086 0.506 0.767 1"/></material></visual></link>
      <joint name="wheel_joint" type="continuous"><origin rpy="-6.123E-17 0 0" xyz="0.0012914 -0.18738 0.055325"/>
        <parent link="base_link"/><child link="wheel"/><axis xyz="0 1 0"/>
      <limit effort="8.85" velocity="17.4"/></joint>"#;
    let robot = Package::new().load(body).unwrap();
    assert_eq!(robot.links()[0].name, "dummy_link");
    let color = |link: usize| robot.links()[link].visuals[0].visual.material.base_color;
    assert_eq!((color(1), color(2)), ([0.356, 0.361, 0.376], [0.086, 0.506, 0.767]));
    let limits = robot.joints()[0].limits;
    assert_eq!((limits.lower, limits.upper), (f64::NEG_INFINITY, f64::INFINITY));
    assert_eq!((limits.velocity, limits.effort), (17.4, 8.85));
}
