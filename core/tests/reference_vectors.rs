//! The paper's stages against vectors of an independent implementation.
//!
//! Vertices are matched through their directions on the unit sphere, never through their numbers.

#![expect(clippy::unwrap_used, reason = "a test that meets nothing where something must be has failed")]

use nalgebra::{Matrix3, Rotation3};

use palpate_core::config::{Config, Method, Settings};
use palpate_core::evidence::attractor::{Attractor, Sense};
use palpate_core::evidence::ledger::Ledger;
use palpate_core::exploration::{self, ProposalRequest, Situation};
use palpate_core::geometry::{Icosphere, Point, TriangleMesh, Vector};
use palpate_core::local::thin_plate::ThinPlate;
use palpate_core::template::{Ellipsoid, EllipsoidFit, Projection, TemplateSurface, ellipsoid};
use palpate_core::uncertainty::{self, Reach};
use serde_json::Value;

const TOLERANCE_M: f64 = 1e-5;
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
            let attractors = file["attractors"].as_array().unwrap().iter().map(|a| Attractor {
                point: Point::from_slice(&numbers(&a["x"])),
                uncertainty: a["u"].as_f64().unwrap(),
                sense: if a["visual"].as_bool().unwrap() { Sense::Vision } else { Sense::Touch },
            });
            Self { attractors: attractors.collect(), camera: Point::from_slice(&numbers(&file["cam"])), file }
        })
    }

    /// The reference starts its first fit from a sphere with the axes of the frame.
    fn first_fit(&self) -> EllipsoidFit {
        let visual: Vec<_> = self.attractors.iter().copied().filter(|a| a.sense == Sense::Vision).collect();
        let start = Ellipsoid {
            base_from_template: Rotation3::identity(),
            ..ellipsoid::initial(&visual, Some(&self.camera))
        };
        ellipsoid::fit(&visual, Some(&self.camera), &start, false)
    }

    fn fit(&self) -> EllipsoidFit {
        ellipsoid::fit(&self.attractors, Some(&self.camera), &self.first_fit().shape, true)
    }

    fn surface(&self) -> TemplateSurface {
        TemplateSurface::new(self.fit().shape.mesh(Icosphere::get(4)))
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
        uncertainty::propagate(Icosphere::get(4), &mesh.vertices, &self.attractors, REACH)
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

#[test]
fn the_first_fit_reaches_the_reference_minimum() {
    for reference in Reference::all() {
        let fit = reference.first_fit();
        let expected = reference.file["first_fit"]["cost"].as_f64().unwrap();
        // The reference states Σ r², we minimise half of it.
        assert!((2.0 * fit.cost / expected - 1.0).abs() < 1e-6, "{} for {expected}", 2.0 * fit.cost);
    }
}

#[test]
fn the_fitted_template_is_the_reference_ellipsoid() {
    for reference in Reference::all() {
        let shape = reference.fit().shape;
        let expected = &reference.file["ellipsoid"];
        assert_close(&shape.centre, &Point::from_slice(&numbers(&expected["centre"])), "centre");
        let axes = Vector::from_row_slice(&numbers(&expected["semi_axes"]));
        assert!((shape.semi_axes - axes).norm() < TOLERANCE_M);
        let rows: Vec<f64> =
            expected["R_columns_are_axes"].as_array().unwrap().iter().flat_map(numbers).collect();
        assert!((shape.base_from_template.matrix() - Matrix3::from_row_slice(&rows)).norm() < 1e-3);
    }
}

#[test]
fn a_start_from_the_data_finds_the_same_surface() {
    for reference in Reference::all() {
        let visual: Vec<_> =
            reference.attractors.iter().copied().filter(|a| a.sense == Sense::Vision).collect();
        let start = ellipsoid::initial(&visual, Some(&reference.camera));
        let cost = ellipsoid::fit(&visual, Some(&reference.camera), &start, false).cost;
        assert!((cost / reference.first_fit().cost - 1.0).abs() < 1e-6);
    }
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
            sphere: Icosphere::get(4),
            mesh: &mesh,
            normals: &mesh.vertex_normals(),
            uncertainty: &reference.uncertainty(&mesh),
            centre: reference.fit().shape.centre,
            reach: REACH,
            deviations: None,
        };
        let proposal = exploration::propose(&situation, &ProposalRequest::best(8));
        let expected = Point::from_slice(&numbers(&reference.file["chosen_xyz"]));
        let nearest = proposal
            .candidates
            .iter()
            .min_by(|a, b| (a.point - expected).norm().total_cmp(&(b.point - expected).norm()))
            .unwrap();
        // Our geodesics are shorter than the reference's edge paths, so near ties may swap.
        assert!((nearest.point - expected).norm() < 0.010);
        assert!(nearest.score > 0.98 * proposal.candidates[0].score);
        let score = reference.file["chosen_score"].as_f64().unwrap();
        assert!((proposal.candidates[0].score / score - 1.0).abs() < 0.02);
        let feasible = 2562
            - u64::from(proposal.excluded.already_certain)
            - u64::from(proposal.excluded.no_confident_neighbour);
        assert_eq!(feasible, reference.file["n_feasible"].as_u64().unwrap());
    }
}
