//! Command lines, and the names that programs have in outputs.

use std::path::Path;
use std::str::FromStr;

/// A command line: a program and its arguments.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CommandLine {
    /// As it was given.
    pub text: String,
    pub(super) words: Vec<String>,
}

impl FromStr for CommandLine {
    type Err = String;

    /// By the rules of a POSIX shell for words and quotes; nothing is expanded.
    fn from_str(text: &str) -> Result<Self, String> {
        let words = shlex::split(text).ok_or_else(|| format!("{text}: a quote is not closed"))?;
        if words.is_empty() {
            return Err("no program is named behind cmd:".into());
        }
        Ok(Self { text: text.to_owned(), words })
    }
}

impl CommandLine {
    /// For outputs: the stem of the first word that names a file, behind an interpreter if there is one.
    pub fn name(&self) -> String {
        let stem =
            |word: &String| Path::new(word).file_stem().map(|stem| stem.to_string_lossy().into_owned());
        let script = self.words.iter().skip(1).find(|word| Path::new(word).extension().is_some());
        script.and_then(stem).or_else(|| stem(&self.words[0])).unwrap_or_default()
    }
}

/// The name, if one is given, and the command line of `cmd:PROGRAM ARGUMENTS` or `NAME=cmd:PROGRAM ARGUMENTS`; none of a text that is
/// neither. `taken` are names of others.
pub(crate) fn named_command(
    text: &str,
    taken: &[&str],
) -> Result<Option<(Option<String>, CommandLine)>, String> {
    let Some((name, command)) = text.split_once("cmd:") else { return Ok(None) };
    let name = name.strip_suffix('=');
    if let Some(name) = name {
        let plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        if name.is_empty() || !name.chars().all(plain) || taken.contains(&name) {
            let taken = taken.join(" or ");
            return Err(format!("{name}=cmd: give a name of letters, digits, - _ and ., not {taken}"));
        }
    } else if !text.starts_with("cmd:") {
        return Ok(None);
    }
    Ok(Some((name.map(str::to_owned), command.parse()?)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_is_named_after_its_script() {
        let name = |text: &str| text.parse::<CommandLine>().unwrap().name();
        assert_eq!(name("python3 -u '/a b/my_estimator.py' --gpu 0"), "my_estimator");
        assert_eq!(name("./run-it --fast"), "run-it");
        assert!("python3 'x".parse::<CommandLine>().is_err() && "  ".parse::<CommandLine>().is_err());
    }

    #[test]
    fn a_name_may_stand_before_a_command() {
        let named = |text: &str| {
            named_command(text, &["grip"]).map(|found| found.map(|(name, command)| (name, command.text)))
        };
        assert_eq!(named("cmd:a b=cmd:c"), Ok(Some((None, "a b=cmd:c".into()))));
        assert_eq!(named("mine=cmd:a"), Ok(Some((Some("mine".into()), "a".into()))));
        assert_eq!(named("csv:x_cmd:y"), Ok(None));
        assert!(named("grip=cmd:a").is_err() && named("a b=cmd:c").is_err() && named("=cmd:c").is_err());
    }
}
