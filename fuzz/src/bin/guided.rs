//! libFuzzer on one of the targets, which `GRIP_FUZZ_TARGET` names: see `fuzz/run`.
#![no_main]
#![allow(clippy::expect_used, reason = "a fuzzer ends at what is wrong")]

use std::sync::LazyLock;

use grip_fuzz::{TARGETS, Target, Workplace};
use libfuzzer_sys::fuzz_target;

static TARGET: LazyLock<(&'static Target, Workplace)> = LazyLock::new(|| {
    let name = std::env::var("GRIP_FUZZ_TARGET").expect("GRIP_FUZZ_TARGET");
    let target = TARGETS.iter().find(|target| target.name == name).expect("a target of that name");
    (target, Workplace::new(target))
});

fuzz_target!(|bytes: &[u8]| TARGET.1.run(TARGET.0, bytes));
