"""What only [waheed2006] needs: its variants of limits, encounters, and drives in physics.

Public: ``limits``, ``drive.drive_plan``, ``drive_encounter``; ``entry`` serves the sections
[printed] and [[encounters]].
"""
