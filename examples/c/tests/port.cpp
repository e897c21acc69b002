// What a bus on a serial port does with a port in use, bad settings, signals and endless times:
// port PORT, with a motor that is node 1.
#include <axlewire_linux.hpp>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <sys/time.h>

#define CHECK(condition)                                                                           \
    if (!(condition)) return std::printf("line %d: %s\n", __LINE__, #condition), 1

int main(int argc, char **argv) {
    using std::chrono::milliseconds;
    if (argc != 2) return 1;
    axle::SerialBus bus{argv[1]};
    CHECK(!bus.error() && !bus.discover() && bus.is_online(1));

    // One program at a time.
    axle::SerialBus second{argv[1]};
    CHECK(second.error() == std::errc::device_or_resource_busy);
    CHECK(second.discover() == second.error() && second.run_for(milliseconds{1}) == second.error());
    CHECK(!second.stop(1));

    // Settings that the port or the role does not have.
    auto config = axle::MasterConfig::usb_adapter();
    config.baud = 12'345;
    CHECK(axle::SerialBus("/dev/ptmx", config).error() == std::errc::invalid_argument);
    config = axle::MasterConfig::usb_adapter();
    config.polling = 9;
    CHECK(axle::SerialBus("/dev/ptmx", config).error() == std::errc::invalid_argument);

    // A signal each 0.1 ms, which interrupts whatever waits.
    struct sigaction action {};
    action.sa_handler = [](int) {};
    sigaction(SIGALRM, &action, nullptr);
    const itimerval often{{0, 100}, {0, 100}}, never{};
    setitimer(ITIMER_REAL, &often, nullptr);
    CHECK(bus.set_velocity(1, 2.0f) && !bus.run_for(milliseconds{500}));
    const auto measured = [&] { return bus.role().node(1)->status.velocity_rps[0]; };
    CHECK(std::fabs(measured() - 2.0f) < 0.1f);
    CHECK(bus.stop(1) && std::fabs(measured()) < 0.1f);
    setitimer(ITIMER_REAL, &never, nullptr);

    // Until something happens, however long that takes.
    CHECK(bus.set_velocity(1, 1.0f));
    int events = 0;
    CHECK(!bus.run_until(axle::Time::max(), [&] { return events > 0; }, [&](auto &) { ++events; }));
    CHECK(bus.stop(1));
    std::puts("all as it says");
    return 0;
}
