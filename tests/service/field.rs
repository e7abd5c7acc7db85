//! Clouds with the faults that real ones have: made here, and as they were collected from public reports.

use std::path::{Path, PathBuf};

use palpate_proto::v1;

use crate::harness::{Outcome, Server, Transport, creation, prior};

/// The collected files, where the folder is there.
fn collected(name: &str) -> Option<Vec<u8>> {
    let folders = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors();
    let folder: Option<PathBuf> =
        folders.map(|folder| folder.join("shared/field")).find(|folder| folder.is_dir());
    let Some(folder) = folder else {
        eprintln!("skipped {name}: there is no folder shared/field beside the repository");
        return None;
    };
    Some(std::fs::read(folder.join(name)).unwrap())
}

/// 80 points of the cap of a ball of 40 mm about (0.5, 0, 0.1), times `scale`.
fn cap(scale: f64) -> Vec<[f64; 3]> {
    let point = |i: u32| {
        let (around, polar) = (2.4 * f64::from(i), 1.1 * (f64::from(i + 1) / 80.0).sqrt());
        let across = 0.04 * polar.sin();
        [0.5 + across * around.cos(), across * around.sin(), 0.1 + 0.04 * polar.cos()].map(|x| scale * x)
    };
    (0..80).map(point).collect()
}

fn ply(rows: &[String]) -> Vec<u8> {
    let xyz = "property float x\nproperty float y\nproperty float z\n";
    let count = rows.len();
    format!("ply\nformat ascii 1.0\nelement vertex {count}\n{xyz}end_header\n{}\n", rows.join("\n"))
        .into_bytes()
}

fn rows(points: &[[f64; 3]]) -> Vec<String> {
    points.iter().map(|[x, y, z]| format!("{x:.6} {y:.6} {z:.6}")).collect()
}

/// The same file in a session of each transport, and what is said of it.
async fn send(server: &Server, name: &str, file: &[u8]) -> Vec<Outcome<v1::AddVisualPriorResponse>> {
    let mut outcomes = Vec::new();
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), format!("{name}-{}", transport.name()));
        caller.create(creation(&name)).await.unwrap();
        let view = v1::VisualPrior {
            encoding: v1::PointEncoding::Ply.into(),
            points: file.to_vec().into(),
            viewpoint: Some(v1::Vector3 { x: 0.5, y: 0.0, z: 0.6 }),
            ..Default::default()
        };
        let request = v1::AddVisualPriorRequest { prior: Some(view), ..prior(&name) };
        outcomes.push(caller.add_prior(request).await);
    }
    outcomes
}

fn codes(reply: &v1::AddVisualPriorResponse) -> Vec<v1::WarningCode> {
    reply.warning_details.iter().map(v1::Warning::code).collect()
}

/// The made file, and the collected one where it is there.
fn both(made: Vec<u8>, collected_name: &str) -> Vec<(&'static str, Vec<u8>)> {
    let collected = collected(collected_name).map(|file| ("collected", file));
    [Some(("made", made)), collected].into_iter().flatten().collect()
}

#[tokio::test]
async fn colours_on_a_line_of_their_own_are_read_over() {
    let server = Server::start().await;
    let text = String::from_utf8(ply(&rows(&cap(1.0))
        .iter()
        .map(|row| format!("{row} \n1 2 3 "))
        .collect::<Vec<_>>()));
    let colours = "z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n";
    let made = text.unwrap().replace("z\n", colours).into_bytes();
    for (name, file) in both(made, "colour_on_its_own_line.ply") {
        for reply in send(&server, name, &file).await {
            let reply = reply.unwrap();
            assert_eq!((reply.accepted_points, reply.warnings), (80, Vec::new()), "{name}");
        }
    }
}

#[tokio::test]
async fn rows_of_nan_are_dropped_counted_and_told() {
    let server = Server::start().await;
    let mut made = rows(&cap(1.0));
    for (index, row) in [(10, "nan nan nan"), (50, "NaN NaN NaN"), (82, "-nan inf 0")] {
        made.insert(index, row.into());
    }
    for (name, file) in both(ply(&made), "nan_rows.ply") {
        for reply in send(&server, name, &file).await {
            let reply = reply.unwrap();
            assert_eq!((reply.accepted_points, reply.non_finite_points), (80, 3), "{name}");
            assert_eq!(codes(&reply), [v1::WarningCode::NonFinitePoints]);
            assert_eq!(reply.warnings, ["3 of 83 points are NaN or infinite and were dropped"]);
        }
    }
}

