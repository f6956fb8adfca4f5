//! `grip reproduce`: a table of the paper from nothing, each step a command of this program that one can run by itself.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Parser;
use grip_sim::bop::results::read_results;
use grip_sim::bop::{self, Dataset};
use grip_sim::render;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::json;

use super::output::{self, Bar};
use super::{Done, convergence};
use crate::benchmark::{Evaluation, Figures, Method, PaperTable, Table, curves, evaluate};
use crate::cli::{Cli, Command, EstimateArgs, MethodChoice, ReproduceArgs, ScenesArgs};
use crate::dataset::{self, Plan};
use crate::scenario::program;
use crate::setup::{ADVERSARIAL, Setup};
use crate::{html, plot, workers};

/// Version of `table1.json`.
pub const SCHEMA: &str = "grip.table1/1";

/// `table1.json`: all figures.
#[derive(Serialize, JsonSchema)]
pub struct Table1<'a> {
    schema: &'static str,
    /// The command that made the data set.
    scenes: &'a str,
    methods: Vec<MethodReport<'a>>,
}

/// A method's part of it.
#[derive(Serialize, JsonSchema)]
struct MethodReport<'a> {
    name: &'a str,
    /// The command that made its poses.
    command: &'a str,
    /// Seconds of an image in the mean, with whatever else ran beside it.
    image_s: Option<f64>,
    /// Its figures by the paper's protocol.
    table: &'a PaperTable,
    /// On the real frames, where these were given.
    real: Option<&'a Figures>,
}

/// A method with its files and figures.
struct Column {
    title: String,
    command: String,
    image_s: Option<f64>,
    evaluation: Evaluation,
    table: PaperTable,
    real: Option<Evaluation>,
}

/// Makes the scenes, lets each method estimate them, and writes the table.
pub fn run(args: &ReproduceArgs) -> Result<Done> {
    for (i, method) in args.methods.iter().enumerate() {
        let title = method.title();
        anyhow::ensure!(
            args.methods[..i].iter().all(|other| other.title() != title),
            "--methods: {title} is there twice; give each a name of its own"
        );
    }
    // Before hours of computing, not after.
    if let Some(frames) = &args.real {
        Dataset::open(frames, None).context("--real")?;
    }
    std::fs::create_dir_all(&args.out)
        .with_context(|| format!("--out {}: cannot be made; give another place", args.out.display()))?;
    let folder = args.out.to_str().with_context(|| format!("--out {}: is no text", args.out.display()))?;
    let set = format!("{folder}/set");
    let made = words(&[
        "scenes",
        "--seed",
        &args.seed.to_string(),
        "--scenes",
        &args.scenes.to_string(),
        "--out",
        &set,
    ]);
    make(&made)?;
    let mut columns = Vec::new();
    for method in &args.methods {
        let (estimated, results) = estimate_words(method, &set, folder, "");
        estimate(&estimated, &results, method)?;
        let dataset = Dataset::open(set.as_ref(), None)?;
        let (evaluation, image_s) = evaluated(&dataset, &results)?;
        let table = PaperTable::new(&evaluation, dataset.root())?;
        let real = args.real.as_deref().map(|frames| real(method, frames, folder)).transpose()?;
        columns.push(Column {
            title: method.title(),
            command: shown(&estimated),
            image_s,
            evaluation,
            table,
            real,
        });
    }
    converge(args, &set, folder)?;
    write(args, &shown(&made), &columns)?;
    Ok(Done::Fully)
}

/// Draws how the searches of ours converge in the first frame.
fn converge(args: &ReproduceArgs, set: &str, folder: &str) -> Result<()> {
    let ours = ["grip", "paper-guarded", "paper"];
    let ours: Vec<&str> =
        ours.into_iter().filter(|name| args.methods.iter().any(|method| method.title() == *name)).collect();
    if ours.is_empty() {
        return Ok(());
    }
    let mut all = words(&["convergence", set, "--out", &format!("{folder}/convergence.svg")]);
    all.extend("--scene 1 --image 0 --seeds 1 --boxes pyramid".split(' ').map(str::to_owned));
    all.extend(ours.iter().flat_map(|name| words(&["--estimator", name])));
    let Command::Convergence(drawn) = parsed(&all)? else { anyhow::bail!("no command that draws") };
    convergence::draw(&drawn).map(drop)
}

