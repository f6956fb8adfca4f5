//! Manipulation.
pub mod rrt;
pub mod smooth;
pub mod space;
pub mod timing;
