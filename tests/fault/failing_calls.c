// Loaded before the C library (LD_PRELOAD), this counts the calls by which a process changes one folder and makes one of them fail, or
// ends the process there as kill -9 would, so that every such call can be tried in turn.
//   CROSSTIE_FAULT_FOLDER  calls that concern files below it are counted, from 1
//   CROSSTIE_FAULT         count | kill:N | fail:N:ERRNO | from:N:ERRNO (that call and all later ones) | short:N (that write writes half; 0: each one)
//   CROSSTIE_FAULT_LOG     where the number of calls is written at the end
//   CROSSTIE_FAULT_CLOCK   seconds by which the time of day is moved
//   CROSSTIE_FAULT_THREAD  the N-th thread and all later ones cannot be made
//   CROSSTIE_FAULT_NAMED   the file system cannot make files without a name (O_TMPFILE)
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

enum { kCount, kKill, kFail, kFrom, kShort };

static const char* folder = NULL;
static int mode = kCount;
static long chosen = 0;
static int number = 0;
static long clock_offset_s = 0;
static long failing_thread = 0;
static int only_named = 0;
static atomic_long calls = 0;
static atomic_long threads = 0;

static long of_environment(const char* name) {
  const char* text = getenv(name);
  return text == NULL ? 0 : atol(text);
}

__attribute__((constructor)) static void begin(void) {
  folder = getenv("CROSSTIE_FAULT_FOLDER");
  clock_offset_s = of_environment("CROSSTIE_FAULT_CLOCK");
  failing_thread = of_environment("CROSSTIE_FAULT_THREAD");
  only_named = getenv("CROSSTIE_FAULT_NAMED") != NULL;
  const char* what = getenv("CROSSTIE_FAULT");
  if (what == NULL) return;
  if (sscanf(what, "kill:%ld", &chosen) == 1) mode = kKill;
  if (sscanf(what, "fail:%ld:%d", &chosen, &number) == 2) mode = kFail;
  if (sscanf(what, "from:%ld:%d", &chosen, &number) == 2) mode = kFrom;
  if (sscanf(what, "short:%ld", &chosen) == 1) mode = kShort;
}

__attribute__((destructor)) static void end(void) {
  const char* log = getenv("CROSSTIE_FAULT_LOG");
  if (log == NULL) return;
  FILE* file = fopen(log, "we");
  if (file == NULL) return;
  fprintf(file, "%ld\n", atomic_load(&calls));
  fclose(file);
}

static int is_below(const char* path) {
  const size_t length = folder == NULL ? 0 : strlen(folder);
  return length > 0 && path != NULL && strncmp(path, folder, length) == 0;
}

static int is_file_below(int file) {
  if (folder == NULL) return 0;
  char link[64];
  char path[PATH_MAX];
  snprintf(link, sizeof link, "/proc/self/fd/%d", file);
  const ssize_t length = readlink(link, path, sizeof path - 1);
  if (length <= 0) return 0;
  path[length] = '\0';
  return is_below(path);
}

static int is_at_below(int at, const char* path) { return path != NULL && path[0] == '/' ? is_below(path) : is_file_below(at); }

static int is_nameless(int flags) {
  if (!only_named || (flags & O_TMPFILE) != O_TMPFILE) return 0;
  errno = EOPNOTSUPP;
  return 1;
}

/// Counts a call that concerns the folder; whether it has to fail, with errno set. 2: write less.
static int fails(int concerns) {
  if (!concerns) return 0;
  const long n = atomic_fetch_add(&calls, 1) + 1;
  if (mode == kKill && n == chosen) kill(getpid(), SIGKILL);
  if ((mode == kFail && n == chosen) || (mode == kFrom && n >= chosen)) {
    errno = number;
    return 1;
  }
  return mode == kShort && (n == chosen || chosen == 0) ? 2 : 0;
}

/// The same of a call that takes something away, which a full disk does not hinder.
static void counts(int concerns) {
  if (!concerns) return;
  const long n = atomic_fetch_add(&calls, 1) + 1;
  if (mode == kKill && n == chosen) kill(getpid(), SIGKILL);
}

