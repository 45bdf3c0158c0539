# SPDX-License-Identifier: LGPL-2.1-or-later
"""The elements that read and write event files, which GStreamer's registry knows by their metadata, and playing a
pipeline to its end."""
import functools
import os
import re
import signal
import sys
import time
from typing import NamedTuple

import gi

gi.require_version("Gst", "1.0")
gi.require_version("GstBase", "1.0")
from gi.repository import GLib, Gst, GstBase  # noqa: E402

from program import Progress  # noqa: E402

# Typefinders see into compressed files, too.
START_SIZE = 1 << 17
# Limit of times in seconds, so that nanoseconds fit a GStreamer clock time.
MAX_SECONDS = 1e9


class Failure(RuntimeError):
    status = 1


class Misuse(Failure):
    status = 2


class FileElement(NamedTuple):
    extension: str  # of files, with its dot
    factory: Gst.ElementFactory
    settings: str  # properties to set for this extension, as in a launch line

    @property
    def name(self):
        return self.factory.get_name()

    def has_pads(self, template):
        return any(pad.name_template == template for pad in self.factory.get_static_pad_templates())

    def property(self, name):
        """The specification of a property, or None."""
        return Gst.ElementFactory.make(self.name).find_property(name)


def _elements_with(key):
    """An element for each extension in its metadata, in alphabetical order."""
    for factory in Gst.Registry.get().get_feature_list(Gst.ElementFactory):
        for entry in filter(None, (factory.get_metadata(key) or "").replace(",", ";").split(";")):
            extension, *settings = entry.split()
            yield FileElement(f".{extension}", factory, " ".join(settings))


@functools.cache
def readers():
    return sorted(_elements_with("input-extensions"), key=lambda element: element.extension)


@functools.cache
def writers():
    return sorted(_elements_with("output-extensions"), key=lambda element: element.extension)


def with_extension_of(elements, path):
    """The element with the extension of a path, or None."""
    return next((element for element in elements if path.lower().endswith(element.extension)), None)


def content_of(path):
    """The first bytes of a file, and their caps, or None. Raises Failure for what cannot be read twice: the bytes read
    here would be lost."""
    if os.path.exists(path) and not os.path.isfile(path) and not os.path.isdir(path):
        raise Failure(f"{path} is not a regular file; save it to a file first")
    try:
        with open(path, "rb") as file:
            start = file.read(START_SIZE)
    except OSError as error:
        raise Failure(f"{path}: {error.strerror}") from None
    return start, GstBase.type_find_helper_for_data(None, start)[0] if start else None


def reader_of(path, caps):
    """The reader of a file, by its content, or by its extension if the content is ambiguous; None if there is none."""
    by_content = next((reader for reader in readers() if caps and reader.factory.can_sink_any_caps(caps)), None)
    return by_content or with_extension_of(readers(), path)


def listed_pictures(path):
    """The times in nanoseconds and the paths of a text file of lines "seconds picture"; None if it is something else."""
    line = re.compile(r"\s*(\S+)\s+(\S.*\.[A-Za-z]\w*)\s*")
    entries = []
    try:
        with open(path, encoding="utf-8") as file:
            for text in file:
                if not text.strip() or text.startswith("#"):
                    continue
                try:
                    time, name = line.fullmatch(text).groups()
                    seconds = float(time)
                except (AttributeError, ValueError):
                    if not entries:
                        return None
                    raise Failure(f"{path}: \"{text.strip()}\" is not a time in seconds and a picture") from None
                if not abs(seconds) < MAX_SECONDS:
                    raise Failure(f"{path}: {time} is not the time of a picture; give seconds below 1e9")
                if entries and round(seconds * 1e9) <= entries[-1][0]:
                    raise Failure(f"{path}: the time {time} is not later than the one before it")
                entries.append((round(seconds * 1e9), os.path.join(os.path.dirname(path), name)))
    except UnicodeDecodeError:
        return None
    return entries


def set_option(element, name, text):
    """Sets a property to the text of an option. Raises Misuse if it is no value of the property."""
    spec = element.find_property(name)
    value = text
    if hasattr(spec, "enum_class"):
        values = {value.value_nick: value for value in spec.enum_class.__enum_values__.values()}
        if text not in values:
            raise Misuse(f"--{name}: no \"{text}\"; choose one of {' '.join(values)}")
        value = values[text]
    elif hasattr(spec, "maximum"):
        if not text.isdecimal() or not spec.minimum <= int(text) <= spec.maximum:
            raise Misuse(f"--{name}: \"{text}\" is not a number from {spec.minimum} to {spec.maximum}")
        value = int(text)
    element.set_property(name, value)


