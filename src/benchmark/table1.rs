//! The GRIP paper's Table I with a column for each of several methods, in Markdown, LaTeX and HTML, and the curves of the four objects
//! that it draws.

use std::fmt::Write as _;

use grip_perception::metrics::auc;

use super::case::Case;
use super::evaluation::Evaluation;
use super::paper::{Area, PaperTable};
use super::published::{DRAWN, GROUPS, METHODS, OBJECTS, THRESHOLD_M};
use crate::html::escape;
use crate::plot::{Axis, Curve, Figure, Panel};

/// A method's figures and its name in the table.
#[derive(Debug, Clone, Copy)]
pub struct Method<'a> {
    /// In the head of its columns.
    pub title: &'a str,
    /// All its errors.
    pub evaluation: &'a Evaluation,
    /// The figures of the table.
    pub table: &'a PaperTable,
}

/// Rows of cells: for each of the paper's three settings ours, then what the paper has.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// The settings, and the heads of the columns of each.
    groups: Vec<(&'static str, Vec<String>)>,
    rows: Vec<(String, Vec<Cell>)>,
}

/// An area, 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Cell {
    area: Option<f64>,
    interval: Option<[f64; 2]>,
    /// The largest of its row in its setting.
    best: bool,
    /// From the paper.
    published: bool,
}

impl Cell {
    fn number(&self) -> String {
        self.area.map_or_else(|| "-".to_owned(), |area| format!("{area:.3}"))
    }

    /// With its interval, where that is `wanted`.
    fn text(&self, wanted: bool) -> String {
        match self.interval.filter(|_| wanted) {
            Some([low, high]) => format!("{} ({low:.3}-{high:.3})", self.number()),
            None => self.number(),
        }
    }
}

