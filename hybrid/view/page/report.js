"use strict";
// The page's own script: draws figures as they come into view, with plotly, which starts with the first of them, and
// moves the cable.  Until then, on paper, and where plotly cannot start, still drawings stand there.
(async () => {
  const byId = (id) => document.getElementById(id);
  const index = JSON.parse(byId("index").textContent);
  const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
  const touch = matchMedia("(pointer: coarse)").matches;
  window.report = { ready: false, frame: 0 };  // what a test, or a console, may look at

  // ---- unpacking -------------------------------------------------------------------------------

  const unpacked = async (id) => {
    const text = atob(byId(id).textContent.trim());
    const bytes = new Uint8Array(text.length);
    for (let k = 0; k < text.length; k++) bytes[k] = text.charCodeAt(k);
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Response(stream).arrayBuffer();
  };

  const problem = (text) => {
    for (const figure of document.querySelectorAll("figure:has(.plot)")) {
      const line = document.createElement("p");
      line.className = "problem";
      line.textContent = text;
      figure.append(line);
    }
  };

  let numbers, Plotly, starting = null;
  const start = async () => {  // more than a second, in which nothing else moves: whether it could
    try {
      numbers = await unpacked("data");
      const script = document.createElement("script");
      script.textContent = new TextDecoder().decode(await unpacked("plotly"));
      performance.mark("unpacked");
      document.head.append(script);
      performance.mark("plotly");
      for (const id of ["data", "plotly"]) byId(id).textContent = "";  // their memory is wanted elsewhere
      Plotly = window.Plotly;
      if (!Plotly) throw new Error("plotly did not start");
      return true;
    } catch (error) {
      problem("Pictures that move need a browser of 2023 or later (DecompressionStream): " + error.message);
      return false;
    }
  };
  const started = () => (starting ??= start());
  performance.mark("text");

  const TYPES = { f4: Float32Array, u1: Uint8Array };
  const flat = (ref) => {
    const size = ref.shape.reduce((a, b) => a * b, 1);
    return new TYPES[ref.type](numbers, ref.$at, size);
  };
  const row = (ref, k) => flat(ref).subarray(k * ref.shape[1], (k + 1) * ref.shape[1]);
  const revived = (x) => {
    if (Array.isArray(x)) return x.map(revived);
    if (x === null || typeof x !== "object") return x;
    if (x.$at !== undefined) {
      const values = x.log ? flat(x).map((v) => (v > 0 ? Math.log10(v) : v === 0 ? -99 : NaN)) : flat(x);
      if (x.shape.length === 1) return values;
      return Array.from({ length: x.shape[0] }, (_, k) => values.subarray(k * x.shape[1], (k + 1) * x.shape[1]));
    }
    return Object.fromEntries(Object.entries(x).map(([key, value]) => [key, revived(value)]));
  };

  // ---- light and dark --------------------------------------------------------------------------

  const night = matchMedia("(prefers-color-scheme: dark)");
  let printing = false;
  const DARK = { "#ffffff": "#15181c", "#222222": "#e6e6e6", "#000000": "#f4f4f4", "#ededed": "#2c3238", "#e4e4e4": "#2c3238",
    "#bdbdbd": "#59616a", "#6e6e6e": "#a9adb3", "#5f5f5f": "#a9adb3", "#555555": "#c8ccd1", "#b5b5b5": "#6b727a", "#9e9e9e": "#59616a",
    "#eee5d0": "#4a4231", "#8c6d31": "#c9a55a", "#eff6fa": "#1b3140", "#0072b2": "#56b4e9", "#d55e00": "#ff8b3d",
    "#009e73": "#2ecf9f", "#8e63b5": "#b594d8", "#c00000": "#ff8a80", "#b84f04": "#ff9a52", "#2c72b6": "#6fb3ee" };
  const shade = (colour) => (night.matches && !printing && DARK[String(colour).toLowerCase()]) || colour;
  const faded = /^rgba\((\d+),(\d+),(\d+),([\d.]+)\)$/;
  const themed = (x, key) => {  // numbers and scales of colours stay
    if (key === "colorscale" || key === "x" || key === "y" || key === "z" || key === "text") return x;
    if (Array.isArray(x)) return x.map((v) => themed(v));
    if (x !== null && typeof x === "object") return ArrayBuffer.isView(x) || x.$at !== undefined ? x
      : Object.fromEntries(Object.entries(x).map(([name, value]) => [name, themed(value, name)]));
    if (typeof x !== "string") return x;
    const part = faded.exec(x);
    if (!part) return shade(x);
    const hex = "#" + part.slice(1, 4).map((v) => Number(v).toString(16).padStart(2, "0")).join("");
    const [r, g, b] = [1, 3, 5].map((k) => parseInt(shade(hex).slice(k, k + 2), 16));
    return `rgba(${r},${g},${b},${part[4]})`;
  };

  // plotly's own button to upload a picture to its servers is switched off: nothing leaves this page.
  const config = { displaylogo: false, showSendToCloud: false, plotlyServerURL: "", responsive: true, displayModeBar: touch ? false : "hover",
    modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"] };

  // ---- the cable -------------------------------------------------------------------------------

  const scene = index.scene;
  const times = scene ? scene.times : [];
  const state = { frame: 0, t: times[0], playing: false, colour: 0, stretched: false, picked: null };
  const box3d = byId("cable-plot");
  let space = null;  // numbers of the traces that move

  const hasWebGL = () => {
    try {
      const canvas = document.createElement("canvas");
      return Boolean(canvas.getContext("webgl2") || canvas.getContext("webgl"));
    } catch { return false; }
  };

  const line = () => {
    const colour = scene.colours[state.colour];
    if (!colour) return { color: shade(scene.ink), width: 7 };
    let color = row(colour.values, state.frame);
    let [low, high] = [colour.low, colour.high];
    if (colour.log) {
      color = color.map((v) => Math.log10(Math.max(v, low)));
      [low, high] = [Math.log10(low), Math.log10(high)];
    }
    const colorscale = colour.scale.map(([at, tint]) => [at, shade(tint)]);
    return { color, cmin: low, cmax: high, colorscale, width: 7, showscale: false };
  };

  const shape = (k) => ({ x: row(scene.x, k), y: row(scene.y, k), z: row(scene.z, k) });
  const placeOf = (s) => {  // on the shape shown, between points
    const grid = flat(scene.s), at = shape(state.frame);
    let k = 1;
    while (k < grid.length - 1 && grid[k] < s) k++;
    const p = grid.length > 1 ? Math.min(Math.max((s - grid[k - 1]) / (grid[k] - grid[k - 1]), 0), 1) : 0;
    const between = (v) => [grid.length > 1 ? v[k - 1] * (1 - p) + v[k] * p : v[0]];
    return { x: between(at.x), y: between(at.y), z: between(at.z) };
  };

  const marks = () => {  // all of them, and the place that was asked for
    const at = state.picked === null ? { x: [NaN], y: [NaN], z: [NaN] } : placeOf(state.picked);
    const all = (axis) => [...scene.marks.flatMap((mark) => [...row(mark[axis], state.frame)]), ...at[axis]];
    return { x: all("x"), y: all("y"), z: all("z") };
  };

  const view = () => {
    // Axes: the size of the box as drawn, so large that its projection fills the panel.
    const size = scene.box.map(([a, b], k) => (b - a) * (state.stretched ? scene.factors[k] : 1));
    const [x, y, z] = scene.box.map(([a, b]) => b - a);
    const eye = z < 0.25 * Math.min(x, y) ? [-0.35, -1, 1.3] : x >= y ? [0.32, -1, 0.26] : [1, -0.32, 0.26];
    const long = Math.hypot(...eye), d = eye.map((v) => v / long);
    const flatLong = Math.hypot(d[0], d[1]);
    const right = [-d[1] / flatLong, d[0] / flatLong, 0];
    const up = [d[1] * right[2] - d[2] * right[1], d[2] * right[0] - d[0] * right[2], d[0] * right[1] - d[1] * right[0]];
    const reach = (axis) => size.reduce((sum, v, k) => sum + Math.abs(axis[k]) * v, 0);
    // The panel is as high as what it shows asks for, so that nothing of it is empty.
    const wanted = (box3d.clientWidth * ACROSS * reach(up)) / (reach(right) * UP);
    const height = Math.round(Math.min(Math.max(wanted, 240), 680, 0.85 * Math.max(innerHeight, 500)));
    box3d.style.height = height + "px";
    const panel = box3d.clientWidth / height;
    const scale = Math.min((SEEN * panel * ACROSS) / reach(right), (SEEN * UP) / reach(up));
    const camera = { eye: { x: 2 * d[0], y: 2 * d[1], z: 2 * d[2] }, up: { x: 0, y: 0, z: 1 },
      center: { x: 0, y: 0, z: -0.03 }, projection: { type: "orthographic" } };
    return { camera, aspectratio: { x: size[0] * scale, y: size[1] * scale, z: size[2] * scale } };
  };
  const ACROSS = 0.9, UP = 0.84;  // parts of the panel that are filled; numbers at the axes have the rest
  const SEEN = 2.0;  // height of the panel in units of aspectratio, measured: plotly scales orthographic views by it

  const sceneLayout = () => {
    const largest = Math.max(...scene.box.map(([a, b]) => b - a));
    const axis = (k) => {
      const drawn = (scene.box[k][1] - scene.box[k][0]) * (state.stretched ? scene.factors[k] : 1);
      return { title: { text: "" }, tickprefix: "xyz"[k] + " = ", showtickprefix: "first", ticksuffix: " m",
        showticksuffix: "last", range: scene.box[k], backgroundcolor: shade("#ffffff"),
        gridcolor: shade("#e4e4e4"), linecolor: shade("#bdbdbd"), zeroline: false, showspikes: false, showbackground: false,
        tickfont: { size: 11, color: shade("#5f5f5f") }, tickangle: 0, nticks: drawn < 0.3 * largest ? 2 : touch ? 4 : 7 };
    };
    const { camera, aspectratio } = view();
    return { xaxis: axis(0), yaxis: axis(1), zaxis: axis(2), aspectmode: "manual", aspectratio, camera, dragmode: "turntable" };
  };

  const say3d = () => {
    const parts = [];
    if (state.stretched) {
      const factors = scene.factors.map((f, k) => (f > 1.005 ? "xyz"[k] + " × " + Number(f.toPrecision(2)) : "")).filter(Boolean);
      parts.push(factors.length ? "Axes stretched: " + factors.join(", ") + "." : "Nothing to stretch: no direction is thin.");
    }
    for (const text of scene.far) parts.push("Not drawn, being far: " + text + ".");
    byId("cable-said").textContent = parts.join(" ");
    const legend = byId("cable-legend");
    legend.textContent = "";
    const colour = scene.colours[state.colour];
    if (colour && colour.legend) for (const [name, tint] of colour.legend) legend.append(swatch(name, tint));
    else if (colour) legend.append(ramp(colour.label, colour.scale.map((c) => c[1]), colour.low, colour.high, "", colour.log));
    for (const plane of scene.planes) if (plane.x) legend.append(swatch(plane.text, plane.line, "plane", plane.fill));
    for (const mark of scene.marks.slice(0, -2))  // without the ends
       legend.append(swatch(mark.name, mark.colour, mark.symbol));
    legend.append(swatch("first shape", "#b5b5b5"));
  };
  const swatch = (name, colour, symbol = "", fill = colour) => {  // the shape of what it stands for
    const item = document.createElement("span"), patch = document.createElement("i");
    patch.style.background = shade(fill);
    if (symbol === "plane") patch.style.borderColor = shade(colour);
    if (symbol) patch.className = symbol;
    item.append(patch, name);
    return item;
  };
  const ramp = (name, shades, low, high, unit, log) => {
    const item = document.createElement("span"), strip = document.createElement("span");
    item.className = "bar";
    strip.className = "ramp";
    strip.style.background = "linear-gradient(to right," + shades.join(",") + ")";
    const text = (v) => Number(v.toPrecision(3)).toString();
    const lowest = document.createElement("span");
    lowest.textContent = (log ? "≤ " : "") + text(low);
    item.append(name, lowest, strip, text(high) + " " + unit + (log ? " (log.)" : ""));
    return item;
  };

  let drawn = false;
  const drawCable = async () => {
    if (!hasWebGL()) {
      byId("cable-said").textContent = "This browser has no WebGL: the cable is shown still.";
      return;
    }
    if (!(await started())) return;
    const traces = [{ type: "scatter3d", mode: "lines", ...shape(0), line: { color: shade("#b5b5b5"), width: 2 }, hoverinfo: "skip" }];
    traces.push({ type: "scatter3d", mode: "lines", ...shape(state.frame), line: line(), customdata: flat(scene.s),
      hovertemplate: "s = %{customdata:.4g} m<br>x = %{x:.4g}, y = %{y:.4g}, z = %{z:.4g} m<extra></extra>" });
    const each = (value) => scene.marks.flatMap((mark) => Array(mark.x.shape[1]).fill(value(mark)));
    traces.push({ type: "scatter3d", mode: "markers", ...marks(), text: [...each((m) => m.name), "chosen"],
      marker: { symbol: [...each((m) => m.symbol), "circle-open"], color: [...each((m) => shade(m.colour)), shade("#c00000")],
        size: [...each((m) => 2 * m.size), 28], line: { color: [...each(() => shade(scene.ink)), shade("#c00000")], width: 1 }, opacity: 1 },
      hovertemplate: "%{text}<br>x = %{x:.4g}, y = %{y:.4g}, z = %{z:.4g} m<extra></extra>" });
    for (const plane of scene.planes) if (plane.x) {
      traces.push({ type: "mesh3d", x: plane.x, y: plane.y, z: plane.z, i: plane.i ?? [0, 0],
        j: plane.j ?? [1, 2], k: plane.k ?? [2, 3], color: shade(plane.fill),
        opacity: plane.solid, hoverinfo: "skip", lighting: { ambient: 1, diffuse: 0, specular: 0 } });
      const rim = plane.rim ?? [0, 1, 2, 3, 0], along = (values) => rim.map((k) => values[k]);
      traces.push({ type: "scatter3d", mode: "lines", x: along(plane.x), y: along(plane.y), z: along(plane.z),
        line: { color: shade(plane.line), width: 2 }, hoverinfo: "skip" });
    }
    box3d.classList.add("drawn");  // its drawing for paper stays, hidden
    const layout = { margin: { l: 0, r: 0, t: 0, b: 0 }, showlegend: false, scene: sceneLayout(),
      font: { family: "system-ui, sans-serif", color: shade(scene.ink) }, paper_bgcolor: shade("#ffffff") };
    if (drawn) return Plotly.react(box3d, traces, layout, config);
    drawn = true;
    await Plotly.newPlot(box3d, traces, layout, config);
    space = { cable: 1, marks: 2 };
    moveCable();  // time may have gone on
    window.report.cable = true;
    let width = box3d.clientWidth;
    new ResizeObserver(() => {
      if (box3d.clientWidth === width) return;  // it also calls at the start
      width = box3d.clientWidth;
      Plotly.relayout(box3d, { "scene.aspectratio": view().aspectratio });
    }).observe(box3d);
  };

  const moveCable = () => {
    if (!space) return;
    const both = [shape(state.frame), marks()];
    const update = { x: both.map((m) => m.x), y: both.map((m) => m.y), z: both.map((m) => m.z) };
    if (scene.colours.length) update["line.color"] = [line().color, undefined];  // undefined: as it is
    Plotly.restyle(box3d, update, [space.cable, space.marks]);
  };
  const recolour = () => space && Plotly.restyle(box3d, { line: [line()] }, [space.cable]);

  // ---- graphs ----------------------------------------------------------------------------------

  const graphs = new Map();  // element -> its figure, once drawn
  const seen = new Set();
  let turn = Promise.resolve();
  const inTurn = (draw) => {  // one at a time, and the page answers in between
    turn = turn.then(draw).catch((error) => console.error(error)).then(() => new Promise((done) => setTimeout(done)));
  };
  const cursor = () => ({ type: "line", xref: "x", yref: "paper", x0: state.t, x1: state.t, y0: 0, y1: 1,
    line: { color: shade("#555555"), width: 1, dash: "dot" } });

  const drawGraph = async (element, figure, again = false) => {
    if (!(await started())) return;
    if (again ? !graphs.has(element) : graphs.has(element)) return;
    const first = !graphs.has(element);
    graphs.set(element, figure);
    const layout = themed(figure.layout);
    layout.dragmode = touch ? false : "zoom";  // a finger scrolls the page
    if (element.clientWidth < 500) layout.legend.font.size = 11;
    if (figure.cursor && times.length > 1) layout.shapes = [cursor(), ...(layout.shapes || [])];
    const data = revived(themed(figure.data));
    for (const trace of data) if (trace.type === "heatmap") trace.zsmooth = false;
    if (figure.now) data[figure.now.trace].y = row(figure.now.frames, state.frame);
    const done = Plotly.newPlot(element, data, layout, config);
    if (figure.cursor && (first || again)) done.then(() => element.on("plotly_click", (event) => go(event.points[0].x)));
    await done;
    element.classList.add("drawn");
  };
  const follow = (element, figure) => {
    if (figure.now) Plotly.restyle(element, { y: [row(figure.now.frames, state.frame)] }, [figure.now.trace]);
    else if (figure.cursor) Plotly.relayout(element, { "shapes[0].x0": state.t, "shapes[0].x1": state.t });
  };

  // ---- time ------------------------------------------------------------------------------------

  const slider = byId("time"), said = byId("now"), button = byId("play"), pace = byId("pace");
  const nearest = (t) => {
    let low = 0, high = times.length - 1;
    while (high - low > 1) { const k = (low + high) >> 1; if (times[k] <= t) low = k; else high = k; }
    return t - times[low] < times[high] - t ? low : high;
  };
  const sayTime = () => {
    if (!slider) return;
    slider.value = String(state.frame);
    said.textContent = "t = " + state.t.toFixed(places) + " s";
    slider.setAttribute("aria-valuetext", said.textContent);
  };
  const show = (frame) => {
    state.frame = window.report.frame = frame;
    state.t = times[frame];
    sayTime();
    if (box3d) moveCable();
    for (const element of seen) if (graphs.has(element)) follow(element, graphs.get(element));
  };
  const go = (t) => { stop(); show(nearest(t)); };
  const pause = times.length > 1 ? (times.at(-1) - times[0]) / (times.length - 1) : 1;
  const places = Math.min(Math.max(1 - Math.floor(Math.log10(pause) + 1e-9), 0), 6);

  let last = 0;
  const tick = (now) => {
    if (!state.playing) return;
    const waits = starting && !space && hasWebGL();  // the cable is about to be drawn
    const t = state.clock + (waits ? 0 : (Math.min(now - last, 1000) / 1000) * Number(pace.value));
    last = now;
    if (t >= times.at(-1)) { show(times.length - 1); stop(); return; }
    state.clock = t;
    const frame = nearest(t);
    if (frame !== state.frame) show(frame);
    requestAnimationFrame(tick);
  };
  const stop = () => { state.playing = false; if (button) { button.textContent = "Play"; button.setAttribute("aria-pressed", "false"); } };
  const play = () => {
    if (state.frame === times.length - 1) show(0);
    state.playing = true;
    state.clock = state.t;
    button.textContent = "Pause";
    button.setAttribute("aria-pressed", "true");
    last = performance.now();
    requestAnimationFrame(tick);
  };
  const jump = (t, s) => {
    state.picked = Number.isFinite(s) ? s : null;
    go(t);
    byId("cable").scrollIntoView({ behavior: still ? "auto" : "smooth" });
  };

  // ---- beginning -------------------------------------------------------------------------------

  if (slider) {
    slider.max = String(times.length - 1);
    slider.addEventListener("input", () => { stop(); show(Number(slider.value)); });
    button.addEventListener("click", () => (state.playing ? stop() : play()));
  }
  for (const group of document.querySelectorAll(".switch")) {
    group.addEventListener("click", (event) => {
      const chosen = event.target.closest("button");
      if (!chosen) return;
      for (const other of group.children) other.setAttribute("aria-pressed", String(other === chosen));
      if (group.id === "colour") { state.colour = Number(chosen.value); recolour(); }
      else {
        state.stretched = chosen.value === "stretched";
        if (space) Plotly.relayout(box3d, { scene: sceneLayout() });
      }
      say3d();
    });
  }
  for (const target of document.querySelectorAll("[data-t]")) {
    const act = () => jump(Number(target.dataset.t), Number(target.dataset.s ?? NaN));
    target.addEventListener("click", act);
    if (target.tagName === "TR") target.addEventListener("keydown", (event) => { if (event.key === "Enter") act(); });
  }
  sayTime();
  if (box3d && scene) {  // its still drawing is there; plotly's takes a second or more, and is made when it is looked at
    say3d();
    if (!hasWebGL()) drawCable();  // which says so
    else {
      view();  // as high as it will be
      new IntersectionObserver((entries, watcher) => {
        if (!entries.some((entry) => entry.isIntersecting)) return;
        watcher.disconnect();
        inTurn(drawCable);
      }, { rootMargin: "-100px 0px" }).observe(box3d);
    }
  }
  const places2d = [...document.querySelectorAll(".plot[data-figure]")];
  const figureOf = (element) => index.figures[Number(element.dataset.figure)];
  const drawNearest = async () => {  // of the graphs that wait, that in the middle of the window
    await started();
    const far = (x) => { const box = x.getBoundingClientRect(); return Math.abs(box.top + box.bottom - innerHeight); };
    const [first] = [...seen].filter((x) => !graphs.has(x)).sort((a, b) => far(a) - far(b));
    if (first) await drawGraph(first, figureOf(first));
  };
  const watcher = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      if (!entry.isIntersecting) { seen.delete(entry.target); continue; }
      seen.add(entry.target);
      if (graphs.has(entry.target)) follow(entry.target, figureOf(entry.target));
      else inTurn(drawNearest);
    }
  }, { rootMargin: "150px" });
  for (const element of places2d) watcher.observe(element);
  const redraw = (elements) => elements.forEach((element) => drawGraph(element, figureOf(element), true));
  const folds = [...document.querySelectorAll("details")].map((fold) => [fold, fold.open]);
  const print = (on) => {  // light, and what is folded opens
    printing = on;
    if (box3d && scene) say3d();
    for (const each of folds) {
      if (on) each[1] = each[0].open;
      each[0].open = on || each[1];
    }
  };
  addEventListener("beforeprint", () => print(true));
  addEventListener("afterprint", () => print(false));
  night.addEventListener("change", () => {
    redraw([...graphs.keys()]);
    if (box3d && scene && space) { say3d(); drawCable(); }
  });
  performance.mark("ready");
  window.report.ready = true;
})();
