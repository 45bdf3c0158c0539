#!/usr/bin/python3 -B
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Makes a data set of events from videos or folders of pictures, following a recipe:

    event-dataset recipe.yaml
    event-dataset verify recipe.yaml

Events, a manifest with all hashes, lists of the parts, statistics and a page of pictures go to a folder beside
the recipe, with the same name. A second call makes only missing and changed files. "verify" simulates the
events again without keeping them, and compares their hashes and the hashes of the files in data/ with the
manifest."""
import argparse
import collections
import concurrent.futures
import contextlib
import fcntl
import hashlib
import json
import os
import re
import shlex
import shutil
import subprocess
import sys

try:
    import gst_eventcamera as ec
    import yaml
    from dataset_report import write_reports
    from dataset_video import hash_of, making_of, record_of, state_of, write_record
    from gst_eventcamera.recipe import uniform_number
    from program import find_plugins, option_parser
except ImportError as missing:
    sys.exit(f"error: {missing}\nInstall python3-gst-eventcamera, a Debian package of gst-eventsim, and python3-yaml,"
             " or in a checkout run ./pipelines/event-dataset")

HERE = os.path.dirname(os.path.realpath(__file__))
MAX_LINES = 20  # printed of a kind


def options():
    parser = option_parser(__doc__, prog="event-dataset", usage="%(prog)s [verify] RECIPE [option ...]")
    parser.add_argument("words", nargs="+", metavar="[verify] RECIPE", help="a file of YAML")
    parser.add_argument("-o", "--output", metavar="FOLDER",
                        help="folder of the data set (default: beside the recipe, with its name)")
    parser.add_argument("--cores", type=int, default=os.cpu_count(), metavar="N",
                        help="videos at a time on this machine (default: one for each processor)")
    parser.add_argument("--retries", type=int, default=2, metavar="N",
                        help="how often a job that failed is tried again (default: %(default)s)")
    parser.add_argument("--profile", metavar="PROFILE",
                        help="Snakemake profile: \"slurm\" runs the jobs on a Slurm cluster; others are a folder, or"
                        " a name that Snakemake knows")
    parser.add_argument("--part", type=part_of_all, default=(1, 1), metavar="K/N",
                        help="make only the K-th of N parts, such as 3/100, for data sets of more than 10,000 videos")
    parser.add_argument("--dry-run", action="store_true",
                        help="print the videos, their parts and drawn parameters, and which would be made")
    parser.add_argument("--manifest", metavar="FILE",
                        help="the manifest that verify compares with (default: the folder's manifest)")
    parser.add_argument("--video", metavar="NAME", help="make one video only, as the jobs do; needs --file")
    parser.add_argument("--file", help="the file of that video")
    parser.add_argument("--trust", action="store_true",
                        help="run any elements, which may read and write your files and send them; otherwise a recipe"
                        " has only elements that do neither")
    parser.add_argument("--unlock", action="store_true",
                        help="remove the lock that a killed run has left, and exit")
    args = parser.parse_args()
    args.verify = args.words[0] == "verify" and len(args.words) > 1
    if len(args.words) != 1 + args.verify:
        parser.error(f"give one recipe, not {' '.join(args.words)}")
    if args.dry_run and args.verify:
        parser.error("--dry-run is not for verify")
    if (args.video is None) != (args.file is None):
        parser.error("--video and --file need each other")
    if args.cores < 1 or args.retries < 0:
        parser.error("--cores must be at least 1, --retries at least 0")
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
    """None if the file does not exist or is incomplete."""
    try:
        with open(path, encoding="utf-8") as file:
            return json.load(file)
    except (FileNotFoundError, ValueError):
        return None


def is_record(record):
    """True if it has the fields that are read."""
    def has(part, *keys):
        return isinstance(part, dict) and all(key in part for key in keys)

    return (has(record, "name", "input", "making") and has(record["input"], "sha256")
            and has(record["making"], "line")
            and ("refused" in record or has(record, "written", "figures", "versions")
                 and isinstance(record["written"], dict)
                 and all(has(file, "path", "size", "sha256") for file in record["written"].values())))


def id_of(name):
    """ID of a video's job."""
    return hashlib.sha256(name.encode()).hexdigest()[:16]


def records_folder(args):
    return "verified" if args.verify else "records"


def record_path(args, name):
    return os.path.join(args.output, records_folder(args), id_of(name) + ".json")


def read_records(args, videos):
    """Records by name, None if missing. The split follows today's recipe and videos, which needs no new
    simulation."""
    found = {}
    for video in videos:
        record = read_json(record_path(args, video.name))
        found[video.name] = record | {"split": video.split} if is_record(record) else None
    return found


