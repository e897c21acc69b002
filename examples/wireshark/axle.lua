-- Wireshark dissector for the lines of axle: Ikeya MD (axle_ikeya) and UCP (axle_ucp).
--
-- It reads the captures of `axle record`, `--record` and `axle extcap`: link types USER0 (Ikeya),
-- USER1 (Ikeya, boards with three motors) and USER3 (UCP). A packet of such a capture may be a
-- frame, several, a part of one, or noise. So each interface and each direction is a stream of
-- bytes, decoded as `axle decode` does it, and the fields are those of `axle decode --json`.
--
-- The first pass over a capture knows only what has been read so far: an open gap is shown "so
-- far". Once a packet is shown again, as in a window or with `tshark -2 -R frame`, the end of what
-- has been read counts as the end of the capture.
--
-- Parts, from the top: checksum, framings, streams, lines (modes, requests and answers), fields,
-- and what a packet shows. Runs with Lua 5.2 to 5.4: no operators on bits.

local bxor, band, rshift = bit.bxor, bit.band, bit.rshift

-- Checksum: CRC-16/MODBUS (ruling B1).

local CRC_TABLE = {}
for byte = 0, 255 do
    local crc = byte
    for _ = 1, 8 do
        local odd = band(crc, 1) == 1
        crc = rshift(crc, 1)
        if odd then crc = bxor(crc, 0xA001) end
    end
    CRC_TABLE[byte] = crc
end

-- Whether the bytes from `first` to `last` end with their own checksum.
local function is_intact(bytes, first, last)
    local crc = 0xFFFF
    for at = first, last - 2 do
        crc = bxor(rshift(crc, 8), CRC_TABLE[band(bxor(crc, bytes:byte(at)), 0xFF)])
    end
    return crc == bytes:byte(last - 1) + 256 * bytes:byte(last)
end

-- Framings: each judges the bytes of `held` from position `at` on. Returns "frame" and its length;
-- "reject", the number of bytes and the reason; or nothing while more bytes are needed.

local SYNC_1, SYNC_2 = 0xFD, 0xFF
local LEAST_LEN, MOST_LEN = 4, 60 -- of the length field (ruling U2)
local OUTSIDE = 4 -- bytes that it does not count

local function judge_ucp(held, at)
    local first, second, low, high = held:byte(at, at + 3)
    if first == nil then return end
    if first ~= SYNC_1 then
        local sync = held:find("\253", at, true) or #held + 1
        return "reject", sync - at, "header"
    end
    if second == nil then return end
    if second ~= SYNC_2 then return "reject", 1, "header" end
    if low == nil then return end
    local len = low + 256 * (high or 0)
    if len < LEAST_LEN or len > MOST_LEN then return "reject", 1, "length" end
    if high == nil or #held < at + len + OUTSIDE - 1 then return end
    if not is_intact(held, at, at + len + OUTSIDE - 1) then return "reject", 1, "crc" end
    return "frame", len + OUTSIDE
end

local READ, WRITE, VELOCITY, POSITION = 0xAA, 0xBB, 0x55, 0x56
local READ_LEN = 4

