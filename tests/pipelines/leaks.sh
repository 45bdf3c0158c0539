#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Pipelines leak no GStreamer objects when they fail or stop early. launch_lines.sh checks those that run to the end.
set -eu
log=$(mktemp)
trap 'rm -f "$log"' EXIT
export GST_TRACERS=leaks GST_DEBUG=GST_TRACER:7 GST_DEBUG_NO_COLOR=1 GST_DEBUG_FILE=$log

check() {
  echo "gst-launch-1.0 $*"
  local status seconds
  # At times, gst-launch-1.0 (1.22) waits forever after an error or the end before its main loop.
  for seconds in 2 2 4 8 20; do
    status=0
    timeout $seconds "$GST_LAUNCH" -q "$@" || status=$?
    [ $status -ne 124 ] && break
  done
  if [ $status -eq 124 ]; then
    echo "FAILED: does not end"
    exit 1
  fi
  if grep "object-alive, " "$log" | grep -v "new format string"; then
    echo "FAILED: leaked objects"
    exit 1
  fi
  grep -q "GST_TRACER" "$log" # the tracer was active
}

# Event files, read in part, and files of another kind.
work=$(mktemp -d)
trap 'rm -rf "$log" "$work"' EXIT
for pair in evtenc:evtdec eventdatenc:eventdatdec eventesenc:eventesdec eventcsvenc:eventcsvdec eventnpyenc:eventnpydec eventnpzenc:eventnpzdec eventmcapenc:eventmcapdemux; do
  file=$work/${pair%:*}
  check videotestsrc num-buffers=8 ! eventsim-frame ! "${pair%:*}" ! filesink location="$file"
  check filesrc location="$file" ! queue ! "${pair#*:}" ! fakesink num-buffers=1
  check filesrc location="$0" ! "${pair#*:}" ! fakesink
done
for layout in dsec metavision; do
  file=$work/$layout.h5
  check videotestsrc num-buffers=8 ! eventsim-frame ! eventhdf5sink format=$layout location="$file"
  check filesrc location="$file" ! queue ! eventhdf5dec ! fakesink num-buffers=1
  check filesrc location="$file" ! decodebin3 ! fakesink
  check filesrc location="$file" ! eventhdf5dec ! identity error-after=2 ! eventhdf5sink location="$file.out"
done
check filesrc location="$0" ! eventhdf5dec ! fakesink
check videotestsrc num-buffers=8 ! eventsim-frame ! eventhdf5sink location=/nowhere/at/all.h5
aedat=$work/aedat
video="videotestsrc num-buffers=30 ! video/x-raw,format=GRAY8,framerate=25/1"
# shellcheck disable=SC2086
check $video ! tee name=t  t. ! queue ! eventsim-frame ! application/x-event-camera ! mux.  t. ! queue ! mux.  aedatmux name=mux ! filesink location="$aedat"
check filesrc location="$aedat" ! queue max-size-bytes=1000 ! aedatdemux name=d  d.events_0 ! queue ! fakesink  d.video_0 ! queue ! fakesink
check eventmerge name=merge ! identity error-after=2 ! fakesink  videotestsrc num-buffers=8 ! eventsim-frame ! merge.  videotestsrc num-buffers=8 ! eventsim-diff ! merge.
check videotestsrc num-buffers=8 ! glupload ! gleventsim-frame ! identity error-after=2 ! fakesink
check videotestsrc num-buffers=8 ! eventsim-frame ! rtpeventpay max-latency=1000000000 ! rtpeventdepay ! fakesink num-buffers=1
for format in spif jaer; do
  pay="eventdatagrampay format=$format"
  depay="eventdatagramdepay format=$format width=320 height=240"
  # shellcheck disable=SC2086
  check videotestsrc num-buffers=8 ! eventsim-frame ! $pay ! identity error-after=2 ! $depay ! fakesink
done
check videotestsrc num-buffers=8 ! eventsim-frame ! eventdatagrampay ! eventdatagramdepay format=es width=20 height=20 ! fakesink
check videotestsrc num-buffers=8 ! video/x-raw,format=GRAY8 ! evtparse format=EVT3 width=320 height=240 ! fakesink
# Errors in mid-stream.
check videotestsrc num-buffers=8 ! eventsim-frame ! rtpeventpay ! rtpeventdepay ! identity error-after=2 ! fakesink
check videotestsrc num-buffers=8 ! eventsim-frame ! rtpeventpay mtu=30 ! fakesink
check filesrc location="$aedat" ! aedatdemux ! identity error-after=2 ! fakesink
check filesrc location="$aedat" ! aedatdemux ! identity error-after=2 ! aedatmux ! fakesink
check videotestsrc num-buffers=8 ! eventsim-frame ! eventrender ! identity error-after=2 ! fakesink
check videotestsrc num-buffers=8 ! identity error-after=4 ! eventsim-frame ! eventrender ! fakesink
for after in "fakesink" "identity error-after=2 ! fakesink"; do
  # shellcheck disable=SC2086
  check eventlabel name=label ! $after  videotestsrc num-buffers=8 ! eventsim-frame ! label.event_sink  videotestsrc num-buffers=8 ! video/x-raw,format=GRAY8 ! label.video_sink
  # shellcheck disable=SC2086
  check flowjoin name=join ! $after  videotestsrc num-buffers=8 ! join.video_sink  videotestsrc num-buffers=8 ! video/x-raw,format=GRAY8,width=2560 ! capssetter join=false replace=true caps=other/tensors,format=static,num_tensors=1,types=float32,dimensions=2:320:240:1 ! join.flow_sink
done
check videotestsrc num-buffers=8 ! tee name=t  t. ! queue ! videoconvert ! eventoverlay name=overlay ! identity error-after=2 ! fakesink  t. ! queue ! eventsim-frame ! overlay.event_sink
check videotestsrc num-buffers=8 ! eventsim-frame ! eventundistort location=/nowhere ! fakesink
# Bags of events and images.
/usr/bin/python3 "$SOURCE/tests/formats/bag_files.py" "$work"
for file in "$work"/evt3.{mcap,bag,db3}; do
  check filesrc location="$file" ! queue ! eventbagdemux name=d  d.events_0 ! queue ! fakesink  d.video_0 ! queue ! fakesink
  check filesrc location="$file" ! eventbagdemux ! fakesink num-buffers=1
done
check filesrc location="$0" ! eventbagdemux ! fakesink
check videotestsrc num-buffers=8 ! eventsim-frame ! identity error-after=2 ! fakesink
check videotestsrc num-buffers=8 ! identity error-after=4 ! eventsim-dense ! fakesink
