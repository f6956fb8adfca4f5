//! One scene of a data set: layouts by physics, frames by renderer and sensors, files.

use std::cell::RefCell;
use std::collections::HashMap;
use std::ops::RangeInclusive;
use std::path::Path;
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::Result;
use grip_physics::{Accept, LaidOut, Placed, ROBOT_LABEL, World, drop_objects};
use grip_sim::bop::{FrameFiles, GtInfo, ObjectInFrame, SceneWriter, gt_info};
use grip_sim::camera::Intrinsics;
use grip_sim::condition::Condition;
use grip_sim::images::{DepthImage, Image, LabelImage};
use grip_sim::objects::ObjectModel;
use grip_sim::pose::{Camera, Object, Pose, World as WorldFrame};
use grip_sim::render::{self, Bounce, RenderScene, Renderer, Rendering, Silhouette};
use grip_sim::rng;
use grip_sim::scene::Scene;
use grip_sim::sensor;
use grip_sim::sensor::lens::Lens;
use grip_sim::sensor::shine::dazzle;
use grip_sim::sensor::variation::CameraVariation;
use nalgebra::Point3;
use rand::RngExt;
use schemars::JsonSchema;
use serde::Serialize;

use super::plan::{CameraPlace, DEPTH_SCALE_MM, Plan, Profile, View};
use crate::progress::Progress;
use crate::setup::Setup;

/// Least share of an object's silhouette that must be seen, and that must lie inside the picture.
const LEAST_VISIBLE: f64 = 0.1;
const LEAST_INSIDE: f64 = 0.6;
/// Least share of what is seen of an object that must be as far away as depth cameras need it, metres: nobody sets up a
/// scene that the camera cannot read. (The Carmine reads from 0.35 m on.)
const LEAST_READ: f64 = 0.6;
const NEAREST_M: f32 = 0.36;

/// Among the objects of a hard scene there are so many that are in no table.
const UNKNOWN: RangeInclusive<usize> = 1..=4;

/// Where the time of a scene went.
#[derive(Debug, Default, Clone, Copy)]
pub struct Timings {
    /// Laying objects out.
    pub physics: Duration,
    /// Drawing.
    pub render: Duration,
    /// Noise, exposure and distortion.
    pub sensor: Duration,
    /// Masks of objects.
    pub masks: Duration,
    /// Encoding and writing files.
    pub write: Duration,
}

impl Timings {
    /// Sums up.
    pub fn add(&mut self, other: &Self) {
        self.physics += other.physics;
        self.render += other.render;
        self.sensor += other.sensor;
        self.masks += other.masks;
        self.write += other.write;
    }
}

/// What making a scene took.
#[derive(Debug)]
pub struct Done {
    /// Layouts thrown away.
    pub rejected: usize,
    pub timings: Timings,
}

/// Version of scene_info.json.
pub const SCENE_SCHEMA: &str = "grip.dataset-scene/1";

/// `scene_info.json`: what the pictures cannot tell.
#[derive(Debug, Serialize, JsonSchema)]
pub struct SceneFile<'a> {
    schema: &'static str,
    seed: u64,
    objects: Vec<&'a str>,
    frames: Vec<FrameInfo<'a>>,
    /// Layouts thrown away, with the reason.
    rejected: Vec<String>,
}

#[derive(Debug, Serialize, JsonSchema)]
struct FrameInfo<'a> {
    im_id: u32,
    name: String,
    condition: &'a Condition,
}

/// Objects at rest, as the cameras see them.
struct Layout {
    scene: RenderScene,
    /// Of each camera.
    seen: Vec<Seen>,
}

/// Objects at rest, as a camera sees them.
struct Seen {
    world_from_camera: Pose<WorldFrame, Camera>,
    /// In the order of the scene's objects.
    camera_from_object: Vec<Pose<Camera, Object>>,
    outlines: Vec<Rc<Silhouette>>,
}

/// Draws of objects for a scene before it is given up.
const DRAWS: u32 = 20;

