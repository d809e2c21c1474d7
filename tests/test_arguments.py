"""Wrong arguments of public functions are one clear line of ours, whatever they are."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydrake.geometry import Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex

import drake_polygrasp
from drake_polygrasp import (
    NO_ERRORS,
    CertifiedGrasp,
    Grasp,
    GraspForces,
    PolygraspError,
    UsageError,
    certify_in_plant,
    contact_poses,
    explain_sets,
    load_grasps,
    load_object,
    object_from_plant,
    obstacles_from_plant,
    plan_grasps,
    rank_in_plant,
    save_grasps,
    surroundings_from_plant,
)
from drake_polygrasp.arguments import check_array, check_count, check_number, check_path
from drake_polygrasp.arrays import frozen
from drake_polygrasp.files.stated_grasp import StatedPlan
from tests.hands.test_model import THREE_FINGER
from tests.loading.test_plant_objects import CUBE, anchored, world
from tests.support.grasp_files import write_box
from tests.support.hands import own_hand, own_hand_grasps
from tests.support.plant_scenes import cube_grasp, model, top_grasp


class Unprintable:
    """Nobody's argument, whose text runs over several lines."""

    def __repr__(self) -> str:
        return "<one\ntwo>"


WRONG: dict[str, Any] = {
    "None": None,
    "an integer": 3,
    "an enormous integer": 10**400,
    "zero": 0,
    "a negative number": -1.5,
    "NaN": math.nan,
    "infinity": math.inf,
    "True": True,
    "text": "0.5",
    "no text": "",
    "a long text": "x" * 5000,
    "a null character": "a\0b",
    "bytes": b"cube.sdf",
    "a list": [],
    "a list of lists": [[1, [2]]],
    "a mapping": {},
    "a complex number": 1j,
    "an array": np.arange(4.0),
    "an array without dimensions": np.array(0.5),
    "an object": Unprintable(),
    "a function": lambda *_, **__: 3,
}


@dataclass(frozen=True)
class Call:
    """A public function and arguments that it takes."""

    function: Callable[..., Any]
    arguments: dict[str, Any]


