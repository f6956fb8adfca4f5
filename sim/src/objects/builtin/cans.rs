//! Cans: coffee, soup, tuna and potted meat. Rims, lids that lie deeper than the rim, a paper label around.

use std::f64::consts::TAU;

use nalgebra::Point3;

use super::BuiltIn;
use super::canvas::{BLACK, Canvas, Color, METAL, Turn, WHITE, Weight, mix};
use super::solids::{MeshBuilder, UvMap, UvRect, circle, cylinder, hull, pole, rounded_rectangle};

/// Points round a can.
const SEGMENTS: usize = 64;
/// Roughness of the label: coated paper.
const PAPER: f64 = 0.45;
/// Roughness and metallic of ends and rims: brushed tinplate.
const BARE: [f64; 2] = [0.4, 1.0];
/// Points on each corner of the meat can.
const PER_CORNER: usize = 9;

/// The section of a can, seen from above, millimetres; its outer line is that of the rims.
#[derive(Debug, Clone, Copy)]
enum Section {
    Round { radius: f64 },
    Rounded { half: [f64; 2], radius: f64 },
}

impl Section {
    /// The outer line moved inwards by `inset`, at height `z`; metres out.
    fn ring(self, inset: f64, z: f64) -> Vec<Point3<f64>> {
        const MM: f64 = 1e-3;
        match self {
            Self::Round { radius } => circle((radius - inset) * MM, z * MM, SEGMENTS),
            Self::Rounded { half, radius } => {
                rounded_rectangle(half.map(|h| h * MM), radius * MM, -inset * MM, z * MM, PER_CORNER)
            }
        }
    }

    fn half(self) -> [f64; 2] {
        match self {
            Self::Round { radius } => [radius; 2],
            Self::Rounded { half, .. } => half,
        }
    }

    fn perimeter(self) -> f64 {
        match self {
            Self::Round { radius } => TAU * radius,
            Self::Rounded { half, radius } => 4.0 * (half[0] + half[1] - 2.0 * radius) + TAU * radius,
        }
    }
}

/// A can and its look.
struct Design {
    section: Section,
    /// Height over both rims, millimetres.
    height: f64,
    /// How high the rims are, millimetres.
    rim: f64,
    /// How far the label lies inside the rims' outer line, millimetres.
    step: f64,
    /// How deep the lids lie, millimetres.
    recess: f64,
    pixels_per_mm: f32,
    /// Paints what is wrapped around. Its fronts are a quarter and three quarters from the left (+y and -y).
    label: fn(&mut Canvas),
    /// Colour of the top.
    lid: Color,
}

/// The model of a can by its YCB name. Sizes are those of the scans.
pub(super) fn build(name: &str) -> Option<BuiltIn> {
    let design = match name {
        "002_master_chef_can" => Design {
            section: Section::Round { radius: 51.2 },
            height: 140.0,
            rim: 3.2,
            step: 0.9,
            recess: 4.0,
            pixels_per_mm: 3.1,
            label: coffee,
            lid: [186, 188, 190],
        },
        "005_tomato_soup_can" => Design {
            section: Section::Round { radius: 33.9 },
            height: 101.8,
            rim: 3.0,
            step: 0.9,
            recess: 4.0,
            pixels_per_mm: 4.2,
            label: soup,
            lid: METAL,
        },
        "007_tuna_fish_can" => Design {
            section: Section::Round { radius: 42.75 },
            height: 33.5,
            rim: 2.8,
            step: 1.0,
            recess: 3.0,
            pixels_per_mm: 3.7,
            label: tuna,
            lid: [190, 184, 164],
        },
        "010_potted_meat_can" => Design {
            section: Section::Rounded { half: [50.8, 29.4], radius: 18.0 },
            height: 83.5,
            rim: 3.0,
            step: 1.0,
            recess: 3.5,
            pixels_per_mm: 3.5,
            label: meat,
            lid: [182, 182, 180],
        },
        _ => return None,
    };
    Some(design.build())
}

