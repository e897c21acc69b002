// Every class of axlewire.hpp, without a port: a master and slaves, a host and a robot, decoders.
#include <axlewire.hpp>
#include <cstdio>
#include <cstring>
#include <vector>
#if __cplusplus >= 202002L
#include <span>
#endif

using namespace std::chrono_literals;

static int failures = 0;

#define CHECK(what)                                                                                \
    if (!(what)) ++failures, std::printf("line %d: not true: %s\n", __LINE__, #what)

/// Lets two roles talk on a line that takes no time.
template <class A, class B, class F>
void talk(A &a, B &b, axle::Time &now, axle::Time span, F &&on_event) {
    for (const axle::Time end = now + span; now < end; now += 100us) {
        a.handle_timeout(now);
        b.handle_timeout(now);
        while (const auto event = a.poll_event()) on_event(*event);
        while (const auto event = b.poll_event()) {}
        while (const auto frame = a.poll_transmit(now)) b.handle_input(*frame, now);
        while (const auto frame = b.poll_transmit(now)) a.handle_input(*frame, now);
    }
}

template <class Master, class Slave, class Velocity>
void turn(Velocity velocity) {
    axle::Time now = 1s;
    auto config = axle::MasterConfig::direct();
    config.accepts_early = 1;
    Master master{config, now};
    Slave slave{2, AXLE_IKEYA_MODE_VELOCITY, axle::SlaveConfig::direct(), now};
    CHECK(master.made() && slave.made());
    int answers = 0;
    const auto count = [&](const auto &it) { answers += it.kind == AXLE_IKEYA_MASTER_STATUS; };
    CHECK(master.set_velocity(2, velocity, now) == AXLE_ERROR_NOT_ONLINE);
    master.discover(now);
    talk(master, slave, now, 500ms, count);
    CHECK(answers > 0 && master.node(2)->health == AXLE_IKEYA_HEALTH_ONLINE);
    CHECK(!slave.command(now) && *slave.mode() == AXLE_IKEYA_MODE_VELOCITY);
    CHECK(master.set_velocity(2, velocity, now));
    slave.set_velocity(velocity);
    talk(master, slave, now, 500ms, count);
    CHECK(slave.command(now) && slave.command(now)->velocity_rps[0] == 1.5f);
    CHECK(master.node(2)->status.velocity_rps[0] == 1.5f);
    CHECK(master.stop(2, now));
    slave.set_velocity({});
    talk(master, slave, now, 3s, count);
    CHECK(master.node(2)->stop == AXLE_IKEYA_STOP_STANDING_STILL);
    CHECK(master.set_position(2, {}, now) == AXLE_ERROR_WRONG_MODE);
    CHECK(master.node(9).status().name() == "AXLE_ERROR_NODE_ID");
    CHECK(master.bus()->stops_owed == 0 && master.node_statistics(2)->replies > 0);
    CHECK(master.counters()->frames > 0 && slave.statistics()->reads > 0);
}

static void drive() {
    axle::Time now = 1s;
    axle::Host host{axle::HostConfig::direct(), now};
    axle::Robot robot{axle::RobotConfig::direct(), now};
    robot.set_telemetry({}, now);
    const auto ignore = [](const auto &) {};
    talk(host, robot, now, 500ms, ignore);
    CHECK(host.set_speed(101, 0, now) == AXLE_ERROR_PERCENT);
    CHECK(host.set_speed(30, -5, now));
    talk(host, robot, now, 200ms, ignore);
    CHECK(robot.command(now).speed_pct == 30 && robot.command(now).turn_pct == -5);
    CHECK(host.take_report() && host.report() && host.robot_state()->is_commanded);
    CHECK(robot.command(now + 1s).speed_pct == 0);
    host.stop(now);
    talk(host, robot, now, 3s, ignore);
    CHECK(host.robot_state()->stop == AXLE_UCP_STOP_STANDING_STILL);
    CHECK(!robot.calibration() && robot.answer_update(AXLE_UCP_OTA_FAILED, now) == AXLE_NONE);
}

static void keep_biases() {
    axle::Host host{axle::HostConfig::direct(), 0ms};
    CHECK(!host.imu_bias() && !host.mag_bias());
    CHECK(host.set_bias(axle::ImuBias{{1, 2, 3}, {4, 5, 6}}) && host.imu_bias()->gyro[2] == 6);
    CHECK(host.set_bias(axle::MagBias{{7, 8, 9}}) && host.mag_bias()->mag[0] == 7);
}

static void decode() {
    axle::Message ping{};
    ping.kind = AXLE_UCP_PING;
    const auto frame = axle::encode(ping);
    CHECK(frame && axle::parse_message(*frame)->kind == AXLE_UCP_PING);
    std::vector<std::uint8_t> line{1, 2};
    line.insert(line.end(), frame->data(), frame->data() + frame->size());

    axle::UcpDecoder decoder;
    axle::Bytes rest = line;
    const auto gap = decoder.decode(rest), found = decoder.decode(rest);
    CHECK(gap && gap->kind == AXLE_STREAM_SKIPPED && gap->skipped == 2);
    CHECK(found && found->kind == AXLE_STREAM_FRAME && found->length == frame->size());
    CHECK(!decoder.decode(rest) && rest.empty() && decoder.counters()->frames == 1);
    std::array<axle_stream_event, 4> events{};
    rest = line;
    CHECK(decoder.decode(rest, events) == 2 && events[1].length == frame->size());
    CHECK(decoder.decode(rest, events) == 0 && rest.empty() && decoder.counters()->frames == 2);

    axle::Packet read{};
    read.kind = AXLE_IKEYA_PACKET_READ;
    CHECK(axle::encode(read).status() == AXLE_ERROR_NODE_ID);
    read.node = 8;
    const auto packet = axle::encode(read);
    CHECK(packet && axle::parse_packet(*packet)->node == 8);
    axle::IkeyaDecoder bus{AXLE_IKEYA_TO_SLAVE};
    std::uint8_t *spare = nullptr;
    CHECK(bus.spare(spare) >= packet->size());
    std::memcpy(spare, packet->data(), packet->size());
    CHECK(bus.commit(packet->size()) && bus.poll() && !bus.poll() && *bus.pending() == 0);
    for (const std::uint8_t byte : axle::Bytes{*packet})
        if (bus.push(byte)) CHECK(bus.poll());
    CHECK(bus.counters()->frames == 2);
    CHECK(axle::IkeyaDecoder{99}.made() == AXLE_ERROR_VALUE);
}

static void convert() {
    CHECK(axle::counts(*axle::position(9000)) == 9000);
    CHECK(axle::position(INT32_MAX).status() == AXLE_ERROR_POSITION);
    CHECK(axle::dip_switches(0, AXLE_IKEYA_ID_VALUE_PLUS_ONE)->node == 1);
    axle::Clock32 clock;
    clock.at(UINT32_MAX);
    CHECK(clock.at(1) == axle::Time{0x1'0000'0001});
    const std::vector<std::uint8_t> digits{'1', '2', '3', '4', '5', '6', '7', '8', '9'};
    CHECK(axle::crc16(digits) == 0x4B37); // the check value of CRC-16/MODBUS
#if __cplusplus >= 202002L
    std::span<const std::uint8_t> span{digits};
    CHECK(axle::crc16(span) == 0x4B37);
    span = axle::Bytes{digits};
    CHECK(span.size() == 9);
#endif
}

int main() {
    turn<axle::Master, axle::Slave>(1.5f);
    turn<axle::Master3, axle::Slave3>(std::array<float, 3>{1.5f, -2, 0});
    drive();
    keep_biases();
    decode();
    convert();
    return failures == 0 ? 0 : 1;
}
