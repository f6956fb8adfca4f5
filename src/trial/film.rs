//! Pictures of a trial from outside: the scene before and after, a strip of each attempt with the hand from near by and, if asked for, an
//! animated replay.
//!
//! While the trial runs only poses and contacts are kept; everything is drawn afterwards, without sensor noise, at an exposure of its own.
//! Nothing of this is seen by perception or planning.
//!
//! | file | what it holds |
//! |---|---|
//! | `views` | where the camera outside stands |
//! | `close_up` | the hand and the object, with what presses on it |
//! | `verdict` | why an attempt is no success, in a line |
//! | `replay` | the animated PNG |

mod close_up;
mod replay;
mod verdict;
mod views;

use anyhow::Result;
use grip_manip::StepName;
use grip_physics::World;
use grip_sim::camera::Intrinsics;
use grip_sim::images::RgbImage;
use grip_sim::pose::{Camera, Pose, World as WorldFrame};
use grip_sim::render::{RenderScene, Renderer};
use grip_sim::sensor::color::{develop, metered};

use self::close_up::Subject;
use self::verdict::{When, verdict};
use super::Pictures;
use crate::pictures::{self, Tone};
use crate::progress::Progress;
use crate::score::outcome::{ItemResult, Outcome};
use crate::setup::Setup;

/// Simulated seconds between pictures of the replay: each is shown for a tenth of a second, so four times as fast.
const EVERY_S: f64 = 0.4;
/// Size of a picture.
const STRIP_SIZE: [usize; 2] = [480, 360];
const WHOLE_SIZE: [usize; 2] = [640, 480];
/// How wide the lens outside is, degrees.
const WIDE_DEG: f64 = 55.0;
/// What is to be in the picture above table and bin, metres: what stands there; what is lifted and carried.
const STANDING_M: f64 = 0.15;
const CARRIED_M: f64 = 0.35;
/// About the picture of what went wrong, pixels.
const FRAME: u32 = 6;
const END: &str = "at the end of the trial";
/// More pictures than these and a strip is no longer looked at.
const MOST_SHOTS: usize = 4;

/// A picture of an attempt.
#[derive(Debug)]
pub struct Shot {
    /// What it shows.
    pub caption: String,
    /// The picture.
    pub picture: RgbImage,
}

/// What an attempt looked like.
#[derive(Debug)]
pub struct Strip {
    /// Whom it was for.
    pub object: String,
    /// What was done and what came of it, the object's name first.
    pub title: String,
    /// Whether it went wrong.
    pub failed: bool,
    /// In the order in which they were taken.
    pub shots: Vec<Shot>,
}

/// The scene from outside.
#[derive(Debug)]
pub struct BeforeAfter {
    /// At the start.
    pub before: RgbImage,
    /// When all had come to rest.
    pub after: RgbImage,
}

/// A scene to be drawn, and whether from near by.
struct Moment {
    what: &'static str,
    scene: RenderScene,
    close: Option<Subject>,
}

struct Attempt {
    object: String,
    body: usize,
    /// Whether the object was to be packed: not pushed or put aside.
    packs: bool,
    moments: Vec<Moment>,
    /// The end of the carry, which is shown if something was wrong then.
    carried: Option<Moment>,
    /// By the robot's own account.
    failure: Option<String>,
}

/// The film in the camera.
pub struct Film<'a> {
    setup: &'a Setup,
    before: Option<RenderScene>,
    attempts: Vec<Attempt>,
    /// Scenes of the replay, with what is said of them; none unless it is recorded.
    replay: Option<Vec<(String, RenderScene)>>,
    next_s: f64,
}

impl<'a> Film<'a> {
    /// A film that has the scene at the start on it, if it is to be looked at.
    pub fn new(setup: &'a Setup, world: &World, wanted: Pictures) -> Self {
        let before = (wanted != Pictures::None).then(|| setup.camera.view(world));
        let replay = (wanted == Pictures::All { record: true }).then(Vec::new);
        Self { setup, before, attempts: Vec::new(), replay, next_s: 0.0 }
    }

    fn runs(&self) -> bool {
        self.before.is_some()
    }

    /// An attempt at body `body` begins, whose name is `object`; `packs` if it is to be packed.
    pub fn begin(&mut self, world: &World, body: usize, object: &str, packs: bool) {
        if self.runs() {
            let moments = vec![Moment { what: "before", scene: self.setup.camera.view(world), close: None }];
            let object = object.to_owned();
            self.attempts.push(Attempt { object, body, packs, moments, carried: None, failure: None });
        }
    }

