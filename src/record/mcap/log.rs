//! What was decided, and what failed, in words.

use anyhow::Result;

use super::schemas::{Log, LogLevel};
use super::source::Source;
use super::{Out, numbered, timestamp};

/// Says all of it.
///
/// # Errors
/// When a table lacks something.
pub fn tell(source: &Source, out: &mut Out) -> Result<()> {
    let mut lines: Vec<(f64, LogLevel, &str, String)> = Vec::new();
    for look in &source.looks {
        let text = format!("look {}: {}", look.look + 1, look.decision);
        lines.push((look.time_s, LogLevel::Info, "look", text));
    }
    let plans = &source.plans;
    let (found, actions, risks) = (plans.yes("found")?, plans.text("action")?, plans.text("risk")?);
    let (objects, instances) = (plans.text("object")?, plans.whole("instance")?);
    let (stages, reasons) = (plans.text("stage")?, plans.text("reason")?);
    for (row, time_s) in plans.seconds("time_s")?.into_iter().enumerate().filter(|(row, _)| !found[*row]) {
        let name = numbered(&objects[row], instances[row]);
        let (action, risk, stage, reason) = (&actions[row], &risks[row], &stages[row], &reasons[row]);
        let text = format!("no way to {action} {name} ({risk}, {stage}): {reason}");
        lines.push((time_s, LogLevel::Debug, "plan", text));
    }
    let attempts = &source.attempts;
    let (begins, ends) = (attempts.seconds("begin_s")?, attempts.seconds("end_s")?);
    let (done, actions) = (attempts.yes("done")?, attempts.text("action")?);
    let (objects, instances) = (attempts.text("object")?, attempts.whole("instance")?);
    let (steps, reasons) = (attempts.text("failed_step")?, attempts.text("reason")?);
    for row in 0..attempts.rows {
        let (action, name) = (&actions[row], numbered(&objects[row], instances[row]));
        lines.push((begins[row], LogLevel::Info, "attempt", format!("{action} {name}")));
        if done[row] {
            lines.push((ends[row], LogLevel::Info, "attempt", format!("{action} {name}: done")));
        } else {
            let text = format!("{action} {name}: failed at {}: {}", steps[row], reasons[row]);
            lines.push((ends[row], LogLevel::Error, "attempt", text));
        }
    }
    lines.extend(lost(source)?);
    lines.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (time_s, level, name, message) in lines {
        let stamp = timestamp(time_s);
        let line = Log { timestamp: stamp, level, message, name: name.to_owned(), ..Default::default() };
        out.say("/log", time_s, &line);
    }
    Ok(())
}

/// What fell off the table during an attempt; seconds are those of its end.
fn lost(source: &Source) -> Result<Vec<(f64, LogLevel, &'static str, String)>> {
    let (rests, attempts) = (&source.rests, &source.attempts);
    let (numbers, locations) = (rests.whole("attempt")?, rests.text("location")?);
    let (objects, instances) = (rests.text("object")?, rests.whole("instance")?);
    let (all, ends) = (attempts.whole("attempt")?, attempts.seconds("end_s")?);
    let mut lines = Vec::new();
    let mut known = Vec::new();
    for row in (0..rests.rows).filter(|&row| locations[row] == "lost") {
        let name = numbered(&objects[row], instances[row]);
        let end = all.iter().position(|attempt| *attempt == numbers[row]);
        if let Some(end) = end.filter(|_| !known.contains(&name)) {
            lines.push((ends[end], LogLevel::Warning, "rest", format!("{name} is lost")));
            known.push(name);
        }
    }
    Ok(lines)
}
