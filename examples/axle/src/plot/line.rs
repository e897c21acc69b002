//! What is drawn comes from the lines of `axle decode --json`, so that a picture cannot say
//! anything else.

use core::fmt;
use std::collections::BTreeMap;

use serde::{
    Deserialize, Deserializer,
    de::{Error, SeqAccess, Visitor},
};

/// A line: a frame or a gap. Of its fields, those that are drawn; one that a message does not have
/// is empty.
#[derive(Debug, Deserialize)]
pub(super) struct Line<'a> {
    pub(super) event: &'a str,
    pub(super) offset: u64,
    /// Seconds since 1970.
    pub(super) t: Option<f64>,
    pub(super) interface: Option<usize>,
    /// That of the bytes, if the capture says it.
    pub(super) direction: Option<&'a str>,
    /// The name of the message; a gap has none.
    #[serde(default)]
    pub(super) message: &'a str,

    pub(super) node: Option<u8>,
    pub(super) mode: Option<Mode>,
    #[serde(default)]
    pub(super) rps: Numbers,
    #[serde(default)]
    pub(super) count: Numbers,
    #[serde(default)]
    pub(super) rotation: Numbers,

    pub(super) index: Option<u8>,
    pub(super) err: Option<u8>,
    #[serde(default)]
    pub(super) speed: Numbers,
    #[serde(default)]
    pub(super) angular: Numbers,
    #[serde(default)]
    pub(super) battery_pct: Numbers,
    #[serde(default)]
    pub(super) rpm: Numbers,
    #[serde(default)]
    pub(super) acc: Numbers,
    #[serde(default)]
    pub(super) gyro: Numbers,
    #[serde(default)]
    pub(super) mag: Numbers,
    #[serde(default)]
    pub(super) heading: Numbers,
    #[serde(default)]
    pub(super) power_w: Numbers,
    #[serde(default)]
    pub(super) voltage_dv: Numbers,
    #[serde(default)]
    pub(super) current_ca: Numbers,

    /// Why the bytes of a gap were skipped.
    #[serde(default)]
    pub(super) reason: &'a str,
    #[serde(default, borrow)]
    pub(super) reasons: BTreeMap<&'a str, u64>,
}

/// How a command was meant.
#[derive(Clone, Copy, Debug, Deserialize, Eq, PartialEq)]
#[serde(rename_all = "lowercase")]
pub(super) enum Mode {
    Velocity,
    Position,
}

/// The most numbers that a field has.
const MOST: usize = 4;

/// A number, several of them, or none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Numbers {
    numbers: [f64; MOST],
    len: usize,
}

impl Numbers {
    pub(super) fn all(&self) -> &[f64] {
        self.numbers.get(..self.len).unwrap_or(&self.numbers)
    }

    fn push(&mut self, number: f64) {
        if let Some(slot) = self.numbers.get_mut(self.len) {
            *slot = number;
            self.len += 1;
        }
    }

    fn one(number: f64) -> Self {
        let mut one = Self::default();
        one.push(number);
        one
    }

    /// These numbers, then those of another field.
    pub(super) fn beside(&self, other: &Self) -> Self {
        let mut both = *self;
        other.all().iter().for_each(|number| both.push(*number));
        both
    }

    /// Each number of this and of another field, as one.
    pub(super) fn with(&self, other: &Self, join: impl Fn(f64, f64) -> f64) -> Self {
        let mut joined = Self::default();
        self.all().iter().zip(other.all()).for_each(|(one, two)| joined.push(join(*one, *two)));
        joined
    }
}

impl<'de> Deserialize<'de> for Numbers {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ANumberOrMore)
    }
}

struct ANumberOrMore;

impl<'de> Visitor<'de> for ANumberOrMore {
    type Value = Numbers;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number or an array of numbers")
    }

    fn visit_f64<E: Error>(self, number: f64) -> Result<Numbers, E> {
        Ok(Numbers::one(number))
    }

    fn visit_i64<E: Error>(self, number: i64) -> Result<Numbers, E> {
        Ok(Numbers::one(number as f64))
    }

    fn visit_u64<E: Error>(self, number: u64) -> Result<Numbers, E> {
        Ok(Numbers::one(number as f64))
    }

    /// JSON has no number for these.
    fn visit_str<E: Error>(self, text: &str) -> Result<Numbers, E> {
        text.parse().map(Numbers::one).map_err(E::custom)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<Numbers, A::Error> {
        let mut numbers = Numbers::default();
        while let Some(one) = sequence.next_element::<Numbers>()? {
            one.all().iter().for_each(|number| numbers.push(*number));
        }
        Ok(numbers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lines_of_a_listing_are_read() {
        let write = r#"{"event":"frame","offset":33,"t":1.000002,"length":8,"protocol":"ikeya","message":"write","node":1,"rps":1.5,"count":0,"rotation":-2,"payload":"0000803f","bytes":"bb","mode":"velocity"}"#;
        let line: Line<'_> = serde_json::from_str(write).unwrap();
        assert_eq!((line.message, line.node, line.mode), ("write", Some(1), Some(Mode::Velocity)));
        assert_eq!((line.rps.all(), line.rotation.all()), (&[1.5][..], &[-2.0][..]));
        assert!(line.t == Some(1.000_002) && line.rpm.all().is_empty());
        let three = r#"{"event":"frame","offset":0,"rps":[1.0,"nan","-inf"]}"#;
        let line: Line<'_> = serde_json::from_str(three).unwrap();
        let [one, two, three] = line.rps.all() else { panic!("{line:?}") };
        assert!(*one == 1.0 && two.is_nan() && *three == f64::NEG_INFINITY);
        let gap =
            r#"{"event":"skipped","offset":8,"length":4,"reason":"id","reasons":{"id":1,"crc":3}}"#;
        let line: Line<'_> = serde_json::from_str(gap).unwrap();
        assert_eq!((line.reason, line.reasons["crc"]), ("id", 3));
    }
}
