//! `grip detect`: the first stage alone, on a picture or on a data set.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use anyhow::{Context, Result};
use grip_perception::{Detection, HeatMaps, PyramidCnn};
use grip_sim::bop::{self, Dataset};
use grip_sim::images::RgbImage;
use grip_sim::objects::ObjectModel;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use super::Done;
use super::output::{self, Bar};
use crate::benchmark::{
    DetectionFigures, FileBox, MOST_BOXES, ObjectImage, measure, object_names, object_title, truth_boxes,
    views,
};
use crate::cli::DetectArgs;
use crate::progress::Progress;
use crate::{pictures, plot};

/// Detects.
pub fn run(args: &DetectArgs) -> Result<Done> {
    let input = args.input.display();
    anyhow::ensure!(args.input.exists(), "{input}: no such picture or data set");
    let network = args.network.options().open(&args.settings.load()?.perception.detector.pyramid)?;
    let threads = args.jobs.unwrap_or(0) as usize;
    let pool =
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().context("cannot start threads")?;
    pool.install(
        || if args.input.is_dir() { of_dataset(args, &network) } else { of_picture(args, &network) },
    )?;
    Ok(Done::Fully)
}

/// A box of a picture.
/// Version of what `--json` prints of a data set.
pub const SCHEMA: &str = "grip.detect/2";
/// And of a picture.
pub const IMAGE_SCHEMA: &str = "grip.detect-image/2";

/// What `--json` prints of a data set.
#[derive(Serialize, JsonSchema)]
pub struct DetectReport<'a> {
    schema: &'static str,
    #[serde(serialize_with = "grip_sim::files::shown")]
    dataset: &'a Path,
    split: &'a str,
    /// The network, and what runs it.
    network: String,
    /// Boxes of a lower confidence are left out of pictures.
    min_confidence: f64,
    images: usize,
    wall_s: f64,
    /// Median of an image, seconds.
    latency_s: f64,
    all: DetectionFigures,
    /// By object number.
    objects: BTreeMap<u32, DetectionFigures>,
    /// By name.
    views: BTreeMap<&'a str, DetectionFigures>,
}

/// What `--json` prints of a picture.
#[derive(Serialize, JsonSchema)]
pub struct ImageReport<'a> {
    schema: &'static str,
    #[serde(serialize_with = "grip_sim::files::shown")]
    image: &'a Path,
    /// Boxes of a lower confidence are left out.
    min_confidence: f64,
    /// The network, and what runs it.
    network: String,
    seconds: f64,
    /// The most confident first.
    boxes: Vec<Found<'a>>,
}

/// A box of an object.
#[derive(Serialize, JsonSchema)]
struct Found<'a> {
    object: &'a str,
    bop_id: u32,
    confidence: f64,
    /// Left, top, width, height, pixels.
    bbox: [f64; 4],
}

fn of_picture(args: &DetectArgs, network: &PyramidCnn) -> Result<()> {
    anyhow::ensure!(
        args.out.is_none() && args.split.is_none(),
        "--out and --split are for data sets; {} is a file",
        args.input.display()
    );
    if let Some(path) = &args.heatmaps {
        plot::check_place(path)?;
    }
    let picture = grip_sim::pictures::upright(&args.input)?;
    let began = Instant::now();
    let maps = network.look(&picture)?;
    let seconds = began.elapsed().as_secs_f64();
    let mut found: Vec<(usize, Detection)> = (1..=maps.description().objects.len())
        .flat_map(|class| maps.boxes(class).into_iter().map(move |detection| (class, detection)))
        .filter(|(_, detection)| detection.confidence >= args.network.min_confidence)
        .collect();
    found.sort_by(|a, b| b.1.confidence.total_cmp(&a.1.confidence));
    found.truncate(args.top as usize);
    if let Some(path) = &args.heatmaps {
        bop::write_atomic(path, &pictures::rgb_png(&pictures::heatmaps(&picture, &maps, &found))?)?;
    }
    let objects = &maps.description().objects;
    let found: Vec<Found<'_>> = found
        .iter()
        .map(|(class, detection)| Found {
            object: &objects[class - 1].name,
            bop_id: objects[class - 1].bop_id,
            confidence: detection.confidence,
            bbox: FileBox::new((0, 0), objects[class - 1].bop_id, detection).bbox,
        })
        .collect();
    if args.json {
        return output::json(&ImageReport {
            schema: IMAGE_SCHEMA,
            image: &args.input,
            min_confidence: args.network.min_confidence,
            network: network.to_string(),
            seconds,
            boxes: found,
        });
    }
    let rows = found.iter().map(|f| {
        let [x, y, w, h] = f.bbox.map(|x| format!("{x:.0}"));
        [f.object.to_owned(), format!("{:.3}", f.confidence), x, y, w, h]
    });
    let header = ["object", "confidence", "left", "top", "width", "height"];
    output::data(format_args!(
        "{}\n{network}: {:.0} ms, the first one of a run; the {} most confident boxes{}",
        output::table(header, &[1, 2, 3, 4, 5], rows),
        1e3 * seconds,
        found.len(),
        without(args.network.min_confidence),
    ))
}

