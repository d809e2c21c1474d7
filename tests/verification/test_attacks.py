"""What someone would try who wants a grasp certified that does not hold: each attempt fails."""

from __future__ import annotations

import math
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
import shapely
from scipy.spatial.transform import Rotation

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.certification.certify import prove, prove_many
from drake_polygrasp.certification.robustness import epsilon_interval, placement_tolerance
from drake_polygrasp.errors import GraspFileError
from drake_polygrasp.files.grasp_file import load_grasps, save_grasps
from drake_polygrasp.files.stated_grasp import StatedPlan
from drake_polygrasp.geometry.polyhedron import Polyhedron
from drake_polygrasp.geometry.surface import Part, build_polyhedron
from drake_polygrasp.geometry.surface_contact import face_at, locate_contacts
from drake_polygrasp.grasp import CertifiedGrasp, Grasp, GraspObject, GraspPlane, Verdict
from drake_polygrasp.loading.object_model import load_object
from drake_polygrasp.verification.report import Status
from drake_polygrasp.verification.verify import verify_file
from tests.support.common import certified_grasp, random_contacts
from tests.support.convex_polyhedra import prism, write_obj
from tests.support.grasp_files import BOX_SDF, EXAMPLE, Document, edit, write_box
from tests.support.lp_judge import is_force_closure
from tests.support.planned import exact_plan
from tests.support.surface_judge import is_exposed

MODELS = Path(__file__).parents[2] / "models"
X, Y, Z = np.eye(3)
PHI = math.atan(0.3)


# Grasps on the boundary of closure: a surface that the file's tolerances nearly turn into another.


@pytest.fixture
def wedge(tmp_path: Path) -> GraspObject:
    """A wedge whose sides lean by arctan(mu) each: fingers slip off, by nothing at all."""
    half, height = 0.05, 0.08
    top = half - height * math.tan(PHI)
    profile = shapely.Polygon([(-half, 0), (half, 0), (top, height), (-top, height)])
    write_obj(tmp_path / "wedge.obj", prism(profile, 0.1))
    mesh = "<mesh><uri>wedge.obj</uri></mesh>"
    sdf = BOX_SDF.replace("<box><size>0.1 0.1 0.2</size></box>", mesh)
    (tmp_path / "wedge.sdf").write_text(sdf)
    return load_object(tmp_path / "wedge.sdf")


def on_the_wedge(phi: float) -> Grasp:
    """Two contacts against one on the wedge's sides, whose normals are said to rise by phi."""
    c, s = math.cos(phi), math.sin(phi)
    x = 0.05 - 0.04 * math.tan(PHI)
    return Grasp(
        frozen([[x, 0.04, 0.05], [-x, 0.04, 0.03], [-x, 0.04, 0.07]]),
        frozen([[-c, -s, 0], [c, -s, 0], [c, -s, 0]]),
        frozen([0.3, 0.3, 0.3]),
        "two_faces",
        (5, 0, 0),
        GraspPlane(frozen(Y), frozen([0, 0.04, 0])),
    )


def test_on_the_boundary_of_closure_nothing_is_certified() -> None:
    assert prove(on_the_wedge(PHI)).verdict is not Verdict.HOLDS


@pytest.mark.parametrize("tilt", [1e-8, 9e-7])
def test_normals_tilted_within_the_tolerance_do_not_carry_a_grasp_over_the_boundary(
    wedge: GraspObject, tmp_path: Path, tilt: float
) -> None:
    grasp = on_the_wedge(PHI - tilt)
    certified = certified_grasp(grasp, wedge.mass, wedge.rho, wedge.p_BBcm)
    assert isinstance(certified, CertifiedGrasp)
    save_grasps(tmp_path / "w.grasp.yaml", wedge, [certified], StatedPlan())
    (report,) = verify_file(tmp_path / "w.grasp.yaml").grasps
    assert report.forces.status is Status.PROVED
    assert report.surface.status is Status.FAILED
    assert "cone" in report.surface.reason


# Contacts just below the exposed surface, where nothing can touch them.


