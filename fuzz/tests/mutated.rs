//! Mutations of the corpus, the same ones every time: a short run, without guidance, of what `fuzz/run` does at length.
//!
//! `GRIP_FUZZ_INPUTS` says how many of each kind.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test")]

use std::panic::{AssertUnwindSafe, catch_unwind};

use grip_fuzz::{TARGETS, Target, Workplace, corpus};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

const INPUTS: usize = 10_000;
/// Inputs that share a folder.
const BATCH: usize = 50;

#[test]
fn no_file_makes_a_reader_panic() {
    let inputs = std::env::var("GRIP_FUZZ_INPUTS").ok().and_then(|text| text.parse().ok()).unwrap_or(INPUTS);
    for target in &TARGETS {
        let seeds: Vec<Vec<u8>> = corpus(target).into_iter().map(|(_, bytes)| bytes).collect();
        assert!(!seeds.is_empty(), "{}: no corpus", target.name);
        let failed: Vec<String> = (0..inputs.div_ceil(BATCH))
            .into_par_iter()
            .flat_map_iter(|batch| {
                let workplace = Workplace::new(target);
                let of_batch = batch * BATCH..inputs.min((batch + 1) * BATCH);
                of_batch.filter_map(|i| attempt(target, &workplace, &seeds, i)).collect::<Vec<_>>()
            })
            .collect();
        println!("{}: {inputs} inputs from {} files", target.name, seeds.len());
        assert!(failed.is_empty(), "{}: {} inputs, the first:\n{}", target.name, failed.len(), failed[0]);
    }
}

/// What went wrong with an input.
fn attempt(target: &Target, workplace: &Workplace, seeds: &[Vec<u8>], number: usize) -> Option<String> {
    // Each file as it stands first.
    let bytes = match seeds.get(number) {
        Some(seed) => seed.clone(),
        None => mutated(seeds, &mut ChaCha8Rng::seed_from_u64(number as u64)),
    };
    let panic = catch_unwind(AssertUnwindSafe(|| workplace.run(target, &bytes))).err()?;
    let message = panic.downcast_ref::<String>().map_or("", String::as_str);
    let kept = std::env::temp_dir().join(format!("grip-fuzz-{}-{number}", target.name));
    std::fs::write(&kept, &bytes).unwrap();
    Some(format!("{}: {message}", kept.display()))
}

/// Numbers and words that readers trip over.
const WORDS: [&str; 24] = [
    "0",
    "-1",
    "1e400",
    "nan",
    "inf",
    "4294967295",
    "-2147483648",
    "18446744073709551616",
    "1e-320",
    "0x1",
    "",
    " ",
    "\"",
    "<",
    "/>",
    "{",
    "[[[[",
    "\u{feff}",
    "\0",
    "../",
    "file://",
    "%",
    "#",
    "é",
];

fn mutated(seeds: &[Vec<u8>], random: &mut impl Rng) -> Vec<u8> {
    let mut bytes = seeds[random.random_range(0..seeds.len())].clone();
    for _ in 0..random.random_range(1..6) {
        let at = random.random_range(0..=bytes.len());
        let length = random.random_range(0..=(bytes.len() - at).min(64));
        match random.random_range(0..9) {
            0 => bytes.truncate(at),
            1 => drop(bytes.drain(at..at + length)),
            2 => {
                let copied = bytes[at..at + length].to_vec();
                let to = random.random_range(0..=bytes.len());
                drop(bytes.splice(to..to, copied));
            }
            3 => {
                let other = &seeds[random.random_range(0..seeds.len())];
                let from = random.random_range(0..=other.len());
                bytes.truncate(at);
                bytes.extend(&other[from..]);
            }
            // A number or a word of the text is another.
            4 | 5 => {
                let plain = |byte: &u8| byte.is_ascii_alphanumeric() || b"+-._".contains(byte);
                let start = bytes[..at].iter().rposition(|byte| !plain(byte)).map_or(0, |i| i + 1);
                let end = bytes[at..].iter().position(|byte| !plain(byte)).map_or(bytes.len(), |i| at + i);
                let word = WORDS[random.random_range(0..WORDS.len())];
                drop(bytes.splice(start..end, word.bytes()));
            }
            6 if at < bytes.len() => bytes[at] ^= 1 << random.random_range(0..8),
            _ if at < bytes.len() => bytes[at] = [0, 1, 0x7f, 0x80, 0xff][random.random_range(0..5)],
            _ => bytes.push(random.random()),
        }
    }
    bytes
}
