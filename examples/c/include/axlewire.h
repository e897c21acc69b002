/* axlewire: Ikeya MD and UCP, two serial protocols for motors and rovers, for C and C++.
 *
 * Objects live in your memory: declare one, and pass its address with its size to `_init`. All else
 * of an object is private. Nothing here allocates, blocks, calls back, reads a clock or keeps a
 * global. Use an object from one thread at a time; a call from an interrupt during another call is
 * refused with AXLE_ERROR_BUSY. `_init` is never refused: it begins anew, whatever the memory holds.
 *
 * Functions return AXLE_OK, AXLE_NONE, or a negative error, which has changed nothing. Pointers may
 * be null or unaligned, which gives an error; what they point to must be as long as said. Outputs
 * must not be in the memory of an object. Times are microseconds of a clock of 64 bits that never
 * goes back; `axle_clock32_at` extends a timer of 32 bits.
 *
 * The loop of a role, here of a master; each step is needed, in this order:
 *
 *     while ((count = read_port(bytes)) > 0)
 *         axle_ikeya_master_handle_input(&master, bytes, count, now_us());
 *     axle_ikeya_master_handle_timeout(&master, time_before_the_port_was_found_empty);
 *     while (axle_ikeya_master_poll_event(&master, &event) == AXLE_OK)
 *         act_on(&event);                  // give commands here
 *     while (axle_ikeya_master_poll_transmit(&master, now_us(), &frame, &length) == AXLE_OK)
 *         if (!write_port(frame, length)) {        // not whole: it is due again, later
 *             axle_ikeya_master_handle_transmit(&master, AXLE_TRANSMIT_CUT_OFF, now_us());
 *             break;
 *         }
 *     wait_for_bytes_or(axle_ikeya_master_next_deadline(&master, &at_us));
 *
 * The loop of a decoder, here for a recording:
 *
 *     while ((left = read_file(bytes)) > 0)
 *         for (data = bytes; axle_ikeya_decoder_decode(&decoder, &data, &left, &event) == AXLE_OK;)
 *             act_on(&event);
 *     do {
 *         axle_ikeya_decoder_idle(&decoder);            // nothing follows
 *         while (axle_ikeya_decoder_poll(&decoder, &event) == AXLE_OK) act_on(&event);
 *         axle_ikeya_decoder_get_pending(&decoder, &left);
 *     } while (left > 0);
 *
 * The rulings, such as I12, are explained in the documentation of axlewire, on the pages `ikeya`
 * and `ucp`. Before you connect a motor, read its page `safety`.
 *
 * Made by header.sh: do not edit.
 */

#ifndef AXLEWIRE_H
#define AXLEWIRE_H

#include <stdint.h>
#include <stddef.h>

/// Counts of a turn.
#define AXLE_IKEYA_COUNTS_PER_REVOLUTION 8192

/// Nodes are read one after another, as fast as the line allows.
#define AXLE_IKEYA_POLLING_FASTEST 1

/// Each node is read once per period, and its set-point repeated at the same rate.
#define AXLE_IKEYA_POLLING_EVERY 2

/// Nodes are read on request only, and to stop them.
#define AXLE_IKEYA_POLLING_MANUAL 3

/// A node answered for the first time: `node`, `mode`.
#define AXLE_IKEYA_MASTER_DISCOVERED 1

/// All ids have been asked: `online`.
#define AXLE_IKEYA_MASTER_DISCOVERY_DONE 2

/// An answer: `node`, `motion`.
#define AXLE_IKEYA_MASTER_STATUS 3

/// The health of a node changed: `node`, `health`, `failures`.
#define AXLE_IKEYA_MASTER_HEALTH 4

/// A READ failed after its last attempt: `node`, `cause`.
#define AXLE_IKEYA_MASTER_READ_FAILED 5

/// A node changed its mode, which ends its set-point: `node`, `mode` (ruling I11).
#define AXLE_IKEYA_MASTER_MODE_CHANGED 6

/// The mode of a node is still in doubt after six exchanges: `node` (ruling I11).
#define AXLE_IKEYA_MASTER_MODE_IN_DOUBT 7

/// The set-point that was to be confirmed has arrived: `node`.
#define AXLE_IKEYA_MASTER_CONFIRMED 8

/// It is not known whether it has: `node`, `cause`.
#define AXLE_IKEYA_MASTER_NOT_CONFIRMED 9

/// A stop is confirmed; the motor may still turn: `node` (ruling I12).
#define AXLE_IKEYA_MASTER_STOPPED 10

/// A motor that was stopped is seen to be at rest: `node` (ruling I12).
#define AXLE_IKEYA_MASTER_STANDING_STILL 11

/// A motor still moves after its time to coast: `node`, `motion` (ruling I12).
#define AXLE_IKEYA_MASTER_STILL_MOVING 12

/// The mode of a node that is owed a stop is still in doubt, so the stop is not written: `node`
/// (rulings I11, I12).
#define AXLE_IKEYA_MASTER_STOP_BLOCKED 13

/// The dead-man has fired (ruling I13).
#define AXLE_IKEYA_MASTER_DEAD_MAN 14

/// An event that is newer than this header.
#define AXLE_IKEYA_MASTER_OTHER 255

/// Never heard, or not a node of this bus.
#define AXLE_IKEYA_HEALTH_UNKNOWN 0

/// The node answers.
#define AXLE_IKEYA_HEALTH_ONLINE 1

/// The node has missed some answers.
#define AXLE_IKEYA_HEALTH_SUSPECT 2

/// The node no longer answers (ruling I7).
#define AXLE_IKEYA_HEALTH_ABNORMAL 3

/// No answer.
#define AXLE_IKEYA_CAUSE_SILENT 1

/// A damaged answer.
#define AXLE_IKEYA_CAUSE_DAMAGED 2

/// Another node, another mode, too early or too late.
#define AXLE_IKEYA_CAUSE_UNEXPECTED 3

/// The set-point to be confirmed was dropped.
#define AXLE_IKEYA_CAUSE_DROPPED 4

/// A cause that is newer than this header.
#define AXLE_IKEYA_CAUSE_OTHER 255

/// No stop was asked for.
#define AXLE_IKEYA_STOP_NOT_ASKED 0

/// The stop is owed: not confirmed yet.
#define AXLE_IKEYA_STOP_OWED 1

/// The stop is confirmed; the motor may still turn.
#define AXLE_IKEYA_STOP_CONFIRMED 2

/// The motor is seen to be at rest.
#define AXLE_IKEYA_STOP_STANDING_STILL 3

/// The motor still moves after its time to coast.
#define AXLE_IKEYA_STOP_STILL_MOVING 4

/// Size of the object, bytes.
#define AXLE_IKEYA_MASTER_SIZE 2288

/// Size of the object, bytes.
#define AXLE_IKEYA3_MASTER_SIZE 2616

/// READ: asks a slave for its status.
#define AXLE_IKEYA_PACKET_READ 1

/// WRITE, as parsed: commands a slave in velocity or position mode.
#define AXLE_IKEYA_PACKET_WRITE 2

/// WRITE of `velocity_rps`, for encoding.
#define AXLE_IKEYA_PACKET_WRITE_VELOCITY 3

/// WRITE of `position`, for encoding.
#define AXLE_IKEYA_PACKET_WRITE_POSITION 4

/// The answer of a slave in velocity mode.
#define AXLE_IKEYA_PACKET_VELOCITY 5

/// The answer of a slave in position mode.
#define AXLE_IKEYA_PACKET_POSITION 6

/// Length of the longest packet, bytes.
#define AXLE_IKEYA_PACKET_MAX_LENGTH 16

/// A command: `motion`.
#define AXLE_IKEYA_SLAVE_COMMAND 1

/// No valid command for the time of the watchdog: stop the motor.
#define AXLE_IKEYA_SLAVE_WATCHDOG 2

/// An event that is newer than this header.
#define AXLE_IKEYA_SLAVE_OTHER 255

/// The id of the DIP switches is their value plus 1 (ruling I2).
#define AXLE_IKEYA_ID_VALUE_PLUS_ONE 1

/// The id of the DIP switches is their value (ruling I2).
#define AXLE_IKEYA_ID_VALUE 2

/// Size of the object, bytes.
#define AXLE_IKEYA_SLAVE_SIZE 360

/// Size of the object, bytes.
#define AXLE_IKEYA3_SLAVE_SIZE 392

/// A frame, whole and undamaged.
#define AXLE_STREAM_FRAME 1

/// A gap: bytes that belong to no frame.
#define AXLE_STREAM_SKIPPED 2

/// The CRC does not match.
#define AXLE_REASON_CRC 1

/// Not the first bytes of a frame.
#define AXLE_REASON_HEADER 2

/// A node id outside 1 to 8.
#define AXLE_REASON_ID 3

/// A length that no frame has.
#define AXLE_REASON_LENGTH 4

/// The line went quiet inside the frame.
#define AXLE_REASON_IDLE 5

/// From the master to slaves with one motor.
#define AXLE_IKEYA_TO_SLAVE 1

/// From slaves with one motor to the master.
#define AXLE_IKEYA_TO_MASTER 2

/// Both directions of a bus of boards with one motor, as on two wires.
#define AXLE_IKEYA_BOTH_DIRECTIONS 3

/// From the master to slaves with three motors.
#define AXLE_IKEYA3_TO_SLAVE 4

/// From slaves with three motors to the master.
#define AXLE_IKEYA3_TO_MASTER 5

/// Both directions of a bus of boards with three motors.
#define AXLE_IKEYA3_BOTH_DIRECTIONS 6

/// Size of the object, bytes.
#define AXLE_IKEYA_DECODER_SIZE 144

/// Size of the object, bytes.
#define AXLE_UCP_DECODER_SIZE 184

/// Most bytes in the body of an unknown frame.
#define AXLE_UCP_BODY_MAX_LENGTH 56

/// A valid frame has arrived, the first or the first after a link that was down.
#define AXLE_UCP_HOST_LINK_UP 1

/// No valid frame has arrived in time; a robot that was told to move is told to stand still
/// (U16).
#define AXLE_UCP_HOST_LINK_DOWN 2

/// The robot answered a ping: `round_trip_us`, `err`.
#define AXLE_UCP_HOST_PONG 3

/// A report: `report`.
#define AXLE_UCP_HOST_REPORT 4

/// The application was silent while the robot moved: it is told to stand still (ruling U10).
#define AXLE_UCP_HOST_DEAD_MAN 5

/// The start of a calibration is acknowledged: `calibration`.
#define AXLE_UCP_HOST_CALIBRATION_STARTED 6

/// The end of a calibration is acknowledged, its result follows: `calibration`.
#define AXLE_UCP_HOST_CALIBRATION_ENDED 7

/// A calibration request failed: `calibration`, `step`, `cause`, `err`, `attempts`.
#define AXLE_UCP_HOST_CALIBRATION_FAILED 8

/// The result of a calibration, which the host keeps: `imu_bias`.
#define AXLE_UCP_HOST_IMU_BIAS 9

/// The result of a calibration, which the host keeps: `mag_bias`.
#define AXLE_UCP_HOST_MAG_BIAS 10

/// The robot has booted, and is sent the biases that the host keeps.
#define AXLE_UCP_HOST_BIASES_SENT 11

/// The robot has booted, but biases are missing: `imu_missing`, `mag_missing`.
#define AXLE_UCP_HOST_BIASES_MISSING 12

/// The robot has booted, but `low_ids_only` forbids the answer (ruling U14).
#define AXLE_UCP_HOST_BIASES_NOT_ANSWERED 13

/// A firmware update was given up: its request was not sent.
#define AXLE_UCP_HOST_UPDATE_NOT_SENT 14

/// The robot answered a firmware update request: `ota_status`.
#define AXLE_UCP_HOST_UPDATE_ANSWERED 15

/// A frame of no known message: `id`, `index`, `body`, `body_length` (ruling U3).
#define AXLE_UCP_HOST_UNKNOWN 16

/// An event that is newer than this header.
#define AXLE_UCP_HOST_OTHER 255

/// The start of a calibration.
#define AXLE_UCP_STEP_START 1

/// The end of a calibration.
#define AXLE_UCP_STEP_END 2

/// No answer after all attempts.
#define AXLE_UCP_FAILURE_NO_ANSWER 1

/// The robot refused: see `err`.
#define AXLE_UCP_FAILURE_REFUSED 2

/// A cause that is newer than this header.
#define AXLE_UCP_FAILURE_OTHER 255

