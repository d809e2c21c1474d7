"""Numbers that geometry is compared with: below them, a difference is noise or rounding."""

from __future__ import annotations

ANGLE_TOLERANCE = 1e-9
"""[rad], ours: what is smaller than this is a rounding error of a unit vector."""
LENGTH_TOLERANCE = 1e-9
"""Times the diameter L, ours: what is shorter is a rounding error of a coordinate."""
SAME_NORMAL = 1e-6
"""[rad], ours: normals within this are one normal."""
FLATNESS = 1e-5
"""Times the diameter L, ours: vertices this near a plane lie in it. Mesh files often carry six
decimals, which leaves half a micrometre of noise per coordinate on objects of a decimetre."""
ON_SURFACE = 1e-6
"""Times the diameter L, ours: a tenth of a micrometre on a decimetre."""
