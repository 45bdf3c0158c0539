#!/usr/bin/python3 -B
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Makes a data set of events from videos or folders of pictures, as a recipe says:

    event-dataset recipe.yaml
    event-dataset verify recipe.yaml

The folder beside the recipe, of its name, gets the events, a manifest of all hashes, lists of the parts,
statistics and a page of pictures. A second call makes only what is missing or has changed. "verify" makes
the events again, keeps none, and compares their hashes, and those of the files in data/, with the manifest."""
import argparse
import concurrent.futures
import contextlib
import fcntl
import glob
import json
import os
import re
import shlex
import shutil
import struct
import subprocess
import sys
import time

try:
    import dataset_clips
    import gst_eventcamera as ec
    from dataset_report import write_reports
    from dataset_video import extension_of, hash_of, making_of, path_in, record_of, state_of, write_record
    from gst_eventcamera.recipe import uniform_number
    from plugins import find_plugins
    from progress import Progress
except ImportError as missing:
    sys.exit(f"error: {missing}\nInstall python3-gst-eventcamera, a Debian package of gst-eventsim, and python3-yaml,"
             " or in a checkout run ./pipelines/event-dataset")

HERE = os.path.dirname(os.path.realpath(__file__))
STEP = re.compile(r"^(\d+) of (\d+) steps")
MAX_TOLD = 20  # lines about videos of a kind
LOCK_SIZE = 1 << 60  # bytes that stand for all videos; a part locks its share of them
FLOCK = struct.Struct("hhqqi4x")  # of the C library


class VideosDone(Progress):
    """Tells of each video on a terminal, of each tenth of the videos elsewhere."""

    def __init__(self, count):
        super().__init__()
        self._count = count
        self._began = time.monotonic()
        self._told = 0

    def tell(self, done):
        done = min(done, self._count)
        if not self.on_terminal and done * 10 // self._count == self._told:
            return
        self._told = done * 10 // self._count
        left = (self._count - done) * (time.monotonic() - self._began) / max(done, 1)
        super().tell(f"{done} of {self._count} videos, about {left // 3600:.0f}:{left // 60 % 60:02.0f}:"
                     f"{left % 60:02.0f} left")


def options():
    parser = argparse.ArgumentParser(
        prog="event-dataset", usage="%(prog)s [verify] RECIPE [option ...]", description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("words", nargs="+", metavar="[verify] RECIPE", help="a file of YAML")
    parser.add_argument("-o", "--output", metavar="FOLDER",
                        help="folder of the data set (default: that of the recipe's name, beside it)")
    parser.add_argument("--cores", type=int, default=os.cpu_count(), metavar="N",
                        help="videos at a time on this machine (default: one for each processor)")
    parser.add_argument("--retries", type=int, default=2, metavar="N",
                        help="how often a job that failed is tried again (default: %(default)s)")
    parser.add_argument("--profile", metavar="PROFILE",
                        help="Snakemake profile: \"slurm\" runs the jobs on a Slurm cluster; others are a folder, or"
                        " a name that Snakemake knows")
    parser.add_argument("--part", type=part_of_all, default=(1, 1), metavar="K/N",
                        help="make only the K-th of N parts, such as 3/100, for data sets of more than 10,000 videos")
    parser.add_argument("--clip-duration", type=int, default=300, metavar="SECONDS",
                        help="a video of two or more clips of this length is simulated in a job for each; the"
                        " events are the same (default: %(default)s, 0 = never)")
    parser.add_argument("--manifest", metavar="FILE",
                        help="the manifest that verify compares with (default: that of the folder)")
    parser.add_argument("--video", metavar="NAME", help="make one video only, as the jobs do; needs --file")
    parser.add_argument("--file", help="the file of that video")
    parser.add_argument("--cuts", nargs="+", type=int, default=[], help=argparse.SUPPRESS)
    parser.add_argument("--clip-number", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--version", action="version", version="%(prog)s @VERSION@",
                        help="print the version and exit")
    args = parser.parse_args()
    args.verify = args.words[0] == "verify" and len(args.words) > 1
    if len(args.words) != 1 + args.verify:
        parser.error(f"give one recipe, not {' '.join(args.words)}")
    if (args.video is None) != (args.file is None):
        parser.error("--video and --file need each other")
    if args.cores < 1 or args.retries < 0 or args.clip_duration < 0:
        parser.error("--cores is at least 1, --retries and --clip-duration at least 0")
    args.recipe = args.words[-1]
    args.output = os.path.abspath(args.output or os.path.splitext(args.recipe)[0])
    return args


def part_of_all(text):
    match = re.fullmatch(r"(\d+)/(\d+)", text)
    if not match or not 1 <= int(match[1]) <= int(match[2]):
        raise argparse.ArgumentTypeError(f"{text} is not a part such as 3/100")
    return int(match[1]), int(match[2])


# records


def read_json(path):
    """None if there is no such file, or not whole."""
    try:
        with open(path, encoding="utf-8") as file:
            return json.load(file)
    except (FileNotFoundError, ValueError):
        return None


def reason_to_make(video, record, output):
    """Why a video has to be made; empty if it need not."""
    if not record or "written" not in record:
        return "missing"
    try:
        written = os.path.getsize(os.path.join(output, record["written"]["path"]))
    except FileNotFoundError:
        return "missing"
    if written != record["written"]["size"]:
        return "its events are not those that were written"
    if record["making"] != making_of(video) or record["figures"]["frames"] < video.recipe.min_frames:
        return "the recipe has changed"
    try:
        if record.get("state") != state_of(video.path) and record["input"]["sha256"] != hash_of(video.path):
            return "the input has changed since the manifest"
    except OSError as failure:  # such as a disk that is not mounted
        print(f"{video.name}: kept as it was made; its input cannot be read: {failure}", file=sys.stderr)
    return ""


def stale_videos(videos, records, output):
    """The videos that have to be made, without their records and events; says which have changed."""
    stale = []
    for video in videos:
        record = records[video.name]
        reason = reason_to_make(video, record, output)
        if not reason:
            continue
        stale.append(video)
        if reason != "missing":
            print(f"{video.name}: {reason}; making it again", file=sys.stderr)
        paths = {path_in(output, "records", video.name, "json"),
                 path_in(output, "data", video.name, extension_of(video.recipe))}
        if record and "written" in record:
            written_as = os.path.splitext(record["written"]["path"])[1].removeprefix(".")
            paths.add(path_in(output, "data", video.name, written_as))
        for path in paths:
            if os.path.exists(path):
                os.remove(path)
    return stale


# the workflow


def locked(output, part):
    """Refuses to work beside another process on the same videos; returns what keeps others away until it and its
    copies in other processes are closed."""
    lock = open(os.path.join(output, ".lock"), "w", encoding="utf-8")
    start, end = (place * LOCK_SIZE // part[1] for place in (part[0] - 1, part[0]))
    try:
        fcntl.fcntl(lock, fcntl.F_OFD_SETLK, FLOCK.pack(fcntl.F_WRLCK, os.SEEK_SET, start, end - start, 0))
    except BlockingIOError:
        raise RuntimeError(f"another event-dataset works in {output}; wait for it, or name another folder") from None
    return lock


def log_of(args):
    """What Snakemake writes."""
    number, count = args.part
    return os.path.join(args.output, "snakemake.log" if count == 1 else f"snakemake-{number}-of-{count}.log")


def profile_options(profile):
    """Our own profiles by their names; Snakemake finds others. It gives a shell the path of a profile's
    program without quotes."""
    own = os.path.join(HERE, profile)
    if os.sep in profile or not os.path.isfile(os.path.join(own, "config.yaml")):
        return ["--profile", profile]
    return ["--profile", own, "--cluster-status", shlex.quote(os.path.join(own, "status"))]


def clips_root(args):
    return "verified-clips" if args.verify else "clips"


def clips_folder(args, name):
    return dataset_clips.folder_of(args.output, clips_root(args), name)


def job_of(args, video):
    """What the workflow has to know of a video. Clips of another input or recipe are removed."""
    cuts = dataset_clips.cuts_of(video, args.clip_duration)
    if cuts and (reason := dataset_clips.reason_against(video)):
        print(f"{video.name}: in one job, not in clips: {reason}", file=sys.stderr)
        cuts = []
    dataset_clips.remove_others(video, clips_folder(args, video.name), cuts)
    return {"path": os.path.abspath(video.path), "cuts": cuts, "in-order": dataset_clips.has_state(video)}


def make(args, videos, lock):
    """Runs a job for each video, or for each of its clips and then one that joins them. Those that fail
    leave no record."""
    command = [os.path.realpath(__file__), *["verify"] * args.verify, os.path.abspath(args.recipe),
               "--output", args.output]
    jobs = ".jobs-{}-of-{}.json".format(*args.part)
    with (concurrent.futures.ThreadPoolExecutor(args.cores) as pool,
          open(os.path.join(args.output, jobs), "w", encoding="utf-8") as file):
        found = pool.map(lambda video: job_of(args, video), videos)
        json.dump({"videos": {video.name: job for video, job in zip(videos, found)}, "command": shlex.join(command),
                   "records": records_folder(args), "clips": clips_root(args)}, file)
    where = profile_options(args.profile) if args.profile else ["--cores", str(args.cores)]
    snakemake = subprocess.Popen(
        ["snakemake", "--snakefile", os.path.join(HERE, "dataset.smk"), "--directory", args.output, *where,
         "--nolock", "--keep-going", "--rerun-incomplete", "--retries", str(args.retries), "--nocolor",
         "--rerun-triggers", "mtime", "--drop-metadata", "--scheduler", "greedy",
         "--config", f"jobs={jobs}"],  # read as YAML, so that it has no paths of the user
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace", pass_fds=[lock.fileno()])
    progress = VideosDone(len(videos))
    try:
        with open(log_of(args), "w", encoding="utf-8") as log:
            for line in snakemake.stdout:
                log.write(line)
                log.flush()
                if step := STEP.match(line):
                    progress.tell(int(step[1]) * len(videos) // (int(step[2]) - 1))
    finally:
        progress.end()
        for _ in snakemake.stdout:  # it ends its jobs at Ctrl-C, and cannot while nobody reads what it writes
            continue
        snakemake.wait()
        with contextlib.suppress(OSError):  # another part uses it, or a job was killed
            os.rmdir(os.path.join(args.output, "unfinished"))
    return snakemake.returncode


def records_folder(args):
    return "verified" if args.verify else "records"


def failure_of(args, name):
    """The last line that the jobs of a video wrote."""
    logs = glob.glob(glob.escape(clips_folder(args, name)) + "/*.log")
    for path in [*sorted(logs), os.path.join(args.output, "logs", f"{name}.log")]:
        with contextlib.suppress(FileNotFoundError), open(path, encoding="utf-8", errors="replace") as file:
            if lines := file.read().strip().splitlines():
                return lines[-1]
    return f"its job did not start or was killed; see {os.path.basename(log_of(args))}"


def tell(kind, lines):
    for line in lines[:MAX_TOLD]:
        print(f"{kind}: {line}")
    if len(lines) > MAX_TOLD:
        print(f"{kind}: and {len(lines) - MAX_TOLD} more")


def records_of(args, videos):
    """With the parts of today's recipe, which do not need another simulation."""
    found = {}
    for video in videos:
        record = read_json(os.path.join(args.output, records_folder(args), f"{video.name}.json"))
        found[video.name] = record | {"split": video.split} if is_record(record) else None
    return found


