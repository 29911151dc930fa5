//! Recordings that are damaged or lie: one sentence each, with the file, the place, what was found and what was
//! expected.

use std::fs;
use std::path::Path;

use shutterbug_cli::import::{Recording, Request};

use crate::import::data;
use crate::import_support::{
    START_NS, chunk, header, image, import, last_line, mcap, message, pictures, record, text, topic, topic_in,
};

/// Imports the bytes as a file of that name: exit code, the last line of what was said, and how many frames came out.
fn imported(name: &str, bytes: &[u8], more: &[&str]) -> (i32, String, usize) {
    let folder = tempfile::tempdir().expect("a folder");
    let (file, out) = (folder.path().join(name), folder.path().join("out"));
    fs::write(&file, bytes).expect("written");
    let (code, _, said) = import(&[&[text(&file).as_str(), "--out", &text(&out)][..], more].concat());
    assert!(!said.contains("panicked"), "{said}");
    let frames = fs::read_to_string(out.join("frames.csv")).map_or(0, |t| t.lines().count() - 1);
    (code, last_line(&said).to_owned(), frames)
}

/// What is said of these records.
fn refused(records: &[Vec<u8>], more: &[&str]) -> String {
    let (code, line, frames) = imported("a.mcap", &mcap(records), more);
    assert!(code == 1 && frames == 0, "{line}");
    assert!(line.starts_with("shutterbug: error: ") && line.contains("a.mcap: found "), "{line}");
    line
}

fn one(picture: &[u8]) -> Vec<Vec<u8>> {
    vec![topic(1, "/cam", "sensor_msgs/Image"), message(1, START_NS, picture)]
}

#[test]
fn what_is_missing_is_named() {
    let both =
        [pictures(2), vec![topic(2, "/other", "sensor_msgs/Image"), topic(3, "/odd", "std_msgs/String")]]
            .concat();
    assert!(refused(&both, &[]).contains("several topics of pictures: /cam, /other; expected --topic"));
    assert!(
        refused(&both, &["--topic", "/came"]).contains("no topic `/came`; expected one of: /cam, /other")
    );
    assert!(
        refused(&both, &["--topic", "/odd"]).contains("`/odd` of type std_msgs/String; expected a topic of")
    );
    assert!(refused(&both, &["--topic", "/other"]).contains("no message of `/other`; expected at least one"));
    assert!(refused(&[topic(3, "/odd", "std_msgs/String")], &[]).contains("no topic of pictures among /odd"));
    assert!(refused(&[topic(1, "/cam", "sensor_msgs/Image")], &[]).contains("no message of `/cam`"));
    let foreign = [topic_in(1, "/cam", "sensor_msgs/Image", "cbor")];
    assert!(refused(&foreign, &["--topic", "/cam"]).contains("`/cam` written in `cbor`"));
    assert!(
        refused(&pictures(2), &["--camera-info", "/info"])
            .contains("no topic `/info`; expected one of: no topics")
    );
    assert!(refused(&pictures(2), &["--poses", "tf"]).contains("expected a log with tf"));
    assert!(
        refused(&pictures(2), &["--imu", "/cam"])
            .contains("`/cam` of type sensor_msgs/Image; expected a topic of sensor_msgs/Imu")
    );
}

