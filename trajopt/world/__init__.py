"""What a robot drives on and among.

Public: ``scene.Scene``, shapes of the ground (``terrain.Flat``, ``ramp.Ramps``,
``height_map.HeightMap``) and of obstacles (``obstacles``).
"""
