"""Lines: buses and rovers, simulated on pseudo-terminals."""

import asyncio
import faulthandler
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import axlewire
import pytest
from axlewire import Bus, NoAnswer, NotOnline, PortLost, Refused, Rover, StillMoving, StopsOwed, sim

WRONG = (PortLost, StopsOwed, StillMoving, NoAnswer, NotOnline)



@pytest.fixture(autouse=True)
def nothing_hangs():
    faulthandler.dump_traceback_later(40, exit=True)
    yield
    faulthandler.cancel_dump_traceback_later()


@pytest.fixture
def port():
    with sim.bus({1: "velocity", 2: "position"}) as port:
        yield port


@pytest.fixture
def field():
    with sim.rover() as port:
        yield port


def turning(port, rps=2.0, **options):
    bus = Bus(port, **options)
    bus.discover()
    bus[1].velocity = rps
    bus.wait(0.2)
    return bus


def told(port, text, within=3.0):
    """Whether the simulator tells this after the last command to move."""
    end = time.monotonic() + within
    while text not in port.log.split("command 2.00 rps")[-1].split("moving")[-1]:
        if time.monotonic() > end:
            return False
        time.sleep(0.01)
    return True


def test_nodes_are_found_and_do_what_they_are_told(port):
    with Bus(port) as bus:
        assert bus.discover() == {1: "velocity", 2: "position"} and bus.online == [1, 2]
        bus[1].velocity, bus[2].position = 2.0, -0.5
        bus.wait(1.0)
        assert bus[1].velocity == pytest.approx(2, abs=0.05)
        assert bus[2].position == pytest.approx(-0.5, abs=0.01)
        assert (bus[2].mode, bus[3].mode, bus[3].health) == ("position", None, "unknown")
        assert repr(bus[1]) == f"<axlewire.Node 1 of {port.path}>"


@pytest.mark.parametrize("code,error,nodes", [
    ("bus[2].velocity = 1.0", Refused, [2]), ("bus[1].position = 1.0", Refused, [1]),
    ("bus[5].velocity = 1.0", NotOnline, [5]), ("bus[5].velocity", NotOnline, [5]),
    ("bus.stop(5)", StopsOwed, [5]), ("bus.stop_all()", StopsOwed, [3, 4, 5, 6, 7, 8]),
    ("bus[1].velocity = float('nan')", ValueError, 0), ("bus[1].velocity = 1e300", ValueError, 0),
    ("bus[2].position = 32768", ValueError, 0), ("bus[1].velocity = '2'", TypeError, 0),
    ("bus.wait(-1)", ValueError, 0), ("bus[0]", KeyError, 0), ("bus[9]", KeyError, 0),
    pytest.param("bus[1].position", Refused, [1]),
])
def test_what_cannot_be_done_is_refused_with_the_nodes(port, code, error, nodes):
    with Bus(port) as bus:
        bus.discover()
        with pytest.raises(error) as raised:
            exec(code)
        assert nodes == 0 or raised.value.nodes == nodes
        assert "turning" not in port.log


def test_the_motor_stops_when_python_is_silent(port):
    bus = turning(port, dead_man_s=0.5)
    bus.wait(1.0)
    assert "command 0.00 rps" not in port.log
    time.sleep(1.0)
    assert "command 0.00 rps" in port.log and told(port, "node 1: at rest")
    bus.close()


@pytest.mark.parametrize("rps", [2.0, 40.0])
def test_a_stop_returns_when_the_motor_is_seen_to_stand(port, rps):
    with turning(port, rps) as bus:
        bus.stop()
        assert abs(bus[1].velocity) < 0.05 and bus[1].stop_progress == "standing_still"
    assert told(port, "node 1: at rest")


BEGIN = """import axlewire, gc, os, signal, sys, threading, time
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)
port = sys.argv[1]
class Holder: pass
def bus(): return axlewire.Bus(port, dead_man_s=None)
def turn(bus): bus.discover(); bus[1].velocity = 2.0; bus.wait(0.2)
def rover(): return axlewire.Rover(port, dead_man_s=60)
def go(rover): rover.drive(60); time.sleep(0.2)
"""
ENDS = {
    "by leaving its block": "with make() as it: turn(it)\nos._exit(0)",
    "by an exception": "with make() as it: turn(it); 1 / 0",
    "by sys.exit": "with make() as it: turn(it); sys.exit(3)",
    "by sys.exit without a block": "it = make(); turn(it); sys.exit(3)",
    "at the end of the program": "it = make(); turn(it)",
    "by del": "it = make(); turn(it); del it\nos._exit(0)",
    "by the collector": "h = Holder(); h.it, h.me = make(), h; turn(h.it); del h; gc.collect()\n"
                        "os._exit(0)",
    "by a thread": "it = make(); turn(it); t = threading.Thread(target=it.close); t.start()\n"
                   "t.join(); os._exit(0)",
}


