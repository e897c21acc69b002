// The roles as the page has them, without a page: what a page that was held up may not do.
//
//   node tests/roles.mjs
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";

import { Bus, initSync, Rover, Simulator } from "../pkg/axlewire_web.js";

initSync({ module: readFileSync(new URL("../pkg/axlewire_web_bg.wasm", import.meta.url)) });

/** Serves a line for so long, a millisecond at a time. */
function serve(role, simulator, from, ms) {
  for (let now = from; now < from + ms; now += 1) {
    for (let frame; (frame = role.transmit(now));) simulator.write(frame, now);
    role.receive(simulator.read(now), now);
  }
  return from + ms;
}

/** Only the other end goes on: the page was held up. */
function hold(simulator, from, ms) {
  for (let now = from; now < from + ms; now += 1) simulator.read(now);
  return from + ms;
}

/** A position motor on its long way, at some phase of its reads. */
function underWay(phase) {
  const simulator = Simulator.bus("1:position", 1, 0);
  const bus = new Bus(500_000, 600_000, 0);
  bus.discover(0);
  const now = serve(bus, simulator, 0, 2000);
  bus.set_position(1, 40, now);
  return { simulator, bus, now: serve(bus, simulator, now, 700 + phase) };
}

const state = (role, now) => JSON.parse(role.state(now));

{
  const simulator = Simulator.rover(1, 0);
  const rover = new Rover(500, 0);
  let now = serve(rover, simulator, 0, 1000);
  rover.drive(50, 0, now);
  now = hold(simulator, serve(rover, simulator, now, 300), 2000);
  rover.keep_alive(now);
  assert.equal(state(rover, now).command.speed, 0, "a person who comes late starts nothing again");
  now = serve(rover, simulator, now, 4000);
  assert.equal(state(rover, now).stop, "standing_still");
  rover.drive(50, 0, now);
  for (let part = 0; part < 20; part += 1) {
    now = serve(rover, simulator, now, 300);
    rover.keep_alive(now);
  }
  assert.equal(state(rover, now).command.speed, 50, "a person who is there keeps it going");
  assert.match(rover.events(), /dead_man/);
}

{
  const simulator = Simulator.bus("1:velocity", 1, 0);
  const bus = new Bus(500_000, 500, 0);
  bus.discover(0);
  let now = serve(bus, simulator, 0, 2000);
  bus.set_velocity(1, 1, now);
  now = hold(simulator, serve(bus, simulator, now, 300), 2000);
  bus.keep_alive(now);
  now = serve(bus, simulator, now, 3000);
  assert.equal(state(bus, now).nodes[0].stop, "standing_still", "the dead-man was not put off");
  assert.match(bus.events(), /dead_man/);
  assert.throws(() => bus.set_velocity(9, 1, now), /9/);
  assert.throws(() => bus.set_velocity(1, NaN, now), Error);
}

// Of a position motor, old answers are not taken for where it is: a stop does not drive it back.
for (let phase = 0; phase < 40; phase += 1) {
  let { simulator, bus, now } = underWay(phase);
  const waiting = [];
  for (const end = now + 1500; now < end; now += 1) waiting.push(...simulator.read(now));
  const at = JSON.parse(simulator.state()).nodes[0].turns;
  bus.stop_all(now);
  for (let frame; (frame = bus.transmit(now));) simulator.write(frame, now);
  bus.receive(new Uint8Array(waiting), now);
  now = serve(bus, simulator, now, 6000);
  assert.equal(state(bus, now).nodes[0].stop, "standing_still");
  const stood = JSON.parse(simulator.state()).nodes[0].turns;
  assert.ok(stood > at - 0.05, `phase ${phase}: it was at ${at}, and stands at ${stood}`);
}

