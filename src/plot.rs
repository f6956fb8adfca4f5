//! Figures for papers and reports: panels of curves as SVG, without fonts or libraries of the system.

pub mod bars;

use std::ops::Range;
use std::path::Path;

use anyhow::{Context, Result};
use grip_sim::bop;
use plotters::coord::Shift;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// The colours of Okabe and Ito, which the colour-blind tell apart; yellow, too pale for a line on white, is left out.
const COLORS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
];
/// Dashes of the curves, so that they can be told apart in grey as well: lengths of lines and gaps.
const DASHES: [&str; 7] = ["", "24 10", "6 8", "40 10 6 10", "14 14", "24 8 6 8 6 8", "60 12"];
/// Curves a panel, so that no two have one colour.
pub const MOST_CURVES: usize = COLORS.len();

// Units of the picture. Points are rounded to them, so there are about two for each pixel of a usual screen.
const PANEL: (u32, u32) = (900, 640);
const TITLE: u32 = 70;
const LEGEND_LINE: u32 = 36;
const TEXT: u32 = 26;

/// Panels under a title.
#[derive(Debug, Clone)]
pub struct Figure {
    /// Above all panels.
    pub title: String,
    /// Panels in a row.
    pub columns: usize,
    /// Row by row.
    pub panels: Vec<Panel>,
}

/// Curves over common axes, with a legend below.
#[derive(Debug, Clone)]
pub struct Panel {
    /// Above it.
    pub title: String,
    /// To the right.
    pub x: Axis,
    /// Upwards.
    pub y: Axis,
    /// At most [`MOST_CURVES`].
    pub curves: Vec<Curve>,
    /// A horizontal line for reference, with its name.
    pub level: Option<(f64, String)>,
}

/// A line, the region around it, and what it was made from. Any of these may be empty.
#[derive(Debug, Clone, Default)]
pub struct Curve {
    /// In the legend.
    pub label: String,
    /// In order of x, units of the axes. The line ends before a y that is no number, and begins anew behind it.
    pub points: Vec<(f64, f64)>,
    /// x, lower and upper end, in order of x.
    pub band: Vec<(f64, f64, f64)>,
    /// Values that were measured, as dots: x, y, and the ends of y's interval.
    pub dots: Vec<(f64, f64, [f64; 2])>,
    /// Single cases, as ticks: x, and whether it is above the panel or below, where the axis upwards has [`room`](Axis::with_room).
    pub rug: Vec<(f64, bool)>,
}

/// An axis with its ticks. What lies beyond its ends is drawn at them.
#[derive(Debug, Clone)]
pub struct Axis {
    label: String,
    range: Range<f64>,
    log: bool,
    /// At either end, without ticks.
    room: f64,
}

impl Axis {
    /// From one value to another. `label` has the unit.
    pub fn linear(label: &str, from: f64, to: f64) -> Self {
        Self { label: label.to_owned(), range: from..to, log: false, room: 0.0 }
    }

    /// The same with so much room beyond either end, for a rug. Of linear axes alone.
    #[must_use]
    pub fn with_room(self, room: f64) -> Self {
        let Range { start, end } = self.range;
        Self { range: start - room..end + room, room, ..self }
    }

    /// Logarithmic, over the positive ones of `values`, to the next 1, 2 or 5 times a power of ten on either side.
    pub fn log(label: &str, values: impl IntoIterator<Item = f64>) -> Self {
        let mut ends = [f64::INFINITY, 0.0];
        for x in values.into_iter().filter(|x| *x > 0.0 && x.is_finite()) {
            ends = [ends[0].min(x), ends[1].max(x)];
        }
        if ends[0] > ends[1] {
            ends = [1.0, 10.0];
        }
        let slack = 1.0 + 1e-9;
        let below = rounds(&[1, 2, 5], &(ends[0] / 10.0..ends[0] * slack)).last().copied();
        let above = rounds(&[1, 2, 5], &(ends[1] / slack..ends[1] * 10.0)).first().copied();
        let from = below.unwrap_or(ends[0]);
        // Two decades' worth of nothing is better than an axis without ticks.
        let to = above.unwrap_or(ends[1]).max(2.0 * from);
        Self { label: label.to_owned(), range: from..to, log: true, room: 0.0 }
    }

