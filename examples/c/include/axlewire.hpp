// axlewire for C++17: classes over axlewire.h that own their memory. Header only; neither
// exceptions nor RTTI are needed. Each member calls the C function of its name, which says more.
#ifndef AXLEWIRE_HPP
#define AXLEWIRE_HPP

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <type_traits>
#include <utility>

#include "axlewire.h"

namespace axle {

/// A time of a clock that never goes back, and spans of it.
using Time = std::chrono::microseconds;

/// What a command has come to: done, nothing to do (AXLE_NONE), or an error.
class Status {
  public:
    // cppcheck-suppress noExplicitConstructor ; what a C function returns is one
    constexpr Status(axle_result code = AXLE_OK) : code_{code} {}
    /// Done.
    constexpr explicit operator bool() const { return code_ == AXLE_OK; }
    constexpr bool is_error() const { return code_ < 0; }
    constexpr axle_result code() const { return code_; }
    std::string_view name() const { return axle_result_name(code_); }
    std::string_view text() const { return axle_result_text(code_); }
    friend constexpr bool operator==(Status a, Status b) { return a.code_ == b.code_; }
    friend constexpr bool operator!=(Status a, Status b) { return a.code_ != b.code_; }

  private:
    axle_result code_;
};

/// A value, or why there is none. The value of an error is all zeros.
template <class T>
class [[nodiscard]] Result {
  public:
    constexpr Result(Status status, const T &value) : status_{status}, value_{value} {}
    constexpr bool has_value() const { return static_cast<bool>(status_); }
    constexpr explicit operator bool() const { return has_value(); }
    constexpr const T &operator*() const { return value_; }
    constexpr const T *operator->() const { return &value_; }
    constexpr T value_or(const T &other) const { return has_value() ? value_ : other; }
    constexpr Status status() const { return status_; }

  private:
    Status status_;
    T value_;
};

/// Bytes of somebody else. Converts from anything with `data` and `size`, such as a vector or a
/// std::span of C++20, and into such a span.
class Bytes {
  public:
    constexpr Bytes() = default;
    constexpr Bytes(const std::uint8_t *data, std::size_t size) : data_{data}, size_{size} {}
    template <class C, class = std::enable_if_t<std::is_convertible_v<
                           decltype(std::declval<const C &>().data()), const std::uint8_t *>>>
    // cppcheck-suppress noExplicitConstructor ; so that a vector can be passed
    constexpr Bytes(const C &bytes) : Bytes(bytes.data(), bytes.size()) {}
    constexpr const std::uint8_t *data() const { return data_; }
    constexpr std::size_t size() const { return size_; }
    constexpr bool empty() const { return size_ == 0; }
    constexpr const std::uint8_t *begin() const { return data_; }
    constexpr const std::uint8_t *end() const { return data_ + size_; }

  private:
    const std::uint8_t *data_ = nullptr;
    std::size_t size_ = 0;
};

/// An encoded frame of at most N bytes.
template <std::size_t N>
struct Frame {
    std::array<std::uint8_t, N> memory;
    std::size_t length;
    constexpr const std::uint8_t *data() const { return memory.data(); }
    constexpr std::size_t size() const { return length; }
};

namespace detail {

inline Time time(std::uint64_t us) { return Time{static_cast<Time::rep>(us)}; }

// An argument as C takes it.
inline std::uint64_t pass(Time time) { return static_cast<std::uint64_t>(time.count()); }
template <class T>
const T *pass(const std::array<T, 3> &values) { return values.data(); }
template <class T>
const T &pass(const T &value) { return value; }

template <class F, class... A>
Status call(F function, const A &...arguments) { return function(pass(arguments)...); }

/// The output of a C function, whose last argument is where to write it.
template <class T, class F, class... A>
Result<T> get(F function, const A &...arguments) {
    T value{};
    const Status status = function(pass(arguments)..., &value);
    return {status, value};
}

/// The same of something that may be absent.
template <class T, class F, class... A>
std::optional<T> maybe(F function, const A &...arguments) {
    const auto result = get<T>(function, arguments...);
    return result ? std::optional<T>{*result} : std::nullopt;
}

} // namespace detail

using Position = axle_ikeya_position;
using Motion = axle_ikeya_motion;
using Node = axle_ikeya_node;
using Bus = axle_ikeya_bus;
using Packet = axle_ikeya_packet;
using Message = axle_ucp_message;
using Motor = axle_ucp_motor;
using Report = axle_ucp_report;
using RobotState = axle_ucp_robot_state;
using Telemetry = axle_ucp_telemetry;
using ImuBias = axle_ucp_imu_bias;
using MagBias = axle_ucp_mag_bias;

inline std::uint16_t crc16(Bytes bytes) { return axle_crc16(bytes.data(), bytes.size()); }

inline Time wire_time(std::size_t bytes, std::uint32_t baud) {
    return Time{axle_wire_time_us(bytes, baud)};
}

/// Extends a timer of 32 bits.
class Clock32 {
  public:
    Time at(std::uint32_t timer_us) { return detail::time(axle_clock32_at(&clock_, timer_us)); }

