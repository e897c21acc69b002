"""What a user writes: checked by mypy and pyright, and not run."""

import axlewire
from axlewire import Frame, Gap

with axlewire.sim.rover() as port, axlewire.Rover(port) as rover:
    rover.drive(speed=30, seconds=1)
    report = rover.report
    assert report is not None
    print(report.rpm, rover.ping() + 1)
    for each in rover.reports():
        print(each.index)
        break
capture = axlewire.read("x.pcapng", units="si")
print(capture["report"]["rpm_0"], len(capture.gaps), capture.plot().svg)
for event in axlewire.Decoder("ucp").feed(bytearray(3)):
    match event:
        case Frame("report"):
            print(event.raw)
        case Gap(length, reason):
            print(length + 1, reason.upper())
with axlewire.Bus("/dev/x", nodes=[1, 2]) as bus:
    for node, mode in bus.discover().items():
        print(node + 1, mode.upper())
    bus[1].velocity = 2
    bus.stop(1, 2)
try:
    pass
except axlewire.StopsOwed as error:
    print(error.nodes)
