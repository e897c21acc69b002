// Turns one node and moves another, and prints what happens: bus_host PORT TURNING MOVING
//
// Node TURNING is in velocity mode, node MOVING in position mode. Returns 0 only if both are then
// seen to stand still. After Ctrl-C, too, they are stopped.
#include <axlewire_linux.hpp>
#include <csignal>
#include <cstdio>
#include <cstdlib>

static volatile std::sig_atomic_t is_over;

int main(int argc, char **argv) {
    using std::chrono::milliseconds;
    if (argc != 4) return std::puts("bus_host PORT TURNING MOVING"), 1;
    std::signal(SIGINT, [](int) { is_over = 1; });
    const auto id = [](const char *text) {
        const int node = text[0] >= '1' && text[0] <= '8' && !text[1] ? text[0] - '0' : 0;
        return static_cast<std::uint8_t>(node);
    };
    const auto turning = id(argv[2]), moving = id(argv[3]);
    if (!turning || !moving) return std::puts("a node is a number from 1 to 8"), 1;
    axle::SerialBus bus{argv[1]};
    auto error = bus.discover();
    if (error) return std::fprintf(stderr, "%s: %s\n", argv[1], error.message().c_str()), 1;

    const auto counts = [&] {
        return axle_ikeya_position_counts(bus.role().node(moving)->status.position[0]);
    };
    const auto rps = [&] { return bus.role().node(turning)->status.velocity_rps[0]; };

    // Half a turn on from where it is now.
    axle::Position to;
    axle::Status status =
        axle_ikeya_position_from_counts(counts() + AXLE_IKEYA_COUNTS_PER_REVOLUTION / 2, &to);
    if (status) status = bus.set_velocity(turning, 1.5f);
    if (status) status = bus.set_position(moving, to);
    if (!status) std::fprintf(stderr, "%s\n", status.text().data());

    const auto begin = bus.now();
    const auto on_event = [](const axle::SerialBus::Event &event) {
        if (event.kind == AXLE_IKEYA_MASTER_HEALTH)
            std::printf("node %d: %s\n", event.node, axle_ikeya_health_name(event.health));
    };
    while (status && !error && !is_over && bus.now() - begin < milliseconds{2000}) {
        error = bus.run_for(milliseconds{250}, on_event);
        std::printf("%.2f rps, %.2f turns\n", static_cast<double>(rps()), counts() / 8192.0);
    }

    // Whatever has happened; `stop` says what the destructor cannot.
    const bool has_stopped = bus.stop(turning);
    const bool is_still = bus.stop(moving) && has_stopped;
    std::puts(is_still ? "standing still" : "a motor may be moving");
    return is_still && status && !error && !is_over ? 0 : 1;
}
