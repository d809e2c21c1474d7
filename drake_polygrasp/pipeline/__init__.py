"""Plans grasps: candidates of the paper and of the search are proved, ranked and certified.

| file | what it holds |
|---|---|
| request.py | an object and validated options: `PlanRequest` |
| friction_left.py | the friction that errors of tilt and friction leave to plan with |
| proposals.py | candidates of the paper and of the search, before any is proved |
| candidates.py | projects candidates onto the true surface |
| judge.py | proves candidates, and keeps their outcomes and proofs |
| judging.py | chooses which candidates are proved, and in which order |
| longer_search.py | adds candidates if fewer grasps are found than asked for |
| freed_memory.py | keeps memory that planning frees and needs again |
| region_certificates.py | certifies the errors that a grasp bears |
| region_proofs.py | states the proofs of bounds under errors |
| error_levels.py | chooses the errors that grasps are stated to bear |
| fallback.py | plans with less of the default errors, where too few grasps may bear them |
| ranking.py | puts proved candidates in order and certifies the best |
| plan.py | `plan_grasps` |
| explain.py | `explain_sets`: what became of every set of faces |
| hand_candidates.py | proposes and proves grasps that a hand may reach |
| hand_options.py | the options of a hand's grasps, checked |
| hand_errors.py | proves the errors that grasps of a hand bear, and squeezes as they ask for |
| one_hand_grasp.py | `hand_grasp_for`: how a hand makes a grasp that is there already |
| hand_plan.py | the plan of a hand, and why candidates are refused, in words |
| hand_grasps.py | `plan_hand_grasps` |
| plant_ranking.py | `rank_in_plant`: ranks the grasps of a plan by the verdicts of a plant |
"""
