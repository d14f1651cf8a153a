"""``python3 -m residual_client status|alarms``: looks at a residuald daemon.

Exit codes: 0 all is well, 1 an error, 2 wrong usage, 3 there is no living daemon, 4 (status) a diagnoser reports a
fault, 5 (status) no fault is reported, but a diagnoser does not judge.
"""

from __future__ import annotations

import argparse
import sys
from typing import Union

from . import (AlarmListener, AlarmNumber, Freshness, Gap, Monitor, NewNumbering, NoTable, TableError, Transition,
               Verdict)

NO_DAEMON, FAULT, NOT_JUDGED = 3, 4, 5


def status(arguments: argparse.Namespace) -> int:
    """Shows every diagnoser once."""
    monitor = Monitor(arguments.instance, arguments.runtime_directory)
    state = monitor.state
    print(f"instance {arguments.instance}: daemon {state}")
    code = 0
    for diagnoser in monitor.diagnosers:
        reading = monitor.read(diagnoser.name)
        line = f"{diagnoser.name}: {reading.freshness.value}"
        record = reading.record
        if record is not None:
            line += f", step {record.step}: {record.verdict.name.lower().replace('_', ' ')}"
            faults = diagnoser.names_of(record.certainly_faulty)
            if record.verdict in (Verdict.FAULT, Verdict.ISOLATED):
                code = FAULT
                line += f" {', '.join(faults)}".rstrip()
            worst = record.worst_channel()
            if worst is not None:
                line += f"; worst {diagnoser.channels[worst[0]].name} at {worst[1].ratio:.3f}"
        judges = reading.freshness is Freshness.FRESH and record is not None
        if code == 0 and not (judges and record.verdict is not Verdict.GUARANTEE_LOST):
            code = NOT_JUDGED
        print(line)
    return code if state == "running" else NO_DAEMON


def alarms(arguments: argparse.Namespace) -> int:
    """Shows the alarm transitions, and goes on with those to come if told so."""
    listener = AlarmListener(arguments.instance, arguments.runtime_directory, start=arguments.since)
    while True:
        event = listener.try_next()
        if event is None and not arguments.follow:
            return 0 if listener.state == "running" else NO_DAEMON
        if event is None:
            event = listener.wait(1.0)
        if isinstance(event, Transition):
            name = event.diagnoser.name if event.diagnoser else "(a diagnoser that is gone)"
            faults = ", ".join(event.faults(event.certainly_faulty))
            print(f"{event.number}  {name}  {event.state.name.lower()}  {faults}".rstrip(), flush=True)
        elif isinstance(event, Gap):
            lost = event.last - event.first + 1
            print(f"GAP: {lost} lost, numbers {event.first} to {event.last}", flush=True)
        elif isinstance(event, NewNumbering):
            print(f"GAP: numbers begin anew with {event.origin}.1; how many transitions are lost behind "
                  f"{event.previous} is unknown", flush=True)


def since(text: str) -> Union[str, AlarmNumber]:
    """The start of a listener."""
    return text if text in ("now", "oldest") else AlarmNumber.parse(text)


def main() -> int:
    """Runs a command; gives the exit code."""
    parser = argparse.ArgumentParser("python3 -m residual_client", description="Looks at a residuald daemon.")
    commands = parser.add_subparsers(required=True)
    for function in (status, alarms):
        command = commands.add_parser(function.__name__, help=function.__doc__)
        command.add_argument("--instance", required=True, help="name of the instance")
        command.add_argument("--runtime-directory", help="directory of the instance's files")
        command.set_defaults(function=function)
        if function is alarms:
            command.add_argument("--since", type=since, default="oldest", metavar="EPOCH.NUMBER|oldest|now")
            command.add_argument("--follow", action="store_true", help="goes on until Ctrl-C")
    arguments = parser.parse_args()
    try:
        return arguments.function(arguments)
    except NoTable as error:
        print(f"residual_client: {error}", file=sys.stderr)
        return NO_DAEMON
    except (TableError, ValueError) as error:
        print(f"residual_client: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 0


if __name__ == "__main__":
    sys.exit(main())
