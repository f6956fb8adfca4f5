//! What a data set says of its surroundings.

use std::path::Path;

use grip_perception::SupportSettings;

use crate::settings::Settings;

/// Settings for the images of a data set: where up is in the world is known of our own sets alone, others leave the world's
/// axes open.
pub fn for_dataset(mut settings: Settings, dataset: &Path) -> Settings {
    if !dataset.join("dataset.json").is_file() {
        let perception = &mut settings.perception;
        let supports = [
            &mut perception.detector.clusters.support,
            &mut perception.grip.observation.support,
            &mut perception.paper.support,
            &mut perception.paper_guarded.support,
        ];
        supports.into_iter().for_each(|support| support.max_tilt_rad = SupportSettings::ANY_TILT);
    }
    settings
}
