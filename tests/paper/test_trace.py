"""A trace shows the planner's own steps: the same sets fall, and the same contacts come out."""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import shapely
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from drake_polygrasp import GraspObject, UsageError, explain_sets, load_object
from drake_polygrasp.cli.main import main
from drake_polygrasp.paper.orientation import least_ball_centre
from drake_polygrasp.paper.reasons import MEANING
from drake_polygrasp.paper.trace import trace_set
from drake_polygrasp.paper.trace_result import SetTrace
from drake_polygrasp.pipeline.explain import Explanation
from drake_polygrasp.visualization.directions import draw_directions
from drake_polygrasp.visualization.explanation import draw_explanation
from drake_polygrasp.visualization.figures import draw_reasons, draw_trace, save_figure
from drake_polygrasp.visualization.meshes import piece_outline, section_lines
from drake_polygrasp.visualization.palette import CONTACTS, PLANE
from drake_polygrasp.visualization.sketch import draw_faces, draw_sketch
from tests.support.grasp_files import BOX_SDF
from tests.support.planned import exact_plan

MODELS = Path(__file__).parents[2] / "models"
FILES = {
    "l_bracket": "l_bracket.sdf",
    "plate_with_hole": "plate_with_hole.sdf",
    "skewed_block": "skewed_block.sdf",
    "t_block": "t_block.urdf",
    "triangular_prism": "triangular_prism.sdf",
}


@cache
def object_(name: str) -> GraspObject:
    return load_object(MODELS / name / FILES.get(name, f"{name}.sdf"))


@cache
def traces(name: str) -> dict[tuple[int, ...], SetTrace]:
    """Of every set of two and three faces."""
    n = len(object_(name).polyhedron.faces)
    sets = [s for k in (2, 3) for s in itertools.combinations(range(n), k)]
    return {faces: trace_set(object_(name), faces) for faces in sets}


@pytest.mark.parametrize("name", FILES)
def test_a_set_ends_in_its_trace_as_it_does_in_explain(name: str) -> None:
    explanation = explain_sets(object_(name), method="paper")
    built = {"certified", "collinear", "tip_blocked", "not_force_closure", "not_evaluated"}
    for faces, reason in zip(explanation.faces.tolist(), explanation.reasons, strict=True):
        its = traces(name)[tuple(sorted({*faces} - {-1}))].reason
        assert its == reason or (its == "not_evaluated" and reason in built)


@pytest.mark.parametrize("name", FILES)
def test_traced_contacts_are_the_planned_ones(name: str) -> None:
    for certified in exact_plan(object_(name), method="paper", top=50).grasps:
        grasp = certified.grasp
        its = traces(name)[tuple(sorted({*grasp.faces}))]
        assert its.faces == grasp.faces
        assert its.p_BC == pytest.approx(grasp.p_BC, abs=1e-6)


@pytest.mark.parametrize("name", FILES)
def test_contacts_are_on_their_segments_and_the_centroid_is_that_of_p(name: str) -> None:
    L = object_(name).polyhedron.diameter
    for its in traces(name).values():
        plane = its.on_pi_p
        if plane is None or plane.p_cI is None:
            continue
        centroid = shapely.get_coordinates(plane.region_p.centroid)[0]
        assert plane.p_cI == pytest.approx(centroid, abs=1e-9 * L)
        if plane.contacts is not None:
            gap = shapely.distance(plane.segments, shapely.points(plane.contacts))
            assert gap.max() < 1e-9 * L


@pytest.mark.parametrize("name", FILES)
def test_segments_are_where_the_plane_cuts_the_faces(name: str) -> None:
    for its in traces(name).values():
        plane = its.on_pi_p
        if plane is None:
            continue
        N = np.cross(*plane.axes_B)
        for index, segments in zip(its.faces, plane.segments, strict=True):
            face = object_(name).polyhedron.faces[index]
            xy = shapely.get_coordinates(segments)
            p_F = (xy @ plane.axes_B + plane.height * N - face.p_BF) @ face.R_BF
            assert np.abs(p_F[:, 2]).max() < 1e-7
            assert shapely.contains(face.polygon_F, shapely.points(p_F[:, :2])).all()


