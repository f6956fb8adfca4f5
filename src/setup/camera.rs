//! The head camera in the simulated room.

use std::sync::{Arc, OnceLock};

use anyhow::Result;
use grip_physics::World;
use grip_sim::camera::Intrinsics;
use grip_sim::condition::Condition;
use grip_sim::frame::CameraFrame;
use grip_sim::pose::{Camera, Pose, World as WorldFrame};
use grip_sim::render::{self, Bounce, Furniture, RenderScene, Renderer, Rendering};
use grip_sim::rng;
use grip_sim::scene::Scene;
use grip_sim::sensor::{self, SensorSettings, Sensors};

/// A camera, and what it sees of a room beside the robot and the objects.
#[derive(Clone)]
pub struct HeadCamera {
    /// Focal lengths, principal point and size, pixels.
    pub intrinsics: Intrinsics,
    /// How its colour and depth differ from the true ones.
    pub sensors: Sensors,
    /// As the room stands in it.
    scene: Arc<Scene>,
    /// Made at the first look: its textures take a third of a second, and not everyone looks.
    room: Arc<OnceLock<(Furniture, Bounce)>>,
    /// Of the run.
    seed: u64,
}

impl HeadCamera {
    /// In a run with `seed`, on which the looks of the room depend; `intrinsics` are those of the robot that the scene names.
    ///
    /// # Errors
    /// When the scene names no known noise.
    pub fn new(
        scene: &Scene,
        intrinsics: Intrinsics,
        settings: &SensorSettings,
        seed: u64,
    ) -> grip_sim::Result<Self> {
        let sensors = settings.sensors(&scene.camera.depth_noise)?;
        Ok(Self { intrinsics, sensors, scene: Arc::new(scene.clone()), room: Arc::default(), seed })
    }

    /// The same camera in a run with another seed.
    pub fn with_seed(&self, scene: &Scene, seed: u64) -> Self {
        Self { scene: Arc::new(scene.clone()), room: Arc::default(), seed, ..self.clone() }
    }

    /// What it sees beside the robot and the objects.
    pub fn furniture(&self) -> &Furniture {
        &self.room().0
    }

    fn room(&self) -> &(Furniture, Bounce) {
        self.room.get_or_init(|| {
            let Scene { table, surroundings, .. } = &*self.scene;
            let furniture = render::furniture(&self.scene.fixtures(), *surroundings, self.seed);
            let bounce = Bounce::of(table, furniture.table_albedo);
            (furniture, bounce)
        })
    }

    /// Everything there is to see, as it stands now.
    pub fn view(&self, world: &World) -> RenderScene {
        let (furniture, bounce) = self.room();
        let mut view = world.render_scene(&furniture.drawn);
        view.bounce = Some(*bounce);
        view
    }

    /// Takes a picture from where the camera is. `shot` numbers the pictures of a run, so that each has noise of its own.
    ///
    /// # Errors
    /// When the renderer fails.
    pub fn capture(
        &self,
        world: &World,
        world_from_camera: &Pose<WorldFrame, Camera>,
        condition: &Condition,
        renderer: &mut dyn Renderer,
        shot: usize,
    ) -> Result<(CameraFrame, Rendering)> {
        let mut random = rng::stream(self.seed, &format!("sensor/{shot}"));
        Ok(sensor::capture(
            renderer,
            &self.view(world),
            condition,
            &self.intrinsics,
            world_from_camera,
            &self.sensors,
            &mut random,
        )?)
    }
}
