(() => {
  const known = JSON.parse(document.getElementById("known").textContent);
  const byId = (id) => document.getElementById(id);
  const knobs = known.knobs;
  const waiting = [];
  const theory = {};
  const times = [];           // ms from an event to what it has drawn, the newest last
  let channel = null, asked = null, number = 0, shown = { values: {} }, slow = 0;
  window.hgorun = { times, get idle() { return channel !== null && asked === null && waiting.length === 0; } };

  // ---- sliders: places of a slider and values

  const logarithmic = (knob) => knob.scale === "log";
  const sign = (knob) => Math.sign(knob.low) || 1;
  function valueAt(knob, place) {
    if (place === placeOf(knob, knob.start)) return knob.start;
    if (knob.scale === "integer") return place;
    const part = place / known.places;
    const value = logarithmic(knob)
      ? sign(knob) * Math.exp((1 - part) * Math.log(Math.abs(knob.low)) + part * Math.log(Math.abs(knob.high)))
      : knob.low + part * (knob.high - knob.low);
    return Number(value.toPrecision(4));
  }
  function placeOf(knob, value) {
    if (knob.scale === "integer") return Math.round(value);
    const size = (v) => logarithmic(knob) ? Math.log(Math.max(sign(knob) * v, 1e-300)) : v;
    const part = (size(value) - size(knob.low)) / (size(knob.high) - size(knob.low) || 1);
    return Math.round(known.places * Math.min(Math.max(part, 0), 1));
  }
  const slider = (i) => document.querySelector(`[data-knob="${i}"]`);
  const field = (i) => document.querySelector(`[data-number="${i}"]`);
  const text = (value) => String(value);
  const seen = [];            // values that sliders and fields show
  function show(i, value) {
    if (seen[i] === value) return;
    if (document.activeElement !== field(i)) seen[i] = value;
    const one = slider(i), unit = knobs[i].unit ? " " + knobs[i].unit : "";
    one.value = placeOf(knobs[i], value);
    one.setAttribute("aria-valuetext", text(Number(value.toPrecision(4))) + unit);
    if (document.activeElement !== field(i)) field(i).value = text(value);
  }

  // ---- groups that are folded at first: beside their names stands how many of their values are not the file's

  const folds = [...document.querySelectorAll(".fold")].map((button) => {
    const inside = byId(button.getAttribute("aria-controls"));
    const own = [...inside.querySelectorAll("[data-knob]")].map((one) => knobs[one.dataset.knob]);
    const open = (is) => { inside.hidden = !is; button.setAttribute("aria-expanded", String(is)); };
    button.addEventListener("click", () => open(inside.hidden));
    return { own, open, said: button.nextElementSibling };
  });
  function mark_folds(values, first) {
    for (const { own, open, said } of folds) {
      const moved = own.filter((knob) => values[knob.name] !== knob.start).length;
      const words = moved ? `${moved} changed` : "";
      if (said.textContent !== words) said.textContent = words;
      if (first && moved) open(true);
    }
  }

  // ---- questions: one at a time; while a slider moves only the newest of its values waits

  function ask(question) {
    question.at = performance.now();
    const last = waiting[waiting.length - 1];
    if (last && last.do === "set" && question.do === "set" && last.name === question.name && !last.final) waiting.pop();
    waiting.push(question);
    send();
  }
  // What is still computed after a second is dropped for a newer place of the same slider.
  function overtakes(next) {
    return asked.do === "set" && next.do === "set" && next.name === asked.name && !next.typed
      && performance.now() - asked.sent > 1000;
  }
  function send() {
    if (channel === null || waiting.length === 0 || (asked !== null && !overtakes(waiting[0]))) return;
    asked = waiting.shift();
    asked.number = ++number;
    asked.sent = performance.now();
    channel.send(JSON.stringify(asked));
    clearTimeout(slow);
    slow = setTimeout(() => say("computing", "busy"), 200);
    setTimeout(send, 1010);
  }
  function say(words, kind = "") {
    const said = byId("said");
    if (said.textContent !== words) said.textContent = words;
    if (said.dataset.kind !== kind) said.dataset.kind = kind;
  }

  // ---- answers

  // Curves are drawn before what is told is written down: they read styles, which every change there makes stale.
  function heard({ data }) {
    const length = new Uint32Array(data, 0, 1)[0];
    const told = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 8, length)));
    try { painting.draw(Bokeh.documents[0], told.drawn, new Float64Array(data, 8 + length)); }
    finally { take(told); }  // what cannot be drawn leaves no question without its answer
  }
  function take(told) {
    const further = told.further || (told.theories && !told.picture);
    if (told.number < number && !further) return;  // what is further is of what is shown, whatever is asked meanwhile
    if (told.busy) { clearTimeout(slow); say(told.busy, "busy"); return; }
    if (further) {
      if (told.theories?.some((one) => one.drawn !== undefined)) bounds_are(true);
      if (told.picture) draw_metrics(told.picture);
      if (told.theories) { keep_theories(told.theories); draw_theories(); redrawn(); }
      return;
    }
    clearTimeout(slow);
    const question = asked;
    asked = null;
    shown = told;
    const held = waiting.length > 0;
    knobs.forEach((knob, i) => { if (!held || document.activeElement !== slider(i)) show(i, told.values[knob.name]); });
    mark_folds(told.values, question?.do === "begin");
    const fault = Boolean(told.error);
    knobs.forEach((knob, i) => field(i).setAttribute("aria-invalid", String(fault && question?.name === knob.name)));
    if ((fault || question?.typed) && question?.name !== undefined) {
      const i = knobs.findIndex((knob) => knob.name === question.name);
      field(i).value = text(told.values[question.name]);
    }
    for (const box of document.querySelectorAll("[data-observer]")) {
      const off = told.off.includes(box.dataset.observer);
      box.checked = !off;
      for (const one of box.closest("fieldset").querySelectorAll(".knob input")) one.disabled = off;
    }
    byId("undo").disabled = !told.undo;
    byId("redo").disabled = !told.redo;
    if (question?.final !== false || fault) keep_address(told);
    if (told.file) byId("file").value = told.file;
    if (told.theories) keep_theories(told.theories);
    if (told.picture) { draw_metrics(told.picture); draw_theories(); bounds_are(told.theories.length >= told.picture.rows.length); }
    if (told.error) say(told.error, "error");
    else if (told.written) say(`written: ${told.written}`);
    else say(summary);
    if (question) redrawn(question.at);
    if (told.theories?.length === told.picture?.rows.length) redrawn();
    send();
  }
  // Where bounds take longer than the curves, those before stay in sight until then, and it is said that they are.
  function bounds_are(known) {
    for (const one of document.querySelectorAll("figure[id^=error], figure[id^=other], #theory"))
      if (known) one.removeAttribute("aria-busy"); else one.setAttribute("aria-busy", "true");
  }
  // The browser takes longer to change its address than to draw the curves: not while a slider is held.
  function keep_address(told) {
    byId("command").textContent = told.command;
    const query = told.query ? "?" + told.query : "";
    history.replaceState(null, "", location.pathname + query);
    for (const kind of ["png", "pdf"]) byId(kind).href = `figure.${kind}${query}`;
  }
  let summary = "", since = 0;
  function redrawn(at) {
    if (at !== undefined) since = at;
    const begun = since;
    requestAnimationFrame(() => setTimeout(() =>  // after the frame
      times.push([at === undefined ? "theory" : "curves", performance.now() - begun])));
  }

  const element = (kind, words, more = {}) => Object.assign(document.createElement(kind), { textContent: words }, more);
  function cell([words, digits]) {
    const one = element("td", words);
    one.dataset.value = digits;
    one.title = digits;
    return one;
  }
  // Tables: where one has no room, its columns stand in blocks of as many below each other.
  const tables = {};          // by id: what it was built of, whose cells are written anew where nothing else changes
  function table(id, columns, rows, meanings) {
    const shape = JSON.stringify([columns, rows.map(([label]) => label)]);
    if (tables[id]?.shape === shape) { refill(tables[id].rows, rows); return; }
    if (tables[id] === undefined) new ResizeObserver(() => fold(id)).observe(byId(id).parentElement);
    tables[id] = { shape, columns, rows, meanings };
    fold(id);
  }
  function fold(id) {
    const own = tables[id], room = byId(id).parentElement.clientWidth;
    if (own.room === room) return;
    own.room = room;
    let most = Math.max(own.columns.length, 1);
    for (build(id, own, most); most > 1 && byId(id).offsetWidth > room; build(id, own, most))
      most = Math.max(1, Math.min(most - 1, Math.floor(most * room / byId(id).offsetWidth)));
  }
  function build(id, { columns, rows, meanings }, most) {
    const blocks = Math.max(Math.ceil(columns.length / most), 1), each = Math.ceil(columns.length / blocks);
    byId(id).replaceChildren(...Array.from({ length: blocks }, (_, block) => {
      const part = [block * each, (block + 1) * each], body = document.createElement("tbody");
      const head = document.createElement("tr");
      head.append(element("th", "observer", { scope: "col" }), ...columns.slice(...part).map((words, i) => title(words, meanings[part[0] + i])));
      body.append(head);
      for (const [label, cells] of rows) {
        const line = document.createElement("tr");
        line.dataset.label = label;
        line.append(element("th", label, { scope: "row" }), ...cells.slice(...part));
        body.append(line);
      }
      return body;
    }));
  }
  function title(words, meaning) {  // long names may be broken at their underscores
    const one = element("th", "", { scope: "col", title: meaning });
    words.split(/(?<=_)/).forEach((part, i) => one.append(...(i ? [document.createElement("wbr"), part] : [part])));
    return one;
  }
  function refill(before, rows) {
    rows.forEach(([, cells], i) => cells.forEach((cell, j) => {
      const old = before[i][1][j];
      if (old.textContent !== cell.textContent) old.textContent = cell.textContent;
      if (old.title !== cell.title) old.title = cell.title;
      if (old.dataset.value !== cell.dataset.value) old.dataset.value = cell.dataset.value;
    }));
  }
  function list(id, lines) {
    const items = byId(id).children;
    if (items.length !== lines.length) byId(id).replaceChildren(...lines.map((words) => element("li", words)));
    else lines.forEach((words, i) => { if (items[i].textContent !== words) items[i].textContent = words; });
  }
  function draw_metrics(picture) {
    table("metrics", ["status", ...picture.columns], picture.rows.map((row) =>
      [row.label, [element("td", row.status, { title: row.reason }), ...row.cells.map(cell)]]), ["", ...picture.meanings]);
    const columns = JSON.stringify(picture.columns);
    if (byId("metrics").dataset.columns !== columns) byId("metrics").dataset.columns = columns;
    summary = picture.said.length ? picture.said.join("; ") : picture.status;
    for (const label of Object.keys(theory)) if (!picture.rows.some((row) => row.label === label)) delete theory[label];
  }
  function keep_theories(found) {
    for (const one of found) {
      const old = theory[one.label];
      theory[one.label] = one.reason === undefined && old
        ? { ...old, cells: { ...old.cells, ...one.cells }, reasons: { ...old.reasons, ...one.reasons } } : one;
    }
  }
  function draw_theories() {
    if (byId("theory") === null) return;  // recorded data have none
    const labels = known.labels.filter((label) => label in theory);
    const columns = [];
    for (const [name, title, meaning] of known.findings) {
      const states = [...new Set(labels.flatMap((label) => Object.keys(theory[label].cells[name] ?? {})))];
      for (const state of states) columns.push([name, state, state ? `${title} ${state}` : title, meaning]);
    }
    const others = Math.max(0, ...labels.map((label) => theory[label].others?.length ?? 0));
    for (let i = 0; byId(`other${i}`); ++i) byId(`other${i}`).hidden = i >= others;
    const dash = ["-", ""];
    table("theory", columns.map((one) => one[2]), labels.map((label) =>
      [label, columns.map(([name, state]) => cell(theory[label].cells[name]?.[state] ?? dash))]), columns.map((one) => one[3]));
    const reasons = new Map();
    for (const label of labels) {
      const own = theory[label], all = Object.entries(own.reasons);
      if (own.reason) all.push(["bound along time", own.reason]);
      for (const [name, reason] of all) {
        const whose = reasons.get(reason) ?? { names: new Set(), labels: new Set() };
        whose.names.add(name); whose.labels.add(label);
        reasons.set(reason, whose);
      }
    }
    const drawn = labels.filter((label) => theory[label].words);
    list("drawn", drawn.map((label) => `${label}: ${theory[label].words}`));
    list("reasons", [...reasons].map(([reason, { names, labels }]) =>
      `no ${[...names].join(", ")} of ${[...labels].join(", ")}: ${reason}`));
  }

  // ---- what a person does

  knobs.forEach((knob, i) => {
    const moved = (final) => () => {
      const value = valueAt(knob, Number(slider(i).value));
      seen[i] = undefined;
      slider(i).setAttribute("aria-valuetext", text(value) + (knob.unit ? " " + knob.unit : ""));
      field(i).value = text(value);
      ask({ do: "set", name: knob.name, value, final });
    };
    slider(i).addEventListener("input", moved(false));
    slider(i).addEventListener("change", moved(true));
    const typed = () => { seen[i] = undefined; ask({ do: "set", name: knob.name, value: field(i).value.trim(), final: true, typed: true }); };
    field(i).addEventListener("change", typed);
  });
  for (const box of document.querySelectorAll("[data-observer]"))
    box.addEventListener("change", () => ask({ do: "observer", label: box.dataset.observer, on: box.checked }));
  const plots = document.querySelector(".plots");
  new ResizeObserver(() => document.documentElement.style.setProperty("--plots", `${plots.offsetHeight}px`)).observe(plots);
  for (const one of ["undo", "redo", "reset"]) byId(one).addEventListener("click", () => ask({ do: one }));
  byId("write").addEventListener("submit", (event) => {
    event.preventDefault();
    ask({ do: "write", file: byId("file").value });
  });
  byId("copy").addEventListener("click", async () => {
    try { await navigator.clipboard.writeText(location.href); say("the address is copied: it holds as long as the command runs"); }
    catch { say("the address cannot be copied here; it is in the browser's bar"); }
  });
  document.addEventListener("keydown", (event) => {
    if (!(event.ctrlKey || event.metaKey) || event.altKey || event.target.matches?.("input[type=text]")) return;
    const key = event.key.toLowerCase();
    const what = key === "z" && !event.shiftKey ? "undo" : key === "y" || key === "z" ? "redo" : null;
    if (what) { event.preventDefault(); ask({ do: what }); }
  });

  // ---- the connection

  try { painting.quicken(); } catch { /* as Bokeh does it */ }
  function name_figures() {
    for (const figure of document.querySelectorAll("figure")) label_parts(figure, figure.getAttribute("aria-label"));
  }
  function begin() {
    if (!window.Bokeh?.documents?.[0]?.roots().length) { setTimeout(begin, 20); return; }
    for (const wait of [0, 1000, 5000]) setTimeout(name_figures, wait);  // figures are built after the document
    scheme(() => Bokeh.documents[0].roots())();
    const address = new URL(`channel?key=${encodeURIComponent(known.channel)}`, location.href);
    address.protocol = address.protocol.replace("http", "ws");
    const socket = new WebSocket(address);
    socket.binaryType = "arraybuffer";
    socket.addEventListener("message", heard);
    socket.addEventListener("open", () => {
      channel = socket;
      waiting.unshift({ do: "begin" });
      send();
    });
    socket.addEventListener("close", () => {
      channel = null;
      clearTimeout(slow);
      say("the command that serves this page has ended: nothing here changes any more", "error");
    });
  }
  begin();
})();
