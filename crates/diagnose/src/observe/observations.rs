//! What was measured, as a diagnosis compares it.

use crate::error::Error;
use crate::observe::band_pulse::{BandPulse, CELL_S};
use crate::observe::observed_response::Measured;
use crate::observe::parameter_table;
use crate::observe::pre_arrival::PreArrival;
use crate::statistics::median;
use crate::survey::planes::planes;
use crate::survey::surfaces::Surfaces;
use crate::survey::{Place, Survey, SurveyedResponse};
use sabine_acoustics::{ImpulseResponse, Material, Observer, report};
use sabine_scene::{MeasuredRoom, Receiver, Source, TimeZero};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

/// Sample rate at which octaves of tables are filtered: it holds the octave of 16 kHz.
const TABLE_RATE_HZ: u32 = 48_000;

/// The measured responses of a room, or its tables, and what the room file says of them.
pub(crate) struct Observations {
    pub survey: Survey,
    /// Responses that may be fitted: those of receivers that are not held out.
    pub fitted: Vec<bool>,
    pub measured: Vec<Measured>,
    pub pre_arrival: PreArrival,
    /// Pulses of the band filters. Any sample rate serves that holds the highest band.
    pub pulses: Vec<BandPulse>,
    /// What was noticed while reading.
    pub notes: Vec<String>,
    /// Samples, until the time axes of shadowed responses are set.
    samples: Vec<ImpulseResponse>,
    pulses_by_rate: BTreeMap<u32, Vec<BandPulse>>,
}

impl Observations {
    /// Responses that nobody has recorded, without any file: planned ones, and those of tests.
    pub fn without_files(survey: Survey, measured: Vec<Measured>, pulses: Vec<BandPulse>) -> Self {
        Self {
            fitted: vec![true; survey.responses.len()],
            survey,
            measured,
            pre_arrival: PreArrival::default(),
            pulses,
            notes: Vec::new(),
            samples: Vec::new(),
            pulses_by_rate: BTreeMap::new(),
        }
    }
}

impl Observations {
    /// Reads all responses; those of the receivers `held` are never fitted. Places are known within `position_sd_m` where the room file
    /// does not say how well.
    pub fn read(
        room: &MeasuredRoom,
        held: &[usize],
        position_sd_m: f64,
        observer: &dyn Observer,
    ) -> Result<Self, Error> {
        let total = room.responses().len();
        if total == 0 && room.parameters().is_empty() {
            return Err(Error::NoResponses);
        }
        let mut found = Self {
            survey: survey_of(room, position_sd_m),
            fitted: Vec::new(),
            measured: Vec::new(),
            pre_arrival: PreArrival::default(),
            pulses: Vec::new(),
            notes: Vec::new(),
            samples: Vec::new(),
            pulses_by_rate: BTreeMap::new(),
        };
        for i in 0..total {
            report(observer, "reading responses", i as u64, total as u64)?;
            found.read_response(room, i)?;
        }
        if total == 0 {
            found.take_tables(room)?;
        }
        found.fitted = found.survey.responses.iter().map(|r| !held.contains(&r.receiver)).collect();
        if !found.fitted.contains(&true) {
            return Err(Error::NothingToCompare { responses: total.max(found.measured.len()) });
        }
        found.pulses = found.pulses_by_rate.values().next_back().cloned().unwrap_or_default();
        Ok(found)
    }

    /// Takes the pairs of the room's tables in the place of responses.
    fn take_tables(&mut self, room: &MeasuredRoom) -> Result<(), Error> {
        let (pairs, notes) = parameter_table::pairs(room);
        (self.survey.responses, self.measured) = pairs.into_iter().unzip();
        self.notes.extend(notes);
        self.pulses_by_rate.insert(TABLE_RATE_HZ, BandPulse::all(room.bands(), TABLE_RATE_HZ, CELL_S)?);
        Ok(())
    }

    /// Whether pairs have tables of parameters in place of responses: all of them, or none.
    pub fn are_tables(&self) -> bool {
        self.measured.iter().any(|m| m.table.is_some())
    }

    /// Keeps those values of tables that the prediction has (`[pair][band][value]`), and notes how many are left out.
    pub fn keep_values(&mut self, kept: &[Vec<Vec<bool>>]) -> Result<(), Error> {
        let left_out: usize =
            self.measured.iter_mut().zip(kept).map(|(measured, kept)| measured.keep(kept)).sum();
        if left_out > 0 {
            self.notes.push(format!(
                "{left_out} values of the tables are not used: the simulated decays do not have them (too short, or nothing before or after 50 or 80 ms)."
            ));
        }
        if self.measured.iter().all(|measured| measured.energies.iter().all(Option::is_none)) {
            return Err(Error::NothingToCompare { responses: self.measured.len() });
        }
        Ok(())
    }