#[test]
fn pictures_that_cannot_be_read_are_named() {
    let said = refused(&one(&image(START_NS, [2, 2], "32FC1", 8, &[0; 16])), &[]);
    assert!(
        said.contains("the encoding `32FC1` in a message of `/cam` at byte 105; expected one of rgb8"),
        "{said}"
    );
    let said = refused(&one(&image(START_NS, [60_000, 60_000], "rgb8", 180_000, &[0; 16])), &[]);
    assert!(said.contains("a picture of 60000x60000 px"), "{said}");
    let said = refused(&one(&image(START_NS, [4, 4], "mono8", 4, &[0; 15])), &[]);
    assert!(said.contains("15 bytes, 4 a row, for 4x4 px"), "{said}");
    // The list of pixels claims 4 GB.
    let mut claims = image(START_NS, [4, 4], "mono8", 4, &[0; 16]);
    let at = claims.len() - 20;
    claims[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
    let said = refused(&one(&claims), &[]);
    assert!(
        said.contains("a list of 4294967295 items with 16 bytes left in a message of `/cam` at byte"),
        "{said}"
    );
}

/// A sensor_msgs/Imu with one rate of turn.
fn inertial(ns: u64, rate: f64) -> Vec<u8> {
    let numbers: Vec<u8> = (0..37).flat_map(|i| if i == 13 { rate } else { 0.0 }.to_le_bytes()).collect();
    [header(ns, "imu"), numbers].concat()
}

#[test]
fn what_was_asked_for_and_cannot_all_be_read_is_an_error_after_the_rest_is_written() {
    let ns = |k: u64| START_NS + 40_000_000 * k;
    let odd = message(1, ns(2), &image(ns(2), [4, 2], "odd", 4, &[0; 8]));
    let records = [pictures(2), vec![odd]].concat();
    let (code, line, frames) = imported("a.mcap", &mcap(&records), &[]);
    assert!(code == 1 && frames == 2, "{line}");
    assert!(
        line.contains(
            "found 1 of 3 messages of `/cam` that cannot be read, the first with the encoding `odd`"
        )
    );
    assert!(
        line.contains("at byte ") && line.contains("what is whole was imported; expected one of rgb8"),
        "{line}"
    );
    let (code, list, _) = listed("a.mcap", &mcap(&records));
    assert!(code == 0 && list.contains("4x2 mono8, 1 cannot be read"), "{list}");
    // Of a sensor that was taken without being asked for it is no more than a word.
    let sensor = [topic(2, "/imu", "sensor_msgs/Imu"), message(2, ns(0), &inertial(ns(0), f64::NAN))];
    let whole = message(2, ns(1), &inertial(ns(1), 0.1));
    let records = [pictures(2), sensor.to_vec(), vec![whole]].concat();
    let (code, line, frames) = imported("a.mcap", &mcap(&records), &[]);
    assert!(code == 0 && frames == 2, "{line}");
    let (code, line, frames) = imported("a.mcap", &mcap(&records), &["--imu", "/imu"]);
    assert!(
        code == 1 && frames == 2 && line.contains("1 of 2 messages of `/imu` that cannot be read"),
        "{line}"
    );
    assert_eq!(imported("a.mcap", &mcap(&pictures(2)), &[]).0, 0, "control");
}

#[test]
fn options_that_a_recording_has_no_use_for_are_refused() {
    let log = |more: &[&str]| imported("a.mcap", &mcap(&pictures(2)), more);
    for (more, says) in [
        (&["--name", "cam1"][..], "--name: found MCAP; expected EuRoC or KITTI"),
        (&["--times", "t.txt"], "--times: found MCAP; expected KITTI"),
        (&["--body", "base", "--poses", "tf:map"], "--body: found --poses tf:map, which needs no body"),
    ] {
        let (code, line, frames) = log(more);
        assert!(code == 2 && frames == 0 && line.contains(says), "{line}");
    }
    assert_eq!(log(&["--poses", "none"]).0, 0, "control");
}

#[test]
fn pictures_out_of_order_are_sorted_and_doubled_ones_left_out() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut records = pictures(4);
    records.swap(2, 3);
    records.push(records[1].clone());
    let (file, out) = (folder.path().join("a.mcap"), folder.path().join("out"));
    fs::write(&file, mcap(&records)).expect("written");
    let (code, _, said) = import(&[&text(&file), "--out", &text(&out)]);
    assert!(code == 0 && said.contains("2 pictures of `/cam` after a later one"), "{said}");
    assert!(said.contains("1 picture of `/cam` with the stamp of another"), "{said}");
    for k in 0..4u8 {
        let picture = image::open(out.join(format!("00000{k}.png"))).expect("there").into_luma8();
        assert_eq!(picture.as_raw()[0], 10 * k, "in order of time");
    }
}

#[test]
fn lengths_that_lie_take_no_memory() {
    let huge = [&[5u8][..], &u64::MAX.to_le_bytes()].concat();
    let (code, line, frames) =
        imported("a.mcap", &[&mcap(&pictures(2))[..8], &pictures(2).concat(), &huge].concat(), &[]);
    assert!(code == 1 && frames == 2, "{line}");
    assert!(line.contains("a record of 18446744073709551615 bytes with 0 bytes left at byte"), "{line}");
    let zeros = vec![0; 40 << 20];
    let bomb = ruzstd::encoding::compress_to_vec(&zeros[..], ruzstd::encoding::CompressionLevel::Fastest);
    assert!(bomb.len() < 1 << 16, "control: it is small");
    let with = |chunk: Vec<u8>| imported("a.mcap", &mcap(&[pictures(2), vec![chunk]].concat()), &[]);
    let (code, line, frames) = with(chunk("zstd", 100, 0, &bomb));
    assert!(code == 1 && frames == 2, "what is whole comes out: {line}");
    assert!(line.contains("a zstd chunk that unpacks to more than 100 bytes at byte"), "{line}");
    let (code, line, _) = with(chunk("zstd", 1 << 60, 0, &bomb));
    assert!(code == 1 && line.contains("a chunk of 1152921504606846976 bytes when unpacked"), "{line}");
    let (code, line, _) = with(chunk("", 3, 7, b"abc"));
    assert!(code == 1 && line.contains("a chunk with the checksum 352441c2"), "{line}");
    let (code, line, _) = with(chunk("snappy", 3, 0, b"abc"));
    assert!(code == 1 && line.contains("a chunk packed with `snappy` at byte"), "{line}");
    // A record inside a chunk that is longer than the chunk.
    let (code, line, _) = with(chunk("", 9, 0, &[&[5u8][..], &u64::MAX.to_le_bytes()].concat()));
    assert!(code == 1 && line.contains("a chunk that ends inside a record"), "{line}");
    let (code, line, _) = with(record(5, &[9; 40]));
    assert!(code == 1 && line.contains("a message of no channel that was described"), "{line}");
}

