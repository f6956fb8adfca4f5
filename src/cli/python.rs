//! The part of the Python package that says what the command line and the settings say: `python/grip/verbs.py` from the options of each
//! verb, `python/grip/settings.py` from the schema of the settings. `GRIP_UPDATE_DOCS=1` writes them anew.

use std::any::TypeId;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::{Arg, ArgAction, CommandFactory};
use serde_json::{Map, Value};

use super::Cli;
use super::options::{name_of, option_names, shown};
use crate::commands::schemas;
use crate::estimators::{EstimatorKind, NetworkChoice};
use crate::graspers::GrasperKind;

/// The functions: a verb, its name where that is another, and what it returns.
const VERBS: [(&str, &str, &str); 19] = [
    ("pack", "pack", "Trial"),
    ("trials", "trials", "Trials"),
    ("merge", "merge", "Trials"),
    ("sweep", "sweep", "Sweep"),
    ("report", "report", "None"),
    ("plan", "plan", "dict[str, Any]"),
    ("render", "render", "None"),
    ("scenes", "scenes", "DataSet"),
    ("detect", "detect", "dict[str, Any]"),
    ("estimate", "estimate", "Estimates"),
    ("eval", "evaluate", "Evaluation"),
    ("explain", "explain", "dict[str, Any]"),
    ("convergence", "convergence", "dict[str, Any]"),
    ("reproduce", "reproduce", "dict[str, Any]"),
    ("grasps", "grasps", "Any"),
    ("export", "export", "None"),
    ("convert", "convert", "None"),
    ("robot", "robot", "dict[str, Any]"),
    ("init", "init", "None"),
];

const VERBS_HEAD: &str = r#""""The verbs of the command as functions: the same options, the same results.

Made of what ``grip --help`` says, by ``GRIP_UPDATE_DOCS=1 cargo test --release --lib -- cli:: commands::``.
"""

from __future__ import annotations

import os
from typing import Any, Literal, Mapping, Optional, Sequence, Union

from . import results as _results
from ._run import run as _run
from .functions import EstimatorFunction, GrasperFunction
from .results import DataSet, Estimates, Evaluation, Sweep, Trial, Trials
from .settings import Settings

Path = Union[str, "os.PathLike[str]"]
Estimator = Union[str, EstimatorFunction, tuple[str, EstimatorFunction]]
"""A word of the command line, a function, or a pair of a name and a function."""
Grasper = Union[str, GrasperFunction, tuple[str, GrasperFunction]]
"""The same for who plans grasps."""
"#;

const SETTINGS_HEAD: &str = r#""""Settings of everything, as ``grip settings`` prints them, with their defaults.

Made of their schema, by ``GRIP_UPDATE_DOCS=1 cargo test --release --lib -- cli:: commands::``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, Optional, Sequence
"#;

/// Text in lines of at most so many characters, the first one after as many that are there already.
fn wrapped(text: &str, indent: &str) -> String {
    const WIDTH: usize = 120;
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let line = lines.last_mut().map(|line| line.len()).unwrap_or_default();
        if line > 0 && indent.len() + line + 1 + word.len() > WIDTH {
            lines.push(String::new());
        }
        if let Some(line) = lines.last_mut() {
            *line += if line.is_empty() { "" } else { " " };
            *line += word;
        }
    }
    lines.join(&format!("\n{indent}"))
}

/// The type of an option in Python.
fn kind(arg: &Arg) -> String {
    let id = arg.get_value_parser().type_id();
    let is = |other: TypeId| id == other;
    let values: Vec<String> =
        arg.get_possible_values().iter().map(|value| format!("\"{}\"", value.get_name())).collect();
    let one = if !arg.get_action().takes_values() {
        return "bool".into();
    } else if !values.is_empty() && !is(TypeId::of::<bool>()) {
        format!("Literal[{}]", values.join(", "))
    } else if [TypeId::of::<u32>(), TypeId::of::<u64>(), TypeId::of::<usize>()].into_iter().any(is) {
        "int".into()
    } else if is(TypeId::of::<f64>()) {
        "float".into()
    } else if is(TypeId::of::<PathBuf>()) || is(TypeId::of::<NetworkChoice>()) {
        "Path".into()
    } else if is(TypeId::of::<EstimatorKind>()) {
        "Estimator".into()
    } else if is(TypeId::of::<GrasperKind>()) {
        "Grasper".into()
    } else {
        "str".into()
    };
    let named = one == "Estimator" || one == "Grasper";
    match arg.get_action() {
        ArgAction::Append if named => format!("Union[{one}, Sequence[{one}], Mapping[str, {one}]]"),
        ArgAction::Append => format!("Union[{one}, Sequence[{one}]]"),
        _ => one,
    }
}