impl Design {
    fn build(&self) -> BuiltIn {
        let px = f64::from(self.pixels_per_mm);
        let top = 0.5 * self.height;
        let [half_x, half_y] = self.section.half();
        // The atlas: label, a strip of metal for the rims, the two ends side by side.
        let round_up = |mm: f64| (mm * px).ceil() as u32;
        let label_size = [round_up(self.section.perimeter()), round_up(self.height - 2.0 * self.rim)];
        let end_size = [round_up(2.0 * half_x), round_up(2.0 * half_y)];
        let (strip, gap) = (16, 4);
        let width = label_size[0].max(2 * end_size[0] + gap);
        let ends_top = label_size[1] + strip + gap;
        let mut atlas = Canvas::new(width, ends_top + end_size[1], METAL);
        let mut label = Canvas::new(label_size[0], label_size[1], WHITE);
        (self.label)(&mut label);
        atlas.paste(0, 0, &label, Turn::None);
        atlas.paste(0, ends_top, &self.end(end_size, self.lid, true), Turn::None);
        atlas.paste(end_size[0] + gap, ends_top, &self.end(end_size, METAL, false), Turn::None);
        let rect = |x: u32, y: u32, [w, h]: [u32; 2]| -> UvRect {
            let (full_w, full_h) = (f64::from(atlas.width()), f64::from(atlas.height()));
            [
                f64::from(x) / full_w,
                (f64::from(y) + 0.5) / full_h,
                f64::from(x + w) / full_w,
                (f64::from(y + h) - 0.5) / full_h,
            ]
        };
        let around = UvMap::Around(rect(0, 0, label_size));
        let metal = UvMap::Around(rect(8, label_size[1] + 6, [label_size[0] - 16, 4]));
        let half = [half_x * 1e-3, half_y * 1e-3];
        let above = UvMap::FromAbove(rect(0, ends_top, end_size), half);
        let below = UvMap::FromBelow(rect(end_size[0] + gap, ends_top, end_size), half);

        let ring = |inset: f64, z: f64| self.section.ring(inset, z);
        let center = |z: f64| {
            let z = z * 1e-3;
            pole(0.0, 0.0, z, ring(0.0, 0.0).len())
        };
        // From the middle of the lid out to the top of the rim, with one pressed step.
        let lid = [
            center(top - self.recess + 0.8),
            ring(9.5, top - self.recess + 0.8),
            ring(8.5, top - self.recess),
            ring(3.4, top - self.recess),
            ring(2.4, top - 0.7),
            ring(1.9, top - 0.15),
            ring(1.3, top),
        ];
        let upper_rim = [
            ring(1.3, top),
            ring(0.5, top - 0.25),
            ring(0.0, top - 1.0),
            ring(0.0, top - self.rim + 0.7),
            ring(0.3, top - self.rim + 0.2),
            ring(self.step, top - self.rim),
        ];
        let side = [ring(self.step, top - self.rim), ring(self.step, self.rim - top)];
        let mirrored = |rings: &[Vec<Point3<f64>>]| -> Vec<Vec<Point3<f64>>> {
            let flip = |ring: &Vec<Point3<f64>>| ring.iter().map(|p| Point3::new(p.x, p.y, -p.z)).collect();
            rings.iter().rev().map(flip).collect()
        };
        let mut mesh = MeshBuilder::new();
        mesh.finish_with(BARE[0], BARE[1]);
        mesh.rings(&lid, above);
        mesh.rings(&upper_rim, metal);
        mesh.finish_with(PAPER, 0.0);
        mesh.rings(&side, around);
        mesh.finish_with(BARE[0], BARE[1]);
        mesh.rings(&mirrored(&upper_rim), metal);
        mesh.rings(&mirrored(&lid), below);

        let solid = match self.section {
            Section::Round { radius } => cylinder([0.0; 3], top * 1e-3, radius * 1e-3),
            Section::Rounded { half, radius } => {
                let outline = |z: f64| {
                    // Without the first point, which lies on a straight edge.
                    let ring = rounded_rectangle(half.map(|h| h * 1e-3), radius * 1e-3, 0.0, z * 1e-3, 4);
                    ring.into_iter().skip(1)
                };
                hull(outline(top).chain(outline(-top)).collect())
            }
        };
        BuiltIn::new(mesh.finish(), atlas.finish(), PAPER as f32, vec![solid])
    }

