//! `grip explain`: a picture that shows why to believe the pose estimates of an image, or not.

use std::path::Path;

use anyhow::Result;
use grip_sim::bop::results::read_results;
use grip_sim::bop::{self, Dataset};
use schemars::JsonSchema;
use serde::Serialize;

use super::Done;
use super::output;
use crate::cli::ExplainArgs;
use crate::explain::{Explained, Explanation, INLIER_M, LEAST_SCORE, Shares};
use crate::{pictures, plot};

/// Version of what `--json` prints.
pub const SCHEMA: &str = "grip.explain/1";

/// What `--json` prints.
#[derive(Serialize, JsonSchema)]
pub struct ExplainReport<'a> {
    schema: &'static str,
    #[serde(serialize_with = "grip_sim::files::shown")]
    dataset: &'a Path,
    split: &'a str,
    #[serde(serialize_with = "grip_sim::files::shown")]
    results: &'a Path,
    scene_id: u32,
    im_id: u32,
    /// The picture.
    #[serde(serialize_with = "grip_sim::files::shown")]
    out: &'a Path,
    /// Depth that differs less than this from what is rendered counts as explained, metres.
    inlier_m: f64,
    /// Estimates of a lower score are left out; null for none.
    least_score: Option<f64>,
    /// Whether outlines of the truth are in the picture.
    truth_drawn: bool,
    /// Of all estimates together.
    shares: Option<&'a Shares>,
    estimates: &'a [Explained],
}

/// Draws the picture.
pub fn run(args: &ExplainArgs) -> Result<Done> {
    plot::check_place(&args.out)?;
    let dataset = Dataset::open(&args.dataset, args.split.as_deref())?;
    let (scene, image) = (args.scene, args.image);
    let scenes = dataset.scenes()?;
    anyhow::ensure!(
        scenes.contains(&scene),
        "{}: has no scene {scene}; it has {} scenes from {} to {}",
        dataset.root().join(dataset.split()).display(),
        scenes.len(),
        scenes.first().unwrap_or(&0),
        scenes.last().unwrap_or(&0)
    );
    let frame = dataset.frame(scene, image)?;
    let mut estimates = read_results(&args.results)?;
    let (count, first) = (estimates.len(), estimates.first().map(|e| (e.scene_id, e.im_id)));
    estimates.retain(|estimate| (estimate.scene_id, estimate.im_id) == (scene, image));
    anyhow::ensure!(
        !estimates.is_empty(),
        "{}: has no estimate of scene {scene}, image {image}{}",
        args.results.display(),
        first.map_or_else(
            || "; it is empty".to_owned(),
            |(s, i)| format!("; it has {count} estimates, the first of scene {s}, image {i}")
        )
    );
    let mut explanation = Explanation::new(&dataset, frame, estimates, args.all)?;
    if args.truth {
        explanation.load_truth(&dataset)?;
    }
    let short =
        |path: &std::path::Path| path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    let title = format!(
        "{}, {}, scene {scene}, image {image}: {}",
        short(&args.dataset),
        dataset.split(),
        short(&args.results)
    );
    let picture = explanation.picture(&title, args.truth);
    bop::write_atomic(&args.out, &pictures::rgb_png(&picture)?)?;
    report(args, &dataset, &explanation)?;
    Ok(Done::Fully)
}

fn report(args: &ExplainArgs, dataset: &Dataset, explanation: &Explanation) -> Result<()> {
    if args.json {
        return output::json(&ExplainReport {
            schema: SCHEMA,
            dataset: &args.dataset,
            split: dataset.split(),
            results: &args.results,
            scene_id: args.scene,
            im_id: args.image,
            out: &args.out,
            inlier_m: INLIER_M,
            least_score: (!args.all).then_some(LEAST_SCORE),
            truth_drawn: args.truth,
            shares: explanation.shares.as_ref(),
            estimates: &explanation.explained,
        });
    }
    let rows = explanation.explained.iter().map(Explained::row);
    output::data(format_args!(
        "{}\n{}: shares of the covered pixels, median of observed minus rendered depth, agreement of print and picture{}",
        output::table(Explained::HEADER, &[1, 2, 3, 4, 5, 6, 7, 8], rows),
        args.out.display(),
        if args.truth { "; outlines of the TRUTH drawn, too" } else { "" },
    ))
}
