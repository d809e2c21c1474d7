"""Bounds what grasps withstand wherever contacts are in their regions, with all errors at once.

| file | what it holds |
|---|---|
| region_task.py | a grasp and the errors under which its bounds are sought |
| region_epsilon.py | bounds epsilon and the squeeze force for all placements in regions |
| region_proof.py | states proofs of bounds over regions as plain data |
| side_by_side.py | runs searches of several grasps so that they share array work |
| ranging_contacts.py | contacts that may be anywhere in their regions, and their friction cones |
| swept_generators.py | forces that serve contacts all over their regions |
| first_facets.py | finds surfaces to begin with: hulls near to what contacts reach |
| simplex_cycle.py | works on closed surfaces of simplices of wrenches |
| swept_facets.py | raises what a surface of facets proves, by better facets |
| steepest.py | finds a good twist for each facet |
| best_forces.py | finds the force that pairs most with a twist all over a region |
| load_norm.py | measures twists by the loads that are to be withstood |
| worst_placement.py | finds the placement in regions that withstands least |
| ceiling.py | bounds from above what a surface of facets may prove |
| contest.py | ends searches for bounds that cannot be as great as is asked |
"""
