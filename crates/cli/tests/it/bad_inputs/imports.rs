//! Measurements of other programs that are damaged, of another kind, or do not fit their room.

use super::outcome::Case;
use super::outcome::Expected::Refused;
use std::path::Path;

const GOLDEN: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../scene/tests/sofa");
const HEAD: &str = "file,source_x_m,source_y_m,source_z_m,receiver_x_m,receiver_y_m,receiver_z_m\n";

/// SOFA files, tables, texts of REW and tables of materials; `recordings::make` has made the sounds.
pub fn make(folder: &Path) {
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.join(name), bytes).unwrap();
    for name in ["pairs.sofa", "head.sofa"] {
        std::fs::copy(Path::new(GOLDEN).join(name), folder.join(name)).unwrap();
    }
    let whole = std::fs::read(folder.join("pairs.sofa")).unwrap();
    write("half.sofa", &whole[..whole.len() / 2]);
    write("zeroed.sofa", &[&whole[..2000], &vec![0; whole.len() - 2000]].concat());
    write("empty.sofa", b"");
    write("text.sofa", b"no HDF5 at all");
    let table = |name: &str, rows: &str| write(name, format!("{HEAD}{rows}").as_bytes());
    table("good.csv", "wav/good.wav,1,2,1.5,3.5,2,1.2\n");
    table("gap.csv", "wav/good.wav,1,2,,3.5,2,1.2\n");
    table("comma.csv", "wav/good.wav,\"1,0\",2,1.5,3.5,2,1.2\n");
    table("outside.csv", "wav/good.wav,1,2,1.5,13.5,2,1.2\n");
    table("parent.csv", "../good.wav,1,2,1.5,3.5,2,1.2\n");
    table("speech.csv", "wav/speech.wav,1,2,1.5,3.5,2,1.2\n");
    table("nan.csv", "wav/good.wav,NaN,2,1.5,3.5,2,1.2\n");
    table("nothing.csv", "");
    write("unknown.csv", b"file,where\nwav/good.wav,there\n");
    write("binary.csv", &[0xff, 0xfe, b'x', b'\n']);
    let rew = |name: &str, rest: &str| {
        write(
            name,
            format!("* Impulse Response data saved by REW V5.31\n4 // Response length\n{rest}").as_bytes(),
        )
    };
    rew("short.txt", "2.0833333333333333E-5 // Sample interval (seconds)\n* Data start\n0\n1\n");
    rew("clockless.txt", "* Data start\n0\n1\n0.5\n0.25\n");
    rew("words.txt", "2,0833333333333333E-5 // Sample interval (seconds)\n* Data start\n0\n1\nhalf\n0,25\n");
    rew("silent.txt", "2.0833333333333333E-5 // Sample interval (seconds)\n* Data start\n0\n0\n0\n0\n");
    write("minimum.txt", b"* IR is the min phase version\n1\n");
    write("short.geo", b"ABS wall = <10 20 30>\n");
    write("loud.geo", b"ABS wall = <10 20 30 40 50 600>\n");
    write("none.geo", b"CORNERS\n1 0 0 0\n");
}

/// None of these is done: one that is would put a draft of its folder beside the others' for a moment.
pub fn cases() -> Vec<Case> {
    let places = "--source 1,2,1.5 --receiver 3.5,2,1.2";
    let mut cases = Vec::new();
    for (file, more, expected) in [
        ("pairs.sofa", "--size 3.5x5x3", Refused(&["s2", "outside"])),
        ("pairs.sofa", "--size 1e9x5x3", Refused(&["--size"])),
        ("half.sofa", "", Refused(&["half.sofa"])),
        ("zeroed.sofa", "", Refused(&["zeroed.sofa"])),
        ("empty.sofa", "", Refused(&["empty.sofa"])),
        ("text.sofa", "", Refused(&["text.sofa: HDF5"])),
        ("head.sofa", "--size 6x5x3", Refused(&["SimpleFreeFieldHRIR", "--head"])),
        ("good.csv", "", Refused(&["--mesh FILE, or --size"])),
        ("good.csv", "--mesh rooms/none.obj", Refused(&["none.obj"])),
        ("gap.csv", "--size 6x5x3", Refused(&["gap.csv: line 2, source_z_m: is missing"])),
        ("comma.csv", "--size 6x5x3", Refused(&["line 2, source_x_m", "1,0"])),
        ("nan.csv", "--size 6x5x3", Refused(&["line 2, source_x_m", "NaN"])),
        ("outside.csv", "--size 6x5x3", Refused(&["r1", "outside"])),
        ("parent.csv", "--size 6x5x3", Refused(&["line 2, file", "outside the folder"])),
        ("speech.csv", "--size 6x5x3", Refused(&["speech.wav"])),
        ("nothing.csv", "--size 6x5x3", Refused(&["line 2: is missing"])),
        ("unknown.csv", "--size 6x5x3", Refused(&["line 1", "where"])),
        ("binary.csv", "--size 6x5x3", Refused(&["binary.csv: line 1"])),
        ("short.txt", places, Refused(&["Response length: 2 values"])),
        ("clockless.txt", places, Refused(&["Sample interval (seconds): is missing"])),
        ("words.txt", places, Refused(&["line 7", "half"])),
        ("silent.txt", places, Refused(&["silent"])),
        ("minimum.txt", places, Refused(&["line 1", "minimum phase"])),
        ("wav/nan.wav", places, Refused(&["nan.wav"])),
        ("wav/good.wav", "--size 6x5x3", Refused(&["--source X,Y,Z"])),
        ("none.sofa", "", Refused(&["none.sofa"])),
        // Port 1 belongs to a service of 1988 that nobody runs.
        ("http://127.0.0.1:1/measurements/1", places, Refused(&["127.0.0.1:1/measurements/1", "no answer"])),
        ("http://127.0.0.1:1/measurements/1?x", places, Refused(&["address", "address of one measurement"])),
        ("https://127.0.0.1:1/measurements/1", places, Refused(&["address", "address of one measurement"])),
        ("http://127.0.0.1:1", "--size 6x5x3", Refused(&["--source X,Y,Z"])),
    ] {
        let size = if more == places { " --size 6x5x3" } else { "" };
        let named = format!("import {file} {more}");
        cases.push(Case::new(named.trim_end(), &format!("import {file} {more}{size} --out OUT"), expected));
    }
    for (arguments, expected) in [
        ("export --room rooms/good --out OUT", Refused(&["must end in .sofa"])),
        ("materials --from short.geo --out OUT.toml", Refused(&["short.geo: line 1", "6 to 8"])),
        ("materials --from loud.geo --out OUT.toml", Refused(&["loud.geo: line 1: absorption"])),
        ("materials --from none.geo --out OUT.toml", Refused(&["none.geo"])),
        ("materials --from good.csv --out OUT.toml", Refused(&["good.csv: tables of materials end in"])),
    ] {
        cases.push(Case::new(arguments, arguments, expected));
    }
    cases
}
