"""The generated nodes in C++ against real ROS: Debian's roscpp with rospy, and rcl of the wheels with rclpy."""

from __future__ import annotations

import csv
import random
import re
import shutil
import signal
import struct
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from fusesoc_firm.cli import main
from fusesoc_firm.frame.codec import encode
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.message.library import MessageLibrary, libraries
from fusesoc_firm.message.middleware import middleware_of
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.node.engine.cpp_trace import write_ways
from fusesoc_firm.node.interface.description import describe
from fusesoc_firm.node.transport.built_simulator import build_simulator
from fusesoc_firm.system.system_core import load_system
from tests.applications.images import filtered, image, load_model
from tests.ros.cpp_nodes import Node, Peer, Ros, check_angles, missing_ros, running_ros
from tests.seeds import seeded

REPOSITORY = Path(__file__).parents[2]
SPECS = REPOSITORY / "specs"
ECHO_SIMULATOR = f"pipe:exec {sys.executable} {Path(__file__).with_name('echo_simulator.py')}"
MODEL_SIMULATOR = REPOSITORY / "tests/node/model_simulator.py"
APPLICATIONS = ["quat2euler", "image_pipeline", "multi_type", "mobile_robot", "robotic_arm", "sobel"]
SEED = seeded(20240721)
pytestmark = pytest.mark.check
# A simulator on a machine that does other things, too, comes to rest late.
PATIENT = ("--drain", "100")

# Two topics through which messages of any size go, with no accelerator between.
ECHO = """\
project: {name: echo, width: 64}
blocks:
  - {name: empty_in, middleware: ROS, mode: subscriber, message: std_msgs/Empty, outgoing: [{name: empty_out}]}
  - {name: empty_out, middleware: ROS, mode: publisher, message: std_msgs/Empty}
  - {name: image_in, middleware: ROS, mode: subscriber, message: sensor_msgs/Image,
     maxLength: 8388608, outgoing: [{name: image_out}]}
  - {name: image_out, middleware: ROS, mode: publisher, message: sensor_msgs/Image}
"""


@dataclass
class Workshop:
    """Where nodes of one version of ROS are made, each once."""

    ros: Ros
    folder: Path
    programs: dict[str, Path] = field(default_factory=dict)

    def specification(self, name: str) -> Path:
        """That of an application, in this version of ROS, with all that lies beside it."""
        if name == "echo":
            return self._echo()
        folder = self.folder / "specs" / name
        spec = folder / f"{name}.yaml"
        if not folder.exists():
            shutil.copytree(SPECS / name.removesuffix("_software"), folder)
            self._adapt(spec)
        return spec

    def _echo(self) -> Path:
        spec = self.folder / "specs/echo/echo.yaml"
        spec.parent.mkdir(parents=True, exist_ok=True)
        spec.write_text(ECHO, encoding="utf-8")
        self._adapt(spec)
        return spec

    def _adapt(self, spec: Path) -> None:
        if self.ros.version == 2:
            text = spec.read_text(encoding="utf-8")
            spec.write_text(re.sub(r"\bmiddleware: ROS\b", "middleware: ROS2", text), encoding="utf-8")

    def package(self, name: str) -> Path:
        """The generated package."""
        spec, folder = self.specification(name), self.folder / "nodes" / name
        messages = ["--path", str(spec.parent / "msg")] if (spec.parent / "msg").is_dir() else []
        command = ["system", "node", str(spec), "--language", "cpp", "--ros", str(self.ros.version)]
        assert main([*command, "-o", str(folder), *messages]) == 0
        return folder

    def check(self, name: str) -> None:
        """Compile a node, and drop what comes of it."""
        self.ros.compile(self.package(name), None)

    def program(self, name: str) -> Path:
        """A node that is compiled and linked."""
        if name not in self.programs:
            self.ros.compile(self.package(name), self.folder / name)
            self.programs[name] = self.folder / name
        return self.programs[name]

    def message(self, name: str) -> str:
        """A type as this version of ROS writes it."""
        return name if self.ros.version == 1 else name.replace("/", "/msg/")

    def echo_peer(self) -> Peer:
        """A peer that sends to both of the echo's topics and hears both."""
        empty, image = self.message("std_msgs/Empty"), self.message("sensor_msgs/Image")
        return Peer(self.ros, {"/empty_out": empty, "/image_out": image}, {"/empty_in": empty, "/image_in": image})

    def image(self, size: int, number: int = 0) -> bytes:
        """The payload of an image with so many bytes of noise, whose height is a number to know it by."""
        noise = random.Random(SEED + size).randbytes(size)
        if self.ros.version == 1:
            words = struct.pack("<IIII", 0, 7, 8, 3) + b"cam" + struct.pack("<III", number, size, 4) + b"rgb8"
            return words + struct.pack("<BII", 0, size, size) + noise
        words = struct.pack("<iII", 7, 8, 4) + b"cam\0" + struct.pack("<III", number, size, 5) + b"rgb8\0"
        words += struct.pack("<B", 0) + bytes(2) + struct.pack("<II", size, size)
        return b"\0\1\0\0" + words + noise


