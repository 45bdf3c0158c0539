# SPDX-License-Identifier: LGPL-2.1-or-later
"""Simulates one video of a data set, and records its hashes, parameters, figures and versions."""
import contextlib
import hashlib
import json
import os
import tempfile

import gst_eventcamera as ec
import numpy as np
from event_streams import samples_of
from gst_eventcamera.dataset import pictures_of
from gst_eventcamera.frames import Frames
from gst_eventcamera.pipeline import EVENT_CAPS, Gst, events_of, utf8_path
from gst_eventcamera.recipe import OUTPUTS, TENSORS
from gst_eventcamera.recordings import WRITERS, buffer_of
from gst_eventcamera.sources import SINK
from gst_eventcamera.tensors import TENSOR_CAPS, tensor_of

# Settings of writers without which the same events give other bytes.
SAME_BYTES = {"h5": "commit-interval=0", "hdf5": "commit-interval=0"}
MAX_KEPT = 16  # arrays of events
# Failures of the machine in any element, such as a full disk; a writer may keep events in TMPDIR.
MACHINE_ERRORS = Gst.ResourceError.NO_SPACE_LEFT, Gst.ResourceError.WRITE, Gst.ResourceError.OPEN_WRITE


class Refused(Exception):
    """A video cannot be simulated, and a retry would not help."""


class NpyFile:
    """A NumPy file of an array that grows along its first axis."""

    def __init__(self, path):
        self._file = open(path, "wb")
        self._first = None
        self._count = 0

    def append(self, tensor):
        if self._first is None:
            self._first = tensor
            self._write_header()
        if (tensor.shape, tensor.dtype) != (self._first.shape, self._first.dtype):
            raise Refused(f"its tensors change from {self._first.shape} to {tensor.shape}")
        self._file.write(tensor.tobytes())
        self._count += 1

    def _write_header(self):
        # NumPy pads the header, so that the first axis may grow.
        np.lib.format.write_array_header_1_0(self._file, {
            "descr": np.lib.format.dtype_to_descr(self._first.dtype), "fortran_order": False,
            "shape": (self._count, *self._first.shape)})

    def close(self):
        if self._first is None:
            raise Refused("too short: it has no tensor")
        self._file.seek(0)
        self._write_header()
        self._file.close()


class Figures:
    """Counts the events of a stream, and keeps a few evenly spaced arrays of it."""

    def __init__(self):
        self.events = self.on = self.chunks = 0
        self.max_rate = 0.0
        self.start = self.end = None
        self._kept, self._spacing = [], 1

    def add(self, chunk):
        if self.chunks % self._spacing == 0:
            self._kept.append(chunk)
        if len(self._kept) > MAX_KEPT:
            del self._kept[1::2]
            self._spacing *= 2
        self.chunks += 1
        self.events += len(chunk)
        self.on += int(np.count_nonzero(chunk["p"]))
        self.start = chunk.start if self.start is None else self.start
        self.end = chunk.end
        if chunk.end > chunk.start:
            self.max_rate = max(self.max_rate, len(chunk) / (chunk.end - chunk.start))

    def busiest(self):
        """The kept array with the most events."""
        return max(self._kept, key=len)

    def described(self, frames):
        duration = self.end - self.start if self.end is not None else 0
        return {"width": self._kept[0].width, "height": self._kept[0].height, "frames": frames,
                "duration": round(duration, 6), "events": self.events, "on-events": self.on,
                "mean-rate": round(self.events / duration) if duration > 0 else 0, "max-rate": round(self.max_rate)}


def hash_of(path):
    """SHA-256 of a file, or of sha256sum's output for a folder of pictures."""
    if os.path.isdir(path):
        lines = "".join(f"{hash_of(picture)}  {os.path.basename(picture)}\n" for picture in pictures_of(path))
        return hashlib.sha256(lines.encode()).hexdigest()
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def state_of(path):
    """Number, sizes and times of files, which change if their content does."""
    files = pictures_of(path) if os.path.isdir(path) else [path]
    found = [os.stat(file) for file in files]
    return [len(found), sum(one.st_size for one in found), max((one.st_mtime_ns for one in found), default=0)]


def making_of(video):
    """Everything besides the input that determines the output."""
    recipe = video.recipe
    making = {"line": video.line, "outputs": list(recipe.outputs)}
    if TENSORS in recipe.outputs:
        making["tensors"] = recipe.tensors
    if recipe.framerate:
        making["framerate"] = str(recipe.framerate)
    if recipe.window:
        making["window"] = [recipe.window.width, recipe.window.height, recipe.window.distance]
    return making


def file_of(name, output):
    """Path of a video's file of events or tensors in a data set."""
    return f"data/{name}.{'npy' if output == TENSORS else output}"


def path_in(folder, file):
    """Path of a file of a data set; creates its folders."""
    path = os.path.join(folder, file)
    os.makedirs(os.path.dirname(path), exist_ok=True)
    return path