def test_strips_hold_their_faces_and_r_l_is_in_all_of_them() -> None:
    for its in traces("skewed_block").values():
        plane = its.on_pi_l
        if plane is None or plane.region_l is None:
            continue
        that = np.column_stack([-plane.nprime[:, 1], plane.nprime[:, 0]])
        for i in range(3):
            across = shapely.get_coordinates(plane.faces[i]) @ that[i]
            assert [across.min(), across.max()] == pytest.approx([plane.low[i], plane.high[i]])
            inside = shapely.get_coordinates(plane.region_l) @ that[i]
            assert plane.low[i] - 1e-9 <= inside.min()
            assert inside.max() <= plane.high[i] + 1e-9


@pytest.mark.parametrize("name", FILES)
def test_the_grasp_plane_stays_within_r_s(name: str) -> None:
    planes = [its.on_pi_s for its in traces(name).values() if its.on_pi_s is not None]
    assert any(plane.height is not None for plane in planes)
    for plane in planes:
        assert plane.height is None or plane.low < plane.height < plane.high


def test_faces_that_are_not_opposed_are_projected_side_by_side() -> None:
    fallen = [its for its in traces("t_block").values() if its.reason == "not_opposed"]
    assert fallen
    for its in fallen:
        assert its.on_pi_s is not None and its.on_pi_s.height is None
        lone, second, third = its.on_pi_s.faces
        assert not shapely.area(lone & second) and not shapely.area(lone & third)
        assert len(draw_trace(its).axes) == 1


def test_cones_are_within_a_right_angle_of_an_axis_just_when_they_cannot_oppose() -> None:
    for name in ("skewed_block", "triangular_prism"):
        for its in traces(name).values():
            if np.linalg.norm(least_ball_centre(its.nhat_TB_B)) < 1e-9:
                continue  # opposite normals have no such axis
            ax = Figure().add_subplot()
            draw_directions(ax, its)
            rims = [patch.get_xy() for patch in ax.patches if isinstance(patch, Polygon)]
            assert len(rims) == len({*its.faces})
            angle = np.linalg.norm(np.concatenate(rims), axis=1).max()
            assert (angle <= 90 + 1e-6) == (its.reason == "orientation"), its.faces


ENDS = {
    "certified": ("l_bracket", (2, 4, 7)),
    "orientation": ("l_bracket", (0, 1, 2)),
    "rl_empty": ("boxes", (0, 4, 5)),
    "rs_empty": ("boxes", (0, 3, 6)),
    "not_opposed": ("t_block", (0, 9)),
    "p_empty": ("boxes", (0, 3, 5)),
    "off_face": ("boxes", (0, 7, 10)),
    "wrong_order": ("boxes", (4, 5, 6)),
    "collinear": ("boxes", (7, 10, 13)),
    "tip_blocked": ("boxes", (0, 5, 14)),
    "not_force_closure": ("concave_mesh", (0, 1, 8)),
}


@cache
def explained(name: str) -> Explanation:
    return explain_sets(object_(name), method="paper")


def labels(ax: Axes) -> set[str]:
    legend = ax.get_legend()
    return set() if legend is None else {text.get_text() for text in legend.get_texts()}


