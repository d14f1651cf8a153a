"""Publishes samples and takes every step record, through the package ``iceoryx2`` (0.10.0, from PyPI).

    pip install iceoryx2==0.10.0
    python3 publish_and_record.py INSTANCE SECONDS INPUT=SIGNALS [INPUT=SIGNALS ...]

Sends a sample of every input 100 times a second and prints one line of JSON for each step record. It needs the
daemon's own user. Types match those of the daemon by name and layout: ``shared/src/sample.rs``, ``shared/src/record.rs``
and ``shared/src/transport``. Names, prefix and directories: ``shared/src/names.rs``.

iceoryx2 makes its shared memory sparse: on a full ``/dev/shm`` the first write to a page without memory kills the
process. The Rust publishers of this project take their memory beforehand, this example does not.
"""

import ctypes
import json
import math
import os
import sys
import time

import iceoryx2 as iox2

MAX_CHANNELS = 64
PERIOD_NS = 10_000_000


class SampleHeader(ctypes.Structure):
    """Before every sample: its number, rising by 1, and CLOCK_MONOTONIC when it was taken."""

    _fields_ = [("sequence", ctypes.c_uint64), ("timestamp_ns", ctypes.c_uint64)]

    @staticmethod
    def type_name() -> str:
        return "residual.SampleHeader.v1"


class RecordHeader(ctypes.Structure):
    """Before every record: its number, rising by 1, and the diagnoser's slot in the bounds table with this epoch.

    The epoch rises with every reload and restart of the daemon: a slot of another epoch may be another diagnoser.
    """

    _fields_ = [(name, ctypes.c_uint64) for name in ("sequence", "slot", "epoch")]

    @staticmethod
    def type_name() -> str:
        return "residual.RecordHeader.v2"


class Channel(ctypes.Structure):
    """A residual between its bounds."""

    _fields_ = [(name, ctypes.c_double) for name in ("lower", "residual", "upper", "ratio")]


class StepRecord(ctypes.Structure):
    """What a diagnoser says at one sampling instant."""

    _fields_ = [
        *((name, ctypes.c_uint64)
          for name in ("step", "instant_ns", "certainly_faulty", "possibly_faulty", "inputs_valid")),
        *((name, ctypes.c_double) for name in ("fault_estimate", "fault_estimate_half_width")),
        *((name, ctypes.c_uint32) for name in ("verdict", "flags", "skipped_instants", "channel_count")),
        ("channels", Channel * MAX_CHANNELS),
    ]

    @staticmethod
    def type_name() -> str:
        return "residual.StepRecord.v1"


def open_node(instance: str) -> iox2.Node:
    """A node among those of the instance; signals stay Python's own business."""
    directory = os.environ.get("RESIDUALD_RUNTIME_DIRECTORY", "/dev/shm")
    config = iox2.config.default()
    config.global_cfg.root_path = iox2.Path.new(f"{directory}/residuald.{instance}.iox2")
    config.global_cfg.prefix = iox2.FileName.new(f"rsd.{instance}.")
    builder = iox2.NodeBuilder.new().config(config).signal_handling_mode(iox2.SignalHandlingMode.Disabled)
    return builder.create(iox2.ServiceType.Ipc)


def open_publisher(node: iox2.Node, instance: str, name: str, signals: int) -> iox2.Publisher:
    """A publisher on the service of an input, which the daemon has created."""
    service = iox2.ServiceName.new(f"residuald/{instance}/input/{name}/v1")
    builder = node.service_builder(service).publish_subscribe(iox2.Slice[ctypes.c_double]).user_header(SampleHeader)
    return builder.open().publisher_builder().initial_max_slice_len(signals).create()


def send(publisher: iox2.Publisher, sequence: int, timestamp_ns: int, elements: list) -> None:
    """Sends one sample."""
    sample = publisher.loan_slice_uninit(len(elements))
    header = sample.user_header().contents
    header.sequence, header.timestamp_ns = sequence, timestamp_ns
    payload = sample.payload()
    for row, element in enumerate(elements):
        payload[row] = element
    sample.assume_init().send()


class Records:
    """Every step record, and how many were lost."""

    def __init__(self, node: iox2.Node, instance: str) -> None:
        service = iox2.ServiceName.new(f"residuald/{instance}/records/v2")
        builder = node.service_builder(service).publish_subscribe(StepRecord).user_header(RecordHeader)
        self._subscriber = builder.open().subscriber_builder().create()
        self._publisher = self._next_sequence = None
        self.received = self.lost = 0

    def print_new(self) -> None:
        """Prints what has come since the last time."""
        while (sample := self._subscriber.receive()) is not None:
            header, record = sample.user_header().contents, sample.payload().contents
            publisher = sample.header.publisher_id.value
            if self._publisher not in (None, publisher):
                self._next_sequence = 0  # a later life of the daemon, heard from its first record on
            if self._next_sequence is not None:
                self.lost += max(0, header.sequence - self._next_sequence)
            self._publisher, self._next_sequence = publisher, header.sequence + 1
            self.received += 1
            channels = record.channels[: record.channel_count]
            evaluated = [channel.ratio for channel in channels if not math.isnan(channel.ratio)]
            print(json.dumps({
                "epoch": header.epoch,
                "slot": header.slot,
                "step": record.step,
                "instant_ns": record.instant_ns,
                "verdict": record.verdict,
                "worst_ratio": max(evaluated, default=None),
            }), flush=True)
            sample.delete()


def main() -> None:
    """Publishes and records for the time that the command line tells."""
    if len(sys.argv) < 4:
        sys.exit("usage: publish_and_record.py INSTANCE SECONDS INPUT=SIGNALS [INPUT=SIGNALS ...]")
    instance, seconds, *inputs = sys.argv[1:]
    node = open_node(instance)
    publishers = []
    for name, signals in (one.split("=") for one in inputs):
        publishers.append((open_publisher(node, instance, name, int(signals)), int(signals)))
    records = Records(node, instance)
    start_ns = time.monotonic_ns()
    count = int(float(seconds) * 1e9) // PERIOD_NS
    for k in range(count):
        stamp_ns = start_ns + k * PERIOD_NS
        time.sleep(max(0, stamp_ns - time.monotonic_ns()) * 1e-9)
        for publisher, signals in publishers:
            send(publisher, k, stamp_ns, [0.004 * math.sin(k + row) for row in range(signals)])
        records.print_new()
    time.sleep(0.1)
    records.print_new()
    print(json.dumps({"published": count, "received": records.received, "lost": records.lost}))


if __name__ == "__main__":
    main()
