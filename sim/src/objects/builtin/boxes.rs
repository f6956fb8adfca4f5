//! Boxes: crackers, sugar, pudding, gelatin, the wood block and the foam brick.

use nalgebra::Vector3;

use super::BuiltIn;
use super::canvas::{BLACK, Canvas, Color, Turn, WHITE, Weight, mix};
use super::solids::{MeshBuilder, UvRect, cuboid};

/// Seams between the pictures of an atlas, pixels.
const GAP: f32 = 4.0;

/// A box with its look.
struct Design {
    /// Extents along x, y, z, millimetres: the YCB list's, in the axes of the scans.
    size: [f64; 3],
    /// Radius of the edges, millimetres.
    radius: f64,
    /// Texture resolution.
    pixels_per_mm: f32,
    /// What shows in gaps of the texture.
    ground: Color,
    /// Roughness of the surface.
    roughness: f32,
    /// Paints one face.
    paint: fn(Face, &mut Canvas),
}

/// The faces of a box, each with the canvas' right and up along the axes that [`MeshBuilder::rounded_box`] tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Face {
    Right,
    Left,
    Back,
    Front,
    Top,
    Bottom,
}

/// In the order of [`MeshBuilder::rounded_box`]: +x, -x, +y, -y, +z, -z.
const FACES: [Face; 6] = [Face::Right, Face::Left, Face::Back, Face::Front, Face::Top, Face::Bottom];

/// The model of a box by its YCB name.
pub(super) fn build(name: &str) -> Option<BuiltIn> {
    let design = match name {
        "003_cracker_box" => Design {
            size: [60.0, 158.0, 210.0],
            radius: 1.2,
            pixels_per_mm: 2.3,
            ground: RED,
            roughness: 0.5,
            paint: crackers,
        },
        "004_sugar_box" => Design {
            size: [38.0, 89.0, 175.0],
            radius: 1.2,
            pixels_per_mm: 3.2,
            ground: YELLOW,
            roughness: 0.55,
            paint: sugar,
        },
        "008_pudding_box" => Design {
            size: [110.0, 89.0, 35.0],
            radius: 1.0,
            pixels_per_mm: 2.5,
            ground: BROWN,
            roughness: 0.5,
            paint: pudding,
        },
        "009_gelatin_box" => Design {
            size: [73.0, 85.0, 28.0],
            radius: 1.0,
            pixels_per_mm: 3.2,
            ground: GELATIN,
            roughness: 0.5,
            paint: gelatin,
        },
        "036_wood_block" => Design {
            size: [90.0, 89.5, 205.5],
            radius: 1.5,
            pixels_per_mm: 2.0,
            ground: WOOD,
            roughness: 0.75,
            paint: wood,
        },
        "061_foam_brick" => Design {
            size: [52.0, 77.5, 51.0],
            radius: 2.0,
            pixels_per_mm: 3.2,
            ground: FOAM,
            roughness: 0.9,
            paint: foam,
        },
        _ => return None,
    };
    Some(design.build())
}

impl Design {
    fn build(&self) -> BuiltIn {
        let [x, y, z] = self.size.map(|s| s as f32 * self.pixels_per_mm);
        // The sides in one row, top and bottom below them.
        let sides = [y, y, x, x];
        let width = sides.iter().sum::<f32>() + 5.0 * GAP;
        let width = width.max(2.0 * x + 3.0 * GAP);
        let height = z + y + 3.0 * GAP;
        let mut atlas = Canvas::new(width.ceil() as u32, height.ceil() as u32, self.ground);
        let (mut left, mut top) = (GAP, GAP);
        let mut rects: [UvRect; 6] = [[0.0; 4]; 6];
        for ((k, face), rect) in FACES.into_iter().enumerate().zip(&mut rects) {
            let (face_width, face_height) = if k < 4 { (sides[k], z) } else { (x, y) };
            if k == 4 {
                (left, top) = (GAP, z + 2.0 * GAP);
            }
            let (left_px, top_px) = (left.round(), top.round());
            let mut picture = Canvas::new(face_width.round() as u32, face_height.round() as u32, self.ground);
            (self.paint)(face, &mut picture);
            let (w, h) = (picture.width(), picture.height());
            atlas.paste(left_px as u32, top_px as u32, &picture, Turn::None);
            *rect = [
                (left_px + 0.5) / atlas.width(),
                (top_px + 0.5) / atlas.height(),
                (left_px + w - 0.5) / atlas.width(),
                (top_px + h - 0.5) / atlas.height(),
            ]
            .map(f64::from);
            left += face_width + GAP;
        }
        let half = Vector3::from(self.size) * 0.5e-3;
        let mut mesh = MeshBuilder::new();
        mesh.rounded_box(half, self.radius * 1e-3, rects);
        BuiltIn::new(mesh.finish(), atlas.finish(), self.roughness, vec![cuboid([0.0; 3], half.into())])
    }
}

