//! CRC-16/MODBUS of 2 to 4096 bytes: ours, C and the `crc` crate.
//!
//! The CRC covers 6 bytes of an Ikeya packet and 42 of a UCP report. All are called through a
//! function pointer, as C must be, at the same cost for each.

use std::hint::black_box;

use axlewire::crc16;
use axlewire_contenders::{reference, streams::Rng};
use crc::{CRC_16_MODBUS, Crc, NoTable, Table};
use criterion::{Criterion, Throughput};

mod measure;
use measure::{criterion, measure};

const LENGTHS: [usize; 7] = [2, 6, 14, 22, 42, 256, 4096];

type Compute = fn(&[u8]) -> u16;

const COMPUTE: [(&str, Compute); 6] = [
    ("axlewire compute", crc16::compute),
    ("C two tables", reference::crc_table),
    ("C bitwise", reference::crc_bitwise),
    ("crc Table<1>", |bytes| {
        const CRC: Crc<u16, Table<1>> = Crc::<u16, Table<1>>::new(&CRC_16_MODBUS);
        CRC.checksum(bytes)
    }),
    ("crc Table<16>", |bytes| {
        const CRC: Crc<u16, Table<16>> = Crc::<u16, Table<16>>::new(&CRC_16_MODBUS);
        CRC.checksum(bytes)
    }),
    ("crc NoTable", |bytes| {
        const CRC: Crc<u16, NoTable> = Crc::<u16, NoTable>::new(&CRC_16_MODBUS);
        CRC.checksum(bytes)
    }),
];

fn main() {
    let mut criterion = criterion();
    for len in LENGTHS {
        length(&mut criterion, len);
    }
    criterion.final_summary();
}

fn length(criterion: &mut Criterion, len: usize) {
    let mut rng = Rng::new(len as u64);
    let bytes: Vec<u8> = (0..len).map(|_| rng.byte()).collect();
    let expected = reference::crc_bitwise(&bytes);
    let frame = [&bytes[..], &expected.to_le_bytes()].concat();

    let mut group = criterion.benchmark_group(format!("crc of {len}"));
    group.throughput(Throughput::Bytes(len as u64));
    for (name, compute) in COMPUTE {
        let compute = black_box(compute);
        measure(&mut group, name, expected, || compute(black_box(&bytes)));
    }

    // `check` also reads the two CRC bytes.
    let check = black_box(crc16::check as fn(&[u8]) -> bool);
    measure(&mut group, "axlewire check", true, || check(black_box(&frame)));
    group.finish();
}
