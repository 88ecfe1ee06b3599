"""Browser pages that need neither network nor server: a motion in 3D, a sweep, a comparison of optimizers.

Python writes compact data into pages that ``viewer/`` at the top of the repository builds.
Public: ``motion_page.write_view``.
"""
