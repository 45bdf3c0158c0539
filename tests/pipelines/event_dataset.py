#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""event-dataset and ec.Dataset: data sets from recipes, made, continued, verified, and on the fly."""

import collections
import glob
import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
import unittest
import unittest.mock

from scratch import launch, path_of, read, write  # first

sys.path.insert(0, os.path.join(os.environ["BUILD"], "pipelines"))

import gst_eventcamera as ec
import numpy as np
from PIL import Image
from dataset_video import hash_of, record_of
from gst_eventcamera.recipe import OUTPUTS, Distribution, uniform_number

PROGRAM = os.path.join(os.environ["BUILD"], "pipelines", "event-dataset")
RECIPE = """
seed: 7
videos: "videos/**/*.mkv"
simulator: eventsim-dvs preset=davis346
parameters:
  positive-threshold: {normal: [0.2, 0.03]}
  negative-threshold: {uniform: [0.8, 1.2], relative-to: positive-threshold}
filters: eventdenoise
output: npz
split: {train: 0.6, test: 0.4}
"""


def make_video(name, frames=8, more=""):
    path = path_of(name)
    launch(f"videotestsrc pattern=ball num-buffers={frames} ! video/x-raw,format=I420,width=64,height=48,framerate=25/1"
           f" {more} ! avenc_ffv1 ! matroskamux ! filesink {shlex.quote('location=' + path)}")
    return path


def recipe_of(folder, text=RECIPE):
    return write(f"{folder}/recipe.yaml", text)


def event_dataset(*words, status=0):
    """What it prints."""
    done = subprocess.run([PROGRAM, *words], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=300)
    assert done.returncode == status, f"status {done.returncode} of {words}:\n{done.stdout}"
    return done.stdout


