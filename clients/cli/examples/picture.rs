//! Draws the README's picture: a simulated robot explores the demo's bottle through a real server,
//! and the estimate is drawn after one look, after a few touches and after all of them.
//!
//! `cargo run --release --locked --example picture -- docs/images/bottle.svg`

use std::collections::BTreeMap;
use std::error::Error;
use std::fmt::Write;
use std::path::PathBuf;

use palpate_client::Client;
use palpate_client::proto::v1::{CreateSessionRequest, GetMeshRequest, MeshFormat, SessionConfig, mesh};
use palpate_core::geometry::{Point, TriangleMesh, Vector};
use palpate_server::{ServeOptions, serve};
use palpate_simulator::robot::{Plan, Robot};
use palpate_simulator::shapes;
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;

/// The estimate is drawn after so many attempts.
const DRAWN_AFTER: [u32; 3] = [0, 10, 50];
const SEED: u64 = 2;

/// From the camera to the object: from above the horizon, and to the side of the seen patch.
const AZIMUTH_DEG: f64 = 60.0;
const ELEVATION_DEG: f64 = 15.0;

/// Drawing units: two of them are a pixel.
const PANEL: (i32, i32) = (400, 760);
const UNITS_A_METRE: f64 = 2100.0;
/// Faces are drawn from far to near in groups of so many, and by colour within a group.
const GROUP: usize = 400;

/// Dark violet, blue, green, yellow: legible without colour vision too.
const RAMP: [[f64; 3]; 5] =
    [[68.0, 1.0, 84.0], [59.0, 82.0, 139.0], [33.0, 145.0, 140.0], [94.0, 201.0, 98.0], [253.0, 231.0, 37.0]];
const GREY: [f64; 3] = [200.0, 200.0, 204.0];

/// A mesh with the uncertainty of its vertices; none for the true object.
struct Panel {
    title: String,
    mesh: TriangleMesh,
    uncertainty: Option<Vec<f64>>,
}

#[tokio::main]
async fn main() -> Result<(), Box<dyn Error>> {
    let path = PathBuf::from(std::env::args().nth(1).ok_or("say where to write the picture, an .svg file")?);
    let folder = tempfile::tempdir()?;
    let listener = TcpListener::bind("127.0.0.1:0").await?;
    let url = format!("http://{}", listener.local_addr()?);
    let shutdown = CancellationToken::new();
    let options = ServeOptions { database: folder.path().join("palpate.db"), ..ServeOptions::default() };
    let server = tokio::spawn(serve(listener, options, shutdown.clone()));

    let panels = explore(Client::connect(&url).await?).await?;
    shutdown.cancel();
    server.await??;
    std::fs::write(path, draw(&panels)?)?;
    Ok(())
}

async fn explore(client: Client) -> Result<Vec<Panel>, Box<dyn Error>> {
    let body = shapes::generate("bottle")?;
    let mut panels =
        vec![Panel { title: "the object".to_owned(), mesh: body.mesh().clone(), uncertainty: None }];
    let config = SessionConfig { seed: Some(SEED), ..SessionConfig::default() };
    let session = CreateSessionRequest { config: Some(config), ..CreateSessionRequest::default() };
    let plan = Plan { session, seed: SEED, attempts: DRAWN_AFTER[2], ..Plan::default() };
    let mut robot = Robot::begin(client.clone(), &body, plan).await?;
    for attempts in DRAWN_AFTER {
        while robot.session().stats.as_ref().is_some_and(|stats| stats.attempts < attempts) {
            robot.step().await?.ok_or("the exploration ended early")?;
        }
        let title = if attempts == 0 { "one look".to_owned() } else { format!("{attempts} touches") };
        panels.push(estimate(&client, &robot.session().session_id, title).await?);
    }
    Ok(panels)
}

async fn estimate(client: &Client, session_id: &str, title: String) -> Result<Panel, Box<dyn Error>> {
    let request = GetMeshRequest {
        session_id: session_id.to_owned(),
        format: MeshFormat::Raw.into(),
        ..GetMeshRequest::default()
    };
    let Some(mesh::Body::Raw(raw)) = client.get_mesh(request).await?.body else {
        return Err("the mesh is not packed".into());
    };
    let vertices = palpate_client::positions(&raw)?;
    let mesh = TriangleMesh {
        vertices: vertices.iter().map(|vertex| Point::from(vertex.map(f64::from))).collect(),
        faces: palpate_client::faces(&raw)?,
    };
    let uncertainty = palpate_client::uncertainty(&raw)?.into_iter().map(f64::from).collect();
    Ok(Panel { title, mesh, uncertainty: Some(uncertainty) })
}

