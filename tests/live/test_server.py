"""The server of `hybrid view`: for its own page alone, two pages on one scene, and what it survives."""

from __future__ import annotations

import asyncio
import json
import random
import socket
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import extras
import pytest

pytestmark = extras.of_file("starlette", "uvicorn", "websockets")

from viewed import LINES, SCENE, Page, exchange, random_edit, served
from websockets.exceptions import ConnectionClosed, InvalidHandshake

from hybrid.cli.commands import main
from hybrid.live.document import MOST_FILES, Document, named_files
from hybrid.live.pictures import picture_of
from hybrid.live.server import LARGEST_MESSAGE, Guard, listen, make_app
from hybrid.live.session import Session
from hybrid.model.plan import plan
from hybrid.scene.read import as_scene, read_text, scene_text
from hybrid.scene.root import in_full


@pytest.fixture(scope="module")
def viewed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, Session, Path]]:
    file = tmp_path_factory.mktemp("view") / "scene.yaml"
    file.write_text(SCENE)
    with served(file) as (address, session):
        yield address, session, file


@pytest.fixture
def page(viewed: tuple[str, Session, Path]) -> Iterator[Page]:
    opened = Page(viewed[0])
    opened.hear("state")
    opened.edit(SCENE)
    yield opened
    opened.close()


def request(
    address: str, path: str | None = None, method: str = "GET", host: str | None = None, more: str = ""
) -> bytes:
    """The status line and head of an answer."""
    _, _, at, token, _ = address.split("/")
    path = f"/{token}/" if path is None else path.replace("TOKEN", token)
    head = f"{method} {path} HTTP/1.1\r\nHost: {at if host is None else host}\r\nConnection: close\r\n{more}\r\n"
    return exchange(address, head.encode())


# ---- who is served ----------------------------------------------------------------------------------


def test_the_page_is_served_and_keeps_to_itself(viewed: tuple[str, Session, Path]) -> None:
    answer = request(viewed[0])
    assert answer.startswith(b"HTTP/1.1 200")
    head = answer.split(b"\r\n\r\n")[0].lower()
    assert b"default-src 'none'" in head and b"frame-ancestors 'none'" in head and b"no-referrer" in head
    for name in (
        "page.js",
        "space.js",
        "codemirror/codemirror.js",
        "live.css",
        "schema.json",
        "codemirror/LICENSE.txt",
    ):
        assert request(viewed[0], f"/TOKEN/{name}").startswith(b"HTTP/1.1 200"), name
    assert b"http://" not in answer and b"https://" not in answer  # nothing of other hosts


@pytest.mark.parametrize(
    "host",
    [
        "evil.example",
        "evil.example:PORT",
        "127.0.0.1.evil.example:PORT",
        "127.0.0.1:1",
        "",
        "0.0.0.0:PORT",
        "[::1]:PORT",
    ],
)
def test_other_hosts_are_refused(viewed: tuple[str, Session, Path], host: str) -> None:
    port = viewed[0].split("/")[2].split(":")[1]
    answer = request(viewed[0], host=host.replace("PORT", port))
    assert answer.split()[1] in (b"403", b"400")
    assert b"<html" not in answer


@pytest.mark.parametrize(
    "origin",
    [
        "http://evil.example",
        "https://127.0.0.1:PORT",
        "http://127.0.0.1:1",
        "null",
        "http://127.0.0.1:PORT.evil.example",
    ],
)
def test_other_origins_are_refused(viewed: tuple[str, Session, Path], origin: str) -> None:
    origin = origin.replace("PORT", viewed[0].split("/")[2].split(":")[1])
    assert request(viewed[0], more=f"Origin: {origin}\r\n").startswith(b"HTTP/1.1 403")
    assert request(viewed[0], more="Sec-Fetch-Site: cross-site\r\n").startswith(b"HTTP/1.1 403")
    with pytest.raises((InvalidHandshake, ConnectionClosed)):
        Page(viewed[0], origin=origin).hear("hello", 5.0)


def test_a_websocket_without_an_origin_is_refused(viewed: tuple[str, Session, Path]) -> None:
    with pytest.raises((InvalidHandshake, ConnectionClosed)):
        Page(viewed[0], origin=None).hear("hello", 5.0)