fn words(words: &[&str]) -> Vec<String> {
    words.iter().map(|word| (*word).to_owned()).collect()
}

/// A command as one would type it.
fn shown(words: &[String]) -> String {
    let quoted = |word: &String| if word.contains(' ') { format!("\"{word}\"") } else { word.clone() };
    format!("grip {}", words.iter().map(quoted).collect::<Vec<_>>().join(" "))
}

fn parsed(words: &[String]) -> Result<Command> {
    Ok(Cli::try_parse_from(["grip".to_owned()].into_iter().chain(words.iter().cloned()))?.command)
}

/// The data set, or what is missing of it.
fn make(words: &[String]) -> Result<()> {
    let Command::Scenes(args) = parsed(words)? else { anyhow::bail!("no command that makes scenes") };
    let ScenesArgs { scene, out, .. } = &args;
    let mut setup = Setup::open(&scene.options(ADVERSARIAL, "base")?)?;
    let plan = Plan::new(&args.options(), &mut setup, render::open(scene.renderer.into())?.device())?;
    plan.claim(out, true)?;
    let progress = Bar::new("frames");
    let made = dataset::make(&setup, &plan, out, workers::cores() as u32, scene.renderer.into(), &progress);
    progress.finish();
    made.map(drop)
}

/// The command that estimates the poses of a data set, and where they go.
fn estimate_words(method: &MethodChoice, set: &str, folder: &str, suffix: &str) -> (Vec<String>, PathBuf) {
    let results = format!("{folder}/{}{suffix}.csv", method.title());
    let mut all = words(&["estimate", set]);
    all.extend(method.options());
    all.extend(words(&["--out", &results]));
    (all, results.into())
}

/// Poses that the same command of the same build made before are kept, whole files and single images.
fn estimate(words: &[String], results: &Path, method: &MethodChoice) -> Result<()> {
    let Command::Estimate(args) = parsed(words)? else { anyhow::bail!("no command that estimates") };
    let EstimateArgs { out, .. } = &args;
    let opened = super::estimate::open(&args)?;
    let mark = results.with_extension("json");
    let described = json!({ "program": program(), "estimate": opened.description() }).to_string();
    if results.is_file() && std::fs::read_to_string(&mark).is_ok_and(|known| known == described) {
        return Ok(());
    }
    output::message(format_args!("{}: {}", method.title(), opened.dataset.root().display()));
    let progress = Bar::new("images");
    let estimated = opened.run(&args).write(out, true, &progress);
    progress.finish();
    estimated?;
    Ok(bop::write_atomic(&mark, described.as_bytes())?)
}

/// Errors, and seconds of an image in the mean.
fn evaluated(dataset: &Dataset, results: &Path) -> Result<(Evaluation, Option<f64>)> {
    let estimates = read_results(results)?;
    let times: std::collections::BTreeMap<(u32, u32), f64> =
        estimates.iter().filter_map(|e| Some(((e.scene_id, e.im_id), e.time_s?))).collect();
    let mean = (!times.is_empty()).then(|| times.values().sum::<f64>() / times.len() as f64);
    Ok((evaluate(dataset, &estimates)?, mean))
}

fn real(method: &MethodChoice, frames: &Path, folder: &str) -> Result<Evaluation> {
    let set = frames.to_str().with_context(|| format!("--real {}: is no text", frames.display()))?;
    let (words, results) = estimate_words(method, set, folder, "-real");
    estimate(&words, &results, method)?;
    Ok(evaluated(&Dataset::open(frames, None)?, &results)?.0)
}

