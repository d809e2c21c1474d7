"""The benchmark's peers are right: they draw fairly, and find what is known to be there."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import shapely

from benchmarks import measure, scans, shell
from benchmarks.long_search import Effort, best_known
from benchmarks.measure import peers
from benchmarks.objects import generated, models
from benchmarks.peers import (
    Surface,
    Triples,
    antipodal_triples,
    best_of,
    closed,
    draw_points,
    epsilon_of,
    is_proved,
    random_triples,
    surface_of,
    triples_at,
    upper_bound,
)
from benchmarks.tables import HEADER, growth_table, kinds_table, row
from drake_polygrasp.geometry.regions import erode
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.wrenches.contacts import force_closure
from tests.support.convex_polyhedra import holed_prism
from tests.support.solids import cube, solid

ROOT = Path(__file__).resolve().parents[1]
DOCS = (ROOT / "README.md", *(ROOT / "docs").glob("*.md"))


def rng() -> np.random.Generator:
    return np.random.default_rng(7)


@pytest.fixture(scope="module")
def holed() -> GraspObject:
    return solid(holed_prism(8, 2, seed=1))


@pytest.fixture(scope="module")
def surface(holed: GraspObject) -> Surface:
    return surface_of(erode(holed.polyhedron))


def test_points_are_drawn_on_their_regions_as_often_as_area_says(surface: Surface) -> None:
    p_BC, region = draw_points(surface, (20_000,), rng())
    regions = surface.regions
    p_FC = np.einsum("mji,mj->mi", regions.R_BF[region], p_BC - regions.p_BF[region])
    distance = shapely.distance(regions.polygon_F[region], shapely.points(p_FC[:, :2]))
    assert distance.max() < 1e-12
    assert np.abs(p_FC[:, 2]).max() < 1e-12
    expected = 20_000 * regions.area / regions.area.sum()
    counts = np.bincount(region, minlength=len(expected))
    assert (np.abs(counts - expected) < 5 * np.sqrt(expected)).all()


def test_antipodal_pairs_lie_in_both_friction_cones_and_on_their_regions(surface: Surface) -> None:
    triples = antipodal_triples(surface, 2_000, rng())
    assert len(triples.mu) > 500
    along = triples.p_BC[:, 1] - triples.p_BC[:, 0]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    cosine = np.abs(np.einsum("mci,mi->mc", triples.nhat_TB_B[:, :2], along))
    assert (cosine >= 1 / np.sqrt(1 + triples.mu[:, :2] ** 2) - 1e-9).all()
    regions, r = surface.regions, triples.region[:, 1]
    p_FC = np.einsum("mji,mj->mi", regions.R_BF[r], triples.p_BC[:, 1] - regions.p_BF[r])
    distance = shapely.distance(regions.polygon_F[r], shapely.points(p_FC[:, :2]))
    assert max(distance.max(), np.abs(p_FC[:, 2]).max()) < 1e-9


def test_on_a_cube_every_antipodal_pair_is_of_opposite_faces() -> None:
    triples = antipodal_triples(surface_of(erode(cube().polyhedron)), 500, rng())
    facing = np.einsum("mi,mi->m", triples.nhat_TB_B[:, 0], triples.nhat_TB_B[:, 1])
    assert facing == pytest.approx(-1)


def test_the_filter_drops_no_triple_of_force_closure(holed: GraspObject, surface: Surface) -> None:
    triples = random_triples(surface, 2_000, rng())
    rows = closed(holed, triples, tip_radius=0.0)
    assert rows.tolist() == np.flatnonzero(force_closure(*triples.contacts)).tolist()


def test_pruning_loses_nothing(holed: GraspObject, surface: Surface) -> None:
    triples = random_triples(surface, 1_000, rng())
    triples = triples.take(closed(holed, triples, tip_radius=0.0))
    epsilon = [epsilon_of(holed, triples.take(np.array([k]))) for k in range(len(triples.mu))]
    assert len(epsilon) > 10
    assert (upper_bound(holed, triples) >= epsilon).all()
    _, found = best_of(holed, triples)
    assert found == pytest.approx(max(epsilon), rel=1e-12)


def test_the_long_search_never_ends_below_where_it_starts() -> None:
    box = cube()
    surface = surface_of(erode(box.polyhedron))
    triples = random_triples(surface, 500, rng())
    start, at_first = best_of(box, triples.take(closed(box, triples, tip_radius=0.0)))
    found, epsilon = best_known(
        box, surface, 0.0, rng(), start, num=200, efforts=(Effort(6, 16, 12, 0.3),)
    )
    assert force_closure(*found.contacts).all()
    # Two contacts on a diagonal of one face, one in the middle of the other: far better.
    assert epsilon > 1.2 * at_first


def test_no_triples_give_no_grasp() -> None:
    none = Triples(
        np.empty((0, 3, 3)), np.empty((0, 3), int), np.empty((0, 3, 3)), np.empty((0, 3))
    )
    best, epsilon = best_of(cube(), none)
    assert (len(best.mu), epsilon) == (0, 0.0)


def test_what_is_proved_is_on_the_surface_with_room_and_holds() -> None:
    box = cube()
    regions = erode(box.polyhedron)
    bottom, top = (int(np.argmax(regions.nhat_TB_B @ n)) for n in ([0, 0, 1], [0, 0, -1]))
    region = np.array([[bottom, bottom, top]])
    p_BC = np.array([[[0.02, 0.03, 0.0], [0.04, 0.03, 0.0], [0.03, 0.03, 0.06]]])
    assert is_proved(box, triples_at(regions, p_BC, region), regions.face[region], 0.001)
    beside, crooked = p_BC + np.array([0.05, 0, 0]), p_BC.copy()
    crooked[0, 2, 0] = 0.059  # past both friction cones at the bottom
    for contacts in (beside, crooked):
        triple = triples_at(regions, contacts, region)
        assert not is_proved(box, triple, regions.face[region], 0.001)


def test_a_search_gives_its_best_grasp_that_is_proved(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuses_two(*_: object) -> bool:
        asked.append(len(asked))
        return len(asked) > 2

    asked: list[int] = []
    best = measure.search(cube(), random_triples, 300)
    monkeypatch.setattr(measure, "is_proved", refuses_two)
    third = measure.search(cube(), random_triples, 300)
    assert len(asked) == 3
    assert 0 < third["epsilon"] < best["epsilon"]
    monkeypatch.setattr(measure, "is_proved", lambda *_: False)
    assert measure.search(cube(), random_triples, 300)["p_BC"] is None


def test_there_are_sixty_generated_objects_of_many_kinds(tmp_path: Path) -> None:
    subjects = generated(tmp_path)
    assert len({subject.name for subject in subjects}) == len(subjects) >= 60
    assert len({subject.kind for subject in subjects}) >= 5
    assert all(subject.file.exists() for subject in [*subjects, *models()])


def test_ratios_are_ours_over_theirs() -> None:
    def result(name: str, ours: float, quick: float, theirs: float) -> dict[str, object]:
        seconds = {"load": 0.0, "plan": 0.5, "certify": 0.0}
        mine = {"epsilon": ours, "sets": 1, "faces": 6, "seconds": seconds, "megabytes": 1.0}
        quickly = mine | {"epsilon": quick, "seconds": {"plan": 0.125}}
        random = {"epsilon": theirs, "seconds": {"total": 0.25}}
        return {"kind": "k", "name": name, "ours": mine, "quick": quickly, "random": random}

    results = [
        result("ellipsoid_10_s0", 0.3, 0.15, 0.2),
        result("ellipsoid_30_s0", 0.1, 0.05, 0.2),
    ]
    printed = dict(zip(HEADER.replace(" s ", "_s ").split(), row(results[0]).split(), strict=False))
    assert (printed["/quick"], printed["/random"], printed["quick_s"]) == ("2.00", "1.50", "0.125")
    lines = [line.split() for line in kinds_table(results).splitlines()]
    assert ["k", "2", "random", "1.000", "0.520", "0.500", "50", "%"] in lines
    assert ["k", "2", "q", "/", "random", "0.500", "0.260", "0.250", "0", "%"] in lines
    assert ["k", "2", "t(random)", "2.00", "2.00", "2.00", "100", "%"] in lines
    assert ["k", "2", "tq(random)", "0.50", "0.50", "0.50", "0", "%"] in lines
    assert "0.00" in growth_table(results)


def test_peers_find_grasps_on_a_model_and_the_same_ones_each_time() -> None:
    file = ROOT / "models" / "wedge" / "wedge.urdf"
    first, again = peers(file, None, repeat=1), peers(file, None, repeat=1)
    for name in ("random", "random_x4", "antipodal"):
        assert first[name]["epsilon"] == again[name]["epsilon"] > 0.02
        assert first[name]["p_BC"] == again[name]["p_BC"]


def test_the_command_prints_its_tables(tmp_path: Path) -> None:
    out = tmp_path / "out.json"
    command = [sys.executable, "-m", "benchmarks.compare", "wedge", "--repeat", "1", "--alone"]
    done = subprocess.run(
        [*command, "--json", str(out)], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert "wedge" in done.stdout
    (result,) = json.loads(out.read_text())
    assert result["ours"]["epsilon"] > 0.05
    assert result["quick"]["epsilon"] > 0.04
    assert result["ours"]["megabytes"] > 50


def test_scans_are_closed_and_of_every_shape_size_and_noise_once() -> None:
    every = list(scans.scans())
    assert len(every) == 20
    for shape in {scan.shape for scan in every}:
        of_shape = [scan for scan in every if scan.shape == shape]
        assert [scan.num_triangles for scan in of_shape] == list(scans.SIZES)
        assert sorted(scan.noise for scan in of_shape) == sorted(scans.NOISES)
    for scan in every:
        assert len(scan.triangles) == scan.num_triangles
        corners = np.unique(scan.triangles.reshape(-1, 3), axis=0, return_inverse=True)[1]
        directed = np.stack([corners.reshape(-1, 3), np.roll(corners.reshape(-1, 3), -1, 1)], -1)
        sides = directed.reshape(-1, 2)
        # Each side is gone along once in each direction.
        assert len(np.unique(sides, axis=0)) == len(sides)
        assert (np.unique(sides, axis=0) == np.unique(sides[:, ::-1], axis=0)).all()


def test_the_grasps_of_a_scan_are_counted_and_asked_about() -> None:
    found = scans.result(next(scans.scans()), top=2)
    assert (found.num_grasps, found.faults) == (2, [])
    assert found.epsilon is not None
    assert found.epsilon > 0.05


def test_the_time_of_a_command_is_that_of_all_its_processes() -> None:
    burn = "import time\nwhile time.process_time() < 0.3: pass"
    child = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {burn!r}])"
    for command in (burn, child):
        seconds = shell.run([sys.executable, "-c", command], {})
        assert seconds.processor >= 0.3
        assert seconds.clock >= 0.3
    assert shell.Seconds(3.0, 8.0).over(shell.Seconds(2.0, 4.0)) == (1.5, 2.0)


def test_commands_are_timed_beside_drake_s_parser(tmp_path: Path) -> None:
    cube_file = ROOT / "models" / "cube" / "cube.sdf"
    (name, seconds, ratio), *others = shell.measure(cube_file, 1, tmp_path)
    assert (name, ratio) == ("Drake's Parser", (1.0, 1.0))
    assert {other[0] for other in others} >= {"plan", "verify", "explain", "--help"}
    for _, other, quotient in others:
        assert quotient.processor == pytest.approx(other / seconds)
    assert (tmp_path / "written.grasp.yaml").is_file()


def test_the_documentation_s_commands_take_the_options_that_it_gives_them() -> None:
    pages = [path.read_text() for path in (ROOT / "benchmarks" / "README.md", *DOCS)]
    found = re.findall(r"python -m benchmarks\.(\w+)([^`\n|]*)", "\n".join(pages))
    options: dict[str, set[str]] = {}
    for module, rest in found:
        options.setdefault(module, set()).update(re.findall(r"--[\w-]+", rest))
    assert len(options) >= 6
    for module, given in options.items():
        command = [sys.executable, "-m", f"benchmarks.{module}", "--help"]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
        assert given <= set(re.findall(r"--[\w-]+", done.stdout)), module