    /// The picture of an end: metal, pressed rings, a stamp.
    fn end(&self, [w, h]: [u32; 2], color: Color, top: bool) -> Canvas {
        let mut c = Canvas::new(w, h, color);
        let (w, h) = (c.width(), c.height());
        c.grain([90.0, 3.0], mix(color, BLACK, 0.4), 0.25, 300);
        if let Section::Round { .. } = self.section {
            let r = 0.5 * w;
            for (share, tone) in [(0.97, 0.25), (0.9, 0.2), (0.8, 0.12), (0.62, 0.1)] {
                c.ring(r, r, share * r, 2.5, mix(color, BLACK, tone));
                c.ring(r, r, share * r - 3.0, 2.0, mix(color, WHITE, 0.35));
            }
        } else {
            for (inset, tone) in [(0.04, 0.3), (0.13, 0.2)] {
                let d = inset * w;
                c.rounded_rect(d, d, w - d, h - d, (0.3 * h - 0.5 * d).max(4.0), mix(color, BLACK, tone));
                let d = d + 3.0;
                c.rounded_rect(d, d, w - d, h - d, (0.3 * h - 0.5 * d).max(4.0), color);
            }
        }
        if top {
            c.text_fitted([0.5 * w, 0.46 * h], [0.34 * w, 0.1 * h], "BEST BY", mix(color, BLACK, 0.6));
            c.text_fitted([0.5 * w, 0.54 * h], [0.34 * w, 0.1 * h], "11 MAR 29", mix(color, BLACK, 0.6));
        } else {
            c.text_fitted([0.5 * w, 0.5 * h], [0.24 * w, 0.1 * h], "K7 2281", mix(color, BLACK, 0.35));
        }
        c.noise(3.0, 301);
        c
    }
}

/// Both fronts of a label, the middle of each and their width.
fn fronts(c: &Canvas) -> [(f32, f32); 2] {
    [(0.25 * c.width(), 0.36 * c.width()), (0.75 * c.width(), 0.36 * c.width())]
}

/// Nutrition table and bar code at the label's seam, from half its width left of it, and opposite.
fn backs(c: &mut Canvas, [y0, y1]: [f32; 2], print: Color) {
    let w = c.width();
    let (half, middle) = (0.06 * w, 0.5 * w);
    c.nutrition_facts([middle - half, y0, middle + half, y1]);
    // The seam is the picture's edge: the bar code right of it, the small print left.
    c.barcode(0.004 * w, y0 + 0.15 * (y1 - y0), 0.062 * w, 0.6 * (y1 - y0), 51);
    c.small_print([0.938 * w, y0, 0.995 * w, y1], 7.0, print, 52);
}