/// Writes the table in each format, and the curves.
fn write(args: &ReproduceArgs, scenes: &str, columns: &[Column]) -> Result<()> {
    let methods: Vec<Method<'_>> = columns
        .iter()
        .map(|Column { title, evaluation, table, .. }| Method { title, evaluation, table })
        .collect();
    let table = Table::new(&methods);
    let figure = plot::svg(&curves(&methods))?;
    let report = Table1 {
        schema: SCHEMA,
        scenes,
        methods: columns
            .iter()
            .map(|column| MethodReport {
                name: &column.title,
                command: &column.command,
                image_s: column.image_s,
                table: &column.table,
                real: column.real.as_ref().map(|evaluation| &evaluation.all),
            })
            .collect(),
    };
    let commands: Vec<&str> =
        std::iter::once(scenes).chain(columns.iter().map(|column| column.command.as_str())).collect();
    for (name, text) in [
        ("table1.md", markdown(&table, columns, &commands)),
        ("table1.tex", table.latex()),
        ("table1.html", page(&table, columns, &commands, &figure)),
        ("table1.json", serde_json::to_string_pretty(&report)? + "\n"),
        ("accuracy.svg", figure),
    ] {
        bop::write_atomic(&args.out.join(name), text.as_bytes())?;
    }
    if args.json {
        return output::json(&report);
    }
    output::data(format_args!("{}", table.markdown()))?;
    output::made("table", &args.out.join("table1.html"));
    Ok(())
}

/// What the numbers are.
const NOTE: &str = "Area under the accuracy-threshold curve up to 4 cm, mean of the objects, with 95 % intervals of the last row (scenes \
                    drawn again); ADD-S for objects with a star, ADD for the others. Columns marked \"paper\" are Chen et al. 2019, Table I, \
                    on its own real scenes, the last row over the objects that ours hold: no contest on one data set.";

fn markdown(table: &Table, columns: &[Column], commands: &[&str]) -> String {
    let mut text = format!("# Table I\n\n{NOTE}\n\n{}\n", table.markdown());
    text += "| method | seconds of an image |\n|---|---|\n";
    for column in columns {
        let seconds = column.image_s.map_or_else(|| "-".to_owned(), |seconds| format!("{seconds:.2}"));
        let _ = writeln!(text, "| {} | {seconds} |", column.title);
    }
    text += "\n![Curves of the four objects that the paper draws](accuracy.svg)\n";
    if columns.iter().any(|column| column.real.is_some()) {
        text += "\n## Real frames\n\n| method | AR | ADD-S area | ADD(-S) area |\n|---|---|---|---|\n";
        for (title, [ar, adds, add_or_adds]) in real_rows(columns) {
            let _ = writeln!(text, "| {title} | {ar} | {adds} | {add_or_adds} |");
        }
    }
    let _ = write!(text, "\n```sh\n{}\n```\n", commands.join("\n"));
    text
}

/// Average recall and areas up to 4 cm, per cent, of each method on the real frames.
fn real_rows(columns: &[Column]) -> impl Iterator<Item = (&str, [String; 3])> {
    let percent = |share: f64| format!("{:.1}", 100.0 * share);
    columns.iter().filter_map(move |column| {
        let all = &column.real.as_ref()?.all;
        let ar = all.bop.average.ar.map_or_else(|| "-".to_owned(), percent);
        Some((column.title.as_str(), [ar, percent(all.auc_adds[0]), percent(all.auc_add_or_adds[0])]))
    })
}

fn page(table: &Table, columns: &[Column], commands: &[&str], figure: &str) -> String {
    let mut page = String::new();
    html::begin(&mut page, "Table I", "Pose estimators on adversarial scenes", None);
    let _ = write!(page, "<p>{}</p>{}", html::escape(NOTE), table.html());
    if columns.iter().any(|column| column.real.is_some()) {
        page += "<h2>Real frames</h2><table><tr><th>method<th class=n>AR<th class=n>ADD-S area<th class=n>ADD(-S) area";
        for (title, cells) in real_rows(columns) {
            let _ = write!(page, "<tr><td>{}<td class=n>{}", html::escape(title), cells.join("<td class=n>"));
        }
        page += "</table>";
    }
    let _ = write!(
        page,
        "<h2>Curves</h2>{figure}<h2>Commands</h2><pre>{}</pre></html>",
        html::escape(&commands.join("\n"))
    );
    page
}
