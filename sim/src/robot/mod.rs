//! The robot model: read from a URDF, immutable, with its kinematics.