def number_of(workshop: Workshop, image: bytes) -> int:
    """The number that an image is known by."""
    return int.from_bytes(image[19:23] if workshop.ros.version == 1 else image[20:24], "little")


def same(workshop: Workshop, one: bytes, other: bytes) -> bool:
    """Whether two payloads are the same image: a publisher of ROS 1 numbers headers, one of ROS 2 may pad.

    rclpy leaves any bytes in the padding before the step.
    """
    if workshop.ros.version == 1:
        return one[4:] == other[4:]
    one, other = (payload[:38] + payload[40:] for payload in (one, other))
    return one == other[: len(one)] and len(other) - len(one) < 4


def simulator(*arguments: object) -> str:
    """The transport to a model that sends every frame back."""
    return f"pipe:PYTHONPATH={REPOSITORY} exec {sys.executable} {MODEL_SIMULATOR} --width 64 " + " ".join(
        map(str, arguments)
    )


def live_simulator(workshop: Workshop, spec: Path, tool: str = "ghdl") -> str:
    """The transport to a simulated system."""
    built = build_simulator(spec, tool, build_root=workshop.folder / "simulators")
    return f"pipe:exec {built.script()}"


ROS1, ROS2 = (
    pytest.param(version, marks=pytest.mark.xdist_group(f"cpp_nodes_{version}"), id=f"ros{version}")
    for version in (1, 2)
)
only_ros1 = pytest.mark.parametrize("workshop", [ROS1], indirect=True)
only_ros2 = pytest.mark.parametrize("workshop", [ROS2], indirect=True)


@pytest.fixture(scope="module", params=[ROS1, ROS2])
def workshop(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Workshop]:
    folder = tmp_path_factory.mktemp(f"ros{request.param}")
    if reason := missing_ros(request.param):
        pytest.skip(reason)
    with running_ros(request.param, folder) as ros:
        yield Workshop(ros, folder)


@pytest.mark.parametrize("name", APPLICATIONS)
def test_the_node_of_every_application_compiles(workshop: Workshop, name: str) -> None:
    workshop.check(name)


