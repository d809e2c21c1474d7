"""Spoils good input at random and asks of `polygrasp` that it end well.

`python tests/support/fuzz.py -h` tells its options.

Whatever a file holds, the command must end by itself and in time with exit code 0, 1 or 2, print no
traceback, say why the code is not 0, and leave no half of a file behind.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[2]))

from drake_polygrasp.cli.child_process import READ_SECONDS, WORK_SECONDS
from drake_polygrasp.cli.main import main
from tests.support.grasp_files import BOX_SDF, EXAMPLE, TETRAHEDRON_VTK, write_box

TIME_LIMIT = READ_SECONDS + WORK_SECONDS + 10
CUBE_OBJ = """\
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 0 0 1
v 1 0 1
v 1 1 1
v 0 1 1
f 1 4 3 2
f 5 6 7 8
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
"""
PARTS_SDF = """\
<sdf version="1.9"><model name="m"><link name="l"><pose>1 2 3 0.1 0.2 0.3</pose>
<inertial><pose>0 0 0.1 0 0 0</pose><mass>2</mass></inertial>
<collision name="a"><pose>0 0 0.1 0 0 0</pose>
<geometry><mesh><uri>cube.obj</uri><scale>0.1 0.2 -0.1</scale></mesh></geometry>
<surface><friction><ode><mu>0.5</mu><mu2>0.4</mu2></ode></friction></surface></collision>
<collision name="b"><geometry><cylinder><radius>0.1</radius><length>0.3</length></cylinder>
</geometry><drake:proximity_properties><drake:mu_dynamic>0.6</drake:mu_dynamic>
</drake:proximity_properties></collision>
</link><link name="k"/><joint name="j" type="fixed"><parent>l</parent><child>k</child></joint>
</model></sdf>
"""
PARTS_URDF = """\
<robot name="m"><link name="l"><inertial><origin xyz="0 0 0.1" rpy="0 0 0"/><mass value="2"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>
<collision name="a"><origin xyz="0 0 0.1" rpy="0 0 0.5"/><geometry><box size="0.1 0.2 0.3"/>
</geometry><drake:proximity_properties><drake:mu_static value="0.5"/></drake:proximity_properties>
</collision><collision name="b"><geometry><mesh filename="tetrahedron.vtk" scale="0.2 0.2 0.2"/>
</geometry></collision></link></robot>
"""
MUJOCO_XML = """\
<mujoco model="m"><asset><mesh name="c" file="cube.obj" scale="0.1 0.1 0.1"/></asset><worldbody>
<body name="l"><geom type="box" size="0.1 0.1 0.1"/><geom type="mesh" mesh="c" friction="0.5"/>
</body></worldbody></mujoco>
"""
DIRECTIVES = """\
directives:
- add_model:
    name: m
    file: package://fuzz/parts.sdf
- add_weld:
    parent: world
    child: m::l
