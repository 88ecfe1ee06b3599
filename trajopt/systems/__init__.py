"""Robots with a planner, objective or page of their own, a folder each; generic rooms reach them by
one registry line.
"""
