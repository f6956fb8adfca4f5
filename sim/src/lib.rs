//! The simulated side of GRIP: what exists, where it is, and what a camera sees of it.
//!
//! | module | what it holds |
//! |---|---|
//! | [`pose`] | rigid transforms that carry their frames in their type |
//! | [`mesh`], [`shape`] | triangle meshes with materials; convex collision shapes |
//! | [`objects`] | the 21 YCB-Video objects, built in or scanned, and objects of one's own |
//! | [`robot`] | the robot model read from a URDF, and its kinematics |
//! | [`scene`] | scene files: table, bin, robot placement, objects |
//! | [`files`] | files of the project: on disk, or built into the program |
//! | [`names`] | names that were mistyped |
//! | [`range`] | numbers in files that may be ranges to draw from |
//! | [`camera`], [`images`], [`frame`] | pinhole cameras, image types, and the frame that perception gets |
//! | [`bop`] | data sets in the format of the BOP challenge, read and written |
//! | [`convert`] | our geometry as parry's |
//! | [`gpu`], [`lanes`] | opening a graphics adapter; eight floats at a time on the CPU |
//! | [`render`], [`sensor`], [`condition`] | renderers (wgpu and CPU), depth and colour noise, scripted conditions |
//!
//! The physics world, and with it the truth about where objects are, is a crate of its own: `grip-physics`.
//!
//! Units are SI, angles radians, frames right-handed with z up in the world; see [`pose`] for the frames.

pub mod bop;
pub mod cache;
pub mod calibration;
pub mod camera;
pub mod condition;
pub mod convert;
pub mod error;
pub mod files;
pub mod frame;
pub mod gpu;
pub mod images;
pub mod lanes;
pub mod mesh;
pub mod names;
pub mod objects;
pub mod pictures;
mod polygon;
pub mod pose;
pub mod range;
pub mod render;
pub mod rng;
pub mod robot;
pub mod scene;
pub mod sensor;
pub mod shape;
pub mod unfinished;

pub use error::{Error, Result};
