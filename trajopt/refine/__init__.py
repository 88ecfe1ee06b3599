"""Programs on top of time scaling, solved by IPOPT.

Public: ``jerk.limit_jerk``, ``profile.follow``.
"""
