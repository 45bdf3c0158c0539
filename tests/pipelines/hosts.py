# SPDX-License-Identifier: LGPL-2.1-or-later
"""Hosts of a test: processes in network namespaces, connected by veth pairs to a switch that records all frames.
The namespaces end with their processes, and the processes with the test, however it ends."""
import ctypes
import fcntl
import multiprocessing
import os
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

SKIPPED = 77  # exit status that Meson knows
MAX_HOSTS = 2
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
        self._process = fork.Process(target=self._run, args=(theirs, number, work, arguments))
        self._process.start()
        theirs.close()
        self._answer()
        network.switch.connect(number, self._process.pid)
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
    def _run(cls, connection, number, work, arguments):
        end_with_parent()
        unshare_network()
        connection.send(None)
        connection.recv()
        ip("link set lo up")
        ip("link set eth0 up")
        ip(f"address add {cls.address(number)}/24 dev eth0")
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


class Switch:
    def __init__(self):
        self.frames = []  # (time, bytes), as sent
        self._ports = {}  # by MAC address
        self._stopped, self._stop = os.pipe()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def connect(self, number, pid):
        mac = mac_address(number)
        ip(f"link add port{number} type veth peer name eth0 address {mac} netns {pid}")
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
            for port in select.select(sources, [], [])[0]:
                if port == self._stopped:
                    return
                frame, (_, _, kind, *_) = port.recvfrom(1 << 16)
                if kind != socket.PACKET_OUTGOING:
                    self._forward(frame, port)

    def _forward(self, frame, source):
        self.frames.append((time.time(), frame))
        is_group = frame[0] & 1
        for mac, port in self._ports.items():
            if port is not source and (is_group or mac == frame[:6]):
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

    def __init__(self, *hosts):
        unshare_network()
        self.switch = Switch()
        self.hosts = [Host(self, number, *host) for number, host in enumerate(hosts, 1)]
        self.switch.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.switch.stop()
        for host in self.hosts:
            host.end()


def run(case):
    """Runs a function without arguments in a namespace of its own; ends the program if it fails."""
    enter_namespace()
    case()
