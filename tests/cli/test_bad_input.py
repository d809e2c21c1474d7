"""No bad file breaks the command line: exit code 2 and one message, or a warning and a grasp."""

from __future__ import annotations

import io
import os
import re
import shutil
import sys
import time
from argparse import Namespace
from collections import deque
from collections.abc import Callable
from contextlib import redirect_stderr
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drake_polygrasp.cli.calls import child_limits
from drake_polygrasp.cli.child_process import (
    ChildLimits,
    _CallResult,
    _Conversation,
    _ProgressReport,
    call_in_child,
)
from drake_polygrasp.cli.progress_line import ProgressLine
from drake_polygrasp.cli.reporting import print_warnings
from drake_polygrasp.errors import ModelError
from drake_polygrasp.loading.mesh_file import MAX_TRIANGLES
from tests.support.fuzz import CUBE_OBJ, run, warm_up

BOX = "<box><size>0.1 0.1 0.2</size></box>"
MESH = "<mesh><uri>mesh.obj</uri></mesh>"
VERTICES, QUADS = CUBE_OBJ.splitlines()[:8], CUBE_OBJ.splitlines()[8:]


def sdf(geometry: str = BOX, inertial: str = "<mass>1</mass>", surface: str = "") -> str:
    return (
        f'<sdf version="1.9"><model name="m"><link name="l"><inertial>{inertial}</inertial>'
        f'<collision name="c"><geometry>{geometry}</geometry>{surface}</collision></link>'
        "</model></sdf>"
    )


def urdf(geometry: str = '<box size="0.1 0.1 0.2"/>', mass: str = "1") -> str:
    inertia = '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>'
    return (
        f'<robot name="m"><link name="l"><inertial><mass value="{mass}"/>{inertia}</inertial>'
        f"<collision><geometry>{geometry}</geometry></collision></link></robot>"
    )


def mjcf(attributes: str) -> str:
    return (
        '<mujoco model="m"><worldbody><body name="l">'
        f'<geom type="box" size="0.1 0.1 0.1" {attributes}/></body></worldbody></mujoco>'
    )


def obj(vertices: list[str], faces: list[str]) -> str:
    return "\n".join([*vertices, *faces, ""])


def turned(face: str) -> str:
    letter, *corners = face.split()
    return " ".join([letter, *reversed(corners)])


ENTITIES = "".join(f"<!ENTITY a{k} '" + 10 * f"&a{k - 1};" + "'>" for k in range(1, 12))
BOMB = f'<!DOCTYPE a [<!ENTITY a0 "a">{ENTITIES}]>' + sdf().replace('"m"', '"&a11;"')
ALIASES = "a: &a0 [x]\n" + "".join(
    f"b{k}: &a{k} [" + ", ".join(9 * [f"*a{k - 1}"]) + "]\n" for k in range(1, 12)
)
NO_NUMBERS = {
    "zero": "0",
    "negative": "-0.1",
    "NaN": "nan",
    "empty": "",
    "words": "a",
    "huge": "1e99",
}

