#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Lines that a user would type, run by gst-launch-1.0; none leaks a GStreamer object.
set -eu
source "$SOURCE/tests/pipelines/pixel_files.sh"
source "$SOURCE/tests/pipelines/scratch_folder.sh"

launch() {
  echo "gst-launch-1.0 $*"
  GST_TRACERS=leaks GST_DEBUG=GST_TRACER:7 GST_DEBUG_NO_COLOR=1 GST_DEBUG_FILE=alive timeout 120 "$GST_LAUNCH" -q "$@" || return
  if grep "object-alive, " alive | grep -v "new format string"; then fail "leaked objects"; fi
  grep -q GST_TRACER alive || fail "no tracer"
}

interrupt() { # FILE SIZE ARGUMENT...: Ctrl-C when the file has this size
  local file=$1 size=$2
  shift 2
  echo "gst-launch-1.0 $*, interrupted"
  timeout 60 "$GST_LAUNCH" -q "$@" &
  local launched=$!
  for _ in $(seq 300); do
    [ "$(stat -c %s "$file" 2>/dev/null || echo 0)" -gt "$size" ] && break
    sleep 0.1
  done
  pkill -INT -P $launched
  wait $launched || true
}

# Events of every simulator into a file.
for element in frame dense sparse diff dvs; do
  launch videotestsrc pattern=ball num-buffers=30 ! eventsim-$element ! application/x-event-camera ! filesink location=ball-$element.xytp
  size=$(stat -c %s ball-$element.xytp)
  [ "$size" -gt 8000 ] && [ $((size % 8)) -eq 0 ] || fail "$element: $size bytes"
done

# The physical pixel with each preset, and with motion.
for preset in ideal esim v2e-clean v2e-noisy icns davis240c davis346 gen4 hs-ergb; do
  launch videotestsrc pattern=ball num-buffers=10 ! eventsim-dvs preset=$preset threshold-sigma=0.03 seed=7 ! evtenc format=EVT3 ! filesink location=$preset.raw
  [ -s $preset.raw ] || fail "$preset: no events"
done
launch videotestsrc pattern=ball num-buffers=10 ! eventsim-dvs upsampling=motion ! videoconvert ! fakesink

# Accumulated events as video, to an encoder and back.
launch videotestsrc pattern=ball num-buffers=30 ! eventsim-diff ! videoconvert ! x264enc ! mp4mux ! filesink location=events.mp4
launch filesrc location=events.mp4 ! decodebin ! eventsim-dense flow=dis-hq ! videoconvert ! fakesink
[ -s events.mp4 ] || fail "no video was written"

# Formats of cameras and decoders, without a converter.
for format in NV12 P010_10LE BGRx; do
  launch videotestsrc num-buffers=5 ! video/x-raw,format=$format ! eventsim-frame positive-threshold=15 ! fakesink
done
launch videotestsrc num-buffers=5 ! jpegenc ! jpegdec ! eventsim-frame ! fakesink

# A tee, live sources, sinks with a clock, threads.
launch videotestsrc is-live=true num-buffers=20 ! tee name=t  t. ! queue ! eventsim-frame ! fakesink sync=true  t. ! queue ! eventsim-sparse ! videoconvert ! fakesink sync=true

# Upstreams without allocation queries, with videorate's copies, and with one frame only.
launch videotestsrc num-buffers=10 ! identity drop-allocation=true ! eventsim-dense ! fakesink
launch videotestsrc num-buffers=10 ! videorate ! video/x-raw,framerate=50/1 ! eventsim-diff ! fakesink
launch videotestsrc num-buffers=1 ! eventsim-sparse ! fakesink

# Ten at once make the same events.
for element in eventsim-dense eventsim-dvs gleventsim-frame gleventsim-diff; do
  ten=()
  for i in {0..9}; do
    ten+=(videotestsrc pattern=ball num-buffers=10 ! video/x-raw,width=160,height=120 ! $element ! evtenc ! filesink location=ten-$i.raw)
  done
  launch "${ten[@]}"
  [ -s ten-0.raw ] || fail "$element: no events"
  for i in {1..9}; do cmp ten-0.raw ten-$i.raw || fail "$element: ten at once differ"; done
done

# Mixed with the video.
launch videotestsrc pattern=ball num-buffers=20 ! tee name=t  t. ! queue ! mixer.  t. ! queue ! eventsim-diff ! videoconvert ! mixer.  compositor name=mixer sink_1::alpha=0.5 ! fakesink

# Drawn in every mode, at other framerates than the events', also from live sources.
for mode in accumulate decay time-surface count; do
  launch videotestsrc pattern=ball num-buffers=30 ! eventsim-diff ! application/x-event-camera ! eventrender mode=$mode ! video/x-raw,framerate=60/1 ! videoconvert ! fakesink
