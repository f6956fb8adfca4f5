//! Where on a plane its surface was seen: the outline of the table top, so that what stands behind the table is not taken
//! for something on it.

use nalgebra::{Point2, Point3, Unit, Vector3};

/// Side of the cells in which the surface is counted, metres: wider than the gaps between sampled points at 1.5 m.
const CELL: f64 = 0.03;
/// Points that make a cell part of the surface.
const CELL_POINTS: u32 = 2;
/// Cells along each side of the grid: points farther than 3 m from the first one are left out.
const CELLS: i64 = 200;
/// A piece of the surface belongs to it when so many of its cells have filled ones on all four sides, 90 square centimetres: a
/// fold or a board's edge parts a surface, while the walls that cut its plane make strips.
const PIECE_CELLS: usize = 10;

/// The convex hull of the large connected pieces of a plane's visible surface.
#[derive(Debug, Clone, PartialEq)]
pub struct Footprint {
    /// Its sides: `n . p - d` is how far inside of a side a point is, metres.
    sides: Vec<(Vector3<f64>, f64)>,
    /// Square metres.
    area: f64,
}

impl Footprint {
    /// From points on the plane with this normal; `None` when they cover no area.
    pub(crate) fn new(
        normal: &Unit<Vector3<f64>>,
        points: impl Iterator<Item = Point3<f64>>,
    ) -> Option<Self> {
        let side = if normal.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
        let first = normal.cross(&side).normalize();
        let axes = [first, normal.cross(&first)];
        let flat: Vec<Point2<f64>> = points.map(|p| flatten(&axes, &p)).collect();
        let origin = flat.first()?;
        let mut counts = vec![0u32; (CELLS * CELLS) as usize];
        let cell = |p: &Point2<f64>| {
            let [x, y] = [0, 1].map(|i| ((p[i] - origin[i]) / CELL).floor() as i64 + CELLS / 2);
            ((0..CELLS).contains(&x) && (0..CELLS).contains(&y)).then_some((y * CELLS + x) as usize)
        };
        for c in flat.iter().filter_map(cell) {
            counts[c] += 1;
        }
        let piece = large_pieces(&counts);
        let inside: Vec<Point2<f64>> =
            flat.iter().filter(|p| cell(p).is_some_and(|c| piece[c])).copied().collect();
        let corners = convex_hull(inside);
        if corners.len() < 3 {
            return None;
        }
        // Corners go counter-clockwise, so what is left of a side is inside.
        let side = |(a, b): (&Point2<f64>, &Point2<f64>)| {
            let along = (b - a).normalize();
            let inward = axes[1] * along.x - axes[0] * along.y;
            (inward, along.perp(&a.coords))
        };
        let pairs = || corners.iter().zip(corners.iter().cycle().skip(1));
        let area = pairs().map(|(a, b)| a.coords.perp(&b.coords)).sum::<f64>() / 2.0;
        Some(Self { sides: pairs().map(side).collect(), area })
    }

    /// All of a plane.
    #[cfg(test)]
    pub(crate) fn endless() -> Self {
        Self { sides: Vec::new(), area: f64::INFINITY }
    }

    /// Area of the hull, square metres.
    pub fn area(&self) -> f64 {
        self.area
    }

    /// Its sides: a normal `n` into it and an offset `d`; `n . p - d` is how far inside a point is, metres.
    pub fn sides(&self) -> &[(Vector3<f64>, f64)] {
        &self.sides
    }

    /// Whether a point is over the surface, or within `margin` metres beside it.
    pub fn covers(&self, point: &Point3<f64>, margin: f64) -> bool {
        self.sides.iter().all(|(inward, offset)| inward.dot(&point.coords) - offset >= -margin)
    }
}

fn flatten(axes: &[Vector3<f64>; 2], p: &Point3<f64>) -> Point2<f64> {
    Point2::new(axes[0].dot(&p.coords), axes[1].dot(&p.coords))
}