/// Makes scene `number` in `split`. Objects that cannot all be laid out in view, such as seven large ones, are drawn anew.
pub fn make(
    setup: &Setup,
    plan: &Plan,
    split: &Path,
    number: u32,
    renderer: &mut dyn Renderer,
    progress: &dyn Progress,
) -> Result<Done> {
    let mut refused = Vec::new();
    let mut draw = 0;
    let mut done = loop {
        let seed: u64 = rng::stream(plan.seed, &format!("scene/{number}/{draw}")).random();
        match attempt(setup, plan, split, number, seed, &refused, renderer) {
            Err(error)
                if draw + 1 < DRAWS
                    && matches!(
                        error.downcast_ref(),
                        Some(grip_physics::Error::World(_) | grip_physics::Error::NoLayout(_))
                    ) =>
            {
                refused.push(format!("draw {draw}: {error:#}"));
                draw += 1;
            }
            other => break other?,
        }
    };
    done.rejected += refused.len();
    progress.advance(plan.views.len() as u64);
    Ok(done)
}

/// Makes scene `number` from `seed`; `refused` are the draws before it.
fn attempt(
    setup: &Setup,
    plan: &Plan,
    split: &Path,
    number: u32,
    seed: u64,
    refused: &[String],
    renderer: &mut dyn Renderer,
) -> Result<Done> {
    let drawn = plan.scene.objects.draw(seed);
    let mut models: Vec<Arc<ObjectModel>> = drawn.iter().map(|&i| setup.models[i].clone()).collect();
    // Large ones come first, so that heaps do not bury small ones.
    models.sort_by(|a, b| b.diameter.total_cmp(&a.diameter));
    let mut scene = plan.scene.clone();
    scene.objects.names = models.iter().map(|model| model.info.name.clone()).collect();
    scene.objects.count = None;
    let targets = models.len();
    if plan.profile == Profile::Hard {
        let mut random = rng::stream(seed, "unknown");
        let count = random.random_range(UNKNOWN);
        models.extend((1..=count).map(|i| Arc::new(render::unknown_object(i, &mut random))));
    }
    let furniture = render::furniture(&scene.fixtures(), scene.surroundings, seed);
    let bounce = Bounce::of(&scene.table, furniture.table_albedo);
    let show = |world: &World| {
        let mut shown = world.render_scene(&furniture.drawn);
        shown.bounce = Some(bounce);
        if plan.camera == CameraPlace::Sphere {
            // From anywhere but its own head, the robot would stand in the picture.
            shown.instances.retain(|instance| instance.label != ROBOT_LABEL);
        }
        shown
    };

    // Of several instances of an object there is one category.
    let objects = setup.models.iter().map(|model| (model.info.bop_id, model.info.name.as_str()));
    let writer = SceneWriter::begin(split, number)?.with_coco(&plan.scene.name, objects);
    let conditions: Vec<Condition> = plan
        .views
        .iter()
        .map(|view| view.condition.draw(&mut rng::stream(seed, &format!("condition/{}", view.of))))
        .collect();
    let mut making = Making {
        setup,
        plan,
        scene: &scene,
        models: &models,
        targets,
        seed,
        show: &show,
        rejected: Vec::new(),
        timings: Timings::default(),
    };
    let mut shared: Option<Layout> = None;
    // Of the last frame that has one of its own, with its name: other cameras see the same.
    let mut own: Option<(&str, Layout)> = None;
    for (im_id, (view, condition)) in (0..).zip(plan.views.iter().zip(&conditions)) {
        let layout = if plan.shares_layout(view) {
            match &mut shared {
                Some(layout) => layout,
                none => none.insert(making.layout(view, condition)?),
            }
        } else {
            match own.take().filter(|(of, _)| *of == view.of) {
                Some(same) => &mut own.insert(same).1,
                None => &mut own.insert((&view.of, making.layout(view, condition)?)).1,
            }
        };
        making.frame(&writer, im_id, view, condition, layout, renderer)?;
    }

    let Making { rejected, mut timings, .. } = making;
    let began = Instant::now();
    let info = SceneFile {
        schema: SCENE_SCHEMA,
        seed,
        objects: models[..targets].iter().map(|model| model.info.name.as_str()).collect(),
        frames: (0..)
            .zip(plan.views.iter().zip(&conditions))
            .map(|(im_id, (view, condition))| FrameInfo {
                im_id,
                name: format!("exp{number:03}_{}", view.name),
                condition,
            })
            .collect(),
        rejected: refused.iter().cloned().chain(rejected).collect(),
    };
    writer.add_file("scene_info.json", (serde_json::to_string_pretty(&info)? + "\n").as_bytes())?;
    writer.finish()?;
    timings.write += began.elapsed();
    Ok(Done { rejected: info.rejected.len(), timings })
}