REFUSED: dict[str, tuple[str, str, str]] = {
    "an empty file": ("x.sdf", "", "cannot be read as XML"),
    "a truncated file": ("x.sdf", sdf()[:90], "cannot be read as XML"),
    "no XML": ("x.urdf", "hello", "cannot be read as XML"),
    "other XML": ("x.sdf", "<html/>", "its first element is <html>, and Drake reads <sdf>"),
    "UTF-16": ("x.sdf", "\udcff\udcfe" + "\0".join(sdf()), "cannot be read as XML"),
    "text after the model": ("x.sdf", sdf() + "\udcff", "text stands after the last tag"),
    "an entity bomb": ("x.sdf", BOMB, "write them out"),
    "an entity": ("x.sdf", f"<!DOCTYPE a [<!ENTITY s '1'>]>{sdf()}", "write them out"),
    "deep XML": ("x.sdf", 50_000 * "<a>" + 50_000 * "</a>", "x.sdf"),
    "a circle of includes": (
        "x.sdf",
        '<sdf version="1.9"><model name="m"><include><uri>./x.sdf</uri></include></model></sdf>',
        "includes itself",
    ),
    "a circle of directives": (
        "x.dmd.yaml",
        "directives:\n- add_directives: {file: x.dmd.yaml}\n",
        "includes itself",
    ),
    "a YAML bomb": ("x.dmd.yaml", ALIASES, "write them out"),
    "deep YAML": ("x.dmd.yaml", 2_000 * "[" + 2_000 * "]", "nested too deeply"),
    "two models": (
        "x.sdf",
        sdf().replace("</sdf>", '<model name="n"><link name="k"/></model></sdf>'),
        "one model",
    ),
    "a half space": ("x.sdf", sdf("<plane><normal>0 0 1</normal></plane>"), "HalfSpace"),
    "no geometry": ("x.sdf", sdf(""), "no collision geometry"),
    "what Drake drops": (
        "x.sdf",
        sdf("<cone><radius>1</radius><length>1</length></cone>"),
        "no collision geometry",
    ),
    "a missing mesh": ("x.sdf", sdf(MESH), "mesh.obj: there is no such mesh file"),
    "a mesh without a name": ("x.urdf", urdf("<mesh/>"), "names no file"),
    "a missing package": (
        "x.sdf",
        sdf("<mesh><uri>package://gone/mesh.obj</uri></mesh>"),
        "--package-path",
    ),
    "a mesh elsewhere": (
        "x.sdf",
        sdf("<mesh><uri>https://example.org/mesh.obj</uri></mesh>"),
        "name a file or a package",
    ),
    "a folder for a mesh": ("x.sdf", sdf("<mesh><uri>.</uri></mesh>"), "convert it"),
    "an STL mesh": ("x.sdf", sdf("<mesh><uri>mesh.stl</uri></mesh>"), "convert it to .obj"),
    "an STL model": ("x.stl", "solid", "convert it"),
    "a scale of zero": (
        "x.sdf",
        sdf(MESH.replace("</uri>", "</uri><scale>0 1 1</scale>")),
        "scale",
    ),
    "a scale of NaN": ("x.urdf", urdf('<mesh filename="mesh.obj" scale="nan 1 1"/>'), "scale"),
    "NaN friction": (
        "x.sdf",
        sdf(surface="<surface><friction><ode><mu>nan</mu></ode></friction></surface>"),
        "friction",
    ),
    "friction beyond measure": ("x.xml", mjcf('friction="1e300"'), "above 0 and at most 100"),
    "a mesh of NaN": ("x.obj", CUBE_OBJ.replace("1 1 1", "1 nan 1"), "vertex 7 is not finite"),
    "a mesh of infinity": ("x.obj", CUBE_OBJ.replace("1 1 1", "1 -inf 1"), "is not finite"),
    "an overflowing mesh": ("x.obj", CUBE_OBJ.replace("1 1 1", "1 1e999 1"), "is not finite"),
    "a mesh beyond measure": ("x.obj", CUBE_OBJ.replace("1 1 1", "1 1e39 1"), "lies beyond 1e+09"),
    "an index out of range": ("x.obj", CUBE_OBJ + "f 1 2 99999999\n", "refers to vertex 99999999"),
    "vertices alone": ("x.obj", obj(VERTICES, []), "at least 4 triangles"),
    "one triangle": ("x.obj", obj(VERTICES, ["f 1 2 3"]), "at least 4 triangles, it has 1"),
    "a mesh in one point": ("x.obj", obj(8 * ["v 0 0 0"], QUADS), "x.obj"),
    "a mesh on one line": ("x.obj", obj([f"v {k} 0 0" for k in range(8)], QUADS), "x.obj"),
    "a centre of mass beyond measure": (
        "x.sdf",
        sdf(inertial="<pose>1e300 0 0 0 0 0</pose><mass>1</mass>"),
        "centre of mass",
    ),
    "automatic inertia of a mesh": (
        "x.sdf",
        sdf(MESH, inertial="").replace("<inertial>", '<inertial auto="true">'),
        "state its mass and inertia",
    ),
    "a flat mesh": (
        "x.obj",
        obj([" ".join([*v.split()[:3], "0"]) for v in VERTICES], QUADS),
        "flat",
    ),
    "a mesh with a vertex far away": (
        "x.obj",
        obj([*VERTICES[:7], "v 1e9 1 1"], QUADS),
        "a vertex far away from the others",
    ),
    "a binary mesh": ("x.obj", "\0\1\2" * 99, "at least 4 vertices"),
    **{
        f"a box of size {name}": ("x.sdf", sdf(f"<box><size>1 {text} 1</size></box>"), "size of a")
        for name, text in NO_NUMBERS.items()
    },
    **{
        f"a URDF box of size {name}": ("x.urdf", urdf(f'<box size="1 {text} 1"/>'), "size of a")
        for name, text in NO_NUMBERS.items()
    },
    **{
        f"a sphere of radius {name}": (
            "x.sdf",
            sdf(f"<sphere><radius>{text}</radius></sphere>"),
            "radius of a collision sphere",
        )
        for name, text in NO_NUMBERS.items()
    },
    **{
        f"a mass of {name}": ("x.sdf", sdf(inertial=f"<mass>{text}</mass>"), "x.sdf")
        for name, text in NO_NUMBERS.items()
        if name != "huge"
    },
    **{
        f"a URDF mass of {name}": ("x.urdf", urdf(mass=text), "x.urdf")
        for name, text in NO_NUMBERS.items()
        if name != "huge"
    },
}


