#!/usr/bin/env python3
"""From a cloud to the next contact."""

from common import client

from palpate.simulated import Ball

CAMERA = (0.5, 0.0, 0.6)  # where the camera is, in metres, in the frame of the robot's base

with client(__doc__) as server:
    session = server.create_session(frame_id="base", table_z=0.06)
    cloud = Ball().seen_from(CAMERA)  # (N, 3) in metres, in the same frame; yours comes from a camera
    view = session.add_prior(cloud, viewpoint=CAMERA)
    print(f"{view.accepted_points} points of the view are in the estimate")

    best = session.candidates()[0]
    print(f"touch at {best.point.round(4)} m, from {best.start.round(4)} towards {best.end.round(4)}")
    print(f"because: {best.why}")
    print(f"the pad's pose at the start of the approach, z into the object:\n{best.pad_pose.round(3)}")

    mesh = session.mesh()
    print(f"the surface so far: {len(mesh.vertices)} vertices, mean uncertainty {mesh.uncertainty.mean():.2f}")
