#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# The pages of docs/elements/ describe the elements as they are.
set -eu
source "$SOURCE/tests/pipelines/scratch_folder.sh"
"$SOURCE/docs/describe-elements" "$work/pages"
diff -r "$SOURCE/docs/elements" "$work/pages" || fail "run docs/describe-elements in the shell of: meson devenv -C build -w ."
