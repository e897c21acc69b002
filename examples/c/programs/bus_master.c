/* Turns a motor for two seconds: bus_master PORT NODE RPS
 * Returns 0 only if it is then seen to stand still. Ctrl-C would leave it turning. */
#define _DEFAULT_SOURCE
#include <axlewire.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>
#define SECOND 1000000u /* times are microseconds */
static axle_ikeya_master master; static int port;

static uint64_t now_us(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * SECOND + (uint64_t)now.tv_nsec / 1000;
}
static int open_port(const char *path) {
    struct termios line;
    port = open(path, O_RDWR | O_NOCTTY | O_NONBLOCK); /* a read must never wait */
    if (port < 0 || tcgetattr(port, &line)) return -1;
    cfmakeraw(&line), cfsetspeed(&line, B500000);
    line.c_cflag = (line.c_cflag & ~(tcflag_t)(CSTOPB | CRTSCTS)) | CLOCAL | CREAD;
    return tcsetattr(port, TCSAFLUSH, &line);
}
/* Serves the bus: 1 with its next event, 0 if there is none in time, -1 if the port has gone. */
static int next_event(axle_ikeya_master_event *event, uint64_t until) {
    for (;;) {
        uint8_t bytes[256];
        const uint8_t *frame;
        size_t length; ssize_t count;
        uint64_t empty_at, now, due = until;
        /* All that has come goes in before anything is sent: else an answer would look stale. */
        while (empty_at = now_us(), (count = read(port, bytes, sizeof bytes)) > 0)
            axle_ikeya_master_handle_input(&master, bytes, (size_t)count, now_us());
        if (count == 0 || errno != EAGAIN) return -1;
        axle_ikeya_master_handle_timeout(&master, empty_at);
        if (axle_ikeya_master_poll_event(&master, event) == AXLE_OK) return 1;
        now = now_us();
        if (axle_ikeya_master_poll_transmit(&master, now, &frame, &length) == AXLE_OK
            && write(port, frame, length) != (ssize_t)length)
            axle_ikeya_master_handle_transmit(&master, AXLE_TRANSMIT_CUT_OFF, now_us());
        if (now >= until) return 0;
        axle_ikeya_master_next_deadline(&master, &due);
        due = due < now ? 0 : (due < until ? due : until) - now;
        poll(&(struct pollfd){port, POLLIN, 0}, 1, (int)(due / 1000) + 1);
    }
}
int main(int argc, char **argv) {
    axle_ikeya_master_config config;
    axle_ikeya_master_event event = {0}; axle_ikeya_node known = {0};
    const uint8_t node = argc == 4 ? (uint8_t)(argv[2][0] - '0') : 0;
    char *rest = "?";
    const float rps = argc == 4 ? strtof(argv[3], &rest) : 0;
    if (*rest || argv[2][1]) return puts("bus_master PORT NODE RPS"), 1;
    if (open_port(argv[1])) return perror(argv[1]), 1;
    axle_ikeya_master_config_usb_adapter(&config);
    config.polling = AXLE_IKEYA_POLLING_EVERY, config.polling_period_us = SECOND / 10;
    const char *name = ttyname(port); /* on a pseudo-terminal, /dev/pts/, bytes take no time */
    config.accepts_early = name && name[5] == 'p';
    axle_ikeya_master_init(&master, sizeof master, &config, now_us());
    axle_ikeya_master_discover(&master, now_us());
    uint64_t end = now_us() + 5 * SECOND;
    while (event.kind != AXLE_IKEYA_MASTER_DISCOVERY_DONE && next_event(&event, end) == 1)
        if (event.kind == AXLE_IKEYA_MASTER_DISCOVERED) printf("found node %u\n", event.node);
    axle_result r = axle_ikeya_master_set_velocity(&master, node, rps, now_us());
    if (r) return fprintf(stderr, "node %u: %s\n", node, axle_result_text(r)), 1;
    for (end = now_us() + 2 * SECOND; next_event(&event, end) == 1;)
        if (event.kind == AXLE_IKEYA_MASTER_STATUS && event.node == node)
            printf("node %u: %.2f turns/s\n", node, (double)event.motion.velocity_rps[0]);
    axle_ikeya_master_stop(&master, node, now_us());
    end = now_us() + 5 * SECOND;
    while (known.stop != AXLE_IKEYA_STOP_STANDING_STILL && next_event(&event, end) == 1)
        axle_ikeya_master_get_node(&master, node, &known);
    if (known.stop != AXLE_IKEYA_STOP_STANDING_STILL) printf("node %u may be moving\n", node);
    return known.stop != AXLE_IKEYA_STOP_STANDING_STILL;
}
