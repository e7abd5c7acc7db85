// A disk that fails on demand, for LD_PRELOAD: calls on files whose name has "palpate.db" in it fail as the file named
// by PALPATE_FAULTS says, in one line of an operation (read, write, sync) and an error number.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <unistd.h>

// The error that the operation on this file is to fail with; 0 for none.
static int fault(int fd, const char *operation) {
    const char *control = getenv("PALPATE_FAULTS");
    if (control == NULL) return 0;
    char link[32], name[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t length = readlink(link, name, sizeof name - 1);
    if (length < 0) return 0;
    name[length] = 0;
    if (strstr(name, "palpate.db") == NULL) return 0;
    // The calls of the system itself: those of the library are the ones below.
    long opened = syscall(SYS_openat, AT_FDCWD, control, O_RDONLY | O_CLOEXEC);
    if (opened < 0) return 0;
    char line[64] = {0}, wanted[16] = {0};
    syscall(SYS_read, opened, line, sizeof line - 1);
    syscall(SYS_close, opened);
    int error = 0;
    if (sscanf(line, "%15s %d", wanted, &error) != 2 || strcmp(wanted, operation) != 0) return 0;
    return error;
}

#define FAIL_IF(operation)                  \
    do {                                    \
        int error = fault(fd, operation);   \
        if (error != 0) {                   \
            errno = error;                  \
            return -1;                      \
        }                                   \
    } while (0)

#define REAL(name, type) ((type)dlsym(RTLD_NEXT, #name))

typedef ssize_t (*reader)(int, void *, size_t);
typedef ssize_t (*writer)(int, const void *, size_t);
typedef ssize_t (*reader_at)(int, void *, size_t, off_t);
typedef ssize_t (*writer_at)(int, const void *, size_t, off_t);
typedef int (*syncer)(int);

ssize_t read(int fd, void *to, size_t count) {
    FAIL_IF("read");
    return REAL(read, reader)(fd, to, count);
}

ssize_t pread(int fd, void *to, size_t count, off_t at) {
    FAIL_IF("read");
    return REAL(pread, reader_at)(fd, to, count, at);
}

ssize_t pread64(int fd, void *to, size_t count, off_t at) {
    FAIL_IF("read");
    return REAL(pread64, reader_at)(fd, to, count, at);
}

ssize_t write(int fd, const void *from, size_t count) {
    FAIL_IF("write");
    return REAL(write, writer)(fd, from, count);
}

ssize_t pwrite(int fd, const void *from, size_t count, off_t at) {
    FAIL_IF("write");
    return REAL(pwrite, writer_at)(fd, from, count, at);
}

ssize_t pwrite64(int fd, const void *from, size_t count, off_t at) {
    FAIL_IF("write");
    return REAL(pwrite64, writer_at)(fd, from, count, at);
}

int fsync(int fd) {
    FAIL_IF("sync");
    return REAL(fsync, syncer)(fd);
}

int fdatasync(int fd) {
    FAIL_IF("sync");
    return REAL(fdatasync, syncer)(fd);
}
