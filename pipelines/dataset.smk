# SPDX-License-Identifier: LGPL-2.1-or-later
# The workflow that event-dataset runs: a job for each video, in the folder of the data set. A job writes its
# record last and at once; event-dataset removes the records of videos that have to be made again.
import json

with open(config["jobs"], encoding="utf-8") as file:
    paths = json.load(file)


rule all:
    input:
        lambda _: [f"{config['records']}/{name}.json" for name in paths],


rule video:
    output:
        config["records"] + "/{name}.json",
    params:
        path=lambda wildcards: paths[wildcards.name],
    log:
        "logs/{name}.log",
    shell:
        "{config[command]} --video {wildcards.name:q} {params.path:q} >{log:q} 2>&1"
