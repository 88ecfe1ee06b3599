"""What [waheed2006] prints of PowerBot beyond its sizes, which stand in
robots/data/powerbot.toml."""

from __future__ import annotations

import math

FRICTION = 0.332  # static, drive wheels on tiles (eq. A:2-6)
LARGEST_SPEED = 2.1  # m/s (eq. 2.6)
LARGEST_ACCELERATION = 0.55  # m/s^2 (eq. 2.7)
LARGEST_GRADE = math.radians(8.53)  # rad (section 2.3.2.4; 15 %)
SONAR_RANGE = 0.6  # m (section 3.6)
SCAN_TIME = 0.5  # s (section 2.3.2.6)
REACTION_TIME = 0.5  # s (section 2.3.2.6)
