//! Bars in groups, side by side with intervals, or stacked.

use anyhow::Result;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::{Area, COLORS, Drawn, TEXT};

// Units of the picture, as for curves.
const WIDTH: u32 = 1500;
const HEIGHT: u32 = 620;
const LEFT: i32 = 110;
const TOP: i32 = 80;
const BELOW: i32 = 110;
const LEGEND_LINE: i32 = 36;
/// Series of a chart: more could not be told apart.
const MOST_SERIES: usize = 14;

/// A chart of bars.
#[derive(Debug, Clone)]
pub struct Bars {
    /// Above it.
    pub title: String,
    /// Of the axis upwards, with its unit.
    pub label: String,
    /// End of that axis.
    pub most: f64,
    /// Whether the series of a group stand on each other.
    pub stacked: bool,
    /// Names of the groups, below them.
    pub groups: Vec<String>,
    /// A name for the legend, and a bar for each group.
    pub series: Vec<(String, Vec<Option<Bar>>)>,
}

/// One bar.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bar {
    /// How high.
    pub value: f64,
    /// The ends of its interval, if it has one.
    pub interval: Option<[f64; 2]>,
}

/// Fill of a series: the colours of curves, dark and pale in turn, so that neighbours differ in grey too.
fn fill(series: usize) -> RGBAColor {
    COLORS[series % COLORS.len()].mix(if series.is_multiple_of(2) { 0.9 } else { 0.45 })
}

/// The chart as SVG.
///
/// # Errors
/// When there are too many series.
pub fn svg(bars: &Bars) -> Result<String> {
    anyhow::ensure!(
        bars.series.len() <= MOST_SERIES,
        "a chart has fills for {MOST_SERIES} series, not for {}",
        bars.series.len()
    );
    let rows = bars.series.len().div_ceil(2) as u32;
    let size = (WIDTH, HEIGHT + LEGEND_LINE as u32 * (rows + 1));
    let mut text = String::new();
    draw(bars, &SVGBackend::with_string(&mut text, size).into_drawing_area())
        .map_err(|error| anyhow::anyhow!("cannot draw the chart: {error}"))?;
    Ok(text)
}