#[test]
fn files_that_break_off_give_what_they_had() {
    let whole = mcap(&pictures(6));
    let (code, line, frames) = imported("a.mcap", &whole[..whole.len() * 7 / 10], &[]);
    assert!(code == 1 && (1..6).contains(&frames), "{frames}: {line}");
    assert!(
        line.contains("what is whole was imported; expected whole records: the recording was not closed"),
        "{line}"
    );
    let bag = fs::read(data("ros1_lz4.bag")).expect("there");
    let (code, line, _) = imported("a.bag", &bag[..bag.len() / 3], &[]);
    assert!(code == 1 && line.contains("bytes left"), "{line}");
    let db3 = fs::read(data("ros2_plain.db3")).expect("there");
    let (code, line, frames) = imported("a.db3", &db3[..db3.len() * 8 / 10], &["--poses", "none"]);
    assert!(code == 1 && frames > 0 && line.contains("behind the end"), "{frames}: {line}");
    for (name, bytes, part) in [
        ("a.bag", &b"#ROSBAG V1.2\n"[..], "another version"),
        ("a.mcap", b"", "an empty file"),
        ("a.db3", b"SQLite format 3\0", "less than 100 bytes"),
        ("a.mcap", b"nothing of the kind", "does not begin as its ending says"),
        ("a.db3.zstd", b"\x28\xb5\x2f\xfd....", "packed with zstd as a whole"),
    ] {
        let (code, line, _) = imported(name, bytes, &[]);
        assert!(code == 1 && line.contains(part), "{line}");
    }
}

/// Whatever bytes a recording holds: an answer, and no panic.
#[test]
fn spoiled_recordings_are_answered() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut state = 12_345u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize
    };
    let names = [
        "ros1_plain.bag",
        "ros1_bz2.bag",
        "ros2_lz4.mcap",
        "ros2_zstd.mcap",
        "ros2_plain.db3",
        "foxglove_json.mcap",
    ];
    let (mut read, mut failed) = (0, 0);
    for name in names {
        let whole = fs::read(data(name)).expect("there");
        for _ in 0..150 {
            let mut bytes = whole.clone();
            for _ in 0..1 + next() % 8 {
                let at = next() % bytes.len();
                bytes[at] = match next() % 3 {
                    0 => 0xff,
                    1 => 0,
                    _ => next() as u8,
                };
            }
            bytes.truncate(if next() % 4 == 0 { next() % bytes.len() } else { bytes.len() });
            match prepared(&folder.path().join(name), &bytes) {
                Ok(()) => read += 1,
                Err(line) => {
                    assert!(!line.contains('\n'), "{line}");
                    failed += 1;
                }
            }
        }
    }
    assert!(read > 50 && failed > 50, "control: some can be read ({read}), some cannot ({failed})");
}

fn prepared(path: &Path, bytes: &[u8]) -> Result<(), String> {
    fs::write(path, bytes).expect("written");
    let recording = Recording::open(path).map_err(|e| e.to_string())?;
    let listed = recording.listing(&mut |_, _| Ok(())).map_err(|e| e.to_string())?;
    assert!(!listed.0.contains('\u{1b}'));
    let request = Request::default();
    recording.prepare(&request, &mut |_, _| Ok(())).map(drop).map_err(|e| e.to_string())
}

/// Records of a ROS 1 bag: fields, then data.
fn bag_record(fields: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
    let counted = |bytes: &[u8]| [&(bytes.len() as u32).to_le_bytes()[..], bytes].concat();
    let field = |(name, value): &(&str, &[u8])| counted(&[name.as_bytes(), b"=", value].concat());
    [counted(&fields.iter().map(field).collect::<Vec<_>>().concat()), counted(data)].concat()
}

fn bag_topic(number: u32, name: &str) -> Vec<u8> {
    let about = bag_record(&[("topic", name.as_bytes()), ("type", b"std_msgs/String")], b"");
    // The data are fields as well: those of a header, without its length.
    let about = &about[4..about.len() - 4];
    bag_record(&[("op", &[7]), ("conn", &number.to_le_bytes()), ("topic", name.as_bytes())], about)
}

