#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Lines that a user would type, run by gst-launch-1.0; none leaks a GStreamer object.
set -eu
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

# Accumulated events as video, to an encoder and back.
launch videotestsrc pattern=ball num-buffers=30 ! eventsim-diff ! videoconvert ! x264enc ! mp4mux ! filesink location=events.mp4
launch filesrc location=events.mp4 ! decodebin ! eventsim-dense flow=dis-hq ! videoconvert ! fakesink
[ -s events.mp4 ] || fail "no video was written"

# A tee, live sources, sinks with a clock, threads.
launch videotestsrc is-live=true num-buffers=20 ! tee name=t  t. ! queue ! eventsim-frame ! fakesink sync=true  t. ! queue ! eventsim-sparse ! videoconvert ! fakesink sync=true

# Upstreams without allocation queries, with videorate's copies, and with one frame only.
launch videotestsrc num-buffers=10 ! identity drop-allocation=true ! eventsim-dense ! fakesink
launch videotestsrc num-buffers=10 ! videorate ! video/x-raw,framerate=50/1 ! eventsim-diff ! fakesink
launch videotestsrc num-buffers=1 ! eventsim-sparse ! fakesink

# Labelled, measured, and compared with another simulator.
launch eventlabel name=label ! eventnpzenc ! filesink location=classes.npz  videotestsrc pattern=ball num-buffers=30 ! eventsim-dvs label=true ! label.event_sink  videotestsrc pattern=ball num-buffers=30 ! video/x-raw,format=GRAY8 ! label.video_sink
launch videotestsrc pattern=ball num-buffers=30 ! eventsim-dvs label=true ! eventdenoise ! eventstats location=stats.json map=map.png ! eventrender ! fakesink
launch videotestsrc is-live=true pattern=ball num-buffers=20 ! tee name=t  t. ! queue ! eventsim-dense ! compare.reference  t. ! queue ! eventsim-diff ! compare.candidate  eventcompare name=compare location=compare.json map=maps.png ! evtenc ! filesink location=candidate.raw
for file in classes.npz stats.json map.png compare.json maps.png; do [ -s $file ] || fail "$file is missing"; done
launch filesrc location=candidate.raw ! evtdec ! eventstats location=/dev/null interval=0 ! fakesink

# Merged: two recordings, and two live streams side by side.
launch videotestsrc pattern=ball num-buffers=10 ! eventsim-diff ! evtenc ! filesink location=ball.raw
launch eventmerge name=m ! evtenc ! filesink location=both.raw  filesrc location=candidate.raw ! evtdec ! m.sink_0  filesrc location=ball.raw ! evtdec ! m.sink_1
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

# Events and their frames in one file, and read back.
launch videotestsrc pattern=ball num-buffers=50 ! video/x-raw,format=GRAY8,framerate=25/1 ! tee name=t  t. ! queue ! eventsim-frame ! application/x-event-camera ! mux.  t. ! queue ! mux.  aedatmux name=mux compression=zstd ! filesink location=ball.aedat4
launch filesrc location=ball.aedat4 ! aedatdemux name=d  d.events_0 ! queue ! filesink location=ball.xytp  d.video_0 ! queue ! filesink location=ball.grey
[ "$(stat -c %s ball.grey)" -eq $((50 * 320 * 240)) ] || fail "not every frame came back"
launch filesrc location=ball.aedat4 ! aedatdemux name=d  d.video_0 ! queue ! eventsim-dense ! application/x-event-camera ! aedatmux ! filesink location=again.aedat4
echo "aedatmux into a pipe"
timeout 60 "$GST_LAUNCH" -q videotestsrc is-live=true num-buffers=20 ! video/x-raw,format=GRAY8 ! tee name=t  t. ! queue ! eventsim-frame ! application/x-event-camera ! mux.  t. ! queue ! mux.  aedatmux name=mux ! fdsink | cat >live.aedat4
launch filesrc location=live.aedat4 ! identity ! aedatdemux ! fakesink

davis=$SHARED_DATA/events/davis346-frames-events-imu.aedat4
[ ! -f "$davis" ] || launch filesrc location="$davis" ! aedatdemux name=d  d.events_0 ! queue ! eventrender ! videoconvert ! fakesink  d.video_0 ! queue ! eventsim-dense ! videoconvert ! fakesink

triggers=$SHARED_DATA/events/evt3-640x480-triggers.raw
[ ! -f "$triggers" ] || launch filesrc location="$triggers" ! evtdec ! eventcut edge=falling ! eventtensor ! fakesink

refused() { # WORDS ARGUMENT...: fails, and says these words
  local words=$1
  shift
  echo "gst-launch-1.0 $*, refused"
  timeout 20 "$GST_LAUNCH" "$@" >refusal 2>&1 && fail "it was not refused"
  grep -qF "$words" refusal || fail "\"$words\" is not in: $(cat refusal)"
}

# Refused, with a reason.
refused "Cannot draw bytes" filesrc location=candidate.raw ! eventrender ! fakesink
for element in evtenc eventstats eventrender; do
  refused 'caps="application/x-event-camera,format=XYTP"' filesrc location=candidate.raw ! decodebin ! $element ! fakesink
  # gst-launch-1.0 prints only the error of a pipeline that fails while it starts; the log has the warning.
  GST_DEBUG=GST_ERROR_SYSTEM:4 refused 'caps="application/x-event-camera,format=XYTP"' filesrc location=candidate.raw ! queue ! decodebin ! $element ! fakesink
done
refused "Insert eventrender before elements that take video" filesrc location=candidate.raw ! evtdec ! videoconvert ! fakesink
refused "Set width and height to match the sender" udpsrc port=0 ! eventdatagramdepay ! fakesink
echo "all lines ran"
