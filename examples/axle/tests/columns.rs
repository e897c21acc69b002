//! `axle decode` lists a byte stream in columns, for people.

mod support;

use support::{bytes, run, stdout};

/// Checks the whole listing; it begins on the line below its quote.
fn check(protocol: &str, input: &[u8], listing: &str) {
    let listed = stdout(run(&["decode", "--protocol", protocol], input));
    assert_eq!(listed, listing.trim_start_matches('\n'));
}

#[test]
fn people_get_columns_and_units_of_a_rover() {
    let input = bytes(concat!(
        "fdff040001000142",
        "fdff0500010000be00",
        "00ff00",
        "fdff280005035700c4ffc4ffc4ffc4ff9cffc800d4fe90010cfe580244fd20037cfcb400067737002600c121",
        "fdff260005fdfffffffffefffdfffcfffdfdfdff0100020003000400050006000700080009006701bef8",
        "fdff140002ff9cff9cff6400640000000000000000006dd9",
        "fdff14000209c4ff14006400000027000000000000002c52",
        "fdff060003000100806b",
        "fdff17000800000100ffff0040f4ff2200c8ff5f0536013ff83539",
        "fdff05000900003fc200",
        "fdff05000a01010f92",
        "fdff14000a0000000000000000000000000000000000b314",
        "fdff0500010000be01",
        "fdff1400",
    ));
    let listing = "
    offset  bytes  message                index  contents
         0      8  ping                       0
         8      9  pong                       0  fine
        17      3  (skipped)                     header: no frame starts here
        20     44  report                     3  battery  87 %  11.9 V   0.55 A    6 W  rpm  -60  -60  -60  -60  acc -0.01  0.01 -0.02 g  gyro   24.4  -30.5   36.6 deg/s  mag  -700   800  -900  heading 180 deg  firmware 38
        64     42  report                   253  battery 65535 (no percentage)  25.3 V  655.33 A  253 W  rpm   -1   -2   -3   -4  acc  0.00  0.00  0.00 g  gyro    0.2    0.3    0.4 deg/s  mag     7     8     9  heading 359 deg  (document layout)
       106     24  motor_control            255  speed -100 %  angular -100 %  front led on  back led 100
       130     24  motor_control              9  speed  -60 %  angular   20 %  front led on  version 39  (starts a firmware update)
       154     10  calibration_start_ack      0  magnetometer, fine
       164     27  biases                     0  fine, acc 1 -1 16384, gyro -12 34 -56, mag 1375 310 -1985
       191      9  ota_ack                    0  accepted
       200      1  (skipped)                     header: no frame starts here
       201      9  network_state              1  SIM absent, in 1 byte
       210     24  unknown                    0  id 10, body 00000000000000000000000000000000
       234     13  (skipped)                     crc: damaged, or not a frame

       247 bytes received
       230 in 11 frames
        17 skipped: 15 header, 1 crc, 1 idle
";
    check("ucp", &input, listing);
}

#[test]
fn people_get_columns_and_units_of_a_motor_bus() {
    let input = bytes(concat!(
        "aa01bed0",
        "bb01000000bf6720",
        "5606ff7fff7f85f1",
        "aa09bf16",
        "5502ffff7fff158a",
        "bb020000807f42b0",
        "5503",
    ));
    let listing = "
    offset  bytes  message                 node  contents
         0      4  read_request               1
         4      8  write                      1  -0.5 rps or -16640.0000 turns (rotation -16640, count 0)
        12      8  position_response          6  32770.9999 turns (rotation 32767, count 32767)
        20      4  (skipped)                     id: invalid node id
        24      8  velocity_response          2  -3.4028235e38 rps
        32      8  write                      2  inf rps
        40      2  (skipped)                     idle: truncated at the end

        42 bytes received
        36 in 5 frames
         6 skipped: 1 header, 4 id, 1 idle
";
    check("ikeya", &input, listing);
}

#[test]
fn people_get_three_values_of_a_three_motor_board() {
    let input =
        bytes(concat!("55030000803f0000004000004040d871", "5605ff1f01e00000ff7f008000005abf",));
    let listing = "
    offset  bytes  message                 node  contents
         0     16  velocity_response          3  1.0 2.0 3.0 rps
        16     16  position_response          5  32767.9999 -32768.9999 0.0000 turns (rotation 32767 -32768 0, count 8191 -8191 0)

        32 bytes received
        32 in 2 frames
         0 skipped
";
    check("ikeya-3", &input, listing);
}