@pytest.fixture(scope="module")
def calls(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Call]:
    folder = tmp_path_factory.mktemp("calls")
    file = load_grasps(write_box(folder))
    cube, plan = model("cube"), plan_grasps(model("cube"), top=1)
    # Nothing is simulated of a grasp off the surface.
    off = replace(plan.grasps[0], grasp=replace(cube_grasp(), p_BC=cube_grasp().p_BC + 1e-3))
    scenery = world(CUBE, anchored("ball", Sphere(0.01), RigidTransform([1.0, 0.0, 0.0])))
    crate = folder / "crate.sdf"
    crate.write_text(CUBE.read_text().replace("0.06", "0.6"))
    too_large = load_object(crate)
    in_plant = {"plant": scenery.plant, "body": scenery.body, "context": scenery.context}
    settings = {
        "patch_angle": None,
        "patch_depth": None,
        "joints_free": False,
        "scale": None,
        "package_paths": (),
        "packages": None,
    }
    planned = {
        "object_": cube,
        "method": "enriched",
        "edge_clearance": None,
        "tip_radius": None,
        "avoid_directions": (),
        "exclude_faces": (),
        "obstacles": None,
        "placement_error": 0.0,
        "tilt_error": 0.0,
        "friction_error": 0.0,
        "com_error": 0.0,
    }
    held = own_hand_grasps(CUBE)[0]
    given: dict[str, dict[str, Any]] = {
        "GraspForces": {
            "object_": cube,
            "grasp": plan.grasps[0],
            "squeeze": 10.0,
            "body": BodyIndex(1),
        },
        "certify_in_plant": {
            "object_": cube,
            "grasp": off,
            "internal_force": None,
            "tip_radius": 0.002,
            "package_paths": (),
            "packages": None,
            "surroundings": None,
            "misses": None,
            "meshcat": None,
        },
        "certify_region": {
            "object_": cube,
            "grasp": off,
            "placement_error": 0.001,
            "tilt_error": 0.01,
            "friction_error": 0.1,
            "com_error": 0.001,
        },
        "check_hand": {"hand": own_hand(), "num": 20, "seed": 0},
        "contact_poses": {"grasp": off},
        "epsilon_gap": {"object_": cube, "plan": plan, "nodes": 10, "progress": None},
        "example_models": {},
        "explain_sets": {**planned, "progress": None},
        "export_directives": {
            "file": file,
            "output": folder / "out.dmd.yaml",
            "instance": None,
        },
        "iter_batch": {"sources": (), "out": folder / "batch"},
        "lift_with_hand": {
            "object_": model("cube"),
            "grasp": held.certified,
            "hand": own_hand(),
            "placement": held,
            "mu": 0.5,
            "feedforward": True,
            "package_paths": (),
            "packages": None,
            "meshcat": None,
        },
        "hand_grasp_for": {
            "object_": too_large,
            "grasp": plan_grasps(too_large, top=1, effort="quick", **NO_ERRORS).grasps[0],
            "hand": own_hand(),
            "surroundings": None,
            "up_B": None,
            "load_mass": 0.1,
            "friction_share": 0.8,
            "clearance": 0.002,
            "approach": 0.1,
            "fingers": None,
            "budget": 1.0,
            "seed": 0,
            "package_paths": (),
            "packages": None,
        },
        "load_grasps": {"path": file.path},
        "load_hand": {"description": THREE_FINGER, "package_paths": (), "packages": None},
        "load_planned_object": {"grasp_file": file.path, "package_paths": (), "packages": None},
        "load_object": {"model_file": CUBE, "body_name": None, "mu": None, **settings},
        "load_surroundings": {
            "scene_file": CUBE,
            "object_": cube,
            "mu": None,
            "package_paths": (),
            "packages": None,
        },
        "object_from_mesh": {
            "vertices": np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]]),
            "faces": np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]),
            "mu": 0.3,
            "mass": None,
            "p_BBcm": None,
            "name": "tetrahedron",
            **{key: settings[key] for key in ("patch_angle", "patch_depth")},
        },
        "object_from_plant": {
            **in_plant,
            "model_file": None,
            "body_name": None,
            "mu": None,
            **settings,
        },
        "obstacles_from_plant": {**in_plant, "ignore": (), "reach": None},
        "plan_batch": {
            "sources": (),
            "out": folder / "batch",
            "executor": None,
            "workers": None,
            "timeout": 60.0,
            "memory": 4 << 30,
            "shard": (1, 1),
            "retry": (),
            "limit": None,
        },
        "plan_hand_grasps": {
            "object_": too_large,  # which takes least time
            "hand": own_hand(),
            "top": 1,
            "surroundings": None,
            "up_B": None,
            "load_mass": 0.1,
            "avoid_directions": (),
            "exclude_faces": (),
            "edge_clearance": None,
            "friction_share": 0.8,
            "clearance": 0.002,
            "approach": 0.1,
            "fingers": None,
            "rank": "epsilon",
            "placement_error": 0.0,
            "tilt_error": 0.0,
            "friction_error": 0.0,
            "com_error": 0.0,
            "budget": 1.0,
            "seed": 0,
            "package_paths": (),
            "packages": None,
            "progress": None,
        },
        "plan_grasps": {**planned, "top": 1, "rank": None, "steps": None, "effort": "quick"},
        "rank_in_plant": {
            "object_": cube,
            "plan": replace(plan, grasps=(off,)),
            "top": None,
            "package_paths": (),
            "packages": None,
            "surroundings": None,
            "progress": None,
        },
        "save_grasps": {
            "path": folder / "new.grasp.yaml",
            "object_": cube,
            "grasps": plan.grasps,
            "plan_settings": plan.settings,
        },
        "surroundings_from_plant": {**in_plant, "ignore": ()},
        "verify_file": {
            "path": file.path,
            "package_paths": (),
            "packages": None,
            "plant": False,
            "scene": None,
            "misses": None,
            "progress": None,
        },
    }
    return {
        name: Call(getattr(drake_polygrasp, name), arguments) for name, arguments in given.items()
    }


