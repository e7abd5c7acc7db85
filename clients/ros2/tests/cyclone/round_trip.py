#!/usr/bin/env python3
"""The round trip over an independent DDS: `round_trip.py PALPATE PALPATE_ROS2`, with cyclonedds and numpy.

A robot explores a ball through the bridge. What it hears is compared with what the server says over HTTP, each touch must
be in the log once, also those that were made while the server was dead, and whatever is sent wrong must be told by its
topic and field.
"""

from __future__ import annotations

import csv
import json
import os
import random
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path
from typing import Any

import numpy as np
import ros_messages as ros
from robot import BEHIND_M, CENTER, LIVE, RADIUS, SENSOR, Robot, matrix, wait_for

PARAMETERS = """
/**:
  ros__parameters:
    frame_id: base
    sensor_frame: pad
    robot_id: arm-1
    experiment: round-trip
    labels: {object: ball}
    crop: {min_m: [0.3, -0.2, 0.0], max_m: [0.7, 0.2, 0.4]}
    reliable_sensors: false
    contact: {threshold_n: 1.0, release_n: 0.5, debounce_samples: 3, tare_samples: 50}
lab:
  palpate:
    ros__parameters:
      session_id: ball-1
      candidates: 3
      config: {method: METHOD_PALPATE, support: {normal: {z: 1}, offset_m: 0.06}, icosphere_subdivisions: 3}
"""


class Server:
    """A server that can be killed and started again on its port and its database."""

    def __init__(self, program: str, folder: Path) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.address = "127.0.0.1:{}".format(free.getsockname()[1])
        self.program, self.folder, self.process = program, folder, None
        self.start()

    def start(self) -> None:
        log = open(self.folder / "server.log", "ab")
        arguments = ["serve", "--listen", self.address, "--database", str(self.folder / "palpate.db")]
        self.process = subprocess.Popen([self.program, *arguments], stderr=log, stdout=log)
        wait_for("server", self.answers)

    def answers(self) -> bool:
        try:
            self.get("readyz")
        except OSError:
            return False
        return True

    def kill(self) -> None:
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()

    def get(self, path: str, body: Any = None) -> bytes:
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(f"http://{self.address}/{path}", data, {"Content-Type": "application/json"})
        with urllib.request.urlopen(request, timeout=30) as reply:
            return reply.read()

    def session(self, session_id: str, more: str = "", body: Any = None) -> Any:
        return json.loads(self.get(f"v1/sessions/{session_id}{more}", body))

    def results(self, session_id: str) -> list[dict[str, Any]]:
        """What became of each approach, by the log."""
        return [event for event in self.session(session_id, "/events")["events"] if "contact_result" in event]


def numbers(vector: Any) -> np.ndarray:
    return np.array([vector.get(axis, 0.0) if isinstance(vector, dict) else getattr(vector, axis) for axis in "xyz"])


class Heard:
    """Everything that the bridge publishes, as RViz and a planner hear it."""

    def __init__(self, robot: Robot) -> None:
        listen = lambda topic, kind: robot.listen(f"/lab/palpate/{topic}", kind)  # noqa: E731
        self.candidate, self.candidates = listen("candidate", ros.PoseStamped), listen("candidates", ros.PoseArray)
        self.details, self.attractors = listen("candidate_details", ros.Candidates), listen("attractors", ros.PointCloud2)
        # The shape is remapped, so that a remapped name is tested as well.
        self.mesh, self.marker = robot.listen("/shape", ros.Mesh), listen("marker", ros.Marker)
        self.diagnostics = robot.listen("/diagnostics", ros.DiagnosticArray, LIVE)

    def part(self, name: str) -> Any:
        array = self.diagnostics.get()
        return next((status for status in array.status if status.name == f"palpate: {name}"), None) if array else None

    def says(self, name: str, level: int, *words: str) -> Any:
        def check() -> Any:
            part = self.part(name)
            return part if part and part.level == level and all(word in part.message for word in words) else None

        return wait_for(f"diagnostics of {name} with level {level} and {words}", check)

    def at(self, revision: int) -> ros.Candidates:
        def check() -> Any:
            details = self.details.get()
            return details if details and details.revision >= revision else None

        return wait_for(f"candidates of revision {revision}", check)


