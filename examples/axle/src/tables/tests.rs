use std::path::Path;

use axlewire::{
    ikeya::{self, NodeId, PositionResponse, three},
    stream::{Frames, Framing},
    ucp::{
        Body, Telemetry, Ucp,
        message::{DocumentReport, FirmwareReport},
    },
};
use serde::Serialize;
use serde_json::{Map, Value, json};

use super::{column::Cell, *};
use crate::{
    decode::{self, Sheet},
    input::{Form, Input},
    listing::{Out, Style},
    pcapng::Direction,
};

/// All rows as lines of `decode --json`, by their numbers.
#[derive(Default)]
struct Lines(BTreeMap<u64, Value>);

impl Sink for Lines {
    fn rows(&mut self, table: &mut Table) -> Result<(), Failure> {
        for (row, number) in table.numbers.iter().enumerate() {
            assert!(self.0.insert(*number, line(table, row)).is_none());
        }
        Ok(())
    }
}

/// A row as a line. Arrays and objects are columns with the names of their fields in front.
fn line(table: &Table, row: usize) -> Value {
    let mut line = Map::new();
    line.insert("event".into(), if table.protocol.is_some() { "frame" } else { "skipped" }.into());
    if let Some(protocol) = table.protocol {
        line.insert("protocol".into(), protocol.name().into());
        line.insert("message".into(), table.message.into());
    }
    for column in &table.columns {
        assert_eq!(column.cells().count(), table.numbers.len(), "{}", column.name);
        let value = match column.cells().nth(row).unwrap() {
            None => continue,
            Some(Cell::Integer(value)) => json!(value),
            Some(Cell::Unsigned(value)) => json!(value),
            // As its shortest digits, which a wider number would not have.
            Some(Cell::Float(value)) if value.is_finite() => {
                serde_json::from_str(&serde_json::to_string(&value).unwrap()).unwrap()
            }
            Some(Cell::Float(value)) => json!(value.to_string().to_lowercase()),
            Some(Cell::Time(value)) => json!(value as f64 / 1e6),
            Some(Cell::Name(value)) => json!(value),
            Some(Cell::Bytes(value)) => {
                json!(value.iter().map(|byte| format!("{byte:02x}")).collect::<String>())
            }
        };
        match column.name.split_once("reasons_") {
            Some((_, name)) => line.entry("reasons").or_insert(json!({}))[name] = value,
            None => match column.name.rsplit_once('_') {
                Some((array, at)) if at.parse::<u8>().is_ok() => {
                    let values = line.entry(array).or_insert(json!([]));
                    values.as_array_mut().unwrap().push(value);
                }
                _ => drop(line.insert(column.name.clone(), value)),
            },
        }
    }
    line.into()
}

/// The rows of a capture, and the lines of its listing.
fn both(path: &Path, named: Option<Protocol>) -> (Vec<Value>, Vec<Value>) {
    let mut input = Input::open_one(Some(path), Form::default()).unwrap();
    let chosen = decode::choose(&mut input, named).unwrap();
    let mut rows = Lines::default();
    decode::walk_into(&mut input, &chosen, &mut rows, || Ok(())).unwrap();

    let mut input = Input::open_one(Some(path), Form::default()).unwrap();
    let chosen = decode::choose(&mut input, named).unwrap();
    let mut sheet = Sheet::new(Some(Style::Json));
    chosen.walk(&mut input, &mut sheet, |_, _| Ok(())).unwrap();
    let lines = String::from_utf8(sheet.out.0).unwrap();
    let lines = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    (rows.0.into_values().collect(), lines)
}

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

fn example(name: &str) -> Vec<u8> {
    std::fs::read(format!("{ROOT}/examples/captures/{name}")).unwrap()
}

