// Runs the component as a controller manager would, 100 times a second: run_component PORT NODE
//
// Returns 0 only if the joint has reached its speed, and deactivating it has seen it stand still.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <hardware_interface/system_interface.hpp>
#include <memory>
#include <thread>

std::unique_ptr<hardware_interface::SystemInterface> make_component();

int main(int argc, char **argv) {
    using namespace hardware_interface;
    if (argc != 3) return std::puts("run_component PORT NODE"), 1;
    const auto component = make_component();
    const HardwareInfo info{{{"port", argv[1]}}, {{"wheel", {{"node", argv[2]}}}}};
    if (component->on_init(info) != CallbackReturn::SUCCESS) return 1;
    const double &measured = *component->export_state_interfaces().at(0).value;
    double &commanded = *component->export_command_interfaces().at(0).value;
    // It is read before it is activated, too.
    if (component->read({}, rclcpp::Duration{10'000'000}) != return_type::OK) return 1;
    if (component->on_activate({}) != CallbackReturn::SUCCESS) return std::puts("no joint"), 1;

    const rclcpp::Duration period{10'000'000};
    auto next = std::chrono::steady_clock::now();
    bool is_fine = true;
    for (int cycle = 0; cycle < 200 && is_fine; ++cycle) {
        is_fine = component->read({}, period) == return_type::OK;
        commanded = 10.0; // radians per second
        is_fine = is_fine && component->write({}, period) == return_type::OK;
        if (cycle % 40 == 39) std::printf("%.2f rad/s\n", measured);
        std::this_thread::sleep_until(next += std::chrono::milliseconds{10});
    }
    // A manager calls only one of both.
    const auto ended = is_fine ? component->on_deactivate({}) : component->on_error({});
    const bool is_still = ended == CallbackReturn::SUCCESS;
    is_fine = is_fine && std::fabs(measured - commanded) < 0.1;
    std::puts(is_still ? "standing still" : "the joint may be moving");
    return is_fine && is_still ? 0 : 1;
}
