"""The grasp file: what is written, what is read back, and what is refused."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import re
import stat
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from pydrake.common.yaml import yaml_load_file

from drake_polygrasp.arrays import frozen
from drake_polygrasp.errors import GraspFileError
from drake_polygrasp.files.grasp_file import (
    grasp_document,
    load_grasps,
    save_grasps,
    write_document,
)
from drake_polygrasp.files.plain_yaml import MAX_YAML_BYTES
from drake_polygrasp.files.stated_grasp import GraspFile, StatedPlan
from drake_polygrasp.geometry.polyhedron import Face, Polyhedron
from drake_polygrasp.grasp import (
    Certificate,
    CertifiedGrasp,
    Grasp,
    GraspObject,
    GraspPlane,
    ModelSource,
    Quality,
)
from tests.support.grasp_files import EXAMPLE

KEYS = {
    "root": ["format", "version", "generator", "object", "plan", "grasps"],
    "object": [
        "model_file",
        "sha256",
        "model_name",
        "body_name",
        "mass",
        "p_BBcm",
        "rho",
        "num_faces",
    ],
    "grasp": ["kind", "faces", "contacts", "grasp_plane", "quality", "certificate"],
    "contact": ["p_BC", "nhat_TB_B", "mu", "f_Bc_B"],
    "certificate": [
        "internal_force",
        "margin",
        "mu_min",
        "mu_min_internal_force",
        "epsilon_lower",
        "epsilon_upper",
        "placement_tolerance",
        "squeeze_force",
        "tilt_tolerance",
        "friction_tolerance",
    ],
}


def the_object(folder: Path, mass: float | None = 1.0) -> GraspObject:
    face = Face(R_BF=frozen(np.eye(3)), p_BF=frozen(np.zeros(3)), polygon_F=None, mu=0.3)
    surface = Polyhedron((face,) * 6, 0.2449, frozen(np.zeros((0, 3, 3))), frozen([], np.int64))
    source = ModelSource(folder / "models" / "box.sdf", "0" * 64, "box", "box")
    return GraspObject(surface, mass, frozen([0.0, -0.0, 0.0]), 0.12247448713915891, source)


def the_grasp() -> CertifiedGrasp:
    """Two contacts against one, on the long faces of a box."""
    grasp = Grasp(
        p_BC=frozen([[0.05, 0, 0], [-0.05, 0.02, 0], [-0.05, -0.02, 0]]),
        nhat_TB_B=frozen([[-1, 0, 0], [1, 0, 0], [1, 0, 0]]),
        mu=frozen([0.3, 0.3, 0.3]),
        kind="two_faces",
        faces=(5, 0, 0),
        grasp_plane=GraspPlane(frozen([0, 0, 1]), frozen([0, 0, 0])),
        quality=Quality("object", 0.61, (0.9, 0.8, 0.85, 1.0, 1.0)),
    )
    certificate = Certificate(
        internal_force=frozen([2.5, 2.5, -1.25]),
        margin=0.75,
        mu_min=0.0,
        mu_min_internal_force=frozen([2.5, 2.5, -1.25]),
        epsilon_lower=0.02448,
        epsilon_upper=0.02470,
        placement_tolerance=0.00287,
        tilt_tolerance=1e-5,
        friction_tolerance=0.01,
        squeeze_force=35.4,
    )
    return CertifiedGrasp(grasp, certificate)


def save(path: Path, mass: float | None = 1.0, **changes: object) -> str:
    grasp = the_grasp()
    certificate = dataclasses.replace(grasp.certificate, **changes)
    grasps = [dataclasses.replace(grasp, certificate=certificate)]
    settings = {"method": "enriched", "edge_clearance": np.float64(0.0024), "top": 10}
    save_grasps(path, the_object(path.parent, mass), grasps, StatedPlan(settings))
    return path.read_text()


def test_keys_stand_in_the_contract_s_order(tmp_path: Path) -> None:
    document = yaml.safe_load(save(tmp_path / "box.grasp.yaml"))
    (grasp,) = document["grasps"]
    assert list(document) == KEYS["root"]
    assert list(document["object"]) == KEYS["object"]
    assert list(grasp) == KEYS["grasp"]
    assert [list(contact) for contact in grasp["contacts"]] == [KEYS["contact"]] * 3
    assert list(grasp["grasp_plane"]) == ["nhat_B", "p_BP"]
    assert list(grasp["quality"]) == ["scale", "Q", "q"]
    assert list(grasp["certificate"]) == KEYS["certificate"]
    assert list(document["generator"]) == ["drake_polygrasp", "drake"]


def test_the_written_file_says_what_the_contract_s_example_says(tmp_path: Path) -> None:
    written = yaml.safe_load(save(tmp_path / "box.grasp.yaml"))["grasps"][0]
    example = yaml.safe_load(EXAMPLE)["grasps"][0]
    for extra in ("tilt_tolerance", "friction_tolerance"):
        del written["certificate"][extra]
    assert written == example


def test_the_same_grasps_give_the_same_bytes(tmp_path: Path) -> None:
    assert save(tmp_path / "a.yaml") == save(tmp_path / "b.yaml")


@pytest.mark.parametrize("is_there", [True, False])
def test_a_link_stays_and_the_file_that_it_leads_to_is_written(
    tmp_path: Path, is_there: bool
) -> None:
    real, link = tmp_path / "far" / "off" / "real.yaml", tmp_path / "link.yaml"
    real.parent.mkdir(parents=True)
    if is_there:
        real.write_text("an older file")
    link.symlink_to(real)
    save_grasps(link, the_object(tmp_path), [the_grasp()], StatedPlan({}))
    assert link.is_symlink()
    assert not real.is_symlink()
    file = load_grasps(link)
    # A path in the file is relative to the folder that the file itself is in.
    assert (file.path.parent / file.object_.model_file).resolve() == tmp_path / "models/box.sdf"
    assert [entry.name for entry in real.parent.iterdir()] == ["real.yaml"]


@pytest.mark.parametrize("name", ["/dev/stdout", "/dev/fd/{}", "/proc/self/fd/{}"])
def test_standard_output_is_refused_even_where_it_goes_to_a_file(name: str, tmp_path: Path) -> None:
    with (tmp_path / "open.txt").open("w") as opened:
        path = Path(name.format(opened.fileno()))
        with pytest.raises(GraspFileError, match="not a regular file"):
            save_grasps(path, the_object(tmp_path), [the_grasp()], StatedPlan({}))
    assert (tmp_path / "open.txt").read_text() == ""
    assert [entry.name for entry in tmp_path.iterdir()] == ["open.txt"]


@pytest.mark.parametrize("name", ["box: - #1", "två ord 物体 \U0001f600", "cube\udcff"])
def test_files_are_the_same_with_libyaml_and_without(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert yaml.__with_libyaml__
    document = {**yaml.safe_load(EXAMPLE)}
    document["object"]["model_name"] = name
    found = []
    for with_libyaml in (True, False):
        monkeypatch.setattr(yaml, "__with_libyaml__", with_libyaml)
        write_document(tmp_path / "box.grasp.yaml", document)
        file = load_grasps(tmp_path / "box.grasp.yaml")
        found.append(((tmp_path / "box.grasp.yaml").read_bytes(), repr(file)))
        assert file.object_.model_name == name
    assert found[0] == found[1]


def test_what_is_written_is_read_back_exactly(tmp_path: Path) -> None:
    save(tmp_path / "box.grasp.yaml")
    read = load_grasps(tmp_path / "box.grasp.yaml")
    (stated,), certified = read.grasps, the_grasp()
    np.testing.assert_array_equal(stated.grasp.p_BC, certified.grasp.p_BC)
    np.testing.assert_array_equal(stated.grasp.nhat_TB_B, certified.grasp.nhat_TB_B)
    np.testing.assert_array_equal(stated.f_Bc_B, [[-0.5, 0, 0], [0.25, 0, 0], [0.25, 0, 0]])
    assert stated.grasp.faces == (5, 0, 0)
    assert stated.grasp.quality == certified.grasp.quality
    for name in KEYS["certificate"]:
        np.testing.assert_array_equal(
            getattr(stated.certificate, name), getattr(certified.certificate, name)
        )
    assert read.object_.mass == 1.0
    assert read.object_.num_faces == 6
    assert read.plan.stated == {"method": "enriched", "edge_clearance": 0.0024, "top": 10}


@given(st.floats(min_value=5e-324, max_value=1.7e308))
def test_every_double_survives_the_file(tmp_path_factory: pytest.TempPathFactory, x: float) -> None:
    path = tmp_path_factory.getbasetemp() / "double.grasp.yaml"
    save(path, margin=x)
    assert load_grasps(path).grasps[0].certificate.margin == x


def test_drake_s_own_yaml_reads_the_file_to_the_same_numbers(tmp_path: Path) -> None:
    path = tmp_path / "box.grasp.yaml"
    save(path, margin=1e-5)
    certificate = yaml_load_file(path)["grasps"][0]["certificate"]
    assert certificate["margin"] == 1e-5
    assert certificate["internal_force"] == [2.5, 2.5, -1.25]


def test_a_model_without_mass_says_null_and_states_no_squeeze(tmp_path: Path) -> None:
    text = save(tmp_path / "box.grasp.yaml", mass=None, squeeze_force=None)
    assert "\n  mass: null\n" in text
    assert "squeeze_force" not in text
    assert load_grasps(tmp_path / "box.grasp.yaml").object_.mass is None


def test_minus_zero_is_written_as_zero(tmp_path: Path) -> None:
    assert "-0.0," not in save(tmp_path / "box.grasp.yaml")


def test_the_model_is_named_relative_to_the_file(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    grasps, object_ = [the_grasp()], the_object(tmp_path)
    save_grasps(tmp_path / "out" / "box.grasp.yaml", object_, grasps, StatedPlan())
    read = load_grasps(tmp_path / "out" / "box.grasp.yaml")
    assert read.object_.model_file == "../models/box.sdf"


def test_an_unfinished_write_leaves_the_older_file_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "box.grasp.yaml"
    path.write_text("older")

    def disk_full(self: Path, text: str, **_: object) -> None:
        self.write_bytes(text[:10].encode())
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", disk_full)
    with pytest.raises(GraspFileError, match="No space left"):
        save_grasps(path, the_object(tmp_path), [the_grasp()], StatedPlan())
    assert [path] == list(tmp_path.iterdir())
    assert path.read_bytes() == b"older"


def test_the_file_gets_the_rights_that_any_new_file_gets(tmp_path: Path) -> None:
    save(tmp_path / "box.grasp.yaml")
    (tmp_path / "plain").touch()
    rights = [
        stat.S_IMODE((tmp_path / name).stat().st_mode) for name in ("box.grasp.yaml", "plain")
    ]
    assert rights[0] == rights[1]


def test_what_is_not_finite_is_not_written(tmp_path: Path) -> None:
    with pytest.raises(GraspFileError, match="finite numbers, not inf"):
        save(tmp_path / "box.grasp.yaml", epsilon_upper=math.inf)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("path", ["/dev/null", "/no/such/folder/box.grasp.yaml"])
def test_where_no_file_can_be_written_is_said(tmp_path: Path, path: str) -> None:
    with pytest.raises(GraspFileError, match=f"{path}: cannot be written"):
        save_grasps(path, the_object(tmp_path), [the_grasp()], StatedPlan())
    assert stat.S_ISCHR(Path("/dev/null").stat().st_mode)


def test_the_example_of_the_contract_is_read(tmp_path: Path) -> None:
    assert load(tmp_path, EXAMPLE).grasps[0].certificate.margin == 0.75


def test_unknown_keys_are_allowed(tmp_path: Path) -> None:
    text = EXAMPLE.replace("- kind:", "- novel: {a: [1, {b: x}]}\n  kind:") + "later: 1\n"
    assert len(load(tmp_path, text).grasps) == 1


def test_numbers_may_be_written_as_json_writes_them(tmp_path: Path) -> None:
    text = EXAMPLE.replace("margin: 0.75", "margin: 75e-2")
    assert load(tmp_path, text).grasps[0].certificate.margin == 0.75


OPTIONAL = ("margin", "mu_min", "mu_min_internal_force", "epsilon_lower", "epsilon_upper")


@pytest.mark.parametrize("key", [*OPTIONAL, "placement_tolerance", "squeeze_force", "quality"])
def test_what_version_1_does_not_require_may_be_left_out(tmp_path: Path, key: str) -> None:
    load(tmp_path, re.sub(rf"^ *{key}: .*\n", "", EXAMPLE, flags=re.MULTILINE))


def refusals() -> list[tuple[str, str, str]]:
    """Text of the example, what replaces it, and what the refusal says."""
    required = [
        (
            line,
            re.sub(r"\w+:", "renamed:", line, count=1),
            f"{line.split(':')[0].strip(' -')} is missing",
        )
        for line in (
            "format: drake_polygrasp/grasps",
            "version: 1",
            "generator: {",
            "model_file: box.sdf",
            "sha256: ",
            "model_name: box",
            "body_name: box",
            "mass: 1.0",
            "p_BBcm: [",
            "rho: 0.1",
            "num_faces: 6",
            "kind: two_faces",
            "faces: [",
            "contacts:\n",
            "p_BC: [0.05,",
            "nhat_TB_B: [-1.0",
            "mu: 0.3\n",
            "f_Bc_B: [-0.5",
            "grasp_plane: {",
            "nhat_B: [",
            "p_BP: [",
            "internal_force: [2.5",
        )
    ]
    return [
        *required,
        ("version: 1", "version: 2", "version is 2"),
        ("version: 1", "version: '1'", "version is '1', not a whole number"),
        ("format: drake_polygrasp/grasps", "format: other", "not a grasp file"),
        ("mu: 0.3\n", "mu: -0.3\n", r"contacts\[0\].mu is -0.3, not positive"),
        ("mu: 0.3\n", "mu: 0\n", r"mu is 0, not positive"),
        ("mu: 0.3\n", "mu: .nan\n", r"grasps\[0\].contacts\[0\].mu is nan, not a finite"),
        ("mu: 0.3\n", "mu: 1e999\n", "mu is inf, not a finite"),
        ("mu: 0.3\n", f"mu: 1{'0' * 400}\n", "not a finite"),
        ("mu: 0.3\n", "mu: true\n", "mu is True, not a finite number"),
        ("mu: 0.3\n", "mu: '0.3'\n", "mu is '0.3', not a finite number"),
        ("mu: 0.3\n", "mu: [0.3]\n", "not a finite number"),
        ("mu: 0.3\n", "mu: null\n", "mu is null"),
        ("mu: 0.3\n", "mu: 0.3\n    mu: 0.3\n", "line 21: the key 'mu' appears a second time"),
        ("margin: 0.75", "margin: -0.75", "margin is -0.75, not zero or positive"),
        ("mass: 1.0", "mass: -1.0", "mass is -1.0, not positive"),
        ("rho: 0.12", "rho: -0.12", "not positive"),
        ("p_BC: [0.05, 0.0, 0.0]", "p_BC: [0.05, 0.0]", "not a list of 3 finite numbers"),
        ("p_BC: [0.05, 0.0, 0.0]", "p_BC: [0.05, .inf, 0.0]", "not a list of 3 finite numbers"),
        ("p_BC: [0.05, 0.0, 0.0]", "p_BC: 0.05", "not a list of 3 finite numbers"),
        ("faces: [5, 0, 0]", "faces: [5, 0]", "faces is"),
        ("faces: [5, 0, 0]", "faces: [5, 0, -1]", "faces is"),
        ("faces: [5, 0, 0]", "faces: [5, 0, 0.0]", "faces is"),
        ("kind: two_faces", "kind: four_faces", "not one of three_faces"),
        ("q: [0.9,", "q: [", "not a list of 5"),
        ("scale: object", "scale: mine", "not one of paper, object"),
        ('sha256: "0', 'sha256: "z', "64 hexadecimal digits"),
        ("grasps:\n", "grasps: 3\nother:\n", "grasps is 3, not a list"),
        ("model_name: box", "model_name: ''", "model_name is ''"),
        ("model_name: box", "model_name: !!python/name:os.system ''", "tag"),
        ("model_name: box", "model_name: !!python/object/apply:os.getcwd []", "tag"),
        ("model_name: box", "model_name: &a box\n  body_name: *a\n  extra: 1", "alias"),
        ("generator: {", "generator: [{", "is not plain YAML"),
    ]


@pytest.mark.parametrize(("old", "new", "message"), refusals())
def test_a_broken_file_is_refused_with_its_place(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    assert old in EXAMPLE
    with pytest.raises(GraspFileError, match=message) as refusal:
        load(tmp_path, EXAMPLE.replace(old, new, 1))
    assert str(refusal.value).startswith(f"{tmp_path}/example.grasp.yaml: ")


@pytest.mark.parametrize(
    "text",
    [
        "",
        "3",
        "- 1",
        "text",
        "[" * 100_000,
        "a: &a [x]\nb: &b [*a, *a]\nc: &c [*b, *b]\n",
        "a: 1\n---\nb: 2\n",
        "? [1]\n: 2\n",
        f"a: {'9' * 5000}",
        "\x00",
        "a: \ttabs",
    ],
)
def test_what_is_no_plain_mapping_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(GraspFileError):
        load(tmp_path, text)


@given(st.binary(max_size=200))
def test_no_bytes_at_all_raise_anything_else(
    tmp_path_factory: pytest.TempPathFactory, data: bytes
) -> None:
    path = tmp_path_factory.getbasetemp() / "bytes.grasp.yaml"
    path.write_bytes(data)
    with pytest.raises(GraspFileError):
        load_grasps(path)


@given(st.data())
def test_an_example_cut_or_garbled_anywhere_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    start = data.draw(st.integers(0, len(EXAMPLE)))
    end = data.draw(st.integers(start, min(start + 20, len(EXAMPLE))))
    text = EXAMPLE[:start] + data.draw(st.text(max_size=5)) + EXAMPLE[end:]
    path = tmp_path_factory.getbasetemp() / "garbled.grasp.yaml"
    path.write_text(text, encoding="utf-8", errors="replace")
    with contextlib.suppress(GraspFileError):
        load_grasps(path)


def test_a_missing_a_huge_and_an_endless_file_are_refused(tmp_path: Path) -> None:
    with pytest.raises(GraspFileError, match="there is no such grasp file"):
        load_grasps(tmp_path / "none.grasp.yaml")
    huge = tmp_path / "huge.grasp.yaml"
    with huge.open("wb") as file:
        file.truncate(MAX_YAML_BYTES + 1)
    with pytest.raises(GraspFileError, match="larger than"):
        load_grasps(huge)
    with pytest.raises(GraspFileError, match="not a regular file"):
        load_grasps("/dev/zero")


def test_the_document_of_a_grasp_is_plain_data() -> None:
    def plain(value: object) -> bool:
        if isinstance(value, dict):
            return all(type(key) is str and plain(item) for key, item in value.items())
        if type(value) is list:
            return all(map(plain, value))
        return type(value) in (str, int, float)

    assert plain(grasp_document(the_grasp()))


def load(folder: Path, text: str) -> GraspFile:
    path = folder / "example.grasp.yaml"
    path.write_text(text, encoding="utf-8")
    return load_grasps(path)
