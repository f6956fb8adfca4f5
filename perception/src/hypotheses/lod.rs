//! Levels of detail: a mesh simplified for rendering many hypotheses.

use meshopt::SimplifyOptions;
use nalgebra::{Point3, Vector3};

use grip_sim::lanes::{F8, LANES};

/// A simplified mesh, in blocks for the kernels.
#[derive(Debug, Clone)]
pub struct Lod {
    /// Blocks of vertex coordinates `[x, y, z]` in the object frame, padded by repeating the last vertex.
    pub(crate) blocks: Vec<[F8; 3]>,
    /// Vertex indices, counter-clockwise from outside, ordered so that neighbours in the list face alike.
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Their planes, blocks of normals and offsets `[x, y, z, d]`: a point `p` is before the front when `n . p > d`. In the
    /// last block, lanes without a triangle have no front.
    pub(crate) planes: Vec<[F8; 4]>,
}

impl Lod {
    /// Vertices in the object frame, metres.
    pub(crate) fn vertices(&self) -> Vec<Point3<f32>> {
        let count = self.triangles.iter().flatten().max().map_or(0, |last| *last as usize + 1);
        let vertex = |i: usize| Point3::from(self.blocks[i / LANES].map(|axis| axis.0[i % LANES]));
        (0..count).map(vertex).collect()
    }
}

/// Vertex positions and vertex indices of triangles.
pub(crate) type Indexed = (Vec<[f32; 3]>, Vec<[u32; 3]>);

/// Merges vertices of equal position (texture seams split them) and drops degenerate triangles; `None` for an index
/// out of range.
pub(crate) fn weld(positions: &[Point3<f32>], triangles: &[[u32; 3]]) -> Option<Indexed> {
    // Adding zero makes -0.0 and 0.0 the same bits.
    let key = |i: usize| positions[i].coords.map(|x| (x + 0.0).to_bits());
    let mut order: Vec<usize> = (0..positions.len()).collect();
    order.sort_by_key(|&i| (key(i).x, key(i).y, key(i).z, i));
    let mut merged = vec![0u32; positions.len()];
    let mut out: Vec<[f32; 3]> = Vec::new();
    for (n, &i) in order.iter().enumerate() {
        if n == 0 || key(order[n - 1]) != key(i) {
            out.push(positions[i].coords.into());
        }
        merged[i] = out.len() as u32 - 1;
    }
    let mut kept = Vec::with_capacity(triangles.len());
    for t in triangles {
        let mut m = [0; 3];
        for (a, &i) in m.iter_mut().zip(t) {
            *a = *merged.get(i as usize)?;
        }
        if m[0] != m[1] && m[1] != m[2] && m[2] != m[0] {
            kept.push(m);
        }
    }
    Some((out, kept))
}

/// A deviation that no sensor of ours sees, metres: simplification that does not exceed it is free.
const UNSEEN_M: f32 = 2.5e-4;

/// Levels of detail of a mesh, one for each of `counts`: at most about so many triangles, and fewer where these deviate from
/// the mesh by no more than [`UNSEEN_M`]: a box needs few.
pub(crate) fn simplify(positions: &[[f32; 3]], triangles: &[[u32; 3]], counts: &[usize]) -> Vec<Lod> {
    let (positions, triangles) = collapsed(positions, triangles, 4, UNSEEN_M);
    let lod = |&count: &usize| {
        let (positions, triangles) = collapsed(&positions, &triangles, count, f32::MAX);
        packed(&positions, triangles)
    };
    counts.iter().map(lod).collect()
}

