"""Draw the strips of films of docs/evidence/loops.md into docs/pictures: frames of `hybrid plot --animate`.

python docs/figures/film_strips.py [name ...]
"""

from __future__ import annotations

import io
import sys
import tempfile
from pathlib import Path

from make_pictures import EXAMPLES, PICTURES, shrink
from PIL import Image

import hybrid
from hybrid.view.matplotlib_backend import animate

# Times, s, of the frames of each example.
STRIPS = {
    "plectoneme": (2.0, 3.6, 4.0, 4.6, 7.0, 12.0),
    "twisted_tether": (20.0, 30.0, 31.4, 36.0, 49.2, 50.0),
    "laying_loop": (20.0, 36.0, 42.8, 43.4, 45.0, 50.0),
}
SHOWN = (0, 0, 720, 258)  # of a frame: its title, time and shapes


def strip(name: str) -> None:
    """One picture of the frames of an example, two beside each other."""
    result = hybrid.run(hybrid.load_scene(EXAMPLES / f"{name}.yaml"))
    with tempfile.TemporaryDirectory() as folder:
        film = animate(result, Path(folder) / "film.gif")
        moving = Image.open(film.path)
        begin, end = float(result.times[0]), float(result.times[-1])
        frames = []
        for t in STRIPS[name]:
            moving.seek(round((t - begin) / (end - begin) * (film.frames - 1)))
            frames.append(moving.convert("RGB").crop(SHOWN))
    width, height = frames[0].size
    page = Image.new("RGB", (2 * width, (len(frames) + 1) // 2 * height), "white")
    for k, frame in enumerate(frames):
        page.paste(frame, (k % 2 * width, k // 2 * height))
    stored = io.BytesIO()
    page.save(stored, "png")
    shrink(stored.getvalue(), PICTURES / f"{name}_film.png")


if __name__ == "__main__":
    for name in sys.argv[1:] or STRIPS:
        strip(name)
