//! `axle plot`: the curves are what `axle decode --json` says, and bad input leaves no file.

#[cfg(feature = "plot")]
#[path = "plot/curves.rs"]
mod curves;
#[cfg(feature = "plot")]
#[path = "plot/pictures.rs"]
mod pictures;
mod support;

use std::{
    fs,
    path::PathBuf,
    sync::atomic::{AtomicUsize, Ordering},
};

use support::axle;

const CAPTURES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../captures/");

/// A folder of its own, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        static COUNT: AtomicUsize = AtomicUsize::new(0);
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let name = format!("axle-plot-{}-{number}-{name}", std::process::id());
        let path = std::env::temp_dir().join(name);
        fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn path(&self, name: &str) -> String {
        self.0.join(name).to_str().unwrap().to_owned()
    }

    /// Everything in it, hidden files too.
    fn names(&self) -> Vec<String> {
        let names = fs::read_dir(&self.0).unwrap();
        let mut names: Vec<_> =
            names.map(|it| it.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// The single error line of a run that fails with this code.
fn complaint(args: &[&str], code: i32) -> String {
    let output = axle(&[&["plot"], args].concat()).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!((output.status.code(), said.lines().count()), (Some(code), 1), "{args:?}: {said}");
    assert!(output.stdout.is_empty());
    said.trim().strip_prefix("axle: ").unwrap().to_owned()
}

#[cfg(not(feature = "plot"))]
#[test]
fn a_build_without_the_feature_says_which_one_is_missing() {
    let folder = Folder::new("without");
    let capture = PathBuf::from(CAPTURES).join("motors.pcapng");
    let said = complaint(&[capture.to_str().unwrap(), "-o", &folder.path("a.svg")], 2);
    let expected = "this axle was built without the feature plot: build it with --features plot";
    assert_eq!(said, expected);
    assert!(folder.names().is_empty());
}