/// What all frames of a scene have in common.
struct Making<'a> {
    setup: &'a Setup,
    plan: &'a Plan,
    scene: &'a Scene,
    /// The objects, then what is unknown among them.
    models: &'a [Arc<ObjectModel>],
    /// How many objects.
    targets: usize,
    seed: u64,
    /// All that is to be seen of a world.
    show: &'a dyn Fn(&World) -> RenderScene,
    /// Layouts thrown away, with the reason.
    rejected: Vec<String>,
    timings: Timings,
}

impl Making<'_> {
    /// Objects put down as `view` wants it, all of them in the picture and to be seen.
    fn layout(&mut self, view: &View, condition: &Condition) -> Result<Layout> {
        let Self { setup, scene, models, .. } = *self;
        let name = if self.plan.shares_layout(view) { "shared" } else { view.of.as_str() };
        let began = Instant::now();
        let seed: u64 = rng::stream(self.seed, &format!("layout/{name}")).random();
        let cameras = match self.plan.camera {
            CameraPlace::Head | CameraPlace::All => self.plan.poses.clone(),
            CameraPlace::Sphere => {
                let [x, y] = scene.objects.center;
                let center = Point3::new(x, y, scene.table.height + 0.03);
                vec![scene.camera.sphere.draw(&center, &mut rng::stream(seed, "camera"))]
            }
        };
        let pinhole = self.plan.pinhole();
        let outlines_by = |camera: &Pose<WorldFrame, Camera>, placed: &[Placed]| {
            let camera_from_world = camera.inverse();
            outlines(placed, pinhole, |(model, pose)| {
                render::silhouette(&model.visual.mesh, &(camera_from_world * *pose), pinhole).map(Rc::new)
            })
        };
        // Every camera must see all of them.
        let glances: Vec<Glance> =
            cameras.iter().map(|camera| Glance::new(camera.inverse(), pinhole)).collect();
        let accept = Accept {
            glance: &|placed| glances.iter().try_for_each(|glance| glance.accepts(placed)),
            look: &|placed| cameras.iter().try_for_each(|camera| outlines_by(camera, placed).map(|_| ())),
        };
        let physics = &setup.settings.physics;
        let cell = &setup.cell;
        let fresh = || {
            World::new(scene, cell.robot.clone(), &cell.config, cell.start.clone(), physics)
                .map(World::for_layout)
        };
        let placement = condition.placement;
        let dropped = drop_objects(scene, models, placement, &physics.placement, seed, accept, fresh);
        self.timings.physics += began.elapsed();
        let (world, dropped) = dropped?;
        self.rejected.extend(dropped.rejected.into_iter().map(|reason| format!("{name}: {reason}")));
        let seen = |world_from_camera: &Pose<WorldFrame, Camera>| -> Result<Seen> {
            let mut outlines = outlines_by(world_from_camera, &world.placed()).map_err(anyhow::Error::msg)?;
            outlines.truncate(self.targets);
            if let Some(lens) = &self.plan.lens {
                outlines = outlines
                    .iter()
                    .map(|outline| distorted(lens, outline).map(Rc::new))
                    .collect::<Result<_>>()?;
            }
            let camera_from_world = world_from_camera.inverse();
            let camera_from_object = (0..self.targets).map(|i| camera_from_world * world.truth(i)).collect();
            Ok(Seen { world_from_camera: *world_from_camera, camera_from_object, outlines })
        };
        let seen = cameras.iter().map(seen).collect::<Result<_>>()?;
        Ok(Layout { scene: (self.show)(&world), seen })
    }

    fn draw(
        &mut self,
        layout: &Layout,
        seen: &Seen,
        condition: &Condition,
        renderer: &mut dyn Renderer,
    ) -> Result<Rendering> {
        let began = Instant::now();
        let mut rendering = renderer.render(
            &layout.scene,
            &condition.lighting,
            self.plan.pinhole(),
            &seen.world_from_camera,
        )?;
        if let Some(lens) = &self.plan.lens {
            rendering = lens.rendering(&rendering)?;
        }
        self.timings.render += began.elapsed();
        Ok(rendering)
    }

    /// Draws, exposes and writes one frame.
    fn frame(
        &mut self,
        writer: &SceneWriter,
        im_id: u32,
        view: &View,
        condition: &Condition,
        layout: &Layout,
        renderer: &mut dyn Renderer,
    ) -> Result<()> {
        let seen = &layout.seen[view.camera(self.scene)];
        let rendering = self.draw(layout, seen, condition, renderer)?;
        let began = Instant::now();
        let Plan { intrinsics, mut sensors, .. } = *self.plan;
        let mut camera_random = rng::stream(self.seed, &format!("camera/{}", view.name));
        let camera = (self.plan.profile == Profile::Hard).then(|| CameraVariation::drawn(&mut camera_random));
        if let Some(camera) = &camera
            && self.plan.any_depth_camera
        {
            sensors.depth = camera.depth_noise;
        }
        let mut random = rng::stream(self.seed, &format!("sensor/{}", view.name));
        let pose = &seen.world_from_camera;
        let mut frame = sensor::sense(&rendering, condition, &intrinsics, pose, &sensors, &mut random);
        if let Some(camera) = &camera {
            frame = camera.applied(&frame, &mut camera_random)?;
        }
        if self.plan.shiny > 0.0 {
            let mut random = rng::stream(self.seed, &format!("shine/{}", view.name));
            let objects = self.models.len() as u16;
            dazzle(&mut frame.depth, &rendering.labels, objects, self.plan.shiny, &mut random);
        }
        self.timings.sensor += began.elapsed();

        let began = Instant::now();
        let masks: Vec<Masks> = (1..)
            .zip(&seen.outlines)
            .map(|(label, outline)| Masks::new(label, outline, &rendering.labels, &frame.depth))
            .collect::<Result<_>>()?;
        let objects: Vec<ObjectInFrame<'_>> = self
            .models
            .iter()
            .zip(&seen.camera_from_object)
            .zip(&masks)
            .map(|((model, pose), masks)| ObjectInFrame {
                obj_id: model.info.bop_id,
                camera_from_object: *pose,
                mask: &masks.whole,
                mask_visib: &masks.visible,
                info: masks.info,
            })
            .collect();
        self.timings.masks += began.elapsed();
        let began = Instant::now();
        writer.add_frame(&FrameFiles {
            im_id,
            rgb: &frame.rgb,
            depth: &frame.depth,
            depth_scale_mm: DEPTH_SCALE_MM,
            intrinsics,
            world_from_camera: Some(seen.world_from_camera),
            objects: &objects,
        })?;
        self.timings.write += began.elapsed();
        Ok(())
    }
}

