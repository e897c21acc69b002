//! Prints the messages in a capture of a rover link: `decode_file FILE`.

use std::{env, error::Error, fs};

use axlewire::{
    stream::{Event, decode_capture},
    ucp::Ucp,
};

fn main() -> Result<(), Box<dyn Error>> {
    let path = env::args().nth(1).ok_or("which file?")?;
    let bytes = fs::read(path)?;
    let (events, counters) = decode_capture::<Ucp>(&bytes);
    for (offset, event) in events {
        match event {
            Event::Frame(frame) => println!("{offset:6}  {:?}", frame.message()),
            Event::Skipped(gap) => {
                println!("{offset:6}  {} bytes skipped: {}", gap.len, gap.reason)
            }
        }
    }
    println!("{} frames, {} bytes skipped", counters.frames, counters.skipped());
    Ok(())
}
