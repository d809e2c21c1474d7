"""Verifies grasp files without the planner.

| file | what it holds |
|---|---|
| verify.py | `verify_file`: proves, recomputes, or says what was not checked |
| numbers.py | whether the numbers of a grasp bear out what its file states of them |
| stated_model.py | the model that a file names, found and loaded with the options stated |
| report.py | what a verification finds, as values |
| plant_results.py | a copy of a grasp file with the verdicts of a plant |
"""