@pytest.mark.parametrize("reason", ENDS)
def test_a_figure_names_the_end_of_its_set_and_shows_it(reason: str) -> None:
    name, faces = ENDS[reason]
    figure = draw_explanation(object_(name), explained(name), faces)
    sketch, *panels = figure.axes
    assert {int(text.get_text()) for text in sketch.texts} == {*faces}
    title = figure.get_suptitle()
    assert reason in title and MEANING[reason][1] in title
    its, last = trace_set(object_(name), faces), panels[-1]
    if reason == "orientation":
        assert len(panels) == 1 and "cone 1" in labels(last)
    if reason == "rl_empty":
        assert its.on_pi_l is not None and its.on_pi_l.region_l is None
    if reason == "rs_empty":
        assert its.on_pi_s is not None and its.on_pi_s.heights is not None
        low, high = its.on_pi_s.heights.T
        assert low.max() >= high.min()
        assert {f"heights of $A_{{l{i}}}$" for i in (1, 2, 3)} <= labels(last)
    if reason == "p_empty":
        assert its.on_pi_p is not None and its.on_pi_p.region_p.is_empty
        assert "$P$" not in labels(last)
    said = set().union(*map(labels, panels))
    assert ("no room for it" in said) >= (reason == "tip_blocked")
    assert ("fingertip" in said) == (its.p_BC is not None)
    unbalanced = last.get_title() == "forces that cancel leave the cones"
    assert unbalanced == (reason in ("collinear", "not_force_closure"))


def test_a_section_is_the_outline_of_the_object() -> None:
    bracket = object_("l_bracket").polyhedron
    lines = section_lines(bracket, np.array([0.0, 1.0, 0.0]), 0.0301)
    assert np.abs(lines[..., 1] - 0.0301).max() < 1e-12
    ends, count = np.unique(lines.reshape(-1, 3).round(9), axis=0, return_counts=True)
    assert (count == 2).all() and len(ends) >= 6
    assert np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1).sum() == pytest.approx(0.44)


def test_faces_that_are_no_set_are_a_usage_error() -> None:
    for faces in ((1,), (1, 2, 3, 4), (1, 99)):
        with pytest.raises(UsageError, match="not a set of two or three faces"):
            trace_set(object_("l_bracket"), faces)


@pytest.mark.parametrize(
    ("name", "faces", "panels"),
    [
        ("l_bracket", (2, 4, 7), 4),  # three faces
        ("l_bracket", (2, 3, 4), 3),  # parallel: no Pi_l
        ("l_bracket", (1, 5), 3),  # a pair
        ("plate_with_hole", (0, 4, 5), 3),  # no contacts: no forces
        ("l_bracket", (0, 1, 2), 1),  # fell at orientation
    ],
)
def test_a_figure_has_a_panel_for_each_plane_that_the_set_came_to(
    name: str, faces: tuple[int, ...], panels: int, tmp_path: Path
) -> None:
    its = traces(name)[faces]
    figure = draw_trace(its)
    assert len(figure.axes) == panels
    title = figure.get_suptitle()
    assert ("contacts found" in title) == (its.p_BC is not None)
    assert its.p_BC is not None or its.reason in title
    figure.savefig(tmp_path / "figure.png", dpi=50)
    for ax in figure.axes:
        drawn = {to_hex(line.get_color()).upper() for line in ax.lines}
        drawn |= {to_hex(patch.get_facecolor()).upper() for patch in ax.patches}
        assert drawn & {*CONTACTS}, ax.get_title()
        assert ax.get_legend() is not None


def test_the_force_triangle_closes() -> None:
    for faces in ((2, 4, 7), (2, 3, 4)):
        ax = draw_trace(traces("l_bracket")[faces]).axes[-1]
        arrows = [(text.xy, text.xyann) for text in ax.texts]  # type: ignore[attr-defined]
        total = sum(np.subtract(head, tail) for head, tail in arrows)
        assert len(arrows) == 3
        assert np.abs(total).max() < 1e-9


@pytest.mark.parametrize("with_grasp", [False, True])
def test_a_sketch_shows_the_whole_object_and_tints_what_is_touched(with_grasp: bool) -> None:
    bracket = object_("l_bracket")
    grasp = exact_plan(bracket, top=1).grasps[0] if with_grasp else None
    ax = Figure().add_subplot(projection="3d")
    draw_sketch(ax, bracket, grasp)
    low, high = np.array([ax.get_xlim(), ax.get_ylim(), ax.get_zlim()]).T
    vertices = 1e3 * bracket.polyhedron.triangles_B.reshape(-1, 3)
    assert low == pytest.approx(vertices.min(axis=0)) and high == pytest.approx(
        vertices.max(axis=0)
    )
    touched = {*range(8)} if grasp is None else {*grasp.grasp.faces}
    assert {int(text.get_text()) for text in ax.texts} == touched


