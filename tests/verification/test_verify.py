"""A grasp file that tells the truth is borne out; one spoilt anywhere is refused."""

from __future__ import annotations

import copy
import math
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drake_polygrasp.arrays import frozen
from drake_polygrasp.certification.robustness import GRAVITY, epsilon_interval
from drake_polygrasp.errors import GraspFileError, ModelError
from drake_polygrasp.files.grasp_file import grasp_document, save_grasps
from drake_polygrasp.grasp import CertifiedGrasp, Grasp, GraspPlane
from drake_polygrasp.loading.object_model import load_object
from drake_polygrasp.verification.report import Status
from drake_polygrasp.verification.verify import verify_file
from tests.support.common import certified_grasp, squeeze_interval
from tests.support.grasp_files import BOX_SDF, EXAMPLE, Document, edit, rebalance, write_box
from tests.support.planned import exact_plan

MODELS = sorted(Path(__file__).parents[2].glob("models/*/*.*df"))
PROVED, RECOMPUTED, FAILED = Status.PROVED, Status.RECOMPUTED, Status.FAILED


@pytest.fixture
def box(tmp_path: Path) -> Path:
    return write_box(tmp_path)


def statuses(file: Path, **options: Any) -> tuple[Status, Status, Status]:
    (grasp,) = verify_file(file, **options).grasps
    return (grasp.forces.status, grasp.surface.status, grasp.numbers.status)


def test_the_example_of_the_format_holds_with_every_figure(box: Path) -> None:
    report = verify_file(box)
    assert statuses(box) == (PROVED, RECOMPUTED, RECOMPUTED), report
    assert report.holds
    assert report.model_checked
    assert report.warnings == ()


def test_verifying_changes_nothing(box: Path) -> None:
    before = {path: path.read_bytes() for path in box.parent.iterdir()}
    verify_file(box)
    assert {path: path.read_bytes() for path in box.parent.iterdir()} == before


def test_without_its_model_the_rest_is_checked_and_a_warning_says_so(box: Path) -> None:
    (box.parent / "box.sdf").unlink()
    report = verify_file(box)
    assert statuses(box) == (PROVED, Status.NOT_CHECKED, RECOMPUTED)
    assert report.holds is None
    assert not report.model_checked
    assert "box.sdf" in report.warnings[0]


def test_what_fails_does_not_hold_whether_the_model_is_there_or_not(box: Path) -> None:
    assert verify_file(box).holds is True
    edit(box, scale("margin", 2.0))
    assert verify_file(box).holds is False
    (box.parent / "box.sdf").unlink()
    assert verify_file(box).holds is False


def test_a_changed_model_does_not_hold(box: Path) -> None:
    (box.parent / "box.sdf").write_text(BOX_SDF + "<!-- another -->")
    assert verify_file(box).holds is False


def test_a_package_that_is_not_known_is_a_missing_model(box: Path) -> None:
    edit(box, lambda d: d["object"].update(model_file="package://boxes/box.sdf"))
    assert statuses(box)[1] is Status.NOT_CHECKED
    (box.parent / "boxes").mkdir()
    (box.parent / "boxes" / "package.xml").write_text("<package><name>boxes</name></package>")
    shutil.copy(box.parent / "box.sdf", box.parent / "boxes")
    assert statuses(box, package_paths=[box.parent])[1] is RECOMPUTED


def test_a_package_path_that_is_no_folder_is_the_caller_s_fault(box: Path) -> None:
    with pytest.raises(ModelError, match="/no/such"):
        verify_file(box, package_paths=["/no/such"])


def test_a_file_without_grasps_holds_nothing(box: Path) -> None:
    assert verify_file(edit(box, lambda d: d.update(grasps=[]))).holds is False


def contact(document: Document, i: int = 0) -> Document:
    found: Document = document["grasps"][0]["contacts"][i]
    return found


def certificate(document: Document) -> Document:
    found: Document = document["grasps"][0]["certificate"]
    return found


