#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Runs gl_bench on small frames, and checks what it writes: gl_test.py GL_BENCH"""
import json
import os
import subprocess
import sys
import tempfile

import plots

METHODS = {
    "frame": "difference",
    "dense-farneback": "interpolate",
    "sparse": "move_points",
    "diff": "move_differences",
    "dvs-esim": "dvs",
    "dvs": "dvs",
}
SIZES = ["48x32", "1x1"]


def run(*arguments, **environment):
    return subprocess.run(
        [sys.argv[1], *arguments], env={**os.environ, **environment}, capture_output=True, text=True, check=False
    )


def main():
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "gl.json")
        result = run("--quick", "--passes", f"--json={path}", *SIZES, SHARED_DATA="")
        assert result.returncode == 0, result.stderr
        with open(path, encoding="utf-8") as file:
            report = json.load(file)
    tables = result.stdout
    assert f"Renderer: {report['renderer']}, OpenGL {report['version']}." in tables, tables
    rows = {(row["scene"], row["method"]): row for row in report["rows"]}
    scenes = [f"{scene}, {size}, n = 10" for size in SIZES for scene in ("ball", "texture")]
    assert list(rows) == [(scene, method) for scene in scenes for method in METHODS], list(rows)
    for (scene, method), row in rows.items():
        assert tables.count(f"| {scene} | {method} |") == 2, tables
        for part in ("upload", "call", "kernels", "read-back", "element", "cpu"):
            assert row[part] > 0, row
        assert {"luma", METHODS[method]} <= row["passes"].keys(), row
        # Each kernel is in the passes once, with all of its time.
        total = sum(kernel["time"] for kernel in row["passes"].values())
        assert 0.1 * row["kernels"] < total < 10 * row["kernels"], row
    assert rows["texture, 48x32, n = 10", "sparse"]["passes"]["paint"]["runs"] == 1
    assert rows["texture, 48x32, n = 10", "sparse"]["events"] > 1000

    result = run("1x1", __EGL_VENDOR_LIBRARY_FILENAMES="/nowhere")
    assert result.returncode == 1 and "no OpenGL 4.3 without a screen: EGL needs the driver" in result.stderr, result
    for wrong in ("0x5", "5", "--slow"):
        result = run(wrong)
        assert result.returncode == 2 and f"'{wrong}' is neither a size" in result.stderr, result

    # The bars of the plot come from the table in the page.
    on_gpu = plots.gpu_times(os.path.join(os.path.dirname(__file__), "..", "docs", "benchmarks.md"))
    assert all(on_gpu[f"driving-640x480/gl-{method}"] > 0 for method in ("dense-farneback", "sparse", "diff")), on_gpu


main()
