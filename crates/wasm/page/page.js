// The page: it asks the worker and shows its answers.
"use strict";

const at = (id) => document.getElementById(id);
const DECAY_RANGE_DB = 65;
// Colours of ColorBrewer (RdYlBu without its pale middle): low octaves are red, high ones blue.
const COLOURS = ["#a50026", "#d73027", "#f46d43", "#c9a227", "#74add1", "#4575b4", "#313695"];
let about = null, current = null, kept = [], meshText = null, opened = null;

// ---- the worker

let worker = null, pending = new Map(), nextId = 1, ready = null, module = null;

async function loadModule() {
  const packed = Uint8Array.from(atob(at("module").textContent.trim()), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return WebAssembly.compile(await new Response(stream).arrayBuffer());
}

function startWorker() {
  if (worker) worker.terminate();
  for (const { reject } of pending.values()) reject(new Error("cancelled"));
  pending.clear();
  const source = URL.createObjectURL(new Blob([at("worker").textContent], { type: "text/javascript" }));
  worker = new Worker(source);
  ready = new Promise((resolve, reject) => {
    worker.onmessage = ({ data }) => {
      if (data.ready) resolve();
      if (data.broken && data.id === undefined) reject(new Error(data.broken));
      if (data.progress) say(`${data.progress.stage} ${data.progress.total ? `${data.progress.done} of ${data.progress.total}` : ""}`);
      const waiting = pending.get(data.id);
      if (!waiting) return;
      pending.delete(data.id);
      if (data.error !== undefined) {
        if (data.broken) { opened = null; startWorker(); }
        waiting.reject(new Error(data.error));
      } else {
        waiting.resolve(Object.assign(data.result, { milliseconds: data.milliseconds }));
      }
    };
    module ??= loadModule();
    const started = worker;
    module.then((compiled) => started.postMessage({ module: compiled }), reject);
  });
  return ready;
}

async function ask(kind, request = {}) {
  await ready;
  return new Promise((resolve, reject) => {
    const id = nextId++;
    pending.set(id, { resolve, reject });
    worker.postMessage({ id, kind, request });
  });
}

function say(text, isError = false) {
  at("state").textContent = text;
  at("state").className = isError ? "error" : "";
}

// Runs what a person asked for; whatever goes wrong is said, never swallowed.
async function attempt(doing, action) {
  say(doing);
  try {
    await action();
  } catch (error) {
    say(error.message, true);
  }
}

// ---- files

function readFile(file) {
  return attempt(`Reading ${file.name} ...`, async () => {
    // Before a byte of it is read.
    if (file.size > about.maxFileBytes) {
      throw new Error(`${file.name}: ${(file.size / 1e6).toFixed(0)} MB; at most ${(about.maxFileBytes / 1e6).toFixed(0)} MB are read here`);
    }
    opened = await ask("open", { name: file.name, bytes: await file.arrayBuffer() });
    at("responses").replaceChildren(...opened.responses.map((r, i) => new Option(r.name, i)));
    at("which").hidden = opened.responses.length < 2;
    at("notes").textContent = opened.notes.join(" ");
    if (opened.shoebox_m) {
      const [low, high] = opened.shoebox_m;
      ["x", "y", "z"].forEach((id, k) => { at(id).value = +(high[k] - low[k]).toFixed(3); });
    }
    await measure(0);
    if (opened.responses.length > 1 && opened.responses.every((r) => r.places_m)) await keepAll();
  });
}

async function measure(index) {
  const { name, sample_rate_hz: rate, places_m: places } = opened.responses[index];
  const { measured, samples, milliseconds } = await ask("measure", { index });
  if (places) [at("source").value, at("receiver").value] = places.map((p) => p.join(", "));
  show(`Measured: ${name}`, measured, samples, rate);
  say(`Measured in ${(milliseconds / 1e3).toFixed(2)} s.`);
}

async function keepAll() {
  for (let index = 0; index < opened.responses.length; index++) {
    const { sample_rate_hz: rate, places_m } = opened.responses[index];
    kept.push({ samples: (await ask("measure", { index })).samples, rate, places: places_m.flat() });
  }
  showKept();
}

// ---- the room

const place = (id) => {
  const words = at(id).value.split(/[,;\s]+/).filter((word) => word !== "");
  const numbers = words.map(Number);
  if (numbers.length !== 3 || numbers.some(Number.isNaN)) throw new Error(`${id}: three coordinates in metres are needed`);
  return numbers;
};

function room() {
  const surfaces = {};
  for (const select of at("surfaces").querySelectorAll("select")) if (select.value) surfaces[select.name] = select.value;
  if (meshText !== null) return { obj: meshText, surfaces };
  return { size_m: ["x", "y", "z"].map((id) => Number(at(id).value)), surfaces };
}

const USUAL = { floor: "parquet_on_concrete", ceiling: "plasterboard_ceiling", walls: "rendered_brick" };

async function showSurfaces() {
  const shape = room();
  const found = await ask("describe", { room: { ...shape, surfaces: {} } });
  const rows = found.surfaces.map(({ name, area_m2 }) => {
    const select = Object.assign(document.createElement("select"), { name });
    select.append(new Option("unknown", ""), ...about.library.map((entry) => new Option(entry.description, entry.name)));
    select.value = about.library.some((entry) => entry.name === name) ? name : USUAL[name] ?? "";
    const label = document.createElement("label");
    label.append(`${name} (${area_m2.toFixed(1)} m²) `, select);
    return label;
  });
  at("surfaces").replaceChildren(...rows);
}

function trace() {
  return attempt("Tracing ...", async () => {
    const request = { room: room(), source_m: place("source"), receiver_m: place("receiver"), rays: Math.round(Number(at("rays").value)), seed: 0 };
    const { traced, samples, rate, milliseconds } = await ask("trace", { request });
    show("Simulated", traced, samples, rate);
    say(`Traced ${traced.paths} paths in ${(milliseconds / 1e3).toFixed(2)} s.`);
  });
}

// ---- results

function show(title, measured, samples, rate) {
  current = { samples, rate };
  at("result").hidden = false;
  at("title").textContent = title;
  at("table").innerHTML = "";
  const head = at("table").createTHead().insertRow();
  const headings = ["", ...measured.bands_hz.map((hz) => hz >= 1000 ? `${hz / 1000} kHz` : `${hz} Hz`)];
  head.append(...headings.map((text) => Object.assign(document.createElement("th"), { textContent: text })));
  const body = at("table").createTBody();
  for (const { name, unit, cells } of measured.rows) {
    const row = body.insertRow();
    row.append(Object.assign(document.createElement("th"), { textContent: unit ? `${name} (${unit})` : name }));
    for (const cell of cells) {
      const td = row.insertCell();
      if (cell.reason !== undefined) {
        td.textContent = "–";
        td.title = cell.reason;
        continue;
      }
      const digits = (x) => x.toFixed(unit === "dB" ? 1 : 2);
      td.append(digits(cell.value), Object.assign(document.createElement("small"), { textContent: `[${digits(cell.low)}, ${digits(cell.high)}]` }));
    }
  }
  at("chart").innerHTML = chart(measured);
}

function chart({ bands_hz, decay_db, decay_step_s }) {
  const [left, right, top, bottom, width, height] = [48, 92, 10, 40, 740, 320];
  const longest = Math.max(0.1, ...decay_db.map((curve) => decay_step_s * curve.filter((db) => db > -DECAY_RANGE_DB).length));
  const step = [0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10].find((s) => longest / s <= 8) ?? 20;
  const x = (s) => left + (width - left - right) * s / longest;
  const y = (db) => top + (height - top - bottom) * -db / DECAY_RANGE_DB;
  let svg = `<svg viewBox="0 0 ${width} ${height}" role="img" aria-label="Decay curves">`;
  for (let db = 0; db >= -60; db -= 10) svg += `<line class="grid" x1="${left}" x2="${width - right}" y1="${y(db)}" y2="${y(db)}"/><text x="${left - 6}" y="${y(db) + 4}" text-anchor="end">${db}</text>`;
  for (let s = 0; s <= longest + 1e-9; s += step) svg += `<text x="${x(s)}" y="${height - bottom + 16}" text-anchor="middle">${+s.toFixed(2)}</text>`;
  svg += `<text x="${(left + width - right) / 2}" y="${height - 4}" text-anchor="middle">time (s)</text>`;
  svg += `<text transform="translate(12 ${(top + height - bottom) / 2}) rotate(-90)" text-anchor="middle">energy to come (dB)</text>`;
  decay_db.forEach((curve, band) => {
    const colour = COLOURS[band % COLOURS.length];
    const points = curve.map((db, i) => [i * decay_step_s, db]).filter(([, db]) => db > -DECAY_RANGE_DB);
    svg += `<polyline fill="none" stroke="${colour}" stroke-width="1.6" points="${points.map(([s, db]) => `${x(s).toFixed(1)},${y(db).toFixed(1)}`).join(" ")}"/>`;
    const legend = top + 14 + 18 * band;
    svg += `<line x1="${width - right + 12}" x2="${width - right + 30}" y1="${legend - 4}" y2="${legend - 4}" stroke="${colour}" stroke-width="3"/><text x="${width - right + 36}" y="${legend}">${bands_hz[band]} Hz</text>`;
  });
  return `${svg}</svg>`;
}

// ---- sound

let audio = null, playing = null;

// Claps, or plucked strings (Karplus and Strong 1983), made here: nothing is fetched.
function drySound(kind, rate) {
  const samples = new Float32Array(Math.round(2.4 * rate));
  let state = 1;
  const noise = () => ((state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 31) - 1;
  if (kind === "clap") {
    for (const start of [0, 0.6, 1.2, 1.35, 1.8]) {
      for (let i = 0; i < 0.03 * rate; i++) samples[Math.round(start * rate) + i] = 0.7 * noise() * Math.exp(-i / (0.004 * rate));
    }
    return samples;
  }
  [220, 277.2, 329.6, 440].forEach((hz, n) => {
    const string = Float32Array.from({ length: Math.round(rate / hz) }, () => 0.4 * noise());
    const start = Math.round(0.35 * n * rate);
    for (let i = 0; i < Math.min(0.9 * rate, samples.length - start); i++) {
      const k = i % string.length;
      samples[start + i] += string[k];
      string[k] = 0.499 * (string[k] + string[(k + 1) % string.length]);
    }
  });
  return samples;
}

function buffer(context, samples, rate) {
  const made = context.createBuffer(1, samples.length, rate);
  made.copyToChannel(samples, 0);
  return made;
}

async function dry(context) {
  const file = at("dry-file").files[0];
  if (!file) return buffer(context, drySound(at("dry").value, context.sampleRate), context.sampleRate);
  if (file.size > about.maxFileBytes) throw new Error(`${file.name}: too large to listen to here`);
  const bytes = await file.arrayBuffer();
  return context.decodeAudioData(bytes).catch(() => { throw new Error(`${file.name}: this browser cannot decode it as sound`); });
}

// Sound in the room, or dry, through any context: tests render without a loudspeaker.
async function connect(context, wet) {
  const source = context.createBufferSource();
  source.buffer = await dry(context);
  if (!wet) return [source, source];
  // A convolver needs its response at the context's own rate.
  const length = Math.ceil(current.samples.length / current.rate * context.sampleRate);
  const offline = new OfflineAudioContext(1, length, context.sampleRate);
  const response = offline.createBufferSource();
  response.buffer = buffer(offline, current.samples, current.rate);
  response.connect(offline.destination);
  response.start();
  const convolver = context.createConvolver();
  convolver.buffer = await offline.startRendering();
  source.connect(convolver);
  return [source, convolver];
}

function listen(wet) {
  return attempt("Playing ...", async () => {
    audio ??= new AudioContext();
    if (audio.state === "suspended") audio.resume();
    stop();
    const [source, end] = await connect(audio, wet);
    end.connect(audio.destination);
    source.start();
    playing = { source, end };
    say(wet ? "Playing in the room." : "Playing dry.");
  });
}

function stop() {
  if (playing) { playing.source.stop(); playing.end.disconnect(); playing = null; }
}

// ---- diagnosis

function showKept() {
  at("kept").textContent = kept.length ? `${kept.length} response${kept.length > 1 ? "s" : ""} kept.` : "Keep two responses or more; a SOFA file brings its own places.";
  at("diagnose").disabled = at("forget").disabled = kept.length === 0;
}

function diagnose() {
  return attempt("Diagnosing ...", async () => {
    at("cancel").hidden = false;
    try {
      const rays = Math.min(2000, Math.max(100, Math.round(Number(at("rays").value))));
      const request = { room: room(), rays, seed: 0, time_zero: at("time-zero").value, levels: at("levels").value };
      const found = await ask("diagnose", { responses: kept, request });
      showDiagnosis(found);
      say(`Diagnosed in ${(found.milliseconds / 1e3).toFixed(1)} s, on ${rays} rays for each pair: few, for a first look.`);
    } finally {
      at("cancel").hidden = true;
    }
  });
}

const VERDICTS = {
  adequate: "The simulation explains the measurement within its expected spread.",
  explained: "A cause is named.",
  incomplete: "A cause is named, and it does not explain everything.",
  unconfirmed: "A cause is named that fits the one place measured; a second place would confirm it or not.",
  law: "A law that no catalogue lists is named.",
  ambiguous: "Several causes explain the misfit equally well.",
  unexplained: "Something is wrong that no listed cause explains.",
};

function showDiagnosis(found) {
  const line = (tag, text) => Object.assign(document.createElement(tag), { textContent: text });
  const p = found.lack_of_fit.p_value;
  const chance = p < 0.001
    ? "Chance still leaves less than 1 in 1000 for the misfit: something else is wrong, and what is named may stand in for it."
    : `Probability of such a misfit by chance: ${p.toPrecision(2)}.`;
  const parts = [line("p", `${VERDICTS[found.verdict] ?? found.verdict} ${chance}`)];
  for (const cause of found.causes) parts.push(line("p", `• ${cause.explanation} (probability ${cause.probability.toFixed(2)})`));
  for (const note of [...found.would_decide, ...found.notes]) parts.push(Object.assign(line("p", note), { className: "note" }));
  const table = document.createElement("table");
  table.createTHead().insertRow().append(line("th", "Absorption, fitted"), ...found.bands_hz.map((hz) => line("th", hz >= 1000 ? `${hz / 1000} kHz` : `${hz} Hz`)));
  const body = table.createTBody();
  for (const [name, { absorption, absorption_sd }] of Object.entries(found.materials)) {
    const row = body.insertRow();
    row.append(line("th", name), ...absorption.map((a, i) => line("td", `${a.toFixed(2)} ± ${absorption_sd[i].toFixed(2)}`)));
  }
  const wide = Object.assign(document.createElement("div"), { className: "wide" });
  wide.append(table);
  at("diagnosis").replaceChildren(...parts, wide);
}

// ---- events

function listenToEvents() {
  const drop = at("drop");
  drop.onclick = () => at("file").click();
  drop.onkeydown = (event) => { if (event.key === "Enter" || event.key === " ") at("file").click(); };
  at("file").onchange = () => { const file = at("file").files[0]; at("file").value = ""; if (file) readFile(file); };
  // Anywhere on the page: a file dropped beside the box would else be opened by the browser.
  document.ondragover = (event) => { event.preventDefault(); drop.classList.add("over"); };
  document.ondragleave = () => drop.classList.remove("over");
  document.ondrop = (event) => {
    event.preventDefault();
    drop.classList.remove("over");
    const file = event.dataTransfer.files[0];
    if (file && file.name.toLowerCase().endsWith(".obj")) takeMesh(file); else if (file) readFile(file);
  };
  at("responses").onchange = () => attempt("Measuring ...", () => measure(Number(at("responses").value)));
  at("room").onsubmit = (event) => { event.preventDefault(); trace(); };
  at("box").onchange = (event) => { if (event.target.type === "number") attempt("", showSurfaces); };
  at("obj").onchange = () => { if (at("obj").files[0]) takeMesh(at("obj").files[0]); };
  at("no-obj").onclick = () => { meshText = null; at("obj").value = ""; at("no-obj").hidden = true; attempt("", showSurfaces); };
  at("listen").onclick = () => listen(true);
  at("listen-dry").onclick = () => listen(false);
  at("stop").onclick = stop;
  at("keep").onclick = () => attempt("", async () => {
    kept.push({ ...current, places: [...place("source"), ...place("receiver")] });
    showKept();
  });
  at("forget").onclick = () => { kept = []; showKept(); };
  at("diagnose").onclick = diagnose;
  at("cancel").onclick = () => { opened = null; at("which").hidden = true; startWorker(); };
}

function takeMesh(file) {
  return attempt(`Reading ${file.name} ...`, async () => {
    if (file.size > about.maxFileBytes) throw new Error(`${file.name}: too large`);
    const before = meshText;
    meshText = await file.text();
    try {
      await showSurfaces();
    } catch (error) {
      meshText = before;
      at("obj").value = "";
      throw error;
    }
    at("no-obj").hidden = false;
    say(`${file.name} is the room now: state places inside it.`);
  });
}

async function begin() {
  await startWorker();
  about = await ask("about");
  listenToEvents();
  await showSurfaces();
  say("Ready.");
  document.body.dataset.readyMilliseconds = performance.now().toFixed(0);
}

begin().catch((error) => say(`This page cannot start: ${error.message}`, true));
