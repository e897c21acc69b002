// Stands in for the header of ros2_control.
#pragma once

namespace hardware_interface {
constexpr char HW_IF_VELOCITY[] = "velocity";
} // namespace hardware_interface
