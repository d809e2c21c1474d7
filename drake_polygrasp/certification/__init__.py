"""Does it hold? One question, several answers; nothing here knows how a grasp was found.

`exact` proves force closure from a few numbers in exact arithmetic, with the standard library
alone; `convex` finds what it checks; `wrench_space` says how much more than the minimum a grasp
can take; `certify` puts them together. `holding` finds the contact forces against a load;
`geometry`, `statics` and `simulation` have a plant of Drake's hold the object (`scratch_plant`);
`in_plant` sets mathematics and plant side by side.
"""
