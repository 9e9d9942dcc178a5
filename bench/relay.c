/* The least that a relay can do: WebSocket in, robot's line out. One client, one robot, no checks.
 *
 * relay PORT ROBOT_PORT: listens on 127.0.0.1:PORT (0: any; printed), connects to the robot, takes
 * masked text frames of at most 125 + 64 KiB bytes and writes "M NUMBER\n" for each "t":NUMBER.
 */
#include <arpa/inet.h>
#include <netinet/tcp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static unsigned char buffer[1 << 17];

static int dial(int port) {
    struct sockaddr_in place = {.sin_family = AF_INET, .sin_port = htons(port)};
    int one = 1, line = socket(AF_INET, SOCK_STREAM, 0);
    inet_pton(AF_INET, "127.0.0.1", &place.sin_addr);
    if (connect(line, (struct sockaddr *)&place, sizeof place)) exit(1);
    setsockopt(line, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
    return line;
}

static void forward(int robot, char *text) {
    char out[64], *found = strstr(text, "\"value\":");
    if (!found) return;
    int size = snprintf(out, sizeof out, "M %lld\n", atoll(found + 8));
    if (write(robot, out, size) != size) exit(1);
}

static size_t frames(int robot, size_t have) {
    size_t at = 0;
    while (have - at >= 6) {
        size_t size = buffer[at + 1] & 0x7f, head = 2;
        if (size == 126) size = buffer[at + 2] << 8 | buffer[at + 3], head = 4;
        if (have - at < head + 4 + size) break;
        unsigned char *mask = buffer + at + head, *body = mask + 4;
        for (size_t i = 0; i < size; i++) body[i] ^= mask[i & 3];
        unsigned char kept = body[size];
        body[size] = 0;
        forward(robot, (char *)body);
        body[size] = kept;
        at += head + 4 + size;
    }
    memmove(buffer, buffer + at, have - at);
    return have - at;
}

int main(int count, char **words) {
    struct sockaddr_in place = {.sin_family = AF_INET};
    socklen_t length = sizeof place;
    int one = 1, door = socket(AF_INET, SOCK_STREAM, 0);
    if (count != 3) return 2;
    place.sin_port = htons(atoi(words[1]));
    inet_pton(AF_INET, "127.0.0.1", &place.sin_addr);
    if (bind(door, (struct sockaddr *)&place, sizeof place) || listen(door, 1)) return 1;
    getsockname(door, (struct sockaddr *)&place, &length);
    printf("ready %d\n", ntohs(place.sin_port));
    fflush(stdout);
    int robot = dial(atoi(words[2])), page = accept(door, 0, 0);
    setsockopt(page, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
    ssize_t got = read(page, buffer, sizeof buffer - 1);
    static const char answer[] = "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\n"
                                 "Connection: Upgrade\r\n\r\n";
    if (got <= 0 || write(page, answer, sizeof answer - 1) < 0) return 1;
    for (size_t have = 0; (got = read(page, buffer + have, sizeof buffer - 1 - have)) > 0;)
        have = frames(robot, have + got);
    return 0;
}
