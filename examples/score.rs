//! The score of a results file, as the BOP challenge has them: `cargo run --example score -- DATASET RESULTS.csv`.

#![allow(clippy::print_stdout, reason = "an example")]

use std::path::Path;

use grip::benchmark::evaluate;
use grip_sim::bop::{Dataset, results::read_results};

pub(crate) fn main() -> anyhow::Result<()> {
    let args: Vec<String> = std::env::args().collect();
    let [_, dataset, results] = &args[..] else {
        anyhow::bail!("give a data set in BOP's format and a results file");
    };
    score(Path::new(dataset), Path::new(results))
}

pub(crate) fn score(dataset: &Path, results: &Path) -> anyhow::Result<()> {
    let dataset = Dataset::open(dataset, None)?;
    let evaluation = evaluate(&dataset, &read_results(results)?)?;
    println!("{}", serde_json::to_string_pretty(&evaluation.all)?);
    Ok(())
}
