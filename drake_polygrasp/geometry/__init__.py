"""The exposed surface of a body, pure: what fingers can touch, and where they touch it.

`surface` merges the triangles of closed `shells` into the faces of a `polyhedron` and cuts away
what other shells cover (`sections`) or seal (`cavities`); curved and noisy bodies become `patches`,
and curved `primitives` are planned on inscribed polyhedra. `seating` brings contacts to the true
surface (`facets`) and says whether a fingertip fits there; `triangles` and `inradius` measure.
Where no finger may be though it could is `exclusion` and `obstacles`.
"""