const RED: Color = [188, 24, 30];
const YELLOW: Color = [246, 205, 40];
const BROWN: Color = [78, 42, 28];
const GELATIN: Color = [196, 26, 52];
const WOOD: Color = [196, 150, 98];
const FOAM: Color = [168, 52, 42];
const BLUE: Color = [30, 62, 140];
const CREAM: Color = [250, 238, 208];

/// A square cracker with toothed edges and holes, turned by `angle`.
fn cracker(canvas: &mut Canvas, [cx, cy]: [f32; 2], half: f32, angle: f32, shade: f32) {
    let (sin, cos) = angle.sin_cos();
    let place = |x: f32, y: f32| [cx + cos * x - sin * y, cy + sin * x + cos * y];
    let outline = |scale: f32, [dx, dy]: [f32; 2]| -> Vec<[f32; 2]> {
        let teeth = 14;
        let mut points = Vec::new();
        for side in 0..4 {
            for k in 0..teeth {
                let along = -1.0 + 2.0 * k as f32 / teeth as f32;
                let out = if k % 2 == 0 { 1.0 } else { 0.93 };
                let (x, y) = match side {
                    0 => (along, -out),
                    1 => (out, along),
                    2 => (-along, out),
                    _ => (-out, -along),
                };
                let [px, py] = place(half * scale * x, half * scale * y);
                points.push([px + dx, py + dy]);
            }
        }
        points
    };
    let dough = mix([216, 126, 34], [242, 172, 66], shade);
    canvas.polygon(&outline(1.02, [0.05 * half, 0.12 * half]), [96, 12, 16]);
    canvas.polygon(&outline(1.0, [0.0, 0.0]), mix(dough, [140, 66, 12], 0.55));
    canvas.polygon(&outline(0.93, [0.0, -0.02 * half]), dough);
    canvas.polygon(&outline(0.7, [0.0, -0.05 * half]), mix(dough, [255, 214, 120], 0.35));
    for (x, y) in [(-0.45, -0.45), (0.45, -0.45), (0.0, 0.0), (-0.45, 0.45), (0.45, 0.45)] {
        let [px, py] = place(half * x, half * y);
        canvas.circle(px, py, 0.09 * half, [150, 78, 18]);
    }
}

