"""The models that come with the package are all of ours, and each can be loaded."""

from __future__ import annotations

from drake_polygrasp import example_models, load_object
from tests.support.planned import MODELS


def test_examples_are_the_models_of_the_repository() -> None:
    found = example_models()
    assert set(found.values()) == set(MODELS)
    assert all(file.parent.name == name for name, file in found.items())
    assert len(load_object(found["cube"]).polyhedron.faces) == 6
