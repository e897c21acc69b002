# Made by stubs.sh: do not edit.
import os
from collections.abc import Awaitable, Iterable, Iterator, Sequence
from typing import IO, TypeAlias
from typing_extensions import Buffer, CapsuleType
from axlewire._picture import Picture
from _typeshed import Incomplete, SupportsGetItem, SupportsLenAndGetItem
from typing import Any, Final, SupportsFloat, SupportsIndex, final
__version__: Final[str]

Path: TypeAlias = str | os.PathLike[str]
Source: TypeAlias = Path | Sequence[Path] | Buffer | IO[bytes]

@final
class Bus:
    """
    A motor bus on a serial port (Ikeya MD, boards with one motor).

    Its motors are stopped, and seen to stand still, when the `with` block is left, at the end of
    the program, and when the object is collected. Between calls a thread of its own serves the
    line. Call something at least every `dead_man_s`, or `wait`: else the motors are stopped,
    because whoever is at the keyboard may have gone. Each node is read, and told its set-point
    again, every `period_s`.
    """
    def __contains__(self, node: SupportsIndex, /) -> bool:
        """
        Whether a node is online.
        """
    def __enter__(self, /) -> Bus: ...
    def __exit__(self, /, kind: type | None, value: Any | None, trace: Any | None) -> None: ...
    def __getitem__(self, node: SupportsIndex, /) -> Node:
        """
        A node by its id, 1 to 8.
        """
    def __iter__(self, /) -> Iterator[str]:
        """
        The ids of the nodes that are online, as `online`.
        """
    def __new__(cls, /, port: "str | os.PathLike[str]", *, nodes: "Iterable[int] | None" = None, baud: SupportsIndex = 500000, dead_man_s: SupportsFloat | SupportsIndex | None = ..., reply_timeout_s: SupportsFloat | SupportsIndex | None = None, period_s: SupportsFloat | SupportsIndex = 0.02) -> Bus: ...
    def __repr__(self, /) -> str: ...
    def close(self, /) -> None:
        """
        Stops what was moved, waits until it is seen to stand still, and closes the port.
        """
    def discover(self, /) -> "dict[int, str]":
        """
        Asks all ids, and returns the nodes that answer with their modes.
        """
    def keep_alive(self, /) -> None:
        """
        Tells the dead-man that somebody is there.
        """
    @property
    def online(self, /) -> list[int]:
        """
        The ids of the nodes that are online.
        """
    @property
    def statistics(self, /) -> dict[str, Any]:
        """
        The counts so far, as a dictionary.
        """
    def stop(self, /, *nodes: "int") -> "None":
        """
        Stops these nodes, or all that were heard, and returns when their motors are seen to stand
        still. Raises `StopsOwed` or `StillMoving` with the nodes whose motors may be moving.
        """
    def stop_all(self, /) -> None:
        """
        Stops every node that may be on this bus, heard or not. Those that were never heard cannot
        confirm it, so `StopsOwed` is raised for them: say with `Bus(..., nodes=[1, 2])` which ids
        there are. `stop()` stops those that were heard.
        """
    def wait(self, /, seconds: SupportsFloat | SupportsIndex) -> None:
        """
        Waits, and tells the dead-man that somebody is there. Raises `PortLost` if the port fails,
        and `NotOnline` if a node that was moved is not heard any more.
        """