/// Nothing heard yet.
#define AXLE_UCP_LINK_WAITING 0

/// The robot is heard.
#define AXLE_UCP_LINK_UP 1

/// The robot is no longer heard.
#define AXLE_UCP_LINK_DOWN 2

/// No stop was asked for.
#define AXLE_UCP_STOP_NOT_ASKED 0

/// The stop has not left yet.
#define AXLE_UCP_STOP_DUE 1

/// The stop has left, and no report shows yet what the robot does.
#define AXLE_UCP_STOP_NO_REPORTS 2

/// Reports show that the robot still moves: see `rpm`.
#define AXLE_UCP_STOP_STILL_MOVING 3

/// Reports show that the robot stands still.
#define AXLE_UCP_STOP_STANDING_STILL 4

/// Size of the object, bytes.
#define AXLE_UCP_HOST_SIZE 1976

/// Time after a stop in which a rover is seen to stand still, microseconds: 2 s to coast, and one
/// more until the average that it reports shows it.
#define AXLE_UCP_COAST_US 3000000

/// Host to robot: checks that the robot is there.
#define AXLE_UCP_PING 1

/// Robot to host, answers a ping: `err`.
#define AXLE_UCP_PONG 2

/// Host to robot: `speed_pct`, `turn_pct`, `front_led`.
#define AXLE_UCP_MOTOR_CONTROL 3

/// Host to robot: `calibration`.
#define AXLE_UCP_CALIBRATION_START 4

/// Robot to host: `calibration`, `err`.
#define AXLE_UCP_CALIBRATION_START_ACK 5

/// Host to robot: `calibration`.
#define AXLE_UCP_CALIBRATION_END 6

/// Robot to host: `calibration`, `err`.
#define AXLE_UCP_CALIBRATION_END_ACK 7

/// Robot to host, as robots send it: `telemetry`, `version` (ruling U5).
#define AXLE_UCP_REPORT 8

/// Robot to host, as in the document: `telemetry` (ruling U5).
#define AXLE_UCP_DOCUMENT_REPORT 9

/// Robot to host: the result of a calibration, `imu_bias`.
#define AXLE_UCP_IMU_BIAS 10

/// Host to robot: `err`.
#define AXLE_UCP_IMU_BIAS_ACK 11

/// Robot to host: the result of a calibration, `mag_bias`.
#define AXLE_UCP_MAG_BIAS 12

/// Host to robot: `err`.
#define AXLE_UCP_MAG_BIAS_ACK 13

/// Robot to host: has booted and wants the stored biases.
#define AXLE_UCP_BIAS_REQUEST 14

/// Host to robot: `imu_bias`, `mag_bias`, `err`.
#define AXLE_UCP_BIASES 15

/// Host to robot: `version`. Encoding it begins an update: the robot then stops answering.
#define AXLE_UCP_OTA_REQUEST 16

/// Robot to host: `ota_status`.
#define AXLE_UCP_OTA_ACK 17

/// Host to robot: `network_state`.
#define AXLE_UCP_SET_NETWORK_STATE 18

/// The same in four bytes, as some hosts send it: `network_state`. Not to be encoded (U8).
#define AXLE_UCP_SET_NETWORK_STATE_WIDE 19

/// A frame of no known message: `id`, `body`, `body_length` (ruling U3).
#define AXLE_UCP_UNKNOWN 20

/// A message that is newer than this header.
#define AXLE_UCP_OTHER 255

/// Length of the longest frame, bytes.
#define AXLE_UCP_FRAME_MAX_LENGTH 64

/// The command has changed: `command`. To move the robot, use `axle_ucp_robot_get_command`.
#define AXLE_UCP_ROBOT_MOTOR 1

/// No valid command for the time of the watchdog: speed and turn are 0 (ruling U10).
#define AXLE_UCP_ROBOT_WATCHDOG 2

/// A calibration is to start: `calibration`, `is_repeated`.
#define AXLE_UCP_ROBOT_CALIBRATION_START 3

/// The calibration is to end, and its result to be handed in: `calibration`.
#define AXLE_UCP_ROBOT_CALIBRATION_END 4

/// The host has the biases of the inertial sensors.
#define AXLE_UCP_ROBOT_IMU_BIAS_TAKEN 5

/// The host has the biases of the magnetometer.
#define AXLE_UCP_ROBOT_MAG_BIAS_TAKEN 6

/// The host has sent its stored biases: `imu_bias`, `mag_bias`, `err`.
#define AXLE_UCP_ROBOT_BIASES 7

/// State of the host's network: `network_state`.
#define AXLE_UCP_ROBOT_NETWORK_STATE 8

/// The host asks for a firmware update: `version`, `by_motor_command`.
#define AXLE_UCP_ROBOT_UPDATE_REQUESTED 9

/// An event that is newer than this header.
#define AXLE_UCP_ROBOT_OTHER 255

/// Size of the object, bytes.
#define AXLE_UCP_ROBOT_SIZE 1080

/// What a node controls: one of `AXLE_IKEYA_MODE_`.
typedef uint8_t axle_ikeya_mode;

/// A position of a motor (ruling I5): `rotation` turns of 8192 counts, and `count` counts. Any
/// values are a position, the sum of both parts: 2 turns and 8192 counts are 3 turns.
typedef struct axle_ikeya_position {
  /// Whole turns.
  int16_t rotation;
  /// Counts, 8192 a turn.
  int16_t count;
} axle_ikeya_position;

/// What a function returns: `AXLE_OK`, `AXLE_NONE`, or an error, which is negative.
///
/// A function that returns an error has done nothing, and has written to none of its outputs.
typedef int32_t axle_result;

/// Ids as bits: bit 0 is node 1, bit 7 is node 8.
typedef uint8_t axle_ikeya_node_set;

/// Settings of a master. Begin with those of `axle_ikeya_master_config_direct` or `_usb_adapter`.
typedef struct axle_ikeya_master_config {
  /// Speed of the line, bit/s; 0 counts as 500,000. Not less than it really is.
  uint32_t baud;
  /// Longest time from the end of a request on the wire to the start of its answer (ruling I7).
  uint32_t reply_timeout_us;
  /// Time after a missed answer during which the node is not polled again. An answer that is
  /// later than both is taken for the next one: a motor that turns may then be told to stand
  /// still, from a measurement of before. Set `reply_timeout_us` for the slowest answer of
  /// your line.
  uint32_t late_guard_us;
  /// Silence between a request or an answer and the next request, for transceivers that need it;
  /// 0 by default.
  uint32_t turnaround_gap_us;
  /// Period in which each node is read, for `AXLE_IKEYA_POLLING_EVERY`; with 0, as fast as the
  /// line allows.
  uint32_t polling_period_us;
  /// Age of a measured position that a stop may hold; 0, the default: always read (ruling I6).
  uint32_t hold_age_us;
  /// Time in which a motor may come to rest after its stop is confirmed (ruling I12); 2 s.
  uint32_t coast_us;
  /// Time without a command or `keep_alive` after which every node under a set-point is owed a
  /// stop (ruling I13); 0, the default, for none.
  uint32_t dead_man_us;
  /// Ids on this bus; all eight by default.
  axle_ikeya_node_set nodes;
  /// One of `AXLE_IKEYA_POLLING_`; `AXLE_IKEYA_POLLING_FASTEST` by default.
  uint8_t polling;
  /// Attempts of a READ before it has failed (ruling I8); 3 by default, 0 counts as 1.
  uint8_t attempts;
  /// Share of line time for finding abnormal nodes, percent; 5 by default, more than 50 counts
  /// as 50 (I13).
  uint8_t recovery_share_pct;
  /// Not 0 if an answer may arrive before the line could have carried it, as behind a pipe, or
  /// if the clock is coarser than 20 us.
  uint8_t accepts_early;
  /// Not 0 if a node that becomes abnormal while under a set-point is owed a stop (I12); 1.
  uint8_t stops_abnormal;
} axle_ikeya_master_config;

/// The master of a bus of boards with one motor.
typedef struct axle_ikeya_master {
  /// Private.
  uint64_t memory[286];
} axle_ikeya_master;

/// Speeds or positions of the motors of a node: measured or commanded.
///
/// Boards with three motors use all elements, others the first.
typedef struct axle_ikeya_motion {
  /// One of `AXLE_IKEYA_MODE_`, which tells what follows; 0 if nothing does.
  axle_ikeya_mode mode;
  /// Speeds, turns per second; 0 in position mode.
  float velocity_rps[3];
  /// Positions; 0 in velocity mode.
  struct axle_ikeya_position position[3];
} axle_ikeya_motion;

/// An event of a master. What an event has is said with its kind; all else is 0.
typedef struct axle_ikeya_master_event {
  /// One of `AXLE_IKEYA_MASTER_`.
  uint8_t kind;
  /// Id of the node, 1 to 8; 0 if the event is of no node.
  uint8_t node;
  /// One of `AXLE_IKEYA_MODE_`.
  axle_ikeya_mode mode;
  /// One of `AXLE_IKEYA_HEALTH_`.
  uint8_t health;
  /// Answers missed in a row, with `AXLE_IKEYA_HEALTH_SUSPECT`.
  uint8_t failures;
  /// One of `AXLE_IKEYA_CAUSE_`.
  uint8_t cause;
  /// Number of nodes that are online.
  uint8_t online;
  /// What was measured.
  struct axle_ikeya_motion motion;
} axle_ikeya_master_event;

/// What a master knows of a node.
typedef struct axle_ikeya_node {
  /// When `status` arrived, microseconds.
  uint64_t measured_at_us;
  /// The latest measurement; its mode is 0 if there is none.
  struct axle_ikeya_motion status;
  /// The set-point in force; its mode is 0 if there is none.
  struct axle_ikeya_motion set_point;
  /// The mode of the node, one of `AXLE_IKEYA_MODE_`; 0 if it is not known.
  axle_ikeya_mode mode;
  /// One of `AXLE_IKEYA_HEALTH_`.
  uint8_t health;
  /// Answers missed in a row, with `AXLE_IKEYA_HEALTH_SUSPECT`.
  uint8_t failures;
  /// How far a stop has come: one of `AXLE_IKEYA_STOP_`.
  uint8_t stop;
  /// 1 if the latest set-point has left.
  uint8_t is_set_point_sent;
  /// 1 if the mode is in doubt (ruling I11).
  uint8_t is_mode_in_doubt;
  /// Why the latest READ that failed did so: one of `AXLE_IKEYA_CAUSE_`; 0 if none has.
  uint8_t last_failure;
  /// 1 if the latest requested READ has been answered or has failed.
  uint8_t is_read_over;
  /// Why the latest requested READ has failed: one of `AXLE_IKEYA_CAUSE_`; 0 if it has not.
  uint8_t read_failure;
} axle_ikeya_node;

/// What a master knows of its bus.
typedef struct axle_ikeya_bus {
  /// Events that were refused because the queue was full.
  uint32_t lost_events;
  /// Time within which a stop is confirmed, or its node is abnormal, microseconds.
  uint32_t stop_bound_us;
  /// Time within which a requested READ is answered or has failed, microseconds.
  uint32_t read_bound_us;
  /// Nodes that are owed a stop (ruling I12).
  axle_ikeya_node_set stops_owed;
  /// Nodes whose stop is confirmed, and which are not yet seen to be at rest.
  axle_ikeya_node_set coasting;
  /// 1 while all ids are being asked.
  uint8_t is_discovering;
} axle_ikeya_bus;

/// Counts of a master.
typedef struct axle_ikeya_master_statistics {
  /// READs sent.
  uint32_t reads;
  /// WRITEs sent.
  uint32_t writes;
  /// Bytes dropped because they came before a request.
  uint32_t stale_bytes;
  /// How often the dead-man has fired.
  uint32_t dead_man;
} axle_ikeya_master_statistics;

/// Times, microseconds; all 0 if there is none yet.
typedef struct axle_latency {
  /// How many there are.
  uint32_t count;
  /// The latest.
  uint32_t last_us;
  /// The shortest.
  uint32_t min_us;
  /// The longest.
  uint32_t max_us;
  /// Their mean.
  uint32_t mean_us;
} axle_latency;

