"""Writes what the Python client reads; see support/dump.rs."""

import struct
import sys

from residual_client import AlarmListener, AlarmNumber, Gap, Monitor, Transition


def bits(value: float) -> str:
    return f"{struct.unpack('=Q', struct.pack('=d', value))[0]:016x}"


def records(monitor: Monitor) -> None:
    print("daemon", monitor.state, monitor.epoch)
    for one in monitor.diagnosers:
        print("diagnoser", one.name, one.method, one.period_ns, one.phase_ns, one.margin_ns)
        for channel in one.channels:
            print(f"channel {channel.name} [{channel.unit}]")
        for fault in one.faults:
            print("fault", fault)
        reading = monitor.read(one.name)
        print("reading", reading.freshness.value, reading.number, reading.epoch)
        record = reading.record
        if record is None:
            continue
        print("record", record.step, record.instant_ns, record.certainly_faulty, record.possibly_faulty,
              record.inputs_valid)
        print("more", bits(record.fault_estimate), bits(record.fault_estimate_half_width), record.verdict_number,
              record.flags, record.skipped_instants)
        for channel in record.channels:
            print("values", bits(channel.lower), bits(channel.residual), bits(channel.upper), bits(channel.ratio))


def alarm(event: object) -> None:
    if isinstance(event, Transition):
        faults = "".join(f" <{name}>" for name in event.faults(event.certainly_faulty))
        diagnoser = event.diagnoser.name if event.diagnoser else ""
        channel = 0xFFFF_FFFF if event.channel is None else event.channel
        print("transition", event.number, event.written_ns, event.instant_ns, event.step, int(event.state),
              event.flags, event.verdict_number, channel, event.occurrence, event.certainly_faulty,
              event.possibly_faulty, bits(event.ratio), bits(event.fault_estimate),
              bits(event.fault_estimate_half_width), f"[{diagnoser}] [{event.channel_name or ''}]{faults}")
    elif isinstance(event, Gap):
        print("gap", event.first, event.last)
    elif event is not None:
        print("new numbering", event.previous, event.origin)


def account(listener: AlarmListener, last: int) -> None:
    seen = missing = 0
    while seen + missing < last:
        event = listener.wait(20.0)
        if isinstance(event, Transition):
            assert event.number.number == event.step == seen + missing + 1
            seen += 1
        else:
            assert isinstance(event, Gap) and event.first == seen + missing + 1, event
            missing += event.last - event.first + 1
    print(seen, missing)


instance, directory, epoch, number = sys.argv[1:]
monitor = Monitor(instance, directory)
listener = AlarmListener(instance, directory, start=AlarmNumber(int(epoch), int(number)))
for line in sys.stdin:
    command, *arguments = line.split()
    if command == "records":
        records(monitor)
    elif command == "account":
        account(listener, int(arguments[0]))
    else:
        for _ in range(int(arguments[0])):
            alarm(listener.wait(20.0))
    print(".", flush=True)
