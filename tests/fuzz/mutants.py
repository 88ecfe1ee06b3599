"""Damaged files of every kind, and what becomes of them: refused in one line, or used.

``python -m tests.fuzz.mutants --count 20000 --seed 1`` runs them in this process, with a watchdog of
10 s and 1 GB, and prints the outcomes by kind of file; it ends with 1 where one was a fault: an
exception but TrajoptError, a hang, memory, or NaN in a result that is said to hold.
"""

from __future__ import annotations

import argparse
import random
import re
import resource
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from tests.fuzz.kinds import Kind, all_kinds
from trajopt.errors import TrajoptError

SECONDS, BYTES = 10.0, 1_000_000_000  # a mutant may take; the goal
_WAITED = 120.0  # s on the clock, where others keep the processors busy; chosen
NUMBER = re.compile(rb"(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?(?![\w.])")
# what stands for a value
ODD = (
    *(b"0", b"-1", b"1", b"2", b"1e9", b"-1e9", b"1e300", b"-1e300", b"5e-324", b"1e-9", b"1e-6"),
    *(b"nan", b"inf", b"-inf", b"9" * 5000, b"9" * 400, b"true", b'"1"', b'""', b"'x'", b"0x7f"),
    *(b"[]", b"{}", b"[1]", b"[" * 3000, b"[1, [2]]", b"{a = 1}", b"1979-05-27", b"", b"7" * 17),
    *(
        b'"../../../etc/passwd"',
        b'"\\u0000"',
        b'"[/bold]"',
        b'"\x1b[2J"',
        b"1_0",
        b"03",
        b"1e",
        b"\xff",
    ),
)
ALIEN = (
    b"",
    b"\n",
    b"\0",
    b'"',
    b"'",
    b"[",
    b"]",
    b"{",
    b"}",
    b"=",
    b",",
    b".",
    b"#",
    b"\xff\xfe",
    b"\r",
)


@dataclass
class Outcomes:
    """Counts by kind and outcome, and the faults."""

    counts: Counter[tuple[str, str]] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        kinds = sorted({kind for kind, _ in self.counts})
        lines = [
            f"{kind}: "
            + ", ".join(f"{n} {o}" for (k, o), n in sorted(self.counts.items()) if k == kind)
            for kind in kinds
        ]
        return "\n".join([*lines, f"{len(self.faults)} faults", *self.faults[:20]])


class Hang(BaseException):
    """The watchdog: no ``except Exception`` may hold it."""


def mutated(data: bytes, draw: random.Random, text: bool) -> bytes:
    """One to three changes of ``data``."""
    for _ in range(draw.choice((1, 1, 1, 2, 3))):
        data = _changed(data, draw, text)
    return data


def _changed(data: bytes, draw: random.Random, text: bool) -> bytes:
    size = max(1, len(data))
    at, until = sorted((draw.randrange(size), min(size, draw.randrange(size) + 1)))
    lines = data.splitlines(keepends=True) or [b""]
    line, other = draw.randrange(len(lines)), draw.randrange(len(lines))
    match draw.randrange(14 if text else 5):
        case 0:  # a bit
            changed = bytearray(data or b"\0")
            changed[min(at, len(changed) - 1)] ^= 1 << draw.randrange(8)
            return bytes(changed)
        case 1:
            return data[:at]
        case 2:
            return data[:at] + data[until:]
        case 3:
            return data[:at] + draw.choice(ALIEN) + data[at:]
        case 4:
            return data[:until] + data[at:]
        case 5:
            del lines[line]
        case 6:
            lines[line], lines[other] = lines[other], lines[line]
        case 7:
            lines.insert(line, lines[other])
        case _:
            found = list(NUMBER.finditer(data))
            if found:
                one = draw.choice(found)
                near = repr(float(one[0]) * draw.choice((-1, 0.5, 2, 10, 0.1, 1e3, 1e-3))).encode()
                odd = draw.choice(ODD) if draw.random() < 0.4 else near
                return data[: one.start()] + odd + data[one.end() :]
    return b"".join(lines)


def run(kinds: list[Kind], count: int, seed: int, folder: Path) -> Outcomes:
    """``count`` mutants, kinds and files in turn."""
    found = Outcomes()
    clocks = {signal.SIGPROF: signal.ITIMER_PROF, signal.SIGALRM: signal.ITIMER_REAL}
    before = {number: signal.signal(number, _bark) for number in clocks}
    for number in range(count):
        kind = kinds[number % len(kinds)]
        draw = random.Random(f"{seed} {number}")
        sound = draw.choice(kind.files)
        content = sound.read_bytes()
        place = folder / kind.name
        file = place / sound.name
        file.write_bytes(mutated(content, draw, kind.text))
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        signal.setitimer(signal.ITIMER_REAL, _WAITED)
        try:
            outcome = kind.use(file)
        except TrajoptError as error:
            outcome = "refused"
            if "\n" in str(error) or len(str(error)) > 2000:
                found.faults.append(
                    f"{kind.name} {number} {sound.name}: told in {str(error)[:200]!r}"
                )
        except (Exception, Hang) as error:
            outcome = "FAULT"
            where = traceback.extract_tb(error.__traceback__)[-1]
            told = f"{type(error).__name__}: {error} ({where.filename}:{where.lineno})"
            found.faults.append(f"{kind.name} {number} {sound.name}: {told[:300]}")
        finally:
            for clock in clocks.values():
                signal.setitimer(clock, 0)
            file.write_bytes(content)  # other mutants may need the sound one
        found.counts[kind.name, outcome] += 1
    for number, handler in before.items():
        signal.signal(number, handler)
    return found


def _bark(*_: object) -> None:
    raise Hang(f"more than {SECONDS} s")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    with tempfile.TemporaryDirectory(prefix="trajopt-fuzz-") as name:
        kinds = all_kinds(Path(name))
        run(kinds, 300, options.seed + 1, Path(name))  # loads what is loaded when first used
        used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + BYTES, used + BYTES))
        started = time.monotonic()
        found = run(kinds, options.count, options.seed, Path(name))
    print(found)
    print(f"{options.count} mutants in {time.monotonic() - started:.0f} s")
    return 1 if found.faults else 0


if __name__ == "__main__":
    sys.exit(main())
