#!/usr/bin/env python3
"""The recipe for Franka in docs/recipes.md, as it is printed: `recipe.py PALPATE PALPATE_ROS2 COMMANDS PARAMETERS PROGRAM`.

The bridge and all topics and services of Palpate are real, over Cyclone DDS; what stands in is rclpy, as far as the program
uses it, and MoveIt with the arm behind it, which goes six times as fast as it is asked to.
"""

from __future__ import annotations

import os
import random
import runpy
import shlex
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import ros_messages as ros
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from robot import CAMERA, CENTER, LATCHED, LIVE, RADIUS, RELIABLE, SENSOR, Robot, matrix, wait_for
from round_trip import Server, numbers

FASTER = 6.0
PAD_M = 0.05  # in front of the flange
STIFFNESS = 4000.0  # N/m
WRENCH = "/franka_robot_state_broadcaster/external_wrench_in_stiffness_frame"
OUT_OF_REACH_X = 0.54


class Franka(Robot):
    """The arm with its camera. `pose` is that of the flange, and it feels the ball by itself."""

    def __init__(self, domain: int) -> None:
        self.dds, self.namespace, self.writers = DomainParticipant(domain), "", {}
        down = ros.Quaternion(1.0, 0.0, 0.0, 0.0)
        self.pose = ros.Pose(ros.Point(0.3, 0.0, 0.5), down)
        static = [
            self.link("fr3_link0", "camera", ros.Vector3(*CAMERA), down),
            self.link("fr3_link8", "pad", ros.Vector3(0.0, 0.0, PAD_M), ros.Quaternion()),
        ]
        late = Policy.DurabilityService(0, Policy.History.KeepLast(10), -1, -1, -1)
        keep = Qos(RELIABLE, Policy.Durability.TransientLocal, Policy.History.KeepLast(10), late)
        self.publish("/tf_static", ros.TFMessage(static), keep)
        self.stopped = threading.Event()
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def force_n(self, pose: ros.Pose) -> float:
        """By which the ball pushes the pad back."""
        pad = numbers(pose.position) + PAD_M * matrix(pose.orientation)[:, 2]
        return STIFFNESS * max(0.0, RADIUS - float(np.linalg.norm(pad - CENTER)))

    def run(self) -> None:
        noise = np.random.default_rng(1)
        while not self.stopped.wait(0.005):
            pose = self.pose
            moved = self.link("fr3_link0", "fr3_link8", ros.Vector3(*numbers(pose.position)), pose.orientation)
            self.publish("/tf", ros.TFMessage([moved]))
            # What the robot exerts, with an offset as its model of itself has one.
            x, y, z = np.array([0.5, -0.4, 1.0 + self.force_n(pose)]) + noise.normal(0.0, 0.1, 3)
            header = ros.Header(moved.header.stamp, "fr3_link8")
            self.publish(WRENCH, ros.WrenchStamped(header, ros.Wrench(ros.Vector3(x, y, z), ros.Vector3())), SENSOR)


class Future:
    """Of something that another thread does."""

    def __init__(self, work: Callable[[], Any]) -> None:
        self.value: Any = None
        self.thread = threading.Thread(target=self._run, args=(work,), daemon=True)
        self.thread.start()

    def _run(self, work: Callable[[], Any]) -> None:
        self.value = work()

    def done(self) -> bool:
        return not self.thread.is_alive()

    def result(self) -> Any:
        self.thread.join()
        return self.value


class Goal:
    """A trajectory that is carried out."""

    def __init__(self, arm: Franka, trajectory: Any) -> None:
        self.arm, self.points, self.cancelled = arm, trajectory.joint_trajectory.points, threading.Event()
        self.future = Future(self._move)

    def _move(self) -> Any:
        begun, at, done = time.monotonic(), 0.0, self.arm.pose
        for point in self.points:
            till = (point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec) / FASTER
            while (now := time.monotonic() - begun) < till:
                if self.cancelled.wait(0.002):
                    return self._ended(1)
                pose = between(done, point.pose, min(1.0, (now - at) / (till - at)))
                # Franka stops by itself where it meets much.
                if self.arm.force_n(pose) > 30.0:
                    return self._ended(-4)
                self.arm.pose = pose
            at, done = till, point.pose
        self.arm.pose = done
        return self._ended(1)

    @staticmethod
    def _ended(code: int) -> Any:
        return SimpleNamespace(result=SimpleNamespace(error_code=SimpleNamespace(val=code)))

    def get_result_async(self) -> Future:
        return self.future

    def cancel_goal_async(self) -> Future:
        self.cancelled.set()
        return Future(lambda: None)


