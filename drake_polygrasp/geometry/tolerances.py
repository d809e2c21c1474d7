"""Tolerances of geometry: smaller differences are rounding errors or noise in the model."""

from __future__ import annotations

ANGLE_TOLERANCE = 1e-9
"""[rad], our choice: smaller angles are rounding errors of unit vectors."""
LENGTH_TOLERANCE = 1e-9
"""Times the diameter L, our choice: shorter lengths are rounding errors of coordinates."""
SAME_NORMAL = 1e-6
"""[rad], our choice: normals that differ by less are equal."""
FLATNESS = 1e-5
"""Times the diameter L, our choice: vertices this near a plane lie in it. Coordinates in mesh files
often have six decimals, hence errors of half a micrometre on objects of a decimetre."""
ON_SURFACE = 1e-6
"""Times the diameter L, our choice: points this near the surface are on it. That is a tenth of a
micrometre on an object of a decimetre."""
UPRIGHT = 1e-6
"""Our choice: facets of a smaller cosine to a contact's normal are walls, seen as lines."""
