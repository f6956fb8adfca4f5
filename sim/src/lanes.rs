//! Eight floats at a time, written so that LLVM makes vector instructions of them, and one switch that compiles a kernel
//! for the machine at hand.
//!
//! Every version does the same operations in the same order, lane by lane, and none fuses multiply and add: results are
//! the same to the bit on every x86-64.
//!
//! This is the one place with `unsafe`: calling a function that was compiled for instructions which were
//! detected.

use std::ops::{Add, AddAssign, Div, Mul, Sub};

/// Lanes of a block.
pub const LANES: usize = 8;

/// A block of pixels or vertices.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(32))]
pub struct F8(pub [f32; LANES]);

impl F8 {
    /// 0 to 7.
    pub const INDEX: Self = Self([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
    /// All zero.
    pub const ZERO: Self = Self([0.0; LANES]);

    /// One value in all lanes.
    #[inline(always)]
    pub fn all(x: f32) -> Self {
        Self([x; LANES])
    }

    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        let mut out = self.0;
        for (o, b) in out.iter_mut().zip(other.0) {
            *o = f(*o, b);
        }
        Self(out)
    }

    /// The smaller, lane by lane; `other` where they cannot be compared.
    #[inline(always)]
    pub fn min(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { a } else { b })
    }

    /// The larger, lane by lane; `other` where they cannot be compared.
    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }

    /// The larger, lane by lane, of values that are not negative, by their bits. Storing a maximum of floats where its second
    /// half was read becomes a masked store, which is many times slower than a whole one on some machines.
    #[inline(always)]
    pub fn max_of_positive(self, other: Self) -> Self {
        self.zip(other, |a, b| f32::from_bits((a.to_bits() as i32).max(b.to_bits() as i32) as u32))
    }

    /// Without the sign.
    #[inline(always)]
    pub fn abs(self) -> Self {
        let mut out = self.0;
        for o in &mut out {
            *o = f32::from_bits(o.to_bits() & 0x7fff_ffff);
        }
        Self(out)
    }

    /// Square root.
    #[inline(always)]
    pub fn sqrt(self) -> Self {
        Self(self.0.map(f32::sqrt))
    }

    /// `yes` where `self > other`, else `no`: a selection, so NaN and infinity in the other branch do no harm.
    #[inline(always)]
    pub fn above(self, other: Self, yes: Self, no: Self) -> Self {
        let mut out = no.0;
        for (i, o) in out.iter_mut().enumerate() {
            *o = if self.0[i] > other.0[i] { yes.0[i] } else { *o };
        }
        Self(out)
    }

    /// `yes` where `self > 0`, else `no`.
    #[inline(always)]
    pub fn positive(self, yes: Self, no: Self) -> Self {
        self.above(Self::ZERO, yes, no)
    }

    /// Sine and cosine of angles within some hundred turns, to 3e-7: quarter turns taken off, then the polynomials of Cephes
    /// (Moshier 1992) for single precision.
    #[inline(always)]
    pub fn sin_cos(self) -> (Self, Self) {
        use std::f32::consts::FRAC_2_PI;
        // A quarter turn in two parts, the first with bits to spare: its multiples are exact.
        const QUARTER: [f32; 2] = [1.570_312_5, 4.838_268e-4];
        // Adding it leaves the nearest whole number in the lowest bits.
        const WHOLE: f32 = 12_582_912.0;
        let (mut sin, mut cos) = (self.0, self.0);
        for (s, c) in sin.iter_mut().zip(&mut cos) {
            let x = *s;
            let shifted = x * FRAC_2_PI + WHOLE;
            let quarter = shifted.to_bits();
            let n = shifted - WHOLE;
            let x = (x - n * QUARTER[0]) - n * QUARTER[1];
            let xx = x * x;
            let odd = x + x * xx * (-1.666_665_5e-1 + xx * (8.332_161e-3 - xx * 1.951_529_6e-4));
            let even =
                1.0 - 0.5 * xx + xx * xx * (4.166_664_6e-2 + xx * (-1.388_731_6e-3 + xx * 2.443_315_7e-5));
            let (a, b) = if quarter & 1 == 0 { (odd, even) } else { (even, odd) };
            // The sign bits: sine turns negative for the quarters 2 and 3, cosine for 1 and 2.
            *s = f32::from_bits(a.to_bits() ^ ((quarter & 2) << 30));
            *c = f32::from_bits(b.to_bits() ^ ((quarter.wrapping_add(1) & 2) << 30));
        }
        (Self(sin), Self(cos))
    }

    /// Sum of the lanes, in a fixed order.
    #[inline(always)]
    pub fn sum(self) -> f32 {
        let a = self.0;
        ((a[0] + a[4]) + (a[2] + a[6])) + ((a[1] + a[5]) + (a[3] + a[7]))
    }

    /// Smallest lane.
    #[inline(always)]
    pub fn least(self) -> f32 {
        self.halved(|a, b| if a < b { a } else { b })
    }

    /// Largest lane.
    #[inline(always)]
    pub fn most(self) -> f32 {
        self.halved(|a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn halved(self, f: impl Fn(f32, f32) -> f32) -> f32 {
        let a = self.0;
        f(f(f(a[0], a[4]), f(a[2], a[6])), f(f(a[1], a[5]), f(a[3], a[7])))
    }
}

/// Eight vectors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct V8 {
    /// First components.
    pub x: F8,
    /// Second components.
    pub y: F8,
    /// Third components.
    pub z: F8,
}

