//! Pieces of a picture in which a sensor reads nothing.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Squares of a grid, some of which are chosen.
pub(super) struct Patches {
    side: usize,
    columns: usize,
    chosen: Vec<bool>,
}

impl Patches {
    /// A `share` of the squares, `side` pixels wide, of a picture.
    pub fn new(width: usize, height: usize, side: usize, share: f32, rng: &mut ChaCha8Rng) -> Self {
        let (columns, rows) = (width.div_ceil(side), height.div_ceil(side));
        let chosen = (0..columns * rows).map(|_| rng.random::<f32>() < share).collect();
        Self { side, columns, chosen }
    }

    pub fn covers(&self, u: usize, v: usize) -> bool {
        self.chosen[v / self.side * self.columns + u / self.side]
    }
}