def child(code, port, **options):
    command = [sys.executable, "-X", "faulthandler", "-c", BEGIN + code, os.fspath(port)]
    return subprocess.Popen(command, stdout=-1, stderr=-1, text=True, **options)


@pytest.mark.parametrize("kind", ["bus", "rover"])
@pytest.mark.parametrize("how", ENDS)
def test_what_moves_is_stopped_and_stands(how, kind, port, field):
    line, moved, stop = {"bus": (port, "command 2.00 rps", "node 1: command 0.00 rps"),
                         "rover": (field, "speed 60 %", "command: speed 0 %")}[kind]
    code = "make = bus\n" if kind == "bus" else "make, turn = rover, go\n"
    _, err = child(code + ENDS[how], line).communicate(timeout=30)
    assert moved in line.log and told(line, stop, 0), err
    assert told(line, "at rest") and "axlewire" not in err


@pytest.mark.parametrize("call", [
    "bus wait(30)", "bus stop()", "bus close()", "bus discover()",
    "rover drive(60, 0, seconds=30)", "rover stop()", "rover close()"])
def test_ctrl_c_in_a_wait_is_raised_at_once_and_what_moves_is_stopped(call, port, field):
    kind, call = call.split(" ", 1)
    line, begin = (port, "turn") if kind == "bus" else (field, "go")
    process = child(f"""it = {kind}(); {begin}(it); print("begins", flush=True)
try: it.{call}
except KeyboardInterrupt: print(time.monotonic())""", line)
    assert process.stdout.readline() == "begins\n"
    time.sleep(0.1)
    sent = time.monotonic()
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=30)
    print(f"Ctrl-C in {kind} {call}: {(float(out or 1e9) - sent) * 1e3:.0f} ms")
    assert float(out) - sent < 0.5, err
    assert told(line, "command 0.00 rps" if kind == "bus" else "command: speed 0 %", 0)
    assert told(line, "at rest")


def test_ctrl_c_of_a_terminal_does_not_end_a_simulator():
    process = child("""with axlewire.sim.bus() as port, bus() as it:
    turn(it); print("begins", flush=True); it.wait(30)""", "", start_new_session=True)
    assert process.stdout.readline() == "begins\n"
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=30)
    assert "KeyboardInterrupt" in err and "StopsOwed" not in err, err


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_motor_is_stopped_when_the_program_is_told_to_end(number, port):
    process = child("it = bus(); turn(it); print('begins', flush=True); it.wait(30)", port)
    assert process.stdout.readline() == "begins\n"
    process.send_signal(number)
    process.communicate(timeout=30)
    assert told(port, "node 1: at rest")


def test_a_simulator_ends_with_its_program():
    out, _ = child("s = axlewire.sim.bus(); print(s._process.pid)", "").communicate(timeout=30)
    with pytest.raises(ProcessLookupError):
        os.kill(int(out), signal.SIGTERM)


@pytest.mark.parametrize("code", ["it.stop()", "it.discover()", "it[1].velocity = 1.0",
                                  pytest.param("it.wait(0.5)")])
def test_a_pulled_cable_of_a_bus_is_told_with_the_nodes(port, code):
    it, begin = turning(port), time.monotonic()
    port.close()
    with pytest.raises(WRONG) as raised:
        exec(code)
    assert raised.type is PortLost or 1 in raised.value.nodes
    with pytest.raises((StopsOwed, StillMoving)) as raised:
        it.close()
    assert 1 in raised.value.nodes and time.monotonic() - begin < 12


@pytest.mark.parametrize("code,after", [("it.drive(60, seconds=30)", 0.2), ("it.stop()", 0.05)])
def test_a_pulled_cable_of_a_rover_is_told(field, code, after):
    it, begin = Rover(field), time.monotonic()
    it.drive(60)
    with ThreadPoolExecutor(1) as threads, pytest.raises(WRONG):
        threads.submit(lambda: (time.sleep(after), field.close()))
        while True:
            exec(code)
    with pytest.raises(WRONG):
        it.close()
    assert time.monotonic() - begin < 12