def test_a_sketch_outlines_what_contacts_may_touch() -> None:
    bracket = object_("l_bracket")
    grasp = exact_plan(bracket, top=1, placement_error=0.002).grasps[0]
    assert grasp.region is not None
    numbers = []
    for shown in (grasp, replace(grasp, region=None)):
        ax = Figure().add_subplot(projection="3d")
        draw_sketch(ax, bracket, shown)
        numbers.append(len(ax.collections))
    assert numbers[0] == numbers[1] + 3
    for pieces, p_BC, nhat_TB_B in zip(
        grasp.region.pieces, grasp.grasp.p_BC, grasp.grasp.nhat_TB_B, strict=True
    ):
        (piece,) = pieces
        arm = piece_outline(piece, lift=0.001) - p_BC
        following = np.roll(arm, -1, axis=0)
        area = np.linalg.norm(np.cross(arm, following).sum(axis=0) / 2)
        # Between a disc of 2 mm and the regular 16-gon around it, where corners are cut at edges.
        assert np.pi * 0.002**2 < area < 16 * np.tan(np.pi / 16) * 0.002**2 * (1 + 1e-6) + 1e-9
        assert -arm @ nhat_TB_B == pytest.approx(0.001, abs=1e-9)


def test_a_sketch_of_a_body_of_patches_numbers_those_of_the_set() -> None:
    bracket = object_("l_bracket")
    patches = tuple(replace(face, reach=1e-3) for face in bracket.polyhedron.faces)
    curved = replace(bracket, polyhedron=replace(bracket.polyhedron, faces=patches))
    ax = Figure().add_subplot(projection="3d")
    draw_faces(ax, curved, (5, 1, 1))
    assert {int(text.get_text()) for text in ax.texts} == {1, 5}


def test_fingertips_are_judged_where_a_patch_lets_them_touch(tmp_path: Path) -> None:
    # Contacts on a patch's plane are inside the cylinder, where no fingertip fits.
    can = "<cylinder><radius>0.03</radius><length>0.1</length></cylinder>"
    sdf = BOX_SDF.replace("<box><size>0.1 0.1 0.2</size></box>", can)
    (tmp_path / "can.sdf").write_text(sdf)
    body = load_object(tmp_path / "can.sdf")
    best = exact_plan(body, method="paper", top=1).grasps[0].grasp
    figure = draw_trace(
        trace_set(body, sorted({*best.faces})), body, 0.02 * body.polyhedron.diameter
    )
    said = set().union(*map(labels, figure.axes))
    assert "fingertip" in said and "no room for it" not in said


def test_reasons_are_bars_as_long_as_their_counts() -> None:
    ax = Figure().add_subplot()
    draw_reasons(ax, {"certified": 3, "orientation": 7})
    assert [bar.get_width() for bar in ax.patches] == [3, 7]  # type: ignore[attr-defined]
    assert to_hex(ax.patches[0].get_facecolor()).upper() == PLANE


@pytest.mark.parametrize("options", [[], ["--set", "1,5"]])
def test_explain_draws_what_it_says(options: list[str], tmp_path: Path) -> None:
    model = str(MODELS / "l_bracket" / "l_bracket.sdf")
    figure = tmp_path / "why.svg"
    assert main(["explain", model, *options, "--figure", str(figure)]) == 0
    assert "</svg>" in figure.read_text()


@pytest.mark.parametrize("name", ["why.sketch", "missing/why.png"])
def test_a_figure_that_cannot_be_written_is_a_usage_error(name: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"picture|written"):
        save_figure(Figure(), tmp_path / name)
