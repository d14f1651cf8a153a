/* Writes what the C client reads; see support/dump.rs of the Rust client's tests. */

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "residual_client.h"

static const char *const DAEMON[] = { "running", "hung", "closed", "unreachable" };
static const char *const FRESHNESS[] = { "fresh", "stale", "not evaluated", "starting", "dead" };

static void check(residual_status status, residual_status expected)
{
    if (status != expected) {
        fprintf(stderr, "dump: status %d instead of %d: %s\n", (int)status, (int)expected, residual_last_error());
        exit(1);
    }
}

static void print_bits(double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    printf(" %016" PRIx64, bits);
}

static void print_diagnoser(residual_monitor *monitor, size_t index)
{
    residual_diagnoser diagnoser;
    residual_channel_name channel;
    residual_text fault;
    residual_reading reading;
    residual_record record;
    size_t followed;

    check(residual_monitor_diagnoser(monitor, index, &diagnoser), RESIDUAL_STATUS_OK);
    printf("diagnoser %s %s %" PRIu64 " %" PRIu64 " %" PRIu64 "\n", diagnoser.name.bytes, diagnoser.method.bytes,
           diagnoser.period_ns, diagnoser.phase_ns, diagnoser.margin_ns);
    for (size_t i = 0; i < diagnoser.channel_count; i++) {
        check(residual_monitor_channel(monitor, index, i, &channel), RESIDUAL_STATUS_OK);
        printf("channel %s [%s]\n", channel.name.bytes, channel.unit.bytes);
    }
    for (size_t i = 0; i < diagnoser.fault_count; i++) {
        check(residual_monitor_fault(monitor, index, i, &fault), RESIDUAL_STATUS_OK);
        printf("fault %s\n", fault.bytes);
    }
    check(residual_monitor_follow(monitor, diagnoser.name.bytes, &followed), RESIDUAL_STATUS_OK);
    check(residual_monitor_read(monitor, followed, &reading, &record), RESIDUAL_STATUS_OK);
    printf("reading %s %" PRIu64 " %" PRIu64 "\n", FRESHNESS[reading.freshness], reading.number, reading.epoch);
    if (reading.number == 0)
        return;
    printf("record %" PRIu64 " %" PRIu64 " %" PRIu64 " %" PRIu64 " %" PRIu64 "\n", record.step, record.instant_ns,
           record.certainly_faulty, record.possibly_faulty, record.inputs_valid);
    printf("more");
    print_bits(record.fault_estimate);
    print_bits(record.fault_estimate_half_width);
    printf(" %" PRIu32 " %" PRIu32 " %" PRIu32 "\n", record.verdict, record.flags, record.skipped_instants);
    for (uint32_t i = 0; i < record.channel_count; i++) {
        printf("values");
        print_bits(record.channels[i].lower);
        print_bits(record.channels[i].residual);
        print_bits(record.channels[i].upper);
        print_bits(record.channels[i].ratio);
        printf("\n");
    }
}

static void print_records(residual_monitor *monitor)
{
    residual_daemon_state state;
    uint64_t epoch;
    size_t count;

    check(residual_monitor_daemon(monitor, &state, &epoch), RESIDUAL_STATUS_OK);
    printf("daemon %s %" PRIu64 "\n", DAEMON[state], epoch);
    check(residual_monitor_diagnoser_count(monitor, &count), RESIDUAL_STATUS_OK);
    for (size_t i = 0; i < count; i++)
        print_diagnoser(monitor, i);
}

static void print_transition(residual_alarm_listener *listener, const residual_alarm_event *event)
{
    const residual_alarm_transition *one = &event->transition;
    residual_text fault;

    printf("transition %" PRIu64 ".%" PRIu64 " %" PRIu64 " %" PRIu64 " %" PRIu64 " %" PRIu32 " %" PRIu32 " %" PRIu32
           " %" PRIu32 " %" PRIu64 " %" PRIu64 " %" PRIu64,
           one->number.epoch, one->number.number, one->written_ns, one->instant_ns, one->step, one->state, one->flags,
           one->verdict, one->channel, one->occurrence, one->certainly_faulty, one->possibly_faulty);
    print_bits(one->ratio);
    print_bits(one->fault_estimate);
    print_bits(one->fault_estimate_half_width);
    printf(" [%s] [%s]", event->diagnoser.bytes, event->channel.bytes);
    for (size_t i = 0; i < 64; i++)
        if (one->certainly_faulty >> i & 1
            && residual_alarm_listener_fault(listener, i, &fault) == RESIDUAL_STATUS_OK)
            printf(" <%s>", fault.bytes);
    printf("\n");
}

static void print_alarm(residual_alarm_listener *listener)
{
    residual_alarm_event event;
    residual_alarm_number position;

    check(residual_alarm_listener_next(listener, 0, UINT64_C(20000000000), &event), RESIDUAL_STATUS_OK);
    check(residual_alarm_listener_position(listener, &position), RESIDUAL_STATUS_OK);
    switch (event.kind) {
    case RESIDUAL_ALARM_EVENT_KIND_TRANSITION:
        print_transition(listener, &event);
        break;
    case RESIDUAL_ALARM_EVENT_KIND_GAP:
        printf("gap %" PRIu64 " %" PRIu64 "\n", event.first, event.last);
        break;
    case RESIDUAL_ALARM_EVENT_KIND_NEW_NUMBERING:
        printf("new numbering %" PRIu64 ".%" PRIu64 " %" PRIu64 "\n", event.previous.epoch, event.previous.number,
               event.origin);
        break;
    }
}

