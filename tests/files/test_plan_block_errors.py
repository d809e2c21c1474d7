"""The errors that a plan states are numbers, or the file is refused and says where."""

from __future__ import annotations

import pytest

from drake_polygrasp.errors import GraspFileError
from drake_polygrasp.files.grasp_file import load_grasps
from drake_polygrasp.settings import ERROR_NAMES
from tests.support.grasp_files import edit, write_box


@pytest.mark.parametrize("name", ERROR_NAMES)
@pytest.mark.parametrize("value", [-0.001, "0.001", True, None, [0.001], float("nan")])
def test_an_error_that_is_no_length_share_or_angle_is_refused(tmp_path, name, value):
    file = write_box(tmp_path)
    edit(file, lambda document: document["plan"].__setitem__(name, value))
    with pytest.raises(GraspFileError, match=f"plan.{name}"):
        load_grasps(file)


@pytest.mark.parametrize("name", ERROR_NAMES)
def test_errors_of_0_and_above_are_read(tmp_path, name):
    file = write_box(tmp_path)
    for value in (0, 0.001):
        edit(file, lambda document, value=value: document["plan"].__setitem__(name, value))
        assert load_grasps(file).plan.stated[name] == value