  private:
    axle_clock32 clock_{};
};

inline std::int32_t counts(Position position) { return axle_ikeya_position_counts(position); }
inline Result<Position> position(std::int32_t counts) {
    return detail::get<Position>(axle_ikeya_position_from_counts, counts);
}

inline Result<Frame<AXLE_IKEYA_PACKET_MAX_LENGTH>> encode(const Packet &packet) {
    Frame<AXLE_IKEYA_PACKET_MAX_LENGTH> to{};
    const Status status =
        axle_ikeya_encode(&packet, to.memory.data(), to.memory.size(), &to.length);
    return {status, to};
}
inline Result<Frame<AXLE_UCP_FRAME_MAX_LENGTH>> encode(const Message &message) {
    Frame<AXLE_UCP_FRAME_MAX_LENGTH> to{};
    const Status status = axle_ucp_encode(&message, to.memory.data(), to.memory.size(), &to.length);
    return {status, to};
}
inline Result<Packet> parse_packet(Bytes bytes) {
    return detail::get<Packet>(axle_ikeya_parse, bytes.data(), bytes.size());
}
/// The body of an unknown message stays in `bytes`.
inline Result<Message> parse_message(Bytes bytes) {
    return detail::get<Message>(axle_ucp_parse, bytes.data(), bytes.size());
}

/// An id and a mode, as DIP switches select them.
struct Selection {
    std::uint8_t node;
    axle_ikeya_mode mode;
};
inline Result<Selection> dip_switches(std::uint8_t switches, std::uint8_t reading) {
    Selection found{};
    const Status status = axle_ikeya_dip_switches(switches, reading, &found.node, &found.mode);
    return {status, found};
}

/// Settings, which begin with those of a kind of port.
template <class C, axle_result (*Direct)(C *), axle_result (*UsbAdapter)(C *)>
struct Config : C {
    static Config direct() { return made(Direct); }
    static Config usb_adapter() { return made(UsbAdapter); }

