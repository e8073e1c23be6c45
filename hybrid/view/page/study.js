"use strict";
// The page of a study: table with sorting and filter, response curves, exceedance, parallel coordinates.
(async () => {
  const byId = (id) => document.getElementById(id);
  window.report = { ready: false };  // what a test, or a console, may look at
  const ROWS = 100;  // rows of the table at first, and more at every click

  const unpacked = async (id) => {
    const text = atob(byId(id).textContent.trim());
    const bytes = Uint8Array.from(text, (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Response(stream).text();
  };
  let study;
  try {
    study = JSON.parse(await unpacked("data"));
  } catch (error) {
    byId("count").textContent = "This page needs a browser of 2023 or later: " + error.message;
    return;
  }
  const { columns, variables, results, texts } = study;
  const names = Object.keys(columns);
  const n = columns.case.values.length;
  const label = (name) => columns[name].unit ? `${name} (${columns[name].unit})` : name;
  const value = (name, k) => columns[name].values[k];
  const isText = (name) => texts.includes(name);

  // ---- table -----------------------------------------------------------------------------------

  let order = [...Array(n).keys()], shown = order, sorted = { name: "case", up: true }, most = ROWS, chosen = null;

  const text = (name, k) => {
    const x = value(name, k);
    if (x === null) return "";
    return typeof x === "number" && !Number.isInteger(x) ? String(Number(x.toPrecision(5))) : String(x);
  };
  const fill = () => {
    const table = byId("table");
    table.textContent = "";
    const head = table.createTHead().insertRow();
    for (const name of names) {
      const cell = document.createElement("th");
      cell.scope = "col";
      cell.className = isText(name) ? "" : "number";
      cell.setAttribute("aria-sort", sorted.name !== name ? "none" : sorted.up ? "ascending" : "descending");
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = label(name) + (sorted.name !== name ? "" : sorted.up ? " ▲" : " ▼");
      button.title = columns[name].description;
      button.addEventListener("click", () => {
        sorted = { name, up: sorted.name === name ? !sorted.up : true };
        update();
      });
      cell.append(button);
      head.append(cell);
    }
    const body = table.createTBody();
    for (const k of shown.slice(0, most)) {
      const row = body.insertRow();
      row.className = (value("status", k) === "failed" ? "failed" : "") + (k === chosen ? " chosen" : "");
      for (const name of names) {
        const cell = row.insertCell();
        cell.className = isText(name) ? "" : "number";
        cell.textContent = text(name, k);
      }
      row.addEventListener("click", () => choose(k));
    }
    byId("count").textContent = `${shown.length} of ${n} cases`;
    byId("more").hidden = shown.length <= most;
  };
  const choose = (k) => {
    chosen = k;
    byId("again").textContent = study.again.replace(/--case \d+/, `--case ${value("case", k)}`)
      .replace(/case\d+\.h5/, `case${value("case", k)}.h5`);
    fill();
  };
  const compare = { "<": (a, b) => a < b, ">": (a, b) => a > b, "<=": (a, b) => a <= b, ">=": (a, b) => a >= b,
    "=": (a, b) => a === b, "==": (a, b) => a === b, "!=": (a, b) => a !== b };
  const test = (part) => {
    const found = part.match(/^\s*(\w+)\s*(<=|>=|==|!=|<|>|=)\s*(.+?)\s*$/);
    if (found && columns[found[1]]) {
      const wanted = Number.isNaN(Number(found[3])) ? found[3] : Number(found[3]);
      return (k) => value(found[1], k) !== null && compare[found[2]](value(found[1], k), wanted);
    }
    const word = part.trim().toLowerCase();
    return (k) => names.some((name) => String(value(name, k)).toLowerCase().includes(word));
  };
  const update = () => {
    const tests = byId("filter").value.split(/\band\b/).filter((part) => part.trim()).map(test);
    shown = order.filter((k) => tests.every((one) => one(k)));
    const sign = sorted.up ? 1 : -1;
    shown.sort((a, b) => {
      const [x, y] = [value(sorted.name, a), value(sorted.name, b)];
      if (x === null || y === null) return (x === null) - (y === null) || a - b;
      return (typeof x === "string" ? x.localeCompare(y) : x - y) * sign || a - b;
    });
    fill();
    if (window.Plotly) draw();
  };
  byId("filter").addEventListener("input", () => { most = ROWS; update(); });
  byId("more").addEventListener("click", () => { most += 10 * ROWS; fill(); });
  update();

  // ---- pictures --------------------------------------------------------------------------------

  const script = document.createElement("script");
  script.textContent = await unpacked("plotly");
  document.head.append(script);
  for (const id of ["data", "plotly"]) byId(id).textContent = "";
  const { Plotly } = window;

  const options = (id, list, first) => {
    for (const name of list) byId(id).append(new Option(name ? label(name) : "none", name));
    byId(id).value = first;
    byId(id).addEventListener("change", draw);
  };
  const numeric = variables.filter((name) => !isText(name));
  const axes = [...numeric, ...results];
  const base = { margin: { l: 64, r: 20, t: 10, b: 46 }, font: { family: "system-ui, sans-serif", size: 13 },
    paper_bgcolor: "#fff", plot_bgcolor: "#fff", showlegend: false, hovermode: "closest" };
  const config = { responsive: true, displaylogo: false };
  const grid = (title) => ({ title: { text: title }, gridcolor: "#e8e8e8", zerolinecolor: "#cfcfcf" });
  const quantile = (values, q) => {
    const at = q * (values.length - 1), k = Math.floor(at);
    return values[k] + (at - k) * ((values[k + 1] ?? values[k]) - values[k]);
  };
  function draw() {
    const [x, y, colour] = ["x", "y", "colour"].map((id) => byId(id).value);
    if (!y) return;
    const have = shown.filter((k) => value(y, k) !== null && value(x, k) !== null);
    const marks = { type: "scatter", mode: "markers", x: have.map((k) => value(x, k)), y: have.map((k) => value(y, k)),
      customdata: have, text: have.map((k) => `case ${value("case", k)}`), hovertemplate: "%{text}<br>%{x}, %{y}<extra></extra>",
      marker: { size: 7, color: colour ? have.map((k) => value(colour, k)) : "#0072b2", opacity: 0.75, colorscale: "Cividis",
        showscale: Boolean(colour), colorbar: { title: { text: colour ? label(colour) : "" }, thickness: 12 } } };
    const traces = [];
    const groups = new Map();
    for (const k of have) groups.set(value(x, k), [...(groups.get(value(x, k)) ?? []), value(y, k)]);
    if (groups.size > 1 && groups.size <= 40 && have.length > 2 * groups.size) {
      const keys = [...groups.keys()].sort((a, b) => a - b);
      const sets = keys.map((key) => groups.get(key).sort((a, b) => a - b));
      const line = (q, more) => ({ type: "scatter", mode: "lines", x: keys, y: sets.map((set) => quantile(set, q)), hoverinfo: "skip", ...more });
      traces.push(line(0.1, { line: { width: 0 } }), line(0.9, { line: { width: 0 }, fill: "tonexty", fillcolor: "rgba(0,0,0,0.08)" }),
        line(0.5, { line: { color: "#444", width: 2 } }));
    }
    Plotly.react("scatter", [...traces, marks], { ...base, xaxis: grid(label(x)), yaxis: grid(label(y)) }, config);
    const values = have.map((k) => value(y, k)).sort((a, b) => a - b);
    Plotly.react("exceedance", [{ type: "scatter", mode: "lines", line: { shape: "hv", color: "#0072b2" }, x: values,
      y: values.map((_, k) => 1 - (k + 1) / (values.length + 1)) }],
      { ...base, xaxis: grid(label(y)), yaxis: { ...grid("exceeded in"), type: values.length > 20 ? "log" : "linear", dtick: values.length > 20 ? 1 : undefined } }, config);
    const lines = [...numeric, y].map((name) => ({ label: label(name), values: have.map((k) => value(name, k)) }))
      .filter((axis) => axis.values.every((one) => one !== null));
    Plotly.react("parallel", [{ type: "parcoords", dimensions: lines,
      line: { color: have.map((k) => value(y, k)), colorscale: "Cividis" } }], { ...base, margin: { l: 60, r: 60, t: 40, b: 20 } }, config);
  }
  options("y", results, results[0]);
  options("x", axes, axes[0]);
  options("colour", ["", ...axes], numeric[1] ?? "");
  if (results.length) {
    draw();
    byId("scatter").on("plotly_click", (event) => {
      const k = event.points[0].customdata;
      if (k !== undefined) { choose(k); byId("table").scrollIntoView({ block: "nearest" }); }
    });
  }
  window.report.ready = true;
})();