fn coffee(c: &mut Canvas) {
    let (w, h) = (c.width(), c.height());
    let (blue, deep, gold) = ([28, 76, 158], [14, 34, 88], [226, 178, 66]);
    c.gradient(0.0, 0.0, w, h, blue, deep);
    c.rect(0.0, 0.0, w, 0.05 * h, gold);
    c.rect(0.0, 0.9 * h, w, 0.92 * h, gold);
    c.rect(0.0, 0.92 * h, w, h, [120, 20, 24]);
    for (x, width) in fronts(c) {
        c.rounded_rect(x - 0.5 * width, 0.1 * h, x + 0.5 * width, 0.46 * h, 18.0, gold);
        c.rounded_rect(
            x - 0.5 * width + 5.0,
            0.1 * h + 5.0,
            x + 0.5 * width - 5.0,
            0.46 * h - 5.0,
            14.0,
            WHITE,
        );
        c.text_fitted([x, 0.185 * h], [0.6 * width, 0.13 * h], "GROUND", [120, 20, 24]);
        c.text_fitted([x, 0.335 * h], [0.88 * width, 0.25 * h], "COFFEE", deep);
        // A cup on a saucer, steam over it.
        c.ellipse(x - 0.18 * width, 0.83 * h, 0.24 * width, 0.045 * h, [214, 216, 222]);
        let cup: Vec<[f32; 2]> = (0..=20)
            .map(|k| {
                let (sin, cos) = (std::f32::consts::PI * k as f32 / 20.0).sin_cos();
                [x - 0.18 * width + 0.17 * width * cos, 0.62 * h + 0.21 * h * sin]
            })
            .collect();
        c.ring(x - 0.01 * width, 0.69 * h, 0.07 * h, 7.0, WHITE);
        c.polygon(&cup, WHITE);
        c.ellipse(x - 0.18 * width, 0.62 * h, 0.17 * width, 0.035 * h, [226, 228, 232]);
        c.ellipse(x - 0.18 * width, 0.625 * h, 0.145 * width, 0.025 * h, [66, 34, 18]);
        for k in 0..3 {
            let sx = x + (-0.25 + 0.07 * k as f32) * width;
            c.stripe([sx, 0.575 * h], [sx + 6.0, 0.535 * h], 4.0, [180, 200, 236]);
            c.stripe([sx + 6.0, 0.535 * h], [sx, 0.495 * h], 4.0, [180, 200, 236]);
        }
        c.text(x + 0.12 * width, 0.58 * h, 0.075 * h, "MEDIUM", gold, Weight::Bold);
        c.text(x + 0.12 * width, 0.66 * h, 0.075 * h, "ROAST", gold, Weight::Bold);
        for k in 0..3 {
            let (bx, by) = (x + (0.19 + 0.09 * k as f32) * width, 0.81 * h);
            c.ellipse(bx, by, 0.04 * width, 0.03 * h, [92, 50, 26]);
            c.stripe([bx - 0.025 * width, by - 2.0], [bx + 0.025 * width, by + 2.0], 2.0, [44, 20, 10]);
        }
        c.text_fitted([x, 0.96 * h], [0.7 * width, 0.06 * h], "NET WT 33 OZ (935g)", WHITE);
    }
    backs(c, [0.14 * h, 0.84 * h], [170, 190, 226]);
    c.noise(2.0, 310);
}

fn soup(c: &mut Canvas) {
    let (w, h) = (c.width(), c.height());
    let (red, gold) = ([196, 22, 32], [206, 164, 72]);
    c.rect(0.0, 0.0, w, 0.5 * h, red);
    c.rect(0.0, 0.5 * h, w, h, WHITE);
    c.rect(0.0, 0.485 * h, w, 0.51 * h, gold);
    for (x, width) in fronts(c) {
        c.text_fitted([x + 2.0, 0.15 * h + 3.0], [0.8 * width, 0.2 * h], "Homestyle", mix(red, BLACK, 0.5));
        c.text_fitted([x, 0.15 * h], [0.8 * width, 0.2 * h], "Homestyle", WHITE);
        c.text_fitted([x, 0.3 * h], [0.6 * width, 0.07 * h], "CONDENSED", WHITE);
        c.circle(x, 0.5 * h, 0.12 * h, gold);
        c.circle(x, 0.5 * h, 0.105 * h, [236, 206, 128]);
        // A tomato on the medal.
        c.ellipse(x, 0.51 * h, 0.07 * h, 0.06 * h, [214, 40, 30]);
        c.ellipse(x - 0.025 * h, 0.49 * h, 0.02 * h, 0.015 * h, [244, 120, 96]);
        c.polygon(
            &[[x - 0.04 * h, 0.45 * h], [x, 0.47 * h], [x + 0.04 * h, 0.45 * h], [x + 0.01 * h, 0.435 * h]],
            [50, 120, 44],
        );
        c.text_fitted([x, 0.7 * h], [0.72 * width, 0.17 * h], "TOMATO", red);
        c.text_fitted([x, 0.84 * h], [0.6 * width, 0.15 * h], "SOUP", red);
        c.text_fitted([x, 0.945 * h], [0.7 * width, 0.05 * h], "NET WT 10 3/4 OZ (305g)", BLACK);
    }
    backs(c, [0.55 * h, 0.97 * h], [120, 110, 108]);
    c.noise(2.0, 311);
}