def move(i: int, offset: tuple[float, float, float]) -> Callable[[Document], None]:
    """Move a contact and all that follows from it, so that only the surface can tell."""

    def change(document: Document) -> None:
        p_BC = contact(document, i)["p_BC"]
        contact(document, i)["p_BC"] = [a + b for a, b in zip(p_BC, offset, strict=True)]
        rebalance(document["grasps"][0])

    return change


def tilt(i: int, angle: float) -> Callable[[Document], None]:
    def change(document: Document) -> None:
        sign = contact(document, i)["nhat_TB_B"][0]
        contact(document, i)["nhat_TB_B"] = [sign * math.cos(angle), math.sin(angle), 0.0]

    return change


def scale(name: str, factor: float) -> Callable[[Document], None]:
    return lambda document: certificate(document).update(
        {name: certificate(document)[name] * factor}
    )


def state(block: str, **values: object) -> Callable[[Document], None]:
    return lambda document: document[block].update(values)


def set_contact(**values: object) -> Callable[[Document], None]:
    return lambda document: contact(document).update(values)


def negate(document: Document) -> None:
    stated = certificate(document)
    stated["internal_force"] = [-x for x in stated["internal_force"]]
    rebalance(document["grasps"][0])


def line_up(document: Document) -> None:
    for i, y in enumerate((0.0, 0.02, -0.02)):
        contact(document, i)["p_BC"] = [-0.05, y, 0.0]
    rebalance(document["grasps"][0])


SPOILT: dict[str, tuple[str, Callable[[Document], object]]] = {
    "contact 1 mm outside": ("surface", move(0, (0.001, 0, 0))),
    "contact 1 mm inside": ("surface", move(0, (-0.001, 0, 0))),
    "contact 1 um inside": ("surface", move(1, (1e-6, 0, 0))),
    "contact beyond an edge": ("surface", move(0, (0, 0, 0.1001))),
    "normal tilted by 0.01": ("surface", tilt(0, 0.01)),
    "normal tilted out of the cone": ("forces", tilt(0, 1.1 * math.atan(0.3))),
    "normal turned round": ("forces", set_contact(nhat_TB_B=[1.0, 0.0, 0.0])),
    "normal of length 5": ("forces", set_contact(nhat_TB_B=[-5.0, 0.0, 0.0])),
    "internal force negated": ("forces", negate),
    "contacts on a line": ("forces", line_up),
    "force altered": ("forces", set_contact(f_Bc_B=[-0.5, 1e-8, 0.0])),
    "forces of another scale": (
        "forces",
        lambda d: (
            certificate(d).update(internal_force=[5.0, 5.0, -2.5]),
            rebalance(d["grasps"][0]),
        ),
    ),
    "more friction than the model's": ("surface", set_contact(mu=0.31)),
    "margin doubled": ("numbers", scale("margin", 2)),
    "margin a millionth more": ("numbers", scale("margin", 1 + 1e-6)),
    "epsilon_lower doubled": ("numbers", scale("epsilon_lower", 2)),
    "epsilon_lower 2 percent more": ("numbers", scale("epsilon_lower", 1.02)),
    "epsilon_upper doubled": ("numbers", scale("epsilon_upper", 2)),
    "epsilon_upper halved": ("numbers", scale("epsilon_upper", 0.5)),
    "placement_tolerance doubled": ("numbers", scale("placement_tolerance", 2)),
    "squeeze_force halved": ("numbers", scale("squeeze_force", 0.5)),
    "tilt_tolerance in degrees": ("numbers", lambda d: certificate(d).update(tilt_tolerance=0.6)),
    "friction_tolerance of mu": (
        "numbers",
        lambda d: certificate(d).update(friction_tolerance=0.3),
    ),
    "another grasp plane": (
        "numbers",
        lambda d: d["grasps"][0]["grasp_plane"].update(p_BP=[0.0, 0.0, 0.01]),
    ),
    "mass halved": ("surface", state("object", mass=0.5)),
    "mass left out": ("surface", state("object", mass=None)),
    "centre of mass moved": ("surface", state("object", p_BBcm=[0.0, 0.0, 0.001])),
    "rho doubled": ("surface", state("object", rho=0.2449489742783178)),
    "faces miscounted": ("surface", state("object", num_faces=7)),
    "another body": ("surface", state("object", body_name="lid")),
    "another model's name": ("surface", state("object", model_name="brick")),
}


