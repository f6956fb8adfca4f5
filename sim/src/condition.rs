//! Scripted conditions (`scenes/conditions/*.toml`): light, exposure and clutter as data, in numbers or ranges of them.

use std::path::Path;

use nalgebra::Vector3;
use rand::Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::calibration::CalibrationError;
use crate::error::{Error, Result};
use crate::files;
use crate::names;
use crate::range::{Range, within};
use crate::render::{Light, Lighting};

/// How objects are put on the table.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Placement {
    /// Apart from each other.
    #[default]
    Spread,
    /// Close together, leaning on and lying over each other.
    Stacked(Clutter),
}

/// How cluttered objects are.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Clutter {
    /// Share of the region, in each direction, on which they are dropped: the smaller, the higher. Above 0, up to 1.
    pub patch: f64,
    /// Share of the objects that may lie that are dropped lying on a side, 0 to 1.
    pub lying_fraction: f64,
    /// Share of the objects that must touch another one in the end, 0 to 1.
    pub touching: f64,
}

/// How far the colour camera may go to get a bright picture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
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

/// What objects really are beside what the table of objects says: shares of it, of which each object draws its own. The robot knows the
/// table.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TrueObjects {
    /// Of its mass, 0.1 to 10.
    #[serde(default = "same")]
    pub mass: Range,
    /// Of its friction, 0 to 4.
    #[serde(default = "same")]
    pub friction: Range,
}

fn same() -> Range {
    Range::exactly(1.0)
}

impl TrueObjects {
    /// Mass and friction of the next object, as shares of what the table says.
    pub fn draw(&self, rng: &mut impl Rng) -> [f64; 2] {
        [self.mass.draw(rng), self.friction.draw(rng)]
    }

    fn problem(&self) -> Option<String> {
        for (field, range, least, most) in
            [("mass", self.mass, 0.1, 10.0), ("friction", self.friction, 0.0, 4.0)]
        {
            if let Some(problem) = range.problem() {
                return Some(format!("objects.{field} = {problem}"));
            }
            if let Err(problem) =
                [range.min, range.max].into_iter().try_for_each(|end| within(field, end, least, most))
            {
                return Some(format!("objects.{problem}"));
            }
        }
        None
    }
}

/// One condition, every number drawn. Positions in it are in the world frame of a scene whose robot stands at the origin
/// and looks along +x at a table about 0.75 m away.
#[derive(Debug, Clone, PartialEq, Default, Serialize, JsonSchema)]
pub struct Condition {
    /// The file's name without `.toml`.
    pub name: String,
    /// How objects are put on the table.
    pub placement: Placement,
    /// The light in the room.
    pub lighting: Lighting,
    /// Limits of the colour camera.
    pub exposure: ExposureLimits,
    /// Where objects are not what the table says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub objects: Option<TrueObjects>,
    /// Where the robot is not what it believes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibration_error: Option<CalibrationError>,
}

/// A condition as written in its file: numbers of the light may be ranges, from which each run draws its own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ConditionSpec {
    /// The file's name without `.toml`.
    #[serde(default)]
    pub name: String,
    /// For people.
    #[serde(default)]
    pub description: String,
    /// How objects are put on the table.
    pub placement: Placement,
    /// The light in the room.
    pub lighting: LightingSpec,
    /// Limits of the colour camera.
    #[serde(default)]
    pub exposure: ExposureLimits,
    /// Where objects are not what the table says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub objects: Option<TrueObjects>,
    /// Where the robot is not what it believes, in trials.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration_error: Option<CalibrationError>,
}

/// [`Lighting`] with ranges.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LightingSpec {
    /// See [`Lighting::ambient_lux`].
    pub ambient_lux: Range,
    /// See [`Lighting::ambient_color`].
    #[serde(default = "white")]
    pub ambient_color: [Range; 3],
    /// See [`Lighting::lights`].
    #[serde(default)]
    pub lights: Vec<LightSpec>,
}

/// [`Light`] with ranges.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LightSpec {
    /// See [`Light::position`].
    pub position: [Range; 3],
    /// See [`Light::target`].
    pub target: [Range; 3],
    /// See [`Light::intensity_cd`].
    pub intensity_cd: Range,
    /// See [`Light::color`].
    #[serde(default = "white")]
    pub color: [Range; 3],
    /// See [`Light::radius`].
    #[serde(default = "point")]
    pub radius: Range,
    /// See [`Light::half_angle`].
    #[serde(default = "everywhere")]
    pub half_angle: Range,
    /// See [`Light::shadows`].
    #[serde(default = "yes")]
    pub shadows: bool,
}