impl V8 {
    /// One vector in all lanes.
    #[inline(always)]
    pub fn all(v: [f32; 3]) -> Self {
        Self { x: F8::all(v[0]), y: F8::all(v[1]), z: F8::all(v[2]) }
    }

    /// Scalar product, lane by lane.
    #[inline(always)]
    pub fn dot(self, other: Self) -> F8 {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// Times a number, lane by lane.
    #[inline(always)]
    pub fn times(self, s: F8) -> Self {
        Self { x: self.x * s, y: self.y * s, z: self.z * s }
    }

    /// The vector in one lane.
    pub fn lane(&self, i: usize) -> [f32; 3] {
        [self.x.0[i], self.y.0[i], self.z.0[i]]
    }
}

impl Add for V8 {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }
}

impl Sub for V8 {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}

/// `count` blocks from value `at` on. Cut a row once, outside of the loop over its blocks: inside, no bounds are left to be
/// checked.
///
/// # Panics
/// When there are fewer; buffers of kernels are padded for this.
#[inline(always)]
pub fn blocks(values: &[f32], at: usize, count: usize) -> &[[f32; LANES]] {
    &values[at..at + count * LANES].as_chunks().0[..count]
}

/// [`blocks`] to be written.
#[inline(always)]
pub fn blocks_mut(values: &mut [f32], at: usize, count: usize) -> &mut [[f32; LANES]] {
    &mut values[at..at + count * LANES].as_chunks_mut().0[..count]
}

/// The sums of a loop, kept in memory. What is stored block by block LLVM makes whole vectors of; sums that live in registers it
/// takes apart into halves and single lanes (measured: twice the time).
#[inline(always)]
pub fn in_memory<const N: usize>(sums: &mut [F8; N]) -> &mut [F8; N] {
    std::hint::black_box(sums)
}

macro_rules! lanewise {
    ($($trait:ident $method:ident $op:tt),*) => {$(
        impl $trait for F8 {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.zip(other, |a, b| a $op b)
            }
        }
    )*};
}
lanewise!(Add add +, Sub sub -, Mul mul *, Div div /);

impl AddAssign for F8 {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

/// A set of vector instructions that this machine has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Isa(Set);

/// The kinds of [`Isa`].
#[doc(hidden)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Set {
    Base,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Isa {
    /// What every machine of the target has.
    pub const BASE: Self = Self(Set::Base);

    /// All that this machine has, the plainest first.
    pub fn available() -> Vec<Self> {
        let mut sets = vec![Self::BASE];
        #[cfg(target_arch = "x86_64")]
        {
            use std::arch::is_x86_feature_detected as has;
            if has!("avx2") {
                sets.push(Self(Set::Avx2));
            }
            if has!("avx2") && has!("avx512f") && has!("avx512vl") && has!("avx512dq") && has!("avx512bw") {
                sets.push(Self(Set::Avx512));
            }
        }
        sets
    }

    /// The best that this machine has.
    pub fn best() -> Self {
        static BEST: std::sync::OnceLock<Isa> = std::sync::OnceLock::new();
        *BEST.get_or_init(|| Self::available().pop().unwrap_or(Self::BASE))
    }

    #[doc(hidden)]
    pub fn set(self) -> Set {
        self.0
    }
}

impl Default for Isa {
    fn default() -> Self {
        Self::best()
    }
}

impl std::fmt::Display for Isa {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self.0 {
            Set::Base => "base",
            #[cfg(target_arch = "x86_64")]
            Set::Avx2 => "avx2",
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => "avx512",
        })
    }
}

/// Defines a function that runs `$body` compiled for a set of instructions. The body must be `#[inline(always)]` down to
/// the leaves, or its callees stay at the baseline.
#[macro_export]
macro_rules! per_machine {
    ($(#[$doc:meta])* $vis:vis fn $name:ident($($arg:ident: $type:ty),* $(,)?) -> $out:ty => $body:path) => {
        $(#[$doc])*
        #[inline]
        $vis fn $name(isa: $crate::lanes::Isa, $($arg: $type),*) -> $out {
            #[cfg(target_arch = "x86_64")]
            {
                use $crate::lanes::Set;
                #[target_feature(enable = "avx2")]
                fn avx2($($arg: $type),*) -> $out {
                    $body($($arg),*)
                }
                #[target_feature(enable = "avx2,avx512f,avx512vl,avx512dq,avx512bw")]
                fn avx512($($arg: $type),*) -> $out {
                    $body($($arg),*)
                }
                #[expect(unsafe_code, reason = "functions for instructions that not every machine has")]
                match isa.set() {
                    Set::Base => {}
                    // SAFETY: an `Isa` of this kind is only made where the machine has AVX2, all that `avx2` requires.
                    Set::Avx2 => return unsafe { avx2($($arg),*) },
                    // SAFETY: likewise for the five sets that `avx512` requires.
                    Set::Avx512 => return unsafe { avx512($($arg),*) },
                }
            }
            #[cfg(not(target_arch = "x86_64"))]
            let _ = isa;
            $body($($arg),*)
        }
    };
}
pub use crate::per_machine;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sine_and_cosine_are_right_in_every_quarter_and_many_turns_away() {
        for k in -4000..4000 {
            let x = k as f32 * 0.05 + 0.013;
            let (sin, cos) = F8::all(x).sin_cos();
            let (s, c) = f64::from(x).sin_cos();
            // The angle itself is rounded to single precision only once, but is reduced in it.
            assert!((f64::from(sin.0[3]) - s).abs() < 3e-7, "sin {x}");
            assert!((f64::from(cos.0[3]) - c).abs() < 3e-7, "cos {x}");
        }
    }
}