    /// Ticks with numbers.
    fn ticks(&self) -> Vec<f64> {
        let Range { start, end } = self.range;
        if !self.log {
            let (start, end) = (start + self.room, end - self.room);
            let step = round_up((end - start) / 8.0);
            let (first, last) = ((start / step).ceil() as i64, (end / step * (1.0 + 1e-9)).floor() as i64);
            return (first..=last).map(|i| i as f64 * step).collect();
        }
        let digits: &[u32] = if end / start > 600.0 { &[1] } else { &[1, 2, 5] };
        rounds(digits, &(start / (1.0 + 1e-9)..end * (1.0 + 1e-9)))
    }

    /// Ticks without.
    fn minor(&self) -> Vec<f64> {
        let all = [1, 2, 3, 4, 5, 6, 7, 8, 9];
        if self.log { rounds(&all, &self.range) } else { Vec::new() }
    }
}

/// The next 1, 2 or 5 times a power of ten from a positive number on; 1 of others.
fn round_up(x: f64) -> f64 {
    rounds(&[1, 2, 5], &(x..10.0 * x)).first().copied().unwrap_or(1.0)
}

/// Digits times powers of ten in a range of positive numbers, ascending.
fn rounds(digits: &[u32], range: &Range<f64>) -> Vec<f64> {
    let decades = range.start.log10().floor() as i32..=range.end.log10().ceil() as i32;
    decades
        .flat_map(|power| digits.iter().map(move |digit| f64::from(*digit) * 10f64.powi(power)))
        .filter(|x| range.contains(x))
        .collect()
}

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (first, last): (i32, i32)) -> i32 {
        let scale = |x: f64| if self.log { x.max(f64::MIN_POSITIVE).log10() } else { x };
        let (start, end) = (scale(self.range.start), scale(self.range.end));
        let share = ((scale(*value) - start) / (end - start)).clamp(0.0, 1.0);
        first + (share * f64::from(last - first)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        if hint.weight().allow_light_points() { self.minor() } else { self.ticks() }
    }

    fn range(&self) -> Range<f64> {
        self.range.clone()
    }
}

impl ValueFormatter<f64> for Axis {
    fn format_ext(&self, value: &f64) -> String {
        // Multiples of steps such as 0.1 are off in their last digits.
        let shown = format!("{value:.6}");
        shown.trim_end_matches('0').trim_end_matches('.').to_owned()
    }
}

/// Draws a figure and writes it, whole or not at all.
///
/// # Errors
/// When a panel has too many curves, or the file cannot be written.
pub fn write(figure: &Figure, path: &Path) -> Result<()> {
    Ok(bop::write_atomic(path, svg(figure)?.as_bytes())?)
}

/// Whether a figure can be written there, to be asked before hours of computing.
///
/// # Errors
/// When `path` is a folder or in none.
pub fn check_place(path: &Path) -> Result<()> {
    anyhow::ensure!(!path.is_dir(), "{}: is a folder; give a file", path.display());
    let folder = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder)
        .with_context(|| format!("{}: cannot be written; give another place", path.display()))?;
    anyhow::ensure!(path.file_name().is_some(), "{}: is no name of a file", path.display());
    Ok(())
}

/// A figure as SVG.
///
/// # Errors
/// When a panel has too many curves.
pub fn svg(figure: &Figure) -> Result<String> {
    let most = figure.panels.iter().map(|panel| panel.curves.len()).max().unwrap_or(0);
    anyhow::ensure!(most <= MOST_CURVES, "a figure has colours for {MOST_CURVES} curves, not for {most}");
    let lines = most as u32 + u32::from(figure.panels.iter().any(|panel| panel.level.is_some()));
    let columns = figure.columns.max(1);
    let rows = figure.panels.len().div_ceil(columns);
    let (width, height) = (PANEL.0, PANEL.1 + LEGEND_LINE * (lines + 2));
    let size = (width * columns as u32, TITLE + height * rows as u32);
    let mut text = String::new();
    draw(figure, SVGBackend::with_string(&mut text, size).into_drawing_area(), (columns, rows))
        .map_err(|error| anyhow::anyhow!("cannot draw the figure: {error}"))?;
    // The library has no dashes that keep a curve in one piece.
    for (RGBColor(r, g, b), dashes) in COLORS.into_iter().zip(DASHES).filter(|(_, dashes)| !dashes.is_empty())
    {
        let stroke = format!("stroke=\"#{r:02X}{g:02X}{b:02X}\" stroke-width=\"4\"");
        text = text.replace(&stroke, &format!("{stroke} stroke-dasharray=\"{dashes}\""));
    }
    Ok(text)
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn<'a> = std::result::Result<(), DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>>;

fn draw<'a>(figure: &Figure, root: Area<'a>, (columns, rows): (usize, usize)) -> Drawn<'a> {
    root.fill(&WHITE)?;
    let (width, _) = root.dim_in_pixel();
    let (title, rest) = root.split_vertically(TITLE);
    let centred = ("sans-serif", TEXT + 6).into_font().into_text_style(&title);
    let centred = centred.pos(Pos::new(HPos::Center, VPos::Center));
    title.draw(&Text::new(figure.title.as_str(), (width as i32 / 2, TITLE as i32 / 2), centred))?;
    for (panel, area) in figure.panels.iter().zip(rest.split_evenly((rows, columns))) {
        let (chart, legend) = area.split_vertically(PANEL.1);
        draw_chart(panel, &chart)?;
        draw_legend(panel, &legend)?;
    }
    root.present()
}

