"""Files of other programs: motions and robots out, robots and race lines in.

One file a format, one line a format in ``FORMATS``. Public: ``export`` (a timed motion, or its
robot, as a file), ``FORMATS``, ``format_of``, ``read_robot`` (URDF and MJCF), ``write_robot``.
"""

from trajopt.formats.registry import FORMATS, export, format_of, read_robot, write_robot

__all__ = ["FORMATS", "export", "format_of", "read_robot", "write_robot"]
