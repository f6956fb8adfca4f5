//! The picture: four panels with captions and legends, and a table below.

use grip_sim::bop::BopFrame;
use grip_sim::camera::Intrinsics;
use grip_sim::images::RgbImage;
use grip_sim::pose::{Camera, Object, Pose};
use grip_sim::render::silhouette;
use image::imageops::{self, FilterType};
use noto_sans_mono_bitmap::{FontWeight, RasterHeight};

use super::{Explained, Explanation, INLIER_M, LEAST_SCORE, Verdict};
use crate::pictures::{draw_text, fill, text_width};

/// Residuals are clipped at this, metres.
const CLIP_M: f32 = 0.02;
/// Panels are at least as wide, pixels, so that the legends fit; smaller images are enlarged by a whole number.
const LEAST_WIDTH: u32 = 600;
/// Between panels and at the margins, pixels.
const GAP: u32 = 12;
/// Rows of the table; more are a matter for --json.
const MOST_ROWS: usize = 30;
/// How much farther from its best place a tag goes to hide one outline pixel less, pixels.
const HIDING_COST: f64 = 0.5;

/// The colours of Okabe and Ito, which the colour-blind tell apart; black is left out.
const COLORS: [[u8; 3]; 7] = [
    [230, 159, 0],
    [86, 180, 233],
    [0, 158, 115],
    [240, 228, 66],
    [204, 121, 167],
    [213, 94, 0],
    [0, 114, 178],
];
const BLACK: [u8; 3] = [0; 3];
const WHITE: [u8; 3] = [255; 3];
/// Where there is no reading.
const NEUTRAL: [u8; 3] = [150; 3];

impl Verdict {
    fn color(self) -> [u8; 3] {
        match self {
            Self::Inlier => [0, 158, 115],
            Self::Occluded => [86, 180, 233],
            Self::Violated => [213, 94, 0],
            Self::Hole => NEUTRAL,
        }
    }

    fn caption(self) -> &'static str {
        match self {
            Self::Inlier => "inlier",
            Self::Occluded => "occluded, observed nearer",
            Self::Violated => "free space violated, farther",
            Self::Hole => "no reading",
        }
    }
}

impl Explained {
    /// Of [`row`](Self::row).
    pub const HEADER: [&str; 9] = [
        "",
        "confidence",
        "covered px",
        "inlier",
        "occluded",
        "violated",
        "no reading",
        "median mm",
        "colour",
    ];

    /// For tables.
    pub fn row(&self) -> [String; 9] {
        let dash = || "-".to_owned();
        let [inlier, occluded, violated, hole] =
            self.shares.map_or([(); 4].map(|()| dash()), |shares| shares.values().map(percent));
        let covered = if self.drawn { self.covered_px.to_string() } else { "not drawn".to_owned() };
        let median = self.median_residual_mm.map_or_else(dash, |mm| {
            // So that what rounds to zero has one sign.
            format!("{:+.1}", (10.0 * mm).round() / 10.0 + 0.0)
        });
        let agreement = self.agreement.map_or_else(dash, |a| format!("{a:+.2}"));
        let score = format!("{:.3}", self.score);
        [self.title(), score, covered, inlier, occluded, violated, hole, median, agreement]
    }
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

/// Sizes that follow from the image's.
struct Layout {
    /// Panel pixels an image pixel.
    zoom: u32,
    panel: [u32; 2],
    text: RasterHeight,
    /// Of a line of text.
    line: u32,
}

impl Layout {
    fn new([width, height]: [u32; 2]) -> Self {
        let zoom = LEAST_WIDTH.div_ceil(width).max(1);
        let panel = [width * zoom, height * zoom];
        let text = if panel[0] < 1200 { RasterHeight::Size16 } else { RasterHeight::Size32 };
        Self { zoom, panel, text, line: text.val() as u32 * 5 / 4 }
    }

    fn write(&self, picture: &mut RgbImage, at: [u32; 2], text: &str) {
        draw_text(picture, at, text, self.text, FontWeight::Regular, BLACK);
    }