fn crackers(face: Face, c: &mut Canvas) {
    let (w, h) = (c.width(), c.height());
    c.gradient(0.0, 0.0, w, h, [206, 30, 34], [164, 14, 22]);
    match face {
        Face::Right | Face::Left => {
            c.rect(0.0, 0.0, w, 0.055 * h, YELLOW);
            c.text_fitted([0.5 * w, 0.028 * h], [0.7 * w, 0.05 * h], "OVEN BAKED SINCE 1921", RED);
            c.ellipse(0.5 * w, 0.24 * h, 0.46 * w, 0.14 * h, [120, 8, 14]);
            c.ellipse(0.5 * w, 0.232 * h, 0.46 * w, 0.14 * h, WHITE);
            c.ellipse(0.5 * w, 0.232 * h, 0.435 * w, 0.125 * h, YELLOW);
            c.text_fitted(
                [0.5 * w + 3.0, 0.232 * h + 3.0],
                [0.8 * w, 0.17 * h],
                "CRACKERS",
                mix(RED, BLACK, 0.6),
            );
            c.text_fitted([0.5 * w, 0.232 * h], [0.8 * w, 0.17 * h], "CRACKERS", RED);
            c.text_fitted([0.5 * w, 0.41 * h], [0.72 * w, 0.055 * h], "Baked Cheese Snacks", WHITE);
            if face == Face::Right {
                for (k, (x, y, angle)) in [
                    (0.22, 0.60, 0.3),
                    (0.52, 0.56, -0.25),
                    (0.80, 0.62, 0.6),
                    (0.18, 0.78, -0.5),
                    (0.82, 0.80, 0.1),
                    (0.36, 0.72, 0.15),
                    (0.64, 0.75, -0.4),
                    (0.48, 0.85, 0.5),
                ]
                .into_iter()
                .enumerate()
                {
                    cracker(c, [x * w, y * h], 0.135 * w, angle, k as f32 / 7.0);
                }
            } else {
                c.rounded_rect(0.07 * w, 0.47 * h, 0.93 * w, 0.88 * h, 10.0, CREAM);
                c.text_fitted([0.5 * w, 0.51 * h], [0.7 * w, 0.05 * h], "PARTY MIX", RED);
                c.small_print([0.12 * w, 0.55 * h, 0.55 * w, 0.85 * h], 7.0, [110, 80, 60], 5);
                cracker(c, [0.74 * w, 0.63 * h], 0.12 * w, 0.3, 0.4);
                cracker(c, [0.76 * w, 0.78 * h], 0.12 * w, -0.4, 0.9);
            }
            c.rect(0.0, 0.945 * h, w, h, mix(RED, BLACK, 0.5));
            c.text(0.04 * w, 0.953 * h, 0.036 * h, "NET WT 16 OZ (453g)", WHITE, Weight::Bold);
        }
        Face::Front | Face::Back => {
            c.text_turned(0.5 * w, 0.2 * h, 0.42 * w, "CRACKERS", YELLOW, Weight::Bold, Turn::Counter);
            if face == Face::Front {
                c.nutrition_facts([0.08 * w, 0.4 * h, 0.92 * w, 0.78 * h]);
                c.small_print([0.08 * w, 0.8 * h, 0.92 * w, 0.97 * h], 6.0, CREAM, 3);
            } else {
                cracker(c, [0.5 * w, 0.5 * h], 0.33 * w, 0.2, 0.6);
                c.small_print([0.1 * w, 0.64 * h, 0.9 * w, 0.8 * h], 6.0, CREAM, 4);
                c.barcode(0.12 * w, 0.83 * h, 0.76 * w, 0.14 * h, 11);
            }
        }
        Face::Top | Face::Bottom => {
            c.rect(0.06 * w, 0.04 * h, 0.94 * w, 0.96 * h, mix(RED, BLACK, 0.12));
            c.text_turned(0.4 * w, 0.5 * h, 0.36 * w, "CRACKERS", YELLOW, Weight::Bold, Turn::Clockwise);
            let words = if face == Face::Top { "LIFT TO OPEN" } else { "BEST BY 11 MAR" };
            c.text_turned(0.76 * w, 0.5 * h, 0.16 * w, words, WHITE, Weight::Regular, Turn::Clockwise);
        }
    }
    c.noise(2.0, 1);
}