/// The mesh as it is.
#[cfg(test)]
pub(crate) fn unsimplified(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Lod {
    packed(positions, triangles.to_vec())
}

/// Collapses edges until `count` triangles are left or the next collapse would move the surface farther than `error_m`.
/// meshopt moves vertices as it collapses edges, which halves the error of keeping them in place.
fn collapsed(positions: &[[f32; 3]], triangles: &[[u32; 3]], count: usize, error_m: f32) -> Indexed {
    let mut positions = positions.to_vec();
    let mut indices: Vec<u32> = triangles.as_flattened().to_vec();
    // The library aborts on a target above the number of indices.
    let target = (3 * count).min(indices.len());
    let kept = meshopt::simplify_with_update(
        &mut indices,
        &mut positions,
        &mut [],
        &[],
        0,
        None,
        target,
        error_m,
        SimplifyOptions::ErrorAbsolute,
        None,
    );
    // A mesh of tiny parts may collapse to nothing: keep it whole then.
    if kept >= 3 {
        indices.truncate(kept);
    }
    (positions, indices.as_chunks::<3>().0.to_vec())
}

/// The mesh in the order and layout of the kernels.
fn packed(positions: &[[f32; 3]], mut faces: Vec<[u32; 3]>) -> Lod {
    if signed_volume(positions, &faces) < 0.0 {
        for f in &mut faces {
            f.swap(1, 2);
        }
    }
    sort_by_normal(positions, &mut faces, 0);
    // Vertices in the order of first use.
    let mut new = vec![u32::MAX; positions.len()];
    let mut used: Vec<[f32; 3]> = Vec::new();
    for i in faces.iter_mut().flatten() {
        let slot = &mut new[*i as usize];
        if *slot == u32::MAX {
            *slot = used.len() as u32;
            used.push(positions[*i as usize]);
        }
        *i = *slot;
    }
    let block = |vertices: &[[f32; 3]]| {
        [0, 1, 2].map(|axis| {
            let mut out = F8::ZERO;
            for (i, value) in out.0.iter_mut().enumerate() {
                *value = vertices[i.min(vertices.len() - 1)][axis];
            }
            out
        })
    };
    let plane = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|i| Vector3::from(used[i as usize]));
        let n = (b - a).cross(&(c - a));
        // What is seen edge on stays for the test on the screen.
        [n.x, n.y, n.z, n.dot(&a) - 1e-5 * n.norm()]
    };
    let planes = |faces: &[[u32; 3]]| {
        let mut out = [F8::ZERO; 4];
        for (i, values) in faces.iter().map(plane).enumerate() {
            for (axis, value) in out.iter_mut().zip(values) {
                axis.0[i] = value;
            }
        }
        out
    };
    Lod {
        blocks: used.chunks(LANES).map(block).collect(),
        planes: faces.chunks(LANES).map(planes).collect(),
        triangles: faces,
    }
}

fn signed_volume(positions: &[[f32; 3]], faces: &[[u32; 3]]) -> f32 {
    faces
        .iter()
        .map(|f| {
            let [a, b, c] = f.map(|i| Vector3::from(positions[i as usize]));
            a.dot(&b.cross(&c))
        })
        .sum()
}

/// Splits at the median along the axis in which normals vary most, down to groups of 16: whole groups then face away.
fn sort_by_normal(positions: &[[f32; 3]], faces: &mut [[u32; 3]], depth: usize) {
    if faces.len() <= 16 || depth > 16 {
        return;
    }
    let normal = |f: &[u32; 3]| {
        let [a, b, c] = f.map(|i| Vector3::from(positions[i as usize]));
        (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_else(Vector3::zeros)
    };
    let n = faces.len() as f32;
    let mean = faces.iter().fold(Vector3::zeros(), |s, f| s + normal(f)) / n;
    let variance = faces.iter().fold(Vector3::zeros(), |s: Vector3<f32>, f| {
        let d = normal(f) - mean;
        s + d.component_mul(&d)
    });
    let axis = variance.imax();
    faces.sort_by(|a, b| normal(a)[axis].total_cmp(&normal(b)[axis]));
    let (left, right) = faces.split_at_mut(faces.len() / 2);
    sort_by_normal(positions, left, depth + 1);
    sort_by_normal(positions, right, depth + 1);
}