def compare(server: Server, heard: Heard, session_id: str, revision: int) -> None:
    """What was published is what the server says."""
    details = heard.at(revision)
    session = server.session(session_id)
    assert (details.session_id, details.revision) == (session_id, session["revision"]), (details, session["revision"])
    proposed = server.session(session_id, "/candidates", {"top_k": 3, "robot": {"robot_id": "arm-1"}})["candidates"]
    assert [one.candidate_id for one in details.candidates] == [one["candidate_id"] for one in proposed]
    for one, expected in zip(details.candidates, proposed):
        for field in ("point", "normal", "probe_start", "probe_end"):
            assert np.array_equal(numbers(getattr(one, field)), numbers(expected[field])), field
        assert one.why == expected["why"] and one.score == expected["score"]
    poses = wait_for("poses", lambda: (got := heard.candidates.get()) and len(got.poses) == len(proposed) and got)
    best = wait_for("pose", lambda: (got := heard.candidate.get()) and got.pose == details.candidates[0].tool_pose and got)
    assert poses.poses[0] == best.pose and poses.header.frame_id == best.header.frame_id == "base"
    assert np.array_equal(numbers(best.pose.position), numbers(proposed[0]["tool_pose"]["position"]))
    # The tool's z axis looks into the object.
    assert np.allclose(matrix(best.pose.orientation)[:, 2], -numbers(proposed[0]["normal"]), atol=1e-6)

    expected = server.session(session_id, "/mesh?format=json")
    vertices, faces = np.array(expected["vertices"]), np.array(expected["faces"])

    def same_mesh() -> Any:
        mesh = heard.mesh.get()
        got = np.array([[p.x, p.y, p.z] for p in mesh.vertices]) if mesh else np.zeros((0, 3))
        same = got.shape == vertices.shape and np.abs(got - vertices).max() < 1e-6
        return mesh if same else None

    mesh = wait_for("mesh as over HTTP", same_mesh)
    assert np.array_equal([triangle.vertex_indices for triangle in mesh.triangles], faces)

    def same_marker() -> Any:
        marker = heard.marker.get()
        got = np.array([[p.x, p.y, p.z] for p in marker.points]) if marker else np.zeros((0, 3))
        same = got.shape == (3 * len(faces), 3) and np.abs(got - vertices[faces.reshape(-1)]).max() < 1e-6
        return marker if same else None

    marker = wait_for("marker as over HTTP", same_marker)
    assert (marker.type, marker.header.frame_id, len(marker.colors)) == (11, "base", 3 * len(faces))
    uncertainty = np.array(expected["uncertainty"])[faces.reshape(-1)]
    colours = np.array([[c.r, c.g, c.b] for c in marker.colors])
    certain, guess = colours[uncertainty.argmin()], colours[uncertainty.argmax()]
    assert uncertainty.max() - uncertainty.min() > 0.1 and certain[1] - certain[0] > guess[1] - guess[0]

    table = csv.DictReader(server.get(f"v1/sessions/{session_id}/export?format=csv").decode().splitlines())
    rows = [row for row in table if row["outcome"] in ("contact", "early_contact")]
    touches = np.array([[float(row[axis]) for axis in ("x_m", "y_m", "z_m")] for row in rows]).reshape(-1, 3)

    def same_attractors() -> Any:
        cloud = heard.attractors.get()
        if cloud is None or cloud.width != len(touches):
            return None
        read = np.frombuffer(bytes(cloud.data), dtype=[("at", "<f4", 3), ("u", "<f4"), ("f", "<f4"), ("seq", "<u4")])
        return bool(len(touches) == 0 or np.abs(read["at"] - touches).max() < 1e-6) and list(read["seq"])

    seqs = wait_for("attractors as over HTTP", lambda: (got := same_attractors()) is not None and (got or True))
    assert len(touches) == 0 or seqs == [int(row["seq"]) for row in rows], (seqs, rows)
    print(f"revision {revision}: {len(proposed)} candidates, {len(vertices)} vertices, {len(touches)} touches as over HTTP")


