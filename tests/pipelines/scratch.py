# SPDX-License-Identifier: LGPL-2.1-or-later
"""Tests of the Python package: works in a temporary folder. Imported first: skips the test without the package."""
import os
import subprocess
import sys
import tempfile

if not os.path.exists(os.path.join(os.environ["GI_TYPELIB_PATH"], "GstEventCamera-1.0.typelib")):
    print("built without introspection: no Python")
    sys.exit(77)

FOLDER = tempfile.TemporaryDirectory()


def path_of(name):
    """A path in the temporary folder; creates its folders."""
    path = os.path.join(FOLDER.name, name)
    os.makedirs(os.path.dirname(path), exist_ok=True)
    return path


def write(name, text):
    with open(path_of(name), "w", encoding="utf-8") as file:
        file.write(text)
    return path_of(name)


def read(name):
    with open(path_of(name), encoding="utf-8") as file:
        return file.read()


def launch(line):
    subprocess.run(f"{os.environ['GST_LAUNCH']} -q {line}", shell=True, check=True)
