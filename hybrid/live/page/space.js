"use strict";
// The line in space, on a canvas: an orthographic view that is turned, moved and zoomed.  It needs no WebGL, which takes
// 70 ms a frame where a machine has no graphics processor, and this takes 3.
window.makeSpace = (canvas, tip) => {
  // From low to high, on white and in the dark: what is high stands out from the ground.
  const BLUE = [["#b5cfe1", "#0072b2", "#00304d"], ["#1f5f8f", "#3a9bd6", "#d6ecfb"]];
  const ORANGE = [["#f2c9a8", "#d55e00", "#5c2600"], ["#8a4a14", "#ee8033", "#ffe3cd"]];
  const scaleOf = (name) => (name === "tension" ? BLUE : ORANGE)[Number(dark())];
  const FIRST = { turn: -0.3, tilt: 0.26, zoom: 1, x: 0, y: 0 };
  let picture = null, frame = null, eye = { ...FIRST }, colour = "zone", stretched = false, shown = [], drawn = 0, old = false, pending = false, picked = null;

  const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const dark = () => matchMedia("(prefers-color-scheme: dark)").matches;
  const mixed = (stops, p) => {
    const at = Math.min(Math.max(p, 0), 1) * (stops.length - 1), k = Math.min(Math.floor(at), stops.length - 2), q = at - k;
    const rgb = (c) => [1, 3, 5].map((i) => parseInt(c.slice(i, i + 2), 16));
    const [a, b] = [rgb(stops[k]), rgb(stops[k + 1])];
    return `rgb(${a.map((v, i) => Math.round(v * (1 - q) + b[i] * q)).join(",")})`;
  };

  // ---- from metres to pixels -----------------------------------------------------------------

  const factors = () => {
    const size = picture.box.map(([a, b]) => Math.max(b - a, 1e-12)), largest = Math.max(...size);
    return size.map((v) => (stretched ? Math.max(1, (0.45 * largest) / v) : 1));
  };
  const projection = () => {
    const f = factors(), middle = picture.box.map(([a, b]) => 0.5 * (a + b));
    const half = picture.box.map(([a, b], k) => 0.5 * (b - a) * f[k]);
    const [ct, st, ce, se] = [Math.cos(eye.turn), Math.sin(eye.turn), Math.cos(eye.tilt), Math.sin(eye.tilt)];
    const right = [ct, st, 0], up = [st * se, -ct * se, ce], toward = [st * ce, -ct * ce, -se].map((v) => -v);
    const reach = (axis) => half.reduce((sum, v, k) => sum + Math.abs(axis[k]) * v, 0);
    const w = canvas.clientWidth, h = canvas.clientHeight;
    const scale = eye.zoom * Math.min((w - 110) / (2 * reach(right)), (h - 86) / (2 * reach(up)));  // room for numbers, legend and buttons
    const project = (p) => {
      const d = p.map((v, k) => (v - middle[k]) * f[k]);
      const dot = (axis) => axis[0] * d[0] + axis[1] * d[1] + axis[2] * d[2];
      return [0.5 * w + 18 + eye.x + scale * dot(right), 0.5 * h + 8 + eye.y - scale * dot(up), dot(toward)];
    };
    return { project, scale, f, toward };
  };

  // ---- drawing -------------------------------------------------------------------------------

  const draw = () => {
    pending = false;
    const pen = canvas.getContext("2d"), ratio = window.devicePixelRatio || 1;
    const w = canvas.clientWidth, h = canvas.clientHeight;
    if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(h * ratio)) {
      canvas.width = Math.round(w * ratio);
      canvas.height = Math.round(h * ratio);
    }
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, w, h);
    shown = [];
    drawn += 1;
    if (!picture || !frame || !w || !h) return;
    const { project } = projection();
    pen.globalAlpha = old ? 0.45 : 1;
    box(pen, project);
    for (const plane of picture.planes) surface(pen, project, plane);
    for (const arm of frame.arms || []) curve(pen, arm.map((p) => (p[0] === null ? null : project(p))), style("--grey"), 1.5);
    frame.lines.forEach((line, k) => cable(pen, project, line, k));
    for (const mark of frame.marks) for (const at of mark.at) symbol(pen, mark, project(at));
    pen.globalAlpha = 1;
    if (picked !== null) {  // the place under the pointer in the graphs
      for (const line of frame.lines) {
        if (picked > line.s[line.s.length - 1] * (1 + 1e-9)) continue;
        const p = project(["x", "y", "z"].map((axis) => valueAt([line.s, line[axis]], picked)));
        pen.beginPath();
        pen.arc(p[0], p[1], 6, 0, 7);
        pen.strokeStyle = style("--alarm");
        pen.lineWidth = 2;
        pen.stroke();
      }
    }
  };
  const again = () => {
    if (pending) return;
    pending = true;
    requestAnimationFrame(draw);
  };

  const curve = (pen, points, colour, width) => {
    pen.strokeStyle = colour;
    pen.lineWidth = width;
    pen.beginPath();
    let open = false;
    for (const p of points) {
      if (!p) { open = false; continue; }
      if (open) pen.lineTo(p[0], p[1]); else pen.moveTo(p[0], p[1]);
      open = true;
    }
    pen.stroke();
  };

  const steps = (low, high, most) => {
    const raw = (high - low) / most, power = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].map((m) => m * power).find((v) => v >= raw);
    const out = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) out.push(Number((k * step).toPrecision(6)));
    return out;
  };

  const box = (pen, project) => {
    // The three edges of the box that are lowest and nearest carry the numbers; the floor has a grid.
    const [x, y, z] = picture.box, f = factors(), grey = style("--line"), ink = style("--grey");
    const flat = (a, b, c) => project([a, b, c]);
    const largest = Math.max(...picture.box.map(([a, b], k) => (b - a) * f[k]));
    const ticks = picture.box.map(([a, b], k) => steps(a, b, Math.max(2, Math.round((7 * (b - a) * f[k]) / largest))));
    pen.font = "11px system-ui, sans-serif";
    pen.fillStyle = ink;
    for (const a of ticks[0]) curve(pen, [flat(a, y[0], z[0]), flat(a, y[1], z[0])], grey, 1);
    for (const b of ticks[1]) curve(pen, [flat(x[0], b, z[0]), flat(x[1], b, z[0])], grey, 1);
    const front = flat(x[0], y[0], z[0])[2] > flat(x[0], y[1], z[0])[2] ? y[0] : y[1];
    const side = flat(x[0], y[0], z[0])[2] > flat(x[1], y[0], z[0])[2] ? x[0] : x[1];
    const left = [[x[0], y[0]], [x[0], y[1]], [x[1], y[0]], [x[1], y[1]]].sort((p, q) => flat(p[0], p[1], z[0])[0] - flat(q[0], q[1], z[0])[0])[0];
    curve(pen, [flat(x[0], front, z[0]), flat(x[1], front, z[0])], ink, 1);
    curve(pen, [flat(side, y[0], z[0]), flat(side, y[1], z[0])], ink, 1);
    curve(pen, [flat(...left, z[0]), flat(...left, z[1])], ink, 1);
    const name = (list, at, axis, dx, dy) => list.forEach((v, k) => {
      const p = project(at(v)), last = k === list.length - 1;
      pen.textAlign = dx < 0 ? "right" : "center";
      pen.fillText(k === 0 ? `${axis} = ${v}` : last ? `${v} m` : `${v}`, p[0] + dx, p[1] + dy);
    });
    const wide = (k, p, q) => Math.hypot(p[0] - q[0], p[1] - q[1]) > 60;
    if (wide(0, flat(x[0], front, z[0]), flat(x[1], front, z[0]))) name(ticks[0], (v) => [v, front, z[0]], "x", 0, 15);
    if (wide(1, flat(side, y[0], z[0]), flat(side, y[1], z[0]))) name(ticks[1], (v) => [side, v, z[0]], "y", 4, 15);
    if (wide(2, flat(...left, z[0]), flat(...left, z[1]))) name(ticks[2], (v) => [...left, v], "z", -6, 4);
  };

  const surface = (pen, project, plane) => {
    if (!plane.x) return;
    const points = plane.x.map((_, k) => project([plane.x[k], plane.y[k], plane.z[k]]));
    const rim = (plane.rim || plane.x.map((_, k) => k)).map((k) => points[k]);
    pen.save();
    pen.globalAlpha *= (dark() ? 0.16 : 0.55) * plane.solid;
    pen.fillStyle = dark() ? plane.line : plane.fill;
    if (plane.i) {
      pen.beginPath();
      plane.i.forEach((a, k) => {
        const [p, q, r] = [points[a], points[plane.j[k]], points[plane.k[k]]];
        pen.moveTo(p[0], p[1]); pen.lineTo(q[0], q[1]); pen.lineTo(r[0], r[1]); pen.closePath();
      });
      pen.fill("nonzero");
    } else {
      pen.beginPath();
      rim.forEach((p, k) => (k ? pen.lineTo(p[0], p[1]) : pen.moveTo(p[0], p[1])));
      pen.closePath();
      pen.fill();
    }
    pen.restore();
    curve(pen, [...rim, rim[0]], plane.line, 1);
  };

  const quantity = () => (colour === "zone" || !frame.lines.some((line) => line.along[colour]) ? null : colour);
  const bounds = (name) => {
    let [low, high] = [Infinity, -Infinity];
    for (const line of frame.lines) for (const v of (line.along[name] || [[], []])[1]) if (v !== null) { low = Math.min(low, v); high = Math.max(high, v); }
    return low < high ? [low, high] : [low, low + (Math.abs(low) || 1)];
  };
  const valueAt = (along, s) => {
    const [x, y] = along;
    let low = 0, high = x.length - 1;
    while (high - low > 1) { const k = (low + high) >> 1; if (x[k] <= s) low = k; else high = k; }
    const p = x[high] > x[low] ? Math.min(Math.max((s - x[low]) / (x[high] - x[low]), 0), 1) : 0;
    return y[low] === null || y[high] === null ? (y[low] ?? y[high]) : y[low] * (1 - p) + y[high] * p;
  };
  const shade = (c) => (dark() && c === "#222222" ? "#e6e6e3" : dark() && c === "#0072B2" ? "#3a9bd6" : dark() && c === "#D55E00" ? "#ee8033" : c);

  const cable = (pen, project, line, k) => {
    const points = line.x.map((_, i) => (line.x[i] === null ? null : project([line.x[i], line.y[i], line.z[i]])));
    points.forEach((p, i) => p && shown.push({ p, s: line.s[i], i, line, k }));
    const name = quantity(), head = picture.heads[k] || {};
    pen.lineJoin = pen.lineCap = "round";
    if (!name) {
      if (!line.zones.length || frame.lines.length > 1) { curve(pen, points, shade(head.colour || "#222222"), 3); return; }
      for (const [, a, b, c] of line.zones) {
        const inside = points.filter((_, i) => line.s[i] >= a - 1e-9 && line.s[i] <= b + 1e-9);
        const first = line.s.findIndex((s) => s >= a - 1e-9);
        if (first > 0 && line.s[first] > a + 1e-9) inside.unshift(points[first - 1]);
        curve(pen, inside, shade(c), 3.2);
      }
      return;
    }
    const [low, high] = bounds(name), along = line.along[name], scale = scaleOf(name);
    for (let i = 1; i < points.length; i++) {
      if (!points[i] || !points[i - 1]) continue;
      const v = along ? valueAt(along, 0.5 * (line.s[i] + line.s[i - 1])) : null;
      curve(pen, [points[i - 1], points[i]], v === null ? style("--grey") : mixed(scale, (v - low) / (high - low)), 3.6);
    }
  };

  const symbol = (pen, mark, p) => {
    const r = mark.symbol === "circle" ? 4 : 4.5;
    pen.beginPath();
    if (mark.symbol === "circle") pen.arc(p[0], p[1], r, 0, 7);
    else if (mark.symbol === "diamond") { pen.moveTo(p[0], p[1] - r - 1); pen.lineTo(p[0] + r + 1, p[1]); pen.lineTo(p[0], p[1] + r + 1); pen.lineTo(p[0] - r - 1, p[1]); pen.closePath(); }
    else pen.rect(p[0] - r, p[1] - r, 2 * r, 2 * r);
    pen.fillStyle = shade(mark.colour);
    pen.fill();
    pen.lineWidth = 1;
    pen.strokeStyle = style("--back");
    pen.stroke();
    shown.push({ p, mark });
  };

  // ---- hands ---------------------------------------------------------------------------------

  const hands = new Map();
  let apart = 0;
  canvas.addEventListener("pointerdown", (e) => { canvas.setPointerCapture(e.pointerId); hands.set(e.pointerId, [e.clientX, e.clientY]); apart = 0; });
  const letGo = (e) => { hands.delete(e.pointerId); apart = 0; };
  canvas.addEventListener("pointerup", letGo);
  canvas.addEventListener("pointercancel", letGo);
  canvas.addEventListener("pointermove", (e) => {
    const before = hands.get(e.pointerId);
    if (!before) { point(e); return; }
    const [dx, dy] = [e.clientX - before[0], e.clientY - before[1]];
    hands.set(e.pointerId, [e.clientX, e.clientY]);
    tip.hidden = true;
    if (hands.size === 2) {
      const [a, b] = [...hands.values()], far = Math.hypot(a[0] - b[0], a[1] - b[1]);
      if (apart) eye.zoom = Math.min(Math.max(eye.zoom * (far / apart), 0.2), 500);
      apart = far;
      eye.x += dx / 2;
      eye.y += dy / 2;
    } else if (e.shiftKey || e.buttons === 2 || e.buttons === 4) { eye.x += dx; eye.y += dy; }
    else { eye.turn -= 0.008 * dx; eye.tilt = Math.min(Math.max(eye.tilt + 0.008 * dy, -1.55), 1.55); }
    again();
  });
  canvas.addEventListener("contextmenu", (e) => e.preventDefault());
  canvas.addEventListener("wheel", (e) => {
    e.preventDefault();
    const k = Math.exp(-0.0015 * e.deltaY), zoom = Math.min(Math.max(eye.zoom * k, 0.2), 500), q = zoom / eye.zoom;
    const [cx, cy] = [e.offsetX - 0.5 * canvas.clientWidth, e.offsetY - 0.5 * canvas.clientHeight];
    eye = { ...eye, zoom, x: cx - q * (cx - eye.x), y: cy - q * (cy - eye.y) };
    again();
  }, { passive: false });
  canvas.addEventListener("pointerleave", () => { tip.hidden = true; });
  canvas.addEventListener("dblclick", () => fit());
  canvas.addEventListener("keydown", (e) => {
    const move = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] }[e.key];
    if (move) { eye.turn += move[0]; eye.tilt = Math.min(Math.max(eye.tilt + move[1], -1.55), 1.55); }
    else if (e.key === "+" || e.key === "-") eye.zoom *= e.key === "+" ? 1.2 : 1 / 1.2;
    else if (e.key === "0") eye = first();
    else return;
    e.preventDefault();
    again();
  });
  const point = (e) => {
    const [x, y] = [e.offsetX, e.offsetY];
    let best = null, least = 20;
    for (const one of shown) { const d = Math.hypot(one.p[0] - x, one.p[1] - y) - (one.mark ? 4 : 0); if (d < least) { least = d; best = one; } }
    tip.hidden = !best;
    if (!best) return;
    const text = (v) => (v === null || v === undefined ? "–" : Number(v.toPrecision(5)).toString());
    if (best.mark) tip.textContent = best.mark.name;
    else {
      const { line, i, s, k } = best, name = (picture.heads[k] || {}).name;
      const rows = [`${name ? name + ", " : ""}s = ${text(s)} m`, `x = ${text(line.x[i])}, y = ${text(line.y[i])}, z = ${text(line.z[i])} m`];
      for (const [key, unit] of [["tension", "N"], ["bending_moment", "N m"], ["clearance", "m"]]) if (line.along[key]) rows.push(`${key.replace("_", " ")} ${text(valueAt(line.along[key], s))} ${unit}`);
      tip.textContent = rows.join("\n");
    }
    tip.style.left = `${Math.min(x + 14, canvas.clientWidth - 190)}px`;
    tip.style.top = `${Math.min(y + 14, canvas.clientHeight - 90)}px`;
  };

  const first = () => {
    const [x, y, z] = picture ? picture.box.map(([a, b]) => b - a) : [1, 1, 1];
    if (z < 0.25 * Math.min(x, y)) return { ...FIRST, tilt: 0.9 };
    return x >= y ? { ...FIRST } : { ...FIRST, turn: 1.27 };
  };
  const fit = () => { eye = first(); again(); };
  new ResizeObserver(again).observe(canvas);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", again);

  let shape = "";  // which way the box lies: another scene gets its own first view
  return {
    show: (now, at) => {
      picture = now;
      frame = at;
      old = false;
      const turned = first(), key = `${turned.turn} ${turned.tilt}`;
      if (key !== shape) { shape = key; eye = turned; }
      draw();
    },
    pick: (s) => { if (s !== picked) { picked = s; again(); } },
    fade: () => { if (!old) { old = true; again(); } },
    colour: (name) => { colour = name; again(); },
    stretch: (on) => { stretched = on; again(); },
    fit, again, factors: () => (picture ? factors() : [1, 1, 1]),
    bounds: () => (frame && quantity() ? [quantity(), ...bounds(quantity()), scaleOf(quantity())] : null),
    get drawn() { return drawn; },
    shade,
  };
};
