"use strict";
// Tension, moment and clearance along the line, with zones and cells below, on a canvas: plotly takes 50 ms of a
// processor for a new picture, and this takes 3.
window.makeGraphs = (box, onPick) => {
  const canvas = document.createElement("canvas"), tip = document.createElement("div");
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", "Tension, moment and clearance along the line; zones and cells");
  tip.className = "tip";
  tip.hidden = true;
  box.append(canvas, tip);
  const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const LEFT = 58, RIGHT = 14, BELOW = 36, STRIP = 24, HEAD = 22, APART = 8;
  // What stands in each of the three graphs: the first of these that the lines have.
  const ROWS = [["tension"], ["bending_moment", "curvature"], ["clearance", "z"]];
  const TITLES = { tension: "tension", bending_moment: "|moment|", curvature: "curvature", clearance: "clearance", z: "height z" };
  const UNITS = { tension: "N", bending_moment: "N m", curvature: "1/m", clearance: "m", z: "m" };
  let picture = null, frame = null, ranges = null, shade = (c) => c, window_ = null, at = null, pending = false, rows = [], drag = null;

  const has = (name) => name === "z" || frame.lines.some((line) => line.along[name]);
  const curveOf = (line, name) => (name === "z" ? [line.s, line.z] : line.along[name]);
  const prefix = (unit, peak) => {
    if (!(peak > 1e-12) || unit === "m" || unit === "1/m") return [1, unit];
    const power = Math.min(Math.max(Math.floor(Math.log10(peak) / 3 + 1e-12), -4), 4);
    return [10 ** (-3 * power), ["p", "n", "µ", "m", "", "k", "M", "G", "T"][power + 4] + unit];
  };
  const limits = (name) => {
    if (ranges && ranges[name] && ranges[name][1] > ranges[name][0]) return ranges[name];
    let [low, high] = name === "z" ? [Infinity, -Infinity] : [0, 0];
    for (const line of frame.lines) for (const v of (curveOf(line, name) || [[], []])[1]) if (v !== null) { if (v < low) low = v; if (v > high) high = v; }
    return low < high ? [low, high] : [low - 0.5, low + 0.5];
  };
  const steps = (low, high, most) => {
    const raw = (high - low) / most, power = 10 ** Math.floor(Math.log10(raw)), step = [1, 2, 5, 10].map((m) => m * power).find((v) => v >= raw * 0.999), out = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) out.push(Number((k * step).toPrecision(9)));
    return out;
  };
  const text = (v) => (Math.abs(v) >= 1e5 || (v !== 0 && Math.abs(v) < 1e-4) ? v.toExponential(1) : String(v));
  const longest = () => Math.max(...picture.heads.map((head) => head.length), 1e-9);
  const first = () => Math.min(0, ...picture.heads.map((head) => head.begin));
  const span = () => window_ || [first(), longest()];

  const draw = () => {
    pending = false;
    const pen = canvas.getContext("2d"), ratio = window.devicePixelRatio || 1, w = box.clientWidth, h = box.clientHeight;
    if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(h * ratio)) { canvas.width = Math.round(w * ratio); canvas.height = Math.round(h * ratio); }
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, w, h);
    if (!picture || !frame || w < 100) return;
    const [a, b] = span(), ink = style("--ink"), grey = style("--grey"), grid = style("--line"), back = style("--back");
    const X = (s) => LEFT + ((s - a) / (b - a)) * (w - LEFT - RIGHT);
    const tall = (h - BELOW - STRIP - APART) / 3, several = frame.lines.length > 1;
    const ticks = steps(a, b, Math.max(3, Math.round(w / 140)));
    pen.textBaseline = "middle";
    rows = ROWS.map((names, k) => {
      const name = names.find(has), top = k * tall + HEAD, bottom = (k + 1) * tall - 4;
      const [low, high] = limits(name), room = 0.05 * (high - low), [y0, y1] = [low === 0 ? 0 : low - room, high + room];
      const Y = (v) => bottom - ((v - y0) / (y1 - y0)) * (bottom - top);
      const [factor, unit] = prefix(UNITS[name], Math.max(Math.abs(low), Math.abs(high)));
      return { name, top, bottom, Y, y0, y1, factor, unit };
    });
    for (const row of rows) {
      pen.lineWidth = 1;
      pen.strokeStyle = grid;
      pen.fillStyle = grey;
      pen.font = "12px system-ui, sans-serif";
      pen.textAlign = "right";
      pen.beginPath();
      for (const v of steps(row.y0 * row.factor, row.y1 * row.factor, 4)) {
        const y = Math.round(row.Y(v / row.factor)) + 0.5;
        pen.moveTo(LEFT, y);
        pen.lineTo(w - RIGHT, y);
        pen.fillText(text(v), LEFT - 6, y);
      }
      for (const s of ticks) { const x = Math.round(X(s)) + 0.5; pen.moveTo(x, row.top); pen.lineTo(x, row.bottom); }
      pen.stroke();
      pen.fillStyle = ink;
      pen.font = "12.5px system-ui, sans-serif";
      pen.textAlign = "left";
      pen.fillText(`${TITLES[row.name]} (${row.unit})`, LEFT, row.top - 10);
      pen.save();
      pen.beginPath();
      pen.rect(LEFT, row.top - 2, w - LEFT - RIGHT, row.bottom - row.top + 4);
      pen.clip();
      pen.lineWidth = 1.6;
      pen.lineJoin = "round";
      frame.lines.forEach((line, i) => {
        const curve = curveOf(line, row.name);
        if (!curve) return;
        const colour = several ? shade((picture.heads[i] || {}).colour || "#222222") : ink;
        pen.strokeStyle = colour === "#222222" ? ink : colour;
        pen.beginPath();
        let open = false;
        curve[0].forEach((s, j) => {
          const v = curve[1][j];
          if (v === null || s === null) { open = false; return; }
          if (open) pen.lineTo(X(s), row.Y(v)); else pen.moveTo(X(s), row.Y(v));
          open = true;
        });
        pen.stroke();
      });
      pen.restore();
      pen.strokeStyle = grey;
      pen.lineWidth = 1;
      pen.beginPath();
      pen.moveTo(LEFT + 0.5, row.top);
      pen.lineTo(LEFT + 0.5, row.bottom);
      pen.stroke();
    }
    strip(pen, X, h, w, back);
    pen.fillStyle = grey;
    pen.font = "12px system-ui, sans-serif";
    pen.textAlign = "center";
    for (const s of ticks) pen.fillText(text(s), Math.min(X(s), w - RIGHT - 4), h - BELOW + 10);
    pen.fillStyle = ink;
    pen.fillText("s (m)", LEFT + 0.5 * (w - LEFT - RIGHT), h - 9);
    if (at !== null) {
      pen.strokeStyle = grey;
      pen.setLineDash([3, 3]);
      pen.beginPath();
      pen.moveTo(X(at), HEAD);
      pen.lineTo(X(at), h - BELOW);
      pen.stroke();
      pen.setLineDash([]);
    }
    if (drag && Math.abs(drag[1] - drag[0]) > 4) {
      pen.fillStyle = style("--select");
      pen.globalAlpha = 0.4;
      pen.fillRect(Math.min(...drag), HEAD, Math.abs(drag[1] - drag[0]), h - BELOW - HEAD);
      pen.globalAlpha = 1;
    }
  };
  // Zones as bars, cells as ticks on them; of several lines one row each.
  const strip = (pen, X, h, w, back) => {
    const count = Math.min(frame.lines.length, 8), top = h - BELOW - STRIP, each = STRIP / count;
    pen.save();
    pen.beginPath();
    pen.rect(LEFT, top, w - LEFT - RIGHT, STRIP);
    pen.clip();
    frame.lines.slice(0, count).forEach((line, i) => {
      const y = top + i * each;
      for (const [kind, a, b, colour] of line.zones) {
        pen.fillStyle = shade(colour);
        pen.fillRect(X(a), y + 0.5, X(b) - X(a), each - 1);
        if (count < 3 && X(b) - X(a) > 70) {
          pen.fillStyle = shade(colour) === colour ? "#ffffff" : back;  // in the dark colours are light
          pen.font = "11px system-ui, sans-serif";
          pen.textAlign = "center";
          pen.fillText(kind, 0.5 * (Math.max(X(a), LEFT) + Math.min(X(b), w - RIGHT)), y + 0.36 * each);
        }
      }
      if (count < 4 && line.nodes.length) {
        pen.strokeStyle = back;
        pen.lineWidth = 1;
        pen.beginPath();
        for (const s of line.nodes) { const x = Math.round(X(s)) + 0.5; pen.moveTo(x, y + 0.66 * each); pen.lineTo(x, y + each - 1); }
        pen.stroke();
      }
    });
    pen.restore();
  };
  const again = () => { if (!pending) { pending = true; requestAnimationFrame(draw); } };

  // ---- hands: values at the pointer, a range that is dragged, all of it by a double click ----------

  const sAt = (x) => { const [a, b] = span(); return a + ((x - LEFT) / (box.clientWidth - LEFT - RIGHT)) * (b - a); };
  const valueAt = ([x, y], s) => {
    let low = 0, high = x.length - 1;
    while (high - low > 1) { const k = (low + high) >> 1; if (x[k] <= s) low = k; else high = k; }
    if (y[low] === null || y[high] === null) return y[low] ?? y[high];
    return x[high] > x[low] ? y[low] + ((y[high] - y[low]) * Math.min(Math.max((s - x[low]) / (x[high] - x[low]), 0), 1)) : y[low];
  };
  const point = (x, y) => {
    const [a, b] = span(), s = sAt(x);
    at = picture && frame && s >= a && s <= b ? s : null;
    tip.hidden = at === null;
    onPick(at);
    again();
    if (at === null) return;
    const out = [`s = ${Number(s.toPrecision(5))} m`];
    frame.lines.slice(0, 6).forEach((line, i) => {
      const head = picture.heads[i] || {}, zone = line.zones.find((z) => s >= z[1] && s <= z[2]);
      if (s > head.length * (1 + 1e-9)) return;
      const parts = rows.filter((row) => curveOf(line, row.name)).map((row) => { const v = valueAt(curveOf(line, row.name), s); return v === null ? "" : `${TITLES[row.name]} ${Number((v * row.factor).toPrecision(4))} ${row.unit}`; });
      out.push(...(head.name ? [`${head.name}: ${parts.filter(Boolean).join(", ")}`] : [...parts.filter(Boolean), zone ? zone[0] : ""].filter(Boolean)));
    });
    tip.textContent = out.join("\n");
    tip.style.left = `${x > 0.6 * box.clientWidth ? x - tip.offsetWidth - 14 : x + 14}px`;
    tip.style.top = `${Math.min(y + 12, box.clientHeight - tip.offsetHeight - 4)}px`;
  };
  canvas.addEventListener("pointermove", (e) => { if (drag) drag[1] = e.offsetX; point(e.offsetX, e.offsetY); });
  canvas.addEventListener("pointerdown", (e) => { if (e.pointerType === "mouse" && e.button === 0) { drag = [e.offsetX, e.offsetX]; canvas.setPointerCapture(e.pointerId); } else point(e.offsetX, e.offsetY); });
  canvas.addEventListener("pointerup", () => {
    if (drag && Math.abs(drag[1] - drag[0]) > 8) { const ends = drag.map(sAt).sort((p, q) => p - q); window_ = [Math.max(ends[0], first()), Math.min(ends[1], longest())]; }
    drag = null;
    again();
  });
  canvas.addEventListener("pointerleave", () => { at = null; tip.hidden = true; drag = null; onPick(null); again(); });
  canvas.addEventListener("dblclick", () => { window_ = null; again(); });
  new ResizeObserver(again).observe(box);

  return {
    show: (now, of, over, shading) => {
      [picture, frame, ranges, shade] = [now, of, over, shading];
      if (window_ && window_[1] > longest()) window_ = null;
      draw();
    },
    fade: (on) => box.classList.toggle("old", on),
    again,
  };
};
