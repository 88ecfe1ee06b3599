"""Numbers printed in [udengaard2008] (active split offset casters), for comparison only."""

from __future__ import annotations

# Table I: (ASOCs, without contact, with partial contact) -> isotropy
TABLE_1: dict[tuple[int, int, int], float] = {
    (2, 0, 0): 1.000,
    (2, 0, 1): 0.464,
    (2, 0, 2): 0.000,
    (3, 0, 0): 1.000,
    (3, 0, 1): 0.706,
    (3, 0, 2): 0.504,
    (3, 0, 3): 0.270,
    (3, 1, 0): 0.577,
    (3, 1, 1): 0.367,
    (3, 1, 2): 0.000,
    (4, 0, 0): 1.000,
    (4, 0, 1): 0.791,
    (4, 0, 2): 0.656,
    (4, 0, 3): 0.544,
    (4, 0, 4): 0.399,
    (4, 1, 0): 0.707,
    (4, 1, 1): 0.574,
    (4, 1, 2): 0.482,
    (4, 1, 3): 0.259,
    (4, 2, 0): 0.414,
    (4, 2, 1): 0.265,
    (4, 2, 2): 0.000,
}

# Table II: largest terrain angle, deg (column unreadable in the scan; inferred) -> isotropy, best
# ratio
TABLE_2: dict[int, tuple[float, float]] = {
    0: (1.000, 2.00),
    15: (0.987, 2.05),
    30: (0.950, 2.27),
    45: (0.895, 2.70),
}

# Figures 9 and 11, read off: split/offset -> isotropy; module spacing, deg -> isotropy
FIGURE_9: dict[float, float] = {1.0: 0.58, 1.5: 0.79, 2.0: 1.0, 2.5: 0.83, 3.0: 0.72}
FIGURE_11: dict[float, float] = {120: 1.0, 90: 0.707, 60: 0.447, 30: 0.216, 0: 0.0}

# Table IV: ASOCs -> change of K, beta_max, h, d_max, S against three, percent
TABLE_4: dict[int, tuple[float, ...]] = {
    4: (-0.4, -1.3, -6.1, -38.8, 94.9),
    5: (-2.2, 16.2, -60.9, -52.9, 161.4),
}

# Table V: soil -> offset, split, radius, width, m
TABLE_5: dict[str, tuple[float, float, float, float]] = {
    "dry_sand": (0.144, 0.325, 0.148, 0.090),
    "sandy_loam": (0.134, 0.306, 0.139, 0.126),
    "clayey_soil": (0.134, 0.306, 0.139, 0.133),
    "snow": (0.144, 0.325, 0.148, 0.054),
}

# Table VI: soil -> gain of d_max over the baseline, percent
TABLE_6: dict[str, float] = {"dry_sand": 18.1, "sandy_loam": 35.2, "clayey_soil": 31.9, "snow": 3.3}

# Table IX: sigma, cm -> RMS error, percent of body length
TABLE_9: dict[float, float] = {0.0: 8.67, 1.5: 8.89, 3.0: 10.48, 4.5: 11.59}

# Table X: (absolute position, ground known) -> RMS error, percent of body length
TABLE_10: dict[tuple[bool, bool], float] = {
    (True, True): 6.96,
    (True, False): 17.71,
    (False, True): 21.28,
    (False, False): 86.31,
}
