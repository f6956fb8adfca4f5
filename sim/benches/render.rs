//! Speed of the renderers on a table with six objects at 640x480: geometry and colour, by condition.
//!
//! `cargo bench -p grip-sim --bench render`
#![expect(clippy::unwrap_used, clippy::print_stderr, reason = "a bench")]

use std::path::Path;

use grip_sim::camera::Intrinsics;
use grip_sim::condition::ConditionSpec;
use grip_sim::objects::{ObjectLibrary, ObjectSet};
use grip_sim::pose::{Camera, Pose, World};
use grip_sim::render::{Instance, RenderScene, RendererChoice, furniture, open};
use grip_sim::scene::{Scene, Surroundings};
use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

fn main() {
    divan::main();
}

fn root() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn scene() -> RenderScene {
    let scene = Scene::load(&root().join("scenes/grocery.toml")).unwrap();
    let library = ObjectLibrary::open(&root().join("scenes/objects.toml"), ObjectSet::BuiltIn).unwrap();
    let mut instances: Vec<Instance> = furniture(&scene.fixtures(), Surroundings::Laboratory, 1)
        .drawn
        .into_iter()
        .map(|(pose, visual)| Instance { visual, pose, label: 0 })
        .collect();
    let names = [
        "003_cracker_box",
        "005_tomato_soup_can",
        "006_mustard_bottle",
        "011_banana",
        "024_bowl",
        "035_power_drill",
    ];
    for (i, name) in names.iter().enumerate() {
        let model = library.load(name).unwrap();
        let at = [0.5 + 0.12 * (i % 3) as f64, -0.1 + 0.2 * (i / 3) as f64, scene.table.height - model.min.z];
        instances.push(Instance {
            visual: model.visual.clone(),
            pose: Isometry3::from_parts(
                Translation3::new(at[0], at[1], at[2]),
                UnitQuaternion::from_euler_angles(0.0, 0.0, i as f64),
            ),
            label: i as u16 + 1,
        });
    }
    RenderScene { instances, bounce: None }
}

fn camera() -> Pose<World, Camera> {
    let (eye, target) = (Vector3::new(0.10, 0.0, 1.25), Vector3::new(0.60, 0.0, 0.65));
    let z = (target - eye).normalize();
    let x = z.cross(&Vector3::z()).normalize();
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, z.cross(&x), z]));
    Pose::new(Isometry3::from_parts(Translation3::from(eye), UnitQuaternion::from_rotation_matrix(&rotation)))
}

fn frame(bencher: divan::Bencher<'_, '_>, choice: RendererChoice, condition: &str) {
    let condition = ConditionSpec::load_named(&root().join("scenes/conditions"), condition)
        .unwrap()
        .draw(&mut grip_sim::rng::stream(1, "condition"));
    let mut renderer = match open(choice) {
        Ok(renderer) => renderer,
        Err(error) => return eprintln!("{error}"),
    };
    let (scene, camera) = (scene(), camera());
    bencher
        .bench_local(|| renderer.render(&scene, &condition.lighting, &Intrinsics::FETCH, &camera).unwrap());
}

#[divan::bench(args = ["base", "dark", "light-left"], sample_count = 20)]
fn wgpu(bencher: divan::Bencher<'_, '_>, condition: &str) {
    frame(bencher, RendererChoice::Wgpu, condition);
}

#[divan::bench(args = ["base", "dark", "light-left"], sample_count = 5)]
fn cpu(bencher: divan::Bencher<'_, '_>, condition: &str) {
    frame(bencher, RendererChoice::Cpu, condition);
}