@final
class Capture:
    """
    A capture that was read: its tables, by message.
    """
    def __contains__(self, message: str, /) -> bool: ...
    def __getitem__(self, message: str, /) -> Table:
        """
        The table of a message: `capture["report"]` or `capture["ucp.report"]`. Empty if no such
        message is in the capture.
        """
    def __iter__(self, /) -> Iterator[str]: ...
    def __len__(self, /) -> int: ...
    def __repr__(self, /) -> str: ...
    def _repr_html_(self, /) -> str:
        """
        For notebooks: the messages, and the bytes that belong to none.
        """
    @property
    def frames(self, /) -> Table:
        """
        All frames in their order: place, protocol, message and bytes.
        """
    @property
    def gaps(self, /) -> Table:
        """
        The bytes that belong to no frame. `reason` tells why no frame starts at the first of them:
        `header` (not the begin of a frame), `length` (no frame is so long), `id` (no such node),
        `crc` (damaged, or not a frame) or `idle` (cut off). If there are several reasons,
        `reasons_header` and the others tell how many bytes each has.
        """
    def keys(self, /) -> list[str]:
        """
        The names of the tables that have rows.
        """
    def plot(self, /) -> "Picture":
        """
        A picture, as `axle plot` draws it; a notebook shows it.
        """
    @property
    def summary(self, /) -> dict[str, Any]:
        """
        The account of the bytes, as a dictionary.
        """

@final
class Decoder:
    """
    Finds the frames in a stream of bytes, whatever is between them.

    Every byte is in exactly one frame or gap: no stray byte costs a frame that is whole.
    """
    def __new__(cls, /, protocol: str) -> Decoder:
        """
        For `ucp`, `ikeya` or `ikeya-3`; packets of both directions.
        """
    def __repr__(self, /) -> str: ...
    @property
    def counters(self, /) -> dict[str, Any]:
        """
        The account so far: each byte is in a frame, in a gap, or pending.
        """
    def feed(self, /, data: "Buffer") -> "list[Frame | Gap]":
        """
        Takes in bytes, in pieces of any length; returns the frames and gaps that are decided now.
        """
    def idle(self, /) -> "list[Frame | Gap]":
        """
        The line is quiet, or the stream has ended: what is pending is no frame any more. Returns
        what is decided now.
        """
    @property
    def pending(self, /) -> int:
        """
        Bytes that may be the begin of a frame.
        """

@final
class Frame:
    """
    A frame: what it is, and the values in it.
    """
    __match_args__ = ("message", "raw")
    def __eq__(self, other: object, /) -> bool: ...
    def __getattr__(self, name: str, /) -> Any: ...
    def __hash__(self, /) -> int: ...
    def __repr__(self, /) -> str: ...
    @property
    def fields(self, /) -> Any:
        """
        All values, as `axle decode --json` names them; bytes as hex digits.
        """
    @property
    def message(self, /) -> str:
        """
        The name of the message, such as `report`.
        """
    @property
    def protocol(self, /) -> str:
        """
        `ucp`, `ikeya` or `ikeya-3`.
        """
    @property
    def raw(self, /) -> bytes:
        """
        The whole frame, with its CRC.
        """

@final
class Gap:
    """
    Bytes that belong to no frame.
    """
    __match_args__ = ("length", "reason")
    def __eq__(self, value: object, /) -> bool: ...
    def __hash__(self, /) -> int: ...
    def __ne__(self, value: object, /) -> bool: ...
    def __repr__(self, /) -> str: ...
    @property
    def length(self, /) -> int:
        """
        How many.
        """
    @property
    def reason(self, /) -> str:
        """
        Why no frame starts at the first: `header`, `length`, `id`, `crc` or `idle`.
        """

@final
class Node:
    """
    A node of a bus: `bus[1]`.
    """
    def __repr__(self, /) -> str: ...
    @property
    def health(self, /) -> str:
        """
        `unknown`, `online`, `suspect` or `abnormal`.
        """
    @property
    def id(self, /) -> int:
        """
        Its id, 1 to 8.
        """
    @property
    def mode(self, /) -> str | None:
        """
        `velocity` or `position`; `None` if it has never answered.
        """
    @property
    def position(self, /) -> float:
        """
        Its position, turns, measured now. Set it to move the motor there.
        """
    @position.setter
    def position(self, /, turns: SupportsFloat | SupportsIndex) -> None: ...
    def stop(self, /) -> None:
        """
        Stops it, and returns when its motor is seen to stand still.
        """
    @property
    def stop_progress(self, /) -> str:
        """
        How far its latest stop is: `not_asked`, `owed`, `confirmed`, `standing_still` or
        `still_moving`.
        """
    @property
    def velocity(self, /) -> float:
        """
        Its speed, turns per second, measured now. Set it to turn the motor.
        """
    @velocity.setter
    def velocity(self, /, rps: SupportsFloat | SupportsIndex) -> None: ...