    /// A control period is over.
    pub fn tick(&mut self, world: &World) {
        if let Some(replay) = self.replay.as_mut().filter(|_| world.time() >= self.next_s) {
            let name = self.attempts.last().map_or("", |attempt| attempt.object.as_str());
            replay.push((format!("{:5.1} s  {name}", world.time()), self.setup.camera.view(world)));
            self.next_s = world.time() + EVERY_S;
        }
    }

    /// A step of the attempt is over.
    pub fn step_done(&mut self, world: &World, step: StepName) {
        let what = match step {
            StepName::Close => "contact",
            StepName::Lift => "lift",
            StepName::Carry => "end of the carry",
            StepName::Push => "push",
            StepName::Retreat => "place",
            _ => return,
        };
        let near = matches!(step, StepName::Close | StepName::Carry);
        let Some(body) = self.attempts.last().map(|attempt| attempt.body).filter(|_| self.runs()) else {
            return;
        };
        let moment = self.moment(world, what, near.then_some(body));
        let Some(attempt) = self.attempts.last_mut() else { return };
        if step == StepName::Carry {
            attempt.carried = Some(moment);
        } else {
            attempt.moments.push(moment);
        }
    }

    /// The attempt has failed just now, by the robot's own account.
    pub fn failed(&mut self, world: &World, outcome: Outcome, reason: &str) {
        let Some(body) = self.attempts.last().map(|attempt| attempt.body).filter(|_| self.runs()) else {
            return;
        };
        let moment = self.moment(world, "failure", Some(body));
        if let Some(attempt) = self.attempts.last_mut() {
            // "missed: missed: ..." says it twice.
            let said = reason.starts_with(outcome.words());
            let reason = if said { reason.to_owned() } else { format!("{}: {reason}", outcome.words()) };
            attempt.failure = Some(reason);
            attempt.moments.push(moment);
        }
    }

    fn moment(&self, world: &World, what: &'static str, near: Option<usize>) -> Moment {
        let hand = world.link_pose(self.setup.cell.config.gripper.link);
        let close = near.map(|body| Subject::new(world, body, Some(&hand)));
        Moment { what, scene: self.setup.camera.view(world), close }
    }

    /// The scene before and after, from where table and bin are seen whole.
    ///
    /// # Errors
    /// When the renderer fails.
    pub fn before_after(&self, world: &World, renderer: &mut dyn Renderer) -> Result<Option<BeforeAfter>> {
        let Some(before) = &self.before else { return Ok(None) };
        let mut draw = Drawing::new(self.setup, WHOLE_SIZE, STANDING_M);
        let before = draw.picture(renderer, before)?;
        let after = draw.picture(renderer, &self.setup.camera.view(world))?;
        Ok(Some(BeforeAfter { before, after }))
    }

    /// Draws the strips; `items` are what came of the trial, and `world` how it ended.
    ///
    /// # Errors
    /// When the renderer fails.
    pub fn strips(
        &self,
        world: &World,
        items: &[ItemResult],
        renderer: &mut dyn Renderer,
        progress: &dyn Progress,
    ) -> Result<Vec<Strip>> {
        let mut draw = Drawing::new(self.setup, STRIP_SIZE, CARRIED_M);
        let mut strips = Vec::with_capacity(self.attempts.len());
        for (i, attempt) in self.attempts.iter().enumerate() {
            progress.message(&format!("drawing the film strips: {} of {}", i + 1, self.attempts.len()));
            let last = !self.attempts[i + 1..].iter().any(|later| later.packs && later.body == attempt.body);
            strips.push(self.strip(attempt, last, world, items, (renderer, &mut draw))?);
        }
        for item in items.iter().filter(|_| self.runs()) {
            let told = strips.iter().any(|strip| strip.failed && strip.object == item.name());
            if !told {
                strips.extend(self.left_over(item, world, (renderer, &draw))?);
            }
        }
        Ok(strips)
    }

