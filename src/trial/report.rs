//! report.html: one file that shows a trial, pictures and all, without a network.

use std::fmt::Write as _;

use anyhow::Result;
use grip_sim::images::{DepthImage, RgbImage};
use grip_sim::pose::{Camera, Pose, World};

use super::TrialRecord;
use crate::html::{self, escape, picture};
use crate::pictures;
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

/// The page.
///
/// # Errors
/// When a picture cannot be encoded.
pub fn html(trial: &TrialRecord) -> Result<String> {
    let TrialRecord { result, looks, after, strips, replay, recording, .. } = trial;
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
    if let (Some(first), Some(after)) = (looks.first(), after) {
        page.push_str("<h2>Before and after</h2><div class=look>");
        figure(&mut page, &first.rgb, "the scene at the start")?;
        figure(&mut page, after, "the scene at the end")?;
        page.push_str("</div>");
    }
    if let Some(glb) = recording.as_ref().and_then(Recording::replay) {
        page.push_str("<h2>Replay</h2>");
        page.push_str(&viewer::html(glb));
    }
    if let Some(gif) = replay {
        page.push_str("<h2>Animation</h2><div class=look>");
        picture(&mut page, "image/gif", gif, "four times as fast");
        page.push_str("</div>");
    }
    if !strips.is_empty() {
        page.push_str("<h2>Attempts</h2>");
    }
    for strip in strips {
        page.push_str("<div class=strip>");
        for (k, (name, shot)) in strip.pictures.iter().enumerate() {
            let caption = if k == 0 { format!("{}: {name}", strip.object) } else { (*name).to_string() };
            picture(&mut page, "image/jpeg", &pictures::jpeg(shot)?, &escape(&caption));
        }
        page.push_str("</div>");
    }
    for (i, look) in looks.iter().enumerate() {
        let _ = write!(page, "<h2>Look {}: {}</h2><div class=look>", i + 1, escape(&look.caption));
        figure(&mut page, &look.rgb, "colour")?;
        let depth = pictures::depth_color(&look.depth);
        figure(&mut page, &depth, "depth, near yellow to far blue, black no reading")?;
        figure(&mut page, &look.overlay, "estimated poses")?;
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
            "<tr><td><span class=key style='background:rgb({r},{g},{b})'></span>{}<td class={class}>{}<td>{:?}<td>{}\
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
