"""Prado & Suárez, Heuristic Grasp Planning with Three Frictional Contacts, section by section.

| section | what it does | file | entry | test |
|---|---|---|---|---|
| 4.1, 4.2 | selection of sets of faces by orientation | orientation.py | opposes, pair_opposes | test_orientation.py |
| 4.1 | parallel or non-parallel sets, n_bs | orientation.py | classify | test_orientation.py |
| 4.1, 4.2 | selection of sets of faces by position | position.py | region_rl, strip_rs, parallel_faces_meet, two_faces_meet | test_position.py |
| 5 | grasp plane Pi_p of three faces | grasp_plane.py | nonparallel_planes, parallel_directions | test_grasp_plane.py |
| 5 | grasp plane Pi_p of two faces | two_faces.py | choices, two_face_planes | test_grasp_plane.py |
| 4.1, 5, 6 | intersections of strips, and of strips with hulls | strips.py | strips_meet, hulls_in_strips | test_position.py |
| 6 | segments a_i and region P | region_p.py | cut_nonparallel, cut_parallel, cut_two_faces | test_region_p.py |
| 6 | quality Q, eq. 5 to 10 | quality.py | q_positions, q_orientation, q_directions | test_quality.py |
| 7 | contact points | contact_points.py | nonparallel_contacts, opposed_contacts | test_contact_points.py |
| 4 to 7 | projections, sections and intervals that several steps share | planar.py | section, project | test_position.py |
| 4 to 7 | all steps in order, for all sets of faces | stages.py | plan_sets | test_reference_planner.py |
| 4 to 7 | the reason that ends a set, and constructed contacts | reasons.py | REASONS, MEANING, SetPlan | test_reference_planner.py |
| 4 to 7 | what every step computes for one set | trace.py | trace_set | test_trace.py |
| 4 to 7 | the result of `trace_set` | trace_result.py | SetTrace | test_trace.py |

Section 2 (faces, edges) is geometry/polyhedron.py and geometry/regions.py. Section 3 (force
closure) is certification/ and wrenches/contacts.py, because Proposition 1 as printed is not true.
All functions take batches of sets, as numpy and shapely arrays. Each file says where it departs
from the text, and why. What goes beyond the paper is in search/.
"""  # noqa: E501 - a table

from __future__ import annotations

from typing import TYPE_CHECKING

from drake_polygrasp import lazy_names

if TYPE_CHECKING:
    from drake_polygrasp.paper.trace import trace_set

__all__ = [
    "trace_set",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "trace": ("trace_set",),
    },
)