#define REAL(type, name, ...) \
  static type (*real)(__VA_ARGS__) = NULL; \
  if (real == NULL) real = (type(*)(__VA_ARGS__))dlsym(RTLD_NEXT, #name)

#define OPEN(name)                                                                    \
  int name(const char* path, int flags, ...) {                                        \
    REAL(int, name, const char*, int, ...);                                           \
    va_list more;                                                                     \
    va_start(more, flags);                                                            \
    const mode_t bits = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(more, mode_t) : 0; \
    va_end(more);                                                                     \
    if (is_nameless(flags)) return -1;                                                \
    if ((flags & (O_CREAT | O_WRONLY | O_RDWR)) != 0 && fails(is_below(path)) == 1) return -1; \
    return real(path, flags, bits);                                                   \
  }
OPEN(open)
OPEN(open64)

#define OPENAT(name)                                                                  \
  int name(int at, const char* path, int flags, ...) {                                \
    REAL(int, name, int, const char*, int, ...);                                      \
    va_list more;                                                                     \
    va_start(more, flags);                                                            \
    const mode_t bits = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(more, mode_t) : 0; \
    va_end(more);                                                                     \
    if (is_nameless(flags)) return -1;                                                \
    if ((flags & (O_CREAT | O_WRONLY | O_RDWR)) != 0 && fails(is_at_below(at, path)) == 1) return -1; \
    return real(at, path, flags, bits);                                               \
  }
OPENAT(openat)
OPENAT(openat64)

ssize_t write(int file, const void* bytes, size_t count) {
  REAL(ssize_t, write, int, const void*, size_t);
  const int how = count > 0 ? fails(is_file_below(file)) : 0;
  if (how == 1) return -1;
  return real(file, bytes, how == 2 ? (count + 1) / 2 : count);
}

ssize_t writev(int file, const struct iovec* parts, int count) {
  REAL(ssize_t, writev, int, const struct iovec*, int);
  if (fails(is_file_below(file)) == 1) return -1;
  return real(file, parts, count);
}

ssize_t sendfile(int out, int in, off_t* offset, size_t count) {
  REAL(ssize_t, sendfile, int, int, off_t*, size_t);
  if (fails(is_file_below(out)) == 1) return -1;
  return real(out, in, offset, count);
}

ssize_t copy_file_range(int in, off64_t* in_at, int out, off64_t* out_at, size_t count, unsigned flags) {
  REAL(ssize_t, copy_file_range, int, off64_t*, int, off64_t*, size_t, unsigned);
  if (fails(is_file_below(out)) == 1) return -1;
  return real(in, in_at, out, out_at, count, flags);
}

int fsync(int file) {
  REAL(int, fsync, int);
  if (fails(is_file_below(file)) == 1) return -1;
  return real(file);
}

int mkdir(const char* path, mode_t bits) {
  REAL(int, mkdir, const char*, mode_t);
  if (fails(is_below(path)) == 1) return -1;
  return real(path, bits);
}

int rename(const char* from, const char* to) {
  REAL(int, rename, const char*, const char*);
  if (fails(is_below(to)) == 1) return -1;
  return real(from, to);
}

int renameat2(int from_at, const char* from, int to_at, const char* to, unsigned flags) {
  REAL(int, renameat2, int, const char*, int, const char*, unsigned);
  if (fails(is_at_below(to_at, to)) == 1) return -1;
  return real(from_at, from, to_at, to, flags);
}

int linkat(int from_at, const char* from, int to_at, const char* to, int flags) {
  REAL(int, linkat, int, const char*, int, const char*, int);
  if (fails(is_at_below(to_at, to)) == 1) return -1;
  return real(from_at, from, to_at, to, flags);
}

int unlink(const char* path) {
  REAL(int, unlink, const char*);
  counts(is_below(path));
  return real(path);
}

int unlinkat(int at, const char* path, int flags) {
  REAL(int, unlinkat, int, const char*, int);
  counts(is_at_below(at, path));
  return real(at, path, flags);
}

int remove(const char* path) {
  REAL(int, remove, const char*);
  counts(is_below(path));
  return real(path);
}

int rmdir(const char* path) {
  REAL(int, rmdir, const char*);
  counts(is_below(path));
  return real(path);
}

int clock_gettime(clockid_t clock, struct timespec* time) {
  REAL(int, clock_gettime, clockid_t, struct timespec*);
  const int result = real(clock, time);
  if (result == 0 && clock == CLOCK_REALTIME) time->tv_sec += clock_offset_s;
  return result;
}

time_t time(time_t* where) {
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  if (where != NULL) *where = now.tv_sec;
  return now.tv_sec;
}

int gettimeofday(struct timeval* restrict now, void* restrict zone) {
  REAL(int, gettimeofday, struct timeval*, void*);
  const int result = real(now, zone);
  if (result == 0) now->tv_sec += clock_offset_s;
  return result;
}

int pthread_create(pthread_t* thread, const pthread_attr_t* attributes, void* (*start)(void*), void* argument) {
  REAL(int, pthread_create, pthread_t*, const pthread_attr_t*, void* (*)(void*), void*);
  if (failing_thread > 0 && atomic_fetch_add(&threads, 1) + 1 >= failing_thread) return EAGAIN;
  return real(thread, attributes, start, argument);
}
