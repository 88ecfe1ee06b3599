"""Limits of a motion, one file a limit: rows that are linear in (s'', s'^2).

Public: the classes (``Speed``, ``Acceleration``, ``Slip``, ``Tip``, ...) and ``Rows`` with the
``Limit`` protocol in ``limit``, for limits of one's own; ``registry`` knows them by name.
"""
