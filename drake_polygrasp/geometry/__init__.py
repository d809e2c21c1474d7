"""The exposed surface of a body, and contacts on it.

Points are in the body frame B. L is the diameter of the body: the greatest distance between two
vertices. A patch is a near-planar part of a curved or scanned surface, planned on like a face.

| file | what it holds |
|---|---|
| tolerances.py | tolerances below which differences are rounding errors or noise |
| triangles.py | normals, frames and distances of triangles |
| needles.py | bounding boxes of triangles, long and narrow ones too |
| triangle_soup.py | triangles near points, and winding numbers |
| face_triangles.py | triangulation of mesh faces with more than three corners |
| shells.py | triangles welded into closed shells, oriented outward |
| open_shells.py | which open shells face inward, by solid angles |
| two_sided.py | which triangles at an edge face one another, where faces are two-sided |
| sections.py | the part of a plane that shells cover |
| cavities.py | cavities that the parts of a body seal |
| primitives.py | spheres, ellipsoids, cylinders and capsules in closed form |
| inradius.py | the radius of the largest disc in a polygon |
| polygons.py | unions, insets and clean-up of polygons |
| polyhedron.py | the exposed surface as faces and patches |
| surface.py | the polyhedron built from collision triangles |
| patches.py | near-planar patches of curved and noisy surfaces |
| face_contacts.py | contacts on planar faces: projection onto their triangles |
| facets.py | contacts on patches: the facets and curved solids under them |
| regions.py | the eroded regions of faces that contacts may use: the paper's A_i |
| face_sets.py | sets of two or three regions: all of them, their keys and their rows |
| surface_contact.py | contacts projected onto the surface or located on it, room for fingertips |
| surface_pieces.py | convex pieces of the true surface, and polygons that contain a disc |
| curved_pieces.py | convex pieces of curved solids around a contact |
| visible_facets.py | facets that a fingertip may touch first when it misses a contact |
| face_pieces.py | polygons on planar faces where fingertips may land, for many contacts |
| landing_points.py | a few points where a fingertip may land when it misses a contact |
| placement_regions.py | the surface that a fingertip may touch when it misses a contact |
| exclusion.py | faces and directions that the user excludes from contact |
| obstacles.py | solids around a body that fingertips must not touch |
| body_identity.py | whether two bodies are the same |
"""
