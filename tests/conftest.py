"""Settings of all tests."""

from hypothesis import settings

# The same examples in every run, and no time limit on each: machines are shared.
settings.register_profile("drake_polygrasp", deadline=None, derandomize=True)
settings.load_profile("drake_polygrasp")