    /// Reads one response; one in which no direct sound is found becomes a note.
    fn read_response(&mut self, room: &MeasuredRoom, index: usize) -> Result<(), Error> {
        let (entry, bands) = (&room.responses()[index], room.bands());
        let response = room.load_response(index)?;
        let rate = response.sample_rate_hz();
        if let Entry::Vacant(place) = self.pulses_by_rate.entry(rate) {
            place.insert(BandPulse::all(bands, rate, CELL_S)?);
        }
        let (source, receiver) = (&room.sources()[entry.source], &room.receivers()[entry.receiver]);
        let name = format!("{}-{}", source.id, receiver.id);
        if let Some(twin) = self.samples.iter().position(|other| *other == response) {
            self.notes.push(format!(
                "The response {name} is a copy of {}: they count as two measurements, but are one.",
                self.survey.responses[twin].name
            ));
        }
        match Measured::new(&response, bands, &self.pulses_by_rate[&rate]) {
            Ok(found) => {
                self.survey.responses.push(SurveyedResponse {
                    source: entry.source,
                    receiver: entry.receiver,
                    name,
                    air: entry.air,
                    duration_s: found.duration_s,
                    direct_s: found.direct_s,
                    sounds_until_s: found.sounds_until_s,
                    recorded_at: entry.recorded_at,
                });
                self.measured.push(found);
                self.samples.push(response);
            }
            Err(reason) => self.notes.push(format!("The response {name} is left out: {reason}.")),
        }
        Ok(())
    }

    /// Sets the time axes of responses whose direct line is blocked (`direct_s` is the time of flight of each pair's first path, `in_sight`
    /// whether that is the direct sound). Their first sound is weak and easily missed: their axis begins when the first path should come,
    /// by the times of the direct sounds of others.
    pub fn align(&mut self, in_sight: &[bool], direct_s: &[f64]) {
        if !self.are_tables() {
            self.align_shadowed(in_sight, direct_s);
        }
        self.samples.clear();
        let lead_ins = self.measured.iter_mut().map(|m| std::mem::take(&mut m.lead_in));
        self.pre_arrival = PreArrival { responses: lead_ins.collect() };
    }

    fn align_shadowed(&mut self, in_sight: &[bool], direct_s: &[f64]) {
        let time_zero = self.survey.measurement.time_zero;
        if time_zero == TimeZero::PerResponse {
            return;
        }
        let seen = (0..in_sight.len()).filter(|&p| in_sight[p]);
        let late_s: Vec<f64> = seen.map(|p| self.measured[p].direct_s - direct_s[p]).collect();
        if late_s.is_empty() && time_zero != TimeZero::Emission {
            return;
        }
        let late_s = median(late_s);
        for i in (0..in_sight.len()).filter(|&p| !in_sight[p]) {
            let begin_s = direct_s[i] + late_s;
            let pulses = &self.pulses_by_rate[&self.samples[i].sample_rate_hz()];
            if let Ok(found) = Measured::read(&self.samples[i], self.survey.bands, pulses, begin_s) {
                self.survey.responses[i].direct_s = begin_s;
                // What comes first has another shape than a direct sound: its sign says nothing.
                self.measured[i] = Measured { pulse: Vec::new(), ..found };
            }
        }
    }
}

/// What the room file says, without any response.
pub(crate) fn survey_of(room: &MeasuredRoom, position_sd_m: f64) -> Survey {
    let vertices = room.scene().vertices();
    let corner = |fold: fn(f64, f64) -> f64, from: f64| {
        std::array::from_fn(|k| vertices.iter().map(|v| v[k]).fold(from, fold))
    };
    let stated = room.scene().materials();
    let scattering = |m: &Material| m.scattering().values().to_vec();
    let scatterings: Vec<f64> = stated.iter().flat_map(|m| scattering(&m.material)).collect();
    let (planes, material_areas_m2) = planes(room.scene());
    let place = |id: &str, position_m, axis, stated_m: Option<f64>| Place {
        id: id.to_owned(),
        position_m,
        axis,
        position_sd_m: stated_m.unwrap_or(position_sd_m),
    };
    let known = room.position_sd();
    let source = |s: &Source| place(&s.id, s.position_m, s.axis, known.source_m(&s.id));
    let receiver = |r: &Receiver| place(&r.id, r.position_m, r.axis, known.receiver_m(&r.id));
    Survey {
        planes,
        surfaces: Surfaces::of(room.scene()).described(room.scene()),
        material_areas_m2,
        diffracted: Vec::new(),
        bands: room.bands(),
        air: room.air(),
        air_assumed: room.air_assumed(),
        measurement: room.measurement(),
        materials: stated.iter().map(|m| m.name.clone()).collect(),
        absorption_priors: room.priors().to_vec(),
        sources: room.sources().iter().map(source).collect(),
        receivers: room.receivers().iter().map(receiver).collect(),
        responses: Vec::new(),
        box_m: [corner(f64::min, f64::INFINITY), corner(f64::max, f64::NEG_INFINITY)],
        bands_of_modes: 0,
        declared_scattering: scatterings.iter().sum::<f64>() / scatterings.len() as f64,
    }
}