static void account(residual_alarm_listener *listener, uint64_t last)
{
    residual_alarm_event event;
    uint64_t seen = 0, missing = 0;

    while (seen + missing < last) {
        uint64_t next = seen + missing + 1;
        check(residual_alarm_listener_next(listener, 0, UINT64_C(20000000000), &event), RESIDUAL_STATUS_OK);
        if (event.kind == RESIDUAL_ALARM_EVENT_KIND_TRANSITION && event.transition.number.number == next
            && event.transition.step == next) {
            seen++;
        } else if (event.kind == RESIDUAL_ALARM_EVENT_KIND_GAP && event.first == next && event.last >= next) {
            missing += event.last - event.first + 1;
        } else {
            fprintf(stderr, "dump: not %" PRIu64 "\n", next);
            exit(1);
        }
    }
    printf("%" PRIu64 " %" PRIu64 "\n", seen, missing);
}

/* What a careless caller does is answered by a code and a text. */
static void check_mistakes(const char *directory, residual_monitor *monitor)
{
    residual_monitor *other = NULL;
    residual_alarm_listener *listener;
    residual_alarm_number number = { 0, 0 };
    residual_reading reading;
    residual_diagnoser diagnoser;
    size_t followed;

    check(residual_monitor_open(NULL, directory, &other), RESIDUAL_STATUS_INVALID_ARGUMENT);
    check(residual_monitor_open("test", directory, NULL), RESIDUAL_STATUS_INVALID_ARGUMENT);
    check(residual_monitor_open("NO/NAME", directory, &other), RESIDUAL_STATUS_INVALID_ARGUMENT);
    check(residual_monitor_open("\xff", directory, &other), RESIDUAL_STATUS_INVALID_ARGUMENT);
    check(residual_monitor_open("nobody", directory, &other), RESIDUAL_STATUS_NO_DAEMON);
    if (!strstr(residual_last_error(), "is the daemon running") || other)
        exit(1);
    check(residual_monitor_follow(monitor, "nobody", &followed), RESIDUAL_STATUS_NO_SUCH_DIAGNOSER);
    check(residual_monitor_read(monitor, 1000000, &reading, NULL), RESIDUAL_STATUS_INVALID_ARGUMENT);
    check(residual_monitor_read(NULL, 0, &reading, NULL), RESIDUAL_STATUS_INVALID_ARGUMENT);
    check(residual_monitor_diagnoser(monitor, 1000000, &diagnoser), RESIDUAL_STATUS_INVALID_ARGUMENT);
    check(residual_alarm_listener_open("test", directory, 3, number, &listener), RESIDUAL_STATUS_INVALID_ARGUMENT);
    check(residual_alarm_listener_open("nobody", directory, 0, number, &listener), RESIDUAL_STATUS_OK);
    check(residual_alarm_listener_position(listener, &number), RESIDUAL_STATUS_NOTHING);
    residual_alarm_listener_close(listener);
    residual_alarm_listener_close(NULL);
    check(residual_monitor_connect("nobody", directory, &other), RESIDUAL_STATUS_OK);
    check(residual_monitor_follow(other, "later", &followed), RESIDUAL_STATUS_OK);
    check(residual_monitor_read(other, followed, &reading, NULL), RESIDUAL_STATUS_OK);
    check(residual_monitor_diagnoser(other, 0, &diagnoser), RESIDUAL_STATUS_NO_DAEMON);
    if (reading.freshness != RESIDUAL_FRESHNESS_DEAD || reading.number != 0)
        exit(1);
    residual_monitor_close(other);
    residual_monitor_close(NULL);
}

int main(int count, char **arguments)
{
    residual_monitor *monitor;
    residual_alarm_listener *listener;
    residual_alarm_number after;
    char line[64];
    unsigned events;
    uint64_t last;

    if (count != 5)
        return 2;
    after.epoch = strtoull(arguments[3], NULL, 10);
    after.number = strtoull(arguments[4], NULL, 10);
    check(residual_monitor_open(arguments[1], arguments[2], &monitor), RESIDUAL_STATUS_OK);
    check(residual_alarm_listener_open(arguments[1], arguments[2], RESIDUAL_ALARM_START_AFTER, after, &listener),
          RESIDUAL_STATUS_OK);
    check_mistakes(arguments[2], monitor);
    while (fgets(line, sizeof line, stdin)) {
        if (sscanf(line, "alarms %u", &events) == 1)
            while (events-- > 0)
                print_alarm(listener);
        else if (sscanf(line, "account %" SCNu64, &last) == 1)
            account(listener, last);
        else
            print_records(monitor);
        printf(".\n");
        fflush(stdout);
    }
    residual_alarm_listener_close(listener);
    residual_monitor_close(monitor);
    return 0;
}
