//! `residuald generate`: shell completions and man pages, from the declaration of the command line.

use std::fs;
use std::io::{self, Write};
use std::path::PathBuf;

use clap::{CommandFactory, Subcommand};
use clap_complete::Shell;
use miette::{Diagnostic, IntoDiagnostic};

use crate::cli::CommandLine;

/// What is generated.
#[derive(Debug, Subcommand)]
pub enum Generated {
    /// Write the completions for a shell to the standard output.
    Completions {
        /// The shell.
        shell: Shell,
    },
    /// Write a man page for the program and one for each of its subcommands.
    Man {
        /// Where to; made if it does not exist.
        directory: PathBuf,
    },
}

/// The man pages cannot be written.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("cannot write man pages to {}: {source}", directory.display())]
#[diagnostic(help("give a directory that this user may write to"))]
pub struct ManPagesError {
    directory: PathBuf,
    source: io::Error,
}

/// Generates it, completions to `output`.
///
/// # Errors
/// [`ManPagesError`]; a failure to write.
pub fn execute(generated: &Generated, output: &mut dyn Write) -> miette::Result<()> {
    let mut command = CommandLine::command();
    match generated {
        Generated::Completions { shell } => {
            let name = command.get_name().to_owned();
            let mut script = Vec::new();
            clap_complete::generate(*shell, &mut command, name, &mut script);
            output.write_all(&script).into_diagnostic()
        }
        Generated::Man { directory } => fs::create_dir_all(directory)
            .and_then(|()| clap_mangen::generate_to(command, directory))
            .map_err(|source| {
                let directory = directory.clone();
                ManPagesError { directory, source }.into()
            }),
    }
}

#[cfg(test)]
mod tests {
    use std::process::{Command, Output};

    use clap::ValueEnum;

    use super::*;

    fn completions(shell: Shell) -> Vec<u8> {
        let mut script = Vec::new();
        execute(&Generated::Completions { shell }, &mut script).unwrap();
        script
    }

    /// Runs a program that a machine may lack; `None`, told in the test's output, if it does.
    fn run_if_there(program: &str, arguments: &[&str]) -> Option<Output> {
        let output = Command::new(program).args(arguments).output().ok();
        if output.is_none() {
            println!("not checked: there is no {program} here");
        }
        output
    }

    #[test]
    fn every_shell_is_told_every_subcommand_and_bash_accepts_it() {
        for shell in Shell::value_variants() {
            let script = String::from_utf8(completions(*shell)).unwrap();
            for command in CommandLine::command().get_subcommands() {
                assert!(
                    script.contains(command.get_name()),
                    "{shell}: {}",
                    command.get_name()
                );
            }
        }
        let file = tempfile::NamedTempFile::new().unwrap();
        fs::write(file.path(), completions(Shell::Bash)).unwrap();
        if let Some(checked) = run_if_there("bash", &["-n", file.path().to_str().unwrap()]) {
            assert!(
                checked.status.success() && checked.stderr.is_empty(),
                "{checked:?}"
            );
        }
    }

    /// The pages of a command and of all subcommands that are shown.
    fn pages_of(command: &clap::Command, name: &str, names: &mut Vec<String>) {
        names.push(format!("{name}.1"));
        for part in command.get_subcommands().filter(|part| !part.is_hide_set()) {
            pages_of(part, &format!("{name}-{}", part.get_name()), names);
        }
    }

    #[test]
    fn every_subcommand_has_a_man_page_that_the_formatter_accepts() {
        let directory = tempfile::tempdir().unwrap();
        let pages = directory.path().join("man1");
        let man = Generated::Man {
            directory: pages.clone(),
        };
        execute(&man, &mut Vec::new()).unwrap();
        let command = CommandLine::command();
        let mut names = Vec::new();
        pages_of(&command, "residuald", &mut names);
        assert!(names.contains(&"residuald-run.1".into()));
        for name in names {
            let path = pages.join(&name);
            let page = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{name}: {error}"));
            assert!(page.contains("\n.TH residuald"), "{name}: {page}");
            if let Some(formatted) =
                run_if_there("groff", &["-man", "-Tutf8", "-ww", "-z", path.to_str().unwrap()])
            {
                assert!(
                    formatted.status.success() && formatted.stderr.is_empty(),
                    "{formatted:?}"
                );
            }
        }
        let main = fs::read_to_string(pages.join("residuald.1")).unwrap();
        assert!(main.contains("Exit codes:"), "{main}");
    }

    #[test]
    fn man_pages_that_cannot_be_written_are_an_error_with_the_place() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let directory = file.path().join("man1");
        let error = execute(&Generated::Man { directory }, &mut Vec::new()).unwrap_err();
        assert!(error.to_string().contains("man1"), "{error}");
    }
}
