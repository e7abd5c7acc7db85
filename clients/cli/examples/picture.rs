//! Draws the README's picture: a simulated robot explores the demo's bottle through a real server,
//! and the estimate is drawn after one look, after a few attempts and after all of them, with the touches.
//!
//! `cargo run --release --locked --example picture -- docs/images/bottle.svg`

mod drawing;

use std::error::Error;
use std::fmt::Write;
use std::path::PathBuf;

use palpate_client::Client;
use palpate_client::proto::v1::{CreateSessionRequest, GetMeshRequest, MeshFormat, SessionConfig, mesh};
use palpate_core::geometry::{Point, TriangleMesh, Vector};
use palpate_server::{ServeOptions, serve};
use palpate_simulator::camera::Camera;
use palpate_simulator::probe::Outcome;
use palpate_simulator::robot::{Plan, Robot};
use palpate_simulator::shapes;
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;

use self::drawing::{Eye, Ramp, Solid};

/// The estimate is drawn after this many attempts.
const DRAWN_AFTER: [u32; 3] = [0, 10, 50];
const SEED: u64 = 2;

/// From the camera to the object: from above the horizon, and to the side of the seen patch.
const AZIMUTH_DEG: f64 = 60.0;
const ELEVATION_DEG: f64 = 15.0;

/// Drawing units: two of them are a pixel.
const PANEL: (i32, i32) = (400, 760);
/// On the right of all panels: what the colours mean.
const BAR_WIDTH: i32 = 210;
const BAR_STEPS: i32 = 12;
/// From the middle of a panel to its camera, which is really farther away.
const CAMERA_UNITS: f64 = 165.0;
const UNITS_A_METRE: f64 = 2100.0;
/// Dark violet, blue, green, yellow: legible without colour vision too.
const RAMP: Ramp = Ramp(&[
    [68.0, 1.0, 84.0],
    [59.0, 82.0, 139.0],
    [33.0, 145.0, 140.0],
    [94.0, 201.0, 98.0],
    [253.0, 231.0, 37.0],
]);

/// Legible on dark and on light.
const DOT: &str = "fill=\"#fff\" stroke=\"#c1121f\" stroke-width=\"4\"";
/// A camera at the origin that looks to the right.
const CAMERA: &str = "<path d=\"M-16 -12h24v24h-24zM8 -5l12 -7v24l-12 -7z\" fill=\"#222\"/>";

/// A mesh with the uncertainty of its vertices; none for the true object.
struct Panel {
    title: String,
    mesh: TriangleMesh,
    uncertainty: Option<Vec<f64>>,
    /// Where the pad was and what it faced, for each contact so far.
    touches: Vec<(Point, Vector)>,
    /// Where the camera was and the middle of what it saw.
    look: Option<(Point, Point)>,
}

/// Whoever looks at the picture.
fn eye() -> Eye {
    Eye::new(AZIMUTH_DEG, ELEVATION_DEG, UNITS_A_METRE)
}

/// The middle of the panel in this column.
fn middle(column: usize) -> (i32, i32) {
    (PANEL.0 * column as i32 + PANEL.0 / 2, PANEL.1 / 2 - 50)
}

#[tokio::main]
async fn main() -> Result<(), Box<dyn Error>> {
    let path = PathBuf::from(std::env::args().nth(1).ok_or("say where to write the picture, an .svg file")?);
    let folder = tempfile::tempdir()?;
    let listener = TcpListener::bind("127.0.0.1:0").await?;
    let url = format!("http://{}", listener.local_addr()?);
    let shutdown = CancellationToken::new();
    let options =
        ServeOptions { database: folder.path().join("palpate.db").into(), ..ServeOptions::default() };
    let server = tokio::spawn(serve(listener, options, shutdown.clone()));

    let panels = explore(Client::connect(&url).await?).await?;
    shutdown.cancel();
    server.await??;
    std::fs::write(path, draw(&panels)?)?;
    Ok(())
}

async fn explore(client: Client) -> Result<Vec<Panel>, Box<dyn Error>> {
    let body = shapes::generate("bottle")?;
    let view = Camera::default().look(&body, SEED);
    let seen = view.points.iter().fold(Vector::zeros(), |sum, point| sum + point.coords);
    let look = (view.viewpoint, Point::from(seen / view.points.len() as f64));
    let mut panels = vec![Panel {
        title: "the object".to_owned(),
        mesh: body.mesh().clone(),
        uncertainty: None,
        touches: Vec::new(),
        look: None,
    }];
    let config = SessionConfig { seed: Some(SEED), ..SessionConfig::default() };
    let session = CreateSessionRequest { config: Some(config), ..CreateSessionRequest::default() };
    let plan = Plan { session, seed: SEED, attempts: DRAWN_AFTER[2], ..Plan::default() };
    let mut robot = Robot::begin(client.clone(), &body, plan).await?;
    let mut touches = Vec::new();
    for attempts in DRAWN_AFTER {
        while robot.session().stats.as_ref().is_some_and(|stats| stats.attempts < attempts) {
            let attempt = robot.step().await?.ok_or("the exploration ended early")?;
            if let Outcome::Hit(touch) | Outcome::Early(touch) = attempt.outcome {
                let pad = touch.base_from_sensor;
                // The pad's z points into the object.
                touches.push((Point::from(pad.translation.vector), -(pad.rotation * Vector::z())));
            }
        }
        let (mesh, uncertainty) = estimate(&client, &robot.session().session_id).await?;
        panels.push(Panel {
            title: if attempts == 0 { "one look".to_owned() } else { format!("{attempts} attempts") },
            mesh,
            uncertainty: Some(uncertainty),
            touches: touches.clone(),
            look: (attempts == 0).then_some(look),
        });
    }
    Ok(panels)
}

