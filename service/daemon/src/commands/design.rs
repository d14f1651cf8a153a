//! `residuald design`: finds the gains of a configuration and writes them to a gains file.

use std::fs::Permissions;
use std::io::{self, IsTerminal as _, Write as _};
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use miette::{Diagnostic, IntoDiagnostic as _};
use residual_diagnosis::gains::error::GainsError;
use residual_diagnosis::gains::file::{BEGINNING, GainsFile, TOLERANCE, VERSION};
use time::OffsetDateTime;
use time::format_description::well_known::Rfc3339;

use crate::configuration::build::Design;
use crate::configuration::gains::{parse_gains, read};
use crate::configuration::{Configuration, ConfigurationError, Loaded};
use crate::plot;

/// What `residuald design` takes.
#[derive(Debug, Args)]
pub struct DesignArguments {
    /// The configuration file (TOML).
    pub configuration: PathBuf,
    /// The gains file to write, `-` for standard output; without it the configuration's `gains_file`, else the
    /// configuration's own path with the ending `.gains.toml`.
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Draw the design into SVG files in this directory as well: singular values against frequency, width of the
    /// bounds against time, detectable fault against delay.
    #[arg(long, value_name = "DIRECTORY")]
    pub plot: Option<PathBuf>,
}

/// Why no gains were written.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub enum DesignError {
    /// The configuration is wrong, or its gains cannot be found or do not hold.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Configuration(#[from] ConfigurationError),
    /// The gains have no form in TOML.
    #[error(transparent)]
    Gains(#[from] GainsError),
    /// What stands at the output's path is something else.
    #[error("{} exists and is not a gains file: {reason}", path.display())]
    #[diagnostic(help("choose another file with -o, or remove this one"))]
    NotGains {
        /// The output.
        path: PathBuf,
        /// How that is known.
        reason: String,
    },
    /// The file cannot be written.
    #[error("cannot write {}: {reason}", path.display())]
    #[diagnostic(help("choose a file in a directory that you may write to with -o"))]
    Write {
        /// The output.
        path: PathBuf,
        /// What the operating system says.
        reason: io::Error,
    },
}

/// Executes the command.
///
/// # Errors
/// [`DesignError`].
pub fn execute(arguments: &DesignArguments) -> miette::Result<()> {
    let loaded = Configuration::from_file(&arguments.configuration)?;
    let output = output_of(arguments, &loaded.configuration);
    let to_file = output.as_os_str() != "-";
    if to_file {
        check_replaceable(&output)?;
    }
    let progress = Progress::start();
    let design = loaded.design(&mut |diagnoser, what| progress.show(diagnoser, what))?;
    let text = gains_text(&design, &command(arguments))?;
    progress.show("", "reading back what was found");
    accept(&loaded, &output, &text)?;
    progress.end();
    for entry in &design.entries {
        for warning in &entry.warnings {
            eprintln!("warning: {}: {warning}", entry.name);
        }
    }
    if to_file {
        write_whole(&output, &text)?;
        println!("{}", written(&design, &output));
    } else {
        let all = io::stdout().lock().write_all(text.as_bytes());
        all.map_err(|reason| DesignError::Write { path: output, reason })?;
    }
    if let Some(directory) = &arguments.plot {
        for plot in draw(&loaded.configuration, &design, directory)? {
            eprintln!("{}", plot.display());
        }
    }
    Ok(())
}

/// The gains file of a design as text; `command` is what makes it again.
///
/// # Errors
/// [`GainsError`]: numbers that have no place in the file.
pub fn gains_text(design: &Design, command: &str) -> Result<String, DesignError> {
    let now = OffsetDateTime::now_utc();
    let date = now.replace_nanosecond(0).unwrap_or(now).format(&Rfc3339);
    let file = GainsFile {
        version: VERSION,
        tool: format!("residuald {}", env!("CARGO_PKG_VERSION")),
        date: date.unwrap_or_default(),
        tolerance: TOLERANCE,
        diagnoser: design.entries.clone(),
    };
    Ok(file.to_text(command)?)
}

