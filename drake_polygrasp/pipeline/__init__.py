"""From a request to proved, ranked grasps: the one room that knows paper, search and certificate.

| file | what it holds |
|---|---|
| request.py | what to plan for, checked |
| friction_left.py | the friction that errors of tilt and friction leave to plan with |
| proposals.py | candidates of the paper and of the search, before any is proved |
| candidates.py | candidates projected onto the true surface |
| judge.py | what becomes of them, and the proofs of those that hold |
| judging.py | which candidates are proved, and in which order |
| longer_search.py | goes on where fewer grasps are found than wanted |
| freed_memory.py | keeps the memory that a plan frees |
| region_certificates.py | certifies the errors that a grasp bears |
| ranking.py | puts proved candidates in order and certifies the best |
| plan.py | `plan_grasps` |
| explain.py | `explain_sets`: what became of every set of faces |
| plant_ranking.py | `rank_in_plant`: ranks the grasps of a plan by the verdicts of a plant |
"""