def build(*parts: Array, mu: tuple[float, ...] = (0.3, 0.3, 0.3, 0.3)) -> Polyhedron:
    return build_polyhedron([Part(part, mu_i) for part, mu_i in zip(parts, mu, strict=False)])


def plate() -> Array:
    return prism(shapely.box(-0.1, -0.1, 0.1, 0.1), 0.1)


def test_a_wall_that_leans_into_another_part_is_no_place_for_a_contact() -> None:
    turn = Rotation.from_rotvec(0.015 * Y)
    slab = prism(shapely.box(-0.05, -0.05, 0.05, 0.05), 0.1) - 0.1 * Z
    body = build(plate(), turn.apply(slab) + 0.1 * Z)
    along = np.array([-0.03, -1e-3, 5e-5, 2e-4, 0.03])
    p_BC = 0.1 * Z + np.outer(along, turn.apply(X))
    found = face_at(body, p_BC, np.tile(turn.apply(-Z), (5, 1)))
    assert (found >= 0).tolist() == [True, True, False, False, False]


@pytest.mark.parametrize("depth", [5e-6, 9e-6, 1.5e-5])
def test_a_wall_a_hair_below_another_is_no_place_for_a_contact(depth: float) -> None:
    L = np.linalg.norm([0.2, 0.2, 0.1])
    body = build(plate(), prism(shapely.box(-0.05, -0.05, 0.05, 0.05), 0.1 - depth * L))
    p_BC = np.array([0.1 * Z, (0.1 - depth * L) * Z])
    assert (face_at(body, p_BC, np.array([-Z, -Z])) >= 0).tolist() == [True, False]


def test_the_surface_s_own_contacts_are_returned() -> None:
    tilt = 5e-7
    stated = np.array([0.01, 0.02, 0.1 + 5e-8])
    leaning = np.array([math.sin(tilt), 0, -math.cos(tilt)])
    touched = locate_contacts(build(plate()), stated[None], leaning[None])
    assert touched.face[0] >= 0
    np.testing.assert_allclose(touched.p_BC, [[0.01, 0.02, 0.1]], atol=1e-15)
    np.testing.assert_allclose(touched.nhat_TB_B, [-Z], atol=1e-15)


@pytest.mark.parametrize("seed", range(4))
def test_blocks_that_touch_overlap_and_coincide_are_told_apart(seed: int) -> None:
    """Blocks on a lattice share faces and planes; the lesser friction of coincident ones holds."""
    rng = np.random.default_rng(seed)
    low = rng.integers(0, 4, (4, 3)).astype(float)
    low[3] = low[0]
    high = low + rng.integers(1, 4, (4, 3))
    mu = (0.2, 0.3, 0.4, 0.1)
    blocks = [
        prism(shapely.box(*a[:2], *b[:2]), b[2] - a[2]) + a[2] * Z
        for a, b in zip(low, high, strict=True)
    ]
    body = build(*blocks, mu=mu)
    for axis, sign, k in [(a, s, k) for a in range(3) for s in (-1, 1) for k in range(4)]:
        nhat = -sign * np.eye(3)[axis]
        p_BC = rng.integers(0, 7, (12, 3)) + rng.uniform(0.1, 0.9, (12, 3))
        p_BC[:, axis] = (low if sign < 0 else high)[k, axis]
        normals = np.tile(nhat, (12, 1))
        found = face_at(body, p_BC, normals)
        behind = p_BC + 1e-3 * nhat
        own = ((behind[:, None] > low) & (behind[:, None] < high)).all(axis=2)
        own &= (low if sign < 0 else high)[:, axis] == p_BC[:, axis, None]
        exposed = is_exposed(p_BC, normals, blocks, 1e-3) & own.any(axis=1)
        assert ((found >= 0) == exposed).all()
        for i in np.flatnonzero(exposed):
            assert body.faces[found[i]].mu == min(np.array(mu)[own[i]])


