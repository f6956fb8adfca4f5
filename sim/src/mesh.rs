//! Triangle meshes with a material: what a renderer draws and what a pose hypothesis is made of.

use std::collections::HashMap;
use std::sync::Arc;

use image::RgbImage;
use nalgebra::{Point3, Vector3};
use parry3d::math::Vector;
use parry3d::transformation::try_convex_hull;
use rand::{Rng, RngExt};

/// An indexed triangle mesh, metres, counter-clockwise seen from outside.
#[derive(Debug, Clone, Default)]
pub struct Mesh {
    /// Vertex positions, metres.
    pub positions: Vec<Point3<f32>>,
    /// A unit normal a vertex. Same length as `positions`.
    pub normals: Vec<Vector3<f32>>,
    /// Texture coordinates a vertex, (0, 0) at the texture's top left. Same length as `positions`, or empty.
    pub uvs: Vec<[f32; 2]>,
    /// sRGB colour a vertex. Same length as `positions`, or empty.
    pub colors: Vec<[u8; 3]>,
    /// Roughness and metallic a vertex, in 255ths, in place of the material's. Same length as `positions`, or empty.
    pub finish: Vec<[u8; 2]>,
    /// Vertex indices of each triangle.
    pub triangles: Vec<[u32; 3]>,
}

/// How a surface takes light. The surface colour is `base_color` times vertex colour times texture, those that exist.
#[derive(Debug, Clone)]
pub struct Material {
    /// sRGB, 0 to 1.
    pub base_color: [f32; 3],
    /// 0 is a mirror, 1 chalk (GGX roughness).
    pub roughness: f32,
    /// 0 for dielectrics, 1 for metal.
    pub metallic: f32,
    /// sRGB texture.
    pub texture: Option<Arc<RgbImage>>,
}

impl Default for Material {
    fn default() -> Self {
        Self { base_color: [0.8, 0.8, 0.8], roughness: 0.7, metallic: 0.0, texture: None }
    }
}

/// A mesh and its material.
#[derive(Debug, Clone)]
pub struct Visual {
    /// Geometry.
    pub mesh: Arc<Mesh>,
    /// Appearance.
    pub material: Material,
}

/// Vertices closer than this are one point of the surface, metres.
const WELD_DISTANCE: f32 = 1e-6;
/// Coordinates beyond this are a slip of units, metres.
const FAR: f32 = 1e3;

impl Mesh {
    /// Corners of the axis-aligned bounding box of all vertices, metres; `None` for a mesh without vertices.
    pub fn bounds(&self) -> Option<(Point3<f64>, Point3<f64>)> {
        let first = self.positions.first()?;
        let (low, high) =
            self.positions.iter().fold((*first, *first), |(low, high), p| (low.inf(p), high.sup(p)));
        Some((low.cast(), high.cast()))
    }

    /// The same mesh with the centre of its bounding box at the origin.
    pub fn centered(mut self) -> Self {
        if let Some((low, high)) = self.bounds() {
            let center = nalgebra::center(&low, &high).coords;
            for p in &mut self.positions {
                *p = Point3::from((p.coords.cast::<f64>() - center).cast::<f32>());
            }
        }
        self
    }

    /// Enclosed volume, cubic metres; negative if the triangles face inwards. Means something for closed meshes only.
    pub fn volume(&self) -> f64 {
        let sixths: f64 = (0..self.triangles.len())
            .map(|t| {
                let [a, b, c] = self.corners(t);
                a.coords.dot(&b.coords.cross(&c.coords))
            })
            .sum();
        sixths / 6.0
    }

    /// Largest distance between two vertices, metres; 0 without vertices.
    pub fn diameter(&self) -> f64 {
        let points: Vec<_> = self.positions.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
        // The farthest two are corners of the hull. A flat mesh has none: then every pair is tried.
        let corners = match try_convex_hull(&points) {
            Ok((hull, _)) => hull,
            Err(_) => points,
        };
        let mut squared: f32 = 0.0;
        for (i, a) in corners.iter().enumerate() {
            for b in &corners[..i] {
                squared = squared.max((*a - *b).length_squared());
            }
        }
        f64::from(squared).sqrt()
    }

