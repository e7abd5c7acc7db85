#!/usr/bin/env python3
"""A session in Rerun: the surface by its uncertainty, what was seen and touched, and the next candidates, over time.

needs: pip install './clients/python[rerun]'
Writes ball.rrd; `rerun ball.rrd` shows it.
"""

import numpy as np
import rerun as rr
from common import client

import palpate
from palpate import v1
from palpate.simulated import Ball

CAMERA, BALL = (0.5, 0.0, 0.6), Ball()


def log_update(update: palpate.Update) -> None:
    """One step of a session's history."""
    rr.set_time("revision", sequence=update.session.revision)
    if update.event and update.event.HasField("contact_result"):
        touch = update.event.contact_result
        if touch.HasField("contact"):
            at = touch.contact.sensor_pose.position
            rr.log(f"touches/{update.event.seq}", rr.Points3D([[at.x, at.y, at.z]], radii=0.001, colors=[40, 90, 220]))
        elif touch.HasField("no_contact"):
            ends = [[end.x, end.y, end.z] for end in (touch.no_contact.swept_from, touch.no_contact.swept_to)]
            rr.log(f"misses/{update.event.seq}", rr.LineStrips3D([ends], radii=0.0005, colors=[200, 40, 40]))
    if update.mesh:
        mesh = update.mesh
        rr.log(
            "surface",
            rr.Mesh3D(vertex_positions=mesh.vertices, triangle_indices=mesh.faces, vertex_colors=mesh.colors()),
        )
        rr.log("uncertainty/mean", rr.Scalars(float(mesh.uncertainty.mean())))


with client(__doc__ or "") as server:
    session = server.create_session("ball-in-rerun", frame_id="base", table_z=0.06)
    cloud = BALL.seen_from(CAMERA)
    session.add_prior(cloud, viewpoint=CAMERA)

    rr.init("palpate")
    rr.save("ball.rrd")
    rr.log("seen", rr.Points3D(cloud, radii=0.0007, colors=[0, 190, 190]), static=True)

    def log_candidates(step: palpate.Step) -> None:
        rr.set_time("revision", sequence=step.accepted.revision)
        starts = np.array([candidate.start for candidate in step.accepted]).reshape(-1, 3)
        ways = np.array([candidate.end - candidate.start for candidate in step.accepted]).reshape(-1, 3)
        rr.log("candidates", rr.Arrows3D(origins=starts, vectors=ways, radii=0.0008, colors=[230, 150, 0]))

    palpate.explore(BALL, session, 15, on_step=log_candidates)
    # The same session once more from its log: any session can be shown so, long after it was made.
    for update in session.replay(include_mesh=True):
        log_update(update)
    assert session.info.state == v1.SESSION_STATE_ACTIVE
    print(f"ball.rrd has {session.revision} revisions of {session.id}")
    session.delete()