    fn write_bold(&self, picture: &mut RgbImage, at: [u32; 2], text: &str) {
        draw_text(picture, at, text, self.text, FontWeight::Bold, BLACK);
    }

    /// A square of this colour with what it means; returns where the next may begin.
    fn swatch(&self, picture: &mut RgbImage, [x, y]: [u32; 2], color: [u8; 3], text: &str) -> u32 {
        let side = self.text.val() as u32 - 2;
        fill(picture, [x, y], [side; 2], BLACK);
        fill(picture, [x + 1, y + 1], [side - 2; 2], color);
        self.write(picture, [x + side + 6, y], text);
        x + side + 6 + text_width(text, self.text) + 2 * GAP
    }
}

impl Explanation {
    /// Draws it under `title`, with the outlines of the truth if its models were loaded and it is asked for.
    pub fn picture(&self, title: &str, truth: bool) -> RgbImage {
        let layout = Layout::new([self.frame.rgb.width(), self.frame.rgb.height()]);
        let [width, height] = layout.panel;
        let rows = self.explained.len().min(MOST_ROWS);
        let hidden = self.explained.len() - rows;
        let table_lines = 1 + rows as u32 + u32::from(hidden > 0);
        let header = GAP + layout.line;
        // A caption, a panel, a legend of two lines.
        let caption = layout.line + layout.line / 2;
        let part = caption + height + GAP / 2 + 2 * layout.line + GAP;
        let table = header + 2 * part;
        let size = [2 * width + 3 * GAP, table + table_lines * layout.line + GAP];
        let mut picture = RgbImage::from_pixel(size[0], size[1], image::Rgb(WHITE));
        layout.write_bold(&mut picture, [GAP, GAP], title);

        let clip_mm = 1e3 * CLIP_M;
        let captions = [
            "Estimates, with their confidence".to_owned()
                + if truth { "; thin and dashed: the TRUTH" } else { "" },
            "Models at these poses: is their print where the picture has it?".to_owned(),
            format!("Residual: observed minus rendered depth, clipped at +-{clip_mm} mm"),
            format!("Verdict along each ray; inliers are within {} mm", 1e3 * INLIER_M),
        ];
        let panels = [
            self.outlines(&layout, truth),
            self.models(&layout),
            self.residuals(&layout),
            self.verdict_map(&layout),
        ];
        let corners = [0, 1, 2, 3].map(|i| [GAP + i % 2 * (width + GAP), header + i / 2 * part]);
        for (([left, top], text), panel) in corners.into_iter().zip(&captions).zip(&panels) {
            layout.write(&mut picture, [left, top + layout.line / 4], text);
            imageops::overlay(&mut picture, panel, i64::from(left), i64::from(top + caption));
        }
        let lefts = [0, 2, 3].map(|i| corners[i][0]);
        let legends = [0, 2, 3].map(|i| corners[i][1] + caption + height + GAP / 2);
        self.legend_of_outlines(&layout, &mut picture, [lefts[0], legends[0]]);
        legend_of_residuals(&layout, &mut picture, [lefts[1], legends[1]]);
        self.legend_of_verdicts(&layout, &mut picture, [lefts[2], legends[2]]);
        self.table(&layout, &mut picture, [GAP, table], rows);
        picture
    }

