"use strict";
// The editor: CodeMirror, with completion and help from the JSON schema of a scene, and marks at the lines of messages.
window.makeEditor = (element, help, tip, onChange, onSave, onRun) => {
  const { CodeMirror } = window;
  const KEYS = matchMedia("(pointer: coarse)").matches ? "" : "Ctrl+Space completes, Ctrl+S saves, Ctrl+Enter runs; Esc leaves the editor.";
  const keys = () => (editor.getOption("readOnly") ? "" : KEYS);
  let schemas = null, quiet = false, marked = [], gutters = new Map();
  const editor = CodeMirror(element, {
    mode: "yaml", lineNumbers: true, lineWrapping: true, indentUnit: 2, tabSize: 2, gutters: ["marks", "CodeMirror-linenumbers"],
    extraKeys: {
      "Ctrl-Space": () => complete(), "Ctrl-S": onSave, "Cmd-S": onSave, "Ctrl-Enter": onRun, "Cmd-Enter": onRun,
      Tab: (cm) => (cm.somethingSelected() ? cm.indentSelection("add") : cm.replaceSelection("  ")), "Shift-Tab": "indentLess",
      Esc: () => editor.getInputField().blur(),  // so that Tab leaves the editor
    },
  });
  editor.getInputField().setAttribute("aria-label", "The scene as YAML; Escape, then Tab leaves it");
  new ResizeObserver(() => { editor.refresh(); if (editor.hasFocus()) editor.scrollIntoView(null, 20); }).observe(element);
  // What does not fit on a line goes on below its beginning.
  editor.on("renderLine", (cm, line, element) => {
    const wide = (CodeMirror.countColumn(line.text, null, 2) + 2) * cm.defaultCharWidth();
    element.style.textIndent = `-${wide}px`;
    element.style.paddingLeft = `${wide + 4}px`;
  });

  // ---- where the cursor is in the scene --------------------------------------------------------

  // The tables around a place: [{key, seen, values}], outermost first, and what is being written there.  It reads block
  // and flow style line by line, and forgives what is not finished.
  const contextAt = (line, column) => {
    const stack = [{ indent: -1, key: null, seen: new Set(), values: {}, list: false }];
    const top = () => stack[stack.length - 1];
    const open = (indent, list, flow) => stack.push({ indent, key: null, seen: new Set(), values: {}, list, flow });
    let writing = "", position = "key";
    for (let n = 0; n <= line; n++) {
      const full = editor.getLine(n), text = n === line ? full.slice(0, column) : full;
      let at = 0;
      const flowing = stack.some((x) => x.flow);
      if (!flowing) {
        const blank = /^\s*(#.*)?$/.test(text);
        if (blank && n < line) continue;
        let indent = text.match(/^ */)[0].length;
        at = indent;
        if (!blank || n === line) {
          while (stack.length > 1 && top().indent > indent) stack.pop();
          while (stack.length > 1 && top().list && top().indent === indent && text[at] !== "-") stack.pop();
          if (top().indent < indent && !(top().list && text[at] === "-" && top().indent === indent)) open(indent, text[at] === "-", false);
          while (text[at] === "-" && (text[at + 1] === " " || at + 1 === text.length)) {
            if (!top().list) open(indent, true, false);
            while (stack.length && top().indent > indent) stack.pop();
            at += 1 + (text.slice(at + 1).match(/^ */)[0].length);
            indent = at;
            open(indent, text[at] === "-", false);
          }
        }
      }
      position = "key";
      writing = "";
      let quote = "";
      for (; at < text.length; at++) {
        const c = text[at];
        if (quote) { if (c === quote) quote = ""; writing += c; continue; }
        if (c === "#" && (at === 0 || /\s/.test(text[at - 1]))) { if (n === line) return null; break; }
        if (c === "'" || c === '"') { quote = c; writing += c; }
        else if (c === "{" || c === "[") { open(at, c === "[", true); position = "key"; writing = ""; }
        else if (c === "}" || c === "]") { while (stack.length > 1 && !top().flow) stack.pop(); if (stack.length > 1) stack.pop(); position = "after"; writing = ""; }
        else if (c === "," && top().flow) { if (top().key) top().values[top().key] = writing.trim(); top().key = null; position = "key"; writing = ""; }
        else if (c === ":" && (at + 1 === text.length || /[\s{[]/.test(text[at + 1])) && position === "key" && !(top().flow && top().list)) {
          top().key = writing.trim();
          top().seen.add(top().key);
          position = "value";
          writing = "";
        } else writing += c;
      }
      if (n < line && top().key && position === "value" && !top().flow) top().values[top().key] = writing.trim();
      if (n < line && stack.some((x) => x.flow) && top().key && position === "value") top().values[top().key] = writing.trim();
    }
    const path = [];
    stack.forEach((x, k) => {
      if (k === 0) return;
      const inner = k === stack.length - 1;
      if (x.list) path.push("[]"); else if (x.key && !inner) path.push(x.key);
    });
    const last = top();
    if (stack.length === 1) return { path: [], position, prefix: writing.trim(), key: last.key, seen: last.seen, values: [{}] };
    return { path, position: last.list && position === "key" ? "value" : position, prefix: writing.trim(), key: last.list ? "[]" : last.key, seen: last.seen,
      values: stack.slice(1).map((x) => x.values), list: last.list };
  };

  // ---- the schema ------------------------------------------------------------------------------

  const rootOf = () => (/^(lines|points):/m.test(editor.getValue()) ? schemas.lines : schemas.cable);
  const deref = (root, node) => {
    let seen = 0;
    while (node && node.$ref && seen++ < 9) node = { ...root.$defs[node.$ref.split("/").pop()], ...(node.description ? { description: node.description } : {}) };
    return node || {};
  };
  const options = (root, node) => {
    const one = deref(root, node), more = one.anyOf || one.oneOf || one.allOf;
    return more ? more.flatMap((x) => options(root, x)) : [one];
  };
  const inside = (root, nodes, key) => nodes.flatMap((node) => {
    if (key === "[]") return node.items ? options(root, node.items) : (node.prefixItems || []).flatMap((x) => options(root, x));
    if (node.properties && node.properties[key]) return options(root, node.properties[key]);
    return node.additionalProperties && typeof node.additionalProperties === "object" ? options(root, node.additionalProperties) : [];
  });
  const ofKind = (nodes, values) => {
    const kind = values && values.kind;
    if (!kind) return nodes;
    const same = nodes.filter((node) => { const k = (node.properties || {}).kind; return k && (k.const === kind || (k.enum || []).includes(kind)); });
    return same.length ? same : nodes;
  };
  const tablesAt = (context) => {
    const root = rootOf();
    let nodes = options(root, root);
    context.path.forEach((key) => { nodes = inside(root, nodes, key); });
    return { root, nodes: ofKind(nodes, context.values[context.values.length - 1]) };
  };
  const describe = (root, nodes, key) => {
    for (const node of nodes) {
      const found = (node.properties || {})[key];
      if (!found) continue;
      const one = deref(root, found), text = found.description || one.description || "";
      const words = options(root, found).flatMap((x) => x.enum || (x.const !== undefined ? [x.const] : []));
      const rows = [`${found.title || key}: ${text}`];
      if (words.length) rows.push(`one of: ${[...new Set(words)].join(", ")}`);
      if (found.default !== undefined && found.default !== null && typeof found.default !== "object") rows.push(`absent: ${found.default}`);
      if ((node.required || []).includes(key)) rows.push("required");
      return rows.join("\n");
    }
    return "";
  };

  // ---- completion ------------------------------------------------------------------------------

  const hints = () => {
    if (!schemas) return null;
    const cursor = editor.getCursor(), context = contextAt(cursor.line, cursor.ch);
    if (!context || context.position === "after") return null;
    const { root, nodes } = tablesAt(context), prefix = context.prefix, list = [];
    const from = CodeMirror.Pos(cursor.line, cursor.ch - prefix.length);
    if (context.position === "key") {
      const names = new Map();
      for (const node of nodes) for (const [name, value] of Object.entries(node.properties || {})) if (!context.seen.has(name) && !names.has(name)) names.set(name, { value, needed: (node.required || []).includes(name) });
      for (const [name, { value, needed }] of names) {
        if (!name.startsWith(prefix) || name === prefix) continue;
        const one = deref(root, value);
        list.push({ text: `${name}: `, name, needed, about: value.description || one.description || "" });
      }
      list.sort((a, b) => b.needed - a.needed || 0);
    } else {
      const own = context.key === "[]" ? nodes : inside(root, nodes, context.key);
      const words = own.flatMap((x) => x.enum || (x.const !== undefined ? [x.const] : x.type === "boolean" ? [true, false] : []));
      for (const word of new Set(words)) if (String(word).startsWith(prefix) && String(word) !== prefix) list.push({ text: String(word), name: String(word), about: "" });
    }
    if (!list.length) return null;
    return { from, to: cursor, list: list.map((x) => ({ text: x.text, render: (li) => { li.textContent = x.name + (x.needed ? " *" : ""); const more = document.createElement("small"); more.textContent = x.about ? "  " + x.about : ""; li.append(more); } })) };
  };
  const complete = () => editor.showHint({ hint: hints, completeSingle: false });
  editor.on("inputRead", (cm, change) => { if (/[\w{, ]$/.test(change.text[change.text.length - 1]) && !cm.state.completionActive) complete(); });

  // ---- help ------------------------------------------------------------------------------------

  const aboutAt = (line, column) => {
    if (!schemas) return "";
    const text = editor.getLine(line) || "";
    let end = column;
    while (end < text.length && /[\w]/.test(text[end])) end++;
    let begin = column;
    while (begin > 0 && /[\w]/.test(text[begin - 1])) begin--;
    if (begin === end) return "";
    const context = contextAt(line, end);
    if (!context) return "";
    const { root, nodes } = tablesAt(context);
    if (/^\s*:(\s|$|[{[])/.test(text.slice(end)) && context.position === "key") return describe(root, nodes, text.slice(begin, end));
    return context.position === "value" && context.key && context.key !== "[]" ? describe(root, nodes, context.key) : "";
  };
  const problemsAt = (line) => marked.filter((x) => x.line === line + 1).map((x) => `${x.where}\n${x.given ? "given: " + x.given + "\n" : ""}${x.text}`).join("\n");
  editor.on("cursorActivity", () => { const { line, ch } = editor.getCursor(); help.textContent = aboutAt(line, ch) || keys(); });
  help.textContent = keys();
  const wrapper = editor.getWrapperElement();
  // Only a hand that moves the mouse asks for help: browsers send a move also when the text moves under a mouse at rest,
  // and taps, behind which one writes, send some too.
  let waiting = 0, rest = "";
  const hideTip = () => { clearTimeout(waiting); tip.hidden = true; };
  const showTip = (e) => {
    if (editor.state.completionActive) return;
    const at = editor.coordsChar({ left: e.clientX, top: e.clientY }, "window"), there = editor.charCoords(at, "window");
    const near = Math.abs(there.left - e.clientX) < 14 && e.clientY >= there.top && e.clientY <= there.bottom;
    const text = [problemsAt(at.line), near ? aboutAt(at.line, at.ch) : ""].filter(Boolean).join("\n\n");
    tip.hidden = !text;
    tip.textContent = text;
    const box = wrapper.getBoundingClientRect(), below = e.clientY - box.top + 18, above = e.clientY - box.top - 12 - tip.offsetHeight;
    tip.style.left = `${Math.min(e.clientX - box.left + 12, Math.max(box.width - 350, 4))}px`;
    tip.style.top = `${below + tip.offsetHeight > box.height && above > 0 ? above : below}px`;
  };
  wrapper.addEventListener("pointermove", (e) => {
    const place = `${e.screenX} ${e.screenY}`;
    if (e.pointerType !== "mouse" || place === rest) return;
    rest = place;
    clearTimeout(waiting);
    waiting = setTimeout(() => showTip(e), 150);
  });
  wrapper.addEventListener("pointerleave", hideTip);
  wrapper.addEventListener("pointerdown", hideTip);
  editor.on("scroll", hideTip);
  editor.on("keydown", hideTip);
  editor.on("change", () => { hideTip(); if (!quiet) onChange(); });

  // ---- the text and its marks ------------------------------------------------------------------

  const mark = (problems) => {
    editor.operation(() => {
      for (const handle of gutters.keys()) editor.removeLineClass(handle, "background", "line-problem");
      editor.clearGutter("marks");
      gutters = new Map();
      marked = problems.filter((x) => x.line);
      for (const one of marked) {
        if (one.line > editor.lineCount()) continue;
        const handle = editor.getLineHandle(one.line - 1);
        if (!one.note) editor.addLineClass(handle, "background", "line-problem");
        gutters.set(handle, one);
        const dot = document.createElement("span");
        dot.className = one.note ? "mark note" : "mark";
        dot.textContent = "●";
        dot.title = `${one.where}: ${one.text}`;
        editor.setGutterMarker(handle, "marks", dot);
      }
    });
  };
  // Another text in place of this one: only what differs is replaced, so that the cursor stays.
  const put = (text) => {
    const now = editor.getValue();
    if (now === text) return;
    let a = 0, b = 0;
    const most = Math.min(now.length, text.length);
    while (a < most && now[a] === text[a]) a++;
    while (b < most - a && now[now.length - 1 - b] === text[text.length - 1 - b]) b++;
    quiet = true;
    editor.replaceRange(text.slice(a, text.length - b), editor.posFromIndex(a), editor.posFromIndex(now.length - b), "*remote");
    quiet = false;
  };
  return {
    put, mark, editor, text: () => editor.getValue(), contextAt, aboutAt, hints,
    schema: (found) => { schemas = found; },
    readOnly: (on) => { if (editor.getOption("readOnly") !== on) { editor.setOption("readOnly", on); help.textContent = keys(); } },
    go: (line, column) => { editor.focus(); editor.setCursor(line - 1, (column || 1) - 1); editor.scrollIntoView(null, 80); },
    skipHead: () => {  // to the first line that is no comment
      let k = 0;
      while (k < editor.lineCount() && /^\s*(#.*)?$/.test(editor.getLine(k))) k++;
      if (k > 6 && k < editor.lineCount()) editor.scrollTo(null, editor.charCoords({ line: k, ch: 0 }, "local").top - 6);
    },
    refresh: () => editor.refresh(),
    forget: () => editor.clearHistory(),
  };
};
// What a text `mine` has on top of `from`, put on `to`; null where both changed the same place.
window.rebased = (from, to, mine) => {
  if (mine === from) return to;
  const part = (text) => {
    let a = 0, b = 0;
    const most = Math.min(from.length, text.length);
    while (a < most && from[a] === text[a]) a++;
    while (b < most - a && from[from.length - 1 - b] === text[text.length - 1 - b]) b++;
    return { a, b: from.length - b, put: text.slice(a, text.length - b) };
  };
  const [x, y] = [part(to), part(mine)];
  if (x.b < y.a) return from.slice(0, x.a) + x.put + from.slice(x.b, y.a) + y.put + from.slice(y.b);
  if (y.b < x.a) return from.slice(0, y.a) + y.put + from.slice(y.b, x.a) + x.put + from.slice(x.b);
  return null;
};