def stop_once_there_is(pattern, *words):
    """Stops the program, and its jobs, when it has made a file of this pattern. Returns it."""
    program = subprocess.Popen([PROGRAM, *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                               start_new_session=True)
    while not glob.glob(pattern):
        assert program.poll() is None, f"{words} ended with status {program.returncode}"
        time.sleep(0.02)
    os.killpg(program.pid, signal.SIGSTOP)
    return program


def program(path, script):
    """Puts a shell script first in PATH."""
    os.chmod(write(path, f"#!/bin/sh\n{script}\n"), 0o755)
    return unittest.mock.patch.dict(os.environ, PATH=os.path.dirname(path_of(path)) + ":" + os.environ["PATH"])


def record_in(folder, video):
    return record_of(video, folder, folder)


def load(folder, name):
    return json.loads(read(f"{folder}/recipe/{name}"))


def hashes(folder):
    return {one["name"]: one["written"]["npz"]["sha256"] for one in load(folder, "manifest.json")["videos"]}


def sizes(parts):
    return dict(collections.Counter(parts.values()))


class DataSets(unittest.TestCase):
    def test_are_made_continued_and_verified(self):
        folder = "a päth's #1: more/set"
        for name in ("walk/two words", "run/three's", "run/four"):
            make_video(f"{folder}/videos/{name}.mkv")
        recipe = recipe_of(folder)
        printed = event_dataset(recipe)
        self.assertIn("3 videos: 3 made, 0 unchanged, 0 refused, 0 failed", printed)
        made = hashes(folder)
        self.assertEqual(sorted(made), ["run/four", "run/three's", "walk/two words"])
        for one in load(folder, "manifest.json")["videos"]:
            self.assertEqual(one["input"]["sha256"], hash_of(path_of(f"{folder}/{one['input']['path']}")))
            written = one["written"]["npz"]
            self.assertEqual(written["sha256"], hash_of(path_of(f"{folder}/recipe/{written['path']}")))
            self.assertEqual(one["figures"]["frames"], 8)
        self.check_reports(folder, made)
        self.check_on_the_fly(folder, recipe)

        self.assertIn("0 made, 3 unchanged", event_dataset(recipe))
        make_video(f"{folder}/videos/run/four.mkv", frames=9)
        os.remove(path_of(f"{folder}/recipe/data/walk/two words.npz"))
        printed = event_dataset(recipe)
        self.assertIn("run/four: the input has changed since the manifest", printed)
        self.assertIn("2 made, 1 unchanged", printed)
        again = hashes(folder)
        self.assertNotEqual(again.pop("run/four"), made.pop("run/four"))
        self.assertEqual(again, made)

        self.assertIn("3 videos of the manifest compared, 0 differences", event_dataset("verify", recipe))
        manifest = load(folder, "manifest.json")
        manifest["videos"][0]["written"]["npz"]["sha256"] = "0" * 64
        manifest["videos"][1]["input"]["sha256"] = "0" * 64
        other = write(f"{folder}/other.json", json.dumps(manifest))
        printed = event_dataset("verify", recipe, "--manifest", other, status=1)
        self.assertIn("run/four: other events, by the same versions", printed)
        self.assertIn("run/three's: the input has changed since the manifest", printed)
        self.check_damage(folder, recipe)

    def check_damage(self, folder, recipe):
        """Only verify sees it in a file of the same size. No file stays from another output."""
        damaged = path_of(f"{folder}/recipe/data/run/four.npz")
        with open(damaged, "r+b") as file:
            file.seek(-100, os.SEEK_END)
            file.write(b"damage")
        self.assertIn("0 made, 3 unchanged", event_dataset(recipe))
        self.assertRegex(event_dataset("verify", recipe, status=1),
                         "different: run/four: its file of events differs from the manifest\n.*, 1 differences")
        os.remove(damaged)
        self.assertIn("3 videos of the manifest compared, 0 differences", event_dataset("verify", recipe))
        event_dataset(recipe_of(folder, RECIPE.replace("npz", "csv")))
        for path in glob.glob(glob.escape(path_of(f"{folder}/recipe/data")) + "/*/*"):
            self.assertTrue(path.endswith(".csv"), path)

    def check_reports(self, folder, made):
        lines = [line for part in ("train", "test") for line in read(f"{folder}/recipe/{part}.txt").splitlines()]
        self.assertEqual(sorted(lines),
                         sorted(f"data/{name}.npz\t{os.path.dirname(name)}" for name in made))
        statistics = load(folder, "statistics.json")
        self.assertEqual(statistics["all"]["videos"], 3)
        self.assertEqual(statistics["all"]["frames"], 24)
        page = read(f"{folder}/recipe/preview.html")
        self.assertEqual(page.count("<img"), 3)
        self.assertNotIn("//", page)  # no address of another machine
        self.assertIn('<a href="previews/walk/two%20words.png"><img', page)
        self.assertRegex(page, "64 × 48 pixels, 8 frames, 0.3 s, .* Mev/s, .*positive-threshold 0")
        self.assertNotIn("rate-p", page)
        with Image.open(path_of(f"{folder}/recipe/previews/run/four.png")) as picture:
            colours = set(picture.convert("RGB").getdata())
        self.assertIn((240, 244, 250), colours)  # ON
        self.assertIn((64, 128, 208), colours)  # OFF

    def check_on_the_fly(self, folder, recipe):
        dataset = ec.Dataset(recipe)
        self.assertEqual([video.name for video in dataset], sorted(hashes(folder)))
        for video in dataset:
            events = np.concatenate(list(video))
            with np.load(path_of(f"{folder}/recipe/data/{video.name}.npz")) as stored:
                for field in "txyp":
                    self.assertTrue(np.array_equal(stored[field], events[field]))
        names = {part: [video.name for video in ec.Dataset(recipe, part)] for part in ("train", "test")}
        self.assertEqual(sorted(names["train"] + names["test"]), sorted(hashes(folder)))
        with self.assertRaises(ValueError):
            ec.Dataset(recipe, "validation")

    def test_report_what_cannot_be_used(self):
        make_video("bad/videos/good.mkv")
        make_video("bad/videos/short.mkv", frames=1)
        make_video("bad/videos/uneven.mkv", more="! identity drop-probability=0.4")
        cut = make_video("bad/videos/cut.mkv", frames=100)
        os.truncate(cut, os.path.getsize(cut) // 3)
        write("bad/videos/noise.mkv", "".join(map(chr, range(128))) * 80)
        printed = event_dataset(recipe_of("bad"), status=1)
        self.assertIn("refused: short: too short: 1 frames of at least 2", printed)
        self.assertRegex(printed, "refused: cut: corrupt: its frames end 2.* s before the 4.0 s of the file")
        self.assertRegex(printed, "refused: noise: corrupt or not supported: .*type")
        self.assertRegex(printed, "warning: uneven: variable framerate: its frames are 40 to (80|120|160) ms apart")
        self.assertIn("5 videos: 2 made, 0 unchanged, 3 refused, 0 failed", printed)
        self.assertEqual(sorted(hashes("bad")), ["good", "uneven"])
        self.assertEqual(sorted(load("bad", "manifest.json")["refused"]), ["cut", "noise", "short"])
        for output in ("npz", "tensors"):
            videos = {video.name: video for video in ec.Dataset(recipe_of("bad", RECIPE.replace("npz", output)))}
            self.assertGreater(len(list(videos["uneven"])), 0)
            for name, fault in (("cut", "cut: corrupt: its"), ("short", "short: too short"), ("noise", "type")):
                with self.assertRaisesRegex(ec.PipelineError, fault):
                    list(videos[name])

    def test_report_pictures_that_cannot_be_decoded(self):
        text = "simulator: eventsim-dvs\noutput: npz\nframerate: 25\n"
        folder = path_of("broken/films/first/")
        launch("videotestsrc pattern=ball num-buffers=6 ! video/x-raw,width=64,height=48"
               f" ! pngenc ! multifilesink {shlex.quote(f'location={folder}%d.png')}")
        for number in (1, 2, 4):
            write(f"broken/films/first/{number}.png", "no picture")
        recipe = recipe_of("broken", text + "videos: films/*")
        printed = event_dataset(recipe, status=1)
        for video in ec.Dataset(recipe):
            self.assertIn(f"refused: {video.name}: corrupt: 3 of its 6 pictures can be decoded\n", printed)
            with self.assertRaisesRegex(ec.PipelineError, f"{video.name}: corrupt: 3 of its 6 pictures can be decoded"):
                list(video)

    def test_have_any_name_are_of_files_only_and_apart_from_them(self):
        video = make_video(f"odd/videos/-{'ha' * 40}.mkv")  # Snakemake refuses periodic wildcards
        os.mkfifo(path_of("odd/videos/pipe.mkv"))
        recipe = recipe_of("odd")
        self.assertIn("1 videos: 1 made", event_dataset(recipe))
        self.assertIn("choose another folder", event_dataset(recipe, "--output", os.path.dirname(video), status=1))
        record, = glob.glob(path_of("odd/recipe/records/*"))
        event_dataset(recipe, "--video", "one", "--file", video, "--output", path_of("odd/alone"))
        self.assertEqual(os.listdir(path_of("odd/alone/data")), ["one.npz"])
        write(record, '{"written": {}}')
        self.assertIn("1 videos: 1 made", event_dataset(recipe))
        manifest = write("odd/manifest.json", '{"videos": [{"name": "a"}]}')
        self.assertIn("no manifest", event_dataset("verify", recipe, "--manifest", manifest, status=1))

    def test_go_on_after_a_kill(self):
        for number in range(4):
            make_video(f"killed/videos/{number}.mkv")
        recipe = recipe_of("killed")
        interrupted = stop_once_there_is(path_of("killed/recipe/unfinished/*"), recipe, "--cores", "1")
        for number in (signal.SIGINT, signal.SIGCONT):
            os.killpg(interrupted.pid, number)
        self.assertEqual(interrupted.wait(), 130)
        shutil.rmtree(path_of("killed/recipe"))
        records = path_of("killed/recipe/records/*.json")
        killed = stop_once_there_is(records, recipe, "--cores", "1")  # videos are made in any order
        os.killpg(killed.pid, signal.SIGKILL)
        killed.wait()
        before = {record: os.stat(record).st_mtime_ns for record in glob.glob(records)}
        self.assertLess(len(before), 4)
        self.assertRegex(event_dataset(recipe, status=1), "(?s)--unlock.*its job did not start or was killed")
        event_dataset(recipe, "--unlock")
        self.assertIn(f"4 videos: {4 - len(before)} made, {len(before)} unchanged", event_dataset(recipe))
        self.assertEqual(before, {record: os.stat(record).st_mtime_ns for record in before})
        self.assertEqual(len(hashes("killed")), 4)
        self.assertFalse(os.path.exists(path_of("killed/recipe/unfinished")))

    def test_report_failures_without_losing_the_rest(self):
        for name in ("one", "two"):
            make_video(f"failing/videos/{name}.mkv")
        os.makedirs(path_of("failing/recipe/previews/one.png"))
        printed = event_dataset(recipe_of("failing"), "--retries", "0", status=1)
        self.assertRegex(printed, "failed: one: .*Is a directory")
        self.assertIn("1 made, 0 unchanged, 0 refused, 1 failed", printed)
        os.rmdir(path_of("failing/recipe/previews/one.png"))
        self.assertIn("1 made, 1 unchanged", event_dataset(path_of("failing/recipe.yaml")))

    def test_are_planned(self):
        for name in ("a/1", "a/2", "b/1"):
            make_video(f"planned/videos/{name}.mkv")
        recipe = recipe_of("planned")
        printed = event_dataset(recipe, "--dry-run")
        for video in ec.Dataset(recipe):
            threshold = video.parameters["positive-threshold"]
            self.assertRegex(printed, f"(?m)^{video.name}\t{video.split}\t.*positive-threshold={threshold} ")
        self.assertIn("3 videos: 3 to make, 1 in test, 2 in train", printed)
        self.assertFalse(os.path.exists(path_of("planned/recipe")))
        event_dataset(recipe)
        os.remove(path_of("planned/recipe/data/b/1.npz"))
        self.assertIn("3 videos: 1 to make", event_dataset(recipe, "--dry-run"))
        self.assertIn("--dry-run is not for verify", event_dataset("verify", recipe, "--dry-run", status=2))

    def test_ask_slurm_once(self):
        """Before any job, with Slurm's own words."""
        make_video("refused/videos/0.mkv")
        recipe = recipe_of("refused")
        write("refused/profile/config.yaml", "cluster: sbatch --partition=none --cpus-per-task={threads}\njobs: 1\n")
        with program("refused/sbatch", 'echo "$@" >>"$0.words"\necho "sbatch: error: invalid partition" >&2\nexit 1'):
            for profile in ("slurm", path_of("refused/profile")):
                self.assertIn("error: Slurm takes no jobs: sbatch: error: invalid partition\n",
                              event_dataset(recipe, "--profile", profile, status=1))
        asked = read("refused/sbatch.words").splitlines()
        self.assertEqual(len(asked), 2)
        self.assertEqual(asked[1], "--partition=none --test-only --wrap=true")

    def test_are_made_in_parts(self):
        for number in range(4):
            make_video(f"parts/videos/{number}.mkv", frames=3)
        recipe = recipe_of("parts")
        self.assertRegex(event_dataset(recipe, "--part", "1/2"), "[1-3] not made yet")
        self.assertIn(" 0 not made yet", event_dataset(recipe, "--part", "2/2"))
        self.assertEqual(len(hashes("parts")), 4)

        # Other parts need no other events.
        recipe = recipe_of("parts", RECIPE.replace("train: 0.6, test: 0.4", "one: 0.5, two: 0.5"))
        os.remove(path_of("parts/videos/0.mkv"))
        os.symlink("nowhere", path_of("parts/videos/0.mkv"))
        printed = event_dataset(recipe)
        self.assertIn("0: kept; its input cannot be read", printed)
        self.assertIn("0 made, 4 unchanged", printed)
        for part in ("one", "two"):
            self.assertEqual(read(f"parts/recipe/{part}.txt").splitlines(),
                             [f"data/{video.name}.npz" for video in ec.Dataset(recipe, part)])
        printed = event_dataset(recipe_of("parts", RECIPE + "min-frames: 4"), status=1)
        self.assertIn("1: the recipe has changed; making it again", printed)
        self.assertIn("0 made, 0 unchanged, 3 refused, 1 failed", printed)

    def test_are_made_and_verified_in_parts_at_the_same_time(self):
        for number in range(4):
            make_video(f"parallel/videos/{number}.mkv", frames=3)
        recipe = recipe_of("parallel")
        for words, pattern in {(recipe,): "unfinished/*", ("verify", recipe): "verified/*.json"}.items():
            first = stop_once_there_is(path_of(f"parallel/recipe/{pattern}"), *words, "--part", "1/2",
                                       "--retries", "0")
            try:
                self.assertIn("cannot be locked", event_dataset(*words, status=1))
                event_dataset(*words, "--part", "2/2")
            finally:
                os.killpg(first.pid, signal.SIGCONT)
            self.assertEqual(first.wait(), 0)
        self.assertEqual(len(hashes("parallel")), 4)

    def test_are_not_verified_by_old_records(self):
        make_video("locked/videos/0.mkv")
        recipe = recipe_of("locked")
        event_dataset(recipe)
        event_dataset("verify", recipe)
        make_video("locked/videos/0.mkv", frames=9)
        with program("locked/snakemake", "exit 3"):
            for words in ((recipe,), ("verify", recipe)):
                self.assertIn("Snakemake ended with status 3", event_dataset(*words, status=1))


class Outputs(unittest.TestCase):
    def records(self, text):
        path = recipe_of("outputs", text)
        make_video("outputs/videos/ball.mkv", frames=12)
        video = ec.Dataset(path)[0]
        return video, [record_in(path_of("outputs/made/"), video) for _ in range(2)]

    def test_are_the_same_bytes_each_time(self):
        for output in OUTPUTS:
            with self.subTest(output):
                video, records = self.records(RECIPE.replace("npz", output))
                self.assertEqual(records[0]["written"], records[1]["written"])
                events = sum(len(chunk) for chunk in video.events())
                self.assertEqual(records[0]["figures"]["events"], events)
                self.assertGreater(events, 500)
                if output not in ("tensors", "csv", "txt"):
                    self.assertEqual(len(ec.read(path_of(f"outputs/made/data/ball.{output}"))), events)

    def test_are_written_at_once(self):
        apart = {output: self.records(RECIPE.replace("npz", output))[1][0]["written"][output]
                 for output in ("csv", "tensors", "raw")}
        _, records = self.records(RECIPE.replace("npz", "[csv, tensors, raw]"))
        self.assertEqual(records[0]["written"], apart)
        for file in apart.values():
            self.assertTrue(os.path.exists(path_of("outputs/made/" + file["path"])))

    def test_of_tensors_are_those_on_the_fly(self):
        video, _ = self.records(RECIPE.replace("npz", "tensors\ntensors: bins=3 frame-count=2 data-type=float16"))
        stored = np.load(path_of("outputs/made/data/ball.npy"))
        self.assertEqual((stored.shape, stored.dtype), ((6, 3, 48, 64), np.float16))
        self.assertTrue(np.array_equal(stored, np.stack(list(video))))

    def test_of_pictures_and_moving_windows(self):
        folder = path_of("pictures/films/first/")
        launch("videotestsrc pattern=ball num-buffers=11 ! video/x-raw,width=66,height=50 ! jpegenc"
               f" ! multifilesink {shlex.quote(f'location={folder}%d.jpg')}")  # 2.jpg comes before 10.jpg
        text = "simulator: eventsim-dvs\noutput: npz\nframerate: 30000/1001\n"
        film = ec.Dataset(recipe_of("pictures", text + "videos: films/*"))[0]
        chunks = list(film)
        self.assertEqual((film.name, len(chunks)), ("first", 10))
        self.assertAlmostEqual(chunks[-1].end, 10 * 1.001 / 30, places=5)
        self.assertLess(max(map(len, chunks)), 2 * min(map(len, chunks)))  # no jumps

        text += "window: {width: 30, height: 20, distance: 9}\nvideos: films/first/1.jpg"
        window = ec.Dataset(recipe_of("pictures", text))[0]
        record = record_in(path_of("pictures/made/"), window)
        self.assertEqual([record["figures"][key] for key in ("width", "height", "frames")], [30, 20, 37])
        there = np.concatenate(list(window))
        self.assertGreater(len(there), 100)


class Recipes(unittest.TestCase):
    def expect(self, error, text):
        with self.assertRaises(ec.RecipeError) as caught:
            ec.Dataset(recipe_of("recipes", text))
        self.assertIn(error, str(caught.exception))

    def test_are_checked(self):
        make_video("recipes/videos/ball.mkv", frames=2)
        base = "videos: videos/*\nsimulator: eventsim-dvs\n"
        for error, text in {
            "unknown key vidoes; known are": base + "vidoes: a",
            "line 1: seed is given twice": "seed: 1\nseed: 2",
            "videos: no file matches nothing/*": base.replace("videos/", "nothing/"),
            'no element "eventsim-dvd"': base.replace("dvs", "dvd"),
            "simulator: give one element": base.replace("dvs", "dvs ! eventdenoise"),
            'no property "colour"': base.replace("dvs", "dvs colour=red"),
            "eventsim-dvs leak-rate=-5: it must be from 0 to": base.replace("dvs", "dvs leak-rate=-5"),
            "eventtensor bins=100000: it must be from 1 to": base + "output: tensors\ntensors: bins=100000",
            "output: 'avi' is none of aedat4, csv": base + "output: [h5, avi]",
            "window: give width, height and distance": base + "framerate: 9\nwindow: {width: 3}",
            "split: the shares add up to 0.9": base + "split: {train: 0.9}",
            "split: '../x' is no name": base + "split: {../x: 1}",
            "group: missing )": base + "split: {train: 1}\ngroup: (",
            "is also set by simulator": base.replace("dvs", "dvs seed=1") + "parameters: {seed: 2}",
        }.items():
            self.expect(error, text)
        for error, value in {
            "99 is not a number from 0.001 to 10": "positive-threshold: 99",
            "uniform needs [minimum, maximum], not [0.3, 0.2]": "positive-threshold: {uniform: [0.3, 0.2]}",
            "is not within the property's 0.001 to 10": "positive-threshold: {uniform: [0.1, 20]}",
            'could not set property "preset"': "preset: {choice: [gen4, gen5]}",
            "relative-to needs a parameter": "positive-threshold: {uniform: [1, 2], relative-to: leak-rate}",
            "hardly ever within 0.001 to 10":
                "leak-rate: 9000\n  positive-threshold: {uniform: [1, 2], relative-to: leak-rate}",
        }.items():
            self.expect(error, base + f"parameters:\n  {value}")
        shutil.copy(path_of("recipes/videos/ball.mkv"), path_of("recipes/videos/ball.mp4"))
        self.expect("have the same name, ball; rename one", base)
        os.rename(path_of("recipes/videos/ball.mp4"), path_of("recipes/videos/{ball}.mp4"))
        self.expect("{ball}' has braces", base)
        os.rename(path_of("recipes/videos/{ball}.mp4"), path_of("recipes/videos/b\udce4ll.mp4"))
        self.expect(path_of("recipes/videos/b\\xe4ll.mp4") + " is not UTF-8; rename it", base)

    def test_run_only_harmless_elements(self):
        make_video("harmless/videos/ball.mkv", frames=3)
        base = "videos: videos/*\nsimulator: eventsim-dvs\noutput: csv\n"
        stolen = path_of("harmless/stolen.csv")
        chain = f"tee name=z z. ! queue ! eventcsvenc ! filesink location=\"{stolen}\" z. ! queue"
        for error, text in {
            "filters: \"tee name=z z.\" is neither": base + f"filters: '{chain}'",
            "frames: tee is none of the elements": base + "frames: tee ! filesink location=stolen.csv",
            "filters: filesink is none": base + "filters: eventdenoise ! filesink location=stolen.csv",
            "filters: eventhotpixel: location may name": base + "filters: eventhotpixel location=stolen.csv",
            "filters: eventdenoise: name may name": base + "filters: eventdenoise name=z",
            'frames: "( videoconvert )" is neither': base + "frames: ( videoconvert )",
            "simulator: filesink is none": base.replace("eventsim-dvs", "filesink location=stolen.csv"),
            'simulator: "eventsim-dvs name=z z." is': base.replace("eventsim-dvs", "eventsim-dvs name=z z."),
            "simulator: eventsim-dvs: profile may": base.replace("dvs", "dvs profile=/etc/passwd"),
            "parameters: profile: may name": base + "parameters: {profile: /etc/passwd}",
            "tensors: give properties": base.replace("csv", "tensors") + "tensors: bins=5 ! queue",
            'tensors: "eventtensor bins=5 z." is': base.replace("csv", "tensors") + "tensors: bins=5 z.",
        }.items():
            with self.subTest(error):
                self.expect(error, text)
        recipe = recipe_of("harmless", base + f"filters: '{chain}'")
        self.assertIn("if you trust the recipe, run it with --trust", event_dataset(recipe, status=2))
        self.assertFalse(os.path.exists(stolen))
        event_dataset(recipe, "--trust")
        self.assertTrue(os.path.exists(stolen))
        harmless = ("frames: videoscale ! video/x-raw, width=(int)64,height=48 ! queue\n"
                    "filters: eventdenoise ! eventscale ! application/x-event-camera,width=20,height=15\n")
        video = ec.Dataset(recipe_of("harmless", base + harmless))[0]
        figures = record_in(path_of("harmless/made/"), video)["figures"]
        self.assertEqual([figures[key] for key in ("width", "height")], [20, 15])

    def test_of_any_text_are_read_soon(self):
        base = "videos: videos/*\nsimulator: eventsim-dvs\n"
        merges = "".join(f"  - &m{i} {{<<: [{', '.join([f'*m{i - 1}'] * 9)}], k{i}: 1}}\n" for i in range(1, 9))
        for error, text in {
            "a number has 90001 characters": base + f"seed: 1{':59' * 30_000}",
            "too long for a recipe": base + "".join(f"k{i}: 1\n" for i in range(100_000)),
            "<< is not for recipes": base + "parameters:\n  - &m0 {a: 1}\n" + merges,
            "more than 1000 values": base + f"parameters: {{seed: {{choice: [{'1,' * 10_000}]}}}}",
        }.items():
            start = time.monotonic()
            self.expect(error, text)
            self.assertLess(time.monotonic() - start, 10)

    def test_of_the_documentation_are_right(self):
        with open(os.path.join(os.environ["SOURCE"], "docs", "data-sets.md"), encoding="utf-8") as file:
            texts = re.findall(r"^```yaml\n(.*?)^```", file.read(), re.MULTILINE | re.DOTALL)
        self.assertEqual(len(texts), 4)
        for text in texts:
            ec.Recipe.load(recipe_of("documented", text))

    def test_draw_the_same_everywhere(self):
        for name in ("a", "b", "c"):
            make_video(f"draws/videos/{name}.mkv", frames=2)
        text = RECIPE + "group: '^.'\n"
        drawn = {video.name: dict(video.parameters) for video in ec.Dataset(recipe_of("draws", text))}
        self.assertEqual(drawn["a"], {"positive-threshold": 0.242983, "negative-threshold": 0.275159,
                                      "seed": 2363029605827867})
        subset = ec.Dataset(recipe_of("draws", text.replace("**/*", "**/[bc]")))
        self.assertEqual({video.name: dict(video.parameters) for video in subset}, {k: drawn[k] for k in "bc"})
        self.assertEqual(len({str(one) for one in drawn.values()}), 3)
        for one in drawn.values():
            self.assertTrue(0.8 <= one["negative-threshold"] / one["positive-threshold"] <= 1.2)
        more = text.replace("parameters:", "parameters:\n  refractory-period: {uniform: [1000, 9000]}")
        whole = ec.Dataset(recipe_of("draws", more))[0].parameters
        self.assertIs(type(whole["refractory-period"]), int)
        self.assertEqual(whole["seed"], drawn["a"]["seed"])

    def test_split_by_exact_shares(self):
        make_video("draws/videos/a.mkv", frames=2)
        split = "split: {train: 0.8, validation: 0.1, test: 0.1}"
        text = RECIPE.replace("split: {train: 0.6, test: 0.4}", split)
        recipe = ec.Recipe.load(recipe_of("draws", text))
        for total, expected in {10: (8, 1, 1), 7: (5, 1, 1), 91: (73, 9, 9), 1000: (800, 100, 100)}.items():
            found = sizes(recipe.parts(map(str, range(total))))
            self.assertEqual(tuple(found.get(part, 0) for part in recipe.split), expected)
        # Of each folder, too.
        parts = recipe.parts(f"{folder}/{number}" for folder in "abcdefg" for number in range(20))
        for folder in "abcdefg":
            of_folder = sizes({name: part for name, part in parts.items() if name[0] == folder})
            self.assertEqual(of_folder, {"train": 16, "validation": 2, "test": 2})
        # Videos of a group stay together.
        recipe = ec.Recipe.load(recipe_of("draws", text + "group: 'g\\d+'\n"))
        parts = recipe.parts(f"x_g{group:02}_{number}" for group in range(30) for number in range(group % 7 + 1))
        for group in range(30):
            self.assertEqual(len({part for name, part in parts.items() if f"g{group:02}" in name}), 1)
        for part, share in recipe.split.items():
            self.assertLessEqual(abs(sizes(parts)[part] - share * len(parts)), 7)

    def test_distributions(self):
        shares = [uniform_number("key", i) for i in range(2000)]
        self.assertAlmostEqual(np.mean(shares), 0.5, delta=0.03)
        normal = [Distribution("normal", (0.2, 0.03)).at(share) for share in shares]
        self.assertAlmostEqual(np.mean(normal), 0.2, delta=0.003)
        self.assertAlmostEqual(np.std(normal), 0.03, delta=0.003)
        logarithmic = [Distribution("log-uniform", (0.01, 1)).at(share) for share in shares]
        self.assertAlmostEqual(np.median(logarithmic), 0.1, delta=0.02)
        chosen = [Distribution("choice", ("a", "b")).at(share) for share in shares]
        self.assertAlmostEqual(chosen.count("a") / 2000, 0.5, delta=0.05)
        self.assertEqual(Distribution("normal", (3, 0)).at(0.7), 3)


if __name__ == "__main__":
    unittest.main(verbosity=2)
