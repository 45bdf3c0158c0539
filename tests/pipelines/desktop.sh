#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# What is installed for desktops: recordings have a type, a thumbnail, and programs that open them.
set -eu
if [ ! -w "$BUILD" ]; then
  echo "$BUILD is read-only: meson cannot install from it"
  exit 77
fi
source "$SOURCE/tests/pipelines/scratch_folder.sh"

export XDG_DATA_HOME=$work/home XDG_CONFIG_HOME=$work/config XDG_CURRENT_DESKTOP=GNOME
meson install -C "$BUILD" --no-rebuild --destdir "$work" --tags desktop --quiet
data=$work/usr/share
cp /usr/share/mime/packages/freedesktop.org.xml "$data/mime/packages/"
export XDG_DATA_DIRS=$data
desktop-file-validate "$data"/applications/*.desktop
appstreamcli validate --no-net "$data"/metainfo/*.xml
update-mime-database "$data/mime"
update-desktop-database -q "$data/applications"

# Types of recordings, and of other files with their extensions.
"$GST_LAUNCH" -q videotestsrc pattern=ball num-buffers=30 ! eventsim-diff ! evtenc ! filesink location=ball.raw
for ending in dat es npy npz aedat4 h5 hdf5 mcap; do "$BUILD/pipelines/event-convert" ball.raw ball.$ending; done
cp ball.dat "without an extension"
/usr/bin/python3 - <<'PYTHON'
import h5py
import numpy as np

np.save("numbers.npy", np.zeros((5, 4)))
np.savez("numbers.npz", x=np.zeros(5))
events = dict.fromkeys(["events/" + name for name in "txyp"], np.zeros(5, int))
for path, sets, options in (
        ("numbers.h5", {"weights": np.zeros(5)}, {}),
        ("particles.h5", dict.fromkeys(["events/pt", "events/eta", "events/phi"], np.zeros(5)), {}),  # of another kind
        ("rows.hdf5", {"events": np.zeros((5, 4))}, {}),
        ("dsec.h5", events | {"ms_to_idx": np.zeros(5, int)}, {"compression": "gzip"}),
        ("columns.h5", events, {}),
        ("e2vid.h5", {name + "s": times for name, times in events.items()}, {}),
        ("v2e.h5", {"events": np.zeros((0, 4), np.uint32)}, {"maxshape": (None, 4), "compression": "gzip"})):
    with h5py.File(path, "w") as file:
        for name, data in sets.items():
            file.create_dataset(name, data=data, **options)
PYTHON
/usr/bin/python3 "$SOURCE/tests/formats/bag_files.py" .
mv evt3.bag bag.bag
mv evt3.db3 bag.db3
cp bag.db3 "a bag without an extension"
echo 'export const a = 1;' >script.es
printf 'IIU\0\010\0\0\0 a photo' >photo.raw
printf '\1\2\3\4 other words' >words.raw
echo "a text" >notes.dat
while read -r type file; do
  found=$(gio info -a standard::content-type "$file" | sed -n 's/.*content-type: //p')
  [ "$found" = "$type" ] || fail "$file: $found instead of $type"
  found=$(xdg-mime query filetype "$file")
  [ "$found" = "$type" ] || fail "$file: xdg-mime tells $found instead of $type"
done <<'FILES'
application/x-prophesee-raw ball.raw
application/x-prophesee-dat ball.dat
application/x-prophesee-dat without an extension
application/x-es ball.es
application/x-event-npy ball.npy
application/x-event-npz ball.npz
application/x-aedat ball.aedat4
application/x-mcap ball.mcap
application/x-rosbag bag.bag
application/x-rosbag2-db3 bag.db3
application/x-rosbag2-db3 a bag without an extension
application/x-event-hdf5 ball.h5
application/x-event-hdf5 ball.hdf5
application/x-event-hdf5 dsec.h5
application/x-event-hdf5 columns.h5
application/x-event-hdf5 e2vid.h5
application/x-event-hdf5 v2e.h5
application/x-npy numbers.npy
application/x-npz numbers.npz
application/x-hdf numbers.h5
application/x-hdf particles.h5
application/x-hdf rows.hdf5
application/ecmascript script.es
image/x-panasonic-rw photo.raw
image/x-panasonic-rw words.raw
text/plain notes.dat
FILES

# Players that are installed open them; the one with a window of its own first.
mkdir programs
ln -s "$(command -v gst-play-1.0)" "$(command -v gio)" programs/
default_of() { # TYPE
  PATH=$work/programs gio mime "$1" | sed -n '1s/.*: //p'
}
for ending in raw dat es npy npz aedat4 h5 mcap; do
  type=$(gio info -a standard::content-type ball.$ending | sed -n 's/.*content-type: //p')
  [ "$(default_of "$type")" = events-in-terminal.desktop ] || fail "$type is opened by $(default_of "$type")"
done
ln -s /bin/true programs/totem
[ "$(default_of application/x-es)" = events-in-gnome-videos.desktop ] || fail "$(default_of application/x-es) instead of Totem"
[ "$(default_of application/x-prophesee-raw)" = events-in-terminal.desktop ] || fail "Totem, which ignores .raw files"

# Thumbnails show events, and nothing else.
thumbnailer=$data/thumbnailers/event-recordings.thumbnailer
grep -qx 'TryExec=event-thumbnail' "$thumbnailer"
draw_thumbnail() { # FILE: prints the numbers of its OFF, its ON and of all pixels
  local line
  line=$(sed -n 's/^Exec=//p' "$thumbnailer")
  line=${line//%s/256}
  line=${line//%i/"$(printf %q "$PWD/$1")"}
  line=${line//%o/thumbnail.png}
  echo "$line" >&2
  eval "env -u DISPLAY PATH='$BUILD/pipelines:$PATH' timeout 60 $line"
  "$GST_LAUNCH" -q filesrc location=thumbnail.png ! pngdec ! videoconvert ! video/x-raw,format=RGB ! filesink location=pixels
  rm thumbnail.png
  od -An -v -tu1 -w3 pixels | awk '
    BEGIN { known["28 34 48"]; known["64 128 208"]; known["240 244 250"] }
    { $1 = $1; ++count[$0] }
    !($0 in known) { print "not a colour of events: " $0 >"/dev/stderr"; exit 1 }
    END { print count["64 128 208"] + 0, count["240 244 250"] + 0, NR }'
}
for ending in raw dat es npy npz aedat4 h5 mcap; do
  type=$(gio info -a standard::content-type ball.$ending | sed -n 's/.*content-type: //p')
  grep -q "^MimeType=.*$type;" "$thumbnailer" || fail "no thumbnail of $type"
  read -r off on all <<<"$(draw_thumbnail ball.$ending)"
  [ "$off" -gt 500 ] && [ "$on" -gt 500 ] || fail "the thumbnail of ball.$ending has $off OFF and $on ON pixels"
done

# Not the frames of a camera that records both.
"$GST_LAUNCH" -q videotestsrc num-buffers=20 ! video/x-raw,format=GRAY8 ! tee name=t \
  t. ! queue ! eventsim-dvs ! application/x-event-camera ! mux. t. ! queue ! mux. aedatmux name=mux ! filesink location=frames.aedat4
read -r off on all <<<"$(draw_thumbnail frames.aedat4)"
[ "$off" -gt 0 ] && [ "$on" -gt 0 ] || fail "the thumbnail of frames.aedat4 has $off OFF and $on ON pixels"

# Each event of a sparse recording, one an hour.
{
  echo t,x,y,p
  for ((i = 0; i < 30; ++i)); do echo "$((i * 3600)),$((i % 6 * 200 + 37)),$((i / 6 * 140 + 51)),$((i % 2))"; done
} >sparse.csv
"$BUILD/pipelines/event-convert" --time-unit=seconds --width=1280 --height=720 sparse.csv sparse.raw
[ "$(draw_thumbnail sparse.raw)" = "15 15 $((256 * 144))" ] || fail "the thumbnail of sparse.raw lacks events"

# The moment that has most of them: a second in an hour.
{
  echo t,x,y,p
  echo 0,127,127,1
  for ((i = 0; i < 4096; ++i)); do echo "$((1800000000 + 100 * i)),$((i % 64)),$((i / 64)),0"; done
  echo 3600000000,127,127,1
} >moment.csv
"$BUILD/pipelines/event-convert" --time-unit=microseconds --width=128 --height=128 moment.csv moment.raw
read -r off on all <<<"$(draw_thumbnail moment.raw)"
[ "$off $all" = "1311 $((128 * 128))" ] && [ "$on" -eq 0 ] || fail "the thumbnail of moment.raw has $off OFF, $on ON and $all pixels"

# None of a recording without events, but a reason.
head -c 100 ball.raw >header.raw
! "$BUILD/pipelines/event-thumbnail" header.raw thumbnail.png 2>reason || fail "a thumbnail without events"
grep -qx "header.raw: no events found" reason || fail "$(cat reason)"

# Nor where it cannot be written, which is not blamed on the recording.
! "$BUILD/pipelines/event-thumbnail" ball.raw nowhere/thumbnail.png 2>errors || fail "a thumbnail nowhere"
grep -qx "nowhere/thumbnail.png: No such file or directory" errors || fail "$(cat errors)"

# A pipe is not waited for.
mkfifo pipe.raw
! timeout 60 "$BUILD/pipelines/event-thumbnail" pipe.raw thumbnail.png 2>reason || fail "a thumbnail of a pipe"
grep -qx "pipe.raw is not a regular file; save it to a file first" reason || fail "$(cat reason)"

# Not in place of the recording, under another name of it either.
ln -s ball.raw link.png
! "$BUILD/pipelines/event-thumbnail" ball.raw link.png 2>reason || fail "a thumbnail in place of its recording"
grep -qx "ball.raw and link.png are the same file" reason || fail "$(cat reason)"

# Effects run as webcam applications run them.
for effect in "$data"/gnome-video-effects/*.effect; do
  for key in Name Comment PipelineDescription; do
    grep -q "^$key=." "$effect" || fail "${effect##*/} has no $key"
  done
  line=$(sed -n 's/^PipelineDescription=//p' "$effect")
  echo "$line"
  eval "timeout 60 $GST_LAUNCH -q videotestsrc num-buffers=5 ! videoconvert ! $line ! videoconvert ! video/x-raw,format=I420,width=320,height=240 ! filesink location=pictures"
  [ "$(stat -c %s pictures)" -eq $((5 * 320 * 240 * 3 / 2)) ] || fail "${effect##*/}: $(stat -c %s pictures) bytes"
done