@pytest.mark.parametrize("token", ["", "wrong", "TOKENx", "TOKE"])
def test_nobody_is_served_without_the_token(viewed: tuple[str, Session, Path], token: str) -> None:
    real = viewed[0].split("/")[3]
    wrong = token.replace("TOKENx", real + "x").replace("TOKE", real[:-1])
    for path in (f"/{wrong}/", f"/{wrong}", f"/{wrong}/page.js", f"/{wrong}/report"):
        answer = request(viewed[0], path)
        assert answer.startswith(b"HTTP/1.1 403"), path
        assert real.encode() not in answer
    with pytest.raises((InvalidHandshake, ConnectionClosed)):
        Page(viewed[0].replace(real, wrong)).hear("hello", 5.0)


PATHS = [
    "/TOKEN/../../../../etc/passwd", "/TOKEN/%2e%2e/%2e%2e/etc/passwd", "/TOKEN/codemirror/../../session.py", "/TOKEN//etc/passwd",
    "/TOKEN/..%2f..%2fsession.py", "/TOKEN/..\\..\\session.py", "/TOKEN/scene.yaml", "/TOKEN/page.js%00.css", "/TOKEN/codemirror",
    "/TOKEN/file:///etc/passwd", "/TOKEN/./session.py", "/../TOKEN/../etc/passwd", "/TOKEN/page.js/../../server.py",
]  # fmt: skip


@pytest.mark.parametrize("path", PATHS)
def test_no_path_leads_to_other_files(viewed: tuple[str, Session, Path], path: str) -> None:
    answer = request(viewed[0], path)
    assert answer.split()[1] in (b"404", b"403", b"400", b"307")
    assert b"root:" not in answer and b"import" not in answer and b"sections" not in answer


def test_it_listens_at_this_machine_alone(viewed: tuple[str, Session, Path]) -> None:
    assert viewed[0].startswith("http://127.0.0.1:")
    assert len(viewed[0].split("/")[3]) >= 30


def test_a_browser_that_comes_before_the_server_runs_waits() -> None:
    with closing(listen()) as at, socket.create_connection(at.getsockname(), timeout=10) as early:
        assert early.getpeername() == at.getsockname()


@pytest.mark.long
def test_messages_that_are_too_large_end_the_connection_and_nothing_else(
    viewed: tuple[str, Session, Path], page: Page
) -> None:
    other = Page(viewed[0])
    with pytest.raises(ConnectionClosed):
        other.ask(do="edit", text="x" * (LARGEST_MESSAGE + 1), base=0)
        while True:
            other.hear("taken")
    page.ask(do="edit", text="x" * 4_000_001, base=page.revision)
    assert "4 MB" in page.hear("refused")["text"]
    assert page.picture(page.edit(SCENE + "# on\n"))["problems"] == []


@pytest.mark.parametrize(
    "message",
    ["", "no json", "[]", "7", "null", '{"do": "shutdown"}', '{"do": "edit"}', '{"do": "edit", "text": 3, "base": "x"}', "[" * 5000, '{"do": "new", "kind": "mooring", "answers": 3}', '{"do": "example", "name": "../../pyproject"}', '{"do": "stop"}', '{"do": "edit", "text": "\\ud800", "base": 0}'],
)  # fmt: skip
def test_messages_that_are_no_sense_are_refused_in_words(page: Page, message: str) -> None:
    page.socket.send(message)
    assert len(page.hear("refused", 10.0)["text"]) < 600
    assert page.edit(SCENE) >= 0


def test_bytes_that_are_no_http_do_no_harm(viewed: tuple[str, Session, Path], page: Page) -> None:
    rng = random.Random(2)
    for size in (1, 100, 10_000):
        exchange(viewed[0], rng.randbytes(size) + b"\r\n\r\n")
    exchange(viewed[0], b"GET /" + b"a" * 200_000 + b" HTTP/1.1\r\n\r\n")
    assert page.edit(SCENE + "# still there\n") >= 0


@pytest.mark.parametrize("name", ["../outside.yaml", "/tmp/outside.yaml", "a/b.yaml", "..", "x\0.yaml"])
def test_nothing_is_written_outside_the_folder(viewed: tuple[str, Session, Path], page: Page, name: str) -> None:
    before = sorted(viewed[2].parent.parent.rglob("*.yaml"))
    page.ask(do="save", name=name)
    assert "no name of a file" in page.hear("refused")["text"]
    assert sorted(viewed[2].parent.parent.rglob("*.yaml")) == before


# ---- the scene ----------------------------------------------------------------------------------------