fn sugar(face: Face, c: &mut Canvas) {
    let (w, h) = (c.width(), c.height());
    match face {
        Face::Right | Face::Left => {
            c.rect(0.0, 0.0, w, h, YELLOW);
            // A white wave across the lower half.
            c.ellipse(0.2 * w, 0.86 * h, 0.95 * w, 0.34 * h, WHITE);
            c.rect(0.0, 0.9 * h, w, h, BLUE);
            c.rounded_rect(0.06 * w, 0.05 * h, 0.94 * w, 0.35 * h, 14.0, BLUE);
            c.rounded_rect(0.08 * w, 0.06 * h, 0.92 * w, 0.34 * h, 12.0, WHITE);
            c.text_fitted([0.5 * w, 0.11 * h], [0.6 * w, 0.06 * h], "PURE CANE", [196, 30, 36]);
            c.text_fitted([0.5 * w, 0.22 * h], [0.8 * w, 0.19 * h], "SUGAR", BLUE);
            c.text_fitted([0.5 * w, 0.315 * h], [0.6 * w, 0.036 * h], "Granulated", BLUE);
            if face == Face::Right {
                // A bowl heaped with sugar, and a spoon.
                c.stripe([0.5 * w, 0.6 * h], [0.88 * w, 0.44 * h], 9.0, [150, 152, 158]);
                c.ellipse(0.48 * w, 0.63 * h, 0.27 * w, 0.09 * h, [232, 232, 236]);
                c.ellipse(0.44 * w, 0.61 * h, 0.2 * w, 0.06 * h, [252, 252, 252]);
                let bowl: Vec<[f32; 2]> = (0..=24)
                    .map(|k| {
                        let (sin, cos) = (std::f32::consts::PI * k as f32 / 24.0).sin_cos();
                        [0.48 * w + 0.32 * w * cos, 0.64 * h + 0.15 * h * sin]
                    })
                    .collect();
                c.polygon(&bowl, BLUE);
                c.rect(0.16 * w, 0.635 * h, 0.8 * w, 0.65 * h, mix(BLUE, WHITE, 0.35));
                c.rect(0.34 * w, 0.785 * h, 0.62 * w, 0.8 * h, mix(BLUE, BLACK, 0.3));
            } else {
                c.text_fitted([0.5 * w, 0.42 * h], [0.8 * w, 0.04 * h], "LEMON ICE TEA", BLUE);
                c.small_print([0.1 * w, 0.46 * h, 0.9 * w, 0.6 * h], 7.5, mix(YELLOW, BLACK, 0.6), 8);
                c.barcode(0.2 * w, 0.7 * h, 0.6 * w, 0.16 * h, 21);
            }
            c.text(0.06 * w, 0.92 * h, 0.05 * h, "NET WT 1 LB (454g)", WHITE, Weight::Bold);
        }
        Face::Front | Face::Back => {
            c.rect(0.0, 0.0, w, h, YELLOW);
            c.rect(0.0, 0.9 * h, w, h, BLUE);
            c.rect(0.0, 0.0, w, 0.045 * h, WHITE);
            c.text_turned(0.5 * w, 0.27 * h, 0.55 * w, "SUGAR", BLUE, Weight::Bold, Turn::Counter);
            if face == Face::Front {
                c.nutrition_facts([0.08 * w, 0.48 * h, 0.92 * w, 0.82 * h]);
            } else {
                c.small_print([0.1 * w, 0.5 * h, 0.9 * w, 0.86 * h], 7.5, mix(YELLOW, BLACK, 0.6), 9);
            }
        }
        Face::Top | Face::Bottom => {
            c.rect(0.0, 0.0, w, h, WHITE);
            c.rect(0.0, 0.0, 0.12 * w, h, YELLOW);
            c.rect(0.88 * w, 0.0, w, h, YELLOW);
            let words = if face == Face::Top { "PUSH TO OPEN" } else { "SUGAR 454g" };
            c.text_turned(0.5 * w, 0.5 * h, 0.22 * w, words, BLUE, Weight::Bold, Turn::Clockwise);
        }
    }
    c.noise(2.0, 2);
}