/// Looks at small pictures of simple meshes, which refuses most of the layouts that a closer look would refuse.
struct Glance {
    camera_from_world: Pose<Camera, WorldFrame>,
    pinhole: Intrinsics,
    /// Outlines of the objects where they last were: in a growing heap most of them have not moved since.
    known: RefCell<HashMap<*const ObjectModel, Outline>>,
}

/// Where an object was, and what was seen of it.
type Outline = (Pose<WorldFrame, Object>, Option<Rc<Silhouette>>);

impl Glance {
    /// How many times smaller than the real picture.
    const TIMES: usize = 4;
    fn new(camera_from_world: Pose<Camera, WorldFrame>, pinhole: &Intrinsics) -> Self {
        Self { camera_from_world, pinhole: pinhole.shrunk(Self::TIMES), known: RefCell::default() }
    }

    fn accepts(&self, placed: &[Placed]) -> LaidOut {
        let mut known = self.known.borrow_mut();
        let outline = |(model, pose): &Placed| match known.get(&Arc::as_ptr(model)) {
            Some((before, outline)) if before == pose => outline.clone(),
            _ => {
                let camera_from_object = self.camera_from_world * *pose;
                let outline =
                    render::silhouette(model.rough(), &camera_from_object, &self.pinhole).map(Rc::new);
                known.insert(Arc::as_ptr(model), (*pose, outline.clone()));
                outline
            }
        };
        outlines(placed, &self.pinhole, outline).map(|_| ())
    }
}

