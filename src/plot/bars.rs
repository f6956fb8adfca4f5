//! Bars in groups, side by side with intervals, or stacked, each with its number.

use anyhow::Result;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::{Area, COLORS, Drawn, TEXT, round_up};

// Units of the picture, as for curves.
const WIDTH: i32 = 1500;
const LEFT: i32 = 110;
const RIGHT: i32 = 30;
const TITLE: i32 = 60;
/// From the floor of a row of groups up to the end of the axis.
const PLOT: i32 = 430;
const LEGEND_LINE: i32 = 36;
/// Of numbers at bars, and of names below them.
const NUMBER: u32 = TEXT - 6;
const NAME: u32 = TEXT - 4;
const NAME_LINE: i32 = 28;
/// Bars are no narrower than a number that stands upright, and no wider than they need to be.
const SLOTS: [i32; 2] = [26, 150];
/// Of a stack, with its numbers beside it.
const STACK: i32 = 90;
/// Series of a chart: more could not be told apart.
pub const MOST_SERIES: usize = 14;

/// A chart of bars. Groups that have no room beside each other stand in several rows.
#[derive(Debug, Clone)]
pub struct Bars {
    /// Above it.
    pub title: String,
    /// Of the axis upwards, with its unit.
    pub label: String,
    /// End of that axis, at least.
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

/// Black on pale fills, white on dark ones.
fn ink(series: usize) -> RGBColor {
    let RGBAColor(r, g, b, opaque) = fill(series);
    let on_white = |c: u8| 255.0 - opaque * (255.0 - f64::from(c));
    let light = 0.299 * on_white(r) + 0.587 * on_white(g) + 0.114 * on_white(b);
    if light < 110.0 { WHITE } else { BLACK }
}

/// The bars that a group has, each with the number of its series. There is no room left for others.
fn present(bars: &Bars, group: usize) -> impl Iterator<Item = (usize, Bar)> {
    let of = move |(s, (_, values)): (usize, &(String, Vec<Option<Bar>>))| Some((s, (*values.get(group)?)?));
    bars.series.iter().enumerate().filter_map(of)
}

/// How wide a text is at most.
fn width_of(text: &str, size: u32) -> i32 {
    (text.chars().count() as f64 * 0.6 * f64::from(size)).ceil() as i32
}

/// A number as it stands at a bar: a digit behind the point unless it is a whole one.
fn number(value: f64) -> String {
    let shown = format!("{value:.1}");
    shown.strip_suffix(".0").unwrap_or(&shown).to_owned()
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
    let layout = Layout::of(bars);
    let mut text = String::new();
    draw(bars, &layout, &SVGBackend::with_string(&mut text, layout.size()).into_drawing_area())
        .map_err(|error| anyhow::anyhow!("cannot draw the chart: {error}"))?;
    Ok(text)
}

/// Where things are.
struct Layout {
    /// End of the axis upwards, and the distance of its ticks.
    most: f64,
    step: f64,
    /// Groups in a row, and rows.
    per_row: usize,
    rows: usize,
    /// Width of a bar, with a gap.
    slot: i32,
    /// Whether numbers stand upright, because bars are narrow.
    upright: bool,
    /// Height of a row: room for numbers above the end of the axis, the plot, names.
    above: i32,
    below: i32,
    /// Lines of the legend, and its columns.
    legend: (i32, i32),
}

impl Layout {
    fn of(bars: &Bars) -> Self {
        let room = WIDTH - LEFT - RIGHT;
        let series = bars.series.len().max(1) as i32;
        let each = (0..bars.groups.len()).map(|g| present(bars, g).count()).max().unwrap_or(0).max(1) as i32;
        let all = || bars.series.iter().flat_map(|(_, values)| values).flatten();
        let widest = all().map(|bar| width_of(&number(bar.value), NUMBER)).max().unwrap_or(0) + 4;
        let names = bars.groups.iter().flat_map(|name| name.split('\n'));
        let name = names.map(|part| width_of(part, NAME)).max().unwrap_or(0) + 12;
        let lines = bars.groups.iter().map(|name| name.split('\n').count()).max().unwrap_or(1) as i32;
        // Beside a stack there is room for the numbers that have none in it.
        let least = if bars.stacked { STACK + widest + 12 } else { SLOTS[0] * each * 5 / 4 };
        let fit = (room / least.max(name).max(1)).max(1) as usize;
        let rows = bars.groups.len().div_ceil(fit).max(1);
        let per_row = bars.groups.len().div_ceil(rows).max(1);
        let slot = (room / per_row as i32 * 4 / 5 / each).clamp(8, SLOTS[1]);
        let upright = !bars.stacked && slot < widest;
        let step = round_up(bars.most / 6.0).max(if bars.stacked { 1.0 } else { 0.0 });
        let longest = bars.series.iter().map(|(name, _)| width_of(name, NAME) + 90).max().unwrap_or(0);
        let columns = (room / longest.max(1)).clamp(1, 4).min(series);
        Self {
            most: if step > 0.0 { (bars.most / step - 1e-9).ceil() * step } else { 1.0 },
            step: if step > 0.0 { step } else { 1.0 },
            per_row,
            rows,
            slot,
            upright,
            above: 50 + if upright { widest } else { NUMBER as i32 },
            below: 30 + NAME_LINE * lines,
            legend: ((series + columns - 1) / columns, columns),
        }
    }

