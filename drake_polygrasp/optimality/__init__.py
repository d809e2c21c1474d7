"""How near a plan's best grasp is to the optimum.

| file | what it holds |
|---|---|
| gap.py | `epsilon_gap`: the bound, and a better grasp where one is met |
| branch_and_bound.py | bounds the best epsilon over all places on all faces |
| cell_bounds.py | bounds of epsilon wherever contacts lie in three triangular cells |
"""