/// The recorded frames, with noise behind each.
fn vectors() -> Vec<(Vec<u8>, Option<Protocol>)> {
    let mut inputs = Vec::new();
    for name in ["ucp", "ikeya"] {
        let text = std::fs::read_to_string(format!("{ROOT}/tests/vectors/{name}.jsonl")).unwrap();
        let vectors: Vec<Value> =
            text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        for (of, protocol) in [
            ("ucp", Protocol::Ucp),
            ("ikeya-md", Protocol::Ikeya),
            ("ikeya-md-3motor", Protocol::Ikeya3),
        ] {
            let mut bytes = Vec::new();
            for vector in vectors.iter().filter(|vector| vector["protocol"] == of) {
                let digits = vector["hex"].as_str().unwrap().as_bytes();
                let hex =
                    |pair: &[u8]| u8::from_str_radix(str::from_utf8(pair).unwrap(), 16).unwrap();
                bytes.extend(digits.chunks(2).map(hex));
                // Noise behind each, so that no damaged one takes the next with it.
                bytes.extend([0; 64]);
            }
            if !bytes.is_empty() {
                inputs.push((bytes, Some(protocol)));
            }
        }
    }
    inputs
}

#[test]
fn the_rows_of_every_capture_and_vector_are_the_lines_of_its_listing() {
    let mut inputs = vectors();
    for name in ["ucp", "ikeya"] {
        inputs.push((example(&format!("{name}.bin")), None));
    }
    assert_eq!(inputs.len(), 5);
    let mut count = 0;
    for (at, (bytes, protocol)) in inputs.into_iter().enumerate() {
        let path = std::env::temp_dir().join(format!("axle-{}-tables-{at}", std::process::id()));
        std::fs::write(&path, bytes).unwrap();
        let (rows, lines) = both(&path, protocol);
        std::fs::remove_file(path).unwrap();
        assert_eq!(rows.len(), lines.len());
        for (row, line) in rows.iter().zip(&lines) {
            assert_eq!(row, line);
        }
        count += rows.len();
    }
    assert!(count > 300, "{count}");
}

/// A frame that serialises itself, whatever it is.
#[derive(Clone, Copy, Serialize)]
#[serde(transparent)]
struct Plain<S>(S);

impl<S: Shown> Shown for Plain<S> {
    const PROTOCOL: Protocol = S::PROTOCOL;

    fn name(&self) -> &'static str {
        self.0.name()
    }

    fn bytes(&self) -> &[u8] {
        self.0.bytes()
    }

    fn number(&self) -> u8 {
        self.0.number()
    }

    fn contents(&self, out: &mut Out, modes: &Modes) {
        self.0.contents(out, modes);
    }

    fn commands(&self) -> Option<NodeId> {
        self.0.commands()
    }
}

/// Table, partition, numbers and columns.
type Rows = (String, Option<Partition>, Vec<u64>, Vec<Column>);

#[derive(Default)]
struct Batches(Vec<Rows>);

impl Sink for Batches {
    fn rows(&mut self, table: &mut Table) -> Result<(), Failure> {
        let columns = table.columns.iter_mut().map(Column::take).collect();
        let numbers = mem::take(&mut table.numbers);
        self.0.push((table.name.clone(), table.partition.clone(), numbers, columns));
        Ok(())
    }
}