    /// The colour image with the outline of every estimate, far ones first, and tags that hide neither each other nor,
    /// where there is room, the outlines.
    fn outlines(&self, layout: &Layout, truth: bool) -> RgbImage {
        let [width, height] = layout.panel;
        let mut panel = imageops::resize(&self.frame.rgb, width, height, FilterType::Triangle);
        let drawn = self.estimates.iter().zip(&self.explained).enumerate().filter(|(_, (_, e))| e.drawn);
        let mut outlines: Vec<(usize, f64, Outline)> = drawn
            .filter_map(|(i, (estimate, _))| {
                let pose = &estimate.camera_from_object;
                Some((i, pose.translation().z, self.outline(layout, estimate.obj_id, pose)?))
            })
            .collect();
        outlines.sort_by(|(_, a, _), (_, b, _)| b.total_cmp(a));
        let thick = (width / 640).clamp(1, 4) as i32;
        for (i, _, outline) in &outlines {
            outline.stamp(&mut panel, thick + 1, |_| BLACK);
            outline.stamp(&mut panel, thick, |_| color(*i));
        }
        if truth {
            for truth in self.frame.ground_truths.iter().flatten() {
                if let Some(outline) = self.outline(layout, truth.obj_id, &truth.camera_from_object) {
                    outline.stamp(&mut panel, 0, |step| if step / 5 % 2 == 0 { WHITE } else { BLACK });
                }
            }
        }
        let mut tags = Tags::new(layout.panel, outlines.iter().map(|(_, _, outline)| outline));
        for (i, _, outline) in outlines.iter().rev() {
            let e = &self.explained[*i];
            let text = format!("{} {:.2}", e.title(), e.score);
            tags.place(&mut panel, layout, outline, &text, color(*i));
        }
        panel
    }

    /// The outline of an object's model at a pose; `None` where it is not in the image.
    fn outline(&self, layout: &Layout, obj_id: u32, pose: &Pose<Camera, Object>) -> Option<Outline> {
        let zoomed = zoomed(&self.frame.intrinsics, layout.zoom as usize);
        Outline::new(&silhouette(&self.models.get(&obj_id)?.mesh, pose, &zoomed)?, layout.panel)
    }

    /// The models where they are rendered, and a dark grey image elsewhere.
    fn models(&self, layout: &Layout) -> RgbImage {
        let rgb = &self.frame.rgb;
        let small = RgbImage::from_fn(rgb.width(), rgb.height(), |u, v| {
            let covered = *self.owner.at(u as usize, v as usize) > 0;
            let darker = || image::Rgb(darkened(rgb.get_pixel(u, v).0));
            if covered { *self.models_seen.get_pixel(u, v) } else { darker() }
        });
        imageops::resize(&small, layout.panel[0], layout.panel[1], FilterType::Triangle)
    }

    fn residuals(&self, layout: &Layout) -> RgbImage {
        self.map(layout, |i, verdict| match verdict {
            Verdict::Hole => NEUTRAL,
            _ => residual_color(self.residual_m.data()[i]),
        })
    }

    fn verdict_map(&self, layout: &Layout) -> RgbImage {
        self.map(layout, |_, verdict| verdict.color())
    }

    /// Colours by pixel where estimates are, and a dark grey image elsewhere. A thin dark line parts the estimates.
    fn map(&self, layout: &Layout, color: impl Fn(usize, Verdict) -> [u8; 3]) -> RgbImage {
        let BopFrame { rgb, .. } = &self.frame;
        let width = rgb.width();
        let small = RgbImage::from_fn(width, rgb.height(), |u, v| {
            let i = (v * width + u) as usize;
            image::Rgb(match self.verdicts.data()[i] {
                Some(verdict) if self.parts(u as usize, v as usize) => color(i, verdict).map(|c| c / 3),
                Some(verdict) => color(i, verdict),
                None => darkened(rgb.get_pixel(u, v).0),
            })
        });
        imageops::resize(&small, layout.panel[0], layout.panel[1], FilterType::Nearest)
    }

    /// Whether the pixel to the right or below belongs to another estimate.
    fn parts(&self, u: usize, v: usize) -> bool {
        let here = *self.owner.at(u, v);
        let other = |u: usize, v: usize| {
            u < self.owner.width() && v < self.owner.height() && ![0, here].contains(self.owner.at(u, v))
        };
        other(u + 1, v) || other(u, v + 1)
    }

