//! Helper processes: this test program once more, running one ignored test that is the helper's body.

use std::fs::{self, File};
use std::io::Read as _;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use residual_shared::names::Instance;

use super::Stage;

const NAME: &str = "RESIDUALD_TEST_INSTANCE";
const DIRECTORY: &str = "RESIDUALD_TEST_DIRECTORY";

/// A helper process. It ends in good order when told so, and is killed when dropped before.
pub struct Helper {
    child: Child,
    output: PathBuf,
}

impl Helper {
    /// Starts the ignored test `body` of this program as a process of its own.
    pub fn start(stage: &Stage, body: &str) -> Self {
        Self::start_command(stage, body, &mut Self::command(stage, body))
    }

    /// The command that [`start`](Self::start) starts.
    pub fn command(stage: &Stage, body: &str) -> Command {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command
            .args(["--ignored", "--exact", "--nocapture", "--test-threads=1", body])
            .env(NAME, stage.instance.name.to_string())
            .env(DIRECTORY, &stage.instance.runtime_directory);
        command
    }

    /// Starts a helper from its command, with its output in a file.
    pub fn start_command(stage: &Stage, body: &str, command: &mut Command) -> Self {
        use std::sync::atomic::AtomicU32;
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let output = stage.files.path().join(format!("{body}-{number}"));
        let child = command
            .stdin(Stdio::piped())
            .stdout(File::create(&output).unwrap())
            .spawn()
            .unwrap();
        Self { child, output }
    }

    /// What it wrote so far, whole lines only.
    pub fn lines(&self) -> Vec<String> {
        let text = fs::read_to_string(&self.output).unwrap();
        let whole = text.rfind('\n').map_or("", |end| &text[..end]);
        whole.lines().map(str::to_owned).collect()
    }

    /// Whether it has not ended.
    pub fn is_alive(&mut self) -> bool {
        self.child.try_wait().unwrap().is_none()
    }

    /// Kills it with SIGKILL.
    pub fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// Kills it with SIGKILL; gives the whole lines that it wrote.
    pub fn kill_and_read(mut self) -> Vec<String> {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
        self.lines()
    }

    /// The latest whole lines that it wrote, some hundred bytes of them.
    pub fn last_lines(&self) -> Vec<String> {
        let bytes = fs::read(&self.output).unwrap();
        let text = String::from_utf8_lossy(&bytes[bytes.len().saturating_sub(400)..]).into_owned();
        let whole = text.rfind('\n').map_or("", |end| &text[..end]);
        whole.lines().skip(1).map(str::to_owned).collect()
    }

    /// Ends it in good order; gives what it wrote.
    pub fn finish(mut self) -> Vec<String> {
        drop(self.child.stdin.take());
        let status = self.child.wait().unwrap();
        let lines = self.lines();
        assert!(status.success(), "a helper process failed: {}", lines.join("\n"));
        lines
    }
}

impl Drop for Helper {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The instance of a helper process; none in a process that is no helper.
pub fn instance() -> Option<Instance> {
    let name = std::env::var(NAME).ok()?;
    let directory = std::env::var_os(DIRECTORY)?;
    // The test program has begun a line.
    println!();
    Some(Instance::new(name.parse().unwrap(), directory))
}

/// Becomes true when the starter of this helper process tells it to end, or ends itself.
pub fn told_to_end() -> Arc<AtomicBool> {
    let told = Arc::new(AtomicBool::new(false));
    let tell = Arc::clone(&told);
    std::thread::spawn(move || {
        let _ = std::io::stdin().read(&mut [0]);
        tell.store(true, Ordering::Relaxed);
    });
    told
}
