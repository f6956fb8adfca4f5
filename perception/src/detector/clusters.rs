//! The detector `clusters`: whatever stands on the support plane and hangs together in depth is a candidate for every
//! object. It needs no training and knows no classes; telling them apart is left to the second stage.

use std::sync::Arc;

use grip_sim::frame::CameraFrame;
use grip_sim::objects::ObjectModel;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::detections::{Detection, Detections, Detector};
use crate::checks::{Checked, part, within};
use crate::error::{Error, Result};
use crate::frame::{check_frame, is_reading};
use crate::support::{SupportSettings, Supports};
use crate::workspace::Workspace;

/// Settings of [`Clusters`]. Figures in brackets are the defaults.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ClusterSettings {
    /// Points up to this height over the plane are the plane's, metres, 0 to 1 (0.008): over the noise at 1 m, under the
    /// marker's 18 mm.
    pub min_height_m: f64,
    /// Points higher than this over the plane are no groceries, metres, 0.01 to 10 (0.5).
    pub max_height_m: f64,
    /// Neighbouring pixels whose depth differs by more belong to different clusters, metres, 0.0001 to 1 (0.015: three times
    /// the noise at 1 m and a slanted surface).
    pub jump_m: f64,
    /// Pixels this far apart are neighbours still, 1 to 100 (3): thin holes do not split a cluster.
    pub reach_px: usize,
    /// Clusters with fewer pixels are noise, 1 or more (30): 30 pixels are 3 cm² at 1 m.
    pub min_pixels: usize,
    /// How the support plane is found; switched off, everything with a reading may be an object's.
    pub support: SupportSettings,
}

impl Default for ClusterSettings {
    fn default() -> Self {
        Self {
            min_height_m: 0.008,
            max_height_m: 0.5,
            jump_m: 0.015,
            reach_px: 3,
            min_pixels: 30,
            support: SupportSettings::default(),
        }
    }
}

impl ClusterSettings {
    /// What is wrong with a value, if anything: its field, the value and the range.
    ///
    /// # Errors
    /// That, for the first such field.
    pub fn validate(&self) -> Checked {
        within("min_height_m", self.min_height_m, 0.0..=1.0, "metres")?;
        within("max_height_m", self.max_height_m, 0.01..=10.0, "metres")?;
        within("jump_m", self.jump_m, 1e-4..=1.0, "metres")?;
        within("reach_px", self.reach_px, 1..=100, "pixels")?;
        within("min_pixels", self.min_pixels, 1..=1_000_000, "pixels")?;
        part("support", self.support.validate())
    }
}

/// Depth clusters above the support plane, each a class-agnostic box with the same confidence for every object. Where
/// nothing is found, the whole image is the one box.
#[derive(Debug, Clone, Default)]
pub struct Clusters {
    settings: ClusterSettings,
    workspace: Option<Workspace>,
}

impl Clusters {
    /// With these settings, everywhere.
    ///
    /// # Errors
    /// [`Error::Setting`] for a value out of range.
    pub fn new(settings: ClusterSettings) -> Result<Self> {
        settings.validate().map_err(Error::Setting)?;
        Ok(Self { settings, workspace: None })
    }

    /// Of points in `workspace` alone.
    #[must_use]
    pub fn within(mut self, workspace: Workspace) -> Self {
        self.workspace = Some(workspace);
        self
    }

    /// The boxes `[u0, v0, u1, v1]` of all clusters, largest first.
    ///
    /// # Errors
    /// When the frame is not usable.
    pub fn boxes(&self, frame: &CameraFrame) -> Result<Vec<[f64; 4]>> {
        check_frame(frame)?;
        let foreground = self.foreground(frame);
        Ok(self.components(&foreground, frame.intrinsics.width))
    }

    /// Depth of the pixels that may be an object's, 0 elsewhere.
    fn foreground(&self, frame: &CameraFrame) -> Vec<f32> {
        let s = &self.settings;
        let supports = Supports::fit(frame, &s.support, self.workspace.as_ref());
        let (k, depth) = (&frame.intrinsics, &frame.depth);
        let mut out = depth.data().to_vec();
        for (i, z) in out.iter_mut().enumerate() {
            let p = k.back_project((i % k.width) as f64, (i / k.width) as f64, f64::from(*z));
            let keep = is_reading(*z)
                && supports.as_ref().is_none_or(|supports| {
                    let height = supports.height(&p, s.min_height_m);
                    height.is_some_and(|height| (s.min_height_m..s.max_height_m).contains(&height))
                })
                && self.workspace.is_none_or(|w| w.contains(&frame.world_from_camera.transform_point(&p)));
            if !keep {
                *z = 0.0;
            }
        }
        out
    }

