//! The surface that objects stand on: its plane, and how far it was seen to reach.

mod footprint;
mod plane;
mod settings;

pub use self::footprint::Footprint;
pub use self::plane::{Plane, Support, fit_support_plane};
pub use self::settings::SupportSettings;