done
launch videotestsrc pattern=ball num-buffers=30 ! eventsim-frame ! eventrender palette=viridis ! videoconvert ! x264enc ! mp4mux ! filesink location=rendered.mp4
[ -s rendered.mp4 ] || fail "no rendered video was written"
# As tensors of every kind.
for tensors in voxel-grid "histogram accumulation-time=50000000" "time-surface event-count=20000 overlap=0.5" "event-frame frame-count=3"; do
  # shellcheck disable=SC2086
  launch videotestsrc is-live=true pattern=ball num-buffers=10 ! eventsim-diff ! eventtensor representation=$tensors ! other/tensors,format=static ! fakesink sync=true
done
launch videotestsrc is-live=true pattern=ball num-buffers=20 ! eventsim-diff ! eventrender event-count=5000 ! video/x-raw,framerate=50/1 ! fakesink sync=true
launch videotestsrc is-live=true pattern=black num-buffers=20 ! eventsim-diff ! eventrender ! fakesink sync=true
launch videotestsrc pattern=ball num-buffers=30 ! eventsim-diff ! eventrender ! video/x-raw,framerate=0/1 ! fakesink
launch videotestsrc pattern=ball num-buffers=30 ! tee name=t  t. ! queue ! videoconvert ! eventoverlay name=overlay ! videoconvert ! fakesink  t. ! queue ! eventsim-diff ! overlay.event_sink
launch videotestsrc is-live=true pattern=ball num-buffers=20 ! tee name=t  t. ! queue ! videoconvert ! eventoverlay name=overlay ! videoconvert ! fakesink sync=true  t. ! queue ! eventsim-diff ! overlay.event_sink

# Labels: what a denoiser keeps, by cause, and the recipes of them.
launch videotestsrc pattern=ball num-buffers=30 ! eventsim-dvs preset=davis346 label=true ! eventdenoise ! eventstats location=causes.json ! fakesink
grep -q '"light-events" : [1-9]' causes.json || fail "no light: $(cat causes.json)"
grep -q '"shot-noise-events" : ' causes.json || fail "no causes: $(cat causes.json)"
launch eventcompare name=compare location=classes.json ! fakesink  videotestsrc pattern=ball num-buffers=30 ! eventsim-dvs preset=davis346 label=true ! tee name=t  t. ! queue ! compare.reference  t. ! queue ! eventdenoise ! compare.candidate
grep -q '"true-positives" : [1-9]' classes.json || fail "no true positives: $(cat classes.json)"
launch videotestsrc pattern=ball num-buffers=30 ! eventsim-dvs preset=davis346 label=true ! eventnpzenc ! filesink location=labelled.npz
launch eventlabel name=label ! eventnpzenc ! filesink location=classes.npz  videotestsrc pattern=ball num-buffers=30 ! eventsim-dvs label=true ! label.event_sink  videotestsrc pattern=ball num-buffers=30 ! video/x-raw,format=GRAY8 ! label.video_sink
/usr/bin/python3 - <<'PYTHON'
import numpy as np
events = np.load("labelled.npz")
assert len(events["cause"]) == len(events["class"]) == len(events["t"]) > 1000
assert set(np.unique(events["cause"])) <= {1, 2, 3, 4, 5}, np.unique(events["cause"])
classes = np.load("classes.npz")["class"]
assert {16, 235} <= set(classes), np.unique(classes)  # of the background and the ball
PYTHON

# Measured, and compared with another simulator.
launch videotestsrc pattern=ball num-buffers=30 ! eventsim-diff ! eventstats location=stats.json map=map.png ! eventrender ! fakesink
launch videotestsrc is-live=true pattern=ball num-buffers=20 ! tee name=t  t. ! queue ! eventsim-dense ! compare.reference  t. ! queue ! eventsim-diff ! compare.candidate  eventcompare name=compare location=compare.json map=maps.png ! evtenc ! filesink location=candidate.raw
grep -q '"std-dev" : [0-9]' stats.json || fail "no figures were written"
grep -q '"map-correlation" : [0-9-]' compare.json || fail "no comparison was written"
[ -s map.png ] && [ -s maps.png ] && [ -s candidate.raw ] || fail "a picture or the candidate is missing"
launch filesrc location=candidate.raw ! evtdec ! eventstats location=/dev/null interval=0 ! fakesink