  private:
    static Config made(axle_result (*settings)(C *)) {
        Config config{};
        settings(&config);
        return config;
    }
};
using MasterConfig = Config<axle_ikeya_master_config, axle_ikeya_master_config_direct,
                            axle_ikeya_master_config_usb_adapter>;
using SlaveConfig = Config<axle_ikeya_slave_config, axle_ikeya_slave_config_direct,
                           axle_ikeya_slave_config_usb_adapter>;
using HostConfig = Config<axle_ucp_host_config, axle_ucp_host_config_direct,
                          axle_ucp_host_config_usb_adapter>;
using RobotConfig = Config<axle_ucp_robot_config, axle_ucp_robot_config_direct,
                           axle_ucp_robot_config_usb_adapter>;

namespace detail {

// The functions of a kind of object, under one name for all kinds.
#define AXLE_CALL(c, name) static constexpr auto name = ::c##_##name;
#define AXLE_DECODER(c)                                                                            \
    using Object = ::c;                                                                            \
    AXLE_CALL(c, decode) AXLE_CALL(c, decode_many) AXLE_CALL(c, push) AXLE_CALL(c, poll)           \
    AXLE_CALL(c, spare) AXLE_CALL(c, commit) AXLE_CALL(c, idle) AXLE_CALL(c, get_pending)          \
    AXLE_CALL(c, get_counters)
#define AXLE_ROLE(c, kind)                                                                         \
    using Object = ::c;                                                                            \
    using Event = ::kind##_event;                                                                  \
    using Statistics = ::kind##_statistics;                                                        \
    AXLE_CALL(c, init) AXLE_CALL(c, handle_input) AXLE_CALL(c, handle_old_input)                   \
    AXLE_CALL(c, handle_timeout) AXLE_CALL(c, poll_event) AXLE_CALL(c, poll_transmit)              \
    AXLE_CALL(c, handle_transmit) AXLE_CALL(c, is_outdated) AXLE_CALL(c, next_deadline)            \
    AXLE_CALL(c, get_line_rules) AXLE_CALL(c, get_statistics) AXLE_CALL(c, get_counters)
#define AXLE_MASTER(c)                                                                             \
    AXLE_ROLE(c, axle_ikeya_master)                                                                \
    AXLE_CALL(c, discover) AXLE_CALL(c, stop) AXLE_CALL(c, stop_all) AXLE_CALL(c, read)            \
    AXLE_CALL(c, confirm) AXLE_CALL(c, keep_alive) AXLE_CALL(c, release) AXLE_CALL(c, get_node)    \
    AXLE_CALL(c, get_bus) AXLE_CALL(c, get_node_statistics)                                        \
    AXLE_CALL(c, check) AXLE_CALL(c, set_velocity) AXLE_CALL(c, set_position)
#define AXLE_SLAVE(c)                                                                              \
    AXLE_ROLE(c, axle_ikeya_slave)                                                                 \
    AXLE_CALL(c, get_command) AXLE_CALL(c, get_mode) AXLE_CALL(c, set_mode)                        \
    AXLE_CALL(c, set_velocity) AXLE_CALL(c, set_position)
struct IkeyaDecoderCalls { AXLE_DECODER(axle_ikeya_decoder) };
struct UcpDecoderCalls { AXLE_DECODER(axle_ucp_decoder) };
struct MasterCalls { AXLE_MASTER(axle_ikeya_master) };
struct Master3Calls { AXLE_MASTER(axle_ikeya3_master) };
struct SlaveCalls { AXLE_SLAVE(axle_ikeya_slave) };
struct Slave3Calls { AXLE_SLAVE(axle_ikeya3_slave) };
struct HostCalls { AXLE_ROLE(axle_ucp_host, axle_ucp_host) };
struct RobotCalls { AXLE_ROLE(axle_ucp_robot, axle_ucp_robot) };
#undef AXLE_SLAVE
#undef AXLE_MASTER
#undef AXLE_ROLE
#undef AXLE_DECODER
#undef AXLE_CALL

/// The memory of an object, which stays where it is: a copy would send what it sends, too.
template <class Object>
class Memory {
  public:
    Memory(const Memory &) = delete;
    Memory &operator=(const Memory &) = delete;
    /// Whether it could be made. If not, its calls fail, and its optional values are absent.
    Status made() const { return made_; }
    /// For the C functions.
    Object *object() { return &object_; }
    const Object *object() const { return &object_; }

  protected:
    template <class F, class... A>
    explicit Memory(F init, const A &...arguments)
        : made_{call(init, &object_, sizeof(Object), arguments...)} {}
    ~Memory() = default;

  private:
    Object object_{};
    Status made_;
};

template <class C>
class Decoder : public Memory<typename C::Object> {
  public:
    using Memory<typename C::Object>::Memory, Memory<typename C::Object>::object;

    /// Removes what is used from the front of `bytes`.
    std::optional<axle_stream_event> decode(Bytes &bytes) {
        const std::uint8_t *data = bytes.data();
        std::size_t size = bytes.size();
        auto event = maybe<axle_stream_event>(C::decode, object(), &data, &size);
        bytes = {data, size};
        return event;
    }
    /// The same of up to N events; returns their number, and 0 once all bytes are used up.
    template <std::size_t N>
    std::size_t decode(Bytes &bytes, std::array<axle_stream_event, N> &events) {
        const std::uint8_t *data = bytes.data();
        std::size_t size = bytes.size();
        const auto count = get<std::size_t>(C::decode_many, object(), &data, &size, events.data(), N);
        bytes = {data, size};
        return count.value_or(0);
    }
    Status push(std::uint8_t byte) { return call(C::push, object(), byte); }
    std::optional<axle_stream_event> poll() { return maybe<axle_stream_event>(C::poll, object()); }
    /// Sets `bytes` to the spare space, and returns its length.
    std::size_t spare(std::uint8_t *&bytes) {
        return get<std::size_t>(C::spare, object(), &bytes).value_or(0);
    }
    Status commit(std::size_t length) { return call(C::commit, object(), length); }
    Status idle() { return call(C::idle, object()); }
    Result<std::size_t> pending() const { return get<std::size_t>(C::get_pending, object()); }
    Result<axle_counters> counters() const { return get<axle_counters>(C::get_counters, object()); }
};

template <class C>
class Role : public Memory<typename C::Object> {
  public:
    using Memory<typename C::Object>::object;
    using Event = typename C::Event;
    using Statistics = typename C::Statistics;