FUNCTIONS = sorted(
    name
    for name in drake_polygrasp.__all__
    if inspect.isfunction(getattr(drake_polygrasp, name)) or name == "GraspForces"
)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_whatever_is_wrong_with_an_argument_is_one_line_of_ours(
    calls: dict[str, Call], name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # "0.5" is a fine name for a file
    call = calls[name]
    parameters = inspect.signature(call.function).parameters.values()
    known = {p.name for p in parameters if p.kind is not p.VAR_KEYWORD} - {"self"}
    assert set(call.arguments) == known, "every argument is swept, and no other"
    call.function(**call.arguments)
    for argument in call.arguments:
        for kind, value in WRONG.items():
            if argument == "nodes" and kind == "an enormous integer":
                continue  # It is a fine number of nodes, and takes as long.
            try:
                call.function(**call.arguments | {argument: value})
            except PolygraspError as error:
                assert str(error), (argument, kind)
                assert "\n" not in str(error), (argument, kind)
            except BaseException as error:
                pytest.fail(f"{argument} = {kind}: {type(error).__name__}: {error}")


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: load_object(CUBE, mu="0.5"), "is '0.5'; it must be above 0 and at most 100"),  # type: ignore[arg-type]
        (lambda: load_object(b"x"), "model_file is b'x'; it must be a path, as text or"),  # type: ignore[arg-type]
        (
            lambda: load_object(CUBE, package_paths="models"),
            "package_paths is 'models'; it must be a list of paths: put it in brackets",
        ),
        (
            lambda: plan_grasps(model("cube"), top=2.5),  # type: ignore[arg-type]
            "top is 2.5; it must be a whole number and at least 1",
        ),
        (
            lambda: plan_grasps(model("cube"), exclude_faces=3),  # type: ignore[arg-type]
            "exclude_faces is 3; it must be a list",
        ),
        (
            lambda: plan_grasps(CUBE),  # type: ignore[arg-type]
            "object_ is a PosixPath; it must be a GraspObject, as load_object returns it",
        ),
        (
            lambda: plan_grasps(model("cube"), tip_radius="3 mm"),  # type: ignore[arg-type]
            "tip_radius is '3 mm'; it must be a length in metres, 0 or more",
        ),
        (
            lambda: plan_grasps(model("cube"), tilt_error=-0.1),
            "tilt_error is -0.1; it must be an angle in radians, from 0 to 1.5",
        ),
        (
            lambda: plan_grasps(model("cube"), friction_error=1),
            "friction_error is 1; it must be a share of the friction coefficient, from 0 to below",
        ),
        (
            lambda: GraspForces(model("cube"), cube_grasp(), "10", BodyIndex(1)),  # type: ignore[arg-type]
            "squeeze is '10'; it must be a force above 0 N",
        ),
        (
            lambda: save_grasps("x", model("cube"), [cube_grasp()], StatedPlan()),  # type: ignore[list-item]
            "it must be a CertifiedGrasp, as plan.grasps holds them",
        ),
        (
            lambda: certify_in_plant(model("cube"), "best", tip_radius=0.0),  # type: ignore[arg-type]
            "the grasp is a str; it must be a Grasp, or a CertifiedGrasp",
        ),
    ],
)
def test_messages_say_what_the_argument_is_and_must_be(call: Callable[[], Any], said: str) -> None:
    with pytest.raises(UsageError) as caught:
        call()
    assert said in str(caught.value)


