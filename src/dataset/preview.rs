//! A contact sheet of any BOP data set: colour, depth and masks of some scenes, with names.

use std::path::Path;

use anyhow::Result;
use grip_sim::bop::Dataset;
use grip_sim::images::{DepthImage, RgbImage};
use image::imageops::{self, FilterType};
use rayon::prelude::*;

use crate::pictures;

/// Scenes and frames shown; a sheet of more is no longer looked at.
const SCENES: usize = 4;
const FRAMES: usize = 7;
/// Width of a picture on the sheet, pixels.
const WIDTH: u32 = 240;

/// Draws the first scenes of `dataset`: a column a frame; colour, depth and masks below each other.
///
/// # Errors
/// When a file of the set is missing or wrong.
pub fn sheet(dataset: &Dataset) -> Result<RgbImage> {
    let mut shown: Vec<(u32, Vec<u32>)> = Vec::new();
    for scene in dataset.scenes()?.into_iter().take(SCENES) {
        shown.push((scene, dataset.images(scene)?.into_iter().take(FRAMES).collect()));
    }
    let columns = shown.iter().map(|(_, images)| images.len()).max().unwrap_or(1).max(1);
    let mut rows = Vec::new();
    for (scene, images) in &shown {
        let names = frame_names(dataset, *scene);
        let frames: Vec<[RgbImage; 3]> = images
            .par_iter()
            .enumerate()
            .map(|(i, &image)| {
                let name = names.get(i).cloned().unwrap_or_else(|| format!("{scene:06}/{image:06}"));
                cell(dataset, *scene, image, &name)
            })
            .collect::<Result<_>>()?;
        for kind in 0..3 {
            let mut row: Vec<RgbImage> = frames.iter().map(|pictures| pictures[kind].clone()).collect();
            if let Some(first) = row.first() {
                let blank = RgbImage::from_pixel(first.width(), first.height(), image::Rgb([255; 3]));
                row.resize(columns, blank);
            }
            rows.extend(row);
        }
    }
    Ok(pictures::sheet(&rows, columns as u32))
}

/// Colour with its name, depth, and masks over faint grey.
fn cell(dataset: &Dataset, scene: u32, image: u32, name: &str) -> Result<[RgbImage; 3]> {
    let frame = dataset.frame(scene, image)?;
    let mut masks = RgbImage::from_fn(frame.rgb.width(), frame.rgb.height(), |u, v| {
        let [r, g, b] = frame.rgb.get_pixel(u, v).0.map(u32::from);
        image::Rgb([((r + g + b) / 9) as u8; 3])
    });
    for (i, truth) in frame.ground_truths.iter().flatten().enumerate() {
        // A set without masks shows none.
        let Some(mask) = dataset.mask_visib(scene, image, i)? else { continue };
        for (pixel, _) in masks.pixels_mut().zip(mask.data()).filter(|(_, covered)| **covered) {
            pixel.0 = pictures::color(truth.obj_id as u16);
        }
    }
    let height = (WIDTH * frame.rgb.height() / frame.rgb.width()).max(1);
    let small = |picture: &RgbImage, filter| imageops::resize(picture, WIDTH, height, filter);
    let mut rgb = small(&frame.rgb, FilterType::Triangle);
    pictures::write_text(&mut rgb, name);
    Ok([
        rgb,
        pictures::depth_picture(&smaller(&frame.depth, WIDTH, height)),
        small(&masks, FilterType::Nearest),
    ])
}

/// Every so many readings of a depth image, as they are: means of near and far would be depths of nothing.
fn smaller(depth: &DepthImage, width: u32, height: u32) -> DepthImage {
    let mut small = DepthImage::filled(width as usize, height as usize, 0.0);
    let from =
        |i: usize, small: u32, large: usize| ((2 * i + 1) * large / (2 * small as usize)).min(large - 1);
    for v in 0..height as usize {
        for u in 0..width as usize {
            *small.at_mut(u, v) = *depth.at(from(u, width, depth.width()), from(v, height, depth.height()));
        }
    }
    small
}

/// The names in our own `scene_info.json`; other sets have none.
fn frame_names(dataset: &Dataset, scene: u32) -> Vec<String> {
    let path = dataset.root().join(dataset.split()).join(format!("{scene:06}/scene_info.json"));
    let read = |path: &Path| -> Option<Vec<String>> {
        let value: serde_json::Value = serde_json::from_slice(&std::fs::read(path).ok()?).ok()?;
        let frames = value["frames"].as_array()?.iter();
        Some(frames.filter_map(|frame| frame["name"].as_str().map(str::to_owned)).collect())
    };
    read(&path).unwrap_or_default()
}
