//! Where a measurement takes place: a directory on tmpfs, an instance, its daemon, and how its processes are
//! scheduled.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::thread::{available_parallelism, scope, sleep};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow, bail, ensure};
use clap::Args;
use residual_shared::bounds_table::TableReader;
use residual_shared::names::Instance;
use residual_shared::transport;
use residuald::summary::Summary;
use tempfile::TempDir;

use super::role;
use crate::process::Process;
use crate::processor::{pin, real_time};
use crate::shared_words::SharedWords;

/// The core of the step thread and of the bare timer loop, under real-time scheduling.
pub const STEP_CORE: usize = 1;

/// The core of everybody else.
pub const OTHER_CORE: usize = 0;

/// Priorities under real-time scheduling: whoever measures lets everybody else go first.
pub const STEP_PRIORITY: u8 = 50;
/// Of publishers and writers.
pub const PUBLISHER_PRIORITY: u8 = 40;
/// Of those who look.
pub const CLIENT_PRIORITY: u8 = 30;

/// How long a daemon may take to find its gains and to open its table.
const START_LIMIT: Duration = Duration::from_secs(30);

/// Why processes cannot have cores of their own and SCHED_FIFO; none if they can.
pub fn real_time_refusal() -> Option<String> {
    let cores = available_parallelism().map_or(1, usize::from);
    if cores < 2 {
        return Some("there is only one core".into());
    }
    let tried = on_own_thread(|| pin(STEP_CORE).and_then(|()| real_time(CLIENT_PRIORITY)));
    tried.err().map(|error| {
        format!("{error:#}; run as root, or grant CAP_SYS_NICE (setcap cap_sys_nice=ep) and enough cores")
    })
}

/// A directory on tmpfs with an instance in it and shared words; it and all of the instance disappear with it.
#[derive(Debug)]
pub struct Stage {
    directory: TempDir,
    instance: Instance,
}

/// What a role is told.
#[derive(Clone, Debug, Args)]
pub struct Part {
    /// The stage's directory.
    pub directory: PathBuf,
    /// The stage's instance.
    pub instance: String,
    /// Gives the process a core and SCHED_FIFO.
    #[arg(long)]
    pub real_time: bool,
}

impl Stage {
    /// A new stage with this many shared words.
    ///
    /// # Errors
    /// There is no tmpfs, or no room on it.
    pub fn open(words: usize) -> Result<Self> {
        let directory = tempfile::tempdir_in("/dev/shm").context("a directory in /dev/shm")?;
        let unique = directory.path().file_name().and_then(|name| name.to_str());
        // iceoryx2 needs names of its own in /dev/shm; instances are named in small letters.
        let name = unique.unwrap_or_default().trim_start_matches('.').to_lowercase();
        let name = format!("{name}-{}", std::process::id() % 100_000);
        let instance = Instance::new(name.parse()?, directory.path());
        let file = File::create_new(words_path(directory.path()))?;
        nix::fcntl::posix_fallocate(&file, 0, 8 * i64::try_from(words)?)
            .context("room in /dev/shm for the shared words")?;
        Ok(Self { directory, instance })
    }

    /// Its directory.
    pub fn directory(&self) -> &Path {
        self.directory.path()
    }

    /// Its instance.
    pub fn instance(&self) -> &Instance {
        &self.instance
    }

    /// Its shared words.
    ///
    /// # Errors
    /// The file cannot be mapped.
    pub fn words(&self) -> Result<SharedWords> {
        words(self.directory())
    }

    /// Starts a process with a role on this stage.
    ///
    /// # Errors
    /// It cannot be started.
    pub fn start(&self, role: &str, is_real_time: bool, more: &[String]) -> Result<Process> {
        let mut arguments = vec![
            role::SUBCOMMAND.to_owned(),
            role.to_owned(),
            self.directory().display().to_string(),
            self.instance.name.to_string(),
        ];
        if is_real_time {
            arguments.push("--real-time".into());
        }
        arguments.extend_from_slice(more);
        Process::start(arguments)
    }

    /// Starts the daemon with this configuration; gives it when its table is there.
    ///
    /// # Errors
    /// It refuses the configuration, or does not start in time.
    pub fn start_daemon(&self, configuration: &str) -> Result<Daemon> {
        let path = self.directory().join("daemon.toml");
        fs::write(&path, configuration)?;
        let arguments = [role::SUBCOMMAND, "daemon", &path.display().to_string()];
        let mut process = Process::start(arguments)?;
        let begin = Instant::now();
        while begin.elapsed() < START_LIMIT {
            if let Ok(table) = TableReader::open(&self.instance.bounds_path())
                && table.directory().pid == process.id()
            {
                return Ok(Daemon { process, table });
            }
            ensure!(
                !process.has_ended()?,
                "the daemon ended; its messages stand above"
            );
            sleep(Duration::from_millis(5));
        }
        bail!("the daemon did not start within {} s", START_LIMIT.as_secs());
    }
}

impl Drop for Stage {
    fn drop(&mut self) {
        // What is left then belongs to a process that still lives, and is told below by nobody.
        let _ = transport::remove_leftovers(&self.instance);
    }
}

/// The daemon of a stage; killed when dropped.
#[derive(Debug)]
pub struct Daemon {
    process: Process,
    /// Its bounds table.
    pub table: TableReader,
}

impl Daemon {
    /// Stops it in good order; what it did.
    ///
    /// # Errors
    /// It failed.
    pub fn stop(mut self) -> Result<Summary> {
        self.process.ask_to_end();
        let summary = self.process.said()?;
        self.process.end()?;
        Ok(summary)
    }
}

impl Part {
    /// The instance.
    ///
    /// # Errors
    /// Its name is none.
    pub fn instance(&self) -> Result<Instance> {
        Ok(Instance::new(self.instance.parse()?, &self.directory))
    }

    /// The shared words.
    ///
    /// # Errors
    /// There are none.
    pub fn words(&self) -> Result<SharedWords> {
        words(&self.directory)
    }

    /// Takes a core and a priority, if this part is a real-time one.
    ///
    /// # Errors
    /// They are not to be had.
    pub fn take_seat(&self, core: usize, priority: u8) -> Result<()> {
        if self.real_time {
            pin(core)?;
            real_time(priority)?;
        }
        Ok(())
    }
}

/// Does `work` on a thread of its own, so that this one keeps its scheduling.
///
/// # Errors
/// Those of `work`.
pub fn on_own_thread<T: Send>(work: impl FnOnce() -> Result<T> + Send) -> Result<T> {
    let outcome = scope(|scope| scope.spawn(work).join());
    outcome.unwrap_or_else(|_| Err(anyhow!("the measuring thread failed")))
}

/// Replaces `from` by `to` in a configuration.
///
/// # Errors
/// It does not hold `from`.
pub fn replaced(configuration: &str, from: &str, to: &str) -> Result<String> {
    ensure!(configuration.contains(from), "the configuration has no `{from}`");
    Ok(configuration.replace(from, to))
}

fn words(directory: &Path) -> Result<SharedWords> {
    SharedWords::open(&words_path(directory)).context("the shared words")
}

fn words_path(directory: &Path) -> PathBuf {
    directory.join("words")
}
