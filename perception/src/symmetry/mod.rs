//! Symmetries of objects as depth sees them.
//!
//! `oriented_box` finds the axes about which an object may look like itself, `group` the rotations that keep its convex hull (its
//! symmetry group, as far as the hull tells), `near` the motions after which its surface nearly lies on itself. The filter
//! compares a result with its near-symmetries by depth, and with the group by colour. What an evaluation holds for equal is
//! another matter: data sets declare it, see [`grip_sim::bop::Symmetries`] and [`crate::metrics::SymmetricShape`].

mod group;
mod near;
mod oriented_box;

pub(crate) use self::group::{SymmetryGroup, turned_about};
pub(crate) use self::near::near_symmetries;
pub(crate) use self::oriented_box::oriented_box;
