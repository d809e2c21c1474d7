"""Writes and reads the grasp file, without Drake and without checking that what it states is true.

| file | what it holds |
|---|---|
| grasp_file.py | writes and reads the whole file: `save_grasps`, `load_grasps` |
| object_block.py | the object block: the model, and what was loaded from it |
| region_block.py | the region block: the errors that a grasp bears |
| plan_block.py | the plan block: the settings of the plan |
| hand_block.py | the hand block of a file, and of a grasp: how a hand holds it |
| plant_block.py | the plant block of a grasp: the verdicts of checks in a plant |
| region_proof_file.py | writes the proofs of bounds over regions |
| whole_file.py | writes text files whole |
| stated_grasp.py | values for what a file states |
| plain_yaml.py | reads untrusted plain YAML, with errors that name the place |
"""
