//! What a camera saw.

use anyhow::{Result, ensure};
use grip_sim::camera::Intrinsics;
use grip_sim::frame::CameraFrame;
use grip_sim::images::{DepthImage, RgbImage};
use grip_sim::pose::{Camera, Pose, World};
use numpy::{PyArray2, PyArray3};
use pyo3::prelude::*;

use crate::arrays;
use crate::error::raised;

/// One registered RGB-D frame. Pixel (0, 0) is the middle of the first one; x is right, y down, z forward.
#[pyclass(module = "grip", frozen, name = "Frame")]
pub struct Frame {
    /// Height x width x 3, uint8: sRGB.
    #[pyo3(get)]
    rgb: Py<PyArray3<u8>>,
    /// Height x width, float32: metres along the optical axis, 0 where there is no reading.
    #[pyo3(get)]
    depth: Py<PyArray2<f32>>,
    /// Camera matrix, 3 x 3, pixels.
    #[pyo3(get, name = "K")]
    k: Py<PyArray2<f64>>,
    /// 4 x 4, from the camera's frame to the world's (z up), metres, as the robot believes; None where nobody knows.
    #[pyo3(get)]
    world_from_camera: Option<Py<PyArray2<f64>>>,
}

impl Frame {
    /// The pictures themselves, not copied.
    pub fn new(py: Python<'_>, frame: CameraFrame) -> Self {
        let CameraFrame { rgb, depth, intrinsics, world_from_camera } = frame;
        Self::of(py, rgb, depth, &intrinsics, Some(&world_from_camera))
    }

    /// Copies, for whoever is asked while others still need the frame.
    pub fn copy(
        py: Python<'_>,
        frame: &CameraFrame,
        world_from_camera: Option<&Pose<World, Camera>>,
    ) -> Self {
        Self::of(py, frame.rgb.clone(), frame.depth.clone(), &frame.intrinsics, world_from_camera)
    }

    fn of(
        py: Python<'_>,
        rgb: RgbImage,
        depth: DepthImage,
        k: &Intrinsics,
        world_from_camera: Option<&Pose<World, Camera>>,
    ) -> Self {
        Self {
            rgb: arrays::rgb(py, rgb).unbind(),
            depth: arrays::plane(py, depth).unbind(),
            k: arrays::camera_matrix(py, k).unbind(),
            world_from_camera: world_from_camera.map(|pose| arrays::pose(py, pose.iso()).unbind()),
        }
    }

    /// What it holds now: arrays may have been written to since.
    pub fn read(&self, py: Python<'_>) -> Result<CameraFrame> {
        let arrays = [self.rgb.bind(py).as_any(), self.depth.bind(py).as_any(), self.k.bind(py).as_any()];
        let (rgb, depth, intrinsics) = pictures(arrays, "frame.")?;
        let world_from_camera = match &self.world_from_camera {
            Some(pose) => Pose::new(arrays::read_isometry(pose.bind(py), "frame.world_from_camera")?),
            None => anyhow::bail!(
                "frame.world_from_camera: is missing: where the table is cannot be told without it; give a 4 x 4 matrix"
            ),
        };
        Ok(CameraFrame { rgb, depth, intrinsics, world_from_camera })
    }
}

#[pymethods]
impl Frame {
    #[new]
    #[pyo3(signature = (rgb, depth, K, world_from_camera = None))]
    #[allow(non_snake_case, reason = "K is what everybody calls it")]
    fn create(
        py: Python<'_>,
        rgb: &Bound<'_, PyAny>,
        depth: &Bound<'_, PyAny>,
        K: &Bound<'_, PyAny>,
        world_from_camera: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        raised(|| {
            let (rgb, depth, k) = pictures([rgb, depth, K], "")?;
            let pose = world_from_camera
                .map(|pose| anyhow::Ok(Pose::new(arrays::read_isometry(pose, "world_from_camera")?)))
                .transpose()?;
            Ok(Self::of(py, rgb, depth, &k, pose.as_ref()))
        })
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let shape: (usize, usize) = self.depth.bind(py).getattr("shape")?.extract()?;
        let pose = if self.world_from_camera.is_some() { "" } else { ", without its pose" };
        Ok(format!("<grip.Frame {} x {}{pose}>", shape.1, shape.0))
    }
}

/// Colour, depth and camera matrix that belong together; `of` stands before their names in errors.
fn pictures(arrays: [&Bound<'_, PyAny>; 3], of: &str) -> Result<(RgbImage, DepthImage, Intrinsics)> {
    let [rgb, depth, k] = arrays;
    let rgb = arrays::read_rgb(rgb, &format!("{of}rgb"))?;
    let depth = arrays::read_depth(depth, &format!("{of}depth"))?;
    let (width, height) = (depth.width(), depth.height());
    ensure!(
        (rgb.width() as usize, rgb.height() as usize) == (width, height),
        "{of}rgb: is {} x {} and depth {width} x {height}: must be the same; register one to the other",
        rgb.width(),
        rgb.height()
    );
    let k = arrays::read_intrinsics(k, &format!("{of}K"), width, height)?;
    Ok((rgb, depth, k))
}
