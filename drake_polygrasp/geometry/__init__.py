"""The exposed surface of a body, pure: what fingers can touch, and where they touch it.

| file | what it holds |
|---|---|
| tolerances.py | what is small enough to be rounding or noise |
| triangles.py | normals, frames and distances of triangles |
| needles.py | bounding boxes of triangles, long and narrow ones too |
| triangle_soup.py | the triangles near points, and winding numbers |
| face_triangles.py | triangles of mesh faces of more than three corners |
| shells.py | triangles welded into closed shells, oriented outward |
| sections.py | what shells cover of a plane |
| cavities.py | rooms that the parts of a body seal |
| primitives.py | spheres, ellipsoids, cylinders and capsules in closed form |
| inradius.py | the largest disc inside a polygon |
| polyhedron.py | faces of the exposed surface, and the body they bound |
| surface.py | from collision triangles to that polyhedron |
| patches.py | near-planar patches of curved and noisy surfaces |
| facets.py | the facets and curved solids under patches |
| regions.py | the eroded regions of faces that contacts may use: the paper's A_i |
| face_sets.py | sets of two or three regions: all of them, their keys and their rows |
| surface_contact.py | contacts brought to the true surface, and room for a fingertip there |
| surface_pieces.py | convex pieces of the true surface, and polygons around discs |
| curved_pieces.py | pieces of curved solids around a contact |
| visible_facets.py | facets that a fingertip may touch first |
| placement_regions.py | where a fingertip lands that misses its contact |
| exclusion.py | faces and directions that contacts avoid |
| obstacles.py | what stands around a body and leaves fingertips no room |
| body_identity.py | what tells one body from another |
"""