fn white() -> [Range; 3] {
    [Range::exactly(1.0); 3]
}

fn point() -> Range {
    Range::exactly(0.0)
}

fn everywhere() -> Range {
    Range::exactly(std::f64::consts::PI)
}

fn yes() -> bool {
    true
}

impl LightSpec {
    fn resolve(&self, mut pick: impl FnMut(&Range) -> f64) -> Light {
        let mut three = |ranges: &[Range; 3]| [0, 1, 2].map(|i: usize| pick(&ranges[i]));
        Light {
            position: Vector3::from(three(&self.position)),
            target: Vector3::from(three(&self.target)),
            color: three(&self.color),
            intensity_cd: pick(&self.intensity_cd),
            radius: pick(&self.radius),
            half_angle: pick(&self.half_angle),
            shadows: self.shadows,
        }
    }

    fn ranges(&self) -> impl Iterator<Item = (&'static str, &Range)> {
        let vectors = [("position", &self.position), ("target", &self.target), ("color", &self.color)];
        let single = [
            ("intensity_cd", &self.intensity_cd),
            ("radius", &self.radius),
            ("half_angle", &self.half_angle),
        ];
        vectors
            .into_iter()
            .flat_map(|(name, ranges)| ranges.iter().map(move |range| (name, range)))
            .chain(single)
    }
}

