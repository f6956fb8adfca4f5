//! TOML as a type, all of it.

use serde::de::DeserializeOwned;

use crate::names;

/// TOML text as a type.
///
/// # Errors
/// The parser's, with the place in the text; and for a list that is longer than its field, which the parser cuts without a word. Of a name
/// that there is not, the nearest is told.
pub fn from_toml<T: DeserializeOwned>(text: &str) -> Result<T, String> {
    let value: T = toml::from_str(text).map_err(|error| {
        let message = error.to_string().trim_end().to_owned();
        let nearest = names::suggestion_in(&message);
        message + &nearest
    })?;
    // Read again as a tree: from one, errors would not tell their place in the text.
    let tree: toml::Table = toml::from_str(text).map_err(|error| error.to_string())?;
    lists_fit::<T>(&toml::Value::Table(tree))?;
    Ok(value)
}

/// Whether lists of a tree that reads as a type have the lengths of its fields.
///
/// # Errors
/// The field, and how long its list may be.
pub fn lists_fit<T: DeserializeOwned>(tree: &toml::Value) -> Result<(), String> {
    match serde_path_to_error::deserialize::<_, T>(json(tree)) {
        Err(error) if error.inner().to_string().starts_with("invalid length") => {
            Err(format!("{}: {}", error.path(), error.inner()))
        }
        _ => Ok(()),
    }
}

/// Numbers matter not here, and JSON lacks some.
fn json(value: &toml::Value) -> serde_json::Value {
    use toml::Value as Toml;
    match value {
        Toml::Table(table) => table.iter().map(|(key, value)| (key.clone(), json(value))).collect(),
        Toml::Array(list) => list.iter().map(json).collect(),
        Toml::String(text) => text.clone().into(),
        Toml::Integer(number) => (*number).into(),
        Toml::Float(number) => if number.is_finite() { *number } else { 0.0 }.into(),
        Toml::Boolean(value) => (*value).into(),
        Toml::Datetime(time) => time.to_string().into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;

    #[test]
    fn a_list_that_is_too_long_is_an_error_with_its_field() {
        let good = String::from_utf8(
            crate::files::read(&crate::files::builtin_path("scenes/grocery.toml")).unwrap().into_owned(),
        )
        .unwrap();
        assert!(from_toml::<Scene>(&good).is_ok());
        let line = good.lines().find(|line| line.starts_with("look_at")).unwrap();
        let longer = line.replacen(']', ", 0.5]", 1);
        let error = from_toml::<Scene>(&good.replace(line, &longer)).unwrap_err();
        assert!(error.contains("robot.look_at") && error.contains("length 4"), "{error}");
        let shorter = line.replacen(", ", "+", 1);
        assert!(from_toml::<Scene>(&good.replace(line, &shorter)).is_err());
    }
}
