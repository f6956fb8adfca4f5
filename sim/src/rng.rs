//! One seed a run, one independent stream for each consumer.
//!
//! Drawing more numbers in one consumer (say, more particles) never changes what another one sees.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sha2::{Digest, Sha256};

/// The random stream of the consumer called `name` in a run with `seed`.
///
/// The name is hashed (SHA-256), so streams of different names are independent, and the same on every machine.
pub fn stream(seed: u64, name: &str) -> ChaCha8Rng {
    let mut hasher = Sha256::new();
    hasher.update(seed.to_le_bytes());
    hasher.update(name.as_bytes());
    ChaCha8Rng::from_seed(hasher.finalize().into())
}

/// The first number of that stream: a seed for what has streams of its own.
pub fn seed(seed: u64, name: &str) -> u64 {
    stream(seed, name).random()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_repeat_and_differ_by_name_and_seed() {
        let draw = |seed, name| stream(seed, name).random::<u64>();
        assert_eq!(draw(1, "scene"), draw(1, "scene"));
        assert_ne!(draw(1, "scene"), draw(1, "sensor"));
        assert_ne!(draw(1, "scene"), draw(2, "scene"));
    }
}