impl ConditionSpec {
    /// Reads a condition file.
    ///
    /// # Errors
    /// When the file cannot be read, or a field is unknown, missing or out of range; the message names file, field and
    /// value.
    pub fn load(path: &Path) -> Result<Self> {
        let text = files::read_to_string(path)?;
        let mut condition: Self = files::from_toml(&text).map_err(|message| Error::invalid(path, message))?;
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
    /// As [`ConditionSpec::load`]; an unknown name lists those present.
    pub fn load_named(dir: &Path, name: &str) -> Result<Self> {
        let known = Self::names(dir)?;
        if !known.iter().any(|k| k == name) {
            return Err(Error::invalid(
                dir,
                format!(
                    "no condition '{name}' here; there are: {}{}",
                    known.join(", "),
                    names::suggestion(known.iter().map(String::as_str), name)
                ),
            ));
        }
        Self::load(&dir.join(format!("{name}.toml")))
    }

    /// The names of the conditions in folder `dir`, sorted.
    ///
    /// # Errors
    /// When the folder cannot be read.
    pub fn names(dir: &Path) -> Result<Vec<String>> {
        let files = files::list(dir)?;
        let conditions = files.iter().filter(|path| path.extension().is_some_and(|e| e == "toml"));
        let mut names: Vec<String> = conditions.map(|path| stem(path)).collect();
        names.sort();
        Ok(names)
    }

    /// The condition of one run.
    pub fn draw(&self, rng: &mut impl Rng) -> Condition {
        self.resolve(|range| range.draw(rng))
    }

    fn resolve(&self, mut pick: impl FnMut(&Range) -> f64) -> Condition {
        let LightingSpec { ambient_lux, ambient_color, lights } = &self.lighting;
        Condition {
            name: self.name.clone(),
            placement: self.placement,
            lighting: Lighting {
                ambient_lux: pick(ambient_lux),
                ambient_color: [0, 1, 2].map(|i: usize| pick(&ambient_color[i])),
                lights: lights.iter().map(|light| light.resolve(&mut pick)).collect(),
            },
            exposure: self.exposure,
            objects: self.objects,
            calibration_error: self.calibration_error,
        }
    }

    /// What is wrong with these numbers, if anything: field, value and range.
    pub fn problem(&self) -> Option<String> {
        let LightingSpec { ambient_lux, ambient_color, lights } = &self.lighting;
        let ambient = std::iter::once(("ambient_lux", ambient_lux))
            .chain(ambient_color.iter().map(|range| ("ambient_color", range)));
        for (field, range) in ambient {
            if let Some(problem) = range.problem() {
                return Some(format!("lighting.{field} = {problem}"));
            }
        }
        for (i, light) in lights.iter().enumerate() {
            for (field, range) in light.ranges() {
                if let Some(problem) = range.problem() {
                    return Some(format!("lighting.lights[{i}].{field} = {problem}"));
                }
            }
        }
        if let Some(problem) = self.calibration_error.and_then(|error| error.problem("calibration_error")) {
            return Some(problem);
        }
        if let Some(problem) = self.objects.and_then(|objects| objects.problem()) {
            return Some(problem);
        }
        // Whatever is drawn lies between these two.
        for end in [|range: &Range| range.min, |range: &Range| range.max] {
            if let Some(problem) = self.resolve(end).lighting.problem() {
                return Some(format!("lighting.{problem}"));
            }
        }
        if let Placement::Stacked(Clutter { patch, lying_fraction, touching }) = self.placement {
            if !(patch > 0.0 && patch <= 1.0) {
                return Some(format!("placement.stacked.patch = {patch}: must be above 0 and at most 1"));
            }
            for (field, share) in [("lying_fraction", lying_fraction), ("touching", touching)] {
                if !(0.0..=1.0).contains(&share) {
                    return Some(format!("placement.stacked.{field} = {share}: must be 0 to 1"));
                }
            }
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
        let error = ConditionSpec::load(&path).unwrap_err().to_string();
        assert!(error.contains("odd.toml"), "{error}");
        error
    }

    #[test]
    fn shipped_conditions_load_and_survive_being_saved() {
        let names = ConditionSpec::names(&shipped()).unwrap();
        for name in ["base", "dark", "light-left", "light-right", "clutter-1", "clutter-2", "clutter-3"] {
            assert!(names.iter().any(|n| n == name), "{name} is missing");
        }
        for name in names {
            let condition = ConditionSpec::load_named(&shipped(), &name).unwrap();
            assert_eq!(condition.name, name);
            assert!(!condition.description.is_empty());
            let text = toml::to_string(&condition).unwrap();
            assert_eq!(toml::from_str::<ConditionSpec>(&text).unwrap(), condition);
        }
    }

    #[test]
    fn the_built_in_conditions_are_those_on_disk() {
        let folder = files::builtin_path("scenes/conditions");
        assert_eq!(ConditionSpec::names(&folder).unwrap(), ConditionSpec::names(&shipped()).unwrap());
        for name in ConditionSpec::names(&folder).unwrap() {
            let load = |folder: &Path| ConditionSpec::load_named(folder, &name).unwrap();
            assert_eq!(load(&folder), load(&shipped()));
        }
    }

    #[test]
    fn conditions_are_what_their_names_say() {
        let load = |name| ConditionSpec::load_named(&shipped(), name).unwrap();
        let base = load("base");
        for name in ["clutter-1", "clutter-2", "clutter-3"] {
            assert!(matches!(load(name).placement, Placement::Stacked(_)));
            assert_eq!(load(name).lighting, base.lighting, "{name}");
        }
        let dark = load("dark").lighting;
        assert!(dark.lights.is_empty() && dark.ambient_lux.min > 0.1 && dark.ambient_lux.max < 5.0);
        // The robot looks along +x, so its left is +y.
        assert!(load("light-left").lighting.lights[0].position[1].min > 0.5);
        assert!(load("light-right").lighting.lights[0].position[1].max < -0.5);
    }

    #[test]
    fn each_seed_draws_its_own_light_from_the_ranges() {
        let spec = ConditionSpec::load_named(&shipped(), "base").unwrap();
        let draw = |seed| spec.draw(&mut crate::rng::stream(seed, "condition"));
        assert_eq!(draw(1), draw(1));
        assert_ne!(draw(1).lighting, draw(2).lighting);
        for seed in 0..100 {
            let lighting = draw(seed).lighting;
            assert_eq!(lighting.problem(), None);
            let range = spec.lighting.ambient_lux;
            assert!((range.min..=range.max).contains(&lighting.ambient_lux));
        }
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
        assert!(
            light("intensity_cd = { min = 5.0, max = 3.0 }")
                .contains("lights[0].intensity_cd = { min = 5, max = 3 }")
        );
        assert!(light("intensity_cd = { min = -5.0, max = 3.0 }").contains("lights[0].intensity_cd = -5"));
        let stacked = "placement = { stacked = { patch = 0.0, lying_fraction = 0.5, touching = 0.5 } }\n[lighting]\nambient_lux = 1";
        assert!(error_of(stacked).contains("stacked.patch = 0"));
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
        let error = ConditionSpec::load_named(&shipped(), "foggy").unwrap_err().to_string();
        assert!(error.contains("foggy") && error.contains("light-left"), "{error}");
        assert!(ConditionSpec::load_named(Path::new("/nowhere"), "base").is_err());
    }
}
