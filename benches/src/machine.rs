//! What it was measured on, and under which load.

use std::fs;
use std::process::Command;
use std::thread::available_parallelism;

use serde::{Deserialize, Serialize};

/// The machine of a measurement. What cannot be told is `unknown`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Machine {
    /// Cores that the program may use.
    pub cores: usize,
    /// Name of the processor.
    pub processor: String,
    /// Whether the processor is a virtual one.
    pub is_virtual: bool,
    /// Memory, MiB.
    pub memory_mib: u64,
    /// Kernel and its version.
    pub kernel: String,
    /// The compiler on the path.
    pub compiler: String,
    /// What chooses the clock rate of the cores.
    pub governor: String,
}

impl Machine {
    /// This machine.
    pub fn this() -> Self {
        let processor = read("/proc/cpuinfo");
        Self {
            cores: available_parallelism().map_or(1, usize::from),
            processor: field(&processor, "model name"),
            is_virtual: field(&processor, "flags")
                .split(' ')
                .any(|flag| flag == "hypervisor"),
            memory_mib: field(&read("/proc/meminfo"), "MemTotal")
                .trim_end_matches(" kB")
                .parse()
                .map_or(0, |kilobytes: u64| kilobytes / 1024),
            kernel: format!("Linux {}", read("/proc/sys/kernel/osrelease").trim()),
            compiler: said_by("rustc", "--version"),
            governor: or_unknown(read("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor").trim()),
        }
    }
}

/// Mean number of processes that ran or wanted to run in the last minute.
pub fn load() -> f64 {
    let text = read("/proc/loadavg");
    text.split(' ')
        .next()
        .and_then(|load| load.parse().ok())
        .unwrap_or(f64::NAN)
}

/// The first line that `program argument` prints; `unknown` if it cannot be run.
pub fn said_by(program: &str, argument: &str) -> String {
    let output = Command::new(program).arg(argument).output();
    let text = output.map_or(String::new(), |output| {
        String::from_utf8_lossy(&output.stdout).into_owned()
    });
    or_unknown(text.lines().next().unwrap_or_default())
}

fn read(path: &str) -> String {
    fs::read_to_string(path).unwrap_or_default()
}

/// The value behind `name :` in a file of such lines.
fn field(text: &str, name: &str) -> String {
    let mut values = text.lines().filter_map(|line| line.split_once(':'));
    let value = values.find(|(left, _)| left.trim() == name);
    or_unknown(value.map_or("", |(_, right)| right.trim()))
}

fn or_unknown(text: &str) -> String {
    if text.is_empty() {
        "unknown".to_owned()
    } else {
        text.to_owned()
    }
}
