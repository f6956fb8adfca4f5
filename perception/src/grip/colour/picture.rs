//! The colour image as [looks](crate::model::look), at all strides.

use grip_sim::frame::CameraFrame;
use grip_sim::lanes::LANES;

use crate::model::look;
use crate::observation::Stride;

/// Pixels of padding on each side, copies of the outermost: a picture is read in blocks, and shifted.
pub(super) const MARGIN: usize = 3 * LANES;

/// The colour image of a frame.
#[derive(Debug)]
pub(crate) struct Picture {
    levels: Vec<PictureLevel>,
}

/// At one resolution.
#[derive(Debug)]
pub(super) struct PictureLevel {
    /// Values a row, padding included.
    pub pitch: usize,
    /// The looks, channel by channel, row by row.
    pub looks: [Vec<f32>; 3],
}

impl Picture {
    /// Of this frame; `None` where it has no colour image of the size of the depth image.
    pub fn new(frame: &CameraFrame) -> Option<Self> {
        let (mut width, mut height) = (frame.intrinsics.width, frame.intrinsics.height);
        if (frame.rgb.width() as usize, frame.rgb.height() as usize) != (width, height) {
            return None;
        }
        let pixels = frame.rgb.as_raw().as_chunks::<3>().0;
        let mut codes: Vec<[f32; 3]> = pixels.iter().map(|p| p.map(|code| f32::from(code) / 255.0)).collect();
        let mut levels = Vec::new();
        for stride in Stride::ALL {
            if stride != Stride::One {
                codes = halved(&codes, [width, height]);
                (width, height) = (width / 2, height / 2);
            }
            levels.push(PictureLevel::new(&codes, [width, height]));
        }
        Some(Self { levels })
    }

    pub(super) fn level(&self, stride: Stride) -> &PictureLevel {
        &self.levels[stride as usize]
    }
}

impl PictureLevel {
    fn new(codes: &[[f32; 3]], [width, height]: [usize; 2]) -> Self {
        let pitch = width.next_multiple_of(LANES) + 2 * MARGIN;
        let mut looks = [0; 3].map(|_| Vec::with_capacity(pitch * (height + 2 * MARGIN)));
        for v in 0..height {
            let row = &codes[v * width..(v + 1) * width];
            let first = looks[0].len();
            for looked in row.iter().map(|p| look(*p)) {
                for (out, x) in looks.iter_mut().zip(looked) {
                    if out.len() == first {
                        out.extend([x; MARGIN]);
                    }
                    out.push(x);
                }
            }
            for out in &mut looks {
                let last = out[out.len() - 1];
                out.resize(first + pitch, last);
            }
        }
        // Rows above and below.
        for out in &mut looks {
            let (top, bottom) = (out[..pitch].to_vec(), out[out.len() - pitch..].to_vec());
            let mut padded = top.repeat(MARGIN);
            padded.append(out);
            padded.extend(bottom.repeat(MARGIN + LANES));
            *out = padded;
        }
        Self { pitch, looks }
    }

    /// Index of pixel (u, v), which may lie in the padding.
    #[inline]
    pub fn index(&self, u: i32, v: i32) -> usize {
        ((v + MARGIN as i32) as usize) * self.pitch + (u + MARGIN as i32) as usize
    }
}

/// Means of blocks of two by two.
fn halved(codes: &[[f32; 3]], [width, height]: [usize; 2]) -> Vec<[f32; 3]> {
    let mean = |u: usize, v: usize| {
        let at = 2 * v * width + 2 * u;
        let block = [at, at + 1, at + width, at + width + 1].map(|i| codes[i]);
        [0, 1, 2].map(|c| 0.25 * (block[0][c] + block[1][c] + block[2][c] + block[3][c]))
    };
    (0..height / 2).flat_map(|v| (0..width / 2).map(move |u| mean(u, v))).collect()
}