/// Counts of one node.
typedef struct axle_ikeya_node_statistics {
  /// Requests that expect an answer.
  uint32_t requests;
  /// Answers in their window.
  uint32_t replies;
  /// Windows that closed without an answer, for whatever reason.
  uint32_t timeouts;
  /// Of these, windows with bytes but no packet.
  uint32_t crc_errors;
  /// Answers that came before the line could have carried them.
  uint32_t early;
  /// Answers outside their window, or in that of another node.
  uint32_t late;
  /// Answers of another mode than known.
  uint32_t other_mode;
  /// Requests that were repeated.
  uint32_t retries;
  /// READs that failed after all attempts.
  uint32_t failures;
  /// From the end of a request to the start of its answer.
  struct axle_latency latency;
} axle_ikeya_node_statistics;

/// Account of a stream: each received byte is in a frame, in a gap, or still pending.
typedef struct axle_counters {
  /// Bytes received.
  uint64_t received;
  /// Frames, and the bytes in them.
  uint64_t frames;
  /// Bytes in frames.
  uint64_t framed;
  /// Gaps between frames.
  uint64_t gaps;
  /// Bytes in gaps, by reason: CRC.
  uint64_t skipped_crc;
  /// By reason: header.
  uint64_t skipped_header;
  /// By reason: node id.
  uint64_t skipped_id;
  /// By reason: length.
  uint64_t skipped_length;
  /// By reason: silence inside a frame.
  uint64_t skipped_idle;
} axle_counters;

/// What has become of a frame: one of `AXLE_TRANSMIT_`.
typedef uint8_t axle_transmit;

/// What a role requires of its line.
typedef struct axle_line_rules {
  /// Longest pause inside a frame that is sent, microseconds: give up one with a longer pause.
  uint32_t frame_pause_us;
  /// Speed of the line, bit/s; 0 if it is not known.
  uint32_t baud;
  /// How long the port may go unread before the bytes in it count as old, microseconds;
  /// `UINT32_MAX` if they never do. Hand in older ones by `handle_old_input`. With 0, as of a
  /// host, bytes count from when the port was last found empty: hand in all of them so, if
  /// others came before or a frame was sent since.
  uint32_t held_up_after_us;
} axle_line_rules;

/// The master of a bus of boards with three motors.
typedef struct axle_ikeya3_master {
  /// Private.
  uint64_t memory[327];
} axle_ikeya3_master;

/// A packet of a motor bus.
typedef struct axle_ikeya_packet {
  /// One of `AXLE_IKEYA_PACKET_`.
  uint8_t kind;
  /// Id of the slave, 1 to 8 (ruling I1).
  uint8_t node;
  /// Motors of the board, 1 or 3; of no matter for a READ, which is the same for both.
  uint8_t motors;
  /// Speeds, turns per second. A WRITE that was parsed has both readings: only the mode of the
  /// node, which is not in the packet, tells which one is meant (ruling I3).
  float velocity_rps[3];
  /// Positions.
  struct axle_ikeya_position position[3];
} axle_ikeya_packet;

/// A bus of boards with one motor, for `axle_ikeya_schedule_get_cycle`.
typedef struct axle_ikeya_schedule {
  /// Speed of the line, bit/s; 500,000 by default.
  uint32_t baud;
  /// Time from the end of a request to the start of its answer; 50 us by default (ruling I9).
  uint32_t response_time_us;
  /// Silence after each packet of the master and after each answer; 0 by default.
  uint32_t turnaround_gap_us;
  /// Number of nodes.
  uint8_t nodes;
  /// Not 0 if each node is commanded in each cycle, or only read; 1 by default.
  uint8_t writes;
} axle_ikeya_schedule;

/// What the master does with each node in turn: a WRITE, if it is commanded, and a READ.
typedef struct axle_ikeya_cycle {
  /// Time that one node takes.
  uint32_t exchange_time_us;
  /// Time of all nodes: from one turn of a node to its next.
  uint32_t cycle_time_us;
  /// Visits to each node per second, rounded down; 0 without nodes.
  uint32_t cycles_per_second;
  /// Share of the time in which the line is in use, percent, rounded down.
  uint32_t busy_pct;
} axle_ikeya_cycle;

/// Settings of a slave. Begin with those of `axle_ikeya_slave_config_direct` or `_usb_adapter`.
typedef struct axle_ikeya_slave_config {
  /// Speed of the line, bit/s; 0 counts as 500,000.
  uint32_t baud;
  /// Time without a valid command before `AXLE_IKEYA_SLAVE_WATCHDOG`; 0, the default, for none:
  /// a motor then keeps its last command forever.
  uint32_t watchdog_us;
  /// Silence between a request and its answer; with the processing below 50 us (ruling I9).
  uint32_t turnaround_gap_us;
  /// Silence after which an incomplete packet is given up (ruling B3).
  uint32_t idle_us;
  /// Time during which an answer may still be sent (ruling I14).
  uint32_t answer_within_us;
  /// Not 0 if the slaves on this line hear each other's answers, as on RS485 with one pair of
  /// wires; 0, the default, on two pairs (ruling I14).
  uint8_t two_wire;
} axle_ikeya_slave_config;

/// A slave with one motor.
typedef struct axle_ikeya_slave {
  /// Private.
  uint64_t memory[45];
} axle_ikeya_slave;

/// An event of a slave.
typedef struct axle_ikeya_slave_event {
  /// One of `AXLE_IKEYA_SLAVE_`.
  uint8_t kind;
  /// The command.
  struct axle_ikeya_motion motion;
} axle_ikeya_slave_event;

/// Counts of a slave.
typedef struct axle_ikeya_slave_statistics {
  /// READs of this node.
  uint32_t reads;
  /// WRITEs of this node.
  uint32_t writes;
  /// Of these, refused: a speed that is not a finite number (ruling I4).
  uint32_t refused;
  /// Packets of other nodes.
  uint32_t foreign;
  /// Answers of other nodes, on two wires, and its own if it hears them.
  uint32_t answers;
  /// Answers sent.
  uint32_t replies;
  /// Requests that were overtaken by others before they were answered.
  uint32_t overtaken;
  /// Answers that would have come too late, and were not sent.
  uint32_t expired;
  /// How often the watchdog has fired.
  uint32_t watchdog;
  /// Events that were refused because the queue was full.
  uint32_t lost_events;
} axle_ikeya_slave_statistics;

/// A slave with three motors.
typedef struct axle_ikeya3_slave {
  /// Private.
  uint64_t memory[49];
} axle_ikeya3_slave;

/// A decoder of a motor bus.
typedef struct axle_ikeya_decoder {
  /// Private.
  uint64_t memory[18];
} axle_ikeya_decoder;

/// A decoder of the link of a rover.
typedef struct axle_ucp_decoder {
  /// Private.
  uint64_t memory[23];
} axle_ucp_decoder;

/// A frame or a gap.
typedef struct axle_stream_event {
  /// One of `AXLE_STREAM_`.
  uint8_t kind;
  /// Why the first byte of a gap begins no frame: one of `AXLE_REASON_`; 0 for a frame. The
  /// other bytes of the gap may have other reasons: the counters have them all.
  uint8_t reason;
  /// The frame, with a matching CRC, in the bytes that were handed in or in the decoder: valid
  /// until either changes. Null for a gap.
  const uint8_t *bytes;
  /// Length of the frame, bytes; 0 for a gap.
  size_t length;
  /// Length of the gap, bytes; 0 for a frame.
  uint64_t skipped;
} axle_stream_event;

/// Extends a timer of 32 bits, which wraps every 71 minutes, to the 64 bits of the other functions.
typedef struct axle_clock32 {
  /// The time of the latest reading, microseconds; 0 at the start.
  uint64_t latest_us;
} axle_clock32;

/// Settings of a host. Begin with those of `axle_ucp_host_config_direct` or `_usb_adapter`.
typedef struct axle_ucp_host_config {
  /// Speed of the line, bit/s; 115,200. Not less than it really is.
  uint32_t baud;
  /// Period at which the latest motor command is repeated (ruling U10); 100 ms.
  uint32_t command_period_us;
  /// Shortest pause between two different motor commands; 20 ms, at most 50.
  uint32_t command_gap_us;
  /// Silence of the application after which a robot is told to stand still (ruling U10); 500 ms.
  uint32_t dead_man_us;
  /// Period of pings; 200 ms, 0 for none.
  uint32_t ping_period_us;
  /// Time after which a ping counts as lost; 500 ms.
  uint32_t ping_timeout_us;
  /// Time without a valid frame after which the link is down (rulings U10, U16); 500 ms.
  uint32_t link_timeout_us;
  /// Time over which the robot averages its wheel speeds (ruling U16); 1100 ms.
  uint32_t rpm_average_us;
  /// Longest time for the acknowledgement of a calibration request; 200 ms.
  uint32_t ack_timeout_us;
  /// Pause that cuts off a frame, besides two byte times; 20 ms.
  uint32_t idle_margin_us;
  /// Number of times a calibration request is sent before it fails; 3.
  uint8_t attempts;
  /// Not 0 if the first frame is a zero motor command (ruling U16); 1. 0 for hosts that only
  /// listen.
  uint8_t sends_first_stop;
  /// Not 0 to send no id from 5 to 10, for robots that hang on them (ruling U14); 0.
  uint8_t low_ids_only;
} axle_ucp_host_config;

/// The host of a rover, which keeps its biases.
typedef struct axle_ucp_host {
  /// Private.
  uint64_t memory[247];
} axle_ucp_host;

/// What a robot measures (ruling U5).
typedef struct axle_ucp_telemetry {
  /// Battery, percent; invalid above 100.
  uint16_t battery_pct;
  /// Current, 0.01 A. Vendor firmware 38 fills the low byte only.
  uint16_t current_ca;
  /// Acceleration in x, y, z; 16,384 is 1 g.
  int16_t acc[3];
  /// Rotation about x, y, z; 16.4 is 1 degree/s.
  int16_t gyro[3];
  /// Magnetic field in x, y, z: counts of the sensor, whose scale the robot does not tell.
  int16_t mag[3];
  /// Heading, degrees, 0 to 360.
  int16_t heading_deg;
  /// Wheel speeds, turns per minute: front left, front right, back left, back right.
  int16_t rpm[4];
  /// Voltage, 0.1 V.
  uint8_t voltage_dv;
  /// Power, W.
  uint8_t power_w;
} axle_ucp_telemetry;

/// A report as received.
typedef struct axle_ucp_report {
  /// What the robot measures.
  struct axle_ucp_telemetry telemetry;
  /// Version of the robot's firmware; -1 if the layout has none.
  int32_t version;
  /// Counter of the robot.
  uint8_t index;
  /// Number of reports missing between the previous one and this one.
  uint8_t lost;
} axle_ucp_report;

/// Biases of the inertial sensors (ruling U11).
typedef struct axle_ucp_imu_bias {
  /// Acceleration in x, y, z; 16,384 is 1 g.
  int16_t acc[3];
  /// Rotation about x, y, z; 16.4 is 1 degree/s.
  int16_t gyro[3];
} axle_ucp_imu_bias;

/// Biases of the magnetometer (ruling U11).
typedef struct axle_ucp_mag_bias {
  /// Field in x, y, z: counts of the sensor.
  int16_t mag[3];
} axle_ucp_mag_bias;

/// Verdict on a frame that was answered (ruling U12): one of `AXLE_UCP_ERR_`; others survive.
typedef uint8_t axle_ucp_err;

/// Sensors to calibrate (ruling U11): one of `AXLE_UCP_CALIBRATION_`; other numbers survive.
typedef uint8_t axle_ucp_calibration;

/// Answer to a firmware update request: one of `AXLE_UCP_OTA_`; other numbers survive.
typedef uint8_t axle_ucp_ota_status;

/// An event of a host. What an event has is said with its kind; all else is 0.
typedef struct axle_ucp_host_event {
  /// Time from the start of a ping to the end of its pong, microseconds.
  uint32_t round_trip_us;
  /// What was reported.
  struct axle_ucp_report report;
  /// Biases of the inertial sensors.
  struct axle_ucp_imu_bias imu_bias;
  /// Biases of the magnetometer.
  struct axle_ucp_mag_bias mag_bias;
  /// One of `AXLE_UCP_HOST_`.
  uint8_t kind;
  /// Verdict on a ping, or of a robot that refused.
  axle_ucp_err err;
  /// Sensors to calibrate.
  axle_ucp_calibration calibration;
  /// The failed request: one of `AXLE_UCP_STEP_`.
  uint8_t step;
  /// Why: one of `AXLE_UCP_FAILURE_`.
  uint8_t cause;
  /// How often the request was sent.
  uint8_t attempts;
  /// 1 if biases of the inertial sensors are missing.
  uint8_t imu_missing;
  /// 1 if biases of the magnetometer are missing.
  uint8_t mag_missing;
  /// Answer to an update request.
  axle_ucp_ota_status ota_status;
  /// Id of an unknown frame.
  uint8_t id;
  /// Its counter.
  uint8_t index;
  /// Length of its body, bytes.
  uint8_t body_length;
  /// Its body.
  uint8_t body[AXLE_UCP_BODY_MAX_LENGTH];
} axle_ucp_host_event;

