"""Control points -> cost, violation and named terms.

Public: ``terminal.terminal_objective``, ``duration.DurationObjective``,
``clearance.ClearObjective``, ``route``; ``base`` holds what an objective may offer.
"""
