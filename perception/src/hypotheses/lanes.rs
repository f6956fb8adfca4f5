//! Eight floats at a time, written so that LLVM makes vector instructions of them, and one switch that compiles a kernel
//! for the machine at hand.
//!
//! Every version does the same operations in the same order, lane by lane, and none fuses multiply and add: results are
//! the same to the bit on every x86-64.
//!
//! This is the one place with `unsafe` in this crate: calling a function that was compiled for instructions which were
//! detected.

use std::ops::{Add, AddAssign, Div, Mul, Sub};

/// Lanes of a block.
pub(crate) const LANES: usize = 8;

/// A block of pixels or vertices.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(32))]
pub(crate) struct F8(pub [f32; LANES]);

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

/// `count` blocks from value `at` on. Cut a row once, outside of the loop over its blocks: inside, no bounds are left to be
/// checked.
///
/// # Panics
/// When there are fewer; buffers of kernels are padded for this.
#[inline(always)]
pub(crate) fn blocks(values: &[f32], at: usize, count: usize) -> &[[f32; LANES]] {
    &values[at..at + count * LANES].as_chunks().0[..count]
}

/// [`blocks`] to be written.
#[inline(always)]
pub(crate) fn blocks_mut(values: &mut [f32], at: usize, count: usize) -> &mut [[f32; LANES]] {
    &mut values[at..at + count * LANES].as_chunks_mut().0[..count]
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

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Set {
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

    pub(crate) fn set(self) -> Set {
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
macro_rules! per_machine {
    ($(#[$doc:meta])* $vis:vis fn $name:ident($($arg:ident: $type:ty),* $(,)?) -> $out:ty => $body:path) => {
        $(#[$doc])*
        #[inline]
        $vis fn $name(isa: $crate::hypotheses::Isa, $($arg: $type),*) -> $out {
            #[cfg(target_arch = "x86_64")]
            {
                use $crate::hypotheses::lanes::Set;
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
pub(crate) use per_machine;
