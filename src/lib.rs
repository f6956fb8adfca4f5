//! Grocery packing in simulation: GRIP estimates poses, a Fetch packs, physics decides, every grasp is scored.
//!
//! This library is what the command `grip` is made of. A trial:
//!
//! ```no_run
//! use grip::estimators::{DetectorKind, Estimator, EstimatorKind, DetectorOptions};
//! use grip::progress::Quiet;
//! use grip::setup::{Setup, SetupOptions};
//! use grip::trial::{self, TrialOptions};
//! use grip_sim::render::{self, RendererChoice};
//!
//! # fn main() -> anyhow::Result<()> {
//! let setup = Setup::load(&SetupOptions { seed: 7, condition: "dark".into(), ..SetupOptions::default() })?;
//! let estimator =
//!     Estimator::open(&setup, &EstimatorKind::Grip, DetectorKind::Pyramid, &DetectorOptions::default())?;
//! let (planner, mut renderer) = (setup.planner(), render::open(RendererChoice::Auto)?);
//! let trial =
//!     trial::run(&setup, &estimator, &planner, renderer.as_mut(), TrialOptions::default(), &Quiet)?;
//! println!("{} of {} packed", trial.result.packed, trial.result.requested);
//! # Ok(())
//! # }
//! ```
//!
//! The folder `examples` has one for each use: a scene, a frame, the poses in it, a pick, a trial, a sweep, the score of a
//! results file.
//!
//! | module | what it holds |
//! |---|---|
//! | [`setup`], [`cell`], [`settings`], [`scenario`] | everything that a run depends on: table, bin and robot; objects, condition, camera, seed; one tree of settings; its record and hash |
//! | [`estimators`] | who estimates poses in a trial |
//! | [`graspers`] | who plans grasps in a trial |
//! | [`external`] | programs of others, and what is said to them |
//! | [`trial`] | one trial: look, believe, choose, act, settle |
//! | [`record`], [`table`] | everything that is known of a trial, saved; Parquet |
//! | [`score`] | what counts as a success, and what a trial was like |
//! | [`experiment`] | many trials, sweeps of pose errors, statistics, reports |
//! | [`campaign`] | any of these, cut into units for clusters, and put together |
//! | [`dataset`] | data sets in BOP's format, made |
//! | [`benchmark`] | poses of any BOP data set, estimated and measured |
//! | [`trajectory`] | planned motions as files, ours and ROS's |
//! | [`robot`] | whether a robot fits its cell, and how it looks |
//! | [`explain`], [`plot`], [`pictures`] | pictures and figures |
//! | `commands` | the command `grip`, with the feature `cli` |
//! | [`run_dir`], [`workers`], [`progress`], [`assets`] | folders that exist whole or not at all, threads, progress, files that ship with the program |
//!
//! Below it: `grip_sim` (objects, robot, scenes, cameras), `grip_physics` (the world, which alone knows the truth),
//! `grip_perception` (detectors and estimators) and `grip_manip` (grasps, places, motions). The last two do not depend on the
//! world. Units are SI, angles radians where a name does not say degrees; frames are in the types of poses.
//!
//! Errors are [`anyhow::Error`]s whose text names the file, the field, the value and what to try.

pub mod assets;
pub mod benchmark;
pub mod campaign;
pub mod cell;
#[cfg(feature = "cli")]
mod cli;
#[cfg(feature = "cli")]
pub mod commands;
pub mod dataset;
pub mod estimators;
pub mod experiment;
pub mod explain;
pub mod external;
pub mod graspers;
mod html;
mod matching;
pub mod mjcf;
pub mod object_report;
pub mod pictures;
pub mod plot;
pub mod progress;
pub mod provenance;
pub mod record;
pub mod robot;
pub mod run_dir;
pub mod scenario;
pub mod score;
pub mod settings;
pub mod setup;
pub mod table;
pub mod trajectory;
pub mod trial;
pub mod workers;

/// The README's program is compiled.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
