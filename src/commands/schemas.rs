//! JSON Schemas of the files that are read and written, from the types that read and write them.

use crate::benchmark::{FileBox, PosteriorLine};
use crate::campaign::{self, CampaignFile, unit};
use crate::dataset;
use crate::estimators::external::protocol::{Reply, Request};
use crate::experiment::plan::{self, ExperimentFile};
use crate::experiment::sweep::{self, GraspLine, SweepFile};
use crate::experiment::trials::{LeftOut, TimingLine};
use crate::graspers::protocol as graspers;
use crate::object_report::{self, ObjectReport};
use crate::record::{self, Event, RecordFile};
use crate::scenario::{self, ScenarioFile};
use crate::score::outcome::{TRIAL_SCHEMA, TrialResult};
use crate::settings::Settings;
use crate::trajectory::{self, TrajectoryFile};
use grip_manip::grasp::GraspFile;
use grip_perception::DetectorDescription;
use grip_sim::bop;
use grip_sim::bop::coco::Coco;
use grip_sim::condition::ConditionSpec;
use grip_sim::objects::table::{self, ObjectTable};
use grip_sim::robot::RobotConfigFile;
use grip_sim::scene::{self, Scene};
use schemars::JsonSchema;
use schemars::generate::{Contract, SchemaSettings};
use serde_json::{Value, json};

use super::{
    convergence, detect, estimate, eval, explain, objects, plan as planning, render, reproduce, robot,
    scenes, trials,
};

