//! Object models of sturdy things of 0.3 kg. All sizes in metres, about the origin.

use std::sync::Arc;

use grip_sim::mesh::{Material, Mesh, Visual};
use grip_sim::objects::{Fragility, ObjectInfo, ObjectModel};
use grip_sim::shape::{CollisionShape, Convex};
use nalgebra::{Isometry3, Vector3};

use crate::meshes::{can, cuboid};

/// What the table of objects would say: number 1, 0.3 kg, friction 0.5, no declared symmetry.
pub fn info(name: &str) -> ObjectInfo {
    ObjectInfo {
        name: name.to_owned(),
        bop_id: 1,
        mass_kg: 0.3,
        friction: 0.5,
        symmetric: false,
        fragility: Fragility::Sturdy,
        upright: false,
        revolution: None,
        half_turns: vec![],
    }
}

/// An object of a plain grey mesh, without a collision shape: for cameras alone.
pub fn object(name: &str, mesh: Mesh) -> Arc<ObjectModel> {
    solid(name, mesh, vec![])
}

/// An object of a plain grey mesh, and of convex pieces for contacts.
pub fn solid(name: &str, mesh: Mesh, pieces: Vec<CollisionShape>) -> Arc<ObjectModel> {
    let visual = Visual { mesh: Arc::new(mesh), material: Material::default() };
    Arc::new(ObjectModel::new(info(name), visual, pieces))
}

/// A box of full extents `size`.
pub fn box_object(name: &str, size: [f32; 3]) -> Arc<ObjectModel> {
    let half = Vector3::from(size.map(f64::from)) * 0.5;
    solid(name, cuboid(size), vec![piece(Convex::Cuboid { half })])
}

/// A can about z with 64 sides.
pub fn can_object(name: &str, radius: f32, height: f32) -> Arc<ObjectModel> {
    let shape = Convex::Cylinder { half_height: 0.5 * f64::from(height), radius: f64::from(radius) };
    solid(name, can(radius, height, 64), vec![piece(shape)])
}

/// One convex piece in the object's own frame.
fn piece(geometry: Convex) -> CollisionShape {
    CollisionShape { pose: Isometry3::identity(), geometry }
}
