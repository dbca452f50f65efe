//! Responses from REW's local interface: a server that answers as its help says, and ones that do not.

use base64::Engine as _;
use sabine_acoustics::Error as ValueError;
use sabine_scene::{Error, ImportOptions, Measurements, Receiver, Source, TimeZero};
use std::io::{BufRead, BufReader, Write};
use std::net::TcpListener;
use std::thread::JoinHandle;

/// Answers one request with these bytes, then hangs up; what was asked for comes back.
fn server(answer: Vec<u8>) -> (String, JoinHandle<String>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("http://{}", listener.local_addr().unwrap());
    let thread = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut lines = BufReader::new(stream.try_clone().unwrap()).lines();
        let request = lines.next().unwrap().unwrap();
        // The head ends with an empty line.
        while lines.next().is_some_and(|line| !line.unwrap().is_empty()) {}
        // A client that has seen enough may be gone.
        let _ = stream.write_all(&answer);
        request
    });
    (address, thread)
}

fn http(status: &str, body: &str) -> Vec<u8> {
    let length = body.len();
    format!("HTTP/1.1 {status}\r\nContent-Type: application/json\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n{body}")
        .into_bytes()
}

/// A response with its direct sound at sample 480, in percent of full scale.
fn percent() -> Vec<f32> {
    (0..9600).map(|i| if i < 480 { 0.0 } else { 50.0 * 0.999_f32.powi(i - 480) }).collect()
}

fn answer(samples: &[f32], start_s: f64) -> String {
    let bytes: Vec<u8> = samples.iter().flat_map(|sample| sample.to_be_bytes()).collect();
    let data = base64::engine::general_purpose::STANDARD.encode(bytes);
    format!(
        r#"{{"unit": "percent", "startTime": {start_s}, "sampleInterval": 2.0833E-5, "sampleRate": 48000, "timingReference": "Loopback", "data": "{data}"}}"#
    )
}

fn import(address: &str, time_zero: Option<TimeZero>) -> Result<Measurements, Error> {
    let source = Source::omni("s", [1.0, 1.0, 1.0]).unwrap();
    let receiver = Receiver::omni("r", [3.0, 1.0, 1.0]).unwrap();
    Measurements::read_rew(
        address,
        source,
        receiver,
        &ImportOptions { time_zero, ..ImportOptions::default() },
    )
}

#[test]
fn a_measurement_comes_in_full_scale_and_its_time_zero_is_kept() {
    let expected: Vec<f32> = percent().iter().map(|sample| sample / 100.0).collect();
    for (time_zero, cut) in [(None, 0), (Some(TimeZero::Emission), 240)] {
        let (address, request) = server(http("200 OK", &answer(&percent(), -0.005)));
        let set = import(&format!("{address}/measurements/3"), time_zero).unwrap();
        assert_eq!(set.responses[0].samples.samples(), &expected[cut..]);
        assert_eq!(set.responses[0].samples.sample_rate_hz(), 48_000);
        assert_eq!(
            request.join().unwrap(),
            "GET /measurements/3/impulse-response?normalised=false&unit=percent HTTP/1.1"
        );
    }
}

#[test]
fn an_answer_in_pieces_without_a_length_is_read() {
    let body = answer(&percent(), 0.0);
    let (head, tail) = body.split_at(body.len() / 3);
    let chunks = format!("{:x}\r\n{head}\r\n{:x}\r\n{tail}\r\n0\r\n\r\n", head.len(), tail.len());
    let (address, _) =
        server(format!("HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n{chunks}").into_bytes());
    assert_eq!(
        import(&format!("{address}/measurements/1"), None).unwrap().responses[0].samples.samples().len(),
        9600
    );
}

#[test]
fn without_a_measurement_the_error_lists_what_is_loaded() {
    let list = r#"{"1": {"title": "Seat 1", "uuid": "a-b", "rewVersion": "5.40", "splOffsetdB": NaN}, "2": {"title": "Seat 2"}}"#;
    let (address, request) = server(http("200 OK", list));
    let error = import(&address, None).unwrap_err().to_string();
    assert!(error.contains("1: Seat 1, 2: Seat 2"), "{error}");
    assert_eq!(request.join().unwrap(), "GET /measurements HTTP/1.1");
}

#[test]
fn whoever_does_not_answer_as_rew_is_refused_by_name() {
    let good = answer(&percent(), 0.0);
    let half = http("200 OK", &good)[..2000].to_vec();
    let promise = b"HTTP/1.1 200 OK\r\nContent-Length: 99999999999\r\n\r\n{".to_vec();
    let moved = b"HTTP/1.1 302 Found\r\nLocation: http://127.0.0.1:1/\r\nContent-Length: 0\r\n\r\n".to_vec();
    let silent = answer(&[0.0; 9600], 0.0);
    let damaged = good.replace("\"data\": \"", "\"data\": \"!");
    for (what, bytes, words) in [
        (
            "no such measurement",
            http("404 Not Found", r#"{"message": "no measurement 9"}"#),
            "status 404: {\"message\": \"no measurement 9\"}",
        ),
        ("a web page", http("200 OK", "<html>hello</html>"), "answer: is `<html>hello</html>"),
        ("an empty answer", http("200 OK", ""), "answer: is `nothing`"),
        ("a list", http("200 OK", "[1, 2]"), "an impulse response in JSON can be read"),
        ("half an answer", half, "no answer: "),
        (
            "an answer that ends within its data",
            http("200 OK", &good[..3000]),
            "an impulse response in JSON can be read",
        ),
        ("a length of 100 GB", promise, "bytes: 99999999999 where at most 134217728 are taken"),
        ("another place", moved, "answers with status 302"),
        ("no HTTP", b"SSH-2.0-OpenSSH_9.2\r\n".to_vec(), "no answer: "),
        ("nothing", Vec::new(), "no answer: "),
        ("silence", http("200 OK", &silent), "samples: silent: every sample is zero"),
        ("other base64", http("200 OK", &damaged), "base64 can be read"),
    ] {
        let (address, _) = server(bytes);
        let error = import(&format!("{address}/measurements/9"), None).unwrap_err().to_string();
        assert!(error.contains(words), "{what}: {error}");
        assert!(error.starts_with(&address), "{what}: {error}");
    }
    let mut samples = percent();
    samples[700] = f32::NAN;
    let (address, _) = server(http("200 OK", &answer(&samples, 0.0)));
    let error = import(&format!("{address}/measurements/1"), None).unwrap_err();
    let Error::InFile { field, source, .. } = error else { panic!("{error}") };
    assert_eq!(field, "data");
    assert!(matches!(*source, Error::Acoustics(ValueError::NotFinite { index: 700, .. })), "{source}");
}

#[test]
fn where_nobody_listens_the_address_is_named() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("http://{}/measurements/1", listener.local_addr().unwrap());
    drop(listener);
    let error = import(&address, None).unwrap_err();
    assert!(matches!(&error, Error::Http { address: named, .. } if named.starts_with(&address)), "{error}");
}
