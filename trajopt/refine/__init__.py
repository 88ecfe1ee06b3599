"""Programs on top of time scaling, solved by IPOPT.

Public: ``jerk.limit_jerk``, ``path.optimize_path``, ``profile.follow``.
"""
