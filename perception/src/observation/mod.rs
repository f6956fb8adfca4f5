//! What the camera saw, prepared once a frame for all hypotheses of all objects: inverse depth, tolerance, plane weight
//! and silhouette evidence at strides 1, 2, 4 and 8.

mod edges;
mod level;
mod settings;
mod stride;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use grip_sim::camera::Intrinsics;
use grip_sim::frame::CameraFrame;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

pub use self::level::Level;
pub use self::settings::ObservationSettings;
pub use self::stride::Stride;

use self::edges::near_edges;
use self::level::{Sources, halved, level};
use crate::frame::is_reading;
use crate::support::{Plane, Support, Supports};
use crate::workspace::Workspace;

/// Inverse depth of pixels that another object explains: an occluder right before the lens.
const EXPLAINED: f32 = 20.0;

/// A plane for the kernels: unit normal and offset, metres, in the optical frame.
pub type FlatPlane = (Vector3<f32>, f32);

fn flat(plane: &Plane) -> FlatPlane {
    (plane.normal.into_inner().cast(), plane.offset as f32)
}

/// The frame at all resolutions, and the planes in it.
#[derive(Debug, Clone)]
pub struct Observation {
    /// Shared, so that what does not change is known by its address.
    levels: Vec<Arc<Level>>,
    /// What objects stand on, if anything was found.
    supports: Option<Supports>,
    /// The camera at full resolution.
    pub intrinsics: Intrinsics,
}

impl Observation {
    /// Prepares a frame. With a workspace only points in it can be an object's.
    pub fn new(frame: &CameraFrame, settings: &ObservationSettings, workspace: Option<&Workspace>) -> Self {
        let supports = Supports::fit(frame, &settings.support, workspace);
        let edges = near_edges(frame, settings);
        let inverse = |z: &f32| if is_reading(*z) { 1.0 / z } else { 0.0 };
        let inverse: Vec<f32> = frame.depth.data().iter().map(inverse).collect();
        // Blocks with an edge, each level from the one before.
        let size = [frame.intrinsics.width, frame.intrinsics.height];
        let mut near = vec![edges];
        for stride in &Stride::ALL[..Stride::ALL.len() - 1] {
            near.push(halved(&near[near.len() - 1], size.map(|side| side / stride.pixels())));
        }
        let sources = Sources { frame, inverse: &inverse, supports: supports.as_ref(), workspace, settings };
        let levels = Stride::ALL
            .par_iter()
            .zip(&near)
            .map(|(&stride, near)| Arc::new(level(&sources, stride, near)))
            .collect();
        Self { levels, supports, intrinsics: frame.intrinsics }
    }

    /// Puts everything on an endless plane.
    #[cfg(test)]
    pub(crate) fn stand_on(&mut self, plane: Plane) {
        self.supports = Some(Supports::endless(plane));
    }

    /// The lowest support plane, if one was found.
    pub fn plane(&self) -> Option<&Plane> {
        self.supports.as_ref().map(|supports| &supports.base().plane)
    }

    /// The same for the kernels.
    pub fn flat_plane(&self) -> Option<FlatPlane> {
        self.plane().map(flat)
    }

    /// The planes of all supports, the lowest first.
    pub fn flat_planes(&self) -> Vec<FlatPlane> {
        self.supports.iter().flat_map(Supports::all).map(|support| flat(&support.plane)).collect()
    }

    /// How much higher than the lowest plane, `base`, the ground is below something whose centre is at `centre`, metres.
    pub fn rise(&self, base: &FlatPlane, centre: &Vector3<f32>) -> f32 {
        if self.supports.as_ref().is_none_or(|supports| supports.higher().is_empty()) {
            return 0.0;
        }
        let height = |(normal, offset): &FlatPlane| normal.dot(centre) + offset;
        self.ground(centre).map_or(0.0, |ground| height(base) - height(&ground))
    }

    /// The support plane below something whose centre is at `centre`, optical frame, metres: the highest one that was seen there,
    /// else the lowest.
    pub fn ground(&self, centre: &Vector3<f32>) -> Option<FlatPlane> {
        let supports = self.supports.as_ref()?;
        let centre = Point3::from(centre.cast::<f64>());
        let below = |support: &&Support| {
            support.plane.height(&centre) > 0.0 && support.footprint.covers(&centre, 0.0)
        };
        let support = supports.higher().iter().rev().find(below).unwrap_or_else(|| supports.base());
        Some(flat(&support.plane))
    }

    /// The level of a stride.
    pub fn level(&self, stride: Stride) -> &Level {
        self.shared_level(stride)
    }

    /// The same, for who keeps what was made of it.
    pub(crate) fn shared_level(&self, stride: Stride) -> &Arc<Level> {
        &self.levels[stride as usize]
    }

    /// A copy in which the marked pixels of the level with stride 2 are taken: they count as occluders from now on.
    pub fn without(&self, explained: &[bool]) -> Self {
        let mut copy = self.clone();
        let marks = self.level(Stride::Two);
        for level in &mut copy.levels {
            let level = Arc::make_mut(level);
            for v in 0..level.height {
                for u in 0..level.width {
                    let at = |u: usize, v: usize| {
                        u < marks.width && v < marks.height && explained[marks.index(u as i32, v as i32)]
                    };
                    let taken = match level.stride.pixels() {
                        1 => at(u / 2, v / 2),
                        stride => {
                            let side = stride / 2;
                            let marked = |i: &usize| at(side * u + i % side, side * v + i / side);
                            2 * (0..side * side).filter(marked).count() >= side * side
                        }
                    };
                    if taken {
                        let i = level.index(u as i32, v as i32);
                        level.w[i] = EXPLAINED;
                        level.tol[i] = 1e-3;
                        level.weight[i] = 0.0;
                        level.edge[i] = 0.0;
                    }
                }
            }
        }
        copy
    }
}
