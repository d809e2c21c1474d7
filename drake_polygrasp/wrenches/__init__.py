"""What three frictional point contacts can do to an object, for many grasps at once.

A wrench is (force, torque about the centre of mass / rho), six numbers of one unit, where rho [m]
is the greatest distance from the centre of mass to the surface. W is the convex hull of the
wrenches that the contacts apply with normal forces that add up to 1. h(w), the support function of
W, is the greatest w . x over x in W. epsilon is the least h(w) over unit w: the largest wrench that
the grasp withstands in every direction (Ferrari & Canny, 1992).

| file | what it holds |
|---|---|
| contacts.py | the contact triangle, frames of contacts, internal forces, and force closure in closed form |
| support.py | the wrenches that span W, and h(w) |
| facet_twists.py | the twists w in whose supporting facet of W lies the whole friction disc of one contact |
| epsilon_bound.py | upper bounds of epsilon, and the directions in which W reaches least far |
| region_support.py | the least h(w) where contacts, normals and the centre of mass may be off |
| epsilon_estimate.py | upper bounds of epsilon in single precision, at a few microseconds a grasp |
"""  # noqa: E501 - a table