impl Table {
    /// Of several methods on one data set.
    pub fn new(methods: &[Method<'_>]) -> Self {
        let heads = methods.iter().map(|method| method.title.to_owned());
        let heads: Vec<String> = heads.chain(METHODS.map(|name| format!("{name}, paper"))).collect();
        let groups = GROUPS.iter().map(|(name, _)| (*name, heads.clone())).collect();
        let row = |name: String, area: &dyn Fn(&PaperTable, usize) -> Area| {
            let cells = (0..GROUPS.len()).flat_map(|group| {
                let areas: Vec<Area> = methods.iter().map(|method| area(method.table, group)).collect();
                cells(&areas)
            });
            (name, cells.collect())
        };
        let mut rows: Vec<(String, Vec<Cell>)> = (OBJECTS.iter().enumerate())
            .map(|(i, object)| {
                let star = if object.symmetric { "*" } else { "" };
                row(format!("{}{star}", object.name), &|table, group| {
                    table.groups[group].objects[i].area.clone()
                })
            })
            .collect();
        rows.push(row("Overall".to_owned(), &|table, group| table.groups[group].overall.area.clone()));
        Self { groups, rows }
    }

    /// Whether intervals are shown of a row: of the last one; for others there is no room.
    fn shows_intervals(&self, row: usize) -> bool {
        row + 1 == self.rows.len()
    }

    /// In Markdown.
    pub fn markdown(&self) -> String {
        let heads = self
            .groups
            .iter()
            .flat_map(|(group, heads)| heads.iter().map(move |head| format!("{group}: {head}")));
        let heads: Vec<String> = heads.collect();
        let mut text = format!("| | {} |\n|---|{}\n", heads.join(" | "), "---|".repeat(heads.len()));
        for (i, (name, cells)) in self.rows.iter().enumerate() {
            let cell = |cell: &Cell| {
                let text = cell.text(self.shows_intervals(i));
                match cell {
                    Cell { area: None, .. } => text,
                    Cell { best: true, .. } => format!("**{text}**"),
                    Cell { published: true, .. } => format!("*{text}*"),
                    _ => text,
                }
            };
            let cells: Vec<String> = cells.iter().map(cell).collect();
            let _ = writeln!(text, "| {} | {} |", name.replace('*', "\\*"), cells.join(" | "));
        }
        text
    }

    /// In LaTeX; needs `xcolor`.
    pub fn latex(&self) -> String {
        let escaped = |text: &str| text.replace('_', "\\_").replace('*', "$^{*}$");
        let columns: String =
            self.groups.iter().map(|(_, heads)| format!("|{}", "r".repeat(heads.len()))).collect();
        let mut text = format!("\\begin{{tabular}}{{l{columns}}}\n\\hline\n");
        for (group, heads) in &self.groups {
            let _ = write!(text, " & \\multicolumn{{{}}}{{c}}{{{group}}}", heads.len());
        }
        text += " \\\\\n";
        for head in self.groups.iter().flat_map(|(_, heads)| heads) {
            let _ = write!(text, " & {}", escaped(head));
        }
        text += " \\\\\n\\hline\n";
        for (i, (name, cells)) in self.rows.iter().enumerate() {
            if self.shows_intervals(i) {
                text += "\\hline\n";
            }
            text += &escaped(name);
            for cell in cells {
                let number = cell.text(self.shows_intervals(i));
                text += &match cell {
                    Cell { area: None, .. } => " & -".to_owned(),
                    Cell { best: true, .. } => format!(" & \\textbf{{{number}}}"),
                    Cell { published: true, .. } => format!(" & \\textcolor{{gray}}{{{number}}}"),
                    _ => format!(" & {number}"),
                };
            }
            text += " \\\\\n";
        }
        text + "\\hline\n\\end{tabular}\n"
    }

    /// The element `table` of a page.
    pub fn html(&self) -> String {
        let mut text = "<table><thead><tr><th>".to_owned();
        for (group, heads) in &self.groups {
            let _ = write!(text, "<th colspan={}>{}", heads.len(), escape(group));
        }
        text += "<tr><th>";
        for head in self.groups.iter().flat_map(|(_, heads)| heads) {
            let _ = write!(text, "<th class=n>{}", escape(head));
        }
        text += "</thead><tbody>";
        for (i, (name, cells)) in self.rows.iter().enumerate() {
            let _ = write!(text, "<tr><td>{}", escape(name));
            for cell in cells {
                let number = cell.text(self.shows_intervals(i));
                let number = if cell.best { format!("<b>{number}</b>") } else { number };
                let grey = if cell.published { " style=color:#8a9199" } else { "" };
                let title = cell
                    .interval
                    .map_or_else(String::new, |[low, high]| format!(" title='95 %: {low:.3}-{high:.3}'"));
                let _ = write!(text, "<td class=n{grey}{title}>{number}");
            }
        }
        text + "</tbody></table>"
    }
}

/// The cells of a row in one setting.
fn cells(areas: &[Area]) -> Vec<Cell> {
    let most = areas.iter().filter_map(|area| area.auc).fold(f64::NEG_INFINITY, f64::max);
    let ours = areas.iter().map(|area| Cell {
        area: area.auc,
        interval: area.interval,
        best: area.auc == Some(most),
        published: false,
    });
    let published = areas.first().map_or([None; 3], |area| area.published);
    let published =
        published.into_iter().map(|area| Cell { area, interval: None, best: false, published: true });
    ours.chain(published).collect()
}

/// Accuracy-threshold curves of the four objects that the paper draws, by setting: a row of panels each.
pub fn curves(methods: &[Method<'_>]) -> Figure {
    let mut panels = Vec::new();
    for (name, views) in GROUPS {
        for object in
            DRAWN.map(|name| OBJECTS.iter().find(|object| object.name == name)).into_iter().flatten()
        {
            let curve = |method: &Method<'_>| {
                let inside = |case: &&Case| {
                    let view = method.evaluation.views.get(&(case.scene_id, case.im_id));
                    case.obj_id == object.obj_id && view.is_some_and(|view| views.contains(&view.as_str()))
                };
                let error = |case: &Case| if object.symmetric { case.adds } else { case.add };
                let errors: Vec<f64> = method.evaluation.cases.iter().filter(inside).map(error).collect();
                let points = super::accuracy::steps(&errors, THRESHOLD_M).into_iter();
                Curve {
                    label: format!(
                        "{}: AUC {:.3}, {} instances",
                        method.title,
                        auc(&errors, THRESHOLD_M),
                        errors.len()
                    ),
                    points: points.map(|(m, share)| (1e3 * m, 100.0 * share)).collect(),
                    ..Curve::default()
                }
            };
            panels.push(Panel {
                title: format!("{}, {name}", object.name),
                x: Axis::linear("threshold, mm", 0.0, 1e3 * THRESHOLD_M),
                y: Axis::linear("instances under the threshold, %", 0.0, 100.0),
                curves: methods.iter().map(curve).collect(),
                level: None,
            });
        }
    }
    Figure { title: "Accuracy against threshold".to_owned(), columns: DRAWN.len(), panels }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(auc: f64) -> Area {
        Area {
            instances: 2,
            auc: Some(auc),
            interval: Some([auc - 0.1, auc + 0.1]),
            published: [None, Some(0.4), Some(0.6)],
        }
    }

    fn table() -> Table {
        let cells = [
            cells(&[area(0.5), area(0.7)]),
            cells(&[area(0.5), Area { auc: None, interval: None, ..area(0.0) }]),
        ]
        .concat();
        let heads = ["a_b", "c", "DOPE, paper", "PoseCNN, paper", "GRIP, paper"].map(str::to_owned).to_vec();
        Table {
            groups: vec![("base", heads.clone()), ("occlusions", heads)],
            rows: vec![("005_can*".to_owned(), cells.clone()), ("Overall".to_owned(), cells)],
        }
    }

    #[test]
    fn the_best_of_ours_is_bold_and_the_papers_are_told_apart() {
        let text = table().markdown();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(
            lines[2],
            "| 005_can\\* | 0.500 | **0.700** | - | *0.400* | *0.600* | **0.500** | - | - | *0.400* | *0.600* |"
        );
        assert!(
            lines[3].starts_with("| Overall | 0.500 (0.400-0.600) | **0.700 (0.600-0.800)** | - |"),
            "{}",
            lines[3]
        );
        assert!(
            lines.iter().all(|line| line.matches(" | ").count() == 10 || line.starts_with("|---")),
            "{text}"
        );
    }

    #[test]
    fn latex_has_as_many_cells_as_columns() {
        let text = table().latex();
        assert!(
            text.contains("005\\_can$^{*}$ & 0.500 & \\textbf{0.700} & - & \\textcolor{gray}{0.400}"),
            "{text}"
        );
        assert!(text.contains("\\multicolumn{5}{c}{base} & \\multicolumn{5}{c}{occlusions}"), "{text}");
        let rows = text.lines().filter(|line| line.contains("0.700"));
        assert!(
            rows.clone().count() == 2 && rows.clone().all(|line| line.matches('&').count() == 10),
            "{text}"
        );
    }
}
