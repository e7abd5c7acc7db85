// What a program does to its disk, for LD_PRELOAD: each write, cut, sync and removal of files whose name has
// "palpate.db" in it is appended to the file named by PALPATE_JOURNAL once it is done and before the program goes on.
// A record is a line "what name offset length", and for a write its bytes. The index of the log of changes (-shm) is
// left out: it does not outlive its process.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <sys/uio.h>

#include "named.h"

static int journal = -1;

__attribute__((constructor)) static void open_journal(void) {
    const char *path = getenv("PALPATE_JOURNAL");
    if (path != NULL) journal = (int)syscall(SYS_openat, AT_FDCWD, path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
    if (journal < 0) abort();
}

// One call of the system for each record, so that records of several threads do not mix.
static void record(const char *what, const char *path, long long offset, const void *bytes, size_t count) {
    const char *slash = strrchr(path, '/');
    const char *name = slash == NULL ? path : slash + 1;
    size_t length = strlen(name);
    if (length > 4 && strcmp(name + length - 4, "-shm") == 0) return;
    if (strchr(name, ' ') != NULL) return; // " (deleted)": nothing of it survives
    char head[512];
    int used = snprintf(head, sizeof head, "%s %s %lld %zu\n", what, name, offset, count);
    size_t following = bytes == NULL ? 0 : count;
    struct iovec parts[2] = {{head, (size_t)used}, {(void *)bytes, following}};
    if (syscall(SYS_writev, journal, parts, 2) != (long)((size_t)used + following)) abort();
}

static void record_open(const char *what, int fd, long long offset, const void *bytes, ssize_t count) {
    char path[4096];
    int before = errno;
    if (count >= 0 && is_ours(fd, path, sizeof path)) record(what, path, offset, bytes, (size_t)count);
    errno = before;
}

#define REAL(name, type) ((type)dlsym(RTLD_NEXT, #name))

typedef ssize_t (*writer)(int, const void *, size_t);
typedef ssize_t (*writer_at)(int, const void *, size_t, off_t);
typedef int (*cutter)(int, off_t);
typedef int (*syncer)(int);
typedef int (*remover)(const char *);

ssize_t write(int fd, const void *from, size_t count) {
    off_t at = lseek(fd, 0, SEEK_CUR);
    ssize_t written = REAL(write, writer)(fd, from, count);
    record_open("write", fd, at, from, written);
    return written;
}

ssize_t pwrite(int fd, const void *from, size_t count, off_t at) {
    ssize_t written = REAL(pwrite, writer_at)(fd, from, count, at);
    record_open("write", fd, at, from, written);
    return written;
}

ssize_t pwrite64(int fd, const void *from, size_t count, off_t at) {
    ssize_t written = REAL(pwrite64, writer_at)(fd, from, count, at);
    record_open("write", fd, at, from, written);
    return written;
}

int ftruncate(int fd, off_t length) {
    int failed = REAL(ftruncate, cutter)(fd, length);
    record_open("cut", fd, length, NULL, failed);
    return failed;
}

int ftruncate64(int fd, off_t length) {
    int failed = REAL(ftruncate64, cutter)(fd, length);
    record_open("cut", fd, length, NULL, failed);
    return failed;
}

int fsync(int fd) {
    int failed = REAL(fsync, syncer)(fd);
    record_open("sync", fd, 0, NULL, failed);
    return failed;
}

int fdatasync(int fd) {
    int failed = REAL(fdatasync, syncer)(fd);
    record_open("sync", fd, 0, NULL, failed);
    return failed;
}

int unlink(const char *path) {
    int failed = REAL(unlink, remover)(path);
    if (failed == 0 && strstr(path, "palpate.db") != NULL) record("gone", path, 0, NULL, 0);
    return failed;
}
