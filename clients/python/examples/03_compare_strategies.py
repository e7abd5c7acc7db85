#!/usr/bin/env python3
"""Two strategies from the same first touches: a fork is a copy of a session, which goes on in its own way."""

from common import client

import palpate
from palpate.simulated import Ball

CAMERA, BALL = (0.5, 0.0, 0.6), Ball()

with client(__doc__) as server:
    begun = server.create_session(frame_id="base", table_z=0.06, experiment="examples")
    begun.add_prior(BALL.seen_from(CAMERA), viewpoint=CAMERA)
    palpate.explore(BALL, begun, 3)

    print("strategy          attempts  failures  uncertainty  error, mm")
    for strategy in ("PROACTIVE", "EXPECTED_GAIN", "RANDOM"):
        session = begun.fork(strategy=strategy, labels={"strategy": strategy})
        palpate.explore(BALL, session, 12)
        error = 1000 * BALL.error_m(session.mesh().vertices)
        stats = session.stats
        figures = f"{stats.attempts:8}  {stats.failures:8}  {stats.mean_uncertainty:11.3f}  {error:9.3f}"
        print(f"{strategy:16}  {figures}")
