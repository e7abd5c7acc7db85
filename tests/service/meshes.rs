//! The surface in every format and at every revision, and how a reader is spared what it has.

use palpate_proto::v1;
use palpate_proto::v1::mesh::Body;
use palpate_proto::v1::{MeshFormat, RawMesh};

use crate::harness::{Caller, Server, accepted, creation, header, send};

fn ask(revision: i64, format: MeshFormat) -> v1::GetMeshRequest {
    v1::GetMeshRequest { session_id: "ball".into(), revision, format: format.into(), ..Default::default() }
}

async fn raw(caller: &Caller, revision: i64) -> RawMesh {
    match caller.mesh(ask(revision, MeshFormat::Raw)).await.unwrap().body {
        Some(Body::Raw(raw)) => raw,
        other => panic!("{other:?}"),
    }
}

async fn file(caller: &Caller, format: MeshFormat) -> Vec<u8> {
    match caller.mesh(ask(0, format)).await.unwrap().body {
        Some(Body::File(file)) => file.into(),
        other => panic!("{other:?}"),
    }
}

#[tokio::test]
async fn a_past_revision_is_bit_for_bit_what_it_was_then() {
    let server = Server::start().await;
    let caller = server.grpc();
    let mut next = caller.begin("ball").await;
    let mut live = vec![caller.mesh(ask(0, MeshFormat::Raw)).await.unwrap()];
    for _ in 0..4 {
        next = caller.go_on("ball", next, 1).await;
        live.push(caller.mesh(ask(0, MeshFormat::Raw)).await.unwrap());
    }
    assert!(live.windows(2).all(|pair| pair[0].body != pair[1].body), "each touch moved the surface");
    let check = async |caller: Caller| {
        for revision in [3, 6, 2, 5, 4] {
            let past = caller.mesh(ask(revision, MeshFormat::Raw)).await.unwrap();
            assert_eq!(past, live[usize::try_from(revision).unwrap() - 2], "revision {revision}");
        }
    };
    check(server.grpc()).await;
    check(server.restart().await.grpc()).await;
}

#[tokio::test]
async fn a_closed_surface_of_a_ball_comes_in_every_format() {
    let server = Server::start().await;
    let caller = server.grpc();
    let first = caller.begin("ball").await;
    caller.go_on("ball", first, 2).await;
    let raw = raw(&caller, 0).await;
    assert_eq!((raw.n_vertices, raw.n_faces), (2562, 5120));
    let vertices = palpate_client::positions(&raw).unwrap();
    let faces = palpate_client::faces(&raw).unwrap();
    let uncertainty = palpate_client::uncertainty(&raw).unwrap();
    assert!(uncertainty.iter().all(|u| (0.0..=1.0).contains(u)));
    // The volume by the divergence theorem: positive only where the triangles are wound outwards. What the camera did
    // not see is a guess, so only its order of magnitude is known.
    let volume: f64 = faces.iter().map(|&[a, b, c]| signed_volume(&vertices, [a, b, c])).sum();
    let ball = 4.0 / 3.0 * std::f64::consts::PI * 0.05_f64.powi(3);
    assert!((0.2..5.0).contains(&(volume / ball)), "{volume} m^3, the ball has {ball} m^3");

    let ply = file(&caller, MeshFormat::Ply).await;
    let end = ply.windows(11).position(|window| window == b"end_header\n").unwrap();
    let head = String::from_utf8(ply[..end].to_vec()).unwrap();
    assert!(head.contains("element vertex 2562") && head.contains("element face 5120"), "{head}");
    assert!(head.contains("uncertainty"), "{head}");
    let obj = String::from_utf8(file(&caller, MeshFormat::Obj).await).unwrap();
    assert_eq!(obj.lines().filter(|line| line.starts_with("v ")).count(), 2562);
    assert_eq!(obj.lines().filter(|line| line.starts_with("f ")).count(), 5120);
    let stl = file(&caller, MeshFormat::Stl).await;
    assert_eq!((stl.len(), &stl[80..84]), (84 + 50 * 5120, &5120_u32.to_le_bytes()[..]));
    let glb = file(&caller, MeshFormat::Glb).await;
    let gltf::Gltf { document, blob } = gltf::Gltf::from_slice(&glb).unwrap();
    let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
    let reader = primitive.reader(|_| blob.as_deref());
    assert_eq!(reader.read_positions().unwrap().collect::<Vec<_>>(), vertices);
    let indices: Vec<u32> = reader.read_indices().unwrap().into_u32().collect();
    assert_eq!(indices, faces.as_flattened());
}

