//! What a data set is made of: options and all files that they name, resolved. Saved as `dataset.json`.

use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result, bail, ensure};
use grip_sim::bop::{self, CameraFile};
use grip_sim::camera::{Distortion, Intrinsics};
use grip_sim::condition::{ConditionSpec, Placement};
use grip_sim::objects::ObjectModel;
use grip_sim::pose::{Camera, Pose, World};
use grip_sim::scene::{FurtherCamera, Scene};
use grip_sim::sensor::Sensors;
use grip_sim::sensor::lens::Lens;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;

use crate::scenario;
use crate::setup::{self, Setup};

/// Version of dataset.json.
pub const SCHEMA: &str = "grip.dataset/1";
/// What a data set is, in its folder.
pub const MANIFEST: &str = "dataset.json";
/// Millimetres in a unit of the depth pictures: fine beside every sensor's steps, and reaches 6.5 m.
pub const DEPTH_SCALE_MM: f64 = 0.1;

/// Where the camera of a data set is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum CameraPlace {
    /// The scene's camera: the robot's head, looking at the scene's `look_at`, unless the scene puts it elsewhere.
    #[default]
    Head,
    /// That one and the scene's further cameras: each takes a picture of every layout.
    All,
    /// On a sphere about the objects.
    Sphere,
}

/// How hard a data set is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Profile {
    /// One camera takes all pictures, well calibrated.
    #[default]
    Standard,
    /// Another camera takes each: see [`CameraVariation`](grip_sim::sensor::variation::CameraVariation).
    Hard,
}

impl Profile {
    /// So that sets that were made before there were profiles can be gone on with.
    fn is_standard(&self) -> bool {
        *self == Self::Standard
    }
}

/// What a data set is to be. The default is the paper's adversarial set.
#[derive(Debug, Clone)]
pub struct DatasetOptions {
    /// How many scenes, 1 to 999999: each with its own objects, surroundings and light.
    pub scenes: u32,
    /// Objects to draw from, by name; the scene's where it is empty.
    pub objects: Vec<String>,
    /// Frames of each scene: a name of [`PAPER_VIEWS`], or `NAME=CONDITION`.
    pub views: Vec<String>,
    /// Where the camera is.
    pub camera: CameraPlace,
    /// How hard it is.
    pub profile: Profile,
    /// Chance of each object, anew in each frame, to shine, so that depth lacks pieces of it
    /// ([`dazzle`](grip_sim::sensor::shine::dazzle)); 0 to 1.
    pub shiny: f64,
    /// Depth noise preset in place of the scene's.
    pub depth_noise: Option<String>,
    /// Lens distortion by OpenCV's coefficients k1, k2, p1, p2, k3; none where it is empty.
    pub distortion: Vec<f64>,
    /// Name of the split's folder.
    pub split: String,
}

impl Default for DatasetOptions {
    fn default() -> Self {
        Self {
            scenes: 40,
            objects: Vec::new(),
            views: PAPER_VIEWS.map(|(name, _)| name.to_owned()).to_vec(),
            camera: CameraPlace::Head,
            profile: Profile::Standard,
            shiny: 0.0,
            depth_noise: None,
            distortion: Vec::new(),
            split: "test".into(),
        }
    }
}

/// The frames of the paper's test set and their conditions.
pub const PAPER_VIEWS: [(&str, &str); 7] = [
    ("B", "base"),
    ("D", "dark"),
    ("D1", "light-left"),
    ("D2", "light-right"),
    ("O1", "clutter-1"),
    ("O2", "clutter-2"),
    ("O3", "clutter-3"),
];

/// One frame of every scene.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct View {
    /// Such as `B`; the frame of scene 3 is called `exp003_B`.
    pub name: String,
    /// Light, and how objects are placed.
    pub condition: ConditionSpec,
    /// Which of the scene's further cameras takes it; none for the scene's camera.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera: Option<String>,
    /// The name that it shares with the frames that other cameras take of the same.
    #[serde(skip)]
    pub of: String,
}

impl View {
    /// The camera's position in [`Plan::poses`].
    pub fn camera(&self, scene: &Scene) -> usize {
        let of = |name: &String| scene.cameras.iter().position(|camera| camera.name == *name);
        self.camera.as_ref().and_then(of).map_or(0, |further| further + 1)
    }
}

