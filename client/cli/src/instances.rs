//! Which instance is meant.

use std::fs;
use std::path::Path;

use residual_client::{Instance, InstanceName, Liveness, TableReader, monotonic_ns};

use crate::error::Error;

/// The instance `name`, or the only one in the directory; of several, the only one that lives.
pub fn choose(name: Option<&InstanceName>, directory: &Path) -> Result<Instance, Error> {
    if let Some(name) = name {
        return Ok(Instance::new(name.clone(), directory));
    }
    let mut found = list(directory)?;
    if found.len() > 1 {
        let living: Vec<_> = found
            .iter()
            .filter(|instance| is_alive(instance))
            .cloned()
            .collect();
        if living.len() == 1 {
            found = living;
        }
    }
    match found.as_slice() {
        [] => Err(Error::NoInstance(directory.into())),
        [one] => Ok(one.clone()),
        several => {
            let mut names: Vec<_> = several.iter().map(|instance| instance.name.to_string()).collect();
            names.sort();
            Err(Error::SeveralInstances(names))
        }
    }
}

/// What to add, in parentheses, where a named instance is not there: the ones that are.
pub fn hint(directory: &Path) -> String {
    let mut names: Vec<_> = list(directory)
        .unwrap_or_default()
        .iter()
        .map(|instance| instance.name.to_string())
        .collect();
    names.sort();
    match names.as_slice() {
        [] => format!(
            " (there is no instance in {}; name the daemon's directory with --runtime-directory)",
            directory.display()
        ),
        _ => format!(
            " (the instances in {} are {})",
            directory.display(),
            names.join(", ")
        ),
    }
}

/// All instances that have a bounds table in the directory.
fn list(directory: &Path) -> Result<Vec<Instance>, Error> {
    let failed = |source| Error::RuntimeDirectory {
        directory: directory.into(),
        source,
    };
    let mut found = Vec::new();
    for entry in fs::read_dir(directory).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        // A bounds table's file name is three words with dots between, and the instance is the second.
        let file_name = path
            .file_name()
            .and_then(|name| name.to_str())
            .unwrap_or_default();
        let Some(Ok(name)) = file_name.split('.').nth(1).map(str::parse::<InstanceName>) else {
            continue;
        };
        let instance = Instance::new(name, directory);
        if instance.bounds_path() == path {
            found.push(instance);
        }
    }
    Ok(found)
}

fn is_alive(instance: &Instance) -> bool {
    let table = TableReader::open(&instance.bounds_path());
    table.is_ok_and(|table| table.liveness(monotonic_ns()) == Liveness::Running)
}