def between(a: ros.Pose, b: ros.Pose, share: float) -> ros.Pose:
    """A pose on the straight way from one to another."""
    position = (1 - share) * numbers(a.position) + share * numbers(b.position)
    one, other = (np.array([q.x, q.y, q.z, q.w]) for q in (a.orientation, b.orientation))
    turn = (1 - share) * one + share * (other if one @ other >= 0 else -other)
    return ros.Pose(ros.Point(*position), ros.Quaternion(*(turn / np.linalg.norm(turn))))


def cartesian_path(arm: Franka, request: Any) -> Any:
    """As MoveIt plans: a point for each `max_step`, at a metre a second."""
    assert (request.group_name, request.link_name, request.header.frame_id) == ("fr3_arm", "fr3_link8", "fr3_link0")
    points, at, seconds = [], arm.pose, 0.0
    for goal in request.waypoints:
        if goal.position.x > OUT_OF_REACH_X:
            return SimpleNamespace(fraction=0.5, solution=None)
        way = numbers(goal.position) - numbers(at.position)
        steps = max(2, int(np.linalg.norm(way) / request.max_step))
        for step in range(1, steps + 1):
            seconds += float(np.linalg.norm(way)) / steps
            stamp = SimpleNamespace(sec=int(seconds), nanosec=int(1e9 * (seconds % 1)))
            points.append(SimpleNamespace(time_from_start=stamp, velocities=[0.1] * 7, accelerations=[0.0] * 7, pose=between(at, goal, step / steps)))
        at = goal
    return SimpleNamespace(fraction=1.0, solution=SimpleNamespace(joint_trajectory=SimpleNamespace(points=points)))


class Client:
    """Of a service: those of the bridge go over DDS, that of MoveIt is the stand-in."""

    def __init__(self, arm: Franka, kind: Any, name: str) -> None:
        self.arm, self.kind, self.name = arm, kind, name

    def call_async(self, request: Any) -> Future:
        if self.name == "/compute_cartesian_path":
            return Future(lambda: cartesian_path(self.arm, request))
        service = self.name.removeprefix("/palpate/")
        return Future(lambda: self.arm.call(service, self.kind.request, self.kind.reply, **vars(request)))


class Node:
    """As far as the program uses it."""

    def __init__(self, arm: Franka) -> None:
        self.arm, self.listeners = arm, []

    def create_subscription(self, kind: type, topic: str, heard: Callable[[Any], None], qos: Any) -> None:
        self.listeners.append((self.arm.listen(topic, kind, qos), heard))

    def create_client(self, kind: Any, name: str) -> Client:
        return Client(self.arm, kind, name)

    def spin(self, seconds: float) -> None:
        for listener, heard in self.listeners:
            for message in listener.reader.take(100):
                heard(message)
        time.sleep(seconds)