def test_quaternions_come_back_as_angles(workshop: Workshop) -> None:
    """The whole: real peers, the node, and the simulated hardware."""
    program = workshop.program("quat2euler")
    transport = live_simulator(workshop, workshop.specification("quat2euler"))
    quaternion, point = (workshop.message(f"geometry_msgs/{name}") for name in ("Quaternion", "Point"))
    prefix = b"" if workshop.ros.version == 1 else b"\0\1\0\0"
    source = random.Random(SEED)
    trace = workshop.folder / "trace.csv"
    with (
        Node(workshop.ros, program, transport, *PATIENT, "--trace", str(trace)) as node,
        Peer(workshop.ros, {"/QuaternionToEuler_pub": point}, {"/QuaternionToEuler_sub": quaternion}) as peer,
    ):
        peer.wait_until_connected()
        for _ in range(20):
            check_angles(peer, source, prefix)
        assert node.stop() == 0
        assert "20 received, 0 dropped, 20 sent, 20 published, 0 errors, 0 restarts" in node.said()
    steps = [line.split(",")[1] for line in trace.read_text(encoding="utf-8").splitlines()[1:]]
    assert {steps.count(step) for step in ("received", "queued", "sent", "taken", "burst", "published")} == {20}
    ways = workshop.folder / "ways.csv"
    spec = workshop.specification("quat2euler")
    write_ways(trace, ways, describe(load_system(spec, libraries([], {}, None))))
    with ways.open(newline="", encoding="utf-8") as file:
        accelerator = [int(row["accelerator_cycles"]) for row in csv.DictReader(file)]
    # Without stalls it takes as long for any quaternion, but for the cycle in which its loop is when one comes.
    assert len(accelerator) == 20 and max(accelerator) - min(accelerator) <= 1


@only_ros1
def test_blocks_in_software_run_beside_the_hardware(workshop: Workshop) -> None:
    """Gray and integral image in hardware, the scaling between them in Python; the topics know nothing of it."""
    spec = workshop.specification("image_pipeline_software")
    model, source = load_model("image_pipeline"), random.Random(SEED)
    name = MessageName("sensor_msgs", "Image")
    frame = frame_of(name, MessageLibrary(middleware_of(1)).closure(name))
    software = f"PYTHONPATH={REPOSITORY} exec {sys.executable} -m fusesoc_firm.node.software_process {spec}"
    program, transport = workshop.program("image_pipeline_software"), live_simulator(workshop, spec)
    with (
        Node(workshop.ros, program, transport, *PATIENT, "--software", software) as node,
        Peer(workshop.ros, {"/sums": "sensor_msgs/Image"}, {"/camera": "sensor_msgs/Image"}) as peer,
    ):
        peer.wait_until_connected()
        sent = [image("ROS", source, height, width, 3) for height, width in ((8, 8), (12, 16), (2, 6))]
        for message in sent:
            peer.publish("/camera", encode(frame, message))
        for message in sent:
            gray = filtered(model, "rgb_to_gray", message)
            expected = encode(frame, filtered(model, "integral_image", filtered(model, "scale_down", gray)))
            assert same(workshop, expected, peer.take()[1])
        assert node.stop() == 0
        assert "its software: 3 received, 0 dropped, 3 sent, 3 published" in node.said()


SIZES = (0, 1, 2, 3, 255, 65_536, 6_220_800)


def test_a_message_of_any_size_goes_through(workshop: Workshop) -> None:
    with Node(workshop.ros, workshop.program("echo"), ECHO_SIMULATOR) as node, workshop.echo_peer() as peer:
        peer.wait_until_connected()
        send_all_sizes(workshop, peer)
        assert node.stop(signal.SIGTERM) == 0


def test_bytes_after_a_message_do_not_reach_the_hardware(workshop: Workshop) -> None:
    if workshop.ros.version == 1:
        pytest.skip("publishers of ROS 1 append nothing")
    trace = workshop.folder / "tails.csv"
    sizes: list[int] = []
    with (
        Node(workshop.ros, workshop.program("echo"), ECHO_SIMULATOR, "--trace", str(trace)) as node,
        workshop.echo_peer() as peer,
    ):
        peer.wait_until_connected()
        for more in (0, 4, 92, 200):
            payload = workshop.image(100, more)
            peer.publish("/image_in", payload + b"\xee" * more, is_raw=True)
            sizes.append(len(payload))
            assert peer.take()[0] == "/image_out"
        assert node.stop() == 0
    rows = csv.DictReader(trace.open(encoding="utf-8"))
    assert [int(row["bytes"]) for row in rows if row["event"] == "sent"] == sizes


