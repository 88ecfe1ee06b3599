"""Climbing steps on semi-circular Mecanum double wheels [guzman2015].

Public: ``planner.plan_climb``, ``configurations``, ``trials``; ``entry`` serves the section
[climb], ``commands`` the command line.
"""