def reason_to_make(video, record, output):
    """Reason to make a video; empty if it is up to date."""
    if not record or "written" not in record:
        return "missing"
    for file in record["written"].values():
        try:
            size = os.path.getsize(os.path.join(output, file["path"]))
        except FileNotFoundError:
            return "missing"
        if size != file["size"]:
            return "the size of its file of events has changed"
    if record["making"] != making_of(video) or record["figures"]["frames"] < video.recipe.min_frames:
        return "the recipe has changed"
    try:
        if record.get("state") != state_of(video.path) and record["input"]["sha256"] != hash_of(video.path):
            return "the input has changed since the manifest"
    except OSError as failure:  # such as a disk that is not mounted
        print(f"{video.name}: kept; its input cannot be read: {failure}", file=sys.stderr)
    return ""


def stale_videos(videos, records, output):
    """The videos that have to be made; prints which have changed."""
    reasons = [(video, reason_to_make(video, records[video.name], output)) for video in videos]
    for video, reason in reasons:
        if reason not in ("", "missing"):
            print(f"{video.name}: {reason}; making it again", file=sys.stderr)
    return [video for video, reason in reasons if reason]


# the workflow


def profile_options(profile):
    """Options for one of our profiles, by name, or any other that Snakemake finds."""
    own = os.path.join(HERE, profile)
    if os.sep in profile or not os.path.isfile(os.path.join(own, "config.yaml")):
        expect_slurm(profile)
        return ["--profile", profile]
    expect_slurm(own)
    # Snakemake passes the path of a profile's program to a shell without quotes.
    return ["--profile", own, "--cluster-status", shlex.quote(os.path.join(own, "status"))]


def expect_slurm(folder):
    """Raises RuntimeError if a profile submits jobs with sbatch, which refuses them."""
    try:
        with open(os.path.join(folder, "config.yaml"), encoding="utf-8") as file:
            words = shlex.split((yaml.safe_load(file) or {}).get("cluster", ""))
    except (FileNotFoundError, NotADirectoryError, yaml.YAMLError):  # Snakemake reports it, or looks elsewhere
        return
    if words[:1] != ["sbatch"]:
        return
    words = [word for word in words if "{" not in word]  # set by Snakemake for each job
    try:
        tested = subprocess.run([*words, "--test-only", "--wrap=true"], capture_output=True, text=True)
    except FileNotFoundError:
        raise RuntimeError("sbatch is missing; on Debian, install: slurm-client") from None
    if tested.returncode != 0:
        raise RuntimeError(f"Slurm takes no jobs: {tested.stderr.strip()}")


def run_snakemake(args, videos, *options):
    """Runs a job for each video, and returns the exit status. Jobs that fail leave no record. Snakemake locks the
    records that it makes against other runs."""
    command = [os.path.realpath(__file__), *["verify"] * args.verify, os.path.abspath(args.recipe),
               "--output", args.output, *["--trust"] * args.trust]
    jobs = ".jobs-{}-of-{}.json".format(*args.part)
    with open(os.path.join(args.output, jobs), "w", encoding="utf-8") as file:
        json.dump({"videos": {id_of(video.name): {"name": video.name, "file": os.path.abspath(video.path)}
                              for video in videos},
                   "command": shlex.join(command), "records": records_folder(args)}, file)
    where = profile_options(args.profile) if args.profile else ["--cores", str(args.cores)]
    snakemake = subprocess.Popen(
        ["snakemake", "--snakefile", os.path.join(HERE, "dataset.smk"), "--directory", args.output, *where,
         "--forceall", "--rerun-incomplete", "--keep-going", "--retries", str(args.retries), "--scheduler", "greedy",
         *options, "--config", f"jobs={jobs}"])  # read as YAML, so no path of the user
    try:
        return snakemake.wait()
    except KeyboardInterrupt:
        snakemake.wait()  # stops its jobs
        raise


def make(args, videos):
    status = run_snakemake(args, videos)
    with contextlib.suppress(OSError):  # in use by another part, or a job was killed
        os.rmdir(os.path.join(args.output, "unfinished"))
    return status


def expect_success(status, failed):
    """Raises RuntimeError if Snakemake failed for another reason than these videos, such as a lock."""
    if status != 0 and not failed:
        raise RuntimeError(f"Snakemake ended with status {status}, for the reason above")


