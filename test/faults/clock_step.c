/* Lets the wall clock of a process jump at one instant, as a clock that is set does (LD_PRELOAD).
 * FAULT_CLOCK_AT is the instant on the monotonic clock in s, FAULT_CLOCK_STEP the jump in s. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdlib.h>
#include <sys/time.h>
#include <time.h>

static int (*real)(clockid_t, struct timespec *);
static long at, step;

__attribute__((constructor)) static void begin(void)
{
    real = (int (*)(clockid_t, struct timespec *))dlsym(RTLD_NEXT, "clock_gettime");
    at = atol(getenv("FAULT_CLOCK_AT"));
    step = atol(getenv("FAULT_CLOCK_STEP"));
}

int clock_gettime(clockid_t clock, struct timespec *out)
{
    struct timespec now;
    if (real == NULL)
        begin();
    int result = real(clock, out);
    if (result == 0 && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE)) {
        real(CLOCK_MONOTONIC, &now);
        if (now.tv_sec >= at)
            out->tv_sec += step;
    }
    return result;
}

int gettimeofday(struct timeval *out, void *zone)
{
    struct timespec now;
    (void)zone;
    int result = clock_gettime(CLOCK_REALTIME, &now);
    out->tv_sec = now.tv_sec;
    out->tv_usec = now.tv_nsec / 1000;
    return result;
}

time_t time(time_t *out)
{
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    if (out != NULL)
        *out = now.tv_sec;
    return now.tv_sec;
}
