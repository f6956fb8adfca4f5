//! What estimators of others say, and what becomes of it.

use std::sync::Arc;

use grip_perception::Workspace;
use grip_sim::camera::Intrinsics;
use grip_sim::frame::CameraFrame;
use grip_sim::images::{DepthImage, RgbImage};

use super::*;
use crate::setup::library;

const HELLO: &str = r#"echo '{"type":"hello","protocol":1,"name":"test"}'"#;

fn models() -> Vec<Arc<ObjectModel>> {
    let library = library(None, &[]).unwrap();
    ["005_tomato_soup_can", "011_banana"].map(|name| library.load(name).unwrap()).into()
}

/// An estimator that is run by `command`.
fn external(command: &str, timeout: Duration) -> (External, Arc<Programs<Estimating>>) {
    let models = models();
    let space = Workspace { min: [0.0; 3], max: [1.0; 3] };
    let programs = Arc::new(Programs::new(Estimating, &command.parse().unwrap(), timeout, models));
    (External { answers: programs.clone(), cell: Some([space; 2]) }, programs)
}

/// An estimator that is a shell script, which has read the greeting.
struct Script {
    _folder: tempfile::TempDir,
    models: Vec<Arc<ObjectModel>>,
    external: External,
    programs: Arc<Programs<Estimating>>,
}

impl Script {
    fn new(text: &str) -> Self {
        Self::that_waits(Duration::from_secs(60), text)
    }

    fn that_waits(timeout: Duration, text: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("estimator.sh");
        std::fs::write(&path, format!("read hello\n{text}\n")).unwrap();
        let (external, programs) = external(&format!("sh '{}'", path.display()), timeout);
        Self { _folder: folder, models: models(), external, programs }
    }

    /// Answers every question with `poses`, as far as what the shell makes of it.
    fn saying(poses: &str) -> Self {
        let answer = format!(r#"{{\"type\":\"poses\",\"id\":$id,\"poses\":[{poses}]}}"#);
        Self::new(&format!(
            "{HELLO}\nwhile read look; do\nid=${{look#*:}}; id=${{id#*:}}; id=${{id%%,*}}\necho \"{answer}\"\ndone"
        ))
    }

    fn look(&self) -> Result<Estimates> {
        let k = Intrinsics { width: 16, height: 16, ..Intrinsics::FETCH };
        let frame = CameraFrame {
            rgb: RgbImage::new(16, 16),
            depth: DepthImage::filled(16, 16, 1.0),
            intrinsics: k,
            world_from_camera: Pose::identity(),
        };
        self.external.look(&Look {
            frame: &frame,
            cameras: &[Pose::identity()],
            before: &Estimates::new(),
            models: &self.models,
            asked: &[0, 1],
            again: false,
            seed: 7,
        })
    }

    fn failure(&self) -> String {
        self.look().unwrap_err().downcast::<EstimatorFailed>().unwrap().0
    }
}

const UNTURNED: &str = r#"\"R\":[1,0,0,0,1,0,0,0,1]"#;

#[test]
fn what_it_says_is_believed_and_its_samples_are_the_spread() {
    let sample = |x: f64| format!(r#"{{{UNTURNED},\"t\":[{x},0,0.8],\"weight\":2}}"#);
    let samples = format!("[{},{}]", sample(0.0), sample(0.006));
    let script = Script::saying(&format!(
        r#"{{\"index\":1,{UNTURNED},\"t\":[0,0,0.8],\"score\":3,\"confidence\":0.7,\"samples\":{samples}}}"#
    ));
    for _ in 0..2 {
        let estimates = script.look().unwrap();
        let [(1, banana)] = estimates.as_slice() else { panic!("{estimates:?}") };
        assert_eq!(banana.best.translation().z, 0.8);
        assert_eq!((banana.score, banana.confidence, banana.there), (3.0, 0.7, true));
        assert_eq!(banana.particles.len(), 2);
        // About the best: half of 6 mm squared.
        assert!((banana.position_std_m - 0.006 / 2f64.sqrt()).abs() < 1e-6, "{}", banana.position_std_m);
    }
    // The process has lived on, and is gone with the estimator, as are its pictures.
    let (waiting, folder) = script.programs.waiting();
    assert_eq!(waiting, 1);
    assert!(folder.join("models/obj_000004.ply").is_file() && folder.join("rgb-0.npy").is_file());
    drop(script);
    assert!(!folder.exists());
}

#[test]
fn what_it_does_wrong_is_told_and_ends_no_more_than_the_trial() {
    let saying = |text: &str| Script::new(text).failure();
    let told = saying("echo out of memory >&2; exit 3");
    assert!(told.contains("it ended (exit status: 3)") && told.contains("out of memory"), "{told}");
    let silent = Script::that_waits(Duration::from_millis(40), "sleep 5").failure();
    assert!(silent.contains("no answer within 0.2 s"), "{silent}");
    assert!(saying("echo hello").contains("not what the protocol says"));
    let other = saying(r#"echo '{"type":"hello","protocol":2,"name":"later"}'"#);
    assert!(other.contains("it speaks protocol 2, and this program 1"), "{other}");
    assert!(saying(&format!("{HELLO}; read look; exit 0")).contains("it ended"));
    let refused = r#"echo '{"type":"error","message":"no GPU"}'"#;
    assert!(saying(&format!("{HELLO}; read look; {refused}")).ends_with("no GPU"));
    let late = r#"echo '{"type":"poses","id":999,"poses":[]}'"#;
    assert!(saying(&format!("{HELLO}; read look; {late}")).contains("answers question 999"));
    let no_program = external("/no/such/program --x", Duration::from_secs(1));
    let missing = Script { external: no_program.0, ..Script::new("") }.failure();
    assert!(missing.contains("cannot be started"), "{missing}");
}

#[test]
fn poses_that_mean_nothing_are_refused_by_field_and_value() {
    let said = |poses: &str| Script::saying(poses).failure();
    let of = |index: usize, rest: &str| format!(r#"{{\"index\":{index},{rest}}}"#);
    let fine = format!(r#"{UNTURNED},\"t\":[0,0,1]"#);
    assert!(said(&of(5, &fine)).contains("index 5: give each of the objects asked for at most once"));
    assert!(said(&format!("{},{}", of(1, &fine), of(1, &fine))).contains("index 1: give each"));
    let stretched = of(0, r#"\"R\":[2,0,0,0,1,0,0,0,1],\"t\":[0,0,1]"#);
    assert!(said(&stretched).contains("index 0: [2.0, 0.0"));
    assert!(
        said(&of(0, &format!(r#"{fine},\"confidence\":1.5"#))).contains("confidence 1.5: must be 0 to 1")
    );
    let sample = format!(r#"{fine},\"samples\":[{{{fine},\"weight\":-1}}]"#);
    assert!(said(&of(0, &sample)).contains("samples[0]: weight -1"));
    assert!(said(&of(0, &format!(r#"{fine},\"sore\":1"#))).contains("unknown field `sore`"));
}