/// A motor command.
typedef struct axle_ucp_motor {
  /// Speed, percent, -100 to 100 (rulings U6, U7).
  int16_t speed_pct;
  /// Turn, percent, -100 to 100: a steering wheel, positive to the right (ruling U6).
  int16_t turn_pct;
  /// Lamp: 0 is off, anything else on.
  uint8_t lamp;
} axle_ucp_motor;

/// State of the host's network (ruling U8): one of `AXLE_UCP_NETWORK_`; other numbers survive.
typedef uint32_t axle_ucp_network_state;

/// What a host knows of its robot.
typedef struct axle_ucp_robot_state {
  /// Events that were refused because the queue was full.
  uint32_t lost_events;
  /// The command in force, if `is_commanded`.
  struct axle_ucp_motor command;
  /// Wheel speeds of a robot that still moves, turns per minute.
  int16_t rpm[4];
  /// One of `AXLE_UCP_LINK_`.
  uint8_t link;
  /// How far a stop has come: one of `AXLE_UCP_STOP_` (ruling U16).
  uint8_t stop;
  /// 1 if a command is in force.
  uint8_t is_commanded;
  /// 1 if the latest stop has left.
  uint8_t is_stop_sent;
  /// 1 during a firmware update.
  uint8_t is_updating;
  /// 1 if the latest calibration request has been answered or has failed.
  uint8_t is_calibration_over;
  /// Why it has failed: one of `AXLE_UCP_FAILURE_`; 0 if it has not.
  uint8_t calibration_failure;
} axle_ucp_robot_state;

/// Counts of a host.
typedef struct axle_ucp_host_statistics {
  /// Motor commands sent.
  uint32_t commands;
  /// Reports received.
  uint32_t reports;
  /// Reports missing, by their counter.
  uint32_t reports_lost;
  /// Reports that came twice.
  uint32_t reports_repeated;
  /// Pings sent.
  uint32_t pings;
  /// Pings without a pong.
  uint32_t pings_lost;
  /// Pongs that tell of a damaged ping, or have another code than 0.
  uint32_t pings_damaged;
  /// Pongs that nobody asked for.
  uint32_t pongs_unasked;
  /// How often the link went down.
  uint32_t links_lost;
  /// How often the dead-man has fired.
  uint32_t dead_man;
  /// Requests for biases received.
  uint32_t bias_requests;
  /// Biases sent.
  uint32_t biases;
  /// Results that came again.
  uint32_t results_repeated;
  /// Results for which the event queue had no room.
  uint32_t results_without_room;
  /// Calibration requests that failed.
  uint32_t calibration_failures;
  /// Calibration requests that were repeated.
  uint32_t calibration_retries;
  /// Acknowledgements that nobody asked for.
  uint32_t acks_unasked;
  /// Messages that only a host sends.
  uint32_t misdirected;
  /// Frames of no known message.
  uint32_t unknown;
  /// From the start of a ping to the end of its pong.
  struct axle_latency round_trip;
} axle_ucp_host_statistics;

/// A message of the link. Which fields it has is said with its kind; all others are 0.
typedef struct axle_ucp_message {
  /// Body of `AXLE_UCP_UNKNOWN`; if parsed, in the frame itself.
  const uint8_t *body;
  /// Its length, bytes.
  size_t body_length;
  /// State of the network.
  axle_ucp_network_state network_state;
  /// What is measured.
  struct axle_ucp_telemetry telemetry;
  /// Biases of the inertial sensors.
  struct axle_ucp_imu_bias imu_bias;
  /// Biases of the magnetometer.
  struct axle_ucp_mag_bias mag_bias;
  /// Speed, percent.
  int16_t speed_pct;
  /// Turn, percent.
  int16_t turn_pct;
  /// Lamp in front: 100 is on, 0 off.
  int16_t front_led;
  /// Lamp at the back, as parsed; shipped robots have none.
  int16_t back_led;
  /// Version: of a report, of an update, or of a motor command, as parsed (ruling U7).
  int16_t version;
  /// One of `AXLE_UCP_`: the message.
  uint8_t kind;
  /// Id of the frame.
  uint8_t id;
  /// Counter of the sender.
  uint8_t index;
  /// Verdict on the frame that is answered.
  axle_ucp_err err;
  /// Sensors to calibrate.
  axle_ucp_calibration calibration;
  /// Answer to an update request.
  axle_ucp_ota_status ota_status;
} axle_ucp_message;

/// Settings of a robot. Begin with those of `axle_ucp_robot_config_direct` or `_usb_adapter`.
typedef struct axle_ucp_robot_config {
  /// Speed of the line, bit/s; 115,200.
  uint32_t baud;
  /// Time without a valid command after which speed and turn become 0 (ruling U10); 500 ms.
  uint32_t watchdog_us;
  /// Period of reports (ruling U10); 20 ms.
  uint32_t report_period_us;
  /// Period at which a calibration result is repeated (ruling U11); 1000 ms.
  uint32_t result_period_us;
  /// Period of requests for biases (ruling U11); 1000 ms, 0 for none.
  uint32_t bias_request_period_us;
  /// Pause that cuts off a frame, besides two byte times; 5 ms.
  uint32_t idle_margin_us;
  /// Version of the firmware in reports (ruling U5); -1 for the layout of the document, without.
  int32_t version;
} axle_ucp_robot_config;

/// The robot's side of the link.
typedef struct axle_ucp_robot {
  /// Private.
  uint64_t memory[135];
} axle_ucp_robot;

/// An event of a robot. What an event has is said with its kind; all else is 0.
typedef struct axle_ucp_robot_event {
  /// State of the host's network.
  axle_ucp_network_state network_state;
  /// The command.
  struct axle_ucp_motor command;
  /// Biases of the inertial sensors.
  struct axle_ucp_imu_bias imu_bias;
  /// Biases of the magnetometer.
  struct axle_ucp_mag_bias mag_bias;
  /// The version offered.
  int16_t version;
  /// One of `AXLE_UCP_ROBOT_`.
  uint8_t kind;
  /// The verdict with the biases.
  axle_ucp_err err;
  /// Sensors to calibrate.
  axle_ucp_calibration calibration;
  /// 1 if this calibration is already running.
  uint8_t is_repeated;
  /// 1 if an update was asked for by a motor command (ruling U7), not by a request.
  uint8_t by_motor_command;
} axle_ucp_robot_event;

/// Counts of a robot.
typedef struct axle_ucp_robot_statistics {
  /// Motor commands accepted.
  uint32_t commands;
  /// Of these, with a speed or turn out of range, which was limited.
  uint32_t commands_clamped;
  /// Motor commands refused because they would start a firmware update (ruling U7).
  uint32_t commands_refused;
  /// How often the watchdog has fired.
  uint32_t watchdog;
  /// Reports sent.
  uint32_t reports;
  /// Reports that were left out.
  uint32_t reports_skipped;
  /// Pings received.
  uint32_t pings;
  /// Pongs sent.
  uint32_t pongs;
  /// Calibration requests of an unknown kind, or to end one that does not run.
  uint32_t calibration_refused;
  /// Calibration requests that came again.
  uint32_t calibration_repeats;
  /// Results sent.
  uint32_t results;
  /// Acknowledgements that were refused.
  uint32_t acks_refused;
  /// Requests for biases sent.
  uint32_t bias_requests;
  /// Messages that only a robot sends.
  uint32_t misdirected;
  /// Frames of no known message.
  uint32_t unknown;
  /// Messages for which the event queue had no room.
  uint32_t without_room;
  /// Events that were refused because the queue was full.
  uint32_t lost_events;
} axle_ucp_robot_statistics;

/// The port has taken all of the frame, but may still hold it.
#define AXLE_TRANSMIT_TAKEN 1

/// All bytes that the port has taken have left by now.
#define AXLE_TRANSMIT_FLUSHED 2

/// The frame did not leave at all, and will not be sent.
#define AXLE_TRANSMIT_UNTOUCHED 3

/// Part of the frame has left, and no more of it will be sent.
#define AXLE_TRANSMIT_CUT_OFF 4

/// The port took all of the frame, and then failed to send what it held.
#define AXLE_TRANSMIT_UNFLUSHED 5

/// The speed of its motors.
#define AXLE_IKEYA_MODE_VELOCITY 1

/// The position of its motors.
#define AXLE_IKEYA_MODE_POSITION 2

/// Done.
#define AXLE_OK 0

/// Done, and there is nothing: no event, no bytes, no deadline, no value yet.
#define AXLE_NONE 1

/// A pointer is null.
#define AXLE_ERROR_NULL (-1)

/// The memory is not of the size that this library needs: header and library are of different
/// versions.
#define AXLE_ERROR_SIZE (-2)

/// The object has not been initialised, or its memory was overwritten.
#define AXLE_ERROR_NOT_INITIALIZED (-3)

/// The object is in use: by a call that an interrupt has suspended, or by another thread.
#define AXLE_ERROR_BUSY (-4)

/// A pointer is not aligned as its type.
#define AXLE_ERROR_ALIGNMENT (-5)

/// The length is longer than any memory.
#define AXLE_ERROR_TOO_LONG (-6)

/// The bytes are in the memory of the object itself, or of the output.
#define AXLE_ERROR_OVERLAP (-7)

/// A number that stands for none of its kinds.
#define AXLE_ERROR_VALUE (-8)

/// A node id outside 1 to 8 (ruling I1).
#define AXLE_ERROR_NODE_ID (-20)

/// DIP switches that select no node (ruling I2).
#define AXLE_ERROR_DIP_SWITCH (-21)

/// NaN or infinity, where a motor needs a finite number (ruling I4).
#define AXLE_ERROR_NOT_FINITE (-22)

/// A position outside the range of count and rotation (ruling I5).
#define AXLE_ERROR_POSITION (-23)

/// A speed or turn outside -100 to 100 (rulings U6, U7).
#define AXLE_ERROR_PERCENT (-24)

/// A network state above 255 (ruling U8).
#define AXLE_ERROR_NETWORK_STATE (-25)

/// The buffer is too small for the frame.
#define AXLE_ERROR_BUFFER_TOO_SMALL (-26)

/// The body is longer than shipped robots can handle (rulings U2, U13).
#define AXLE_ERROR_BODY_TOO_LONG (-27)

/// An unknown frame with the id of a known message (rulings U7, U13).
#define AXLE_ERROR_KNOWN_ID (-28)

/// An unknown frame with FD FF behind its header (ruling U13).
#define AXLE_ERROR_NESTED_HEADER (-29)

/// A motor command that would start a firmware update (rulings U7, U13).
#define AXLE_ERROR_STARTS_UPDATE (-30)

/// The bytes are not as long as a packet, or as the length in its header.
#define AXLE_ERROR_LENGTH (-40)

/// The header or the node id has a value that no packet has.
#define AXLE_ERROR_FIELD (-41)

/// The CRC does not match (ruling B1).
#define AXLE_ERROR_CRC (-42)

/// The decoder is full: poll its events until `AXLE_NONE`, then push the byte again.
#define AXLE_ERROR_FULL (-43)

/// The node is not online: it has not answered yet, or no longer does (ruling I7).
#define AXLE_ERROR_NOT_ONLINE (-60)

/// The node is in the other mode (ruling I3).
#define AXLE_ERROR_WRONG_MODE (-61)

/// The mode of the node is in doubt; it is being read (ruling I11).
#define AXLE_ERROR_MODE_IN_DOUBT (-62)

/// The node is owed a stop, which comes first (ruling I12).
#define AXLE_ERROR_STOP_OWED (-63)

/// The node has no set-point that could be confirmed.
#define AXLE_ERROR_NO_SET_POINT (-64)

/// The robot is not heard (ruling U16).
#define AXLE_ERROR_LINK_DOWN (-80)

/// A calibration request is not answered yet, or its event has no room yet.
#define AXLE_ERROR_CALIBRATING (-81)

/// A kind of calibration that shipped robots do not know.
#define AXLE_ERROR_CALIBRATION_KIND (-82)