/// Every schema (draft 2020-12), by the name of its file: `scene` is that of `scene.json` in `docs/schemas`.
pub fn all() -> Vec<(&'static str, Value)> {
    vec![
        // What people write.
        ("scene", read::<Scene>(Some(scene::SCHEMA))),
        ("condition", read::<ConditionSpec>(None)),
        ("object-table", read::<ObjectTable>(Some(table::SCHEMA))),
        ("robot-config", read::<RobotConfigFile>(None)),
        ("settings", read::<Settings>(None)),
        ("detector", read::<DetectorDescription>(Some(DetectorDescription::SCHEMA))),
        ("grasps", read::<GraspFile>(Some(GraspFile::SCHEMA))),
        // What an estimator of others is told, and what it may say.
        ("estimator-request", written::<Request<'_>>(None)),
        ("estimator-reply", read::<Reply>(None)),
        // The same for a grasp planner.
        ("grasper-request", written::<graspers::Request<'_>>(None)),
        ("grasper-reply", read::<graspers::Reply>(None)),
        // A trial.
        ("trial", written::<TrialResult>(Some(TRIAL_SCHEMA))),
        ("scenario", written::<ScenarioFile<'_>>(Some(scenario::SCHEMA))),
        ("record", written::<RecordFile>(Some(record::SCHEMA))),
        ("record-event", written::<Event>(None)),
        // Experiments.
        ("experiment", written::<ExperimentFile<'_>>(Some(plan::SCHEMA))),
        ("experiment-timing", written::<TimingLine>(None)),
        ("experiment-left-out", written::<LeftOut>(None)),
        ("sweep", written::<SweepFile<'_>>(Some(sweep::SCHEMA))),
        ("sweep-grasp", written::<GraspLine>(None)),
        // Campaigns.
        ("campaign-file", read::<CampaignFile>(None)),
        ("campaign", written::<campaign::Manifest>(Some(campaign::manifest::SCHEMA))),
        ("campaign-unit", written::<unit::DoneFile>(Some(unit::SCHEMA))),
        ("campaign-failed", written::<unit::FailedFile>(Some(unit::FAILED_SCHEMA))),
        // A planned motion.
        ("trajectory", written::<TrajectoryFile>(Some(trajectory::SCHEMA))),
        // Data sets.
        ("dataset", written::<dataset::Plan>(Some(dataset::SCHEMA))),
        ("dataset-scene", written::<dataset::SceneFile<'_>>(Some(dataset::SCENE_SCHEMA))),
        ("camera", written::<render::CameraFile<'_>>(Some(render::SCHEMA))),
        ("bop-camera", read::<bop::CameraFile>(None)),
        ("bop-scene-camera", read::<bop::SceneCamera>(None)),
        ("bop-scene-gt", read::<bop::SceneGt>(None)),
        ("bop-scene-gt-info", read::<bop::SceneGtInfo>(None)),
        ("bop-models-info", read::<bop::ModelsFile>(None)),
        ("bop-targets", read::<Vec<bop::Target>>(None)),
        ("coco", written::<Coco>(None)),
        ("boxes", read::<Vec<FileBox>>(None)),
        ("posteriors", read::<PosteriorLine>(None)),
        // What `--json` prints.
        ("campaign-status", written::<campaign::status::Status>(Some(campaign::status::SCHEMA))),
        ("campaign-merge", written::<campaign::merge::Merged>(Some(campaign::merge::SCHEMA))),
        ("convergence", written::<convergence::ConvergenceReport<'_>>(Some(convergence::SCHEMA))),
        ("detect", written::<detect::DetectReport<'_>>(Some(detect::SCHEMA))),
        ("detect-image", written::<detect::ImageReport<'_>>(Some(detect::IMAGE_SCHEMA))),
        ("estimate", written::<estimate::EstimateReport<'_>>(Some(estimate::SCHEMA))),
        ("eval", written::<eval::EvalReport<'_>>(Some(eval::SCHEMA))),
        ("experiment-summary", written::<trials::ExperimentSummary>(Some(trials::SUMMARY_SCHEMA))),
        ("explain", written::<explain::ExplainReport<'_>>(Some(explain::SCHEMA))),
        ("object-report", written::<ObjectReport<'_>>(Some(object_report::SCHEMA))),
        ("objects", written::<objects::ObjectList<'_>>(Some(objects::SCHEMA))),
        ("plan", written::<planning::PlanReport<'_>>(Some(planning::SCHEMA))),
        ("robot", written::<robot::RobotReport<'_>>(Some(robot::SCHEMA))),
        ("scenes", written::<scenes::ScenesReport<'_>>(Some(scenes::SCHEMA))),
        ("table1", written::<reproduce::Table1<'_>>(Some(reproduce::SCHEMA))),
        ("sweep-summary", written::<super::sweep::SweepSummary<'_>>(Some(super::sweep::SUMMARY_SCHEMA))),
    ]
}

/// Of files that are read.
fn read<T: JsonSchema>(version: Option<&str>) -> Value {
    schema::<T>(Contract::Deserialize, version)
}

/// Of files that are written.
fn written<T: JsonSchema>(version: Option<&str>) -> Value {
    schema::<T>(Contract::Serialize, version)
}

/// `version` is what the field `schema` must be.
fn schema<T: JsonSchema>(contract: Contract, version: Option<&str>) -> Value {
    let mut settings = SchemaSettings::draft2020_12();
    settings.contract = contract;
    let mut schema = settings.into_generator().into_root_schema_for::<T>().to_value();
    if let Some(version) = version {
        schema["properties"]["schema"] = json!({ "const": version });
    }
    schema
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::path::Path;

    use super::*;

    /// Those in the documentation are those of the types.
    #[test]
    fn the_schemas_in_the_documentation_are_current() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/schemas");
        let wanted: BTreeMap<String, String> = all()
            .into_iter()
            .map(|(name, schema)| {
                (format!("{name}.json"), serde_json::to_string_pretty(&schema).unwrap() + "\n")
            })
            .collect();
        if std::env::var_os("GRIP_UPDATE_DOCS").is_some() {
            let _ = std::fs::remove_dir_all(&folder);
            std::fs::create_dir_all(&folder).unwrap();
            wanted.iter().for_each(|(name, text)| std::fs::write(folder.join(name), text).unwrap());
        }
        let found: BTreeMap<String, String> = std::fs::read_dir(&folder)
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .map(|path| {
                let name = path.file_name().unwrap().to_string_lossy().into_owned();
                (name, std::fs::read_to_string(&path).unwrap())
            })
            .collect();
        let how = "run `GRIP_UPDATE_DOCS=1 cargo test --release --lib schemas` and commit what it writes";
        assert!(wanted.keys().eq(found.keys()), "docs/schemas has other files: {how}");
        for (name, text) in &wanted {
            assert_eq!(text, &found[name], "docs/schemas/{name}: {how}");
        }
    }
}
