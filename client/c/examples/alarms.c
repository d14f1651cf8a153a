/*
 * Prints every alarm transition, sleeping in between, over restarts of the daemon.
 *
 *     cc alarms.c -lresidual_client -o alarms && ./alarms INSTANCE [EPOCH NUMBER]
 *
 * With a number it goes on behind that transition: keep the last one that was printed, and none is missed.
 */

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "residual_client.h"

static const char *const STATES[] = { "cleared", "pending", "raised", "isolated" };

static void print_transition(residual_alarm_listener *listener, const residual_alarm_event *event)
{
    const residual_alarm_transition *transition = &event->transition;
    residual_text fault;

    printf("%" PRIu64 ".%" PRIu64 ": %s %s", transition->number.epoch, transition->number.number,
           event->diagnoser.bytes[0] ? event->diagnoser.bytes : "?", STATES[transition->state]);
    for (size_t i = 0; i < 64; i++)
        if (transition->certainly_faulty >> i & 1
            && residual_alarm_listener_fault(listener, i, &fault) == RESIDUAL_STATUS_OK)
            printf(" [%s]", fault.bytes);
    printf("\n");
}

int main(int count, char **arguments)
{
    residual_alarm_listener *listener;
    residual_alarm_event event;
    residual_status status;
    residual_alarm_number after = { 0, 0 };
    uint32_t start = RESIDUAL_ALARM_START_OLDEST;

    if (count != 2 && count != 4) {
        fprintf(stderr, "usage: alarms INSTANCE [EPOCH NUMBER]\n");
        return 2;
    }
    if (count == 4) {
        start = RESIDUAL_ALARM_START_AFTER;
        after.epoch = strtoull(arguments[2], NULL, 10);
        after.number = strtoull(arguments[3], NULL, 10);
    }
    status = residual_alarm_listener_open(arguments[1], NULL, start, after, &listener);
    if (status != RESIDUAL_STATUS_OK) {
        fprintf(stderr, "alarms: %s\n", residual_last_error());
        return 1;
    }
    setvbuf(stdout, NULL, _IOLBF, 0);
    for (;;) {
        status = residual_alarm_listener_next(listener, 0, 1000000000, &event);
        if (status == RESIDUAL_STATUS_NOTHING)
            continue;
        if (status != RESIDUAL_STATUS_OK)
            break;
        switch (event.kind) {
        case RESIDUAL_ALARM_EVENT_KIND_TRANSITION:
            print_transition(listener, &event);
            break;
        case RESIDUAL_ALARM_EVENT_KIND_GAP:
            printf("transitions %" PRIu64 " to %" PRIu64 " are lost\n", event.first, event.last);
            break;
        case RESIDUAL_ALARM_EVENT_KIND_NEW_NUMBERING:
            printf("numbers begin anew; what came after %" PRIu64 ".%" PRIu64 " is not known\n",
                   event.previous.epoch, event.previous.number);
            break;
        }
    }
    fprintf(stderr, "alarms: %s\n", residual_last_error());
    residual_alarm_listener_close(listener);
    return 1;
}