def test_a_picture_has_everything_and_an_error_keeps_the_last_one(
    viewed: tuple[str, Session, Path], page: Page
) -> None:
    picture = page.picture(page.edit(SCENE.replace("title: A line", "title: Another")))
    assert picture["title"] == "Another" and picture["problems"] == []
    line = picture["frame"]["lines"][0]
    assert {"tension", "bending_moment", "curvature", "clearance"} <= set(line["along"])
    assert len(line["nodes"]) == line["cells"] + 1 == 41
    assert line["zones"][0][:3] == ["rod", 0.0, 30.0]
    assert min(line["along"]["clearance"][1]) == pytest.approx(0.0, abs=0.05)
    assert ["cells", "40 (202 unknowns)"] in picture["plan"] or any("40" in row[1] for row in picture["plan"])
    broken = page.picture(page.edit(SCENE.replace("mass: 2.0", "mass: -2.0")))
    assert broken["problems"][0]["line"] == 6 and "frame" not in broken
    late = Page(viewed[0])  # one that comes now gets the last good picture, and what is wrong
    late.hear("state")
    pictures = [m["picture"] for m in late.got if m["is"] == "picture"]
    assert pictures[0]["title"] == "Another" and "frame" in pictures[0]
    assert pictures[1]["problems"] == broken["problems"]
    late.close()


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("mass: 2.0", "mass: two", 6, "number"),
        ("initial: equilibrium", "initial: [", 10, "close it with ]"),
        ("kind: pinned, position: [14, 0, 0]", "kind: pined, position: [14, 0, 0]", 9, "pinned"),
        ("time: {duration: 4.0, step: 0.05}", "time: {duration: 4.0, steps: 0.05}", 13, "step"),
        ("length: 30", "length: 20", None, ""),
    ],
)
def test_problems_stand_at_their_line(page: Page, old: str, new: str, line: int | None, words: str) -> None:
    found = page.picture(page.edit(SCENE.replace(old, new)))["problems"]
    assert line in [x["line"] for x in found] or line is None
    assert found and any(words in x["text"] + x["given"] for x in found)


def test_an_equilibrium_that_is_not_found_stands_at_initial() -> None:
    scene = SCENE.replace("end: {kind: pinned, position: [14, 0, 0]", "end: {kind: free").replace(
        ", motion: {heave: {amplitude: 0.5, period: 4}, ramp: 4}", ""
    )
    text = scene.replace("environment:\n  seabed: {z: -20, stiffness: 2.0e+3}", "environment: {gravity: 0}").replace(
        "start: {kind: pinned, position: [0, 0, -20]}", "start: free"
    )
    picture, _ = picture_of(text, "", lambda: None)
    assert len(picture["problems"]) == 1
    assert picture["problems"][0]["line"] in (8, 9, None)


TWO_SECTIONS = """\
cable:
  sections:
    - {length: 20, mass: 7, axial_stiffness: 1.0e+6, bending_stiffness: 1}
    - {length: 10, mass: 2, axial_stiffness: 1.0e+6, bending_stiffness: 20}
ends:
  start: {kind: pinned, position: [0, 0, 0]}
  end: {kind: pinned, position: [25, 0, 0], motion: {heave: {amplitude: 0.1, period: 4}, ramp: 4}}
initial: equilibrium
time: {duration: 4}
"""


@pytest.mark.parametrize("form", [as_scene, in_full])
@pytest.mark.parametrize("model, kind", [("", "rod"), ("model: catenary\n", "catenary")])
def test_a_scene_that_names_no_model_is_shown_as_the_plan_has_it(model: str, kind: str, form: Any) -> None:
    scene = form(read_text(TWO_SECTIONS + model)[0])
    picture, result = picture_of(scene_text(scene), "", lambda: None)
    ((_, line),) = plan(scene).each_line()
    assert result is not None and {zone[0] for zone in picture["frame"]["lines"][0]["zones"]} == {kind}
    assert {zone.kind for zone in line.zones} == {kind}


def test_a_named_line_is_drawn_at_as_many_points_as_a_cable() -> None:
    """A point for each cell as far as a screen shows them apart, whatever the file of a run would keep."""
    points = "points: {a: {position: [0, 0, 0]}, b: {position: [25, 0, 0]}}\noutput: {points: 11}\nlines:\n  one:"
    one = f"{points} {{start: a, end: b, mesh: {{cells: 150}}, sections: [{{length: 30, mass: 7, diameter: 0.1}}]}}\n"
    picture, _ = picture_of(one, "", lambda: None)
    assert picture["problems"] == [] and len(picture["frame"]["lines"][0]["s"]) == 151


