//! Where to put an object in the bin: height map minimisation (Wang and Hauser 2018).

mod height_map;
mod search;
mod settings;
mod support;

pub use height_map::{HeightMap, Profile};
pub use search::{PlacePose, PlaceWish, bin_map, outline_in_bin, place_poses, wished_places};
pub use settings::PlaceSettings;
