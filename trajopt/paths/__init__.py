"""Splines and what limits see of them.

Public: ``path.Path`` (``Path.through``) and ``samples.sample_path``.
"""
