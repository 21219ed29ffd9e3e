/* The firmware as a process: the host on a pseudo terminal or a TCP port, the plant on a second TCP port.
 *
 *     swingid-native (--pty | --tcp PORT) --plant PORT [--live] [--rate HZ] [--counts AXIS WHEEL] [--limit V]
 *                    [--firmware HASH]
 *
 * Port 0 is any free one. Two lines of standard output say where: "link ADDRESS", "plant PORT". The plant sets the
 * pace, as fast as it can or in real time. Per sample it sends 24 bytes: time (u32, us), axis, wheel (i32), current
 * (f32), valid (u32), and how many bytes the host has sent so far (u32), which are waited for as far as the sample
 * takes them, so that a run can be repeated byte by byte: the plant waits meanwhile, so no device time passes. With
 * --live nothing is waited for, also not for a host at the start. The answer has 8 bytes: the voltage (f32) and how
 * many bytes have gone to the host (u32). The process ends with the plant's connection.
 */
#define _DEFAULT_SOURCE
#define _XOPEN_SOURCE 600
#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include "hal.h"

#define TOLD 24
#define ANSWER 8
#define WAITING 16384 /* bytes of a host that the link holds, as the system counts them; one that sends more waits */

static int listener = -1, link_fd = -1, plant_fd = -1;
static uint32_t wanted, received, passed_on;
static uint8_t told[TOLD];
static float applied;
static int fresh, answered = 1, over, live;

static void fail(const char *what) {
    fprintf(stderr, "swingid-native: %s: %s\n", what, strerror(errno));
    exit(1);
}

