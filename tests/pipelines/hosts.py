# SPDX-License-Identifier: LGPL-2.1-or-later
"""Hosts of a test: processes in network namespaces of their own, connected by veth pairs to a switch
that loses, duplicates and delays packets like tc's netem, but with a seed, and on every kernel.
The namespaces end with their processes, and these with the test, however it ends."""
import ctypes
import fcntl
import heapq
import multiprocessing.connection
import os
import random
import select
import shutil
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
import traceback
from dataclasses import dataclass

SKIPPED = 77  # exit status that Meson knows
MAX_HOSTS = 3
libc = ctypes.CDLL(None, use_errno=True)
fork = multiprocessing.get_context("fork")


def enter_namespace():
    """Starts the program again as root of a user and network namespace, or ends it as skipped."""
    unshare = [shutil.which("unshare") or "unshare", "--map-root-user", "--net"]
    if "IN_NAMESPACE" in os.environ:
        return
    try:
        subprocess.run([*unshare, "ip", "link", "add", "port", "type", "veth"],
                       check=True, capture_output=True, text=True)
    except (OSError, subprocess.CalledProcessError) as cause:
        print(f"Skipped: cannot make network namespaces with veth: {cause} {getattr(cause, 'stderr', '')}")
        sys.exit(SKIPPED)
    os.execve(unshare[0], [*unshare, sys.executable, *sys.argv], {**os.environ, "IN_NAMESPACE": "1"})


def end_with_parent():
    pr_set_pdeathsig = 1
    libc.prctl(pr_set_pdeathsig, signal.SIGKILL)


def unshare_network():
    clone_newnet = 0x40000000
    if libc.unshare(clone_newnet) != 0:
        raise OSError(ctypes.get_errno(), "unshare")


def ip(arguments):
    subprocess.run(["ip", *arguments.split()], check=True)


def mac_address(host):
    return f"02:00:00:00:00:{host:02x}"


def compute_checksums(interface):
    """Without this, veth leaves them to hardware that does not exist."""
    ethtool, set_tx_checksums = 0x8946, 0x17
    off = ctypes.create_string_buffer(struct.pack("II", set_tx_checksums, 0))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        fcntl.ioctl(any_socket, ethtool, struct.pack("16sP16x", interface.encode(), ctypes.addressof(off)))


class Host:
    """An object in a process on a host. Its methods are called by their names here."""

    def __init__(self, network, number, work, *arguments):
        self._connection, theirs = fork.Pipe()
        self._process = fork.Process(target=self._run, args=(theirs, number, network.mtu, work, arguments))
        self._process.start()
        theirs.close()
        self._answer()
        network.switch.connect(number, self._process.pid, network.mtu)
        self._connection.send(None)
        self._answer()

    @staticmethod
    def address(number):
        return f"10.0.0.{number}"

    def __getattr__(self, method):
        def call(*arguments):
            self._connection.send((method, arguments))
            return self._answer()
        return call

    def end(self):
        self._process.kill()
        self._process.join()

    def _answer(self):
        answer = self._connection.recv()
        if isinstance(answer, Exception):
            raise answer
        return answer

    @classmethod
    def _run(cls, connection, number, mtu, work, arguments):
        end_with_parent()
        unshare_network()
        connection.send(None)
        connection.recv()
        ip("link set lo up")
        ip(f"link set eth0 mtu {mtu} up")
        ip(f"address add {cls.address(number)}/24 dev eth0")
        ip("route add 224.0.0.0/4 dev eth0")
        # Packets do not wait for ARP, whose queue is short, or for the interface.
        for other in range(1, MAX_HOSTS + 1):
            ip(f"neighbour add {cls.address(other)} lladdr {mac_address(other)} dev eth0 nud permanent")
        while " state UP " not in subprocess.run(["ip", "link", "show", "eth0"], check=True, capture_output=True,
                                                 text=True).stdout:
            time.sleep(0.01)
        compute_checksums("eth0")
        worker = work(*arguments)
        connection.send(None)
        while True:
            method, arguments = connection.recv()
            try:
                answer = getattr(worker, method)(*arguments)
            except Exception as cause:  # pylint: disable=broad-except
                traceback.print_exc()
                answer = cause
            connection.send(answer)


@dataclass(frozen=True)
class Conditions:
    """What happens to each UDP packet."""
    loss: float = 0  # probability
    duplication: float = 0  # probability
    delayed: float = 0  # probability of a delay
    delay: float = 0  # maximum, seconds


def is_udp(frame):
    return frame[12:14] == b"\x08\x00" and frame[23] == socket.IPPROTO_UDP


