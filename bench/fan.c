/* The least that a frame to many pages can cost: takes CLIENTS connections, answers each with a 101,
   and writes SIZE bytes to each, FRAMES times, RATE a second. Prints its port, and at the end the
   seconds of processor time of the loop.   fan CLIENTS SIZE FRAMES RATE */
#include <arpa/inet.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

static double spent(void) {
  struct rusage used;
  getrusage(RUSAGE_SELF, &used);
  return used.ru_utime.tv_sec + used.ru_stime.tv_sec +
         (used.ru_utime.tv_usec + used.ru_stime.tv_usec) / 1e6;
}

int main(int count, char **words) {
  if (count != 5) return 2;
  int clients = atoi(words[1]), size = atoi(words[2]), frames = atoi(words[3]);
  struct timespec pause = {0, 1000000000L / atoi(words[4])};
  int lines[256];
  static unsigned char frame[65536];
  if (clients > 256 || size < 4 || size > 65535) return 2;
  frame[0] = 0x81;
  frame[1] = 126;
  frame[2] = (size - 4) >> 8;
  frame[3] = (size - 4) & 255;
  memset(frame + 4, 'x', size - 4);
  struct sockaddr_in here = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
  socklen_t length = sizeof here;
  int door = socket(AF_INET, SOCK_STREAM, 0);
  if (bind(door, (struct sockaddr *)&here, sizeof here) || listen(door, 256)) return 1;
  getsockname(door, (struct sockaddr *)&here, &length);
  printf("%d\n", ntohs(here.sin_port));
  fflush(stdout);
  for (int each = 0; each < clients; each++) {
    char asked[4096];
    const char *said = "HTTP/1.1 101 Switching Protocols\r\n\r\n";
    lines[each] = accept(door, 0, 0);
    if (read(lines[each], asked, sizeof asked) <= 0) return 1;
    if (write(lines[each], said, strlen(said)) < 0) return 1;
  }
  double began = spent();
  for (int number = 0; number < frames; number++) {
    for (int each = 0; each < clients; each++)
      if (write(lines[each], frame, size) != size) return 1;
    nanosleep(&pause, 0);
  }
  printf("%.6f\n", spent() - began);
  return 0;
}
