# SPDX-License-Identifier: LGPL-2.1-or-later
# The workflow that event-dataset runs: a job for each video, in the folder of the data set, and before it one
# for each of its clips, if it has any. A job writes its record last and at once; event-dataset removes the
# records of videos that have to be made again.
import json

with open(config["jobs"], encoding="utf-8") as file:
    jobs = json.load(file)
videos, command = jobs["videos"], jobs["command"]


def clips_of(name):
    cuts = videos[name]["cuts"]
    return [f"{jobs['clips']}/{name}.d/{number}.json" for number in range(len(cuts) + 1 if cuts else 0)]


def clip_before(wildcards):
    number = int(wildcards.number)
    return clips_of(wildcards.name)[number - 1 : number] if videos[wildcards.name]["in-order"] else []


def arguments(wildcards):
    """The file, and where it is cut."""
    path, cuts = (videos[wildcards.name][key] for key in ("path", "cuts"))
    return [f"--file={path}", *(["--cuts", *map(str, cuts)] if cuts else [])]


rule all:
    input:
        lambda _: [f"{jobs['records']}/{name}.json" for name in videos],


rule clip:
    input:
        clip_before,
    output:
        jobs["clips"] + "/{name}.d/{number}.json",
    wildcard_constraints:
        number=r"\d+",
    params:
        arguments=arguments,
    log:
        jobs["clips"] + "/{name}.d/{number}.log",
    shell:
        "{command} --clip-number {wildcards.number} --video={wildcards.name:q} {params.arguments:q}"
        " >{log:q} 2>&1"


rule video:
    input:
        lambda wildcards: clips_of(wildcards.name),
    output:
        jobs["records"] + "/{name}.json",
    params:
        arguments=arguments,
    log:
        "logs/{name}.log",
    shell:
        "{command} --video={wildcards.name:q} {params.arguments:q} >{log:q} 2>&1"
