//! Writes the Fetch's shells as OBJ files, in link frames, metres: `cargo run --release --example fetch_meshes`.
//!
//! Every shell is a loft: rounded rectangles (superellipses) at stations along an axis, joined and capped. What is a
//! plain box, cylinder or sphere is in the URDF itself. The shapes are our own, made after the robot's published
//! dimensions; no mesh of the maker is used.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::Path;

/// Points around a section.
const AROUND: usize = 32;
/// Facets that meet at less than this angle are shaded smoothly, degrees.
const CREASE: f64 = 40.0;

/// A section across the axis: where, centre, half sizes, and exponent (2 an ellipse, large a rectangle).
struct Section {
    at: f64,
    center: [f64; 2],
    half: [f64; 2],
    exponent: f64,
}

fn section(at: f64, center: [f64; 2], half: [f64; 2], exponent: f64) -> Section {
    Section { at, center, half, exponent }
}

/// Points of a section between two angles (turns), `count` intervals.
fn outline(section: &Section, turns: [f64; 2], count: usize) -> Vec<[f64; 2]> {
    (0..count)
        .map(|i| {
            let share = i as f64 / count as f64;
            let angle = TAU * (turns[0] + (turns[1] - turns[0]) * share);
            let round = |v: f64| v.signum() * v.abs().powf(2.0 / section.exponent);
            [
                section.center[0] + section.half[0] * round(angle.cos()),
                section.center[1] + section.half[1] * round(angle.sin()),
            ]
        })
        .collect()
}

/// A polygon mesh.
#[derive(Default)]
struct Mesh {
    points: Vec<[f64; 3]>,
    faces: Vec<Vec<usize>>,
}

/// A closed loft along x, y or z (0, 1, 2); the section's plane is spanned by the next two axes.
fn loft(axis: usize, sections: &[Section]) -> Mesh {
    let mut mesh = Mesh::default();
    for section in sections {
        for [u, v] in outline(section, [0.0, 1.0], AROUND) {
            mesh.points.push(place(axis, section.at, u, v));
        }
    }
    for row in 0..sections.len() - 1 {
        for i in 0..AROUND {
            let (a, b) = (row * AROUND + i, row * AROUND + (i + 1) % AROUND);
            mesh.faces.push(vec![a, b, b + AROUND, a + AROUND]);
        }
    }
    let last = (sections.len() - 1) * AROUND;
    mesh.faces.push((0..AROUND).rev().collect());
    mesh.faces.push((last..last + AROUND).collect());
    mesh
}

/// A panel that lies on a loft along z, from `turns[0]` to `turns[1]` around it.
fn panel(sections: &[Section], turns: [f64; 2]) -> Mesh {
    let mut mesh = Mesh::default();
    for section in sections {
        for [x, y] in outline(section, turns, AROUND) {
            mesh.points.push([x, y, section.at]);
        }
    }
    for row in 0..sections.len() - 1 {
        for i in 0..AROUND - 1 {
            let a = row * AROUND + i;
            mesh.faces.push(vec![a, a + 1, a + 1 + AROUND, a + AROUND]);
        }
    }
    mesh
}

fn place(axis: usize, at: f64, u: f64, v: f64) -> [f64; 3] {
    let mut point = [0.0; 3];
    point[axis] = at;
    point[(axis + 1) % 3] = u;
    point[(axis + 2) % 3] = v;
    point
}

impl Mesh {
    /// Twice the area vector of a face (Newell's method).
    fn area(&self, face: &[usize]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for (i, &a) in face.iter().enumerate() {
            let (p, q) = (self.points[a], self.points[face[(i + 1) % face.len()]]);
            for (axis, total) in sum.iter_mut().enumerate() {
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                *total += (p[u] - q[u]) * (p[v] + q[v]);
            }
        }
        sum
    }