@pytest.fixture(autouse=True, scope="module")
def warm() -> None:
    warm_up()


def write(folder: Path, name: str, text: str) -> None:
    (folder / name).write_bytes(text.encode(errors="surrogateescape"))


@pytest.mark.parametrize("case", REFUSED)
def test_exit_code_2_and_one_message_that_names_the_fault(case: str, tmp_path: Path) -> None:
    name, text, fault = REFUSED[case]
    write(tmp_path, name, text)
    if "scale" in case or "automatic" in case:
        write(tmp_path, "mesh.obj", CUBE_OBJ)
    ending = run(f"plan {name} -o out.yaml", tmp_path)
    *warnings, message = ending.said.splitlines()
    assert (ending.code, ending.fault) == (2, ""), ending.said
    assert message.startswith("polygrasp: ")
    assert fault in message
    assert all(line.startswith("warning: ") for line in warnings)
    assert not (tmp_path / "out.yaml").exists()


ACCEPTED: dict[str, tuple[str, str, str]] = {
    "an open mesh": ("x.obj", obj(VERTICES, QUADS[1:]), "its surface is not closed"),
    "an inside-out mesh": ("x.obj", obj(VERTICES, [turned(f) for f in QUADS]), "face inward"),
    "mixed winding": (
        "x.obj",
        obj(VERTICES, [turned(f) if k % 2 else f for k, f in enumerate(QUADS)]),
        "face inward",
    ),
    "doubled triangles": ("x.obj", obj(VERTICES, 2 * QUADS), ""),
    "a mirrored mesh": (
        "x.sdf",
        sdf(MESH.replace("</uri>", "</uri><scale>-0.1 0.1 0.1</scale>")),
        "",
    ),
    "no inertia": ("x.sdf", sdf(inertial=""), "states no mass"),
    "impossible inertia": (
        "x.sdf",
        sdf(
            inertial="<mass>1</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>99</izz></inertia>",
        ),
        "inertia",
    ),
    "a frame a kilometre away": (
        "x.sdf",
        sdf().replace("<geometry>", "<pose>1000 0 0 0 0 0</pose><geometry>"),
        "",
    ),
    "a massless body": ("x.xml", mjcf('mass="0"'), "states no mass"),
    "friction of NaN": ("x.xml", mjcf('friction="nan"'), "states no friction"),
    "a byte order mark": ("x.sdf", "\ufeff" + sdf(), ""),
}


@pytest.mark.parametrize("case", ACCEPTED)
def test_a_sensible_user_gets_a_grasp_and_a_warning(case: str, tmp_path: Path) -> None:
    name, text, warning = ACCEPTED[case]
    write(tmp_path, name, text)
    write(tmp_path, "mesh.obj", CUBE_OBJ)
    ending = run(f"plan {name} --method paper --top 1 -o out.yaml", tmp_path)
    assert (ending.code, ending.fault) == (0, ""), ending.said
    assert warning in ending.said
    assert (tmp_path / "out.yaml").is_file()
    assert run("verify out.yaml", tmp_path).code == 0


