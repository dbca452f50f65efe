// Everything that computes runs here, so that the page answers while it does. The glue of wasm-bindgen stands above this file.
"use strict";

let opened = null;
let lastFault = "";
const { maxFileBytes, library, describeRoom, measureSamples, Opened, Traced, Survey } = wasm_bindgen;

self.sabineProgress = (stage, done, total) => self.postMessage({ progress: { stage, done, total } });
self.sabineFault = (message) => { lastFault = message; };

// Each takes a request and gives [answer, buffers that move with it].
const work = {
  about: () => [{ maxFileBytes: maxFileBytes(), library: JSON.parse(library()) }],
  describe: ({ room }) => [JSON.parse(describeRoom(JSON.stringify(room)))],
  open: ({ name, bytes }) => {
    if (opened) opened.free();
    opened = null;
    opened = new Opened(name, new Uint8Array(bytes));
    return [JSON.parse(opened.summary())];
  },
  measure: ({ index }) => {
    const samples = opened.samples(index);
    return [{ measured: JSON.parse(opened.measure(index)), samples }, [samples.buffer]];
  },
  measureSamples: ({ samples, rate }) => [JSON.parse(measureSamples(samples, rate))],
  trace: ({ request }) => {
    const traced = new Traced(JSON.stringify(request));
    const samples = traced.samples();
    const answer = { traced: JSON.parse(traced.summary()), samples, rate: traced.sampleRate() };
    traced.free();
    return [answer, [samples.buffer]];
  },
  diagnose: ({ responses, request }) => {
    const survey = new Survey();
    try {
      for (const { samples, rate, places } of responses) survey.add(samples, rate, new Float64Array(places));
      return [JSON.parse(survey.diagnose(JSON.stringify(request)))];
    } finally {
      survey.free();
    }
  },
};

const loaded = new Promise((resolve, reject) => {
  self.onmessage = ({ data }) => {
    if (data.module) {
      wasm_bindgen({ module_or_path: data.module }).then(resolve, reject);
      self.onmessage = answer;
      loaded.then(() => self.postMessage({ ready: true }), (error) => self.postMessage({ broken: String(error) }));
    }
  };
});

async function answer({ data: { id, kind, request } }) {
  try {
    await loaded;
    const started = performance.now();
    const [result, moved = []] = work[kind](request);
    self.postMessage({ id, result, milliseconds: performance.now() - started }, moved);
  } catch (error) {
    // After a fault of WebAssembly its memory may be anything: the page starts a new worker.
    const broken = error instanceof WebAssembly.RuntimeError || error instanceof RangeError;
    const message = broken ? `internal fault (please report it): ${lastFault || error.message}` : error.message;
    self.postMessage({ id, error: message, broken });
  }
}