def test_several_lines_are_drawn(page: Page) -> None:
    picture = page.picture(page.edit(LINES))
    assert picture["problems"] == []
    assert [head["name"] for head in picture["heads"]] == ["a", "b"]
    assert len(picture["frame"]["lines"]) == 2
    assert "point buoy" in [mark["name"] for mark in picture["frame"]["marks"]]


def test_the_file_is_watched_and_saving_asks_where_it_was_changed(
    viewed: tuple[str, Session, Path], page: Page
) -> None:
    file = viewed[2]
    page.ask(do="save", force=True)
    page.hear("saved")
    file.write_text(SCENE.replace("A line", "From outside"))
    assert "From outside" in page.hear(lambda m: m["is"] == "text" and "From outside" in m["text"])["text"]
    assert page.picture(page.revision)["title"] == "From outside"
    page.edit(SCENE.replace("A line", "Mine"))
    file.write_text(SCENE.replace("A line", "Theirs"))
    page.hear(lambda m: m["is"] == "state" and m["disk"] == "differs")
    page.ask(do="reload")
    assert "Theirs" in page.hear(lambda m: m["is"] == "text" and "Theirs" in m["text"])["text"]
    assert "Theirs" in file.read_text()


def test_files_that_the_scene_names_are_watched(viewed: tuple[str, Session, Path], page: Page) -> None:
    """A picture follows the motion file: not there, sound, and with a jump of velocity."""
    moved = SCENE.replace("{heave: {amplitude: 0.5, period: 4}, ramp: 4}", "{file: moved.csv}")
    problems = page.picture(page.edit(moved))["problems"]
    assert problems and "moved.csv" in problems[0]["text"] + problems[0]["given"]
    file = viewed[2].parent / "moved.csv"
    rows = [(0.5 * k, 14.0, 0.0, 0.0) for k in range(9)]
    file.write_text("t,x,y,z\n" + "".join(f"{t},{x},{y},{z}\n" for t, x, y, z in rows))
    assert not page.hear("picture")["picture"]["problems"]
    file.write_text(file.read_text().replace("2.0,14.0", "2.0,wrong"))
    problems = page.hear("picture")["picture"]["problems"]
    assert problems and "moved.csv" in problems[0]["text"] + problems[0]["given"]


def test_a_file_that_changes_while_it_is_read_is_read_again(tmp_path: Path) -> None:
    """Before anyone has looked at it for the first time, too."""
    text, file = "motion: {file: moved.csv}\n", tmp_path / "moved.csv"
    asked: list[bool] = []

    async def read() -> None:
        session, again = Session(Document(text, folder=tmp_path)), asyncio.Event()

        async def ask(*_: object) -> bytes:
            asked.append(file.exists())
            file.write_text("t,x,y,z\n")
            if len(asked) > 1:
                again.set()
            return b'{"problems": []}'

        session.workers.ask = ask  # type: ignore[method-assign]
        session._wanted.set()
        tasks = [asyncio.create_task(work) for work in (session._compute(), session._watch_named())]
        await asyncio.wait_for(again.wait(), 20.0)
        for task in tasks:
            task.cancel()

    asyncio.run(read())
    assert asked == [False, True]


def test_files_are_found_in_texts_that_are_no_scenes(tmp_path: Path) -> None:
    text = "  # file: no.csv\nmotion: {file: a.csv, ramp: 8}\nx: [\nforce: {'file': \"b c.csv\"}\n"
    text += (
        "vessel: {rao: ship/rao.csv, origin: [0, 0]}  # file: x\n  file: d.csv # the last\nprofile: e.csv\nfile: {\n"
    )
    names = ["a.csv", "b c.csv", "ship/rao.csv", "x", "d.csv"]
    assert named_files(text, tmp_path) == [tmp_path / name for name in names]
    assert len(named_files("file: a{}\n" * 3 + "".join(f"file: {k}.csv\n" for k in range(99)), tmp_path)) == MOST_FILES


def test_two_pages_see_each_other_and_lose_nothing(viewed: tuple[str, Session, Path], page: Page) -> None:
    other = Page(viewed[0])
    other.hear("text")
    base = page.revision
    page.edit(SCENE.replace("title: A line", "title: One"), base)
    other.edit(SCENE.replace("duration: 4.0", "duration: 5.0"), base)  # it had not seen the other's
    assert "title: One" in other.text and "duration: 5.0" in other.text
    page.hear(lambda m: m["is"] == "text" and m["revision"] >= other.revision)
    assert page.text == other.text
    other.close()


