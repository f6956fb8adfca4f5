//! Speed of the physics world: one second with the Fetch at rest or moving and six objects on the table.
//!
//! `cargo bench -p grip-physics`; real time is 1 s.
#![expect(clippy::unwrap_used, reason = "a bench")]

use std::path::Path;
use std::sync::Arc;

use grip_physics::{Accept, PhysicsSettings, STEP_HZ, World, drop_objects};
use grip_sim::condition::Placement;
use grip_sim::objects::{ObjectLibrary, ObjectSet};
use grip_sim::robot::{RobotConfig, RobotModel};
use grip_sim::scene::Scene;

fn main() {
    divan::main();
}

fn world() -> (World, RobotConfig) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let scene = Scene::load(&root.join("scenes/grocery.toml")).unwrap();
    let robot = RobotModel::load(&root.join("robots/fetch/fetch.urdf"), &[]).unwrap();
    let (robot, config) = RobotConfig::load(&root.join("robots/fetch/fetch.toml"), robot).unwrap();
    let robot = Arc::new(robot);
    let library = ObjectLibrary::open(&root.join("scenes/objects.toml"), ObjectSet::BuiltIn).unwrap();
    let mut names = scene.objects.names.clone();
    names.push("007_tuna_fish_can".into());
    let models: Vec<_> = names.iter().map(|n| library.load(n).unwrap()).collect();
    let q = config.configuration(&robot, &scene.robot.start_pose).unwrap();
    let settings = PhysicsSettings::default();
    let fresh = || World::new(&scene, robot.clone(), &config, q.clone(), &settings);
    let (world, _) =
        drop_objects(&scene, &models, Placement::Spread, &settings.placement, 1, Accept::ALL, fresh).unwrap();
    (world, config)
}

/// Objects asleep, robot at rest.
#[divan::bench(sample_count = 10)]
fn second_at_rest(bencher: divan::Bencher<'_, '_>) {
    bencher.with_inputs(|| world().0).bench_local_values(|mut world| {
        let (target, grip) = world.hold();
        for _ in 0..STEP_HZ {
            world.step(&target, grip);
        }
        world
    });
}

/// The arm swings.
#[divan::bench(sample_count = 10)]
fn second_moving(bencher: divan::Bencher<'_, '_>) {
    bencher.with_inputs(world).bench_local_values(|(mut world, config)| {
        let (mut target, grip) = world.hold();
        for step in 0..STEP_HZ {
            let swing = 0.3 / f64::from(STEP_HZ) * if step < STEP_HZ / 2 { 1.0 } else { -1.0 };
            target[config.arm[6]] += swing;
            target[config.arm[4]] += swing;
            world.step(&target, grip);
        }
        world
    });
}

/// Objects still falling and settling: the dearest second of a trial.
#[divan::bench(sample_count = 10)]
fn layout_from_seed(bencher: divan::Bencher<'_, '_>) {
    bencher.bench_local(world);
}