class Duration:
    def __init__(self, seconds: float) -> None:
        self.nanoseconds = round(1e9 * seconds)

    @classmethod
    def from_msg(cls, message: Any) -> Duration:
        return cls(message.sec + 1e-9 * message.nanosec)

    def to_msg(self) -> Any:
        return SimpleNamespace(sec=self.nanoseconds // 10**9, nanosec=self.nanoseconds % 10**9)


def install(arm: Franka) -> None:
    """What the program imports."""

    def module(name: str, **content: Any) -> None:
        sys.modules[name] = ModuleType(name)
        vars(sys.modules[name]).update(content)

    class Request(SimpleNamespace):
        NO_IK = 1

        def __init__(self, **fields: Any) -> None:
            super().__init__(**fields)

    class PathRequest(Request):
        def __init__(self, **fields: Any) -> None:
            super().__init__(header=ros.Header(), **fields)

    def service(request: type, reply: type) -> Any:
        return SimpleNamespace(Request=Request, request=request, reply=reply)

    def spin_until(node: Node, future: Future) -> None:
        while not future.done():
            node.spin(0.005)

    class ActionClient:
        def __init__(self, node: Node, kind: Any, name: str) -> None:
            assert name == "/execute_trajectory"

        def send_goal_async(self, goal: Any) -> Future:
            return Future(lambda: Goal(arm, goal.trajectory))

    module(
        "rclpy",
        init=lambda: None,
        create_node=lambda name: Node(arm),
        spin_once=lambda node, timeout_sec: node.spin(timeout_sec),
        spin_until_future_complete=spin_until,
    )
    module("rclpy.action", ActionClient=ActionClient)
    module("rclpy.duration", Duration=Duration)
    module(
        "rclpy.qos",
        DurabilityPolicy=SimpleNamespace(TRANSIENT_LOCAL=LATCHED),
        QoSProfile=lambda depth, durability: durability,
        qos_profile_sensor_data=SENSOR,
    )
    for package in ("geometry_msgs", "moveit_msgs", "palpate_msgs", "std_srvs"):
        module(package)
    module("geometry_msgs.msg", WrenchStamped=ros.WrenchStamped)
    module("moveit_msgs.action", ExecuteTrajectory=SimpleNamespace(Goal=lambda trajectory: SimpleNamespace(trajectory=trajectory)))
    module("moveit_msgs.srv", GetCartesianPath=SimpleNamespace(Request=PathRequest))
    module("palpate_msgs.msg", Candidates=ros.Candidates)
    module("palpate_msgs.srv", Reject=service(ros.RejectRequest, ros.RejectResponse))
    module("std_srvs.srv", Trigger=service(ros.TriggerRequest, ros.TriggerResponse))


def main() -> None:
    palpate, bridge_program, commands, parameters, program = sys.argv[1:]
    folder = Path(tempfile.mkdtemp())
    domain = random.randint(1, 100)
    server = Server(palpate, folder)
    (folder / "franka.yaml").write_text(Path(parameters).read_text())
    # The bridge as the page starts it, and beside that where the server is and when it is enough.
    lines = Path(commands).read_text().replace("\\\n", " ").splitlines()
    command = next(shlex.split(line) for line in lines if line.startswith("palpate-ros2 "))
    more = ["-p", f"server:=http://{server.address}", "-p", "rmw:=rmw_cyclonedds_cpp", "-p", "session_id:=franka"]
    more += ["-p", "config.stop.max_attempts:=9"]
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain)}
    log = open(folder / "bridge.log", "wb")
    bridge = subprocess.Popen([bridge_program, *command[1:], *more], cwd=folder, env=environment, stderr=log)
    arm = Franka(domain)
    try:
        install(arm)

        def seen() -> Any:
            cloud = arm.cloud()
            arm.publish("/camera/depth/color/points", cloud, SENSOR)
            time.sleep(0.1)
            try:
                return server.session("franka")["revision"] >= 2
            except OSError:
                return None

        wait_for("view", seen)
        runpy.run_path(program, run_name="__main__")
        check([event["contact_result"] for event in server.results("franka")])
    except BaseException:
        for name in ("bridge.log", "server.log"):
            sys.stderr.write(f"--- {name}\n" + (folder / name).read_text()[-6000:])
        raise
    finally:
        arm.stop()
        bridge.kill()
        server.kill()


def check(results: list[Any]) -> None:
    """What is in the log is what the arm did."""
    assert len(results) == 9, results
    contacts = [result["contact"] for result in results if "contact" in result]
    assert len(contacts) >= 3, results
    for contact in contacts:
        # The bridge saw the pad where the ball is; the force rose while it went on.
        assert abs(np.linalg.norm(numbers(contact["sensor_pose"]["position"]) - CENTER) - RADIUS) < 0.002, contact
        force = numbers(contact["wrench"]["force"]) - numbers(contact["rest_wrench"]["force"])
        assert force[2] < -2.5, contact
    kinds = [next(kind for kind in ("contact", "no_contact", "rejected") if kind in result) for result in results]
    print(f"the recipe for Franka: {', '.join(kinds)}")


if __name__ == "__main__":
    main()
