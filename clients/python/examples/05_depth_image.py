#!/usr/bin/env python3
"""A depth image with its mask: what a depth camera and a segmentation give, without making a cloud of it."""

import numpy as np
from common import client

import palpate
from palpate.simulated import Ball

BALL = Ball()
ROWS, COLUMNS, FOCAL, ABOVE = (
    240,
    320,
    500.0,
    0.5,
)  # pixels, pixels, pixels, metres from the camera to the ball's centre

# The pose of the camera's optical frame in the base's: x to the right, y down, z forward; here it looks straight down.
base_from_camera = (np.array(BALL.center) + [0.0, 0.0, ABOVE], [1.0, 0.0, 0.0, 0.0])
intrinsics = (FOCAL, FOCAL, (COLUMNS - 1) / 2, (ROWS - 1) / 2)  # fx, fy, cx, cy

# A stand-in for the camera: each pixel's ray against the ball and the table 40 mm below its centre.
columns, rows = np.meshgrid(np.arange(COLUMNS), np.arange(ROWS))
x, y = (columns - intrinsics[2]) / FOCAL, (rows - intrinsics[3]) / FOCAL
root = ABOVE**2 - (1 + x * x + y * y) * (ABOVE**2 - BALL.radius**2)
on_ball = root > 0
depth_m = np.where(on_ball, (ABOVE - np.sqrt(np.maximum(root, 0))) / (1 + x * x + y * y), ABOVE + 0.04)
depth = (depth_m * 1000).round().astype(np.uint16)  # millimetres, as a RealSense stores them; 0 = no measurement

with client(__doc__) as server:
    session = server.create_session(frame_id="base", table_z=0.06)
    view = session.add_depth(depth, intrinsics, base_from_camera, mask=on_ball)
    print(f"{view.accepted_points} points after thinning to {1000 * view.voxel_m:.1f} mm; set aside: {view.set_aside}")
    palpate.explore(BALL, session, 20)
    print(f"{1000 * BALL.error_m(session.mesh().vertices):.2f} mm from the truth after 20 attempts")
