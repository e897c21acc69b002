//! The guide of the library: its `console` blocks print what they show. `TRYCMD=overwrite` writes
//! what they print into the pages.

#[test]
fn the_commands_of_the_guide_print_what_it_shows() {
    // They are those of a reader at the top of the repository.
    std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).unwrap();
    trycmd::TestCases::new().env("TZ", "UTC").case("src/guide/*.md");
}