def test_spaces_and_letters_of_any_script_are_a_name(tmp_path: Path) -> None:
    folder = tmp_path / "två ord 物体"
    folder.mkdir()
    write(folder, "mått.obj", CUBE_OBJ)
    write(tmp_path, "x.sdf", sdf(f"<mesh><uri>{folder.name}/mått.obj</uri></mesh>"))
    assert run("plan x.sdf --method paper --top 1", tmp_path).code == 0
    shutil.move(tmp_path / "x.sdf", folder / "ж.sdf")
    write(folder, "ж.sdf", sdf("<mesh><uri>mått.obj</uri></mesh>"))
    ending = run("plan ж.sdf --method paper --top 1", folder)
    assert (ending.code, ending.litter) == (0, ["ж.grasp.yaml"])
    assert run("verify ж.grasp.yaml", folder).code == 0


@pytest.mark.parametrize("command", ["plan", "explain", "verify", "show --html page.html"])
@pytest.mark.parametrize("name", ["folder.sdf", "pipe.sdf", "gone.sdf", "secret.sdf", 99 * "long."])
def test_what_is_no_readable_file_is_refused(command: str, name: str, tmp_path: Path) -> None:
    (tmp_path / "folder.sdf").mkdir()
    os.mkfifo(tmp_path / "pipe.sdf")
    write(tmp_path, "secret.sdf", sdf())
    (tmp_path / "secret.sdf").chmod(0)
    if name == "secret.sdf" and os.access(tmp_path / name, os.R_OK):
        pytest.skip("this user may read every file")
    ending = run(f"{command} {name}", tmp_path)
    assert (ending.code, ending.fault) == (2, ""), ending.said
    assert ending.said.count("\n") == 1
    assert name[:12] in ending.said  # Names beyond any system's measure are shortened.


def test_two_million_triangles_are_refused_in_a_moment(tmp_path: Path) -> None:
    with (tmp_path / "x.obj").open("w") as file:
        file.write("\n".join([*VERTICES, *(500_000 * ["f 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4"])]))
    ending = run("plan x.obj", tmp_path)
    assert (ending.code, ending.fault) == (2, "")
    assert f"2000000 elements are more than {MAX_TRIANGLES}; simplify it" in ending.said


def test_a_file_beyond_measure_is_not_read(tmp_path: Path) -> None:
    for name in ("x.sdf", "x.obj", "x.dmd.yaml", "x.grasp.yaml"):
        with (tmp_path / name).open("wb") as file:
            file.truncate(1 << 40)
        ending = run(f"{'verify' if 'grasp' in name else 'plan'} {name}", tmp_path)
        assert (ending.code, ending.fault) == (2, "")
        assert "is larger than" in ending.said


SECONDS = {"sleep": 0.5, "spin": 0.5, "swell": 300.0, "swell_in_numpy": 300.0, "crash": 300.0}
"""Time limits: little for what never ends, and none that matters for what ends by itself."""
EXPECTED = {
    "sleep": r"trying x\.sdf: stopped after 0\.5 s; repair",
    "spin": r"trying x\.sdf: stopped after 0\.5 s",
    "swell": r"trying x\.sdf: runs out of memory \(4 GB at most\)",
    "swell_in_numpy": r"trying x\.sdf: runs out of memory \(4 GB at most\)",
    "crash": r"trying x\.sdf: Drake crashed \(SIGKILL\): last words; repair",
}


@pytest.mark.parametrize("function", SECONDS)
def test_time_memory_and_crashes_are_contained(function: str) -> None:
    limits = ChildLimits("trying x.sdf", SECONDS[function])
    with pytest.raises(ModelError, match=EXPECTED[function]):
        call_in_child(f"tests.cli.test_bad_input:{function}", 1000.0, limits=limits)


def sleep(seconds: float) -> None:
    time.sleep(seconds)


