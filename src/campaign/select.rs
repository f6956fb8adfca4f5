//! Which units a task runs: what its options say, or else what the engine that started it says.

use std::str::FromStr;

use anyhow::{Context, Result, bail, ensure};

use crate::experiment::plan::Shard;

/// Environment variables in which engines say which task of many this is: job arrays of Slurm, indexed Jobs of Kubernetes.
pub const VARIABLES: [&str; 2] = ["SLURM_ARRAY_TASK_ID", "JOB_COMPLETION_INDEX"];

/// Numbers of units, as `sbatch --array` takes them: `0-3,7`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Numbers(pub Vec<usize>);

impl FromStr for Numbers {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let wrong = || format!("{text}: give numbers and ranges of units, such as 0-3,7");
        let mut numbers = Vec::new();
        for part in text.split(',') {
            let (first, last) = part.split_once('-').unwrap_or((part, part));
            let [first, last] = [first, last].map(|number| number.trim().parse::<usize>());
            let (Ok(first), Ok(last)) = (first, last) else { return Err(wrong()) };
            if first > last || last - first > 10_000_000 {
                return Err(wrong());
            }
            numbers.extend(first..=last);
        }
        Ok(Self(numbers))
    }
}

/// Ascending numbers as ranges.
pub fn ranges(numbers: impl IntoIterator<Item = usize>) -> String {
    let mut found: Vec<(usize, usize)> = Vec::new();
    for number in numbers {
        match found.last_mut() {
            Some((_, last)) if *last + 1 == number => *last = number,
            _ => found.push((number, number)),
        }
    }
    let shown = |&(first, last): &(usize, usize)| {
        if first == last { first.to_string() } else { format!("{first}-{last}") }
    };
    found.iter().map(shown).collect::<Vec<_>>().join(",")
}

/// The units, of so many, that a task runs: those it is told by number, or every N-th by a shard, or the one of the engine's task;
/// `variable` reads the environment.
///
/// # Errors
/// When none is said, two engines say different ones, or there is no such unit.
pub fn units(
    all: usize,
    numbers: Option<&Numbers>,
    shard: Option<Shard>,
    variable: impl Fn(&str) -> Option<String>,
) -> Result<Vec<usize>> {
    let known = |unit: usize, by: &str| {
        ensure!(unit < all, "{by}: there is no unit {unit}; the campaign has {all}, from 0 on");
        Ok(unit)
    };
    if let Some(Numbers(numbers)) = numbers {
        return numbers.iter().map(|&unit| known(unit, "--unit")).collect();
    }
    if let Some(Shard { index, of }) = shard {
        return Ok((index - 1..all).step_by(of).collect());
    }
    let mut said: Option<(&str, usize)> = None;
    for name in VARIABLES {
        let Some(text) = variable(name).filter(|text| !text.trim().is_empty()) else { continue };
        let unit: usize =
            text.trim().parse().with_context(|| format!("{name} = {text}: is no number of a unit"))?;
        match said {
            Some((other, before)) if before != unit => {
                bail!("{other} = {before} and {name} = {unit}: contradict each other; give --unit")
            }
            _ => said = Some((name, unit)),
        }
    }
    let Some((name, unit)) = said else {
        bail!(
            "which unit? Give --unit 0-3,7, or --shard I/N for every N-th (--shard 1/1 for all), or run it as a task of an engine that sets {}",
            VARIABLES.join(" or ")
        )
    };
    Ok(vec![known(unit, name)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_written_as_they_are_read() {
        for text in ["0", "0-3,7", "1,3,5-6", "10-99"] {
            assert_eq!(ranges(text.parse::<Numbers>().unwrap().0), text);
        }
        assert_eq!(ranges([]), "");
        for wrong in ["", "a", "3-1", "1-", "-1", "1,,2", "1-2-3"] {
            assert!(wrong.parse::<Numbers>().unwrap_err().contains("such as 0-3,7"), "{wrong}");
        }
    }

    #[test]
    fn options_win_over_engines_and_engines_must_agree() {
        let environment = |pairs: &'static [(&'static str, &'static str)]| {
            move |name: &str| pairs.iter().find(|(n, _)| *n == name).map(|(_, value)| (*value).to_owned())
        };
        let slurm = environment(&[("SLURM_ARRAY_TASK_ID", "4")]);
        assert_eq!(units(9, None, None, slurm).unwrap(), [4]);
        assert_eq!(units(9, Some(&Numbers(vec![1, 2])), None, slurm).unwrap(), [1, 2]);
        assert_eq!(units(9, None, Some(Shard { index: 2, of: 4 }), slurm).unwrap(), [1, 5]);
        assert!(units(4, None, None, slurm).unwrap_err().to_string().contains("no unit 4"));
        assert_eq!(units(9, None, None, environment(&[("JOB_COMPLETION_INDEX", "0")])).unwrap(), [0]);
        let both = environment(&[("SLURM_ARRAY_TASK_ID", "4"), ("JOB_COMPLETION_INDEX", "5")]);
        assert!(units(9, None, None, both).unwrap_err().to_string().contains("contradict"));
        assert!(units(9, None, None, environment(&[])).unwrap_err().to_string().contains("which unit"));
        assert!(units(9, None, None, environment(&[("SLURM_ARRAY_TASK_ID", "x")])).is_err());
        // All shards together have every unit once.
        let mut all: Vec<usize> =
            (1..=4).flat_map(|index| units(9, None, Some(Shard { index, of: 4 }), slurm).unwrap()).collect();
        all.sort_unstable();
        assert_eq!(all, Vec::from_iter(0..9));
    }
}
