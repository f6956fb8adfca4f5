//! Ranges of settings: which field is out of its range, in words.

use std::fmt::Display;
use std::ops::RangeInclusive;

/// The first problem found, if any.
#[derive(Debug, Default)]
pub(crate) struct Ranges(Option<String>);

impl Ranges {
    /// A number, which must be within `range`: NaN and the infinities are not.
    pub fn number(self, field: &str, value: f64, range: RangeInclusive<f64>, unit: &str) -> Self {
        self.check(field, value, range, unit)
    }

    /// A list of numbers, each within `range`, and at least one.
    pub fn numbers(mut self, field: &str, values: &[f64], range: RangeInclusive<f64>, unit: &str) -> Self {
        if values.is_empty() {
            self.0.get_or_insert_with(|| format!("{field} is empty; it needs at least one value ({unit})"));
        }
        values.iter().enumerate().fold(self, |ranges, (i, value)| {
            ranges.check(&format!("{field}[{i}]"), *value, range.clone(), unit)
        })
    }

    /// A count.
    pub fn count(self, field: &str, value: usize, range: RangeInclusive<usize>) -> Self {
        self.check(field, value, range, "a whole number")
    }

    /// A part of the settings with what [`Ranges::result`] said of it.
    pub fn part(mut self, field: &str, result: Result<(), String>) -> Self {
        if let Err(problem) = result {
            self.0.get_or_insert_with(|| format!("{field}.{problem}"));
        }
        self
    }

    /// What is wrong, if anything.
    pub fn result(self) -> Result<(), String> {
        self.0.map_or(Ok(()), Err)
    }

    fn check<T: PartialOrd + Display>(
        mut self,
        field: &str,
        value: T,
        range: RangeInclusive<T>,
        unit: &str,
    ) -> Self {
        if !range.contains(&value) {
            let (low, high) = range.into_inner();
            self.0.get_or_insert_with(|| {
                format!("{field} is {value}, out of its range from {low} to {high} ({unit})")
            });
        }
        self
    }
}
