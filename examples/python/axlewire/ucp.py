"""UCP: a function per message, which gives the frame as bytes.

    >>> axlewire.ucp.motor_control(30, 0)
"""

from axlewire._axlewire import (
    ucp_bias_request as bias_request,
    ucp_biases as biases,
    ucp_calibration_end as calibration_end,
    ucp_calibration_end_ack as calibration_end_ack,
    ucp_calibration_start as calibration_start,
    ucp_calibration_start_ack as calibration_start_ack,
    ucp_document_report as document_report,
    ucp_imu_bias as imu_bias,
    ucp_imu_bias_ack as imu_bias_ack,
    ucp_mag_bias as mag_bias,
    ucp_mag_bias_ack as mag_bias_ack,
    ucp_motor_control as motor_control,
    ucp_network_state as network_state,
    ucp_ota_ack as ota_ack,
    ucp_ota_request as ota_request,
    ucp_ping as ping,
    ucp_pong as pong,
    ucp_report as report,
    ucp_unknown as unknown,
)

__all__ = [
    "bias_request",
    "biases",
    "calibration_end",
    "calibration_end_ack",
    "calibration_start",
    "calibration_start_ack",
    "document_report",
    "imu_bias",
    "imu_bias_ack",
    "mag_bias",
    "mag_bias_ack",
    "motor_control",
    "network_state",
    "ota_ack",
    "ota_request",
    "ping",
    "pong",
    "report",
    "unknown",
]