fn draw_chart<'a>(panel: &Panel, area: &Area<'a>) -> Drawn<'a> {
    let mut chart = ChartBuilder::on(area)
        .margin_left(24)
        .margin_right(40)
        .margin_top(10)
        .caption(&panel.title, ("sans-serif", TEXT + 2))
        .x_label_area_size(76)
        .y_label_area_size(100)
        .build_cartesian_2d(panel.x.clone(), panel.y.clone())?;
    chart
        .configure_mesh()
        .label_style(("sans-serif", TEXT - 2))
        .axis_desc_style(("sans-serif", TEXT))
        .x_desc(panel.x.label.as_str())
        .y_desc(panel.y.label.as_str())
        .light_line_style(BLACK.mix(0.06))
        .bold_line_style(BLACK.mix(0.16))
        .draw()?;
    // All bands below all lines.
    for (curve, color) in panel.curves.iter().zip(COLORS) {
        let lower = curve.band.iter().map(|&(x, low, _)| (x, low));
        let upper = curve.band.iter().rev().map(|&(x, _, high)| (x, high));
        let outline: Vec<(f64, f64)> = lower.chain(upper).collect();
        if !outline.is_empty() {
            chart.draw_series([Polygon::new(outline, color.mix(0.16))])?;
        }
    }
    if let Some((y, _)) = &panel.level {
        let Range { start, end } = panel.x.range;
        chart.draw_series([PathElement::new([(start, *y), (end, *y)], level_style())])?;
    }
    for (curve, color) in panel.curves.iter().zip(COLORS) {
        for piece in curve.points.split(|point| point.1.is_nan()).filter(|piece| !piece.is_empty()) {
            chart.draw_series([PathElement::new(piece, color.stroke_width(4))])?;
        }
    }
    // All dots above all lines.
    for (curve, color) in panel.curves.iter().zip(COLORS) {
        let whisker = color.mix(0.6).stroke_width(2);
        let interval =
            |&(x, _, [low, high]): &(f64, f64, [f64; 2])| PathElement::new([(x, low), (x, high)], whisker);
        chart.draw_series(curve.dots.iter().map(interval))?;
        chart.draw_series(curve.dots.iter().map(|&(x, y, _)| Circle::new((x, y), 7, color.filled())))?;
    }
    // A lane a curve, from the ends of the axis outwards.
    let (lane, gap) = (0.85 * panel.y.room / panel.curves.len().max(1) as f64, 0.15 * panel.y.room);
    let ends = [panel.y.range.start + panel.y.room - gap, panel.y.range.end - panel.y.room + gap];
    for (i, (curve, color)) in panel.curves.iter().zip(COLORS).enumerate() {
        let tick = |&(x, above): &(f64, bool)| {
            let (end, sign) = if above { (ends[1], 1.0) } else { (ends[0], -1.0) };
            let [from, to] = [i as f64, i as f64 + 0.8].map(|lanes| end + sign * lanes * lane);
            PathElement::new([(x, from), (x, to)], color.mix(0.75).stroke_width(2))
        };
        chart.draw_series(curve.rug.iter().map(tick))?;
    }
    Ok(())
}

fn draw_legend<'a>(panel: &Panel, area: &Area<'a>) -> Drawn<'a> {
    let curves = panel.curves.iter().zip(COLORS);
    let mut lines: Vec<(&str, ShapeStyle)> =
        curves.map(|(curve, color)| (curve.label.as_str(), color.stroke_width(4))).collect();
    if let Some((_, name)) = &panel.level {
        lines.push((name, level_style()));
    }
    for (i, (label, style)) in (0..).zip(lines) {
        let y = (LEGEND_LINE * (i + 1)) as i32;
        area.draw(&PathElement::new([(130, y), (190, y)], style))?;
        let font = ("sans-serif", TEXT).into_font().into_text_style(area);
        area.draw(&Text::new(label, (205, y), font.pos(Pos::new(HPos::Left, VPos::Center))))?;
    }
    Ok(())
}

