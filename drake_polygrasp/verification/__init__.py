"""Checks grasp files without the planner.

| file | what it holds |
|---|---|
| verify.py | `verify_file`: forces proved, contacts compared with the model, numbers recomputed |
| numbers.py | compares stated numbers with recomputed ones; needs no model |
| surface.py | compares stated contacts with the model's surface |
| hand.py | whether a hand holds a grasp as stated, from its own model |
| region.py | whether the errors that a grasp bears are proved, and cover the surface |
| stated_model.py | the model that a file names, found and loaded with the options stated |
| report.py | the results of a verification, as values |
| plant_results.py | writes a copy of a grasp file with the verdicts of a plant |
"""