/// Draws the design of every diagnoser; returns the files.
fn draw(configuration: &Configuration, design: &Design, directory: &Path) -> miette::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    let built = design.entries.iter().zip(&design.diagnosers);
    for (diagnoser, (entry, designed)) in configuration.diagnosers.iter().zip(built) {
        let responses = diagnoser.method.responses(entry.sample_time_s, &entry.gains);
        let responses = responses.into_diagnostic()?;
        let drawn = plot::write(directory, &entry.name, entry.sample_time_s, designed, &responses);
        files.extend(drawn.into_diagnostic()?);
    }
    Ok(files)
}

/// Reads back what was found, just as the daemon will: what is accepted here is accepted there.
fn accept(loaded: &Loaded, output: &Path, text: &str) -> Result<(), ConfigurationError> {
    loaded.on_gains(&output.display().to_string(), text).map(|_| ())
}

fn output_of(arguments: &DesignArguments, configuration: &Configuration) -> PathBuf {
    let configured = || configuration.daemon.gains_file.clone();
    let beside = || arguments.configuration.with_extension("gains.toml");
    arguments
        .output
        .clone()
        .or_else(configured)
        .unwrap_or_else(beside)
}

/// The command that makes the file again, by the names of the files alone.
fn command(arguments: &DesignArguments) -> String {
    let name = |path: &Path| {
        path.file_name()
            .map_or(String::new(), |name| name.to_string_lossy().into_owned())
    };
    let output = match &arguments.output {
        Some(path) if path.as_os_str() != "-" => format!(" -o {}", name(path)),
        _ => String::new(),
    };
    format!("residuald design {}{output}", name(&arguments.configuration))
}

/// Refuses to replace anything but a gains file, which may be damaged, and an empty file.
fn check_replaceable(path: &Path) -> Result<(), DesignError> {
    let refuse = |reason: String| {
        let path = path.to_owned();
        Err(DesignError::NotGains { path, reason })
    };
    if !path.try_exists().unwrap_or(true) {
        return Ok(());
    }
    match read(path) {
        Err(reason) => refuse(reason),
        Ok(text) if text.is_empty() || text.starts_with(BEGINNING) => Ok(()),
        Ok(text) => match parse_gains("", &text) {
            Ok(_) => Ok(()),
            Err(_) => refuse(format!("it does not begin with `{BEGINNING}`")),
        },
    }
}

/// Writes the file whole or not at all, and through a link the file behind it.
fn write_whole(path: &Path, text: &str) -> Result<(), DesignError> {
    let target = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let directory = match target.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let write = || -> io::Result<()> {
        // The process' mask takes from these permissions what its user does not want to give.
        let permissions = Permissions::from_mode(0o666);
        let mut file = tempfile::Builder::new()
            .prefix(".gains-")
            .permissions(permissions)
            .tempfile_in(directory)?;
        file.write_all(text.as_bytes())?;
        file.as_file().sync_all()?;
        file.persist(&target).map_err(|error| error.error)?;
        Ok(())
    };
    write().map_err(|reason| DesignError::Write {
        path: path.to_owned(),
        reason,
    })
}

fn written(design: &Design, output: &Path) -> String {
    let count = match design.entries.len() {
        1 => "1 diagnoser".to_owned(),
        more => format!("{more} diagnosers"),
    };
    format!("{}: gains of {count}, verified", output.display())
}

/// What is being done: a moving line on a terminal, lines of their own elsewhere; on standard error.
struct Progress {
    bar: Option<ProgressBar>,
}

impl Progress {
    fn start() -> Self {
        let bar = io::stderr().is_terminal().then(|| {
            let style = ProgressStyle::with_template("{spinner} {elapsed} {msg}");
            let bar = ProgressBar::new_spinner()
                .with_style(style.unwrap_or_else(|_| ProgressStyle::default_spinner()));
            bar.enable_steady_tick(Duration::from_millis(100));
            bar
        });
        Self { bar }
    }

    fn show(&self, diagnoser: &str, what: &str) {
        let separator = if diagnoser.is_empty() { "" } else { ": " };
        let line = format!("{diagnoser}{separator}{what}");
        match &self.bar {
            Some(bar) => bar.set_message(line),
            None => eprintln!("{line}"),
        }
    }

    fn end(self) {
        if let Some(bar) = self.bar {
            bar.finish_and_clear();
        }
    }
}