    /// Corners of triangle `index`, metres.
    ///
    /// # Panics
    /// If there is no such triangle, or it names a vertex that does not exist; see [`validate`](Self::validate).
    pub fn corners(&self, index: usize) -> [Point3<f64>; 3] {
        self.triangles[index].map(|i| self.positions[i as usize].cast())
    }

    /// Checks that there are triangles, that lengths and indices fit, and that all numbers are finite and within 1 km.
    ///
    /// # Errors
    /// What is wrong, in words; the caller adds the file.
    pub fn validate(&self) -> Result<(), String> {
        let count = self.positions.len();
        if self.triangles.is_empty() {
            return Err("holds no triangles".into());
        }
        for (what, length) in [
            ("normals", self.normals.len()),
            ("texture coordinates", self.uvs.len()),
            ("colours", self.colors.len()),
            ("finishes", self.finish.len()),
        ] {
            if length != count && (length != 0 || what == "normals") {
                return Err(format!("{length} {what} for {count} vertices"));
            }
        }
        for (index, triangle) in self.triangles.iter().enumerate() {
            if let Some(vertex) = triangle.iter().find(|&&i| i as usize >= count) {
                return Err(format!("triangle {index} names vertex {vertex}, but there are {count}"));
            }
        }
        for (index, p) in self.positions.iter().enumerate() {
            if !p.iter().all(|v| v.abs() < FAR) {
                return Err(format!(
                    "vertex {index} is ({}, {}, {}): not finite or farther than 1 km; check the file and its unit",
                    p.x, p.y, p.z
                ));
            }
        }
        if let Some(index) = self.normals.iter().position(|n| !(0.99..1.01).contains(&n.norm())) {
            return Err(format!("the normal of vertex {index} is not of unit length"));
        }
        match self.uvs.iter().position(|uv| !uv.iter().all(|v| v.abs() < FAR)) {
            Some(index) => Err(format!("the texture coordinates of vertex {index} are not finite")),
            None => Ok(()),
        }
    }

    /// Whether the surface has no rim and is oriented throughout: along every edge, as many triangles run one way as the
    /// other. Vertices less than a micrometre apart count as one.
    pub fn is_closed(&self) -> bool {
        let welded = self.welded();
        let mut balance: HashMap<(u32, u32), i32> = HashMap::new();
        for t in &self.triangles {
            for (i, j) in [(0, 1), (1, 2), (2, 0)] {
                let (a, b) = (welded[t[i] as usize], welded[t[j] as usize]);
                match a.cmp(&b) {
                    std::cmp::Ordering::Less => *balance.entry((a, b)).or_default() += 1,
                    std::cmp::Ordering::Greater => *balance.entry((b, a)).or_default() -= 1,
                    std::cmp::Ordering::Equal => {}
                }
            }
        }
        !self.triangles.is_empty() && balance.values().all(|&count| count == 0)
    }

    /// For each vertex the first one at the same place.
    fn welded(&self) -> Vec<u32> {
        type Cell = [i64; 3];
        let cell = |p: &Point3<f32>| -> Cell { [0, 1, 2].map(|i| (p[i] / WELD_DISTANCE).floor() as i64) };
        let mut seen: HashMap<Cell, Vec<u32>> = HashMap::new();
        let mut welded: Vec<u32> = Vec::with_capacity(self.positions.len());
        for (index, p) in self.positions.iter().enumerate() {
            let [x, y, z] = cell(p);
            let near = (-1..=1)
                .flat_map(|dx| (-1..=1).flat_map(move |dy| (-1..=1).map(move |dz| [x + dx, y + dy, z + dz])))
                .filter_map(|cell| seen.get(&cell))
                .flatten()
                .copied()
                .filter(|&other| (self.positions[other as usize] - p).norm() < WELD_DISTANCE)
                .min();
            let first = near.unwrap_or(index as u32);
            if near.is_none() {
                seen.entry([x, y, z]).or_default().push(first);
            }
            welded.push(first);
        }
        welded
    }

