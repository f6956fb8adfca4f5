//! Tests of the whole: the command as a user runs it, and the library under it. One program, since each links everything.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests")]

#[cfg(unix)]
mod campaign;
mod cli;
mod common;
mod crosscheck;
mod detect;
mod estimate;
mod estimators;
mod examples;
mod experiments;
mod explain;
mod figures;
mod golden;
mod graspers;
mod init;
mod input;
mod mcap;
mod metrics;
mod objects;
#[cfg(unix)]
mod own;
mod pack;
mod plan;
mod record;
mod renderers;
mod robots;
mod scenes;
mod schemas;
