//! What goes between Rust and NumPy: pictures, camera matrices, poses. Arrays of any strides are read; what has another shape or type
//! is refused by name.

use anyhow::{Context, Result, bail, ensure};
use grip_sim::bop;
use grip_sim::camera::Intrinsics;
use grip_sim::images::{DepthImage, Image, RgbImage};
use nalgebra::Isometry3;
use numpy::{
    Element, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;

/// A pose x' = R x + t as a 4 x 4 matrix.
pub fn pose<'py>(py: Python<'py>, iso: &Isometry3<f64>) -> Bound<'py, PyArray2<f64>> {
    let m = iso.to_homogeneous();
    reshaped(py, m.transpose().as_slice().to_vec(), [4, 4])
}

/// Camera matrix, pixels.
pub fn camera_matrix<'py>(py: Python<'py>, k: &Intrinsics) -> Bound<'py, PyArray2<f64>> {
    reshaped(py, vec![k.fx, 0.0, k.cx, 0.0, k.fy, k.cy, 0.0, 0.0, 1.0], [3, 3])
}

/// Height x width x 3; the picture's own memory.
pub fn rgb(py: Python<'_>, image: RgbImage) -> Bound<'_, PyArray3<u8>> {
    let shape = [image.height() as usize, image.width() as usize, 3];
    reshaped(py, image.into_raw(), shape)
}

/// Height x width; the picture's own memory.
pub fn plane<T: Element + Clone>(py: Python<'_>, image: Image<T>) -> Bound<'_, PyArray2<T>> {
    let shape = [image.height(), image.width()];
    reshaped(py, image.into_data(), shape)
}

/// N x 4 x 4.
pub fn poses<'a, 'py>(
    py: Python<'py>,
    all: impl Iterator<Item = &'a Isometry3<f64>>,
) -> Bound<'py, PyArray3<f64>> {
    let numbers: Vec<f64> =
        all.flat_map(|iso| iso.to_homogeneous().transpose().as_slice().to_vec()).collect();
    let count = numbers.len() / 16;
    reshaped(py, numbers, [count, 4, 4])
}

/// The shape is that of as many numbers, always.
fn reshaped<'py, T: Element, const N: usize>(
    py: Python<'py>,
    numbers: Vec<T>,
    shape: [usize; N],
) -> Bound<'py, numpy::PyArray<T, numpy::ndarray::Dim<[usize; N]>>>
where
    numpy::ndarray::Dim<[usize; N]>: numpy::ndarray::Dimension,
    [usize; N]: numpy::ndarray::IntoDimension<Dim = numpy::ndarray::Dim<[usize; N]>>,
{
    let flat = PyArray1::from_vec(py, numbers);
    #[allow(clippy::expect_used, reason = "the vector has as many numbers as the shape")]
    flat.reshape(shape).expect("as many numbers")
}

/// An array of this type, or what it is instead.
fn array<'py, T: Element>(
    value: &Bound<'py, PyAny>,
    name: &str,
    wanted: &str,
) -> Result<PyReadonlyArray<'py, T, numpy::ndarray::IxDyn>> {
    if let Ok(array) = value.extract() {
        return Ok(array);
    }
    match value.cast::<PyUntypedArray>() {
        Ok(array) => bail!("{name}: {} of shape {:?}: give {wanted}", array.dtype(), array.shape()),
        Err(_) => bail!("{name}: {}: give {wanted}, a NumPy array", value.get_type()),
    }
}

/// All elements, row by row, whatever the strides.
fn row_by_row<T: Element + Copy>(array: &PyReadonlyArray<'_, T, numpy::ndarray::IxDyn>) -> Vec<T> {
    let view = array.as_array();
    // What lies so in memory is copied at once: a picture takes a tenth of the time.
    view.as_slice().map_or_else(|| view.iter().copied().collect(), <[T]>::to_vec)
}

