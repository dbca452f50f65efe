//! Tables of measured parameters in a room's folder: how they are written in the wild, and what is refused.

use sabine_acoustics::ParameterKind;
use sabine_scene::{Error, MeasuredRoom, ReadOptions};
use tempfile::TempDir;

const TOML: &str = r#"
[room]
mesh = "room.obj"
[bands]
centres_hz = [500, 1000]
[materials.wall]
[[sources]]
id = "LS-1"
position_m = [1.0, 1.0, 1.6]
[[receivers]]
id = "MP1"
position_m = [3.0, 2.0, 1.0]
[[receivers]]
id = "MP2"
position_m = [2.0, 3.0, 1.0]
"#;
const OBJ: &str = "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\nv 0 0 3\nv 4 0 3\nv 4 4 3\nv 0 4 3\nusemtl wall\nf 1 2 3 4\nf 8 7 6 5\nf 1 5 6 2\nf 2 6 7 3\nf 3 7 8 4\nf 4 8 5 1\n";

fn folder(tables: &str, csv: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("room.toml"), format!("{TOML}{tables}")).unwrap();
    std::fs::write(folder.path().join("room.obj"), OBJ).unwrap();
    std::fs::write(folder.path().join("p.csv"), csv).unwrap();
    folder
}

fn read(tables: &str, csv: &str) -> Result<MeasuredRoom, Error> {
    MeasuredRoom::read(folder(tables, csv).path())
}

const ONE: &str = "[[parameters]]\nfile = \"p.csv\"\n";

#[test]
fn points_commas_gaps_and_units_are_read() {
    for csv in [
        "pair,band_hz,t30_s,T30_s_sd,c80_db,ts_ms,d50_percent\nLS-1-MP1,500,0.93,0.04,-1.5,81.5,43\nLS-1-MP2,1000,-,,2.0,n/a,\n",
        "\u{feff}source;receiver;band_hz;t30_s;t30_s_sd;c80_db;ts_s;d50\r\nLS-1;MP1;500;0,93;0,04;-1,5;0,0815;0,43\r\nLS-1;MP2;1000;;;2;NaN;-\r\n",
        "source\treceiver\tband_hz\tt30_s\tt30_s_sd\tc80_db\tts_s\td50\nLS-1\tMP1\t500\t0.93\t0.04\t-1.5\t0.0815\t0.43\nLS-1\tMP2\t1000\t\t\t2\t\t\n",
    ] {
        let room = read(ONE, csv).unwrap();
        let found: Vec<_> =
            room.parameters().iter().map(|p| (p.receiver, p.band_hz, p.kind, p.line)).collect();
        let at_500 = |kind| (0, 500.0, kind, 2);
        assert_eq!(
            found,
            [
                at_500(ParameterKind::T30),
                at_500(ParameterKind::C80),
                at_500(ParameterKind::CentreTime),
                at_500(ParameterKind::D50),
                (1, 1000.0, ParameterKind::C80, 3)
            ],
            "{csv}"
        );
        let value = |i: usize| room.parameters()[i].value;
        assert_eq!(room.parameters()[0].standard_deviation, Some(0.04));
        assert!((value(1) + 1.5).abs() < 1e-12 && (value(2) - 0.0815).abs() < 1e-12, "{csv}");
        assert!((value(3) - 0.43).abs() < 1e-12);
    }
}

#[test]
fn a_table_may_be_of_one_pair_and_the_octave_of_63_hz_is_62_5() {
    let tables = "[[parameters]]\nfile = \"p.csv\"\nsource = \"LS-1\"\nreceiver = \"MP2\"\n";
    let room = read(tables, "band_hz,edt_s\n63,1.2\n125,1.1\n").unwrap();
    assert_eq!(room.parameters()[0].receiver, 1);
    assert_eq!(room.parameters()[0].band_hz, 62.5);
    assert_eq!(room.unmeasured_at(Vec::new()).parameters(), []);
}

