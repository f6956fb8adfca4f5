//! Sensor models: what depth and colour look like after a real camera has had its way with them.

pub mod color;
pub mod depth;
pub mod lens;
mod normal;
mod patches;
pub mod shine;
pub mod variation;

use rand::RngExt;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::color::ColorSensor;
use self::depth::{Carmine109, DepthNoise};
use crate::camera::Intrinsics;
use crate::condition::Condition;
use crate::error::Result;
use crate::frame::CameraFrame;
use crate::pose::{Camera, Pose, World};
use crate::range::within;
use crate::render::{RenderScene, Renderer, Rendering};

/// The two sensors of the camera.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sensors {
    /// Colour.
    pub color: ColorSensor,
    /// Depth.
    pub depth: DepthNoise,
}

/// Settings of the sensors that a scene may name.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SensorSettings {
    /// Colour.
    pub color: ColorSensor,
    /// Depth of the presets `carmine-109` and `carmine-109-near`.
    pub carmine: Carmine109,
}

impl SensorSettings {
    /// Whether every number is within its range.
    ///
    /// # Errors
    /// The first that is not, by its name in the tree, its value and its range.
    pub fn validate(&self) -> std::result::Result<(), String> {
        let Self { color, carmine } = self;
        within("color.electrons_per_nit_second", color.electrons_per_nit_second, 1.0, 1e6)?;
        within("color.full_well", color.full_well, 100.0, 1e6)?;
        within("color.read_noise", color.read_noise, 0.0, 1e3)?;
        within("color.levels", color.levels, 255.0, 65535.0)?;
        within("color.target", color.target, 0.01, 0.9)?;
        within("color.spread", color.spread, 0.0, 0.33)?;
        within("color.white_balance", color.white_balance, 0.0, 1.0)?;
        within("carmine.lateral_px", carmine.lateral_px.into(), 0.0, 10.0)?;
        within("carmine.bias_px", carmine.bias_px.into(), 0.0, 10.0)?;
        within("carmine.projector_x", carmine.projector_x.into(), -1.0, 1.0)?;
        within("carmine.grazing_exponent", carmine.grazing_exponent.into(), 0.0, 100.0)
    }

    /// The sensors, depth by the scene's preset.
    ///
    /// # Errors
    /// When there is no preset of that name.
    pub fn sensors(&self, depth_noise: &str) -> Result<Sensors> {
        Ok(Sensors { color: self.color, depth: DepthNoise::from_name(depth_noise, &self.carmine)? })
    }
}

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
    sensors: &Sensors,
    rng: &mut ChaCha8Rng,
) -> Result<(CameraFrame, Rendering)> {
    let rendering = renderer.render(scene, &condition.lighting, intrinsics, world_from_camera)?;
    let frame = sense(&rendering, condition, intrinsics, world_from_camera, sensors, rng);
    Ok((frame, rendering))
}

/// Passes what a renderer saw in the light of `condition` through both sensors.
pub fn sense(
    rendering: &Rendering,
    condition: &Condition,
    intrinsics: &Intrinsics,
    world_from_camera: &Pose<World, Camera>,
    sensors: &Sensors,
    rng: &mut ChaCha8Rng,
) -> CameraFrame {
    CameraFrame {
        rgb: sensors.color.expose(&rendering.radiance, condition, rng),
        depth: sensors.depth.apply(rendering, intrinsics, rng),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_survive_being_saved_and_reach_the_preset_that_a_scene_names() {
        let part: SensorSettings =
            toml::from_str("[carmine]\nbias_px = 0.0\n[color]\nread_noise = 8.0").unwrap();
        assert_eq!(toml::from_str::<SensorSettings>(&toml::to_string(&part).unwrap()).unwrap(), part);
        let sensors = part.sensors("carmine-109-near").unwrap();
        assert_eq!(sensors.color, ColorSensor { read_noise: 8.0, ..ColorSensor::default() });
        let DepthNoise::Carmine109(depth) = sensors.depth else { panic!("{sensors:?}") };
        assert_eq!(depth.bias_px, 0.0);
        assert_eq!(depth.range, depth::DepthRange::Near);
        assert_eq!(SensorSettings::default().sensors("carmine-109").unwrap(), Sensors::default());
        assert!(part.sensors("fog").unwrap_err().to_string().contains("carmine-109-near"));
    }

    #[test]
    fn settings_out_of_range_are_named_with_their_value() {
        assert_eq!(SensorSettings::default().validate(), Ok(()));
        for (text, wanted) in [
            ("[color]\ntarget = 2.0", "color.target = 2"),
            ("[carmine]\nbias_px = nan", "carmine.bias_px = NaN"),
        ] {
            let message = toml::from_str::<SensorSettings>(text).unwrap().validate().unwrap_err();
            assert!(message.contains(wanted), "{message}");
        }
        assert!(toml::from_str::<SensorSettings>("[carmine]\nrange = \"near\"").is_err());
    }
}
