"use strict";
// The page: what is exchanged with the server, and which picture is shown.
(() => {
  const byId = (id) => document.getElementById(id);
  const PAUSE = 100, LONGEST_WAIT = 5000;  // ms without a key until a text is sent; between two tries to connect
  const view = window.view = { ready: false, revision: -1, drawn: -1, connected: false, errors: 0, stamps: [] };  // what a test may look at
  addEventListener("error", () => { view.errors += 1; });
  addEventListener("unhandledrejection", () => { view.errors += 1; });

  const editorTip = document.createElement("div");
  editorTip.className = "tip";
  editorTip.hidden = true;
  byId("editor").append(editorTip);
  const space = window.makeSpace(byId("space"), byId("space-tip"));
  const graphs = window.makeGraphs(byId("graphs"), (s) => space.pick(s));
  const editor = window.makeEditor(byId("editor"), byId("help"), editorTip, () => changed(), () => save(), () => run());
  view.editor = editor;
  view.space = space;
  fetch("schema.json").then((found) => found.json()).then((found) => editor.schema(found));

  // ---- the text, shared with other browsers and the file ----------------------------------------

  // `base` is the text of revision `revision` of the server; `sent` what is on its way; the editor may be further.
  let base = "", revision = -1, sent = null, timer = 0, me = 0, state = {}, asked = null, hello = null, shownStart = false;
  let socket = null, wait = 200;

  const ask = (message) => {
    if (socket && socket.readyState === WebSocket.OPEN) { socket.send(JSON.stringify(message)); return true; }
    return false;
  };
  const changed = () => {
    showStart();
    clearTimeout(timer);
    timer = setTimeout(send, PAUSE);
    buttons();
  };
  const send = () => {
    if (!state.editable || sent !== null || revision < 0) return;
    const text = editor.text();
    if (text === base) return;
    view.stamps.push(performance.now());
    if (ask({ do: "edit", text, base: revision })) sent = text;
  };
  const take = (text, number, from) => {
    const mine = editor.text(), next = window.rebased(from, text, mine);
    if (next === null) { timer = setTimeout(send, 0); return; }  // both changed one place: the server merges, from `revision`
    base = text;
    revision = view.revision = number;
    editor.put(next);
    if (editor.text() !== base) timer = setTimeout(send, PAUSE);
  };

  const hear = {
    hello: (m) => {
      me = m.client;
      hello = m;
      sent = null;
      makeStart();
    },
    text: (m) => {
      if (revision < 0) {
        base = m.text;
        revision = view.revision = m.revision;
        editor.put(m.text);
        editor.forget();
        editor.skipHead();
      } else if (sent === null) {
        if (m.revision >= revision) take(m.text, m.revision, base);
        if (editor.text() !== base) send();
      }  // else the answer to what is on its way has everything
      showStart();
    },
    taken: (m) => {
      const mine = sent;
      sent = null;
      take(m.text === null ? mine : m.text, m.revision, mine);
      if (editor.text() !== base && !timer) timer = setTimeout(send, 0);
      follow();
      buttons();
    },
    picture: (m) => { queued = m; later(); },
    frames: (m) => takeFrames(m),
    state: (m) => { state = m; showState(); },
    saved: (m) => { say(`${m.file} is saved`); follow(); },
    refused: (m) => { sent = after = asked = null; refused(m.text); },
    ask: (m) => {
      asked = null;
      choose(`${m.file} is there already, a result of an earlier run.`, [["Cancel"], ["Replace it", () => { asked = "run"; ask({ do: "run", replace: true }); }, true]]);
    },
  };
  let queued = null, scheduled = false;
  const later = () => {  // of pictures that come faster than they can be drawn, the last
    if (scheduled) return;
    scheduled = true;
    setTimeout(() => { scheduled = false; const m = queued; queued = null; if (m) takePicture(m); }, 0);
  };

  const connect = () => {
    socket = new WebSocket(`ws://${location.host}${location.pathname}live`);
    socket.addEventListener("open", () => { wait = 200; view.connected = true; showState(); });
    socket.addEventListener("message", (event) => { const m = JSON.parse(event.data); hear[m.is](m); });
    socket.addEventListener("close", () => {
      view.connected = false;
      sent = null;
      showState();
      setTimeout(connect, wait);
      wait = Math.min(2 * wait, LONGEST_WAIT);
    });
  };
  addEventListener("online", () => { wait = 200; });
  addEventListener("beforeunload", (event) => { if (state.editable && (editor.text() !== base || (!view.connected && state.changed))) event.preventDefault(); });

  // ---- pictures -----------------------------------------------------------------------------------

  let still = null, problems = [], motion = null, mode = "still", frame = 0, playing = false, clock = 0, last = 0;

  const takePicture = (m) => {
    const { picture } = m;
    problems = [...picture.problems, ...picture.notes.map((note) => ({ ...note, note: true, where: note.title }))];
    editor.mark(m.revision === revision || editor.text() === base ? problems : problems);
    if (picture.frame) still = picture;
    if (mode === "motion" && motion && !motion.running && view.drawn >= 0 && m.revision > view.drawn) mode = "still";
    listProblems(!picture.frame);
    if (mode === "still") showStill(Boolean(picture.frame));
    if (picture.plan) rows(byId("plan-list"), picture.plan.map(([title, text]) => ({ title, text })));
    byId("title").textContent = (still && still.title) || "hybrid view";
    document.title = `${state.file || "new scene"} – hybrid view`;
    view.drawn = m.revision;
    buttons();
  };
  const showStill = (fresh) => {
    byId("back").hidden = true;
    timed(Boolean(motion));
    graphs.fade(!fresh);
    if (!still) return;
    if (!fresh) { space.fade(); return; }
    space.show(still, still.frame);
    graphs.show(still, still.frame, null, space.shade);
    rows(byId("facts-list"), still.facts);
    legend();
  };
  const rows = (list, found) => {
    list.textContent = "";
    for (const one of found) {
      const [head, text] = [document.createElement("dt"), document.createElement("dd")];
      head.textContent = one.title;
      head.className = one.weight || "";
      text.textContent = one.text;
      list.append(head, text);
    }
  };
  const listProblems = (bad) => {
    const real = problems.filter((x) => !x.note), verdict = byId("verdict"), list = byId("list");
    verdict.textContent = bad ? `${real.length} problem${real.length === 1 ? "" : "s"}; the picture is the last good one` : "The scene is read, and has an equilibrium.";
    if (bad && !still) verdict.textContent = `${real.length} problem${real.length === 1 ? "" : "s"}`;
    verdict.className = bad ? "bad" : "good";
    list.textContent = "";
    for (const one of problems) {
      const item = document.createElement("li"), where = document.createElement("span");
      item.className = one.note ? "note" : "problem";
      where.className = "where";
      where.textContent = `${one.where}${one.given ? ": " + one.given : ""}\n`;
      if (one.line) {
        const go = document.createElement("button");
        go.type = "button";
        go.textContent = `line ${one.line}`;
        go.addEventListener("click", () => editor.go(one.line, one.column));
        item.append(go);
      }
      item.append(where, one.text);
      list.append(item);
    }
  };
  const legend = () => {
    const box = byId("legend"), picture = mode === "motion" && motion ? motion : still, now = current();
    box.textContent = "";
    if (!picture || !now) return;
    const item = (name, background, wide) => {
      const patch = document.createElement("i"), text = document.createElement("span");
      patch.style.background = background;
      if (wide) patch.className = "ramp";
      text.append(patch, name);
      box.append(text);
    };
    const scale = space.bounds();
    if (scale) {
      const kilo = scale[0] !== "curvature" && Math.max(Math.abs(scale[1]), Math.abs(scale[2])) >= 1e3;
      const text = (v) => Number((kilo ? v / 1e3 : v).toPrecision(3)).toString();
      const unit = (kilo ? "k" : "") + { tension: "N", bending_moment: "N m", curvature: "1/m" }[scale[0]];
      item(`${text(scale[1])} to ${text(scale[2])} ${unit}`, `linear-gradient(to right, ${scale[3].join(",")})`, true);
    } else if (now.lines.length > 1) picture.heads.slice(0, 10).forEach((head) => item(head.name, space.shade(head.colour)));
    else for (const [kind, colour] of new Map(now.lines[0].zones.map((zone) => [zone[0], zone[3]]))) item(kind, space.shade(colour));
    for (const plane of picture.planes) item(plane.text, plane.line);
    for (const text of picture.far) { const far = document.createElement("span"); far.textContent = `not drawn, being far: ${text}`; box.append(far); }
  };

  // ---- motion --------------------------------------------------------------------------------------

  const current = () => (mode === "motion" && motion ? motion.frames[frame] : still && still.frame);
  const timed = (on) => { byId("time-row").hidden = !on; byId("view").classList.toggle("timed", on); };
  const takeFrames = (m) => {
    const atEnd = !motion || frame >= motion.frames.length - 1 || (m.running && !playing && mode === "motion" && frame >= motion.frames.length - 2);
    const fresh = m.begin === 0, followed = m.running || Boolean(motion && motion.running) || asked === "run";
    motion = { ...m.head, frames: fresh ? m.frames : [...(motion ? motion.frames.slice(0, m.begin) : []), ...m.frames], running: m.running, status: m.status };
    view.frames = motion.frames.length;
    motion.ranges = {};
    for (const one of motion.frames) for (const line of one.lines) for (const name of Object.keys(line.along)) {  // axes stay
      const range = motion.ranges[name] ||= [0, 0];
      for (const v of line.along[name][1]) if (v !== null) { if (v > range[1]) range[1] = v; else if (v < range[0]) range[0] = v; }
    }
    if (fresh && (followed || !state.editable || asked === "play")) { mode = "motion"; frame = 0; asked = null; }
    timed(motion.frames.length > 0);
    byId("time").max = String(Math.max(motion.frames.length - 1, 0));
    if (mode === "motion") {
      if (atEnd && followed && !playing) frame = motion.frames.length - 1;
      showMotion();
      if (!m.running) rows(byId("facts-list"), motion.facts || []);
    }
    if (!state.editable) {
      byId("title").textContent = motion.title || "hybrid view";
      if (!base && m.head) editor.refresh();
    }
    buttons();
  };
  const showMotion = () => {
    if (!motion || !motion.frames.length) return;
    frame = Math.min(Math.max(frame, 0), motion.frames.length - 1);
    const now = motion.frames[frame];
    byId("time").value = String(frame);
    byId("now").textContent = `t = ${Number(now.t.toPrecision(6))} s`;
    byId("time").setAttribute("aria-valuetext", byId("now").textContent);
    byId("back").hidden = !still;
    graphs.fade(false);
    space.show(motion, now);
    graphs.show(motion, now, motion.ranges, space.shade);
    legend();
    view.frame = frame;
  };
  const tick = (now) => {
    if (!playing) return;
    const times = motion.frames.map((x) => x.t), span = times[times.length - 1] - times[0];
    clock += ((Math.min(now - last, 500)) / 1000) * Math.max(span / 12, 1e-9);  // all of it in 12 s
    last = now;
    if (clock >= times[times.length - 1]) { frame = times.length - 1; stop(); showMotion(); return; }
    let k = frame;
    while (k < times.length - 1 && times[k + 1] <= clock) k++;
    if (k !== frame) { frame = k; showMotion(); }
    requestAnimationFrame(tick);
  };
  const stop = () => { playing = false; byId("play").textContent = "Play"; byId("play").setAttribute("aria-pressed", "false"); };
  byId("play").addEventListener("click", () => {
    if (playing) { stop(); return; }
    if (!motion || motion.frames.length < 2) return;
    mode = "motion";
    if (frame >= motion.frames.length - 1) frame = 0;
    playing = true;
    clock = motion.frames[frame].t;
    last = performance.now();
    byId("play").textContent = "Pause";
    byId("play").setAttribute("aria-pressed", "true");
    requestAnimationFrame(tick);
  });
  byId("time").addEventListener("input", () => { stop(); mode = "motion"; frame = Number(byId("time").value); showMotion(); });
  byId("back").addEventListener("click", () => { stop(); mode = "still"; showStill(true); byId("now").textContent = ""; timed(Boolean(motion)); });

  // ---- commands ------------------------------------------------------------------------------------

  let after = null;  // what is done when the text has arrived and is saved
  const follow = () => { if (after && sent === null && editor.text() === base) { const next = after; after = null; next(); } };
  const settled = (next) => {  // do something when the server has the text
    clearTimeout(timer);
    after = next;
    if (editor.text() === base && sent === null) follow();
    else send();
  };
  const save = (then, force) => {
    if (!state.editable) return;
    if (!view.connected) { refused("not connected: the text is kept here, and is sent when the connection is back"); return; }
    const done = typeof then === "function" ? then : null;
    if (state.file) settled(() => { if (ask({ do: "save", force: force === true })) after = done; });
    else choose(`Name of the new file, in ${state.folder}`, [["Cancel"], ["Save", (name) => settled(() => { if (ask({ do: "save", name })) after = done; }), true]], "scene.yaml");
  };
  const run = () => {
    if (!state.editable) return;
    if (byId("run").disabled) { say(`Not run: ${whyNot()}.`); return; }
    const begin = () => { asked = "run"; ask({ do: "run" }); };
    if (!state.file || state.changed || editor.text() !== base) save(() => setTimeout(begin, 0)); else begin();
  };
  byId("save").addEventListener("click", () => save());
  byId("run").addEventListener("click", run);
  byId("stop").addEventListener("click", () => ask({ do: "stop" }));
  byId("play-result").addEventListener("click", () => { asked = "play"; ask({ do: "play" }); });
  byId("report").addEventListener("click", () => window.open(`report?of=${mode === "motion" ? "motion" : "still"}`, "_blank"));
  byId("modes").addEventListener("click", () => window.open("report?of=modes", "_blank"));
  byId("colour").addEventListener("change", () => { space.colour(byId("colour").value); legend(); });
  byId("stretch").addEventListener("click", () => {
    const on = byId("stretch").getAttribute("aria-pressed") !== "true";
    byId("stretch").setAttribute("aria-pressed", String(on));
    space.stretch(on);
  });
  byId("fit").addEventListener("click", () => space.fit());
  addEventListener("keydown", (event) => {  // outside the editor, which has its own
    const command = { s: () => save(), Enter: run }[event.key];
    if (!command || !(event.ctrlKey || event.metaKey) || event.defaultPrevented || byId("dialog").open) return;
    event.preventDefault();
    command();
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { if (mode === "motion") showMotion(); else showStill(true); });

  const choose = (question, choices, name) => {
    byId("question").textContent = question;
    const field = byId("answer"), box = byId("choices"), dialog = byId("dialog");
    field.hidden = name === undefined;
    field.value = name || "";
    box.textContent = "";
    for (const [text, action, main] of choices) {
      const button = document.createElement("button");
      button.type = main ? "submit" : "button";
      button.textContent = text;
      if (main) button.className = "main";
      button.addEventListener("click", (event) => { event.preventDefault(); dialog.close(); if (action) action(field.value); });
      box.append(button);
    }
    if (!dialog.open) dialog.showModal();
    if (name !== undefined) field.select();
  };
  const say = (text) => { byId("status").textContent = text; byId("status").className = ""; clearTimeout(say.timer); say.timer = setTimeout(showState, 2500); };
  const refused = (text) => {
    if (/changed on disk/.test(text)) { choose(`${text}.\nSaving replaces what is there.`, [["Cancel"], ["Take the file", () => ask({ do: "reload" })], ["Save anyway", () => save(null, true), true]]); return; }
    choose(text, [["Close", null, true]]);
  };

  // ---- what stands above ---------------------------------------------------------------------------

  const whyNot = () => {
    if (state.run && state.run.running) return "a run is under way";
    if (problems.some((x) => !x.note)) return "the scene has problems";
    return still ? "the scene has no motion; it needs a table `time`" : "the scene has not been read yet";
  };
  const buttons = () => {
    const running = Boolean(state.run && state.run.running), unsaved = state.editable && (state.changed || editor.text() !== base);
    for (const id of ["save", "run"]) byId(id).hidden = !state.editable;
    byId("save").disabled = state.file ? !unsaved : !editor.text().trim();
    byId("run").disabled = running || problems.some((x) => !x.note) || !still || !still.moves;
    byId("run").title = byId("run").disabled ? `Not now: ${whyNot()}` : "Compute the motion (Ctrl+Enter)";
    byId("stop").hidden = !running;
    byId("modes").hidden = !state.editable;
    byId("modes").disabled = !still || problems.some((x) => !x.note);
    byId("report").disabled = !(mode === "motion" ? motion : still);
    byId("play-result").hidden = !(state.editable && state.result && !state.playing && !running);
    byId("file").textContent = (state.file || "not saved yet") + (unsaved && state.file ? " • changed" : "");
  };
  const showState = () => {
    const status = byId("status"), { run: r } = state;
    status.className = view.connected ? "" : "alarm";
    status.textContent = !view.connected ? "not connected; what you write is kept" : state.compiling ? "compiling the kernels for this machine: first use only, up to a minute" : state.computing ? "computing …" : state.browsers > 1 ? `${state.browsers} browsers` : "";
    byId("progress").hidden = !r;
    if (r) {
      byId("bar").style.width = `${100 * (r.fraction || 0)}%`;
      byId("progress-text").textContent = `${r.file}: ${r.text.split("\n")[0]}`;
      byId("progress-text").title = r.text;
      if (r.ended === "failed" && showState.told !== r.text) { showState.told = r.text; refused(`The run failed.\n\n${r.text}`); }
    }
    const banner = byId("banner");
    banner.hidden = !state.disk;
    if (state.disk) {
      banner.textContent = state.disk === "gone" ? `${state.file} is no longer on disk; saving writes it again.` : `${state.file} was changed on disk by another program, and here too.`;
      if (state.disk === "differs") for (const [text, message] of [["Take the file", { do: "reload" }], ["Keep mine and save", null]]) {
        const button = document.createElement("button");
        button.type = "button";
        button.textContent = text;
        button.addEventListener("click", () => (message ? ask(message) : save(null, true)));
        banner.append(button);
      }
    }
    editor.readOnly(state.editable === false);
    byId("messages").hidden = state.editable === false;
    byId("plan").hidden = state.editable === false;
    buttons();
  };

  // ---- a new scene -----------------------------------------------------------------------------------

  let kind = null;
  const showStart = () => {
    const empty = state.editable !== false && !state.file && !editor.text().trim();
    if (empty !== shownStart || !view.ready) {
      shownStart = empty;
      byId("start").hidden = !empty && !kind;
    }
    const starting = !byId("start").hidden && empty;
    for (const id of ["scene", "messages", "view"]) byId(id).hidden = starting;
    if (!starting) editor.refresh();
    view.ready = true;
  };
  const makeStart = () => {
    const form = byId("new"), list = byId("examples");
    form.textContent = list.textContent = "";
    const set = document.createElement("fieldset"), head = document.createElement("legend"), fields = document.createElement("div");
    head.textContent = "1. What is it?";
    set.append(head);
    for (const one of hello.questions) {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = one.kind === "span" ? "suspended span" : one.kind;
      button.title = one.text;
      button.setAttribute("aria-pressed", "false");
      button.addEventListener("click", () => {
        for (const other of set.querySelectorAll("button")) other.setAttribute("aria-pressed", String(other === button));
        fields.textContent = "";
        const about = document.createElement("p");
        about.textContent = one.text;
        fields.append(about);
        one.questions.forEach((question, k) => {
          const row = document.createElement("div"), label = document.createElement("label"), input = document.createElement("input"), unit = document.createElement("span");
          row.className = "field";
          label.textContent = `${k + 2}. ${question.text}`;
          label.htmlFor = input.id = `answer-${question.key}`;
          Object.assign(input, { type: "number", min: question.low, max: question.high, step: "any", value: question.usual, required: true, name: question.key });
          unit.textContent = question.unit;
          row.append(label, input, unit);
          fields.append(row);
        });
        const make = document.createElement("button");
        make.type = "submit";
        make.className = "main";
        make.textContent = "Make the scene";
        fields.append(make);
        form.onsubmit = (event) => {
          event.preventDefault();
          ask({ do: "new", kind: one.kind, answers: Object.fromEntries(new FormData(form)) });
        };
      });
      set.append(button);
    }
    form.append(set, fields);
    for (const one of hello.examples) {
      const item = document.createElement("li"), button = document.createElement("button"), name = document.createElement("strong");
      button.type = "button";
      name.textContent = one.name;
      button.append(name, one.text);
      button.addEventListener("click", () => ask({ do: "example", name: one.name }));
      item.append(button);
      list.append(item);
    }
  };
  if (matchMedia("(max-width: 900px)").matches) byId("facts-of").open = byId("plan").open = false;
  connect();
})();
