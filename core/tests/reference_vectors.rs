//! The paper's stages against vectors of an independent implementation, `data/reference.py`.
//!
//! Vertices are matched through their directions on the unit sphere, never through their numbers.

#![expect(clippy::unwrap_used, reason = "a test that meets nothing where something must be has failed")]

use nalgebra::Matrix3;

use palpate_core::config::{Axes, Config, Method, Settings};
use palpate_core::evidence::attractor::{Attractor, Sense};
use palpate_core::evidence::ledger::Ledger;
use palpate_core::exploration::{self, ProposalRequest, Situation};
use palpate_core::geometry::{Icosphere, Point, TriangleMesh, Vector};
use palpate_core::local::thin_plate::ThinPlate;
use palpate_core::template::{EllipsoidFit, Projection, TemplateSurface, ellipsoid};
use palpate_core::uncertainty::{self, Reach};
use serde_json::Value;

/// Where a foot lies on an edge of the mesh the faces about it give heights up to 0.015 mm apart, and the
/// reference takes the middle.
const TOLERANCE_M: f64 = 1e-5;
/// The fit's steps are prescribed, so only rounding separates two fits.
const FIT_TOLERANCE_M: f64 = 1e-9;
const REACH: Reach = Reach { hops: 5, length_m: 0.020 };

struct Reference {
    file: Value,
    attractors: Vec<Attractor>,
    camera: Point,
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

fn points(value: &Value) -> Vec<Point> {
    value.as_array().unwrap().iter().map(|row| Point::from_slice(&numbers(row))).collect()
}

impl Reference {
    fn all() -> [Self; 2] {
        [include_str!("data/ellipsoid_cap.json"), include_str!("data/mustard.json")].map(|text| {
            let file: Value = serde_json::from_str(text).unwrap();
            let attractors = file["attractors"].as_array().unwrap().iter().map(|a| {
                let sense = if a["visual"].as_bool().unwrap() { Sense::Vision } else { Sense::Touch };
                Attractor::new(Point::from_slice(&numbers(&a["x"])), a["u"].as_f64().unwrap(), sense)
            });
            Self { attractors: attractors.collect(), camera: Point::from_slice(&numbers(&file["cam"])), file }
        })
    }

    fn visual(&self) -> Vec<Attractor> {
        self.attractors.iter().copied().filter(|a| a.sense == Sense::Vision).collect()
    }

    fn first_fit(&self, axes: Axes) -> EllipsoidFit {
        ellipsoid::fit(&self.visual(), Some(&self.camera), axes)
    }

    fn fit(&self, axes: Axes) -> EllipsoidFit {
        ellipsoid::fit(&self.attractors, Some(&self.camera), axes)
    }

    fn surface(&self) -> TemplateSurface {
        TemplateSurface::new(self.fit(Axes::Frame).shape.mesh(Icosphere::get(4)))
    }

    fn projections(&self) -> Vec<Projection> {
        let surface = self.surface();
        self.attractors.iter().map(|attractor| surface.project(&attractor.point)).collect()
    }

    /// The template's mesh and the deformed one.
    fn meshes(&self) -> (TriangleMesh, TriangleMesh) {
        let surface = self.surface();
        let plate = ThinPlate::fit(&self.projections());
        let deformed = surface.raised(&plate.heights_m(&surface.mesh().vertices));
        (surface.mesh().clone(), deformed)
    }

    fn uncertainty(&self, mesh: &TriangleMesh) -> Vec<f64> {
        uncertainty::propagate(&Icosphere::get(4).connectivity, &mesh.vertices, &self.attractors, REACH)
    }