    Status handle_input(Bytes bytes, Time now) {
        return call(C::handle_input, object(), bytes.data(), bytes.size(), now);
    }
    Status handle_old_input(Bytes bytes, Time since, Time now) {
        return call(C::handle_old_input, object(), bytes.data(), bytes.size(), since, now);
    }
    Status handle_timeout(Time now) { return call(C::handle_timeout, object(), now); }
    std::optional<Event> poll_event() { return maybe<Event>(C::poll_event, object()); }
    std::optional<Bytes> poll_transmit(Time now) {
        const std::uint8_t *data = nullptr;
        const auto size = maybe<std::size_t>(C::poll_transmit, object(), now, &data);
        return size ? std::optional<Bytes>{{data, *size}} : std::nullopt;
    }
    Status handle_transmit(axle_transmit outcome, Time now) {
        return call(C::handle_transmit, object(), outcome, now);
    }
    bool is_outdated() const { return C::is_outdated(object()) == AXLE_OK; }
    std::optional<Time> next_deadline() const {
        const auto at = maybe<std::uint64_t>(C::next_deadline, object());
        return at ? std::optional<Time>{time(*at)} : std::nullopt;
    }
    Result<axle_line_rules> line_rules() const {
        return get<axle_line_rules>(C::get_line_rules, object());
    }
    Result<Statistics> statistics() const { return get<Statistics>(C::get_statistics, object()); }
    Result<axle_counters> counters() const { return get<axle_counters>(C::get_counters, object()); }

  protected:
    template <class... A>
    explicit Role(const A &...arguments) : Memory<typename C::Object>(C::init, arguments...) {}
};

// What a board with one motor takes, and one with three.
template <class T, std::size_t N>
using Motors = std::conditional_t<N == 1, T, std::array<T, N>>;

template <class C, std::size_t N>
class Master : public Role<C> {
  public:
    using Role<C>::object;
    using Velocity = Motors<float, N>;
    using Place = Motors<axle::Position, N>;

    Master(const axle_ikeya_master_config &config, Time now) : Role<C>(&config, now) {}
    Status discover(Time now) { return call(C::discover, object(), now); }
    /// Turns per second.
    [[nodiscard]] Status set_velocity(std::uint8_t node, Velocity rps, Time now) {
        return call(C::set_velocity, object(), node, rps, now);
    }
    [[nodiscard]] Status set_position(std::uint8_t node, Place at, Time now) {
        return call(C::set_position, object(), node, at, now);
    }
    [[nodiscard]] Status stop(std::uint8_t node, Time now) {
        return call(C::stop, object(), node, now);
    }
    Status stop_all(Time now) { return call(C::stop_all, object(), now); }
    Status check(std::uint8_t node, const Motion &motion) const {
        return call(C::check, object(), node, &motion);
    }
    [[nodiscard]] Status read(std::uint8_t node, Time now) {
        return call(C::read, object(), node, now);
    }
    [[nodiscard]] Status confirm(std::uint8_t node, Time now) {
        return call(C::confirm, object(), node, now);
    }
    Status keep_alive(Time now) { return call(C::keep_alive, object(), now); }
    Status release(std::uint8_t node) { return call(C::release, object(), node); }
    Result<Node> node(std::uint8_t node) const { return get<Node>(C::get_node, object(), node); }
    Result<Bus> bus() const { return get<Bus>(C::get_bus, object()); }
    Result<axle_ikeya_node_statistics> node_statistics(std::uint8_t node) const {
        return get<axle_ikeya_node_statistics>(C::get_node_statistics, object(), node);
    }
};

template <class C, std::size_t N>
class Slave : public Role<C> {
  public:
    using Role<C>::object;

