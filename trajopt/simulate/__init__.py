"""Physics: a robot's description built as links and joints, and driven in any engine.

Public: ``check.validate`` (drive a trajectory in a scene), ``stepping.drive`` (drive commands or a
controller), ``stepping.open_session`` (a running simulation), ``build.build`` (robot to model),
``engine.ENGINES``, ``sensors.Sensors``. Engines import their package when they are first used.
"""
