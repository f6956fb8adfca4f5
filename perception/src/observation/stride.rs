//! The resolutions at which a frame is prepared.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A resolution of the image pyramid: blocks of so many pixels a side make one pixel. In files the number, 1, 2, 4 or 8.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "u32", into = "u32")]
#[schemars(with = "u32", extend("enum" = [1, 2, 4, 8]))]
pub enum Stride {
    /// Full resolution.
    One,
    /// Half of it.
    Two,
    /// A quarter.
    Four,
    /// An eighth.
    Eight,
}

impl Stride {
    /// All, the finest first.
    pub const ALL: [Self; 4] = [Self::One, Self::Two, Self::Four, Self::Eight];

    /// Side of a block, pixels of the image.
    pub fn pixels(self) -> usize {
        1 << self as usize
    }

    /// The next finer one; none of full resolution.
    pub fn finer(self) -> Option<Self> {
        (self as usize).checked_sub(1).map(|i| Self::ALL[i])
    }
}

impl From<Stride> for u32 {
    fn from(stride: Stride) -> Self {
        1 << stride as u32
    }
}

impl TryFrom<u32> for Stride {
    type Error = String;

    fn try_from(pixels: u32) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|stride| u32::from(*stride) == pixels);
        found.ok_or_else(|| format!("stride = {pixels}: must be 1, 2, 4 or 8"))
    }
}

impl fmt::Display for Stride {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.pixels())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_level_that_is_not_prepared_cannot_be_asked_for() {
        for (text, stride) in
            [("1", Stride::One), ("2", Stride::Two), ("4", Stride::Four), ("8", Stride::Eight)]
        {
            assert_eq!(serde_json::from_str::<Stride>(text).unwrap(), stride);
            assert_eq!(serde_json::to_string(&stride).unwrap(), text);
        }
        let error = serde_json::from_str::<Stride>("3").unwrap_err().to_string();
        assert!(error.contains("stride = 3: must be 1, 2, 4 or 8"), "{error}");
        assert_eq!(Stride::Two.finer(), Some(Stride::One));
        assert_eq!(Stride::One.finer(), None);
    }
}