def test_who_comes_back_loses_nothing(viewed: tuple[str, Session, Path], page: Page) -> None:
    base, mine = page.revision, SCENE.replace("mass: 2.0", "mass: 2.5")
    away = Page(viewed[0])
    away.hear("state")
    away.close()  # a closed lid
    page.edit(SCENE.replace("title: A line", "title: Meanwhile"))
    back = Page(viewed[0])
    back.hear("state")
    back.edit(mine, base)
    assert "mass: 2.5" in back.text and "title: Meanwhile" in back.text
    back.edit(mine, base)  # sent again, as it was not known whether it had arrived
    assert "mass: 2.5" in back.text and "title: Meanwhile" in back.text
    back.close()


def test_random_edits_are_answered(viewed: tuple[str, Session, Path], page: Page) -> None:
    """The page may send whatever a hand types: every text gets a picture or words, and none a traceback."""
    rng = random.Random(5)
    text, last = SCENE, 0
    for _ in range(100):
        text = random_edit(rng, text if rng.random() < 0.6 and text else SCENE)
        if text.strip():
            last = page.edit(text)
    last = page.edit(SCENE + "# the end\n")
    picture = page.picture(last)
    assert picture["problems"] == [] and "frame" in picture
    answers = [m["picture"] for m in page.got if m["is"] == "picture"]
    assert not [x for x in answers if x.get("bug") or "Traceback" in json.dumps(x["problems"])]


def test_a_newer_text_does_not_wait_for_an_older_one(viewed: tuple[str, Session, Path], page: Page) -> None:
    """A text that takes seconds (a mesh of 400 000 cells in space) is given up when another one comes."""
    page.picture(page.edit(SCENE + "# ready\n"))
    older = page.edit(SCENE.replace("cells: 40", "cells: 400000").replace("[14, 0, 0]", "[14, 3, 0]"))
    time.sleep(0.1)  # it has begun
    assert page.picture(page.edit(SCENE.replace("A line", "The newer")))["title"] == "The newer"
    assert older not in [m["revision"] for m in page.got if m["is"] == "picture"], "the older one was waited for"


def answered(app: Guard, path: str, method: str = "GET") -> tuple[int, dict[bytes, bytes]]:
    """Status and headers of what the page answers to a browser that is started with an address."""
    sent: list[Any] = []
    scope = {"type": "http", "method": method, "path": path, "headers": [(b"host", b"127.0.0.1:1234")]}

    async def send(message: Any) -> None:
        sent.append(message)

    async def receive() -> Any:
        return {"type": "http.request", "body": b"", "more_body": False}

    asyncio.run(app({**scope, "query_string": b"", "root_path": ""}, receive, send))
    return sent[0]["status"], dict(sent[0]["headers"])


def test_a_ticket_opens_the_page_once() -> None:
    app = make_app(Session(None), 1234, "token")
    ticket = app.ticket
    assert ticket and len(ticket) >= 30
    assert answered(app, f"/{ticket}/page.js")[0] == 404 and answered(app, f"/{ticket}/live")[0] == 404
    status, headers = answered(app, f"/{ticket}")
    assert status == 303 and headers[b"location"] == b"/token/"
    assert answered(app, f"/{ticket}")[0] == 403, "whoever has read it from a command line comes too late"
    assert answered(app, "/token/")[0] == 200


def test_the_token_is_not_on_the_command_line_of_the_browser(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "scene.yaml").write_text(SCENE)
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", opened.append)

    async def serve(self: Any, sockets: Any) -> None:
        sockets[0].close()

    monkeypatch.setattr("uvicorn.Server.serve", serve)
    with pytest.raises(SystemExit):
        main(["view", str(tmp_path / "scene.yaml"), "--json"])
    address = json.loads(capsys.readouterr().out.splitlines()[0])["address"]
    token = address.split("/")[3]
    assert len(opened) == 1 and opened[0].startswith(address.split(token)[0]) and token not in opened[0]


@pytest.mark.parametrize("base", ["1e400", "-1e400", "NaN", "1e30", '"x"', "null", "[1]"])
def test_a_number_that_is_none_is_refused(viewed: tuple[str, Session, Path], page: Page, base: str) -> None:
    page.socket.send(f'{{"do": "edit", "text": "x", "base": {base}}}')
    if base != "1e30":
        assert "not understood" in page.hear("refused")["text"]
    page.edit(SCENE)
