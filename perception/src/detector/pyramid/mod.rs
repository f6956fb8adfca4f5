//! PyramidCNN, GRIP's first stage: a convolutional network looks at an image pyramid, and its heat maps are boxes for every
//! object. There is no threshold anywhere (Chen et al. 2019, section Object Detection).
//!
//! One forward pass a level gives, for every cell of 8 by 8 pixels, the probability of each object (and of none), and of seven aspect ratios.
//! A cell's position, its level's size and the aspect ratio are a box, the object's probability is its confidence; see
//! [`HeatMaps`].
//!
//! The network is an ONNX file, run by ort: by tract, in Rust, unless `ORT_DYLIB_PATH` names a native ONNX Runtime. Two are built
//! in ([`BuiltInNetwork`]): `perception/models/pyramid-base.onnx` and `pyramid-varied.onnx`; the pages beside them say how they
//! were made and what they are worth.

mod description;
mod exported;
mod heatmaps;
mod rehearsal;
mod runtime;
mod settings;
#[cfg(test)]
mod tests;

use std::fmt;
use std::path::Path;
use std::sync::Arc;

use fast_image_resize::images::{TypedImage, TypedImageRef};
use fast_image_resize::pixels::U8x3;
use fast_image_resize::{FilterType, ResizeAlg, ResizeOptions, Resizer};
use grip_sim::files;
use grip_sim::frame::CameraFrame;
use grip_sim::images::RgbImage;
use grip_sim::objects::ObjectModel;
use rayon::prelude::*;

pub use description::{DetectorDescription, KnownObject};
pub use heatmaps::{HeatMap, HeatMaps};
pub use runtime::Providers;
pub use settings::PyramidSettings;

use crate::detector::detections::{Detection, Detections, Detector};
use crate::error::{Error, Result};
use crate::frame::check_frame;
use runtime::Network;

/// The networks that are built in. They differ in the pictures that they were trained on.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum BuiltInNetwork {
    /// What the paper trains on: objects apart from each other, in base light.
    Base,
    /// Every light, heaps, things that are no objects, and another camera for each picture.
    #[default]
    Varied,
}

impl BuiltInNetwork {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Base, Self::Varied];

    /// As on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Base => "base",
            Self::Varied => "varied",
        }
    }

    /// The ONNX file and its description.
    fn files(self) -> (&'static [u8], &'static str) {
        match self {
            Self::Base => (
                include_bytes!("../../../models/pyramid-base.onnx"),
                include_str!("../../../models/pyramid-base.json"),
            ),
            Self::Varied => (
                include_bytes!("../../../models/pyramid-varied.onnx"),
                include_str!("../../../models/pyramid-varied.json"),
            ),
        }
    }
}

/// The first stage of GRIP.
#[derive(Debug)]
pub struct PyramidCnn {
    description: Arc<DetectorDescription>,
    network: Network,
    settings: PyramidSettings,
}

impl PyramidCnn {
    /// A network that is built in.
    ///
    /// # Errors
    /// When the runtime cannot be started: `ORT_DYLIB_PATH` names no ONNX Runtime, or a provider is not there.
    pub fn built_in(which: BuiltInNetwork, providers: &Providers) -> Result<Self> {
        let (model, description) = which.files();
        let shown = format!("the built-in detector `{}`", which.name());
        let description = DetectorDescription::parse(description, &shown)?;
        let network = Network::load(model, &shown, &description, providers, true)?;
        Ok(Self { description: Arc::new(description), network, settings: PyramidSettings::default() })
    }

    /// The network of an ONNX file; a description of the same name, ending in `.json`, must lie beside it.
    ///
    /// Input `image`: float (1, 3, height, width), RGB in 0 to 1, any size. Outputs, cells of `stride_px` pixels each: `classes`,
    /// (1, 1 + objects, rows, columns), background first, and `shapes`, (1, aspect ratios, rows, columns); both sum to 1 over the second axis.
    ///
    /// # Errors
    /// When a file is missing or broken, or inputs and outputs are not as above and as the description says.
    pub fn open(path: &Path, providers: &Providers) -> Result<Self> {
        let shown = path.display().to_string();
        let bytes = files::read(path).map_err(|e| Error::Detector(e.to_string()))?;
        let folder = path.parent().unwrap_or(Path::new("."));
        let model = exported::whole(&bytes, folder).map_err(|e| Error::Detector(format!("{shown}: {e}")))?;
        let beside = path.with_extension("json");
        let text = files::read_to_string(&beside).map_err(|e| {
            Error::Detector(format!(
                "{e}; a detector needs its description beside it, as perception/models/pyramid-varied.json is"
            ))
        })?;
        let description = DetectorDescription::parse(&text, &beside.display().to_string())?;
        let network = Network::load(&model, &shown, &description, providers, false)?;
        Ok(Self { description: Arc::new(description), network, settings: PyramidSettings::default() })
    }

    /// With these settings.
    ///
    /// # Errors
    /// [`Error::Setting`] for a value out of range.
    pub fn with_settings(mut self, settings: PyramidSettings) -> Result<Self> {
        settings.validate().map_err(Error::Setting)?;
        self.settings = settings;
        Ok(self)
    }

