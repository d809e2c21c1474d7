"""The grasp file: written and read, nothing in it proved; free of Drake.

| file | what it holds |
|---|---|
| grasp_file.py | writes and reads the whole file: `save_grasps`, `load_grasps` |
| stated_grasp.py | what a file states, as values |
| plain_yaml.py | reads plain YAML from anyone, each refusal naming its place |
| plan_block.py | the plan block: what repeats the plan |
| plant_block.py | the plant block: the verdicts of a plant |
"""
