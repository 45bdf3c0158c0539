#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""event-dataset --profile slurm: a controller and two nodes of Slurm on this machine make the same files as local
jobs, even if the daemon of a node is killed."""

import getpass
import itertools
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time

import scratch  # noqa: F401  first
from gst_eventcamera.pipeline import Gst, Pipeline, quoted

FRAMES = "video/x-raw,format=I420,width=160,height=90"
VIDEOS = [os.path.join(os.environ["SHARED_DATA"], "video", name)
          for name in ("bottles-640x360-30fps.mp4", "cars-768x432-12fps.mp4")]
PROGRAM = os.path.join(os.environ["BUILD"], "pipelines", "event-dataset")
CLIPS = 40 if os.environ.get("SOAK") else 6
RECIPE = """
seed: 3
videos: clips/*.mkv
simulator: eventsim-dvs preset=davis346
parameters: {positive-threshold: {normal: [0.2, 0.03]}}
output: h5
"""
SLURM = """
ClusterName=test
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ports[0]}
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool-%n
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/%n.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SlurmdParameters=config_overrides
SlurmdTimeout=6
MpiDefault=none
NodeName=node1 NodeHostname={host} NodeAddr=127.0.0.1 Port={ports[1]} CPUs=1
NodeName=node2 NodeHostname={host} NodeAddr=127.0.0.1 Port={ports[2]} CPUs=1
PartitionName=all Nodes=ALL Default=YES
"""


def cut_clips(folder):
    """Clips of a dozen frames."""
    for video in VIDEOS:
        with Pipeline(f"filesrc location={quoted(video)} ! decodebin ! videoconvert ! videoscale ! {FRAMES}"
                      " ! appsink name=out sync=false max-buffers=4") as decoder:
            buffers = (sample.get_buffer().copy_deep() for sample in decoder.samples())
            for number in range(CLIPS // len(VIDEOS)):
                write_clip(f"{folder}/{os.path.basename(video)[:4]}-{number:02}.mkv", itertools.islice(buffers, 12))


def write_clip(path, buffers):
    def timed():
        for number, buffer in enumerate(buffers):
            buffer.pts, buffer.dts = number * Gst.SECOND // 25, Gst.CLOCK_TIME_NONE
            yield buffer

    with Pipeline(f"appsrc name=in format=time ! avenc_ffv1 ! matroskamux ! filesink location={quoted(path)}") as encoder:
        encoder.feed("in", f"{FRAMES},framerate=25/1", timed())
        encoder.set_state(Gst.State.PLAYING)
        encoder.wait()


def free_ports(count):
    sockets = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    ports = [one.getsockname()[1] for one in sockets]
    for one in sockets:
        one.close()
    return ports


class Slurm:
    """A cluster on this machine."""

    def __init__(self, folder):
        self._folder = folder
        self._running = {}
        os.makedirs(f"{folder}/state")
        with open(os.open(f"{folder}/key", os.O_CREAT | os.O_WRONLY, 0o600), "wb") as key:
            key.write(os.urandom(1024))
        with open(f"{folder}/slurm.conf", "w", encoding="utf-8") as file:
            file.write(SLURM.format(folder=folder, user=getpass.getuser(), ports=free_ports(3),
                                    host=socket.gethostname().partition(".")[0]))
        os.environ["SLURM_CONF"] = f"{folder}/slurm.conf"
        self._start("munged", "--foreground", "--force", f"--key-file={folder}/key", f"--socket={folder}/munge.socket",
                    f"--pid-file={folder}/munged.pid", f"--log-file={folder}/munged.log", f"--seed-file={folder}/seed")
        self._wait(lambda: os.path.exists(f"{folder}/munge.socket"))
        self._start("slurmctld", "-D")
        for node in ("node1", "node2"):
            self._start("slurmd", "-D", "-N", node, name=node)
        self._wait(lambda: self.states() == {"node1": "idle", "node2": "idle"})

    def _start(self, *command, name=None):
        with open(f"{self._folder}/{name or command[0]}.out", "wb") as log:
            self._running[name or command[0]] = subprocess.Popen(
                command, stdout=log, stderr=log, env={**os.environ, "PATH": os.environ["PATH"] + ":/usr/sbin"})

    def _wait(self, condition):
        deadline = time.monotonic() + 60
        while not condition():
            if time.monotonic() > deadline:
                raise TimeoutError("Slurm does not start: " + self.log("slurmctld") + self.log("node1"))
            time.sleep(0.2)

    def log(self, name):
        with open(f"{self._folder}/{name}.out", encoding="utf-8", errors="replace") as file:
            return file.read()

    def states(self):
        told = subprocess.run(["sinfo", "--noheader", "--Node", "--format=%N %T"], capture_output=True, text=True)
        return dict(line.split() for line in told.stdout.splitlines())

    def kill(self, name, number=signal.SIGKILL):
        self._running[name].send_signal(number)
        self._running.pop(name).wait()

    def stop(self):
        for name in reversed(list(self._running)):
            self.kill(name, signal.SIGTERM)


def hashes(folder):
    with open(f"{folder}/manifest.json", encoding="utf-8") as file:
        return {one["name"]: one["written"]["h5"]["sha256"] for one in json.load(file)["videos"]}


def main(folder, slurm_folder):
    os.mkdir(f"{folder}/clips")
    cut_clips(f"{folder}/clips")
    recipe = f"{folder}/recipe.yaml"
    with open(recipe, "w", encoding="utf-8") as file:
        file.write(RECIPE)
    subprocess.run([PROGRAM, recipe, "--output", f"{folder}/local"], check=True)

    slurm = Slurm(slurm_folder)
    try:
        program = subprocess.Popen([PROGRAM, recipe, "--output", f"{folder}/cluster", "--profile", "slurm"])
        while slurm.states()["node2"] not in ("allocated", "mixed"):
            assert program.poll() is None, "no job ran on node2"
            time.sleep(0.1)
        slurm.kill("node2")
        print("killed the daemon of node2", flush=True)
        assert program.wait() == 0
        assert "not responding" in slurm.log("slurmctld"), slurm.log("slurmctld")
    finally:
        slurm.stop()
    local = hashes(f"{folder}/local")
    assert len(local) == CLIPS
    assert hashes(f"{folder}/cluster") == local
    print(f"the {len(local)} files are the same")


if __name__ == "__main__":
    if not all(map(os.path.exists, VIDEOS)) or not shutil.which("sbatch"):
        print("no videos in ../shared/data, or no Slurm")
        sys.exit(77)
    # The paths of Slurm's own files cannot have blanks.
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory(dir="/tmp") as slurm_scratch:
        main(folder, slurm_scratch)