#[tokio::test]
async fn decimal_commas_are_named_with_their_line() {
    let server = Server::start().await;
    let made: Vec<String> = rows(&cap(1.0)).iter().map(|row| row.replace('.', ",")).collect();
    for (name, file) in both(ply(&made), "decimal_commas.ply") {
        for refused in send(&server, name, &file).await {
            let refused = refused.unwrap_err();
            assert_eq!(refused.fields, ["prior.points"], "{name}");
            let message = &refused.message;
            assert!(message.contains("line 8") && message.contains("a number with a comma"), "{message}");
        }
    }
}

#[tokio::test]
async fn pixels_without_depth_at_the_cameras_origin_count_once_and_are_told() {
    let server = Server::start().await;
    let made = [rows(&cap(1.0)), rows(&[[0.0; 3]; 30])].concat();
    for (name, file) in both(ply(&made), "no_depth_is_zero.ply") {
        for reply in send(&server, name, &file).await {
            let reply = reply.unwrap();
            assert!((80..=81).contains(&reply.accepted_points), "{name}: {}", reply.accepted_points);
            assert_eq!(reply.set_aside.as_ref().unwrap().repeated_points, 29);
            let codes = codes(&reply);
            assert!(codes.contains(&v1::WarningCode::RepeatedPoints), "{:?}", reply.warnings);
            assert!(!codes.contains(&v1::WarningCode::ImplausibleSize), "{:?}", reply.warnings);
        }
    }
}

#[tokio::test]
async fn millimetres_are_suspected_and_a_hundred_metres_refused() {
    let server = Server::start().await;
    for (name, file) in both(ply(&rows(&cap(1000.0))), "millimetres.ply") {
        for reply in send(&server, name, &file).await {
            let reply = reply.unwrap();
            assert_eq!(codes(&reply), [v1::WarningCode::ImplausibleSize], "{name}");
            let message = &reply.warnings[0];
            assert!(message.contains("m across: are these millimetres? Send metres"), "{message}");
            assert!((60.0..=80.0).contains(&reply.warning_details[0].parameters["size_m"]));
        }
    }
    for refused in send(&server, "vast", &ply(&rows(&cap(2000.0)))).await {
        let refused = refused.unwrap_err();
        assert_eq!(refused.fields, ["prior.points"]);
        assert!(refused.message.contains("refuse_above_m, 100 m"), "{}", refused.message);
    }
    for reply in send(&server, "tiny", &ply(&rows(&cap(0.01)))).await {
        assert_eq!(codes(&reply.unwrap()), [v1::WarningCode::ImplausibleSize]);
    }
}

#[tokio::test]
async fn what_is_plausible_can_be_set_and_is_shown_in_the_session() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let sizes = v1::PlausibleSize { max_m: Some(90.0), ..Default::default() };
        let config = v1::SessionConfig { plausible_size: Some(sizes), ..Default::default() };
        let request = v1::CreateSessionRequest { config: Some(config), ..creation(name) };
        let session = caller.create(request).await.unwrap();
        let expected =
            v1::PlausibleSize { min_m: Some(0.005), max_m: Some(90.0), refuse_above_m: Some(100.0) };
        assert_eq!(session.config.unwrap().plausible_size, Some(expected));
        let view = v1::VisualPrior {
            encoding: v1::PointEncoding::Ply.into(),
            points: ply(&rows(&cap(1000.0))).into(),
            viewpoint: Some(v1::Vector3 { x: 500.0, y: 0.0, z: 600.0 }),
            ..Default::default()
        };
        let request = v1::AddVisualPriorRequest { prior: Some(view), ..prior(name) };
        assert_eq!(caller.add_prior(request).await.unwrap().warnings, Vec::<String>::new());
        let sizes = v1::PlausibleSize { min_m: Some(2.0), ..Default::default() };
        let config = v1::SessionConfig { plausible_size: Some(sizes), ..Default::default() };
        let refused =
            caller.create(v1::CreateSessionRequest { config: Some(config), ..creation("bad") }).await;
        assert_eq!(refused.unwrap_err().fields, ["config.plausible_size.max_m"]);
    }
}