@final
class Report:
    """
    A report of a rover, as it was received: `battery_pct`, `rpm` (four), `acc`, `gyro`, `mag`
    (three each), `heading`, `power_w`, `voltage_dv`, `current_ca`, `version`. A capture has arrays
    as columns `rpm_0` to `rpm_3`, which tell units and meaning.
    """
    def __getattr__(self, name: str, /) -> Any: ...
    def __repr__(self, /) -> str: ...
    @property
    def fields(self, /) -> Any:
        """
        All fields with their values.
        """
    @property
    def lost(self, /) -> int:
        """
        Number of reports missing between the previous one and this one.
        """

@final
class Reports:
    """
    The reports of a rover, as they come. They end with the line.
    """
    def __aiter__(self, /) -> Reports: ...
    def __anext__(self, /) -> Awaitable[Report]: ...
    def __iter__(self, /) -> Reports: ...
    def __next__(self, /) -> Report: ...
    def __repr__(self, /) -> str: ...
    @property
    def dropped(self, /) -> int:
        """
        Reports that were dropped because nobody took them for more than a minute.
        """
    @property
    def is_over(self, /) -> bool:
        """
        Whether the line is closed. Reports may still wait.
        """
    def next(self, /, within_s: SupportsFloat | SupportsIndex) -> Report | None:
        """
        The next report; `None` if none comes within this time, or no more come.
        """

@final
class Rover:
    """
    A rover on a serial port (UCP).

    It is stopped, and seen to stand still, when the `with` block is left, at the end of the
    program, and when the object is collected. A command without `seconds` ends by itself after half
    a second if no other follows: whoever is at the keyboard may have gone.
    """
    def __enter__(self, /) -> Rover: ...
    def __exit__(self, /, kind: type | None, value: Any | None, trace: Any | None) -> None: ...
    def __new__(cls, /, port: "str | os.PathLike[str]", *, baud: SupportsIndex = 115200, dead_man_s: SupportsFloat | SupportsIndex = 0.5, low_ids_only: bool = False) -> Rover: ...
    def __repr__(self, /) -> str: ...
    def close(self, /) -> None:
        """
        Stops what was moved, waits until it is seen to stand still, and closes the port.
        """
    def drive(self, /, speed: SupportsIndex = 0, angular: SupportsIndex = 0, *, seconds: SupportsFloat | SupportsIndex | None = None) -> None:
        """
        Drives: percent of the speed ahead, and percent of turn, positive as a steering wheel that
        is turned to the right. With `seconds` it then stops, and returns when the rover is seen
        to stand still, which takes another second or so; else it returns at once.
        """
    @property
    def link(self, /) -> str:
        """
        Whether the robot is heard: `waiting`, `up` or `down`.
        """
    def ping(self, /, within_s: SupportsFloat | SupportsIndex = 1.0) -> float:
        """
        Waits for the answer to a ping, and returns the round trip, seconds.
        """
    @property
    def report(self, /) -> Report | None:
        """
        The latest report; `None` before the first.
        """
    def reports(self, /) -> Reports:
        """
        The reports from now on, one after another: `for report in rover.reports()` in a thread, or
        `async for`.
        """
    def stop(self, /) -> None:
        """
        Stops, and returns when the rover is seen to stand still. Raises `StillMoving` if it is not.
        """

@final
class Scan:
    """
    Reads a capture in another thread, batch by batch: memory does not grow with its length.
    """
    def __arrow_c_stream__(self, /, requested_schema: Any | None = None) -> CapsuleType:
        """
        For whatever takes a stream of Arrow: the rows of one message, in constant memory.
        """
    def __iter__(self, /) -> Scan: ...
    def __next__(self, /) -> Table: ...
    def __repr__(self, /) -> str: ...
    @property
    def summary(self, /) -> dict[str, Any] | None:
        """
        The account of the bytes, as that of a capture; `None` before the end.
        """