    /// The height of a value in the row with this floor.
    fn y(&self, value: f64, floor: i32) -> i32 {
        floor - ((value / self.most).clamp(0.0, 1.0) * f64::from(PLOT)).round() as i32
    }

    fn row(&self) -> i32 {
        self.above + PLOT + self.below
    }

    fn size(&self) -> (u32, u32) {
        let height = TITLE + self.rows as i32 * self.row() + LEGEND_LINE * (self.legend.0 + 1);
        (WIDTH as u32, height as u32)
    }
}

fn draw<'a>(bars: &Bars, layout: &Layout, root: &Area<'a>) -> Drawn<'a> {
    root.fill(&WHITE)?;
    let pen = Pen { root };
    pen.text(&bars.title, (WIDTH / 2, TITLE / 2), TEXT + 4, HPos::Center)?;
    for (row, first) in (0..bars.groups.len().max(1)).step_by(layout.per_row).enumerate() {
        let floor = TITLE + row as i32 * layout.row() + layout.above + PLOT;
        draw_axis(bars, layout, &pen, floor)?;
        let width = f64::from(WIDTH - LEFT - RIGHT) / layout.per_row as f64;
        for (place, g) in (first..bars.groups.len()).take(layout.per_row).enumerate() {
            let middle = LEFT + (width * (place as f64 + 0.5)) as i32;
            for (line, part) in bars.groups[g].split('\n').enumerate() {
                pen.text(part, (middle, floor + 22 + NAME_LINE * line as i32), NAME, HPos::Center)?;
            }
            if bars.stacked {
                draw_stack(bars, layout, &pen, g, (middle, floor))?;
            } else {
                draw_beside(bars, layout, &pen, g, (middle, floor))?;
            }
        }
        root.draw(&PathElement::new([(LEFT, floor), (WIDTH - RIGHT, floor)], BLACK.stroke_width(2)))?;
    }
    let (lines, columns) = layout.legend;
    let top = TITLE + layout.rows as i32 * layout.row();
    for (s, (name, _)) in bars.series.iter().enumerate() {
        let (column, line) = (s as i32 / lines.max(1), s as i32 % lines.max(1));
        let x = LEFT + column * (WIDTH - LEFT - RIGHT) / columns;
        let at = top + LEGEND_LINE / 2 + LEGEND_LINE * line;
        pen.bar([(x, at - 10), (x + 40, at + 10)], s)?;
        pen.text(name, (x + 54, at), NAME, HPos::Left)?;
    }
    root.present()
}