@pytest.mark.parametrize("spoilt", SPOILT)
def test_a_spoilt_file_is_refused_where_it_was_spoilt(box: Path, spoilt: str) -> None:
    line, change = SPOILT[spoilt]
    report = verify_file(edit(box, change))
    assert getattr(report.grasps[0], line).status is FAILED, report
    assert getattr(report.grasps[0], line).reason
    assert not report.holds


def test_a_model_changed_by_one_byte_is_another_model(box: Path) -> None:
    (box.parent / "box.sdf").write_text(BOX_SDF + " ")
    report = verify_file(box)
    assert report.grasps[0].surface.status is FAILED
    assert "sha256" in report.grasps[0].surface.reason
    assert not report.holds


def test_a_model_that_no_longer_loads_is_refused(box: Path) -> None:
    (box.parent / "box.sdf").write_text("<sdf")
    assert not verify_file(box).holds


@pytest.mark.parametrize("mu", ["-0.3", "0", ".nan", ".inf"])
def test_friction_that_is_no_positive_number_is_no_grasp_file(tmp_path: Path, mu: str) -> None:
    with pytest.raises(GraspFileError, match="mu"):
        verify_file(write_box(tmp_path, EXAMPLE.replace("mu: 0.3", f"mu: {mu}", 1)))


def test_a_key_given_twice_is_no_grasp_file(tmp_path: Path) -> None:
    text = EXAMPLE.replace("margin: 0.75", "margin: 0.75\n    margin: 0.5")
    with pytest.raises(GraspFileError, match="margin"):
        verify_file(write_box(tmp_path, text))


def test_less_than_the_truth_may_be_claimed(box: Path) -> None:
    def modest(document: Document) -> None:
        certificate(document).update(
            margin=0.1, mu_min=0.2, epsilon_lower=0.01, placement_tolerance=0.0, squeeze_force=1e3
        )

    assert verify_file(edit(box, modest)).holds


def test_friction_asked_for_in_the_plan_may_exceed_the_model_s(box: Path) -> None:
    def slippery(document: Document) -> None:
        document["plan"]["mu"] = 0.5
        del certificate(document)["epsilon_upper"]
        for i in range(3):
            contact(document, i)["mu"] = 0.5

    report = verify_file(edit(box, slippery))
    assert report.holds, report
    assert "0.5" in report.warnings[0]


def test_friction_asked_for_is_a_positive_number(box: Path) -> None:
    with pytest.raises(GraspFileError, match=r"plan\.mu"):
        verify_file(edit(box, state("plan", mu="high")))


def wedge_grasp() -> CertifiedGrasp:
    """Two against one on walls that close in by 20 degrees: needs friction of tan(10 deg)."""
    c, s = math.cos(math.radians(10)), math.sin(math.radians(10))
    grasp = Grasp(
        p_BC=frozen([[0.05, 0, 0], [-0.05, 0.02, 0], [-0.05, -0.02, 0]]),
        nhat_TB_B=frozen([[-c, 0, s], [c, 0, s], [c, 0, s]]),
        mu=frozen([0.3, 0.3, 0.3]),
        kind="two_faces",
        faces=(5, 0, 0),
        grasp_plane=GraspPlane(frozen([0, 0, 1]), frozen([0, 0, 0])),
    )
    certified = certified_grasp(grasp, 1.0, 0.12, np.zeros(3))
    assert isinstance(certified, CertifiedGrasp)
    return certified


@pytest.fixture
def wedge(box: Path) -> Path:
    (box.parent / "box.sdf").unlink()
    return edit(
        box,
        lambda d: (
            d.update(grasps=[grasp_document(wedge_grasp())]),
            d["object"].update(rho=0.12),
        ),
    )


def test_a_grasp_that_needs_friction_says_how_much(wedge: Path) -> None:
    assert wedge_grasp().certificate.mu_min == pytest.approx(math.tan(math.radians(10)), rel=2e-3)
    assert verify_file(wedge).holds is None


def halve_friction(document: Document) -> None:
    for i in range(3):
        contact(document, i)["mu"] = certificate(document)["mu_min"] / 2


