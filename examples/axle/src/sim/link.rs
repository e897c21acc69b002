//! A symbolic link to a pseudo-terminal: a stable name for a path that is new each time.

use std::{
    fs, io,
    os::unix::fs::symlink,
    path::{Path, PathBuf},
};

use crate::failure::Failure;

/// A link, removed when it is dropped.
#[derive(Debug)]
pub(super) struct Link {
    path: PathBuf,
    target: PathBuf,
}

impl Link {
    /// Links `path` to the pseudo-terminal `target`. A stale link of a killed simulation is
    /// replaced: a link to a pseudo-terminal that no longer exists, or that is `target` now.
    ///
    /// Fails if anything else is there.
    pub(super) fn create(path: &Path, target: &Path) -> Result<Self, Failure> {
        let failed =
            |cause: &str| Failure::Failed(format!("cannot create the link {path:?}: {cause}"));
        if let Ok(found) = fs::symlink_metadata(path) {
            if !found.is_symlink() {
                return Err(failed("something else is there"));
            }
            let old = fs::read_link(path).map_err(|error| failed(&error.to_string()))?;
            let is_ours = old.parent() == target.parent();
            if !is_ours {
                return Err(failed(&format!("it is a link to {old:?}")));
            }
            if old != target && old.exists() {
                return Err(failed(&format!("it is a link to {old:?}, which is in use")));
            }
            fs::remove_file(path).map_err(|error| failed(&error.to_string()))?;
        }
        symlink(target, path).map_err(|error| match error.kind() {
            io::ErrorKind::NotFound => failed("no such directory"),
            _ => failed(&error.to_string()),
        })?;
        Ok(Self { path: path.to_owned(), target: target.to_owned() })
    }
}

/// A link that leads elsewhere by now belongs to another simulation.
impl Drop for Link {
    fn drop(&mut self) {
        if fs::read_link(&self.path).is_ok_and(|target| target == self.target) {
            // There is nowhere left to report it.
            let _ = fs::remove_file(&self.path);
        }
    }
}