// A page that closes hears nothing any more: what it hands over stops a position motor too.
for (let phase = 0; phase < 40; phase += 1) {
  let { simulator, bus, now } = underWay(phase);
  bus.stop_all(now);
  // As `stopWithoutWaiting` of the page does it.
  for (let isHandedOver = false; ; now += 1) {
    const frame = bus.transmit(now);
    if (frame) simulator.write(frame, now);
    else if (isHandedOver) break;
    isHandedOver ||= frame !== undefined;
  }
  simulator.write(bus.last_words(now), now);
  now = hold(simulator, now, 4000);
  const { turns } = JSON.parse(simulator.state()).nodes[0];
  now = hold(simulator, now, 1000);
  assert.equal(JSON.parse(simulator.state()).nodes[0].turns, turns, `phase ${phase}: it stands`);
  assert.ok(turns < 39, `phase ${phase}: it was not stopped, but has arrived`);
}

/** Another master turns this node. Returns the time. */
function turnedByAnother(simulator, node) {
  const other = new Bus(500_000, 600_000, 0);
  other.discover(0);
  const found = serve(other, simulator, 0, 2000);
  other.set_velocity(node, 1, found);
  return serve(other, simulator, found, 2000);
}

// One that is plugged in later is found and stopped behind a STOP.
{
  const simulator = Simulator.bus("1:velocity 2:velocity", 1, 0);
  let now = turnedByAnother(simulator, 2);
  simulator.unplug(2, true);
  const bus = new Bus(500_000, 600_000, now);
  bus.discover(now);
  now = serve(bus, simulator, now, 3000);
  simulator.unplug(2, false);
  now = serve(bus, simulator, now, 1000);
  bus.stop_all(now);
  now = serve(bus, simulator, now, 5000);
  assert.deepEqual(
    state(bus, now)
      .nodes.map(({ stop }) => stop)
      .slice(0, 3),
    ["standing_still", "standing_still", "not_asked"],
  );
  assert.ok(Math.abs(JSON.parse(simulator.state()).nodes[1].rps) < 0.05);
}

// Also while another one, which is owed its stop, is missing.
{
  const simulator = Simulator.bus("1:velocity 2:velocity", 1, 0);
  let now = turnedByAnother(simulator, 2);
  simulator.unplug(2, true);
  const bus = new Bus(500_000, 600_000, now);
  bus.discover(now);
  now = serve(bus, simulator, now, 3000);
  bus.set_velocity(1, 1, now);
  now = serve(bus, simulator, now, 1000);
  simulator.unplug(1, true);
  simulator.unplug(2, false);
  now = serve(bus, simulator, now, 500);
  bus.stop_all(now);
  now = serve(bus, simulator, now, 5000);
  assert.equal(state(bus, now).nodes[0].stop, "owed");
  assert.equal(state(bus, now).nodes[1].stop, "standing_still");
  assert.ok(Math.abs(JSON.parse(simulator.state()).nodes[1].rps) < 0.05);
  simulator.unplug(1, false);
  now = serve(bus, simulator, now, 2000);
  assert.equal(state(bus, now).nodes[0].stop, "standing_still");
}

{
  const simulator = Simulator.bus("1:velocity 8:velocity", 1, 0);
  let now = turnedByAnother(simulator, 8);
  const bus = new Bus(500_000, 600_000, now);
  bus.discover(now);
  while (state(bus, now).nodes[0].mode === null) now = serve(bus, simulator, now, 1);
  assert.equal(state(bus, now).nodes[7].mode, null, "it is not found yet");
  bus.stop_all(now);
  now = serve(bus, simulator, now, 5000);
  assert.equal(
    state(bus, now).nodes[7].stop,
    "standing_still",
    "a STOP holds for what is found later",
  );
  assert.ok(Math.abs(JSON.parse(simulator.state()).nodes[1].rps) < 0.05);
}

{
  const simulator = Simulator.bus("1:velocity", 1, 0);
  const bus = new Bus(500_000, 600_000, 0);
  bus.discover(0);
  let now = 0;
  for (let cycle = 0; cycle < 1000; cycle += 1) {
    simulator.unplug(1, cycle % 2 === 0);
    now = serve(bus, simulator, now, 400);
  }
  assert.equal(JSON.parse(bus.events()).length, 1000, "a hidden page keeps the latest events only");
}

console.log("the roles of the page: a late sign of life puts no dead-man off");
