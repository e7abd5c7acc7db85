// A disk that fails, is slow or stands still on demand, for LD_PRELOAD: calls on files whose name has "palpate.db" in it do as the
// file named by PALPATE_FAULTS says, in lines of a fault (fail, slow, hold), an operation (read, write, sync) and a
// number: of an error, or of milliseconds that each call takes. A fourth word is an offset in the database itself:
// only the calls that touch this byte are meant then. What is held goes on when the file says otherwise; its number
// means nothing, and a file with the ending ".held" beside the first one is made.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <sys/syscall.h>
#include <sys/types.h>

#include "named.h"

// What the control file says; nothing where there is none. The calls of the system itself are used: those of the
// library are the ones below.
static void ordered(char *lines, size_t size) {
    lines[0] = 0;
    const char *control = getenv("PALPATE_FAULTS");
    if (control == NULL) return;
    long opened = syscall(SYS_openat, AT_FDCWD, control, O_RDONLY | O_CLOEXEC);
    if (opened < 0) return;
    long length = syscall(SYS_read, opened, lines, size - 1);
    syscall(SYS_close, opened);
    lines[length > 0 ? length : 0] = 0;
}

// Whether a call touches this byte of the database itself.
static int touches(const char *path, off_t at, size_t count, long long place) {
    const char *name = strrchr(path, '/');
    if (name == NULL || strcmp(name, "/palpate.db") != 0) return 0;
    return at <= place && place < at + (long long)count;
}

#define HELD (-1)

// Waits as long as the operation is to take, and gives the error that it is to fail with; 0 for none.
static int fault_now(const char *path, const char *operation, off_t at, size_t count) {
    char lines[256], kind[16], wanted[16];
    ordered(lines, sizeof lines);
    char *rest = NULL;
    int error = 0, number = 0;
    long long place = 0;
    for (char *line = strtok_r(lines, "\n", &rest); line != NULL; line = strtok_r(NULL, "\n", &rest)) {
        int words = sscanf(line, "%15s %15s %d %lld", kind, wanted, &number, &place);
        if (words < 3 || strcmp(wanted, operation) != 0) continue;
        if (words == 4 && !touches(path, at, count, place)) continue;
        if (strcmp(kind, "slow") == 0) usleep(1000 * (useconds_t)number);
        if (strcmp(kind, "fail") == 0) error = number;
        if (strcmp(kind, "hold") == 0) error = HELD;
    }
    return error;
}

// Tells that something is held.
static void tell(void) {
    char told[4096];
    snprintf(told, sizeof told, "%s.held", getenv("PALPATE_FAULTS"));
    long made = syscall(SYS_openat, AT_FDCWD, told, O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
    if (made >= 0) syscall(SYS_close, made);
}

// The same, and waits as long as it is held.
static int fault(int fd, const char *operation, off_t at, size_t count) {
    char path[4096];
    if (!is_ours(fd, path, sizeof path)) return 0;
    int error;
    while ((error = fault_now(path, operation, at, count)) == HELD) {
        tell();
        usleep(10 * 1000);
    }
    return error;
}

#define FAIL_IF(operation, at, count)                \
    do {                                             \
        int error = fault(fd, operation, at, count); \
        if (error != 0) {                            \
            errno = error;                           \
            return -1;                               \
        }                                            \
    } while (0)

#define REAL(name, type) ((type)dlsym(RTLD_NEXT, #name))

typedef ssize_t (*reader)(int, void *, size_t);
typedef ssize_t (*writer)(int, const void *, size_t);
typedef ssize_t (*reader_at)(int, void *, size_t, off_t);
typedef ssize_t (*writer_at)(int, const void *, size_t, off_t);
typedef int (*syncer)(int);

ssize_t read(int fd, void *to, size_t count) {
    FAIL_IF("read", lseek(fd, 0, SEEK_CUR), count);
    return REAL(read, reader)(fd, to, count);
}

ssize_t pread(int fd, void *to, size_t count, off_t at) {
    FAIL_IF("read", at, count);
    return REAL(pread, reader_at)(fd, to, count, at);
}

ssize_t pread64(int fd, void *to, size_t count, off_t at) {
    FAIL_IF("read", at, count);
    return REAL(pread64, reader_at)(fd, to, count, at);
}

ssize_t write(int fd, const void *from, size_t count) {
    FAIL_IF("write", lseek(fd, 0, SEEK_CUR), count);
    return REAL(write, writer)(fd, from, count);
}

ssize_t pwrite(int fd, const void *from, size_t count, off_t at) {
    FAIL_IF("write", at, count);
    return REAL(pwrite, writer_at)(fd, from, count, at);
}

ssize_t pwrite64(int fd, const void *from, size_t count, off_t at) {
    FAIL_IF("write", at, count);
    return REAL(pwrite64, writer_at)(fd, from, count, at);
}

int fsync(int fd) {
    FAIL_IF("sync", 0, 0);
    return REAL(fsync, syncer)(fd);
}

int fdatasync(int fd) {
    FAIL_IF("sync", 0, 0);
    return REAL(fdatasync, syncer)(fd);
}
