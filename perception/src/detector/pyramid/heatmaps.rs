//! Heat maps, and how boxes are read off them.

use std::sync::Arc;

use super::description::DetectorDescription;
use super::settings::PyramidSettings;
use crate::detector::detections::{Detection, iou};

/// One level of the pyramid: probabilities of objects and of aspect ratios for every cell.
#[derive(Debug, Clone)]
pub struct HeatMap {
    /// Pixels of the level for one of the image, along both axes.
    pub scale: [f64; 2],
    /// Rows of cells.
    pub rows: usize,
    /// Columns of cells.
    pub columns: usize,
    /// (1 + objects, rows, columns), background first.
    pub(super) classes: Vec<f32>,
    /// (aspect ratios, rows, columns).
    pub(super) shapes: Vec<f32>,
}

impl HeatMap {
    /// Probability of class `class` (0 is the background) in each cell, row by row.
    pub fn class(&self, class: usize) -> &[f32] {
        let cells = self.rows * self.columns;
        &self.classes[class * cells..(class + 1) * cells]
    }

    /// Cells around one, itself included, row by row; fewer at the border.
    fn around(&self, cell: usize, reach: usize) -> impl Iterator<Item = usize> + use<> {
        let (row, column, columns) = (cell / self.columns, cell % self.columns, self.columns);
        let rows = row.saturating_sub(reach)..(row + reach + 1).min(self.rows);
        let across = column.saturating_sub(reach)..(column + reach + 1).min(columns);
        rows.flat_map(move |r| across.clone().map(move |c| r * columns + c))
    }

    /// Whether no neighbour of a cell has more; of equal ones, the first is the peak.
    fn is_peak(&self, map: &[f32], cell: usize) -> bool {
        self.around(cell, 1).all(|other| map[other] < map[cell] || (map[other] == map[cell] && other >= cell))
    }
}

/// What a network says of an image: a pyramid of heat maps.
#[derive(Debug, Clone)]
pub struct HeatMaps {
    /// Width and height of the image, pixels.
    pub(super) size: [f64; 2],
    /// Finest level first.
    pub(super) maps: Vec<HeatMap>,
    pub(super) description: Arc<DetectorDescription>,
    pub(super) settings: PyramidSettings,
}

impl HeatMaps {
    /// The levels, finest first; see [`PyramidSettings::side_px`].
    pub fn levels(&self) -> &[HeatMap] {
        &self.maps
    }

    /// The network's description.
    pub fn description(&self) -> &DetectorDescription {
        &self.description
    }

    /// All boxes of class `class`, the most confident first: one for each peak of each level, however low. Position and size
    /// are averages over the cells and levels about it, weighted by probability.
    pub fn boxes(&self, class: usize) -> Vec<Detection> {
        let mut found = Vec::new();
        for (level, map) in self.maps.iter().enumerate() {
            let values = map.class(class);
            let peaks = (0..values.len()).filter(|cell| map.is_peak(values, *cell));
            found.extend(peaks.map(|cell| self.read(class, level, cell)));
        }
        found.sort_by(|a, b| b.confidence.total_cmp(&a.confidence));
        let mut kept: Vec<Detection> = Vec::with_capacity(found.len());
        for detection in found {
            if kept.iter().all(|other| iou(&other.bbox, &detection.bbox) < self.settings.same_box_iou) {
                kept.push(detection);
            }
        }
        kept
    }

    /// The box of a cell.
    fn read(&self, class: usize, level: usize, cell: usize) -> Detection {
        let map = &self.maps[level];
        let values = map.class(class);
        let cells = map.rows * map.columns;
        let ratios = &self.description.aspect_ratios;
        let (mut sum, mut centre, mut shapes) = (0.0, [0.0; 2], vec![0.0; ratios.len()]);
        for near in map.around(cell, self.settings.reach_cells) {
            let weight = f64::from(values[near]) + f64::from(f32::MIN_POSITIVE);
            sum += weight;
            centre[0] += weight * ((near % map.columns) as f64 + 0.5);
            centre[1] += weight * ((near / map.columns) as f64 + 0.5);
            for (i, shape) in shapes.iter_mut().enumerate() {
                *shape += weight * f64::from(map.shapes[i * cells + near]);
            }
        }
        let stride = self.description.stride_px as f64;
        let [u, v] = [0, 1].map(|axis| stride * centre[axis] / sum / map.scale[axis]);
        let here = f64::from(values[cell]);
        let finer = level.checked_sub(1).map_or(0.0, |other| self.at(class, other, u, v));
        let coarser = if level + 1 < self.maps.len() { self.at(class, level + 1, u, v) } else { 0.0 };
        let octaves =
            self.settings.octaves * (coarser - finer) / (coarser + here + finer).max(f64::MIN_POSITIVE);
        let side = self.settings.side_px(level) * octaves.exp2();
        let ratio = ratio(ratios, &shapes);
        let (w, h) = (side * ratio.min(1.0), side * (1.0 / ratio).min(1.0));
        // Edges of pixels to centres of the first and the last one inside.
        let clamp = |x: f64, axis: usize| x.clamp(0.0, self.size[axis] - 1.0);
        let bbox = [
            clamp(u - w / 2.0, 0),
            clamp(v - h / 2.0, 1),
            clamp(u + w / 2.0 - 1.0, 0),
            clamp(v + h / 2.0 - 1.0, 1),
        ];
        Detection { bbox: [bbox[0], bbox[1], bbox[2].max(bbox[0]), bbox[3].max(bbox[1])], confidence: here }
    }

    /// The largest probability of a level near a pixel of the image.
    fn at(&self, class: usize, level: usize, u: f64, v: f64) -> f64 {
        let map = &self.maps[level];
        let stride = self.description.stride_px as f64;
        let cell = |x: f64, axis: usize, count: usize| {
            ((x * map.scale[axis] / stride).floor().max(0.0) as usize).min(count - 1)
        };
        let cell = cell(v, 1, map.rows) * map.columns + cell(u, 0, map.columns);
        let values = map.class(class);
        f64::from(map.around(cell, 1).map(|near| values[near]).fold(0.0, f32::max))
    }
}

/// The aspect ratio that a distribution over ratios says: the mean of the logarithms of the likeliest and its neighbours.
fn ratio(ratios: &[f64], probabilities: &[f64]) -> f64 {
    let best = (0..ratios.len()).max_by(|a, b| probabilities[*a].total_cmp(&probabilities[*b])).unwrap_or(0);
    let near = best.saturating_sub(1)..(best + 2).min(ratios.len());
    let sum: f64 = near.clone().map(|i| probabilities[i]).sum();
    if sum > 0.0 {
        (near.map(|i| probabilities[i] * ratios[i].ln()).sum::<f64>() / sum).exp()
    } else {
        ratios[best]
    }
}
