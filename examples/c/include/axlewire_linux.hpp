// A motor bus and a rover on a serial port of Linux: axle::SerialBus and axle::SerialRover.
#ifndef AXLEWIRE_LINUX_HPP
#define AXLEWIRE_LINUX_HPP

#include <algorithm>
#include <cerrno>
#include <ctime>
#include <system_error>

#include <fcntl.h>
#include <poll.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <termios.h>
#include <unistd.h>

#include "axlewire.hpp"

namespace axle {
namespace detail {

/// This long after that, or at the end of time.
inline Time after(Time begin, Time span) {
    return span > Time::max() - begin ? Time::max() : begin + span;
}

inline std::error_code failure(int number) { return {number, std::generic_category()}; }

inline Time steady_now() {
    return std::chrono::duration_cast<Time>(std::chrono::steady_clock::now().time_since_epoch());
}

/// Linux numbers the devices of pseudo-terminals from 136 to 143.
inline bool is_pseudo_terminal(const char *path) {
    struct stat found {};
    if (::stat(path, &found) != 0) return false;
    const auto major_number = found.st_rdev >> 8 & 0xFFF;
    return major_number >= 136 && major_number <= 143;
}

class SerialPort {
  public:
    SerialPort(const char *path, std::uint32_t baud) {
        error_ = open(path, baud);
        if (error_) close();
    }
    ~SerialPort() { close(); }
    SerialPort(const SerialPort &) = delete;
    SerialPort &operator=(const SerialPort &) = delete;

    /// Why it could not be opened.
    std::error_code error() const { return error_; }

    /// Bytes that have come; 0 if there are none, negative if the port fails: then see `errno`.
    ssize_t read(std::uint8_t *to, std::size_t size) {
        ssize_t count;
        do count = ::read(file_, to, size);
        while (count < 0 && errno == EINTR);
        if (count < 0) return errno == EAGAIN ? 0 : -1;
        if (count == 0) errno = EIO; // the other end has hung up
        return count == 0 ? -1 : count;
    }

    ssize_t write(Bytes bytes) {
        ssize_t count;
        do count = ::write(file_, bytes.data(), bytes.size());
        while (count < 0 && errno == EINTR);
        return count;
    }

    /// Waits until all bytes have left. A port that keeps them for a second loses them: else an old
    /// command would leave some day.
    bool flush() {
        const Time end = steady_now() + std::chrono::seconds{1};
        int queued = 0;
        while (::ioctl(file_, TIOCOUTQ, &queued) == 0 && queued > 0) {
            if (steady_now() > end) {
                ::tcflush(file_, TCOFLUSH);
                return false;
            }
            nap();
        }
        // What is left is in the UART.
        while (::tcdrain(file_) != 0)
            if (errno != EINTR || steady_now() > end) return false;
        return true;
    }

    /// Waits for bytes, at most until `until`.
    void wait(Time until) {
        const auto left = std::max(until - steady_now(), Time{0}).count();
        const timespec span{static_cast<time_t>(left / 1'000'000),
                            static_cast<long>(left % 1'000'000 * 1000)};
        pollfd readable{file_, POLLIN, 0};
        ::ppoll(&readable, 1, &span, nullptr);
        if (readable.revents & ~POLLIN) nap(); // it has failed, and would not wait
    }

  private:
    int file_ = -1;
    std::error_code error_;

