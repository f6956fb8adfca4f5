//! The built-in objects: for each YCB-Video object a model made in code, of the scanned object's size and axes, with a
//! label of our own design.
//!
//! Sizes are those of the YCB object list and of the scans in the YCB-Video data set of BOP (their bounding boxes).

mod banana;
mod bottles;
mod boxes;
mod cans;
mod canvas;
mod clamps;
mod lofts;
mod solids;
#[cfg(test)]
mod tests;
mod tools;
mod vessels;

use std::sync::Arc;

use nalgebra::{Point3, Translation3};

use crate::mesh::{Material, Mesh, Visual};
use crate::shape::CollisionShape;

/// A model made in code. The mesh is closed, and the centre of its bounding box is the origin.
#[derive(Debug, Clone)]
pub struct BuiltIn {
    /// Mesh, material and texture.
    pub visual: Visual,
    /// Convex pieces that make up the solid.
    pub collision: Vec<CollisionShape>,
}

impl BuiltIn {
    /// A model of a mesh, the texture on it, its roughness (0 to 1, where the mesh has no finish of its own) and the pieces
    /// of its solid.
    fn new(
        mesh: Mesh,
        texture: Arc<image::RgbImage>,
        roughness: f32,
        collision: Vec<CollisionShape>,
    ) -> Self {
        let material = Material { base_color: [1.0; 3], roughness, metallic: 0.0, texture: Some(texture) };
        let visual = Visual { mesh: Arc::new(mesh), material };
        Self { visual, collision }
    }

    /// Moves mesh and solid so that the centre of the mesh's bounding box is the origin.
    fn centered(mut self) -> Self {
        let mesh = Arc::make_mut(&mut self.visual.mesh);
        let start = Point3::from([f32::MAX; 3]);
        let low = mesh.positions.iter().fold(start, |m, p| m.inf(p));
        let high = mesh.positions.iter().fold(-start, |m, p| m.sup(p));
        let center = nalgebra::center(&low, &high).coords;
        for p in &mut mesh.positions {
            *p -= center;
        }
        let back = Translation3::from(-center.cast::<f64>());
        for shape in &mut self.collision {
            shape.pose = back * shape.pose;
        }
        self
    }
}

/// The built-in model of a YCB name such as `003_cracker_box`; `None` for a name that has none.
pub(super) fn build(name: &str) -> Option<BuiltIn> {
    boxes::build(name)
        .or_else(|| cans::build(name))
        .or_else(|| bottles::build(name))
        .or_else(|| banana::build(name))
        .or_else(|| vessels::build(name))
        .or_else(|| tools::build(name))
        .or_else(|| clamps::build(name))
        .map(BuiltIn::centered)
}