@pytest.mark.parametrize(
    ("line", "change"),
    [
        ("forces", halve_friction),
        ("numbers", scale("mu_min", 0.99)),
        ("numbers", lambda d: certificate(d).update(mu_min=0.0)),
        ("numbers", lambda d: certificate(d).update(mu_min_internal_force=[0.0, 0.0, 0.0])),
        (
            "numbers",
            lambda d: (
                certificate(d).pop("mu_min_internal_force"),
                certificate(d).update(mu_min=0.17),
            ),
        ),
    ],
)
def test_less_friction_than_it_takes_is_refused(
    wedge: Path, line: str, change: Callable[[Document], object]
) -> None:
    report = verify_file(edit(wedge, change))
    assert getattr(report.grasps[0], line).status is FAILED


def test_mu_min_without_its_witness_is_proved_by_another(wedge: Path) -> None:
    assert (
        verify_file(edit(wedge, lambda d: certificate(d).pop("mu_min_internal_force"))).holds
        is None
    )


@pytest.mark.parametrize("model", MODELS, ids=lambda path: path.stem)
def test_every_grasp_planned_on_a_model_is_borne_out(tmp_path: Path, model: Path) -> None:
    object_ = load_object(model)
    for method in ("paper", "enriched"):
        plan = exact_plan(object_, method=method)
        save_grasps(tmp_path / "planned.grasp.yaml", object_, plan.grasps, plan.settings)
        report = verify_file(tmp_path / "planned.grasp.yaml")
        assert report.holds == (model.stem != "tetrahedron"), report
        assert report.warnings == ()


def numbers_of(document: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The place of every number in a document."""
    if isinstance(document, dict | list):
        items = document.items() if isinstance(document, dict) else enumerate(document)
        for key, value in items:
            yield from numbers_of(value, (*path, key))
    elif isinstance(document, float):
        yield path


@pytest.mark.parametrize("size", [1e-300, 1e300])
def test_a_number_of_any_size_in_any_place_is_answered(box: Path, size: float) -> None:
    (box.parent / "box.sdf").unlink()
    original = box.read_text()
    places: list[tuple[Any, ...]] = []
    edit(box, lambda d: places.extend(numbers_of(d)))
    for path in places:

        def change(document: Any, path: tuple[Any, ...] = path) -> None:
            for key in path[:-1]:
                document = document[key]
            document[path[-1]] = size

        box.write_text(original)
        verify_file(edit(box, change))


@pytest.mark.parametrize(("factor", "holds"), [(1.0, True), (0.9995, False)])
def test_a_claim_may_be_as_close_as_it_is_true(tmp_path: Path, factor: float, holds: bool) -> None:
    object_ = load_object(next(path for path in MODELS if path.stem == "cube"))
    plan = exact_plan(object_, top=1)
    (found,) = plan.grasps
    contacts = found.grasp.p_BC, found.grasp.nhat_TB_B, found.grasp.mu
    scale = object_.p_BBcm, object_.rho
    epsilon = epsilon_interval(*contacts, *scale, relative_gap=1e-5)
    r_w = squeeze_interval(*contacts, *scale, relative_gap=1e-5).lower
    assert object_.mass is not None
    certificate = replace(
        found.certificate,
        epsilon_lower=epsilon.lower / factor,
        epsilon_upper=epsilon.upper / factor,
        squeeze_force=factor * object_.mass * GRAVITY / r_w,
    )
    grasps = [replace(found, certificate=certificate)]
    save_grasps(tmp_path / "close.grasp.yaml", object_, grasps, plan.settings)
    assert verify_file(tmp_path / "close.grasp.yaml").holds == holds


def test_progress_is_told_in_grasps(box: Path) -> None:
    def thrice(document: Document) -> None:
        document["grasps"] = [copy.deepcopy(document["grasps"][0]) for _ in range(3)]

    edit(box, thrice)
    told: list[tuple[int, int]] = []
    report = verify_file(box, progress=lambda done, total: told.append((done, total)))
    assert report.holds
    assert told == [(0, 3), (1, 3), (2, 3)]