@only_ros1
def test_an_image_of_six_megabytes_goes_through_hardware(workshop: Workshop) -> None:
    """Through multi_type, where it is passed on as it comes, beside a topic of no bytes that goes straight through."""
    spec = workshop.specification("multi_type")
    text = re.sub(r",\s*buffer: 230500}", "}", spec.read_text(encoding="utf-8"))
    text = text.replace("maxLength: 230500", "maxLength: 8388608")
    spec.write_text(text + ECHO.partition("blocks:\n")[2].partition("  - {name: image")[0], encoding="utf-8")
    transport = live_simulator(workshop, spec, "verilator")
    with Node(workshop.ros, workshop.program("multi_type"), transport, *PATIENT) as node, workshop.echo_peer() as peer:
        peer.wait_until_connected()
        send_all_sizes(workshop, peer)
        assert node.stop() == 0


def send_all_sizes(workshop: Workshop, peer: Peer) -> None:
    """A message without a byte, and images of growing size, each of which comes back."""
    empty = b"" if workshop.ros.version == 1 else b"\0\1\0\0\0"
    peer.publish("/empty_in", empty)
    topic, payload = peer.take()
    assert topic == "/empty_out" and payload[: len(empty)] == empty
    for size in SIZES:
        image = workshop.image(size)
        peer.publish("/image_in", image)
        topic, payload = peer.take()
        assert topic == "/image_out" and same(workshop, image, payload), size


def test_what_was_taken_is_published_before_the_end(workshop: Workshop) -> None:
    """The simulator needs a while for each frame, so most of them are under way when the signal comes."""
    transport = simulator("--latency", 4000)
    with (
        Node(workshop.ros, workshop.program("echo"), transport, "--depth", "100") as node,
        workshop.echo_peer() as peer,
    ):
        peer.wait_until_connected()
        for number in range(60):
            peer.publish("/image_in", workshop.image(100, number))
        first = number_of(workshop, peer.take()[1])
        assert node.stop() == 0
        counts = re.search(r"(\d+) received, (\d+) dropped, (\d+) sent, (\d+) published", node.said())
        assert counts
        received, dropped, *others = map(int, counts.groups())
        assert (dropped, others) == (0, [received, received])
        assert [first, *(number_of(workshop, peer.take()[1]) for _ in range(received - 1))] == [*range(received)]


def test_a_peer_that_dies_and_comes_back_is_served_again(workshop: Workshop) -> None:
    with Node(workshop.ros, workshop.program("echo"), simulator()) as node:
        for number in range(2):
            with workshop.echo_peer() as peer:
                peer.wait_until_connected()
                image = workshop.image(1000, number)
                peer.publish("/image_in", image)
                assert same(workshop, image, peer.take()[1])
                # One that nobody is there for any more.
                peer.publish("/image_in", workshop.image(500_000))
                peer.kill()
        assert node.stop() == 0


def test_a_simulator_that_is_killed_in_mid_frame_ends_the_node(workshop: Workshop) -> None:
    transport = simulator("--fault", "cut", "--at", 1)
    with Node(workshop.ros, workshop.program("echo"), transport) as node, workshop.echo_peer() as peer:
        peer.wait_until_connected()
        for number in range(2):
            peer.publish("/image_in", workshop.image(1000, number))
        assert node.wait() == 1
        assert "the simulator ended with status 4" in node.said()