fn function(page: &mut String, verb: &clap::Command, name: &str, returns: &str) {
    let names = option_names(verb);
    let has_json = names.iter().any(|name| name == "json");
    // What is printed is returned; `strict` is another way to print it.
    let args: Vec<(String, &Arg)> = shown(verb)
        .map(|arg| (name_of(verb, arg), arg))
        .filter(|(name, _)| name != "json" && name != "strict")
        .collect();
    let (positional, named): (Vec<_>, Vec<_>) = args.iter().partition(|(_, arg)| arg.is_positional());
    let parameter = |(name, arg): &&&(String, &Arg)| {
        let mut kind = kind(arg);
        if name == "settings" {
            kind = "Union[Settings, Mapping[str, Any], Path]".into();
        }
        if name == "scene" && !kind.contains("Sequence") {
            kind = "Union[Path, Mapping[str, Any]]".into();
        }
        match (arg.is_required_set(), arg.get_action().takes_values()) {
            (true, _) => format!("    {name}: {kind},\n"),
            (false, false) => format!("    {name}: bool = False,\n"),
            (false, true) => format!("    {name}: Optional[{kind}] = None,\n"),
        }
    };
    let _ = write!(page, "\n\ndef {name}(\n");
    page.extend(positional.iter().map(|arg| parameter(&arg)));
    *page += "    *,\n";
    page.extend(named.iter().map(|arg| parameter(&arg)));
    let _ = write!(page, "    progress: Optional[bool] = None,\n) -> {returns}:\n");
    let about = verb.get_about().map(ToString::to_string).unwrap_or_default();
    let _ = write!(
        page,
        "    r\"\"\"{}\n\n    Args:\n",
        wrapped(&format!("{}.", about.trim_end_matches('.')), "    ")
    );
    for (name, arg) in &args {
        let help = arg.get_long_help().or(arg.get_help()).map(ToString::to_string).unwrap_or_default();
        let values: Vec<String> =
            arg.get_default_values().iter().map(|v| v.to_string_lossy().into_owned()).collect();
        let default = match values.is_empty() || !arg.get_action().takes_values() {
            true => String::new(),
            false => format!(" Default: {}.", values.join(",")),
        };
        let text = format!("{}.{default}", help.trim_end_matches('.'));
        let _ = writeln!(page, "        {name}: {}", wrapped(&text, "            "));
    }
    let bars = "progress: Whether to show a bar, which needs tqdm. Default: where tqdm is installed.";
    let _ = write!(
        page,
        "        {bars}\n\n    Raises:\n        Error: With the text that the command prints.\n    \"\"\"\n"
    );
    let options =
        "{key: value for key, value in locals().items() if key != \"progress\" and value is not False}";
    let _ = writeln!(page, "    options = {options}");
    if has_json {
        *page += "    options[\"json\"] = True\n";
    }
    let called = format!(
        "_results.of(\"{}\", options, *_run(\"{}\", options, progress))",
        verb.get_name(),
        verb.get_name()
    );
    match returns {
        "None" => {
            let _ = writeln!(page, "    {called}");
        }
        _ => {
            let _ = writeln!(page, "    return {called}");
        }
    }
}

fn verbs() -> String {
    let mut page = VERBS_HEAD.to_owned();
    let mut command = Cli::command();
    command.build();
    for (verb, name, returns) in VERBS {
        let found = command.find_subcommand(verb);
        function(&mut page, found.unwrap_or_else(|| panic!("{verb}")), name, returns);
    }
    page
}

/// A name of Python's for a definition of the schema.
fn class(reference: &str) -> String {
    match reference.rsplit('/').next().unwrap_or_default() {
        // The schema numbers what has one name in two places.
        "BeliefSettings2" => "TrialBeliefSettings".into(),
        "ScoreSettings2" => "TrialScoreSettings".into(),
        name => name.into(),
    }
}

fn settings_type(schema: &Value, definitions: &Map<String, Value>) -> String {
    if let Some(reference) = schema["$ref"].as_str() {
        let name = reference.rsplit('/').next().unwrap_or_default();
        return match &definitions[name] {
            object if object["type"] == "object" => class(name),
            choice => settings_type(choice, definitions),
        };
    }
    if let Some(choices) = schema["oneOf"].as_array() {
        let words: Vec<String> = choices.iter().map(|choice| choice["const"].to_string()).collect();
        return format!("Literal[{}]", words.join(", "));
    }
    if let Some(choices) = schema["enum"].as_array() {
        let words: Vec<String> = choices.iter().map(Value::to_string).collect();
        return format!("Literal[{}]", words.join(", "));
    }
    match &schema["type"] {
        Value::String(word) => match word.as_str() {
            "number" => "float".into(),
            "integer" => "int".into(),
            "boolean" => "bool".into(),
            "string" => "str".into(),
            "array" => format!("Sequence[{}]", settings_type(&schema["items"], definitions)),
            other => panic!("{other}: {schema}"),
        },
        Value::Array(words) => {
            let mut one = schema.clone();
            one["type"] = words[0].clone();
            format!("Optional[{}]", settings_type(&one, definitions))
        }
        _ => panic!("{schema}"),
    }
}

