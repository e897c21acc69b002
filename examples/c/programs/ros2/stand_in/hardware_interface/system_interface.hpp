// Stands in for the header of ros2_control: our own words for the part that axle_bus.cpp uses.
#pragma once
#include <cstdint>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

namespace rclcpp {
class Time {};
class Duration {
  public:
    explicit Duration(std::int64_t nanoseconds) : nanoseconds_{nanoseconds} {}
    std::int64_t nanoseconds() const { return nanoseconds_; }

  private:
    std::int64_t nanoseconds_;
};
} // namespace rclcpp
namespace rclcpp_lifecycle {
class State {};
} // namespace rclcpp_lifecycle

namespace hardware_interface {
enum class return_type : std::uint8_t { OK = 0, ERROR = 1 };
enum class CallbackReturn : std::uint8_t { SUCCESS = 97, FAILURE = 98, ERROR = 99 };

struct ComponentInfo {
    std::string name;
    std::unordered_map<std::string, std::string> parameters;
};
struct HardwareInfo {
    std::unordered_map<std::string, std::string> hardware_parameters;
    std::vector<ComponentInfo> joints;
};

/// A value of a joint, shared with the controllers.
struct Handle {
    std::string joint, interface;
    double *value;
    Handle(std::string of, std::string name, double *at)
        : joint{std::move(of)}, interface{std::move(name)}, value{at} {}
};
using StateInterface = Handle;
using CommandInterface = Handle;

class SystemInterface {
  public:
    virtual ~SystemInterface() = default;
    virtual CallbackReturn on_init(const HardwareInfo &info) {
        info_ = info;
        return CallbackReturn::SUCCESS;
    }
    virtual std::vector<StateInterface> export_state_interfaces() = 0;
    virtual std::vector<CommandInterface> export_command_interfaces() = 0;
    virtual CallbackReturn on_activate(const rclcpp_lifecycle::State &) = 0;
    virtual CallbackReturn on_deactivate(const rclcpp_lifecycle::State &) = 0;
    virtual CallbackReturn on_error(const rclcpp_lifecycle::State &) {
        return CallbackReturn::ERROR;
    }
    virtual return_type read(const rclcpp::Time &time, const rclcpp::Duration &period) = 0;
    virtual return_type write(const rclcpp::Time &time, const rclcpp::Duration &period) = 0;

  protected:
    HardwareInfo info_;
};
} // namespace hardware_interface
