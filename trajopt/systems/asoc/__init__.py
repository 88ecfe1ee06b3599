"""The robot on active split offset casters [udengaard2008].

Public: ``modules`` (geometry and ``asoc_robot``), ``isotropy``, ``design``, ``tracking``, ``run``.
"""
