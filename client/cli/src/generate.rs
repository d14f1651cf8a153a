//! `residual generate`: shell completions and man pages, from the declaration of the command line.

use std::fs;
use std::io::Write;
use std::path::PathBuf;

use clap::{CommandFactory, Subcommand};
use clap_complete::Shell;

use crate::arguments::Arguments;
use crate::error::Error;

/// What is generated.
#[derive(Debug, Subcommand)]
pub enum Generated {
    /// Writes the completions for a shell to the standard output.
    Completions {
        /// The shell.
        shell: Shell,
    },
    /// Writes a man page for the program and one for each of its subcommands.
    Man {
        /// Where to; made if it does not exist.
        directory: PathBuf,
    },
}

/// Generates it, completions to the output; gives the exit code.
pub fn run(generated: &Generated, output: &mut impl Write) -> Result<u8, Error> {
    let mut command = Arguments::command();
    match generated {
        Generated::Completions { shell } => {
            let name = command.get_name().to_owned();
            let mut script = Vec::new();
            clap_complete::generate(*shell, &mut command, name, &mut script);
            output.write_all(&script)?;
        }
        Generated::Man { directory } => {
            fs::create_dir_all(directory)
                .and_then(|()| clap_mangen::generate_to(command, directory))
                .map_err(|source| Error::ManPages {
                    directory: directory.clone(),
                    source,
                })?;
        }
    }
    Ok(0)
}

#[cfg(test)]
mod tests {
    use std::process::{Command, Output};

    use clap::ValueEnum;

    use super::*;

    fn completions(shell: Shell) -> Vec<u8> {
        let mut script = Vec::new();
        run(&Generated::Completions { shell }, &mut script).unwrap();
        script
    }

    /// Runs a program that a machine may lack; `None`, told in the test's output, if it does.
    fn run_if_there(program: &str, arguments: &[&str]) -> Option<Output> {
        match Command::new(program).args(arguments).output() {
            Ok(output) => Some(output),
            Err(_) => {
                println!("not checked: there is no {program} here");
                None
            }
        }
    }

    #[test]
    fn every_shell_is_told_every_subcommand() {
        for shell in Shell::value_variants() {
            let script = String::from_utf8(completions(*shell)).unwrap();
            for command in Arguments::command().get_subcommands() {
                assert!(
                    script.contains(command.get_name()),
                    "{shell}: {}",
                    command.get_name()
                );
            }
        }
    }

    #[test]
    fn bash_completes_a_subcommand_and_its_options() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("residual.bash");
        fs::write(&path, completions(Shell::Bash)).unwrap();
        let path = path.to_str().unwrap();
        let Some(checked) = run_if_there("bash", &["-n", path]) else {
            return;
        };
        assert!(
            checked.status.success() && checked.stderr.is_empty(),
            "{checked:?}"
        );
        let completed = |words: &str, index: usize, word: &str, before: &str| {
            let program = format!(
                "source {path}; COMP_WORDS=({words}); COMP_CWORD={index}; \
                 _residual residual '{word}' '{before}'; echo \"${{COMPREPLY[@]}}\""
            );
            let output = run_if_there("bash", &["-c", &program]).unwrap();
            String::from_utf8(output.stdout).unwrap().trim().to_owned()
        };
        assert_eq!(completed("residual wat", 1, "wat", "residual"), "watch");
        assert_eq!(
            completed("residual watch --inter", 2, "--inter", "watch"),
            "--interval"
        );
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
        run(&man, &mut Vec::new()).unwrap();
        let command = Arguments::command();
        let mut names = Vec::new();
        pages_of(&command, "residual", &mut names);
        for name in ["residual-ctl-reload.1", "residual-generate-man.1"] {
            assert!(names.contains(&name.into()), "{names:?}");
        }
        for name in names {
            let path = pages.join(&name);
            let page = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{name}: {error}"));
            assert!(page.contains("\n.TH residual"), "{name}: {page}");
            let path = path.to_str().unwrap();
            if let Some(formatted) = run_if_there("groff", &["-man", "-Tutf8", "-ww", "-z", path]) {
                assert!(
                    formatted.status.success() && formatted.stderr.is_empty(),
                    "{formatted:?}"
                );
            }
        }
        let main = fs::read_to_string(pages.join("residual.1")).unwrap();
        assert!(
            main.contains("Exit codes:") && main.contains("there is no living daemon"),
            "{main}"
        );
    }

    #[test]
    fn man_pages_that_cannot_be_written_are_an_error_with_the_place() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let directory = file.path().join("man1");
        let error = run(&Generated::Man { directory }, &mut Vec::new()).unwrap_err();
        assert!(
            error.to_string().contains("man1") && error.exit_code() == 1,
            "{error}"
        );
    }
}
