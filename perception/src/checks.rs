//! Checks of settings. A message names the field, its value and its range: `epsilon_m = NaN: 0.0001 to 0.1 metres`.

use std::fmt::Display;
use std::ops::RangeInclusive;

/// What is wrong with settings, if anything.
pub(crate) type Checked = Result<(), String>;

/// Within a range, its ends included; `unit` is for the message, and empty for a plain number.
pub(crate) fn within<T: PartialOrd + Display>(
    field: &str,
    value: T,
    range: RangeInclusive<T>,
    unit: &str,
) -> Checked {
    if range.contains(&value) {
        return Ok(());
    }
    let (low, high) = (range.start(), range.end());
    let space = if unit.is_empty() { "" } else { " " };
    Err(format!("{field} = {value}: {low} to {high}{space}{unit}"))
}

/// Over 0 and finite.
pub(crate) fn positive(field: &str, value: impl Into<f64> + Display + Copy) -> Checked {
    let number: f64 = value.into();
    if number > 0.0 && number.is_finite() {
        return Ok(());
    }
    Err(format!("{field} = {value}: must be positive and finite"))
}

/// At least 0 and finite.
pub(crate) fn not_negative(field: &str, value: impl Into<f64> + Display + Copy) -> Checked {
    let number: f64 = value.into();
    if number >= 0.0 && number.is_finite() {
        return Ok(());
    }
    Err(format!("{field} = {value}: must be finite and not negative"))
}

/// Puts the name of a part before its fields: `support.inlier_m`.
pub(crate) fn part(name: &str, checked: Checked) -> Checked {
    checked.map_err(|problem| format!("{name}.{problem}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_name_field_value_and_range() {
        assert_eq!(within("share", 0.5, 0.0..=1.0, ""), Ok(()));
        let problem = part("support", within("inlier_m", f64::NAN, 0.001..=0.1, "metres"));
        assert_eq!(problem.unwrap_err(), "support.inlier_m = NaN: 0.001 to 0.1 metres");
        assert!(positive("weight", 0.0f32).unwrap_err().starts_with("weight = 0: must be positive"));
        assert!(not_negative("weight", 0.0).is_ok() && not_negative("weight", f64::INFINITY).is_err());
    }
}