    /// The same mesh with normals from its triangles: smooth across edges where facets turn by less than `crease`
    /// (radians), sharp elsewhere. Vertices on sharp edges are doubled.
    pub fn compute_normals(&self, crease: f64) -> Self {
        let welded = self.welded();
        let facets: Vec<Vector3<f64>> = (0..self.triangles.len())
            .map(|t| {
                let [a, b, c] = self.corners(t);
                (b - a).cross(&(c - a))
            })
            .collect();
        let mut around: Vec<Vec<u32>> = vec![Vec::new(); self.positions.len()];
        for (index, t) in self.triangles.iter().enumerate() {
            for &i in t {
                around[welded[i as usize] as usize].push(index as u32);
            }
        }
        let mut mesh = Self::default();
        // The new vertices that each old one became, with their normals.
        let mut copies: Vec<Vec<u32>> = vec![Vec::new(); self.positions.len()];
        for (index, t) in self.triangles.iter().enumerate() {
            // A facet without area has no direction of its own and takes that of its neighbours.
            let own = facets[index].try_normalize(0.0);
            let triangle = t.map(|vertex| {
                let old = vertex as usize;
                let sum: Vector3<f64> = around[welded[old] as usize]
                    .iter()
                    .map(|&other| facets[other as usize])
                    .filter(|facet| own.is_none_or(|own| facet.norm() > 0.0 && facet.angle(&own) <= crease))
                    .sum();
                let normal = sum.try_normalize(0.0).or(own).unwrap_or_else(Vector3::z);
                let normal: Vector3<f32> = normal.cast();
                let same =
                    copies[old].iter().find(|&&copy| (mesh.normals[copy as usize] - normal).norm() < 1e-4);
                if let Some(&copy) = same {
                    return copy;
                }
                let copy = mesh.positions.len() as u32;
                mesh.positions.push(self.positions[old]);
                mesh.normals.push(normal);
                mesh.uvs.extend(self.uvs.get(old));
                mesh.colors.extend(self.colors.get(old));
                mesh.finish.extend(self.finish.get(old));
                copies[old].push(copy);
                copy
            });
            mesh.triangles.push(triangle);
        }
        mesh
    }

    /// The same surface without looks or normals, one vertex a place, with as few triangles as keep it within `error`
    /// (metres).
    pub fn simplified(&self, error: f64) -> Self {
        let welded = self.welded();
        let all: Vec<u32> = self.triangles.as_flattened().iter().map(|&i| welded[i as usize]).collect();
        let places: Vec<[f32; 3]> = self.positions.iter().map(|p| p.coords.into()).collect();
        let options = meshopt::SimplifyOptions::ErrorAbsolute;
        let mut few = meshopt::simplify_decoder(&all, &places, 0, error as f32, options, None);
        let mut positions = Vec::new();
        let mut kept = vec![None; self.positions.len()];
        for corner in &mut few {
            let old = *corner as usize;
            *corner = *kept[old].get_or_insert_with(|| {
                positions.push(self.positions[old]);
                positions.len() as u32 - 1
            });
        }
        Self { positions, triangles: few.as_chunks::<3>().0.to_vec(), ..Self::default() }
    }