def test_a_shell_that_crosses_itself_is_not_touched_from_within() -> None:
    """Of a bow tie one half is wound the other way: its walls seem to face inward."""
    outline = [(0.5, 0.0), (4.0, 0.0), (4.0, 3.0), (-2.0, -1.5), (-2.0, 0.0)]
    triangles = []
    for (a, b), (c, d) in zip(outline, outline[1:] + outline[:1], strict=True):
        triangles += [[(a, b, 1), (c, d, 1), (0, 0, 1)], [(c, d, 0), (a, b, 0), (0, 0, 0)]]
        triangles += [[(a, b, 0), (c, d, 0), (c, d, 1)], [(a, b, 0), (c, d, 1), (a, b, 1)]]
    p_BC = np.array([[4, 1.5, 0.5], [-2, -0.7, 0.5], [-1, -0.3, 0]])
    found = face_at(build(np.array(triangles, dtype=float)), p_BC, np.array([-X, -X, -Z]))
    assert (found >= 0).tolist() == [True, False, False]


# Numbers that promise too much.


@pytest.mark.parametrize("name", ["plate_with_hole", "u_channel", "concave_mesh", "two_materials"])
def test_within_the_placement_tolerance_contacts_stay_on_their_faces_and_hold(name: str) -> None:
    object_ = load_object(next((MODELS / name).glob("*.*df")))
    rng = np.random.default_rng(0)
    # Hardly any clearance, so that edges and holes are near.
    for certified in exact_plan(object_, edge_clearance=1e-5, tip_radius=0.0, top=5).grasps:
        grasp = certified.grasp
        step = rng.normal(size=(20, 3, 3))
        step -= np.einsum("kij,ij->ki", step, grasp.nhat_TB_B)[..., None] * grasp.nhat_TB_B
        step /= np.linalg.norm(step, axis=-1, keepdims=True)
        p_BC = grasp.p_BC + 0.95 * certified.certificate.placement_tolerance * step
        normals = np.broadcast_to(grasp.nhat_TB_B, p_BC.shape)
        faces = face_at(object_.polyhedron, p_BC.reshape(-1, 3), normals.reshape(-1, 3))
        assert (faces.reshape(-1, 3) == face_at(object_.polyhedron, grasp.p_BC, normals[0])).all()
        for p in p_BC[:5]:
            assert is_force_closure(p, grasp.nhat_TB_B, grasp.mu, around=False, sides=48)


def test_contacts_moved_against_the_weakest_wrench_hold_within_the_placement_tolerance() -> None:
    p_BC, nhat_TB_B, mu = random_contacts(400, seed=3)
    held = 0
    for p, n, mu_k, proof in zip(p_BC, nhat_TB_B, mu, prove_many(p_BC, nhat_TB_B, mu), strict=True):
        if proof.verdict is not Verdict.HOLDS:
            continue
        epsilon = epsilon_interval(p, n, mu_k, np.zeros(3), 1.0)
        w = epsilon.normals[epsilon.offsets.argmin()]
        pull = w[:3] + np.cross(w[3:], p)
        across = pull - (pull * n).sum(-1, keepdims=True) * n
        push = n + mu_k[:, None] * across / np.linalg.norm(across, axis=-1, keepdims=True)
        worst = np.cross(push, w[3:])
        worst -= (worst * n).sum(-1, keepdims=True) * n
        worst /= np.linalg.norm(worst, axis=-1, keepdims=True)
        moved = p - 0.999 * placement_tolerance(epsilon.lower, mu_k, 1.0) * worst
        assert prove_many(moved[None], n[None], mu_k[None])[0].verdict is not Verdict.FAILS
        held += 1
    assert held > 20


def contact(document: Document, i: int) -> Document:
    found: Document = document["grasps"][0]["contacts"][i]
    return found


def swap_contacts(document: Document) -> None:
    contacts = document["grasps"][0]["contacts"]
    contacts[0], contacts[1] = contacts[1], contacts[0]


def in_grasp(block: str, **values: object) -> Callable[[Document], None]:
    return lambda document: document["grasps"][0][block].update(values)


