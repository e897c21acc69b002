//! Lines of output about moments: text for people, or one JSON object each.

use std::fmt::Display;

use serde::Serialize;

use crate::{
    failure::Failure,
    teller::{self, Teller},
};

/// The form of the lines.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Form {
    /// The time in seconds, and a sentence.
    Text,
    /// An object with the time in `seconds`.
    Json,
}

impl Form {
    /// The form that --json asks for.
    pub(crate) const fn of(is_json: bool) -> Self {
        if is_json { Self::Json } else { Self::Text }
    }

    /// A line about an event, this many microseconds after the beginning.
    pub(crate) fn line(self, micros: u64, event: &(impl Display + Serialize)) -> String {
        let seconds = micros as f64 / 1e6;
        match self {
            Self::Text => format!("{seconds:7.2} s  {event}"),
            Self::Json => object(&Timed { event, seconds }),
        }
    }

    /// The same without a time.
    pub(crate) fn plain(self, event: &(impl Display + Serialize)) -> String {
        match self {
            Self::Text => event.to_string(),
            Self::Json => object(event),
        }
    }
}

/// How a subcommand ended that has moved something, for --json.
#[derive(Debug, Serialize)]
#[serde(tag = "event", rename = "outcome")]
pub(crate) struct Outcome {
    /// Whether what was moved was measured at rest.
    at_rest: bool,
    /// What went wrong, as on standard error.
    #[serde(skip_serializing_if = "Option::is_none")]
    failure: Option<String>,
}

impl Outcome {
    pub(crate) fn of(result: &Result<(), Failure>, at_rest: bool) -> Self {
        Self { at_rest, failure: result.as_ref().err().map(ToString::to_string) }
    }

    /// Prints it as the last line, for use while nothing moves.
    pub(crate) fn print(&self, form: Form) {
        if form == Form::Json {
            drop(teller::print(&object(self)));
        }
    }

    /// Queues it as the last line. People read the failure on standard error.
    pub(crate) fn say(&self, form: Form, teller: &mut Teller) {
        if form == Form::Json {
            // If the output fails, what was moved has been stopped all the same.
            drop(teller.say(object(self)));
        }
    }
}

#[derive(Serialize)]
struct Timed<'a, E> {
    #[serde(flatten)]
    event: &'a E,
    seconds: f64,
}

/// Events are made of numbers and names, which JSON can say.
fn object(event: &impl Serialize) -> String {
    serde_json::to_string(event).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Serialize)]
    struct Wave {
        height: u8,
    }

    impl Display for Wave {
        fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            write!(f, "a wave of {}", self.height)
        }
    }

    #[test]
    fn a_line_has_the_time_in_seconds_and_the_event() {
        let wave = Wave { height: 3 };
        assert_eq!(Form::of(false).line(1_500_000, &wave), "   1.50 s  a wave of 3");
        assert_eq!(Form::of(true).line(1_500_000, &wave), r#"{"height":3,"seconds":1.5}"#);
        assert_eq!(Form::Text.plain(&wave), "a wave of 3");
        assert_eq!(Form::Json.plain(&wave), r#"{"height":3}"#);
    }
}