fn level_style() -> ShapeStyle {
    RGBColor(110, 110, 110).stroke_width(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn log_axes_end_at_round_numbers_around_the_values() {
        let axis = Axis::log("", [0.0, 0.3, 42.0, f64::INFINITY]);
        assert!((axis.range.start - 0.2).abs() < 1e-12 && (axis.range.end - 50.0).abs() < 1e-9, "{axis:?}");
        let shown: Vec<String> = axis.ticks().iter().map(|tick| axis.format_ext(tick)).collect();
        assert_eq!(shown, ["0.2", "0.5", "1", "2", "5", "10", "20", "50"]);
        // Values that are round themselves are the ends.
        assert_eq!(Axis::log("", [1.0, 100.0]).range, 1.0..100.0);
        assert_eq!(Axis::log("", []).range, 1.0..10.0);
        assert_eq!(Axis::log("", [1.0]).range, 1.0..2.0);
    }

    #[test]
    fn ticks_of_a_linear_axis() {
        let shown = |axis: &Axis| axis.ticks().iter().map(|tick| axis.format_ext(tick)).collect::<Vec<_>>();
        assert_eq!(shown(&Axis::linear("", 0.0, 40.0)), ["0", "5", "10", "15", "20", "25", "30", "35", "40"]);
        assert_eq!(
            shown(&Axis::linear("", 0.0, 0.7)),
            ["0", "0.1", "0.2", "0.3", "0.4", "0.5", "0.6", "0.7"]
        );
    }

    #[test]
    fn single_cases_stand_beside_their_curve_and_a_gap_is_none() {
        let curve = Curve {
            label: "can".into(),
            points: vec![(-1.0, 50.0), (0.0, 100.0), (0.0, f64::NAN), (0.0, 90.0), (1.0, 50.0)],
            dots: vec![(-1.0, 40.0, [10.0, 70.0]), (1.0, 60.0, [30.0, 80.0])],
            rug: vec![(-1.0, false), (-0.9, true), (1.0, true)],
            ..Curve::default()
        };
        let panel = Panel {
            title: String::new(),
            x: Axis::linear("x", -1.0, 1.0),
            y: Axis::linear("y", 0.0, 100.0).with_room(10.0),
            curves: vec![curve],
            level: None,
        };
        let shown: Vec<String> = panel.y.ticks().iter().map(|tick| panel.y.format_ext(tick)).collect();
        assert_eq!((shown.first().unwrap().as_str(), shown.last().unwrap().as_str()), ("0", "100"));
        let text = svg(&Figure { title: String::new(), columns: 1, panels: vec![panel] }).unwrap();
        let of = |element: &str, width: u32| {
            let width = format!("stroke=\"#0072B2\" stroke-width=\"{width}\"");
            text.lines().filter(|line| line.starts_with(element) && line.contains(&width)).count()
        };
        // Two pieces and the legend's line; two intervals and three ticks.
        assert_eq!((of("<polyline", 4), of("<polyline", 2)), (3, 5), "{text}");
        assert_eq!(text.matches("<circle").count(), 2);
    }

    #[test]
    fn values_map_to_pixels_and_stay_inside() {
        let log = Axis::log("", [1.0, 100.0]);
        let at = |x: f64| log.map(&x, (0, 1000));
        assert_eq!([at(1.0), at(10.0), at(100.0), at(0.0), at(1e9)], [0, 500, 1000, 0, 1000]);
        // Upwards is from large to small pixels.
        assert_eq!(Axis::linear("", 0.0, 4.0).map(&1.0, (400, 0)), 300);
    }

    #[test]
    fn names_of_any_kind_stay_text() {
        let points = vec![(0.0, 0.0), (1.0, 1.0)];
        let curve = Curve { label: "a<b> & \"c\"".to_owned(), points, ..Curve::default() };
        let panel = Panel {
            title: String::new(),
            x: Axis::linear("x", 0.0, 1.0),
            y: Axis::linear("y", 0.0, 1.0),
            curves: vec![curve; 2],
            level: None,
        };
        let figure = Figure { title: "<&>".to_owned(), columns: 1, panels: vec![panel] };
        let text = svg(&figure).unwrap();
        assert!(!text.contains("<b>") && text.contains("a&lt;b"), "{text}");
        let many = Figure {
            panels: vec![Panel {
                curves: vec![figure.panels[0].curves[0].clone(); 8],
                ..figure.panels[0].clone()
            }],
            ..figure
        };
        assert!(svg(&many).unwrap_err().to_string().contains("colours for 7"));
    }
}
