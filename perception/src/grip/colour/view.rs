//! Picture and depth image at the resolution at which an object is compared.

use nalgebra::Isometry3;

use super::agreement::{Agreement, Prepared};
use super::picture::Picture;
use super::sheet::Sheet;
use crate::grip::settings::ColourSettings;
use crate::model::Print;
use crate::observation::{Observation, Stride};

/// The points of a print are at most so many pixels apart, that no pixel is left out; so an object has 1000 to 4000 pixels.
const APART: f32 = 0.8;
/// A sketch is made of one point in so many, and half as large.
const SKETCHED: usize = 4;

/// The picture and depth image for one object.
pub(super) struct View<'a> {
    print: &'a Print,
    picture: &'a Picture,
    observation: &'a Observation,
    stride: Stride,
    /// Of sketches.
    coarse: Stride,
    /// How far colour and depth image may be apart, pixels of the picture.
    most_shift: f32,
}

impl<'a> View<'a> {
    /// For an object about at `pose`; `None` where that is behind the camera.
    pub fn new(
        print: &'a Print,
        pose: &Isometry3<f32>,
        observation: &'a Observation,
        picture: &'a Picture,
        settings: &ColourSettings,
    ) -> Option<Self> {
        let distance = pose.translation.vector.z;
        if distance.is_nan() || distance <= 0.0 {
            return None;
        }
        let scale = observation.intrinsics.fx as f32 / distance;
        let fits = |stride: &Stride| print.spacing * scale / stride.pixels() as f32 <= APART;
        let stride = Stride::ALL.into_iter().find(fits).unwrap_or(Stride::Eight);
        let coarse = Stride::ALL[(stride as usize + 1).min(Stride::ALL.len() - 1)];
        Some(Self { print, picture, observation, stride, coarse, most_shift: settings.most_shift_px })
    }

    /// How the print at a pose agrees with the picture; `None` where nothing of it is seen.
    pub fn agreement(&self, pose: &Isometry3<f32>) -> Option<Agreement> {
        if self.coarse == self.stride {
            return self.compared(pose, self.stride, 1, None);
        }
        // Where a sketch agrees best the drawing does, to a pixel of either side.
        let about = self.sketched(pose)?.shift.map(|d| 2 * d);
        self.compared(pose, self.stride, 1, Some(about))
    }

    /// The same, roughly and quickly.
    pub fn sketched(&self, pose: &Isometry3<f32>) -> Option<Agreement> {
        self.compared(pose, self.coarse, SKETCHED, None)
    }

    /// Of one point in `every`; at a shift near one that is known, or at any.
    fn compared(
        &self,
        pose: &Isometry3<f32>,
        stride: Stride,
        every: usize,
        about: Option<[i32; 2]>,
    ) -> Option<Agreement> {
        let most = self.most_shift / stride.pixels() as f32;
        let (about, reach) =
            about.map_or(([0, 0], most.ceil() as i32), |about| (about, i32::from(most > 0.0)));
        let sheet = Sheet::draw(self.print, pose, self.observation.level(stride), every)?;
        Some(Prepared::new(sheet)?.agreement(self.picture.level(stride), about, reach, most))
    }
}