def is_last_fragment(frame):
    more_fragments = 0x20
    return not frame[20] & more_fragments


class Switch:
    def __init__(self, seed):
        self.conditions = Conditions()
        self.packets = self.lost = self.duplicated = self.delayed = 0  # of UDP
        self.datagrams = 0  # whose packets were all forwarded, lost or delayed
        self.frames = []  # (time, bytes), as sent
        self._random = random.Random(seed)
        self._ports = {}  # by MAC address
        self._waiting = []
        self._stopped, self._stop = os.pipe()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def connect(self, number, pid, mtu):
        mac = mac_address(number)
        ip(f"link add port{number} mtu {mtu} type veth peer name eth0 address {mac} netns {pid}")
        ip(f"link set port{number} up")
        port = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(0x0003))
        port.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 24)
        port.bind((f"port{number}", 0))
        self._ports[bytes.fromhex(mac.replace(":", ""))] = port

    def start(self):
        self._thread.start()

    def stop(self):
        os.write(self._stop, b"s")
        self._thread.join()

    def _run(self):
        sources = [self._stopped, *self._ports.values()]
        while True:
            timeout = max(self._waiting[0][0] - time.monotonic(), 0) if self._waiting else None
            for port in select.select(sources, [], [], timeout)[0]:
                if port == self._stopped:
                    return
                frame, (_, _, kind, *_) = port.recvfrom(1 << 16)
                if kind != socket.PACKET_OUTGOING:
                    self._take(frame, port)
            while self._waiting and self._waiting[0][0] <= time.monotonic():
                _, _, frame, port = self._waiting[0]
                self._forward(frame, port)
                heapq.heappop(self._waiting)

    def _take(self, frame, source):
        self.frames.append((time.time(), frame))
        is_group = frame[0] & 1
        for mac, port in self._ports.items():
            if port is not source and (is_group or mac == frame[:6]):
                if is_udp(frame):
                    self._take_udp(frame, port)
                else:
                    self._forward(frame, port)
        if is_udp(frame) and is_last_fragment(frame):
            self.datagrams += 1

    def has_forwarded(self, datagrams):
        """True if it holds none of the first so many UDP datagrams that hosts have sent."""
        return self.datagrams >= datagrams and not self._waiting

    def _take_udp(self, frame, port):
        self.packets += 1
        conditions, happens = self.conditions, self._random.random
        if happens() < conditions.loss:
            self.lost += 1
            return
        copies = 1
        if happens() < conditions.duplication:
            self.duplicated += 1
            copies = 2
        for _ in range(copies):
            if happens() < conditions.delayed:
                self.delayed += 1
                due = time.monotonic() + happens() * conditions.delay
                heapq.heappush(self._waiting, (due, self.delayed, frame, port))
            else:
                self._forward(frame, port)

    @staticmethod
    def _forward(frame, port):
        port.send(frame)

    def write_pcap(self, path):
        """All frames that hosts have sent."""
        ethernet = 1
        with open(path, "wb") as file:
            file.write(struct.pack("=IHHIIII", 0xA1B2C3D4, 2, 4, 0, 0, 1 << 16, ethernet))
            for moment, frame in list(self.frames):
                file.write(struct.pack("=IIII", int(moment), int(moment % 1 * 1e6), len(frame), len(frame)) + frame)


class Network:
    """Hosts 1, 2, ... and their switch, in the process that makes it."""

    def __init__(self, *hosts, mtu=1500, seed=1):
        self.mtu = mtu
        unshare_network()
        self.switch = Switch(seed)
        self.hosts = [Host(self, number, *host) for number, host in enumerate(hosts, 1)]
        self.switch.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.switch.stop()
        for host in self.hosts:
            host.end()


def run(cases, at_once=6):
    """Runs functions without arguments, each in a process of its own; ends the program."""
    def in_child(case):
        end_with_parent()
        start = time.monotonic()
        case()
        print(f"{case.__name__}: {time.monotonic() - start:.1f} s", flush=True)

    enter_namespace()
    waiting, running, failed = list(cases), {}, []
    while waiting or running:
        while waiting and len(running) < at_once:
            case = waiting.pop(0)
            process = fork.Process(target=in_child, args=(case,))
            process.start()
            running[process.sentinel] = process, case
        for sentinel in multiprocessing.connection.wait(running):
            process, case = running.pop(sentinel)
            process.join()
            if process.exitcode != 0:
                failed.append(case.__name__)
    if failed:
        sys.exit(f"Failed: {', '.join(failed)}")
