"""Write docs/tutorial.md: ten minutes of commands with what they print, recorded from the commands themselves.

    python docs/make_tutorial.py            # runs the commands, and writes the page and its pictures
    python docs/make_tutorial.py --check    # runs them, and exits with 1 if they print something else than the page has

Numbers that a machine makes (wall time, speed, sizes) are left out of the comparison.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

PAGE = Path(__file__).with_name("tutorial.md")
PICTURES = Path(__file__).with_name("pictures")
SCENE = """\
title: A hydrophone on a cable, towed into a current
environment:
  fluid: {density: 1025, current: [0.6, 0, 0]}        # kg/m^3, m/s
cable:
  sections:
    - {length: 80, mass: 0.9, diameter: 0.02, axial_stiffness: 2.0e+6, bending_stiffness: 15, drag: {normal: 1.2}}
  attachments:
    - {kind: clump, at: 60, mass: 12, volume: 0.002}  # m, kg, m^3
ends:
  start: {kind: pinned, position: [0, 0, 0]}          # at the ship
  end: {kind: free}
initial: equilibrium
model: catenary
"""
# What is written, in order: text, or a command and the pictures that it makes.
STEPS: list[str | tuple[str, ...]] = [
    """\
# Tutorial

Use this page to go once, in ten minutes, from a scene to a report, and to see what each command prints.

What stands under a command was recorded from it by `python docs/make_tutorial.py`; a test runs all of them again.
[Start here](index.md) explains a first scene in words; this page shows the way.

## 1. Write a scene

Save this as `tow.yaml`: a cable of 80 m hangs from a ship in a current, with a clump near its lower end.

```yaml
# tow.yaml
"""
    + SCENE
    + """```

## 2. What would be computed

A plan takes some tenths of a second: it says which forces are on, by which key, and how many cells there are.
""",
    ("hybrid plan tow.yaml",),
    """## 3. The equilibrium

""",
    ("hybrid static tow.yaml --plot", "tow.static.png"),
    """The current carries the cable back; the clump pulls it down.
Of a line that lies flat the lowest point is the first one that is as low as any, within 1e-9 of the length.

## 4. A mistake

Every key is checked. A word that is not known is refused, with what was probably meant:
""",
    ("hybrid static tow.yaml --set cable.sections[0].diametre=0.03",),
    """## 5. The motion

The ship heaves by 1 m every 8 s, and positions within 10 cm and forces at the ends within 1 % are asked for.
`--set` changes a value for one run; you may as well write it into the file.
""",
    (
        'hybrid run tow.yaml --set "ends.start={kind: pinned, position: [0, 0, 0], '
        'motion: {heave: {amplitude: 1.0, period: 8}, ramp: 16}}" --set "time={duration: 60}" '
        '--set "accuracy={position: 10 cm, tension: 1%}" --plot',
        "tow.png",
    ),
    """The closing lines are the answer in short: extremes with place and time, and what was written.

## 6. What the run amounts to

""",
    ("hybrid stats tow.h5 --times 20:60",),
    """## 7. A page to hand on

""",
    ("hybrid report tow.h5",),
    """`tow.html` is one file: open it in a browser, turn the cable, move the slider, print it
([The report](report.md)).

## 8. Another program

""",
    ("hybrid export tow.h5 -o tow.csv",),
    """## Go on

- [Start here](index.md) asks for an accuracy, and gets an estimate of the error:
  `accuracy: {position: 0.1 m, tension: 1%}`, or `accuracy: 2%`: of how far the line moves, and of its tensions.
- [Examples](examples.md) and the [Gallery](gallery.md): copy the nearest scene.
- `hybrid view tow.yaml` shows the equilibrium while you write ([Live view](view.md)).
""",
]
# What differs from machine to machine, and from day to day.
VARIES = re.compile(r"(?:\d+ (?:min|h) )?[\d.]+ (?:ms|s|min|h) of wall time(?: \([^()]*\))?|[\d.]+ [kM]B")


def recorded(command: str, folder: Path) -> str:
    """What a command prints on both streams, in the order of a terminal."""
    program = command.replace("hybrid ", f'"{sys.executable}" -c "from hybrid.cli.commands import main; main()" ', 1)
    environment = os.environ | {"COLUMNS": "110", "NO_COLOR": "1", "TERM": "dumb"}
    done = subprocess.run(
        program, shell=True, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    lines = [line.rstrip() for line in done.stdout.splitlines() if not line.startswith("compiling the kernels")]
    return "\n".join(lines).strip("\n")


def page(folder: Path) -> str:
    """The page, from commands that are run in the folder; their pictures are left there."""
    (folder / "tow.yaml").write_text(SCENE, encoding="utf-8")
    text = ""
    for step in STEPS:
        if isinstance(step, str):
            text += step
            continue
        command, *pictures = step
        text = text.rstrip("\n") + "\n\n"
        text += f"```bash\n{command}\n```\n\n```text\n{recorded(command, folder)}\n```\n\n"
        for picture in pictures:
            text += f"![What {command.split(' --')[0]} draws](pictures/tutorial_{picture})\n\n"
    return text


def constant(text: str) -> str:
    """The text without what varies."""
    return re.sub(r"[ \t]+", " ", VARIES.sub("...", text))


def main(arguments: list[str]) -> int:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        made = page(folder)
        if "--check" in arguments:
            return int(constant(made) != constant(PAGE.read_text(encoding="utf-8")))
        PAGE.write_text(made, encoding="utf-8")
        for picture in [picture for step in STEPS if isinstance(step, tuple) for picture in step[1:]]:
            from PIL import Image

            Image.open(folder / picture).convert("RGB").quantize(256).save(
                PICTURES / f"tutorial_{picture}", optimize=True
            )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
