//! Motion planning problems of others, and how they are solved.

mod moveit;
mod solve;

pub use moveit::{MotionProblem, ProblemError, find_problems, load_problem};
pub use solve::{ProblemResult, ProblemStatus};