#[tokio::test]
async fn a_glb_has_the_colours_that_were_asked_for_over_both_transports() {
    let server = Server::start().await;
    let caller = server.grpc();
    caller.begin("ball").await;
    let coloured =
        |colormap: v1::Colormap, format| v1::GetMeshRequest { colormap: colormap.into(), ..ask(0, format) };
    let get = async |query: &str| {
        let response = accepted(server.http().get(&format!("/v1/sessions/ball/mesh?{query}"))).await.unwrap();
        assert_eq!(header(&response, "content-type"), "model/gltf-binary");
        assert_eq!(header(&response, "content-disposition"), "inline; filename=\"ball-r0002.glb\"");
        response.bytes().await.unwrap()
    };
    let mut files = Vec::new();
    for (colormap, query) in [
        (v1::Colormap::Unspecified, "format=glb"),
        (v1::Colormap::Paper, "format=glb&colormap=paper"),
        (v1::Colormap::Cividis, "format=glb&colormap=cividis"),
    ] {
        let Some(Body::File(file)) = caller.mesh(coloured(colormap, MeshFormat::Glb)).await.unwrap().body
        else {
            panic!("a file")
        };
        assert_eq!(get(query).await, file);
        files.push(file);
    }
    assert_eq!(files[0], files[1]);
    assert_ne!(files[1], files[2]);
    let ply = coloured(v1::Colormap::Paper, MeshFormat::Ply);
    assert_eq!(caller.mesh(ply).await.unwrap_err().fields, ["colormap"]);
    let unknown = server.http().get("/v1/sessions/ball/mesh?format=glb&colormap=pink");
    assert_eq!(accepted(unknown).await.unwrap_err().fields, ["colormap"]);
}

fn signed_volume(vertices: &[[f32; 3]], face: [u32; 3]) -> f64 {
    let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] =
        face.map(|index| vertices[index as usize].map(f64::from));
    (ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)) / 6.0
}

#[tokio::test]
async fn a_reader_is_spared_what_it_says_it_has() {
    let server = Server::start().await;
    let caller = server.grpc();
    let first = caller.begin("ball").await;
    let known = caller.mesh(ask(0, MeshFormat::Raw)).await.unwrap();
    let same = v1::GetMeshRequest { if_none_match: known.etag.clone(), ..ask(0, MeshFormat::Raw) };
    let spared = caller.mesh(same.clone()).await.unwrap();
    assert!(spared.not_modified && spared.body.is_none());
    assert_eq!((spared.etag.as_str(), spared.revision), (known.etag.as_str(), 2));
    let as_ply = v1::GetMeshRequest { format: MeshFormat::Ply.into(), ..same.clone() };
    assert!(!caller.mesh(as_ply).await.unwrap().not_modified, "another format is another content");

    caller.go_on("ball", first, 1).await;
    let moved = caller.mesh(same).await.unwrap();
    assert!(!moved.not_modified && moved.etag != known.etag);
    let Some(Body::Raw(whole)) = moved.body else { panic!("raw") };
    let half = v1::GetMeshRequest { have_topology: whole.topology_etag.clone(), ..ask(0, MeshFormat::Raw) };
    let Some(Body::Raw(half)) = caller.mesh(half).await.unwrap().body else { panic!("raw") };
    assert_eq!(half, RawMesh { faces_u32_le: palpate_proto::Bytes::new(), ..whole });
}

#[tokio::test]
async fn http_caches_a_fixed_revision_for_a_year_and_the_newest_not_at_all() {
    let server = Server::start().await;
    let first = server.grpc().begin("ball").await;
    let newest = server.http().get("/v1/sessions/ball/mesh");
    let newest = accepted(newest).await.unwrap();
    assert_eq!(header(&newest, "cache-control"), "no-cache");
    assert_eq!(header(&newest, "content-type"), "model/ply", "who has no wish gets PLY");
    let etag = header(&newest, "etag").to_owned();
    let fixed = || server.http().get("/v1/sessions/ball/mesh?revision=2");
    let past = accepted(fixed()).await.unwrap();
    assert_eq!(header(&past, "cache-control"), "max-age=31536000, immutable");
    let known = send(fixed().header("if-none-match", &etag)).await;
    assert_eq!((known.status().as_u16(), header(&known, "etag")), (304, etag.as_str()));
    assert_eq!(known.bytes().await.unwrap().len(), 0);
    server.grpc().go_on("ball", first, 1).await;
    let moved = server.http().get("/v1/sessions/ball/mesh").header("if-none-match", &etag);
    assert_eq!(send(moved).await.status(), 200);
}

#[tokio::test]
async fn a_mesh_that_there_is_not_is_refused() {
    let server = Server::start().await;
    let caller = server.grpc();
    caller.create(creation("ball")).await.unwrap();
    let unseen = caller.mesh(ask(0, MeshFormat::Raw)).await.unwrap_err();
    assert_eq!(unseen.reason, "NO_VISUAL_PRIOR");
    caller.add_prior(crate::harness::prior("ball")).await.unwrap();
    for revision in [-1, 3] {
        assert_eq!(caller.mesh(ask(revision, MeshFormat::Raw)).await.unwrap_err().fields, ["revision"]);
    }
    assert_eq!(caller.mesh(ask(1, MeshFormat::Raw)).await.unwrap_err().reason, "NO_VISUAL_PRIOR");
    let get = |path: &str| server.http().get(&format!("/v1/sessions/ball/{path}"));
    assert_eq!(accepted(get("mesh?revision=3")).await.unwrap_err().fields, ["revision"]);
    assert_eq!(accepted(get("mesh?format=step")).await.unwrap_err().fields, ["format"]);
    let picture = get("mesh").header("accept", "image/png");
    assert_eq!(accepted(picture).await.unwrap_err().reason, "NOT_ACCEPTABLE");
}
