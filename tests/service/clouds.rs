//! Clouds as cameras give them: of any size, with holes, from any number of sides.

use palpate_proto::v1;

use crate::harness::{Server, Transport, accepted, cloud, creation, from_json, prior, without_timing};

/// The half of a ball of 50 mm about (0, 0, 0.3) that is seen from `side` (1 or -1) along x.
fn half_ball(count: usize, side: f32) -> Vec<[f32; 3]> {
    let point = |i: usize| {
        let (around, up) = (2.4 * i as f32, 1.0 - i as f32 / count as f32);
        let across = (1.0 - up * up).sqrt();
        [0.05 * side * up, 0.05 * across * around.cos(), 0.3 + 0.05 * across * around.sin()]
    };
    (0..count).map(point).collect()
}

fn view(session_id: &str, request_id: &str, points: &[[f32; 3]], side: f64) -> v1::AddVisualPriorRequest {
    let viewpoint = Some(v1::Vector3 { x: side, y: 0.0, z: 0.3 });
    v1::AddVisualPriorRequest {
        prior: Some(v1::VisualPrior { viewpoint, ..cloud(points) }),
        request_id: request_id.into(),
        ..prior(session_id)
    }
}

#[tokio::test]
async fn clouds_of_any_size_and_number_are_thinned_to_the_limit_and_the_reply_says_how() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        caller.create(creation(name)).await.unwrap();
        let front = half_ball(12_465, 1.0);
        let first = caller.add_prior(view(name, "front", &front, 1.0)).await.unwrap();
        assert!((0.0005..0.01).contains(&first.voxel_m), "{}", first.voxel_m);
        assert!((1000..=2000).contains(&first.accepted_points), "{}", first.accepted_points);
        assert_eq!(first.accepted_points + first.dropped_points, 12_465);
        let back = half_ball(12_465, -1.0);
        let second = caller.add_prior(view(name, "back", &back, -1.0)).await.unwrap();
        assert!(second.voxel_m > first.voxel_m && second.accepted_points > 200, "{}", second.accepted_points);
        for number in 0..4 {
            let (points, side) = if number % 2 == 0 { (&front, 1.0) } else { (&back, -1.0) };
            let again = view(name, &format!("again-{number}"), points, side);
            assert_eq!(caller.add_prior(again).await.unwrap().warnings.len(), 1, "it shows nothing new");
        }
        let stats = caller.get(name).await.unwrap().stats.unwrap();
        assert!((500..=2000).contains(&stats.visual_points), "{stats:?}");
        let sent =
            v1::ListEventsRequest { session_id: name.into(), include_points: true, ..Default::default() };
        let Some(v1::event::Kind::VisualPrior(logged)) =
            caller.events(sent).await.unwrap().events.remove(1).kind
        else {
            panic!("a view")
        };
        assert_eq!(logged.points, cloud(&front).points, "the log keeps what was sent");
    }
    let before = server.grpc().get("grpc").await.unwrap();
    let hashes = |log: Vec<v1::Event>| log.into_iter().map(|event| event.state_hash).collect::<Vec<_>>();
    assert_eq!(hashes(server.grpc().log("grpc").await), hashes(server.grpc().log("http").await));
    let server = server.restart().await;
    let next = server.grpc().add_prior(view("grpc", "after", &half_ball(100, 1.0), 1.0)).await.unwrap();
    let stats = |session: v1::Session| without_timing(session).stats;
    assert_eq!(stats(next.session.unwrap()), stats(before), "the replay thins in the same way");
}

#[tokio::test]
async fn a_wish_for_voxels_gives_the_mean_of_each() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        caller.create(creation(name)).await.unwrap();
        let mut request = view(name, "view", &half_ball(5000, 1.0), 1.0);
        request.prior.as_mut().unwrap().voxel_m = Some(0.005);
        let reply = caller.add_prior(request).await.unwrap();
        assert_eq!(reply.voxel_m, 0.005);
        assert!((300..1500).contains(&reply.accepted_points), "{}", reply.accepted_points);
    }
}

#[tokio::test]
async fn points_that_a_camera_did_not_see_are_dropped_and_counted_packed_or_as_a_file() {
    let server = Server::start().await;
    let mut points = half_ball(200, 1.0);
    points[7][1] = f32::NAN;
    points[100] = [f32::NAN; 3];
    points[199][2] = f32::INFINITY;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        caller.create(creation(name)).await.unwrap();
        let reply = caller.add_prior(view(name, "view", &points, 1.0)).await.unwrap();
        assert_eq!((reply.accepted_points, reply.dropped_points, reply.non_finite_points), (197, 0, 3));
    }
    let mut ply = "ply\nformat binary_little_endian 1.0\nelement vertex 200\n".to_owned();
    ply.push_str("property float x\nproperty float y\nproperty float z\nend_header\n");
    let body = [ply.as_bytes(), &cloud(&points).points].concat();
    server.grpc().create(creation("file")).await.unwrap();
    let request = server
        .http()
        .request(reqwest::Method::POST, "/v1/sessions/file/priors?viewpoint=1,0,0.3")
        .header("content-type", "application/ply")
        .body(body);
    let reply: v1::AddVisualPriorResponse =
        from_json(&accepted(request).await.unwrap().text().await.unwrap());
    assert_eq!((reply.accepted_points, reply.non_finite_points), (197, 3));
    let hash = async |name: &str| server.grpc().log(name).await.remove(1).state_hash;
    assert_eq!(hash("file").await, hash("grpc").await);
}
