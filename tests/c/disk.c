/* A disk that a test can look into: cc -shared -fPIC disk.c -o disk.so, then LD_PRELOAD=disk.so and
 *   DISK_ROOT      path; what is done to files below it counts, nothing else
 *   DISK_LOG       file that every change is written to, in order (below)
 *   DISK_FULL_AT   from the n-th call that needs room on (from 1), such calls fail with "no space left"; with
 *                  DISK_FULL_ONCE, only that one
 *   DISK_KILL_AT   before the n-th change (from 1) the process gets SIGKILL
 * A record of the log: op, number of the file, offset, lengths of two texts, the texts.
 *   O  file made or emptied (path) W bytes written (offset; bytes) T cut (offset = new length)
 *   S  file synchronised D folder synchronised (path)
 *   R  renamed (from, to) L given a second name (first, second) U removed (path)
 *   M  folder made (path) X folder removed (path) */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { FDS = 4096 };
static pthread_mutex_t turn = PTHREAD_MUTEX_INITIALIZER;
/* Number of the file behind a descriptor, 0: none of ours. A folder's is negative. */
static int files[FDS], next_file;
static char *folders[FDS];
static long changes, roomy;

static long number(const char *name) {
    const char *value = getenv(name);
    return value ? atol(value) : 0;
}

static int ours(const char *path) {
    const char *root = getenv("DISK_ROOT");
    size_t n = root ? strlen(root) : 0;
    return n && path && !strncmp(path, root, n) && (path[n] == '/' || !path[n]);
}

/* Several processes may write one log. */
__attribute__((constructor)) static void begin(void) { next_file = getpid() << 8; }

/* The real function of a name. */
#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