def test_what_is_of_the_model_file_is_refused_without_one() -> None:
    with pytest.raises(UsageError, match="scale is of model_file"):
        object_from_plant(*world(CUBE).asked, scale=2.0)
    with pytest.raises(UsageError, match="packages is 3"):
        object_from_plant(*world(CUBE).asked, packages=3)  # type: ignore[arg-type]


def test_a_body_may_be_given_by_its_name_or_index() -> None:
    scenery = world(CUBE)
    plant, body, context = scenery.asked
    by_body = object_from_plant(plant, body, context)
    for given in ("cube", "cube::cube", body.index()):
        assert object_from_plant(plant, given, context).rho == by_body.rho
        assert obstacles_from_plant(plant, given, context).names == ()
        assert surroundings_from_plant(plant, given, context).names == ()
    with pytest.raises(UsageError, match=r"no body of the plant is called 'mug'; it has 'cube::"):
        object_from_plant(plant, "mug", context)


def test_a_name_of_several_bodies_has_to_be_told_apart() -> None:
    def add_another(plant: MultibodyPlant) -> None:
        parser = Parser(plant, model_name_prefix="other")
        parser.AddModels(str(CUBE))

    plant, _, context = world(CUBE, add_another).asked
    with pytest.raises(UsageError, match=r"several bodies .* 'cube::cube', 'other::cube::cube'"):
        object_from_plant(plant, "cube", context)
    assert object_from_plant(plant, "other::cube::cube", context).mass == pytest.approx(0.1512)


def test_a_certified_grasp_is_as_good_as_a_grasp(tmp_path: Path) -> None:
    certified, tip_radius = top_grasp("cube")
    assert isinstance(certified, CertifiedGrasp)
    for one, other in zip(contact_poses(certified), contact_poses(certified.grasp), strict=True):
        assert one.IsExactlyEqualTo(other)
    save_grasps(
        tmp_path / "x.grasp.yaml",
        model("cube"),
        [certified],
        StatedPlan({"tip_radius": tip_radius}),
    )
    (stated,) = load_grasps(tmp_path / "x.grasp.yaml").grasps
    for one, other in zip(contact_poses(certified), contact_poses(stated), strict=True):
        assert one.IsExactlyEqualTo(other)
    GraspForces(model("cube"), stated, 10.0, world(CUBE).body)


@pytest.mark.parametrize(
    "change",
    [
        {"p_BC": np.zeros((3, 2))},
        {"p_BC": [[0, 0, 0]] * 3},
        {"mu": frozen([0.3, math.nan, 0.3])},
        {"nhat_TB_B": frozen(np.full((3, 3), math.inf))},
        {"nhat_TB_B": frozen(np.zeros((3, 3)))},
        {"nhat_TB_B": frozen(2 * np.eye(3))},
        {"mu": frozen(np.zeros(3))},
        {"p_BC": frozen(np.full((3, 3), 1e300))},
    ],
)
def test_arrays_of_a_grasp_are_checked(change: dict[str, Any]) -> None:
    wrong: Grasp = replace(cube_grasp(), **change)
    with pytest.raises(UsageError, match=next(iter(change))):
        contact_poses(wrong)


def test_numbers_of_any_kind_are_numbers() -> None:
    for value in (0.5, np.float32(0.5), np.float64(0.5), np.array(0.5)):
        assert check_number("x", value, "a number") == 0.5
    assert check_count("n", np.int32(3)) == 3
    assert check_path("p", Path("a")) == Path("a")
    assert check_array("a", [1, 2, 3], (3,)).tolist() == [1.0, 2.0, 3.0]
    assert rank_in_plant(model("cube"), replace(plan_grasps(model("cube")), grasps=())).grasps == ()


def test_a_clearance_that_leaves_no_face_leaves_no_set() -> None:
    for method in ("paper", "enriched"):
        plan = plan_grasps(model("cube"), edge_clearance=3.0, method=method)  # type: ignore[arg-type]
        assert (plan.num_sets, plan.grasps) == (0, ())
        assert explain_sets(model("cube"), edge_clearance=3.0).reasons == []