    fn legend_of_outlines(&self, layout: &Layout, picture: &mut RgbImage, [x, y]: [u32; 2]) {
        let (count, drawn) = (self.explained.len(), self.explained.iter().filter(|e| e.drawn).count());
        let left_out = count - drawn;
        let text = match left_out {
            0 => format!("all {count} estimates"),
            _ => format!("{drawn} of {count} estimates; {left_out} below {LEAST_SCORE} confidence not drawn"),
        };
        layout.write(picture, [x, y], &text);
        layout.write(picture, [x, y + layout.line], "whole outlines, also where something hides the object");
    }

    fn legend_of_verdicts(&self, layout: &Layout, picture: &mut RgbImage, [x, y]: [u32; 2]) {
        let shares = self.shares.map(|shares| shares.values());
        for (i, verdict) in (0..).zip(Verdict::ALL) {
            let share = shares.map_or_else(|| "-".to_owned(), |shares| percent(shares[i as usize]));
            // Columns of inlier and no reading, which are short, and of the other two.
            let (column, row) =
                if matches!(verdict, Verdict::Inlier | Verdict::Hole) { (0, i / 3) } else { (1, i - 1) };
            let at = [x + column * layout.panel[0] * 2 / 5, y + row * layout.line];
            layout.swatch(picture, at, verdict.color(), &format!("{} {share}", verdict.caption()));
        }
    }

