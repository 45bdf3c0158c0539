# SPDX-License-Identifier: LGPL-2.1-or-later
"""Events of simulators and of cameras."""
from __future__ import annotations

import os
from typing import Iterator

from .events import Events
from .pipeline import EVENT_CAPS, Pipeline, events_of, expect_limits
from .video import VideoFile

SINK = "appsink name=out sync=false max-buffers=4"


OUTPUT = f"{EVENT_CAPS} ! {SINK}"


def _chunks(playing: Pipeline, is_live: bool = False) -> Iterator[Events]:
    with playing as pipeline:
        pipeline.gaps_as_buffers()
        for sample in pipeline.samples():
            events = events_of(sample)
            if is_live:
                events.arrival = pipeline.now(sample.get_segment())
            yield events


def simulate(video: str | os.PathLike[str], simulator: str = "eventsim-dvs") -> Iterator[Events]:
    """Yields the events that an event camera would have seen, one array per pair of consecutive frames of a video.

    video: a file that GStreamer plays.
    simulator: an element and its properties, such as "eventsim-dvs preset=davis346 seed=7"; further
        elements may follow it, such as "eventsim-dvs ! eventdenoise".

    The simulator gets the frames as they are decoded, upright and deinterlaced; a looping GIF is played once.
    Only the current array is in memory. Raises PipelineError if the file cannot be read, an element or property
    does not exist, or a number is not within the limits of its property."""
    expect_limits(simulator)
    return _chunks(VideoFile(video, f"{simulator} ! {OUTPUT}"))


def live(pipeline: str) -> Iterator[Events]:
    """Yields the events at the end of a pipeline, such as "v4l2src ! eventsim-dvs", an array a buffer.

    Leaving the loop, by break, an exception or Ctrl-C, stops the pipeline. The pipeline waits while the loop is
    busy, but live sources drop events that are not read in time. Raises PipelineError."""
    return _chunks(Pipeline(f"{pipeline} ! {OUTPUT}"), is_live=True)
