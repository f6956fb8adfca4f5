//! `grip render`: what the head camera sees, as files.

use anyhow::Result;
use grip_sim::render;
use schemars::JsonSchema;
use serde::Serialize;

use super::Done;
use super::output;
use crate::cli::RenderArgs;
use crate::pictures;
use crate::run_dir::RunDir;
use crate::setup::{GROCERY, Setup};

/// Version of camera.json.
pub const SCHEMA: &str = "grip.camera/1";

/// camera.json: all that is needed to use the pictures.
#[derive(Serialize, JsonSchema)]
pub struct CameraFile<'a> {
    schema: &'static str,
    scene: &'a str,
    condition: &'a str,
    seed: u64,
    renderer: &'a str,
    object_set: String,
    intrinsics: grip_sim::camera::Intrinsics,
    /// depth.png times this gives metres.
    depth_scale_m: f64,
    depth_noise: &'a str,
    world_from_camera: grip_sim::pose::Pose<grip_sim::pose::World, grip_sim::pose::Camera>,
    labels: Vec<Label<'a>>,
}

/// What a number in labels.png means, and where that object is.
#[derive(Serialize, JsonSchema)]
struct Label<'a> {
    label: u16,
    name: &'a str,
    world_from_object: Option<grip_sim::pose::Pose<grip_sim::pose::World, grip_sim::pose::Object>>,
}

/// Draws a scene and writes the pictures.
pub fn run(args: &RenderArgs) -> Result<Done> {
    let run = RunDir::begin(&args.out)?;
    let setup = Setup::load(&args.scene.options(GROCERY, &args.condition)?)?;
    let mut renderer = render::open(args.scene.renderer.into())?;
    let (world, _) = setup.drop_objects()?;
    let (frame, rendering) = setup.capture(&world, renderer.as_mut(), 0)?;

    let mut labels: Vec<Label<'_>> = (0..world.object_count())
        .map(|i| Label {
            label: i as u16 + 1,
            name: &world.object(i).info.name,
            world_from_object: Some(world.truth(i)),
        })
        .collect();
    labels.push(Label { label: grip_physics::ROBOT_LABEL, name: "robot", world_from_object: None });
    let camera = CameraFile {
        schema: SCHEMA,
        scene: &setup.cell.scene.name,
        condition: &setup.condition.name,
        seed: setup.seed,
        renderer: renderer.name(),
        object_set: setup.object_set(),
        intrinsics: frame.intrinsics,
        depth_scale_m: 0.001,
        depth_noise: &setup.cell.scene.camera.depth_noise,
        // Beside the true poses of the objects.
        world_from_camera: setup.true_camera(&world),
        labels,
    };
    run.write("rgb.png", pictures::rgb_png(&frame.rgb)?)?;
    run.write("depth.png", pictures::depth_png_mm(&frame.depth)?)?;
    run.write("depth_color.png", pictures::rgb_png(&pictures::depth_picture(&frame.depth))?)?;
    run.write("labels.png", pictures::labels_png(&rendering.labels)?)?;
    run.write("camera.json", serde_json::to_string_pretty(&camera)?)?;
    let folder = run.finish()?;
    output::message(format_args!("wrote {} with the {} renderer", folder.display(), renderer.name()));
    Ok(Done::Fully)
}
