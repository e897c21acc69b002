//! Writes `motors.pcapng` and `drive.pcapng`, two captures that tell a story: `stories FOLDER`.
//!
//! Everything happens on simulated lines in virtual time, and the same program always writes the
//! same bytes. Those in `examples/captures` are its own.

mod capture;
mod drive;
mod motors;

use std::{env, error::Error, fs, path::Path};

fn main() -> Result<(), Box<dyn Error>> {
    let folder = env::args_os().nth(1).ok_or("which folder?")?;
    let stories = [("motors.pcapng", motors::story()?), ("drive.pcapng", drive::story()?)];
    for (name, bytes) in stories {
        write(&Path::new(&folder).join(name), &bytes)?;
        println!("{name}: {} bytes", bytes.len());
    }
    Ok(())
}

/// Writes a whole file or, if that fails, none.
fn write(path: &Path, bytes: &[u8]) -> Result<(), Box<dyn Error>> {
    let part = path.with_extension("part");
    let written = fs::write(&part, bytes).and_then(|()| fs::rename(&part, path));
    written.map_err(|error| {
        // There may be none.
        let _ = fs::remove_file(&part);
        format!("cannot write {path:?}: {error}").into()
    })
}