/// A value of JSON as Python writes it, of a setting of this schema.
fn literal(value: &Value, schema: &Value, definitions: &Map<String, Value>) -> String {
    if let Some(reference) = schema["$ref"].as_str() {
        let name = reference.rsplit('/').next().unwrap_or_default();
        let definition = &definitions[name];
        if definition["type"] == "object" {
            let Value::Object(fields) = value else { panic!("{value}") };
            let properties = &definition["properties"];
            let given: Vec<String> = fields
                .iter()
                .filter(|(field, value)| properties[field.as_str()]["default"] != **value)
                .map(|(field, value)| {
                    format!("{field}={}", literal(value, &properties[field.as_str()], definitions))
                })
                .collect();
            return format!("{}({})", class(name), given.join(", "));
        }
    }
    match value {
        Value::Bool(true) => "True".into(),
        Value::Bool(false) => "False".into(),
        Value::Null => "None".into(),
        Value::Array(items) => {
            let items: Vec<String> =
                items.iter().map(|item| literal(item, &schema["items"], definitions)).collect();
            format!("[{}]", items.join(", "))
        }
        // As few digits as say the same number.
        Value::Number(number) if schema["format"] == "float" => {
            format!("{:?}", number.as_f64().unwrap_or_default() as f32)
        }
        other => other.to_string(),
    }
}

fn settings() -> String {
    let all = schemas::all();
    let (_, schema) = all.iter().find(|(name, _)| *name == "settings").unwrap_or_else(|| panic!("settings"));
    let Value::Object(definitions) = &schema["$defs"] else { panic!("no definitions") };
    let mut page = SETTINGS_HEAD.to_owned();
    let mut written = Vec::new();
    fn write_class(
        page: &mut String,
        name: &str,
        schema: &Value,
        definitions: &Map<String, Value>,
        written: &mut Vec<String>,
    ) {
        if written.iter().any(|other| other == name) {
            return;
        }
        written.push(name.to_owned());
        let Value::Object(properties) = &schema["properties"] else { panic!("{name}") };
        // What it is made of stands before it.
        let text = schema["properties"].to_string();
        for (inner, definition) in definitions {
            let used = text.contains(&format!("\"#/$defs/{inner}\""));
            if used && definition["type"] == "object" {
                write_class(page, inner, definition, definitions, written);
            }
        }
        let about = |schema: &Value| schema["description"].as_str().unwrap_or_default().replace('\\', "/");
        let _ = write!(
            page,
            "\n\n@dataclass\nclass {}:\n    r\"\"\"{}\"\"\"\n",
            class(name),
            wrapped(&about(schema), "    ")
        );
        // Those without a default come first, as Python wants it.
        let (with, without): (Vec<_>, Vec<_>) =
            properties.iter().partition(|(_, p)| p.get("default").is_some());
        for (field, property) in without.into_iter().chain(with) {
            let kind = settings_type(property, definitions);
            let optional = kind.starts_with("Optional");
            let default = match property.get("default") {
                Some(value) => {
                    let value = literal(value, property, definitions);
                    let made = value.ends_with("()").then(|| value.trim_end_matches("()").to_owned());
                    match made {
                        Some(class) => format!(" = field(default_factory={class})"),
                        None if value.starts_with('[') || value.contains('(') => {
                            format!(" = field(default_factory=lambda: {value})")
                        }
                        None => format!(" = {value}"),
                    }
                }
                None if optional => " = None".into(),
                None => String::new(),
            };
            let _ = writeln!(page, "\n    {field}: {kind}{default}");
            let _ = writeln!(page, "    r\"\"\"{}\"\"\"", wrapped(&about(property), "    "));
        }
    }
    write_class(&mut page, "Settings", schema, definitions, &mut written);
    page
}

#[test]
fn the_python_package_says_what_the_command_line_says() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("python/grip");
    for (name, page) in [("verbs.py", verbs()), ("settings.py", settings())] {
        let file = folder.join(name);
        if std::env::var_os("GRIP_UPDATE_DOCS").is_some() {
            std::fs::write(&file, &page).unwrap();
        }
        let written = std::fs::read_to_string(&file).unwrap_or_default();
        assert!(written == page, "python/grip/{name} is not current; GRIP_UPDATE_DOCS=1 writes it anew");
    }
}