"""
FILES = {
    "box.sdf": BOX_SDF,
    "parts.sdf": PARTS_SDF,
    "parts.urdf": PARTS_URDF,
    "mujoco.xml": MUJOCO_XML,
    "scene.dmd.yaml": DIRECTIVES,
    "cube.obj": CUBE_OBJ,
    "tetrahedron.vtk": TETRAHEDRON_VTK,
    "box.grasp.yaml": EXAMPLE,
    "package.xml": "<package><name>fuzz</name></package>\n",
}
COMMANDS = {
    "box.sdf": "plan box.sdf",
    "parts.sdf": "plan parts.sdf",
    "parts.urdf": "plan parts.urdf",
    "mujoco.xml": "plan mujoco.xml",
    "scene.dmd.yaml": "plan scene.dmd.yaml",
    "cube.obj": "plan cube.obj",
    "tetrahedron.vtk": "plan parts.urdf",
    "box.grasp.yaml": "verify box.grasp.yaml",
    "package.xml": "plan scene.dmd.yaml",
}
"""What reads each file."""
NUMBERS = (
    *("0", "-0", "-1", "1", "2", "3", "7", "0.5", "1e-9", "1e-300", "1e9", "1e300", "1e999"),
    *("nan", "inf", "-inf", "99999999999", "0x1", "1,0", "''"),
)
WORDS = (
    "<include><uri>box.sdf</uri></include>",
    '<include file="mujoco.xml"/>',
    "<uri>package://fuzz/cube.obj</uri>",
    "<uri>http://nowhere/cube.obj</uri>",
    "<!DOCTYPE a [<!ENTITY b 'c'>]>",
    "<sphere><radius>0.1</radius></sphere>",
    '<sphere radius="0.1"/>',
    '<box size="1 1 1"/>',
    "<plane/>",
    "<geometry/>",
    "<pose>nan 0 0 0 0 0</pose>",
    "<!--",
    "]]>",
    "&amp;&x;",
    "f 1 2 3\n",
    "f -1 -2 -3 -4\n",
    "v 1 1 1\n",
    "usemtl x\n",
    "!!python/object:os.system ",
    "&a ",
    "*a",
    "- ",
    ": ",
    "{",
    "[",
    "null",
    "\0",
    "\ufeff",
    "物",
    "\\\n",
)


class Ending(NamedTuple):
    """How a command ended."""

    code: int
    """Negative: the signal."""
    said: str
    """On standard output and error."""
    seconds: float
    litter: list[str]
    """Files that it left besides the one asked for."""

    @property
    def fault(self) -> str:
        """What a command must not do, or nothing."""
        if self.code not in (0, 1, 2):
            return f"exit code {self.code}"
        for phrase in ("Traceback", "internal error"):
            if phrase in self.said:
                return phrase
        if (self.code and not self.said) or (self.code == 2 and "polygrasp: " not in self.said):
            return "no message"
        return f"it left {', '.join(self.litter)}" if self.litter else ""


def spoil(content: bytes, dice: random.Random) -> bytes:
    """One to four random changes."""
    for _ in range(dice.choice((1, 1, 1, 2, 4))):
        content = dice.choice(CHANGES)(content, dice)
    return content


def _change_number(content: bytes, dice: random.Random) -> bytes:
    words = content.split(b" ")
    places = [k for k, word in enumerate(words) if any(48 <= c < 58 for c in word)]
    if places:
        k = dice.choice(places)
        digits = [i for i, c in enumerate(words[k]) if 48 <= c < 58]
        first = dice.choice(digits)
        last = next((i for i in range(first, len(words[k])) if i not in digits), len(words[k]))
        words[k] = words[k][:first] + dice.choice(NUMBERS).encode() + words[k][last:]
    return b" ".join(words)


def _insert_word(content: bytes, dice: random.Random) -> bytes:
    k = dice.randint(0, len(content))
    return content[:k] + dice.choice(WORDS).encode() + content[k:]


def _insert_between_tags(content: bytes, dice: random.Random) -> bytes:
    pieces = content.split(b">")
    k = dice.randrange(len(pieces))
    return b">".join([*pieces[: k + 1], dice.choice(WORDS[:9]).encode()[:-1], *pieces[k + 1 :]])


def _flip_bytes(content: bytes, dice: random.Random) -> bytes:
    spoilt = bytearray(content)
    for _ in range(dice.randint(1, 4)):
        if spoilt:
            spoilt[dice.randrange(len(spoilt))] = dice.randrange(256)
    return bytes(spoilt)


def _cut(content: bytes, dice: random.Random) -> bytes:
    a, b = sorted(dice.choices(range(len(content) + 1), k=2))
    return content[:a] + content[b:] if dice.random() < 0.5 else content[:a]


def _repeat(content: bytes, dice: random.Random) -> bytes:
    a, b = sorted(dice.choices(range(len(content) + 1), k=2))
    return content[:b] + content[a:b] * dice.choice((1, 1, 3, 50)) + content[b:]


def _drop_line(content: bytes, dice: random.Random) -> bytes:
    lines = content.splitlines(keepends=True)
    k = dice.randint(0, len(lines))
    return b"".join(lines[:k] + lines[k + 1 :])


def _swap_lines(content: bytes, dice: random.Random) -> bytes:
    lines = content.splitlines(keepends=True)
    dice.shuffle(lines)
    return b"".join(lines)


CHANGES: tuple[Callable[[bytes, random.Random], bytes], ...] = (
    *(_change_number,) * 4,
    *(_insert_word, _insert_between_tags) * 2,
    *(_flip_bytes, _cut, _repeat, _drop_line, _swap_lines),
)


def warm_up() -> None:
    """Imports what commands import, so that every fork has it."""
    for module in ("pipeline.plan", "cli.plan_table", "cli.verify_table", "verification.verify"):
        import_module(f"drake_polygrasp.{module}")


def run(command: str, folder: Path, time_limit: float = TIME_LIMIT) -> Ending:
    """Runs `polygrasp` in a fork of this process, which has imported everything."""
    before = set(folder.iterdir())
    with tempfile.TemporaryFile() as output:
        start = time.perf_counter()
        pid = os.fork()
        if not pid:
            _main(command, folder, output.fileno(), time_limit)
        _, status = os.waitpid(pid, 0)
        seconds = time.perf_counter() - start
        output.seek(0)
        said = output.read().decode(errors="replace")
    litter = sorted(path.name for path in set(folder.iterdir()) - before - {folder / "out.yaml"})
    return Ending(os.waitstatus_to_exitcode(status), said, seconds, litter)


def _main(command: str, folder: Path, output: int, time_limit: float) -> None:
    code = 70
    try:
        signal.alarm(round(time_limit))
        os.chdir(folder)
        for stream in (1, 2):
            os.dup2(output, stream)
        sys.stdout, sys.stderr = os.fdopen(1, "w"), os.fdopen(2, "w")
        code = main(command.split())
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def write_files(folder: Path) -> Path:
    """A new folder with all that is good."""
    folder.mkdir()
    for name, text in FILES.items():
        (folder / name).write_text(text)
    write_box(folder)
    return folder


def fuzz(numbers: range, seed: int, keep: Path | None = None) -> tuple[Counter[str], list[str]]:
    """How spoilt inputs ended by file and exit code, and the faults; `keep` collects them.

    Each input is drawn from the seed and its number, so that any one can be had again.
    """
    warm_up()
    endings, faults, slowest = Counter[str](), [], 0.0
    with tempfile.TemporaryDirectory() as scratch:
        for number in numbers:
            dice = random.Random(f"{seed} {number}")
            folder = write_files(Path(scratch) / str(number))
            name = list(COMMANDS)[number % len(COMMANDS)]
            (folder / name).write_bytes(spoil((folder / name).read_bytes(), dice))
            command = COMMANDS[name]
            if command.startswith("plan"):
                method = dice.choice(("paper", "paper", "enriched"))
                command += f" --method {method} --top 1 -o out.yaml"
            ending = run(command, folder)
            slowest = max(slowest, ending.seconds)
            endings[f"{name}: exit {ending.code}"] += 1
            if ending.fault:
                faults.append(f"input {number}: {command}: {ending.fault}\n{ending.said[-800:]}")
                if keep:
                    shutil.copytree(folder, keep / str(number), dirs_exist_ok=True)
            shutil.rmtree(folder)
            if __name__ == "__main__" and number % 250 == 249:
                print(f"{number + 1} inputs, {len(faults)} faults, slowest {slowest:.1f} s")
                sys.stdout.flush()
    return endings, faults


def _report() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first", type=int, default=0, help="number of the first input")
    parser.add_argument("--count", type=int, default=5000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, help="folder for inputs that end badly")
    arguments = parser.parse_args()
    numbers = range(arguments.first, arguments.first + arguments.count)
    endings, faults = fuzz(numbers, arguments.seed, arguments.keep)
    print(*faults, sep="\n")
    for ending, number in sorted(endings.items()):
        print(f"{number:6d}  {ending}")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(_report())
