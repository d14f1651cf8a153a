/*
 * Polls one diagnoser ten times a second and prints what it says, over restarts of the daemon.
 *
 *     cc poll.c -lresidual_client -o poll && ./poll INSTANCE DIAGNOSER
 */

#define _POSIX_C_SOURCE 199309L

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <time.h>

#include "residual_client.h"

static int failed(void)
{
    fprintf(stderr, "poll: %s\n", residual_last_error());
    return 1;
}

/* The largest ratio of the evaluated channels. */
static double worst_ratio(const residual_record *record)
{
    double worst = 0.0;
    for (uint32_t i = 0; i < record->channel_count; i++) {
        double ratio = record->channels[i].ratio;
        if (!isnan(ratio) && ratio > worst)
            worst = ratio;
    }
    return worst;
}

int main(int count, char **arguments)
{
    residual_monitor *monitor;
    size_t diagnoser;

    if (count != 3) {
        fprintf(stderr, "usage: poll INSTANCE DIAGNOSER\n");
        return 2;
    }
    if (residual_monitor_connect(arguments[1], NULL, &monitor) != RESIDUAL_STATUS_OK)
        return failed();
    if (residual_monitor_follow(monitor, arguments[2], &diagnoser) != RESIDUAL_STATUS_OK) {
        residual_monitor_close(monitor);
        return failed();
    }
    setvbuf(stdout, NULL, _IOLBF, 0);
    for (;;) {
        residual_reading reading;
        residual_record record;

        if (residual_monitor_read(monitor, diagnoser, &reading, &record) != RESIDUAL_STATUS_OK)
            break;
        switch (reading.freshness) {
        case RESIDUAL_FRESHNESS_FRESH:
            printf("step %" PRIu64 ": verdict %" PRIu32 ", worst ratio %.3f\n", record.step, record.verdict,
                   worst_ratio(&record));
            break;
        case RESIDUAL_FRESHNESS_STALE:
            printf("no new record for %.3f s\n", 1e-9 * (double)reading.age_ns);
            break;
        case RESIDUAL_FRESHNESS_NOT_EVALUATED:
            printf("step %" PRIu64 ": not evaluated\n", record.step);
            break;
        case RESIDUAL_FRESHNESS_STARTING:
            printf("starting\n");
            break;
        case RESIDUAL_FRESHNESS_DEAD:
            printf("no daemon\n");
            break;
        }
        nanosleep(&(struct timespec){ .tv_nsec = 100000000 }, NULL);
    }
    failed();
    residual_monitor_close(monitor);
    return 1;
}
