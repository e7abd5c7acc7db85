//! An example of each JSON body, as `docs/http.md` has them: sent in this order, each is accepted.
//!
//! The tests send them, and so does whoever presses "Execute" at `/docs`.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

/// The session that the examples are about.
pub(super) const SESSION_ID: &str = "first-ball";

/// The example of an operation's body, by the operation's id.
pub(super) fn body(operation_id: &str) -> Option<Value> {
    match operation_id {
        "create_session" => Some(json!({
            "session_id": SESSION_ID,
            "frame_id": "table",
            "labels": { "object": "ball" },
            // With it, pressing "Execute" again is a retry and not a second session of the same id.
            "request_id": "create-first-ball",
        })),
        "add_visual_prior" => Some(json!({
            "prior": { "points": cap(), "viewpoint": { "x": 0.5, "y": 0.0, "z": 0.6 } },
            "propose": 1,
            "request_id": "view-1",
        })),
        "propose_contacts" => Some(json!({
            "top_k": 3,
            // The table, which no approach may enter.
            "robot": { "keep_out": [
                { "half_space": { "normal": { "x": 0.0, "y": 0.0, "z": 1.0 }, "offset_m": 0.06 } },
            ] },
        })),
        "report_contact" => Some(json!({
            // A robot echoes the candidate_id of what it tried; without one it chose the place itself.
            "result": { "contact": {
                "sensor_pose": {
                    "position": { "x": 0.54, "y": 0.0, "z": 0.1 },
                    // The pad faces the ball, against the x axis.
                    "orientation": { "x": 0.0, "y": -FRAC_1_SQRT_2, "z": 0.0, "w": FRAC_1_SQRT_2 },
                },
                "wrench": {
                    "force": { "x": 0.0, "y": 0.0, "z": -2.0 },
                    "torque": { "x": 0.001, "y": 0.0, "z": 0.0 },
                },
            } },
            "propose": 1,
            "request_id": "touch-1",
        })),
        // Eight triangles in place of the ball: more of them are a better truth.
        "evaluate_session" => {
            Some(json!({ "revisions": [2, 0], "reference_mesh": STANDARD.encode(OCTAHEDRON) }))
        }
        _ => None,
    }
}

/// The corners of the ball, as an OBJ file.
const OCTAHEDRON: &str = "v 0.54 0 0.1\nv 0.46 0 0.1\nv 0.5 0.04 0.1\nv 0.5 -0.04 0.1\nv 0.5 0 0.14\nv 0.5 0 0.06\n\
                          f 1 3 5\nf 3 2 5\nf 2 4 5\nf 4 1 5\nf 3 1 6\nf 2 3 6\nf 4 2 6\nf 1 4 6\n";

/// The top of a ball of 40 mm radius about (0.5, 0, 0.1), in tenths of a millimetre.
fn cap() -> Vec<[f64; 3]> {
    let (rings, around) = (3, 8);
    let point = |ring: i32, step: i32| {
        let (polar, turn) = (0.3 * f64::from(ring), TAU * f64::from(step) / f64::from(around));
        let across = 0.04 * polar.sin();
        let place = [0.5 + across * turn.cos(), across * turn.sin(), 0.1 + 0.04 * polar.cos()];
        place.map(|x| (1e4 * x).round() / 1e4)
    };
    (1..=rings).flat_map(|ring| (0..around).map(move |step| point(ring, step))).collect()
}