/// What came of an image.
struct Looked {
    key: (u32, u32),
    objects: Vec<ObjectImage>,
}

fn of_dataset(args: &DetectArgs, network: &PyramidCnn) -> Result<()> {
    if let Some(path) = &args.out {
        plot::check_place(path)?;
    }
    if let Some(folder) = &args.heatmaps {
        std::fs::create_dir_all(folder).with_context(|| format!("--heatmaps {}", folder.display()))?;
    }
    let dataset = Dataset::open(&args.input, args.split.as_deref())?;
    let classes = classes(network, &dataset)?;
    let mut images = Vec::new();
    for scene in dataset.scenes()? {
        images.extend(dataset.images(scene)?.into_iter().map(|image| (scene, image)));
    }
    let latency_s = latency(network, &dataset, &images)?;
    let progress = Bar::new("images");
    progress.begin(images.len() as u64, 0);
    let began = Instant::now();
    let looked: Vec<Looked> = images
        .par_iter()
        .map(|key| {
            let looked = look(args, network, &dataset, &classes, *key)
                .with_context(|| format!("scene {}, image {}", key.0, key.1));
            progress.advance(1);
            looked
        })
        .collect::<Result<_>>()?;
    progress.finish();
    let wall_s = began.elapsed().as_secs_f64();
    if let Some(path) = &args.out {
        let boxes: Vec<FileBox> = looked.iter().flat_map(file_boxes).collect();
        bop::write_atomic(path, serde_json::to_string(&boxes)?.as_bytes())?;
    }
    report(args, network, &dataset, &looked, [wall_s, latency_s])
}

/// Seconds that one image takes when it has the machine to itself: the median of the first five, after one that does not count.
fn latency(network: &PyramidCnn, dataset: &Dataset, images: &[(u32, u32)]) -> Result<f64> {
    let mut seconds = Vec::new();
    for (i, (scene, image)) in images.iter().take(5).enumerate() {
        let rgb = dataset.frame(*scene, *image)?.rgb;
        if i == 0 {
            network.look(&rgb)?;
        }
        let began = Instant::now();
        let maps = network.look(&rgb)?;
        (1..=maps.description().objects.len()).for_each(|class| drop(maps.boxes(class)));
        seconds.push(began.elapsed().as_secs_f64());
    }
    seconds.sort_by(f64::total_cmp);
    Ok(seconds.get(seconds.len() / 2).copied().unwrap_or_default())
}

/// The network's class of an object, and the object.
type Class = (usize, Arc<ObjectModel>);

/// Those of all objects of a data set.
fn classes(network: &PyramidCnn, dataset: &Dataset) -> Result<Vec<Class>> {
    let mut classes = Vec::new();
    for id in dataset.model_ids()? {
        let object = crate::benchmark::load_object(dataset, id)?;
        classes.push((network.class_of(&object)?, object));
    }
    Ok(classes)
}

fn look(
    args: &DetectArgs,
    network: &PyramidCnn,
    dataset: &Dataset,
    classes: &[Class],
    key: (u32, u32),
) -> Result<Looked> {
    let frame = dataset.frame(key.0, key.1)?;
    let maps = network.look(&frame.rgb)?;
    let boxes: Vec<Vec<Detection>> = classes.iter().map(|(class, _)| maps.boxes(*class)).collect();
    let objects = classes
        .iter()
        .zip(&boxes)
        .map(|((_, object), boxes)| {
            let id = object.info.bop_id;
            Ok(ObjectImage {
                object: id,
                truth: truth_boxes(&frame, object)?,
                found: boxes
                    .iter()
                    .filter(|detection| detection.confidence >= args.network.min_confidence)
                    .take(MOST_BOXES)
                    .map(|detection| (FileBox::new(key, id, detection).bbox, detection.confidence))
                    .collect(),
            })
        })
        .collect::<Result<_>>()?;
    if let Some(folder) = &args.heatmaps {
        draw(args, folder, &maps, &frame.rgb, classes, &boxes, key)?;
    }
    Ok(Looked { key, objects })
}