def record_of(video, folder, scratch, keep=True):
    """Simulates a video, and returns its record. Its files of events are either complete or missing, even if the
    process is killed; without `keep`, only their hashes are recorded. The folder `scratch` is on the same file system
    as the folder of the data set."""
    if keep:
        remove_events(folder, video.name)
    record = {"name": video.name, "state": state_of(video.path),
              "input": {"path": os.path.relpath(video.path, os.path.dirname(video.recipe.path)),
                        "sha256": hash_of(video.path)},
              "making": making_of(video), "parameters": dict(video.parameters)}
    paths = {output: os.path.join(scratch, output) for output in video.recipe.outputs}
    try:
        figures, picture, warnings, decoders = simulate(video, paths)
    except Refused as reason:
        return record | {"refused": str(reason)}
    except ec.PipelineError as failure:
        if is_of_machine(failure):
            raise
        return record | {"refused": f"corrupt or not supported: {failure}"}
    written = {output: {"path": file_of(video.name, output), "size": os.path.getsize(path), "sha256": hash_of(path)}
               for output, path in paths.items()}
    if keep:
        with open(path_in(folder, f"previews/{video.name}.png"), "wb") as file:
            file.write(picture)
        for output, path in paths.items():
            os.replace(path, path_in(folder, written[output]["path"]))
    return record | {"written": written, "figures": figures, "warnings": warnings,
                     "versions": versions() | {"decoders": decoders}}


def remove_events(folder, name):
    """Removes a video's files of events, in any format."""
    for output in OUTPUTS:
        with contextlib.suppress(FileNotFoundError):
            os.remove(path_in(folder, file_of(name, output)))


def write_record(path, record):
    """Writes all of the record or nothing."""
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with tempfile.NamedTemporaryFile("w", dir=os.path.dirname(path), delete=False, encoding="utf-8") as file:
        json.dump(record, file, indent=1, sort_keys=True)
    os.chmod(file.name, 0o644)
    os.replace(file.name, path)


def writer_of(recipe, output):
    """Elements that write an output; the sink is named "file-" and the output."""
    if output == TENSORS:
        return f"eventtensor {recipe.tensors} ! {TENSOR_CAPS} ! appsink name=file-{TENSORS} sync=false async=false"
    writer = WRITERS["." + output].replace("name=file", f"name=file-{output}")
    return f"{writer} {SAME_BYTES.get(output, '')} async=false"


def simulate(video, paths):
    """Writes the events and tensors of a video to a path for each output. Returns figures, a picture, warnings, and the
    decoders."""
    figures, frames = Figures(), Frames()
    writers = "".join(f" events. ! queue ! {writer_of(video.recipe, output)} " for output in paths)

    # One thread, since there is a job for each processor.
    with video.playing(f"tee name=events ! queue ! {SINK} {writers}", threads=1) as pipeline:
        decoders = decoders_of(pipeline)
        pipeline.gaps_as_buffers()
        frames.watch(pipeline.element("decoded").get_static_pad("sink"))
        array = NpyFile(paths[TENSORS]) if TENSORS in paths else None
        for output in set(paths) - {TENSORS}:
            pipeline.element(f"file-{output}").set_property("location", utf8_path(paths[output]))
        for sample in pipeline.samples():
            figures.add(events_of(sample))
            while array and (tensor := pipeline.element(f"file-{TENSORS}").emit("try-pull-sample", 0)):
                array.append(tensor_of(tensor))
        for tensor in pipeline.samples(f"file-{TENSORS}") if array else ():
            array.append(tensor_of(tensor))
        pipeline.wait()
        duration = pipeline.duration()
    if fault := video.fault(frames, duration):
        raise Refused(fault)
    if figures.chunks == 0:
        raise Refused("too short: nothing is left of it after the filters")
    if array:
        array.close()
    return figures.described(len(frames.times)), picture_of(figures.busiest()), frames.warnings(), sorted(decoders)


def is_of_machine(failure):
    """True if the machine is at fault, not the video."""
    return failure.element.startswith("file-") or (failure.error is not None and any(
        failure.error.matches(Gst.ResourceError.quark(), code) for code in MACHINE_ERRORS))


def decoders_of(pipeline):
    """A set to which the decoders of a pipeline are added as it starts."""
    decoders = set()

    def note(element):
        factory = element.get_factory()
        if factory and "Decoder" in factory.get_metadata("klass"):
            decoders.add(f"{factory.get_name()} {factory.get_plugin().get_version()}")

    pipeline.on_element(note)
    return decoders


def versions():
    plugin = Gst.Registry.get().find_plugin("eventsim")
    return {"eventsim": plugin.get_version() if plugin else "", "gstreamer": Gst.version_string()}


def picture_of(events):
    """Events drawn as a PNG."""
    start, end = round(1e6 * events.start), round(1e6 * events.end)
    picture, = samples_of(
        "appsrc name=events format=time ! eventrender ! video/x-raw,format=RGB,framerate=0/1 ! pngenc"
        " ! appsink name=out sync=false",
        [("events", f"{EVENT_CAPS},width={events.width},height={events.height},framerate=0/1",
          [buffer_of(events, start, end - start)])])
    return picture.get_buffer().extract_dup(0, picture.get_buffer().get_size())
