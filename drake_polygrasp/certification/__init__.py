"""Does it hold? Mathematics alone; nothing here knows how a grasp was found, or a file or plant.

| file | what it holds |
|---|---|
| exact.py | proves force closure from a few numbers in exact arithmetic, with the standard library alone |
| convex.py | finds the forces and twists that `exact` checks |
| contact_regions.py | finds one internal force for regions of contacts, and the largest discs |
| certify.py | proves grasps, and says of those that hold how well they do |
| robustness.py | epsilon and the tolerances: how much more than the minimum a grasp withstands |
| holding_forces.py | contact forces that hold the object against a load |
"""  # noqa: E501 - a table