fn pudding(face: Face, c: &mut Canvas) {
    let (w, h) = (c.width(), c.height());
    c.gradient(0.0, 0.0, w, h, [92, 50, 32], [58, 30, 20]);
    match face {
        Face::Top => {
            // A bowl of pudding with cream.
            let (x, y) = (0.66 * w, 0.68 * h);
            c.ellipse(x, y + 0.07 * h, 0.32 * w, 0.25 * h, [30, 14, 10]);
            c.ellipse(x, y, 0.32 * w, 0.25 * h, WHITE);
            c.ellipse(x, y - 0.01 * h, 0.28 * w, 0.21 * h, [120, 66, 38]);
            c.ellipse(x - 0.03 * w, y - 0.03 * h, 0.2 * w, 0.13 * h, [140, 80, 48]);
            for (dx, dy, r) in
                [(0.0, 0.0, 0.12), (-0.03, -0.04, 0.09), (0.02, -0.07, 0.06), (0.0, -0.11, 0.03)]
            {
                c.ellipse(x + dx * w, y + dy * h + 0.012 * h, r * w, 0.75 * r * w, [206, 190, 164]);
                c.ellipse(x + dx * w, y + dy * h, r * w, 0.72 * r * w, [252, 246, 232]);
            }
            c.rect(0.0, 0.05 * h, w, 0.36 * h, CREAM);
            c.rect(0.0, 0.36 * h, w, 0.38 * h, [214, 60, 40]);
            c.text_fitted([0.5 * w, 0.12 * h], [0.7 * w, 0.13 * h], "CHOCOLATE", [150, 36, 24]);
            c.text_fitted([0.5 * w, 0.26 * h], [0.9 * w, 0.24 * h], "PUDDING", BROWN);
            c.text(0.05 * w, 0.45 * h, 0.085 * h, "INSTANT", YELLOW, Weight::Bold);
            c.text(0.05 * w, 0.54 * h, 0.07 * h, "& pie filling", CREAM, Weight::Regular);
            c.text(0.05 * w, 0.87 * h, 0.07 * h, "NET WT 3.9 OZ", WHITE, Weight::Regular);
        }
        Face::Bottom => {
            c.rounded_rect(0.04 * w, 0.06 * h, 0.5 * w, 0.94 * h, 8.0, CREAM);
            c.text_fitted([0.27 * w, 0.13 * h], [0.4 * w, 0.09 * h], "DIRECTIONS", BROWN);
            c.small_print([0.08 * w, 0.22 * h, 0.46 * w, 0.88 * h], 7.0, [120, 90, 70], 13);
            c.nutrition_facts([0.55 * w, 0.06 * h, 0.95 * w, 0.62 * h]);
            c.barcode(0.57 * w, 0.68 * h, 0.36 * w, 0.25 * h, 31);
        }
        _ => {
            c.rect(0.0, 0.2 * h, w, 0.8 * h, CREAM);
            c.text_fitted([0.5 * w, 0.5 * h], [0.9 * w, 0.5 * h], "CHOCOLATE PUDDING", BROWN);
        }
    }
    c.noise(2.0, 3);
}

/// A strawberry about `(x, y)`, `r` high and wide.
fn strawberry(c: &mut Canvas, x: f32, y: f32, r: f32) {
    let body: Vec<[f32; 2]> = (0..40)
        .map(|k| {
            let (sin, cos) = (std::f32::consts::TAU * k as f32 / 40.0).sin_cos();
            let narrow = 1.0 - 0.45 * (0.5 + 0.5 * sin);
            [x + r * narrow * cos * 1.05, y + r * sin]
        })
        .collect();
    c.polygon(&body, [222, 22, 38]);
    c.ellipse(x - 0.3 * r, y - 0.35 * r, 0.3 * r, 0.25 * r, [240, 80, 84]);
    for row in 0..4 {
        for k in 0..4 - row / 2 {
            let spread = 0.42 - 0.07 * row as f32;
            let sx = x + r * spread * (k as f32 - 0.5 * (3 - row / 2) as f32);
            c.ellipse(sx, y + r * (-0.45 + 0.35 * row as f32), 0.045 * r, 0.07 * r, [250, 220, 120]);
        }
    }
    for k in -2..=2_i32 {
        let a = k as f32 * 0.55;
        let tip = [x + 0.75 * r * a.sin(), y - 0.95 * r + 0.3 * r * a.abs()];
        c.polygon(
            &[[x - 0.16 * r, y - 0.95 * r], [x + 0.16 * r, y - 0.95 * r], [tip[0], tip[1] + 0.3 * r]],
            [48, 132, 52],
        );
    }
    c.stripe([x, y - 0.9 * r], [x + 0.12 * r, y - 1.2 * r], 0.1 * r, [60, 140, 60]);
}