# Filtered, with each filter: fewer events, but not none.
for filter in eventdenoise "eventdenoise method=dwf" eventtrail "eventrefractory refractory-period=10000000" \
  "eventhotpixel location=hot.txt min-rate=0 learning-period=100000000" "eventratecontrol max-rate=1000"; do
  # shellcheck disable=SC2086
  launch filesrc location=candidate.raw ! evtdec ! $filter ! evtenc ! filesink location=filtered.raw
  size=$(stat -c %s filtered.raw)
  [ "$size" -gt 1000 ] && [ "$size" -lt "$(stat -c %s candidate.raw)" ] || fail "$filter: $size bytes"
done
launch filesrc location=candidate.raw ! evtdec ! eventhotpixel location=hot.txt learn=false ! eventantiflicker mode=band-pass ! fakesink

# Cropped, turned and scaled.
launch filesrc location=candidate.raw ! evtdec ! eventcrop left=100 ! eventflip video-direction=90r ! eventscale ! application/x-event-camera,width=80,height=60 ! eventpolarity keep=on ! eventcsvenc ! filesink location=scaled.csv
awk -F, 'NR > 1 && ($2 >= 80 || $3 >= 60 || $4 != 1) { exit 1 }' scaled.csv || fail "events are outside of the scaled sensor, or OFF"
[ "$(wc -l <scaled.csv)" -gt 1000 ] || fail "events are missing"

# Masked and undistorted.
make_pixel_files .
launch filesrc location=candidate.raw ! evtdec ! eventmask location=mask.png ! eventcsvenc ! filesink location=masked.csv
awk -F, 'NR > 1 && $2 < 160 { exit 1 }' masked.csv || fail "events are in the masked half"
launch filesrc location=candidate.raw ! evtdec ! eventundistort location=camera.yaml ! eventcsvenc ! filesink location=undistorted.csv
for file in masked undistorted; do [ "$(wc -l <$file.csv)" -gt 1000 ] || fail "$file.csv lacks events"; done

# Bags of ROS: written, and those of recorders read, with their images.
launch filesrc location=candidate.raw ! evtdec ! eventmcapenc ! filesink location=candidate.mcap
launch filesrc location=candidate.raw ! evtdec ! eventcsvenc ! filesink location=candidate.csv
launch filesrc location=candidate.mcap ! eventmcapdemux ! eventcsvenc ! filesink location=from-mcap.csv
cmp candidate.csv from-mcap.csv || fail "a bag has other events"
/usr/bin/python3 "$SOURCE/tests/formats/bag_files.py" .
for file in evt3.mcap evt3.bag evt3.db3; do
  launch filesrc location=$file ! eventbagdemux name=d  d.events_0 ! queue ! eventcsvenc ! filesink location=$file.csv  d.video_0 ! queue ! filesink location=images
  [ "$(wc -l <$file.csv)" = 6001 ] || fail "$file: $(wc -l <$file.csv) lines"
  [ "$(stat -c %s images)" = $((40 * 88 * 65)) ] || fail "$file: images of $(stat -c %s images) bytes"
done

# Merged: two recordings, and two live streams side by side.
launch eventmerge name=m ! evtenc ! filesink location=both.raw  filesrc location=candidate.raw ! evtdec ! m.sink_0  filesrc location=filtered.raw ! evtdec ! m.sink_1
[ "$(stat -c %s both.raw)" -gt "$(stat -c %s candidate.raw)" ] || fail "the merged recording is not larger"
launch eventmerge name=m sink_1::xpos=320 ! eventrender ! fakesink sync=true  videotestsrc is-live=true pattern=ball num-buffers=20 ! eventsim-diff ! queue ! m.  videotestsrc is-live=true pattern=snow num-buffers=20 ! eventsim-frame ! queue ! m.

# Interrupted with -e, the file is complete.
interrupt interrupted.mp4 10000 -e videotestsrc is-live=true ! eventsim-frame ! videoconvert ! x264enc tune=zerolatency ! mp4mux ! filesink buffer-mode=unbuffered location=interrupted.mp4
launch filesrc location=interrupted.mp4 ! decodebin ! fakesink

# A client that joins a server late gets the header first.
port=$((20000 + $$ % 20000))
for writer in "evtenc format=EVT3" eventdatenc "application/x-event-camera ! aedatmux"; do
  echo "tcpserversink of $writer"
  timeout 60 "$GST_LAUNCH" -q videotestsrc is-live=true pattern=ball ! eventsim-frame ! $writer ! tcpserversink host=127.0.0.1 port=$port &
  serving=$!
  joined=false
  for _ in $(seq 20); do
    sleep 1
    timeout 20 "$GST_LAUNCH" -q tcpclientsrc host=127.0.0.1 port=$port num-buffers=30 ! decodebin caps=application/x-event-camera,format=XYTP ! filesink location=joined.xytp || continue
    joined=true
    break
  done
  kill $serving
  wait $serving || true
  $joined && [ "$(stat -c %s joined.xytp)" -gt 8000 ] || fail "a client of $writer got no events"