/// Checks that the frames in these bytes fill the same batches on both ways; returns their rows.
fn same_batches<F: Framing>(bytes: &[u8], has_times: bool, in_partitions: bool) -> usize
where
    for<'a> F::Frame<'a>: Shown,
{
    let mut tables = [(); 2].map(|()| Tables::new(has_times, in_partitions));
    let mut batches = [(); 2].map(|()| Batches::default());
    let (mut modes, mut count) = (Modes::default(), 0);
    let lines: [Rc<str>; 2] = ["a".into(), "b".into()];
    Frames::<F>::new(bytes).each(|frame| {
        count += 1;
        let direction = [None, Some(Direction::In), Some(Direction::Out)][count as usize % 3];
        let at = Place {
            offset: 9 * count,
            micros: (has_times && count % 7 > 0).then_some(count / 50 % 3 * DAY_US + count),
            interface: (has_times && count % 5 > 0).then_some(count as usize % 2),
            direction: direction.filter(|_| has_times),
        };
        tables.iter_mut().for_each(|it| it.turn_to(&lines[count as usize / 40 % 2]));
        tables[0].frame(at, &frame, &modes);
        tables[1].frame(at, &Plain(frame), &modes);
        frame.teach(&mut modes);
        for (tables, batches) in tables.iter_mut().zip(&mut batches) {
            tables.give_full(batches).unwrap();
        }
    });
    for (tables, batches) in tables.iter_mut().zip(&mut batches) {
        tables.give_rest(batches).unwrap();
    }
    let [fast, plain] = batches;
    assert_eq!(fast.0.len(), plain.0.len());
    for (fast, plain) in fast.0.iter().zip(&plain.0) {
        assert_eq!((&fast.0, &fast.1, &fast.2), (&plain.0, &plain.1, &plain.2));
        for (fast, plain) in fast.3.iter().zip(&plain.3) {
            match (&fast.values, &plain.values) {
                (Values::Float(values), Values::Float(others)) => {
                    let bits = |all: &[f32]| all.iter().map(|it| it.to_bits()).collect::<Vec<_>>();
                    assert_eq!(bits(values), bits(others), "{}", fast.name);
                    assert_eq!(fast.present, plain.present, "{}", fast.name);
                }
                _ => assert!(fast == plain, "{}", fast.name),
            }
        }
    }
    count as usize
}

/// Numbers that repeat late.
fn noise() -> impl FnMut() -> u64 {
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state
    }
}

#[test]
fn frames_that_come_often_fill_their_columns_as_if_they_serialised_themselves() {
    let mut inputs = vectors();
    let pieces = inputs.iter().flat_map(|(bytes, _)| bytes.chunks(8)).map(Vec::from);
    let pieces: Vec<Vec<u8>> = pieces.collect();
    for name in ["ucp.bin", "ikeya.bin", "drive.pcapng", "motors.pcapng"] {
        inputs.push((example(name), None));
    }
    let (mut next, mut bytes) = (noise(), Vec::new());
    for _ in 0..5000 {
        let mut some = || next() as i16;
        let telemetry = Telemetry {
            battery_pct: some() as u16,
            rpm: [(); 4].map(|()| some()),
            acc: [(); 3].map(|()| some()),
            gyro: [(); 3].map(|()| some()),
            mag: [(); 3].map(|()| some()),
            heading_deg: some(),
            power_w: some() as u8,
            voltage_dv: some() as u8,
            current_ca: some() as u16,
        };
        let (index, version) = (some() as u8, some() as u16);
        let node = NodeId::ALL[usize::from(index % 8)];
        match next() % 20 {
            0 => bytes.extend(DocumentReport::new(&telemetry).frame(index).as_bytes()),
            1 => bytes.extend(&pieces[next() as usize % pieces.len()]),
            2..5 => {
                let at = ikeya::Position::new(telemetry.heading_deg, telemetry.rpm[0]);
                bytes.extend(PositionResponse::new(node, at).as_bytes());
            }
            _ => bytes.extend(FirmwareReport::new(&telemetry, version).frame(index).as_bytes()),
        }
    }
    inputs.push((bytes, None));
    for (bytes, _) in inputs {
        let mut count = 0;
        for (has_times, in_partitions) in [(false, false), (true, false), (true, true)] {
            count += same_batches::<Ucp>(&bytes, has_times, in_partitions);
            count += same_batches::<ikeya::ToMaster>(&bytes, has_times, in_partitions);
            count += same_batches::<ikeya::BothDirections>(&bytes, has_times, in_partitions);
            count += same_batches::<three::BothDirections>(&bytes, has_times, in_partitions);
        }
        assert!(count > 40, "{count}");
    }
}

#[test]
fn a_batch_of_frames_that_come_often_is_full_and_the_rest_follows() {
    let report = FirmwareReport::new(&Telemetry::default(), 38).frame(1);
    let bytes = report.as_bytes().repeat(BATCH + 300);
    assert_eq!(same_batches::<Ucp>(&bytes, false, false), BATCH + 300);
}
