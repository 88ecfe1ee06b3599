"""One MCAP file, for Foxglove and all that reads MCAP: what ``rosbag`` writes, without its folder."""

from __future__ import annotations

import tempfile
from pathlib import Path

from trajopt.files import whole_file
from trajopt.formats import rosbag
from trajopt.timing.trajectory import Trajectory


def write(trajectory: Trajectory, file: Path, sample_time: float) -> int:
    """As ``rosbag.write``."""
    with tempfile.TemporaryDirectory() as folder:
        count = rosbag.write(trajectory, Path(folder) / "bag", sample_time)
        with whole_file(file) as part:
            part.write_bytes((Path(folder) / "bag" / "bag.mcap").read_bytes())
    return count