/// The latest estimate with the uncertainty of its vertices.
async fn estimate(client: &Client, session_id: &str) -> Result<(TriangleMesh, Vec<f64>), Box<dyn Error>> {
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
    Ok((mesh, uncertainty))
}

fn draw(panels: &[Panel]) -> Result<String, std::fmt::Error> {
    let (width, height) = (PANEL.0 * panels.len() as i32 + BAR_WIDTH, PANEL.1);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{}\" height=\"{}\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n\
         <g font-family=\"sans-serif\" font-size=\"28\" text-anchor=\"middle\" fill=\"#222\">\n",
        width / 2,
        height / 2
    );
    for (column, panel) in panels.iter().enumerate() {
        writeln!(svg, "<text x=\"{}\" y=\"{}\">{}</text>", middle(column).0, height - 20, panel.title)?;
    }
    svg.push_str("</g>\n<g stroke-width=\"1\" stroke-linejoin=\"round\">\n");
    for (column, panel) in panels.iter().enumerate() {
        let solid = Solid { mesh: &panel.mesh, uncertainty: panel.uncertainty.as_deref(), ramp: RAMP };
        solid.draw(&mut svg, &eye(), middle(column))?;
    }
    svg.push_str("</g>\n");
    for (column, panel) in panels.iter().enumerate() {
        draw_touches(&mut svg, panel, column)?;
        draw_camera(&mut svg, panel, column)?;
    }
    draw_bar(&mut svg, PANEL.0 * panels.len() as i32)?;
    svg.push_str("</svg>\n");
    Ok(svg)
}

/// A dot for each touch on the near side.
fn draw_touches(svg: &mut String, panel: &Panel, column: usize) -> std::fmt::Result {
    let (eye, origin) = (eye(), middle(column));
    for (point, outward) in &panel.touches {
        if outward.dot(&eye.towards) > 0.0 {
            let (x, y) = eye.place(point);
            let (x, y) = (origin.0 + x.round() as i32, origin.1 + y.round() as i32);
            writeln!(svg, "<circle cx=\"{x}\" cy=\"{y}\" r=\"7\" {DOT}/>")?;
        }
    }
    Ok(())
}

/// The camera on its side of the panel, and a line to the middle of what it saw.
fn draw_camera(svg: &mut String, panel: &Panel, column: usize) -> std::fmt::Result {
    let Some((viewpoint, seen)) = &panel.look else { return Ok(()) };
    let (eye, origin) = (eye(), middle(column));
    let ((x, y), (to_x, to_y)) = (eye.place(viewpoint), eye.place(seen));
    let nearer = CAMERA_UNITS / x.hypot(y);
    let (x, y) = (f64::from(origin.0) + nearer * x, f64::from(origin.1) + nearer * y);
    let (to_x, to_y) = (f64::from(origin.0) + to_x, f64::from(origin.1) + to_y);
    let turned = (to_y - y).atan2(to_x - x).to_degrees();
    writeln!(
        svg,
        "<path d=\"M{x:.0} {y:.0}L{to_x:.0} {to_y:.0}\" stroke=\"#222\" stroke-width=\"3\" stroke-dasharray=\"9 7\"/>\n\
         <g transform=\"translate({x:.0} {y:.0}) rotate({turned:.0})\">{CAMERA}</g>"
    )
}

/// What the colours, the dots and the camera mean.
fn draw_bar(svg: &mut String, left: i32) -> std::fmt::Result {
    let (x, top, width, height) = (left + 20, 130, 30, 300);
    let step = height / BAR_STEPS;
    for place in 0..BAR_STEPS {
        let colour = RAMP.colour(Some(f64::from(place) / f64::from(BAR_STEPS - 1)), 1.0);
        let y = top + height - step * (place + 1);
        writeln!(svg, "<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{step}\" fill=\"{colour}\"/>")?;
    }
    let text = x + width + 12;
    writeln!(svg, "<g font-family=\"sans-serif\" font-size=\"24\" fill=\"#222\">")?;
    writeln!(svg, "<text x=\"{x}\" y=\"{}\">uncertainty</text>", top - 22)?;
    for (y, label) in [(top + 20, "1: a guess"), (top + height, "0: certain")] {
        writeln!(svg, "<text x=\"{text}\" y=\"{y}\">{label}</text>")?;
    }
    let (dot_y, camera_y) = (top + height + 60, top + height + 120);
    writeln!(svg, "<circle cx=\"{}\" cy=\"{dot_y}\" r=\"7\" {DOT}/>", x + width / 2)?;
    writeln!(svg, "<text x=\"{text}\" y=\"{}\">touch</text>", dot_y + 8)?;
    writeln!(svg, "<g transform=\"translate({} {camera_y})\">{CAMERA}</g>", x + width / 2 - 6)?;
    writeln!(svg, "<text x=\"{text}\" y=\"{}\">camera</text>\n</g>", camera_y + 8)
}
