"""What is sent: arrays as the contract has them, and errors that name the argument where they cannot be."""

from datetime import datetime, timedelta, timezone

import numpy as np
import pytest

import palpate
from palpate import outcomes, v1, views
from palpate.calls import session_config
from palpate.channel import target


def test_a_cloud_is_packed_as_32_bit_floats() -> None:
    points = np.random.default_rng(1).random((7, 3))
    for given in (points, points.astype(np.float32), points.tolist(), np.asfortranarray(points), points.astype(">f8")):
        prior = views.cloud(given, (0, 0, 1), 0.002, 0.2, False)
        assert np.frombuffer(prior.points, "<f4").reshape(-1, 3) == pytest.approx(points, abs=1e-6)
    assert (prior.viewpoint.z, prior.voxel_m, prior.uncertainty) == (1, 0.002, 0.2)


@pytest.mark.parametrize(
    ("points", "words"),
    [
        (np.zeros((3, 4)), "shape"),
        (np.zeros(3), "shape"),
        (np.full((5, 3), 120, dtype=np.int16), "metres"),
        (np.array([["a", "b", "c"]]), "numbers"),
        (np.zeros((2, 3), dtype=complex), "complex"),
        ("cloud.xyz", "neither"),
    ],
)
def test_what_is_no_cloud_is_refused_before_it_is_sent(points: object, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        views.cloud(points, None, None, None, False)  # type: ignore[arg-type]


def test_a_depth_image_has_its_camera_and_its_mask() -> None:
    depth = np.arange(12, dtype=np.uint16).reshape(3, 4)
    camera = np.array([[600.0, 0, 1.5], [0, 601, 1.0], [0, 0, 1]])
    mask = depth > 5
    prior = views.depth_image(depth, camera, np.eye(4), mask, 0.001, (0.1, 2.0), None, None, True)
    assert (prior.depth.width, prior.depth.height, prior.depth.fx, prior.depth.cy) == (4, 3, 600, 1)
    assert np.frombuffer(prior.points, "<u2").reshape(3, 4).tolist() == depth.tolist()
    assert np.frombuffer(prior.depth.mask_u8, "u1").sum() == mask.sum()
    assert (prior.depth.max_depth_m, prior.keep_clutter) == (2.0, True)
    same = views.depth_image(
        depth.astype(">i4"), (600, 601, 1.5, 1.0), np.eye(4), mask, 0.001, (0.1, 2.0), None, None, True
    )
    assert same == prior


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"depth": np.zeros((2, 3, 1), np.uint16)}, "depth has the shape"),
        ({"depth": np.zeros((2, 3))}, "depth is of float64"),
        ({"depth": np.full((2, 3), 70_000)}, "16-bit"),
        ({"intrinsics": [600, 600]}, "intrinsics has the shape"),
        ({"mask": np.zeros((3, 2))}, "mask has the shape"),
        ({"depth_scale_m": 0}, "depth_scale_m is 0"),
        ({"base_from_camera": np.eye(3)}, "base_from_camera has the shape"),
    ],
)
def test_what_is_no_depth_image_is_refused_before_it_is_sent(change: dict[str, object], words: str) -> None:
    arguments: dict[str, object] = {
        "depth": np.zeros((2, 3), np.uint16),
        "intrinsics": (600, 600, 1, 1),
        "base_from_camera": np.eye(4),
        "mask": None,
        "depth_scale_m": 0.001,
        "depth_range_m": None,
        "voxel_m": None,
        "uncertainty": None,
        "keep_clutter": False,
    }
    with pytest.raises(ValueError, match=words):
        views.depth_image(**(arguments | change))  # type: ignore[arg-type]


def test_names_are_taken_with_and_without_their_prefix() -> None:
    config = session_config({"seed": 3}, "paper", "STRATEGY_RANDOM", 20, 0.06, (), ["min-uncertainty"])
    assert (config.method, config.strategy, config.seed) == (v1.METHOD_PAPER, v1.STRATEGY_RANDOM, 3)
    assert (config.stop.max_attempts, config.support.offset_m) == (20, 0.06)
    assert list(config.shadow) == [v1.STRATEGY_MIN_UNCERTAINTY]
    with pytest.raises(ValueError, match="method is 'best'; there are PAPER, PALPATE, GPIS"):
        session_config(None, "best", None, None, None, (), ())
    with pytest.raises(ValueError, match=r"config: .*speed"):
        session_config({"speed": 1}, None, None, None, None, (), ())


def test_an_outcome_without_a_candidate_says_where_it_was() -> None:
    with pytest.raises(ValueError, match="swept_from is missing"):
        outcomes.result(None, None)
    with pytest.raises(ValueError, match="pose is a position only"):
        outcomes.result(None, palpate.Contact((0, 0, 0)))
    with pytest.raises(ValueError, match="reason is 'tired'; there are NO_IK"):
        outcomes.result(None, palpate.Rejected("tired"))
    with pytest.raises(TypeError, match="the outcome is a int"):
        outcomes.result(None, 3)  # type: ignore[arg-type]


def test_addresses_are_told_from_what_is_none() -> None:
    assert target("http://127.0.0.1:7257") == "127.0.0.1:7257"
    assert target("lab-pc:7257/") == "lab-pc:7257"
    assert target("http://[::1]:7257") == "[::1]:7257"
    for wrong in ("ftp://here", "http://", "http://here:port", "http://here/v1"):
        with pytest.raises(ValueError, match="one looks like"):
            target(wrong)
    assert target("https://lab-pc") == "lab-pc:443"


def test_counts_times_and_dictionaries_are_named_where_they_are_none() -> None:
    for budget in (2.5, -1, "20"):
        with pytest.raises(ValueError, match="budget is"):
            session_config(None, None, None, budget, None, (), ())  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="config is a str"):
        session_config("x", None, None, None, None, (), ())  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="observe_time is a str"):
        outcomes.result(None, palpate.Rejected("no_ik"), observe_time="now")  # type: ignore[arg-type]


def test_a_time_without_a_zone_is_this_machines_own() -> None:
    now = datetime.now()
    for given in (now, now.astimezone(timezone.utc), now.astimezone(timezone(timedelta(hours=9)))):
        sent = outcomes.result(None, palpate.Rejected("no_ik"), observe_time=given).observe_time
        assert abs(sent.ToNanoseconds() / 1e9 - now.timestamp()) < 1e-5