    fn table(&self, layout: &Layout, picture: &mut RgbImage, [x, y]: [u32; 2], rows: usize) {
        let longest = self.explained.iter().map(|e| e.title().len()).max().unwrap_or(0);
        let line = |cells: [&str; 9]| {
            let [title, cells @ ..] = cells;
            cells.iter().fold(format!("{title:longest$}"), |text, cell| format!("{text}  {cell:>10}"))
        };
        let left = x + layout.text.val() as u32 + 4;
        layout.write_bold(picture, [left, y], &line(Explained::HEADER));
        for (i, e) in self.explained.iter().enumerate().take(rows) {
            let at = [x, y + (i as u32 + 1) * layout.line];
            let cells = e.row();
            let text = line(cells.each_ref().map(String::as_str));
            layout.swatch(picture, at, if e.drawn { color(i) } else { WHITE }, &text);
        }
        if rows < self.explained.len() {
            let text = format!("and {} more; --json has them all", self.explained.len() - rows);
            layout.write(picture, [left, y + (rows as u32 + 1) * layout.line], &text);
        }
    }
}

/// The colour bar with its ticks below, and what is neither.
fn legend_of_residuals(layout: &Layout, picture: &mut RgbImage, [x, y]: [u32; 2]) {
    let (margin, length, height) = (2 * layout.line, layout.panel[0] * 2 / 5, layout.text.val() as u32 - 2);
    let (left, clip_mm) = (x + margin, 1e3 * CLIP_M);
    for i in 0..=length {
        let share = i as f32 / length as f32;
        fill(picture, [left + i, y], [1, height], residual_color((2.0 * share - 1.0) * CLIP_M));
    }
    for tick in 0..=4_u32 {
        let at = left + tick * length / 4;
        fill(picture, [at, y + height], [1, 3], BLACK);
        let mm = (tick as f32 / 2.0 - 1.0) * clip_mm;
        let text = match tick {
            2 => "0 mm".to_owned(),
            _ => format!("{mm:+}"),
        };
        layout.write(
            picture,
            [at.saturating_sub(text_width(&text, layout.text) / 2), y + layout.line],
            &text,
        );
    }
    let right = left + length + margin;
    layout.swatch(picture, [right, y], NEUTRAL, "no reading");
    layout.swatch(picture, [right, y + layout.line], darkened([128; 3]), "not covered");
}

/// Blue where something was observed nearer than rendered, red where farther, white at 0.
fn residual_color(residual_m: f32) -> [u8; 3] {
    let share = 0.5 - 0.5 * (residual_m / CLIP_M).clamp(-1.0, 1.0);
    // Without the ends of the scale, which are too dark beside pixels that nothing covers.
    let c = colorous::RED_BLUE.eval_continuous(0.08 + 0.84 * f64::from(share));
    [c.r, c.g, c.b]
}

fn darkened([r, g, b]: [u8; 3]) -> [u8; 3] {
    [((u32::from(r) + u32::from(g) + u32::from(b)) / 10) as u8; 3]
}

/// Of the estimate at this place in the results; the eighth has that of the first, but lighter, and so on.
fn color(index: usize) -> [u8; 3] {
    let lighter = |c: u8, share: u32| (u32::from(c) + (255 - u32::from(c)) * share / 4) as u8;
    COLORS[index % COLORS.len()].map(|c| lighter(c, (index / COLORS.len() % 3) as u32))
}

/// The camera of a picture that is `times` larger.
fn zoomed(k: &Intrinsics, times: usize) -> Intrinsics {
    let by = times as f64;
    let middle = |c: f64| (c + 0.5) * by - 0.5;
    Intrinsics {
        width: k.width * times,
        height: k.height * times,
        fx: k.fx * by,
        fy: k.fy * by,
        cx: middle(k.cx),
        cy: middle(k.cy),
    }
}

/// The rim of a silhouette within a panel.
struct Outline {
    /// In the order of a walk along it.
    pixels: Vec<[i32; 2]>,
    left: i32,
    right: i32,
    top: i32,
}

impl Outline {
    fn new(silhouette: &grip_sim::render::Silhouette, panel: [u32; 2]) -> Option<Self> {
        let mask = &silhouette.mask;
        let size = [mask.width() as i32, mask.height() as i32];
        let covers = |[x, y]: [i32; 2]| {
            (0..size[0]).contains(&x) && (0..size[1]).contains(&y) && *mask.at(x as usize, y as usize)
        };
        let rim = |[x, y]: [i32; 2]| {
            covers([x, y]) && [[x - 1, y], [x + 1, y], [x, y - 1], [x, y + 1]].into_iter().any(|p| !covers(p))
        };
        let mut open: std::collections::BTreeSet<[i32; 2]> =
            (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| [x, y])).filter(|p| rim(*p)).collect();
        let mut pixels = Vec::new();
        // Straight neighbours come first, or corners would be skipped and left for later.
        let steps = [[1, 0], [0, 1], [-1, 0], [0, -1], [1, 1], [-1, 1], [-1, -1], [1, -1]];
        while let Some(mut at) = open.pop_first() {
            loop {
                let p = [0, 1].map(|axis| at[axis] + silhouette.offset[axis]);
                if [0, 1].into_iter().all(|axis| (0..panel[axis] as i32).contains(&p[axis])) {
                    pixels.push(p);
                }
                let next = steps.map(|[x, y]| [at[0] + x, at[1] + y]).into_iter().find(|p| open.remove(p));
                let Some(next) = next else { break };
                at = next;
            }
        }
        let (xs, ys) = (pixels.iter().map(|p| p[0]), pixels.iter().map(|p| p[1]));
        let (left, right, top) = (xs.clone().min()?, xs.max()?, ys.min()?);
        Some(Self { pixels, left, right, top })
    }

    /// Draws squares that reach `radius` pixels from the rim, in the colour of their place along it.
    fn stamp(&self, panel: &mut RgbImage, radius: i32, color: impl Fn(usize) -> [u8; 3]) {
        for (step, [x, y]) in self.pixels.iter().enumerate() {
            let corner = [x - radius, y - radius].map(|c| c.max(0) as u32);
            let end = [x + radius + 1, y + radius + 1].map(|c| c.max(0) as u32);
            fill(panel, corner, [end[0] - corner[0], end[1] - corner[1]], color(step));
        }
    }
}

/// Where names may still be put.
struct Tags {
    panel: [u32; 2],
    /// Outline pixels above and left of each corner of a pixel.
    sums: Vec<u32>,
    /// Corners of those placed: left, top, right, bottom.
    placed: Vec<[u32; 4]>,
}