    /// What the network was made for.
    pub fn description(&self) -> &DetectorDescription {
        &self.description
    }

    /// Who runs it, such as `tract` or `ONNX Runtime (cpu)`.
    pub fn runtime(&self) -> &str {
        self.network.runtime()
    }

    /// The heat maps of an image, finest level first.
    ///
    /// # Errors
    /// When the image has less than two cells in its coarsest level, or the network fails.
    pub fn look(&self, image: &RgbImage) -> Result<HeatMaps> {
        let (width, height) = (image.width() as usize, image.height() as usize);
        let levels = self.levels(width, height);
        if levels.is_empty() {
            return Err(Error::Frame(format!(
                "the image is {width}x{height} pixels, too small to detect anything in; give one of at least 100x100"
            )));
        }
        let maps: Vec<HeatMap> = levels
            .into_par_iter()
            .map(|(w, h)| {
                let (classes, shapes) = self.network.run(planes(image, w, h)?, w, h)?;
                let scale = [w as f64 / width as f64, h as f64 / height as f64];
                let (rows, columns) = (h / self.description.stride_px, w / self.description.stride_px);
                Ok(HeatMap { scale, rows, columns, classes, shapes })
            })
            .collect::<Result<_>>()?;
        let size = [width as f64, height as f64];
        let (description, settings) = (Arc::clone(&self.description), self.settings.clone());
        Ok(HeatMaps { size, maps, description, settings })
    }

    /// Width and height of each level of the pyramid of an image, pixels, finest first.
    fn levels(&self, width: usize, height: usize) -> Vec<(usize, usize)> {
        let longest = self.settings.coarsest_share * width.max(height) as f64;
        let stride = self.description.stride_px;
        (0..)
            .map(|level| self.settings.side_px(level))
            .take_while(|side| *side <= longest)
            .map(|side| {
                let scale = self.description.side_px / side;
                ((width as f64 * scale).round() as usize, (height as f64 * scale).round() as usize)
            })
            .take_while(|(w, h)| *w.min(h) >= 2 * stride)
            .collect()
    }

    /// The network's class of an object, from 1: that of its name, or, where a data set names objects by number, that of its
    /// number if it is as large.
    ///
    /// # Errors
    /// When the network does not know the object.
    pub fn class_of(&self, object: &ObjectModel) -> Result<usize> {
        self.description.class_of(object)
    }

    /// [`class_of`](Self::class_of); none of an object that the network does not know.
    ///
    /// # Errors
    /// When the object has the number of another one that the network knows.
    pub fn knows(&self, object: &ObjectModel) -> Result<Option<usize>> {
        self.description.knows(object)
    }
}

impl fmt::Display for PyramidCnn {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {} in {}", self.description.name, self.network.fingerprint(), self.runtime())
    }
}

impl Detector for PyramidCnn {
    fn name(&self) -> &'static str {
        "pyramid"
    }

    fn detect(&self, frame: &CameraFrame, objects: &[Arc<ObjectModel>]) -> Result<Detections> {
        check_frame(frame)?;
        let (k, rgb) = (&frame.intrinsics, &frame.rgb);
        let size = (rgb.width() as usize, rgb.height() as usize);
        if size != (k.width, k.height) {
            return Err(Error::Frame(format!(
                "the colour image is {}x{} pixels but the intrinsics say {}x{}; the detector needs colour that is registered to depth (without colour, use the detector clusters)",
                size.0, size.1, k.width, k.height
            )));
        }
        // Several instances of an object are found in the same boxes.
        let mut wanted: Vec<(&str, usize)> = Vec::new();
        for object in objects {
            if wanted.iter().all(|(name, _)| *name != object.info.name) {
                wanted.push((&object.info.name, self.class_of(object)?));
            }
        }
        let maps = self.look(rgb)?;
        let found: Vec<Vec<Detection>> = wanted.par_iter().map(|(_, class)| maps.boxes(*class)).collect();
        let mut detections = Detections::new();
        for ((name, _), boxes) in wanted.iter().zip(found) {
            for detection in boxes {
                detections.push(name, detection)?;
            }
        }
        Ok(detections)
    }
}

/// An image at another size, as planes of red, green and blue in 0 to 1. The filter is a triangle as wide as a pixel of the smaller image, which
/// is what training pictures are made with (Pillow's `BILINEAR`).
fn planes(image: &RgbImage, width: usize, height: usize) -> Result<Vec<f32>> {
    let failed = |e: &dyn std::fmt::Display| Error::Frame(format!("cannot resize the image: {e}"));
    // Typed: otherwise the code of all kinds of pixels is compiled, which was half of this crate.
    let source = TypedImageRef::<U8x3>::from_buffer(image.width(), image.height(), image.as_raw())
        .map_err(|e| failed(&e))?;
    let mut target = TypedImage::<U8x3>::new(width as u32, height as u32);
    let options = ResizeOptions::new().resize_alg(ResizeAlg::Convolution(FilterType::Bilinear));
    Resizer::new().resize_typed(&source, &mut target, &options).map_err(|e| failed(&e))?;
    let pixels = target.pixels();
    Ok((0..3).flat_map(|c| pixels.iter().map(move |pixel| f32::from(pixel.0[c]) / 255.0)).collect())
}