def test_a_simulator_that_is_killed_is_started_again_if_asked(workshop: Workshop) -> None:
    """Each one dies when it has taken its third frame, and every third answer is lost with it."""
    transport = simulator("--fault", "kill", "--at", 2)
    with Node(workshop.ros, workshop.program("echo"), transport, "--restart") as node, workshop.echo_peer() as peer:
        peer.wait_until_connected()
        for number in (0, 1, 3, 4, 6, 7):
            if number % 3 == 0 and number:
                peer.publish("/image_in", workshop.image(1000, number - 1))
                node.wait_until_said("the transport is opened again", number // 3)
            peer.publish("/image_in", workshop.image(1000, number))
            assert number_of(workshop, peer.take()[1]) == number
        assert node.stop() == 0
        assert "2 restarts" in node.said()


def test_topics_are_remapped_and_moved_by_ros(workshop: Workshop) -> None:
    arguments = ["image_in:=/camera", "__ns:=/robot"]
    if workshop.ros.version == 2:
        arguments = ["--ros-args", *(word for argument in arguments for word in ("-r", argument))]
    image = workshop.message("sensor_msgs/Image")
    with (
        Node(workshop.ros, workshop.program("echo"), simulator(), *arguments) as node,
        Peer(workshop.ros, {"/robot/image_out": image}, {"/camera": image}) as peer,
    ):
        peer.wait_until_connected()
        peer.publish("/camera", workshop.image(10))
        assert same(workshop, workshop.image(10), peer.take()[1])
        assert node.stop() == 0


def run(workshop: Workshop, program: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """A node that ends by itself."""
    return subprocess.run(
        [program, *arguments], env=workshop.ros.environment, capture_output=True, text=True, check=False
    )


def test_help_names_every_option_and_topic(workshop: Workshop) -> None:
    done = run(workshop, workshop.program("echo"), "--help")
    assert done.returncode == 0 and not done.stderr
    for word in "--transport --depth --overflow --drain --restart --trace empty_in image_out status".split():
        assert word in done.stdout
    assert ("--qos" in done.stdout) == (workshop.ros.version == 2)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "--transport is missing"),
        (["--transport"], "--transport needs a value"),
        (["--transport", "pipe:true", "--depth", "0"], "--depth is '0'; legal: 1 to 999999999"),
        (["--transport", "pipe:true", "--depth", "ten"], "--depth is 'ten'; legal: 1 to 999999999"),
        (["--transport", "pipe:true", "--trace", "/no/such"], "cannot write '/no/such'"),
        (["--transport", "pipe:true", "--overflow", "x"], "--overflow is 'x'; legal: block, drop_newest, drop_oldest"),
        (["--bogus"], "unknown option '--bogus'"),
    ],
)
def test_a_wrong_command_line_is_told(workshop: Workshop, arguments: list[str], message: str) -> None:
    done = run(workshop, workshop.program("echo"), *arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"echo_node: {message}; see --help\n"


def test_an_address_that_is_none_ends_the_node(workshop: Workshop) -> None:
    done = run(workshop, workshop.program("echo"), "--transport", "carrier:pigeon")
    assert done.returncode == 1
    assert "the transport is 'carrier:pigeon'; legal: pipe:COMMAND, uart:" in done.stderr


@only_ros1
def test_a_node_waits_for_its_master(workshop: Workshop) -> None:
    environment = {**workshop.ros.environment, "ROS_MASTER_URI": "http://127.0.0.1:9"}
    lonely = Ros(1, workshop.ros.python, (), (), environment)
    with Node(lonely, workshop.program("echo"), simulator()) as node:
        node.wait_until_said("waiting for a master at http://127.0.0.1:9")
        assert node.stop() == 0


@only_ros2
def test_a_message_that_is_not_installed_is_named(workshop: Workshop) -> None:
    done = run(workshop, workshop.program("robotic_arm"), "--transport", simulator())
    assert done.returncode == 1
    assert "the message robotic_arm/msg/ArmPoses of poses is not installed" in done.stderr


@only_ros2
def test_a_message_that_is_installed_with_another_definition_is_refused(workshop: Workshop) -> None:
    package = workshop.folder / "other"
    shutil.copytree(workshop.package("echo"), package)
    source = package / "src/echo_node.cpp"
    text = source.read_text(encoding="utf-8")
    source.write_text(re.sub(r"RIHS01_\w{4}", "RIHS01_beef", text), encoding="utf-8")
    program = workshop.folder / "other_node"
    workshop.ros.compile(package, program)
    done = run(workshop, program, "--transport", simulator())
    assert done.returncode == 1
    assert "is installed in a version that differs from the hardware's (RIHS01_beef" in done.stderr
