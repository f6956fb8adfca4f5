//! The robot's workcell: what is fixed in it, and what the robot knows of it before it looks.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, Result, bail, ensure};
use grip_manip::{BeliefScene, BinGeometry};
use grip_perception::Workspace;
use grip_sim::pose::{Camera, Pose, World};
use grip_sim::robot::{RobotConfig, RobotModel, find_urdf};
use grip_sim::scene::{CameraPlace, Scene};
use nalgebra::{Isometry3, Point3};

/// Depth smears the bin's edges by about this much, metres.
const SMEAR_M: f64 = 0.01;
/// Nothing is put down nearer than this to the table's edge, metres.
const RIM_M: f64 = 0.05;
/// What may stick out of the bin: its inside ends so far above what it stands on, metres.
const BIN_SPACE_M: f64 = 0.35;

/// A table, a bin and a robot, without objects.
#[derive(Debug, Clone)]
pub struct Cell {
    /// The scene file; its objects are those of the run.
    pub scene: Scene,
    /// The robot.
    pub robot: Arc<RobotModel>,
    /// What the URDF does not say.
    pub config: Arc<RobotConfig>,
    /// The file of that.
    pub settings: PathBuf,
    mount: Mount,
    /// Start configuration: the scene's pose and torso, the head looking at the scene's point.
    pub start: Vec<f64>,
    /// The folder of the scene file, where conditions and objects may lie.
    pub folder: PathBuf,
}

/// Where the camera is that the robot sees by.
#[derive(Debug, Clone)]
enum Mount {
    /// Fixed in the room.
    Room(Pose<World, Camera>),
    /// On a link of the robot, by its index, at this place in it.
    Link(usize, Isometry3<f64>),
}

impl Mount {
    fn at(place: &CameraPlace, robot: &RobotModel) -> Result<Option<Self>> {
        if let Some(pose) = place.in_room() {
            return Ok(Some(Self::Room(pose)));
        }
        place.on_robot().map(|(link, pose)| Ok(Self::Link(robot.link_index(link)?, pose))).transpose()
    }

    fn new(scene: &Scene, robot: &RobotModel, config: &RobotConfig) -> Result<Self> {
        if let Some(place) = &scene.camera.place
            && let Some(mount) = Self::at(place, robot).context("camera.place.link")?
        {
            return Ok(mount);
        }
        let camera = config.camera.as_ref().with_context(|| {
            format!(
                "camera.place: is missing, and robot {} has no camera: its settings have no [camera]; say where a camera is, in the room \
                 (place = {{ eye = [x, y, z], target = [x, y, z] }}) or on a link (place = {{ link = \"NAME\", xyz = [..], rpy = [..] }})",
                robot.name()
            )
        })?;
        Ok(Self::Link(camera.optical_link, Isometry3::identity()))
    }
}

impl Cell {
    /// Reads a scene file and the robot that it names, or the one at `urdf`, with the settings at `config`.
    ///
    /// # Errors
    /// When a file is missing or wrong; names file, field, value and what to try.
    pub fn load(
        scene_file: &Path,
        urdf: Option<&Path>,
        config: Option<&Path>,
        package_path: &[PathBuf],
    ) -> Result<Self> {
        let scene = Scene::load(scene_file)?;
        let folder = scene_file.parent().unwrap_or(Path::new("."));
        let urdf = match urdf {
            Some(urdf) => urdf.to_path_buf(),
            None => find_urdf(&scene.robot.urdf, folder, package_path)
                .with_context(|| scene_file.display().to_string())?,
        };
        let settings = config.map_or_else(|| folder.join(&scene.robot.config), Path::to_path_buf);
        let robot = RobotModel::load(&urdf, package_path)?;
        let (robot, config) = RobotConfig::load(&settings, robot)?;
        let at = || scene_file.display().to_string();
        let mount = Mount::new(&scene, &robot, &config).with_context(at)?;
        let start = start_configuration(&scene, &robot, &config, scene.robot.torso, None)
            .with_context(|| format!("{}: [robot]", scene_file.display()))?;
        let (robot, config) = (Arc::new(robot), Arc::new(config));
        Ok(Self { scene, robot, config, settings, mount, start, folder: folder.to_path_buf() })
    }

    /// Moves the robot to where it stands in a run with `seed`; its head looks at the same point.
    pub(crate) fn draw(&mut self, seed: u64) {
        self.scene.robot.draw(seed);
        if let Some(point) = self.scene.robot.look_at {
            let target = self.scene.world_from_base().inverse().transform_point(&point.into());
            self.start = self.config.look_at(&self.robot, &self.start, &target);
        }
    }

    /// The start configuration with the torso `torso` metres above its lower stop, the head looking at a point of the world; `None`
    /// where that is no other view: for a camera in the room, and for a robot without a torso or a head.
    ///
    /// # Errors
    /// When that is outside of the torso's limits.
    pub fn looking_at(&self, point: &Point3<f64>, torso: f64) -> Result<Option<Vec<f64>>> {
        let moves = matches!(self.mount, Mount::Link(..));
        if !moves || self.config.torso().is_none() || self.config.head.is_none() {
            return Ok(None);
        }
        start_configuration(&self.scene, &self.robot, &self.config, Some(torso), Some(point)).map(Some)
    }

