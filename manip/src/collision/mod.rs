//! Collision checks of a configuration against the believed scene, the robot itself and what it holds.

pub(crate) mod batch;
mod checker;
mod cloud;
mod cover;
mod piece;
mod query;
mod robot;
mod solid;
mod unmodelled;

pub use checker::CollisionChecker;
pub use cover::Ball;
pub use query::{CollisionBody, CollisionPair, CollisionQuery, HeldObject, InTheWay, Margins};
pub use robot::{CoverSummary, RobotSolids};
pub use unmodelled::{UnmodelledSettings, unmodelled_obstacles};
