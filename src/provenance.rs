//! Where a page comes from: which program made it, from which command line, when, and on what machine. Pages have it and no file of
//! results, since those of equal runs are equal.

use std::cell::RefCell;
use std::time::{SystemTime, UNIX_EPOCH};

use crate::campaign::node;
use crate::scenario::{Program, program};
use crate::workers;

thread_local! {
    /// The command line of the verb that runs on this thread.
    static COMMAND: RefCell<Option<Vec<String>>> = const { RefCell::new(None) };
}

/// Does `work`, whose pages say that it was asked for by these words.
pub fn asked_by<T>(words: Vec<String>, work: impl FnOnce() -> T) -> T {
    /// Also when the work panics.
    struct End(Option<Vec<String>>);
    impl Drop for End {
        fn drop(&mut self) {
            COMMAND.set(self.0.take());
        }
    }
    let _end = End(COMMAND.replace(Some(words)));
    work()
}

/// What is known of the making of a page.
#[derive(Debug, Clone)]
pub struct Provenance {
    /// Version, commit, platform.
    pub program: Program,
    /// As a shell would read it. That of the process, where no verb of ours runs.
    pub command: String,
    /// In UTC, such as `2024-02-29 23:59:59 UTC`. Where `SOURCE_DATE_EPOCH` is set it is that moment, so that the same page can be made
    /// again.
    pub date: String,
    /// The model of the processor.
    pub cpu: String,
    /// How many threads it runs.
    pub cores: usize,
}

impl Provenance {
    /// Of a page that is made now.
    pub fn now() -> Self {
        let words = COMMAND
            .with_borrow(Clone::clone)
            .unwrap_or_else(|| std::env::args_os().map(|word| word.to_string_lossy().into_owned()).collect());
        let said = std::env::var("SOURCE_DATE_EPOCH").ok().and_then(|seconds| seconds.parse().ok());
        let now = || SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
        Self {
            program: program(),
            command: command_line(&words),
            date: utc(said.unwrap_or_else(now)),
            cpu: node::cpu(),
            cores: workers::cores(),
        }
    }
}

/// Words as a POSIX shell reads them.
pub fn command_line<S: AsRef<str>>(words: &[S]) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@%".contains(c);
    let quoted = |word: &S| {
        let word = word.as_ref();
        if !word.is_empty() && word.chars().all(plain) {
            word.to_owned()
        } else {
            format!("'{}'", word.replace('\'', r"'\''"))
        }
    };
    words.iter().map(quoted).collect::<Vec<_>>().join(" ")
}

/// Seconds since 1970 as a date of the Gregorian calendar, which repeats every 400 years, 146,097 days. Years begin in March here, so
/// that the leap day is the last one.
fn utc(seconds: u64) -> String {
    let (days, second) = (seconds / 86_400 + 719_468, seconds % 86_400);
    let (era, day) = (days / 146_097, days % 146_097);
    let year = (day - day / 1460 + day / 36_524 - day / 146_096) / 365;
    let day = day - (365 * year + year / 4 - year / 100);
    // Months from March on have 153 days in each five.
    let march = (5 * day + 2) / 153;
    let day = day - (153 * march + 2) / 5 + 1;
    let month = if march < 10 { march + 3 } else { march - 9 };
    let year = 400 * era + year + u64::from(month <= 2);
    let (hour, minute, second) = (second / 3600, second / 60 % 60, second % 60);
    format!("{year:04}-{month:02}-{day:02} {hour:02}:{minute:02}:{second:02} UTC")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_those_of_the_calendar() {
        // By `date -u -d @N`.
        for (seconds, date) in [
            (0, "1970-01-01 00:00:00 UTC"),
            (951_782_400, "2000-02-29 00:00:00 UTC"),
            (1_709_251_199, "2024-02-29 23:59:59 UTC"),
            (1_735_689_599, "2024-12-31 23:59:59 UTC"),
            (4_107_542_400, "2100-03-01 00:00:00 UTC"),
        ] {
            assert_eq!(utc(seconds), date);
        }
    }

    #[test]
    fn a_page_names_the_verb_that_made_it_as_a_shell_reads_it() {
        let words = ["grip", "pack", "--estimator", "mine=cmd:python3 it's.py"].map(str::to_owned).to_vec();
        let made = asked_by(words, Provenance::now);
        assert_eq!(made.command, r"grip pack --estimator 'mine=cmd:python3 it'\''s.py'");
        assert!(!Provenance::now().command.contains("it's"), "the verb has ended");
    }
}
