#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# The pages of docs/elements/ describe the elements as they are, and lines of documents are not too long.
set -eu
source "$SOURCE/tests/pipelines/scratch_folder.sh"
"$SOURCE/docs/describe-elements" "$work/pages"
diff -r "$SOURCE/docs/elements" "$work/pages" || fail "run docs/describe-elements in the shell of: meson devenv -C build -w ."

# A property that is newer than its element has its own version.
mkdir docs
cp "$SOURCE/docs/describe-elements" docs
cp -r "$SOURCE/elements" "$SOURCE/gst" .
printf '/**\n * GstEventCrop:top:\n *\n * Rows.\n *\n * Since: 7.5\n */\n' >>elements/eventcam/filters/eventcrop.cpp
docs/describe-elements pages
grep -q '^| `top` |.*| 7\.5 |' pages/eventcrop.md || fail "$(grep top pages/eventcrop.md)"
grep -q '^| `left` |.*| 0\.1 |' pages/eventcrop.md || fail "$(grep left pages/eventcrop.md)"

# A comment without a version or an example is named.
sed -i 's/ \* Since: 0.1/ */' elements/eventcam/filters/eventcrop.cpp
if docs/describe-elements pages 2>errors; then fail "eventcrop needs no version"; fi
grep -q 'error: SECTION:element-eventcrop in .*"Since: VERSION"' errors || fail "$(cat errors)"
sed -i 's/## Example launch line/## Example/' elements/eventcam/filters/eventcrop.cpp
if docs/describe-elements pages 2>errors; then fail "eventcrop needs no example"; fi
grep -q 'error: SECTION:element-eventcrop in .*"## Example launch line"' errors || fail "$(cat errors)"

# Lines have at most 120 characters, except tables, code, images and addresses.
/usr/bin/python3 - "$SOURCE" <<'PYTHON' || fail "break these lines"
import re
import sys
from pathlib import Path

source = Path(sys.argv[1])
long = []
for page in [*source.glob("docs/*.md"), *(source / f"{name}.md" for name in ("README", "CONTRIBUTING", "SECURITY"))]:
    text = re.sub(r"^```.*?^```$", lambda code: "\n" * code[0].count("\n"), page.read_text(), flags=re.M | re.S)
    long += [f"{page}:{number}: {len(line)} characters" for number, line in enumerate(text.split("\n"), 1)
             if len(line) > 120 and not re.match(r"[|<!]", line) and "://" not in line]
if long:
    sys.exit("\n".join(long))
PYTHON

# Encoders of pictures, which their defaults would blur or make unplayable in some players.
pictures=$(grep -rnE 'vp8enc [^!]*!|x264enc' "$SOURCE"/{README.md,docs,elements,pipelines,desktop} --include='*.md' \
  --include='*.cpp' --include='*.py' --include='*.sh' --include='*.1' --include=demo || true)
if grep vp8enc <<<"$pictures" | grep -v target-bitrate=4000000; then fail "vp8enc needs a target-bitrate"; fi
if grep 'x264enc !' <<<"$pictures" | grep -v 'format=I420 ! x264enc ! video/x-h264,profile=main'; then
  fail "x264enc needs I420 and a profile"
fi
