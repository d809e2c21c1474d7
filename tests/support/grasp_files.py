"""The example of the grasp file: a box of 0.1 x 0.1 x 0.2 m and 1 kg, and how to spoil it."""

from __future__ import annotations

from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any

import yaml

Document = dict[str, Any]

BOX_SDF = """\
<sdf version="1.9">
  <model name="box">
    <link name="box">
      <inertial>
        <mass>1</mass>
        <inertia>
          <ixx>0.00416667</ixx><iyy>0.00416667</iyy><izz>0.00166667</izz>
          <ixy>0</ixy><ixz>0</ixz><iyz>0</iyz>
        </inertia>
      </inertial>
      <collision name="box">
        <geometry><box><size>0.1 0.1 0.2</size></box></geometry>
        <surface><friction><ode><mu>0.3</mu><mu2>0.3</mu2></ode></friction></surface>
      </collision>
    </link>
  </model>
</sdf>
"""

EXAMPLE = f"""\
format: drake_polygrasp/grasps
version: 1
generator: {{drake_polygrasp: "0.1.0", drake: "1.58.0"}}
object:
  model_file: box.sdf
  sha256: "{64 * "0"}"
  model_name: box
  body_name: box
  mass: 1.0
  p_BBcm: [0.0, 0.0, 0.0]
  rho: 0.12247448713915891
  num_faces: 6
plan: {{method: enriched, edge_clearance: 0.0024, tip_radius: 0.0049}}
grasps:
- kind: two_faces
  faces: [5, 0, 0]
  contacts:
  - p_BC: [0.05, 0.0, 0.0]
    nhat_TB_B: [-1.0, 0.0, 0.0]
    mu: 0.3
    f_Bc_B: [-0.5, 0.0, 0.0]
  - {{p_BC: [-0.05, 0.02, 0.0], nhat_TB_B: [1.0, 0.0, 0.0], mu: 0.3, f_Bc_B: [0.25, 0.0, 0.0]}}
  - {{p_BC: [-0.05, -0.02, 0.0], nhat_TB_B: [1.0, 0.0, 0.0], mu: 0.3, f_Bc_B: [0.25, 0.0, 0.0]}}
  grasp_plane: {{nhat_B: [0.0, 0.0, 1.0], p_BP: [0.0, 0.0, 0.0]}}
  quality: {{scale: object, Q: 0.61, q: [0.9, 0.8, 0.85, 1.0, 1.0]}}
  certificate:
    internal_force: [2.5, 2.5, -1.25]
    margin: 0.75
    mu_min: 0.0
    mu_min_internal_force: [2.5, 2.5, -1.25]
    epsilon_lower: 0.02448
    epsilon_upper: 0.02470
    placement_tolerance: 0.00287
    squeeze_force: 35.4
"""
TETRAHEDRON_VTK = """\
# vtk DataFile Version 3.0
tetrahedron
ASCII
DATASET UNSTRUCTURED_GRID
POINTS 4 double
0 0 0  1 0 0  0 1 0  0 0 1
CELLS 1 5
4 0 1 2 3
CELL_TYPES 1
10
"""


def write_box(folder: Path, text: str = EXAMPLE) -> Path:
    """The example and its model; the digest is computed as the format defines it."""
    (folder / "box.sdf").write_text(BOX_SDF)
    digest = sha256(sha256(BOX_SDF.encode()).digest()).hexdigest()
    file = folder / "box.grasp.yaml"
    file.write_text(text.replace(64 * "0", digest))
    return file


def edit(file: Path, change: Callable[[Document], object]) -> Path:
    """The file after `change` has had its document."""
    document = yaml.safe_load(file.read_text())
    change(document)
    file.write_text(yaml.safe_dump(document, sort_keys=False))
    return file


def rebalance(grasp: Document) -> None:
    """Make f_Bc_B what the contacts and internal_force make it; plain arithmetic, our own."""
    p = [contact["p_BC"] for contact in grasp["contacts"]]
    x_12, x_13, x_23 = grasp["certificate"]["internal_force"]
    pushes = ({1: x_12, 2: x_13}, {0: x_12, 2: x_23}, {0: x_13, 1: x_23})
    for i, contact in enumerate(grasp["contacts"]):
        contact["f_Bc_B"] = [
            sum(x * (p[j][k] - p[i][k]) for j, x in pushes[i].items()) for k in range(3)
        ]