SPOILT: dict[str, tuple[str, Callable[[Document], object]]] = {
    "contacts in another order than forces": ("forces", swap_contacts),
    "a face that is not there": ("numbers", lambda d: d["grasps"][0].update(faces=[6, 0, 0])),
    "a kind of other faces": ("numbers", lambda d: d["grasps"][0].update(kind="three_faces")),
    "more quality than its factors make": ("numbers", in_grasp("quality", Q=0.613)),
    "a factor of quality above 1": ("numbers", in_grasp("quality", q=[9.0, 1.0, 1.0, 1.0, 1.0])),
    "factors of quality below 0": ("numbers", in_grasp("quality", q=[-1.0, -1.0, 1.0, 1.0, 1.0])),
    "a witness of nothing": (
        "numbers",
        lambda d: (
            d["grasps"][0]["certificate"].pop("mu_min"),
            d["grasps"][0]["certificate"].update(mu_min_internal_force=[1.0, 1.0, 1.0]),
        ),
    ),
}


@pytest.mark.parametrize("spoilt", SPOILT)
def test_a_file_that_contradicts_itself_is_refused(tmp_path: Path, spoilt: str) -> None:
    line, change = SPOILT[spoilt]
    report = verify_file(edit(write_box(tmp_path), change))
    assert getattr(report.grasps[0], line).status is Status.FAILED, report
    assert not report.holds


# YAML that other readers would read as other numbers.

MARGIN = "    margin: 0.75\n"


@pytest.mark.parametrize(
    ("honest", "spoilt"),
    [
        (MARGIN, "    <<: {margin: 0.99}\n"),
        (MARGIN, "    <<: [{margin: 0.99}]\n"),
        (MARGIN, "    '<<': {margin: 0.99}\n"),
        (MARGIN, "    !!binary bWFyZ2lu: 0.99\n"),
        (MARGIN, "    !!python/name:os.system margin: 0.75\n"),
        (MARGIN, "    note: &name margin\n    *name : 0.75\n"),
        (MARGIN, MARGIN + '    "\\x6dargin": 0.99\n'),
        ("squeeze_force: 35.4", "squeeze_force: 050"),
        ("squeeze_force: 35.4", "squeeze_force: 0o50"),
        ("squeeze_force: 35.4", "squeeze_force: 1:30"),
        ("squeeze_force: 35.4", "squeeze_force: 1e400"),
        ("squeeze_force: 35.4", "squeeze_force: 1" + 309 * "0"),
        ("squeeze_force: 35.4", "squeeze_force: 1" + 5000 * "0"),
        ("squeeze_force: 35.4", "squeeze_force: true"),
        ("mass: 1.0", "mass: 01"),
        ("version: 1", "version: 01"),
    ],
)
def test_what_readers_of_yaml_differ_on_is_refused(
    tmp_path: Path, honest: str, spoilt: str
) -> None:
    assert honest in EXAMPLE
    with pytest.raises(GraspFileError):
        verify_file(write_box(tmp_path, EXAMPLE.replace(honest, spoilt, 1)))


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_direction_whose_square_overflows_is_refused_in_one_message(tmp_path: Path) -> None:
    avoided = {"avoid_directions": [[1e308, 1e308, 1e308]], "avoid_angle": 0.5}
    file = edit(write_box(tmp_path), lambda d: d["plan"].update(avoided))
    with pytest.raises(GraspFileError, match="not a list of unit vectors"):
        load_grasps(file)


def test_a_model_by_a_name_that_no_file_can_have_is_missing(tmp_path: Path) -> None:
    file = edit(write_box(tmp_path), lambda d: d["object"].update(model_file=5000 * "a"))
    assert verify_file(file).grasps[0].surface.status is Status.NOT_CHECKED


def test_another_model_s_digest_is_no_excuse(tmp_path: Path) -> None:
    """A file may name any model, but its contacts must be on that one."""
    file = write_box(tmp_path)
    other = BOX_SDF.replace("0.1 0.1 0.2", "0.12 0.1 0.2")
    (tmp_path / "other.sdf").write_text(other)
    digest = sha256(sha256(other.encode()).digest()).hexdigest()
    edit(file, lambda d: d["object"].update(model_file="other.sdf", sha256=digest))
    assert verify_file(file).grasps[0].surface.status is Status.FAILED
