"""Optimizers under one contract.

Public: ``search.minimize``, ``base.Budget``, ``base.OptimizeResult``; a method is one file and one
registry line, or a plugin (``plugins``).
"""
