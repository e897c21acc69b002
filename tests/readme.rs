//! The README: what it shares with the docs is the same text, and its example is the real one.

const README: &str = include_str!("../README.md");

#[test]
fn the_guarantees_and_the_features_of_the_readme_are_those_of_the_docs() {
    for shared in [include_str!("../src/guarantees.md"), include_str!("../src/features.md")] {
        assert!(README.contains(shared), "not in the README:\n{shared}");
    }
}

#[test]
fn the_readme_turns_a_motor_with_the_program_that_its_command_runs() {
    let program = include_str!("../examples/host/src/bin/spin.rs");
    let (_, code) = program.split_once("\n\n").expect("its docs end");
    assert!(code.starts_with("use axlewire") && code.ends_with("}\n"));
    assert!(README.contains(&format!("```rust,no_run\n{code}```\n")), "not in the README:\n{code}");
}

#[test]
fn the_table_of_features_has_each_feature_and_says_which_are_default() {
    let manifest = include_str!("../Cargo.toml");
    let (_, features) = manifest.split_once("\n[features]\n").expect("there are features");
    let (features, _) = features.split_once("\n\n").expect("and then something else");
    let mut lines = features.lines().filter(|line| !line.starts_with('#'));
    let default = lines.next().and_then(|line| line.strip_prefix("default = ")).expect("first");
    let mut declared: Vec<String> = lines
        .map(|line| line.split_once(" = ").expect("a feature").0.to_string())
        .map(|name| {
            let is_default = default.contains(&format!("\"{name}\""));
            format!("| `{name}` | {}|", if is_default { "yes " } else { "" })
        })
        .collect();
    let table = include_str!("../src/features.md").lines().skip(2);
    let mut told: Vec<String> =
        table.map(|row| row.splitn(4, '|').take(3).collect::<Vec<_>>().join("|") + "|").collect();
    declared.sort();
    told.sort();
    assert_eq!(declared, told);
}