    Slave(std::uint8_t node, axle_ikeya_mode mode, const axle_ikeya_slave_config &config, Time now)
        : Role<C>(node, mode, &config, now) {}
    /// Absent: the motor must be at rest.
    std::optional<Motion> command(Time now) const {
        return maybe<Motion>(C::get_command, object(), now);
    }
    Result<axle_ikeya_mode> mode() const { return get<axle_ikeya_mode>(C::get_mode, object()); }
    Status set_mode(axle_ikeya_mode mode) { return call(C::set_mode, object(), mode); }
    /// As measured, turns per second.
    Status set_velocity(Motors<float, N> rps) { return call(C::set_velocity, object(), rps); }
    Status set_position(Motors<Position, N> at) { return call(C::set_position, object(), at); }
};

class IkeyaDecoder : public Decoder<IkeyaDecoderCalls> {
  public:
    /// One of AXLE_IKEYA_TO_SLAVE and its neighbours.
    explicit IkeyaDecoder(std::uint8_t framing) : Decoder(axle_ikeya_decoder_init, framing) {}
};

class UcpDecoder : public Decoder<UcpDecoderCalls> {
  public:
    UcpDecoder() : Decoder(axle_ucp_decoder_init) {}
};

class Host : public Role<HostCalls> {
  public:
    Host(const axle_ucp_host_config &config, Time now) : Role(&config, now) {}
    /// Percent, both.
    [[nodiscard]] Status set_speed(std::int16_t speed, std::int16_t turn, Time now) {
        return call(axle_ucp_host_set_speed, object(), speed, turn, now);
    }
    [[nodiscard]] Status drive(Motor command, Time now) {
        return call(axle_ucp_host_drive, object(), command, now);
    }
    Status stop(Time now) { return call(axle_ucp_host_stop, object(), now); }
    [[nodiscard]] Status start_calibration(axle_ucp_calibration kind, Time now) {
        return call(axle_ucp_host_start_calibration, object(), kind, now);
    }
    [[nodiscard]] Status end_calibration(axle_ucp_calibration kind, Time now) {
        return call(axle_ucp_host_end_calibration, object(), kind, now);
    }
    [[nodiscard]] Status set_network_state(axle_ucp_network_state state, Time now) {
        return call(axle_ucp_host_set_network_state, object(), state, now);
    }
    [[nodiscard]] Status start_firmware_update(std::int16_t version, Time now) {
        return call(axle_ucp_host_start_firmware_update, object(), version, now);
    }
    Status end_firmware_update(Time now) {
        return call(axle_ucp_host_end_firmware_update, object(), now);
    }
    Result<RobotState> robot_state() const {
        return get<RobotState>(axle_ucp_host_get_robot_state, object());
    }
    std::optional<Report> take_report() {
        return maybe<Report>(axle_ucp_host_take_report, object());
    }
    std::optional<Report> report() const {
        return maybe<Report>(axle_ucp_host_get_report, object());
    }
    std::optional<Time> take_round_trip() {
        const auto us = maybe<std::uint32_t>(axle_ucp_host_take_round_trip, object());
        return us ? std::optional<Time>{Time{*us}} : std::nullopt;
    }
    /// What the host keeps, for a program that stores it: of a calibration, or from `set_bias`.
    std::optional<ImuBias> imu_bias() const {
        return maybe<ImuBias>(axle_ucp_host_get_imu_bias, object());
    }
    std::optional<MagBias> mag_bias() const {
        return maybe<MagBias>(axle_ucp_host_get_mag_bias, object());
    }
    Status set_bias(ImuBias bias) { return call(axle_ucp_host_set_imu_bias, object(), bias); }
    Status set_bias(MagBias bias) { return call(axle_ucp_host_set_mag_bias, object(), bias); }
};

class Robot : public Role<RobotCalls> {
  public:
    Robot(const axle_ucp_robot_config &config, Time now) : Role(&config, now) {}
    /// The command in force; zeros, which is a stop, if there is none.
    Motor command(Time now) const { return *get<Motor>(axle_ucp_robot_get_command, object(), now); }
    std::optional<Motor> take_command(Time now) {
        return maybe<Motor>(axle_ucp_robot_take_command, object(), now);
    }
    Status set_telemetry(const Telemetry &telemetry, Time now) {
        return call(axle_ucp_robot_set_telemetry, object(), &telemetry, now);
    }
    Status calibration_result(ImuBias bias, Time now) {
        return call(axle_ucp_robot_calibration_result_imu, object(), bias, now);
    }
    Status calibration_result(MagBias bias, Time now) {
        return call(axle_ucp_robot_calibration_result_mag, object(), bias, now);
    }
    Status answer_update(axle_ucp_ota_status status, Time now) {
        return call(axle_ucp_robot_answer_update, object(), status, now);
    }
    std::optional<axle_ucp_calibration> calibration() const {
        return maybe<axle_ucp_calibration>(axle_ucp_robot_get_calibration, object());
    }
    std::optional<axle_ucp_network_state> network_state() const {
        return maybe<axle_ucp_network_state>(axle_ucp_robot_get_network_state, object());
    }
    std::optional<axle_ucp_calibration> abort_calibration() {
        return maybe<axle_ucp_calibration>(axle_ucp_robot_abort_calibration, object());
    }
};

} // namespace detail

using Master = detail::Master<detail::MasterCalls, 1>;
using Master3 = detail::Master<detail::Master3Calls, 3>;
using Slave = detail::Slave<detail::SlaveCalls, 1>;
using Slave3 = detail::Slave<detail::Slave3Calls, 3>;
using detail::Host;
using detail::IkeyaDecoder;
using detail::Robot;
using detail::UcpDecoder;

} // namespace axle

#endif
