//! `scene_gt_info.json`: what is measured of an instance's silhouette and visible part.

use super::format::GtInfo;
use crate::camera::Intrinsics;
use crate::images::{DepthImage, Image};
use crate::mesh::Mesh;
use crate::pose::{Camera, Object, Pose};
use crate::render::silhouette;
use crate::{Error, Result};

/// An instance's counts and boxes, as the toolkit's `calc_gt_info` takes them.
///
/// `silhouette` is the object as if it were alone, on a canvas that may be larger than the image: its pixel (0, 0) is the
/// image's pixel `offset` = [column, row] (the toolkit renders on three times the image's size, that is
/// `[-width, -height]`). `visible` is the seen part and `depth` the depth picture, metres, 0 for no reading; both of the
/// image's size.
///
/// Boxes are `[x, y, width, height]` with width and height the largest less the smallest index, so that a single pixel has
/// width 0: the toolkit's convention (`calc_2d_bbox`), one less than COCO's. Both are `[-1; 4]` where nothing is visible,
/// also that of the silhouette. (The toolkit finds the visible part by comparing depths within 15 mm; ours comes from the
/// renderer's labels and is exact.)
///
/// # Errors
/// When `visible` and `depth` differ in size.
pub fn gt_info(
    silhouette: &Image<bool>,
    offset: [i32; 2],
    visible: &Image<bool>,
    depth: &DepthImage,
) -> Result<GtInfo> {
    let (width, height) = (depth.width(), depth.height());
    if (visible.width(), visible.height()) != (width, height) {
        return Err(Error::invalid(
            "mask_visib",
            format!("is {}x{}, but the depth picture {width}x{height}", visible.width(), visible.height()),
        ));
    }
    let has_reading = |[u, v]: [i32; 2]| {
        let inside = |value: i32, end: usize| usize::try_from(value).ok().filter(|&value| value < end);
        inside(u, width).zip(inside(v, height)).is_some_and(|(u, v)| *depth.at(u, v) > 0.0)
    };
    let (mut whole, mut seen, mut px_count_valid) = (Extent::default(), Extent::default(), 0);
    for [u, v] in pixels(silhouette) {
        let at = [u + offset[0], v + offset[1]];
        whole.add(at);
        px_count_valid += u64::from(has_reading(at));
    }
    pixels(visible).for_each(|at| seen.add(at));
    let visib_fract = if whole.count > 0 { seen.count as f64 / whole.count as f64 } else { 0.0 };
    Ok(GtInfo {
        bbox_obj: if seen.count > 0 { whole.bbox() } else { [-1; 4] },
        bbox_visib: seen.bbox(),
        px_count_all: whole.count,
        px_count_valid,
        px_count_visib: seen.count,
        visib_fract,
    })
}

/// A surface counts as seen when it is no farther behind the measured one than this along its ray, metres: the toolkit's.
pub const VISIBLE_M: f64 = 0.015;

/// The same of an object at a pose in a picture that others took: what is seen of it is found by comparing depths, as the toolkit
/// does. Where nothing was measured nothing hides. Nothing is seen of what is behind the camera or far out of the image.
///
/// # Errors
/// When intrinsics and depth picture differ in size.
pub fn estimated_gt_info(
    mesh: &Mesh,
    camera_from_object: &Pose<Camera, Object>,
    depth: &DepthImage,
    intrinsics: &Intrinsics,
) -> Result<GtInfo> {
    let (width, height) = (depth.width(), depth.height());
    let mut visible = Image::filled(width, height, false);
    let Some(outline) = silhouette(mesh, camera_from_object, intrinsics) else {
        return gt_info(&Image::filled(0, 0, false), [0, 0], &visible, depth);
    };
    for [x, y] in pixels(&outline.mask) {
        let inside = |at: i32, end: usize| usize::try_from(at).ok().filter(|at| *at < end);
        let (u, v) = (inside(x + outline.offset[0], width), inside(y + outline.offset[1], height));
        let Some((u, v)) = u.zip(v) else { continue };
        let rendered = 1.0 / f64::from(*outline.inverse_depth.at(x as usize, y as usize));
        let measured = f64::from(*depth.at(u, v));
        let ray = intrinsics.back_project(u as f64, v as f64, 1.0).coords.norm();
        // Written so that NaN is a hole.
        *visible.at_mut(u, v) = !(measured > 0.0 && (rendered - measured) * ray > VISIBLE_M);
    }
    gt_info(&outline.mask, outline.offset, &visible, depth)
}