/// A resolved data set. Two equal plans make the same files, byte for byte, on the same renderer.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Plan {
    schema: &'static str,
    program: &'static str,
    /// As in [`grip_sim::rng`].
    pub seed: u64,
    /// How many scenes.
    pub scenes: u32,
    /// The folder of the scenes.
    pub split: String,
    /// Image numbers are positions here.
    pub views: Vec<View>,
    /// Where the camera is.
    pub camera: CameraPlace,
    /// How hard it is; left out of a standard one.
    #[serde(skip_serializing_if = "Profile::is_standard", default)]
    pub profile: Profile,
    /// Chance of each object to shine; left out of a set in which nothing does.
    #[serde(skip_serializing_if = "is_zero", default)]
    pub shiny: f64,
    /// Of every picture.
    pub intrinsics: Intrinsics,
    /// Of the lens; BOP has no field for it, so it stands here alone.
    pub distortion: Distortion,
    /// Where the cameras are: the scene's, and the further ones that take pictures. Of a camera on a sphere it says nothing.
    #[serde(skip)]
    pub poses: Vec<Pose<World, Camera>>,
    /// Where the distortion is not none.
    #[serde(skip)]
    pub lens: Option<Lens>,
    depth_noise_name: String,
    /// Whether each picture's depth is of another depth camera.
    #[serde(skip)]
    pub any_depth_camera: bool,
    #[serde(skip)]
    /// How pictures differ from the true ones.
    pub sensors: Sensors,
    object_set: String,
    renderer: String,
    /// Objects that are not of a set, as in scenario.json.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    own_objects: Vec<Value>,
    /// The scene file, with the objects to draw from.
    pub scene: Scene,
}

impl Plan {
    /// Puts the options and `setup` together, which keeps the objects that they name; `device` says what draws.
    ///
    /// # Errors
    /// When a view, its condition, an object or a number is wrong: names the option and what to try.
    pub fn new(options: &DatasetOptions, setup: &mut Setup, device: String) -> Result<Self> {
        if !options.objects.is_empty() {
            choose(setup, &options.objects)?;
        }
        let views =
            options.views.iter().map(|text| view(text, &setup.cell.folder)).collect::<Result<Vec<_>>>()?;
        for (i, view) in views.iter().enumerate() {
            ensure!(
                views[..i].iter().all(|earlier| earlier.name != view.name),
                "--views: '{}' stands twice; give each frame a name of its own",
                view.name
            );
        }
        let (views, poses) = seen_by_cameras(views, options.camera, setup)?;
        ensure!((0.0..=1.0).contains(&options.shiny), "--shiny {}: must be from 0 to 1", options.shiny);
        let of_scene = &setup.cell.scene.camera.depth_noise;
        let depth_noise = options.depth_noise.as_ref().unwrap_or(of_scene);
        let sensors = setup.settings.sensor.sensors(depth_noise).context("--depth-noise")?;
        let any_depth_camera = options.profile == Profile::Hard && options.depth_noise.is_none();
        let depth_noise_name = if any_depth_camera { "any" } else { depth_noise }.to_owned();
        let distortion = distortion(&options.distortion, &setup.camera.intrinsics)?;
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        ensure!(
            !options.split.is_empty() && options.split.chars().all(plain),
            "--split {}: must be of letters, digits, '-' and '_'",
            options.split
        );
        Ok(Self {
            schema: SCHEMA,
            program: concat!("grip ", env!("CARGO_PKG_VERSION")),
            seed: setup.seed,
            scenes: options.scenes,
            split: options.split.clone(),
            views,
            camera: options.camera,
            poses,
            profile: options.profile,
            shiny: options.shiny,
            intrinsics: setup.camera.intrinsics,
            lens: (!distortion.is_none())
                .then(|| Lens::new(&setup.camera.intrinsics, &distortion))
                .transpose()
                .context("--distortion")?,
            distortion,
            depth_noise_name,
            any_depth_camera,
            sensors,
            object_set: setup.object_set(),
            renderer: device,
            own_objects: own_objects(setup)?,
            scene: setup.cell.scene.clone(),
        })
    }

    /// Whether the frame shows the layout that all such frames of its scene share.
    pub fn shares_layout(&self, view: &View) -> bool {
        view.condition.placement == Placement::Spread && self.camera != CameraPlace::Sphere
    }

    /// Writes `dataset.json` in a new folder; in one that has it, checks that it is the same plan.
    ///
    /// # Errors
    /// When the folder holds something else, or the plan differs, or without `resume`.
    pub fn claim(&self, out: &Path, resume: bool) -> Result<()> {
        let path = out.join(MANIFEST);
        let text = serde_json::to_string_pretty(self)? + "\n";
        let occupied = out.exists()
            && std::fs::read_dir(out)
                .with_context(|| format!("{}: cannot read", out.display()))?
                .next()
                .is_some();
        if occupied {
            let Ok(earlier) = std::fs::read_to_string(&path) else {
                bail!("{}: exists and is no data set of this program; choose another --out", out.display());
            };
            ensure!(
                resume,
                "{}: holds a data set; give --resume to make what it lacks, or choose another --out",
                out.display()
            );
            ensure!(
                earlier == text,
                "{}: was made with other settings ({}); give the same ones, or choose another --out",
                path.display(),
                first_difference(&earlier, &text)
            );
            return Ok(());
        }
        std::fs::create_dir_all(out).with_context(|| {
            format!("{}: cannot make the folder; check permissions or choose another --out", out.display())
        })?;
        Ok(bop::write_atomic(&path, text.as_bytes())?)
    }