fn draw(panels: &[Panel]) -> Result<String, std::fmt::Error> {
    let (width, height) = (PANEL.0 * panels.len() as i32, PANEL.1);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{}\" height=\"{}\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n\
         <g font-family=\"sans-serif\" font-size=\"28\" text-anchor=\"middle\" fill=\"#222\">\n",
        width / 2,
        height / 2
    );
    for (column, panel) in panels.iter().enumerate() {
        let middle = PANEL.0 * column as i32 + PANEL.0 / 2;
        writeln!(svg, "<text x=\"{middle}\" y=\"{}\">{}</text>", height - 20, panel.title)?;
    }
    svg.push_str("</g>\n<g stroke-width=\"1\" stroke-linejoin=\"round\">\n");
    for (column, panel) in panels.iter().enumerate() {
        draw_mesh(&mut svg, panel, column)?;
    }
    svg.push_str("</g>\n</svg>\n");
    Ok(svg)
}

/// Draws the faces that look at the camera, the farthest first.
fn draw_mesh(svg: &mut String, panel: &Panel, column: usize) -> std::fmt::Result {
    let (azimuth, elevation) = (AZIMUTH_DEG.to_radians(), ELEVATION_DEG.to_radians());
    let right = Vector::new(-azimuth.sin(), azimuth.cos(), 0.0);
    let towards =
        Vector::new(azimuth.cos() * elevation.cos(), azimuth.sin() * elevation.cos(), elevation.sin());
    let up = towards.cross(&right);
    let origin = (PANEL.0 * column as i32 + PANEL.0 / 2, PANEL.1 / 2 - 50);
    let place = |vertex: u32| {
        let v = panel.mesh.vertices[vertex as usize].coords;
        let units = |length_m: f64| (UNITS_A_METRE * length_m).round() as i32;
        (origin.0 + units(v.dot(&right)), origin.1 - units(v.dot(&up)))
    };

    let facing = |face: usize| panel.mesh.face_normal(face).dot(&towards);
    let depth = |face: usize| panel.mesh.corners(face).iter().map(|p| p.coords.dot(&towards)).sum::<f64>();
    let mut faces: Vec<usize> = (0..panel.mesh.faces.len()).filter(|&face| facing(face) > 0.0).collect();
    faces.sort_by(|&a, &b| depth(a).total_cmp(&depth(b)));
    for group in faces.chunks(GROUP) {
        let mut by_colour: BTreeMap<String, String> = BTreeMap::new();
        for &face in group {
            let corners = panel.mesh.faces[face];
            let [a, b, c] = corners.map(place);
            let uncertainty = panel.uncertainty.as_ref().map(|u| mean(corners.map(|v| u[v as usize])));
            let outline = by_colour.entry(colour(uncertainty, facing(face))).or_default();
            write!(outline, "M{} {}l{} {} {} {}z", a.0, a.1, b.0 - a.0, b.1 - a.1, c.0 - b.0, c.1 - b.1)?;
        }
        for (colour, outline) in by_colour {
            writeln!(svg, "<path fill=\"{colour}\" stroke=\"{colour}\" d=\"{outline}\"/>")?;
        }
    }
    Ok(())
}

fn mean(values: [f64; 3]) -> f64 {
    values.iter().sum::<f64>() / 3.0
}

/// The ramp at `uncertainty`, darker where the face turns away; in few steps, so that faces share colours.
fn colour(uncertainty: Option<f64>, facing: f64) -> String {
    let light = 0.55 + 0.45 * (5.0 * facing).round() / 5.0;
    let base = uncertainty.map_or(GREY, |u| {
        let along = (12.0 * u.clamp(0.0, 1.0)).round() / 12.0 * (RAMP.len() - 1) as f64;
        let below = (along as usize).min(RAMP.len() - 2);
        let share = along - below as f64;
        std::array::from_fn(|part| (1.0 - share) * RAMP[below][part] + share * RAMP[below + 1][part])
    });
    // Three digits: sixteen steps a channel.
    let [red, green, blue] = base.map(|part| (light * part / 17.0).round() as u8);
    format!("#{red:x}{green:x}{blue:x}")
}
