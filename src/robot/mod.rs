//! Whether a robot fits its cell: its named poses, what it reaches, what it can grasp; and how it looks.

mod check;
mod draw;

pub use check::{ObjectCheck, PoseCheck, RobotCheck, check};
pub use draw::portrait;