    /// The pinhole camera that is drawn: under a lens with distortion it sees more than the picture shows.
    pub fn pinhole(&self) -> &Intrinsics {
        self.lens.as_ref().map_or(&self.intrinsics, Lens::padded)
    }

    /// `camera.json` of the set.
    pub fn camera_file(&self) -> CameraFile {
        let Intrinsics { width, height, fx, fy, cx, cy } = self.intrinsics;
        CameraFile { width, height, fx, fy, cx, cy, depth_scale: Some(DEPTH_SCALE_MM) }
    }
}

/// What the scene's objects of one's own are, each once.
fn own_objects(setup: &Setup) -> Result<Vec<Value>> {
    let own = setup.models.iter().filter(|model| model.source.is_some());
    let mut entries: Vec<Value> = Vec::new();
    for model in own {
        let entry = serde_json::to_value(scenario::object(model))?;
        if !entries.contains(&entry) {
            entries.push(entry);
        }
    }
    Ok(entries)
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// Reduces the scene to the objects named.
fn choose(setup: &mut Setup, names: &[String]) -> Result<()> {
    let models: Vec<Arc<ObjectModel>> =
        names.iter().map(|name| setup.library.load(name).context("--objects")).collect::<Result<_>>()?;
    if let Some(count) = &mut setup.cell.scene.objects.count {
        count.min = count.min.min(names.len());
        count.max = count.max.min(names.len());
    }
    setup.cell.scene.objects.names = names.to_vec();
    setup.cell.scene.objects.placed.retain(|placed| names.contains(&placed.name));
    setup.models = models;
    Ok(())
}

/// `B`, or `NAME=CONDITION`.
fn view(text: &str, folder: &Path) -> Result<View> {
    let (name, condition) = match text.split_once('=') {
        Some((name, condition)) => (name, condition),
        None => *PAPER_VIEWS.iter().find(|(name, _)| *name == text).with_context(|| {
            let known: Vec<&str> = PAPER_VIEWS.iter().map(|(name, _)| *name).collect();
            format!("--views: no frame '{text}'; there are {}, or give NAME=CONDITION", known.join(", "))
        })?,
    };
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    ensure!(
        !name.is_empty() && name.chars().all(plain),
        "--views: '{text}': a frame's name must be of letters, digits, '-' and '_'"
    );
    let condition = setup::load_condition(folder, condition).with_context(|| format!("--views {text}"))?;
    Ok(View { name: name.to_owned(), condition, camera: None, of: name.to_owned() })
}

/// Where cameras are.
type CameraPoses = Vec<Pose<World, Camera>>;

/// The frames of all cameras that take pictures, those of one kind together, and where these cameras are.
fn seen_by_cameras(views: Vec<View>, camera: CameraPlace, setup: &Setup) -> Result<(Vec<View>, CameraPoses)> {
    let Setup { cell, .. } = setup;
    let mut poses = vec![cell.world_from_camera(&cell.start)];
    if camera != CameraPlace::All {
        return Ok((views, poses));
    }
    let further = &cell.scene.cameras;
    ensure!(!further.is_empty(), "--camera all: the scene has no [[cameras]] (name, place); add some");
    for camera in further {
        let pose = cell.camera_at(&camera.place, &cell.start);
        poses.push(pose.with_context(|| format!("cameras.place of '{}'", camera.name))?);
    }
    let by = |view: &View, camera: &FurtherCamera| View {
        name: format!("{}_{}", view.name, camera.name),
        camera: Some(camera.name.clone()),
        ..view.clone()
    };
    let all = |view: View| {
        let others: Vec<View> = further.iter().map(|camera| by(&view, camera)).collect();
        std::iter::once(view).chain(others)
    };
    Ok((views.into_iter().flat_map(all).collect(), poses))
}

fn distortion(given: &[f64], intrinsics: &Intrinsics) -> Result<Distortion> {
    let distortion = match *given {
        [] => Distortion::default(),
        [k1, k2, p1, p2, k3] => Distortion { k1, k2, p1, p2, k3 },
        _ => bail!("--distortion: {} numbers; give the five k1,k2,p1,p2,k3", given.len()),
    };
    if let Some(problem) = distortion.problem(intrinsics) {
        bail!("--distortion: {problem}");
    }
    Ok(distortion)
}

/// The first lines that are not the same, for people.
fn first_difference(earlier: &str, now: &str) -> String {
    earlier
        .lines()
        .zip(now.lines())
        .find(|(a, b)| a != b)
        .map(|(a, b)| format!("{} then, {} now", a.trim(), b.trim()))
        .unwrap_or_else(|| "one is longer than the other".into())
}
