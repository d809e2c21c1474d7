"""The judge of misses is right: closed forms of closure, of what rays meet and of what is drawn."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.misses import generated, judged, stated_errors, surface_of
from drake_polygrasp import plan_grasps, save_grasps
from drake_polygrasp.certification.robustness import epsilon_interval
from tests.support.common import prism_grasp, wedge_grasp
from tests.support.lp_judge import is_force_closure as by_linear_programs
from tests.support.miss_judge import (
    Errors,
    Solid,
    Surface,
    cast,
    draw,
    epsilons,
    is_force_closure,
)
from tests.support.plant_scenes import model
from tests.support.solids import cube

ROOT = Path(__file__).resolve().parents[1]
PHI = 0.3
DOWN = np.array([0.0, 0.0, -1.0])


@pytest.mark.parametrize("factor", [0.99, 1.01])
def test_a_wedge_is_held_iff_friction_is_above_the_tangent_of_its_half_angle(factor: float) -> None:
    grasp = wedge_grasp(PHI, factor * np.tan(PHI))
    closed = is_force_closure(grasp.p_BC[None], grasp.nhat_TB_B[None], grasp.mu[None])
    assert closed.tolist() == [factor > 1]


def test_closure_is_that_of_linear_programs_over_polygonal_cones() -> None:
    rng = np.random.default_rng(5)
    p, n = rng.normal(size=(300, 3, 3)), rng.normal(size=(300, 3, 3))
    n -= 2 * p / np.linalg.norm(p, axis=2, keepdims=True)  # mostly inward
    n /= np.linalg.norm(n, axis=2, keepdims=True)
    mu = rng.uniform(0.2, 1.0, (300, 3))
    found = is_force_closure(p, n, mu)
    assert 20 < found.sum() < 280
    for p_k, n_k, mu_k, closed in zip(p, n, mu, found, strict=True):
        if closed:
            assert by_linear_programs(p_k, n_k, mu_k, around=True)
        else:
            assert not by_linear_programs(p_k, n_k, mu_k, around=False)


def test_epsilon_is_the_certificates() -> None:
    """Cones of 32 edges are inside the true ones: too little by 1 - cos(pi / 32), 0.5 percent."""
    for grasp, rho in ((prism_grasp(mu=0.3), 0.1), (wedge_grasp(PHI, 0.8), 0.2)):
        contacts = grasp.p_BC[None], grasp.nhat_TB_B[None], grasp.mu[None]
        (found,) = epsilons(*contacts, np.zeros((1, 3)), rho, sides=32)
        known = epsilon_interval(*(array[0] for array in contacts), np.zeros(3), rho)
        assert (1 - 6e-3) * known.lower <= found <= known.upper * (1 + 1e-4)  # joggled by qhull


def test_rays_meet_curved_solids_where_they_are_and_as_they_lean() -> None:
    R = np.eye(3)[[1, 2, 0]].T
    for kind, radii, depth, outward in (
        ("ellipsoid", (1.0, 1.0, 2.0), 5 - np.sqrt(1 - 0.36), (0.6, 0.0, 0.8)),
        ("cylinder", (1.0, 1.0, 2.0), 5 - 0.8, (0.6, 0.0, 0.8)),
        ("capsule", (1.0, 1.0, 2.0), 5 - 0.8, (0.6, 0.0, 0.8)),
    ):
        solid = Solid(kind, R, np.zeros(3), np.array(radii), 0.4)
        axis = solid.R_BG[:, 2]
        side = np.cross(axis, [0, 0, 1.0])
        surface = Surface(np.empty((0, 3, 3)), np.empty(0), [solid])
        hits = cast(surface, (0.6 * side - 5 * DOWN)[None], DOWN)
        assert hits.depth == pytest.approx([depth])
        assert -hits.inward[0] == pytest.approx(outward[0] * side + outward[2] * -DOWN)
        assert hits.mu.tolist() == [0.4]


def test_rays_meet_the_flat_end_of_a_cylinder_and_the_round_end_of_a_capsule() -> None:
    start = np.array([[0.6, 0.0, 5.0], [1.1, 0.0, 5.0]])
    for kind, depth, outward in (("cylinder", 3.0, (0, 0, 1)), ("capsule", 2.2, (0.6, 0, 0.8))):
        solid = Solid(kind, np.eye(3), np.zeros(3), np.array([1.0, 1.0, 2.0]), 0.4)
        hits = cast(Surface(np.empty((0, 3, 3)), np.empty(0), [solid]), start, DOWN)
        assert hits.depth == pytest.approx([depth, np.inf])
        assert -hits.inward[0] == pytest.approx(outward)


def test_a_contact_at_an_edge_leaves_the_face_as_often_as_a_disc_says() -> None:
    """Contacts d from one edge each, misses of r: a segment of each disc is off the face."""
    box, d, r, trials = cube(), 0.002, 0.005, 20_000
    lower = box.polyhedron.triangles_B.reshape(-1, 3).min(axis=0)
    upper = box.polyhedron.triangles_B.reshape(-1, 3).max(axis=0)
    middle = (lower + upper) / 2
    p = np.array(
        [
            [lower[0], lower[1] + d, middle[2]],
            [upper[0], middle[1], upper[2] - d],
            [upper[0], middle[1], lower[2] + d],
        ]
    )
    n = np.array([[1.0, 0, 0], [-1.0, 0, 0], [-1.0, 0, 0]])
    errors = Errors(np.full(3, r), 0.0, 0.0, 0.0)
    drawn = draw(
        surface_of(box), p, n, np.ones(3), middle, errors, trials, np.random.default_rng(1)
    )
    segment = np.arccos(d / r) - d / r * np.sqrt(1 - (d / r) ** 2)
    expected = 1 - (1 - segment / np.pi) ** 3
    assert drawn.off.mean() == pytest.approx(expected, abs=4 * np.sqrt(0.25 / trials))
    on = ~drawn.off
    assert np.abs(drawn.p[on, 0, 0] - lower[0]).max() < 1e-12
    assert (drawn.n[on] == n).all()
    assert not drawn.holds[drawn.off].any()


def test_errors_drawn_are_no_larger_than_stated_and_fill_their_range() -> None:
    box = cube()
    middle = box.p_BBcm
    half = float(middle[0])
    p = middle + half * np.array([[-1.0, 0, 0], [1, 0, 0.2], [1, 0, -0.2]])
    n = np.array([[1.0, 0, 0], [-1.0, 0, 0], [-1.0, 0, 0]])
    mu = box.polyhedron.mu[:3]
    errors = Errors(np.array([1e-3, 2e-3, 0.0]), 0.1, 0.2, 3e-3)
    surface = surface_of(box)
    drawn = draw(surface, p, n, mu, middle, errors, 4000, np.random.default_rng(2))
    miss = np.linalg.norm(drawn.p - p, axis=2).max(axis=0)
    assert miss == pytest.approx(errors.placement, rel=0.01)
    tilt = np.arccos((drawn.n * n).sum(axis=2))
    assert tilt.max() == pytest.approx(0.1, rel=0.01)
    assert np.median(tilt) == pytest.approx(0.1 / np.sqrt(2), rel=0.03)  # half the cap's area
    share = drawn.mu / mu
    assert (share.min(), share.max()) == pytest.approx((0.8, 1.2), abs=0.01)
    assert np.linalg.norm(drawn.p_com - middle, axis=1).max() == pytest.approx(3e-3, rel=0.01)
    worst = draw(surface, p, n, mu, middle, errors, 100, np.random.default_rng(2), on_rim=True)
    assert np.linalg.norm(worst.p - p, axis=2) == pytest.approx(np.tile(errors.placement, (100, 1)))
    assert np.arccos((worst.n * n).sum(axis=2)) == pytest.approx(0.1)
    assert worst.mu == pytest.approx(np.tile(0.8 * mu, (100, 1)))


def test_what_grasps_are_proved_to_bear_they_bear_in_every_trial() -> None:
    """On planar faces, an octagonal prism's edges among them, and on polyhedra of many facets."""
    objects = [model("octagonal_prism"), model("two_materials")]
    objects += [subject.make() for subject in generated(2)]
    proved = 0
    for k, object_ in enumerate(objects):
        plan = plan_grasps(
            object_, top=2, placement_error=0.002, tilt_error=0.06, friction_error=0.15
        )
        for certified in plan.grasps:
            if certified.region is not None:
                errors = stated_errors(certified.region)
                for on_rim in (False, True):
                    found = judged(f"{k}", "errors", object_, certified, errors, on_rim=on_rim)
                    assert found.holds == 1.0
                proved += 1
    assert proved >= 6


def test_a_grasp_file_is_judged_by_what_it_states(tmp_path: Path) -> None:
    box = model("cube")
    plan = plan_grasps(box, top=1, placement_error=0.002, tilt_error=0.06)
    file = tmp_path / "cube.grasp.yaml"
    save_grasps(file, box, plan.grasps, plan.settings)
    command = [sys.executable, "-m", "benchmarks.misses", str(file), "--stated", "--trials", "50"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert "    2.00  file         1.000" in done.stdout


def test_the_command_prints_how_often_grasps_hold_and_fails_where_too_few_do() -> None:
    model = ROOT / "models" / "cube" / "cube.sdf"
    command = [sys.executable, "-m", "benchmarks.misses", str(model), "--trials", "200"]
    command += ["--plans", "clearance", "--require", "1"]
    for least, code in (("1", 0), ("1.1", 1)):
        done = subprocess.run([*command, least], cwd=ROOT, capture_output=True, text=True)
        assert done.returncode == code, done.stderr
        assert "clearance: P 1.0000 in the mean of 1 objects" in done.stdout
