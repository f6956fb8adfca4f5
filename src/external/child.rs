//! A process that answers lines with lines.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Longest line that is read, bytes: a hundred objects with a thousand samples each are 20 MB.
const LONGEST_LINE: u64 = 64 << 20;
/// Lines of its stderr that are told when it fails.
const TOLD: usize = 5;
/// How long a process that has closed its output may take to end.
const ENDING: Duration = Duration::from_secs(2);

/// A process, with its pipes.
pub(super) struct LineProcess {
    /// In words, for what goes wrong.
    name: String,
    child: Child,
    stdin: Option<ChildStdin>,
    lines: Receiver<std::io::Result<String>>,
    /// The last lines of its stderr.
    last_words: Arc<Mutex<VecDeque<String>>>,
    /// Whoever reads that.
    listener: Option<JoinHandle<()>>,
}

impl LineProcess {
    /// Starts the program that `words` begins with. What it writes to its stderr goes to the log.
    ///
    /// # Errors
    /// When it cannot be started, in words.
    pub fn start(words: &[String]) -> Result<Self, String> {
        let (program, arguments) = words.split_first().ok_or("no program is named")?;
        let started = Command::new(program)
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn();
        let mut child = started.map_err(|error| format!("{program}: cannot be started: {error}"))?;
        let last_words = Arc::new(Mutex::new(VecDeque::new()));
        let name = words.join(" ");
        let listener = child.stderr.take().map(|stderr| {
            let (last_words, name) = (last_words.clone(), name.clone());
            std::thread::spawn(move || log_lines(stderr, &name, &last_words))
        });
        let (sender, lines) = sync_channel(1);
        if let Some(stdout) = child.stdout.take() {
            std::thread::spawn(move || send_lines(stdout, &sender));
        }
        let stdin = child.stdin.take();
        Ok(Self { name, child, stdin, lines, last_words, listener })
    }

    /// Sends a line, and waits for the one that comes back.
    ///
    /// # Errors
    /// When the process is gone, says nothing within `wait` or says too much, in words.
    pub fn ask(&mut self, line: &str, wait: Duration) -> Result<String, String> {
        let sent = self.stdin.as_mut().map(|stdin| {
            stdin.write_all(line.as_bytes())?;
            stdin.write_all(b"\n")?;
            stdin.flush()
        });
        if !matches!(sent, Some(Ok(()))) {
            return Err(self.gone());
        }
        match self.lines.recv_timeout(wait) {
            Ok(Ok(line)) => Ok(line),
            Ok(Err(error)) => Err(format!("its output cannot be read: {error}")),
            Err(RecvTimeoutError::Timeout) => {
                Err(format!("no answer within {} s{}", wait.as_secs_f64(), self.told()))
            }
            Err(RecvTimeoutError::Disconnected) => Err(self.gone()),
        }
    }

    /// That it has ended, and how.
    fn gone(&mut self) -> String {
        self.stdin = None;
        let until = Instant::now() + ENDING;
        let status: Option<ExitStatus> = loop {
            match self.child.try_wait() {
                Ok(None) if Instant::now() < until => std::thread::sleep(Duration::from_millis(5)),
                status => break status.ok().flatten(),
            }
        };
        // Its last words may still be on their way; a child of its own may never close them.
        let heard = |listener: &JoinHandle<()>| listener.is_finished() || Instant::now() >= until;
        while status.is_some() && self.listener.as_ref().is_some_and(|listener| !heard(listener)) {
            std::thread::sleep(Duration::from_millis(1));
        }
        match status {
            Some(status) => format!("it ended ({status}){}", self.told()),
            None => format!("it closed its output{}", self.told()),
        }
    }

    /// What it wrote to its stderr last.
    fn told(&self) -> String {
        let last = self.last_words.lock().unwrap_or_else(PoisonError::into_inner);
        if last.is_empty() {
            return String::new();
        }
        format!("; its last words: {}", last.iter().cloned().collect::<Vec<_>>().join(" / "))
    }
}

impl Drop for LineProcess {
    /// Closes its input, which tells it to end; kills it when it does not.
    fn drop(&mut self) {
        self.stdin = None;
        let until = Instant::now() + ENDING;
        while matches!(self.child.try_wait(), Ok(None)) && Instant::now() < until {
            std::thread::sleep(Duration::from_millis(5));
        }
        let _ = self.child.kill();
        if let Err(error) = self.child.wait() {
            log::debug!("{}: {error}", self.name);
        }
    }
}

fn log_lines(stderr: impl Read, name: &str, last_words: &Mutex<VecDeque<String>>) {
    for line in BufReader::new(stderr).split(b'\n') {
        let Ok(line) = line else { return };
        let line = String::from_utf8_lossy(&line).trim_end().to_owned();
        log::info!("{name}: {line}");
        let mut last = last_words.lock().unwrap_or_else(PoisonError::into_inner);
        if last.len() == TOLD {
            last.pop_front();
        }
        last.push_back(line);
    }
}

fn send_lines(stdout: impl Read, sender: &SyncSender<std::io::Result<String>>) {
    let mut reader = BufReader::new(stdout);
    loop {
        let mut line = Vec::new();
        let read = reader.by_ref().take(LONGEST_LINE).read_until(b'\n', &mut line);
        let said = match read {
            Ok(0) => return,
            Ok(_) if line.last() != Some(&b'\n') && line.len() as u64 == LONGEST_LINE => {
                Err(std::io::Error::other(format!("a line of more than {} MB", LONGEST_LINE >> 20)))
            }
            Ok(_) => Ok(String::from_utf8_lossy(&line).trim().to_owned()),
            Err(error) => Err(error),
        };
        let ends = said.is_err();
        // Empty lines say nothing.
        if matches!(&said, Ok(line) if line.is_empty()) {
            continue;
        }
        if sender.send(said).is_err() || ends {
            return;
        }
    }
}