@final
class Table:
    """
    Rows of one message, as columns of Arrow.

    pyarrow, Polars, pandas, DuckDB and nanoarrow take it without a copy:
    `pyarrow.table(table)`, `polars.DataFrame(table)`, `pandas.DataFrame.from_arrow(table)`.
    """
    def __arrow_c_schema__(self, /) -> CapsuleType:
        """
        The schema alone.
        """
    def __arrow_c_stream__(self, /, requested_schema: Any | None = None) -> CapsuleType:
        """
        For whatever takes a stream of Arrow.
        """
    def __getitem__(self, column: str, /) -> list[Any]:
        """
        The values of a column as a list.
        """
    def __len__(self, /) -> int: ...
    def __repr__(self, /) -> str: ...
    @property
    def column_names(self, /) -> list[str]:
        """
        The names of the columns.
        """
    @property
    def columns(self, /) -> dict[str, Any]:
        """
        What each column is: its unit, its meaning, and the ruling that decides it.
        """
    @property
    def name(self, /) -> str:
        """
        Protocol and message, such as `ucp.report`.
        """
    def to_pydict(self, /) -> "dict[str, list[Any]]":
        """
        All columns as lists.
        """

def _leave_all() -> None:
    """
    Stops whatever still moves, on all lines. Called at the end of the program.
    """

def _tool(args: SupportsGetItem[int, str]) -> int:
    """
    Runs the tool `axle` with these arguments, and returns its exit code.
    """

def crc16(data: "Buffer") -> int:
    """
    CRC-16 of both protocols (ruling B1).
    """

def ikeya_position(id: SupportsIndex, position: "float | Sequence[float]") -> bytes:
    """
    Slave to master: its position, turns; three for a board with three motors.
    """

def ikeya_read(id: SupportsIndex) -> bytes:
    """
    Master to slave: asks for the status.
    """

def ikeya_velocity(id: SupportsIndex, velocity: "float | Sequence[float]") -> bytes:
    """
    Slave to master: its speed, turns per second; three for a board with three motors.
    """

def ikeya_write_position(id: SupportsIndex, position: "float | Sequence[float]") -> bytes:
    """
    Master to slave: a position, turns; three for a board with three motors.
    """

def ikeya_write_velocity(id: SupportsIndex, velocity: "float | Sequence[float]") -> bytes:
    """
    Master to slave: a speed, turns per second; three for a board with three motors.
    """

def read(source: "Source", *, protocol: str | None = None, units: str | None = None) -> Capture:
    """
    Reads a capture as a whole: a path, several, a folder, bytes, or a file open for reading bytes.

    It may be pcapng, pcap, or raw bytes, packed with gzip or not. `protocol` names that of raw
    bytes: "ucp", "ikeya" or "ikeya-3"; without it, it is found out. With `units="si"` each measured
    column has another one beside it, such as `rpm_0_si` in rad/s, as `f64`. Of a damaged capture it
    reads what there is, and warns; without any frame, all tables are empty. Raises OSError if the
    file cannot be read, and ValueError if it is no capture.
    """

def scan(source: "Source", *, protocol: str | None = None, message: str | None = None, units: str | None = None) -> Scan:
    """
    Reads a capture batch by batch, in a thread of its own: memory does not grow with its length.

    Gives tables of up to 65,536 rows. With `message` they are of that message only, and the scan is
    itself a stream of Arrow. The rest is as with `read`.
    """

def ucp_bias_request(*, index: SupportsIndex = 0) -> bytes:
    """
    Robot to host: has booted and wants the stored biases.
    """

def ucp_biases(acc: SupportsLenAndGetItem[SupportsIndex] = ..., gyro: SupportsLenAndGetItem[SupportsIndex] = ..., mag: SupportsLenAndGetItem[SupportsIndex] = ..., err: SupportsIndex = ..., *, index: SupportsIndex = 0) -> bytes:
    """
    Host to robot: the stored biases.
    """

