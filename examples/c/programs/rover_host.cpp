// Drives a rover for two seconds and prints what it measures: rover_host PORT
//
// Returns 0 only if it is then seen to stand still. After Ctrl-C nothing is sent any more, and a
// rover stops by itself.
#include <axlewire_linux.hpp>
#include <cstdio>

using std::chrono::milliseconds;
using std::chrono::seconds;

int main(int argc, char **argv) {
    if (argc != 2) return std::puts("rover_host PORT"), 1;
    axle::SerialRover rover{argv[1]};
    if (rover.error()) {
        std::fprintf(stderr, "%s: %s\n", argv[1], rover.error().message().c_str());
        return 1;
    }

    // A robot that is not heard is not commanded.
    const auto is_heard = [&] { return rover.role().robot_state()->link == AXLE_UCP_LINK_UP; };
    auto error = rover.run_until(rover.now() + seconds{2}, is_heard, [](const auto &) {});
    if (!is_heard()) return std::fprintf(stderr, "no robot answers\n"), 1;

    const axle::Time end = rover.now() + seconds{2};
    while (!error && rover.now() < end) {
        // Percent; it counts for half a second.
        if (const auto status = rover.drive(20, 0); !status) {
            std::fprintf(stderr, "%s\n", status.text().data());
            break;
        }
        error = rover.run_for(milliseconds{200});
        if (const auto report = rover.role().take_report()) {
            const auto &seen = report->telemetry;
            std::printf("%d %d %d %d rpm, %.1f V\n", seen.rpm[0], seen.rpm[1], seen.rpm[2],
                        seen.rpm[3], seen.voltage_dv / 10.0);
        }
    }

    // Whatever has happened.
    if (!rover.stop()) return std::fprintf(stderr, "the rover may be moving\n"), 1;
    std::puts("standing still");
    return error ? 1 : 0;
}