def test_the_reports_of_a_pulled_cable_end(field):
    with Rover(field) as rover:
        reports = rover.reports()
        next(reports)
        field.close()
        with pytest.raises((PortLost, StopIteration)):
            end = time.monotonic() + 1
            while time.monotonic() < end:
                reports.next(0.2) or reports.is_over and next(reports)


def test_several_threads_use_one_bus(port):
    with turning(port) as bus, ThreadPoolExecutor(8) as threads:
        def work(at):
            for _ in range(20):
                bus[1].velocity = 1.0 + at / 10
                assert isinstance(bus[1].velocity, float) and bus[2].position is not None
        assert list(threads.map(work, range(8))) == [None] * 8
        waits = [threads.submit(bus.wait, 30) for _ in range(7)]
        time.sleep(0.2)
        bus.close()
        assert all(isinstance(it.exception(timeout=5), PortLost) for it in waits)
    assert told(port, "node 1: at rest")


def test_a_rover_drives_and_tells_what_it_measures(field):
    with Rover(field) as rover, ThreadPoolExecutor(1) as threads:
        reports, begin = rover.reports(), time.monotonic()
        seen = threads.submit(lambda: [next(reports) for _ in range(40)])
        rover.drive(speed=60, angular=0, seconds=1)
        assert 1 < time.monotonic() - begin < 6 and max(map(abs, rover.report.rpm)) <= 2
        assert max(it.rpm[0] for it in seen.result(timeout=5)) > 20
        report = rover.report
        assert report.battery_pct <= 100 and report.voltage_dv > 50 and report.version == 38
        assert 0 < rover.ping() < 0.5 and rover.link == "up" and "battery_pct" in repr(report)
        rover.drive(60)
        time.sleep(1.2)
        assert told(field, "command: speed 0 %", 0)
        with pytest.raises((Refused, ValueError)):
            rover.drive(101)
    assert told(field, "at rest")


def in_order(seen):
    return {(b - a) % 256 for a, b in zip(seen, seen[1:])} == {1}


def test_reports_come_whole_during_a_stop(field):
    with Rover(field) as rover:
        reports = rover.reports()
        rover.drive(60, seconds=0.5)
        assert in_order([next(reports).index for _ in range(60)])


def test_a_report_has_the_fields_of_a_capture(field):
    with Rover(field) as rover:
        fields = axlewire.Decoder("ucp").feed(axlewire.ucp.report())[0].fields
        report = next(rover.reports())
        for name in fields.keys() - {"length", "bytes", "id", "protocol", "message"}:
            getattr(report, name)


async def indexes(reports, count, patience):
    found = []
    while len(found) < count:
        try:
            found.append((await asyncio.wait_for(anext(reports), patience)).index)
        except asyncio.TimeoutError:
            pass
    return found


async def all_of(reports):
    return [report async for report in reports]


def test_reports_come_by_async_for_and_end_with_the_line(field):
    async def main():
        rover, seen = Rover(field), []
        task = asyncio.create_task(all_of(rover.reports()))
        async for report in rover.reports():
            seen.append(report.index)
            if len(seen) == 20:
                task.cancel()
                with pytest.raises(asyncio.CancelledError):
                    await asyncio.wait_for(task, 1)
                await asyncio.to_thread(rover.close)
        return seen
    seen = asyncio.run(main())
    assert len(seen) >= 20 and in_order(seen)


def test_a_cancelled_wait_loses_no_report(field):
    with Rover(field) as rover:
        assert in_order(asyncio.run(indexes(rover.reports(), 8, 0.005)))


def test_a_closed_line_can_be_closed_again_and_not_be_used(port, field):
    bus, rover = turning(port), Rover(field)
    for line in (bus, bus, rover, rover):
        line.close()
    for use in [bus.discover, bus.stop, bus.stop_all, bus.keep_alive, lambda: bus[1].velocity,
                lambda: bus.wait(1), lambda: bus.online, lambda: rover.drive(1), rover.stop,
                rover.ping, rover.reports, lambda: rover.report]:
        with pytest.raises(PortLost, match="closed"):
            use()
    for kind in (Bus, Rover):
        with pytest.raises(OSError, match="/dev/none"):
            kind("/dev/none")


def test_a_stop_is_for_whatever_turns_also_by_a_program_that_was_killed(port):
    process = child("it = bus(); turn(it); os._exit(0)", port)
    process.communicate(timeout=30)
    with Bus(port) as other:
        other.discover()
        assert other[1].velocity > 1
        other.stop()
        assert abs(other[1].velocity) < 0.05
    with Bus(port) as unheard, pytest.raises(Refused, match="discover"):
        unheard.stop()