fn draw_axis<'a>(bars: &Bars, layout: &Layout, pen: &Pen<'_, 'a>, floor: i32) -> Drawn<'a> {
    pen.text(&bars.label, (LEFT - 80, floor - PLOT - layout.above + 14), TEXT - 2, HPos::Left)?;
    for k in 0..=(layout.most / layout.step).round() as i32 {
        let value = layout.step * f64::from(k);
        let at = layout.y(value, floor);
        let line = PathElement::new([(LEFT, at), (WIDTH - RIGHT, at)], BLACK.mix(0.15).stroke_width(1));
        pen.root.draw(&line)?;
        let shown = format!("{value:.4}");
        let shown = shown.trim_end_matches('0').trim_end_matches('.');
        pen.text(shown, (LEFT - 12, at), TEXT - 4, HPos::Right)?;
    }
    Ok(())
}

/// The bars of a group side by side, each with its number above its interval.
fn draw_beside<'a>(
    bars: &Bars,
    layout: &Layout,
    pen: &Pen<'_, 'a>,
    group: usize,
    (middle, floor): (i32, i32),
) -> Drawn<'a> {
    let left = middle - layout.slot * present(bars, group).count() as i32 / 2;
    for (place, (s, bar)) in present(bars, group).enumerate() {
        let x0 = left + layout.slot * place as i32;
        let (x0, x1) = (x0 + 2, x0 + layout.slot - 2);
        let mut top = layout.y(bar.value, floor);
        pen.bar([(x0, top), (x1, floor)], s)?;
        let centre = (x0 + x1) / 2;
        if let Some(interval) = bar.interval {
            let [low, high] = interval.map(|end| layout.y(end, floor));
            // White below black, so that it is seen on every fill.
            for (color, width) in [(WHITE, 7), (BLACK, 3)] {
                let whisker = color.stroke_width(width);
                pen.root.draw(&PathElement::new([(centre, low), (centre, high)], whisker))?;
                for end in [low, high] {
                    let half = 9.min(layout.slot / 3);
                    pen.root
                        .draw(&PathElement::new([(centre - half, end), (centre + half, end)], whisker))?;
                }
            }
            top = top.min(high);
        }
        pen.above(&number(bar.value), (centre, top - 6), layout.upright)?;
    }
    Ok(())
}

/// The bars of a group on each other: numbers inside where there is room, else beside them, and the sum above.
fn draw_stack<'a>(
    bars: &Bars,
    layout: &Layout,
    pen: &Pen<'_, 'a>,
    group: usize,
    (middle, floor): (i32, i32),
) -> Drawn<'a> {
    let (x0, x1) = (middle - STACK / 2, middle + STACK / 2);
    let mut sum = 0.0;
    // Numbers beside the stack, from below: height of the part, and what stands there.
    let mut beside: Vec<(i32, String)> = Vec::new();
    for (s, bar) in present(bars, group) {
        let (low, high) = (layout.y(sum, floor), layout.y(sum + bar.value, floor));
        sum += bar.value;
        pen.bar([(x0, high), (x1, low)], s)?;
        let at = (low + high) / 2;
        if low - high >= NUMBER as i32 + 2 {
            let ink = ink(s);
            let style = pen.style(NUMBER, HPos::Center, VPos::Center).color(&ink);
            pen.root.draw(&Text::new(number(bar.value), (middle, at), style))?;
        } else {
            beside.push((at, number(bar.value)));
        }
    }
    let wanted: Vec<i32> = beside.iter().map(|(at, _)| *at).collect();
    let mut placed = spread(&wanted, NUMBER as i32);
    // Not on the floor.
    let mut lowest = floor - NUMBER as i32 / 2;
    for at in &mut placed {
        *at = lowest.min(*at);
        lowest = *at - NUMBER as i32;
    }
    for ((at, shown), placed) in beside.iter().zip(placed) {
        let line = [(x1 + 1, *at), (x1 + 10, placed)];
        pen.root.draw(&PathElement::new(line, BLACK.mix(0.6).stroke_width(1)))?;
        pen.text(shown, (x1 + 13, placed), NUMBER, HPos::Left)?;
    }
    pen.above(&number(sum), (middle, layout.y(sum, floor) - 6), false)
}