/// Numbers of a small matrix: an array of any type of numbers, or nested lists of them.
fn matrix<const N: usize>(value: &Bound<'_, PyAny>, name: &str, side: usize) -> Result<[f64; N]> {
    let wanted = format!("a {side} x {side} matrix of numbers");
    let as_array = || -> PyResult<Option<Bound<'_, PyAny>>> {
        let array = value.py().import("numpy")?.call_method1("asarray", (value,))?;
        let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
        // Neither truth values, nor complex numbers, nor texts that look like numbers.
        if !["f", "i", "u"].contains(&kind.as_str()) {
            return Ok(None);
        }
        array.call_method1("astype", ("float64",)).map(Some)
    };
    let converted = as_array().ok().flatten().with_context(|| format!("{name}: give {wanted}"))?;
    let numbers = array::<f64>(&converted, name, &wanted)?;
    let view = numbers.as_array();
    ensure!(view.shape() == [side, side], "{name}: has shape {:?}: give {wanted}", view.shape());
    ensure!(view.iter().all(|x| x.is_finite()), "{name}: {view}: must be finite");
    let flat: Vec<f64> = view.iter().copied().collect();
    flat.try_into().ok().with_context(|| format!("{name}: give {wanted}"))
}

/// A pose from a 4 x 4 matrix: rotation row by row, translation in metres.
pub fn read_pose(value: &Bound<'_, PyAny>, name: &str) -> Result<([f64; 9], [f64; 3])> {
    let m: [f64; 16] = matrix(value, name, 4)?;
    ensure!(
        m[12..] == [0.0, 0.0, 0.0, 1.0],
        "{name}: its last row is {:?}: must be 0, 0, 0, 1 (columns are axes and the last one is metres)",
        &m[12..]
    );
    let rotation = std::array::from_fn(|i| m[4 * (i / 3) + i % 3]);
    Ok((rotation, [m[3], m[7], m[11]]))
}

/// The same as a transform.
pub fn read_isometry(value: &Bound<'_, PyAny>, name: &str) -> Result<Isometry3<f64>> {
    let (rotation, translation) = read_pose(value, name)?;
    bop::rigid(&rotation, &translation).map_err(|why| anyhow::anyhow!("{name}: {why}"))
}

/// A camera matrix of pictures of this size.
pub fn read_intrinsics(
    value: &Bound<'_, PyAny>,
    name: &str,
    width: usize,
    height: usize,
) -> Result<Intrinsics> {
    let [fx, skew, cx, a, fy, cy, b, c, one] = matrix::<9>(value, name, 3)?;
    ensure!(
        [skew, a, b, c] == [0.0; 4] && one == 1.0 && fx > 0.0 && fy > 0.0,
        "{name}: must be (fx, 0, cx; 0, fy, cy; 0, 0, 1) in pixels, fx and fy above 0"
    );
    Ok(Intrinsics { width, height, fx, fy, cx, cy })
}

/// Height x width x 3, uint8.
pub fn read_rgb(value: &Bound<'_, PyAny>, name: &str) -> Result<RgbImage> {
    const WANTED: &str = "height x width x 3, uint8, sRGB";
    let pixels = array::<u8>(value, name, WANTED)?;
    let view = pixels.as_array();
    let &[height, width, 3] = view.shape() else {
        bail!("{name}: has shape {:?}: give {WANTED}", view.shape())
    };
    ensure!(height > 0 && width > 0, "{name}: has no pixels");
    let bytes = row_by_row(&pixels);
    RgbImage::from_raw(width as u32, height as u32, bytes).with_context(|| format!("{name}: give {WANTED}"))
}

/// Height x width, float32 or float64, metres.
pub fn read_depth(value: &Bound<'_, PyAny>, name: &str) -> Result<DepthImage> {
    const WANTED: &str = "height x width, float32 or float64, metres along the optical axis, 0 where there is no reading \
         (of millimetres as uint16: depth.astype('float32') / 1000)";
    let pixels: PyReadonlyArray<'_, f32, _> =
        match value.extract::<PyReadonlyArray<'_, f64, numpy::ndarray::IxDyn>>() {
            Ok(double) => {
                let single = double.as_array().map(|z| *z as f32);
                numpy::PyArray::from_owned_array(value.py(), single).readonly()
            }
            Err(_) => array::<f32>(value, name, WANTED)?,
        };
    let view = pixels.as_array();
    let &[height, width] = view.shape() else { bail!("{name}: has shape {:?}: give {WANTED}", view.shape()) };
    let metres = row_by_row(&pixels);
    if let Some(z) = metres.iter().find(|z| !(z.is_finite() && **z >= 0.0)) {
        bail!("{name}: has a value of {z}: give {WANTED}");
    }
    DepthImage::from_vec(width, height, metres).with_context(|| format!("{name}: give {WANTED}"))
}
