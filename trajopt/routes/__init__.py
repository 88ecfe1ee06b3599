"""From a start to a goal among obstacles: routes in different ways around, least time or length.

Public: ``plan.plan_route``, ``plan.Route``.
"""
