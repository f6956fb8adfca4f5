//! `grip grasps`: the grasps of objects by the robot's gripper, as files.

use std::sync::Arc;
use std::time::Instant;

use anyhow::{Context, Result};
use grip_manip::Planner;
use grip_manip::grasp::GraspSet;
use grip_sim::bop::write_atomic;
use grip_sim::render::{self, RendererChoice};

use super::Done;
use super::output;
use crate::cli::GraspsArgs;
use crate::pictures;
use crate::run_dir::RunDir;
use crate::setup;

/// Finds the grasps, saves a file an object where `--out` says and a picture where `--preview` does, prints how many there are.
pub fn run(args: &GraspsArgs) -> Result<Done> {
    let folder = args.out.as_deref().map(RunDir::begin).transpose()?;
    let library = setup::library(args.ycb.clone(), &args.tables.tables)?;
    let names: Vec<String> = match args.objects.as_slice() {
        [] => library.names().map(str::to_string).collect(),
        given => given.to_vec(),
    };
    let (urdf, robot, config) = args.robot.load()?;
    let name = robot.name().to_string();
    let settings = args.settings.load()?.for_robot(&config);
    let gripper = config.gripper.clone();
    let planner = Planner::new(Arc::new(robot), Arc::new(config), settings.planner);
    let mut renderer = args.preview.as_ref().map(|_| render::open(RendererChoice::Auto)).transpose()?;
    let mut drawn = Vec::new();
    let (mut sets, mut models) = (Vec::new(), Vec::new());
    let mut rows = Vec::new();
    for object in &names {
        let model = library.load(object)?;
        let clock = Instant::now();
        let grasps = planner.grasps(&model);
        let seconds = clock.elapsed().as_secs_f64();
        let widths = grasps.candidates.iter().map(|g| 1e3 * g.width);
        let (narrow, wide) = widths.fold((f64::INFINITY, 0.0_f64), |(a, b), w| (a.min(w), b.max(w)));
        let range = if grasps.candidates.is_empty() {
            "no grasp: too wide or too thin for the gripper".to_string()
        } else {
            format!("{narrow:.0} to {wide:.0}")
        };
        rows.push([object.clone(), grasps.candidates.len().to_string(), range, format!("{seconds:.2}")]);
        let set = GraspSet::new(&model, &library.label([&model]), &name, &grasps.candidates);
        if let Some(renderer) = &mut renderer {
            drawn.push(pictures::grasps(&model, &gripper, &grasps.candidates, renderer.as_mut())?);
        }
        models.push(model);
        if let Some(folder) = &folder {
            folder.write(&GraspSet::file_name(object), serde_json::to_string_pretty(&set)?)?;
        }
        sets.push(set);
    }
    if let Some(folder) = folder {
        let folder = folder.finish().context("--out")?;
        output::message(format_args!("grasps: {}", folder.display()));
    }
    if let Some(path) = &args.preview {
        write_atomic(path, &pictures::rgb_png(&pictures::sheet(&drawn, 1))?).context("--preview")?;
        output::message(format_args!("preview: {}", path.display()));
    }
    if args.json {
        output::data(format_args!("{}", serde_json::to_string_pretty(&sets)?))?;
        return Ok(Done::Fully);
    }
    let table = output::table(["object", "grasps", "width mm", "seconds"], &[1, 3], rows);
    output::data(format_args!("{table}"))?;
    output::data(format_args!(
        "\nrobot: {name} ({}), object set: {}",
        urdf.display(),
        library.label(&models)
    ))?;
    Ok(Done::Fully)
}