/// Marks the sets of filled cells that touch, corners included, and are large.
fn large_pieces(counts: &[u32]) -> Vec<bool> {
    let filled = |c: usize| counts[c] >= CELL_POINTS;
    let mut label = vec![0u32; counts.len()];
    let cross = |c: usize| {
        let (x, y) = (c as i64 % CELLS, c as i64 / CELLS);
        [(x, y), (x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)].iter().all(|&(x, y)| {
            (0..CELLS).contains(&x) && (0..CELLS).contains(&y) && filled((y * CELLS + x) as usize)
        })
    };
    // Cells inside of each piece, by label; 0 is none.
    let mut inner = vec![0usize];
    for start in 0..counts.len() {
        if !filled(start) || label[start] != 0 {
            continue;
        }
        let next = inner.len() as u32;
        let (mut inside, mut stack) = (0, vec![start]);
        label[start] = next;
        while let Some(c) = stack.pop() {
            inside += usize::from(cross(c));
            let (x, y) = (c as i64 % CELLS, c as i64 / CELLS);
            for (nx, ny) in (y - 1..=y + 1).flat_map(|ny| (x - 1..=x + 1).map(move |nx| (nx, ny))) {
                if (0..CELLS).contains(&nx) && (0..CELLS).contains(&ny) {
                    let n = (ny * CELLS + nx) as usize;
                    if filled(n) && label[n] == 0 {
                        label[n] = next;
                        stack.push(n);
                    }
                }
            }
        }
        inner.push(inside);
    }
    let least = inner.iter().copied().max().unwrap_or(0).min(PIECE_CELLS);
    label.into_iter().map(|l| l != 0 && inner[l as usize] >= least).collect()
}

/// Andrew's monotone chain; counter-clockwise.
fn convex_hull(mut points: Vec<Point2<f64>>) -> Vec<Point2<f64>> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let chain = |points: &mut dyn Iterator<Item = &Point2<f64>>| {
        let mut hull: Vec<Point2<f64>> = Vec::new();
        for p in points {
            while let [.., a, b] = hull[..]
                && (b - a).perp(&(p - b)) <= 0.0
            {
                hull.pop();
            }
            hull.push(*p);
        }
        hull.pop();
        hull
    };
    let mut hull = chain(&mut points.iter());
    hull.extend(chain(&mut points.iter().rev()));
    hull
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points a centimetre apart on the plane z = 1.
    fn grid(x0: f64, columns: usize, rows: usize) -> impl Iterator<Item = Point3<f64>> {
        let at = move |i: usize| (x0 + 0.01 * (i % columns) as f64, 0.01 * (i / columns) as f64);
        (0..columns * rows).map(at).map(|(x, y)| Point3::new(x, y, 1.0))
    }

    #[test]
    fn covers_a_surface_and_its_margin_but_no_strip_beside_it() {
        let points = grid(0.0, 60, 60).chain(grid(1.0, 5, 60));
        let footprint = Footprint::new(&Vector3::z_axis(), points).unwrap();
        let covers = |x: f64, y: f64, margin: f64| footprint.covers(&Point3::new(x, y, 0.7), margin);
        assert!((footprint.area() - 0.59 * 0.59).abs() < 1e-9);
        assert!(covers(0.3, 0.3, 0.0) && covers(0.01, 0.58, 0.0));
        assert!(!covers(1.02, 0.1, 0.0) && !covers(0.62, 0.3, 0.0) && !covers(0.3, -0.02, 0.0));
        assert!(covers(0.62, 0.3, 0.04) && covers(0.3, -0.02, 0.03));
    }

    #[test]
    fn a_surface_in_two_pieces_is_one() {
        let points = grid(0.0, 60, 60).chain(grid(0.8, 20, 20));
        let footprint = Footprint::new(&Vector3::z_axis(), points).unwrap();
        let covers = |x: f64, y: f64| footprint.covers(&Point3::new(x, y, 0.7), 0.0);
        assert!(covers(0.9, 0.1) && covers(0.7, 0.1) && !covers(0.9, 0.5));
    }

    #[test]
    fn a_row_of_points_has_no_outline() {
        assert!(Footprint::new(&Vector3::z_axis(), grid(0.0, 1, 1)).is_none());
    }
}
