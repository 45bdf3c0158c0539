#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""The Python package gst_eventcamera: reading, streaming, seeking, simulating, writing, tensors, failures."""

import copy
import itertools
import multiprocessing
import os
import shlex
import signal
import struct
import subprocess
import sys
import threading
import tracemalloc
import unittest
import unittest.mock
import warnings

from scratch import FOLDER, launch, path_of, write  # first

import gst_eventcamera as ec
import numpy as np
from PIL import Image
from gst_eventcamera import pipeline as internals
from gst_eventcamera import recordings
from gst_eventcamera.pipeline import Gst
from gst_eventcamera.sources import SINK

WIDTH, HEIGHT = 346, 260


def random_events(count, microseconds, seed=1, pixels=(WIDTH, HEIGHT)):
    """Sorted, from 0 on, with a silence from 0.4 to 0.6 of the time."""
    random = np.random.default_rng(seed)
    events = ec.Events(count, *pixels)
    t = np.sort(random.integers(0, microseconds, count))
    t[0] = 0
    silent = (t > 0.4 * microseconds) & (t < 0.6 * microseconds)
    events["t"] = np.sort(np.where(silent, t // 4, t))
    events["x"] = random.integers(0, pixels[0], count)
    events["y"] = random.integers(0, pixels[1], count)
    events["p"] = random.integers(0, 2, count)
    return events


def same(a, b):
    return len(a) == len(b) and all(np.array_equal(a[name], b[name]) for name in "txyp")


class VideoFrames(unittest.TestCase):
    """They reach the simulator as a person sees them, and as they are in a pipeline."""

    def make(self, name, line):
        launch(f"{line} ! filesink location={shlex.quote(path_of(name))}")
        return path_of(name)

    def make_film(self, container, audio, pause):
        """45 moving frames with B-frames; with pauses of 2 s before frames 15 and 30."""
        name = f"{'audio' if audio else 'mute'} {'pause' if pause else 'even'}.{container}"
        muxer = {"mkv": "matroskamux", "ts": "mpegtsmux", "mp4": "mp4mux", "avi": "avimux", "flv": "flvmux"}[container]
        audio_line = ("  audiotestsrc num-buffers=250 samplesperbuffer=882 ! audio/x-raw,rate=44100,channels=1"
                      " ! audioconvert ! lamemp3enc ! mpegaudioparse ! queue ! mux.") if audio else ""
        pipeline = Gst.parse_launch(
            f"videotestsrc num-buffers=45 pattern=zone-plate kx2=20 ky2=20 kt=9 ! video/x-raw,format=I420,width=64,"
            f"height=48,framerate=30/1 ! identity name=frames ! x264enc bframes=3 b-adapt=false speed-preset=ultrafast"
            f" ! video/x-h264,profile=main ! h264parse ! queue ! {muxer} name=mux ! filesink name=file{audio_line}")
        pipeline.get_by_name("file").set_property("location", path_of(name))
        count = itertools.count()

        def delay(_, info):
            info.get_buffer().pts += next(count) // 15 * 2 * Gst.SECOND * pause
            return Gst.PadProbeReturn.OK

        pipeline.get_by_name("frames").get_static_pad("src").add_probe(Gst.PadProbeType.BUFFER, delay)
        pipeline.set_state(Gst.State.PLAYING)
        ended = pipeline.get_bus().timed_pop_filtered(60 * Gst.SECOND, Gst.MessageType.EOS | Gst.MessageType.ERROR)
        pipeline.set_state(Gst.State.NULL)
        self.assertEqual(ended.type, Gst.MessageType.EOS, name)
        return path_of(name)

    def test_events_before_the_frames_of_a_file(self):
        ball = "videotestsrc pattern=ball num-buffers=20 ! video/x-raw,format=GRAY8"
        path = self.make("both.aedat4", f"{ball} ! eventsim-frame ! mux.  {ball} ! identity ts-offset=100000000 ! mux."
                                        "  aedatmux name=mux")
        recorded = ec.read(path)
        simulated = np.concatenate(list(ec.simulate(path, "eventsim-frame")))
        self.assertGreater(len(recorded), 1000)
        for name in "xyp":
            np.testing.assert_array_equal(simulated[name], recorded[name])
        events = path_of("events.raw")
        ec.write(events, recorded)
        with self.assertRaisesRegex(ec.PipelineError, "has events, but no frames"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            list(ec.simulate(events))

    def test_each_frame_but_the_first_ends_an_interval(self):
        for container, audio, pause in itertools.product(("mkv", "ts", "mp4", "avi", "flv"), (0, 1), (0, 1)):
            film = self.make_film(container, audio, pause)
            with self.subTest(film=film), warnings.catch_warnings():
                warnings.simplefilter("ignore")  # tsdemux loses times in pauses
                self.assertEqual(sum(len(chunk) > 0 for chunk in ec.simulate(film, "eventsim-frame")), 44)

    def test_frames_are_not_converted(self):
        for pixels in "BGRA", "I420_10LE", "Y42B", "GRAY16_LE":
            video = self.make("pixels.mkv", "videotestsrc pattern=ball num-buffers=8"
                              f" ! video/x-raw,format={pixels},width=64,height=48,framerate=25/1 ! avenc_ffv1 ! matroskamux")
            launch(f"filesrc location={shlex.quote(video)} ! decodebin ! eventsim-dvs ! eventnpyenc"
                   f" ! filesink location={shlex.quote(path_of('expected.npy'))}")
            expected = ec.read(path_of("expected.npy"))
            with self.subTest(pixels):
                self.assertTrue(same(ec.join(ec.simulate(video, "eventsim-dvs")), expected))

    def test_rotated_video_is_upright(self):
        video = self.make("rotated.mp4", "videotestsrc pattern=ball num-buffers=8"
                          " ! video/x-raw,format=I420,width=64,height=48 ! x264enc ! mp4mux")
        with open(video, "r+b") as file:  # mp4mux 1.22 writes no rotation
            file.seek(file.read().index(b"tkhd") + 44)
            file.write(struct.pack(">9i", 0, 1 << 16, 0, -1 << 16, 0, 0, 0, 0, 1 << 30))
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            events = ec.join(ec.simulate(video, "eventsim-frame"))
        self.assertEqual((events.width, events.height), (48, 64))
        self.assertGreater(len(events), 0)

    def test_files_count_from_the_time_that_players_call_0(self):
        film = self.make_film("mp4", 0, 0)  # its B-frames shift its timestamps
        first = next(ec.simulate(film, "eventsim-frame"))
        self.assertGreater(first.start, 0)
        self.assertEqual(first.stream_start, 0)
        launch(f"filesrc location={shlex.quote(film)} ! decodebin ! eventsim-frame ! eventnpyenc"
               f" ! filesink location={shlex.quote(path_of('film.npy'))}")
        self.assertEqual(int(ec.read(path_of("film.npy"))["t"][0]), round((first.end - first.start) * 1e6 - 0.5))

    def test_interlaced_video_is_deinterlaced(self):
        video = self.make("interlaced.mkv", "videotestsrc pattern=ball num-buffers=16"
                          " ! video/x-raw,format=I420,width=64,height=48,framerate=50/1 ! interlace field-pattern=1:1"
                          " ! x264enc interlaced=true ! matroskamux")
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            chunks = list(ec.simulate(video, "eventsim-frame"))
        self.assertGreaterEqual(len(chunks), 14)  # an interval a field

    def test_a_looping_gif_is_played_once(self):
        pictures = [Image.fromarray(np.uint8([[100 * ((x - 4 * i) % 32 < 8) for x in range(32)]] * 24)) for i in range(8)]
        pictures[0].save(path_of("loop.gif"), save_all=True, append_images=pictures[1:], duration=40, loop=3)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # avdec_gif gives no times
            chunks = list(ec.simulate(path_of("loop.gif"), "eventsim-frame"))
        self.assertEqual(len(chunks), 7)
        self.assertAlmostEqual(chunks[-1].end, 7 * 0.04)


class Recordings(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.events = random_events(30_000, 2_000_000)
        cls.path = path_of("a recording.raw")
        ec.write(cls.path, cls.events)

    def test_reads_exactly(self):
        read = ec.read(self.path)
        self.assertTrue(same(read, self.events))
        self.assertEqual((read.width, read.height), (WIDTH, HEIGHT))
        self.assertEqual(read.dtype.names, ("t", "x", "y", "p"))
        self.assertEqual([read[name].dtype for name in "txyp"], [np.int64, np.uint16, np.uint16, bool])
        self.assertIs(type(read["t"]), np.ndarray)

    def test_windows_partition_the_recording(self):
        stream = ec.stream(self.path, window=0.03)
        windows = list(stream)
        self.assertEqual(len(windows), len(stream))
        self.assertEqual((stream.width, stream.height), (WIDTH, HEIGHT))
        self.assertTrue(same(np.concatenate(windows), self.events))
        for i, window in enumerate(windows):
            self.assertAlmostEqual(window.start, i * 0.03)
            self.assertTrue(same(window, self.events.between(i * 0.03, (i + 1) * 0.03)), i)
        self.assertTrue(any(len(window) == 0 for window in windows))

    def test_slices_and_seeks(self):
        stream = ec.stream(self.path, window=0.05)
        windows = list(stream)
        self.assertTrue(same(stream[7], windows[7]))
        self.assertTrue(same(stream[-1], windows[-1]))
        part = stream[8:15]
        self.assertEqual(len(part), 7)
        self.assertTrue(all(same(a, b) for a, b in zip(part, windows[8:15], strict=True)))
        self.assertTrue(all(same(a, b) for a, b in zip(part[2:4], windows[10:12], strict=True)))
        self.assertTrue(same(np.concatenate(list(stream.between(1.5))), self.events.between(1.5, 9)))
        with self.assertRaises(IndexError):
            stream[len(stream)]

    def test_windows_are_whole_microseconds(self):
        stream = ec.stream(self.path, window=1 / 30)
        windows = list(stream)
        self.assertEqual(stream.window, 0.033333)
        for i in (1, 17, len(stream) - 1):
            self.assertTrue(same(stream[i], windows[i]), i)
        self.assertTrue(all(same(a, b) for a, b in zip(stream[20:40], windows[20:40], strict=True)))

    def test_parts(self):
        stream = ec.stream(self.path, window=0.05)
        for start, end in ((-1, None), (0, -1), (1, 0.5), (float("nan"), None), (0, float("nan"))):
            for part in (lambda: ec.read(self.path, start, end), lambda: stream[3:].between(start, end)):
                with self.assertRaisesRegex(ValueError, "0 <= start <= end"):
                    part()
        for start, end in ((9, None), (9, 10), (1, 1), (1e30, None), (float("inf"), None)):
            part = ec.read(self.path, start, end)
            self.assertEqual((len(part), part.width, part.height), (0, WIDTH, HEIGHT))
            self.assertEqual((len(stream.between(start, end)), list(stream.between(start, end))), (0, []))
        self.assertEqual(list(stream[:3].between(1, 2)), [])
        for start, end in ((0.25, 0.5), (1.5, float("inf"))):
            self.assertTrue(same(ec.read(self.path, start, end), self.events.between(start, min(end, 9))))

    def test_learns_durations_that_are_estimates_or_not_known(self):
        events = ec.Events(6_000_100, WIDTH, HEIGHT)
        events["t"] = np.append(np.arange(6_000_000) // 2, np.arange(3_000_000, 13_000_000, 100_000))
        for name in "xyp":
            events[name] = 1
        ec.write(path_of("short.raw"), events)
        np.savez(path_of("none.npz"), **{name: events[name] for name in "txyp"})
        ec.write(path_of("long.csv"), events[:3_000_000])
        for name, duration in ("short.raw", 12.900001), ("none.npz", 12.900001), ("long.csv", 1.5):
            stream = ec.stream(path_of(name))
            windows = sum(1 for _ in stream)
            with self.subTest(name):
                self.assertAlmostEqual(stream[windows - 1].start, (windows - 1) * 0.033)
                self.assertAlmostEqual(stream[-1].start, (windows - 1) * 0.033)
                self.assertEqual((stream.duration, len(stream), len(stream[2:])), (duration, windows, windows - 2))
                self.assertEqual(len(list(stream[-3:])), 3)
                self.assertAlmostEqual(ec.read(path_of(name), 0, 0.2).end, 0.2)
                for index in windows, windows + 1, -windows - 1:
                    with self.assertRaises(IndexError):
                        stream[index]

    def test_streams_in_constant_memory(self):
        path = path_of("long.raw")
        ec.write(path, random_events(500_000, 5_000_000))
        tracemalloc.start()
        count = sum(len(window) for window in ec.stream(path, window=0.02))
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        self.assertEqual(count, 500_000)
        self.assertLess(peak, 1_000_000)  # all events take 8 MB

    def test_tells_the_time_that_it_read(self):
        late = self.events.copy()
        late["t"] += 7_139_845
        path = path_of("late.raw")
        ec.write(path, late)
        last = late["t"][-1] / 1e6
        whole, part = ec.read(path), ec.read(path, 0, 0.5)
        self.assertAlmostEqual(whole.start, 7.139845)
        self.assertAlmostEqual(whole.end, last, places=5)
        self.assertAlmostEqual(part.end, 7.639845)
        self.assertAlmostEqual(ec.read(path, 1.9, 9).end, last, places=5)
        self.assertAlmostEqual(list(ec.stream(path, window=0.03).between(0, 0.5))[-1].end, 7.639845)

    def labelled(self, count):
        events = random_events(count, 30_000)
        events.cause = (np.arange(count) % 5).astype(np.uint8)
        events.object_class = np.arange(count).astype(np.uint16)
        return events

    def test_writes_labels(self):
        events = self.labelled(3000)
        for extension in ("npz", "h5", "csv"):
            path = path_of(f"labels.{extension}")
            ec.write(path, events)
            read = ec.read(path)
            self.assertTrue(same(read, events))
            self.assertTrue(np.array_equal(read.cause, events.cause), extension)
            self.assertTrue(np.array_equal(read.object_class, events.object_class), extension)
        events.cause = events.cause[1:]
        with self.assertRaisesRegex(ValueError, "3000 events, but 2999 labels"):
            ec.write(path, events)

    def test_sorts_and_selects_labels(self):
        events = self.labelled(3000)
        events["t"] = np.random.default_rng(1).permutation(3000)
        order = np.argsort(events["t"])
        copied, sorted_in_place = np.sort(events, order="t"), events.copy()
        sorted_in_place.sort(order="t")
        for result in (copied, sorted_in_place):
            self.assertTrue(same(result, events[order]))
            self.assertTrue(np.array_equal(result.cause, events.cause[order]))
            self.assertTrue(np.array_equal(result.object_class, events.object_class[order]))
        pixels = events[["x", "y"]]
        self.assertEqual(pixels.dtype.names, ("x", "y"))
        self.assertIs(pixels.cause.base, events.cause)
        labelled = ec.join(ec.live("videotestsrc num-buffers=3 ! eventsim-dvs label=true"))
        expected = np.sort(labelled[::-1], order="t")
        labelled[::-1].sort(order="t")  # in the memory of the whole
        self.assertTrue(same(labelled, expected[::-1]))
        self.assertTrue(np.array_equal(labelled.cause, expected[::-1].cause))

    def test_writes_fields_of_any_integer_type(self):
        events = np.zeros(3, [("t", "<u8"), ("x", "<u8"), ("y", "<u8"), ("p", "<u8")])
        events["y"], events["p"] = (1, 2, 3), (0, 1, 1)
        ec.write(path_of("unsigned.raw"), events, np.int64(WIDTH), np.uint16(HEIGHT))
        self.assertTrue(same(ec.read(path_of("unsigned.raw")), events))

    def test_replaces_files_by_complete_ones_only(self):
        path = path_of("kept.npy")
        ec.write(path, self.events)
        events = np.zeros(3, [("t", "<i8"), ("x", "<i4"), ("y", "<f4"), ("p", "<i1")])
        with self.assertRaisesRegex(ValueError, "y is float32"):
            ec.write(path, events, WIDTH, HEIGHT)
        with self.assertRaises(ec.PipelineError):
            ec.write("/nowhere/events.raw", self.events)
        failing = "eventnpyenc ! identity error-after=2 ! filesink name=file"
        with unittest.mock.patch.dict(recordings.WRITERS, {".npy": failing}), self.assertRaises(ec.PipelineError):
            ec.write(path, self.events)
        self.assertTrue(same(ec.read(path), self.events))
        self.assertFalse([name for name in os.listdir(FOLDER.name) if name.endswith(".part")])

    def test_refuses_pixels_before_the_first_and_knows_signs(self):
        events = np.zeros(3, [("t", "<i8"), ("x", "<i4"), ("y", "<i4"), ("p", "<i1")])
        events["p"] = -1, 1, -1
        path = path_of("signs.raw")
        ec.write(path, events, WIDTH, HEIGHT)
        self.assertEqual(list(ec.read(path)["p"]), [False, True, False])
        self.assertEqual(ec.voxel_grid(events, 1, WIDTH, HEIGHT).sum(), -1)
        events["x"] = -1
        with self.assertRaisesRegex(ValueError, "outside the sensor"):
            ec.write(path, events, WIDTH, HEIGHT)

    def test_reads_over_a_silence_of_decades(self):
        events = self.events[:3].copy()
        events["t"] = 0, 10, 2**50
        path = path_of("decades.csv")
        ec.write(path, events)
        self.assertTrue(same(ec.read(path), events))
        stream = ec.stream(path)
        with self.assertWarnsRegex(ec.PipelineWarning, "pause of .* s: its windows are skipped"):
            windows = list(stream)
        self.assertLess(len(windows), 10)
        self.assertEqual([len(window) for window in windows if len(window)], [2, 1])
        self.assertTrue(windows[-1].start <= 2**50 / 1e6 < windows[-1].end)
        with self.assertRaisesRegex(TypeError, "windows, most of them in pauses"):
            len(stream)
        self.assertEqual(len(stream[-1]), 1)

    def test_takes_paths_of_any_type(self):
        path = path_of("bytes.csv")
        ec.write(os.fsencode(path), self.events)
        self.assertTrue(same(ec.read(os.fsencode(path)), self.events))
        self.assertEqual(ec.stream(os.fsencode(path)).width, ec.stream(path).width)
        for wrong in (lambda: ec.read("a\0b"), lambda: ec.write("a\0b.csv", self.events)):
            with self.assertRaisesRegex(ValueError, "null byte"):
                wrong()

    def test_joins_chunks(self):
        events = self.labelled(3000)
        gap = ec.Events(0, WIDTH, HEIGHT)
        whole = ec.join(chunk for chunk in (events[:1000], gap, events[1000:]))
        self.assertTrue(same(whole, events))
        self.assertEqual((whole.width, whole.height), (WIDTH, HEIGHT))
        self.assertTrue(np.array_equal(whole.object_class, events.object_class))
        self.assertIsNone(ec.join([events, self.events]).cause)
        self.assertEqual(len(ec.join([])), 0)

    def test_knows_the_size_that_all_events_need(self):
        path = path_of("growing.npy")
        events = np.zeros(3_000_000, ec.EVENT)
        events["t"] = np.arange(len(events))
        events["x"][-9:], events["y"][-9:] = 1199, 699
        np.save(path, events)
        self.assertLess(ec.stream(path).width, 1200)  # as far as it is read
        for read in ec.read(path), ec.read(path, 2.9), ec.join(ec.stream(path)):
            self.assertEqual((read.width, read.height), (1280, 720))

    def test_copies_are_complete(self):
        events = random_events(100, 1000)
        events.start, events.end = 1.0, 2.0
        events.cause = np.arange(100, dtype=np.uint8)
        events.object_class = np.arange(100, dtype=np.uint16)
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            sent = pool.apply(copy.copy, (events,))
        for other in (sent, copy.copy(events), copy.deepcopy(events), events.copy()):
            self.assertIsNot(other, events)
            self.assertTrue(same(other, events))
            self.assertEqual((other.width, other.height, other.start, other.end), (WIDTH, HEIGHT, 1.0, 2.0))
            self.assertTrue(np.array_equal(other.cause, events.cause))
            self.assertTrue(np.array_equal(other.object_class, events.object_class))
            self.assertFalse(np.shares_memory(other.cause, events.cause))


class Simulators(unittest.TestCase):
    def test_an_interval_without_events_is_a_chunk(self):
        chunks = list(ec.live("videotestsrc pattern=black num-buffers=4 ! eventsim-frame"))
        self.assertEqual([len(chunk) for chunk in chunks], [0, 0, 0])

    def test_appsinks_may_be_used_before_the_import(self):
        program = ("import gi; gi.require_version('Gst', '1.0'); from gi.repository import Gst; Gst.init(None);"
                   " Gst.parse_launch('appsrc ! appsink'); import gst_eventcamera as ec, numpy as np;"
                   " events = np.zeros(9, ec.EVENT); ec.write('imported.npy', events, 4, 4);"
                   " print(len(ec.read('imported.npy')))")
        output = subprocess.run([sys.executable, "-c", program], cwd=FOLDER.name, check=True, stdout=subprocess.PIPE)
        self.assertEqual(output.stdout, b"9\n")

    def test_leaving_the_loop_stops_the_pipeline(self):
        before = threading.active_count(), len(os.listdir("/proc/self/task"))
        for _ in range(3):
            for chunk in ec.live("videotestsrc is-live=true pattern=ball ! eventsim-frame"):
                self.assertTrue(chunk.end < chunk.arrival < chunk.end + 20, f"{chunk.end} s, {chunk.arrival} s")
                break
        self.assertLessEqual(len(os.listdir("/proc/self/task")), before[1] + 4)  # pools of threads stay

    def test_interrupts(self):
        program = subprocess.Popen(
            [sys.executable, "-c", "import gst_eventcamera as ec\n"
             "for chunk in ec.live('videotestsrc is-live=true pattern=ball ! eventsim-frame'):\n"
             "    print(len(chunk), flush=True)"],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        program.stdout.readline()
        program.send_signal(signal.SIGINT)
        _, errors = program.communicate(timeout=30)
        self.assertIn("KeyboardInterrupt", errors)

    def test_the_end_of_the_program_stops_the_pipeline(self):
        program = ("import gst_eventcamera as ec, time\n"
                   "chunks = ec.live('videotestsrc pattern=black ! eventsim-diff')\n"
                   "next(chunks)\n"
                   "time.sleep(0.5)")  # until the pipeline waits for the loop
        subprocess.run([sys.executable, "-c", program], check=True, timeout=30)


class Recipes(unittest.TestCase):
    def parameter(self, value, name="positive-threshold"):
        recipe = write("number.yaml", f"{{videos: x, simulator: eventsim-dvs, parameters: {{{name}: {value}}}}}")
        return ec.Recipe.load(recipe).drawn("x")[name]

    def test_numbers_have_exponents_and_limits(self):
        for value in "2e-1", "2E-1", "+20.e-2", "{choice: [2e-1]}", "{uniform: [2e-1, 0.2]}":
            self.assertEqual(self.parameter(value), 0.2, value)
        self.assertEqual(self.parameter("{choice: [gen4]}", "preset"), "gen4")
        for value in "1e9", "-1e9", '"1e9"', '"0.2"', "true", "{choice: [0.2, 1e9]}", '{choice: [0.2, "0.3"]}':
            with self.assertRaisesRegex(ec.RecipeError, "parameters: positive-threshold: .*0.001 to 10"):
                self.parameter(value)
        with self.assertRaisesRegex(ec.PipelineError, 'denoise="1e9": it must be from -1 to 255'):
            ec.simulate("/nowhere", 'eventsim-dvs denoise="1e9"')


class Videos(unittest.TestCase):
    def test_may_be_shorter_than_their_file(self):
        for frames, framerate, audio, expected in (
                (3, "1/2", "", 4), (75, "25/1", "audiotestsrc samplesperbuffer=4410 num-buffers=50 ! mux.", 2.96)):
            launch(f"matroskamux name=mux ! filesink location={shlex.quote(path_of('short.mkv'))}"
                   f" videotestsrc pattern=ball num-buffers={frames}"
                   f" ! video/x-raw,format=GRAY8,width=64,height=48,framerate={framerate} ! mux. {audio}")
            recipe = write("recipe.yaml", "{videos: short.mkv, simulator: eventsim-dvs, output: npz}")
            self.assertAlmostEqual(sum(chunk.end - chunk.start for chunk in ec.Dataset(recipe)[0]), expected, places=2)


class Tensors(unittest.TestCase):
    def test_a_voxel_grid_is_that_of_the_element(self):
        path = path_of("voxels.raw")
        ec.write(path, random_events(5000, 500_000, seed=3))
        grids = [ec.voxel_grid(window, 5) for window in ec.stream(path, window=0.1)]
        tensors = list(ec.tensors(f"filesrc location={internals.quoted(path)} ! evtdec"
                                  " ! eventtensor bins=5 accumulation-time=100000000"))
        self.assertEqual(len(grids), len(tensors))
        for grid, tensor in zip(grids, tensors):
            self.assertTrue(np.array_equal(grid, tensor))

    def test_every_type_arrives(self):
        line = "videotestsrc pattern=ball num-buffers=4 ! eventsim-frame ! eventtensor representation=histogram"
        exact = list(ec.tensors(line))
        self.assertEqual((exact[0].shape, exact[0].dtype), ((2, 240, 320), np.float32))
        for kind in ("float16", "uint8"):
            for tensor, other in zip(ec.tensors(f"{line} data-type={kind}"), exact, strict=True):
                self.assertEqual(tensor.dtype, kind)
                self.assertTrue(np.array_equal(tensor.astype(np.float32), other))

    def test_other_orders_of_fields_are_understood(self):
        events = random_events(100, 1000)
        tonic = np.empty(100, [("x", np.int16), ("y", np.int16), ("t", np.int64), ("p", bool)])
        for name in "txyp":
            tonic[name] = events[name]
        self.assertTrue(np.array_equal(ec.voxel_grid(tonic, 3, WIDTH, HEIGHT), ec.voxel_grid(events, 3)))

    def test_numbers_are_whole_and_of_the_sensor(self):
        events = np.zeros(3, [("t", "<f8"), ("x", "<i4"), ("y", "<i4"), ("p", "<i1")])
        events["t"] = 0, 1, 2
        self.assertEqual(ec.voxel_grid(events, 1, WIDTH, HEIGHT).sum(), -3)
        for name, value in (("t", 2.5), ("t", float("nan")), ("t", float("inf")), ("x", 65536), ("y", -1)):
            wrong = events.copy()
            wrong[name][2] = value
            with self.assertRaisesRegex(ValueError, f"{name} must be whole numbers"):
                ec.voxel_grid(wrong, 1, WIDTH, HEIGHT)


class Failures(unittest.TestCase):
    def expect(self, error, text, work):
        with self.assertRaises(error) as caught:
            work()
        self.assertIn(text, str(caught.exception))

    def test_are_exceptions_with_the_text_of_the_element(self):
        self.expect(ec.PipelineError, 'No such file "/nowhere"', lambda: ec.read("/nowhere"))
        self.expect(ec.PipelineError, "the name /nowhere/lat\\xfcin.npz is not UTF-8; rename it",
                    lambda: ec.read("/nowhere/lat\udcfcin.npz"))
        self.expect(ec.PipelineError, 'no element "nothing"', lambda: list(ec.live("videotestsrc ! nothing")))
        self.expect(ec.PipelineError, "2048x2048 pixels",
                    lambda: ec.write(path_of("wide.raw"), random_events(9, 9, pixels=(3000, 9))))
        full = path_of("full.raw")
        os.symlink("/dev/full", full)
        self.expect(ec.PipelineError, "No space left", lambda: ec.write(full, random_events(3_000_000, 3_000_000)))

    def test_of_elements_that_go_on_are_warnings(self):
        path = path_of("corrupt.dat")
        ec.write(path, random_events(30_000, 300_000))
        os.truncate(path, os.path.getsize(path) - 3)
        for read in (ec.read, lambda path: list(ec.stream(path))):
            with self.assertWarnsRegex(ec.PipelineWarning, "Corrupt data at byte .* ends within an event") as caught:
                read(path)
            self.assertEqual(caught.filename, __file__)
        events = random_events(3, 10)
        events["t"] = 0, 1, 86_400_000_000
        with self.assertWarnsRegex(ec.PipelineWarning, "pause of 86399 s"):
            ec.write(path_of("pause.es"), events)

    def test_come_after_all_samples(self):
        samples = 0
        with self.assertRaisesRegex(ec.PipelineError, "identity"):
            for _ in ec.live("videotestsrc num-buffers=9 ! eventsim-frame ! identity error-after=6"):
                samples += 1
        self.assertEqual(samples, 5)

    def test_leave_nothing_open(self):
        def fail():
            with self.assertRaises(ec.PipelineError):
                list(ec.live("videotestsrc ! nothing"))
            return len(os.listdir("/proc/self/fd"))

        fail()
        self.assertEqual(fail(), fail())

    def test_do_not_wait_behind_other_messages(self):
        with internals.Pipeline("videotestsrc num-buffers=100 ! video/x-raw,width=32,height=32,framerate=1000/1"
                                f" ! eventsim-frame ! eventstats interval=1 ! {SINK}") as pipeline:
            for _ in itertools.islice(pipeline.samples(), 90):
                pass
            messages = sum(1 for _ in iter(pipeline._bus.pop, None))
        self.assertLess(messages, 50)

    def test_of_forked_processes_are_exceptions(self):
        path = path_of("forked.npz")
        ec.write(path, random_events(9, 9))
        with multiprocessing.get_context("fork").Pool(1) as pool:
            with self.assertRaisesRegex(ec.PipelineError, "spawn"):
                pool.apply_async(ec.read, (path,)).get(timeout=60)
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            self.assertEqual(len(pool.apply(ec.read, (path,))), 9)

    def test_tell_what_to_install(self):
        missing = subprocess.run([sys.executable, "-c", "import gst_eventcamera"], capture_output=True, text=True,
                                 env=os.environ | {"GI_TYPELIB_PATH": "/nowhere"})
        self.assertRegex(missing.stderr, "ImportError: .*install: .*gir1.2-gsteventcamera-1.0")

    def test_of_arguments_are_value_errors(self):
        events = random_events(100, 1000)
        self.expect(ValueError, "extension", lambda: ec.write(path_of("x.mp4"), events))
        self.expect(ValueError, "sorted", lambda: ec.write(path_of("x.raw"), events[::-1]))
        late = events.copy()
        for t in (2**52 + 1, 2**62, 2**63 - 1):
            late["t"][-1] = t
            self.expect(ValueError, "at most 2**52", lambda: ec.write(path_of("x.raw"), late))
        self.expect(ValueError, "sorted", lambda: ec.voxel_grid(events[::-1]))
        self.expect(ValueError, "outside", lambda: ec.voxel_grid(events, 5, 10, 10))
        for bins in (0, 257, 2.5):
            self.expect(ValueError, f"{bins} bins", lambda: ec.voxel_grid(events, bins))
        for width in (16385, -1, 2.5, "9"):
            self.expect(ValueError, "from 1 to 16384", lambda: ec.voxel_grid(events, 1, width))
        self.expect(ValueError, "window", lambda: ec.stream("x", window=0))


if __name__ == "__main__":  # not in the processes of a pool
    unittest.main()