def ucp_calibration_end(kind: SupportsIndex = ..., *, index: SupportsIndex = 0) -> bytes:
    """
    Host to robot: ends a calibration.
    """

def ucp_calibration_end_ack(kind: SupportsIndex = ..., err: SupportsIndex = ..., *, index: SupportsIndex = 0) -> bytes:
    """
    Robot to host: answers it.
    """

def ucp_calibration_start(kind: SupportsIndex = ..., *, index: SupportsIndex = 0) -> bytes:
    """
    Host to robot: asks for a calibration, 1 for the magnetometer, 2 for the inertial sensors.
    """

def ucp_calibration_start_ack(kind: SupportsIndex = ..., err: SupportsIndex = ..., *, index: SupportsIndex = 0) -> bytes:
    """
    Robot to host: answers it.
    """

def ucp_document_report(*, index: SupportsIndex = 0, **fields: "int | Sequence[int]") -> bytes:
    """
    The same in the layout of the document (ruling U5).
    """

def ucp_imu_bias(acc: SupportsLenAndGetItem[SupportsIndex] = ..., gyro: SupportsLenAndGetItem[SupportsIndex] = ..., *, index: SupportsIndex = 0) -> bytes:
    """
    Robot to host: the result of a calibration of the inertial sensors.
    """

def ucp_imu_bias_ack(err: SupportsIndex = ..., *, index: SupportsIndex = 0) -> bytes:
    """
    Host to robot: answers it.
    """

def ucp_mag_bias(mag: SupportsLenAndGetItem[SupportsIndex] = ..., *, index: SupportsIndex = 0) -> bytes:
    """
    Robot to host: the result of a calibration of the magnetometer.
    """

def ucp_mag_bias_ack(err: SupportsIndex = ..., *, index: SupportsIndex = 0) -> bytes:
    """
    Host to robot: answers it.
    """

def ucp_motor_control(speed: SupportsIndex = ..., angular: SupportsIndex = ..., front_led: bool = ..., *, index: SupportsIndex = 0) -> bytes:
    """
    Host to robot: drives, percent of the speed and of turn; -100 to 100.
    """

def ucp_network_state(state: SupportsIndex = ..., *, index: SupportsIndex = 0) -> bytes:
    """
    Host to robot: the state of its network, 0 to 255.
    """

def ucp_ota_ack(status: SupportsIndex = ..., *, index: SupportsIndex = 0) -> bytes:
    """
    Robot to host: answers it.
    """

def ucp_ota_request(version: SupportsIndex = ..., *, index: SupportsIndex = 0) -> bytes:
    """
    Host to robot: **starts a firmware update**; the robot then stops answering.
    """

def ucp_ping(*, index: SupportsIndex = 0) -> bytes:
    """
    Host to robot: checks that it is there.
    """

def ucp_pong(err: SupportsIndex = ..., *, index: SupportsIndex = 0) -> bytes:
    """
    Robot to host: answers a ping.
    """

def ucp_report(*, version: SupportsIndex = 38, index: SupportsIndex = 0, **fields: "int | Sequence[int]") -> bytes:
    """
    Robot to host: what it measures. The fields are those of a `Report`: `battery_pct`, `rpm`
    (four), `acc`, `gyro`, `mag` (three each), `heading`, `power_w`, `voltage_dv`, `current_ca`; all
    0 if not given.
    """

def ucp_unknown(id: SupportsIndex, body: SupportsGetItem[int, SupportsIndex] = ..., *, index: SupportsIndex = 0) -> bytes:
    """
    A frame of no known message (rulings U3, U13).
    """


class Error(Exception):
    nodes: list[int]

class StopsOwed(Error): ...

class StillMoving(Error): ...

class NotOnline(Error): ...

class Refused(Error): ...

class NoAnswer(Error): ...

class PortLost(Error): ...
