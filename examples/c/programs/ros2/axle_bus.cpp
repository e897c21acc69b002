// A ros2_control hardware component: velocity joints on a motor bus.
//
// In the URDF, <param name="port"> is of the hardware, and <param name="node"> of each joint.
// Compiled here against headers in stand_in/, which have only what is used of that interface.
#include <axlewire_linux.hpp>
#include <cmath>
#include <hardware_interface/system_interface.hpp>
#include <hardware_interface/types/hardware_interface_type_values.hpp>
#include <pluginlib/class_list_macros.hpp>

namespace hw = hardware_interface;
constexpr double turn = 6.283185307179586; // radians

class AxleBus : public hw::SystemInterface {
    struct Joint {
        std::uint8_t node;
        double measured = NAN, commanded = NAN; // radians per second
    };
    std::optional<axle::SerialBus> bus_;
    std::vector<Joint> joints_;

  public:
    hw::CallbackReturn on_init(const hw::HardwareInfo &info) override {
        for (const auto &joint : info.joints)
            joints_.push_back({static_cast<std::uint8_t>(std::stoi(joint.parameters.at("node")))});
        return SystemInterface::on_init(info);
    }
    std::vector<hw::StateInterface> export_state_interfaces() override {
        std::vector<hw::StateInterface> all;
        for (std::size_t i = 0; i < joints_.size(); ++i)
            all.emplace_back(info_.joints[i].name, hw::HW_IF_VELOCITY, &joints_[i].measured);
        return all;
    }
    std::vector<hw::CommandInterface> export_command_interfaces() override {
        std::vector<hw::CommandInterface> all;
        for (std::size_t i = 0; i < joints_.size(); ++i)
            all.emplace_back(info_.joints[i].name, hw::HW_IF_VELOCITY, &joints_[i].commanded);
        return all;
    }
    hw::CallbackReturn on_activate(const rclcpp_lifecycle::State &) override {
        auto config = axle::MasterConfig::usb_adapter();
        config.dead_man_us = 500'000; // reads without a write stop the joints
        bus_.emplace(info_.hardware_parameters.at("port").c_str(), config);
        if (bus_->discover()) return hw::CallbackReturn::ERROR; // also if the port is in use
        for (const auto &joint : joints_)
            if (!bus_->is_online(joint.node)) return hw::CallbackReturn::ERROR;
        return hw::CallbackReturn::SUCCESS;
    }
    hw::CallbackReturn on_deactivate(const rclcpp_lifecycle::State &) override {
        bool is_still = true;
        for (auto &joint : joints_) is_still = (!bus_ || bus_->stop(joint.node)) && is_still;
        bus_.reset();
        return is_still ? hw::CallbackReturn::SUCCESS : hw::CallbackReturn::ERROR;
    }
    // After an ERROR of `read` or `write` nobody serves the bus any more.
    hw::CallbackReturn on_error(const rclcpp_lifecycle::State &state) override {
        return on_deactivate(state);
    }
    hw::return_type read(const rclcpp::Time &, const rclcpp::Duration &period) override {
        if (!bus_) return hw::return_type::OK; // not activated
        // The line has half of each cycle; the controllers have the rest.
        if (bus_->run_for(axle::Time{period.nanoseconds() / 2000})) return hw::return_type::ERROR;
        for (auto &joint : joints_) {
            if (!bus_->is_online(joint.node)) return hw::return_type::ERROR;
            joint.measured = turn * bus_->role().node(joint.node)->status.velocity_rps[0];
        }
        return hw::return_type::OK;
    }
    hw::return_type write(const rclcpp::Time &, const rclcpp::Duration &) override {
        for (const auto &joint : joints_) {
            if (!bus_ || std::isnan(joint.commanded)) continue; // no controller yet
            const auto rps = static_cast<float>(joint.commanded / turn);
            if (!bus_->set_velocity(joint.node, rps)) return hw::return_type::ERROR;
        }
        return hw::return_type::OK;
    }
};

PLUGINLIB_EXPORT_CLASS(AxleBus, hardware_interface::SystemInterface)