    /// Our vertices at the directions of the reference's.
    fn vertices(&self) -> Vec<usize> {
        points(&self.file["unit_sphere"]).iter().map(vertex_towards).collect()
    }
}

fn vertex_towards(direction: &Point) -> usize {
    let towards = |v: &usize| Icosphere::get(4).directions[*v].dot(&direction.coords);
    (0..2562).max_by(|a, b| towards(a).total_cmp(&towards(b))).unwrap()
}

fn assert_close(found: &Point, expected: &Point, what: &str) {
    assert!((found - expected).norm() < TOLERANCE_M, "{what}: {found} for {expected}");
}

/// Compares with the members of `expected` whose names are `prefix` and then `centre`, `semi_axes`, `loss`.
fn assert_fit(found: &EllipsoidFit, expected: &Value, prefix: &str) {
    let member = |name: &str| &expected[format!("{prefix}{name}")];
    let centre = Point::from_slice(&numbers(member("centre")));
    let semi_axes = Vector::from_row_slice(&numbers(member("semi_axes")));
    let loss = member("loss").as_f64().unwrap();
    assert!((found.shape.centre - centre).norm() < FIT_TOLERANCE_M, "{} for {centre}", found.shape.centre);
    assert!(
        (found.shape.semi_axes - semi_axes).norm() < FIT_TOLERANCE_M,
        "{} for {semi_axes}",
        found.shape.semi_axes
    );
    assert!((found.loss / loss - 1.0).abs() < 1e-8, "{} for {loss}", found.loss);
}

fn assert_axes(found: &EllipsoidFit, expected: &Value, tolerance: f64) {
    let rows: Vec<f64> = expected.as_array().unwrap().iter().flat_map(numbers).collect();
    let expected = Matrix3::from_row_slice(&rows);
    let found = found.shape.base_from_template.matrix();
    assert!((found - expected).norm() < tolerance, "{found} for {expected}");
}

#[test]
fn the_fit_to_the_visual_points_is_the_reference_ellipsoid() {
    for reference in Reference::all() {
        let fit = reference.first_fit(Axes::Frame);
        assert_fit(&fit, &reference.file["first_fit"], "");
        assert_eq!(*fit.shape.base_from_template.matrix(), Matrix3::identity());
    }
}

#[test]
fn the_fitted_template_is_the_reference_ellipsoid() {
    for reference in Reference::all() {
        let fit = reference.fit(Axes::Frame);
        let expected = &reference.file["ellipsoid"];
        assert_fit(&fit, expected, "");
        assert_axes(&fit, &expected["R_columns_are_axes"], 1e-12);
    }
}

#[test]
fn free_axes_turn_as_in_the_reference() {
    for reference in Reference::all() {
        let file = &reference.file;
        for (fit, expected) in
            [(reference.first_fit(Axes::Free), &file["first_free_fit"]), (reference.fit(Axes::Free), file)]
        {
            assert_fit(&fit, expected, "free_");
            assert_axes(&fit, &expected["free_R"], 1e-6);
        }
    }
}

/// 160 visual points weigh one half each, so the mustard bottle's 80 given twice change nothing.
#[test]
fn visual_points_together_weigh_at_most_as_much_as_80_touches() {
    let [_, reference] = Reference::all();
    assert_eq!(reference.visual().len(), 80);
    let twice: Vec<_> = reference.attractors.iter().copied().chain(reference.visual()).collect();
    let fit = ellipsoid::fit(&twice, Some(&reference.camera), Axes::Frame);
    assert_fit(&fit, &reference.file["ellipsoid"], "");
}

#[test]
fn attractors_project_onto_the_template_as_in_the_reference() {
    for reference in Reference::all() {
        let projections = reference.projections();
        for expected in reference.file["projections"].as_array().unwrap() {
            let found = &projections[expected["i"].as_u64().unwrap() as usize];
            assert_close(
                &found.foot.point.into(),
                &Point::from_slice(&numbers(&expected["p"])),
                "projection",
            );
            assert!((found.height_m - expected["d"].as_f64().unwrap()).abs() < TOLERANCE_M);
        }
    }
}

#[test]
fn vertices_move_as_in_the_reference() {
    for reference in Reference::all() {
        let (global, deformed) = reference.meshes();
        let normals = global.vertex_normals();
        let file = &reference.file;
        for (row, vertex) in reference.vertices().into_iter().enumerate() {
            assert_close(&global.vertices[vertex], &points(&file["global_vertices"])[row], "template");
            let normal = Point::from(normals[vertex].into_inner());
            assert!((normal - points(&file["global_normals"])[row]).norm() < 1e-3);
            assert_close(&deformed.vertices[vertex], &points(&file["displaced_vertices"])[row], "deformed");
        }
    }
}

#[test]
fn uncertainty_spreads_as_in_the_reference() {
    for reference in Reference::all() {
        let (_, deformed) = reference.meshes();
        let u = reference.uncertainty(&deformed);
        for (vertex, expected) in
            reference.vertices().into_iter().zip(numbers(&reference.file["uncertainty"]))
        {
            assert!((u[vertex] - expected).abs() < 1e-3, "{} for {expected}", u[vertex]);
        }
        let mean = u.iter().sum::<f64>() / u.len() as f64;
        assert!((mean - reference.file["uncertainty_mean"].as_f64().unwrap()).abs() < 1e-4);
        let unknown = u.iter().filter(|u| **u == 1.0).count() as u64;
        assert_eq!(unknown, reference.file["n_u1"].as_u64().unwrap());
    }
}

#[test]
fn the_next_contact_is_chosen_like_in_the_reference() {
    let config = Config::new(Settings { method: Method::Paper, ..Settings::default() }).unwrap();
    for reference in Reference::all() {
        let (_, mesh) = reference.meshes();
        let situation = Situation {
            config: &config,
            ledger: &Ledger::default(),
            connectivity: &Icosphere::get(4).connectivity,
            mesh: &mesh,
            normals: &mesh.vertex_normals(),
            uncertainty: &reference.uncertainty(&mesh),
            centre: reference.fit(Axes::Frame).shape.centre,
            reach: REACH,
            deviations: None,
            doubted: Vec::new(),
        };
        let proposal = exploration::propose(&situation, &ProposalRequest::best(8));
        let expected = Point::from_slice(&numbers(&reference.file["chosen_xyz"]));
        let nearest = proposal
            .candidates
            .iter()
            .min_by(|a, b| (a.point - expected).norm().total_cmp(&(b.point - expected).norm()))
            .unwrap();
        // Our geodesics are shorter than the reference's edge paths, so near ties may swap; the second of
        // them is offered a few millimetres beside its place, where candidates keep apart.
        assert!((nearest.point - expected).norm() < 0.005);
        assert!(nearest.score > 0.96 * proposal.candidates[0].score);
        let score = reference.file["chosen_score"].as_f64().unwrap();
        assert!((proposal.candidates[0].score / score - 1.0).abs() < 0.02);
        let feasible = 2562
            - u64::from(proposal.excluded.already_certain)
            - u64::from(proposal.excluded.no_confident_neighbour);
        assert_eq!(feasible, reference.file["n_feasible"].as_u64().unwrap());
    }
}