done

# What cameras send: buffers of V4L2, a serial line, and a socket that a client joins late.
for words in EVT21 EVT3; do
  launch videotestsrc pattern=ball num-buffers=30 ! eventsim-diff ! evtenc ! application/x-event-camera,format=$words ! filesink location=line.$words
  launch filesrc location=line.$words blocksize=1000 ! evtparse format=$words width=320 height=240 ! evtdec ! eventcsvenc ! filesink location=line.csv
  launch filesrc location=line.$words ! application/x-event-camera,format=$words,width=320,height=240 ! evtdec ! eventcsvenc ! filesink location=words.csv
  cmp line.csv words.csv
done
{ cat line.EVT3 && printf '\x19\xe0'; } >line.grey
truncate -s $((4096 * 391)) line.grey
launch filesrc location=line.grey blocksize=$((4096 * 391)) ! video/x-raw,format=GRAY8,width=4096,height=391,framerate=0/1 ! evtparse format=EVT3 width=320 height=240 ! evtdec ! filesink location=line.xytp
[ -s line.xytp ] || fail "no events came out of a padded buffer"
timeout 60 "$GST_LAUNCH" -q videotestsrc is-live=true pattern=ball ! eventsim-diff ! evtenc ! application/x-event-camera,format=EVT3 ! tcpserversink host=127.0.0.1 port=$port &
serving=$!
for _ in $(seq 20); do
  sleep 1
  timeout 20 "$GST_LAUNCH" -q tcpclientsrc host=127.0.0.1 port=$port do-timestamp=true num-buffers=30 ! evtparse format=EVT3 width=320 height=240 ! evtdec ! filesink location=joined.xytp && break
done
kill $serving
wait $serving || true
[ -s joined.xytp ] || fail "a client of words without a header got no events"

# Datagrams of other tools, without a network.
for format in spif es; do
  launch videotestsrc pattern=ball num-buffers=20 ! eventsim-diff ! eventdatagrampay format=$format ! eventdatagramdepay format=$format width=320 height=240 ! eventrender ! videoconvert ! fakesink
done

# Events and their frames in one file, and read back.
launch videotestsrc pattern=ball num-buffers=50 ! video/x-raw,format=GRAY8,framerate=25/1 ! tee name=t  t. ! queue ! eventsim-frame ! application/x-event-camera ! mux.  t. ! queue ! mux.  aedatmux name=mux compression=zstd ! filesink location=ball.aedat4
launch filesrc location=ball.aedat4 ! aedatdemux name=d  d.events_0 ! queue ! filesink location=ball.xytp  d.video_0 ! queue ! filesink location=ball.grey
[ "$(stat -c %s ball.xytp)" -gt 8000 ] || fail "no events came back"
[ "$(stat -c %s ball.grey)" -eq $((50 * 320 * 240)) ] || fail "not every frame came back"
launch filesrc location=ball.aedat4 ! aedatdemux name=d  d.video_0 ! queue ! eventsim-dense ! application/x-event-camera ! aedatmux ! filesink location=again.aedat4
launch filesrc location=again.aedat4 ! decodebin caps="application/x-event-camera,format=XYTP" ! aedatmux compression=lz4-high ! aedatdemux ! fakesink
echo "aedatmux into a pipe"
timeout 60 "$GST_LAUNCH" -q videotestsrc is-live=true num-buffers=20 ! video/x-raw,format=GRAY8 ! tee name=t  t. ! queue ! eventsim-frame ! application/x-event-camera ! mux.  t. ! queue ! mux.  aedatmux name=mux ! fdsink | cat >live.aedat4
launch filesrc location=live.aedat4 ! identity ! aedatdemux ! fakesink

discover() { # FILE PATTERN
  echo "gst-discoverer-1.0 $1"
  timeout 60 gst-discoverer-1.0 -v "$1" >discovered
  grep -q "$2" discovered || {
    cat discovered
    fail "$1: $2"
  }
}
discover ball.aedat4 "container format: AEDAT 4.0"
discover ball.aedat4 "Duration: 0:00:01.9"
discover ball.aedat4 "Seekable: yes"
discover ball.aedat4 "application/x-event-camera, format=(string)XYTP, width=(int)320, height=(int)240"
discover ball.aedat4 "video/x-raw, format=(string)GRAY8, width=(int)320, height=(int)240"