def is_record(record):
    """True if it has what is looked up in it."""
    def has(part, *keys):
        return isinstance(part, dict) and all(key in part for key in keys)

    return (has(record, "name", "split", "input", "making") and has(record["input"], "sha256")
            and has(record["making"], "line")
            and ("refused" in record or has(record, "written", "figures", "versions")
                 and has(record["written"], "path", "size", "sha256")))


# the commands


def make_one(args, recipe):
    name = args.video
    video = ec.DatasetVideo(recipe, name, args.file)
    folder, clips, notes = clips_folder(args, name), None, {}
    if args.clip_number is not None:
        dataset_clips.make_clip(video, folder, args.cuts, args.clip_number)
        return
    if args.cuts:
        try:
            clips = dataset_clips.Clips(video, folder, args.cuts)
        except dataset_clips.NotJoinable as reason:
            notes = {"whole": f"made as a whole, not in clips: {reason}"}
    record = record_of(video, args.output, keep=not args.verify, clips=clips)
    write_record(path_in(args.output, records_folder(args), name, "json"), record | notes)
    shutil.rmtree(folder, ignore_errors=True)


def remove_clips(args, videos):
    """In case a job was killed before it did so."""
    for video in videos:
        folder = clips_folder(args, video.name)
        shutil.rmtree(folder, ignore_errors=True)
        with contextlib.suppress(OSError):  # other clips are there, or none have been
            os.removedirs(os.path.dirname(folder))