static uint32_t u32_at(const uint8_t *p) {
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

static float f32_at(const uint8_t *p) {
    const uint32_t bits = u32_at(p);
    float x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

static void put_u32(uint8_t *p, uint32_t x) {
    for (int i = 0; i < 4; i++) p[i] = (uint8_t)(x >> 8 * i);
}

/* A listening socket for this machine alone; its port. */
static int listen_on(int port, int *actual) {
    struct sockaddr_in address;
    socklen_t size = sizeof address;
    const int fd = socket(AF_INET, SOCK_STREAM, 0), yes = 1, waiting = WAITING;
    if (fd < 0) fail("socket");
    memset(&address, 0, sizeof address);
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons((uint16_t)port);
    setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &waiting, sizeof waiting); /* each connection has it from here */
    if (bind(fd, (struct sockaddr *)&address, sizeof address) < 0 || listen(fd, 1) < 0) fail("listen");
    if (getsockname(fd, (struct sockaddr *)&address, &size) < 0) fail("getsockname");
    *actual = ntohs(address.sin_port);
    return fd;
}

/* The next connection; -1 where there is none. */
static int accept_on(int fd) {
    const int yes = 1, found = accept(fd, NULL, NULL);
    if (found >= 0) setsockopt(found, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
    return found;
}

static void open_pty(void) {
    struct termios settings;
    const int master = posix_openpt(O_RDWR | O_NOCTTY);
    int slave;
    if (master < 0 || grantpt(master) < 0 || unlockpt(master) < 0) fail("pty");
    slave = open(ptsname(master), O_RDWR | O_NOCTTY); /* stays open, so that a host may leave and come back */
    if (slave < 0 || tcgetattr(slave, &settings) < 0) fail("pty");
    cfmakeraw(&settings);
    if (tcsetattr(slave, TCSANOW, &settings) < 0) fail("pty");
    printf("link %s\n", ptsname(master));
    link_fd = master;
}

static void connect_link(void) {
    if (link_fd < 0) link_fd = accept_on(listener);
    if (link_fd >= 0) fcntl(link_fd, F_SETFL, fcntl(link_fd, F_GETFL) | O_NONBLOCK);
}

/* A host that has gone makes room for the next; while one is there, another waits. */
static void look_for_host(void) {
    struct pollfd asked = {listener, POLLIN, 0};
    char one;
    if (listener < 0) return;
    if (link_fd >= 0 && recv(link_fd, &one, 1, MSG_PEEK | MSG_DONTWAIT) == 0) {
        close(link_fd);
        link_fd = -1;
    }
    if (link_fd < 0 && poll(&asked, 1, 0) > 0) connect_link();
}

/* One exchange with the plant: the answer of the last sample, and the readings of the next. */
static void exchange(void) {
    uint8_t answer[ANSWER];
    size_t size = 0;
    uint32_t bits;
    if (!answered) {
        memcpy(&bits, &applied, sizeof bits);
        put_u32(answer, bits);
        put_u32(answer + 4, passed_on);
        if (write(plant_fd, answer, ANSWER) != ANSWER) over = 1;
        answered = 1;
    }
    while (!over && size < TOLD) {
        const ssize_t count = read(plant_fd, told + size, TOLD - size);
        if (count <= 0 && !(count < 0 && errno == EINTR)) over = 1;
        if (count > 0) size += (size_t)count;
    }
    wanted = u32_at(told + 20);
    look_for_host();
}

int hal_receive(uint8_t *bytes, int room) {
    ssize_t count;
    if (!fresh) exchange();
    fresh = 1;
    if (live) {
        count = over || link_fd < 0 ? 0 : read(link_fd, bytes, (size_t)room);
        return count > 0 ? (int)count : 0; /* look_for_host finds a host that has gone */
    }
    if (over || received == wanted) return 0;
    connect_link();
    if (link_fd < 0) fail("accept");
    if ((uint32_t)room > wanted - received) room = (int)(wanted - received);
    do {
        struct pollfd wait = {link_fd, POLLIN, 0};
        poll(&wait, 1, -1);
        count = read(link_fd, bytes, (size_t)room);
    } while (count < 0 && (errno == EINTR || errno == EAGAIN));
    if (count <= 0) { /* unplugged: what was on the way is lost */
        received = wanted;
        if (listener >= 0) {
            close(link_fd);
            link_fd = -1;
        }
        return 0;
    }
    received += (uint32_t)count;
    return (int)count;
}

int hal_wait(void) {
    fresh = 0;
    return !over;
}

void hal_read(swingid_inputs *inputs) {
    inputs->time = u32_at(told);
    inputs->axis = (int32_t)u32_at(told + 4);
    inputs->wheel = (int32_t)u32_at(told + 8);
    inputs->current = f32_at(told + 12);
    inputs->valid = u32_at(told + 16) != 0;
}

void hal_apply(float voltage, int armed) {
    (void)armed;
    applied = voltage;
    answered = 0;
}

int hal_send(const uint8_t *bytes, int size) {
    struct pollfd may = {link_fd, POLLOUT, 0};
    ssize_t count;
    if (link_fd < 0) return size; /* nobody listens */
    if (poll(&may, 1, 0) <= 0 || !(may.revents & POLLOUT)) return 0;
    count = write(link_fd, bytes, (size_t)size);
    if (count > 0) passed_on += (uint32_t)count;
    return count > 0 ? (int)count : 0;
}

/* The number after an option; ends the process with a sentence where there is none. */
static double number(int count, char **arguments, int *i) {
    const char *option = arguments[*i];
    char *end;
    double x = -1.0;
    if (++*i < count) {
        x = strtod(arguments[*i], &end);
        if (end == arguments[*i] || *end != 0) x = -1.0;
    }
    if (!(x >= 0.0 && x < 4294967296.0)) {
        fprintf(stderr, "swingid-native: %s needs a number from 0 on\n", option);
        exit(2);
    }
    return x;
}

int main(int count, char **arguments) {
    swingid_config config = {1000.0f, 16384, 16384, 10.0f, 0, SWINGID_MOST_ORDER, 0};
    int pty = 0, tcp = -1, plant = -1, port;
    for (int i = 1; i < count; i++) {
        const char *option = arguments[i];
        if (strcmp(option, "--pty") == 0) {
            pty = 1;
        } else if (strcmp(option, "--live") == 0) {
            live = 1;
        } else if (strcmp(option, "--tcp") == 0) {
            tcp = (int)number(count, arguments, &i);
        } else if (strcmp(option, "--plant") == 0) {
            plant = (int)number(count, arguments, &i);
        } else if (strcmp(option, "--rate") == 0) {
            config.rate = (float)number(count, arguments, &i);
        } else if (strcmp(option, "--counts") == 0) {
            config.axis_counts = (uint32_t)number(count, arguments, &i);
            config.wheel_counts = (uint32_t)number(count, arguments, &i);
        } else if (strcmp(option, "--limit") == 0) {
            config.voltage_limit = (float)number(count, arguments, &i);
        } else if (strcmp(option, "--firmware") == 0) {
            config.firmware = (uint32_t)number(count, arguments, &i);
        } else {
            fprintf(stderr, "swingid-native: unknown option %s\n", option);
            return 2;
        }
    }
    if (pty == (tcp >= 0) || plant < 0 || tcp > 65535 || plant > 65535 || config.rate < 20.0f) {
        fprintf(stderr, "usage: swingid-native (--pty | --tcp PORT) --plant PORT [--live] "
                        "[--rate HZ, 20 or more] [--counts AXIS WHEEL] [--limit V] [--firmware HASH]\n");
        return 2;
    }
    signal(SIGPIPE, SIG_IGN);
    if (pty) {
        open_pty();
    } else {
        listener = listen_on(tcp, &port);
        printf("link 127.0.0.1:%d\n", port);
    }
    plant = listen_on(plant, &port);
    printf("plant %d\n", port);
    fflush(stdout);
    plant_fd = accept_on(plant);
    if (plant_fd < 0) fail("accept");
    if (live && listener >= 0) fcntl(listener, F_SETFL, O_NONBLOCK); /* a host may go before it is accepted */
    if (!live || pty) connect_link();
    swingid_loop(&config);
    return 0;
}