/// The robot hangs on such an id, and `low_ids_only` is set (ruling U14).
#define AXLE_ERROR_LOW_IDS_ONLY (-83)

/// The robot is not seen to stand still behind a stop (ruling U16).
#define AXLE_ERROR_MOVING (-84)

/// A firmware update is going on.
#define AXLE_ERROR_UPDATING (-85)

/// Refused for a reason that is newer than this header.
#define AXLE_ERROR_OTHER (-100)

/// The magnetometer; the host must turn the robot meanwhile.
#define AXLE_UCP_CALIBRATION_MAGNETOMETER 1

/// Accelerometer and gyroscope; the robot must stand still meanwhile.
#define AXLE_UCP_CALIBRATION_IMU 2

/// It arrived undamaged.
#define AXLE_UCP_ERR_FINE 0

/// It arrived damaged.
#define AXLE_UCP_ERR_DAMAGED 1

/// The update starts.
#define AXLE_UCP_OTA_ACCEPTED 0

/// An unknown error.
#define AXLE_UCP_OTA_FAILED 1

/// Not allowed.
#define AXLE_UCP_OTA_FORBIDDEN 2

/// Not known yet.
#define AXLE_UCP_NETWORK_UNKNOWN 0

/// No SIM card.
#define AXLE_UCP_NETWORK_SIM_ABSENT 1

/// No network.
#define AXLE_UCP_NETWORK_DISCONNECTED 2

/// Connected.
#define AXLE_UCP_NETWORK_CONNECTED 3

/// Firmware update in progress.
#define AXLE_UCP_NETWORK_OTA 4

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/// CRC-16/MODBUS of the bytes (ruling B1): what both protocols put behind them, low byte first.
///
/// 0xFFFF, the CRC of no bytes, if `data` is null.
uint16_t axle_crc16(const uint8_t *data, size_t length);

/// The name of a mode, such as "velocity"; "?" for another number.
const char *axle_ikeya_mode_name(axle_ikeya_mode kind);

/// The position as counts in all.
int32_t axle_ikeya_position_counts(struct axle_ikeya_position position);

/// The position at so many counts. Both parts have one sign, as in C; fails with
/// `AXLE_ERROR_POSITION` beyond 32,767 turns and 8,191 counts, or -32,768 turns and -8,191 counts.
axle_result axle_ikeya_position_from_counts(int32_t counts, struct axle_ikeya_position *position);

/// The name of a kind of event, such as "standing_still"; "?" for another number.
const char *axle_ikeya_master_event_name(uint8_t kind);

/// The name of a health, such as "online"; "?" for another number.
const char *axle_ikeya_health_name(uint8_t kind);

/// The name of a cause, such as "silent"; "?" for another number.
const char *axle_ikeya_cause_name(uint8_t kind);

/// The name of what became of a stop, such as "owed"; "?" for another number.
const char *axle_ikeya_stop_name(uint8_t kind);

/// Settings for one of the processor's own UARTs: 500 kbit/s, answers within 500 us.
axle_result axle_ikeya_master_config_direct(struct axle_ikeya_master_config *config);

/// Settings for a USB adapter, which may delay an answer by 16 ms: answers within 20 ms.
axle_result axle_ikeya_master_config_usb_adapter(struct axle_ikeya_master_config *config);

/// Makes a master that knows no node yet: call `discover`. `size` is `sizeof *master`.
/// Never call it during another call with the same object.
axle_result axle_ikeya_master_init(struct axle_ikeya_master *master,
                                   size_t size,
                                   const struct axle_ikeya_master_config *config,
                                   uint64_t now_us);

/// The next event; `AXLE_NONE` if there is none. Take them all before `poll_transmit`.
axle_result axle_ikeya_master_poll_event(struct axle_ikeya_master *master,
                                         struct axle_ikeya_master_event *event);

/// Asks all ids of this bus that are not online. During a discovery it changes nothing.
axle_result axle_ikeya_master_discover(struct axle_ikeya_master *master, uint64_t now_us);

/// Stops a node: sent before anything else, and repeated until the motor is seen to be at
/// rest, or until a set-point, which is refused before the stop is confirmed (I12).
///
/// `get_node` tells how far it is. After `stop_bound_us`, `coast_us` and `read_bound_us`, a
/// node that is not seen to stand still may be moving.
axle_result axle_ikeya_master_stop(struct axle_ikeya_master *master, uint8_t node, uint64_t now_us);

/// Stops all nodes of this bus, also those that do not answer (ruling I12).
axle_result axle_ikeya_master_stop_all(struct axle_ikeya_master *master, uint64_t now_us);

/// Checks whether a command with this motion would be accepted at the time of the latest
/// call; sends nothing. The dead-man may have fired since: `handle_timeout` tells. Fails as
/// the command would, and with `AXLE_ERROR_VALUE` for a mode of another number.
axle_result axle_ikeya_master_check(const struct axle_ikeya_master *master,
                                    uint8_t node,
                                    const struct axle_ikeya_motion *motion);

/// Reads a node soon; an event tells of the answer, or that it failed.
axle_result axle_ikeya_master_read(struct axle_ikeya_master *master, uint8_t node, uint64_t now_us);

/// Asks whether the set-point of a node has arrived; an event tells.
axle_result axle_ikeya_master_confirm(struct axle_ikeya_master *master,
                                      uint8_t node,
                                      uint64_t now_us);

/// Tells the dead-man that the application is there (ruling I13).
axle_result axle_ikeya_master_keep_alive(struct axle_ikeya_master *master, uint64_t now_us);

/// Forgets the set-point of a node, which keeps following it.
axle_result axle_ikeya_master_release(struct axle_ikeya_master *master, uint8_t node);

/// What is known of a node.
axle_result axle_ikeya_master_get_node(const struct axle_ikeya_master *master,
                                       uint8_t node,
                                       struct axle_ikeya_node *known);

/// What is known of the bus.
axle_result axle_ikeya_master_get_bus(const struct axle_ikeya_master *master,
                                      struct axle_ikeya_bus *known);

/// The counts so far.
axle_result axle_ikeya_master_get_statistics(const struct axle_ikeya_master *master,
                                             struct axle_ikeya_master_statistics *counts);

/// The counts of a node so far.
axle_result axle_ikeya_master_get_node_statistics(const struct axle_ikeya_master *master,
                                                  uint8_t node,
                                                  struct axle_ikeya_node_statistics *counts);

/// The account of the bytes received.
axle_result axle_ikeya_master_get_counters(const struct axle_ikeya_master *master,
                                           struct axle_counters *account);

/// Takes in all received bytes, which have just arrived.
///
/// Hand in all of them before the next `poll_transmit`; none is fine, too.
axle_result axle_ikeya_master_handle_input(struct axle_ikeya_master *role,
                                           const uint8_t *bytes,
                                           size_t length,
                                           uint64_t now_us);

/// Takes in received bytes that may have waited since `since_us`: the program was held up,
/// or a frame was handed out before they were read. An old command must not count as new.
axle_result axle_ikeya_master_handle_old_input(struct axle_ikeya_master *role,
                                               const uint8_t *bytes,
                                               size_t length,
                                               uint64_t since_us,
                                               uint64_t now_us);

/// Lets time pass. Call it when `next_deadline` is reached, with a time read before the
/// port was last found empty.
axle_result axle_ikeya_master_handle_timeout(struct axle_ikeya_master *role, uint64_t now_us);

/// The next frame to be sent, whole and at once; `AXLE_NONE` if there is none now. The
/// bytes are valid until the next call with this object.
axle_result axle_ikeya_master_poll_transmit(struct axle_ikeya_master *role,
                                            uint64_t now_us,
                                            const uint8_t **bytes,
                                            size_t *length);

/// Tells what has become of the latest frame, before any other call.
///
/// Needed if a frame did not leave whole: a command is then never sent late, and a stop is
/// due again. If the port holds bytes back, tell of `AXLE_TRANSMIT_TAKEN` after each frame
/// and of `AXLE_TRANSMIT_FLUSHED` once the bytes have left: both or neither.
axle_result axle_ikeya_master_handle_transmit(struct axle_ikeya_master *role,
                                              axle_transmit outcome,
                                              uint64_t now_us);

/// Whether a frame of which only a part was sent has become wrong: `AXLE_OK` if so: give
/// up the rest and tell of `AXLE_TRANSMIT_CUT_OFF`; `AXLE_NONE` if not.
axle_result axle_ikeya_master_is_outdated(const struct axle_ikeya_master *role);

/// When to call `handle_timeout` and `poll_transmit` again at the latest; `AXLE_NONE` if
/// only bytes or commands can change anything. Ask again after every other call.
axle_result axle_ikeya_master_next_deadline(const struct axle_ikeya_master *role, uint64_t *at_us);

/// What the role requires of its line.
axle_result axle_ikeya_master_get_line_rules(const struct axle_ikeya_master *role,
                                             struct axle_line_rules *rules);

/// Makes a master that knows no node yet: call `discover`. `size` is `sizeof *master`.
/// Never call it during another call with the same object.
axle_result axle_ikeya3_master_init(struct axle_ikeya3_master *master,
                                    size_t size,
                                    const struct axle_ikeya_master_config *config,
                                    uint64_t now_us);

/// The next event; `AXLE_NONE` if there is none. Take them all before `poll_transmit`.
axle_result axle_ikeya3_master_poll_event(struct axle_ikeya3_master *master,
                                          struct axle_ikeya_master_event *event);

/// Asks all ids of this bus that are not online. During a discovery it changes nothing.
axle_result axle_ikeya3_master_discover(struct axle_ikeya3_master *master, uint64_t now_us);

/// Stops a node: sent before anything else, and repeated until the motor is seen to be at
/// rest, or until a set-point, which is refused before the stop is confirmed (I12).
///
/// `get_node` tells how far it is. After `stop_bound_us`, `coast_us` and `read_bound_us`, a
/// node that is not seen to stand still may be moving.
axle_result axle_ikeya3_master_stop(struct axle_ikeya3_master *master,
                                    uint8_t node,
                                    uint64_t now_us);

/// Stops all nodes of this bus, also those that do not answer (ruling I12).
axle_result axle_ikeya3_master_stop_all(struct axle_ikeya3_master *master, uint64_t now_us);

/// Checks whether a command with this motion would be accepted at the time of the latest
/// call; sends nothing. The dead-man may have fired since: `handle_timeout` tells. Fails as
/// the command would, and with `AXLE_ERROR_VALUE` for a mode of another number.
axle_result axle_ikeya3_master_check(const struct axle_ikeya3_master *master,
                                     uint8_t node,
                                     const struct axle_ikeya_motion *motion);

/// Reads a node soon; an event tells of the answer, or that it failed.
axle_result axle_ikeya3_master_read(struct axle_ikeya3_master *master,
                                    uint8_t node,
                                    uint64_t now_us);

/// Asks whether the set-point of a node has arrived; an event tells.
axle_result axle_ikeya3_master_confirm(struct axle_ikeya3_master *master,
                                       uint8_t node,
                                       uint64_t now_us);

/// Tells the dead-man that the application is there (ruling I13).
axle_result axle_ikeya3_master_keep_alive(struct axle_ikeya3_master *master, uint64_t now_us);

/// Forgets the set-point of a node, which keeps following it.
axle_result axle_ikeya3_master_release(struct axle_ikeya3_master *master, uint8_t node);

/// What is known of a node.
axle_result axle_ikeya3_master_get_node(const struct axle_ikeya3_master *master,
                                        uint8_t node,
                                        struct axle_ikeya_node *known);

/// What is known of the bus.
axle_result axle_ikeya3_master_get_bus(const struct axle_ikeya3_master *master,
                                       struct axle_ikeya_bus *known);

/// The counts so far.
axle_result axle_ikeya3_master_get_statistics(const struct axle_ikeya3_master *master,
                                              struct axle_ikeya_master_statistics *counts);

/// The counts of a node so far.
axle_result axle_ikeya3_master_get_node_statistics(const struct axle_ikeya3_master *master,
                                                   uint8_t node,
                                                   struct axle_ikeya_node_statistics *counts);

/// The account of the bytes received.
axle_result axle_ikeya3_master_get_counters(const struct axle_ikeya3_master *master,
                                            struct axle_counters *account);

/// Takes in all received bytes, which have just arrived.
///
/// Hand in all of them before the next `poll_transmit`; none is fine, too.
axle_result axle_ikeya3_master_handle_input(struct axle_ikeya3_master *role,
                                            const uint8_t *bytes,
                                            size_t length,
                                            uint64_t now_us);

