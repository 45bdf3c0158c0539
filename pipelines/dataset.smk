# SPDX-License-Identifier: LGPL-2.1-or-later
# The workflow of event-dataset: a job for each video, in the folder of the data set. Jobs have IDs, since Snakemake
# does not take every name of a file. The last thing that a job writes is its record.
import json

with open(config["jobs"], encoding="utf-8") as file:
    jobs = json.load(file)
videos, command = jobs["videos"], jobs["command"]


rule all:
    input:
        [f"{jobs['records']}/{id}.json" for id in videos],


rule video:
    output:
        jobs["records"] + "/{id}.json",
    params:
        name=lambda wildcards: videos[wildcards.id]["name"],
        file=lambda wildcards: videos[wildcards.id]["file"],
    message:
        "{params.name}"
    log:
        "logs/{id}.log",
    shell:
        "{command} --video={params.name:q} --file={params.file:q} >{log:q} 2>&1"
