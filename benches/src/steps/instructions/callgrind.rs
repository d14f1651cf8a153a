//! Executed instructions of a step, counted by `valgrind --tool=callgrind`.
//!
//! The program runs itself as a child with one case. Callgrind counts only while the child is inside
//! [`super::counted_step`], after the case has been warmed up, so that the count is that of the steps alone and the same in
//! every run. Tools that wrap callgrind (gungraun) need a runner that is installed apart from the program; this needs
//! nothing but valgrind.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};

use super::Child;
use crate::machine::said_by;

/// Where an instruction stands: file of the machine code, address in it.
pub type Place = (String, u64);

/// What callgrind counted.
#[derive(Clone, Debug)]
pub struct Counted {
    /// Steps.
    pub steps: u64,
    /// Instructions executed in them.
    pub instructions: u64,
    /// How often each instruction was executed, if asked for.
    pub executions: HashMap<Place, u64>,
    /// Instructions of each function, without those of the functions that it calls; the dearest first.
    pub functions: Vec<(String, u64)>,
    /// What the child said of itself.
    pub child: Child,
}

/// The version of valgrind; `None` if there is none.
pub fn valgrind() -> Option<String> {
    let version = said_by("valgrind", "--version");
    version.starts_with("valgrind").then_some(version)
}

/// Counts the instructions of `steps` steps of a case after `warm_up` steps; `program` is `residual-bench`.
///
/// # Errors
/// Valgrind or the child failed.
pub fn count(program: &Path, case: &str, warm_up: usize, steps: usize, with_places: bool) -> Result<Counted> {
    let directory = tempfile::tempdir()?;
    let profile = directory.path().join("callgrind.out");
    let mut command = Command::new("valgrind");
    command.args(["--tool=callgrind", "-q", "--toggle-collect=*counted_step*"]);
    command.args(["--compress-strings=no", "--compress-pos=no"]);
    if with_places {
        command.arg("--dump-instr=yes");
    }
    command.arg(option("--callgrind-out-file=", &profile));
    command.arg(program).args(["step-case", case]);
    command.args([warm_up.to_string(), steps.to_string()]);
    let output = command
        .stdin(Stdio::null())
        .output()
        .context("valgrind does not start")?;
    let said = String::from_utf8_lossy(&output.stdout);
    if !output.status.success() {
        let errors = String::from_utf8_lossy(&output.stderr);
        bail!("valgrind ended with {}: {errors}", output.status);
    }
    let child = serde_json::from_str(&said).with_context(|| format!("the child said: {said}"))?;
    let text =
        std::fs::read_to_string(&profile).with_context(|| format!("{} cannot be read", profile.display()))?;
    let lines = costs(&text);
    let counted = Counted {
        steps: steps as u64,
        instructions: total(&text)?,
        executions: if with_places {
            executions(&lines)
        } else {
            HashMap::new()
        },
        functions: functions(&lines),
        child,
    };
    anyhow::ensure!(
        counted.instructions > 0,
        "callgrind has seen no step of \"{case}\""
    );
    Ok(counted)
}

impl Counted {
    /// Instructions of one step.
    pub fn per_step(&self) -> f64 {
        self.instructions as f64 / self.steps as f64
    }
}

fn option(name: &str, path: &Path) -> PathBuf {
    let mut option = std::ffi::OsString::from(name);
    option.push(path);
    option.into()
}

/// The sum over all functions.
fn total(profile: &str) -> Result<u64> {
    let line = profile
        .lines()
        .rev()
        .find_map(|line| line.strip_prefix("totals: "));
    let total = line.context("a profile without totals")?;
    Ok(total.trim().parse()?)
}

/// A line `[0xADDRESS] LINE COUNT` of a profile, with the object and the function that it stands below.
struct Cost<'a> {
    object: &'a str,
    function: &'a str,
    address: Option<u64>,
    count: u64,
}

/// The costs of a profile. The line behind `calls=` is the inclusive cost of a call, which is counted in the callee already.
fn costs(profile: &str) -> Vec<Cost<'_>> {
    let (mut object, mut function) = ("", "");
    let mut is_call = false;
    let mut all = Vec::new();
    for line in profile.lines() {
        if let Some(name) = line.strip_prefix("ob=") {
            object = name;
        } else if let Some(name) = line.strip_prefix("fn=") {
            function = name;
        } else if line.starts_with("calls=") {
            is_call = true;
        } else if line.starts_with(|first: char| first.is_ascii_digit()) {
            let mut fields = line.split(' ');
            let count = fields.next_back().and_then(|count| count.parse().ok());
            let address = fields.next().and_then(|first| first.strip_prefix("0x"));
            if let (false, Some(count)) = (is_call, count) {
                all.push(Cost {
                    object,
                    function,
                    address: address.and_then(|address| u64::from_str_radix(address, 16).ok()),
                    count,
                });
            }
            is_call = false;
        }
    }
    all
}

fn executions(costs: &[Cost<'_>]) -> HashMap<Place, u64> {
    let mut all = HashMap::new();
    for cost in costs {
        if let Some(address) = cost.address {
            *all.entry((cost.object.to_owned(), address)).or_default() += cost.count;
        }
    }
    all
}

fn functions(costs: &[Cost<'_>]) -> Vec<(String, u64)> {
    let mut all: HashMap<&str, u64> = HashMap::new();
    for cost in costs {
        *all.entry(cost.function).or_default() += cost.count;
    }
    let mut all: Vec<(String, u64)> = all
        .into_iter()
        .map(|(name, count)| (name.to_owned(), count))
        .collect();
    all.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    const PROFILE: &str = "\
version: 1\npositions: instr line\nevents: Ir\n\nob=/program\nfl=a.rs\nfn=counted_step\n0x10 5 64\n0x14 6 64\n\
cob=/lib/libm.so\ncfn=exp\ncalls=64 0x20 0\n0x14 6 640\n0x18 7 64\n\nob=/lib/libm.so\nfn=exp\n0x20 0 320\n0x24 0 320\n\n\
totals: 832\n";

    #[test]
    fn inclusive_costs_of_calls_are_not_counted_twice() {
        let costs = costs(PROFILE);
        let executions = executions(&costs);
        assert_eq!(executions.values().sum::<u64>(), total(PROFILE).unwrap());
        assert_eq!(
            functions(&costs),
            [("exp".to_owned(), 640), ("counted_step".to_owned(), 192)]
        );
        assert_eq!(executions[&("/program".to_owned(), 0x14)], 64);
        assert_eq!(executions[&("/lib/libm.so".to_owned(), 0x24)], 320);
    }
}