    /// Of an item that is not packed though no attempt at it failed: where it is at the end.
    fn left_over(
        &self,
        item: &ItemResult,
        world: &World,
        (renderer, draw): (&mut dyn Renderer, &Drawing<'_>),
    ) -> Result<Option<Strip>> {
        let object = item.name();
        let Some((why, _)) = verdict(item, &self.setup.settings.success) else { return Ok(None) };
        let Some(body) = (0..world.object_count()).find(|&body| self.setup.name(body) == object) else {
            return Ok(None);
        };
        let scene = self.setup.camera.view(world);
        let mut picture = draw.close_up(renderer, &scene, &Subject::new(world, body, None))?;
        pictures::frame(&mut picture, FRAME, pictures::BAD);
        let shots = vec![Shot { caption: END.to_owned(), picture }];
        Ok(Some(Strip { title: format!("{object}: {why}"), object, failed: true, shots }))
    }

    fn strip(
        &self,
        attempt: &Attempt,
        last: bool,
        world: &World,
        items: &[ItemResult],
        (renderer, draw): (&mut dyn Renderer, &mut Drawing<'_>),
    ) -> Result<Strip> {
        // What the trial's end says is of the last attempt at an item.
        let item = items.iter().find(|item| attempt.packs && last && item.name() == attempt.object);
        let judged = item.filter(|_| attempt.failure.is_none());
        let judged = judged.and_then(|item| verdict(item, &self.setup.settings.success));
        let mut moments: Vec<&Moment> = attempt.moments.iter().collect();
        let end;
        match &judged {
            Some((_, When::Carry)) => moments.extend(&attempt.carried),
            Some((_, When::End)) => {
                let close = Some(Subject::new(world, attempt.body, None));
                end = Moment { what: END, scene: self.setup.camera.view(world), close };
                moments.push(&end);
            }
            Some((_, When::Grasp)) | None => {}
        }
        if moments.len() > MOST_SHOTS {
            moments.retain(|moment| moment.what != "lift");
        }
        let pushed = attempt.moments.iter().any(|moment| moment.what == "push");
        let mut shots = Vec::new();
        for moment in moments {
            let presses = moment.close.iter().flat_map(|close| &close.presses);
            let forces: Vec<String> = presses.map(|press| format!("{:.0} N", press.newtons())).collect();
            let caption = match (&moment.close, forces.as_slice()) {
                (None, _) if pushed && moment.what == "place" => "after the push".to_owned(),
                (None, _) if !attempt.packs && moment.what == "place" => "put aside".to_owned(),
                (None, _) => moment.what.to_owned(),
                (Some(_), []) if moment.what == END => moment.what.to_owned(),
                (Some(_), []) if moment.what == "contact" => "closed: no finger touches".to_owned(),
                (Some(_), []) => format!("{}: no finger touches", moment.what),
                (Some(_), forces) => format!("{}: {}", moment.what, forces.join(", ")),
            };
            let picture = match &moment.close {
                None => draw.picture(renderer, &moment.scene)?,
                Some(subject) => draw.close_up(renderer, &moment.scene, subject)?,
            };
            shots.push(Shot { caption, picture });
        }
        let failure = attempt.failure.clone().or_else(|| judged.map(|(why, _)| why));
        if let (Some(_), Some(shot)) = (&failure, shots.last_mut()) {
            pictures::frame(&mut shot.picture, FRAME, pictures::BAD);
        }
        let came_of_it = match (&failure, item) {
            (Some(why), _) => format!(": {why}"),
            (None, Some(_)) => ": packed".to_owned(),
            (None, None) if attempt.packs => String::new(),
            (None, None) if pushed => ": pushed".to_owned(),
            (None, None) => ": put aside".to_owned(),
        };
        let title = format!("{}{came_of_it}", attempt.object);
        Ok(Strip { object: attempt.object.clone(), title, failed: failure.is_some(), shots })
    }

    /// Draws the replay as an animated PNG; none if it was not recorded.
    ///
    /// # Errors
    /// When the renderer or the encoder fails.
    pub fn replay(&self, renderer: &mut dyn Renderer, progress: &dyn Progress) -> Result<Option<Vec<u8>>> {
        let Some(scenes) = self.replay.as_ref().filter(|scenes| !scenes.is_empty()) else {
            return Ok(None);
        };
        let mut draw = Drawing::new(self.setup, WHOLE_SIZE, CARRIED_M);
        let mut pictures = Vec::with_capacity(scenes.len());
        for (i, (text, scene)) in scenes.iter().enumerate() {
            progress.message(&format!("drawing the replay: {} of {}", i + 1, scenes.len()));
            let mut picture = draw.picture(renderer, scene)?;
            pictures::write_text(&mut picture, text);
            pictures.push(picture);
        }
        progress.message("writing the replay");
        Ok(Some(replay::animation(&pictures)?))
    }
}

/// Draws scenes as the outside camera sees them, all at the exposure of the first.
struct Drawing<'a> {
    setup: &'a Setup,
    size: [usize; 2],
    lens: Intrinsics,
    world_from_camera: Pose<WorldFrame, Camera>,
    exposure: Option<f32>,
}

impl<'a> Drawing<'a> {
    fn new(setup: &'a Setup, size: [usize; 2], headroom: f64) -> Self {
        let lens = pictures::camera::lens(size, WIDE_DEG);
        let world_from_camera = views::overview(&setup.cell.scene, &lens, headroom);
        Self { setup, size, lens, world_from_camera, exposure: None }
    }