/// Takes in received bytes that may have waited since `since_us`: the program was held up,
/// or a frame was handed out before they were read. An old command must not count as new.
axle_result axle_ikeya3_master_handle_old_input(struct axle_ikeya3_master *role,
                                                const uint8_t *bytes,
                                                size_t length,
                                                uint64_t since_us,
                                                uint64_t now_us);

/// Lets time pass. Call it when `next_deadline` is reached, with a time read before the
/// port was last found empty.
axle_result axle_ikeya3_master_handle_timeout(struct axle_ikeya3_master *role, uint64_t now_us);

/// The next frame to be sent, whole and at once; `AXLE_NONE` if there is none now. The
/// bytes are valid until the next call with this object.
axle_result axle_ikeya3_master_poll_transmit(struct axle_ikeya3_master *role,
                                             uint64_t now_us,
                                             const uint8_t **bytes,
                                             size_t *length);

/// Tells what has become of the latest frame, before any other call.
///
/// Needed if a frame did not leave whole: a command is then never sent late, and a stop is
/// due again. If the port holds bytes back, tell of `AXLE_TRANSMIT_TAKEN` after each frame
/// and of `AXLE_TRANSMIT_FLUSHED` once the bytes have left: both or neither.
axle_result axle_ikeya3_master_handle_transmit(struct axle_ikeya3_master *role,
                                               axle_transmit outcome,
                                               uint64_t now_us);

/// Whether a frame of which only a part was sent has become wrong: `AXLE_OK` if so: give
/// up the rest and tell of `AXLE_TRANSMIT_CUT_OFF`; `AXLE_NONE` if not.
axle_result axle_ikeya3_master_is_outdated(const struct axle_ikeya3_master *role);

/// When to call `handle_timeout` and `poll_transmit` again at the latest; `AXLE_NONE` if
/// only bytes or commands can change anything. Ask again after every other call.
axle_result axle_ikeya3_master_next_deadline(const struct axle_ikeya3_master *role,
                                             uint64_t *at_us);

/// What the role requires of its line.
axle_result axle_ikeya3_master_get_line_rules(const struct axle_ikeya3_master *role,
                                              struct axle_line_rules *rules);

/// Turns a motor at this speed, turns per second, from now on.
///
/// Fails with `AXLE_ERROR_NOT_ONLINE`, `AXLE_ERROR_WRONG_MODE`, `AXLE_ERROR_MODE_IN_DOUBT`,
/// `AXLE_ERROR_STOP_OWED`, `AXLE_ERROR_NOT_FINITE` or `AXLE_ERROR_NODE_ID`.
axle_result axle_ikeya_master_set_velocity(struct axle_ikeya_master *master,
                                           uint8_t node,
                                           float rps,
                                           uint64_t now_us);

/// Moves a motor to this position.
///
/// Fails as `axle_ikeya_master_set_velocity`.
axle_result axle_ikeya_master_set_position(struct axle_ikeya_master *master,
                                           uint8_t node,
                                           struct axle_ikeya_position position,
                                           uint64_t now_us);

/// Turns the three motors of a node at these speeds, turns per second; `rps` has three elements.
///
/// Fails as `axle_ikeya_master_set_velocity`.
axle_result axle_ikeya3_master_set_velocity(struct axle_ikeya3_master *master,
                                            uint8_t node,
                                            const float *rps,
                                            uint64_t now_us);

/// Moves the three motors of a node to these positions; `positions` has three elements.
///
/// Fails as `axle_ikeya_master_set_velocity`.
axle_result axle_ikeya3_master_set_position(struct axle_ikeya3_master *master,
                                            uint8_t node,
                                            const struct axle_ikeya_position *positions,
                                            uint64_t now_us);

/// The name of a kind of packet, such as "read"; "?" for another number.
const char *axle_ikeya_packet_name(uint8_t kind);

/// Writes the packet with its CRC to `to`, which has room for `capacity` bytes, and its length.
///
/// Fails with `AXLE_ERROR_NODE_ID`, `AXLE_ERROR_NOT_FINITE`, `AXLE_ERROR_BUFFER_TOO_SMALL`, or
/// `AXLE_ERROR_VALUE` for an unknown kind or number of motors.
axle_result axle_ikeya_encode(const struct axle_ikeya_packet *packet,
                              uint8_t *to,
                              size_t capacity,
                              size_t *length);

/// Reads a packet of exactly these bytes; of 16 bytes if its board has three motors.
///
/// Fails with `AXLE_ERROR_LENGTH`, `AXLE_ERROR_FIELD`, `AXLE_ERROR_NODE_ID` or `AXLE_ERROR_CRC`.
axle_result axle_ikeya_parse(const uint8_t *data, size_t length, struct axle_ikeya_packet *packet);

/// A bus of so many nodes with the values by default.
axle_result axle_ikeya_schedule_default(struct axle_ikeya_schedule *schedule, uint8_t nodes);

/// The shortest cycle of a bus.
///
/// Fails with `AXLE_ERROR_VALUE` for a `baud` of 0, and `AXLE_ERROR_NODE_ID` for more than 8 nodes
/// or none. Times that do not fit are `UINT32_MAX`.
axle_result axle_ikeya_schedule_get_cycle(const struct axle_ikeya_schedule *schedule,
                                          struct axle_ikeya_cycle *cycle);

/// Settings for one of the processor's own UARTs at 500 kbit/s.
axle_result axle_ikeya_slave_config_direct(struct axle_ikeya_slave_config *config);

/// Settings for a slave on a host: a USB adapter makes pauses of up to 16 ms.
axle_result axle_ikeya_slave_config_usb_adapter(struct axle_ikeya_slave_config *config);

/// The name of a kind of event, such as "watchdog"; "?" for another number.
const char *axle_ikeya_slave_event_name(uint8_t kind);

/// Reads four DIP switches, one bit each: the id of the node and its mode (ruling I2).
///
/// `reading` is `AXLE_IKEYA_ID_VALUE_PLUS_ONE` or `AXLE_IKEYA_ID_VALUE`.
axle_result axle_ikeya_dip_switches(uint8_t switches,
                                    uint8_t reading,
                                    uint8_t *node,
                                    axle_ikeya_mode *mode);

/// Makes a slave with this id, 1 to 8, in this mode. `size` is `sizeof *slave`. Never call
/// it during another call with the same object.
axle_result axle_ikeya_slave_init(struct axle_ikeya_slave *slave,
                                  size_t size,
                                  uint8_t node,
                                  axle_ikeya_mode mode,
                                  const struct axle_ikeya_slave_config *config,
                                  uint64_t now_us);

/// The next event; `AXLE_NONE` if there is none.
axle_result axle_ikeya_slave_poll_event(struct axle_ikeya_slave *slave,
                                        struct axle_ikeya_slave_event *event);

/// The command in force; `AXLE_NONE` if there is none, or if it is too old for the
/// watchdog: the motor must then be at rest. Correct at any time.
axle_result axle_ikeya_slave_get_command(const struct axle_ikeya_slave *slave,
                                         uint64_t now_us,
                                         struct axle_ikeya_motion *command);

/// The mode, one of `AXLE_IKEYA_MODE_`.
axle_result axle_ikeya_slave_get_mode(const struct axle_ikeya_slave *slave, axle_ikeya_mode *mode);

/// Changes the mode; the command in force ends.
axle_result axle_ikeya_slave_set_mode(struct axle_ikeya_slave *slave, axle_ikeya_mode mode);

/// The counts so far.
axle_result axle_ikeya_slave_get_statistics(const struct axle_ikeya_slave *slave,
                                            struct axle_ikeya_slave_statistics *counts);

/// The account of the bytes received.
axle_result axle_ikeya_slave_get_counters(const struct axle_ikeya_slave *slave,
                                          struct axle_counters *account);

/// Takes in all received bytes, which have just arrived.
///
/// Hand in all of them before the next `poll_transmit`; none is fine, too.
axle_result axle_ikeya_slave_handle_input(struct axle_ikeya_slave *role,
                                          const uint8_t *bytes,
                                          size_t length,
                                          uint64_t now_us);

/// Takes in received bytes that may have waited since `since_us`: the program was held up,
/// or a frame was handed out before they were read. An old command must not count as new.
axle_result axle_ikeya_slave_handle_old_input(struct axle_ikeya_slave *role,
                                              const uint8_t *bytes,
                                              size_t length,
                                              uint64_t since_us,
                                              uint64_t now_us);

/// Lets time pass. Call it when `next_deadline` is reached, with a time read before the
/// port was last found empty.
axle_result axle_ikeya_slave_handle_timeout(struct axle_ikeya_slave *role, uint64_t now_us);

/// The next frame to be sent, whole and at once; `AXLE_NONE` if there is none now. The
/// bytes are valid until the next call with this object.
axle_result axle_ikeya_slave_poll_transmit(struct axle_ikeya_slave *role,
                                           uint64_t now_us,
                                           const uint8_t **bytes,
                                           size_t *length);

/// Tells what has become of the latest frame, before any other call.
///
/// Needed if a frame did not leave whole: a command is then never sent late, and a stop is
/// due again. If the port holds bytes back, tell of `AXLE_TRANSMIT_TAKEN` after each frame
/// and of `AXLE_TRANSMIT_FLUSHED` once the bytes have left: both or neither.
axle_result axle_ikeya_slave_handle_transmit(struct axle_ikeya_slave *role,
                                             axle_transmit outcome,
                                             uint64_t now_us);

/// Whether a frame of which only a part was sent has become wrong: `AXLE_OK` if so: give
/// up the rest and tell of `AXLE_TRANSMIT_CUT_OFF`; `AXLE_NONE` if not.
axle_result axle_ikeya_slave_is_outdated(const struct axle_ikeya_slave *role);

/// When to call `handle_timeout` and `poll_transmit` again at the latest; `AXLE_NONE` if
/// only bytes or commands can change anything. Ask again after every other call.
axle_result axle_ikeya_slave_next_deadline(const struct axle_ikeya_slave *role, uint64_t *at_us);

/// What the role requires of its line.
axle_result axle_ikeya_slave_get_line_rules(const struct axle_ikeya_slave *role,
                                            struct axle_line_rules *rules);

/// Makes a slave with this id, 1 to 8, in this mode. `size` is `sizeof *slave`. Never call
/// it during another call with the same object.
axle_result axle_ikeya3_slave_init(struct axle_ikeya3_slave *slave,
                                   size_t size,
                                   uint8_t node,
                                   axle_ikeya_mode mode,
                                   const struct axle_ikeya_slave_config *config,
                                   uint64_t now_us);

/// The next event; `AXLE_NONE` if there is none.
axle_result axle_ikeya3_slave_poll_event(struct axle_ikeya3_slave *slave,
                                         struct axle_ikeya_slave_event *event);

/// The command in force; `AXLE_NONE` if there is none, or if it is too old for the
/// watchdog: the motor must then be at rest. Correct at any time.
axle_result axle_ikeya3_slave_get_command(const struct axle_ikeya3_slave *slave,
                                          uint64_t now_us,
                                          struct axle_ikeya_motion *command);

/// The mode, one of `AXLE_IKEYA_MODE_`.
axle_result axle_ikeya3_slave_get_mode(const struct axle_ikeya3_slave *slave,
                                       axle_ikeya_mode *mode);

/// Changes the mode; the command in force ends.
axle_result axle_ikeya3_slave_set_mode(struct axle_ikeya3_slave *slave, axle_ikeya_mode mode);

/// The counts so far.
axle_result axle_ikeya3_slave_get_statistics(const struct axle_ikeya3_slave *slave,
                                             struct axle_ikeya_slave_statistics *counts);

/// The account of the bytes received.
axle_result axle_ikeya3_slave_get_counters(const struct axle_ikeya3_slave *slave,
                                           struct axle_counters *account);

/// Takes in all received bytes, which have just arrived.
///
/// Hand in all of them before the next `poll_transmit`; none is fine, too.
axle_result axle_ikeya3_slave_handle_input(struct axle_ikeya3_slave *role,
                                           const uint8_t *bytes,
                                           size_t length,
                                           uint64_t now_us);

/// Takes in received bytes that may have waited since `since_us`: the program was held up,
/// or a frame was handed out before they were read. An old command must not count as new.
axle_result axle_ikeya3_slave_handle_old_input(struct axle_ikeya3_slave *role,
                                               const uint8_t *bytes,
                                               size_t length,
                                               uint64_t since_us,
                                               uint64_t now_us);

