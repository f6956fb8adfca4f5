//! The surfaces that objects stand on: their planes, and how far they were seen to reach.

mod footprint;
mod plane;
mod settings;

pub use self::footprint::Footprint;
pub use self::plane::{Plane, Support, Supports};
pub use self::settings::SupportSettings;

#[cfg(test)]
pub(crate) use self::plane::tests::stepped;
