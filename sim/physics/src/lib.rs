//! The rapier world: table and bin, the Fetch, and the objects. The only place that knows where things really are.
//!
//! Arm and body links are kinematic, posed by our own forward kinematics behind a servo model that respects velocity,
//! acceleration and joint limits; the two fingers are dynamic bodies on force-limited prismatic drives, so that grasps
//! hold by friction or do not hold. Nothing is ever welded or teleported once a trial has begun.
//!
//! Perception and planning must not know the truth, so `grip-perception` and `grip-manip` never depend on this crate.
//!
//! | file | what it holds |
//! |---|---|
//! | `world` | [`World`]: building, stepping, truth, state hash |
//! | `robot_body` | links, fingers, servo model and grip law |
//! | `blows` | what an object is struck with |
//! | `contacts` | contact forces of the last step, by who touches whom |
//! | `faces` | hulls that touch with their whole faces |
//! | `pads` | what a soft pad's patch holds |
//! | `placement` | dropping objects on the table from a seed |
//! | `settings` | the numbers that decide results |
//! | `view` | what the camera sees of the world |

mod blows;
#[cfg(test)]
mod closed_forms;
mod contacts;
mod error;
mod faces;
mod pads;
mod placement;
mod robot_body;
mod settings;
#[cfg(test)]
mod tests;
mod view;
mod world;

pub use contacts::{Body, BodyContact, ObjectContacts};
pub use error::{Error, Result};
pub use placement::{Accept, Dropped, LaidOut, drop_objects};
pub use robot_body::{Grip, Stop};
pub use settings::{
    FingerSettings, LayoutSettings, ObjectSettings, PhysicsSettings, PlacementSettings, ServoSettings,
    SolverSettings, StopSettings,
};
pub use view::ROBOT_LABEL;
pub use world::{Placed, STEP_HZ, Settled, World};