static void note(char op, int file, int64_t offset, const void *a, uint32_t na, const void *b, uint32_t nb) {
    static int log = -1;
    const char *path = getenv("DISK_LOG");
    if (!path) return;
    if (log < 0) log = REAL(open)(path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
    char head[21];
    head[0] = op;
    memcpy(head + 1, &file, 4), memcpy(head + 5, &offset, 8), memcpy(head + 13, &na, 4), memcpy(head + 17, &nb, 4);
    if (REAL(write)(log, head, sizeof head) < 0 || REAL(write)(log, a, na) < 0 || REAL(write)(log, b, nb) < 0) abort();
}

static void named(char op, int file, const char *a, const char *b) {
    note(op, file, 0, a, (uint32_t)strlen(a), b, b ? (uint32_t)strlen(b) : 0);
}

/* Counts a change; the process may end here. Returns whether there is no room for it. */
static int stopped(int needs_room) {
    if (++changes == number("DISK_KILL_AT")) raise(SIGKILL);
    if (!needs_room) return 0;
    long at = number("DISK_FULL_AT");
    ++roomy;
    if (!at || roomy < at || (roomy > at && getenv("DISK_FULL_ONCE"))) return 0;
    errno = ENOSPC;
    return 1;
}

static int opened(int fd, const char *path, int flags, int was_there) {
    if (fd < 0 || fd >= FDS) return fd;
    struct stat about;
    if (!fstat(fd, &about) && S_ISDIR(about.st_mode)) {
        files[fd] = -1;
        free(folders[fd]);
        folders[fd] = strdup(path);
    } else if (flags & (O_WRONLY | O_RDWR)) {
        /* One number for one file, however often it is opened. */
        static struct { ino_t inode; int file; } known[FDS];
        int i = 0;
        while (i < FDS - 1 && known[i].file && known[i].inode != about.st_ino) ++i;
        if (!known[i].file || !was_there) known[i].inode = about.st_ino, known[i].file = ++next_file;
        files[fd] = known[i].file;
        if (!was_there || flags & O_TRUNC) named('O', files[fd], path, NULL);
    }
    return fd;
}

static int open_any(int folder, const char *path, int flags, mode_t mode) {
    if (!ours(path)) return REAL(openat)(folder, path, flags, mode);
    pthread_mutex_lock(&turn);
    struct stat about;
    int was_there = !stat(path, &about), changes_it = (flags & O_CREAT && !was_there) || flags & O_TRUNC;
    int fd = changes_it && stopped(1) ? -1 : opened(REAL(openat)(folder, path, flags, mode), path, flags, was_there);
    pthread_mutex_unlock(&turn);
    return fd;
}

#define OPEN(name) \
    int name(const char *path, int flags, ...) { \
        va_list list; \
        va_start(list, flags); \
        mode_t mode = flags & O_CREAT ? va_arg(list, mode_t) : 0; \
        va_end(list); \
        return open_any(AT_FDCWD, path, flags, mode); \
    }
OPEN(open)
OPEN(open64)

int openat64(int folder, const char *path, int flags, ...) {
    va_list list;
    va_start(list, flags);
    mode_t mode = flags & O_CREAT ? va_arg(list, mode_t) : 0;
    va_end(list);
    return open_any(folder, path, flags, mode);
}

int close(int fd) {
    if (fd >= 0 && fd < FDS) files[fd] = 0;
    return REAL(close)(fd);
}

ssize_t write(int fd, const void *bytes, size_t count) {
    if (fd < 0 || fd >= FDS || files[fd] <= 0) return REAL(write)(fd, bytes, count);
    pthread_mutex_lock(&turn);
    ssize_t done = -1;
    if (!stopped(1)) {
        struct stat about;
        int64_t at = fcntl(fd, F_GETFL) & O_APPEND ? (fstat(fd, &about), about.st_size) : lseek(fd, 0, SEEK_CUR);
        /* A little at a time: a file can end anywhere. */
        done = REAL(write)(fd, bytes, count < 300 ? count : 300);
        if (done > 0) note('W', files[fd], at, bytes, (uint32_t)done, NULL, 0);
    }
    pthread_mutex_unlock(&turn);
    return done;
}

static int synchronised(int fd, int (*real)(int)) {
    if (fd < 0 || fd >= FDS || !files[fd]) return real(fd);
    pthread_mutex_lock(&turn);
    /* Some disks tell only here that they are full. */
    int done = stopped(1) ? -1 : real(fd);
    if (!done) files[fd] < 0 ? named('D', 0, folders[fd], NULL) : note('S', files[fd], 0, NULL, 0, NULL, 0);
    pthread_mutex_unlock(&turn);
    return done;
}

int fsync(int fd) { return synchronised(fd, REAL(fsync)); }
int fdatasync(int fd) { return synchronised(fd, REAL(fdatasync)); }

int ftruncate64(int fd, off64_t length) {
    if (fd < 0 || fd >= FDS || files[fd] <= 0) return REAL(ftruncate64)(fd, length);
    pthread_mutex_lock(&turn);
    int done = stopped(0) ? -1 : REAL(ftruncate64)(fd, length);
    if (!done) note('T', files[fd], length, NULL, 0, NULL, 0);
    pthread_mutex_unlock(&turn);
    return done;
}

/* Calls that change a name. */
#define NAME(op, name, needs_room, decl, call, from, to) \
    int name decl { \
        if (!ours(from)) return REAL(name) call; \
        pthread_mutex_lock(&turn); \
        int done = stopped(needs_room) ? -1 : REAL(name) call; \
        if (!done) named(op, 0, from, to); \
        pthread_mutex_unlock(&turn); \
        return done; \
    }
NAME('R', rename, 1, (const char *from, const char *to), (from, to), from, to)
NAME('L', linkat, 1, (int at, const char *from, int there, const char *to, int flags), (at, from, there, to, flags),
     from, to)
NAME('U', unlink, 0, (const char *path), (path), path, NULL)
NAME('M', mkdir, 1, (const char *path, mode_t mode), (path, mode), path, NULL)
NAME('X', rmdir, 0, (const char *path), (path), path, NULL)