fn bag_message(number: u32, kind: &[(&str, &[u8])]) -> Vec<u8> {
    let number = number.to_le_bytes();
    let fields = [kind, &[("conn", &number[..]), ("time", &[1, 0, 0, 0, 0, 0, 0, 0][..])]].concat();
    bag_record(&fields, b"\x01\0\0\0a")
}

fn bag_chunk(how: &str, bytes: u32, packed: &[u8]) -> Vec<u8> {
    bag_record(&[("op", &[5]), ("compression", how.as_bytes()), ("size", &bytes.to_le_bytes())], packed)
}

/// A bag with its index at that place.
fn bag(index_at: u64, records: &[Vec<u8>]) -> Vec<u8> {
    let head = bag_record(&[("op", &[3]), ("index_pos", &index_at.to_le_bytes())], &[b' '; 64]);
    [&b"#ROSBAG V2.0\n"[..], &head, &records.concat()].concat()
}

/// What the list of a file's contents says: exit code, list, last message.
fn listed(name: &str, bytes: &[u8]) -> (i32, String, String) {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join(name);
    fs::write(&file, bytes).expect("written");
    let (code, list, said) = import(&[&text(&file)]);
    assert!(!said.contains("panicked"), "{said}");
    (code, list, last_line(&said).to_owned())
}

/// A bag that was cut off between two records, or holds what nobody reads, is not told to be whole.
#[test]
fn bags_that_are_not_whole_say_so() {
    let whole = [bag_topic(0, "/a"), bag_message(0, &[("op", &[2])])];
    let (code, list, line) = listed("a.bag", &bag(100, &whole));
    assert!(code == 0 && list.contains("/a") && line.is_empty(), "control: {list}{line}");
    let (code, list, line) = listed("a.bag", &bag(1 << 40, &whole));
    assert!(code == 1 && list.contains("/a"), "{list}{line}");
    assert!(line.contains("an index at byte 1099511627776, beyond the end of the file"), "{line}");
    let (code, _, line) = listed("a.bag", &bag(0, &whole));
    assert!(code == 1 && line.contains("found no index"), "{line}");
    let (code, _, line) = listed("a.bag", b"#ROSBAG V2.0\n");
    assert!(code == 1 && line.contains("found no index"), "{line}");
    let (code, _, line) = listed("a.bag", &bag(100, &[&whole[..], &[bag_message(0, &[])]].concat()));
    assert!(code == 1 && line.contains("a record of no kind in this place"), "{line}");
    let within = bag_chunk("none", 1, &bag_chunk("none", 1, &whole.concat()));
    let (code, _, line) = listed("a.bag", &bag(100, &[&whole[..], &[within]].concat()));
    assert!(code == 1 && line.contains("a record of the kind 0x05 in this place"), "{line}");
}

/// Some KB that unpack to a hundred GB end where the file's size says so, and not after hours.
#[test]
fn bombs_in_numbers_end_soon() {
    // An index, which nobody needs, of 100 MB.
    let index = bag_record(&[("op", &[4])], &vec![0; 100 << 20]);
    let mut bomb = Vec::new();
    let mut packer = bzip2::read::BzEncoder::new(&index[..], bzip2::Compression::best());
    std::io::Read::read_to_end(&mut packer, &mut bomb).expect("packed");
    assert!(bomb.len() < 1000, "control: it is small");
    let begun = std::time::Instant::now();
    let (code, _, line) =
        listed("a.bag", &bag(100, &vec![bag_chunk("bz2", index.len() as u32, &bomb); 1000]));
    let took_s = begun.elapsed().as_secs_f64();
    assert!(code == 1 && line.contains("packed bytes that unpack to more than"), "{line}");
    let (code, _, line) = listed("a.bag", &bag(100, &[bag_chunk("bz2", index.len() as u32, &bomb)]));
    assert!(code == 0, "control: one is no fault: {line}");
    // Unpacking all of it takes ten minutes.
    assert!(took_s < 100.0, "{took_s} s");
}

/// Twice the topics take twice the time.
#[test]
fn many_topics_take_time_by_their_number() {
    let of = |count: u32| {
        let again = (0..3 * count).map(|i| bag_topic(i, &format!("/a/long/name/of/a/topic/{}", i % count)));
        let bytes = bag(100, &again.collect::<Vec<_>>());
        let begun = std::time::Instant::now();
        let (_, list, line) = listed("a.bag", &bytes);
        assert!(list.contains("/a/long/name/of/a/topic/7 "), "{line}");
        begun.elapsed().as_secs_f64()
    };
    let (few, many) = (of(3_000).max(0.1), of(60_000));
    // By its square: 400 times as long.
    assert!(many < 100.0 * few, "{few} s, {many} s");
}