/// Columns and rows of the pixels that are set.
fn pixels(mask: &Image<bool>) -> impl Iterator<Item = [i32; 2]> {
    let width = mask.width().max(1);
    mask.data().chunks(width).enumerate().flat_map(|(v, row)| {
        row.iter().enumerate().filter(|(_, set)| **set).map(move |(u, _)| [u as i32, v as i32])
    })
}

/// Number and bounds of pixels.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Extent {
    count: u64,
    low: [i32; 2],
    high: [i32; 2],
}

impl Extent {
    /// Of the pixels of `mask` that are set.
    pub(super) fn of(mask: &Image<bool>) -> Self {
        let mut extent = Self::default();
        pixels(mask).for_each(|at| extent.add(at));
        extent
    }

    pub(super) fn count(&self) -> u64 {
        self.count
    }

    fn add(&mut self, at: [i32; 2]) {
        if self.count == 0 {
            (self.low, self.high) = (at, at);
        }
        for (i, value) in at.into_iter().enumerate() {
            self.low[i] = self.low[i].min(value);
            self.high[i] = self.high[i].max(value);
        }
        self.count += 1;
    }

    /// The toolkit's box: `[-1; 4]` for nothing.
    pub(super) fn bbox(&self) -> [i32; 4] {
        if self.count == 0 {
            return [-1; 4];
        }
        [self.low[0], self.low[1], self.high[0] - self.low[0], self.high[1] - self.low[1]]
    }

    /// COCO's box, whose width and height count pixels; `None` for nothing.
    pub(super) fn coco_bbox(&self) -> Option<[i32; 4]> {
        let [x, y, width, height] = self.bbox();
        (self.count > 0).then_some([x, y, width + 1, height + 1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An image of `size` with the rectangle of columns and rows `from..to` set.
    fn rectangle(size: [usize; 2], from: [usize; 2], to: [usize; 2]) -> Image<bool> {
        let mut mask = Image::filled(size[0], size[1], false);
        for v in from[1]..to[1] {
            (from[0]..to[0]).for_each(|u| *mask.at_mut(u, v) = true);
        }
        mask
    }

    #[test]
    fn a_free_object_is_counted_in_closed_form() {
        let mask = rectangle([20, 16], [3, 4], [9, 12]);
        let mut depth = DepthImage::filled(20, 16, 1.0);
        for u in 0..20 {
            *depth.at_mut(u, 5) = 0.0;
        }
        let info = gt_info(&mask, [0, 0], &mask, &depth).unwrap();
        assert_eq!(info.bbox_obj, [3, 4, 5, 7]);
        assert_eq!(info.bbox_visib, info.bbox_obj);
        assert_eq!((info.px_count_all, info.px_count_valid, info.px_count_visib), (48, 42, 48));
        assert_eq!(info.visib_fract, 1.0);
        let point = rectangle([20, 16], [7, 7], [8, 8]);
        assert_eq!(gt_info(&point, [0, 0], &point, &depth).unwrap().bbox_obj, [7, 7, 0, 0]);
    }

    #[test]
    fn a_truncated_object_counts_what_lies_outside() {
        // On a canvas of three times the image, 10 columns of the object left of it and 6 in it, 2 rows above.
        let canvas = rectangle([60, 48], [10, 14], [26, 20]);
        let visible = rectangle([20, 16], [0, 0], [3, 4]);
        let info = gt_info(&canvas, [-20, -16], &visible, &DepthImage::filled(20, 16, 0.7)).unwrap();
        assert_eq!(info.bbox_obj, [-10, -2, 15, 5]);
        assert_eq!(info.bbox_visib, [0, 0, 2, 3]);
        assert_eq!((info.px_count_all, info.px_count_valid, info.px_count_visib), (96, 24, 12));
        assert_eq!(info.visib_fract, 0.125);
    }

    #[test]
    fn hidden_and_absent_objects_have_no_boxes() {
        let nothing = Image::filled(20, 16, false);
        let depth = DepthImage::filled(20, 16, 1.0);
        let hidden = gt_info(&rectangle([20, 16], [3, 4], [9, 12]), [0, 0], &nothing, &depth).unwrap();
        assert_eq!((hidden.bbox_obj, hidden.bbox_visib), ([-1; 4], [-1; 4]));
        assert_eq!((hidden.px_count_all, hidden.px_count_valid, hidden.visib_fract), (48, 48, 0.0));
        let absent = gt_info(&nothing, [0, 0], &nothing, &depth).unwrap();
        assert_eq!((absent.px_count_all, absent.visib_fract, absent.bbox_obj), (0, 0.0, [-1; 4]));
        assert!(gt_info(&nothing, [0, 0], &Image::filled(8, 8, false), &depth).is_err());
    }
}