def utf8_path(path):
    """A path as the value of a property."""
    try:
        path.encode()
    except UnicodeEncodeError:
        raise Failure(f"the name {path} is not UTF-8; rename it") from None
    return path


def parse(line):
    """Makes a pipeline."""
    try:
        return Gst.parse_launch_full(line, None, Gst.ParseFlags.FATAL_ERRORS)
    except GLib.Error as error:
        raise Failure(error.message) from None


def post_error(element, text, cause, kind=Gst.Message.new_error):
    error = GLib.Error.new_literal(Gst.StreamError.quark(), text, Gst.StreamError.WRONG_TYPE)
    element.post_message(kind(element, error, f"\n{cause}"))


def events_pad(reader):
    """The pad of a demuxer's first stream of events. Posts an error and returns None if there is none."""
    names = [pad.get_name() for pad in reader.srcpads]
    count = sum(name.startswith("events_") for name in names)
    if count == 0:
        post_error(reader, "The file has no events to convert.", f"no stream of events among {len(names)} streams")
    elif count > 1:
        post_error(reader, f"Only the first of {count} streams of events is converted.",
                   "the others are on the pads events_1 and on", Gst.Message.new_warning)
    return reader.get_static_pad("events_0")


def described(message):
    """The kind and text of a message, and its cause: the debug text, after the code location."""
    kind, parse_message = {
        Gst.MessageType.ERROR: ("error", message.parse_error),
        Gst.MessageType.WARNING: ("warning", message.parse_warning),
        Gst.MessageType.INFO: ("note", message.parse_info),
    }[message.type]
    error, debug = parse_message()
    text = f"{kind}: {error.message}"
    if error.matches(Gst.CoreError.quark(), Gst.CoreError.MISSING_PLUGIN):
        text += " On Debian, install: gstreamer1.0-libav gstreamer1.0-plugins-good"
    _, _, cause = (debug or "").partition("\n")
    return f"{text}\n  {cause}" if cause else text


class Interrupt:
    """True after the first Ctrl-C, SIGTERM or SIGHUP; a second Ctrl-C or SIGTERM ends the program."""

    def __init__(self):
        self._numbers = []
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # no traceback where `head` has read enough
        # A terminal that closes sends SIGHUP, and then its shell does. nohup ignores both.
        for number in signal.SIGINT, signal.SIGTERM, signal.SIGHUP:
            if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
                signal.signal(number, self._note)

    def _note(self, number, _):
        self._numbers.append(number)
        if number != signal.SIGHUP:
            signal.signal(number, signal.SIG_DFL)

    def __bool__(self):
        return bool(self._numbers)


class PlayProgress(Progress):
    """The share that is done, and the time left."""

    def __init__(self):
        super().__init__(interval=10, pause=1)
        self._start = time.monotonic()

    def show(self, share, count):
        if share is None:
            return
        share = min(max(share, 0), 1)
        left = f", {(time.monotonic() - self._start) * (1 / share - 1):.0f} s left" if share > 0.01 else ""
        bar = f"[{'#' * round(40 * share):40}] " if self.on_terminal else ""
        self.update(f"{bar}{100 * share:3.0f} %, {count}{left}")


def play(pipeline, show, report, interrupt=False, prepare=None):
    """Plays a pipeline to its end, or until `interrupt` is true, which completes the output.

    show(): prints the progress; called about five times a second.
    report(message): prints a warning or a note.
    prepare(): called in PAUSED, before the pipeline plays.
    Raises Failure with the text of an error."""
    bus = pipeline.get_bus()
    ending = False
    kinds = (Gst.MessageType.EOS | Gst.MessageType.ERROR | Gst.MessageType.WARNING | Gst.MessageType.INFO
             | Gst.MessageType.ASYNC_DONE)
    pipeline.set_state(Gst.State.PAUSED if prepare else Gst.State.PLAYING)
    while True:
        if interrupt and not ending and not prepare:
            ending = True
            pipeline.send_event(Gst.Event.new_eos())
        message = bus.timed_pop_filtered(Gst.SECOND // 5, kinds)
        if message is None:
            show()
        elif message.type == Gst.MessageType.EOS:
            return
        elif message.type == Gst.MessageType.ERROR:
            raise Failure(described(message))
        elif message.type != Gst.MessageType.ASYNC_DONE:
            report(described(message))
        elif prepare:
            prepare()
            prepare = None
            pipeline.set_state(Gst.State.PLAYING)


def run(main):
    """Runs a program, and exits."""
    try:
        sys.exit(main())
    except RuntimeError as failure:
        print(failure, file=sys.stderr)
        sys.exit(getattr(failure, "status", 1))
