//! The rapier world: table and bin, the Fetch, and the objects. The only place that knows where things really are.
//!
//! Arm and body links are kinematic, posed by our own forward kinematics behind a servo model that respects velocity,
//! acceleration and joint limits; the two fingers are dynamic bodies on force-limited prismatic drives, so that grasps
//! hold by friction or do not hold. Nothing is ever welded or teleported once a trial has begun.
//!
//! | file | what it holds |
//! |---|---|
//! | `world.rs` | [`World`]: building, stepping, truth, state hash |
//! | `robot_body.rs` | links, fingers, servo model and grip law |
//! | `contacts.rs` | contact forces of the last step, by who touches whom |
//! | `placement.rs` | dropping objects on the table from a seed |
//! | `view.rs` | what the camera sees of the world |

mod contacts;
mod placement;
mod robot_body;
#[cfg(test)]
mod tests;
mod view;
mod world;

pub use contacts::{Body, FingerContact, ObjectContacts};
pub use placement::{Accept, Dropped, LaidOut, Placed, drop_objects};
pub use robot_body::{Grip, Stop};
pub use view::ROBOT_LABEL;
pub use world::{STEP_HZ, Settled, World};