    fn picture(&mut self, renderer: &mut dyn Renderer, scene: &RenderScene) -> Result<RgbImage> {
        let lighting = &self.setup.condition.lighting;
        let rendering = renderer.render(scene, lighting, &self.lens, &self.world_from_camera)?;
        let exposure = *self.exposure.get_or_insert_with(|| metered(&rendering.radiance));
        Ok(develop(&rendering.radiance, exposure))
    }

    fn close_up(
        &self,
        renderer: &mut dyn Renderer,
        scene: &RenderScene,
        subject: &Subject,
    ) -> Result<RgbImage> {
        let lighting = &self.setup.condition.lighting;
        subject.picture(scene, renderer, self.size, |renderer, lens, camera| {
            let rendering = renderer.render(scene, lighting, lens, camera)?;
            Ok(develop(&rendering.radiance, metered(&rendering.radiance)))
        })
    }
}

/// All strips below each other, each below its title; those that went wrong are in red.
pub fn sheet(strips: &[Strip]) -> RgbImage {
    let columns = strips.iter().map(|strip| strip.shots.len()).max().unwrap_or(0).max(1);
    let width = |pictures: &[RgbImage]| pictures.first().map_or(1, RgbImage::width);
    let mut rows = Vec::new();
    for strip in strips {
        let mut cells: Vec<RgbImage> = strip
            .shots
            .iter()
            .map(|shot| pictures::captioned(&shot.picture, &shot.caption, Tone::Plain))
            .collect();
        let blank = RgbImage::from_pixel(width(&cells), 1, image::Rgb([255; 3]));
        cells.resize(columns, blank);
        let row = pictures::sheet(&cells, columns as u32);
        let tone = if strip.failed { Tone::Bad } else { Tone::Title };
        rows.push(pictures::sheet(&[pictures::caption(row.width(), &strip.title, tone), row], 1));
    }
    pictures::sheet(&rows, 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Quiet;
    use crate::setup::SetupOptions;
    use grip_sim::render::{RendererChoice, open};

    #[test]
    fn a_failed_attempt_is_red_and_says_why_and_a_film_that_is_not_wanted_stays_empty() {
        let setup = Setup::load(&SetupOptions { seed: 4, ..SetupOptions::default() }).unwrap();
        let (world, _) = setup.drop_objects().unwrap();
        let mut renderer = open(RendererChoice::Cpu).unwrap();
        let mut film = Film::new(&setup, &world, Pictures::Film);
        for (body, failed) in [(0, true), (1, false)] {
            film.begin(&world, body, &setup.name(body), true);
            film.step_done(&world, StepName::Close);
            film.step_done(&world, StepName::Carry);
            if failed {
                film.failed(
                    &world,
                    Outcome::Missed,
                    "missed: the fingers closed to 2.0 mm, the object is 38.0 mm wide",
                );
            }
        }
        let strips = film.strips(&world, &[], renderer.as_mut(), &Quiet).unwrap();
        let shots = |strip: &Strip| strip.shots.iter().map(|shot| shot.caption.clone()).collect::<Vec<_>>();
        assert_eq!(
            strips[0].title,
            "004_sugar_box: missed: the fingers closed to 2.0 mm, the object is 38.0 mm wide"
        );
        assert_eq!(shots(&strips[0]), ["before", "closed: no finger touches", "failure: no finger touches"]);
        assert_eq!(shots(&strips[1]), ["before", "closed: no finger touches"]);
        assert_eq!([strips[0].failed, strips[1].failed], [true, false]);
        let red = |picture: &RgbImage| picture.pixels().filter(|p| p.0 == pictures::BAD).count();
        let frame = 2 * 6 * (480 + 360 - 12);
        assert!(red(&strips[0].shots[2].picture) >= frame as usize && red(&strips[0].shots[1].picture) == 0);
        // The close-up is of the object: it is in the middle of the picture, where the table was before.
        let [before, near] = [0, 1].map(|k| strips[0].shots[k].picture.get_pixel(240, 180).0);
        assert_ne!(before, near);
        let sheet = sheet(&strips);
        assert!(red(&sheet) > frame as usize + 10_000, "the title is red as well: {}", red(&sheet));

        let mut none = Film::new(&setup, &world, Pictures::None);
        none.begin(&world, 0, "a", true);
        none.step_done(&world, StepName::Close);
        none.failed(&world, Outcome::Missed, "so");
        assert!(none.strips(&world, &[], renderer.as_mut(), &Quiet).unwrap().is_empty());
        assert!(none.before_after(&world, renderer.as_mut()).unwrap().is_none());
    }
}