fn gelatin(face: Face, c: &mut Canvas) {
    let (w, h) = (c.width(), c.height());
    c.gradient(0.0, 0.0, w, h, [212, 34, 60], [164, 14, 40]);
    match face {
        Face::Top => {
            c.rounded_rect(0.06 * w, 0.05 * h, 0.94 * w, 0.4 * h, 12.0, WHITE);
            c.text_fitted([0.5 * w, 0.15 * h], [0.8 * w, 0.13 * h], "STRAWBERRY", [212, 24, 50]);
            c.text_fitted([0.5 * w, 0.29 * h], [0.8 * w, 0.2 * h], "GELATIN", [150, 10, 36]);
            strawberry(c, 0.3 * w, 0.66 * h, 0.17 * w);
            strawberry(c, 0.68 * w, 0.62 * h, 0.15 * w);
            strawberry(c, 0.53 * w, 0.75 * h, 0.16 * w);
            c.rect(0.0, 0.9 * h, w, h, [120, 6, 28]);
            c.text_fitted([0.5 * w, 0.95 * h], [0.8 * w, 0.06 * h], "NET WT 3 OZ (85g)", WHITE);
        }
        Face::Bottom => {
            c.rounded_rect(0.05 * w, 0.05 * h, 0.95 * w, 0.52 * h, 8.0, WHITE);
            c.text_fitted([0.5 * w, 0.1 * h], [0.7 * w, 0.07 * h], "HOW TO MAKE", [180, 16, 44]);
            c.small_print([0.1 * w, 0.16 * h, 0.9 * w, 0.5 * h], 7.5, [120, 70, 80], 17);
            c.nutrition_facts([0.05 * w, 0.56 * h, 0.46 * w, 0.96 * h]);
            c.barcode(0.52 * w, 0.62 * h, 0.43 * w, 0.28 * h, 41);
        }
        _ => {
            c.rect(0.0, 0.78 * h, w, 0.84 * h, WHITE);
            c.text_fitted([0.5 * w, 0.42 * h], [0.9 * w, 0.45 * h], "STRAWBERRY GELATIN", WHITE);
        }
    }
    c.noise(2.0, 4);
}

fn wood(face: Face, c: &mut Canvas) {
    let (w, h) = (c.width(), c.height());
    let (dark, pale) = ([126, 82, 44], [224, 186, 134]);
    let seed = 100 + face as u32;
    if matches!(face, Face::Top | Face::Bottom) {
        // Year rings about a heart outside the block, and saw marks.
        let (x0, y0) = (0.3 * w, -0.45 * h);
        c.paint(
            [0.0, 0.0, w, h],
            |x, y| {
                let bend = 9.0 * super::canvas::value_noise(x / 40.0, y / 40.0, seed);
                let r = ((x - x0).hypot(y - y0) + bend) / 9.0;
                let late = (r - r.floor()).powi(3);
                0.15 + 0.65 * late
            },
            |_, _| dark,
        );
        c.grain([60.0, 2.0], dark, 0.25, seed);
    } else {
        c.grain([30.0, 300.0], pale, 0.5, seed);
        c.grain([5.0, 260.0], dark, 0.55, seed + 1);
        c.grain([1.6, 60.0], dark, 0.35, seed + 2);
        if face == Face::Front {
            let (x, y) = (0.62 * w, 0.3 * h);
            for (k, r) in [9.0, 7.0, 5.0, 3.0].into_iter().enumerate() {
                c.ellipse(x, y, r, 1.5 * r, mix(dark, [70, 40, 20], k as f32 / 3.0));
            }
        }
    }
    c.noise(5.0, seed);
}

fn foam(face: Face, c: &mut Canvas) {
    let (w, h) = (c.width(), c.height());
    let seed = 200 + face as u32;
    c.grain([26.0, 26.0], [196, 76, 60], 0.5, seed);
    c.grain([3.0, 3.0], [110, 24, 20], 0.45, seed + 1);
    if matches!(face, Face::Top | Face::Bottom) {
        for k in 0..3 {
            let (x, y, r) = (0.5 * w, (0.22 + 0.28 * k as f32) * h, 0.15 * w);
            c.circle(x, y, r + 1.5, [190, 80, 66]);
            c.circle(x, y, r, [72, 16, 14]);
            c.ellipse(x + 0.18 * r, y + 0.3 * r, 0.75 * r, 0.62 * r, [98, 24, 20]);
        }
    }
    c.noise(9.0, seed);
}
