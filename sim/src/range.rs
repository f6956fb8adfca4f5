//! A number that a file gives exactly, or as the range that it is drawn from; and the check that a number is in a range.

use std::borrow::Cow;
use std::fmt;

use rand::{Rng, RngExt};
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::{self, Deserializer, MapAccess, Visitor};
use serde::ser::{SerializeMap, Serializer};
use serde::{Deserialize, Serialize};

/// Whether the number `value` of `field` is one from `low` to `high`.
///
/// # Errors
/// When it is not: field, value and range.
pub fn within(field: &str, value: f64, low: f64, high: f64) -> std::result::Result<(), String> {
    // NaN is in no range.
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(format!("{field} = {value}: must be a finite number from {low} to {high}"))
}

/// Written `0.3`, or `{ min = 0.2, max = 0.4 }` for a number drawn evenly from between.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// The smallest value.
    pub min: f64,
    /// The largest value.
    pub max: f64,
}

impl Range {
    /// Always `value`.
    pub const fn exactly(value: f64) -> Self {
        Self { min: value, max: value }
    }

    /// A value from the range. Draws one number, however narrow the range, so that editing one range of a file does not
    /// move the values of the others.
    pub fn draw(&self, rng: &mut impl Rng) -> f64 {
        self.min + (self.max - self.min) * rng.random::<f64>()
    }

    /// What is wrong with it, if anything; the caller adds the field.
    pub fn problem(&self) -> Option<String> {
        (!(self.min.is_finite() && self.max.is_finite() && self.min <= self.max)).then(|| {
            format!("{{ min = {}, max = {} }}: must be finite, min no larger than max", self.min, self.max)
        })
    }
}

impl Serialize for Range {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.min == self.max {
            return serializer.serialize_f64(self.min);
        }
        let mut map = serializer.serialize_map(Some(2))?;
        map.serialize_entry("min", &self.min)?;
        map.serialize_entry("max", &self.max)?;
        map.end()
    }
}

impl<'de> Deserialize<'de> for Range {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(RangeVisitor)
    }
}

/// In files.
#[derive(JsonSchema)]
#[serde(untagged)]
#[expect(dead_code, reason = "the schema alone")]
enum RangeFile {
    /// Exactly this.
    Exactly(f64),
    /// Drawn evenly from here.
    #[schemars(extend("additionalProperties" = false))]
    Between {
        /// At least.
        min: f64,
        /// At most.
        max: f64,
    },
}

impl JsonSchema for Range {
    fn schema_name() -> Cow<'static, str> {
        "Range".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        RangeFile::json_schema(generator)
    }
}

struct RangeVisitor;

impl<'de> Visitor<'de> for RangeVisitor {
    type Value = Range;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number, or a range { min = .., max = .. }")
    }

    fn visit_f64<E: de::Error>(self, value: f64) -> Result<Range, E> {
        Ok(Range::exactly(value))
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<Range, E> {
        Ok(Range::exactly(value as f64))
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<Range, E> {
        Ok(Range::exactly(value as f64))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Range, A::Error> {
        let (mut min, mut max) = (None, None);
        while let Some(key) = map.next_key::<String>()? {
            let slot = match key.as_str() {
                "min" => &mut min,
                "max" => &mut max,
                other => return Err(de::Error::unknown_field(other, &["min", "max"])),
            };
            if slot.replace(map.next_value::<f64>()?).is_some() {
                return Err(de::Error::custom(format!("`{key}` stands twice")));
            }
        }
        let min = min.ok_or_else(|| de::Error::missing_field("min"))?;
        let max = max.ok_or_else(|| de::Error::missing_field("max"))?;
        Ok(Range { min, max })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct File {
        a: Range,
        b: Range,
        c: [Range; 2],
    }

    #[test]
    fn numbers_and_ranges_are_read_and_written_back() {
        let text = "a = 1\nb = { min = -0.5, max = 2.0 }\nc = [0.25, { min = 0, max = 1 }]\n"
            .replace("0, max = 1 ", "0.0, max = 1.0 ");
        let file: File = toml::from_str(&text).unwrap();
        assert_eq!(file.a, Range::exactly(1.0));
        assert_eq!(file.b, Range { min: -0.5, max: 2.0 });
        assert_eq!(toml::from_str::<File>(&toml::to_string(&file).unwrap()).unwrap(), file);
        for (bad, wanted) in [
            ("a = \"x\"", "a number, or a range"),
            ("a = { min = 1.0 }", "max"),
            ("a = { min = 1.0, max = 2.0, mean = 1.5 }", "mean"),
        ] {
            let error = toml::from_str::<File>(bad).unwrap_err().to_string();
            assert!(error.contains(wanted), "{error}");
        }
        assert!(Range { min: 2.0, max: 1.0 }.problem().is_some());
        assert!(Range { min: f64::NAN, max: 1.0 }.problem().is_some());
    }

    #[test]
    fn values_fill_the_range() {
        let mut rng = crate::rng::stream(1, "range");
        let range = Range { min: 2.0, max: 3.0 };
        let values: Vec<f64> = (0..1000).map(|_| range.draw(&mut rng)).collect();
        assert!(values.iter().all(|v| (2.0..3.0).contains(v)));
        let mean = values.iter().sum::<f64>() / 1000.0;
        assert!((mean - 2.5).abs() < 0.03, "{mean}");
        assert_eq!(Range::exactly(7.0).draw(&mut rng), 7.0);
    }
}
