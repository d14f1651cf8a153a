"""What all peers in Python have in common: the problem, and the lines `check` and `time` on the standard input.

A peer is an object with `reset()`, `step(measurements, commands)` and `out`, the compared numbers of the latest step
(all residuals, then all upper bounds). See `contender.rs` for the other side.
"""

import gc
import json
import platform
import sys
from time import thread_time_ns

import numpy as np


def run(make, name=f"numpy {np.__version__}"):
    """Reads the problem, says what this is, and obeys until the standard input is closed."""
    with open(sys.argv[1], encoding="utf-8") as file:
        problem = json.load(file)
    peer = make(problem)
    inputs = peer.inputs(problem) if hasattr(peer, "inputs") else sampled(problem)
    gc.collect()
    gc.freeze()
    print(f"{name}, Python {platform.python_version()}", flush=True)
    for line in sys.stdin:
        if line.strip() == "check":
            print(json.dumps(outputs(peer, inputs)), flush=True)
        else:
            one_pass(peer, inputs)
            print(one_pass(peer, inputs), flush=True)


def sampled(problem):
    """(y, u) of every instant."""
    return [
        (np.array(y), np.array(u)) for y, u in zip(problem["measurements"], problem["commands"])
    ]


def outputs(peer, inputs):
    peer.reset()
    numbers = []
    for y, u in inputs:
        peer.step(y, u)
        numbers.append(peer.out.tolist())
    return numbers


def one_pass(peer, inputs):
    peer.reset()
    step = peer.step
    begin = thread_time_ns()
    for y, u in inputs:
        step(y, u)
    return thread_time_ns() - begin
