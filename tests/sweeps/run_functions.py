"""Run functions of the sweep tests, importable by every worker."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import time
from typing import Any

import numpy as np

from trajopt.sweeps.cases import Case


def noop(case: Case) -> None:
    """Nothing."""


def cheap(case: Case) -> dict[str, Any]:
    """A few numbers that depend on values and seed."""
    x = float(case["x"])
    return {"square": x * x, "draw": float(case.rng().random()), "even": int(x) % 2 == 0}


def friction(case: Case, problem: Any) -> float:
    """What the problem of this case has, times a value that only this function knows."""
    return float(problem.ground.friction) * float(case["factor"])


def paced(case: Case) -> dict[str, Any]:
    """``cheap``, 5 ms long."""
    time.sleep(0.005)
    return cheap(case)


def waiting(case: Case) -> dict[str, Any]:
    """``cheap``, 0.2 s long."""
    time.sleep(0.2)
    return cheap(case)


def mixed(case: Case) -> dict[str, Any]:
    """``cheap`` with arrays, and an error now and then."""
    if case["x"] % 97 == 5:
        raise ValueError(f"x = {case['x']} is a bad number")
    return {
        **cheap(case),
        "nested": {"text": f"case {case['x']}", "list": [1, 2.5]},
        "track": np.arange(6.0).reshape(3, 2) * case["x"],
    }


def paced_mixed(case: Case) -> dict[str, Any]:
    """``mixed``, 3 ms long: enough for many chunks."""
    time.sleep(0.003)
    return mixed(case)


def poisoned(case: Case) -> Any:
    """A different disaster by ``kind`` for one case; all others are ``cheap``."""
    match case["kind"]:
        case "raise":
            raise RuntimeError("on purpose")
        case "exit":
            sys.exit(3)
        case "hard exit":
            os._exit(3)
        case "segfault":
            ctypes.string_at(0)
        case "hang":
            time.sleep(3600)
        case "spin":
            while True:
                pass
        case "deaf":
            signal.pthread_sigmask(
                signal.SIG_BLOCK, {signal.SIGTERM, signal.SIGINT, signal.SIGALRM}
            )
            ctypes.PyDLL(None).sleep(3600)  # in C, holding the interpreter lock
        case "memory":
            return {"square": float(np.ones(1 << 33).sum())}
        case "print":
            for _ in range(20_000):
                print("x" * 1000)
        case "unserialisable":
            return {"square": object()}
        case "lambda":
            return lambda: 0
        case "kind":
            return {"square": "text where numbers are", "draw": 0.0, "even": True}
        case "kill worker":
            os.kill(os.getppid(), signal.SIGKILL)
            time.sleep(10)
    return cheap(case)