    /// As OBJ, with a normal a corner: the mean of the facets around it that meet at less than the crease angle.
    fn obj(&self) -> String {
        let areas: Vec<[f64; 3]> = self.faces.iter().map(|face| self.area(face)).collect();
        let mut around: Vec<Vec<usize>> = vec![Vec::new(); self.points.len()];
        for (index, face) in self.faces.iter().enumerate() {
            for &point in face {
                around[point].push(index);
            }
        }
        let smooth = CREASE.to_radians().cos();
        let mut text = String::from("# Made by the example fetch_meshes.\n");
        for [x, y, z] in &self.points {
            let _ = writeln!(text, "v {x:.4} {y:.4} {z:.4}");
        }
        let mut normals: BTreeMap<[i64; 3], usize> = BTreeMap::new();
        let mut normal_lines = String::new();
        let mut face_lines = String::new();
        for (index, face) in self.faces.iter().enumerate() {
            face_lines.push('f');
            for &point in face {
                let own = unit(areas[index]);
                let mut sum = [0.0; 3];
                for &other in &around[point] {
                    if dot(own, unit(areas[other])) > smooth {
                        for (total, part) in sum.iter_mut().zip(areas[other]) {
                            *total += part;
                        }
                    }
                }
                let key = unit(sum).map(|v| (v * 1e3).round() as i64);
                let next = normals.len() + 1;
                let number = *normals.entry(key).or_insert_with(|| {
                    let [x, y, z] = key.map(|v| v as f64 / 1e3);
                    let _ = writeln!(normal_lines, "vn {x} {y} {z}");
                    next
                });
                let _ = write!(face_lines, " {}//{number}", point + 1);
            }
            face_lines.push('\n');
        }
        text + &normal_lines + &face_lines
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn unit(v: [f64; 3]) -> [f64; 3] {
    let length = dot(v, v).sqrt().max(1e-12);
    v.map(|c| c / length)
}

/// From a flex joint at x = 0, whose child half is on the +y side, to a round seam at `end`.
fn flex_link(end: f64, radius: f64) -> Mesh {
    let half = 0.5 * 0.06;
    loft(
        0,
        &[
            section(-0.02, [half, 0.0], [half - 0.002, 0.045], 3.0),
            section(0.012, [half, 0.0], [half, 0.055], 3.0),
            section(0.035, [0.8 * half, 0.0], [0.036, 0.053], 3.0),
            section(0.5 * (0.045 + end), [0.0, 0.0], [0.93 * radius, 0.93 * radius], 2.2),
            section(end - 0.008, [0.0, 0.0], [radius, radius], 2.0),
            section(end, [0.0, 0.0], [radius - 0.003, radius - 0.003], 2.0),
        ],
    )
}

/// From a round seam at `start` to a flex joint at `end`, whose parent half is on the -y side.
fn roll_link(start: f64, end: f64, radius: f64) -> Mesh {
    let half = 0.5 * 0.06;
    loft(
        0,
        &[
            section(start, [0.0, 0.0], [radius - 0.003, radius - 0.003], 2.0),
            section(start + 0.008, [0.0, 0.0], [radius, radius], 2.0),
            section(start + 0.05, [0.0, 0.0], [radius, radius], 2.0),
            section(end - 0.055, [-0.3 * half, 0.0], [0.046, 0.054], 2.6),
            section(end - 0.03, [-half, 0.0], [half, 0.055], 3.0),
            section(end - 0.01, [-half, 0.0], [half, 0.055], 3.0),
            section(end + 0.02, [-half, 0.0], [half - 0.002, 0.045], 3.0),
        ],
    )
}

fn base_sections(grow: f64, heights: &[(f64, f64)]) -> Vec<Section> {
    heights
        .iter()
        .map(|&(z, inset)| {
            let half = [0.28 + grow - inset, 0.254 + grow - inset];
            section(z, [0.0, 0.0], half, 2.25)
        })
        .collect()
}

fn shells() -> Vec<(&'static str, Mesh)> {
    let drum = [
        (0.035, 0.030),
        (0.045, 0.012),
        (0.075, 0.0),
        (0.300, 0.0),
        (0.340, 0.008),
        (0.360, 0.026),
        (0.366, 0.050),
    ];
    let bellows: Vec<Section> = (0..=28)
        .map(|i| {
            let inset = if i % 2 == 0 { 0.0 } else { 0.012 };
            section(-0.02 + 0.44 * f64::from(i) / 28.0, [-0.075, 0.0], [0.092 - inset, 0.15 - inset], 8.0)
        })
        .collect();
    vec![
        ("base_shell", loft(2, &base_sections(0.0, &drum))),
        (
            "base_front",
            panel(&base_sections(0.003, &[(0.070, 0.0), (0.150, 0.0), (0.235, 0.0)]), [-0.16, 0.16]),
        ),
        ("base_slot", panel(&base_sections(0.002, &[(0.268, 0.0), (0.302, 0.0)]), [-0.31, 0.31])),
        (
            "torso_shell",
            loft(
                2,
                &[
                    section(0.004, [-0.075, 0.0], [0.108, 0.166], 8.0),
                    section(0.016, [-0.075, 0.0], [0.115, 0.174], 8.0),
                    section(0.300, [-0.075, 0.0], [0.115, 0.174], 8.0),
                    section(0.430, [-0.075, 0.0], [0.115, 0.160], 7.0),
                    section(0.500, [-0.062, 0.0], [0.110, 0.130], 5.0),
                    section(0.550, [-0.045, 0.0], [0.110, 0.100], 3.5),
                    section(0.578, [-0.032, 0.0], [0.104, 0.088], 3.0),
                    section(0.588, [-0.026, 0.0], [0.094, 0.078], 3.0),
                ],
            ),
        ),
        (
            "torso_chest",
            loft(
                2,
                &[
                    section(0.130, [0.020, 0.0], [0.050, 0.050], 3.0),
                    section(0.200, [0.056, 0.0], [0.112, 0.058], 3.0),
                    section(0.230, [0.060, 0.0], [0.119, 0.060], 2.8),
                    section(0.292, [0.060, 0.0], [0.119, 0.060], 2.8),
                    section(0.300, [0.060, 0.0], [0.114, 0.055], 2.8),
                ],
            ),
        ),
        ("torso_bellows", loft(2, &bellows)),
        (
            "shoulder_pan",
            loft(
                0,
                &[
                    section(-0.052, [0.0, 0.012], [0.022, 0.035], 2.6),
                    section(-0.035, [0.0, 0.015], [0.045, 0.048], 2.6),
                    section(0.010, [-0.004, 0.022], [0.056, 0.058], 2.6),
                    section(0.050, [-0.020, 0.045], [0.042, 0.060], 2.8),
                    section(0.085, [-0.030, 0.058], [0.030, 0.057], 3.0),
                    section(0.110, [-0.030, 0.060], [0.030, 0.056], 3.0),
                    section(0.137, [-0.030, 0.060], [0.028, 0.045], 3.0),
                ],
            ),
        ),
        ("shoulder_lift", flex_link(0.160, 0.053)),
        ("upperarm_roll", roll_link(-0.057, 0.133, 0.052)),
        ("elbow_flex", flex_link(0.150, 0.052)),
        ("forearm_roll", roll_link(-0.045, 0.1245, 0.052)),
        ("wrist_flex", flex_link(0.100, 0.050)),
        (
            "head_pan",
            loft(
                2,
                &[
                    section(0.002, [-0.010, 0.0], [0.092, 0.105], 2.6),
                    section(0.018, [-0.008, 0.0], [0.118, 0.132], 2.8),
                    section(0.070, [-0.008, 0.0], [0.120, 0.138], 2.8),
                    section(0.105, [-0.012, 0.0], [0.110, 0.130], 2.8),
                    section(0.118, [-0.014, 0.0], [0.088, 0.108], 2.6),
                ],
            ),
        ),
        (
            "head_tilt",
            loft(
                1,
                &[
                    section(-0.094, [0.0, 0.0], [0.030, 0.030], 2.4),
                    section(-0.086, [0.0, 0.004], [0.038, 0.036], 3.0),
                    section(0.000, [0.0, 0.004], [0.040, 0.040], 3.2),
                    section(0.086, [0.0, 0.004], [0.038, 0.036], 3.0),
                    section(0.094, [0.0, 0.0], [0.030, 0.030], 2.4),
                ],
            ),
        ),
        (
            "gripper_palm",
            loft(
                0,
                &[
                    section(-0.1525, [0.0, 0.0], [0.046, 0.030], 3.5),
                    section(-0.1430, [0.0, 0.0], [0.056, 0.035], 4.5),
                    section(-0.1200, [0.0, 0.0], [0.062, 0.0365], 6.0),
                    section(-0.0400, [0.0, 0.0], [0.062, 0.0365], 6.0),
                    section(-0.0320, [0.0, 0.0], [0.058, 0.033], 6.0),
                ],
            ),
        ),
    ]
}

fn main() -> std::io::Result<()> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../robots/fetch/meshes");
    for (name, mesh) in shells() {
        std::fs::write(folder.join(format!("{name}.obj")), mesh.obj())?;
    }
    Ok(())
}
