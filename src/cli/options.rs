//! Options of a verb as a table, such as TOML and JSON have it, in place of words on a command line: the same names (`_` for `-`), the
//! same values, the same errors. A verb of a verb is named by both: `campaign plan`.

use anyhow::{Context, Result, bail};
use clap::CommandFactory;
use serde_json::{Map, Value};

use super::Cli;

/// The verb `verb` as data, with all that `--help` says of it.
pub fn verb(verb: &str) -> Result<clap::Command> {
    let mut command = Cli::command();
    command.build();
    let mut known = &command;
    for word in verb.split(' ') {
        known = known.find_subcommand(word).with_context(|| {
            let verbs = known.get_subcommands().map(clap::Command::get_name);
            format!("{verb}: is no verb of grip{}", grip_sim::names::suggestion(verbs, word))
        })?;
    }
    Ok(known.clone())
}

/// The words of the command line that says the same as `options`: the program's name first, then the verb.
///
/// A list is an option given several times, `true` a flag, `false` and null say nothing.
///
/// # Errors
/// When an option has another name, or a value is a table. What a value may be is for the command line to say.
pub fn words(name: &str, options: &Map<String, Value>) -> Result<Vec<String>> {
    let verb = verb(name)?;
    let mut words: Vec<String> = ["grip"].into_iter().chain(name.split(' ')).map(str::to_owned).collect();
    let mut positional = Vec::new();
    for (key, value) in options {
        let arg = shown(&verb).find(|arg| name_of(&verb, arg) == key.replace('-', "_"));
        let Some(arg) = arg else {
            let names: Vec<String> = option_names(&verb);
            let suggestion = grip_sim::names::suggestion(names.iter().map(String::as_str), key);
            bail!("{key}: grip {name} has no such option; it has {}{suggestion}", names.join(", "));
        };
        let place: &mut Vec<String> = if arg.is_positional() { &mut positional } else { &mut words };
        let values = match value {
            Value::Array(list) => list.as_slice(),
            one => std::slice::from_ref(one),
        };
        for value in values {
            let text = match value {
                Value::Null | Value::Bool(false) => continue,
                Value::Bool(true) if arg.get_action().takes_values() => {
                    bail!("{key} = true: grip {name} wants a value here")
                }
                Value::Bool(true) => None,
                Value::String(text) => Some(text.clone()),
                Value::Number(number) => Some(number.to_string()),
                Value::Array(_) | Value::Object(_) => {
                    bail!("{key} = {value}: give a number, a text, true, false, or a list of them")
                }
            };
            place.push(match (arg.get_long(), text) {
                (Some(long), Some(text)) => format!("--{long}={text}"),
                (Some(long), None) => format!("--{long}"),
                (None, text) => text.with_context(|| format!("{key} = {value}: give a text"))?,
            });
        }
    }
    if !positional.is_empty() {
        words.push("--".into());
        words.append(&mut positional);
    }
    Ok(words)
}

/// The names of a verb's options in a table.
pub fn option_names(verb: &clap::Command) -> Vec<String> {
    shown(verb).map(|arg| name_of(verb, arg)).collect()
}

/// The options that are a verb's own.
pub fn shown(verb: &clap::Command) -> impl Iterator<Item = &clap::Arg> {
    let everywhere =
        |arg: &clap::Arg| arg.is_global_set() || ["help", "version"].contains(&arg.get_id().as_str());
    verb.get_arguments().filter(move |arg| !everywhere(arg))
}

/// The name of an option in a table: the one that people know, with `_`; of what stands without one on a command line that of its
/// field, or `names` where that is another option's, as the objects of a sweep are named and tables of objects are `objects`.
pub fn name_of(verb: &clap::Command, arg: &clap::Arg) -> String {
    let long = |arg: &clap::Arg| arg.get_long().map(|long| long.replace('-', "_"));
    let taken = |id: &str| verb.get_arguments().any(|other| long(other).as_deref() == Some(id));
    match (long(arg), arg.get_id().as_str()) {
        (Some(long), _) => long,
        (None, id) if taken(id) => "names".into(),
        (None, id) => id.into(),
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use serde_json::json;

    use super::*;
    use crate::cli::Command;

    fn parse(verb: &str, options: Value) -> Result<Command> {
        let words = words(verb, options.as_object().unwrap())?;
        Ok(Cli::try_parse_from(words)?.command)
    }

    #[test]
    fn a_table_says_what_a_command_line_says() {
        let options = json!({
            "trials": 20, "seed": u64::MAX, "conditions": ["dark", "base"], "estimators": "truth", "resume": true, "json": false,
            "package_path": ["a", "b c"], "shard": "2/4", "jobs": null,
        });
        let Command::Trials(args) = parse("trials", options).unwrap() else { panic!() };
        assert_eq!((args.trials, args.seed, args.resume, args.json), (20, u64::MAX, true, false));
        assert_eq!(args.conditions, ["dark", "base"]);
        assert_eq!(args.robot.package_path, ["a", "b c"].map(std::path::PathBuf::from));
        assert_eq!((args.shard.unwrap().index, args.jobs), (2, None));
        // What stands without a name, and negative numbers.
        let options = json!({ "names": ["011_banana", "-odd"], "objects": "mine.toml", "range": [40, 45.5], "friction": -1.0 });
        let Command::Sweep(args) = parse("sweep", options).unwrap() else { panic!() };
        assert_eq!(args.objects, ["011_banana", "-odd"]);
        assert_eq!(args.tables.tables, [std::path::PathBuf::from("mine.toml")]);
        assert_eq!((args.range, args.friction), (vec![40.0, 45.5], Some(-1.0)));
    }

    #[test]
    fn a_verb_of_a_verb_is_named_by_both() {
        let command = parse("campaign run", json!({ "folder": "-c", "unit": "0-3,7", "jobs": 2 })).unwrap();
        let Command::Campaign(crate::cli::CampaignArgs { command: crate::cli::CampaignCommand::Run(args) }) =
            command
        else {
            panic!()
        };
        assert_eq!((args.folder.to_str(), args.jobs), (Some("-c"), Some(2)));
        let error = parse("campaign plam", json!({})).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains("did you mean 'plan'"), "{error}");
    }

    #[test]
    fn what_is_no_option_is_named() {
        let error =
            |verb: &str, options: Value| format!("{:#}", parse(verb, options).map(|_| ()).unwrap_err());
        let text = error("trials", json!({ "estimator": "grip" }));
        assert!(
            text.contains("estimator: grip trials has no such option")
                && text.contains("did you mean 'estimators'"),
            "{text}"
        );
        assert!(error("trails", json!({})).contains("did you mean 'trials'"));
        assert!(error("trials", json!({ "trials": { "n": 1 } })).contains("give a number"));
        assert!(error("trials", json!({ "out": true })).contains("wants a value"));
        assert!(error("trials", json!({ "trials": 0 })).contains("1..=1000000"));
        assert!(error("trials", json!({ "verbose": true })).contains("no such option"));
    }
}
