//! Looks that a PLY file can hold. It has a texture or a colour a vertex, and readers take the one or the other; our
//! materials have both, multiplied. Here they are multiplied out into one texture.

use std::collections::BTreeMap;

use image::{Rgb, RgbImage};

use crate::mesh::{Material, Mesh, Visual};
use crate::render::srgb::{LINEAR_OF_8BIT, color_to_linear, encode_8bit};

/// Texels around a tile, so that filtering does not bleed between tiles.
const PADDING: i64 = 3;
/// Tiles are packed in shelves of this width at least.
const SHELF: u32 = 2048;

/// The mesh with texture coordinates of its own texture, or with colours and no texture. Every place has the colour that
/// `visual` has there, up to 8-bit rounding; a triangle whose corners differ in colour and which is textured too takes
/// their mean.
pub(super) fn plain(visual: &Visual) -> (Mesh, Option<RgbImage>) {
    let Visual { mesh, material } = visual;
    let mut mesh = Mesh::clone(mesh);
    match &material.texture {
        Some(texture) if !mesh.uvs.is_empty() => {
            if mesh.colors.is_empty() && material.base_color == [1.0; 3] {
                return (mesh, Some(RgbImage::clone(texture)));
            }
            let (mesh, texture) = baked(&mesh, material, texture);
            (mesh, Some(texture))
        }
        _ => {
            let base = color_to_linear(material.base_color);
            let count = mesh.positions.len();
            let colors = if mesh.colors.len() == count { mesh.colors } else { vec![[255; 3]; count] };
            mesh.colors = colors.iter().map(|color| tinted(*color, base)).collect();
            mesh.uvs.clear();
            (mesh, None)
        }
    }
}

/// The sRGB colour times a linear one.
fn tinted(color: [u8; 3], linear: [f32; 3]) -> [u8; 3] {
    std::array::from_fn(|i| encode_8bit(LINEAR_OF_8BIT[usize::from(color[i])] * linear[i]))
}

/// A piece of the texture in one colour: first and last texel used, then its place in the atlas.
#[derive(Debug, Clone, Copy)]
struct Tile {
    low: [i64; 2],
    high: [i64; 2],
    place: [u32; 2],
}

impl Tile {
    fn size(&self) -> [u32; 2] {
        [0, 1].map(|i| (self.high[i] - self.low[i] + 1) as u32)
    }
}

/// One tile for each colour: the part of the texture that its triangles use, times the colour.
fn baked(mesh: &Mesh, material: &Material, texture: &RgbImage) -> (Mesh, RgbImage) {
    let size = [texture.width(), texture.height()].map(f64::from);
    let texel = |uv: [f32; 2]| [0, 1].map(|i| f64::from(uv[i]) * size[i]);
    let color_of = |triangle: &[u32; 3]| -> [u8; 3] {
        let corners = triangle.map(|i| mesh.colors.get(i as usize).copied().unwrap_or([255; 3]));
        if corners[0] == corners[1] && corners[1] == corners[2] {
            return corners[0];
        }
        std::array::from_fn(|i| {
            encode_8bit(corners.iter().map(|color| LINEAR_OF_8BIT[usize::from(color[i])]).sum::<f32>() / 3.0)
        })
    };
    let mut tiles: BTreeMap<[u8; 3], Tile> = BTreeMap::new();
    for triangle in &mesh.triangles {
        for &vertex in triangle {
            let at = texel(mesh.uvs[vertex as usize]);
            let low = at.map(|value| value.floor() as i64 - PADDING);
            let high = at.map(|value| value.ceil() as i64 + PADDING);
            let tile = tiles.entry(color_of(triangle)).or_insert(Tile { low, high, place: [0; 2] });
            for i in 0..2 {
                tile.low[i] = tile.low[i].min(low[i]);
                tile.high[i] = tile.high[i].max(high[i]);
            }
        }
    }
    let atlas_size = pack(tiles.values_mut().collect());
    let mut atlas = RgbImage::from_pixel(atlas_size[0], atlas_size[1], Rgb([128; 3]));
    let base = color_to_linear(material.base_color);
    for (color, tile) in &tiles {
        let tint: [f32; 3] = std::array::from_fn(|i| LINEAR_OF_8BIT[usize::from(color[i])] * base[i]);
        let [width, height] = tile.size();
        for y in 0..height {
            for x in 0..width {
                // Textures repeat.
                let from = [
                    (tile.low[0] + i64::from(x)).rem_euclid(i64::from(texture.width())) as u32,
                    (tile.low[1] + i64::from(y)).rem_euclid(i64::from(texture.height())) as u32,
                ];
                let value = tinted(texture.get_pixel(from[0], from[1]).0, tint);
                atlas.put_pixel(tile.place[0] + x, tile.place[1] + y, Rgb(value));
            }
        }
    }
    (moved(mesh, texel, atlas_size, |triangle| tiles.get(&color_of(triangle)).copied()), atlas)
}

/// The mesh with texture coordinates in the atlas. A vertex with triangles of several colours is doubled.
fn moved(
    mesh: &Mesh,
    texel: impl Fn([f32; 2]) -> [f64; 2],
    atlas: [u32; 2],
    tile_of: impl Fn(&[u32; 3]) -> Option<Tile>,
) -> Mesh {
    let mut result = Mesh { uvs: mesh.uvs.clone(), colors: vec![], ..mesh.clone() };
    let mut owner: Vec<Option<[u32; 2]>> = vec![None; mesh.positions.len()];
    let mut copies: BTreeMap<(u32, [u32; 2]), u32> = BTreeMap::new();
    for triangle in &mut result.triangles {
        let Some(tile) = tile_of(triangle) else { continue };
        for vertex in triangle {
            let old = *vertex as usize;
            if owner[old].is_some_and(|place| place != tile.place) {
                *vertex = *copies.entry((*vertex, tile.place)).or_insert_with(|| {
                    result.positions.push(mesh.positions[old]);
                    result.normals.push(mesh.normals[old]);
                    result.uvs.push([0.0; 2]);
                    (result.positions.len() - 1) as u32
                });
            } else {
                owner[old] = Some(tile.place);
            }
            let at = texel(mesh.uvs[old]);
            result.uvs[*vertex as usize] = std::array::from_fn(|i| {
                ((at[i] - tile.low[i] as f64 + f64::from(tile.place[i])) / f64::from(atlas[i])) as f32
            });
        }
    }
    result
}

/// Places the tiles on shelves, the highest first, and returns the size of the whole.
fn pack(mut tiles: Vec<&mut Tile>) -> [u32; 2] {
    tiles.sort_by_key(|tile| std::cmp::Reverse(tile.size()[1]));
    let width = tiles.iter().map(|tile| tile.size()[0]).max().unwrap_or(1).max(SHELF);
    let (mut x, mut y, mut shelf, mut used) = (0, 0, 0, 1);
    for tile in tiles {
        let [w, h] = tile.size();
        if x + w > width {
            (x, y, shelf) = (0, y + shelf, 0);
        }
        tile.place = [x, y];
        x += w;
        shelf = shelf.max(h);
        used = used.max(x);
    }
    [used, y + shelf.max(1)]
}
