//! What JavaScript calls.

use crate::{DiagnoseSpec, Error, Measured, Opened, RoomSpec, Survey, TraceSpec, Traced, library_json};
use sabine_acoustics::ImpulseResponse;
use std::ops::ControlFlow;
use wasm_bindgen::prelude::*;

#[wasm_bindgen]
extern "C" {
    /// The worker's way to tell how far long work is.
    #[wasm_bindgen(js_name = sabineProgress)]
    fn progress(stage: &str, done: f64, total: f64);
    /// The worker's way to remember what a fault was: the exception of WebAssembly says "unreachable" only.
    #[wasm_bindgen(js_name = sabineFault)]
    fn fault(message: &str);
}

fn observer(stage: &str, done: u64, total: u64) -> ControlFlow<()> {
    progress(stage, done as f64, total as f64);
    ControlFlow::Continue(())
}

fn thrown(error: impl Into<Error>) -> JsError {
    JsError::new(&error.into().to_string())
}

/// Runs when the module is loaded.
#[wasm_bindgen(start)]
pub fn start() {
    std::panic::set_hook(Box::new(|info| fault(&info.to_string())));
}

/// Largest file in bytes, for the page to refuse one before it reads it.
#[wasm_bindgen(js_name = maxFileBytes)]
pub fn max_file_bytes() -> f64 {
    crate::MAX_FILE_BYTES as f64
}

/// Surfaces of the library as JSON.
#[wasm_bindgen]
pub fn library() -> String {
    library_json().to_string()
}

/// Surfaces, size and volume of a room as JSON.
#[wasm_bindgen(js_name = describeRoom)]
pub fn describe_room(room: &str) -> Result<String, JsError> {
    let spec: RoomSpec = serde_json::from_str(room).map_err(thrown)?;
    Ok(spec.describe().map_err(thrown)?.to_string())
}

/// A file that was dropped.
#[wasm_bindgen(js_name = Opened)]
pub struct JsOpened(Opened);

#[wasm_bindgen(js_class = Opened)]
impl JsOpened {
    /// Reads the bytes of a file.
    #[wasm_bindgen(constructor)]
    pub fn new(name: &str, bytes: Vec<u8>) -> Result<JsOpened, JsError> {
        Ok(Self(Opened::read(name, bytes).map_err(thrown)?))
    }

    /// What it holds, as JSON.
    pub fn summary(&self) -> String {
        self.0.summary().to_string()
    }

    /// Parameters of a response as JSON.
    pub fn measure(&self, index: usize) -> Result<String, JsError> {
        measure_response(&self.0.response(index).map_err(thrown)?.samples)
    }

    /// Samples of a response.
    pub fn samples(&self, index: usize) -> Result<Vec<f32>, JsError> {
        Ok(self.0.response(index).map_err(thrown)?.samples.samples().to_vec())
    }
}

/// Parameters of samples as JSON.
#[wasm_bindgen(js_name = measureSamples)]
pub fn measure_samples(samples: Vec<f32>, sample_rate_hz: u32) -> Result<String, JsError> {
    measure_response(&ImpulseResponse::new(samples, sample_rate_hz).map_err(thrown)?)
}

fn measure_response(response: &ImpulseResponse) -> Result<String, JsError> {
    serde_json::to_string(&Measured::read(response).map_err(thrown)?).map_err(thrown)
}

/// A traced response.
#[wasm_bindgen(js_name = Traced)]
pub struct JsTraced(Traced);

#[wasm_bindgen(js_class = Traced)]
impl JsTraced {
    /// Traces what a request asks for.
    #[wasm_bindgen(constructor)]
    pub fn new(request: &str) -> Result<JsTraced, JsError> {
        let spec: TraceSpec = serde_json::from_str(request).map_err(thrown)?;
        Ok(Self(Traced::new(&spec, &observer).map_err(thrown)?))
    }

    /// Parameters and decay curves as JSON.
    pub fn summary(&self) -> Result<String, JsError> {
        serde_json::to_string(&self.0).map_err(thrown)
    }

    /// Samples of the response.
    pub fn samples(&self) -> Vec<f32> {
        self.0.response.samples().to_vec()
    }

    /// Samples per second.
    #[wasm_bindgen(js_name = sampleRate)]
    pub fn sample_rate(&self) -> u32 {
        self.0.response.sample_rate_hz()
    }
}

/// Responses for a diagnosis.
#[wasm_bindgen(js_name = Survey)]
#[derive(Default)]
pub struct JsSurvey(Survey);

#[wasm_bindgen(js_class = Survey)]
impl JsSurvey {
    /// None yet.
    #[wasm_bindgen(constructor)]
    pub fn new() -> JsSurvey {
        Self::default()
    }

    /// Adds a response; its places are six coordinates in metres, those of the source first.
    pub fn add(&mut self, samples: Vec<f32>, sample_rate_hz: u32, places_m: &[f64]) -> Result<(), JsError> {
        let response = ImpulseResponse::new(samples, sample_rate_hz).map_err(thrown)?;
        let Ok([a, b, c, d, e, f]) = <[f64; 6]>::try_from(places_m) else {
            return Err(JsError::new("places: six coordinates in metres are needed for each response"));
        };
        self.0.add(response, [[a, b, c], [d, e, f]]).map_err(thrown)
    }

    /// The diagnosis as JSON.
    pub fn diagnose(&self, request: &str) -> Result<String, JsError> {
        let spec: DiagnoseSpec = serde_json::from_str(request).map_err(thrown)?;
        Ok(self.0.diagnose(&spec, &observer).map_err(thrown)?.to_string())
    }
}
