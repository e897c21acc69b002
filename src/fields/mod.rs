#![cfg_attr(all(feature = "ikeya", feature = "ucp"), doc = include_str!("../fields.md"))]

mod lines;

pub use crate::{
    field::{Field, Kind, Shape},
    record::Record,
};

/// All objects of `axle decode --json`, each with its fields. It is made of the tables that encode
/// and decode the messages, so it has every message.
pub const FIELDS: &[Record] = &joined::<{ count(PARTS) }>(PARTS);

const PARTS: &[&[Record]] = &[
    #[cfg(feature = "ucp")]
    crate::ucp::fields::RECORDS,
    #[cfg(feature = "ikeya")]
    crate::ikeya::fields::ONE,
    #[cfg(feature = "ikeya")]
    crate::ikeya::fields::THREE,
    lines::RECORDS,
];

const fn count(parts: &[&[Record]]) -> usize {
    match parts {
        [] => 0,
        [first, rest @ ..] => first.len() + count(rest),
    }
}

const fn joined<const N: usize>(parts: &[&[Record]]) -> [Record; N] {
    let mut all = [lines::RECORDS[0]; N];
    let (mut part, mut of_part, mut at) = (0, 0, 0);
    while at < N {
        if of_part < parts[part].len() {
            all[at] = parts[part][of_part];
            (of_part, at) = (of_part + 1, at + 1);
        } else {
            (part, of_part) = (part + 1, 0);
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use core::hint::black_box;

    use super::*;

    #[test]
    fn the_table_is_the_same_when_it_is_joined_while_a_program_runs() {
        let parts = black_box(PARTS);
        assert_eq!(count(parts), FIELDS.len());
        assert_eq!(joined::<{ count(PARTS) }>(parts)[..], *FIELDS);
    }
}
