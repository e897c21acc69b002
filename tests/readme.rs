//! The README: what it shares with the docs is the same text, and its example is the real one.

const README: &str = include_str!("../README.md");

#[test]
fn the_guarantees_and_the_features_of_the_readme_are_those_of_the_docs() {
    for shared in [include_str!("../src/guarantees.md"), include_str!("../src/features.md")] {
        assert!(README.contains(shared), "not in the README:\n{shared}");
    }
}

#[test]
fn the_readme_turns_a_motor_with_the_code_that_its_command_runs() {
    let example = include_str!("../examples/axle/examples/turn.rs");
    let (_, turn) = example.split_once("fn turn<").expect("there is such a function");
    let (turn, _) = turn.split_once("\n}\n").expect("it ends");
    assert!(README.contains(turn), "not in the README:\n{turn}");
}
