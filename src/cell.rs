//! The robot's workcell: what is fixed in it, and what the robot knows of it before it looks.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, Result, ensure};
use grip_manip::{BeliefScene, BinGeometry};
use grip_perception::Workspace;
use grip_sim::pose::{Camera, Pose, World};
use grip_sim::robot::{RobotConfig, RobotModel};
use grip_sim::scene::Scene;
use nalgebra::Point3;

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
    /// Start configuration: the scene's pose and torso, the head looking at the scene's point.
    pub start: Vec<f64>,
    /// The folder of the scene file, where conditions and objects may lie.
    pub folder: PathBuf,
}

impl Cell {
    /// Reads a scene file and the robot that it names, or the one at `urdf`.
    ///
    /// # Errors
    /// When a file is missing or wrong; names file, field, value and what to try.
    pub fn load(scene_file: &Path, urdf: Option<&Path>, package_path: &[PathBuf]) -> Result<Self> {
        let scene = Scene::load(scene_file)?;
        let folder = scene_file.parent().unwrap_or(Path::new("."));
        let urdf = urdf.map_or_else(|| folder.join(&scene.robot.urdf), Path::to_path_buf);
        let robot = Arc::new(RobotModel::load(&urdf, package_path)?);
        let config = Arc::new(RobotConfig::load(&folder.join(&scene.robot.config), &robot)?);
        let start =
            start_configuration(&scene, &robot, &config, &scene.robot.look_at.into(), scene.robot.torso)
                .with_context(|| format!("{}: [robot]", scene_file.display()))?;
        Ok(Self { scene, robot, config, start, folder: folder.to_path_buf() })
    }

    /// Moves the robot to where it stands in a run with `seed`; its head looks at the same point.
    pub(crate) fn draw(&mut self, seed: u64) {
        self.scene.robot.draw(seed);
        let target = self.scene.world_from_base().inverse().transform_point(&self.scene.robot.look_at.into());
        self.start = self.config.look_at(&self.robot, &self.start, &target);
    }

    /// The start configuration with the torso `torso` metres above its lower stop, the head looking at a point of the world.
    ///
    /// # Errors
    /// When that is outside of the torso's limits.
    pub fn looking_at(&self, point: &Point3<f64>, torso: f64) -> Result<Vec<f64>> {
        start_configuration(&self.scene, &self.robot, &self.config, point, torso)
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

    /// The head camera's pose by forward kinematics, with the joints at `q`.
    pub fn world_from_camera(&self, q: &[f64]) -> Pose<World, Camera> {
        let base_from_camera = self.robot.fk_link(q, self.config.camera.optical_link);
        Pose::new(self.scene.world_from_base().iso() * base_from_camera)
    }
}

fn start_configuration(
    scene: &Scene,
    robot: &RobotModel,
    config: &RobotConfig,
    look_at: &Point3<f64>,
    height: f64,
) -> Result<Vec<f64>> {
    let mut q = config.configuration(robot, &scene.robot.start_pose)?;
    if let Some(torso) = config.arm_with_torso.iter().find(|joint| !config.arm.contains(joint)) {
        let limits = robot.joints()[*torso].limits;
        ensure!(
            limits.contains(height),
            "torso = {height}: outside the limits of {} ({} to {} m)",
            robot.joints()[*torso].name,
            limits.lower,
            limits.upper
        );
        q[*torso] = height;
    }
    for finger in config.gripper.fingers {
        q[finger] = config.gripper.opening / 2.0;
    }
    let target = scene.world_from_base().inverse().transform_point(look_at);
    Ok(config.look_at(robot, &q, &target))
}