fn tuna(c: &mut Canvas) {
    let (w, h) = (c.width(), c.height());
    let (blue, green, yellow) = ([20, 66, 140], [24, 120, 96], [244, 206, 66]);
    c.rect(0.0, 0.0, w, h, blue);
    c.rect(0.0, 0.0, w, 0.13 * h, green);
    c.rect(0.0, 0.87 * h, w, h, green);
    c.rect(0.0, 0.13 * h, w, 0.16 * h, yellow);
    c.rect(0.0, 0.84 * h, w, 0.87 * h, yellow);
    for (x, width) in fronts(c) {
        c.text_fitted([x + 0.14 * width, 0.42 * h], [0.66 * width, 0.44 * h], "TUNA FISH", WHITE);
        c.text_fitted([x + 0.14 * width, 0.7 * h], [0.6 * width, 0.17 * h], "CHUNK LIGHT IN WATER", yellow);
        // A fish in an oval, its head to the left.
        let (fx, fy, r) = (x - 0.35 * width, 0.5 * h, 0.11 * width);
        c.ellipse(fx, fy, 1.35 * r, 0.3 * h, mix(blue, WHITE, 0.75));
        c.polygon(
            &[
                [fx + 0.6 * r, fy],
                [fx + 1.2 * r, fy - 0.16 * h],
                [fx + 1.05 * r, fy],
                [fx + 1.2 * r, fy + 0.16 * h],
            ],
            [44, 86, 130],
        );
        c.ellipse(fx - 0.1 * r, fy, 0.95 * r, 0.13 * h, [44, 86, 130]);
        c.ellipse(fx - 0.1 * r, fy + 0.045 * h, 0.85 * r, 0.075 * h, [190, 204, 214]);
        c.polygon(
            &[[fx - 0.3 * r, fy - 0.1 * h], [fx + 0.1 * r, fy - 0.22 * h], [fx + 0.25 * r, fy - 0.1 * h]],
            [44, 86, 130],
        );
        c.circle(fx - 0.78 * r, fy - 0.02 * h, 2.6, WHITE);
        c.circle(fx - 0.78 * r, fy - 0.02 * h, 1.4, BLACK);
    }
    backs(c, [0.2 * h, 0.8 * h], [190, 206, 230]);
    c.noise(2.0, 312);
}

fn meat(c: &mut Canvas) {
    let (w, h) = (c.width(), c.height());
    let (blue, deep, yellow) = ([24, 70, 156], [14, 40, 104], [250, 214, 70]);
    c.gradient(0.0, 0.0, w, h, blue, deep);
    c.rect(0.0, 0.9 * h, w, 0.93 * h, yellow);
    for (x, width) in fronts(c) {
        let width = 0.9 * width;
        c.text_fitted([x + 3.0, 0.15 * h + 3.0], [0.8 * width, 0.25 * h], "POTTED", mix(deep, BLACK, 0.5));
        c.text_fitted([x, 0.15 * h], [0.8 * width, 0.25 * h], "POTTED", yellow);
        c.text_fitted([x + 3.0, 0.36 * h + 3.0], [0.8 * width, 0.3 * h], "MEAT", mix(deep, BLACK, 0.5));
        c.text_fitted([x, 0.36 * h], [0.8 * width, 0.3 * h], "MEAT", yellow);
        // A plate with a loaf in slices and some parsley.
        c.ellipse(x, 0.74 * h, 0.44 * width, 0.14 * h, WHITE);
        c.ellipse(x, 0.735 * h, 0.37 * width, 0.105 * h, [214, 218, 226]);
        for k in 0..5 {
            let sx = x + (-0.2 + 0.085 * k as f32) * width;
            let (l, t, r, b) = (sx - 0.09 * width, 0.6 * h, sx + 0.09 * width, 0.79 * h);
            c.rounded_rect(l, t, r, b, 12.0, [160, 70, 60]);
            c.rounded_rect(l + 3.0, t + 2.0, r - 1.0, b - 2.0, 11.0, [226, 134, 116]);
            c.circle(sx, 0.68 * h, 3.0, [244, 186, 166]);
            c.circle(sx + 0.03 * width, 0.73 * h, 2.4, [190, 92, 78]);
        }
        for (dx, dy) in [(0.28, 0.74), (0.31, 0.71), (0.33, 0.75), (0.3, 0.77)] {
            c.circle(x + dx * width, dy * h, 0.022 * width, [60, 140, 52]);
        }
        c.text_fitted([x, 0.965 * h], [0.8 * width, 0.055 * h], "NET WT 12 OZ (340g)", WHITE);
    }
    backs(c, [0.12 * h, 0.84 * h], [176, 194, 228]);
    c.noise(2.0, 313);
}