/// Lets time pass. Call it when `next_deadline` is reached, with a time read before the
/// port was last found empty.
axle_result axle_ikeya3_slave_handle_timeout(struct axle_ikeya3_slave *role, uint64_t now_us);

/// The next frame to be sent, whole and at once; `AXLE_NONE` if there is none now. The
/// bytes are valid until the next call with this object.
axle_result axle_ikeya3_slave_poll_transmit(struct axle_ikeya3_slave *role,
                                            uint64_t now_us,
                                            const uint8_t **bytes,
                                            size_t *length);

/// Tells what has become of the latest frame, before any other call.
///
/// Needed if a frame did not leave whole: a command is then never sent late, and a stop is
/// due again. If the port holds bytes back, tell of `AXLE_TRANSMIT_TAKEN` after each frame
/// and of `AXLE_TRANSMIT_FLUSHED` once the bytes have left: both or neither.
axle_result axle_ikeya3_slave_handle_transmit(struct axle_ikeya3_slave *role,
                                              axle_transmit outcome,
                                              uint64_t now_us);

/// Whether a frame of which only a part was sent has become wrong: `AXLE_OK` if so: give
/// up the rest and tell of `AXLE_TRANSMIT_CUT_OFF`; `AXLE_NONE` if not.
axle_result axle_ikeya3_slave_is_outdated(const struct axle_ikeya3_slave *role);

/// When to call `handle_timeout` and `poll_transmit` again at the latest; `AXLE_NONE` if
/// only bytes or commands can change anything. Ask again after every other call.
axle_result axle_ikeya3_slave_next_deadline(const struct axle_ikeya3_slave *role, uint64_t *at_us);

/// What the role requires of its line.
axle_result axle_ikeya3_slave_get_line_rules(const struct axle_ikeya3_slave *role,
                                             struct axle_line_rules *rules);

/// Sets the speed that is measured, turns per second, for the next answers in velocity mode.
axle_result axle_ikeya_slave_set_velocity(struct axle_ikeya_slave *slave, float rps);

/// Sets the position that is measured, for the next answers in position mode.
axle_result axle_ikeya_slave_set_position(struct axle_ikeya_slave *slave,
                                          struct axle_ikeya_position position);

/// The same for three motors; `rps` has three elements.
axle_result axle_ikeya3_slave_set_velocity(struct axle_ikeya3_slave *slave, const float *rps);

/// The same for three motors; `positions` has three elements.
axle_result axle_ikeya3_slave_set_position(struct axle_ikeya3_slave *slave,
                                           const struct axle_ikeya_position *positions);

/// Its name, such as "AXLE_ERROR_NULL"; "?" for a number that is no result.
const char *axle_result_name(axle_result result);

/// What it means, in a few words.
const char *axle_result_text(axle_result result);

/// The name of a reason, such as "crc"; "?" for another number.
const char *axle_reason_name(uint8_t kind);

/// Makes an empty decoder of this framing: `AXLE_IKEYA_TO_SLAVE`, `AXLE_IKEYA_TO_MASTER`, or, for a
/// recording of both, `AXLE_IKEYA_BOTH_DIRECTIONS`; the same with `AXLE_IKEYA3_` for boards with
/// three motors. `size` is `sizeof *decoder`. Never call it during another call with the same
/// object.
axle_result axle_ikeya_decoder_init(struct axle_ikeya_decoder *decoder,
                                    size_t size,
                                    uint8_t framing);

/// Makes an empty decoder. `size` is `sizeof *decoder`. Never call it during another call with the
/// same object.
axle_result axle_ucp_decoder_init(struct axle_ucp_decoder *decoder, size_t size);

/// The next frame or gap in the bytes that are held and in `*data`; advances `*data` and
/// `*length` past the bytes used. `AXLE_NONE` once all are used up.
///
/// Call it until it returns `AXLE_NONE`, or go on later with the rest.
axle_result axle_ikeya_decoder_decode(struct axle_ikeya_decoder *decoder,
                                      const uint8_t **data,
                                      size_t *length,
                                      struct axle_stream_event *event);

/// The next frames and gaps, at most `capacity` of them, for a long recording: one call
/// instead of one for each. Writes their number to `*count`; `AXLE_NONE` and 0 once all
/// bytes are used up.
///
/// Fewer than `capacity` do not tell that all are used up: a frame that began in earlier
/// data is the last one of its call, as it is held in the decoder.
axle_result axle_ikeya_decoder_decode_many(struct axle_ikeya_decoder *decoder,
                                           const uint8_t **data,
                                           size_t *length,
                                           struct axle_stream_event *events,
                                           size_t capacity,
                                           size_t *count);

/// Takes in one byte: `AXLE_OK` if there may be an event to poll, `AXLE_NONE` if not.
///
/// Poll until `AXLE_NONE` before the next byte: a full decoder refuses it, with
/// `AXLE_ERROR_FULL`.
axle_result axle_ikeya_decoder_push(struct axle_ikeya_decoder *decoder, uint8_t byte);

/// The next frame or gap in the bytes that are held; `AXLE_NONE` if there is none.
axle_result axle_ikeya_decoder_poll(struct axle_ikeya_decoder *decoder,
                                    struct axle_stream_event *event);

/// Free space behind the bytes that are held, for a port or a DMA to write into; then
/// `commit` them. At least one byte once `poll` has returned `AXLE_NONE`.
axle_result axle_ikeya_decoder_spare(struct axle_ikeya_decoder *decoder,
                                     uint8_t **bytes,
                                     size_t *length);

/// Takes in the first bytes of the spare space; more than its length count as that.
axle_result axle_ikeya_decoder_commit(struct axle_ikeya_decoder *decoder, size_t length);

/// Tells that the line went quiet: the bytes that are held will not be completed (ruling
/// B3). Then poll until `AXLE_NONE`.
///
/// A possible start of a frame at the very end is still held: if nothing follows at all, as
/// at the end of a file, repeat it, and poll, until `get_pending` gives 0.
axle_result axle_ikeya_decoder_idle(struct axle_ikeya_decoder *decoder);

/// Number of bytes that are held and undecided.
axle_result axle_ikeya_decoder_get_pending(const struct axle_ikeya_decoder *decoder, size_t *count);

/// The account of all bytes so far.
axle_result axle_ikeya_decoder_get_counters(const struct axle_ikeya_decoder *decoder,
                                            struct axle_counters *account);

/// The next frame or gap in the bytes that are held and in `*data`; advances `*data` and
/// `*length` past the bytes used. `AXLE_NONE` once all are used up.
///
/// Call it until it returns `AXLE_NONE`, or go on later with the rest.
axle_result axle_ucp_decoder_decode(struct axle_ucp_decoder *decoder,
                                    const uint8_t **data,
                                    size_t *length,
                                    struct axle_stream_event *event);

/// The next frames and gaps, at most `capacity` of them, for a long recording: one call
/// instead of one for each. Writes their number to `*count`; `AXLE_NONE` and 0 once all
/// bytes are used up.
///
/// Fewer than `capacity` do not tell that all are used up: a frame that began in earlier
/// data is the last one of its call, as it is held in the decoder.
axle_result axle_ucp_decoder_decode_many(struct axle_ucp_decoder *decoder,
                                         const uint8_t **data,
                                         size_t *length,
                                         struct axle_stream_event *events,
                                         size_t capacity,
                                         size_t *count);

/// Takes in one byte: `AXLE_OK` if there may be an event to poll, `AXLE_NONE` if not.
///
/// Poll until `AXLE_NONE` before the next byte: a full decoder refuses it, with
/// `AXLE_ERROR_FULL`.
axle_result axle_ucp_decoder_push(struct axle_ucp_decoder *decoder, uint8_t byte);

/// The next frame or gap in the bytes that are held; `AXLE_NONE` if there is none.
axle_result axle_ucp_decoder_poll(struct axle_ucp_decoder *decoder,
                                  struct axle_stream_event *event);

/// Free space behind the bytes that are held, for a port or a DMA to write into; then
/// `commit` them. At least one byte once `poll` has returned `AXLE_NONE`.
axle_result axle_ucp_decoder_spare(struct axle_ucp_decoder *decoder,
                                   uint8_t **bytes,
                                   size_t *length);

/// Takes in the first bytes of the spare space; more than its length count as that.
axle_result axle_ucp_decoder_commit(struct axle_ucp_decoder *decoder, size_t length);

/// Tells that the line went quiet: the bytes that are held will not be completed (ruling
/// B3). Then poll until `AXLE_NONE`.
///
/// A possible start of a frame at the very end is still held: if nothing follows at all, as
/// at the end of a file, repeat it, and poll, until `get_pending` gives 0.
axle_result axle_ucp_decoder_idle(struct axle_ucp_decoder *decoder);

/// Number of bytes that are held and undecided.
axle_result axle_ucp_decoder_get_pending(const struct axle_ucp_decoder *decoder, size_t *count);

/// The account of all bytes so far.
axle_result axle_ucp_decoder_get_counters(const struct axle_ucp_decoder *decoder,
                                          struct axle_counters *account);

/// The time at this reading of a timer of 32 bits that counts microseconds; 0 if `clock` is null.
///
/// Start with a `clock` of zeros. Pass readings in order, at least one every 71 minutes, and none
/// from an interrupt while another is passed.
uint64_t axle_clock32_at(struct axle_clock32 *clock, uint32_t timer_us);

/// Time that so many bytes take on a line, 10 bit times each, microseconds (ruling B6).
uint32_t axle_wire_time_us(size_t bytes, uint32_t baud);

/// Settings for one of the processor's own UARTs.
axle_result axle_ucp_host_config_direct(struct axle_ucp_host_config *config);

/// Settings for a USB adapter.
axle_result axle_ucp_host_config_usb_adapter(struct axle_ucp_host_config *config);

/// Time within which a calibration request has been acknowledged or has failed, with these
/// settings; `UINT32_MAX` if that does not fit.
axle_result axle_ucp_host_get_calibration_bound(const struct axle_ucp_host_config *config,
                                                uint32_t *bound_us);

/// The name of a kind of event, such as "link_up"; "?" for another number.
const char *axle_ucp_host_event_name(uint8_t kind);

/// The name of a failure, such as "refused"; "?" for another number.
const char *axle_ucp_failure_name(uint8_t kind);

/// The name of the state of a link, such as "up"; "?" for another number.
const char *axle_ucp_link_name(uint8_t kind);

/// The name of what became of a stop, such as "due"; "?" for another number.
const char *axle_ucp_stop_name(uint8_t kind);

/// Makes a host without biases. `size` is `sizeof *host`. Never call it during another call with
/// the same object.
axle_result axle_ucp_host_init(struct axle_ucp_host *host,
                               size_t size,
                               const struct axle_ucp_host_config *config,
                               uint64_t now_us);

/// Takes in all received bytes, which have just arrived.
///
/// Hand in all of them before the next `poll_transmit`; none is fine, too.
axle_result axle_ucp_host_handle_input(struct axle_ucp_host *role,
                                       const uint8_t *bytes,
                                       size_t length,
                                       uint64_t now_us);

/// Takes in received bytes that may have waited since `since_us`: the program was held up,
/// or a frame was handed out before they were read. An old command must not count as new.
axle_result axle_ucp_host_handle_old_input(struct axle_ucp_host *role,
                                           const uint8_t *bytes,
                                           size_t length,
                                           uint64_t since_us,
                                           uint64_t now_us);

/// Lets time pass. Call it when `next_deadline` is reached, with a time read before the
/// port was last found empty.
axle_result axle_ucp_host_handle_timeout(struct axle_ucp_host *role, uint64_t now_us);

/// The next frame to be sent, whole and at once; `AXLE_NONE` if there is none now. The
/// bytes are valid until the next call with this object.
axle_result axle_ucp_host_poll_transmit(struct axle_ucp_host *role,
                                        uint64_t now_us,
                                        const uint8_t **bytes,
                                        size_t *length);

/// Tells what has become of the latest frame, before any other call.
///
/// Needed if a frame did not leave whole: a command is then never sent late, and a stop is
/// due again. If the port holds bytes back, tell of `AXLE_TRANSMIT_TAKEN` after each frame
/// and of `AXLE_TRANSMIT_FLUSHED` once the bytes have left: both or neither.
axle_result axle_ucp_host_handle_transmit(struct axle_ucp_host *role,
                                          axle_transmit outcome,
                                          uint64_t now_us);