    /// Connected components by union-find over pixels, each with its last foreground pixel to the left and above.
    fn components(&self, depth: &[f32], width: usize) -> Vec<[f64; 4]> {
        let mut parent: Vec<u32> = (0..depth.len() as u32).collect();
        let connected = |a: f32, b: f32| (a - b).abs() < self.settings.jump_m as f32;
        for i in 0..depth.len() {
            if depth[i] == 0.0 {
                continue;
            }
            let (u, v) = (i % width, i / width);
            for gap in 1..=self.settings.reach_px {
                if gap <= u && depth[i - gap] > 0.0 {
                    if connected(depth[i], depth[i - gap]) {
                        union(&mut parent, i as u32, (i - gap) as u32);
                    }
                    break;
                }
            }
            for gap in 1..=self.settings.reach_px {
                if gap <= v && depth[i - gap * width] > 0.0 {
                    if connected(depth[i], depth[i - gap * width]) {
                        union(&mut parent, i as u32, (i - gap * width) as u32);
                    }
                    break;
                }
            }
        }
        // Roots are the smallest index of their component, so clusters come out in scan order.
        let mut found: Vec<(usize, [f64; 4])> = Vec::new();
        let mut slot = vec![u32::MAX; depth.len()];
        for (i, &z) in depth.iter().enumerate() {
            if z == 0.0 {
                continue;
            }
            let root = find(&mut parent, i as u32) as usize;
            if slot[root] == u32::MAX {
                slot[root] = found.len() as u32;
                found.push((0, [f64::MAX, f64::MAX, f64::MIN, f64::MIN]));
            }
            let (count, b) = &mut found[slot[root] as usize];
            let (u, v) = ((i % width) as f64, (i / width) as f64);
            *count += 1;
            *b = [b[0].min(u), b[1].min(v), b[2].max(u), b[3].max(v)];
        }
        found.retain(|(count, _)| *count >= self.settings.min_pixels);
        found.sort_by_key(|(count, _)| std::cmp::Reverse(*count));
        found.into_iter().map(|(_, b)| b).collect()
    }
}

fn find(parent: &mut [u32], mut i: u32) -> u32 {
    while parent[i as usize] != i {
        parent[i as usize] = parent[parent[i as usize] as usize];
        i = parent[i as usize];
    }
    i
}

fn union(parent: &mut [u32], a: u32, b: u32) {
    let (a, b) = (find(parent, a), find(parent, b));
    let (low, high) = (a.min(b), a.max(b));
    parent[high as usize] = low;
}

impl Detector for Clusters {
    fn name(&self) -> &'static str {
        "clusters"
    }

    fn detect(&self, frame: &CameraFrame, objects: &[Arc<ObjectModel>]) -> Result<Detections> {
        let mut boxes = self.boxes(frame)?;
        if boxes.is_empty() {
            boxes.push([0.0, 0.0, frame.intrinsics.width as f64 - 1.0, frame.intrinsics.height as f64 - 1.0]);
        }
        let confidence = 1.0;
        let mut detections = Detections::new();
        for object in objects {
            if detections.of(&object.info.name).is_empty() {
                for &bbox in &boxes {
                    detections.push(&object.info.name, Detection { bbox, confidence })?;
                }
            }
        }
        Ok(detections)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn separates_by_depth_and_looks_through_thin_holes() {
        let (width, height) = (40, 20);
        let mut depth = vec![0.0f32; width * height];
        let mut paint = |u: std::ops::Range<usize>, v: std::ops::Range<usize>, z: f32| {
            for y in v {
                for x in u.clone() {
                    depth[y * width + x] = z;
                }
            }
        };
        paint(2..20, 3..15, 0.9); // one object,
        paint(9..11, 3..15, 0.0); // with a thin hole,
        paint(20..30, 5..12, 0.95); // one 5 cm behind that touches it in the image,
        paint(35..37, 1..3, 0.9); // and four pixels of noise.
        let boxes = Clusters::default().components(&depth, width);
        assert_eq!(boxes, [[2.0, 3.0, 19.0, 14.0], [20.0, 5.0, 29.0, 11.0]]);
    }
}