impl Tags {
    fn new<'a>(panel: [u32; 2], outlines: impl Iterator<Item = &'a Outline>) -> Self {
        let columns = panel[0] as usize + 1;
        let mut sums = vec![0; columns * (panel[1] as usize + 1)];
        for [x, y] in outlines.flat_map(|outline| &outline.pixels) {
            sums[(*y as usize + 1) * columns + *x as usize + 1] = 1;
        }
        for y in 1..=panel[1] as usize {
            for x in 1..columns {
                let i = y * columns + x;
                sums[i] = sums[i] + sums[i - 1] + sums[i - columns] - sums[i - columns - 1];
            }
        }
        Self { panel, sums, placed: Vec::new() }
    }

    fn outline_pixels(&self, [left, top, right, bottom]: [u32; 4]) -> u32 {
        let at = |x: u32, y: u32| self.sums[y as usize * (self.panel[0] as usize + 1) + x as usize];
        at(right, bottom) + at(left, top) - at(left, bottom) - at(right, top)
    }

    /// Puts `text` on `color` near above the outline, with a line to its nearest point; leaves it out where there is no
    /// room at all.
    fn place(
        &mut self,
        picture: &mut RgbImage,
        layout: &Layout,
        outline: &Outline,
        text: &str,
        color: [u8; 3],
    ) {
        let size = [text_width(text, layout.text) + 6, layout.text.val() as u32 + 2];
        let best = [
            f64::from(outline.left + outline.right) / 2.0,
            f64::from(outline.top) - f64::from(size[1]) / 2.0 - 4.0,
        ];
        let rectangle = |x: u32, y: u32| [x, y, x + size[0], y + size[1]];
        let apart = |a: [u32; 4], b: &[u32; 4]| a[2] < b[0] || b[2] < a[0] || a[3] < b[1] || b[3] < a[1];
        let grid = |axis: usize| (0..=self.panel[axis].saturating_sub(size[axis])).step_by(4);
        let free = grid(1)
            .flat_map(|y| grid(0).map(move |x| rectangle(x, y)))
            .filter(|r| r[2] <= self.panel[0] && r[3] <= self.panel[1])
            .filter(|r| self.placed.iter().all(|other| apart(*r, other)));
        let center = |r: &[u32; 4]| [f64::from(r[0] + r[2]) / 2.0, f64::from(r[1] + r[3]) / 2.0];
        let cost = |r: &[u32; 4]| {
            let [x, y] = center(r);
            (x - best[0]).hypot(y - best[1]) + HIDING_COST * f64::from(self.outline_pixels(*r))
        };
        let Some(r) = free.min_by(|a, b| cost(a).total_cmp(&cost(b))) else { return };
        let [x, y] = center(&r);
        let away = |p: &[f64; 2]| (p[0] - x).hypot(p[1] - y);
        let rim = outline.pixels.iter().map(|p| p.map(f64::from));
        if let Some(nearest) = rim.min_by(|a, b| away(a).total_cmp(&away(b))) {
            line(picture, [x, y], nearest, color);
        }
        fill(picture, [r[0], r[1]], size, BLACK);
        fill(picture, [r[0] + 1, r[1] + 1], [size[0] - 2, size[1] - 2], color);
        let [red, green, blue] = color.map(u32::from);
        let ink = if 3 * red + 6 * green + blue > 1100 { BLACK } else { WHITE };
        draw_text(picture, [r[0] + 3, r[1] + 1], text, layout.text, FontWeight::Bold, ink);
        self.placed.push(r);
    }
}

/// Two pixels wide.
fn line(picture: &mut RgbImage, from: [f64; 2], to: [f64; 2], color: [u8; 3]) {
    let steps = (to[0] - from[0]).abs().max((to[1] - from[1]).abs()).ceil().max(1.0);
    for step in 0..=steps as u32 {
        let at = [0, 1].map(|axis| from[axis] + (to[axis] - from[axis]) * f64::from(step) / steps);
        fill(picture, at.map(|c| c.max(0.0) as u32), [2, 2], color);
    }
}