def main() -> None:
    palpate, bridge_program = sys.argv[1:]
    folder = Path(tempfile.mkdtemp())
    # Another domain than that of a robot next door, and of a second run beside this one.
    domain = random.randint(1, 100)
    server = Server(palpate, folder)
    (folder / "parameters.yaml").write_text(PARAMETERS)
    ros_args = ["--params-file", str(folder / "parameters.yaml"), "-p", f"server:=http://{server.address}", "-p", "rmw:=rmw_cyclonedds_cpp"]
    ros_args += ["-r", "__ns:=/lab", "-r", "points:=/camera/points", "-r", "wrench:=/ft/raw", "-r", "~/mesh:=/shape"]
    bridge_log = open(folder / "bridge.log", "wb")
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain)}
    bridge = subprocess.Popen([bridge_program, "--ros-args", *ros_args], env=environment, stderr=bridge_log)
    robot = None
    try:
        robot = Robot(domain, "/lab")
        explore(server, robot)
        bridge.send_signal(signal.SIGINT)
        assert bridge.wait(10) == 0, "the bridge did not end as it was asked to"
    except BaseException:
        for name in ("bridge.log", "server.log"):
            sys.stderr.write(f"--- {name}\n" + (folder / name).read_text()[-6000:])
        raise
    finally:
        if robot:
            robot.stop()
        bridge.kill()
        server.kill()


def explore(server: Server, robot: Robot) -> None:
    heard = Heard(robot)
    heard.says("session", 0, "ball-1")
    heard.says("detector", 0, "listens")

    # Clouds that are wrong are told by topic and field, and the next one is taken.
    broken = robot.cloud()
    broken.fields = broken.fields[1:]
    again(robot, "/camera/points", broken, lambda: heard.part("view") and "no \"z\"" in heard.part("view").message)
    lost = robot.cloud("/nowhere")
    again(robot, "/camera/points", lost, lambda: "nowhere" in heard.part("view").message)
    assert server.session("ball-1")["state"] == "SESSION_STATE_AWAITING_PRIOR"

    # A cloud with big-endian doubles becomes the view, with the camera's place from TF.
    again(robot, "/camera/points", robot.cloud("/camera", big=True), lambda: server.session("ball-1")["revision"] == 2)
    compare(server, heard, "ball-1", 2)
    view = server.session("ball-1", "/events")["events"][1]["visual_prior"]
    assert np.allclose(numbers(view["viewpoint"]), [0.5, 0.0, 0.6]), view
    session = server.session("ball-1")
    assert (session["experiment"], session["labels"], session["frame_id"]) == ("round-trip", {"object": "ball"}, "base")

    made = 0
    for _ in range(4):
        made += touch(robot, heard, server, "ball-1", made)
    compare(server, heard, "ball-1", 2 + made)

    # The server dies; the robot touches; the server comes back.
    candidate = heard.at(2 + made).candidates[0]
    server.kill()
    heard.says("server", 2, "kept")
    hit = robot.touch(candidate)
    if not hit:
        assert robot.call("no_contact", ros.TriggerRequest, ros.TriggerResponse).success is False
    time.sleep(2.0)
    server.start()
    made += 1
    reported(server, "ball-1", made)
    heard.says("server", 0)
    compare(server, heard, "ball-1", 2 + made)

    # The server is killed in the very moment of the report, three times.
    for delay in (0.0, 0.05, 0.15):
        candidate = heard.at(2 + made).candidates[0]
        hit = robot.touch(candidate)
        if not hit:
            robot.publish("/lab/contact", ros.Contact(robot.header("base"), kind=1, candidate_id=candidate.candidate_id))
        time.sleep(delay)
        server.kill()
        time.sleep(0.3)
        server.start()
        made += 1
        reported(server, "ball-1", made)
    compare(server, heard, "ball-1", 2 + made)

    # Who detects without the bridge: a contact with its pose, one whose pose is that of TF, one with a field that is wrong.
    made += contacts(robot, heard, server, made)
    made += services(robot, heard, server, made)
    results = server.results("ball-1")
    ids = [event["contact_result"].get("candidate_id") for event in results]
    requests = [event["request_id"] for event in results]
    assert len(set(requests)) == len(requests) == made
    assert len([one for one in ids if one]) == len({one for one in ids if one}), "a candidate was reported twice"

    # Who comes late hears the last of everything.
    late = Heard(robot)
    compare(server, late, "ball-1", 2 + made)

    # Somebody else rejects a candidate: the bridge notices.
    candidate = late.at(2 + made).candidates[0].candidate_id
    result = {"candidate_id": candidate, "rejected": {"reason": "REJECT_REASON_OPERATOR"}}
    server.session("ball-1", "/contacts", {"result": result})
    made += 1
    compare(server, heard, "ball-1", 2 + made)

    depth_session(robot, heard, server)
    finished = robot.call("finish", ros.FinishRequest, ros.FinishResponse, note="done")
    assert finished.success, finished
    assert server.session("ball-2")["state"] == "SESSION_STATE_FINISHED"
    print(f"{made} approaches, each in the log once")


