//! `room.toml`, field by field as it stands in the file.

use crate::mesh_file::mesh_options::LengthUnit;
use crate::mesh_file::up_axis::UpAxis;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RoomFile {
    pub room: RoomTable,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub air: Option<AirTable>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measurement: Option<MeasurementTable>,
    pub bands: BandsTable,
    #[serde(default)]
    pub materials: BTreeMap<String, MaterialTable>,
    #[serde(default)]
    pub sources: Vec<PlaceTable>,
    #[serde(default)]
    pub receivers: Vec<PlaceTable>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub responses: Vec<ResponseTable>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parameters: Vec<ParameterTable>,
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RoomTable {
    pub mesh: PathBuf,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub units: Option<LengthUnit>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub up_axis: Option<UpAxis>,
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct AirTable {
    pub temperature_c: f64,
    pub relative_humidity_percent: f64,
    pub pressure_kpa: f64,
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MeasurementTable {
    pub time_zero: super::TimeZero,
    pub levels: super::Levels,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position_sd_m: Option<f64>,
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BandsTable {
    pub centres_hz: Vec<f64>,
}

#[derive(Clone, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MaterialTable {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub library: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub absorption: Option<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub absorption_sd: Option<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scattering: Option<Vec<f64>>,
}

/// A source or a receiver.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PlaceTable {
    pub id: String,
    pub position_m: Vec<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub orientation: Option<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position_sd_m: Option<f64>,
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ResponseTable {
    pub source: String,
    pub receiver: String,
    pub file: PathBuf,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature_c: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relative_humidity_percent: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub session: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recorded_at: Option<f64>,
}

/// A table of measured parameters: of one pair where source and receiver are named, else of those that its lines name.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ParameterTable {
    pub file: PathBuf,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub receiver: Option<String>,
}
