"""The fastest motion along a path.

Public: ``scaling.time_scale``, ``trajectory.Trajectory`` and ``State``; engines are registered in
``engines``.
"""
