//! report.html: one file that shows a trial, pictures and all, without a network.

use std::fmt::Write as _;

use anyhow::Result;
use grip_sim::images::{DepthImage, RgbImage};
use grip_sim::pose::{Camera, Pose, World};

use image::imageops::{self, FilterType};

use super::TrialRecord;
use super::film::BeforeAfter;
use crate::html::{self, escape, picture};
use crate::pictures::{self, Tone};
use crate::record::{Recording, viewer};
use crate::score::outcome::{ItemResult, ItemTiming, Outcome, TrialResult};

/// The pictures of one look.
#[derive(Debug, Clone)]
pub struct LookPictures {
    /// What was looked for and what was decided.
    pub caption: String,
    /// Colour.
    pub rgb: RgbImage,
    /// Depth, metres.
    pub depth: DepthImage,
    /// Colour with the estimated poses as outlines.
    pub overlay: RgbImage,
    /// Objects that were looked for, positions in the setup's list.
    pub asked: Vec<usize>,
    /// Where the camera was.
    pub world_from_camera: Pose<World, Camera>,
}

impl LookPictures {
    /// What a person looks at, each with its caption: colour, the same brightened if it is dark, depth, estimated poses.
    pub fn pictures(&self) -> Vec<(String, RgbImage)> {
        let mut shown = vec![("what the camera saw".to_owned(), self.rgb.clone())];
        let depth = ("depth, black where there is none".to_owned(), pictures::depth_picture(&self.depth));
        match pictures::brightened(&self.rgb) {
            None => shown.extend([depth, ("estimated poses".to_owned(), self.overlay.clone())]),
            Some((bright, gain)) => {
                let marked = pictures::marks_on(&bright, &self.rgb, &self.overlay);
                shown.push((format!("the same, brightened {gain:.0} times for people"), bright));
                shown.extend([depth, ("estimated poses, on the brightened picture".to_owned(), marked)]);
            }
        }
        shown
    }
}

/// summary.png: the scene before and after, the first look, and what the fingers did first; none without pictures.
pub fn summary(trial: &TrialRecord) -> Option<RgbImage> {
    let (BeforeAfter { before, after }, first) = (trial.before_after.as_ref()?, trial.looks.first()?);
    let captioned =
        |(caption, picture): &(String, RgbImage)| pictures::captioned(picture, caption, Tone::Plain);
    let result = &trial.result;
    let whole = [
        ("before".to_owned(), before.clone()),
        (format!("after: {} of {} packed", result.packed, result.requested), after.clone()),
    ];
    let [before, after] = whole.each_ref().map(captioned);
    let look: Vec<RgbImage> = first.pictures().iter().map(captioned).collect();
    let mut cells = vec![before];
    cells.extend(look.iter().take(2).cloned());
    cells.push(after);
    cells.extend(look.into_iter().skip(2));
    // A look in the dark has one picture more.
    let contact = trial.strips.iter().find_map(|strip| Some((strip, strip.shots.get(1)?)));
    if let Some((strip, shot)) = contact.filter(|_| cells.len() < 6) {
        let [width, height] = [first.rgb.width(), first.rgb.height()];
        let shown = imageops::resize(&shot.picture, width, height, FilterType::CatmullRom);
        cells.push(captioned(&(format!("{}, {}", strip.object, shot.caption), shown)));
    }
    Some(pictures::sheet(&cells, 3))
}

