"""Does it hold? One question, several answers; nothing here knows how a grasp was found.

`exact` proves force closure from a few numbers in exact arithmetic, with the standard library
alone; `convex` finds what it checks; `wrench_space` says how much more than the minimum a grasp
can take; `certify` puts them together.
"""