def failure_of(args, name):
    """The last line that the job of a video wrote."""
    path = os.path.join(args.output, "logs", id_of(name) + ".log")
    with contextlib.suppress(FileNotFoundError), open(path, encoding="utf-8", errors="replace") as file:
        if lines := file.read().strip().splitlines():
            return lines[-1]
    return "its job did not start or was killed"


def print_lines(kind, lines):
    for line in lines[:MAX_LINES]:
        print(f"{kind}: {line}")
    if len(lines) > MAX_LINES:
        print(f"{kind}: and {len(lines) - MAX_LINES} more")


# the commands


def make_one(args, recipe):
    video = ec.DatasetVideo(recipe, args.video, args.file)
    unfinished = os.path.join(args.output, "unfinished", id_of(video.name))
    shutil.rmtree(unfinished, ignore_errors=True)  # of a job that was killed
    os.makedirs(unfinished)
    try:
        record = record_of(video, args.output, unfinished, keep=not args.verify)
        write_record(record_path(args, video.name), record)
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)


def selected(args, videos):
    number, count = args.part
    return [video for video in videos if int(uniform_number(video.name, "part") * count) == number - 1]


def expect_own_folder(output, videos):
    """Raises RuntimeError if a video is in the folder of the data set, which is written to and cleaned up."""
    folder = os.path.realpath(output)
    for video in videos:
        if os.path.commonpath([folder, os.path.realpath(video.path)]) == folder:
            raise RuntimeError(f"{output} has {video.path}, a video of the recipe; choose another folder with --output")


def print_plan(videos, stale):
    for video in videos:
        parameters = " ".join(f"{name}={value}" for name, value in video.parameters.items())
        print("\t".join(filter(None, [video.name, video.split, parameters])))
    parts = collections.Counter(video.split for video in videos)
    print(", ".join([f"{len(videos)} videos: {len(stale)} to make",
                     *(f"{count} in {part}" for part, count in sorted(parts.items()) if part)]))


def make_all(args, recipe):
    """Returns the exit status."""
    videos = list(ec.Dataset(recipe))
    expect_own_folder(args.output, videos)
    mine = selected(args, videos)
    stale = stale_videos(mine, read_records(args, mine), args.output)
    if args.dry_run:
        print_plan(mine, stale)
        return 0
    os.makedirs(args.output, exist_ok=True)
    status = make(args, stale) if stale else 0
    with open(os.path.join(args.output, ".lock-reports"), "w", encoding="utf-8") as reports:
        fcntl.flock(reports, fcntl.LOCK_EX)  # other parts write them, too, from all records
        records = read_records(args, videos)
        write_reports(args.output, recipe, records)
    failed = [video.name for video in stale if not records[video.name]]
    expect_success(status, failed)
    made = [record for record in records.values() if record and "written" in record]
    refused = [f"{name}: {record['refused']}" for name, record in records.items() if record and "refused" in record]
    print_lines("warning", [f"{record['name']}: {warning}" for record in made for warning in record["warnings"]])
    print_lines("refused", refused)
    print_lines("failed", [f"{name}: {failure_of(args, name)}" for name in failed])
    new = sum(1 for video in stale if "written" in (records[video.name] or {}))
    absent = sum(1 for record in records.values() if not record) - len(failed)
    print(f"{len(videos)} videos: {new} made, {len(mine) - len(stale)} unchanged, {len(refused)} refused,"
          f" {len(failed)} failed, {absent} not made yet; {args.output}")
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
    status = make(args, present) if present else 0
    records = read_records(args, present)
    expect_success(status, [name for name, record in records.items() if not record])
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
        differences += [f"{video.name}: its file of events differs from the manifest"
                        for video, damaged in zip(present, found) if damaged]
    print_lines("different", differences)
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
    if expected["written"] == record["written"]:
        return ""
    if expected["versions"] != record["versions"]:
        return f"other events, by {record['versions']} instead of {expected['versions']}"
    return "other events, by the same versions"


def is_damaged(written, output):
    """True if one of the files of events is there, and is not as it was written."""
    paths = {os.path.join(output, file["path"]): file["sha256"] for file in written.values()}
    return any(os.path.exists(path) and hash_of(path) != sha256 for path, sha256 in paths.items())


def main():
    args = options()
    find_plugins()
    recipe = ec.Recipe.load(args.recipe, args.trust)
    if args.video:
        make_one(args, recipe)
        return 0
    if not args.dry_run and not shutil.which("snakemake"):
        raise RuntimeError("Snakemake is missing; on Debian, install: snakemake")
    if args.unlock:
        return run_snakemake(args, [], "--unlock")
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
