//! Why items were not packed, as the first table of a page: the most frequent way first, with trials to look at.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::Sources;
use super::origin::Origin;
use super::replay::UNKNOWN;
use crate::experiment::plan::Key;
use crate::experiment::summary::Cell;
use crate::html::escape;
use crate::score::outcome::{ItemResult, Outcome, Stage};

/// Rows, and seeds in a row.
const MOST_ROWS: usize = 40;
const MOST_SEEDS: usize = 4;

/// Items of one scene, condition and method that failed in one way.
#[derive(Debug, Clone, PartialEq)]
pub struct Way {
    /// Scene, condition and method.
    pub cell: [String; 3],
    /// What became of them.
    pub outcome: &'static str,
    /// How far they came.
    pub stage: String,
    /// The first clause of success that they failed, of those that the fingers had closed on.
    pub clause: &'static str,
    /// How many.
    pub items: usize,
    /// Of how many of the cell.
    pub of: usize,
    /// In which trials, each once.
    pub trials: Vec<Key>,
}

/// All of them, the most frequent first.
pub fn ways(sources: &Sources, cells: &[Cell]) -> Vec<Way> {
    type Case<'a> = ([String; 3], &'static str, Stage, &'static str);
    let mut ways: BTreeMap<Case<'_>, (usize, Vec<Key>)> = BTreeMap::new();
    for trial in &sources.trials {
        for item in trial.items.iter().filter(|item| item.outcome != Outcome::Packed) {
            let cell = [trial.scene.clone(), trial.condition.clone(), trial.method()];
            let case = (cell, item.outcome.words(), item.stage, clause(item));
            let (items, trials) = ways.entry(case).or_default();
            *items += 1;
            let key = Key::of(trial);
            if trials.last() != Some(&key) {
                trials.push(key);
            }
        }
    }
    let of = |cell: &[String; 3]| {
        let same = |c: &&Cell| [&c.scene, &c.condition, &c.method()] == [&cell[0], &cell[1], &cell[2]];
        cells.iter().find(same).map_or(0, |c| c.items)
    };
    let mut ways: Vec<Way> = ways
        .into_iter()
        .map(|((cell, outcome, stage, clause), (items, mut trials))| {
            trials.sort_unstable();
            let stage = if stage == Stage::Done { "end".into() } else { format!("{stage:?}").to_lowercase() };
            Way { of: of(&cell), cell, outcome, stage, clause, items, trials }
        })
        .collect();
    // Equal ones stay in the order of their names.
    ways.sort_by_key(|way| std::cmp::Reverse(way.items));
    ways
}

/// The first clause that does not hold; of what was never gripped all fail, which says nothing.
fn clause(item: &ItemResult) -> &'static str {
    let failed = item.clauses.by_name().into_iter().find(|(_, holds)| !holds);
    failed.filter(|_| item.stage >= Stage::Grasp).map_or("–", |(name, _)| name)
}

/// The table.
pub fn section(page: &mut String, sources: &Sources, cells: &[Cell]) {
    page.push_str("<h2>Why did it fail?</h2>");
    let ways = ways(sources, cells);
    let items: usize = cells.iter().map(|c| c.items).sum();
    let failed: usize = ways.iter().map(|way| way.items).sum();
    if failed == 0 {
        let _ = write!(page, "<p>It did not: all of {items} items were packed.</p>");
        return;
    }
    let several = cells.iter().any(|cell| cell.scene != cells[0].scene);
    let _ = write!(
        page,
        "<p>{failed} of {items} items were not packed. The share is of all items that the estimator was given under the condition; the \
         command runs the first of the seeds again.</p>\
         <table><tr><th>outcome<th>reached<th>clause that failed{}<th>condition<th>estimator<th class=n>items<th class=n>share\
         <th>seeds<th>again</tr>",
        if several { "<th>scene" } else { "" }
    );
    for way in ways.iter().take(MOST_ROWS) {
        let Way { cell: [scene, condition, method], outcome, stage, clause, items, of, trials } = way;
        let scene = if several { format!("<td>{}", escape(scene)) } else { String::new() };
        let share = 100.0 * *items as f64 / (*of).max(1) as f64;
        let seeds: Vec<String> = trials.iter().take(MOST_SEEDS).map(|key| key.seed.to_string()).collect();
        let more = if trials.len() > MOST_SEEDS { ", …" } else { "" };
        let again = trials.first().and_then(|key| sources.replays.get(key)).map_or("", String::as_str);
        let _ = write!(
            page,
            "<tr><td>{outcome}<td>{stage}<td>{clause}{scene}<td>{}<td>{}<td class=n>{items}<td class='n w'>{share:.1} % of {of}\
             <td>{}{more}<td><code>{}</code></tr>",
            escape(condition),
            escape(method),
            seeds.join(", "),
            unbroken(again)
        );
    }
    page.push_str("</table>");
    if ways.len() > MOST_ROWS {
        let _ = write!(page, "<p>The {MOST_ROWS} most frequent of {} ways.</p>", ways.len());
    }
    let shown = || ways.iter().filter_map(|way| sources.replays.get(way.trials.first()?));
    if shown().any(|command| UNKNOWN.iter().any(|unknown| command.contains(unknown))) {
        page.push_str(
            "<p>What stands in capitals in a command is a file or folder that the trial was given.</p>",
        );
    }
    if sources.origins.iter().any(Origin::is_of_another_build) {
        page.push_str("<p>Another build made some of the results: it is that one which repeats them to the last bit.</p>");
    }
}

/// A command that is broken between its words alone, and still copied as it is.
fn unbroken(command: &str) -> String {
    let word = |word: &str| format!("<span class=w>{}</span>", escape(word));
    command.split(' ').map(word).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::summary::{cells, tests::trial};

    #[test]
    fn ways_are_counted_by_cell_with_their_seeds() {
        let mut sources = Sources {
            trials: vec![
                trial(1, "base", "grip", &[("can", false, None), ("box", false, None)]),
                trial(2, "base", "grip", &[("can", false, None), ("box", true, None)]),
                trial(3, "base", "grip", &[("can", false, None), ("box", true, None)]),
                trial(3, "dark", "grip", &[("can", true, None), ("box", false, None)]),
            ],
            ..Sources::default()
        };
        // It came to the lift; the others were never gripped.
        sources.trials[2].items[0].stage = Stage::Lift;
        sources.trials[2].items[0].clauses.opposing_contacts = true;
        for trial in &mut sources.trials[..2] {
            trial.items.iter_mut().for_each(|item| item.stage = Stage::Plan);
        }
        sources.replays.insert(Key::of(&sources.trials[0]), "grip pack --seed 1".into());
        let cells = cells(&sources.trials);
        let ways = ways(&sources, &cells);
        let shown: Vec<_> = ways.iter().map(|w| (&*w.cell[1], &*w.stage, w.clause, w.items, w.of)).collect();
        assert_eq!(
            shown,
            [
                ("base", "plan", "–", 3, 6),
                ("base", "lift", "lifted clear", 1, 6),
                ("dark", "end", "opposing contacts", 1, 2),
            ]
        );
        assert_eq!(ways[0].trials.iter().map(|key| key.seed).collect::<Vec<_>>(), [1, 2], "each once");
        let mut page = String::new();
        section(&mut page, &sources, &cells);
        let row = "<td class=n>3<td class='n w'>50.0 % of 6<td>1, 2<td><code><span class=w>grip</span> ";
        assert!(page.contains(row), "{page}");
    }
}
