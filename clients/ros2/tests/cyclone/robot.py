"""A robot that speaks ROS 2 by Cyclone DDS: a camera, an arm with a force-torque sensor behind its pad, and a ball."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import ros_messages as ros
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

CENTER, RADIUS = np.array([0.5, 0.0, 0.1]), 0.04
CAMERA = np.array([0.5, 0.0, 0.6])
# The sensor sits 30 mm behind the pad's face and is turned by a quarter about the pad's axis.
BEHIND_M, WEIGHT_N = 0.03, np.array([0.4, -0.3, 1.5])

RELIABLE = Policy.Reliability.Reliable(duration(seconds=1))
LIVE = Qos(RELIABLE, Policy.Durability.Volatile, Policy.History.KeepLast(200))
LATCHED = Qos(RELIABLE, Policy.Durability.TransientLocal, Policy.History.KeepLast(1))
SENSOR = Qos(Policy.Reliability.BestEffort, Policy.Durability.Volatile, Policy.History.KeepLast(200))


def wait_for(what: str, check: Callable[[], Any], seconds: float = 60.0) -> Any:
    """What `check` gives as soon as it is something."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if found := check():
            return found
        time.sleep(0.02)
    raise SystemExit(f"in {seconds:.0f} s there was no {what}")


def matrix(q: ros.Quaternion) -> np.ndarray:
    """The rotation of a quaternion."""
    x, y, z, w = q.x, q.y, q.z, q.w
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


