"""From a plan and measurements to commands; noise is drawn in ``simulate``.

Public: ``tracking.Tracker``, ``approach.approach_controller``, ``replan``, ``commands``.
"""