def test_a_stop_takes_over_from_a_drive_of_another_thread(field):
    with Rover(field) as rover, ThreadPoolExecutor(1) as threads:
        driving = threads.submit(rover.drive, 60, 0, seconds=30)
        time.sleep(0.5)
        rover.stop()
        time.sleep(0.5)
        assert max(map(abs, rover.report.rpm)) <= 2
        with pytest.raises(Refused, match="another call"):
            driving.result(timeout=5)


def test_a_close_that_failed_fails_again(port):
    bus = turning(port)
    port.close()
    for _ in range(2):
        with pytest.raises((StopsOwed, StillMoving)) as raised:
            bus.close()
        assert raised.value.nodes == [1]


def test_each_of_several_closes_waits_and_tells_the_same(port):
    bus = turning(port)
    port.close()
    with ThreadPoolExecutor(3) as threads:
        closing = [threads.submit(bus.close) for _ in range(3)]
        assert all(isinstance(it.exception(30), (StopsOwed, StillMoving)) for it in closing)


def test_a_forked_process_has_no_line(port):
    code = """it = bus(); turn(it)
if os.fork() == 0:
    try: it.online
    except axlewire.PortLost as error: print(error, flush=True)
    it.close()
    del it
    sys.exit(0)
os.wait(); time.sleep(0.1); print(it[1].velocity > 1)"""
    out, err = child(code, port).communicate(timeout=30)
    assert out == "the line belongs to the process that opened it\nTrue\n", err
    assert told(port, "node 1: at rest")


def test_a_port_that_is_closed_is_free_although_a_forked_process_goes_on(port):
    code = """it = bus(); turn(it)
if os.fork() == 0:
    sys.stdout.close(); time.sleep(8); os._exit(0)
it.close(); it = bus(); print(it.discover(), flush=True)"""
    process = child(code, port)
    assert process.stdout.readline().startswith("{1: ")
    process.wait(20)


@pytest.mark.parametrize("ends", ["raise SystemExit", "1 / 0", "time.sleep(30)"])
def test_motors_are_stopped_although_another_thread_never_ends(port, ends):
    code = f"""it = bus(); turn(it)
def log():
    while True: it[1].velocity; time.sleep(0.05)
threading.Thread(target=log).start()
print("goes on", flush=True)
{ends}"""
    process = child(code, port)
    assert process.stdout.readline() == "goes on\n"
    if "sleep" in ends:
        process.send_signal(signal.SIGTERM)
    process.communicate(timeout=15)
    assert told(port, "node 1: at rest")


def test_motors_are_stopped_before_the_program_is_suspended(port):
    process = child("""it = bus(); turn(it); print("turns", flush=True); time.sleep(30)""", port)
    assert process.stdout.readline() == "turns\n"
    process.send_signal(signal.SIGTSTP)
    assert told(port, "node 1: at rest")
    process.send_signal(signal.SIGCONT)
    process.kill()
    process.communicate()


def test_what_no_bus_can_mean_is_refused_in_plain_words(port):
    for baud in [0, 1, True]:
        with pytest.raises(ValueError, match="bit/s is not from 1200"):
            Bus(port, baud=baud)
    with pytest.raises(ValueError, match="0.0005"):
        Bus(port, reply_timeout_s=0)
    with Bus(port) as bus:
        for node in [-1, 0, 9, 256]:
            with pytest.raises(KeyError, match=f"node id {node} is outside 1 to 8"):
                bus[node]
        found = bus.discover()
        assert list(bus) == list(found) and 1 in bus and 0 not in bus


def test_what_was_asked_for_behind_a_ctrl_c_is_not_done(port):
    code = """it = bus(); it.discover()
t = threading.Thread(target=lambda: it.stop(5), daemon=True); t.start(); time.sleep(0.1)
print("begins", flush=True)
try: it[1].velocity = 2.0
except KeyboardInterrupt: pass
time.sleep(3); print(it[1].velocity)"""
    process = child(code, port)
    assert process.stdout.readline() == "begins\n"
    time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=40)
    assert float(out) == 0 and "command 2.00 rps" not in port.log, err


def test_the_dead_man_that_has_fired_is_told(port):
    with turning(port, dead_man_s=0.3) as bus:
        time.sleep(0.8)
        with pytest.warns(UserWarning, match="dead-man"):
            bus.online
