//! Height maps on a square grid: the tops of what lies in a bin, and the lower and upper side of an object.

use grip_sim::mesh::Mesh;
use nalgebra::{Isometry3, Point3};

/// Heights over a grid of square cells; cell (i, j) covers `x0 + [i, i + 1) * cell` and likewise in y.
#[derive(Debug, Clone, PartialEq)]
pub struct HeightMap {
    /// Cells along x and y.
    pub size: [usize; 2],
    /// Coordinates of the corner of cell (0, 0), metres.
    pub origin: [f64; 2],
    /// Edge of a cell, metres.
    pub cell: f64,
    /// Row by row along x: index `i + j * size[0]`.
    pub heights: Vec<f64>,
}

impl HeightMap {
    /// A map of one height.
    pub fn flat(origin: [f64; 2], size: [usize; 2], cell: f64, height: f64) -> Self {
        Self { size, origin, cell, heights: vec![height; size[0] * size[1]] }
    }

    /// Calls `visit(index, z)` for each cell whose centre a triangle covers, and for the cells of the vertices.
    pub fn rasterize(
        &mut self,
        mesh: &Mesh,
        map_from_mesh: &Isometry3<f64>,
        mut visit: impl FnMut(&mut f64, f64, usize),
    ) {
        let points: Vec<Point3<f64>> =
            mesh.positions.iter().map(|p| map_from_mesh * p.cast::<f64>()).collect();
        let [nx, ny] = self.size;
        let (cell, origin) = (self.cell, self.origin);
        // Grid coordinates in which cell centres are whole numbers.
        let u = |p: &Point3<f64>| (p.x - origin[0]) / cell - 0.5;
        let v = |p: &Point3<f64>| (p.y - origin[1]) / cell - 0.5;
        for p in &points {
            let (i, j) = (u(p).round(), v(p).round());
            if i >= 0.0 && j >= 0.0 && (i as usize) < nx && (j as usize) < ny {
                let index = i as usize + j as usize * nx;
                visit(&mut self.heights[index], p.z, index);
            }
        }
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|i| points[i as usize]);
            let (ua, va, ub, vb, uc, vc) = (u(&a), v(&a), u(&b), v(&b), u(&c), v(&c));
            let area = (ub - ua) * (vc - va) - (uc - ua) * (vb - va);
            if area.abs() < 1e-9 {
                continue;
            }
            let range = |x: f64, y: f64, z: f64, n: usize| {
                let low = x.min(y).min(z).ceil().max(0.0);
                let high = x.max(y).max(z).floor().min(n as f64 - 1.0);
                (low as usize, if high < low { None } else { Some(high as usize) })
            };
            let (i0, Some(i1)) = range(ua, ub, uc, nx) else {
                continue;
            };
            let (j0, Some(j1)) = range(va, vb, vc, ny) else {
                continue;
            };
            for j in j0..=j1 {
                for i in i0..=i1 {
                    let (x, y) = (i as f64, j as f64);
                    let wb = ((x - ua) * (vc - va) - (uc - ua) * (y - va)) / area;
                    let wc = ((ub - ua) * (y - va) - (x - ua) * (vb - va)) / area;
                    let wa = 1.0 - wb - wc;
                    if wa >= -1e-9 && wb >= -1e-9 && wc >= -1e-9 {
                        let index = i + j * nx;
                        let z = wa * a.z + wb * b.z + wc * c.z;
                        visit(&mut self.heights[index], z, index);
                    }
                }
            }
        }
    }
}

/// The lower and upper side of a turned object over the cells that it covers, about its own origin.
#[derive(Debug, Clone)]
pub struct Profile {
    /// Covered cells: offsets in whole cells from the cell of the origin, lowest and highest z, metres.
    pub cells: Vec<([i32; 2], f64, f64)>,
    /// Lowest and highest z of all.
    pub span: [f64; 2],
}

impl Profile {
    /// The profile of `mesh` turned by `rotation` (a pose without translation), on cells of `cell` metres.
    pub fn new(mesh: &Mesh, rotation: &Isometry3<f64>, cell: f64) -> Self {
        let radius = mesh.positions.iter().map(|p| f64::from(p.coords.norm())).fold(0.0, f64::max);
        let half = (radius / cell).ceil() as i32 + 1;
        let n = (2 * half + 1) as usize;
        // The origin lies at the centre of the middle cell.
        let corner = -(f64::from(half) + 0.5) * cell;
        let mut low = HeightMap::flat([corner, corner], [n, n], cell, f64::INFINITY);
        let mut high = vec![f64::NEG_INFINITY; n * n];
        low.rasterize(mesh, rotation, |height, z, index| {
            *height = height.min(z);
            high[index] = high[index].max(z);
        });
        let cells: Vec<([i32; 2], f64, f64)> = (0..n * n)
            .filter(|&k| low.heights[k].is_finite())
            .map(|k| {
                let offset = [(k % n) as i32 - half, (k / n) as i32 - half];
                (offset, low.heights[k], high[k])
            })
            .collect();
        let span =
            cells.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |s, c| [s[0].min(c.1), s[1].max(c.2)]);
        Self { cells, span }
    }

    /// The same with `margin` more cells all round, which take the heights of their nearest covered neighbours.
    pub fn dilated(&self, margin: i32) -> Self {
        let mut grown: std::collections::BTreeMap<[i32; 2], (f64, f64)> = std::collections::BTreeMap::new();
        for (at, low, high) in &self.cells {
            for dx in -margin..=margin {
                for dy in -margin..=margin {
                    if dx * dx + dy * dy <= margin * margin {
                        let entry = grown
                            .entry([at[0] + dx, at[1] + dy])
                            .or_insert((f64::INFINITY, f64::NEG_INFINITY));
                        *entry = (entry.0.min(*low), entry.1.max(*high));
                    }
                }
            }
        }
        Self { cells: grown.into_iter().map(|(at, (l, h))| (at, l, h)).collect(), span: self.span }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{box_model, cylinder_model};

    #[test]
    fn a_box_covers_its_area_at_its_heights() {
        let model = box_model("box", [0.10, 0.06, 0.04]);
        let p = Profile::new(&model.visual.mesh, &Isometry3::identity(), 0.005);
        let area = p.cells.len() as f64 * 0.005 * 0.005;
        assert!((area - 0.006).abs() < 0.0009, "{area}");
        assert!(p.cells.iter().all(|c| (c.1 + 0.02).abs() < 1e-6 && (c.2 - 0.02).abs() < 1e-6));
        let wider = p.dilated(2);
        let reach = |p: &Profile| p.cells.iter().map(|c| c.0[0]).max().unwrap();
        assert_eq!(reach(&wider), reach(&p) + 2);
    }

    #[test]
    fn a_lying_can_is_round_below() {
        let model = cylinder_model("can", 0.03, 0.1);
        let lying = Isometry3::rotation(nalgebra::Vector3::y() * std::f64::consts::FRAC_PI_2);
        let p = Profile::new(&model.visual.mesh, &lying, 0.005);
        for (at, low, high) in &p.cells {
            let y = f64::from(at[1]) * 0.005;
            let h = (0.03f64.powi(2) - y * y).max(0.0).sqrt();
            // Heights are those of cell centres, but for vertices, which count for the whole of their cell.
            assert!(h < 0.02 || ((high + low).abs() < 2e-3 && (high - h).abs() < 2e-3), "{y} {high} {h}");
        }
    }
}
