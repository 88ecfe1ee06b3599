"""The same sweep on every engine: the sorted tables must be equal, byte for byte.

    python -m tests.sweeps.same_table [--cases 2000] [--engines one two dask slurm dask-slurm]

Compared are all columns but those of time, host and path, as CSV bytes, and the arrays beside the
table. The last two engines need a running Slurm (``. tests/slurm/start.sh``).
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

from tests.sweeps.crashes import cases, digest
from tests.sweeps.run_functions import paced_mixed
from trajopt.sweeps.dask_engines import dask_local, dask_slurm
from trajopt.sweeps.host import CaseLimits
from trajopt.sweeps.slurm import SlurmOptions, submit
from trajopt.sweeps.store import Store, open_store
from trajopt.sweeps.sweeps import sweep, tabled

ENGINES = ("one", "two", "dask", "slurm", "dask-slurm")


def swept(engine: str, count: int, folder: Path) -> Store:
    """The store of ``count`` cases of ``paced_mixed`` (results of all kinds, arrays, some errors)
    run on ``engine``."""
    place = folder / engine
    match engine:
        case "one" | "two":
            return sweep(
                cases(count), paced_mixed, executor=1 if engine == "one" else 2, store=place
            )
        case "dask":
            return sweep(cases(count), paced_mixed, executor=dask_local(2), store=place)
        case "dask-slurm":
            return sweep(
                cases(count),
                paced_mixed,
                store=place,
                executor=dask_slurm(1, memory="1GB", directory=str(folder)),
            )
        case "slurm":
            table = tabled(cases(count), paced_mixed, None)
            submit(
                table,
                paced_mixed,
                open_store(place),
                limits=CaseLimits(60.0, 0),
                wait=True,
                case_seconds=0.05,
                options=SlurmOptions(elements=4, memory="500M"),
            )
            return open_store(place)
    raise ValueError(engine)


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cases", type=int, default=2000)
    parser.add_argument("--engines", nargs="+", choices=ENGINES, default=list(ENGINES))
    options = parser.parse_args()
    found = set()
    with tempfile.TemporaryDirectory(prefix="trajopt-same-") as folder:
        for engine in options.engines:
            started = time.monotonic()
            store = swept(engine, options.cases, Path(folder))
            table = digest(store)
            found.add(table)
            print(
                f"{engine:10s} {table}  {store.counts()}, {len(store.parts())} parts, "
                f"{time.monotonic() - started:.1f} s",
                flush=True,
            )
    print("all equal" if len(found) == 1 else "NOT EQUAL")
    return 0 if len(found) == 1 else 1


if __name__ == "__main__":
    sys.exit(main())