/// The outline of each object as `outline` draws it, or the first one that is not well in the picture, or hidden by the
/// others.
fn outlines(
    placed: &[Placed],
    pinhole: &Intrinsics,
    mut outline: impl FnMut(&Placed) -> Option<Rc<Silhouette>>,
) -> std::result::Result<Vec<Rc<Silhouette>>, String> {
    let mut outlines = Vec::new();
    let mut front = Image::filled(pinhole.width, pinhole.height, (0.0, usize::MAX));
    for (i, object) in placed.iter().enumerate() {
        let name = &object.0.info.name;
        let outline = outline(object).ok_or_else(|| format!("{name} is out of the picture"))?;
        let inside = share_inside(&outline, pinhole);
        if inside < LEAST_INSIDE {
            return Err(format!("only {:.0} % of {name} are in the picture", 100.0 * inside));
        }
        for ([x, y], [u, v]) in pixels_inside(&outline, pinhole.width, pinhole.height) {
            let (inverse, nearest) = front.at_mut(u, v);
            let here = *outline.inverse_depth.at(x, y);
            if here > *inverse {
                (*inverse, *nearest) = (here, i);
            }
        }
        outlines.push(outline);
    }
    // Pixels that are seen of each object, and those of them that are far enough away.
    let mut counts = vec![(0_usize, 0_usize); outlines.len()];
    for (inverse, nearest) in front.data() {
        if let Some((seen, read)) = counts.get_mut(*nearest) {
            *seen += 1;
            *read += usize::from(inverse * NEAREST_M < 1.0);
        }
    }
    for ((outline, (seen, read)), (model, _)) in outlines.iter().zip(counts).zip(placed) {
        let name = &model.info.name;
        let all = outline.mask.data().iter().filter(|&&covered| covered).count();
        if (seen as f64) < LEAST_VISIBLE * all as f64 {
            return Err(format!("only {seen} of {all} pixels of {name} are seen"));
        }
        if (read as f64) < LEAST_READ * seen as f64 {
            return Err(format!("{name} is too near for a depth camera"));
        }
    }
    Ok(outlines)
}

/// The masks of one object in one frame.
struct Masks {
    /// Within the image.
    whole: Image<bool>,
    visible: Image<bool>,
    info: GtInfo,
}

impl Masks {
    fn new(label: u16, outline: &Silhouette, labels: &LabelImage, depth: &DepthImage) -> Result<Self> {
        let (width, height) = (labels.width(), labels.height());
        let mut visible = Image::filled(width, height, false);
        let mut whole = visible.clone();
        let mut canvas = outline.mask.clone();
        for ([x, y], [u, v]) in pixels_inside(outline, width, height) {
            let seen = *labels.at(u, v) == label;
            // Graphics adapters round corners to fractions of a pixel: a pixel on the rim may be seen that the exact
            // outline leaves out.
            let covered = *canvas.at(x, y) || seen;
            *canvas.at_mut(x, y) = covered;
            *whole.at_mut(u, v) = covered;
            *visible.at_mut(u, v) = seen;
        }
        let info = gt_info(&canvas, outline.offset, &visible, depth)?;
        Ok(Self { whole, visible, info })
    }
}

/// An outline as the lens shows it; what it puts outside of the picture is lost.
fn distorted(lens: &Lens, outline: &Silhouette) -> Result<Silhouette> {
    let pinhole = lens.padded();
    let mut inverse_depth = Image::filled(pinhole.width, pinhole.height, 0.0);
    for ([x, y], [u, v]) in pixels_inside(outline, pinhole.width, pinhole.height) {
        *inverse_depth.at_mut(u, v) = *outline.inverse_depth.at(x, y);
    }
    let inverse_depth = lens.nearest(&inverse_depth)?;
    let mut mask = Image::filled(inverse_depth.width(), inverse_depth.height(), false);
    for (covered, &inverse) in mask.data_mut().iter_mut().zip(inverse_depth.data()) {
        *covered = inverse > 0.0;
    }
    Ok(Silhouette { mask, inverse_depth, offset: [0, 0] })
}

/// The pixels of an outline's rectangle that lie in an image of that size: in the rectangle, and in the image.
fn pixels_inside(
    outline: &Silhouette,
    width: usize,
    height: usize,
) -> impl Iterator<Item = ([usize; 2], [usize; 2])> {
    let [left, top] = outline.offset.map(i64::from);
    let (columns, rows) = (outline.mask.width(), outline.mask.height());
    (0..rows).flat_map(move |y| (0..columns).map(move |x| [x, y])).filter_map(move |[x, y]| {
        let (u, v) = (usize::try_from(x as i64 + left).ok()?, usize::try_from(y as i64 + top).ok()?);
        (u < width && v < height).then_some(([x, y], [u, v]))
    })
}

/// Share of the outline's pixels that lie in the image.
fn share_inside(outline: &Silhouette, intrinsics: &Intrinsics) -> f64 {
    let all = outline.mask.data().iter().filter(|&&covered| covered).count();
    let inside = pixels_inside(outline, intrinsics.width, intrinsics.height)
        .filter(|([x, y], _)| *outline.mask.at(*x, *y))
        .count();
    inside as f64 / all.max(1) as f64
}
