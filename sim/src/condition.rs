//! Scripted conditions (`scenes/conditions/*.toml`): light, exposure and clutter as data.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::render::Lighting;

/// How objects are put on the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Placement {
    /// Apart from each other.
    Spread,
    /// Close together, leaning on and lying over each other.
    Stacked,
}

/// How far the colour camera may go to get a bright picture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExposureLimits {
    /// Longest exposure, seconds: 1/30 at 30 frames a second.
    pub max_time_s: f64,
    /// Largest gain, 1 or more.
    pub max_gain: f64,
}

impl Default for ExposureLimits {
    fn default() -> Self {
        Self { max_time_s: 1.0 / 30.0, max_gain: 8.0 }
    }
}

/// One condition. Positions in it are in the world frame of a scene whose robot stands at the origin and looks along +x
/// at a table about 0.75 m away.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Condition {
    /// The file's name without `.toml`.
    #[serde(default)]
    pub name: String,
    /// For people.
    #[serde(default)]
    pub description: String,
    /// How objects are put on the table.
    pub placement: Placement,
    /// The light in the room.
    pub lighting: Lighting,
    /// Limits of the colour camera.
    #[serde(default)]
    pub exposure: ExposureLimits,
}

impl Condition {
    /// Reads a condition file.
    ///
    /// # Errors
    /// When the file cannot be read, or a field is unknown, missing or out of range; the message names file, field and
    /// value.
    pub fn load(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(|source| Error::io(path, source))?;
        let mut condition: Self = toml::from_str(&text)
            .map_err(|error| Error::invalid(path, error.to_string().trim().to_owned()))?;
        if let Some(problem) = condition.problem() {
            return Err(Error::invalid(path, problem));
        }
        if condition.name.is_empty() {
            condition.name = stem(path);
        }
        Ok(condition)
    }

    /// Reads the condition called `name` in folder `dir`, for example `base` in `scenes/conditions`.
    ///
    /// # Errors
    /// As [`Condition::load`]; an unknown name lists those present.
    pub fn load_named(dir: &Path, name: &str) -> Result<Self> {
        let known = Self::names(dir)?;
        if !known.iter().any(|k| k == name) {
            return Err(Error::invalid(
                dir,
                format!("no condition '{name}' here; there are: {}", known.join(", ")),
            ));
        }
        Self::load(&dir.join(format!("{name}.toml")))
    }

    /// The names of the conditions in folder `dir`, sorted.
    ///
    /// # Errors
    /// When the folder cannot be read.
    pub fn names(dir: &Path) -> Result<Vec<String>> {
        let mut names = Vec::new();
        for entry in std::fs::read_dir(dir).map_err(|source| Error::io(dir, source))? {
            let path = entry.map_err(|source| Error::io(dir, source))?.path();
            if path.extension().is_some_and(|e| e == "toml") {
                names.push(stem(&path));
            }
        }
        names.sort();
        Ok(names)
    }

    /// What is wrong with these numbers, if anything: field, value and range.
    pub fn problem(&self) -> Option<String> {
        if let Some(problem) = self.lighting.problem() {
            return Some(format!("lighting.{problem}"));
        }
        let ExposureLimits { max_time_s, max_gain } = self.exposure;
        if !(max_time_s.is_finite() && (1e-5..=10.0).contains(&max_time_s)) {
            return Some(format!("exposure.max_time_s = {max_time_s}: must be 1e-5 to 10 seconds"));
        }
        if !(max_gain.is_finite() && (1.0..=1000.0).contains(&max_gain)) {
            return Some(format!("exposure.max_gain = {max_gain}: must be 1 to 1000"));
        }
        None
    }
}

fn stem(path: &Path) -> String {
    path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    fn shipped() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/conditions")
    }

    fn error_of(text: &str) -> String {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("odd.toml");
        std::fs::write(&path, text).unwrap();
        let error = Condition::load(&path).unwrap_err().to_string();
        assert!(error.contains("odd.toml"), "{error}");
        error
    }

    #[test]
    fn shipped_conditions_load_and_survive_being_saved() {
        let names = Condition::names(&shipped()).unwrap();
        for name in ["base", "dark", "light-left", "light-right", "clutter"] {
            assert!(names.iter().any(|n| n == name), "{name} is missing");
        }
        for name in names {
            let condition = Condition::load_named(&shipped(), &name).unwrap();
            assert_eq!(condition.name, name);
            assert!(!condition.description.is_empty());
            let text = toml::to_string(&condition).unwrap();
            assert_eq!(toml::from_str::<Condition>(&text).unwrap(), condition);
        }
    }

    #[test]
    fn conditions_are_what_their_names_say() {
        let load = |name| Condition::load_named(&shipped(), name).unwrap();
        assert_eq!(load("clutter").placement, Placement::Stacked);
        assert_eq!(load("clutter").lighting, load("base").lighting);
        assert!(load("dark").lighting.lights.is_empty());
        assert!((0.5..=3.0).contains(&load("dark").lighting.ambient_lux));
        // The robot looks along +x, so its left is +y.
        assert!(load("light-left").lighting.lights[0].position.y > 0.5);
        assert!(load("light-right").lighting.lights[0].position.y < -0.5);
    }

    #[test]
    fn errors_name_file_field_and_value() {
        let good = "placement = \"spread\"\n[lighting]\nambient_lux = 5.0\n";
        let light = |fields: &str| {
            error_of(&format!(
                "{good}[[lighting.lights]]\nposition = [0, 0, 2]\ntarget = [1, 0, 0]\n{fields}"
            ))
        };
        assert!(light("intensity_cd = -3.0").contains("lights[0].intensity_cd = -3"));
        assert!(light("intensity_cd = 3.0\nhalf_angle = 9.0").contains("half_angle = 9"));
        assert!(light("intensity_cd = 3.0\ncolour = [1, 1, 1]").contains("colour"));
        assert!(error_of("placement = \"spread\"\n[lighting]\nambient_lux = nan").contains("ambient_lux"));
        assert!(error_of("placement = \"heaped\"\n[lighting]\nambient_lux = 1").contains("heaped"));
        assert!(
            error_of(&format!("{good}[exposure]\nmax_time_s = 0\nmax_gain = 2")).contains("max_time_s = 0")
        );
        let five =
            "[[lighting.lights]]\nposition = [0, 0, 2]\ntarget = [1, 0, 0]\nintensity_cd = 1\n".repeat(5);
        assert!(error_of(&format!("{good}{five}")).contains("at most 4"));
        assert!(error_of("placement = ").contains("odd.toml"));
    }

    #[test]
    fn an_unknown_name_lists_those_present() {
        let error = Condition::load_named(&shipped(), "foggy").unwrap_err().to_string();
        assert!(error.contains("foggy") && error.contains("light-left"), "{error}");
        assert!(Condition::load_named(Path::new("/nowhere"), "base").is_err());
    }
}
