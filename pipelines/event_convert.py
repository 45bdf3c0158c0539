#!/usr/bin/python3 -B
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Converts recordings of event cameras, videos and pictures. The extension of OUT selects the format.

    event-convert recording.raw recording.h5                     to another format
    event-convert drive.mp4 drive.raw                            simulates the events of a video
    event-convert recording.raw talk.mp4 --speed 0.1 --scale 2   draws a film
    event-convert recording.raw sheet.png --sheet 4x3            draws pictures
    event-convert first.raw second.raw both.raw --join"""
import argparse
import contextlib
import glob
import os
import re
import sys
from fractions import Fraction

# Imported first: it requires the versions.
from event_files import (MAX_SECONDS, Failure, Gst, Interrupt, Misuse, PlayProgress, content_of, events_pad,
                         listed_pictures, parse, play, post_error, reader_of, readers, run, set_option, utf8_path,
                         with_extension_of, writers)
from program import find_elements, find_plugins, option_parser

WRITER_OPTIONS = {"format": "encoding of a .raw or .mcap file, dialect of text, or layout of HDF5",
                  "compression": "compression of an .aedat4, .h5 or .mcap file"}
# The files whose readers have the property.
READER_OPTIONS = {"time-unit": "text, NumPy or HDF5 files", "column-order": "text, NumPy or HDF5 files",
                  "width": "files that may lack a sensor size", "height": "files that may lack a sensor size"}
# Files that are drawn: framerate, and the elements after a picture.
FILMS = {
    # 4:2:0 in the profile high plays everywhere; the index comes first, for browsers.
    ".mp4": (30, "video/x-raw,format=I420 ! x264enc pass=qual quantizer=18 vbv-buf-capacity=0 speed-preset=fast"
                 " ! video/x-h264,profile=high ! mp4mux faststart=true ! filesink name=file"),
    ".webm": (30, "video/x-raw,format=I420 ! vp8enc deadline=1 cpu-used=4 end-usage=cq cq-level=10"
                  " target-bitrate=20000000 ! webmmux ! filesink name=file"),
    ".gif": (25, "video/x-raw,format=RGB ! appsink name=file sync=false"),
    ".png": (30, "video/x-raw,format=RGB ! appsink name=file sync=false"),
}
# Events and frames may be apart by half a second, and a muxer waits for the later of both, for a silent stream until
# it lags by half a second or more. Only files whose times stop advancing reach the limit of bytes.
BOTH = "max-size-buffers=0 max-size-bytes=1073741824 max-size-time=2000000000"


# inputs


def is_pattern(path):
    return glob.has_magic(path) and not os.path.exists(path)


def pictures_of(path, options):
    """The times in nanoseconds and the paths of a pattern of pictures, or of a list of lines "seconds picture"; None if
    the path is something else."""
    if is_pattern(path):
        names = sorted(glob.glob(path), key=lambda name: [
            (int(part), "") if part.isdecimal() else (0, part) for part in re.split(r"(\d+)", name)])
        if not names:
            raise Failure(f"{path}: no picture matches this pattern")
        if not options.framerate:
            raise Misuse(f"{path}: give the pictures a second with --framerate")
        return [(round(i * Gst.SECOND / options.framerate), name) for i, name in enumerate(names)]
    return listed_pictures(path) if os.path.isfile(path) else None


def tracked(buffers, place):
    """Yields buffers, and keeps the seconds since the first one in place[0]."""
    first = None
    for buffer in buffers:
        first = buffer.pts if first is None else first
        place[0] = (buffer.pts - first) / Gst.SECOND
        yield buffer


def buffers_of(pictures, speed):
    for time, path in pictures:
        with open(path, "rb") as file:
            buffer = Gst.Buffer.new_wrapped(file.read())
        buffer.pts = round((time - min(pictures[0][0], 0)) / speed)
        yield buffer


def retime(pad, speed, report=lambda count: None):
    """Makes the frames that leave a pad `speed` times as fast, from time 0 on. report(count) gets their number so far."""
    start, count = None, 0

    def push(pad, info):
        nonlocal start, count
        if info.type & Gst.PadProbeType.BUFFER:
            frame = info.get_buffer()
            timed = frame.copy()  # refers to the same memory
            timed.pts = round((frame.pts - start) / speed)
            if frame.duration != Gst.CLOCK_TIME_NONE:
                timed.duration = round(frame.duration / speed)
            count += 1
            report(count)
            pad.get_peer().chain(timed)
            return Gst.PadProbeReturn.DROP
        event = info.get_event()
        if event.type == Gst.EventType.FLUSH_STOP:
            start, count = None, 0
        if event.type != Gst.EventType.SEGMENT:
            return Gst.PadProbeReturn.OK
        if start is None:  # a later one only has another end
            start = event.parse_segment().start
            segment = Gst.Segment()
            segment.init(Gst.Format.TIME)
            pad.get_peer().send_event(Gst.Event.new_segment(segment))
        return Gst.PadProbeReturn.DROP

    pad.add_probe(Gst.PadProbeType.BUFFER | Gst.PadProbeType.EVENT_DOWNSTREAM | Gst.PadProbeType.EVENT_FLUSH, push)


def recorded(paths, options):
    """Yields the size of the sensor and the seconds of recordings, and then their buffers: one after the other in time,
    or of one backwards with inverted polarity."""
    import gst_eventcamera as ec  # only here, since it takes a quarter of a second
    from gst_eventcamera.recordings import buffer_of

    streams = [ec.stream(path, window=0.1).between(options.start, options.to) for path in paths]
    sizes = [(stream.width, stream.height) for stream in streams]
    yield *map(max, zip(*sizes)), sum(stream.duration for stream in streams)
    end = None
    for stream in streams:
        length = round(stream.duration * 1e6)
        order = reversed(range(len(stream))) if options.reverse else None
        origin = round(next(iter(stream)).start * 1e6)
        shift = 0 if end is None else end - origin
        end = origin + length + shift
        for events in map(stream.__getitem__, order) if order else stream:
            start, stop = round(events.start * 1e6) + shift, min(round(events.end * 1e6) + shift, end)
            events["t"] += shift
            if options.reverse:
                events = events[::-1]
                events["t"] = origin + end - 1 - events["t"]
                events["p"] = ~events["p"]
                start, stop = origin + end - stop, origin + end - start
            if stop > start:
                yield buffer_of(events, start, stop - start)


def is_pipeline(text):
    """True if the text starts with the name of an element, and is no file."""
    words = text.split()
    return bool(words) and not os.path.exists(text) and Gst.ElementFactory.find(words[0]) is not None


def reader_or_fail(path):
    reader = reader_of(path, content_of(path)[1])
    if not reader:
        raise Failure(f"{path} is not a recording of events; convert it to one first")
    return reader


# outputs


class Pictures:
    """Pictures that are drawn, for a GIF or a sheet."""

    def __init__(self, cells):
        try:
            from PIL import Image  # only here, since few conversions need it
        except ImportError:
            raise Failure("pictures need Pillow; on Debian, install: python3-pil") from None
        self._image = Image
        self._cells = cells  # columns and rows of a sheet; None for a GIF
        self._kept, self._spacing, self._count = [], 1, 0

    def add(self, sink):
        """Keeps a picture; for a sheet, only a few evenly spaced ones."""
        sample = sink.emit("pull-sample")
        caps = sample.get_caps().get_structure(0)
        size = caps.get_value("width"), caps.get_value("height")
        buffer = sample.get_buffer()
        if self._count % self._spacing == 0:
            data = buffer.extract_dup(0, buffer.get_size())
            self._kept.append(self._image.frombytes("RGB", size, data, "raw", "RGB", len(data) // size[1]))
        self._count += 1
        if self._cells and len(self._kept) > 8 * self._cells[0] * self._cells[1]:
            del self._kept[1::2]
            self._spacing *= 2
        return Gst.FlowReturn.OK

    def save(self, path):
        if not self._kept:
            raise Failure("there is nothing to draw")
        if self._cells:
            self._sheet().save(path, "PNG")
            return
        first, *others = (picture.quantize(256, dither=self._image.Dither.NONE) for picture in self._kept)
        first.save(path, "GIF", save_all=True, append_images=others,
                   duration=1000 // FILMS[".gif"][0], loop=0)

    def _sheet(self):
        """The pictures in the middle of as many parts of equal length."""
        columns, rows = self._cells
        width, height = self._kept[0].size
        gap = 0 if self._cells == (1, 1) else max(width // 80, 2)
        sheet = self._image.new("RGB", (columns * (width + gap) - gap, rows * (height + gap) - gap), "white")
        for i in range(columns * rows):
            picture = self._kept[(2 * i + 1) * len(self._kept) // (2 * columns * rows)]
            sheet.paste(picture, (i % columns * (width + gap), i // columns * (height + gap)))
        return sheet


def at_rate(rate):
    return f"video/x-raw,framerate={rate.numerator}/{rate.denominator}"


def set_size(pad, info, scale):
    """Sets the size of the output, once the size of the drawn pictures is known; H.264 in 4:2:0 has even sides."""
    caps = info.get_event().parse_caps() if info.get_event().type == Gst.EventType.CAPS else None
    if caps:
        # Halves are rounded up.
        width, height = (max(2, int(caps.get_structure(0).get_value(side) * scale / 2 + Fraction(1, 2)) * 2)
                         for side in ("width", "height"))
        pad.get_parent_element().get_parent().get_by_name("size").set_property("caps", Gst.Caps.from_string(
            f"video/x-raw,width={width},height={height},pixel-aspect-ratio=1/1"))
    return Gst.PadProbeReturn.OK


class Conversion:
    """A pipeline from inputs to a file."""

    def __init__(self, inputs, out, options, interrupt):
        self._inputs, self._options, self._interrupt = inputs, options, interrupt
        self._out = out
        self._count = 0  # pictures drawn
        self._labelled = False
        self._pictures = None
        self._film = next((film for ending, film in FILMS.items() if out.lower().endswith(ending)), None)
        self._writer = writer_of(out) if not self._film else None
        self._readers = []
        self._fed = None
        self._progress = PlayProgress()
        is_drawing = options.scale != 1 or options.sheet != (1, 1) or options.render or options.over_frames
        if self._writer and is_drawing:
            raise Misuse(f"--scale, --sheet, --render and --over-frames apply only to {' '.join(FILMS)} files")
        names = re.findall(r"! (\w+)(?![/\w])", self._film[1]) if self._film else []
        find_elements(names, "gstreamer1.0-plugins-base gstreamer1.0-plugins-good gstreamer1.0-plugins-ugly")
        self._is_still = out.lower().endswith(".png")
        self._pipeline = self._make()
        self._set_up()

    # the pipeline

    def _make(self):
        options = self._options
        path = self._inputs[0]
        if options.join or options.reverse:
            for each in self._inputs:
                reader_or_fail(each)
            buffers = recorded(self._inputs, options)
            width, height, length = next(buffers)
            pipeline = parse(f"appsrc name=source format=time ! queue name=events0 ! {self._rest()}")
            self._feed(pipeline, Gst.Caps.from_string(
                f"application/x-event-camera,format=XYTP,width={width},height={height},framerate=0/1"), buffers, length)
            return pipeline
        if options.merge:
            self._readers = [reader_or_fail(each) for each in self._inputs]
            return parse(f"eventmerge name=merge min-streams={len(self._inputs)} ! {self._rest()} "
                         + " ".join(self._branch(i, f"merge.sink_{i}") for i in range(len(self._inputs))))
        if is_pipeline(path):
            return self._simulated(f"{path} ! decodebin")
        start, caps = (b"", None) if is_pattern(path) else content_of(path)
        if pictures := pictures_of(path, options):
            pipeline = self._simulated("appsrc name=source format=time ! decodebin")
            speed = options.speed if self._writer else 1
            self._feed(pipeline, content_of(pictures[0][1])[1], buffers_of(pictures, speed),
                       (pictures[-1][0] - pictures[0][0]) / Gst.SECOND / float(speed))
            return pipeline
        reader = reader_of(path, caps)
        if reader:
            self._readers = [reader]
            return parse(self._branch(0, self._rest()))
        if start.startswith(b"MATLAB 5.0 MAT-file"):
            raise Failure(f"{path}: files of MATLAB are not read; docs/formats.md has a line that exports them")
        if not caps or not caps.get_structure(0).get_name().startswith(("video/", "image/", "application/")):
            raise Failure(f"{path}: neither its content nor its extension matches a known format; see --help")
        return self._simulated()

    def _feed(self, pipeline, caps, buffers, seconds):
        """Feeds the appsrc `source` with buffers, `seconds` long in all."""
        from gst_eventcamera.pipeline import feed

        self._fed = [0, seconds]
        feed(pipeline.get_by_name("source"), caps, tracked(buffers, self._fed))

    def _simulated(self, source=None):
        """A pipeline that simulates the events of `source`, by default of the video file."""
        from gst_eventcamera.pipeline import expect_limits  # only here, since it takes a quarter of a second
        from gst_eventcamera.video import VideoFile, VideoPipeline

        options = self._options
        expect_limits(options.simulator)
        rest = f"{options.simulator} ! application/x-event-camera ! queue name=events0 {BOTH} ! "
        if options.over_frames:
            rest = f"tee name=t ! queue ! {rest}{self._rest(f't. ! queue name=overlaid {BOTH} !')}"
        else:
            rest += self._rest()
        self._video = VideoPipeline(source, rest) if source else VideoFile(self._inputs[0], rest)
        frames = self._video.element("frames")
        if self._writer and options.speed != 1 and not self._video.element("source"):
            retime(frames.get_static_pad("src"), options.speed)
        return frames.get_parent()

    def _branch(self, i, rest):
        link = "" if self._readers[i].has_pads("events_%u") else "!"
        return f"filesrc name=in{i} ! {self._readers[i].name} name=reader{i} {link} queue name=events{i} ! {rest}"

    def _rest(self, frames=f"queue name=overlaid {BOTH} !"):
        """The elements after the events."""
        options = self._options
        crop = "eventcrop name=crop ! " if options.crop else ""
        if self._writer:
            is_sink = self._writer.factory.list_is_type(Gst.ELEMENT_FACTORY_TYPE_SINK)
            return f"{crop}{self._writer.name} name=writer {self._writer.settings} " + (
                "" if is_sink else "! filesink name=file")
        framerate, encoder = self._film
        rate = f"capsfilter name=rate caps={at_rate(framerate / options.speed)}"
        film = (f"identity name=drawn ! capssetter caps=video/x-raw,framerate={framerate}/1"
                f" ! videoscale name=scale method=nearest-neighbour ! capsfilter name=size ! videoconvert ! {encoder}")
        if options.over_frames:
            if not frames.startswith("t.") and not any(reader.has_pads("video_%u") for reader in self._readers):
                raise Failure(f"{self._inputs[0]} has no frames to draw over; leave out --over-frames")
            return (f"{crop}overlay.event_sink {frames} videoconvert ! videorate ! {rate} ! overlay.video_sink"
                    f" {options.render or 'eventoverlay'} name=overlay ! {film}")
        return f"{crop}{options.render or 'eventrender'} ! {rate} ! {film}"

    def _set_up(self):
        options, pipeline = self._options, self._pipeline
        if self._writer and options.speed != 1 and not pipeline.get_by_name("frames"):
            raise Misuse("--speed applies to films, and to videos whose events are simulated")
        for name, files in READER_OPTIONS.items():
            value = getattr(options, name)
            if value is None:
                continue
            elements = [pipeline.get_by_name(f"reader{i}") for i in range(len(self._readers))]
            if not elements or not all(reader.find_property(name) for reader in elements):
                raise Misuse(f"--{name} applies only to reading {files}")
            for reader in elements:
                set_option(reader, name, value)
        for i in range(len(self._readers)):
            pipeline.get_by_name(f"in{i}").set_property("location", utf8_path(self._inputs[i]))
            reader = pipeline.get_by_name(f"reader{i}")
            if self._readers[i].has_pads("events_%u"):
                reader.connect("no-more-pads", self._link_streams, i)
        for name in WRITER_OPTIONS:
            if (value := getattr(options, name)) is not None:
                writer = pipeline.get_by_name("writer")
                if not writer or not writer.find_property(name):
                    raise Misuse(f"--{name} does not apply to {os.path.splitext(self._out)[1]} files")
                set_option(writer, name, value)
        if options.crop:
            pipeline.get_by_name("crop").get_static_pad("sink").add_probe(
                Gst.PadProbeType.EVENT_DOWNSTREAM, set_crop, options.crop)
        if self._film:
            retime(pipeline.get_by_name("drawn").get_static_pad("src"), options.speed, self._note_count)
            pipeline.get_by_name("scale").get_static_pad("sink").add_probe(
                Gst.PadProbeType.EVENT_DOWNSTREAM, set_size, options.scale)
            sink = pipeline.get_by_name("file")
            if sink.find_property("emit-signals"):
                self._pictures = Pictures(options.sheet if self._is_still else None)
                sink.set_property("emit-signals", True)
                sink.connect("new-sample", self._pictures.add)
        else:
            pipeline.get_by_name("events0").get_static_pad("src").add_probe(
                Gst.PadProbeType.BUFFER, self._look_for_labels)

    def _link_streams(self, reader, i):
        """Links the streams of a file once they are known. Runs in the streaming thread, before data flows."""
        events, video = events_pad(reader), reader.get_static_pad("video_0")
        if not events:
            return
        frames = self._pipeline.get_by_name("overlaid")
        writer = self._pipeline.get_by_name("writer")
        if frames:
            if not video:
                post_error(reader, "The file has no frames to draw over; leave out --over-frames.", "")
                return
            video.link(frames.get_static_pad("sink"))
        # Frames are not cropped, so they would not match the events.
        elif video and writer and not self._options.crop and self._writer.has_pads("video_%u"):
            queue = Gst.parse_bin_from_description(f"queue {BOTH}", True)
            self._pipeline.add(queue)
            queue.get_static_pad("src").link(writer.request_pad_simple("video_0"))
            video.link(queue.get_static_pad("sink"))
            queue.sync_state_with_parent()
        events.link(self._pipeline.get_by_name(f"events{i}").get_static_pad("sink"))

    def _look_for_labels(self, pad, info):
        kind = Gst.Meta.get_info("GstEventCameraLabelMeta")
        self._labelled = self._labelled or bool(kind and info.get_buffer().get_meta(kind.api))
        return Gst.PadProbeReturn.OK

    # running

    def run(self, path):
        """Writes the file, and returns a summary. Raises Failure."""
        options, pipeline = self._options, self._pipeline
        if not self._pictures:
            sink = pipeline.get_by_name("file") or pipeline.get_by_name("writer")
            sink.set_property("location", utf8_path(path))
        is_part = options.start > 0 or options.to is not None
        is_file = not pipeline.get_by_name("source") and not is_pipeline(self._inputs[0])
        if is_part and not (is_file or options.join or options.reverse):
            raise Misuse(f"{self._inputs[0]} cannot be sought, so --from and --to do not apply")
        try:
            play(pipeline, self._show, self._print_message, self._interrupt,
                 self._seek if is_file and (is_part or self._is_still) else None)
            if self._pictures:
                self._pictures.save(path)
            return self._summary(is_part)
        except Failure as failure:
            raise type(failure)(f"{', '.join(self._inputs)}: {failure}") from None
        finally:
            self._progress.clear()
            pipeline.set_state(Gst.State.NULL)

    def _seek(self):
        """Plays only the selected part. Draws pictures at least as often as the sheet needs."""
        options, pipeline = self._options, self._pipeline
        known, duration = pipeline.query_duration(Gst.Format.TIME)
        end = Gst.SECOND * options.to if options.to is not None else None
        if self._is_still and known:
            span = max(min(end or duration, duration) - Gst.SECOND * options.start, 1)
            cells = options.sheet[0] * options.sheet[1]
            rate = max(Fraction(2 * cells * Gst.SECOND, round(span)), FILMS[".png"][0] / options.speed)
            caps = Gst.Caps.from_string(at_rate(rate.limit_denominator(1000)))
            pipeline.get_by_name("rate").set_property("caps", caps)
        # Once, where both branches of events and frames would each seek.
        source = pipeline.get_by_name("frames") or pipeline.get_by_name("merge") or pipeline.get_by_name("reader0")
        if not source.seek(1, Gst.Format.TIME, Gst.SeekFlags.FLUSH | Gst.SeekFlags.ACCURATE, Gst.SeekType.SET,
                             round(options.start * Gst.SECOND), Gst.SeekType.NONE if end is None else Gst.SeekType.SET,
                             round(end or 0)):
            raise Failure("it cannot be sought, so --from and --to do not apply")

    def _position(self):
        """Seconds of the inputs that have been read, and their duration; None if unknown."""
        if self._fed:
            return self._fed
        element = self._pipeline.get_by_name("events0")
        is_at, at = element.query_position(Gst.Format.TIME)
        is_known, duration = element.query_duration(Gst.Format.TIME)
        return (at / Gst.SECOND, duration / Gst.SECOND) if is_at and is_known and duration > 0 else None

    def _events(self):
        return self._pipeline.get_by_name("writer").get_property("stats").get_uint64("events")[1]

    def _show(self):
        place = self._position()
        start, to = self._options.start, self._options.to
        share = None
        if self._fed and place[1] > 0:
            share = place[0] / place[1]
        elif place and (end := min(place[1], to or MAX_SECONDS)) > start:
            share = (place[0] - start) / (end - start)
        self._progress.show(share, f"{self._count} pictures" if self._film else f"{self._events()} events")

    def _print_message(self, text):
        self._progress.clear()
        print(f"{', '.join(self._inputs)}: {text}", file=sys.stderr)

    def _note_count(self, count):
        self._count = count

    def _summary(self, is_part):
        options = self._options
        if self._film:
            cells = options.sheet[0] * options.sheet[1]
            return f"{cells if self._is_still else self._count} pictures"
        events = self._events()
        if events == 0 and (is_part or options.crop) and not self._interrupt:
            place = self._position()
            self._print_message("warning: no events in this part" + (f"; the recording lasts {place[1]:.6g} s" if place else ""))
        written = self._pipeline.get_by_name("writer").get_property("stats")
        skipped = []
        for i in range(len(self._readers)):
            read = self._pipeline.get_by_name(f"reader{i}").get_property("stats")
            for field in "frames", "triggers", "imu-samples":
                count = read.get_uint64(field)[1] - written.get_uint64(field)[1]
                if count > 0:
                    skipped.append(f"{count} {'IMU samples' if field.startswith('imu') else field}")
        if self._labelled and written.get_uint64("labels")[1] == 0:
            skipped.append("labels")
        if skipped:
            self._print_message(f"dropped: {', '.join(skipped)}")
        return f"{events} events"


def set_crop(pad, info, region):
    """Makes an eventcrop keep a region, once the size of the sensor is known. Runs in the streaming thread."""
    if info.get_event().type != Gst.EventType.CAPS:
        return Gst.PadProbeReturn.OK
    crop, (width, height, x, y) = pad.get_parent_element(), region
    sensor = info.get_event().parse_caps().get_structure(0)
    right, bottom = sensor.get_value("width") - x - width, sensor.get_value("height") - y - height
    if right < 0 or bottom < 0:
        post_error(crop, f"The region {width}x{height}+{x}+{y} is not within the sensor.", sensor.to_string())
        return Gst.PadProbeReturn.DROP
    for name, value in {"left": x, "right": right, "top": y, "bottom": bottom}.items():
        crop.set_property(name, value)
    return Gst.PadProbeReturn.OK


# files


def writer_of(path):
    writer = with_extension_of(writers(), path)
    if not writer:
        if reader := with_extension_of(readers(), path):
            raise Misuse(f"{reader.extension} files can only be read")
        known = " ".join(element.extension for element in writers())
        raise Misuse(f"{path}: unknown extension; {' '.join(FILMS)} are drawn, and for events known are {known}")
    return writer


@contextlib.contextmanager
def replacing(path, interrupt):
    """Yields the path of a file next to `path` to write to, so that only a complete file replaces an existing one. A link
    stays; its target is replaced."""
    if os.path.isdir(path):
        raise Misuse(f"{path} is a directory; name a file in it")
    if os.path.exists(path) and not os.path.isfile(path):
        raise Misuse(f"{path} is not a regular file, and would be replaced; name a file")
    target = os.path.realpath(path) if os.path.islink(path) else path
    if os.path.islink(path) and not os.path.exists(target):
        raise Failure(f"{path}: target of the link: No such file or directory")
    for part in [f"{target}.part"] + [f"{target}.part{i}" for i in range(2, 1000)]:
        try:
            open(part, "xb").close()
            break
        except FileExistsError:
            pass
        except OSError as error:
            raise Failure(f"{path} cannot be written: {error.strerror}") from None
    try:
        yield part
    except BaseException:
        os.remove(part)
        raise
    if interrupt and os.path.exists(target):
        raise Failure(f"interrupted: {path} is unchanged; the events so far are in {part}")
    try:
        os.replace(part, target)
    except OSError as error:
        raise Failure(f"{path}: {error.strerror}; the output is in {part}") from None
    if interrupt:
        raise Failure(f"interrupted: {path} has the events so far")


def convert(inputs, out, options, interrupt):
    for path in inputs:
        if os.path.exists(path) and os.path.exists(out) and os.path.samefile(path, out):
            # Writing starts before reading ends.
            raise Misuse(f"{path} and {out} are the same file")
        if path.endswith(".db3") and os.path.exists(f"{path}-wal") and os.path.getsize(f"{path}-wal") > 0:
            print(f"{path}: warning: messages in {path}-wal are not read; run: sqlite3 {path} 'PRAGMA wal_checkpoint'",
                  file=sys.stderr)
    conversion = Conversion(inputs, out, options, interrupt)
    with replacing(out, interrupt) as part:
        written = conversion.run(part)
    print(f"{written} from {', '.join(inputs)} to {out}")


def convert_all(options, interrupt):
    """Converts each input to a file in the output directory; a failure does not stop the others. Returns the exit
    status."""
    outputs = {}
    for path in options.files:
        name = os.path.basename(path)
        if options.extension:
            name = f"{os.path.splitext(name)[0]}.{options.extension.removeprefix('.')}"
        out = os.path.join(options.output_directory, name)
        if out in outputs:
            raise Misuse(f"{outputs[out]} and {path} would both become {out}")
        outputs[out] = path
    try:
        os.makedirs(options.output_directory, exist_ok=True)
    except OSError as error:
        raise Failure(f"{options.output_directory}: {error.strerror}") from None
    status = 0
    for out, path in outputs.items():
        if interrupt:
            break
        try:
            convert([path], out, options, interrupt)
        except RuntimeError as failure:
            print(failure, file=sys.stderr)
            status = max(status, getattr(failure, "status", 1))
    return status


# the program


def seconds(text):
    value = float(text)
    if not 0 <= value < MAX_SECONDS:
        raise argparse.ArgumentTypeError("must be from 0 to less than 1e9 s, and --from less than --to")
    return value


def positive(text):
    value = Fraction(text)
    if not Fraction(1, 10**6) <= value <= 10**6:
        raise argparse.ArgumentTypeError("must be a number from 1e-6 to 1e6")
    return value


def region(text):
    found = re.fullmatch(r"(\d{1,5})x(\d{1,5})\+(\d{1,5})\+(\d{1,5})", text, re.ASCII)
    if not found or "0" in found.group(1, 2):
        raise argparse.ArgumentTypeError("needs WIDTHxHEIGHT+X+Y, such as 320x240+100+50")
    return tuple(map(int, found.groups()))


def cells(text):
    found = re.fullmatch(r"([1-9]\d?)x([1-9]\d?)", text, re.ASCII)
    if not found:
        raise argparse.ArgumentTypeError("needs COLUMNSxROWS, such as 4x3")
    return tuple(map(int, found.groups()))


def formats():
    """Part of --help after the options."""
    lines = ["Formats, by the extension of OUT; IN is recognised by its content:"]
    for writer in writers():
        note = f" ({writer.settings})" if writer.settings else ""
        lines.append(f"  {writer.extension:8} {writer.factory.get_metadata('description')}{note}")
    for reader in readers():
        if not with_extension_of(writers(), reader.extension):
            lines.append(f"  {reader.extension:8} {reader.factory.get_metadata('description')} (read only)")
    lines += ["  .mp4 .webm .gif .png  drawn events", "", "Names that options accept:"]
    for option in [*WRITER_OPTIONS, *READER_OPTIONS]:
        for element in writers() if option in WRITER_OPTIONS else readers():
            spec = element.property(option)
            if hasattr(spec, "enum_class"):
                names = " ".join(value.value_nick for value in spec.enum_class.__enum_values__.values())
                lines.append(f"  --{option}, {element.extension}: {names}")
    lines.append("  --extension, all: " + " ".join(ending[1:] for ending in [
        *(writer.extension for writer in writers()), *FILMS]))
    return "\n".join([*lines, "", "Exit status: 0 = converted, 1 = failed or interrupted, 2 = wrong usage"])


def parse_options():
    parser = option_parser(
        __doc__, prog="event-convert", usage="%(prog)s [OPTION]... IN... OUT", allow_abbrev=False,
        epilog=formats() if {"-h", "--help"} & set(sys.argv) else None)
    add = parser.add_argument
    add("files", nargs="*", metavar="IN... OUT",
        help="IN: a recording, a video, a quoted pattern of pictures, a text file of lines \"seconds picture\", or a"
        " pipeline, such as \"v4l2src num-buffers=90\"")
    add("-f", "--format", metavar="NAME", help=WRITER_OPTIONS["format"])
    add("-c", "--compression", metavar="NAME", help=WRITER_OPTIONS["compression"])
    add("-u", "--time-unit", dest="time-unit", metavar="NAME",
        help="time unit of a text, NumPy or HDF5 file that is read")
    add("-o", "--column-order", dest="column-order", metavar="LETTERS", help="columns of such a file, such as txyp")
    add("--width", metavar="PIXELS", help="width of the sensor, if IN does not state it")
    add("--height", metavar="PIXELS", help="height of the sensor, if IN does not state it")
    add("--from", dest="start", type=seconds, default=0, metavar="SECONDS",
        help="start of the part to convert, from the start of IN")
    add("--to", type=seconds, metavar="SECONDS", help="its end, exclusive")
    add("--crop", type=region, metavar="WIDTHxHEIGHT+X+Y",
        help="convert a region of the sensor, whose first pixel becomes (0, 0)")
    add("--simulator", default="eventsim-dvs", metavar="ELEMENT",
        help='for videos and pictures, with its properties, such as "eventsim-diff positive-threshold=10"; further'
        " elements may follow (default: %(default)s)")
    add("--framerate", type=positive, metavar="RATE", help="of a pattern of pictures, a second")
    add("--speed", type=positive, default=Fraction(1), metavar="FACTOR",
        help="speed of OUT relative to IN: 0.1 for a film in slow motion, 8 for the events of a video that was"
        " recorded at 240 frames/s and plays at 30")
    add("--scale", type=positive, default=Fraction(1), metavar="FACTOR", help="size of a drawn pixel")
    add("--render", metavar="ELEMENT", help='what draws, such as "eventrender mode=decay palette=light"')
    add("--over-frames", action="store_true", help="draw over the frames of IN")
    add("--sheet", type=cells, default=(1, 1), metavar="COLUMNSxROWS",
        help="pictures of a .png, evenly spaced in time; by default, one in the middle")
    add("--join", action="store_true", help="several IN: one after the other in time")
    add("--merge", action="store_true", help="several IN: superimposed, by their timestamps")
    add("--reverse", action="store_true", help="time backwards, polarity inverted")
    add("--output-directory", metavar="DIRECTORY", help="convert each IN to a file of the same name in this folder")
    add("--extension", metavar="NAME", help="extension of the files in the output directory (default: the extension of IN)")
    # parse_intermixed_args() of Python 3.11 refuses names after "--".
    words = sys.argv[1:]
    end = words.index("--") if "--" in words else len(words)
    options = parser.parse_intermixed_args(words[:end])
    options.files += words[end + 1:]
    several = options.join or options.merge
    if options.output_directory is None:
        if several and len(options.files) < 3:
            parser.error("--join and --merge need two IN or more, and OUT")
        if not several and len(options.files) != 2:
            parser.error("needs IN and OUT; several IN need --join or --merge; quote a pattern of pictures")
        if options.extension is not None:
            parser.error("--extension needs --output-directory")
    elif not options.files:
        parser.error("needs IN")
    if several + options.reverse + (several and options.output_directory is not None) > 1:
        parser.error("--join, --merge, --reverse and --output-directory exclude each other")
    if options.to is not None and options.start >= options.to:
        parser.error("--from must be less than --to")
    return options


def main():
    Gst.init(None)
    for stream in sys.stdout, sys.stderr:
        stream.reconfigure(errors="surrogateescape")
    options = parse_options()
    find_plugins(["eventcam"])
    interrupt = Interrupt()
    if options.output_directory is not None:
        return convert_all(options, interrupt)
    *inputs, out = options.files
    convert(inputs, out, options, interrupt)
    return 0


if __name__ == "__main__":
    run(main)
