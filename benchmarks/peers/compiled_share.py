"""How much of one call of ``time_scale`` is compiled code: ``python -m benchmarks.peers.compiled_share``.

Every compiled function that Python calls is timed in a call of 1,001 points with slip, tip and wheels
(processor time, least of the repetitions), and so is the call itself. What is inside a compiled
function counts as compiled; handing over its arguments does too, some microseconds each.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import defaultdict
from collections.abc import Callable
from functools import wraps
from typing import Any

from numba.core.registry import CPUDispatcher

from benchmarks.peers.time_scaling_calls import LIMITS
from benchmarks.peers.time_scaling_cases import curve, robot
from trajopt.timing.scaling import time_scale

POINTS = 1001


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--repetitions", type=int, default=60)
    parser.add_argument("--points", type=int, default=POINTS)
    options = parser.parse_args()
    whole, parts = measured(options.points, options.repetitions)
    inside = sum(parts.values())
    print(f"one call of {options.points} points: {whole * 1e3:.2f} ms")
    print(f"in compiled code: {inside * 1e3:.2f} ms, {inside / whole:.0%}")
    for name, seconds in sorted(parts.items(), key=lambda item: -item[1]):
        print(f"  {name:32} {seconds * 1e3:6.3f} ms")


def measured(points: int, repetitions: int) -> tuple[float, dict[str, float]]:
    """Least seconds of a call, and of what it spends in each compiled function."""
    path, one = curve(), robot()

    def call() -> None:
        time_scale(path, LIMITS, robot=one, gridpoints=points)

    call()
    spent: defaultdict[str, float] = defaultdict(float)
    put_in(spent)
    whole, least = float("inf"), {}
    for _ in range(repetitions):
        spent.clear()
        begin = time.process_time()
        call()
        seconds = time.process_time() - begin
        if seconds < whole:
            whole, least = seconds, dict(spent)
    return whole, least


def put_in(spent: defaultdict[str, float]) -> None:
    """Have every compiled function of the package add its time to ``spent``."""
    for module in [m for name, m in sys.modules.items() if name.startswith("trajopt.")]:
        for name, value in list(vars(module).items()):
            if isinstance(value, CPUDispatcher):
                setattr(module, name, timed(value, spent))


def timed(function: Any, spent: defaultdict[str, float]) -> Callable[..., Any]:
    name = f"{function.__module__.rsplit('.', 1)[-1]}.{function.__name__}"

    @wraps(function.py_func)
    def run(*arguments: Any) -> Any:
        begin = time.process_time()
        found = function(*arguments)
        spent[name] += time.process_time() - begin
        return found

    return run


if __name__ == "__main__":
    main()
