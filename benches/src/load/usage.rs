//! What the kernel knows of a process or thread: processor time, memory, page faults.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, Result};
use nix::unistd::{SysconfVar, sysconf};

/// Processor time and page faults so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Usage {
    /// Time in the program.
    pub user: Duration,
    /// Time in the kernel.
    pub system: Duration,
    /// Page faults without reading a disk.
    pub minor_faults: u64,
    /// Page faults that read a disk.
    pub major_faults: u64,
}

impl Usage {
    /// Of a whole process.
    ///
    /// # Errors
    /// It has ended.
    pub fn of_process(pid: u32) -> Result<Self> {
        Self::read(&Path::new("/proc").join(pid.to_string()))
    }

    /// Of the first thread of a process: the daemon's step thread.
    ///
    /// # Errors
    /// The process has ended.
    pub fn of_first_thread(pid: u32) -> Result<Self> {
        Self::read(&first_thread(pid))
    }

    /// Processor time.
    pub fn total(&self) -> Duration {
        self.user + self.system
    }

    /// What has come since `earlier`.
    pub fn since(&self, earlier: &Self) -> Self {
        Self {
            user: self.user.saturating_sub(earlier.user),
            system: self.system.saturating_sub(earlier.system),
            minor_faults: self.minor_faults - earlier.minor_faults,
            major_faults: self.major_faults - earlier.major_faults,
        }
    }

    fn read(directory: &Path) -> Result<Self> {
        let path = directory.join("stat");
        let text = fs::read_to_string(&path).with_context(|| path.display().to_string())?;
        let ticks = sysconf(SysconfVar::CLK_TCK)?.context("no length of a tick")?;
        parse(&text, ticks as f64).with_context(|| format!("{}: {text}", path.display()))
    }
}

/// Fields of proc_pid_stat(5), which are counted behind the name in parentheses.
fn parse(text: &str, ticks_per_second: f64) -> Option<Usage> {
    let (_, behind) = text.rsplit_once(") ")?;
    let fields: Vec<&str> = behind.split(' ').collect();
    // Field n of the manual page is fields[n - 3].
    let field = |number: usize| fields.get(number - 3)?.parse::<u64>().ok();
    let time = |number: usize| Some(Duration::from_secs_f64(field(number)? as f64 / ticks_per_second));
    Some(Usage {
        minor_faults: field(10)?,
        major_faults: field(12)?,
        user: time(14)?,
        system: time(15)?,
    })
}

/// Resident memory of a process, bytes.
///
/// # Errors
/// It has ended.
pub fn resident_bytes(pid: u32) -> Result<u64> {
    let path = Path::new("/proc").join(pid.to_string()).join("status");
    let text = fs::read_to_string(&path).with_context(|| path.display().to_string())?;
    let line = text.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    let kibibytes = line.and_then(|line| line.trim().strip_suffix(" kB")?.trim().parse::<u64>().ok());
    Ok(kibibytes.context("no VmRSS")? * 1024)
}

/// How the first thread of a process is scheduled, for people.
pub fn scheduling(pid: u32) -> String {
    let of = |file: &str, key: &str| {
        let text = fs::read_to_string(first_thread(pid).join(file)).unwrap_or_default();
        let line = text.lines().find(|line| line.starts_with(key)).map(str::to_owned);
        line.and_then(|line| Some(line.rsplit_once([':', ' '])?.1.trim().to_owned()))
            .unwrap_or_else(|| "unknown".to_owned())
    };
    let policy = match of("sched", "policy").as_str() {
        "0" => "SCHED_OTHER".to_owned(),
        "1" => "SCHED_FIFO".to_owned(),
        other => format!("policy {other}"),
    };
    format!(
        "{policy}, processors {}",
        of("status", "Cpus_allowed_list").replace('\t', "")
    )
}

fn first_thread(pid: u32) -> PathBuf {
    Path::new("/proc").join(format!("{pid}/task/{pid}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_of_a_process_with_a_strange_name_is_read() {
        let line = "7 (a) b (c)) S 1 7 7 0 -1 4194304 11 12 13 14 250 50 0 0 20 0 1 0 9 1 1";
        let expected = Usage {
            user: Duration::from_millis(2500),
            system: Duration::from_millis(500),
            minor_faults: 11,
            major_faults: 13,
        };
        assert_eq!(parse(line, 100.0), Some(expected));
    }

    #[test]
    fn this_process_has_memory_and_faults() {
        let pid = std::process::id();
        assert!(resident_bytes(pid).unwrap() > 100_000);
        assert!(Usage::of_process(pid).unwrap().minor_faults > 10);
        assert!(scheduling(pid).contains("processors"));
    }
}
