"""Wrenches that three frictional point contacts can apply to an object, for batches of grasps.

Contacts are hard points with Coulomb friction and the exact quadratic friction cone.

- A wrench is (force, torque about the centre of mass / rho): six components with the unit of a
  force. rho [m] is the greatest distance from the centre of mass to the surface.
- The friction disc of a contact is the set of wrenches of those forces in its friction cone whose
  normal component is 1. The wrench set W is the convex hull of the three discs: the wrenches that
  the contacts apply with normal forces that sum to 1.
- h(w), the support function of W, is the greatest w . x over x in W; h_i(w) is the same for the
  disc of contact i, and h(w) is the greatest h_i(w).
- A direction w reads as a twist, (velocity of the centre of mass, rho times angular velocity):
  w . x is the power of the wrench x. With v and omega the two halves of w, the point of the object
  at r (from the centre of mass, divided by rho) moves with u = v + omega x r, and a contact there
  with inward normal n has h_i(w) = n . u + mu |u - (n . u) n|.
- epsilon is the least h(w) over unit w: the radius of the largest ball about the origin inside W,
  hence the largest wrench that the grasp withstands in every direction with normal forces that sum
  to 1 (Ferrari & Canny, 1992).

Arrays hold M grasps: points `p_BC` [m] and inward unit normals `nhat_TB_B`, shape (M, 3, 3), one
row per contact, and friction coefficients `mu`, shape (M, 3). Results here are filters and bounds
in floating point; `certification` proves.

| file | what it holds |
|---|---|
| contacts.py | the contact triangle, contact frames, internal forces, and force closure in closed form |
| support.py | the wrenches that span W, and h(w) |
| facet_twists.py | twists w whose supporting facet of W contains the whole friction disc of one contact |
| epsilon_bound.py | upper bounds of epsilon, and the directions in which h is least |
| epsilon_estimate.py | the same bounds in single precision, a few microseconds per grasp |
| hulls.py | builds convex hulls of several sets of wrenches side by side |
| linear_systems.py | solves many small linear systems, the same on every processor |
| region_support.py | the least h(w) when contacts, normals and the centre of mass may be off |
"""  # noqa: E501 - a table