    static void nap() {
        const timespec span{0, 200'000};
        ::nanosleep(&span, nullptr);
    }

    void close() {
        if (file_ >= 0) ::close(file_);
        file_ = -1;
    }

    std::error_code open(const char *path, std::uint32_t baud) {
        file_ = ::open(path, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
        termios line{};
        if (file_ < 0 || ::tcgetattr(file_, &line) != 0) return failure(errno);
        // Two programs on one line would read each other's answers.
        if (::flock(file_, LOCK_EX | LOCK_NB) != 0) return failure(EBUSY);
        ::cfmakeraw(&line);
        line.c_iflag &= ~static_cast<tcflag_t>(IXOFF | IXANY | INPCK);
        line.c_cflag &= ~static_cast<tcflag_t>(CSTOPB | CRTSCTS);
        line.c_cflag |= CLOCAL | CREAD;
        if (speed_of(baud) == B0) return failure(EINVAL);
        ::cfsetspeed(&line, speed_of(baud));
        return ::tcsetattr(file_, TCSAFLUSH, &line) == 0 ? std::error_code{} : failure(errno);
    }

    static speed_t speed_of(std::uint32_t baud) {
        switch (baud) {
        case 9'600: return B9600;
        case 19'200: return B19200;
        case 38'400: return B38400;
        case 57'600: return B57600;
        case 115'200: return B115200;
        case 230'400: return B230400;
        case 460'800: return B460800;
        case 500'000: return B500000;
        case 921'600: return B921600;
        case 1'000'000: return B1000000;
        case 1'500'000: return B1500000;
        case 2'000'000: return B2000000;
        case 3'000'000: return B3000000;
        default: return B0;
        }
    }
};

/// A master or a host on a serial port. Slaves and robots must look at their port more often.
template <class Role>
class Serial {
  public:
    using Event = typename Role::Event;

    /// Why the port could not be opened, or EINVAL for bad settings. Then nothing is sent, and
    /// `serve` returns it.
    std::error_code error() const {
        return port_.error() || role_.made() ? port_.error() : failure(EINVAL);
    }
    Role &role() { return role_; }
    Time now() const { return steady_now(); }

    /// Takes in what has come, passes the events on, and sends what is due. It waits only for its
    /// bytes to leave. Call it often, or `run_for` instead.
    template <class F>
    std::error_code serve(F &&on_event) {
        std::error_code failed = error();
        if (failed) return failed;
        for (int frame = 0; frame < 8; ++frame) {
            const auto received = receive();
            if (!failed) failed = received;
            while (const auto event = role_.poll_event()) on_event(*event);
            const Time time = now();
            // Events have taken long: what has come meanwhile goes first.
            if (time - looked_at_ > std::chrono::milliseconds{10} && frame < 3) continue;
            // Even if nothing can be received: a stop must leave.
            const auto bytes = role_.poll_transmit(time);
            if (!bytes) break;
            const auto sent = send(*bytes);
            if (!failed) failed = sent;
            if (sent) break;
        }
        return failed;
    }

    /// Serves the line until `done`, but no longer than to `end`, a time of `now`, or until the port
    /// fails.
    template <class Done, class F>
    std::error_code run_until(Time end, Done &&done, F &&on_event) {
        for (;;) {
            if (const auto failed = serve(on_event)) return failed;
            if (done() || now() >= end) return {};
            port_.wait(std::min(end, role_.next_deadline().value_or(end)));
        }
    }

    /// Serves the line for so long, or until the port fails. Without `on_event`, events are dropped.
    template <class F>
    std::error_code run_for(Time span, F &&on_event) {
        return run_until(after(now(), span), [] { return false; }, on_event);
    }
    std::error_code run_for(Time span) {
        return run_for(span, [](const Event &) {});
    }

  protected:
    template <class Config>
    Serial(const char *path, const Config &config)
        : port_{path, config.baud}, role_{config, steady_now()} {}
    ~Serial() = default;

    /// The same as `run_until`, but goes on when the port fails. Drops events.
    template <class Done>
    void insist_until(Time end, Done &&done) {
        while (!error() && !done() && now() < end) {
            (void)run_until(end, done, [](const Event &) {});
            port_.wait(std::min(end, now() + std::chrono::milliseconds{1}));
        }
    }

  private:
    SerialPort port_;
    Role role_;
    Time looked_at_ = steady_now();
    /// When the port was last seen empty: all bytes have come since.
    Time empty_at_ = looked_at_;
    bool has_overtaken_ = false;

    std::error_code receive() {
        const std::uint32_t limit = role_.line_rules()->held_up_after_us;
        std::array<std::uint8_t, 256> memory;
        std::error_code failed;
        // A line is slower than so many reads. A port that always has more must not hold up a stop.
        for (int reads = 0; reads < 16; ++reads) {
            looked_at_ = now();
            const ssize_t count = port_.read(memory.data(), memory.size());
            if (count == 0) {
                empty_at_ = looked_at_;
                has_overtaken_ = false;
                role_.handle_timeout(empty_at_);
                return {};
            }
            if (count < 0) {
                failed = failure(errno);
                break;
            }
            const Bytes bytes{memory.data(), static_cast<std::size_t>(count)};
            const Time time = now();
            const bool is_old =
                limit == UINT32_MAX ? has_overtaken_ : time - empty_at_ > Time{limit};
            if (is_old) role_.handle_old_input(bytes, empty_at_, time);
            else role_.handle_input(bytes, time);
        }
        // More may wait in the port, from before what is sent now.
        has_overtaken_ = true;
        role_.handle_old_input({}, empty_at_, now());
        role_.handle_timeout(now());
        return failed;
    }

    std::error_code send(Bytes frame) {
        const ssize_t count = port_.write(frame);
        if (count == static_cast<ssize_t>(frame.size())) {
            role_.handle_transmit(AXLE_TRANSMIT_TAKEN, now());
            const bool left = port_.flush();
            role_.handle_transmit(left ? AXLE_TRANSMIT_FLUSHED : AXLE_TRANSMIT_UNFLUSHED, now());
            return left ? std::error_code{} : failure(ETIMEDOUT);
        }
        const int number = count < 0 ? errno : EAGAIN;
        role_.handle_transmit(count > 0 ? AXLE_TRANSMIT_CUT_OFF : AXLE_TRANSMIT_UNTOUCHED, now());
        return failure(number);
    }
};

/// On a pseudo-terminal, as of a simulated bus, bytes take no time.
inline axle_ikeya_master_config for_port(const char *path, axle_ikeya_master_config config) {
    if (config.baud == 0) config.baud = 500'000;
    if (is_pseudo_terminal(path)) config.accepts_early = 1;
    return config;
}

} // namespace detail

/// The master of a motor bus on a serial port. Its end stops each node that it has told to move,
/// unless it was released since: then it keeps its last command.
///
/// A program that is killed, as by Ctrl-C without a handler, stops nothing: catch the signal, or use
/// slaves with a watchdog.
template <class M>
class BasicSerialBus : public detail::Serial<M> {
  public:
    explicit BasicSerialBus(const char *path,
                            const axle_ikeya_master_config &config = MasterConfig::usb_adapter())
        : detail::Serial<M>(path, detail::for_port(path, config)), coast_{config.coast_us} {}

