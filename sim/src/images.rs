//! Image types. Pixel (u, v) is column u, row v from the top left; data is row-major. Pixel centres are at integers + 0.5
//! in continuous image coordinates minus 0.5, that is: the ray of pixel (u, v) goes through image point (u, v) of the
//! intrinsics' convention (OpenCV, BOP).

pub use image::RgbImage;

/// A row-major image of `T`.
#[derive(Debug, Clone, PartialEq)]
pub struct Image<T> {
    width: usize,
    height: usize,
    data: Vec<T>,
}

/// Distance along the optical axis in metres. Exactly `0.0` means: no reading.
pub type DepthImage = Image<f32>;
/// Instance labels: 0 is nothing; what other numbers mean is told by the scene that was rendered.
pub type LabelImage = Image<u16>;
/// Linear-light RGB radiance, before exposure.
pub type RadianceImage = Image<[f32; 3]>;

impl<T: Clone> Image<T> {
    /// An image of one value.
    pub fn filled(width: usize, height: usize, value: T) -> Self {
        Self { width, height, data: vec![value; width * height] }
    }

    /// From row-major data; `None` unless `data.len() == width * height`.
    pub fn from_vec(width: usize, height: usize, data: Vec<T>) -> Option<Self> {
        (data.len() == width * height).then_some(Self { width, height, data })
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The pixel at column `u`, row `v`.
    ///
    /// # Panics
    /// Outside the image, as slices do.
    pub fn at(&self, u: usize, v: usize) -> &T {
        &self.data[v * self.width + u]
    }

    /// The pixel at column `u`, row `v`, to be changed.
    ///
    /// # Panics
    /// Outside the image, as slices do.
    pub fn at_mut(&mut self, u: usize, v: usize) -> &mut T {
        &mut self.data[v * self.width + u]
    }

    /// All pixels, row after row.
    pub fn data(&self) -> &[T] {
        &self.data
    }

    /// All pixels, row after row, without the image.
    pub fn into_data(self) -> Vec<T> {
        self.data
    }

    /// All pixels, row after row, to be changed.
    pub fn data_mut(&mut self) -> &mut [T] {
        &mut self.data
    }
}