def selected(args, videos):
    number, count = args.part
    return [video for video in videos if int(uniform_number(video.name, "part") * count) == number - 1]


def expect_own_folder(output, videos):
    """The folder of a data set is written to and cleaned up, so that of its videos must be another."""
    folder = os.path.realpath(output)
    for video in videos:
        if os.path.commonpath([folder, os.path.realpath(video.path)]) == folder:
            raise RuntimeError(f"{output} has {video.path}, a video of the recipe; choose another folder with --output")


def make_all(args, recipe):
    """The exit status."""
    videos = list(ec.Dataset(recipe))
    expect_own_folder(args.output, videos)
    os.makedirs(args.output, exist_ok=True)
    with locked(args.output, args.part) as lock:
        if args.part == (1, 1):
            shutil.rmtree(os.path.join(args.output, "unfinished"), ignore_errors=True)
        mine = selected(args, videos)
        stale = stale_videos(mine, records_of(args, mine), args.output)
        status = make(args, stale, lock) if stale else 0
        with open(os.path.join(args.output, ".lock-reports"), "w", encoding="utf-8") as reports:
            fcntl.flock(reports, fcntl.LOCK_EX)  # other parts write them as well, with all records
            records = records_of(args, videos)
            write_reports(args.output, recipe, videos, records)
        remove_clips(args, [video for video in mine if records[video.name]])
    refused = [f"{name}: {record['refused']}" for name, record in records.items() if record and "refused" in record]
    failed = [video.name for video in stale if not records[video.name]]
    tell("warning", [f"{name}: {warning}" for name, record in records.items() if record
                     for warning in record.get("warnings", ())])
    tell("note", [f"{video.name}: {records[video.name]['whole']}" for video in stale
                  if "whole" in (records[video.name] or {})])
    tell("refused", refused)
    tell("failed", [f"{name}: {failure_of(args, name)}" for name in failed])
    made = sum(1 for video in stale if records[video.name] and "written" in records[video.name])
    absent = sum(1 for record in records.values() if not record) - len(failed)
    print(f"{len(videos)} videos: {made} made, {len(mine) - len(stale)} unchanged, {len(refused)} refused,"
          f" {len(failed)} failed, {absent} not made yet; {args.output}")
    if status != 0 and not failed:
        raise RuntimeError(f"Snakemake ended with status {status}; see {log_of(args)}")
    return 1 if refused or failed else 0