/// The page.
///
/// # Errors
/// When a picture cannot be encoded.
pub fn html(trial: &TrialRecord) -> Result<String> {
    let TrialRecord { result, looks, before_after, strips, replay, recording, .. } = trial;
    let (wall_s, times) = result.timing.as_ref().map_or((0.0, [].as_slice()), |t| (t.wall_s, &t.items));
    let mut page = String::new();
    let TrialResult { packed, requested, scene, condition, seed, renderer, .. } = result;
    let title = format!("{packed} of {requested} packed: scene {scene}, condition {condition}, seed {seed}");
    html::begin(&mut page, "One trial", &title, Some(renderer));
    if result.estimator == "truth" {
        page.push_str(
            "<p class=note><b>Estimator: truth.</b> Poses were read from the simulator. This is a ceiling, not a result.</p>",
        );
    }
    // Writing to a String cannot fail.
    let _ = write!(
        page,
        "<p>Estimator {}, grasps of {}, detector {}, objects {}, renderer {}, hypotheses {}. {:.1} s simulated in {:.1} s. State <code>{}</code>.</p>",
        result.estimator,
        result.grasper,
        result.detector,
        result.object_set,
        result.renderer,
        result.hypotheses,
        result.sim_s,
        wall_s,
        &result.state_hash[..16.min(result.state_hash.len())]
    );
    page.push_str("<h2>Items</h2>");
    items_table(&mut page, &result.items, times);
    let _ = write!(page, "<p>{}.</p>", escape(&result.score.to_string()));
    for item in result.items.iter().filter(|item| !item.failed_attempts.is_empty()) {
        let reasons: Vec<_> = item.failed_attempts.iter().map(|f| f.reason.as_str()).collect();
        let _ = write!(
            page,
            "<p>Failed attempts at {}: {}.</p>",
            escape(&item.name()),
            escape(&reasons.join("; "))
        );
    }
    if let Some(BeforeAfter { before, after }) = before_after {
        page.push_str("<h2>Before and after</h2><div class=look>");
        figure(&mut page, before, "the scene at the start")?;
        figure(&mut page, after, "the scene at the end")?;
        page.push_str("</div>");
    }
    if let Some(glb) = recording.as_ref().and_then(Recording::replay) {
        page.push_str("<h2>Replay</h2>");
        page.push_str(&viewer::html(glb));
    }
    if let Some(animation) = replay {
        page.push_str("<h2>Animation</h2><div class=look>");
        picture(&mut page, "image/png", animation, "four times as fast");
        page.push_str("</div>");
    }
    if !strips.is_empty() {
        page.push_str(
            "<h2>Attempts</h2><p>Arrows are the forces of the right (magenta) and the left finger (cyan) on the object.</p>",
        );
    }
    for strip in strips {
        let class = if strip.failed { "bad" } else { "ok" };
        let _ = write!(page, "<h3 class={class}>{}</h3><div class=strip>", escape(&strip.title));
        for shot in &strip.shots {
            picture(&mut page, "image/jpeg", &pictures::jpeg(&shot.picture)?, &escape(&shot.caption));
        }
        page.push_str("</div>");
    }
    for (i, look) in looks.iter().enumerate() {
        let _ = write!(page, "<h2>Look {}: {}</h2><div class=look>", i + 1, escape(&look.caption));
        for (caption, image) in look.pictures() {
            figure(&mut page, &image, &caption)?;
        }
        page.push_str("</div>");
    }
    page.push_str("</html>\n");
    Ok(page)
}

fn items_table(page: &mut String, items: &[ItemResult], times: &[ItemTiming]) {
    page.push_str(
        "<table><tr><th>object<th>outcome<th>stage<th>why<th class=n>tries<th class=n>ADD mm<th class=n>ADD-S mm\
         <th class=n>slip mm<th class=n>peak N<th class=n>estimate s<th class=n>plan s<th>clauses that failed</tr>",
    );
    for (i, item) in items.iter().enumerate() {
        let time = times.get(i).copied().unwrap_or(ItemTiming { estimate_s: 0.0, plan_s: 0.0 });
        let class = if item.outcome == Outcome::Packed { "ok" } else { "bad" };
        let [r, g, b] = pictures::color(i as u16 + 1);
        let mm = |metres: Option<f64>| metres.map_or("–".to_string(), |m| format!("{:.1}", m * 1e3));
        let _ = write!(
            page,
            "<tr><td class=w><span class=key style='background:rgb({r},{g},{b})'></span>{}<td class={class}>{}<td>{:?}<td>{}\
             <td class=n>{}<td class=n>{}<td class=n>{}<td class=n>{}<td class=n>{:.0}<td class=n>{:.2}<td class=n>{:.2}<td>{}</tr>",
            escape(&item.name()),
            item.outcome.words(),
            item.stage,
            escape(&item.reason),
            item.attempts,
            mm(item.add_m),
            mm(item.adds_m),
            mm(item.slip_m),
            item.peak_force_n,
            time.estimate_s,
            time.plan_s,
            failed_clauses(item)
        );
    }
    page.push_str("</table>");
}

fn failed_clauses(item: &ItemResult) -> String {
    let failed: Vec<_> =
        item.clauses.by_name().iter().filter(|(_, holds)| !holds).map(|(name, _)| *name).collect();
    failed.join(", ")
}

fn figure(page: &mut String, image: &RgbImage, caption: &str) -> Result<()> {
    picture(page, "image/jpeg", &pictures::jpeg(image)?, caption);
    Ok(())
}