class Robot:
    """Publishes TF and wrenches at 100 Hz from a thread of its own; `press` is the force along the pad's axis."""

    def __init__(self, domain: int, namespace: str) -> None:
        self.dds = DomainParticipant(domain)
        self.namespace = namespace
        self.writers: dict[str, DataWriter] = {}
        self.pose, self.press_n = ros.Pose(ros.Point(0.2, 0.0, 0.5), ros.Quaternion(1.0, 0.0, 0.0, 0.0)), 0.0
        # Twice, the second time in a message of its own, as two static publishers do.
        down = ros.Quaternion(1.0, 0.0, 0.0, 0.0)
        self.static = [
            self.link("base", "camera", ros.Vector3(*CAMERA), down),
            self.link("pad", "/ft_sensor", ros.Vector3(0.0, 0.0, -BEHIND_M), ros.Quaternion(0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))),
        ]
        # As rmw_cyclonedds_cpp has it: what late readers get is bounded apart from the history.
        late = Policy.DurabilityService(0, Policy.History.KeepLast(10), -1, -1, -1)
        keep = Qos(RELIABLE, Policy.Durability.TransientLocal, Policy.History.KeepLast(10), late)
        for one in self.static:
            self.publish("/tf_static", ros.TFMessage([one]), keep)
        self.stopped = threading.Event()
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    @staticmethod
    def now() -> ros.Time:
        ns = time.time_ns()
        return ros.Time(ns // 1_000_000_000, ns % 1_000_000_000)

    def header(self, frame: str) -> ros.Header:
        return ros.Header(self.now(), frame)

    def link(self, parent: str, child: str, at: ros.Vector3, turned: ros.Quaternion) -> ros.TransformStamped:
        return ros.TransformStamped(self.header(parent), child, ros.Transform(at, turned))

    def publish(self, topic: str, message: Any, qos: Qos = LIVE) -> None:
        if topic not in self.writers:
            self.writers[topic] = DataWriter(self.dds, Topic(self.dds, f"rt{topic}", type(message), qos=qos), qos=qos)
        self.writers[topic].write(message)

    def listen(self, topic: str, kind: type, qos: Qos = LATCHED) -> Listener:
        return Listener(self.dds, f"rt{topic}", kind, qos)

    def run(self) -> None:
        """TF first, so that a wrench finds its pose; the sensor's own weight and noise are on every sample."""
        random = np.random.default_rng(1)
        while not self.stopped.wait(0.01):
            p, q = self.pose.position, self.pose.orientation
            moved = self.link("base", "pad", ros.Vector3(p.x, p.y, p.z), q)
            self.publish("/tf", ros.TFMessage([moved]))
            # In the pad's frame the object pushes against z; the sensor's x is the pad's y.
            x, y, z = WEIGHT_N + random.normal(0.0, 0.02, 3) + np.array([0.0, 0.0, -self.press_n])
            self.publish("/ft/raw", ros.WrenchStamped(moved_header(moved, "ft_sensor"), ros.Wrench(ros.Vector3(x, y, z), ros.Vector3())), SENSOR)

    def touch(self, candidate: ros.Candidate) -> bool:
        """Goes the candidate's way until the ball is touched, presses, and goes back; whether it touched."""
        start, end = (np.array([p.x, p.y, p.z]) for p in (candidate.probe_start, candidate.probe_end))
        self.pose = candidate.tool_pose
        time.sleep(0.1)
        way, touched = end - start, None
        for share in np.linspace(0.0, 1.0, 61):
            at = start + share * way
            if np.linalg.norm(at - CENTER) <= RADIUS:
                touched = at
                break
            self.pose = ros.Pose(ros.Point(*at), candidate.tool_pose.orientation)
            time.sleep(0.01)
        if touched is not None:
            time.sleep(0.05)
            self.press_n = 3.0
            time.sleep(0.15)
            self.press_n = 0.0
            time.sleep(0.05)
        self.pose = ros.Pose(ros.Point(*start), candidate.tool_pose.orientation)
        return touched is not None

    def cloud(self, frame: str = "camera", big: bool = False) -> ros.PointCloud2:
        """What the camera sees of the ball, in its own frame: organised, z first, rows padded, NaN where nothing is."""
        size, rows, columns = (8, 30, 30) if big else (4, 30, 30)
        kind = (">" if big else "<") + ("f8" if big else "f4")
        data = bytearray()
        for row in range(rows):
            for column in range(columns):
                x, y = (np.array([column, row]) - 14.5) * 0.0026
                inside = RADIUS**2 - x * x - y * y
                z = CAMERA[2] - CENTER[2] - math.sqrt(inside) if inside > 1e-5 else math.nan
                data += np.array([z, x if z == z else math.nan, y], dtype=kind).tobytes() + b"\xff" * 4
            data += b"\xee" * 6
        point_step = 3 * size + 4
        fields = [ros.PointField(name, at * size, 8 if big else 7, 1) for at, name in enumerate("zxy")]
        return ros.PointCloud2(self.header(frame), rows, columns, fields, big, point_step, columns * point_step + 6, list(data), False)

    def depth(self) -> tuple[ros.Image, ros.CameraInfo]:
        """The same as a depth image in millimetres, big-endian."""
        width, height, f = 64, 48, 300.0
        values = np.zeros((height, width), dtype=">u2")
        for row in range(height):
            for column in range(width):
                ray = np.array([(column - 31.5) / f, (row - 23.5) / f, 1.0])
                center = np.array([0.0, 0.0, CAMERA[2] - CENTER[2]])
                a, b, c = ray @ ray, ray @ center, center @ center - RADIUS**2
                if (root := b * b - a * c) > 0:
                    values[row, column] = round(1000 * (b - math.sqrt(root)) / a)
        header = self.header("camera")
        k = [f, 0.0, 31.5, 0.0, f, 23.5, 0.0, 0.0, 1.0]
        info = ros.CameraInfo(header, height, width, "plumb_bob", [0.0] * 5, k, [1.0, 0, 0, 0, 1.0, 0, 0, 0, 1.0], [0.0] * 12)
        return ros.Image(header, height, width, "16UC1", 1, 2 * width, list(values.tobytes())), info

    def call(self, service: str, request: Callable[..., Any], reply: type, **fields: Any) -> Any:
        """Calls a service as rmw_cyclonedds_cpp does."""
        qos = Qos(RELIABLE, Policy.Durability.Volatile, Policy.History.KeepLast(10))
        name = f"{self.namespace}/palpate/{service}"
        reader = DataReader(self.dds, Topic(self.dds, f"rr{name}Reply", reply, qos=qos), qos=qos)
        message = request(client=0x1122334455667788, number=time.monotonic_ns(), **fields)
        writer = DataWriter(self.dds, Topic(self.dds, f"rq{name}Request", type(message), qos=qos), qos=qos)
        wait_for(f"service {service}", lambda: writer.get_matched_subscriptions() and reader.get_matched_publications() or None)
        time.sleep(0.2)
        writer.write(message)

        def answer() -> Any:
            return next((one for one in reader.take(10) if (one.client, one.number) == (message.client, message.number)), None)

        return wait_for(f"answer of {service}", answer, 20.0)

    def stop(self) -> None:
        self.stopped.set()
        self.thread.join()


def moved_header(moved: ros.TransformStamped, frame: str) -> ros.Header:
    return ros.Header(moved.header.stamp, frame)


class Listener:
    """Keeps the newest message of a topic."""

    def __init__(self, dds: DomainParticipant, topic: str, kind: type, qos: Qos) -> None:
        self.reader = DataReader(dds, Topic(dds, topic, kind, qos=qos), qos=qos)
        self.newest: Any = None

    def get(self) -> Any:
        for message in self.reader.take(50):
            self.newest = message
        return self.newest
