//! Which peers are there, and what to install for the others.

use std::env;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result};

/// Where sources and installed peers are.
#[derive(Clone, Debug)]
pub struct Environment {
    /// `benches/peers`.
    pub sources: PathBuf,
    /// `peers` beside the profiles of Cargo's target directory: what `install.sh` has installed, what is compiled here.
    pub installed: PathBuf,
}

/// Why a peer is left out: a sentence for the report.
pub type Absent = String;

const INSTALL: &str = "run `benches/peers/install.sh`";

impl Environment {
    /// The directories of this build.
    ///
    /// # Errors
    /// The path of this program is not known.
    pub fn find() -> Result<Self> {
        let program = env::current_exe().context("this program's own path")?;
        let target = program.parent().and_then(Path::parent);
        Ok(Self {
            sources: Path::new(env!("CARGO_MANIFEST_DIR")).join("peers"),
            installed: target
                .context("this program does not lie in a target directory")?
                .join("peers"),
        })
    }

    /// The interpreter of the virtual environment that `install.sh` made, else `python3`; it can import `package`.
    ///
    /// # Errors
    /// There is none, with what to install.
    pub fn python(&self, package: &str) -> Result<PathBuf, Absent> {
        let own = self.installed.join("python/bin/python");
        let interpreters = [own, PathBuf::from("python3")];
        let imports =
            |python: &&PathBuf| succeeds(Command::new(python).arg("-c").arg(format!("import {package}")));
        let found = interpreters.iter().find(imports);
        found.cloned().ok_or_else(|| {
            format!("no Python with the package {package}; {INSTALL}, or pip install {package}")
        })
    }

    /// `g++` and the directory of Eigen's headers.
    ///
    /// # Errors
    /// One of them is missing, with what to install.
    pub fn eigen(&self) -> Result<PathBuf, Absent> {
        if !succeeds(Command::new("g++").arg("--version")) {
            return Err(format!("no g++; {INSTALL}, or apt-get install g++"));
        }
        let directories = ["/usr/include/eigen3", "/usr/local/include/eigen3"].map(PathBuf::from);
        let found = directories
            .into_iter()
            .find(|directory| directory.join("Eigen/Dense").is_file());
        found.ok_or_else(|| format!("no headers of Eigen; {INSTALL}, or apt-get install libeigen3-dev"))
    }

    /// Cyclone DDS's `ddsperf`.
    ///
    /// # Errors
    /// It is not on the path, with what to install.
    pub fn ddsperf(&self) -> Result<PathBuf, Absent> {
        let directories = env::var_os("PATH").unwrap_or_default();
        let mut programs = env::split_paths(&directories).map(|directory| directory.join("ddsperf"));
        programs
            .find(|program| program.is_file())
            .ok_or_else(|| format!("no ddsperf; {INSTALL}, or apt-get install cyclonedds-tools"))
    }

    /// The program in `benches/peers/zenoh`.
    ///
    /// # Errors
    /// It has not been built, with what to do.
    pub fn zenoh(&self) -> Result<PathBuf, Absent> {
        let program = self.installed.join("zenoh/release/zenoh-latency");
        match program.is_file() {
            true => Ok(program),
            false => Err(format!(
                "zenoh-latency has not been built; {INSTALL} (compiles some 250 crates)"
            )),
        }
    }
}

fn succeeds(command: &mut Command) -> bool {
    let status = command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    status.is_ok_and(|status| status.success())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_there_is_named_with_what_to_install() {
        let nowhere = Environment {
            sources: PathBuf::from("/nonexistent"),
            installed: PathBuf::from("/nonexistent"),
        };
        let absent = nowhere.python("a_package_that_nobody_has").unwrap_err();
        assert!(absent.contains("install.sh") && absent.contains("a_package_that_nobody_has"));
        assert!(nowhere.zenoh().unwrap_err().contains("install.sh"));
    }
}