fn draw<'a>(bars: &Bars, root: &Area<'a>) -> Drawn<'a> {
    root.fill(&WHITE)?;
    let (right, floor) = (WIDTH as i32 - 30, HEIGHT as i32 - BELOW);
    let y = |value: f64| {
        let share = if bars.most > 0.0 { (value / bars.most).clamp(0.0, 1.0) } else { 0.0 };
        floor - (share * f64::from(floor - TOP)).round() as i32
    };
    let text = |content: &str, at: (i32, i32), size: u32, h: HPos, v: VPos| -> Drawn<'a> {
        let style = ("sans-serif", size).into_font().into_text_style(root).pos(Pos::new(h, v));
        root.draw(&Text::new(content.to_owned(), at, style))
    };
    text(&bars.title, (WIDTH as i32 / 2, 30), TEXT + 4, HPos::Center, VPos::Center)?;
    text(&bars.label, (LEFT - 80, TOP - 22), TEXT - 2, HPos::Left, VPos::Center)?;
    for k in 0..=5 {
        let value = bars.most * f64::from(k) / 5.0;
        let at = y(value);
        root.draw(&PathElement::new([(LEFT, at), (right, at)], BLACK.mix(0.15).stroke_width(1)))?;
        let shown = format!("{value:.2}");
        let shown = shown.trim_end_matches('0').trim_end_matches('.');
        text(shown, (LEFT - 12, at), TEXT - 4, HPos::Right, VPos::Center)?;
    }
    let group_width = f64::from(right - LEFT) / bars.groups.len().max(1) as f64;
    for (g, name) in bars.groups.iter().enumerate() {
        let left = f64::from(LEFT) + group_width * g as f64;
        let middle = (left + 0.5 * group_width) as i32;
        for (line, part) in name.split('\n').enumerate() {
            let at = (middle, floor + 22 + 28 * line as i32);
            text(part, at, TEXT - 4, HPos::Center, VPos::Center)?;
        }
        let inside = 0.8 * group_width;
        let slot = if bars.stacked { inside.min(120.0) } else { inside / bars.series.len().max(1) as f64 };
        let mut below = 0.0;
        for (s, (_, values)) in bars.series.iter().enumerate() {
            let Some(bar) = values.get(g).copied().flatten() else { continue };
            let x0 = if bars.stacked {
                left + 0.5 * (group_width - slot)
            } else {
                left + 0.1 * group_width + slot * s as f64
            };
            let (x0, x1) = ((x0 + 2.0) as i32, (x0 + slot - 2.0) as i32);
            let (low, high) = (y(below), y(below + bar.value));
            root.draw(&Rectangle::new([(x0, high), (x1, low)], fill(s).filled()))?;
            root.draw(&Rectangle::new([(x0, high), (x1, low)], BLACK.mix(0.7).stroke_width(1)))?;
            let centre = (x0 + x1) / 2;
            if let Some([from, to]) = bar.interval {
                let whisker = BLACK.stroke_width(3);
                root.draw(&PathElement::new([(centre, y(from)), (centre, y(to))], whisker))?;
                for end in [from, to] {
                    root.draw(&PathElement::new([(centre - 9, y(end)), (centre + 9, y(end))], whisker))?;
                }
            }
            if bars.stacked {
                if low - high > 24 {
                    let shown = format!("{}", bar.value);
                    text(&shown, (centre, (low + high) / 2), TEXT - 6, HPos::Center, VPos::Center)?;
                }
                below += bar.value;
            }
        }
    }
    root.draw(&PathElement::new([(LEFT, floor), (right, floor)], BLACK.stroke_width(2)))?;
    for (s, (name, _)) in bars.series.iter().enumerate() {
        let x = LEFT + (s % 2) as i32 * (WIDTH as i32 - LEFT) / 2;
        let at = HEIGHT as i32 + LEGEND_LINE * (s / 2) as i32;
        root.draw(&Rectangle::new([(x, at - 10), (x + 40, at + 10)], fill(s).filled()))?;
        root.draw(&Rectangle::new([(x, at - 10), (x + 40, at + 10)], BLACK.mix(0.7).stroke_width(1)))?;
        text(name, (x + 54, at), TEXT - 4, HPos::Left, VPos::Center)?;
    }
    root.present()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bars(stacked: bool) -> Bars {
        let bar = |value, interval| Some(Bar { value, interval });
        Bars {
            title: "a & b".into(),
            label: "share".into(),
            most: 1.0,
            stacked,
            groups: vec!["base".into(), "dark\nroom".into()],
            series: vec![
                ("one".into(), vec![bar(0.5, Some([0.4, 0.6])), None]),
                ("two".into(), vec![bar(0.25, None), bar(1.0, None)]),
            ],
        }
    }

    #[test]
    fn bars_stand_beside_or_on_each_other() {
        let heights = |svg: &str| -> Vec<i32> {
            let rectangles = svg.lines().filter(|l| l.starts_with("<rect") && !l.contains("fill=\"none\""));
            rectangles
                .filter_map(|l| l.split("height=\"").nth(1)?.split('"').next()?.parse().ok())
                .filter(|h| *h > 30 && *h < HEIGHT as i32)
                .collect()
        };
        let floor = HEIGHT as i32 - BELOW - TOP;
        let near = |found: &[i32], shares: &[f64]| {
            found.len() == shares.len()
                && found.iter().zip(shares).all(|(h, s)| (f64::from(*h) - s * f64::from(floor)).abs() <= 2.0)
        };
        for stacked in [false, true] {
            let svg = svg(&bars(stacked)).unwrap();
            assert!(near(&heights(&svg), &[0.5, 0.25, 1.0]), "{:?} of {floor}", heights(&svg));
            assert!(svg.contains("a &amp; b") && svg.contains("room"));
        }
    }

    #[test]
    fn too_many_series_are_refused() {
        let mut many = bars(true);
        many.series = vec![many.series[0].clone(); MOST_SERIES + 1];
        assert!(svg(&many).unwrap_err().to_string().contains("not for 15"));
    }
}