/// Whether a frame of which only a part was sent has become wrong: `AXLE_OK` if so: give
/// up the rest and tell of `AXLE_TRANSMIT_CUT_OFF`; `AXLE_NONE` if not.
axle_result axle_ucp_host_is_outdated(const struct axle_ucp_host *role);

/// When to call `handle_timeout` and `poll_transmit` again at the latest; `AXLE_NONE` if
/// only bytes or commands can change anything. Ask again after every other call.
axle_result axle_ucp_host_next_deadline(const struct axle_ucp_host *role, uint64_t *at_us);

/// What the role requires of its line.
axle_result axle_ucp_host_get_line_rules(const struct axle_ucp_host *role,
                                         struct axle_line_rules *rules);

/// The next event; `AXLE_NONE` if there is none. Take them all before `poll_transmit`.
axle_result axle_ucp_host_poll_event(struct axle_ucp_host *host, struct axle_ucp_host_event *event);

/// Drives at this speed and turn, percent, until the next command; the lamp is off. The host
/// repeats it; call again within the time of the dead-man (rulings U6, U10).
///
/// Fails with `AXLE_ERROR_PERCENT`, `AXLE_ERROR_LINK_DOWN` or `AXLE_ERROR_UPDATING`.
axle_result axle_ucp_host_set_speed(struct axle_ucp_host *host,
                                    int16_t speed_pct,
                                    int16_t turn_pct,
                                    uint64_t now_us);

/// The same with the lamp.
axle_result axle_ucp_host_drive(struct axle_ucp_host *host,
                                struct axle_ucp_motor command,
                                uint64_t now_us);

/// Tells the robot to stand still, again and again, until reports show that it does (ruling U16).
///
/// `get_robot_state` tells how far it is. After `AXLE_UCP_COAST_US`, a robot that is not seen to
/// stand still may be moving.
axle_result axle_ucp_host_stop(struct axle_ucp_host *host, uint64_t now_us);

/// Asks the robot to start a calibration; an event tells (ruling U11).
axle_result axle_ucp_host_start_calibration(struct axle_ucp_host *host,
                                            axle_ucp_calibration calibration,
                                            uint64_t now_us);

/// Asks the robot to end a calibration; events tell of that and of the result (ruling U11).
axle_result axle_ucp_host_end_calibration(struct axle_ucp_host *host,
                                          axle_ucp_calibration calibration,
                                          uint64_t now_us);

/// Tells the robot the state of the network, for its lamp (ruling U8).
axle_result axle_ucp_host_set_network_state(struct axle_ucp_host *host,
                                            axle_ucp_network_state state,
                                            uint64_t now_us);

/// Asks the robot for a firmware update to this version, once it is seen to stand still. The robot
/// then answers no more: the application takes the port (ruling U7).
axle_result axle_ucp_host_start_firmware_update(struct axle_ucp_host *host,
                                                int16_t version,
                                                uint64_t now_us);

/// Ends a firmware update: the host speaks to the robot again.
axle_result axle_ucp_host_end_firmware_update(struct axle_ucp_host *host, uint64_t now_us);

/// What is known of the robot.
axle_result axle_ucp_host_get_robot_state(const struct axle_ucp_host *host,
                                          struct axle_ucp_robot_state *state);

/// The latest report, once; `AXLE_NONE` if there is no new one. It need not be polled as an event.
axle_result axle_ucp_host_take_report(struct axle_ucp_host *host, struct axle_ucp_report *report);

/// The latest report, however old; `AXLE_NONE` if there is none.
axle_result axle_ucp_host_get_report(const struct axle_ucp_host *host,
                                     struct axle_ucp_report *report);

/// Time of the latest ping to its pong, once, microseconds; `AXLE_NONE` if there is no new one.
axle_result axle_ucp_host_take_round_trip(struct axle_ucp_host *host, uint32_t *round_trip_us);

/// Gives the host the biases that a program has kept: a robot that boots asks for them.
axle_result axle_ucp_host_set_imu_bias(struct axle_ucp_host *host, struct axle_ucp_imu_bias bias);

/// The same for the magnetometer.
axle_result axle_ucp_host_set_mag_bias(struct axle_ucp_host *host, struct axle_ucp_mag_bias bias);

/// The biases that the host keeps, for a program that stores them: those of the latest calibration,
/// which the robot was told are kept, or those that were set; `AXLE_NONE` if there are none.
axle_result axle_ucp_host_get_imu_bias(const struct axle_ucp_host *host,
                                       struct axle_ucp_imu_bias *bias);

/// The same of the magnetometer.
axle_result axle_ucp_host_get_mag_bias(const struct axle_ucp_host *host,
                                       struct axle_ucp_mag_bias *bias);

/// The counts so far.
axle_result axle_ucp_host_get_statistics(const struct axle_ucp_host *host,
                                         struct axle_ucp_host_statistics *counts);

/// The account of the bytes received.
axle_result axle_ucp_host_get_counters(const struct axle_ucp_host *host,
                                       struct axle_counters *account);

/// The name of a kind of message, such as "report"; "?" for another number.
const char *axle_ucp_message_name(uint8_t kind);

/// Writes the frame of a message with its CRC to `to`, which has room for `capacity` bytes, and
/// its length.
///
/// Fails with `AXLE_ERROR_PERCENT`, `AXLE_ERROR_STARTS_UPDATE`, `AXLE_ERROR_NETWORK_STATE`,
/// `AXLE_ERROR_KNOWN_ID`, `AXLE_ERROR_NESTED_HEADER`, `AXLE_ERROR_BODY_TOO_LONG`,
/// `AXLE_ERROR_BUFFER_TOO_SMALL`, `AXLE_ERROR_OVERLAP` if the body is in `to`, or
/// `AXLE_ERROR_VALUE` for an unknown kind, or for a motor command with a version, with a lamp other
/// than 0 and 100, or with a lamp at the back.
axle_result axle_ucp_encode(const struct axle_ucp_message *message,
                            uint8_t *to,
                            size_t capacity,
                            size_t *length);

/// Reads the message in a frame of exactly these bytes.
///
/// Fails with `AXLE_ERROR_LENGTH`, `AXLE_ERROR_FIELD` or `AXLE_ERROR_CRC`.
axle_result axle_ucp_parse(const uint8_t *data, size_t length, struct axle_ucp_message *message);

/// Settings for one of the processor's own UARTs.
axle_result axle_ucp_robot_config_direct(struct axle_ucp_robot_config *config);

/// Settings for a robot on a host.
axle_result axle_ucp_robot_config_usb_adapter(struct axle_ucp_robot_config *config);

/// The name of a kind of event, such as "motor"; "?" for another number.
const char *axle_ucp_robot_event_name(uint8_t kind);

/// Makes a robot. `size` is `sizeof *robot`. Never call it during another call with the same
/// object.
axle_result axle_ucp_robot_init(struct axle_ucp_robot *robot,
                                size_t size,
                                const struct axle_ucp_robot_config *config,
                                uint64_t now_us);

/// Takes in all received bytes, which have just arrived.
///
/// Hand in all of them before the next `poll_transmit`; none is fine, too.
axle_result axle_ucp_robot_handle_input(struct axle_ucp_robot *role,
                                        const uint8_t *bytes,
                                        size_t length,
                                        uint64_t now_us);

/// Takes in received bytes that may have waited since `since_us`: the program was held up,
/// or a frame was handed out before they were read. An old command must not count as new.
axle_result axle_ucp_robot_handle_old_input(struct axle_ucp_robot *role,
                                            const uint8_t *bytes,
                                            size_t length,
                                            uint64_t since_us,
                                            uint64_t now_us);

/// Lets time pass. Call it when `next_deadline` is reached, with a time read before the
/// port was last found empty.
axle_result axle_ucp_robot_handle_timeout(struct axle_ucp_robot *role, uint64_t now_us);

/// The next frame to be sent, whole and at once; `AXLE_NONE` if there is none now. The
/// bytes are valid until the next call with this object.
axle_result axle_ucp_robot_poll_transmit(struct axle_ucp_robot *role,
                                         uint64_t now_us,
                                         const uint8_t **bytes,
                                         size_t *length);

/// Tells what has become of the latest frame, before any other call.
///
/// Needed if a frame did not leave whole: a command is then never sent late, and a stop is
/// due again. If the port holds bytes back, tell of `AXLE_TRANSMIT_TAKEN` after each frame
/// and of `AXLE_TRANSMIT_FLUSHED` once the bytes have left: both or neither.
axle_result axle_ucp_robot_handle_transmit(struct axle_ucp_robot *role,
                                           axle_transmit outcome,
                                           uint64_t now_us);

/// Whether a frame of which only a part was sent has become wrong: `AXLE_OK` if so: give
/// up the rest and tell of `AXLE_TRANSMIT_CUT_OFF`; `AXLE_NONE` if not.
axle_result axle_ucp_robot_is_outdated(const struct axle_ucp_robot *role);

/// When to call `handle_timeout` and `poll_transmit` again at the latest; `AXLE_NONE` if
/// only bytes or commands can change anything. Ask again after every other call.
axle_result axle_ucp_robot_next_deadline(const struct axle_ucp_robot *role, uint64_t *at_us);

/// What the role requires of its line.
axle_result axle_ucp_robot_get_line_rules(const struct axle_ucp_robot *role,
                                          struct axle_line_rules *rules);

/// The next event; `AXLE_NONE` if there is none. Take them all before `poll_transmit`.
axle_result axle_ucp_robot_poll_event(struct axle_ucp_robot *robot,
                                      struct axle_ucp_robot_event *event);

/// The command in force: the latest, or a stop if it is too old. Correct at any time.
axle_result axle_ucp_robot_get_command(const struct axle_ucp_robot *robot,
                                       uint64_t now_us,
                                       struct axle_ucp_motor *command);

/// The command in force if it has changed since the last call; `AXLE_NONE` if not. A stop by the
/// watchdog is a change.
axle_result axle_ucp_robot_take_command(struct axle_ucp_robot *robot,
                                        uint64_t now_us,
                                        struct axle_ucp_motor *command);

/// Sets the content of the next reports. The first call starts them.
axle_result axle_ucp_robot_set_telemetry(struct axle_ucp_robot *robot,
                                         const struct axle_ucp_telemetry *telemetry,
                                         uint64_t now_us);

/// Sends the result of a calibration until the host has it (ruling U11).
axle_result axle_ucp_robot_calibration_result_imu(struct axle_ucp_robot *robot,
                                                  struct axle_ucp_imu_bias bias,
                                                  uint64_t now_us);

/// The same for the magnetometer.
axle_result axle_ucp_robot_calibration_result_mag(struct axle_ucp_robot *robot,
                                                  struct axle_ucp_mag_bias bias,
                                                  uint64_t now_us);

/// Answers a firmware update request; `AXLE_NONE` if there is none. The application stops the
/// motors first, and takes the port after `AXLE_UCP_OTA_ACCEPTED`.
axle_result axle_ucp_robot_answer_update(struct axle_ucp_robot *robot,
                                         axle_ucp_ota_status status,
                                         uint64_t now_us);

/// The calibration that is running; `AXLE_NONE` if there is none.
axle_result axle_ucp_robot_get_calibration(const struct axle_ucp_robot *robot,
                                           axle_ucp_calibration *calibration);

/// The state of the host's network, as told last; `AXLE_NONE` if it was not.
axle_result axle_ucp_robot_get_network_state(const struct axle_ucp_robot *robot,
                                             axle_ucp_network_state *state);

/// Ends the running calibration without a result, and tells which one; `AXLE_NONE` if there is
/// none. The host is not told.
axle_result axle_ucp_robot_abort_calibration(struct axle_ucp_robot *robot,
                                             axle_ucp_calibration *calibration);

/// The counts so far.
axle_result axle_ucp_robot_get_statistics(const struct axle_ucp_robot *robot,
                                          struct axle_ucp_robot_statistics *counts);

/// The account of the bytes received.
axle_result axle_ucp_robot_get_counters(const struct axle_ucp_robot *robot,
                                        struct axle_counters *account);

/// The name of a calibration, such as "imu"; "?" for another number.
const char *axle_ucp_calibration_name(axle_ucp_calibration kind);

/// The name of an answer to an update, such as "accepted"; "?" for another number.
const char *axle_ucp_ota_status_name(axle_ucp_ota_status kind);

/// The name of a state of the network, such as "connected"; "?" for another number.
const char *axle_ucp_network_state_name(axle_ucp_network_state kind);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* AXLEWIRE_H */
