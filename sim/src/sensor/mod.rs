//! Sensor models: what depth and colour look like after a real camera has had its way with them.

pub mod color;
pub mod depth;
pub mod lens;
mod normal;

use rand::RngExt;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use self::color::ColorSensor;
use self::depth::DepthNoise;
use crate::camera::Intrinsics;
use crate::condition::Condition;
use crate::error::Result;
use crate::frame::CameraFrame;
use crate::pose::{Camera, Pose, World};
use crate::render::{RenderScene, Renderer, Rendering};

/// Takes one frame: renders `scene` in the light of `condition` and passes the result through both sensors.
///
/// The second value is what the renderer saw, before noise: perfect depth and labels, for scoring and data sets, never
/// for perception.
///
/// # Errors
/// When the renderer fails.
pub fn capture(
    renderer: &mut dyn Renderer,
    scene: &RenderScene,
    condition: &Condition,
    intrinsics: &Intrinsics,
    world_from_camera: &Pose<World, Camera>,
    noise: &DepthNoise,
    rng: &mut ChaCha8Rng,
) -> Result<(CameraFrame, Rendering)> {
    let rendering = renderer.render(scene, &condition.lighting, intrinsics, world_from_camera)?;
    let frame = sense(&rendering, condition, intrinsics, world_from_camera, noise, rng);
    Ok((frame, rendering))
}

/// Passes what a renderer saw in the light of `condition` through both sensors.
pub fn sense(
    rendering: &Rendering,
    condition: &Condition,
    intrinsics: &Intrinsics,
    world_from_camera: &Pose<World, Camera>,
    noise: &DepthNoise,
    rng: &mut ChaCha8Rng,
) -> CameraFrame {
    CameraFrame {
        rgb: ColorSensor::default().expose(&rendering.radiance, condition, rng),
        depth: noise.apply(rendering, intrinsics, rng),
        intrinsics: *intrinsics,
        world_from_camera: *world_from_camera,
    }
}

/// Random streams for the rows of one image, so that rows can be worked on in any order and on any number of threads.
#[derive(Clone)]
struct RowStreams(ChaCha8Rng);

impl RowStreams {
    /// Draws one number from `rng`.
    fn new(rng: &mut ChaCha8Rng) -> Self {
        Self(ChaCha8Rng::seed_from_u64(rng.random()))
    }

    fn row(&self, v: usize) -> ChaCha8Rng {
        let mut rng = self.0.clone();
        rng.set_stream(v as u64);
        rng
    }
}