def spin(_: float) -> None:
    while True:
        pass


def swell(_: float) -> bytes:
    return bytes(8 << 30)


def swell_in_numpy(_: float) -> int:
    return len(np.ones(1 << 30))


def crash(_: float) -> None:
    os.write(2, b"first words\nlast words\n")
    os.kill(os.getpid(), 9)


@pytest.mark.parametrize("function", SECONDS)
def test_each_stage_of_a_child_has_its_own_name_and_time(
    function: str, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = ChildLimits("polygrasp plan", 300.0)
    with pytest.raises(ModelError, match=EXPECTED[function]):
        call_in_child("tests.cli.test_bad_input:two_stages", function, limits=whole)
    assert capsys.readouterr().err == "warning: read\n"


def two_stages(function: str) -> None:
    """The first stage takes longer than a short second may, and is no part of what fails."""
    first, second = ChildLimits("reading y.sdf", 300.0), ChildLimits("trying x.sdf")
    assert call_in_child("tests.cli.test_bad_input:sleep", 0.7, limits=first)[1] > 0.6
    print_warnings(["read"])
    second = replace(second, seconds=SECONDS[function])
    call_in_child(f"tests.cli.test_bad_input:{function}", 1000.0, limits=second)


def test_a_stage_returns_its_value_in_the_same_child(capsys: pytest.CaptureFixture[str]) -> None:
    parent, child, stage = call_in_child("tests.cli.test_bad_input:processes", "x")[0]
    assert parent == os.getpid()
    assert child == stage != parent
    assert capsys.readouterr().err == ""


def processes(_: str) -> tuple[int, int, int]:
    return os.getppid(), os.getpid(), call_in_child("os:getpid", limits=ChildLimits("asking"))[0]


WAITING = r"(\rwaiting \.\.\. \d+ s\x1b\[K)+\r\x1b\[K"
"""The line, as often as a busy machine makes it, and its end."""


class Terminal(io.StringIO):
    """Standard error as a terminal; there is a file as soon as something is shown on it."""

    def __init__(self, shown: Path) -> None:
        super().__init__()
        self.shown = shown

    def isatty(self) -> bool:
        return True

    def write(self, text: str) -> int:
        self.shown.touch()
        return super().write(text)


@pytest.fixture
def terminal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Terminal:
    """A terminal, on which progress is shown as soon as the parent waits for anything."""
    monkeypatch.setattr("drake_polygrasp.cli.progress_line._DELAY_SECONDS", 0.0)
    return Terminal(tmp_path / "shown")


def test_progress_is_shown_on_a_terminal(terminal: Terminal) -> None:
    wait = "tests.cli.test_bad_input:wait_for"
    with redirect_stderr(terminal):
        call_in_child(wait, str(terminal.shown), limits=ChildLimits("waiting", 300.0))
    assert re.fullmatch(WAITING, terminal.getvalue())


def test_progress_is_shown_nowhere_else(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("drake_polygrasp.cli.progress_line._DELAY_SECONDS", 0.0)
    # It is longer than the parent waits before it shows progress.
    call_in_child("tests.cli.test_bad_input:sleep", 0.7, limits=ChildLimits("waiting"))
    assert capsys.readouterr().err == ""


def wait_for(file: str) -> None:
    while not Path(file).exists():
        time.sleep(0.01)


def test_progress_is_shown_after_a_second_and_twice_in_each(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    now, terminal, shown = 0.0, Terminal(tmp_path / "shown"), []
    monkeypatch.setattr("drake_polygrasp.cli.progress_line.perf_counter", lambda: now)
    with redirect_stderr(terminal):
        line = ProgressLine("waiting")
        for now in (0.0, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0):  # noqa: B007 - the line reads it
            line.refresh()
            shown.append(terminal.getvalue().count("waiting"))
    assert shown == [0, 0, 1, 1, 2, 2, 3]


def test_a_warning_is_printed_in_place_of_the_progress_line(terminal: Terminal) -> None:
    warn = "tests.cli.test_bad_input:warn_late"
    with redirect_stderr(terminal):
        call_in_child(warn, str(terminal.shown), limits=ChildLimits("waiting", 300.0))
    # A child that takes its time to end has the line again.
    assert re.fullmatch(f"{WAITING}warning: late\n({WAITING})?", terminal.getvalue())


def warn_late(file: str) -> None:
    wait_for(file)
    print_warnings(["late"])


def test_progress_that_is_counted_comes_from_the_child(terminal: Terminal) -> None:
    counting = ChildLimits("counting", unit="sheep")
    with redirect_stderr(terminal):
        value, _ = call_in_child("tests.cli.test_bad_input:count_sheep", 12, limits=counting)
    assert value == 12
    said = terminal.getvalue()
    assert re.search(r"\rcounting \.\.\. \d+ of 12 sheep, \d+ s\x1b\[K", said), said
    assert said.endswith("\r\x1b[K")
    quiet = ChildLimits("counting", unit="sheep", quiet=True)
    with redirect_stderr(terminal):
        call_in_child("tests.cli.test_bad_input:count_sheep", 12, limits=quiet)
    assert terminal.getvalue() == said


def count_sheep(number: int, progress: Callable[[int, int], None]) -> int:
    for k in range(number):
        progress(k, number)
    return number


def test_who_reads_json_through_a_pipe_is_told_no_progress(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    machine, person = Namespace(json=True), Namespace(json=False)
    assert child_limits(machine, "planning").quiet
    assert not child_limits(person, "planning").quiet
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    assert not child_limits(machine, "planning").quiet


class ToldAt:
    """The parent's end of the pipe of a child that says things at given times, which pass here."""

    def __init__(self, *messages: tuple[float, object]) -> None:
        self.now, self._messages = 0.0, deque(messages)

    def poll(self, seconds: float) -> bool:
        comes = bool(self._messages) and self._messages[0][0] <= self.now + seconds
        self.now = max(self.now, self._messages[0][0]) if comes else self.now + seconds
        return comes

    def recv(self) -> object:
        return self._messages.popleft()[1]


def test_a_child_that_gives_word_of_itself_is_not_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    """The time allowed is from one word on progress to the next."""
    sheep = ChildLimits("counting", seconds=2.0, unit="sheep")
    for step, last, is_stopped in ((1.9, 1.9, False), (0.1, 2.1, True)):
        words = [(step * k, _ProgressReport(k, 25)) for k in range(25)]
        pipe = ToldAt(*words, (24 * step + last, _CallResult("counted", 0.0, None)))
        monkeypatch.setattr("drake_polygrasp.cli.progress_line.perf_counter", lambda: pipe.now)  # noqa: B023
        conversation = _Conversation(pipe, sheep)  # type: ignore[arg-type]
        if is_stopped:
            with pytest.raises(ModelError, match="counting: stopped after 2 s"):
                conversation.wait_for_result()
            assert pipe.now == pytest.approx(24 * step + 2.0)
        else:
            assert conversation.wait_for_result().value == "counted"


class OftenStopped(ToldAt):
    """The same where Ctrl-Z stops both ends for an hour whenever the parent waits."""

    def poll(self, seconds: float) -> bool:
        comes = super().poll(seconds)
        self.now += 3600.0
        return comes


def test_time_in_which_the_command_is_stopped_does_not_count(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for hours, is_stopped in ((3, False), (5, True)):
        pipe = OftenStopped((3600.0 * hours, _CallResult("planned", 0.0, None)))
        monkeypatch.setattr("drake_polygrasp.cli.progress_line.perf_counter", lambda: pipe.now)  # noqa: B023
        conversation = _Conversation(pipe, ChildLimits("planning", seconds=2.0))  # type: ignore[arg-type]
        if is_stopped:
            with pytest.raises(ModelError, match="planning: stopped after 2 s"):
                conversation.wait_for_result()
        else:
            assert conversation.wait_for_result().value == "planned"


def test_what_cannot_be_pickled_is_still_an_error() -> None:
    with pytest.raises(RuntimeError, match="lambda"):
        call_in_child("tests.cli.test_bad_input:give_a_function", "x")


def give_a_function(_: str) -> Callable[[], None]:
    return lambda: None