def again(robot: Robot, topic: str, message: Any, is_done: Any) -> None:
    """Publishes as a camera does, again and again, until it is noticed."""

    def check() -> Any:
        message.header.stamp = robot.now()
        robot.publish(topic, message, SENSOR)
        time.sleep(0.1)
        return is_done() or None

    wait_for(f"effect of {topic}", check)


def reported(server: Server, session_id: str, made: int) -> list[dict[str, Any]]:
    """The results in the log, once there are so many; never more."""
    results = wait_for(f"result {made}", lambda: (got := server.results(session_id)) and len(got) >= made and got)
    assert len(results) == made, results
    return results


def touch(robot: Robot, heard: Heard, server: Server, session_id: str, made: int) -> int:
    """One approach; its place, wrench and candidate must be in the log."""
    candidate = heard.at(2 + made).candidates[0]
    hit = robot.touch(candidate)
    if not hit:
        assert robot.call("no_contact", ros.TriggerRequest, ros.TriggerResponse).success
    result = reported(server, session_id, made + 1)[-1]["contact_result"]
    assert (result["candidate_id"], result["robot_id"]) == (candidate.candidate_id, "arm-1")
    if not hit:
        assert np.array_equal(numbers(result["no_contact"]["swept_from"]), numbers(candidate.probe_start))
        return 1
    contact = result["contact"]
    at = numbers(contact["sensor_pose"]["position"])
    # One step of the robot is half a millimetre, and it stands still while it presses.
    assert abs(np.linalg.norm(at - CENTER) - RADIUS) < 0.001, at
    # What it went through since it was in front of the surface is free.
    swept = numbers(contact["swept_from"])
    assert np.linalg.norm(swept - numbers(candidate.probe_start)) < 0.004, (swept, candidate.probe_start)
    force, rest = numbers(contact["wrench"]["force"]), numbers(contact["rest_wrench"]["force"])
    assert abs((force - rest)[2] + 3.0) < 0.1 and np.abs((force - rest)[:2]).max() < 0.1, (force, rest)
    # The weight at the sensor, turned by a quarter into the pad's frame, and its torque about the pad's face.
    assert np.allclose(rest, [0.3, 0.4, 1.5], atol=0.02), rest
    torque = numbers(contact["rest_wrench"]["torque"])
    assert np.allclose(torque, np.cross([0.0, 0.0, -BEHIND_M], rest), atol=1e-3), torque
    return 1


def contacts(robot: Robot, heard: Heard, server: Server, made: int) -> int:
    wrench = ros.Wrench(ros.Vector3(0.0, 0.0, -2.0))
    candidate = heard.at(2 + made).candidates[1]
    down = candidate.tool_pose.orientation
    on_surface = CENTER + RADIUS * numbers(candidate.normal)
    contact = ros.Contact(robot.header("/base"), candidate_id=candidate.candidate_id, has_wrench=True, wrench=wrench)
    contact.has_pose, contact.pose = True, ros.Pose(ros.Point(*on_surface), down)
    contact.has_sweep, contact.swept_from = True, candidate.probe_start
    robot.publish("/lab/contact", contact)
    result = reported(server, "ball-1", made + 1)[-1]["contact_result"]
    assert result["candidate_id"] == candidate.candidate_id
    assert np.allclose(numbers(result["contact"]["sensor_pose"]["position"]), on_surface, atol=1e-12)
    assert np.array_equal(numbers(result["contact"]["swept_from"]), numbers(candidate.probe_start))

    heard.at(3 + made)
    robot.pose = ros.Pose(ros.Point(*(CENTER + [0.0, 0.0, RADIUS])), ros.Quaternion(1.0, 0.0, 0.0, 0.0))
    time.sleep(0.1)
    # From the camera's frame, with an uncertainty of its own, and no candidate; the pose is that of TF.
    free = ros.Contact(robot.header(""), candidate_id="none", has_uncertainty=True, uncertainty=0.1)
    robot.publish("/lab/contact", free)
    result = reported(server, "ball-1", made + 2)[-1]["contact_result"]
    assert "candidate_id" not in result or result["candidate_id"] == "", result
    assert np.allclose(numbers(result["contact"]["sensor_pose"]["position"]), CENTER + [0.0, 0.0, RADIUS], atol=1e-9)
    assert result["contact"]["uncertainty"] == 0.1

    robot.publish("/lab/contact", ros.Contact(robot.header(""), kind=7))
    heard.says("contact", 2, "topic contact", "kind is 7")
    robot.publish("/lab/contact", ros.Contact(robot.header("")))
    heard.says("contact", 2, "has_wrench", "has_uncertainty")
    future = ros.Contact(robot.header(""), has_uncertainty=True)
    future.header.stamp.sec += 100
    robot.publish("/lab/contact", future)
    heard.says("contact", 2, "later than the last transform")
    return 2