    /// The same surface without looks, one vertex a place, that covers it about evenly, whatever the triangles were: first
    /// with as few triangles as keep it within a thirtieth of `longest` (metres), then with edges halved until none is
    /// longer than that. Normals are smooth.
    pub fn refined(&self, longest: f64) -> Self {
        let Self { mut positions, mut triangles, .. } = self.simplified(longest / 30.0);
        loop {
            // Both triangles of an edge see the same halves, so that the surface stays closed.
            let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
            let mut middle = |a: u32, b: u32| {
                let (p, q) = (positions[a as usize], positions[b as usize]);
                (f64::from(nalgebra::distance(&p, &q)) > longest).then(|| {
                    *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                        positions.push(nalgebra::center(&p, &q));
                        positions.len() as u32 - 1
                    })
                })
            };
            let mut finer = Vec::with_capacity(triangles.len());
            for &[a, b, c] in &triangles {
                match [middle(a, b), middle(b, c), middle(c, a)] {
                    [None, None, None] => finer.push([a, b, c]),
                    [Some(ab), None, None] => finer.extend([[a, ab, c], [ab, b, c]]),
                    [None, Some(bc), None] => finer.extend([[b, bc, a], [bc, c, a]]),
                    [None, None, Some(ca)] => finer.extend([[c, ca, b], [ca, a, b]]),
                    [Some(ab), Some(bc), None] => finer.extend([[a, ab, c], [ab, bc, c], [ab, b, bc]]),
                    [None, Some(bc), Some(ca)] => finer.extend([[b, bc, a], [bc, ca, a], [bc, c, ca]]),
                    [Some(ab), None, Some(ca)] => finer.extend([[c, ca, b], [ca, ab, b], [ca, a, ab]]),
                    [Some(ab), Some(bc), Some(ca)] => {
                        finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
                    }
                }
            }
            let done = finer.len() == triangles.len();
            triangles = finer;
            if done {
                break;
            }
        }
        Self { positions, triangles, ..Self::default() }.compute_normals(std::f64::consts::PI)
    }

    /// `count` points spread uniformly over the surface by area, metres; stratified, so that they cover it evenly. None if
    /// the surface has no area.
    pub fn sample_surface(&self, count: usize, rng: &mut impl Rng) -> Vec<Point3<f64>> {
        self.sample_surface_indexed(count, rng).into_iter().map(|(point, _)| point).collect()
    }

    /// [`sample_surface`](Self::sample_surface), with the triangle that each point lies on.
    pub fn sample_surface_indexed(&self, count: usize, rng: &mut impl Rng) -> Vec<(Point3<f64>, usize)> {
        let mut total = 0.0;
        let up_to: Vec<f64> = (0..self.triangles.len())
            .map(|t| {
                let [a, b, c] = self.corners(t);
                total += (b - a).cross(&(c - a)).norm();
                total
            })
            .collect();
        if total <= 0.0 || !total.is_finite() {
            return Vec::new();
        }
        (0..count)
            .map(|k| {
                let at = (k as f64 + rng.random::<f64>()) / count as f64 * total;
                let triangle = up_to.partition_point(|&end| end <= at).min(up_to.len() - 1);
                let [a, b, c] = self.corners(triangle);
                let (mut s, mut t) = (rng.random::<f64>(), rng.random::<f64>());
                if s + t > 1.0 {
                    (s, t) = (1.0 - s, 1.0 - t);
                }
                (a + (b - a) * s + (c - a) * t, triangle)
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box of full size `size`, with the vertices of its corners shared.
    fn cuboid(size: [f32; 3]) -> Mesh {
        let positions: Vec<Point3<f32>> = (0..8)
            .map(|i| {
                let side = |bit: usize| if i >> bit & 1 == 1 { 0.5 } else { -0.5 };
                Point3::new(side(0) * size[0], side(1) * size[1], side(2) * size[2])
            })
            .collect();
        let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        Mesh { normals: vec![Vector3::z(); 8], positions, triangles, ..Mesh::default() }
    }

    #[test]
    fn a_box_has_its_closed_form_measures() {
        let mesh = cuboid([0.1, 0.2, 0.3]);
        assert!((mesh.volume() - 0.006).abs() < 1e-9);
        assert!((mesh.diameter() - 0.14f64.sqrt()).abs() < 1e-7);
        assert!(mesh.is_closed() && mesh.validate().is_ok());
        let mut moved = mesh.clone();
        for p in &mut moved.positions {
            *p += Vector3::new(1.0, 2.0, 3.0);
        }
        let (low, high) = moved.centered().bounds().unwrap();
        assert!((low + high.coords).coords.norm() < 1e-6 && (high.z - 0.15).abs() < 1e-6);
        assert!(Mesh::default().bounds().is_none() && Mesh::default().diameter() == 0.0);
    }

    #[test]
    fn a_refined_box_is_the_same_box_with_short_edges() {
        let mesh = cuboid([0.1, 0.2, 0.3]);
        let fine = mesh.refined(0.01);
        assert!(fine.is_closed() && fine.validate().is_ok());
        assert!((fine.volume() - 0.006).abs() < 1e-8 && (fine.diameter() - 0.14f64.sqrt()).abs() < 1e-7);
        let longest = (0..fine.triangles.len())
            .flat_map(|t| {
                let [a, b, c] = fine.corners(t);
                [(a - b).norm(), (b - c).norm(), (c - a).norm()]
            })
            .fold(0.0, f64::max);
        assert!(longest <= 0.01, "{longest}");
        // V - E + F = 2: one vertex a place, no cracks.
        assert_eq!(fine.positions.len(), 2 + fine.triangles.len() / 2);
    }

    #[test]
    fn a_hole_or_a_turned_triangle_is_not_closed() {
        let mut open = cuboid([1.0; 3]);
        let last = open.triangles.pop().unwrap();
        assert!(!open.is_closed());
        open.triangles.push([last[0], last[2], last[1]]);
        assert!(!open.is_closed());
        assert!(!Mesh::default().is_closed());
    }

    #[test]
    fn normals_keep_sharp_edges_and_smooth_over_shallow_ones() {
        let mesh = cuboid([1.0; 3]);
        let sharp = mesh.compute_normals(0.5);
        assert_eq!(sharp.positions.len(), 24);
        assert!(sharp.is_closed(), "doubled vertices are welded");
        assert!(sharp.validate().is_ok());
        for (t, triangle) in sharp.triangles.iter().enumerate() {
            let [a, b, c] = sharp.corners(t);
            let facet = (b - a).cross(&(c - a)).normalize();
            for &i in triangle {
                assert!((sharp.normals[i as usize].cast::<f64>() - facet).norm() < 1e-6);
            }
        }
        let smooth = mesh.compute_normals(3.0);
        assert_eq!(smooth.positions.len(), 8);
        assert!(smooth.positions.iter().zip(&smooth.normals).all(|(p, n)| p.coords.dot(n) > 0.7));
    }

    #[test]
    fn facets_without_area_get_unit_normals() {
        let mut mesh = cuboid([1.0; 3]);
        mesh.triangles.extend([[0, 0, 1], [3, 3, 3]]);
        assert!(mesh.compute_normals(0.5).validate().is_ok());
    }

    #[test]
    fn samples_lie_on_the_surface_and_share_it_by_area() {
        let mesh = cuboid([0.1, 0.2, 0.4]);
        let samples = mesh.sample_surface(1000, &mut crate::rng::stream(1, "test"));
        let on = |p: &Point3<f64>| {
            (p.x.abs() - 0.05).abs() < 1e-6
                || (p.y.abs() - 0.1).abs() < 1e-6
                || (p.z.abs() - 0.2).abs() < 1e-6
        };
        assert!(samples.iter().all(on));
        // Two faces of 0.1 x 0.2 out of an area of 0.28.
        let ends = samples.iter().filter(|p| (p.z.abs() - 0.2).abs() < 1e-6).count();
        assert!(ends.abs_diff(143) < 5, "{ends}");
    }

    #[test]
    fn validation_finds_what_is_wrong() {
        let broken = |change: fn(&mut Mesh)| {
            let mut mesh = cuboid([1.0; 3]);
            change(&mut mesh);
            mesh.validate().unwrap_err()
        };
        assert!(broken(|m| m.positions[3].y = f32::NAN).contains("vertex 3"));
        assert!(broken(|m| m.positions[3].y = 1e30).contains("vertex 3"));
        assert!(broken(|m| m.triangles[2][1] = 8).contains("triangle 2 names vertex 8"));
        assert!(broken(|m| m.normals[1] = Vector3::zeros()).contains("normal of vertex 1"));
        assert!(broken(|m| m.uvs = vec![[0.0; 2]; 3]).contains("3 texture coordinates"));
        assert!(broken(|m| m.triangles.clear()).contains("no triangles"));
    }
}