/// Heights at least `apart` from each other and as near as may be to those wanted, which go up (pixels go down).
fn spread(wanted: &[i32], apart: i32) -> Vec<i32> {
    // Neighbours that are too near become one block around the mean of what they want.
    let mut blocks: Vec<(f64, usize)> = Vec::new();
    let half = |count: usize| f64::from(apart) * count as f64 / 2.0;
    for &at in wanted {
        let mut block = (f64::from(at), 1);
        while let Some(&(below, count)) = blocks.last()
            && below - half(count) < block.0 + half(block.1)
        {
            let both = count + block.1;
            block = ((below * count as f64 + block.0 * block.1 as f64) / both as f64, both);
            blocks.pop();
        }
        blocks.push(block);
    }
    let places = blocks.into_iter().flat_map(|(middle, count)| {
        (0..count).map(move |i| middle + half(count) - f64::from(apart) * (i as f64 + 0.5))
    });
    places.map(|at| at.round() as i32).collect()
}

struct Pen<'p, 'a> {
    root: &'p Area<'a>,
}

impl<'a> Pen<'_, 'a> {
    fn style(&self, size: u32, h: HPos, v: VPos) -> TextStyle<'static> {
        ("sans-serif", size).into_font().into_text_style(self.root).pos(Pos::new(h, v))
    }

    fn text(&self, content: &str, at: (i32, i32), size: u32, h: HPos) -> Drawn<'a> {
        self.root.draw(&Text::new(content.to_owned(), at, self.style(size, h, VPos::Center)))
    }

    /// A number over `at`, along the bar where it is narrow.
    fn above(&self, content: &str, at: (i32, i32), upright: bool) -> Drawn<'a> {
        let style = if upright {
            self.style(NUMBER, HPos::Left, VPos::Center).transform(FontTransform::Rotate270)
        } else {
            self.style(NUMBER, HPos::Center, VPos::Bottom)
        };
        self.root.draw(&Text::new(content.to_owned(), at, style))
    }

    fn bar(&self, corners: [(i32, i32); 2], series: usize) -> Drawn<'a> {
        self.root.draw(&Rectangle::new(corners, fill(series).filled()))?;
        self.root.draw(&Rectangle::new(corners, BLACK.mix(0.7).stroke_width(1)))
    }
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
                .filter(|h| *h > 30 && *h <= PLOT)
                .collect()
        };
        let near = |found: &[i32], shares: &[f64]| {
            found.len() == shares.len()
                && found.iter().zip(shares).all(|(h, s)| (f64::from(*h) - s * f64::from(PLOT)).abs() <= 2.0)
        };
        for stacked in [false, true] {
            let svg = svg(&bars(stacked)).unwrap();
            assert!(near(&heights(&svg), &[0.5, 0.25, 1.0]), "{:?} of {PLOT}", heights(&svg));
            assert!(svg.contains("a &amp; b") && svg.contains("room"));
        }
    }

    /// Where the numbers of a chart are, and whether they stand upright.
    fn numbers(svg: &str) -> Vec<(f64, [f64; 2], bool)> {
        let attribute = |tag: &str, name: &str| -> Option<f64> {
            tag.split(&format!(" {name}=\"")).nth(1)?.split('"').next()?.parse().ok()
        };
        let mut found = Vec::new();
        for part in svg.split("<text").skip(1) {
            let (tag, rest) = part.split_once('>').unwrap();
            let size = attribute(tag, "font-size").unwrap();
            let shown = rest.split('<').next().unwrap().trim();
            // Of a font of another size are the ticks.
            let own = (size - f64::from(NUMBER) / 1.24).abs() < 1.0;
            if let (true, Ok(value)) = (own, shown.parse()) {
                let at = ["x", "y"].map(|name| attribute(tag, name).unwrap());
                found.push((value, at, tag.contains("rotate(")));
            }
        }
        found
    }

    #[test]
    fn every_bar_has_its_number_and_none_is_on_another() {
        // Nothing, everything, and what rounds to whole numbers; from wide bars to ones that are narrower than their numbers.
        let values = [0.0, 100.0, 33.3, 99.97, 8.0];
        for (groups, series) in [(1, 1), (4, 2), (6, 5), (9, 14)] {
            let value = |i: usize| values[i % values.len()];
            let bar = |i: usize| Bar {
                value: value(i),
                interval: Some([0.9 * value(i), (value(i) + 10.0).min(100.0)]),
            };
            let chart = Bars {
                title: String::new(),
                label: String::new(),
                most: 100.0,
                stacked: false,
                groups: (0..groups).map(|g| format!("clutter-{g}\ngrip")).collect(),
                series: (0..series)
                    .map(|s| (format!("s{s}"), (0..groups).map(|g| Some(bar(g * series + s))).collect()))
                    .collect(),
            };
            let svg = svg(&chart).unwrap();
            let (width, height) = Layout::of(&chart).size();
            let found = numbers(&svg);
            assert_eq!(found.len(), groups * series, "{groups} groups of {series}: {found:?}");
            for (i, (value, [x, y], upright)) in found.iter().enumerate() {
                let [w, h] = [f64::from(width_of(&number(*value), NUMBER)), f64::from(NUMBER)];
                let boxed = |[x, y]: [f64; 2]| {
                    if *upright {
                        [x - h / 2.0, y - w, x + h / 2.0, y]
                    } else {
                        [x - w / 2.0, y - h, x + w / 2.0, y]
                    }
                };
                let [x0, y0, x1, y1] = boxed([*x, *y]);
                assert!(
                    x0 >= 0.0 && y0 >= 0.0 && x1 <= f64::from(width) && y1 <= f64::from(height),
                    "cut off"
                );
                for (_, other, _) in &found[..i] {
                    // Of the same size or smaller: its middle is what counts.
                    let [a0, b0, a1, b1] = boxed(*other);
                    let apart = a1 - 1.0 <= x0 || x1 <= a0 + 1.0 || b1 <= y0 || y1 <= b0;
                    assert!(
                        apart,
                        "{groups} groups of {series}: {value} at {x}, {y} on another at {other:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn thin_parts_of_a_stack_have_their_numbers_beside_it() {
        let counts = [200.0, 1.0, 1.0, 2.0, 1.0, 40.0];
        let one = |n: f64| vec![Some(Bar { value: n, interval: None })];
        let chart = Bars {
            stacked: true,
            most: 245.0,
            groups: vec!["dark".into()],
            series: counts.iter().map(|n| ("kind".into(), one(*n))).collect(),
            ..bars(true)
        };
        let mut found = numbers(&svg(&chart).unwrap());
        let sum = found.pop().unwrap();
        assert_eq!(sum.0, 245.0);
        let mut shown: Vec<f64> = found.iter().map(|(value, ..)| *value).collect();
        shown.sort_by(f64::total_cmp);
        assert_eq!(shown, [1.0, 1.0, 1.0, 2.0, 40.0, 200.0]);
        let mut beside: Vec<f64> = found.iter().filter(|f| f.0 < 10.0).map(|f| f.1[1]).collect();
        beside.sort_by(f64::total_cmp);
        assert!(beside.windows(2).all(|w| w[1] - w[0] >= f64::from(NUMBER) - 1.0), "{beside:?}");
    }

    #[test]
    fn what_is_spread_stays_in_order_and_near() {
        assert_eq!(spread(&[100, 50], 20), [100, 50]);
        assert_eq!(spread(&[100, 100], 20), [110, 90]);
        assert_eq!(spread(&[100, 98, 96, 10], 20), [118, 98, 78, 10]);
        assert_eq!(spread(&[], 20), [0; 0]);
    }

    #[test]
    fn too_many_series_are_refused() {
        let mut many = bars(true);
        many.series = vec![many.series[0].clone(); MOST_SERIES + 1];
        assert!(svg(&many).unwrap_err().to_string().contains("not for 15"));
    }
}