fn draw(
    args: &DetectArgs,
    folder: &Path,
    maps: &HeatMaps,
    rgb: &RgbImage,
    classes: &[Class],
    boxes: &[Vec<Detection>],
    key: (u32, u32),
) -> Result<()> {
    let mut top: Vec<(usize, Detection)> = classes
        .iter()
        .zip(boxes)
        .flat_map(|((class, _), boxes)| boxes.iter().map(|b| (*class, *b)))
        .collect();
    top.retain(|(_, detection)| detection.confidence >= args.network.min_confidence);
    top.sort_by(|a, b| b.1.confidence.total_cmp(&a.1.confidence));
    top.truncate(args.top as usize);
    let path: PathBuf = folder.join(format!("{:06}_{:06}.png", key.0, key.1));
    Ok(bop::write_atomic(&path, &pictures::rgb_png(&pictures::heatmaps(rgb, maps, &top))?)?)
}

fn file_boxes(looked: &Looked) -> impl Iterator<Item = FileBox> {
    let (scene_id, image_id) = looked.key;
    looked.objects.iter().flat_map(move |object| {
        object.found.iter().map(move |&(bbox, score)| FileBox {
            scene_id,
            image_id,
            category_id: object.object,
            bbox,
            score,
        })
    })
}

fn report(
    args: &DetectArgs,
    network: &PyramidCnn,
    dataset: &Dataset,
    looked: &[Looked],
    [wall_s, latency_s]: [f64; 2],
) -> Result<()> {
    let names = views(dataset)?;
    let of_view = |view: Option<&str>| {
        let images =
            looked.iter().filter(|l| view.is_none_or(|view| names.get(&l.key).is_some_and(|n| n == view)));
        measure(images.flat_map(|l| &l.objects))
    };
    let mut known: Vec<&str> = names.values().map(String::as_str).collect();
    known.sort_unstable();
    known.dedup();
    let by_view: Vec<(&str, DetectionFigures)> = known.into_iter().map(|v| (v, of_view(Some(v)).1)).collect();
    let (by_object, all) = of_view(None);
    if all.instances == 0 {
        output::message(format_args!(
            "{}: has no boxes of the truth to compare with; they are in scene_gt.json of its scenes",
            args.input.display()
        ));
    }
    if args.json {
        return output::json(&DetectReport {
            schema: SCHEMA,
            dataset: &args.input,
            split: dataset.split(),
            network: network.to_string(),
            min_confidence: args.network.min_confidence,
            images: looked.len(),
            wall_s,
            latency_s,
            all,
            objects: by_object,
            views: by_view.into_iter().collect(),
        });
    }
    let shown = |share: Option<f64>| share.map_or_else(|| "-".to_owned(), |x| format!("{:.1}", 100.0 * x));
    let row = |name: String, f: &DetectionFigures| {
        [
            name,
            f.instances.to_string(),
            shown(f.ap50),
            shown(f.ap),
            shown(f.recall50),
            shown(f.ar),
            shown(f.top1),
        ]
    };
    let objects = object_names(dataset);
    let rows = by_object
        .iter()
        .map(|(id, f)| row(object_title(&objects, *id), f))
        .chain(by_view.iter().map(|(name, f)| row(format!("view {name}"), f)))
        .chain([row("all".into(), &all)]);
    let header = ["", "instances", "AP50", "AP", "recall@100", "AR@100", "best box right"];
    output::data(format_args!(
        "{}\n{network}: {} images in {wall_s:.1} s; one alone takes {:.0} ms; per cent, means of the objects{}",
        output::table(header, &[1, 2, 3, 4, 5, 6], rows),
        looked.len(),
        1e3 * latency_s,
        without(args.network.min_confidence)
    ))
}

fn without(threshold: f64) -> String {
    if threshold > 0.0 { format!(", without boxes under {threshold}") } else { String::new() }
}
