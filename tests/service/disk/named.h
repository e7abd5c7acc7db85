// Which of the server's files a call is about, for the libraries that stand between it and the system.
#include <stdio.h>
#include <string.h>
#include <unistd.h>

// The path of an open file whose name has "palpate.db" in it; 0 for any other one.
static int is_ours(int fd, char *path, size_t size) {
    char link[32];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t length = readlink(link, path, size - 1);
    if (length < 0) return 0;
    path[length] = 0;
    return strstr(path, "palpate.db") != NULL;
}