echo "gst-play-1.0 ball.aedat4"
timeout 60 gst-play-1.0 -q --no-interactive --videosink=fakesink --start-position=1 ball.aedat4 >played 2>&1 || fail "gst-play-1.0: $(cat played)"

# Conversions of event files.
launch videotestsrc pattern=ball num-buffers=60 ! eventsim-diff ! evtenc format=EVT3 ! filesink location=out.raw
launch filesrc location=out.raw ! decodebin caps="application/x-event-camera,format=XYTP" ! aedatmux compression=zstd ! filesink location=out.aedat4
launch filesrc location=out.raw ! evtdec ! eventesenc ! filesink location=out.es
launch filesrc location=out.es ! eventesdec ! eventrender mode=decay accumulation-time=20000000 ! video/x-raw,framerate=60/1 ! videoconvert ! fakesink
launch filesrc location=out.raw ! decodebin ! eventhdf5sink format=metavision location=out.h5 && fail "pictures were written as events"
launch filesrc location=out.raw ! decodebin caps=application/x-event-camera ! eventhdf5sink format=metavision location=out.h5
launch filesrc location=out.h5 ! eventhdf5dec ! evtenc ! filesink location=again.raw
# Two files with different time origins, side by side.
launch filesrc location=out.aedat4 ! decodebin ! videoconvert ! mixer.  filesrc location=out.h5 ! decodebin ! videoconvert ! mixer.  compositor name=mixer sink_1::xpos=320 ! fakesink
davis=$SHARED_DATA/events/davis346-frames-events-imu.aedat4
[ ! -f "$davis" ] || launch filesrc location="$davis" ! aedatdemux name=d  d.events_0 ! queue ! eventrender ! videoconvert ! fakesink  d.video_0 ! queue ! eventsim-dense ! videoconvert ! fakesink

interrupt interrupted.h5 300000 videotestsrc is-live=true pattern=snow ! eventsim-frame ! eventhdf5sink compression=none location=interrupted.h5
launch filesrc location=interrupted.h5 ! eventhdf5dec ! filesink location=interrupted.xytp
[ "$(stat -c %s interrupted.xytp)" -gt 300000 ] || fail "events from before the interruption are lost"

refused() { # WORDS ARGUMENT...: fails, and says these words
  local words=$1
  shift
  echo "gst-launch-1.0 $*, refused"
  timeout 20 "$GST_LAUNCH" "$@" >refusal 2>&1 && fail "it was not refused"
  grep -qF "$words" refusal || fail "\"$words\" is not in: $(cat refusal)"
}

# Refused, with a reason.
refused "Cannot draw bytes" filesrc location=out.raw ! eventrender ! fakesink
for element in evtenc eventstats eventrender; do
  refused 'caps="application/x-event-camera,format=XYTP"' filesrc location=out.raw ! decodebin ! $element ! fakesink
  # gst-launch-1.0 prints only the error of a pipeline that fails while it starts; the log has the warning.
  GST_DEBUG=GST_ERROR_SYSTEM:4 refused 'caps="application/x-event-camera,format=XYTP"' filesrc location=out.raw ! queue ! decodebin ! $element ! fakesink
done
refused "Insert eventrender before elements that take video" filesrc location=out.raw ! evtdec ! videoconvert ! fakesink
refused "preset=davis999: choose one of standard, ideal, " videotestsrc ! eventsim-dvs preset=davis999 ! fakesink
refused "EVT words support sensors of 1x1 to 2048x2048 pixels" videotestsrc num-buffers=3 ! video/x-raw,width=2049,height=16 ! eventsim-frame ! evtenc ! fakesink
launch videotestsrc num-buffers=3 ! video/x-raw,width=2049,height=16 ! videoscale ! eventsim-frame ! evtenc ! fakesink

refused "Set width and height to match the sender" udpsrc port=0 ! eventdatagramdepay ! fakesink
refused "up to 1024x512 pixels" videotestsrc num-buffers=3 ! video/x-raw,width=1280,height=720 ! eventsim-frame ! eventdatagrampay format=jaer ! fakesink

# Other refusals.
timeout 5 "$GST_LAUNCH" -q filesrc location=ball-frame.xytp ! aedatdemux ! fakesink 2>refusal && fail "a file that is not AEDAT was read"
grep -q "this is not AEDAT" refusal || fail "the refusal does not name the format"
if "$GST_LAUNCH" -q videotestsrc num-buffers=2 ! video/x-raw,format=v210 ! eventsim-frame ! fakesink 2>refusal; then
  fail "v210 was accepted"
fi
grep -q "format=(string)v210" refusal || fail "the refusal does not name the format"
echo "all lines ran"