def verify_all(args, recipe):
    """The exit status."""
    manifest = read_json(args.manifest or os.path.join(args.output, "manifest.json"))
    if (not isinstance(manifest, dict) or not isinstance(manifest.get("videos"), list)
            or not all(map(is_record, manifest["videos"])) or not isinstance(manifest.get("refused", {}), dict)):
        raise RuntimeError(f"{args.manifest or args.output}: no manifest; make the data set first, or give one"
                           " with --manifest")
    expected = {one["name"]: one for one in manifest["videos"]}
    videos = selected(args, ec.Dataset(recipe))
    present = [video for video in videos if video.name in expected]
    expect_own_folder(args.output, videos)
    os.makedirs(args.output, exist_ok=True)
    with locked(args.output, args.part) as lock:
        remove_clips(args, present)
        for video in present:
            with contextlib.suppress(FileNotFoundError):
                os.remove(path_in(args.output, records_folder(args), video.name, "json"))
        if present:
            make(args, present, lock)
        records = records_of(args, present)
        remove_clips(args, [video for video in present if records[video.name]])
    differences = [f"{name}: not among the videos" for name in expected
                   if args.part == (1, 1) and name not in records]
    differences += [f"{video.name}: not in the manifest" for video in videos
                    if video.name not in expected and video.name not in manifest.get("refused", {})]
    for name, record in records.items():
        difference = difference_of(expected[name], record) if record else failure_of(args, name)
        if difference:
            differences.append(f"{name}: {difference}")
    with concurrent.futures.ThreadPoolExecutor(args.cores) as pool:
        found = pool.map(lambda video: is_damaged(expected[video.name]["written"], args.output), present)
        differences += [f"{video.name}: its file of events is not that of the manifest"
                        for video, damaged in zip(present, found) if damaged]
    tell("different", differences)
    print(f"{len(present)} videos of the manifest compared, {len(differences)} differences")
    return 1 if differences else 0


def difference_of(expected, record):
    """What differs first, from input to output; empty if nothing does."""
    if expected["input"]["sha256"] != record["input"]["sha256"]:
        return "the input has changed since the manifest"
    if expected["making"] != record["making"]:
        return f"made by \"{record['making']['line']}\" instead of \"{expected['making']['line']}\""
    if "refused" in record:
        return record["refused"]
    if expected["written"]["sha256"] == record["written"]["sha256"]:
        return ""
    if expected["versions"] != record["versions"]:
        return f"other events, by {record['versions']} instead of {expected['versions']}"
    return "other events, by the same versions"


def is_damaged(written, output):
    """True if a file of events is there, and is not what was written."""
    path = os.path.join(output, written["path"])
    return os.path.exists(path) and hash_of(path) != written["sha256"]


def main():
    args = options()
    find_plugins()
    recipe = ec.Recipe.load(args.recipe)
    if args.video:
        make_one(args, recipe)
        return 0
    if not shutil.which("snakemake"):
        raise RuntimeError("Snakemake is missing; on Debian, install: snakemake")
    return verify_all(args, recipe) if args.verify else make_all(args, recipe)


if __name__ == "__main__":
    try:
        sys.exit(main())
    except ec.RecipeError as failure:
        print(f"error: {failure}", file=sys.stderr)
        sys.exit(2)
    except (RuntimeError, OSError) as failure:
        sys.exit(f"error: {failure}")
    except KeyboardInterrupt:
        print("interrupted; run the same command to resume", file=sys.stderr)
        sys.exit(130)