    /// What the robot knows before it looks: table, bin and where it stands. No objects.
    pub fn empty_belief(&self) -> BeliefScene {
        let bin = &self.scene.bin;
        BeliefScene::new(
            self.scene.fixtures().into_iter().map(|f| f.shape).collect(),
            self.scene.table.height,
            BinGeometry::new(Pose::new(bin.world_from_bin()), bin.inner, bin.wall_height),
            self.scene.world_from_base(),
        )
    }

    /// Where objects may lie, from the map of the cell: the largest rectangle of the table beside the bin, from just
    /// below the table's top to 0.4 m above it.
    pub fn workspace(&self) -> Workspace {
        let table = &self.scene.table;
        let bin = self.scene.bin.outline();
        let (low, high) = (table.low(), table.high());
        let mut best = (low, high);
        if (0..2).all(|a| bin.0[a] < high[a] && bin.1[a] > low[a]) {
            let beside = (0..2).flat_map(|a| {
                let (mut below, mut above) = ((low, high), (low, high));
                below.1[a] = bin.0[a] - SMEAR_M;
                above.0[a] = bin.1[a] + SMEAR_M;
                [below, above]
            });
            let area = |(l, h): &([f64; 2], [f64; 2])| (h[0] - l[0]).max(0.0) * (h[1] - l[1]).max(0.0);
            best = beside.max_by(|a, b| area(a).total_cmp(&area(b))).unwrap_or(best);
        }
        let ([x0, y0], [x1, y1]) = best;
        Workspace { min: [x0, y0, table.height - 0.02], max: [x1, y1, table.height + 0.4] }
    }

    /// The table where objects may lie, as a bin without walls, but for its rim.
    pub(crate) fn free_table(&self) -> BinGeometry {
        let Workspace { min, max } = self.workspace();
        let center = [0, 1].map(|axis| 0.5 * (min[axis] + max[axis]));
        let inner = [0, 1].map(|axis| (max[axis] - min[axis] - 2.0 * RIM_M).max(RIM_M));
        let pose = Pose::from_xyz_rpy([center[0], center[1], self.scene.table.height], [0.0; 3]);
        BinGeometry::new(pose, inner, 0.0)
    }

    /// The inside of the bin and what may stick out of it.
    pub fn bin_space(&self) -> Workspace {
        let bin = &self.scene.bin;
        let (low, high) = bin.outline();
        let walls = bin.wall_thickness;
        Workspace {
            min: [low[0] + walls, low[1] + walls, bin.base_height],
            max: [high[0] - walls, high[1] - walls, bin.base_height + BIN_SPACE_M],
        }
    }

    /// The camera's pose by forward kinematics, with the joints at `q`.
    pub fn world_from_camera(&self, q: &[f64]) -> Pose<World, Camera> {
        self.camera_on(&self.mount, q)
    }

    /// The pose of a camera at another place, with the joints at `q`.
    ///
    /// # Errors
    /// When the robot has no such link.
    pub fn camera_at(&self, place: &CameraPlace, q: &[f64]) -> Result<Pose<World, Camera>> {
        let mount = Mount::at(place, &self.robot)?.context("a camera without a place")?;
        Ok(self.camera_on(&mount, q))
    }

    fn camera_on(&self, mount: &Mount, q: &[f64]) -> Pose<World, Camera> {
        match mount {
            Mount::Room(pose) => *pose,
            Mount::Link(link, link_from_camera) => {
                let base_from_camera = self.robot.fk_link(q, *link) * link_from_camera;
                Pose::new(self.scene.world_from_base().iso() * base_from_camera)
            }
        }
    }
}

/// The scene's start pose, the torso `height` metres above its lower stop, the head looking at a point of the world: the scene's where
/// none is given.
fn start_configuration(
    scene: &Scene,
    robot: &RobotModel,
    config: &RobotConfig,
    height: Option<f64>,
    point: Option<&Point3<f64>>,
) -> Result<Vec<f64>> {
    let mut q = config.configuration(robot, &scene.robot.start_pose)?;
    match (config.torso(), height) {
        (Some(torso), Some(height)) => {
            let joint = &robot.joints()[torso];
            let limits = joint.limits;
            ensure!(
                limits.contains(height),
                "torso = {height}: outside the limits of {} ({} to {} m)",
                joint.name,
                limits.lower,
                limits.upper
            );
            q[torso] = height;
        }
        (Some(torso), None) => {
            bail!("torso: is missing; give the height of {}, metres", robot.joints()[torso].name)
        }
        (None, Some(height)) => bail!("torso = {height}: robot {} has no torso; leave it out", robot.name()),
        (None, None) => {}
    }
    for finger in config.gripper.fingers {
        q[finger] = config.gripper.opening / 2.0;
    }
    let point = match (config.head, point.copied().or(scene.robot.look_at.map(Point3::from))) {
        (Some(_), None) => bail!("look_at: is missing; give the point that the head looks at, metres"),
        (None, Some(_)) => bail!("look_at: robot {} has no head; leave it out", robot.name()),
        (Some(_), Some(point)) => point,
        (None, None) => return Ok(q),
    };
    let target = scene.world_from_base().inverse().transform_point(&point);
    Ok(config.look_at(robot, &q, &target))
}