    /// It waits until the stops are confirmed, but no longer than `stop_bound_us`, and not for the
    /// motors to come to rest: call `stop` to know.
    ~BasicSerialBus() {
        for (std::uint8_t node = 1; node <= 8; ++node) {
            const auto known = master().node(node);
            if (known->set_point.mode != 0 && known->stop == AXLE_IKEYA_STOP_NOT_ASKED)
                (void)master().stop(node, this->now());
        }
        this->insist_until(this->now() + Time{master().bus()->stop_bound_us},
                           [&] { return master().bus()->stops_owed == 0; });
    }

    /// Asks all ids; `is_online` then tells which have answered: perhaps none. Fails if that takes
    /// longer than 30 s. Drops events.
    std::error_code discover() {
        master().discover(this->now());
        const Time end = this->now() + std::chrono::seconds{30};
        const auto is_over = [&] { return master().bus()->is_discovering == 0; };
        const auto failed = this->run_until(end, is_over, [](const typename M::Event &) {});
        return failed || is_over() ? failed : detail::failure(ETIMEDOUT);
    }

    bool is_online(std::uint8_t node) {
        return master().node(node)->health == AXLE_IKEYA_HEALTH_ONLINE;
    }

    /// Turns per second, from the next `serve` on.
    [[nodiscard]] Status set_velocity(std::uint8_t node, typename M::Velocity rps) {
        return master().set_velocity(node, rps, this->now());
    }
    [[nodiscard]] Status set_position(std::uint8_t node, typename M::Place at) {
        return master().set_position(node, at, this->now());
    }

    /// Stops a node. True once its motor is seen to stand still; if false, it may be moving.
    /// Drops events.
    [[nodiscard]] bool stop(std::uint8_t node) {
        if (!master().stop(node, this->now())) return false;
        const auto bus = master().bus();
        const auto stop = [&] { return master().node(node)->stop; };
        this->insist_until(
            this->now() + Time{bus->stop_bound_us} + coast_ + Time{bus->read_bound_us}, [&] {
                return stop() == AXLE_IKEYA_STOP_STANDING_STILL
                       || stop() == AXLE_IKEYA_STOP_STILL_MOVING;
            });
        return stop() == AXLE_IKEYA_STOP_STANDING_STILL;
    }

  private:
    Time coast_;

    M &master() { return this->role(); }
};
using SerialBus = BasicSerialBus<Master>;
using SerialBus3 = BasicSerialBus<Master3>;

/// The host of a rover on a serial port. Its end stops a rover that it has told to drive.
class SerialRover : public detail::Serial<Host> {
  public:
    explicit SerialRover(const char *path,
                         const axle_ucp_host_config &config = HostConfig::usb_adapter())
        : Serial(path, config) {}

    ~SerialRover() {
        if (!role().robot_state()->is_commanded) return;
        role().stop(now());
        insist_until(now() + std::chrono::milliseconds{100},
                     [&] { return role().robot_state()->is_stop_sent != 0; });
    }

    /// Percent. Counts for the time of the dead-man: call it again and again.
    [[nodiscard]] Status drive(std::int16_t speed, std::int16_t turn) {
        return role().set_speed(speed, turn, now());
    }

    /// Stops the rover. True once it is seen to stand still; if false, it may be moving.
    /// Drops events.
    [[nodiscard]] bool stop(Time within = std::chrono::seconds{3}) {
        role().stop(now());
        const auto is_still = [&] {
            return role().robot_state()->stop == AXLE_UCP_STOP_STANDING_STILL;
        };
        insist_until(detail::after(now(), within), is_still);
        return is_still();
    }
};

} // namespace axle

#endif