def services(robot: Robot, heard: Heard, server: Server, made: int) -> int:
    # What was claimed by contacts that were wrong is open again with the next proposal of another candidate.
    candidate = heard.at(2 + made).candidates[0]
    rejected = robot.call(
        "reject", ros.RejectRequest, ros.RejectResponse, candidate_id=candidate.candidate_id, reason=1, detail="behind the wall"
    )
    assert rejected.success and rejected.revision == 3 + made, rejected
    result = reported(server, "ball-1", made + 1)[-1]["contact_result"]
    assert result["rejected"] == {"reason": "REJECT_REASON_NO_IK", "detail": "behind the wall"}, result
    assert robot.call("reject", ros.RejectRequest, ros.RejectResponse, reason=9).success is False
    proposed = robot.call("propose", ros.ProposeRequest, ros.ProposeResponse, top_k=2)
    assert proposed.success and proposed.revision == 3 + made, proposed
    expected = server.session("ball-1", "/candidates", {"top_k": 2, "robot": {"robot_id": "arm-1"}})["candidates"]
    ids = [one["candidate_id"] for one in expected]
    wait_for("two candidates", lambda: [one.candidate_id for one in heard.details.get().candidates] == ids or None)
    assert robot.call("propose", ros.ProposeRequest, ros.ProposeResponse).success
    assert robot.call("tare", ros.TriggerRequest, ros.TriggerResponse).success
    heard.says("detector", 0, "listens")
    return 1


def depth_session(robot: Robot, heard: Heard, server: Server) -> None:
    """Another session, made by a service, from a depth image."""
    wrong = robot.call("create", ros.CreateSessionRequest, ros.CreateSessionResponse, config='{"metod": 1}')
    assert not wrong.success and "metod" in wrong.message, wrong
    config = json.dumps({"method": "METHOD_PAPER", "icosphere_subdivisions": 3})
    made = robot.call("create", ros.CreateSessionRequest, ros.CreateSessionResponse, session_id="ball-2", config=config)
    assert made.success and made.session_id == "ball-2", made
    assert server.session("ball-2")["config"]["method"] == "METHOD_PAPER"
    image, info = robot.depth()

    def send() -> Any:
        info.header.stamp = image.header.stamp = robot.now()
        robot.publish("/lab/depth/camera_info", info, SENSOR)
        robot.publish("/lab/depth/image", image, SENSOR)
        time.sleep(0.1)
        return server.session("ball-2")["revision"] == 2 or None

    wait_for("view of a depth image", send)
    compare(server, heard, "ball-2", 2)
    view = server.session("ball-2", "/events")["events"][1]["visual_prior"]
    assert view["depth"]["depth_scale_m"] == 0.001 and view["depth"]["fx"] == 300.0, view["depth"]
    assert np.allclose(numbers(view["depth"]["base_from_camera"]["position"]), [0.5, 0.0, 0.6])
    vertices = np.array(server.session("ball-2", "/mesh?format=json")["vertices"])
    seen = vertices[vertices[:, 2] > CENTER[2] + 0.5 * RADIUS]
    assert np.abs(np.linalg.norm(seen - CENTER, axis=1) - RADIUS).mean() < 0.004, "the ball is not where it is"


if __name__ == "__main__":
    main()
