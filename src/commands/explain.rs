//! `grip explain`: a picture that shows why to believe the pose estimates of an image, or not.

use anyhow::Result;
use grip_sim::bop::results::read_results;
use grip_sim::bop::{self, Dataset};
use serde_json::json;

use super::Done;
use super::output;
use crate::cli::ExplainArgs;
use grip::explain::{Explained, Explanation, INLIER_M, LEAST_SCORE};
use grip::{pictures, plot};

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
        let json = json!({
            "schema": "grip.explain/1",
            "dataset": args.dataset,
            "split": dataset.split(),
            "results": args.results,
            "scene_id": args.scene,
            "im_id": args.image,
            "out": args.out,
            "inlier_m": INLIER_M,
            "least_score": if args.all { None } else { Some(LEAST_SCORE) },
            "truth_drawn": args.truth,
            "shares": explanation.shares,
            "estimates": explanation.explained,
        });
        return output::data(format_args!("{}", serde_json::to_string_pretty(&json)?));
    }
    let rows = explanation.explained.iter().map(Explained::row);
    output::data(format_args!(
        "{}\n{}: shares of the covered pixels, median of observed minus rendered depth{}",
        output::table(Explained::HEADER, &[1, 2, 3, 4, 5, 6, 7], rows),
        args.out.display(),
        if args.truth { "; outlines of the TRUTH drawn, too" } else { "" },
    ))
}