-- `long` is the length of everything but a READ.
local function judge_ikeya(long)
    return function(held, at)
        local header, id = held:byte(at, at + 1)
        if header == nil then return end
        local len
        if header == READ then
            len = READ_LEN
        elseif header == WRITE or header == VELOCITY or header == POSITION then
            len = long
        else
            return "reject", (held:find("[\170\187\85\86]", at) or #held + 1) - at, "header"
        end
        if #held < at + len - 1 then return end
        if not is_intact(held, at, at + len - 1) then return "reject", 1, "crc" end
        -- A whole packet for a node that cannot exist (ruling I1).
        if id < 1 or id > 8 then return "reject", len, "id" end
        return "frame", len
    end
end

local REASONS = { "header", "length", "id", "crc", "idle" }
local MEANINGS = {
    header = "no frame starts here",
    length = "invalid length",
    id = "invalid node id",
    crc = "damaged, or not a frame",
    idle = "truncated at the end",
}

-- Streams: the bytes of one interface in one direction.

local function new_stream(kind, direction)
    return {
        kind = kind,
        direction = direction,
        judge = kind.judge,
        held = "", -- received, neither framed nor skipped yet
        offset = 0, -- of the first held byte
        received = 0,
        chunks = {}, -- the packets of the stream
        chunk = 1, -- the first that the next event may end in
        events = {}, -- frames and gaps, in order, without a hole between them
        gap = nil, -- the open one
    }
end

-- Books bytes as skipped.
local function skip(stream, count, reason)
    local gap = stream.gap
    if not gap then
        gap = { begin = stream.offset, reason = reason, by = {} }
        stream.gap = gap
    end
    gap.by[reason] = (gap.by[reason] or 0) + count
    stream.offset = stream.offset + count
    gap.finish = stream.offset
end

-- Adds an event, with the packet that has its last byte.
local function add_event(stream, event)
    local chunks = stream.chunks
    while chunks[stream.chunk].finish < event.finish do stream.chunk = stream.chunk + 1 end
    event.packet, event.micros = chunks[stream.chunk], chunks[stream.chunk].micros
    event.direction = stream.direction
    stream.events[#stream.events + 1] = event
end

local function end_gap(stream)
    if stream.gap then
        add_event(stream, stream.gap)
        stream.gap = nil
    end
end

-- Finds all that the held bytes decide. If nothing follows, a truncated candidate costs one byte,
-- and the search goes on inside it (ruling B3). `meet` is called with each frame.
local function search(stream, is_over, meet)
    local held, at = stream.held, 1
    while true do
        local verdict, count, reason = stream.judge(held, at)
        if not verdict and is_over and at <= #held then
            verdict, count, reason = "reject", 1, "idle"
        end
        if verdict == "frame" then
            end_gap(stream)
            local frame = {
                begin = stream.offset,
                finish = stream.offset + count,
                bytes = held:sub(at, at + count - 1),
            }
            stream.offset = frame.finish
            add_event(stream, frame)
            meet(frame)
        elseif verdict == "reject" then
            skip(stream, count, reason)
        else
            break
        end
        at = at + count
    end
    stream.held = held:sub(at)
    if is_over then end_gap(stream) end
end

-- A copy that can be brought to its end. Its events are those behind the ones of the original.
local function copy_of(stream)
    local copy = new_stream(stream.kind, stream.direction)
    copy.held, copy.offset, copy.received = stream.held, stream.offset, stream.received
    copy.chunks, copy.chunk = stream.chunks, stream.chunk
    local gap = stream.gap
    if gap then
        copy.gap = { begin = gap.begin, finish = gap.finish, reason = gap.reason, by = {} }
        for reason, count in pairs(gap.by) do copy.gap.by[reason] = count end
    end
    return copy
end

-- Lines: the streams of an interface, the modes of its nodes, and what is asked.

-- Set in the preferences, microseconds.
local reply_window = { ikeya = 20000 }
-- Wire time of a byte at 500 kbit/s, microseconds (ruling B6).
local IKEYA_BYTE = 20

-- Which answer each request of UCP is for.
local UCP_ANSWERS = {
    ping = "pong",
    calibration_start = "calibration_start_ack",
    calibration_end = "calibration_end_ack",
    imu_bias = "imu_bias_ack",
    mag_bias = "mag_bias_ack",
    bias_request = "biases",
    ota_request = "ota_ack",
}
local UCP_REQUESTS = {}
for request, answer in pairs(UCP_ANSWERS) do UCP_REQUESTS[answer] = request end

local IKEYA_NAMES = {
    [READ] = "read_request",
    [WRITE] = "write",
    [VELOCITY] = "velocity_response",
    [POSITION] = "position_response",
}

local ucp_message -- defined with the fields

-- The request of an answer, and how long the answer took: nothing is known of that if a packet has
-- no time, or if the clock was set back.
local function match(answer, asked)
    answer.request = asked
    if answer.micros and asked.micros and answer.micros >= asked.micros then
        answer.took = answer.micros - asked.micros
    end
end

-- Whether the adapter hears what it has sent: a frame of the master that came from the
-- other side before, and whose echo has not come yet. Echoes come in the order in which the frames
-- were sent; those of damaged ones never come. The last few are enough.
local MOST_ECHOES = 16

local function is_echo(state, frame)
    local sent = state.sent
    for at, earlier in ipairs(sent) do
        if earlier.bytes == frame.bytes and earlier.direction ~= frame.direction then
            for _ = 1, at do table.remove(sent, 1) end
            return true
        end
    end
    sent[#sent + 1] = frame
    if #sent > MOST_ECHOES then table.remove(sent, 1) end
    return false
end

-- A frame of the bus, in the order in which frames are decided.
local function meet_ikeya(line, frame)
    local state = line.state
    local header, node = frame.bytes:byte(1, 2)
    frame.name, frame.node = IKEYA_NAMES[header], node
    if header == READ or header == WRITE then
        if header == WRITE then frame.mode = state.modes[node] end
        if is_echo(state, frame) then
            frame.is_echo = true
            return
        end
        local asked = state.asked
        if asked then state.unanswered[asked] = true end
        state.has_requests = true
        -- Boards with three motors answer a WRITE too (ruling I10).
        local is_answered = header == READ or line.kind.motors == 3
        state.asked = is_answered and frame or nil
        return
    end
    local mode = header == VELOCITY and "velocity" or "position"
    local known = state.modes[node]
    if known and known ~= mode then frame.mode_before = known end
    state.modes[node] = mode
    local asked = state.asked
    if asked and asked.node == node then
        match(frame, asked)
        state.answers[asked] = frame
        state.asked = nil
        local wire_time = IKEYA_BYTE * (#asked.bytes + #frame.bytes)
        frame.is_late = frame.took and frame.took > reply_window.ikeya + wire_time
    elseif asked then
        frame.is_foreign, frame.asked = true, asked
    elseif state.has_requests then
        frame.is_unasked = true
    end
end

-- A frame of the rover's link.
local function meet_ucp(line, frame)
    local state = line.state
    frame.name = ucp_message(frame.bytes).name
    local answer, request = UCP_ANSWERS[frame.name], UCP_REQUESTS[frame.name]
    if answer then
        local asked = state.open[frame.name]
        if asked then state.unanswered[asked] = true end
        state.open[frame.name] = frame
    elseif request and state.open[request] then
        match(frame, state.open[request])
        state.answers[frame.request] = frame
        state.open[request] = nil
    end
end

-- Once that has passed without an answer, none is expected any more, microseconds. On the rover's
-- link, whose requests are repeated every second at the most, it is no ruling.
local UCP_PATIENCE = 1000000
local function patience_for(kind, asked)
    if kind.name == "ucp" then return UCP_PATIENCE end
    return reply_window.ikeya + IKEYA_BYTE * (#asked.bytes + kind.longest)
end

-- `answers` and `unanswered` are of requests; those of a copy are for what is behind the original.
local function new_state()
    return { modes = {}, sent = {}, open = {}, answers = {}, unanswered = {} }
end

local KINDS = {
    [wtap.USER0] = {
        name = "ikeya", motors = 1, longest = 8, judge = judge_ikeya(8), meet = meet_ikeya,
    },
    [wtap.USER1] = {
        name = "ikeya-3", motors = 3, longest = 16, judge = judge_ikeya(16), meet = meet_ikeya,
    },
    [wtap.USER3] = { name = "ucp", judge = judge_ucp, meet = meet_ucp },
}

-- A read filter (`-R`) drops packets after they were shown here, and gives their numbers to the
-- next ones. So `packets` has those that are in the list, by number, but `latest` may be dropped
-- still; what was dropped has no number.
local lines, packets, latest, has_dropped

local function reset()
    lines, packets, latest, has_dropped = {}, {}, nil, false
end
reset()

-- The number by which to refer to a packet, if it is in the list.
local function number_of(packet)
    local is_sure = packet.is_listed or packet ~= latest or not has_dropped
    return is_sure and packet.number or nil
end

-- The order in which `axle decode` ends the directions of a line.
local DIRECTIONS = { "unknown", "in", "out" }

-- All that would follow if the line ended now: the events of each direction, and the exchanges.
-- On a bus, only READs are short enough to be found then, so that modes play no part.
local function ending_of(line)
    if line.ending and line.ending.received == line.received then return line.ending end
    local state = new_state()
    state.has_requests, state.asked = line.state.has_requests, line.state.asked
    for name, frame in pairs(line.state.open) do state.open[name] = frame end
    for at, frame in ipairs(line.state.sent) do state.sent[at] = frame end
    local copy = { kind = line.kind, state = state }
    local ending = { received = line.received, state = state, events = {} }
    for _, direction in ipairs(DIRECTIONS) do
        local stream = line.streams[direction]
        if stream then
            local last = copy_of(stream)
            search(last, true, function(frame) line.kind.meet(copy, frame) end)
            ending.events[direction] = last.events
        end
    end
    local function give_up(asked)
        if asked.micros and line.last_micros - asked.micros > patience_for(line.kind, asked) then
            state.unanswered[asked] = true
        end
    end
    if state.asked then give_up(state.asked) end
    for _, asked in pairs(state.open) do give_up(asked) end
    line.ending = ending
    return ending
end

-- Takes in the bytes of a packet, once.
local function take(key, kind, direction, bytes, number, micros)
    local line = lines[key]
    if not line then
        line = { kind = kind, state = new_state(), streams = {}, received = 0, last_micros = 0 }
        lines[key] = line
    end
    local stream = line.streams[direction]
    if not stream then
        stream = new_stream(kind, direction)
        line.streams[direction] = stream
    end
    local begin = stream.received
    local finish = begin + #bytes
    stream.received, line.received = finish, line.received + #bytes
    if #bytes > 0 then line.last_micros = math.max(line.last_micros, micros or 0) end
    local packet = {
        line = line, stream = stream, begin = begin, finish = finish, number = number,
        micros = micros,
    }
    local dropped = packets[number]
    if dropped then dropped.number, has_dropped = nil, true end
    packets[number], latest = packet, packet
    stream.chunks[#stream.chunks + 1] = packet
    stream.held = stream.held .. bytes
    search(stream, false, function(frame) kind.meet(line, frame) end)
    return packet
end

-- The events that share bytes with a packet; `events` are in order.
local function append_shared(shared, events, begin, finish)
    local low, high = 1, #events + 1
    while low < high do
        local middle = math.floor((low + high) / 2)
        if events[middle].finish > begin then high = middle else low = middle + 1 end
    end
    while events[low] and events[low].begin < finish do
        shared[#shared + 1] = events[low]
        low = low + 1
    end
end

-- Fields. Their names are those of `axle decode --json`: `axle_ikeya.node`; for a message of UCP,
-- with the message in between: `axle_ucp.report.battery_pct`; for the parts of an array, with the
-- part behind: `axle_ucp.report.acc.x`.

local ikeya = Proto("axle_ikeya", "Ikeya MD motor bus")
local ucp = Proto("axle_ucp", "UCP rover link")

local function warning(abbr, name, title, group, severity)
    return ProtoExpert.new(
        abbr .. "." .. name, title, expert.group[group], expert.severity[severity])
end

local BYTES = { " byte", " bytes" }

-- The fields and warnings that both protocols have.
local function common_fields(abbr)
    local function name(suffix) return abbr .. "." .. suffix end
    return {
        offset = ProtoField.uint64(name("offset"), "Offset in the bytes of its direction"),
        length = ProtoField.uint32(name("length"), "Length", base.UNIT_STRING, BYTES),
        protocol = ProtoField.string(name("protocol"), "Protocol"),
        message = ProtoField.string(name("message"), "Message"),
        bytes = ProtoField.bytes(name("bytes"), "Bytes"),
        skipped_offset = ProtoField.uint64(name("skipped.offset"), "Offset of the skipped bytes"),
        skipped_length = ProtoField.uint32(
            name("skipped.length"), "Skipped", base.UNIT_STRING, BYTES),
        reason = ProtoField.string(name("skipped.reason"), "Reason of the first byte"),
        reason_header = ProtoField.uint32(
            name("skipped.reasons.header"), "Bytes that start no frame"),
        reason_length = ProtoField.uint32(
            name("skipped.reasons.length"), "Bytes with invalid lengths"),
        reason_id = ProtoField.uint32(name("skipped.reasons.id"), "Bytes for invalid nodes"),
        reason_crc = ProtoField.uint32(name("skipped.reasons.crc"), "Bytes with wrong checksums"),
        reason_idle = ProtoField.uint32(name("skipped.reasons.idle"), "Bytes of truncated frames"),
        so_far = ProtoField.uint32(
            name("skipped_so_far"), "Skipped so far", base.UNIT_STRING, BYTES),
        pending = ProtoField.uint32(
            name("pending"), "May still become a frame", base.UNIT_STRING, BYTES),
        ends_in = ProtoField.framenum(name("ends_in"), "Goes on, and ends in packet"),
        took = ProtoField.uint64(
            name("response_time_us"), "Response time", base.UNIT_STRING, { " µs" }),
        clock = ProtoField.string(name("response_time_of"), "Response time as seen by"),
        request = ProtoField.framenum(
            name("request_in"), "Answer to packet", base.NONE, frametype.REQUEST),
        answer = ProtoField.framenum(
            name("answer_in"), "Answered in packet", base.NONE, frametype.RESPONSE),
    }, {
        bad_crc = warning(abbr, "bad_crc", "Wrong checksum", "CHECKSUM", "ERROR"),
        gap = warning(abbr, "gap", "Skipped bytes", "UNDECODED", "WARN"),
        unanswered = warning(abbr, "unanswered", "Not answered", "SEQUENCE", "NOTE"),
    }
end

-- Registers fields and warnings with their protocol.
local function register(proto, fields, experts)
    local listed, warnings = {}, {}
    for _, field in pairs(fields) do listed[#listed + 1] = field end
    for _, warning in pairs(experts) do warnings[#warnings + 1] = warning end
    proto.fields, proto.experts = listed, warnings
end

-- Ikeya.

local IKEYA, IKEYA_EXPERTS = common_fields("axle_ikeya")
IKEYA.node = ProtoField.uint8("axle_ikeya.node", "Node")
IKEYA.mode = ProtoField.string("axle_ikeya.mode", "Mode in which the node last answered")
IKEYA.payload = ProtoField.bytes("axle_ikeya.payload", "Payload, both readings")
for motor = 0, 3 do
    -- 0: boards with one motor.
    local name = "axle_ikeya." .. (motor > 0 and "motor" .. motor .. "." or "")
    local of = motor > 0 and " of motor " .. motor or ""
    IKEYA["rps" .. motor] = ProtoField.float(name .. "rps", "Speed" .. of .. ", 1/s")
    IKEYA["count" .. motor] = ProtoField.int16(name .. "count", "Count" .. of .. ", 1/8192 turn")
    IKEYA["rotation" .. motor] = ProtoField.int16(name .. "rotation", "Rotation" .. of .. ", turns")
end
for name, of in pairs({
    late = { "Late answer", "SEQUENCE", "WARN" },
    foreign = { "Foreign answer", "SEQUENCE", "WARN" },
    mode_changed = { "Another mode", "PROTOCOL", "WARN" },
    not_a_number = { "Not a number", "PROTOCOL", "WARN" },
}) do
    IKEYA_EXPERTS[name] = warning("axle_ikeya", name, of[1], of[2], of[3])
end
register(ikeya, IKEYA, IKEYA_EXPERTS)
ikeya.prefs.reply_window_us = Pref.uint("Reply window, µs", reply_window.ikeya,
    "Answers that take longer are marked as late (ruling I7): 20000 suits a USB adapter, 500 a "
    .. "UART of the recording machine. The time on the wire is added.")
function ikeya.prefs_changed() reply_window.ikeya = ikeya.prefs.reply_window_us end

-- UCP.

local UCP, UCP_EXPERTS = common_fields("axle_ucp")
UCP.id = ProtoField.uint8("axle_ucp.id", "Id")
UCP.index = ProtoField.uint8("axle_ucp.index", "Index")

local ERR = { [0] = "fine", [1] = "damaged" }
local OTA = { [0] = "accepted", [1] = "failed", [2] = "forbidden" }
local SENSORS = { [1] = "magnetometer", [2] = "IMU" }
local NETWORK = {
    [0] = "unknown", [1] = "SIM absent", [2] = "disconnected", [3] = "connected",
    [4] = "firmware update",
}
local XYZ, WHEELS = { "x", "y", "z" }, { "front_left", "front_right", "back_left", "back_right" }
local WIDTHS = { uint8 = 1, uint16 = 2, int16 = 2, uint32 = 4 }

-- How a value in other units is written behind it.
local function scaled(factor, form)
    return function(value) return form:format(value * factor) end
end
local VOLTS, AMPERES = scaled(0.1, "%.1f V"), scaled(0.01, "%.2f A")
local G, DEGREES_PER_S = scaled(1 / 16384, "%.4f g"), scaled(1 / 16.4, "%.2f °/s")

-- Of each field of a body, in the order on the wire: key, type, title, unit or words for its
-- values; the names of its parts, if it is an array; and its value in other words.
local function err(words) return { "err", "uint8", "Result", words } end
local KIND = { "type", "uint8", "Sensors", SENSORS }
local RPM = { "rpm", "int16", "Wheel speed", " 1/min", WHEELS }
local ACC = { "acc", "int16", "Acceleration, 1/16384 g", nil, XYZ, G }
local GYRO = { "gyro", "int16", "Angular velocity, 1/16.4 °/s", nil, XYZ, DEGREES_PER_S }
local MAG = { "mag", "int16", "Magnetic field, sensor counts", nil, XYZ }
local HEADING = { "heading", "int16", "Heading", "°" }
local BATTERY = { "battery_pct", "uint16", "Battery", " %" }
local POWER = { "power_w", "uint8", "Power", " W" }
local VOLTAGE = { "voltage_dv", "uint8", "Voltage, 0.1 V", nil, nil, VOLTS }
local CURRENT = { "current_ca", "uint16", "Current, 0.01 A", nil, nil, AMPERES }
local ACC_BIAS = { "acc_bias", "int16", "Bias of the accelerometer, 1/16384 g", nil, XYZ, G }
local GYRO_BIAS = {
    "gyro_bias", "int16", "Bias of the gyroscope, 1/16.4 °/s", nil, XYZ, DEGREES_PER_S,
}
local MAG_BIAS = { "mag_bias", "int16", "Bias of the magnetometer, sensor counts", nil, XYZ }
local FIRMWARE = { "version", "uint16", "Version of the firmware" }

-- The messages by id and length of the body (rulings U4, U5, U8). `from` is the sender.
local MESSAGES = {
    [1] = {
        [0] = { name = "ping", from = "host" },
        [1] = { name = "pong", from = "robot", err(ERR) },
    },
    [2] = { [16] = {
        name = "motor_control", from = "host",
        { "speed", "int16", "Speed, positive forward", " %" },
        { "angular", "int16", "Steering, positive to the right", " %" },
        { "front_led", "int16", "Front lamp", { [0] = "off", [100] = "on" } },
        { "back_led", "int16", "Back lamp, reserved" },
        { "version", "uint16", "Version, reserved" },
        { "reserve1", "uint16", "Reserved" },
        { "reserve2", "uint32", "Reserved" },
    } },
    [3] = {
        [1] = { name = "calibration_start", from = "host", KIND },
        [2] = { name = "calibration_start_ack", from = "robot", KIND, err(ERR) },
    },
    [4] = {
        [1] = { name = "calibration_end", from = "host", KIND },
        [2] = { name = "calibration_end_ack", from = "robot", KIND, err(ERR) },
    },
    [5] = {
        [36] = {
            name = "report", from = "robot", layout = "firmware",
            BATTERY, RPM, ACC, GYRO, MAG, HEADING, POWER, VOLTAGE, CURRENT, FIRMWARE,
        },
        [34] = {
            name = "report", from = "robot", layout = "document",
            BATTERY, RPM, POWER, VOLTAGE, CURRENT, ACC, GYRO, MAG, HEADING,
        },
    },
    [6] = {
        [12] = { name = "imu_bias", from = "robot", ACC_BIAS, GYRO_BIAS },
        [1] = { name = "imu_bias_ack", from = "host", err(ERR) },
    },
    [7] = {
        [6] = { name = "mag_bias", from = "robot", MAG_BIAS },
        [1] = { name = "mag_bias_ack", from = "host", err(ERR) },
    },
    [8] = {
        [0] = { name = "bias_request", from = "robot" },
        [19] = { name = "biases", from = "host", err(ERR), ACC_BIAS, GYRO_BIAS, MAG_BIAS },
    },
    [9] = {
        [2] = { name = "ota_request", from = "host", { "version", "int16", "Version offered" } },
        [1] = { name = "ota_ack", from = "robot", err(OTA) },
    },
    [10] = {
        [1] = { name = "network_state", from = "host", { "state", "uint8", "Network", NETWORK } },
        [4] = { name = "network_state", from = "host", { "state", "uint32", "Network", NETWORK } },
    },
}
local UNKNOWN = { name = "unknown" }

function ucp_message(frame)
    local by_len = MESSAGES[frame:byte(5)]
    return by_len and by_len[#frame - 8] or UNKNOWN
end

-- The field of a value, registered at its first use. `state` has two widths.
local function ucp_field(message, value, part)
    local key, kind, title, says = value[1], value[2], value[3], value[4]
    local name = message.name .. "." .. key .. (part and "." .. part or "")
    if key == "state" then kind = "uint32" end
    if not UCP[name] then
        if part then title = title .. ", " .. part:gsub("_", " ") end
        local display, words = base.DEC, nil
        if type(says) == "string" then display, words = base.UNIT_STRING, { says } end
        if type(says) == "table" then words = says end
        UCP[name] = ProtoField[kind]("axle_ucp." .. name, title, display, words)
    end
    return UCP[name]
end

for _, by_len in pairs(MESSAGES) do
    for _, message in pairs(by_len) do
        for _, value in ipairs(message) do
            for _, part in ipairs(value[5] or { false }) do ucp_field(message, value, part) end
        end
    end
end
UCP["report.layout"] = ProtoField.string("axle_ucp.report.layout", "Layout")
UCP["network_state.state_width"] = ProtoField.uint8(
    "axle_ucp.network_state.state_width", "Width of the state", base.UNIT_STRING, BYTES)
UCP["unknown.body"] = ProtoField.bytes("axle_ucp.unknown.body", "Body")
UCP_EXPERTS.hazard = warning("axle_ucp", "hazard", "Hazard", "PROTOCOL", "ERROR")
UCP_EXPERTS.battery = warning("axle_ucp", "battery", "Impossible charge", "PROTOCOL", "WARN")
register(ucp, UCP, UCP_EXPERTS)

-- What a frame shows. `range` is its bytes. Returns a line for the packet list.

local function hex(bytes)
    return (bytes:gsub(".", function(byte) return ("%02x"):format(byte:byte()) end))
end

local function speed_in_words(rps)
    return ("%.2f rps"):format(rps)
end

local function warn(item, warning_of, form, ...)
    item:add_proto_expert_info(warning_of, form:format(...))
end

local function show_ikeya(frame, range, item, kind)
    item:add_le(IKEYA.node, range(1, 1))
    local is_write, texts = frame.name == "write", {}
    local values = range:len() > READ_LEN and range(2, range:len() - 4) or nil
    local shows_speed = frame.name == "velocity_response" or is_write
    local is_odd = false
    local shows_position = frame.name == "position_response" or is_write
    for motor = 1, values and kind.motors or 0 do
        local suffix = kind.motors > 1 and motor or 0
        if shows_speed then
            local value = values(4 * (motor - 1), 4)
            item:add_le(IKEYA["rps" .. suffix], value)
            if not is_write or frame.mode == "velocity" then
                texts[#texts + 1] = speed_in_words(value:le_float())
            end
            local rps = value:le_float()
            is_odd = is_odd or rps ~= rps or math.abs(rps) == math.huge
        end
        if shows_position then
            -- All counts precede all rotations.
            local count = values(2 * (motor - 1), 2)
            local rotation = values(2 * (kind.motors + motor - 1), 2)
            item:add_le(IKEYA["count" .. suffix], count)
            item:add_le(IKEYA["rotation" .. suffix], rotation)
            if not is_write or frame.mode == "position" then
                local turns = rotation:le_int() + count:le_int() / 8192
                texts[#texts + 1] = ("%.4f turns"):format(turns)
            end
        end
    end
    if is_write then
        item:add(IKEYA.payload, values)
        if frame.mode then item:add(IKEYA.mode, frame.mode):set_generated() end
        if not frame.mode then texts = { hex(values:raw()) } end
    end
    if is_odd and (not is_write or frame.mode == "velocity") then
        warn(item, IKEYA_EXPERTS.not_a_number, "The speed is no finite number (ruling I4)")
    end
    if frame.mode_before then
        warn(item, IKEYA_EXPERTS.mode_changed,
            "Node %d was in %s mode before (ruling I11)", frame.node, frame.mode_before)
    end
    if frame.is_late then
        warn(item, IKEYA_EXPERTS.late, "Late answer: %d µs (ruling I7)", frame.took)
    elseif frame.is_foreign then
        warn(item, IKEYA_EXPERTS.foreign,
            "Node %d answered when node %d was asked (ruling I7)", frame.node, frame.asked.node)
    elseif frame.is_unasked then
        warn(item, IKEYA_EXPERTS.foreign,
            "Node %d answered, but no answer was due (ruling I7)", frame.node)
    end
    local values_text = #texts > 0 and ": " .. table.concat(texts, ", ") or ""
    return ("%s, node %d%s"):format(frame.name, frame.node, values_text)
end

-- What harms a shipped robot, if the host sent this frame (rulings U7, U13): a list of reasons.

-- A motor command or an offer of a version above it starts a firmware update.
local HARMLESS_VERSION = 38

local function motor_hazards(body)
    local reasons = {}
    local function add(...) reasons[#reasons + 1] = string.format(...) end
    for at, name in ipairs({ "speed", "angular" }) do
        local value = body(2 * (at - 1), 2):le_int()
        if math.abs(value) > 100 then
            add("%s %d is beyond 100 %% (ruling U7)", name, value)
        end
    end
    local lamp = body(4, 2):le_int()
    if lamp ~= 0 and lamp ~= 100 then
        add("front_led %d is neither 0 nor 100 (ruling U7)", lamp)
    end
    local version = body(8, 2):le_int()
    if version > HARMLESS_VERSION then
        add("version %d starts a firmware update (ruling U7)", version)
    elseif version ~= 0 then
        add("version %d is not 0 (ruling U7)", version)
    end
    for _, reserved in ipairs({
        { "back_led", body(6, 2):le_int() },
        { "reserve1", body(10, 2):le_uint() },
        { "reserve2", body(12, 4):le_uint() },
    }) do
        if reserved[2] ~= 0 then add("%s %d is not 0 (ruling U7)", reserved[1], reserved[2]) end
    end
    return reasons
end

-- The least length of a body with which the host sends this id; nil if it never does.
local function least_of_host(id)
    local least
    for len, message in pairs(MESSAGES[id] or {}) do
        if message.from == "host" then least = math.min(least or len, len) end
    end
    return least
end

local function hazards_of(frame, message, body)
    local id, len = frame.bytes:byte(5), #frame.bytes - 8
    -- Without a direction, the message tells the sender.
    if frame.direction == "in" or frame.direction ~= "out" and message.from == "robot" then
        return {}
    end
    local least = least_of_host(id)
    if MESSAGES[id] and not least then
        return { ("id %d from a host hangs shipped robots (ruling U13)"):format(id) }
    elseif least and len < least then
        local form = "a body of %d bytes, not %d: shipped robots read what lies behind (ruling U13)"
        return { form:format(len, least) }
    elseif message.name == "motor_control" then
        return motor_hazards(body)
    elseif message.name == "ota_request" and body(0, 2):le_int() > HARMLESS_VERSION then
        return { ("version %d starts a firmware update (ruling U7)"):format(body(0, 2):le_int()) }
    end
    return {}
end

local function show_ucp(frame, range, item)
    local message = ucp_message(frame.bytes)
    item:add_le(UCP.id, range(4, 1))
    item:add_le(UCP.index, range(5, 1))
    local body = range:len() > 8 and range(6, range:len() - 8) or nil
    local at, texts = 0, {}
    if message.layout then
        item:add(UCP["report.layout"], message.layout):set_generated()
    end
    for _, value in ipairs(message) do
        local words, in_words = value[4], value[6]
        local numbers = {}
        for _, part in ipairs(value[5] or { false }) do
            local width = WIDTHS[value[2]]
            local bytes = body(at, width)
            local number = value[2] == "int16" and bytes:le_int() or bytes:le_uint()
            local shown = item:add_le(ucp_field(message, value, part), bytes)
            if in_words then shown:append_text(" (" .. in_words(number) .. ")") end
            local text = in_words and in_words(number) or ("%d"):format(number)
            numbers[#numbers + 1] = type(words) == "table" and words[number] or text
            at = at + width
        end
        local unit = type(words) == "string" and words or ""
        texts[#texts + 1] = value[1] .. " " .. table.concat(numbers, " ") .. unit
        if value[1] == "state" then
            item:add(UCP["network_state.state_width"], body, body:len()):set_generated()
        elseif value[1] == "battery_pct" and body(0, 2):le_uint() > 100 then
            warn(item, UCP_EXPERTS.battery, "Battery above 100 %% (ruling U5)")
        end
    end
    if message == UNKNOWN then
        local empty = range(6, 0)
        item:add(UCP["unknown.body"], body or empty)
        texts = { ("id %d, body %s"):format(frame.bytes:byte(5), hex(frame.bytes:sub(7, -3))) }
    end
    local hazards = hazards_of(frame, message, body)
    if #hazards > 0 then
        item:add_proto_expert_info(UCP_EXPERTS.hazard, table.concat(hazards, "; "))
    end
    local contents = #texts > 0 and ": " .. table.concat(texts, ", ") or ""
    return ("%s, index %d%s"):format(frame.name, frame.bytes:byte(6), contents)
end

-- What a packet shows.

local interface_id = Field.new("frame.interface_id")
local interface_name = Field.new("frame.interface_name")
local section_number = Field.new("frame.section_number")

-- Whose time a response time is. Nothing but the name of the port tells of an adapter.
local function clock_of(port)
    local name = port and port:lower() or ""
    if name:find("usb") or name:find("acm") then
        return "the machine behind the USB adapter: up to 16 ms are the adapter's"
    elseif name:find("^tcp:") then
        return "the recording machine: the time of the network is in it"
    elseif name:find("pts/") then
        return "the recording machine, on a pseudo-terminal: no wire, no adapter"
    end
    return "the recording machine; if the port is a USB adapter, up to 16 ms are the adapter's"
end

-- An offset may exceed 32 bits.
local function u64(number)
    return UInt64.new(number % 4294967296, math.floor(number / 4294967296))
end

-- A view of the bytes of an event: in the packet, or put together from several.
local function range_of(event, packet, tvb)
    local first = event.begin - packet.begin
    if first >= 0 then return tvb(first, event.finish - event.begin) end
    local whole = ByteArray.new(hex(event.bytes))
    return whole:tvb("Frame of several packets"):range()
end

-- Adds the number of the packet in which an event ends.
local function refer(item, field, event)
    local number = number_of(event.packet)
    if number then item:add(field, number):set_generated() end
end

-- The frame that ends in this packet.
local function show_frame(event, packet, tvb, tree, view)
    local kind, fields, experts = packet.line.kind, view.fields, view.experts
    local range = range_of(event, packet, tvb)
    local item = tree:add(view.proto, range)
    item:add(fields.offset, range, u64(event.begin)):set_generated()
    item:add(fields.length, range, range:len()):set_generated()
    item:add(fields.protocol, range, kind.name):set_generated()
    item:add(fields.message, range, event.name):set_generated()
    local text = view.show(event, range, item, kind)
    item:add(fields.bytes, range)
    local state, ending = packet.line.state, view.ending and view.ending.state
    local answer = state.answers[event] or (ending and ending.answers[event])
    if event.request then
        refer(item, fields.request, event.request)
        if event.took then
            item:add(fields.took, u64(event.took)):set_generated()
            local port = interface_name()
            item:add(fields.clock, clock_of(port and port.value)):set_generated()
            text = text .. (" (%d µs)"):format(event.took)
        end
    elseif answer then
        refer(item, fields.answer, answer)
    elseif state.unanswered[event] then
        warn(item, experts.unanswered, "Not answered before the next request")
    elseif ending and ending.unanswered[event] then
        warn(item, experts.unanswered, "Not answered until the end")
    end
    if event.is_echo then text = text .. " (echo)" end
    item:append_text(", " .. text)
    return text
end

local function warn_of_gap(gap, item, view, text)
    local experts = view.experts
    item:add_proto_expert_info(gap.by.crc and experts.bad_crc or experts.gap, text)
end

-- The gap that ends in this packet, or the one that is still open.
local function show_gap(gap, packet, tvb, tree, view, is_open)
    local fields, experts = view.fields, view.experts
    local first = math.max(gap.begin - packet.begin, 0)
    local range = tvb(first, math.min(gap.finish, packet.finish) - packet.begin - first)
    local item = tree:add(view.proto, range)
    local length = gap.finish - gap.begin
    local bytes = length == 1 and "byte" or "bytes"
    local text = ("%d %s skipped%s: %s, %s"):format(
        length, bytes, is_open and " so far" or "", gap.reason, MEANINGS[gap.reason])
    item:append_text(", " .. text)
    if is_open then
        item:add(fields.so_far, range, length):set_generated()
    else
        item:add(fields.skipped_offset, range, u64(gap.begin)):set_generated()
        item:add(fields.skipped_length, range, length):set_generated()
        item:add(fields.reason, range, gap.reason):set_generated()
        -- If it is the only one, that says all.
        if (gap.by[gap.reason] or 0) < length then
            for _, reason in ipairs(REASONS) do
                local count = gap.by[reason]
                if count then
                    item:add(fields["reason_" .. reason], range, count):set_generated()
                end
            end
        end
    end
    warn_of_gap(gap, item, view, text)
    -- Robots trust a length before they know the checksum, and whether all of the frame comes.
    if gap.by.length and packet.line.kind.name == "ucp" and packet.stream.direction ~= "in" then
        item:add_proto_expert_info(experts.hazard,
            "A length below 4 or above 60 hangs or overruns shipped robots (rulings U2, U13)")
    end
    return text
end

-- The beginning of an event that ends in a later packet.
local function show_part(event, packet, tvb, tree, view)
    local first = math.max(event.begin - packet.begin, 0)
    local range = tvb(first, packet.finish - packet.begin - first)
    local item = tree:add(view.proto, range)
    local what = event.name and "frame" or "gap"
    refer(item, view.fields.ends_in, event)
    local text = ("%d of %d bytes of a %s"):format(range:len(), event.finish - event.begin, what)
    item:append_text(", " .. text)
    if event.reason then warn_of_gap(event, item, view, text) end
    return text
end

-- Bytes that are neither framed nor skipped yet.
local function show_pending(packet, tvb, tree, view)
    local first = math.max(packet.stream.offset - packet.begin, 0)
    local range = tvb(first, packet.finish - packet.begin - first)
    local item = tree:add(view.proto, range)
    item:add(view.fields.pending, range, range:len()):set_generated()
    local text = ("%d bytes that may still become a frame"):format(range:len())
    item:append_text(", " .. text)
    return text
end

-- Sender and receiver of a frame, for the columns of addresses.
local function addresses(frame, kind)
    if kind.name == "ucp" then
        local from = ucp_message(frame.bytes).from
        if not from then return end
        return from, from == "host" and "robot" or "host"
    end
    local node = "node " .. frame.node
    if frame.name == "write" or frame.name == "read_request" then return "master", node end
    return node, "master"
end

local VIEWS = {
    ikeya = {
        proto = ikeya, fields = IKEYA, experts = IKEYA_EXPERTS, show = show_ikeya,
        title = "Ikeya MD",
    },
    ucp = { proto = ucp, fields = UCP, experts = UCP_EXPERTS, show = show_ucp, title = "UCP" },
}
VIEWS["ikeya-3"] = VIEWS.ikeya

local function dissect(tvb, pinfo, tree)
    local kind = KINDS[pinfo.match_uint]
    if not kind then return 0 end
    local packet = pinfo.visited and packets[pinfo.number]
    if packet then
        packet.is_listed = true
    else
        local interface, section = interface_id(), section_number()
        local key = ("%s:%s:%s"):format(kind.name, section and section.value or "",
            interface and interface.value or "")
        local direction = ({ [P2P_DIR_RECV] = "in", [P2P_DIR_SENT] = "out" })[pinfo.p2p_dir]
        -- A packet without a time has the time 0.
        local micros = pinfo.abs_ts > 0 and math.floor(pinfo.abs_ts * 1e6 + 0.5) or nil
        packet = take(key, kind, direction or "unknown", tvb:raw(), pinfo.number, micros)
        packet.is_blind = not interface
    end
    local line, stream = packet.line, packet.stream
    local view = setmetatable({}, { __index = VIEWS[kind.name] })
    local shared, is_over = {}, pinfo.visited
    append_shared(shared, stream.events, packet.begin, packet.finish)
    if is_over then
        view.ending = ending_of(line)
        append_shared(shared, view.ending.events[stream.direction], packet.begin, packet.finish)
    end
    local texts = {}
    for _, event in ipairs(shared) do
        local show = show_part
        if event.packet == packet then show = event.name and show_frame or show_gap end
        texts[#texts + 1] = show(event, packet, tvb, tree, view)
        if event.name then
            local from, to = addresses(event, kind)
            if from then pinfo.cols.src, pinfo.cols.dst = from, to end
        end
    end
    local gap = stream.gap
    if not is_over and gap and gap.finish > packet.begin then
        texts[#texts + 1] = show_gap(gap, packet, tvb, tree, view, true)
    end
    if not is_over and #stream.held > 0 and stream.offset < packet.finish then
        texts[#texts + 1] = show_pending(packet, tvb, tree, view)
    end
    -- The first pass of `tshark -2` knows no interfaces without `-R frame`.
    local interface = packet.is_blind and interface_id()
    if interface and interface.value > 0 then
        texts[#texts + 1] = "decoded as if there were one interface only: use tshark -R frame"
    end
    pinfo.cols.protocol = view.title
    pinfo.cols.info = table.concat(texts, "; ")
    return tvb:len()
end

ikeya.dissector, ucp.dissector = dissect, dissect
ikeya.init, ucp.init = reset, reset

local encapsulations = DissectorTable.get("wtap_encap")
encapsulations:add(wtap.USER0, ikeya)
encapsulations:add(wtap.USER1, ikeya)
encapsulations:add(wtap.USER3, ucp)