#[test]
fn each_fault_names_file_line_and_column() {
    for (csv, named) in [
        ("pair,band_hz,t30_s\nLS-1-MP9,500,1\n", ["line 2, pair", "MP9"]),
        ("source,receiver,band_hz,t30_s\nLS-1,MP1,500,1\nLS1,MP1,1000,1\n", ["line 3, source", "LS1"]),
        ("pair,band_hz,t30_s\nLS-1-MP1,500,-0.4\n", ["line 2, t30_s", "-0.4"]),
        ("pair,band_hz,t30_s\nLS-1-MP1,500,930\n", ["line 2, t30_s", "30 s"]),
        ("pair,band_hz,ts_s\nLS-1-MP1,500,81\n", ["line 2, ts_s", "ts_ms"]),
        ("pair,band_hz,d50\nLS-1-MP1,500,43\n", ["line 2, d50", "d50_percent"]),
        ("pair,band_hz,c80_db\nLS-1-MP1,500,inf\n", ["line 2, c80_db", "a number"]),
        ("pair,band_hz,c80_db\nLS-1-MP1,500,soft\n", ["line 2, c80_db", "soft"]),
        ("pair;band_hz;t30_s\nLS-1-MP1;500;1.234,5\n", ["line 2, t30_s", "1.234,5"]),
        ("pair,band_hz,t30_s,t30_s_sd\nLS-1-MP1,500,1,0\n", ["line 2, t30_s_sd", "standard deviation"]),
        ("pair,band_hz,t30_s\nLS-1-MP1,630,1\n", ["line 2, band_hz", "octave"]),
        ("pair,band_hz,t30_s\nLS-1-MP1,,1\n", ["line 2, band_hz", "missing"]),
        ("pair,band_hz,t30_s\nLS-1-MP1,500,1\nLS-1-MP1,500,1.1\n", ["line 3, t30_s", "T30 of LS-1-MP1"]),
        ("pair,band_hz,t30_s\nLS-1-MP1,500,0,93\n", ["line 2", "3 cells"]),
        ("pair,band_hz,t30_ms\nLS-1-MP1,500,930\n", ["line 1", "t30_ms"]),
        ("pair,band_hz,ts_s,ts_ms\nLS-1-MP1,500,0.08,80\n", ["line 1", "Ts"]),
        ("pair,source,receiver,band_hz,t30_s\n", ["line 1", "pair"]),
        ("pair,band_hz,t20_s_sd\nLS-1-MP1,500,1\n", ["line 1", "t20_s"]),
        ("band_hz,t30_s\n500,1\n", ["line 1", "source"]),
        ("pair,t30_s\nLS-1-MP1,1\n", ["line 1", "band_hz"]),
        ("pair,band_hz\nLS-1-MP1,500\n", ["line 1", "t30_s"]),
        ("pair,band_hz,t30_s\nLS-1-MP1,500,-\n", ["any measured value", "missing"]),
    ] {
        let message = read(ONE, csv).unwrap_err().to_string();
        assert!(message.contains("p.csv"), "{csv}: {message}");
        assert!(named.iter().all(|part| message.contains(part)), "{csv}: {named:?}: {message}");
    }
}

#[test]
fn faults_of_the_room_file_name_its_field() {
    let csv = "pair,band_hz,t30_s\nLS-1-MP1,500,1\n";
    for (tables, named) in [
        ("[[parameters]]\nfile = \"p.csv\"\nsource = \"LS-1\"\n", ["room.toml", "parameters[0].receiver"]),
        (
            "[[parameters]]\nfile = \"p.csv\"\nsource = \"x\"\nreceiver = \"MP1\"\n",
            ["parameters[0].source", "x"],
        ),
        ("[[parameters]]\nfile = \"p.csv\"\ncolour = 1\n", ["room.toml", "colour"]),
        ("[[parameters]]\nfile = \"none.csv\"\n", ["none.csv", ""]),
        ("[[parameters]]\nfile = \"../p.csv\"\n", ["parameters[0].file", "outside"]),
        // The pair twice.
        ("[[parameters]]\nfile = \"p.csv\"\nsource = \"LS-1\"\nreceiver = \"MP1\"\n", ["p.csv", "line 1"]),
    ] {
        let message = read(tables, csv).unwrap_err().to_string();
        assert!(named.iter().all(|part| message.contains(part)), "{tables}: {message}");
    }
    // Two tables may not state a value twice.
    let folder = folder(&format!("{ONE}{ONE}"), csv);
    let options = ReadOptions { allow_outside: true };
    let message = MeasuredRoom::read_with(folder.path(), &options).unwrap_err().to_string();
    assert!(message.contains("T30 of LS-1-MP1 at 500 Hz"), "{message}");
}
